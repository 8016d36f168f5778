//! Where the feet of a person are in contact with the floor, as evaluations of retargeting have it.

use crate::body::{End, Proportions, SegmentPose};
use glam::DVec3;

/// A toe slower than this over the floor may be in contact, m/s.
pub const CONTACT_M_S: f64 = 0.15;
/// A toe no higher than this above its low is, m.
pub const CONTACT_M: f64 = 0.05;
/// Which part of a toe's heights lies below its low.
const LOW: f64 = 0.05;

/// A foot of a person over a motion.
#[derive(Clone, Debug)]
pub struct Toe {
    /// Where its toe is, pose by pose, m.
    pub at_m: Vec<DVec3>,
    /// Whether it is in contact then.
    pub contact: Vec<bool>,
}

impl Toe {
    /// The left and the right one in poses that follow at `rate_hz`.
    #[must_use]
    pub fn both(poses: &[SegmentPose], rate_hz: f64, lengths: &Proportions) -> [Self; 2] {
        [End::LeftToe, End::RightToe].map(|end| Self::of(poses, rate_hz, lengths, end))
    }

    fn of(poses: &[SegmentPose], rate_hz: f64, lengths: &Proportions, end: End) -> Self {
        let at_m: Vec<DVec3> =
            poses.iter().map(|pose| lengths.positions(pose).end_m(end)).collect();
        let low_m = quantile(at_m.iter().map(|at| at.z).collect(), LOW).unwrap_or(0.0);
        let last = at_m.len().saturating_sub(1);
        let contact = (0..at_m.len()).map(|at| {
            let (before, after) = (at.saturating_sub(1), (at + 1).min(last));
            let moved_m = (at_m[after] - at_m[before]).truncate().length();
            let speed_m_s = moved_m * rate_hz / (after - before).max(1) as f64;
            speed_m_s < CONTACT_M_S && at_m[at].z < low_m + CONTACT_M
        });
        let contact = contact.collect();
        Self { at_m, contact }
    }
}

/// The value that a part of all values, 0 to 1, lies below.
#[must_use]
pub fn quantile(mut values: Vec<f64>, share: f64) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    let at = (share * values.len().saturating_sub(1) as f64).round() as usize;
    values.get(at).copied()
}
