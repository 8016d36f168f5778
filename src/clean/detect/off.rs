//! Markers that are not where their neighbours say: jumps, jerks, shaking, and what fell off.

use super::super::artefact::{Artefact, ArtefactKind, Cause};
use super::super::neighbours::Neighbour;
use super::super::trial::{Trial, runs};
use super::expectation::{Expectation, median};
use glam::DVec3;
use nalgebra::Matrix2;
use std::f64::consts::TAU;
use std::ops::Range;

/// Least step of a jump, m, and how many usual steps.
const STEP_M: f64 = 0.01;
const STEPS: f64 = 10.0;
/// How many times as long as those in so many frames before and after.
const ALONE: f64 = 4.0;
const AROUND: usize = 5;
/// Longest jump that is told by its two steps, s; and the longest that is a jerk.
const LONGEST_S: f64 = 1.0;
const JERK_S: f64 = 0.05;
/// How far the second step may miss to be the way back, as a share of the first.
const BACK: f64 = 0.4;
/// Frames beside a jump with which it is compared, and the share of the step by which it must differ in between.
const BESIDE: usize = 5;
const FEWEST_BESIDE: usize = 3;
const HELD: f64 = 0.5;
/// Half the time over which slow motion is fitted, s.
const SMOOTHED_S: f64 = 0.07;
/// Time over which shaking is judged, s, its least strength, m, and how many times the usual.
const SHAKEN_S: f64 = 0.24;
const SHAKE_M: f64 = 0.0015;
const SHAKES: f64 = 5.5;
/// Turns of direction in that time.
const TURNS: usize = 3;
/// Fewest frames a second in which it can be told from fast motion.
const LEAST_RATE_HZ: f64 = 50.0;
/// Slowest shaking, Hz: what is slower may be a person.
const SLOWEST_HZ: f64 = 7.0;
/// How much stronger steps and shaking must be than what the neighbours do at the same time.
const AGITATED: f64 = 2.5;
const SHAKEN_BY: f64 = 2.0;
/// Shaking that is as regular as a wave may be weaker: its least strength, m, how many times the usual, how much more than
/// what the neighbours do, and the share of it that one wave explains.
const WAVE_M: f64 = 0.0025;
const WAVES: f64 = 2.0;

const WAVE_BY: f64 = 1.0;
const REGULAR: f64 = 0.75;
/// Waves that are tried, Hz, from the slowest shaking to this, in such steps; the slowest that counts, because a limb that
/// lands is slower; and the longest time in which one wave is looked for, s.
const SLOWEST_WAVE_HZ: f64 = 9.0;
const QUICKEST_HZ: f64 = 32.0;
const STEP_HZ: f64 = 1.0;
const WAVE_S: f64 = 0.3;
/// A neighbour that trembles by this share as strongly, and so much alike (as a correlation), is of the same limb.
const LEAST_SHARED: f64 = 0.25;
const ALIKE: f64 = 0.6;
/// Neighbours whose distances must show what is off, too, and how much of it.
const WITNESSES: usize = 5;
const SHOWN: f64 = 0.45;
/// What is added to how much distances vary, m, over time and from frame to frame.
const SLOW_M: f64 = 0.001;
const QUICK_M: f64 = 2e-4;
/// What was found at one marker.
#[derive(Debug)]
pub(super) struct Found {
    /// What is wrong.
    pub(super) artefacts: Vec<Artefact>,
    /// How far beyond what is allowed the worst of it is.
    pub(super) score: f64,
    /// True if it changes place suddenly, whether or not it comes back.
    pub(super) is_sudden: bool,
}

