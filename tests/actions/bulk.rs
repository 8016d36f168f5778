//! Corpora as others read them: pyarrow finds the samples of the single path in a Parquet file, and
//! works them out again from the actionlets beside it. A run that is killed is taken up to the same
//! bytes, and memory does not grow with what is made.

use crate::aloud::aloud;
use crate::python;
use serde_json::Value;
use std::fs;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

/// Half a unit in the last place of `value` in single precision, and of the ninth decimal of the
/// table.
fn rounding(value: f64) -> f64 {
    value.abs() * f64::from(f32::EPSILON) / 2.0 + 1e-9
}

fn gaitway(arguments: &[&str]) -> Command {
    let mut command = crate::program::gaitway();
    command.args(arguments);
    command
}

fn made(mut command: Command) -> Value {
    let output = command.arg("--json").output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{command:?}: {said}");
    serde_json::from_slice(&output.stdout).expect("a JSON report")
}

fn refused(mut command: Command, words: &[&str]) {
    let output = command.output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{command:?}: {said}");
    for word in words {
        assert!(said.contains(word), "{word:?} is not in:\n{said}");
    }
}

/// Reads both files with pyarrow and works out every angle again from the actionlets, in the words
/// of the paper: y = a + 2 delta S(u), S by Eqs. 1 and 4.
const SCRIPT: &str = r#"
import json, sys
import numpy as np
import pyarrow.parquet as pq

def integral(v):
    # Cubics through even samples, level at both ends, else with the harmonic mean of the slopes.
    d = np.diff(v)
    same = d[:-1] * d[1:] > 0
    mean = np.divide(2 * d[:-1] * d[1:], d[:-1] + d[1:], out=np.zeros(len(d) - 1), where=same)
    m = np.concatenate(([0.0], mean, [0.0]))
    w = np.linspace(0, 1, 2001)[:-1, None]
    square, cube = 3 * d - 2 * m[:-1] - m[1:], m[:-1] + m[1:] - 2 * d
    rises = v[:-1] + m[:-1] * w + square * w**2 + cube * w**3
    rises = np.append(rises.T.ravel(), v[-1])
    u = np.linspace(0, 1, len(rises))
    area = np.concatenate(([0.0], np.cumsum((rises[1:] + rises[:-1]) / 2 * np.diff(u))))
    assert abs(area[-1] - 1) < 1e-6
    return u, area

poses, pieces = (pq.ParquetFile(path) for path in sys.argv[1:3])
table, made_of = poses.read(), pieces.read()
angles = table.column_names[2:24]
variation = table["variation"].to_numpy()
time_s = table["time_s"].to_numpy().astype(float)
column = {name: made_of[name].to_numpy() for name in made_of.column_names}
worst = 0.0
for row in range(made_of.num_rows):
    of = {name: values[row] for name, values in column.items()}
    end_s = of["begin_s"] + of["duration_s"]
    here = (variation == of["variation"]) & (of["begin_s"] <= time_s) & (time_s <= end_s)
    u = (time_s[here] - of["begin_s"]) / of["duration_s"]
    a, delta, T = of["from_rad"], of["to_rad"] - of["from_rad"], of["peak"]
    if of["shape"] == 0:
        assert delta == 0.0
        y = np.full(u.shape, a)
    elif of["shape"] == 3:
        v = of["samples"]
        y = a + delta * np.interp(u, *integral(v))
    else:
        assert of["shape"] == 1
        assert len(of["samples"]) == 0
        up = u / 2 - T / (2 * np.pi) * np.sin(np.pi * u / T)
        down = u / 2 + (1 - T) / (2 * np.pi) * np.sin(np.pi * (u - T) / (1 - T))
        y = a + 2 * delta * np.where(u <= T, up, down)
    got = table[angles[of["dof"]]].to_numpy()[here]
    worst = max(worst, np.abs(got - y).max(initial=0.0))
print(json.dumps({
    "names": table.column_names,
    "row_groups": [poses.num_row_groups, pieces.num_row_groups],
    "about": json.loads(poses.schema_arrow.metadata[b"gaitway"]),
    "worst_rad": float(worst),
    "covered": sorted(set(zip(column["variation"].tolist(), column["dof"].tolist()))),
    "sampled": [len(v) for v, kind in zip(column["samples"], column["shape"]) if kind == 3],
    "columns": [table[name].to_pylist() for name in table.column_names[:27]],
}))
"#;

