//! `calibrate` with the test as the person: it answers on standard input and turns the joints of a
//! virtual robot by hand. What comes out is compared with where the joints really are.

mod aloud;
mod desk;
mod priority;
mod program;

use desk::{Desk, json, run, text};
use serde_json::Value;
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStderr, Output, Stdio};
use std::time::{Duration, Instant};

/// `gaitway calibrate` under way.
struct Session<'a> {
    child: Child,
    said: BufReader<ChildStderr>,
    desk: &'a Desk,
    heard: String,
}

impl<'a> Session<'a> {
    fn start(desk: &'a Desk, config: &Path, robot: &str, more: &[&str]) -> Self {
        let mut child = crate::program::gaitway()
            .args(["calibrate", robot, "--bus", &desk.bus(), "--json"])
            .args(more)
            .env("XDG_CONFIG_HOME", config)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the command");
        let said = BufReader::new(child.stderr.take().expect("its words"));
        Self { child, said, desk, heard: String::new() }
    }

    /// Reads until a line that contains `word`.
    fn until(&mut self, word: &str) {
        loop {
            let mut line = String::new();
            let n = self.said.read_line(&mut line).expect("text");
            self.heard.push_str(&line);
            assert!(n > 0, "it ended before {word:?}:\n{}", self.heard);
            if line.contains(word) {
                return;
            }
        }
    }

    fn answer(&mut self, line: &str) {
        let stdin = self.child.stdin.as_mut().expect("its input");
        if writeln!(stdin, "{line}").is_err() {
            self.until("a word that does not come");
        }
    }

    fn place(&self, joint: &str, angle_rad: f64) {
        assert!(self.desk.world().place_joint(joint, angle_rad), "no joint {joint}");
    }

    /// Turns a joint by hand, slowly enough to be followed: a twentieth of a turn at a time.
    fn turn(&self, joint: &str, to_rad: f64) {
        let from_rad = self.desk.world().joint_position_rad(joint).expect("a joint");
        let steps = ((to_rad - from_rad).abs() / 0.3).ceil().max(1.0) as u32;
        for step in 1..=steps {
            self.place(joint, from_rad + (to_rad - from_rad) * f64::from(step) / f64::from(steps));
            self.until_looked_at(joint);
        }
    }

    /// Waits until the command has surely seen where the joint is now: the answer after the next
    /// is asked for when the next has been heard, or given up.
    fn until_looked_at(&self, joint: &str) {
        let statuses = || self.desk.world().statuses(joint).expect("a joint");
        let (enough, began) = (statuses() + 3, Instant::now());
        while statuses() < enough {
            assert!(began.elapsed() < Duration::from_secs(60), "{joint} is not looked at");
            std::thread::sleep(Duration::from_millis(2));
        }
    }

    /// One joint, zero to range; all angles in the virtual robot's own sense.
    fn joint(&mut self, joint: &str, zero: f64, positive: f64, ends: (f64, f64)) {
        self.until(joint);
        self.turn(joint, zero);
        self.answer("");
        self.until("positive direction");
        self.turn(joint, positive);
        self.answer("");
        self.until("whole range");
        self.turn(joint, ends.0);
        self.turn(joint, ends.1);
        self.answer("");
    }

    fn end(mut self) -> Output {
        drop(self.child.stdin.take());
        let mut rest = String::new();
        std::io::Read::read_to_string(&mut self.said, &mut rest).expect("text");
        self.heard.push_str(&rest);
        let mut output = self.child.wait_with_output().expect("its end");
        output.stderr = self.heard.into_bytes();
        output
    }
}

fn joint<'a>(report: &'a Value, name: &str) -> &'a Value {
    let joints = report["joints"].as_array().expect("joints");
    joints.iter().find(|joint| joint["name"] == name).unwrap_or_else(|| panic!("{report:#}"))
}

