//! What the shape of a hierarchy says, names aside: a person's limbs are two pairs of like chains,
//! the legs on the joint nearer the root, the arms on a joint of the third chain from there, and
//! the head is at the end of what is left.

use crate::mocap::bvh::Bvh;

/// How much the bones of a left and a right limb may differ in length.
const LIKENESS: f64 = 0.15;

/// Pairs of limbs, each with its three main joints: hip, knee, ankle or shoulder, elbow, wrist.
#[derive(Clone, Copy, Debug, Default)]
pub struct Limbs {
    /// The legs, in file order.
    pub legs: Option<[[usize; 3]; 2]>,
    /// The arms, in file order.
    pub arms: Option<[[usize; 3]; 2]>,
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
    chain(bvh, &reaches(bvh), joint).get(1).copied()
}

/// Joints down the longest chain from `joint`; those in the same place as the one before are left
/// out, the last of them standing for all.
fn chain(bvh: &Bvh, reach: &[f64], joint: usize) -> Vec<usize> {
    let mut joints = vec![joint];
    let mut at = joint;
    let total = |at: usize| reach[at] + length(bvh, at);
    while let Some(below) = children(bvh, at).max_by(|a, b| total(*a).total_cmp(&total(*b))) {
        at = below;
        if length(bvh, at) > 0.0 {
            joints.push(at);
        } else if let Some(last) = joints.last_mut()
            && *last != joint
        {
            *last = at;
        }
    }
    joints
}

/// The joint that starts the longest two bones in a row, and the two below it.
fn main_joints(bvh: &Bvh, chain: &[usize]) -> Option<[usize; 3]> {
    let bones = |three: &&[usize]| length(bvh, three[1]) + length(bvh, three[2]);
    let best = chain.windows(3).max_by(|a, b| bones(a).total_cmp(&bones(b)))?;
    Some([best[0], best[1], best[2]])
}

struct Pair {
    fork: usize,
    limbs: [[usize; 3]; 2],
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
            .filter_map(|(one, other)| {
                let limbs = alike(bvh, &reach, one, other)?;
                Some((reach[one], Pair { fork, limbs }))
            })
            .max_by(|(a, _), (b, _)| a.total_cmp(b))
            .map(|(_, pair)| pair);
        pairs.extend(longest);
    }
    pairs.sort_by_key(|pair| depth(pair.fork));
    let Some(legs) = pairs.first() else { return Limbs::default() };
    let arms = pairs
        .iter()
        .skip(1)
        .find(|pair| !legs.limbs.iter().any(|leg| is_within(pair.fork, leg[0])));
    Limbs { legs: Some(legs.limbs), arms: arms.map(|arms| arms.limbs) }
}

/// The main joints of two chains, if they are like mirror images.
fn alike(bvh: &Bvh, reach: &[f64], one: usize, other: usize) -> Option<[[usize; 3]; 2]> {
    let near = |a: f64, b: f64| (a - b).abs() <= LIKENESS * a.max(b);
    let limbs = [one, other].map(|start| main_joints(bvh, &chain(bvh, reach, start)));
    let [Some(left), Some(right)] = limbs else { return None };
    let alike = (1..3).all(|at| near(length(bvh, left[at]), length(bvh, right[at])));
    // A single bone with a double: fingers and the like are far shorter than limbs.
    let long = length(bvh, left[1]) + length(bvh, left[2]) > 0.15 * reach[0];
    (alike && long).then_some([left, right])
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
    let has_end =
        |at: &usize| children(bvh, *at).next().is_some() || !bvh.joints[*at].ends.is_empty();
    joints.into_iter().rev().find(has_end)
}
