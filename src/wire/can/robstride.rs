//! Xiaomi CyberGear and RobStride actuators, the makers' own protocol: extended frames of eight
//! bytes at 1 Mbit/s.
//!
//! ```text
//! identifier    kind 5 | data 16 | target 8
//! ```
//!
//! Two byte orders: motion and feedback are big-endian, parameters little-endian. The torque of a
//! motion command travels in the identifier.
//!
//! Source: Xiaomi, "CyberGear instruction manual" section 4 (belovictor/cybergear-docs); RobStride,
//! "RS00 user manual", section 4; kscalelabs/actuator 01c8f989, `actuator/rust/robstride`.

use super::{CanFrame, CanId, Faults, Feedback, Number};

/// A device or host id, 0 to 254. A reply to [`Command::Identify`] is addressed to 0xFE.
pub type Id = crate::wire::Id<254>;

/// A motion command in steps of 16 bits on the actuator's ranges.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Setpoint {
    /// Position.
    pub position: u16,
    /// Velocity.
    pub velocity: u16,
    /// Gain on the error of position.
    pub kp: u16,
    /// Gain on the error of velocity.
    pub kd: u16,
    /// Torque added.
    pub torque: u16,
}

/// What a device is told.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Command {
    /// Answer with the unique number of your processor.
    Identify,
    /// Where to be; needs run mode 0.
    Setpoint(Setpoint),
    /// Drive from now on.
    Enable,
    /// Let go, and forget a fault if so told.
    Disable {
        /// Forget it.
        clear_faults: bool,
    },
    /// The present position is zero, until power-off.
    SetZero,
    /// Listen to another id from now on.
    SetId(Id),
    /// The value of a parameter.
    Read(u16),
    /// Sets a parameter until power-off: an `f32`'s bits, or an integer.
    Write(u16, u32),
    /// Keeps the settings over power-off. RobStride only.
    Save,
    /// Tell feedback unasked, or do not. RobStride only.
    Report(bool),
}

const KIND_IDENTITY: u32 = 0;
const KIND_FEEDBACK: u32 = 2;
const KIND_READ: u32 = 17;
const KIND_FAULT: u32 = 21;
const KIND_REPORT: u32 = 24;

/// A frame from host to device.
#[must_use]
pub fn command(host: Id, id: Id, command: Command) -> CanFrame {
    let from = u16::from(host.get());
    let to = |kind: u32, data: u16| {
        CanId::extended_of(kind << 24 | u32::from(data) << 8 | u32::from(id.get()))
    };
    let parameter =
        |index: u16, value: u32| (u64::from(index) | u64::from(value) << 32).to_le_bytes();
    let first = |byte: u8| [byte, 0, 0, 0, 0, 0, 0, 0];
    match command {
        Command::Identify => CanFrame::classic(to(KIND_IDENTITY, from), [0; 8]),
        Command::Setpoint(Setpoint { position, velocity, kp, kd, torque }) => {
            let packed = [position, velocity, kp, kd]
                .iter()
                .fold(0, |packed: u64, field| packed << 16 | u64::from(*field));
            CanFrame::classic(to(1, torque), packed.to_be_bytes())
        }
        Command::Enable => CanFrame::classic(to(3, from), [0; 8]),
        Command::Disable { clear_faults } => {
            CanFrame::classic(to(4, from), first(clear_faults.into()))
        }
        Command::SetZero => CanFrame::classic(to(6, from), first(1)),
        Command::SetId(new) => CanFrame::classic(to(7, u16::from(new.get()) << 8 | from), first(1)),
        Command::Read(index) => CanFrame::classic(to(KIND_READ, from), parameter(index, 0)),
        Command::Write(index, value) => CanFrame::classic(to(18, from), parameter(index, value)),
        Command::Save => CanFrame::classic(to(22, from), [1, 2, 3, 4, 5, 6, 7, 8]),
        Command::Report(on) => {
            CanFrame::classic(to(KIND_REPORT, from), [1, 2, 3, 4, 5, 6, on.into(), 0])
        }
    }
}

