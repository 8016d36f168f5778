"""LeRobot's motor buses. Arguments: port, feetech or dynamixel, then name:id:model of each motor."""

import sys

import lerobot_alone  # noqa: F401
from lerobot.motors import Motor, MotorCalibration, MotorNormMode
from lerobot.motors.dynamixel import DynamixelMotorsBus
from lerobot.motors.feetech import FeetechMotorsBus
from serving import Lost, serve

motors = {}
for motor in sys.argv[3:]:
    name, number, model = motor.split(":")
    motors[name] = Motor(int(number), model, MotorNormMode.RANGE_M100_100)
kind = {"feetech": FeetechMotorsBus, "dynamixel": DynamixelMotorsBus}[sys.argv[2]]
bus = kind(sys.argv[1], motors)
RETRIES = 3


def guarded(operation):
    def run(*arguments):
        try:
            return operation(*arguments)
        except ConnectionError as cause:
            if "no status packet" in str(cause):
                raise Lost(str(cause)) from cause
            raise

    return run


def write_calibration(ranges):
    bus.write_calibration(
        {
            name: MotorCalibration(motors[name].id, 0, offset, low, high)
            for name, (offset, low, high) in ranges.items()
        }
    )


serve(
    {
        "connect": guarded(lambda: bus.connect(handshake=True)),
        "ping": guarded(lambda name: bus.ping(name, num_retry=RETRIES)),
        "broadcast_ping": guarded(
            lambda: {str(n): m for n, m in (bus.broadcast_ping(num_retry=RETRIES) or {}).items()}
        ),
        "read": guarded(
            lambda what, name: bus.read(what, name, normalize=False, num_retry=RETRIES)
        ),
        "write": guarded(
            lambda what, name, value: bus.write(
                what, name, value, normalize=False, num_retry=RETRIES
            )
        ),
        "sync_read": guarded(
            lambda what: bus.sync_read(what, normalize=False, num_retry=RETRIES)
        ),
        "sync_write": guarded(
            lambda what, values: bus.sync_write(what, values, normalize=False, num_retry=RETRIES)
        ),
        "enable_torque": guarded(lambda: bus.enable_torque(num_retry=RETRIES)),
        "disable_torque": guarded(lambda: bus.disable_torque(num_retry=RETRIES)),
        "configure_motors": guarded(bus.configure_motors),
        "set_half_turn_homings": guarded(lambda: bus.set_half_turn_homings()),
        "write_calibration": guarded(write_calibration),
        "is_calibrated": guarded(lambda: bus.is_calibrated),
        "sync_read_normalized": guarded(
            lambda what: bus.sync_read(what, num_retry=RETRIES)
        ),
    }
)
