#!/usr/bin/env python3
"""Hands an inertial sensor of the Lab Streaming Layer on to Gaitway.

A stream of LSL (https://labstreaminglayer.org) becomes lines of Gaitway's profile `arduino-csv` behind a port of this
machine. The time of each sample is LSL's own, brought to this machine's clock. Needs PyPI's pylsl.

    python lsl_in.py "wrist" 7001                     waits for the stream, and for who connects
    gaitway record right_forearm=imu:arduino-csv@tcp:127.0.0.1:7001 -o wave.mcap

Channels are found by their labels: acc_x acc_y acc_z gyro_x gyro_y gyro_z, or those named by --channels, in this order. A
channel whose unit is g or deg/s is changed to m/s2 or rad/s; one without a unit is taken as it is.
"""

import argparse
import math
import socket
import sys

import pylsl

LABELS = "acc_x,acc_y,acc_z,gyro_x,gyro_y,gyro_z"
FACTORS = {
    "g": 9.80665,
    "deg/s": math.pi / 180,
    "degrees/s": math.pi / 180,
    "m/s2": 1.0,
    "m/s^2": 1.0,
    "rad/s": 1.0,
    "": 1.0,
}


def channels(info):
    """Labels and units of a stream, in its order."""
    found = []
    channel = info.desc().child("channels").child("channel")
    while not channel.empty():
        found.append((channel.child_value("label"), channel.child_value("unit")))
        channel = channel.next_sibling("channel")
    return found


def chosen(found, wanted):
    """Where the wanted channels are, and by what they are multiplied."""
    labels = [label for label, _ in found]
    picked = []
    for label in wanted:
        if label not in labels:
            sys.exit(f"the stream has no channel {label}\n  got      {', '.join(labels) or 'channels without labels'}"
                     "\n  to do    name six of them: --channels ax,ay,az,gx,gy,gz")
        at = labels.index(label)
        unit = found[at][1].strip().lower()
        if unit not in FACTORS:
            sys.exit(f"the unit of {label} is not known\n  got      {unit}\n  allowed  m/s2, g, rad/s, deg/s")
        picked.append((at, FACTORS[unit]))
    return picked


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("stream", help="name of the stream")
    parser.add_argument("port", type=int, help="port of 127.0.0.1 at which its lines are")
    parser.add_argument("--channels", default=LABELS, help=f"[default: {LABELS}]")
    asked = parser.parse_args()
    wanted = asked.channels.split(",")
    if len(wanted) != 6:
        sys.exit(f"six channels are wanted\n  got      {asked.channels}")
    server = socket.create_server(("127.0.0.1", asked.port))
    print(f"waiting for the stream {asked.stream}", file=sys.stderr)
    (stream,) = pylsl.resolve_byprop("name", asked.stream)
    inlet = pylsl.StreamInlet(stream, processing_flags=pylsl.proc_clocksync | pylsl.proc_monotonize)
    picked = chosen(channels(inlet.info()), wanted)
    inlet.open_stream()
    print(f"to go on: gaitway record NAME=imu:arduino-csv@tcp:127.0.0.1:{asked.port} -o FILE.mcap", file=sys.stderr)
    while True:
        reader, _ = server.accept()
        reader.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        inlet.flush()
        try:
            while True:
                rows, times_s = inlet.pull_chunk(timeout=1.0)
                lines = []
                for row, time_s in zip(rows, times_s):
                    ticks = round(time_s * 1e6) % 2**32
                    lines.append(",".join([str(ticks), *(f"{row[at] * factor:.9g}" for at, factor in picked)]))
                if lines:
                    reader.sendall(("\n".join(lines) + "\n").encode())
        except (BrokenPipeError, ConnectionResetError):
            reader.close()


try:
    main()
except KeyboardInterrupt:
    pass
