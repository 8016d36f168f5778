//! Numbers as steps on a range, and the packing of the "mini cheetah", which CubeMars and Damiao
//! share.
//!
//! Source: CubeMars, "AK Series Actuator Driver Manual" 1.0.15, section 5.3; Damiao,
//! "DM-J4310-2EC user manual" V1.0.

use super::drive::{Drive, Goal};
use gaitway_profiles::Ranges;

/// The value of step `code` of 2^bits on a range.
pub(super) fn decode(code: u64, bits: u32, low: f64, high: f64) -> f64 {
    low + code as f64 * (high - low) / ((1_u64 << bits) - 1) as f64
}

/// The step below a value, from `-end` to `end`; the makers' code cuts off, and so does this.
pub(super) fn encode(value: f64, bits: u32, end: f64) -> u64 {
    let steps = ((1_u64 << bits) - 1) as f64;
    ((value.clamp(-end, end) + end) * steps / (2.0 * end)) as u64
}

/// What the last byte of `FF FF FF FF FF FF FF ..` asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Order {
    Clear,
    Enable,
    Disable,
    SetZero,
    Unknown,
}

impl Order {
    pub fn of(bytes: [u8; 8]) -> Option<Order> {
        let [head @ .., last] = bytes;
        match last {
            _ if head != [0xFF; 7] => None,
            0xFB => Some(Order::Clear),
            0xFC => Some(Order::Enable),
            0xFD => Some(Order::Disable),
            0xFE => Some(Order::SetZero),
            0xF0..=0xFF => Some(Order::Unknown),
            // A torque, with everything else at its upper end.
            _ => None,
        }
    }
}

/// Spring, damper and torque out of eight bytes: 16, 12, 12, 12 and 12 bits, first bit highest.
pub(super) fn impedance(ranges: &Ranges, bytes: [u8; 8]) -> Goal {
    let whole = u64::from_be_bytes(bytes);
    let field = |shift: u32| whole >> shift & 0xFFF;
    let both = |code, bits, end: f64| decode(code, bits, -end, end);
    Goal::impedance(
        both(whole >> 48, 16, ranges.position_rad),
        both(field(36), 12, ranges.velocity_rad_s),
        decode(field(24), 12, 0.0, ranges.kp_nm_rad),
        decode(field(12), 12, 0.0, ranges.kd_nm_s_rad),
        both(field(0), 12, ranges.torque_nm),
    )
}

/// Position, velocity and torque in five bytes: 16, 12 and 12 bits.
pub(super) fn state(ranges: &Ranges, drive: &Drive) -> [u8; 5] {
    let whole = encode(drive.tell_rad(), 16, ranges.position_rad) << 24
        | encode(drive.velocity_rad_s, 12, ranges.velocity_rad_s) << 12
        | encode(drive.torque_nm, 12, ranges.torque_nm);
    let [_, _, _, bytes @ ..] = whole.to_be_bytes();
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(model: &str) -> Ranges {
        gaitway_profiles::actuator(model).expect("shipped").ranges.expect("ranges")
    }

    // Ranges of TMotorCANControl, `mit_can.py`, and of DM_CAN.py, `Limit_Param`; the bytes worked
    // out by hand from the manuals' packing.
    #[test]
    fn a_command_is_unpacked_to_a_step_of_each_range() {
        for (model, bytes) in [
            ("ak80-9", [0x7A, 0xE0, 0x85, 0x10, 0xA3, 0x19, 0x99, 0x54]),
            ("dm4310", [0x7A, 0xE0, 0x88, 0x80, 0xA3, 0x19, 0x9A, 0x65]),
        ] {
            let ranges = of(model);
            let Goal::Impedance { position, velocity, kp, kd, torque, .. } =
                impedance(&ranges, bytes)
            else {
                panic!("a spring");
            };
            for (value, expected, span, steps) in [
                (position, -0.5, 2.0 * ranges.position_rad, 65_535.0),
                (velocity, 2.0, 2.0 * ranges.velocity_rad_s, 4095.0),
                (kp, 20.0, ranges.kp_nm_rad, 4095.0),
                (kd, 0.5, ranges.kd_nm_s_rad, 4095.0),
                (torque, 3.0, 2.0 * ranges.torque_nm, 4095.0),
            ] {
                assert!((value - expected).abs() <= span / steps, "{model}: {value} {expected}");
            }
        }
    }

    #[test]
    fn orders_have_seven_bytes_of_ones() {
        let of_last = |last| Order::of([0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, last]);
        assert_eq!(of_last(0xFC), Some(Order::Enable));
        assert_eq!(of_last(0x00), None);
        assert_eq!(Order::of([0x7F, 0xFF, 0x7F, 0xF0, 0, 0, 0x07, 0xFC]), None);
    }

    // Xiaomi's ranges: the feedback of belovictor/cybergear-docs, section 4.1.3.
    #[test]
    fn sixteen_bits_reach_from_end_to_end() {
        let end = 4.0 * std::f64::consts::PI;
        assert!((decode(0x7FFE, 16, -end, end) + 0.000_575).abs() < 1e-6);
        assert!((decode(0x8073, 16, -30.0, 30.0) - 0.106).abs() < 1e-3);
        assert_eq!((encode(-99.0, 16, end), encode(99.0, 16, end)), (0, 0xFFFF));
    }
}
