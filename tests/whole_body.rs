//! Whether a robot that is said to stay on its feet does, and one that is said to fall falls, judged by MuJoCo's model of it on
//! servos that give way, as they are and otherwise. `GAITWAY_LONG=1` takes all captures and actions, and prints shares.

mod aloud;
mod captured;
#[path = "whole_body/floor.rs"]
mod floor;
mod program;
mod python;
#[path = "whole_body/tempo.rs"]
mod tempo;

use aloud::aloud;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::process::Command;

/// What is tried: its name, N m/rad (none: as in the model), friction, times the mass, s of delay, a seed.
type Condition = (&'static str, Option<f64>, f64, f64, f64, Option<u64>);

const AS_IT_IS: Condition = ("as it is", None, 1.0, 1.0, 0.0, None);
const SOFT: Condition = ("15 N m/rad", Some(15.0), 1.0, 1.0, 0.0, None);
const HEAVY: Condition = ("mass x 1.2", None, 1.0, 1.2, 0.0, None);
const ALL: [Condition; 12] = [
    AS_IT_IS,
    SOFT,
    ("60 N m/rad", Some(60.0), 1.0, 1.0, 0.0, None),
    ("friction 0.5", None, 0.5, 1.0, 0.0, None),
    ("mass x 0.8", None, 1.0, 0.8, 0.0, None),
    HEAVY,
    ("20 ms late", None, 1.0, 1.0, 0.02, None),
    ("pushed, 0", None, 1.0, 1.0, 0.0, Some(0)),
    ("pushed, 1", None, 1.0, 1.0, 0.0, Some(1)),
    ("pushed, 2", None, 1.0, 1.0, 0.0, Some(2)),
    ("pushed, 3", None, 1.0, 1.0, 0.0, Some(3)),
    ("pushed, 4", None, 1.0, 1.0, 0.0, Some(4)),
];

fn folder() -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("whole-body");
    std::fs::create_dir_all(&folder).expect("a temporary folder");
    folder
}

/// The table of a motion on OP3, and what is said of it; nothing if it is refused.
fn retargeted(motion: &str, name: &str) -> Option<(PathBuf, Value)> {
    retargeted_on("op3", motion, name, &[])
}

/// The same of one that may fall rather than wait for its feet.
fn as_it_falls(motion: &str, name: &str) -> Option<(PathBuf, Value)> {
    retargeted_on("op3", motion, name, &["--allow-fall"])
}

fn retargeted_on(robot: &str, motion: &str, name: &str, more: &[&str]) -> Option<(PathBuf, Value)> {
    let table = folder().join(format!("{name}.csv"));
    let mut command = program::gaitway();
    command.args(["retarget", motion, "--robot", robot, "--rate", "100", "--json", "--force"]);
    let output = command.args(more).arg("-o").arg(&table).output().expect("the command");
    let report = output.status.success();
    report.then(|| (table, serde_json::from_slice(&output.stdout).expect("JSON")))
}

/// When each falls under each condition on OP3, s, by motion; nothing if there is no MuJoCo.
fn judged(tables: &[PathBuf], conditions: &[Condition]) -> Option<Vec<Vec<Option<f64>>>> {
    let model = captured::captured("robots")?.join("robotis_op3/robotis_op3_lite.xml");
    judged_on(&model, tables, conditions)
}

/// The same on a model, or a robot's file with its servos.
fn judged_on(
    model: &Path,
    tables: &[PathBuf],
    conditions: &[Condition],
) -> Option<Vec<Vec<Option<f64>>>> {
    let python = match python::python() {
        Ok(python) => python,
        Err(cause) => {
            aloud!("SKIPPED: nothing was judged: {cause}");
            return None;
        }
    };
    let run = |table: &PathBuf, of: &Condition| json!([table, of.1, of.2, of.3, of.4, of.5]);
    let runs: Vec<Value> =
        tables.iter().flat_map(|table| conditions.iter().map(move |of| run(table, of))).collect();
    let feet = ["l_ank_roll_link", "r_ank_roll_link"];
    // Tests run beside one another.
    let order = tables.first()?.with_extension("order.json");
    let words = json!({"model": model, "feet": feet, "runs": runs}).to_string();
    std::fs::write(&order, words).expect("written");
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/whole_body/judge.py");
    let run = Command::new(&python.program).arg(script).arg(&order).output().expect("Python");
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    let fell: Vec<Option<f64>> = serde_json::from_slice(&run.stdout).expect("JSON");
    Some(fell.chunks(conditions.len()).map(<[_]>::to_vec).collect())
}

