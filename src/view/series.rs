//! Numbers over time in few bytes: whole multiples of a step, told by how they change.
//!
//! A value is `start + step * x` with a whole x. Of x the differences are kept, or the differences of
//! these, whichever takes less; the sign goes into the lowest bit (0, -1, 1, -2, ... are 0, 1, 2, 3, ...), and
//! blocks of 32 are Rice codes: five bits for k, then of each number its part above bit k in ones that end with
//! a zero, and its k lower bits. A block whose k is 31 is all zeros and has no more. Bits go into bytes from the
//! highest down, bytes into base64 (RFC 4648).
//! R. F. Rice, "Some practical universal noiseless coding techniques", JPL Publication 79-22, 1979.
//!
//! Goals of retargeted motions take two bits a sample so, angles as servos measure them two to three: as much as
//! deflate makes of the same differences in bytes, without a library on either side.

use serde::Serialize;

/// Numbers in a block.
const BLOCK: usize = 32;
/// The k of a block of zeros.
const ZEROS: u32 = 31;
/// Multiples beyond this are gaps: every code then fits into 32 bits.
const MOST: f64 = (1_u64 << 26) as f64;

/// One quantity, sample by sample.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Coded {
    /// Samples.
    count: usize,
    /// The first value.
    start: f64,
    /// What values are multiples of, from the first on.
    step: f64,
    /// Differences, or differences of differences.
    order: u8,
    /// First sample and number of samples of each gap; in between a value is repeated.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    gaps: Vec<[usize; 2]>,
    /// The codes.
    bits: String,
}

impl Coded {
    /// Values rounded to multiples of `quantum`; those that are not finite, or further than 2^26 multiples from
    /// zero, are gaps.
    #[must_use]
    pub fn of(values: impl IntoIterator<Item = f64>, quantum: f64) -> Self {
        let mut gaps: Vec<[usize; 2]> = Vec::new();
        let mut whole: Vec<i64> = Vec::new();
        for value in values {
            let multiple = (value / quantum).round();
            if multiple.abs() <= MOST {
                // The beginning of a series that begins with a gap is level.
                if gaps.last().is_some_and(|gap| *gap == [0, whole.len()]) {
                    whole.fill(multiple as i64);
                }
                whole.push(multiple as i64);
                continue;
            }
            match gaps.last_mut().filter(|gap| gap[0] + gap[1] == whole.len()) {
                Some(gap) => gap[1] += 1,
                None => gaps.push([whole.len(), 1]),
            }
            whole.push(whole.last().copied().unwrap_or(0));
        }
        let first = whole.first().copied().unwrap_or(0);
        let away = || whole.iter().map(|multiple| multiple - first);
        let step = away().fold(0, |step, off| divisor(step, off.unsigned_abs())).max(1);
        let steps: Vec<i64> = away().map(|off| off / step as i64).collect();
        let changes = folded(&differences(&steps));
        let bends = folded(&differences(&differences(&steps)));
        let order = if cost(&changes) <= cost(&bends) { 1 } else { 2 };
        let mut bits = Bits::default();
        for block in [changes, bends][order - 1].chunks(BLOCK) {
            bits.block(block);
        }
        Self {
            count: steps.len(),
            start: first as f64 * quantum,
            step: step as f64 * quantum,
            order: order as u8,
            gaps,
            bits: bits.base64(),
        }
    }

    /// Samples.
    #[must_use]
    pub const fn count(&self) -> usize {
        self.count
    }

    /// The values, as they were rounded; gaps are not numbers.
    #[must_use]
    pub fn values(&self) -> Vec<f64> {
        let mut codes = Vec::with_capacity(self.count);
        let mut bits = Digits::of(&self.bits);
        while codes.len() < self.count {
            let k = bits.take(5);
            for _ in 0..BLOCK.min(self.count - codes.len()) {
                codes.push(if k == ZEROS { 0 } else { bits.code(k) });
            }
        }
        let (mut at, mut slope) = (0_i64, 0_i64);
        let values = codes.iter().map(|code| {
            let change = i64::from(code >> 1) ^ -i64::from(code & 1);
            slope = if self.order == 1 { change } else { slope + change };
            at += slope;
            self.start + self.step * at as f64
        });
        let mut values: Vec<f64> = values.collect();
        for [begin, length] in &self.gaps {
            values[*begin..begin + length].fill(f64::NAN);
        }
        values
    }
}

/// Bits of a text in base64, from the highest down; zeros behind its end.
struct Digits<'a> {
    digits: std::slice::Iter<'a, u8>,
    /// Bits that were not taken, the next ones highest, and how many.
    rest: u64,
    held: u32,
}

