//! What one control cycle costs beside the wire, over a pseudo-terminal whose bytes take no time:
//! goals to N servos by sync write, states of N servos by one group read, for several drivers in
//! one run.
//!
//! The time of a cycle is host time plus the virtual servos' own, the same for all drivers. The
//! share of the wire limit is wire / (wire + host), with the wire time of the cycle's bytes at that
//! line speed and 2 us of return delay: what is left of the rate a host without cost would reach.
//!
//! Run: `cargo bench --bench cycle`. DynamixelSDK is the Python package; without Python its rows
//! are missing, and it is said.

#[path = "../tests/python/mod.rs"]
mod python;

use gaitway::bus::{Bus, GroupItem, GroupQuestion, GroupRead, Protocol, Timing};
use gaitway::port::serial::SerialLine;
use gaitway::port::{Clock, MonotonicClock};
use gaitway::time::Duration;
use gaitway_profiles::{Robot, Setup};
use gaitway_sim::{Door, Options, World};
use python::Python;
use std::process::Command;
use std::sync::{Arc, Mutex};
use std::time::Instant;

const CYCLES: u32 = 1_000;
const WARM_UP: u32 = 100;
const SERVOS: [u8; 4] = [6, 12, 20, 30];
const RETURN_DELAY_US: f64 = 2.0;
/// What the makers' SDK grants an answer beside its bytes.
const PATIENCE: Duration = Duration::from_millis(34);
const LINE_BPS: u32 = 1_000_000;

/// A way to read many servos, and what is read and written.
struct Kind {
    name: &'static str,
    servo: &'static str,
    protocol: Protocol,
    read: GroupRead,
    goal: (u16, u16),
    state: (u16, u16),
}

const KINDS: [Kind; 5] = [
    Kind {
        name: "2.0 sync",
        servo: "xm430-w350",
        protocol: Protocol::Dynamixel2,
        read: GroupRead::Sync,
        goal: (116, 4),
        state: (126, 10),
    },
    Kind {
        name: "2.0 fast sync",
        servo: "xm430-w350",
        protocol: Protocol::Dynamixel2,
        read: GroupRead::Fast,
        goal: (116, 4),
        state: (126, 10),
    },
    Kind {
        name: "2.0 bulk",
        servo: "xm430-w350",
        protocol: Protocol::Dynamixel2,
        read: GroupRead::Bulk,
        goal: (116, 4),
        state: (126, 10),
    },
    Kind {
        name: "1.0 bulk",
        servo: "mx-28",
        protocol: Protocol::Dynamixel1,
        read: GroupRead::Bulk,
        goal: (30, 2),
        state: (36, 6),
    },
    Kind {
        name: "STS sync",
        servo: "sts3215",
        protocol: Protocol::FeetechSts,
        read: GroupRead::Sync,
        goal: (42, 2),
        state: (56, 6),
    },
];

/// Mean and 99th percentile of a cycle, us.
struct Cost {
    mean_us: f64,
    p99_us: f64,
}

fn main() {
    let python = python::python();
    if let Err(cause) = &python {
        println!("no DynamixelSDK: {cause}");
    }
    println!("{}", machine());
    println!("{CYCLES} cycles each; ratio to gaitway; share of the wire limit at 1, 2, 4 Mbit/s\n");
    println!(
        "{:<14} {:>2} {:<17} {:>9} {:>9} {:>6} | {:>7} {:>7} {:>7}",
        "read", "N", "driver", "us/cycle", "p99, us", "ratio", "1 M", "2 M", "4 M"
    );
    for kind in &KINDS {
        for servos in SERVOS {
            compare(kind, servos, python.as_ref().ok());
        }
    }
}

fn compare(kind: &Kind, servos: u8, python: Option<&Python>) {
    let ids: Vec<u8> = (1..=servos).collect();
    let ours = time_of(kind, servos, |path| gaitway(path, kind, &ids));
    row(kind, servos, "gaitway", &ours, &ours);
    // dynamixel2 0.9.1 has no fast reads, and its bulk read asks for the wrong bytes.
    if kind.protocol == Protocol::Dynamixel2 && kind.read == GroupRead::Sync {
        let theirs = time_of(kind, servos, |path| dynamixel2(path, kind, &ids));
        row(kind, servos, "dynamixel2", &theirs, &ours);
    }
    if kind.read != GroupRead::Bulk {
        let theirs = time_of(kind, servos, |path| rustypot(path, kind, &ids));
        row(kind, servos, "rustypot", &theirs, &ours);
    }
    let sdk = python.filter(|_| kind.protocol != Protocol::FeetechSts);
    if let Some(theirs) = sdk.and_then(|python| sdk_cost(python, kind, servos)) {
        row(kind, servos, "DynamixelSDK (Py)", &theirs, &ours);
    }
}

