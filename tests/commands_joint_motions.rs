//! `gaitway play` of motions that are in the robot's own joints already.

mod program;

use gaitway::recording::{CycleRecord, JointRecord, RecordedJoint, Recorder, RunEnd, RunStart};
use gaitway::time::Instant;
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::process::Output;
use std::time::{Duration, SystemTime};

fn file(name: &str) -> PathBuf {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("joint-motions");
    std::fs::create_dir_all(&folder).expect("a folder");
    folder.join(name)
}

fn gaitway(arguments: &[&str]) -> Output {
    crate::program::gaitway().args(arguments).output().expect("the command")
}

fn played(motion: &str, more: &[&str]) -> Value {
    let mut arguments = vec!["play", motion, "--robot", "op3", "--bus", "sim", "--json"];
    arguments.extend(more);
    let output = gaitway(&arguments);
    serde_json::from_slice(&output.stdout)
        .unwrap_or_else(|_| panic!("{}", String::from_utf8_lossy(&output.stderr)))
}

fn refusal(motion: &str, more: &[&str]) -> String {
    let mut arguments = vec!["play", motion, "--robot", "op3", "--bus", "sim"];
    arguments.extend(more);
    let output = gaitway(&arguments);
    assert_eq!(output.status.code(), Some(1));
    let said = [output.stdout, output.stderr].concat();
    String::from_utf8_lossy(&said).into_owned()
}

fn joint<'a>(report: &'a Value, name: &str) -> &'a Value {
    let joints = report["joints"].as_array().expect("joints");
    joints.iter().find(|joint| joint["name"] == name).expect("a joint of the robot")
}

fn named(name: &str) -> RecordedJoint {
    RecordedJoint {
        name: name.into(),
        lower_rad: None,
        upper_rad: None,
        velocity_limit_rad_s: None,
        acceleration_limit_rad_s2: None,
    }
}

/// A head that is turned by hand from 0.3 rad: 0.3 cos(2 t), read with the noise of an encoder of
/// 4,096 counts, every seventh reading missing. Any more joints do the same.
fn taught(name: &str, joints: &[&str]) -> String {
    let path = file(name);
    let began = Instant::from_nanos(1_000_000_000);
    let start = RunStart {
        robot: "op3".into(),
        motion: "taught".into(),
        joints: joints.iter().map(|&name| named(name)).collect(),
        wall_clock_start: SystemTime::UNIX_EPOCH,
        monotonic_start: began,
        gaitway_version: "0".into(),
        metadata: BTreeMap::new(),
    };
    let recorder = Recorder::create(&path, true, start).expect("a recording");
    let count = std::f64::consts::TAU / 4096.0;
    for n in 0..=250_u32 {
        let time_s = f64::from(n) / 50.0;
        let angle_rad = (0.3 * (2.0 * time_s).cos() / count).round() * count;
        let missed = n % 7 == 3;
        let record = JointRecord {
            present_position_rad: (!missed).then_some(angle_rad),
            missed: missed.then(|| "no answer".into()),
            ..JointRecord::default()
        };
        recorder.take_patiently(CycleRecord {
            cycle: n.into(),
            at: began + Duration::from_secs_f64(time_s),
            joints: vec![record; joints.len()],
            base: None,
        });
    }
    let summary = recorder.finish(RunEnd {
        outcome: "done".into(),
        stop_reason: None,
        at: began + Duration::from_secs(6),
        metadata: BTreeMap::new(),
    });
    assert!(summary.is_complete());
    path.display().to_string()
}

#[test]
fn a_joint_that_a_motion_names_twice_is_refused_and_both_places_are_named() {
    let path = file("twice.csv");
    let rows = "0,0,0,0.1\n0.4,0,0,0.1\n";
    std::fs::write(&path, format!("time_s,r_knee_rad,head_pan_rad,r_knee_rad\n{rows}"))
        .expect("a table");
    let said = refusal(&path.display().to_string(), &[]);
    assert!(said.contains("r_knee: column 2 and column 4"), "{said}");

    let said = refusal(&taught("twice.mcap", &["head_pan", "head_tilt", "head_pan"]), &[]);
    assert!(said.contains("head_pan: joint 1 and joint 3"), "{said}");
}

#[test]
fn a_motion_taught_by_hand_is_played_back_from_rest_to_rest() {
    let report = played(&taught("taught.mcap", &["head_pan"]), &[]);
    assert_eq!(report["outcome"], "done", "{report}");
    assert_eq!(report["source"]["format"], "taught");
    assert_eq!(report["retime_factor"], 1.0, "slow enough for the robot as it is");
    let head = joint(&report, "head_pan");
    let range = head["range_rad"].as_array().expect("a range");
    let (low, high) = (range[0].as_f64().expect("rad"), range[1].as_f64().expect("rad"));
    assert!((low + 0.3).abs() < 0.02 && (high - 0.3).abs() < 0.02, "{low} to {high}");
    for joint in report["joints"].as_array().expect("joints") {
        assert_eq!(joint["end_velocity_rad_s"], 0.0);
        assert_eq!(joint["start_velocity_rad_s"], 0.0);
    }
    assert_eq!(report["referee"]["violations"], serde_json::json!([]));
}

