//! An action as a body of other measures does it: its feet hold as they do on the body it was made for.
//!
//! Longer or shorter legs with the same angles put feet down elsewhere: they slide, or swing so low that they
//! scuff the floor. So the seams of the legs (their angles, times and peaks) are moved, as little as goes, until
//! soles stand where they stand, keep clear of the floor where they swing, and the root is accelerated as it
//! was: a regression as for variations ([`crate::action::foothold`]), taken in steps from the one body to the other,
//! each from how soles answer there. What is in the air for a while takes its time as things that fall do: with the
//! root of the length of the legs.

use nalgebra::{Cholesky, DMatrix, DVector};

use crate::action::feet::{Feet, FootingBounds};
use crate::action::mutate::Seams;
use crate::action::{Action, Spread};
use crate::body::Proportions;
use crate::body::contact::ON_FLOOR_M;
use crate::error::Error;

use core::ops::Range;
use glam::DVec3;

/// Feet are looked at about so often.
const LOOKS_HZ: f64 = 125.0;
/// Rounds of a cyclic action that are looked at: one led in, one between others, one led out.
const ROUNDS: u32 = 3;
/// A seam is moved by this part of its standard deviation to tell how soles answer.
const NUDGE: f64 = 0.2;
/// As bad as one another: a sole so far from where it is to be ...
const HOLDS_M: f64 = 0.000_7;
/// ... a root accelerated by so much otherwise, m/s^2, both on the average over this time ...
const ROOT_HOLDS_M_S2: f64 = 4.0;
const HOLDS_FOR_S: f64 = 0.05;
/// ... feet that end so far from where they would, m ...
const AWAY_M: f64 = 0.003;
/// ... and a seam moved by so many of its standard deviations among variations.
const MOVED: f64 = 8.0;
/// Feet that end nearer to where they began have come back, m.
const CAME_BACK_M: f64 = 0.02;
/// A sole that swings is as high as on the other body, or at least so high, m: that it is not on the floor.
const CLEAR_M: f64 = 0.009;
/// Of what soles slide on the body it was made for so much is left to them.
const SLIDES_LEFT: f64 = 0.7;
/// Bodies differ by so much from step to step.
const STEP: f64 = 0.05;
/// Regressions at the last step, until feet hold.
const TRIES: usize = 10;
/// They hold if this part of what is allowed is not used up.
const GOOD: f64 = 0.97;
/// What is added to how well seams are known, in turn, until a regression helps.
const DAMPINGS: [f64; 6] = [0.0, 0.1, 1.0, 10.0, 100.0, 1e3];
/// What misses a bound, or nearly, counts so many times as much in the next regression.
const MATTERS_MORE: f64 = 1.5;
const NEARLY: f64 = 0.85;
/// More seams of legs are not looked at.
const MOST_SEAMS: usize = 400;

/// The stature actions are made for, m.
const MADE_FOR_M: f64 = 1.75;

/// Actions as one body does them: each is fitted to it once.
#[derive(Clone, Debug)]
pub struct Fits {
    body: Proportions,
    done: Vec<(Action, Action)>,
}

impl Fits {
    /// Of a body.
    #[must_use]
    pub const fn of(body: Proportions) -> Self {
        Self { body, done: Vec::new() }
    }

    /// Of the body that actions are made for: they stay as they are.
    ///
    /// # Errors
    /// None.
    pub fn usual() -> Result<Self, Error> {
        Ok(Self::of(made_for()?))
    }

    /// The body.
    #[must_use]
    pub const fn body(&self) -> &Proportions {
        &self.body
    }

    /// The action as this body does it.
    ///
    /// # Errors
    /// If it cannot be performed.
    pub fn fit(&mut self, action: &Action) -> Result<Action, Error> {
        if let Some((_, fitted)) = self.done.iter().find(|(asked, _)| asked == action) {
            return Ok(fitted.clone());
        }
        let fitted = fit(action, &made_for()?, &self.body)?;
        self.done.push((action.clone(), fitted.clone()));
        Ok(fitted)
    }
}

/// The body that actions are made for.
///
/// # Errors
/// None.
pub fn made_for() -> Result<Proportions, Error> {
    Proportions::of_stature(MADE_FOR_M)
}

