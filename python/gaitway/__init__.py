"""Virtual servos for tests without hardware, and human motion for small humanoid robots.

>>> from gaitway import VirtualRobot
>>> with VirtualRobot("so101") as robot:
...     port = robot.path  # open it with the servos' own SDK
...     robot.joint("gripper").move(0.5)
"""

from ._binary import binary
from ._commands import CommandError, play, record, retarget, run
from ._reports import JointReport, PlayReport, RecordReport, RetargetReport
from ._robot import ControlError, Fault, Joint, Registers, VirtualRobot, WaitTimeout

__all__ = [
    "CommandError",
    "ControlError",
    "Fault",
    "Joint",
    "JointReport",
    "PlayReport",
    "RecordReport",
    "Registers",
    "RetargetReport",
    "VirtualRobot",
    "WaitTimeout",
    "binary",
    "play",
    "record",
    "retarget",
    "run",
]
