//! ODrive, CAN Simple: standard frames, `node << 5 | command`, little-endian numbers in
//! revolutions of the output shaft.
//!
//! Heartbeat and estimates come at a steady rate; on firmware 0.5 other values are asked for by a
//! remote request. In `Feedback`, position is in revolutions, velocity in revolutions per second,
//! torque a motor current in ampere.
//!
//! Source: odriverobotics/ODrive, `docs/can-protocol.rst` and `can_simple.cpp` of firmware 0.5.6, and
//! `ODrive.Axis.Error` of its reference;
//! ODrive documentation, "CAN Protocol" of firmware 0.6, and `enums.py` of odrive 0.6.11.

use super::{CanFrame, CanId, Faults, Feedback, Format, Number};

/// A node id, 0 to 63.
pub type Id = crate::wire::Id<63>;

/// What a node is told.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Command {
    /// Let go at once, as an error that must be cleared.
    EmergencyStop,
    /// Wanted state; [`STATE_IDLE`] or [`STATE_CLOSED_LOOP`].
    State(u32),
    /// Control mode and input mode.
    Mode {
        /// 0 voltage, 1 torque, 2 velocity, 3 position.
        control: u32,
        /// 1 = as it comes; others filter or ramp.
        input: u32,
    },
    /// Where to be.
    Position {
        /// Revolutions.
        position: f32,
        /// Velocity added, in 0.001 rev/s.
        velocity: i16,
        /// Torque added, in 0.001 N m.
        torque: i16,
    },
    /// How fast to turn, rev/s, and torque added, N m.
    Velocity(f32, f32),
    /// Torque, N m.
    Torque(f32),
    /// Largest speed, rev/s, and current, A.
    Limits(f32, f32),
    /// Gain on the error of position, (rev/s)/rev.
    PositionGain(f32),
    /// Gains on the error of velocity: N m/(rev/s), and N m/rev.
    VelocityGains(f32, f32),
    /// Forget all errors.
    ClearErrors,
    /// Start anew; lets go.
    Reboot,
}

/// Axis state: lets go.
pub const STATE_IDLE: u32 = 1;
/// Axis state: drives.
pub const STATE_CLOSED_LOOP: u32 = 8;

const fn to(id: Id, command: u32) -> CanId {
    CanId::standard_of((id.get() as u32) << 5 | command)
}

/// A frame to one node.
#[must_use]
pub fn command(id: Id, command: Command) -> CanFrame {
    let two = |first: u32, second: u32| (u64::from(first) | u64::from(second) << 32).to_le_bytes();
    let floats = |first: f32, second: f32| two(first.to_bits(), second.to_bits());
    match command {
        Command::EmergencyStop => CanFrame::classic(to(id, 0x02), []),
        Command::State(state) => CanFrame::classic(to(id, 0x07), state.to_le_bytes()),
        Command::Mode { control, input } => CanFrame::classic(to(id, 0x0B), two(control, input)),
        Command::Position { position, velocity, torque } => {
            let [velocity, torque] = [velocity, torque].map(i16::cast_unsigned).map(u32::from);
            let added = velocity | torque << 16;
            CanFrame::classic(to(id, 0x0C), two(position.to_bits(), added))
        }
        Command::Velocity(velocity, torque) => {
            CanFrame::classic(to(id, 0x0D), floats(velocity, torque))
        }
        Command::Torque(torque) => CanFrame::classic(to(id, 0x0E), torque.to_le_bytes()),
        Command::Limits(speed, current) => CanFrame::classic(to(id, 0x0F), floats(speed, current)),
        Command::PositionGain(gain) => CanFrame::classic(to(id, 0x1A), gain.to_le_bytes()),
        Command::VelocityGains(gain, integral) => {
            CanFrame::classic(to(id, 0x1B), floats(gain, integral))
        }
        Command::ClearErrors => CanFrame::classic(to(id, 0x18), []),
        Command::Reboot => CanFrame::classic(to(id, 0x16), []),
    }
}

