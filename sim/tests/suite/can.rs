//! CAN lines in a world: they share its clock, its faults and its referee.

use crate::scene::{can_robot, dynamixels, instruction};
use gaitway_profiles::Robot;
use gaitway_sim::can::{CanFrame, CanHeard, Kind, QueueFull, Trouble};
use gaitway_sim::{Damage, Fault, Options, Rule, SimError, World};

const MS: u64 = 1_000_000;
const ENABLE: [u8; 8] = [0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFC];
const CLEAR: [u8; 8] = [0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFB];

struct Host {
    world: World,
}

impl Host {
    fn new(actuators: &[(&str, u8)]) -> Host {
        Host::with(&can_robot(actuators), Vec::new())
    }

    fn with(robot: &Robot, faults: Vec<Fault>) -> Host {
        Host {
            world: World::new(robot, Options { faults, ..Options::default() }).expect("a world"),
        }
    }

    fn send(&mut self, id: u32, bytes: &[u8]) {
        self.world.can_send(0, CanFrame::classic(id, false, bytes)).expect("room");
    }

    fn hear(&mut self) -> Option<CanHeard> {
        let until_ns = self.world.now_ns() + 5 * MS;
        self.world.can_receive(0, until_ns)
    }

    fn ask(&mut self, id: u32, bytes: &[u8]) -> CanFrame {
        self.send(id, bytes);
        match self.hear() {
            Some(CanHeard::Frame(frame)) => frame,
            other => panic!("no answer but {other:?}"),
        }
    }

    fn wait_ms(&mut self, ms: u64) {
        self.world.run_until(self.world.now_ns() + ms * MS);
    }
}

/// A Damiao's mode 1, kp 50 and kd 1 on the ranges of a DM4310 (12.5 rad, 500, 5).
fn mit(position_rad: f64) -> [u8; 8] {
    let [high, low] = (((position_rad + 12.5) * 65_535.0 / 25.0) as u16).to_be_bytes();
    [high, low, 0x7F, 0xF1, 0x99, 0x33, 0x37, 0xFF]
}

#[test]
fn a_worlds_can_line_answers_and_moves_its_joint() {
    let mut host = Host::new(&[("dm4310", 1)]);
    assert!(host.world.is_can(0));
    assert_eq!(host.ask(1, &ENABLE).id, 0x11, "the robot file's answer_id");
    for _ in 0..100 {
        host.ask(1, &mit(0.005));
        host.wait_ms(5);
    }
    let position = host.world.joint_position_rad("j1").expect("a joint");
    assert!((position - 0.005).abs() < 1e-3, "{position}");
    assert!(host.world.verdict().line_load[0] > 0.01);
}

#[test]
fn joints_stand_in_their_initial_pose_with_direction_gear_and_offset() {
    let mut robot = can_robot(&[("dm4310", 1)]);
    let joint = &mut robot.joints[0];
    (joint.initial, joint.offset_rad, joint.direction, joint.gear) = (Some(0.4), 0.1, -1, 0.5);
    let mut host = Host::with(&robot, Vec::new());
    assert!((host.world.joint_position_rad("j1").expect("a joint") - 0.4).abs() < 1e-12);
    // joint = direction x gear x actuator - offset: the actuator is at -1.
    let answer = host.ask(0x7FF, &[1, 0, 0xCC, 0, 0, 0, 0, 0]);
    let code = u16::from_be_bytes([answer.bytes[1], answer.bytes[2]]);
    assert_eq!(code, ((12.5 - 1.0) * 65_535.0 / 25.0) as u16);
    assert!(host.world.place_joint("j1", -0.2));
    assert!((host.world.joint_position_rad("j1").expect("a joint") + 0.2).abs() < 1e-12);
}