fn seen_by(python: &Path, poses: &Path, pieces: &Path) -> Value {
    let output = Command::new(python).args(["-c", SCRIPT]).args([poses, pieces]).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// Rows of a table: time, angles and root.
fn rows(table: &Path) -> Vec<Vec<f64>> {
    let text = fs::read_to_string(table).unwrap();
    let lines = text.lines().skip(1);
    lines.map(|line| line.split(',').map(|value| value.parse().unwrap()).collect()).collect()
}

#[test]
fn another_reader_finds_the_samples_of_the_single_path() {
    let python = match python::python() {
        Ok(python) => python.program,
        Err(cause) => {
            aloud!("SKIPPED: no Python with pyarrow, nothing was compared: {cause}");
            return;
        }
    };
    let folder = crate::program::folder("read");
    let out = folder.join("run.parquet");
    let given = ["run:x2", "--seed", "9", "--rate", "120"];
    let synth = |more: &[&str]| made(gaitway(&[&["synth"][..], &given, more].concat()));
    let report = synth(&["--variations", "5", "-o", out.to_str().unwrap()]);
    let found = seen_by(&python, &out, &folder.join("run.actionlets.parquet"));
    let columns: Vec<Vec<f64>> = serde_json::from_value(found["columns"].clone()).unwrap();
    assert_eq!(columns.len(), 27);
    assert_eq!(columns[0].len() as u64, report["poses"].as_u64().unwrap());
    assert_eq!(found["names"][1], "time_s");
    assert_eq!(found["names"][2], "torso_flexion_rad");
    assert_eq!(found["names"][24], "root_x_m");
    assert_eq!(found["about"]["seed"], 9);
    assert_eq!(found["about"]["classes"][0]["variations"], 5);
    // Times are single as well: at the greatest speed of a run, 20 rad/s, half a unit is 5e-6 rad.
    let worst_rad = found["worst_rad"].as_f64().unwrap();
    aloud!("{} poses; from the actionlets again within {worst_rad:.1e} rad", columns[0].len());
    assert!(worst_rad < 5e-6, "{worst_rad}");
    assert_eq!(found["covered"].as_array().unwrap().len(), 5 * 22);
    for number in 0..5 {
        let table = folder.join(format!("{number}.csv"));
        let path = table.to_str().unwrap();
        synth(&["--variation", &number.to_string(), "-o", path]);
        let alone = rows(&table);
        let at = |row: &usize| columns[0][*row] == f64::from(number);
        let together: Vec<usize> = (0..columns[0].len()).filter(at).collect();
        assert_eq!(together.len(), alone.len(), "variation {number}");
        for (row, alone) in together.into_iter().zip(&alone) {
            // How the pelvis is turned stands in the table alone.
            for (column, value) in alone.iter().enumerate().skip(1).take(25) {
                let got = columns[column + 1][row];
                assert!((got - value).abs() <= rounding(*value), "{number}: {got} is not {value}");
            }
        }
    }
}

#[test]
fn sampled_velocity_functions_are_in_the_corpus() {
    let python = match python::python() {
        Ok(python) => python.program,
        Err(cause) => {
            aloud!("SKIPPED: no Python with pyarrow, nothing was compared: {cause}");
            return;
        }
    };
    let folder = crate::program::folder("sampled");
    let (nod, out) = (folder.join("nod.toml"), folder.join("nod.parquet"));
    let text = "schema = 1\nname = \"nod\"\nduration_s = 1.0\n\
                [shapes]\nlate = [0, 1, 2, 6, 9, 4, 0]\n[[group]]\nname = \"neck\"\n\
                kind = \"joint\"\n\
                turns.neck_flexion = [[0.5, 20, \"late\"], [0.7, 3], [1, 0, 0.4]]\n";
    fs::write(&nod, text).unwrap();
    let mut command = gaitway(&["synth", "--variations", "3", "--set", "vary_exchange=0", "-o"]);
    command.arg(&out).arg(&nod);
    made(command);
    let found = seen_by(&python, &out, &folder.join("nod.actionlets.parquet"));
    let worst_rad = found["worst_rad"].as_f64().unwrap();
    assert!(worst_rad < 5e-6, "{worst_rad}");
    assert_eq!(found["sampled"], serde_json::json!([7, 7, 7]));
}

fn names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).unwrap();
    let mut names: Vec<String> =
        entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

/// Looks again and again until `done` says so or the child has ended.
fn watch(child: &mut Child, mut done: impl FnMut(&Child) -> bool) {
    while child.try_wait().unwrap().is_none() && !done(child) {
        std::thread::sleep(Duration::from_millis(1));
    }
}

