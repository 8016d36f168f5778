//! Where a moving body is, from nothing but how its segments are turned: it stands on its lowest sole,
//! which stays where it is, and where its legs fall away faster than it can fall it flies.
//!
//! The floor is the plane z = 0. It only pushes, so the centre of mass never falls faster than freely:
//! flights begin where standing would ask for that, and end where a sole is down again. What legs cannot
//! do smoothly (the heel that meets the floor, a landing) is spread over [`SPREAD_S`], so that position
//! and velocity have no jumps.

use glam::{DQuat, DVec2, DVec3};

use crate::body::mass::{SegmentMasses, centre_of_mass_m, segment_masses};
use crate::body::{End, Proportions, SegmentPose};
use crate::rigid::ground::GRAVITY_M_S2;

/// Standard deviation of the time over which the path of the centre of mass is averaged, s: people's
/// heels and ankles give as fast (a heel pad is pressed for some 20 ms).
pub const SPREAD_S: f64 = 0.015;
/// Soles this much higher than the lowest carry e times less, m.
const CARRIES_M: f64 = 0.002;
/// Time over which the speed of a body that was measured is averaged, s: which sole is the lowest changes with the noise.
const SLUGGISH_S: f64 = 0.05;
/// Higher above the floor than this, the body flies, m.
const FLIES_M: f64 = 0.002;

/// The ends of both soles: what can carry.
pub const SOLES: [End; 4] = [End::LeftHeel, End::LeftToe, End::RightHeel, End::RightToe];

/// Of a pose: [`SOLES`] and the centre of mass against the root, m.
#[derive(Clone, Copy, Debug)]
pub(crate) struct AboutRoot {
    pub(crate) soles_m: [DVec3; 4],
    centre_m: DVec3,
}

impl AboutRoot {
    /// Of a pose, wherever its root is.
    pub(crate) fn of(body: &Proportions, masses: &SegmentMasses, pose: &SegmentPose) -> Self {
        let pose = SegmentPose { root_m: DVec3::ZERO, ..pose.clone() };
        let at = body.positions(&pose);
        let soles_m = SOLES.map(|end| at.end_m(end));
        Self { soles_m, centre_m: centre_of_mass_m(body, masses, &pose) }
    }

    /// The same of a body that is turned as a whole.
    pub(crate) fn turned(&self, turn: DQuat) -> Self {
        Self { soles_m: self.soles_m.map(|sole_m| turn * sole_m), centre_m: turn * self.centre_m }
    }
}

/// Root positions of poses that follow at `rate_hz`, whose own are ignored; the first has its root above the
/// origin.
#[must_use]
pub fn path_m(body: &Proportions, poses: &[SegmentPose], rate_hz: f64) -> Vec<DVec3> {
    let masses = segment_masses(body);
    let about_root: Vec<AboutRoot> =
        poses.iter().map(|pose| AboutRoot::of(body, &masses, pose)).collect();
    path_about_m(&about_root, rate_hz)
}

/// The same of what is known of poses.
pub(crate) fn path_about_m(about_root: &[AboutRoot], rate_hz: f64) -> Vec<DVec3> {
    let mut centres_m = unspread_m(about_root, rate_hz);
    spread(&mut centres_m, rate_hz, SPREAD_S);
    let mut roots_m: Vec<DVec3> = centres_m
        .iter()
        .zip(about_root)
        .map(|(centre_m, about)| *centre_m - about.centre_m)
        .collect();
    if let Some(first) = roots_m.first().map(|root_m| DVec3::new(root_m.x, root_m.y, 0.0)) {
        for root_m in &mut roots_m {
            *root_m -= first;
        }
    }
    roots_m
}

