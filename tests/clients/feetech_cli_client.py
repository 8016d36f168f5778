"""feetech-cli: its command line, its controller and the packets below. Arguments: port, family."""

import contextlib
import io
import sys

from feetech_cli import cli
from feetech_cli.controller import FeetechServoController
from feetech_cli.protocol import FeetechTimeoutError, describe_error
from feetech_cli.registers import CONTROL_TABLE
from serving import Lost, serve

address, family = sys.argv[1:3]
controller = None


def connect():
    global controller
    controller = FeetechServoController(
        address, 1_000_000, timeout=0.2, little_endian=family == "sts", max_id=3
    )
    return controller.open()


def disconnect():
    controller.close()


def command(*arguments):
    """A command as a user types it: its exit code and what it prints."""
    said = io.StringIO()
    connection = ["-p", address, "-b", "1000000", "--timeout", "0.2", "--max-id", "3"]
    family_flag = [] if family == "sts" else ["--scs"]
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
        code = cli.main([*connection, *family_flag, *arguments])
    return [code, said.getvalue()]


def of_controller(name):
    def operation(*arguments):
        try:
            return getattr(controller, name)(*arguments)
        except FeetechTimeoutError as cause:
            raise Lost(str(cause)) from cause

    return operation


def sync_read(numbers, start, size):
    seen = of_controller("sync_read")(numbers, start, size)
    return {str(number): [error, list(data)] for number, (error, data) in seen.items()}


def reg_write(number, start, data):
    controller.packet_handler.txrx(number, 4, [start, *data])


def action(number):
    if number == 254:
        controller.packet_handler.txonly(number, 5)
    else:
        controller.packet_handler.txrx(number, 5)


def registers():
    return [
        [name, register.address, register.size, register.writable, register.sign_bit is not None]
        for name, register in CONTROL_TABLE.items()
    ]


operations = {
    "connect": connect,
    "disconnect": disconnect,
    "command": command,
    "registers": registers,
    "describe_error": describe_error,
    "sync_read": sync_read,
    "reg_write": reg_write,
    "action": action,
}
for name in (
    "ping",
    "scan",
    "scan_all_baudrates",
    "read_register",
    "read_register_with_error",
    "read_registers",
    "write_register",
    "detect_response_level",
    "dump_with_error",
    "unlock_eeprom",
    "lock_eeprom",
    "set_id",
    "set_baudrate",
    "factory_reset",
    "set_torque",
    "set_goal_position",
    "sync_write_positions",
    "set_goal_velocity",
    "set_acceleration",
    "set_zero",
    "set_operating_mode",
    "selftest",
):
    operations[name] = of_controller(name)

serve(operations)
