//! Which models a frame concerns. A model of which nothing is under way waits, for each phase that it may begin with,
//! for one demand that the last frame did not meet; while that is not met the phase cannot begin, and nobody has to look
//! at the model. So models that are idle cost nothing, however many there are.

use super::features::{FEATURES, Feature, FeatureRow};
use super::model::{ActionModel, FeatureRange, ModelPhase};
use super::posture::MajorPosture;
use core::cmp::Ordering;
use core::ops::Range;
use std::collections::BinaryHeap;

/// The first features of a row say which posture it is.
const POSTURES: usize = MajorPosture::ALL.len();

/// A phase that waits for a number to be at least (or at most, as its negative) this. The least comes first.
#[derive(Clone, Copy, Debug)]
struct Bound {
    least: f64,
    entry: usize,
}

impl Ord for Bound {
    fn cmp(&self, other: &Self) -> Ordering {
        other.least.total_cmp(&self.least).then(other.entry.cmp(&self.entry))
    }
}

impl PartialOrd for Bound {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Bound {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Bound {}

/// Those who wait for numbers to rise to bounds.
#[derive(Clone, Debug)]
struct Rising {
    by_feature: Vec<BinaryHeap<Bound>>,
    /// The first bound of each feature; nothing happens while all numbers are below.
    first: [f64; FEATURES],
}

impl Rising {
    fn new() -> Self {
        Self { by_feature: vec![BinaryHeap::new(); FEATURES], first: [f64::INFINITY; FEATURES] }
    }

    fn wait(&mut self, feature: Feature, least: f64, entry: usize) {
        // What compares with nothing is never met.
        let least = if least.is_nan() { f64::INFINITY } else { least };
        let of = feature.index();
        self.by_feature[of].push(Bound { least, entry });
        self.first[of] = self.first[of].min(least);
    }

    /// Takes out those whose bound is reached.
    fn reached(&mut self, values: impl Fn(usize) -> f64, mut take: impl FnMut(usize)) {
        for of in 0..FEATURES {
            let value = values(of);
            if !(value >= self.first[of]) {
                continue;
            }
            let waiting = &mut self.by_feature[of];
            while waiting.peek().is_some_and(|bound| bound.least <= value) {
                if let Some(bound) = waiting.pop() {
                    take(bound.entry);
                }
            }
            self.first[of] = waiting.peek().map_or(f64::INFINITY, |bound| bound.least);
        }
    }
}

/// A phase that a model may begin with.
#[derive(Clone, Copy, Debug)]
struct Entry {
    model: usize,
    phase: usize,
    waits: bool,
}

/// Which models wait for what, and which a frame has to be shown to. It holds each phase that a model may begin with once at
/// most.
#[derive(Clone, Debug)]
pub struct WaitingRoom {
    entries: Vec<Entry>,
    of_model: Vec<Range<usize>>,
    rising: Rising,
    falling: Rising,
    /// Those who wait for another posture, and the one there was.
    for_posture: Vec<usize>,
    posture: [f64; POSTURES],
    /// A bit for each model that is awake.
    awake: Vec<u64>,
}

impl WaitingRoom {
    /// All models are awake.
    #[must_use]
    pub fn new(models: &[ActionModel]) -> Self {
        let mut entries = Vec::new();
        let mut of_model = Vec::with_capacity(models.len());
        let mut awake = vec![0; models.len().div_ceil(64)];
        for (model, of) in models.iter().enumerate() {
            let from = entries.len();
            let phases = 0..of.phases.len().min(of.leading + 1);
            entries.extend(phases.map(|phase| Entry { model, phase, waits: false }));
            of_model.push(from..entries.len());
            awake[model / 64] |= 1 << (model % 64);
        }
        Self {
            entries,
            of_model,
            rising: Rising::new(),
            falling: Rising::new(),
            for_posture: Vec::new(),
            posture: [f64::NAN; POSTURES],
            awake,
        }
    }

    /// Wakes the models that a frame concerns.
    pub fn wake(&mut self, row: &FeatureRow) {
        let Self { entries, rising, falling, awake, for_posture, .. } = self;
        let mut take = |entry: usize| {
            entries[entry].waits = false;
            let model = entries[entry].model;
            awake[model / 64] |= 1 << (model % 64);
        };
        rising.reached(|of| row.values[of], &mut take);
        falling.reached(|of| -row.values[of], &mut take);
        let posture = &row.values[..POSTURES];
        if !same(posture, &self.posture) {
            for_posture.drain(..).for_each(take);
            self.posture.copy_from_slice(posture);
        }
    }

