//! What a corpus lacks, who is to be asked, and what scores say of people: how far annotators agree, and what of a
//! person's motion a robot keeps.

use crate::program::{folder, gaitway, json, words};
use gaitway::corpus::store::Store;
use gaitway::corpus::tables::LABELS;
use gaitway::session::plan::Plan;
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};

fn corpus(args: &[&str]) -> Value {
    let output = gaitway().arg("corpus").args(args).arg("--json").output().expect("the program");
    assert!(output.status.success(), "{args:?}: {}", words(&output));
    json(&output)
}

fn shown(path: &Path) -> String {
    path.display().to_string()
}

fn new(name: &str) -> (PathBuf, String) {
    let folder = folder(name);
    let moves = shown(&folder.join("moves"));
    corpus(&["new", &moves]);
    (folder, moves)
}

/// A capture of an action, as a file.
fn bvh(path: &Path, action: &str) {
    let made =
        gaitway().args(["synth", action, "--rate", "30", "-o", &shown(path)]).output().expect("it");
    assert!(made.status.success(), "{}", words(&made));
}

/// A finished session of one person in which these were done.
fn session(folder: &Path, trials: &[&str]) -> String {
    let session = folder.join("monday");
    for inner in ["subjects", "angles"] {
        fs::create_dir_all(session.join(inner)).expect("a folder");
    }
    fs::write(session.join("session.toml"), "").expect("a file");
    let subject = "id = \"s07\"\ngender = \"female\"\n[measures]\nage_years = 30\nstature_m = 1.7\nmass_kg = 65\n";
    fs::write(session.join("subjects/s07.toml"), subject).expect("a file");
    let mut manifest = "schema = 1\nsession = \"monday\"\nbegun = \"2026-01-05T10:00:00Z\"\nfinished = \"2026-01-05T11:00:00Z\"\n\
                        operator = \"o\"\nplace = \"here\"\ngaitway_version = \"0.1.0\"\nsubjects = [\"subjects/s07.toml\"]\n\
                        action = []\n[choices]\ndata_type = \"\"\nrange_of_motion = \"\"\nrange_of_subjects = \"\"\n\
                        definition_and_execution = \"\"\noutput = \"\"\n"
        .to_owned();
    for (at, action) in trials.iter().enumerate() {
        bvh(&session.join(format!("angles/{action}-01.bvh")), ["wave-r", "bow", "kick-r"][at]);
        manifest.push_str(&format!(
            "[[trial]]\nname = \"{action}-01\"\naction = \"{action}\"\nverdict = \"keep\"\ngood_repetitions = 1\n\
             subjects = [\"s07\"]\nrecordings = []\nangles = [\"angles/{action}-01.bvh\"]\n\
             not_worn = []\nsilent_samples = 0\nduration_s = 3.0\nprops = \"\"\nnotes = \"\"\n"
        ));
    }
    fs::write(session.join("manifest.toml"), manifest).expect("a file");
    shown(&session)
}

#[test]
fn a_plan_lists_what_nobody_did_leads_a_session_and_knows_its_trials_when_they_come() {
    let (folder, moves) = new("plan");
    let empty = corpus(&["plan", &moves, "generalisation"]);
    assert_eq!((&empty["wanted"], &empty["recorded"]), (&Value::from(330), &Value::from(0)));
    // What the program makes is told, and does not count.
    corpus(&["generate", &moves, "generalisation", "--part", "7/330"]);
    let made = corpus(&["plan", &moves, "generalisation"]);
    assert_eq!((&made["only_made"], &made["recorded"]), (&Value::from(1), &Value::from(0)));

    let (plan, plot) = (shown(&folder.join("plan.toml")), shown(&folder.join("plot.svg")));
    corpus(&["plan", &moves, "generalisation", "-o", &plan, "--plot", &plot]);
    let text = fs::read_to_string(&plan).expect("a plan");
    let planned = Plan::parse(&text, "plan.toml").expect("a plan of a session");
    assert_eq!(planned.actions.len(), 330);
    let name = planned.actions[0].name.as_str();
    assert_eq!((name, planned.wanted(&planned.actions[0])), ("reach-001", 1));
    assert!(planned.actions[0].explain.starts_with("Reach with the right hand, to 0."));
    let again = gaitway().args(["corpus", "plan", &moves, "generalisation", "-o", &plan]).output();
    assert_eq!(again.expect("the program").status.code(), Some(1), "nothing is written over");

    corpus(&["add", &moves, &session(&folder, &[name, "kick-001"]), "--set", "generalisation"]);
    let found = corpus(&["query", &moves, "kind=session and action=reach and target_z_m>-1"]);
    assert_eq!(found["trials"], 1);
    let then = corpus(&["plan", &moves, "generalisation"]);
    assert_eq!(then["recorded"], 2);
    let missing: Vec<&str> = then["missing"]
        .as_array()
        .expect("a list")
        .iter()
        .filter_map(|of| of["name"].as_str())
        .collect();
    assert!(!missing.contains(&name) && !missing.contains(&"kick-001") && missing.len() == 328);

    // The picture has a square for each trial, and one person in it: who did nothing yet covers nothing.
    let idle = folder.join("s08.toml");
    fs::write(&idle, "id = \"s08\"\n[measures]\nstature_m = 1.9\nmass_kg = 90\n").expect("a file");
    corpus(&["add", &moves, "--subject-file", &shown(&idle)]);
    corpus(&["plan", &moves, "generalisation", "--plot", &plot, "--force"]);
    let svg = fs::read_to_string(&plot).expect("a picture");
    let count = |what: &str| svg.matches(what).count();
    assert_eq!(count("<rect "), 330);
    assert_eq!((count("class=\"done\""), count("class=\"made\"")), (2, 1));
    assert_eq!((count("class=\"known\""), count("class=\"next\"")), (1, 10));
    assert_eq!(then["people"], 1);
}