/// What is wrong with a marker by its neighbours `near`.
pub(super) fn off(trial: &Trial, marker: usize, near: &[Neighbour]) -> Found {
    let mut expectation = Expectation::new(trial, marker, near, None);
    let off = expectation.off(trial);
    let signal = Signal::of(trial, marker, off, &expectation.near);
    let (steps, shakes) = (signal.steps(), signal.shakes());
    let is_sudden = (1..signal.off.len()).any(|frame| signal.is_jump(frame));
    // What shakes hard steps to and fro, and one jump looks like shaking to those that watch for it.
    let within = |step: &Artefact, shake: &Artefact| {
        step.frames.start < shake.frames.end && shake.frames.start < step.frames.end
    };
    let is_shaken =
        |shake: &Artefact| steps.iter().filter(|(step, _)| within(step, shake)).count() != 1;
    let shakes: Vec<_> = shakes.into_iter().filter(|(shake, _)| is_shaken(shake)).collect();
    let is_alone =
        |step: &Artefact| !shakes.iter().any(|(shake, _): &(Artefact, f64)| within(step, shake));
    let mut found: Vec<_> = steps.iter().filter(|(step, _)| is_alone(step)).cloned().collect();
    found.extend(shakes);
    let score = found.iter().map(|(_, score)| *score).fold(0.0, f64::max);
    let artefacts = found
        .into_iter()
        .map(|(mut artefact, score)| {
            artefact.confidence = 1.0 - 0.5 / score.max(1.0);
            artefact
        })
        .collect();
    Found { artefacts, score, is_sudden }
}

/// By how much a marker is off over time.
struct Signal<'a> {
    trial: &'a Trial,
    marker: usize,
    near: Vec<usize>,
    /// The most constant of them.
    witnesses: Vec<Neighbour>,
    off: Vec<Option<DVec3>>,
    /// How suddenly its neighbours move in each frame, m.
    agitation_m: Vec<f64>,
    /// Least step that is a jump, m.
    step_m: f64,
}

impl<'a> Signal<'a> {
    fn of(trial: &'a Trial, marker: usize, off: Vec<Option<DVec3>>, near: &[Neighbour]) -> Self {
        let witnesses = near.iter().take(WITNESSES).copied().collect();
        let near: Vec<usize> = near.iter().map(|of| of.marker).collect();
        let agitation_m = (0..trial.frames()).map(|frame| agitation(trial, &near, frame)).collect();
        let steps = off.windows(2).filter_map(|pair| Some((pair[1]? - pair[0]?).length()));
        let usual_step = median(steps).unwrap_or(0.0);
        Self {
            trial,
            marker,
            near,
            witnesses,
            off,
            agitation_m,
            step_m: STEP_M.max(STEPS * usual_step),
        }
    }

    fn at(&self, frame: usize) -> Option<DVec3> {
        self.off.get(frame).copied().flatten()
    }

    /// The step into a frame.
    fn step(&self, frame: usize) -> Option<DVec3> {
        Some(self.at(frame)? - self.at(frame.checked_sub(1)?)?)
    }

    /// True of a step that is long, and long among those around it: fast motion has no single one.
    fn is_jump(&self, frame: usize) -> bool {
        let Some(step) = self.step(frame).map(|step| step.length()) else { return false };
        let around = (frame.saturating_sub(AROUND)..=frame + AROUND).filter(|of| *of != frame);
        let usual = median(around.filter_map(|of| self.step(of)).map(|of| of.length()));
        step > self
            .step_m
            .max(ALONE * usual.unwrap_or(0.0))
            .max(AGITATED * self.agitation(frame, 2))
    }

    /// How suddenly the neighbours move around a frame, m.
    fn agitation(&self, frame: usize, reach: usize) -> f64 {
        let around = self.agitation_m.get(frame.saturating_sub(reach)..);
        around.unwrap_or_default().iter().take(2 * reach + 1).copied().fold(0.0, f64::max)
    }

