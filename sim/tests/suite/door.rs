//! A real program's view: a terminal, bytes in, bytes out.

use crate::scene::{can_robot, crc16, dynamixels, hex, statuses, sync_write_goals, write};
use gaitway_sim::{Door, DoorError, Fault, Options, Rule, World};
use std::fs::{self, File, OpenOptions};
use std::io::{Read, Write};
use std::net::TcpStream;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

const PING_1: &str = "FF FF FD 00 01 03 00 01 19 4E";

fn world(line_timing: bool) -> Arc<Mutex<World>> {
    let options = Options { line_timing, ..Options::default() };
    Arc::new(Mutex::new(World::new(&dynamixels(&[1]), options).unwrap()))
}

fn open(path: &Path) -> File {
    OpenOptions::new().read(true).write(true).open(path).unwrap()
}

fn ask(port: &mut File, bytes: &[u8], count: usize) -> Vec<u8> {
    port.write_all(bytes).unwrap();
    let mut answer = vec![0; count];
    port.read_exact(&mut answer).unwrap();
    answer
}

/// A path for a link that is not there yet.
fn link(name: &str) -> PathBuf {
    let path = std::env::temp_dir().join(format!("gaitway-{}-{name}", std::process::id()));
    let _ = fs::remove_file(&path);
    path
}

#[test]
fn a_ping_through_the_door_is_answered() {
    for line_timing in [false, true] {
        let door = Door::open(world(line_timing), 0, None).unwrap();
        let mut port = open(door.path());
        for _ in 0..20 {
            let answer = statuses(&ask(&mut port, &hex(PING_1), 14));
            assert_eq!((answer[0].id, answer[0].params.len()), (1, 3));
        }
    }
}

#[test]
fn programs_come_and_go_while_the_door_stays_open() {
    let door = Door::open(world(false), 0, None).unwrap();
    for _ in 0..3 {
        let mut port = open(door.path());
        assert_eq!(ask(&mut port, &hex(PING_1), 14).len(), 14);
    }
}

#[test]
fn a_wrong_line_speed_is_not_understood() {
    let world = world(false);
    let door = Door::open(Arc::clone(&world), 0, None).unwrap();
    let mut port = open(door.path());
    let set_speed = |bps| {
        let mut settings = rustix::termios::tcgetattr(&port).unwrap();
        settings.set_speed(bps).unwrap();
        rustix::termios::tcsetattr(&port, rustix::termios::OptionalActions::Now, &settings)
            .unwrap();
    };
    set_speed(57_600);
    (&port).write_all(&hex(PING_1)).unwrap();
    // The line has carried a packet; nobody could read it.
    while world.lock().unwrap().verdict().instructions == 0 {
        std::thread::yield_now();
    }
    assert_eq!(world.lock().unwrap().verdict().statuses, 0);
    set_speed(1_000_000);
    let answer = ask(&mut port, &hex(PING_1), 14);
    assert_eq!(crc16(&answer[..12]).to_le_bytes(), answer[12..]);
    assert_eq!(world.lock().unwrap().verdict().statuses, 1);
}

#[test]
fn a_link_names_the_terminal_while_the_door_is_open() {
    let link = link("open");
    let door = Door::open(world(false), 0, Some(&link)).unwrap();
    assert_eq!(fs::read_link(&link).unwrap(), door.path());
    assert_eq!(ask(&mut open(&link), &hex(PING_1), 14).len(), 14);
    drop(door);
    assert!(fs::symlink_metadata(&link).is_err());
}

#[test]
fn a_dangling_link_is_replaced_and_anything_else_is_not() {
    let link = link("taken");
    symlink("/nonexistent/terminal", &link).unwrap();
    drop(Door::open(world(false), 0, Some(&link)).unwrap());

    fs::write(&link, "mine").unwrap();
    let refused = Door::open(world(false), 0, Some(&link)).err();
    assert!(matches!(refused, Some(DoorError::LinkTaken(path)) if path == link));
    assert_eq!(fs::read(&link).unwrap(), b"mine");
    fs::remove_file(&link).unwrap();

    symlink("/dev/null", &link).unwrap();
    assert!(matches!(
        Door::open(world(false), 0, Some(&link)).err(),
        Some(DoorError::LinkTaken(_))
    ));
    fs::remove_file(&link).unwrap();
}

