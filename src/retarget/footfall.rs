//! What a motion says of the feet: which one carries, and whether its sole lies flat.

use crate::body::root::spread;
use crate::body::{Proportions, Segment, SegmentPose};
use crate::error::Error;
use crate::recognise::contact::Floor;
use crate::recognise::points::{BodyPoint, Lengths, Points};
use crate::retarget::toe::Toe;
use crate::units::wrap_rad;
use glam::{DQuat, DVec3};

/// A person's weight goes from foot to foot over this time, standard deviation, s.
const SHIFTS_S: f64 = 0.04;
/// So long no foot needs to be in contact between two steps of a person who does not run, s.
const FLIGHT_S: f64 = 0.1;
/// So long both are planted then, s.
const BOTH_S: f64 = 0.1;
/// A foot comes and goes for so long, s.
const COMES_S: f64 = 0.1;
/// Cosines of a sole's tilt between which a foot that carries begins to lie flat: 25 and 8 deg.
const FLAT: [f64; 2] = [0.906, 0.990];

/// What is turned over further than this cosine is upside down.
const UPSIDE: f64 = -0.8;

/// Both feet, left first, and the trunk, at an instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Footfall {
    /// How much of a foot carries, 0 to 1; it comes and goes smoothly.
    pub carries: [f64; 2],
    /// How much of it lies flat, 0 to 1, at most as much as carries.
    pub flat: [f64; 2],
    /// Up, in the axes of what the robot's base plays.
    pub up: DVec3,
    /// Whether a foot touches the floor; none where nobody said.
    pub touches: Option<[bool; 2]>,
    /// Where somebody looks, without jumps of a turn, rad; none where nobody said.
    pub heading_rad: Option<f64>,
}

impl Footfall {
    /// Upright on both feet.
    pub const STANDING: Self =
        Self { carries: [1.0; 2], flat: [1.0; 2], up: DVec3::Z, touches: None, heading_rad: None };

    /// On the way to another: `share` 0 is this one, 1 the other.
    #[must_use]
    pub fn towards(&self, other: &Self, share: f64) -> Self {
        let part = |a: [f64; 2], b: [f64; 2]| [0, 1].map(|i| a[i] + (b[i] - a[i]) * share);
        Self {
            carries: part(self.carries, other.carries),
            flat: part(self.flat, other.flat),
            up: self.up.lerp(other.up, share).try_normalize().unwrap_or(self.up),
            touches: if share < 0.5 { self.touches } else { other.touches },
            heading_rad: match (self.heading_rad, other.heading_rad) {
                (Some(a), Some(b)) => Some(a + (b - a) * share),
                (a, b) => a.or(b),
            },
        }
    }
}

/// Where something looks that is turned so, near to where it did before, rad: how far it is turned about the vertical beside the
/// shortest way to how it leans. Upside down that says nothing, and it looks where it did.
#[must_use]
pub fn looking_rad(turned: DQuat, before_rad: f64) -> f64 {
    if (turned * DVec3::Z).z < UPSIDE {
        return before_rad;
    }
    before_rad + wrap_rad(2.0 * turned.z.atan2(turned.w) - before_rad)
}

