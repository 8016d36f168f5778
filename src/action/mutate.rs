//! Variations of an action (Zheng et al. 2007, Sec. 4): other velocity functions from a database,
//! and perturbed parameters.
//!
//! Angles are perturbed at the seams, which two neighbours share. The two sides of a body that
//! share a waveform stay copies of one another, phases and rates of groups are kept, and so is the
//! first turning point of every cycle: phase differences stay what they were. Durations inside an
//! action change against one another but not their sum; the whole is stretched for all groups
//! alike.

use crate::action::database::Database;
use crate::action::{Action, Group, Turn};
use crate::actionlet::Shape;
use crate::actionlet::shape::PEAK_AT;
use crate::body::Dof;
use crate::error::Error;
use rand::{Rng, RngExt};

impl Action {
    /// The same action with the speed peak of every half sine at one place (as in Fig. 5c of the
    /// paper, T = 0.3 and 0.5).
    ///
    /// # Errors
    /// If the place is not in [`PEAK_AT`].
    pub fn with_peak(mut self, peak_at: f64) -> Result<Self, Error> {
        let shape = Shape::half_sine(peak_at)?;
        for turn in self.waveforms.iter_mut().flatten() {
            if let Shape::HalfSine(_) = turn.shape {
                turn.shape = shape.clone();
            }
        }
        Ok(self)
    }
}

/// How far variations go.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spread {
    /// Seam angles move by at most half this part of the smaller angle change beside them, so that
    /// two that approach each other cannot pass: 0 to 0.9.
    pub angle: f64,
    /// Seam times move by at most this part of the shorter duration beside them: 0 to 0.45.
    pub time: f64,
    /// Peaks of half sines move by at most this: 0 to 0.8.
    pub peak: f64,
    /// The whole action gets longer or shorter by at most this part: 0 to 0.9.
    pub duration: f64,
    /// Probability that an actionlet's velocity function is exchanged for one of its type: 0 to 1.
    pub exchange: f64,
}

impl Default for Spread {
    fn default() -> Self {
        Self { angle: 0.1, time: 0.05, peak: 0.1, duration: 0.1, exchange: 0.2 }
    }
}

impl Spread {
    /// Checks that every figure is in its range.
    ///
    /// # Errors
    /// If one is not.
    pub fn check(&self) -> Result<(), Error> {
        for (what, value, most) in [
            ("angle", self.angle, 0.9),
            ("time", self.time, 0.45),
            ("peak", self.peak, 0.8),
            ("duration", self.duration, 0.9),
            ("exchange", self.exchange, 1.0),
        ] {
            if !(0.0..=most).contains(&value) {
                return Err(Error::new(format!("the spread of {what} is out of range"))
                    .got(value.to_string())
                    .allowed(format!("0 to {most}")));
            }
        }
        Ok(())
    }
}

/// A variation of an action. The same state of `random` gives the same variation.
#[must_use]
pub fn mutate(
    action: &Action,
    spread: &Spread,
    database: &Database,
    random: &mut impl Rng,
) -> Action {
    let mut varied = action.clone();
    varied.duration_s *= 1.0 + around_zero(random, spread.duration);
    for waveform in 0..action.waveforms.len() {
        let dofs: Vec<Dof> =
            action.tracks().filter(|t| t.waveform == waveform).map(|t| t.dof).collect();
        let Some(dof) = dofs.first().copied() else { continue };
        let turns = &mut varied.waveforms[waveform];
        exchange(action, dof, turns, spread, database, random);
        for turn in turns.iter_mut() {
            if let Shape::HalfSine(peak_at) = &turn.shape {
                let moved = peak_at.value() + around_zero(random, spread.peak);
                let moved = moved.clamp(*PEAK_AT.start(), *PEAK_AT.end());
                turn.shape = Shape::half_sine(moved).unwrap_or_default();
            }
        }
        move_angles(action, &dofs, turns, spread.angle, random);
        move_times(action, waveform, turns, spread.time, random);
    }
    varied
}

/// Evenly distributed between minus and plus `most`.
fn around_zero(random: &mut impl Rng, most: f64) -> f64 {
    if most > 0.0 { random.random_range(-most..=most) } else { 0.0 }
}

