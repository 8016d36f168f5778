#!/usr/bin/env python3
"""Motions on Unitree's G1, retargeted by gaitway and by GMR's method, judged alike.

GMR (github.com/YanjieZe/GMR, 0.1.0) scales a person's joints about the pelvis and finds joint angles by two stages of
differential inverse kinematics. Its package wants assets that cannot always be had, so the method is written down here
again, on the same library (mink) and with its own tables: 4.1 solutions a frame and 8.9 cm off its targets on the
walk that its package was measured on, as there.

The judge is MuJoCo on one model for both. Limbs are compared with the person's where the robot's own hips and shoulders
look, so that a robot that turned less than the person is not wrong in every limb; how far each turned is a column.

    pip install mujoco mink daqp scipy
    gaitway robot import G1.xml --servo NAME -o g1.toml
    benches/retarget/beside_gmr.py --tables smplx_to_g1.json --model g1_mocap_29dof.xml --judge G1.xml \\
        --robot g1.toml --gaitway target/release/gaitway CLIP.bvh ...

CLIP.bvh: joints called Hips, Spine3, LeftArm, ..., lengths in inches, up along Z, a rest pose with all joints at zero.
Times are of solving alone for GMR, at 30 Hz; for gaitway of its whole process, reading included, at the capture's rate.
The robot's file should allow what G1's motors do (20 to 37 rad/s): whatever is slower is not compared.
"""

import argparse
import csv
import json
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import mink
import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

RATE_HZ = 30.0
INCH_M = 0.0254
# GMR goes on while the error falls by more than this, so often at most.
BETTER, STEPS, DAMPING = 1e-3, 10, 0.5
# Frames at the ends are left out: gaitway leads in and out, in the same time.
ENDS = 20
SIDES = ("left", "right")
# The left knee among G1's joints.
KNEE = 3
PEOPLE = {"pelvis": "Hips", "spine3": "Spine3"} | {
    f"{side}_{part}": f"{side.capitalize()}{joint}"
    for side in SIDES
    for part, joint in {
        "hip": "UpLeg",
        "knee": "Leg",
        "ankle": "Foot",
        "foot": "ToeBase",
        "shoulder": "Arm",
        "elbow": "ForeArm",
        "wrist": "Hand",
    }.items()
}
CHAINS = {
    "leg": (("hip", "knee", "ankle"), ("hip_roll_link", "knee_link", "ankle_pitch_link")),
    "arm": (("shoulder", "elbow", "wrist"), ("shoulder_roll_link", "elbow_link", "wrist_yaw_link")),
}


def turned(axis, angles):
    """Rotations by angles about X, Y or Z: [frame, 3, 3]."""
    return Rotation.from_euler(axis.lower(), np.reshape(angles, (-1, 1)), degrees=True).as_matrix()


def read_bvh(path):
    """Places [frame, 3] in m and rotations [frame, 3, 3] of every joint in the world, and frames per second."""
    words = iter(path.read_text().split())
    joints, above = [], []
    for word in words:
        if word in ("ROOT", "JOINT", "End"):
            joints.append({"name": next(words), "parent": above[-1] if above else None, "channels": []})
        elif word == "{":
            above.append(len(joints) - 1)
        elif word == "}":
            above.pop()
        elif word == "OFFSET":
            joints[above[-1]]["offset"] = np.array([float(next(words)) for _ in range(3)])
        elif word == "CHANNELS":
            joints[above[-1]]["channels"] = [next(words) for _ in range(int(next(words)))]
        elif word == "MOTION":
            break
    next(words)
    count = int(next(words))
    next(words), next(words)
    step_s = float(next(words))
    columns = iter(np.array([float(word) for word in words]).reshape(count, -1).T)
    placed = []
    for joint in joints:
        at = np.tile(joint["offset"], (count, 1))
        turn = np.tile(np.eye(3), (count, 1, 1))
        for channel in joint["channels"]:
            column = next(columns)
            if channel.endswith("rotation"):
                turn = turn @ turned(channel[0], column)
            elif joint["parent"] is None:
                at[:, "XYZ".index(channel[0])] = column
        if joint["parent"] is not None:
            from_m, by = placed[joint["parent"]]
            at = from_m + np.einsum("nij,nj->ni", by, at)
            turn = by @ turn
        placed.append((at, turn))
    return {joint["name"]: (at * INCH_M, turn) for joint, (at, turn) in zip(joints, placed)}, 1.0 / step_s


