//! Actions made of actionlets, as files: one motion, or variations by the thousand.

mod bulk;
mod catalogue;
mod room;

pub use bulk::{ClassOrder, ClassReport, MAX_VARIATIONS, VariedReport, tables_beside, vary};

use super::composition::{Composed, GaitChangeReport, InsertReport, compose};
use super::observer::Observer;
use super::pending::unless_stopped;
use super::report::Outcome;
use super::share::Share;
use crate::action::corpus::{Corpus, VariationStatus, Variations};
use crate::action::database::Types;
use crate::action::{
    Action, Database, Fits, FootingBounds, Inserts, Join, Missed, Motion, Spread, phrase, table,
};
use crate::actionlet::shape::PEAK_AT;
use crate::body::contact::Footing;
use crate::body::{BodyFigure, Proportions, SegmentPose, Sex};
use crate::draft;
use crate::error::{Error, ErrorKind};
use crate::mocap::scene::{DrawnFeet, Scene};
use crate::mocap::{bvh, export, humanoid};
use crate::toml_text::advice;
use crate::view::scene::page_of;
use serde::Serialize;
use std::fmt::Write as _;
use std::path::PathBuf;

/// How actions are made, and where they are written.
#[derive(Clone, Debug, PartialEq)]
pub struct SynthOrder {
    /// Pieces of other actions that are pasted in; none where variations are made.
    pub inserts: Inserts,
    /// How it is changed.
    pub figures: Figures,
    /// Poses per second.
    pub rate_hz: f64,
    /// Seed of the variations.
    pub seed: u64,
    /// Folders of action files whose velocity functions variations may use as well.
    pub database: Vec<PathBuf>,
    /// Whether a corpus has joints and ends as points in space.
    pub has_points: bool,
    /// Which files of a corpus in a folder are made.
    pub part: Share,
    /// The file, whose ending says what is written; of variations perhaps a folder.
    pub file: PathBuf,
    /// A page of one motion beside it, if one is wanted.
    pub html: Option<PathBuf>,
    /// It may replace one that is there.
    pub replace: bool,
}

/// What `--set` knows.
const KEYS: [&str; 19] = [
    "duration_s",
    "rounds",
    "pace",
    "peak",
    "stature_m",
    "mass_kg",
    "sex",
    "figure",
    "leg_m",
    "blend_s",
    "vary_angle",
    "vary_time",
    "vary_peak",
    "vary_duration",
    "vary_exchange",
    "vary_stride",
    "vary_stature",
    "vary_heading_deg",
    "vary_types",
];

/// How an action is changed before it is performed.
#[derive(Clone, Debug, PartialEq)]
pub struct Figures {
    duration_s: Option<f64>,
    rounds: Option<u32>,
    pace: f64,
    peak: Option<f64>,
    stature_m: f64,
    mass_kg: Option<f64>,
    leg_m: Option<f64>,
    sex: Option<Sex>,
    figure: BodyFigure,
    blend_s: Option<f64>,
    spread: Spread,
    types: Types,
    /// As it was said.
    pairs: Vec<String>,
}

impl Figures {
    /// Reads `KEY=VALUE` pairs.
    ///
    /// # Errors
    /// If a key is unknown or a value is not its kind of number.
    pub fn read(pairs: &[String]) -> Result<Self, Error> {
        let mut figures = Self {
            duration_s: None,
            rounds: None,
            pace: 1.0,
            peak: None,
            stature_m: 1.75,
            mass_kg: None,
            leg_m: None,
            sex: None,
            figure: BodyFigure::default(),
            blend_s: None,
            spread: Spread::default(),
            types: Types::default(),
            pairs: pairs.to_vec(),
        };
        for pair in pairs {
            let wrong = |allowed: &str| {
                Error::new("cannot set this")
                    .at("--set")
                    .got(pair.clone())
                    .allowed(allowed)
                    .remedy("correct it, or leave it out")
            };
            let unknown = |key: &str| {
                let remedy = advice(key, &KEYS, "correct it, or leave it out");
                wrong(&format!("KEY=VALUE with {}", KEYS.join(", "))).remedy(remedy)
            };
            let (key, text) = pair.split_once('=').ok_or_else(|| unknown(pair))?;
            match (key, text) {
                ("vary_types", "range") => figures.types = Types::ByRange,
                ("vary_types", "paper") => figures.types = Types::ByDirection,
                ("vary_types", _) => return Err(wrong("range or paper")),
                ("sex", "female") => figures.sex = Some(Sex::Female),
                ("sex", "male") => figures.sex = Some(Sex::Male),
                ("sex", _) => return Err(wrong("female or male")),
                ("figure", "de-leva") => figures.figure = BodyFigure::DeLeva,
                ("figure", "drillis-contini") => figures.figure = BodyFigure::DrillisContini,
                ("figure", _) => return Err(wrong("de-leva or drillis-contini")),
                _ if !KEYS.contains(&key) => return Err(unknown(key)),
                _ => figures.set(key, text, &wrong)?,
            }
        }
        figures.spread.check()?;
        Ok(figures)
    }

