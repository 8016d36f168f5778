//! `scan`, `servo`, `monitor`, `record` and `calibrate` as a user types them, on robots with CAN
//! lines whose actuators are virtual.

mod program;
#[path = "can_robot/robots.rs"]
#[allow(dead_code)]
mod robots;

use robots::{CUBEMARS, CUBEMARS_SERVO, DAMIAO, Kind, MOTEUS, ODRIVE, RECOIL, ROBSTRIDE};
use serde_json::Value;
use std::io::Write as _;
use std::path::PathBuf;
use std::process::{Output, Stdio};

/// The path of a robot file with three actuators of this kind on one line.
fn few(kind: Kind) -> String {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("commands-can").join(kind.servo);
    std::fs::create_dir_all(&folder).expect("a folder");
    let path = folder.join("few.toml");
    // Tests run side by side: whoever reads finds the whole file.
    let own = folder.join(format!("few-{:?}", std::thread::current().id()));
    std::fs::write(&own, robots::few(kind, 3, 100.0)).expect("a file");
    std::fs::rename(&own, &path).expect("renamed");
    path.display().to_string()
}

fn run(arguments: &[&str]) -> Output {
    crate::program::gaitway().args(arguments).output().expect("the command")
}

/// Runs with `--robot` of this kind behind the arguments.
fn on(kind: Kind, arguments: &[&str]) -> Output {
    run(&[arguments, &["--robot", &few(kind)]].concat())
}

fn text(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

fn json(output: &Output) -> Value {
    let said = String::from_utf8_lossy(&output.stderr);
    serde_json::from_slice(&output.stdout).unwrap_or_else(|e| panic!("{e}: {said}"))
}

fn refusal(output: &Output) -> String {
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1), "{said}{}", text(output));
    said
}

fn said(found: &str, words: &[&str]) {
    for word in words {
        assert!(found.contains(word), "{word} is missing in\n{found}");
    }
}

#[test]
fn a_scan_finds_every_actuator_and_says_what_it_asked() {
    for (kind, protocol, model) in [
        (DAMIAO, "damiao", Some("DM-J4310-2EC")),
        (ROBSTRIDE, "robstride", None),
        (ODRIVE, "odrive", Some("ODrive S1, firmware 0.6")),
        (MOTEUS, "moteus", None),
        (RECOIL, "recoil", None),
        (CUBEMARS_SERVO, "cubemars-servo", None),
    ] {
        let report = json(&on(kind, &["scan", "sim", "--json", "-q"]));
        let devices = report["devices"].as_array().expect("devices");
        let ids: Vec<u64> = devices.iter().filter_map(|of| of["id"].as_u64()).collect();
        assert_eq!(ids, [1, 2, 3], "{protocol}: {report:#}");
        for device in devices {
            assert_eq!(device["protocol"], protocol);
            assert_eq!(device["model"].as_str(), model);
            assert_ne!(device["torque_on"], true);
        }
        assert_eq!(report["collisions"], serde_json::json!([]));
        assert!(report["asked"].as_array().is_some_and(|asked| asked.len() > 1), "{report:#}");
    }
}

#[test]
fn a_scan_for_one_dialect_asks_in_no_other() {
    let report = json(&on(DAMIAO, &["scan", "sim", "--protocol", "damiao", "--json", "-q"]));
    assert_eq!(report["devices"][1]["answer_id"], 0x12, "{report:#}");
    let asked = report["asked"].to_string();
    assert!(asked.contains("damiao") && !asked.contains("moteus"), "{asked}");
    let output = on(DAMIAO, &["scan", "sim", "--protocol", "robstride", "-q"]);
    assert_eq!(output.status.code(), Some(1), "nobody of that kind is there");
    said(&text(&output), &["nobody is heard", "bit rate"]);
}

