//! `synth` and `actionlets` as typed.

use serde_json::Value;
use std::fs;
use std::path::Path;
use std::process::Output;

fn run(arguments: &[&str]) -> Output {
    crate::program::gaitway().args(arguments).output().unwrap()
}

fn made(arguments: &[&str]) -> Value {
    ended(arguments, 0, "done")
}

fn ended(arguments: &[&str], code: i32, outcome: &str) -> Value {
    let output = run(&[arguments, &["--json"]].concat());
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{arguments:?}: {said}");
    let report: Value = serde_json::from_slice(&output.stdout).expect("a JSON report");
    assert_eq!(report["outcome"], outcome);
    report
}

fn refused(arguments: &[&str], words: &[&str]) {
    let output = run(arguments);
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{arguments:?}: {said}");
    for word in words {
        assert!(said.contains(word), "{word:?} is not in:\n{said}");
    }
}

#[test]
fn a_table_has_time_22_angles_and_the_root_at_the_rate_asked_for() {
    let out = crate::program::folder("csv").join("walk.csv");
    let path = out.to_str().unwrap();
    let report = made(&["synth", "walk", "--rate", "50", "-o", path]);
    assert!((report["duration_s"].as_f64().unwrap() - 4.8).abs() < 1e-9);
    let table = fs::read_to_string(&out).unwrap();
    let mut lines = table.lines();
    let head: Vec<&str> = lines.next().unwrap().split(',').collect();
    assert_eq!((head.len(), head[0], head[1]), (29, "time_s", "torso_flexion_rad"));
    assert_eq!(head[23..26], ["root_x_m", "root_y_m", "root_z_m"]);
    let pelvis = ["pelvis_rotation_rad", "pelvis_obliquity_rad", "pelvis_tilt_rad"];
    assert_eq!(head[26..], pelvis);
    let rows: Vec<Vec<f64>> =
        lines.map(|line| line.split(',').map(|v| v.parse().unwrap()).collect()).collect();
    assert_eq!(rows.len(), 241);
    assert!(rows.iter().all(|row| row.len() == 29));
    assert_eq!(rows[0][..23], [0.0; 23]);
    // Thigh, shank and foot of 1.75 m at both ends (de Leva's women and men: 0.3685 + 0.4386 m of 1.735,
    // 0.4222 + 0.4403 m of 1.741; ankles at 0.039 of it), and steps between.
    let leg = f64::midpoint((0.3685 + 0.4386) / 1.735, (0.4222 + 0.4403) / 1.741);
    for row in [0, 240] {
        assert!((rows[row][25] - (leg + 0.039) * 1.75).abs() < 1e-4, "{:?}", rows[row]);
    }
    assert!(rows[240][23] > 2.0 && rows[240][24].abs() < 0.3, "{:?}", rows[240]);
    assert!((rows[240][0] - 4.8).abs() < 1e-9);
    // What is there is not written over.
    refused(&["synth", "walk", "-o", path], &["exists already", "--force"]);
}