#[test]
fn a_run_that_is_killed_is_taken_up_to_the_same_bytes_on_any_number_of_processors() {
    let folder = crate::program::folder("kill");
    let (whole, killed) = (folder.join("whole"), folder.join("killed"));
    let arguments = |out: &Path| {
        let given = ["synth", "wave-l:0.5s", "--rate", "10", "--variations", "7501", "-o"];
        let mut all: Vec<String> = given.map(str::to_owned).to_vec();
        all.push(out.to_str().unwrap().to_owned());
        all
    };
    let mut child = gaitway(&[])
        .args(arguments(&killed))
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let whole_sets = || {
        let names =
            fs::read_dir(&killed).into_iter().flatten().map(|entry| entry.unwrap().file_name());
        let names = names.map(|name| name.into_string().unwrap());
        names.filter(|name| name.starts_with("variations") && !name.ends_with(".part")).count()
    };
    watch(&mut child, |_| whole_sets() > 0);
    child.kill().unwrap();
    child.wait().unwrap();
    let kept = whole_sets() as u64;
    // Of 1,250 variations each.
    assert!(kept < 6, "it ended before it was killed");
    let mut again = gaitway(&[]);
    again.args(arguments(&killed));
    let found = made(again)["found"].as_u64().unwrap();
    assert_eq!(found, kept * 1_250);
    // On one processor, where a machine can be told so.
    let mut alone = Command::new("taskset");
    alone.args(["-c", "0", crate::program::PATH]).args(arguments(&whole)).arg("--json");
    if !alone.output().is_ok_and(|output| output.status.success()) {
        aloud!("SKIPPED: no taskset, compared with a run on as many processors");
        let mut command = gaitway(&[]);
        command.args(arguments(&whole));
        made(command);
    }
    assert_eq!(names(&whole), names(&killed));
    for name in names(&whole) {
        let [a, b] = [&whole, &killed].map(|folder| fs::read(folder.join(&name)).unwrap());
        assert!(a == b, "{name} differs");
    }
    fs::remove_dir_all(folder).unwrap();
}

/// Most memory a process has held so far, bytes; none once it has ended.
fn peak_bytes(child: &Child) -> Option<u64> {
    let status = fs::read_to_string(format!("/proc/{}/status", child.id())).ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    line.trim().strip_suffix(" kB")?.trim().parse::<u64>().ok().map(|kb| kb * 1024)
}

#[test]
fn memory_does_not_grow_with_what_is_made() {
    let folder = crate::program::folder("memory");
    let held = |variations: u64| {
        let out = folder.join(format!("{variations}.parquet"));
        let mut command = gaitway(&["synth", "box-r:x10", "--rate", "300", "--variations"]);
        command.arg(variations.to_string()).arg("-o").arg(&out).stdout(Stdio::null());
        let mut child = command.spawn().unwrap();
        let mut most = 0;
        watch(&mut child, |child| {
            most = peak_bytes(child).unwrap_or(0).max(most);
            false
        });
        assert!(child.wait().unwrap().success());
        (most, fs::metadata(&out).unwrap().len())
    };
    let [(few, little), (many, much)] = [250, 1000].map(held);
    aloud!(
        "{} MB written with {} MB of memory, {} with {}",
        little >> 20,
        few >> 20,
        much >> 20,
        many >> 20
    );
    // What is written is pressed to a part of what is made.
    assert!(few > 0 && much > 3 * little);
    assert!(many < few + (much - little) / 2, "{many} bytes held, {few} for a quarter");
    fs::remove_dir_all(folder).unwrap();
}

/// An action file of somebody who nods.
fn nodding(angle_deg: i32) -> String {
    format!(
        "schema = 1\nname = \"nod\"\nduration_s = 1.0\n[[group]]\nname = \"neck\"\n\
         kind = \"joint\"\nturns.neck_flexion = [[0.5, {angle_deg}], [1.0, 0]]\n"
    )
}

#[test]
fn a_corpus_whose_action_was_edited_is_not_taken_up() {
    let folder = crate::program::folder("edited");
    let (nod, out) = (folder.join("nod.toml"), folder.join("corpus"));
    let synth = || {
        let mut command = gaitway(&["synth", "--variations", "3", "-o"]);
        command.arg(&out).arg(&nod);
        command
    };
    fs::write(&nod, nodding(20)).unwrap();
    assert_eq!(made(synth())["found"], 0);
    assert_eq!(made(synth())["found"], 3);
    fs::write(&nod, nodding(21)).unwrap();
    refused(synth(), &["another corpus", "fingerprint"]);
    // What stands where the catalogue or the folder is to be is not waited for, nor written over.
    let catalogue = out.join("corpus.json");
    fs::remove_file(&catalogue).unwrap();
    let made_pipe = Command::new("mkfifo").arg(&catalogue).status();
    assert!(made_pipe.is_ok_and(|status| status.success()));
    refused(synth(), &["not the catalogue of a corpus", "it is no file"]);
    fs::remove_dir_all(&out).unwrap();
    fs::write(&out, "precious").unwrap();
    refused(synth(), &["this is a file, not a folder", "corpus"]);
    assert_eq!(fs::read(&out).unwrap(), b"precious");
    // What cannot be made is refused by name.
    let path = folder.join("three.csv");
    let path = path.to_str().unwrap();
    refused(gaitway(&["synth", "bow", "--variations", "3", "-o", path]), &["--variation NUMBER"]);
    assert!(!Path::new(path).exists());
}

/// Reads a labelled corpus with three programs and holds them to one another, and the tables too.
const READERS: &str = r#"
import glob, json, sys
import duckdb, numpy as np, polars as pl, pyarrow.dataset as ds, pyarrow.parquet as pq

