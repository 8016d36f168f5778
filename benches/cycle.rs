//! What one control cycle costs beside the wire: sync write of 20 goals and sync read of 20
//! states, over a pseudo-terminal whose bytes take no time, for three drivers in one run.
//!
//! The time of a cycle is host time plus the virtual robot's own, the same for all. The share of
//! the wire limit is wire / (wire + host) with the wire time of the cycle's bytes at that speed.
//!
//! Run: `cargo bench --bench cycle`

use gaitway::bus::GroupRead;
use gaitway::guard::Guard;
use gaitway::port::serial::SerialLine;
use gaitway::port::{BytePort, Clock, MonotonicClock};
use gaitway::robot::{Link, Robot};
use gaitway::time::Duration;
use gaitway_sim::{Door, Options, World};
use std::sync::{Arc, Mutex};
use std::time::Instant;

const CYCLES: u32 = 3_000;
const WARM_UP: u32 = 200;
const GOAL_ADDRESS: u16 = 116;
const STATE_ADDRESS: u16 = 126;
const STATE_BYTES: u16 = 10;

fn main() {
    println!("{}", machine());
    println!("20 x XM430-W350, sync write (4 bytes) + read (10 bytes), {CYCLES} cycles each\n");
    let robot = Robot::load("op3").expect("op3 ships with gaitway");
    let ids: Vec<u8> = robot.joints.iter().map(|joint| joint.id).collect();
    let rows = [
        ("gaitway, sync read", time_of(|path| gaitway(path, GroupRead::Sync))),
        ("gaitway, fast sync read", time_of(|path| gaitway(path, GroupRead::Fast))),
        ("dynamixel2 0.9.1, sync read", time_of(|path| dynamixel2(path, &ids))),
        ("rustypot 1.13.1, sync read", time_of(|path| rustypot(path, &ids, false))),
        ("rustypot 1.13.1, fast sync read", time_of(|path| rustypot(path, &ids, true))),
    ];
    let ours = rows[0].1.0;
    println!(
        "{:<32} {:>9} {:>9} {:>9} | {:>27}",
        "driver", "us/cycle", "p99, us", "ratio", "share of wire limit at"
    );
    println!("{:<32} {:>9} {:>9} {:>9} | {:>8} {:>8} {:>8}", "", "", "", "", "1 M", "2 M", "4 M");
    for (name, (mean_us, p99_us)) in rows {
        let fast = name.contains("fast");
        let share = |mbps: f64| {
            let wire_us = wire_us(fast, mbps);
            100.0 * wire_us / (wire_us + mean_us)
        };
        println!(
            "{name:<32} {mean_us:>9.1} {p99_us:>9.1} {:>9.2} | {:>6.1} % {:>6.1} % {:>6.1} %",
            mean_us / ours,
            share(1.0),
            share(2.0),
            share(4.0)
        );
    }
}

/// Line time of the cycle's bytes, us: protocol overheads of the e-Manual, return delay 2 us each.
fn wire_us(fast: bool, mbps: f64) -> f64 {
    let n = 20.0;
    let write = 14.0 + 5.0 * n;
    let request = 14.0 + n;
    let (answer, delays) =
        if fast { (8.0 + n * (10.0 + 4.0), 2.0) } else { (n * (11.0 + 10.0), 2.0 * n) };
    (write + request + answer) * 10.0 / mbps + delays
}

/// Mean and 99th percentile of a cycle, us. `open` gets the path of a fresh virtual robot and
/// returns a cycle.
fn time_of(open: impl FnOnce(&str) -> Box<dyn FnMut()>) -> (f64, f64) {
    let robot = gaitway_profiles::robot("op3").expect("op3 ships with gaitway");
    let options = Options { line_timing: false, ..Options::default() };
    let world = World::new(&robot, options).expect("a virtual op3");
    let door = Door::open(Arc::new(Mutex::new(world)), 0, None).expect("a pseudo-terminal");
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
    let mean = times_us.iter().sum::<f64>() / times_us.len() as f64;
    times_us.sort_by(f64::total_cmp);
    (mean, times_us[times_us.len() * 99 / 100])
}

