//! Markers that are not where their neighbours say: jumps, jerks, shaking, and what fell off.

use super::super::artefact::{Artefact, ArtefactKind, Cause};
use super::super::neighbours::Neighbour;
use super::super::trial::{Trial, runs};
use super::expectation::{Expectation, median};
use glam::DVec3;
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
    let near: Vec<usize> = expectation.near.iter().map(|of| of.marker).collect();
    let signal = Signal::of(trial, marker, off, &near);
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
    off: Vec<Option<DVec3>>,
    /// How suddenly its neighbours move in each frame, m.
    agitation_m: Vec<f64>,
    /// Least step that is a jump, m.
    step_m: f64,
}

impl<'a> Signal<'a> {
    fn of(trial: &'a Trial, marker: usize, off: Vec<Option<DVec3>>, near: &[usize]) -> Self {
        let agitation_m = (0..trial.frames()).map(|frame| agitation(trial, near, frame)).collect();

        let steps = off.windows(2).filter_map(|pair| Some((pair[1]? - pair[0]?).length()));
        let usual_step = median(steps).unwrap_or(0.0);
        Self {
            trial,
            marker,
            near: near.to_vec(),
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

    /// True if it is elsewhere between two steps, by about as much as the first.
    fn is_held(&self, run: &Range<usize>, away: DVec3) -> bool {
        let middle = |frames: Range<usize>| -> Option<DVec3> {
            let seen: Vec<DVec3> = frames.filter_map(|frame| self.at(frame)).collect();
            let axis = |axis: usize| median(seen.iter().map(|of| of[axis]));
            Some(DVec3::new(axis(0)?, axis(1)?, axis(2)?))
        };
        let before = middle(run.start.saturating_sub(BESIDE)..run.start);
        let after = middle(run.end..run.end + BESIDE);
        let (Some(inside), Some(before), Some(after)) = (middle(run.clone()), before, after) else {
            return false;
        };
        let off = inside - (before + after) / 2.0;
        off.dot(away) > HELD * away.length_squared()
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
        let least = SHAKE_M.max(SHAKES * usual);
        let is_strong = |frame: usize| strengths[frame].is_some_and(|of| of > least);
        let mut found = Vec::new();
        for run in runs(quick.len(), is_strong) {
            // A window that is half in it is half as strong.
            let most = run.clone().filter_map(|frame| strengths[frame]).fold(0.0, f64::max);
            let shaken = self.shaken(&quick, &run, most);
            let Some(shaken) = shaken else { continue };
            let turns = turns(&quick, &shaken);
            let hz = turns as f64 / 2.0 * self.trial.rate_hz() / shaken.len() as f64;
            let others = self.quickness_around(&shaken);
            let is_brief = shaken.len() < self.trial.frames_of(SHAKEN_S / 2.0);
            if is_brief || turns < TURNS || hz < SLOWEST_HZ || most < SHAKEN_BY * others {
                continue;
            }
            let artefact = self.artefact(ArtefactKind::Shake, Cause::LooseAttachment, shaken);
            found.push((artefact, most / least));
        }
        found
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
