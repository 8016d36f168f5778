//! What a person types and what they read: help, refusals, files that exist.

mod program;

use serde_json::Value;
use std::fs::Permissions;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::Output;

fn run(arguments: &[&str]) -> Output {
    crate::program::gaitway().args(arguments).output().expect("the command")
}

fn stdout(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// Plays `motion` and returns the exit code and the reason it was refused for.
fn refusal(motion: &str, more: &[&str]) -> (Option<i32>, String) {
    let mut arguments = vec!["play", motion, "--robot", "op3", "--bus", "sim", "--json", "-q"];
    arguments.extend(more);
    let output = run(&arguments);
    let report: Value = serde_json::from_slice(&output.stdout).expect("a JSON report");
    assert_eq!(report["outcome"], "refused", "{report:#}");
    (output.status.code(), report["stop_reason"].as_str().expect("a reason").to_owned())
}

fn assert_words(text: &str, words: &[&str]) {
    for word in words {
        assert!(text.contains(word), "{word:?} is missing in:\n{text}");
    }
}

/// The commands that a help page lists.
fn listed(help: &str) -> Vec<&str> {
    let list = help.split("Commands:\n").nth(1).expect("a list of commands");
    let rows = list.lines().take_while(|line| line.starts_with("  "));
    let named =
        rows.filter(|row| !row.starts_with("   ")).filter_map(|row| row.split_whitespace().next());
    named.filter(|name| *name != "help").collect()
}

/// Fails unless the help of a command, and of each below it, shows how it is typed.
fn assert_taught(command: &[&str], seen: &mut usize) {
    let help = stdout(&run(&[command, &["--help"]].concat()));
    let typed = format!("gaitway {}", command.join(" "));
    if help.contains("\nCommands:\n") {
        for name in listed(&help) {
            assert_taught(&[command, &[name]].concat(), seen);
        }
        // One that does something by itself shows that too.
        assert_words(&help, &["Usage:"]);
    } else {
        assert_words(&help, &["Usage:", "Example", &typed, "--quiet"]);
    }
    *seen += 1;
}

#[test]
fn help_teaches_every_command_with_an_example() {
    let help = stdout(&run(&["--help"]));
    assert_words(&help, &["gaitway play walk", "gaitway simulate", "gaitway doctor"]);
    let mut seen = 0;
    for command in listed(&help) {
        assert_taught(&[command], &mut seen);
    }
    // Of these some are commands of `servo`, `profile` and others.
    assert!(seen >= 30, "{seen} commands");
}

/// A sentence of a help text is one line of its file: the terminal's width breaks it, and nothing before.
#[test]
fn no_help_text_breaks_a_sentence_by_itself() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/cli/help");
    let is_prose = |line: &str| {
        !line.is_empty()
            && !line.starts_with(' ')
            && !line.contains("  ")
            && !line.contains("gaitway ")
    };
    let mut files = 0;
    for entry in std::fs::read_dir(folder).expect("help texts") {
        let path = entry.expect("an entry").path();
        let text = std::fs::read_to_string(&path).expect("a help text");
        let lines: Vec<&str> = text.lines().collect();
        for pair in lines.windows(2) {
            let goes_on = is_prose(pair[0]) && is_prose(pair[1]) && !pair[0].ends_with('.');
            assert!(!goes_on, "{}: {:?} goes on with {:?}", path.display(), pair[0], pair[1]);
        }
        files += 1;
    }
    assert!(files > 30, "{files} help texts");
    let mut narrow = crate::program::gaitway();
    let narrow = narrow.args(["score", "splicing", "--help"]).env("COLUMNS", "60").output();
    let narrow = stdout(&narrow.expect("the command"));
    let prose = narrow.lines().filter(|line| !line.starts_with(' '));
    let longest = prose.map(str::len).max().expect("lines");
    assert!(longest <= 60, "a line of {longest}:\n{narrow}");
}

#[test]
fn the_shipped_walk_is_played_on_both_robots() {
    for robot in ["op3", "open-duck-mini-v2"] {
        let output = run(&["play", "walk", "--robot", robot, "--bus", "sim", "--json", "-q"]);
        let report: Value = serde_json::from_slice(&output.stdout).expect("a JSON report");
        assert_eq!(report["outcome"], "done", "{report:#}");
        assert_eq!(report["missed_cycles"], 0);
        assert_eq!(report["referee"]["violations"], serde_json::json!([]), "{robot}");
        assert!(report["retime_factor"].as_f64().expect("a factor") <= 5.0);
        assert_eq!(output.status.code(), Some(0));
        for key in ["cycle_hz", "wire_limit_hz", "bus_load", "duration_s", "min_voltage_v"] {
            assert!(report[key].as_f64().is_some_and(|v| v > 0.0), "{robot}: {key}");
        }
    }
}

