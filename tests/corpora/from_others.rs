//! Motion databases of others, taken into a corpus with what they say of motions, people and times; and a corpus in the
//! hands of Polars, pandas and Spark.

use crate::aloud::aloud;
use crate::program::{folder, gaitway, json, words};
use crate::python;
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn run(args: &[&str]) -> Output {
    gaitway().args(args).arg("--json").output().expect("the program")
}

fn report(args: &[&str]) -> Value {
    let output = run(args);
    assert!(output.status.success(), "{args:?}: {}", words(&output));
    json(&output)
}

/// A folder in the layout of BONES-SEED: two motions that are there, one that is not. Its table is written by pandas.
fn seed(name: &str) -> Option<(PathBuf, PathBuf)> {
    let python = match python::python() {
        Ok(python) => python,
        Err(why) => {
            aloud!("SKIPPED: no Python environment: {why}");
            return None;
        }
    };
    let base = folder(name);
    let seed = base.join("seed");
    for inner in ["metadata", "soma_proportional/bvh/230711", "soma_uniform/bvh/230711"] {
        fs::create_dir_all(seed.join(inner)).expect("a folder");
    }
    for (action, kind, file) in [
        ("walk:3s", "soma_proportional", "walk_ff_001__A425"),
        // By both bodies: that of the actor is taken.
        ("walk:2s", "soma_uniform", "walk_ff_001__A425"),
        ("bow", "soma_uniform", "bow_001__A548_M"),
    ] {
        let file = seed.join(format!("{kind}/bvh/230711/{file}.bvh")).display().to_string();
        report(&["synth", action, "--rate", "30", "-o", &file]);
    }
    let script = "
import sys, pandas as pd
names = ['walk_ff_001__A425', 'bow_001__A548_M', 'jump_001__A425']
path = lambda kind: [f'soma_{kind}/bvh/230711/{n}.bvh' for n in names]
table = pd.DataFrame({
  'move_name': names, 'filename': names, 'move_duration_frames': [360, 200, 100],
  'package': ['Locomotion', 'Social', 'Locomotion'], 'category': ['Baseline', 'Gestures', 'Baseline'],
  'is_mirror': [False, True, False], 'content_type_of_movement': ['Walking', None, 'Jumping'],
  'actor_uid': ['A425', 'A548', 'A425'], 'actor_gender': ['F', 'M', 'F'], 'actor_age_yr': [31, None, 31],
  'actor_height_cm': [168, 181, 168], 'actor_weight_kg': [60.5, 80, 60.5],
  'move_soma_proportional_path': path('proportional'), 'move_soma_uniform_path': path('uniform'),
  'content_natural_desc_1': ['A person walks, \"slowly\".', None, 'x'],
})
table.to_parquet(sys.argv[1] + '/seed_metadata_v004.parquet')
table.to_csv(sys.argv[1] + '/seed_metadata_v003.csv', index=False)
";
    let metadata = seed.join("metadata");
    let wrote = Command::new(&python.program).args(["-c", script]).arg(&metadata).output();
    let wrote = wrote.expect("Python");
    assert!(wrote.status.success(), "{}", words(&wrote));
    let timeline = "{\"filename\": \"walk_ff_001__A425\", \"events\": [{\"start_time\": 0.0, \"end_time\": 1.0, \
                    \"description\": \"starts to walk\"}, {\"start_time\": 1.0, \"end_time\": 1.5, \"description\": \"walks on straight ahead for some time, both arms swinging, and then turns left\"}, {\"start_time\": 1.5, \"end_time\": 2.5, \"description\": \"walks on straight ahead for some time, both arms swinging, and then turns right\"}]}\n\
                    {\"filename\": \"jump_001__A425\", \"events\": []}\n";
    fs::write(metadata.join("seed_metadata_v002_temporal_labels.jsonl"), timeline)
        .expect("a timeline");
    Some((base, seed))
}

fn added(base: &Path, seed: &Path, name: &str) -> (String, Value) {
    let corpus = base.join(name).display().to_string();
    report(&["corpus", "new", &corpus]);
    let told = report(&["corpus", "add", &corpus, &seed.display().to_string()]);
    (corpus, told)
}

