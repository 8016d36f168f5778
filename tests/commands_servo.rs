//! `scan`, `servo`, `hold`, `monitor` as a user types them, on virtual servos: what is set one way
//! is read back another way, past the command, in the servo's own registers.

mod aloud;
mod desk;
mod priority;
mod program;

use desk::{Desk, json, refusal, run, text};
use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;
use std::process::{Child, Output, Stdio};
use std::time::Duration;

#[test]
fn a_board_among_servos_is_no_servo_and_is_said_to_be_none() {
    for deed in [&["get", "sim", "200"][..], &["torque", "sim", "200", "off"]] {
        let mut arguments = vec!["servo"];
        arguments.extend(deed);
        arguments.extend(["--robot", "op3"]);
        let said = refusal(&run(&arguments));
        assert!(said.contains("no servo") && said.contains("OpenCR"), "{said}");
        assert!(said.contains("list boards") && !said.contains("--servo"), "{said}");
    }
}

#[test]
fn a_scan_finds_every_servo_of_the_robot_and_writes_nothing() {
    // OP3's base has a board with a sensor among its servos.
    let board = Some((200, "OpenCR with the OP3 firmware"));
    for (robot, model, protocol, ids, board) in [
        ("op3", "XM430-W350", "dynamixel-2.0", 1..=20, board),
        ("so101", "STS3215", "feetech-sts", 1..=6, None),
        ("op2", "MX-28", "dynamixel-1.0", 1..=20, None),
    ] {
        let report = json(&run(&["scan", "sim", "--robot", robot, "--json", "-q"]));
        let devices = report["devices"].as_array().expect("devices");
        let found: Vec<u64> = devices.iter().filter_map(|d| d["id"].as_u64()).collect();
        let expected: Vec<u64> = ids.chain(board.map(|(id, _)| id)).collect();
        assert_eq!(found, expected, "{robot}");
        for device in devices {
            let of_board = board.filter(|(id, _)| device["id"] == *id).map(|(_, model)| model);
            assert_eq!(device["model"], of_board.unwrap_or(model));
            assert_eq!(device["protocol"], protocol);
        }
        assert_eq!(report["collisions"], serde_json::json!([]));
    }
    let table = text(&run(&["scan", "sim", "--robot", "op3", "-q"]));
    let columns: Vec<Option<usize>> = table
        .lines()
        .take(22)
        .map(|row| row.find("dynamixel-2.0").or(row.find("protocol")))
        .collect();
    assert_eq!(columns, vec![columns[0]; 22], "{table}");
    let desk = Desk::with("so101");
    let before = desk.registers("gripper");
    run(&["scan", &desk.bus(), "--robot", "so101"]);
    assert_eq!(desk.registers("gripper"), before);
    assert_eq!(desk.violations(), Vec::<String>::new());
}

#[test]
fn a_robot_behind_a_tcp_port_is_scanned_held_and_moved_like_one_on_a_cable() {
    let desk = Desk::with("so101");
    let (bus, door) = desk.over_tcp();
    let report = json(&run(&["scan", &bus, "--robot", "so101", "--json", "-q"]));
    assert_eq!(report["devices"].as_array().map(Vec::len), Some(6), "{report:#}");
    let go = ["servo", "move", &bus, "6", "8", "--robot", "so101", "--json", "-q"];
    let moved = json(&desk::run_until_done(&go, |output| output.status.success()));
    assert_eq!(moved["outcome"], "done", "{moved:#}");
    let raw = desk.world().register("gripper", "Present Position").expect("a register");
    // 8 degrees are 91 counts past the middle.
    assert!((raw - 2048 - 91).abs() < 20, "{raw}");
    let said = refusal(&run(&["scan", &bus, "--robot", "so101", "--baud", "57600"]));
    assert!(said.contains("the other end"), "{said}");
    drop(door);
    let said = refusal(&run(&["scan", &bus, "--robot", "so101"]));
    assert!(said.contains("the connection is not accepted"), "{said}");
}

