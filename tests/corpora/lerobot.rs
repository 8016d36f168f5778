//! Motions of robots as other programs keep them: LeRobot datasets and Unitree's tables, written and read.

use crate::aloud::aloud;
use crate::program::{folder, gaitway, json, words};
use crate::python;
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

fn run(arguments: &[&str]) -> Value {
    json(&gaitway().args(arguments).arg("--json").output().expect("the program"))
}

/// What a run that is refused says.
fn refused(arguments: &[&str]) -> String {
    let output = gaitway().args(arguments).output().expect("the program");
    assert!(!output.status.success(), "{arguments:?} works: {}", words(&output));
    assert!(!words(&output).contains("panicked"), "{}", words(&output));
    words(&output)
}

fn shown(path: &Path) -> String {
    path.display().to_string()
}

/// A corpus of a wave, a bow and a kick, and where else things may go.
fn corpus(name: &str) -> (PathBuf, String) {
    let folder = folder(name);
    let corpus = shown(&folder.join("moves"));
    run(&["corpus", "new", &corpus]);
    run(&["corpus", "add", &corpus, "wave-r", "bow", "kick-r"]);
    (folder, corpus)
}

fn export(corpus: &str, question: &str, format: &str, robot: &str, into: &str) -> Value {
    let arguments = ["corpus", "export", corpus, question, "--format", format, "--robot", robot];
    run(&[&arguments[..], &["-o", into]].concat())
}

/// Runs a script of Python with these arguments, and gives back the JSON that it prints.
fn by_python(script: &str, arguments: &[&str]) -> Option<Value> {
    let python = match python::python() {
        Ok(python) => python,
        Err(cause) => {
            aloud!("SKIPPED: nothing to hold datasets against: {cause}");
            return None;
        }
    };
    let output = Command::new(&python.program)
        .args(["-c", script])
        .args(arguments)
        .output()
        .expect("python");
    assert!(output.status.success(), "{}", words(&output));
    Some(json(&output))
}

/// Reads a dataset as LeRobot does: pandas for tasks, Arrow for the rest; and has its figures reckoned by NumPy.
const READ: &str = r#"
import json, sys
import numpy as np, pandas as pd, pyarrow.parquet as pq
root = sys.argv[1]
info = json.load(open(root + "/meta/info.json"))
stats = json.load(open(root + "/meta/stats.json"))
tasks = pd.read_parquet(root + "/meta/tasks.parquet")
episodes = pd.read_parquet(root + "/meta/episodes/chunk-000/file-000.parquet")
file = pq.ParquetFile(root + "/" + info["data_path"].format(chunk_index=0, file_index=0))
groups = [file.read_row_group(n).to_pandas() for n in range(file.num_row_groups)]
worst = 0.0
for at, (group, row) in enumerate(zip(groups, episodes.to_dict("records"))):
    assert set(group["episode_index"]) == {at} == {row["episode_index"]}
    assert len(group) == row["length"] == row["dataset_to_index"] - row["dataset_from_index"]
    assert list(group["index"]) == list(range(row["dataset_from_index"], row["dataset_to_index"]))
    assert np.array_equal(group["timestamp"].to_numpy(), (np.arange(len(group)) / info["fps"]).astype("float32"))
    assert list(row["tasks"]) == [tasks.iloc[group["task_index"][0]].name]
    for key in ("action", "observation.state", "timestamp", "index"):
        values = np.stack([np.atleast_1d(x) for x in group[key]]).astype("float64")
        assert values.shape[1] == info["features"][key]["shape"][0]
        told = {"min": values.min(0), "max": values.max(0), "mean": values.mean(0), "std": values.std(0)}
        told |= {f"q{q:02}": np.quantile(values, q / 100, axis=0) for q in (1, 10, 50, 90, 99)}
        for name, wanted in told.items():
            worst = max(worst, float(np.abs(np.asarray(row[f"stats/{key}/{name}"]) - wanted).max()))
whole = pd.concat(groups)
for key in ("action", "observation.state"):
    values = np.stack(whole[key].to_numpy()).astype("float64")
    for name, wanted in {"min": values.min(0), "max": values.max(0), "mean": values.mean(0), "std": values.std(0)}.items():
        worst = max(worst, float(np.abs(np.asarray(stats[key][name]) - wanted).max()))
    assert stats[key]["count"] == [len(whole)]
