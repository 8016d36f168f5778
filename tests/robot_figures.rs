//! What a motion does to all of a robot, held against MuJoCo: depths and lowest points of shapes in
//! random postures, and a written motion whose base is put into MuJoCo's own model of the robot.

mod aloud;
mod captured;
mod program;
mod python;

use aloud::aloud;
use gaitway::retarget::collision::{SelfContact, lowest_m};
use gaitway::rigid::{Placement, Volume};
use gaitway::robot::body::RobotBody;
use glam::{DQuat, DVec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::process::Command;

/// Shapes in the world as bodies of their own: their distances two by two, and how low they reach.
const SHAPES: &str = r#"
import json, sys
import mujoco, numpy as np

random = np.random.default_rng(14)
answers = []
for scene in json.load(open(sys.argv[1])):
    bodies = "".join(f'<body><geom name="g{i}" {g}/></body>' for i, g in enumerate(scene["shapes"]))
    floor = '<geom name="floor" type="plane" size="9 9 1"/>'
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><worldbody>{floor}{bodies}</worldbody></mujoco>')
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    number = lambda name: mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, name)
    between = np.zeros(6)
    round_ones = (int(mujoco.mjtGeom.mjGEOM_CAPSULE), int(mujoco.mjtGeom.mjGEOM_SPHERE))
    capsule = lambda g: int(model.geom_type[g]) in round_ones
    reach = lambda g, ways: (
        ways @ data.geom_xpos[g]
        + (np.abs(ways @ data.geom_xmat[g].reshape(3, 3)[:, 2]) * model.geom_size[g][1]
           + model.geom_size[g][0] if capsule(g)
           else np.abs(ways @ data.geom_xmat[g].reshape(3, 3)) @ model.geom_size[g]))
    def deep(a, b):
        # MuJoCo's own is far off for a capsule whose line is inside a box: the least way out is
        # looked for among directions instead, nearer and nearer to the best.
        best, spread = np.array([0.0, 0.0, 1.0]), 3.0
        for _ in range(40):
            ways = best + spread * random.normal(size=(400, 3))
            ways = np.vstack([best, ways / np.linalg.norm(ways, axis=1)[:, None]])
            depths = reach(a, ways) + reach(b, -ways)
            best, spread = ways[depths.argmin()], spread * (0.75 if spread < 1 else 0.6)
        return -depths.min()
    def apart(a, b):
        found = mujoco.mj_geomDistance(model, data, a, b, 5.0, between)
        mixed = "floor" not in (model.geom(a).name, model.geom(b).name) and capsule(a) != capsule(b)
        return max(deep(a, b) for _ in range(3)) if found < 0 and mixed else found
    answers.append({
        "pairs": [apart(number(f"g{a}"), number(f"g{b}")) for a, b in scene["pairs"]],
        "heights": [apart(number("floor"), number(f"g{i}")) for i in range(len(scene["shapes"]))],
    })
print(json.dumps(answers))
"#;

fn answers(script: &str, name: &str, order: &Value, more: &[&str]) -> Option<Value> {
    let python = match python::python() {
        Ok(python) => python,
        Err(cause) => {
            aloud!("SKIPPED: {name} was not compared: {cause}");
            return None;
        }
    };
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("{name}.figures.json"));
    std::fs::write(&path, order.to_string()).expect("written");
    let mut run = Command::new(&python.program);
    let run = run.args(["-c", script]).arg(&path).args(more).output().expect("Python");
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    Some(serde_json::from_slice(&run.stdout).expect("JSON"))
}