#[test]
fn a_slip_of_the_finger_is_answered_with_what_is_allowed() {
    let so101 = ["--robot", "so101"];
    let gripper = |words: &[&str]| run(&[&["servo"], words, &so101[..]].concat());
    let said = refusal(&gripper(&["get", "sim", "6", "present temprature"]));
    assert!(said.contains("Present Temperature"), "{said}");
    let eeprom = ["set", "sim", "6", "Max Temperature Limit", "7000", "--permit-eeprom"];
    let said = refusal(&gripper(&eeprom));
    // A limit is allowed up to what the maker's table says, in the unit it was asked in.
    assert!(said.contains("allowed") && said.contains("degC"), "{said}");
    let output = gripper(&["move", "sim", "6", "NaN"]);
    assert_eq!(output.status.code(), Some(2), "an angle that is no angle never reaches the line");
    let said = text(&run(&["scan", "sim", "--robot", "so101", "--protocol", "dynamixel-2.0"]));
    assert!(said.contains("at 1000000 bit/s") && said.contains("--baud all"), "{said}");
}

#[test]
fn two_servos_with_one_id_are_named() {
    let desk = Desk::with("so101");
    assert!(desk.world().duplicate("gripper", 0.5));
    let output = run(&["scan", &desk.bus(), "--robot", "so101", "--json", "-q"]);
    let report = json(&output);
    assert_eq!(report["collisions"][0]["id"], 6, "{report:#}");
    let output = run(&["scan", &desk.bus(), "--robot", "so101", "-q"]);
    assert!(text(&output).contains("TWO DEVICES WITH THIS ID"), "{}", text(&output));
}

