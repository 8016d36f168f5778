//! Robots of a user's own: files that ask only for what a job needs, and drafts made of what answers on
//! a line.

mod aloud;
mod priority;
mod program;

use gaitway_profiles::{Robot, parse_robot, robot};
use gaitway_sim::{Door, Options, World};
use priority::run_before_others;
use program::{folder, json, words};
use serde_json::Value;
use std::collections::BTreeSet;
use std::net::SocketAddr;
use std::path::Path;
use std::process::Output;
use std::sync::{Arc, Mutex};

fn gaitway(folder: &Path, arguments: &[&str]) -> Output {
    program::gaitway().current_dir(folder).args(arguments).output().expect("the command")
}

/// A shipped robot behind a TCP port, as a bridge of a serial line is.
fn door(robot: &Robot) -> (Door, String) {
    run_before_others();
    let world = World::new(robot, Options::default()).expect("a virtual robot");
    let local = SocketAddr::from(([127, 0, 0, 1], 0));
    let door = Door::open_tcp(Arc::new(Mutex::new(world)), 0, local).expect("a TCP port");
    let address = door.path().display().to_string();
    (door, address)
}

const ARM: &str = r#"
schema = 1
name = "my-arm"

[[line]]
name = "arm"
baud_bps = 1000000

[[joint]]
name = "shoulder"
line = "arm"
id = 1
servo = "xm430-w350"
lower_rad = -1.5
upper_rad = 1.5
velocity_rad_s = 2.0
acceleration_rad_s2 = 10.0

[[joint]]
name = "elbow"
line = "arm"
id = 2
servo = "sts3215"
direction = -1
lower_rad = 0.2
upper_rad = 1.5
velocity_rad_s = 2.0
acceleration_rad_s2 = 10.0
"#;

#[test]
fn an_arm_without_body_places_or_setup_plays_tables_and_says_what_it_cannot() {
    let folder = folder("bare");
    // Its name is not its file's.
    std::fs::write(folder.join("left one.toml"), ARM).expect("written");
    let table = "time_s,shoulder_rad,elbow_rad\n0,0,0.25\n0.4,0.4,0.9\n0.8,0.4,0.9\n1.2,0,0.25\n";
    std::fs::write(folder.join("table.csv"), table).expect("written");
    let play = |motion: &str| {
        gaitway(&folder, &["play", motion, "--robot", "left one.toml", "--bus", "sim", "--json"])
    };
    let played = json(&play("table.csv"));
    assert_eq!(
        (&played["outcome"], &played["robot"]),
        (&"done".into(), &"my-arm".into()),
        "{played:#}"
    );
    assert_eq!(played["referee"]["violations"], Value::Array(Vec::new()));
    let refused = play("walk");
    assert_eq!(refused.status.code(), Some(1));
    let said = words(&refused);
    for part in ["which part of a body", "no [anatomy]", "a table (.csv)", "origin_m"] {
        assert!(said.contains(part), "{part}: {said}");
    }
    let checked = gaitway(&folder, &["profile", "check", "left one.toml"]);
    let said = words(&checked);
    assert!(checked.status.success(), "{said}");
    assert!(said.contains("my-arm: OK"), "{said}");
    assert!(said.contains("follows no body"), "what is impossible is said: {said}");
}

#[test]
fn live_mirroring_with_a_robot_that_follows_no_body_is_refused_before_it_is_looked_for() {
    let folder = folder("live");
    std::fs::write(folder.join("my-arm.toml"), ARM).expect("written");
    let bus = "serial:/dev/there-is-no-such-port";
    let refused =
        gaitway(&folder, &["live", "--from", "file:walk", "--robot", "my-arm.toml", "--bus", bus]);
    assert_eq!(refused.status.code(), Some(1));
    assert!(words(&refused).contains("which part of a body"), "{}", words(&refused));
}

