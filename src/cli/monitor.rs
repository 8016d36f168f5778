//! `monitor`: how every joint is, again and again. Reads only.

use super::Remarks;
use super::calibrated::CalibrationArg;
use super::output::{Untold, print_json, print_over};
use super::signals::{Signals, is_from_outside};
use super::viewing::{ViewArg, Viewing};
use crate::error::Error;
use crate::job::monitor::{MonitorOrder, monitor};
use crate::job::observer::JointReading;
use crate::job::page::live::Shows;
use crate::job::{Event, Observer};
use crate::rig::Address;
use crate::time::Duration;
use clap::Args;
use serde::Serialize;
use std::fmt::Write;
use std::io::IsTerminal;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

/// Arguments of `monitor`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  gaitway monitor op3 --bus serial:/dev/ttyUSB0\n  \
    gaitway monitor op3 --bus serial:/dev/ttyUSB0 --for 5s --json > joints.jsonl")]
pub struct MonitorArgs {
    /// Robot by name or path of its file
    robot: String,
    /// Where the robot is: sim, sim:pty, serial:PATH[?baud=N], tcp:HOST:PORT, can:INTERFACE; LINE=BUS
    /// for each line of a robot with several
    #[arg(long, value_name = "BUS", required = true)]
    bus: Vec<Address>,
    /// End after this time, e.g. 5s or 500ms [default: at Ctrl-C; once in virtual time]
    #[arg(long = "for", value_name = "TIME", value_parser = time)]
    for_time: Option<Duration>,
    /// Tables per second at most
    #[arg(long, value_name = "HZ", default_value_t = 4.0, value_parser = rate)]
    rate: f64,
    /// One JSON document per line and reading instead of tables
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    view: ViewArg,
    #[command(flatten)]
    calibration: CalibrationArg,
}

/// Reads a duration: `5s`, `500ms`, `2min`, or seconds.
///
/// # Errors
/// Anything else, in words for clap.
pub fn time(text: &str) -> Result<Duration, String> {
    let units = [("ms", 1e-3), ("min", 60.0), ("s", 1.0), ("", 1.0)];
    let seconds = units.iter().find_map(|(unit, factor)| {
        let number: f64 = text.strip_suffix(unit)?.trim().parse().ok()?;
        Some(number * factor)
    });
    match seconds {
        Some(seconds) if (0.0..=1e6).contains(&seconds) => Ok(Duration::from_secs_f64(seconds)),
        _ => Err("a time such as 5s, 500ms or 2min".to_owned()),
    }
}

fn rate(text: &str) -> Result<f64, String> {
    let rate_hz: f64 = text.parse().map_err(|_| "not a number".to_owned())?;
    if (0.1..=50.0).contains(&rate_hz) {
        Ok(rate_hz)
    } else {
        Err("allowed: 0.1 to 50 Hz".to_owned())
    }
}

#[derive(Serialize)]
struct Look<'a> {
    time_s: f64,
    joints: &'a [JointReading],
}

/// Shows each look as it comes.
struct Screen<'a> {
    json: bool,
    /// A terminal: each table stands over the one before.
    live: bool,
    remarks: Remarks,
    signals: &'a Signals,
    shown_lines: AtomicUsize,
    untold: Mutex<Option<Untold>>,
}

impl Screen<'_> {
    fn tell(&self, time_s: f64, joints: &[JointReading]) -> Result<(), Untold> {
        if self.json {
            let line = serde_json::to_string(&Look { time_s, joints });
            return print_json(&(line.map_err(|e| Untold::Failed(e.to_string()))? + "\n"));
        }
        let table = table(time_s, joints);
        let shown = self.shown_lines.swap(table.lines().count(), Ordering::Relaxed);
        print_over(if self.live { shown } else { 0 }, &table)
    }
}

impl Observer for Screen<'_> {
    fn hear(&self, event: Event<'_>) {
        match event {
            Event::Note(text) => self.remarks.say(text),
            Event::Joints { time_s, joints } => {
                let told = self.tell(time_s, joints).err();
                *self.untold.lock().unwrap_or_else(PoisonError::into_inner) = told;
            }
            _ => {}
        }
    }

    fn wants_to_stop(&self) -> bool {
        let untold = self.untold.lock().unwrap_or_else(PoisonError::into_inner).is_some();
        untold || self.signals.first().is_some()
    }
}

/// Runs `monitor` until the time is over or a signal comes.
///
/// # Errors
/// A bus that cannot be opened, a line that is lost, a table that cannot be shown.
pub fn run(args: &MonitorArgs, remarks: Remarks) -> Result<i32, Error> {
    let signals = Signals::listen().map_err(|e| Error::new(format!("no signals: {e}")))?;
    let screen = Screen {
        json: args.json,
        live: !args.json && std::io::stdout().is_terminal(),
        remarks,
        signals: &signals,
        shown_lines: AtomicUsize::new(0),
        untold: Mutex::new(None),
    };
    let order = MonitorOrder {
        robot: args.robot.clone(),
        buses: args.bus.clone(),
        calibration: args.calibration.path().map(Path::to_owned),
        time: args.for_time,
        rate_hz: args.rate,
    };
    let view = args.view.open(Some(&args.robot), &args.bus, "as it is", Shows::default())?;
    monitor(&order, &Viewing::new(&screen, view.as_ref()))?;
    match screen.untold.into_inner().unwrap_or_else(PoisonError::into_inner) {
        Some(failed @ Untold::Failed(_)) => Err(failed.into()),
        Some(Untold::Unwanted) | None => {
            let ended = signals.first().filter(|&number| is_from_outside(number));
            Ok(ended.map_or(0, |number| 128 + number))
        }
    }
}

fn table(time_s: f64, joints: &[JointReading]) -> String {
    let mut out = format!(
        "{time_s:.1} s\n{:<18} {:>3} {:>9} {:>9} {:>8} {:>9} {:>6} {:>5} {:<7} {}\n",
        "joint", "ID", "goal deg", "is deg", "deg/s", "load", "deg C", "V", "torque", "error"
    );
    let number = |value: Option<f64>, digits: usize| {
        value.map_or_else(|| "-".to_owned(), |value| format!("{value:.digits$}"))
    };
    for joint in joints {
        let load = match (joint.load_ratio, joint.current_a) {
            (_, Some(current_a)) => format!("{:.0} mA", current_a * 1e3),
            (Some(load), None) => format!("{:.0} %", load * 100.0),
            (None, None) => "-".to_owned(),
        };
        let torque = joint.torque_on.map_or("-", |on| if on { "on" } else { "off" });
        let line = format!(
            "{:<18} {:>3} {:>9} {:>9} {:>8} {load:>9} {:>6} {:>5} {torque:<7} {}",
            joint.name,
            joint.id,
            number(joint.goal_rad.map(f64::to_degrees), 1),
            number(joint.present_rad.map(f64::to_degrees), 1),
            number(joint.velocity_rad_s.map(f64::to_degrees), 0),
            number(joint.temperature_c, 0),
            number(joint.voltage_v, 1),
            joint.error.as_deref().unwrap_or_default(),
        );
        let _ = writeln!(out, "{}", line.trim_end());
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_read_with_their_unit() {
        for (text, millis) in [("5s", 5000), ("500ms", 500), ("2min", 120_000), ("1.5", 1500)] {
            assert_eq!(time(text), Ok(Duration::from_millis(millis)), "{text}");
        }
        for text in ["", "s", "-1s", "NaN", "5h", "inf"] {
            assert!(time(text).is_err(), "{text}");
        }
    }
}
