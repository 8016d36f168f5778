//! `recognise`, `model` and `score`, as they are typed.

mod captured;
mod program;

use captured::captured;
use gaitway::job::recognise::{RecogniseOrder, RecognisedAction, recognise};
use gaitway::recognise::model::BodySide;
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
    assert_eq!(phases.len(), 3);
    assert_eq!(phases[0]["start_s"], event["start_s"]);
    assert_eq!(phases[2]["end_s"], event["end_s"]);
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
    assert_eq!(kinds, ["begun", "phase", "phase", "phase", "done"], "{text}");
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
    assert!(report["per_corruption"].is_null(), "nobody asked for them");
    // With times, and the left hand of a wave hidden: it is not asked for, the walk and the bow are.
    let wave = Path::new(env!("CARGO_MANIFEST_DIR")).join("actions/wave-l.toml");
    std::fs::copy(wave, clips.join("wave-l.toml")).expect("an action");
    let table =
        "file,class,side,start_s,end_s\nbow.toml,bow,,0.2,2.6\nwave-l.toml,wave,L,1.3,4.4\n";
    std::fs::write(clips.join("labels.csv"), table).expect("labels");
    let clips = clips.display().to_string();
    let output = run(&["score", "classification", &clips, "--corruptions", "--json"]);
    done(&output);
    let report = json(&output);
    assert_eq!(report["global"]["correct"], 2, "{report}");
    let of = |name: &str| {
        let all = report["per_corruption"].as_array().expect("corruptions").iter();
        all.clone().find(|of| of["corruption"] == name).expect(name).clone()
    };
    assert_eq!(of("no left hand")["global"]["truth"], 1);
    for same in ["mirrored", "heading drifts 3 deg/s"] {
        assert_eq!(of(same)["global"]["correct"], 2, "{same}");
        assert!(of(same)["delay_s"].as_f64().is_some_and(|s| s.abs() < 0.02), "{}", of(same));
    }
    assert_eq!(of("0.7 times as fast")["global"]["truth"], 2);
}

#[test]
fn several_sources_are_named_in_one_run_each_with_its_own_name_in_the_order_of_time() {
    let output = run(&["recognise", "wave-l", "bow", "--json-lines"]);
    done(&output);
    let events: Vec<Value> = String::from_utf8_lossy(&output.stdout)
        .lines()
        .map(|line| serde_json::from_str(line).expect("a line of JSON"))
        .collect();
    let times: Vec<f64> = events.iter().filter_map(|of| of["at_s"].as_f64()).collect();
    assert!(times.len() == events.len() && times.is_sorted(), "{times:?}");
    let done_in = |source: &str| -> Vec<&str> {
        let of = events.iter().filter(|of| of["source"] == source && of["kind"] == "done");
        of.filter_map(|of| of["action"].as_str()).collect()
    };
    assert_eq!((done_in("wave-l"), done_in("bow")), (vec!["wave"], vec!["bow"]));
    let file = folder("several").join("found.csv").display().to_string();
    let output = run(&["recognise", "wave-l", "bow", "--labels", &file, "--json"]);
    done(&output);
    let report = json(&output);
    let alone = json(&run(&["recognise", "bow", "--json"]));
    assert_eq!(report["sources"][1]["events"], alone["events"]);
    let table = std::fs::read_to_string(&file).expect("a table");
    assert!(table.starts_with("file,") && table.contains("\nbow,"), "{table}");
    for (wrong, said) in [
        (&["recognise", "bow", "bow"][..], "named twice"),
        (&["recognise", "bow", "walk", "--html", "no.html"], "one person"),
        (&["recognise", "bow", "there-is-no-such"], "there-is-no-such"),
    ] {
        let refused = run(wrong);
        assert!(!refused.status.success() && words(&refused).contains(said), "{wrong:?}");
    }
}