#[test]
fn nothing_is_written_into_the_folder_of_a_corpus() {
    let (folder, moves) = new("inside");
    let version = Path::new(&moves).join("version.json");
    let link = folder.join("link.bvh");
    for link in [&link, &folder.join("link.toml")] {
        std::os::unix::fs::symlink(&version, link).expect("a link");
    }
    let before = fs::read(&version).expect("a version");
    let there = names(&moves);
    for (verb, file) in [
        ("plan", "version.json"),
        ("query", "version.json"),
        ("plan", "new.toml"),
        ("plan", "../link.toml"),
    ] {
        let file = shown(&Path::new(&moves).join(file));
        let what = if verb == "plan" { "praxicon" } else { "" };
        let run = gaitway().args(["corpus", verb, &moves, what, "-o", &file, "--force"]).output();
        let run = run.expect("the program");
        assert_eq!(run.status.code(), Some(1), "{verb} {file}");
        assert!(words(&run).contains("outside"), "{}", words(&run));
    }
    // Whoever writes, and whatever: a result, a report, a folder.
    let bow = shown(&folder.join("bow.bvh"));
    bvh(Path::new(&bow), "bow");
    let inside = |name: &str| shown(&Path::new(&moves).join(name));
    let (table, version_file, link) =
        (inside("trials/x.csv"), inside("version.json"), shown(&link));
    let beside = shown(&folder.join("variations"));
    for line in [
        ["convert", &bow, &table, "--force"].as_slice(),
        &["convert", &bow, &link, "--force"],
        &["synth", "bow", "-o", &link, "--force"],
        &["retarget", &bow, "--robot", "op3", "-o", &link, "--force"],
        &["corpus", "query", &moves, "", "--report", &version_file, "--force"],
        &["corpus", "check", &moves, "--report", &link, "--force"],
        &["corpus", "export", &moves, "", "--format", "bvh", "-o", &inside("exports")],
        &["corpus", "new", &inside("within/another")],
        &["synth", "bow", "--variations", "2", "-o", &inside("variations")],
        &["cut", &bow, "-o", &inside("pieces")],
        &["synth", "bow", "--variations", "2", "-o", &inside("../nowhere/../moves/variations")],
        &["synth", "bow", "--variations", "2", "-o", &beside, "--report", &inside("report.json")],
        &["list", "actions", "--report", &inside("report.json")],
        &["corpus", "generate", &moves, "no-such-set", "--report", &inside("report.json")],
        &["calibrate", "so101", "--bus", "sim", "--calibration", &inside("corpus.toml"), "--force"],
        &["simulate", "imus", "--pty", &inside("imus")],
        &["record", "--session", &inside("tuesday"), "torso=imu:x-imu3@serial:/dev/ttyUSB9"],
    ] {
        let run = gaitway().args(line).output().expect("the program");
        assert!(!Path::new(&inside("report.json")).exists(), "{line:?}");
        if line.contains(&"no-such-set") {
            continue;
        }
        assert_ne!(run.status.code(), Some(0), "{line:?}");
        assert!(words(&run).contains("outside"), "{line:?}: {}", words(&run));
    }
    assert_eq!(fs::read(&version).expect("a version"), before);
    assert!(!Path::new(&moves).join("new.toml").exists());
    assert_eq!(names(&moves), there);
}

