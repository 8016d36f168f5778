//! Which joint of a humanoid moves which part of a body, guessed from where its joints are.
//!
//! Nothing here goes by names. The base looks ahead along x and up along z. Legs are what ends in a sole, one on
//! either side, or, of a model without soles, the lowest chains, if they are alike: the two longest ways between
//! joints of a leg are thigh and shank. Of what is left, the longest chain on either side is an arm; its elbow is
//! the first joint that bends it, away from the shoulder. What carries both arms or both legs is a waist, and the
//! highest end in the middle the head.

use super::PublicModel;
use super::onto::{OwnJoint, Reduced, ReducedLink};
use crate::rigid::{Placement, Volume};
use gaitway_profiles::{Anatomy, BaseKind, Segment, SegmentLink};
use glam::{DQuat, DVec3};
use nalgebra::{DMatrix, DVector};
use std::collections::BTreeSet;

/// Where an anatomy comes from that nobody wrote.
const GUESSED: &str = "unconfirmed: guessed by `gaitway robot import` from where joints are";
/// What is nearer to the middle than this is on no side, m.
const ASIDE_M: f64 = 0.005;
/// The same of an arm: its last joint, or the end of what hangs on it.
const ARM_ASIDE_M: f64 = 0.02;
const HAND_ASIDE_M: f64 = 0.03;
/// A head is at most so far from the middle, m.
const MIDDLE_M: f64 = 0.02;
/// Joints that something else on a side has at least that may be a limb.
const LIMB_JOINTS: usize = 3;
/// Joints that legs of a model without soles have at least, and how alike both are, as a part of their length.
const LEG_JOINTS: usize = 4;
const ALIKE: f64 = 0.1;
/// An elbow is at least this part of an arm's length away from the shoulder.
const ELBOW_SHARE: f64 = 0.25;
/// From such a part of an arm's length on two joints are no shoulder any more.
const APART_SHARE: f64 = 0.12;
/// The cosine between an axis and a line: above it the joint turns about the line, below it bends it.
const TURNS: f64 = 0.7;
/// Joints that turn a part about any axis.
const BALL: usize = 3;
/// Joints nearer to one another than this have no direction between them, m.
const NEAR_M: f64 = 0.02;
/// Arms begin so far above legs at least, and a sole that reaches further back than ahead by more looks back, m.
const ABOVE_M: f64 = 0.02;
/// A sole is told by so many of its corners at most.
const CORNERS: usize = 32;
/// What it counts that a joint is far from zero in N pose, beside a link that points elsewhere.
const CALM: f64 = 0.03;
/// The same of a hand that faces elsewhere than at zero.
const FACES: f64 = 0.1;
/// A joint is at a right angle, or at zero, that is no further from it than this, rad: ...
const ZERO_RAD: f64 = 0.03;
/// ... one that bends or turns the lower part of a leg, ...
const ROUGH_LEG_RAD: f64 = 0.1;
/// ... and the same of an arm, whose end is a guess.
const ROUGH_ARM_RAD: f64 = 0.4;
const RIGHT_RAD: f64 = std::f64::consts::FRAC_PI_2;
/// How N pose is sought: at most so many steps of such a length, rad.
const STEPS: usize = 60;
const STEP_RAD: f64 = 0.2;
const NUDGE_RAD: f64 = 1e-5;

/// A limb of one side.
struct Limb {
    /// Its joints, from the base or the waist on.
    path: Vec<usize>,
    /// The last joint before its upper part, and before its lower one.
    parts: [usize; 2],
    /// Knee or elbow.
    bend: usize,
    /// An elbow that can be turned to any side.
    is_ball: bool,
    /// How much it counts how these are turned about themselves.
    twists: [f64; 2],
    /// What is up on its end, in the base's axes at zero, if that is a foot.
    up: Option<DVec3>,
}

/// A pair of limbs: the last joint that carries both, if any does, and left and right one.
type Pair = (Option<usize>, [Option<Limb>; 2]);

