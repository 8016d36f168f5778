//! `synth`, as it is typed.

use super::inserts::{InsertArgs, told};
use super::signals::Signals;
use super::terminal::Terminal;
use super::{Deed, Output, Remarks};
use crate::error::{Error, either};
use crate::job::report::counted;
use crate::job::share::Share;
use crate::job::synth::{
    ClassOrder, ClassReport, Figures, FootingReport, MAX_VARIATIONS, MissedReport, SynthOrder,
    VariedMotionReport, synth, tables_beside, vary,
};
use clap::Args;
use std::fmt::Write as _;
use std::path::PathBuf;

/// Arguments of `synth`.
#[derive(Clone, Debug, Args)]
#[command(after_help = include_str!("help/synth.txt"))]
pub struct SynthArgs {
    /// A shipped action, an action file (.toml), or several: walk:6s,wave-r,bow; with + between two
    /// gaits, one goes over into the other without a stop: walk:6s+run:5s
    #[arg(required_unless_present = "class")]
    action: Option<String>,
    /// A class of a corpus, with the label a learner is to see: LABEL=ACTION, or LABEL:COUNT=ACTION where
    /// it is to have another number of variations; given several times
    #[arg(long, value_name = "LABEL=ACTION", conflicts_with_all = ["action", "variation", "insert"],
          requires = "varied", value_parser = class)]
    class: Vec<(String, Option<u32>, String)>,
    #[command(flatten)]
    inserts: InsertArgs,
    /// Poses per second
    #[arg(long, value_name = "HZ", default_value_t = 120.0, allow_negative_numbers = true)]
    rate: f64,
    /// Make this many variations (of each class); OUT is then a .parquet file, or a folder: there an
    /// interrupted run is resumed, and more variations and classes are added by naming them
    #[arg(long, value_name = "N", group = "varied", conflicts_with = "insert",
          value_parser = clap::value_parser!(u32)
          .range(1..=i64::from(MAX_VARIATIONS)))]
    variations: Option<u32>,
    /// Make only this one of the variations, counted from 0
    #[arg(long, value_name = "NUMBER", group = "varied", conflicts_with = "insert",
          value_parser = clap::value_parser!(u32)
          .range(0..i64::from(MAX_VARIATIONS)))]
    variation: Option<u32>,
    /// Seed of the variations
    #[arg(long, default_value_t = 0, requires = "varied")]
    seed: u64,
    /// Folder of action files whose velocity functions variations may use as well
    #[arg(long, value_name = "FOLDER", requires = "varied")]
    database: Vec<PathBuf>,
    /// Only every Nth file of a folder, the Kth first: several processes or machines make one part each, and the
    /// command without it looks whether all is there
    #[arg(long, value_name = "K/N", requires = "variations", conflicts_with = "variation")]
    part: Option<String>,
    /// Leave joints and ends out of a corpus, as points in space: two thirds of its bytes
    #[arg(long, requires = "variations")]
    no_points: bool,
    /// Change a value: duration_s, rounds, pace, peak, blend_s; of the body stature_m, mass_kg, leg_m, sex
    /// (female or male) and figure (de-leva or drillis-contini); for variations vary_angle, vary_time,
    /// vary_peak, vary_duration, vary_exchange, vary_stride, vary_stature, vary_heading_deg, and vary_types
    /// (range or paper)
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// File to write: .csv (time_s, the 22 angles, rad, the root, m, and how the pelvis is turned, rad), .bvh, .x3d (an H-Anim
    /// humanoid over a floor, followed by the camera), or .html (a page that draws it with its contacts,
    /// its centre of mass and the force of the floor)
    #[arg(short, long, value_name = "OUT", required_unless_present = "html")]
    output_file: Option<PathBuf>,
    /// The page of one action, beside OUT or alone
    #[arg(long, value_name = "FILE.html", conflicts_with = "variations")]
    html: Option<PathBuf>,
    #[command(flatten)]
    output: Output,
}

