//! How much faster than life a 20-servo robot plays in virtual time: the whole command, from the
//! file to the report, at 100 Hz.
//!
//! Run: `cargo bench --bench virtual_time`

use std::process::Command;
use std::time::Instant;

fn main() {
    let cpuinfo = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = cpuinfo.lines().find_map(|line| line.strip_prefix("model name")).unwrap_or("?");
    println!("processor{model}; gaitway {}", env!("CARGO_PKG_VERSION"));
    println!(
        "{:>6} {:>14} {:>10} {:>12} {:>12}",
        "rounds", "robot time, s", "wall, s", "x real time", "violations"
    );
    for rounds in ["1", "10", "40"] {
        let began = Instant::now();
        let output = Command::new(env!("CARGO_BIN_EXE_gaitway"))
            .args(["play", "walk", "--robot", "op3", "--bus", "sim", "--rate", "100"])
            .args(["--loop", rounds, "--json", "--quiet"])
            .output()
            .expect("the gaitway command");
        let wall_s = began.elapsed().as_secs_f64();
        let report: serde_json::Value =
            serde_json::from_slice(&output.stdout).expect("a JSON report");
        let robot_s = report["duration_s"].as_f64().unwrap_or(0.0);
        let violations = report["referee"]["violations"].as_array().map_or(0, Vec::len);
        println!(
            "{rounds:>6} {robot_s:>14.2} {wall_s:>10.3} {:>12.0} {violations:>12}",
            robot_s / wall_s
        );
    }
}
