//! How fast actions are named on one core, from joint positions in memory to events, features and contacts included, with
//! 25, 250 and 2,500 models, and how late an event is known; and, on labelled clips, how good and how fast that is beside two
//! recognisers that learn from examples: `cargo bench --bench recognition -- [FOLDER]`.
//!
//! Speeds are by the time of the thread, so that other programs do not count; times of single frames are by the clock.
//!
//! The folder has clips and a `labels.csv` (`file`, `class`), as `score classification` reads it. DTW and HMMs learn from the
//! first, third, ... clip of each class by name and all are judged on the others, by clip: right if the class was named, false
//! for each other class that was. Both see the rows of features that models see, and a clip as a whole; they name one class,
//! of those that models know or none of them.

use gaitway::action::phrase;
use gaitway::body::{BodyFigure, Proportions};
use gaitway::job::source::{CaptureOptions, body_motion};
use gaitway::mocap::anatomy::Capture;
use gaitway::recognise::features::{Extractor, FEATURES, Noise};
use gaitway::recognise::machine::ActionEvent;
use gaitway::recognise::model::{ActionModel, FeatureRange, vocabulary};
use gaitway::recognise::points::{Lengths, Points};
use gaitway::recognise::posture::EquationReading;
use gaitway::recognise::score::{ClassTally, interval};
use gaitway::recognise::stream::Recogniser;
use gaitway::table::rows;
use rustix::time::{ClockId, clock_gettime};
use std::collections::{BTreeMap, BTreeSet};
use std::hint::black_box;
use std::path::Path;
use std::time::Instant;

#[path = "recognition/learned.rs"]
mod learned;

/// The models of Salamah and Brunnett's 25 actions.
const PAPER: [&str; 25] = [
    "box-l",
    "box-r",
    "chop-l",
    "chop-r",
    "drink-r",
    "fight",
    "hop",
    "hop-l",
    "hop-r",
    "jump",
    "jumping-jacks",
    "kick-r",
    "knee-kick-r",
    "run-l",
    "run-r",
    "side-kick-r",
    "sit-down",
    "squat",
    "stand-up",
    "swing-arms-circular",
    "swing-arms-sagittal",
    "swing-arms-transverse",
    "throw-r",
    "walk-l",
    "walk-r",
];
/// What is done where no clips are at hand.
const ACTIONS: &str = "walk:6s,wave-r,bow,run:5s,kick-r,box-l,jump,kick-l,wave-l,box-r,squat";
/// Frames that a speed is measured over, at least.
const FRAMES: usize = 100_000;
const ROUNDS: usize = 7;

struct Clip {
    label: String,
    lengths: Lengths,
    noise: Option<Noise>,
    rate_hz: f64,
    frames: Vec<Points>,
}

impl Clip {
    fn of(label: &str, capture: &Capture) -> Self {
        let body = Proportions::of_figure(BodyFigure::DrillisContini, capture.stature_m)
            .expect("a body of this stature");
        let points = |pose| Points::of(&body, pose, &capture.tracked);
        let frames: Vec<Points> = capture.poses.iter().map(points).collect();
        let lengths = Lengths::of(&body);
        let noise = Noise::of_quietest(&frames, capture.rate_hz);
        let noise = noise.filter(|noise| noise.is_still(&lengths));
        Self { label: label.to_owned(), lengths, noise, rate_hz: capture.rate_hz, frames }
    }

    fn read(label: &str, motion: &str) -> Self {
        let (capture, _) =
            body_motion(motion, None, &CaptureOptions::default()).expect("a clip of a person");
        Self::of(label, &capture)
    }

    fn recogniser(&self, models: &[ActionModel]) -> Recogniser {
        Recogniser::new(models.to_vec(), self.lengths, EquationReading::Repaired, self.noise)
    }

    /// What a recogniser that learns sees of it.
    fn rows(&self) -> Vec<[f64; FEATURES]> {
        let mut extractor = Extractor::new(self.lengths, EquationReading::Repaired, self.noise);
        let row = |points| extractor.next(points, 1.0 / self.rate_hz).values;
        self.frames.iter().map(row).collect()
    }
}

fn main() {
    let folder = std::env::args().skip(1).find(|word| !word.starts_with("--"));
    let clips = folder.as_deref().map(|folder| labelled(Path::new(folder)));
    let made;
    let heard = match &clips {
        Some(clips) => clips,
        None => {
            assert!(phrase::is_phrase(ACTIONS));
            made = vec![Clip::read("actions", ACTIONS)];
            &made
        }
    };
    speed(heard);
    let models = vocabulary::all().expect("models");
    match &clips {
        Some(clips) => judge(clips, &models),
        None => println!("SKIPPED: no folder of labelled clips to learn from"),
    }
}

