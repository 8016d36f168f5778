//! Where the pelvis goes, from where the feet touch the ground.
//!
//! Joint angles say nothing about travel. While one foot at a time stands, the foot on the ground
//! stays where it is, so the pelvis moves against it; the ground is the plane z = 0. When no foot
//! stands, the root falls freely.

use glam::{DQuat, DVec3};

use crate::body::proportions::{End, Proportions, proximal_joint};
use crate::body::{JointAngles, Segment, SegmentPose};

const SOLES: [End; 4] = [End::LeftHeel, End::LeftToe, End::RightHeel, End::RightToe];

/// Soles no further apart in height than rounding makes them.
const EQUALLY_LOW_M: f64 = 1e-9;

/// Root positions for a series of poses that is never in flight: the lowest of heels and toes is on
/// the ground and does not slide. Each pose is joint angles and the orientation of the pelvis; the
/// first has its root above the origin.
#[must_use]
pub fn root_on_ground(body: &Proportions, poses: &[(JointAngles, DQuat)]) -> Vec<DVec3> {
    let mut roots_m: Vec<DVec3> = Vec::with_capacity(poses.len());
    let mut soles_before_m = None;
    for (angles, orientation) in poses {
        let soles_m = soles_of_legs(body, angles, *orientation);
        let lowest_m = soles_m.iter().map(|sole| sole.z).fold(f64::MAX, f64::min);
        let mut root_m = roots_m.last().copied().unwrap_or(DVec3::ZERO);
        if let Some(before_m) = soles_before_m.replace(soles_m) {
            // What the soles moved against the pelvis, the pelvis moves against the ground. Points
            // equally low, of two feet that move alike, carry equally.
            let (mut moved_m, mut carry) = (DVec3::ZERO, 0.0);
            for (before, now) in before_m.into_iter().zip(soles_m) {
                if now.z <= lowest_m + EQUALLY_LOW_M {
                    moved_m += before - now;
                    carry += 1.0;
                }
            }
            root_m += moved_m / carry;
        }
        root_m.z = -lowest_m;
        roots_m.push(root_m);
    }
    roots_m
}

/// Standard acceleration of free fall, m/s^2.
const GRAVITY_M_S2: f64 = 9.806_65;
/// Speed at take-off is taken over this time before it, s.
const TAKE_OFF_S: f64 = 0.03;

/// Root positions as [`root_on_ground`], for poses at `rate_hz` with times of flight, s: from, to,
/// in order. In flight the root goes on with the horizontal speed it had, and rises and falls so
/// that a foot touches the ground again at the end.
#[must_use]
pub fn root_path(
    body: &Proportions,
    poses: &[(JointAngles, DQuat)],
    rate_hz: f64,
    flights_s: &[(f64, f64)],
) -> Vec<DVec3> {
    let mut roots_m = root_on_ground(body, poses);
    let index = |time_s: f64| ((time_s * rate_hz).round() as usize).min(poses.len());
    for (from_s, to_s) in flights_s {
        let (from, to) = (index(*from_s), index(*to_s));
        if !(from + 1 < to && to < poses.len()) {
            continue;
        }
        let before = from.saturating_sub((TAKE_OFF_S * rate_hz).ceil() as usize);
        let velocity = match from - before {
            0 => DVec3::ZERO,
            steps => (roots_m[from] - roots_m[before]) * rate_hz / steps as f64,
        };
        let (takes_off, lands) = (roots_m[from], roots_m[to]);
        let flight_s = (to - from) as f64 / rate_hz;
        let rise = (lands.z - takes_off.z) / flight_s + GRAVITY_M_S2 * flight_s / 2.0;
        for (step, root_m) in roots_m[from..to].iter_mut().enumerate() {
            let t = step as f64 / rate_hz;
            let ahead = velocity.truncate() * t;
            let z = takes_off.z + rise * t - GRAVITY_M_S2 * t * t / 2.0;
            *root_m = DVec3::new(takes_off.x + ahead.x, takes_off.y + ahead.y, z);
        }
        // What stands after the landing stands where the flight ended.
        let ahead = velocity.truncate() * flight_s;
        let moved = takes_off.truncate() + ahead - lands.truncate();
        for root_m in &mut roots_m[to..] {
            root_m.x += moved.x;
            root_m.y += moved.y;
        }
    }
    roots_m
}

/// How much feet slide: root mean square horizontal speed, m/s, of heels and toes that are lower
/// than `height_m` above the ground, over all poses; 0 if none is. Poses follow at `rate_hz`.
#[must_use]
pub fn foot_skate_m_s(
    body: &Proportions,
    poses: &[SegmentPose],
    rate_hz: f64,
    height_m: f64,
) -> f64 {
    let (mut squares, mut count) = (0.0, 0usize);
    for pair in poses.windows(2) {
        let (before, after) = (soles(body, &pair[0]), soles(body, &pair[1]));
        for (before, after) in before.into_iter().zip(after) {
            if before.z < height_m && after.z < height_m {
                squares += ((after - before) * rate_hz).truncate().length_squared();
                count += 1;
            }
        }
    }
    if count == 0 { 0.0 } else { (squares / count as f64).sqrt() }
}

fn soles(body: &Proportions, pose: &SegmentPose) -> [DVec3; 4] {
    let at = body.positions(pose);
    SOLES.map(|end| at.end_m(end))
}

const LEGS: [([Segment; 3], [End; 2]); 2] = [
    ([Segment::LeftThigh, Segment::LeftShank, Segment::LeftFoot], [End::LeftHeel, End::LeftToe]),
    (
        [Segment::RightThigh, Segment::RightShank, Segment::RightFoot],
        [End::RightHeel, End::RightToe],
    ),
];