#[test]
fn a_report_is_written_as_text_json_and_page() {
    let folder = crate::program::folder("report");
    let page = folder.join("walk.html");
    let json = folder.join("walk.json");
    let mut arguments = vec!["play", "walk", "--robot", "op3", "--bus", "sim", "--html"];
    arguments.extend([page.to_str().expect("UTF-8"), "--report", json.to_str().expect("UTF-8")]);
    let output = run(&arguments);
    let text = stdout(&output);
    assert_words(&text, &["done: walk on op3 over sim", "retimed", "r_knee", "no rule broken"]);
    let html = std::fs::read_to_string(&page).expect("a page");
    assert_words(&html, &["<html", "r_knee", "l_sho_pitch"]);
    let report = std::fs::read_to_string(&json).expect("a report");
    let report: Value = serde_json::from_str(&report).expect("JSON");
    assert_eq!(report["joints"].as_array().map(Vec::len), Some(20));
    // A second run must not overwrite what is there.
    let again = run(&arguments);
    assert_eq!(again.status.code(), Some(1));
    assert_words(&stdout(&again), &["refused", "exists already", "--force"]);
}

#[test]
fn a_dry_run_checks_everything_and_writes_nothing() {
    let output = run(&["play", "walk", "--robot", "op3", "--bus", "sim", "--dry-run", "--json"]);
    let report: Value = serde_json::from_slice(&output.stdout).expect("a JSON report");
    assert_eq!(report["outcome"], "done");
    assert_eq!(report["cycles"], 0);
    assert_eq!(report["dry_run"], true);
    assert!(report["joints"][0]["peak_velocity_rad_s"].as_f64().is_some_and(|v| v > 0.0));
}

#[test]
fn unusable_files_are_refused_with_line_and_remedy() {
    let folder = crate::program::folder("unusable");
    let file = |name: &str, text: &str| {
        let path = folder.join(name);
        std::fs::write(&path, text).expect("a file");
        path.to_str().expect("UTF-8").to_owned()
    };
    let walk = include_str!("../motions/walk.bvh");
    let cut = &walk[..walk.len() * 2 / 3];
    let (code, reason) = refusal(&file("cut.bvh", cut), &[]);
    assert_eq!(code, Some(1));
    assert_words(&reason, &["cut.bvh"]);
    let last_line = walk.trim_end().lines().last().expect("a line");
    let nan = walk.replace(last_line, &last_line.replacen(char::is_numeric, "nan ", 1));
    let (_, reason) = refusal(&file("nan.bvh", &nan), &[]);
    assert_words(&reason, &["nan.bvh"]);
    let (_, reason) = refusal(&file("empty.bvh", ""), &[]);
    assert_words(&reason, &["empty.bvh"]);
    let (_, reason) = refusal("no-such-file.bvh", &[]);
    assert_words(&reason, &["no-such-file.bvh"]);
    let (_, reason) = refusal("dance", &[]);
    assert_words(&reason, &["dance", "walk", ".bvh"]);
}

#[test]
fn unknown_joints_and_sections_are_refused_with_what_there_is() {
    let (_, reason) = refusal("walk", &["--only", "left_elbow"]);
    assert_words(&reason, &["left_elbow", "l_el", "--only"]);
    let (_, reason) = refusal("walk", &["--from", "5", "--to", "2"]);
    assert_words(&reason, &["5 to 2 s", "--from"]);
}

#[test]
fn numbers_out_of_range_are_usage_errors_that_name_the_range() {
    for (option, value, range) in [
        ("--rate", "0", "20 to 1000 Hz"),
        ("--rate", "-5", "20 to 1000 Hz"),
        ("--speed", "nan", "0.01 to 100"),
        ("--speed", "0", "0.01 to 100"),
        ("--loop", "0", "1 to 10000"),
    ] {
        let output = run(&["play", "walk", "--robot", "op3", "--bus", "sim", option, value]);
        assert_eq!(output.status.code(), Some(2), "{option} {value}");
        assert_words(&String::from_utf8_lossy(&output.stderr), &[option, range]);
    }
}