#[test]
fn a_folder_in_the_layout_of_bones_seed_brings_motions_people_and_times() {
    let Some((base, seed)) = seed("bones") else { return };
    let (corpus, told) = added(&base, &seed, "moves");
    assert_eq!((&told["added"], &told["labels"]), (&2.into(), &3.into()), "{told:#}");
    let notes = told["notes"].to_string();
    assert!(notes.contains("1 motion of") && notes.contains("LICENSE.md"), "{notes}");
    let walks = report(&[
        "corpus",
        "query",
        &corpus,
        "action=walking and subject.gender=F and subject.stature_m>1.6 and subject.age=31",
    ]);
    let [walk] = walks["clips"].as_array().expect("clips").as_slice() else {
        panic!("one walk: {walks:#}")
    };
    assert_eq!(walk["name"], "walk_ff_001__A425");
    let by_the_actor = seed.join("soma_proportional/bvh/230711/walk_ff_001__A425.bvh");
    let told_by_it = report(&["info", &by_the_actor.display().to_string()]);
    assert_eq!(walk["duration_s"], told_by_it["duration_s"], "by the actor's body");
    // What is not said of a motion is what its category says.
    let bow = report(&["corpus", "query", &corpus, "action=gestures and subject=bones-a548"]);
    assert_eq!(bow["trials"], 1);
    let frames = report(&["corpus", "query", &corpus, "label=\"starts to walk\"", "--frames"]);
    let clips = frames["clips"].as_array().expect("clips");
    assert_eq!(
        (clips.len(), &clips[0]["answering"][0]["last_frame"]),
        (1, &30.into()),
        "{frames:#}"
    );

    // Sentences that begin alike stay two.
    let out = base.join("labels").display().to_string();
    report(&["corpus", "export", &corpus, "action=walking", "--format", "labels", "-o", &out]);
    let told = report(&["corpus", "query", &corpus, "label like walks*"]);
    assert_eq!(told["trials"], 1);
    fn texts(folder: &Path) -> usize {
        let entries = fs::read_dir(folder).expect("a folder").flatten().map(|entry| entry.path());
        entries
            .map(|path| match path.is_dir() {
                true => texts(&path),
                false => usize::from(path.extension().is_some_and(|ending| ending == "txt")),
            })
            .sum()
    }
    assert_eq!(texts(Path::new(&out)), 3);

    // The table as text says the same.
    fs::remove_file(seed.join("metadata/seed_metadata_v004.parquet")).expect("gone");
    let (by_text, again) = added(&base, &seed, "by-text");
    assert_eq!((&again["added"], &again["labels"]), (&2.into(), &3.into()));
    let version = |corpus: &str| report(&["info", corpus])["holds"][1][1].clone();
    assert_eq!(version(&by_text), version(&corpus));
}

#[test]
fn pipes_are_not_waited_for_and_links_that_go_round_are_not_followed() {
    let base = folder("round");
    let corpus = base.join("moves").display().to_string();
    report(&["corpus", "new", &corpus]);
    let pipe = base.join("pipe.bvh");
    assert!(Command::new("mkfifo").arg(&pipe).status().expect("mkfifo").success());
    let refused = run(&["corpus", "add", &corpus, &pipe.display().to_string(), "--action", "walk"]);
    assert_eq!(refused.status.code(), Some(1));
    assert!(words(&refused).contains("it is no file"), "{}", words(&refused));
    let round = base.join("round");
    fs::create_dir(&round).expect("a folder");
    for link in ["a", "b", "c"] {
        std::os::unix::fs::symlink(".", round.join(link)).expect("a link");
    }
    let file = round.join("bow.bvh").display().to_string();
    report(&["synth", "bow", "-o", &file]);
    let told = report(&["corpus", "add", &corpus, &round.display().to_string(), "--action", "bow"]);
    assert_eq!((&told["added"], told["found"].as_array().map(Vec::len)), (&1.into(), Some(0)));
    let large = run(&["corpus", "generate", &corpus, "praxicon", "--seed", "9007199254740993"]);
    assert_eq!(large.status.code(), Some(1));
    assert!(words(&large).contains("9007199254740992"), "{}", words(&large));
}

