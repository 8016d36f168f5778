//! Which files are of one skeleton: equal joint names, one hierarchy, equal OFFSETs.
//!
//! Bone frames follow from these, whatever is done in a clip. The OFFSET of a root is a place in
//! the world, and so is that of a joint with position channels which is all that its root carries:
//! they are left out. So are end sites, which exporters fill in one file and not in the next.

use crate::mocap::bvh::{Channel, Joint};
use glam::DVec3;

/// OFFSETs are equal to this part of the longest chain of bones: a millimetre of a person.
const EQUAL: f64 = 1e-3;

/// The bones of a file, as far as they make its skeleton.
#[derive(Clone, Debug, PartialEq)]
pub struct Bones {
    bones: Vec<Bone>,
    /// Length of the longest chain, file units.
    longest: f64,
}

#[derive(Clone, Debug, PartialEq)]
struct Bone {
    name: String,
    parent: Option<usize>,
    offset: DVec3,
}

impl Bones {
    /// The bones of the joints of a file, parents before children.
    #[must_use]
    pub fn of(joints: &[Joint]) -> Self {
        let mut reaches: Vec<f64> = Vec::with_capacity(joints.len());
        let mut bones = Vec::with_capacity(joints.len());
        for (at, joint) in joints.iter().enumerate() {
            let offset = if is_place(joints, at) { DVec3::ZERO } else { joint.offset };
            let above = joint.parent.map_or(0.0, |parent| reaches[parent]);
            reaches.push(above + offset.length());
            bones.push(Bone { name: joint.name.clone(), parent: joint.parent, offset });
        }
        Self { bones, longest: reaches.into_iter().fold(0.0, f64::max) }
    }

    /// True if both are of one skeleton.
    #[must_use]
    pub fn is_same(&self, other: &Self) -> bool {
        let near = EQUAL * self.longest.max(other.longest);
        let same = |(a, b): (&Bone, &Bone)| {
            a.name == b.name && a.parent == b.parent && (a.offset - b.offset).length() <= near
        };
        self.bones.len() == other.bones.len() && self.bones.iter().zip(&other.bones).all(same)
    }
}

/// True of a joint whose OFFSET says where somebody stands instead of how long a bone is.
fn is_place(joints: &[Joint], at: usize) -> bool {
    let joint = &joints[at];
    let Some(parent) = joint.parent else { return true };
    let moves = joint.channels.iter().any(|channel| matches!(channel, Channel::Position(_)));
    let alone = || joints.iter().filter(|other| other.parent == Some(parent)).count() == 1;
    joints[parent].parent.is_none() && moves && alone()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mocap::bvh::Axis;

    /// A root that stays, a pelvis that moves below it, and a leg: in cm.
    fn joints() -> Vec<Joint> {
        let position = vec![Channel::Position(Axis::X)];
        let joint = |name: &str, parent, offset, channels| Joint {
            name: name.to_owned(),
            parent,
            offset,
            channels,
            first_channel: 0,
            ends: vec![DVec3::X],
        };
        vec![
            joint("Root", None, DVec3::ZERO, Vec::new()),
            joint("Hips", Some(0), DVec3::new(3.0, 95.0, -452.0), position.clone()),
            joint("Leg", Some(1), DVec3::new(9.0, 0.0, 0.0), position.clone()),
            joint("Shin", Some(2), DVec3::new(0.0, -43.0, 0.0), position.clone()),
            joint("Foot", Some(3), DVec3::new(0.0, -43.0, 0.0), position),
        ]
    }

    fn same_after(change: fn(&mut Vec<Joint>)) -> bool {
        let (plain, mut changed) = (joints(), joints());
        change(&mut changed);
        let (plain, changed) = (Bones::of(&plain), Bones::of(&changed));
        assert_eq!(plain.is_same(&changed), changed.is_same(&plain));
        plain.is_same(&changed)
    }

    #[test]
    fn rounding_and_where_somebody_stands_make_no_other_skeleton() {
        assert!(same_after(|_| ()));
        assert!(same_after(|joints| joints[3].offset.z += 0.04));
        assert!(same_after(|joints| joints[1].offset = DVec3::new(0.0, 91.0, -2.0)));
        assert!(same_after(|joints| joints[0].offset.x = 7.0));
        assert!(same_after(|joints| joints[4].ends.clear()));
    }

    #[test]
    fn another_bone_name_or_parent_makes_another_skeleton() {
        assert!(!same_after(|joints| joints[3].offset.z += 0.5));
        assert!(!same_after(|joints| joints[3].name.push('2')));
        assert!(!same_after(|joints| joints[4].parent = Some(2)));
        assert!(!same_after(|joints| drop(joints.pop())));
        // Where the root carries more than the hips, their OFFSET is a bone.
        assert!(!same_after(|joints| joints[2].parent = Some(0)));
    }
}
