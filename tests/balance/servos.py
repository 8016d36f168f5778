"""Dynamixel Protocol 2.0 from the device's side, and what an XM430-W350 and OP3's OpenCR keep in their registers.

Written from ROBOTIS' e-Manual (protocol2, x/xm430-w350), the board by `firmware-profiles/boards`, as far as a program that plays a motion asks.
Nothing here knows what moves the joints: registers that are measured are asked for when they are read.
"""

BROADCAST = 0xFE
PING, READ, WRITE, REG_WRITE, ACTION, REBOOT, CLEAR = 0x01, 0x02, 0x03, 0x04, 0x05, 0x08, 0x10
SYNC_READ, SYNC_WRITE, FAST_SYNC_READ, BULK_READ, BULK_WRITE, FAST_BULK_READ = 0x82, 0x83, 0x8A, 0x92, 0x93, 0x9A
STATUS = 0x55
ERROR_INSTRUCTION, ERROR_RANGE, ERROR_LENGTH, ERROR_LIMIT, ERROR_ACCESS = 2, 4, 5, 6, 7
HEADER = b"\xff\xff\xfd\x00"


def _table():
    table = []
    for byte in range(256):
        rest = byte << 8
        for _ in range(8):
            rest = (rest << 1) ^ 0x8005 if rest & 0x8000 else rest << 1
        table.append(rest & 0xFFFF)
    return table


_CRC = _table()


def crc16(data, crc=0):
    for byte in data:
        crc = (crc << 8 & 0xFFFF) ^ _CRC[crc >> 8 ^ byte]
    return crc


def stuff(body):
    """An FD after each FF FF FD, so that no header is in it."""
    return body.replace(b"\xff\xff\xfd", b"\xff\xff\xfd\xfd")


def unstuff(body):
    return body.replace(b"\xff\xff\xfd\xfd", b"\xff\xff\xfd")


def packet(device, body):
    """A packet whose body begins with its instruction."""
    body = stuff(body)
    said = HEADER + bytes([device]) + (len(body) + 2).to_bytes(2, "little") + body
    return said + crc16(said).to_bytes(2, "little")


def status(device, error, params=b""):
    return packet(device, bytes([STATUS, error]) + params)


class Ear:
    """Instructions out of a stream of bytes; what is damaged is passed over."""

    def __init__(self):
        self.heard = b""
        self.damaged = 0

    def hear(self, data):
        self.heard += data
        while True:
            start = self.heard.find(HEADER)
            if start < 0:
                self.heard = self.heard[-3:]
                return
            self.heard = self.heard[start:]
            if len(self.heard) < 7:
                return
            total = 7 + int.from_bytes(self.heard[5:7], "little")
            if len(self.heard) < total:
                return
            whole = self.heard[:total]
            if total < 10 or crc16(whole[:-2]) != int.from_bytes(whole[-2:], "little"):
                self.damaged += 1
                self.heard = self.heard[4:]
                continue
            self.heard = self.heard[total:]
            body = unstuff(whole[7:-2])
            yield whole[4], body[0], body[1:]


class Device:
    """A control table behind an ID: what was written is there, what is measured is asked for."""

    # Address: bytes, value at power-up. What is at none of them reads 0.
    REGISTERS = {}
    MEASURED = {}
    WRITABLE = frozenset()
    STATUS_LEVEL = 68

    def __init__(self, device, measure):
        self.id, self.measure = device, measure
        self.memory = bytearray(1024)
        self.later = []
        for address, (size, value) in self.REGISTERS.items():
            self.put(address, size, value)

    def put(self, address, size, value):
        self.memory[address : address + size] = (value & (1 << 8 * size) - 1).to_bytes(size, "little")

    def get(self, address, size, signed=False):
        return int.from_bytes(self.memory[address : address + size], "little", signed=signed)

    def read(self, address, count):
        for at, size in self.MEASURED.items():
            if at < address + count and address < at + size:
                self.put(at, size, self.measure(self, at))
        return bytes(self.memory[address : address + count])

    def write(self, address, data):
        if address not in self.WRITABLE:
            return ERROR_ACCESS
        self.memory[address : address + len(data)] = data
        self.wrote(address, len(data))
        return 0

    def wrote(self, address, count):
        pass

    def level(self):
        return self.memory[self.STATUS_LEVEL]

    def answer(self, code, params):
        """Error and parameters of a status to an instruction to this device alone, or to all."""
        if code == PING:
            return 0, bytes(self.memory[0:2]) + bytes(self.memory[6:7])
        if code == READ and len(params) == 4:
            return 0, self.read(int.from_bytes(params[:2], "little"), int.from_bytes(params[2:], "little"))
        if code == WRITE and len(params) >= 3:
            return self.write(int.from_bytes(params[:2], "little"), params[2:]), b""
        if code == REG_WRITE and len(params) >= 3:
            self.later.append(params)
            return 0, b""
        if code == ACTION:
            for kept in self.later:
                self.write(int.from_bytes(kept[:2], "little"), kept[2:])
            self.later = []
            return 0, b""
        return ERROR_INSTRUCTION, b""


