//! A virtual robot with weight: what it plays moves its body, and it stays up or falls.

mod program;

use program::{folder, gaitway, words};
use serde_json::Value;
use std::fs;
use std::io::Write;
use std::process::{Output, Stdio};

fn play(arguments: &[&str]) -> (Output, Value) {
    let output = gaitway()
        .args(["play", "--bus", "sim", "--json"])
        .args(arguments)
        .output()
        .expect("it runs");
    let report = serde_json::from_slice(&output.stdout).unwrap_or_else(|_| panic!("{output:?}"));
    (output, report)
}

#[test]
fn a_bow_keeps_its_feet_and_servos_report_the_weight_they_hold() {
    let (_, light) = play(&["bow", "--robot", "op3"]);
    let (output, heavy) = play(&["bow", "--robot", "op3", "--physics"]);
    assert_eq!(output.status.code(), Some(0), "{}", words(&output));
    assert!(light.get("fell_at_s").is_none(), "only with weight");
    assert!(heavy["fell_at_s"].is_null() && heavy.get("fell_at_s").is_some(), "{heavy}");
    let current = |report: &Value| report["max_current_a"].as_f64().expect("a current");
    // 3.1 kg over bent hips against the stand-in of a robot without weight.
    assert!(current(&heavy) > 2.0 * current(&light), "{} {}", current(&heavy), current(&light));
}

#[test]
fn what_is_predicted_to_fall_falls_when_it_is_predicted() {
    let (output, report) = play(&["kick-r", "--robot", "op3", "--physics", "--allow-fall"]);
    assert_eq!(output.status.code(), Some(0), "{}", words(&output));
    let predicted_s = report["metrics"]["predicted_fall_s"].as_f64();
    let fell_s = report["fell_at_s"].as_f64();
    assert!(predicted_s.is_some() && fell_s.is_some(), "{predicted_s:?} {fell_s:?}");
    let said = report["notes"].to_string();
    assert!(said.contains("fell at "), "{said}");
}

#[test]
fn a_robot_on_a_stand_does_not_fall_and_one_whose_torque_goes_does() {
    let (output, hung) = play(&["kick-r", "--robot", "op3", "--physics", "--hang"]);
    assert_eq!(output.status.code(), Some(0), "its legs reach no floor: {}", hung["stop_reason"]);
    assert!(hung["fell_at_s"].is_null() && hung.get("fell_at_s").is_some(), "{hung}");
    let (_, limp) = play(&["bow", "--robot", "op3", "--physics", "--end", "limp"]);
    let fell_s = limp["fell_at_s"].as_f64().expect("it falls");
    let lasted_s = limp["duration_s"].as_f64().expect("a time");
    assert!(fell_s > lasted_s - 0.1, "after its torque was off: {fell_s} {lasted_s}");
}

#[test]
fn arms_that_would_be_in_one_another_meet_press_and_are_named() {
    // Only as it was made one arm is in the other.
    let exact = ["box-r", "--robot", "op3", "--hang", "--no-retime", "--speed", "0.5"];
    let (_, light) = play(&exact);
    assert!(light.get("met").is_none(), "only with weight");
    let (_, apart) = play(&["wave-r", "--robot", "op3", "--hang", "--physics"]);
    assert_eq!(apart["met"], serde_json::json!([]), "nothing of a wave is in its way");
    let (_, heavy) = play(&[&exact[..], &["--physics"]].concat());
    let met = heavy["met"].as_array().expect("a list");
    let arms: Vec<&Value> =
        met.iter().filter(|of| of["links"].to_string().matches("_el").count() == 2).collect();
    assert_eq!(arms.len(), 1, "{met:?}");
    // Centimetres of a servo's error, at its gain, on the length of an arm.
    let force_n = arms[0]["peak_force_n"].as_f64().expect("a force");
    assert!((2.0..200.0).contains(&force_n), "{force_n} N");
    let said = heavy["notes"].to_string();
    assert!(said.contains("with weight, ") && said.contains(" met "), "{said}");
    // What would have gone through stops, and its servo reports that it does not get there.
    let off = |report: &Value| {
        let joints = report["joints"].as_array().expect("joints").iter();
        let arms = joints.filter(|joint| joint["name"].as_str().expect("a name").contains("_sho_"));
        arms.map(|joint| joint["tracking_rms_rad"].as_f64().expect("rad")).fold(0.0, f64::max)
    };
    assert!(off(&heavy) > 1.5 * off(&light), "{} {}", off(&heavy), off(&light));
}

