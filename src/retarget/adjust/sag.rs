//! Goals beyond poses: a servo that carries gives way, so its goal is as far beyond where it is to be.
//!
//! A robot that stands still weighs on each joint with its weight times how far its centre of mass would rise over the
//! sole that carries it, were the joint turned (virtual work). A servo holds that as a spring does, by its file's stiffness.

use super::Solver;
use crate::retarget::base::StandingSole;
use crate::rigid::Placement;
use crate::rigid::ground::GRAVITY_M_S2;
use glam::DVec3;

impl Solver<'_> {
    /// How the centre of mass moves with each joint of the robot, m/rad, in the axes of its base.
    pub(super) fn centre_slopes_m(&self, placed: &[Placement]) -> Vec<DVec3> {
        let tree = &self.of.body.tree;
        let (links, mass_kg) = (tree.links(), tree.mass_kg());
        let mut slopes_m = vec![DVec3::ZERO; self.of.free.len()];
        for (link, own) in links.iter().enumerate().filter(|(_, own)| own.mass.mass_kg > 0.0) {
            let at_m = placed[link].point(own.mass.centre_m);
            for mover in &self.movers[link] {
                let joint = placed[mover.link];
                let axis = joint.turn * links[mover.link].axis;
                let share = mover.ratio * own.mass.mass_kg / mass_kg;
                slopes_m[mover.joint] += axis.cross(at_m - joint.at_m) * share;
            }
        }
        slopes_m
    }

    /// How far beyond each joint its goal is while both soles carry such shares of the weight, rad; nothing of a robot whose
    /// file does not say how its servos give way.
    pub(super) fn beyond_rad(
        &self,
        placed: &[Placement],
        soles: [&StandingSole; 2],
        shares: [f64; 2],
    ) -> Option<Vec<f64>> {
        let Self { of, movers, .. } = self;
        let tree = &of.body.tree;
        let drives = of.body.drives.as_ref()?;
        let centre_m = tree.centre_of_mass_m(placed);
        let slopes_m = self.centre_slopes_m(placed);
        let mut rises_m = vec![0.0; slopes_m.len()];
        for (sole, share) in soles.into_iter().zip(shares) {
            let up = placed[sole.link].turn * sole.normal;
            for (rises_m, slope_m) in rises_m.iter_mut().zip(&slopes_m) {
                *rises_m += share * up.dot(*slope_m);
            }
            // The sole lies where it lies: a joint that carries it turns all the rest the other way.
            for mover in &movers[sole.link] {
                let joint = placed[mover.link];
                let axis = joint.turn * tree.links()[mover.link].axis;
                let turned_m = axis.cross(centre_m - joint.at_m);
                rises_m[mover.joint] -= share * mover.ratio * up.dot(turned_m);
            }
        }
        let weight_n = tree.mass_kg() * GRAVITY_M_S2;
        let each = rises_m.into_iter().zip(drives);
        Some(each.map(|(rises_m, of)| weight_n * rises_m / of.stiffness_nm_rad).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::op3;
    use super::*;
    use crate::rigid::tree::TreeMotion;

    /// A step for differences, rad.
    const NUDGE_RAD: f64 = 1e-5;

    /// On its left leg, hip and knee bent, leaning.
    fn pose(op3: &super::super::tests::Op3) -> Vec<f64> {
        let mut pose = op3.start_rad.clone();
        for (name, rad) in
            [("l_hip_roll", -0.2), ("l_ank_roll", 0.15), ("r_knee", 0.4), ("l_knee", 0.3)]
        {
            pose[op3.joint(name)] += rad;
        }
        pose
    }

    #[test]
    fn goals_are_beyond_by_how_the_weight_would_rise_over_the_soles_that_carry_it() {
        let op3 = op3();
        let free = vec![true; op3.start_rad.len()];
        let solver = Solver::new(op3.adjustable(&free));
        let soles = solver.feet().expect("two feet");
        let (body, pose) = (solver.of.body, pose(&op3));
        let drives = body.drives.as_ref().expect("servos");
        let heights_m = |pose: &[f64]| {
            let placed = solver.place(pose);
            let centre_m = body.tree.centre_of_mass_m(&placed);
            soles.map(|sole| sole.normal.dot(placed[sole.link].inverse().point(centre_m)))
        };
        for shares in [[1.0, 0.0], [0.0, 1.0], [0.3, 0.7]] {
            let beyond_rad =
                solver.beyond_rad(&solver.place(&pose), soles, shares).expect("servos");
            for (joint, beyond_rad) in beyond_rad.iter().enumerate() {
                let [more, less] = [NUDGE_RAD, -NUDGE_RAD].map(|nudge_rad| {
                    let mut nudged = pose.clone();
                    nudged[joint] += nudge_rad;
                    let [left_m, right_m] = heights_m(&nudged);
                    shares[0] * left_m + shares[1] * right_m
                });
                let rises_m = (more - less) / (2.0 * NUDGE_RAD);
                let torque_nm = body.tree.mass_kg() * GRAVITY_M_S2 * rises_m;
                let off_rad = beyond_rad - torque_nm / drives[joint].stiffness_nm_rad;
                assert!(off_rad.abs() < 1e-7, "{joint}: {off_rad}");
            }
        }
    }

    #[test]
    fn what_carries_nothing_but_itself_is_held_against_what_inverse_dynamics_say() {
        let op3 = op3();
        let free = vec![true; op3.start_rad.len()];
        let solver = Solver::new(op3.adjustable(&free));
        let soles = solver.feet().expect("two feet");
        let (body, pose) = (solver.of.body, pose(&op3));
        let placed = solver.place(&pose);
        let beyond_rad = solver.beyond_rad(&placed, soles, [1.0, 0.0]).expect("servos");
        let up = placed[soles[0].link].turn * soles[0].normal;
        let still = TreeMotion::at_rest(Placement::IDENTITY, body.angles(&pose));
        let efforts = body.tree.inverse_dynamics(&still, up * -GRAVITY_M_S2);
        let drives = body.drives.as_ref().expect("servos");
        let mut most_rad = 0.0_f64;
        for name in [
            "l_sho_pitch",
            "r_sho_roll",
            "l_el",
            "head_tilt",
            "r_hip_roll",
            "r_hip_pitch",
            "r_knee",
        ] {
            let joint = op3.joint(name);
            let own_rad = efforts.joints[joint] / drives[joint].stiffness_nm_rad;
            assert!((beyond_rad[joint] - own_rad).abs() < 1e-9, "{name}: {own_rad}");
            most_rad = most_rad.max(own_rad.abs());
        }
        assert!(most_rad > 0.01, "{most_rad}");
    }
}