/// What a device says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Message {
    /// The unique number of its processor, as sent.
    Identity([u8; 8]),
    /// Feedback, in answer to any command. Temperature in steps of 0.1 degree Celsius.
    Feedback(Feedback),
    /// Value of a parameter, its bits.
    Parameter(u16, u32),
    /// It has no such parameter.
    NoParameter(u16),
    /// Faults and warnings, bit by bit; see [`faults`].
    Fault {
        /// Not zero: it has let go.
        faults: u32,
        /// It goes on.
        warnings: u32,
    },
}

/// What a device says and which; none if it is no frame of eight bytes from a device.
#[must_use]
pub fn message(frame: &CanFrame) -> Option<(Id, Message)> {
    let bytes: [u8; 8] = frame.classic_bytes()?;
    if !frame.id().is_extended() {
        return None;
    }
    let number = frame.id().number();
    let id = Id::new((number >> 8) as u8)?;
    let message = match number >> 24 {
        KIND_IDENTITY if number & 0xFF == 0xFE => Message::Identity(bytes),
        KIND_FEEDBACK | KIND_REPORT => Message::Feedback(feedback(number, bytes)),
        KIND_READ => {
            let [i0, i1, _, _, value @ ..] = bytes;
            let index = u16::from_le_bytes([i0, i1]);
            match number >> 16 & 0xFF {
                0 => Message::Parameter(index, u32::from_le_bytes(value)),
                _ => Message::NoParameter(index),
            }
        }
        KIND_FAULT => {
            let [f0, f1, f2, f3, warnings @ ..] = bytes;
            let faults = u32::from_le_bytes([f0, f1, f2, f3]);
            Message::Fault { faults, warnings: u32::from_le_bytes(warnings) }
        }
        _ => return None,
    };
    Some((id, message))
}

fn feedback(number: u32, [p1, p0, v1, v0, t1, t0, c1, c0]: [u8; 8]) -> Feedback {
    const RUNNING: u32 = 2;
    // Bit 20 is a Hall encoder's on CyberGear and a blocked motor's on RobStride.
    const BITS: [(u32, Faults); 6] = [
        (16, Faults::UNDER_VOLTAGE),
        (17, Faults::CURRENT),
        (18, Faults::HOT),
        (19, Faults::ENCODER),
        (20, Faults::ENCODER.and(Faults::OVERLOAD)),
        (21, Faults::NOT_CALIBRATED),
    ];
    let code = |high, low| Some(Number::Code { code: u16::from_be_bytes([high, low]), bits: 16 });
    Feedback {
        position: code(p1, p0),
        velocity: code(v1, v0),
        torque: code(t1, t0),
        temperature: Some(Number::Steps(i16::from_be_bytes([c1, c0]).into())),
        enabled: Some(number >> 22 & 3 == RUNNING),
        faults: Faults::of_bits(number, &BITS),
    }
}

/// The faults of [`Message::Fault`] in common words: the bits on which the families agree.
#[must_use]
pub fn faults(bits: u32) -> Faults {
    const BITS: [(u32, Faults); 9] = [
        (0, Faults::MOTOR_HOT),
        (1, Faults::DRIVER),
        (2, Faults::UNDER_VOLTAGE),
        (3, Faults::OVER_VOLTAGE),
        (4, Faults::CURRENT),
        (5, Faults::CURRENT),
        (7, Faults::NOT_CALIBRATED),
        (14, Faults::OVERLOAD),
        (16, Faults::CURRENT),
    ];
    let known = BITS.iter().fold(0, |mask, (bit, _)| mask | 1 << bit);
    let other = if bits & !known != 0 { Faults::OTHER } else { Faults::NONE };
    Faults::of_bits(bits, &BITS).and(other)
}

