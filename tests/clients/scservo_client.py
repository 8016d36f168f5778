"""FEETECH's SDK for Python as two packages: one module name, two sets of arguments.

Arguments: port, bits per second, package, family (sts or scs).
"""

import os
import sys

package, family = sys.argv[3:5]
if package == "feetech-servo-sdk":
    sys.path.insert(0, os.environ["GAITWAY_BESIDE"])

import scservo_sdk as sdk  # noqa: E402: which one it is was decided above
from serving import Lost, serve  # noqa: E402

# The setting for a slow adapter: at least this many milliseconds are waited for a status.
sdk.port_handler.LATENCY_TIMER = 200
port = sdk.PortHandler(sys.argv[1])
assert port.setBaudRate(int(sys.argv[2]))
if package == "feetech-servo-sdk":
    packets, before = sdk.PacketHandler(0 if family == "sts" else 1), (port,)
else:
    packets, before = (sdk.sms_sts if family == "sts" else sdk.scscl)(port), ()


def call(name, *arguments):
    return getattr(packets, name)(*before, *arguments)


def judge(result, error=0):
    if result == sdk.COMM_RX_TIMEOUT:
        raise Lost(packets.getTxRxResult(result))
    if result != sdk.COMM_SUCCESS:
        raise RuntimeError(packets.getTxRxResult(result))
    if error:
        raise RuntimeError(f"error {error} {packets.getRxPacketError(error)}")


def value_of(name):
    """An operation whose value comes first, or values, then how it went."""

    def operation(*arguments):
        *seen, result, error = call(name, *arguments)
        judge(result, error)
        return seen[0] if len(seen) == 1 else seen

    return operation


def done(name):
    """An operation that only says how it went."""
    return lambda *arguments: judge(*call(name, *arguments))


def read(number, address, size):
    return value_of(f"read{size}ByteTxRx")(number, address)


def read_with_error(number, address, size):
    data, result, error = call("readTxRx", number, address, size)
    judge(result)
    return [list(data), error]


def write(number, address, size, value):
    judge(*call(f"write{size}ByteTxRx", number, address, value))


def write_unanswered(number, address, size, value):
    judge(call(f"write{size}ByteTxOnly", number, address, value))


def reg_write(number, address, data):
    judge(*call("regWriteTxRx", number, address, len(data), data))


def action(number):
    judge(call("action", number))


def sync_read(numbers, address, size):
    group = sdk.GroupSyncRead(*before, packets, address, size)
    for number in numbers:
        assert group.addParam(number)
    judge(group.txRxPacket())
    for number in numbers:
        available = group.isAvailable(number, address, size)
        assert available[0] if isinstance(available, tuple) else available, number
    return [group.getData(number, address, size) for number in numbers]


def sync_write(address, entries):
    group = sdk.GroupSyncWrite(*before, packets, address, len(entries[0][1]))
    for number, data in entries:
        assert group.addParam(number, data)
    judge(group.txPacket())


def sync_write_positions(goals):
    add = packets.SyncWritePosEx if family == "sts" else packets.SyncWritePos
    for goal in goals:
        assert add(*goal)
    judge(packets.groupSyncWrite.txPacket())
    packets.groupSyncWrite.clearParam()


operations = {
    "ping": value_of("ping"),
    "read": read,
    "read_with_error": read_with_error,
    "write": write,
    "write_unanswered": write_unanswered,
    "reg_write": reg_write,
    "action": action,
    "sync_read": sync_read,
    "sync_write": sync_write,
    "sync_write_positions": sync_write_positions,
    "RegAction": lambda: judge(call("RegAction")),
}
for name in ("ReadPos", "ReadSpeed", "ReadPosSpeed", "ReadMoving"):
    operations[name] = value_of(name)
for name in (
    ("WritePosEx", "RegWritePosEx", "WheelMode", "WriteSpec")
    if family == "sts"
    else ("WritePos", "RegWritePos", "PWMMode", "WritePWM")
) + ("LockEprom", "unLockEprom"):
    operations[name] = done(name)

serve(operations)