class Gmr:
    """GMR's tables and its two stages."""

    def __init__(self, tables, model, stature_m):
        text = re.sub(r"<geom[^>]*mesh=[^>]*/>|<mesh [^>]*/>", "", Path(model).read_text())
        self.model = mujoco.MjModel.from_xml_string(text)
        self.configuration = mink.Configuration(self.model)
        self.limits = [mink.ConfigurationLimit(self.model)]
        tables = json.loads(Path(tables).read_text())
        ratio = stature_m / tables["human_height_assumption"]
        self.scale = {name: of * ratio for name, of in tables["human_scale_table"].items()}
        self.stages = []
        for key in ("ik_match_table1", "ik_match_table2"):
            stage = []
            for frame, (human, at, turn, offset_m, offset) in tables[key].items():
                task = mink.FrameTask(frame, "body", position_cost=at, orientation_cost=turn, lm_damping=1.0)
                stage.append((human, task, np.array(offset_m), Rotation.from_quat(np.roll(offset, -1))))
            self.stages.append(stage)

    def frame(self, people, at):
        """Joint angles for a frame; how many solutions it took."""
        root = people["pelvis"][0][at]
        solved = 0
        for stage in self.stages:
            for human, task, offset_m, offset in stage:
                place = (people[human][0][at] - root) * self.scale[human] + root * self.scale["pelvis"]
                turn = Rotation.from_matrix(people[human][1][at]) * offset
                rotation = mink.SO3(np.roll(turn.as_quat(), 1))
                task.set_target(
                    mink.SE3.from_rotation_and_translation(rotation, place + turn.apply(offset_m))
                )
            tasks = [task for _, task, _, _ in stage]
            error = self.error(tasks)
            for _ in range(STEPS + 1):
                step_s = self.model.opt.timestep
                velocity = mink.solve_ik(
                    self.configuration, tasks, step_s, "daqp", damping=DAMPING, limits=self.limits
                )
                self.configuration.integrate_inplace(velocity, step_s)
                solved += 1
                before, error = error, self.error(tasks)
                if before - error <= BETTER:
                    break
        return self.configuration.data.qpos.copy(), solved

    def error(self, tasks):
        return np.linalg.norm(np.concatenate([task.compute_error(self.configuration) for task in tasks]))