/// An action whose feet hold on one body, so that they hold on another. One that does not stand on its feet
/// stays as it is, and so does one that holds there already.
///
/// # Errors
/// If it cannot be performed.
pub fn fit(action: &Action, from: &Proportions, to: &Proportions) -> Result<Action, Error> {
    let unlike = from.unlike(to);
    let same = || Ok(action.clone());
    if unlike == 0.0 {
        return same();
    }
    let motion = action.perform_rounds(action.rounds.min(ROUNDS))?;
    let Some(bounds) = FootingBounds::of(&motion, from)? else { return same() };
    if bounds.share(&motion, to)? < GOOD {
        return same();
    }
    let seams = Seams::of(action, &Spread::default());
    let legs: Vec<usize> = (0..seams.seams.len()).filter(|at| seams.seams[*at].is_of_leg).collect();
    if !(1..=MOST_SEAMS).contains(&legs.len()) {
        return same();
    }
    let looks = (motion.duration_s() * LOOKS_HZ).ceil();
    let rate_hz = looks / motion.duration_s();
    let feet = Feet::of(from, &motion.poses(from, rate_hz)?);
    let contacts = feet.contacts();
    let weights = Weights { contacts: vec![1.0; contacts.len()], roots: vec![1.0; looks as usize] };
    let fitting = Fitting { action, from, bounds, seams, legs, looks, feet, contacts };
    fitting.run(to, (unlike / STEP).ceil().max(1.0), weights)
}

struct Fitting<'a> {
    action: &'a Action,
    from: &'a Proportions,
    bounds: FootingBounds,
    seams: Seams,
    /// Which of the seams are of legs.
    legs: Vec<usize>,
    looks: f64,
    /// On the body it was made for.
    feet: Feet,
    contacts: Vec<(usize, Range<usize>)>,
}

/// How much contacts and accelerations matter.
struct Weights {
    contacts: Vec<f64>,
    roots: Vec<f64>,
}

