"""Jobs of the command, from Python: a thin layer over its JSON."""

from __future__ import annotations

import json
import os
import subprocess
from typing import Any, Dict, List, Optional, Sequence, Union, cast

from ._binary import binary
from ._reports import PlayReport, RecordReport, RetargetReport

#: Done, but something could not be recorded or reported; the report says what.
_WITH_LOSS = 3

_Path = Union[str, "os.PathLike[str]"]


class CommandError(Exception):
    """The command did not do what it was told.

    Attributes:
        exit_code: 1 refused or failed, 2 wrong usage, 3 done but its report is lost, 4 stopped.
        words: what it said to people.
        report: its report, as far as there is one.
    """

    def __init__(self, exit_code: int, words: str, report: Optional[Dict[str, Any]]) -> None:
        super().__init__(words or f"exit code {exit_code}")
        self.exit_code = exit_code
        self.words = words
        self.report = report


def run(*arguments: str, timeout_s: Optional[float] = None) -> Dict[str, Any]:
    """Runs any command that knows ``--json``; its report.

    Raises:
        CommandError: it ended with another code than 0, or 3 with a report: then it is done, and the
            report's ``outcome`` says that something was lost.
        subprocess.TimeoutExpired: it took too long, and was killed.
    """
    done = subprocess.run(
        [binary(), "--quiet", *arguments, "--json"],
        stdin=subprocess.DEVNULL,
        capture_output=True,
        encoding="utf-8",
        timeout=timeout_s,
    )
    try:
        report: Optional[Dict[str, Any]] = json.loads(done.stdout)
    except ValueError:
        report = None
    if done.returncode not in (0, _WITH_LOSS) or report is None:
        # A report says itself why nothing was done.
        reason = report.get("stop_reason") if report else None
        raise CommandError(done.returncode, done.stderr.strip() or str(reason or ""), report)
    return report


def _given(**options: Union[_Path, float, int, None]) -> List[str]:
    """``--rate 50`` and the like, of what is given."""
    given: List[str] = []
    for name, value in options.items():
        if value is not None:
            text = os.fspath(value) if isinstance(value, os.PathLike) else str(value)
            given += [f"--{name}", text]
    return given


def play(
    motion: _Path,
    *,
    robot: _Path,
    bus: str = "sim",
    rate: Optional[float] = None,
    speed: Optional[float] = None,
    record: Optional[_Path] = None,
    options: Sequence[str] = (),
    timeout_s: Optional[float] = None,
) -> PlayReport:
    """Plays a motion on a robot, by default a virtual one in virtual time: ``gaitway play``.

    With ``bus="serial:/dev/ttyUSB0"`` a real robot moves, with all checks of the command.
    ``options`` are more of its arguments.
    """
    given = _given(robot=robot, bus=bus, rate=rate, speed=speed, record=record)
    report = run("play", os.fspath(motion), *given, *options, timeout_s=timeout_s)
    return cast(PlayReport, report)


def retarget(
    motion: _Path,
    *,
    robot: _Path,
    output: _Path,
    options: Sequence[str] = (),
    timeout_s: Optional[float] = None,
) -> RetargetReport:
    """Transfers a motion to a robot's joints and writes the trajectory: ``gaitway retarget``."""
    given = _given(robot=robot) + ["-o", os.fspath(output)]
    report = run("retarget", os.fspath(motion), *given, *options, timeout_s=timeout_s)
    return cast(RetargetReport, report)


def record(
    *sources: str,
    output: _Path,
    for_s: Optional[float] = None,
    options: Sequence[str] = (),
    timeout_s: Optional[float] = None,
) -> RecordReport:
    """Records sensors and hand-guided servos, for so long: ``gaitway record``."""
    given = ["-o", os.fspath(output)]
    if for_s is not None:
        given += ["--for", f"{for_s}s"]
    return cast(RecordReport, run("record", *sources, *given, *options, timeout_s=timeout_s))
