"""LeRobot as published, without its packages for learning.

These are large and its motor buses do not use them, but a module beside the buses names them: empty ones stand in. LeRobot
itself lies in the folder that GAITWAY_BESIDE names. Whoever imports this first can import `lerobot.motors`.
"""

import os
import sys
import types

sys.path.insert(0, os.environ["GAITWAY_BESIDE"])


class Empty(types.ModuleType):
    """A module in which any name is a class."""

    def __getattr__(self, name):
        if name.startswith("__"):
            raise AttributeError(name)
        return type(name, (), {})


for absent in ("torch", "accelerate", "datasets", "datasets.utils", "datasets.utils.logging"):
    sys.modules[absent] = Empty(absent)
