//! Models of robots are read as MuJoCo reads them: places of links, centre of mass and the torques of
//! a motion, in random postures. MuJoCo is its makers' package for Python, `mujoco`.

mod aloud;
mod captured;
mod python;

use aloud::aloud;
use gaitway::rigid::{Capsule, Placement, TreeMotion, Volume};
use gaitway::robot::Robot;
use gaitway::robot::body::RobotBody;
use gaitway::robot::model::surface::Surface;
use gaitway::robot::model::{self, DraftServo, Provenance, PublicModel, Reduced};
use gaitway::robot::urdf_text::urdf;
use gaitway_profiles::{Anatomy, Segment};
use glam::{DQuat, DVec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::Command;

/// Places every body, and takes the inverse dynamics without armature, damping and friction
/// (`mj_rne` knows none of them), for each posture on the standard input.
const SCRIPT: &str = r#"
import json, re, sys
import mujoco, numpy as np

order = json.load(open(sys.argv[1]))
text = open(order["model"]).read()
if "</robot>" in text:
    # Fixed links stay links, and moments of inertia what they are.
    text = re.sub("<mujoco>.*?</mujoco>", "", text, flags=re.S)
    text = text.replace("</robot>", '<mujoco><compiler fusestatic="false" boundmass="0" '
                        'discardvisual="false" autolimits="true"/></mujoco></robot>')
model = mujoco.MjModel.from_xml_string(text)
data = mujoco.MjData(model)
model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
model.opt.gravity[:] = [0, 0, -9.81]
joints = {model.joint(i).name: model.joint(i) for i in range(model.njnt)}
free = [j for j in range(model.njnt) if model.jnt_type[j] == mujoco.mjtJoint.mjJNT_FREE]
answers = []
for posture in order["postures"]:
    data.qpos[:] = 0
    data.qvel[:] = 0
    qacc = np.zeros(model.nv)
    for name, (q, v, a) in posture["joints"].items():
        data.qpos[joints[name].qposadr[0]] = q
        data.qvel[joints[name].dofadr[0]] = v
        qacc[joints[name].dofadr[0]] = a
    turn = np.zeros(9)
    if free:
        at, dof = model.jnt_qposadr[free[0]], model.jnt_dofadr[free[0]]
        data.qpos[at:at + 7] = posture["base"]
        mujoco.mju_quat2Mat(turn, np.array(posture["base"][3:]))
        turn = turn.reshape(3, 3)
        # MuJoCo has a free body's spin, and its torque, in the body's own axes.
        data.qvel[dof:dof + 3] = posture["velocity"]
        data.qvel[dof + 3:dof + 6] = turn.T @ posture["spin"]
        qacc[dof:dof + 3] = posture["acceleration"]
        qacc[dof + 3:dof + 6] = turn.T @ posture["spin_rate"]
    data.qacc[:] = qacc
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_comVel(model, data)
    forces = np.zeros(model.nv)
    mujoco.mj_rne(model, data, 1, forces)
    answer = {
        "bodies": {model.body(i).name: data.xpos[i].tolist() for i in range(model.nbody)},
        "turns": {model.body(i).name: data.xquat[i].tolist() for i in range(model.nbody)},
        "joints": {name: forces[j.dofadr[0]] for name, j in joints.items()},
        "centre": {model.body(i).name: data.subtree_com[i].tolist() for i in range(model.nbody)},
        "mass": {model.body(i).name: float(model.body_subtreemass[i]) for i in range(model.nbody)},
    }
    if free:
        answer["force"] = forces[dof:dof + 3].tolist()
        answer["torque"] = (turn @ forces[dof + 3:dof + 6]).tolist()
    answers.append(answer)
print(json.dumps(answers))
"#;

/// How each position servo of a model holds its joint, as MuJoCo has compiled it.
const SERVOS: &str = r#"
import json, sys
import mujoco, numpy as np

model = mujoco.MjModel.from_xml_path(sys.argv[1])
answer = {}
for at in range(model.nu):
    joint, gear = model.actuator_trnid[at, 0], model.actuator_gear[at, 0]
    dof = model.jnt_dofadr[joint]
    limits = []
    if model.actuator_forcelimited[at]:
        limits.append(min(abs(model.actuator_forcerange[at])) * abs(gear))
    if model.jnt_actfrclimited[joint]:
        limits.append(min(abs(model.jnt_actfrcrange[joint])))
    damping = np.atleast_1d(model.dof_damping[dof])[0]
    answer[model.joint(joint).name] = [
        model.actuator_gainprm[at, 0] * gear**2, damping - model.actuator_biasprm[at, 2] * gear**2,
        model.dof_armature[dof], model.dof_frictionloss[dof], min(limits) if limits else None]
print(json.dumps(answer))
"#;

/// How far ours may be from MuJoCo's: m, and N m or N.
const NEAR: f64 = 1e-6;

fn mujoco(model: &Path, postures: &[Value]) -> Result<Vec<Value>, String> {
    let python = python::python()?;
    let name = model.file_name().expect("a file").to_string_lossy().into_owned();
    let order = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("{name}.postures.json"));
    std::fs::write(&order, json!({"model": model, "postures": postures}).to_string()).unwrap();
    let run =
        Command::new(&python.program).args(["-c", SCRIPT]).arg(&order).output().expect("Python");
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    let answers: Vec<Value> = serde_json::from_slice(&run.stdout).expect("JSON");
    Ok(answers)
}

