//! `scan` on a CAN line: what is said of it.

use super::ScanArgs;
use crate::cli::protocol::can_dialect;
use crate::cli::terminal::Terminal;
use crate::cli::{Deed, Remarks};
use crate::error::Error;
use crate::job::report::counted;
use crate::job::scan::can::{CanScanReport, Collision, LeftOut, scan_can};
use std::fmt::Write;

/// Runs `scan` on a CAN line; exit code 1 if nobody is heard.
///
/// # Errors
/// A line that cannot be opened or fails, a protocol that is none of CAN lines.
pub fn run(args: &ScanArgs, remarks: Remarks) -> Result<i32, Error> {
    if args.baud.is_some() {
        return Err(Error::new("the speed of a CAN line is the interface's, or stands in its address")
            .at("--baud")
            .allowed("no --baud on a CAN line")
            .remedy(
                "ip link set can0 down; ip link set can0 up type can bitrate 500000. Of an slcan adapter: \
                 can:slcan:/dev/ttyACM0?bitrate=500000",
            ));
    }
    if args.timeout.is_some() {
        return Err(Error::new("this option is for serial lines").at("--timeout"));
    }
    let dialect = can_dialect(args.protocol, &args.bus)?;
    let terminal = Terminal::unheard(remarks);
    let report = scan_can(&args.bus, args.robot.as_deref(), dialect, args.let_go, &terminal)?;
    let code = i32::from(report.devices.is_empty() && report.collisions.is_empty());
    let code = args.output.conclude(&report, &text(&report), Deed::Look, code);
    if report.devices.iter().any(|device| !device.unasked) {
        remarks.say(TWINS);
    }
    Ok(code)
}

/// Two devices that answer the same bits at the same time are one to everybody on the line.
const TWINS: &str = "two devices with one id whose answers are equal in every bit look like one: \
                     if a count surprises you, plug them in one by one";

fn text(report: &CanScanReport) -> String {
    let mut out = format!(
        "{:>3}  {:<14} {:<26} {:<10} {:<10} {:<24} {}\n",
        "ID", "protocol", "model", "hardware", "firmware", "serial", "torque"
    );
    for of in &report.devices {
        let known = |fact: &Option<String>| fact.clone().unwrap_or_else(|| "?".to_owned());
        let torque = of.torque_on.map_or("?", |on| if on { "on" } else { "off" });
        let faults = of.faults.as_ref().map_or_else(String::new, |f| format!("  FAULT: {f}"));
        let _ = writeln!(
            out,
            "{:>3}  {:<14} {:<26} {:<10} {:<10} {:<24} {torque}{faults}",
            of.id,
            of.protocol,
            of.model.as_deref().unwrap_or("not told"),
            known(&of.hardware),
            known(&of.firmware),
            known(&of.serial),
        );
    }
    for Collision { id, protocol, reason } in &report.collisions {
        let _ = writeln!(
            out,
            "{id:>3}  TWO DEVICES WITH THIS ID? ({protocol}): {reason}\n     unplug all but \
             one and give it another: gaitway servo set-id BUS {id} NEW"
        );
    }
    let devices = counted(report.devices.len(), "device");
    let _ = writeln!(out, "{devices} on {} at {}", report.bus, report.speed);
    report.asked.iter().for_each(|words| {
        let _ = writeln!(out, "asked      {words}");
    });
    for LeftOut { protocol, reason } in &report.left_out {
        let _ = writeln!(out, "not asked  {protocol}: {reason}");
    }
    report.notes.iter().for_each(|note| {
        let _ = writeln!(out, "note       {note}");
    });
    if report.devices.is_empty() && report.collisions.is_empty() {
        out.push_str(
            "nobody is heard: check power, cable, the resistors at both ends, and the \
             bit rate\n",
        );
    }
    out
}