/// Reads `LABEL=ACTION` and `LABEL:COUNT=ACTION`.
fn class(text: &str) -> Result<(String, Option<u32>, String), String> {
    let form = "LABEL=ACTION or LABEL:COUNT=ACTION";
    let (before, action) = text.split_once('=').ok_or(form)?;
    let (label, count) = match before.split_once(':') {
        None => (before, None),
        Some((label, count)) => match count.parse() {
            Ok(count) if (1..=MAX_VARIATIONS).contains(&count) => (label, Some(count)),
            _ => return Err(format!("COUNT is a whole number from 1 to {MAX_VARIATIONS}")),
        },
    };
    if label.is_empty() || action.is_empty() || label.len() > 200 {
        return Err(format!("{form}, with a label of at most 200 bytes"));
    }
    Ok((label.to_owned(), count, action.to_owned()))
}

/// Runs `synth`.
///
/// # Errors
/// If there is no such action, a figure is out of range, or the file cannot be written.
pub fn run(args: &SynthArgs, remarks: Remarks) -> Result<i32, Error> {
    // The page may be all that is wanted.
    let (file, html) = match (&args.output_file, &args.html) {
        (Some(file), html) => (file.clone(), html.clone()),
        (None, Some(page)) => (page.clone(), None),
        (None, None) => return Err(Error::new("no file to write").remedy("name one: -o walk.csv")),
    };
    let order = SynthOrder {
        inserts: args.inserts.order(),
        figures: Figures::read(&args.set)?,
        rate_hz: args.rate,
        seed: args.seed,
        database: args.database.clone(),
        has_points: !args.no_points,
        part: args.part.as_deref().map_or(Ok(Share::WHOLE), Share::parse)?,
        file,
        html,
        replace: args.output.force(),
    };
    let signals = Signals::listened()?;
    match (args.variations, &args.action) {
        (Some(variations), _) => run_many(args, &order, variations, remarks, &signals),
        (None, Some(action)) => run_one(args, &order, action, remarks, &signals),
        (None, None) => Err(Error::new("no action was named")),
    }
}

fn run_many(
    args: &SynthArgs,
    order: &SynthOrder,
    variations: u32,
    remarks: Remarks,
    signals: &Signals,
) -> Result<i32, Error> {
    if order.file.extension().is_some_and(|e| e == "parquet") {
        let [pieces, rows] = tables_beside(&order.file);
        args.output.check_files(&[&Some(order.file.clone()), &Some(pieces), &Some(rows)])?;
    } else {
        args.output.check_files(&[])?;
    }
    let named = |(label, count, phrase): &(String, Option<u32>, String)| ClassOrder {
        label: label.clone(),
        phrase: phrase.clone(),
        variations: count.unwrap_or(variations),
    };
    let mut classes: Vec<ClassOrder> = args.class.iter().map(named).collect();
    if let Some(action) = &args.action {
        classes.push(named(&(action.clone(), None, action.clone())));
    }
    let made = vary(order, &classes, &Terminal::new(remarks, signals))?;
    let text = if remarks.quiet {
        format!("{}\n", made.written)
    } else {
        format!(
            "{}: {} of {}, {} of them found, {} written\n{}{}written   {}\n",
            made.outcome.word(),
            made.variations_text(),
            classes.iter().map(|class| class.label.as_str()).collect::<Vec<_>>().join(" and "),
            made.found,
            counted(made.poses, "pose"),
            made.mended.iter().map(|how| anew(how)).collect::<String>(),
            made.classes.iter().map(feet_of).collect::<String>(),
            made.written
        )
    };
    for class in made.classes.iter().filter(|class| class.implausible > 0) {
        let ClassReport { label, valid, repaired, implausible, .. } = class;
        let all = valid + repaired + implausible;
        let fell = either(implausible, "does not stand on its feet", "do not stand on their feet");
        remarks.say(&format!("{implausible} of {all} {label} {fell} (status implausible)"));
    }
    Ok(args.output.conclude(&made, &text, Deed::Work, made.outcome.exit_code()))
}