#[test]
fn clips_are_scored_by_labels_of_their_frames_and_others_than_the_clip_has_are_named() {
    let folder = folder("frame-labels");
    let clip = folder.join("clips/one.bvh");
    std::fs::create_dir_all(folder.join("clips")).expect("a folder");
    done(&run(&["synth", "bow", "-o", &clip.display().to_string()]));
    let text = std::fs::read_to_string(&clip).expect("a clip");
    let frames = text.lines().skip_while(|line| !line.starts_with("Frame Time")).count() - 1;
    let label = |action: &str, mark: &str, count: usize| {
        let trial = folder.join("labels/one");
        std::fs::create_dir_all(&trial).expect("a folder");
        std::fs::write(trial.join(format!("{action}.txt")), format!("{mark}\n").repeat(count))
            .expect("labels");
    };
    let (clips, labels) = (folder.join("clips"), folder.join("labels"));
    let (clips, labels) = (clips.display().to_string(), labels.display().to_string());
    let score = || {
        let output = run(&["score", "classification", &clips, "--labels", &labels, "--json"]);
        done(&output);
        json(&output)
    };
    label("bow", "1.0", frames);
    label("walk", "0.0", frames);
    let global = score()["global"].clone();
    assert_eq!((&global["correct"], &global["truth"]), (&1.into(), &1.into()), "{global}");
    label("bow", "0.5", frames);
    let global = score()["global"].clone();
    assert_eq!((&global["recognised"], &global["truth"]), (&0.into(), &0.into()), "{global}");
    label("bow", "1.0", frames + 7);
    let refused = run(&["score", "classification", &clips, "--labels", &labels]);
    assert!(words(&refused).contains("other numbers of frames"), "{}", words(&refused));
    label("walk", "0.0", frames + 7);
    let unread = score()["unread"].to_string();
    assert!(unread.contains("one.bvh") && unread.contains("labels of"), "{unread}");
}

/// The model of a nod: the trunk leans this far at least.
fn nod(folder: &Path, least_deg: f64) -> String {
    let text = format!(
        "schema = 1\nname = \"nod\"\n[[phase]]\nname = \"lean\"\n\
         measure.trunk_lean_deg = [{least_deg}, 120]\n"
    );
    std::fs::write(folder.join("nod.toml"), text).expect("a model");
    folder.display().to_string()
}

/// The only model of a folder, explained on a motion.
fn explained(motion: &str, models: &str) -> Value {
    let output = run(&["model", "explain", motion, "--models", models, "--json"]);
    done(&output);
    let report = json(&output);
    assert_eq!(report["models"].as_array().map(Vec::len), Some(1), "{report}");
    report["models"][0].clone()
}

#[test]
fn a_model_that_is_given_what_it_was_said_to_want_fires_and_with_a_little_less_does_not() {
    let folder = folder("explain");
    let missed = explained("bow", &nod(&folder, 70.0));
    assert_eq!(missed["fired"].as_array().map(Vec::len), Some(0), "{missed}");
    let furthest = &missed["furthest"];
    assert_eq!((&furthest["stopped"], &furthest["number"]), (&"not_entered".into(), &1.into()));
    let wanting = &furthest["wanting"][0];
    assert_eq!(wanting["feature"], "trunk_lean_deg");
    let by = wanting["by"].as_f64().expect("by how much");
    assert!(by < 0.0 && (wanting["value"].as_f64().expect("a value") - 70.0 - by).abs() < 1e-9);
    for (least_deg, fires) in [(70.0 + by - 0.01, 1), (70.0 + by + 0.01, 0)] {
        let found = explained("bow", &nod(&folder, least_deg));
        assert_eq!(found["fired"].as_array().map(Vec::len), Some(fires), "{found}");
    }
}