#[test]
fn what_is_said_to_stay_stays_with_soft_servos_and_a_heavy_body_too() {
    let (mut tables, mut names) = (Vec::new(), Vec::new());
    for motion in ["walk", "squat"] {
        let (table, report) = retargeted(motion, motion).expect("a table");
        let metrics = &report["metrics"];
        assert_eq!(metrics["predicted_fall_s"], Value::Null, "{motion}");
        assert_eq!(metrics["soft_fall_s"], Value::Null, "{motion}");
        tables.push(table);
        names.push(motion);
    }
    let Some(all) = judged(&tables, &[AS_IT_IS, SOFT, HEAVY]) else { return };
    for (name, fell) in names.iter().zip(&all) {
        assert_eq!(*fell, [None; 3], "{name}");
    }
}

#[test]
fn what_is_said_to_fall_with_soft_servos_alone_falls_with_them_alone() {
    let (table, report) = as_it_falls("throw-l", "throw-l").expect("a table");
    assert_eq!(report["metrics"]["predicted_fall_s"], Value::Null);
    assert!(report["metrics"]["soft_fall_s"].is_number(), "{}", report["metrics"]);
    let Some(all) = judged(&[table], &[AS_IT_IS, SOFT]) else { return };
    assert!(all[0][0].is_none() && all[0][1].is_some(), "{all:?}");
}

#[test]
fn what_is_said_to_fall_falls() {
    let (table, report) = as_it_falls("jump", "jump").expect("a table");
    assert!(report["metrics"]["predicted_fall_s"].is_number(), "{}", report["metrics"]);
    let Some(all) = judged(&[table], &[AS_IT_IS]) else { return };
    assert!(all[0][0].is_some(), "{all:?}");
}

/// Both feet keep down in the one, and in the other they are lifted one by one.
#[test]
fn what_would_fall_stays_up_if_its_person_waits_for_the_robots_feet() {
    let Some(captures) = captured::captured("mocap/bvh") else { return };
    let dance = captured::bvh_files(&captures)
        .into_iter()
        .find(|path| path.ends_with("jesse_dance.bvh"))
        .expect("a dance");
    let dance = dance.to_str().expect("a path");
    let (mut tables, mut falling) = (Vec::new(), Vec::new());
    for (at, (motion, said)) in
        [("jump", "both feet stay"), ("knee-kick-r", "feet lifted: 1"), (dance, "both feet stay")]
            .into_iter()
            .enumerate()
    {
        let (table, report) = retargeted(motion, &format!("waits-{at}")).expect("a table");
        let metrics = &report["metrics"];
        assert_eq!(metrics["predicted_fall_s"], Value::Null, "{motion}");
        assert_eq!(metrics["soft_fall_s"], Value::Null, "{motion}");
        let notes = report["notes"].to_string();
        assert!(notes.contains(said), "{motion}: {notes}");
        tables.push(table);
        falling.push(as_it_falls(motion, &format!("falls-{at}")).expect("a table").0);
    }
    let Some(all) = judged(&tables, &[AS_IT_IS, SOFT, HEAVY]) else { return };
    assert_eq!(all, [[None; 3]; 3]);
    let fell = judged(&falling, &[AS_IT_IS]).expect("judged before");
    assert!(fell.iter().all(|fell| fell[0].is_some()), "{fell:?}");
}

fn robot_file(robot: &str) -> PathBuf {
    let robots = Path::new(env!("CARGO_MANIFEST_DIR")).join("firmware-profiles/robots");
    robots.join(format!("{robot}.toml"))
}

/// What is said of falls is held against MuJoCo's own model of the robot's file, with its servos.
fn falls_as_is_said(robot: &str, motions: &[(&str, bool)]) {
    let (mut tables, mut said) = (Vec::new(), Vec::new());
    for (motion, falls) in motions {
        let (table, report) =
            retargeted_on(robot, motion, &format!("{robot}-{motion}"), &["--allow-fall"])
                .expect("a table");
        let fall = report["metrics"]["predicted_fall_s"].is_number();
        assert_eq!(fall, *falls, "{robot} {motion}: {}", report["metrics"]);
        tables.push(table);
        said.push(fall);
    }
    let Some(all) = judged_on(&robot_file(robot), &tables, &[AS_IT_IS]) else { return };
    let fell: Vec<bool> = all.iter().map(|fell| fell[0].is_some()).collect();
    assert_eq!(fell, said, "{robot}: {motions:?} {all:?}");
}

