//! The packed command of the MIT Mini Cheetah's motor controller, as CubeMars and Damiao use it.
//!
//! ```text
//! position 16 | velocity 12 | kp 12 | kd 12 | torque 12     most significant bit first
//! ```
//!
//! The motor's torque is `kp (position - its position) + kd (velocity - its velocity) + torque`.
//! Each field is a step on a range of the actuator ([`Number::Code`]).
//!
//! Source: bgkatz/motorcontrol, `CAN_com.cpp`; neurobionics/TMotorCANControl, `mit_can.py`.

use super::{CanFrame, CanId, Number};

/// Bits of the position field.
pub const POSITION_BITS: u8 = 16;
/// Bits of each of the other fields.
pub const FIELD_BITS: u8 = 12;

const FIELD_MAX: u16 = (1 << FIELD_BITS) - 1;

/// One command, in steps. Fields above 12 bits are taken as the largest step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Setpoint {
    /// Position, 16 bits.
    pub position: u16,
    /// Velocity, 12 bits.
    pub velocity: u16,
    /// Gain on the error of position, 12 bits.
    pub kp: u16,
    /// Gain on the error of velocity, 12 bits.
    pub kd: u16,
    /// Torque added, 12 bits.
    pub torque: u16,
}

/// What the special commands do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Order {
    ClearFaults = 0xFB,
    Enable = 0xFC,
    Disable = 0xFD,
    SetZero = 0xFE,
}

pub(super) const fn order(id: CanId, order: Order) -> CanFrame {
    CanFrame::classic(id, [0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, order as u8])
}

pub(super) fn setpoint(id: CanId, setpoint: Setpoint) -> CanFrame {
    let [velocity, kp, kd, torque] =
        [setpoint.velocity, setpoint.kp, setpoint.kd, setpoint.torque].map(|x| x.min(FIELD_MAX));
    let packed =
        [velocity, kp, kd, torque].iter().fold(u64::from(setpoint.position), |packed, field| {
            packed << FIELD_BITS | u64::from(*field)
        });
    CanFrame::classic(id, packed.to_be_bytes())
}

/// Position, velocity and torque as the replies pack them, 16, 12 and 12 bits.
pub(super) fn state([p1, p0, v, vt, t]: [u8; 5]) -> [Number; 3] {
    let [v, vt, t] = [v, vt, t].map(u16::from);
    let field = |code| Number::Code { code, bits: FIELD_BITS };
    [
        Number::Code { code: u16::from_be_bytes([p1, p0]), bits: POSITION_BITS },
        field(v << 4 | vt >> 4),
        field((vt & 0x0F) << 8 | t),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn packed(position: u16, velocity: u16, kp: u16, kd: u16, torque: u16) -> Vec<u8> {
        let setpoint = Setpoint { position, velocity, kp, kd, torque };
        super::setpoint(CanId::standard_of(1), setpoint).payload().to_vec()
    }

    // Steps worked out by hand from the ranges of the AK80-9 (12.5 rad, 50 rad/s, 500, 5, 18 N m)
    // with the formula of TMotorCANControl, rounded down; 0 is not a step but lies between two.
    #[test]
    fn fields_lie_where_the_mini_cheetah_puts_them() {
        let zeros = packed(0x7FFF, 0x7FF, 0, 0, 0x7FF);
        assert_eq!(zeros, [0x7F, 0xFF, 0x7F, 0xF0, 0x00, 0x00, 0x07, 0xFF]);
        let one_radian = packed(0x8A3C, 0x7FF, 0x199, 0x333, 0x7FF);
        assert_eq!(one_radian, [0x8A, 0x3C, 0x7F, 0xF1, 0x99, 0x33, 0x37, 0xFF]);
        let all = packed(0x7AE0, 0x851, 0x0A3, 0x199, 0x954);
        assert_eq!(all, [0x7A, 0xE0, 0x85, 0x10, 0xA3, 0x19, 0x99, 0x54]);
    }

    #[test]
    fn a_field_too_large_is_the_largest_step_and_spoils_no_other() {
        let most = packed(0, 0xFFFF, 0, 0x1000, 0);
        assert_eq!(most, [0x00, 0x00, 0xFF, 0xF0, 0x00, 0xFF, 0xF0, 0x00]);
    }
}
