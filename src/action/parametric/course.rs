//! A motion from rest to rest, stretch by stretch: in each, every degree of freedom that moves does so as one actionlet.

use crate::action::Motion;
use crate::action::motion::{resting_until, then_until};
use crate::actionlet::shape::PEAK_AT;
use crate::actionlet::{Sequence, Shape};
use crate::body::{Dof, JointAngles};
use crate::error::Error;

/// How one degree of freedom uses the time of a stretch: when it begins and ends to move, as parts of it, and where
/// its speed has its peak.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Timing {
    pub(super) begins: f64,
    pub(super) ends: f64,
    pub(super) peak_at: f64,
}

impl Timing {
    /// All of the time, fastest in the middle.
    pub(super) const EVEN: Self = Self { begins: 0.0, ends: 1.0, peak_at: 0.5 };

    /// The same backwards in time.
    fn reversed(self) -> Self {
        let peak_at = (1.0 - self.peak_at).clamp(*PEAK_AT.start(), *PEAK_AT.end());
        Self { begins: 1.0 - self.ends, ends: 1.0 - self.begins, peak_at }
    }
}

/// From rest to rest.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Stretch {
    pub(super) from: JointAngles,
    pub(super) to: JointAngles,
    pub(super) duration_s: f64,
    pub(super) timings: [Timing; 22],
    /// Which turn round on the way, at which part of it, and at which angle: they have two actionlets.
    pub(super) turns: Vec<(Dof, f64, f64)>,
}

impl Stretch {
    pub(super) const fn even(from: JointAngles, to: JointAngles, duration_s: f64) -> Self {
        Self { from, to, duration_s, timings: [Timing::EVEN; 22], turns: Vec::new() }
    }

    /// The same backwards in time: feet that held hold.
    pub(super) fn reversed(&self) -> Self {
        let timings = self.timings.map(Timing::reversed);
        let turns = self.turns.iter().map(|(dof, at, rad)| (*dof, 1.0 - at, *rad)).collect();
        Self { from: self.to, to: self.from, duration_s: self.duration_s, timings, turns }
    }

    /// The same seen in a mirror.
    pub(super) fn mirrored(&self) -> Self {
        let mut timings = self.timings;
        for dof in Dof::ALL {
            timings[dof.mirrored().0.index()] = self.timings[dof.index()];
        }
        let (from, to) = (mirrored(&self.from), mirrored(&self.to));
        let turn = |(dof, at, rad): &(Dof, f64, f64)| {
            let (twin, sign) = dof.mirrored();
            (twin, *at, sign * rad)
        };
        let turns = self.turns.iter().map(turn).collect();
        Self { from, to, duration_s: self.duration_s, timings, turns }
    }

    /// Appends it to chains that end where it begins.
    fn append(&self, chains: &mut [Sequence], begin_s: f64) -> Result<(), Error> {
        let at_s = |part: f64| begin_s + part * self.duration_s;
        for (dof, chain) in Dof::ALL.into_iter().zip(chains.iter_mut()) {
            let timing = self.timings[dof.index()];
            let rested = resting_until(chain.clone(), at_s(timing.begins))?;
            let shape = Shape::half_sine(timing.peak_at)?;
            let turn = self.turns.iter().find(|(turns, ..)| *turns == dof);
            let moved = match turn {
                Some((_, at, rad)) => then_until(rested, at_s(*at), *rad, Shape::default())?,
                None => rested,
            };
            let moved = if self.to[dof] == moved.to_rad() {
                moved
            } else {
                then_until(moved, at_s(timing.ends), self.to[dof], shape)?
            };
            *chain = resting_until(moved, at_s(1.0))?;
        }
        Ok(())
    }
}

/// Angles of a body seen in a mirror.
pub(super) fn mirrored(angles: &JointAngles) -> JointAngles {
    let mut other = JointAngles::default();
    for dof in Dof::ALL {
        let (twin, sign) = dof.mirrored();
        other[twin] = sign * angles[dof];
    }
    other
}

/// Stretches that follow one another.
#[derive(Clone, Debug, Default)]
pub(super) struct Course {
    stretches: Vec<Stretch>,
}

impl Course {
    /// Where it is so far.
    pub(super) fn last(&self) -> JointAngles {
        self.stretches.last().map_or_else(JointAngles::default, |of| of.to)
    }

    /// How long it is so far, s.
    pub(super) fn duration_s(&self) -> f64 {
        self.stretches.iter().map(|of| of.duration_s).sum()
    }

    /// On to other angles, all at once.
    pub(super) fn go(&mut self, to: JointAngles, duration_s: f64) {
        self.then(Stretch::even(self.last(), to, duration_s));
    }

    pub(super) fn then(&mut self, stretch: Stretch) {
        self.stretches.push(stretch);
    }

    /// The motion.
    ///
    /// # Errors
    /// As of chains of actionlets.
    pub(super) fn motion(&self) -> Result<Motion, Error> {
        let from = self.stretches.first().map_or_else(JointAngles::default, |of| of.from);
        let start = |dof: Dof| Sequence::starting_at(0.0, from[dof]);
        let mut chains = Dof::ALL.into_iter().map(start).collect::<Result<Vec<_>, _>>()?;
        let mut begin_s = 0.0;
        for stretch in &self.stretches {
            stretch.append(&mut chains, begin_s)?;
            begin_s += stretch.duration_s;
        }
        Motion::new(chains)
    }
}
