//! `live`, as it is typed.

use super::calibrated::CalibrationArg;
use super::operator::Operator;
use super::signals::Signals;
use super::viewing::{ViewArg, Viewing};
use super::wearing::WearingArgs;
use super::{Deed, Output, Remarks, play};
use crate::error::Error;
use crate::job::bvh_stream::BvhStream;
use crate::job::live::{LiveOrder, When, live};
use crate::job::page::file::page as file_page;
use crate::job::page::live::Shows;
use crate::job::report::PlayReport;
use crate::job::source::CaptureOptions;
use crate::job::vmc::Avatar;
use crate::recording::SampleEncoding;
use crate::rig::Address;
use crate::time::{Duration, listening_time};
use crate::view::live::LiveView;
use clap::Args;
use std::path::{Path, PathBuf};

mod table;

pub(super) use table::Shown;

/// Arguments of `live`.
#[derive(Clone, Debug, Args)]
#[command(after_help = include_str!("help/live.txt"))]
pub struct LiveArgs {
    /// What to follow: sensors, a recording or a motion (see below)
    #[arg(long, value_name = "SOURCE", num_args = 1.., required_unless_present = "wear")]
    from: Vec<String>,
    #[command(flatten)]
    wearing: WearingArgs,
    /// Robot by name, or path of its file (see `gaitway profile list`)
    #[arg(long, required_unless_present = "dry_run")]
    robot: Option<String>,
    /// Where the robot is, as for `play`
    #[arg(long, value_name = "BUS", required_unless_present = "dry_run")]
    bus: Vec<Address>,
    /// Cycles per second [default: the robot file's]
    #[arg(long, value_name = "HZ", value_parser = play::rate, allow_negative_numbers = true)]
    rate: Option<f64>,
    /// Follow for this time, then come to rest
    #[arg(long = "for", value_name = "TIME", value_parser = listening_time, allow_negative_numbers = true)]
    time: Option<Duration>,
    /// Record goals, measured states and the samples of all sensors to this file
    #[arg(long, value_name = "FILE.mcap")]
    record: Option<PathBuf>,
    /// Samples of sensors in it as json, or as protobuf: fewer bytes, and other programs read it as well
    #[arg(long, value_name = "ENCODING", default_value = "json")]
    encoding: SampleEncoding,
    /// Write a page of that recording: the robot, and whoever wore the sensors beside it
    #[arg(long, value_name = "FILE.html", requires = "record")]
    html: Option<PathBuf>,
    /// Move servos whose firmware the profile was not checked against
    #[arg(long)]
    accept_firmware: bool,
    /// The robot hangs on a stand: its feet go where the person's go, and need not carry it
    #[arg(long)]
    hang: bool,
    /// The virtual robot has weight and may fall (sim, sim:pty; robots whose file has a body)
    #[arg(long)]
    physics: bool,
    /// Joints that the robot's file names answer a base that tilts otherwise than what is followed wants, as with `play`
    #[arg(long, requires = "robot")]
    balance: bool,
    /// Faults of this script befall the virtual robot, by its own clock (sim, sim:pty; keys: sim/README.md)
    #[arg(long, value_name = "FILE.toml", requires = "robot")]
    faults: Option<PathBuf>,
    /// Write nothing to the robot. With sensors: show the joint angles of the body, with or
    /// without a robot
    #[arg(long)]
    dry_run: bool,
    /// Name what the person does as it happens: on standard error, in the report, and in the recording
    /// (channel /lines/actions)
    #[arg(long)]
    recognise: bool,
    /// Folder of models for that, in place of those that ship with gaitway
    #[arg(long, value_name = "DIR", requires = "recognise")]
    models: Option<PathBuf>,
    /// When the person has done ACTION (`wave`, or with a side `wave-r`), the robot comes to rest, plays MOTION as
    /// `play` does, and follows again; what is done meanwhile is counted and not answered (repeatable)
    #[arg(long, value_name = "ACTION=play:MOTION", requires = "recognise")]
    when: Vec<When>,
    /// When a sensor of an arm or the head is lost, let that limb rest and follow the others; a leg of a robot without legs
    /// too. Pelvis, trunk and legs that a robot stands on end it as ever
    #[arg(long)]
    keep_going: bool,
    /// Follow somebody although the calibration names sensors that seem to be swapped
    #[arg(long)]
    despite_swaps: bool,
    #[command(flatten)]
    view: ViewArg,
    /// Show whoever wears the sensors to a program that draws avatars: the Virtual Motion Capture protocol (VMC), to this
    /// address, usually 127.0.0.1:39539
    #[arg(long, value_name = "HOST:PORT")]
    vmc: Option<String>,
    /// Send whoever wears the sensors to each program that connects to this address over TCP, as a BVH file that goes on
    #[arg(long, value_name = "HOST:PORT")]
    bvh: Option<String>,
    /// Seed of the virtual robot
    #[arg(long, default_value_t = 0)]
    seed: u64,
    #[command(flatten)]
    calibration: CalibrationArg,
    #[command(flatten)]
    output: Output,
}