/// The anatomy of what stands on two legs, or is held and has two arms.
///
/// # Errors
/// Why nothing is guessed of anything else.
pub(super) fn guessed(model: &PublicModel, of: &Reduced) -> Result<Anatomy, &'static str> {
    let zeros = vec![0.0; model.tree.moving()];
    let zero = model.tree.place(Placement::IDENTITY, &zeros);
    let body = Chain { model, zero, joints: &of.joints, links: &of.links };
    let at = body.placed(&vec![0.0; of.joints.len()]).0;
    let feet = body.feet(&at);
    let hands = body.hands(&at, feet)?;
    let begins_m = |ends: [usize; 2]| {
        let (shared, paths) = body.shared(ends);
        paths[0].get(shared).map_or(f64::NEG_INFINITY, |joint| at[*joint].z)
    };
    let (feet, hands) = match (feet, hands, model.base) {
        (Some(feet), Some(hands), _) if begins_m(hands) > begins_m(feet) + ABOVE_M => {
            (Some(feet), Some(hands))
        }
        (Some(_), Some(_), BaseKind::Free) => {
            return Err(
                "what else hangs on it begins no higher than its legs do, so it has no arms",
            );
        }
        (Some(feet), None, BaseKind::Free) => (Some(feet), None),
        (None, _, BaseKind::Free) => {
            return Err(
                "it has no two legs, the same to the left and to the right (the model has to look along x)",
            );
        }
        // What is held needs no legs: what hangs on it are arms.
        (_, _, BaseKind::Fixed) => {
            let hands = body.hands(&at, None)?;
            (None, Some(hands.ok_or("it is held by its base and has no two arms, left and right")?))
        }
    };
    let on = |joint: usize, ends: Option<[usize; 2]>| ends.is_some_and(|of| body.is_on(joint, of));
    let (hips, legs) = body.pair(feet, |path| body.leg(&at, path));
    let (waist, arms) = body.pair(hands, |path| body.arm(&at, path));
    if legs.iter().flatten().any(|leg| body.looks_back(leg)) {
        return Err(
            "its feet reach backwards and its knees bend forwards (the model has to look along x)",
        );
    }
    let base = match (hips, waist) {
        (None, None) => vec![Segment::Pelvis, Segment::Torso],
        (None, Some(_)) => vec![Segment::Pelvis],
        (Some(_), None) => vec![Segment::Torso],
        (Some(_), Some(_)) => return Err("its arms and its legs hang on a waist each"),
    };
    let plays = |segment: Segment, joint: usize, direction_weight: f64, twist_weight: f64| {
        let joint = of.joints[joint].name.clone();
        SegmentLink { segment, joint, direction_weight, twist_weight }
    };
    let head = body.head(&at, &|joint| on(joint, feet) || on(joint, hands));
    let trunk = [(Segment::Head, head), (Segment::Torso, waist), (Segment::Pelvis, hips)];
    let trunk = trunk.into_iter().filter_map(|(segment, joint)| Some((segment, joint?)));
    let mut segments: Vec<SegmentLink> =
        trunk.map(|(segment, joint)| plays(segment, joint, 1.0, 1.0)).collect();
    let names = [
        ([Segment::LeftUpperArm, Segment::LeftForearm], None),
        ([Segment::RightUpperArm, Segment::RightForearm], None),
        ([Segment::LeftThigh, Segment::LeftShank], Some(Segment::LeftFoot)),
        ([Segment::RightThigh, Segment::RightShank], Some(Segment::RightFoot)),
    ];
    let mut angles_rad = vec![0.0; of.joints.len()];
    let mut any_limb = false;
    for (limb, (names, end)) in arms.into_iter().chain(legs).zip(names) {
        let Some(limb) = limb else { continue };
        any_limb = true;
        let parts = limb.parts.into_iter().zip(limb.twists).zip(names);
        segments.extend(parts.map(|((joint, twist), segment)| plays(segment, joint, 1.0, twist)));
        let end = end.zip(limb.path.last());
        segments.extend(end.map(|(segment, joint)| plays(segment, *joint, 0.5, 0.3)));
        body.hang(&limb, &mut angles_rad);
    }
    if !any_limb {
        return Err("no limb of it has a knee or an elbow");
    }
    // A robot file says it of joints that are driven.
    let is_driven =
        |name: &String| of.joints.iter().any(|of| of.name == *name && of.follows.is_empty());
    if !segments.iter().all(|of| is_driven(&of.joint)) {
        return Err("a part of it hangs on a joint that follows others");
    }
    let joints: BTreeSet<&String> = segments.iter().map(|of| &of.joint).collect();
    if joints.len() < segments.len() {
        return Err("a joint of it would move two parts of a body");
    }
    let turned = of.joints.iter().zip(angles_rad).filter(|(_, angle_rad)| *angle_rad != 0.0);
    let n_pose_rad = turned.map(|(of, angle_rad)| (of.name.clone(), rounded(angle_rad)));
    Ok(Anatomy { base, n_pose_rad: n_pose_rad.collect(), segments, source: GUESSED.to_owned() })
}

