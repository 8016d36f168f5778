//! A board with an inertial sensor in a robot's base: what is read of it in a cycle.

use super::registers::spoken;
use crate::bus::Protocol;
use gaitway_profiles::{Board, FirmwareRange, SignedAxis};
use glam::DVec3;

/// Standard gravity, m/s²: what a `g` of a profile is.
pub const STANDARD_GRAVITY_M_S2: f64 = 9.80665;
/// Bytes of three words.
const THREE_WORDS: u16 = 6;

/// What a base feels, in its own axes: X ahead, Y to the left, Z up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Inertial {
    /// How it turns, rad/s.
    pub rate_rad_s: DVec3,
    /// What it is accelerated by, without gravity, m/s²: a base that lies still, 9.8 upwards.
    pub acceleration_m_s2: DVec3,
}

/// A board, as it is screwed to a base.
#[derive(Clone, Debug)]
pub struct InertialBoard {
    /// What it speaks.
    pub protocol: Protocol,
    /// What it answers when asked for its model.
    pub model_number: u16,
    /// The firmware its profile holds for.
    pub firmware: FirmwareRange,
    /// First byte of what is measured, and how many there are.
    block: (u16, u16),
    gyroscope: u16,
    rad_s_per_count: f64,
    accelerometer: u16,
    m_s2_per_count: f64,
    axes: [SignedAxis; 3],
}

impl InertialBoard {
    /// A board of a validated profile; `axes` are the base's as axes of the sensor.
    #[must_use]
    pub fn new(profile: &Board, axes: [SignedAxis; 3]) -> Self {
        let imu = &profile.imu;
        let first = imu.gyroscope.min(imu.accelerometer);
        let end = imu.gyroscope.max(imu.accelerometer) + THREE_WORDS;
        Self {
            protocol: spoken(profile.protocol),
            model_number: profile.model_number,
            firmware: profile.firmware,
            block: (first, end - first),
            gyroscope: imu.gyroscope - first,
            rad_s_per_count: imu.gyroscope_deg_s.to_radians(),
            accelerometer: imu.accelerometer - first,
            m_s2_per_count: imu.accelerometer_g * STANDARD_GRAVITY_M_S2,
            axes,
        }
    }

    /// First address to read, and how many bytes.
    #[must_use]
    pub const fn block(&self) -> (u16, u16) {
        self.block
    }

    /// What the bytes say; nothing if they are not as many as were asked for.
    #[must_use]
    pub fn decode(&self, bytes: &[u8]) -> Option<Inertial> {
        if bytes.len() != usize::from(self.block.1) {
            return None;
        }
        Some(Inertial {
            rate_rad_s: self.three(bytes, self.gyroscope)? * self.rad_s_per_count,
            acceleration_m_s2: self.three(bytes, self.accelerometer)? * self.m_s2_per_count,
        })
    }

    /// Three words, turned into the base's axes.
    fn three(&self, bytes: &[u8], first: u16) -> Option<DVec3> {
        let words = bytes.get(usize::from(first)..)?.get(..usize::from(THREE_WORDS))?;
        let word = |at: usize| f64::from(i16::from_le_bytes([words[2 * at], words[2 * at + 1]]));
        let of_sensor = DVec3::new(word(0), word(1), word(2));
        let [x, y, z] = self.axes.map(|axis| DVec3::from(axis.unit()).dot(of_sensor));
        Some(DVec3::new(x, y, z))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_of_the_op3s_board_are_what_its_maker_makes_of_them() {
        let board = gaitway_profiles::board("opencr-op3").unwrap();
        let axes = [SignedAxis::MinusX, SignedAxis::MinusY, SignedAxis::PlusZ];
        let board = InertialBoard::new(&board, axes);
        assert_eq!(board.block(), (32, 12));
        // open_cr_module.cpp: -32800 to 32800 are -2000 to 2000 deg/s, 16384 is 1 g; X and Y the other way.
        let words: [i16; 6] = [164, -1640, 16400, 8192, -16384, 16384];
        let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
        let felt = board.decode(&bytes).unwrap();
        let deg_s = felt.rate_rad_s.to_array().map(f64::to_degrees);
        for (is, should) in deg_s.into_iter().zip([-10.0, 100.0, 1000.0]) {
            assert!((is - should).abs() < 1e-9, "{deg_s:?}");
        }
        let g = (felt.acceleration_m_s2 / 9.80665).to_array();
        for (is, should) in g.into_iter().zip([-0.5, 1.0, 1.0]) {
            assert!((is - should).abs() < 1e-12, "{g:?}");
        }
        assert_eq!(board.decode(&bytes[1..]), None);
    }
}
