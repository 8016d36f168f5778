//! `record`, as it is typed.

mod marks;
mod session;

use super::report::Outcome;
use super::signals::Signals;
use super::terminal::Terminal;
use super::viewing::{ViewArg, Viewing};
use super::{Deed, Output, Remarks};
use crate::error::Error;
use crate::job::page::file::page as file_page;
use crate::job::page::live::Shows;
use crate::job::record::Mode;
use crate::job::record::{RecordOrder, RecordReport, record};
use crate::job::report::counted;
use crate::job::source::CaptureOptions;
use crate::job::source_words;
use crate::recording::SampleEncoding;
use crate::sensing::{Source, Wear, What};
use crate::time::{Duration, duration};
use clap::Args;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Arguments of `record`.
#[derive(Debug, Args)]
#[command(after_help = include_str!("help/record.txt"))]
pub struct RecordArgs {
    /// What to record
    #[arg(required_unless_present_any = ["session", "wear"], value_name = "SOURCE")]
    sources: Vec<Source>,
    /// The recording
    #[arg(short, long, value_name = "FILE.mcap", required_unless_present = "session")]
    out: Option<PathBuf>,
    /// Lead through a recording session in this folder, or resume one
    #[arg(long, value_name = "DIR", conflicts_with_all = ["out", "time", "name", "limp"])]
    session: Option<PathBuf>,
    /// Which segment wears which sensor or tracker (left_thigh=tracker-00aa01-0), or a file that says what is worn, as for
    /// `live`; its sources are recorded, and how they are worn is kept in the recording
    #[arg(long, value_name = "SEGMENT=SENSOR|FILE.toml")]
    wear: Vec<String>,
    /// What the session should record (see docs/capture.md); without it, you are asked
    #[arg(long, value_name = "FILE.toml", conflicts_with = "out")]
    plan: Option<PathBuf>,
    /// A subject who was measured in another session (its subjects/ID.toml): whoever has that id is not measured again
    #[arg(long, value_name = "FILE.toml", requires = "session")]
    subject: Vec<PathBuf>,
    /// How long, e.g. 10s or 2.5s; without it until Ctrl-C
    #[arg(long = "for", value_name = "TIME", value_parser = duration)]
    time: Option<Duration>,
    /// Name of the trial, kept in the recording
    #[arg(long, value_name = "TRIAL", default_value = "", hide_default_value = true)]
    name: String,
    /// Take headings from the magnetic field (not recommended indoors)
    #[arg(long)]
    magnetometer: bool,
    /// Readings of servos per second
    #[arg(long, default_value_t = 50.0, value_name = "HZ")]
    rate: f64,
    /// Switch the servos' torque off first, to guide the robot by hand: it falls unless supported
    #[arg(long)]
    limp: bool,
    /// Write a page that shows the robot whose joints were recorded
    #[arg(long, value_name = "FILE.html", conflicts_with = "session")]
    html: Option<PathBuf>,
    /// Samples of sensors as json, or as protobuf: fewer bytes, and other programs read it as well
    #[arg(long, value_name = "ENCODING", default_value = "json")]
    encoding: SampleEncoding,
    #[command(flatten)]
    view: ViewArg,
    #[command(flatten)]
    output: Output,
}

/// Runs `record`; exit code 3 if something is missing in the recording.
///
/// # Errors
/// A source that cannot be opened, a file that cannot be written.
pub fn run(args: &RecordArgs, remarks: Remarks) -> Result<i32, Error> {
    let signals = Signals::listen().map_err(|e| Error::new(format!("no signals: {e}")))?;
    if let Some(root) = &args.session {
        return session::run(args, root, signals, remarks);
    }
    let file = args.out.clone().ok_or_else(|| Error::new("no file to record to"))?;
    args.output.check_files(&[&args.out, &args.html])?;
    let wear = Wear::of(Vec::new(), &args.wear)?.beside(&args.sources);
    let order = RecordOrder {
        sources: wear.sources,
        worn: wear.places,
        file,
        replace: args.output.force(),
        time: args.time,
        name: args.name.clone(),
        mode: if args.magnetometer { Mode::NineAxes } else { Mode::SixAxes },
        rate_hz: args.rate,
        limp: args.limp,
        samples: args.encoding,
    };
    let servos = order.sources.iter().find_map(|source| match &source.what {
        What::Servos { robot, addresses } => Some((robot.as_str(), addresses.as_slice())),
        _ => None,
    });
    let (robot, buses) = servos.map_or((None, &[][..]), |(robot, buses)| (Some(robot), buses));
    // Sensors and lines of text are heard.
    let sensors = order.sources.len() > usize::from(servos.is_some());
    let view = args.view.open(robot, buses, "recorded", Shows { sensors, person: false })?;
    let terminal = Terminal::new(remarks, &signals);
    let viewing = Viewing::new(&terminal, view.as_ref());
    let marks = marks::listen(terminal.typed(), !remarks.shows_progress());
    let report = record(&order, &marks.set, &viewing)?;
    drop(marks);
    terminal.clear();
    let outcome = if report.is_whole() { Outcome::Done } else { Outcome::DoneWithLoss };
    viewing.ended(outcome, report.poisoned.as_deref());
    let text = text(&report, &order.file);
    let paged = args.html.as_ref().filter(|_| report.file.is_some()).map_or(Ok(()), |page| {
        let html = file_page(&order.file, &CaptureOptions::default())?;
        args.output.write_file(page, html.as_bytes())
    });
    let outcome = match &paged {
        Ok(()) => outcome,
        Err(error) => {
            remarks.say(&format!("no page was written: {error}"));
            Outcome::DoneWithLoss
        }
    };
    Ok(args.output.conclude(&report, &text, Deed::Work, outcome.exit_code()))
}

fn text(report: &RecordReport, file: &Path) -> String {
    let mut out = match report.file {
        Some(_) => format!("recorded {:.2} s to {}\n", report.duration_s, file.display()),
        None => format!("nothing was recorded; {} is as it was\n", file.display()),
    };
    for source in &report.sources {
        source_words::heard(source, &mut out);
    }
    for (sensor, of) in &report.doubted {
        let (times, time_s) = (counted(of.times, "time"), of.time_s);
        let _ = writeln!(
            out,
            "  {sensor} said {times}, for {time_s:.1} s, what nobody who wears it can do"
        );
    }
    let refused: u64 = report.dropped_by_topic.values().sum();
    if refused > 0 {
        let _ = writeln!(
            out,
            "  the disk could not keep up: {refused} lost",
            refused = counted(refused, "message")
        );
    }
    if let Some(poisoned) = &report.poisoned {
        let lost = report.dropped - refused;
        let _ = writeln!(
            out,
            "  the recording ended early: {poisoned}; {lost} lost",
            lost = counted(lost, "message")
        );
    }
    out
}
