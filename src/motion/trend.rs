//! Where joints are and how they move, from poses that come one by one.

use crate::motion::follow::Target;
use std::collections::VecDeque;

/// Poses this much older than the newest no longer count, s: three at 60 Hz, so that the velocity
/// is not that of a single step, and short against any movement of a person.
const WINDOW_S: f64 = 0.05;
/// Most poses kept, whatever their rate.
const MOST_POSES: usize = 64;

/// The last poses of a robot's joints, and the straight line through them.
#[derive(Clone, Debug, Default)]
pub struct Trend {
    poses: VecDeque<(f64, Vec<f64>)>,
}

impl Trend {
    /// Adds the pose of a moment. One that is not later than the newest, has another number of
    /// joints, or is not finite does not count.
    pub fn push(&mut self, time_s: f64, position_rad: &[f64]) {
        let sound = time_s.is_finite() && position_rad.iter().all(|rad| rad.is_finite());
        let follows = self.poses.back().is_none_or(|(newest_s, newest)| {
            time_s > *newest_s && newest.len() == position_rad.len()
        });
        if !(sound && follows) {
            return;
        }
        self.poses.push_back((time_s, position_rad.to_vec()));
        let oldest_s = time_s - WINDOW_S * (1.0 + 1e-9);
        while self.poses.len() > MOST_POSES
            || self.poses.front().is_some_and(|(first_s, _)| *first_s < oldest_s)
        {
            self.poses.pop_front();
        }
    }

    /// The joints as of the newest pose, for use at `now_s`: least squares, so that noise is
    /// halved and even motion is told without delay. `None` before the first pose.
    #[must_use]
    pub fn target(&self, now_s: f64) -> Option<Target> {
        let (newest_s, newest) = self.poses.back()?;
        let count = self.poses.len() as f64;
        let mean_s = self.poses.iter().map(|(t, _)| t - newest_s).sum::<f64>() / count;
        let spread: f64 = self.poses.iter().map(|(t, _)| (t - newest_s - mean_s).powi(2)).sum();
        let line = |joint: usize| {
            let mean = self.poses.iter().map(|(_, q)| q[joint]).sum::<f64>() / count;
            let slope: f64 = self
                .poses
                .iter()
                .map(|(t, q)| (t - newest_s - mean_s) * (q[joint] - mean))
                .sum::<f64>();
            let slope = if spread > 0.0 { slope / spread } else { 0.0 };
            (mean - slope * mean_s, slope)
        };
        let (position_rad, velocity_rad_s) = (0..newest.len()).map(line).unzip();
        let age_s = now_s - newest_s;
        Some(Target { position_rad, velocity_rad_s, age_s, careful: Vec::new() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn even_motion_is_told_without_delay_and_only_the_last_poses_count() {
        let mut trend = Trend::default();
        assert_eq!(trend.target(0.0), None);
        trend.push(-1.0, &[9.0, 9.0]);
        for n in 0..20 {
            let t = f64::from(n) * 0.01;
            trend.push(t, &[0.3 + 2.0 * t, -t]);
        }
        let target = trend.target(0.21).unwrap();
        assert!((target.position_rad[0] - (0.3 + 0.38)).abs() < 1e-12);
        assert!((target.velocity_rad_s[0] - 2.0).abs() < 1e-9);
        assert!((target.velocity_rad_s[1] + 1.0).abs() < 1e-9);
        assert!((target.age_s - 0.02).abs() < 1e-12);
    }

    #[test]
    fn one_pose_stands_and_what_is_late_odd_or_no_number_does_not_count() {
        let mut trend = Trend::default();
        trend.push(1.0, &[0.5]);
        for (time_s, pose) in [(0.9, vec![7.0]), (1.1, vec![1.0, 2.0]), (1.2, vec![f64::NAN])] {
            trend.push(time_s, &pose);
        }
        trend.push(f64::INFINITY, &[1.0]);
        let target = trend.target(1.0).unwrap();
        assert_eq!((target.position_rad, target.velocity_rad_s), (vec![0.5], vec![0.0]));
    }
}
