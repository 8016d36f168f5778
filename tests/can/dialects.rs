//! Every dialect exchanged with a device on the line. The device knows bytes only: what it expects
//! and what it answers was worked out from the makers' documents, not by the code under test.

use super::{FAST, frame, heard, open, soon};
use gaitway::port::FramePort as _;
use gaitway::wire::can::{CanFrame, CanId, Faults, Format, Number};
use gaitway::wire::can::{cubemars, damiao, moteus, odrive, recoil, robstride};
use std::thread::{JoinHandle, spawn};

/// A device that expects these frames in turn and answers each.
fn device(interface: &'static str, exchanges: Vec<(CanFrame, CanFrame)>) -> JoinHandle<()> {
    let mut port = open(interface);
    spawn(move || {
        for (expected, answer) in exchanges {
            assert_eq!(heard(&mut port), expected);
            port.send(&answer, soon()).expect("answered");
        }
    })
}

fn standard(id: u32, payload: &[u8]) -> CanFrame {
    frame(CanId::standard(id), Format::Classic, payload)
}

fn extended(id: u32, payload: &[u8]) -> CanFrame {
    frame(CanId::extended(id), Format::Classic, payload)
}

/// Sends and returns the answer.
fn ask(interface: &str, exchanges: Vec<(CanFrame, CanFrame)>, asked: &[CanFrame]) -> Vec<CanFrame> {
    assert_eq!(exchanges.len(), asked.len());
    let mut port = open(interface);
    let name = if interface == "vcan0" { "vcan0" } else { "vcan1" };
    let device = device(name, exchanges);
    let answers = asked
        .iter()
        .map(|frame| {
            port.send(frame, soon()).expect("sent");
            heard(&mut port)
        })
        .collect();
    device.join().expect("the device heard what it expected");
    answers
}

#[test]
#[ignore = "needs CAN interfaces"]
fn cubemars_in_mit_mode_is_enabled_and_follows() {
    let id = cubemars::Id::new(3).expect("an id");
    let to_one_radian = cubemars::Setpoint {
        position: 0x8A3C,
        velocity: 0x7FF,
        kp: 0x199,
        kd: 0x333,
        torque: 0x7FF,
    };
    let reply = standard(0, &[0x03, 0x8A, 0x3C, 0x7F, 0xF7, 0xFF, 0x23, 0x00]);
    let short = standard(0, &[0x03, 0x7F, 0xFF, 0x7F, 0xF7, 0xFF]);
    let enable = standard(3, &[0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFC]);
    let go = standard(3, &[0x8A, 0x3C, 0x7F, 0xF1, 0x99, 0x33, 0x37, 0xFF]);
    let answers = ask(
        "vcan1",
        vec![(enable, short), (go, reply)],
        &[
            cubemars::mit_command(id, cubemars::MitCommand::Enable),
            cubemars::mit_command(id, cubemars::MitCommand::Setpoint(to_one_radian)),
        ],
    );
    let replies: Vec<_> = answers.iter().filter_map(cubemars::mit_reply).collect();
    assert_eq!(replies.len(), 2, "a short reply is one too");
    assert_eq!(replies[0].1.temperature, None);
    assert_eq!(replies[1].0, id);
    assert_eq!(replies[1].1.position, Some(Number::Code { code: 0x8A3C, bits: 16 }));
}

#[test]
#[ignore = "needs CAN interfaces"]
fn cubemars_in_servo_mode_goes_to_ninety_degrees() {
    let id = cubemars::Id::new(1).expect("an id");
    let status = [0x03, 0x84, 0x00, 0x64, 0x00, 0x32, 0x23, 0x00];
    let go = (extended(0x0401, &[0x00, 0x0D, 0xBB, 0xA0]), extended(0x2901, &status));
    let command = cubemars::servo_command(id, cubemars::ServoCommand::Position(900_000));
    let answers = ask("vcan1", vec![go], &[command]);
    let (whose, feedback) = cubemars::servo_feedback(&answers[0]).expect("feedback");
    assert_eq!((whose, feedback.position), (id, Some(Number::Steps(900))));
}

#[test]
#[ignore = "needs CAN interfaces"]
fn damiao_tells_its_range_and_its_state() {
    let id = damiao::Id::new(1).expect("an id");
    let exchanges = vec![
        (
            standard(0x7FF, &[0x01, 0x00, 0x33, 0x15, 0, 0, 0, 0]),
            standard(0x11, &[0x01, 0x00, 0x33, 0x15, 0x00, 0x00, 0x48, 0x41]),
        ),
        (
            standard(0x101, &[0, 0, 0x80, 0x3F, 0, 0, 0, 0x40]),
            standard(0x11, &[0x11, 0x8A, 0x3C, 0x7F, 0xF7, 0xFF, 0x23, 0x1E]),
        ),
        (
            standard(0x7FF, &[0x01, 0x00, 0xCC, 0x00, 0, 0, 0, 0]),
            standard(0x11, &[0xD1, 0x7F, 0xFF, 0x7F, 0xF7, 0xFF, 0x23, 0x1E]),
        ),
    ];
    let go = damiao::Command::PositionVelocity { position: 1.0, speed: 2.0 };
    let asked = [
        damiao::request(id, damiao::Request::Read(damiao::register::PMAX)),
        damiao::command(id, go),
        damiao::request(id, damiao::Request::Feedback),
    ];
    let answers = ask("vcan1", exchanges, &asked);
    let range = damiao::register_value(id, 0x11, damiao::register::PMAX, &answers[0]);
    assert_eq!(range.map(f32::from_bits), Some(12.5));
    let feedback = damiao::feedback(id, 0x11, &answers[1]).expect("feedback");
    assert_eq!((feedback.enabled, feedback.faults), (Some(true), Faults::NONE));
    let feedback = damiao::feedback(id, 0x11, &answers[2]).expect("feedback");
    assert_eq!((feedback.enabled, feedback.faults), (Some(false), Faults::SILENCE));
}

