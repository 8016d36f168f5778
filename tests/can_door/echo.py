"""Sends every CAN frame back that it hears through a slcan adapter: PORT COUNT."""

import sys

import can

port, count = sys.argv[1], int(sys.argv[2])
with can.Bus(interface="slcan", channel=port, bitrate=1_000_000, sleep_after_open=0) as bus:
    for _ in range(count):
        message = bus.recv(30)
        assert message is not None, "nothing was heard"
        bus.send(message)