/// Where the centre of mass is while soles stay where they stand and flights are free, with the jumps of
/// velocity that legs leave.
fn unspread_m(about_root: &[AboutRoot], rate_hz: f64) -> Vec<DVec3> {
    let step_s = 1.0 / rate_hz;
    let mut centres_m: Vec<DVec3> = Vec::with_capacity(about_root.len());
    let mut flying_m_s: Option<DVec2> = None;
    for (at, AboutRoot { soles_m, centre_m }) in about_root.iter().enumerate() {
        let stands_z_m = centre_m.z - lowest(soles_m);
        let [.., before, last] = centres_m[..] else {
            // Nothing moves before the first pose.
            let level_m = centres_m.last().map_or(DVec2::ZERO, |last: &DVec3| last.truncate());
            centres_m.push(level_m.extend(stands_z_m));
            continue;
        };
        let falls_z_m = 2.0 * last.z - before.z - GRAVITY_M_S2 * step_s * step_s;
        let z_m = stands_z_m.max(falls_z_m);
        let level_m = if z_m - stands_z_m > FLIES_M {
            let velocity_m_s = *flying_m_s.get_or_insert((last - before).truncate() * rate_hz);
            velocity_m_s * step_s
        } else {
            flying_m_s = None;
            let was = &about_root[at - 1];
            let moved_m = carried_m(&was.soles_m, soles_m);
            moved_m + (*centre_m - was.centre_m).truncate()
        };
        centres_m.push((last.truncate() + level_m).extend(z_m));
    }
    centres_m
}

fn lowest(soles_m: &[DVec3; 4]) -> f64 {
    soles_m.iter().map(|sole| sole.z).fold(f64::MAX, f64::min)
}

/// How far the root goes while soles go from here to there against it, and what carries stays where it is, m.
fn carried_m(before_m: &[DVec3; 4], now_m: &[DVec3; 4]) -> DVec2 {
    let ground = (lowest(before_m), lowest(now_m));
    let (mut moved_m, mut carry) = (DVec2::ZERO, 0.0);
    for (before, now) in before_m.iter().zip(now_m) {
        let height_m = f64::midpoint(before.z - ground.0, now.z - ground.1);
        let part = (-height_m / CARRIES_M).exp();
        moved_m += (*before - *now).truncate() * part;
        carry += part;
    }
    moved_m / carry
}

/// Where the root of a body that was measured is as poses come: at once, from nothing but the poses so far, as if nobody ever
/// flew. Noise looks like many small flights.
#[derive(Clone, Debug)]
pub struct StandingRoot {
    body: Proportions,
    soles_m: Option<[DVec3; 4]>,
    level_m: DVec2,
    speed_m_s: DVec2,
}

impl StandingRoot {
    /// A body that has not been seen yet; it begins above the origin.
    #[must_use]
    pub const fn new(body: Proportions) -> Self {
        Self { body, soles_m: None, level_m: DVec2::ZERO, speed_m_s: DVec2::ZERO }
    }

    /// The root in the next pose, whose own is ignored, so long after the last, s; m.
    pub fn next(&mut self, pose: &SegmentPose, dt_s: f64) -> DVec3 {
        let at = self.body.positions(&SegmentPose { root_m: DVec3::ZERO, ..pose.clone() });
        let soles_m = SOLES.map(|end| at.end_m(end));
        if let Some(before_m) = self.soles_m.replace(soles_m).filter(|_| dt_s > 0.0) {
            let share = 1.0 - (-dt_s / SLUGGISH_S).exp();
            let speed_m_s = carried_m(&before_m, &soles_m) / dt_s;
            // One pose that is none must not be the end of it.
            if speed_m_s.is_finite() {
                self.speed_m_s += share * (speed_m_s - self.speed_m_s);
                self.level_m += self.speed_m_s * dt_s;
            }
        }
        self.level_m.extend(-lowest(&soles_m))
    }
}