impl LiveArgs {
    fn order(&self) -> LiveOrder {
        LiveOrder {
            from: self.from.clone(),
            wear: self.wearing.wear.clone(),
            robot: self.robot.clone(),
            buses: self.bus.clone(),
            calibration: self.calibration.path().map(Path::to_owned),
            seed: self.seed,
            samples: self.encoding,
            rate_hz: self.rate,
            time: self.time,
            plan: self.wearing.plan(),
            body_calibration: self.wearing.calibration_body.clone(),
            recalibrate: self.wearing.recalibrate,
            mode: self.wearing.mode(),
            record: self.record.clone(),
            replace: self.output.force(),
            accept_firmware: self.accept_firmware,
            hangs: self.hang,
            physics: self.physics,
            balances: self.balance,
            faults: self.faults.clone(),
            dry_run: self.dry_run,
            recognise: self.recognise,
            models: self.models.clone(),
            when: self.when.clone(),
            keep_going: self.keep_going,
            despite_swaps: self.despite_swaps,
        }
    }

    /// The page of the robot that follows, if one is wanted.
    fn view(&self) -> Result<Option<LiveView>, Error> {
        let what = match &self.robot {
            Some(_) => format!("follows {}", self.order().motion()),
            None => self.order().motion(),
        };
        // A motion that is performed has no sensors.
        let is_heard = self.from.iter().all(|from| !from.starts_with("file:"));
        let shown = [("--vmc", &self.vmc), ("--bvh", &self.bvh)];
        if let Some((option, _)) = shown.iter().find(|(_, place)| place.is_some() && !is_heard) {
            return Err(Error::new("whoever wears sensors is shown, and this is a motion")
                .at(*option)
                .got(self.order().motion())
                .allowed("sensors, or replay:FILE.mcap"));
        }
        let shows = Shows { sensors: is_heard, person: is_heard };
        self.view.open(self.robot.as_deref(), &self.bus, &what, shows)
    }

    /// Writes the page of what was recorded, if one is wanted.
    fn add_page(&self, run: &mut PlayReport) {
        let Some((page, recording)) = self.html.as_ref().zip(run.recording.as_ref()) else {
            return;
        };
        let made = file_page(Path::new(recording), &CaptureOptions::default());
        match made.and_then(|html| self.output.write_file(page, html.as_bytes())) {
            Ok(()) => run.html = Some(page.display().to_string()),
            Err(error) => run.describe_no_page(&error),
        }
    }

    /// Fails if what is followed would be written over, also by a report of a refusal.
    fn check_read_files(&self) -> Result<(), Error> {
        let written = [self.record.as_deref(), self.html.as_deref()];
        let recording: Vec<&Path> = written.into_iter().flatten().collect();
        let read = self
            .from
            .iter()
            .filter_map(|from| from.strip_prefix("replay:").or_else(|| from.strip_prefix("file:")));
        read.map(Path::new).try_for_each(|file| self.output.check_apart(file, &recording))
    }
}

/// Runs `live`; the exit code.
///
/// # Errors
/// No signals can be heard, or an output is what is followed. A refusal is a report, not an error.
pub fn run(args: &LiveArgs, remarks: Remarks) -> Result<i32, Error> {
    args.check_read_files()?;
    let signals = Signals::listen().map_err(|e| Error::new(format!("no signals: {e}")))?;
    let order = args.order();
    let followed = |view: Option<LiveView>| {
        let operator = Operator::listen(signals.clone(), remarks);
        let avatar = Avatar::new(&operator, args.vmc.as_deref())?;
        let stream = BvhStream::new(&avatar, args.bvh.as_deref())?;
        if let Some(address) = stream.address() {
            remarks.say(&format!("bvh       {address}"));
        }
        let viewing = Viewing::new(&stream, view.as_ref());
        let report = live(&order, &viewing, &viewing.of(&operator));
        viewing.ended(report.run.outcome, report.run.stop_reason.as_deref());
        Ok(report)
    };
    let checked = args.output.check_files(&[&args.record, &args.html]);
    let mut report =
        checked.and_then(|()| args.view()).and_then(followed).unwrap_or_else(|error| {
            let mut report = order.report();
            report.run.describe_refused(&error);
            report
        });
    args.add_page(&mut report.run);
    let code = report.run.exit_code(signals.first());
    let deed = if args.dry_run { Deed::Look } else { Deed::Motion };
    Ok(args.output.conclude(&report, &report.text(remarks.quiet), deed, code))
}
