//! `recognise`, `model` and `score`, as they are typed.

mod program;

use program::{folder, gaitway, json, words};
use serde_json::Value;
use std::path::Path;
use std::process::Output;

fn run(arguments: &[&str]) -> Output {
    gaitway().args(arguments).output().expect("the command")
}

fn done(output: &Output) {
    assert!(output.status.success(), "{}", words(output));
}

/// The actions and sides that were recognised in a motion.
fn recognised(motion: &str) -> Vec<(String, Option<String>)> {
    let output = run(&["recognise", motion, "--json"]);
    done(&output);
    let events = json(&output)["events"].as_array().expect("events").clone();
    let text = |value: &Value| value.as_str().map(str::to_owned);
    events.iter().map(|of| (text(&of["action"]).expect("an action"), text(&of["side"]))).collect()
}

#[test]
fn a_walk_is_strides_of_one_foot_and_the_other_in_turn() {
    let strides = recognised("walk");
    assert!(strides.len() >= 6, "{strides:?}");
    assert!(strides.iter().all(|(action, _)| action == "walk"), "{strides:?}");
    for pair in strides.windows(2) {
        assert_ne!(pair[0].1, pair[1].1, "{strides:?}");
    }
}

#[test]
fn a_report_has_times_within_the_motion_and_in_order() {
    let output = run(&["recognise", "bow", "--json"]);
    done(&output);
    let report = json(&output);
    let event = &report["events"][0];
    assert_eq!(event["action"], "bow");
    assert_eq!(event["person"], 0);
    let time = |name: &str| event[name].as_f64().expect(name);
    assert!(time("start_s") < time("end_s") && time("end_s") <= time("recognised_at_s"));
    assert!(time("recognised_at_s") <= report["source"]["duration_s"].as_f64().expect("a length"));
    let phases = event["phases"].as_array().expect("phases");
    assert_eq!(phases.len(), 2);
    assert_eq!(phases[0]["start_s"], event["start_s"]);
    assert_eq!(phases[1]["end_s"], event["end_s"]);
    assert_eq!(report["frames"], report["source"]["frames"]);
}

#[test]
fn lines_of_json_tell_what_begins_before_what_is_done_and_in_the_order_of_time() {
    let output = run(&["recognise", "bow", "--json-lines"]);
    done(&output);
    let text = String::from_utf8(output.stdout).expect("text");
    let lines: Vec<Value> =
        text.lines().map(|line| serde_json::from_str(line).expect("a line")).collect();
    let of = lines.iter().filter(|line| line["action"] == "bow");
    let kinds: Vec<&str> = of.map(|line| line["kind"].as_str().expect("a kind")).collect();
    assert_eq!(kinds, ["begun", "phase", "phase", "done"], "{text}");
    let at: Vec<f64> = lines.iter().map(|line| line["at_s"].as_f64().expect("a time")).collect();
    assert!(at.is_sorted());
}

#[test]
fn a_table_of_what_was_found_is_written_and_never_over_another() {
    let table = folder("labels").join("found.csv");
    let name = table.display().to_string();
    done(&run(&["recognise", "bow", "--labels", &name]));
    let text = std::fs::read_to_string(&table).expect("a table");
    let mut lines = text.lines();
    assert_eq!(lines.next(), Some("start_s,end_s,class,side,person"));
    assert!(lines.next().is_some_and(|line| line.contains(",bow,,0")), "{text}");
    let refused = run(&["recognise", "bow", "--labels", &name]);
    assert!(!refused.status.success() && words(&refused).contains("--force"));
}

/// A BVH file of two legs and a trunk, without arms.
const LEGS: &str = "HIERARCHY\nROOT Hips\n{\nOFFSET 0 0 0\nCHANNELS 6 Xposition Yposition Zposition \
Zrotation Xrotation Yrotation\nJOINT Spine\n{\nOFFSET 0 10 0\nCHANNELS 3 Zrotation Xrotation Yrotation\n\
JOINT Head\n{\nOFFSET 0 45 0\nCHANNELS 3 Zrotation Xrotation Yrotation\nEnd Site\n{\nOFFSET 0 20 0\n}\n}\n}\n";