#[test]
fn nobody_on_the_line_is_exit_code_1_with_advice() {
    let output = run(&["scan", "sim", "--robot", "op3", "--baud", "57600", "-q"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(text(&output).contains("--baud all"), "{}", text(&output));
}

#[test]
fn a_scan_at_all_speeds_finds_a_servo_that_was_left_at_another() {
    let output = run(&["scan", "sim", "--robot", "so101", "--baud", "all", "--json", "-q"]);
    let report = json(&output);
    assert!(report["scanned_baud_bps"].as_array().is_some_and(|s| s.len() > 8), "{report:#}");
    // Each is found once, at its own speed.
    assert_eq!(report["devices"].as_array().map(Vec::len), Some(6), "{report:#}");
    assert_eq!(report["devices"][0]["baud_bps"], 1_000_000);
}

#[test]
fn a_virtual_bus_needs_a_robot_and_says_so() {
    let said = refusal(&run(&["scan", "sim"]));
    assert!(said.contains("--robot op3"), "{said}");
}

#[test]
fn a_register_is_read_by_name_in_si_and_degrees() {
    let desk = Desk::with("op3");
    // 3072 counts are 90 degrees past the middle.
    desk.world().set_register("head_pan", "Present Position", 3072);
    let get = ["servo", "get", &desk.bus(), "19", "present_position", "--robot", "op3"];
    let said = text(&run(&get));
    assert!(said.contains("1.570796 rad") && said.contains("90.00 deg"), "{said}");
    let report = json(&run(&[&get[..], &["--json"]].concat()));
    assert_eq!(report["raw"], 3072);
    assert!(
        (report["value_rad"].as_f64().expect("rad") - core::f64::consts::FRAC_PI_2).abs() < 1e-9
    );
}

#[test]
fn a_ram_register_is_set_read_back_and_undone_by_the_printed_command() {
    let desk = Desk::with("op3");
    let bus = desk.bus();
    let before = desk.world().register("head_pan", "Position P Gain");
    let set = ["servo", "set", &bus, "19", "Position P Gain", "640", "--robot", "op3", "--json"];
    let report = json(&run(&set));
    assert_eq!(desk.world().register("head_pan", "Position P Gain"), Some(640));
    assert_eq!(report["raw_before"].as_i64(), before);
    let undo = report["undo"].as_str().expect("an undo command").to_owned();
    desk::run_line(&undo);
    assert_eq!(desk.world().register("head_pan", "Position P Gain"), before);
}

#[test]
fn what_is_kept_at_power_off_needs_a_permit_and_goes_through_the_lock() {
    let desk = Desk::permitting("so101");
    let bus = desk.bus();
    let set = ["servo", "set", &bus, "6", "max_temperature_limit", "60", "--robot", "so101"];
    let said = refusal(&run(&set));
    assert!(said.contains("--permit-eeprom"), "{said}");
    assert_ne!(desk.world().register("gripper", "Max Temperature Limit"), Some(60));
    let done = run(&[&set[..], &["--permit-eeprom"]].concat());
    assert_eq!(done.status.code(), Some(0), "{}", text(&done));
    assert_eq!(desk.world().register("gripper", "Max Temperature Limit"), Some(60));
    assert_eq!(desk.world().register("gripper", "Lock"), Some(1));
    // It is kept: the lock was open while it was written.
    desk.power_cycle();
    assert_eq!(desk.world().register("gripper", "Max Temperature Limit"), Some(60));
}

#[test]
fn nothing_that_is_kept_is_written_while_torque_is_on() {
    let desk = Desk::permitting("op3");
    desk.world().set_register("head_pan", "Torque Enable", 1);
    let bus = desk.bus();
    for command in [
        vec!["servo", "set", &bus, "19", "temperature_limit", "60"],
        vec!["servo", "set-id", &bus, "19", "99"],
        vec!["servo", "set-baud", &bus, "19", "1000000"],
        vec!["servo", "factory-reset", &bus, "19"],
    ] {
        let said = refusal(&run(&[&command[..], &["--robot", "op3", "--permit-eeprom"]].concat()));
        assert!(said.contains("torque is on") && said.contains("limp"), "{said}");
    }
    assert_eq!(desk.world().register("head_pan", "ID"), Some(19));
}

#[test]
fn goals_and_torque_are_refused_with_the_command_that_does_it() {
    let desk = Desk::with("op3");
    let bus = desk.bus();
    for (register, value, word) in [
        ("goal position", "0", "servo move"),
        ("Goal_Velocity", "1", "servo move"),
        ("goal current", "0.1", "servo move"),
        ("goal pwm", "0.1", "servo move"),
        ("indirect data 1", "1", "servo move"),
        ("Torque Enable", "1", "servo torque"),
        ("id", "5", "set-id"),
        ("baud_rate", "3", "set-baud"),
        ("present position", "0", "only be read"),
    ] {
        let set =
            ["servo", "set", &bus, "19", register, value, "--robot", "op3", "--permit-eeprom"];
        let said = refusal(&run(&set));
        assert!(said.contains(word), "{register}: {said}");
    }
    assert_eq!(desk.world().register("head_pan", "Torque Enable"), Some(0));
}

#[test]
fn values_that_do_not_fit_are_refused_with_what_is_allowed() {
    let desk = Desk::with("op3");
    let bus = desk.bus();
    for (register, value) in
        [("Position P Gain", "20000"), ("Position P Gain", "many"), ("profile_velocity", "NaN")]
    {
        let said = refusal(&run(&["servo", "set", &bus, "19", register, value, "--robot", "op3"]));
        assert!(said.contains("allowed"), "{register} {value}: {said}");
    }
    let said = refusal(&run(&["servo", "get", &bus, "19", "warp factor", "--robot", "op3"]));
    assert!(said.contains("no such register") && said.contains("profile show"), "{said}");
}

#[test]
fn an_id_is_changed_found_again_and_never_given_twice() {
    for (robot, joint, id) in [("op3", "head_pan", "19"), ("so101", "gripper", "6")] {
        let desk = Desk::permitting(robot);
        let bus = desk.bus();
        let more = ["--robot", robot, "--permit-eeprom"];
        let taken = refusal(&run(&[&["servo", "set-id", &bus, id, "2"][..], &more].concat()));
        assert!(taken.contains("taken"), "{taken}");
        let done = run(&[&["servo", "set-id", &bus, id, "77"][..], &more].concat());
        assert_eq!(done.status.code(), Some(0), "{}", text(&done));
        assert_eq!(desk.world().register(joint, "ID"), Some(77));
        let info = json(&run(&["servo", "info", &bus, "77", "--robot", robot, "--json"]));
        assert_eq!(info["id"], 77);
        let gone = refusal(&run(&["servo", "info", &bus, id, "--robot", robot]));
        assert!(gone.contains("no device answers") && gone.contains("gaitway scan"), "{gone}");
        desk.power_cycle();
        assert_eq!(desk.world().register(joint, "ID"), Some(77), "{robot}: not kept");
    }
}

#[test]
fn a_line_speed_is_changed_and_found_at_the_new_one() {
    let desk = Desk::permitting("so101");
    let bus = desk.bus();
    let set = ["servo", "set-baud", &bus, "6", "500000", "--robot", "so101", "--permit-eeprom"];
    let report = json(&run(&[&set[..], &["--json"]].concat()));
    assert_eq!(report["baud_bps"], 500_000);
    let faster = format!("{bus}?baud=500000");
    assert_eq!(json(&run(&["servo", "info", &faster, "6", "--json"]))["id"], 6);
    let undo = report["undo"].as_str().expect("an undo command").to_owned();
    desk::run_line(&undo);
    assert_eq!(json(&run(&["servo", "info", &bus, "6", "--robot", "so101", "--json"]))["id"], 6);
    let odd = ["servo", "set-baud", &bus, "6", "123456", "--robot", "so101", "--permit-eeprom"];
    let said = refusal(&run(&odd));
    assert!(said.contains("1000000"), "{said}");
}

#[test]
fn a_reboot_clears_the_error_and_asks_before_it_lets_go() {
    let desk = Desk::with("op3");
    let bus = desk.bus();
    desk.world().set_register("head_pan", "Torque Enable", 1);
    let reboot = ["servo", "reboot", &bus, "19", "--robot", "op3"];
    let said = refusal(&run(&reboot));
    assert!(said.contains("--yes"), "{said}");
    assert_eq!(desk.world().register("head_pan", "Torque Enable"), Some(1));
    let report = json(&run(&[&reboot[..], &["--yes", "--json"]].concat()));
    assert_eq!(report["torque_on"], false);
    assert_eq!(desk.world().register("head_pan", "Torque Enable"), Some(0));
    let feetech = refusal(&run(&["servo", "reboot", "sim", "6", "--robot", "so101"]));
    assert!(feetech.contains("power off and on"), "{feetech}");
}

#[test]
fn a_factory_reset_says_what_it_does_and_keeps_id_and_speed() {
    let desk = Desk::permitting("op3");
    let bus = desk.bus();
    desk.world().set_register("head_pan", "Temperature Limit", 42);
    let reset = ["servo", "factory-reset", &bus, "19", "--robot", "op3"];
    let said = refusal(&run(&reset));
    assert!(said.contains("ID 19") && said.contains("--permit-eeprom"), "{said}");
    assert_eq!(desk.world().register("head_pan", "Temperature Limit"), Some(42));
    let done = run(&[&reset[..], &["--permit-eeprom"]].concat());
    assert_eq!(done.status.code(), Some(0), "{}", text(&done));
    // 80 degrees Celsius leave the factory (XM430-W350 e-Manual, Temperature Limit(31)).
    assert_eq!(desk.world().register("head_pan", "Temperature Limit"), Some(80));
    assert_eq!(desk.world().register("head_pan", "ID"), Some(19));
}

#[test]
fn one_servo_is_moved_through_the_guard_and_the_referee_agrees() {
    for (robot, id, angle) in [("op3", "19", "20"), ("so101", "5", "-12.5")] {
        let output = run(&["servo", "move", "sim", id, angle, "--robot", robot, "--json", "-q"]);
        let report = json(&output);
        assert_eq!(report["outcome"], "done", "{report:#}");
        let wanted_rad = angle.parse::<f64>().expect("a number").to_radians();
        let reached = report["reached_rad"].as_f64().expect("an angle");
        assert!((reached - wanted_rad).abs() < 0.03, "{report:#}");
        let peak = report["peak_velocity_rad_s"].as_f64().expect("a speed");
        assert!(peak <= 30_f64.to_radians() + 1e-9, "{report:#}");
    }
}

#[test]
fn a_gripper_without_position_mode_is_moved_in_the_mode_it_has() {
    let (desk, joint) = Desk::of_servo("rh-p12-rn");
    let bus = format!("{}?baud=57600", desk.bus());
    let is_done = |output: &Output| output.status.success();
    let go = ["servo", "move", &bus, "1", "40", "--json", "-q"];
    let report = json(&desk::run_until_done(&go, is_done));
    assert_eq!(report["outcome"], "done", "{report:#}");
    let reached = report["reached_rad"].as_f64().expect("an angle");
    assert!((reached - 40_f64.to_radians()).abs() < 0.03, "{report:#}");
    // It is closed at 1150 counts of 4096 to a turn: no goal leads further.
    let far = run(&["servo", "move", &bus, "1", "120", "--json", "-q"]);
    let said = String::from_utf8_lossy(&far.stderr).into_owned();
    assert!(!far.status.success() && said.contains("101.0"), "{said}");
    let off = json(&run(&["servo", "torque", &bus, "1", "off", "--json", "-q"]));
    assert_eq!(off["torque_on"], false);
    let on =
        json(&desk::run_until_done(&["servo", "torque", &bus, "1", "on", "--json", "-q"], is_done));
    assert_eq!(on["outcome"], "done");
    assert_eq!(desk.world().register(&joint, "Torque Enable"), Some(1));
    assert_eq!(desk.violations(), Vec::<String>::new());
    // In current mode it is refused, and the line that is printed puts it right.
    desk.world().set_register(&joint, "Torque Enable", 0);
    desk.world().set_register(&joint, "Operating Mode", 0);
    let refused = run(&["servo", "move", &bus, "1", "40"]);
    let said = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert!(said.contains("CurrentBasedPosition"), "{said}");
    let line =
        said.lines().find_map(|line| line.split_once("gaitway servo set")).expect("a remedy");
    let line = format!("gaitway servo set{}", line.1).replace("BUS", &format!("'{bus}'"));
    desk::run_line(&line);
    assert_eq!(desk.world().register(&joint, "Operating Mode"), Some(5));
}

#[test]
fn torque_of_one_servo_comes_on_where_it_stands_and_goes_off_again() {
    for (robot, id, joint) in [("so101", "5", "wrist_roll"), ("op3", "19", "head_pan")] {
        let desk = Desk::with(robot);
        let bus = desk.bus();
        // A goal of long ago, a quarter turn away: torque that came on with it would run there.
        desk.world().set_register(joint, "Goal Position", 1024);
        let before = desk.world().joint_position_rad(joint).expect("a joint");
        let torque = |state: &str| {
            let go = ["servo", "torque", &bus, id, state, "--robot", robot, "--json", "-q"];
            json(&desk::run_until_done(&go, |output| output.status.success()))
        };
        assert_eq!(torque("on")["outcome"], "done");
        let read = |name: &str| desk.world().register(joint, name).expect("a register");
        assert_eq!(read("Torque Enable"), 1);
        let (goal, present) = (read("Goal Position"), read("Present Position"));
        assert!((goal - present).abs() <= 12, "{robot}: {goal}, {present}");
        let after = desk.world().joint_position_rad(joint).expect("a joint");
        assert!((after - before).abs() < 0.02, "{robot}: it moved from {before} to {after}");
        assert_eq!(torque("off")["torque_on"], false);
        assert_eq!(desk.world().register(joint, "Torque Enable"), Some(0));
        assert_eq!(desk.violations(), Vec::<String>::new(), "{robot}");
    }
}

/// OP3's head is turned by `servo move --limp`, and something done to it under way; what came of it.
fn disturbed_under_way(desk: &Desk, disturb: impl Fn(&Child)) -> Output {
    const ATTEMPTS: u32 = 20;
    let bus = desk.bus();
    let is_moving = || {
        let world = desk.world();
        let turned_rad = world.joint_position_rad("head_pan").expect("a joint").abs();
        world.register("head_pan", "Torque Enable") == Some(1) && turned_rad > 0.1
    };
    for attempt in 1..=ATTEMPTS {
        let mut command = crate::program::gaitway();
        command.args(["servo", "move", &bus, "19", "60", "--robot", "op3", "--limp", "--json"]);
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = command.spawn().expect("a run");
        while child.try_wait().expect("a process").is_none() {
            if is_moving() {
                disturb(&child);
                return child.wait_with_output().expect("an end");
            }
            std::thread::sleep(Duration::from_millis(2));
        }
        // A machine that stalls may not have let it begin.
        let output = child.wait_with_output().expect("an end");
        let said = String::from_utf8_lossy(&output.stderr);
        aloud::aloud!("DISTURBED by the machine {attempt} times before it moved: {said}");
    }
    panic!("it never moved");
}

#[test]
fn a_move_that_was_stopped_is_not_followed_by_limp() {
    let desk = Desk::with("op3");
    let torque = || desk.world().register("head_pan", "Torque Enable");
    let bus = desk.bus();
    let go = ["servo", "move", &bus, "19", "3", "--robot", "op3", "--limp", "--json", "-q"];
    let done = json(&desk::run_until_done(&go, |output| output.status.success()));
    assert_eq!((&done["outcome"], torque()), (&"done".into(), Some(0)), "{done:#}");
    let output = disturbed_under_way(&desk, |child| {
        kill_process(Pid::from_child(child), Signal::INT).expect("a signal");
    });
    let report = json(&output);
    // A machine that stalls may have stopped it before; nobody goes limp after that either.
    assert_eq!(report["outcome"], "stopped", "{report:#}");
    assert_eq!(report["left"]["holding"].as_array().map(Vec::len), Some(1), "{report:#}");
    assert_eq!(torque(), Some(1));
    let turned_rad = desk.world().joint_position_rad("head_pan").expect("a joint");
    assert!((0.05..1.0).contains(&turned_rad), "it was under way: {turned_rad} rad");
}

#[test]
fn a_servo_that_falls_silent_in_a_move_is_told_with_its_watchdog() {
    let desk = Desk::with("op3");
    let output = disturbed_under_way(&desk, |_| desk.world().unplug("head_pan").expect("a joint"));
    let (report, said) = (json(&output), String::from_utf8_lossy(&output.stderr));
    assert_eq!(report["outcome"], "stopped", "{report:#}");
    let words = "bus watchdog may still be on";
    assert!(report["notes"].to_string().contains(words), "{report:#}");
    assert!(said.contains(words), "{said}");
}

#[test]
fn a_dry_run_of_a_move_says_the_way_and_moves_nothing() {
    let desk = Desk::with("op3");
    let bus = desk.bus();
    let before = desk.registers("head_pan");
    let dry = ["servo", "move", &bus, "19", "15", "--robot", "op3", "--dry-run", "-q"];
    let output = desk::run_until_done(&dry, |output| output.status.success());
    assert!(text(&output).contains("nothing was written"), "{}", text(&output));
    assert_eq!(desk.registers("head_pan"), before);
    let far = refusal(&run(&["servo", "move", &bus, "19", "400", "--robot", "op3"]));
    assert!(far.contains("400") || far.contains("outside"), "{far}");
    assert_eq!(desk.world().register("head_pan", "Torque Enable"), Some(0));
}

/// One reading of so101 in which all joints but `silent` answered: on a machine that stalls for
/// longer than a question may take, they may seem not to.
fn monitored(bus: &str, silent: &[&str]) -> Value {
    let read = |output: &std::process::Output| {
        let reading = json(output);
        let joints = reading["joints"].as_array().expect("joints").clone();
        let there = |joint: &Value| joint["error"].is_null();
        let excused = |joint: &Value| silent.iter().any(|name| joint["name"] == *name);
        joints.iter().all(|joint| there(joint) || excused(joint))
    };
    let monitor = ["monitor", "so101", "--bus", bus, "--for", "0s", "--json"];
    json(&desk::run_until_done(&monitor, read))
}

#[test]
fn hold_switches_torque_on_where_the_robot_stands_and_monitor_sees_it() {
    let desk = Desk::with("so101");
    let bus = desk.bus();
    let watch = || monitored(&bus, &[]);
    let before = desk.world().joint_position_rad("elbow_flex").expect("a joint");
    assert_eq!(watch()["joints"][2]["torque_on"], false);
    let dry = ["hold", "so101", "--bus", &bus, "--dry-run", "-q"];
    let dry = desk::run_until_done(&dry, |output| output.status.success());
    assert!(text(&dry).contains("would be held"), "{}", text(&dry));
    assert_eq!(desk.world().register("elbow_flex", "Torque Enable"), Some(0));
    let hold = ["hold", "so101", "--bus", &bus, "--json", "-q"];
    let held = json(&desk::run_until_done(&hold, |output| output.status.success()));
    assert_eq!(held["outcome"], "done");
    let seen = watch();
    for joint in seen["joints"].as_array().expect("joints") {
        assert_eq!(joint["torque_on"], true, "{joint}");
        let (goal, is) = (joint["goal_rad"].as_f64(), joint["present_rad"].as_f64());
        let off = goal.expect("a goal") - is.expect("a position");
        assert!(off.abs() < 0.02, "{joint}");
    }
    let after = desk.world().joint_position_rad("elbow_flex").expect("a joint");
    assert!((after - before).abs() < 0.02, "it moved from {before} to {after}");
    let said = refusal(&run(&["limp", "so101", "--bus", &bus]));
    assert!(said.contains("--yes"), "{said}");
    assert_eq!(desk.world().register("elbow_flex", "Torque Enable"), Some(1));
    assert_eq!(json(&run(&["limp", "so101", "--bus", &bus, "--yes", "--json"]))["outcome"], "done");
    assert_eq!(watch()["joints"][2]["torque_on"], false);
    assert_eq!(desk.violations(), Vec::<String>::new());
}

#[test]
fn monitor_names_a_silent_joint_and_goes_on_with_the_others() {
    let desk = Desk::with("so101");
    desk.world().unplug("wrist_flex").expect("a joint");
    let reading = monitored(&desk.bus(), &["wrist_flex"]);
    for joint in reading["joints"].as_array().expect("joints") {
        let silent = joint["name"] == "wrist_flex";
        assert_eq!(joint["present_rad"].is_null(), silent, "{joint}");
        assert_eq!(joint["error"].as_str() == Some("no answer"), silent, "{joint}");
    }
}

#[test]
fn monitor_prints_a_plain_table_where_nobody_watches() {
    let output = run(&["monitor", "op3", "--bus", "sim", "--for", "500ms"]);
    let said = text(&output);
    assert!(!said.contains('\x1b'), "escape codes in a pipe");
    // At 4 Hz: at 0, 0.25 and 0.5 s.
    assert_eq!(said.matches("goal deg").count(), 3, "{said}");
    assert!(said.contains("head_tilt") && said.contains("deg C"), "{said}");
}

#[test]
fn doctor_measures_the_round_trip_of_a_line() {
    let output = run(&["doctor", "--bus", "sim", "--robot", "op3", "--json"]);
    let report = json(&output);
    let findings = report["findings"].as_array().expect("findings");
    let trip = findings.iter().find(|f| f["about"] == "round trip on sim").expect("the round trip");
    assert_eq!(trip["level"], "ok");
    let found = trip["found"].as_str().expect("words");
    // Ping 10 and status 14 bytes at 2 Mbit/s are 0.12 ms; the return delay is 2 us.
    assert!(found.contains("200 of 200") && found.contains("median 0.12 ms"), "{found}");
}

#[test]
fn a_dynamixel_is_never_locked_since_only_its_power_could_open_it_again() {
    let desk = Desk::permitting("op2");
    let (name, id) = ("r_knee", "13");
    let limit = ["servo", "set", &desk.bus(), id, "Temperature Limit", "--robot", "op2"];
    for celsius in ["70", "75"] {
        let output = run(&[&limit[..], &[celsius, "--permit-eeprom", "-q"]].concat());
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    }
    assert_eq!(desk.world().register(name, "Lock"), Some(0));
    // One that somebody locked is left as it is, and that is said.
    desk.world().set_register(name, "Lock", 1);
    let said = refusal(&run(&[&limit[..], &["72", "--permit-eeprom"]].concat()));
    assert!(said.contains("locked") && said.contains("power off and on"), "{said}");
}

#[test]
fn a_servo_that_answers_reads_only_is_told_to_answer_everything() {
    let desk = Desk::with("op3");
    desk.world().set_register("r_knee", "Status Return Level", 1);
    let level = ["servo", "set", &desk.bus(), "13", "Status Return Level", "2", "--robot", "op3"];
    let output = run(&level);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert_eq!(desk.world().register("r_knee", "Status Return Level"), Some(2));
    assert_eq!(desk.violations(), Vec::<String>::new());
}