#[test]
fn all_that_is_wrong_with_a_robot_file_is_told_at_once() {
    let folder = folder("faults");
    let wrong = ARM
        .replace(
            "upper_rad = 1.5\nvelocity_rad_s = 2.0\nacceleration_rad_s2 = 10.0\n\n",
            "up = 1\n\n",
        )
        .replace("id = 2", "id = \"two\"");
    std::fs::write(folder.join("wrong.toml"), &wrong).expect("written");
    let refused = gaitway(&folder, &["profile", "check", "wrong.toml"]);
    assert_eq!(refused.status.code(), Some(1));
    let said = words(&refused);
    for part in [
        "there is no key `up`",
        "the key `upper_rad` is missing",
        "the key `velocity_rad_s` is missing",
        "the key `acceleration_rad_s2` is missing",
        "the text \"two\", where a whole number from 0 to 255 belongs",
        "joint \"shoulder\"",
        "joint \"elbow\"",
    ] {
        assert!(said.contains(part), "{part}: {said}");
    }
}

#[test]
fn a_draft_of_what_answers_is_whole_and_its_robot_plays_where_it_was_made() {
    let so101 = robot("so101").expect("shipped");
    let (_door, address) = door(&so101);
    let folder = folder("draft");
    let new = ["robot", "new", "--from", &address, "-o", "my_arm.toml", "--json"];
    let made = gaitway(&folder, &new);
    assert!(made.status.success(), "{}", words(&made));
    let report = json(&made);
    assert_eq!(report["faults"], Value::Null, "{report:#}");
    let text = std::fs::read_to_string(folder.join("my_arm.toml")).expect("written");
    let draft = parse_robot("my_arm.toml", &text).expect("a robot file");
    assert_eq!((draft.name.as_str(), draft.lines.len()), ("my-arm", 1));
    assert_eq!(draft.lines[0].baud_bps(), Some(1_000_000));
    let of = |robot: &Robot| -> Vec<(u8, String)> {
        robot.joints.iter().map(|joint| (joint.id, joint.servo.clone())).collect()
    };
    // The gearing of an STS3215 is on its label, not in its registers.
    let model = |(id, servo): (u8, String)| (id, servo[..7].to_owned());
    let models = |robot: &Robot| of(robot).into_iter().map(model).collect::<Vec<_>>();
    assert_eq!(models(&draft), models(&so101));
    for (joint, real) in draft.joints.iter().zip(&so101.joints) {
        // Where it stands; a step of an STS3215 is 0.0015 rad.
        let start = joint.initial.expect("where it stands");
        assert!((start - real.initial_rad()).abs() < 0.002, "{}: {start}", joint.name);
        let (_, registers) = so101.setup_for(real);
        let (_, found) = draft.setup_for(joint);
        assert_eq!(found.get("Operating Mode"), registers.get("Operating Mode"));
    }
    // A twist of the last joint but one, and back, on the robot it was made of.
    let header: Vec<_> = draft.joints.iter().map(|joint| format!("{}_rad", joint.name)).collect();
    let row = |time_s: f64, turn_rad: f64| {
        let at = |joint: &gaitway_profiles::Joint| {
            joint.initial_rad() + if joint.id == 5 { turn_rad } else { 0.0 }
        };
        let angles: Vec<_> = draft.joints.iter().map(|joint| at(joint).to_string()).collect();
        format!("{time_s},{}\n", angles.join(","))
    };
    let table = format!("time_s,{}\n", header.join(","))
        + &row(0.0, 0.0)
        + &row(0.4, 0.2)
        + &row(0.8, 0.5)
        + &row(1.2, 0.2)
        + &row(1.6, 0.0);
    std::fs::write(folder.join("twist.csv"), table).expect("written");
    let play = ["play", "twist.csv", "--robot", "my_arm.toml", "--bus", &address, "--json"];
    // A machine that stalls stops what runs in real time, and says so.
    let mut played = json(&gaitway(&folder, &play));
    for _ in 0..3 {
        let code = played["stop"]["code"].as_str().unwrap_or_default();
        if !matches!(code, "late" | "stalled" | "silent") {
            break;
        }
        played = json(&gaitway(&folder, &play));
    }
    assert_eq!(played["outcome"], "done", "{played:#}");
    // The file is never written over.
    let again = gaitway(&folder, &new);
    assert_eq!(again.status.code(), Some(1));
    assert!(words(&again).contains("exists already"), "{}", words(&again));
}

