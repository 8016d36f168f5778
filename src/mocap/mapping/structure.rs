//! What the shape of a hierarchy says, names aside: a person's limbs are two pairs of like chains,
//! the legs on the joint nearer the root, the arms on a joint of the third chain from there, and
//! the head is at the end of what is left.

use crate::mocap::bvh::Bvh;

/// How much the bones of a left and a right limb may differ in length.
const LIKENESS: f64 = 0.15;

/// Pairs of limbs, each with its two main joints: hip and knee, or shoulder and elbow.
#[derive(Clone, Copy, Debug, Default)]
pub struct Limbs {
    /// The legs, in file order.
    pub legs: Option<[[usize; 2]; 2]>,
    /// The arms, in file order.
    pub arms: Option<[[usize; 2]; 2]>,
}

/// Length of the bone above a joint, file units.
fn length(bvh: &Bvh, joint: usize) -> f64 {
    bvh.joints[joint].offset.length()
}

fn children(bvh: &Bvh, joint: usize) -> impl Iterator<Item = usize> + '_ {
    (joint + 1..bvh.joints.len()).filter(move |at| bvh.joints[*at].parent == Some(joint))
}

/// Length of the longest chain of bones below each joint, end sites not counted.
fn reaches(bvh: &Bvh) -> Vec<f64> {
    let mut reach = vec![0.0_f64; bvh.joints.len()];
    for at in (0..bvh.joints.len()).rev() {
        if let Some(parent) = bvh.joints[at].parent {
            reach[parent] = reach[parent].max(reach[at] + length(bvh, at));
        }
    }
    reach
}

/// The next joint at a distance down the longest chain, if any.
#[must_use]
pub fn next(bvh: &Bvh, joint: usize) -> Option<usize> {
    chain(bvh, &reaches(bvh), joint).get(1).map(|(joint, _)| *joint)
}

/// Joints down the longest chain from `joint`, each with the length of the bone above it; of those
/// in one place the last stands for all.
fn chain(bvh: &Bvh, reach: &[f64], joint: usize) -> Vec<(usize, f64)> {
    let mut joints = vec![(joint, 0.0)];
    let mut at = joint;
    let total = |at: usize| reach[at] + length(bvh, at);
    while let Some(below) = children(bvh, at).max_by(|a, b| total(*a).total_cmp(&total(*b))) {
        at = below;
        match joints.last_mut() {
            Some(last) if length(bvh, at) == 0.0 && last.0 != joint => last.0 = at,
            _ if length(bvh, at) == 0.0 => {}
            _ => joints.push((at, length(bvh, at))),
        }
    }
    joints
}

/// The joints that start the longest two bones in a row of a chain, and the bones' lengths; of
/// about equal ones the last, since a collarbone may look long. The chain's last bone may be an
/// end site.
fn main_joints(bvh: &Bvh, chain: &[(usize, f64)]) -> Option<([usize; 2], [f64; 2])> {
    let mut lengths: Vec<f64> = chain[1..].iter().map(|(_, length)| *length).collect();
    let ends = chain.last().map(|(last, _)| &bvh.joints[*last].ends);
    lengths.extend(ends.into_iter().flatten().map(|end| end.length()).max_by(f64::total_cmp));
    let bones = || chain.windows(2).zip(lengths.windows(2));
    let longest = bones().map(|(_, bones)| bones[0] + bones[1]).fold(0.0, f64::max);
    let is_long = |bones: &[f64]| bones[0] + bones[1] >= (1.0 - LIKENESS) * longest;
    let last = bones().rev().find(|(_, bones)| is_long(bones));
    last.map(|(joints, bones)| ([joints[0].0, joints[1].0], [bones[0], bones[1]]))
}

struct Pair {
    fork: usize,
    length: f64,
    limbs: [[usize; 2]; 2],
}

/// Finds the two pairs of limbs.
#[must_use]
pub fn limbs(bvh: &Bvh) -> Limbs {
    let reach = reaches(bvh);
    let depth =
        |joint: usize| std::iter::successors(Some(joint), |at| bvh.joints[*at].parent).count();
    let is_within = |joint: usize, above: usize| {
        std::iter::successors(Some(joint), |at| bvh.joints[*at].parent).any(|at| at == above)
    };
    let mut pairs = Vec::new();
    for fork in 0..bvh.joints.len() {
        let below: Vec<usize> = children(bvh, fork).collect();
        let longest: Option<Pair> = below
            .iter()
            .enumerate()
            .flat_map(|(at, one)| below[at + 1..].iter().map(move |other| (*one, *other)))
            .filter_map(|(one, other)| alike(bvh, &reach, one, other))
            .map(|(limbs, length)| Pair { fork, length, limbs })
            .max_by(|a, b| a.length.total_cmp(&b.length));
        pairs.extend(longest);
    }
    // Pairs of fingers, eyes and the like are far shorter than limbs.
    let longest = pairs.iter().map(|pair| pair.length).fold(0.0, f64::max);
    pairs.retain(|pair| pair.length > 0.4 * longest);
    pairs.sort_by_key(|pair| depth(pair.fork));
    let Some(legs) = pairs.first() else { return Limbs::default() };
    let arms = pairs
        .iter()
        .skip(1)
        .find(|pair| !legs.limbs.iter().any(|leg| is_within(pair.fork, leg[0])));
    Limbs { legs: Some(legs.limbs), arms: arms.map(|arms| arms.limbs) }
}

/// The main joints of two chains and the length of their bones, if they are like mirror images.
fn alike(bvh: &Bvh, reach: &[f64], one: usize, other: usize) -> Option<([[usize; 2]; 2], f64)> {
    let near = |a: f64, b: f64| (a - b).abs() <= LIKENESS * a.max(b);
    let (left, left_bones) = main_joints(bvh, &chain(bvh, reach, one))?;
    let (right, right_bones) = main_joints(bvh, &chain(bvh, reach, other))?;
    let alike = (0..2).all(|at| near(left_bones[at], right_bones[at]));
    alike.then_some(([left, right], left_bones[0] + left_bones[1]))
}

/// The head: the longest chain up from the torso that carries no arm; its last joint but an end.
#[must_use]
pub fn head(bvh: &Bvh, torso: usize, arms: [Option<usize>; 2]) -> Option<usize> {
    let reach = reaches(bvh);
    let is_above = |joint: usize, arm: Option<usize>| {
        std::iter::successors(arm, |at| bvh.joints[*at].parent).any(|at| at == joint)
    };
    let free = children(bvh, torso).filter(|at| !arms.iter().any(|arm| is_above(*at, *arm)));
    let start = free.max_by(|a, b| reach[*a].total_cmp(&reach[*b]))?;
    let joints = chain(bvh, &reach, start);
    let has_end = |at: usize| children(bvh, at).next().is_some() || !bvh.joints[at].ends.is_empty();
    joints.iter().rev().find(|(at, _)| has_end(*at)).or(joints.last()).map(|(at, _)| *at)
}
