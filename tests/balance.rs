//! A virtual OP3 with weight that feels how its base tilts, and answers, or is told that it cannot.

mod aloud;
mod captured;
mod program;
mod python;

use aloud::aloud;
use program::{folder, gaitway, words};
use serde_json::Value;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

/// What a command says of a virtual robot, and its report.
fn told(command: &[&str], arguments: &[&str]) -> (Output, Value) {
    let output = gaitway()
        .args(command)
        .args(["--bus", "sim", "--json"])
        .args(arguments)
        .output()
        .expect("it runs");
    let report = serde_json::from_slice(&output.stdout).unwrap_or_else(|_| panic!("{output:?}"));
    (output, report)
}

fn play(arguments: &[&str]) -> (Output, Value) {
    told(&["play", "--robot", "op3"], arguments)
}

/// A script with one fault.
fn script(folder: &Path, text: &str) -> String {
    let path = folder.join("faults.toml");
    fs::write(&path, format!("[[fault]]\n{text}\n")).expect("a script");
    path.display().to_string()
}

fn figure(report: &Value, key: &str) -> f64 {
    report["balance"][key].as_f64().unwrap_or_else(|| panic!("no {key}: {}", report["balance"]))
}

#[test]
fn a_robot_that_balances_feels_every_cycle_keeps_every_rule_and_ends_at_rest() {
    let (output, report) = play(&["wave-r", "--physics", "--balance"]);
    assert_eq!(output.status.code(), Some(0), "{}", words(&output));
    assert!(report["fell_at_s"].is_null(), "{report}");
    assert_eq!(figure(&report, "missed_cycles"), 0.0);
    assert_eq!(figure(&report, "felt_cycles"), report["cycles"].as_f64().expect("cycles"));
    let (moved_rad, most_rad) = (figure(&report, "peak_correction_rad"), 0.15);
    assert!(moved_rad > 1e-3 && moved_rad <= most_rad, "{moved_rad}");
    let said = report["notes"].to_string();
    assert!(said.contains("balance: the base tilted by "), "{said}");
    // Rules of the referee: limits, steps, first and last two goals equal.
    assert_eq!(report["referee"]["violations"], Value::Array(Vec::new()));
    let (_, without) = play(&["wave-r", "--physics"]);
    assert!(without["balance"].is_null(), "only who asks for it");
}

#[test]
fn a_walk_on_a_floor_that_falls_aside_falls_and_stays_up_if_it_balances() {
    let folder = folder("balance-slope");
    let slope = script(&folder, "kind = 'slope'\nleft_rad = 0.06\nfrom_s = 1.2");
    let alone = play(&["walk", "--physics", "--faults", &slope]).1;
    assert!(alone["fell_at_s"].is_f64(), "{}", alone["notes"]);
    let (output, balanced) = play(&["walk", "--physics", "--faults", &slope, "--balance"]);
    assert_eq!(output.status.code(), Some(0), "{}", words(&output));
    assert!(balanced["fell_at_s"].is_null(), "{}", balanced["notes"]);
    assert!(figure(&balanced, "peak_tilt_rad") > 0.05, "it felt the slope");
}

#[test]
fn a_robot_that_is_thrown_over_is_named_and_lies_limp_as_its_file_says() {
    let folder = folder("balance-fall");
    let push = script(&folder, "kind = 'push'\nahead_n = 60\nfrom_s = 2\nuntil_s = 2.2");
    let (output, report) = play(&["wave-r", "--physics", "--balance", "--faults", &push]);
    assert_eq!(output.status.code(), Some(4), "{}", words(&output));
    assert_eq!(report["stop"]["code"], "fell");
    let tilt_rad = report["stop"]["got"].as_f64().expect("a tilt");
    assert!(tilt_rad > 60_f64.to_radians(), "{tilt_rad}");
    assert!(report["fell_at_s"].is_f64(), "the world saw it too");
    assert_eq!(report["left"]["limp"].as_array().expect("joints").len(), 20, "{}", report["left"]);
    // Without balance nobody feels it.
    let (_, unfelt) = play(&["wave-r", "--physics", "--faults", &push]);
    assert_ne!(unfelt["stop"]["code"], "fell");
}

#[test]
fn a_sensor_that_falls_silent_stops_the_motion_and_one_that_never_answered_is_refused() {
    let folder = folder("balance-silent");
    let silent =
        script(&folder, "kind = 'silent'\nline = 'body'\nid = 200\nfrom_s = 2\nuntil_s = 60");
    let (output, report) = play(&["wave-r", "--physics", "--balance", "--faults", &silent]);
    assert_eq!(output.status.code(), Some(4), "{}", words(&output));
    assert_eq!(report["stop"]["code"], "feels-nothing");
    assert!(report["fell_at_s"].is_null(), "{report}");
    assert_eq!(report["referee"]["violations"], Value::Array(Vec::new()));
    assert_eq!(play(&["wave-r", "--physics", "--faults", &silent]).0.status.code(), Some(0));
    let never =
        script(&folder, "kind = 'silent'\nline = 'body'\nid = 200\nfrom_s = 0\nuntil_s = 60");
    let (output, report) = play(&["wave-r", "--physics", "--balance", "--faults", &never]);
    assert_eq!(output.status.code(), Some(1), "{}", words(&output));
    let said = report["stop_reason"].as_str().expect("a reason").to_owned();
    assert!(
        said.contains("opencr-op3 in the base, ID 200") && said.contains("--balance"),
        "{said}"
    );
}

