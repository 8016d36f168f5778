//! How well motions are made of other motions, and told apart, judged on the trials of a corpus.
//!
//! Each of these holds something back that is in the corpus, has it made of the rest, and compares: in mm, the mean
//! distance of 15 joints and 7 ends of the body over the time. Beside it stand baselines that anybody has at hand.

use super::people::Split;
use crate::body::anthropometry::Measure;
use crate::body::{Dof, Proportions, SegmentPose};
use crate::corpus::query::Question;
use crate::corpus::rows::{LabelEntry, PARAMETERS, SubjectEntry, TrialEntry};
use crate::corpus::select::Selection;
use crate::corpus::store::Store;
use crate::corpus::tables::{LABELS, TrialFrames};
use crate::error::{Error, ErrorKind, counted};
use crate::job::pending::go_on;
use crate::job::report::Outcome;
use crate::job::{Event, Observer};
use crate::recognise::score::interval as share_interval;
use glam::{DMat4, DVec4};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;
use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::path::PathBuf;

/// Instants of a motion at which two are compared.
pub(super) const INSTANTS: usize = 40;
/// Signals that are angles; after them come root and pelvis.
pub(super) const ANGLES: usize = Dof::ALL.len();
/// Neighbours of a target of which a motion is made.
const NEIGHBOURS: usize = 8;
/// Fewer trials of an action are not judged.
const FEWEST: usize = 8;
/// How well the plane through neighbours is known beforehand.
const RIDGE: f64 = 0.05;
/// Times a mean is taken of trials drawn anew, for its interval.
const DRAWS: usize = 1000;

/// What is to be judged.
#[derive(Clone, Debug)]
pub struct MotionScoreOrder {
    /// The folder of the corpus.
    pub corpus: PathBuf,
    /// Which of its trials, as a question; all if it is empty.
    pub question: String,
    /// Of what is drawn.
    pub seed: u64,
    /// Judge a fifth of the people, by what the others did.
    pub by_subject: bool,
}

/// What others reach.
#[derive(Clone, Debug, Serialize)]
pub struct Baseline {
    /// How it is made.
    pub what: &'static str,
    /// Its figure.
    pub value: f64,
    /// Its 95 % interval.
    pub interval: [f64; 2],
}

/// A figure beside the score: a feature of a motion as far as it is kept, or what else is told of who moves.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FeatureKept {
    /// What it is.
    pub what: &'static str,
    /// In which unit.
    pub unit: &'static str,
    /// Its mean over the trials that have it; none if none has.
    pub value: Option<f64>,
    /// Its 95 % interval.
    pub interval: Option<[f64; 2]>,
    /// The mean with angles that are copied; of people, if all were told alike.
    pub baseline: Option<f64>,
}

/// A score.
#[derive(Clone, Debug, Serialize)]
pub struct MotionScore {
    /// `done`.
    pub outcome: Outcome,
    /// What is judged.
    pub score: &'static str,
    /// The corpus.
    pub corpus: String,
    /// Its version.
    pub version: String,
    /// What it is compared with, in words.
    pub truth: &'static str,
    /// Unit of the figures: `mm`, less is better; `share`, more is better.
    pub unit: &'static str,
    /// The figure; none without a truth.
    pub value: Option<f64>,
    /// Its 95 % interval.
    pub interval: Option<[f64; 2]>,
    /// What simpler ways reach.
    pub baselines: Vec<Baseline>,
    /// What could not be better, or worse: how it is told, and the figure.
    pub bound: Option<(&'static str, f64)>,
    /// The figure by class.
    pub per_class: BTreeMap<String, f64>,
    /// Of retargeting: what else is kept, and what it costs; of identification: what is told of those who
    /// are not known; of transitioning: two trials put together.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub features: Vec<FeatureKept>,
    /// Things that were judged.
    pub judged: u64,
    /// What was not judged, and why.
    pub passed_over: BTreeMap<String, u64>,
    /// Of what was drawn.
    pub seed: u64,
    /// How many people were judged, and by what how many others did; none if everybody was by all others.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub people: Option<[usize; 2]>,
}

impl MotionScore {
    pub(super) fn pass_over(&mut self, why: &str, count: u64) {
        if count == 0 {
            return;
        }
        *self.passed_over.entry(why.to_owned()).or_default() += count;
    }