fn close(value: &Value, wanted: f64) {
    let got = value.as_f64().unwrap_or_else(|| panic!("{value} is no number"));
    assert!((got - wanted).abs() < 0.01, "{got} instead of {wanted}");
}

/// A joint whose horn sits 0.2 rad off and whose servo turns the other way: afterwards the robot
/// reads zero where the person said zero is.
#[test]
fn zero_direction_and_range_are_found_and_used_by_every_command() {
    let desk = Desk::with("so101");
    let config = crate::program::folder("all");
    let mut session = Session::start(&desk, &config, "so101", &["--only", "elbow_flex"]);
    session.joint("elbow_flex", 0.2, -0.4, (-0.8, 1.0));
    let output = session.end();
    let report = json(&output);
    assert_eq!(report["outcome"], "done", "{report:#}");
    let file = config.join("gaitway/calibration/so101.toml");
    assert_eq!(report["calibration"], file.to_str().expect("UTF-8"));
    let elbow = joint(&report, "elbow_flex");
    // In the calibrated sense the ends are at (0.2 - 1.0) and (0.2 + 0.8), 0.02 drawn in.
    close(&elbow["lower_rad"], 0.2 - 1.0 + 0.02);
    close(&elbow["upper_rad"], 0.2 + 0.8 - 0.02);
    // Read back another way: monitor, which loads the file by itself.
    desk.world().place_joint("elbow_flex", 0.2 - 0.5);
    let watch = crate::program::gaitway()
        .args(["monitor", "so101", "--bus", &desk.bus(), "--for", "0s", "--json"])
        .env("XDG_CONFIG_HOME", &config)
        .output()
        .expect("the command");
    close(&joint(&json(&watch), "elbow_flex")["present_rad"], 0.5);
    assert!(String::from_utf8_lossy(&watch.stderr).contains("so101.toml"), "the file is not named");
    // Nothing was written to a servo.
    assert_eq!(desk.violations(), Vec::<String>::new());
    assert_eq!(desk.world().register("elbow_flex", "Homing Offset"), Some(0));
}

/// Who has measured half of an arm is told that it is kept.
#[test]
fn a_servo_that_vanishes_ends_a_calibration_and_how_to_go_on_is_said() {
    let desk = Desk::with("so101");
    let config = crate::program::folder("vanished");
    let mut session = Session::start(&desk, &config, "so101", &["--only", "elbow_flex,gripper"]);
    session.joint("elbow_flex", 0.2, 0.6, (-0.8, 1.0));
    session.until("gripper");
    desk.world().unplug("gripper").expect("a joint");
    session.answer("");
    let output = session.end();
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1), "{told}");
    assert!(told.contains("to go on: the same command with --resume"), "{told}");
    assert!(config.join("gaitway/calibration/so101.toml.partial").exists(), "{told}");
}

/// An empty calibration would later be taken for one.
#[test]
fn a_calibration_in_which_every_joint_is_skipped_is_none() {
    let desk = Desk::with("so101");
    let config = crate::program::folder("skipped");
    let mut session = Session::start(&desk, &config, "so101", &["--only", "elbow_flex,gripper"]);
    for joint in ["elbow_flex", "gripper"] {
        session.until(joint);
        session.answer("s");
    }
    let output = session.end();
    assert_eq!(output.status.code(), Some(1), "{}", text(&output));
    assert!(String::from_utf8_lossy(&output.stderr).contains("no joint was measured"));
    let left = std::fs::read_dir(config.join("gaitway/calibration")).map(|found| found.count());
    assert_eq!(left.unwrap_or(0), 0, "something was written");
}