#[test]
fn a_toddlerbot_falls_and_stays_as_its_servos_let_it_each_by_its_own() {
    falls_as_is_said("toddlerbot", &[("bow", false), ("wave-r", false), ("hop-l", true)]);
}

#[test]
fn an_open_duck_stays() {
    falls_as_is_said("open-duck-mini-v2", &[("squat", false)]);
}

#[test]
fn a_robot_whose_servos_do_not_hold_it_up_is_said_not_to_stand_and_what_would_help() {
    falls_as_is_said("berkeley-humanoid-lite", &[("wave-r", true)]);
    let robot = "berkeley-humanoid-lite";
    let (_, report) = retargeted_on(robot, "bow", "too-soft", &[]).expect("a table");
    // MuJoCo has it after 0.9 s.
    for key in ["still_fall_s", "predicted_fall_s"] {
        let fall_s = report["metrics"][key].as_f64().expect("a number");
        assert!((0.5..1.5).contains(&fall_s), "{key} {fall_s}");
    }
    let notes = report["notes"].to_string();
    assert!(notes.contains("does not stand on its own feet"), "{notes}");
    let (_, hung) = retargeted_on(robot, "bow", "hung", &["--hang"]).expect("a table");
    assert_eq!(hung["metrics"]["still_fall_s"], Value::Null);
    assert!(!hung["notes"].to_string().contains("its own feet"), "{}", hung["notes"]);
}

/// Its base lies on the floor, between the feet: what falls is its weight.
#[test]
fn the_same_robot_with_stiff_servos_stays() {
    let text = std::fs::read_to_string(robot_file("berkeley-humanoid-lite")).expect("a file");
    let stiff = text
        .replace("stiffness_nm_rad = 20.0", "stiffness_nm_rad = 3000.0")
        .replace("damping_nm_s_rad = 2.0", "damping_nm_s_rad = 60.0")
        .replace("torque_nm = 6.0", "torque_nm = 2000.0");
    let file = folder().join("stiff.toml");
    std::fs::write(&file, stiff.replace("name = \"berkeley-humanoid-lite\"", "name = \"stiff\""))
        .expect("written");
    let robot = file.to_str().expect("a path");
    let (table, report) = retargeted_on(robot, "wave-r", "stiff", &[]).expect("a table");
    assert_eq!(report["metrics"]["predicted_fall_s"], Value::Null, "{}", report["metrics"]);
    let Some(all) = judged_on(&file, &[table], &[AS_IT_IS]) else { return };
    assert_eq!(all, [[None]]);
}

#[test]
fn a_robot_that_would_fall_on_its_way_to_the_first_pose_takes_longer_for_it() {
    let Some(captures) = captured::captured("mocap/bvh") else { return };
    let wave = captured::bvh_files(&captures)
        .into_iter()
        .find(|path| path.ends_with("left_hand_wave.bvh"))
        .expect("a wave");
    let wave = wave.to_str().expect("a path");
    let (table, report) = retargeted_on("toddlerbot", wave, "calmer", &[]).expect("a table");
    assert_eq!(report["metrics"]["predicted_fall_s"], Value::Null);
    let approach_s = report["approach_s"].as_f64().expect("a number");
    let (_, hung) = retargeted_on("toddlerbot", wave, "usual", &["--hang"]).expect("a table");
    let usual_s = hung["approach_s"].as_f64().expect("a number");
    assert!(approach_s > 1.5 * usual_s, "{approach_s} {usual_s}");
    let Some(all) = judged_on(&robot_file("toddlerbot"), &[table], &[AS_IT_IS]) else { return };
    assert_eq!(all, [[None]]);
}