/// Indices of the parameters used here; `f32` where a unit stands.
pub mod parameter {
    /// 0 motion, 1 position, 2 speed, 3 current; one byte. Only while disabled.
    pub const RUN_MODE: u16 = 0x7005;
    /// Goal of run mode 2, rad/s.
    pub const SPEED_GOAL: u16 = 0x700A;
    /// Largest torque, N m.
    pub const TORQUE_LIMIT: u16 = 0x700B;
    /// Goal of run mode 1, rad.
    pub const POSITION_GOAL: u16 = 0x7016;
    /// Largest speed in run mode 1, rad/s.
    pub const SPEED_LIMIT: u16 = 0x7017;
    /// Position, rad. Read only.
    pub const POSITION: u16 = 0x7019;
    /// Velocity, rad/s. Read only.
    pub const VELOCITY: u16 = 0x701B;
    /// Supply voltage, V. Read only.
    pub const BUS_VOLTAGE: u16 = 0x701C;
    /// Silence of the host after which it lets go, in 50 us, four bytes; 0 = never. RobStride only.
    pub const CAN_TIMEOUT: u16 = 0x7028;
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wire::can::Format;

    fn said(command: Command) -> (u32, Vec<u8>) {
        let host = Id::new(0xFD).expect("an id");
        let frame = super::command(host, Id::new(0x7F).expect("an id"), command);
        assert!(frame.id().is_extended());
        (frame.id().number(), frame.payload().to_vec())
    }

    // Vectors after section 4.1 of the manual, worked out by hand.
    #[test]
    fn orders_carry_the_host_in_the_identifier() {
        let none = vec![0; 8];
        let first = vec![1, 0, 0, 0, 0, 0, 0, 0];
        assert_eq!(said(Command::Enable), (0x0300_FD7F, none.clone()));
        assert_eq!(said(Command::Disable { clear_faults: false }), (0x0400_FD7F, none.clone()));
        assert_eq!(said(Command::Disable { clear_faults: true }), (0x0400_FD7F, first.clone()));
        assert_eq!(said(Command::SetZero), (0x0600_FD7F, first.clone()));
        assert_eq!(said(Command::SetId(Id::new(1).expect("an id"))), (0x0701_FD7F, first));
        assert_eq!(said(Command::Identify), (0x0000_FD7F, none));
    }

    // Sections 4.1.11 and 4.1.13 of RobStride's manual.
    #[test]
    fn saving_and_reporting_spell_out_the_bytes_that_guard_them() {
        assert_eq!(said(Command::Save), (0x1600_FD7F, vec![1, 2, 3, 4, 5, 6, 7, 8]));
        assert_eq!(said(Command::Report(true)), (0x1800_FD7F, vec![1, 2, 3, 4, 5, 6, 1, 0]));
        assert_eq!(said(Command::Report(false)), (0x1800_FD7F, vec![1, 2, 3, 4, 5, 6, 0, 0]));
    }

    #[test]
    fn parameters_are_little_endian() {
        use parameter::*;
        let write = |index, value: f32| said(Command::Write(index, value.to_bits()));
        let expected = |kind, bytes: [u8; 8]| (kind, bytes.to_vec());
        let run_mode = said(Command::Write(RUN_MODE, 1));
        assert_eq!(run_mode, expected(0x1200_FD7F, [0x05, 0x70, 0, 0, 1, 0, 0, 0]));
        let goal = expected(0x1200_FD7F, [0x16, 0x70, 0, 0, 0, 0, 0x80, 0x3F]);
        assert_eq!(write(POSITION_GOAL, 1.0), goal);
        let limit = expected(0x1200_FD7F, [0x17, 0x70, 0, 0, 0, 0, 0, 0x40]);
        assert_eq!(write(SPEED_LIMIT, 2.0), limit);
        let read = expected(0x1100_FD7F, [0x19, 0x70, 0, 0, 0, 0, 0, 0]);
        assert_eq!(said(Command::Read(POSITION)), read);
        // 20000 is a second.
        let timeout = expected(0x1200_FD7F, [0x28, 0x70, 0, 0, 0xD0, 0x07, 0, 0]);
        assert_eq!(said(Command::Write(CAN_TIMEOUT, 2_000)), timeout);
    }

