//! What of the feet is on the floor, how still it stands there, and how hard the floor has to push: whether
//! a motion could be done.

use core::ops::Range;
use glam::{DVec2, DVec3};

use crate::body::mass::{self, segment_masses};
use crate::body::root::SOLES;
use crate::body::{Proportions, SegmentPose};
use crate::error::Error;
use crate::motion::smooth::low_pass;
use crate::rigid::ground::{self, GRAVITY_M_S2, GroundReaction, SupportPolygon};
use crate::rigid::mass::Posed;

/// A sole lower than this is on the floor, m.
pub const ON_FLOOR_M: f64 = 0.005;
/// Breadth of a sole, part of the stature (Drillis and Contini, as for [`Proportions`]).
const FOOT_BREADTH: f64 = 0.055;
/// With less than this part of its weight a body does not stand on anything.
const HARDLY: f64 = 0.1;
/// Forces are told below this frequency, Hz: what lies above is noise of differences.
pub const FORCE_CUTOFF_HZ: f64 = 20.0;

/// Half the breadth of a sole, m.
#[must_use]
pub fn half_breadth_m(body: &Proportions) -> f64 {
    FOOT_BREADTH * body.stature_m() / 2.0
}

/// Where [`SOLES`] are in a pose, m.
#[must_use]
pub fn places_m(body: &Proportions, pose: &SegmentPose) -> [DVec3; 4] {
    let at = body.positions(pose);
    SOLES.map(|end| at.end_m(end))
}

/// Which of [`SOLES`] are on the floor, from where they are.
#[must_use]
pub fn on_floor(soles_m: &[DVec3; 4]) -> [bool; 4] {
    soles_m.map(|sole_m| sole_m.z < ON_FLOOR_M)
}

/// The area between those corners of the soles that are on the floor in a pose.
#[must_use]
pub fn support(body: &Proportions, pose: &SegmentPose) -> SupportPolygon {
    let half_m = DVec3::Y * half_breadth_m(body);
    let corners = SOLES.iter().zip(places_m(body, pose)).flat_map(|(end, sole_m)| {
        let aside_m = pose.orientation[end.segment().index()] * half_m;
        [sole_m - aside_m, sole_m + aside_m]
    });
    let carries = |corner_m: &DVec3| corner_m.z < ON_FLOOR_M;
    let floor: Vec<DVec2> = corners.filter(carries).map(|corner_m| corner_m.truncate()).collect();
    SupportPolygon::of(&floor)
}

/// The area between the corners of those of [`SOLES`] that carry in a pose.
#[must_use]
pub fn support_of(body: &Proportions, pose: &SegmentPose, carries: &[bool; 4]) -> SupportPolygon {
    let half_m = DVec3::Y * half_breadth_m(body);
    let carrying = SOLES.iter().zip(places_m(body, pose)).zip(carries).filter(|(_, is)| **is);
    let corners = carrying.flat_map(|((end, sole_m), _)| {
        let aside_m = pose.orientation[end.segment().index()] * half_m;
        [sole_m - aside_m, sole_m + aside_m].map(DVec3::truncate)
    });
    SupportPolygon::of(&corners.collect::<Vec<_>>())
}

/// Height of the floor under a body that does not stand on z = 0, m: the one near which its lowest sole is
/// for longest (the median of the heights in the fullest span of twice [`ON_FLOOR_M`]).
#[must_use]
pub fn floor_m(body: &Proportions, poses: &[SegmentPose]) -> f64 {
    let lowest =
        |pose| places_m(body, pose).iter().map(|place_m| place_m.z).fold(f64::MAX, f64::min);
    let mut heights_m: Vec<f64> = poses.iter().map(lowest).collect();
    heights_m.sort_by(f64::total_cmp);
    let mut fullest = &heights_m[..0];
    let mut first = 0;
    for (last, height_m) in heights_m.iter().enumerate() {
        while height_m - heights_m[first] > 2.0 * ON_FLOOR_M {
            first += 1;
        }
        if last + 1 - first > fullest.len() {
            fullest = &heights_m[first..=last];
        }
    }
    fullest.get(fullest.len() / 2).copied().unwrap_or(0.0)
}

/// How a body stands on its feet while it moves.
#[derive(Clone, Debug, PartialEq)]
pub struct Footing {
    rate_hz: f64,
    roots_m: Vec<DVec3>,
    /// By pose, in the order of [`SOLES`].
    soles_m: Vec<[DVec3; 4]>,
    force_body_weights: Vec<f64>,
    /// By pose, how far inside the soles on the floor the zero-moment point lies, m; none in the air.
    margins_m: Vec<Option<f64>>,
}

