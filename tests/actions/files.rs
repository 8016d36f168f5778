//! Action files: what is accepted, and that every refusal names line, degree of freedom and rule.

use gaitway::action::{Action, file, vocabulary};
use gaitway::body::Dof;

const NOD: &str = r#"schema = 1
name = "nod"
note = "A nod"
duration_s = 1.0

[shapes]
quick = [0, 3, 2, 1, 0]

[[group]]
name = "trunk"
kind = "limb"
turns.neck_flexion = [[0.4, 20, 0.3], [0.6, 20], [1.0, 0, "minimum-jerk"]]
turns.torso_flexion = [[0.5, 5, "quick"], [1.0, 0]]
"#;

const SWAY: &str = r#"schema = 1
name = "sway"
cyclic = true
duration_s = 2.0
rounds = 3

[[group]]
name = "left arm"
kind = "limb"
turns.left_shoulder_flexion = [[0.0, -20], [0.5, 20]]
turns.left_elbow_flexion = [[0.1, 10], [0.6, 30]]

[[group]]
name = "right arm"
kind = "limb"
mirrors = "left arm"
phase = 0.5
"#;

fn parse(text: &str) -> Result<Action, gaitway::error::Error> {
    file::parse(text, "nod.toml", &vocabulary::lender)
}

fn refused(text: &str, words: &[&str]) {
    let error = parse(text).expect_err(text).to_string();
    for word in words {
        assert!(error.contains(word), "{word:?} is not in:\n{error}");
    }
}

#[test]
fn the_examples_of_these_tests_are_accepted() {
    let nod = parse(NOD).unwrap().perform().unwrap();
    assert!((nod.duration_s() - 1.0).abs() < 1e-12);
    let at = |time_s| nod.at(Dof::NeckFlexion, time_s).position_rad.to_degrees();
    assert!((at(0.5) - 20.0).abs() < 1e-9 && at(1.0).abs() < 1e-9);
    let sway = parse(SWAY).unwrap().perform().unwrap();
    assert!((sway.duration_s() - 6.0).abs() < 1e-12);
}

#[test]
fn refusals_name_line_degree_of_freedom_and_rule() {
    for (from, to, words) in [
        (
            "[0.4, 20, 0.3]",
            "[0.4, 60, 0.3]",
            &["line 12", "neck_flexion", "60 deg", "-45 to 45"][..],
        ),
        ("[0.4, 20, 0.3]", "[0.4, 20, 0.95]", &["line 12", "neck_flexion", "0.95", "0.1 to 0.9"]),
        ("[0.4, 20, 0.3]", "[0.4]", &["line 12", "neck_flexion", "when it ends"]),
        ("[0.6, 20]", "[0.3, 20]", &["line 12", "neck_flexion", "order of time"]),
        ("[1.0, 0, \"min", "[1.2, 0, \"min", &["line 12", "neck_flexion", "1.2", "0 to 1"]),
        ("\"quick\"]", "\"quack\"]", &["line 13", "torso_flexion", "quack", "[shapes]"]),
        ("[0, 3, 2, 1, 0]", "[0, 3, 0, 1, 0]", &["line 7", "shape quick", "sample 3 of 5"]),
        ("torso_flexion", "knee_flexion", &["line 13", "knee_flexion", "left_knee_flexion"]),
        ("torso_flexion", "left_knee_flexion", &["line 9", "group trunk", "connected"]),
        ("kind = \"limb\"", "kind = \"joint\"", &["line 9", "group trunk", "one joint"]),
        ("kind = \"limb\"", "kind = \"arm\"", &["line 11", "arm"]),
        ("schema = 1", "schema = 2", &["line 1", "schema = 1"]),
        ("name = \"nod\"", "name = \"A nod\"", &["line 2", "hyphens"]),
        ("duration_s = 1.0", "duration_s = 0.0", &["line 4", "0.01 to 86400 s"]),
        ("duration_s = 1.0", "duration = 1.0", &["line 4", "duration"]),
        ("duration_s = 1.0", "", &["duration_s"]),
        ("note = ", "rounds = 3\nnote = ", &["line 3", "cyclic"]),
        ("note = ", "flights = [[0.5, 0.2]]\nnote = ", &["line 3", "flight"]),
        ("note = ", "phases = [[1.5, \"late\"]]\nnote = ", &["phase late", "1.5"]),
        ("kind = \"limb\"", "kind = \"limb\"\nphase = 0.5", &["group trunk", "cyclic"]),
        ("kind = \"limb\"", "kind = \"limb\"\nmirrors = \"x\"", &["group trunk", "exactly one"]),
        ("[shapes]", "[start]\nafter = 0.5\n[shapes]", &["start and stop"]),
        ("[shapes]", "[pose]\nleft_knee_flexion = 200\n[shapes]", &["line 7", "left_knee_flexion"]),
    ] {
        assert!(NOD.contains(from), "{from}");
        refused(&NOD.replace(from, to), words);
    }
}

