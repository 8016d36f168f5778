//! Coded numbers of CAN actuators: steps on a range of the model, to SI units and back.

use crate::wire::can::{Number, mit, robstride};
use gaitway_profiles::Ranges;

/// A motion of a spring and a damper with a torque added, SI units at the output.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Impedance {
    /// rad
    pub position_rad: f64,
    /// rad/s
    pub velocity_rad_s: f64,
    /// N m/rad
    pub kp_nm_rad: f64,
    /// N m s/rad
    pub kd_nm_s_rad: f64,
    /// N m
    pub torque_nm: f64,
}

/// The step of 2^`bits` on `low` to `high` that is nearest to `value`. What lies outside is the
/// end it lies beyond; not-a-number is the middle, where symmetric ranges have their zero.
#[must_use]
pub fn step(value: f64, low: f64, high: f64, bits: u8) -> u16 {
    let steps = f64::from(last_step(bits));
    let share = (value - low) / (high - low);
    let share = if share.is_nan() { 0.5 } else { share.clamp(0.0, 1.0) };
    (share * steps).round() as u16
}

/// What a number of a device stands for on a range that reaches as far below zero as above it.
/// None for a number that is no step.
#[must_use]
pub fn symmetric(number: Number, end: f64) -> Option<f64> {
    match number {
        Number::Code { code, bits } => {
            Some(f64::from(code) / f64::from(last_step(bits)) * 2.0 * end - end)
        }
        Number::Steps(_) | Number::Value(_) => None,
    }
}

/// The angle nearest to `angle` that 16 bits on `-end` to `end` can say, on the side of it that
/// `up` names.
#[must_use]
pub fn representable(angle: f64, end: f64, up: bool) -> f64 {
    /// A step that is met but for rounding is met.
    const NEAR: f64 = 1e-6;
    let last = f64::from(last_step(mit::POSITION_BITS));
    let at = (angle + end) / (2.0 * end) * last;
    let step = if up { (at - NEAR).ceil() } else { (at + NEAR).floor() };
    step.clamp(0.0, last) / last * 2.0 * end - end
}

fn last_step(bits: u8) -> u16 {
    u16::MAX >> 16_u8.saturating_sub(bits.max(1))
}

/// As CubeMars in MIT mode and Damiao take it.
#[must_use]
pub fn mit_setpoint(wanted: Impedance, ranges: &Ranges) -> mit::Setpoint {
    let [position, velocity, kp, kd, torque] =
        steps(wanted, ranges, [mit::POSITION_BITS, mit::FIELD_BITS]);
    mit::Setpoint { position, velocity, kp, kd, torque }
}

/// As CyberGear and RobStride take it.
#[must_use]
pub fn robstride_setpoint(wanted: Impedance, ranges: &Ranges) -> robstride::Setpoint {
    let [position, velocity, kp, kd, torque] = steps(wanted, ranges, [16, 16]);
    robstride::Setpoint { position, velocity, kp, kd, torque }
}

fn steps(wanted: Impedance, ranges: &Ranges, [position_bits, bits]: [u8; 2]) -> [u16; 5] {
    let both = |value, end: f64, bits| step(value, -end, end, bits);
    // Not-a-number must be no gain at all, not half of the largest.
    let gain = |value: f64, end| step(if value > 0.0 { value } else { 0.0 }, 0.0, end, bits);
    [
        both(wanted.position_rad, ranges.position_rad, position_bits),
        both(wanted.velocity_rad_s, ranges.velocity_rad_s, bits),
        gain(wanted.kp_nm_rad, ranges.kp_nm_rad),
        gain(wanted.kd_nm_s_rad, ranges.kd_nm_s_rad),
        both(wanted.torque_nm, ranges.torque_nm, bits),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_number_comes_back_within_half_a_step(
            share in -1.0_f64..=1.0,
            end in 0.1_f64..1000.0,
            bits in 8_u8..=16,
        ) {
            let value = share * end;
            let back = symmetric(Number::Code { code: step(value, -end, end, bits), bits }, end);
            let half_step = end / f64::from((1_u32 << bits) - 1);
            prop_assert!((back.expect("a step") - value).abs() <= half_step * 1.000_001);
        }
    }

    proptest! {
        #[test]
        fn a_limit_rounded_inwards_is_a_step_and_stays_inside(
            angle in -12.5_f64..=12.5,
            up: bool,
        ) {
            let told = representable(angle, 12.5, up);
            let off = if up { told - angle } else { angle - told };
            prop_assert!((-1e-9..=25.0 / 65_535.0).contains(&off), "{off}");
            let again = Number::Code { code: step(told, -12.5, 12.5, 16), bits: 16 };
            prop_assert!((symmetric(again, 12.5).expect("a step") - told).abs() < 1e-9);
        }
    }

    // Steps by the formula of TMotorCANControl, which rounds down: at most one step away.
    #[test]
    fn a_setpoint_of_the_ak80_9_is_the_one_of_the_literature() {
        let profile = gaitway_profiles::actuator("ak80-9").expect("shipped");
        let wanted = Impedance {
            position_rad: -0.5,
            velocity_rad_s: 2.0,
            kp_nm_rad: 20.0,
            kd_nm_s_rad: 0.5,
            torque_nm: 3.0,
        };
        let got = mit_setpoint(wanted, &profile.ranges.expect("coded"));
        let fields = [got.position, got.velocity, got.kp, got.kd, got.torque];
        for (got, expected) in fields.into_iter().zip([0x7AE0, 0x851, 0x0A3, 0x199, 0x954]) {
            assert!(got.abs_diff(expected) <= 1, "{got:#X} {expected:#X}");
        }
    }

    #[test]
    fn what_is_no_number_pulls_nowhere() {
        let profile = gaitway_profiles::actuator("cybergear").expect("shipped");
        let nan = Impedance {
            position_rad: f64::NAN,
            velocity_rad_s: f64::NAN,
            kp_nm_rad: f64::NAN,
            kd_nm_s_rad: f64::NAN,
            torque_nm: f64::NAN,
        };
        let got = robstride_setpoint(nan, &profile.ranges.expect("coded"));
        assert_eq!((got.kp, got.kd, got.torque), (0, 0, 0x8000));
    }
}
