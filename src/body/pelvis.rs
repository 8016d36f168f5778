//! How the pelvis is turned in the world, in the words of gait analysis.

use glam::{DQuat, EulerRot};

/// The turning of the pelvis: about the vertical by its rotation, then about the X axis as turned by
/// its obliquity, then about the Y axis as turned by its tilt. So each keeps the meaning it has for
/// who looks on (Baker, "Pelvic angles: a mathematically rigorous definition which is consistent
/// with a conventional clinical understanding of the terms", Gait & Posture 13, 2001).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PelvisAngles {
    /// The front turned to the left of +X, rad.
    pub rotation_rad: f64,
    /// The left side up, rad.
    pub obliquity_rad: f64,
    /// The upper end leaning forward, rad.
    pub tilt_rad: f64,
}

impl PelvisAngles {
    /// Their names, in the order of [`Self::to_array`].
    pub const NAMES: [&str; 3] = ["pelvis_rotation", "pelvis_obliquity", "pelvis_tilt"];

    /// The angles of a pelvis with this orientation in the world; rotation and tilt are in
    /// [-pi, pi].
    #[must_use]
    pub fn of(orientation: DQuat) -> Self {
        let (rotation_rad, obliquity_rad, tilt_rad) = orientation.to_euler(EulerRot::ZXY);
        Self { rotation_rad, obliquity_rad, tilt_rad }
    }

    /// Rotation, obliquity, tilt, rad.
    #[must_use]
    pub const fn to_array(self) -> [f64; 3] {
        [self.rotation_rad, self.obliquity_rad, self.tilt_rad]
    }

    /// The orientation in the world.
    #[must_use]
    pub fn to_orientation(self) -> DQuat {
        DQuat::from_rotation_z(self.rotation_rad)
            * DQuat::from_rotation_x(self.obliquity_rad)
            * DQuat::from_rotation_y(self.tilt_rad)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn angles_and_orientation_say_the_same(
            (rotation_rad, obliquity_rad, tilt_rad) in (-3.1..3.1, -1.5..1.5, -3.1..3.1),
        ) {
            let angles = PelvisAngles { rotation_rad, obliquity_rad, tilt_rad };
            let found = PelvisAngles::of(angles.to_orientation());
            for (a, b) in found.to_array().into_iter().zip(angles.to_array()) {
                prop_assert!((a - b).abs() < 1e-6, "{found:?} {angles:?}");
            }
        }
    }

    #[test]
    fn signs_are_those_of_the_words() {
        let turned = |rotation_rad, obliquity_rad, tilt_rad| {
            PelvisAngles { rotation_rad, obliquity_rad, tilt_rad }.to_orientation()
        };
        assert!((turned(0.3, 0.0, 0.0) * DVec3::X).y > 0.2, "the front goes to the left");
        assert!((turned(0.0, 0.3, 0.0) * DVec3::Y).z > 0.2, "the left side goes up");
        assert!((turned(0.0, 0.0, 0.3) * DVec3::Z).x > 0.2, "the upper end goes forward");
    }
}
