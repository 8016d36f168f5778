//! What runs in the guest: the CAN port on virtual interfaces. vcan0 is up and carries FD, vcan1 is
//! up and classic, vcan2 is down.

#[path = "commands.rs"]
mod commands;
#[path = "dialects.rs"]
mod dialects;
#[path = "robot.rs"]
mod robot;
#[allow(dead_code)]
#[path = "../can_robot/robots.rs"]
mod robots;
#[path = "simulator.rs"]
mod simulator;
#[path = "slcan.rs"]
mod slcan;
#[path = "virtual_actuators.rs"]
mod virtual_actuators;

use gaitway::port::can::{CanInterface, Filter, interfaces, state};
use gaitway::port::{Clock as _, FramePort as _, Heard, MonotonicClock, PortError};
use gaitway::time::{Duration, Instant};
use gaitway::wire::can::{CanFrame, CanId, Format};
use socketcan::Socket as _;

/// Longer than the guest ever takes.
fn soon() -> Instant {
    MonotonicClock.now() + Duration::from_secs(5)
}

/// Long enough for what is already on its way.
fn in_a_moment() -> Instant {
    MonotonicClock.now() + Duration::from_millis(50)
}

fn open(name: &str) -> CanInterface {
    CanInterface::open(name).expect("an interface of the guest")
}

fn frame(id: Option<CanId>, format: Format, payload: &[u8]) -> CanFrame {
    CanFrame::new(id.expect("an id"), format, payload).expect("a frame")
}

fn heard(port: &mut CanInterface) -> CanFrame {
    match port.receive(soon()) {
        Ok(Heard::Frame(frame)) => frame,
        other => panic!("{other:?}"),
    }
}

const FAST: Format = Format::Fd { fast: true };
const SLOW: Format = Format::Fd { fast: false };

#[test]
#[ignore = "needs CAN interfaces"]
fn frames_of_every_format_arrive_as_they_were_sent() {
    let (mut here, mut there) = (open("vcan0"), open("vcan0"));
    for frame in [
        frame(CanId::standard(0), Format::Classic, &[]),
        frame(CanId::standard(0x7FF), Format::Classic, &[1, 2, 3, 4, 5, 6, 7, 8]),
        frame(CanId::extended(0x1FFF_FFFF), Format::Classic, &[0xFF]),
        frame(CanId::extended(1), Format::Classic, &[1]),
        frame(CanId::standard(0x29), Format::Remote { length: 8 }, &[]),
        frame(CanId::extended(0x8001), FAST, &[0x5A; 64]),
        frame(CanId::standard(1), SLOW, &[0xA5; 12]),
    ] {
        here.send(&frame, soon()).expect("sent");
        assert_eq!(heard(&mut there), frame);
    }
    assert_eq!(here.receive(in_a_moment()), Err(PortError::TimedOut), "nobody hears himself");
}

#[test]
#[ignore = "needs CAN interfaces"]
fn a_classic_interface_refuses_fd_frames_in_words_and_goes_on() {
    let (mut here, mut there) = (open("vcan1"), open("vcan1"));
    let refused = here.send(&frame(CanId::standard(1), FAST, &[0; 12]), soon());
    assert!(matches!(&refused, Err(PortError::Io(text)) if text.contains("vcan1")), "{refused:?}");
    let classic = frame(CanId::standard(1), Format::Classic, &[1]);
    here.send(&classic, soon()).expect("sent");
    assert_eq!(heard(&mut there), classic);
}

