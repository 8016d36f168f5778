//! Every shipped action on the virtual OP3: done, at rest at its end, hardly slower than people.

use crate::aloud::aloud;
use gaitway::action::join::Join;
use gaitway::action::{Motion, phrase, vocabulary};
use gaitway::actionlet::Actionlet;
use gaitway::body::Dof;
use serde_json::Value;

/// Slowing that needs no reason.
const FAIR: f64 = 1.5;
/// What joints that do not stand in for one degree of freedom of the body may add to the rest, and
/// room between samples.
const MORE: f64 = 1.03;
/// Where OP3's hips begin to keep from their limit, deg: what asks for more is not followed.
const HIP_DEG: f64 = 69.0;
/// OP3's limits: XM430-W350 at 12 V, and full speed in 0.2 s.
const OP3_RAD_S: f64 = 4.796_165;
const OP3_RAD_S2: f64 = 23.981;

fn play(action: &str) -> Value {
    play_with(action, &[])
}

/// On a stand, where an action is done exactly.
fn play_with(action: &str, options: &[&str]) -> Value {
    let output = crate::program::gaitway()
        .args(["play", action, "--robot", "op3", "--bus", "sim", "--json", "-q", "--hang"])
        .args(options)
        .output()
        .unwrap();
    serde_json::from_slice(&output.stdout).expect("a JSON report")
}

/// Degrees of freedom that a single joint of OP3 stands in for, whatever the others do: with its leg
/// straight ahead the pitch of the hip, and always knee, ankle (its roll keeps the sole level) and head. Its arms lack a joint, so
/// that none of theirs is one of a person's.
fn played_by_one_joint(motion: &Motion) -> Vec<Dof> {
    let still = |dof: &Dof| motion.track(*dof).actionlets().iter().all(Actionlet::is_rest);
    let mut dofs = vec![Dof::NeckFlexion];
    for [flexion, abduction, rotation, knee, ankle] in [
        [
            Dof::LeftHipFlexion,
            Dof::LeftHipAbduction,
            Dof::LeftHipRotation,
            Dof::LeftKneeFlexion,
            Dof::LeftAnkleDorsiflexion,
        ],
        [
            Dof::RightHipFlexion,
            Dof::RightHipAbduction,
            Dof::RightHipRotation,
            Dof::RightKneeFlexion,
            Dof::RightAnkleDorsiflexion,
        ],
    ] {
        dofs.extend([knee, ankle]);
        if still(&abduction) && still(&rotation) {
            dofs.push(flexion);
        }
    }
    dofs
}

/// What the action itself asks for, before anything is retargeted: how much slower it must be played
/// that one joint of OP3 can do what its degree of freedom does, all of it, by the peaks of its
/// actionlets in closed form. The largest such factor, and whose it is.
fn asked(action: &str) -> (f64, &'static str) {
    let motion = vocabulary::find(action).unwrap().perform().unwrap();
    let mut most = (1.0, "-");
    for dof in played_by_one_joint(&motion) {
        for peaks in motion.track(dof).actionlets().iter().map(Actionlet::peaks) {
            let slower = (peaks.velocity_rad_s / OP3_RAD_S)
                .max((peaks.acceleration_rad_s2 / OP3_RAD_S2).sqrt());
            if slower > most.0 {
                most = (slower, dof.name());
            }
        }
    }
    most
}

fn was_moved(report: &Value) -> bool {
    let notes = report["notes"].as_array().unwrap();
    notes.iter().any(|note| note.as_str().unwrap().starts_with("moved so that the robot"))
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
    // An action rests at both ends; what is moved is a table, which is led in and out.
    let is_moved = was_moved(report);
    for key in ["ease_in_s", "ease_out_s"] {
        assert!(is_moved || report[key].as_f64() == Some(0.0), "{name}: {key}: it rests there");
    }
    report["retime_factor"].as_f64().unwrap()
}

