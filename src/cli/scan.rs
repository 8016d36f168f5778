//! `scan`: every device that answers on a line. Reads only.

mod can;

use super::signals::Signals;
use super::terminal::Terminal;
use super::{Deed, Output, Remarks};
use crate::cli::protocol::{ProtocolName, serial_protocol};
use crate::error::Error;
use crate::job::report::counted;
use crate::job::scan::{Collision, Device, ScanOrder, ScanReport, Speeds, scan_line};
use crate::job::servo::register::firmware_words;
use crate::rig::{Address, is_can};
use crate::time::Duration;
use clap::Args;
use std::fmt::Write;

/// Arguments of `scan`.
#[derive(Debug, Args)]
#[command(after_help = include_str!("help/scan.txt"))]
pub struct ScanArgs {
    /// Where the line is: serial:PATH[?baud=N], tcp:HOST:PORT, can:INTERFACE,
    /// can:slcan:PATH[?bitrate=N], sim or sim:pty
    bus: Address,
    /// Ask in this protocol only [default: all]
    #[arg(long, value_enum)]
    protocol: Option<ProtocolName>,
    /// Line speed, bits per second, or `all`: every speed of every known servo. Of serial lines: the
    /// speed of a CAN interface is set with `ip link`, that of an slcan adapter stands in its address
    #[arg(long, value_name = "BPS|all", value_parser = baud)]
    baud: Option<Speeds>,
    /// Wait at least so long for each answer, on serial lines: behind adapters and networks that are slow
    /// [default: what line, servo and adapter may take]
    #[arg(long, value_name = "MS", value_parser = timeout)]
    timeout: Option<Duration>,
    /// Robot whose line this is: says the line speed, and which robot a virtual one is
    #[arg(long, value_name = "ROBOT")]
    robot: Option<String>,
    /// Tell CubeMars actuators in MIT mode to let go: they answer nothing else that moves nothing.
    /// What they hold falls
    #[arg(long)]
    let_go: bool,
    #[command(flatten)]
    output: Output,
}

pub(super) fn baud(text: &str) -> Result<Speeds, String> {
    match text.parse() {
        Ok(bps) if bps > 0 => Ok(Speeds::One(bps)),
        _ if text == "all" => Ok(Speeds::All),
        _ => Err("a number of bits per second, or all".to_owned()),
    }
}

/// Reads `--timeout`.
fn timeout(text: &str) -> Result<Duration, String> {
    match text.parse() {
        Ok(ms @ 1..=10_000) => Ok(Duration::from_millis(ms)),
        _ => Err("1 to 10000 ms".to_owned()),
    }
}

/// Two devices equal in everything that is read, at every time it is read, cannot be told apart.
const TWINS: &str = "two devices with one ID that always answer the same at the same time look \
                     like one: if a count surprises you, plug them in one by one";

/// Runs `scan`; exit code 1 if nobody answers.
///
/// # Errors
/// A line that cannot be opened or fails.
pub fn run(args: &ScanArgs, remarks: Remarks) -> Result<i32, Error> {
    args.output.check_files(&[])?;
    let robot = args.robot.as_deref();
    if is_can(&args.bus, robot)? {
        return can::run(args, remarks);
    }
    let protocol = serial_protocol(args.protocol, &args.bus)?;
    let signals = Signals::listen().map_err(|e| Error::new(format!("no signals: {e}")))?;
    let terminal = Terminal::new(remarks, &signals);
    let speeds = args.baud.unwrap_or_default();
    let how = ScanOrder { bus: &args.bus, robot, protocol, speeds, wait: args.timeout };
    let report = scan_line(&how, &terminal)?;
    let code = i32::from(report.devices.is_empty() && report.collisions.is_empty());
    let code = signals.first().filter(|_| report.stopped).map_or(code, |number| 128 + number);
    let code = args.output.conclude(&report, &text(&report), Deed::Look, code);
    match (report.devices.is_empty(), protocol) {
        (false, _) => remarks.say(TWINS),
        (true, Some(_)) => remarks.say("without --protocol the line is asked in all protocols"),
        (true, None) => {}
    }
    Ok(code)
}

/// Letters of the column of models, if none is longer.
const MODEL_COLUMN: usize = 16;

fn text(report: &ScanReport) -> String {
    let model = |device: &Device| device.model.clone().unwrap_or_else(|| "unknown".to_owned());
    let longest = report.devices.iter().map(|device| model(device).chars().count()).max();
    let wide = longest.unwrap_or(0).max(MODEL_COLUMN);
    let mut out = format!(
        "{:>3}  {:<wide$} {:>6}  {:<9} {:<14} {:>9}\n",
        "ID", "model", "number", "firmware", "protocol", "bit/s"
    );
    let unknown = || "?".to_owned();
    for device in &report.devices {
        let known = device.profile.as_deref().and_then(|p| gaitway_profiles::servo(p).ok());
        let firmware = device.firmware.map_or_else(unknown, |firmware| {
            known.map_or_else(|| firmware.to_string(), |s| firmware_words(s, firmware))
        });
        let _ = writeln!(
            out,
            "{:>3}  {:<wide$} {:>6}  {firmware:<9} {:<14} {:>9}{}",
            device.id,
            model(device),
            device.model_number.map_or_else(unknown, |number| number.to_string()),
            device.protocol,
            device.baud_bps.map_or_else(|| "-".to_owned(), |bps| bps.to_string()),
            if device.alert { "  reports an error" } else { "" }
        );
    }
    for collision in &report.collisions {
        let Collision { id, protocol, baud_bps, reason } = collision;
        let speed = baud_bps.map_or_else(String::new, |bps| format!(", {bps} bit/s"));
        let _ = writeln!(
            out,
            "{id:>3}  TWO DEVICES WITH THIS ID? ({protocol}{speed}): {reason}\n     \
             unplug all but one and give it another: gaitway servo set-id BUS {id} NEW"
        );
    }
    for own in &report.profiles {
        let _ = writeln!(out, "profile {own}");
    }
    let speeds = match report.scanned_baud_bps[..] {
        [] => String::new(),
        [one] => format!(" at {one} bit/s"),
        ref several => format!(" at {}", counted(several.len(), "line speed")),
    };
    let _ = writeln!(out, "{}{speeds} on {}", counted(report.devices.len(), "device"), report.bus);
    if report.scanned_baud_bps.is_empty() {
        out.push_str(
            "the speed of a line behind TCP is that of its other end, and not known here\n",
        );
    }
    if report.stopped {
        out.push_str("stopped before all was asked: there may be more\n");
    } else if report.devices.is_empty() && report.collisions.is_empty() {
        out.push_str("nobody answers: check power and cable");
        out.push_str(if report.scanned_baud_bps.len() == 1 {
            ", or look at every speed with --baud all\n"
        } else {
            "\n"
        });
    }
    if !report.unusable_baud_bps.is_empty() {
        let speeds: Vec<String> = report.unusable_baud_bps.iter().map(u32::to_string).collect();
        let _ = writeln!(out, "the port does not know {} bit/s", speeds.join(", "));
    }
    out
}
