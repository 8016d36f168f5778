//! Frames of the 21 bones by the rules of their authors (Guerra-Filho and Biswas 2012): in each bone Y goes from its origin
//! to what it aims at, and X is Y cross the way to a third point; in the root Z goes to the front of the pelvis, and Y is as
//! near to up as can be.
//!
//! The rules say the frames while the person stands; from there they turn as the bones do. By the rules alone X of left and right bones
//! point opposite ways, since third points lie outwards on both sides: frames of right bones are turned by half about Y, so
//! that one rotation means the same on both sides. Feet are alike as they are.

use super::{BONES, FittedBones, MarkerPlace};
use glam::{DMat3, DQuat, DVec3};

/// How a bone lies in a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoneFrame {
    /// Its name.
    pub name: &'static str,
    /// Its origin, m, axes of the file.
    pub at_m: DVec3,
    /// From the bone to the axes of the file.
    pub turn: DQuat,
}

/// The third point of a bone, in the order of the table; none of the root.
pub(super) const THIRD: [Option<MarkerPlace>; BONES] = {
    use MarkerPlace::*;
    [
        None,
        Some(STRN),
        Some(STRN),
        Some(CLAV),
        Some(CLAV),
        Some(CLAV),
        Some(LUPA),
        Some(LFRM),
        Some(LWRA),
        Some(CLAV),
        Some(RUPA),
        Some(RFRM),
        Some(RWRA),
        Some(RPSI),
        Some(LTHI),
        Some(LTIB),
        Some(LHEE),
        Some(LPSI),
        Some(RTHI),
        Some(RTIB),
        Some(RHEE),
    ]
};

/// The frame of a bone that goes from one point to another; `third_m` is the way from its origin to its third point.
pub(super) fn by_rule(name: &str, aim_m: DVec3, third_m: Option<DVec3>) -> Option<DQuat> {
    let aim = aim_m.try_normalize()?;
    let Some(third_m) = third_m else {
        let y = (DVec3::Z - aim * aim.z).try_normalize()?;
        return Some(DQuat::from_mat3(&DMat3::from_cols(y.cross(aim), y, aim)));
    };
    let x = aim.cross(third_m).try_normalize()?;
    let x = if name.starts_with("R_") && name != "R_Foot" { -x } else { x };
    Some(DQuat::from_mat3(&DMat3::from_cols(x, aim, x.cross(aim))))
}

impl FittedBones {
    /// How bones lie in a frame, those whose rule the markers allow.
    #[must_use]
    pub fn bone_frames(&self, frame: usize) -> Vec<BoneFrame> {
        let Some((_, turns)) = self.frames.get(frame) else { return Vec::new() };
        let back = self.upright.inverse();
        let all = self.bones.iter().zip(turns).zip(self.points_m(frame));
        let one =
            |((bone, turn), (name, at_m)): ((&super::StoodBone, &DQuat), (&'static str, DVec3))| {
                Some(BoneFrame { name, at_m, turn: (back * *turn * bone.axes?).normalize() })
            };
        all.filter_map(one).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn y_aims_and_x_is_at_a_right_angle_to_the_third_point() {
        let turn =
            by_rule("L_Upper_Leg", -DVec3::Z, Some(DVec3::new(0.02, 0.1, -0.2))).expect("a frame");
        assert!((turn * DVec3::Y).distance(-DVec3::Z) < 1e-12);
        assert!((turn * DVec3::X).dot(DVec3::new(0.02, 0.1, -0.2)).abs() < 1e-12);
        assert!((turn * DVec3::X).x > 0.9, "forward");
    }

    #[test]
    fn left_and_right_bones_of_one_who_stands_have_x_the_same_way() {
        let mirrored = |way: DVec3| DVec3::new(way.x, -way.y, way.z);
        for (bone, aim, third) in [
            ("Upper_Leg", DVec3::new(0.0, 0.02, -0.4), DVec3::new(0.0, 0.1, -0.2)),
            ("Upper_Arm", DVec3::new(0.0, 0.3, 0.0), DVec3::new(0.0, 0.1, 0.05)),
            ("Foot", DVec3::new(0.15, 0.02, -0.05), DVec3::new(-0.06, 0.0, -0.04)),
            ("Hip", DVec3::new(0.1, 0.05, -0.1), DVec3::new(0.0, -0.1, 0.0)),
        ] {
            let left = by_rule(&format!("L_{bone}"), aim, Some(third)).expect("left") * DVec3::X;
            let right = by_rule(&format!("R_{bone}"), mirrored(aim), Some(mirrored(third)));
            let right = right.expect("right") * DVec3::X;
            assert!(
                mirrored(left).distance(right) < 1e-12 || mirrored(left).distance(-right) < 1e-12
            );
            assert!(left.dot(right) > 0.5, "{bone}: {left} {right}");
        }
    }

    #[test]
    fn the_root_has_z_forwards_and_y_up() {
        let turn = by_rule("Root", DVec3::new(0.15, 0.0, -0.03), None).expect("a frame");
        assert!(
            (turn * DVec3::Z).x > 0.9 && (turn * DVec3::Y).z > 0.9 && (turn * DVec3::X).y > 0.99
        );
        assert!(by_rule("Neck", DVec3::Z, Some(DVec3::Z)).is_none());
    }
}
