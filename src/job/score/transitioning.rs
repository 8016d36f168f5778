//! From one action to the next: half a second is cut out where it is known, and made again of what is before and behind it;
//! and put between a trial of the one and a trial of the other, where somebody did both, one after the other.

use super::motions::{
    ANGLES, FeatureKept, Held, Judging, MotionScore, MotionScoreOrder, apart_mm, mean,
    mean_interval, turned,
};
use super::people::Split;
use crate::body::Proportions;
use crate::corpus::rows::LabelEntry;
use crate::error::Error;
use crate::job::Observer;
use crate::job::pending::go_on;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeMap;

/// What is cut out of a motion and made again, s.
const GAP_S: f64 = 0.5;
/// Cuts in a trial.
const CUTS: usize = 3;
/// Frames of each side by which the like of it is found in another trial.
const ALIKE: usize = 6;

/// From a motion to the one after it, over a gap that is known.
///
/// # Errors
/// As [`super::motions::generalisation`].
pub fn transitioning(
    order: &MotionScoreOrder,
    observer: &dyn Observer,
) -> Result<MotionScore, Error> {
    let mut judging = Judging::of(order)?;
    let trials = std::mem::take(&mut judging.trials);
    let labels = judging.labels()?;
    let split = judging.split.clone();
    let mut report = judging.report(
        "transitioning",
        ("half a second of each trial that is cut out, of A before it and B after it", "mm"),
    );
    let mut random = ChaCha8Rng::seed_from_u64(order.seed);
    let mut errors: [Vec<f64>; 4] = Default::default();
    let mut by_class: BTreeMap<String, Vec<f64>> = BTreeMap::new();
    for held in trials.iter().filter(|held| split.judges(&held.entry)) {
        go_on(observer)?;
        let gap = (GAP_S * held.entry.rate_hz).round() as usize;
        if gap < 4 || held.frames() < 3 * gap {
            report.pass_over("shorter than three gaps", 1);
            continue;
        }
        let body = Proportions::of_stature(held.entry.body_stature_m)?;
        for _ in 0..CUTS {
            let from = random.random_range(2..held.frames() - gap - 2);
            let made = across(held, from, gap);
            let truth: Vec<Vec<f64>> = (from..from + gap).map(|at| frame(held, at)).collect();
            errors[3].push(apart_mm(&body, &best_between(&made[1], &made[0], &truth), &truth));
            for (errors, made) in errors.iter_mut().zip(&made) {
                errors.push(apart_mm(&body, made, &truth));
            }
            let own = by_class.entry(held.entry.action.clone()).or_default();
            own.extend(errors[0].last());
        }
        report.judged += 1;
    }
    if report.judged > 0 {
        let what =
            ["a blend of half a second: A stands still, B stands still, mixed", "A stands still"];
        report.tell(&errors[0], what.into_iter().zip(&errors[1..]));
        report.bound = Some((
            "each signal from the blend to the cubic, or as far beyond, as who knows the truth wants it",
            mean(&errors[3]),
        ));
        report.per_class =
            by_class.iter().map(|(class, errors)| (class.clone(), mean(errors))).collect();
    }
    put_together(&trials, &labels, &split, &mut report)?;
    Ok(report)
}

fn frame(held: &Held, at: usize) -> Vec<f64> {
    held.frames.signals.iter().map(|of| f64::from(of[at])).collect()
}

/// What is put into a gap: with the speeds of both sides; a blend; and the last pose.
fn across(held: &Held, from: usize, gap: usize) -> [Vec<Vec<f64>>; 3] {
    between([from - 2, from - 1, from + gap, from + gap + 1].map(|at| frame(held, at)), gap)
}

/// Each signal as far from one to the other, or up to as far beyond it, as brings it nearest to the truth.
fn best_between(one: &[Vec<f64>], other: &[Vec<f64>], truth: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let share = |signal: usize| {
        let (mut along, mut square) = (0.0, 1e-12);
        for ((one, other), own) in one.iter().zip(other).zip(truth) {
            let way = other[signal] - one[signal];
            along += way * turned(one[signal], own[signal]);
            square += way * way;
        }
        f64::clamp(along / square, 0.0, 2.0)
    };
    let shares: Vec<f64> = (0..one.first().map_or(0, Vec::len)).map(share).collect();
    let row = |(one, other): (&Vec<f64>, &Vec<f64>)| {
        let signals = one.iter().zip(other).zip(&shares);
        signals.map(|((one, other), share)| one + share * (other - one)).collect()
    };
    one.iter().zip(other).map(row).collect()
}

