//! Recoil, the motor controller of Berkeley Humanoid Lite: standard frames in the manner of
//! CANopen, `function << 7 | id`, little-endian numbers in radians of the output.
//!
//! A setpoint is answered with the state at once, and feeds the device's watchdog. Gains, limits
//! and the watchdog's length are parameters, told by where they lie in the firmware's memory. An
//! answer to [`Command::Read`] holds the value alone: whose it is must be remembered.
//!
//! Source: uncertainty-cc/Recoil-Motor-Controller, `motor_controller.c`, `handleCANMessage` and
//! `handleSDO`; HybridRobotics/Berkeley-Humanoid-Lite-Lowlevel 08091ced, `recoil/core.py`.

use super::{CanFrame, CanId, Faults, Feedback, Number};

/// A device id, 0 to 127; 0 means every device.
pub type Id = crate::wire::Id<127>;

/// What a device is set to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// Lets go, and asks to be idle before it drives.
    Disabled = 0x00,
    /// Lets go.
    Idle = 0x01,
    /// Brakes, and heeds no goal.
    Damping = 0x02,
    /// Heeds torques.
    Torque = 0x11,
    /// Heeds velocities.
    Velocity = 0x12,
    /// Heeds positions.
    Position = 0x13,
}

/// What a device is told.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Command {
    /// What to do from now on. Not answered.
    Mode(Mode),
    /// Where to be, rad, and how fast, rad/s; answered with position and velocity.
    PositionVelocity(f32, f32),
    /// Where to be, rad, and a torque added, N m; answered with position and torque.
    PositionTorque(f32, f32),
    /// The host is there: feeds the watchdog. Not answered.
    Feed,
    /// Say these bytes; feeds the watchdog.
    Echo([u8; 8]),
    /// The value of a [`parameter`].
    Read(u16),
    /// Sets a [`parameter`] until power-off: an `f32`'s bits, or an integer. Not answered.
    Write(u16, u32),
    /// Keeps all parameters over power-off.
    Save,
}

/// Numbers of the messages, host to device but for those that are told apart in [`message`].
const MODE: u32 = 0x0;
const ECHOED: u32 = 0x3;
const ECHO: u32 = 0x4;
const STATE: u32 = 0x5;
const POSITION_VELOCITY: u32 = 0x6;
const STATE_WITH_TORQUE: u32 = 0x7;
const POSITION_TORQUE: u32 = 0x8;
const STATE_UNASKED: u32 = 0x9;
const VALUE: u32 = 0xB;
const PARAMETER: u32 = 0xC;
const MEMORY: u32 = 0xD;
const FEED: u32 = 0xE;

/// In the first byte of a parameter's frame.
const WRITE: u8 = 1 << 5;
const READ: u8 = 2 << 5;

/// A frame to one device.
#[must_use]
pub fn command(id: Id, command: Command) -> CanFrame {
    let to = |function: u32| CanId::standard_of(function << 7 | u32::from(id.get()));
    let floats = |first: f32, second: f32| {
        (u64::from(first.to_bits()) | u64::from(second.to_bits()) << 32).to_le_bytes()
    };
    match command {
        Command::Mode(mode) => CanFrame::classic(to(MODE), [mode as u8, id.get()]),
        Command::PositionVelocity(position, velocity) => {
            CanFrame::classic(to(POSITION_VELOCITY), floats(position, velocity))
        }
        Command::PositionTorque(position, torque) => {
            CanFrame::classic(to(POSITION_TORQUE), floats(position, torque))
        }
        Command::Feed => CanFrame::classic(to(FEED), []),
        Command::Echo(bytes) => CanFrame::classic(to(ECHO), bytes),
        Command::Read(number) => {
            let [low, high] = number.to_le_bytes();
            CanFrame::classic(to(PARAMETER), [READ, low, high])
        }
        Command::Write(number, value) => {
            let [low, high] = number.to_le_bytes();
            let [v0, v1, v2, v3] = value.to_le_bytes();
            CanFrame::classic(to(PARAMETER), [WRITE, low, high, 0, v0, v1, v2, v3])
        }
        Command::Save => CanFrame::classic(to(MEMORY), [1]),
    }
}

