//! An action put on another one, and one after another, scored against somebody who did both.

use crate::program::{folder, gaitway, json, words};
use serde_json::Value;
use std::fs;
use std::path::Path;

fn run(arguments: &[&str]) -> Value {
    json(&gaitway().args(arguments).arg("--json").output().expect("the program"))
}

fn number(of: &Value) -> f64 {
    of.as_f64().unwrap_or_else(|| panic!("a number: {of}"))
}

/// The angles of an action, frame by frame, with their titles.
fn performed(action: &str, within: &Path) -> (Vec<String>, Vec<Vec<f64>>) {
    let file = within.join(format!("{}.csv", action.replace(':', "-")));
    let shown = file.display().to_string();
    let output = gaitway().args(["synth", action, "-o", &shown]).output().expect("the program");
    assert!(output.status.success(), "{}", words(&output));
    let text = fs::read_to_string(&file).expect("a table");
    let mut lines = text.lines();
    let titles = lines.next().expect("titles").split(',').map(str::to_owned).collect();
    let row = |line: &str| line.split(',').map(|cell| cell.parse().expect("a number")).collect();
    (titles, lines.map(row).collect())
}

fn written(path: &Path, titles: &[String], rows: &[Vec<f64>]) -> String {
    let row = |row: &Vec<f64>| row.iter().map(f64::to_string).collect::<Vec<_>>().join(",") + "\n";
    let text: String =
        std::iter::once(titles.join(",") + "\n").chain(rows.iter().map(row)).collect();
    fs::write(path, text).expect("a table");
    path.display().to_string()
}

/// A corpus of these, each a table of angles.
fn added(folder: &Path, titles: &[String], trials: [(&str, &Vec<Vec<f64>>); 3]) -> String {
    let corpus = folder.join("moves").display().to_string();
    run(&["corpus", "new", &corpus]);
    for (action, rows) in trials {
        let file = written(&folder.join(format!("{action}.csv")), titles, rows);
        let added = run(&["corpus", "add", &corpus, &file, "--action", action]);
        assert_eq!(added["added"], 1, "{added:#}");
    }
    corpus
}

/// A corpus of who walks, who waves, and who does both: the right arm of the second on the first. `called` names the two alone.
fn corpus(name: &str, called: [&str; 2]) -> String {
    let folder = folder(name);
    let (titles, walk) = performed("walk:8s", &folder);
    let (same, wave) = performed("wave-r", &folder);
    assert_eq!(titles, same);
    let is_of_arm = |title: &str| title.contains("right_shoulder") || title.contains("right_elbow");
    assert_eq!(titles.iter().filter(|title| is_of_arm(title)).count(), 4, "{titles:?}");
    let count = walk.len().min(wave.len());
    let both = |at: usize| -> Vec<f64> {
        let pairs = titles.iter().zip(walk[at].iter().zip(&wave[at]));
        pairs.map(|(title, (walk, wave))| if is_of_arm(title) { *wave } else { *walk }).collect()
    };
    let both: Vec<Vec<f64>> = (0..count).map(both).collect();
    assert!(count > 200, "{count} frames");
    added(&folder, &titles, [("walk+wave", &both), (called[0], &walk), (called[1], &wave)])
}

#[test]
fn a_wave_on_a_walk_is_nearer_than_either_and_further_when_its_parts_are_called_wrongly() {
    let told = run(&["score", "splicing", &corpus("right", ["walk", "wave"])]);
    assert_eq!((&told["judged"], &told["unit"]), (&1.into(), &"mm".into()), "{told:#}");
    let (value, bound) = (number(&told["value"]), number(&told["bound"][1]));
    let (paste, first) = (&told["baselines"][0]["value"], &told["baselines"][1]["value"]);
    // Each angle is that of one of the two: who knows which makes it again, as far as pieces begin every 50 ms.
    assert!(bound < 5.0 && value < 5.0, "{told:#}");
    assert!(bound <= value + 1e-9 && value < 0.5 * number(first), "{told:#}");
    assert!(value < 0.5 * number(paste), "{told:#}");
    let [low, high] = [0, 1].map(|end| number(&told["interval"][end]));
    assert!(low <= value && value <= high);
    assert_eq!(number(&told["per_class"]["walk+wave"]), value);
    // Who walks is called a wave, and who waves a walk.
    let spoilt = run(&["score", "splicing", &corpus("spoilt", ["wave", "walk"])]);
    assert!(
        number(&spoilt["value"]) > 1.5 * value + 50.0,
        "{} mm after {value} mm",
        spoilt["value"]
    );
}

#[test]
fn without_somebody_who_does_both_there_is_no_truth() {
    let folder = folder("none");
    let corpus = folder.join("moves").display().to_string();
    run(&["corpus", "new", &corpus]);
    run(&["corpus", "add", &corpus, "bow", "wave-r"]);
    let told = run(&["score", "splicing", &corpus]);
    assert!(told["value"].is_null());
    assert!(told["truth"].as_str().expect("words").contains("no truth here"));
    // Somebody does both, and nobody one of them alone.
    run(&["corpus", "add", &corpus, "kick-r", "--action", "walk+kick"]);
    let told = run(&["score", "splicing", &corpus]);
    assert_eq!(told["passed_over"]["an action of the two is not there alone"], 1, "{told:#}");
}