from lerobot_doctor.dataset_loader import load_dataset
from lerobot_doctor.runner import run_checks
report = run_checks(load_dataset(root))
failed = [str(m) for r in report.results for m in r.messages if m.severity.name == "FAIL"]
print(json.dumps({
    "info": info, "worst": worst, "groups": len(groups), "tasks": list(tasks.index), "failed": failed,
    "checks": len(report.results),
    "action": [g["action"].map(list).map(lambda r: [float(x) for x in r]).to_list() for g in groups],
    "state": [g["observation.state"].map(lambda r: [float(x) for x in r]).to_list() for g in groups],
}))
"#;

fn rows(of: &Value) -> Vec<Vec<f64>> {
    let row =
        |row: &Value| row.as_array().expect("a row").iter().filter_map(Value::as_f64).collect();
    of.as_array().expect("rows").iter().map(row).collect()
}

fn table(path: &Path) -> Vec<Vec<f64>> {
    let text = fs::read_to_string(path).expect("a table");
    let row = |line: &str| line.split(',').map(|cell| cell.parse().expect("a number")).collect();
    text.lines().map(row).collect()
}

/// How far two tables are apart at most.
fn apart(one: &[Vec<f64>], other: &[Vec<f64>]) -> f64 {
    assert_eq!(one.len(), other.len(), "rows");
    let pairs = one.iter().zip(other).flat_map(|(a, b)| {
        assert_eq!(a.len(), b.len(), "columns");
        a.iter().zip(b)
    });
    pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// Asks LeRobot's own class, with PyTorch, what it reads of a dataset.
const READ_BY_LEROBOT: &str = r#"
import json, sys, torch
from lerobot.datasets.lerobot_dataset import LeRobotDataset
whole = LeRobotDataset("local/waves", root=sys.argv[1])
later = LeRobotDataset("local/waves", root=sys.argv[1], episodes=[1], delta_timestamps={"action": [0.0, 1 / 30]})
batch = next(iter(torch.utils.data.DataLoader(whole, batch_size=8)))
assert batch["action"].dtype == torch.float32 and torch.isfinite(batch["observation.state"]).all()
rows = [whole[at] for at in range(len(whole))]
print(json.dumps({
    "episodes": whole.num_episodes, "fps": whole.fps, "batch": list(batch["action"].shape),
    "action": [row["action"].tolist() for row in rows], "state": [row["observation.state"].tolist() for row in rows],
    "episode": [int(row["episode_index"]) for row in rows], "task": [row["task"] for row in rows],
    "pair": later[0]["action"].tolist(), "mean": whole.meta.stats["action"]["mean"].tolist(),
}))
"#;

#[test]
fn lerobots_own_class_gives_pytorch_each_frame_of_a_dataset() {
    if std::env::var_os("CI").is_none() {
        aloud!("SKIPPED: LeRobot's class with PyTorch (6 GB) reads a dataset where CI is set");
        return;
    }
    const LIST: &str = include_str!("../python/torch.txt");
    let made = python::environment("torch-environment", &[LIST], "torch, lerobot", |made| {
        made.pip("torch.txt", &[])
    });
    let environment = made.expect("an environment with PyTorch");
    let (folder, corpus) = corpus("with-torch");
    let (dataset, tables) = (folder.join("dataset"), folder.join("tables"));
    let question = "action=bow or action=wave-r";
    export(&corpus, question, "lerobot", "op3", &shown(&dataset));
    let by_csv = export(&corpus, question, "robot-csv", "op3", &shown(&tables));
    let output = Command::new(environment.join("bin/python"))
        .args(["-c", READ_BY_LEROBOT, &shown(&dataset)])
        // Nothing is asked of a hub.
        .envs([("HF_HUB_OFFLINE", "1"), ("HF_HOME", &shown(&folder.join("hub")))])
        .output()
        .expect("python");
    assert!(output.status.success(), "{}", words(&output));
    let read = json(&output);
    assert_eq!((&read["episodes"], &read["fps"]), (&2.into(), &30.into()));
    assert_eq!(
        read["batch"],
        serde_json::json!([8, by_csv["joints"].as_array().map_or(0, Vec::len)])
    );
    // Frame by frame what the tables say, which another writer wrote.
    let mut wanted: Vec<Vec<f64>> = Vec::new();
    for (episode, trial) in by_csv["trials"].as_array().expect("trials").iter().enumerate() {
        for row in table(&tables.join(trial["files"][0].as_str().expect("a file"))) {
            assert_eq!(read["episode"][wanted.len()], episode, "frame {}", wanted.len());
            assert_eq!(read["task"][wanted.len()], trial["action"], "frame {}", wanted.len());
            if !wanted.is_empty() && read["episode"][wanted.len() - 1] != episode {
                let pair = rows(&read["pair"]);
                assert!(apart(&pair[..1], &[row[7..].to_vec()]) < 2e-6, "the second episode alone");
            }
            wanted.push(row[7..].to_vec());
        }
    }
    assert!(wanted.len() > 200, "{} frames", wanted.len());
    let action = rows(&read["action"]);
    assert!(apart(&action, &wanted) < 2e-6, "{}", apart(&action, &wanted));
    assert_eq!(read["action"], read["state"]);
    for (joint, mean) in read["mean"].as_array().expect("means").iter().enumerate() {
        let own = wanted.iter().map(|row| row[joint]).sum::<f64>() / wanted.len() as f64;
        assert!((mean.as_f64().expect("a number") - own).abs() < 1e-5, "joint {joint}: {own}");
    }
}

#[test]
fn a_dataset_is_what_arrow_pandas_and_lerobot_doctor_read_of_it() {
    let (folder, corpus) = corpus("written");
    let (dataset, tables) = (folder.join("dataset"), folder.join("tables"));
    let question = "action=bow or action=wave-r";
    let report = export(&corpus, question, "lerobot", "op3", &shown(&dataset));
    assert_eq!(
        (&report["outcome"], &report["rate_hz"]),
        (&"done".into(), &30.0.into()),
        "{report:#}"
    );
    let by_csv = export(&corpus, question, "robot-csv", "op3", &shown(&tables));
    let Some(read) = by_python(READ, &[&shown(&dataset)]) else { return };
    assert!(read["worst"].as_f64().expect("a number") < 1e-9, "figures: {}", read["worst"]);
    assert_eq!(read["failed"], Value::Array(Vec::new()), "lerobot-doctor");
    assert!(read["checks"].as_u64().expect("a number") >= 8);
    assert_eq!(read["groups"], 2);
    let info = &read["info"];
    assert_eq!((&info["codebase_version"], &info["fps"]), (&"v3.0".into(), &30.into()));
    let joints = report["joints"].as_array().expect("joints");
    let names: Vec<Value> = joints
        .iter()
        .map(|joint| format!("{}_rad", joint.as_str().expect("a name")).into())
        .collect();
    assert_eq!(info["features"]["action"]["names"], Value::Array(names));
    // Goals of nobody who played them are goals and states alike, and are those of the tables.
    for (at, trial) in by_csv["trials"].as_array().expect("trials").iter().enumerate() {
        let of_dataset = &report["trials"][at];
        assert_eq!(of_dataset["episodes"], Value::Array(vec![at.into()]));
        assert_eq!(of_dataset["trial"], trial["trial"]);
        let file = tables.join(trial["files"][0].as_str().expect("a file"));
        let joints: Vec<Vec<f64>> = table(&file).iter().map(|row| row[7..].to_vec()).collect();
        let action = rows(&read["action"][at]);
        assert!(apart(&action, &joints) < 2e-6, "{}", apart(&action, &joints));
        assert_eq!(read["action"][at], read["state"][at]);
    }
}

#[test]
fn an_episode_is_played_as_it_was_written_and_what_is_mistyped_is_told() {
    let (folder, corpus) = corpus("played");
    let dataset = shown(&folder.join("dataset"));
    let report = export(&corpus, "action=bow or action=wave-r", "lerobot", "so101", &dataset);
    assert_eq!(report["trials"].as_array().expect("trials").len(), 2);
    let info = fs::read_to_string(Path::new(&dataset).join("meta/info.json")).expect("a file");
    let info: Value = serde_json::from_str(&info).expect("JSON");
    let frames = |episode: usize| {
        let motion = format!("{dataset}#{episode}");
        let played = run(&["play", &motion, "--robot", "so101", "--bus", "sim"]);
        assert_eq!(played["outcome"], "done", "{played:#}");
        assert_eq!(played["source"]["format"], "lerobot");
        played["source"]["frames"].as_u64().expect("frames")
    };
    assert_eq!(frames(0) + frames(1), info["total_frames"].as_u64().expect("frames"));

    let to = ["--robot", "so101", "--bus", "sim"];
    let said = |motion: &str| refused(&[&["play", motion][..], &to].concat());
    assert!(said(&dataset).contains("which episode is meant is not said"));
    assert!(said(&dataset).contains("dataset#1"), "{}", said(&dataset));
    assert!(said(&format!("{dataset}#2")).contains("there is no such episode"));
    assert!(said(&format!("{dataset}#99999999999999999999")).contains("not an episode's number"));
    assert!(said(&format!("{dataset}#-1")).contains("not an episode's number"));
    assert!(said(&format!("{dataset}#1:degrees")).contains("rad, deg or range"));
    assert!(said(&format!("{dataset}#1:deg")).contains("are in rad"));
    let other = refused(&["play", &format!("{dataset}#1"), "--robot", "op3", "--bus", "sim"]);
    assert!(other.contains("a joint that the robot does not have"), "{other}");
    assert!(refused(&["recognise", &format!("{dataset}#1")]).contains("no body"));
    let none = ["corpus", "export", &corpus, "--format", "lerobot", "-o", &dataset];
    assert!(refused(&none).contains("no robot is named"));
    let misplaced =
        ["--format", "robot-csv", "--robot", "op3", "--recordings", "x", "-o", &dataset];
    let misplaced = refused(&[&["corpus", "export", &corpus][..], &misplaced].concat());
    assert!(misplaced.contains("--format lerobot"), "{misplaced}");
}

/// Writes what LeRobot does for an SO-101: a list of fixed length, packed by Snappy, degrees, and the gripper's share of
/// its range.
const FOREIGN: &str = r#"
import json, os, sys
import numpy as np, pandas as pd, pyarrow as pa, pyarrow.parquet as pq
root, kind = sys.argv[1], sys.argv[2]
joints = ["shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper"]
lengths = [40, 60, 50]
for part in ("meta/episodes/chunk-000", "data/chunk-000"):
    os.makedirs(f"{root}/{part}")
feature = {"dtype": "float32", "shape": [6], "names": [j + ".pos" for j in joints]}
if kind == "range-names":
    feature["names"] = {"motors": [j + ".pos" for j in joints]}
info = {"codebase_version": "v2.1" if kind == "old" else "v3.0", "fps": 0 if kind == "fps" else 30, "total_episodes": 3,
        "features": {"action": feature, "observation.state": feature}, "data_path":
        "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"}
if kind == "elsewhere":
    info["data_path"] = "../../../etc/{chunk_index}/{file_index}.parquet"
if kind == "shape":
    info["features"]["action"]["shape"] = [4000000000]
json.dump(info, open(root + "/meta/info.json", "w"))
total, schema = 0, pa.schema([("action", pa.list_(pa.float32(), 6)), ("observation.state", pa.list_(pa.float32(), 6)),
    ("timestamp", pa.float32()), ("frame_index", pa.int64()), ("episode_index", pa.int64()), ("index", pa.int64())])
rows = []
writer = pq.ParquetWriter(root + "/data/chunk-000/file-000.parquet", schema if kind != "ragged" else
    schema.set(0, pa.field("action", pa.list_(pa.float32()))), compression="zstd" if kind == "zstd" else "snappy")
for episode, length in enumerate(lengths):
    t = np.arange(length)
    base = 20 * np.sin(t / 15.0 + episode)
    action = np.stack([base, base / 2, -base, base / 3, 0 * base, 50 + base], 1).astype("float32")
    if kind == "nan": action[7, 2] = np.nan
    action = [list(map(float, a)) for a in action]
    if kind == "ragged": action[5] = action[5][:4]
    table = pa.table({"action": pa.array(action, writer.schema.field("action").type), "observation.state":
        pa.array(action if kind != "ragged" else [[0.0] * 6] * length, schema.field(1).type),
        "timestamp": pa.array((t / 30).astype("float32")), "frame_index": t,
        "episode_index": np.full(length, episode), "index": t + total}, schema=writer.schema)
    writer.write_table(table)
    rows.append({"episode_index": episode, "tasks": ["wipe"], "length": 10**12 if kind == "long" else length + (kind == "length"),
        "data/chunk_index": 0, "data/file_index": 7 if kind == "lost" else 0, "dataset_from_index": total, "dataset_to_index": total + length})
    total += length
writer.close()
if kind == "no-row": rows = rows[:1]
pd.DataFrame(rows).to_parquet(root + "/meta/episodes/chunk-000/file-000.parquet")
if kind == "cut":
    path = root + "/data/chunk-000/file-000.parquet"
    at = pq.ParquetFile(path).metadata.row_group(1).column(0).data_page_offset
    data = open(path, "rb").read()
    open(path, "wb").write(data[:at] + bytes(40) + data[at + 40:])
print("{}")
"#;

#[test]
fn what_lerobot_recorded_of_an_arm_is_read_in_the_unit_that_is_said() {
    let folder = folder("foreign");
    for (kind, packed) in [("plain", "deg"), ("zstd", "deg"), ("range-names", "range")] {
        let dataset = shown(&folder.join(kind));
        if by_python(FOREIGN, &[&dataset, kind]).is_none() {
            return;
        }
        let unsaid =
            refused(&["retarget", &format!("{dataset}#1"), "--robot", "so101", "-o", "x.csv"]);
        assert!(unsaid.contains("are is not said in it") && unsaid.contains("#1:deg"), "{unsaid}");
        let file = shown(&folder.join(format!("{kind}.csv")));
        let motion = format!("{dataset}#1:{packed}");
        let report = run(&["retarget", &motion, "--robot", "so101", "-o", &file]);
        assert_eq!(report["source"]["frames"], 60, "{report:#}");
        // The end of the file is the end of the episode; the low-pass that hands get moves it a little.
        let text = fs::read_to_string(&file).expect("a table");
        let end: Vec<f64> = text
            .lines()
            .last()
            .expect("rows")
            .split(',')
            .map(|cell| cell.parse().expect("a number"))
            .collect();
        let base = 20.0 * f64::from(59.0_f32 / 15.0 + 1.0).sin();
        let lower_upper = |joint: &str| {
            let robot = gaitway_profiles::robot("so101").expect("a robot");
            let joint = robot.joints.iter().find(|of| of.name == joint).expect("a joint").clone();
            (joint.lower_rad, joint.upper_rad)
        };
        let share = |joint: &str, share: f64| {
            let (lower, upper) = lower_upper(joint);
            lower + share * (upper - lower)
        };
        let pan = if packed == "deg" {
            base.to_radians()
        } else {
            share("shoulder_pan", (base + 100.0) / 200.0)
        };
        let gripper = share("gripper", (50.0 + base) / 100.0);
        assert!((end[1] - pan).abs() < 0.02, "{kind}: {} and {pan}", end[1]);
        assert!((end[6] - gripper).abs() < 0.02, "{kind}: {} and {gripper}", end[6]);
    }
}

#[test]
fn damaged_and_lying_datasets_are_refused_with_what_is_wrong() {
    let folder = folder("hostile");
    let cases = [
        ("nan", "a joint's number is none"),
        ("ragged", "more or fewer than 6 numbers"),
        ("length", "more or fewer frames than its dataset tells"),
        ("long", "an episode is too long"),
        ("lost", "file-007.parquet"),
        ("no-row", "does not say where an episode is"),
        ("old", "a dataset of another version"),
        ("fps", "no frames a second that can be played"),
        ("elsewhere", "its frames are not where LeRobot puts them"),
        ("shape", "it does not name each of its joints"),
        ("cut", "cannot be read"),
    ];
    for (kind, wanted) in cases {
        let dataset = shown(&folder.join(kind));
        if by_python(FOREIGN, &[&dataset, kind]).is_none() {
            return;
        }
        let motion = format!("{dataset}#1:deg");
        let said = refused(&["play", &motion, "--robot", "so101", "--bus", "sim"]);
        assert!(said.contains(wanted), "{kind}: {said}");
    }
    // Every byte of what says where its frames are may be wrong.
    let dataset = folder.join("plain");
    by_python(FOREIGN, &[&shown(&dataset), "plain"]);
    let path = dataset.join("data/chunk-000/file-000.parquet");
    let whole = fs::read(&path).expect("bytes");
    let motion = format!("{}#1:deg", dataset.display());
    for at in (whole.len() - 1200..whole.len()).step_by(61) {
        let mut changed = whole.clone();
        changed[at] ^= 0x5a;
        fs::write(&path, &changed).expect("a file");
        let output = gaitway()
            .args([
                "retarget",
                &motion,
                "--robot",
                "so101",
                "--force",
                "-o",
                &shown(&folder.join("x.csv")),
            ])
            .output()
            .expect("the program");
        assert!(matches!(output.status.code(), Some(0 | 1)), "byte {at}: {}", words(&output));
    }
}

#[test]
fn goals_and_measured_angles_of_a_trial_that_was_played_are_actions_and_states() {
    let (folder, corpus) = corpus("recorded");
    let (tables, recordings) = (folder.join("tables"), folder.join("recordings"));
    fs::create_dir(&recordings).expect("a folder");
    let dataset = shown(&folder.join("dataset"));
    let report = export(&corpus, "action=bow", "robot-csv", "op3", &shown(&tables));
    let of_bow = report["trials"].as_array().expect("trials").iter();
    let bow = of_bow.clone().find(|trial| trial["action"] == "bow").expect("a bow");
    let file = shown(&tables.join(bow["files"][0].as_str().expect("a file")));
    let recording = shown(&recordings.join("a.mcap"));
    let arguments = ["play", &file, "--robot", "op3", "--bus", "sim", "--record", &recording];
    let played = run(&arguments);
    assert_eq!(played["outcome"], "done", "{played:#}");
    let with = |more: &[&str]| {
        let arguments =
            ["corpus", "export", &corpus, "action=bow", "--format", "lerobot", "--robot", "op3"];
        [&arguments[..], more].concat().iter().map(|text| (*text).to_owned()).collect::<Vec<_>>()
    };
    let arguments = with(&["--recordings", &shown(&recordings), "-o", &dataset]);
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let report = run(&arguments);
    let trials = report["trials"].as_array().expect("trials");
    let recorded: Vec<&Value> =
        trials.iter().filter(|trial| trial["recordings"].is_array()).collect();
    assert_eq!((recorded.len(), trials.len()), (1, 1));
    assert_eq!(
        (&recorded[0]["action"], recorded[0]["recordings"][0].as_str()),
        (&"bow".into(), Some(&*recording))
    );
    // The same out of the recording itself, cycle by cycle.
    let cycles = gaitway::recording::read(Path::new(&recording)).expect("a recording").cycles;
    let episode =
        usize::try_from(recorded[0]["episodes"][0].as_u64().expect("a number")).expect("small");
    let Some(read) = by_python(READ, &[&dataset]) else { return };
    let (action, state) = (rows(&read["action"][episode]), rows(&read["state"][episode]));
    assert!(apart(&action, &state) > 1e-3, "a servo follows its goal");
    let first = cycles.iter().find(|cycle| {
        cycle.joints.iter().all(|of| of.goal_rad.is_some() && of.present_position_rad.is_some())
    });
    let begin = first.expect("a cycle").at;
    let (mut seen, mut worst) = (0, 0.0_f64);
    for cycle in &cycles {
        let frame = cycle.at.seconds_since(begin) * 30.0;
        if (frame - frame.round()).abs() > 1e-3 || frame < 0.0 {
            continue;
        }
        let Some((action, state)) =
            action.get(frame.round() as usize).zip(state.get(frame.round() as usize))
        else {
            continue;
        };
        for (at, joint) in cycle.joints.iter().enumerate() {
            let Some((goal, present)) = joint.goal_rad.zip(joint.present_position_rad) else {
                continue;
            };
            worst = worst.max((goal - action[at]).abs()).max((present - state[at]).abs());
            seen += 1;
        }
    }
    assert!(seen > 100 && worst < 1e-3, "{seen} angles, {worst} rad apart");
    let empty = folder.join("empty");
    fs::create_dir(&empty).expect("a folder");
    let arguments = with(&["--recordings", &shown(&empty), "-o", &shown(&folder.join("other"))]);
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    assert!(refused(&arguments).contains("no recording of this robot is there"));
}

/// Joints of Unitree's G1, as its data set orders them (unitreerobotics/LAFAN1_Retargeting_Dataset).
fn of_g1() -> Vec<String> {
    let leg = ["hip_pitch", "hip_roll", "hip_yaw", "knee", "ankle_pitch", "ankle_roll"];
    let arm = [
        "shoulder_pitch",
        "shoulder_roll",
        "shoulder_yaw",
        "elbow",
        "wrist_roll",
        "wrist_pitch",
        "wrist_yaw",
    ];
    let side = |side: &str, parts: &[&str]| {
        parts.iter().map(|part| format!("{side}_{part}_joint")).collect::<Vec<_>>()
    };
    let waist = ["yaw", "roll", "pitch"].map(|part| format!("waist_{part}_joint")).to_vec();
    [side("left", &leg), side("right", &leg), waist, side("left", &arm), side("right", &arm)]
        .concat()
}

/// A robot with those joints, whose file lists them in another order: what moves with a body, from the pelvis out.
fn like_g1(folder: &Path) -> String {
    let joints = of_g1();
    // Each limb is a chain; the waist is one from the pelvis, and carries the arms.
    let parent = |at: usize| match at {
        0 | 6 | 12 => "pelvis".to_owned(),
        15 | 22 => format!("{}_l", joints[14]),
        _ => format!("{}_l", joints[at - 1]),
    };
    let origin = |at: usize| match (at, joints[at].as_str()) {
        (0, _) => "0 0.1 -0.05",
        (6, _) => "0 -0.1 -0.05",
        (15, _) => "0 0.15 0.3",
        (22, _) => "0 -0.15 0.3",
        (_, name)
            if ["knee", "ankle_pitch", "elbow", "wrist_roll"]
                .iter()
                .any(|of| name.contains(of)) =>
        {
            "0 0 -0.3"
        }
        _ => "0 0 0",
    };
    let axis = |name: &str| match name {
        name if name.contains("roll") => "1 0 0",
        name if name.contains("yaw") => "0 0 1",
        _ => "0 1 0",
    };
    let mut urdf = "<robot name=\"g\"><link name=\"pelvis\"><inertial><mass value=\"3\"/>\
        <inertia ixx=\"0.01\" iyy=\"0.01\" izz=\"0.01\" ixy=\"0\" ixz=\"0\" iyz=\"0\"/></inertial></link>"
        .to_owned();
    for (at, name) in joints.iter().enumerate().rev() {
        let (parent, origin, axis) = (parent(at), origin(at), axis(name));
        urdf += &format!(
            "<link name=\"{name}_l\"><inertial><mass value=\"0.1\"/><inertia ixx=\"0.001\" iyy=\"0.001\" izz=\"0.001\" \
             ixy=\"0\" ixz=\"0\" iyz=\"0\"/></inertial></link><joint name=\"{name}\" type=\"revolute\">\
             <parent link=\"{parent}\"/><child link=\"{name}_l\"/><origin xyz=\"{origin}\"/><axis xyz=\"{axis}\"/>\
             <limit lower=\"-2\" upper=\"2\" velocity=\"20\" effort=\"5\"/></joint>"
        );
    }
    let (model, robot) = (folder.join("g.urdf"), shown(&folder.join("g.toml")));
    fs::write(&model, urdf + "</robot>").expect("a model");
    run(&["robot", "import", &shown(&model), "--servo", "xm430-w350", "-o", &robot]);
    let listed = gaitway_profiles::robot(&robot).expect("a robot").joints;
    assert_ne!(
        listed.iter().map(|joint| joint.name.clone()).collect::<Vec<_>>(),
        joints,
        "another order"
    );
    robot
}

#[test]
fn tables_of_unitree_move_the_joints_that_they_mean_whatever_the_robots_file_lists_first() {
    let folder = folder("unitree");
    let robot = like_g1(&folder);
    let row = |at: usize| -> String {
        let joints =
            (0..29).map(|joint| format!("{:.6}", 0.01 * f64::from(joint) * (at as f64 / 60.0)));
        let base = ["0.1", "0.2", "0.7", "0", "0", "0", "1"].map(str::to_owned);
        base.into_iter().chain(joints).collect::<Vec<_>>().join(",") + "\n"
    };
    let path = folder.join("dance.csv");
    let whole: Vec<String> = (0..61).map(row).collect();
    fs::write(&path, whole.concat()).expect("a table");
    let out = shown(&folder.join("out.csv"));
    let report = run(&["retarget", &shown(&path), "--robot", &robot, "-o", &out]);
    assert_eq!(
        (&report["source"]["frames"], &report["source"]["rate_hz"]),
        (&61.into(), &30.0.into()),
        "{report:#}"
    );
    let text = fs::read_to_string(&out).expect("a table");
    let titles: Vec<&str> = text.lines().next().expect("titles").split(',').collect();
    let end: Vec<f64> = text
        .lines()
        .last()
        .expect("a row")
        .split(',')
        .map(|cell| cell.parse().expect("a number"))
        .collect();
    for (joint, name) in of_g1().iter().enumerate() {
        let column =
            titles.iter().position(|title| *title == format!("{name}_rad")).expect("a column");
        assert!((end[column] - 0.01 * joint as f64).abs() < 1e-5, "{name}: {}", end[column]);
    }
    let wrong = |name: &str, rows: Vec<String>, wanted: &str| {
        let path = folder.join(format!("{name}.csv"));
        fs::write(&path, rows.concat()).expect("a table");
        let said = refused(&[
            "retarget",
            &shown(&path),
            "--robot",
            &robot,
            "-o",
            &shown(&folder.join("none.csv")),
        ]);
        assert!(said.contains(wanted), "{name}: {said}");
    };
    let with = |at: usize, row: &str| {
        let mut rows = whole.clone();
        rows[at] = row.to_owned();
        rows
    };
    let short = whole[9].rsplit_once(',').expect("cells").0.to_owned() + "\n";
    wrong("short", with(9, &short), "line 10: 35 cells");
    wrong("nan", with(9, &whole[9].replacen("0.1", "nan", 1)), "line 10: nan");
    wrong("word", with(9, &whole[9].replacen("0.1", "left", 1)), "line 10: left");
    wrong("turn", with(9, &whole[9].replacen("0,0,0,1", "0,0,0,0", 1)), "has not the length 1");
    wrong("once", vec![whole[0].clone()], "two rows at least");
    wrong("narrow", vec!["1,2,3\n".to_owned(); 4], "36 numbers in a row, for this robot");
    let other = refused(&["play", &shown(&path), "--robot", "op3", "--bus", "sim"]);
    assert!(
        other.contains("27 numbers in a row, for this robot") && other.contains("36 cells"),
        "{other}"
    );
}

#[test]
fn a_table_in_unitrees_order_comes_back_as_the_motion_that_it_is() {
    let (folder, corpus) = corpus("unitree-back");
    let robot = like_g1(&folder);
    let (out, own) = (folder.join("out"), folder.join("own"));
    let report = export(&corpus, "action=wave-r", "unitree-csv", &robot, &shown(&out));
    assert_eq!(report["outcome"], "done", "{report:#}");
    assert_eq!(report["joints"], Value::Array(of_g1().into_iter().map(Value::from).collect()));
    let by_file = export(&corpus, "action=wave-r", "robot-csv", &robot, &shown(&own));
    let file = |report: &Value, within: &Path| {
        within.join(report["trials"][0]["files"][0].as_str().expect("a file"))
    };
    let (unitree, listed) = (table(&file(&report, &out)), table(&file(&by_file, &own)));
    // The same numbers, each where its own list of joints says.
    let names = by_file["joints"].as_array().expect("joints");
    for (at, joint) in of_g1().iter().enumerate() {
        let other = names.iter().position(|name| name == joint.as_str()).expect("a joint");
        let column = |rows: &[Vec<f64>], at: usize| {
            rows.iter().map(|row| vec![row[7 + at]]).collect::<Vec<_>>()
        };
        assert_eq!(column(&unitree, at), column(&listed, other), "{joint}");
    }
    let elbow = of_g1().iter().position(|joint| joint == "right_elbow_joint").expect("an elbow");
    let moved = unitree
        .iter()
        .map(|row| row[7 + elbow])
        .fold(0.0, |most: f64, angle| most.max(angle.abs()));
    assert!(moved > 0.3, "an arm waves: {moved} rad");
    let motion = shown(&file(&report, &out));
    let back =
        run(&["retarget", &motion, "--robot", &robot, "-o", &shown(&folder.join("back.csv"))]);
    assert_eq!(back["source"]["frames"], unitree.len(), "{back:#}");
}

#[test]
fn a_table_in_unitrees_order_is_refused_of_a_robot_without_those_joints() {
    let (folder, corpus) = corpus("to-unitree");
    let out = shown(&folder.join("out"));
    let said = refused(&[
        "corpus",
        "export",
        &corpus,
        "--format",
        "unitree-csv",
        "--robot",
        "op3",
        "-o",
        &out,
    ]);
    assert!(said.contains("no left_hip_pitch") && said.contains("robot-csv"), "{said}");
    assert!(!Path::new(&out).exists(), "nothing is begun");
    let unknown = refused(&[
        "corpus", "export", &corpus, "--format", "le-robot", "--robot", "op3", "-o", &out,
    ]);
    assert!(unknown.contains("unitree-csv, lerobot"), "{unknown}");
}
