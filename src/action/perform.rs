//! From a definition to chains of actionlets.

use crate::action::motion::{resting_until, then_until};
use crate::action::{Action, Ends, Group, Motion, Turn};
use crate::actionlet::{Sequence, Shape};
use crate::body::Dof;
use crate::error::Error;
use std::ops::RangeInclusive;

/// Most rounds of a cyclic action.
pub const MAX_ROUNDS: u32 = 100_000;
/// Rounding of an instant, in periods.
const ROUNDED: f64 = 1e-9;
/// A stride begins at this phase of a leg, in its swing, and so before the contact that its phase counts from:
/// what a leg does just before its foot comes down decides where it comes down.
const STRIDE_BEGINS: f64 = 0.75;

/// A cyclic action on its way: from which phase, how far, and what comes before and after.
#[derive(Clone, Debug)]
pub(super) struct Way<'a> {
    /// How it is led in and out, where that is asked for.
    pub(super) ends: &'a Ends,
    /// Phase at its begin.
    pub(super) phase: f64,
    /// How far it goes, in periods.
    pub(super) periods: f64,
    /// It comes out of rest, from its pose; else out of another cycle.
    pub(super) from_rest: bool,
    /// It comes to rest, at its pose; else goes over into another cycle.
    pub(super) to_rest: bool,
}

impl Action {
    /// The motion with its default number of rounds.
    ///
    /// # Errors
    /// As [`Self::perform_rounds`].
    pub fn perform(&self) -> Result<Motion, Error> {
        self.perform_rounds(self.rounds)
    }

    /// Whole rounds of a cyclic action that come nearest to a duration: at least one.
    #[must_use]
    pub fn rounds_in(&self, duration_s: f64) -> u32 {
        // The cast saturates, and not-a-number becomes zero.
        ((duration_s / self.duration_s).round() as u32).clamp(1, MAX_ROUNDS)
    }

    /// The motion, a cyclic action with so many rounds; an action that is done once ignores them.
    ///
    /// # Errors
    /// If rounds are out of range or the definition does not fit together.
    pub fn perform_rounds(&self, rounds: u32) -> Result<Motion, Error> {
        if !(1..=MAX_ROUNDS).contains(&rounds) {
            return Err(Error::new("the number of rounds of an action is out of range")
                .got(rounds.to_string())
                .allowed(format!("1 to {MAX_ROUNDS}")));
        }
        let way = self.cyclic.as_ref().map(|ends| Way {
            ends,
            phase: ends.phase,
            periods: f64::from(rounds),
            from_rest: true,
            to_rest: true,
        });
        let end_s = way.as_ref().map_or(1.0, |way| way.periods) * self.duration_s;
        let mut tracks = Vec::with_capacity(Dof::ALL.len());
        for dof in Dof::ALL {
            let turns = match &way {
                None => self.turns_once(dof),
                Some(way) => self.turns_on(way, dof),
            };
            let chain = self.chain(dof, &turns.unwrap_or_default());
            let chain = chain.map_err(|e| e.at(format!("action {}, {}", self.name, dof.name())))?;
            tracks.push(resting_until(chain, end_s)?);
        }
        let flights = way.map_or_else(|| self.flights.clone(), |way| self.flights_on(&way));
        let in_s = |(from, to): (f64, f64)| (from * self.duration_s, to * self.duration_s);
        Motion::new(tracks)?.in_flight(flights.into_iter().map(in_s).collect())
    }

    /// Turning points of a degree of freedom of an action that is done once.
    fn turns_once(&self, dof: Dof) -> Option<Vec<Turn>> {
        let track = self.tracks().find(|track| track.dof == dof)?;
        Some(self.waveforms[track.waveform].clone())
    }

    fn chain(&self, dof: Dof, turns: &[Turn]) -> Result<Sequence, Error> {
        let start = Sequence::starting_at(0.0, self.pose[dof])?;
        turns.iter().try_fold(start, |chain, turn| {
            then_until(chain, turn.at * self.duration_s, turn.angle_rad, turn.shape.clone())
        })
    }

