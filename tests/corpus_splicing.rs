//! An action put on another one, and one after another, scored against somebody who did both.

mod program;

use program::{folder, gaitway, json, words};
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

/// A corpus of who walks, who waves, and who does both: the right arm of the second on the first. `called` names the two alone.
fn corpus(name: &str, called: [&str; 2]) -> String {
    let folder = folder(name);
    let corpus = folder.join("moves").display().to_string();
    run(&["corpus", "new", &corpus]);
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
    for (action, rows) in [("walk+wave", &both), (called[0], &walk), (called[1], &wave)] {
        let file = written(&folder.join(format!("{action}.csv")), &titles, rows);
        let added = run(&["corpus", "add", &corpus, &file, "--action", action]);
        assert_eq!(added["added"], 1, "{added:#}");
    }
    corpus
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
    let corpus = folder.join("moves").display().to_string();
    run(&["corpus", "new", &corpus]);
    let (titles, walk) = performed("walk:6s", &folder);
    let (_, sprint) = performed("run:5s", &folder);
    let (same, both) = performed("walk:6s+run:5s", &folder);
    assert_eq!(titles, same);
    for (action, rows) in [("walk>run", &both), (called[0], &walk), (called[1], &sprint)] {
        let file = written(&folder.join(format!("{action}.csv")), &titles, rows);
        let added = run(&["corpus", "add", &corpus, &file, "--action", action]);
        assert_eq!(added["added"], 1, "{added:#}");
    }
    corpus
}

#[test]
fn a_change_of_gait_is_made_of_both_gaits_and_worse_when_they_are_called_wrongly() {
    let corpus = walks_into_runs("change", ["walk", "run"]);
    let told = run(&["score", "transitioning", &corpus]);
    assert!(told["features"].is_null(), "{told:#}");
    let why = "nobody labelled where one action ends and the next begins";
    assert_eq!(told["passed_over"][why], 1, "{told:#}");
    let label = |corpus: &str| {
        let folder = Path::new(corpus).parent().expect("a folder");
        let labels = folder.join("labels.csv");
        let rows =
            "file,class,start_s,end_s\nwalk>run.csv,walk,0.0,5.9\nwalk>run.csv,run,6.1,9.0\n";
        fs::write(&labels, rows).expect("labels");
        let [file, labels] =
            [folder.join("walk>run.csv"), labels].map(|path| path.display().to_string());
        let told =
            run(&["corpus", "add", corpus, &file, "--action", "walk>run", "--labels", &labels]);
        assert_eq!(told["labels"], 2, "{told:#}");
    };
    label(&corpus);
    let told = run(&["score", "transitioning", &corpus]);
    let of = |told: &Value, which: usize, name: &str| number(&told["features"][which][name]);
    let (own, blend) = (of(&told, 0, "value"), of(&told, 0, "baseline"));
    assert!(own < 60.0 && own < blend, "{own} mm, {blend} mm where both stand still");
    // What fades is faster for a moment than either; who stands is not.
    assert_eq!((of(&told, 1, "value"), of(&told, 1, "baseline")), (0.0, 100.0), "{told:#}");
    // Who walks is said to run, and who runs to walk.
    let spoilt = walks_into_runs("change-spoilt", ["run", "walk"]);
    label(&spoilt);
    let spoilt = run(&["score", "transitioning", &spoilt]);
    assert!(of(&spoilt, 0, "value") > 1.5 * own, "{own} mm, then {spoilt:#}");
}
