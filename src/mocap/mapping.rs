//! Which joint of a skeleton moves which segment of the body.
//!
//! Names first (see [`names`]), checked against the hierarchy: a shank hangs below a thigh. Where
//! names do not tell, the shape of the hierarchy does (see [`structure`]). A mapping file has the
//! last word:
//!
//! ```toml
//! [segments]
//! left_upper_arm = "LeftArm"
//! ```

use crate::body::{Segment, segment_name};
use crate::error::{Error, ErrorKind};
use crate::mocap::bvh::{Bvh, Joint};
use crate::mocap::skeleton::Point;
use crate::toml_text::from_toml;
use glam::DVec3;
use serde::Deserialize;
use std::collections::BTreeMap;

pub mod names;
pub mod structure;

use names::{Name, Side};

/// The joints behind one segment.
#[derive(Clone, Debug, PartialEq)]
pub struct Part {
    /// Joint at the segment's upper end: hip, knee, ankle, shoulder, elbow, base of the head.
    pub joint: usize,
    /// Joint whose frame the segment is fixed in; below [`Part::joint`] where twist joints are.
    pub carrier: usize,
    /// The segment's far end, if the skeleton has it: the next joint, the wrist, the toes.
    pub tip: Option<Point>,
}

/// Body segments found in a skeleton.
#[derive(Clone, Debug, PartialEq)]
pub struct Mapping {
    parts: [Option<Part>; 13],
    /// Base of the neck, if there is one.
    pub neck: Option<usize>,
    /// True if names or a mapping file say what is left; false if only the order in the file does.
    pub sides_are_named: bool,
}

/// A mapping file: names of joints by segment.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MappingFile {
    /// Joint name by segment name, e.g. `left_upper_arm = "LeftArm"`.
    pub segments: BTreeMap<String, String>,
}

impl MappingFile {
    /// Reads the text of a mapping file.
    ///
    /// # Errors
    /// If it is not TOML, or has other keys than `[segments]`.
    pub fn parse(text: &str) -> Result<Self, Error> {
        from_toml(text).map_err(|cause| {
            Error::of(ErrorKind::Malformed, "the mapping file cannot be read")
                .got(cause.to_string().trim_end().to_owned())
                .allowed("[segments] with lines such as left_upper_arm = \"LeftArm\"")
        })
    }
}

/// Segments of a leg from the hip down, by side.
pub const LEGS: [[Segment; 3]; 2] = [
    [Segment::LeftThigh, Segment::LeftShank, Segment::LeftFoot],
    [Segment::RightThigh, Segment::RightShank, Segment::RightFoot],
];
/// Segments of an arm from the shoulder down, by side.
pub const ARMS: [[Segment; 2]; 2] = [
    [Segment::LeftUpperArm, Segment::LeftForearm],
    [Segment::RightUpperArm, Segment::RightForearm],
];
const SIDES: [Side; 2] = [Side::Left, Side::Right];

impl Mapping {
    /// Finds the segments of a skeleton.
    ///
    /// # Errors
    /// If the mapping file names a segment or joint that is not there, or a joint twice, or if
    /// neither legs nor arms are found.
    pub fn find(bvh: &Bvh, file: Option<&MappingFile>) -> Result<Self, Error> {
        let given = file.map_or(Ok([None; 13]), |file| given_joints(bvh, file))?;
        let all: Vec<&str> = bvh.joints.iter().map(|joint| joint.name.as_str()).collect();
        let search = Search { bvh, names: names::parse(&all), given };
        search.mapping()
    }

    /// What is known of a segment.
    #[must_use]
    pub fn part(&self, segment: Segment) -> Option<&Part> {
        self.parts[segment.index()].as_ref()
    }

    /// True if each segment is of the same joints as in another mapping.
    #[must_use]
    pub fn is_alike(&self, other: &Self) -> bool {
        let joints = |part: &Option<Part>| part.as_ref().map(|part| (part.joint, part.carrier));
        self.parts.iter().map(joints).eq(other.parts.iter().map(joints))
    }