/// A program behind the door that has put torque on at 2048, and waits for nothing else.
fn under_torque(world: &Arc<Mutex<World>>) -> (Door, File) {
    let door = Door::open(Arc::clone(world), 0, None).unwrap();
    let mut port = open(door.path());
    for _ in 0..2 {
        port.write_all(&sync_write_goals(&[(1, 2048)])).unwrap();
    }
    ask(&mut port, &write(1, 64, &[1]), 11);
    (door, port)
}

fn goals_arrive(world: &Mutex<World>, count: u64) {
    wait_until("the goals are there", || world.lock().unwrap().verdict().goals == count);
}

#[test]
fn a_goal_that_jumps_is_seen_through_the_door() {
    let world = world(true);
    let (_door, mut port) = under_torque(&world);
    // There and back, nearly a turn each: 1.2 s for the joint. That the door was awake in between
    // is known by the pings it answered.
    let goals = [4000, 100, 4000];
    for goal in goals {
        port.write_all(&sync_write_goals(&[(1, goal)])).unwrap();
        ask(&mut port, &hex(PING_1), 14);
    }
    let verdict = world.lock().unwrap().verdict();
    assert_eq!(verdict.goals, 2 + 3);
    assert_eq!((verdict.count(Rule::GoalStep), verdict.count(Rule::SpeedChange)), (3, 4));
}

#[test]
fn a_door_that_wakes_late_sees_no_step_that_was_none() {
    for late in [false, true] {
        let world = world(true);
        let (_door, mut port) = under_torque(&world);
        // Whoever holds the world keeps the door from its work, as a busy machine does.
        let held = late.then(|| world.lock().unwrap());
        // Half of the joint's speed: 16 counts are 24.5 mrad, and want 5.1 ms.
        for k in 1..=20 {
            std::thread::sleep(std::time::Duration::from_millis(10));
            port.write_all(&sync_write_goals(&[(1, 2048 + 16 * k)])).unwrap();
        }
        drop(held);
        goals_arrive(&world, 22);
        assert_eq!(world.lock().unwrap().verdict().count(Rule::GoalStep), 0, "late: {late}");
    }
}

#[test]
fn a_line_that_is_not_there_has_no_door() {
    assert!(matches!(Door::open(world(false), 1, None).err(), Some(DoorError::NoLine(1))));
}

fn world_with(faults: Vec<Fault>) -> Arc<Mutex<World>> {
    let options = Options { line_timing: false, faults, ..Options::default() };
    Arc::new(Mutex::new(World::new(&dynamixels(&[1]), options).unwrap()))
}

/// Waits until something is so; a machine may be slow, but not for ever.
fn wait_until(what: &str, is_so: impl Fn() -> bool) {
    let begin = std::time::Instant::now();
    while !is_so() {
        assert!(begin.elapsed().as_secs() < 10, "{what}");
        std::thread::sleep(std::time::Duration::from_millis(1));
    }
}

#[test]
fn what_one_program_left_unread_is_not_for_the_next() {
    let door = Door::open(world(false), 0, None).unwrap();
    for _ in 0..3 {
        let mut port = open(door.path());
        port.write_all(&hex(PING_1)).unwrap();
        wait_until("an answer", || rustix::io::ioctl_fionread(&port) == Ok(14));
        drop(port);
        wait_until("an empty buffer", || rustix::io::ioctl_fionread(open(door.path())) == Ok(0));
        let mut port = open(door.path());
        // A read of the model number: its status differs from a ping's.
        let answer = ask(&mut port, &crate::scene::read(1, 0, 2), 13);
        assert_eq!(statuses(&answer)[0].params.len(), 2);
    }
}

#[test]
fn one_program_at_a_time_talks_over_tcp() {
    let door = Door::open_tcp(world(false), 0, "127.0.0.1:0".parse().unwrap()).unwrap();
    let address = door.path().to_str().unwrap().strip_prefix("tcp:").unwrap().to_string();
    let ping = |port: &mut TcpStream| {
        port.write_all(&hex(PING_1)).unwrap();
        let mut answer = [0; 14];
        port.read_exact(&mut answer).map(|()| answer)
    };
    for _ in 0..3 {
        let mut first = TcpStream::connect(&address).unwrap();
        assert!(ping(&mut first).is_ok());
        let mut second = TcpStream::connect(&address).unwrap();
        assert_eq!(second.read(&mut [0; 1]).unwrap_or(0), 0, "the second is sent away");
        assert!(ping(&mut first).is_ok());
    }
}

