//! Sets of a corpus, filled with what the body model does.
//!
//! Each trial is a function of the set, its place in it and the seed, and of nothing else: parts that are made one by
//! one, in any order or at once, by several processes, fill a corpus to the same version. Every trial is judged from the
//! frames that are kept: where hand and feet are at the time they are to be there, and what soles and root do.

use super::labels::throughout;
use super::shipped::{self, Shipped, ShippedMotion, ShippedTrial, Stand};
use crate::action::corpus::VariationStatus;
use crate::action::parametric::{Ask, Made, Marked, Performer, Side, origin_m};
use crate::body::contact::Footing;
use crate::body::root::SOLES;
use crate::body::{End, Proportions, SegmentPose};
use crate::corpus::query::Question;
use crate::corpus::rows::{LabelEntry, TrialEntry, TrialKind};
use crate::corpus::select::Selection;
use crate::corpus::sets::{PlannedSet, PlannedTrial};
use crate::corpus::store::{NewTrial, Store};
use crate::corpus::tables::{TRIALS, TrialFrames};
use crate::error::{Error, ErrorKind};
use crate::job::pending::go_on;
use crate::job::report::Outcome;
use crate::job::share::Share;
use crate::job::{Event, Observer};
use glam::{DQuat, DVec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use std::thread;
use std::time::Duration;

/// Frames per second.
const RATE_HZ: f64 = 120.0;
/// What soles slide while they come down and leave is told by so many poses per second of the motion itself.
const SLIDES_HZ: f64 = 250.0;
/// Statures of those who do the sets, m.
const STATURES_M: [f64; 2] = [1.75, 1.65];
/// A trial whose hand or foot is further from where it is to be is to be made anew, m.
const MOST_AWAY_M: f64 = 0.02;
/// So many trials are made, and then added, at once.
const BATCH: usize = 24;
/// Another process that adds a part is waited for so often, and so long each time.
const WAITS: u32 = 600;
const WAIT: Duration = Duration::from_millis(100);
/// After so many times it is said.
const SAID_AFTER: u32 = 10;
const MOST_SEED: u64 = 1 << 53;
/// Who says what a generated trial is.
const GENERATOR: &str = "generator";

/// What is to be made.
#[derive(Clone, Debug)]
pub struct GenerateOrder {
    /// The folder of the corpus.
    pub corpus: PathBuf,
    /// The set, by its name.
    pub set: String,
    /// Which part of it.
    pub part: Share,
    /// Of the grid, if it is 0; else drawn beside it.
    pub seed: u64,
    /// Make again what is there, and compare.
    pub verify: bool,
}

/// A trial, and what came of it.
#[derive(Clone, Debug, Serialize)]
pub struct GeneratedTrial {
    /// What it is called.
    pub name: String,
    /// What is done in it.
    pub action: &'static str,
    /// Its id.
    pub trial: String,
    /// How far hand or foot is from where it was to be, at most, mm.
    pub away_mm: f64,
    /// How deep a sole sinks below the floor, mm.
    pub sinks_mm: f64,
    /// How far a sole slides while it stands, mm.
    pub slides_mm: f64,
    /// How hard the root is accelerated, m/s^2.
    pub root_m_s2: f64,
    /// How far inside the soles the zero-moment point is at least, mm: of what is not carried, does not sit and does not fly.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub margin_mm: Option<f64>,
    /// The most that the floor pushes, with what is lifted, N.
    pub force_n: f64,
    /// Which bounds it misses; it is to be made anew then.
    pub missed: Vec<String>,
}

/// What was made.
#[derive(Clone, Debug, Serialize)]
pub struct GenerateReport {
    /// `done`, or `done_with_loss` if a trial misses a bound, or is not what was there.
    pub outcome: Outcome,
    /// The folder of the corpus.
    pub corpus: String,
    /// Its version now.
    pub version: String,
    /// The set.
    pub set: &'static str,
    /// Which part of how many.
    pub part: [usize; 2],
    /// Of which seed.
    pub seed: u64,
    /// Trials that came.
    pub added: u64,
    /// Trials that were there.
    pub found: u64,
    /// Trials that are there, and not what they are when they are made again (`--verify`).
    pub changed: Vec<String>,
    /// What the set asks for and the body model does not do.
    pub left_out: Vec<String>,
    /// Trials that are not added, since their frames are there: of another seed that changes nothing of them, say.
    pub alike: Vec<String>,
    /// What was made.
    pub trials: Vec<GeneratedTrial>,
}

/// A trial, and how it is made.
#[derive(Clone, Debug)]
enum Asked {
    /// By what is asked for: a place, a direction, a load.
    Parameters(PlannedTrial),
    /// As a variation of a shipped action.
    Shipped(ShippedTrial),
}

impl Asked {
    const fn planned(&self) -> &PlannedTrial {
        match self {
            Self::Parameters(planned) | Self::Shipped(ShippedTrial { planned, .. }) => planned,
        }
    }
}

/// The trials of a set that can be made, in their order, and the names of those that cannot.
fn trials(set: PlannedSet) -> (Vec<Asked>, Vec<String>) {
    if matches!(set, PlannedSet::Generalisation | PlannedSet::CoArticulation) {
        return (set.trials().into_iter().map(Asked::Parameters).collect(), Vec::new());
    }
    let (trials, left_out) = shipped::trials(set);
    (trials.into_iter().map(Asked::Shipped).collect(), left_out)
}

/// Those who do the sets, of one processor.
struct Performers {
    asked: [Performer; 2],
    shipped: Shipped,
}

/// Fills a set, or a part of it.
///
/// # Errors
/// No corpus, a set that is not known, a wish to stop: given again, it goes on.
pub fn generate(order: &GenerateOrder, observer: &dyn Observer) -> Result<GenerateReport, Error> {
    // Seeds are kept as numbers of which this is the last that is exact.
    if order.seed > MOST_SEED {
        return Err(Error::of(ErrorKind::OutsideLimits, "a seed is too large to be kept")
            .at("--seed")
            .got(order.seed.to_string())
            .allowed(format!("0 to {MOST_SEED}")));
    }
    let set = PlannedSet::of(&order.set).ok_or_else(|| {
        Error::of(ErrorKind::Unknown, "no set is called so").none_of(
            &order.set,
            PlannedSet::ALL.map(PlannedSet::word),
            "take one of these",
        )
    })?;
    let (all, left_out) = trials(set);
    let planned: Vec<(usize, Asked)> =
        all.into_iter().enumerate().filter(|(at, _)| order.part.has(*at)).collect();
    let known = known(&Store::open(&order.corpus)?, set, order.seed)?;
    let mut report = GenerateReport {
        outcome: Outcome::Done,
        corpus: super::shown(&order.corpus),
        version: String::new(),
        set: set.word(),
        part: order.part.numbers(),
        seed: order.seed,
        added: 0,
        found: 0,
        changed: Vec::new(),
        left_out,
        alike: Vec::new(),
        trials: Vec::new(),
    };
    let is_known = |(_, of): &&(usize, Asked)| known.contains_key(&of.planned().name);
    let wanted: Vec<&(usize, Asked)> =
        planned.iter().filter(|of| order.verify || !is_known(of)).collect();
    report.found = planned.iter().filter(is_known).count() as u64;
    let mut performers = Workers::new()?;
    for (done, batch) in wanted.chunks(BATCH).enumerate() {
        let (done, total) = ((done * BATCH) as u64, wanted.len() as u64);
        observer.hear(Event::Step { done, total, what: "trials" });
        let mut made = Vec::with_capacity(batch.len());
        let mut stopped = Ok(());
        for few in batch.chunks(performers.each.len()) {
            stopped = go_on(observer);
            if stopped.is_err() {
                break;
            }
            made.extend(performers.make(few, set, order.seed)?);
        }
        for (trial, new) in &made {
            let sha256 = &new.entry.frames_sha256;
            match known.get(&new.entry.name) {
                Some(known) if known != sha256 => report.changed.push(trial.name.clone()),
                _ => {}
            }
        }
        report.trials.extend(made.iter().map(|(trial, _)| trial.clone()));
        made.retain(|(trial, _)| !known.contains_key(&trial.name));
        let new = made.into_iter().map(|(_, new)| new).collect();
        report.added += add(order, set, new, &mut report.alike, observer)?;
        // What was made until then is kept.
        stopped?;
    }
    let total = wanted.len() as u64;
    observer.hear(Event::Step { done: total, total, what: "trials" });
    if !report.changed.is_empty() || report.trials.iter().any(|of| !of.missed.is_empty()) {
        report.outcome = Outcome::DoneWithLoss;
    }
    report.version = Store::open(&order.corpus)?.version().version.clone();
    Ok(report)
}

/// Names and hashes of the trials that are there.
fn known(store: &Store, set: PlannedSet, seed: u64) -> Result<BTreeMap<String, String>, Error> {
    let mut known = BTreeMap::new();
    for note in store.files(TRIALS).filter(|note| note.set == set.word()) {
        for of in store.trials_in(note)? {
            let is_own = of.kind == TrialKind::Generated
                && of.parameters.get("seed").copied() == Some(seed as f64);
            if is_own {
                known.insert(of.name, of.frames_sha256);
            }
        }
    }
    Ok(known)
}

/// Adds what was made, a step for each action, and says how much that was; another process that adds is waited for.
fn add(
    order: &GenerateOrder,
    set: PlannedSet,
    made: Vec<NewTrial>,
    alike: &mut Vec<String>,
    observer: &dyn Observer,
) -> Result<u64, Error> {
    if made.is_empty() {
        return Ok(0);
    }
    let mut waited = 0;
    let mut store = loop {
        match Store::open_to_change(&order.corpus) {
            Err(error) if error.kind == ErrorKind::Busy && waited < WAITS => {
                go_on(observer)?;
                waited += 1;
                if waited == SAID_AFTER {
                    let who = error.got.as_deref().unwrap_or("another program");
                    observer.hear(Event::Note(&format!(
                        "{who} changes the corpus: it is waited for, {} s at most",
                        (WAIT * WAITS).as_secs()
                    )));
                }
                thread::park_timeout(WAIT);
            }
            other => break other?,
        }
    };
    // Somebody else may have made the same meanwhile.
    let there: BTreeSet<String> = known(&store, set, order.seed)?.into_keys().collect();
    let mut own = own_frames(&store, &made)?;
    let mut by_action: BTreeMap<String, Vec<NewTrial>> = BTreeMap::new();
    let mut added = 0;
    for new in made.into_iter().filter(|new| !there.contains(&new.entry.name)) {
        let name = format!("{} {}", set.word(), new.entry.name);
        if let Some(other) = own.get(&new.entry.trial) {
            alike.push(format!("{name}: the same frames as {other}"));
            continue;
        }
        own.insert(new.entry.trial.clone(), name);
        added += 1;
        by_action.entry(new.entry.action.clone()).or_default().push(new);
    }
    for (action, new) in by_action {
        let words = format!("{}, {action}, seed {}", set.word(), order.seed);
        store.add(set.word(), &action, new, &[], &words)?;
    }
    Ok(added)
}

/// Trials of the corpus whose frames are among those that were made, by id.
fn own_frames(store: &Store, made: &[NewTrial]) -> Result<BTreeMap<String, String>, Error> {
    let ids: Vec<String> = made.iter().map(|new| format!("\"{}\"", new.entry.trial)).collect();
    let question = Question::parse(&format!("trial in ({})", ids.join(", ")))?;
    let mut found = BTreeMap::new();
    Selection::new(store, &question, false)?.trials(u64::MAX, |entry| {
        found.insert(entry.trial, format!("{} {}", entry.set, entry.name));
        Ok(())
    })?;
    Ok(found)
}

/// Those who do the sets, once for each processor.
struct Workers {
    each: Vec<Performers>,
}

impl Workers {
    fn new() -> Result<Self, Error> {
        let count = thread::available_parallelism().map_or(1, usize::from).min(BATCH);
        let performer = |stature_m: f64| Proportions::of_stature(stature_m).map(Performer::of);
        let own = || {
            let asked = [performer(STATURES_M[0])?, performer(STATURES_M[1])?];
            Ok(Performers { asked, shipped: Shipped::at(RATE_HZ) })
        };
        Ok(Self { each: (0..count).map(|_| own()).collect::<Result<_, Error>>()? })
    }

    /// Makes some trials, in their order.
    fn make(
        &mut self,
        batch: &[&(usize, Asked)],
        set: PlannedSet,
        seed: u64,
    ) -> Result<Vec<(GeneratedTrial, NewTrial)>, Error> {
        let count = self.each.len();
        let mut made: Vec<(usize, Result<_, Error>)> = Vec::with_capacity(batch.len());
        thread::scope(|scope| {
            let workers = self.each.iter_mut().enumerate();
            let begin = |(worker, performers)| {
                let own = batch.iter().enumerate().skip(worker).step_by(count);
                scope.spawn(move || share(own, performers, set, seed))
            };
            let running: Vec<_> = workers.map(begin).collect();
            for worker in running {
                match worker.join() {
                    Ok(some) => made.extend(some),
                    Err(panic) => std::panic::resume_unwind(panic),
                }
            }
        });
        made.sort_by_key(|(at, _)| *at);
        made.into_iter().map(|(_, made)| made).collect()
    }
}

/// A trial that was made, and what there is to be added.
type MadeTrial = Result<(GeneratedTrial, NewTrial), Error>;

/// What one of them makes of a batch, by place in it.
fn share<'a>(
    own: impl Iterator<Item = (usize, &'a &'a (usize, Asked))>,
    performers: &mut Performers,
    set: PlannedSet,
    seed: u64,
) -> Vec<(usize, MadeTrial)> {
    own.map(|(at, (index, asked))| (at, trial(performers, asked, *index, set, seed))).collect()
}

