//! The virtual robot as a person starts it, `gaitway simulate`, between two clients: what one sets
//! the other finds.

use crate::bench::{Client, Lost};
use crate::python::Python;
use crate::rustypot_wheel as wheel;
use crate::scenario::{About, Record, Run, Scenario};
use serde_json::{Value, json};
use std::io::{BufRead, BufReader};
use std::process::{Child, Stdio};

pub static BETWEEN_TWO: Scenario = Scenario::new(
    crate::dynamixel_sdk::NAME,
    "DYNAMIXEL 2.0",
    About::Everything(&[]),
    Run::Python(between_two),
);

/// The simulator in a process of its own; ends with the test.
struct Simulator(Child);

impl Drop for Simulator {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn between_two(python: &Python, _: &mut Record) -> Result<(), Lost> {
    let link = format!("{}/clients-op3", env!("CARGO_TARGET_TMPDIR"));
    let _ = std::fs::remove_file(&link);
    let mut command = crate::program::gaitway();
    command.args(["simulate", "op3", "--pty", &link]);
    let child = command.stdout(Stdio::piped()).stderr(Stdio::null()).spawn();
    let mut simulator = Simulator(child.expect("the simulator"));
    // Its first line says that the port is there.
    let mut said = String::new();
    let stdout = simulator.0.stdout.as_mut().expect("its output");
    BufReader::new(stdout).read_line(&mut said).expect("a line");
    let ids: Vec<i64> = (1..=20).collect();
    let goals: Vec<Value> = ids.iter().map(|id| json!([id, 2048 + 7 * id])).collect();
    let set: Vec<i64> = ids.iter().map(|id| 2048 + 7 * id).collect();
    let mut sdk = Client::start(python, "dynamixel_sdk_client.py", &[&link, "2000000", "2"]);
    sdk.ask("sync_write", json!([116, 4, goals]))?;
    assert_eq!(sdk.ask("ping", json!([20]))?, 1020);
    drop(sdk);
    let mut other = wheel::client_at(python, &link, "2000000", "Xl430");
    let seen = other.ask("sync_read_register", json!([ids, "goal_position"]))?;
    assert_eq!(seen, json!(set));
    Ok(())
}