class Servo(Device):
    """XM430-W350 as an OP3 has it: 2 Mbit/s, position control."""

    TORQUE, GOAL, WATCHDOG = 64, 116, 98
    REGISTERS = {
        0: (2, 1020), 6: (1, 45), 8: (1, 4), 9: (1, 1), 10: (1, 0), 11: (1, 3), 12: (1, 255), 13: (1, 2), 20: (4, 0), 24: (4, 10),
        31: (1, 80), 32: (2, 160), 34: (2, 95), 36: (2, 885), 38: (2, 1193), 44: (4, 200), 48: (4, 4095), 52: (4, 0), 63: (1, 52),
        68: (1, 2), 76: (2, 1920), 78: (2, 100), 84: (2, 800), 100: (2, 885), 102: (2, 1193), 116: (4, 2048), 144: (2, 120), 146: (1, 30),
    }
    # Tick, moving, and from PWM to position.
    MEASURED = {120: 2, 122: 1, 124: 2, 126: 2, 128: 4, 132: 4}
    WRITABLE = frozenset(
        [8, 9, 10, 11, 12, 13, 20, 24, 31, 32, 34, 36, 38, 44, 48, 52, 60, 63, 64, 65, 68, 76, 78, 80, 82, 84, 88, 90, 98, 100, 102, 104]
        + [108, 112, 116]
    )

    def __init__(self, device, measure, moved):
        super().__init__(device, measure)
        self.memory[7] = device
        self.moved = moved

    def write(self, address, data):
        if address < 64 and self.memory[self.TORQUE]:
            return ERROR_ACCESS
        if address <= self.GOAL < address + len(data):
            goal = int.from_bytes(data[self.GOAL - address :][:4], "little", signed=True)
            if not self.get(52, 4) <= goal <= self.get(48, 4):
                return ERROR_LIMIT
        return super().write(address, data)

    def wrote(self, address, count):
        if address <= self.TORQUE < address + count or address <= self.GOAL < address + count:
            self.moved(self)


class Board(Device):
    """OpenCR with OP3's firmware: scales of open_cr_module.h."""

    GYRO_DEG_S, ACCELERATION_G = 2000 / 32800, 2 / 32768
    STATUS_LEVEL = 16
    REGISTERS = {0: (2, 29696), 2: (1, 2), 3: (1, 200), 4: (1, 4), 5: (1, 0), 16: (1, 2), 26: (2, 31), 31: (1, 120)}
    MEASURED = {at: 2 for at in range(32, 44, 2)}
    WRITABLE = frozenset([3, 4, 5, 16, 18, 20, 22, 24, 25, 26, 28, 50])

    def answer(self, code, params):
        if code == PING:
            return 0, bytes(self.memory[0:3])
        return super().answer(code, params)


class Bus:
    """Devices on one line. `hear` takes what the host sent and gives what comes back: a list of statuses, in their order."""

    def __init__(self, devices):
        self.devices = {device.id: device for device in devices}
        self.ear = Ear()

    def hear(self, data):
        for device, code, params in self.ear.hear(data):
            yield b"".join(self.obey(device, code, params))

    def obey(self, to, code, params):
        word = lambda at: int.from_bytes(params[at : at + 2], "little")
        if code in (SYNC_READ, FAST_SYNC_READ):
            asked = [(device, word(0), word(2)) for device in params[4:]]
            yield from self.several(asked, code == FAST_SYNC_READ)
        elif code in (BULK_READ, FAST_BULK_READ):
            asked = [(params[at], word(at + 1), word(at + 3)) for at in range(0, len(params) - 4, 5)]
            yield from self.several(asked, code == FAST_BULK_READ)
        elif code == SYNC_WRITE:
            address, size = word(0), word(2)
            for at in range(4, len(params) - size, 1 + size):
                if params[at] in self.devices:
                    self.devices[params[at]].write(address, params[at + 1 : at + 1 + size])
        elif code == BULK_WRITE:
            at = 0
            while at + 5 <= len(params):
                size = word(at + 3)
                if params[at] in self.devices:
                    self.devices[params[at]].write(word(at + 1), params[at + 5 : at + 5 + size])
                at += 5 + size
        elif code != STATUS:
            for device in self.devices.values():
                if to not in (device.id, BROADCAST):
                    continue
                error, answer = device.answer(code, params)
                least = {PING: 0, READ: 1}.get(code, 2)
                if device.level() >= least and (to != BROADCAST or code == PING):
                    yield status(device.id, error, answer)

    def several(self, asked, is_fast):
        there = [(self.devices[device], at, size) for device, at, size in asked if device in self.devices]
        if len(there) < len(asked):
            there = []  # who waits for a device before it that says nothing says nothing
        if not is_fast:
            for device, at, size in there:
                yield status(device.id, 0, device.read(at, size))
            return
        if not there:
            return
        # One status for all: error, ID, data and the CRC of all that was said so far, for each. Its length is known before its
        # bytes are, so that nothing in it is stuffed.
        length = 1 + sum(4 + size for _, _, size in there)
        said = HEADER + bytes([BROADCAST]) + length.to_bytes(2, "little") + bytes([STATUS])
        for device, at, size in there:
            said += bytes([0, device.id]) + device.read(at, size)
            said += crc16(said).to_bytes(2, "little")
        yield said