/// What was not as it was left, a few lines.
fn anew(how: &str) -> String {
    format!("anew      {}\n", how.replace('\n', "\n          "))
}

/// Whether the feet of a class hold, a line.
fn feet_of(class: &ClassReport) -> String {
    if class.valid + class.repaired + class.implausible == 0 {
        return String::new();
    }
    let mut line = format!(
        "{:9} {} {} as drawn, {} since {}; {} {} thrown away",
        class.label,
        class.valid,
        either(class.valid, "stands on its feet", "stand on their feet"),
        class.repaired,
        either(class.repaired, "it was repaired", "they were repaired"),
        counted(class.rejected, "draw"),
        either(class.rejected, "was", "were")
    );
    if class.implausible > 0 {
        let verb = either(class.implausible, "DOES", "DO");
        let _ = write!(line, "; {} {verb} NOT STAND (status implausible)", class.implausible);
    }
    line + "\n"
}

/// What became of a variation, a line.
fn became(varied: &VariedMotionReport) -> String {
    let tail = match varied.status {
        "valid" => "its feet hold as it was drawn",
        "repaired" => "its feet hold since it was repaired",
        _ => "ITS FEET DO NOT HOLD, nor do those of other draws",
    };
    format!(
        "variation {}: {tail}; {} draws before it were thrown away; stature {:.2} m\n",
        varied.variation, varied.rejected, varied.stature_m
    )
}

/// How the body stands on its feet, a line.
fn feet(footing: &FootingReport) -> String {
    format!(
        "feet      both on the floor {:.0} % of the time, none {:.0} %; they slide by at most {:.1} mm; \
         the floor pushes with {:.2} to {:.2} body weights\n",
        footing.both_feet * 1e2,
        footing.flying * 1e2,
        footing.slides_m * 1e3,
        footing.least_force_body_weights,
        footing.most_force_body_weights
    )
}

/// A bound that is missed, a line.
fn misses(missed: &MissedReport) -> String {
    let (does, times, unit) = match missed.what {
        "sinks_m" => ("a sole sinks by", 1e3, "mm"),
        "slides_m" => ("a sole slides by", 1e3, "mm"),
        "away_m" => ("in the end they are off by", 1e3, "mm"),
        _ => ("the root is accelerated by", 1.0, "m/s2"),
    };
    let (got, most) = (missed.got * times, missed.most * times);
    format!("feet do not hold: {does} {got:.1} {unit}, {most:.1} are allowed")
}

fn run_one(
    args: &SynthArgs,
    order: &SynthOrder,
    action: &str,
    remarks: Remarks,
    signals: &Signals,
) -> Result<i32, Error> {
    args.output.check_files(&[&Some(order.file.clone()), &order.html])?;
    let report = synth(order, action, args.variation, &Terminal::new(remarks, signals))?;
    let text = if remarks.quiet {
        format!("{}\n", report.written)
    } else {
        format!(
            "{}: {} takes {:.3} s, {}\n{}{}{}{}written   {}, {} at {} Hz\n",
            report.outcome.word(),
            report.action,
            report.duration_s,
            counted(report.actionlets, "actionlet"),
            report.varied.as_ref().map_or_else(String::new, became),
            told(&report.changes, &report.inserts),
            feet(&report.footing),
            report.html.as_ref().map_or_else(String::new, |page| format!("plots     {page}\n")),
            report.written,
            counted(report.poses, "pose"),
            report.rate_hz
        )
    };
    for missed in &report.footing.missed {
        remarks.say(&misses(missed));
    }
    Ok(args.output.conclude(&report, &text, Deed::Work, report.outcome.exit_code()))
}