/// [`soles`] of a body with its root at the origin, without the rest of it: corpora ask for this at
/// every pose.
fn soles_of_legs(body: &Proportions, angles: &JointAngles, pelvis: DQuat) -> [DVec3; 4] {
    let [left_m, right_m] = LEGS.map(|(segments, ends)| {
        let (mut at_m, mut turned) = (DVec3::ZERO, pelvis);
        for segment in segments {
            if let Some((_, offset_m)) = body.joint_offset_m(proximal_joint(segment)) {
                at_m += turned * offset_m;
            }
            turned = (turned * angles.against_parent(segment)).normalize();
        }
        ends.map(|end| at_m + turned * body.end_offset_m(end).1)
    });
    [left_m[0], left_m[1], right_m[0], right_m[1]]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::Dof;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn legs_alone_have_their_soles_where_the_whole_body_has(
            angles in prop::array::uniform22(-1.5..1.5),
            (x, y) in (-1.0..1.0, -1.0..1.0),
        ) {
            let (angles, pelvis) =
                (JointAngles(angles), DQuat::from_rotation_x(x) * DQuat::from_rotation_y(y));
            let whole_m = soles(&body(), &angles.to_pose(DVec3::ZERO, pelvis));
            for (got_m, sole_m) in soles_of_legs(&body(), &angles, pelvis).into_iter().zip(whole_m) {
                prop_assert!((got_m - sole_m).length() < 1e-12);
            }
        }
    }

    fn body() -> Proportions {
        Proportions::of_stature(1.75).unwrap()
    }

    #[test]
    fn a_standing_body_stays_above_the_origin() {
        let roots_m = root_on_ground(&body(), &[(JointAngles::default(), DQuat::IDENTITY); 3]);
        for root_m in roots_m {
            assert!((root_m - DVec3::new(0.0, 0.0, 1.75 * 0.530)).length() < 1e-12);
        }
        assert!(root_on_ground(&body(), &[]).is_empty());
    }

    #[test]
    fn swinging_over_a_stiff_standing_leg_carries_the_pelvis_forward() {
        // The left leg is lifted out of the way; the right swings from front to back.
        let pose = |degrees: f64| {
            let mut angles = JointAngles::default();
            angles[Dof::LeftKneeFlexion] = 1.5;
            angles[Dof::RightHipFlexion] = degrees.to_radians();
            angles[Dof::RightAnkleDorsiflexion] = -degrees.to_radians();
            (angles, DQuat::IDENTITY)
        };
        let poses: Vec<_> = (-20..=20).map(|i| pose(-f64::from(i))).collect();
        let roots_m = root_on_ground(&body(), &poses);
        let leg_m = 1.75 * (0.530 - 0.039);
        let travel_m = roots_m[40].x - roots_m[0].x;
        assert!((travel_m - 2.0 * leg_m * 20f64.to_radians().sin()).abs() < 1e-9, "{travel_m}");
        let segments: Vec<_> =
            poses.iter().zip(&roots_m).map(|((a, q), root)| a.to_pose(*root, *q)).collect();
        assert!(foot_skate_m_s(&body(), &segments, 100.0, 0.01) < 1e-9);
    }

    #[test]
    fn in_flight_the_body_rises_and_falls_freely_and_goes_on() {
        // A stiff leg swings back on the ground, then nothing changes for 0.4 s in the air.
        let pose = |degrees: f64| {
            let mut angles = JointAngles::default();
            angles[Dof::LeftKneeFlexion] = 1.5;
            angles[Dof::RightHipFlexion] = degrees.to_radians();
            angles[Dof::RightAnkleDorsiflexion] = -degrees.to_radians();
            (angles, DQuat::IDENTITY)
        };
        let (rate_hz, flight_s) = (100.0, 0.4);
        let poses: Vec<_> = (0..100).map(|i| pose(10.0 - f64::from(i.min(40)) * 0.5)).collect();
        let roots_m = root_path(&body(), &poses, rate_hz, &[(0.4, 0.4 + flight_s)]);
        let rise_m = roots_m[60].z - roots_m[40].z;
        assert!((rise_m - 9.80665 * flight_s * flight_s / 8.0).abs() < 1e-9, "{rise_m}");
        assert!((roots_m[80].z - roots_m[40].z).abs() < 1e-12);
        let speed = (roots_m[40].x - roots_m[37].x) * rate_hz / 3.0;
        let travel_m = roots_m[80].x - roots_m[40].x;
        assert!(speed > 0.3 && (travel_m - speed * flight_s).abs() < 1e-9, "{travel_m} {speed}");
        // The landing foot stands where it landed.
        assert!((roots_m[99] - roots_m[80]).length() < 1e-12);
        // A flight that does not fit leaves the path on the ground.
        let grounded = root_on_ground(&body(), &poses);
        assert_eq!(root_path(&body(), &poses, rate_hz, &[(0.9, 2.0)]), grounded);
    }

    #[test]
    fn a_foot_dragged_along_the_ground_is_seen_to_skate() {
        let still = JointAngles::default();
        let root = |i: i32| DVec3::new(0.01 * f64::from(i), 0.0, body().root_height_m());
        let poses: Vec<_> = (0..10).map(|i| still.to_pose(root(i), DQuat::IDENTITY)).collect();
        assert!((foot_skate_m_s(&body(), &poses, 100.0, 0.01) - 1.0).abs() < 1e-9);
    }
}
