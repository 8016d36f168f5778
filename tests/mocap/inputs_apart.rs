//! Whatever is read is never written over, not even with `--force`; and what cleaning says is what it did.

use crate::captured;
use crate::program::{folder, gaitway, words};
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Output;

fn run(folder: &Path, arguments: &[&str]) -> Output {
    gaitway().current_dir(folder).args(arguments).output().expect("it runs")
}

/// A folder with a walk and a static trial of one person, if the captures are there.
fn trials(name: &str) -> Option<PathBuf> {
    let from = captured::captured("mocap/c3d")?.join("pig");
    let folder = folder(name);
    for (file, to) in [
        ("PiG_Motion-FlatFoot-Full.c3d", "walk.c3d"),
        ("PiG_Calibration-FlatFoot-Full.c3d", "static.c3d"),
    ] {
        fs::write(folder.join(to), fs::read(from.join(file)).expect("a capture")).expect("written");
    }
    Some(folder)
}

#[test]
fn what_is_read_is_never_written_over() {
    let Some(folder) = trials("apart") else { return };
    fs::create_dir_all(folder.join("others")).expect("a folder");
    fs::copy(folder.join("walk.c3d"), folder.join("others/w.c3d")).expect("copied");
    fs::write(folder.join("t.csv"), "x,y,z\n1,2,3\n2,3,4\n").expect("written");
    let declared = "rate_hz = 100\n[[sensor]]\nname = \"a\"\nrate = [\"x\", \"y\", \"z\"]\n";
    fs::write(folder.join("s.toml"), declared).expect("written");
    let all = ["walk.c3d", "static.c3d", "others/w.c3d", "t.csv", "s.toml"];
    let bytes = || all.map(|file| fs::read(folder.join(file)).expect("still there"));
    let before = bytes();
    for command in [
        "fit walk.c3d --static static.c3d -o static.c3d",
        "fit walk.c3d --static static.c3d -o x.bvh --report static.c3d",
        "fit walk.c3d --static static.c3d -o x.bvh --report x.bvh",
        "clean walk.c3d --static static.c3d -o static.c3d",
        "clean walk.c3d --static static.c3d -o o.c3d --html static.c3d",
        "clean walk.c3d --others others -o others/w.c3d",
        "clean others --check --report others/w.c3d",
        "clean others -o out --report others/w.c3d",
        "clean walk.c3d -o x.c3d --html x.edits.toml",
        "info t.csv --sensors s.toml --report s.toml",
    ] {
        let arguments: Vec<&str> = command.split(' ').chain(["--force"]).collect();
        let refused = run(&folder, &arguments);
        assert_eq!(refused.status.code(), Some(1), "{command}: {}", words(&refused));
        let said = words(&refused);
        assert!(
            said.contains("would be written over") || said.contains("the same name"),
            "{command}: {said}"
        );
        assert!(bytes() == before, "{command}");
    }
}

/// A marker of the walk as a table, changed by `change` (frame, place in m).
fn changed(folder: &Path, marker: &str, change: impl Fn(usize, [f64; 3]) -> [f64; 3]) -> String {
    let made = run(folder, &["convert", "walk.c3d", "walk.csv", "--force"]);
    assert!(made.status.success(), "{}", words(&made));
    let text = fs::read_to_string(folder.join("walk.csv")).expect("a table");
    let mut lines = text.lines();
    let titles = lines.next().expect("titles");
    let first = titles.split(',').position(|title| title == format!("{marker}_x_m"));
    let first = first.unwrap_or_else(|| panic!("{titles}"));
    let mut out = titles.to_owned() + "\n";
    for (frame, line) in lines.enumerate() {
        let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
        let place = [0, 1, 2].map(|axis| cells[first + axis].parse().unwrap_or(f64::NAN));
        for (axis, value) in change(frame, place).into_iter().enumerate() {
            cells[first + axis] = value.to_string();
        }
        out += &(cells.join(",") + "\n");
    }
    fs::write(folder.join("changed.csv"), &out).expect("written");
    out
}