class Judge:
    """One model that both are looked at on."""

    def __init__(self, model):
        self.model = mujoco.MjModel.from_xml_path(model)
        self.data = mujoco.MjData(self.model)
        mujoco.mj_forward(self.model, self.data)
        # What touches with all joints at zero is how the model is made; so is a wrist on its own hand.
        self.made = {self.pair(contact) for contact in self.data.contact[: self.data.ncon]}
        self.soles = [
            geom
            for geom in range(self.model.ngeom)
            if self.model.geom_contype[geom] and "ankle_roll" in self.name(geom)
        ]
        if not self.soles:
            sys.exit(f"{model}: nothing at its ankles touches the floor")

    def name(self, geom):
        return self.model.body(self.model.geom_bodyid[geom]).name

    def pair(self, contact):
        return frozenset((self.name(contact.geom1), self.name(contact.geom2)))

    def is_touch(self, contact):
        pair = self.pair(contact)
        wrist = all("wrist" in name for name in pair) and len({name.split("_")[0] for name in pair}) == 1
        return contact.dist < -1e-3 and "world" not in pair and pair not in self.made and not wrist

    def lowest_m(self, geom):
        kind, size = self.model.geom_type[geom], self.model.geom_size[geom]
        down = np.abs(self.data.geom_xmat[geom].reshape(3, 3)[2])
        if kind == mujoco.mjtGeom.mjGEOM_SPHERE:
            reach = size[0]
        elif kind == mujoco.mjtGeom.mjGEOM_BOX:
            reach = down @ size
        else:
            sys.exit(f"{self.name(geom)}: a sole is made of boxes or balls here, not of {kind}")
        return self.data.geom_xpos[geom][2] - reach

    def look(self, motion, people):
        count = len(motion)
        links = {f"{side}_{link}" for side in SIDES for _, links in CHAINS.values() for link in links}
        links |= {f"{side}_ankle_roll_link" for side in SIDES}
        at = {link: np.zeros((count, 3)) for link in links}
        low_m, touching = np.zeros(count), np.zeros(count, bool)
        for frame in range(count):
            self.data.qpos[:] = motion[frame]
            mujoco.mj_fwdPosition(self.model, self.data)
            for link in links:
                at[link][frame] = self.data.body(link).xpos
            low_m[frame] = min(self.lowest_m(geom) for geom in self.soles)
            touching[frame] = any(self.is_touch(of) for of in self.data.contact[: self.data.ncon])
        parts = {}
        ends = {}
        looks, human_looks = looking(
            [at[f"left_{link}"] - at[f"right_{link}"] for link in ("hip_roll_link", "shoulder_roll_link")]
        ), looking([people[f"left_{part}"][0] - people[f"right_{part}"][0] for part in ("hip", "shoulder")])
        back = turned("Z", np.degrees(human_looks - looks))
        for side in SIDES:
            for limb, (humans, chain) in CHAINS.items():
                own = [np.einsum("nij,nj->ni", back, at[f"{side}_{link}"]) for link in chain]
                theirs = [people[f"{side}_{human}"][0] for human in humans]
                lengths = []
                for part in range(2):
                    one, two = own[part + 1] - own[part], theirs[part + 1] - theirs[part]
                    sizes = [np.linalg.norm(of, axis=1) for of in (one, two)]
                    lengths.append([np.median(of) for of in sizes])
                    cosine = np.clip(np.sum(one * two, 1) / sizes[0] / sizes[1], -1, 1)
                    parts.setdefault((limb, part), []).append(np.degrees(np.arccos(cosine)).mean())
                own_m, theirs_m = np.sum(lengths, 0)
                wanted = (theirs[2] - theirs[0]) * own_m / theirs_m
                ends.setdefault(limb, []).append(np.linalg.norm(own[2] - own[0] - wanted, axis=1).mean())
        slides = []
        for side in SIDES:
            toe = people[f"{side}_foot"][0]
            stands = speed(toe) < 0.15
            stands &= toe[:, 2] < np.percentile(toe[:, 2], 5) + 0.05
            slides += list(speed(at[f"{side}_ankle_roll_link"])[stands])
        angles, limits = motion[:, 7:], self.model.jnt_range[1:]
        stuck = ((angles < limits[:, 0] + 1e-3) | (angles > limits[:, 1] - 1e-3)).any(1)
        angle = lambda key: np.mean(parts[key])
        return (
            f"{angle(('leg', 0)):.1f} / {angle(('leg', 1)):.1f} / {angle(('arm', 0)):.1f} / {angle(('arm', 1)):.1f} deg"
            f" | {np.mean(ends['arm']) * 100:.1f} / {np.mean(ends['leg']) * 100:.1f} cm"
            f" | {np.mean(slides) * 100:.1f} cm/s | {low_m.min() * 100:.1f} cm, {(low_m < -0.01).mean():.0%}"
            f" | {touching.mean():.1%} | {stuck.mean():.0%} | {np.abs(np.diff(angles, axis=0)).max() * RATE_HZ:.1f} rad/s"
            f" | {np.degrees(looks[-1] - looks[0]):.0f} of {np.degrees(human_looks[-1] - human_looks[0]):.0f} deg"
        )


