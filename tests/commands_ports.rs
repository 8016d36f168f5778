//! `ports` and `doctor` on machines made of files: what a user reads there.

mod program;

use serde_json::Value;
use std::fs;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::Output;

/// A machine in a folder: the same files that Linux shows, with the same links.
struct FakeMachine(PathBuf);

impl FakeMachine {
    fn new(name: &str) -> Self {
        let root = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("machine-{name}"));
        let _ = fs::remove_dir_all(&root);
        for folder in ["dev", "proc", "etc", "sys/class/tty", "sys/class/net"] {
            fs::create_dir_all(root.join(folder)).expect("a folder");
        }
        let machine = Self(root);
        machine.write("etc/group", "root:x:0:\ndialout:x:20:\n");
        machine
    }

    fn write(&self, path: &str, text: &str) {
        let path = self.0.join(path);
        fs::create_dir_all(path.parent().expect("a folder")).expect("a folder");
        fs::write(path, text).expect("a file");
    }

    fn link(&self, path: &str, to: &str) {
        let path = self.0.join(path);
        fs::create_dir_all(path.parent().expect("a folder")).expect("a folder");
        symlink(to, path).expect("a link");
    }

    /// A U2D2 as the FTDI driver shows it (Linux Documentation/ABI, sysfs-bus-usb): the port lies
    /// inside the interface, that inside the device.
    fn plug_in_u2d2(&self, latency_ms: u32) {
        let usb = "sys/devices/pci0/usb1/1-2";
        for (name, text) in [
            ("idVendor", "0403"),
            ("idProduct", "6014"),
            ("manufacturer", "FTDI"),
            ("product", "USB <-> Serial Converter"),
            ("serial", "FT4THVPV"),
        ] {
            self.write(&format!("{usb}/{name}"), &format!("{text}\n"));
        }
        let port = format!("{usb}/1-2:1.0/ttyUSB0");
        self.write(&format!("{port}/latency_timer"), &format!("{latency_ms}\n"));
        self.write("sys/bus/usb-serial/drivers/ftdi_sio/bind", "");
        self.link(&format!("{port}/driver"), "../../../../../../bus/usb-serial/drivers/ftdi_sio");
        fs::create_dir_all(self.0.join(format!("{port}/tty/ttyUSB0"))).expect("a folder");
        self.link(&format!("{port}/tty/ttyUSB0/device"), "../..");
        self.link(
            "sys/class/tty/ttyUSB0",
            "../../devices/pci0/usb1/1-2/1-2:1.0/ttyUSB0/tty/ttyUSB0",
        );
        self.write("dev/ttyUSB0", "");
        self.link("dev/serial/by-id/usb-FTDI_FT4THVPV-if00-port0", "../../ttyUSB0");
        self.link("dev/gaitway-u2d2-FT4THVPV", "ttyUSB0");
    }

    fn run(&self, command: &str, more: &[&str]) -> Output {
        crate::program::gaitway()
            .args([command, "--root"])
            .arg(&self.0)
            .args(more)
            .output()
            .expect("the command")
    }

    fn json(&self, command: &str) -> Value {
        let output = self.run(command, &["--json"]);
        assert_eq!(output.status.code(), Some(0));
        serde_json::from_slice(&output.stdout).expect("JSON")
    }
}

fn text(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

fn finding<'a>(report: &'a Value, about: &str) -> &'a Value {
    let findings = report["findings"].as_array().expect("findings");
    findings.iter().find(|f| f["about"] == about).unwrap_or_else(|| panic!("{about}: {report:#}"))
}

#[test]
fn an_adapter_is_named_with_its_stable_names_and_its_latency() {
    let machine = FakeMachine::new("u2d2");
    machine.plug_in_u2d2(16);
    let report = machine.json("ports");
    let port = &report["serial"][0];
    assert_eq!(port["path"], "/dev/ttyUSB0");
    assert_eq!(port["usb"]["id"], "0403:6014");
    assert_eq!(port["usb"]["serial"], "FT4THVPV");
    assert_eq!(port["driver"], "ftdi_sio");
    assert_eq!(port["latency_timer_ms"], 16);
    assert!(port["adapter"].as_str().is_some_and(|name| name.contains("U2D2")), "{port:#}");
    assert_eq!(port["stable_paths"][0], "/dev/gaitway-u2d2-FT4THVPV");
    assert_eq!(port["stable_paths"][1], "/dev/serial/by-id/usb-FTDI_FT4THVPV-if00-port0");
    let slow = finding(&report, "/dev/ttyUSB0");
    assert_eq!(slow["level"], "advice");
    assert!(slow["remedy"].as_str().is_some_and(|r| r.contains("latency_timer")), "{slow:#}");
    let said = text(&machine.run("ports", &[]));
    for word in ["U2D2", "16 ms", "/dev/gaitway-u2d2-FT4THVPV", "echo 1 | sudo tee"] {
        assert!(said.contains(word), "{word} is missing in\n{said}");
    }
}

#[test]
fn a_quick_adapter_that_nobody_holds_needs_nothing() {
    let machine = FakeMachine::new("quick");
    machine.plug_in_u2d2(1);
    assert_eq!(machine.json("ports")["findings"], serde_json::json!([]));
}