    /// True if it is elsewhere between two steps, by about as much as the first, and if distances say so, too.
    fn is_held(&self, run: &Range<usize>, away: DVec3) -> bool {
        let middle = |frames: Range<usize>| -> Option<DVec3> {
            let seen: Vec<DVec3> = frames.filter_map(|frame| self.at(frame)).collect();
            if seen.len() < FEWEST_BESIDE {
                return None;
            }
            let axis = |axis: usize| median(seen.iter().map(|of| of[axis]));
            Some(DVec3::new(axis(0)?, axis(1)?, axis(2)?))
        };
        let beside = [run.start.saturating_sub(BESIDE)..run.start, run.end..run.end + BESIDE];
        let [before, after] = beside.clone().map(middle);
        let inside = || {
            let seen: Vec<DVec3> = run.clone().filter_map(|frame| self.at(frame)).collect();
            let axis = |axis: usize| median(seen.iter().map(|of| of[axis]));
            Some(DVec3::new(axis(0)?, axis(1)?, axis(2)?))
        };
        let (Some(inside), Some(before), Some(after)) = (inside(), before, after) else {
            return false;
        };
        let off = inside - (before + after) / 2.0;
        if off.dot(away) <= HELD * away.length_squared() {
            return false;
        }
        let shown = |of: &Neighbour| {
            let distance = |frame: usize| -> Option<f64> {
                Some(self.trial.at(self.marker, frame)?.distance(self.trial.at(of.marker, frame)?))
            };
            let [before, after] = beside.clone().map(|frames| median(frames.filter_map(distance)));
            let usual = (before? + after?) / 2.0;
            let changes = run.clone().filter_map(|frame| {
                let place = self.trial.at(self.marker, frame)?;
                let other = self.trial.at(of.marker, frame)?;
                let expected = place.distance(other) - (place - off).distance(other);
                Some((expected, place.distance(other) - usual))
            });
            Some(Shown::of(changes, of.spread_m + SLOW_M))
        };
        self.is_shown(shown)
    }

    /// True if the most constant distances show what is off: a marker that is elsewhere is so for all, while a pose that
    /// the neighbours did not show before moves what they expect, and no distance. Whoever is left out, the others say so.
    fn is_shown(&self, shown: impl Fn(&Neighbour) -> Option<Shown>) -> bool {
        let all: Vec<Shown> = self.witnesses.iter().filter_map(shown).collect();
        let share = |without: Option<usize>| {
            let others =
                || all.iter().enumerate().filter(|(at, _)| Some(*at) != without).map(|(_, of)| of);
            let expected: f64 = others().map(|of| of.expected).sum();
            // What moves across all distances, none of them can show.
            if expected < others().count() as f64 {
                return 1.0;
            }
            others().map(|of| of.seen).sum::<f64>() / expected
        };
        share(None) > SHOWN && (0..all.len()).all(|without| share(Some(without)) > SHOWN / 2.0)
    }

    fn artefact(&self, kind: ArtefactKind, cause: Cause, frames: Range<usize>) -> Artefact {
        let marker = self.marker;
        Artefact { kind, marker, with: None, frames, cause: Some(cause), confidence: 0.0 }
    }

    fn kind(&self, run: &Range<usize>) -> ArtefactKind {
        let is_short = run.len() <= self.trial.frames_of(JERK_S);
        if is_short { ArtefactKind::ImpactJerk } else { ArtefactKind::Jump }
    }

    /// Away in one step and back in another.
    fn steps(&self) -> Vec<(Artefact, f64)> {
        let longest = self.trial.frames_of(LONGEST_S);
        let frames: Vec<usize> = (1..self.off.len()).filter(|frame| self.is_jump(*frame)).collect();
        let mut found = Vec::new();
        let mut at = 0;
        while let Some(first) = frames.get(at).copied() {
            at += 1;
            let Some(away) = self.step(first) else { continue };
            // The way back may be several steps after one another.
            let mut way = away;
            let mut end = None;
            for (later, frame) in frames.iter().enumerate().skip(at) {
                if frame - first > longest {
                    break;
                }
                way += self.step(*frame).unwrap_or_default();
                if way.length() < BACK * away.length() {
                    end = Some((later, *frame));
                    break;
                }
            }
            if let Some((later, end)) = end {
                let run = first..end;
                if !self.is_held(&run, away) {
                    continue;
                }
                let (kind, cause) = match self.kind(&run) {
                    ArtefactKind::ImpactJerk => (ArtefactKind::ImpactJerk, Cause::SkinMovement),
                    kind => (kind, Cause::BadReconstruction),
                };
                found.push((self.artefact(kind, cause, run), away.length() / self.step_m));
                at = later + 1;
            }
        }
        found
    }