/// Places of a marker in a table, m.
fn places(folder: &Path, file: &str, marker: &str) -> Vec<[f64; 3]> {
    let text = fs::read_to_string(folder.join(file)).expect("a table");
    let mut lines = text.lines();
    let titles = lines.next().expect("titles");
    let first = titles.split(',').position(|title| title == format!("{marker}_x_m"));
    let first = first.expect("the marker");
    let place = |line: &str| {
        let cells: Vec<&str> = line.split(',').collect();
        [0, 1, 2].map(|axis| cells[first + axis].parse().unwrap_or(f64::NAN))
    };
    lines.map(place).collect()
}

#[test]
fn a_marker_that_steps_away_and_stays_there_is_filled_from_before_it_stepped() {
    let Some(folder) = trials("steps") else { return };
    let held = std::cell::Cell::new([0.0; 3]);
    for (case, at_origin) in [("away", false), ("origin", true)] {
        changed(&folder, "LANK", |frame, place| {
            if frame == 120 {
                held.set(if at_origin { [0.0; 3] } else { place.map(|value| value + 0.3) });
            }
            if (120..135).contains(&frame) { held.get() } else { place }
        });
        let done = run(&folder, &["clean", "changed.csv", "-o", "cleaned.csv", "--force"]);
        assert!(matches!(done.status.code(), Some(0 | 3)), "{case}: {}", words(&done));
        let truth = places(&folder, "walk.csv", "LANK");
        let mended = places(&folder, "cleaned.csv", "LANK");
        for frame in 115..140 {
            let off_m: f64 = (0..3)
                .map(|axis| (truth[frame][axis] - mended[frame][axis]).powi(2))
                .sum::<f64>()
                .sqrt();
            assert!(off_m < 0.03, "{case}, frame {frame}: {off_m} m");
        }
    }
}

#[test]
fn a_fill_of_an_edit_list_that_cannot_be_made_is_not_called_filled() {
    let Some(folder) = trials("unfilled") else { return };
    let list = "schema = 1\nsource = \"walk.c3d\"\n\n[[edit]]\nkind = \"by_hand\"\nmarker = \"LANK\"\n\
                first_frame = 300\nlast_frame = 310\nremedy = \"fill\"\nmethod = \"other_trials\"\n";
    fs::write(folder.join("e.toml"), list).expect("written");
    let arguments = ["clean", "walk.c3d", "-o", "o.c3d", "--edits", "e.toml", "--json", "--force"];
    let done = run(&folder, &arguments);
    assert_eq!(done.status.code(), Some(3), "{}", words(&done));
    let report: Value = serde_json::from_slice(&done.stdout).expect("JSON");
    assert_eq!(report["outcome"], "done_with_loss");
    assert_eq!(report["artefacts"][0]["remedy"], "remove");
    assert!(report["notes"].to_string().contains("cannot fill 11 frames"), "{}", report["notes"]);
}

#[test]
fn a_table_in_which_rows_are_missing_is_refused_and_one_that_is_cut_off_is_said() {
    let Some(folder) = trials("rows") else { return };
    let made = run(&folder, &["convert", "walk.c3d", "walk.trc", "--force"]);
    assert!(made.status.success(), "{}", words(&made));
    changed(&folder, "LANK", |_, place| place);
    let without = |file: &str, to: &str, from: usize| {
        let text = fs::read_to_string(folder.join(file)).expect("a table");
        let kept = text.lines().enumerate().filter(|(line, _)| !(from..from + 50).contains(line));
        let kept: Vec<&str> = kept.map(|(_, line)| line).collect();
        fs::write(folder.join(to), kept.join("\n") + "\n").expect("written");
    };
    without("changed.csv", "hole.csv", 101);
    without("walk.trc", "hole.trc", 106);
    for file in ["hole.csv", "hole.trc"] {
        for command in ["clean FILE -o o.csv", "info FILE", "convert FILE o.c3d"] {
            let arguments = command.replace("FILE", file);
            let arguments: Vec<&str> = arguments.split(' ').collect();
            let refused = run(&folder, &arguments);
            assert_eq!(refused.status.code(), Some(1), "{command}: {}", words(&refused));
            let said = words(&refused);
            assert!(said.contains("rows are missing") && said.contains("line "), "{said}");
        }
    }
    let whole = fs::read(folder.join("walk.c3d")).expect("a capture");
    fs::write(folder.join("cut.c3d"), &whole[..whole.len() / 2]).expect("written");
    let done =
        run(&folder, &["fit", "cut.c3d", "--static", "static.c3d", "-o", "cut.bvh", "--json"]);
    assert_eq!(done.status.code(), Some(3), "{}", words(&done));
    let report: Value = serde_json::from_slice(&done.stdout).expect("JSON");
    assert!(report["notes"].to_string().contains("frames that the file claims"), "{report}");
}

