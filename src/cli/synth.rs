//! `synth`: actions made of actionlets, as files.

mod bulk;

use super::{Deed, Output, Remarks};
use crate::action::{Action, Join, Motion, Spread, phrase, table};
use crate::body::Proportions;
use crate::error::{Error, ErrorKind};
use crate::mocap::{bvh, export, humanoid, page};
use clap::Args;
use serde::Serialize;
use std::path::PathBuf;

/// Arguments of `synth`.
#[derive(Clone, Debug, Args)]
#[command(after_help = "Examples:\n  \
    gaitway synth walk -o walk.csv\n  \
    gaitway synth walk:6s,wave-r,bow --rate 60 -o greeting.bvh\n  \
    gaitway synth run --variations 1000000 --seed 1 --set vary_angle=0.2 -o corpus/\n  \
    gaitway synth run --variation 17 --seed 1 -o one.bvh")]
pub struct SynthArgs {
    /// A shipped action, an action file (.toml), or several: walk:6s,wave-r,bow
    action: String,
    /// Poses per second
    #[arg(long, value_name = "HZ", default_value_t = 120.0, allow_negative_numbers = true)]
    rate: f64,
    /// Make this many variations; OUT is then a .parquet file, or a folder; an interrupted run is
    /// resumed
    #[arg(long, value_name = "N", group = "varied", value_parser = clap::value_parser!(u32)
          .range(1..=i64::from(bulk::MAX_VARIATIONS)))]
    variations: Option<u32>,
    /// Make only this one of the variations, counted from 0
    #[arg(long, value_name = "NUMBER", group = "varied", value_parser = clap::value_parser!(u32)
          .range(0..i64::from(bulk::MAX_VARIATIONS)))]
    variation: Option<u32>,
    /// Seed of the variations
    #[arg(long, default_value_t = 0, requires = "varied")]
    seed: u64,
    /// Folder of action files whose velocity functions variations may use as well
    #[arg(long, value_name = "FOLDER", requires = "varied")]
    database: Vec<PathBuf>,
    /// Change a value: duration_s, rounds, pace, peak, stature_m, blend_s; for variations vary_angle,
    /// vary_time, vary_peak, vary_duration, vary_exchange
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// File to write: .csv (time_s, the 22 angles, rad, and the root, m), .bvh, .x3d (an H-Anim
    /// humanoid), or .html (a page that draws it)
    #[arg(short, long, value_name = "OUT")]
    output_file: PathBuf,
    #[command(flatten)]
    output: Output,
}

/// What `--set` says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Figures {
    duration_s: Option<f64>,
    rounds: Option<u32>,
    pace: f64,
    peak: Option<f64>,
    stature_m: f64,
    blend_s: Option<f64>,
    spread: Spread,
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
            blend_s: None,
            spread: Spread::default(),
        };
        for pair in pairs {
            let wrong = |allowed: &str| {
                Error::new("cannot set this").at("--set").got(pair.clone()).allowed(allowed)
            };
            let keys = "KEY=VALUE with duration_s, rounds, pace, peak, stature_m, blend_s or \
                        vary_angle, vary_time, vary_peak, vary_duration, vary_exchange";
            let (key, text) = pair.split_once('=').ok_or_else(|| wrong(keys))?;
            let value: f64 = text.parse().map_err(|_| wrong("a number"))?;
            match key {
                "duration_s" => figures.duration_s = Some(value),
                "rounds" if value.fract() == 0.0 && (1.0..=1e5).contains(&value) => {
                    figures.rounds = Some(value as u32);
                }
                "rounds" => return Err(wrong("a whole number from 1 to 100000")),
                "pace" if phrase::PACES.contains(&value) => figures.pace = value,
                "pace" => return Err(wrong("0.1 to 10")),
                "peak" => figures.peak = Some(value),
                "stature_m" => figures.stature_m = value,
                "blend_s" => figures.blend_s = Some(value),
                "vary_angle" => figures.spread.angle = value,
                "vary_time" => figures.spread.time = value,
                "vary_peak" => figures.spread.peak = value,
                "vary_duration" => figures.spread.duration = value,
                "vary_exchange" => figures.spread.exchange = value,
                _ => return Err(wrong(keys)),
            }
        }
        Ok(figures)
    }

    /// An action with these figures.
    ///
    /// # Errors
    /// If a figure is out of range.
    pub fn applied(&self, mut action: Action) -> Result<Action, Error> {
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
    #[must_use]
    pub fn join(&self) -> Join {
        self.blend_s.map_or(Join::Transition, Join::Blend)
    }

    /// The body that moves.
    ///
    /// # Errors
    /// If the stature is out of range.
    pub fn body(&self) -> Result<Proportions, Error> {
        Proportions::of_stature(self.stature_m)
    }
}