#[test]
fn an_action_in_which_a_robot_would_be_in_itself_is_moved_and_no_other() {
    for (robot, motion, more, is_moved) in [
        ("toddlerbot", "wave-r", &[][..], true),
        ("toddlerbot", "wave-r", &["--hang"], true),
        ("op3", "bow", &["--hang"], false),
        ("op3", "box-r", &[], true),
    ] {
        let name = format!("apart-{robot}-{motion}-{}", more.len());
        let (_, report) = retargeted_on(robot, motion, &name, more).expect("a table");
        let metrics = &report["metrics"];
        assert_eq!(metrics["self_collision_share"], 0.0, "{robot} {motion}");
        let notes = report["notes"].to_string();
        assert_eq!(notes.contains("moved so that"), is_moved, "{robot} {motion}: {notes}");
    }
}

/// Falls of a virtual robot with weight, whose own servos move it, beside those of MuJoCo's, on another's servos.
#[test]
fn a_virtual_robot_with_weight_falls_and_stays_as_in_mujoco() {
    let is_long = std::env::var_os("GAITWAY_LONG").is_some();
    let all = gaitway::action::vocabulary::names();
    let motions: Vec<&str> =
        if is_long { all.collect() } else { vec!["walk", "bow", "kick-r", "jump"] };
    let (mut tables, mut fell) = (Vec::new(), Vec::new());
    for motion in motions {
        let Some((table, _)) = as_it_falls(motion, &format!("weight-{motion}")) else { continue };
        let played = program::gaitway()
            .args(["play", motion, "--robot", "op3", "--bus", "sim", "--json"])
            .args(["--physics", "--allow-fall"])
            .output()
            .expect("the command");
        let report: Value = serde_json::from_slice(&played.stdout).expect("JSON");
        fell.push((motion, report["fell_at_s"].is_number()));
        tables.push(table);
    }
    let Some(judged) = judged(&tables, &[AS_IT_IS]) else { return };
    let mut otherwise = Vec::new();
    for ((motion, fell), judged) in fell.iter().zip(&judged) {
        if *fell != judged[0].is_some() {
            otherwise.push(format!("{motion}: fell {fell}, in MuJoCo {:?}", judged[0]));
        }
    }
    aloud!(
        "{} of {} as in MuJoCo; {}",
        fell.len() - otherwise.len(),
        fell.len(),
        otherwise.join(", ")
    );
    assert!(otherwise.len() <= fell.len() / 10, "{}", otherwise.join(", "));
}

#[test]
fn of_all_captures_falls_and_stays_are_predicted() {
    if std::env::var_os("GAITWAY_LONG").is_none() {
        aloud!("SKIPPED: set GAITWAY_LONG to judge all captures and actions, for half an hour");
        return;
    }
    let Some(captures) = captured::captured("mocap/bvh") else { return };
    let files = captured::bvh_files(&captures).into_iter();
    let captures = files.map(|path| path.to_str().expect("a path").to_owned());
    let actions = gaitway::action::vocabulary::names().map(str::to_owned);
    let (mut tables, mut said) = (Vec::new(), Vec::new());
    for (at, motion) in captures.chain(actions).enumerate() {
        let Some((table, report)) = retargeted(&motion, &at.to_string()) else { continue };
        tables.push(table);
        let metrics = &report["metrics"];
        said.push(["predicted_fall_s", "soft_fall_s"].map(|key| metrics[key].is_number()));
    }
    let Some(all) = judged(&tables, &ALL) else { return };
    let shares = |at: usize, by: usize| {
        let pairs = || all.iter().zip(&said).map(|(fell, said)| (fell[at].is_some(), said[by]));
        let of = |fell: bool| pairs().filter(|pair| pair.0 == fell).count();
        let right = |fell: bool| pairs().filter(|pair| *pair == (fell, fell)).count();
        let robust = pairs().filter(|pair| !pair.1).count();
        let stands = pairs().filter(|pair| *pair == (false, false)).count();
        ([right(true), of(true)], [right(false), of(false)], [stands, robust])
    };
    for (at, condition) in ALL.iter().enumerate() {
        let (falls, stays, held) = shares(at, 1);
        aloud!(
            "{}: {} of {} stay up; of {} said to stay with soft servos {} do ({falls:?} {stays:?})",
            condition.0,
            stays[1],
            all.len(),
            held[1],
            held[0]
        );
    }
    let (falls, stays, _) = shares(0, 0);
    aloud!("as it is: falls {falls:?}, stays {stays:?} predicted");
    for [right, of] in [falls, stays] {
        assert!(right as f64 >= 0.95 * of as f64, "{right} of {of}");
    }
}
