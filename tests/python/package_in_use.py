"""The Python package as somebody uses it who has installed it."""

import os
import signal
import subprocess
import sys
import time

import gaitway
import pytest
import serial
from gaitway import CommandError, ControlError, VirtualRobot, WaitTimeout

# A ping to ID 1 in DYNAMIXEL Protocol 2.0, and where the model number is in its status (e-Manual).
PING = bytes.fromhex("fffffd000103000119 4e")
XM430_W350 = 1020


def ping(path):
    with serial.Serial(path, 57_600, timeout=5) as port:
        port.write(PING)
        return int.from_bytes(port.read(14)[9:11], "little")


@pytest.mark.virtual_robot(servos=["xm430-w350:1,2"])
def test_a_program_finds_the_servo_and_the_test_sees_what_it_asked(virtual_robot):
    assert ping(virtual_robot.path) == XM430_W350
    entry = virtual_robot.wait(instruction="ping", timeout_s=5)
    assert (entry["id"], entry["bytes"]) == (1, PING.hex())
    assert virtual_robot.count(kind="answered", id=1) == 1
    with pytest.raises(WaitTimeout, match="0 within 0.05 s"):
        virtual_robot.wait(instruction="reboot", timeout_s=0.05)
    assert [e["kind"] for e in virtual_robot.log()] == ["asked", "answered"]


def test_registers_are_a_mapping(virtual_robot):
    registers = virtual_robot.joint("gripper").registers
    registers["present_position"] = 1500
    assert registers["Present Position"] == virtual_robot.registers("arm/6")["ID"] * 250
    assert "ID" in registers and len(registers) == len(list(registers)) > 30
    with pytest.raises(KeyError, match="there are: "):
        registers["Colour"]
    with pytest.raises(ControlError, match="allowed"):
        registers["ID"] = 1000


def test_a_hand_moves_a_limp_joint_in_stepped_time(virtual_robot):
    joint = virtual_robot.joint("elbow_flex")
    with virtual_robot.frozen():
        joint.move(joint.position_rad + 0.3)
        begin = joint.position_rad
        assert joint.in_hand and not joint.torque
        virtual_robot.step(2)
        assert joint.position_rad == pytest.approx(begin + 0.3, abs=0.02)
        assert not joint.in_hand


@pytest.mark.virtual_robot(servos=["xm430-w350:1"])
def test_a_fault_ends_with_its_block_and_a_plug_is_a_plug(virtual_robot):
    robot = virtual_robot
    robot.freeze()
    sound = robot.send(PING)
    assert int.from_bytes(sound[9:11], "little") == XM430_W350
    with robot.fault("mute", joint="joint_1"):
        assert robot.send(PING) == b""
    assert robot.send(PING) == sound
    robot.unplug()
    assert robot.paths == {"bus": None} or robot.send(PING) == b""
    robot.plug()
    robot.joint("joint_1").unplug()
    assert robot.send(PING) == b"" and not robot.joint("joint_1").plugged
    robot.reset()
    assert robot.time_s == 0.0 and robot.send(PING) == sound


@pytest.mark.virtual_robot(seed=7, faults=[{"kind": "mute", "joint": "gripper"}])
class TestMarkers:
    def test_the_marker_of_a_class_counts(self, virtual_robot):
        assert virtual_robot.name == "so101"

    @pytest.mark.virtual_robot("op3", faults=[])
    def test_the_nearest_marker_counts_first(self, virtual_robot):
        assert virtual_robot.name == "op3"
        assert len(virtual_robot.joints) == 20


# Prints its session and the simulator's, and dies without a word to anybody.
KILLED = """
import os, signal, gaitway
robot = gaitway.VirtualRobot("so101")
print(os.getsid(0), os.getsid(robot._process.pid), robot._process.pid, flush=True)
os.kill(os.getpid(), signal.SIGKILL)
"""


def is_running(process):
    try:
        with open(f"/proc/{process}/stat") as stat:
            return stat.read().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


def test_the_simulator_has_a_session_of_its_own_and_ends_with_who_started_it():
    killed = subprocess.run([sys.executable, "-c", KILLED], stdout=subprocess.PIPE, text=True)
    assert killed.returncode == -signal.SIGKILL
    session, of_simulator, simulator = map(int, killed.stdout.split())
    assert session == os.getsid(0) and of_simulator == simulator
    deadline = time.monotonic() + 60
    while is_running(simulator):
        assert time.monotonic() < deadline
        time.sleep(0.01)


def test_what_cannot_be_started_says_why():
    with pytest.raises(RuntimeError, match="did you mean sts3215"):
        VirtualRobot(servos=["sts3214:1"])


def test_jobs_run_through_the_command(tmp_path):
    report = gaitway.play("bow", robot="op3")
    assert report["outcome"] == "done" and len(report["joints"]) == 20
    assert report["referee"] == {"violations": []}
    written = gaitway.retarget("bow", robot="op3", output=tmp_path / "bow.csv")
    assert written["robot"] == "op3"
    assert (tmp_path / "bow.csv").read_text().startswith("time_s,")
    with VirtualRobot("so101") as robot:
        source = f"servos:so101@serial:{robot.path}"
        recorded = gaitway.record(source, output=tmp_path / "taught.mcap", for_s=1)
    # On a busy machine some answers come too late.
    assert recorded["outcome"] in ("done", "done_with_loss") and recorded["messages"] > 0
    with pytest.raises(CommandError, match="there is no robot") as refused:
        gaitway.play("bow", robot="opp3")
    assert refused.value.exit_code == 1