    /// Trembling.
    fn shakes(&self) -> Vec<(Artefact, f64)> {
        if self.trial.rate_hz() < LEAST_RATE_HZ {
            return Vec::new();
        }
        let quick = self.quick(|frame| self.at(frame));
        let own = self.quick(|frame| self.trial.at(self.marker, frame));
        let half = self.trial.frames_of(SHAKEN_S / 2.0).max(3);
        let strength = |of: &[Option<DVec3>], frame: usize| -> Option<f64> {
            let around = of.get(frame.saturating_sub(half)..).unwrap_or_default();
            let seen = || around.iter().take(2 * half + 1).flatten();
            let (count, squares) =
                (seen().count(), seen().map(|of| of.length_squared()).sum::<f64>());
            (count > half).then(|| (squares / count as f64).sqrt())
        };
        // A marker that shakes does so itself, and against its neighbours; fast motion is in the first alone, and
        // what the neighbours do not know is in the second.
        let strengths: Vec<Option<f64>> = (0..quick.len())
            .map(|frame| Some(strength(&quick, frame)?.min(strength(&own, frame)?)))
            .collect();
        let usual = median(strengths.iter().flatten().copied()).unwrap_or(0.0);
        let strong = Strength { least_m: SHAKE_M.max(SHAKES * usual), by: SHAKEN_BY, wave: None };
        let least_m = strong.least_m.min(WAVE_M.max(WAVES * usual));
        let regular = Strength { least_m, by: WAVE_BY, wave: Some(REGULAR) };
        let trembling = Trembling { quick, own, strengths };
        let mut found: Vec<(Artefact, f64)> = Vec::new();
        for strength in [strong, regular] {
            let is_strong =
                |frame: usize| trembling.strengths[frame].is_some_and(|of| of > strength.least_m);
            for run in runs(trembling.quick.len(), is_strong) {
                let meets = |of: &Range<usize>| of.start < run.end && run.start < of.end;
                if !found.iter().any(|(known, _)| meets(&known.frames)) {
                    found.extend(self.shake(&trembling, &run, &strength));
                }
            }
        }
        found
    }

    /// What shakes in a run, if it is more than a person does.
    fn shake(
        &self,
        trembling: &Trembling,
        run: &Range<usize>,
        strength: &Strength,
    ) -> Option<(Artefact, f64)> {
        let Trembling { quick, own, strengths } = trembling;
        // A window that is half in it is half as strong.
        let most = run.clone().filter_map(|frame| strengths[frame]).fold(0.0, f64::max);
        let shaken = self.shaken(quick, run, most)?;
        let turns = turns(quick, &shaken);
        let hz = turns as f64 / 2.0 * self.trial.rate_hz() / shaken.len() as f64;
        let is_brief = shaken.len() < self.trial.frames_of(SHAKEN_S / 2.0);
        if is_brief
            || turns < TURNS
            || hz < SLOWEST_HZ
            || most < strength.by * self.quickness_around(&shaken)
        {
            return None;
        }
        let is_wave = |share: f64| {
            let (explained, hz) = self.wave(quick, &shaken);
            explained >= share && hz >= SLOWEST_WAVE_HZ
        };
        let is_meant = strength.wave.is_none_or(is_wave)
            && !self.is_shared(own, &shaken)
            && self.is_shaking_shown(quick, &shaken);
        is_meant.then(|| {
            let artefact = self.artefact(ArtefactKind::Shake, Cause::LooseAttachment, shaken);
            (artefact, most / strength.least_m)
        })
    }

    /// True if the most constant distances shake, too.
    fn is_shaking_shown(&self, quick: &[Option<DVec3>], run: &Range<usize>) -> bool {
        self.is_shown(|of| {
            let distance = |frame: usize| -> Option<DVec3> {
                let own = self.trial.at(self.marker, frame)?;
                Some(DVec3::new(own.distance(self.trial.at(of.marker, frame)?), 0.0, 0.0))
            };
            let trembles = |frame: usize| Some(self.quick_at(frame, &distance)?.x);
            let usual = median((0..quick.len()).filter_map(trembles).map(f64::abs))?;
            let changes = run.clone().filter_map(|frame| {
                let (own, other) =
                    (self.trial.at(self.marker, frame)?, self.trial.at(of.marker, frame)?);
                let away = quick.get(frame).copied().flatten()?;
                Some((away.dot((own - other).normalize_or_zero()), trembles(frame)?))
            });
            Some(Shown::of(changes, usual + QUICK_M))
        })
    }