/// Other programs leave offsets in the servos. The zero that is measured goes with them, and play
/// takes the servo as it was then, and not when the offset has changed since.
#[test]
fn an_offset_that_was_in_the_servo_before_belongs_to_the_calibration() {
    let desk = Desk::with("so101");
    let config = crate::program::folder("offset");
    desk.world().set_register("elbow_flex", "Homing Offset", 100);
    let mut session = Session::start(&desk, &config, "so101", &["--only", "elbow_flex"]);
    session.joint("elbow_flex", 0.2, 0.6, (-0.8, 1.0));
    let report = json(&session.end());
    assert_eq!(joint(&report, "elbow_flex")["homing_offset_raw"], 100);
    let hold = || {
        crate::program::gaitway()
            .args(["hold", "so101", "--bus", &desk.bus(), "--dry-run"])
            .env("XDG_CONFIG_HOME", &config)
            .output()
            .expect("the command")
    };
    desk.world().place_joint("elbow_flex", 0.2);
    let ready = (0..20).map(|_| hold()).find(|output| output.status.success());
    assert!(ready.is_some(), "{}", String::from_utf8_lossy(&hold().stderr));
    desk.world().set_register("elbow_flex", "Homing Offset", 50);
    let said = String::from_utf8_lossy(&hold().stderr).into_owned();
    assert!(said.contains("Homing Offset") && said.contains("100 (raw)"), "{said}");
}

#[test]
fn a_dry_run_measures_and_writes_nothing() {
    let desk = Desk::with("so101");
    let config = crate::program::folder("dry");
    let mut session = Session::start(&desk, &config, "so101", &["--only", "gripper", "--dry-run"]);
    session.joint("gripper", 0.1, 0.4, (0.0, 0.9));
    let report = json(&session.end());
    assert_eq!((&report["outcome"], &report["dry_run"]), (&"done".into(), &true.into()));
    assert_eq!(joint(&report, "gripper")["direction"], {
        let file = gaitway_profiles::robot("so101").expect("a shipped robot");
        i64::from(file.joint("gripper").expect("a joint").direction)
    });
    assert_eq!(std::fs::read_dir(&config).expect("the folder").count(), 0, "something was written");
}

#[test]
fn a_stopped_calibration_goes_on_where_it_was() {
    let desk = Desk::with("so101");
    let config = crate::program::folder("resume");
    let only = ["--only", "wrist_roll,gripper"];
    let mut session = Session::start(&desk, &config, "so101", &only);
    session.joint("wrist_roll", 0.0, 0.3, (-0.5, 0.5));
    session.until("gripper");
    session.answer("q");
    let output = session.end();
    assert_eq!(output.status.code(), Some(4));
    assert_eq!(json(&output)["outcome"], "stopped");
    let folder = config.join("gaitway/calibration");
    assert!(folder.join("so101.toml.partial").exists());
    assert!(!folder.join("so101.toml").exists(), "half a calibration is none");
    // Beginning anew is refused as long as one is under way.
    let again = Session::start(&desk, &config, "so101", &only).end();
    assert!(String::from_utf8_lossy(&again.stderr).contains("--resume"));

    let mut session = Session::start(&desk, &config, "so101", &[&only[..], &["--resume"]].concat());
    session.until("[1/1]");
    session.joint("gripper", 0.1, 0.4, (0.0, 0.9));
    assert_eq!(json(&session.end())["outcome"], "done");
    let text = std::fs::read_to_string(folder.join("so101.toml")).expect("the calibration");
    assert!(text.contains("wrist_roll") && text.contains("gripper"), "{text}");
    assert!(!folder.join("so101.toml.partial").exists());
    // What is there is not replaced without being asked, and kept even then.
    let third = Session::start(&desk, &config, "so101", &only).end();
    assert!(String::from_utf8_lossy(&third.stderr).contains("--force"));
}