#[test]
fn why_a_model_did_not_fire_is_drawn_beside_the_person() {
    let folder = folder("explain-drawn");
    let models = nod(&folder, 70.0);
    let page = folder.join("why.html").display().to_string();
    let asked = ["model", "explain", "bow", "--models", &models, "--html", &page];
    let output = run(&[&asked[..], &["--json"]].concat());
    assert_eq!(output.status.code(), Some(0), "{}", words(&output));
    let report: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let wanting = &report["models"][0]["furthest"]["wanting"][0];
    let html = std::fs::read_to_string(&page).expect("a page");
    for part in ["phase 1 of", wanting["feature"].as_str().expect("a feature")] {
        assert!(html.contains(part), "{part}");
    }
    let again = run(&asked);
    assert_eq!(again.status.code(), Some(1), "it is not written over: {}", words(&again));
}

#[test]
fn amounts_and_followers_that_are_wanting_are_told_with_phase_and_time() {
    let folder = folder("explain-amounts");
    let model = |forward: f64, then: &str| {
        let text = format!(
            "schema = 1\nname = \"nod\"\ngap_s = 2\n[[phase]]\nname = \"down\"\n\
             torso = {{ frontal = \"forward {forward}..\" }}\n[[phase]]\nname = \"then\"\n{then}\n"
        );
        std::fs::write(folder.join("nod.toml"), text).expect("a model");
        explained("bow", &folder.display().to_string())
    };
    let up = "torso = { frontal = \"backward\" }";
    let missed = model(3.0, up)["furthest"].clone();
    assert_eq!((&missed["stopped"], &missed["phase"]), (&"not_enough".into(), &"down".into()));
    let wanting = &missed["wanting"][0];
    assert_eq!(
        (&wanting["demand"], &wanting["feature"]),
        (&"amount".into(), &"torso_frontal".into())
    );
    let enough = 3.0 + wanting["by"].as_f64().expect("by how much") - 0.01;
    let seen = model(enough, up);
    assert_eq!(seen["fired"].as_array().map(Vec::len), Some(1), "{seen}");
    // Nobody who bows has a hand above the head.
    let missed = model(enough, "measure.right_hand_height = [1, 2]")["furthest"].clone();
    assert_eq!((&missed["stopped"], &missed["number"]), (&"no_next".into(), &2.into()));
    assert_eq!(missed["wanting"][0]["feature"], "right_hand_height");
    assert!(missed["start_s"].as_f64() < missed["at_s"].as_f64(), "{missed}");
}

#[test]
fn an_explanation_is_of_the_models_and_the_time_that_are_asked_for() {
    let output = run(&["model", "explain", "bow", "--model", "wave", "--model", "bow", "--json"]);
    done(&output);
    let report = json(&output);
    let names: Vec<&str> = report["models"]
        .as_array()
        .expect("models")
        .iter()
        .filter_map(|of| of["model"].as_str())
        .collect();
    assert_eq!(names, ["bow", "wave-l", "wave-r", "wave-small-l", "wave-small-r"]);
    let bow = |more: &[&str]| {
        let output =
            run(&[&["model", "explain", "bow", "--model", "bow", "--json"], more].concat());
        done(&output);
        json(&output)["models"][0]["fired"].as_array().map(Vec::len)
    };
    assert_eq!((bow(&[]), bow(&["--to", "0.1"])), (Some(1), Some(0)));
    let refused = run(&["model", "explain", "bow", "--model", "bovv"]);
    assert!(!refused.status.success() && words(&refused).contains("bovv"));
    let refused = run(&["model", "explain", "bow", "--from", "2", "--to", "1"]);
    assert!(!refused.status.success() && words(&refused).contains("ends before it begins"));
}

