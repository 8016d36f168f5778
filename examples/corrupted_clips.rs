//! What noise, speed, rate, drift and missing joints cost the recogniser, on clips that were cut by hand.
//!
//! ```text
//! cargo run --release --example corrupted_clips -- FOLDER TABLE.csv
//! ```
//!
//! The table has the columns file, class, side (L, R or nothing), start_s and end_s, as those in `tests/cuts`.
//! Right is what has the class, the side if the cut has one, and more than half of the cut. The delay is how much later
//! than in the clip as it stands an action's end is known, in s of the clip, mean over what is right in both.

use gaitway::Error;
use gaitway::body::{BodyFigure, Proportions};
use gaitway::job::source::{CaptureOptions, body_motion};
use gaitway::recognise::features::Noise;
use gaitway::recognise::machine::{ActionEvent, Span};
use gaitway::recognise::model::{ActionModel, BodySide, vocabulary};
use gaitway::recognise::points::{BodyPoint, Lengths, Points};
use gaitway::recognise::posture::EquationReading;
use gaitway::recognise::score::is_same;
use gaitway::recognise::stream::Recogniser;
use gaitway::table::rows;
use glam::{DQuat, DVec3};
use std::collections::BTreeMap;
use std::path::Path;

/// What is done to a clip.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Corruption {
    Nothing,
    /// Standard deviation of each coordinate, m.
    White(f64),
    /// The same of noise that is slower than 3 Hz.
    Slow(f64),
    Speed(f64),
    Mirrored,
    /// Frames per second, at most.
    Rate(f64),
    /// rad/s.
    Drift(f64),
    /// The left hand is not seen.
    NoLeftHand,
}

const TRIED: [(&str, Corruption); 10] = [
    ("as it stands", Corruption::Nothing),
    ("white noise, 2 mm", Corruption::White(0.002)),
    ("white noise, 5 mm", Corruption::White(0.005)),
    ("noise below 3 Hz, 2 cm", Corruption::Slow(0.02)),
    ("0.7 times as fast", Corruption::Speed(0.7)),
    ("1.4 times as fast", Corruption::Speed(1.4)),
    ("mirrored", Corruption::Mirrored),
    ("30 frames/s", Corruption::Rate(30.0)),
    ("heading drifts 3 deg/s", Corruption::Drift(0.052)),
    ("no left hand", Corruption::NoLeftHand),
];

struct Clip {
    frames: Vec<Points>,
    rate_hz: f64,
    lengths: Lengths,
    cuts: Vec<Cut>,
}

#[derive(Clone)]
struct Cut {
    class: String,
    side: Option<BodySide>,
    span: Span,
}

struct Event {
    action: String,
    side: Option<BodySide>,
    span: Span,
    at_s: f64,
}

/// Xorshift (Marsaglia 2003), and a sum of twelve for a normal distribution.
struct Chance(u64);

impl Chance {
    fn uniform(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
    }

    fn vector(&mut self) -> DVec3 {
        DVec3::new(self.normal(), self.normal(), self.normal())
    }
}

fn main() -> Result<(), Error> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [folder, table] = arguments.as_slice() else {
        return Err(Error::new("two arguments are wanted").allowed("FOLDER TABLE.csv"));
    };
    let clips = read(Path::new(folder), Path::new(table))?;
    let models = vocabulary::all()?;
    println!(
        "{:24} {:>7} {:>10} {:>5} {:>11} {:>8} {:>8}",
        "", "correct", "recognised", "there", "precision %", "recall %", "delay s"
    );
    let mut ends: BTreeMap<(usize, usize), f64> = BTreeMap::new();
    for (name, corruption) in TRIED {
        let (mut correct, mut recognised, mut there) = (0, 0, 0);
        let mut delays = Vec::new();
        for (number, clip) in clips.iter().enumerate() {
            let (frames, rate_hz, cuts) = corrupted(clip, corruption, number);
            let events = recognise(&frames, rate_hz, &clip.lengths, models.clone());
            let mut taken = vec![false; events.len()];
            recognised += events.len();
            there += cuts.len();
            for (index, cut) in cuts.iter().enumerate() {
                let is_it = |event: &Event| {
                    event.action == cut.class
                        && (cut.side.is_none() || event.side == cut.side)
                        && is_same(&event.span, &cut.span)
                };
                let found = (0..events.len()).find(|at| !taken[*at] && is_it(&events[*at]));
                let Some(at) = found else { continue };
                taken[at] = true;
                correct += 1;
                // In s of the clip as it stands.
                let known_s = events[at].at_s
                    * if let Corruption::Speed(factor) = corruption { factor } else { 1.0 };
                if corruption == Corruption::Nothing {
                    ends.insert((number, index), known_s);
                }
                delays.extend(ends.get(&(number, index)).map(|before_s| known_s - before_s));
            }
        }
        let share = |of: usize, all: usize| 100.0 * of as f64 / all.max(1) as f64;
        println!(
            "{name:24} {correct:>7} {recognised:>10} {there:>5} {:>11.1} {:>8.1} {:>8.3}",
            share(correct, recognised),
            share(correct, there),
            delays.iter().sum::<f64>() / delays.len().max(1) as f64
        );
    }
    Ok(())
}

