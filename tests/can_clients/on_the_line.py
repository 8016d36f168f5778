"""Moves one actuator to half a radian with somebody else's package, through a slcan adapter.

Arguments: client, terminal. Prints a JSON object: where the client says the actuator stands, and
what else it read.
"""

import json
import sys
import time

import can

GOAL = 0.5
PATIENCE_S = 20.0


def adapter(terminal):
    return can.Bus(interface="slcan", channel=terminal, bitrate=1_000_000, sleep_after_open=0.1)


def until_there(step):
    """Calls `step`, which gives a position or none, until that stays at the goal."""
    end, position, there = time.monotonic() + PATIENCE_S, None, 0
    while time.monotonic() < end and there < 30:
        position = step() or position
        there = there + 1 if position is not None and abs(position - GOAL) <= 0.02 else 0
    return position


def damiao(terminal):
    from damiao_motor import DaMiaoController

    can.rc["bitrate"] = 1_000_000  # it leaves that to the system's settings
    controller = DaMiaoController(channel=terminal, bustype="slcan")
    motor = controller.add_motor(motor_id=1, feedback_id=0x11, motor_type="4310")
    motor.ensure_control_mode("MIT")
    range_rad = motor.get_register(21, timeout=5.0)
    motor.enable()

    def step():
        motor.send_cmd_mit(target_position=GOAL, stiffness=30.0, damping=1.0)
        time.sleep(0.01)
        return motor.get_states().get("pos")

    position = until_there(step)
    motor.disable()
    time.sleep(0.1)
    controller.shutdown()
    return {"position": position, "range": range_rad}


def robstride(terminal):
    from robstride_dynamics import Motor, ParameterType, RobstrideBus

    bus = RobstrideBus(terminal, {"a": Motor(0x7F, "rs-02")})
    bus.channel_handler = adapter(terminal)  # its connect() knows SocketCAN alone
    bus.enable("a")

    def step():
        bus.write_operation_frame("a", GOAL, 30.0, 1.0)
        return bus.read_operation_frame("a")[0]

    position = until_there(step)
    said = bus.read("a", ParameterType.MECHANICAL_POSITION)
    bus.disconnect()
    return {"position": position, "parameter": float(said)}


def cybergear(terminal):
    from CyberGearDriver import CyberGearMotor

    line = adapter(terminal)

    def send(theirs):
        line.send(
            can.Message(
                arbitration_id=theirs.arbitration_id, data=theirs.data, is_extended_id=True
            )
        )

    motor = CyberGearMotor(0x7F, send)
    notifier = can.Notifier(line, [motor.message_received])
    motor.enable()

    def step():
        motor.control(GOAL, 0.0, 0.0, 30.0, 1.0)
        return motor.state.get("position")

    position = until_there(step)
    motor.stop()
    time.sleep(0.1)
    notifier.stop()
    line.shutdown()
    return {"position": position}


CLIENTS = {"damiao": damiao, "robstride": robstride, "cybergear": cybergear}
out, sys.stdout = sys.stdout, sys.stderr
print(json.dumps(CLIENTS[sys.argv[1]](sys.argv[2])), file=out, flush=True)
