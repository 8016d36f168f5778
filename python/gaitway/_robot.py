"""A virtual robot in a process of its own, and all that a test does to it."""

from __future__ import annotations

import json
import os
import subprocess
import tempfile
import threading
from contextlib import contextmanager
from types import TracebackType
from typing import (
    IO,
    Any,
    Dict,
    Iterator,
    List,
    Mapping,
    MutableMapping,
    Optional,
    Sequence,
    Type,
    Union,
)

from ._binary import binary

#: An object of JSON.
Json = Dict[str, Any]
#: What a request or a fault may hold.
Value = Union[str, int, float, bool, Sequence[int]]

#: The version of the control channel that this module speaks.
CONTROL_VERSION = 1
#: How long the simulator may take to end, s.
_END_S = 5.0


class ControlError(Exception):
    """The simulator refused a request.

    Attributes:
        at: where the request is wrong.
        got: what was found there.
        allowed: what would have been accepted.
    """

    def __init__(self, at: str, got: str, allowed: str) -> None:
        super().__init__(f"{at}: got {got}; allowed: {allowed}")
        self.at = at
        self.got = got
        self.allowed = allowed


class WaitTimeout(ControlError, TimeoutError):
    """What was waited for did not come."""


class Registers(MutableMapping[str, int]):
    """The registers of one servo as raw numbers, past all rules of the line.

    Names are those of the servo's profile in any spelling: ``Goal Position``, ``goal_position``.
    """

    def __init__(self, robot: "VirtualRobot", servo: str) -> None:
        self._robot = robot
        self._servo = servo

    def _all(self) -> Dict[str, int]:
        reply = self._robot.request("get", **_servo(self._servo))
        registers: Dict[str, int] = reply["registers"]
        return registers

    def __getitem__(self, name: str) -> int:
        try:
            reply = self._robot.request("get", register=name, **_servo(self._servo))
        except ControlError as error:
            if "has no register" in error.got:
                raise KeyError(f"{name}; there are: {error.allowed}") from error
            raise
        value: int = reply["value"]
        return value

    def __setitem__(self, name: str, value: int) -> None:
        self._robot.request("set", register=name, value=int(value), **_servo(self._servo))

    def __delitem__(self, name: str) -> None:
        raise TypeError("a servo keeps all its registers")

    def __iter__(self) -> Iterator[str]:
        return iter(self._all())

    def __len__(self) -> int:
        return len(self._all())

    def __repr__(self) -> str:
        return f"Registers({self._all()!r})"


class Joint:
    """One joint: how it really is, a hand for it, and its plug."""

    def __init__(self, robot: "VirtualRobot", name: str, line: str, id: int, servo: str) -> None:
        self._robot = robot
        #: Its name in the robot file.
        self.name = name
        #: Name of its line.
        self.line = line
        #: ID of its servo at first.
        self.id = id
        #: Profile of its servo.
        self.servo = servo
        #: Registers of its servo.
        self.registers = Registers(robot, name)

    def _state(self) -> Json:
        return self._robot.request("state", joint=self.name)

    @property
    def position_rad(self) -> float:
        """Where it is, rad, whatever its registers say."""
        return float(self._state()["position_rad"])

    @property
    def velocity_rad_s(self) -> float:
        """How fast it turns, rad/s."""
        return float(self._state()["velocity_rad_s"])

    @property
    def torque(self) -> bool:
        """Its servo gives torque, or its actuator is enabled."""
        return bool(self._state()["torque"])

    @property
    def plugged(self) -> bool:
        """Its servo is plugged in."""
        return bool(self._state()["plugged"])

    @property
    def in_hand(self) -> bool:
        """A hand has it."""
        return bool(self._state()["in_hand"])

    def move(
        self,
        to_rad: float,
        *,
        speed_rad_s: float = 1.0,
        torque_nm: Optional[float] = None,
        hold: bool = False,
    ) -> None:
        """Takes the joint by hand towards an angle, and returns at once.

        Without torque it follows; under torque it resists with what it has. The hand gives at most
        ``torque_nm`` N m, by default a quarter of what the servo gives when stalled, and lets go once
        the joint is there, unless it is to ``hold``.
        """
        hand: Dict[str, Value] = {"to_rad": to_rad, "speed_rad_s": speed_rad_s, "hold": hold}
        if torque_nm is not None:
            hand["torque_nm"] = torque_nm
        self._robot.request("hand", joint=self.name, **hand)

    def let_go(self) -> None:
        """The hand lets go."""
        self._robot.request("let-go", joint=self.name)

    def unplug(self) -> None:
        """Draws the servo's plug: it loses its power, and neither hears nor answers."""
        self._robot.request("unplug", joint=self.name)

    def plug(self) -> None:
        """Plugs the servo in again: it boots, without torque."""
        self._robot.request("plug", joint=self.name)

    def __repr__(self) -> str:
        return f"Joint({self.name!r}, line={self.line!r}, id={self.id}, servo={self.servo!r})"