impl<'a> Digits<'a> {
    fn of(text: &'a str) -> Self {
        Self { digits: text.as_bytes().iter(), rest: 0, held: 0 }
    }

    /// At most 32 bits at a time.
    fn take(&mut self, bits: u32) -> u32 {
        while self.held < bits {
            let digit = match self.digits.next() {
                Some(letter @ b'A'..=b'Z') => letter - b'A',
                Some(letter @ b'a'..=b'z') => letter - b'a' + 26,
                Some(number @ b'0'..=b'9') => number - b'0' + 52,
                Some(b'+') => 62,
                Some(b'/') => 63,
                _ => 0,
            };
            self.rest = (self.rest << 6) | u64::from(digit);
            self.held += 6;
        }
        self.held -= bits;
        let taken = self.rest >> self.held;
        self.rest &= (1 << self.held) - 1;
        taken as u32
    }

    /// A Rice code.
    fn code(&mut self, k: u32) -> u32 {
        let mut above = 0_u32;
        // No code of a value within reach is as long.
        while above < u32::MAX >> k && self.take(1) == 1 {
            above += 1;
        }
        (above << k) | self.take(k)
    }
}

/// Greatest common divisor.
fn divisor(mut one: u64, mut two: u64) -> u64 {
    while two != 0 {
        (one, two) = (two, one % two);
    }
    one
}

/// Each less the one before, the first less zero.
fn differences(values: &[i64]) -> Vec<i64> {
    let before = std::iter::once(&0).chain(values);
    values.iter().zip(before).map(|(value, before)| value - before).collect()
}

/// The sign in the lowest bit.
fn folded(values: &[i64]) -> Vec<u32> {
    values.iter().map(|value| ((value << 1) ^ (value >> 63)) as u32).collect()
}

/// The best k of a block, and the bits it takes.
fn best(block: &[u32]) -> (u32, u64) {
    if block.iter().all(|code| *code == 0) {
        return (ZEROS, 0);
    }
    let takes =
        |k: u32| -> u64 { block.iter().map(|code| u64::from(code >> k) + 1 + u64::from(k)).sum() };
    let sum: u64 = block.iter().map(|code| u64::from(*code)).sum();
    // Near the logarithm of the mean.
    let near = (sum / block.len() as u64).max(1).ilog2();
    let tried = near.saturating_sub(2)..=(near + 1).min(ZEROS - 1);
    tried.map(|k| (k, takes(k))).min_by_key(|(_, bits)| *bits).unwrap_or((ZEROS - 1, u64::MAX))
}

fn cost(codes: &[u32]) -> u64 {
    codes.chunks(BLOCK).map(|block| 5 + best(block).1).sum()
}

#[derive(Default)]
struct Bits {
    bytes: Vec<u8>,
    /// Bits that make no byte yet, the last ones lowest, and how many.
    rest: u64,
    held: u32,
}

impl Bits {
    /// At most 32 bits at a time.
    fn push(&mut self, value: u64, bits: u32) {
        self.rest = (self.rest << bits) | value;
        self.held += bits;
        while self.held >= 8 {
            self.held -= 8;
            self.bytes.push((self.rest >> self.held) as u8);
        }
        self.rest &= (1 << self.held) - 1;
    }

    fn block(&mut self, block: &[u32]) {
        let (k, _) = best(block);
        self.push(k.into(), 5);
        if k == ZEROS {
            return;
        }
        for code in block {
            let mut ones = code >> k;
            while ones >= 32 {
                self.push(u32::MAX.into(), 32);
                ones -= 32;
            }
            self.push((1 << ones) - 1, ones);
            self.push(0, 1);
            self.push(u64::from(*code) & ((1 << k) - 1), k);
        }
    }

