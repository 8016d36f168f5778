//! The reference MCAP reader for Python (<https://pypi.org/project/mcap/>) opens our recordings
//! and finds in them what we put there.

mod aloud;
mod python;

use aloud::aloud;
use std::fs;
use std::path::Path;
use std::process::Command;

use gaitway::recording::{Recorder, recover};

#[path = "recording/scene.rs"]
mod scene;

use scene::{WALL_START_S, cycle, end, messages, start};

const SCRIPT: &str = r#"
import json, sys
from mcap.reader import make_reader
from mcap.stream_reader import StreamReader

path = sys.argv[1]
with open(path, "rb") as file:
    records = sum(1 for _ in StreamReader(file, validate_crcs=True).records)
with open(path, "rb") as file:
    reader = make_reader(file, validate_crcs=True)
    statistics = reader.get_summary().statistics
    found = {
        "records": records,
        "message_count": statistics.message_count,
        "counts": {},
        "schemas": {},
        "first": {},
        "first_log_time": {},
        "metadata": {entry.name: entry.metadata for entry in reader.iter_metadata()},
    }
    for schema, channel, message in reader.iter_messages():
        topic = channel.topic
        found["counts"][topic] = found["counts"].get(topic, 0) + 1
        found["schemas"][topic] = schema.name
        found["first"].setdefault(topic, json.loads(message.data))
        found["first_log_time"].setdefault(topic, message.log_time)
print(json.dumps(found))
"#;

fn seen_by(python: &Path, recording: &Path) -> serde_json::Value {
    let output =
        Command::new(python).args(["-c", SCRIPT]).arg(recording).output().expect("it ran before");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

#[test]
fn the_reference_reader_finds_what_was_recorded() {
    let python = match python::python() {
        Ok(python) => python.program,
        Err(cause) => {
            aloud!("SKIPPED: no Python with the mcap package, nothing was compared: {cause}");
            return;
        }
    };
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("python-recordings");
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).unwrap();
    let path = folder.join("trial.mcap");
    let recorder = Recorder::create(&path, false, start()).unwrap();
    (0..60).for_each(|n| recorder.take_patiently(cycle(n)));
    let stored = recorder.finish(end(60));
    assert_eq!(stored.messages, (0..60).map(messages).sum::<u64>() + 2);

    let seen = seen_by(&python, &path);
    assert_eq!(seen["message_count"], stored.messages);
    let counts = serde_json::json!({
        "/run": 2, "/joints/goal": 60, "/joints/present": 60, "/cycle": 60, "/health": 15
    });
    assert_eq!(seen["counts"], counts);
    assert_eq!(seen["schemas"]["/joints/present"], "foxglove.JointStates");
    let present = &seen["first"]["/joints/present"];
    assert_eq!(present["joints"][0]["position"], -0.125);
    assert_eq!(present["joints"][1], serde_json::json!({ "name": "r_el" }));
    assert_eq!(seen["first"]["/health"]["joints"][0]["temperature_c"], 41.0);
    assert_eq!(seen["first_log_time"]["/cycle"], WALL_START_S * 1_000_000_000);
    assert_eq!(seen["metadata"]["gaitway.start"]["robot"], "op3");
    assert_eq!(seen["metadata"]["gaitway.end"]["outcome"], "done");

    let bytes = fs::read(&path).unwrap();
    fs::write(&path, &bytes[..bytes.len() - 200]).unwrap();
    let recovered = recover(&path, false).unwrap();
    let seen = seen_by(&python, &recovered.path);
    assert_eq!(seen["message_count"], recovered.messages);
    assert_eq!(seen["counts"], counts);
    assert_eq!(seen["metadata"]["gaitway.recovered"]["was_finished"], "false");
}
