//! What virtual actuators of each family do, spoken to in the bytes of the makers' documents.

use gaitway_sim::can::{Actuator, CanFrame, CanHeard, CanLine, CanOptions, Kind, Trouble};
use std::f64::consts::TAU;

const MS: u64 = 1_000_000;
const ENABLE: [u8; 8] = [0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFC];

struct Bench {
    line: CanLine,
}

impl Bench {
    fn new(model: &str, id: u8) -> Bench {
        let actuator = Actuator::new(model, id).expect("an actuator");
        Bench { line: CanLine::new(CanOptions::default(), vec![actuator]) }
    }

    fn actuator(&mut self) -> &mut Actuator {
        &mut self.line.actuators_mut()[0]
    }

    /// All that is heard for 2 ms after a frame.
    fn tell(&mut self, frame: CanFrame) -> Vec<CanFrame> {
        while self.line.receive().is_some() {}
        self.line.send(frame).expect("room");
        self.heard(2)
    }

    fn heard(&mut self, ms: u64) -> Vec<CanFrame> {
        self.line.run_until(self.line.now_ns() + ms * MS);
        let heard = std::iter::from_fn(|| self.line.receive());
        heard
            .map(|heard| match heard {
                CanHeard::Frame(frame) => frame,
                other => panic!("{other:?}"),
            })
            .collect()
    }

    fn ask(&mut self, frame: CanFrame) -> CanFrame {
        self.tell(frame).pop().expect("an answer")
    }

    fn standard(&mut self, id: u32, bytes: &[u8]) -> CanFrame {
        self.ask(CanFrame::classic(id, false, bytes))
    }

    fn extended(&mut self, id: u32, bytes: &[u8]) -> CanFrame {
        self.ask(CanFrame::classic(id, true, bytes))
    }

    fn wait(&mut self, ms: u64) {
        self.line.run_until(self.line.now_ns() + ms * MS);
    }

    fn position(&self) -> f64 {
        self.line.actuators()[0].position_rad()
    }

    fn velocity(&self) -> f64 {
        self.line.actuators()[0].velocity_rad_s()
    }

    fn enabled(&self) -> bool {
        self.line.actuators()[0].enabled()
    }
}

fn close(value: f64, expected: f64, tolerance: f64) {
    assert!((value - expected).abs() <= tolerance, "{value} is not {expected}");
}

mod damiao {
    use super::*;

    /// Register `number` of device 1, as it answers.
    fn register(bench: &mut Bench, number: u8) -> u32 {
        let answer = bench.standard(0x7FF, &[1, 0, 0x33, number, 0, 0, 0, 0]);
        assert_eq!(answer.bytes[..4], [1, 0, 0x33, number]);
        u32::from_le_bytes(answer.bytes[4..].try_into().expect("four bytes"))
    }

    fn write(bench: &mut Bench, number: u8, value: u32) -> CanFrame {
        let [a, b, c, d] = value.to_le_bytes();
        bench.standard(0x7FF, &[1, 0, 0x55, number, a, b, c, d])
    }

    // DM_CAN.py, Limit_Param of DM4310: 12.5 rad, 30 rad/s, 10 N m.
    #[test]
    fn feedback_is_coded_on_the_ranges_of_the_registers() {
        let mut bench = Bench::new("dm4310", 1);
        for (number, end) in [(21, 12.5_f32), (22, 30.0), (23, 10.0)] {
            assert_eq!(register(&mut bench, number), end.to_bits());
        }
        let zero = bench.standard(1, &ENABLE);
        assert_eq!((zero.id, &zero.bytes[..6]), (0, &[0x11, 0x7F, 0xFF, 0x7F, 0xF7, 0xFF][..]));
        bench.actuator().place(1.0);
        let refresh = [1, 0, 0xCC, 0, 0, 0, 0, 0];
        assert_eq!(bench.standard(0x7FF, &refresh).bytes[..3], [0x11, 0x8A, 0x3C]);
        write(&mut bench, 21, 4.0_f32.to_bits());
        // (1 + 4) x 65535 / 8.
        assert_eq!(bench.standard(0x7FF, &refresh).bytes[1..3], [0x9F, 0xFF]);
    }