#[test]
fn a_drafted_model_sees_its_examples_and_not_what_another_side_does() {
    let folder = folder("drafted");
    let file = folder.join("my-kick-r.toml").display().to_string();
    let draft = [
        "model",
        "new",
        "my-kick-r",
        "--from",
        "kick-r",
        "--from",
        "kick-r@0s..1.6s",
        "--side",
        "right",
        "-o",
        &file,
    ];
    let output = run(&[&draft[..], &["--json"]].concat());
    done(&output);
    let examples = json(&output)["examples"].clone();
    assert_eq!(
        (&examples[0]["fired"], &examples[1]["fired"]),
        (&1.into(), &1.into()),
        "{examples}"
    );
    done(&run(&["model", "check", &file]));
    let found = |motion: &str| {
        let models = folder.display().to_string();
        let output = run(&["recognise", motion, "--models", &models, "--json"]);
        done(&output);
        json(&output)["events"].as_array().map(Vec::len)
    };
    for (motion, events) in [("kick-r", 1), ("kick-l", 0), ("bow", 0), ("walk", 0)] {
        assert_eq!(found(motion), Some(events), "{motion}");
    }
    let refused = run(&draft);
    assert!(!refused.status.success() && words(&refused).contains("--force"));
    let other = folder.join("none.toml").display().to_string();
    let refused =
        run(&["model", "new", "none", "--from", "kick-r", "--from", "bow@0s..0.1s", "-o", &other]);
    assert!(words(&refused).contains("share no motion"), "{}", words(&refused));
    let refused = run(&["model", "new", "none", "--from", "kick-r@5..9", "-o", &other]);
    assert!(words(&refused).contains("nothing in this part"), "{}", words(&refused));
    let refused = run(&["model", "new", "none", "--from", "kick-r@1..99", "-o", &other]);
    assert!(words(&refused).contains("beyond the end"), "{}", words(&refused));
}

#[test]
fn what_a_robot_plays_is_named_from_what_its_servos_reported() {
    let file = folder("played").join("run.mcap");
    let name = file.display().to_string();
    // What a robot on its own feet would fall in is named as well: the virtual one cannot.
    for (motion, action) in [("kick-r", "kick"), ("wave-r", "wave")] {
        let play = ["play", motion, "--robot", "op3", "--bus", "sim", "--record", &name];
        let output = run(&[&play[..], &["--allow-fall", "--json", "--force"]].concat());
        done(&output);
        let slowed = json(&output)["retime_factor"].as_f64().expect("a factor").to_string();
        let output = run(&["recognise", &name, "--slowed", &slowed, "--json"]);
        done(&output);
        let report = json(&output);
        assert_eq!(report["source"]["format"], "servos");
        let named: Vec<&Value> = report["events"]
            .as_array()
            .expect("events")
            .iter()
            .filter(|of| of["action"] == action)
            .collect();
        assert!(!named.is_empty() && named.iter().all(|of| of["side"] == "right"), "{report}");
        let end_s = report["source"]["duration_s"].as_f64().expect("a length");
        assert!(named.iter().all(|of| of["end_s"].as_f64() <= Some(end_s)), "{report}");
        // The same in a model's own terms, by the same clock.
        let explain = ["model", "explain", &name, "--model", motion, "--slowed", &slowed, "--json"];
        let output = run(&explain);
        done(&output);
        let fired = json(&output)["models"][0]["fired"].clone();
        let (told, own) = (fired[0]["end_s"].as_f64(), named[0]["end_s"].as_f64());
        let off_s = told.zip(own).map_or(f64::NAN, |(told, own)| (told - own).abs());
        assert!(off_s < 1e-6, "{fired} {named:?}");
    }
    let output = run(&["recognise", &name, "--json"]);
    let report = json(&output);
    // Nobody can see what it has not.
    let notes = report["notes"].to_string();
    assert!(notes.contains("joints and soles"), "{notes}");
    let refused = run(&["recognise", &name, "--rate", "100"]);
    assert!(words(&refused).contains("needs no mapping"), "{}", words(&refused));
    let refused = run(&["recognise", &name, "--slowed", "nan"]);
    assert_eq!(refused.status.code(), Some(1));
    let refused = run(&["model", "explain", &name, "--slowed", "0"]);
    assert!(words(&refused).contains("nothing is slowed like that"), "{}", words(&refused));
}