#[test]
fn who_comes_right_after_another_over_tcp_is_not_sent_away() {
    let world = world(false);
    let door = Door::open_tcp(Arc::clone(&world), 0, "127.0.0.1:0".parse().unwrap()).unwrap();
    let address = door.path().to_str().unwrap().strip_prefix("tcp:").unwrap().to_string();
    for _ in 0..20 {
        // The door is busy while one program says something and goes, and the next comes.
        let busy = world.lock().unwrap();
        let mut first = TcpStream::connect(&address).unwrap();
        first.write_all(&hex(PING_1)).unwrap();
        drop(first);
        let mut second = TcpStream::connect(&address).unwrap();
        drop(busy);
        second.write_all(&crate::scene::read(1, 0, 2)).unwrap();
        let mut answer = [0; 13];
        second.read_exact(&mut answer).unwrap();
        assert_eq!(statuses(&answer)[0].params.len(), 2);
    }
}

#[test]
fn programs_that_come_at_once_are_told_apart() {
    let world = world(false);
    let door = Door::open(Arc::clone(&world), 0, None).unwrap();
    let mut stay = open(door.path());
    assert_eq!(ask(&mut stay, &hex(PING_1), 14).len(), 14);
    let busy = world.lock().unwrap();
    stay.write_all(&hex(PING_1)).unwrap();
    std::thread::sleep(std::time::Duration::from_millis(20));
    // The door has work and sees these together, later.
    let others = [(); 3].map(|()| open(door.path()));
    drop(busy);
    stay.read_exact(&mut [0; 14]).unwrap();
    for other in others {
        drop(other);
        stay.write_all(&hex(PING_1)).unwrap();
        wait_until("an answer", || rustix::io::ioctl_fionread(&stay) == Ok(14));
        stay.read_exact(&mut [0; 14]).unwrap();
    }
}

#[test]
fn a_hang_up_is_one_and_the_door_comes_back_under_another_name() {
    let (old, new) = (link("old"), link("new"));
    let hang_up = Fault::HangUp {
        line: None,
        at_ns: 100_000_000,
        until_ns: Some(200_000_000),
        link: Some(new.clone()),
    };
    let door = Door::open(world_with(vec![hang_up]), 0, Some(&old)).unwrap();
    let first = door.path().to_path_buf();
    let mut port = open(&old);
    // End of file or an error, not silence.
    assert_eq!(port.read(&mut [0; 1]).unwrap_or(0), 0);
    wait_until("plugged in", || door.current_path().is_some());
    let second = door.current_path().unwrap();
    assert_ne!(first, second);
    assert!(fs::symlink_metadata(&old).is_err());
    assert_eq!(fs::read_link(&new).unwrap(), second);
    assert_eq!(ask(&mut open(&new), &hex(PING_1), 14).len(), 14);
    drop(door);
    assert!(fs::symlink_metadata(&new).is_err());
}

#[test]
fn a_tcp_door_that_hung_up_sends_everyone_away() {
    let hang_up = Fault::HangUp { line: None, at_ns: 50_000_000, until_ns: None, link: None };
    let address = "127.0.0.1:0".parse().unwrap();
    let door = Door::open_tcp(world_with(vec![hang_up]), 0, address).unwrap();
    let address = door.path().to_str().unwrap().strip_prefix("tcp:").unwrap().to_string();
    let mut early = TcpStream::connect(&address).unwrap();
    assert_eq!(early.read(&mut [0; 1]).unwrap_or(0), 0);
    let mut late = TcpStream::connect(&address).unwrap();
    assert_eq!(late.read(&mut [0; 1]).unwrap_or(0), 0);
}

#[test]
fn a_blocked_line_lets_its_program_wait() {
    let until_ns = 300_000_000;
    let blocked = Fault::Blocked { line: None, from_ns: 0, until_ns, bytes: 0 };
    let world = world_with(vec![blocked]);
    let door = Door::open(Arc::clone(&world), 0, None).unwrap();
    let mut port = open(door.path());
    assert_eq!(ask(&mut port, &hex(PING_1), 14).len(), 14);
    assert!(world.lock().unwrap().now_ns() >= until_ns);
}