    /// Sets a value that is a number.
    fn set(&mut self, key: &str, text: &str, wrong: &dyn Fn(&str) -> Error) -> Result<(), Error> {
        let value: f64 = text.parse().map_err(|_| wrong("a number"))?;
        if !value.is_finite() {
            return Err(wrong("a finite number"));
        }
        match key {
            "duration_s" => self.duration_s = Some(value),
            "rounds" if value.fract() == 0.0 && (1.0..=1e5).contains(&value) => {
                self.rounds = Some(value as u32);
            }
            "rounds" => return Err(wrong("a whole number from 1 to 100000")),
            "pace" if phrase::PACES.contains(&value) => self.pace = value,
            "pace" => return Err(wrong("0.1 to 10")),
            "peak" if PEAK_AT.contains(&value) => self.peak = Some(value),
            "peak" => return Err(wrong("0.1 to 0.9")),
            "stature_m" => self.stature_m = value,
            "mass_kg" => self.mass_kg = Some(value),
            "blend_s" if value > 0.0 => self.blend_s = Some(value),
            "blend_s" => return Err(wrong("above 0 s, to the length of what it joins")),
            "vary_angle" => self.spread.angle = value,
            "vary_time" => self.spread.time = value,
            "vary_peak" => self.spread.peak = value,
            "vary_duration" => self.spread.duration = value,
            "vary_exchange" => self.spread.exchange = value,
            "vary_stride" => self.spread.stride = value,
            "vary_stature" => self.spread.stature = value,
            "vary_heading_deg" => self.spread.heading_rad = value.to_radians(),
            _ => self.leg_m = Some(value),
        }
        Ok(())
    }

    /// An action with these figures.
    fn applied(&self, mut action: Action) -> Result<Action, Error> {
        if let Some(duration_s) = self.duration_s {
            let range = crate::action::file::MIN_DURATION_S..=crate::action::file::MAX_DURATION_S;
            if !range.contains(&duration_s) {
                return Err(Error::new("a duration is out of range")
                    .at("--set duration_s")
                    .got(duration_s.to_string())
                    .allowed(format!("{} to {} s", range.start(), range.end())));
            }
            action.duration_s = duration_s;
        }
        action.duration_s /= self.pace;
        if let Some(rounds) = self.rounds {
            action.rounds = rounds;
        }
        if let Some(peak) = self.peak {
            action = action.with_peak(peak).map_err(|e| e.at("--set peak"))?;
        }
        Ok(action)
    }

    /// How actions that follow one another are joined.
    fn join(&self) -> Join {
        self.blend_s.map_or(Join::Transition, Join::Blend)
    }

    /// The body that moves.
    fn body(&self) -> Result<Proportions, Error> {
        let body = Proportions::of_figure(self.figure, self.stature_m)
            .map_err(|e| e.at("--set stature_m"))?
            .of_sex(self.sex);
        let body = self.leg_m.map_or(Ok(body), |leg_m| {
            body.with_leg_length_m(leg_m).map_err(|e| e.at("--set leg_m"))
        })?;
        self.mass_kg.map_or(Ok(body), |mass_kg| {
            body.with_mass_kg(mass_kg).map_err(|e| e.at("--set mass_kg"))
        })
    }
}

/// What came of it.
#[derive(Clone, Debug, Serialize)]
pub struct SynthReport {
    /// `done`, or `done_with_loss` if feet do not hold that do on the body that actions are made for, or those of
    /// a variation do not.
    pub outcome: Outcome,
    /// What was asked for.
    pub action: String,
    /// Length, s.
    pub duration_s: f64,
    /// Poses per second.
    pub rate_hz: f64,
    /// Poses written.
    pub poses: usize,
    /// Actionlets that move something.
    pub actionlets: usize,
    /// What became of the variation, if it is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub varied: Option<VariedMotionReport>,
    /// Changes of gait without a stop, in order of time, before anything was inserted.
    pub changes: Vec<GaitChangeReport>,
    /// What was inserted, in the order in which it was.
    pub inserts: Vec<InsertReport>,
    /// How the body stands on its feet.
    pub footing: FootingReport,
    /// Where.
    pub written: String,
    /// The page beside it, if one was wanted.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub html: Option<String>,
}

/// What became of one variation.
#[derive(Clone, Debug, Serialize)]
pub struct VariedMotionReport {
    /// Its number.
    pub variation: u32,
    /// `valid`, `repaired` or `implausible`: whether its feet hold.
    pub status: &'static str,
    /// Draws before it that were thrown away.
    pub rejected: u32,
    /// Stature of the body, m.
    pub stature_m: f64,
}