/// The lines of a BVH file behind its header, as numbers.
fn poses(file: &Path) -> Vec<Vec<f64>> {
    let text = std::fs::read_to_string(file).expect("a BVH file");
    let lines = text.lines().skip_while(|line| !line.starts_with("Frame Time")).skip(1);
    lines
        .map(|line| line.split(' ').map(|cell| cell.parse().expect("a number")).collect())
        .collect()
}

#[test]
fn pieces_of_a_bvh_file_are_its_own_lines_from_margin_to_margin() {
    let folder = folder("cut-file");
    let whole = folder.join("whole.bvh");
    let name = whole.display().to_string();
    done(&run(&["synth", "bow", "--rate", "50", "-o", &name]));
    let table = folder.join("table.csv");
    std::fs::write(&table, "class,side,start_s,end_s\nlow,,0.8,1.2\nlow,,1.3,1.5\nend,L,2.6,9\n")
        .expect("a table");
    let (table, pieces) = (table.display().to_string(), folder.join("pieces"));
    let out = pieces.display().to_string();
    let cut = ["cut", &name, "-o", &out, "--labels", &table, "--margin", "0.2", "--join", "0.1"];
    let output = run(&[&cut[..], &["--json"]].concat());
    done(&output);
    let report = json(&output);
    assert_eq!(report["as_it_stands"], true);
    let of = |piece: usize, key: &str| report["pieces"][piece][key].clone();
    // 0.8 - 0.2 to 1.5 + 0.2 s, both frames among them, and what there is of 2.4 s to the end.
    let all = poses(&whole);
    assert_eq!(
        (of(0, "events"), of(0, "first_frame"), of(0, "frames")),
        (2.into(), 30.into(), 56.into())
    );
    assert_eq!((of(1, "first_frame"), of(1, "frames")), (120.into(), (all.len() - 120).into()));
    assert_eq!(poses(&pieces.join("whole-001-low.bvh")), all[30..86]);
    assert_eq!(poses(&pieces.join("whole-002-end.bvh")), all[120..]);
    let labels = std::fs::read_to_string(pieces.join("labels.csv")).expect("labels");
    assert!(labels.contains("\nwhole-001-low.bvh,low,,0.7000,0.9000\n"), "{labels}");
    let refused = run(&cut);
    assert!(!refused.status.success() && words(&refused).contains("--force"));
    done(&run(&[&cut[..], &["--force"]].concat()));
    let refused = run(&["cut", "bow", "-o", &out, "--margin", "-1"]);
    assert!(words(&refused).contains("out of range"), "{}", words(&refused));
}

#[test]
fn what_is_cut_by_recognition_is_recognised_again_by_its_own_table() {
    let pieces = folder("cut-actions").join("pieces");
    let out = pieces.display().to_string();
    let output = run(&["cut", "walk:4s,bow,wave-r", "-o", &out, "--json"]);
    done(&output);
    let report = json(&output);
    let actions: Vec<&str> = report["pieces"]
        .as_array()
        .expect("pieces")
        .iter()
        .filter_map(|of| of["action"].as_str())
        .collect();
    assert_eq!(actions, ["walk", "bow", "wave"], "{report}");
    let output = run(&["score", "classification", &out, "--json"]);
    done(&output);
    let global = json(&output)["global"].clone();
    assert!(global["recall"].as_f64() >= Some(0.85), "{global}");
    assert!(global["precision"].as_f64() >= Some(0.85), "{global}");
    let nothing = run(&["cut", "bow", "-o", &out, "--only", "run"]);
    done(&nothing);
    assert!(words(&nothing).contains("nothing to cut"), "{}", words(&nothing));
}

