//! Which servos understand which packets. All on a line hear the same bytes, each by its own rules.

use crate::exchange::{Exchange, Scan};
use crate::servo::Servo;
use crate::{dynamixel1, dynamixel2, feetech};
use gaitway_profiles::Protocol;

/// Servos that take packets apart in the same way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Family {
    Dynamixel2,
    Dynamixel1,
    /// STS and SCS. The bytes are those of DYNAMIXEL Protocol 1.0, so both hear each other's
    /// packets and share the IDs.
    Feetech,
}

impl Family {
    pub const ALL: [Family; 3] = [Family::Dynamixel2, Family::Dynamixel1, Family::Feetech];

    pub fn of(protocol: Protocol) -> Family {
        match protocol {
            Protocol::Dynamixel1 => Family::Dynamixel1,
            Protocol::Dynamixel2 => Family::Dynamixel2,
            Protocol::FeetechSts | Protocol::FeetechScs => Family::Feetech,
        }
    }

    pub fn includes(self, servo: &Servo) -> bool {
        Family::of(servo.model.protocol) == self
    }

    /// A pause between bytes longer than this ends a packet unfinished: e-Manual, Protocol 2.0,
    /// "Processing Order of Reception", and Protocol 1.0, which gives 100 ms. FEETECH gives none;
    /// the shorter one is assumed.
    pub fn gap_ns(self) -> u64 {
        match self {
            Family::Dynamixel1 => 100_000_000,
            Family::Dynamixel2 | Family::Feetech => 1_500_000,
        }
    }

    /// What stands at the start of `bytes`.
    pub fn scan(self, bytes: &[u8]) -> Scan {
        match self {
            Family::Dynamixel2 => dynamixel2::packet::scan(bytes),
            Family::Dynamixel1 | Family::Feetech => dynamixel1::packet::scan(bytes),
        }
    }

    /// Lets the servos that hear carry out a packet that ended at `at_ns`.
    pub fn answer(self, packet: &[u8], servos: &mut [Servo], at_ns: u64) -> Exchange {
        match self {
            Family::Dynamixel2 => dynamixel2::answer(packet, servos, at_ns),
            Family::Dynamixel1 => dynamixel1::answer(packet, servos, at_ns),
            Family::Feetech => feetech::answer(packet, servos, at_ns),
        }
    }

    /// What is said to a packet with a wrong checksum, where that is said at all.
    pub fn complain(self, packet: &[u8], servos: &mut [Servo]) -> Exchange {
        match (self, packet) {
            (Family::Dynamixel2, &[_, _, _, _, id, ..]) => dynamixel2::complain(id, servos),
            (Family::Dynamixel1, &[_, _, id, ..]) => dynamixel1::complain(id, servos),
            _ => Exchange::nothing(),
        }
    }
}
