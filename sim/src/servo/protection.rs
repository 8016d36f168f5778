//! What a servo notices about itself, and what it does about it.
//!
//! - DYNAMIXEL 2.0: error bits stay until a restart; those in Shutdown(63) clear Torque Enable, and
//!   it cannot be set again before the restart.
//! - DYNAMIXEL 1.0: voltage and temperature bits last as long as their cause, overload until Torque
//!   Limit(34) is written. Bits in Shutdown(18) set Torque Limit to 0; writing it brings the torque
//!   back, for as long as the cause is gone. The same happens for a bit raised by an instruction
//!   (angle limit, range, instruction), as the manual says of the angle limit.
//! - FEETECH: voltage and temperature bits last as long as their cause, and take the torque if they
//!   are in the unloading condition(19). Overload does not take it but limits it to the protective
//!   torque(34, SCS 37); without such a register the torque goes. Writing Torque Enable forgets
//!   overload and overcurrent. The public tables name these registers but do not tell all of this:
//!   that overload needs its bit in the unloading condition, and how it is forgotten, is assumed.
//!
//! Overload is, on DYNAMIXEL, 80 % of the stall torque for one second (assumed; the manuals speak
//! of "persistent load that exceeds maximum output"); on FEETECH the overload torque(36, SCS 39)
//! for the protection time(35, SCS 38), overcurrent the protection current(28) for its time(38).
//!
//! The alarm LED blinks once a second while an error is up that its mask names; DYNAMIXEL 2.0 has
//! no mask and blinks while shut down.

use super::{Event, Servo};
use crate::motor::Bound;
use gaitway_profiles::{Protocol, Role};

