//! Which mode a servo is in, and what its position register means there.
//!
//! - DYNAMIXEL 2.0 and STS: the operating mode register, by the profile's table; a value that is
//!   not in it counts as position mode (and cannot be written).
//! - DYNAMIXEL 1.0: both angle limits 0 is wheel mode, which turns at a speed on MX and at a duty
//!   on AX; both at the highest count is multi-turn on MX; Torque Control Mode Enable goes before.
//! - SCS: both angle limits 0 is PWM mode.
//! - XL-320 speaks protocol 2.0 over a table in the manner of AX: [`Servo::has_profile`] is false.
//!
//! The encoder is absolute within one turn. DYNAMIXEL 2.0 (but for XL-320) counts turns in every
//! mode (extended position: -256..256) and forgets them when it restarts, when the mode becomes
//! position, and when torque comes on in position mode (e-Manual, Present Position). All others
//! read within one turn, but for MX multi-turn and STS with both limits 0 or with bit 4 of
//! Phase(18). Where less than a turn is readable (AX, XL-320, SCS: 300 of 360 degrees) the dead gap
//! reads as its nearer end; the makers call the reading there undefined.
//!
//! Within one turn no manual says which way a servo goes to a goal. Here it never crosses the seam:
//! from torque on it keeps to the turn it is in.

use super::Servo;
use gaitway_profiles::{Mode, Protocol, Role};
use std::f64::consts::TAU;

/// Phase(18): positions count turns.
const PHASE_MULTI_TURN: i64 = 1 << 4;

impl Servo {
    pub(super) fn mode(&self) -> Mode {
        match self.model.protocol {
            Protocol::Dynamixel2 | Protocol::FeetechSts => {
                let value = self.value(Role::OperatingMode).unwrap_or(0);
                self.model.mode(value).unwrap_or(Mode::Position)
            }
            Protocol::Dynamixel1 => self.dynamixel1_mode(),
            Protocol::FeetechScs if self.limits() == (0, 0) => Mode::Pwm,
            Protocol::FeetechScs => Mode::Position,
        }
    }

    fn dynamixel1_mode(&self) -> Mode {
        let last = i64::from(self.model.profile.position.counts) - 1;
        if self.value(Role::TorqueControlEnable) == Some(1) {
            return Mode::Current;
        }
        match self.limits() {
            (0, 0) if self.has_compliance() => Mode::Pwm,
            (0, 0) => Mode::Velocity,
            limits if limits == (last, last) && self.value(Role::ResolutionDivider).is_some() => {
                Mode::ExtendedPosition
            }
            _ => Mode::Position,
        }
    }

    /// The X and MX (2.0) tables: profile registers, Goal PWM, gains of their own for speed.
    pub(super) fn has_profile(&self) -> bool {
        self.model.protocol == Protocol::Dynamixel2 && self.value(Role::ProfileVelocity).is_some()
    }

    /// AX: compliance in place of P, I and D.
    pub(super) fn has_compliance(&self) -> bool {
        self.value(Role::CwComplianceSlope).is_some()
    }

    /// Lowest and highest angle limit.
    pub(super) fn limits(&self) -> (i64, i64) {
        let limit = |role| self.value(role).unwrap_or(0);
        (limit(Role::MinPositionLimit), limit(Role::MaxPositionLimit))
    }

    pub(super) fn drive_mode(&self) -> i64 {
        self.value(Role::DriveMode).unwrap_or(0)
    }

    /// -1 if Drive Mode(10) bit 0 reverses the servo, else 1. MX with protocol 1.0 does not reverse
    /// in wheel mode.
    pub(super) fn side(&self) -> f64 {
        let old = self.model.protocol == Protocol::Dynamixel1;
        let reverses = !(old && self.mode() == Mode::Velocity);
        if reverses && self.drive_mode() & 1 != 0 { -1.0 } else { 1.0 }
    }

    /// Counts in 360 degrees; the readable ones may be fewer.
    fn counts_per_turn(&self) -> f64 {
        TAU / self.model.radians_per_count
    }

