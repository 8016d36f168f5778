"""The rustypot wheel. Arguments: port, bits per second, controller (as in XL330), seconds to wait."""

import sys

import rustypot
from serving import Lost, serve

address, bps, family, timeout_s = sys.argv[1:5]
kind = getattr(rustypot, f"{family}PyController")
controller = kind(address, int(bps), float(timeout_s))
definition = kind.definition()
bus = None


def guarded(operation):
    """Tells a silent line from other errors, by the words the wheel has for it."""

    def run(*arguments):
        try:
            return operation(*arguments)
        except RuntimeError as cause:
            if "timed out" in str(cause) or "Timeout" in str(cause):
                raise Lost(str(cause)) from cause
            raise

    return run


def called(name):
    return guarded(lambda *arguments: getattr(controller, name)(*arguments))


def registers():
    writable = (rustypot.RegisterAccess.ReadWrite, rustypot.RegisterAccess.Write)
    return [
        [r.name, r.addr, r.size, r.access in writable, r.encoding != "unsigned"]
        for r in kind.registers()
    ]


def by_text(found):
    return {str(number): model for number, model in found.items()}


def open_bus(numbers):
    """The same motors through the class that LeRobot uses."""
    global bus
    controller.close()
    bus = rustypot.Bus(
        address, int(bps), float(timeout_s), {number: definition for number in numbers}
    )


def of_bus(name):
    return guarded(lambda *arguments: getattr(bus, name)(*arguments))


operations = {
    "registers": registers,
    "scan": guarded(lambda numbers: by_text(controller.scan(numbers))),
    "broadcast_scan": guarded(lambda: by_text(controller.broadcast_scan())),
    "open_bus": open_bus,
    "bus_set_torque": guarded(lambda *arguments: by_text(bus.set_torque(*arguments))),
    "bus_change_id": guarded(lambda *arguments: bus.change_id(definition, *arguments)),
    "bus_change_baudrate": guarded(lambda *arguments: bus.change_baudrate(definition, *arguments)),
    "bus_broadcast_scan": guarded(lambda: by_text(bus.broadcast_scan(definition))),
}
for name in (
    "ping",
    "reboot",
    "factory_reset",
    "read_register",
    "read_register_with_error",
    "write_register",
    "sync_read_register",
    "sync_write_register",
    "set_fast_sync_read",
    "read_raw_data",
    "write_raw_data",
    "sync_read_raw_data",
    "sync_write_raw_data",
    "read_present_position",
    "write_goal_position",
    "sync_read_present_position",
    "sync_write_goal_position",
):
    operations[name] = called(name)
for name in ("read_register", "write_register", "sync_read_register", "sync_write_register"):
    operations[f"bus_{name}"] = of_bus(name)

serve(operations)
