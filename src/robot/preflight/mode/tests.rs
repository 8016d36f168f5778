//! Drive Mode of Dynamixel X, over a servo that answers nothing but what it holds there.

use super::*;
use crate::port::{BytePort, Clock, PortError};
use crate::robot::Robot;
use crate::time::Instant;
use crate::wire::checksum::crc16;
use std::collections::VecDeque;
use std::sync::{Arc, Mutex};

/// What its register holds when it is asked next, the last one for good; what it says; and how
/// often it was asked.
#[derive(Default)]
struct Servo {
    now: Instant,
    values: VecDeque<u8>,
    says: VecDeque<u8>,
    asked: usize,
}

#[derive(Clone, Default)]
struct Shared(Arc<Mutex<Servo>>);

impl Clock for Shared {
    fn now(&self) -> Instant {
        self.0.lock().expect("one thread").now
    }

    fn sleep_until(&self, at: Instant) {
        let mut servo = self.0.lock().expect("one thread");
        servo.now = servo.now.max(at);
    }
}

impl BytePort for Shared {
    fn send(&mut self, bytes: &[u8], _deadline: Instant) -> Result<(), PortError> {
        // Read, one byte, Drive Mode(10).
        let &[0xFF, 0xFF, 0xFD, 0, id, 7, 0, 2, 10, 0, 1, 0, _, _] = bytes else {
            panic!("not asked of these tests: {bytes:02X?}");
        };
        let mut servo = self.0.lock().expect("one thread");
        servo.asked += 1;
        let value = servo.values[0];
        if servo.values.len() > 1 {
            servo.values.pop_front();
        }
        let mut status = vec![0xFF, 0xFF, 0xFD, 0, id, 5, 0, 0x55, 0, value];
        status.extend(crc16(&status).to_le_bytes());
        servo.says.extend(status);
        Ok(())
    }

    fn receive(&mut self, buffer: &mut [u8], deadline: Instant) -> Result<usize, PortError> {
        let mut servo = self.0.lock().expect("one thread");
        let count = servo.says.len().min(buffer.len());
        if count == 0 {
            servo.now = servo.now.max(deadline);
            return Err(PortError::TimedOut);
        }
        buffer.iter_mut().zip(servo.says.drain(..count)).for_each(|(to, byte)| *to = byte);
        Ok(count)
    }

    fn discard_input(&mut self) -> Result<(), PortError> {
        self.0.lock().expect("one thread").says.clear();
        Ok(())
    }
}

/// What is said of a servo with these values in its Drive Mode, and how often it was asked.
fn said(values: &[u8]) -> (Result<(), Error>, usize) {
    let servo = Shared::default();
    servo.0.lock().expect("one thread").values = values.iter().copied().collect();
    let port: Box<dyn BytePort> = Box::new(servo.clone());
    let robot = Robot::load("op3").expect("shipped");
    let mut link = Link::new(robot, vec![(port, Duration::ZERO)], Arc::new(servo.clone()));
    let said = check_drive_mode(&mut link, 0);
    let asked = servo.0.lock().expect("one thread").asked;
    (said, asked)
}

#[test]
fn a_servo_that_turns_the_other_way_may_and_is_asked_once() {
    assert_eq!([0, 1].map(|raw| said(&[raw])), [(Ok(()), 1), (Ok(()), 1)]);
}

#[test]
fn a_servo_that_times_its_moves_or_switches_its_torque_on_by_itself_is_refused() {
    let times = "a servo times its moves: no register limits its speed";
    let switches = "a servo switches its torque on by itself with a goal";
    for (raw, what, bit, then) in [
        (0x04, times, 0x04, 0x00),
        (0x05, times, 0x04, 0x01),
        (0x08, switches, 0x08, 0x00),
        (0x09, switches, 0x08, 0x01),
        (0x0D, times, 0x04, 0x09),
    ] {
        let (said, asked) = said(&[raw]);
        let error = said.expect_err("refused");
        assert_eq!((error.what.as_str(), asked), (what, 2), "{raw}");
        assert_eq!(error.got.as_deref(), Some(&*format!("{raw} (raw)")));
        assert_eq!(
            error.allowed.as_deref(),
            Some(&*format!("bit 0x{bit:02X} clear, as it leaves the factory"))
        );
        let remedy = error.remedy.expect("what to do");
        assert!(remedy.contains(&format!("'Drive Mode' --raw {then} ")), "{remedy}");
    }
}

#[test]
fn a_mode_that_reads_wrong_once_was_an_answer_to_something_else() {
    for raw in [0x04, 0x08, 0x0C] {
        assert_eq!(said(&[raw, 0]), (Ok(()), 2), "{raw}");
    }
}