#[test]
fn who_answers_only_when_told_to_let_go_is_told_so_only_on_demand() {
    let quiet = on(CUBEMARS, &["scan", "sim", "-q"]);
    assert_eq!(quiet.status.code(), Some(1));
    said(&text(&quiet), &["not asked  cubemars-mit", "--let-go"]);
    // The option alone names no dialect: others on the line are spared.
    let spared = on(CUBEMARS, &["scan", "sim", "--protocol", "damiao", "--let-go", "-q"]);
    assert_eq!(spared.status.code(), Some(1));
    let told = on(CUBEMARS, &["scan", "sim", "--protocol", "cubemars-mit", "--let-go", "-q"]);
    assert!(told.status.success());
    said(&text(&told), &["3 devices", "TOLD TO LET GO"]);
}

#[test]
fn serial_protocols_and_speeds_have_no_place_on_a_can_line() {
    let refused = refusal(&on(DAMIAO, &["scan", "sim", "--protocol", "dynamixel-2.0"]));
    said(&refused, &["serial lines only", "robstride"]);
    said(&refusal(&on(DAMIAO, &["scan", "sim", "--baud", "all"])), &["ip link set"]);
    let refused = refusal(&run(&["scan", "sim", "--robot", "op3", "--protocol", "damiao"]));
    said(&refused, &["CAN lines only", "dynamixel-2.0"]);
    let baud = ["servo", "set-baud", "sim", "1", "500000", "--permit-eeprom"];
    said(&refusal(&on(DAMIAO, &baud)), &["not available on CAN lines", "ip link"]);
    said(&refusal(&on(DAMIAO, &["servo", "factory-reset", "sim", "1"])), &["maker's tool"]);
}

#[test]
fn a_setting_is_read_by_name_or_number_in_si() {
    said(&text(&on(DAMIAO, &["servo", "get", "sim", "1", "pmax"])), &["PMAX: 12.5 rad"]);
    let report = json(&on(DAMIAO, &["servo", "get", "sim", "2", "22", "--json"]));
    assert_eq!((&report["register"], &report["value_rad_s"]), (&"VMAX".into(), &30.0.into()));
    let report = json(&on(ROBSTRIDE, &["servo", "get", "sim", "3", "0x701C", "--json"]));
    assert_eq!((&report["register"], &report["value_v"]), (&"VBUS".into(), &24.0.into()));
    let report = json(&on(RECOIL, &["servo", "get", "sim", "1", "watchdog_timeout", "--json"]));
    // 1000 ms.
    assert_eq!((&report["raw"], &report["value_s"]), (&1000.into(), &1.0.into()));
    let whole = text(&on(MOTEUS, &["servo", "get", "sim", "1"]));
    said(&whole, &["position", "voltage", "0x0100  model_number"]);
    let refused = refusal(&on(ODRIVE, &["servo", "get", "sim", "1", "pos_gain"]));
    said(&refused, &["no such setting", "bus_voltage", "odrivetool"]);
    let refused = refusal(&on(CUBEMARS, &["servo", "get", "sim", "1", "kp"]));
    said(&refused, &["no settings on the line", "serial port"]);
}

#[test]
fn who_an_actuator_is_is_told_with_its_state() {
    let report = json(&on(ODRIVE, &["servo", "info", "sim", "2", "--json"]));
    assert_eq!(report["firmware"], "0.6.8");
    assert_eq!((&report["torque_on"], &report["faults"]), (&false.into(), &"none".into()));
    let told = text(&on(DAMIAO, &["servo", "info", "sim", "1"]));
    said(&told, &["DM-J4310-2EC, ID 1", "torque off", "CTRL_MODE"]);
    let refused = refusal(&on(DAMIAO, &["servo", "info", "sim", "9"]));
    said(&refused, &["no device answers", "ID 9"]);
    let other = ["servo", "info", "sim", "1", "--model", "rs02", "--protocol", "damiao"];
    said(&refusal(&on(DAMIAO, &other)), &["another protocol"]);
}