    #[test]
    fn each_control_mode_obeys_its_own_identifier_only() {
        let mut bench = Bench::new("dm4310", 1);
        // One radian at no more than two radians a second.
        let there = [0, 0, 0x80, 0x3F, 0, 0, 0, 0x40];
        assert!(bench.tell(CanFrame::classic(0x101, false, &there)).is_empty(), "mode 1");
        let echo = write(&mut bench, 10, 2);
        assert_eq!(echo.bytes, [1, 0, 0x55, 0x0A, 2, 0, 0, 0]);
        bench.standard(1, &ENABLE);
        bench.standard(0x101, &there);
        bench.wait(248);
        close(bench.position(), 0.5, 0.01);
        close(bench.velocity(), 2.0, 1e-6);
        bench.wait(1000);
        close(bench.position(), 1.0, 1e-3);
        write(&mut bench, 10, 3);
        bench.standard(0x201, &(-1.5_f32).to_le_bytes().repeat(2));
        bench.wait(10);
        close(bench.velocity(), -1.5, 1e-6);
        write(&mut bench, 10, 4);
        // To two radians at 1 rad/s (100 x 0.01) with all of the current.
        let force = [0, 0, 0, 0x40, 100, 0, 0x10, 0x27];
        let before = bench.position();
        bench.standard(0x301, &force);
        bench.wait(98);
        close(bench.position() - before, 0.1, 0.01);
    }

    #[test]
    fn only_what_was_saved_outlives_power() {
        let mut bench = Bench::new("dm4310", 1);
        write(&mut bench, 7, 0x11);
        assert_eq!(bench.standard(0x7FF, &[1, 0, 0xAA, 1, 0, 0, 0, 0]).id, 0x11);
        write(&mut bench, 9, 400);
        let now_ns = bench.line.now_ns();
        bench.actuator().restart(now_ns + MS);
        bench.wait(2);
        assert_eq!((register(&mut bench, 7), register(&mut bench, 9)), (0x11, 0));
    }

    #[test]
    fn registers_that_only_tell_keep_their_values() {
        let mut bench = Bench::new("dm4310", 1);
        write(&mut bench, 13, 7);
        assert_eq!(register(&mut bench, 13), 0);
        write(&mut bench, 10, 9);
        assert_eq!(register(&mut bench, 10), 1, "no such mode");
        bench.actuator().place(0.5);
        assert_eq!(register(&mut bench, 81), 0.5_f32.to_bits());
    }
}

mod cubemars {
    use super::*;

    #[test]
    fn the_answer_names_its_sender_in_the_first_byte_and_its_fault_in_the_last() {
        let mut bench = Bench::new("ak80-9", 3);
        let zero = [0x7F, 0xFF, 0x7F, 0xF0, 0, 0, 0x07, 0xFF];
        let answer = bench.standard(3, &zero);
        assert_eq!((answer.id, answer.bytes[0]), (0, 3));
        assert_eq!(answer.bytes[1..6], [0x7F, 0xFF, 0x7F, 0xF7, 0xFF]);
        for (trouble, code) in [
            (Trouble::OverTemperature, 1),
            (Trouble::UnderVoltage, 4),
            (Trouble::Encoder, 5),
            (Trouble::LostPhase, 6),
        ] {
            bench.actuator().set_trouble(Some(trouble));
            assert_eq!(bench.standard(3, &zero).bytes[7], code);
            assert!(!bench.enabled());
        }
    }

    #[test]
    fn it_is_mute_for_a_second_after_it_has_set_its_zero() {
        let mut bench = Bench::new("ak80-9", 3);
        bench.actuator().place(0.7);
        let order = |last| CanFrame::classic(3, false, &[[0xFF; 7].as_slice(), &[last]].concat());
        assert!(bench.tell(order(0xFE)).is_empty());
        bench.wait(900);
        assert!(bench.tell(order(0xFC)).is_empty());
        bench.wait(100);
        assert_eq!(bench.ask(order(0xFC)).bytes[1..3], [0x7F, 0xFF]);
    }

