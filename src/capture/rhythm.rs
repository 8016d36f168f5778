//! How often a sensor with a clock samples, as that clock tells, and what is missing by it.
//!
//! A device may be set to another rate than its profile's. By the profile's, one of half the rate would lose every second
//! sample, and one of twice the rate would never lose one. So the period is the step that most steps of the device's own clock
//! agree on, and the others are multiples of it: steps that are longer are losses. The profile's period, or the one that was found, stands as
//! long as steps agree with it. Where they do not, what is missing is not told before it is known by which period it is to be counted:
//! soon (half a second, 16 samples), and then all of it. A change of rate is found in the same way.
//!
//! Samples that are stamped two by two tell no period: they are counted by the one that stands. By a clock of which a sample takes two
//! or three ticks, one that samples more slowly than its profile says is told to lose some at first.
//!
//! What nobody can tell without a counter: whether a device samples half as often, or evenly loses every second sample.

/// A step so far off the period or a multiple of it, as a part of the period, or a tick of the clock, agrees with it.
const NEAR: f64 = 0.25;
/// The first steps agree with a period that nothing has confirmed yet only so closely.
const CLOSE: f64 = 0.05;
/// So many steps in a row that are one period each confirm it after a doubt.
const CONFIRM: u32 = 6;
/// So many leave no doubt about those before.
const FIRM: u32 = 8;
/// Another period is looked for in so many steps, over this time, s, or in more.
const LEAST: usize = 16;
const LEAST_S: f64 = 0.5;
const ENOUGH: usize = 128;
/// So many agree on nothing: they are counted by the period that stands.
const MOST: usize = 256;
/// How often it is looked.
const EVERY: usize = 8;
/// Part of the steps that are multiples of a period if it is theirs.
const MULTIPLES: f64 = 0.8;
/// Part of the steps that are one period: of the period that stands, of another one, and of another one if there are many steps.
const ONES_OF_KNOWN: f64 = 0.2;
const ONES: f64 = 0.5;
const ONES_OF_MANY: f64 = 0.3;
/// A shorter period is not believed if this part of the samples would be missing by it while there are as many as the known
/// period asks for: they are read or stamped unevenly.
const MOSTLY: f64 = 0.48;
/// No sensor's rate is this many times off its profile's.
const MOST_FACTOR: f64 = 50.0;
/// Steps after which the period is known better.
const BLOCK: f64 = 32.0;
/// A block that is off by more than this part says that the period is another one, and not the same better known.
const ANOTHER: f64 = 0.02;
/// More of them at once say little of one.
const FEW: u64 = 8;
/// Steps that the period is the mean of, at most.
const REMEMBERED: f64 = 1024.0;
/// Samples between two, by a counter, beyond which a step says nothing of the period.
const MOST_BETWEEN: u64 = 16;

/// A step from one sample that was used to the next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Stride {
    /// On the device's clock, s.
    pub(super) step_s: f64,
    /// How many samples on it is, where a counter tells.
    pub(super) counted: Option<u64>,
    /// Samples that came in between and were not used.
    pub(super) came: u64,
}

/// What is missing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Missing {
    /// Samples.
    pub(super) samples: u64,
    /// Places.
    pub(super) gaps: u64,
}

impl Missing {
    const fn and(self, other: Self) -> Self {
        let samples = self.samples.saturating_add(other.samples);
        Self { samples, gaps: self.gaps.saturating_add(other.gaps) }
    }
}

/// The rhythm of one device.
#[derive(Clone, Debug)]
pub(super) struct Rhythm {
    nominal_s: f64,
    tick_s: f64,
    /// Time and number of the steps that the period is the mean of.
    all: (f64, f64),
    /// Those of the block that comes next.
    block: (f64, f64),
    /// Steps of which it is not known by which period they are to be counted.
    held: Vec<Stride>,
    /// What comes is held.
    doubtful: bool,
    /// No step has confirmed the period yet.
    fresh: bool,
    /// Steps that were counted by a period that few steps have confirmed, and what was told of them; `None` once enough have.
    early: Option<(Vec<Stride>, Missing)>,
    /// Steps in a row that are not one period each, and that are.
    odd: u32,
    even: u32,
    known: bool,
}

impl Rhythm {
    /// Of a device that should send a sample every `nominal_s`, with a clock of such ticks.
    pub(super) fn new(nominal_s: f64, tick_s: f64) -> Self {
        let usable = |s: f64, or: f64| if s.is_finite() && s > 0.0 { s } else { or };
        let nominal_s = usable(nominal_s, 0.01);
        Self {
            nominal_s,
            tick_s: usable(tick_s, 1e-6),
            all: (nominal_s * BLOCK, BLOCK),
            block: (0.0, 0.0),
            held: Vec::new(),
            doubtful: true,
            fresh: true,
            early: Some(Default::default()),
            odd: 0,
            even: 0,
            known: false,
        }
    }

    /// Time from sample to sample, s.
    pub(super) const fn period_s(&self) -> f64 {
        self.all.0 / self.all.1
    }

