"""Plays motions with and without balance on MuJoCo's OP3, pushed and on slopes, and in Gaitway's own physics; who falls, and when.

    measure.py GAITWAY MODEL.xml RESULTS.jsonl [PART ...]     runs what RESULTS does not have yet (all parts: 25 minutes of two cores)
    measure.py RESULTS.jsonl                                 prints the tables

Times of pushes are seconds since torque was on, the same for both judges, with and without balance.
"""

import collections
import json
import math
import multiprocessing
import os
import random
import subprocess
import sys
import tempfile

sys.dont_write_bytecode = True  # nothing is left beside the sources
HERE = os.path.dirname(os.path.abspath(__file__))
STAND = os.path.join(HERE, "stand.csv")
# Between which times it is pushed, s since torque was on: after the approach, before the last second.
MOTIONS = {"walk": (2.0, 13.0), "stand": (1.5, 4.5), "bow": (3.2, 4.8), "squat": (3.2, 5.0), "wave-r": (3.2, 7.6), "jumping-jacks": (3.2, 12.2)}
STRENGTHS = {"walk": (6, 10, 14)}
ON_BOTH_FEET = (12, 18, 24)
PUSH_S = 0.1
WAYS = {"ahead": (1, 0), "back": (-1, 0), "left": (0, 1), "right": (0, -1)}
SLOPES_DEG, SLOPE_FROM_S = (2, 4, 6), 1.4
CONDITIONS = {
    "as it is": {}, "mass x 0.8": {"mass": 0.8}, "mass x 1.2": {"mass": 1.2}, "friction 0.5": {"friction": 0.5}, "20 ms late": {"delay_s": 0.02},
}
# What the robot's file says otherwise under [body.balance]: tilt_time_s, gain on the tilt, gain on its rate (s).
GAINS = {
    "no answer": (1.0, 0.0, 0.0),
    "the rate alone": (1.0, 0.0, 0.02),
    "the tilt alone": (1.0, 0.15, 0.0),
    "twice the rate": (1.0, 0.15, 0.04),
    "four times the tilt": (1.0, 0.6, 0.02),
    "twice both": (1.0, 0.3, 0.04),
}
OP3 = os.path.join(HERE, "../../firmware-profiles/robots/op3.toml")
# The virtual robot's clock when torque is on, s: 1.7 s less what a push of 60 N that begins at 1.5 s brings it down later than
# one that is there when it is let go (0.2 s after torque is on).
OWN_ON_S = 0.685


def trials(motion, seeds, slopes=True):
    yield ("nothing", "", 0, 0)
    for way in WAYS:
        for strength in STRENGTHS.get(motion, ON_BOTH_FEET):
            for seed in range(seeds):
                yield ("push", way, strength, seed)
    for way in WAYS if slopes else ():
        for slope in SLOPES_DEG:
            yield ("slope", way, slope, 0)


def jobs(parts):
    """In the order of what matters most."""
    def pairs(judge, motion, condition, seeds, slopes=True):
        for trial in trials(motion, seeds, slopes):
            for balance in (False, True):
                yield judge, motion, condition, balance, *trial

    def finer(condition, balances):
        """Seven more pushes each way as hard as one in two is borne, and slopes between and beyond."""
        for balance in balances:
            for way in WAYS:
                for seed in range(3, 10):
                    for much in (10, 14):
                        yield "mujoco", "walk", condition, balance, "push", way, much, seed
                for much in (5, 6, 7, 8):
                    yield "mujoco", "walk", condition, balance, "slope", way, much, 0

    actions = list(MOTIONS)[2:]
    def few():
        for balance in (False, True):
            yield "mujoco", "walk", "as it is", balance, "nothing", "", 0, 0
            for way in ("left", "right"):
                for much in (2, 6):
                    yield "mujoco", "walk", "as it is", balance, "slope", way, much, 0
        yield "mujoco", "walk", "as it is", True, "slope", "left", 14, 0

    wanted = {
        "walk": lambda: pairs("mujoco", "walk", "as it is", 3),
        "finer": lambda: finer("as it is", (False, True)),
        "gains": lambda: [job for of in GAINS for job in finer(of, (True,))],
        "stand": lambda: pairs("mujoco", "stand", "as it is", 3),
        "actions": lambda: [job for of in actions for job in pairs("mujoco", of, "as it is", 1)],
        "conditions": lambda: sorted(
            (job for of in list(CONDITIONS)[1:] for job in pairs("mujoco", "walk", of, 1)), key=lambda job: (job[4], -job[6], job[5])
        ),
        "own": lambda: [*pairs("own", "walk", "as it is", 3), *pairs("own", "stand", "as it is", 3)],
        "own-actions": lambda: [job for of in actions for job in pairs("own", of, "as it is", 1)],
        "check": few,
    }
    for part in parts or [part for part in wanted if part != "check"]:
        yield from wanted[part]()


