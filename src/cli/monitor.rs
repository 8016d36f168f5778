//! `monitor`: how every joint is, again and again. Reads only.

use super::Remarks;
use super::calibrated::CalibrationArg;
use super::output::{Untold, print_json, print_over};
use super::signals::Signals;
use crate::bus::AskError;
use crate::device::{Health, JointState};
use crate::error::{Error, ErrorKind};
use crate::rig::Address;
use crate::rig::connect;
use crate::robot::{Link, LinkError};
use crate::time::Duration;
use clap::Args;
use gaitway_profiles::Role;
use serde::Serialize;
use std::fmt::Write;
use std::io::IsTerminal;

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

/// One joint at one time; absent: not read.
#[derive(Clone, Debug, Default, Serialize)]
struct Row {
    name: String,
    id: u8,
    goal_rad: Option<f64>,
    present_rad: Option<f64>,
    velocity_rad_s: Option<f64>,
    load_ratio: Option<f64>,
    current_a: Option<f64>,
    temperature_c: Option<f64>,
    voltage_v: Option<f64>,
    torque_on: Option<bool>,
    /// What the servo reports, or why it says nothing.
    error: Option<String>,
}

#[derive(Serialize)]
struct Reading<'a> {
    time_s: f64,
    joints: &'a [Row],
}

/// Budget of the first look: other programs are listened for before anything is told.
const FIRST: Duration = Duration::from_secs(2);
/// Meanwhile those speak who tell of themselves unasked.
const UNASKED: Duration = Duration::from_millis(150);
/// Budget of one question.
const QUESTION: Duration = Duration::from_millis(50);

/// Runs `monitor` until the time is over or a signal comes.
///
/// # Errors
/// A bus that cannot be opened, a line that is lost. A silent joint is a row that says so.
pub fn run(args: &MonitorArgs, remarks: Remarks) -> Result<i32, Error> {
    let signals = Signals::listen().map_err(|e| Error::new(format!("no signals: {e}")))?;
    let (robot, calibration) = args.calibration.load(&args.robot, &args.bus)?;
    if let Some(path) = calibration {
        remarks.say(&format!("calibration {}", path.display()));
    }
    let mut connection = connect(robot, &args.bus, 0)?;
    let real_time = connection.real_time;
    let link = &mut connection.link;
    link.set_retries(1);
    let clock = std::sync::Arc::clone(link.clock());
    // CAN actuators that answer commands only are listened for first; that is not done again.
    let _ = answered(link.states(clock.now() + FIRST))?;
    clock.sleep_until(clock.now() + UNASKED);
    let began = clock.now();
    let once = if real_time { None } else { Some(Duration::ZERO) };
    let until = args.for_time.or(once).map(|time| began + time);
    let mut shown_lines = 0;
    let live = !args.json && std::io::stdout().is_terminal();
    loop {
        let at = clock.now();
        let rows = read(link)?;
        let time_s = at.since(began).as_secs_f64();
        let told = if args.json {
            let reading = Reading { time_s, joints: &rows };
            let line = serde_json::to_string(&reading)
                .map_err(|e| Error::new(format!("a reading cannot be written as JSON: {e}")))?;
            print_json(&format!("{line}\n"))
        } else {
            let table = table(time_s, &rows);
            let over = if live { shown_lines } else { 0 };
            shown_lines = table.lines().count();
            print_over(over, &table)
        };
        match told {
            Ok(()) => {}
            Err(Untold::Unwanted) => return Ok(0),
            Err(failed) => return Err(failed.into()),
        }
        let next = at + Duration::from_secs_f64(1.0 / args.rate);
        if until.is_some_and(|until| next > until) || signals.first().is_some() {
            return Ok(0);
        }
        clock.sleep_until(next);
    }
}

/// A question that one joint did not answer is that joint's matter; a line that is gone is not.
fn answered<T>(read: Result<T, LinkError>) -> Result<Result<T, String>, Error> {
    match read {
        Ok(value) => Ok(Ok(value)),
        Err(LinkError { error: AskError::Port(error), place, .. }) => {
            Err(Error::of(ErrorKind::Damaged, "the line failed").at(place).got(error.to_string()))
        }
        Err(error) => Ok(Err(error.error.to_string())),
    }
}