    /// Samples per second, once steps have agreed on that.
    pub(super) fn rate_hz(&self) -> Option<f64> {
        self.known.then(|| 1.0 / self.period_s())
    }

    /// Takes a step forward, and tells what is missing as far as that is known now: before this sample, or before those of which
    /// it was not known yet.
    pub(super) fn take(&mut self, stride: Stride) -> Missing {
        let Some(stride) = of_one(stride) else { return Missing::default() };
        let is_even = self.is_even(&stride);
        if stride.came == 0 {
            (self.odd, self.even) = match is_even {
                true => (0, self.even.saturating_add(1)),
                false => (self.odd.saturating_add(1), 0),
            };
        }
        self.doubtful |= self.odd >= 2;
        if !self.doubtful {
            if is_even {
                self.learn(&stride);
            }
            let told = missing(&stride, self.period_s());
            self.remember(std::iter::once(stride), told);
            return told;
        }
        self.held.push(stride);
        if self.even >= if self.fresh { 1 } else { CONFIRM } {
            self.known = true;
            return self.settle(true);
        }
        let count = self.held.len();
        if count.is_multiple_of(EVERY)
            && self.says_much()
            && let Some(period_s) = self.found(LEAST)
        {
            let early = self.turn_to(period_s);
            return early.and(self.settle(true));
        }
        if count >= MOST { self.settle(false) } else { Missing::default() }
    }

    /// What is missing and was not told yet, as far as it can be told now.
    pub(super) fn pending(&self) -> Missing {
        let period_s = self.found(3).unwrap_or(self.period_s());
        all_missing(&self.held, period_s)
    }

    /// The device began again: the period is what it was until steps say another. What was not told yet is told.
    pub(super) fn restart(&mut self) -> Missing {
        let pending = self.pending();
        self.held.clear();
        (self.doubtful, self.fresh, self.odd, self.even) = (true, true, 0, 0);
        self.early = Some(Default::default());
        pending
    }

    /// True if a step is one period.
    fn is_even(&self, stride: &Stride) -> bool {
        let period_s = self.period_s();
        match self.fresh {
            true => (stride.step_s - period_s).abs() <= (CLOSE * period_s).max(self.tick_s * 1.001),
            false => self.near(stride.step_s, period_s) == Some(1),
        }
    }

    /// Knows the period better, if the step is one or a few of it.
    fn learn(&mut self, stride: &Stride) {
        let times = self.near(stride.step_s, self.period_s());
        let Some(times) = times.filter(|times| *times <= FEW && stride.came == 0) else { return };
        self.block = (self.block.0 + stride.step_s, self.block.1 + times as f64);
        if self.block.1 < BLOCK {
            return;
        }
        let (block, all) = (std::mem::take(&mut self.block), self.all);
        if !self.may_be(block.0 / block.1) {
            return;
        }
        let off = (block.0 / block.1 / self.period_s() - 1.0).abs();
        self.all = match off > ANOTHER {
            true => block,
            false if all.1 >= REMEMBERED => (all.0 / 2.0 + block.0, all.1 / 2.0 + block.1),
            false => (all.0 + block.0, all.1 + block.1),
        };
    }

    /// True if a sensor of this profile may have such a period.
    fn may_be(&self, period_s: f64) -> bool {
        let bounds = self.nominal_s / MOST_FACTOR..=self.nominal_s * MOST_FACTOR;
        bounds.contains(&period_s)
    }

    /// Keeps what was counted as long as the period may turn out to be another.
    fn remember(&mut self, strides: impl Iterator<Item = Stride>, told: Missing) {
        if let Some((all, all_told)) = &mut self.early {
            all.extend(strides);
            *all_told = all_told.and(told);
            if self.even >= FIRM || all.len() >= MOST {
                self.early = None;
            }
        }
    }

    /// Goes by this period from now on. What was missing and not told, since another was believed at first.
    fn turn_to(&mut self, period_s: f64) -> Missing {
        self.known = true;
        if period_s.to_bits() == self.period_s().to_bits() {
            return Missing::default();
        }
        self.all = (period_s * BLOCK, BLOCK);
        self.block = (0.0, 0.0);
        let (early, told) = self.early.take().unwrap_or_default();
        let all = all_missing(&early, period_s);
        let samples = all.samples.saturating_sub(told.samples);
        Missing { samples, gaps: all.gaps.saturating_sub(told.gaps) }
    }

    /// Counts what was held by the period that stands, and learns from it if it agrees with that.
    fn settle(&mut self, is_agreed: bool) -> Missing {
        let told = all_missing(&self.held, self.period_s());
        let held = std::mem::take(&mut self.held);
        if is_agreed {
            held.iter().for_each(|stride| self.learn(stride));
        }
        (self.doubtful, self.fresh, self.odd) = (false, false, 0);
        self.remember(held.into_iter(), told);
        told
    }

    /// True if another period may be found in what was held.
    fn says_much(&self) -> bool {
        let span_s: f64 = self.held.iter().map(|stride| stride.step_s).sum();
        self.held.len() >= ENOUGH || self.held.len() >= LEAST && span_s >= LEAST_S
    }