impl Footing {
    /// Of poses that follow at `rate_hz`.
    ///
    /// # Errors
    /// If the rate is too low for a force to be told: twice [`FORCE_CUTOFF_HZ`].
    pub fn of(body: &Proportions, poses: &[SegmentPose], rate_hz: f64) -> Result<Self, Error> {
        let masses = segment_masses(body);
        let bodies: Vec<[Posed; 13]> =
            poses.iter().map(|pose| mass::posed(body, &masses, pose)).collect();
        let soles_m: Vec<[DVec3; 4]> = poses.iter().map(|pose| places_m(body, pose)).collect();
        let reactions = ground::reactions(&bodies, rate_hz);
        // The table's parts of a body's mass add up to 0.9999 of it.
        let weight_n = masses.iter().map(|mass| mass.mass_kg).sum::<f64>() * GRAVITY_M_S2;
        let pushed: Vec<f64> =
            reactions.iter().map(|reaction| reaction.force_n.z / weight_n).collect();
        // Where it acts is told as smoothly as the force: its moment about the origin is filtered.
        let moment = |axis: fn(DVec2) -> f64| {
            let of = |reaction: &GroundReaction| {
                reaction.zero_moment_point_m.map_or(0.0, axis) * reaction.force_n.z / weight_n
            };
            low_pass(&reactions.iter().map(of).collect::<Vec<_>>(), rate_hz, FORCE_CUTOFF_HZ)
        };
        let force_body_weights = low_pass(&pushed, rate_hz, FORCE_CUTOFF_HZ)?;
        let (along, aside) = (moment(|point| point.x)?, moment(|point| point.y)?);
        let margins_m = (0..poses.len())
            .map(|at| {
                let force = force_body_weights[at];
                if !(force > HARDLY) {
                    return None;
                }
                support(body, &poses[at]).margin_m(DVec2::new(along[at] / force, aside[at] / force))
            })
            .collect();
        Ok(Self {
            rate_hz,
            roots_m: poses.iter().map(|pose| pose.root_m).collect(),
            soles_m,
            force_body_weights,
            margins_m,
        })
    }

    /// By pose, how far inside the soles on the floor the zero-moment point lies, m: outside if negative,
    /// none while the floor hardly pushes or no sole is on it. A body that is outside falls, or is held.
    #[must_use]
    pub fn margins_m(&self) -> &[Option<f64>] {
        &self.margins_m
    }

    /// Vertical force of the floor below [`FORCE_CUTOFF_HZ`], body weights, by pose.
    #[must_use]
    pub fn force_body_weights(&self) -> &[f64] {
        &self.force_body_weights
    }

    /// Height of the lowest sole, m: negative where it sinks into the floor.
    #[must_use]
    pub fn lowest_m(&self) -> f64 {
        lowest_m(&self.soles_m)
    }

    /// Which of [`SOLES`] are on the floor in a pose.
    #[must_use]
    pub fn on_floor(&self, pose: usize) -> [bool; 4] {
        on_floor(&self.soles_m[pose])
    }

    /// How far an end of a sole slides while it is on the floor, m, as [`worst_slide_m`].
    #[must_use]
    pub fn slide_m(&self) -> f64 {
        worst_slide_m(&self.soles_m)
    }

    /// Greatest acceleration of the root, m/s^2.
    #[must_use]
    pub fn root_acceleration_m_s2(&self) -> f64 {
        let bends = self.roots_m.windows(3).map(|three| three[0] - 2.0 * three[1] + three[2]);
        bends.map(|bend| bend.length() * self.rate_hz * self.rate_hz).fold(0.0, f64::max)
    }

    /// Part of some poses in which both feet are on the floor.
    #[must_use]
    pub fn both_feet(&self, poses: Range<usize>) -> f64 {
        self.share(poses, |[a, b, c, d]| (a || b) && (c || d))
    }

    /// Part of some poses in which no foot is on the floor.
    #[must_use]
    pub fn flying(&self, poses: Range<usize>) -> f64 {
        self.share(poses, |down| !down.contains(&true))
    }

    fn share(&self, poses: Range<usize>, holds: impl Fn([bool; 4]) -> bool) -> f64 {
        let count = poses.len().max(1) as f64;
        poses.filter(|pose| holds(self.on_floor(*pose))).count() as f64 / count
    }

    /// How far the middle of the feet is from where it was at first, over the floor, m: the furthest, and at
    /// last.
    #[must_use]
    pub fn travel_m(&self) -> (f64, f64) {
        let middle = |soles_m: &[DVec3; 4]| soles_m.iter().sum::<DVec3>().truncate() / 4.0;
        let (Some(first), Some(last)) = (self.soles_m.first(), self.soles_m.last()) else {
            return (0.0, 0.0);
        };
        let away_m = |soles_m| middle(soles_m).distance(middle(first));
        (self.soles_m.iter().map(away_m).fold(0.0, f64::max), away_m(last))
    }