#[test]
fn a_draft_says_what_its_line_did_not_tell() {
    let folder = folder("can");
    let new = ["robot", "new", "--robot", "berkeley-humanoid-lite", "-o", "legs.toml", "--json"];
    let new = [&new[..], &["--from", "left_leg=sim", "--from", "right_leg=sim"]].concat();
    let lines = robot("berkeley-humanoid-lite").expect("shipped").lines;
    let names: Vec<_> = lines.iter().map(|line| line.name.as_str()).collect();
    assert!(names.contains(&"left_leg") && names.contains(&"right_leg"), "{names:?}");
    let made = gaitway(&folder, &new);
    assert!(made.status.success(), "{}", words(&made));
    let report = json(&made);
    // A Recoil keeps its gains itself.
    assert_eq!(report["faults"], Value::Null, "{report:#}");
    let joints = report["joints"].as_array().expect("joints");
    assert_eq!(joints.len(), 12);
    assert!(joints.iter().any(|joint| joint["line"] == "right_leg"), "{report:#}");
    let distinct: BTreeSet<String> = joints.iter().map(|joint| joint["name"].to_string()).collect();
    assert_eq!(distinct.len(), 12, "names differ though IDs may not: {distinct:?}");
    assert!(report["notes"].to_string().contains("tells no limits"), "{report:#}");
}

#[test]
fn gains_that_no_line_tells_are_named_as_missing_and_the_draft_is_written_all_the_same() {
    let folder = folder("gains");
    let joint = |id: u8| {
        format!(
            "[[joint]]\nname = \"j{id}\"\nline = \"bus\"\nid = {id}\nanswer_id = {}\nservo = \"dm4310\"\n\
             kp_nm_rad = 20.0\nkd_nm_s_rad = 1.0\nlower_rad = -1.0\nupper_rad = 1.0\n\
             velocity_rad_s = 2.0\nacceleration_rad_s2 = 10.0\n",
            16 + id
        )
    };
    let line = "[[line]]\nname = \"bus\"\nkind = \"can\"\nbitrate_bps = 1000000\n";
    let text = format!("schema = 1\nname = \"two\"\n{line}{}{}", joint(1), joint(2));
    std::fs::write(folder.join("two.toml"), text).expect("written");
    let new = ["robot", "new", "--from", "sim", "--robot", "two.toml", "-o", "found.toml"];
    let made = gaitway(&folder, &[&new[..], &["--json"]].concat());
    assert!(made.status.success(), "{}", words(&made));
    let report = json(&made);
    let faults = report["faults"].as_str().unwrap_or_else(|| panic!("{report:#}"));
    let both = ["joint \"joint_1\"", "joint \"joint_2\""];
    assert!(
        faults.contains("gains") && both.iter().all(|joint| faults.contains(joint)),
        "{faults}"
    );
    let draft = std::fs::read_to_string(folder.join("found.toml")).expect("written");
    assert!(draft.contains("answer_id = 17") && draft.contains("answer_id = 18"), "{draft}");
}

#[test]
fn a_line_on_which_nobody_answers_makes_no_file() {
    let mut one = robot("op3").expect("shipped");
    one.joints.truncate(1);
    one.joints[0].id = 1;
    one.anatomy = None;
    let (door, address) = door(&one);
    drop(door);
    let folder = folder("nobody");
    let made = gaitway(&folder, &["robot", "new", "--from", &address, "-o", "nobody.toml"]);
    assert_eq!(made.status.code(), Some(1));
    assert!(!folder.join("nobody.toml").exists());
    for name in ["nobody.txt", "no body!.toml"] {
        let made = gaitway(&folder, &["robot", "new", "--from", &address, "-o", name]);
        assert!(words(&made).contains("not a usable name for a robot file"), "{}", words(&made));
    }
}

#[test]
fn the_least_robot_of_the_examples_swings_and_its_servo_is_the_one_it_names() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/two-joints");
    let play = ["play", "swing.csv", "--robot", "two-joints.toml", "--bus", "sim", "--json"];
    let played = json(&gaitway(&folder, &play));
    assert_eq!(played["outcome"], "done", "{played:#}");
    assert_eq!(played["referee"]["violations"], Value::Array(Vec::new()));
    // It has the model number of the servo it extends; the robot file says which of the two it is.
    let info = ["servo", "info", "sim", "2", "--robot", "two-joints.toml"];
    let said = words(&gaitway(&folder, &info));
    assert!(said.contains("MY-430") && said.contains("my-servo.toml"), "{said}");
}
