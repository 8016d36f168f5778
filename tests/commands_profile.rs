//! `gaitway profile` for programs: one JSON document on standard output, or in a file.

mod program;

use serde_json::Value;
use std::process::Output;

fn run(arguments: &[&str]) -> Output {
    crate::program::gaitway().arg("profile").args(arguments).output().expect("the command")
}

fn json(arguments: &[&str]) -> Value {
    let output = run(arguments);
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    serde_json::from_slice(&output.stdout).expect("one JSON document")
}

#[test]
fn the_list_names_every_shipped_profile_by_kind() {
    let list = json(&["list", "--json"]);
    let names = |kind: &str| -> Vec<String> {
        let listed = list[kind].as_array().expect(kind).iter();
        listed.map(|one| one["name"].as_str().expect("a name").to_owned()).collect()
    };
    assert_eq!(names("servos"), gaitway_profiles::servo_names().collect::<Vec<_>>());
    assert_eq!(names("actuators"), gaitway_profiles::actuator_names().collect::<Vec<_>>());
    assert_eq!(names("sensors"), gaitway_profiles::sensor_names().collect::<Vec<_>>());
    assert_eq!(names("robots"), gaitway_profiles::robot_names().collect::<Vec<_>>());
    assert_eq!(names("adapters").len(), gaitway_profiles::adapters().expect("valid").len());
    let text = String::from_utf8(run(&["list"]).stdout).expect("text");
    for kind in ["servos", "actuators", "sensors", "robots", "adapters"] {
        names(kind).iter().for_each(|name| assert!(text.contains(name), "{name}"));
    }
}

#[test]
fn a_servo_that_extends_another_is_shown_as_the_whole_it_is() {
    let shown = json(&["show", "sts3215-c018", "--json"]);
    let servo = gaitway_profiles::servo("sts3215-c018").expect("shipped");
    assert_eq!(shown["name"], "sts3215-c018");
    assert_eq!(shown.get("extends"), None);
    let registers = shown["register"].as_array().expect("registers");
    assert_eq!(registers.len(), servo.registers.len());
}

#[test]
fn a_check_lists_what_nobody_could_confirm_and_writes_the_same_to_a_file() {
    let path = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join("profile-check.json");
    let _ = std::fs::remove_file(&path);
    let report = path.to_str().expect("a path");
    let checked = json(&["check", "x-imu3", "--json", "--report", report]);
    assert_eq!((&checked["outcome"], &checked["kind"]), (&"done".into(), &"sensor".into()));
    let unconfirmed = checked["unconfirmed"].as_array().expect("a list");
    assert!(unconfirmed.iter().any(|fact| fact["place"] == "channel MagneticField"), "{checked}");
    let written = std::fs::read(&path).expect("a report");
    assert_eq!(serde_json::from_slice::<Value>(&written).expect("JSON"), checked);
    // A second time it would overwrite.
    assert_eq!(run(&["check", "x-imu3", "--report", report]).status.code(), Some(1));
}