    /// Turning points of a degree of freedom on the way, `at` in periods from its begin; none if the
    /// action does not drive it. Out of rest it comes from the pose, into rest it goes back there; in
    /// motion the cycle goes on, a period beyond either end.
    pub(super) fn turns_on(&self, way: &Way<'_>, dof: Dof) -> Option<Vec<Turn>> {
        let (group, track) = self.groups.iter().find_map(|group| {
            group.tracks.iter().find(|track| track.dof == dof).map(|track| (group, track))
        })?;
        let Way { ends, periods, .. } = way;
        let lead = |turns: &[(Dof, Turn)], from: f64| -> Vec<Turn> {
            let own = turns.iter().filter(|(of, _)| *of == dof);
            own.map(|(_, turn)| Turn { at: turn.at + from, ..turn.clone() }).collect()
        };
        let mut turns = if way.from_rest { lead(&ends.lead_in, 0.0) } else { Vec::new() };
        let joins = turns.len();
        let from = if way.from_rest { ends.after } else { -1.0 };
        let to = if way.to_rest { periods - ends.before } else { periods + 1.0 };
        let round = |round: i64| self.round_of(round, group, track.waveform);
        turns.extend(cycle(group, round, way.phase, &(from..=to)));
        // The cycle is joined by a transition, not by the actionlet that arrives there in a round.
        if let Some(joined) = turns.get_mut(joins) {
            joined.shape = Shape::default();
        }
        if way.to_rest {
            turns.extend(lead(&ends.lead_out, *periods));
            if turns.last().is_none_or(|turn| turn.at < *periods) {
                let angle_rad = self.pose[dof];
                turns.push(Turn { at: *periods, angle_rad, shape: Shape::default() });
            }
        }
        Some(turns)
    }

    /// Turning points of a round of a waveform of a group, each of its own stride: from one swing of a leg
    /// to the next, so that all of a step is of one stride. Groups whose phase is half a round away take
    /// every other of the strides, as left and right steps follow one another.
    fn round_of(&self, round: i64, group: &Group, waveform: usize) -> impl Iterator<Item = &Turn> {
        let count = self.strides.len().max(1) as i64;
        let other = i64::from(group.phase >= 0.5);
        self.waveforms[waveform].iter().enumerate().map(move |(index, turn)| {
            let stride = 2 * (round + i64::from(turn.at >= STRIDE_BEGINS)) + other;
            // Below the count, which is small; the cast cannot wrap.
            let waveforms = self.strides.get(stride.rem_euclid(count) as usize);
            waveforms.and_then(|of| of.get(waveform)?.get(index)).unwrap_or(turn)
        })
    }

    /// Flights on the way, in periods from its begin, in order.
    pub(super) fn flights_on(&self, way: &Way<'_>) -> Vec<(f64, f64)> {
        let from = if way.from_rest { way.ends.after } else { -ROUNDED };
        let to = if way.to_rest { way.periods - way.ends.before } else { way.periods + ROUNDED };
        let mut flights: Vec<(f64, f64)> = Vec::new();
        for round in -1..=(way.periods + way.phase).ceil() as i64 {
            for flight in &self.flights {
                let at = |phase: f64| round as f64 + phase - way.phase;
                if at(flight.0) >= from && at(flight.1) <= to {
                    flights.push((at(flight.0), at(flight.1)));
                }
            }
        }
        flights.sort_by(|a, b| a.0.total_cmp(&b.0));
        flights
    }
}

/// Turning points of a waveform, given by round, `at` in periods of the action from an instant at which it
/// is at `phase`, those that lie `within`.
fn cycle<'a, Round: Iterator<Item = &'a Turn>>(
    group: &Group,
    waveform: impl Fn(i64) -> Round,
    phase: f64,
    within: &RangeInclusive<f64>,
) -> Vec<Turn> {
    let rate = f64::from(group.rate.0) / f64::from(group.rate.1);
    let own = |at: f64| rate * (at + phase) + group.phase;
    let rounds = own(*within.start()).floor() as i64 - 1..=own(*within.end()).ceil() as i64;
    let mut turns = Vec::new();
    for round in rounds {
        for turn in waveform(round) {
            // Eq. 7 solved for time: rate (t + start phase) + phase = round + at.
            let at = (round as f64 + turn.at - group.phase) / rate - phase;
            if within.contains(&at) {
                turns.push(Turn { at, ..turn.clone() });
            }
        }
    }
    turns
}
