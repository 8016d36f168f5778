//! Who looks on, and what that does to a robot that plays: how late cycles of a walk begin at 100 Hz with nobody, one and
//! sixteen connections that hear all that is told, and with one Chromium; and how old what they see is.
//!
//! The baseline is the same motion without `--view`, five times in the same run: a figure counts only beside their spread.
//!
//! Run: `cargo bench --bench looked_on`; after `--` a number of seconds for each run, and a word of the rows to be run.

#[allow(dead_code)]
#[path = "../tests/chromium/mod.rs"]
mod chromium;
mod simulator;

use chromium::Browser;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, ChildStderr, Command, Stdio};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

const RATE_HZ: f64 = 100.0;
const GAITWAY: &str = env!("CARGO_BIN_EXE_gaitway");

/// Who looks on.
#[derive(Clone, Copy)]
enum Who {
    Nobody,
    Sockets(usize),
    Chromium,
}

fn main() {
    let seconds: f64 = std::env::args().find_map(|a| a.parse().ok()).unwrap_or(24.0);
    let wanted = std::env::args().skip(1).find(|word| word.starts_with(char::is_alphabetic));
    let cpuinfo = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = cpuinfo.lines().find_map(|line| line.strip_prefix("model name")).unwrap_or("?");
    println!("processor{model}; gaitway {}", env!("CARGO_PKG_VERSION"));
    let folder = std::env::temp_dir().join(format!("looked-on-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder");
    println!(
        "cycles began late, ms        p50     p99   p99.9   worst  missed    age of what is seen, ms: p50, p99"
    );
    for (name, who) in [
        ("without --view", Who::Nobody),
        ("without --view", Who::Nobody),
        ("without --view", Who::Nobody),
        ("without --view", Who::Nobody),
        ("without --view", Who::Nobody),
        ("--view, nobody looks", Who::Sockets(0)),
        ("1 connection", Who::Sockets(1)),
        ("16 connections", Who::Sockets(16)),
        ("1 Chromium", Who::Chromium),
    ] {
        if wanted.as_ref().is_some_and(|wanted| !name.contains(wanted.as_str())) {
            continue;
        }
        let run = run(&folder, who, seconds);
        let [p50, p99, p999, worst] = [0.5, 0.99, 0.999, 1.0].map(|share| at(&run.late_ms, share));
        print!("{name:<24} {p50:>7.2} {p99:>7.2} {p999:>7.2} {worst:>7.2} {:>7}", run.missed);
        if !run.age_ms.is_empty() {
            print!("    {:.0}, {:.0}", at(&run.age_ms, 0.5), at(&run.age_ms, 0.99));
        }
        println!("{}", run.ended.map_or_else(String::new, |how| format!("    {how}")));
    }
    let _ = std::fs::remove_dir_all(&folder);
}

/// Of sorted values the one below which this share lies.
fn at(sorted: &[f64], share: f64) -> f64 {
    sorted[((sorted.len() - 1) as f64 * share) as usize]
}

struct Run {
    /// Sorted, ms.
    late_ms: Vec<f64>,
    /// Sorted, ms; empty if nobody looked on.
    age_ms: Vec<f64>,
    missed: u64,
    /// How it ended, if not as it was to.
    ended: Option<String>,
}

fn now_s() -> f64 {
    SystemTime::now().duration_since(UNIX_EPOCH).expect("after 1970").as_secs_f64()
}

/// When something was seen, and which time of the robot it showed, s.
type Sight = (f64, f64);

fn run(folder: &Path, who: Who, seconds: f64) -> Run {
    let link = folder.join("op3");
    let (mut simulator, bus) = (simulator::op3(&link), format!("serial:{}", link.display()));
    let recording = folder.join("run.mcap");
    let (record, rounds) = (recording.display().to_string(), (seconds / 8.0).ceil().to_string());
    let mut command = Command::new(GAITWAY);
    command.args(["play", "walk", "--hang", "--robot", "op3", "--bus", &bus, "--json", "--force"]);
    command.args(["--rate", "100", "--loop", &rounds, "--record", &record]);
    if !matches!(who, Who::Nobody) {
        command.arg("--view");
    }
    let mut player =
        command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("the gaitway command");
    let said = BufReader::new(player.stderr.take().expect("piped"));
    let mut stdout = player.stdout.take().expect("piped");
    // A report that nobody reads fills the pipe.
    let report = std::thread::spawn(move || {
        let mut told = String::new();
        stdout.read_to_string(&mut told).expect("a report");
        told
    });
    let sights = match who {
        Who::Nobody => {
            drain(said);
            Vec::new()
        }
        Who::Sockets(count) => {
            let url = address(said);
            let listeners: Vec<_> = (0..count).map(|_| listener(&url)).collect();
            listeners.into_iter().flat_map(|of| of.join().expect("a listener")).collect()
        }
        Who::Chromium => looked_at(folder, &address(said), &mut player),
    };
    let told = report.join().expect("a report");
    player.wait().expect("it ends");
    let _ = simulator.kill();
    let _ = simulator.wait();
    let report: serde_json::Value = serde_json::from_str(&told).expect("JSON");
    let began_s = cycles(&recording);
    let (first, period) = (began_s[0], 1.0 / RATE_HZ);
    // A cycle that is skipped counts as missed; those after it are due where they would have been.
    let late_s = |at: &f64| {
        let late_s = (at - first).rem_euclid(period);
        if late_s > 0.9 * period { late_s - period } else { late_s }
    };
    let mut late_ms: Vec<f64> = began_s.iter().map(|at| late_s(at) * 1e3).collect();
    // The first is not the measure of the others: who was earliest was in time.
    let earliest = late_ms.iter().copied().fold(f64::INFINITY, f64::min);
    late_ms.iter_mut().for_each(|ms| *ms -= earliest);
    late_ms.sort_by(f64::total_cmp);
    let last = began_s[began_s.len() - 1] - first;
    let mut age_ms: Vec<f64> = sights
        .into_iter()
        // Before the first cycle and after the last nothing gets any older.
        .filter(|(_, showed)| *showed > 0.0 && *showed < last - 0.1)
        .map(|(at, showed)| (at - first - showed) * 1e3)
        .collect();
    age_ms.sort_by(f64::total_cmp);
    let ended = report["stop_reason"].as_str().map(|why| format!("{}: {why}", report["outcome"]));
    Run { late_ms, age_ms, missed: report["missed_cycles"].as_u64().unwrap_or(0), ended }
}

fn drain(mut said: BufReader<ChildStderr>) {
    std::thread::spawn(move || std::io::copy(&mut said, &mut std::io::sink()));
}

/// Where the page is.
fn address(mut said: BufReader<ChildStderr>) -> String {
    loop {
        let mut line = String::new();
        assert!(said.read_line(&mut line).expect("words") > 0, "no page is served");
        if let Some(url) = line.trim().strip_prefix("view ") {
            let url = url.trim().to_owned();
            drain(said);
            return url;
        }
    }
}

/// Hears all that is told.
fn listener(url: &str) -> std::thread::JoinHandle<Vec<Sight>> {
    let rest = url.strip_prefix("http://").expect("a page");
    let (host, path) = rest.split_at(rest.find('/').expect("a path"));
    let mut stream = TcpStream::connect(host).expect("it listens");
    let ask = format!("GET {path}frames HTTP/1.1\r\nHost: {host}\r\n\r\n");
    stream.write_all(ask.as_bytes()).expect("asked");
    std::thread::spawn(move || {
        let mut sights = Vec::new();
        for line in BufReader::new(stream).lines() {
            let Ok(line) = line else { break };
            let Some(data) = line.strip_prefix("data: ") else { continue };
            let at = now_s();
            let frame: serde_json::Value = serde_json::from_str(data).expect("JSON");
            sights.push((at, frame["time_s"].as_f64().expect("a time")));
        }
        sights
    })
}

/// What a browser has on its screen, looked at again and again.
fn looked_at(folder: &Path, url: &str, player: &mut Child) -> Vec<Sight> {
    let mut browser = Browser::start(&folder.join("browser")).expect("chromium");
    browser.look(1280, 900, false);
    browser.open_served(url);
    let mut sights = Vec::new();
    while player.try_wait().expect("its state").is_none() {
        let seen = browser.value("[Date.now() / 1e3, gaitway.figures().now]");
        if let (Some(at), Some(showed)) = (seen[0].as_f64(), seen[1].as_f64()) {
            sights.push((at, showed));
        }
        std::thread::sleep(Duration::from_millis(37));
    }
    sights
}

/// Wall time of every cycle of a recording, s.
fn cycles(recording: &Path) -> Vec<f64> {
    let bytes = std::fs::read(recording).expect("a recording");
    let mut cycles = Vec::new();
    for message in mcap::MessageStream::new(&bytes).expect("a recording") {
        let message = message.expect("a message");
        if message.channel.topic == "/cycle" {
            cycles.push(message.log_time as f64 * 1e-9);
        }
    }
    cycles
}
