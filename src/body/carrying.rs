//! Whether a foot that was measured carries: one that is low and slow.
//!
//! Measured feet are never still and never quite on the floor: markers sit on shoes, joints are computed, soles
//! bend. So a part of a foot (heel, ankle, toe) carries while it is near the ground and hardly moves, with room between
//! beginning and ending so that noise does not make it step; a foot carries while a part of it does. For bodies
//! that are made, whose soles lie on the floor exactly, there is [`crate::body::contact`].
//!
//! The numbers are ours. Against force plates (20 N), on level ground and on stairs, feet found so touch and leave within
//! two frames of 100 and 120 a second (`tests/mocap/measured_force.rs`).

use super::{Joint, Proportions};
use glam::DVec3;

/// A part that is no higher than this above where it is when the foot stands is near the ground, in shanks.
pub const NEAR_SHANKS: f64 = 0.1;
/// How much higher a part of a foot that carries may be.
const KEEPS: f64 = 1.5;
/// No part of a foot is on the floor, or off it, for a shorter time than this, s: sprinters stand for twice as long.
const SHORTEST_S: f64 = 0.05;
/// A foot begins to carry below this speed of a part, in legs per second ...
const BEGINS_LEG_S: f64 = 0.8;
/// ... and ends above this one: a toe that leaves is pushed off.
const ENDS_LEG_S: f64 = 1.2;

/// A part of a foot in one frame; not numbers where it was not seen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FootPart {
    /// How much higher it is than when the foot stands on the ground under it, m.
    pub height_m: f64,
    /// How fast it moves, m/s.
    pub speed_m_s: f64,
}

/// A foot that is followed frame by frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeasuredFoot {
    shank_m: f64,
    leg_m: f64,
    carries: bool,
}

impl MeasuredFoot {
    /// Of a leg of these lengths, knee to ankle and hip to ankle, in the air.
    #[must_use]
    pub const fn new(shank_m: f64, leg_m: f64) -> Self {
        Self { shank_m, leg_m, carries: false }
    }

    /// Whether it carries in the next frame.
    pub fn next(&mut self, parts: &[FootPart]) -> bool {
        let near_m = NEAR_SHANKS * self.shank_m;
        let (most_m, most_m_s) = if self.carries {
            (KEEPS * near_m, ENDS_LEG_S * self.leg_m)
        } else {
            (near_m, BEGINS_LEG_S * self.leg_m)
        };
        let carries = |part: &FootPart| part.height_m <= most_m && part.speed_m_s <= most_m_s;
        self.carries = parts.iter().any(carries);
        self.carries
    }
}

/// Which of [`SOLES`](super::root::SOLES) carry, by pose, from where they are over the floor, m; for what is seen whole.
#[must_use]
pub fn soles(body: &Proportions, soles_m: &[[DVec3; 4]], rate_hz: f64) -> Vec<[bool; 4]> {
    let length_m = |joint: Joint| body.joint_offset_m(joint).map_or(0.0, |(_, at_m)| at_m.length());
    let shank_m = length_m(Joint::LeftAnkle);
    let mut parts = [MeasuredFoot::new(shank_m, shank_m + length_m(Joint::LeftKnee)); 4];
    let last = soles_m.len().saturating_sub(1);
    let carries = soles_m.iter().enumerate().map(|(at, places_m)| {
        let (before, after) = (at.saturating_sub(1), (at + 1).min(last));
        let dt_s = (after - before).max(1) as f64 / rate_hz;
        core::array::from_fn(|end| {
            let moved_m = soles_m[after][end] - soles_m[before][end];
            let speed_m_s = moved_m.length() / dt_s;
            parts[end].next(&[FootPart { height_m: places_m[end].z, speed_m_s }])
        })
    });
    let mut carries: Vec<[bool; 4]> = carries.collect();
    let shortest = (SHORTEST_S * rate_hz).ceil() as usize;
    for end in 0..4 {
        // What is lifted for a moment stands; then, what stands for a moment only passes by.
        for stands in [false, true] {
            let mut begin = 0;
            while begin < carries.len() {
                let is_run = |on: &&[bool; 4]| on[end] == carries[begin][end];
                let length = carries[begin..].iter().take_while(is_run).count();
                let is_inner = begin > 0 && begin + length < carries.len();
                if carries[begin][end] == stands && is_inner && length < shortest {
                    carries[begin..begin + length].iter_mut().for_each(|on| on[end] = !stands);
                }
                begin += length;
            }
        }
    }
    carries
}

#[cfg(test)]
mod tests {
    use super::*;

    const UNSEEN: FootPart = FootPart { height_m: f64::NAN, speed_m_s: f64::NAN };

    fn part(height_m: f64, speed_m_s: f64) -> FootPart {
        FootPart { height_m, speed_m_s }
    }

    #[test]
    fn a_foot_carries_while_a_part_of_it_is_low_and_slow() {
        let mut foot = MeasuredFoot::new(0.4, 0.8);
        let swings = part(0.02, 3.0);
        assert!(!foot.next(&[swings, swings]));
        assert!(!foot.next(&[UNSEEN, part(0.3, 0.0)]), "lifted and held");
        assert!(foot.next(&[part(0.01, 0.3), swings]), "the heel is down");
        assert!(foot.next(&[swings, part(0.0, 0.1)]), "the toe took over");
        assert!(!foot.next(&[swings, swings]));
        assert!(!foot.next(&[UNSEEN, UNSEEN]) && !foot.next(&[]));
    }

    #[test]
    fn a_foot_leaves_faster_and_higher_than_it_comes() {
        let (quick, raised) = (part(0.0, 0.9), part(0.05, 0.0));
        for between in [quick, raised] {
            let mut foot = MeasuredFoot::new(0.4, 0.8);
            assert!(!foot.next(&[between]), "{between:?}");
            foot.next(&[part(0.0, 0.0)]);
            assert!(foot.next(&[between]), "{between:?}");
        }
    }

    /// A second on the floor, as high as noise has it, and then half a second of a step.
    #[test]
    fn soles_that_stand_carry_in_one_go_however_they_are_drawn_and_those_that_swing_do_not() {
        let body = Proportions::of_stature(1.75).expect("a body");
        let rate_hz = 120.0;
        let places = |at: u32| {
            let noise_m = 0.002 * f64::from(at * 7 % 5) - 0.004;
            let steps = f64::from(at.saturating_sub(120)) / rate_hz;
            // The left foot stands 15 mm above the floor and goes; the right one stays, 5 mm in it.
            let left = DVec3::new(2.5 * steps, 0.1, 0.015 + noise_m + 0.1 * steps);
            let right = DVec3::new(0.0, -0.1, -0.005 - noise_m);
            [left, left + DVec3::X * 0.2, right, right + DVec3::X * 0.2]
        };
        let places: Vec<[DVec3; 4]> = (0..180).map(places).collect();
        let found = soles(&body, &places, rate_hz);
        assert!(found[..120].iter().all(|on| *on == [true; 4]));
        assert!(found[122..].iter().all(|on| *on == [false, false, true, true]));
        // For three poses the right foot is raised, for three the left one rests on its way.
        let mut moments = places.clone();
        moments[60..63].iter_mut().for_each(|soles_m| soles_m[2].z = 0.1);
        let at_m = moments[150][0];
        moments[149..154].iter_mut().for_each(|soles_m| soles_m[0] = at_m.with_z(0.0));
        assert_eq!(soles(&body, &moments, rate_hz), found);
        assert!(soles(&body, &[], rate_hz).is_empty());
        assert_eq!(soles(&body, &places[..1], rate_hz), [[true; 4]]);
    }
}