    /// Tells errors, and those of simpler ways, which each have what they are before them.
    pub(super) fn tell<'a>(
        &mut self,
        errors: &[f64],
        simpler: impl IntoIterator<Item = (&'static str, &'a Vec<f64>)>,
    ) {
        let seed = self.seed;
        self.value = Some(mean(errors));
        // One trial says nothing of how far others would be off.
        self.interval = (errors.len() > 1).then(|| mean_interval(errors, seed));
        let baseline = |(what, errors): (&'static str, &Vec<f64>)| Baseline {
            what,
            value: mean(errors),
            interval: mean_interval(errors, seed),
        };
        self.baselines = simpler.into_iter().map(baseline).collect();
    }
}

/// A trial at its instants.
pub(super) struct Held {
    pub(super) entry: TrialEntry,
    pub(super) frames: TrialFrames,
}

impl Held {
    pub(super) fn frames(&self) -> usize {
        self.frames.len()
    }

    /// All signals at an instant, as a part of its duration.
    pub(super) fn at(&self, part: f64) -> Vec<f64> {
        let last = self.frames().saturating_sub(1);
        let at = part * last as f64;
        let before = (at.floor() as usize).min(last);
        let (after, u) = ((before + 1).min(last), at - at.floor());
        let between = |of: &Vec<f32>| f64::from(of[before]) * (1.0 - u) + f64::from(of[after]) * u;
        self.frames.signals.iter().map(between).collect()
    }

    /// Poses at [`INSTANTS`].
    pub(super) fn poses(&self) -> Vec<SegmentPose> {
        poses(&self.all())
    }

    fn all(&self) -> Vec<Vec<f64>> {
        (0..INSTANTS).map(|at| self.at(at as f64 / (INSTANTS - 1) as f64)).collect()
    }
}

/// Poses of signals.
pub(super) fn poses(rows: &[Vec<f64>]) -> Vec<SegmentPose> {
    let signals = rows.first().map_or(0, Vec::len);
    let column = |signal: usize| rows.iter().map(|row| row[signal] as f32).collect();
    TrialFrames { signals: (0..signals).map(column).collect() }.poses()
}

/// The shorter of the two ways from an angle to another, rad.
pub(super) fn turned(from: f64, to: f64) -> f64 {
    let way = to - from;
    way - TAU * (way / TAU).round()
}

/// Mean distance of joints and ends, mm.
pub(super) fn apart_mm(body: &Proportions, one: &[Vec<f64>], other: &[Vec<f64>]) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for (one, other) in poses(one).iter().zip(&poses(other)) {
        let (one, other) = (body.positions(one), body.positions(other));
        let points = one.joints_m.iter().zip(&other.joints_m);
        for (a, b) in points.chain(one.ends_m.iter().zip(&other.ends_m)) {
            sum += a.distance(*b);
            count += 1.0;
        }
    }
    1e3 * sum / f64::max(count, 1.0)
}

pub(super) fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

/// Where the mean lies in 95 of 100 cases, of values drawn anew with repetition (Efron, "Bootstrap methods: another look at
/// the jackknife", 1979).
pub(super) fn mean_interval(values: &[f64], seed: u64) -> [f64; 2] {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut means: Vec<f64> = (0..DRAWS)
        .map(|_| {
            let drawn = (0..values.len()).map(|_| values[random.random_range(0..values.len())]);
            drawn.sum::<f64>() / values.len().max(1) as f64
        })
        .collect();
    means.sort_by(f64::total_cmp);
    [means[DRAWS / 40], means[DRAWS - 1 - DRAWS / 40]]
}

pub(super) struct Judging<'a> {
    pub(super) order: &'a MotionScoreOrder,
    store: Store,
    pub(super) trials: Vec<Held>,
    pub(super) split: Split,
    passed_over: BTreeMap<String, u64>,
}

