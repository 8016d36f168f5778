//! Other people's packages, unmodified, move virtual actuators through a slcan adapter on a
//! pseudo-terminal. Where those really are is looked up past the line.

use super::aloud;
use super::python;
use gaitway_profiles::parse_robot;
use gaitway_sim::{Door, Options, World};
use serde_json::Value;
use std::path::Path;
use std::process::Command;
use std::sync::{Arc, Mutex, PoisonError};

/// One joint on one CAN line.
fn robot(actuator: &str, id: u8, answer_id: &str) -> String {
    format!(
        r#"
schema = 1
name = "one"
description = "one actuator"
source = "a fixture"
rate_hz = 100.0
acceleration_source = "assumed: a fixture"

[[line]]
name = "line"
kind = "can"
bitrate_bps = 1000000

[[joint]]
name = "joint"
line = "line"
id = {id}
servo = "{actuator}"
{answer_id}
kp_nm_rad = 30.0
kd_nm_s_rad = 1.0
direction = 1
offset_rad = 0.0
lower_rad = -3.0
upper_rad = 3.0
velocity_rad_s = 5.0
acceleration_rad_s2 = 25.0
initial_rad = 0.0
origin_m = [0.0, 0.0, 0.0]
axis = [0.0, 1.0, 0.0]

[anatomy]
base = ["pelvis"]
n_pose_rad = {{}}
source = "a fixture"

[[anatomy.segment]]
segment = "left_thigh"
joint = "joint"
direction_weight = 1.0
twist_weight = 0.0
"#
    )
}

/// What the client says of the actuator that it moved, after a look at where that really is.
fn moves(client: &str, actuator: &str, id: u8, answer_id: &str) -> Option<Value> {
    let python = match python::python() {
        Ok(python) => python,
        Err(cause) => {
            aloud!("SKIPPED: no Python with CAN packages, {client} moved nothing: {cause}");
            return None;
        }
    };
    let robot = parse_robot("one.toml", &robot(actuator, id, answer_id)).expect("a robot");
    let world = World::new(&robot, Options::default()).expect("a world");
    let world = Arc::new(Mutex::new(world));
    let door = Door::open(Arc::clone(&world), 0, None).expect("a terminal");
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/can_clients/on_the_line.py");
    let output = Command::new(python.program)
        .arg(script)
        .arg(client)
        .arg(door.path())
        .output()
        .expect("Python");
    let text = String::from_utf8_lossy(&output.stdout);
    let said: Value = serde_json::from_str(&text).unwrap_or_else(|error| {
        panic!("{error}: {text}{}", String::from_utf8_lossy(&output.stderr))
    });
    let position = said["position"].as_f64().unwrap_or(f64::NAN);
    assert!((position - 0.5).abs() <= 0.02, "{client}: {said}");
    let world = world.lock().unwrap_or_else(PoisonError::into_inner);
    let joint = world.actuator("joint").expect("a joint");
    assert!(!joint.enabled(), "{client} let it go");
    let is = joint.position_rad();
    assert!((is - 0.5).abs() <= 0.1, "{client}: it is at {is} rad");
    Some(said)
}

#[test]
fn damiao_motor_moves_a_virtual_damiao() {
    let Some(said) = moves("damiao", "dm4310", 1, "answer_id = 17") else { return };
    assert_eq!(said["range"], 12.5);
}

#[test]
fn robstride_dynamics_moves_a_virtual_robstride() {
    let Some(said) = moves("robstride", "rs02", 0x7F, "") else { return };
    let parameter = said["parameter"].as_f64().unwrap_or(f64::NAN);
    assert!((parameter - 0.5).abs() <= 0.05, "{said}");
}

/// Its range of position is that of the manual's sample code, 12.5 instead of 4 pi: what it calls
/// half a radian is 0.503.
#[test]
fn cybergear_driver_moves_a_virtual_cybergear() {
    moves("cybergear", "cybergear", 0x7F, "timeout_configured_s = 0.5");
}