#[test]
fn every_shipped_action_is_named_as_itself_on_its_own_side() {
    for name in gaitway::action::vocabulary::names() {
        let order = RecogniseOrder { motion: name.to_owned(), ..RecogniseOrder::default() };
        let report = recognise(&order, |_| ()).expect(name);
        let (action, side) = match name.rsplit_once('-') {
            Some((action, "l")) => (action, Some(BodySide::Left)),
            Some((action, "r")) => (action, Some(BodySide::Right)),
            _ => (name, None),
        };
        let is_it = |event: &&RecognisedAction| {
            event.action == action && (side.is_none() || event.side == side)
        };
        let right = report.events.iter().filter(is_it).count();
        assert!(right > 0, "{name}: {:?}", report.events);
        // What is alike is also named: a chop begins as a throw does, arms that swing level as a wave, and who
        // runs walks the first and the last stride.
        let alike = [("chop", "throw"), ("swing-arms-transverse", "wave"), ("run", "walk")];
        let is_alike = |event: &RecognisedAction| {
            alike.contains(&(action, event.action.as_str())) && report.events.len() - right <= 2
        };
        let strange: Vec<_> =
            report.events.iter().filter(|event| !is_it(event) && !is_alike(event)).collect();
        assert!(strange.is_empty(), "{name}: {strange:?}");
    }
}

/// What was cut by hand, clip by clip (`tests/cuts/README.md`).
#[test]
fn clips_of_other_skeletons_are_named_where_they_were_cut_by_hand() {
    let Some(clips) = captured("mocap/bvh") else { return };
    let cuts = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/cuts/others.csv");
    let (clips, cuts) = (clips.display().to_string(), cuts.display().to_string());
    let output = run(&["score", "classification", &clips, "--labels", &cuts, "--json"]);
    done(&output);
    let report = json(&output);
    assert_eq!(report["unread"].as_array().map(Vec::len), Some(0), "{report}");
    let global = &report["global"];
    let of = |key: &str| global[key].as_f64().expect(key);
    assert!(of("precision") > 0.8 && of("recall") > 0.85, "{global}");
    let cut = &report["segmentation"];
    assert!(cut["mean_ms"].as_f64() < Some(200.0), "{cut}");
}

#[test]
fn who_sits_down_is_named_in_sitting_and_not_when_the_seat_is_left() {
    let output = run(&["recognise", "sit-down,stand-up", "--json"]);
    done(&output);
    let report = json(&output);
    let events = report["events"].as_array().expect("events");
    let event = |action| events.iter().find(|of| of["action"] == action).expect(action);
    let sat_s = event("sit-down")["recognised_at_s"].as_f64().expect("a time");
    // The seat of the model lasts a quarter of a second, that of the actions longer.
    let phases = event("stand-up")["phases"].as_array().expect("phases");
    let up_s = phases.last().and_then(|up| up["start_s"].as_f64()).expect("a time");
    assert!(sat_s < up_s - 0.3, "{report}");
}

#[test]
fn a_model_that_mirrors_what_cannot_be_mirrored_says_what_is_wrong_with_that() {
    let folder = folder("mirrors");
    let write = |name: &str, text: &str| {
        std::fs::write(folder.join(name), text).expect("a file");
    };
    let said = || {
        let refused = run(&["model", "check", &folder.join("a.toml").display().to_string()]);
        assert_eq!(refused.status.code(), Some(1));
        words(&refused)
    };
    write("a.toml", "schema = 1\nname = \"a\"\nmirror_of = \"b\"\n");
    let absent = said();
    assert!(absent.contains("no such model") && absent.contains("mirror_of"), "{absent}");
    write("b.toml", "schema = 1\nname = \"b\"\nmirror_of = \"kick-r\"\n");
    let twice = said();
    assert!(twice.contains("b.toml") && twice.contains("mirrored again"), "{twice}");
    write("b.toml", "schema = 1\nname = \"b\"\n[[phase]]\nname = \"p\"\nposture = \"sittin\"\n");
    let broken = said();
    assert!(broken.contains("b.toml, phase p") && broken.contains("sittin"), "{broken}");
}