#[test]
fn serial_and_can_lines_share_the_clock() {
    let mut robot = dynamixels(&[1]);
    let mut can = can_robot(&[("dm4310", 1)]);
    can.lines[0].name = "legs".to_string();
    can.joints[0].line = "legs".to_string();
    robot.lines.append(&mut can.lines);
    robot.joints.append(&mut can.joints);
    let mut host = Host::with(&robot, Vec::new());
    assert_eq!((host.world.is_can(0), host.world.is_can(1)), (false, true));
    host.world.transmit(0, &instruction(1, 1, &[]), 1_000_000);
    host.world.can_send(1, CanFrame::classic(1, false, &ENABLE)).expect("room");
    // 10 bytes take 100 us; the frame of 8 bytes at least 111, and its answer comes 100 us later.
    let mut answer = [0; 64];
    assert_eq!(host.world.receive(0, &mut answer, 5 * MS), 14);
    let serial_ns = host.world.now_ns();
    assert!(matches!(host.world.can_receive(1, 5 * MS), Some(CanHeard::Frame(_))));
    assert!((300_000..350_000).contains(&host.world.now_ns()), "{}", host.world.now_ns());
    assert!(serial_ns < host.world.now_ns());
}

#[test]
fn without_line_timing_only_the_actuator_takes_its_time() {
    let options = Options { line_timing: false, ..Options::default() };
    let world = World::new(&can_robot(&[("dm4310", 1)]), options).expect("a world");
    let mut host = Host { world };
    host.ask(1, &ENABLE);
    assert_eq!(host.world.now_ns(), 100_000);
}

#[test]
fn goals_beyond_limits_or_too_fast_are_seen() {
    let mut host = Host::new(&[("dm4310", 1)]);
    host.ask(1, &ENABLE);
    host.ask(1, &mit(0.0));
    host.ask(1, &mit(0.0));
    assert!(host.world.verdict().is_clean(), "{:?}", host.world.verdict());
    host.wait_ms(5);
    host.ask(1, &mit(2.5));
    let rules: Vec<Rule> = host.world.verdict().violations.iter().map(|v| v.rule).collect();
    let abrupt = Rule::SpeedChange;
    assert_eq!(
        rules,
        [Rule::GoalInsideLimits, Rule::GoalStep, abrupt, Rule::RestAtEnds, abrupt],
        "too fast, and no rest at the end"
    );
    assert_eq!(host.world.verdict().goals, 3);
}

#[test]
fn a_host_that_drives_on_a_blocked_actuator_is_seen() {
    // 20 mrad in 10 ms: the 18th goal is 0.36 rad away, and one is allowed for its own step. Who
    // is not answered has not seen that nothing moves.
    for (mute, seen) in [(false, true), (true, false)] {
        let damage = Damage::Mute;
        let (from_ns, until_ns, probability) = (100 * MS, u64::MAX, 1.0);
        let fault = Fault::Statuses { of: None, from_ns, until_ns, probability, damage };
        let faults = if mute { vec![fault] } else { Vec::new() };
        let mut host = Host::with(&can_robot(&[("dm4310", 1)]), faults);
        host.ask(1, &ENABLE);
        host.ask(1, &mit(0.0));
        host.world.actuator_mut("j1").expect("one").set_stuck(true);
        host.wait_ms(100);
        let far = |host: &Host| host.world.verdict().count(Rule::GoalDistance) > 0;
        let first = (1..=40).find(|&k| {
            let frame = CanFrame::classic(1, false, &mit(0.02 * f64::from(k)));
            host.world.can_send(0, frame).expect("room");
            host.wait_ms(10);
            far(&host)
        });
        assert_eq!(first.is_some(), seen, "{first:?}");
        assert!(first.is_none_or(|k| k == 18 || k == 19), "{first:?}");
    }
}

#[test]
fn torque_that_comes_on_away_from_the_goal_is_seen() {
    let mut host = Host::new(&[("dm4310", 1)]);
    host.ask(1, &ENABLE);
    assert!(host.world.verdict().is_clean(), "enabled without a goal it gives none");
    host.ask(1, &mit(0.1));
    let verdict = host.world.verdict();
    assert_eq!(verdict.violations[0].rule, Rule::TorqueOn);
}