/// As many digits as matter.
fn rounded(angle_rad: f64) -> f64 {
    (angle_rad * 1e6).round() / 1e6
}

/// Joints with what hangs on them.
struct Chain<'a> {
    model: &'a PublicModel,
    /// The model's links with everything at zero.
    zero: Vec<Placement>,
    joints: &'a [OwnJoint],
    /// The base's, and behind it one for each joint.
    links: &'a [ReducedLink],
}

impl Chain<'_> {
    /// Where each joint is, m, and how its link is turned from where it is at zero.
    fn placed(&self, angles_rad: &[f64]) -> (Vec<DVec3>, Vec<DQuat>) {
        let tree = &self.model.tree;
        let mut all_rad = vec![0.0; tree.moving()];
        for (joint, angle_rad) in self.joints.iter().zip(angles_rad) {
            if let Some(at) = tree.coordinate(joint.link) {
                all_rad[at] = *angle_rad;
            }
        }
        let placed = tree.place(Placement::IDENTITY, &all_rad);
        let at = |of: &OwnJoint| placed[of.link].point(tree.links()[of.link].anchor_m);
        let turn = |of: &OwnJoint| placed[of.link].turn * self.zero[of.link].turn.inverse();
        (self.joints.iter().map(at).collect(), self.joints.iter().map(turn).collect())
    }

    /// The joints from the base to this one.
    fn path(&self, joint: usize) -> Vec<usize> {
        let above = |joint: &usize| self.joints[*joint].parent;
        let mut path: Vec<usize> = std::iter::successors(Some(joint), above).collect();
        path.reverse();
        path
    }

    fn link(&self, joint: usize) -> &ReducedLink {
        &self.links[joint + 1]
    }

    /// Where the link on a joint ends, from that joint, m: the far end of its largest shape, or, if it has none, twice
    /// as far as its weight.
    fn end_m(&self, joint: usize) -> DVec3 {
        let link = self.link(joint);
        let size = |volume: &Volume| volume.ball_m().1;
        let largest = link.volumes.iter().max_by(|one, two| size(one).total_cmp(&size(two)));
        let from_m = self.joints[joint].parent.map_or(DVec3::ZERO, |of| self.joints[of].at_m);
        let onward = self.joints[joint].at_m - from_m;
        largest.map_or(link.mass.centre_m * 2.0, |volume| far_end_m(volume, onward))
    }

    /// Two joints that turn about the same direction with everything at zero.
    fn are_parallel(&self, one: usize, two: usize) -> bool {
        self.joints[one].axis.dot(self.joints[two].axis).abs() > TURNS
    }

    /// Joints that carry no other.
    fn ends(&self) -> impl Iterator<Item = usize> {
        let carries = |joint: usize| self.joints.iter().any(|of| of.parent == Some(joint));
        (0..self.joints.len()).filter(move |joint| !carries(*joint))
    }

    /// Lengths between the joints of a path, m.
    fn ways(at: &[DVec3], path: &[usize]) -> Vec<f64> {
        path.windows(2).map(|pair| at[pair[0]].distance(at[pair[1]])).collect()
    }

    /// How many joints the ways to two ends share, and those ways.
    fn shared(&self, ends: [usize; 2]) -> (usize, [Vec<usize>; 2]) {
        let paths = ends.map(|end| self.path(end));
        let both = paths[0].iter().zip(&paths[1]).take_while(|(one, two)| one == two).count();
        (both, paths)
    }

    /// A joint of a pair of limbs, of what carries both, or of what hangs on them.
    fn is_on(&self, joint: usize, ends: [usize; 2]) -> bool {
        let (shared, paths) = self.shared(ends);
        let own: Vec<usize> = paths.iter().flat_map(|path| &path[shared..]).copied().collect();
        paths[0][..shared].contains(&joint) || self.path(joint).iter().any(|of| own.contains(of))
    }

    /// What carries both ends, and the limb that `made` finds in the rest of the way to each.
    fn pair(&self, ends: Option<[usize; 2]>, made: impl Fn(&[usize]) -> Option<Limb>) -> Pair {
        let Some((shared, paths)) = ends.map(|ends| self.shared(ends)) else {
            return (None, [None, None]);
        };
        let carrier = shared.checked_sub(1).map(|last| paths[0][last]);
        (carrier, paths.map(|path| made(&path[shared..])))
    }

    /// What it stands on, left and right.
    fn feet(&self, at: &[DVec3]) -> Option<[usize; 2]> {
        let stands = |joint: usize| !self.link(joint).sole_m.is_empty();
        let any_stands = self.links.iter().any(|link| !link.sole_m.is_empty());
        let is_aside = |joint: usize, side: f64| at[joint].y * side > ASIDE_M;
        let foot = |side: f64| {
            if !any_stands {
                let aside = self.ends().filter(|joint| is_aside(*joint, side));
                return aside.min_by(|one, two| at[*one].z.total_cmp(&at[*two].z));
            }
            // Toes stand too, on a foot that does.
            let is_first =
                |joint: &usize| !self.path(*joint).iter().rev().skip(1).any(|of| stands(*of));
            let all = (0..self.joints.len()).filter(|joint| stands(*joint));
            let mut feet = all.filter(|joint| is_aside(*joint, side)).filter(is_first);
            feet.next().filter(|_| feet.next().is_none())
        };
        let feet = [foot(1.0)?, foot(-1.0)?];
        if any_stands {
            return Some(feet);
        }
        let length_m = |foot: usize| Self::ways(at, &self.path(foot)).iter().sum::<f64>();
        let alike_m = ALIKE * length_m(feet[0]).max(length_m(feet[1]));
        let [left_m, right_m] = feet.map(|foot| at[foot]);
        let are_alike = left_m.distance(right_m * DVec3::new(1.0, -1.0, 1.0)) < alike_m;
        let are_long = feet.iter().all(|foot| self.path(*foot).len() >= LEG_JOINTS);
        // Who has more that are as low has four legs.
        let lowest_m = left_m.z.max(right_m.z);
        let low = self.ends().filter(|end| at[*end].z < lowest_m + alike_m);
        let are_two = low.filter(|end| !self.is_on(*end, feet)).count() == 0;
        (are_alike && are_long && are_two).then_some(feet)
    }

    /// A sole that is further behind its joint than before it, on a leg whose knee bends to the front.
    fn looks_back(&self, leg: &Limb) -> bool {
        let Some(foot) = leg.path.last() else { return false };
        let corners = self.link(*foot).sole_m.iter().map(|corner| corner.x);
        let reach_m = corners.clone().fold(0.0, f64::max) + corners.fold(0.0, f64::min);
        let zeros = vec![0.0; self.joints.len()];
        reach_m < -ABOVE_M && self.bends_forwards(leg, &zeros) == Some(true)
    }

    fn leg(&self, at: &[DVec3], path: &[usize]) -> Option<Limb> {
        // A hip may be far to the side of another: that is no part of a leg.
        let level: Vec<DVec3> = at.iter().map(|at_m| at_m.with_y(0.0)).collect();
        let mut ways: Vec<(f64, usize)> = Self::ways(&level, path).into_iter().zip(0..).collect();
        ways.sort_by(|one, two| two.0.total_cmp(&one.0));
        let [(_, one), (_, two)] = *ways.get(..2)? else { return None };
        let knee = one.max(two);
        // What is no further away than this is the same knee, in two joints.
        let is_apart =
            |before: &usize| level[path[*before]].distance(level[path[before + 1]]) > NEAR_M;
        let thigh = (0..knee).rev().find(is_apart)?;
        Some(Limb {
            path: path.to_vec(),
            parts: [path[thigh], path[knee]],
            bend: path[knee],
            is_ball: false,
            twists: [if thigh + 1 < BALL { 0.0 } else { 0.3 }, 0.1],
            up: path.last().map(|foot| up(&self.link(*foot).sole_m)),
        })
    }

    /// The ends of the longest chain on either side that is no leg.
    ///
    /// # Errors
    /// More than one limb on a side.
    fn hands(
        &self,
        at: &[DVec3],
        feet: Option<[usize; 2]>,
    ) -> Result<Option<[usize; 2]>, &'static str> {
        let length_m = |joint: &usize| {
            Self::ways(at, &self.path(*joint)).iter().sum::<f64>() + self.end_m(*joint).length()
        };
        let free: Vec<usize> =
            self.ends().filter(|end| !feet.is_some_and(|feet| self.is_on(*end, feet))).collect();
        let is_aside = |joint: usize, side: f64| {
            let tip_m = at[joint] + self.end_m(joint);
            at[joint].y * side > ARM_ASIDE_M || tip_m.y * side > HAND_ASIDE_M
        };
        let hand = |side: f64| {
            let aside = free.iter().copied().filter(|joint| is_aside(*joint, side));
            aside.max_by(|one, two| length_m(one).total_cmp(&length_m(two)))
        };
        let Some(hands) = hand(1.0).zip(hand(-1.0)).map(|(left, right)| [left, right]) else {
            return Ok(None);
        };
        let is_limb = |end: &usize| {
            let is_other = !self.is_on(*end, hands) && self.path(*end).len() >= LIMB_JOINTS;
            is_other && at[*end].y.abs() > ARM_ASIDE_M
        };
        if free.iter().any(is_limb) {
            return Err("more than one limb hangs on a side of it, besides legs");
        }
        Ok(Some(hands))
    }

    fn arm(&self, at: &[DVec3], path: &[usize]) -> Option<Limb> {
        let (first, last) = (*path.first()?, *path.last()?);
        let tip_m = at[last] + self.end_m(last);
        let ways = Self::ways(at, path);
        let length_m = ways.iter().sum::<f64>() + self.end_m(last).length();
        let along = |from_m: DVec3, to_m: DVec3| (to_m - from_m).normalize_or_zero();
        let is_elbow = |index: &usize| {
            let (joint, before) = (path[*index], path[*index - 1]);
            let is_apart = ways[*index - 1] > APART_SHARE * length_m;
            let from_m = if is_apart { at[before] } else { at[first] };
            let bends = self.joints[joint].axis.dot(along(from_m, at[joint])).abs() < TURNS;
            bends && at[first].distance(at[joint]) > ELBOW_SHARE * length_m
        };
        let elbow = (1..path.len()).find(is_elbow)?;
        let forearm = along(at[path[elbow]], tip_m);
        let turns = |index: &usize| self.joints[path[*index]].axis.dot(forearm).abs() > TURNS;
        let lower = (elbow + 1..path.len()).take_while(turns).last().unwrap_or(elbow);
        Some(Limb {
            path: path.to_vec(),
            parts: [path[elbow - 1], path[lower]],
            bend: path[elbow],
            is_ball: elbow >= BALL,
            twists: [if elbow < BALL { 0.0 } else { 0.3 }, if lower > elbow { 0.1 } else { 0.0 }],
            up: None,
        })
    }

    /// The highest end in the middle that no limb has.
    fn head(&self, at: &[DVec3], is_limb: &dyn Fn(usize) -> bool) -> Option<usize> {
        let middle_z_m = at.iter().map(|at_m| at_m.z).sum::<f64>() / at.len().max(1) as f64;
        let is_head = |joint: &usize| {
            !is_limb(*joint) && at[*joint].y.abs() < MIDDLE_M && at[*joint].z > middle_z_m
        };
        self.ends().filter(is_head).max_by(|one, two| at[*one].z.total_cmp(&at[*two].z))
    }

    /// Turns the joints of a limb until it hangs straight down, a foot flat below it or an elbow to the front, with
    /// joints as near to zero as that lets them.
    fn hang(&self, limb: &Limb, angles_rad: &mut [f64]) {
        let turned = limb.path.iter().copied().take_while(|joint| *joint != limb.bend).last();
        let starts = if limb.is_ball { &[0.0, RIGHT_RAD, -RIGHT_RAD][..] } else { &[0.0] };
        let hung = starts.iter().map(|start_rad| {
            let mut angles_rad = angles_rad.to_vec();
            if let Some(joint) = turned {
                angles_rad[joint] = *start_rad;
            }
            let off = self.hang_from(limb, &mut angles_rad);
            // An elbow that would bend backwards is turned the wrong way.
            let is_back = limb.is_ball && self.bends_forwards(limb, &angles_rad) == Some(false);
            (off + f64::from(u8::from(is_back)), angles_rad)
        });
        if let Some((_, best)) = hung.min_by(|one, two| one.0.total_cmp(&two.0)) {
            angles_rad.copy_from_slice(&best);
        }
        // Makers count from right angles; where a hand really points, its shape tells roughly.
        for joint in limb.path.iter().copied() {
            let square_rad = (angles_rad[joint] / RIGHT_RAD).round() * RIGHT_RAD;
            let is_rough = self.are_parallel(joint, limb.bend) || joint == limb.parts[1];
            let near_rad = match (is_rough, limb.up) {
                (true, None) => ROUGH_ARM_RAD,
                (true, Some(_)) => ROUGH_LEG_RAD,
                (false, _) => ZERO_RAD,
            };
            if (angles_rad[joint] - square_rad).abs() < near_rad {
                angles_rad[joint] = square_rad;
            }
        }
    }

    /// Gauss and Newton, from these angles on; how far it is off in the end.
    fn hang_from(&self, limb: &Limb, angles_rad: &mut [f64]) -> f64 {
        let driven: Vec<usize> =
            limb.path.iter().copied().filter(|of| self.joints[*of].follows.is_empty()).collect();
        for _ in 0..STEPS {
            let here = self.off(limb, angles_rad);
            let mut slopes = DMatrix::zeros(here.len(), driven.len());
            for (column, joint) in driven.iter().enumerate() {
                let mut nudged = angles_rad.to_vec();
                nudged[*joint] += NUDGE_RAD;
                slopes.set_column(column, &((self.off(limb, &nudged) - &here) / NUDGE_RAD));
            }
            let normal =
                slopes.tr_mul(&slopes) + DMatrix::identity(driven.len(), driven.len()) * 1e-6;
            let Some(factor) = normal.cholesky() else { break };
            let step = factor.solve(&slopes.tr_mul(&here));
            for (joint, step) in driven.iter().zip(step.iter()) {
                angles_rad[*joint] -= step.clamp(-STEP_RAD, STEP_RAD);
            }
            if step.amax() < NUDGE_RAD {
                break;
            }
        }
        self.off(limb, angles_rad).norm_squared()
    }

    /// Whether the longer part of a knee's or an elbow's range moves what hangs on it to the front; nothing without a range.
    fn bends_forwards(&self, limb: &Limb, angles_rad: &[f64]) -> Option<bool> {
        let (lower_rad, upper_rad) = self.joints[limb.bend].range?;
        let axis = self.placed(angles_rad).1[limb.bend] * self.joints[limb.bend].axis;
        let at_rad = angles_rad[limb.bend];
        let bends_up = upper_rad - at_rad > at_rad - lower_rad;
        // Turned about -y what hangs goes forward.
        Some((axis.y < 0.0) == bends_up)
    }

    /// How far a limb is from hanging, and its joints from zero. A joint may be anywhere along its axis: whether a limb
    /// is bent is told by axes that are parallel to its knee or elbow.
    fn off(&self, limb: &Limb, angles_rad: &[f64]) -> DVector<f64> {
        let (at, turns) = self.placed(angles_rad);
        let bend_m = at[limb.bend];
        let axis = turns[limb.bend] * self.joints[limb.bend].axis;
        let last = limb.path.last().copied().unwrap_or(limb.bend);
        let tip_m = at[last] + turns[last] * self.end_m(last);
        let bend = limb.path.iter().position(|joint| *joint == limb.bend).unwrap_or(0);
        let is_apart = |joint: &usize| at[*joint].distance(bend_m) > NEAR_M;
        let above: Vec<usize> = limb.path[..bend].iter().rev().copied().filter(is_apart).collect();
        let below: Vec<usize> = limb.path[bend..].iter().copied().filter(is_apart).collect();
        let hinged = |joints: &[usize]| {
            let parallel = joints.iter().find(|joint| self.are_parallel(**joint, limb.bend));
            parallel.or(joints.first()).copied()
        };
        let from_m = |end: Option<usize>| end.map_or(bend_m, |joint| at[joint]);
        let to_m = |end: Option<usize>| end.map_or(tip_m, |joint| at[joint]);
        let mut off = Vec::new();
        for part_m in [bend_m - from_m(hinged(&above)), to_m(hinged(&below)) - bend_m] {
            let bent = part_m.reject_from(axis).normalize_or_zero() + DVec3::Z;
            off.extend(bent.reject_from(axis).to_array());
        }
        // A knee or an elbow lies across a limb: level, it does not lean.
        match limb.up {
            Some(_) => off.push(axis.z),
            None if limb.is_ball => off.extend([axis.x, axis.z]),
            None => {
                // Where a hand ends is too rough to tell.
                let end_m = below.first().map_or(bend_m, |joint| at[*joint]);
                let start_m = from_m(above.first().copied());
                off.push(((end_m - start_m).normalize_or_zero() + DVec3::Z).dot(axis));
            }
        }
        if limb.parts[1] != limb.bend {
            // A hand faces as it does at zero.
            off.extend(((turns[limb.parts[1]] * DVec3::Y - DVec3::Y) * FACES).to_array());
        }
        if let Some(up) = limb.up {
            off.extend((turns[last] * up - DVec3::Z).to_array());
        }
        off.extend(limb.path.iter().map(|joint| CALM * angles_rad[*joint]));
        DVector::from_vec(off)
    }
}

