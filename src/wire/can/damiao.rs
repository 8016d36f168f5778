//! Damiao DM actuators, classic CAN at 1 Mbit/s.
//!
//! A device listens to its own id, to its id plus a number per control mode, and to 0x7FF for
//! registers. It answers each frame with one frame under its master id (register 7), whose first
//! byte names it by the low four bits of its id: with a shared master id, ids must differ there.
//!
//! Source: Damiao, "DM-J4310-2EC user manual" V1.0; cmjang/DM_Control_Python, `DM_CAN.py`;
//! huggingface/lerobot 7427f318, `motors/damiao`; jia-xie/damiao-motor 1.0.6, its register table.

pub use super::mit::Setpoint;
use super::mit::{self, Order};
use super::{CanFrame, CanId, Faults, Feedback, Number};

/// A device id, 0 to 255: a larger one would collide with the numbers of the modes.
pub type Id = crate::wire::Id<255>;

/// Where registers are asked for.
const REGISTERS: u32 = 0x7FF;

/// What a device is told. The last four need the matching control mode in [`register::CTRL_MODE`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Command {
    /// Drive from now on.
    Enable,
    /// Let go.
    Disable,
    /// The present position is zero, for good.
    SetZero,
    /// Forget a fault.
    ClearFaults,
    /// Mode 1.
    Setpoint(Setpoint),
    /// Mode 2: a position, rad, to be reached at no more than a speed, rad/s.
    PositionVelocity {
        /// rad
        position: f32,
        /// rad/s
        speed: f32,
    },
    /// Mode 3: a velocity, rad/s.
    Velocity(f32),
    /// Mode 4: a position with limits on speed and current.
    PositionForce {
        /// rad
        position: f32,
        /// In 0.01 rad/s, to 10000.
        speed: u16,
        /// Share of the largest current, in 1e-4, to 10000.
        current: u16,
    },
}

/// A frame to one device.
#[must_use]
pub fn command(id: Id, command: Command) -> CanFrame {
    let to = |mode: u32| CanId::standard_of(mode + u32::from(id.get()));
    match command {
        Command::Enable => mit::order(to(0), Order::Enable),
        Command::Disable => mit::order(to(0), Order::Disable),
        Command::SetZero => mit::order(to(0), Order::SetZero),
        Command::ClearFaults => mit::order(to(0), Order::ClearFaults),
        Command::Setpoint(setpoint) => mit::setpoint(to(0), setpoint),
        Command::PositionVelocity { position, speed } => {
            CanFrame::classic(to(0x100), two(position, speed))
        }
        Command::Velocity(velocity) => CanFrame::classic(to(0x200), two(velocity, 0.0)),
        Command::PositionForce { position, speed, current } => {
            let limits = u32::from(speed.min(10_000)) | u32::from(current.min(10_000)) << 16;
            CanFrame::classic(to(0x300), two(position, f32::from_bits(limits)))
        }
    }
}

/// Two words, little-endian.
fn two(first: f32, second: f32) -> [u8; 8] {
    (u64::from(first.to_bits()) | u64::from(second.to_bits()) << 32).to_le_bytes()
}

/// What is asked of a device's registers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Request {
    /// Feedback now, without a command.
    Feedback,
    /// The value of a register.
    Read(u8),
    /// Writes a register until power-off. Which hold an `f32` is told by [`register::is_integer`].
    Write(u8, u32),
    /// Keeps all registers over power-off. Only while disabled.
    Save,
}

/// A frame about registers.
#[must_use]
pub fn request(id: Id, request: Request) -> CanFrame {
    let (what, number, value) = match request {
        Request::Feedback => (0xCC, 0, 0),
        Request::Read(number) => (0x33, number, 0),
        Request::Write(number, value) => (0x55, number, value),
        Request::Save => (0xAA, 0x01, 0),
    };
    let [v0, v1, v2, v3] = u32::to_le_bytes(value);
    let payload = [id.get(), 0, what, number, v0, v1, v2, v3];
    CanFrame::classic(CanId::standard_of(REGISTERS), payload)
}