impl<'a> Judging<'a> {
    pub(super) fn of(order: &'a MotionScoreOrder) -> Result<Self, Error> {
        let question = Question::parse(&order.question)?;
        let store = Store::open(&order.corpus)?;
        let mut entries = Vec::new();
        Selection::new(&store, &question, false)?.trials(u64::MAX, |entry| {
            entries.push(entry);
            Ok(())
        })?;
        let mut passed_over = BTreeMap::new();
        let all = entries.len();
        entries.retain(|entry| entry.place.is_some());
        if entries.len() < all {
            passed_over.insert("frames are not kept".to_owned(), (all - entries.len()) as u64);
        }
        let mut split = Split::default();
        if order.by_subject {
            split = Split::drawn(&entries, order.seed)?;
            let known = entries.len();
            entries.retain(|entry| entry.subject.is_some());
            if entries.len() < known {
                let count = (known - entries.len()) as u64;
                passed_over.insert("nobody knows who did it".to_owned(), count);
            }
        }
        entries.sort_by(|a, b| (&a.set, &a.action, &a.name).cmp(&(&b.set, &b.action, &b.name)));
        let mut trials = Vec::new();
        store.frames_of(&entries.iter().collect::<Vec<_>>(), |entry, frames| {
            trials.push(Held { entry: entry.clone(), frames });
            Ok(())
        })?;
        if trials.is_empty() {
            return Err(Error::of(ErrorKind::Absent, "there is nothing to be judged")
                .at(order.corpus.display().to_string())
                .got(format!("{}, none with frames", counted(all, "trial")))
                .remedy("`gaitway corpus generate DIR generalisation` makes some"));
        }
        Ok(Self { order, store, trials, split, passed_over })
    }

    /// Labels by trial.
    pub(super) fn labels(&self) -> Result<BTreeMap<String, Vec<LabelEntry>>, Error> {
        let mut found: BTreeMap<String, Vec<LabelEntry>> = BTreeMap::new();
        for note in self.store.files(LABELS) {
            for of in self.store.labels_in(note)? {
                found.entry(of.trial.clone()).or_default().push(of);
            }
        }
        Ok(found)
    }

    pub(super) fn report(
        self,
        score: &'static str,
        (truth, unit): (&'static str, &'static str),
    ) -> MotionScore {
        MotionScore {
            outcome: Outcome::Done,
            score,
            corpus: self.order.corpus.display().to_string(),
            version: self.store.version().version.clone(),
            truth,
            unit,
            value: None,
            interval: None,
            baselines: Vec::new(),
            bound: None,
            per_class: BTreeMap::new(),
            features: Vec::new(),
            judged: 0,
            passed_over: self.passed_over,
            seed: self.order.seed,
            people: self.split.people(),
        }
    }
}

/// The target of a trial as a point: its parameters, a direction as a place.
fn target(entry: &TrialEntry) -> Vec<f64> {
    let of = |name: &str| entry.parameters.get(name).copied();
    let mut at = Vec::new();
    if let Some(direction_rad) = of("direction_rad") {
        let length_m = of("length_m").unwrap_or(1.0);
        at.extend([direction_rad.cos() * length_m, direction_rad.sin() * length_m]);
    }
    let plain = PARAMETERS
        .iter()
        .filter(|name| !["direction_rad", "length_m", "seed", "variation"].contains(*name));
    // How fast it came out is no target where a place is.
    let has_place = of("target_x_m").is_some();
    let asked = plain.filter(|name| {
        !(has_place && entry.action == "reach" && **name == "speed_m_s" && is_free(entry))
    });
    at.extend(asked.filter_map(|name| of(name)));
    at
}

/// Whether nobody asked for the speed of a reach: it is not one of those at given speeds.
fn is_free(entry: &TrialEntry) -> bool {
    !entry.name.contains("speed")
}

/// What a motion for a target is made of: neighbours that lend themselves to it, with their weights.
fn weights(targets: &[Vec<f64>], of: &[f64], lends: impl Fn(usize) -> bool) -> Vec<(usize, f64)> {
    let away = |at: &[f64]| at.iter().zip(of).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
    let mut near: Vec<(usize, f64)> = targets
        .iter()
        .enumerate()
        .filter(|(index, _)| lends(*index))
        .map(|(index, at)| (index, away(at)))
        .collect();
    near.sort_by(|a, b| a.1.total_cmp(&b.1));
    near.truncate(NEIGHBOURS);
    near.into_iter().map(|(index, away)| (index, 1.0 / (away + 1e-9))).collect()
}