def befalls(motion, kind, way, much, seed):
    """Pushes and slope of a trial."""
    if kind == "push":
        from_s, to_s = MOTIONS[motion]
        at_s = random.Random(f"{motion} {way} {much} {seed}").uniform(from_s, to_s)
        return [(at_s, at_s + PUSH_S, WAYS[way][0] * much, WAYS[way][1] * much)], None
    if kind == "slope":
        return [], (SLOPE_FROM_S, *(math.radians(much) * of for of in WAYS[way]))
    return [], None


def robot_of(folder, condition):
    """The robot's file; one of its own where gains are others."""
    if condition not in GAINS:
        return "op3"
    tilt_time_s, tilt, rate_s = GAINS[condition]
    with open(OP3) as file:
        text = file.read()
    for was, is_now in (("tilt_time_s = 1.0", f"tilt_time_s = {tilt_time_s}"), ("0.15, ", f"{tilt}, "), ("0.02 }", f"{rate_s} }}")):
        assert was in text, was
        text = text.replace(was, is_now)
    path = os.path.join(folder, f"op3-{os.getpid()}.toml")
    with open(path, "w") as file:
        file.write(text)
    return path


def command(gaitway, robot, motion, balance, bus):
    motion = STAND if motion == "stand" else motion
    return [gaitway, "play", motion, "--robot", robot, "--json", "--bus", bus] + (["--balance"] if balance else [])


programs = {}


def by_mujoco(tools, job, watch=None):
    import line
    import world

    _, motion, condition, balance, *trial = job
    conditions = CONDITIONS.get(condition, {})
    pushes, slope = befalls(motion, *trial)
    robot = world.World(world.model_of(tools["model"], **conditions), pushes=pushes, slope=slope, seed=trial[-1], watch=watch, **conditions)
    robot_file = robot_of(tools["folder"], condition)
    key = (motion, balance, condition if condition in GAINS else None)
    if key not in programs:
        play = lambda path: command(tools["gaitway"], robot_file, motion, balance, "serial:" + path)
        programs[key] = line.Program(play, tools["clock"], tools["folder"])
    report = json.loads(programs[key].run(robot))
    return report, robot.fell_s, robot.fell_on, {"let_go_s": robot.let_go_s - robot.powered_s, "damaged": robot.bus.ear.damaged}


def by_itself(tools, job):
    _, motion, _, balance, *trial = job
    pushes, slope = befalls(motion, *trial)
    script = ""
    for from_s, to_s, ahead, left in pushes:
        span = f"from_s = {from_s + OWN_ON_S:.4f}\nuntil_s = {to_s + OWN_ON_S:.4f}\n"
        script += f'[[fault]]\nkind = "push"\nahead_n = {ahead}\nleft_n = {left}\n{span}'
    if slope:
        script += f'[[fault]]\nkind = "slope"\nahead_rad = {slope[1]:.5f}\nleft_rad = {slope[2]:.5f}\nfrom_s = {slope[0] + OWN_ON_S}\n'
    with tempfile.NamedTemporaryFile("w", suffix=".toml") as faults:
        faults.write(script)
        faults.flush()
        done = subprocess.run(
            [*command(tools["gaitway"], "op3", motion, balance, "sim"), "--physics", "--faults", faults.name], capture_output=True
        )
    report = json.loads(done.stdout)
    return report, report["fell_at_s"], report["fell_on"] if "fell_on" in report else None, {}


def run(order):
    tools, job = order
    judge = by_itself if job[0] == "own" else by_mujoco
    try:
        report, fell_s, fell_on, more = judge(tools, job)
    except (RuntimeError, ValueError, OSError) as error:
        return {"job": job, "failed": str(error)}
    ended = {"outcome": report["outcome"], "stop": (report.get("stop") or {}).get("code"), "duration_s": report["duration_s"]}
    return {"job": job, "fell_s": fell_s, "fell_on": fell_on, "balance": report.get("balance"), **ended, **more}


