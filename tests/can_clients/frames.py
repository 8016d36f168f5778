"""Other people's CAN code, unmodified, asked for frames and for what frames mean.

Reads one JSON list a line, [client, what, arguments...], and answers each with a line: what the
client sent ([[identifier, bytes in hexadecimal], ...]), what it understood, or {"error": words}.
"""

import contextlib
import io
import json
import math
import sys
import time

import can


class Line:
    """Stands in for python-can's bus: keeps what is sent, hands out what is to be heard."""

    def __init__(self):
        self.sent, self.heard, self.channel_info = [], [], "stand-in"

    def send(self, message):
        data = bytes(message.data)
        self.sent.append([message.arbitration_id, message.is_extended_id, data.hex()])

    def recv(self, timeout=None):
        return self.heard.pop(0) if self.heard else None

    def shutdown(self):
        pass


def message(identifier, data):
    return can.Message(
        arbitration_id=identifier, data=bytes.fromhex(data), is_extended_id=identifier > 0x7FF
    )


class Damiao:
    def __init__(self):
        from damiao_motor.core.motor import DaMiaoMotor

        self.line = Line()
        self.motor = DaMiaoMotor(1, 0x11, self.line, motor_type="4310")

    def send(self, what, *arguments):
        if what == "ranges":
            from damiao_motor.core.motor import MOTOR_TYPE_PRESETS

            return {k: [v["p_max"], v["v_max"], v["t_max"]] for k, v in MOTOR_TYPE_PRESETS.items()}
        getattr(self.motor, what)(*arguments)

    def hear(self, identifier, data):
        self.motor.state, self.motor.registers = {}, {}
        self.motor.process_feedback_frame(bytes.fromhex(data), identifier)
        return [self.motor.state, self.motor.registers]


class CyberGear:
    def __init__(self):
        from CyberGearDriver import CyberGearMotor

        self.line = Line()
        self.motor = CyberGearMotor(0x7F, self.line_send, host_id=0xFD)

    def line_send(self, theirs):
        self.line.send(message(theirs.arbitration_id, bytes(theirs.data).hex()))

    def send(self, what, *arguments):
        getattr(self.motor, what)(*arguments)

    def hear(self, identifier, data):
        self.motor.message_received(message(identifier, data))
        return [self.motor.state, self.motor.params, self.motor.faults]


class Robstride:
    def __init__(self):
        from robstride_dynamics import Motor, RobstrideBus
        from robstride_dynamics import protocol

        self.line = Line()
        self.types = protocol.ParameterType
        self.bus = RobstrideBus("none", {"a": Motor(0x7F, "rs-02")})
        self.bus.host_id, self.bus.channel_handler = 0xFD, self.line

    def send(self, what, *arguments):
        answer = message(0x02807FFD, "7fff7fff7fff00fa")
        if what == "ranges":
            from robstride_dynamics import table

            names = [f"MODEL_MIT_{x}_TABLE" for x in ("POSITION", "VELOCITY", "TORQUE", "KP", "KD")]
            tables = [getattr(table, name) for name in names]
            return {model: [t[model] for t in tables] for model in tables[0]}
        elif what == "write":
            self.line.heard = [answer]
            self.bus.write("a", getattr(self.types, arguments[0]), arguments[1])
        elif what == "read":
            self.line.heard = [message(0x11007FFD, arguments[1])]
            return float(self.bus.read("a", getattr(self.types, arguments[0])))
        else:
            self.line.heard = [answer]
            getattr(self.bus, what)("a", *arguments)

    def hear(self, identifier, data):
        self.line.heard = [message(identifier, data)]
        said = io.StringIO()
        with contextlib.redirect_stdout(said):
            values = self.bus.read_operation_frame("a")
        return [list(map(float, values)), said.getvalue()]


class TMotor:
    def __init__(self):
        from TMotorCANControl import mit_can, servo_can

        self.line = Line()
        # Their constructors bring an interface up as root; what they do with frames needs none.
        self.mit = object.__new__(mit_can.CAN_Manager)
        self.servo = object.__new__(servo_can.CAN_Manager_servo)
        for manager in (self.mit, self.servo):
            manager.bus, manager.debug = self.line, False

    def send(self, what, *arguments):
        owner = self.servo if hasattr(type(self.servo), what) and what[:4] == "comm" else self.mit
        getattr(owner, what)(*arguments)

    def hear(self, identifier, data):
        data = bytes.fromhex(data)
        if identifier > 0x7FF:
            state = self.servo.parse_servo_message(data)
        else:
            state = self.mit.parse_MIT_message(data, "AK80-9")
        return [
            float(x)
            for x in (
                state.position,
                state.velocity,
                state.current,
                -1 if state.temperature is None else state.temperature,
                -1 if state.error is None else state.error,
            )
        ]


class Moteus:
    def __init__(self):
        import moteus

        self.moteus, self.line = moteus, Line()
        whole = moteus.PositionResolution()
        for name in vars(moteus.PositionResolution):
            if not name.startswith("_"):
                setattr(whole, name, moteus.INT16)
        self.plain = moteus.Controller(id=1)
        self.coarse = moteus.Controller(id=1, position_resolution=whole)

    def send(self, what, arguments, coarse=False):
        arguments = {k: math.nan if v is None else v for k, v in arguments.items()}
        if "data" in arguments:
            arguments["data"] = arguments["data"].encode()
        command = getattr(self.coarse if coarse else self.plain, what)(**arguments)
        reply = 0x8000 if command.reply_required else 0
        identifier = reply | command.source << 8 | command.destination
        self.line.send(message(identifier, command.data.hex()))

    def hear(self, identifier, data):
        parsed = self.moteus.parse_registers(bytes.fromhex(data))
        named = lambda values: {int(k): float(v) for k, v in values.items()}
        asked = [[int(register), int(resolution)] for register, resolution in parsed.query]
        return [named(parsed.command), named(parsed.response), asked]


class ODrive:
    def __init__(self):
        self.line = Line()

    def send(self, what):
        from odrive import enums

        return {e.name: int(e.value) for e in getattr(enums, what)}


class LeRobot:
    def __init__(self):
        import importlib.metadata
        import importlib.util

        self.line = Line()
        # The file by itself: its package wants those for learning.
        path = importlib.metadata.distribution("lerobot").locate_file(
            "lerobot/motors/damiao/tables.py"
        )
        spec = importlib.util.spec_from_file_location("tables", path)
        self.tables = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(self.tables)

    def send(self, what):
        if what == "ranges":
            return {k.name: list(v) for k, v in self.tables.MOTOR_LIMIT_PARAMS.items()}
        return {e.name: int(e.value) for e in getattr(self.tables, what)}


CLIENTS = {
    "damiao": Damiao,
    "cybergear": CyberGear,
    "robstride": Robstride,
    "tmotor": TMotor,
    "moteus": Moteus,
    "odrive": ODrive,
    "lerobot": LeRobot,
}


def answer(made, request):
    name, what, *arguments = request
    if name not in made:
        made[name] = CLIENTS[name]()
    client = made[name]
    client.line.sent = []
    if what == "hear":
        return client.hear(*arguments)
    value = client.send(what, *arguments)
    return value if value is not None else client.line.sent


def main():
    time.sleep = lambda seconds: None  # some wait after each frame
    made, out = {}, sys.stdout
    sys.stdout = sys.stderr  # what they print, even on their way out
    for line in sys.stdin:
        try:
            value = answer(made, json.loads(line))
        except Exception as error:  # whatever another's code raises is an answer too
            value = {"error": f"{type(error).__name__}: {error}"}
        print(json.dumps(value, default=float), file=out, flush=True)


main()
