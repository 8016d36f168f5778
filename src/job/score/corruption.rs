//! What is done to clips to see what it costs the recogniser: noise, another pace, fewer frames, a heading that drifts, a
//! joint that is not seen.

use crate::job::recognise::SeenBody;
use crate::recognise::features::Noise;
use crate::recognise::model::BodySide;
use crate::recognise::points::{BodyPoint, Points};
use core::f64::consts::TAU;
use glam::{DQuat, DVec3};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Sines that make slow noise, and the fastest of them, Hz.
const SINES: usize = 6;
const SLOWER_THAN_HZ: f64 = 3.0;

/// What is done to a clip.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Corruption {
    /// Noise of each coordinate in each frame, standard deviation, m.
    White(f64),
    /// The same of noise that is slower than 3 Hz.
    Slow(f64),
    /// So many times as fast.
    Speed(f64),
    /// Left and right are exchanged.
    Mirrored,
    /// So many frames a second, at most.
    Rate(f64),
    /// The heading drifts, rad/s.
    Drift(f64),
    /// The left hand is not seen.
    NoLeftHand,
}

/// All that is tried, by name.
pub const TRIED: [(&str, Corruption); 9] = [
    ("white noise, 2 mm", Corruption::White(0.002)),
    ("white noise, 5 mm", Corruption::White(0.005)),
    ("noise below 3 Hz, 2 cm", Corruption::Slow(0.02)),
    ("0.7 times as fast", Corruption::Speed(0.7)),
    ("1.4 times as fast", Corruption::Speed(1.4)),
    ("mirrored", Corruption::Mirrored),
    ("30 frames/s", Corruption::Rate(30.0)),
    ("heading drifts 3 deg/s", Corruption::Drift(0.052)),
    ("no left hand", Corruption::NoLeftHand),
];

impl Corruption {
    /// So many times as fast as the clip is what is left of it.
    pub const fn pace(self) -> f64 {
        match self {
            Self::Speed(factor) => factor,
            _ => 1.0,
        }
    }

    /// The side on which that is done which was done on this.
    pub const fn side(self, side: BodySide) -> BodySide {
        match self {
            Self::Mirrored => side.mirrored(),
            _ => side,
        }
    }

    /// A clip with this done to it, and its frames per second. The same number gives the same noise.
    pub fn of(self, clip: &SeenBody, rate_hz: f64, number: u64) -> (SeenBody, f64) {
        let mut frames = clip.frames.clone();
        let mut rate_hz = rate_hz;
        let mut chance = ChaCha8Rng::seed_from_u64(number);
        match self {
            Self::White(deviation_m) => {
                for point in frames.iter_mut().flat_map(|points| &mut points.0) {
                    *point += deviation_m * normal(&mut chance);
                }
            }
            Self::Slow(deviation_m) => slow(&mut frames, deviation_m, rate_hz, &mut chance),
            Self::Speed(factor) => rate_hz *= factor,
            Self::Mirrored => frames.iter_mut().for_each(mirror),
            Self::Rate(most_hz) => {
                let step = (rate_hz / most_hz).round().max(1.0) as usize;
                frames = frames.into_iter().step_by(step).collect();
                rate_hz /= step as f64;
            }
            Self::Drift(rad_s) => {
                // As of worn sensors: the body turns about itself and each step leads the way it then faces.
                let mut root_m =
                    frames.first().map_or(DVec3::ZERO, |points| points[BodyPoint::Root]);
                let mut last_m = root_m;
                for (n, points) in frames.iter_mut().enumerate() {
                    let turn = DQuat::from_rotation_z(rad_s * n as f64 / rate_hz);
                    let own_m = points[BodyPoint::Root];
                    root_m += turn * (own_m - last_m);
                    last_m = own_m;
                    *points = Points(points.0.map(|at| root_m + turn * (at - own_m)));
                }
            }
            Self::NoLeftHand => {
                for points in &mut frames {
                    points[BodyPoint::LeftHand] = DVec3::NAN;
                }
            }
        }
        let noise = Noise::of_quietest(&frames, rate_hz);
        let noise = noise.filter(|noise| noise.is_still(&clip.lengths));
        (SeenBody { lengths: clip.lengths, frames, noise }, rate_hz)
    }
}

/// Sines of random frequencies for each point, with this deviation together.
fn slow(frames: &mut [Points], deviation_m: f64, rate_hz: f64, chance: &mut impl Rng) {
    for place in BodyPoint::ALL {
        let sines: [(DVec3, f64, f64); SINES] = core::array::from_fn(|_| {
            let by_m = normal(chance) * deviation_m / (SINES as f64 / 2.0).sqrt();
            (by_m, SLOWER_THAN_HZ * chance.random::<f64>(), TAU * chance.random::<f64>())
        });
        for (n, points) in frames.iter_mut().enumerate() {
            let time_s = n as f64 / rate_hz;
            let at =
                |(by_m, hz, from): &(DVec3, f64, f64)| *by_m * (TAU * hz * time_s + from).sin();
            points[place] += sines.iter().map(at).sum::<DVec3>();
        }
    }
}