#[test]
fn a_setting_is_written_read_back_and_undone_by_the_printed_command() {
    let output = on(DAMIAO, &["servo", "set", "sim", "1", "TIMEOUT", "0.02", "--json"]);
    let report = json(&output);
    // Steps of 50 us.
    assert_eq!((&report["raw"], &report["raw_before"]), (&400.into(), &0.0.into()));
    assert_eq!(report["kept"], false);
    let remarks = String::from_utf8_lossy(&output.stderr).into_owned();
    said(&remarks, &["to undo: gaitway servo set sim 1 TIMEOUT --raw", "forgets this"]);
    let keep = ["servo", "set", "sim", "1", "OT_Value", "80", "--permit-eeprom", "--json"];
    assert_eq!(json(&on(DAMIAO, &keep))["kept"], true);
    let dry = ["servo", "set", "sim", "1", "limit_spd", "100deg/s", "--dry-run"];
    said(&refusal(&on(ROBSTRIDE, &dry)), &["not a value", "rad/s"]);
    let dry = ["servo", "set", "sim", "1", "limit_spd", "1.5", "--dry-run", "-q"];
    said(&text(&on(ROBSTRIDE, &dry)), &["limit_spd would become 1.5 rad/s"]);
    // Only what the actuator really kept is called so: an 8th mode is none.
    let refused = refusal(&on(DAMIAO, &["servo", "set", "sim", "1", "CTRL_MODE", "8"]));
    said(&refused, &["did not keep", "8"]);
}

#[test]
fn goals_torque_and_ids_are_no_settings() {
    for (kind, name, words) in [
        (ROBSTRIDE, "loc_ref", "servo move"),
        (ROBSTRIDE, "spd_ref", "servo move"),
        (ROBSTRIDE, "iq_ref", "servo move"),
        (MOTEUS, "command_position", "servo move"),
        (MOTEUS, "mode", "limp"),
        (RECOIL, "mode", "limp"),
        (DAMIAO, "ESC_ID", "set-id"),
        (DAMIAO, "MST_ID", "set-id"),
        (DAMIAO, "can_br", "ip link"),
    ] {
        for more in [&[][..], &["--raw", "--permit-eeprom"]] {
            let arguments = [&["servo", "set", "sim", "1", name, "1"], more].concat();
            said(&refusal(&on(kind, &arguments)), &[words]);
        }
    }
    let refused = refusal(&on(DAMIAO, &["servo", "set", "sim", "1", "p_m", "0"]));
    said(&refused, &["only be read"]);
}

#[test]
fn an_actuator_gets_another_id_and_is_looked_for_there() {
    for kind in [DAMIAO, ROBSTRIDE, RECOIL] {
        let set = |new: &'static str, more: &[&'static str]| {
            on(kind, &[&["servo", "set-id", "sim", "1", new], more].concat())
        };
        let report = json(&set("9", &["--permit-eeprom", "--json", "-q"]));
        assert_eq!((&report["id_before"], &report["id"]), (&1.into(), &9.into()));
        assert!(report["undo"].as_str().is_some_and(|undo| undo.contains("set-id sim 9 1")));
        said(&refusal(&set("9", &[])), &["--permit-eeprom"]);
        said(&refusal(&set("2", &["--permit-eeprom"])), &["taken"]);
    }
    for (kind, tool) in [(ODRIVE, "odrivetool"), (MOTEUS, "moteus_tool")] {
        let refused = on(kind, &["servo", "set-id", "sim", "1", "9", "--permit-eeprom"]);
        said(&refusal(&refused), &["keeps no ID", tool]);
    }
}

#[test]
fn an_odrive_is_restarted_and_others_cannot_be() {
    let output = on(ODRIVE, &["servo", "reboot", "sim", "1", "-q"]);
    assert!(output.status.success(), "{output:?}");
    said(&text(&output), &["is back"]);
    said(&refusal(&on(DAMIAO, &["servo", "reboot", "sim", "1"])), &["power off and on"]);
}