    /// The first model at or behind this one that is awake.
    #[must_use]
    pub fn awake_from(&self, model: usize) -> Option<usize> {
        let (word, bit) = (model / 64, model % 64);
        let rest = self.awake.get(word)? & (u64::MAX << bit);
        if rest != 0 {
            return Some(64 * word + rest.trailing_zeros() as usize);
        }
        let (more, bits) =
            self.awake.iter().enumerate().skip(word + 1).find(|(_, bits)| **bits != 0)?;
        Some(64 * more + bits.trailing_zeros() as usize)
    }

    /// Lets a model wait of which nothing is under way, and which this frame could not begin.
    pub fn rest(&mut self, index: usize, model: &ActionModel, row: &FeatureRow) {
        let mut all_wait = true;
        for entry in self.of_model[index].clone() {
            if !self.entries[entry].waits {
                let phase = &model.phases[self.entries[entry].phase];
                self.entries[entry].waits = self.wait(entry, phase, row);
                all_wait &= self.entries[entry].waits;
            }
        }
        if all_wait {
            self.awake[index / 64] &= !(1 << (index % 64));
        }
    }

    /// Finds something for a phase to wait for; false if the frame fits it.
    fn wait(&mut self, entry: usize, phase: &ModelPhase, row: &FeatureRow) -> bool {
        let unmet = phase.gates.iter().find(|gate| !gate.range.holds(row.value(gate.feature)));
        if let Some(gate) = unmet {
            let FeatureRange { from, to } = gate.range;
            if row.value(gate.feature) > to {
                self.falling.wait(gate.feature, -to, entry);
            } else {
                self.rising.wait(gate.feature, from, entry);
            }
        } else if phase.fits(row) {
            return false;
        } else {
            self.for_posture.push(entry);
        }
        true
    }
}

fn same(a: &[f64], b: &[f64]) -> bool {
    a.iter().zip(b).all(|(a, b)| a.to_bits() == b.to_bits())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recognise::machine::{ActionEvent, ModelMachine};
    use crate::recognise::model::vocabulary;
    use crate::recognise::posture::EquationReading;
    use proptest::prelude::*;

    /// Rows in which every feature jumps about, often to nothing that is a number, and now and then stays.
    fn rows() -> impl Strategy<Value = Vec<FeatureRow>> {
        let value = prop_oneof![
            4 => -2.0..2.0f64,
            2 => Just(1.0),
            2 => Just(0.0),
            1 => Just(f64::NAN),
            1 => -100.0..100.0f64,
        ];
        let row = proptest::collection::vec(value, FEATURES);
        let kept = proptest::collection::vec((row, 1..4usize), 1..40);
        kept.prop_map(|kept| {
            let mut rows = Vec::new();
            for (values, times) in kept {
                let mut row = FeatureRow::unknown(0.02);
                row.values.copy_from_slice(&values);
                rows.extend(vec![row; times]);
            }
            rows
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]

        #[test]
        fn what_models_say_is_the_same_whether_those_who_wait_are_looked_at_or_not(
            rows in rows(),
            strict in any::<bool>(),
        ) {
            let reading =
                if strict { EquationReading::Strict } else { EquationReading::Repaired };
            let mut models = vocabulary::all().expect("models");
            for model in &mut models {
                // What jumps about meets few demands at once.
                for phase in &mut model.phases {
                    phase.gates.truncate(2);
                }
            }
            let machines = vec![ModelMachine::new(reading); models.len()];
            let mut all = machines.clone();
            let mut some = machines;
            let mut waiting = WaitingRoom::new(&models);
            for (n, row) in rows.iter().enumerate() {
                let time_s = n as f64 * 0.02;
                let mut expected: Vec<(usize, ActionEvent)> = Vec::new();
                for (index, model) in models.iter().enumerate() {
                    all[index].next(model, row, time_s, &mut |what| expected.push((index, what)));
                }
                let mut told: Vec<(usize, ActionEvent)> = Vec::new();
                waiting.wake(row);
                let mut from = 0;
                while let Some(index) = waiting.awake_from(from) {
                    from = index + 1;
                    let model = &models[index];
                    some[index].next(model, row, time_s, &mut |what| told.push((index, what)));
                    if some[index].is_idle() {
                        waiting.rest(index, model, row);
                    }
                }
                prop_assert_eq!(told, expected);
            }
        }
    }

    #[test]
    fn who_stands_still_keeps_no_model_awake() {
        let models = vocabulary::all().expect("models");
        let mut waiting = WaitingRoom::new(&models);
        let row = FeatureRow { values: [0.0; FEATURES], dt_s: 0.02 };
        for awake in [models.len(), 0] {
            waiting.wake(&row);
            let found = (0..models.len()).filter(|of| waiting.awake_from(*of) == Some(*of));
            assert_eq!(found.count(), awake);
            for (index, model) in models.iter().enumerate() {
                waiting.rest(index, model, &row);
            }
        }
    }
}
