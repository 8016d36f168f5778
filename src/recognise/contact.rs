//! Where the floor is, and what touches it.
//!
//! The paper says that a joint is "approximately" as high as the ground and gives no tolerance. Here the
//! floor is as high as the lowest point of the body that stands still; a point touches it if it is no
//! higher above it than its own height in standing on it, and 0.1 of the shank. A foot must also be
//! slow ([`crate::body::carrying`]).

use super::points::{BodyPoint, Lengths, Points};
use crate::body::carrying::{FootPart, MeasuredFoot, NEAR_SHANKS};
use glam::DVec3;

/// What can touch the ground, and how high its joint is then, in shanks: the ankle as in the published
/// proportions of [`crate::body::proportions`], the others by the flesh around a joint (ours). [`Floor::next`] goes by their rows.
const TOUCHES: [(BodyPoint, f64); 10] = [
    (BodyPoint::LeftFoot, 0.16),
    (BodyPoint::RightFoot, 0.16),
    (BodyPoint::LeftToe, 0.0),
    (BodyPoint::RightToe, 0.0),
    (BodyPoint::LeftKnee, 0.15),
    (BodyPoint::RightKnee, 0.15),
    (BodyPoint::LeftHand, 0.12),
    (BodyPoint::RightHand, 0.12),
    (BodyPoint::LeftHip, 0.27),
    (BodyPoint::RightHip, 0.27),
];
/// What is slower stands still, in legs per second.
const STILL_LEG_S: f64 = 0.25;
/// So long the lowest point has to stand still higher or lower than the floor before the floor is there, s.
const FLOOR_AFTER_S: f64 = 0.15;

/// True, false, or not shown.
pub type Known = Option<bool>;

/// What touches the ground.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Contacts {
    /// Height of the ground, m.
    pub floor_m: f64,
    /// Left and right foot, by ankle or toe.
    pub feet: [Known; 2],
    /// Left and right knee.
    pub knees: [Known; 2],
    /// Left and right hand.
    pub hands: [Known; 2],
    /// Left and right hip.
    pub hips: [Known; 2],
}

/// Finds contacts frame by frame.
#[derive(Clone, Debug)]
pub struct Floor {
    lengths: Lengths,
    floor_m: Option<f64>,
    still_s: f64,
    feet: [MeasuredFoot; 2],
}

impl Floor {
    /// Of a body of these lengths, nothing seen yet.
    #[must_use]
    pub const fn new(lengths: Lengths) -> Self {
        let foot = MeasuredFoot::new(lengths.tibia_m, lengths.leg_m());
        Self { lengths, floor_m: None, still_s: 0.0, feet: [foot; 2] }
    }

    /// The next frame: where the points are, how fast they move, m/s, and how long after the last
    /// frame, s.
    pub fn next(&mut self, points: &Points, velocities: &Points, dt_s: f64) -> Contacts {
        let tibia_m = self.lengths.tibia_m;
        let stood_m = TOUCHES.map(|(place, height)| points[place].z - height * tibia_m);
        let mut lowest: Option<usize> = None;
        for (index, height_m) in stood_m.iter().enumerate().filter(|(_, m)| m.is_finite()) {
            if lowest.is_none_or(|lowest| *height_m < stood_m[lowest]) {
                lowest = Some(index);
            }
        }
        let Some(lowest) = lowest else { return Contacts::default() };
        self.find(stood_m[lowest], velocities[TOUCHES[lowest].0], dt_s);
        let floor_m = self.floor_m.unwrap_or(stood_m[lowest]);
        let heights_m = stood_m.map(|stood_m| stood_m - floor_m);
        let touches = |index: usize| {
            let height_m = heights_m[index];
            height_m.is_finite().then_some(height_m <= NEAR_SHANKS * tibia_m)
        };
        let feet = [
            self.foot(0, [0, 2], &heights_m, velocities),
            self.foot(1, [1, 3], &heights_m, velocities),
        ];
        Contacts {
            floor_m,
            feet,
            knees: [4, 5].map(touches),
            hands: [6, 7].map(touches),
            hips: [8, 9].map(touches),
        }
    }

    /// The floor is where the lowest point stands still.
    fn find(&mut self, lowest_m: f64, velocity: DVec3, dt_s: f64) {
        let is_still = velocity.length() < STILL_LEG_S * self.lengths.leg_m();
        self.still_s = if is_still { self.still_s + dt_s } else { 0.0 };
        match self.floor_m {
            None => self.floor_m = Some(lowest_m),
            Some(_) if self.still_s >= FLOOR_AFTER_S => self.floor_m = Some(lowest_m),
            Some(floor_m) if lowest_m < floor_m => self.floor_m = Some(lowest_m),
            Some(_) => {}
        }
    }