#[test]
fn figures_are_set_or_refused_by_name() {
    let folder = crate::program::folder("set");
    let out = |name: &str| folder.join(name).to_str().unwrap().to_owned();
    let duration = |set: &[&str], name: &str| {
        let out = out(name);
        let set: Vec<&str> = set.iter().flat_map(|pair| ["--set", pair]).collect();
        let report = made(&[&["synth", "walk", "-o", &out], set.as_slice()].concat());
        report["duration_s"].as_f64().unwrap()
    };
    assert!((duration(&["rounds=2"], "a.csv") - 2.4).abs() < 1e-9);
    assert!((duration(&["duration_s=1.0", "rounds=5"], "b.csv") - 5.0).abs() < 1e-9);
    assert!((duration(&["pace=0.5"], "c.csv") - 9.6).abs() < 1e-9);
    assert!((duration(&["peak=0.3"], "d.bvh") - 4.8).abs() < 1e-9);
    for (set, words) in [
        ("rounds=0", &["rounds=0", "whole number"][..]),
        ("speed=2", &["speed=2", "pace"]),
        ("peak=0.95", &["peak", "0.1 to 0.9"]),
        ("stature=1.7", &["did you mean stature_m?"]),
        ("vary_strides=1", &["did you mean vary_stride?"]),
        ("blend_s=0", &["blend_s=0", "above 0"]),
        ("blend_s=-1", &["blend_s=-1", "above 0"]),
        ("stature_m=9", &["stature", "0.3 to 3 m"]),
        ("pace", &["KEY=VALUE"]),
        ("vary_types=joint", &["vary_types=joint", "range or paper"]),
    ] {
        refused(&["synth", "walk", "-o", &out("x.bvh"), "--set", set], words);
    }
    for key in [
        "duration_s",
        "rounds",
        "pace",
        "peak",
        "stature_m",
        "mass_kg",
        "leg_m",
        "blend_s",
        "vary_angle",
        "vary_time",
        "vary_peak",
        "vary_duration",
        "vary_exchange",
        "vary_stride",
        "vary_stature",
        "vary_heading_deg",
    ] {
        for value in ["NaN", "inf", "-inf", "-1", "1e400"] {
            let set = format!("{key}={value}");
            refused(&["synth", "walk", "-o", &out("x.bvh"), "--set", &set], &[key]);
        }
    }
    assert!(!folder.join("x.bvh").exists());
    refused(&["synth", "walk", "-o", &out("x.mp4")], &["x.mp4", ".csv"]);
    refused(&["synth", "moonwalk", "-o", &out("x.csv")], &["moonwalk", "jumping-jacks"]);
    refused(&["synth", "walk", "--rate", "0", "-o", &out("x.csv")], &["0 Hz", "10000 Hz"]);
}

#[test]
fn a_bvh_file_reads_back_as_a_person_who_walks() {
    let out = crate::program::folder("bvh").join("walk.bvh");
    made(&["synth", "walk:x6", "--rate", "60", "-o", out.to_str().unwrap()]);
    let capture = gaitway::mocap::read_bvh(&out, None).unwrap();
    assert!((capture.stature_m - 1.75).abs() < 0.1);
    let travel_m = capture.poses[capture.poses.len() - 1].root_m.x - capture.poses[0].root_m.x;
    assert!((8.0..13.0).contains(&travel_m), "{travel_m} m in 7.2 s");
}

#[test]
fn an_x3d_file_is_one_humanoid_with_a_route_for_every_joint() {
    let out = crate::program::folder("x3d").join("bow.x3d");
    made(&["synth", "bow", "--rate", "30", "-o", out.to_str().unwrap()]);
    let text = fs::read_to_string(&out).unwrap();
    assert_eq!(text.matches("<HAnimHumanoid ").count(), 1);
    assert_eq!(text.matches("<HAnimJoint DEF=").count(), 13);
    assert_eq!(text.matches("<HAnimJoint USE=").count(), 13);
    assert_eq!(text.matches("toField='set_rotation'").count(), 13);
    // Every element is closed.
    let mut open: Vec<&str> = Vec::new();
    for tag in text.split('<').skip(1).map(|rest| rest.split('>').next().unwrap()) {
        if tag.starts_with(['?', '!']) || tag.ends_with('/') {
            continue;
        }
        match tag.strip_prefix('/') {
            Some(name) => assert_eq!(open.pop(), Some(name)),
            None => open.push(tag.split_whitespace().next().unwrap()),
        }
    }
    assert!(open.is_empty(), "{open:?}");
    // Interpolators have a value for every key.
    for line in text.lines().filter(|line| line.starts_with("<OrientationInterpolator")) {
        let field = |name: &str| line.split(name).nth(1).unwrap().split('\'').nth(1).unwrap();
        let (keys, values) = (field(" key=").split(' ').count(), field("keyValue=").split(", "));
        assert_eq!(keys, 85);
        assert!(
            values.clone().count() == keys && values.into_iter().all(|v| v.split(' ').count() == 4)
        );
    }
}

#[test]
fn a_page_needs_nothing_from_outside() {
    let out = crate::program::folder("page").join("run.html");
    made(&["synth", "run", "-o", out.to_str().unwrap()]);
    let page = fs::read_to_string(&out).unwrap();
    assert!(page.contains("<canvas") && page.contains("default-src 'none'"));
    for outside in ["src=\"", "href=", "url(", "@import"] {
        assert!(!page.contains(outside), "{outside}");
    }
}