/// The value device `id` gives for register `number` under its master id, after a read or a write.
///
/// Nothing but the bytes tells such an answer from feedback: ask this only after a request.
#[must_use]
pub fn register_value(id: Id, master: u16, number: u8, frame: &CanFrame) -> Option<u32> {
    let [low, high, what, register, value @ ..] = from_master(master, frame)?;
    let matches = [low, high] == [id.get(), 0] && matches!(what, 0x33 | 0x55);
    (matches && register == number).then_some(u32::from_le_bytes(value))
}

/// What device `id` answers under its master id to any command.
///
/// Of temperatures the power stage's is given; the rotor's stands in the last byte.
#[must_use]
pub fn feedback(id: Id, master: u16, frame: &CanFrame) -> Option<Feedback> {
    let [who, p1, p0, v, vt, t, stage_celsius, _rotor_celsius] = from_master(master, frame)?;
    if who & 0x0F != id.get() & 0x0F {
        return None;
    }
    let [position, velocity, torque] = mit::state([p1, p0, v, vt, t]).map(Some);
    let state = who >> 4;
    Some(Feedback {
        position,
        velocity,
        torque,
        temperature: Some(Number::Steps(stage_celsius.into())),
        enabled: Some(state == 1),
        faults: faults(state),
    })
}

fn from_master(master: u16, frame: &CanFrame) -> Option<[u8; 8]> {
    if frame.id().is_standard(master.into()) { frame.classic_bytes() } else { None }
}

const fn faults(state: u8) -> Faults {
    match state {
        0 | 1 => Faults::NONE,
        0x8 => Faults::OVER_VOLTAGE,
        0x9 => Faults::UNDER_VOLTAGE,
        0xA => Faults::CURRENT,
        0xB => Faults::HOT,
        0xC => Faults::MOTOR_HOT,
        0xD => Faults::SILENCE,
        0xE => Faults::OVERLOAD,
        _ => Faults::OTHER,
    }
}

/// Numbers of the registers, `f32` where a unit stands, else integers.
pub mod register {
    /// Least supply voltage, V.
    pub const UNDER_VOLTAGE: u8 = 0;
    /// Temperature at which it lets go, degrees Celsius.
    pub const OVER_TEMPERATURE: u8 = 2;
    /// Acceleration in modes 2 and 3, rad/s2.
    pub const ACCELERATION: u8 = 4;
    /// Deceleration in modes 2 and 3, rad/s2; below zero.
    pub const DECELERATION: u8 = 5;
    /// Largest speed in modes 2 and 3, rad/s.
    pub const SPEED_LIMIT: u8 = 6;
    /// Id the device answers under.
    pub const MST_ID: u8 = 7;
    /// Id the device listens to.
    pub const ESC_ID: u8 = 8;
    /// Silence of the host after which the device lets go, in 50 us; 0 = never.
    pub const TIMEOUT: u8 = 9;
    /// Control mode, 1 to 4.
    pub const CTRL_MODE: u8 = 10;
    /// Version of the firmware.
    pub const SOFTWARE: u8 = 14;
    /// Turns of the rotor in one of the output, a ratio as `f32`.
    pub const GEAR_RATIO: u8 = 20;
    /// End of the range of position, rad.
    pub const PMAX: u8 = 21;
    /// End of the range of velocity, rad/s.
    pub const VMAX: u8 = 22;
    /// End of the range of torque, N m.
    pub const TMAX: u8 = 23;
    /// Bit rate, 0 to 9: 125, 200, 250, 500 kbit/s, 1, 2, 2.5, 3.2, 4, 5 Mbit/s.
    pub const BIT_RATE: u8 = 35;
    /// Supply voltage, V. Read only, newer firmware.
    pub const BUS_VOLTAGE: u8 = 60;

