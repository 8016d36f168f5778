"""LeRobot as published, with PyTorch: its own commands, from finding a port to replaying what was recorded.

Arguments: a folder of its own. GAITWAY names the program, PYTHONPATH has the package `gaitway`. What a person would do at
each prompt is done through the control channel. Prints what came of it as JSON.
"""

import glob
import json
import math
import os
import re
import subprocess
import sys
import threading
import time

import pandas
from gaitway import VirtualRobot

FOLDER = sys.argv[1]
COMMANDS = os.path.dirname(sys.executable)
HOME = {
    "HF_HOME": os.path.join(FOLDER, "home"),
    "HF_LEROBOT_HOME": os.path.join(FOLDER, "home/lerobot"),
    "HF_HUB_OFFLINE": "1",
}
PATIENCE_S = 240
JOINTS = ["shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper"]


class Prompted:
    """A command of LeRobot, and what it says."""

    def __init__(self, name, *arguments):
        self.process = subprocess.Popen(
            [os.path.join(COMMANDS, name), *arguments],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            env={**os.environ, **HOME, "PYTHONUNBUFFERED": "1"},
        )
        self.said, self.read = "", 0
        # Always read: it would wait for whoever does not.
        self.reader = threading.Thread(target=self.listen, daemon=True)
        self.reader.start()

    def listen(self):
        while more := os.read(self.process.stdout.fileno(), 65536):
            self.said += more.decode(errors="replace")

    def expect(self, pattern):
        """Waits until it has said something like this since the last time."""
        end = time.monotonic() + PATIENCE_S
        while True:
            is_over = not self.reader.is_alive()
            found = re.search(pattern, self.said[self.read :])
            if found:
                self.read += found.end()
                return
            if is_over or time.monotonic() > end:
                raise SystemExit(f"waited in vain for {pattern!r}:\n{self.said[-4000:]}")
            time.sleep(0.02)

    def enter(self, text=""):
        self.process.stdin.write(f"{text}\n".encode())
        self.process.stdin.flush()

    def ends(self):
        self.process.stdin.close()
        code = self.process.wait(timeout=PATIENCE_S)
        self.reader.join()
        if code != 0:
            raise SystemExit(f"it ended with {code}:\n{self.said[-4000:]}")


def set_up(robot, kind, role):
    """Each motor alone on the line, with the ID that it has from the factory."""
    for name in JOINTS:
        robot.joint(name).registers["ID"] = 1
        robot.joint(name).unplug()
    command = Prompted("lerobot-setup-motors", f"--{role}.type={kind}", f"--{role}.port={robot.path}")
    for name in reversed(JOINTS):
        command.expect(f"'{name}' motor only")
        robot.joint(name).plug()
        time.sleep(0.5)  # it starts, as a servo does that has just been plugged in
        command.enter()
        command.expect(f"'{name}' motor id set to")
        robot.joint(name).unplug()
    command.ends()
    ids = [robot.joint(name).registers["ID"] for name in JOINTS]
    for name in JOINTS:
        robot.joint(name).plug()
    time.sleep(0.5)
    return ids


def calibrate(robot, kind, role, name):
    command = Prompted(
        "lerobot-calibrate", f"--{role}.type={kind}", f"--{role}.port={robot.path}", f"--{role}.id={name}"
    )
    command.expect("middle of its range of motion and press ENTER")
    command.enter()
    command.expect("Press ENTER to stop")
    for joint in JOINTS:
        for angle_rad in (0.5, -0.5, 0.0):
            robot.joint(joint).move(angle_rad, speed_rad_s=4.0)
            time.sleep(0.4)
        robot.joint(joint).let_go()
    command.enter()
    command.expect("Calibration saved")
    command.ends()


def find_port(told):
    """Its list of ports before and after a cable was pulled out. It looks for /dev/tty*."""
    link = "/dev/ttyGAITWAY"
    try:
        with VirtualRobot("so101", link=link):
            command = Prompted("lerobot-find-port")
            command.expect("press Enter when done")
            os.rename(link, link[:5] + "gaitway-pulled-out")
            command.enter()
            command.expect(f"The port of this MotorsBus is '{link}'")
            os.rename(link[:5] + "gaitway-pulled-out", link)
            command.ends()
            told["port"] = link
    except RuntimeError as cause:
        told["port"] = f"SKIPPED: {cause}"