fn read(path: &Path) -> PublicModel {
    let text = std::fs::read_to_string(path).expect("a model");
    model::read(&text, &mut |_| Err("not asked for here".to_owned()))
        .unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

fn vector(value: &Value) -> DVec3 {
    let of = |at: usize| value[at].as_f64().expect("a number");
    DVec3::new(of(0), of(1), of(2))
}

/// The largest differences between ours and MuJoCo's: places (m), turns, centre of mass (m), forces.
#[derive(Debug, Default)]
struct Apart {
    place: f64,
    turn: f64,
    centre: f64,
    force: f64,
}

fn compared(path: &Path) -> Result<(PublicModel, Apart), String> {
    let found = read(path);
    let mut random = ChaCha8Rng::seed_from_u64(14);
    let mut number = |reach: f64| random.random_range(-reach..reach);
    let mut motions = Vec::new();
    let mut postures = Vec::new();
    for _ in 0..20 {
        let turn = DQuat::from_xyzw(number(1.0), number(1.0), number(1.0), 1.0).normalize();
        let mut point = |reach: f64| DVec3::new(number(reach), number(reach), number(reach));
        let (at_m, velocity_m_s, spin_rad_s) = (point(1.0), point(2.0), point(3.0));
        let (acceleration_m_s2, spin_rate_rad_s2) = (point(5.0), point(10.0));
        let moving = found.tree.moving();
        let mut list = |reach: f64| (0..moving).map(|_| number(reach)).collect::<Vec<f64>>();
        let (angles, rates, accelerations) = (list(1.0), list(3.0), list(20.0));
        let joints: serde_json::Map<String, Value> = found
            .joints
            .iter()
            .enumerate()
            .map(|(j, joint)| (joint.name.clone(), json!([angles[j], rates[j], accelerations[j]])))
            .collect();
        postures.push(json!({
            "base": [at_m.x, at_m.y, at_m.z, turn.w, turn.x, turn.y, turn.z],
            "velocity": velocity_m_s.to_array(), "spin": spin_rad_s.to_array(),
            "acceleration": acceleration_m_s2.to_array(),
            "spin_rate": spin_rate_rad_s2.to_array(), "joints": joints,
        }));
        motions.push(TreeMotion {
            base: Placement { at_m, turn },
            velocity_m_s,
            spin_rad_s,
            acceleration_m_s2,
            spin_rate_rad_s2,
            angles,
            rates,
            accelerations,
        });
    }
    let answers = mujoco(path, &postures)?;
    let mut apart = Apart::default();
    for (motion, answer) in motions.iter_mut().zip(&answers) {
        let is_free = answer.get("force").is_some();
        let root = found.tree.links()[0].name.clone();
        if !is_free {
            // Where MuJoCo has put what is screwed down.
            let turn = &answer["turns"][&root];
            let q = |at: usize| turn[at].as_f64().unwrap_or(f64::from(u8::from(at == 0)));
            let at_m = answer["bodies"].get(&root).map_or(DVec3::ZERO, vector);
            let base = Placement { at_m, turn: DQuat::from_xyzw(q(1), q(2), q(3), q(0)) };
            *motion = TreeMotion {
                rates: motion.rates.clone(),
                accelerations: motion.accelerations.clone(),
                ..TreeMotion::at_rest(base, motion.angles.clone())
            };
        }
        let placed = found.tree.place(motion.base, &motion.angles);
        let mut looked_at = 0;
        for (link, placement) in found.tree.links().iter().zip(&placed) {
            let Some(body) = answer["bodies"].get(&link.name) else { continue };
            looked_at += 1;
            apart.place = apart.place.max(vector(body).distance(placement.at_m));
            let turn = &answer["turns"][&link.name];
            let q = |at: usize| turn[at].as_f64().expect("a number");
            let turn = DQuat::from_xyzw(q(1), q(2), q(3), q(0));
            apart.turn = apart.turn.max((turn.inverse() * placement.turn).xyz().length());
        }
        // MuJoCo has no links between the joints of one body, and takes a weightless root for the world.
        let between = found.tree.links().iter().filter(|link| link.name.contains(" before "));
        let expected = placed.len() - between.count() - 1;
        assert!(looked_at >= expected, "{looked_at} of {} links", placed.len());
        let top = if answer["mass"].get(&root).is_some() { root.as_str() } else { "world" };
        let mass_kg = answer["mass"][top].as_f64().expect("a mass");
        assert!((found.tree.mass_kg() - mass_kg).abs() < 1e-9, "{mass_kg} kg");
        let centre = found.tree.centre_of_mass_m(&placed);
        apart.centre = apart.centre.max(centre.distance(vector(&answer["centre"][top])));
        let efforts = found.tree.inverse_dynamics(motion, DVec3::new(0.0, 0.0, -9.81));
        for (joint, effort) in found.joints.iter().zip(&efforts.joints) {
            let theirs = answer["joints"][&joint.name].as_f64().expect("a torque");
            apart.force = apart.force.max((effort - theirs).abs());
        }
        if is_free {
            let (force, torque) = (vector(&answer["force"]), vector(&answer["torque"]));
            apart.force = apart.force.max(efforts.base_force_n.distance(force));
            apart.force = apart.force.max(efforts.base_torque_nm.distance(torque));
        }
    }
    Ok((found, apart))
}

fn held_to(path: &Path) -> Result<PublicModel, String> {
    let (found, apart) = compared(path)?;
    let name = path.file_name().expect("a file").to_string_lossy();
    aloud!(
        "{name}: {} links, {} joints, {:.3} kg; apart by {:.1e} m, {:.1e} m, {:.1e} N m",
        found.tree.links().len(),
        found.joints.len(),
        found.tree.mass_kg(),
        apart.place,
        apart.centre,
        apart.force
    );
    let worst = apart.place.max(apart.turn).max(apart.centre).max(apart.force);
    assert!(worst < NEAR, "{name}: {apart:?}");
    Ok(found)
}

/// Every way MJCF has to turn and to size things, in one chain.
const MADE_MJCF: &str = r#"<mujoco model="made">
  <compiler angle="degree" eulerseq="XYz"/>
  <default>
    <geom density="700"/>
    <default class="arm">
      <joint axis="0 1 0" range="-90 45"/>
      <geom type="capsule" size="0.03 0.1"/>
      <default class="hand"><geom type="box" size="0.02 0.03 0.04"/></default>
    </default>
  </default>
  <worldbody>
    <geom type="plane" size="1 1 1"/>
    <body name="trunk" pos="0 0 1">
      <freejoint name="root"/>
      <inertial pos="0.01 0 0.02" quat="0.9 0.1 0.2 0.3" mass="3" diaginertia="0.02 0.03 0.04"/>
      <body name="upper" childclass="arm" pos="0.1 0.2 0.3" euler="30 -40 20">
        <joint name="shoulder" pos="0.01 0.02 -0.03"/>
        <geom pos="0 0 -0.1"/>
        <geom fromto="0 0 0 0.1 0.05 -0.1" mass="0.2"/>
        <body name="fore" pos="0 0 -0.2" axisangle="1 2 3 50">
          <joint name="elbow" axis="1 0 0.5"/>
          <joint name="twist" axis="0 0 2" pos="0.02 0 0"/>
          <geom type="cylinder" size="0.02 0.08"/>
          <geom type="ellipsoid" size="0.02 0.03 0.05" pos="0.1 0 0" zaxis="1 1 0"/>
          <body name="palm" pos="0 0.1 -0.1" xyaxes="0 1 0.2 -1 0 0">
            <joint name="reach" type="slide" axis="1 1 0" range="0 0.1"/>
            <geom class="hand" pos="0 0 0.01"/>
            <geom type="sphere" size="0.03" contype="0" conaffinity="0"/>
          </body>
        </body>
      </body>
      <body name="leg" pos="0 -0.1 -0.2">
        <joint name="hip" axis="1 0 0"/>
        <inertial pos="0 0.01 -0.1" mass="1.5" fullinertia="0.01 0.011 0.004 0.001 -0.0005 0.0002"/>
      </body>
    </body>
  </worldbody>
  <actuator><motor joint="shoulder"/><motor joint="elbow"/><motor joint="hip"/></actuator>
  <equality><joint joint1="twist" joint2="elbow" polycoef="0.1 -0.5 0 0 0"/></equality>
</mujoco>"#;

const MADE_URDF: &str = r#"<robot name="made">
  <link name="base"/>
  <link name="one"><inertial><origin xyz="0.1 0 0.02" rpy="0.1 0.2 0.3"/><mass value="1.2"/>
    <inertia ixx="0.01" iyy="0.02" izz="0.015" ixy="0.001" ixz="-0.002" iyz="0.0005"/></inertial></link>
  <link name="two"><inertial><mass value="0.4"/>
    <inertia ixx="0.001" iyy="0.001" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="three"><inertial><origin xyz="0 0.05 0"/><mass value="0.3"/>
    <inertia ixx="0.001" iyy="0.002" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="b" type="prismatic"><parent link="one"/><child link="two"/>
    <origin xyz="0.3 0 0" rpy="0 -0.7 0.4"/><axis xyz="0 1 1"/>
    <limit lower="0" upper="0.2" effort="1" velocity="1"/></joint>
  <joint name="a" type="revolute"><parent link="base"/><child link="one"/>
    <origin xyz="0 0.1 0.5" rpy="0.3 0.2 -1.1"/><axis xyz="0 0 1"/>
    <limit lower="-1" upper="2" effort="1" velocity="1"/></joint>
  <joint name="c" type="continuous"><parent link="two"/><child link="three"/><axis xyz="1 0 0"/>
    <mimic joint="a" multiplier="-0.5" offset="0.2"/></joint>
</robot>"#;

/// The robot file that is drafted of a model, with the anatomy that was guessed.
fn drafted(found: &PublicModel, reduced: &Reduced) -> gaitway_profiles::Robot {
    let (name, fastest_rad_s) = (Some("xm430-w350".to_owned()), Some(1.0));
    let servo = DraftServo { name, fastest_rad_s, baud_bps: 1_000_000 };
    let here = || "here".to_owned();
    let words = Provenance { source: here(), licence: here(), shape_source: here() };
    let text = found.draft_text(reduced, &words, "drafted", &servo);
    gaitway_profiles::parse_robot("drafted.toml", &text).expect("a draft")
}

fn played(of: &Anatomy) -> BTreeMap<Segment, String> {
    of.segments.iter().map(|link| (link.segment, link.joint.clone())).collect()
}

/// The robots that ship, as URDF, of which nothing but places of joints, masses and shapes is left: which joint moves
/// what was written by hand.
#[test]
fn of_robots_that_ship_the_anatomy_is_guessed_that_somebody_wrote() {
    for (robot, otherwise, posed) in [
        ("op3", &[][..], &[][..]),
        // Its head looks down with its joint at zero.
        ("op2", &[], &["head_tilt"]),
        ("toddlerbot", &[], &[]),
        ("poppy-humanoid", &[], &[]),
        ("open-duck-mini-v2", &[], &[]),
        // Behind the elbow one more joint turns the forearm: the file has the elbow.
        ("berkeley-humanoid-lite", &[Segment::LeftForearm, Segment::RightForearm], &[]),
    ] {
        let shipped = Robot::load(robot).expect("a robot");
        let body = RobotBody::of(&shipped.file).expect("a tree").expect("a body");
        let text = urdf(robot, &body, &shipped.limits());
        let found = model::read(&text, &mut |_| Err("none".to_owned())).expect("a model");
        let mut reduced = found.on_its_own().expect("joints");
        // A URDF says nothing of soles: they are where the file has them.
        for link in &mut reduced.links {
            let name = link.joint.map(|joint| reduced.joints[joint].name.clone());
            let mut of = shipped.file.body.as_ref().expect("a body").links.iter();
            let own = of.find(|of| of.joint == name).and_then(|of| of.sole_m.as_ref());
            link.sole_m = own.into_iter().flatten().map(|corner| DVec3::from(*corner)).collect();
        }
        let guessed = found.anatomy(&reduced).unwrap_or_else(|reason| panic!("{robot}: {reason}"));
        let wrote = shipped.file.anatomy.as_ref().expect("an anatomy");
        assert_eq!(guessed.base, wrote.base, "{robot}");
        let (ours, theirs) = (played(&guessed), played(wrote));
        let all: BTreeSet<Segment> = ours.keys().chain(theirs.keys()).copied().collect();
        let differ: Vec<Segment> =
            all.into_iter().filter(|key| ours.get(key) != theirs.get(key)).collect();
        assert_eq!(differ, otherwise, "{robot}: {ours:?}");
        let angle_rad = |of: &Anatomy, name: &str| of.n_pose_rad.get(name).copied().unwrap_or(0.0);
        let off = |name: &&str| (angle_rad(&guessed, name) - angle_rad(wrote, name)).abs() > 0.03;
        let names = shipped.file.joints.iter().map(|joint| joint.name.as_str());
        let elsewhere: Vec<&str> = names.filter(off).collect();
        assert_eq!(elsewhere, posed, "{robot}: {:?}", guessed.n_pose_rad);
    }
}

/// Robots whose makers call each joint by what it moves.
#[test]
fn of_public_models_the_anatomy_is_guessed_that_names_of_joints_tell() {
    let Some(robots) = captured::captured("robots") else { return };
    // Head, trunk; upper arm, forearm, thigh, shank and foot of the left side, then what differs in names of the right.
    let right_rad = (std::f64::consts::FRAC_PI_2 * 1e6).round() / 1e6;
    // How its arms hang: G1's forearms look ahead at zero, T1's arms to its sides.
    for (file, base, trunk, left, sides, hanging) in [
        (
            "unitree_g1/g1.xml",
            &[Segment::Pelvis][..],
            &[(Segment::Torso, "waist_pitch_joint")][..],
            [
                "left_shoulder_yaw_joint",
                "left_wrist_roll_joint",
                "left_hip_yaw_joint",
                "left_knee_joint",
                "left_ankle_roll_joint",
            ],
            ["left_", "right_"],
            &[("left_elbow_joint", right_rad), ("right_elbow_joint", right_rad)][..],
        ),
        (
            "booster_t1/t1.xml",
            &[Segment::Torso],
            &[(Segment::Head, "head_pitch"), (Segment::Pelvis, "waist")],
            [
                "left_elbow_pitch",
                "left_elbow_yaw",
                "left_hip_yaw",
                "left_knee_pitch",
                "left_ankle_roll",
            ],
            ["left_", "right_"],
            &[("left_shoulder_roll", -right_rad), ("right_shoulder_roll", right_rad)],
        ),
        (
            "hightorque_hi/hi_25dof.xml",
            &[Segment::Torso],
            // Nothing drives its head and its wrists.
            &[(Segment::Pelvis, "waist_joint")],
            [
                "l_upper_arm_joint",
                "l_elbow_joint",
                "l_thigh_joint",
                "l_calf_joint",
                "l_ankle_roll_joint",
            ],
            ["l_", "r_"],
            &[],
        ),
        // It has no arms, and its hips are far apart to the side.
        (
            "open_duck_mini_v2/open_duck_mini_v2_lite.xml",
            &[Segment::Pelvis, Segment::Torso],
            &[(Segment::Head, "head_roll")],
            ["", "", "left_hip_pitch", "left_knee", "left_ankle"],
            ["left_", "right_"],
            &[],
        ),
    ] {
        let path = robots.join(file);
        let text = std::fs::read_to_string(&path).expect("a model");
        let mut found = model::read(&text, &mut |_| Err("none".to_owned())).expect("a model");
        found.fill(false);
        let reduced = found.on_its_own().expect("joints");
        let guessed = found.anatomy(&reduced).unwrap_or_else(|reason| panic!("{file}: {reason}"));
        let mut named: BTreeMap<Segment, String> =
            trunk.iter().map(|(segment, joint)| (*segment, (*joint).to_owned())).collect();
        let right = left.map(|name| name.replacen(sides[0], sides[1], 1));
        let left = left.map(str::to_owned);
        for (segments, joints) in [(LEFT, left), (RIGHT, right)] {
            let there = segments.into_iter().zip(joints).filter(|(_, joint)| !joint.is_empty());
            named.extend(there);
        }
        assert_eq!((guessed.base.as_slice(), played(&guessed)), (base, named), "{file}");
        let angles_rad: Vec<(&str, f64)> = guessed
            .n_pose_rad
            .iter()
            .map(|(name, angle_rad)| (name.as_str(), *angle_rad))
            .collect();
        assert_eq!(angles_rad, hanging, "{file}");
    }
}

const LEFT: [Segment; 5] = [
    Segment::LeftUpperArm,
    Segment::LeftForearm,
    Segment::LeftThigh,
    Segment::LeftShank,
    Segment::LeftFoot,
];
const RIGHT: [Segment; 5] = [
    Segment::RightUpperArm,
    Segment::RightForearm,
    Segment::RightThigh,
    Segment::RightShank,
    Segment::RightFoot,
];

/// A limb of a made robot: where it begins, and the axes and places of its joints, each from the one before.
type Limb<'a> = ([f64; 3], &'a [(&'a str, [f64; 3])]);

const ACROSS: &str = "0 1 0";
const AHEAD: &str = "1 0 0";
const UP: &str = "0 0 1";
const LEG: &[(&str, [f64; 3])] = &[
    (AHEAD, [0.0; 3]),
    (ACROSS, [0.0; 3]),
    (ACROSS, [0.0, 0.0, -0.2]),
    (ACROSS, [0.0, 0.0, -0.2]),
];
const WITH_TOES: &[(&str, [f64; 3])] = &[
    (AHEAD, [0.0; 3]),
    (ACROSS, [0.0; 3]),
    (ACROSS, [0.0, 0.0, -0.2]),
    (ACROSS, [0.0, 0.0, -0.2]),
    (ACROSS, [0.06, 0.0, 0.0]),
];
const ARM: &[(&str, [f64; 3])] =
    &[(ACROSS, [0.0; 3]), (AHEAD, [0.0; 3]), (UP, [0.0, 0.0, -0.05]), (ACROSS, [0.0, 0.0, -0.1])];

/// A trunk with limbs: joints are called after limb and place, `limb0_1`. What hangs on each is a small box below it,
/// a little ahead.
fn made_of(limbs: &[Limb], is_held: bool) -> String {
    let link = |name: &str, mass_kg: f64| {
        let inertia = "ixx='1e-3' iyy='1e-3' izz='1e-3' ixy='0' ixz='0' iyz='0'";
        let weight = format!("<mass value='{mass_kg}'/><inertia {inertia}/>");
        let shape = "<geometry><box size='0.06 0.04 0.04'/></geometry>";
        let shape = format!("<collision><origin xyz='0.01 0 -0.02'/>{shape}</collision>");
        format!("<link name='{name}'><inertial>{weight}</inertial>{shape}</link>")
    };
    let mut text = format!("<robot name='made'>{}", link("trunk", 2.0));
    if is_held {
        text += "<link name='world'/><joint name='held' type='fixed'><parent link='world'/><child link='trunk'/></joint>";
    }
    for (limb, (at_m, joints)) in limbs.iter().enumerate() {
        let mut above = "trunk".to_owned();
        for (joint, (axis, from_m)) in joints.iter().enumerate() {
            let name = format!("limb{limb}_{joint}");
            let hangs = format!("<parent link='{above}'/><child link='{name}'/>");
            let [x, y, z] = [0, 1, 2].map(|i| from_m[i] + if joint == 0 { at_m[i] } else { 0.0 });
            let place = format!("<origin xyz='{x} {y} {z}'/><axis xyz='{axis}'/>");
            let limit = "<limit lower='-1.5' upper='1' effort='1' velocity='1'/>";
            text += &link(&name, 0.1);
            text += &format!("<joint name='{name}' type='revolute'>{hangs}{place}{limit}</joint>");
            above = name;
        }
    }
    text + "</robot>"
}

/// What is guessed of a model, and what its draft says.
fn made(urdf: &str) -> (Result<Anatomy, &'static str>, Option<Anatomy>) {
    let found = model::read(urdf, &mut |_| Err("none".to_owned())).expect("a model");
    let reduced = found.on_its_own().expect("joints");
    (found.anatomy(&reduced), drafted(&found, &reduced).anatomy)
}

#[test]
fn a_draft_says_what_is_guessed() {
    let (left, right) = ([0.0, 0.1, 0.0], [0.0, -0.1, 0.0]);
    let (guessed, written) = made(&made_of(&[(left, LEG), (right, LEG)], false));
    let (guessed, written) = (guessed.expect("legs"), written.expect("legs"));
    assert_eq!(played(&guessed), played(&written));
    assert_eq!((&guessed.base, guessed.n_pose_rad), (&written.base, written.n_pose_rad.clone()));
    assert_eq!(played(&written)[&Segment::RightShank], "limb1_2");
    assert_eq!(written.segments.len(), 6);
    // Toes are on a foot, and no arms.
    let shoulders = [[0.0, 0.15, 0.3], [0.0, -0.15, 0.3]];
    let whole = [(left, WITH_TOES), (right, WITH_TOES), (shoulders[0], ARM), (shoulders[1], ARM)];
    let guessed = played(&made(&made_of(&whole, false)).0.expect("a body"));
    for (segment, joint) in [
        (Segment::LeftShank, "limb0_2"),
        (Segment::LeftFoot, "limb0_3"),
        (Segment::LeftUpperArm, "limb2_2"),
        (Segment::RightForearm, "limb3_3"),
    ] {
        assert_eq!(guessed[&segment], joint);
    }
    // What is held by its base has arms, however long they are.
    let (guessed, _) = made(&made_of(&[(shoulders[0], ARM), (shoulders[1], ARM)], true));
    let guessed = played(&guessed.expect("arms"));
    assert_eq!(
        guessed.keys().copied().collect::<Vec<_>>(),
        [
            Segment::LeftUpperArm,
            Segment::LeftForearm,
            Segment::RightUpperArm,
            Segment::RightForearm
        ]
    );
}

#[test]
fn of_what_nobody_can_tell_nothing_is_guessed_and_why_is_said() {
    let dog = |heights_m: [f64; 4]| {
        let corners = [[0.2, 0.1], [0.2, -0.1], [-0.2, 0.1], [-0.2, -0.1]];
        let legs = corners.into_iter().zip(heights_m).map(|([x, y], z)| ([x, y, z], LEG));
        made_of(&legs.collect::<Vec<_>>(), false)
    };
    let legs = made_of(&[([0.0, 0.1, 0.0], LEG), ([0.0, -0.1, 0.0], LEG)], false);
    let back = legs.replace("xyz='0.01 0 -0.02'", "xyz='-0.02 0 -0.02'");
    let fingers: Vec<Limb> = [0.06, 0.03, -0.03, -0.06].map(|y| ([0.0, y, 0.0], ARM)).into();
    for (model, reason) in [
        (MADE_URDF.to_owned(), "no two arms"),
        // Front legs as low as hind legs, and a little higher.
        (dog([0.0; 4]), "more than one limb"),
        (dog([0.01, 0.01, 0.0, 0.0]), "no higher than its legs"),
        (back, "reach backwards"),
        (made_of(&fingers, true), "more than one limb"),
    ] {
        let (guessed, written) = made(&model);
        let told = guessed.expect_err("nothing");
        assert!(told.contains(reason) && written.is_none(), "{told}, not {reason}: {model}");
    }
}

#[test]
fn words_that_rust_writes_otherwise_are_words_in_toml() {
    let text =
        "<mujoco model='e\u{301}'><worldbody><body name='base'><freejoint/><geom size='0.1'/>
        <body name='arm'><joint name='j'/><geom size='0.1'/></body></body></worldbody></mujoco>";
    let found = model::read(text, &mut |_| Err("none".to_owned())).expect("a model");
    let reduced = found.on_its_own().expect("a joint");
    let words = Provenance {
        source: "here\u{200b} \"and\" \\ there".to_owned(),
        licence: "none\u{301}".to_owned(),
        shape_source: "\u{feff}here".to_owned(),
    };
    let (name, fastest_rad_s) = (Some("xm430-w350".to_owned()), Some(1.0));
    let servo = DraftServo { name, fastest_rad_s, baud_bps: 1_000_000 };
    let draft = found.draft_text(&reduced, &words, "drafted", &servo);
    let robot = gaitway_profiles::parse_robot("drafted.toml", &draft).expect("a robot");
    assert_eq!(robot.source, words.source);
    let body = robot.body.expect("a body");
    assert_eq!((body.licence, body.shape_source), (words.licence, words.shape_source));
    assert!(robot.description.starts_with("e\u{301}, "), "{}", robot.description);
}

#[test]
fn servos_that_pull_to_a_position_hold_joints_as_in_mujoco() {
    let Some(robots) = captured::captured("robots") else { return };
    let python = match python::python() {
        Ok(python) => python,
        Err(cause) => {
            aloud!("SKIPPED: nothing was compared: {cause}");
            return;
        }
    };
    for (file, count) in [
        ("robotis_op3/robotis_op3_lite.xml", 20),
        ("unitree_g1/unitree_g1_lite.xml", 29),
        ("booster_t1/booster_t1_lite.xml", 23),
        ("open_duck_mini_v2/open_duck_mini_v2_lite.xml", 14),
        // Its actuators are motors.
        ("hightorque_hi/hightorque_hi_lite.xml", 0),
    ] {
        let path = robots.join(file);
        let found = read(&path);
        let run = Command::new(&python.program).args(["-c", SERVOS]).arg(&path).output().unwrap();
        assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
        let theirs: Value = serde_json::from_slice(&run.stdout).expect("JSON");
        let mut compared = 0;
        for joint in &found.joints {
            let Some(ours) = joint.holds else { continue };
            let ours = [
                ours.stiffness_nm_rad,
                ours.damping_nm_s_rad,
                ours.armature_kg_m2,
                ours.friction_nm,
                ours.torque_nm,
            ];
            for (ours, theirs) in ours.iter().zip(theirs[&joint.name].as_array().expect("five")) {
                let theirs = theirs.as_f64().expect("a number");
                assert!(
                    (ours - theirs).abs() < 1e-6 * theirs.abs().max(1.0),
                    "{file} {}: {ours} {theirs}",
                    joint.name
                );
            }
            compared += 1;
        }
        assert_eq!(compared, count, "{file}");
    }
}

/// Of a whole model with damping as a part of the critical one, and gears, which none of the above has.
#[test]
fn damping_as_a_part_of_the_critical_one_is_that_of_what_a_joint_carries() {
    let model = |actuator: &str| {
        format!(
            r#"<mujoco><compiler angle="radian"/><default><joint armature="0.02" damping="0.1" frictionloss="0.3"/>
            <position kp="30" forcerange="-4 4"/></default><worldbody><body name="base"><freejoint/><geom size="0.1"/>
            <body name="arm"><joint name="j" axis="0 1 0" pos="0.1 0 0"/><geom type="box" size="0.1 0.05 0.2" pos="0 0 0.3"/>
            <body name="hand" pos="0 0 0.5"><joint name="k" axis="1 0 0"/><geom size="0.05"/></body></body></body></worldbody>
            <actuator>{actuator}</actuator></mujoco>"#
        )
    };
    let read = |actuator: &str| {
        let text = model(actuator);
        let found = model::read(&text, &mut |_| Err("none".to_owned())).expect("a model");
        found.joint("j").expect("j").holds
    };
    let plain = read(r#"<position joint="j" kv="2"/>"#).expect("a servo");
    assert_eq!((plain.stiffness_nm_rad, plain.damping_nm_s_rad, plain.torque_nm), (30.0, 2.1, 4.0));
    let geared = read(r#"<position joint="j" gear="3" kv="2"/>"#).expect("a servo");
    assert_eq!((geared.stiffness_nm_rad, geared.torque_nm), (270.0, 12.0));
    for none in [
        r#"<motor joint="j"/>"#,
        r#"<position joint="j" forcelimited="false"/>"#,
        r#"<position joint="j"/><motor joint="j"/>"#,
        r#"<position joint="j" kp="-3"/>"#,
        r#"<position joint="j" kp="nan"/>"#,
        r#"<general joint="j" gainprm="30" biastype="affine" biasprm="0 -20 -1" forcerange="-4 4"/>"#,
        // MuJoCo's default of a position servo is one of all actuators.
        r#"<general joint="j" gainprm="30" biastype="affine" biasprm="0 -30 -1" forcerange="-4 4"/>"#,
        r#"<position joint="j" kv="2" dampratio="1"/>"#,
        r#"<position joint="j" forcerange="2 8"/>"#,
        r#"<position joint="j" timeconst="0.5"/>"#,
        r#"<position joint="j" class="none"/>"#,
        r#"<position joint="j"/><motor jointinparent="k"/>"#,
    ] {
        assert_eq!(read(none), None, "{none}");
    }
    let turned = read(r#"<position joint="j" gear="2" armature="0.5"/>"#).expect("a servo");
    assert_eq!(turned.armature_kg_m2, 2.02);
    let Ok(python) = python::python() else {
        aloud!("SKIPPED: damping as a part of the critical one was not held against MuJoCo's");
        return;
    };
    let critical = r#"<position joint="j" dampratio="0.7"/>"#;
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join("damped.xml");
    std::fs::write(&path, model(critical)).unwrap();
    let run = Command::new(&python.program).args(["-c", SERVOS]).arg(&path).output().unwrap();
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    let theirs: Value = serde_json::from_slice(&run.stdout).expect("JSON");
    let (ours, theirs) = (read(critical).expect("a servo"), theirs["j"][1].as_f64().unwrap());
    assert!((ours.damping_nm_s_rad - theirs).abs() < 1e-6 * theirs, "{ours:?} {theirs}");
    assert!(theirs > 1.0);
}

#[test]
fn models_made_here_move_as_in_mujoco() {
    for (name, text) in [("made.xml", MADE_MJCF), ("made.urdf", MADE_URDF)] {
        let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
        std::fs::write(&path, text).unwrap();
        match held_to(&path) {
            Ok(found) => assert_eq!(found.tree.couplings().len(), 1, "{name}"),
            Err(cause) => aloud!("SKIPPED: {name} was not compared: {cause}"),
        }
    }
}

/// A shipped robot, and the public model its body is from.
const SHIPPED: &[(&str, &str)] = &[
    ("op3", "robotis_op3/robotis_op3_lite.xml"),
    ("poppy-humanoid", "poppy_humanoid/poppy_humanoid_nomesh.urdf"),
    ("open-duck-mini-v2", "open_duck_mini_v2/open_duck_mini_v2_lite.xml"),
    ("toddlerbot", "toddlerbot/toddlerbot_lite.xml"),
    ("berkeley-humanoid-lite", "berkeley_humanoid_lite/berkeley_humanoid_lite_nomesh.urdf"),
];

/// Joints of a model that are not at zero where the robot's are, degrees: Poppy's model spreads its arms.
const ZEROS: &[(&str, &str, f64)] = &[
    ("poppy-humanoid", "l_shoulder_y", 90.0),
    ("poppy-humanoid", "l_shoulder_x", 90.0),
    ("poppy-humanoid", "r_shoulder_y", -90.0),
    ("poppy-humanoid", "r_shoulder_x", 90.0),
];

/// Numbers in robot files are rounded, and axes in them slid along themselves: m, N m.
const ROUNDED: f64 = 1e-4;

#[test]
fn shipped_bodies_weigh_and_move_as_their_public_models() {
    let Some(folder) = captured::captured("robots") else { return };
    let mut random = ChaCha8Rng::seed_from_u64(41);
    for (name, file) in SHIPPED {
        let model = read(&folder.join(file));
        let robot = gaitway_profiles::robot(name).expect("a shipped robot");
        let body = RobotBody::of(&robot).expect("a body").expect("it has one");
        let zero: Vec<(String, f64)> = ZEROS
            .iter()
            .filter(|(of, ..)| of == name)
            .map(|(_, joint, degrees)| ((*joint).to_owned(), degrees.to_radians()))
            .collect();
        let zeros = model.posture(&zero).expect("joints of the model");
        let reduced = model.onto(&robot, &zeros).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert!((body.tree.mass_kg() - model.tree.mass_kg()).abs() < 1e-5, "{name}");
        let base = Placement { at_m: DVec3::ZERO, turn: reduced.turn };
        let at_zero = model.tree.place(base, &zeros);
        let (mut centre, mut torque) = (0.0_f64, 0.0_f64);
        for _ in 0..20 {
            let (mut ours, mut theirs) = (Vec::new(), zeros.clone());
            let mut signs = Vec::new();
            for own in &reduced.joints {
                let angle: f64 = random.random_range(-1.0..1.0);
                let link = &model.tree.links()[own.link];
                let sign = (at_zero[own.link].turn * link.axis).dot(own.axis).signum();
                theirs[model.tree.coordinate(own.link).expect("it moves")] += sign * angle;
                ours.push(angle);
                signs.push(sign);
            }
            let here = TreeMotion::at_rest(Placement::IDENTITY, body.angles(&ours));
            let there = TreeMotion::at_rest(base, theirs);
            let of = |tree: &gaitway::rigid::Tree, motion: &TreeMotion| {
                tree.centre_of_mass_m(&tree.place(motion.base, &motion.angles))
            };
            centre = centre.max(of(&body.tree, &here).distance(of(&model.tree, &there)));
            let down = DVec3::new(0.0, 0.0, -9.81);
            let (a, b) = (
                body.tree.inverse_dynamics(&here, down),
                model.tree.inverse_dynamics(&there, down),
            );
            for (at, own) in reduced.joints.iter().enumerate() {
                let other = b.joints[model.tree.coordinate(own.link).expect("it moves")];
                torque = torque.max((a.joints[at] - signs[at] * other).abs());
            }
        }
        aloud!("{name}: {:.3} kg, apart by {centre:.1e} m, {torque:.1e} N m", body.tree.mass_kg());
        assert!(centre < ROUNDED && torque < 2e-3, "{name}: {centre} m, {torque} N m");
    }
}

#[test]
fn every_shipped_humanoid_with_a_public_model_has_a_body_of_known_licence() {
    for (name, _) in SHIPPED {
        let robot = gaitway_profiles::robot(name).expect("a shipped robot");
        let body = robot.body.as_ref().expect("a body");
        assert!(!body.licence.starts_with("unconfirmed") && body.source.len() > 20, "{name}");
        let found = RobotBody::of(&robot).expect("sound").expect("a body");
        assert!(found.soles.len() == 2, "{name} stands on {} soles", found.soles.len());
        let joints = found.tree.links().iter().filter(|link| link.parent.is_some()).count();
        assert_eq!(joints, robot.joints.len() + body.coupled.len(), "{name}");
    }
}

fn refusal(text: &str) -> String {
    let read = model::read(text, &mut |_| Err("no meshes".to_owned()));
    read.err().unwrap_or_else(|| panic!("taken: {}", &text[..text.len().min(300)])).to_string()
}

#[test]
fn what_no_robot_can_be_is_refused_in_words() {
    let link = |inside: &str| format!("<robot name=\"r\"><link name=\"a\">{inside}</link></robot>");
    let inertia = |mass: &str, ixx: &str| {
        link(&format!(
            "<inertial><mass value=\"{mass}\"/><inertia ixx=\"{ixx}\" iyy=\"1\" izz=\"1\"/></inertial>"
        ))
    };
    let body = |inside: &str| {
        format!("<mujoco><worldbody><body name=\"a\">{inside}</body></worldbody></mujoco>")
    };
    let joint = |from: &str, to: &str| {
        format!(
            "<joint name=\"{from}{to}\" type=\"fixed\"><parent link=\"{from}\"/><child link=\"{to}\"/></joint>"
        )
    };
    let links = "<link name=\"a\"/><link name=\"b\"/><link name=\"c\"/>";
    let robot = |joints: &[String]| format!("<robot name=\"r\">{links}{}</robot>", joints.concat());
    for (text, word) in [
        (String::new(), "whole XML"),
        ("<robot><link name=\"a\">".to_owned(), "whole XML"),
        ("<html/>".to_owned(), "no model of a robot"),
        ("<!DOCTYPE x [<!ENTITY a \"b\">]><robot/>".to_owned(), "whole XML"),
        ("<robot/>".to_owned(), "hangs on nothing"),
        (inertia("-1", "1"), "cannot be a mass"),
        (inertia("nan", "1"), "cannot be used"),
        (inertia("1", "-1"), "negative moment"),
        (inertia("0", "1"), "without mass"),
        (robot(&[joint("a", "b"), joint("b", "c"), joint("c", "a")]), "hangs on nothing"),
        (robot(&[joint("a", "b"), joint("c", "b")]), "hangs on two joints"),
        (robot(&[joint("b", "c"), joint("c", "b")]), "in a circle"),
        (robot(&[joint("a", "b"), joint("a", "x")]), "not there"),
        ("<mujoco/>".to_owned(), "no body"),
        (body("<include file=\"/etc/passwd\"/>"), "not unfolded"),
        (body("<joint type=\"ball\"/>"), "hinge or slide"),
        (body("<joint axis=\"0 0 0\"/>"), "a direction"),
        (body("<joint ref=\"1\"/>"), "draws it"),
        (body("<geom size=\"inf\"/>"), "cannot be used"),
        (body("<inertial mass=\"1\" pos=\"0 0 0\" diaginertia=\"1 1 -1\"/>"), "negative moment"),
        (body("<inertial mass=\"1e400\" pos=\"0 0 0\"/>"), "cannot be used"),
        (body(&"<joint/>".repeat(100)), "this many joints"),
        (format!("<robot>{}</robot>", "<a>".repeat(100_000)), "too deep"),
        (format!("<mujoco>{}</mujoco>", "<a/>".repeat(1_000_000)), "too large"),
        (format!("<robot>{}</robot>", "<link name=\"a\"/>".repeat(1_000_000)), "too large"),
        (format!("<robot>{}</robot>", "<link/>".repeat(2000)), "this many links"),
    ] {
        let said = refusal(&text);
        assert!(said.contains(word), "{word:?} is not in {said:?}");
    }
}

/// Any beginning of a model, and any byte of it changed, is read or refused, nothing else.
#[test]
fn broken_models_are_read_or_refused() {
    for text in [MADE_MJCF, MADE_URDF] {
        let mut refused = 0;
        // Every seventh: 7 shares no factor with lengths of words and lines.
        let places = (0..text.len()).step_by(7).filter(|at| text.is_char_boundary(*at));
        let places: Vec<usize> = places.collect();
        for &at in &places {
            let read = |text: &str| model::read(text, &mut |_| Err(String::new())).is_err();
            refused += usize::from(read(&text[..at]));
            for other in ["", "0", "-", "\"", "<", "nan"] {
                read(&format!("{}{other}{}", &text[..at], &text[at + 1..]));
            }
        }
        assert!(refused * 10 > places.len() * 9, "{refused} beginnings refused");
    }
}

#[test]
fn limits_that_an_exporter_makes_up_are_not_taken_over() {
    let model = |limit: &str| {
        let text = format!(
            "<robot name=\"r\"><link name=\"a\"/><link name=\"b\"/>\
             <joint name=\"j\" type=\"revolute\"><parent link=\"a\"/><child link=\"b\"/>{limit}</joint></robot>"
        );
        let found = model::read(&text, &mut |_| Err(String::new())).expect("a model");
        found.joints[0].range
    };
    assert_eq!(model("<limit lower=\"-1\" upper=\"2\"/>"), Some((-1.0, 2.0)));
    for placeholder in [
        "",
        "<limit lower=\"0\" upper=\"0\"/>",
        "<limit lower=\"-3.14\" upper=\"3.14\"/>",
        "<limit lower=\"-3.14159265\" upper=\"3.14159265\"/>",
        "<limit effort=\"1\"/>",
        "<limit lower=\"2\" upper=\"-1\"/>",
    ] {
        assert_eq!(model(placeholder), None, "{placeholder}");
    }
}

#[test]
fn a_mesh_gets_the_capsule_or_box_that_holds_all_its_corners() {
    let round = |at: usize| {
        let (y, x) = (at as f64 * 0.4).sin_cos();
        format!("v {} {} {}\n", 0.01 * x, 0.01 * y, if at.is_multiple_of(2) { -0.1 } else { 0.1 })
    };
    let rod: String = (0..32).map(round).collect();
    let plank = "v 0 0 -0.1\nv 0.01 0 0.1\nv 0 0.01 0.1\nv -0.01 0 0\n".to_owned();
    for (text, is_round) in [(rod, true), (plank, false)] {
        let volume = volume_of(&text);
        assert_eq!(matches!(volume, Volume::Capsule(_)), is_round, "{volume:?}");
        for corner in Surface::read(text.as_bytes()).expect("an OBJ mesh").points_m {
            let point = corner * 2.0;
            let ball = Volume::Capsule(Capsule { from_m: point, to_m: point, radius_m: 0.0 });
            assert!(volume.distance_m(&ball) < 1e-9, "{point} is outside");
        }
    }
    for broken in [&b"solid"[..], b"", &[0; 84], &[255; 200], b"v 1 2\nv nan 0 0"] {
        assert_eq!(Surface::read(broken), None, "{broken:?}");
    }
}

/// What stands for a mesh, twice as large, in a model.
fn volume_of(text: &str) -> Volume {
    let urdf = "<robot name=\"r\"><link name=\"a\"><collision><geometry>\
                <mesh filename=\"m.obj\" scale=\"2 2 2\"/></geometry></collision></link></robot>";
    let found = model::read(urdf, &mut |name| {
        assert_eq!(name, "m.obj");
        Ok(text.as_bytes().to_vec())
    });
    let found = found.expect("a model");
    let [volume] = found.volumes[0].as_slice() else { panic!("one volume") };
    *volume
}

/// Public models without their meshes: OP3, Open Duck Mini v2, ToddlerBot, Berkeley Humanoid Lite,
/// Unitree G1, Booster T1, HighTorque Hi as MJCF; Poppy, NAO, Berkeley, ToddlerBot, G1, Hi as URDF.
#[test]
fn public_models_move_as_in_mujoco() {
    let Some(folder) = captured::captured("robots") else {
        return;
    };
    let mut models: Vec<PathBuf> = Vec::new();
    for robot in std::fs::read_dir(folder).expect("a folder") {
        let robot = robot.expect("an entry").path();
        if robot.is_dir() {
            let files = std::fs::read_dir(robot).expect("a folder");
            models.extend(files.map(|file| file.expect("an entry").path()));
        }
    }
    models.retain(|path| {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let without = name.ends_with("_lite.xml") || name.ends_with("_nomesh.urdf");
        without && !std::fs::read_to_string(path).is_ok_and(|text| text.contains("file=\""))
    });
    models.sort();
    assert!(models.len() >= 10, "{models:?}");
    for path in &models {
        if let Err(cause) = held_to(path) {
            aloud!("SKIPPED: {} was not compared: {cause}", path.display());
        }
    }
}

#[test]
fn a_shipped_robot_that_is_written_as_urdf_is_the_same_robot_to_mujoco_and_when_it_is_read_again() {
    if let Err(cause) = python::python() {
        aloud!("SKIPPED: no MuJoCo, no written model was read by it: {cause}");
        return;
    }
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let mut random = ChaCha8Rng::seed_from_u64(18);
    let names = SHIPPED.iter().map(|(name, _)| *name);
    for name in names {
        let file = gaitway_profiles::robot(name).expect("a shipped robot");
        let robot = gaitway::robot::Robot::new(file).expect("a robot");
        let body = RobotBody::of(&robot.file).expect("sound").expect("a body");
        let limits: Vec<_> = robot.joints.iter().map(|joint| joint.limits).collect();
        let path = folder.join(format!("{name}.urdf"));
        std::fs::write(&path, urdf(name, &body, &limits)).expect("a file");
        // MuJoCo and our reader agree about what was written ...
        let again = held_to(&path).expect("MuJoCo");
        // ... and what was read is what was meant: masses, places, ranges.
        assert!((again.tree.mass_kg() - body.tree.mass_kg()).abs() < 1e-9, "{name}");
        let own = robot.joints.len();
        for _ in 0..10 {
            let angles: Vec<f64> = (0..own).map(|_| random.random_range(-1.0..1.0)).collect();
            let here = body.tree.place(Placement::IDENTITY, &body.angles(&angles));
            let mut theirs = vec![0.0; again.tree.moving()];
            for (link, tree) in body.tree.links().iter().enumerate().skip(1) {
                let turned = body.angles(&angles)[body.tree.coordinate(link).expect("it moves")];
                let other = again.tree.link(&tree.name).expect("the same link");
                theirs[again.tree.coordinate(other).expect("it moves")] = turned;
            }
            let there = again.tree.place(Placement::IDENTITY, &theirs);
            for (link, placed) in body.tree.links().iter().zip(&here) {
                let other = again.tree.link(&link.name).expect("the same link");
                assert!(placed.at_m.distance(there[other].at_m) < 1e-9, "{name}: {}", link.name);
            }
        }
        for joint in &robot.joints {
            let found = again.joints.iter().find(|found| found.name == joint.name);
            let range = found.expect("the joint").range;
            // Limits of half a turn are placeholders to the reader.
            let (lower_rad, upper_rad) = (joint.limits.lower_rad(), joint.limits.upper_rad());
            let meant = range.unwrap_or((lower_rad, upper_rad));
            let apart = (meant.0 - lower_rad).abs() + (meant.1 - upper_rad).abs();
            assert!(apart < 1e-12, "{name}: {}", joint.name);
        }
    }
}