/// What can be asked of a node by a remote request, the number of its message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Request {
    /// Position and velocity.
    Estimates = 0x09,
    /// Motor current, wanted and measured.
    Current = 0x14,
    /// Supply voltage and current.
    Supply = 0x17,
}

/// A remote request, which firmware 0.5 answers with a frame of the same identifier.
#[must_use]
pub const fn request(id: Id, request: Request) -> CanFrame {
    question(id, request as u8)
}

/// A remote request for message `number`, of which five bits count.
#[must_use]
pub const fn question(id: Id, number: u8) -> CanFrame {
    let mut frame = CanFrame::classic(to(id, number as u32 & 0x1F), []);
    frame.format = Format::Remote { length: 8 };
    frame
}

/// The two words of message `number`, if `frame` is that of node `id`.
#[must_use]
pub fn words(id: Id, number: u8, frame: &CanFrame) -> Option<[u32; 2]> {
    let meant = frame.id() == to(id, u32::from(number) & 0x1F);
    frame.classic_bytes().filter(|_| meant).map(halves)
}

/// What a node says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Message {
    /// It lives; sent ten times a second.
    Heartbeat {
        /// Error bits of the axis (0.5) or all active errors (0.6); 0 = none.
        error: u32,
        /// Axis state.
        state: u8,
    },
    /// Part of the feedback: position and velocity, or the motor current.
    Feedback(Feedback),
    /// Supply voltage, V, and current, A.
    Supply(f32, f32),
}

/// What a node says, and which.
#[must_use]
pub fn message(frame: &CanFrame) -> Option<(Id, Message)> {
    if frame.id().is_extended() {
        return None;
    }
    let number = frame.id().number();
    let pair = || {
        let [first, second] = halves(frame.classic_bytes()?);
        Some([f32::from_bits(first), f32::from_bits(second)])
    };
    let message = match number & 0x1F {
        0x01 => {
            let [e0, e1, e2, e3, state] = frame.classic_bytes()?;
            Message::Heartbeat { error: u32::from_le_bytes([e0, e1, e2, e3]), state }
        }
        0x09 => {
            let [position, velocity] = pair()?.map(|x| Some(Number::Value(x)));
            Message::Feedback(Feedback { position, velocity, ..Feedback::default() })
        }
        0x14 => {
            let [_wanted, measured] = pair()?.map(|x| Some(Number::Value(x)));
            Message::Feedback(Feedback { torque: measured, ..Feedback::default() })
        }
        0x17 => {
            let [volt, ampere] = pair()?;
            Message::Supply(volt, ampere)
        }
        _ => return None,
    };
    Some((Id::new((number >> 5) as u8)?, message))
}

fn halves(bytes: [u8; 8]) -> [u32; 2] {
    let whole = u64::from_le_bytes(bytes);
    [whole as u32, (whole >> 32) as u32]
}

/// Which numbering of errors a node uses; its messages do not tell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Firmware {
    /// 0.5: errors of the axis, with the rest to be asked for.
    V05,
    /// 0.6: all active errors.
    V06,
}

/// The error bits of a heartbeat in common words.
#[must_use]
pub fn faults(error: u32, firmware: Firmware) -> Faults {
    let table = match firmware {
        Firmware::V05 => ERRORS_05,
        Firmware::V06 => ERRORS_06,
    };
    let known = table.iter().fold(0, |mask, (bit, _)| mask | 1 << bit);
    let other = if error & !known != 0 { Faults::OTHER } else { Faults::NONE };
    Faults::of_bits(error, table).and(other)
}

/// `ODrive.Axis.Error`, firmware 0.5; the voltages until 0.5.3.
const ERRORS_05: &[(u32, Faults)] = &[
    (1, Faults::UNDER_VOLTAGE),
    (2, Faults::OVER_VOLTAGE),
    (6, Faults::DRIVER),
    (7, Faults::ENCODER),
    (8, Faults::ENCODER),
    (11, Faults::SILENCE),
    (12, Faults::OUT_OF_RANGE),
    (13, Faults::OUT_OF_RANGE),
    (18, Faults::HOT),
    (19, Faults::NOT_CALIBRATED),
];