/// The clips of a table with what was cut in them.
fn read(folder: &Path, table: &Path) -> Result<Vec<Clip>, Error> {
    let text = std::fs::read_to_string(table)
        .map_err(|e| Error::new("cannot read the table").got(e.to_string()))?;
    let mut cuts: BTreeMap<String, Vec<Cut>> = BTreeMap::new();
    for row in rows(&text).skip(1) {
        let row = row?;
        let cells: Vec<&str> = row.cells().collect();
        let [file, class, side, _style, start, end, ..] = cells.as_slice() else { continue };
        let (Ok(start_s), Ok(end_s)) = (start.parse(), end.parse()) else { continue };
        let side = match *side {
            "L" => Some(BodySide::Left),
            "R" => Some(BodySide::Right),
            _ => None,
        };
        cuts.entry((*file).to_owned()).or_default().push(Cut {
            class: (*class).to_owned(),
            side,
            span: Span { start_s, end_s },
        });
    }
    let clip = |(file, cuts): (String, Vec<Cut>)| {
        let motion = folder.join(file).display().to_string();
        let (capture, _) = body_motion(&motion, None, &CaptureOptions::default())?;
        let body = Proportions::of_figure(BodyFigure::DrillisContini, capture.stature_m)?;
        let frames = capture.poses.iter().map(|pose| Points::of(&body, pose, &capture.tracked));
        Ok(Clip {
            frames: frames.collect(),
            rate_hz: capture.rate_hz,
            lengths: Lengths::of(&body),
            cuts,
        })
    };
    cuts.into_iter().map(clip).collect()
}

/// A clip with something done to it: its frames, their rate, and the cuts as they then are.
fn corrupted(clip: &Clip, corruption: Corruption, number: usize) -> (Vec<Points>, f64, Vec<Cut>) {
    let (mut frames, mut rate_hz, mut cuts) =
        (clip.frames.clone(), clip.rate_hz, clip.cuts.clone());
    let mut chance = Chance(0x9E37_79B9_7F4A_7C15 ^ (number as u64 + 1));
    match corruption {
        Corruption::Nothing => {}
        Corruption::White(deviation_m) => {
            for point in frames.iter_mut().flat_map(|points| &mut points.0) {
                *point += deviation_m * chance.vector();
            }
        }
        Corruption::Slow(deviation_m) => {
            // Six sines below 3 Hz for each point, with this variance together.
            for place in BodyPoint::ALL {
                let sines: Vec<(DVec3, f64, f64)> = (0..6)
                    .map(|_| {
                        (
                            chance.vector(),
                            3.0 * chance.uniform(),
                            core::f64::consts::TAU * chance.uniform(),
                        )
                    })
                    .collect();
                for (n, points) in frames.iter_mut().enumerate() {
                    let time_s = n as f64 / rate_hz;
                    let at = |(by, hz, from): &(DVec3, f64, f64)| {
                        *by * (core::f64::consts::TAU * hz * time_s + from).sin()
                    };
                    let sum: DVec3 = sines.iter().map(at).sum();
                    points[place] += deviation_m * sum / 3f64.sqrt();
                }
            }
        }
        Corruption::Speed(factor) => {
            rate_hz *= factor;
            for cut in &mut cuts {
                cut.span.start_s /= factor;
                cut.span.end_s /= factor;
            }
        }
        Corruption::Mirrored => {
            for points in &mut frames {
                let mut mirrored = Points(points.0.map(|at| DVec3::new(at.x, -at.y, at.z)));
                for first in [3, 5, 7, 9, 11] {
                    mirrored.0.swap(first, first + 1);
                }
                *points = mirrored;
            }
            for cut in &mut cuts {
                cut.side = cut.side.map(BodySide::mirrored);
            }
        }
        Corruption::Rate(most_hz) => {
            let step = (rate_hz / most_hz).round().max(1.0) as usize;
            frames = frames.into_iter().step_by(step).collect();
            rate_hz /= step as f64;
        }
        Corruption::Drift(rad_s) => {
            for (n, points) in frames.iter_mut().enumerate() {
                let turn = DQuat::from_rotation_z(rad_s * n as f64 / rate_hz);
                *points = Points(points.0.map(|at| turn * at));
            }
        }
        Corruption::NoLeftHand => {
            for points in &mut frames {
                points[BodyPoint::LeftHand] = DVec3::NAN;
            }
            // What needs it cannot be seen and is not asked for.
            let needs = |cut: &Cut| {
                cut.class == "jumping-jacks"
                    || (["wave", "box"].contains(&cut.class.as_str())
                        && cut.side == Some(BodySide::Left))
            };
            cuts.retain(|cut| !needs(cut));
        }
    }
    (frames, rate_hz, cuts)
}

fn recognise(
    frames: &[Points],
    rate_hz: f64,
    lengths: &Lengths,
    models: Vec<ActionModel>,
) -> Vec<Event> {
    let noise = Noise::of_quietest(frames, rate_hz).filter(|noise| noise.is_still(lengths));
    let mut recogniser =
        Recogniser::new(models.clone(), *lengths, EquationReading::Repaired, noise);
    let mut events = Vec::new();
    let mut tell = |index: usize, at_s: f64, what: ActionEvent| {
        if let ActionEvent::Done { span, .. } = what {
            let ActionModel { action, side, .. } = &models[index];
            events.push(Event { action: action.clone(), side: *side, span, at_s });
        }
    };
    for points in frames {
        recogniser.next(points, 1.0 / rate_hz, &mut tell);
    }
    recogniser.finish(&mut tell);
    events
}
