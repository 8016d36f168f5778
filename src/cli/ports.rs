//! `ports`, as it is typed and read.

use super::{Deed, Output, Remarks, finding};
use crate::error::Error;
use crate::job::ports::{Access, CanKind, CanPort, Controller, Machine, Port, Survey, survey};
use clap::Args;
use std::fmt::Write;
use std::path::PathBuf;

/// Arguments of `ports`.
#[derive(Debug, Args)]
#[command(after_help = "Example: gaitway ports")]
pub struct PortsArgs {
    /// Look below this folder instead of /
    #[arg(long, value_name = "DIR", hide = true, default_value = "/")]
    root: PathBuf,
    #[command(flatten)]
    output: Output,
}

/// Runs `ports`.
///
/// # Errors
/// A report file that exists or cannot be written.
pub fn run(args: &PortsArgs, _remarks: Remarks) -> Result<i32, Error> {
    args.output.check_files(&[])?;
    let found = survey(&Machine::at(&args.root));
    Ok(args.output.conclude(&found, &found.text(), Deed::Look, 0))
}

/// A CAN interface for a person.
fn can_words(can: &CanPort) -> String {
    let mut words = vec![can.state.clone()];
    words.push(match (can.kind, &can.driver) {
        (CanKind::Virtual, _) => "virtual".to_owned(),
        (CanKind::Slcan, _) => "serial adapter (slcan)".to_owned(),
        (CanKind::Controller, driver) => {
            let driver = driver.as_deref().unwrap_or("?");
            let usb = can.usb.as_ref().and_then(|usb| usb.product.clone());
            format!("driver {driver}{}", usb.map_or_else(String::new, |name| format!(", {name}")))
        }
    });
    words.push(match (can.bitrate_bps, can.kind) {
        (Some(bps), _) => format!("{bps} bit/s"),
        (None, CanKind::Virtual) => "no speed".to_owned(),
        (None, _) => "no speed set".to_owned(),
    });
    match (can.fd, can.data_bitrate_bps) {
        (Some(true), Some(fast)) => words.push(format!("CAN FD, data {fast} bit/s")),
        (Some(true), None) => words.push("CAN FD".to_owned()),
        (Some(false), _) => words.push("classic".to_owned()),
        (None, _) => {}
    }
    words.extend(can.controller.map(|health| {
        let health = match health {
            Controller::Active => "error active",
            Controller::Warning => "error warning",
            Controller::Passive => "ERROR PASSIVE",
            Controller::BusOff => "BUS-OFF",
            Controller::Stopped => "stopped",
        };
        health.to_owned()
    }));
    words.join(", ")
}

impl Survey {
    /// The survey for a person.
    pub(super) fn text(&self) -> String {
        let mut out = String::new();
        if !self.serial.is_empty() {
            out.push_str("serial ports\n");
        }
        for Port { port, adapter } in &self.serial {
            let _ = writeln!(out, "  {}", port.path);
            let mut row = |label: &str, text: String| {
                let _ = writeln!(out, "    {label:<11} {text}");
            };
            if let Some(usb) = &port.usb {
                let said = [&usb.maker, &usb.product].into_iter().flatten();
                let said: Vec<&str> = said.map(String::as_str).collect();
                row("USB", format!("{} {}", usb.id, said.join(" ")));
                row("serial no.", usb.serial.clone().unwrap_or_else(|| "none".to_owned()));
            }
            let unknown = || format!("unknown; driver {}", port.driver.as_deref().unwrap_or("?"));
            row("adapter", adapter.clone().unwrap_or_else(unknown));
            for path in &port.stable_paths {
                row("stable name", path.clone());
            }
            if let Some(ms) = port.latency_timer_ms {
                row("latency", format!("{ms} ms"));
            }
            let granted = if port.access.granted { "yes" } else { "NO" };
            let Access { group, mode, .. } = &port.access;
            row("may open", format!("{granted} (group {group}, mode {mode})"));
            for holder in &port.held_by {
                row("held by", format!("{} (process {})", holder.name, holder.pid));
            }
        }
        if !self.can.is_empty() {
            out.push_str("CAN interfaces\n");
        }
        for can in &self.can {
            let _ = writeln!(out, "  {:<15} {}", can.name, can_words(can));
        }
        if !self.kernel_speaks_can {
            out.push_str(
                "no CAN: this kernel was built without it (or a container hides it), so there is no \
                 CAN interface here;\n  robots on CAN lines play with --bus sim, or through an slcan \
                 adapter, can:slcan:PORT. For interfaces, on the machine itself: sudo modprobe can_raw\n",
            );
        }
        out.push_str(&finding::text(&self.findings));
        out
    }
}