#[test]
fn another_device_at_the_sensors_id_is_refused() {
    let folder = folder("balance-other");
    let other = script(
        &folder,
        "kind = 'register'\nline = 'body'\nid = 200\nregister = 'Model Number'\nvalue = 1020",
    );
    let (output, report) = play(&["wave-r", "--physics", "--balance", "--faults", &other]);
    assert_eq!(output.status.code(), Some(1), "{}", words(&output));
    let said = report["stop_reason"].as_str().expect("a reason");
    assert!(said.contains("model 1020") && said.contains("model 29696"), "{said}");
}

#[test]
fn who_cannot_balance_is_told_why() {
    for (arguments, words) in [
        (["wave-r", "--balance", "--hang"].as_slice(), "--hang too"),
        (&["wave-r", "--balance", "--only", "head_pan"], "--only too"),
        (&["wave-r", "--balance", "--robot", "toddlerbot"], "[body.balance]"),
    ] {
        let mut command = gaitway();
        command.args(["play", "--bus", "sim", "--json"]);
        if !arguments.contains(&"--robot") {
            command.args(["--robot", "op3"]);
        }
        let output = command.args(arguments).output().expect("it runs");
        assert_eq!(output.status.code(), Some(1), "{output:?}");
        assert!(String::from_utf8_lossy(&output.stdout).contains(words), "{output:?}");
    }
}

#[test]
fn faults_befall_only_a_robot_of_this_process_and_a_script_sets_nothing_else() {
    let folder = folder("play-faults");
    let push = script(&folder, "kind = 'push'\nahead_n = 5\nfrom_s = 2\nuntil_s = 2.1");
    let (output, report) = play(&["wave-r", "--faults", &push]);
    assert_eq!(output.status.code(), Some(1), "{}", words(&output));
    assert!(report["stop_reason"].as_str().expect("a reason").contains("--physics"), "{report}");
    let seeded = folder.join("seeded.toml").display().to_string();
    fs::write(&seeded, "seed = 3\n").expect("a script");
    let (_, report) = play(&["wave-r", "--faults", &seeded]);
    let said = report["stop_reason"].as_str().expect("a reason");
    assert!(said.contains("seed") && said.contains("gaitway simulate"), "{said}");
    let real = folder.join("port").display().to_string();
    let output = gaitway()
        .args(["play", "wave-r", "--robot", "op3", "--faults", &push, "--bus", &real])
        .output()
        .expect("it runs");
    assert_eq!(output.status.code(), Some(1));
}

/// What a script of `tests/balance` writes of the program under test and OP3 in MuJoCo, row by row.
#[cfg(all(target_os = "linux", target_arch = "x86_64"))]
fn judged_by_mujoco(script: &str, arguments: &[&str]) -> Option<Vec<Value>> {
    let model = captured::captured("robots")?.join("robotis_op3/robotis_op3_lite.xml");
    let python = match python::python() {
        Ok(python) => python,
        Err(cause) => {
            aloud!("SKIPPED: nothing was judged: {cause}");
            return None;
        }
    };
    if Command::new("cc").arg("--version").output().is_err() {
        aloud!("SKIPPED: nothing was judged: no cc, which makes tests/balance/clock.c");
        return None;
    }
    let results = folder(&format!("{script}-in-mujoco")).join("results.jsonl");
    let run = Command::new(&python.program)
        .env("XDG_CONFIG_HOME", Path::new(env!("CARGO_TARGET_TMPDIR")).join("nobody"))
        .arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/balance").join(script))
        .arg(program::PATH)
        .args([&model, &results])
        .args(arguments)
        .output()
        .expect("Python");
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    let text = fs::read_to_string(&results).expect("results");
    let rows: Vec<Value> =
        text.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    for row in &rows {
        assert!(row["failed"].is_null(), "{row}");
        assert_eq!(row["damaged"], 0, "packets that another codec found damaged: {row}");
    }
    Some(rows)
}

/// The program as it is, on a serial line behind which a physics engine of others moves the robot, by servos and a codec that are
/// not ours. Time stands while anybody computes: however busy the machine is, these runs are the same.
#[cfg(all(target_os = "linux", target_arch = "x86_64"))]
#[test]
fn in_mujoco_too_a_walk_on_a_slope_falls_aside_unless_it_balances() {
    let Some(rows) = judged_by_mujoco("measure.py", &["check"]) else { return };
    let told = |row: &Value| {
        let job = &row["job"];
        let what = format!("{} {} {}", job[4].as_str()?, job[5].as_str()?, job[6]);
        Some((what, job[3].as_bool()?, row["fell_s"].as_f64()))
    };
    let rows: Vec<_> = rows.iter().map(|row| told(row).expect("a job")).collect();
    let fell_s = |what: &str, balances: bool| {
        let found = rows.iter().find(|row| row.0 == what && row.1 == balances);
        found.unwrap_or_else(|| panic!("no {what}: {rows:?}")).2
    };
    for what in ["nothing  0", "slope left 2", "slope right 2"] {
        assert_eq!((fell_s(what, false), fell_s(what, true)), (None, None), "{what}");
    }
    for what in ["slope left 6", "slope right 6"] {
        assert!(fell_s(what, false).is_some(), "{what}, without: {rows:?}");
        assert_eq!(fell_s(what, true), None, "{what}, with");
    }
    // The judge can see a fall of who balances.
    assert!(fell_s("slope left 14", true).is_some(), "{rows:?}");
}