    /// Servo mode with ten frames of feedback in a second.
    fn servo_mode() -> Bench {
        let mut bench = Bench::new("ak80-9-servo", 1);
        bench.actuator().set_feedback_rate(10);
        bench
    }

    fn command(bench: &mut Bench, id: u32, bytes: &[u8]) {
        assert!(bench.tell(CanFrame::classic(id, true, bytes)).is_empty(), "no answer");
    }

    #[test]
    fn servo_mode_goes_to_degrees_and_tells_of_tenths() {
        let mut bench = servo_mode();
        command(&mut bench, 0x0401, &[0x00, 0x0D, 0xBB, 0xA0]);
        bench.wait(2000);
        close(bench.position().to_degrees(), 90.0, 0.01);
        let feedback = bench.heard(150).pop().expect("feedback");
        assert_eq!((feedback.id, feedback.extended), (0x2901, true));
        assert!([[0x03, 0x83], [0x03, 0x84]].contains(&[feedback.bytes[0], feedback.bytes[1]]));
    }

    #[test]
    fn servo_mode_turns_at_an_electrical_speed() {
        let mut bench = servo_mode();
        command(&mut bench, 0x0301, &[0x00, 0x00, 0x03, 0xE8]);
        bench.wait(150);
        // 1000 rev/min of the field, 21 pole pairs, a gear of 9.
        close(bench.velocity(), 1000.0 / 60.0 / 21.0 / 9.0 * TAU, 1e-9);
        let feedback = bench.heard(150).pop().expect("feedback");
        assert!([[0, 0x63], [0, 0x64]].contains(&[feedback.bytes[2], feedback.bytes[3]]));
    }

    #[test]
    fn servo_mode_keeps_to_a_profiles_speed() {
        let mut bench = servo_mode();
        // 90 degrees at 5000 rev/min of the field.
        command(&mut bench, 0x0601, &[0x00, 0x0D, 0xBB, 0xA0, 0x01, 0xF4, 0x01, 0x2C]);
        bench.wait(98);
        close(bench.position(), 0.1 * 5000.0 / 60.0 / 21.0 / 9.0 * TAU, 0.01);
        bench.wait(2000);
        close(bench.position().to_degrees(), 90.0, 0.01);
    }
}

mod robstride {
    use super::*;

    fn set(bench: &mut Bench, index: [u8; 2], value: [u8; 4]) -> CanFrame {
        let [a, b, c, d] = value;
        bench.extended(0x1200_FD7F, &[index[0], index[1], 0, 0, a, b, c, d])
    }

    #[test]
    fn position_mode_runs_from_parameters() {
        let mut bench = Bench::new("cybergear", 0x7F);
        assert_eq!(set(&mut bench, [0x05, 0x70], [1, 0, 0, 0]).id, 0x0200_7FFD);
        set(&mut bench, [0x17, 0x70], 2.0_f32.to_le_bytes());
        assert_eq!(bench.extended(0x0300_FD7F, &[0; 8]).id, 0x0280_7FFD);
        set(&mut bench, [0x16, 0x70], 1.0_f32.to_le_bytes());
        bench.wait(248);
        close(bench.position(), 0.5, 0.01);
        bench.wait(1000);
        close(bench.position(), 1.0, 1e-3);
        let answer = bench.extended(0x1100_FD7F, &[0x19, 0x70, 0, 0, 0, 0, 0, 0]);
        assert_eq!((answer.id, &answer.bytes[..4]), (0x1100_7FFD, &[0x19, 0x70, 0, 0][..]));
        let read = f32::from_le_bytes(answer.bytes[4..].try_into().expect("four bytes"));
        close(read.into(), 1.0, 1e-3);
    }

    #[test]
    fn the_run_mode_stays_while_it_runs() {
        let mut bench = Bench::new("rs02", 1);
        bench.extended(0x0300_FD01, &[0; 8]);
        bench.extended(0x1200_FD01, &[0x05, 0x70, 0, 0, 2, 0, 0, 0]);
        let mode = bench.extended(0x1100_FD01, &[0x05, 0x70, 0, 0, 0, 0, 0, 0]);
        assert_eq!(mode.bytes[4], 0);
    }