#[test]
fn outputs_that_cannot_be_written_are_refused_before_anything_moves() {
    let folder = crate::program::folder("outputs");
    let file = folder.join("one.html");
    let file = file.to_str().expect("UTF-8");
    for (more, words) in [
        (vec!["--html", "/no-such-folder/x.html"], "no such folder"),
        (vec!["--html", file, "--record", file], "same name"),
        (vec!["--record", folder.to_str().expect("UTF-8")], "a folder, not a file"),
    ] {
        let (_, reason) = refusal("walk", &more);
        assert_words(&reason, &[words]);
    }
    let closed = folder.join("closed");
    std::fs::create_dir(&closed).expect("a folder");
    std::fs::set_permissions(&closed, Permissions::from_mode(0o555)).expect("closed");
    if rustix::process::geteuid().is_root() {
        // Nothing is closed to root, unless the whole file system is.
        return;
    }
    let (_, reason) = refusal("walk", &["--html", closed.join("x").to_str().expect("UTF-8")]);
    assert_words(&reason, &["you may not write here", "closed"]);
}

#[test]
fn a_bus_too_many_is_refused() {
    let (_, reason) = refusal("walk", &["--bus", "serial:/dev/ttyUSB7"]);
    assert_words(&reason, &["more buses than the robot has lines for", "body"]);
}

#[test]
fn a_recording_is_described_and_a_cut_one_recovered() {
    let folder = crate::program::folder("recordings");
    let whole = folder.join("walk.mcap");
    let path = whole.to_str().expect("UTF-8");
    run(&["play", "walk", "--robot", "op3", "--bus", "sim", "-q", "--record", path]);
    let text = stdout(&run(&["info", path]));
    assert_words(&text, &["robot     op3", "motion    walk", "outcome   done", "complete"]);
    let bytes = std::fs::read(&whole).expect("a recording");
    let cut = folder.join("cut.mcap");
    std::fs::write(&cut, &bytes[..bytes.len() / 2]).expect("a file");
    let cut = cut.to_str().expect("UTF-8");
    assert_words(&stdout(&run(&["info", cut])), &["never closed"]);
    let recovered = run(&["recover", cut]);
    assert_eq!(recovered.status.code(), Some(3));
    let saved = stdout(&recovered);
    assert_words(&stdout(&run(&["info", saved.trim()])), &["robot     op3"]);
}

#[test]
fn a_motion_beyond_the_limits_is_refused_unless_it_may_be_slowed() {
    let (_, reason) = refusal("walk", &["--speed", "20", "--no-retime"]);
    assert_words(&reason, &["beyond", "joint"]);
    let (_, reason) = refusal("walk", &["--no-approach"]);
    assert_words(&reason, &["far from where the motion starts"]);
}

#[test]
fn an_unknown_robot_or_bus_is_refused_with_what_there_is() {
    let output = run(&["play", "walk", "--robot", "op4", "--bus", "sim", "--json", "-q"]);
    let report: Value = serde_json::from_slice(&output.stdout).expect("a JSON report");
    assert_words(report["stop_reason"].as_str().expect("a reason"), &["op4", "op3"]);
    let output = run(&["play", "walk", "--robot", "op3", "--bus", "usb:1"]);
    assert_eq!(output.status.code(), Some(2));
    assert_words(&String::from_utf8_lossy(&output.stderr), &["usb:1", "sim:pty"]);
}

#[test]
fn what_is_mistyped_is_told_by_its_part() {
    let folder = crate::program::folder("mistyped");
    let table = folder.join("semicolons.csv").display().to_string();
    std::fs::write(&table, "time_s;head_pan_rad\n0;0\n1;0,5\n").expect("a file");
    let sim = ["--robot", "op3", "--bus", "sim"];
    for (arguments, words) in [
        (&["play", "walk", "--robot", "OP3", "--bus", "sim"][..], &["did you mean op3?"][..]),
        (&[&["play", "WALK"][..], &sim].concat(), &["did you mean walk?"]),
        (&[&["play", "walk,,bow"][..], &sim].concat(), &["the motion", "nothing"]),
        (&[&["play", "walk:0s"][..], &sim].concat(), &["walk:0s", "at most 86400"]),
        (&[&["play", "walk", "--mapping", "x.toml"][..], &sim].concat(), &["needs no mapping"]),
        (&[&["play", &table][..], &sim].concat(), &["time_s;head_pan_rad", "by commas"]),
        (&["scan", "serial:/dev/ttyUSB0?bud=9600"], &["write ?baud=N"]),
        (&["scan", "serial:/dev/ttyUSB0?baud=abc"], &["write ?baud=N"]),
        (&["scan", "tcp:127.0.0.1"], &["tcp:HOST:PORT"]),
        (&["scan", "slcan:/dev/ttyACM0"], &["write can:slcan:/dev/ttyACM0"]),
        (&["scan", &format!("serial:{table}")], &["it is no terminal"]),
    ] {
        let output = run(arguments);
        assert!(!output.status.success(), "{arguments:?}");
        assert_words(&crate::program::words(&output), words);
    }
    // What is right is told nothing of.
    let right = crate::program::words(&run(&["scan", "serial:/nowhere?baud=9600"]));
    assert!(right.contains("no such port") && !right.contains("?baud=N"), "{right}");
}

