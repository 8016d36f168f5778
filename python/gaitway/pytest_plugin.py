"""The pytest plugin: the fixture ``virtual_robot``, and what it says when a test fails."""

from __future__ import annotations

from typing import Any, Generator, Iterator

import pytest

from ._robot import VirtualRobot

#: Packets that a failing test prints.
_SHOWN = 20
_ROBOT = pytest.StashKey[VirtualRobot]()


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addini("virtual_robot", "the robot of the fixture virtual_robot", default="so101")


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line(
        "markers",
        "virtual_robot(robot, *, servos, baud, seed, faults, ...): what the fixture virtual_robot "
        "starts; the arguments of gaitway.VirtualRobot",
    )


@pytest.fixture
def virtual_robot(request: pytest.FixtureRequest) -> Iterator[VirtualRobot]:
    """A virtual robot for this test alone: ``virtual_robot.path`` is its serial port.

    ``@pytest.mark.virtual_robot("op3", seed=7, faults=[{"kind": "mute", "joint": "head_pan"}])`` says
    which; the nearest marker counts, and keywords of those further out that it does not have.
    """
    arguments: tuple[Any, ...] = ()
    keywords: dict[str, Any] = {}
    for marker in request.node.iter_markers("virtual_robot"):
        names_one = arguments or "robot" in keywords or "servos" in keywords
        if not names_one:
            arguments = marker.args
        keywords = {**marker.kwargs, **keywords}
    if arguments or "servos" in keywords:
        keywords.pop("robot", None)
    if not arguments and not {"robot", "servos"} & set(keywords):
        arguments = (request.config.getini("virtual_robot"),)
    with VirtualRobot(*arguments, **keywords) as robot:
        request.node.stash[_ROBOT] = robot
        yield robot


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: pytest.CallInfo[None]
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    report = yield
    robot = item.stash.get(_ROBOT, None)
    if report.when == "call" and report.failed and robot is not None:
        try:
            packets = robot.last_packets(_SHOWN) or "none"
        except Exception as error:  # Whatever it is, the test's own failure is told.
            packets = f"they cannot be had: {error}"
        report.sections.append((f"last packets of {robot.name}", packets))
    return report