    #[test]
    fn an_unknown_parameter_is_refused_in_the_identifier() {
        let mut bench = Bench::new("rs02", 1);
        let answer = bench.extended(0x1100_FD01, &[0x34, 0x12, 0, 0, 0, 0, 0, 0]);
        assert_eq!(answer.id, 0x1101_01FD);
    }

    #[test]
    fn it_can_be_given_another_id_and_says_who_it_is() {
        let mut bench = Bench::new("cybergear", 0x7F);
        assert_eq!(bench.extended(0x0000_FD7F, &[0; 8]).id, 0x0000_7FFE);
        assert_eq!(bench.extended(0x0701_FD7F, &[1, 0, 0, 0, 0, 0, 0, 0]).id, 0x0000_01FE);
        assert_eq!(bench.extended(0x0300_FD01, &[0; 8]).id, 0x0280_01FD);
    }

    #[test]
    fn a_silent_host_makes_it_let_go_once_that_is_set() {
        for (model, index) in [("cybergear", [0x0C, 0x20]), ("rs02", [0x28, 0x70])] {
            let mut bench = Bench::new(model, 0x7F);
            bench.extended(0x0300_FD7F, &[0; 8]);
            bench.wait(1000);
            assert!(bench.enabled(), "no timeout from the factory");
            // 20000 steps are a second; these are 100 ms.
            set(&mut bench, index, 2000_u32.to_le_bytes());
            bench.wait(95);
            assert!(bench.enabled());
            bench.wait(10);
            assert!(!bench.enabled());
        }
    }

    // RobStride, "RS00 user manual", sections 4.1.11 and 4.1.13.
    #[test]
    fn it_saves_and_reports_when_the_guarding_bytes_are_there() {
        let mut bench = Bench::new("rs02", 0x7F);
        set(&mut bench, [0x17, 0x70], 3.0_f32.to_le_bytes());
        bench.extended(0x1600_FD7F, &[1, 2, 3, 4, 5, 6, 7, 8]);
        set(&mut bench, [0x17, 0x70], 4.0_f32.to_le_bytes());
        let now_ns = bench.line.now_ns();
        bench.actuator().restart(now_ns + MS);
        bench.wait(2);
        let speed = bench.extended(0x1100_FD7F, &[0x17, 0x70, 0, 0, 0, 0, 0, 0]);
        assert_eq!(speed.bytes[4..], 3.0_f32.to_le_bytes());
        bench.extended(0x1800_FD7F, &[1, 2, 3, 4, 5, 6, 1, 0]);
        let reports = bench.heard(100);
        assert_eq!((reports.len(), reports[0].id), (10, 0x1800_7FFD));
        bench.extended(0x1800_FD7F, &[1, 2, 3, 4, 5, 6, 0, 0]);
        assert!(bench.heard(100).is_empty());
    }

    #[test]
    fn a_fault_is_told_at_once_and_in_every_answer_until_it_is_cleared() {
        let mut bench = Bench::new("cybergear", 0x7F);
        bench.extended(0x0300_FD7F, &[0; 8]);
        bench.actuator().set_trouble(Some(Trouble::UnderVoltage));
        let told = bench.heard(2).pop().expect("a fault");
        assert_eq!((told.id, told.bytes[0]), (0x1500_7FFD, 1 << 2));
        bench.actuator().set_trouble(None);
        assert_eq!(bench.extended(0x0300_FD7F, &[0; 8]).id, 0x0201_7FFD);
        let cleared = bench.extended(0x0400_FD7F, &[1, 0, 0, 0, 0, 0, 0, 0]);
        assert_eq!(cleared.id, 0x0200_7FFD);
    }
}

mod odrive {
    use super::*;

    const CLOSED_LOOP: [u8; 4] = [8, 0, 0, 0];

    fn request(id: u32) -> CanFrame {
        CanFrame { id, extended: false, kind: Kind::Remote(8), bytes: Vec::new() }
    }

    fn tell(bench: &mut Bench, id: u32, bytes: &[u8]) {
        bench.tell(CanFrame::classic(id, false, bytes));
    }

