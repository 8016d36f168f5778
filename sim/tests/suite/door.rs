//! A real program's view: a terminal, bytes in, bytes out.

use crate::scene::{crc16, dynamixels, hex, statuses};
use gaitway_sim::{Door, DoorError, Options, World};
use std::fs::{self, File, OpenOptions};
use std::io::{Read, Write};
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

#[test]
fn a_line_that_is_not_there_has_no_door() {
    assert!(matches!(Door::open(world(false), 1, None).err(), Some(DoorError::NoLine(1))));
}