    /// True for a register that holds an integer; the others hold an `f32`.
    #[must_use]
    pub const fn is_integer(number: u8) -> bool {
        matches!(number, 7..=10 | 13..=16 | 35 | 36)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wire::can::Format;

    const ONE: Id = match Id::new(1) {
        Some(id) => id,
        None => unreachable!(),
    };

    fn frame_of(number: u32, payload: &[u8]) -> Option<CanFrame> {
        CanFrame::new(CanId::standard(number)?, Format::Classic, payload)
    }

    fn said(frame: CanFrame) -> (u32, Vec<u8>) {
        assert!(!frame.id().is_extended());
        (frame.id().number(), frame.payload().to_vec())
    }

    // Vectors from cmjang/DM_Control_Python, `DM_CAN.py`, worked out by hand.
    #[test]
    fn registers_are_asked_for_under_0x7ff() {
        for (request, bytes) in [
            (Request::Feedback, [0x01, 0, 0xCC, 0, 0, 0, 0, 0]),
            (Request::Read(register::PMAX), [0x01, 0, 0x33, 0x15, 0, 0, 0, 0]),
            (Request::Write(register::CTRL_MODE, 2), [0x01, 0, 0x55, 0x0A, 2, 0, 0, 0]),
            // 20 ms of silence in steps of 50 us: 400.
            (Request::Write(register::TIMEOUT, 400), [0x01, 0, 0x55, 0x09, 0x90, 0x01, 0, 0]),
            (Request::Save, [0x01, 0, 0xAA, 0x01, 0, 0, 0, 0]),
        ] {
            assert_eq!(said(super::request(ONE, request)), (0x7FF, bytes.to_vec()), "{request:?}");
        }
    }

    #[test]
    fn each_mode_has_its_own_identifier() {
        let all = |number, bytes: [u8; 8]| (number, bytes.to_vec());
        let go = Command::PositionVelocity { position: 1.0, speed: 2.0 };
        let expected = all(0x101, [0, 0, 0x80, 0x3F, 0, 0, 0, 0x40]);
        assert_eq!(said(command(ONE, go)), expected);
        let expected = all(0x201, [0, 0, 0, 0xC0, 0, 0, 0, 0]);
        assert_eq!(said(command(ONE, Command::Velocity(-2.0))), expected);
        let go = Command::PositionForce { position: 1.0, speed: 500, current: 20_000 };
        let expected = all(0x301, [0, 0, 0x80, 0x3F, 0xF4, 0x01, 0x10, 0x27]);
        assert_eq!(said(command(ONE, go)), expected);
        let expected = all(1, [0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFB]);
        assert_eq!(said(command(ONE, Command::ClearFaults)), expected);
    }

    #[test]
    fn feedback_is_found_by_master_id_and_low_nibble() {
        let bytes = [0x11, 0x7F, 0xFF, 0x7F, 0xF7, 0xFF, 0x23, 0x1E];
        let frame = frame_of(0x11, &bytes).expect("fits");
        let feedback = super::feedback(ONE, 0x11, &frame).expect("feedback");
        assert_eq!(feedback.position, Some(Number::Code { code: 0x7FFF, bits: 16 }));
        assert_eq!(feedback.torque, Some(Number::Code { code: 0x7FF, bits: 12 }));
        assert_eq!(feedback.temperature, Some(Number::Steps(35)));
        assert_eq!((feedback.enabled, feedback.faults), (Some(true), Faults::NONE));
        let two = Id::new(2).expect("an id");
        assert_eq!(super::feedback(two, 0x11, &frame), None);
        assert_eq!(super::feedback(ONE, 0x12, &frame), None);
        assert_eq!(super::feedback(ONE, 0x11, &frame_of(0x11, &bytes[..7]).expect("fits")), None);
    }

    #[test]
    fn the_high_nibble_is_the_state_or_the_fault() {
        for (first, enabled, faults) in [
            (0x01, false, Faults::NONE),
            (0x11, true, Faults::NONE),
            (0xD1, false, Faults::SILENCE),
            (0x91, false, Faults::UNDER_VOLTAGE),
            (0x71, false, Faults::OTHER),
        ] {
            let frame = frame_of(0, &[first, 0, 0, 0, 0, 0, 0, 0]).expect("fits");
            let feedback = super::feedback(ONE, 0, &frame).expect("feedback");
            assert_eq!((feedback.enabled, feedback.faults), (Some(enabled), faults));
        }
    }

    #[test]
    fn a_register_value_is_taken_only_for_the_register_asked() {
        let bytes = [1, 0, 0x33, register::PMAX, 0, 0, 0x48, 0x41];
        let frame = frame_of(0x11, &bytes).expect("fits");
        let value = register_value(ONE, 0x11, register::PMAX, &frame);
        assert_eq!(value.map(f32::from_bits), Some(12.5));
        assert_eq!(register_value(ONE, 0x11, register::VMAX, &frame), None);
    }
}