#[test]
fn a_full_queue_refuses_frames_until_time_has_passed() {
    let mut host = Host::new(&[("dm4310", 1)]);
    let frame = CanFrame::classic(1, false, &ENABLE);
    for _ in 0..10 {
        assert_eq!(host.world.can_send(0, frame.clone()), Ok(()));
    }
    assert_eq!(host.world.can_send(0, frame.clone()), Err(QueueFull));
    host.wait_ms(1);
    assert_eq!(host.world.can_send(0, frame), Ok(()));
}

#[test]
fn a_held_line_fills_the_queue_and_lets_go_again() {
    let fault = Fault::Blocked { line: None, from_ns: 0, until_ns: 20 * MS, bytes: 0 };
    let mut host = Host::with(&can_robot(&[("dm4310", 1)]), vec![fault]);
    let frame = CanFrame::classic(1, false, &ENABLE);
    for _ in 0..10 {
        assert_eq!(host.world.can_send(0, frame.clone()), Ok(()));
    }
    host.wait_ms(10);
    assert_eq!(host.world.can_send(0, frame.clone()), Err(QueueFull));
    host.wait_ms(15);
    assert_eq!(host.world.can_send(0, frame), Ok(()));
    assert!(matches!(host.hear(), Some(CanHeard::Frame(_))));
}

#[test]
fn bus_off_is_told_once_and_the_line_is_silent_until_it_is_over() {
    let fault = Fault::BusOff { line: None, at_ns: 10 * MS, until_ns: Some(30 * MS) };
    let mut host = Host::with(&can_robot(&[("dm4310", 1)]), vec![fault]);
    host.ask(1, &ENABLE);
    host.wait_ms(12);
    assert_eq!(host.hear(), Some(CanHeard::BusOff));
    host.send(1, &ENABLE);
    assert_eq!(host.hear(), None);
    host.wait_ms(20);
    assert_eq!(host.hear(), Some(CanHeard::Restarted));
    host.ask(1, &ENABLE);
    assert_eq!(host.world.take_struck()[0].fault, "bus-off");
}

#[test]
fn trouble_makes_a_drive_let_go_until_it_is_gone_and_cleared() {
    let fault = Fault::Trouble {
        joint: "j1".to_string(),
        trouble: Trouble::OverTemperature,
        from_ns: 10 * MS,
        until_ns: 20 * MS,
    };
    let mut host = Host::with(&can_robot(&[("dm4310", 1)]), vec![fault]);
    assert_eq!(host.ask(1, &ENABLE).bytes[0], 0x11);
    host.wait_ms(11);
    let hot = host.ask(1, &CLEAR);
    assert_eq!(hot.bytes[0], 0xB1, "the cause is still there");
    assert!(hot.bytes[6] > 80, "{hot:?}");
    host.wait_ms(10);
    assert_eq!(host.ask(1, &ENABLE).bytes[0], 0xB1);
    assert_eq!(host.ask(1, &CLEAR).bytes[0], 0x01);
    assert_eq!(host.ask(1, &ENABLE).bytes[0], 0x11);
}

#[test]
fn answers_can_be_short_foreign_missing_or_twice() {
    let damaged = |nth, damage| Fault::Status { joint: "j1".to_string(), nth, damage };
    let faults = vec![
        damaged(0, Damage::Length { length: 5 }),
        damaged(1, Damage::Mute),
        damaged(2, Damage::Duplicate),
        damaged(3, Damage::Garbage { length: 8 }),
        damaged(4, Damage::Lie { at: 0, xor: 0x0F }),
    ];
    let mut host = Host::with(&can_robot(&[("dm4310", 1)]), faults);
    assert_eq!(host.ask(1, &ENABLE).bytes.len(), 5);
    host.send(1, &ENABLE);
    assert_eq!(host.hear(), None);
    let answer = host.ask(1, &ENABLE);
    assert_eq!(host.hear(), Some(CanHeard::Frame(answer.clone())));
    let foreign = host.ask(1, &ENABLE);
    assert_ne!(foreign, answer);
    assert_eq!(host.hear(), Some(CanHeard::Frame(answer.clone())));
    assert_eq!(host.ask(1, &ENABLE).bytes[0], answer.bytes[0] ^ 0x0F);
    assert_eq!(host.world.struck_count(), 5);
}

