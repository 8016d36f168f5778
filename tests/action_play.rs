//! Every shipped action on the virtual OP3: done, at rest at its end, hardly slower than people.

use gaitway::action::vocabulary;
use serde_json::Value;
use std::io::Write;
use std::process::Command;

/// Slowing that needs no reason.
const FAIR: f64 = 1.5;
/// OP3's limits: XM430-W350 at 12 V, and full speed in 0.2 s.
const OP3_RAD_S: f64 = 4.8;
const OP3_RAD_S2: f64 = 24.0;

/// Actions an OP3 does in a way of its own: its upper arms do not turn about themselves, so what a
/// person does with a turn of the upper arm it does with large moves of shoulder and elbow.
const NO_UPPER_ARM_ROTATION: [&str; 2] = ["drink-l", "drink-r"];

fn play(action: &str) -> Value {
    let output = Command::new(env!("CARGO_BIN_EXE_gaitway"))
        .args(["play", action, "--robot", "op3", "--bus", "sim", "--json", "-q"])
        .output()
        .unwrap();
    serde_json::from_slice(&output.stdout).expect("a JSON report")
}

/// How much slower the action itself would have to be, joint for joint, to keep OP3's limits.
fn asked(action: &str) -> f64 {
    let motion = vocabulary::find(action).unwrap().perform().unwrap();
    let slower = motion.moving().map(|(_, piece)| {
        let peaks = piece.peaks();
        (peaks.velocity_rad_s / OP3_RAD_S).max((peaks.acceleration_rad_s2 / OP3_RAD_S2).sqrt())
    });
    slower.fold(1.0, f64::max)
}

fn judge(report: &Value, name: &str) -> f64 {
    assert_eq!(report["outcome"], "done", "{name}: {report:#}");
    assert_eq!(report["source"]["format"], "action", "{name}");
    assert_eq!(report["referee"]["violations"], serde_json::json!([]), "{name}");
    for key in ["max_start_velocity_rad_s", "max_end_velocity_rad_s"] {
        assert_eq!(report[key].as_f64(), Some(0.0), "{name}: {key}");
    }
    for joint in report["joints"].as_array().unwrap() {
        let of = |key: &str| joint[key].as_f64().unwrap();
        assert!(of("peak_velocity_rad_s") <= of("limit_velocity_rad_s") * 1.000_001, "{name}");
        let peak = of("peak_acceleration_rad_s2");
        assert!(peak <= of("limit_acceleration_rad_s2") * 1.000_001, "{name}");
    }
    report["retime_factor"].as_f64().unwrap()
}

#[test]
fn all_actions_are_done_on_op3_and_slowed_only_where_servos_must() {
    let mut unfair = Vec::new();
    for name in vocabulary::names() {
        let factor = judge(&play(name), name);
        let asked = asked(name);
        let _ = writeln!(
            std::io::stderr(),
            "{name:24} slowed {factor:.2} times; its own actionlets ask for {asked:.2}"
        );
        if factor > FAIR && asked <= FAIR && !NO_UPPER_ARM_ROTATION.contains(&name) {
            unfair.push(format!("{name}: {factor:.2}"));
        }
    }
    assert!(unfair.is_empty(), "slowed without a reason: {unfair:?}");
}

#[test]
fn actions_in_a_row_come_to_rest_in_between_and_paces_change_there() {
    for phrase in ["walk:x2,wave-r,bow", "squat@2,squat@0.5", "sit-down,wave-l,stand-up"] {
        judge(&play(phrase), phrase);
    }
}

#[test]
fn wrong_phrases_are_refused_with_what_there_is() {
    for (phrase, words) in [
        ("walk,dance", &["dance", "jumping-jacks"][..]),
        ("walk:fast", &["walk:fast", "NAME:6s"]),
        ("no-such.toml", &["no-such.toml"]),
    ] {
        let report = play(phrase);
        assert_eq!(report["outcome"], "refused", "{phrase}");
        let reason = report["stop_reason"].as_str().unwrap();
        for word in words {
            assert!(reason.contains(word), "{word:?} is not in {reason}");
        }
    }
}
