"""The authors' C++ VQF over a minute at 200 Hz, all outputs, best of five: ns per sample."""
import time
import numpy as np
import vqf

rate_hz, count = 200.0, 12001
t = np.arange(count) / rate_hz
noise = np.random.default_rng(0)
gyr = np.stack([np.sin(2.1 * t), np.cos(1.3 * t), np.sin(0.7 * t)], 1)
gyr = np.ascontiguousarray(gyr + noise.normal(0, 0.002, gyr.shape))
acc = np.ascontiguousarray(np.tile([0.0, 0.0, 9.81], (count, 1)) + noise.normal(0, 0.03, gyr.shape))
mag = np.ascontiguousarray(np.tile([0.0, 20.0, -44.0], (count, 1)))
for name, args in (("six axes", (gyr, acc)), ("nine axes", (gyr, acc, mag))):
    best = float("inf")
    for _ in range(5):
        began = time.perf_counter()
        vqf.VQF(1 / rate_hz).updateBatch(*args)
        best = min(best, time.perf_counter() - began)
    print(f"  C++ VQF, {name}: {best / count * 1e9:.0f} ns")
