//! `clean`, as it is typed.

use super::terminal::Terminal;
use super::{Deed, Output, Remarks};
use crate::error::Error;
use crate::job::clean::{ArtefactFigures, CleanOrder, CleanReport, Remedy, clean};
use crate::job::clean_check::{CheckOrder, check, cut_off_remark};
use crate::job::clean_folder::clean_folder;
use crate::job::report::counted;
use clap::Args;
use std::fmt::Write;
use std::path::PathBuf;

/// Expected errors of fills that may be asked for, mm.
const TOLERANCES_MM: std::ops::RangeInclusive<f64> = 0.0..=1000.0;

/// Arguments of `clean`.
#[derive(Clone, Debug, Args)]
#[command(after_help = include_str!("help/clean.txt"))]
pub struct CleanArgs {
    /// Markers in motion (.c3d, .trc, .csm, .csv), or a folder of them; with --check also skeletons (.bvh, .amc)
    file: PathBuf,
    /// File to write, or folder
    #[arg(short, long, value_name = "OUT", required_unless_present = "check")]
    output_file: Option<PathBuf>,
    /// Only look: write nothing, rank trials by doubt
    #[arg(long, conflicts_with_all = ["output_file", "edits", "tolerance"])]
    check: bool,
    /// With --check, or of a folder: most of a trial's samples that may be doubtful, % [default: by the folder's clean.toml, else 1]
    #[arg(long, value_name = "PERCENT", value_parser = percent, allow_negative_numbers = true)]
    most_doubt: Option<f64>,
    /// Edit list: applied if the file is there, else written [default: beside OUT]
    #[arg(long, value_name = "EDITS.toml")]
    edits: Option<PathBuf>,
    /// Trial in which the same person stands still, for fills by the skeleton [default: the trial itself]
    #[arg(long = "static", value_name = "FILE", conflicts_with = "check")]
    static_trial: Option<PathBuf>,
    /// Other trial with the same markers, or a folder of them, from which fills may be learned
    #[arg(long, value_name = "FILE|FOLDER", conflicts_with = "check")]
    others: Vec<PathBuf>,
    /// Write a page that shows the markers as they were and are, with everything found on a time line
    #[arg(long, value_name = "FILE.html", conflicts_with = "check")]
    html: Option<PathBuf>,
    /// Leave gaps whose fill is expected to miss by more, mm
    #[arg(long, value_name = "MM", default_value_t = 50.0, value_parser = tolerance,
          allow_negative_numbers = true)]
    tolerance: f64,
    /// Frames per second of markers that do not say it
    #[arg(long, value_name = "HZ", allow_negative_numbers = true)]
    rate: Option<f64>,
    #[command(flatten)]
    output: Output,
}

fn tolerance(text: &str) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| "not a number".to_owned())?;
    let allowed = || format!("{} to {} mm", TOLERANCES_MM.start(), TOLERANCES_MM.end());
    if TOLERANCES_MM.contains(&value) { Ok(value) } else { Err(allowed()) }
}

fn percent(text: &str) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| "not a number".to_owned())?;
    if (0.0..=100.0).contains(&value) { Ok(value) } else { Err("0 to 100 %".to_owned()) }
}

/// Runs `clean`; exit code 3 if something was found and not mended.
///
/// # Errors
/// Files that cannot be read or written, an edit list of another file.
pub fn run(args: &CleanArgs, remarks: Remarks) -> Result<i32, Error> {
    // clap asks for a file to write, unless it is not to be written.
    let Some(output_file) = args.output_file.as_deref().filter(|_| !args.check) else {
        return looked_at(args, remarks);
    };
    let order = CleanOrder {
        markers: args.file.clone(),
        rate_hz: args.rate,
        file: output_file.to_owned(),
        edits: args.edits.clone(),
        tolerance_m: args.tolerance / 1e3,
        static_trial: args.static_trial.clone(),
        others: args.others.clone(),
        html: args.html.clone(),
        replace: args.output.force(),
    };
    let mut inputs = vec![args.file.as_path()];
    inputs.extend(args.static_trial.as_deref());
    inputs.extend(args.others.iter().map(PathBuf::as_path));
    inputs.extend(args.edits.as_deref().filter(|file| file.exists()));
    if args.file.is_dir() {
        args.output.check_files(&[])?;
        args.output.check_all_apart(&inputs, &[])?;
        return of_folder(args, &order, remarks);
    }
    if args.most_doubt.is_some() {
        return Err(Error::new("--most-doubt goes with --check, or with a folder"));
    }
    let list = match &args.edits {
        Some(edits) => Some(edits.clone()).filter(|file| !file.exists()),
        None => Some(order.edit_list()),
    };
    args.output.check_files(&[&Some(output_file.to_owned()), &list, &args.html])?;
    let mut outputs = vec![output_file];
    outputs.extend(list.as_deref());
    outputs.extend(args.html.as_deref());
    args.output.check_all_apart(&inputs, &outputs)?;
    let report = clean(&order, &Terminal::unheard(remarks))?;
    let code = report.outcome.exit_code();
    Ok(args.output.conclude(&report, &words(&report, remarks), Deed::Work, code))
}