folder = sys.argv[1]
files = folder + "/poses-*.parquet"
counts = "select label, class, count(distinct variation), count(*) from '%s' group by all order by all"
by_duckdb = [list(row) for row in duckdb.sql(counts % files).fetchall()]
of = pl.scan_parquet(files).group_by("label", "class")
of = of.agg(pl.col("variation").n_unique(), pl.len()).sort("label", "class").collect()
by_polars = [list(row) for row in of.rows()]
table = ds.dataset(sorted(glob.glob(files))).to_table()
labels = np.array(table["label"].to_pylist())
classes = np.array(table["class"].to_pylist())
number = table["variation"].to_numpy()
by_pyarrow = [
    [label, classes[labels == label][0], len(set(number[labels == label])), int((labels == label).sum())]
    for label in sorted(set(labels.tolist()))
]
rows = duckdb.sql(f"select * from '{folder}/variations-*.parquet' order by label, variation")
rows = [dict(zip(rows.columns, row)) for row in rows.fetchall()]
for row in rows:
    file = pq.ParquetFile(folder + "/" + row["file"])
    group = file.read_row_group(row["row_group"], ["variation", "label"])
    before = sum(file.metadata.row_group(i).num_rows for i in range(row["row_group"]))
    here = group.slice(row["first_row"] - before, row["rows"])
    assert set(here["variation"].to_pylist()) == {row["variation"]}
    assert set(here["label"].to_pylist()) == {row["label"]}
    assert here.num_rows == row["rows"] == int(row["duration_s"] * 60 + 1e-6) + 1
of = duckdb.sql("select label, class, count(distinct variation) from '%s/actionlets-*.parquet' "
                "group by all order by all" % folder)
actionlets = [list(row) for row in of.fetchall()]
point = lambda name: np.stack([table[f"{name}_{a}_m"].to_numpy().astype(float) for a in "xyz"], 1)
root = np.stack([table[f"root_{a}_m"].to_numpy() for a in "xyz"], 1)
bones = [("left_hip", "left_knee"), ("right_elbow", "right_wrist"), ("neck", "head_top")]
lengths = [np.linalg.norm(point(a) - point(b), axis=1) for a, b in bones]
low = {sole: point(sole)[:, 2] for sole in ["left_heel", "left_toe", "right_heel", "right_toe"]}
carries = {sole: table["contact_" + sole].to_numpy(zero_copy_only=False) for sole in low}
metadata = pq.ParquetFile(sorted(glob.glob(files))[0]).metadata
columns = [metadata.row_group(0).column(i) for i in range(metadata.num_columns)]
print(json.dumps({
    "seeds": sorted({row["seed"] for row in rows}),
    "actionlets": actionlets,
    "counts": [by_duckdb, by_polars, by_pyarrow],
    "rows": len(rows),
    "status": {
        label: sorted({row["status"] for row in rows if row["label"] == label})
        for label in sorted(set(labels.tolist()))
    },
    "subjects": len({row["subject"] for row in rows}),
    "stature_m": rows[0]["stature_m"],
    "rounds": rows[-1]["rounds"],
    "root_off_m": float(np.abs(point("pelvis") - root).max()),
    "stretch_m": float(max(np.ptp(length) for length in lengths)),
    "carries_high_m": max(float(low[sole][carries[sole]].max()) for sole in low),
    "carried": float(np.any(list(carries.values()), axis=0).mean()),
    "codecs": sorted({column.compression for column in columns}),
    "split": sum("BYTE_STREAM_SPLIT" in column.encodings for column in columns),
    "with_statistics": sum(column.is_stats_set for column in columns),
    "columns": len(columns),
}))
"#;

