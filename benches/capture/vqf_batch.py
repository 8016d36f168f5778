"""The authors' C++ VQF over a recording, all outputs, best of five: ns per sample.

The one argument is a file of little-endian doubles: rate x, y, z, specific force x, y, z, at 200 Hz.
"""
import sys
import time
import numpy as np
import vqf

rows = np.fromfile(sys.argv[1], "<f8").reshape(-1, 6)
gyr, acc = (np.ascontiguousarray(rows[:, at : at + 3]) for at in (0, 3))
mag = np.ascontiguousarray(np.tile([0.0, 20e-6, -44e-6], (len(rows), 1)))
for name, args in (("six axes", (gyr, acc)), ("nine axes", (gyr, acc, mag))):
    best = float("inf")
    for _ in range(5):
        began = time.perf_counter()
        vqf.VQF(1 / 200.0).updateBatch(*args)
        best = min(best, time.perf_counter() - began)
    print(f"  C++ VQF, {name}: {best / len(rows) * 1e9:.0f} ns")