#[test]
fn the_same_motion_ends_in_the_same_way() {
    let one = play(&["squat", "--robot", "op3", "--physics"]).1;
    let two = play(&["squat", "--robot", "op3", "--physics"]).1;
    assert_eq!(one["joints"], two["joints"]);
    assert_eq!(one["fell_at_s"], two["fell_at_s"]);
}

#[test]
fn what_has_no_weight_or_is_real_is_told_so() {
    let (output, report) =
        play(&["wave-r", "--robot", "so101", "--physics", "--only", "shoulder_pan"]);
    assert_eq!(output.status.code(), Some(1), "{report}");
    let folder = folder("physics-real");
    let path = folder.join("port").display().to_string();
    let output = gaitway()
        .args(["play", "bow", "--robot", "op3", "--physics", "--bus", &path])
        .output()
        .expect("it runs");
    assert_eq!(output.status.code(), Some(1));
    let bench = gaitway()
        .args(["simulate", "--servo", "xm430-w350:1", "--physics"])
        .output()
        .expect("it runs");
    assert_eq!(bench.status.code(), Some(1));
    let said = words(&bench);
    assert!(
        said.contains("a robot without a body has no weight") && said.contains("to do"),
        "{said}"
    );
}

/// What a robot with weight says over the control channel and on standard error while this is asked.
fn simulated(more: &[&str], requests: &str) -> (String, String) {
    let mut child = gaitway()
        .args(["simulate", "op3", "--physics", "--control", "stdin", "--no-referee"])
        .args(more)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("it runs");
    child.stdin.take().expect("piped").write_all(requests.as_bytes()).expect("it listens");
    let output = child.wait_with_output().expect("it ends");
    let text = |bytes| String::from_utf8(bytes).expect("text");
    (text(output.stdout), text(output.stderr))
}