/// What the feet of a person do, pose by pose, with the finder that recognition has. `base` is the segment
/// that the robot's base plays.
///
/// # Errors
/// A stature nobody has.
pub fn of_person(
    poses: &[SegmentPose],
    tracked: &[bool; 13],
    stature_m: f64,
    rate_hz: f64,
    base: Segment,
) -> Result<Vec<Footfall>, Error> {
    let body = Proportions::of_stature(stature_m)?;
    let mut floor = Floor::new(Lengths::of(&body));
    let points = |pose: &SegmentPose| Points::of(&body, pose, tracked);
    let last = poses.len().saturating_sub(1);
    let mut found = Vec::with_capacity(poses.len());
    let mut three = poses.first().map(|first| [points(first); 3]);
    let mut heading_rad = 0.0;
    for at in 0..poses.len() {
        let Some([before, now, after]) = &mut three else { break };
        (*before, *now) = (*now, *after);
        *after = points(&poses[(at + 1).min(last)]);
        if at == 0 {
            *now = *before;
        }
        let steps = (usize::from(at > 0) + usize::from(at < last)).max(1) as f64;
        let velocity = |place: BodyPoint| (after[place] - before[place]) * (rate_hz / steps);
        let velocities = Points(BodyPoint::ALL.map(velocity));
        let touches = floor.next(now, &velocities, 1.0 / rate_hz).feet.map(|is| is == Some(true));
        let level = |foot: Segment| {
            let up = (poses[at].orientation[foot.index()] * DVec3::Z).z;
            let part = ((up - FLAT[0]) / (FLAT[1] - FLAT[0])).clamp(0.0, 1.0);
            part * part * (3.0 - 2.0 * part)
        };
        let carries = touches.map(|touches| f64::from(u8::from(touches)));
        let turned = poses[at].orientation[base.index()];
        heading_rad = looking_rad(turned, heading_rad);
        found.push(Footfall {
            carries,
            flat: [carries[0] * level(Segment::LeftFoot), carries[1] * level(Segment::RightFoot)],
            up: turned.inverse() * DVec3::Z,
            touches: Some(touches),
            heading_rad: Some(heading_rad),
        });
    }
    smooth(&mut found, rate_hz);
    Ok(found)
}

/// The same on feet that are planted where a toe is in contact: these carry, and lie flat as a robot's must that
/// has no toes. Where none is, all stays as it was.
pub fn plant(found: &mut [Footfall], toes: &[Toe; 2], rate_hz: f64) {
    for (at, of) in found.iter_mut().enumerate() {
        let planted = toes.each_ref().map(|toe| toe.contact.get(at) == Some(&true));
        if planted != [false; 2] {
            of.carries = planted.map(|is| f64::from(u8::from(is)));
            (of.flat, of.touches) = (of.carries, Some(planted));
        }
    }
    smooth(found, rate_hz);
}

/// The same at other times of it, in samples, that follow one another at the same rate: of feet that are planted or
/// not.
#[must_use]
pub fn at_times(found: &[Footfall], times: &[f64], rate_hz: f64) -> Vec<Footfall> {
    let last = found.len().saturating_sub(1);
    let at = |time: &f64| {
        let before = (*time as usize).min(last);
        let mut of = found[before].towards(&found[(before + 1).min(last)], time - before as f64);
        // Weight goes over as fast as ever.
        if let Some(touches) = of.touches.filter(|touches| *touches != [false; 2]) {
            of.carries = touches.map(|is| f64::from(u8::from(is)));
            of.flat = of.carries;
        }
        of
    };
    let mut all: Vec<Footfall> =
        if found.is_empty() { Vec::new() } else { times.iter().map(at).collect() };
    lay(&mut all, rate_hz);
    smooth(&mut all, rate_hz);
    all
}

/// Beside a foot that stays one that comes or goes says nothing of what is level.
fn lay(found: &mut [Footfall], rate_hz: f64) {
    let reach = (COMES_S * rate_hz).ceil() as usize;
    let touches: Vec<[bool; 2]> = found.iter().map(|of| of.touches.unwrap_or_default()).collect();
    for (at, of) in found.iter_mut().enumerate() {
        let around = &touches[at.saturating_sub(reach)..(at + reach + 1).min(touches.len())];
        let stays = [0, 1].map(|side| around.iter().all(|touches| touches[side]));
        if stays[0] != stays[1] {
            of.flat = stays.map(|is| f64::from(u8::from(is)));
        }
    }
}

