//! CubeMars (T-Motor) AK actuators. The firmware is set to one of two modes beforehand.
//!
//! - MIT mode: [`mit_command`] and [`mit_reply`], standard frames.
//! - Servo mode, kin to VESC: [`servo_command`] and [`servo_feedback`], extended frames with
//!   `packet << 8 | id`, numbers big-endian.
//!
//! `Feedback::torque` is a torque in MIT mode and the motor's current in servo mode.
//!
//! Source: CubeMars, "AK Series Actuator Driver Manual" 1.0.15, sections 5.1 and 5.2;
//! neurobionics/TMotorCANControl, `mit_can.py` and `servo_can.py`.

pub use super::mit::Setpoint;
use super::mit::{self, Order};
use super::{CanFrame, CanId, Faults, Feedback, Number};

/// A device id, 0 to 255.
pub type Id = crate::wire::Id<255>;

/// What MIT mode is told.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MitCommand {
    /// Drive from now on.
    Enable,
    /// Let go.
    Disable,
    /// The present position is zero. The actuator answers nothing for about a second afterwards.
    SetZero,
    /// Where to be.
    Setpoint(Setpoint),
}

/// A frame for MIT mode.
#[must_use]
pub fn mit_command(id: Id, command: MitCommand) -> CanFrame {
    let to = CanId::standard_of(id.get().into());
    match command {
        MitCommand::Enable => mit::order(to, Order::Enable),
        MitCommand::Disable => mit::order(to, Order::Disable),
        MitCommand::SetZero => mit::order(to, Order::SetZero),
        MitCommand::Setpoint(setpoint) => mit::setpoint(to, setpoint),
    }
}

/// The reply of MIT mode, and whose it is: that stands in the first byte, the identifier of the
/// frame is the master's. Older firmware leaves out temperature and fault.
#[must_use]
pub fn mit_reply(frame: &CanFrame) -> Option<(Id, Feedback)> {
    if frame.id().is_extended() {
        return None;
    }
    let [id, state @ ..] = frame.classic_bytes::<6>()?;
    let [position, velocity, torque] = mit::state(state).map(Some);
    let mut feedback = Feedback { position, velocity, torque, ..Feedback::default() };
    if let Some([_, _, _, _, _, _, celsius, code]) = frame.classic_bytes::<8>() {
        feedback.temperature = Some(Number::Steps(celsius.into()));
        feedback.faults = faults(code);
    }
    Some((Id::new(id)?, feedback))
}

/// What servo mode is told, in its own steps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ServoCommand {
    /// Share of the supply voltage, in 1e-5.
    Duty(i32),
    /// Motor current, in mA.
    Current(i32),
    /// Current that brakes, in mA.
    Brake(i32),
    /// Electrical speed, rev/min: the rotor's times pole pairs.
    Speed(i32),
    /// Position, in 1e-4 degree.
    Position(i32),
    /// The present position is zero: until power-off, or for good.
    SetOrigin {
        /// For good.
        kept: bool,
    },
    /// Position with a profile of speed.
    PositionSpeed {
        /// In 1e-4 degree.
        position: i32,
        /// Electrical, in 10 rev/min.
        speed: i16,
        /// Electrical, in 10 rev/min per second.
        acceleration: i16,
    },
}

/// A frame for servo mode.
#[must_use]
pub fn servo_command(id: Id, command: ServoCommand) -> CanFrame {
    let to = |packet: u32| CanId::extended_of(packet << 8 | u32::from(id.get()));
    match command {
        ServoCommand::Duty(x) => CanFrame::classic(to(0), x.to_be_bytes()),
        ServoCommand::Current(x) => CanFrame::classic(to(1), x.to_be_bytes()),
        ServoCommand::Brake(x) => CanFrame::classic(to(2), x.to_be_bytes()),
        ServoCommand::Speed(x) => CanFrame::classic(to(3), x.to_be_bytes()),
        ServoCommand::Position(x) => CanFrame::classic(to(4), x.to_be_bytes()),
        ServoCommand::SetOrigin { kept } => CanFrame::classic(to(5), [kept.into()]),
        ServoCommand::PositionSpeed { position, speed, acceleration } => {
            let packed = u64::from(position.cast_unsigned()) << 32
                | u64::from(speed.cast_unsigned()) << 16
                | u64::from(acceleration.cast_unsigned());
            CanFrame::classic(to(6), packed.to_be_bytes())
        }
    }
}

/// What servo mode tells at a steady rate without being asked, and whose it is. Steps: 0.1 degree,
/// 10 electrical rev/min, 0.01 A, 1 degree Celsius.
#[must_use]
pub fn servo_feedback(frame: &CanFrame) -> Option<(Id, Feedback)> {
    const STATUS: u32 = 0x29;
    if !frame.id().is_extended() || frame.id().number() >> 8 != STATUS {
        return None;
    }
    let [p1, p0, v1, v0, i1, i0, celsius, code] = frame.classic_bytes()?;
    let steps = |high, low| Some(Number::Steps(i16::from_be_bytes([high, low]).into()));
    let feedback = Feedback {
        position: steps(p1, p0),
        velocity: steps(v1, v0),
        torque: steps(i1, i0),
        temperature: Some(Number::Steps(celsius.cast_signed().into())),
        enabled: None,
        faults: faults(code),
    };
    Some((Id::new(frame.id().number() as u8)?, feedback))
}