def looking(across):
    """Where something looks whose left is `across` its right, rad, without jumps of a turn."""
    left = sum(across)
    return np.unwrap(np.arctan2(-left[:, 0], left[:, 1]))


def speed(place):
    return np.linalg.norm(np.gradient(place[:, :2], 1 / RATE_HZ, axis=0), axis=1)


def led_in(motion, people):
    """Frames by which a motion is late: how much its left knee is bent tells best."""
    thigh, shank = (people[f"left_{two}"][0] - people[f"left_{one}"][0] for one, two in (("hip", "knee"), ("knee", "ankle")))
    cosine = np.sum(thigh * shank, 1) / np.linalg.norm(thigh, axis=1) / np.linalg.norm(shank, axis=1)
    bent = np.arccos(np.clip(cosine, -1, 1))
    knee = motion[:, 7 + KNEE]
    late = range(max(1, len(motion) - len(bent) + 1))
    return min(late, key=lambda by: np.std(knee[by:][: len(bent)] - bent[: len(knee) - by]))


def by_gaitway(args, clip):
    """Joint angles that gaitway writes, as MuJoCo has them, and the seconds that it took."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "motion.csv"
        command = [args.gaitway, "retarget", clip, "--robot", args.robot, "--no-retime", "--allow-fall"]
        command += ["--format", "unitree-csv", "--rate", str(RATE_HZ), "-q", "-o", file]
        command += ["--profiles", args.profiles] if args.profiles else []
        began = time.perf_counter()
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        took_s = time.perf_counter() - began
        rows = [[float(cell) for cell in row] for row in csv.reader(file.open())]
    rows = np.array(rows)
    return np.concatenate([rows[:, :3], rows[:, [6, 3, 4, 5]], rows[:, 7:]], 1), took_s


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for option in ("--tables", "--model", "--judge", "--robot"):
        parser.add_argument(option, required=True)
    parser.add_argument("--gaitway", default="gaitway")
    parser.add_argument("--profiles")
    parser.add_argument("--stature", type=float, default=1.765, help="of whoever was captured, m")
    parser.add_argument("clips", nargs="+", type=Path)
    args = parser.parse_args()
    judge = Judge(args.judge)
    print(
        "| clip | by | thigh / shank / upper arm / forearm | hands / feet | slip | lowest, share below -1 cm"
        " | in itself | at a limit | fastest joint | turns | times real time |\n|" + "---|" * 11
    )
    for clip in args.clips:
        people, rate_hz = read_bvh(clip)
        every = round(rate_hz / RATE_HZ)
        if abs(rate_hz / RATE_HZ - every) > 0.01 * every:
            sys.exit(f"{clip}: {rate_hz:.2f} Hz is no multiple of {RATE_HZ:.0f}")
        smplx = turned("X", [90.0])[0]
        people = {
            name: (people[joint][0][::every], people[joint][1][::every] @ smplx) for name, joint in PEOPLE.items()
        }
        count = len(people["pelvis"][0])
        gmr = Gmr(args.tables, args.model, args.stature)
        began = time.perf_counter()
        frames = [gmr.frame(people, at) for at in range(count)]
        took_s = time.perf_counter() - began
        motions = {"GMR": (np.array([frame for frame, _ in frames]), count / RATE_HZ / took_s)}
        motion, took_s = by_gaitway(args, clip)
        motions["gaitway"] = (motion, count / RATE_HZ / took_s)
        seen = {name: (at[ENDS:-ENDS], turn[ENDS:-ENDS]) for name, (at, turn) in people.items()}
        for by, (motion, faster) in motions.items():
            motion = motion[ENDS + led_in(motion, people) :][: count - 2 * ENDS]
            print(f"| {clip.stem} | {by} | {judge.look(motion, seen)} | {faster:.1f} |", flush=True)


if __name__ == "__main__":
    main()