    /// True if the reading counts turns.
    fn counts_turns(&self) -> bool {
        match self.model.protocol {
            Protocol::Dynamixel2 => self.model.profile.position.degrees == 360,
            Protocol::Dynamixel1 => self.mode() == Mode::ExtendedPosition,
            Protocol::FeetechSts => {
                self.value(Role::Phase).unwrap_or(0) & PHASE_MULTI_TURN != 0
                    || self.limits() == (0, 0)
            }
            Protocol::FeetechScs => false,
        }
    }

    /// Encoder counts to one of the register: MX's Resolution Divider(22) in multi-turn mode and
    /// STS's Angular Resolution(30) while turns are counted.
    fn divider(&self) -> f64 {
        if self.model.protocol == Protocol::Dynamixel2 || !self.counts_turns() {
            return 1.0;
        }
        let divider = self.value(Role::ResolutionDivider).or(self.value(Role::AngularResolution));
        divider.map_or(1.0, |divider| divider.max(1) as f64)
    }

    /// Register counts added to the encoder's.
    fn offset_counts(&self) -> i64 {
        let raw = self.value(Role::HomingOffset).unwrap_or(0);
        match self.model.protocol {
            // In position mode only a quarter turn either way counts.
            Protocol::Dynamixel2
                if self.mode() == Mode::Position
                    && raw.abs() > i64::from(self.model.profile.position.counts / 4) =>
            {
                0
            }
            // Multi Turn Offset(20) counts in multi-turn mode only.
            Protocol::Dynamixel1 if self.mode() != Mode::ExtendedPosition => 0,
            Protocol::Dynamixel1 | Protocol::Dynamixel2 => raw,
            // Position offset(31) is subtracted.
            Protocol::FeetechSts | Protocol::FeetechScs => -raw,
        }
    }

    /// Encoder counts at a shaft angle, turns included.
    fn encoder(&self, shaft_rad: f64) -> f64 {
        let zero = i64::from(self.model.profile.position.zero_count) + self.reading_offset;
        zero as f64 + self.side() * shaft_rad / self.model.radians_per_count
    }

    /// What the position register shows at a shaft angle.
    pub(super) fn reading(&self, shaft_rad: f64) -> i64 {
        let counts = self.encoder(shaft_rad);
        if self.counts_turns() {
            return (counts / self.divider()).round() as i64 + self.offset_counts();
        }
        let turn = self.counts_per_turn();
        let within = (counts.round() + self.offset_counts() as f64).rem_euclid(turn);
        let last = f64::from(self.model.profile.position.counts) - 1.0;
        let readable = if within <= last + 0.5 {
            within.round().min(last)
        } else if within < 0.5 * (last + turn) {
            last
        } else {
            0.0
        };
        readable as i64
    }

    /// The reading at the shaft's angle.
    pub fn present_position(&self) -> i64 {
        self.reading(self.motor.position_rad())
    }

    /// The shaft angle that reads `raw`, in the turn kept to.
    pub(super) fn shaft_rad(&self, raw: i64) -> f64 {
        let mut counts = (raw - self.offset_counts()) as f64 * self.divider();
        if !self.counts_turns() {
            counts += self.turn as f64 * self.counts_per_turn();
        }
        let zero = i64::from(self.model.profile.position.zero_count) + self.reading_offset;
        self.side() * (counts - zero as f64) * self.model.radians_per_count
    }

    /// From here on the servo keeps to the turn its shaft is in.
    pub(super) fn note_turn(&mut self) {
        let turn = self.counts_per_turn();
        let gap = turn - f64::from(self.model.profile.position.counts);
        let counts = self.encoder(self.motor.position_rad()).round() + self.offset_counts() as f64;
        self.turn = ((counts + 0.5 * gap) / turn).floor() as i64;
    }

    /// The turns counted so far are forgotten: the encoder reads within one turn.
    pub(super) fn forget_turns(&mut self) {
        if self.counts_turns() {
            let turn = self.counts_per_turn();
            let lowest = f64::from(self.model.profile.position.lowest_count);
            let counts = self.encoder(self.motor.position_rad()).round() - lowest;
            self.reading_offset -= ((counts / turn).floor() * turn) as i64;
        }
        self.note_turn();
    }
}
