//! `play`, as it is typed.

use super::calibrated::CalibrationArg;
use super::signals::Signals;
use super::source::MotionArgs;
use super::terminal::Terminal;
use super::viewing::{ViewArg, Viewing};
use super::{Deed, Output, Remarks};
use crate::error::Error;
use crate::job::page::{self, live::Shows};
use crate::job::play::{self, Accept, Options, PlayOrder, Played, Rounds};
use crate::job::report::PlayReport;
use crate::rig::Address;
use clap::{Args, ValueEnum};
use std::path::{Path, PathBuf};

/// Arguments of `play`.
#[derive(Clone, Debug, Args)]
#[command(after_help = include_str!("help/play.txt"))]
pub struct PlayArgs {
    #[command(flatten)]
    motion: MotionArgs,
    /// Where the robot is: sim, sim:pty, serial:PATH[?baud=N], tcp:HOST:PORT, can:INTERFACE; LINE=BUS
    /// for each line of a robot with several
    #[arg(long, value_name = "BUS", required = true)]
    bus: Vec<Address>,
    /// Cycles per second [default: the robot file's]
    #[arg(long, value_name = "HZ", value_parser = rate, allow_negative_numbers = true)]
    rate: Option<f64>,
    /// Play it N times, with a transition in between; without N until Ctrl-C, which brings it to rest [default: 1]
    #[arg(long = "loop", value_name = "N", num_args = 0..=1, default_value = "1", hide_default_value = true,
          default_missing_value = ENDLESS, value_parser = rounds)]
    repeat: Rounds,
    /// What the joints do after the motion
    #[arg(long, value_enum, default_value_t = EndState::Hold)]
    end: EndState,
    /// Record goals and measured states to this file
    #[arg(long, value_name = "FILE.mcap")]
    record: Option<PathBuf>,
    /// Refuse a motion that starts away from where the robot stands, instead of moving there first
    #[arg(long)]
    no_approach: bool,
    /// Play on servos whose firmware the profile was not checked against
    #[arg(long)]
    accept_firmware: bool,
    /// Lower the servos' return delay (EEPROM) if the rate needs it; you are told how to undo it
    #[arg(long)]
    permit_eeprom: bool,
    /// Check everything, write nothing
    #[arg(long)]
    dry_run: bool,
    /// Write a page with plots of every joint
    #[arg(long, value_name = "FILE.html")]
    html: Option<PathBuf>,
    #[command(flatten)]
    view: ViewArg,
    /// The virtual robot has weight and may fall (sim, sim:pty; robots whose file has a body)
    #[arg(long)]
    physics: bool,
    /// Joints that the robot's file names answer a base that tilts otherwise than the motion wants (op3: its ankles; its
    /// OpenCR feels it)
    #[arg(long)]
    balance: bool,
    /// Faults of this script befall the virtual robot, by its own clock (sim, sim:pty; keys: sim/README.md)
    #[arg(long, value_name = "FILE.toml")]
    faults: Option<PathBuf>,
    /// Seed of the virtual robot
    #[arg(long, default_value_t = 0)]
    seed: u64,
    #[command(flatten)]
    calibration: CalibrationArg,
    #[command(flatten)]
    output: Output,
}

/// What the joints do when the motion is over, as it is typed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum EndState {
    /// Stay where they are, torque on
    Hold,
    /// Torque off: a standing robot falls
    Limp,
}

/// Runs `play`; the exit code.
///
/// # Errors
/// No signals can be heard. A refused motion is a report, not an error.
pub fn run(args: &PlayArgs, remarks: Remarks) -> Result<i32, Error> {
    let signals = Signals::listen().map_err(|e| Error::new(format!("no signals: {e}")))?;
    let order = args.order();
    let checked = args.output.check_files(&[&args.record, &args.html]);
    let what = &order.motion.motion;
    let played = match checked
        .and_then(|()| args.view.open(Some(&order.robot), &order.buses, what, Shows::default()))
    {
        Ok(view) => {
            let terminal = Terminal::new(remarks, &signals);
            let viewing = Viewing::new(&terminal, view.as_ref());
            let played = play::play(&order, &viewing);
            viewing.ended(played.report.outcome, played.report.stop_reason.as_deref());
            played
        }
        Err(error) => {
            let buses = order.buses.iter().map(ToString::to_string).collect();
            let mut report = PlayReport::new(&order.motion.motion, &order.robot, buses);
            report.dry_run = args.dry_run;
            report.describe_refused(&error);
            Played { report, series: None, scene: None }
        }
    };
    let report = args.with_page(played);
    let code = report.exit_code(signals.first());
    let deed = if args.dry_run { Deed::Look } else { Deed::Motion };
    Ok(args.output.conclude(&report, &report.text(remarks.quiet), deed, code))
}

/// Reads `--rate`: below 20 Hz goals would be too far apart to be watched.
pub(super) fn rate(text: &str) -> Result<f64, String> {
    let rate_hz: f64 = text.parse().map_err(|_| "not a number".to_owned())?;
    if (20.0..=1000.0).contains(&rate_hz) {
        Ok(rate_hz)
    } else {
        Err("allowed: 20 to 1000 Hz".to_owned())
    }
}

/// What `--loop` without a number stands for.
const ENDLESS: &str = "endless";

/// Reads `--loop`.
fn rounds(text: &str) -> Result<Rounds, String> {
    match text.parse::<u32>() {
        _ if text == ENDLESS => Ok(Rounds::Endless),
        Ok(count @ 1..=10_000) => Ok(Rounds::Times(count)),
        _ => Err("1 to 10000, or nothing: until Ctrl-C".to_owned()),
    }
}

impl PlayArgs {
    fn order(&self) -> PlayOrder {
        PlayOrder {
            motion: self.motion.order(),
            robot: self.motion.robot().to_owned(),
            buses: self.bus.clone(),
            calibration: self.calibration.path().map(Path::to_owned),
            seed: self.seed,
            options: Options {
                speed: self.motion.speed(),
                retime: self.motion.retime(),
                approach: !self.no_approach,
                rounds: self.repeat,
                rate_hz: self.rate,
                end: match self.end {
                    EndState::Hold => play::EndState::Hold,
                    EndState::Limp => play::EndState::Limp,
                },
                record: self.record.clone(),
                replace: self.output.force(),
                keep_series: self.html.is_some(),
                accept: Accept { firmware: self.accept_firmware, eeprom: self.permit_eeprom },
                dry_run: self.dry_run,
                hangs: self.motion.hangs(),
                allow_fall: self.motion.allows_fall(),
                physics: self.physics,
                balance: self.balance,
                faults: self.faults.clone(),
            },
        }
    }

    /// Writes the page with plots, if one is wanted and something was played.
    fn with_page(&self, played: Played) -> PlayReport {
        let Played { mut report, scene, .. } = played;
        let (Some(path), Some(scene)) = (&self.html, scene) else { return report };
        report.html = Some(path.display().to_string());
        let page = page::page(&report, scene);
        let written = page.and_then(|page| self.output.write_file(path, page.as_bytes()));
        if let Err(error) = written {
            report.describe_no_page(&error);
        }
        report
    }
}