#[test]
fn only_and_mirror_do_what_they_say() {
    let ranges = |more: &[&str]| -> Vec<(String, f64)> {
        let mut arguments = vec!["play", "walk", "--robot", "op3", "--bus", "sim", "--json", "-q"];
        arguments.extend(more);
        let report: Value = serde_json::from_slice(&run(&arguments).stdout).expect("a report");
        assert_eq!(report["outcome"], "done", "{report:#}");
        let joints = report["joints"].as_array().expect("joints").iter();
        let width = |j: &Value| {
            j["range_rad"][1].as_f64().expect("measured") - j["range_rad"][0].as_f64().expect("too")
        };
        joints.map(|j| (j["name"].as_str().expect("a name").to_owned(), width(j))).collect()
    };
    for (name, width) in ranges(&["--only", "r_knee,r_hip_pitch"]) {
        let moves = name == "r_knee" || name == "r_hip_pitch";
        assert_eq!(width > 0.05, moves, "{name} moved over {width} rad");
    }
    let (plain, mirrored) = (ranges(&[]), ranges(&["--mirror"]));
    let of = |ranges: &[(String, f64)], name: &str| {
        ranges.iter().find(|(n, _)| n == name).map(|(_, width)| *width).expect("a joint")
    };
    for (left, right) in [("l_knee", "r_knee"), ("l_sho_pitch", "r_sho_pitch")] {
        let off = (of(&plain, left) - of(&mirrored, right)).abs();
        assert!(off < 0.03, "{left} mirrored differs from {right} by {off} rad");
    }
}

#[test]
fn retarget_writes_a_table_that_starts_and_ends_at_rest() {
    let folder = crate::program::folder("retarget");
    let csv = folder.join("walk.csv");
    let output = run(&["retarget", "walk", "--robot", "op3", "-o", csv.to_str().expect("UTF-8")]);
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let table = std::fs::read_to_string(&csv).expect("a table");
    let mut lines = table.lines();
    let head = lines.next().expect("a head");
    assert!(head.starts_with("time_s,r_sho_pitch_rad"), "{head}");
    let rows: Vec<Vec<f64>> =
        lines.map(|l| l.split(',').map(|v| v.parse().expect("a number")).collect()).collect();
    assert!(rows.iter().all(|row| row.len() == 30 && row.iter().all(|v| v.is_finite())));
    let step = |a: &[f64], b: &[f64]| {
        a[1..21].iter().zip(&b[1..21]).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    };
    // Behind the joints: where the base is, turned by a rotation, and which feet stand.
    assert!(head.ends_with("base_qz,contact_left,contact_right"), "{head}");
    for row in &rows {
        let turn = row[24..28].iter().map(|part| part * part).sum::<f64>();
        assert!((turn - 1.0).abs() < 1e-6 && row[28..].iter().all(|is| *is == 0.0 || *is == 1.0));
    }
    // From rest, a joint gets 1/6 a_max/T_ramp t^3 far at most: micro-radians in 10 ms.
    assert!(step(&rows[0], &rows[1]) < 1e-3, "first step {}", step(&rows[0], &rows[1]));
    assert!(rows.windows(2).any(|pair| step(&pair[0], &pair[1]) > 1e-3), "nothing moves");
}

#[test]
fn profiles_are_listed_by_maker_and_protocol() {
    let list = stdout(&run(&["profile", "list"]));
    assert_words(&list, &["op3", "xm430-w350", "sts3215", "u2d2"]);
    let heading = |text: &str| list.find(text).unwrap_or_else(|| panic!("no {text:?} in {list}"));
    // Each servo stands under its maker and protocol.
    let (scs, sts) = (heading("FEETECH, FEETECH SCS"), heading("FEETECH, FEETECH STS"));
    let (one, two) = (heading("ROBOTIS, DYNAMIXEL Protocol 1.0"), heading("Protocol 2.0"));
    for (name, from, to) in
        [("  scs15 ", scs, sts), ("  sts3032 ", sts, one), ("  ax-12a ", one, two)]
    {
        assert!((from..to).contains(&heading(name)), "{name} in {list}");
    }
    assert!(heading("  xl320 ") > two);
}