#[test]
fn a_table_and_a_recording_of_goals_play_as_the_action_they_are_made_from() {
    let (table, recording) = (file("bow.csv"), file("bow.mcap"));
    let action = played("bow", &[]);
    for out in [&table, &recording] {
        let out = out.display().to_string();
        let made = gaitway(&["retarget", "bow", "--robot", "op3", "-o", &out, "--force"]);
        assert!(made.status.success(), "{made:?}");
        let report = played(&out, &[]);
        assert_eq!(report["outcome"], "done", "{report}");
        assert_eq!(report["retime_factor"], 1.0);
        for name in ["r_hip_pitch", "head_tilt"] {
            let range = |report: &Value, end: usize| {
                joint(report, name)["range_rad"][end].as_f64().expect("rad")
            };
            for end in [0, 1] {
                let (found, expected) = (range(&report, end), range(&action, end));
                assert!((found - expected).abs() < 0.01, "{name}: {found} {expected}");
            }
        }
    }
}

#[test]
fn a_trajectory_faster_than_the_robot_is_slowed_only_when_asked() {
    let path = file("fast.csv");
    let rows = (0..=200).map(|n| {
        let time_s = f64::from(n) / 100.0;
        // A half turn of 0.8 rad and back, at rest at both ends, at up to 60 rad/s2.
        format!("{time_s},{}\n", 0.4 * (1.0 - (12.566_370_614 * time_s).cos()))
    });
    std::fs::write(&path, format!("time_s,head_pan_rad\n{}", rows.collect::<String>()))
        .expect("a table");
    let path = path.display().to_string();
    let said = refusal(&path, &[]);
    assert!(said.contains("head_pan") && said.contains("--retime"), "{said}");
    let report = played(&path, &["--retime"]);
    assert_eq!(report["outcome"], "done");
    // OP3's head may be accelerated by 24 rad/s2; 0.4 rad at 4 pi rad/s asks for 63.2.
    let factor = report["retime_factor"].as_f64().expect("a factor");
    assert!((factor - (63.2_f64 / 24.0).sqrt()).abs() < 0.1, "{factor}");
}

#[test]
fn key_frames_are_joined_by_actionlets_that_rest_in_each() {
    let table = file("keys.csv");
    std::fs::write(&table, "time_s,head_pan_rad\n10,0\n11,0.5\n13,-0.5\n").unwrap();
    let record = file("keys.mcap");
    let arguments = ["--hang", "--force", "--record", record.to_str().unwrap()];
    let report = played(table.to_str().unwrap(), &arguments);
    assert_eq!(report["outcome"], "done", "{report}");
    assert_eq!(report["source"]["format"], "key frames");
    // The peak of Eq. 1 is twice the mean speed.
    let peak_rad_s = joint(&report, "head_pan")["peak_velocity_rad_s"].as_f64().expect("a peak");
    assert!((peak_rad_s - 1.0).abs() < 0.01, "{peak_rad_s} rad/s");
    let recorded = gaitway::recording::read(&record).expect("a recording");
    let start = recorded.start.expect("a start");
    let index = start.joints.iter().position(|joint| joint.name == "head_pan").expect("the joint");
    let goals: Vec<f64> =
        recorded.cycles.iter().filter_map(|cycle| cycle.joints[index].goal_rad).collect();
    // It rests in its key frames: there goals are turned round, and nowhere else.
    let steps: Vec<f64> = goals.windows(2).map(|two| two[1] - two[0]).collect();
    let moving: Vec<f64> = steps.into_iter().filter(|step| step.abs() > 2e-3).collect();
    let turns = moving.windows(2).filter(|two| two[0] * two[1] < 0.0).count();
    assert_eq!(turns, 1, "up to the second, down to the third");
    let highest = goals.iter().copied().fold(f64::MIN, f64::max);
    assert!((highest - 0.5).abs() < 1e-3, "{highest} rad");
    assert!((goals.last().expect("goals") + 0.5).abs() < 1e-3);
}

#[test]
fn a_key_frame_at_the_end_of_a_joints_range_is_played() {
    let upper_rad = gaitway_profiles::robot("so101").expect("a robot").joints[0].upper_rad;
    let path = file("at-the-end.csv");
    for end_rad in [upper_rad, -upper_rad] {
        let rows = format!("time_s,shoulder_pan_rad\n0,0\n2,{end_rad}\n4,{end_rad}\n6,0\n");
        std::fs::write(&path, rows).expect("written");
        let motion = path.display().to_string();
        let arguments = ["play", &motion, "--robot", "so101", "--bus", "sim", "--json"];
        let output = gaitway(&arguments);
        let report: Value = serde_json::from_slice(&output.stdout)
            .unwrap_or_else(|_| panic!("{}", String::from_utf8_lossy(&output.stderr)));
        assert_eq!(report["outcome"], "done", "{end_rad}: {}", report["stop_reason"]);
    }
}