/// The parameters of a trial: of the grid, or drawn beside it.
fn parameters(planned: &PlannedTrial, index: usize, seed: u64) -> BTreeMap<&'static str, f64> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    random.set_stream(index as u64);
    let mut parameters = planned.parameters.clone();
    for (name, value) in &mut parameters {
        let beside = planned.beside.get(name).copied().unwrap_or(0.0);
        let drawn: f64 = random.random_range(-1.0..=1.0);
        if seed > 0 && beside > 0.0 {
            // What is measured is not below zero, where a direction goes to either side.
            let least = if *name == "direction_rad" { f64::MIN } else { 0.0_f64.min(*value) };
            *value = (*value + drawn * beside).max(least);
        }
    }
    parameters
}

/// What is to be done for these parameters.
///
/// # Errors
/// An action that is none of those that are made for what is asked.
pub(in crate::job) fn ask(action: &str, parameters: &BTreeMap<&str, f64>) -> Result<Ask, Error> {
    let of = |name: &str| parameters.get(name).copied();
    let value = |name: &str| of(name).unwrap_or(0.0);
    let target_m = DVec3::new(value("target_x_m"), value("target_y_m"), value("target_z_m"));
    let direction_rad = value("direction_rad");
    let length_m = value("length_m");
    Ok(match action {
        "reach" => Ask::Reach { target_m, speed_m_s: of("speed_m_s") },
        "kick" => Ask::Kick { target_m, speed_m_s: value("speed_m_s") },
        "step" => Ask::Step { direction_rad, length_m },
        "sit-stand" => Ask::SitAndStand { height_m: value("height_m") },
        "lift" => Ask::Lift { load_kg: value("load_kg") },
        "walk" => Ask::Walk { direction_rad },
        "jog" => Ask::Jog { direction_rad },
        "hop" => Ask::Hop { direction_rad, length_m },
        "jump" => Ask::Jump { direction_rad, length_m },
        "step>reach" => Ask::StepThenReach { direction_rad },
        "reach>step" => Ask::ReachThenStep { direction_rad },
        other => {
            return Err(Error::of(ErrorKind::Unknown, "no action that can be asked for").got(other));
        }
    })
}

