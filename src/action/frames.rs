//! What a corpus holds of one variation: the one place where a motion becomes its rows.

use crate::action::Motion;
use crate::body::contact::ON_FLOOR_M;
use crate::body::{Joint, JointAngles, JointPositions, Proportions, root, stance};
use crate::error::Error;
use glam::{DQuat, DVec3};

/// Names of the parts of the feet, in the order of [`CorpusPose::carries`], which is that of
/// [`root::SOLES`].
pub const SOLES: [&str; 4] = ["left_heel", "left_toe", "right_heel", "right_toe"];

const ENDS: [&str; 7] = [
    "head_top",
    "left_fingertip",
    "right_fingertip",
    "left_heel",
    "left_toe",
    "right_heel",
    "right_toe",
];

/// Points of a body in a corpus: 15 joints and 7 ends.
pub const POINTS: usize = Joint::ALL.len() + ENDS.len();

/// Names of the points, in the order of [`CorpusPose::points_m`].
pub fn point_names() -> impl Iterator<Item = &'static str> {
    Joint::ALL.into_iter().map(Joint::name).chain(ENDS)
}

/// A body at an instant.
#[derive(Clone, Debug, PartialEq)]
pub struct CorpusPose {
    /// Its 22 angles.
    pub angles: JointAngles,
    /// Middle between the hip joints in the world, m.
    pub root_m: DVec3,
    /// Orientation of the pelvis in the world.
    pub pelvis: DQuat,
    /// Which parts of the feet carry, in the order of [`SOLES`].
    pub carries: [bool; 4],
    at: JointPositions,
}

impl CorpusPose {
    /// Where joints and ends are in the world, m.
    #[must_use]
    pub fn points_m(&self) -> [DVec3; POINTS] {
        let mut points = self.at.joints_m.iter().chain(&self.at.ends_m);
        std::array::from_fn(|_| points.next().copied().unwrap_or_default())
    }
}

/// A motion of a body with these proportions, at an even rate from 0 s on.
///
/// # Errors
/// As [`Motion::placed`].
pub fn frames(motion: &Motion, body: &Proportions, rate_hz: f64) -> Result<Vec<CorpusPose>, Error> {
    let placed = motion.placed(body, rate_hz)?.into_iter();
    let frame = |(angles, pelvis, root_m): (JointAngles, DQuat, DVec3)| {
        let at = body.positions(&stance::on_flat_soles(&angles, root_m, pelvis));
        let carries = root::SOLES.map(|end| at.end_m(end).z < ON_FLOOR_M);
        CorpusPose { angles, root_m, pelvis, carries, at }
    };
    Ok(placed.map(frame).collect())
}