#[test]
fn key_frames_of_the_body_are_a_motion_too() {
    let (table, angles) = (file("bend.csv"), file("bend-angles.csv"));
    std::fs::write(&table, "time_s,right_elbow_flexion_deg\n0,0\n1,90\n3,0\n").unwrap();
    let output =
        gaitway(&["convert", table.to_str().unwrap(), angles.to_str().unwrap(), "--force"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(String::from_utf8_lossy(&output.stderr).contains("3 key frames"));
    let text = std::fs::read_to_string(&angles).expect("a table");
    let mut rows = text.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let titles = rows.next().expect("titles");
    let column = titles.iter().position(|title| *title == "right_elbow_flexion_rad");
    let column = column.expect("the elbow");
    let bent: Vec<f64> = rows.map(|row| row[column].parse().expect("a number")).collect();
    assert_eq!(bent.len(), 301);
    // A quarter of the way up Eq. 1 has done 1/4 - 1/(2 pi) of its change, half way a half of it.
    let quarter = 0.25 - 1.0 / std::f64::consts::TAU;
    for (row, part) in [(0, 0.0), (25, quarter), (50, 0.5), (100, 1.0), (200, 0.5), (300, 0.0)] {
        let expected = part * std::f64::consts::FRAC_PI_2;
        assert!((bent[row] - expected).abs() < 1e-5, "{row}: {}, not {expected}", bent[row]);
    }
}

#[test]
fn what_cannot_be_played_is_refused_in_words() {
    let table = |name: &str, text: &str| {
        let path = file(name);
        std::fs::write(&path, text).expect("a table");
        path.display().to_string()
    };
    for (text, more, words) in [
        ("time_s,head_pan_rad\n0,0\n0.4,9\n", &[][..], "leaves a joint's limits"),
        ("time_s,tail_rad\n0,0\n0.4,0\n", &[], "a joint that the robot does not have"),
        ("time_s,head_pan_rad\n0,0\n0.1,0\n2,0\n", &[], "the motion has a gap"),
        ("time_s,head_pan_rad\n0,0\n1e5,0\n", &[], "key frames over too long a time"),
        ("time_s,head_pan_rad\n0,0\n0,0\n", &[], "time does not go on"),
        ("time_s,head_pan_rad\n0,NaN\n0.1,0\n", &[], "a cell is no number"),
        ("time_s,head_pan_rad\n0,0,1\n", &[], "not one number per column"),
        ("time_s,head_pan\n0,0\n1,0\n", &[], "in rad"),
        ("time,head_pan\n", &[], "not a table of joint angles"),
        ("time_s,head_pan_rad\n0,0\n", &[], "two rows"),
        ("time_s,head_pan_rad\n0,0\n0.4,0\n", &["--mirror"], "already"),
        ("time_s,head_pan_rad\n0,0\n0.4,0\n", &["--from", "3"], "no such section"),
        ("time_s,r_knee_rad,head_pan_rad,r_knee_rad\n0,0,0,0\n0.4,0,0,0\n", &[], "named twice"),
        (
            "time_s,head_pan_rad\n0,0\n0.4,0\n",
            &["--only", "head_pan,r_knee,head_pan"],
            "head_pan: name 1 and name 3",
        ),
    ] {
        let said = refusal(&table("wrong.csv", text), more);
        assert!(said.contains(words), "{words:?} expected in:\n{said}");
        assert!(said.contains("allowed") || said.contains("to do"), "{said}");
    }
}

#[test]
fn a_table_of_minutes_is_played_as_one_of_seconds_is() {
    let table = file("minutes.csv").display().to_string();
    let made = ["retarget", "squat:40s", "--robot", "op3", "--rate", "200", "-o", &table];
    let made = gaitway(&[&made[..], &["--force"]].concat());
    assert!(made.status.success(), "{made:?}");
    let bytes = std::fs::metadata(&table).expect("a table").len();
    assert!(bytes > 2 << 20, "more than a profile may have: {bytes}");
    let report = played(&table, &["--dry-run"]);
    assert_eq!(report["outcome"], "done", "{report}");
    // The clip, and what leads to it.
    let duration_s = report["source"]["duration_s"].as_f64().expect("a time");
    assert!(duration_s > 40.0, "{duration_s}");
    let said = refusal(&file("").display().to_string(), &[]);
    assert!(!said.contains("panicked"), "{said}");
}
