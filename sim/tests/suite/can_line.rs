//! Virtual actuators on a virtual CAN line, spoken to in bytes.

use gaitway_sim::can::{Actuator, CanFrame, CanHeard, CanLine, CanOptions};

const MS: u64 = 1_000_000;

fn line(actuators: &[(&str, u8)]) -> CanLine {
    let actuators = actuators.iter().map(|(model, id)| Actuator::new(model, *id).expect("known"));
    CanLine::new(CanOptions::default(), actuators.collect())
}

fn ask(line: &mut CanLine, frame: CanFrame) -> CanFrame {
    line.send(frame).expect("room");
    line.run_until_heard(line.now_ns() + 5 * MS);
    heard(line)
}

fn heard(line: &mut CanLine) -> CanFrame {
    match line.receive() {
        Some(CanHeard::Frame(frame)) => frame,
        other => panic!("no frame but {other:?}"),
    }
}

fn standard(id: u32, bytes: &[u8]) -> CanFrame {
    CanFrame::classic(id, false, bytes)
}

const ENABLE: [u8; 8] = [0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFC];
/// One radian, kp 50, kd 1, on the ranges of a DM4310 (12.5 rad).
const ONE_RADIAN: [u8; 8] = [0x8A, 0x3C, 0x7F, 0xF1, 0x99, 0x33, 0x37, 0xFF];

#[test]
fn answers_come_lowest_identifier_first_whoever_was_asked_first() {
    let mut line = line(&[("dm4310", 2), ("dm4310", 1)]);
    for id in [2, 1] {
        ask(&mut line, standard(0x7FF, &[id, 0, 0x55, 7, 0x10 + id, 0, 0, 0]));
    }
    // The host's own urgent frames hold the line until both have an answer ready.
    for (id, bytes) in [(2, ENABLE), (1, ENABLE), (0, [0; 8]), (0, [0; 8]), (0, [0; 8])] {
        line.send(standard(id, &bytes)).expect("room");
    }
    line.run_until(line.now_ns() + 5 * MS);
    let (first, second) = (heard(&mut line), heard(&mut line));
    assert_eq!((first.id, second.id), (0x11, 0x12));
    assert_eq!(first.bytes[0] >> 4, 1, "enabled");
}

#[test]
fn a_damiao_goes_where_spring_and_damper_pull_it() {
    let mut line = line(&[("dm4310", 1)]);
    ask(&mut line, standard(1, &ENABLE));
    for _ in 0..100 {
        ask(&mut line, standard(1, &ONE_RADIAN));
        line.run_until(line.now_ns() + 5 * MS);
    }
    let position = line.actuators()[0].position_rad();
    assert!((position - 1.0).abs() < 0.01, "{position}");
}

#[test]
fn a_disabled_actuator_answers_and_does_not_move() {
    let mut line = line(&[("ak80-9", 3), ("cybergear", 0x7F)]);
    let answer = ask(&mut line, standard(3, &ONE_RADIAN));
    assert_eq!((answer.id, answer.bytes[0]), (0, 3));
    assert_eq!(answer.bytes[1..3], [0x7F, 0xFF]);
    line.run_until(100 * MS);
    assert!(line.actuators()[0].position_rad().abs() < 1e-12);
}

#[test]
fn a_silent_host_makes_a_damiao_let_go_until_the_fault_is_cleared() {
    let mut line = line(&[("dm4310", 1)]);
    // 400 steps of 50 us: 20 ms.
    ask(&mut line, standard(0x7FF, &[1, 0, 0x55, 9, 0x90, 0x01, 0, 0]));
    ask(&mut line, standard(1, &ENABLE));
    line.run_until(line.now_ns() + 15 * MS);
    assert!(line.actuators()[0].enabled(), "not yet");
    line.run_until(line.now_ns() + 10 * MS);
    assert!(!line.actuators()[0].enabled());
    assert_eq!(ask(&mut line, standard(1, &ENABLE)).bytes[0], 0xD1, "enabling is no clearing");
    let clear = [0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFB];
    assert_eq!(ask(&mut line, standard(1, &clear)).bytes[0], 0x01);
    assert_eq!(ask(&mut line, standard(1, &ENABLE)).bytes[0], 0x11);
}

#[test]
fn a_cybergear_obeys_extended_frames_with_torque_in_the_identifier() {
    let mut line = line(&[("cybergear", 0x7F)]);
    let enabled = ask(&mut line, CanFrame::classic(0x0300_FD7F, true, &[0; 8]));
    assert_eq!(enabled.id, 0x0280_7FFD, "running, from 0x7F to 0xFD");
    // One radian on 4 pi, kp 50, kd 1, no torque.
    let go = [0x8A, 0x2F, 0x7F, 0xFF, 0x19, 0x99, 0x33, 0x33];
    for _ in 0..100 {
        ask(&mut line, CanFrame::classic(0x017F_FF7F, true, &go));
        line.run_until(line.now_ns() + 5 * MS);
    }
    let position = line.actuators()[0].position_rad();
    assert!((position - 1.0).abs() < 0.01, "{position}");
}
