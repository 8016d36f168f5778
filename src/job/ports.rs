//! Where a robot could be plugged in, and what keeps it from working.

use super::finding::Finding;
use crate::port::inventory::{SerialPort, UsbFacts};
use gaitway_profiles as profiles;
use serde::Serialize;

pub use crate::port::can::Controller;
pub use crate::port::inventory::{Access, CanKind, CanPort, Machine};

/// The rules that come with gaitway.
pub const RULES: &str = include_str!("../../udev/60-gaitway.rules");
/// The name they are installed by.
pub const RULES_FILE: &str = "60-gaitway.rules";
/// What installs them.
pub const INSTALL_RULES: &str = "gaitway doctor --rules | sudo tee /etc/udev/rules.d/60-gaitway.rules > /dev/null\n\
     sudo udevadm control --reload && sudo udevadm trigger";

/// A latency timer above this costs a 100 Hz cycle noticeably, ms.
const LONGEST_LATENCY_MS: u32 = 1;

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
    /// Whether this kernel knows CAN at all.
    pub kernel_speaks_can: bool,
    /// What is not as it should be.
    pub findings: Vec<Finding>,
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
    findings.extend(serial.iter().filter_map(|port| slcan_finding(&port.port)));
    findings.extend(can.iter().filter_map(can_finding));
    Survey { serial, can, kernel_speaks_can: machine.speaks_can(), findings }
}

fn serial_findings(port: &SerialPort) -> Vec<Finding> {
    let mut findings = Vec::new();
    if !port.access.granted {
        findings.push(no_access(port));
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

fn no_access(port: &SerialPort) -> Finding {
    let (path, group) = (&port.path, &port.access.group);
    let found = format!("you may not open it (group {group}, mode {})", port.access.mode);
    // Nobody should have to become a member of root for a port.
    let share = if group == "root" {
        format!("sudo chgrp dialout {path} && sudo chmod 660 {path}")
    } else {
        format!("sudo usermod -aG {group} $USER, then log in again")
    };
    if port.usb.is_some() {
        let remedy =
            format!("{INSTALL_RULES}\nor, on a machine without a desktop session: {share}");
        Finding::problem(path, found, remedy)
    } else {
        Finding::advice(path, found, format!("only if a robot is on this built-in port: {share}"))
    }
}

/// What keeps a CAN interface from working, with what mends it.
fn can_finding(can: &CanPort) -> Option<Finding> {
    let name = &can.name;
    let set_up = match (can.bitrate_bps, can.data_bitrate_bps) {
        (Some(bps), Some(fast)) => format!("type can bitrate {bps} dbitrate {fast} fd on"),
        (Some(bps), None) => format!("type can bitrate {bps}"),
        _ => "type can bitrate 1000000".to_owned(),
    };
    if can.state == "down" {
        let remedy = match can.kind {
            CanKind::Virtual => format!("sudo ip link set {name} up"),
            CanKind::Slcan => format!(
                "sudo ip link set {name} up\n\
                 if slcand has ended: sudo slcand -o -c -s8 /dev/ttyACM0 {name} (-s8: 1 Mbit/s)"
            ),
            CanKind::Controller => format!(
                "sudo ip link set {name} up {set_up}\n\
                 for CAN FD (moteus): sudo ip link set {name} up type can bitrate 1000000 \
                 dbitrate 5000000 fd on"
            ),
        };
        return Some(Finding::advice(name, "the interface is down", remedy));
    }
    let again = format!(
        "check CAN_H, CAN_L, ground, a resistor of 120 ohm at each end and the bit rate, then:\n\
         sudo ip link set {name} down && sudo ip link set {name} up {set_up} restart-ms 100"
    );
    match can.controller? {
        Controller::BusOff => Some(Finding::problem(
            name,
            "the controller has left the line (bus-off): too many errors",
            again,
        )),
        Controller::Passive => Some(Finding::problem(
            name,
            "so many errors that the controller may not speak up any more (error passive)",
            again,
        )),
        Controller::Warning => {
            Some(Finding::advice(name, "the controller has counted many errors", again))
        }
        Controller::Active | Controller::Stopped => None,
    }
}

/// A serial port that is a USB-CAN adapter in disguise.
fn slcan_finding(port: &SerialPort) -> Option<Finding> {
    let usb = port.usb.as_ref()?;
    let said = [&usb.maker, &usb.product].into_iter().flatten();
    let said: Vec<String> = said.map(|words| words.to_lowercase()).collect();
    let is_can = said.iter().any(|words| words.contains("canable") || words.contains("slcan"));
    is_can.then(|| {
        Finding::advice(
            &port.path,
            "a USB-CAN adapter that speaks slcan",
            format!("the CAN line behind it is: --bus can:slcan:{}", port.path),
        )
    })
}