    /// The share of quick motion that one wave explains, and that wave, Hz: the one that explains most.
    fn wave(&self, quick: &[Option<DVec3>], run: &Range<usize>) -> (f64, f64) {
        let rate_hz = self.trial.rate_hz();
        let frames = run.len().min(self.trial.frames_of(WAVE_S));
        let middle = run.start + (run.len() - frames) / 2;
        let seen: Vec<(f64, DVec3)> = (middle..middle + frames)
            .filter_map(|frame| {
                Some(((frame - middle) as f64 / rate_hz, quick.get(frame).copied().flatten()?))
            })
            .collect();
        let all: f64 = seen.iter().map(|(_, of)| of.length_squared()).sum();
        let explained = |hz: f64| -> Option<f64> {
            let (mut squares, mut products) = (Matrix2::zeros(), [DVec3::ZERO; 2]);
            for (time_s, of) in &seen {
                let (sin, cos) = (TAU * hz * time_s).sin_cos();
                squares += Matrix2::new(sin * sin, sin * cos, sin * cos, cos * cos);
                products[0] += sin * *of;
                products[1] += cos * *of;
            }
            let inverse = squares.try_inverse()?;
            let [s, c] = products;
            let both = 2.0 * inverse[(0, 1)] * s.dot(c);
            Some(inverse[(0, 0)] * s.dot(s) + both + inverse[(1, 1)] * c.dot(c))
        };
        let steps = ((QUICKEST_HZ - SLOWEST_HZ) / STEP_HZ) as usize;
        let waves = (0..=steps).map(|step| SLOWEST_HZ + STEP_HZ * step as f64);
        let waves = waves.filter(|hz| *hz < 0.45 * rate_hz);
        let best = waves
            .filter_map(|hz| Some((explained(hz)?, hz)))
            .fold((0.0, 0.0), |best: (f64, f64), of| if of.0 > best.0 { of } else { best });
        (best.0 / all.max(f64::MIN_POSITIVE), best.1)
    }

    /// True if a neighbour trembles along: then it is the limb.
    fn is_shared(&self, own: &[Option<DVec3>], run: &Range<usize>) -> bool {
        let along = |of: &dyn Fn(usize) -> Option<DVec3>| -> Option<DVec3> {
            let seen = run.clone().filter_map(of);
            seen.max_by(|a, b| a.length().total_cmp(&b.length()))?.try_normalize()
        };
        let mine = |frame: usize| own.get(frame).copied().flatten();
        let Some(my_way) = along(&mine) else { return false };
        self.witnesses.iter().any(|of| {
            let theirs = |frame: usize| self.quick_at(frame, &|at| self.trial.at(of.marker, at));
            let Some(their_way) = along(&theirs) else { return false };
            let (mut products, mut squares) = (0.0, [0.0, 0.0]);
            for frame in run.clone() {
                let (Some(mine), Some(theirs)) = (mine(frame), theirs(frame)) else { continue };
                let (mine, theirs) = (mine.dot(my_way), theirs.dot(their_way));
                products += mine * theirs;
                squares[0] += mine * mine;
                squares[1] += theirs * theirs;
            }
            squares[1] > LEAST_SHARED * LEAST_SHARED * squares[0]
                && products.abs() > ALIKE * (squares[0] * squares[1]).sqrt()
        })
    }

    /// What is left of a motion after the parabolas that fit it best around each frame (Savitzky and Golay, Analytical
    /// Chemistry 36, 1964).
    fn quick(&self, motion: impl Fn(usize) -> Option<DVec3>) -> Vec<Option<DVec3>> {
        (0..self.off.len()).map(|frame| self.quick_at(frame, &motion)).collect()
    }