/// Rate at which feet are looked at, whatever is written.
const FOOTING_HZ: f64 = 240.0;

/// How a body stands on its feet while it does something: whether it could be done.
#[derive(Clone, Debug, Serialize)]
pub struct FootingReport {
    /// How far a sole sinks into the floor, m; 0 if none does.
    pub sinks_m: f64,
    /// How far a sole slides while it is on the floor, m, the worst of all contacts.
    pub slides_m: f64,
    /// Greatest acceleration of the root, m/s^2.
    pub root_acceleration_m_s2: f64,
    /// Part of the time with both feet on the floor.
    pub both_feet: f64,
    /// Part of the time with none.
    pub flying: f64,
    /// What 1 % of the time the floor pushes less than, body weights, below 20 Hz.
    pub least_force_body_weights: f64,
    /// What 1 % of the time it pushes more than, body weights.
    pub most_force_body_weights: f64,
    /// Part of the time on the floor in which the zero-moment point lies inside the soles.
    pub balanced: f64,
    /// How far the middle of the feet has gone in the end, m.
    pub travel_m: f64,
    /// Bounds that are missed; none if the feet hold.
    pub missed: Vec<MissedReport>,
}

/// A bound that is missed.
#[derive(Clone, Debug, Serialize)]
pub struct MissedReport {
    /// What is bounded, with its unit: `sinks_m`, `slides_m`, `root_acceleration_m_s2` or `away_m`.
    pub what: &'static str,
    /// What it is.
    pub got: f64,
    /// What it is to stay below.
    pub most: f64,
}

impl MissedReport {
    fn of(missed: &Missed) -> Self {
        let Missed { what, got, most } = *missed;
        Self { what, got, most }
    }
}

impl FootingReport {
    fn of(motion: &Motion, body: &Proportions, bounds: &FootingBounds) -> Result<Self, Error> {
        let poses = motion.poses(body, FOOTING_HZ)?;
        let footing = Footing::of(body, &poses, FOOTING_HZ)?;
        let margins_m: Vec<f64> = footing.margins_m().iter().flatten().copied().collect();
        let inside = margins_m.iter().filter(|margin_m| **margin_m >= 0.0).count();
        Ok(Self {
            sinks_m: (-footing.lowest_m()).max(0.0),
            slides_m: footing.slide_m(),
            root_acceleration_m_s2: footing.root_acceleration_m_s2(),
            both_feet: footing.both_feet(0..poses.len()),
            flying: footing.flying(0..poses.len()),
            least_force_body_weights: footing.force_quantile(0.01),
            most_force_body_weights: footing.force_quantile(0.99),
            balanced: inside as f64 / margins_m.len().max(1) as f64,
            travel_m: footing.travel_m().1,
            missed: bounds.missed(motion, body)?.iter().map(MissedReport::of).collect(),
        })
    }
}

/// Writes one motion: the action as it is, or one of its variations. It is a shipped action, an action
/// file (.toml), or several: `walk:6s,wave-r,bow`, and without a stop between two gaits
/// `walk:6s+run:5s`.
///
/// # Errors
/// No such action, a figure out of range, a wish to stop, a file that cannot be written.
pub fn synth(
    order: &SynthOrder,
    phrase: &str,
    variation: Option<u32>,
    observer: &dyn Observer,
) -> Result<SynthReport, Error> {
    let (of, action) = (order.clone(), phrase.to_owned());
    let made = unless_stopped(observer, move || of.made(&action, variation))?;
    let Synthesised { report, bytes, page } = made;
    draft::write_file(&order.file, order.replace, &bytes)?;
    if let Some((path, page)) = order.html.as_ref().zip(page) {
        draft::write_file(path, order.replace, &page)?;
    }
    Ok(report)
}

/// A motion that was made.
struct Synthesised {
    /// What is to be said of it.
    report: SynthReport,
    /// What is to be written.
    bytes: Vec<u8>,
    /// Its page, if one is wanted.
    page: Option<Vec<u8>>,
}

