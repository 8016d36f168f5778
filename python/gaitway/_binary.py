"""Where the command is that came with this package."""

from __future__ import annotations

import os
import shutil
import sysconfig
from typing import Optional


def binary() -> str:
    """Path of the ``gaitway`` command.

    The environment variable ``GAITWAY`` comes first, then what was installed with this package, then
    the search path.

    Raises:
        FileNotFoundError: there is none.
    """
    named = os.environ.get("GAITWAY")
    if named:
        return named
    schemes = [sysconfig.get_default_scheme(), "posix_user"] if _knows_schemes() else []
    folders = [sysconfig.get_path("scripts")]
    folders += [sysconfig.get_path("scripts", scheme) for scheme in schemes]
    for folder in folders:
        path = os.path.join(folder, "gaitway")
        if os.access(path, os.X_OK):
            return path
    found: Optional[str] = shutil.which("gaitway")
    if found is None:
        raise FileNotFoundError(
            "there is no gaitway command: install this package with pip, put the command on the "
            "search path, or name it in the environment variable GAITWAY"
        )
    return found


def _knows_schemes() -> bool:
    # Python 3.9 does not say which scheme is its own.
    return hasattr(sysconfig, "get_default_scheme")