/// Captures in which an OP3 whose goals are its poses falls there: it kicks, turns while it walks, and skips a rope.
#[cfg(all(target_os = "linux", target_arch = "x86_64"))]
const LIFTS_FEET: [&str; 4] = [
    "cmu_new2_frontkick001.bvh",
    "dataset-2_walk-turn-left_feminine_004.bvh",
    "dataset-2_walk-turn-right_feminine_004.bvh",
    "cmu_1006_jump_rope.bvh",
];

#[cfg(all(target_os = "linux", target_arch = "x86_64"))]
#[test]
fn in_mujoco_too_a_robot_that_follows_captures_as_they_come_lifts_feet_and_stays_up() {
    let Some(folder) = captured::captures() else { return };
    let files = captured::bvh_files(&folder);
    let is_one = |file: &&Path| LIFTS_FEET.iter().any(|name| file.ends_with(name));
    let motions: Vec<&str> =
        files.iter().map(|f| f.as_path()).filter(is_one).filter_map(Path::to_str).collect();
    if motions.len() < LIFTS_FEET.len() {
        aloud!(
            "SKIPPED: {} of {} captures are not there",
            LIFTS_FEET.len() - motions.len(),
            LIFTS_FEET.len()
        );
    }
    let Some(rows) = judged_by_mujoco("follow.py", &[&["{}"], motions.as_slice()].concat()) else {
        return;
    };
    assert_eq!(rows.len(), motions.len());
    for row in &rows {
        assert_eq!(row["outcome"], "done", "{row}");
        assert!(row["fell_s"].is_null(), "{row}");
        assert!(row["feet"]["lifted"].as_u64().is_some_and(|lifted| lifted > 0), "{row}");
    }
}

/// `live` of an OP3 with weight that follows somebody who waves.
fn live(arguments: &[&str]) -> (Output, Value) {
    told(&["live", "--from", "file:wave-r"], arguments)
}

#[test]
fn a_robot_that_follows_and_balances_feels_every_cycle_and_answers_within_its_limits() {
    let (output, report) = live(&["--robot", "op3", "--physics", "--balance"]);
    assert_eq!(output.status.code(), Some(0), "{}", words(&output));
    assert!(report["fell_at_s"].is_null(), "{report}");
    assert_eq!(figure(&report, "missed_cycles"), 0.0);
    assert_eq!(figure(&report, "felt_cycles"), report["cycles"].as_f64().expect("cycles"));
    let moved_rad = figure(&report, "peak_correction_rad");
    assert!(moved_rad > 1e-3 && moved_rad <= 0.15, "{moved_rad}");
    assert!(report["notes"].to_string().contains("balance: the base tilted by "), "{report}");
    assert_eq!(report["referee"]["violations"], Value::Array(Vec::new()));
    let (_, without) = live(&["--robot", "op3", "--physics"]);
    assert!(without["balance"].is_null(), "only who asks for it");
}

#[test]
fn a_robot_that_is_thrown_over_while_it_follows_is_named_and_lies_limp_as_its_file_says() {
    let folder = folder("balance-fall-live");
    let push = script(&folder, "kind = 'push'\nahead_n = 60\nfrom_s = 5\nuntil_s = 5.2");
    let thrown = ["--robot", "op3", "--physics", "--faults", &push];
    let (output, report) = live(&[thrown.as_slice(), &["--balance"]].concat());
    assert_eq!(output.status.code(), Some(4), "{}", words(&output));
    assert_eq!(report["stop"]["code"], "fell");
    assert!(report["fell_at_s"].is_f64(), "the world saw it too");
    assert_eq!(report["left"]["limp"].as_array().expect("joints").len(), 20, "{}", report["left"]);
    let (_, unfelt) = live(&thrown);
    assert!(unfelt["fell_at_s"].is_f64() && unfelt["stop"]["code"] != "fell", "{unfelt}");
}

#[test]
fn who_cannot_balance_while_it_follows_is_told_why() {
    for (arguments, words) in [
        (["--robot", "op3", "--balance", "--hang"].as_slice(), "--hang too"),
        (&["--robot", "toddlerbot", "--balance"], "[body.balance]"),
    ] {
        let (output, report) = live(arguments);
        assert_eq!(output.status.code(), Some(1), "{output:?}");
        assert!(report["stop_reason"].as_str().expect("a reason").contains(words), "{report}");
    }
}