/// The same between any two frames before and two behind it.
fn between([before, a, b, after]: [Vec<f64>; 4], gap: usize) -> [Vec<Vec<f64>>; 3] {
    let steps = (gap + 1) as f64;
    let rows = |of: &dyn Fn(usize, f64) -> f64| -> Vec<Vec<f64>> {
        let row = |step: usize| (0..a.len()).map(|n| of(n, step as f64 / steps)).collect();
        (1..=gap).map(row).collect()
    };
    let smooth = |u: f64| u * u * (3.0 - 2.0 * u);
    let with_speed = |n: usize, u: f64| {
        // The cubic with the angles and speeds of both ends (Hermite).
        let (from, to) = ((a[n] - before[n]) * steps, (after[n] - b[n]) * steps);
        let own = a[n] + (b[n] - a[n]) * smooth(u);
        own + from * u * (1.0 - u).powi(2) - to * u * u * (1.0 - u)
    };
    [rows(&with_speed), rows(&|n, u| a[n] + (b[n] - a[n]) * smooth(u)), rows(&|n, _| a[n])]
}

/// Half a second of somebody who goes from one action to another, made of a trial of each alone.
struct Composed {
    /// Both going on while one fades into the other; and a blend between the poses in which they stand still.
    made: [Vec<Vec<f64>>; 2],
    truth: Vec<Vec<f64>>,
    /// Whether it turns no joint faster than the trials it is made of do anywhere.
    is_feasible: [bool; 2],
}

/// Where one action ends and the other begins, in a trial of both, by its labels.
fn change(labels: &[LabelEntry], one: &str, other: &str) -> Option<usize> {
    let end = labels.iter().filter(|of| of.label == one).map(|of| of.last_frame).max()?;
    let begin = labels.iter().filter(|of| of.label == other).map(|of| of.first_frame).min()?;
    usize::try_from(end.saturating_add(begin) / 2).ok()
}

/// The frame of some trials whose angles, and those of the frames about it, are nearest to what is looked for; with room for
/// a gap before or behind it.
fn alike<'a>(
    trials: &[&'a Held],
    wanted: &[Vec<f64>],
    room: (usize, usize),
) -> Option<(&'a Held, usize)> {
    let mut best: Option<(f64, &Held, usize)> = None;
    for held in trials {
        let last = (held.frames() + 1).saturating_sub(wanted.len() + room.1);
        for at in room.0..last {
            let square = |(n, wanted): (usize, &Vec<f64>)| -> f64 {
                let own = held.frames.signals[..ANGLES].iter().zip(wanted);
                own.map(|(own, wanted)| turned(*wanted, f64::from(own[at + n])).powi(2)).sum()
            };
            let apart: f64 = wanted.iter().enumerate().map(square).sum();
            if best.is_none_or(|(least, ..)| apart < least) {
                best = Some((apart, held, at));
            }
        }
    }
    best.map(|(_, held, at)| (held, at))
}

/// A frame of another trial, with its angles as near as whole turns bring them, on the root and the pelvis of the truth.
fn brought(of: &Held, at: usize, truth: &[f64]) -> Vec<f64> {
    let mut row = truth.to_vec();
    for (own, signal) in row[..ANGLES].iter_mut().zip(&of.frames.signals) {
        *own += turned(*own, f64::from(signal[at]));
    }
    row
}

/// The fastest that an angle turns in a trial, rad a frame.
fn fastest(of: &Held, signal: usize) -> f64 {
    let steps = of.frames.signals[signal].windows(2);
    steps.map(|pair| turned(f64::from(pair[0]), f64::from(pair[1])).abs()).fold(0.0, f64::max)
}