/// A corpus of who walks, who runs, and who goes from a walk into a run without a stop, with the time of that.
fn walks_into_runs(name: &str, called: [&str; 2]) -> String {
    let folder = folder(name);
    let (titles, walk) = performed("walk:6s", &folder);
    let (_, sprint) = performed("run:5s", &folder);
    let (same, both) = performed("walk:6s+run:5s", &folder);
    assert_eq!(titles, same);
    added(&folder, &titles, [("walk>run", &both), (called[0], &walk), (called[1], &sprint)])
}

/// Says until when the first is done, and from when on the second, s.
fn label(corpus: &str, [one, other]: [&str; 2], [end_s, begin_s]: [f64; 2]) {
    let folder = Path::new(corpus).parent().expect("a folder");
    let (both, labels) = (format!("{one}>{other}"), folder.join("labels.csv"));
    let rows = format!(
        "file,class,start_s,end_s\n{both}.csv,{one},0.0,{end_s}\n{both}.csv,{other},{begin_s},{}\n",
        begin_s + 1.0
    );
    fs::write(&labels, rows).expect("labels");
    let file = folder.join(format!("{both}.csv")).display().to_string();
    let labels = labels.display().to_string();
    let told = run(&["corpus", "add", corpus, &file, "--action", &both, "--labels", &labels]);
    assert_eq!(told["labels"], 2, "{told:#}");
}

#[test]
fn who_goes_from_one_pose_into_another_moves_faster_than_who_stands_in_either() {
    for (name, turned_rad, feasible) in [("alike", 0.0, 100.0), ("unlike", 0.8, 0.0)] {
        let folder = folder(name);
        let (titles, bow) = performed("bow", &folder);
        let elbow = titles.iter().position(|title| title.contains("left_elbow")).expect("an elbow");
        // At rest, with the elbow at some angle.
        let pose = |at: usize, angle_rad: f64| {
            let mut row = bow[0].clone();
            row[0] = at as f64 / 120.0;
            row[elbow] += angle_rad;
            row
        };
        // Of other lengths, since a corpus takes no trial twice.
        let still = |angle_rad: f64, frames: usize| {
            (0..frames).map(|at| pose(at, angle_rad)).collect::<Vec<_>>()
        };
        // Half a second about the middle is 60 frames, in which the angle goes over by the cubic that is level at both ends.
        let over = |at: usize| {
            let u = ((at as f64 - 149.0) / 61.0).clamp(0.0, 1.0);
            turned_rad * u * u * (3.0 - 2.0 * u)
        };
        let both = (0..361).map(|at| pose(at, over(at))).collect();
        let [here, there] = [still(0.0, 301), still(turned_rad, 331)];
        let corpus = added(&folder, &titles, [("a>b", &both), ("a", &here), ("b", &there)]);
        label(&corpus, ["a", "b"], [1.4, 1.6]);
        let told = run(&["score", "transitioning", &corpus]);
        let of = |which: usize, name: &str| number(&told["features"][which][name]);
        assert!(of(0, "value") < 0.01 && of(0, "baseline") < 0.01, "{name}: {told:#}");
        assert_eq!((of(1, "value"), of(1, "baseline")), (feasible, feasible), "{name}");
    }
}

#[test]
fn a_change_of_gait_is_made_of_both_gaits_and_worse_when_they_are_called_wrongly() {
    let corpus = walks_into_runs("change", ["walk", "run"]);
    let told = run(&["score", "transitioning", &corpus]);
    assert!(told["features"].is_null(), "{told:#}");
    let why = "nobody labelled where one action ends and the next begins";
    assert_eq!(told["passed_over"][why], 1, "{told:#}");
    label(&corpus, ["walk", "run"], [5.9, 6.1]);
    let told = run(&["score", "transitioning", &corpus]);
    let of = |told: &Value, which: usize, name: &str| number(&told["features"][which][name]);
    let (own, blend) = (of(&told, 0, "value"), of(&told, 0, "baseline"));
    assert!(own < 60.0 && own < blend, "{own} mm, {blend} mm where both stand still");
    // What fades is faster for a moment than either; who stands is not.
    assert_eq!((of(&told, 1, "value"), of(&told, 1, "baseline")), (0.0, 100.0), "{told:#}");
    // Who walks is said to run, and who runs to walk.
    let spoilt = walks_into_runs("change-spoilt", ["run", "walk"]);
    label(&spoilt, ["walk", "run"], [5.9, 6.1]);
    let spoilt = run(&["score", "transitioning", &spoilt]);
    assert!(of(&spoilt, 0, "value") > 1.5 * own, "{own} mm, then {spoilt:#}");
}
