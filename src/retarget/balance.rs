//! Whether a robot stays on its feet: where the floor has to push, and what becomes of it where the floor
//! cannot.
//!
//! A body whose zero-moment point (quasi-statically, the point under its centre of mass) leaves its
//! support tips about the edge. Tipping is that of an inverted pendulum: with x the way its centre has gone
//! over the edge and m how far inside the support the point lies, x'' = g / h (x - m), x not below 0
//! (Kajita et al., "The 3D linear inverted pendulum mode", IROS 2001, its support held at the edge). So a short
//! moment outside is survived, and a longer one is a fall. Servos are taken for stiff.

use crate::error::Error;
use crate::motion::low_pass;
use crate::retarget::base::{ON_FLOOR_M, StandingSole};
use crate::rigid::Placement;
use crate::rigid::ground::{GRAVITY_M_S2, GroundReaction, SupportPolygon, reaction_of};
use crate::rigid::mass::{Momentum, Posed, centre_m};
use crate::robot::RobotBody;
use glam::{DVec2, DVec3};

/// Where the floor pushes is told below this frequency, Hz: faster shaking is taken up by gears and soles.
pub(super) const CUTOFF_HZ: f64 = 8.0;
/// The same as a part of the rate, at most.
pub(super) const CUTOFF_SHARE: f64 = 0.2;
/// A zero-moment point this near to the point under the centre of mass is that point, m.
const QUASI_STATIC_M: f64 = 0.003;
/// With less than this part of its weight a body does not stand on anything.
pub(super) const HARDLY: f64 = 0.1;
/// A body whose centre has gone this far over the edge, as part of its height, does not come back.
const LOST: f64 = 0.2;

/// What a body does to the floor, pose by pose.
#[derive(Clone, Debug)]
pub struct FloorLoad<'a> {
    body: &'a RobotBody,
    soles: &'a [StandingSole],
    step_s: f64,
    now: Vec<Posed>,
    /// What it has on the way to there.
    momentum: Momentum,
    /// Under the centre of mass, m.
    centres_m: Vec<DVec2>,
    height_m: f64,
    /// Vertical force, weights.
    forces: Vec<f64>,
    /// That force times where it acts, m.
    moments_m: Vec<DVec2>,
    /// Corners on the floor, m, and how many those of all poses up to each are.
    corners_m: Vec<DVec2>,
    ends: Vec<usize>,
}

/// How a body keeps its balance.
#[derive(Clone, Debug, PartialEq)]
pub struct Balance {
    /// By pose, how far inside its support the zero-moment point lies, m; outside if negative. None where
    /// nothing carries.
    pub margins_m: Vec<Option<f64>>,
    /// Index of the pose in which it is lost, if it falls.
    pub falls_at: Option<usize>,
}

impl<'a> FloorLoad<'a> {
    /// Of poses that follow at `rate_hz`.
    #[must_use]
    pub const fn new(body: &'a RobotBody, soles: &'a [StandingSole], rate_hz: f64) -> Self {
        Self {
            body,
            soles,
            step_s: 1.0 / rate_hz,
            now: Vec::new(),
            momentum: Momentum { linear_kg_m_s: DVec3::ZERO, angular_kg_m2_s: DVec3::ZERO },
            centres_m: Vec::new(),
            height_m: 0.0,
            forces: Vec::new(),
            moments_m: Vec::new(),
            corners_m: Vec::new(),
            ends: Vec::new(),
        }
    }

    /// The next pose: where all links are in the world.
    pub fn next(&mut self, placed: &[Placement]) {
        let links = self.body.tree.links().iter().zip(placed);
        let weighing = links.filter(|(link, _)| link.mass.mass_kg > 0.0);
        let after: Vec<Posed> = weighing
            .map(|(link, place)| Posed {
                mass: link.mass,
                origin_m: place.at_m,
                turned: place.turn,
            })
            .collect();
        let centre_m = centre_m(&after);
        self.height_m = self.height_m.max(centre_m.z);
        self.centres_m.push(centre_m.truncate());
        for sole in self.soles {
            let corners = sole.corners_m.iter().map(|corner| placed[sole.link].point(*corner));
            let down = corners.filter(|corner| corner.z < ON_FLOOR_M);
            self.corners_m.extend(down.map(|corner| corner.truncate()));
        }
        self.ends.push(self.corners_m.len());
        // Nothing moves before the first pose.
        if self.centres_m.len() > 1 {
            self.push(Momentum::between(&self.now, &after, self.step_s));
        }
        self.now = after;
    }