/// What a device says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Message {
    /// Position, rad, with velocity, rad/s, or torque, N m. It does not tell of faults.
    Feedback(Feedback),
    /// The value of the parameter last read, its bits.
    Parameter(u32),
    /// What it was told to say.
    Echo([u8; 8]),
}

/// What a device says and which; none for what a host says.
#[must_use]
pub fn message(frame: &CanFrame) -> Option<(Id, Message)> {
    if frame.id().is_extended() {
        return None;
    }
    let pair = || {
        let [p0, p1, p2, p3, second @ ..] = frame.classic_bytes::<8>()?;
        let value = |bytes| Some(Number::Value(f32::from_le_bytes(bytes)));
        Some([value([p0, p1, p2, p3]), value(second)])
    };
    let message = match frame.id().number() >> 7 {
        STATE | STATE_UNASKED => {
            let [position, velocity] = pair()?;
            Message::Feedback(Feedback { position, velocity, ..Feedback::default() })
        }
        STATE_WITH_TORQUE => {
            let [position, torque] = pair()?;
            Message::Feedback(Feedback { position, torque, ..Feedback::default() })
        }
        VALUE => Message::Parameter(u32::from_le_bytes(frame.classic_bytes()?)),
        ECHOED => Message::Echo(frame.classic_bytes()?),
        _ => return None,
    };
    Some((Id::new(frame.id().number() as u8 & 0x7F)?, message))
}

/// Whether a device in this mode drives its motor, given the bits of [`parameter::MODE`].
#[must_use]
pub const fn drives(mode: u32) -> bool {
    matches!(mode & 0xFF, 0x02 | 0x05 | 0x10..=0x13 | 0x20..=0x22)
}

/// The bits of [`parameter::ERROR`] in common words.
#[must_use]
pub fn faults(error: u32) -> Faults {
    const BITS: [(u32, Faults); 12] = [
        (0, Faults::OTHER),
        (1, Faults::OTHER),
        (2, Faults::OTHER),
        (3, Faults::NOT_CALIBRATED),
        (4, Faults::DRIVER),
        (5, Faults::OTHER),
        (6, Faults::SILENCE),
        (7, Faults::OVER_VOLTAGE),
        (8, Faults::CURRENT),
        (9, Faults::HOT),
        (10, Faults::OTHER),
        (11, Faults::ENCODER),
    ];
    let other = if error >> BITS.len() != 0 { Faults::OTHER } else { Faults::NONE };
    Faults::of_bits(error, &BITS).and(other)
}

/// Numbers of the parameters used here; `f32` where a unit stands.
pub mod parameter {
    /// Id it listens to, an integer.
    pub const DEVICE_ID: u16 = 0x000;
    /// Date of the firmware as hexadecimal digits, `0x20250226`.
    pub const FIRMWARE: u16 = 0x004;
    /// Silence of the host after which it brakes, ms, an integer. Heeded from the next start on.
    pub const WATCHDOG: u16 = 0x008;
    /// How often it tells its state unasked, Hz, an integer; 0 = never.
    pub const UNASKED_RATE: u16 = 0x00C;
    /// What it is doing, an integer; see [`super::Mode`].
    pub const MODE: u16 = 0x010;
    /// What is wrong, bit by bit; see [`super::faults`].
    pub const ERROR: u16 = 0x014;
    /// Turns of the rotor in one of the output; negative where it is mounted the other way round.
    pub const GEAR_RATIO: u16 = 0x01C;
    /// Gain on the error of position, N m/rad.
    pub const KP: u16 = 0x020;
    /// Gain on the integral of the error of position, N m/(rad s).
    pub const KI: u16 = 0x024;
    /// Gain on the error of velocity, N m s/rad.
    pub const KD: u16 = 0x028;
    /// Largest torque, N m.
    pub const TORQUE_LIMIT: u16 = 0x030;
    /// Largest velocity, rad/s.
    pub const VELOCITY_LIMIT: u16 = 0x034;
    /// Least position, rad.
    pub const LOWER_LIMIT: u16 = 0x038;
    /// Greatest position, rad.
    pub const UPPER_LIMIT: u16 = 0x03C;
    /// Torque, N m. Read only.
    pub const TORQUE: u16 = 0x048;
    /// Velocity, rad/s. Read only.
    pub const VELOCITY: u16 = 0x054;
    /// Position, rad. Read only.
    pub const POSITION: u16 = 0x060;
    /// Supply voltage, V. Read only.
    pub const BUS_VOLTAGE: u16 = 0x100;
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wire::can::Format;