#[test]
fn a_fall_is_an_event_and_all_times_are_of_one_clock() {
    let folder = folder("physics-told");
    let script = folder.join("faults.toml");
    fs::write(&script, "[[fault]]\nkind = \"overload\"\njoint = \"head_pan\"\nat_s = 0.5\n")
        .expect("a file");
    let robot = gaitway_profiles::robot("op3").expect("a robot");
    let torque = |on: u8| -> String {
        let set = |joint: &str| {
            format!(r#"{{"do":"set","joint":"{joint}","register":"Torque Enable","value":{on}}}"#)
        };
        robot.joints.iter().map(|joint| set(&joint.name) + "\n").collect()
    };
    let requests = format!(
        "{{\"do\":\"freeze\"}}\n{{\"do\":\"reset\"}}\n{}{{\"do\":\"step\",\"for_s\":1}}\n{}\
         {{\"do\":\"step\",\"for_s\":3}}\n{{\"do\":\"log\",\"kind\":\"fell\"}}\n",
        torque(1),
        torque(0),
    );
    let (told, said) = simulated(&["--faults", &script.display().to_string()], &requests);
    let log: Value = serde_json::from_str(told.lines().last().expect("replies")).expect("JSON");
    let entries = log["entries"].as_array().expect("entries");
    assert_eq!(entries.len(), 1, "{log}");
    let fall = &entries[0];
    let at_s = fall["at_s"].as_f64().expect("a time");
    // Torque went at 1 s, and nobody who is limp stands for longer than 1.5 s.
    assert!(fall["kind"] == "fell" && (1.1..2.5).contains(&at_s), "{fall}");
    let how = fall["on"].as_str().map_or("tilted".to_owned(), |on| format!("{on} on the floor"));
    assert!(said.contains(&format!("fell at {at_s:.6} s: {how}")), "{said}");
    assert!(said.contains("fault at 0.500000 s: overload, head_pan"), "{said}");
    assert!(said.contains("seconds of the virtual robot's clock"), "{said}");
}

/// The face of the library: the same switch.
#[test]
fn a_library_user_gives_weight_as_the_command_does() {
    use gaitway::job::open::open;
    use gaitway::job::play::Options;
    let mut robot = open("op3", "sim").expect("a virtual robot");
    let motion = robot.motion("bow").expect("a motion");
    let options = Options { physics: true, ..Options::default() };
    let report = robot.play(&motion, options).expect("it plays");
    let physics = report.physics.expect("weight");
    assert_eq!((physics.fell_at_s, physics.fell_on), (None, None));
}

/// How a standing OP3 fares under a fault script: when it fell, s since its torque was on.
fn under(script: &str) -> Option<f64> {
    use gaitway::job::weight;
    use gaitway_sim::{Options, Script, World};
    let robot = gaitway_profiles::robot("op3").expect("a robot");
    let script = Script::parse(script).expect("a script");
    let mut world = World::new(&robot, script.apply(Options::default())).expect("a world");
    let witness = weight::give(&mut world, &robot, false).expect("a body");
    for joint in &robot.joints {
        world.preset(&joint.name, "Torque Enable", 1).expect("a servo");
    }
    for step in 1..=600 {
        world.run_until(step * 10_000_000);
    }
    witness.fall().map(|fall| fall.at_s)
}

#[test]
fn a_robot_that_stands_bears_a_small_push_and_a_gentle_slope_and_falls_under_great_ones() {
    assert_eq!(under(""), None);
    // 3.1 kg: a tenth of its weight for a tenth of a second, then as much as its weight.
    let push = |force_n: f64, way: &str| {
        format!("[[fault]]\nkind = 'push'\n{way} = {force_n}\nfrom_s = 2\nuntil_s = 2.1\n")
    };
    for way in ["ahead_n", "left_n"] {
        for sign in [1.0, -1.0] {
            assert_eq!(under(&push(3.0 * sign, way)), None, "{way} {sign}");
            let fell_s = under(&push(45.0 * sign, way)).expect("it falls");
            assert!((2.0..3.5).contains(&fell_s), "{way} {sign}: {fell_s}");
        }
    }
    let slope = |ahead_rad: f64| {
        format!("[[fault]]\nkind = 'slope'\nahead_rad = {ahead_rad}\nfrom_s = 2\n")
    };
    assert_eq!(under(&slope(0.05)), None);
    let fell_s = under(&slope(0.6)).expect("it falls");
    assert!((2.0..4.0).contains(&fell_s), "{fell_s}");
}

#[test]
fn a_script_with_a_push_asks_for_weight() {
    let folder = folder("physics-push");
    std::fs::write(folder.join("push.toml"), "[[fault]]\nkind = 'push'\nahead_n = 5\n")
        .expect("a file");
    let arguments = ["simulate", "op3", "--pty", "port", "--faults", "push.toml"];
    let output = gaitway().current_dir(&folder).args(arguments).output().expect("it runs");
    assert_eq!(output.status.code(), Some(1), "{}", words(&output));
    assert!(words(&output).contains("add --physics"), "{}", words(&output));
}

#[test]
fn the_page_shows_where_the_weight_took_the_robot() {
    use gaitway::job::observer::Nobody;
    use gaitway::job::open::open;
    use gaitway::job::play::Options;
    let mut robot = open("op3", "sim").expect("a virtual robot");
    let motion = robot.motion("kick-r").expect("a motion");
    let options =
        Options { physics: true, allow_fall: true, keep_series: true, ..Options::default() };
    let played = robot.play_watched(&motion, options, &Nobody).expect("it plays");
    let scene = played.scene.expect("a scene");
    let fell = scene.spans.iter().find(|span| span.row == "fell").expect("a fall");
    // The report counts from when torque was on, which is a little before the first cycle.
    let told_s = played.report.physics.as_ref().and_then(|of| of.fell_at_s).expect("a fall");
    let late_s = told_s - fell.start_s;
    assert!((0.0..1.0).contains(&late_s), "{told_s} {fell:?}");
    let page = gaitway::job::page::page(&played.report, scene).expect("a page");
    assert!(page.contains("weight and servos took it"), "it says whose base it shows");
    assert!(page.contains("fell at "), "and that it fell");
}