fn mixed(trials: &[Vec<Vec<f64>>], of: &[(usize, f64)]) -> Vec<Vec<f64>> {
    let total: f64 = of.iter().map(|(_, weight)| weight).sum();
    let mut rows = vec![vec![0.0; trials[0][0].len()]; INSTANTS];
    for (index, weight) in of {
        for (row, own) in rows.iter_mut().zip(&trials[*index]) {
            row.iter_mut().zip(own).for_each(|(sum, own)| *sum += own * weight / total);
        }
    }
    rows
}

/// Weights with which neighbours lie on a plane over their targets whose value at the target is looked for: at most three
/// figures of the target count.
fn on_a_plane(targets: &[Vec<f64>], of: &[f64], near: &[(usize, f64)]) -> Vec<(usize, f64)> {
    let row = |at: &[f64]| {
        let off = |n: usize| at.get(n).map_or(0.0, |at| at - of[n]);
        DVec4::new(1.0, off(0), off(1), off(2))
    };
    let total: f64 = near.iter().map(|(_, weight)| weight).sum();
    let mut normal = DMat4::from_diagonal(DVec4::new(0.0, RIDGE, RIDGE, RIDGE));
    for (index, weight) in near {
        let row = row(&targets[*index]);
        let [a, b, c, d] = row.to_array().map(|part| row * part * (weight / total));
        normal += DMat4::from_cols(a, b, c, d);
    }
    let first = normal.inverse().row(0);
    let found = near
        .iter()
        .map(|(index, weight)| (*index, weight / total * first.dot(row(&targets[*index]))));
    found.collect()
}

/// A motion for a target that nobody moved to, made of those to other targets.
///
/// # Errors
/// No corpus, nothing in it to be judged, a wish to stop.
pub fn generalisation(
    order: &MotionScoreOrder,
    observer: &dyn Observer,
) -> Result<MotionScore, Error> {
    let mut judging = Judging::of(order)?;
    let split = judging.split.clone();
    let mut groups: BTreeMap<(String, String, usize), Vec<Held>> = BTreeMap::new();
    for held in std::mem::take(&mut judging.trials) {
        // Other people are as tall as they are.
        let stature = match split {
            Split::Everybody => format!(" {:.3} m", held.entry.body_stature_m),
            Split::People { .. } => String::new(),
        };
        let key = (held.entry.action.clone(), stature, target(&held.entry).len());
        groups.entry(key).or_default().push(held);
    }
    let mut report = judging.report(
        "generalisation",
        ("each trial in turn, which what is made for its target does not see", "mm"),
    );
    let mut errors: [Vec<f64>; 4] = Default::default();
    for ((action, stature, figures), group) in groups {
        go_on(observer)?;
        let judged = |at: &usize| split.judges(&group[*at].entry);
        let all: Vec<usize> = (0..group.len()).collect();
        let count = all.iter().copied().filter(judged).count() as u64;
        let lending = |at: &usize| split.lends(&group[*at].entry);
        if all.iter().copied().filter(lending).count() < FEWEST || figures == 0 || count == 0 {
            report.pass_over("too few of an action with targets", count);
            continue;
        }
        observer.hear(Event::Step {
            done: report.judged,
            total: report.judged + count,
            what: "trials",
        });
        let mut targets: Vec<Vec<f64>> = group.iter().map(|of| target(&of.entry)).collect();
        scale(&mut targets);
        let trials: Vec<Vec<Vec<f64>>> = group.iter().map(Held::all).collect();
        let before = errors[0].len();
        for (index, truth) in trials.iter().enumerate().filter(|(index, _)| judged(index)) {
            let body = Proportions::of_stature(group[index].entry.body_stature_m)?;
            let lends = |other: usize| other != index && lending(&other);
            let near = weights(&targets, &targets[index], lends);
            let plane = on_a_plane(&targets, &targets[index], &near);
            let apart = |made: &[Vec<f64>]| apart_mm(&body, made, truth);
            errors[0].push(apart(&mixed(&trials, &plane)));
            errors[1].push(apart(&mixed(&trials, &near)));
            errors[2].push(apart(&trials[near[0].0]));
            let best =
                near.iter().map(|(index, _)| apart(&trials[*index])).fold(f64::MAX, f64::min);
            errors[3].push(best);
        }
        report.judged += count;
        report.per_class.insert(format!("{action}{stature}"), mean(&errors[0][before..]));
    }
    if report.judged > 0 {
        let what = ["eight neighbours, by inverse squared distance", "the nearest, copied"];
        report.tell(&errors[0], what.into_iter().zip(&errors[1..]));
        report.bound =
            Some(("the best of eight neighbours, copied by who knows the truth", mean(&errors[3])));
    }
    Ok(report)
}

