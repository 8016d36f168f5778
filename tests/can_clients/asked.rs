//! Asks other people's CAN code for frames and for what frames mean.

use crate::python;
use gaitway::wire::can::{CanFrame, CanId};
use serde_json::Value;
use std::io::Write as _;
use std::path::Path;
use std::process::{Command, Stdio};

/// Every answer, in order; none, with a word about it, where there is no Python.
pub fn asked(requests: &[Value]) -> Option<Vec<Value>> {
    let python = match python::python() {
        Ok(python) => python,
        Err(cause) => {
            crate::aloud!("SKIPPED: no Python with CAN packages, nothing was compared: {cause}");
            return None;
        }
    };
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/can_clients/frames.py");
    let mut child = Command::new(python.program)
        .arg(script)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .expect("Python starts");
    let lines: Vec<_> = requests.iter().map(Value::to_string).collect();
    let mut input = child.stdin.take().expect("an input");
    // All at once would fill both pipes.
    let writer = std::thread::spawn(move || {
        let _ = input.write_all((lines.join("\n") + "\n").as_bytes());
    });
    let output = child.wait_with_output().expect("an end");
    writer.join().expect("written");
    let text = String::from_utf8(output.stdout).expect("text");
    let answers: Vec<Value> =
        text.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    assert_eq!(answers.len(), requests.len(), "an answer to each");
    Some(answers)
}

/// The one frame a client sent: identifier and bytes.
#[track_caller]
pub fn sent(answer: &Value) -> (CanId, Vec<u8>) {
    let [frame] = answer.as_array().expect("frames").as_slice() else { panic!("{answer}") };
    let number = frame[0].as_f64().expect("an identifier") as u32;
    let id = match frame[1].as_bool().expect("a flag") {
        true => CanId::extended(number),
        false => CanId::standard(number),
    };
    (id.expect("fits"), bytes(frame[2].as_str().expect("bytes")))
}

#[track_caller]
pub fn assert_sent(answer: &Value, ours: &CanFrame) {
    assert_eq!(sent(answer), (ours.id(), ours.payload().to_vec()), "{ours:?}");
}

#[track_caller]
pub fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

#[track_caller]
pub fn error(answer: &Value) -> &str {
    answer["error"].as_str().unwrap_or_else(|| panic!("{answer} is no error"))
}

pub fn bytes(hexadecimal: &str) -> Vec<u8> {
    let pairs = hexadecimal.as_bytes().chunks(2);
    pairs
        .map(|p| u8::from_str_radix(std::str::from_utf8(p).expect("ASCII"), 16).expect("hex"))
        .collect()
}

pub fn hexadecimal(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}