    fn base64(mut self) -> String {
        if self.held > 0 {
            self.push(0, 8 - self.held);
        }
        const DIGITS: &[u8; 64] =
            b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
        let mut text = String::with_capacity(self.bytes.len().div_ceil(3) * 4);
        for three in self.bytes.chunks(3) {
            let at = |index: usize| u32::from(three.get(index).copied().unwrap_or(0));
            let bits = at(0) << 16 | at(1) << 8 | at(2);
            for digit in 0..4 {
                let shown = digit <= three.len();
                let digit = DIGITS[(bits >> (18 - 6 * digit)) as usize & 63];
                text.push(if shown { char::from(digit) } else { '=' });
            }
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Reads a series as the head of this file says, by nothing that wrote it.
    fn read(coded: &Coded) -> Vec<f64> {
        let digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
        let digit = |c: char| digits.find(c).unwrap_or(0);
        let bits: Vec<bool> = coded
            .bits
            .chars()
            .flat_map(|c| (0..6).rev().map(move |bit| digit(c) >> bit & 1 == 1))
            .collect();
        let mut bits = bits.into_iter();
        let whole = |count: u32, bits: &mut dyn Iterator<Item = bool>| {
            (0..count).fold(0_u64, |value, _| value << 1 | u64::from(bits.next().unwrap()))
        };
        let mut codes = Vec::new();
        while codes.len() < coded.count {
            let k = whole(5, &mut bits) as u32;
            for _ in 0..(coded.count - codes.len()).min(32) {
                if k == 31 {
                    codes.push(0);
                    continue;
                }
                let ones = bits.by_ref().take_while(|bit| *bit).count() as u64;
                codes.push(ones << k | whole(k, &mut bits));
            }
        }
        let mut sums: Vec<i64> = codes
            .iter()
            .map(|code| (code >> 1) as i64 * if code & 1 == 1 { -1 } else { 1 } - (code & 1) as i64)
            .collect();
        for _ in 0..coded.order {
            let mut sum = 0;
            for value in &mut sums {
                sum += *value;
                *value = sum;
            }
        }
        let mut values: Vec<f64> =
            sums.iter().map(|x| coded.start + coded.step * *x as f64).collect();
        for [from, count] in &coded.gaps {
            values[*from..from + count].fill(f64::NAN);
        }
        values
    }

    proptest! {
        #[test]
        fn what_is_read_is_what_was_written_to_half_a_step(
            values in prop::collection::vec(
                prop_oneof![8 => -3.0..3.0_f64, 1 => Just(f64::NAN), 1 => -1e9..1e9_f64], 0..300),
        ) {
            let quantum = 1e-3;
            let coded = Coded::of(values.iter().copied(), quantum);
            let read = read(&coded);
            let own = coded.values();
            prop_assert!(own.iter().map(|value| value.to_bits()).eq(read.iter().map(|value| value.to_bits())));
            prop_assert_eq!(read.len(), values.len());
            for (read, value) in read.iter().zip(&values) {
                if value.abs() <= MOST * quantum {
                    prop_assert!((read - value).abs() <= quantum * 0.501 + 1e-9 * value.abs());
                } else {
                    prop_assert!(read.is_nan(), "{} of {}", read, value);
                }
            }
        }
    }

    #[test]
    fn a_series_that_stands_still_takes_five_bits_a_block() {
        let still = Coded::of(vec![0.7; 32_000], 1e-4);
        assert_eq!(still.bits.len(), (1000_usize * 5).div_ceil(24) * 4);
        assert!(read(&still).iter().all(|value| (value - 0.7).abs() < 1e-12));
    }

    #[test]
    fn a_gap_at_the_start_costs_nothing() {
        let mut values = vec![f64::NAN; 64];
        values.extend([2.0; 64]);
        let coded = Coded::of(values.clone(), 1.0);
        assert_eq!(coded.gaps, [[0, 64]]);
        assert_eq!((coded.start, coded.bits.len()), (2.0, 4));
        assert!(read(&coded).iter().zip(&values).all(|(a, b)| a == b || a.is_nan() && b.is_nan()));
    }

    /// A servo of 4096 counts a turn under a sine of a walk, with noise of a count, beside its goal.
    #[test]
    fn ten_minutes_of_sixty_joints_at_100_hz_fit_into_eight_megabytes() {
        let mut state = 1_u32;
        let mut noise = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(state >> 8) / f64::from(1 << 24) - 0.5
        };
        let count = std::f64::consts::TAU / 4096.0;
        let angle =
            |n: i32| 0.6 * (f64::from(n) * 0.01 * 5.2).sin() + 0.2 * (f64::from(n) * 0.163).cos();
        let goal = Coded::of((0..60_000).map(angle), super::super::ANGLE_RAD);
        let present = (0..60_000).map(|n| ((angle(n - 3) / count) + 1.5 * noise()).round() * count);
        let present = Coded::of(present, super::super::ANGLE_RAD);
        let bytes = 60 * (goal.bits.len() + present.bits.len());
        assert!(bytes < 7_000_000, "{bytes}: {} {}", goal.bits.len(), present.bits.len());
        assert!(present.step > 7.9 * super::super::ANGLE_RAD, "it is told in counts");
    }
}
