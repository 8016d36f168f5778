//! What a joint says about the headings of its two segments.

use crate::units::wrap_rad;
use glam::{DQuat, DVec2, DVec3};

/// How a joint can turn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Freedom {
    /// About Y, which both segments share.
    Flexion,
    /// About Y of the segment above and the long axis, Z, of the one below, which are at right
    /// angles whatever the joint does.
    FlexionAndTwist,
}

/// Least horizontal part of the axes looked at: of steep ones the heading is lost in noise.
const LEAST_LEVEL: f64 = 0.5;

/// By how much the heading of `below` must be turned for the joint to be possible, rad, and how
/// well the pose tells, 0 to 1. `None` if it does not.
///
/// One axis: the projections of the common axis on the ground must agree. Two axes: turning the
/// lower one about the vertical until it is at right angles to the upper one; of the two ways the
/// nearer. (D. Laidig, D. Lehmann, M.-A. Begin, T. Seel, "Magnetometer-free realtime inertial
/// motion tracking by exploitation of kinematic constraints in 2-DOF joints", EMBC 2019.)
pub fn heading_error_rad(above: DQuat, below: DQuat, freedom: Freedom) -> Option<(f64, f64)> {
    let upper = above * DVec3::Y;
    let lower = below * if freedom == Freedom::Flexion { DVec3::Y } else { DVec3::Z };
    let (flat_upper, flat_lower) = (flat(upper), flat(lower));
    let level = flat_upper.length() * flat_lower.length();
    if !(level > LEAST_LEVEL) {
        return None;
    }
    let between = heading(flat_upper) - heading(flat_lower);
    let off_rad = match freedom {
        Freedom::Flexion => wrap_rad(between),
        Freedom::FlexionAndTwist => {
            let cosine = -upper.z * lower.z / level;
            if !(cosine.abs() < 1.0) {
                return None;
            }
            let (one, other) =
                (wrap_rad(between + cosine.acos()), wrap_rad(between - cosine.acos()));
            if one.abs() < other.abs() { one } else { other }
        }
    };
    Some((off_rad, level))
}

fn flat(axis: DVec3) -> DVec2 {
    DVec2::new(axis.x, axis.y)
}

fn heading(flat: DVec2) -> f64 {
    flat.y.atan2(flat.x)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_heading_that_is_off_is_seen_whatever_the_joint_does(
            lean in -0.5..0.5_f64, faces in -3.0..3.0_f64, flexion in 0.2..2.0_f64,
            twist in -1.0..1.0_f64, off in -0.4..0.4_f64,
        ) {
            let above = DQuat::from_rotation_z(faces) * DQuat::from_rotation_y(lean);
            let hinge = above * DQuat::from_rotation_y(-flexion);
            let turned = DQuat::from_rotation_z(off) * hinge;
            let (seen, _) = heading_error_rad(above, turned, Freedom::Flexion).expect("level");
            prop_assert!((seen + off).abs() < 1e-9);
            let twisted = DQuat::from_rotation_z(off) * hinge * DQuat::from_rotation_z(twist);
            if let Some((seen, weight)) =
                heading_error_rad(above, twisted, Freedom::FlexionAndTwist)
            {
                prop_assert!((seen + off).abs() < 1e-9, "{seen} {off}");
                prop_assert!(weight > LEAST_LEVEL && weight <= 1.0);
            }
        }
    }

    #[test]
    fn a_hanging_arm_and_a_leg_on_its_side_say_nothing() {
        let hanging = DQuat::from_rotation_y(-0.1);
        assert_eq!(heading_error_rad(DQuat::IDENTITY, hanging, Freedom::FlexionAndTwist), None);
        let aside = DQuat::from_rotation_x(1.5);
        assert_eq!(heading_error_rad(aside, aside, Freedom::Flexion), None);
    }
}