/// The poses that are kept of a motion: from the point below the centre of mass, at [`RATE_HZ`]; of who does not stand alone,
/// from there.
///
/// # Errors
/// As of motions.
fn frames(made: &Made, body: &Proportions, stand: Option<Stand>) -> Result<TrialFrames, Error> {
    let mut poses = made.motion.poses(body, RATE_HZ)?;
    let (at_m, faces_rad) = stand.map_or((DVec3::ZERO, 0.0), |of| (of.at_m, of.faces_rad));
    let moved_m = at_m - DQuat::from_rotation_z(faces_rad) * origin_m(body);
    poses.iter_mut().for_each(|pose| pose.root_m += moved_m);
    Ok(TrialFrames::of(&poses))
}

fn trial(
    performers: &mut Performers,
    asked: &Asked,
    index: usize,
    set: PlannedSet,
    seed: u64,
) -> Result<(GeneratedTrial, NewTrial), Error> {
    let planned = asked.planned();
    let said = |error: Error| error.at(format!("{}, seed {seed}", planned.name));
    let parameters = parameters(planned, index, seed);
    let (made, body, missed, stand, parts_s) = match asked {
        Asked::Parameters(_) => {
            let performer = &mut performers.asked[usize::from(planned.performer == 2)];
            let made = ask(planned.action, &parameters).and_then(|ask| performer.make(&ask));
            let (made, body) = (made.map_err(said)?, *performer.body());
            let missed = made.missed(&body)?.into_iter();
            let missed = missed
                .map(|of| format!("{}: {:.4}, to be below {:.4}", of.what, of.got, of.most))
                .collect();
            let parts_s = made.parts_s.clone();
            (made, body, missed, None, parts_s)
        }
        Asked::Shipped(shipped) => {
            let made = performers.shipped.make(shipped, seed).map_err(said)?;
            let ShippedMotion { varied, stand, parts_s } = made;
            let falls = varied.status == VariationStatus::Implausible;
            let missed = if falls { vec!["its feet do not hold".to_owned()] } else { Vec::new() };
            (Made::of(varied.motion, Vec::new()), varied.body, missed, Some(stand), parts_s)
        }
    };
    let frames = frames(&made, &body, stand)?;
    let mut trial = judged(&made, &body, &frames.poses(), missed)?;
    let sha256 = frames.sha256(RATE_HZ);
    trial.name.clone_from(&planned.name);
    trial.action = planned.action;
    trial.trial = sha256.chars().take(16).collect();
    let mut parameters: BTreeMap<String, f64> =
        parameters.into_iter().map(|(name, value)| (name.to_owned(), value)).collect();
    parameters.insert("seed".to_owned(), seed as f64);
    parameters.insert("variation".to_owned(), index as f64);
    if let (false, Some(speed)) = (parameters.contains_key("speed_m_s"), made.speed_m_s) {
        parameters.insert("speed_m_s".to_owned(), speed);
    }
    let entry = TrialEntry {
        trial: trial.trial.clone(),
        name: planned.name.clone(),
        set: set.word().to_owned(),
        action: planned.action.to_owned(),
        kind: TrialKind::Generated,
        synthetic: true,
        subject: None,
        session: planned.together.then(|| format!("{}-{seed}", planned.action)),
        source: format!("{} {} seed {seed}", set.word(), planned.name),
        format: "generated".to_owned(),
        source_sha256: None,
        source_file: None,
        provenance: Some(format!("body model of {} m", body.stature_m())),
        licence: super::add::OWN.to_owned(),
        noncommercial: false,
        verdict: Some(if trial.missed.is_empty() { "keep" } else { "retake" }.to_owned()),
        repetitions: Some(1),
        edits_sha256: None,
        untracked: None,
        part_of: None,
        body_stature_m: body.stature_m(),
        frames: frames.len() as i64,
        rate_hz: RATE_HZ,
        duration_s: frames.len().saturating_sub(1) as f64 / RATE_HZ,
        frames_sha256: sha256,
        parameters,
        place: None,
    };
    let mut labels = vec![throughout(planned.action, frames.len(), GENERATOR)];
    // What it is made of, frame by frame; the casts saturate.
    for (part, (from_s, to_s)) in planned.parts().zip(parts_s) {
        let label = throughout(part, frames.len(), GENERATOR);
        let (first, last) = ((from_s * RATE_HZ).ceil() as i64, (to_s * RATE_HZ) as i64);
        labels.push(LabelEntry {
            first_frame: first.min(label.last_frame),
            last_frame: last.min(label.last_frame),
            ..label
        });
    }
    for label in &mut labels {
        label.trial.clone_from(&entry.trial);
        label.set.clone_from(&entry.set);
        label.action.clone_from(&entry.action);
    }
    Ok((trial, NewTrial { entry, frames: Some(frames), labels, source: None }))
}

