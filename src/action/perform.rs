//! From a definition to chains of actionlets.

use crate::action::motion::{resting_until, then_until};
use crate::action::{Action, Ends, Group, Motion, Turn};
use crate::actionlet::{Sequence, Shape};
use crate::body::Dof;
use crate::error::Error;

/// Most rounds of a cyclic action.
pub const MAX_ROUNDS: u32 = 100_000;

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
        let rounds = if self.cyclic.is_some() { f64::from(rounds) } else { 1.0 };
        let mut chains: Vec<Option<Sequence>> = vec![None; Dof::ALL.len()];
        for group in &self.groups {
            for track in &group.tracks {
                let turns = &self.waveforms[track.waveform];
                let all = match &self.cyclic {
                    None => turns.clone(),
                    Some(ends) => self.turns_of_rounds(group, track.dof, turns, ends, rounds),
                };
                let chain = self.chain(track.dof, &all);
                chains[track.dof.index()] =
                    Some(chain.map_err(|e| {
                        e.at(format!("action {}, {}", self.name, track.dof.name()))
                    })?);
            }
        }
        let end_s = rounds * self.duration_s;
        let tracks = Dof::ALL.into_iter().zip(chains).map(|(dof, chain)| match chain {
            Some(chain) => resting_until(chain, end_s),
            None => Sequence::starting_at(0.0, self.pose[dof])?.rest(end_s),
        });
        Motion::new(tracks.collect::<Result<_, _>>()?)?.in_flight(self.flights_of(rounds))
    }

    fn chain(&self, dof: Dof, turns: &[Turn]) -> Result<Sequence, Error> {
        let start = Sequence::starting_at(0.0, self.pose[dof])?;
        turns.iter().try_fold(start, |chain, turn| {
            then_until(chain, turn.at * self.duration_s, turn.angle_rad, turn.shape.clone())
        })
    }

    /// Turning points of a degree of freedom from the pose through the rounds and back, `at` in
    /// periods from the start.
    fn turns_of_rounds(
        &self,
        group: &Group,
        dof: Dof,
        waveform: &[Turn],
        ends: &Ends,
        rounds: f64,
    ) -> Vec<Turn> {
        let lead = |turns: &[(Dof, Turn)], from: f64| -> Vec<Turn> {
            let own = turns.iter().filter(|(of, _)| *of == dof);
            own.map(|(_, turn)| Turn { at: turn.at + from, ..turn.clone() }).collect()
        };
        let mut turns = lead(&ends.lead_in, 0.0);
        let joins = turns.len();
        let (numerator, denominator) = (f64::from(group.rate.0), f64::from(group.rate.1));
        let rate = numerator / denominator;
        // Own rounds that reach from before the start to after the end.
        let last = (rate * (rounds + ends.phase) + group.phase).ceil() as i64;
        for round in -1..=last {
            for turn in waveform {
                // Eq. 7 solved for time: rate (t + start phase) + phase = round + at.
                let at = (round as f64 + turn.at - group.phase) / rate - ends.phase;
                if (ends.after..=rounds - ends.before).contains(&at) {
                    turns.push(Turn { at, ..turn.clone() });
                }
            }
        }
        // The cycle is joined by a transition, not by the actionlet that arrives there in a round.
        if let Some(joined) = turns.get_mut(joins) {
            joined.shape = Shape::default();
        }
        turns.extend(lead(&ends.lead_out, rounds));
        if turns.last().is_none_or(|turn| turn.at < rounds) {
            turns.push(Turn { at: rounds, angle_rad: self.pose[dof], shape: Shape::default() });
        }
        turns
    }

    /// Flights in s from the start.
    fn flights_of(&self, rounds: f64) -> Vec<(f64, f64)> {
        let in_s = |(from, to): (f64, f64)| (from * self.duration_s, to * self.duration_s);
        let Some(ends) = &self.cyclic else {
            return self.flights.iter().copied().map(in_s).collect();
        };
        let mut flights: Vec<(f64, f64)> = Vec::new();
        for round in -1..=(rounds + ends.phase).ceil() as i64 {
            for (from, to) in &self.flights {
                let at = |phase: f64| round as f64 + phase - ends.phase;
                if at(*from) >= ends.after && at(*to) <= rounds - ends.before {
                    flights.push((at(*from), at(*to)));
                }
            }
        }
        flights.sort_by(|a, b| a.0.total_cmp(&b.0));
        flights.into_iter().map(in_s).collect()
    }
}