#[test]
fn a_servo_is_shown_with_units_ranges_and_roles() {
    let shown = stdout(&run(&["profile", "show", "xm430-w350"]));
    assert_words(&shown, &["Goal Position", "116", "eeprom", "3 position", "Protocol 2.0"]);
    let row = |name: &str| {
        let mut rows = shown.lines().filter(|row| row.contains(name));
        rows.next().unwrap_or_else(|| panic!("no {name} in {shown}")).to_owned()
    };
    assert_words(&row("Current Limit"), &["0 to 1193", "current limit", "0.00269 A"]);
    assert_words(&row("Indirect Data 29 to 56"), &["634", "0 to 255", "indirect data"]);
    // A file written as another servo plus what differs is shown whole.
    let whole = stdout(&run(&["profile", "show", "xh430-w210"]));
    assert_words(&whole, &["model number 1010", "0 to 648", "Goal Position"]);
}

#[test]
fn robots_and_adapters_are_shown() {
    assert_words(&stdout(&run(&["profile", "show", "op3"])), &["r_knee", "assumed"]);
    let adapter = stdout(&run(&["profile", "show", "opencr"]));
    assert_words(&adapter, &["0483:5740", "does not hear its own bytes", "STM32"]);
}

#[test]
fn a_check_of_any_kind_of_profile_says_what_is_unconfirmed() {
    assert_words(&stdout(&run(&["profile", "check", "op3"])), &["OK", "20 joints"]);
    let servo = stdout(&run(&["profile", "check", "scs0009"]));
    assert_words(&servo, &["OK", "servo", "unconfirmed", "register Acceleration(41)"]);
    let adapter = stdout(&run(&["profile", "check", "openrb-150"]));
    assert_words(&adapter, &["OK", "2f5d:2202", "unconfirmed: 1"]);
    let folder = crate::program::folder("profile_servo");
    let file = folder.join("my-servo.toml");
    let path = file.to_str().expect("UTF-8");
    let extended = "extends = \"xl430-w250\"\nname = \"my-servo\"\nmodel = \"Mine\"\n";
    std::fs::write(&file, extended).expect("a file");
    assert_words(&stdout(&run(&["profile", "check", path])), &["my-servo: OK; servo"]);
}

#[test]
fn a_wrong_file_is_refused_with_what_where_got_and_allowed() {
    let folder = crate::program::folder("profile");
    let file = folder.join("my-robot.toml");
    let path = file.to_str().expect("UTF-8");
    let refusal = |text: &str| {
        std::fs::write(&file, text).expect("a file");
        let output = run(&["profile", "check", path]);
        assert_eq!(output.status.code(), Some(1));
        String::from_utf8_lossy(&output.stderr).into_owned()
    };
    let misspelt = "schema = 1\nname = \"my-robot\"\nvelocty = 3\n";
    assert_words(&refusal(misspelt), &["velocty"]);
    let no_base = "extends = \"xl431\"\nname = \"my-robot\"\n";
    assert_words(&refusal(no_base), &["extend", "where", "extends", "got", "xl431"]);
    let no_id = "schema = 1\nname = \"my-robot\"\nmodel = \"x\"\nusb_ids = [\"12\"]\n\
        echo = false\nlatency_s = 0.001\nsource = \"x\"\n";
    assert_words(&refusal(no_id), &["not a USB id", "got", "allowed", "vvvv:pppp"]);
    let output = run(&["profile", "check", "xm431"]);
    assert_words(&String::from_utf8_lossy(&output.stderr), &["no profile", "xm430-w350", "op3"]);
}

#[test]
fn a_shell_completes_every_command_and_man_has_a_page_for_each() {
    let bash = stdout(&run(&["completions", "bash"]));
    let main = stdout(&run(&["man"]));
    for command in ["play", "simulate", "servo", "record", "completions"] {
        assert!(bash.contains(&format!("gaitway__subcmd__{command}")), "{command}");
        assert!(main.contains(&format!("gaitway\\-{command}(1)")), "{command}: {main}");
    }
    assert!(bash.contains("--permit-eeprom"), "with its options");
    let page = stdout(&run(&["man", "servo", "set-id"]));
    assert!(page.starts_with(".ie") && page.contains("gaitway\\-servo\\-set\\-id"), "{page}");
    let refused = run(&["man", "servo", "dance"]);
    assert_eq!(refused.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&refused.stderr).contains("set-id"));
}