    /// The last heartbeat of a while: its error and its state.
    fn beat(bench: &mut Bench) -> (u32, u8) {
        let mut beats = bench.heard(100).into_iter().filter(|frame| frame.id == 0x21);
        let beat = beats.next_back().expect("a heartbeat");
        let error = beat.bytes[..4].try_into().expect("four bytes");
        (u32::from_le_bytes(error), beat.bytes[4])
    }

    fn estimates(bench: &mut Bench) -> [f32; 2] {
        let mut frames = bench.heard(20).into_iter().filter(|frame| frame.id == 0x29);
        let bytes = frames.next_back().expect("estimates").bytes;
        [0, 4].map(|k| f32::from_le_bytes(bytes[k..k + 4].try_into().expect("four bytes")))
    }

    #[test]
    fn heartbeats_and_estimates_come_at_their_rates() {
        let mut bench = Bench::new("odrive-s1", 1);
        bench.heard(200);
        let frames = bench.heard(1000);
        let count = |id| frames.iter().filter(|frame| frame.id == id).count();
        assert_eq!((count(0x21), count(0x29), frames.len()), (10, 100, 110));
    }

    #[test]
    fn it_goes_where_it_is_told_within_its_limits() {
        let mut bench = Bench::new("odrive-v3", 1);
        bench.actuator().place(-0.25 * TAU);
        assert_eq!(estimates(&mut bench), [-0.25, 0.0]);
        tell(&mut bench, 0x27, &CLOSED_LOOP);
        assert_eq!(beat(&mut bench), (0, 8));
        close(bench.position(), -0.25 * TAU, 1e-9);
        // 0.5 rev/s at the most, 10 A.
        tell(&mut bench, 0x2F, &[0, 0, 0, 0x3F, 0, 0, 0x20, 0x41]);
        tell(&mut bench, 0x2B, &[3, 0, 0, 0, 1, 0, 0, 0]);
        tell(&mut bench, 0x2C, &[0, 0, 0xC0, 0x3F, 0, 0, 0, 0]);
        bench.wait(498);
        close(bench.position() / TAU, 0.0, 0.01);
        bench.wait(4000);
        close(bench.position() / TAU, 1.5, 1e-3);
    }

    #[test]
    fn velocity_mode_turns_and_idle_lets_go() {
        let mut bench = Bench::new("odrive-s1", 1);
        tell(&mut bench, 0x2B, &[2, 0, 0, 0, 1, 0, 0, 0]);
        tell(&mut bench, 0x27, &CLOSED_LOOP);
        tell(&mut bench, 0x2D, &[0, 0, 0, 0x40, 0, 0, 0, 0]);
        let [_, velocity] = estimates(&mut bench);
        close(velocity.into(), 2.0, 1e-6);
        tell(&mut bench, 0x27, &[1, 0, 0, 0]);
        assert!(!bench.enabled());
    }

    #[test]
    fn remote_requests_and_empty_messages_are_answered() {
        let mut bench = Bench::new("odrive-v3", 1);
        bench.actuator().place(TAU);
        let told = |bench: &mut Bench, frame: CanFrame| {
            let id = frame.id;
            bench.tell(frame).into_iter().find(|answer| answer.id == id).expect("an answer")
        };
        let volts = told(&mut bench, request(0x37)).bytes;
        assert_eq!(volts[..4], 24.0_f32.to_le_bytes());
        let counts = told(&mut bench, CanFrame::classic(0x2A, false, &[])).bytes;
        assert_eq!(counts, [0, 0x20, 0, 0, 0, 0, 0, 0], "8192 counts");
        assert_eq!(told(&mut bench, request(0x23)).bytes, [0; 8]);
    }

    #[test]
    fn the_watchdog_is_an_error_that_must_be_cleared() {
        for (model, error) in [("odrive-v3", 1 << 11), ("odrive-s1", 1 << 24)] {
            let mut bench = Bench::new(model, 1);
            bench.actuator().set_timeout(Some(50 * MS));
            tell(&mut bench, 0x27, &CLOSED_LOOP);
            bench.wait(40);
            assert!(bench.enabled());
            assert_eq!(beat(&mut bench), (error, 1));
            tell(&mut bench, 0x27, &CLOSED_LOOP);
            assert!(!bench.enabled(), "not before it is cleared");
            tell(&mut bench, 0x38, &[]);
            tell(&mut bench, 0x27, &CLOSED_LOOP);
            assert!(bench.enabled());
        }
    }

