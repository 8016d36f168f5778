"""Moves one virtual actuator through a USB-CAN adapter, as its user would: FAMILY PORT."""

import asyncio
import os
import struct
import sys
import time

# damiao-motor names no bit rate; python-can takes this one then.
os.environ["CAN_BITRATE"] = "1000000"

import can

# Radians; an ODrive and a moteus count in turns.
GOAL = 0.5
TURN = 6.283185307179586
# Real time: a machine that stands still for a while must not fail this.
PATIENCE_S = 20


def adapter(port):
    return can.Bus(interface="slcan", channel=port, bitrate=1_000_000, sleep_after_open=0)


def tell(bus, number, payload):
    bus.send(can.Message(arbitration_id=number, data=payload, is_extended_id=False))


def until_there(step, position):
    """Steps, and reads, until the position is the goal."""
    end = time.monotonic() + PATIENCE_S
    while time.monotonic() < end:
        step()
        here = position()
        if here is not None and abs(here - GOAL) < 0.01:
            return
        time.sleep(0.005)
    sys.exit("it never arrived")


def damiao(port):
    from damiao_motor import DaMiaoController

    controller = DaMiaoController(channel=port, bustype="slcan")
    motor = controller.add_motor(motor_id=1, feedback_id=0x11, motor_type="4310")
    motor.ensure_control_mode("MIT")
    assert abs(motor.get_register(21) - 12.5) < 1e-6
    motor.enable()
    until_there(
        lambda: motor.send_cmd_mit(target_position=GOAL, stiffness=20.0, damping=1.0),
        lambda: motor.get_states().get("pos"),
    )
    motor.disable()
    controller.shutdown()


def cubemars(port):
    def steps(value, low, high, bits):
        return int((value - low) * ((1 << bits) - 1) / (high - low))

    # AK80-9 in MIT mode: the ranges of TMotorCANControl.
    packed = steps(GOAL, -12.5, 12.5, 16) << 48 | steps(0, -50, 50, 12) << 36
    packed |= steps(20, 0, 500, 12) << 24 | steps(1, 0, 5, 12) << 12 | steps(0, -18, 18, 12)
    order = b"\xff" * 7
    with adapter(port) as bus:
        tell(bus, 3, order + b"\xfc")

        def position():
            answer = bus.recv(0.5)
            if answer is None:
                return None
            assert (answer.arbitration_id, answer.data[0]) == (0, 3)
            return struct.unpack(">H", answer.data[1:3])[0] * 25 / 65535 - 12.5

        until_there(lambda: tell(bus, 3, packed.to_bytes(8, "big")), position)
        tell(bus, 3, order + b"\xfd")


def odrive(port):
    node = 5 << 5
    with adapter(port) as bus:
        assert bus.get_version(2) == (10, 13)
        tell(bus, node | 0x0B, struct.pack("<II", 3, 1))
        tell(bus, node | 0x07, struct.pack("<I", 8))

        def position():
            heard = bus.recv(0.5)
            if heard is None or heard.arbitration_id != node | 0x09:
                return None
            return struct.unpack("<f", heard.data[:4])[0] * TURN

        # The firmware answers a remote request of its bus voltage.
        bus.send(
            can.Message(
                arbitration_id=node | 0x17, is_remote_frame=True, dlc=8, is_extended_id=False
            )
        )
        while (heard := bus.recv(PATIENCE_S)).arbitration_id != node | 0x17:
            pass
        assert struct.unpack("<f", heard.data[:4])[0] == 24.0
        until_there(
            lambda: tell(bus, node | 0x0C, struct.pack("<fhh", GOAL / TURN, 0, 0)), position
        )
        tell(bus, node | 0x07, struct.pack("<I", 1))


async def moteus(port):
    import moteus

    # The frames for CAN FD are CANable's addition to slcan.
    rates = {"nom_bitrate": 1_000_000, "data_bitrate": 5_000_000}
    points = {"nom_sample_point": 80, "data_sample_point": 80}
    timing = can.BitTimingFd.from_sample_point(f_clock=80_000_000, **rates, **points)
    transport = moteus.PythonCan(
        interface="slcan", channel=port, timing=timing, sleep_after_open=0
    )
    controller = moteus.Controller(id=7, transport=transport)
    await controller.set_stop()
    end = time.monotonic() + PATIENCE_S
    while time.monotonic() < end:
        state = await controller.set_position(
            position=GOAL / TURN, velocity=0, watchdog_timeout=5, query=True
        )
        if abs(state.values[moteus.Register.POSITION] * TURN - GOAL) < 0.01:
            assert state.values[moteus.Register.MODE] == moteus.Mode.POSITION
            await controller.set_stop()
            return
    sys.exit("it never arrived")


family, port = sys.argv[1:]
if family == "moteus":
    asyncio.run(asyncio.wait_for(moteus(port), 2 * PATIENCE_S))
else:
    {"damiao": damiao, "cubemars": cubemars, "odrive": odrive}[family](port)
# python-can ends its threads in its own time.
sys.stdout.flush()
os._exit(0)