/// Figures of targets as parts of how far they are spread; those that are alike are left out.
fn scale(targets: &mut [Vec<f64>]) {
    let figures = targets.first().map_or(0, Vec::len);
    let spread = |figure: usize| {
        let own: Vec<f64> = targets.iter().map(|of| of[figure]).collect();
        let middle = mean(&own);
        mean(&own.iter().map(|of| (of - middle).powi(2)).collect::<Vec<_>>()).sqrt()
    };
    let spreads: Vec<f64> = (0..figures).map(spread).collect();
    for target in targets {
        let own = target.iter().zip(&spreads).filter(|(_, spread)| **spread > 1e-9);
        *target = own.map(|(of, spread)| of / spread).collect();
    }
}

/// Who it is that moves.
///
/// # Errors
/// As [`generalisation`].
pub fn identification(
    order: &MotionScoreOrder,
    observer: &dyn Observer,
) -> Result<MotionScore, Error> {
    let mut judging = Judging::of(order)?;
    let trials = std::mem::take(&mut judging.trials);
    let people: BTreeMap<String, SubjectEntry> =
        judging.store.subjects()?.into_iter().map(|of| (of.subject.id.clone(), of)).collect();
    let mut strangers: Vec<[&SubjectEntry; 2]> = Vec::new();
    // Of whom the most frequent and the mean are.
    let mut others_did: Vec<&SubjectEntry> = Vec::new();
    let split = judging.split.clone();
    let mut report = judging.report(
        "identification",
        ("who did a trial, told by the most alike of the others of its action", "share"),
    );
    let mut by_action: BTreeMap<String, Vec<Held>> = BTreeMap::new();
    for held in trials {
        if held.entry.subject.is_none() {
            report.pass_over("nobody knows who did it", 1);
        } else {
            by_action.entry(held.entry.action.clone()).or_default().push(held);
        }
    }
    let mut tally: BTreeMap<String, (usize, usize)> = BTreeMap::new();
    for group in by_action.into_values() {
        go_on(observer)?;
        let who = |at: usize| group[at].entry.subject.clone().unwrap_or_default();
        let alone = (0..group.len()).all(|at| who(at) == who(0));
        if alone {
            report.pass_over("done by one person only", group.len() as u64);
            continue;
        }
        let bodies = group.iter().map(|of| Proportions::of_stature(of.entry.body_stature_m));
        let bodies = bodies.collect::<Result<Vec<_>, _>>()?;
        // Everybody begins above the origin.
        let rows: Vec<Vec<Vec<f64>>> = group.iter().map(|of| from_the_origin(of.all())).collect();
        let judged = |at: &usize| split.judges(&group[*at].entry);
        let lending = (0..group.len()).filter(|at| split.lends(&group[*at].entry));
        others_did.extend(lending.filter_map(|at| people.get(&who(at))));
        for at in (0..group.len()).filter(judged) {
            report.judged += 1;
            let others = (0..group.len()).filter(|other| *other != at);
            let apart = |other: usize| apart_mm(&bodies[at], &rows[at], &rows[other]);
            let others: Vec<(f64, usize)> = others.map(|other| (apart(other), other)).collect();
            let nearest = others.iter().min_by(|a, b| a.0.total_cmp(&b.0));
            let lends = |other: usize| split.lends(&group[other].entry);
            let foreign =
                others.iter().filter(|(_, other)| who(*other) != who(at) && lends(*other));
            let stranger = foreign.min_by(|a, b| a.0.total_cmp(&b.0));
            let told = stranger.and_then(|(_, other)| people.get(&who(*other)));
            strangers.extend(people.get(&who(at)).zip(told).map(|(own, told)| [own, told]));
            let is_right = nearest.is_some_and(|(_, other)| who(*other) == who(at));
            let own = tally.entry(who(at)).or_default();
            *own = (own.0 + usize::from(is_right), own.1 + 1);
        }
    }
    let (right, all) = tally.values().fold((0, 0), |sum, of| (sum.0 + of.0, sum.1 + of.1));
    let most = tally.values().map(|of| of.1).max().unwrap_or(0);
    if all > 0 {
        report.value = Some(right as f64 / all as f64);
        report.interval = share_interval(right, all);
        report.baselines = vec![Baseline {
            what: "always who did most",
            value: most as f64 / all as f64,
            interval: share_interval(most, all).unwrap_or([0.0, 1.0]),
        }];
        report.bound = Some(("all of them", 1.0));
        report.features = of_strangers(&strangers, &others_did, order.seed);
        report.per_class =
            tally.into_iter().map(|(who, of)| (who, of.0 as f64 / of.1 as f64)).collect();
    } else {
        report.truth = match split {
            Split::Everybody => "no truth here: no action is done by two people who are known",
            Split::People { .. } => {
                "no truth here: none of those who are judged did an action that another did as well"
            }
        };
    }
    Ok(report)
}