/// A shape as MuJoCo has it.
fn geom(volume: &Volume) -> String {
    let words = |v: DVec3| format!("{} {} {}", v.x, v.y, v.z);
    match volume {
        Volume::Capsule(of) if of.from_m.distance(of.to_m) < 1e-6 => {
            format!(r#"type="sphere" pos="{}" size="{}""#, words(of.from_m), of.radius_m)
        }
        Volume::Capsule(of) => format!(
            r#"type="capsule" fromto="{} {}" size="{}""#,
            words(of.from_m),
            words(of.to_m),
            of.radius_m
        ),
        Volume::Cuboid(of) => format!(
            r#"type="box" size="{}" pos="{}" quat="{} {} {} {}""#,
            words(of.half_m),
            words(of.centre_m),
            of.turn.w,
            of.turn.x,
            of.turn.y,
            of.turn.z
        ),
    }
}

#[test]
fn robots_are_in_themselves_and_in_the_floor_as_deep_as_mujoco_says() {
    let mut random = ChaCha8Rng::seed_from_u64(14);
    for name in gaitway_profiles::robot_names() {
        let file = gaitway_profiles::robot(name).expect("shipped");
        let Some(body) = RobotBody::of(&file).expect("a body") else { continue };
        let start: Vec<f64> = file.joints.iter().map(|joint| joint.initial_rad()).collect();
        let inside = SelfContact::of(&body, &start);
        let (mut scenes, mut ours) = (Vec::new(), Vec::new());
        for _ in 0..25 {
            let mut number = |reach: f64| random.random_range(-reach..reach);
            let turn = DQuat::from_xyzw(number(0.3), number(0.3), number(1.0), 1.0).normalize();
            let base = Placement { at_m: DVec3::new(0.1, -0.2, 0.2 + number(0.2)), turn };
            let pose: Vec<f64> = file.joints.iter().map(|_| number(1.2)).collect();
            let placed = body.tree.place(base, &body.angles(&pose));
            let shapes: Vec<(usize, Volume)> = body
                .volumes
                .iter()
                .enumerate()
                .flat_map(|(link, all)| {
                    let place = placed[link];
                    all.iter().map(move |volume| (link, volume.placed(place)))
                })
                .collect();
            let pairs: Vec<(usize, usize)> = (0..shapes.len())
                .flat_map(|a| (a + 1..shapes.len()).map(move |b| (a, b)))
                .filter(|&(a, b)| !body.are_neighbours(shapes[a].0, shapes[b].0))
                .filter(|&(a, b)| !inside.overlarge().contains(&(shapes[a].0, shapes[b].0)))
                .collect();
            ours.push((
                inside.deepest(&placed).map_or(0.0, |o| o.depth_m),
                lowest_m(&body, &placed),
            ));
            let words: Vec<String> = shapes.iter().map(|(_, volume)| geom(volume)).collect();
            scenes.push(json!({"shapes": words, "pairs": pairs}));
        }
        let Some(theirs) = answers(SHAPES, name, &json!(scenes), &[]) else { return };
        let (mut deep, mut apart) = (0, 0.0_f64);
        for ((depth_m, low_m), answer) in ours.iter().zip(theirs.as_array().expect("a list")) {
            let least = |list: &Value| {
                let all = list.as_array().expect("a list").iter();
                all.map(|value| value.as_f64().expect("a number")).fold(f64::MAX, f64::min)
            };
            let depth_theirs_m = (-least(&answer["pairs"])).max(0.0);
            deep += usize::from(depth_theirs_m > 1e-3);
            apart = apart.max((depth_m - depth_theirs_m).abs());
            // Soles may reach below the shapes by as much as files are rounded.
            let off_m = low_m - least(&answer["heights"]);
            assert!((-2e-3..1e-6).contains(&off_m), "{name}: {low_m} {off_m}");
        }
        aloud!("{name}: {deep} of {} postures in themselves, apart by {apart:.1e} m", ours.len());
        assert!(apart < 1e-4, "{name}: {apart} m");
        assert!(deep > 0, "{name}: no posture touches itself, so nothing was compared");
    }
}

/// Puts the rows of a table into a model of the robot, and looks at its feet and its weight.
const ROWS: &str = r#"
import csv, json, sys
import mujoco, numpy as np

order = json.load(open(sys.argv[1]))
model = mujoco.MjModel.from_xml_path(order["model"])
data = mujoco.MjData(model)
rows = list(csv.reader(open(order["table"])))
titles, rows = rows[0], np.array([[float(cell) for cell in row] for row in rows[1:]])
column = {title: rows[:, at] for at, title in enumerate(titles)}
joints = [t[:-4] for t in titles if t.endswith("_rad")]
feet = [model.body(name).id for name in order["feet"]]
corners = {}
for foot in feet:
    corners[foot] = [(model.geom_pos[g], model.geom_quat[g], model.geom_size[g])
                     for g in range(model.ngeom) if model.geom_bodyid[g] == foot]
def hull_holds(points, at):
    points = np.array(points)
    if len(points) < 3:
        return False
    angles = np.linspace(0, 2 * np.pi, 720)
    ways = np.stack([np.cos(angles), np.sin(angles)], 1)
    return bool(np.all((points @ ways.T).max(0) >= ways @ at))
lows, stands, inside, soles = [], [], [], []
for row in range(len(rows)):
    data.qpos[0:3] = [column[k][row] for k in ("base_x_m", "base_y_m", "base_z_m")]
    data.qpos[3:7] = [column[k][row] for k in ("base_qw", "base_qx", "base_qy", "base_qz")]
    for name in joints:
        data.qpos[model.joint(name).qposadr[0]] = column[name + "_rad"][row]
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    floor, low, where = [], [], []
    for foot in feet:
        points = []
        for pos, quat, size in corners[foot]:
            turn, place = np.zeros(9), np.zeros(3)
            q = np.zeros(4)
            mujoco.mju_mulQuat(q, data.xquat[foot], quat)
            mujoco.mju_quat2Mat(turn, q)
            mujoco.mju_rotVecQuat(place, pos, data.xquat[foot])
            place += data.xpos[foot]
            signs = [(a, b, c) for a in (-1, 1) for b in (-1, 1) for c in (-1, 1)]
            points += [place + turn.reshape(3, 3) @ (size * np.array(s)) for s in signs]
        low.append(min(point[2] for point in points))
        where.append(data.xpos[foot][:2].tolist())
        floor += [point[:2] for point in points if point[2] < 0.005]
    lows.append(low)
    soles.append(where)
    inside.append(hull_holds(floor, data.subtree_com[model.body("body_link").id][:2]))
print(json.dumps({"lows": lows, "inside": inside, "soles": soles}))
"#;

fn folder() -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("robot-figures");
    std::fs::create_dir_all(&folder).expect("a temporary folder");
    folder
}

