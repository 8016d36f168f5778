//! Raw counts to SI and back, by a servo's profile. The only place that knows scale factors.

use crate::bus;
use crate::error::counted;
use core::f64::consts::{PI, TAU};
use gaitway_profiles::{Encoding, Protocol, Register, Role, Servo, Unit};
use std::fmt;

/// A servo model: its profile seen through SI units.
#[derive(Clone, Copy, Debug)]
pub struct Model {
    servo: &'static Servo,
}

/// A value that does not fit its register, or a register the model does not have.
#[derive(Clone, Debug, PartialEq)]
pub enum RegisterError {
    /// No register of this model plays that role.
    NoSuchRole {
        /// Servo profile.
        servo: String,
        /// What was looked for.
        role: Role,
    },
    /// The value cannot be written in the register's bytes.
    OutOfRange {
        /// The vendor's name of the register.
        register: String,
        /// Raw value.
        raw: f64,
        /// Lowest raw value.
        min: i64,
        /// Highest raw value.
        max: i64,
    },
    /// Fewer bytes than the register has.
    Short {
        /// The vendor's name of the register.
        register: String,
        /// Bytes given.
        got: usize,
        /// Bytes wanted.
        wanted: usize,
    },
}

impl fmt::Display for RegisterError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoSuchRole { servo, role } => write!(f, "{servo} has no register for {role:?}"),
            Self::OutOfRange { register, raw, min, max } => {
                write!(f, "{register}: raw value {raw} is outside {min} to {max}")
            }
            Self::Short { register, got, wanted } => {
                write!(f, "{register}: {got}, {wanted} wanted", got = counted(got, "byte"))
            }
        }
    }
}

impl std::error::Error for RegisterError {}

/// What a profile's protocol is on a bus.
pub(super) const fn spoken(protocol: Protocol) -> bus::Protocol {
    match protocol {
        Protocol::Dynamixel1 => bus::Protocol::Dynamixel1,
        Protocol::Dynamixel2 => bus::Protocol::Dynamixel2,
        Protocol::FeetechSts => bus::Protocol::FeetechSts,
        Protocol::FeetechScs => bus::Protocol::FeetechScs,
    }
}

impl Model {
    /// The model described by `servo`.
    #[must_use]
    pub const fn new(servo: &'static Servo) -> Self {
        Self { servo }
    }