/// Gender and age, as those of the other person who moves most alike; each trial with both who did it and who that is.
/// Beside it, what is told whoever it is: the most frequent gender and the mean age of `others`.
fn of_strangers(
    trials: &[[&SubjectEntry; 2]],
    others: &[&SubjectEntry],
    seed: u64,
) -> Vec<FeatureKept> {
    let feature = |what, unit, found: Vec<f64>, simpler: Vec<f64>| FeatureKept {
        what,
        unit,
        value: (!found.is_empty()).then(|| mean(&found)),
        interval: (found.len() > 1).then(|| mean_interval(&found, seed)),
        baseline: (!simpler.is_empty()).then(|| mean(&simpler)),
    };
    let genders = trials.iter().map(|both| both.map(|of| of.subject.gender.as_str()));
    let genders: Vec<[&str; 2]> = genders.filter(|both| !both.contains(&"")).collect();
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    let told = others.iter().map(|of| of.subject.gender.as_str()).filter(|of| !of.is_empty());
    told.for_each(|gender| *counts.entry(gender).or_default() += 1);
    let most = counts.iter().max_by_key(|(_, count)| **count).map_or("", |(gender, _)| gender);
    let share = |is_right: bool| if is_right { 100.0 } else { 0.0 };
    let ages = trials
        .iter()
        .filter_map(|[own, told]| Some([own.measure(Measure::Age)?, told.measure(Measure::Age)?]));
    let ages: Vec<[f64; 2]> = ages.collect();
    let told = others.iter().filter_map(|of| of.measure(Measure::Age));
    let middle = mean(&told.collect::<Vec<_>>());
    [
        feature(
            "gender, as of another person who moves alike; always the most frequent",
            "%",
            genders.iter().map(|[own, told]| share(own == told)).collect(),
            genders.iter().map(|[own, _]| share(*own == most)).collect(),
        ),
        feature(
            "age, as of another person who moves alike, off by; always the mean",
            "years",
            ages.iter().map(|[own, told]| (own - told).abs()).collect(),
            ages.iter().map(|[own, _]| (own - middle).abs()).collect(),
        ),
    ]
    .into_iter()
    .filter(|of| of.value.is_some())
    .collect()
}

fn from_the_origin(mut rows: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
    const ROOT_X: usize = 22;
    let first: Vec<f64> =
        rows.first().map_or_else(Vec::new, |row| row[ROOT_X..ROOT_X + 2].to_vec());
    for row in &mut rows {
        for (value, first) in row[ROOT_X..].iter_mut().zip(&first) {
            *value -= first;
        }
    }
    rows
}