/// Where what is marked is in a pose, m.
fn place_m(body: &Proportions, pose: &SegmentPose, of: Marked) -> DVec3 {
    let at = body.positions(pose);
    let middle =
        |ends: &[End]| ends.iter().map(|end| at.end_m(*end)).sum::<DVec3>() / ends.len() as f64;
    match of {
        Marked::End(end) => at.end_m(end),
        Marked::Foot(Side::Left) => middle(&SOLES[..2]),
        Marked::Foot(Side::Right) => middle(&SOLES[2..]),
        Marked::Feet => middle(&SOLES),
        Marked::RootHeight => DVec3::Z * pose.root_m.z,
    }
}

/// What the frames that are kept say.
fn judged(
    made: &Made,
    body: &Proportions,
    poses: &[SegmentPose],
    mut missed: Vec<String>,
) -> Result<GeneratedTrial, Error> {
    let origin_m = origin_m(body);
    let last = poses.len().saturating_sub(1);
    let away = made.marks.iter().map(|mark| {
        // Marks are at times of frames; the cast saturates.
        let frame = ((mark.at_s * RATE_HZ).round() as usize).min(last);
        let wanted_m = match mark.of {
            Marked::RootHeight => mark.at_m,
            _ => mark.at_m - origin_m,
        };
        place_m(body, &poses[frame], mark.of).distance(wanted_m)
    });
    let away_m = away.fold(0.0, f64::max);
    let footing = Footing::of(body, poses, RATE_HZ)?;
    let all = 0..poses.len();
    let sits = |frame: usize| {
        let at_s = frame as f64 / RATE_HZ;
        made.seated_s.is_some_and(|(from_s, to_s)| (from_s..=to_s).contains(&at_s))
    };
    let margins = footing.margins_m().iter().enumerate();
    let margins = margins.filter(|(frame, _)| !sits(*frame)).filter_map(|(_, margin)| *margin);
    let is_told = made.load.is_none() && footing.flying(all) == 0.0;
    let weight_n = body.mass_kg() * crate::rigid::ground::GRAVITY_M_S2;
    let load_n = |frame: usize| {
        let at_s = frame as f64 / RATE_HZ;
        made.load
            .filter(|(_, from_s)| at_s >= *from_s)
            .map_or(0.0, |(load_kg, _)| load_kg * crate::rigid::ground::GRAVITY_M_S2)
    };
    // What is carried is accelerated as the body is, on the whole.
    let forces = footing.force_body_weights().iter().enumerate();
    let forces = forces.map(|(frame, weights)| weights * (weight_n + load_n(frame)));
    if away_m > MOST_AWAY_M {
        missed.push(format!("away_m: {away_m:.4}, to be below {MOST_AWAY_M}"));
    }
    Ok(GeneratedTrial {
        name: String::new(),
        action: "",
        trial: String::new(),
        away_mm: 1e3 * away_m,
        sinks_mm: 1e3 * (-footing.lowest_m()).max(0.0),
        slides_mm: 1e3
            * Footing::of(body, &made.motion.poses(body, SLIDES_HZ)?, SLIDES_HZ)?.slide_m(),
        root_m_s2: footing.root_acceleration_m_s2(),
        margin_mm: is_told.then(|| 1e3 * margins.fold(f64::MAX, f64::min)),
        force_n: forces.fold(0.0, f64::max),
        missed,
    })
}
