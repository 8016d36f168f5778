//! Mass, where it lies, and how much of it moves.

use glam::{DMat3, DQuat, DVec3};
use nalgebra::Matrix3;

/// The mass of a rigid body in its own frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mass {
    /// kg.
    pub mass_kg: f64,
    /// Where its centre is, m.
    pub centre_m: DVec3,
    /// Moments and products of inertia about the centre, kg m^2.
    pub inertia_kg_m2: DMat3,
}

impl Mass {
    /// Nothing.
    pub const NONE: Self = Self { mass_kg: 0.0, centre_m: DVec3::ZERO, inertia_kg_m2: DMat3::ZERO };

    /// A body whose radii of gyration about the axes of its frame, through its centre, are given, m.
    #[must_use]
    pub fn of_radii(mass_kg: f64, centre_m: DVec3, radii_m: DVec3) -> Self {
        let inertia_kg_m2 = DMat3::from_diagonal(radii_m * radii_m * mass_kg);
        Self { mass_kg, centre_m, inertia_kg_m2 }
    }

    /// Both as one body, in the same axes (parallel axis theorem).
    #[must_use]
    pub fn with(&self, other: &Self) -> Self {
        let mass_kg = self.mass_kg + other.mass_kg;
        if !(mass_kg > 0.0) {
            return Self::NONE;
        }
        let centre_m = (self.centre_m * self.mass_kg + other.centre_m * other.mass_kg) / mass_kg;
        let about = |part: &Self| {
            part.inertia_kg_m2 + point_inertia(part.mass_kg, part.centre_m - centre_m)
        };
        Self { mass_kg, centre_m, inertia_kg_m2: about(self) + about(other) }
    }

    /// Least, middle and largest moment of inertia, kg m².
    #[must_use]
    pub fn moments_kg_m2(&self) -> [f64; 3] {
        let columns = self.inertia_kg_m2.to_cols_array();
        let mut moments: [f64; 3] =
            Matrix3::from_column_slice(&columns).symmetric_eigenvalues().into();
        moments.sort_by(f64::total_cmp);
        moments
    }
}

/// Inertia of a point of mass `mass_kg` at `away_m` from where it is taken about, kg m^2.
fn point_inertia(mass_kg: f64, away_m: DVec3) -> DMat3 {
    let outer = DMat3::from_cols(away_m * away_m.x, away_m * away_m.y, away_m * away_m.z);
    (DMat3::from_diagonal(DVec3::splat(away_m.length_squared())) - outer) * mass_kg
}

/// A body that lies somewhere: its mass, where the origin of its frame is, m, and how it is turned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Posed {
    /// What it is made of.
    pub mass: Mass,
    /// Origin of its frame in the world, m.
    pub origin_m: DVec3,
    /// Its frame in the world.
    pub turned: DQuat,
}

impl Posed {
    /// Its centre in the world, m.
    #[must_use]
    pub fn centre_m(&self) -> DVec3 {
        self.origin_m + self.turned * self.mass.centre_m
    }

    fn inertia_kg_m2(&self) -> DMat3 {
        let turned = DMat3::from_quat(self.turned);
        turned * self.mass.inertia_kg_m2 * turned.transpose()
    }
}

/// The common centre of mass of some bodies, m; the origin if they weigh nothing.
#[must_use]
pub fn centre_m(bodies: &[Posed]) -> DVec3 {
    let mass_kg: f64 = bodies.iter().map(|body| body.mass.mass_kg).sum();
    if !(mass_kg > 0.0) {
        return DVec3::ZERO;
    }
    let moment: DVec3 = bodies.iter().map(|body| body.centre_m() * body.mass.mass_kg).sum();
    moment / mass_kg
}

/// Momentum of bodies that go from one place to another.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Momentum {
    /// kg m/s.
    pub linear_kg_m_s: DVec3,
    /// About the common centre of mass, kg m^2/s.
    pub angular_kg_m2_s: DVec3,
}

impl Momentum {
    /// Of the same bodies at two instants, `step_s` apart: what they have halfway between.
    #[must_use]
    pub fn between(before: &[Posed], after: &[Posed], step_s: f64) -> Self {
        let (from_m, to_m) = (centre_m(before), centre_m(after));
        let centre_m_s = (to_m - from_m) / step_s;
        let mut momentum = Self::default();
        for (before, after) in before.iter().zip(after) {
            let mass_kg = after.mass.mass_kg;
            let (from, to) = (before.centre_m() - from_m, after.centre_m() - to_m);
            let velocity_m_s = (to - from) / step_s;
            momentum.linear_kg_m_s += (velocity_m_s + centre_m_s) * mass_kg;
            let turned = after.turned * before.turned.inverse();
            let rate_rad_s = turned.to_scaled_axis() / step_s;
            let inertia = (before.inertia_kg_m2() + after.inertia_kg_m2()) * 0.5;
            momentum.angular_kg_m2_s +=
                ((from + to) * 0.5).cross(velocity_m_s) * mass_kg + inertia * rate_rad_s;
        }
        momentum
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A rod of length l about its end: m l^2 / 3.
    #[test]
    fn two_halves_of_a_rod_are_the_rod() {
        let half = |x: f64| {
            let radius = 0.5 / 12.0f64.sqrt();
            Mass::of_radii(1.0, DVec3::new(x, 0.0, 0.0), DVec3::new(0.0, radius, radius))
        };
        let rod = half(0.25).with(&half(0.75));
        assert!((rod.mass_kg - 2.0).abs() < 1e-12);
        assert!((rod.centre_m - DVec3::new(0.5, 0.0, 0.0)).length() < 1e-12);
        let expected = 2.0 / 12.0;
        assert!((rod.inertia_kg_m2.col(1).y - expected).abs() < 1e-12);
        assert!((rod.inertia_kg_m2.col(2).z - expected).abs() < 1e-12);
        assert!(rod.inertia_kg_m2.col(0).x.abs() < 1e-12);
    }

    #[test]
    fn a_body_that_turns_about_a_far_point_has_the_momentum_of_a_textbook() {
        // 2 kg, 0.5 m from where it turns at 3 rad/s, turning with it: about its own centre I w.
        let mass = Mass::of_radii(2.0, DVec3::new(0.5, 0.0, 0.0), DVec3::splat(0.1));
        let step_s = 1e-4;
        let at = |angle: f64| Posed {
            mass,
            origin_m: DVec3::ZERO,
            turned: DQuat::from_rotation_z(angle),
        };
        let got = Momentum::between(&[at(0.0)], &[at(3.0 * step_s)], step_s);
        assert!((got.linear_kg_m_s - DVec3::new(0.0, 3.0, 0.0)).length() < 1e-3);
        assert!((got.angular_kg_m2_s.z - 2.0 * 0.01 * 3.0).abs() < 1e-6);
        // With a twin on the other side the common centre rests, and 2 m r^2 w is added.
        let twin = |angle: f64| at(angle + core::f64::consts::PI);
        let both = Momentum::between(
            &[at(0.0), twin(0.0)],
            &[at(3.0 * step_s), twin(3.0 * step_s)],
            step_s,
        );
        assert!(both.linear_kg_m_s.length() < 1e-9);
        let expected = 2.0 * (2.0 * 0.01 + 2.0 * 0.25) * 3.0;
        assert!((both.angular_kg_m2_s.z - expected).abs() < 1e-6, "{both:?}");
    }

    #[test]
    fn nothing_has_no_centre() {
        assert_eq!(centre_m(&[]), DVec3::ZERO);
        assert_eq!(Mass::NONE.with(&Mass::NONE), Mass::NONE);
    }
}