impl SynthOrder {
    /// The motion.
    fn made(&self, phrase: &str, variation: Option<u32>) -> Result<Synthesised, Error> {
        let mut fits = Fits::of(self.figures.body()?);
        let corpus = self.corpus(phrase, &mut fits)?;
        let (mut body, mut title, mut varied) = (corpus.body, phrase.to_owned(), None);
        let made = match variation {
            Some(number) => {
                self.check_varied()?;
                let made = Variations::of(corpus.clone())?.variation(number)?;
                body = made.body;
                let _ = write!(title, ", variation {number}");
                varied = Some(VariedMotionReport {
                    variation: number,
                    status: made.status.name(),
                    rejected: made.rejected,
                    stature_m: body.stature_m(),
                });
                Composed { motion: made.motion, changes: Vec::new(), inserts: Vec::new() }
            }
            None => compose(&corpus.parts, corpus.join, &self.inserts, &mut fits)?,
        };
        let motion = &made.motion;
        let usual = self.usual_bounds(phrase)?;
        let footing = FootingReport::of(motion, &body, &usual.unwrap_or_default())?;
        let is_lost = match &varied {
            Some(varied) => varied.status == VariationStatus::Implausible.name(),
            None => usual.is_some() && !footing.missed.is_empty(),
        };
        let ending = self.file.extension().and_then(|e| e.to_str()).unwrap_or_default();
        let written = |ending: &str| bytes_of(self, ending, &title, &body, motion);
        let (bytes, page) =
            (written(ending)?, self.html.as_ref().map(|_| written("html")).transpose()?);
        let report = SynthReport {
            outcome: if is_lost { Outcome::DoneWithLoss } else { Outcome::Done },
            action: phrase.to_owned(),
            duration_s: motion.duration_s(),
            rate_hz: self.rate_hz,
            poses: motion.pose_count(self.rate_hz)?,
            actionlets: motion.moving().count(),
            varied,
            changes: made.changes,
            inserts: made.inserts,
            footing,
            written: self.file.display().to_string(),
            html: self.html.as_ref().map(|page| page.display().to_string()),
        };
        Ok(Synthesised { report, bytes, page })
    }

    /// Fails if variations are to have inserts: their seams are elsewhere, where a cut may hold none.
    fn check_varied(&self) -> Result<(), Error> {
        let Some(insert) = self.inserts.list.first() else { return Ok(()) };
        Err(Error::new("nothing can be inserted into variations")
            .got(insert.to_string())
            .remedy("insert into the action itself, or leave the variations out"))
    }

    /// How well feet hold if all is done by the body that actions are made for; none if they do not.
    fn usual_bounds(&self, phrase: &str) -> Result<Option<FootingBounds>, Error> {
        let mut fits = Fits::usual()?;
        let parts = self.parts(phrase, &mut fits)?;
        let made = compose(&parts, self.figures.join(), &self.inserts, &mut fits)?;
        FootingBounds::of(&made.motion, fits.body())
    }

    /// The actions as a body does them.
    fn parts(&self, phrase: &str, fits: &mut Fits) -> Result<Vec<phrase::Part>, Error> {
        let mut parts = phrase::load(phrase)?;
        for part in &mut parts {
            part.action = self.figures.applied(fits.fit(&part.action)?)?;
        }
        Ok(parts)
    }

    /// What variations are made of, by the body of these fits.
    fn corpus(&self, phrase: &str, fits: &mut Fits) -> Result<Corpus, Error> {
        let mut database = Database::shipped_by(self.figures.types)?;
        for folder in &self.database {
            database.add_folder(folder)?;
        }
        self.figures.spread.check()?;
        Ok(Corpus {
            label: phrase.to_owned(),
            parts: self.parts(phrase, fits)?,
            join: self.figures.join(),
            spread: self.figures.spread,
            database,
            seed: self.seed,
            rate_hz: self.rate_hz,
            body: *fits.body(),
            has_points: self.has_points,
        })
    }
}

/// The motion as the kind of file that a name with this ending asks for.
fn bytes_of(
    order: &SynthOrder,
    ending: &str,
    title: &str,
    body: &Proportions,
    motion: &Motion,
) -> Result<Vec<u8>, Error> {
    let rate_hz = order.rate_hz;
    let poses = || motion.poses(body, rate_hz);
    fn scene<'a>(
        title: &'a str,
        poses: &'a [SegmentPose],
        body: &'a Proportions,
        rate_hz: f64,
    ) -> Scene<'a> {
        Scene { title, poses, body, rate_hz, floor_m: 0.0, feet: DrawnFeet::Made }
    }
    match ending {
        "csv" => {
            let mut bytes = Vec::new();
            table::write_csv(motion, body, order.rate_hz, &mut bytes)?;
            Ok(bytes)
        }
        "bvh" => Ok(bvh::write(&export::bvh_of(&poses()?, body, order.rate_hz)).into_bytes()),
        "x3d" => Ok(humanoid::x3d_of(&scene(title, &poses()?, body, rate_hz)).into_bytes()),
        "html" => Ok(page_of(&scene(title, &poses()?, body, rate_hz))?.into_bytes()),
        _ => Err(Error::of(ErrorKind::Unknown, "this kind of file cannot be written")
            .at("-o")
            .got(order.file.display().to_string())
            .allowed("a name that ends in .csv, .bvh, .x3d or .html; with --variations .parquet")),
    }
}
