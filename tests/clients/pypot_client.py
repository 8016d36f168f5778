"""pypot's access to AX and MX servos. Arguments: port."""

import sys

from pypot.dynamixel.io import DxlIO
from pypot.dynamixel.io.abstract_io import DxlTimeoutError, _DxlAccess
from serving import Lost, serve

io = DxlIO(sys.argv[1], baudrate=1_000_000, timeout=0.4)


def guarded(operation):
    def run(*arguments):
        try:
            return operation(*arguments)
        except DxlTimeoutError as cause:
            raise Lost(str(cause)) from cause

    return run


def registers(model):
    """What it knows of a servo, one number each."""
    return [
        [c.name, c.address, c.length, c.access == _DxlAccess.readwrite, False]
        for c in DxlIO._AbstractDxlIO__controls
        if c.nb_elem == 1 and model in c.models and c.access != _DxlAccess.writeonly
    ]


def control(name):
    return next(c for c in DxlIO._AbstractDxlIO__controls if c.name == name)


def read(number, name):
    c = control(name)
    getter = c.getter_name or "get_" + name.replace(" ", "_")
    # `get_status_return_level` and the like are made of ones with a line before their name.
    getter = "_" + getter if hasattr(io, "_" + getter) else getter
    return int(getattr(io, getter)([number], convert=False)[0])


def write(number, name, value):
    c = control(name)
    setter = c.setter_name or "set_" + name.replace(" ", "_")
    setter = "_" + setter if hasattr(io, "_" + setter) else setter
    getattr(io, setter)({number: value}, convert=False)


def calls_of_two_writes(number, name, value):
    """What it calls of its serial port, in order."""
    calls = []
    for call in ("flushOutput", "write"):
        original = getattr(io._serial, call)

        def noted(*arguments, call=call, original=original):
            calls.append(call)
            return original(*arguments)

        setattr(io._serial, call, noted)
    write(number, name, value)
    write(number, name, value)
    return calls


def by_number(values):
    return {int(number): value for number, value in values.items()}


serve(
    {
        "registers": registers,
        "ping": guarded(lambda number: io.ping(number)),
        "scan": guarded(lambda numbers: io.scan(numbers)),
        "model": guarded(lambda numbers: io.get_model(numbers)),
        "read": guarded(read),
        "write": guarded(write),
        "calls_of_two_writes": calls_of_two_writes,
        "set_goal_position": guarded(lambda goals: io.set_goal_position(by_number(goals))),
        "get_present_position": guarded(lambda numbers: io.get_present_position(numbers)),
        "set_moving_speed": guarded(lambda speeds: io.set_moving_speed(by_number(speeds))),
        "set_pid_gain": guarded(lambda gains: io.set_pid_gain(by_number(gains))),
        "get_pid_gain": guarded(lambda numbers: io.get_pid_gain(numbers)),
        "set_angle_limit": guarded(lambda limits: io.set_angle_limit(by_number(limits))),
        "set_wheel_mode": guarded(lambda numbers: io.set_wheel_mode(numbers)),
        "set_joint_mode": guarded(lambda numbers: io.set_joint_mode(numbers)),
        "enable_torque": guarded(lambda numbers: io.enable_torque(numbers)),
        "disable_torque": guarded(lambda numbers: io.disable_torque(numbers)),
        "change_id": guarded(lambda numbers: io.change_id(by_number(numbers))),
        "get_control_table": guarded(lambda number: io.get_control_table([number])[0]),
    }
)
