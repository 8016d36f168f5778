//! A step and a reach of which the second begins before the first is over.
//!
//! Legs and the bends of the trunk are the step's, which keep its weight over its feet; the right arm, the head and the turn
//! of the trunk are the reach's. The hand so goes ahead of the body wherever that goes, to no place of the room.

use glam::DVec3;

use super::reach::{self, STAYS_S};
use super::step::{LIFT_S, SHIFT_S, SWING_S, Steps};
use super::{Made, Mark};
use crate::action::at_once::{at_once, moves};
use crate::body::Dof;
use crate::error::Error;

/// How long the step is, m.
const STEP_M: f64 = 0.15;
/// Where the hand would go of a body that stands: ahead, left, up, parts of the stature.
const REACHES: DVec3 = DVec3::new(0.27, -0.12, 0.72);

/// Which comes first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum First {
    /// The hand begins while the first foot swings.
    Step,
    /// The first foot leaves the floor while the hand is on its way back.
    Reach,
}

pub(super) fn made(steps: &Steps, first: First, direction_rad: f64) -> Result<Made, Error> {
    let body = &steps.poser().body;
    let step = steps.made(&[(direction_rad, STEP_M)])?;
    let reach = reach::made(body, REACHES * body.stature_m(), None)?;
    let there_s = reach.marks.first().map_or(0.0, |mark| mark.at_s);
    let (step_s, reach_s) = match first {
        First::Step => (0.0, SHIFT_S + LIFT_S + SWING_S / 2.0),
        First::Reach => {
            let back_s = f64::midpoint(there_s + STAYS_S / 2.0, reach.motion.duration_s());
            ((back_s - SHIFT_S).max(0.0), 0.0)
        }
    };
    let bends = |dof: Dof| matches!(dof, Dof::TorsoFlexion | Dof::TorsoLateralBend);
    let motion = at_once((&step.motion, step_s), (&reach.motion, reach_s), |dof| {
        moves(&reach.motion, dof) && !(bends(dof) && moves(&step.motion, dof))
    })?;
    let later = |mark: Mark| Mark { at_s: mark.at_s + step_s, ..mark };
    let mut parts_s = vec![
        (step_s, step_s + step.motion.duration_s()),
        (reach_s, reach_s + reach.motion.duration_s()),
    ];
    if first == First::Reach {
        parts_s.reverse();
    }
    Ok(Made { parts_s, ..Made::of(motion, step.marks.into_iter().map(later).collect()) })
}
