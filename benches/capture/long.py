"""`gaitway record` of many sensors for long, in real time, while ports come and go and the host stands still: what share of a core it
takes, how much memory, how many MB an hour, and what it tells of losses beside what was lost.

    python3 benches/capture/long.py --gaitway target/release/gaitway            # fifteen sensors at 200 Hz, ten minutes
    python3 benches/capture/long.py --gaitway target/release/gaitway --for 30

The sensors are written here, from the maker's manual (Xsens, MTData2), so that it is known of each sample whether it was sent: the
profile says 100 Hz, they send 200. Each is a pseudo-terminal behind a link of its own. Some samples are lost on the way; now and then a
sensor is pulled out and plugged in again, while its clock and its counter go on; now and then the recording process is stopped
for a while. Sensors fall silent one second before the recording ends, so that what was sent last is heard. Needs Linux and Python 3.11.
Exit code 1: something was told that is not so.
"""

import argparse
import json
import math
import os
import pty
import random
import signal
import struct
import subprocess
import sys
import tempfile
import time
import tty
from pathlib import Path

TICK_S = 1e-4
# The sensor falls silent so long before it is pulled out: what it sent last is read by then.
LINGERS_S = 0.1


def packet(number: int, taken_s: float, phase: float) -> bytes:
    """MTData2: packet counter, sample time, acceleration, rate of turn; all bytes after the first add up to nothing."""
    turn = 3.0 * math.cos(math.tau * 0.5 * taken_s + phase)
    data = struct.pack(">HBH", 0x1020, 2, number & 0xFFFF)
    data += struct.pack(">HBI", 0x1060, 4, int(taken_s / TICK_S + 1e-6) & 0xFFFF_FFFF)
    data += struct.pack(">HB3f", 0x4020, 12, 0.1 * math.sin(taken_s), 0.0, 9.80665)
    data += struct.pack(">HB3f", 0x8020, 12, 0.0, 0.0, turn)
    body = struct.pack("BBB", 0xFF, 0x36, len(data)) + data
    return b"\xfa" + body + bytes([-sum(body) & 0xFF])


class Sensor:
    """One sensor behind a link, and what became of what it measured."""

    def __init__(self, link: Path, phase: float):
        self.link, self.phase = link, phase
        self.began = False
        self.sent = self.lost = self.pulled = 0
        self.since = 0  # lost since the last that was sent
        self.master = None
        self.plug()

    def plug(self):
        self.master, slave = pty.openpty()
        tty.setraw(slave)
        name = os.ttyname(slave)
        os.close(slave)
        os.set_blocking(self.master, False)
        fresh = self.link.with_suffix(".new")
        fresh.symlink_to(name)
        fresh.rename(self.link)

    def pull(self):
        os.close(self.master)
        self.master = None
        self.pulled += 1

    def listens(self):
        """Whoever opened it has said the command that begins."""
        try:
            self.began |= bool(os.read(self.master, 256))
        except OSError:
            pass
        return self.began

    def measure(self, number: int, taken_s: float, is_sent: bool):
        if is_sent and self.master is not None:
            bytes_ = packet(number, taken_s, self.phase)
            try:
                whole = os.write(self.master, bytes_) == len(bytes_)
            except OSError:
                whole = False
            if whole:
                self.sent += 1
                self.lost += self.since
                self.since = 0
                return
        self.since += 1