/// The report of a motion that is written to a table.
fn retargeted(motion: &str, table: &Path, more: &[&str]) -> Value {
    let mut command = program::gaitway();
    command.args(["retarget", motion, "--robot", "op3", "--json", "--force", "-o"]).arg(table);
    let output = command.args(more).output().expect("the command");
    assert!(output.status.success(), "{output:?}");
    serde_json::from_slice(&output.stdout).expect("JSON")
}

#[test]
fn a_written_motion_stands_on_the_floor_of_mujocos_model() {
    let Some(robots) = captured::captured("robots") else { return };
    let model = robots.join("robotis_op3/robotis_op3_lite.xml");
    for motion in ["bow", "squat", "walk:x2"] {
        let table = folder().join("table.csv");
        let report = retargeted(motion, &table, &["--rate", "100"]);
        let order =
            json!({"model": model, "table": table, "feet": ["l_ank_roll_link", "r_ank_roll_link"]});
        let Some(answer) = answers(ROWS, motion, &order, &[]) else { return };
        let list = |name: &str| answer[name].as_array().expect("a list").clone();
        for (row, low) in list("lows").iter().enumerate() {
            let low_m = low[0].as_f64().unwrap().min(low[1].as_f64().unwrap());
            assert!(low_m.abs() < 1e-3, "{motion}, row {row}: the lower sole is at {low_m} m");
        }
        // Slowly enough, the zero-moment point is where the centre of mass is.
        let inside = list("inside");
        let share = inside.iter().filter(|is| **is == Value::Bool(false)).count() as f64
            / inside.len() as f64;
        let metrics = &report["metrics"];
        let told = metrics["unbalanced_share"].as_f64().expect("a share");
        aloud!("{motion}: outside its soles {share:.3} of the time by MuJoCo, {told:.3} by ours");
        assert!((share - told).abs() < 0.05, "{motion}: {share} {told}");
        assert_eq!(metrics["penetration_share"], 0.0);
    }
}

/// Torques that a table asks of a robot's joints, by MuJoCo's inverse dynamics; of what the floor has to give, each foot's
/// part as the zero-moment point lies between them. Then the most as part of what an XM430-W350 has by its maker's page (12 V: 4.1 N m,
/// 46 turns a minute), and the jerk.
const EFFORTS: &str = r#"
import csv, json, sys
import mujoco, numpy as np

order = json.load(open(sys.argv[1]))
model = mujoco.MjModel.from_xml_path(order["model"])
model.dof_damping[:], model.dof_frictionloss[:] = 0, 0
model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT) | int(mujoco.mjtDisableBit.mjDSBL_LIMIT)
model.opt.gravity[:] = [0, 0, -9.80665]
data = mujoco.MjData(model)
rows = list(csv.reader(open(order["table"])))
titles, rows = rows[0], np.array([[float(cell) for cell in row] for row in rows[1:]])
column = {title: rows[:, at] for at, title in enumerate(titles)}
joints = [t[:-4] for t in titles if t.endswith("_rad")]
places = np.zeros((len(rows), model.nq))
places[:, 0:3] = np.stack([column[k] for k in ("base_x_m", "base_y_m", "base_z_m")], 1)
places[:, 3:7] = np.stack([column[k] for k in ("base_qw", "base_qx", "base_qy", "base_qz")], 1)
for name in joints:
    places[:, model.joint(name).qposadr[0]] = column[name + "_rad"]