/// What came of it.
#[derive(Serialize)]
struct Report {
    outcome: &'static str,
    action: String,
    duration_s: f64,
    rate_hz: f64,
    poses: usize,
    actionlets: usize,
    written: String,
}

/// Runs `synth`.
///
/// # Errors
/// If there is no such action, a figure is out of range, or the file cannot be written.
pub fn run(args: &SynthArgs, remarks: Remarks) -> Result<i32, Error> {
    let figures = Figures::read(&args.set)?;
    if args.variations.is_some() {
        let made = bulk::make(args, &figures, remarks)?;
        let text = if remarks.quiet {
            format!("{}\n", made.written)
        } else {
            format!(
                "done: {} variations of {}, {} of them found, {} poses written\nwritten   {}\n",
                made.variations, args.action, made.found, made.poses, made.written
            )
        };
        return Ok(args.output.conclude(&made, &text, Deed::Work, 0));
    }
    args.output.check_files(&[&Some(args.output_file.clone())])?;
    let corpus = bulk::corpus(args, &figures)?;
    let motion = match args.variation {
        Some(number) => corpus.variation(number)?,
        None => phrase::perform(&corpus.parts, corpus.join)?,
    };
    let bytes = bytes_of(args, &figures, &motion)?;
    args.output.write_file(&args.output_file, &bytes)?;
    let report = Report {
        outcome: "done",
        action: args.action.clone(),
        duration_s: motion.duration_s(),
        rate_hz: args.rate,
        poses: motion.pose_count(args.rate)?,
        actionlets: motion.moving().count(),
        written: args.output_file.display().to_string(),
    };
    let text = if remarks.quiet {
        format!("{}\n", report.written)
    } else {
        format!(
            "done: {} takes {:.3} s, {} actionlets\nwritten   {}, {} poses at {} Hz\n",
            report.action,
            report.duration_s,
            report.actionlets,
            report.written,
            report.poses,
            report.rate_hz
        )
    };
    Ok(args.output.conclude(&report, &text, Deed::Work, 0))
}

/// The motion as the kind of file the output's name asks for.
fn bytes_of(args: &SynthArgs, figures: &Figures, motion: &Motion) -> Result<Vec<u8>, Error> {
    let body = figures.body()?;
    let poses = || motion.poses(&body, args.rate);
    let title = args.action.as_str();
    match args.output_file.extension().and_then(|e| e.to_str()).unwrap_or_default() {
        "csv" => {
            let mut bytes = Vec::new();
            table::write_csv(motion, &body, args.rate, &mut bytes)?;
            Ok(bytes)
        }
        "bvh" => Ok(bvh::write(&export::bvh_of(&poses()?, &body, args.rate)).into_bytes()),
        "x3d" => Ok(humanoid::x3d_of(title, &poses()?, &body, args.rate).into_bytes()),
        "html" => Ok(page::page_of(title, &poses()?, &body, args.rate).into_bytes()),
        _ => Err(Error::of(ErrorKind::Unknown, "not a kind of file I can write")
            .at("-o")
            .got(args.output_file.display().to_string())
            .allowed("a name that ends in .csv, .bvh, .x3d or .html; with --variations .parquet")),
    }
}