/// What can be wrong: the word the profiles have for it, and its usual bit.
type Trouble = (&'static str, u8);
const VOLTAGE: Trouble = ("input voltage", 0);
const HEAT: Trouble = ("overheating", 2);
/// FEETECH only.
const OVERCURRENT: Trouble = ("current", 3);
const OVERLOAD: Trouble = ("overload", 5);
const DYNAMIXEL_OVERLOAD: Bound = Bound { ratio: 0.8, time_s: 1.0 };
/// The alarm LED is lit for so long, then dark for so long.
const HALF_BLINK_NS: u64 = 500_000_000;
const NEVER: Bound = Bound { ratio: f64::INFINITY, time_s: f64::INFINITY };

impl Servo {
    /// The error byte of a status in protocol 1.0's frame, but for what was wrong with the
    /// instruction itself: one bit for each thing that is wrong.
    pub fn status_error(&self) -> u8 {
        (self.errors & 0x7F) as u8
    }

    /// Bits of Hardware Error Status or Status; a servo without such a register has them too.
    pub fn hardware_error(&self) -> i64 {
        self.errors
    }

    pub(super) fn set_errors(&mut self, bits: i64) {
        if bits != self.errors {
            self.errors = bits;
            self.put(Role::HardwareError, self.error_register());
        }
    }

    /// What the error register holds while these errors are up: their bits, or the code of the worst.
    fn error_register(&self) -> i64 {
        let codes = &self.model.profile.error_codes;
        if codes.is_empty() {
            return self.errors;
        }
        let is_low = self.si(Role::MinVoltageLimit).is_some_and(|v| self.motor.voltage_v() < v);
        let voltage = if is_low { "low voltage" } else { "over voltage" };
        let named = [(OVERLOAD, "overload"), (HEAT, "motor overheating"), (VOLTAGE, voltage)];
        let up = named.iter().find(|(trouble, _)| self.errors & self.bits([*trouble]) != 0);
        let code = up.and_then(|(_, name)| codes.iter().find(|code| code.name == *name));
        code.map_or(0, |code| code.value.into())
    }

    /// The bits of these troubles; XL-320 has its own.
    fn bits<const N: usize>(&self, troubles: [Trouble; N]) -> i64 {
        let listed = &self.model.profile.error_bits;
        let bit = |(name, usual): Trouble| {
            1 << listed.iter().find(|bit| bit.name == name).map_or(usual, |bit| bit.bit)
        };
        troubles.into_iter().fold(0, |bits, trouble| bits | bit(trouble))
    }

    /// Looks at voltage and temperature.
    pub(super) fn protect(&mut self) {
        let mut bits = 0;
        if self.si(Role::TemperatureLimit).is_some_and(|c| self.motor.temperature_c() > c) {
            bits |= self.bits([HEAT]);
        }
        let volts = self.motor.voltage_v();
        if self.si(Role::MaxVoltageLimit).is_some_and(|v| volts > v)
            || self.si(Role::MinVoltageLimit).is_some_and(|v| volts < v)
        {
            bits |= self.bits([VOLTAGE]);
        }
        if self.model.protocol != Protocol::Dynamixel2 {
            self.set_errors(self.errors & !self.bits([VOLTAGE, HEAT]) | bits);
        }
        if bits != 0 {
            self.raise(bits);
        }
    }

    /// These errors are up now.
    pub(super) fn raise(&mut self, bits: i64) {
        self.set_errors(self.errors | bits);
        self.shut_down_for(bits);
    }

    /// An error of the instruction, which lasts no longer than its status.
    pub(super) fn shut_down_for(&mut self, bits: i64) {
        if bits & self.shutdown_mask() == 0 {
            return;
        }
        match self.model.protocol {
            Protocol::Dynamixel1 => self.put(Role::TorqueLimit, 0),
            Protocol::Dynamixel2 => self.put(Role::TorqueEnable, 0),
            Protocol::FeetechSts | Protocol::FeetechScs => {
                let spared = bits & self.shutdown_mask() == self.bits([OVERLOAD])
                    && self.value(Role::ProtectiveTorque).is_some();
                if !spared {
                    self.put(Role::TorqueEnable, 0);
                }
            }
        }
        self.update_regulator();
        self.follow_torque();
    }

    fn shutdown_mask(&self) -> i64 {
        self.value(Role::Shutdown).unwrap_or_else(|| self.bits([VOLTAGE, HEAT, OVERLOAD]))
    }

    /// True while an error keeps Torque Enable from being set.
    pub(super) fn is_shut_down(&self) -> bool {
        let mask = match self.model.protocol {
            Protocol::Dynamixel2 => self.shutdown_mask(),
            Protocol::Dynamixel1 => 0,
            Protocol::FeetechSts | Protocol::FeetechScs => {
                self.shutdown_mask() & self.bits([VOLTAGE, HEAT])
            }
        };
        self.errors & mask != 0
    }

    pub fn raise_overload(&mut self, now_ns: u64) {
        self.advance(now_ns);
        self.overloaded();
    }

    pub(super) fn overloaded(&mut self) {
        self.raise(self.bits([OVERLOAD]));
    }

    pub(super) fn overcurrent(&mut self) {
        self.raise(self.bits([OVERCURRENT]));
    }

    /// What ends an overload without a restart has happened.
    pub(super) fn forget_overload(&mut self) {
        self.set_errors(self.errors & !self.bits([OVERLOAD, OVERCURRENT]));
    }

    /// FEETECH: highest duty while overloaded.
    pub(super) fn protective_limit(&self) -> Option<f64> {
        let limited = self.errors & self.shutdown_mask() & self.bits([OVERLOAD]) != 0;
        let feetech = matches!(self.model.protocol, Protocol::FeetechSts | Protocol::FeetechScs);
        self.si(Role::ProtectiveTorque).filter(|_| limited && feetech)
    }

    pub(super) fn overload_bound(&self) -> Bound {
        match self.model.protocol {
            Protocol::Dynamixel1 | Protocol::Dynamixel2 => DYNAMIXEL_OVERLOAD,
            Protocol::FeetechSts | Protocol::FeetechScs => {
                self.bound(Role::OverloadTorque, Role::ProtectionTime, 1.0)
            }
        }
    }

    pub(super) fn overcurrent_bound(&self) -> Bound {
        let stall_a = self.motor.stall_current_a();
        self.bound(Role::ProtectionCurrent, Role::OverCurrentTime, stall_a)
    }

    /// A bound two registers give; a limit of 0 means none.
    fn bound(&self, limit: Role, time: Role, full_scale: f64) -> Bound {
        match (self.si(limit), self.si(time)) {
            (Some(limit), Some(time_s)) if limit > 0.0 => {
                Bound { ratio: limit / full_scale, time_s }
            }
            _ => NEVER,
        }
    }

    /// True if the LED shines.
    pub fn led_lit(&self) -> bool {
        let alarm = match (self.model.protocol, self.value(Role::AlarmLed)) {
            (Protocol::Dynamixel2, _) => self.is_shut_down(),
            (_, mask) => self.errors & mask.unwrap_or(0) != 0,
        };
        if alarm {
            return (self.motor.now_ns() / HALF_BLINK_NS).is_multiple_of(2);
        }
        self.value(Role::Led).is_some_and(|led| led != 0)
    }

    /// Lets the motor follow what the table says of torque, and tells the referee of changes.
    pub(super) fn follow_torque(&mut self) {
        let is = self.has_torque();
        if is && !self.engaged {
            self.engaged = true;
            self.engage();
        } else if !is {
            if self.engaged {
                self.events.push(Event::TorqueOff);
            }
            self.engaged = false;
            if self.brakes() { self.motor.brake() } else { self.motor.release() }
        }
    }

    /// True if the motor is to give torque.
    fn has_torque(&self) -> bool {
        let limited =
            self.model.protocol == Protocol::Dynamixel1 && self.value(Role::TorqueLimit) == Some(0);
        self.value(Role::TorqueEnable) == Some(1) && !limited
    }

    /// FEETECH, Torque Enable(40) = 2: damping.
    fn brakes(&self) -> bool {
        self.value(Role::TorqueEnable) == Some(2)
    }
}