step = 0.01
feet = [model.body(name).id for name in ("l_ank_roll_link", "r_ank_roll_link")]
weight = sum(model.body_mass) * 9.80665
def speed(one, two):
    found = np.zeros(model.nv)
    mujoco.mj_differentiatePos(model, found, step, one, two)
    return found
def corners(foot):
    found = []
    for g in range(model.ngeom):
        if model.geom_bodyid[g] == foot and model.geom_type[g] == int(mujoco.mjtGeom.mjGEOM_BOX):
            signs = [(a, b, c) for a in (-1, 1) for b in (-1, 1) for c in (-1, 1)]
            turn = data.geom_xmat[g].reshape(3, 3)
            found += [data.geom_xpos[g] + turn @ (model.geom_size[g] * np.array(s)) for s in signs]
    return np.array([at[:2] for at in found if at[2] < 0.005])
torques = []
for at in range(len(rows)):
    before, after = places[max(at - 1, 0)], places[min(at + 1, len(rows) - 1)]
    coming, going = speed(before, places[at]), speed(places[at], after)
    data.qpos[:], data.qvel[:], data.qacc[:] = places[at], (coming + going) / 2, (going - coming) / step
    mujoco.mj_inverse(model, data)
    needed = data.qfrc_inverse.copy()
    force = needed[0:3].copy()
    if not order["hangs"] and force[2] > 0.1 * weight:
        turn = data.xmat[1].reshape(3, 3)
        moment = turn @ needed[3:6] + np.cross(data.qpos[0:3], force)
        point = np.array([-moment[1], moment[0]]) / force[2]
        left_over = moment[2] - (point[0] * force[1] - point[1] * force[0])
        stand = [(foot, corners(foot).mean(0)) for foot in feet if len(corners(foot))]
        parts = [1.0]
        if len(stand) == 2:
            way = stand[1][1] - stand[0][1]
            second = np.clip((point - stand[0][1]) @ way / (way @ way), 0, 1)
            parts = [1 - second, second]
        off = point - sum(part * where for part, (_, where) in zip(parts, stand)) if stand else 0
        for part, (foot, where) in zip(parts, stand):
            moves, turns = np.zeros((3, model.nv)), np.zeros((3, model.nv))
            mujoco.mj_jac(model, data, moves, turns, np.append(where + off, 0.0), foot)
            needed -= part * (moves.T @ force + turns.T @ [0, 0, left_over])
        # What is held in the air is held by nobody.
        assert not stand or np.abs(needed[0:6]).max() < 1e-6, needed[0:6]
    torques.append([needed[model.joint(name).dofadr[0]] for name in joints])
torques = np.array(torques)
# Butterworth's second order forward and backward, 8 Hz in all, ends reflected at their points.
warped = np.tan(np.pi * 8 * step) / (np.sqrt(2) - 1) ** 0.25
scale = 1 + np.sqrt(2) * warped + warped ** 2
b, a = warped ** 2 / scale, [2 * (warped ** 2 - 1) / scale, (1 - np.sqrt(2) * warped + warped ** 2) / scale]
def once(x):
    y, x = np.array(x), np.array(x)
    for at in range(len(x)):
        x1, x2 = x[max(at - 1, 0)], x[max(at - 2, 0)]
        y1, y2 = (y[max(at - 1, 0)], y[max(at - 2, 0)]) if at else (x[0], x[0])
        if at == 1: y2 = x[0]
        y[at] = b * (x[at] + 2 * x1 + x2) - a[0] * y1 - a[1] * y2
    return y
pad = 60
padded = np.concatenate([2 * torques[0] - torques[pad:0:-1], torques, 2 * torques[-1] - torques[-2:-pad - 2:-1]])
smooth = once(once(padded)[::-1])[::-1][pad:-pad]
angles = np.stack([column[name + "_rad"] for name in joints], 1)
ends = np.concatenate([angles[:1], angles, angles[-1:]])
speeds = (ends[2:] - ends[:-2]) / (2 * step)
answer = {}
for key, share in (("peak_torque", smooth / 4.1), ("peak_voltage", smooth / 4.1 + speeds / (46 * 2 * np.pi / 60))):
    row, joint = np.unravel_index(np.abs(share).argmax(), share.shape)
    answer[key] = {"share": float(np.abs(share).max()), "joint": joints[joint], "at_s": row * step}
clip = angles[int(np.ceil(order["begins_s"] / step - 1e-9)):]
answer["jerk_rms_rad_s3"] = float(np.sqrt((np.diff(clip, 3, axis=0) ** 2).mean()) / step ** 3)
print(json.dumps(answer))
"#;