#[test]
fn a_table_of_strangers_that_leads_out_of_its_folder_or_is_damaged_is_refused() {
    let Some((base, seed)) = seed("bones-wrong") else { return };
    let corpus = base.join("moves").display().to_string();
    report(&["corpus", "new", &corpus]);
    let table = seed.join("metadata/seed_metadata_v003.csv");
    fs::remove_file(seed.join("metadata/seed_metadata_v004.parquet")).expect("gone");
    let text = fs::read_to_string(&table).expect("a table");
    let add = || run(&["corpus", "add", &corpus, &seed.display().to_string()]);
    let refused = |what: &str| {
        let output = add();
        assert_eq!(output.status.code(), Some(1), "{what}");
        assert!(words(&output).contains(what), "{what}: {}", words(&output));
    };
    report(&["synth", "bow", "-o", &base.join("out.bvh").display().to_string()]);
    fs::write(&table, text.replace("soma_uniform/bvh/230711/bow", "../out")).expect("a table");
    refused("not its own");
    // Neither a row that is cut off is passed over, nor one with a cell too many.
    let (whole, last) = text.trim_end().rsplit_once('\n').expect("rows");
    for (row, got) in
        [("jump_001__A425,jump_001__A425", "2 cells"), (&format!("{last},x"), "16 cells")]
    {
        fs::write(&table, format!("{whole}\n{row}\n")).expect("a table");
        refused("a row has not one cell per column");
        let said = words(&add());
        for part in ["seed_metadata_v003.csv, line 4", got, "15 cells, as there are titles"] {
            assert!(said.contains(part), "{part}: {said}");
        }
    }
    fs::write(&table, &text).expect("a table");
    let timeline = seed.join("metadata/seed_metadata_v002_temporal_labels.jsonl");
    for (start_s, says, what) in [
        (2, "walks", "ends before it begins"),
        (0, "", "plain words"),
        (0, "\\u001b[2J", "plain words"),
    ] {
        let event =
            format!("{{\"start_time\": {start_s}, \"end_time\": 1, \"description\": \"{says}\"}}");
        fs::write(&timeline, format!("{{\"filename\": \"a\", \"events\": [{event}]}}"))
            .expect("a timeline");
        refused(what);
    }
    fs::write(&timeline, "{\"filename\": \"a\"").expect("a timeline");
    refused("line 1");
    fs::write(&timeline, vec![b' '; 1 << 21]).expect("a timeline");
    refused("1048576 bytes for one motion");
    fs::write(&timeline, "").expect("a timeline");
    let unknown = text.replace("move_soma_", "path_");
    fs::write(&table, unknown).expect("a table");
    refused("move_soma_proportional_path or move_soma_uniform_path");
    fs::write(&table, &text).expect("a table");
    // A pipe is not waited for.
    fs::remove_file(&timeline).expect("gone");
    assert!(Command::new("mkfifo").arg(&timeline).status().expect("mkfifo").success());
    refused("it is no file");
    fs::remove_file(&timeline).expect("gone");
    // What begins after a motion is over: that motion is not taken, the other is.
    let late = "{\"filename\": \"bow_001__A548_M\", \"events\": [{\"start_time\": 60, \"end_time\": 61, \"description\": \"bows\"}]}";
    fs::write(&timeline, late).expect("a timeline");
    let told = add();
    assert_eq!((told.status.code(), &json(&told)["added"]), (Some(3), &1.into()));
    let unread = json(&told)["unread"].to_string();
    assert!(unread.contains("bows from 60.000 s on"), "{unread}");
    fs::write(&timeline, "").expect("a timeline");
    assert_eq!(json(&add())["added"], 1);
}