#[test]
#[ignore = "needs CAN interfaces"]
fn cybergear_is_enabled_and_tells_its_position() {
    use robstride::{Command, Message, parameter};
    let [host, id] = [0xFD, 0x7F].map(|number| robstride::Id::new(number).expect("an id"));
    let feedback = [0x7F, 0xFE, 0x80, 0x73, 0x7F, 0xFF, 0x01, 0x18];
    let position = [0x19, 0x70, 0, 0, 0, 0, 0x80, 0x3F];
    let exchanges = vec![
        (extended(0x0300_FD7F, &[0; 8]), extended(0x0280_7FFD, &feedback)),
        (extended(0x1100_FD7F, &[0x19, 0x70, 0, 0, 0, 0, 0, 0]), extended(0x1100_7FFD, &position)),
    ];
    let asked = [
        robstride::command(host, id, Command::Enable),
        robstride::command(host, id, Command::Read(parameter::POSITION)),
    ];
    let answers = ask("vcan1", exchanges, &asked);
    let Some((whose, Message::Feedback(feedback))) = robstride::message(&answers[0]) else {
        panic!("feedback");
    };
    assert_eq!((whose, feedback.enabled), (id, Some(true)));
    let expected = Message::Parameter(parameter::POSITION, 1.0_f32.to_bits());
    assert_eq!(robstride::message(&answers[1]), Some((id, expected)));
}

#[test]
#[ignore = "needs CAN interfaces"]
fn odrive_answers_a_remote_request() {
    let id = odrive::Id::new(1).expect("an id");
    let request = frame(CanId::standard(0x29), Format::Remote { length: 8 }, &[]);
    let exchanges = vec![
        (standard(0x27, &[8, 0, 0, 0]), standard(0x21, &[0, 0, 0, 0, 8, 0, 0, 0])),
        (request, standard(0x29, &[0, 0, 0x80, 0xBE, 0, 0, 0, 0x40])),
    ];
    let asked = [
        odrive::command(id, odrive::Command::State(odrive::STATE_CLOSED_LOOP)),
        odrive::request(id, odrive::Request::Estimates),
    ];
    let answers = ask("vcan1", exchanges, &asked);
    let beat = odrive::Message::Heartbeat { error: 0, state: 8 };
    assert_eq!(odrive::message(&answers[0]), Some((id, beat)));
    let Some((_, odrive::Message::Feedback(feedback))) = odrive::message(&answers[1]) else {
        panic!("estimates");
    };
    assert_eq!(feedback.position, Some(Number::Value(-0.25)));
}

#[test]
#[ignore = "needs CAN interfaces"]
fn moteus_answers_over_fd_with_an_extended_identifier() {
    use moteus::{MODE_POSITION, Resolution, Values, register};
    let [host, id] = [0, 1].map(|number| moteus::Id::new(number).expect("an id"));
    let mut message = moteus::Message::default();
    message.write(register::MODE, Values::Int8(&[MODE_POSITION])).expect("fits");
    message.write(register::COMMAND, Values::Int16(&[0x60, 0x120, -176])).expect("fits");
    message.read(Resolution::Int16, register::MODE, 4).expect("fits");
    message.read(Resolution::Int8, 0x00D, 3).expect("fits");
    let route = moteus::Route { source: host, destination: id, reply: true, fast: true };
    let expected = [
        0x01, 0x00, 0x0A, 0x07, 0x20, 0x60, 0x00, 0x20, 0x01, 0x50, 0xFF, 0x14, 0x04, 0x00, 0x13,
        0x0D,
    ];
    let reply = [
        0x24, 0x04, 0x00, 0x0A, 0x00, 0x50, 0x00, 0x00, 0x01, 0x70, 0xFF, 0x23, 0x0D, 0x18, 0x14,
        0x00,
    ];
    let exchange = (
        frame(CanId::extended(0x8001), FAST, &expected),
        frame(CanId::standard(0x100), FAST, &reply),
    );
    let answers = ask("vcan0", vec![exchange], &[message.frame(route)]);
    let feedback = moteus::feedback(id, &answers[0]).expect("feedback");
    assert_eq!(feedback.position, Some(Number::Steps(0x50)));
    assert_eq!(feedback.enabled, Some(true));
}

#[test]
#[ignore = "needs CAN interfaces"]
fn recoil_answers_a_goal_with_its_state_and_a_read_with_a_value() {
    use recoil::{Command, Message, command, parameter};
    let id = recoil::Id::new(11).expect("an id");
    // One radian at -2 rad/s; it stands at -0.25 rad and turns at 2 rad/s. The watchdog: 1000 ms.
    let goal = standard(0x30B, &[0, 0, 0x80, 0x3F, 0, 0, 0, 0xC0]);
    let state = standard(0x28B, &[0, 0, 0x80, 0xBE, 0, 0, 0, 0x40]);
    let read = standard(0x60B, &[0x40, 0x08, 0x00]);
    let value = standard(0x58B, &[0xE8, 0x03, 0, 0]);
    let asked = [
        command(id, Command::PositionVelocity(1.0, -2.0)),
        command(id, Command::Read(parameter::WATCHDOG)),
    ];
    let answers = ask("vcan1", vec![(goal, state), (read, value)], &asked);
    let Some((whose, Message::Feedback(feedback))) = recoil::message(&answers[0]) else {
        panic!("feedback");
    };
    assert_eq!((whose, feedback.position), (id, Some(Number::Value(-0.25))));
    assert_eq!(recoil::message(&answers[1]), Some((id, Message::Parameter(1000))));
}