def times(pid: int) -> float:
    """What a process has taken of a core, s."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def resident_kb(pid: int) -> int:
    for line in Path(f"/proc/{pid}/status").read_text().splitlines():
        if line.startswith("VmRSS:"):
            return int(line.split()[1])
    return 0


def run(args, folder: Path) -> int:
    chance = random.Random(args.seed)
    sensors = [Sensor(folder / f"imu{n}", 0.3 * n) for n in range(args.sensors)]
    file = folder / "long.mcap"
    sources = [f"imu{n}=imu:xsens-mti@{sensor.link}" for n, sensor in enumerate(sensors)]
    command = [args.gaitway, "record", *sources, "--for", f"{args.seconds}s", "-o", str(file)]
    child = subprocess.Popen(
        [*command, "--json", "--quiet"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    try:
        return watched(args, chance, sensors, file, child)
    finally:
        if child.poll() is None:
            child.kill()


def watched(args, chance, sensors, file: Path, child) -> int:
    while not all([sensor.listens() for sensor in sensors]):
        if child.poll() is not None:
            print(child.stderr.read(), file=sys.stderr)
            return 2
        time.sleep(0.01)
    began = time.monotonic()
    taken_before_s, memory_kb, measured_s = times(child.pid), [], 0.0
    # Whom it befalls to be pulled out, when, and when it is plugged in again.
    out = {}
    next_pull_s, next_stall_s, next_look_s = args.unplug_every, args.stall_every, 1.0
    stopped_until_s = None
    quiet_s = args.seconds - 1.0
    number = stalls = 0
    while child.poll() is None:
        now_s = time.monotonic() - began
        if stopped_until_s is not None and now_s >= stopped_until_s:
            child.send_signal(signal.SIGCONT)
            stopped_until_s = None
        calm = quiet_s - now_s > 5.0
        if calm and stopped_until_s is None and now_s >= next_stall_s:
            child.send_signal(signal.SIGSTOP)
            stopped_until_s, next_stall_s, stalls = now_s + args.stall, now_s + args.stall_every, stalls + 1
        if calm and now_s >= next_pull_s:
            at = chance.randrange(len(sensors))
            next_pull_s = now_s + args.unplug_every
            out.setdefault(at, (now_s + LINGERS_S + args.stall, now_s + args.unplug + args.stall))
        for at, (gone_s, back_s) in list(out.items()):
            if sensors[at].master is not None and now_s >= gone_s and stopped_until_s is None:
                sensors[at].pull()
            elif sensors[at].master is None and now_s >= back_s:
                sensors[at].plug()
                sensors[at].began = False
                del out[at]
        if now_s >= next_look_s and now_s < quiet_s:
            next_look_s += 1.0
            memory_kb.append(resident_kb(child.pid))
            measured_s, taken_s = now_s, times(child.pid) - taken_before_s
        while number / args.rate <= min(now_s, quiet_s):
            is_last = (number + 1) / args.rate > quiet_s
            for at, sensor in enumerate(sensors):
                heard = sensor.master is not None and sensor.listens() and at not in out
                is_lost = number > 0 and not is_last and chance.random() < args.loss
                sensor.measure(number, number / args.rate, heard and not is_lost)
            number += 1
        time.sleep(0.5 / args.rate)
    said, remarks = child.communicate()
    report = json.loads(said)
    told = {source["name"]: source for source in report["sources"]}
    print(f"{args.sensors} sensors at {args.rate:.0f} Hz for {report['duration_s']:.1f} s, {stalls} stalls of {args.stall} s")
    print(f"  share of a core    {100 * taken_s / measured_s:.2f} %")
    middle = memory_kb[len(memory_kb) // 2]
    print(f"  memory             {memory_kb[0] / 1024:.1f} MiB after 1 s, {middle / 1024:.1f} in the middle, {max(memory_kb) / 1024:.1f} at most")
    print(f"  disk               {file.stat().st_size / 1e6 / quiet_s * 3600:.0f} MB an hour")
    wrong = 0
    for n, sensor in enumerate(sensors):
        of = told[f"imu{n}"]
        counts = of["counts"]
        # In the order of: heard, lost, pulled out, and what is never right.
        so = (sensor.sent, sensor.lost, sensor.pulled, 0, 0, 0)
        says = (counts["samples"], counts["missed"], of["gone"], counts["resets"], counts["misread"], of["bad_packets"])
        wrong += so != says
        mark = "" if so == says else f"   <- told: {says}"
        print(f"  imu{n:<3} {so[0]} heard, {so[1]} lost, pulled out {so[2]} times, {of.get('rate_hz') or 0:.2f} Hz{mark}")
    print(f"  told as it was: {len(sensors) - wrong} of {len(sensors)}; outcome {report['outcome']}, dropped {report['dropped']}")
    if remarks.strip() and args.verbose:
        print(remarks, file=sys.stderr)
    return 1 if wrong or report["dropped"] else 0


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--gaitway", default="target/release/gaitway", help="the program")
    parser.add_argument("--for", dest="seconds", type=float, default=600.0, help="how long, s")
    parser.add_argument("--sensors", type=int, default=15)
    parser.add_argument("--rate", type=float, default=200.0, help="Hz")
    parser.add_argument("--loss", type=float, default=0.002, help="part of the samples that are lost")
    parser.add_argument("--unplug-every", type=float, default=20.0, help="s")
    parser.add_argument("--unplug", type=float, default=2.0, help="for how long, s")
    parser.add_argument("--stall-every", type=float, default=7.0, help="s")
    parser.add_argument("--stall", type=float, default=0.3, help="for how long, s")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--verbose", action="store_true", help="what the recording said")
    args = parser.parse_args()
    if args.seconds < 10.0:
        parser.error("--for: at least 10 s, so that something is lost and something is seen")
    with tempfile.TemporaryDirectory(prefix="gaitway-long-") as folder:
        return run(args, Path(folder))


if __name__ == "__main__":
    sys.exit(main())