#[test]
fn what_servos_have_to_give_is_what_mujoco_says() {
    let Some(robots) = captured::captured("robots") else { return };
    let model = robots.join("robotis_op3/robotis_op3_lite.xml");
    for (motion, hangs) in [
        ("squat", false),
        ("bow", false),
        ("kick-r", false),
        ("side-kick-l", true),
        ("walk:x2", false),
    ] {
        let table = folder().join("efforts.csv");
        let more: &[&str] = if hangs { &["--rate", "100", "--hang"] } else { &["--rate", "100"] };
        let report = retargeted(motion, &table, more);
        let begins_s = &report["approach_s"];
        let order = json!({"model": model, "table": table, "hangs": hangs, "begins_s": begins_s});
        let Some(answer) = answers(EFFORTS, &format!("efforts-{motion}"), &order, &[]) else {
            return;
        };
        let metrics = &report["metrics"];
        for key in ["peak_torque", "peak_voltage"] {
            let [ours, theirs] = [&metrics[key], &answer[key]];
            let share = |of: &Value| of["share"].as_f64().expect("a share");
            aloud!("{motion}: {key} {ours}, by MuJoCo {theirs}");
            assert!((share(ours) - share(theirs)).abs() < 0.003, "{motion}: {ours} {theirs}");
            assert_eq!(ours["joint"], theirs["joint"], "{motion}");
        }
        let [ours, theirs] =
            [metrics, &answer].map(|of| of["jerk_rms_rad_s3"].as_f64().expect("a jerk"));
        assert!((ours / theirs - 1.0).abs() < 0.01, "{motion}: jerk {ours}, {theirs}");
    }
}

#[test]
fn a_capture_on_a_stand_is_as_slow_as_its_servos_need() {
    let Some(captures) = captured::captured("mocap/bvh") else { return };
    let mut most = 0.0_f64;
    for name in ["dash_normal_001", "slash_normal_001", "respond_normal_001", "bow_normal_001"] {
        let file = captures.join(format!("bandai/dataset-1_{name}.bvh"));
        let table = folder().join("paced.csv");
        let report = retargeted(file.to_str().expect("a path"), &table, &["--hang"]);
        for key in ["peak_torque", "peak_voltage"] {
            let share = report["metrics"][key]["share"].as_f64().expect("a share");
            assert!(share <= 0.9, "{name}: {key} {share}");
            most = most.max(share);
        }
    }
    // By the limits of velocity and acceleration alone each of these asks for all of the voltage, or more.
    assert!(most > 0.8, "nothing is slowed for its servos: {most}");
}

#[test]
fn a_table_with_a_base_is_played_and_tells_the_same_of_itself() {
    let table = folder().join("kick.csv");
    let first = retargeted("kick-r", &table, &["--allow-fall"]);
    let again = folder().join("again.csv");
    let second = retargeted(table.to_str().expect("a path"), &again, &[]);
    for (figure, near) in
        [("self_collision_depth_m", 1e-4), ("unbalanced_share", 0.03), ("balance_margin_m", 0.01)]
    {
        let [one, two] = [&first, &second].map(|r| r["metrics"][figure].as_f64().expect(figure));
        assert!((one - two).abs() < near, "{figure}: {one}, then {two}");
    }
    assert!(first["metrics"]["predicted_fall_s"].is_number());
    assert!(second["metrics"]["predicted_fall_s"].is_number());
    assert_eq!(second["metrics"]["hand_error_m"], Value::Null, "nobody's hands");
    let hung = retargeted("kick-r", &table, &["--hang"]);
    assert_eq!(hung["metrics"]["predicted_fall_s"], Value::Null);
    let text = std::fs::read_to_string(&table).expect("a table");
    let titles = text.lines().next().expect("titles");
    assert!(titles.ends_with(
        "base_x_m,base_y_m,base_z_m,base_qw,base_qx,base_qy,base_qz,contact_left,contact_right"
    ));
    // A base that is turned by no rotation is refused with its line.
    let broken: Vec<String> = text
        .lines()
        .enumerate()
        .map(|(at, line)| {
            let mut cells: Vec<&str> = line.split(',').collect();
            let count = cells.len();
            if at == 3 {
                cells[count - 6] = "5.0";
            }
            cells.join(",")
        })
        .collect();
    std::fs::write(&table, broken.join("\n")).expect("written");
    let output = program::gaitway()
        .args(["retarget", table.to_str().expect("a path"), "--robot", "op3", "-o"])
        .arg(folder().join("never.csv"))
        .output()
        .expect("the command");
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1));
    assert!(said.contains("rotation") && said.contains("line 4"), "{said}");
}