#[test]
fn the_usual_speeds_of_servo_lines_can_be_set() {
    for baud_bps in [9600, 57_600, 115_200, 1_000_000, 2_000_000, 3_000_000, 4_000_000] {
        let mut robot = dynamixels(&[1]);
        robot.lines[0].kind = gaitway_profiles::LineKind::Serial { baud_bps };
        let world = World::new(&robot, Options::default()).unwrap();
        let door = Door::open(Arc::new(Mutex::new(world)), 0, None).unwrap();
        let mut port = open(door.path());
        let mut settings = rustix::termios::tcgetattr(&port).unwrap();
        settings.set_speed(baud_bps).unwrap();
        rustix::termios::tcsetattr(&port, rustix::termios::OptionalActions::Now, &settings)
            .unwrap();
        rustix::termios::tcdrain(&port).unwrap();
        rustix::termios::tcflush(&port, rustix::termios::QueueSelector::IOFlush).unwrap();
        rustix::termios::tcsendbreak(&port).unwrap();
        assert_eq!(ask(&mut port, &hex(PING_1), 14).len(), 14, "{baud_bps}");
    }
}

/// The first line of the adapter that begins so.
fn line_that_begins(port: &mut File, wanted: &str) -> String {
    let mut line = String::new();
    loop {
        let mut byte = [0];
        port.read_exact(&mut byte).unwrap();
        match byte[0] {
            b'\r' if line.starts_with(wanted) => return line,
            b'\r' | 7 => line.clear(),
            other => line.push(char::from(other)),
        }
    }
}

#[test]
fn a_can_line_is_behind_an_adapter_that_speaks_slcan() {
    let world = World::new(&can_robot(&[("dm4310", 1)]), Options::default()).unwrap();
    let world = Arc::new(Mutex::new(world));
    let door = Door::open(Arc::clone(&world), 0, None).unwrap();
    for _ in 0..2 {
        let mut port = open(door.path());
        port.write_all(b"\rC\rS8\rO\rV\r").unwrap();
        assert_eq!(line_that_begins(&mut port, "V"), "V1013");
        port.write_all(b"t0018FFFFFFFFFFFFFFFC\r").unwrap();
        // Under its answer_id, enabled, at zero.
        assert!(line_that_begins(&mut port, "t0118").starts_with("t0118117FFF7FF7FF"));
        port.write_all(b"C\r").unwrap();
        line_that_begins(&mut port, "");
    }
    assert!(world.lock().unwrap().actuator("j1").unwrap().enabled());
}

#[test]
fn an_adapter_tells_of_bus_off() {
    let fault = Fault::BusOff { line: None, at_ns: 0, until_ns: None };
    let options = Options { faults: vec![fault], ..Options::default() };
    let world = World::new(&can_robot(&[("dm4310", 1)]), options).unwrap();
    let door = Door::open(Arc::new(Mutex::new(world)), 0, None).unwrap();
    let mut port = open(door.path());
    // It has left the line before anybody asked; the flags tell, and frames are refused.
    port.write_all(b"S8\rO\rV\r").unwrap();
    line_that_begins(&mut port, "V");
    port.write_all(b"F\r").unwrap();
    assert!(["F00", "FA4"].contains(&line_that_begins(&mut port, "F").as_str()));
    port.write_all(b"t0010\rF\r").unwrap();
    assert_eq!(line_that_begins(&mut port, "F"), "FA4");
}

#[test]
fn the_adapter_of_a_can_line_can_be_reached_over_tcp() {
    let world = World::new(&can_robot(&[("ak80-9", 3)]), Options::default()).unwrap();
    let door = Door::open_tcp(Arc::new(Mutex::new(world)), 0, ([127, 0, 0, 1], 0).into()).unwrap();
    let path = door.path().display().to_string();
    let mut port = TcpStream::connect(&path["tcp:".len()..]).unwrap();
    port.write_all(b"S8\rO\rt0038FFFFFFFFFFFFFFFC\r").unwrap();
    // Two acknowledgements, the frame is taken, and the answer is that of actuator 3.
    let mut answer = [0; 4 + 9];
    port.read_exact(&mut answer).unwrap();
    assert_eq!(&answer[..11], b"\r\rz\rt000803");
}