#[test]
fn a_trial_that_is_cut_off_is_named_wherever_it_is_looked_at() {
    let Some(folder) = trials("cut") else { return };
    fs::create_dir_all(folder.join("raw")).expect("a folder");
    let whole = fs::read(folder.join("walk.c3d")).expect("a capture");
    fs::write(folder.join("raw/cut.c3d"), &whole[..whole.len() / 2]).expect("written");
    fs::copy(folder.join("walk.c3d"), folder.join("raw/whole.c3d")).expect("copied");
    let said = "the file is cut off";
    for arguments in
        ["clean raw --check --most-doubt 100", "clean raw -o out --most-doubt 100 --force"]
    {
        let arguments: Vec<&str> = arguments.split(' ').collect();
        let done = run(&folder, &arguments);
        assert_eq!(done.status.code(), Some(3), "{arguments:?}: {}", words(&done));
        let text = words(&done);
        assert!(text.lines().any(|row| row.contains("cut.c3d") && row.contains(said)), "{text}");
        assert!(!text.lines().any(|row| row.contains("whole.c3d") && row.contains(said)), "{text}");
        let done = run(&folder, &[&arguments[..], &["--json"]].concat());
        let report: Value = serde_json::from_slice(&done.stdout).expect("JSON");
        assert_eq!(report["outcome"], "done_with_loss");
        let lost = |name: &str| {
            let trials = report["trials"].as_array().expect("a list");
            let is_it = |of: &&Value| {
                let file = of.get("trial").unwrap_or(&of["markers"]);
                file.as_str().is_some_and(|file| file.ends_with(name))
            };
            trials.iter().find(is_it).expect("the trial")["lost_frames"].as_u64().expect("a count")
        };
        assert!(lost("cut.c3d") > 100 && lost("whole.c3d") == 0, "{report}");
    }
    for arguments in [
        "clean raw/cut.c3d -o o.c3d --html clean.html",
        "info raw/cut.c3d --html info.html",
        "clean walk.c3d -o w.c3d --html whole.html",
    ] {
        run(&folder, &arguments.split(' ').collect::<Vec<&str>>());
    }
    let page = |name: &str| fs::read_to_string(folder.join(name)).expect("a page").contains(said);
    assert_eq!(["clean.html", "info.html", "whole.html"].map(page), [true, true, false]);
}

#[test]
fn two_trials_of_one_name_have_an_edit_list_each() {
    let Some(folder) = trials("twins") else { return };
    fs::create_dir_all(folder.join("raw")).expect("a folder");
    fs::rename(folder.join("walk.c3d"), folder.join("raw/walk.c3d")).expect("moved");
    let made = run(&folder, &["convert", "raw/walk.c3d", "raw/walk.trc"]);
    assert!(made.status.success(), "{}", words(&made));
    for round in 1..3 {
        let done = run(&folder, &["clean", "raw", "-o", "out", "--json", "--force"]);
        let report: Value = serde_json::from_slice(&done.stdout).expect("JSON");
        for (trial, number) in report["trials"].as_array().expect("a list").iter().zip(1..) {
            assert_eq!(trial["error"], Value::Null, "round {round}, trial {number}: {report:#}");
        }
    }
    for list in ["out/walk.c3d.edits.toml", "out/walk.trc.edits.toml"] {
        assert!(folder.join(list).exists(), "{list}");
    }
}

