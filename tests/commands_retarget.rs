//! `gaitway retarget`: the same trajectory in each kind of file.

mod aloud;
mod program;
mod python;

use aloud::aloud;
use gaitway::mocap::bvh;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::Output;

fn folder() -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("commands-retarget");
    std::fs::create_dir_all(&folder).expect("a temporary folder");
    folder
}

fn retarget(out: &Path, more: &[&str]) -> Output {
    crate::program::gaitway()
        .args(["retarget", "wave-r", "--robot", "op3", "--rate", "50", "-o"])
        .arg(out)
        .args(more)
        .output()
        .expect("the command")
}

/// A table: times, one row of angles per time, rad, the joints, and where the base is.
struct Table {
    times: Vec<f64>,
    poses: Vec<Vec<f64>>,
    names: Vec<String>,
    bases: Vec<Vec<f64>>,
}

/// The table, in a file of the test's own.
fn table(file: &str) -> Table {
    let path = folder().join(file);
    assert!(retarget(&path, &["--force"]).status.success());
    let text = std::fs::read_to_string(path).expect("a table");
    let mut lines = text.lines();
    let titles = lines.next().expect("titles").split(',').skip(1);
    let names = titles.filter_map(|title| title.strip_suffix("_rad").map(str::to_owned));
    let names: Vec<String> = names.collect();
    let (mut times, mut poses, mut bases) = (Vec::new(), Vec::new(), Vec::new());
    for line in lines {
        let row: Vec<f64> = line.split(',').map(|cell| cell.parse().expect("a number")).collect();
        let (joints, base) = row[1..].split_at(names.len());
        times.push(row[0]);
        poses.push(joints.to_vec());
        bases.push(base.to_vec());
    }
    Table { times, poses, names, bases }
}

#[test]
fn a_recording_holds_the_goals_of_the_table_and_nothing_that_was_not_measured() {
    let Table { times, poses, names, bases } = table("beside-mcap.csv");
    let path = folder().join("wave.mcap");
    let _ = std::fs::remove_file(&path);
    let output = retarget(&path, &[]);
    assert!(output.status.success(), "{output:?}");
    let recording = gaitway::recording::read(&path).expect("a recording");
    assert!(recording.finished);
    let series = gaitway::recording::joint_series(&recording);
    assert_eq!(series.joint_names, names);
    assert_eq!(series.times_s.len(), times.len());
    for (time_s, expected_s) in series.times_s.iter().zip(&times) {
        assert!((time_s - expected_s).abs() < 1e-6);
    }
    for (found, expected) in series.positions_rad.iter().flatten().zip(poses.iter().flatten()) {
        assert!((found - expected).abs() < 1e-8);
    }
    for (cycle, base) in recording.cycles.iter().zip(&bases) {
        let found = cycle.base.as_ref().expect("a base");
        let (at, turn) = (found.at_m, found.turn);
        let contacts = found.contacts.map(|stands| f64::from(u8::from(stands)));
        let found = [at.x, at.y, at.z, turn.w, turn.x, turn.y, turn.z, contacts[0], contacts[1]];
        assert_eq!(base.len(), found.len());
        assert!(found.iter().zip(base).all(|(a, b)| (a - b).abs() < 1e-8), "{found:?} {base:?}");
    }
    let overview = gaitway::recording::summary(&path).expect("a recording");
    assert_eq!(overview.channels.get("/joints/present"), None);
    assert_eq!(overview.missed_reads, 0);
    assert_eq!(retarget(&path, &[]).status.code(), Some(1), "never replaced unasked");
}

#[test]
fn a_bvh_file_has_the_robots_joints_and_as_many_poses_as_the_table_has_rows() {
    let Table { times, poses, names, bases } = table("beside-bvh.csv");
    let path = folder().join("wave.bvh");
    let output = retarget(&path, &["--force"]);
    assert!(output.status.success(), "{output:?}");
    let read = bvh::read(&path).expect("a BVH file");
    assert_eq!(read.pose_count(), times.len());
    assert!((read.time_step_s - 0.02).abs() < 1e-12);
    assert_eq!(read.joints[0].name, "base");
    for (row, base) in bases.iter().enumerate() {
        // X left, Y up, Z forward; cm.
        let seen = &read.pose(row)[..3];
        let expected = [base[1], base[2], base[0]].map(|metres| metres * 100.0);
        assert!(seen.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-3), "{row}: {seen:?}");
    }
    for (index, name) in names.iter().enumerate() {
        let joint = read.joints.iter().find(|joint| joint.name == *name).expect(name);
        // However a turn is split over three axes, its size is that of the joint's angle.
        for (row, pose) in poses.iter().enumerate() {
            let at = joint.first_channel;
            let angles = &read.pose(row)[at..at + 3];
            let [z, x, y] = [0, 1, 2].map(|part| angles[part].to_radians());
            let turn = glam::DQuat::from_euler(glam::EulerRot::ZXY, z, x, y);
            let size = 2.0 * turn.w.abs().min(1.0).acos();
            assert!((size - pose[index].abs()).abs() < 1e-6, "{name} {row}: {size}");
        }
    }
}

