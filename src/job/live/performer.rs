//! Somebody who does a recorded motion now.

use crate::body::SegmentPose;
use crate::mocap::anatomy::Capture;

/// So long a robot that is late is waited for at the end, s.
pub const LONGEST_WAIT_S: f64 = 3.0;

/// Performs a capture: stands in its first pose until the robot has reached it, then moves.
pub struct Performer {
    capture: Capture,
    longest_s: f64,
    began_s: Option<f64>,
}

impl Performer {
    /// Performs `capture`, for `duration_s` if that is shorter than it.
    pub fn new(capture: Capture, duration_s: Option<f64>) -> Self {
        let last = capture.poses.len().saturating_sub(1) as f64;
        let longest_s = duration_s.unwrap_or(f64::INFINITY).min(last / capture.rate_hz);
        Self { capture, longest_s, began_s: None }
    }

    /// The pose at a moment; `None` once the performance is over. While the robot is on its way to
    /// the first pose, that is held; and the last one while the robot is late, `waits`.
    pub fn pose(&mut self, now_s: f64, approaching: bool, waits: bool) -> Option<SegmentPose> {
        if !approaching && self.began_s.is_none() {
            self.began_s = Some(now_s);
        }
        let time_s = self.began_s.map_or(0.0, |began_s| now_s - began_s);
        let is_over = !(time_s <= self.longest_s);
        if is_over && !(waits && time_s <= self.longest_s + LONGEST_WAIT_S) {
            return None;
        }
        (!self.capture.poses.is_empty()).then(|| self.capture.at(time_s.min(self.longest_s)))
    }
}