    fn quick_at(&self, frame: usize, motion: &impl Fn(usize) -> Option<DVec3>) -> Option<DVec3> {
        let reach = self.trial.frames_of(SMOOTHED_S).max(2);
        let m = reach as f64;
        let scale = (2.0 * m - 1.0) * (2.0 * m + 1.0) * (2.0 * m + 3.0);
        let mut smooth = DVec3::ZERO;
        for (at, of) in (frame.checked_sub(reach)?..=frame + reach).enumerate() {
            let from_middle = at as f64 - m;
            let weight = 3.0 * (3.0 * m * m + 3.0 * m - 1.0) - 15.0 * from_middle * from_middle;
            smooth += weight / scale * motion(of)?;
        }
        Some(motion(frame)? - smooth)
    }

    /// How strong quick motion is in the neighbours, m: the median of their root mean squares.
    fn quickness_around(&self, run: &Range<usize>) -> f64 {
        let of = |marker: &usize| {
            let quick = |frame| self.quick_at(frame, &|at| self.trial.at(*marker, at));
            let seen: Vec<f64> =
                run.clone().filter_map(quick).map(|quick| quick.length_squared()).collect();
            (!seen.is_empty()).then(|| (seen.iter().sum::<f64>() / seen.len() as f64).sqrt())
        };
        median(self.near.iter().filter_map(of)).unwrap_or(0.0)
    }

    /// The frames that shake themselves, from the first to the last.
    fn shaken(
        &self,
        quick: &[Option<DVec3>],
        run: &Range<usize>,
        most: f64,
    ) -> Option<Range<usize>> {
        let shakes = |frame: &usize| {
            quick.get(*frame).copied().flatten().is_some_and(|of| of.length() > most / 2.0)
        };
        let (first, last) = (run.clone().find(shakes)?, run.clone().rev().find(shakes)?);
        Some(first..last + 1)
    }
}

/// How a marker trembles over time.
struct Trembling {
    /// Against its neighbours, by itself, and the strength of both, m.
    quick: Vec<Option<DVec3>>,
    own: Vec<Option<DVec3>>,
    strengths: Vec<Option<f64>>,
}

/// What counts as shaking.
struct Strength {
    least_m: f64,
    /// How much more than the neighbours.
    by: f64,
    /// The share that one wave must explain.
    wave: Option<f64>,
}

/// What a distance shows of what is off, in squares of how much it varies.
#[derive(Clone, Copy, Debug)]
struct Shown {
    expected: f64,
    seen: f64,
}

impl Shown {
    /// Of changes that are expected and seen, m; `varies_m` is usual.
    fn of(changes: impl Iterator<Item = (f64, f64)>, varies_m: f64) -> Self {
        let (mut sum, mut count) = (Self { expected: 0.0, seen: 0.0 }, 0.0_f64);
        for (expected, seen) in changes {
            sum.expected += expected * expected;
            sum.seen += expected * seen;
            count += 1.0;
        }
        let scale = 1.0 / (count.max(1.0) * varies_m * varies_m);
        Self { expected: scale * sum.expected, seen: scale * sum.seen }
    }
}

/// How often the quick motion turns round, along the way it goes most.
fn turns(quick: &[Option<DVec3>], run: &Range<usize>) -> usize {
    let seen: Vec<DVec3> =
        run.clone().filter_map(|frame| quick.get(frame).copied().flatten()).collect();
    let longest = seen.iter().copied().max_by(|a, b| a.length().total_cmp(&b.length()));
    let Some(along) = longest.and_then(|of| of.try_normalize()) else { return 0 };
    let signs: Vec<bool> = seen.iter().map(|of| of.dot(along) > 0.0).collect();
    signs.windows(2).filter(|pair| pair[0] != pair[1]).count()
}

/// How suddenly markers move in a frame, m: the median of their second differences.
fn agitation(trial: &Trial, markers: &[usize], frame: usize) -> f64 {
    let of = |marker: &usize| {
        let place = |at: usize| trial.at(*marker, at);
        let around = (place(frame.checked_sub(1)?)?, place(frame)?, place(frame + 1)?);
        Some((around.0 - 2.0 * around.1 + around.2).length())
    };
    median(markers.iter().filter_map(of)).unwrap_or(0.0)
}