/// The end that is further away along a shape's longest side; of two alike the one that goes on in a direction.
fn far_end_m(volume: &Volume, onward: DVec3) -> DVec3 {
    let ends = match volume {
        Volume::Capsule(of) => [of.from_m, of.to_m],
        Volume::Cuboid(of) => {
            let sides = [DVec3::X * of.half_m.x, DVec3::Y * of.half_m.y, DVec3::Z * of.half_m.z];
            let longest = sides.into_iter().max_by(|a, b| a.length().total_cmp(&b.length()));
            let along = of.turn * longest.unwrap_or(DVec3::ZERO);
            [of.centre_m - along, of.centre_m + along]
        }
    };
    let [one_m, two_m] = ends.map(DVec3::length);
    let is_first = match (one_m - two_m).abs() < NEAR_M {
        true => ends[0].dot(onward) > ends[1].dot(onward),
        false => one_m > two_m,
    };
    ends[usize::from(!is_first)]
}

/// Up from corners that lie in a plane; as it is at zero of what has none.
fn up(corners_m: &[DVec3]) -> DVec3 {
    let middle_m = corners_m.iter().sum::<DVec3>() / corners_m.len().max(1) as f64;
    let every = corners_m.len().div_ceil(CORNERS).max(1);
    let arms = || corners_m.iter().step_by(every).map(|corner| *corner - middle_m);
    let normals = arms().flat_map(|one| arms().map(move |two| one.cross(two)));
    let longest = |a: &DVec3, b: &DVec3| a.length_squared().total_cmp(&b.length_squared());
    let normal = normals.max_by(longest).unwrap_or(DVec3::Z).try_normalize().unwrap_or(DVec3::Z);
    if normal.z < 0.0 { -normal } else { normal }
}