    /// The profile.
    #[must_use]
    pub const fn profile(&self) -> &'static Servo {
        self.servo
    }

    /// True if a goal switches the torque of a servo on that has none. (Dynamixel 1.0: told by users
    /// of AX and MX servos; Dynamixel 2.0 only in a drive mode that preflight refuses; FEETECH: not
    /// confirmed by the maker, whose tables have a register for it.)
    #[must_use]
    pub fn goal_switches_torque_on(&self) -> bool {
        self.protocol() == bus::Protocol::Dynamixel1
    }

    /// What the bus has to speak to a servo of this model.
    #[must_use]
    pub const fn protocol(&self) -> bus::Protocol {
        spoken(self.servo.protocol)
    }

    /// Byte order is a property of the protocol: of these, only SCS sends the high byte first.
    const fn big_endian(&self) -> bool {
        matches!(self.servo.protocol, Protocol::FeetechScs)
    }

    /// The register for `role`.
    ///
    /// # Errors
    /// [`RegisterError::NoSuchRole`].
    pub fn register(&self, role: Role) -> Result<&'static Register, RegisterError> {
        self.servo
            .register(role)
            .ok_or_else(|| RegisterError::NoSuchRole { servo: self.servo.name.clone(), role })
    }

    /// The register that opens (0) and closes (1) what the servo keeps at power-off.
    ///
    /// Feetech only: a Dynamixel's Lock(47) cannot be opened again before its power goes off
    /// (e-Manual, AX-12A), so it is never closed.
    #[must_use]
    pub fn eeprom_lock(&self) -> Option<&'static Register> {
        let feetech = matches!(self.servo.protocol, Protocol::FeetechSts | Protocol::FeetechScs);
        self.servo.register(Role::EepromLock).filter(|_| feetech)
    }

    /// Angle of one count of a position register, rad.
    #[must_use]
    pub fn rad_per_count(&self) -> f64 {
        let position = &self.servo.position;
        f64::from(position.degrees) / f64::from(position.counts) * PI / 180.0
    }

    /// SI value of one raw count of `register`, without any zero.
    fn scale(&self, register: &Register) -> f64 {
        let per_count = register.scale.unwrap_or(1.0);
        match register.unit {
            Unit::Turn | Unit::TurnRelative | Unit::CountPerSecond | Unit::CountPerSecond2 => {
                per_count * self.rad_per_count()
            }
            Unit::Rpm => per_count * TAU / 60.0,
            Unit::Rpm2 => per_count * TAU / 3600.0,
            Unit::None | Unit::Ampere | Unit::Volt | Unit::Celsius | Unit::Second | Unit::Ratio => {
                per_count
            }
        }
    }

    /// Raw count that stands for zero in `register`.
    fn zero(&self, register: &Register) -> f64 {
        match (register.zero, register.unit) {
            (Some(zero), _) => zero as f64,
            (None, Unit::Turn) => f64::from(self.servo.position.zero_count),
            (None, _) => 0.0,
        }
    }

    /// SI value of a raw count.
    #[must_use]
    pub fn si_from_raw(&self, register: &Register, raw: i64) -> f64 {
        (raw as f64 - self.zero(register)) * self.scale(register)
    }

    /// Nearest raw count of an SI value.
    ///
    /// # Errors
    /// [`RegisterError::OutOfRange`] if it does not fit the register's bytes, NaN included.
    pub fn raw_from_si(&self, register: &Register, si: f64) -> Result<i64, RegisterError> {
        let raw = (si / self.scale(register) + self.zero(register)).round();
        let (min, max) = register.encoding.range();
        if raw >= min as f64 && raw <= max as f64 {
            Ok(raw as i64)
        } else {
            Err(RegisterError::OutOfRange { register: register.name.clone(), raw, min, max })
        }
    }

    /// The register's bytes as an SI value.
    ///
    /// # Errors
    /// [`RegisterError::Short`].
    pub fn si_from_bytes(&self, register: &Register, bytes: &[u8]) -> Result<f64, RegisterError> {
        Ok(self.si_from_raw(register, self.raw_from_bytes(register, bytes)?))
    }

    /// An SI value as the register's bytes, appended to `out`.
    ///
    /// # Errors
    /// As [`Model::raw_from_si`].
    pub fn append_si(
        &self,
        register: &Register,
        si: f64,
        out: &mut Vec<u8>,
    ) -> Result<(), RegisterError> {
        self.append_raw(register, self.raw_from_si(register, si)?, out)
    }

    /// The number the first bytes of `bytes` hold, in the protocol's byte order.
    ///
    /// # Errors
    /// [`RegisterError::Short`].
    pub fn raw_from_bytes(&self, register: &Register, bytes: &[u8]) -> Result<i64, RegisterError> {
        let wanted = usize::from(register.bytes);
        let Some(own) = bytes.get(..wanted) else {
            let got = bytes.len();
            return Err(RegisterError::Short { register: register.name.clone(), got, wanted });
        };
        let append = |word: i64, &byte: &u8| (word << 8) | i64::from(byte);
        let word = if self.big_endian() {
            own.iter().fold(0, append)
        } else {
            own.iter().rev().fold(0, append)
        };
        Ok(match register.encoding {
            Encoding::U8 | Encoding::U16 | Encoding::U32 => word,
            Encoding::I8 => i64::from(word as u8 as i8),
            Encoding::I16 => i64::from(word as u16 as i16),
            Encoding::I32 => i64::from(word as u32 as i32),
            encoding => {
                let bit = sign_bit(encoding).unwrap_or(15);
                let magnitude = word & ((1 << bit) - 1);
                if word >> bit & 1 == 1 { -magnitude } else { magnitude }
            }
        })
    }

    /// `raw` as the register's bytes, in the protocol's byte order, appended to `out`.
    ///
    /// # Errors
    /// [`RegisterError::OutOfRange`].
    pub fn append_raw(
        &self,
        register: &Register,
        raw: i64,
        out: &mut Vec<u8>,
    ) -> Result<(), RegisterError> {
        let (min, max) = register.encoding.range();
        if !(min..=max).contains(&raw) {
            let (register, raw) = (register.name.clone(), raw as f64);
            return Err(RegisterError::OutOfRange { register, raw, min, max });
        }
        let word = match sign_bit(register.encoding) {
            Some(bit) if raw < 0 => (1 << bit) | -raw,
            _ => raw,
        };
        let start = out.len();
        out.extend_from_slice(&word.to_le_bytes()[..usize::from(register.bytes)]);
        if self.big_endian() {
            out[start..].reverse();
        }
        Ok(())
    }
}