    /// Takes left legs for right.
    pub fn swap_legs(&mut self) {
        for (left, right) in LEGS[0].into_iter().zip(LEGS[1]) {
            self.parts.swap(left.index(), right.index());
        }
    }

    /// Takes left arms for right.
    pub fn swap_arms(&mut self) {
        for (left, right) in ARMS[0].into_iter().zip(ARMS[1]) {
            self.parts.swap(left.index(), right.index());
        }
    }

    /// One line: which joint stands for which segment.
    #[must_use]
    pub fn describe(&self, bvh: &Bvh) -> String {
        let found = Segment::ALL.iter().filter_map(|segment| {
            let part = self.part(*segment)?;
            Some(format!("{} = {}", segment_name(*segment), bvh.joints[part.joint].name))
        });
        found.collect::<Vec<_>>().join(", ")
    }
}

fn given_joints(bvh: &Bvh, file: &MappingFile) -> Result<[Option<usize>; 13], Error> {
    let mut given = [None; 13];
    for (key, joint) in &file.segments {
        let segment = Segment::ALL.into_iter().find(|segment| segment_name(*segment) == key);
        let Some(segment) = segment else {
            let names: Vec<&str> =
                Segment::ALL.iter().map(|segment| segment_name(*segment)).collect();
            return Err(Error::of(
                ErrorKind::Malformed,
                "the mapping file names a segment that does not exist",
            )
            .at("[segments]")
            .got(key.as_str())
            .allowed(names.join(", ")));
        };
        let at = bvh.joints.iter().position(|candidate| candidate.name == *joint);
        let Some(at) = at else {
            let names: Vec<&str> = bvh.joints.iter().map(|joint| joint.name.as_str()).collect();
            return Err(Error::new(format!(
                "the mapping file gives {key} a joint that is not there"
            ))
            .at(format!("[segments], {key}"))
            .got(joint.as_str())
            .allowed(names.join(", ")));
        };
        let same = |(_, other): &(usize, &Joint)| other.name == *joint;
        if let Some((second, _)) = bvh.joints.iter().enumerate().skip(at + 1).find(same) {
            return Err(Error::new(format!(
                "the mapping file gives {key} a joint whose name stands twice in the skeleton"
            ))
            .at(format!("[segments], {key}"))
            .got(format!("{joint}: joint {} and joint {}", at + 1, second + 1))
            .allowed("a joint whose name stands there once"));
        }
        let other = Segment::ALL.into_iter().find(|other| given[other.index()] == Some(at));
        if let Some(other) = other.filter(|other| !is_trunk(*other) || !is_trunk(segment)) {
            return Err(Error::of(ErrorKind::Malformed, "the mapping file names a joint twice")
                .at("[segments]")
                .got(format!("{joint}: {} and {key}", segment_name(other)))
                .allowed("a joint of its own for each segment"));
        }
        given[segment.index()] = Some(at);
    }
    Ok(given)
}

/// True for those that one joint may carry together, in a skeleton without a spine.
const fn is_trunk(segment: Segment) -> bool {
    matches!(segment, Segment::Pelvis | Segment::Torso)
}

/// Everything the search looks at.
struct Search<'a> {
    bvh: &'a Bvh,
    names: Vec<Name>,
    given: [Option<usize>; 13],
}

/// Joints of a limb from its root to its end.
type Limb = [Option<usize>; 3];

