//! A minute of a 20-servo robot at 100 Hz over the pseudo-terminal of `simulate`, in real time that
//! waits for nobody: missed and late cycles, beside the lateness of the machine's own timer in the same run.
//!
//! Run: `cargo bench --bench real_time` (or with a number of seconds after `--`)

mod simulator;

use std::process::Command;
use std::time::{Duration, Instant};

const RATE_HZ: f64 = 100.0;

fn main() {
    let seconds: f64 = std::env::args().find_map(|a| a.parse().ok()).unwrap_or(60.0);
    let cpuinfo = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = cpuinfo.lines().find_map(|line| line.strip_prefix("model name")).unwrap_or("?");
    println!("processor{model}; gaitway {}", env!("CARGO_PKG_VERSION"));
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let timers: Vec<_> =
        (0..cores).map(|core| std::thread::spawn(move || timer_lateness(core, seconds))).collect();
    let played = play(seconds);
    for (core, timer) in timers.into_iter().enumerate() {
        let mut late_us = timer.join().expect("the timer thread");
        late_us.sort_by(f64::total_cmp);
        let at = |share: f64| late_us[((late_us.len() - 1) as f64 * share) as usize];
        let beyond = late_us.iter().filter(|&&us| us > 5_000.0).count();
        println!(
            "core {core}, idle timer: {} wake-ups, p50 {:.0} us, p99 {:.0} us, worst {:.0} us; \
             {beyond} later than half a cycle",
            late_us.len(),
            at(0.5),
            at(0.99),
            at(1.0)
        );
    }
    for key in ["outcome", "cycles", "missed_cycles", "late_cycles", "duration_s", "bus_load"] {
        println!("{key:<14} {}", played[key]);
    }
}

/// How late a thread of its own wakes on `core` that does what the loop does, sleep to an absolute
/// time, and nothing else, us.
fn timer_lateness(core: usize, seconds: f64) -> Vec<f64> {
    use gaitway::port::{Clock, MonotonicClock};
    let mut only = rustix::thread::CpuSet::new();
    only.set(core);
    // Where pinning is not allowed the figure is that of whichever core the thread is on.
    let _ = rustix::thread::sched_setaffinity(None, &only);
    let clock = MonotonicClock;
    let (began, period) = (clock.now(), Duration::from_secs_f64(1.0 / RATE_HZ));
    let ticks = (seconds * RATE_HZ) as u32;
    (1..=ticks)
        .map(|tick| {
            let due = began + period * tick;
            clock.sleep_until(due);
            clock.now().since(due).as_secs_f64() * 1e6
        })
        .collect()
}

/// Plays the shipped walk over and over until the time is up; the report.
fn play(seconds: f64) -> serde_json::Value {
    let link = std::env::temp_dir().join(format!("real-time-{}", std::process::id()));
    let mut simulator = simulator::op3(&link);
    let bus = format!("serial:{}", link.display());
    let began = Instant::now();
    // One round of the walk is some 8 s long on this robot.
    let rounds = (seconds / 8.0).ceil().max(1.0).to_string();
    let output = Command::new(env!("CARGO_BIN_EXE_gaitway"))
        .args(["play", "walk", "--hang", "--robot", "op3", "--bus", &bus, "--json", "--quiet"])
        .args(["--rate", "100", "--loop", &rounds])
        .output()
        .expect("the gaitway command");
    simulator.kill().and_then(|()| simulator.wait()).expect("ended");
    let _ = std::fs::remove_file(&link);
    println!("played for {:.1} s", began.elapsed().as_secs_f64());
    serde_json::from_slice(&output.stdout).expect("a JSON report")
}
