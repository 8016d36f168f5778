//! Points and directions of a placed skeleton that the searches for unit, axes and rest pose share.

use crate::body::Segment;
use crate::mocap::mapping::{ARMS, LEGS, Mapping};
use crate::mocap::skeleton::Placed;
use glam::DVec3;

/// A placed skeleton seen as a body.
#[derive(Clone, Copy)]
pub struct Landmarks<'a> {
    /// Which joint is what.
    pub mapping: &'a Mapping,
    /// Where the joints are.
    pub placed: &'a Placed,
    /// Length of one file unit in `placed`.
    pub unit: f64,
}

impl Landmarks<'_> {
    /// The joint at the segment's upper end.
    pub fn joint(&self, segment: Segment) -> Option<DVec3> {
        Some(self.placed.position[self.mapping.part(segment)?.joint])
    }

    /// From the segment's joint to its far end.
    pub fn bone(&self, segment: Segment) -> Option<DVec3> {
        let part = self.mapping.part(segment)?;
        Some(self.placed.point(part.tip?, self.unit) - self.placed.position[part.joint])
    }

    /// Direction of [`Self::bone`].
    pub fn direction(&self, segment: Segment) -> Option<DVec3> {
        self.bone(segment)?.try_normalize()
    }

    /// Midpoint of the joints of two segments.
    fn middle(&self, [left, right]: [Segment; 2]) -> Option<DVec3> {
        Some(self.joint(left)?.midpoint(self.joint(right)?))
    }

    /// Midpoint between the hip joints, or the pelvis.
    pub fn hips(&self) -> DVec3 {
        self.middle([Segment::LeftThigh, Segment::RightThigh])
            .or_else(|| self.joint(Segment::Pelvis))
            .unwrap_or(self.placed.position[0])
    }

    /// Top of the trunk: midpoint between the shoulders, or the neck, or the head.
    pub fn trunk_top(&self) -> Option<DVec3> {
        self.middle([Segment::LeftUpperArm, Segment::RightUpperArm])
            .or_else(|| Some(self.placed.position[self.mapping.neck?]))
            .or_else(|| self.joint(Segment::Head))
    }

    /// From the hips to the top of the trunk.
    pub fn trunk(&self) -> Option<DVec3> {
        (self.trunk_top()? - self.hips()).try_normalize()
    }

    /// From the right hip joint to the left.
    pub fn hip_line(&self) -> Option<DVec3> {
        let left = self.joint(Segment::LeftThigh)?;
        (left - self.joint(Segment::RightThigh)?).try_normalize()
    }

    /// From the right shoulder joint to the left.
    pub fn shoulder_line(&self) -> Option<DVec3> {
        let left = self.joint(Segment::LeftUpperArm)?;
        (left - self.joint(Segment::RightUpperArm)?).try_normalize()
    }

    /// The line across the body: hips, or shoulders.
    pub fn across(&self) -> Option<DVec3> {
        self.hip_line().or_else(|| self.shoulder_line())
    }

    /// Along the whole body upwards: trunk and legs together, about unit length when upright.
    pub fn body_axis(&self) -> Option<DVec3> {
        let trunk = self.trunk();
        let feet = self.middle([Segment::LeftFoot, Segment::RightFoot]);
        let legs = feet.and_then(|feet| (self.hips() - feet).try_normalize());
        match (trunk, legs) {
            (Some(trunk), Some(legs)) => Some(trunk.midpoint(legs)),
            (one, other) => one.or(other),
        }
    }

    /// True if the body stands as models are drawn: upright along `up`, legs down and straight,
    /// arms straight and alike, hanging, spread or anything between.
    pub fn is_rest_like(&self, up: DVec3) -> bool {
        let near = |a: DVec3, b: DVec3, cosine: f64| a.dot(b) >= cosine;
        let Some(trunk) = self.trunk() else { return false };
        let Some(across) = self.across() else { return false };
        let mut rest = near(trunk, up, 0.95) && across.dot(up).abs() < 0.2;
        for [thigh, shank, _] in LEGS {
            if let (Some(thigh), Some(shank)) = (self.direction(thigh), self.direction(shank)) {
                rest &= near(thigh, -up, 0.88) && near(thigh, shank, 0.93);
            }
        }
        let mut lift = Vec::new();
        for ([upper, lower], outwards) in ARMS.into_iter().zip([across, -across]) {
            if let (Some(upper), Some(lower)) = (self.direction(upper), self.direction(lower)) {
                let sagittal = upper.dot(across.cross(up));
                rest &= near(upper, lower, 0.88) && sagittal.abs() < 0.4;
                rest &= upper.dot(outwards) > -0.1 && upper.dot(up) < 0.4;
                lift.push(upper.dot(up));
            }
        }
        rest && lift.windows(2).all(|pair| (pair[0] - pair[1]).abs() < 0.25)
    }
}
