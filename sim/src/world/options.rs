//! How a world behaves, and what the manuals leave open.

use crate::adapter::Usb;
use crate::fault::Fault;

/// How a world behaves.
#[derive(Clone, Debug)]
pub struct Options {
    /// Everything random follows from it.
    pub seed: u64,
    /// True: bytes take their time and servos wait their return delay. False: all at once.
    pub line_timing: bool,
    /// EEPROM writes are allowed from the start.
    pub permit_eeprom: bool,
    /// The host hears its own bytes, as with some adapters.
    pub echo: bool,
    /// Time the adapter holds bytes back after they are complete.
    pub adapter_latency_ns: u64,
    /// How the adapter gathers bytes for the host; without one it hands over whole statuses.
    pub usb: Option<Usb>,
    /// What comes after a servo that does not answer its part of a sync or bulk read.
    pub missing_in_chain: MissingInChain,
    /// What DYNAMIXEL servos say to a packet for them whose checksum is wrong.
    pub bad_checksum: BadChecksum,
    /// What goal speed 0 means to FEETECH servos that move to positions.
    pub zero_speed: ZeroSpeed,
    /// What switches the torque of FEETECH servos on.
    pub torque_switch: TorqueSwitch,
    /// What goes wrong.
    pub faults: Vec<Fault>,
}

impl Default for Options {
    fn default() -> Options {
        Options {
            seed: 0,
            line_timing: true,
            permit_eeprom: false,
            echo: false,
            adapter_latency_ns: 0,
            usb: None,
            missing_in_chain: MissingInChain::Silent,
            bad_checksum: BadChecksum::Ignore,
            zero_speed: ZeroSpeed::NoLimit,
            torque_switch: TorqueSwitch::WaitsForRegister,
            faults: Vec::new(),
        }
    }
}

/// What servos do whose turn in a sync or bulk read comes after one that stays silent. No manual
/// says; a servo is known to wait for the status before its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MissingInChain {
    /// They wait for good.
    Silent,
    /// They go on after a pause. A merged (fast) status is cut off all the same.
    AnswerAfter {
        /// The pause.
        gap_ns: u64,
    },
}

/// What goal speed 0 means to FEETECH servos in position and step mode. A public table of the
/// memory gives the choice to bit 3 of Phase(18), but its factory value is not told, and hosts that
/// never write a speed expect their servos to move.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ZeroSpeed {
    /// As fast as it can.
    NoLimit,
    /// Bit 3 set: as fast as it can; clear: stop.
    AsPhaseSays,
}

/// What switches the torque of FEETECH servos (STS, SMS and SCS) on. The public tables name Torque
/// Enable(40) and give no value for power-up; the maker's own examples of goals never write it, and
/// users tell of servos whose torque is on from the start. Which it is nobody has confirmed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TorqueSwitch {
    /// The register alone: it is 0 at power-up.
    WaitsForRegister,
    /// The register, which is 0 at power-up, and any goal written while it is 0: that makes it 1.
    ComesWithGoal,
    /// It is 1 from power-up on; the servo holds where it stands.
    OnAtPowerUp,
}

/// What DYNAMIXEL servos do with a packet for them whose checksum is wrong. The manuals define an
/// error for it (bit 4 in Protocol 1.0, number 3 in Protocol 2.0), but hosts do not get to see it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BadChecksum {
    /// Nothing; the bytes are searched for another packet.
    Ignore,
    /// They answer with the error.
    Answer,
}
