"""Plays tables of a robot in MuJoCo's model of it with position servos, on a floor, and says when it falls.

Order (a file of JSON): model, feet, runs: [table, stiffness, friction, mass, delay_s, seed]. Answer: a list of seconds or null.
A model that ends in .toml is a robot's file: its feet are in it, and its servos are so many times as stiff (`stiffness`).
A fall is a link other than a foot on the floor, or 60 deg of tilt. The robot does not meet itself.
"""

import csv, json, sys
import mujoco, numpy as np

import of_file, on_a_floor

order = json.load(open(sys.argv[1]))


def falls(table, stiffness, friction, mass, delay_s, seed):
    if order["model"].endswith(".toml"):
        model, feet = of_file.model_of(order["model"], stiffness, friction, mass)
    else:
        model, feet = on_a_floor.model_of(order["model"], stiffness, friction, mass), order["feet"]
    level = model.geom("level").id
    with open(table) as file:
        rows = list(csv.reader(file))
    titles, rows = rows[0], np.array([[float(cell) for cell in row] for row in rows[1:]])
    column = {title: rows[:, at] for at, title in enumerate(titles)}
    joints = [title[:-4] for title in titles if title.endswith("_rad")]
    data = mujoco.MjData(model)
    places = [model.joint(name).qposadr[0] for name in joints]
    driver = {model.actuator_trnid[a, 0]: a for a in range(model.nu)}
    drivers = [driver[model.joint(name).id] for name in joints]
    goals = np.stack([column[name + "_rad"] for name in joints], 1)
    data.qpos[0:3] = [column[k][0] for k in ("base_x_m", "base_y_m", "base_z_m")]
    data.qpos[3:7] = [column[k][0] for k in ("base_qw", "base_qx", "base_qy", "base_qz")]
    data.qpos[places] = goals[0]
    random = None if seed is None else np.random.default_rng(seed)
    if random is not None:
        data.qpos[places] += random.normal(0, 0.01, len(places))
    trunk = model.jnt_bodyid[0]
    feet = [model.body(name).id for name in feet]
    times, step_s = column["time_s"], model.opt.timestep
    count = int((times[-1] + 1.0) / step_s)
    ticks = np.clip(np.arange(count) * step_s - delay_s, 0, times[-1])
    wanted = np.stack([np.interp(ticks, times, goals[:, k]) for k in range(len(joints))], 1)
    for tick in range(count):
        data.ctrl[drivers] = wanted[tick]
        if random is not None and tick % 50 == 0:
            data.xfrc_applied[trunk, :3] = random.normal(0, 0.5, 3)
        mujoco.mj_step(model, data)
        if tick % 5:
            continue
        met = [(a if b == level else b) for a, b in zip(data.contact.geom1, data.contact.geom2)]
        low = any(model.geom_bodyid[geom] not in feet for geom in met)
        if low or data.xmat[trunk][8] < 0.5:
            return tick * step_s
    return None


print(json.dumps([falls(*run) for run in order["runs"]]))