#[test]
fn three_programs_read_a_labelled_corpus_alike() {
    let python = match python::python() {
        Ok(python) => python.program,
        Err(cause) => {
            aloud!("SKIPPED: no Python with duckdb, polars and pyarrow: {cause}");
            return;
        }
    };
    let folder = crate::program::folder("labelled").join("corpus");
    let mut command = gaitway(&["synth", "--class", "strolling=walk:x4", "--class"]);
    command.args(["greeting:7=bow:0.5s,wave-r", "--variations", "90", "--rate", "60"]);
    command.args(["--seed", &u64::MAX.to_string(), "-o"]);
    let made = command.arg(&folder).arg("--json").output().unwrap();
    // Nobody bows in half a second.
    assert_eq!(made.status.code(), Some(3), "{}", String::from_utf8_lossy(&made.stderr));
    let report: Value = serde_json::from_slice(&made.stdout).expect("a JSON report");
    assert_eq!(report["variations"], 97);
    let output = Command::new(&python).args(["-c", READERS]).arg(&folder).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let found: Value = serde_json::from_slice(&output.stdout).unwrap();
    let counts = &found["counts"];
    assert_eq!(counts[0], counts[1]);
    assert_eq!(counts[0], counts[2]);
    let expected = [("greeting", "bow,wave-r", 7), ("strolling", "walk", 90)];
    for (index, (label, class, variations)) in expected.into_iter().enumerate() {
        let row = &counts[0][index];
        assert_eq!(row[0], label);
        assert_eq!(row[1], class);
        assert_eq!(row[2], variations);
    }
    let poses = counts[0][0][3].as_u64().unwrap() + counts[0][1][3].as_u64().unwrap();
    assert_eq!(report["poses"], poses);
    assert_eq!(found["rows"], 97);
    assert_eq!(found["seeds"], serde_json::json!([u64::MAX]));
    assert_eq!(
        found["actionlets"],
        serde_json::json!([["greeting", "bow,wave-r", 7], ["strolling", "walk", 90]])
    );
    assert_eq!(found["rounds"], 4);
    assert_eq!(found["stature_m"], 1.75);
    assert_eq!(found["subjects"], 1);
    // The feet of walks hold, some of them after a repair.
    assert_eq!(found["status"]["greeting"], serde_json::json!(["implausible"]));
    let strolling = found["status"]["strolling"].as_array().unwrap();
    assert!(strolling.contains(&"valid".into()), "{strolling:?}");
    assert!(!strolling.contains(&"implausible".into()), "{strolling:?}");
    // Points are kept to 1/16384 m: half of it off on each axis.
    let below = |key: &str, most: f64| {
        let value = found[key].as_f64().unwrap();
        assert!(value <= most, "{key}: {value}");
    };
    below("root_off_m", 0.5 / 16_384.0 + 1e-6);
    below("stretch_m", 4.0 * 0.87 / 16_384.0 + 1e-6);
    assert_eq!(found["codecs"], serde_json::json!(["ZSTD"]));
    assert_eq!(found["with_statistics"], found["columns"]);
    // Angles, root, orientation, points.
    assert_eq!(found["split"], 22 + 3 + 4 + 66);
    assert!(found["carried"].as_f64().unwrap() > 0.5, "{found}");
    aloud!("{poses} poses of two classes: DuckDB, Polars and PyArrow count alike");
}

#[test]
fn a_corpus_grows_into_the_bytes_of_one_that_was_made_at_once() {
    let folder = crate::program::folder("grown");
    let synth = |out: &str, given: &[&str], rest: &[&str]| {
        let mut command = gaitway(&["synth", "--rate", "10", "--variations"]);
        command.args(given).args(rest).arg("-o").arg(folder.join(out));
        command
    };
    let (nods, waves) = (["--class", "nodding=wave-l:0.5s"], ["--class", "waving:40=wave-r"]);
    let both = [nods, waves].concat();
    made(synth("grown", &["300"], &nods));
    assert_eq!(made(synth("grown", &["1300"], &nods))["found"], 0, "the last file is made anew");
    let grown = made(synth("grown", &["2000"], &nods));
    assert_eq!((&grown["found"], &grown["mended"]), (&1_250.into(), &Value::Array(Vec::new())));
    assert_eq!(made(synth("grown", &["1"], &waves))["found"], 0, "another class");
    assert_eq!(made(synth("grown", &["2000"], &both))["found"], 2_040);
    made(synth("once", &["2000"], &both));
    let (grown, once) = (folder.join("grown"), folder.join("once"));
    assert_eq!(names(&grown), names(&once));
    assert_eq!(names(&once).len(), 3 * 3 + 1);
    for name in names(&once) {
        let [a, b] = [&grown, &once].map(|folder| fs::read(folder.join(&name)).unwrap());
        assert!(a == b, "{name} differs");
    }
    for (given, words) in [
        (&["2000", "--seed", "1"][..], "--seed 0 (asked for: 1)"),
        (&["2000", "--set", "vary_angle=0.2"], "--set [] (asked for: [vary_angle=0.2])"),
        (&["2000", "--set", "stature_m=1.6"], "body body-"),
        (&["2000", "--no-points"], "points true (asked for: false)"),
        (&["1999"], "variations of nodding 2000 (asked for: 1999, fewer)"),
    ] {
        refused(synth("grown", given, &nods), &["another corpus", words]);
    }
    let other = ["--class", "nodding=bow"];
    refused(synth("grown", &["2000"], &other), &["action of nodding wave-l:0.5s (asked for: bow)"]);
    let twice = [nods, other].concat();
    refused(synth("new", &["3"], &twice), &["two classes have one label", "nodding"]);
    assert!(!folder.join("new").exists());
    assert_eq!(names(&grown), names(&once), "what was refused left nothing behind");
}

