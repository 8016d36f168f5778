//! What a corpus holds of one variation: the one place where a motion becomes its rows.

use crate::action::Motion;
use crate::body::contact::{ON_FLOOR_M, worst_slide_m};
use crate::body::{Joint, JointAngles, JointPositions, Proportions, root, stance};
use crate::error::Error;
use glam::{DQuat, DVec3};

/// Names of the parts of the feet, in the order of [`CorpusPose::carries`], which is that of
/// [`root::SOLES`].
pub const SOLES: [&str; 4] = ["left_heel", "left_toe", "right_heel", "right_toe"];

/// A sole of a valid variation sinks into the floor by less, m.
const SINKS_M: f64 = 0.001;
/// While it is on the floor, a sole of a valid variation slides by less, m.
const SLIDES_M: f64 = 0.005;
/// The root of a valid variation is accelerated by less, m/s^2 ...
const ROOT_M_S2: f64 = 18.0;
/// ... and by less than this if it flies, and so lands.
const LANDING_ROOT_M_S2: f64 = 40.0;

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

/// Whether a person could do a variation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum VariationStatus {
    /// Its feet stand where they stand, on the floor, and its root is not jerked.
    Valid,
    /// Somewhere they do not, or it is.
    Implausible,
}

impl VariationStatus {
    /// As it stands in tables.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Valid => "valid",
            Self::Implausible => "implausible",
        }
    }
}

/// A variation as it goes into a corpus.
#[derive(Clone, Debug, PartialEq)]
pub struct CorpusPoses {
    /// Whether a person could do it.
    pub status: VariationStatus,
    /// By pose.
    pub frames: Vec<CorpusPose>,
}

/// A motion of a body with these proportions, at an even rate from 0 s on.
///
/// # Errors
/// As [`Motion::placed`].
pub fn frames(motion: &Motion, body: &Proportions, rate_hz: f64) -> Result<CorpusPoses, Error> {
    let placed = motion.placed(body, rate_hz)?.into_iter();
    let frame = |(angles, pelvis, root_m): (JointAngles, DQuat, DVec3)| {
        let at = body.positions(&stance::on_flat_soles(&angles, root_m, pelvis));
        let carries = root::SOLES.map(|end| at.end_m(end).z < ON_FLOOR_M);
        CorpusPose { angles, root_m, pelvis, carries, at }
    };
    let frames: Vec<CorpusPose> = placed.map(frame).collect();
    Ok(CorpusPoses { status: status(&frames, rate_hz), frames })
}

/// As far as poses at this rate show it.
fn status(frames: &[CorpusPose], rate_hz: f64) -> VariationStatus {
    let soles_m: Vec<[DVec3; 4]> =
        frames.iter().map(|frame| root::SOLES.map(|end| frame.at.end_m(end))).collect();
    let sinks = soles_m.iter().flatten().any(|sole_m| !(sole_m.z > -SINKS_M));
    let flies = frames.iter().any(|frame| !frame.carries.contains(&true));
    let most = if flies { LANDING_ROOT_M_S2 } else { ROOT_M_S2 };
    let jerked = frames.windows(3).any(|three| {
        let bend = three[0].root_m - 2.0 * three[1].root_m + three[2].root_m;
        !(bend.length() * rate_hz * rate_hz < most)
    });
    if sinks || jerked || !(worst_slide_m(&soles_m) < SLIDES_M) {
        VariationStatus::Implausible
    } else {
        VariationStatus::Valid
    }
}