#[test]
fn what_no_edit_list_and_no_rate_is_is_refused_and_leaves_nothing() {
    let Some(folder) = trials("refused") else { return };
    let made = std::process::Command::new("mkfifo").arg(folder.join("pipe")).status();
    assert!(made.is_ok_and(|of| of.success()), "a pipe");
    let before = fs::read_dir(&folder).expect("a folder").count();
    for (arguments, said) in [
        ("clean walk.c3d -o o.c3d --edits pipe", "an edit list is a file"),
        ("clean walk.c3d -o o.c3d --edits /dev/zero", "an edit list is a file"),
        ("clean walk.c3d -o o.c3d --rate NaN", "0.1 to 100000 Hz"),
        ("clean walk.c3d -o o.c3d --rate -7", "0.1 to 100000 Hz"),
        ("clean walk.c3d --check --rate 0", "0.1 to 100000 Hz"),
        ("convert walk.c3d o.csv --rate inf", "0.1 to 100000 Hz"),
        ("info walk.c3d --rate 0", "0.1 to 100000 Hz"),
        ("fit walk.c3d --static static.c3d -o o.bvh --rate NaN", "0.1 to 100000 Hz"),
        ("clean walk.c3d -o o.c3d --html /dev/full --force", "cannot write the file"),
        ("clean walk.c3d -o /dev/full --html o.html --force", "cannot"),
    ] {
        let done = run(&folder, &arguments.split(' ').collect::<Vec<&str>>());
        assert!(matches!(done.status.code(), Some(1..=3)), "{arguments}: {}", words(&done));
        assert!(words(&done).contains(said), "{arguments}: {}", words(&done));
        assert_eq!(fs::read_dir(&folder).expect("a folder").count(), before, "{arguments}");
    }
    let told = run(&folder, &["convert", "walk.c3d", "o.csv", "--rate", "50"]);
    assert!(words(&told).contains("the file says 100 frames per second; taken as 50"), "{told:?}");
    let alike = run(&folder, &["convert", "walk.c3d", "p.csv", "--rate", "100"]);
    assert!(!words(&alike).contains("as told"), "{}", words(&alike));
}

#[test]
fn zeros_are_no_places_to_a_fit_and_samples_far_away_are_told() {
    let Some(folder) = trials("zeros") else { return };
    for (to, held) in [("zero", 0.0), ("far", 2e3), ("unseen", f64::NAN)] {
        let table =
            changed(
                &folder,
                "LANK",
                |frame, place| {
                    if (120..135).contains(&frame) { [held; 3] } else { place }
                },
            );
        fs::write(folder.join(format!("{to}.csv")), table.replace("NaN", "")).expect("written");
    }
    let fitted = |file: &str| {
        let done = run(&folder, &["fit", file, "--static", "static.c3d", "-o", "o.csv", "--force"]);
        assert!(matches!(done.status.code(), Some(0 | 3)), "{}", words(&done));
        (words(&done), fs::read(folder.join("o.csv")).expect("angles"))
    };
    let [zero, far, unseen] = ["zero.csv", "far.csv", "unseen.csv"].map(fitted);
    assert!(zero.1 == unseen.1 && far.1 == unseen.1, "the angles are the same");
    assert!(zero.0.contains("15 samples of 1 marker are at the very origin"), "{}", zero.0);
    assert!(far.0.contains("15 samples of 1 marker are farther than 1000 m away"), "{}", far.0);
    let done = run(&folder, &["clean", "far.csv", "-o", "cleaned.csv"]);
    assert!(words(&done).contains("farther than 1000 m away"), "{}", words(&done));
}