fn mirror(points: &mut Points) {
    let mut mirrored = Points(points.0.map(|at| DVec3::new(at.x, -at.y, at.z)));
    for first in [
        BodyPoint::LeftHand,
        BodyPoint::LeftHip,
        BodyPoint::LeftKnee,
        BodyPoint::LeftFoot,
        BodyPoint::LeftToe,
    ] {
        mirrored.0.swap(first as usize, first as usize + 1);
    }
    *points = mirrored;
}

/// Three coordinates of a normal distribution of deviation 1: a sum of twelve (Irwin and Hall).
fn normal(chance: &mut impl Rng) -> DVec3 {
    let mut one = || (0..12).map(|_| chance.random::<f64>()).sum::<f64>() - 6.0;
    DVec3::new(one(), one(), one())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::{BodyFigure, JointAngles, Proportions};
    use crate::recognise::points::Lengths;

    /// Somebody who stands still for ten seconds.
    fn stands() -> SeenBody {
        let body = Proportions::of_figure(BodyFigure::DrillisContini, 1.7).expect("a body");
        let pose = JointAngles::default().to_pose(DVec3::Z * body.root_height_m(), DQuat::IDENTITY);
        let points = Points::of(&body, &pose, &[true; 13]);
        SeenBody { lengths: Lengths::of(&body), frames: vec![points; 1200], noise: None }
    }

    fn deviation_m(one: &SeenBody, other: &SeenBody) -> f64 {
        let pairs = one.frames.iter().zip(&other.frames);
        let squares =
            pairs.flat_map(|(a, b)| (0..13).map(|at| (a.0[at] - b.0[at]).length_squared()));
        (squares.sum::<f64>() / (one.frames.len() * 13 * 3) as f64).sqrt()
    }

    #[test]
    fn noise_has_the_deviation_it_says_and_is_the_same_again() {
        let still = stands();
        for (corruption, asked_m, room) in
            [(Corruption::White(0.005), 0.005, 0.05), (Corruption::Slow(0.02), 0.02, 0.35)]
        {
            let (noisy, rate_hz) = corruption.of(&still, 120.0, 7);
            let found_m = deviation_m(&still, &noisy);
            assert!((found_m / asked_m - 1.0).abs() < room, "{corruption:?}: {found_m}");
            assert_eq!(rate_hz, 120.0);
            assert_eq!(deviation_m(&noisy, &corruption.of(&still, 120.0, 7).0), 0.0);
            assert!(deviation_m(&noisy, &corruption.of(&still, 120.0, 8).0) > 0.0);
        }
    }

    #[test]
    fn a_heading_that_drifts_turns_a_body_about_itself_wherever_it_stands() {
        let mut far = stands();
        let offset_m = DVec3::new(50.0, -20.0, 0.0);
        far.frames.iter_mut().for_each(|points| points.0.iter_mut().for_each(|at| *at += offset_m));
        let (drifted, _) = Corruption::Drift(0.05).of(&far, 120.0, 0);
        let (first, last) = (&far.frames[0], &drifted.frames[1199]);
        assert!((last[BodyPoint::Root] - first[BodyPoint::Root]).length() < 1e-9);
        let hips = |points: &Points| points[BodyPoint::LeftHip] - points[BodyPoint::RightHip];
        let turned_rad = hips(first).angle_between(hips(last));
        assert!((turned_rad - 0.05 * 1199.0 / 120.0).abs() < 1e-6, "{turned_rad}");
    }

    #[test]
    fn who_is_mirrored_twice_is_as_before_and_fewer_frames_take_as_long() {
        let still = stands();
        let mirror = |of: &SeenBody| Corruption::Mirrored.of(of, 120.0, 0).0;
        let once = mirror(&still);
        assert!(deviation_m(&still, &once) < 1e-9, "who stands straight is symmetric");
        assert_eq!(deviation_m(&still, &mirror(&once)), 0.0);
        let (fewer, rate_hz) = Corruption::Rate(30.0).of(&still, 120.0, 0);
        assert_eq!((fewer.frames.len(), rate_hz), (300, 30.0));
        let (hidden, _) = Corruption::NoLeftHand.of(&still, 120.0, 0);
        assert!(hidden.frames.iter().all(|points| points[BodyPoint::LeftHand].is_nan()));
        assert!(!hidden.frames[0][BodyPoint::RightHand].is_nan());
    }
}