    #[test]
    fn an_emergency_stop_lets_go() {
        let mut bench = Bench::new("odrive-v3", 1);
        tell(&mut bench, 0x27, &CLOSED_LOOP);
        tell(&mut bench, 0x22, &[]);
        assert_eq!(beat(&mut bench), (1 << 14, 1));
    }
}

mod moteus {
    use super::*;

    fn ask(bench: &mut Bench, id: u32, bytes: &[u8]) -> Vec<CanFrame> {
        let kind = Kind::Fd { fast: true };
        bench.tell(CanFrame { id, extended: id > 0x7FF, kind, bytes: bytes.to_vec() })
    }

    /// Device 1 is asked by host 0, who wants an answer.
    fn answer(bench: &mut Bench, bytes: &[u8]) -> Vec<u8> {
        let answer = ask(bench, 0x8001, bytes).pop().expect("an answer");
        assert_eq!((answer.id, answer.extended), (0x100, false));
        answer.bytes
    }

    fn mode(bench: &mut Bench) -> u8 {
        let bytes = answer(bench, &[0x11, 0x00]);
        assert_eq!(bytes[..2], [0x21, 0x00]);
        bytes[2]
    }

    /// A position command of floats: mode 10, then position, velocity and, in milliseconds of
    /// int16, the timeout.
    fn position(rev: f32, rev_s: f32, timeout_ms: i16) -> Vec<u8> {
        let mut bytes = vec![0x01, 0x00, 10, 0x0E, 0x20];
        bytes.extend(rev.to_le_bytes());
        bytes.extend(rev_s.to_le_bytes());
        bytes.extend([0x05, 0x27]);
        bytes.extend(timeout_ms.to_le_bytes());
        bytes.extend([0x50; 3]);
        bytes
    }

    // mjbots/moteus, docs/reference.md, the example of section A: what is asked is byte for byte
    // the manual's, and so is the shape of the answer.
    #[test]
    fn the_manuals_example_is_answered_in_the_manuals_shape() {
        let mut bench = Bench::new("moteus-r4", 1);
        let asked = [
            0x01, 0x00, 0x0A, 0x07, 0x20, 0x60, 0x00, 0x20, 0x01, 0x50, 0xFF, 0x14, 0x04, 0x00,
            0x13, 0x0D,
        ];
        let bytes = answer(&mut bench, &asked);
        assert_eq!(bytes.len(), 16);
        assert_eq!(bytes[..3], [0x24, 0x04, 0x00]);
        assert_eq!(bytes[11..], [0x23, 0x0D, 48, 30, 0], "24 V in halves, 30 degrees, no fault");
        assert_eq!(mode(&mut bench), 10);
    }

    #[test]
    fn every_resolution_tells_the_same_position() {
        let mut bench = Bench::new("moteus-r4", 1);
        bench.actuator().place(-0.25 * TAU);
        let asked = [0x11, 0x01, 0x15, 0x01, 0x19, 0x01, 0x1D, 0x01];
        let mut expected = vec![0x21, 0x01, 231, 0x25, 0x01];
        expected.extend((-2500_i16).to_le_bytes());
        expected.extend([0x29, 0x01]);
        expected.extend((-25_000_i32).to_le_bytes());
        expected.extend([0x2D, 0x01]);
        expected.extend((-0.25_f32).to_le_bytes());
        expected.resize(20, 0x50);
        assert_eq!(answer(&mut bench, &asked), expected);
    }