    /// What the floor does to the last pose, from which it goes on like this.
    fn push(&mut self, next: Momentum) {
        let GroundReaction { force_n, zero_moment_point_m } =
            reaction_of(&self.now, [self.momentum, next], self.step_s);
        self.momentum = next;
        let weight_n = self.body.tree.mass_kg() * GRAVITY_M_S2;
        let force = if weight_n > 0.0 { force_n.z / weight_n } else { 0.0 };
        self.forces.push(force);
        self.moments_m.push(zero_moment_point_m.unwrap_or_default() * force);
    }

    /// What came of all poses.
    ///
    /// # Errors
    /// A rate at which nothing can be filtered.
    pub fn finish(mut self) -> Result<Balance, Error> {
        if !self.centres_m.is_empty() {
            self.push(Momentum::default());
        }
        let rate_hz = 1.0 / self.step_s;
        let filtered =
            |values: Vec<f64>| low_pass(&values, rate_hz, CUTOFF_HZ.min(CUTOFF_SHARE * rate_hz));
        let along = filtered(self.moments_m.iter().map(|moment| moment.x).collect())?;
        let aside = filtered(self.moments_m.iter().map(|moment| moment.y).collect())?;
        let forces = filtered(self.forces)?;
        let mut begins = 0;
        let mut margins_m = Vec::with_capacity(self.ends.len());
        for (at, end) in self.ends.iter().enumerate() {
            let support = SupportPolygon::of(&self.corners_m[begins..*end]);
            begins = *end;
            let force = forces[at];
            let centre_m = self.centres_m[at];
            let point_m = DVec2::new(along[at], aside[at]) / force;
            let quasi_static = point_m.distance(centre_m) < QUASI_STATIC_M;
            let point_m = if quasi_static { centre_m } else { point_m };
            margins_m.push((force > HARDLY).then(|| support.margin_m(point_m)).flatten());
        }
        let falls_at = falls_at(&margins_m, self.step_s, self.height_m);
        Ok(Balance { margins_m, falls_at })
    }
}

/// In which pose a body of this height of its centre, m, is lost, if in any.
#[must_use]
pub fn falls_at(margins_m: &[Option<f64>], step_s: f64, height_m: f64) -> Option<usize> {
    let rate = GRAVITY_M_S2 / height_m.max(1e-3);
    let (mut over_m, mut speed_m_s) = (0.0_f64, 0.0_f64);
    margins_m.iter().position(|margin_m| {
        // Who stands on nothing is neither held nor tipped.
        let margin_m = margin_m.unwrap_or(over_m);
        speed_m_s += rate * (over_m - margin_m) * step_s;
        over_m += speed_m_s * step_s;
        if over_m <= 0.0 {
            (over_m, speed_m_s) = (0.0, 0.0);
        }
        over_m > LOST * height_m
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Out of the support by d from rest, x = d (cosh(w t) - 1).
    #[test]
    fn who_stands_outside_the_support_falls_as_a_pendulum_does() {
        let (height_m, outside_m, step_s) = (0.25, 0.01, 1e-4);
        let margins = vec![Some(-outside_m); 20_000];
        let at = falls_at(&margins, step_s, height_m).expect("a fall");
        let w = (GRAVITY_M_S2 / height_m).sqrt();
        let expected_s = (1.0 + LOST * height_m / outside_m).acosh() / w;
        assert!((at as f64 * step_s - expected_s).abs() < 2e-3, "{at} {expected_s}");
    }

    #[test]
    fn a_short_moment_outside_is_survived_and_a_longer_one_is_not() {
        let fall = |outside: usize| {
            let mut margins = vec![Some(0.03); 100];
            margins.extend(vec![Some(-0.01); outside]);
            margins.extend(vec![Some(0.03); 400]);
            falls_at(&margins, 0.01, 0.25)
        };
        assert_eq!((fall(0), fall(10)), (None, None));
        assert!(fall(80).is_some());
    }

    #[test]
    fn nothing_does_not_fall() {
        assert_eq!(falls_at(&[], 0.01, 0.0), None);
        assert_eq!(falls_at(&[None; 50], 0.01, 0.25), None);
    }
}