#[test]
#[ignore = "needs CAN interfaces"]
fn filters_let_through_what_they_name_and_nothing_else() {
    let (mut here, mut there) = (open("vcan0"), open("vcan0"));
    let id = |number| CanId::standard(number).expect("fits");
    let replies = Filter { id: id(0x10), mask: 0x7F0 };
    let motor = Filter { id: CanId::extended(0x0200_0000).expect("fits"), mask: 0x1F00_0000 };
    there.listen_to(&[replies, motor]).expect("filters");
    let payload = [7];
    let sent = [
        (CanId::standard(0x11), true),
        (CanId::standard(0x21), false),
        (CanId::extended(0x11), false), // the number of a standard one that is let through
        (CanId::extended(0x0200_7FFD), true),
        (CanId::extended(0x0300_7FFD), false),
        (CanId::standard(0x1F), true),
    ];
    for (id, _) in sent {
        here.send(&frame(id, Format::Classic, &payload), soon()).expect("sent");
    }
    for (id, _) in sent.iter().filter(|(_, passes)| *passes) {
        assert_eq!(Some(heard(&mut there).id()), *id);
    }
    assert_eq!(there.receive(in_a_moment()), Err(PortError::TimedOut));
}

#[test]
#[ignore = "needs CAN interfaces"]
fn reports_of_the_line_are_heard_between_frames() {
    let mut port = open("vcan0");
    port.listen_to(&[]).expect("filters"); // reports pass any filter
    let kernel = socketcan::CanSocket::open("vcan0").expect("a socket");
    let report = |classes: u32, bytes: [u8; 8]| {
        let frame = socketcan::CanErrorFrame::new_error(classes, &bytes).expect("a report");
        kernel.write_frame(&socketcan::CanFrame::from(frame)).expect("looped back");
    };
    report(0x60, [0; 8]);
    report(0x204, [0, 0x20, 0, 0, 0, 0, 130, 0]);
    report(0x100, [0; 8]);
    let mut next = || match port.receive(soon()) {
        Ok(Heard::Report(report)) => report,
        other => panic!("{other:?}"),
    };
    let first = next();
    assert!(first.bus_off() && first.no_ack(), "{first}");
    let second = next();
    assert!(second.passive() && !second.bus_off(), "{second}");
    assert_eq!(second.counters(), Some([130, 0]));
    assert!(next().recovered());
}

#[test]
#[ignore = "needs CAN interfaces"]
fn waiting_ends_at_the_deadline() {
    let mut port = open("vcan1");
    let deadline = MonotonicClock.now() + Duration::from_millis(20);
    assert_eq!(port.receive(deadline), Err(PortError::TimedOut));
    assert!(MonotonicClock.now() >= deadline);
}

#[test]
#[ignore = "needs CAN interfaces"]
fn an_interface_that_is_down_is_gone_and_says_so() {
    let mut port = open("vcan2");
    let frame = frame(CanId::standard(1), Format::Classic, &[1]);
    let sent = port.send(&frame, soon());
    assert!(matches!(&sent, Err(PortError::Gone(text)) if text.contains("down")), "{sent:?}");
}

#[test]
#[ignore = "needs CAN interfaces"]
fn interfaces_are_listed_with_their_state() {
    let names = interfaces();
    for name in ["vcan0", "vcan1", "vcan2"] {
        assert!(names.iter().any(|found| found == name), "{names:?}");
    }
    assert!(!names.iter().any(|name| name == "lo"));
    let vcan0 = state("vcan0").expect("a state");
    assert!(vcan0.up && vcan0.fd && vcan0.bitrate_bps.is_none() && vcan0.controller.is_none());
    let vcan1 = state("vcan1").expect("a state");
    assert!(vcan1.up && !vcan1.fd);
    assert!(!state("vcan2").expect("a state").up);
}

#[test]
#[ignore = "needs CAN interfaces"]
fn thousands_of_frames_in_a_row_are_neither_lost_nor_mixed_up() {
    let (mut here, mut there) = (open("vcan0"), open("vcan0"));
    let mut received = 0_u16;
    for k in 0..2000_u16 {
        let bytes = k.to_be_bytes();
        here.send(&frame(CanId::standard(1), Format::Classic, &bytes), soon()).expect("sent");
        if k % 50 == 49 {
            for _ in 0..50 {
                assert_eq!(heard(&mut there).payload(), received.to_be_bytes());
                received += 1;
            }
        }
    }
    assert_eq!(received, 2000);
}