    // docs/reference.md, A.2.a: what one step of each integer stands for.
    #[test]
    fn integers_count_in_the_steps_of_their_quantity() {
        for (register, value, steps) in [
            (0x20, 0.5_f32, [50, 5000, 50_000]),
            (0x21, 0.5, [5, 2000, 50_000]),
            (0x22, -1.5, [-3, -150, -1500]),
            (0x23, 1.0, [127, 32_767, i32::MAX]),
            (0x27, 0.25, [25, 250, 250_000]),
        ] {
            let mut bench = Bench::new("moteus-r4", 1);
            let mut bytes = vec![0x0D, register];
            bytes.extend(value.to_le_bytes());
            bytes.extend([0x11, register, 0x15, register, 0x19, register]);
            let said = answer(&mut bench, &bytes);
            let mut expected = vec![0x21, register, steps[0] as u8, 0x25, register];
            expected.extend((steps[1] as i16).to_le_bytes());
            expected.extend([0x29, register]);
            expected.extend(steps[2].to_le_bytes());
            assert_eq!(said[..expected.len()], expected, "{register:#x}");
        }
    }

    #[test]
    fn a_goal_that_is_no_number_moves_nothing() {
        let mut bench = Bench::new("moteus-r4", 1);
        answer(&mut bench, &position(0.0, 0.0, i16::MIN));
        for wrong in [position(f32::INFINITY, 0.0, 0), position(0.0, f32::NEG_INFINITY, 0)] {
            answer(&mut bench, &wrong);
            bench.wait(20);
            close(bench.position(), 0.0, 1e-9);
        }
    }

    #[test]
    fn not_a_number_is_the_smallest_integer() {
        let mut bench = Bench::new("moteus-r4", 1);
        // The stop position is none unless one was told.
        let bytes = answer(&mut bench, &[0x11, 0x26, 0x15, 0x26]);
        assert_eq!(bytes[..7], [0x21, 0x26, 0x80, 0x25, 0x26, 0x00, 0x80]);
    }

    #[test]
    fn it_holds_a_position_and_moves_on_at_a_velocity() {
        let mut bench = Bench::new("moteus-r4", 1);
        for _ in 0..100 {
            answer(&mut bench, &position(0.01, 0.0, 0));
            bench.wait(8);
        }
        close(bench.position() / TAU, 0.01, 1e-3);
        // From where it stands, at half a revolution a second.
        answer(&mut bench, &position(f32::NAN, 0.5, i16::MIN));
        bench.wait(998);
        close(bench.position() / TAU, 0.51, 0.03);
    }

    #[test]
    fn a_silent_host_brings_mode_11_which_only_stopping_leaves() {
        let mut bench = Bench::new("moteus-r4", 1);
        answer(&mut bench, &position(0.0, 0.0, 0));
        bench.wait(90);
        assert_eq!(mode(&mut bench), 10, "the factory's 0.1 s");
        bench.wait(20);
        assert_eq!(mode(&mut bench), 11, "asking alone feeds nothing");
        answer(&mut bench, &position(0.0, 0.0, 0));
        assert_eq!(mode(&mut bench), 11);
        answer(&mut bench, &[0x01, 0x00, 0x00]);
        assert_eq!(mode(&mut bench), 0);
        answer(&mut bench, &position(0.0, 0.0, 20));
        bench.wait(30);
        assert_eq!(mode(&mut bench), 11, "a command's own timeout");
        answer(&mut bench, &[0x01, 0x00, 0x00]);
        answer(&mut bench, &position(0.0, 0.0, i16::MIN));
        bench.wait(5000);
        assert_eq!(mode(&mut bench), 10, "none at all");
    }

    #[test]
    fn a_fault_is_a_mode_and_a_code_until_it_is_stopped() {
        let mut bench = Bench::new("moteus-r4", 1);
        bench.actuator().set_trouble(Some(Trouble::Encoder));
        answer(&mut bench, &position(0.0, 0.0, 0));
        let bytes = answer(&mut bench, &[0x11, 0x00, 0x11, 0x0F]);
        assert_eq!(bytes[..6], [0x21, 0x00, 1, 0x21, 0x0F, 35]);
        bench.actuator().set_trouble(None);
        answer(&mut bench, &[0x01, 0x00, 0x00]);
        assert_eq!(mode(&mut bench), 0);
    }