#[test]
fn an_actuator_may_fall_silent_and_come_back() {
    let fault = Fault::Silent { joint: "j1".to_string(), from_ns: 0, until_ns: 50 * MS };
    let mut host = Host::with(&can_robot(&[("dm4310", 1)]), vec![fault]);
    host.send(1, &ENABLE);
    assert_eq!(host.hear(), None);
    host.wait_ms(50);
    host.ask(1, &ENABLE);
}

#[test]
fn a_babbling_node_holds_the_line_from_less_urgent_frames() {
    let babble = CanFrame::classic(0, false, &[0x55; 8]);
    let fault = Fault::Babble {
        line: None,
        frame: babble.clone(),
        period_ns: 10_000,
        from_ns: 0,
        until_ns: 20 * MS,
    };
    let mut host = Host::with(&can_robot(&[("dm4310", 1)]), vec![fault]);
    host.send(1, &ENABLE);
    while host.world.now_ns() < 19 * MS {
        assert_eq!(host.hear(), Some(CanHeard::Frame(babble.clone())));
    }
    let mut answered = false;
    while let Some(heard) = host.hear() {
        answered |= heard != CanHeard::Frame(babble.clone());
    }
    assert!(answered, "once it was quiet");
    assert!(host.world.verdict().line_load[0] > 0.015);
}

#[test]
fn faults_of_servos_are_refused_for_actuators_and_the_other_way_round() {
    let refused = |robot: &Robot, fault| {
        let options = Options { faults: vec![fault], ..Options::default() };
        World::new(robot, options).err().expect("refused")
    };
    let joint = || "j1".to_string();
    let can = can_robot(&[("dm4310", 1)]);
    let jump = Fault::PositionJump { joint: joint(), at_ns: 0, counts: 5 };
    assert!(matches!(refused(&can, jump), SimError::BadServo { .. }));
    let serial = dynamixels(&[1]);
    let first = serial.joints[0].name.clone();
    let (trouble, from_ns, until_ns) = (Trouble::Encoder, 0, u64::MAX);
    let fault = Fault::Trouble { joint: first, trouble, from_ns, until_ns };
    assert!(matches!(refused(&serial, fault), SimError::BadServo { .. }));
    let line = Some(serial.lines[0].name.clone());
    let fault = Fault::BusOff { line, at_ns: 0, until_ns: None };
    assert!(matches!(refused(&serial, fault), SimError::NotCan(_)));
}

#[test]
fn a_pulled_out_adapter_takes_the_can_line_with_it() {
    let fault = Fault::HangUp { line: None, at_ns: 5 * MS, until_ns: Some(10 * MS), link: None };
    let mut host = Host::with(&can_robot(&[("dm4310", 1)]), vec![fault]);
    assert_eq!(host.world.connection(0), Some(1));
    host.wait_ms(6);
    assert_eq!(host.world.connection(0), None);
    host.send(1, &ENABLE);
    assert_eq!(host.hear(), None);
    host.wait_ms(10);
    assert_eq!(host.world.connection(0), Some(2));
    host.ask(1, &ENABLE);
}

#[test]
fn equal_worlds_hear_equal_frames_however_often_one_looks() {
    let heard = |look_us: u64| {
        let mut host = Host::new(&[("odrive-s1", 1), ("odrive-v3", 2)]);
        let mut frames = Vec::new();
        for us in (0..=300_000).step_by(look_us as usize) {
            host.world.run_until(us * 1000);
            if us % 30_000 == 0 && us < 300_000 {
                let request = Kind::Remote(8);
                let id = 1 << 5 | 0x09;
                let frame = CanFrame { id, extended: false, kind: request, bytes: Vec::new() };
                host.world.can_send(0, frame).expect("room");
            }
            while let Some(frame) = host.world.can_receive(0, host.world.now_ns()) {
                frames.push(frame);
            }
        }
        frames
    };
    let often = heard(100);
    assert!(often.len() > 60, "{}", often.len());
    assert!(often == heard(10_000));
}
