"""Times control cycles with ROBOTIS DynamixelSDK and prints mean and 99th percentile in us.

Arguments: port, bits per second, protocol (1 or 2), read (sync, fast, bulk), servos (IDs 1 to N),
goal address, goal bytes, state address, state bytes, cycles to warm up, cycles.
"""

import sys
import time

import dynamixel_sdk as sdk

port_name, bps, protocol, read = sys.argv[1:5]
servos, goal, goal_bytes, state, state_bytes, warm_up, cycles = map(int, sys.argv[5:12])

port = sdk.PortHandler(port_name)
assert port.setBaudRate(int(bps))
packets = sdk.PacketHandler(float(protocol))
ids = range(1, servos + 1)

if read == "bulk":
    reader = sdk.GroupBulkRead(port, packets)
    for number in ids:
        assert reader.addParam(number, state, state_bytes)
else:
    reader = sdk.GroupSyncRead(port, packets, state, state_bytes)
    for number in ids:
        assert reader.addParam(number)
ask = reader.fastSyncRead if read == "fast" else reader.txRxPacket
writer = sdk.GroupSyncWrite(port, packets, goal, goal_bytes)
goal_data = list((2048).to_bytes(goal_bytes, "little"))


def cycle():
    result = ask()
    assert result == sdk.COMM_SUCCESS, packets.getTxRxResult(result)
    writer.clearParam()
    for number in ids:
        assert writer.addParam(number, goal_data)
    result = writer.txPacket()
    assert result == sdk.COMM_SUCCESS, packets.getTxRxResult(result)


for _ in range(warm_up):
    cycle()
times = []
for _ in range(cycles):
    began = time.perf_counter()
    cycle()
    times.append((time.perf_counter() - began) * 1e6)
times.sort()
print(sum(times) / len(times), times[len(times) * 99 // 100])