    #[test]
    fn motion_is_big_endian_with_the_torque_in_the_identifier() {
        let setpoint =
            Setpoint { position: 0x8A2F, velocity: 0x7FFF, kp: 0x1999, kd: 0x3333, torque: 0x7FFF };
        let bytes = vec![0x8A, 0x2F, 0x7F, 0xFF, 0x19, 0x99, 0x33, 0x33];
        assert_eq!(said(Command::Setpoint(setpoint)), (0x017F_FF7F, bytes));
    }

    fn heard(number: u32, bytes: &[u8]) -> Option<(Id, Message)> {
        let id = CanId::extended(number).expect("fits");
        message(&CanFrame::new(id, Format::Classic, bytes).expect("fits"))
    }

    #[test]
    fn feedback_tells_whose_it_is_in_the_identifier() {
        let bytes = [0x7F, 0xFE, 0x80, 0x73, 0x7F, 0xFF, 0x01, 0x18];
        let Some((id, Message::Feedback(feedback))) = heard(0x0200_0100, &bytes) else {
            panic!("feedback");
        };
        assert_eq!(id.get(), 1);
        assert_eq!(feedback.position, Some(Number::Code { code: 0x7FFE, bits: 16 }));
        assert_eq!(feedback.velocity, Some(Number::Code { code: 0x8073, bits: 16 }));
        assert_eq!(feedback.temperature, Some(Number::Steps(280)));
        assert_eq!((feedback.enabled, feedback.faults), (Some(false), Faults::NONE));
        assert_eq!(heard(0x0200_0100, &bytes[..7]), None);
    }

    #[test]
    fn mode_and_faults_stand_above_the_id() {
        let Some((id, Message::Feedback(feedback))) = heard(0x02A4_7FFD, &[0; 8]) else {
            panic!("feedback");
        };
        assert_eq!(id.get(), 0x7F);
        assert_eq!(feedback.enabled, Some(true));
        assert_eq!(feedback.faults, Faults::HOT.and(Faults::NOT_CALIBRATED));
    }

    #[test]
    fn answers_of_other_kinds_are_told_apart() {
        let value = heard(0x1100_7FFD, &[0x19, 0x70, 0, 0, 0, 0, 0x80, 0x3F]);
        let position = Message::Parameter(parameter::POSITION, 1.0_f32.to_bits());
        assert_eq!(value.map(|(_, message)| message), Some(position));
        let none = heard(0x1101_7FFD, &[0x28, 0x70, 0, 0, 0, 0, 0, 0]).map(|(_, m)| m);
        assert_eq!(none, Some(Message::NoParameter(parameter::CAN_TIMEOUT)));
        let fault = heard(0x1500_7FFD, &[0x01, 0, 0, 0, 0x02, 0, 0, 0]).map(|(_, m)| m);
        assert_eq!(fault, Some(Message::Fault { faults: 1, warnings: 2 }));
        let number = heard(0x0000_7FFE, &[1, 2, 3, 4, 5, 6, 7, 8]).map(|(_, m)| m);
        assert_eq!(number, Some(Message::Identity([1, 2, 3, 4, 5, 6, 7, 8])));
        assert_eq!(heard(0x0300_FD7F, &[0; 8]), None, "a host's own frame is no device's");
    }

    #[test]
    fn fault_bits_have_common_words_where_the_families_agree() {
        assert_eq!(faults(0), Faults::NONE);
        assert_eq!(faults(1 << 2 | 1 << 16), Faults::UNDER_VOLTAGE.and(Faults::CURRENT));
        assert_eq!(faults(1 << 14 | 1 << 7), Faults::OVERLOAD.and(Faults::NOT_CALIBRATED));
        assert_eq!(faults(1 << 9), Faults::OTHER);
    }

    #[test]
    fn feedback_told_unasked_is_feedback() {
        assert_eq!(heard(0x1880_7FFD, &[1; 8]), heard(0x0280_7FFD, &[1; 8]));
    }
}