/// Time that this thread has worked, s.
fn worked_s() -> f64 {
    let time = clock_gettime(ClockId::ThreadCPUTime);
    time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64
}

/// Frames per second and the time of each frame, with more and more models.
fn speed(clips: &[Clip]) {
    let models: Vec<ActionModel> =
        PAPER.iter().map(|name| vocabulary::find(name).expect(name)).collect();
    println!(
        "{:>6} {:>12} {:>10} {:>10} {:>12} {:>14} {:>12}",
        "models", "frames/s", "median us", "p99 us", "p99.9 us", "events", "s of motion"
    );
    for copies in [0, 1, 10, 100] {
        let models: Vec<ActionModel> = (0..copies)
            .flat_map(|copy| models.iter().map(move |model| varied(model, copy)))
            .collect();
        let (mut times, mut events, mut frames) = (Vec::new(), 0, 0);
        let mut of_frames = Vec::with_capacity(FRAMES);
        let mut seconds = 0.0;
        for round in 0..ROUNDS {
            frames = 0;
            events = 0;
            seconds = 0.0;
            let mut took_s = 0.0;
            let mut turn = clips.iter().cycle();
            while frames < FRAMES
                && let Some(clip) = turn.next()
            {
                let mut recogniser = clip.recogniser(&models);
                let dt_s = 1.0 / clip.rate_hz;
                let mut tell = |_, _, what| {
                    events += usize::from(matches!(what, ActionEvent::Done { .. }));
                };
                let start = worked_s();
                if round == 0 {
                    for points in &clip.frames {
                        let start = Instant::now();
                        recogniser.next(black_box(points), dt_s, &mut tell);
                        of_frames.push(start.elapsed().as_secs_f64());
                    }
                } else {
                    for points in &clip.frames {
                        recogniser.next(black_box(points), dt_s, &mut tell);
                    }
                }
                took_s += worked_s() - start;
                black_box(&recogniser);
                frames += clip.frames.len();
                seconds += clip.frames.len() as f64 * dt_s;
            }
            if round > 0 {
                times.push(took_s);
            }
        }
        times.sort_by(f64::total_cmp);
        of_frames.sort_by(f64::total_cmp);
        let at = |share: f64| 1e6 * of_frames[(share * (of_frames.len() - 1) as f64) as usize];
        println!(
            "{:>6} {:>12.0} {:>10.2} {:>10.2} {:>12.2} {:>14} {:>12.0}",
            models.len(),
            frames as f64 / times[times.len() / 2],
            at(0.5),
            at(0.99),
            at(0.999),
            events,
            seconds
        );
    }
}

/// The model with thresholds up to a fifth lower or higher; the first copy is the model itself.
fn varied(model: &ActionModel, copy: usize) -> ActionModel {
    let mut varied = model.clone();
    varied.name = format!("{}-{copy}", model.name);
    let factor = 0.8 + 0.4 * ((copy as f64 * 0.618_033_988_75 + 0.5) % 1.0);
    let scaled =
        |range: FeatureRange| FeatureRange { from: range.from * factor, to: range.to * factor };
    for phase in varied.phases.iter_mut().filter(|_| copy > 0) {
        // What is true or false stays so.
        let measured = phase.gates.iter_mut().chain(&mut phase.means);
        for condition in measured.filter(|of| of.range.from != of.range.to) {
            condition.range = scaled(condition.range);
        }
        for travel in &mut phase.travels {
            travel.amount = scaled(travel.amount);
            travel.speed = scaled(travel.speed);
        }
    }
    varied
}

/// The clips that a table of labels names.
fn labelled(folder: &Path) -> Vec<Clip> {
    let text = std::fs::read_to_string(folder.join("labels.csv")).expect("labels.csv");
    let mut rows = rows(&text);
    let titles = rows.next().expect("titles").expect("titles");
    let column = |name: &str| titles.cells().position(|title| title == name).expect(name);
    let (file, class) = (column("file"), column("class"));
    let mut named: Vec<(String, String)> = rows
        .map(|row| {
            let row = row.expect("a row");
            let cell = |at: usize| row.cells().nth(at).expect("a cell").to_owned();
            (cell(class), cell(file))
        })
        .collect();
    named.sort();
    let motion = |file: &str| folder.join(file).display().to_string();
    named.iter().map(|(class, file)| Clip::read(class, &motion(file))).collect()
}