#[test]
fn a_joint_whose_encoder_begins_anew_is_followed_and_mended_in_the_servo_only_with_a_permit() {
    for robot_and_joint in [("so101", "wrist_roll"), ("op3", "head_pan")] {
        let (robot, name) = robot_and_joint;
        let file = gaitway_profiles::robot(robot).expect("a shipped robot");
        let direction = f64::from(file.joint(name).expect("a joint").direction);
        let desk = Desk::permitting(robot);
        let config = crate::program::folder(&format!("wrap-{robot}"));
        // The horn was mounted so that the joint's middle is near the end of the servo's turn. An
        // op3's servo can shift its reading by a quarter turn only, so there the end is nearer.
        let (zero, reach) = if robot == "op3" { (1.4, 2.2) } else { (2.6, 0.9) };
        let ends = (zero - 0.5, zero + reach);
        let only = ["--only", name];
        let mut session = Session::start(&desk, &config, robot, &only);
        session.joint(name, zero, zero + 0.3, ends);
        let refused = session.end();
        let said = String::from_utf8_lossy(&refused.stderr);
        assert!(said.contains("wrap around") && said.contains("--permit-eeprom"), "{said}");
        assert_eq!(desk.world().register(name, "Homing Offset"), Some(0), "{robot}");

        desk.world().place_joint(name, zero);
        let resumed = [&only[..], &["--resume", "--permit-eeprom"]].concat();
        let mut session = Session::start(&desk, &config, robot, &resumed);
        session.joint(name, zero, zero + 0.3, ends);
        let output = session.end();
        let report = json(&output);
        assert_eq!(report["outcome"], "done", "{}", String::from_utf8_lossy(&output.stderr));
        // Dynamixel adds its offset, Feetech subtracts it.
        let sense = if robot == "op3" { -1.0 } else { 1.0 };
        let wanted = sense * direction * zero * 4096.0 / core::f64::consts::TAU;
        let raw = desk.world().register(name, "Homing Offset").expect("a register");
        assert!((raw as f64 - wanted).abs() < 8.0, "{robot}: {raw} instead of {wanted}");
        // At the zero pose the servo now reads the middle of its travel.
        desk.world().place_joint(name, zero);
        let id = file.joint(name).expect("a joint").id.to_string();
        let get =
            ["servo", "get", &desk.bus(), &id, "present position", "--robot", robot, "--json"];
        let present = json(&run(&get))["raw"].as_i64().expect("a count");
        assert!((present - 2048).abs() < 8, "{robot}: {present}");
        let undo = report["undo"][0].as_str().expect("an undo command");
        desk::run_line(&format!("{undo} 2>&1"));
        assert_eq!(desk.world().register(name, "Homing Offset"), Some(0), "{robot}");
    }
}

#[test]
fn a_held_robot_is_not_let_go_without_a_yes() {
    let desk = Desk::with("so101");
    desk.world().set_register("gripper", "Torque Enable", 1);
    let config = crate::program::folder("held");
    let output = Session::start(&desk, &config, "so101", &["--only", "gripper"]).end();
    assert_eq!(output.status.code(), Some(1));
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(said.contains("--yes"), "{said}");
    assert_eq!(desk.world().register("gripper", "Torque Enable"), Some(1));
}

#[test]
fn play_names_the_calibration_it_used_and_refuses_another_robots() {
    let folder = crate::program::folder("play");
    let file = folder.join("mine.toml");
    let path = file.to_str().expect("UTF-8");
    let write = |robot: &str, joint: &str| {
        let text = format!(
            "schema = 1\nrobot = {robot:?}\n[[joint]]\nname = {joint:?}\ndirection = 1\n\
             offset_rad = 0.05\n"
        );
        std::fs::write(&file, text).expect("a file");
    };
    write("op3", "head_pan");
    let play = ["play", "walk", "--robot", "op3", "--bus", "sim", "--json", "-q", "--calibration"];
    let report = json(&run(&[&play[..], &[path]].concat()));
    assert_eq!((&report["outcome"], &report["calibration"]), (&"done".into(), &path.into()));
    for (robot, joint, word) in
        [("so101", "gripper", "another robot"), ("op3", "third_arm", "third_arm")]
    {
        write(robot, joint);
        let output = run(&[&play[..], &[path]].concat());
        let reason = json(&output)["stop_reason"].as_str().expect("a reason").to_owned();
        assert!(reason.contains(word), "{reason}");
        assert_eq!(output.status.code(), Some(1), "{}", text(&output));
    }
}