#[test]
fn a_capture_becomes_an_action_file_that_plays() {
    let out = crate::program::folder("actionlets").join("My Walk.toml");
    let path = out.to_str().unwrap();
    let report = made(&["actionlets", "motions/walk.bvh", "-o", path]);
    assert!(report["median_rms_deg"].as_f64().unwrap() <= 1.0, "{report:#}");
    assert!(report["compression"].as_f64().unwrap() > 10.0, "{report:#}");
    let text = fs::read_to_string(&out).unwrap();
    assert!(text.contains("name = \"my-walk\"") && text.contains("captured = true"), "{text}");
    let output = run(&["play", path, "--robot", "op3", "--bus", "sim", "--dry-run", "--json"]);
    let played: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(played["outcome"], "done", "{played:#}");
    refused(&["actionlets", "motions/walk.bvh", "-o", "walk.json"], &["walk.json", ".toml"]);
    refused(&["actionlets", "no-such.bvh", "-o", path, "--force"], &["no-such.bvh"]);
}

/// The shipped walk with noise of 2 degrees on every rotation, evenly distributed.
fn noisy_walk() -> String {
    let text = fs::read_to_string("motions/walk.bvh").unwrap();
    let (head, motion) = text.split_once("Frame Time").unwrap();
    let (time, rows) = motion.split_once('\n').unwrap();
    let mut state = 1u64;
    let mut noise = || {
        // Knuth's MMIX generator; the standard deviation of -1 to 1 is the root of a third.
        state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let part = (state >> 11) as f64 / (1u64 << 53) as f64;
        2.0 * 3f64.sqrt() * (2.0 * part - 1.0)
    };
    let mut noisy = format!("{head}Frame Time{time}\n");
    for row in rows.lines() {
        let values = row.split_whitespace().enumerate().map(|(index, value)| {
            let value: f64 = value.parse().unwrap();
            format!("{}", if index < 3 { value } else { value + noise() })
        });
        noisy.push_str(&values.collect::<Vec<_>>().join(" "));
        noisy.push('\n');
    }
    noisy
}