def known(path):
    if not os.path.exists(path):
        return {}
    with open(path) as file:
        rows = [json.loads(row) for row in file]
    return {tuple(row["job"]): row for row in rows if "failed" not in row}


def tools_in(folder, gaitway, model):
    clock = os.path.join(folder, "clock.so")
    subprocess.run(["cc", "-O2", "-shared", "-fPIC", "-o", clock, os.path.join(HERE, "clock.c"), "-lpthread"], check=True)
    return {"gaitway": gaitway, "model": model, "clock": clock, "folder": folder}


def measure(gaitway, model, path, parts):
    there = known(path)
    with tempfile.TemporaryDirectory() as folder:
        tools = tools_in(folder, gaitway, model)
        missing = [(tools, job) for job in jobs(parts) if job not in there]
        with multiprocessing.Pool(int(os.environ.get("WORKERS", 2))) as pool, open(path, "a") as file:
            for done, row in enumerate(pool.imap_unordered(run, missing), 1):
                file.write(json.dumps(row) + "\n")
                file.flush()
                if done % 20 == 0:
                    print(f"{done} of {len(missing)}", file=sys.stderr)


def tell(path):
    rows = known(path)
    falls = {job: row["fell_s"] is not None for job, row in rows.items()}

    def table(title, groups):
        print(f"\n{title}\n\n| | borne without | with | only without | only with |\n|---|---|---|---|---|")
        for name, tells in groups:
            without = {job[:3] + job[4:]: fell for job, fell in falls.items() if tells(job) and not job[3]}
            balanced = {job[:3] + job[4:]: fell for job, fell in falls.items() if tells(job) and job[3]}
            both = without.keys() & balanced.keys()
            if both:
                worse = sum(not without[of] and balanced[of] for of in both)
                better = sum(without[of] and not balanced[of] for of in both)
                counts = [sum(not fell[of] for of in both) for fell in (without, balanced)]
                print(f"| {name} | {counts[0]} of {len(both)} | {counts[1]} of {len(both)} | {worse} | {better} |")

    for judge in ("mujoco", "own"):
        for kind in ("nothing", "push", "slope"):
            groups = []
            for motion in MOTIONS:
                for condition in CONDITIONS:
                    is_it = lambda job, m=motion, c=condition: job[:3] == (judge, m, c) and job[4] == kind
                    groups.append((f"{motion}, {condition}", is_it))
            table(f"{judge}: {kind}", groups)
    levels = [(kind, way, much) for kind in ("push", "slope") for much in (2, 4, 5, 6, 7, 8, 10, 12, 14, 18, 24) for way in WAYS]
    for judge in ("mujoco", "own"):
        groups = [
            (" ".join(map(str, level)), lambda job, l=level: job[0] == judge and job[1] == "walk" and job[2] == "as it is" and job[4:7] == l)
            for level in levels
        ]
        table(f"{judge}: walk, each way", groups)
    finest = {job[2:]: fell for job, fell in falls.items() if job[:2] == ("mujoco", "walk") and (job[4] == "slope" and job[6] > 4 or job[7] > 2)}
    print("\nOther gains, the finer course in MuJoCo\n\n| | pushes borne | slopes borne |\n|---|---|---|")
    for name, condition, balance in (("nothing", "as it is", False), ("as shipped", "as it is", True), *((of, of, True) for of in GAINS)):
        of = {kind: [fell for job, fell in finest.items() if job[:3] == (condition, balance, kind)] for kind in ("push", "slope")}
        print(f"| {name} | " + " | ".join(f"{each.count(False)} of {len(each)}" for each in of.values()) + " |")
    print("\nBoth judges, the same pushes and slopes\n\n| | both stay | both fall | MuJoCo alone falls | own alone falls |\n|---|---|---|---|---|")
    agree = collections.defaultdict(collections.Counter)
    for job, fell in falls.items():
        other = ("own", *job[1:])
        if job[0] == "mujoco" and other in falls:
            agree[job[1], job[4], job[3]][fell, falls[other]] += 1
    for (motion, kind, balance), of in agree.items():
        counts = " | ".join(str(of[key]) for key in ((False, False), (True, True), (True, False), (False, True)))
        print(f"| {motion}, {kind}, {'with' if balance else 'without'} | {counts} |")


if __name__ == "__main__":
    if len(sys.argv) == 2:
        tell(sys.argv[1])
    else:
        measure(*sys.argv[1:4], sys.argv[4:])