    #[test]
    fn unknown_registers_are_refused_and_other_devices_left_alone() {
        let mut bench = Bench::new("moteus-r4", 1);
        let bytes = answer(&mut bench, &[0x11, 0xFF, 0x0F]);
        assert_eq!(bytes[..4], [0x31, 0xFF, 0x0F, 2]);
        // The last register there could be, and one beyond.
        let bytes = answer(&mut bench, &[0x02, 0xFF, 0xFF, 0xFF, 0xFF, 0x0F, 7, 7]);
        assert_eq!(bytes[..7], [0x30, 0xFF, 0xFF, 0xFF, 0xFF, 0x0F, 2]);
        assert!(ask(&mut bench, 0x8002, &[0x11, 0x00]).is_empty());
        assert!(ask(&mut bench, 0x0001, &[0x11, 0x00]).is_empty(), "no answer was asked for");
    }
}

mod recoil {
    use super::*;

    fn read(bench: &mut Bench, at: u16) -> u32 {
        let [low, high] = at.to_le_bytes();
        let answer = bench.standard(0x60B, &[0x40, low, high]);
        assert_eq!(answer.id, 0x58B);
        u32::from_le_bytes(answer.bytes.try_into().expect("four bytes"))
    }

    fn mode(bench: &mut Bench, mode: u8) {
        assert!(bench.tell(CanFrame::classic(0x00B, false, &[mode, 11])).is_empty());
    }

    fn go(bench: &mut Bench, position: f32) -> CanFrame {
        bench.standard(0x30B, &[position.to_le_bytes(), [0; 4]].concat())
    }

    #[test]
    fn position_mode_holds_first_and_then_goes_where_it_is_told() {
        let mut bench = Bench::new("recoil-5010", 11);
        bench.actuator().place(0.3);
        mode(&mut bench, 0x13);
        bench.wait(100);
        close(bench.position(), 0.3, 1e-6);
        for _ in 0..300 {
            go(&mut bench, 0.5);
            bench.wait(3);
        }
        close(bench.position(), 0.5, 1e-3);
        let state = go(&mut bench, 0.5);
        assert_eq!(state.id, 0x28B);
        let told = f32::from_le_bytes(state.bytes[..4].try_into().expect("four bytes"));
        close(told.into(), 0.5, 1e-3);
        assert_eq!(read(&mut bench, 0x010), 0x13);
    }

    #[test]
    fn a_silent_host_brings_damping_and_an_error_bit() {
        let mut bench = Bench::new("recoil-5010", 11);
        mode(&mut bench, 0x13);
        bench.wait(900);
        bench.tell(CanFrame::classic(0x70B, false, &[]));
        bench.wait(990);
        assert_eq!(read(&mut bench, 0x010), 0x13, "the heartbeat fed it");
        bench.wait(20);
        assert_eq!((read(&mut bench, 0x010), read(&mut bench, 0x014)), (0x02, 0x40));
        mode(&mut bench, 0x01);
        assert!(!bench.enabled());
        mode(&mut bench, 0x13);
        go(&mut bench, 0.0);
        assert_eq!(read(&mut bench, 0x010), 0x13);
    }

    #[test]
    fn disabled_is_left_by_way_of_idle_only() {
        let mut bench = Bench::new("recoil-5010", 11);
        mode(&mut bench, 0x00);
        mode(&mut bench, 0x13);
        assert_eq!((read(&mut bench, 0x010), read(&mut bench, 0x014)), (0x01, 0x20));
    }

    #[test]
    fn parameters_are_read_and_written_where_they_lie() {
        let mut bench = Bench::new("recoil-5010", 11);
        let [a, b, c, d] = 35.0_f32.to_le_bytes();
        assert!(
            bench.tell(CanFrame::classic(0x60B, false, &[0x20, 0x20, 0, 0, a, b, c, d])).is_empty()
        );
        assert_eq!(read(&mut bench, 0x020), 35.0_f32.to_bits());
        assert_eq!(read(&mut bench, 0x100), 24.0_f32.to_bits());
        let echo = bench.standard(0x20B, &[0xCA, 1, 2, 3, 4, 5, 6, 7]);
        assert_eq!((echo.id, echo.bytes[0]), (0x18B, 0xCA));
    }
}