    fn id(number: u8) -> Id {
        Id::new(number).expect("an id")
    }

    // Vectors after `recoil/core.py`, whose `struct` formats were worked out by hand.
    #[test]
    fn commands_stand_behind_function_and_id() {
        let p_1_v_minus_2 = [0, 0, 0x80, 0x3F, 0, 0, 0, 0xC0];
        for (command, number, payload) in [
            (Command::Mode(Mode::Position), 0x00B, &[0x13, 11][..]),
            (Command::Mode(Mode::Damping), 0x00B, &[0x02, 11]),
            (Command::PositionVelocity(1.0, -2.0), 0x30B, &p_1_v_minus_2),
            (Command::PositionTorque(1.0, -2.0), 0x40B, &p_1_v_minus_2),
            (Command::Feed, 0x70B, &[]),
            (Command::Echo([0xCA, 0, 0, 0, 0, 0, 0, 1]), 0x20B, &[0xCA, 0, 0, 0, 0, 0, 0, 1]),
            (Command::Read(parameter::BUS_VOLTAGE), 0x60B, &[0x40, 0x00, 0x01]),
            (
                Command::Write(parameter::KP, 20.0_f32.to_bits()),
                0x60B,
                &[0x20, 0x20, 0x00, 0x00, 0x00, 0x00, 0xA0, 0x41],
            ),
            (Command::Save, 0x68B, &[1]),
        ] {
            let frame = super::command(id(11), command);
            assert!(frame.id().is_standard(number), "{command:?} {frame:?}");
            assert_eq!(frame.payload(), payload, "{command:?}");
        }
    }

    fn heard(number: u32, payload: &[u8]) -> Option<(Id, Message)> {
        message(&CanFrame::new(CanId::standard_of(number), Format::Classic, payload).expect("fits"))
    }

    #[test]
    fn a_state_tells_velocity_or_torque_by_its_function() {
        let bytes = [0, 0, 0x80, 0xBE, 0, 0, 0, 0x40];
        let Some((whose, Message::Feedback(feedback))) = heard(0x28B, &bytes) else {
            panic!("feedback");
        };
        assert_eq!(whose, id(11));
        assert_eq!(feedback.position, Some(Number::Value(-0.25)));
        assert_eq!((feedback.velocity, feedback.torque), (Some(Number::Value(2.0)), None));
        assert_eq!(feedback.enabled, None, "it does not say");
        let Some((_, Message::Feedback(feedback))) = heard(0x38B, &bytes) else {
            panic!("feedback");
        };
        assert_eq!((feedback.velocity, feedback.torque), (None, Some(Number::Value(2.0))));
        assert_eq!(heard(0x48B, &bytes), heard(0x28B, &bytes), "told unasked");
        assert_eq!(heard(0x28B, &bytes[..7]), None, "too short");
        assert_eq!(heard(0x30B, &bytes), None, "a host's own frame is no device's");
    }

    #[test]
    fn a_value_comes_without_its_number() {
        let volt = 24.0_f32.to_bits();
        assert_eq!(heard(0x58B, &volt.to_le_bytes()), Some((id(11), Message::Parameter(volt))));
        assert_eq!(heard(0x58B, &[0x60]), None, "too short to be a value");
        let echo = Message::Echo([0xCA, 1, 2, 3, 4, 5, 6, 7]);
        assert_eq!(heard(0x18B, &[0xCA, 1, 2, 3, 4, 5, 6, 7]), Some((id(11), echo)));
    }

    #[test]
    fn errors_have_common_words() {
        assert_eq!(faults(0), Faults::NONE);
        assert_eq!(faults(0x40), Faults::SILENCE);
        assert_eq!(faults(0x380), Faults::OVER_VOLTAGE.and(Faults::CURRENT).and(Faults::HOT));
        assert_eq!(faults(0x8000_0000), Faults::OTHER);
        assert!(drives(Mode::Position as u32) && drives(Mode::Damping as u32));
        assert!(!drives(Mode::Idle as u32) && !drives(Mode::Disabled as u32));
    }
}