const SPARK: &str = "
import json, sys
from pyspark.sql import SparkSession
session = SparkSession.builder.master('local[1]').config('spark.ui.enabled', 'false')
session = session.config('spark.driver.host', '127.0.0.1').getOrCreate()
trials, frames = (session.read.parquet(sys.argv[1] + '/' + table) for table in ('trials', 'frames'))
each = trials.groupBy('set', 'action').count().collect()
both = frames.join(trials.select('trial', 'name'), 'trial').groupBy('name').count().collect()
labels = session.read.parquet(sys.argv[1] + '/labels').filter(\"label = 'wave-r'\").count()
print(json.dumps({
  'actions': sorted([row['set'], row['action'], row['count']] for row in each),
  'frames': {row['name']: row['count'] for row in both},
  'waves': labels,
}))
";

const POLARS_AND_PANDAS: &str = "
import json, sys, polars as pl, pandas as pd
folder = sys.argv[1]
def by_polars():
    table = lambda of: pl.read_parquet(f'{folder}/{of}/**/*.parquet', hive_partitioning=True)
    trials, frames, labels = table('trials'), table('frames'), table('labels')
    each = trials.group_by('set', 'action').len()
    both = frames.join(trials.select('trial', 'name'), on='trial').group_by('name').len()
    return {'actions': sorted([str(a), str(b), c] for a, b, c in each.rows()),
            'frames': dict(both.rows()), 'waves': labels.filter(pl.col('label') == 'wave-r').height}
def by_pandas():
    table = lambda of: pd.read_parquet(f'{folder}/{of}')
    trials, frames, labels = table('trials'), table('frames'), table('labels')
    each = trials.groupby(['set', 'action'], observed=True).size()
    both = frames.merge(trials[['trial', 'name']], on='trial').groupby('name').size()
    return {'actions': sorted([str(a), str(b), int(c)] for (a, b), c in each.items()),
            'frames': {n: int(c) for n, c in both.items()},
            'waves': int((labels['label'] == 'wave-r').sum())}
print(json.dumps([by_polars(), by_pandas()]))
";

/// A corpus of three actions; what the program says of it, in the words of the scripts above.
fn three_actions(name: &str) -> (String, Value) {
    let corpus = folder(name).join("moves").display().to_string();
    report(&["corpus", "new", &corpus]);
    report(&["corpus", "add", &corpus, "bow", "wave-r", "walk:3s"]);
    let asked = report(&["corpus", "query", &corpus, ""]);
    let clips = asked["clips"].as_array().expect("clips");
    let frames: serde_json::Map<String, Value> = clips
        .iter()
        .map(|clip| (clip["name"].as_str().expect("a name").to_owned(), clip["frames"].clone()))
        .collect();
    let actions =
        ["bow", "walk", "wave-r"].map(|action| serde_json::json!(["generated", action, 1]));
    (corpus, serde_json::json!({"actions": actions, "frames": frames, "waves": 1}))
}

#[test]
fn polars_and_pandas_read_a_corpus_as_it_lies_there() {
    let python = match python::python() {
        Ok(python) => python,
        Err(why) => return aloud!("SKIPPED: no Python environment: {why}"),
    };
    let (corpus, expected) = three_actions("frames-of-data");
    let mut script = Command::new(&python.program);
    let output = script.args(["-c", POLARS_AND_PANDAS, &corpus]).output().expect("Python");
    assert!(output.status.success(), "{}", words(&output));
    let found: Value = serde_json::from_slice(&output.stdout).expect("a JSON report");
    assert_eq!(found, serde_json::json!([expected, expected]));
}

/// Spark is half a gigabyte, and wants Java.
#[test]
fn spark_reads_a_corpus_as_it_lies_there() {
    if std::env::var_os("GAITWAY_LONG").is_none() {
        return aloud!("SKIPPED: Spark reads a corpus with GAITWAY_LONG=1");
    }
    let environment = Path::new(env!("CARGO_TARGET_TMPDIR")).join("spark");
    let python = environment.join("bin/python");
    let run_it = |command: &mut Command| {
        let output = command.output().expect("a program");
        assert!(output.status.success(), "{command:?}: {}", words(&output));
        output
    };
    if !environment.join("complete").exists() {
        run_it(Command::new("python3").args(["-m", "venv", "--clear"]).arg(&environment));
        run_it(Command::new(&python).args(["-m", "pip", "install", "--quiet", "pyspark==4.3.0"]));
        fs::write(environment.join("complete"), "").expect("a file");
    }
    let (corpus, expected) = three_actions("spark");
    let output = run_it(Command::new(&python).args(["-c", SPARK, &corpus]));
    let found: Value = serde_json::from_slice(&output.stdout).expect("a JSON report");
    assert_eq!(found, expected);
}