    /// The period that steps which were held agree on, if so many of them at least are looked at: the one that stands, or another.
    fn found(&self, least: usize) -> Option<f64> {
        let usable = self.held.iter().filter(|stride| stride.came == 0);
        let mut steps_s: Vec<f64> = usable.map(|stride| stride.step_s).collect();
        if steps_s.len() < least {
            return None;
        }
        steps_s.sort_by(f64::total_cmp);
        let standing_s = self.period_s();
        let agreement = |period_s: f64| self.agreement(period_s, &steps_s);
        let agrees = |period_s: f64, ones: f64| agreement(period_s).is_enough(ones);
        if agrees(standing_s, ONES_OF_KNOWN) {
            let better_s = self.refined(standing_s, &steps_s).filter(|better_s| {
                (better_s / standing_s - 1.0).abs() > ANOTHER && agrees(*better_s, ONES_OF_KNOWN)
            });
            return better_s.or(Some(standing_s));
        }
        let ones = if steps_s.len() >= ENOUGH { ONES_OF_MANY } else { ONES };
        let mean_s = steps_s.iter().sum::<f64>() / steps_s.len().max(1) as f64;
        let comes_as_often = (mean_s / standing_s - 1.0).abs() <= CLOSE;
        let candidates = seeds(&steps_s).into_iter().filter_map(|seed_s| {
            let period_s = self.refined(seed_s, &steps_s)?;
            let agreement = agreement(period_s);
            let is_uneven = comes_as_often && 1.0 - period_s / mean_s >= MOSTLY;
            (self.may_be(period_s) && !is_uneven && agreement.is_enough(ones))
                .then_some((agreement.ones, period_s))
        });
        let best = candidates.max_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
        best.map(|(_, period_s)| period_s)
    }

    /// How many periods a step is, if it is a multiple.
    fn near(&self, step_s: f64, period_s: f64) -> Option<u64> {
        let times = (step_s / period_s).round().max(1.0);
        let near_s = (NEAR * period_s).max(self.tick_s * 1.001);
        ((step_s - times * period_s).abs() <= near_s).then_some(times as u64)
    }

    /// How many steps are multiples of a period.
    fn agreement(&self, period_s: f64, steps_s: &[f64]) -> Agreement {
        let (mut ones, mut multiples) = (0.0, 0.0);
        for times in steps_s.iter().filter_map(|step_s| self.near(*step_s, period_s)) {
            multiples += 1.0;
            ones += f64::from(times == 1);
        }
        let count = steps_s.len().max(1) as f64;
        Agreement { ones: ones / count, multiples: multiples / count }
    }

    /// The mean of the steps that are near one, and so on.
    fn refined(&self, seed_s: f64, steps_s: &[f64]) -> Option<f64> {
        let mut period_s = seed_s;
        for _ in 0..4 {
            let is_one = |step_s: &&f64| self.near(**step_s, period_s) == Some(1);
            let (mut sum_s, mut count) = (0.0, 0.0);
            for step_s in steps_s.iter().filter(is_one) {
                (sum_s, count) = (sum_s + step_s, count + 1.0);
            }
            if count == 0.0 {
                return None;
            }
            period_s = sum_s / count;
        }
        Some(period_s)
    }
}

/// Parts of some steps that are one period, and any multiple of it.
struct Agreement {
    ones: f64,
    multiples: f64,
}

impl Agreement {
    fn is_enough(&self, ones: f64) -> bool {
        self.ones >= ones && self.multiples >= MULTIPLES
    }
}

/// A step as one of a single sample, where a counter tells how many it is of.
fn of_one(stride: Stride) -> Option<Stride> {
    let counted = stride.counted.unwrap_or(1);
    let is_usable = stride.step_s.is_finite() && stride.step_s > 0.0;
    (is_usable && (1..=MOST_BETWEEN).contains(&counted))
        .then_some(Stride { step_s: stride.step_s / counted as f64, ..stride })
}

/// What is missing in several steps.
fn all_missing(strides: &[Stride], period_s: f64) -> Missing {
    strides.iter().fold(Missing::default(), |all, stride| all.and(missing(stride, period_s)))
}

/// What is missing in a step.
fn missing(stride: &Stride, period_s: f64) -> Missing {
    let times = (stride.step_s / period_s).round().max(1.0) as u64;
    let samples = (times - 1).saturating_sub(stride.came);
    Missing { samples, gaps: u64::from(samples > 0) }
}

/// Where periods are looked for among steps in order of length.
fn seeds(steps_s: &[f64]) -> Vec<f64> {
    let count = steps_s.len();
    let mean_s = |part: &[f64]| part.iter().sum::<f64>() / part.len().max(1) as f64;
    let mut seeds: Vec<f64> = (0..8).map(|part| steps_s[part * count / 8]).collect();
    seeds.extend([mean_s(&steps_s[..(count * 3).div_ceil(4)]), mean_s(steps_s)]);
    seeds
}

#[cfg(test)]
mod tests;