fn read(link: &mut Link) -> Result<Vec<Row>, Error> {
    let states = answered(link.states(link.clock().now() + 2 * QUESTION))?;
    let states = states.map_err(|e| Error::new("the robot cannot be asked").got(e))?;
    let mut rows = Vec::with_capacity(states.len());
    for (index, state) in states.into_iter().enumerate() {
        let joint = &link.robot().joints[index];
        let mut row = Row { name: joint.name.clone(), id: joint.id, ..Row::default() };
        match state {
            Ok((state, _)) => {
                row.take(&state);
                fill(link, index, &mut row)?;
            }
            Err(miss) => row.error = Some(miss.to_string()),
        }
        rows.push(row);
    }
    Ok(rows)
}

/// Goal and slow facts of one joint.
fn fill(link: &mut Link, index: usize, row: &mut Row) -> Result<(), Error> {
    let budget = link.clock().now() + QUESTION;
    if let Some(register) = link.robot().joints[index].register(Role::GoalPosition) {
        match answered(link.read_register(index, register, budget))? {
            Ok(raw) => {
                let joint = &link.robot().joints[index];
                let position_rad = joint.model()?.si_from_raw(register, raw);
                let goal = JointState { position_rad, ..JointState::default() };
                row.goal_rad = Some(joint.joint_state(goal).position_rad);
            }
            Err(miss) => row.error = Some(miss),
        }
    }
    for part in 0..link.health_reads(index) {
        let budget = link.clock().now() + QUESTION;
        match answered(link.health(index, part, budget))? {
            Ok(health) => {
                row.take_health(&health);
                if let Some(bits) = health.error_bits.filter(|&bits| bits != 0) {
                    row.error = Some(link.error_words(index, bits));
                }
            }
            Err(miss) => row.error = Some(miss),
        }
    }
    Ok(())
}

impl Row {
    fn take(&mut self, state: &JointState) {
        self.present_rad = Some(state.position_rad);
        self.velocity_rad_s = state.velocity_rad_s;
        self.load_ratio = state.load_ratio;
        self.current_a = state.current_a;
        self.temperature_c = state.temperature_c;
        self.voltage_v = state.voltage_v;
    }

    fn take_health(&mut self, health: &Health) {
        self.torque_on = self.torque_on.or(health.torque_on);
        self.temperature_c = health.temperature_c.or(self.temperature_c);
        self.voltage_v = health.voltage_v.or(self.voltage_v);
    }
}

fn table(time_s: f64, rows: &[Row]) -> String {
    let mut out = format!(
        "{time_s:.1} s\n{:<18} {:>3} {:>9} {:>9} {:>8} {:>9} {:>6} {:>5} {:<7} {}\n",
        "joint", "ID", "goal deg", "is deg", "deg/s", "load", "deg C", "V", "torque", "error"
    );
    let number = |value: Option<f64>, digits: usize| {
        value.map_or_else(|| "-".to_owned(), |value| format!("{value:.digits$}"))
    };
    for row in rows {
        let load = match (row.load_ratio, row.current_a) {
            (_, Some(current_a)) => format!("{:.0} mA", current_a * 1e3),
            (Some(load), None) => format!("{:.0} %", load * 100.0),
            (None, None) => "-".to_owned(),
        };
        let torque = row.torque_on.map_or("-", |on| if on { "on" } else { "off" });
        let line = format!(
            "{:<18} {:>3} {:>9} {:>9} {:>8} {load:>9} {:>6} {:>5} {torque:<7} {}",
            row.name,
            row.id,
            number(row.goal_rad.map(f64::to_degrees), 1),
            number(row.present_rad.map(f64::to_degrees), 1),
            number(row.velocity_rad_s.map(f64::to_degrees), 0),
            number(row.temperature_c, 0),
            number(row.voltage_v, 1),
            row.error.as_deref().unwrap_or_default(),
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