fn names(folder: &str) -> Vec<String> {
    let entries = fs::read_dir(folder).expect("a folder").flatten();
    let mut names: Vec<String> =
        entries.map(|entry| entry.file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

#[test]
fn a_composite_says_which_of_its_parts_nobody_did_alone_and_many_people_are_counted() {
    let (folder, moves) = new("parts");
    let composition = corpus(&["plan", &moves, "composition"]);
    let of = |report: &Value, name: &str| {
        let all = report["missing"].as_array().expect("a list").clone();
        all.into_iter().find(|of| of["name"] == name).expect("it is missing")
    };
    let both = of(&composition, "walk-and-wave");
    assert_eq!(both["parts_missing"], serde_json::json!(["walk", "wave"]));
    corpus(&["add", &moves, &session(&folder, &["wave"]), "--set", "praxicon"]);
    let both = of(&corpus(&["plan", &moves, "composition"]), "walk-and-wave");
    assert_eq!(both["parts_missing"], serde_json::json!(["walk"]));

    let cross = corpus(&["plan", &moves, "cross-validation"]);
    assert_eq!((&cross["wanted"], &cross["recorded"]), (&Value::from(3500), &Value::from(0)));
    let plan = shown(&folder.join("two.toml"));
    corpus(&["plan", &moves, "interaction", "-o", &plan]);
    let two = Plan::parse(&fs::read_to_string(&plan).expect("a plan"), "two.toml").expect("a plan");
    assert!(two.actions.iter().all(|action| action.together) && two.actions.len() == 20);

    let unknown = gaitway().args(["corpus", "plan", &moves, "generalization"]).output();
    let said = words(&unknown.expect("the program"));
    assert!(said.contains("generalisation") && said.contains("interaction"), "{said}");
}

#[test]
fn two_annotators_agree_as_far_as_their_frames_do() {
    let (folder, moves) = new("agreement");
    let clip = folder.join("clip.bvh");
    bvh(&clip, "wave-r");
    let labelled = |name: &str, start_s: f64, end_s: f64| {
        let table = folder.join(format!("{name}.csv"));
        let row = format!("file,class,start_s,end_s\nclip.bvh,wave,{start_s},{end_s}\n");
        fs::write(&table, row).expect("a table");
        let (clip, table) = (shown(&clip), shown(&table));
        corpus(&[
            "add",
            &moves,
            &clip,
            "--action",
            "wave",
            "--labels",
            &table,
            "--annotator",
            name,
        ]);
    };
    let score =
        || json(&gaitway().args(["score", "agreement", &moves, "--json"]).output().expect("it"));
    labelled("anna", 0.5, 1.5);
    let alone = score();
    assert!(alone["value"].is_null());
    assert_eq!(alone["passed_over"]["labelled by fewer than two"], 1);
    labelled("ben", 0.5, 1.5);
    assert_eq!(score()["value"], 1.0);
    labelled("carl", 1.0, 2.0);
    let three = score();
    let value = three["value"].as_f64().expect("a share");
    assert!(value < 0.9 && value > 0.0, "{value}");
    assert_eq!(three["per_class"]["wave"], three["value"]);
    // Somebody's label ends at the last number there is.
    let mut store = Store::open_to_change(Path::new(&moves)).expect("a corpus");
    let note = store.files(LABELS).next().expect("labels").clone();
    let mut endless = store.labels_in(&note).expect("labels").remove(0);
    endless.last_frame = i64::MAX;
    endless.annotator = "dora".to_owned();
    store.label(&[endless], "beyond the end").expect("kept");
    drop(store);
    assert!(score()["value"].as_f64().expect("a share") < 1.0);
}

#[test]
fn a_plan_and_its_picture_appear_together_or_not_at_all() {
    let (folder, moves) = new("together");
    let plan = folder.join("plan.toml");
    // Whatever is written there finds the disk full.
    let plot = folder.join("plot.svg");
    std::os::unix::fs::symlink("/dev/full", &plot).expect("a link");
    let run = gaitway()
        .args(["corpus", "plan", &moves, "praxicon", "-o", &shown(&plan), "--force", "--plot"])
        .arg(&plot)
        .output()
        .expect("the program");
    assert_eq!(run.status.code(), Some(1), "{}", words(&run));
    assert!(!plan.exists(), "{:?}", names(&shown(&folder)));
}

#[test]
fn a_robot_keeps_more_of_a_motion_than_copied_angles_do_and_less_of_one_it_cannot_do() {
    let (folder, moves) = new("retargeting");
    let score = |question: &str| {
        let run = gaitway()
            .args(["score", "retargeting", &moves, question, "--robot", "op3", "--json"])
            .output()
            .expect("the program");
        assert!(run.status.success(), "{}", words(&run));
        json(&run)
    };
    let (good, odd) = (folder.join("good.bvh"), folder.join("odd.bvh"));
    bvh(&good, "wave-r,bow");
    corpus(&["add", &moves, &shown(&good), "--action", "wave"]);
    let found = score("action=wave");
    let value = |of: &Value| of.as_f64().expect("a number");
    let feature = |of: &Value, begins: &str| {
        let all = of["features"].as_array().expect("a list").clone();
        let is_it = |of: &Value| of["what"].as_str().is_some_and(|what| what.starts_with(begins));
        all.into_iter().find(is_it).expect("it is told")
    };
    let hands = feature(&found, "hands");
    assert!(value(&hands["value"]) < value(&hands["baseline"]), "{hands}");
    assert_eq!(feature(&found, "trials whose feet")["value"], 100.0);
    assert!(found["bound"].is_null(), "nobody did it twice");

    // The same with arms that swing round: a robot's shoulders end before that.
    bvh(&odd, "swing-arms-circular");
    corpus(&["add", &moves, &shown(&odd), "--action", "swing"]);
    let spoilt = score("action=swing");
    assert!(
        value(&spoilt["value"]) > value(&found["value"]),
        "{} after {}",
        spoilt["value"],
        found["value"]
    );

    let screwed =
        gaitway().args(["score", "retargeting", &moves, "--robot", "poppy-torso"]).output();
    let said = words(&screwed.expect("the program"));
    assert!(!said.contains("panicked"), "{said}");
}