/// Where one foot that is planted follows the other both are for a moment, and at both ends: weight can only go over
/// then, and who begins and ends at rest does so on both feet.
pub fn hand_over(found: &mut [Footfall], rate_hz: f64) {
    let mut planted: Vec<[bool; 2]> =
        found.iter().map(|of| of.touches.unwrap_or([true; 2])).collect();
    let given = planted.clone();
    let rest = ((BOTH_S * rate_hz).ceil() as usize).min(planted.len());
    let end = planted.len() - rest;
    planted[..rest].fill([true; 2]);
    planted[end..].fill([true; 2]);
    let (flight, half) = ((FLIGHT_S * rate_hz) as usize, (BOTH_S / 2.0 * rate_hz).ceil() as usize);
    let mut last: Option<(usize, [bool; 2])> = None;
    let (mut changes, mut airborne) = (Vec::new(), 0);
    for (at, now) in planted.iter().enumerate() {
        match (now, last) {
            ([false, false], _) => airborne += 1,
            ([true, true], _) => {}
            (_, Some((before, was))) if was != *now && airborne <= flight => {
                changes.push((before, at));
            }
            _ => {}
        }
        if now[0] != now[1] {
            (last, airborne) = (Some((at, *now)), 0);
        }
    }
    for (before, at) in changes {
        let middle = (before + at).div_ceil(2);
        let from = (before + 1).min(middle.saturating_sub(half));
        let to = at.max(middle + half).min(planted.len());
        planted[from..to].fill([true; 2]);
    }
    for (of, (planted, given)) in found.iter_mut().zip(planted.into_iter().zip(given)) {
        if planted != given {
            (of.carries, of.flat, of.touches) = ([1.0; 2], [1.0; 2], Some(planted));
        }
    }
    lay(found, rate_hz);
    smooth(found, rate_hz);
}

/// What feet do that were said to stand or not, at `rate_hz`, under a base that is turned so: it needs no
/// soles to tell.
#[must_use]
pub fn of_contacts(said: &[([bool; 2], DQuat)], rate_hz: f64) -> Vec<Footfall> {
    let instant = |(touches, base): &([bool; 2], DQuat)| {
        let carries = touches.map(|touches| f64::from(u8::from(touches)));
        let up = base.inverse() * DVec3::Z;
        Footfall { carries, flat: [0.0; 2], up, touches: Some(*touches), heading_rad: None }
    };
    let mut found: Vec<Footfall> = said.iter().map(instant).collect();
    smooth(&mut found, rate_hz);
    found
}

/// The same of feet whose soles lie flat where they stand, and of what is up for the base.
#[must_use]
pub fn of_soles(said: &[([bool; 2], DVec3)], rate_hz: f64) -> Vec<Footfall> {
    let instant = |(touches, up): &([bool; 2], DVec3)| {
        let carries = touches.map(|touches| f64::from(u8::from(touches)));
        Footfall { carries, flat: carries, up: *up, touches: Some(*touches), heading_rad: None }
    };
    let mut found: Vec<Footfall> = said.iter().map(instant).collect();
    smooth(&mut found, rate_hz);
    found
}