impl Fitting<'_> {
    fn run(&self, to: &Proportions, steps: f64, mut weights: Weights) -> Result<Action, Error> {
        let mut moved = DVector::zeros(self.legs.len());
        for step in 1..steps as usize {
            let body = self.from.towards(to, step as f64 / steps);
            moved = self.regressed(&body, moved, &weights)?;
        }
        // What comes out is never worse than what was asked for.
        let own = self.action.perform_rounds(self.action.rounds.min(ROUNDS))?;
        let mut best = (self.bounds.share(&own, to)?, self.action.clone());
        for _ in 0..TRIES {
            moved = self.regressed(to, moved, &weights)?;
            let action = self.moved(&moved, to);
            let motion = action.perform_rounds(action.rounds.min(ROUNDS))?;
            let share = self.bounds.share(&motion, to)?;
            if share < best.0 {
                best = (share, action);
            }
            if best.0 < GOOD {
                break;
            }
            self.reweigh(&mut weights, &moved, to)?;
        }
        Ok(best.1)
    }

    /// Its seams moved by so many of their standard deviations.
    fn moved(&self, moved: &DVector<f64>, body: &Proportions) -> Action {
        let mut offsets = vec![0.0; self.seams.seams.len()];
        for (seam, moved) in self.legs.iter().zip(moved.iter()) {
            offsets[*seam] = moved * self.seams.seams[*seam].deviation;
        }
        let mut action = self.seams.moved(self.action, &offsets);
        action.duration_s *= self.longer(body);
        action
    }

    fn taller(&self, body: &Proportions) -> f64 {
        body.root_height_m() / self.from.root_height_m()
    }

    /// How much longer it takes.
    fn longer(&self, body: &Proportions) -> f64 {
        if self.feet.fly() { self.taller(body).sqrt() } else { 1.0 }
    }

    fn feet(&self, moved: &DVector<f64>, body: &Proportions) -> Result<Feet, Error> {
        let action = self.moved(moved, body);
        let motion = action.perform_rounds(action.rounds.min(ROUNDS))?;
        Ok(Feet::of(body, &motion.poses(body, self.looks / motion.duration_s())?))
    }

    /// Looks per second on a body.
    fn rate_hz(&self, body: &Proportions) -> f64 {
        let rounds = if self.action.cyclic.is_some() { self.action.rounds.min(ROUNDS) } else { 1 };
        self.looks / (self.action.duration_s * f64::from(rounds) * self.longer(body))
    }

    /// What soles and root do otherwise than they are to, each as a part of what is as bad as the others.
    fn off(&self, feet: &Feet, body: &Proportions, weights: &Weights) -> DVector<f64> {
        let own = &self.feet;
        let last = feet.soles_m.len() - 1;
        let sole_m = |look: usize, sole: usize| feet.soles_m[look.min(last)][sole];
        let rate_hz = self.rate_hz(body);
        let part = (1.0 / (rate_hz * HOLDS_FOR_S)).sqrt();
        let mut off = Vec::new();
        let mut stands = vec![[false; 4]; own.soles_m.len()];
        for ((sole, range), weight) in self.contacts.iter().zip(&weights.contacts) {
            let mean_m = |of: &dyn Fn(usize) -> DVec3| {
                range.clone().map(of).sum::<DVec3>() / range.len() as f64
            };
            let (now, then) =
                (|look: usize| sole_m(look, *sole), |look: usize| own.soles_m[look][*sole]);
            let (mean_now_m, mean_then_m) = (mean_m(&now), mean_m(&then));
            for look in range.clone() {
                stands[look][*sole] = true;
                let slid_m = (now(look) - mean_now_m) - (then(look) - mean_then_m) * SLIDES_LEFT;
                let slid_m = slid_m.with_z(now(look).z - then(look).z);
                off.extend((slid_m * (weight * part / HOLDS_M)).to_array());
            }
        }
        for (look, stands) in stands.iter().enumerate() {
            for sole in (0..4).filter(|sole| !stands[*sole]) {
                let height_m = own.soles_m[look][sole].z;
                if height_m < 4.0 * ON_FLOOR_M {
                    let low_m = (sole_m(look, sole).z - height_m.min(CLEAR_M)).min(0.0);
                    off.push(low_m * part / HOLDS_M);
                }
            }
        }
        let then_hz = self.rate_hz(self.from);
        let scale = self.taller(body) / self.longer(body).powi(2) * then_hz * then_hz;
        let mut bends_m = feet.bends_m();
        for (own_m, weight) in own.bends_m().zip(&weights.roots) {
            let own_m_s2 = own_m * scale;
            let now_m_s2 = bends_m.next().map_or(own_m_s2, |bend_m| bend_m * rate_hz * rate_hz);
            off.extend(((now_m_s2 - own_m_s2) * (weight * part / ROOT_HOLDS_M_S2)).to_array());
        }
        if own.away_m().length() < CAME_BACK_M {
            off.extend(((feet.away_m() - own.away_m()) / AWAY_M).to_array());
        }
        DVector::from_vec(off)
    }

    /// The seams after one regression.
    fn regressed(
        &self,
        body: &Proportions,
        moved: DVector<f64>,
        weights: &Weights,
    ) -> Result<DVector<f64>, Error> {
        let off = self.off(&self.feet(&moved, body)?, body, weights);
        let mut answers = DMatrix::zeros(off.len(), moved.len());
        for seam in 0..moved.len() {
            let mut nudged = moved.clone();
            nudged[seam] += NUDGE;
            let slope = (self.off(&self.feet(&nudged, body)?, body, weights) - &off) / NUDGE;
            answers.set_column(seam, &slope);
        }
        let turned = answers.transpose();
        let kept = 1.0 / (MOVED * MOVED);
        let identity = DMatrix::identity(moved.len(), moved.len());
        let normal = &identity * kept + &turned * &answers;
        let towards = -(&turned * &off) - &moved * kept;
        let cost = |off: &DVector<f64>, moved: &DVector<f64>| {
            off.norm_squared() + moved.norm_squared() * kept
        };
        let before = cost(&off, &moved);
        // Where soles do not answer as they did nearby, less far (Levenberg and Marquardt).
        for damping in DAMPINGS {
            let Some(factors) = Cholesky::new(&normal + &identity * damping) else { continue };
            let next = &moved + factors.solve(&towards);
            // Seams that have passed one another are too far.
            if let Ok(feet) = self.feet(&next, body)
                && cost(&self.off(&feet, body, weights), &next) < before
            {
                return Ok(next);
            }
        }
        Ok(moved)
    }

    /// What nearly misses its bound matters more from now on.
    fn reweigh(
        &self,
        weights: &mut Weights,
        moved: &DVector<f64>,
        body: &Proportions,
    ) -> Result<(), Error> {
        let feet = self.feet(moved, body)?;
        let last = feet.soles_m.len() - 1;
        for ((sole, range), weight) in self.contacts.iter().zip(&mut weights.contacts) {
            let soles_m = range.clone().map(|look| feet.soles_m[look.min(last)][*sole]);
            let extent = soles_m.fold(None, |extent: Option<(DVec3, DVec3)>, at_m| {
                let (least, most) = extent.unwrap_or((at_m, at_m));
                Some((least.min(at_m), most.max(at_m)))
            });
            let slides_m = extent.map_or(0.0, |(least, most)| (most - least).truncate().length());
            if self.bounds.is_nearly_slid(slides_m, NEARLY) {
                *weight *= MATTERS_MORE;
            }
        }
        let rate_hz = self.rate_hz(body);
        for (bend_m, weight) in feet.bends_m().zip(&mut weights.roots) {
            if self.bounds.is_nearly_jerked(bend_m.length() * rate_hz * rate_hz, feet.fly(), NEARLY)
            {
                *weight *= MATTERS_MORE;
            }
        }
        Ok(())
    }
}