fn row(kind: &Kind, servos: u8, driver: &str, cost: &Cost, ours: &Cost) {
    let share = |mbps: f64| {
        let wire_us = wire_us(kind, f64::from(servos), mbps);
        100.0 * wire_us / (wire_us + cost.mean_us)
    };
    println!(
        "{:<14} {servos:>2} {driver:<17} {:>9.1} {:>9.1} {:>6.2} | {:>5.1} % {:>5.1} % {:>5.1} %",
        kind.name,
        cost.mean_us,
        cost.p99_us,
        cost.mean_us / ours.mean_us,
        share(1.0),
        share(2.0),
        share(4.0)
    );
}

/// Line time of the cycle's bytes, us: packet sizes of the makers' manuals.
fn wire_us(kind: &Kind, n: f64, mbps: f64) -> f64 {
    let (goal, state) = (f64::from(kind.goal.1), f64::from(kind.state.1));
    let (bytes, delays) = match (kind.protocol, kind.read) {
        (Protocol::Dynamixel2, GroupRead::Sync) => {
            (14.0 + n * (1.0 + goal) + 14.0 + n + n * (11.0 + state), n)
        }
        (Protocol::Dynamixel2, GroupRead::Fast) => {
            (14.0 + n * (1.0 + goal) + 14.0 + n + 8.0 + n * (4.0 + state), 1.0)
        }
        (Protocol::Dynamixel2, _) => {
            (14.0 + n * (1.0 + goal) + 10.0 + 5.0 * n + n * (11.0 + state), n)
        }
        (_, GroupRead::Bulk) => (8.0 + n * (1.0 + goal) + 7.0 + 3.0 * n + n * (6.0 + state), n),
        (_, _) => (8.0 + n * (1.0 + goal) + 8.0 + n + n * (6.0 + state), n),
    };
    bytes * 10.0 / mbps + RETURN_DELAY_US * delays
}

/// `servos` servos of one kind on one line.
fn line_of(kind: &Kind, servos: u8) -> Robot {
    let mut robot = gaitway_profiles::robot("op3").expect("op3 ships with gaitway");
    robot.lines[0].kind = gaitway_profiles::LineKind::Serial { baud_bps: LINE_BPS };
    let pattern = robot.joints[0].clone();
    let joint = |id: u8| {
        let mut joint = pattern.clone();
        joint.name = format!("joint_{id}");
        joint.servo = kind.servo.to_owned();
        joint.id = id;
        joint
    };
    robot.joints = (1..=servos).map(joint).collect();
    let firmware = gaitway_profiles::servo(kind.servo).expect("a shipped servo").firmware.min;
    robot.setups = vec![Setup {
        servo: kind.servo.to_owned(),
        joints: None,
        firmware,
        registers: [("Return Delay Time".to_owned(), 1)].into(),
        source: "a bench".to_owned(),
    }];
    robot
}

fn virtual_line(kind: &Kind, servos: u8) -> Door {
    let options = Options { line_timing: false, ..Options::default() };
    let world = World::new(&line_of(kind, servos), options).expect("virtual servos");
    Door::open(Arc::new(Mutex::new(world)), 0, None).expect("a pseudo-terminal")
}

/// What a cycle costs. `open` gets the path of a fresh virtual line and returns a cycle.
fn time_of(kind: &Kind, servos: u8, open: impl FnOnce(&str) -> Box<dyn FnMut()>) -> Cost {
    let door = virtual_line(kind, servos);
    let mut cycle = open(door.path().to_str().expect("a UTF-8 path"));
    for _ in 0..WARM_UP {
        cycle();
    }
    let mut times_us: Vec<f64> = (0..CYCLES)
        .map(|_| {
            let began = Instant::now();
            cycle();
            began.elapsed().as_secs_f64() * 1e6
        })
        .collect();
    let mean_us = times_us.iter().sum::<f64>() / times_us.len() as f64;
    times_us.sort_by(f64::total_cmp);
    Cost { mean_us, p99_us: times_us[times_us.len() * 99 / 100] }
}

fn gaitway(path: &str, kind: &Kind, ids: &[u8]) -> Box<dyn FnMut()> {
    let port = SerialLine::open(path, LINE_BPS).expect("the virtual line's port");
    let timing =
        Timing { baud_bps: LINE_BPS, return_delay: Duration::from_micros(2), latency: PATIENCE };
    let mut bus = Bus::new(Box::new(port), Arc::new(MonotonicClock), timing);
    let (address, length) = kind.state;
    let items = ids.iter().map(|&id| GroupItem { id, address, length }).collect();
    let question = GroupQuestion { protocol: kind.protocol, kind: kind.read, items };
    let goal_bytes = 2048_u32.to_le_bytes();
    let goals: Vec<u8> = ids.to_vec();
    let (goal_address, goal_length) = kind.goal;
    let protocol = kind.protocol;
    Box::new(move || {
        let budget = MonotonicClock.now() + Duration::from_millis(50);
        bus.begin_group_read(&question, budget).expect("a line");
        let answers = bus.finish_group_read(budget).expect("a line");
        assert!(answers.iter().all(Result::is_ok), "an answer is missing");
        let goal = &goal_bytes[..usize::from(goal_length)];
        let items: Vec<(u8, &[u8])> = goals.iter().map(|&id| (id, goal)).collect();
        bus.sync_write(protocol, goal_address, &items, budget).expect("a line");
    })
}