#[test]
fn refusals_of_cycles_name_the_rule() {
    for (from, to, words) in [
        ("[[0.0, -20], [0.5, 20]]", "[[0.0, -20]]", &["left_shoulder_flexion", "two turning"][..]),
        ("[[0.0, -20], [0.5, 20]]", "[[0.0, -20], [1.0, 20]]", &["two turning", "below 1"]),
        ("phase = 0.5", "rate = [0, 1]", &["right arm", "whole numbers"]),
        ("phase = 0.5", "phase = nan", &["right arm", "finite"]),
        ("\"left arm\"\nphase", "\"left leg\"\nphase", &["right arm", "before it"]),
        ("name = \"right arm\"", "name = \"left arm\"", &["same name"]),
        ("rounds = 3", "rounds = 0", &["line 5", "at least one"]),
        ("rounds = 3", "rounds = 3\nstart = { phase = 1.5 }", &["start.phase", "1.5"]),
        ("rounds = 3", "rounds = 3\nstop = { before = 0 }", &["stop.before"]),
        (
            "rounds = 3",
            "rounds = 3\nstart.turns.left_elbow_flexion = [[0.9, 5]]",
            &["left_elbow_flexion", "start.after"],
        ),
    ] {
        assert!(SWAY.contains(from), "{from}");
        refused(&SWAY.replace(from, to), words);
    }
    let twice = SWAY.replace("mirrors = \"left arm\"", "from = \"walk/left arm\"");
    refused(&twice, &["left arm and in group right arm", "driven twice", "left_shoulder_flexion"]);
    refused(&SWAY.replace("mirrors = \"left arm\"", "from = \"walk/tail\""), &["walk/tail"]);
}

#[test]
fn groups_are_taken_from_other_actions() {
    let text = SWAY.replace("mirrors = \"left arm\"", "from = \"walk/right leg\"");
    let text = text.replace("name = \"right arm\"", "name = \"leg\"");
    let action = parse(&text).unwrap();
    let walk = vocabulary::find("walk").unwrap();
    let waveform = |action: &Action, dof: Dof| {
        let track = *action.tracks().find(|track| track.dof == dof).unwrap();
        action.waveforms[track.waveform].clone()
    };
    let dof = Dof::RightKneeFlexion;
    assert_eq!(waveform(&action, dof), waveform(&walk, dof));
}

#[test]
fn a_mirrored_action_has_nothing_of_its_own() {
    let mirrored = "schema = 1\nname = \"box-x\"\nmirror_of = \"box-l\"\n";
    assert_eq!(parse(mirrored).unwrap().name, "box-x");
    refused(&format!("{mirrored}duration_s = 2.0\n"), &["line 3", "nothing of its own"]);
    refused(&mirrored.replace("box-l", "box-q"), &["line 3", "box-q"]);
    // What others lean on leans on none: no file can go round in circles.
    refused(&mirrored.replace("box-l", "box-r"), &["line 3", "box-r"]);
}

#[test]
fn any_cut_of_a_file_is_refused_or_accepted_but_never_more() {
    let walk = vocabulary::text("walk").unwrap();
    for text in [NOD, SWAY, walk] {
        for end in (0..text.len()).filter(|end| text.is_char_boundary(*end)) {
            let _ = parse(&text[..end]);
        }
    }
}

/// Every key the reader takes is in the schema for editors, and the other way round.
#[test]
fn the_schema_for_editors_has_the_keys_of_the_reader() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("actions");
    let text = std::fs::read_to_string(folder.join("schema.json")).unwrap();
    let schema: serde_json::Value = serde_json::from_str(&text).unwrap();
    let keys = |path: &str| -> Vec<String> {
        schema.pointer(path).unwrap().as_object().unwrap().keys().cloned().collect()
    };
    // The reader lists what it takes when it meets a key it does not know.
    let listed = |text: &str| {
        let error = parse(text).unwrap_err().to_string();
        let list = error.split("the keys here are ").nth(1).unwrap_or_else(|| panic!("{error}"));
        let names = list.lines().next().unwrap().split(", ").map(str::to_owned);
        names.collect::<Vec<String>>()
    };
    let same = |mut a: Vec<String>, mut b: Vec<String>| {
        a.sort();
        b.sort();
        assert_eq!(a, b);
    };
    same(keys("/properties"), listed("what = 1\n"));
    same(keys("/$defs/group/properties"), listed("[[group]]\nwhat = 1\n"));
    same(keys("/properties/start/properties"), listed("[start]\nwhat = 1\n"));
    same(keys("/$defs/turns/properties"), Dof::ALL.map(|dof| dof.name().to_owned()).to_vec());
    same(keys("/properties/pose/properties"), Dof::ALL.map(|dof| dof.name().to_owned()).to_vec());
}

/// Sampled and minimum-jerk shapes, flights and rests survive being written and read.
#[test]
fn a_motion_written_as_a_file_is_the_same_motion() {
    let given =
        parse(&NOD.replace("note = ", "flights = [[0.2, 0.4], [0.6, 0.7]]\nnote = ")).unwrap();
    let motion = given.perform().unwrap();
    let written = Action::of_motion("nod", "a \"nod\"", "tests", &motion).to_toml().unwrap();
    let read = parse(&written).unwrap();
    assert_eq!((read.note.as_str(), read.captured), ("a \"nod\"", true));
    let again = read.perform().unwrap();
    assert_eq!(again.flights_s().len(), 2);
    for i in 0..=100 {
        let time_s = f64::from(i) / 100.0;
        for dof in Dof::ALL {
            let (a, b) = (motion.at(dof, time_s), again.at(dof, time_s));
            assert!((a.position_rad - b.position_rad).abs() < 1e-5, "{dof:?} at {time_s}");
        }
    }
    assert!(vocabulary::find("walk").unwrap().to_toml().is_err());
}
