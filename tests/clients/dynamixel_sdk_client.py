"""ROBOTIS DynamixelSDK. Arguments: port, bits per second, protocol (1 or 2)."""

import sys

import dynamixel_sdk as sdk
from serving import Lost, serve

# The setting for a slow adapter: twice this many milliseconds are waited for a status.
sdk.port_handler.LATENCY_TIMER = 200
port = sdk.PortHandler(sys.argv[1])
assert port.setBaudRate(int(sys.argv[2]))
packets = sdk.PacketHandler(float(sys.argv[3]))


def judge(result, error=0):
    if result == sdk.COMM_RX_TIMEOUT:
        raise Lost(packets.getTxRxResult(result))
    if result != sdk.COMM_SUCCESS:
        raise RuntimeError(packets.getTxRxResult(result))
    if error:
        raise RuntimeError(f"error {error} {packets.getRxPacketError(error)}")


def ping(number):
    model, result, error = packets.ping(port, number)
    judge(result, error)
    return model


def broadcast_ping():
    found, result = packets.broadcastPing(port)
    judge(result)
    return {str(number): seen for number, seen in found.items()}


def read(number, address, size):
    one = {1: packets.read1ByteTxRx, 2: packets.read2ByteTxRx, 4: packets.read4ByteTxRx}
    value, result, error = one[size](port, number, address)
    judge(result, error)
    return value


def read_with_error(number, address, size):
    data, result, error = packets.readTxRx(port, number, address, size)
    judge(result)
    return [list(data), error]


def write(number, address, size, value):
    one = {1: packets.write1ByteTxRx, 2: packets.write2ByteTxRx, 4: packets.write4ByteTxRx}
    judge(*one[size](port, number, address, value))


def write_unanswered(number, address, size, value):
    one = {1: packets.write1ByteTxOnly, 2: packets.write2ByteTxOnly, 4: packets.write4ByteTxOnly}
    judge(one[size](port, number, address, value))


def little_endian(value, size):
    return list((value % 256**size).to_bytes(size, "little"))


def reg_write(number, address, size, value):
    judge(*packets.regWriteTxRx(port, number, address, size, little_endian(value, size)))


def action(number):
    judge(packets.action(port, number))


def reboot(number):
    judge(*packets.reboot(port, number))


def factory_reset(number, *option):
    judge(*packets.factoryReset(port, number, *option))


def clear_multi_turn(number):
    judge(*packets.clearMultiTurn(port, number))


def many(group, method, asked):
    judge(getattr(group, method)())
    for number, address, size in asked:
        assert group.isAvailable(number, address, size)
    return [group.getData(number, address, size) for number, address, size in asked]


def sync(method):
    def read(numbers, address, size):
        group = sdk.GroupSyncRead(port, packets, address, size)
        for number in numbers:
            assert group.addParam(number)
        return many(group, method, [(number, address, size) for number in numbers])

    return read


def bulk(method):
    def read(asked):
        group = sdk.GroupBulkRead(port, packets)
        for number, address, size in asked:
            assert group.addParam(number, address, size)
        return many(group, method, asked)

    return read


def bulk_read_by_hand(asked):
    """The same instruction below the group's class."""
    parameters = [part for number, address, size in asked for part in (size, number, address)]
    judge(packets.bulkReadTx(port, parameters, len(parameters)))
    seen = []
    for number, _, size in asked:
        data, result, error = packets.readRx(port, number, size)
        judge(result, error)
        seen.append(int.from_bytes(bytes(data), "little"))
    return seen


def sync_write(address, size, goals):
    group = sdk.GroupSyncWrite(port, packets, address, size)
    for number, value in goals:
        assert group.addParam(number, little_endian(value, size))
    judge(group.txPacket())


def bulk_write(goals):
    group = sdk.GroupBulkWrite(port, packets)
    for number, address, size, value in goals:
        assert group.addParam(number, address, size, little_endian(value, size))
    judge(group.txPacket())


serve(
    {
        "ping": ping,
        "broadcast_ping": broadcast_ping,
        "read": read,
        "read_with_error": read_with_error,
        "write": write,
        "write_unanswered": write_unanswered,
        "reg_write": reg_write,
        "action": action,
        "reboot": reboot,
        "factory_reset": factory_reset,
        "clear_multi_turn": clear_multi_turn,
        "sync_read": sync("txRxPacket"),
        "fast_sync_read": sync("fastSyncRead"),
        "bulk_read": bulk("txRxPacket"),
        "bulk_read_by_hand": bulk_read_by_hand,
        "fast_bulk_read": bulk("fastBulkRead"),
        "sync_write": sync_write,
        "bulk_write": bulk_write,
    }
)
