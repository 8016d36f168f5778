//! Whether somebody stands still, as N pose asks for it.

use crate::body::{Segment, SegmentPose};

/// Whoever stands turns no segment faster, rad/s: people who stand sway by a tenth of it ...
const STANDS_RAD_S: f64 = 0.5;
/// ... over so long, s: from sample to sample a coarse sensor jumps.
const OVER_S: f64 = 0.25;
/// For so long nothing may have moved, s.
const CALM_S: f64 = 0.5;

/// Looks at a body from moment to moment.
#[derive(Clone, Debug, Default)]
pub struct Calm {
    /// What was measured of it so long ago, s.
    before: Option<(SegmentPose, [bool; 13])>,
    ago_s: f64,
    /// Which segment moved last, and how long ago, s.
    moved: Option<(Segment, f64)>,
}

impl Calm {
    /// Takes where the sensors put the body, `dt_s` after the moment before, and which segments were measured.
    pub fn take(&mut self, pose: &SegmentPose, measured: &[bool; 13], dt_s: f64) {
        self.ago_s += dt_s;
        self.moved = self.moved.map(|(segment, ago_s)| (segment, ago_s + dt_s));
        let Some((before, was_measured)) = self.before.take_if(|_| self.ago_s >= OVER_S) else {
            self.before.get_or_insert_with(|| (pose.clone(), *measured));
            return;
        };
        let most_rad = STANDS_RAD_S * self.ago_s;
        let moves = |segment: &Segment| {
            let at = segment.index();
            let [was, is] = [&before, pose].map(|pose| pose.orientation[at]);
            let is = if was.dot(is) < 0.0 { -is } else { is };
            was_measured[at] && measured[at] && !(was.angle_between(is) <= most_rad)
        };
        if let Some(segment) = Segment::ALL.into_iter().find(moves) {
            self.moved = Some((segment, 0.0));
        }
        (self.before, self.ago_s) = (Some((pose.clone(), *measured)), 0.0);
    }

    /// A segment that moved in the last half second; `None` of somebody who stands still.
    #[must_use]
    pub fn moving(&self) -> Option<Segment> {
        self.moved.filter(|(_, ago_s)| *ago_s < CALM_S).map(|(segment, _)| segment)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::JointAngles;
    use glam::{DQuat, DVec3};

    /// Who moves at the end of so many seconds at 100 Hz, in which the left shank is turned by this.
    fn moving(lasts_s: f64, measured: bool, turned_rad: impl Fn(f64) -> f64) -> Option<Segment> {
        let mut calm = Calm::default();
        for n in 0..(lasts_s * 100.0) as u32 {
            let mut pose = JointAngles::default().to_pose(DVec3::ZERO, DQuat::IDENTITY);
            let turned = DQuat::from_rotation_y(turned_rad(f64::from(n) / 100.0));
            // As good as the other one of the two.
            let sign = if n % 2 == 0 { 1.0 } else { -1.0 };
            pose.orientation[Segment::LeftShank.index()] = turned * sign;
            calm.take(&pose, &[measured; 13], 0.01);
        }
        calm.moving()
    }

    #[test]
    fn who_sways_stands_still_and_who_walks_does_not_until_half_a_second_after() {
        assert_eq!(moving(2.0, true, |t| 0.05 * (3.0 * t).sin()), None);
        // A sensor that tells whole degrees.
        let coarse = |t: f64| (2.0 * (3.0 * t).sin()).round().to_radians();
        assert_eq!(moving(2.0, true, coarse), None);
        for lasts_s in [2.0, 2.1, 2.2, 2.3, 2.4] {
            let walks = |t: f64| 0.5 * (6.0 * t).sin();
            assert_eq!(moving(lasts_s, true, walks), Some(Segment::LeftShank), "{lasts_s}");
        }
        assert_eq!(moving(2.0, false, |t| 0.5 * (6.0 * t).sin()), None);
        let until_1_s = |t: f64| t.min(1.0);
        assert_eq!(moving(1.3, true, until_1_s), Some(Segment::LeftShank));
        assert_eq!(moving(1.8, true, until_1_s), None);
        assert_eq!(moving(0.01, true, |_| 1.0), None);
    }
}