class Fault:
    """A fault that has begun; as a context it ends with its block."""

    def __init__(self, robot: "VirtualRobot", number: int) -> None:
        self._robot = robot
        #: Its number.
        self.number = number
        self._has_ended = False

    def end(self) -> None:
        """Ends it."""
        self._robot.request("end", fault=self.number)
        self._has_ended = True

    def __enter__(self) -> "Fault":
        return self

    def __exit__(
        self,
        kind: Optional[Type[BaseException]],
        error: Optional[BaseException],
        trace: Optional[TracebackType],
    ) -> None:
        if not self._has_ended:
            self.end()


class VirtualRobot:
    """A virtual robot that other programs open as a serial port, held in hand by this one.

    Args:
        robot: a robot's name (``so101``, ``op3``, ...), or the path of a robot file.
        servos: instead of a robot, servos on a bench: ``["xm430-w350:1,2", "sts3215:3"]``.
        baud: speed of the bench's line, bit/s; without it that of its servos as they leave the factory.
        seed: everything random follows from it.
        faults: tables as in a fault script, each with its ``kind``; they begin with the robot.
        adapter: the USB adapter that the lines are behind.
        line_timing: bytes take their time on the line.
        link: make this link to the terminal; of several lines ``LINK-NAME``.
        tcp: ports of the loopback interface instead of terminals.
        options: more arguments of ``gaitway simulate``.

    Raises:
        RuntimeError: the simulator did not start; its words.
    """

    def __init__(
        self,
        robot: Union[str, "os.PathLike[str]", None] = None,
        *,
        servos: Sequence[str] = (),
        baud: Optional[int] = None,
        seed: Optional[int] = None,
        faults: Sequence[Mapping[str, Value]] = (),
        adapter: Optional[str] = None,
        line_timing: bool = True,
        link: Union[str, "os.PathLike[str]", None] = None,
        tcp: bool = False,
        options: Sequence[str] = (),
    ) -> None:
        command = [binary(), "simulate", "--control", "stdin", "--no-referee", "--permit-eeprom"]
        if robot is not None:
            command.append(os.fspath(robot))
        for text in servos:
            command += ["--servo", text]
        for option, value in (("--baud", baud), ("--seed", seed), ("--adapter", adapter)):
            if value is not None:
                command += [option, str(value)]
        if link is not None:
            command += ["--pty", os.fspath(link)]
        if tcp:
            command += ["--tcp", "0"]
        if not line_timing:
            command.append("--no-line-timing")
        self._lock = threading.Lock()
        # A file takes all that is said there, however much; a pipe that nobody reads would not.
        self._words: IO[bytes] = tempfile.TemporaryFile()
        # In a session of its own: the kernel gives sessions their turns, so that it answers at once however
        # many processes of this one are busy. Ctrl-C does not reach it there; it ends with its standard input.
        self._process = subprocess.Popen(
            [*command, *options],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._words,
            encoding="utf-8",
            start_new_session=True,
        )
        try:
            about = self._about()
            #: Its name.
            self.name: str = about["robot"]
            self._joints = {told["name"]: Joint(self, **told) for told in about["joints"]}
            for fault in faults:
                self.request("fault", **fault)
        except BaseException:
            self.stop()
            raise

    def _about(self) -> Json:
        return self.request("about", version=CONTROL_VERSION)

    # What it is, and where.

    @property
    def paths(self) -> Dict[str, Optional[str]]:
        """Where each line is now: a path, or ``tcp:ADDRESS``; None while its adapter is pulled out."""
        return {line["name"]: line["place"] for line in self._about()["lines"]}

    @property
    def path(self) -> str:
        """Where its only line is.

        Raises:
            LookupError: there are several lines, or its adapter is pulled out.
        """
        places = self.paths
        if len(places) != 1:
            raise LookupError(f"{self.name} has several lines: paths has {', '.join(places)}")
        (place,) = places.values()
        if place is None:
            raise LookupError("the adapter is pulled out")
        return place

    @property
    def joints(self) -> Dict[str, Joint]:
        """All joints by name, in the order of the robot file."""
        return dict(self._joints)

    def joint(self, name: str) -> Joint:
        """The joint with this name."""
        try:
            return self._joints[name]
        except KeyError:
            raise KeyError(f"{name}; there are: {', '.join(self._joints)}") from None

    def registers(self, servo: str) -> Registers:
        """Registers of a servo, named by its joint or as ``LINE/ID``."""
        return Registers(self, servo)

    # What goes wrong.

    def fault(self, kind: str, **keys: Value) -> Fault:
        """Begins a fault now, or when its keys say; it ends with its block or by :meth:`Fault.end`.

        The keys are those of a fault script (sim/README.md): ``fault("mute", joint="gripper")``.
        """
        return Fault(self, int(self.request("fault", kind=kind, **keys)["fault"]))

    def unplug(self, line: Optional[str] = None) -> None:
        """Pulls the adapter of a line out, or of the only one: programs see a hang-up."""
        self.request("unplug", line=line or self._only_line())

    def plug(self, line: Optional[str] = None) -> None:
        """Plugs the adapter of a line in again; :attr:`path` may be another then."""
        self.request("plug", line=line or self._only_line())

    def _only_line(self) -> str:
        names = list(self.paths)
        if len(names) != 1:
            raise LookupError(f"which line? {', '.join(names)}")
        return names[0]

    # Time.

    def reset(self) -> None:
        """Everything is as at the start, and time is zero; programs stay connected."""
        self.request("reset")

    def freeze(self) -> None:
        """Time stands still: nobody is answered until :meth:`step` or :meth:`run`."""
        self.request("freeze")

    def step(self, seconds: float) -> None:
        """Lets so much frozen time pass at once, at most 60 s."""
        self.request("step", for_s=seconds)

    def run(self) -> None:
        """Time goes with real time again."""
        self.request("run")

    @contextmanager
    def frozen(self) -> Iterator[None]:
        """Time stands still in this block."""
        self.freeze()
        try:
            yield
        finally:
            self.run()

    @property
    def time_s(self) -> float:
        """World time, s since the start or the last reset."""
        return float(self._about()["at_s"])

    def send(self, bytes: bytes, *, line: Optional[str] = None, for_s: float = 0.005) -> bytes:
        """Says something as the host while time is frozen; what comes back within ``for_s``."""
        name = line or self._only_line()
        reply = self.request("send", line=name, bytes=bytes.hex(), for_s=for_s)
        return type(bytes).fromhex(reply["bytes"])

    # What was asked.

    def log(self, **filter: Value) -> List[Json]:
        """What has happened, oldest first: packets asked and answered, faults, torque, plugs.

        Filters are ``kind`` (``asked``, ``answered``, ``frame``, ``struck``, ``torque``, ``adapter``,
        ``reset``), ``joint``, ``line``, ``id``, ``instruction`` (``ping``, ``read``, ``sync-write``, ...),
        ``address`` and ``since`` (a number ``n``).
        """
        entries: List[Json] = []
        while True:
            reply = self.request("log", **filter)
            entries += reply["entries"]
            if not reply["entries"] or reply["next"] <= reply["entries"][-1]["n"] + 1:
                return entries
            filter["since"] = reply["next"]

    def count(self, **filter: Value) -> int:
        """How many of them there are."""
        return int(self.request("count", **filter)["count"])

    def wait(self, count: int = 1, *, timeout_s: float = 1.0, **filter: Value) -> Json:
        """Waits until there are so many of them, those from before too; the last of these.

        Raises:
            WaitTimeout: they did not come in time.
        """
        reply = self.request("wait", count=count, timeout_s=timeout_s, **filter)
        entry: Json = reply["entry"]
        return entry

    def last_packets(self, count: int = 20) -> str:
        """The last packets in words, one a line: for a message when something went wrong."""
        entries = [entry for entry in self.log() if entry["kind"] not in ("torque", "reset")]
        return "\n".join(_words(entry) for entry in entries[-count:])

    # The channel itself.

    def request(self, do: str, **keys: Value) -> Json:
        """One request of the control channel, and its reply.

        Raises:
            ControlError: it was refused.
            RuntimeError: the simulator has ended.
        """
        line = json.dumps({"do": do, **keys})
        with self._lock:
            reply = self._exchange(line)
        if reply["ok"]:
            return reply
        error = reply["error"]
        kind = WaitTimeout if error["at"] == "wait" else ControlError
        raise kind(error["at"], error["got"], error["allowed"])

    def _exchange(self, line: str) -> Json:
        stdin, stdout = self._process.stdin, self._process.stdout
        assert stdin is not None and stdout is not None
        try:
            stdin.write(line + "\n")
            stdin.flush()
            # Before the first reply it says where its lines are.
            while True:
                said = stdout.readline()
                if said.startswith("{"):
                    reply: Json = json.loads(said)
                    return reply
                if not said:
                    break
        except (BrokenPipeError, ValueError):
            pass
        self._process.wait(_END_S)
        raise RuntimeError(f"the simulator has ended: {self.words().strip()}")

    def words(self) -> str:
        """What the simulator has said to people."""
        if self._words.closed:
            return ""
        self._words.seek(0)
        return self._words.read().decode("utf-8", "replace")

    def stop(self) -> None:
        """Ends it; nothing happens if it has ended."""
        for end in (self._process.stdin, self._process.stdout):
            if end is not None and not end.closed:
                try:
                    end.close()
                except BrokenPipeError:
                    pass
        try:
            self._process.wait(_END_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._words.close()

    def __enter__(self) -> "VirtualRobot":
        return self

    def __exit__(
        self,
        kind: Optional[Type[BaseException]],
        error: Optional[BaseException],
        trace: Optional[TracebackType],
    ) -> None:
        self.stop()

    def __repr__(self) -> str:
        return f"VirtualRobot({self.name!r})"


def _servo(name: str) -> Dict[str, Value]:
    """A servo by its joint, or by ``LINE/ID``."""
    line, slash, id = name.partition("/")
    return {"line": line, "id": int(id)} if slash else {"joint": name}


def _words(entry: Json) -> str:
    at = f"{entry['at_s']:10.6f} s"
    kind = entry["kind"]
    if kind == "asked":
        where = f" {entry.get('register') or entry.get('address', '')}".rstrip()
        whom = entry.get("ids") or entry["id"]
        return f"{at}  ->  {entry['instruction']} {whom}{where}  {entry['bytes']}"
    if kind == "answered":
        return f"{at}  <-  {entry['id']}  {entry['bytes']}"
    if kind == "frame":
        arrow = "->" if entry["from_host"] else "<-"
        return f"{at}  {arrow}  {entry['id']:x}  {entry['bytes']}"
    if kind == "struck":
        return f"{at}  fault {entry['fault']} {entry['place']}"
    return f"{at}  adapter of {entry['line']} {'in' if entry['plugged'] else 'out'}"
