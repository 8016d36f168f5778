"""Connects as one of LeRobot's robots does. Arguments: port, and the file of the robot in LeRobot.

The robot's class needs cameras and packages for learning; what motors it has stands in its file, and
is read from there. LeRobot's bus then looks whether each is there, of which model and firmware.
"""

import ast
import json
import os
import sys

import lerobot_alone  # noqa: F401
import lerobot.motors as motors
from lerobot.motors.dynamixel import DynamixelMotorsBus
from lerobot.motors.feetech import FeetechMotorsBus

BUSES = {"DynamixelMotorsBus": DynamixelMotorsBus, "FeetechMotorsBus": FeetechMotorsBus}

port, file = sys.argv[1:]
package = os.path.dirname(os.path.dirname(motors.__file__))
with open(os.path.join(package, file)) as source:
    calls = [node for node in ast.walk(ast.parse(source.read())) if isinstance(node, ast.Call)]
(call,) = [call for call in calls if getattr(call.func, "id", "") in BUSES]
keywords = {keyword.arg: keyword.value for keyword in call.keywords}
found = {}
for name, motor in zip(keywords["motors"].keys, keywords["motors"].values):
    number, model = (ast.literal_eval(argument) for argument in motor.args[:2])
    found[name.value] = motors.Motor(number, model, motors.MotorNormMode.RANGE_0_100)
options = {}
if "protocol_version" in keywords:
    options["protocol_version"] = ast.literal_eval(keywords["protocol_version"])
bus = BUSES[call.func.id](port, found, **options)
# On a busy machine: wait a second for an answer.
bus.port_handler.setPacketTimeout = lambda _: bus.port_handler.setPacketTimeoutMillis(1000)
bus.connect()
bus.configure_motors()
read = {name: bus.read("Present_Position", name, normalize=False) for name in found}
models = {name: bus.model_number_table[motor.model] for name, motor in found.items()}
told = {name: [motor.id, models[name], read[name]] for name, motor in found.items()}
bus.disconnect(disable_torque=False)
print(json.dumps(told))