fn gaitway(path: &str, mode: GroupRead) -> Box<dyn FnMut()> {
    let robot = Robot::load("op3").expect("op3 ships with gaitway");
    let firmware = if mode == GroupRead::Fast { 45 } else { 0 };
    let port = SerialLine::open(path, 2_000_000).expect("the virtual robot's port");
    // As patient as the others: 34 ms is what the makers' SDK grants.
    let ports = vec![(Box::new(port) as Box<dyn BytePort>, Duration::from_millis(34))];
    let clock = Arc::new(MonotonicClock);
    let mut link = Link::new(robot, ports, clock.clone());
    link.plan_reads(&[firmware; 20], Duration::from_millis(10));
    let budget = || clock.now() + Duration::from_millis(50);
    let start: Vec<f64> = link
        .states(budget())
        .expect("a line")
        .into_iter()
        .map(|state| state.expect("an answer").0.position_rad)
        .collect();
    let guard = Guard::standing_at(&start, link.robot().limits(), clock.now());
    let (_, command) = guard.expect("a start pose inside the limits");
    Box::new(move || {
        let budget = MonotonicClock.now() + Duration::from_millis(50);
        let states = link.states(budget).expect("a line");
        assert!(states.iter().all(Result::is_ok), "an answer is missing");
        link.write_goals(&command, budget).expect("a line");
    })
}

fn dynamixel2(path: &str, ids: &[u8]) -> Box<dyn FnMut()> {
    use dynamixel2::instructions::SyncWriteData;
    let ids = ids.to_vec();
    let mut bus = dynamixel2::Bus::open_with_buffers(path, 2_000_000, vec![0; 1024], vec![0; 1024])
        .expect("the virtual robot's port");
    Box::new(move || {
        let states = bus.sync_read(&ids, STATE_ADDRESS, STATE_BYTES).expect("answers");
        assert_eq!(states.len(), ids.len(), "an answer is missing");
        let goals = ids.iter().map(|&motor_id| SyncWriteData { motor_id, data: 2048_u32 });
        let goals: Vec<_> = goals.collect();
        bus.sync_write_u32(GOAL_ADDRESS, &goals).expect("a line");
    })
}

fn rustypot(path: &str, ids: &[u8], fast: bool) -> Box<dyn FnMut()> {
    let ids = ids.to_vec();
    let mut port = serialport::new(path, 2_000_000)
        .timeout(Duration::from_millis(50))
        .open()
        .expect("the virtual robot's port");
    let protocol = rustypot::DynamixelProtocolHandler::v2();
    let protocol = if fast { protocol.with_fast_sync_read() } else { protocol };
    let goals: Vec<Vec<u8>> = ids.iter().map(|_| 2048_u32.to_le_bytes().to_vec()).collect();
    Box::new(move || {
        let (address, bytes) = (STATE_ADDRESS as u8, STATE_BYTES as u8);
        let states = protocol.sync_read(port.as_mut(), &ids, address, bytes).expect("answers");
        assert_eq!(states.len(), ids.len(), "an answer is missing");
        protocol.sync_write(port.as_mut(), &ids, GOAL_ADDRESS as u8, &goals).expect("a line");
    })
}

/// Processor, cores and versions, so that the figures can be compared.
fn machine() -> String {
    let cpuinfo = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = cpuinfo.lines().find_map(|line| line.strip_prefix("model name")).unwrap_or("?");
    let cores = std::thread::available_parallelism().map_or(0, usize::from);
    format!(
        "processor{model}, {cores} cores; gaitway {}, dynamixel2 0.9.1, rustypot 1.13.1",
        env!("CARGO_PKG_VERSION")
    )
}