#[test]
fn the_program_that_holds_a_port_is_named() {
    let machine = FakeMachine::new("held");
    machine.plug_in_u2d2(1);
    machine.write("proc/4711/comm", "dynamixel_wizar\n");
    machine.link("proc/4711/fd/5", "/dev/ttyUSB0");
    let report = machine.json("ports");
    assert_eq!(report["serial"][0]["held_by"][0]["pid"], 4711);
    let said = finding(&report, "/dev/ttyUSB0")["found"].as_str().expect("text").to_owned();
    assert!(said.contains("dynamixel_wizar") && said.contains("4711"), "{said}");
}

#[test]
fn a_port_that_is_not_soldered_in_and_a_terminal_without_hardware_are_left_out() {
    let machine = FakeMachine::new("empty");
    machine.write("sys/devices/pnp0/type", "0\n");
    machine.write("sys/devices/pnp0/tty/ttyS0/type", "0\n");
    machine.link("sys/devices/pnp0/tty/ttyS0/device", "../..");
    machine.link("sys/class/tty/ttyS0", "../../devices/pnp0/tty/ttyS0");
    machine.write("dev/ttyS0", "");
    machine.write("sys/class/tty/tty1/dev", "4:1\n");
    machine.write("dev/tty1", "");
    let report = machine.json("ports");
    assert_eq!(report["serial"], serde_json::json!([]));
    let said = finding(&report, "ports")["remedy"].as_str().expect("a remedy").to_owned();
    assert!(said.contains("--bus sim"), "{said}");
}

#[test]
fn a_can_interface_that_is_down_is_listed_with_the_command_that_wakes_it() {
    let machine = FakeMachine::new("can");
    machine.write("sys/class/net/can0/type", "280\n");
    machine.write("sys/class/net/can0/operstate", "down\n");
    machine.write("sys/class/net/can0/device/uevent", "DRIVER=mcp251x\n");
    machine.write("sys/class/net/eth0/type", "1\n");
    machine.write("sys/class/net/eth0/operstate", "up\n");
    let report = machine.json("ports");
    assert_eq!(report["can"].as_array().map(Vec::len), Some(1));
    assert_eq!(report["can"][0]["name"], "can0");
    let said = finding(&report, "can0")["remedy"].as_str().expect("a remedy").to_owned();
    assert!(said.contains("ip link set can0 up type can bitrate"), "{said}");
}

#[test]
fn doctor_says_what_is_missing_and_only_strict_makes_it_a_failure() {
    let machine = FakeMachine::new("unwell");
    machine.plug_in_u2d2(16);
    machine.write("proc/99/comm", "ModemManager\n");
    machine.write(
        "usr/lib/udev/rules.d/85-brltty.rules",
        "# 10c4/ea60\nENV{PRODUCT}==\"1a86/7523/*\", ATTRS{idVendor}==\"1A86\"\n",
    );
    machine.write("sys/devices/system/cpu/cpu0/cpufreq/scaling_governor", "powersave\n");
    machine.write("sys/devices/system/cpu/cpu0/cpufreq/scaling_driver", "cpufreq-dt\n");
    let report = machine.json("doctor");
    for (about, level) in [
        ("udev rules", "advice"),
        ("ModemManager", "problem"),
        ("brltty", "problem"),
        ("CPU governor", "advice"),
        ("/dev/ttyUSB0", "advice"),
    ] {
        let found = finding(&report, about);
        assert_eq!(found["level"], level, "{about}");
        assert!(found["remedy"].as_str().is_some_and(|r| r.len() > 10), "{about}");
    }
    assert_eq!(machine.run("doctor", &["--strict"]).status.code(), Some(1));
}

#[test]
fn installed_rules_are_recognised_and_changed_ones_too() {
    let machine = FakeMachine::new("rules");
    machine.write("proc/99/comm", "ModemManager\n");
    let rules = machine.run("doctor", &["--rules"]);
    machine.write("etc/udev/rules.d/60-gaitway.rules", &text(&rules));
    let report = machine.json("doctor");
    assert_eq!(finding(&report, "udev rules")["level"], "ok");
    assert_eq!(finding(&report, "ModemManager")["level"], "ok");
    machine.write("etc/udev/rules.d/60-gaitway.rules", "# an older one\n");
    assert_eq!(finding(&machine.json("doctor"), "udev rules")["level"], "advice");
}

#[test]
fn every_known_adapter_has_a_rule_and_the_file_comes_before_the_one_that_grants_access() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("udev");
    let rules = fs::read_to_string(folder.join("60-gaitway.rules")).expect("the rules");
    for adapter in gaitway_profiles::adapters().expect("the shipped adapters") {
        for id in &adapter.usb_ids {
            let (vendor, product) = id.split_once(':').expect("vvvv:pppp");
            let rule =
                format!("ATTRS{{idVendor}}==\"{vendor}\", ATTRS{{idProduct}}==\"{product}\"");
            assert!(rules.contains(&rule), "{}: no rule for {id}", adapter.name);
        }
    }
    for entry in fs::read_dir(&folder).expect("the folder").flatten() {
        let name = entry.file_name().into_string().expect("a name");
        let number: u32 = name.split('-').next().and_then(|n| n.parse().ok()).expect("a number");
        assert!(number < 73, "{name}: 73-seat-late.rules has run by then");
    }
}