#[test]
fn what_is_measured_on_a_virtual_robot_is_never_kept_as_the_real_ones() {
    let config = crate::program::folder("virtual");
    let calibrate = |more: &[&str]| {
        crate::program::gaitway()
            .args(["calibrate", "so101", "--bus", "sim"])
            .args(more)
            .env("XDG_CONFIG_HOME", &config)
            .stdin(Stdio::null())
            .output()
            .expect("the command")
    };
    let refused = calibrate(&[]);
    assert_eq!(refused.status.code(), Some(1));
    let said = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert!(said.contains("--dry-run") && said.contains("--calibration"), "{said}");
    // Nobody answers: stopped, but begun.
    assert_eq!(calibrate(&["--dry-run"]).status.code(), Some(4));
    assert_eq!(std::fs::read_dir(&config).expect("the folder").count(), 0, "something was written");
}

#[test]
fn a_calibration_of_lerobot_is_carried_over_and_back_and_its_offsets_are_looked_for() {
    let folder = crate::program::folder("calibrate-lerobot");
    let path = |name: &str| folder.join(name).display().to_string();
    let (theirs, ours, back) = (path("theirs.json"), path("ours.toml"), path("back.json"));
    let motor = |id: u8, homing_offset: i64| {
        serde_json::json!({"id": id, "drive_mode": 0, "homing_offset": homing_offset,
                           "range_min": 800, "range_max": 3200})
    };
    let motors = serde_json::json!({"shoulder_pan": motor(1, -1365), "gripper": motor(6, 12)});
    std::fs::write(&theirs, motors.to_string()).expect("a file");
    let import = ["calibrate", "so101", "--from-lerobot", &theirs, "--calibration", &ours];
    let dry = run(&[&import[..], &["--dry-run", "--json"]].concat());
    assert_eq!(json(&dry)["dry_run"], true);
    assert!(!std::path::Path::new(&ours).exists(), "nothing is written");
    assert_eq!(run(&[&import[..], &["--only", "gripper"]].concat()).status.code(), Some(2));
    let done = run(&import);
    assert_eq!(done.status.code(), Some(0), "{}", String::from_utf8_lossy(&done.stderr));
    assert!(text(&done).contains("shoulder_pan") && text(&done).contains(&ours), "{}", text(&done));
    let again = run(&import);
    assert_eq!(again.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&again.stderr).contains("--force"));
    let export = ["calibrate", "so101", "--to-lerobot", &back, "--calibration", &ours, "--json"];
    let dry = run(&[&export[..], &["--dry-run"]].concat());
    assert_eq!((json(&dry)["dry_run"].clone(), dry.status.code()), (true.into(), Some(0)));
    assert!(!std::path::Path::new(&back).exists(), "nothing is written");
    let done = run(&export);
    assert_eq!(done.status.code(), Some(0), "{}", String::from_utf8_lossy(&done.stderr));
    assert_eq!(json(&done)["joints"].as_array().map(Vec::len), Some(2));
    let written = std::fs::read_to_string(&back).expect("written");
    assert_eq!(serde_json::from_str::<Value>(&written).expect("JSON"), motors);
    // The servos on the desk have other offsets: what was measured with those does not hold.
    let desk = Desk::with("so101");
    let bus = desk.bus();
    let refused = run(&["hold", "so101", "--bus", &bus, "--calibration", &ours]);
    let said = String::from_utf8_lossy(&refused.stderr).into_owned() + &text(&refused);
    assert_eq!(refused.status.code(), Some(1), "{said}");
    assert!(said.contains("-1365"), "{said}");
    // Neither a bus nor a file is no calibration.
    assert_eq!(run(&["calibrate", "so101"]).status.code(), Some(2));
}