/// Codes 0 to 7. Of 6 the sources disagree (unbalanced phases, or the power stage too hot); both
/// are its driver's. The temperature it tells, and 1 is about, is the driver board's.
const fn faults(code: u8) -> Faults {
    match code {
        0 => Faults::NONE,
        1 => Faults::HOT,
        2 => Faults::CURRENT,
        3 => Faults::OVER_VOLTAGE,
        4 => Faults::UNDER_VOLTAGE,
        5 => Faults::ENCODER,
        6 => Faults::DRIVER,
        7 => Faults::OVERLOAD,
        _ => Faults::OTHER,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wire::can::Format;

    fn id(number: u8) -> Id {
        Id::new(number).expect("an id")
    }

    fn frame(id: CanId, payload: &[u8]) -> CanFrame {
        CanFrame::new(id, Format::Classic, payload).expect("fits")
    }

    #[test]
    fn the_mit_orders_are_seven_times_ff_and_a_number() {
        for (command, last) in
            [(MitCommand::Enable, 0xFC), (MitCommand::Disable, 0xFD), (MitCommand::SetZero, 0xFE)]
        {
            let frame = mit_command(id(5), command);
            assert!(frame.id().is_standard(5));
            assert_eq!(frame.payload(), [0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, last]);
        }
    }

    #[test]
    fn a_mit_reply_is_his_whose_number_it_begins_with() {
        let whole = [0x03, 0x8A, 0x3C, 0x7F, 0xF7, 0xFF, 0x23, 0x01];
        let (whose, feedback) = mit_reply(&frame(CanId::standard_of(0), &whole)).expect("a reply");
        assert_eq!(whose, id(3));
        assert_eq!(feedback.position, Some(Number::Code { code: 0x8A3C, bits: 16 }));
        assert_eq!(feedback.velocity, Some(Number::Code { code: 0x7FF, bits: 12 }));
        assert_eq!(feedback.torque, Some(Number::Code { code: 0x7FF, bits: 12 }));
        assert_eq!(feedback.temperature, Some(Number::Steps(35)));
        assert_eq!(feedback.faults, Faults::HOT);
    }

    #[test]
    fn six_bytes_are_a_mit_reply_of_older_firmware_and_five_are_none() {
        let whole = [0x03, 0x8A, 0x3C, 0x7F, 0xF7, 0xFF];
        let (_, feedback) = mit_reply(&frame(CanId::standard_of(0), &whole)).expect("a reply");
        assert_eq!(feedback.temperature, None);
        assert!(feedback.position.is_some());
        assert_eq!(mit_reply(&frame(CanId::standard_of(0), &whole[..5])), None);
    }

    // The maker's manual, section 5.1, numbers worked out by hand.
    #[test]
    fn servo_commands_are_big_endian_behind_packet_and_id() {
        for (command, number, payload) in [
            (ServoCommand::Position(900_000), 0x0401, &[0x00, 0x0D, 0xBB, 0xA0][..]),
            (ServoCommand::Speed(1000), 0x0301, &[0x00, 0x00, 0x03, 0xE8]),
            (ServoCommand::Current(-1), 0x0101, &[0xFF, 0xFF, 0xFF, 0xFF]),
            (ServoCommand::SetOrigin { kept: true }, 0x0501, &[1]),
            (
                ServoCommand::PositionSpeed { position: 900_000, speed: 500, acceleration: 300 },
                0x0601,
                &[0x00, 0x0D, 0xBB, 0xA0, 0x01, 0xF4, 0x01, 0x2C],
            ),
            (
                ServoCommand::PositionSpeed { position: -1, speed: -1, acceleration: 1 },
                0x0601,
                &[0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0x00, 0x01],
            ),
        ] {
            let frame = servo_command(id(1), command);
            assert_eq!(Some(frame.id()), CanId::extended(number));
            assert_eq!(frame.payload(), payload, "{command:?}");
        }
    }

    #[test]
    fn servo_feedback_is_told_by_packet_0x29() {
        let bytes = [0x03, 0x84, 0x00, 0x64, 0x00, 0x32, 0x23, 0x00];
        let whole = frame(CanId::extended_of(0x2901), &bytes);
        let (whose, feedback) = servo_feedback(&whole).expect("feedback");
        assert_eq!(whose, id(1));
        assert_eq!(feedback.position, Some(Number::Steps(900)));
        assert_eq!(feedback.velocity, Some(Number::Steps(100)));
        assert_eq!(feedback.torque, Some(Number::Steps(50)));
        assert_eq!(feedback.temperature, Some(Number::Steps(35)));
        assert!(feedback.faults.is_none());
        assert_eq!(servo_feedback(&frame(CanId::extended_of(0x2801), &bytes)), None);
        assert_eq!(servo_feedback(&frame(CanId::extended_of(0x2901), &bytes[..7])), None);
    }
}