    /// The vertical force that a part of the time lies below, body weights: `share` 0 to 1.
    #[must_use]
    pub fn force_quantile(&self, share: f64) -> f64 {
        let mut sorted = self.force_body_weights.clone();
        sorted.sort_by(f64::total_cmp);
        let at = (share.clamp(0.0, 1.0) * sorted.len().saturating_sub(1) as f64).round() as usize;
        sorted.get(at).copied().unwrap_or(0.0)
    }
}

/// Between two poses soles are looked at so often: they go there as a cubic through four poses, which at 240
/// poses a second is off by some micrometres.
const LOOKS_BETWEEN: usize = 8;

/// How far one of [`SOLES`] slides while it is on the floor, m, the worst of all contacts: the diagonal of the
/// rectangle that holds its places, from the instant it comes down to the one it leaves, wherever those lie
/// between two poses. By pose.
#[must_use]
pub fn worst_slide_m(soles_m: &[[DVec3; 4]]) -> f64 {
    let mut worst_m = 0.0f64;
    for end in 0..SOLES.len() {
        let mut held: Option<(DVec3, DVec3)> = None;
        let mut last_m: Option<DVec3> = None;
        for_each_look(soles_m, end, |between, part, at_m| {
            let carries = at_m.z < ON_FLOOR_M;
            let mut places_m = [carries.then_some(at_m), None];
            if let Some(before_m) = last_m.replace(at_m)
                && (before_m.z < ON_FLOOR_M) != carries
            {
                let back = (at_m.z - ON_FLOOR_M) / (at_m.z - before_m.z);
                places_m[1] = Some(between.at_m(part - back / LOOKS_BETWEEN as f64));
            }
            for place_m in places_m.into_iter().flatten() {
                let (least, most) = held.unwrap_or((place_m, place_m));
                let (least, most) = (least.min(place_m), most.max(place_m));
                worst_m = worst_m.max((most - least).truncate().length());
                held = Some((least, most));
            }
            if !carries {
                held = None;
            }
        });
    }
    worst_m
}

/// Height of the lowest of [`SOLES`] at any time, m, by pose.
#[must_use]
pub fn lowest_m(soles_m: &[[DVec3; 4]]) -> f64 {
    let mut lowest_m = f64::MAX;
    for end in 0..SOLES.len() {
        for_each_look(soles_m, end, |_, _, at_m| lowest_m = lowest_m.min(at_m.z));
    }
    lowest_m
}

/// Where a sole is from one pose to the next: a cubic through them and the two beside.
#[derive(Clone, Copy, Debug)]
struct Between([DVec3; 4]);

impl Between {
    /// At a part of the way, 0 to 1.
    fn at_m(&self, u: f64) -> DVec3 {
        let [a, b, c, d] = self.0;
        let outer = u * (u - 1.0) / 6.0;
        let inner = (u + 1.0) * (u - 2.0) / 2.0;
        // Against one of them, so that a sole that stands still does so exactly.
        b - (a - b) * (outer * (u - 2.0)) - (c - b) * (inner * u) + (d - b) * (outer * (u + 1.0))
    }
}

