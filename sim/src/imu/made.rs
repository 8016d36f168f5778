//! A motion that is made as it goes: nobody knows beforehand what the body will do.
//!
//! What a sensor undergoes at a moment follows from the poses around it, by the same curves as for a motion that was made
//! beforehand ([`BodyMotion`]). Of a pose further away the curve at that moment knows next to nothing: its share falls by the
//! factor 2 - sqrt(3) from pose to pose, so [`AROUND`] poses to either side are as good as all of them.

use super::{BodyMotion, ImuError, Kinematics, Mount};
use std::fmt::{Debug, Formatter};
use std::sync::Arc;

/// So many poses before a moment and after it decide what a sensor undergoes; so many are asked for ahead of time.
pub const AROUND: u64 = 12;

/// Where a segment is at one time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SegmentAt {
    /// Its origin, m.
    pub position_m: [f64; 3],
    /// Turns vectors of the segment into the world's, w, x, y, z.
    pub orientation: [f64; 4],
}

/// Makes poses as they are needed. The number of a pose counts from zero, at the motion's beginning; what is asked for twice is
/// the same twice, as long as it is not long ago. Numbers that are not finite make samples that mean nothing.
pub trait MakesPoses: Send + Sync {
    /// The poses from one number on, in their order: as many as `into` has places.
    fn poses(&self, from: u64, into: &mut [SegmentAt]);
}

/// Poses of a segment, evenly spaced in time, that are made as they are needed; it has no end.
#[derive(Clone)]
pub struct MadeMotion {
    rate_hz: f64,
    makes: Arc<dyn MakesPoses>,
}

impl MadeMotion {
    /// A motion of `rate_hz` poses in a second.
    ///
    /// # Errors
    /// A rate that is not above zero.
    pub fn new(rate_hz: f64, makes: Arc<dyn MakesPoses>) -> Result<Self, ImuError> {
        if !(rate_hz.is_finite() && rate_hz > 0.0) {
            return Err(ImuError::Number("the rate of the poses"));
        }
        Ok(Self { rate_hz, makes })
    }

    /// What a sensor mounted so undergoes at `time_s` since the first pose.
    #[must_use]
    pub fn at(&self, time_s: f64, mount: &Mount) -> Kinematics {
        // What is not a time is the beginning.
        let now = (time_s * self.rate_hz).floor() as u64;
        let from = now.saturating_sub(AROUND);
        let still = SegmentAt { position_m: [0.0; 3], orientation: [1.0, 0.0, 0.0, 0.0] };
        let mut poses = vec![still; (now - from + AROUND + 2) as usize];
        self.makes.poses(from, &mut poses);
        let positions: Vec<_> = poses.iter().map(|pose| pose.position_m).collect();
        let orientations: Vec<_> = poses.iter().map(|pose| pose.orientation).collect();
        let around = BodyMotion::through(self.rate_hz, &positions, &orientations);
        around.at(time_s - from as f64 / self.rate_hz, mount)
    }
}

impl Debug for MadeMotion {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("MadeMotion").field("rate_hz", &self.rate_hz).finish_non_exhaustive()
    }
}

/// What carries a sensor.
#[derive(Clone, Debug)]
pub enum ImuMotion {
    /// A motion that was made beforehand.
    Played(Box<BodyMotion>),
    /// One that is made as it goes.
    Made(MadeMotion),
}

impl ImuMotion {
    /// What a sensor mounted so undergoes at `time_s` since the beginning.
    #[must_use]
    pub fn at(&self, time_s: f64, mount: &Mount) -> Kinematics {
        match self {
            Self::Played(motion) => motion.at(time_s, mount),
            Self::Made(motion) => motion.at(time_s, mount),
        }
    }

    /// When it is over, s; one that is made as it goes never is.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        match self {
            Self::Played(motion) => motion.duration_s(),
            Self::Made(_) => f64::INFINITY,
        }
    }
}

impl From<BodyMotion> for ImuMotion {
    fn from(motion: BodyMotion) -> Self {
        Self::Played(Box::new(motion))
    }
}

impl From<MadeMotion> for ImuMotion {
    fn from(motion: MadeMotion) -> Self {
        Self::Made(motion)
    }
}
