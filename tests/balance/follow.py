"""Lets a robot on its own feet follow motions pose by pose (`gaitway live`), in MuJoCo; who falls, and when.

    follow.py GAITWAY MODEL.xml RESULTS.jsonl CONDITION [--OPTION ...] MOTION ...

CONDITION is JSON: {} as it is, or some of mass, friction, stiffness (N m/rad), delay_s. Options are those of `live`, such as --balance.
"""

import json
import multiprocessing
import sys
import tempfile

sys.dont_write_bytecode = True  # nothing is left beside the sources
import line
import measure
import world


def run(order):
    tools, condition, options, motion = order
    live = [tools["gaitway"], "live", "--from", f"file:{motion}", "--robot", "op3", "--json", *options]
    try:
        program = line.Program(lambda path: [*live, "--bus", "serial:" + path], tools["clock"], tools["folder"])
    except OSError as error:
        return {"motion": motion, "failed": str(error)}
    try:
        robot = world.World(world.model_of(tools["model"], **condition), seed=0, **condition)
        report = json.loads(program.run(robot))
    except (RuntimeError, ValueError) as error:
        return {"motion": motion, "failed": str(error)}
    finally:
        program.close()
    told = {key: report.get(key) for key in ("outcome", "stop_reason", "duration_s", "feet", "balance")}
    return {"motion": motion, "fell_s": robot.fell_s, "fell_on": robot.fell_on, "damaged": robot.bus.ear.damaged, **told}


def main(gaitway, model, results, condition, *rest):
    options = [word for word in rest if word.startswith("--")]
    motions = [word for word in rest if not word.startswith("--")]
    condition = json.loads(condition)
    with tempfile.TemporaryDirectory() as folder, open(results, "w") as file:
        tools = measure.tools_in(folder, gaitway, model)
        orders = [(tools, condition, options, motion) for motion in motions]
        with multiprocessing.Pool(2) as pool:
            rows = [row for row in pool.imap(run, orders)]
        file.writelines(json.dumps(row) + "\n" for row in rows)
    followed = [row for row in rows if "failed" not in row]
    for row in rows:
        if "failed" in row:
            print(f"{row['motion']} was not followed: {row['failed']}", file=sys.stderr)
    stayed = sum(row["fell_s"] is None for row in followed)
    stopped = sum(row["outcome"] != "done" for row in followed)
    print(f"{len(followed)} of {len(rows)} followed, {stayed} stayed up, {stopped} were stopped")


if __name__ == "__main__":
    main(*sys.argv[1:])