#[test]
fn parts_that_several_processes_make_at_once_are_the_files_of_the_whole() {
    let folder = crate::program::folder("shares");
    let given = ["synth", "--class", "nod=wave-l:0.5s", "--class", "bow:1400=bow"];
    let synth = |out: &str, part: &str| {
        let mut command = gaitway(&given);
        command.args(["--rate", "10", "--variations", "5001", "-o"]).arg(folder.join(out));
        if !part.is_empty() {
            command.args(["--part", part]);
        }
        command
    };
    made(synth("whole", ""));
    let begin = |part: &str| {
        let mut command = synth("parts", part);
        command.arg("--json").stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap()
    };
    // All at once; the second is killed at some time, and made again.
    let mut running = ["1/3", "2/3", "3/3"].map(begin);
    let (first, rest) = running.split_first_mut().expect("three");
    watch(&mut rest[0], |_| folder.join("parts").is_dir());
    rest[0].kill().unwrap();
    assert!(first.wait().unwrap().success() && rest[1].wait().unwrap().success());
    running.into_iter().for_each(|mut child| drop(child.wait()));
    let one = made(synth("parts", "1/3"));
    assert_eq!(one["part"], serde_json::json!([1, 3]));
    assert_eq!((&one["found"], &one["poses"]), (&one["variations"], &0.into()), "it was there");
    made(synth("parts", "2/3"));
    let all = made(synth("parts", ""));
    assert_eq!((&all["found"], &all["poses"]), (&6_401.into(), &0.into()), "nothing is missing");
    let (whole, parts) = (folder.join("whole"), folder.join("parts"));
    assert_eq!(names(&whole), names(&parts));
    for name in names(&whole) {
        let [a, b] = [&whole, &parts].map(|folder| fs::read(folder.join(&name)).unwrap());
        assert!(a == b, "{name} differs");
    }
    refused(synth("one.parquet", "1/3"), &["not made in parts", "1/3", "folder"]);
    refused(synth("parts", "4/3"), &["no part", "4/3", "K/N"]);
    fs::remove_dir_all(folder).unwrap();
}

/// The example as it is given to others, with two workers on this machine.
#[test]
fn parts_that_ray_has_made_are_the_files_of_the_whole() {
    let python = match python::python() {
        Ok(python) => python,
        Err(why) => return aloud!("SKIPPED: no Python environment: {why}"),
    };
    let folder = crate::program::folder("ray");
    let given = ["synth", "wave-l:0.5s", "--rate", "10", "--variations", "7000", "-o"];
    let mut whole = gaitway(&given);
    whole.arg(folder.join("whole"));
    made(whole);
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/corpus_with_ray.py");
    let with_ray = "import ray, runpy, sys; begin = ray.init; \
                    ray.init = lambda **given: begin(num_cpus=2, **given); \
                    sys.argv = sys.argv[1:]; runpy.run_path(sys.argv[0], run_name='__main__')";
    let output = Command::new(&python.program)
        .args(["-c", with_ray, script, "3", crate::program::PATH])
        .args(given)
        .arg(folder.join("ray"))
        .env("RAY_USAGE_STATS_ENABLED", "0")
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", crate::program::words(&output));
    let report: Value = serde_json::from_slice(&output.stdout).expect("a JSON report");
    assert_eq!((&report["parts"], &report["whole"]["found"]), (&3.into(), &7_000.into()));
    assert_eq!(report["whole"]["poses"], 0, "nothing was missing");
    let (whole, parts) = (folder.join("whole"), folder.join("ray"));
    assert_eq!(names(&whole), names(&parts));
    for name in names(&whole) {
        let [a, b] = [&whole, &parts].map(|folder| fs::read(folder.join(&name)).unwrap());
        assert!(a == b, "{name} differs");
    }
    fs::remove_dir_all(folder).unwrap();
}

/// A small file system of its own for a command line; none where this user may not have one.
fn on_small_disk(folder: &Path, size: &str, script: &str) -> Option<std::process::Output> {
    let disk = folder.join("disk");
    fs::create_dir_all(&disk).unwrap();
    let script = format!("mount -t tmpfs -o size={size} none \"$1\" || exit 77\n{script}");
    let mut command = Command::new("unshare");
    command.args(["--map-root-user", "--mount", "sh", "-c", &script, "sh"]);
    let output = command.arg(&disk).arg(crate::program::PATH).output();
    let output = output.ok().filter(|output| ![Some(77), None].contains(&output.status.code()));
    if output.as_ref().is_none_or(|o| String::from_utf8_lossy(&o.stderr).contains("unshare")) {
        aloud!("SKIPPED: no small file system to fill (unshare, tmpfs)");
        return None;
    }
    output
}

#[test]
fn no_room_is_said_before_anything_is_written() {
    let folder = crate::program::folder("small");
    let script = "\"$2\" synth walk --variations 5000 -o \"$1/corpus\"; echo $?; ls \"$1\"";
    let Some(output) = on_small_disk(&folder, "4m", script) else { return };
    assert_eq!(String::from_utf8_lossy(&output.stdout), "1\n", "nothing is there");
    let said = String::from_utf8_lossy(&output.stderr);
    let place = folder.join("disk/corpus").display().to_string();
    for word in ["no room for the corpus", &place, "4.2 MB of room", "about ", "make room"] {
        assert!(said.contains(word), "{word:?} is not in:\n{said}");
    }
}