/// Lets the weight come and go as a person shifts it.
fn smooth(found: &mut [Footfall], rate_hz: f64) {
    let pair = |two: [f64; 2]| DVec3::new(two[0], two[1], 0.0);
    let mut carries: Vec<DVec3> = found.iter().map(|of| pair(of.carries)).collect();
    let mut flat: Vec<DVec3> = found.iter().map(|of| pair(of.flat)).collect();
    spread(&mut carries, rate_hz, SHIFTS_S);
    spread(&mut flat, rate_hz, SHIFTS_S);
    for (of, (carries, flat)) in found.iter_mut().zip(carries.iter().zip(&flat)) {
        of.carries = [carries.x, carries.y];
        of.flat = [flat.x, flat.y];
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::{Dof, JointAngles};
    use glam::DQuat;

    #[test]
    fn a_lifted_foot_carries_nothing_and_one_on_its_toe_does_not_lie_flat() {
        let body = Proportions::of_stature(1.75).unwrap();
        let mut lifted = JointAngles::default();
        (lifted[Dof::LeftHipFlexion], lifted[Dof::LeftKneeFlexion]) = (0.9, 0.9);
        // Both heels up by 40 deg.
        let mut on_toe = JointAngles::default();
        on_toe[Dof::RightAnkleDorsiflexion] = -0.7;
        on_toe[Dof::LeftAnkleDorsiflexion] = -0.7;
        let root_m = DVec3::Z * body.root_height_m();
        let pose = |angles: &JointAngles| angles.to_pose(root_m, DQuat::IDENTITY);
        let found = |angles: &JointAngles| {
            let poses = vec![pose(angles); 60];
            of_person(&poses, &[true; 13], 1.75, 120.0, Segment::Pelvis).unwrap()[30]
        };
        let standing = found(&JointAngles::default());
        assert_eq!((standing.carries, standing.flat), ([1.0; 2], [1.0; 2]));
        let one_leg = found(&lifted);
        assert_eq!((one_leg.carries, one_leg.touches), ([0.0, 1.0], Some([false, true])));
        let tiptoe = found(&on_toe);
        assert_eq!((tiptoe.carries, tiptoe.flat), ([1.0; 2], [0.0; 2]));
    }

    fn of(touches: [bool; 2]) -> Footfall {
        let carries = touches.map(|is| f64::from(u8::from(is)));
        Footfall { carries, flat: carries, touches: Some(touches), ..Footfall::STANDING }
    }

    #[test]
    fn feet_hand_over_on_both_and_a_runner_flies_on() {
        let (left, right) = ([true, false], [false, true]);
        // At 100 Hz: left, right at once; a flight of 0.2 s; left.
        let mut found: Vec<Footfall> = (0..200)
            .map(|at| of(if at < 60 { left } else { right }))
            .chain((0..20).map(|_| of([false; 2])))
            .chain((0..60).map(|_| of(left)))
            .collect();
        hand_over(&mut found, 100.0);
        let both = |at: usize| found[at].touches == Some([true; 2]);
        let all: Vec<usize> = (0..found.len()).filter(|at| both(*at)).collect();
        assert_eq!(all, (0..10).chain(55..65).chain(270..280).collect::<Vec<_>>());
        // Weight is on both in the middle of it, and then on the right one.
        assert!(found[60].carries[0] > 0.5 && found[60].carries[1] > 0.5, "{:?}", found[60]);
        assert!(found[100].carries[0] < 0.01 && found[100].carries[1] > 0.99, "{:?}", found[100]);
        // A foot that comes or goes does not say what is level.
        assert!(found[70].flat[0] < 0.2 && found[70].flat[1] > 0.8, "{:?}", found[70]);
    }

    #[test]
    fn at_other_times_weight_goes_over_as_fast_as_ever() {
        let mut found: Vec<Footfall> =
            (0..100).map(|at| of(if at < 50 { [true; 2] } else { [false, true] })).collect();
        smooth(&mut found, 100.0);
        let times: Vec<f64> = (0..400).map(|at| f64::from(at) * 0.2475).collect();
        let slow = at_times(&found, &times, 100.0);
        let lasts = |found: &[Footfall]| {
            found.iter().filter(|of| (0.1..0.9).contains(&of.carries[0])).count()
        };
        assert!(lasts(&slow).abs_diff(lasts(&found)) <= 1, "{}", lasts(&slow));
        assert!(at_times(&[], &times, 100.0).is_empty());
    }

    #[test]
    fn who_turns_over_looks_where_it_did() {
        let (heading_rad, mut looks_rad) = (0.7, 0.7);
        for degrees in (0..=360).step_by(5) {
            let tilt = DQuat::from_rotation_y(f64::from(degrees).to_radians());
            looks_rad = looking_rad(DQuat::from_rotation_z(heading_rad) * tilt, looks_rad);
            assert!((looks_rad - heading_rad).abs() < 1e-9, "{degrees} deg: {looks_rad}");
        }
        // And who turns on, without jumps.
        for turned_rad in [1.0, 3.0, 5.0, 7.0] {
            looks_rad = looking_rad(DQuat::from_rotation_z(turned_rad), looks_rad);
            assert!((looks_rad - turned_rad).abs() < 1e-9, "{looks_rad}");
        }
    }

    #[test]
    fn a_bow_leans_what_the_base_plays() {
        let pose = JointAngles::default().to_pose(DVec3::Z, DQuat::from_rotation_y(0.5));
        let found = of_person(&[pose], &[true; 13], 1.75, 120.0, Segment::Pelvis).unwrap();
        assert!((found[0].up - DVec3::new(-(0.5f64.sin()), 0.0, 0.5f64.cos())).length() < 1e-12);
        assert!(of_person(&[], &[true; 13], 1.75, 120.0, Segment::Pelvis).unwrap().is_empty());
    }
}
