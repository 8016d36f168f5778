//! A stretch in which both feet stand, so timed that neither slides.
//!
//! Two feet on the floor hold one another: of ten degrees of freedom of the legs most follow from the others. Between two
//! poses in which both stand, actionlets do not quite keep to that. So when each begins, ends and is fastest is moved,
//! as little as goes, until soles stay where they stand: damped least squares on what soles and root really do.

use nalgebra::{DMatrix, DVector};

use super::course::{Stretch, Timing};
use super::damped;
use crate::action::feet::{Feet, FootingBounds};
use crate::action::{Motion, parametric::course::Course};
use crate::actionlet::shape::PEAK_AT;
use crate::body::contact::worst_slide_m;
use crate::body::{Dof, Proportions};
use crate::error::Error;

/// Looks at the feet.
const LOOKS_HZ: f64 = 100.0;
/// It rests before and after, s.
const RESTS_S: f64 = 0.1;
/// Soles are held as well as this, m, root as well as this, m/s^2.
const HOLDS_M: f64 = 0.000_7;
const ROOT_HOLDS_M_S2: f64 = 6.0;
/// Moved as a matter of course: parts of the stretch.
const USUAL: f64 = 0.15;
const NUDGE: f64 = 0.02;
const STEPS: usize = 25;
/// A step that gains less, as a part, is the last.
const ENOUGH: f64 = 0.003;
const DAMPINGS: [f64; 6] = [0.01, 0.1, 1.0, 10.0, 100.0, 1e4];
/// Where soles slide further than this they matter more, so many times, in turn.
const GOOD_M: f64 = 0.003;
const MATTERS: [f64; 4] = [1.0, 3.0, 10.0, 30.0];
const JUDGED_HZ: f64 = FootingBounds::JUDGED_HZ;
/// An actionlet lasts at least so long, a part of the stretch.
const LASTS: f64 = 0.25;

/// What is moved: by degree of freedom of a leg that moves, begin, end, and peak.
fn moving(stretch: &Stretch) -> Vec<Dof> {
    let moves = |dof: &Dof| dof.is_of_leg() && stretch.from[*dof] != stretch.to[*dof];
    Dof::ALL.into_iter().filter(moves).collect()
}

fn timed(stretch: &Stretch, dofs: &[Dof], x: &DVector<f64>) -> Stretch {
    let mut moved = stretch.clone();
    for (dof, x) in dofs.iter().zip(x.as_slice().chunks(3)) {
        let given = stretch.timings[dof.index()];
        let begins = (given.begins + x[0] * USUAL).clamp(0.0, 1.0 - LASTS);
        let ends = (given.ends + x[1] * USUAL).clamp(begins + LASTS, 1.0);
        let peak_at = (given.peak_at + x[2] * USUAL).clamp(*PEAK_AT.start(), *PEAK_AT.end());
        moved.timings[dof.index()] = Timing { begins, ends, peak_at };
    }
    moved
}

fn alone(stretch: &Stretch) -> Result<Motion, Error> {
    let mut course = Course::default();
    course.then(Stretch::even(stretch.from, stretch.from, RESTS_S));
    course.then(stretch.clone());
    course.then(Stretch::even(stretch.to, stretch.to, RESTS_S));
    course.motion()
}

/// What soles that are to stand (heels and toes, left first) and the root do.
fn off(
    body: &Proportions,
    stretch: &Stretch,
    (stands, matters): ([bool; 4], f64),
    x: &DVector<f64>,
) -> Result<DVector<f64>, Error> {
    let motion = alone(stretch)?;
    let feet = Feet::of(body, &motion.poses(body, LOOKS_HZ)?);
    let part = (1.0 / (LOOKS_HZ * 0.05)).sqrt();
    let mut off: Vec<f64> = x.iter().copied().collect();
    let Some(first) = feet.soles_m.first().copied() else { return Ok(DVector::from_vec(off)) };
    for soles_m in &feet.soles_m {
        for sole in (0..4).filter(|sole| stands[*sole]) {
            let left_m = soles_m[sole] - first[sole];
            off.extend((left_m * (matters * part / HOLDS_M)).to_array());
        }
    }
    for bend_m in feet.bends_m() {
        let over = (bend_m.length() * LOOKS_HZ * LOOKS_HZ - 6.0).max(0.0);
        off.push(over * part / ROOT_HOLDS_M_S2);
    }
    Ok(DVector::from_vec(off))
}

/// The stretch in another time, in which soles that stand stay where they are.
///
/// # Errors
/// As of chains of actionlets.
pub(super) fn settled(
    body: &Proportions,
    stretch: &Stretch,
    stands: [bool; 4],
) -> Result<Stretch, Error> {
    let dofs = moving(stretch);
    let mut x = DVector::zeros(3 * dofs.len());
    for matters in MATTERS {
        x = regressed(body, stretch, &dofs, (stands, matters), x)?;
        let feet = Feet::of(body, &alone(&timed(stretch, &dofs, &x))?.poses(body, JUDGED_HZ)?);
        if worst_slide_m(&feet.soles_m) < GOOD_M {
            break;
        }
    }
    Ok(timed(stretch, &dofs, &x))
}

fn regressed(
    body: &Proportions,
    stretch: &Stretch,
    dofs: &[Dof],
    stands: ([bool; 4], f64),
    mut x: DVector<f64>,
) -> Result<DVector<f64>, Error> {
    let at = |x: &DVector<f64>| timed(stretch, dofs, x);
    let mut now = off(body, &at(&x), stands, &x)?;
    for _ in 0..STEPS {
        let mut answers = DMatrix::zeros(now.len(), x.len());
        for index in 0..x.len() {
            let (mut more, mut less) = (x.clone(), x.clone());
            more[index] += NUDGE;
            less[index] -= NUDGE;
            let slope =
                off(body, &at(&more), stands, &more)? - off(body, &at(&less), stands, &less)?;
            answers.set_column(index, &(slope / (2.0 * NUDGE)));
        }
        let then = |next: DVector<f64>| {
            let off = off(body, &at(&next), stands, &next)?;
            Ok::<_, Error>(Some((next, off)))
        };
        let Some(step) = damped::step(&x, (&now, &answers), &DAMPINGS, then)? else { break };
        (x, now) = (step.at, step.off);
        if step.gained < ENOUGH {
            break;
        }
    }
    Ok(x)
}