#[test]
fn a_disk_that_fills_up_leaves_whole_files_and_what_is_made_again_is_the_same() {
    let folder = crate::program::folder("filled");
    let nod = folder.join("nod.toml");
    fs::write(&nod, nodding(20)).unwrap();
    let class = format!("nodding={}", nod.display());
    let order = ["synth", "--class", &class, "--variations", "7500", "--no-points", "-o"];
    let words = order.map(|word| format!("'{word}'")).join(" ");
    let script = format!(
        "\"$2\" {words} \"$1/corpus\" & \n\
         while ! ls \"$1\"/corpus/*.part; do sleep 0.01; done >/dev/null 2>&1\n\
         cat /dev/zero >\"$1/filler\" 2>/dev/null\n\
         wait $!; echo code $?; ls \"$1/corpus\"; rm \"$1/filler\"\n\
         \"$2\" {words} \"$1/corpus\" && cp -r \"$1/corpus\" \"$1.kept\""
    );
    let Some(output) = on_small_disk(&folder, "150m", &script) else { return };
    let heard = String::from_utf8_lossy(&output.stdout);
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(heard.contains("code 1\n") && !heard.contains(".part"), "{heard}{said}");
    let place = folder.join("disk/corpus/poses-nodding-").display().to_string();
    for word in ["the disk is full", &place, "0.0 MB of room", "about ", "make room"] {
        assert!(said.contains(word), "{word:?} is not in:\n{said}");
    }
    let once = folder.join("once");
    let mut command = gaitway(&order);
    command.arg(&once);
    made(command);
    let kept = folder.join("disk.kept");
    assert_eq!(names(&kept), names(&once));
    for name in names(&once) {
        assert!(
            fs::read(kept.join(&name)).unwrap() == fs::read(once.join(&name)).unwrap(),
            "{name}"
        );
    }
    fs::remove_dir_all(folder).unwrap();
}

#[test]
fn what_is_found_and_is_not_what_was_made_is_made_anew_and_said() {
    let folder = crate::program::folder("mended");
    let synth = |out: &Path, seed: &str| {
        let mut command =
            gaitway(&["synth", "--class", "a=wave-l:0.5s", "--class", "b=wave-r:0.5s"]);
        command.args(["--rate", "10", "--variations", "1300", "--seed", seed, "-o"]).arg(out);
        made(command)
    };
    let (whole, other) = (folder.join("whole"), folder.join("other"));
    synth(&whole, "1");
    synth(&other, "2");
    let given = names(&whole);
    let bytes: Vec<Vec<u8>> = given.iter().map(|n| fs::read(whole.join(n)).unwrap()).collect();
    let damaged = |name: &str, damage: &dyn Fn(&Path)| {
        damage(&whole.join(name));
        let report = synth(&whole, "1");
        let mended = report["mended"].as_array().unwrap().clone();
        assert_eq!(mended.len(), 1, "{name}: {mended:?}");
        for (name, bytes) in given.iter().zip(&bytes) {
            assert!(fs::read(whole.join(name)).unwrap() == *bytes, "{name} differs");
        }
        assert_eq!(names(&whole), given);
        mended[0].as_str().unwrap().to_owned()
    };
    let cut = |parts: usize| {
        move |path: &Path| {
            let bytes = fs::read(path).unwrap();
            fs::write(path, &bytes[..bytes.len() * parts / 10]).unwrap();
        }
    };
    for table in ["poses", "actionlets", "variations"] {
        let name = format!("{table}-a-000000.parquet");
        for parts in [0, 5, 9] {
            assert!(damaged(&name, &cut(parts)).contains(&name), "{name}");
        }
        let grown = |path: &Path| {
            let bytes = fs::read(path).unwrap();
            fs::write(path, [&bytes[..4], &bytes].concat()).unwrap();
        };
        damaged(&name, &grown);
        // Whole, but of another class, another seed, another part of the class.
        damaged(&name, &|path| {
            fs::copy(whole.join(format!("{table}-b-000000.parquet")), path).map(drop).unwrap();
        });
        damaged(&name, &|path| fs::copy(other.join(&name), path).map(drop).unwrap());
        damaged(&name, &|path| {
            fs::copy(whole.join(format!("{table}-a-000001.parquet")), path).map(drop).unwrap();
        });
        damaged(&name, &|path| fs::write(path, "no table").unwrap());
    }
    // All three of another part.
    damaged("poses-a-000000.parquet", &|_| {
        for table in ["poses", "actionlets", "variations"] {
            let [from, to] = [1, 0].map(|n| whole.join(format!("{table}-a-00000{n}.parquet")));
            fs::copy(from, to).unwrap();
        }
    });
    // What is none of ours is said in words as well, and a folder stays.
    let poses = whole.join("poses-b-000000.parquet");
    fs::remove_file(&poses).unwrap();
    fs::create_dir(&poses).unwrap();
    let mut command = gaitway(&["synth", "--class", "a=wave-l:0.5s", "--class", "b=wave-r:0.5s"]);
    command.args(["--rate", "10", "--variations", "1300", "--seed", "1", "-o"]).arg(&whole);
    refused(command, &["cannot write the corpus", "poses-b-000000.parquet"]);
    assert!(poses.is_dir() && !names(&whole).iter().any(|name| name.ends_with(".part")));
}