impl Search<'_> {
    fn mapping(&self) -> Result<Mapping, Error> {
        let mut legs = SIDES.map(|side| self.limb(side, [names::THIGH, names::SHANK, names::FOOT]));
        let mut arms =
            SIDES.map(|side| self.limb(side, [names::UPPER_ARM, names::FOREARM, names::HAND]));
        let mut sides_are_named = true;
        if [legs, arms].iter().any(|limbs| limbs.iter().any(|limb| limb[1].is_none())) {
            let shape = structure::limbs(self.bvh);
            for (limbs, found) in [(&mut legs, shape.legs), (&mut arms, shape.arms)] {
                if let Some(found) = found
                    && limbs.iter().any(|limb| limb[1].is_none())
                {
                    *limbs = self.by_side(found);
                    sides_are_named &= found.iter().any(|limb| self.side(*limb).is_some());
                }
            }
        }
        let mut parts: [Option<Part>; 13] = Default::default();
        for (limbs, feet) in [(legs, true), (arms, false)] {
            for (side, limb) in limbs.into_iter().enumerate() {
                let segments = LEGS[side].into_iter().take(if feet { 3 } else { 0 });
                let segments: Vec<Segment> =
                    segments.chain(ARMS[side].into_iter().take(if feet { 0 } else { 2 })).collect();
                self.place_limb(&segments, limb, &mut parts)?;
            }
        }
        self.place_trunk(&mut parts);
        let whole = |limbs: &[Segment]| limbs.iter().all(|s| parts[s.index()].is_some());
        if !LEGS.iter().any(|leg| whole(&leg[..2])) && !ARMS.iter().any(|arm| whole(arm)) {
            let names: Vec<&str> =
                self.bvh.joints.iter().take(40).map(|joint| joint.name.as_str()).collect();
            return Err(Error::of(
                ErrorKind::Malformed,
                "no legs and no arms are found in the skeleton",
            )
            .got(format!("joints {}", names.join(", ")))
            .allowed("a person: thigh, shank, upper arm, forearm on both sides")
            .remedy("if it is a person, name the joints in a mapping file"));
        }
        let neck = names::find(&self.names, Side::Middle, names::NECK, |_| true);
        Ok(Mapping { parts, neck, sides_are_named })
    }

    /// True if `joint` is `above` or hangs below it.
    fn is_within(&self, joint: usize, above: usize) -> bool {
        let mut at = Some(joint);
        while let Some(joint) = at {
            if joint == above {
                return true;
            }
            at = self.bvh.joints[joint].parent;
        }
        false
    }

    /// A limb by names: the first choice of words that makes a chain downwards. The third joint
    /// may be missing.
    fn limb(&self, side: Side, words: [&[&str]; 3]) -> Limb {
        let below = |above: usize| move |at: usize| at != above && self.is_within(at, above);
        for first in words[0] {
            let Some(upper) = names::find(&self.names, side, &[first], |_| true) else { continue };
            let Some(lower) = names::find(&self.names, side, words[1], below(upper)) else {
                continue;
            };
            let end = names::find(&self.names, side, words[2], below(lower));
            return [Some(upper), Some(lower), end.or_else(|| structure::next(self.bvh, lower))];
        }
        [None; 3]
    }

    /// The side that the names of a limb agree on.
    fn side(&self, limb: [usize; 2]) -> Option<Side> {
        let count = |side| limb.iter().filter(|at| self.names[**at].side == side).count();
        match count(Side::Left).cmp(&count(Side::Right)) {
            std::cmp::Ordering::Greater => Some(Side::Left),
            std::cmp::Ordering::Less => Some(Side::Right),
            std::cmp::Ordering::Equal => None,
        }
    }

    /// Puts a pair of limbs in order, left first, if names tell.
    fn by_side(&self, [one, other]: [[usize; 2]; 2]) -> [Limb; 2] {
        let swap = self.side(one) == Some(Side::Right) || self.side(other) == Some(Side::Left);
        let pair = if swap { [other, one] } else { [one, other] };
        pair.map(|[upper, lower]| [Some(upper), Some(lower), structure::next(self.bvh, lower)])
    }

    /// Fills in the segments of a limb, `limb` overruled by the mapping file.
    fn place_limb(
        &self,
        segments: &[Segment],
        limb: Limb,
        parts: &mut [Option<Part>; 13],
    ) -> Result<(), Error> {
        let mut joints = limb;
        for (joint, segment) in joints.iter_mut().zip(segments) {
            *joint = self.given[segment.index()].or(*joint);
        }
        for (at, segment) in segments.iter().enumerate() {
            let Some(joint) = joints[at] else { break };
            let next = joints.get(at + 1).copied().flatten();
            let part = match next {
                Some(next) if next != joint && self.is_within(next, joint) => Part {
                    joint,
                    carrier: self.bvh.joints[next].parent.unwrap_or(joint),
                    tip: Some(Point::origin(next)),
                },
                Some(next) if at + 1 < segments.len() => {
                    return Err(Error::new(format!(
                        "joint {} of {} does not hang below joint {} of {}",
                        self.bvh.joints[next].name,
                        segment_name(segments[at + 1]),
                        self.bvh.joints[joint].name,
                        segment_name(*segment)
                    ))
                    .remedy("correct the mapping file"));
                }
                _ => Part { joint, carrier: joint, tip: self.tip(joint) },
            };
            parts[segment.index()] = Some(part);
        }
        Ok(())
    }

    /// The far end of a last segment: toes by name, else the next joint, else an end site. Where
    /// that is a stub, as an ankle's own height above the foot, the far end of the bone behind it.
    fn tip(&self, joint: usize) -> Option<Point> {
        let below = |at: usize| at != joint && self.is_within(at, joint);
        let joints = &self.bvh.joints;
        let toe = names::find(&self.names, self.names[joint].side, names::TOE, below);
        let far = |at: &usize| joints[*at].offset != DVec3::ZERO;
        let end = |joint: usize| {
            let offset = *joints[joint].ends.iter().find(|end| **end != DVec3::ZERO)?;
            Some(Point { joint, offset })
        };
        let next = toe.filter(far).or_else(|| structure::next(self.bvh, joint));
        let Some(next) = next else { return end(joint) };
        let beyond = structure::next(self.bvh, next).map(Point::origin).or_else(|| end(next));
        let length = |point: &Point| match point.offset {
            DVec3::ZERO => joints[point.joint].offset.length(),
            offset => offset.length(),
        };
        let is_stub = |beyond: &Point| length(beyond) > 2.0 * joints[next].offset.length();
        Some(beyond.filter(is_stub).unwrap_or(Point::origin(next)))
    }

    /// Pelvis and torso are what carries the legs and the arms; the head is found by name, else
    /// as the chain upwards from the torso.
    fn place_trunk(&self, parts: &mut [Option<Part>; 13]) {
        let joint = |parts: &[Option<Part>; 13], segment: Segment| {
            parts[segment.index()].as_ref().map(|part| part.joint)
        };
        let common = |a: Option<usize>, b: Option<usize>| {
            let mut above = self.bvh.joints[a?].parent;
            while let Some(at) = above {
                if self.is_within(b?, at) {
                    return Some(at);
                }
                above = self.bvh.joints[at].parent;
            }
            None
        };
        let hips = common(joint(parts, Segment::LeftThigh), joint(parts, Segment::RightThigh));
        let shoulders =
            common(joint(parts, Segment::LeftUpperArm), joint(parts, Segment::RightUpperArm));
        let named = |words: &[&str]| names::find(&self.names, Side::Middle, words, |_| true);
        // 3ds Max Biped hangs the thighs on the first spine joint, though they do not turn with it,
        // and the collarbones on the neck.
        let spine_carries_legs =
            hips.is_some_and(|hips| self.names[hips].word.starts_with("spine"));
        let hips = match named(names::PELVIS) {
            Some(pelvis) if spine_carries_legs => Some(pelvis),
            pelvis => hips.or(pelvis).or(Some(0)),
        };
        let mut torso = shoulders;
        while let Some(at) = torso
            && names::NECK.contains(&self.names[at].word.as_str())
        {
            torso = self.bvh.joints[at].parent;
        }
        let neck_or_head = named(names::NECK).or_else(|| named(names::HEAD));
        let torso = torso.or_else(|| self.bvh.joints[neck_or_head?].parent);
        let arms = [Segment::LeftUpperArm, Segment::RightUpperArm].map(|arm| joint(parts, arm));
        let head = named(names::HEAD)
            .or_else(|| named(&["neck"]))
            .or_else(|| structure::head(self.bvh, torso?, arms));
        let found = [(Segment::Pelvis, hips), (Segment::Torso, torso), (Segment::Head, head)];
        for (segment, joint) in found {
            let joint = self.given[segment.index()].or(joint);
            parts[segment.index()] =
                joint.map(|joint| Part { joint, carrier: joint, tip: self.tip(joint) });
        }
    }
}