fn sign_bit(encoding: Encoding) -> Option<u32> {
    match encoding {
        Encoding::SignMagnitude10 => Some(10),
        Encoding::SignMagnitude11 => Some(11),
        Encoding::SignMagnitude15 => Some(15),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn model(name: &str) -> Model {
        Model::new(gaitway_profiles::servo(name).expect("a shipped servo"))
    }

    fn register(model: &Model, role: Role) -> &'static Register {
        model.register(role).expect("a register")
    }

    /// Values printed in the manuals, or worked out by hand from their units.
    #[test]
    fn raw_counts_are_the_si_values_of_the_manuals() {
        let rpm = TAU / 60.0;
        for (servo, role, bytes, si) in [
            // Mid travel is angle zero; a quarter turn is 1024 counts.
            ("xm430-w350", Role::PresentPosition, vec![0x00, 0x08, 0, 0], 0.0),
            ("xm430-w350", Role::PresentPosition, vec![0x00, 0x0C, 0, 0], PI / 2.0),
            (
                "xm430-w350",
                Role::GoalPosition,
                vec![0xFF, 0xFF, 0xFF, 0xFF],
                -2049.0 * TAU / 4096.0,
            ),
            // 0.229 rev/min, 2.69 mA and 0.1 V per count.
            ("xm430-w350", Role::PresentVelocity, vec![100, 0, 0, 0], 22.9 * rpm),
            ("xm430-w350", Role::PresentVelocity, vec![0x9C, 0xFF, 0xFF, 0xFF], -22.9 * rpm),
            ("xm430-w350", Role::PresentCurrent, vec![0x18, 0xFC], -2.69),
            ("xm430-w350", Role::PresentVoltage, vec![120, 0], 12.0),
            ("xm430-w350", Role::ReturnDelay, vec![250], 500e-6),
            // 214.577 rev/min2 per count.
            ("xm430-w350", Role::ProfileAcceleration, vec![1, 0, 0, 0], 214.577 * TAU / 3600.0),
            // Feetech: bit 15 is the sign of a speed (0x83E8 = -1000 steps/s), bit 10 of a load.
            ("sts3215", Role::GoalVelocity, vec![0xE8, 0x83], -1000.0 * TAU / 4096.0),
            ("sts3215", Role::PresentLoad, vec![0x64, 0x04], -0.1),
            ("sts3215", Role::PresentPosition, vec![0x00, 0x08], 0.0),
            ("sts3215", Role::PresentVoltage, vec![74], 7.4),
        ] {
            let model = model(servo);
            let got = model.si_from_bytes(register(&model, role), &bytes).expect("enough bytes");
            assert!((got - si).abs() < 1e-9, "{servo} {role:?}: {got}, {si} by the manual");
        }
    }

    /// SCServo SDK, `SCSCL.cpp`: goal position 511 is sent as 01 FF, and speed 1000 as 03 E8.
    #[test]
    fn words_of_scs_servos_have_the_high_byte_first() {
        let sts = gaitway_profiles::servo("sts3215").expect("a shipped servo");
        let scs = Servo { protocol: Protocol::FeetechScs, ..sts.clone() };
        let model = Model::new(Box::leak(Box::new(scs)));
        let goal = register(&model, Role::GoalPosition);
        let mut bytes = Vec::new();
        model.append_raw(goal, 511, &mut bytes).expect("in range");
        model.append_raw(register(&model, Role::GoalVelocity), 1000, &mut bytes).expect("fits");
        assert_eq!(bytes, [0x01, 0xFF, 0x03, 0xE8]);
        assert_eq!(model.raw_from_bytes(goal, &[0x01, 0xFF]), Ok(511));
        assert_eq!(Model::new(sts).raw_from_bytes(goal, &[0xFF, 0x01]), Ok(511));
    }

    #[test]
    fn what_does_not_fit_a_register_is_refused_with_its_range() {
        let model = model("sts3215");
        let goal = register(&model, Role::GoalPosition);
        for si in [f64::NAN, f64::INFINITY, 60.0, -60.0] {
            let error = model.raw_from_si(goal, si).expect_err("too far");
            assert!(error.to_string().contains("-32767 to 32767"), "{error}");
        }
        assert!(model.si_from_bytes(goal, &[1]).is_err());
        assert!(model.register(Role::ProfileVelocity).is_err());
    }

    proptest! {
        #[test]
        fn writing_and_reading_back_stays_within_half_a_count(angle in -3.0..3.0_f64) {
            for name in ["xm430-w350", "xl430-w250", "xl330-m288", "sts3215"] {
                let model = model(name);
                let goal = register(&model, Role::GoalPosition);
                let mut bytes = Vec::new();
                model.append_si(goal, angle, &mut bytes).expect("in range");
                let back = model.si_from_bytes(goal, &bytes).expect("enough bytes");
                prop_assert!((back - angle).abs() <= model.rad_per_count() / 2.0 + 1e-12, "{}", name);
            }
        }

        #[test]
        fn any_bytes_of_any_register_survive_reading_and_writing(word in any::<[u8; 4]>()) {
            for name in ["xm430-w350", "sts3215"] {
                let model = model(name);
                for register in &model.profile().registers {
                    let raw = model.raw_from_bytes(register, &word).expect("four bytes are enough");
                    let mut bytes = Vec::new();
                    model.append_raw(register, raw, &mut bytes).expect("what was read can be written");
                    prop_assert_eq!(model.raw_from_bytes(register, &bytes).expect("its bytes"), raw);
                }
            }
        }
    }
}
