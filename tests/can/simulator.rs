//! The doors of virtual CAN lines on a real kernel: an interface of the system, and the kernel's own
//! driver for slcan adapters behind a pseudo-terminal.

use super::{FAST, frame, heard, open, soon};
use gaitway::port::can::{CanInterface, Controller, state};
use gaitway::port::can_bridge::CanBridge;
use gaitway::port::{FramePort as _, Heard};
use gaitway::wire::can::{CanFrame, CanId, Format};
use gaitway_sim::{Door, Options, World};
use std::process::{Command, Stdio};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

const ENABLE: [u8; 8] = [0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFC];

/// A Damiao, a CubeMars, an ODrive and a moteus, each on a line of its own, in this order.
fn world() -> Arc<Mutex<World>> {
    let text = include_str!("../can_door/four-families.toml");
    let robot = gaitway_profiles::parse_robot("four-families.toml", text).expect("a robot");
    Arc::new(Mutex::new(World::new(&robot, Options::default()).expect("a world")))
}

fn standard(number: u32, payload: &[u8]) -> CanFrame {
    frame(CanId::standard(number), Format::Classic, payload)
}

#[test]
#[ignore = "needs CAN interfaces"]
fn a_virtual_line_on_an_interface_answers_every_program_there() {
    let world = world();
    let bridge = CanBridge::open(Arc::clone(&world), 0, "vcan0").expect("a bridge");
    let mut port = open("vcan0");
    port.send(&standard(1, &ENABLE), soon()).expect("sent");
    let answer = heard(&mut port);
    assert_eq!(Some(answer.id()), CanId::standard(0x11));
    assert_eq!(answer.payload()[..3], [0x11, 0x7F, 0xFF]);
    assert!(world.lock().expect("a world").actuator("damiao_joint").expect("there").enabled());
    drop(bridge);

    let _bridge = CanBridge::open(world, 3, "vcan0").expect("a bridge");
    // Mode and position, as int16, of moteus 7.
    let question = frame(CanId::extended(0x8007), FAST, &[0x16, 0x00, 0x50, 0x50]);
    port.send(&question, soon()).expect("sent");
    let answer = heard(&mut port);
    assert_eq!(answer.format(), FAST);
    assert_eq!(answer.payload()[..6], [0x26, 0x00, 0, 0, 0, 0]);
}

#[test]
#[ignore = "needs CAN interfaces"]
fn a_bridge_to_nowhere_is_refused() {
    assert!(CanBridge::open(world(), 0, "nocan7").is_err());
    assert!(CanBridge::open(world(), 9, "vcan0").is_err(), "no such line");
}

/// The kernel's interface `name` on an adapter at this terminal, at 1 Mbit/s.
fn attach(door: &Door, name: &str) -> std::process::Child {
    let daemon = Command::new("slcand")
        .args(["-F", "-S", "1000000"])
        .arg(door.path())
        .arg(name)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .expect("slcand");
    let end = Instant::now() + Duration::from_secs(10);
    let interface = loop {
        match socketcan::CanInterface::open(name) {
            Ok(interface) => break interface,
            Err(error) => assert!(Instant::now() < end, "{name}: {error}"),
        }
        std::thread::yield_now();
    };
    interface.set_bitrate(1_000_000, None).expect("a bit rate");
    interface.bring_up().expect("up");
    daemon
}

#[test]
#[ignore = "needs CAN interfaces"]
fn the_kernels_slcan_driver_finds_an_adapter_with_virtual_actuators() {
    let world = world();
    let door = Door::open(Arc::clone(&world), 0, None).expect("a terminal");
    let mut daemon = attach(&door, "slcan1");
    let mut port = CanInterface::open("slcan1").expect("open");
    port.send(&standard(1, &ENABLE), soon()).expect("sent");
    let answer = heard(&mut port);
    assert_eq!(Some(answer.id()), CanId::standard(0x11));
    // An order to one who is not there, and then one more: nobody is confused.
    port.send(&standard(2, &ENABLE), soon()).expect("sent");
    let request = [1, 0, 0x33, 21, 0, 0, 0, 0];
    port.send(&standard(0x7FF, &request), soon()).expect("sent");
    assert_eq!(heard(&mut port).payload(), [1, 0, 0x33, 21, 0, 0, 0x48, 0x41], "12.5");

    world.lock().expect("a world").can_line_mut(0).expect("CAN").set_bus_off(true);
    match port.receive(soon()) {
        Ok(Heard::Report(report)) => assert!(report.bus_off(), "{report}"),
        other => panic!("{other:?}"),
    }
    assert_eq!(state("slcan1").expect("a state").controller, Some(Controller::BusOff));
    let _ = daemon.kill();
    let _ = daemon.wait();
}