/// Averages points over a time of this standard deviation: three running means, near a normal distribution,
/// as if the first and the last point had always been and would always be.
pub fn spread(points_m: &mut [DVec3], rate_hz: f64, deviation_s: f64) {
    // The variance of a mean of w samples is (w^2 - 1) / 12.
    let width = (4.0 * (deviation_s * rate_hz).powi(2) + 1.0).sqrt();
    let half = ((width - 1.0) / 2.0).round() as usize;
    let (Some(first), Some(last)) = (points_m.first().copied(), points_m.last().copied()) else {
        return;
    };
    if half == 0 {
        return;
    }
    for _ in 0..3 {
        let given = points_m.to_vec();
        let at = |i: isize| match usize::try_from(i) {
            Ok(i) => given.get(i).copied().unwrap_or(last),
            Err(_) => first,
        };
        let half = half as isize;
        // Against the middle, so that far from the origin sums stay exact.
        for (i, point_m) in points_m.iter_mut().enumerate() {
            let i = i as isize;
            let middle = at(i);
            let sum: DVec3 = (i - half..=i + half).map(|i| at(i) - middle).sum();
            *point_m = middle + sum / (2 * half + 1) as f64;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::{Dof, JointAngles};

    const RATE_HZ: f64 = 240.0;

    fn body() -> Proportions {
        Proportions::of_stature(1.75).unwrap()
    }

    #[test]
    fn who_walks_is_placed_as_it_comes_where_who_is_known_whole_is() {
        // Legs swing in turn, the one that comes forward bent, soles level.
        let pose = |n: u32| {
            let (sin, cos) = (3.0 * f64::from(n) / RATE_HZ).sin_cos();
            let mut angles = JointAngles::default();
            angles[Dof::LeftHipFlexion] = 0.3 * sin + 0.4 * cos.max(0.0);
            angles[Dof::LeftKneeFlexion] = 0.8 * cos.max(0.0);
            angles[Dof::LeftAnkleDorsiflexion] = 0.4 * cos.max(0.0) - 0.3 * sin;
            angles[Dof::RightHipFlexion] = -0.3 * sin + 0.4 * (-cos).max(0.0);
            angles[Dof::RightKneeFlexion] = 0.8 * (-cos).max(0.0);
            angles[Dof::RightAnkleDorsiflexion] = 0.4 * (-cos).max(0.0) + 0.3 * sin;
            angles.to_pose(DVec3::ZERO, DQuat::IDENTITY)
        };
        let poses: Vec<SegmentPose> = (0..1200).map(pose).collect();
        let known_m = path_m(&body(), &poses, RATE_HZ);
        let mut root = StandingRoot::new(body());
        let mut furthest_m = 0f64;
        for (pose, known_m) in poses.iter().zip(&known_m) {
            furthest_m = furthest_m.max(root.next(pose, 1.0 / RATE_HZ).distance(*known_m));
        }
        let way_m = known_m.last().expect("a way").x;
        assert!(way_m > 1.0 && furthest_m < 0.1 * way_m, "{furthest_m} of {way_m} m");
    }

    /// The right leg's hip and ankle, the left out of the way.
    fn on_right_leg(degrees: f64) -> SegmentPose {
        let mut angles = JointAngles::default();
        angles[Dof::LeftKneeFlexion] = 1.5;
        angles[Dof::RightHipFlexion] = degrees.to_radians();
        angles[Dof::RightAnkleDorsiflexion] = -degrees.to_radians();
        angles.to_pose(DVec3::ZERO, DQuat::IDENTITY)
    }

    #[test]
    fn a_standing_body_stays_above_the_origin() {
        let still = JointAngles::default().to_pose(DVec3::ONE, DQuat::IDENTITY);
        for root_m in path_m(&body(), &vec![still; 30], RATE_HZ) {
            let expected = DVec3::new(0.0, 0.0, body().root_height_m());
            assert!((root_m - expected).length() < 1e-12);
        }
        assert!(path_m(&body(), &[], RATE_HZ).is_empty());
    }

    #[test]
    fn swinging_over_a_stiff_standing_leg_carries_the_pelvis_forward() {
        // At rest at both ends, so that what is spread there is nothing.
        let angle = |i: usize| {
            let part = (i.clamp(40, 200) - 40) as f64 / 160.0;
            20.0 * (part * core::f64::consts::PI).cos()
        };
        let poses: Vec<SegmentPose> = (0..240).map(|i| on_right_leg(angle(i))).collect();
        let roots_m = path_m(&body(), &poses, RATE_HZ);
        let leg_m = body().root_height_m() - 1.75 * 0.039;
        let travel_m = roots_m[239].x - roots_m[0].x;
        assert!((travel_m - 2.0 * leg_m * 20f64.to_radians().sin()).abs() < 1e-6, "{travel_m}");
        for (pose, root_m) in poses.iter().zip(&roots_m) {
            let at = body().positions(&SegmentPose { root_m: *root_m, ..pose.clone() });
            assert!(at.end_m(End::RightHeel).z.abs() < 1e-3);
        }
    }

    /// Both feet are pulled up in 0.1 s: nobody falls that fast. Take-off at rest from the height h of the
    /// centre of mass, so it takes sqrt(2 h / g) to come down by h.
    #[test]
    fn what_loses_its_legs_falls_freely() {
        let pose = |i: i32| {
            let part = f64::from(i.clamp(20, 44) - 20) / 24.0;
            let angle = 1.2 * (1.0 - (part * core::f64::consts::PI).cos()) / 2.0;
            let mut angles = JointAngles::default();
            for (hip, knee, ankle) in [
                (Dof::LeftHipFlexion, Dof::LeftKneeFlexion, Dof::LeftAnkleDorsiflexion),
                (Dof::RightHipFlexion, Dof::RightKneeFlexion, Dof::RightAnkleDorsiflexion),
            ] {
                angles[hip] = angle;
                angles[knee] = 2.0 * angle;
                // Soles stay level.
                angles[ankle] = angle;
            }
            angles.to_pose(DVec3::ZERO, DQuat::IDENTITY)
        };
        let poses: Vec<SegmentPose> = (0..240).map(pose).collect();
        let masses = segment_masses(&body());
        let centre_z_m: Vec<f64> = poses
            .iter()
            .zip(path_m(&body(), &poses, RATE_HZ))
            .map(|(pose, root_m)| {
                let pose = SegmentPose { root_m, ..pose.clone() };
                centre_of_mass_m(&body(), &masses, &pose).z
            })
            .collect();
        let dropped_m = centre_z_m[0] - centre_z_m[239];
        assert!(dropped_m > 0.3, "{dropped_m}");
        let half = centre_z_m.iter().position(|z| *z < centre_z_m[0] - dropped_m / 2.0).unwrap();
        let start = centre_z_m.iter().position(|z| *z < centre_z_m[0] - 0.02).unwrap();
        // From 0.02 m to half of the drop, on a parabola that began at rest.
        let expected_s = (dropped_m / GRAVITY_M_S2).sqrt() - (0.04 / GRAVITY_M_S2).sqrt();
        let got_s = (half - start) as f64 / RATE_HZ;
        assert!((got_s - expected_s).abs() < 2.0 / RATE_HZ, "{got_s} {expected_s}");
        // And never faster than freely.
        for three in centre_z_m.windows(3) {
            let fall = (three[0] - 2.0 * three[1] + three[2]) * RATE_HZ * RATE_HZ;
            assert!(fall > -GRAVITY_M_S2 - 0.01, "{fall}");
        }
    }

    /// A step down onto a heel: the pelvis's velocity would jump, and is spread.
    #[test]
    fn velocity_has_no_jumps_where_another_sole_begins_to_carry() {
        // The right leg swings evenly from front to back; the left, a mirror, takes over halfway.
        let pose = |i: i32| {
            let mut angles = JointAngles::default();
            let degrees = 20.0 - f64::from(i) * 0.25;
            for (hip, ankle, swing) in [
                (Dof::RightHipFlexion, Dof::RightAnkleDorsiflexion, degrees),
                (Dof::LeftHipFlexion, Dof::LeftAnkleDorsiflexion, degrees + 20.0),
            ] {
                angles[hip] = swing.to_radians();
                angles[ankle] = -swing.to_radians();
            }
            angles.to_pose(DVec3::ZERO, DQuat::IDENTITY)
        };
        let poses: Vec<SegmentPose> = (0..160).map(pose).collect();
        let roots_m = path_m(&body(), &poses, RATE_HZ);
        let most = roots_m[20..140]
            .windows(3)
            .map(|three| ((three[0] - 2.0 * three[1] + three[2]) * RATE_HZ * RATE_HZ).length())
            .fold(0.0, f64::max);
        // The height's velocity turns by 2 l sin(20 deg / 2) w = 0.3 m/s, over at least 2.5 sigma.
        assert!(most < 12.0, "{most} m/s2");
    }
}
