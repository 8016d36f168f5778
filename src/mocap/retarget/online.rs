//! Retargeting pose by pose, as they come.
//!
//! The same fit as for whole clips, but blind to what comes next: each pose is fitted from the fit
//! of the one before. Where a clip would choose the cheapest way from fit to fit afterwards, here a
//! rival fit is kept beside the one in use, and takes over once it has been the better one by as
//! much as the change costs: a robot that follows is not to swing back and forth.

use super::group::{Group, Target};
use super::solve::{CHANGE_RAD_S, COLD_STEPS, GOOD_COST, SAME_RAD, WARM_STEPS};
use super::solve::{descend, fixed_starts};
use super::{RobotModel, SegmentLink, Settings};
use crate::body::SegmentPose;
use crate::body::segment_name;
use crate::error::Error;
use crate::motion::saturate;
use nalgebra::DVector;

/// Turns poses into joint angles of a robot, one after the other.
pub struct Online<'a> {
    model: &'a RobotModel,
    solvers: Vec<Solver<'a>>,
    angles_rad: Vec<f64>,
    margin_rad: f64,
    notes: Vec<String>,
}

/// A group of joints and its fits.
struct Solver<'a> {
    group: Group<'a>,
    starts: Vec<DVector<f64>>,
    /// Which start is tried next.
    turn: usize,
    fit: Option<(DVector<f64>, f64)>,
    rival: Option<Rival>,
}

/// Another way to fit the same pose.
struct Rival {
    angles: DVector<f64>,
    cost: f64,
    /// Cost it would have saved so far, times time, s.
    saved_s: f64,
}

impl<'a> Online<'a> {
    /// For a robot that stands at `initial_rad`, and poses that have the segments that are
    /// `tracked`, by index. Joints of links whose segment is not tracked stay where they are.
    ///
    /// # Errors
    /// If the model contradicts itself, or none of its links' segments is tracked.
    pub fn new(
        model: &'a RobotModel,
        tracked: &[bool; 13],
        initial_rad: &[f64],
        settings: &Settings,
    ) -> Result<Self, Error> {
        model.check(initial_rad)?;
        let is_tracked = |link: &&SegmentLink| tracked[link.segment.index()];
        let used: Vec<SegmentLink> = model.links.iter().filter(is_tracked).copied().collect();
        if used.is_empty() {
            return Err(Error::new("no segment that the robot plays is known")
                .remedy("wear a sensor on an arm or a leg"));
        }
        let unused = model.links.iter().filter(|link| !tracked[link.segment.index()]);
        let stays = |link: &SegmentLink| {
            format!("no {}: the robot's stays where it is", segment_name(link.segment))
        };
        let solver = |group: Group<'a>| Solver {
            starts: fixed_starts(&group, initial_rad),
            group,
            turn: 0,
            fit: None,
            rival: None,
        };
        Ok(Self {
            notes: unused.map(stays).collect(),
            solvers: Group::all(model, &used).into_iter().map(solver).collect(),
            angles_rad: initial_rad.to_vec(),
            margin_rad: settings.margin_rad,
            model,
        })
    }

    /// What is not played, a line each.
    #[must_use]
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// Angles, by joint, rad, for the pose `dt_s` after the one before: inside the limits, in the
    /// robot's order.
    pub fn pose(&mut self, pose: &SegmentPose, dt_s: f64) -> &[f64] {
        for solver in &mut self.solvers {
            let Some(fit) = solver.next(pose, dt_s) else { continue };
            for (joint, angle) in solver.group.joints().iter().zip(fit.iter()) {
                let of = &self.model.joints[*joint];
                self.angles_rad[*joint] =
                    saturate(*angle, of.lower_rad, of.upper_rad, self.margin_rad);
            }
        }
        &self.angles_rad
    }
}

impl Solver<'_> {
    fn next(&mut self, pose: &SegmentPose, dt_s: f64) -> Option<DVector<f64>> {
        let targets = self.group.targets(pose);
        match self.fit.take() {
            None => {
                let cold = |start: &DVector<f64>| {
                    descend(&self.group, &targets, start.clone(), None, COLD_STEPS)
                };
                self.fit = self.starts.iter().map(cold).min_by(|a, b| a.1.total_cmp(&b.1));
            }
            Some((before, _)) => {
                let warm =
                    descend(&self.group, &targets, before.clone(), Some(&before), WARM_STEPS);
                self.fit = Some(self.challenged(&targets, warm, dt_s));
            }
        }
        self.fit.as_ref().map(|(angles, _)| angles.clone())
    }

    /// The fit in use or, if that has been the worse one for long enough, its rival.
    fn challenged(
        &mut self,
        targets: &[Target],
        fit: (DVector<f64>, f64),
        dt_s: f64,
    ) -> (DVector<f64>, f64) {
        let rival = self.rival.take().map(|rival| {
            let from = &rival.angles;
            let (angles, cost) =
                descend(&self.group, targets, from.clone(), Some(from), WARM_STEPS);
            Rival { angles, cost, ..rival }
        });
        let mut rival = rival.filter(|rival| (&rival.angles - &fit.0).amax() > SAME_RAD);
        if fit.1 > GOOD_COST && !self.starts.is_empty() {
            // One start per pose: which is soon all of them, and hardly any time.
            let start = self.starts[self.turn % self.starts.len()].clone();
            self.turn += 1;
            let (angles, cost) = descend(&self.group, targets, start, None, COLD_STEPS);
            let is_other = (&angles - &fit.0).amax() > SAME_RAD;
            if is_other && cost < rival.as_ref().map_or(fit.1, |rival| rival.cost - GOOD_COST) {
                rival = Some(Rival { angles, cost, saved_s: 0.0 });
            }
        }
        let Some(mut rival) = rival else { return fit };
        rival.saved_s = (rival.saved_s + (fit.1 - rival.cost) * dt_s).max(0.0);
        // As over whole clips: a change costs the time it takes.
        if rival.saved_s > (&rival.angles - &fit.0).amax() / CHANGE_RAD_S {
            return (rival.angles, rival.cost);
        }
        if rival.saved_s > 0.0 {
            self.rival = Some(rival);
        }
        fit
    }
}