def replayed(robot, after, joint_id):
    """The goals of a joint in counts, as they came over the line since then."""
    goals = []
    for entry in robot.log(kind="asked", instruction="sync-write", address=42):
        if entry["at_s"] > after:
            data = bytes.fromhex(entry["params"])[2:]
            goals += [data[at + 1] + 256 * data[at + 2] for at in range(0, len(data), 3) if data[at] == joint_id]
    return goals


def asked(root, calibration, joint, episode):
    """What the dataset has of a joint, in counts: LeRobot keeps degrees from the middle of the range."""
    table = pandas.concat(map(pandas.read_parquet, glob.glob(os.path.join(root, "data/*/*.parquet"))))
    names = json.load(open(os.path.join(root, "meta/info.json")))["features"]["action"]["names"]
    own = json.load(open(calibration))[joint]
    middle = (own["range_min"] + own["range_max"]) / 2
    rows = table[table["episode_index"] == episode].sort_values("frame_index")["action"]
    return [float(row[names.index(f"{joint}.pos")]) * 4095 / 360 + middle for row in rows]


def arms(leader, follower):
    return [
        "--robot.type=so101_follower",
        f"--robot.port={follower.path}",
        "--robot.id=follower",
        "--teleop.type=so101_leader",
        f"--teleop.port={leader.path}",
        "--teleop.id=leader",
    ]


def present(robot):
    return {name: robot.joint(name).registers["Present_Position"] for name in JOINTS}


def main():
    told = {}
    find_port(told)
    with VirtualRobot("so101-leader") as leader, VirtualRobot("so101") as follower:
        told["ids"] = set_up(follower, "so101_follower", "robot")
        calibrate(leader, "so101_leader", "teleop", "leader")
        calibrate(follower, "so101_follower", "robot", "follower")

        command = Prompted("lerobot-teleoperate", *arms(leader, follower), "--teleop_time_s=6", "--fps=30")
        command.expect("Teleop loop time|time: ")
        leader.joint("elbow_flex").move(0.4, speed_rad_s=0.5)
        time.sleep(2.5)
        told["led"] = [present(leader)["elbow_flex"], present(follower)["elbow_flex"]]
        command.ends()

        leader.joint("elbow_flex").let_go()
        root = os.path.join(FOLDER, "recorded")
        command = Prompted(
            "lerobot-record",
            *arms(leader, follower),
            "--dataset.repo_id=local/recorded",
            f"--dataset.root={root}",
            "--dataset.single_task=bend an elbow",
            "--dataset.num_episodes=2",
            "--dataset.episode_time_s=3",
            "--dataset.reset_time_s=1",
            "--dataset.push_to_hub=false",
            "--play_sounds=false",
        )
        command.expect("Recording episode 0")
        for turn in range(12):
            leader.joint("elbow_flex").move(0.4 * math.sin(turn), speed_rad_s=0.6)
            time.sleep(0.7)
        command.ends()

        began_s = follower.time_s
        command = Prompted(
            "lerobot-replay",
            "--robot.type=so101_follower",
            f"--robot.port={follower.path}",
            "--robot.id=follower",
            "--dataset.repo_id=local/recorded",
            f"--dataset.root={root}",
            "--dataset.episode=0",
            "--play_sounds=false",
        )
        command.ends()
        own = os.path.join(HOME["HF_LEROBOT_HOME"], "calibration/robots/so_follower/follower.json")
        goals, wanted = replayed(follower, began_s, 3), asked(root, own, "elbow_flex", 0)
        told["replayed"] = [len(goals), len(wanted)]
        told["apart_counts"] = max(abs(a - b) for a, b in zip(goals, wanted))
        told["range_counts"] = max(wanted) - min(wanted)
        told["info"] = json.load(open(os.path.join(root, "meta/info.json")))
    print(json.dumps(told))


main()