/// Prints the table of docs/actions.md.
#[test]
fn all_actions_are_done_on_op3_and_slowed_only_where_servos_must() {
    let mut unfair = Vec::new();
    let mut in_itself = Vec::new();
    aloud!("| action | asked by its own joints | slowed on OP3 | decided by |");
    for name in vocabulary::names() {
        let report = play(name);
        let factor = judge(&report, name);
        if was_moved(&report) {
            in_itself.push(name);
        }
        let (asked, dof) = asked(name);
        let joint = report["retime_joint"].as_str().filter(|_| factor > 1.0).unwrap_or("-");
        aloud!("| {name} | {asked:.2} ({dof}) | {factor:.2} | {joint} |");
        let motion = vocabulary::find(name).unwrap().perform().unwrap();
        let hips = [Dof::LeftHipFlexion, Dof::RightHipFlexion];
        let mut turns = hips.into_iter().flat_map(|hip| motion.track(hip).actionlets());
        let followed = turns.all(|turn| turn.to_rad().to_degrees() < HIP_DEG);
        if followed && factor < asked {
            unfair.push(format!("{name}: {factor:.2}, though {dof} asks for {asked:.2}"));
        }
        if !(factor <= FAIR.max(MORE * asked)) {
            unfair.push(format!("{name}: {factor:.2}, asked {asked:.2}"));
        }
    }
    assert!(unfair.is_empty(), "slowed without a reason: {unfair:?}");
    // Its upper arms hang beside its chest: done exactly, its forearms would be in it.
    assert_eq!(in_itself, ["box-l", "box-r", "drink-l", "drink-r"]);
}

#[test]
fn on_its_own_feet_a_robot_leads_its_weight_inside_and_what_needs_nothing_is_done_exactly() {
    let on_feet = |action: &str, options: &[&str]| {
        let output = crate::program::gaitway()
            .args(["play", action, "--robot", "op3", "--bus", "sim", "--json", "-q"])
            .args(options)
            .output()
            .unwrap();
        let report: Value = serde_json::from_slice(&output.stdout).expect("a JSON report");
        assert_eq!(report["outcome"], "done", "{action}: {report:#}");
        assert_eq!(report["referee"]["violations"], serde_json::json!([]), "{action}");
        report
    };
    let margin_m = |report: &Value| report["metrics"]["balance_margin_m"].as_f64().unwrap();
    // Its own time and way, and moved.
    let (exact, moved) = (on_feet("squat", &["--no-retime"]), on_feet("squat", &[]));
    assert!(margin_m(&exact) < 0.012 && margin_m(&moved) > 0.02, "{exact:#} {moved:#}");
    // A kick to the side is a fall on one leg; led over the other foot, and slower in parts, it is none.
    let kick = on_feet("side-kick-l", &[]);
    assert_eq!(kick["metrics"]["predicted_fall_s"], Value::Null, "{kick:#}");
    let hung = play("side-kick-l");
    assert!(kick["duration_s"].as_f64() > hung["duration_s"].as_f64());
    // An arm that chops keeps no robot from standing.
    let (chops, hung) = (on_feet("chop-l", &[]), play("chop-l"));
    assert!(!was_moved(&chops), "{chops:#}");
    assert_eq!((&chops["duration_s"], &chops["joints"]), (&hung["duration_s"], &hung["joints"]));
}

#[test]
fn actions_in_a_row_come_to_rest_in_between_and_paces_change_there() {
    for phrase in ["walk:x2,wave-r,bow", "squat@2,squat@0.5", "sit-down,wave-l,stand-up"] {
        judge(&play(phrase), phrase);
    }
}

#[test]
fn rounds_of_a_phrase_are_joined_at_rest_at_any_speed() {
    for options in [&["--loop", "3"][..], &["--loop", "2", "--speed", "3"], &["--speed", "0.3"]] {
        judge(&play_with("walk:x1@2,squat@3", options), &options.join(" "));
    }
}

#[test]
fn a_pace_changes_where_every_joint_rests_and_no_velocity_jumps() {
    let of = |text: &str| phrase::perform(&phrase::load(text).unwrap(), Join::Transition).unwrap();
    let walk_s = of("walk:x2@2").duration_s();
    assert!((walk_s - of("walk:x2").duration_s() / 2.0).abs() < 1e-9);
    let motion = of("walk:x2@2,squat@0.5");
    let step_s = 1e-3;
    for dof in Dof::ALL {
        assert_eq!(motion.at(dof, walk_s).velocity_rad_s.abs(), 0.0, "{}", dof.name());
        let sharpest = motion.moving().filter(|(of, _)| *of == dof).map(|(_, piece)| piece.peaks());
        let most = sharpest.map(|peaks| peaks.acceleration_rad_s2).fold(0.0, f64::max);
        for step in 0..(motion.duration_s() / step_s) as u32 {
            let at = |step: u32| motion.at(dof, f64::from(step) * step_s).velocity_rad_s;
            let change = (at(step + 1) - at(step)).abs();
            assert!(change <= most * step_s + 1e-9, "{} at step {step}: {change}", dof.name());
        }
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