#[test]
fn labels_that_look_alike_in_names_of_files_keep_their_files() {
    let folder = crate::program::folder("alike").join("corpus");
    // The second is how the first was written in names of files.
    let labels = ["a b", "a-b-e0bf0bb6", "a-b", "A-b", "a/b", "../b"];
    let mut command = gaitway(&["synth", "--rate", "10", "--variations", "3", "-o"]);
    command.arg(&folder);
    for label in labels {
        command.args(["--class", &format!("{label}=wave-l:0.5s")]);
    }
    assert_eq!(made(command)["variations"], 18);
    assert_eq!(names(&folder).len(), 1 + 3 * labels.len(), "{:?}", names(&folder));
    assert_eq!(names(folder.parent().unwrap()), ["corpus"]);
}

/// Told to stop, once `when` says that it is at work; its exit code.
fn interrupted(mut command: Command, when: impl Fn(u32) -> bool) -> std::process::Output {
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    watch(&mut child, |child| when(child.id()));
    let pid = rustix::process::Pid::from_child(&child);
    rustix::process::kill_process(pid, rustix::process::Signal::INT).expect("a signal");
    let (tell, told) = std::sync::mpsc::channel();
    std::thread::spawn(move || tell.send(child.wait_with_output()));
    // To its end each would take many minutes.
    let output = told.recv_timeout(Duration::from_secs(20)).expect("it ends at once");
    output.unwrap()
}

/// Whether a process computes on a thread of its own.
fn is_at_work(process: u32) -> bool {
    let Ok(threads) = fs::read_dir(format!("/proc/{process}/task")) else { return false };
    let name = |thread: fs::DirEntry| fs::read_to_string(thread.path().join("comm")).ok();
    threads.flatten().filter_map(name).any(|name| name == "work\n")
}

#[test]
fn an_interrupt_ends_what_is_planned_and_what_is_made_at_once_and_leaves_whole_files_or_none() {
    let folder = crate::program::folder("interrupted");
    let out = folder.join("out.csv");
    let long = ["--json", "-o", out.to_str().unwrap()];
    for planned in [
        &["synth", "walk:900s", "--variation", "1"][..],
        &["retarget", "walk:900s", "--robot", "op3"],
        &["synth", "walk:300s", "--variations", "100000"],
    ] {
        let mut command = gaitway(planned);
        match planned.last() {
            Some(&"100000") => command.args(["--json", "-o"]).arg(folder.join("many.parquet")),
            _ => command.args(long),
        };
        let output = interrupted(command, is_at_work);
        assert_eq!(output.status.code(), Some(130), "{planned:?}");
        let report: Value = serde_json::from_slice(&output.stdout).expect("a report");
        assert_eq!(report["outcome"], "stopped");
        assert_eq!(names(&folder), [""; 0], "{planned:?}");
    }
    let played =
        gaitway(&["play", "walk:900s", "--robot", "op3", "--bus", "sim", "--hang", "--json"]);
    let output = interrupted(played, is_at_work);
    assert_eq!(output.status.code(), Some(130));
    let report: Value = serde_json::from_slice(&output.stdout).expect("a report");
    assert_eq!((&report["outcome"], &report["cycles"]), (&"stopped".into(), &0.into()));
    // In the midst of a corpus: what is whole stays, the rest is gone.
    let corpus = folder.join("corpus");
    let mut command = gaitway(&["synth", "wave-l:0.5s", "--rate", "10", "--variations", "1000000"]);
    command.args(["-o"]).arg(&corpus);
    let is_there = |ending: &str| {
        let entries = fs::read_dir(&corpus).into_iter().flatten().flatten();
        let mut names = entries.map(|entry| entry.file_name().into_string().unwrap());
        names.any(|name| name.ends_with(ending))
    };
    let is_under_way = |_| is_there("000000.parquet") && is_there(".part");
    let output = interrupted(command, is_under_way);
    assert_eq!(output.status.code(), Some(130));
    assert!(String::from_utf8_lossy(&output.stderr).contains("stopped before it was done"));
    assert!(is_there("000000.parquet") && !is_there(".part"), "{:?}", names(&corpus));
}
