//! `ports`: where a robot could be plugged in, and what keeps it from working.

use super::finding::{self, Finding};
use super::{Output, Remarks};
use crate::error::Error;
use crate::port::inventory::{Access, CanPort, Machine, SerialPort, UsbFacts};
use clap::Args;
use gaitway_profiles as profiles;
use serde::Serialize;
use std::fmt::Write;
use std::path::PathBuf;

/// The rules that come with gaitway.
pub const RULES: &str = include_str!("../../udev/60-gaitway.rules");
/// The name they are installed by.
pub const RULES_FILE: &str = "60-gaitway.rules";
/// What installs them.
pub const INSTALL_RULES: &str = "gaitway doctor --rules | sudo tee /etc/udev/rules.d/60-gaitway.rules > /dev/null\n\
     sudo udevadm control --reload && sudo udevadm trigger";

/// A latency timer above this costs a 100 Hz cycle noticeably, ms.
const LONGEST_LATENCY_MS: u32 = 1;

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

/// A serial port with what is known of its adapter.
#[derive(Clone, Debug, Serialize)]
pub struct Port {
    /// What the machine says.
    #[serde(flatten)]
    pub port: SerialPort,
    /// Adapter by its USB id, as its profile names it.
    pub adapter: Option<String>,
}

/// What `ports` found.
#[derive(Clone, Debug, Serialize)]
pub struct Survey {
    /// Serial ports.
    pub serial: Vec<Port>,
    /// CAN interfaces.
    pub can: Vec<CanPort>,
    /// What is not as it should be.
    pub findings: Vec<Finding>,
}

/// Runs `ports`.
///
/// # Errors
/// A report file that exists or cannot be written.
pub fn run(args: &PortsArgs, _remarks: Remarks) -> Result<i32, Error> {
    args.output.check_files(&[])?;
    let found = survey(&Machine::at(&args.root));
    args.output.report(&found, &found.text())?;
    Ok(0)
}

/// Looks at every port of `machine`.
#[must_use]
pub fn survey(machine: &Machine) -> Survey {
    let with_adapter = |port: SerialPort| {
        let ids = port.usb.as_ref().and_then(UsbFacts::ids);
        let adapter = ids
            .and_then(|(vendor, product)| profiles::adapter_for_usb(vendor, product).ok()?)
            .map(|adapter| adapter.model.clone());
        Port { port, adapter }
    };
    let serial: Vec<Port> = machine.serial_ports().into_iter().map(with_adapter).collect();
    let can = machine.can_ports();
    let mut findings = Vec::new();
    if serial.is_empty() && can.is_empty() {
        findings.push(Finding::advice(
            "ports",
            "no serial port and no CAN interface",
            "plug the adapter in; `sudo dmesg | tail` says what the kernel made of it\n\
             without hardware: gaitway play walk --robot op3 --bus sim",
        ));
    }
    findings.extend(serial.iter().flat_map(|port| serial_findings(&port.port)));
    findings.extend(can.iter().filter_map(can_finding));
    Survey { serial, can, findings }
}

fn serial_findings(port: &SerialPort) -> Vec<Finding> {
    let mut findings = Vec::new();
    if !port.access.granted {
        findings.push(Finding::problem(
            &port.path,
            format!("you may not open it (group {}, mode {})", port.access.group, port.access.mode),
            format!(
                "{INSTALL_RULES}\nor, on a machine without a desktop session: \
                     sudo usermod -aG {} $USER, then log in again",
                port.access.group
            ),
        ));
    }
    if let Some(ms) = port.latency_timer_ms.filter(|&ms| ms > LONGEST_LATENCY_MS) {
        let name = port.path.trim_start_matches("/dev/");
        findings.push(Finding::advice(
            &port.path,
            format!("the driver holds answers back for up to {ms} ms"),
            format!(
                "echo 1 | sudo tee /sys/class/tty/{name}/device/latency_timer\n\
                     for good: {INSTALL_RULES}"
            ),
        ));
    }
    for holder in &port.held_by {
        findings.push(Finding::advice(
            &port.path,
            format!("held open by {} (process {})", holder.name, holder.pid),
            "end that program before gaitway opens the port",
        ));
    }
    findings
}

fn can_finding(can: &CanPort) -> Option<Finding> {
    (can.state == "down").then(|| {
        Finding::advice(
            &can.name,
            "the interface is down",
            format!("sudo ip link set {} up type can bitrate 1000000", can.name),
        )
    })
}

impl Survey {
    /// The survey for a person.
    #[must_use]
    pub fn text(&self) -> String {
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
            let rate = can.bitrate_bps.map_or_else(
                || format!("speed: ask `ip -details link show {}`", can.name),
                |bps| format!("{bps} bit/s"),
            );
            let driver = can.driver.as_deref().unwrap_or("virtual");
            let _ = writeln!(out, "  {:<15} {}, {driver}, {rate}", can.name, can.state);
        }
        out.push_str(&finding::text(&self.findings));
        out
    }
}