/// The angle an actionlet starts from.
fn from_rad(action: &Action, dof: Dof, turns: &[Turn], index: usize) -> f64 {
    match (index.checked_sub(1), &action.cyclic) {
        (Some(before), _) => turns[before].angle_rad,
        (None, None) => action.pose[dof],
        (None, Some(_)) => turns[turns.len() - 1].angle_rad,
    }
}

fn exchange(
    action: &Action,
    dof: Dof,
    turns: &mut [Turn],
    spread: &Spread,
    database: &Database,
    random: &mut impl Rng,
) {
    if !(spread.exchange > 0.0) {
        return;
    }
    for index in 0..turns.len() {
        let change_rad = turns[index].angle_rad - from_rad(action, dof, turns, index);
        let alike =
            database.type_of(dof, change_rad).map_or(&[][..], |kind| database.of_type(kind));
        if alike.is_empty() || !random.random_bool(spread.exchange) {
            continue;
        }
        let pick = random.random_range(0..alike.len());
        turns[index].shape = alike[pick].shape.clone();
    }
}

/// Moves the angles of turning points inside the anatomical range, and never further out of it than
/// they are (captured ones may be). Neighbours with equal angles, a rest between, move together;
/// where an action that is done once starts and ends it stays.
fn move_angles(
    action: &Action,
    dofs: &[Dof],
    turns: &mut [Turn],
    spread: f64,
    random: &mut impl Rng,
) {
    let closed = action.cyclic.is_some();
    let given: Vec<f64> = turns.iter().map(|turn| turn.angle_rad).collect();
    let count = given.len();
    let start_rad = action.pose[dofs[0]];
    let mut index = 0;
    while index < count {
        let mut end = index;
        while end + 1 < count && given[end + 1] == given[index] {
            end += 1;
        }
        let before = match index.checked_sub(1) {
            Some(before) => given[before],
            None if closed => given[count - 1],
            None => start_rad,
        };
        let after = if end + 1 < count { Some(given[end + 1]) } else { closed.then(|| given[0]) };
        let moved = around_zero(random, spread);
        if let Some(after) = after {
            let smaller = (given[index] - before).abs().min((after - given[index]).abs());
            // Two neighbours may approach each other: half the change is the most for each.
            let angle_rad = given[index] + moved * smaller / 2.0;
            let (lower, upper) = dofs[0].range_rad();
            for turn in &mut turns[index..=end] {
                turn.angle_rad =
                    angle_rad.clamp(lower.min(turn.angle_rad), upper.max(turn.angle_rad));
            }
        }
        index = end + 1;
    }
}

/// Moves the times of turning points but the first of a cycle and the last of an action that is
/// done once. None moves over the instants at which a cycle is joined and left: the first and last
/// rounds of all variations are made of the same actionlets.
fn move_times(
    action: &Action,
    waveform: usize,
    turns: &mut [Turn],
    spread: f64,
    random: &mut impl Rng,
) {
    let closed = action.cyclic.is_some();
    let given: Vec<f64> = turns.iter().map(|turn| turn.at).collect();
    let count = given.len();
    for index in 0..count {
        let moved = around_zero(random, spread);
        let before = if index == 0 { 0.0 } else { given[index - 1] };
        let after = if index + 1 < count { given[index + 1] } else { given[0] + 1.0 };
        let fixed = if closed { index == 0 } else { index + 1 == count };
        let shorter = (given[index] - before).min(after - given[index]);
        let at = given[index] + moved * shorter;
        let stays =
            rounds_played(action, waveform, at) == rounds_played(action, waveform, given[index]);
        if !fixed && stays {
            turns[index].at = at;
        }
    }
}

/// The first round of a cycle in which a turning point is played and the last, for every group that
/// plays it (Eq. 7, as `Action::perform_rounds` solves it).
fn rounds_played(action: &Action, waveform: usize, at: f64) -> Vec<[f64; 2]> {
    let Some(ends) = &action.cyclic else { return Vec::new() };
    let plays = |group: &&Group| group.tracks.iter().any(|track| track.waveform == waveform);
    let rounds = |group: &Group| {
        let rate = f64::from(group.rate.0) / f64::from(group.rate.1);
        let round = |time: f64| rate * (time + ends.phase) + group.phase - at;
        let left = f64::from(action.rounds) - ends.before;
        [round(ends.after).ceil(), round(left).floor()]
    };
    action.groups.iter().filter(plays).map(rounds).collect()
}