/// A trial of both, made of one of each: which frames of them, and the root and pelvis of each frame, are given.
fn composed(
    held: &Held,
    middle: usize,
    gap: usize,
    one: &[&Held],
    other: &[&Held],
) -> Option<Composed> {
    let from = middle.checked_sub(gap / 2)?;
    let to = from + gap;
    if from < ALIKE + 1 || to + ALIKE + 1 > held.frames() {
        return None;
    }
    let rows = |from: usize, to: usize| (from..to).map(|at| frame(held, at)).collect::<Vec<_>>();
    let (a, a_at) = alike(one, &rows(from - ALIKE, from), (0, gap))?;
    let (b, b_at) = alike(other, &rows(to, to + ALIKE), (gap, 0))?;
    let (a_last, truth) = (a_at + ALIKE - 1, rows(from, to));
    let ends = [
        brought(a, a_last - 1, &frame(held, from - 2)),
        brought(a, a_last, &frame(held, from - 1)),
        brought(b, b_at, &frame(held, to)),
        brought(b, b_at + 1, &frame(held, to + 1)),
    ];
    let [_, mut blend, _] = between(ends, gap);
    // With the speeds of both sides instead, a change from a walk into a run is 78 mm off in place of 53: a step is lost.
    let mut made: Vec<Vec<f64>> = Vec::with_capacity(gap);
    for (step, own) in truth.iter().enumerate() {
        let u = (step + 1) as f64 / (gap + 1) as f64;
        let (mut row, b) = (brought(a, a_last + 1 + step, own), brought(b, b_at - gap + step, own));
        for (one, other) in row[..ANGLES].iter_mut().zip(&b) {
            *one += turned(*one, *other) * u * u * (3.0 - 2.0 * u);
        }
        made.push(row);
    }
    for (row, own) in blend.iter_mut().zip(&truth) {
        row[ANGLES..].copy_from_slice(&own[ANGLES..]);
    }
    let most: Vec<f64> = (0..ANGLES).map(|n| fastest(a, n).max(fastest(b, n))).collect();
    let is_feasible = [&made, &blend].map(|rows| {
        rows.windows(2)
            .all(|pair| (0..ANGLES).all(|n| turned(pair[0][n], pair[1][n]).abs() <= most[n] + 1e-9))
    });
    Some(Composed { made: [made, blend], truth, is_feasible })
}

/// Judges trials whose action is called `walk>kick`, of those called `walk` and `kick`, where labels say when one ends and the
/// other begins.
fn put_together(
    trials: &[Held],
    labels: &BTreeMap<String, Vec<LabelEntry>>,
    split: &Split,
    report: &mut MotionScore,
) -> Result<(), Error> {
    let mut errors: [Vec<f64>; 2] = Default::default();
    let mut feasible: [Vec<f64>; 2] = Default::default();
    for held in trials.iter().filter(|held| split.judges(&held.entry)) {
        let Some((one, other)) = held.entry.action.split_once('>') else { continue };
        let alone = |name: &str| -> Vec<&Held> {
            let is_it =
                |of: &&Held| of.entry.action == name && of.entry.rate_hz == held.entry.rate_hz;
            trials.iter().filter(is_it).filter(|of| split.lends(&of.entry)).collect()
        };
        let own = labels.get(&held.entry.trial).map_or(&[][..], Vec::as_slice);
        let Some(middle) = change(own, one, other) else {
            report.pass_over("nobody labelled where one action ends and the next begins", 1);
            continue;
        };
        let (one, other) = (alone(one), alone(other));
        let gap = (GAP_S * held.entry.rate_hz).round() as usize;
        let Some(composed) = composed(held, middle, gap, &one, &other) else {
            report.pass_over("no trial of each action alone, at its rate and long enough", 1);
            continue;
        };
        let body = Proportions::of_stature(held.entry.body_stature_m)?;
        for (way, made) in composed.made.iter().enumerate() {
            errors[way].push(apart_mm(&body, made, &composed.truth));
            feasible[way].push(if composed.is_feasible[way] { 100.0 } else { 0.0 });
        }
    }
    if errors[0].is_empty() {
        return Ok(());
    }
    let feature = |what, unit, [own, blend]: &[Vec<f64>; 2]| FeatureKept {
        what,
        unit,
        value: Some(mean(own)),
        interval: (own.len() > 1).then(|| mean_interval(own, report.seed)),
        baseline: Some(mean(blend)),
    };
    report.features = vec![
        feature("A>B of trials of A and of B, which fade, off; both standing still", "mm", &errors),
        feature("of these, no joint faster than in both trials", "%", &feasible),
    ];
    Ok(())
}