/// The action that a label means, if models know it.
fn meant(label: &str) -> Option<&'static str> {
    match label {
        "bye" | "byebye" => Some("wave"),
        "dash" | "run" => Some("run"),
        "bow" => Some("bow"),
        "walk" | "walk-left" | "walk-right" => Some("walk"),
        _ if label.starts_with("wave") => Some("wave"),
        _ if label.starts_with("walk-turn") => Some("walk"),
        _ => None,
    }
}

/// Precision and recall of the models and of those who learned, on clips that none of them was made from.
fn judge(clips: &[Clip], models: &[ActionModel]) {
    let mut place: BTreeMap<&str, usize> = BTreeMap::new();
    let (mut taught, mut judged) = (Vec::new(), Vec::new());
    for clip in clips {
        let place = place.entry(&clip.label).or_default();
        if place.is_multiple_of(2) {
            taught.push(clip)
        } else {
            judged.push(clip)
        }
        *place += 1;
    }
    let examples: Vec<(&str, Vec<[f64; FEATURES]>)> =
        taught.iter().map(|clip| (clip.label.as_str(), clip.rows())).collect();
    let judged_rows: Vec<Vec<[f64; FEATURES]>> = judged.iter().map(|clip| clip.rows()).collect();
    let frames: usize = judged_rows.iter().map(Vec::len).sum();
    println!("\n{} clips to learn from, {} judged, {frames} frames", taught.len(), judged.len());

    let start = worked_s();
    let named = judged.iter().map(|clip| {
        let mut recogniser = clip.recogniser(models);
        let mut found = BTreeSet::new();
        let mut tell = |index: usize, _, what| {
            if matches!(what, ActionEvent::Done { .. }) {
                found.insert(models[index].action.clone());
            }
        };
        for points in &clip.frames {
            recogniser.next(points, 1.0 / clip.rate_hz, &mut tell);
        }
        recogniser.finish(&mut tell);
        found
    });
    let named: Vec<BTreeSet<String>> = named.collect();
    table("models", &judged, &named, frames, worked_s() - start);

    let scale = learned::Scale::of(&examples);
    let nearest = learned::Nearest::new(&scale, &examples);
    let markov = learned::MarkovModels::new(&scale, &examples);
    let by_warping = |rows: &[learned::Row]| nearest.label(&scale.scaled(rows));
    let by_likelihood = |rows: &[learned::Row]| markov.label(&scale.scaled(rows));
    judge_learned("DTW, nearest neighbour", &judged, &judged_rows, by_warping);
    judge_learned("HMM for each class", &judged, &judged_rows, by_likelihood);
}

fn judge_learned(
    name: &str,
    judged: &[&Clip],
    rows: &[Vec<learned::Row>],
    label: impl Fn(&[learned::Row]) -> String,
) {
    let frames = rows.iter().map(Vec::len).sum();
    let start = worked_s();
    let named = |rows: &Vec<learned::Row>| {
        meant(&label(rows)).map(str::to_owned).into_iter().collect::<BTreeSet<String>>()
    };
    let named: Vec<BTreeSet<String>> = rows.iter().map(named).collect();
    table(name, judged, &named, frames, worked_s() - start);
}

fn table(name: &str, clips: &[&Clip], named: &[BTreeSet<String>], frames: usize, took_s: f64) {
    let mut classes: BTreeMap<String, ClassTally> = BTreeMap::new();
    for (clip, found) in clips.iter().zip(named) {
        let truth = meant(&clip.label);
        for action in found {
            let tally = classes.entry(action.clone()).or_default();
            tally.recognised += 1;
            tally.correct += usize::from(truth == Some(action));
        }
        if let Some(truth) = truth {
            classes.entry(truth.to_owned()).or_default().truth += 1;
        }
    }
    println!("{name}: {:.0} frames/s", frames as f64 / took_s);
    let all = classes.values().fold(ClassTally::default(), |all, tally| all.plus(*tally));
    for (class, tally) in classes.iter().chain([(&"all".to_owned(), &all)]) {
        let share = |of: usize, all: usize| match interval(of, all) {
            Some([from, to]) => format!(
                "{:5.1} ({:.0} to {:.0})",
                100.0 * of as f64 / all as f64,
                100.0 * from,
                100.0 * to
            ),
            None => "-".to_owned(),
        };
        println!(
            "  {class:16} {:>3} clips  precision {:>18}  recall {:>18}",
            tally.truth,
            share(tally.correct, tally.recognised),
            share(tally.correct, tally.truth)
        );
    }
}