/// Cleans the trials of a folder; exit code 3 if one is above what is allowed, or cannot be cleaned.
fn of_folder(args: &CleanArgs, order: &CleanOrder, remarks: Remarks) -> Result<i32, Error> {
    let most_doubt = args.most_doubt.map(|percent| percent / 100.0);
    let report = clean_folder(order, most_doubt, &Terminal::unheard(remarks))?;
    let percent =
        |doubt: Option<f64>| doubt.map_or("-".to_owned(), |of| format!("{:.2}", of * 1e2));
    let mut text = "before %   after %  round  artefacts   left     s  trial\n".to_owned();
    for of in &report.trials {
        let error = of.error.as_ref().map(|error| format!(": {error}"));
        let said = error.unwrap_or_else(|| too_much(&of.above) + &cut_off_remark(of.lost_frames));
        let (before, after) = (percent(of.doubt_before), percent(of.doubt_after));
        let (round, wrong, left) = (of.round, of.artefacts, of.not_mended);
        let (machine_s, trial) = (of.machine_s, &of.trial);
        let _ = writeln!(
            text,
            "{before:>8}  {after:>8}  {round:>5}  {wrong:>9}  {left:>5}  {machine_s:>4.0}  {trial}{said}"
        );
    }
    let _ = writeln!(text, "rounds    {}", report.rounds);
    let code = report.outcome.exit_code();
    Ok(args.output.conclude(&report, &text, Deed::Work, code))
}

/// Looks at trials; exit code 3 if one has more doubt than allowed.
fn looked_at(args: &CleanArgs, remarks: Remarks) -> Result<i32, Error> {
    args.output.check_files(&[])?;
    args.output.check_apart(&args.file, &[])?;
    let order = CheckOrder {
        markers: args.file.clone(),
        rate_hz: args.rate,
        most_doubt: args.most_doubt.map(|percent| percent / 100.0),
    };
    let report = check(&order, &Terminal::unheard(remarks))?;
    let mut text = " doubt %         s  markers  joints  trial\n".to_owned();
    for trial in &report.trials {
        let doubt = trial.doubt.map_or("-".to_owned(), |of| format!("{:.2}", of * 100.0));
        let kinds = trial.artefacts.iter().map(|(kind, count)| format!("{count} {}", kind.word()));
        let found = trial.error.iter().cloned().chain(kinds).collect::<Vec<_>>().join(", ");
        let said = if found.is_empty() { String::new() } else { format!(": {found}") };
        let is_read = trial.error.is_none();
        let above = if is_read {
            too_much(&trial.above) + &cut_off_remark(trial.lost_frames)
        } else {
            String::new()
        };
        let (duration_s, markers, joints) =
            (trial.duration_s, trial.marker_count, trial.joint_count);
        let _ = writeln!(
            text,
            "{doubt:>8}  {duration_s:>8.2}  {markers:>7}  {joints:>6}  {}{said}{above}",
            trial.markers
        );
    }
    if let Some(file) = report.thresholds.as_ref().filter(|_| !remarks.quiet) {
        let _ = writeln!(text, "thresholds {file}");
    }
    let code = report.outcome.exit_code();
    Ok(args.output.conclude(&report, &text, Deed::Look, code))
}

fn too_much(above: &[String]) -> String {
    if above.is_empty() { String::new() } else { format!(" (too much: {})", above.join(", ")) }
}

fn words(report: &CleanReport, remarks: Remarks) -> String {
    let mut text = String::new();
    if !remarks.quiet {
        let _ = writeln!(
            text,
            "{}: {} at {} Hz, {}, {}; {} filled, {} taken out",
            report.outcome.word(),
            counted(report.frames, "frame"),
            report.rate_hz,
            counted(report.marker_count, "marker"),
            counted(report.artefacts.len(), "artefact"),
            counted(report.filled_samples, "sample"),
            report.removed_samples
        );
        if report.cropped_frames > 0 {
            let _ = writeln!(
                text,
                "cropped   {} left out at the ends",
                counted(report.cropped_frames, "frame")
            );
        }
        if !report.artefacts.is_empty() {
            let _ = writeln!(
                text,
                "{:15} {:12} {:>8} {:>8}  {:18} {:>4}  {:22} {:>11}",
                "artefact", "marker", "from s", "to s", "cause", "sure", "done", "expected mm"
            );
        }
        report.artefacts.iter().for_each(|of| row(&mut text, of));
        let untouched = &report.untouched_sha256;
        let alike = if untouched.before == untouched.after { "the same" } else { "NOT the same" };
        let _ = writeln!(
            text,
            "untouched {}, {alike} before and after ({})",
            counted(untouched.samples, "sample"),
            untouched.after.get(..12).unwrap_or_default()
        );
        for note in &report.notes {
            let _ = writeln!(text, "note      {note}");
        }
    }
    let _ = writeln!(text, "edits     {}", report.edits);
    let _ = writeln!(text, "written   {}", report.written);
    text
}

fn row(text: &mut String, of: &ArtefactFigures) {
    let marker = match &of.with {
        Some(other) => format!("{}-{other}", of.marker),
        None => of.marker.clone(),
    };
    let done = match (of.remedy, of.fill) {
        (Remedy::Fill, Some(method)) => format!("filled, {}", method.word()),
        (Remedy::Fill, None) => "filled".to_owned(),
        (Remedy::Remove, _) => "taken out, not filled".to_owned(),
        (Remedy::Exchange, _) => "exchanged".to_owned(),
        (Remedy::Leave, _) => "left".to_owned(),
    };
    let or_dash = |value: Option<String>| value.unwrap_or_else(|| "-".to_owned());
    let _ = writeln!(
        text,
        "{:15} {marker:12} {:>8.3} {:>8.3}  {:18} {:>4}  {done:22} {:>11}",
        of.kind.word(),
        of.start_s,
        of.end_s,
        of.cause.map_or("-", |cause| cause.words()),
        or_dash(of.confidence.map(|sure| format!("{sure:.2}"))),
        or_dash(of.expected_error_m.map(|error_m| format!("{:.1}", error_m * 1e3))),
    );
}