fn dynamixel2(path: &str, kind: &Kind, ids: &[u8]) -> Box<dyn FnMut()> {
    use dynamixel2::instructions::SyncWriteData;
    let ids = ids.to_vec();
    let mut bus = dynamixel2::Bus::open_with_buffers(path, LINE_BPS, vec![0; 1024], vec![0; 1024])
        .expect("the virtual line's port");
    let ((goal_address, _), (address, count)) = (kind.goal, kind.state);
    Box::new(move || {
        let states = bus.sync_read(&ids, address, count).expect("answers");
        assert_eq!(states.len(), ids.len(), "an answer is missing");
        let goals = ids.iter().map(|&motor_id| SyncWriteData { motor_id, data: 2048_u32 });
        let goals: Vec<_> = goals.collect();
        bus.sync_write_u32(goal_address, &goals).expect("a line");
    })
}

fn rustypot(path: &str, kind: &Kind, ids: &[u8]) -> Box<dyn FnMut()> {
    let ids = ids.to_vec();
    let mut port = serialport::new(path, LINE_BPS)
        .timeout(Duration::from_millis(50))
        .open()
        .expect("the virtual line's port");
    let protocol = match (kind.protocol, kind.read) {
        (Protocol::Dynamixel2, GroupRead::Fast) => {
            rustypot::DynamixelProtocolHandler::v2().with_fast_sync_read()
        }
        (Protocol::Dynamixel2, _) => rustypot::DynamixelProtocolHandler::v2(),
        _ => rustypot::DynamixelProtocolHandler::v1(),
    };
    let ((goal_address, goal_length), (address, length)) = (kind.goal, kind.state);
    let goal = 2048_u32.to_le_bytes()[..usize::from(goal_length)].to_vec();
    let goals: Vec<Vec<u8>> = ids.iter().map(|_| goal.clone()).collect();
    Box::new(move || {
        let states = protocol.sync_read(port.as_mut(), &ids, address as u8, length as u8);
        assert_eq!(states.expect("answers").len(), ids.len(), "an answer is missing");
        protocol.sync_write(port.as_mut(), &ids, goal_address as u8, &goals).expect("a line");
    })
}

/// The makers' SDK in Python, timed by itself in a process of its own.
fn sdk_cost(python: &Python, kind: &Kind, servos: u8) -> Option<Cost> {
    let door = virtual_line(kind, servos);
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/benches/cycle/dynamixel_sdk_cycle.py");
    let read = match kind.read {
        GroupRead::Sync => "sync",
        GroupRead::Fast => "fast",
        GroupRead::Bulk | GroupRead::FastBulk => "bulk",
    };
    let protocol = if kind.protocol == Protocol::Dynamixel1 { "1" } else { "2" };
    let numbers = [kind.goal.0, kind.goal.1, kind.state.0, kind.state.1].map(|n| n.to_string());
    let output = Command::new(&python.program)
        .arg(script)
        .arg(door.path())
        .args([&LINE_BPS.to_string(), protocol, read, &servos.to_string()])
        .args(&numbers)
        .args([WARM_UP.to_string(), CYCLES.to_string()])
        .output()
        .ok()?;
    let text = String::from_utf8_lossy(&output.stdout);
    let mut figures = text.split_whitespace().map(str::parse::<f64>);
    match (figures.next(), figures.next()) {
        (Some(Ok(mean_us)), Some(Ok(p99_us))) => Some(Cost { mean_us, p99_us }),
        _ => {
            // Its bulk read of Protocol 1.0 ends in a TypeError of its own.
            let words = String::from_utf8_lossy(&output.stderr);
            println!("DynamixelSDK fails: {}", words.lines().last().unwrap_or_default());
            None
        }
    }
}

/// Processor, cores and versions, so that the figures can be compared.
fn machine() -> String {
    let cpuinfo = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = cpuinfo.lines().find_map(|line| line.strip_prefix("model name")).unwrap_or("?");
    let cores = std::thread::available_parallelism().map_or(0, usize::from);
    format!(
        "processor{model}, {cores} cores; gaitway {}, dynamixel2 0.9.1, rustypot 1.13.1, \
         dynamixel-sdk 4.1.0 (Python)",
        env!("CARGO_PKG_VERSION")
    )
}