    /// Whether a foot touches of which these are the rows of ankle and toe.
    fn foot(
        &mut self,
        side: usize,
        rows: [usize; 2],
        heights_m: &[f64; TOUCHES.len()],
        velocities: &Points,
    ) -> Known {
        if !heights_m[rows[0]].is_finite() {
            return None;
        }
        let parts = rows.map(|row| FootPart {
            height_m: Some(heights_m[row]).filter(|m| m.is_finite()).unwrap_or(f64::NAN),
            speed_m_s: velocities[TOUCHES[row].0].length(),
        });
        Some(self.feet[side].next(&parts))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::{BodyFigure, Dof, JointAngles, Proportions};
    use glam::DQuat;

    fn body() -> Proportions {
        Proportions::of_figure(BodyFigure::DrillisContini, 1.75).expect("a body")
    }

    fn points(change: impl FnOnce(&mut JointAngles), raised_m: f64) -> Points {
        let mut angles = JointAngles::default();
        change(&mut angles);
        let root_m = DVec3::new(0.0, 0.0, body().root_height_m() + raised_m);
        Points::of(&body(), &angles.to_pose(root_m, DQuat::IDENTITY), &[true; 13])
    }

    const STILL: Points = Points([DVec3::ZERO; 13]);

    #[test]
    fn who_stands_touches_the_ground_with_the_feet_alone_wherever_the_ground_is() {
        for raised_m in [0.0, 3.0] {
            let mut floor = Floor::new(Lengths::of(&body()));
            let found = floor.next(&points(|_| (), raised_m), &STILL, 0.01);
            assert_eq!(found.feet, [Some(true); 2]);
            assert_eq!((found.knees, found.hands), ([Some(false); 2], [Some(false); 2]));
            assert!((found.floor_m - raised_m).abs() < 0.01, "{}", found.floor_m);
        }
    }

    #[test]
    fn a_lifted_foot_and_a_fast_one_do_not_touch() {
        let mut floor = Floor::new(Lengths::of(&body()));
        let lifted = points(
            |angles| {
                angles[Dof::LeftHipFlexion] = 0.8;
                angles[Dof::LeftKneeFlexion] = 0.8;
            },
            0.0,
        );
        assert_eq!(floor.next(&lifted, &STILL, 0.01).feet, [Some(false), Some(true)]);
        let mut fast = STILL;
        fast[BodyPoint::RightFoot] = DVec3::X * 3.0;
        fast[BodyPoint::RightToe] = DVec3::X * 3.0;
        assert_eq!(floor.next(&points(|_| (), 0.0), &fast, 0.01).feet, [Some(true), Some(false)]);
    }

    #[test]
    fn a_foot_that_touches_goes_on_to_touch_at_a_speed_that_another_would_not_begin_with() {
        let between = 0.9 * Lengths::of(&body()).leg_m();
        let mut slides = STILL;
        for place in [BodyPoint::LeftFoot, BodyPoint::LeftToe] {
            slides[place] = DVec3::X * between;
        }
        let stands = points(|_| (), 0.0);
        let mut floor = Floor::new(Lengths::of(&body()));
        assert_eq!(floor.next(&stands, &slides, 0.01).feet[0], Some(false));
        floor.next(&stands, &STILL, 0.01);
        assert_eq!(floor.next(&stands, &slides, 0.01).feet[0], Some(true));
    }

    #[test]
    fn in_the_air_nothing_touches_and_on_a_step_the_floor_is_higher() {
        let mut floor = Floor::new(Lengths::of(&body()));
        floor.next(&points(|_| (), 0.0), &STILL, 0.01);
        let falls = Points([DVec3::new(0.0, 0.0, 2.0); 13]);
        assert_eq!(floor.next(&points(|_| (), 0.4), &falls, 0.01).feet, [Some(false); 2]);
        for _ in 0..20 {
            floor.next(&points(|_| (), 0.2), &STILL, 0.01);
        }
        let stands = floor.next(&points(|_| (), 0.2), &STILL, 0.01);
        assert_eq!(stands.feet, [Some(true); 2]);
        assert!((stands.floor_m - 0.2).abs() < 0.01);
    }

    #[test]
    fn a_foot_that_is_not_shown_is_unknown() {
        let mut seen = points(|_| (), 0.0);
        seen[BodyPoint::LeftFoot] = DVec3::NAN;
        seen[BodyPoint::LeftToe] = DVec3::NAN;
        let mut floor = Floor::new(Lengths::of(&body()));
        assert_eq!(floor.next(&seen, &STILL, 0.01).feet, [None, Some(true)]);
    }
}