/// `ODrive.Error`, firmware 0.6.
const ERRORS_06: &[(u32, Faults)] = &[
    (3, Faults::ENCODER),
    (4, Faults::NOT_CALIBRATED),
    (5, Faults::DRIVER),
    (8, Faults::OVER_VOLTAGE),
    (9, Faults::UNDER_VOLTAGE),
    (10, Faults::CURRENT),
    (11, Faults::CURRENT),
    (12, Faults::CURRENT),
    (13, Faults::MOTOR_HOT),
    (14, Faults::HOT),
    (15, Faults::OUT_OF_RANGE),
    (16, Faults::OUT_OF_RANGE),
    (17, Faults::CURRENT),
    (24, Faults::SILENCE),
    (26, Faults::ENCODER),
    (30, Faults::NOT_CALIBRATED),
];

#[cfg(test)]
mod tests {
    use super::*;

    fn one() -> Id {
        Id::new(1).expect("an id")
    }

    // Vectors after `can-protocol.rst`, worked out by hand.
    #[test]
    fn commands_are_little_endian_behind_node_and_number() {
        let position = |velocity, torque| Command::Position { position: 1.5, velocity, torque };
        for (command, number, payload) in [
            (Command::State(STATE_CLOSED_LOOP), 0x27, &[8, 0, 0, 0][..]),
            (position(0, 0), 0x2C, &[0, 0, 0xC0, 0x3F, 0, 0, 0, 0]),
            (position(500, -100), 0x2C, &[0, 0, 0xC0, 0x3F, 0xF4, 0x01, 0x9C, 0xFF]),
            (Command::Mode { control: 3, input: 1 }, 0x2B, &[3, 0, 0, 0, 1, 0, 0, 0]),
            (Command::Velocity(2.0, 0.0), 0x2D, &[0, 0, 0, 0x40, 0, 0, 0, 0]),
            (Command::Torque(1.0), 0x2E, &[0, 0, 0x80, 0x3F]),
            (Command::EmergencyStop, 0x22, &[]),
            (Command::ClearErrors, 0x38, &[]),
        ] {
            let frame = super::command(one(), command);
            assert!(frame.id().is_standard(number), "{frame:?}");
            assert_eq!(frame.payload(), payload, "{command:?}");
        }
    }

    #[test]
    fn a_request_is_remote_and_empty() {
        let frame = request(one(), Request::Estimates);
        assert!(frame.id().is_standard(0x29));
        assert_eq!((frame.format(), frame.payload()), (Format::Remote { length: 8 }, &[][..]));
    }

    fn heard(number: u32, bytes: &[u8]) -> Option<(Id, Message)> {
        message(&CanFrame::new(CanId::standard_of(number), Format::Classic, bytes).expect("fits"))
    }

    #[test]
    fn estimates_and_heartbeat_name_their_node() {
        let Some((id, Message::Feedback(feedback))) =
            heard(0x29, &[0, 0, 0x80, 0xBE, 0, 0, 0, 0x40])
        else {
            panic!("estimates");
        };
        assert_eq!(id, one());
        assert_eq!(feedback.position, Some(Number::Value(-0.25)));
        assert_eq!(feedback.velocity, Some(Number::Value(2.0)));
        let beat = heard(0x7E1, &[0x40, 0, 0, 0, 1, 0, 0, 0x80]);
        let expected = Message::Heartbeat { error: 0x40, state: 1 };
        assert_eq!(beat, Some((Id::new(63).expect("an id"), expected)));
        assert_eq!(heard(0x29, &[0; 7]), None, "too short");
        assert_eq!(heard(0x21, &[0; 4]), None, "too short");
    }

    #[test]
    fn an_error_without_a_word_is_still_an_error() {
        assert_eq!(faults(0, Firmware::V06), Faults::NONE);
        assert_eq!(faults(1 << 24, Firmware::V06), Faults::SILENCE);
        assert_eq!(faults(1 << 11, Firmware::V05), Faults::SILENCE);
        assert_eq!(faults(1 << 31, Firmware::V06), Faults::OTHER);
        assert_eq!(faults(1 << 24, Firmware::V05), Faults::OTHER);
    }
}