/// Tells where a sole is in every pose, and between any two of which one is near the floor.
fn for_each_look(soles_m: &[[DVec3; 4]], end: usize, mut look: impl FnMut(&Between, f64, DVec3)) {
    let Some(last) = soles_m.len().checked_sub(1) else { return };
    let near = |pose: usize| soles_m[pose][end].z < 4.0 * ON_FLOOR_M;
    for pose in 0..last {
        let place_m = |pose: usize| soles_m[pose.min(last)][end];
        let before_m = place_m(pose.saturating_sub(1));
        let between = Between([before_m, place_m(pose), place_m(pose + 1), place_m(pose + 2)]);
        look(&between, 0.0, place_m(pose));
        if near(pose) || near(pose + 1) {
            for step in 1..LOOKS_BETWEEN {
                let part = step as f64 / LOOKS_BETWEEN as f64;
                look(&between, part, between.at_m(part));
            }
        }
    }
    let last_m = soles_m[last][end];
    look(&Between([last_m; 4]), 0.0, last_m);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::JointAngles;
    use glam::DQuat;

    const RATE_HZ: f64 = 240.0;

    fn standing(root_m: impl Fn(f64) -> DVec3) -> Footing {
        let body = Proportions::of_stature(1.75).unwrap();
        let height_m = DVec3::Z * body.root_height_m();
        let pose = |i: u32| {
            let at_m = height_m + root_m(f64::from(i) / RATE_HZ);
            JointAngles::default().to_pose(at_m, DQuat::IDENTITY)
        };
        Footing::of(&body, &(0..480).map(pose).collect::<Vec<_>>(), RATE_HZ).unwrap()
    }

    #[test]
    fn who_stands_still_presses_with_the_weight_of_the_body_and_does_not_slide() {
        let still = standing(|_| DVec3::ZERO);
        assert!(still.force_body_weights().iter().all(|force| (force - 1.0).abs() < 1e-6));
        assert_eq!(
            (still.slide_m(), still.both_feet(0..480), still.flying(0..480)),
            (0.0, 1.0, 0.0)
        );
        assert!(still.lowest_m().abs() < 1e-12 && still.root_acceleration_m_s2() < 1e-9);
    }

    /// Over the ankle, a quarter of the foot's length before its heel; the sole's own half breadth is 48 mm.
    #[test]
    fn who_stands_still_stands_over_the_soles_and_who_is_pushed_too_fast_does_not() {
        let still = standing(|_| DVec3::ZERO);
        let expected_m = 0.25 * f64::midpoint(0.2283 / 1.735, 0.2581 / 1.741) * 1.75;
        let got_m = still.margins_m()[240].unwrap();
        // The centre of mass of the feet lies ahead of the ankles.
        assert!((got_m - expected_m).abs() < 0.01, "{got_m} {expected_m}");
        // 2 m/s2 forward, with the centre of mass 1 m high: 20 cm behind it.
        let pushed = standing(|t| DVec3::X * (t * t));
        assert!(pushed.margins_m()[240].unwrap() < -0.1);
        let above = standing(|_| DVec3::Z * 0.1);
        assert_eq!(above.margins_m()[240], None);
    }

    #[test]
    fn a_foot_dragged_along_the_floor_slides_as_far_as_it_is_dragged() {
        let dragged = standing(|t| DVec3::new(0.1 * t, 0.0, 0.0));
        assert!((dragged.slide_m() - 0.1 * 479.0 / RATE_HZ).abs() < 1e-9);
        let above = standing(|t| DVec3::new(0.1 * t, 0.0, 0.01));
        assert_eq!((above.slide_m(), above.flying(0..480)), (0.0, 1.0));
        assert!((above.travel_m().1 - 0.1 * 479.0 / RATE_HZ).abs() < 1e-9);
    }

    /// A sole comes down and goes forward by 5 for every 6 that it sinks: while it is lower than 5 mm, by 4.17 mm.
    #[test]
    fn a_slide_is_as_long_however_often_it_is_looked_at() {
        let place = |t: f64| {
            let left_s = (0.1 - t).max(0.0);
            // Smooth where it stops: people do not stop at once.
            let ease = |v: f64| v * (left_s * left_s / (left_s + 0.01));
            DVec3::new(-ease(0.5), 0.0, ease(0.6))
        };
        let expected_m = 0.005 * 0.5 / 0.6;
        for (rate_hz, late_s) in [(240.0, 0.0), (250.0, 0.001), (250.0, 0.003), (1000.0, 0.0004)] {
            let count = (0.2 * rate_hz) as u32;
            let soles_m: Vec<[DVec3; 4]> =
                (0..count).map(|i| [place(late_s + f64::from(i) / rate_hz); 4]).collect();
            let got_m = worst_slide_m(&soles_m);
            assert!((got_m - expected_m).abs() < 5e-5, "{rate_hz} Hz: {got_m} {expected_m}");
            assert!(lowest_m(&soles_m).abs() < 1e-4);
        }
    }

    #[test]
    fn the_floor_is_where_a_body_stands_for_longest() {
        let body = Proportions::of_stature(1.75).unwrap();
        let poses = |heights_m: &[f64]| {
            let pose = |height_m: &f64| {
                let root_m = DVec3::Z * (body.root_height_m() + height_m);
                JointAngles::default().to_pose(root_m, DQuat::IDENTITY)
            };
            heights_m.iter().map(pose).collect::<Vec<_>>()
        };
        // It stands at 0.3 m, to within millimetres; jumps; sinks once.
        let mut heights_m: Vec<f64> = (0..50).map(|i| 0.3 + 1e-4 * f64::from(i % 5)).collect();
        heights_m.extend((0..100).map(|i| 0.3 + 0.005 * f64::from(i)));
        heights_m.push(0.1);
        assert!((floor_m(&body, &poses(&heights_m)) - 0.3).abs() < 1e-3);
        assert_eq!(floor_m(&body, &[]), 0.0);
    }

    #[test]
    fn who_falls_is_not_pushed_and_who_is_lifted_is_pushed_harder() {
        let falling = standing(|t| DVec3::Z * (-GRAVITY_M_S2 * t * t / 2.0));
        assert!(falling.force_body_weights()[240].abs() < 1e-3);
        let lifted = standing(|t| DVec3::Z * (GRAVITY_M_S2 * t * t / 4.0));
        assert!((lifted.force_body_weights()[240] - 1.5).abs() < 1e-3);
        assert!((lifted.root_acceleration_m_s2() - GRAVITY_M_S2 / 2.0).abs() < 1e-6);
        assert!(falling.lowest_m() < -1.0);
    }
}