#[test]
fn an_actuator_is_moved_by_one_guarded_movement() {
    let gains = ["--kp", "40", "--kd", "1.5"];
    let timeout = ["--timeout", "0.2"];
    for (kind, more) in [
        (DAMIAO, &gains[..]),
        (ROBSTRIDE, &gains[..]),
        (CUBEMARS, &[&gains[..], &timeout[..]].concat()[..]),
        (ODRIVE, &[]),
        (MOTEUS, &[]),
        (RECOIL, &[]),
    ] {
        let go = [&["servo", "move", "sim", "2", "20", "--json", "-q"], more].concat();
        let report = json(&on(kind, &go));
        assert_eq!(report["outcome"], "done", "{}: {report:#}", kind.servo);
        let reached_deg = report["reached_rad"].as_f64().expect("an angle").to_degrees();
        assert!((reached_deg - 20.0).abs() < 2.0, "{}: {reached_deg}", kind.servo);
    }
}

#[test]
fn what_a_movement_needs_is_asked_for_in_words() {
    let bare = refusal(&on(DAMIAO, &["servo", "move", "sim", "1", "10"]));
    said(&bare, &["gains", "--kp"]);
    let gains = ["--kp", "40", "--kd", "1.5"];
    let go = |angle: &'static str| [&["servo", "move", "sim", "1", angle], &gains[..]].concat();
    said(&refusal(&on(CUBEMARS, &go("10"))), &["may go on pulling", "timeout"]);
    said(&refusal(&on(ODRIVE, &go("10"))), &["keeps its own gains"]);
    said(&refusal(&on(DAMIAO, &go("400"))), &["more than a turn away"]);
    let serial = ["servo", "move", "sim", "6", "8", "--robot", "so101", "--kp", "1", "--kd", "1"];
    said(&refusal(&run(&serial)), &["CAN actuators only"]);
}

#[test]
fn monitor_shows_those_too_that_answer_only_commands() {
    for kind in [DAMIAO, CUBEMARS, ROBSTRIDE, ODRIVE, MOTEUS, RECOIL, CUBEMARS_SERVO] {
        let output = run(&["monitor", &few(kind), "--bus", "sim", "--json"]);
        let reading = json(&output);
        for joint in reading["joints"].as_array().expect("joints") {
            assert!(joint["present_rad"].is_number(), "{}: {reading:#}", kind.servo);
        }
    }
}

fn record(kind: Kind, more: &[&str]) -> Output {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR"));
    let file = folder.join(format!("commands-can-{}.mcap", kind.servo)).display().to_string();
    let source = format!("servos:{}@sim:pty", few(kind));
    run(&[&["record", &source, "-o", &file, "--for", "500ms", "--force", "-q"], more].concat())
}

#[test]
fn actuators_are_recorded_without_a_word_that_changes_anything() {
    let output = record(DAMIAO, &["--json"]);
    let report = json(&output);
    assert_eq!(report["outcome"], "done", "{report:#}");
    said(&refusal(&record(CUBEMARS, &[])), &["answer nothing but commands", "--limp"]);
}

#[test]
fn a_limp_actuator_is_calibrated_by_hand() {
    let robot = few(DAMIAO);
    let mut command = crate::program::gaitway()
        .args(["calibrate", &robot, "--bus", "sim", "--dry-run", "--json"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the command");
    // The first joint's zero is taken; nobody turns it, so it is skipped, and then all is stopped.
    command.stdin.take().expect("a pipe").write_all(b"\ns\nq\n").expect("written");
    let output = command.wait_with_output().expect("ended");
    let words = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(4), "{words}");
    said(&words, &["[1/3]", "zero where the servo stands at", "[2/3]"]);
    let kept = ["calibrate", &robot, "--bus", "sim", "--dry-run", "--permit-eeprom"];
    said(&refusal(&run(&kept)), &["own zero is not set here"]);
}