#[test]
fn an_ending_it_does_not_know_is_refused_with_those_it_does() {
    let output = retarget(&folder().join("wave.fbx"), &[]);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1));
    assert!(said.contains(".csv, .mcap, .bvh or .npz"), "{said}");
}

/// How far what learners read is from a table of the same motion, of which they have the part that begins after the
/// way to the first pose.
const BESIDE_TABLE: &str = "
import csv, json, sys, numpy as np
table, npz, plain, begins_s = *sys.argv[1:4], float(sys.argv[4])
rows = list(csv.reader(open(table)))
titles, values = rows[0], np.array(rows[1:], dtype=float)
joints = [title for title in titles if title.endswith('_rad')]
def at(times, title):
    return np.interp(times, values[:, 0], values[:, titles.index(title)])
data = np.load(npz, allow_pickle=False)
lines = np.loadtxt(plain, delimiter=',')
def off(found, times, names):
    return float(np.abs(found - np.stack([at(times, name) for name in names], axis=1)).max())
base = ['base_x_m', 'base_y_m', 'base_z_m']
quick = begins_s + np.arange(len(data['joint_pos'])) / 50
slow = begins_s + np.arange(len(lines)) / 30
print(json.dumps({
  'fps': int(data['fps'][0]),
  'names': [str(name) + '_rad' for name in data['joint_names']] == joints,
  'npz_rad': off(data['joint_pos'], quick, joints),
  'npz_m': off(data['body_pos_w'][:, 0], quick, base),
  'csv_rad': off(lines[:, 7:], slow, joints),
  'csv_m': off(lines[:, :7], slow, base + ['base_qx', 'base_qy', 'base_qz', 'base_qw']),
  'ends_s': [float(quick[-1]), float(slow[-1]), float(values[-1, 0])],
}))
";

#[test]
fn learners_read_the_motion_of_the_table_from_its_first_pose_on() {
    let python = match python::python() {
        Ok(python) => python,
        Err(why) => {
            aloud!("SKIPPED: {why}");
            return;
        }
    };
    let made = |file: &str, more: &[&str]| {
        let path = folder().join(file);
        let mut command = crate::program::gaitway();
        command.args(["retarget", "squat", "--robot", "op3", "--force", "--json", "-o"]);
        let output = command.arg(&path).args(more).output().expect("the command");
        assert!(output.status.success(), "{output:?}");
        let report: Value = serde_json::from_slice(&output.stdout).expect("a report");
        (path, report)
    };
    let (table, report) = made("learned-from.csv", &["--rate", "1000"]);
    let (npz, _) = made("learned.npz", &[]);
    let (plain, told) = made("learned.csv", &["--format", "robot-csv"]);
    let notes = told["notes"].to_string();
    assert!(notes.contains("the motion alone"), "{notes}");
    let begins_s = report["approach_s"].as_f64().expect("a way to the first pose");
    let read = std::process::Command::new(&python.program)
        .args(["-c", BESIDE_TABLE])
        .args([&table, &npz, &plain])
        .arg(begins_s.to_string())
        .output()
        .expect("Python");
    assert!(read.status.success(), "{}", String::from_utf8_lossy(&read.stderr));
    let read: Value = serde_json::from_slice(&read.stdout).expect("JSON");
    assert_eq!((&read["fps"], &read["names"]), (&Value::from(50), &Value::from(true)));
    // Between rows of the table, a millisecond apart, lines are straight.
    for (key, most) in [("npz_rad", 2e-5), ("npz_m", 2e-5), ("csv_rad", 2e-5), ("csv_m", 2e-5)] {
        assert!(read[key].as_f64().expect(key) < most, "{key}: {read}");
    }
    let ends_s: Vec<f64> = serde_json::from_value(read["ends_s"].clone()).expect("times");
    let longest = report["duration_s"].as_f64().expect("a duration");
    assert!((ends_s[2] - longest).abs() < 1e-3, "{read}");
    assert!(ends_s[..2].iter().all(|end_s| *end_s <= longest && *end_s > 0.5 * longest), "{read}");
}

#[test]
fn a_format_that_is_not_there_or_of_another_ending_or_of_another_robot_is_refused_and_nothing_written()
 {
    let wave = folder().join("refused.csv");
    let bare = folder().join("refused.npz");
    for (file, more, said) in [
        (&wave, &["--format", "robot-cvs"][..], "robot-csv"),
        (&bare, &["--format", "robot-csv"], "ends in .csv"),
        (&wave, &["--format", "unitree-csv"], "no left_hip_pitch"),
        (&bare, &["--rate", "29.97"], "whole number"),
    ] {
        let mut command = crate::program::gaitway();
        command.args(["retarget", "wave-r", "--robot", "op3", "-o"]).arg(file).args(more);
        let output = command.output().expect("the command");
        let told = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(1), "{told}");
        assert!(told.contains(said), "{more:?}: {told}");
        assert!(!file.exists());
    }
}