fn leg(side: &str, x: i32) -> String {
    format!(
        "JOINT {side}UpLeg\n{{\nOFFSET {x} 0 0\nCHANNELS 3 Zrotation Xrotation Yrotation\n\
         JOINT {side}Leg\n{{\nOFFSET 0 -42 0\nCHANNELS 3 Zrotation Xrotation Yrotation\n\
         JOINT {side}Foot\n{{\nOFFSET 0 -42 0\nCHANNELS 3 Zrotation Xrotation Yrotation\n\
         End Site\n{{\nOFFSET 0 -5 15\n}}\n}}\n}}\n}}\n"
    )
}

#[test]
fn without_arms_no_wave_can_be_seen_and_the_report_says_why() {
    let frame = "0 90 0".to_owned() + &" 0".repeat(27) + "\n";
    let text = format!(
        "{LEGS}{}{}}}\nMOTION\nFrames: 60\nFrame Time: 0.0333333\n{}",
        leg("Left", 9),
        leg("Right", -9),
        frame.repeat(60)
    );
    let file = folder("legs").join("legs.bvh");
    std::fs::write(&file, text).expect("a file");
    let output = run(&["recognise", &file.display().to_string(), "--json"]);
    done(&output);
    let report = json(&output);
    assert_eq!(report["events"].as_array().map(Vec::len), Some(0));
    let blind = report["blind"].as_array().expect("blind models");
    let of = |name: &str| blind.iter().find(|of| of["model"] == name);
    let missing = of("wave-r").expect("it cannot fire")["missing"].to_string();
    assert!(missing.contains("right_hand_height"), "{missing}");
    assert!(of("walk-l").is_none(), "legs are there: {blind:?}");
}

#[test]
fn models_of_a_folder_take_the_place_of_the_shipped_ones_and_are_checked() {
    let folder = folder("models");
    let model = |name: &str, text: &str| {
        std::fs::write(folder.join(name), text).expect("a file");
        folder.join(name).display().to_string()
    };
    let good = model(
        "nod.toml",
        "schema = 1\nname = \"nod\"\n[[phase]]\nname = \"lean\"\nmeasure.trunk_lean_deg = [20, 90]\n",
    );
    done(&run(&["model", "check", &good]));
    done(&run(&["model", "check"]));
    let models = folder.display().to_string();
    let output = run(&["recognise", "bow", "--models", &models, "--json"]);
    done(&output);
    let report = json(&output);
    assert_eq!((&report["models"], &report["events"][0]["action"]), (&1.into(), &"nod".into()));
    let bad = model(
        "bad.toml",
        "schema = 1\nname = \"bad\"\n[[phase]]\nname = \"lean\"\nmeasure.trunk_lean_deg = [90, 20]\n",
    );
    for arguments in
        [&["model", "check", &good, &bad][..], &["recognise", "bow", "--models", &models]]
    {
        let refused = run(arguments);
        assert_eq!(refused.status.code(), Some(1));
        let said = words(&refused);
        assert!(said.contains("cannot happen") && said.contains("bad.toml"), "{said}");
    }
}

#[test]
fn an_empty_folder_and_one_that_is_not_there_have_no_models() {
    let empty = folder("empty");
    let refused = run(&["recognise", "bow", "--models", &empty.display().to_string()]);
    assert!(words(&refused).contains("no models"), "{}", words(&refused));
    let refused = run(&["recognise", "bow", "--models", "there/is/no/such/folder"]);
    assert_eq!(refused.status.code(), Some(1));
}

#[test]
fn clips_are_scored_by_their_labels_and_one_that_cannot_be_read_is_named() {
    let clips = folder("clips");
    for action in ["bow", "walk"] {
        let file = clips.join(format!("{action}.toml"));
        let source = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("actions/{action}.toml"));
        std::fs::copy(source, file).expect("an action");
    }
    std::fs::write(
        clips.join("labels.csv"),
        "file,class,side\nbow.toml,bow,\nwalk.toml,walk,\nlost.bvh,walk,\n",
    )
    .expect("labels");
    let output = run(&["score", "classification", &clips.display().to_string(), "--json"]);
    done(&output);
    let report = json(&output);
    assert_eq!(report["clips"], 3);
    let unread = report["unread"].as_array().expect("unread");
    assert!(unread.len() == 1 && unread[0].to_string().contains("lost.bvh"), "{unread:?}");
    let global = &report["global"];
    assert_eq!((&global["correct"], &global["truth"]), (&2.into(), &2.into()), "{report}");
    assert!(report["segmentation"].is_null(), "no label has times");
}
