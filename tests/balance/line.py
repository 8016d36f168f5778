"""A pseudo-terminal with a robot behind it, for runs of a program that opens it.

The program's clock is that of `clock.c`, and what it sends and hears comes through a socket, with its times; the terminal is only opened
and set up.
"""

import os
import socket
import struct
import subprocess
import tempfile
import tty

BYTE_S = 10 / 2e6
START_NS = 1_000_000_000


def opened():
    there, here = os.openpty()
    tty.setraw(here)
    return there, here, os.ttyname(here)


class Program:
    """A program that has planned its motion and waits at its line; each run is one of a copy of it, by the clock of `clock.c`."""

    def __init__(self, command, clock, folder):
        self.ends = opened()
        self.door = os.path.join(folder, f"door-{os.getpid()}-{id(self)}")
        self.listener = socket.socket(socket.AF_UNIX)
        self.listener.bind(self.door)
        self.listener.listen(1)
        self.listener.settimeout(1)
        self.said = tempfile.TemporaryFile()
        environment = dict(os.environ, LD_PRELOAD=clock, BALANCE_TTY=self.ends[2], BALANCE_SOCKET=self.door)
        self.process = subprocess.Popen(command(self.ends[2]), env=environment, stdout=self.said, stderr=subprocess.STDOUT)

    def run(self, world, after_s=1.0, answer_s=0.0005):
        """Plays once, and the world goes on a second longer; what the program printed. Statuses come `answer_s` late."""
        while True:
            try:
                peer, _ = self.listener.accept()
                break
            except TimeoutError:
                if self.process.poll() is not None:
                    self.said.seek(0)
                    raise RuntimeError(self.said.read().decode()[-2000:]) from None
        with tempfile.NamedTemporaryFile() as out:
            name = out.name.encode()
            with peer:
                peer.sendall(bytes([len(name)]) + name)
                serve(world, peer, answer_s)
            world.advance(world.now_s + after_s)
            return out.read()

    def close(self):
        self.listener.close()
        os.unlink(self.door)
        self.process.kill()
        self.process.wait()
        self.said.close()
        for end in self.ends[:2]:
            os.close(end)


def serve(world, peer, answer_s):
    stream = peer.makefile("rwb", buffering=0)
    answers = []  # when, bytes
    free_s = 0.0

    def take(count):
        data = b""
        while len(data) < count:
            more = stream.read(count - len(data))
            if not more:
                return None
            data += more
        return data

    while head := take(21):
        op, now_ns, until_ns, count = struct.unpack("<cQQI", head)
        now_s = (now_ns - START_NS) * 1e-9
        if op == b"W":
            data = take(count)
            # The line says one thing after the other.
            heard_s = max(now_s, free_s) + count * BYTE_S
            world.advance(heard_s)
            for said in world.bus.hear(data):
                heard_s = heard_s + len(said) * BYTE_S
                if said:
                    answers.append((heard_s + answer_s, said))
            free_s = heard_s
            continue
        until_s = (until_ns - START_NS) * 1e-9
        if answers and answers[0][0] <= max(until_s, now_s):
            at_s, data = answers.pop(0)
        else:
            at_s, data = until_s, b""
        world.advance(max(now_s, at_s))
        stream.write(struct.pack("<QI", max(now_ns, START_NS + int(at_s * 1e9 + 0.5)), len(data)) + data)