#[test]
fn a_tolerance_that_is_missed_is_a_loss_that_is_told_and_the_file_is_written() {
    let folder = crate::program::folder("noisy");
    let (noisy, out) = (folder.join("noisy.bvh"), folder.join("noisy.toml"));
    fs::write(&noisy, noisy_walk()).unwrap();
    let arguments = ["actionlets", noisy.to_str().unwrap(), "-o", out.to_str().unwrap()];
    let report = ended(&arguments, 3, "done_with_loss");
    let dofs = report["dofs"].as_array().unwrap();
    assert_eq!(dofs.len(), 22);
    for dof in dofs {
        let misses = dof["rms_deg"].as_f64().unwrap() > 1.0;
        assert_eq!(dof["misses_tolerance"], misses, "{dof:#}");
    }
    let knee = dofs.iter().find(|dof| dof["name"] == "left_knee_flexion").unwrap();
    assert_eq!(knee["misses_tolerance"], true);
    assert!((1.6..2.4).contains(&knee["noise_deg"].as_f64().unwrap()), "{knee:#}");
    assert!(fs::read_to_string(&out).unwrap().contains("captured = true"));
    let output = run(&[&arguments[..], &["--force"]].concat());
    assert_eq!(output.status.code(), Some(3));
    let said = String::from_utf8_lossy(&output.stdout);
    for words in ["done, with loss", "the tolerance of 1 deg is missed by", "noise"] {
        assert!(said.contains(words), "{words:?} is not in:\n{said}");
    }
    // Without the noise it is kept, and nothing is said of it.
    let clean = folder.join("clean.toml");
    let output = run(&["actionlets", "motions/walk.bvh", "-o", clean.to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(0));
    assert!(!String::from_utf8_lossy(&output.stdout).contains("missed"));
}

#[test]
fn the_time_near_a_singular_pose_is_told() {
    let folder = crate::program::folder("singular");
    let (jacks, out) = (folder.join("jacks.bvh"), folder.join("jacks.toml"));
    made(&["synth", "jumping-jacks", "-o", jacks.to_str().unwrap()]);
    let arguments = ["actionlets", jacks.to_str().unwrap(), "-o", out.to_str().unwrap()];
    let report = made(&arguments);
    let near = report["near_singular"].as_array().unwrap();
    let joints: Vec<&str> = near.iter().map(|joint| joint["joint"].as_str().unwrap()).collect();
    assert_eq!(joints, ["left_shoulder", "right_shoulder"], "{report:#}");
    for joint in near {
        // The arms pass through the singular pose twice in a jump, at some 400 deg/s.
        let share = joint["share"].as_f64().unwrap();
        assert!((0.005..0.2).contains(&share), "{joint:#}");
        assert!(joint["off_deg"].as_f64().unwrap() < 0.1, "{joint:#}");
    }
    let output = run(&[&arguments[..], &["--force"]].concat());
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(said.contains("left_shoulder is near its singularity for"), "{said}");
}

#[test]
fn a_corpus_is_the_same_whole_in_pieces_and_taken_up_again() {
    let folder = crate::program::folder("corpus");
    let at = |name: &str| folder.join(name);
    let synth = |out: &Path, seed: &str| {
        let out = out.to_str().unwrap().to_owned();
        let arguments = ["synth", "wave-l:0.5s", "--rate", "10", "--variations", "20001", "--seed"];
        made(&[&arguments[..], &[seed, "-o", &out]].concat())
    };
    let whole = at("whole");
    assert_eq!(synth(&whole, "3")["found"], 0);
    let names = |folder: &Path| {
        let mut names: Vec<String> = fs::read_dir(folder)
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    };
    let given = names(&whole);
    // Seventeen sets of three tables, of at most 1,250 variations, and corpus.json.
    assert_eq!(given.len(), 52, "{given:?}");
    let named = |table: &str, number: &str| {
        let is_it = |name: &&String| name.starts_with(table) && name.ends_with(number);
        whole.join(given.iter().find(is_it).unwrap())
    };
    let bytes: Vec<Vec<u8>> = given.iter().map(|n| fs::read(whole.join(n)).unwrap()).collect();
    // As a run leaves it that was broken off in its second pair.
    fs::remove_file(named("variations", "01.parquet")).unwrap();
    fs::remove_file(named("actionlets", "02.parquet")).unwrap();
    let poses = named("poses", "02.parquet");
    fs::rename(&poses, poses.with_extension("parquet.part")).unwrap();
    // One that lost its end with the power.
    let cut = named("variations", "03.parquet");
    fs::write(&cut, &fs::read(&cut).unwrap()[..100]).unwrap();
    let again = synth(&whole, "3");
    assert_eq!(again["found"], 20_001 - 3 * 1_250);
    assert_eq!(again["mended"].as_array().unwrap().len(), 3, "{}", again["mended"]);
    assert_eq!(names(&whole), given);
    for (name, bytes) in given.iter().zip(&bytes) {
        assert!(fs::read(whole.join(name)).unwrap() == *bytes, "{name} differs");
    }
    // Another seed is another corpus, and not mixed with this one.
    let out = whole.to_str().unwrap();
    let other =
        ["synth", "wave-l:0.5s", "--rate", "10", "--variations", "20001", "--seed", "4", "-o"];
    refused(&[&other[..], &[out]].concat(), &["another corpus", "--seed 3 (asked for: 4)"]);
    let single = at("one.parquet");
    let one = single.to_str().unwrap();
    made(&["synth", "wave-l:0.5s", "--rate", "10", "--variations", "10", "-o", one]);
    let bytes = fs::read(&single).unwrap();
    assert!(bytes.starts_with(b"PAR1") && bytes.ends_with(b"PAR1"));
    assert!(at("one.actionlets.parquet").exists() && at("one.variations.parquet").exists());
    refused(&["synth", "bow", "--variations", "10", "-o", one], &["exists already"]);
}

#[test]
fn what_comes_to_nothing_is_told_as_json_by_every_command_alike() {
    let folder = crate::program::folder("nothing");
    let out = |name: &str| folder.join(name).to_str().unwrap().to_owned();
    let there = out("there.json");
    fs::write(&there, "precious").unwrap();
    for arguments in [
        &["synth", "moonwalk", "-o", &out("a.csv")][..],
        &["synth", "moonwalk", "--variations", "3", "-o", &out("a")],
        &["actionlets", "moonwalk", "-o", &out("a.toml")],
        &["retarget", "moonwalk", "--robot", "op3", "-o", &out("a.csv")],
        &["play", "moonwalk", "--robot", "op3", "--bus", "sim"],
        &["recognise", "moonwalk"],
    ] {
        let output = run(&[arguments, &["--json"]].concat());
        let report: Value = serde_json::from_slice(&output.stdout).expect("a report");
        assert_eq!(output.status.code(), Some(1), "{arguments:?}");
        assert_eq!(report["outcome"], "refused", "{arguments:?}");
        assert_eq!(report["refusal"], "unknown", "{arguments:?}: {report}");
        assert!(report["stop_reason"].as_str().unwrap().contains("moonwalk"), "{report}");
    }
    // As a file too, but never over one that is there.
    let report = out("report.json");
    refused(&["synth", "moonwalk", "-o", &out("a.csv"), "--report", &report], &["moonwalk"]);
    let told: Value = serde_json::from_slice(&fs::read(report).unwrap()).unwrap();
    assert_eq!(told["outcome"], "refused");
    refused(&["synth", "walk", "-o", &out("a.csv"), "--report", &there], &["exists already"]);
    assert_eq!(fs::read(there).unwrap(), b"precious");
}

/// The words of a run that ends with a code.
fn says(arguments: &[&str], code: i32, words: &[&str]) {
    let output = run(arguments);
    let said = crate::program::words(&output);
    assert_eq!(output.status.code(), Some(code), "{arguments:?}: {said}");
    for word in words {
        assert!(said.contains(word), "{word:?} is not in:\n{said}");
    }
}

#[test]
fn an_insert_says_what_became_of_each_degree_of_freedom() {
    let folder = crate::program::folder("insert");
    let out = |name: &str| folder.join(name).to_str().unwrap().to_owned();
    let (a, b) = (out("a.csv"), out("b.csv"));
    let report =
        made(&["synth", "bow", "--insert", "wave-r@1.3s", "--insert-wait", "-o", a.as_str()]);
    assert!((report["duration_s"].as_f64().unwrap() - 2.8 - 5.0).abs() < 1e-9);
    let insert = &report["inserts"][0];
    assert_eq!(report["inserts"].as_array().unwrap().len(), 1);
    assert_eq!(insert["source"], "wave-r");
    assert_eq!(insert["meanwhile"], "wait");
    assert!((insert["longer_by_s"].as_f64().unwrap() - 5.0).abs() < 1e-9);
    let names = |list: &Value, key: &str| -> Vec<String> {
        let name = |row: &Value| row.get(key).unwrap_or(row).as_str().unwrap().to_owned();
        list.as_array().unwrap().iter().map(name).collect()
    };
    let pasted = ["flexion", "abduction", "rotation"].map(|of| format!("right_shoulder_{of}"));
    let pasted = [&pasted[..], &["right_elbow_flexion".to_owned()]].concat();
    assert_eq!(names(&insert["dofs"], "dof"), pasted);
    let kept = ["torso_flexion", "left_shoulder_flexion", "neck_flexion"];
    assert_eq!(names(&insert["kept"], ""), kept);
    for dof in insert["dofs"].as_array().unwrap() {
        let number = |key: &str| dof[key].as_f64().unwrap_or_else(|| panic!("{key}: {dof}"));
        assert_eq!(
            (number("cut_from_s"), number("cut_moved_s"), number("seam_s")),
            (0.0, 0.0, 0.0)
        );
        assert!((number("pasted_from_s") - 1.3).abs() < 1e-9, "{dof}");
        assert!((number("pasted_to_s") - 6.3).abs() < 1e-9, "{dof}");
        assert!(number("angles_after_moved_rad").abs() < 1e-9, "{dof}");
    }
    // The back is bent all the while, and straight at the end.
    let table = fs::read_to_string(&a).unwrap();
    let torso_rad = |row: usize| -> f64 {
        table.lines().nth(row + 1).unwrap().split(',').nth(1).unwrap().parse().unwrap()
    };
    let bent_rad = 52f64.to_radians();
    assert!((torso_rad(140) - bent_rad).abs() < 1e-8 && (torso_rad(780) - bent_rad).abs() < 1e-8);
    assert!(torso_rad(936).abs() < 1e-8);
    says(
        &["synth", "bow", "--insert", "wave-r:0s..4s@1.3s", "--insert-nearest", "-o", b.as_str()],
        0,
        &[
            "inserted  wave-r from 0.000 to 4.000 s at 1.300 s, 4.000 s longer",
            "right_elbow_flexion      from its rest at 0.000 s: pasted at 1.300",
            "meanwhile go on: torso_flexion",
        ],
    );
}

#[test]
fn inserts_that_cannot_be_are_refused_before_anything_is_written() {
    let folder = crate::program::folder("no-insert");
    let out = folder.join("x.csv").to_str().unwrap().to_owned();
    let synth = |action: &str, more: &[&str], code: i32, words: &[&str]| {
        says(&[&["synth", action, "-o", out.as_str()][..], more].concat(), code, words);
        assert!(!Path::new(&out).exists());
    };
    for (insert, words) in [
        ("bow:1.4s..0.5s@3s", &["bow:1.4s..0.5s@3s", "ends before it begins"][..]),
        ("bow:NaNs..0.5s@3s", &["NaN s", "0 to 86400 s"]),
        ("bow:0s..1e308s@3s", &["0 to 86400 s"]),
        ("bow:0.5..1.4@3", &["SOURCE:FROM..TO@TIME"]),
        ("bow", &["SOURCE:FROM..TO@TIME"]),
    ] {
        synth("walk", &["--insert", insert], 2, words);
    }
    for (insert, words) in [
        (
            "bow:0.5s..9s@3s",
            &["bow:0.5s..9s@3s", "not inside what it is cut out of", "0 to 2.8 s"][..],
        ),
        ("bow@9s", &["not inside the motion", "0 to 4.8 s"]),
        ("moonwalk@3s", &["moonwalk@3s", "not an action"]),
        ("no-such.toml@3s", &["no-such.toml"]),
        (
            "bow:0.5s..1s@3s",
            &["torso_flexion rests at 0 and 1.12 s", "left_shoulder_flexion", "--insert-nearest"],
        ),
        ("bow:1.2s..1.5s@3s", &["nothing moves in the cut"]),
        ("drink-r@2.3s", &["anatomical range", "right_elbow_flexion", "--insert-keep-end"]),
    ] {
        synth("walk", &["--insert", insert], 1, words);
    }
    synth("walk", &["--insert-nearest"], 2, &["--insert"]);
    let varied = ["--insert", "bow@3s", "--variation", "3"];
    synth("walk", &varied, 2, &["--variation", "cannot be used with"]);
    synth("bow+walk:6s", &[], 1, &["done once", "join it with a comma"]);
}

#[test]
fn a_change_of_gait_says_where_each_degree_of_freedom_goes_over() {
    let folder = crate::program::folder("change");
    let out = |name: &str| folder.join(name).to_str().unwrap().to_owned();
    let report = made(&["synth", "walk:6s+run:5s", "-o", &out("a.csv")]);
    // Walks for 6 s, then as many whole rounds as come nearest to 5 s.
    let period_s = gaitway::action::vocabulary::find("run").unwrap().duration_s;
    let whole_s = 6.0 + (5.0 / period_s).round() * period_s;
    assert!((report["duration_s"].as_f64().unwrap() - whole_s).abs() < 1e-9);
    let change = &report["changes"][0];
    assert_eq!(change["from"], "walk");
    assert_eq!(change["to"], "run");
    assert!((change["time_s"].as_f64().unwrap() - 6.0).abs() < 1e-9);
    let dofs = change["dofs"].as_array().unwrap();
    assert!(dofs.iter().any(|dof| dof["dof"] == "torso_flexion"), "{change:#}");
    for dof in dofs {
        let number = |key: &str| dof[key].as_f64().unwrap_or_else(|| panic!("{key}: {dof}"));
        assert!(number("left_s") < number("joined_s"), "{dof}");
        assert!(number("left_rad").abs() < 3.0 && number("joined_rad").abs() < 3.0, "{dof}");
    }
    says(
        &["synth", "walk:6s+run:5s", "-o", &out("b.csv")],
        0,
        &["changed   walk to run at 6.000 s, phase 0.500", "left_hip_flexion         leaves"],
    );
}

#[test]
fn what_is_played_may_have_inserts_and_changes_too() {
    let play = |more: &[&str]| {
        let arguments = ["--robot", "op3", "--bus", "sim", "--dry-run", "--json"];
        let output = run(&[&["play"][..], more, &arguments].concat());
        let report: Value = serde_json::from_slice(&output.stdout).unwrap();
        (output.status.code(), report)
    };
    let (code, report) = play(&["walk:x2+run:x3", "--insert", "wave-r@1s"]);
    assert_eq!(code, Some(0), "{report:#}");
    let source = &report["source"];
    assert_eq!(source["changes"][0]["to"], "run");
    assert_eq!(source["inserts"][0]["source"], "wave-r");
    let notes = report["notes"].to_string();
    assert!(notes.contains("walk goes over into run at 2.400 s without a stop"), "{notes}");
    assert!(notes.contains("wave-r from 0.000 to 5.000 s inserted at 1.000 s"), "{notes}");
    let (_, plain) = play(&["bow"]);
    assert!(plain["source"].get("inserts").is_none(), "{plain:#}");
    let (code, report) = play(&["motions/walk.bvh", "--insert", "bow@1s"]);
    assert_eq!(code, Some(1));
    let said = report.to_string();
    assert!(said.contains("inserted into actions only") && said.contains("actionlets"), "{said}");
}

#[test]
fn the_examples_of_inserts_and_changes_in_the_documents_run() {
    let folder = crate::program::folder("documents");
    let text = fs::read_to_string("docs/actions.md").unwrap();
    let examples = text.lines().filter(|line| line.starts_with("gaitway synth "));
    let examples: Vec<&str> =
        examples.filter(|line| line.contains("--insert ") || line.contains('+')).collect();
    assert!(examples.len() >= 4, "{examples:?}");
    for example in examples {
        let arguments: Vec<&str> = example.split_whitespace().skip(1).collect();
        let mut command = crate::program::gaitway();
        let output = command.args(&arguments).current_dir(&folder).output().unwrap();
        assert_eq!(output.status.code(), Some(0), "{example}: {}", crate::program::words(&output));
        assert!(folder.join(arguments[arguments.len() - 1]).exists(), "{example}");
    }
}

#[test]
fn a_variation_says_whether_its_feet_hold_and_who_does_it() {
    let folder = crate::program::folder("one-variation");
    let out = |name: &str| folder.join(name).to_str().unwrap().to_owned();
    let one = |set: &[&str], name: &str| {
        let (out, mut words) = (out(name), vec!["synth", "kick-r", "--variation", "7"]);
        words.extend(set);
        words.extend(["-o", &out]);
        made(&words)
    };
    let usual = one(&[], "a.html");
    assert_eq!(usual["varied"]["variation"], 7);
    let holds = ["valid", "repaired"].contains(&usual["varied"]["status"].as_str().unwrap());
    assert!(holds && usual["footing"]["slides_m"].as_f64().unwrap() < 0.005, "{usual:#}");
    assert_eq!(usual["varied"]["stature_m"], 1.75);
    let page = std::fs::read_to_string(folder.join("a.html")).unwrap();
    assert!(page.contains("kick-r, variation 7"), "its title");
    let other = one(&["--set", "vary_stature=0.2"], "b.csv");
    let stature_m = other["varied"]["stature_m"].as_f64().unwrap();
    assert!((1.4..2.1).contains(&stature_m) && stature_m != 1.75, "{stature_m}");
    // In a tenth of the time nobody kicks and stands.
    let c = out("c.csv");
    let hurried = ["synth", "kick-r", "--variation", "7", "--set", "pace=10", "-o", &c];
    let hurried = ended(&hurried, 3, "done_with_loss");
    assert_eq!(hurried["varied"]["status"], "implausible");
    let whole = made(&["synth", "kick-r", "-o", &out("d.csv")]);
    assert!(whole.get("varied").is_none(), "it is no variation");
}
