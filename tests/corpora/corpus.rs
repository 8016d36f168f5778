//! The motion database as it is used: added to, asked, killed, filled up, and read by DuckDB beside it.

#[path = "corpus/made.rs"]
mod made;

use crate::aloud::aloud;
use crate::program;
use crate::program::{folder, gaitway, json, words};
use crate::python;
use gaitway::corpus::query::Question;
use gaitway::corpus::select::Selection;
use gaitway::corpus::store::Store;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde_json::Value;
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Output, Stdio};

fn corpus(arguments: &[&str]) -> Output {
    gaitway().arg("corpus").args(arguments).output().expect("the program")
}

/// Runs it with `--json`; its report.
fn report(arguments: &[&str]) -> Value {
    let output =
        gaitway().arg("corpus").args(arguments).arg("--json").output().expect("the program");
    json(&output)
}

fn shown(path: &Path) -> String {
    path.display().to_string()
}

/// A new corpus in a folder of this test's own.
fn new(name: &str) -> (PathBuf, String) {
    let folder = folder(name);
    let corpus_folder = shown(&folder.join("moves"));
    assert!(corpus(&["new", &corpus_folder]).status.success());
    (folder, corpus_folder)
}

fn files(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).expect("a folder").flatten() {
        if entry.path().is_dir() {
            found.extend(files(&entry.path()));
        } else {
            found.push(entry.path());
        }
    }
    found.sort();
    found
}

const DUCKDB: &str = "
import duckdb, json, sys
folder, by_frame, conditions = json.load(sys.stdin)
db = duckdb.connect()
for table in ('trials', 'labels', 'frames'):
    db.sql(f\"create view {table} as select * from read_parquet('{folder}/{table}/**/*.parquet', \"
           f\"hive_partitioning=true, hive_types_autocast=false)\")
db.sql(f\"create view subjects as select * from '{folder}/subjects.parquet'\")
answers = []
for condition in conditions:
    if by_frame:
        rows = db.sql('select t.trial, f.frame from trials t left join subjects s using (subject) '
                      f'join frames f on f.trial = t.trial where {condition}')
        answers.append(sorted([f'{t}:{n}' for t, n in rows.fetchall()]))
    else:
        rows = db.sql(f'select t.trial from trials t left join subjects s using (subject) where {condition}')
        answers.append(sorted([row[0] for row in rows.fetchall()]))
json.dump(answers, sys.stdout)
";

/// What DuckDB answers to these conditions of SQL.
fn by_duckdb(folder: &Path, by_frame: bool, conditions: &[String]) -> Option<Vec<Vec<String>>> {
    let python = match python::python() {
        Ok(python) => python,
        Err(cause) => {
            aloud!("SKIPPED: nothing to hold questions against: {cause}");
            return None;
        }
    };
    let mut child = std::process::Command::new(&python.program)
        .args(["-c", DUCKDB])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("python");
    let input = serde_json::to_vec(&(shown(folder), by_frame, conditions)).expect("JSON");
    std::io::Write::write_all(&mut child.stdin.take().expect("its input"), &input)
        .expect("written");
    let output = child.wait_with_output().expect("an end");
    assert!(output.status.success(), "{}", words(&output));
    Some(serde_json::from_slice(&output.stdout).expect("JSON"))
}

/// A corpus, questions (ours, and as DuckDB has them), and DuckDB's answers.
type Asked = (Store, Vec<(String, String)>, Vec<Vec<String>>);

/// A corpus of so many trials, one of so many with frames, so many random questions (ours, and as DuckDB has them), and its answers.
fn asked(
    name: &str,
    seed: u64,
    [trials, framed, questions]: [usize; 3],
    frames: bool,
) -> Option<Asked> {
    let folder = folder(name).join("made");
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    made::corpus(&folder, trials, framed, &mut random);
    let questions: Vec<(String, String)> =
        (0..questions).map(|n| made::question(&mut random, n % 4, frames)).collect();
    let conditions: Vec<String> = questions.iter().map(|(_, sql)| sql.clone()).collect();
    let expected = by_duckdb(&folder, frames, &conditions)?;
    Some((Store::open(&folder).expect("a corpus"), questions, expected))
}

#[test]
fn duckdb_gives_the_same_trials_to_two_hundred_random_questions() {
    let Some((store, questions, expected)) = asked("duckdb", 17, [2400, 7, 200], false) else {
        return;
    };
    let (mut skipped, mut answered) = (0, BTreeSet::new());
    for ((question, sql), expected) in questions.iter().zip(expected) {
        let asked = Question::parse(question).expect(question);
        let selection = Selection::new(&store, &asked, false).expect(question);
        let mut found = Vec::new();
        let looked = selection
            .trials(u64::MAX, |trial| {
                found.push(trial.trial);
                Ok(())
            })
            .expect(question);
        found.sort();
        assert_eq!(found, expected, "{question}\n{sql}");
        assert_eq!(looked.trials, found.len() as u64);
        // Those beyond the most are counted all the same.
        let mut few = 0;
        let counted = selection.trials(3, |_| {
            few += 1;
            Ok(())
        });
        assert_eq!((counted.expect(question).trials, few), (looked.trials, looked.trials.min(3)));
        skipped += looked.files - looked.files_read + looked.groups - looked.groups_read;
        answered.insert(found.len());
    }
    assert!(skipped > 500, "files and row groups that need not be read are not: {skipped}");
    assert!(answered.len() > 80, "questions of all kinds: {answered:?}");
}

#[test]
fn duckdb_gives_the_same_frames_to_a_hundred_random_questions() {
    let Some((store, questions, expected)) = asked("duckdb-frames", 18, [240, 1, 100], true) else {
        return;
    };
    for ((question, sql), expected) in questions.iter().zip(expected) {
        let asked = Question::parse(question).expect(question);
        let selection = Selection::new(&store, &asked, true).expect(question);
        let mut found = Vec::new();
        selection
            .frames(|trial, spans| {
                for span in spans {
                    let frames = span.first_frame..=span.last_frame;
                    found.extend(frames.map(|frame| format!("{}:{frame}", trial.trial)));
                }
                Ok(())
            })
            .expect(question);
        found.sort();
        assert!(found == expected, "{question}\n{sql}\n{} and {}", found.len(), expected.len());
    }
}

#[test]
fn what_is_there_already_is_not_added_twice_and_said() {
    let (folder, moves) = new("twice");
    let bow = folder.join("bow.bvh");
    let made = gaitway().args(["synth", "bow", "--rate", "30", "-o"]).arg(&bow).output();
    assert!(made.expect("the program").status.success());
    let copy = folder.join("copy.bvh");
    fs::copy(&bow, &copy).expect("a copy");
    // Other bytes, the same motion.
    let text = fs::read_to_string(&bow).expect("a text");
    fs::write(folder.join("other.bvh"), text + "\n").expect("a file");
    let add = |source: &Path| report(&["add", &moves, &shown(source), "--action", "bow"]);
    let first = add(&bow);
    assert_eq!((first["added"].as_u64(), first["trials"].as_u64()), (Some(1), Some(1)));
    let second = add(&copy);
    assert_eq!(second["added"], 0);
    assert_eq!(second["found"][0]["by"], "file");
    let third = add(&folder.join("other.bvh"));
    assert_eq!(
        (&third["added"], &third["found"][0]["by"]),
        (&Value::from(0), &Value::from("frames"))
    );
    assert_eq!(third["version"], first["version"]);
    assert_eq!(report(&["add", &moves, "bow"])["added"], 1, "an action is no capture of it");
    assert_eq!(report(&["add", &moves, "bow"])["found"][0]["by"], "frames");
    assert_eq!(report(&["check", &moves])["faults"], Value::from(Vec::<Value>::new()));
}

#[test]
fn the_order_in_which_trials_come_does_not_change_the_version() {
    let (_, one) = new("order-one");
    let (_, other) = new("order-other");
    for action in ["bow", "kick-r", "wave-r"] {
        assert!(corpus(&["add", &one, action]).status.success());
    }
    let last = report(&["add", &other, "wave-r", "kick-r", "bow"]);
    let version = report(&["query", &one])["version"].clone();
    assert_eq!(version, last["version"]);
    report(&["add", &one, "squat"]);
    assert_ne!(report(&["query", &one])["version"], version);
    let gone = report(&["remove", &one, "--where", "action=squat"]);
    assert_eq!((&gone["removed"], &gone["version"]), (&Value::from(1), &version));
}

/// Names of what must be whole whenever somebody looks: all but what is begun in `.new`.
fn tables(moves: &str) -> Vec<PathBuf> {
    let is_table = |path: &PathBuf| {
        path.extension().is_some_and(|e| e == "parquet") && !shown(path).contains("/.new/")
    };
    files(Path::new(moves)).into_iter().filter(is_table).collect()
}

#[test]
fn a_command_that_is_killed_leaves_nothing_half_written_and_goes_on() {
    let actions: Vec<String> = (1..13).map(|n| format!("bow@0.{:02}", 50 + n)).collect();
    let add = |moves: &str| {
        let mut command = gaitway();
        command.args(["corpus", "add", moves]).args(&actions).args(["kick-r", "wave-r", "squat"]);
        command.stdout(Stdio::null()).stderr(Stdio::null());
        command
    };
    let (_, twin) = new("kill-twin");
    let began = std::time::Instant::now();
    assert!(add(&twin).status().expect("the program").success());
    let whole = began.elapsed();
    let expected = report(&["query", &twin]);
    let (_, moves) = new("kill");
    let mut was_cut_off = 0;
    for round in 0..50_u32 {
        // From the beginning to the end, in another place each time, and from where it was left.
        let mut child = add(&moves).spawn().expect("the program");
        std::thread::sleep(whole * (round * 37 % 50) / 50);
        let _ = child.kill();
        was_cut_off += u32::from(!child.wait().expect("an end").success());
        for table in tables(&moves) {
            let read = gaitway::columnar::TableReader::open(&table);
            assert!(read.is_ok_and(|table| table.rows() > 0), "{}", table.display());
        }
        // Whoever looks at it next does what was begun to its end.
        let checked = corpus(&["check", &moves]);
        assert!(checked.status.success(), "round {round}: {}", words(&checked));
        if round % 5 == 4 {
            report(&["remove", &moves, "--where", "action=kick-r or duration_s>2"]);
        }
    }
    assert!(was_cut_off > 20, "only {was_cut_off} were cut off");
    assert!(add(&moves).status().expect("the program").success());
    let found = report(&["query", &moves]);
    assert_eq!((&found["version"], &found["trials"]), (&expected["version"], &expected["trials"]));
}

#[test]
fn a_disk_that_is_full_leaves_the_corpus_as_it_was() {
    let (_, moves) = new("full");
    assert!(corpus(&["add", &moves, "bow"]).status.success());
    let before = report(&["query", &moves])["version"].clone();
    for blocks in [0, 1, 8, 16, 40] {
        let script = format!("ulimit -f {blocks}; exec \"$0\" corpus add {moves} walk:20s");
        let output = std::process::Command::new("sh").args(["-c", &script, program::PATH]).output();
        let output = output.expect("the program");
        assert_eq!(output.status.code(), Some(1), "{}", words(&output));
        // What, where, got, what to do.
        let said = words(&output);
        for part in ["File too large", &*moves, "to do     write to a disk"] {
            let part = part.replace("to do     ", "to do    ");
            assert!(said.contains(&part), "{part}: {said}");
        }
        assert_eq!(report(&["query", &moves])["version"], before);
        assert!(!Path::new(&moves).join(".new").exists(), "{blocks}: what was begun is gone");
        assert!(corpus(&["check", &moves]).status.success());
    }
    assert!(corpus(&["add", &moves, "walk:20s"]).status.success(), "with room it goes on");
}

#[test]
fn of_two_who_change_a_corpus_the_second_is_told_and_who_reads_is_not_kept() {
    let (_, moves) = new("two");
    assert!(corpus(&["add", &moves, "bow"]).status.success());
    let lock = fs::File::open(&moves).expect("a folder");
    lock.lock().expect("a lock");
    for arguments in [vec!["add", &moves, "walk"], vec!["remove", &moves, "--where", "action=bow"]]
    {
        let refused = corpus(&arguments);
        assert_eq!(refused.status.code(), Some(1));
        assert!(
            words(&refused).contains("another program changes this corpus"),
            "{}",
            words(&refused)
        );
    }
    assert_eq!(report(&["query", &moves, "action=bow"])["trials"], 1);
    drop(lock);
    assert!(corpus(&["add", &moves, "walk"]).status.success());
}

#[test]
fn a_file_that_vanished_or_changed_is_named() {
    let (_, moves) = new("vanished");
    assert!(corpus(&["add", &moves, "bow", "walk", "squat"]).status.success());
    let of = |table: &str, action: &str| {
        let folder = Path::new(&moves).join(format!("{table}/set=generated/action={action}"));
        files(&folder).remove(0)
    };
    fs::remove_file(of("frames", "bow")).expect("removed");
    let labels = of("labels", "walk");
    let mut bytes = fs::read(&labels).expect("bytes");
    bytes[20] ^= 1;
    fs::write(&labels, bytes).expect("changed");
    fs::copy(of("trials", "squat"), of("trials", "squat").with_file_name("mine.parquet"))
        .expect("a copy");
    let checked = report(&["check", &moves]);
    assert_eq!(checked["outcome"], "failed");
    let faults = checked["faults"].as_array().expect("faults");
    let has = |kind: &str, at: &str| {
        faults.iter().any(|f| f["kind"] == kind && f["at"].as_str().is_some_and(|a| a.contains(at)))
    };
    assert!(has("missing", "frames/set=generated/action=bow"), "{faults:#?}");
    assert!(has("changed", "labels/set=generated/action=walk"), "{faults:#?}");
    assert!(has("stray", "mine.parquet"), "{faults:#?}");
    let asked = corpus(&["query", &moves, "frame.root_z_m>0", "--frames"]);
    assert!(words(&asked).contains("a file of the corpus is not there"), "{}", words(&asked));
    assert_eq!(report(&["query", &moves, "action=bow"])["trials"], 1, "its row is still there");
}

#[test]
fn what_is_no_part_of_a_corpus_is_named_and_is_no_fault() {
    let (folder, moves) = new("strays");
    assert!(corpus(&["add", &moves, "bow"]).status.success());
    let of = |name: &str| folder.join("moves").join(name);
    let remarks = || {
        let checked = report(&["check", &moves]);
        assert_eq!(checked["outcome"], "done", "{checked:#}");
        let remarks = checked["remarks"].as_array().expect("remarks").clone();
        remarks.iter().filter_map(Value::as_str).map(str::to_owned).collect::<Vec<_>>()
    };
    assert_eq!(remarks(), Vec::<String>::new());
    fs::write(of("notes.txt"), "mine").expect("a file");
    fs::create_dir_all(of("old/deeper")).expect("a folder");
    fs::write(of("old/deeper/walk.bvh"), "mine").expect("a file");
    fs::create_dir_all(of("frames/set=generated/action=jump")).expect("a folder");
    let named = |name: &str| format!("no part of the corpus: {}", of(name).display());
    // A folder is named once, and not all that lies in it.
    assert_eq!(
        remarks(),
        [named("frames/set=generated/action=jump"), named("notes.txt"), named("old")]
    );
}

#[test]
fn a_manifest_that_is_a_pipe_is_refused_and_not_waited_for() {
    let (folder, moves) = new("pipe");
    assert!(corpus(&["add", &moves, "bow"]).status.success());
    let manifest = folder.join("moves/corpus.toml");
    fs::remove_file(&manifest).expect("removed");
    let made = std::process::Command::new("mkfifo").arg(&manifest).status();
    assert!(made.expect("mkfifo").success());
    for arguments in
        [&["query", &moves, "action=bow"][..], &["add", &moves, "walk"], &["check", &moves]]
    {
        // One that waits is ended, and has another code.
        let mut limited = std::process::Command::new("timeout");
        let output = limited.arg("20").arg(program::PATH).arg("corpus").args(arguments).output();
        let output = output.expect("the program");
        let told = words(&output);
        assert_eq!(output.status.code(), Some(1), "{told}");
        assert!(told.contains("the manifest of the corpus is no file"), "{told}");
    }
}

#[test]
fn who_changes_a_corpus_is_named_to_whoever_has_to_wait() {
    let (_, moves) = new("held");
    let store = Store::open_to_change(Path::new(&moves)).expect("a corpus");
    let own = format!("process {} (", std::process::id());
    let told = words(&corpus(&["add", &moves, "bow"]));
    assert!(told.contains("another program changes this corpus") && told.contains(&own), "{told}");
    // Who makes a part of a set waits, and says for whom.
    let mut waiting = gaitway();
    waiting.args(["corpus", "generate", &moves, "generalisation", "--part", "1/300"]);
    let waiting = waiting.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("it starts");
    let mut waiting = waiting;
    let mut said = std::io::BufReader::new(waiting.stderr.take().expect("its words"));
    let mut line = String::new();
    while !line.contains("it is waited for") {
        line.clear();
        let count = std::io::BufRead::read_line(&mut said, &mut line).expect("text");
        assert!(count > 0, "it ended without a word of whom it waits for");
    }
    assert!(line.contains(&own), "{line}");
    drop(store);
    assert!(waiting.wait().expect("its end").success());
}

#[test]
fn the_subjects_of_a_session_have_ids_that_can_be_names_of_files() {
    let (folder, moves) = new("ids");
    let lab = folder.join("lab");
    fs::create_dir_all(lab.join("trials")).expect("a folder");
    let session = "schema = 1\nname = \"lab\"\nbegun = \"2026-01-01T00:00:00Z\"\nsources = [\"torso=imu:x-imu3@/dev/null\"]\n\
                   subjects = [\"../../outside\"]\ngaitway_version = \"0.2.0\"\n[plan]\n[[plan.action]]\nname = \"bow\"\nexplain = \"bow\"\nrepetitions = 1\n";
    fs::write(lab.join("session.toml"), session).expect("a file");
    let resumed =
        gaitway().args(["record", "--session", &shown(&lab)]).stdin(Stdio::null()).output();
    let told = words(&resumed.expect("the program"));
    assert!(told.contains("not an id") && told.contains("../../outside"), "{told}");
    let told = words(&corpus(&["add", &moves, &shown(&lab)]));
    assert!(told.contains("the session is not finished"), "{told}");
}

#[test]
fn what_a_table_says_of_a_trial_is_bounded_and_the_refusal_is_short() {
    let (folder, moves) = new("long-names");
    let file = shown(&folder.join("one.bvh"));
    let made = gaitway().args(["synth", "bow", "--rate", "30", "-o", &file]).output();
    assert!(made.expect("the program").status.success());
    let trials = shown(&folder.join("trials.csv"));
    let add = |column: &str, length: usize| {
        let text = "n".repeat(length);
        fs::write(&trials, format!("file,action,subject,{column}\none.bvh,bow,anna,{text}\n"))
            .expect("a table");
        gaitway().args(["corpus", "add", &moves, "--trials", &trials]).output().expect("it runs")
    };
    for (column, longest) in [
        ("name", 255),
        ("session", 255),
        ("licence", 255),
        ("provenance", 4096),
        ("gender", 255),
        ("remarks", 4096),
    ] {
        let output = add(column, 3_000_000);
        let said = words(&output);
        assert_eq!(output.status.code(), Some(1), "{said}");
        let (got, allowed) = ("3000000 bytes: nnn", format!("at most {longest} bytes"));
        for part in [&*format!("trials.csv, line 2, {column}"), got, &allowed, "to do"] {
            assert!(said.contains(part), "{column}, {part}: {said}");
        }
        assert!(said.len() < 600, "{} bytes", said.len());
        assert_eq!(add(column, longest + 1).status.code(), Some(1), "{column}");
    }
    let output = add("name", 255);
    assert!(output.status.success(), "{}", words(&output));
}

#[test]
fn a_person_who_is_removed_is_nowhere_any_more() {
    let (folder, moves) = new("person");
    for (name, action) in [("one", "bow"), ("two", "kick-r"), ("three", "wave-r")] {
        let file = shown(&folder.join(format!("{name}.bvh")));
        let made = gaitway().args(["synth", action, "--rate", "30", "-o", &file]).output();
        assert!(made.expect("the program").status.success());
    }
    let table = "file,action,subject,age_years,stature_m,consent\n\
                 one.bvh,bow,anna,11,1.45,given\ntwo.bvh,kick,anna,,,\nthree.bvh,kick,bert,40,1.8,given\n";
    let trials = shown(&folder.join("trials.csv"));
    fs::write(&trials, table).expect("a table");
    assert_eq!(report(&["add", &moves, "--trials", &trials])["added"], 3);
    let young = "action=kick and subject.age<12 and subject.stature_m>1.4";
    assert_eq!(report(&["query", &moves, young])["trials"], 1);
    let dry = report(&["remove", &moves, "--subject", "anna", "--dry-run"]);
    assert_eq!((&dry["removed"], &dry["left"]), (&Value::from(2), &Value::from(3)));
    let gone = report(&["remove", &moves, "--subject", "anna"]);
    assert_eq!((&gone["removed"], &gone["left"]), (&Value::from(2), &Value::from(1)));
    let left = report(&["query", &moves]);
    assert_eq!(left["clips"][0]["subject"], "bert");
    assert!(corpus(&["check", &moves]).status.success());
    let sources: Vec<PathBuf> = files(&Path::new(&moves).join("sources"));
    assert_eq!(sources.len(), 1, "{sources:?}");
    for file in files(Path::new(&moves)) {
        let bytes = fs::read(&file).expect("bytes");
        assert!(!bytes.windows(4).any(|part| part == b"anna"), "{}", file.display());
    }
    let nobody = corpus(&["remove", &moves, "--subject", "anna"]);
    assert!(words(&nobody).contains("bert"), "{}", words(&nobody));
}

#[test]
fn who_withdrew_is_not_added_and_a_licence_marks_its_trials() {
    let (folder, moves) = new("consent");
    let file = shown(&folder.join("bow.bvh"));
    let made = gaitway().args(["synth", "bow", "--rate", "30", "-o", &file]).output();
    assert!(made.expect("the program").status.success());
    let add = |consent: &str| {
        corpus(&[
            "add",
            &moves,
            &file,
            "--action",
            "bow",
            "--subject",
            "s1",
            "--licence",
            "CC-BY-NC-4.0",
            "--consent",
            consent,
        ])
    };
    let subject = shown(&folder.join("s1.toml"));
    fs::write(&subject, "id = \"s1\"\n[measures]\nstature_m = 1.7\n").expect("a file");
    assert!(
        corpus(&["add", &moves, "--subject-file", &subject, "--consent", "withdrawn"])
            .status
            .success()
    );
    let refused = corpus(&["add", &moves, &file, "--action", "bow", "--subject", "s1"]);
    assert!(words(&refused).contains("withdrew"), "{}", words(&refused));
    assert!(words(&add("maybe")).contains("given"), "a word of consent");
    assert!(
        corpus(&["add", &moves, "--subject-file", &subject, "--consent", "given"]).status.success()
    );
    assert!(add("given").status.success());
    assert_eq!(report(&["query", &moves, "noncommercial"])["trials"], 1);
}

#[test]
fn what_a_known_person_allows_now_counts_for_all_of_them_and_who_withdrew_is_not_added() {
    let (folder, moves) = new("allowed");
    let add = |action: &str, consent: &str| {
        let file = shown(&folder.join(format!("{action}.bvh")));
        let made = gaitway().args(["synth", action, "--rate", "10", "-o", &file]).output();
        assert!(made.expect("the program").status.success());
        corpus(&["add", &moves, &file, "--action", action, "--subject", "s1", "--consent", consent])
    };
    let count = |question: &str| report(&["query", &moves, question])["trials"].clone();
    assert!(add("bow", "given").status.success());
    assert!(add("squat", "internal").status.success());
    assert_eq!(count("subject.consent=internal"), 2);
    // Refused, and noted all the same; of somebody new as well.
    let refused = add("hop", "withdrawn");
    assert_eq!(refused.status.code(), Some(1), "{}", words(&refused));
    assert_eq!(count("subject.consent=withdrawn"), 2);
    let file = shown(&folder.join("hop.bvh"));
    let hop = ["add", &moves, &file, "--action", "hop", "--subject", "s2"];
    let new = corpus(&[&hop[..], &["--consent", "withdrawn"]].concat());
    assert!(words(&new).contains("withdrew"), "{}", words(&new));
    assert!(words(&corpus(&hop)).contains("withdrew"));
    assert_eq!(count(""), 2);
}

#[test]
fn labels_of_tables_and_of_frames_are_asked_by_trial_and_by_frame() {
    let (folder, moves) = new("labels");
    let clips = folder.join("clips");
    fs::create_dir(&clips).expect("a folder");
    for action in ["bow", "walk"] {
        let file = shown(&clips.join(format!("{action}.bvh")));
        let made = gaitway().args(["synth", action, "--rate", "10", "-o", &file]).output();
        assert!(made.expect("the program").status.success());
    }
    let table = shown(&clips.join("labels.csv"));
    fs::write(
        &table,
        "file,class,side,start_s,end_s\nbow.bvh,nod,L,0.2,0.5\nbow.bvh,bow,,,\nwalk.bvh,walk,,,\n",
    )
    .expect("a table");
    let clips_shown = shown(&clips);
    let added = report(&["add", &moves, &clips_shown, "--labels", &table, "--annotator", "me"]);
    assert_eq!((&added["added"], &added["labels"]), (&Value::from(2), &Value::from(4)));
    let nod = report(&["query", &moves, "label=nod-l", "--frames"]);
    let span = &nod["clips"][0]["answering"];
    assert_eq!(
        (&span[0]["first_frame"], &span[0]["last_frame"]),
        (&Value::from(2), &Value::from(5))
    );
    assert_eq!(report(&["query", &moves, "not label=nod"])["clips"][0]["action"], "walk");
    // Later somebody else labels frame by frame.
    let labels = folder.join("labels/bow");
    fs::create_dir_all(&labels).expect("a folder");
    let frames = nod["clips"][0]["frames"].as_u64().expect("frames") as usize;
    fs::write(labels.join("deep.txt"), "0.0\n1.0\n0.5\n".to_owned() + &"0\n".repeat(frames - 3))
        .expect("labels");
    let labels = shown(&folder.join("labels"));
    let again = report(&[
        "add",
        &moves,
        &clips_shown,
        "--labels",
        &labels,
        "--annotator",
        "other",
        "--action",
        "bow",
    ]);
    assert_eq!((&again["added"], &again["labels"]), (&Value::from(0), &Value::from(2)));
    assert_eq!(
        report(&["query", &moves, "label=deep", "--frames"])["clips"][0]["answering"][0]["last_frame"],
        1
    );
    assert!(corpus(&["check", &moves]).status.success());
    // Labels of other clips than those that are added.
    fs::write(&table, "file,class\nbow.bvh,bow\nelsewhere/nod.bvh,nod\n").expect("a table");
    let other = report(&["add", &moves, &clips_shown, "--labels", &table, "--action", "x"]);
    let note = other["notes"][0].as_str().expect("a note");
    assert!(note.contains("1 clip name") && note.contains("elsewhere/nod.bvh"), "{note}");
    let file = folder.join("file");
    fs::write(&file, "mine").expect("a file");
    let refused = corpus(&["export", &moves, "--format", "bvh", "-o", &shown(&file)]);
    let said = words(&refused);
    assert!(said.contains("a folder is to be") && said.contains("to do"), "{said}");
    assert_eq!(fs::read_to_string(&file).expect("a file"), "mine");
}

#[test]
fn variations_become_trials_with_the_frames_that_were_written() {
    let (folder, moves) = new("variations");
    let made = folder.join("made");
    let out = gaitway()
        .args(["synth", "kick-r", "--variations", "12", "--seed", "3", "--rate", "30", "-o"])
        .arg(&made)
        .output();
    assert!(out.expect("the program").status.success());
    let added = report(&["add", &moves, &shown(&made)]);
    assert_eq!(added["added"], 12);
    let asked = report(&["query", &moves, "variation>=10 and seed=3 and synthetic"]);
    assert_eq!(asked["trials"], 2);
    let one = folder.join("one.csv");
    let out = gaitway()
        .args(["synth", "kick-r", "--variation", "11", "--seed", "3", "--rate", "30", "-o"])
        .arg(&one)
        .output();
    assert!(out.expect("the program").status.success());
    // The same variation, made alone and written as a table.
    let store = Store::open(Path::new(&moves)).expect("a corpus");
    let question = Question::parse("variation=11").expect("a question");
    let mut entries = Vec::new();
    let selection = Selection::new(&store, &question, false).expect("a question");
    selection
        .trials(1, |entry| {
            entries.push(entry);
            Ok(())
        })
        .expect("a trial");
    let text = fs::read_to_string(&one).expect("a table");
    let rows: Vec<Vec<f64>> = text
        .lines()
        .skip(1)
        .map(|line| line.split(',').map(|cell| cell.parse().expect("a number")).collect())
        .collect();
    store
        .frames_of(&entries.iter().collect::<Vec<_>>(), |_, frames| {
            assert_eq!(frames.len(), rows.len());
            for (signal, values) in frames.signals.iter().enumerate().take(25) {
                for (row, value) in rows.iter().zip(values) {
                    assert!((row[1 + signal] - f64::from(*value)).abs() < 1e-5);
                }
            }
            Ok(())
        })
        .expect("frames");
    let rows = report(&["add", &moves, &shown(&made), "--without-frames"]);
    assert_eq!(rows["found"].as_array().map(Vec::len), Some(12));
}

#[test]
fn a_session_brings_its_subjects_verdicts_and_repetitions() {
    let (folder, moves) = new("session");
    let session = folder.join("monday");
    for inner in ["subjects", "angles"] {
        fs::create_dir_all(session.join(inner)).expect("a folder");
    }
    let add = || corpus(&["add", &moves, &shown(&session), "--consent", "given"]);
    fs::write(session.join("session.toml"), "").expect("a file");
    assert!(words(&add()).contains("not finished"));
    let subject =
        "id = \"s07\"\ngender = \"female\"\n[measures]\nage_years = 9\nstature_m = 1.43\n";
    fs::write(session.join("subjects/s07.toml"), subject).expect("a file");
    let trial = |number: u32, verdict: &str, good: u32| {
        format!(
            "[[trial]]\nname = \"kick-0{number}\"\naction = \"kick\"\nverdict = \"{verdict}\"\ngood_repetitions = {good}\n\
             subjects = [\"s07\"]\nrecordings = []\nangles = [\"angles/kick-0{number}.csv\", \"angles/kick-0{number}.bvh\"]\n\
             not_worn = []\nsilent_samples = 0\nduration_s = 3.0\nprops = \"\"\nnotes = \"\"\n"
        )
    };
    let manifest = "schema = 1\nsession = \"monday\"\nbegun = \"2026-01-05T10:00:00Z\"\nfinished = \"2026-01-05T11:00:00Z\"\n\
                    operator = \"o\"\nplace = \"here\"\ngaitway_version = \"0.1.0\"\nsubjects = [\"subjects/s07.toml\"]\n\
                    action = []\n[choices]\ndata_type = \"\"\nrange_of_motion = \"\"\nrange_of_subjects = \"\"\n\
                    definition_and_execution = \"\"\noutput = \"\"\n";
    let trials = trial(1, "keep", 10) + &trial(2, "retake", 0);
    fs::write(session.join("manifest.toml"), manifest.to_owned() + &trials).expect("a file");
    for (number, action) in [(1, "kick-r"), (2, "kick-l")] {
        let file = shown(&session.join(format!("angles/kick-0{number}.bvh")));
        let made = gaitway().args(["synth", action, "--rate", "30", "-o", &file]).output();
        assert!(made.expect("the program").status.success());
    }
    let added = add();
    assert!(added.status.success(), "{}", words(&added));
    let young = "session=monday and subject.age<10 and verdict=keep and repetitions=10";
    let found = report(&["query", &moves, young]);
    assert_eq!(
        (&found["trials"], &found["clips"][0]["name"]),
        (&Value::from(1), &Value::from("kick-01"))
    );
    assert_eq!(report(&["query", &moves, "verdict=retake and subject.consent=given"])["trials"], 1);

    // A trial that was kept and has no motion is named; one to be retaken is not missed.
    let without = |number, verdict: &str| {
        let trial = trial(number, verdict, 1);
        let (before, rest) = trial.split_once("angles = [").expect("angles");
        let (_, after) = rest.split_once("]\n").expect("their end");
        format!("{before}angles = []\nno_angles = \"the arm was not worn\"\n{after}")
    };
    let trials = without(3, "keep") + &without(4, "retake");
    fs::write(session.join("manifest.toml"), manifest.to_owned() + &trials).expect("a file");
    let lost = add();
    assert_eq!(lost.status.code(), Some(3), "{}", words(&lost));
    let said = words(&lost);
    assert!(said.contains("kick-03") && said.contains("the arm was not worn"), "{said}");
    assert!(!said.contains("kick-04"), "{said}");

    // A manifest names files of its own session, wherever links lead.
    fs::copy(session.join("angles/kick-01.bvh"), folder.join("elsewhere.bvh")).expect("a copy");
    std::os::unix::fs::symlink(folder.join("elsewhere.bvh"), session.join("angles/link.bvh"))
        .expect("a link");
    for elsewhere in
        [shown(&folder.join("elsewhere.bvh")), "../elsewhere.bvh".into(), "angles/link.bvh".into()]
    {
        let trials = trial(1, "keep", 1).replace("angles/kick-01.bvh", &elsewhere);
        fs::write(session.join("manifest.toml"), manifest.to_owned() + &trials).expect("a file");
        let refused = add();
        assert_eq!(refused.status.code(), Some(1), "{elsewhere}");
        assert!(words(&refused).contains("not its own"), "{}", words(&refused));
    }
    // Ids become names of files. Whose a trial is that broke off at once nobody knows, and it has no motion.
    let whose = trial(1, "keep", 1).replace("[\"s07\"]", "[\"../s07\"]");
    fs::write(session.join("manifest.toml"), manifest.to_owned() + &whose).expect("a file");
    let refused = add();
    assert_eq!(refused.status.code(), Some(1));
    assert!(words(&refused).contains("not an id"), "{}", words(&refused));
    let broken = without(5, "retake").replace("[\"s07\"]", "[\"\"]");
    let trials = trial(1, "keep", 1) + &broken;
    fs::write(session.join("manifest.toml"), manifest.to_owned() + &trials).expect("a file");
    assert!(add().status.success(), "{}", words(&add()));
}

#[test]
fn what_cannot_be_understood_is_said_with_its_place() {
    let (folder, moves) = new("wrong");
    let wrong = corpus(&["query", &moves, "action=kick and subject.statue_m>1.4"]);
    let said = words(&wrong);
    assert!(said.contains("letter 17") && said.contains("subject.stature_m"), "{said}");
    let signal = words(&corpus(&["query", &moves, "frame.root_z_m>1"]));
    assert!(signal.contains("--frames"), "{signal}");
    let file = folder.join("a.bvh");
    fs::write(&file, "HIERARCHY nothing").expect("a file");
    let action = corpus(&["add", &moves, &shown(&file)]);
    assert_eq!(action.status.code(), Some(1));
    let none = words(&corpus(&["query", &shown(&folder)]));
    assert!(none.contains("no corpus in this folder") && none.contains("corpus new"), "{none}");
    assert!(words(&corpus(&["new", &moves])).contains("already"));
    assert!(words(&corpus(&["new", &shown(&folder)])).contains("not empty"));
    fs::write(Path::new(&moves).join("version.json"), "{}").expect("a file");
    assert!(words(&corpus(&["query", &moves])).contains("changed into something else"));
}

/// Clips of one person in a corpus, and two licences.
fn passed_on(name: &str) -> (PathBuf, String) {
    let (folder, moves) = new(name);
    for (action, licence, consent) in [
        ("bow", "CC-BY-NC-4.0", "given"),
        ("kick-r", "CC-BY-ND-4.0", "given"),
        ("squat", "CC0-1.0", "internal"),
    ] {
        let file = shown(&folder.join(format!("{action}.bvh")));
        let made = gaitway().args(["synth", action, "--rate", "30", "-o", &file]).output();
        assert!(made.expect("the program").status.success());
        let subject = format!("s-{action}");
        let added = corpus(&[
            "add",
            &moves,
            &file,
            "--action",
            action,
            "--licence",
            licence,
            "--subject",
            &subject,
            "--consent",
            consent,
        ]);
        assert!(added.status.success(), "{}", words(&added));
    }
    assert!(corpus(&["add", &moves, "wave-r"]).status.success());
    (folder, moves)
}

#[test]
fn an_export_tells_its_version_and_its_licences_and_withholds_what_is_forbidden() {
    let (folder, moves) = passed_on("export");
    let out = shown(&folder.join("bvh"));
    let done = report(&["export", &moves, "--format", "bvh", "-o", &out]);
    assert_eq!(done["version"], report(&["query", &moves])["version"]);
    assert_eq!(
        (&done["outcome"], &done["noncommercial"]),
        (&Value::from("done_with_loss"), &Value::from(true))
    );
    let told: Value = serde_json::from_str(
        &fs::read_to_string(Path::new(&out).join("export.json")).expect("a file"),
    )
    .expect("JSON");
    assert_eq!(told["licences"]["CC-BY-NC-4.0"], 1);
    let withheld = done["withheld"].to_string();
    assert!(withheld.contains("kick-r") && withheld.contains("forbids"), "{withheld}");
    assert!(withheld.contains("squat") && withheld.contains("did not allow"), "{withheld}");
    let bow = done["trials"]
        .as_array()
        .expect("trials")
        .iter()
        .find(|of| of["action"] == "bow")
        .expect("bow");
    let written = Path::new(&out).join(bow["files"][0].as_str().expect("a name"));
    // What comes out is what went in: read again it has the same angles.
    let (_, again) = new("export-again");
    let added = report(&["add", &again, &shown(&written), "--action", "bow"]);
    assert_eq!(added["added"], 1);
    let frames = |moves: &str| {
        let store = Store::open(Path::new(moves)).expect("a corpus");
        let mut entries = Vec::new();
        let question = Question::parse("action=bow").expect("a question");
        let selection = Selection::new(&store, &question, false).expect("a question");
        selection
            .trials(1, |entry| {
                entries.push(entry);
                Ok(())
            })
            .expect("a trial");
        let mut found = None;
        store
            .frames_of(&[&entries[0]], |_, frames| {
                found = Some(frames);
                Ok(())
            })
            .expect("frames");
        found.expect("frames").signals
    };
    for (signal, (one, other)) in frames(&moves).iter().zip(frames(&again)).enumerate().take(22) {
        assert_eq!(one.len(), other.len());
        let off = one.iter().zip(&other).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(off < 0.01, "signal {signal}: {off} rad");
    }
    let gone = report(&["remove", &moves, "--subject", "s-bow"]);
    let export = gone["exports"][0]["path"].as_str().expect("an export").to_owned();
    assert!(export.ends_with("export/bvh"), "{export}");
}

#[test]
fn files_are_passed_on_byte_for_byte_and_labels_line_for_line() {
    let (folder, moves) = passed_on("export-source");
    let out = folder.join("source");
    let done = report(&[
        "export",
        &moves,
        "action in (bow, kick-r)",
        "--format",
        "source",
        "-o",
        &shown(&out),
    ]);
    assert_eq!(done["outcome"], "done", "a licence without derivatives allows the file itself");
    for trial in done["trials"].as_array().expect("trials") {
        let file = out.join(trial["files"][0].as_str().expect("a name"));
        let action = trial["action"].as_str().expect("an action");
        assert_eq!(
            fs::read(file).expect("bytes"),
            fs::read(folder.join(format!("{action}.bvh"))).expect("bytes")
        );
    }
    let out = folder.join("labels");
    let done =
        report(&["export", &moves, "kind=generated", "--format", "labels", "-o", &shown(&out)]);
    let name = done["trials"][0]["files"][0].as_str().expect("a name");
    assert!(name.ends_with("/wave-r.txt"), "{name}");
    let text = fs::read_to_string(out.join(name)).expect("a text");
    assert_eq!(text.lines().count() as u64, done["trials"][0]["frames"].as_u64().expect("frames"));
    assert!(text.lines().all(|line| line == "1.0"));
}

#[test]
fn what_a_robot_would_do_is_a_table_inside_its_limits() {
    let (folder, moves) = new("export-robot");
    assert!(corpus(&["add", &moves, "wave-r", "bow"]).status.success());
    let out = folder.join("op3");
    let done =
        report(&["export", &moves, "--format", "robot-csv", "--robot", "op3", "-o", &shown(&out)]);
    assert_eq!(done["rate_hz"], 30.0);
    let joints = done["joints"].as_array().expect("joints").len();
    let robot = gaitway::robot::Robot::load("op3").expect("a robot");
    for trial in done["trials"].as_array().expect("trials") {
        let text = fs::read_to_string(out.join(trial["files"][0].as_str().expect("a name")))
            .expect("a table");
        let rows: Vec<Vec<f64>> = text
            .lines()
            .map(|line| line.split(',').map(|cell| cell.parse().expect("a number")).collect())
            .collect();
        assert!(rows.len() > 30, "{}", rows.len());
        for row in &rows {
            assert_eq!(row.len(), 7 + joints);
            assert!((row[3..7].iter().map(|part| part * part).sum::<f64>() - 1.0).abs() < 1e-4);
            for (angle, joint) in row[7..].iter().zip(&robot.joints) {
                assert!(
                    (joint.limits.lower_rad() - 1e-5..=joint.limits.upper_rad() + 1e-5)
                        .contains(angle)
                );
            }
        }
        for pair in rows.windows(2) {
            for ((a, b), joint) in pair[0][7..].iter().zip(&pair[1][7..]).zip(&robot.joints) {
                assert!(
                    (a - b).abs() * 30.0 <= joint.limits.velocity_rad_s() * 1.001 + 1e-3,
                    "{}",
                    joint.name
                );
            }
        }
    }
    let none = words(&corpus(&[
        "export",
        &moves,
        "--format",
        "robot-csv",
        "-o",
        &shown(&folder.join("x")),
    ]));
    assert!(none.contains("--robot"), "{none}");
}

#[test]
fn an_export_that_is_killed_goes_on_and_ends_like_one_that_was_not() {
    let (folder, moves) = new("export-kill");
    let actions: Vec<String> = (1..40).map(|n| format!("bow@0.{:02}", 50 + n)).collect();
    let mut add = gaitway();
    add.args(["corpus", "add", &moves]).args(&actions);
    assert!(add.output().expect("the program").status.success());
    let export = |out: &Path| {
        let mut command = gaitway();
        command.args(["corpus", "export", &moves, "--format", "bvh", "-o"]).arg(out);
        command.stdout(Stdio::null()).stderr(Stdio::null());
        command
    };
    let twin = folder.join("twin");
    let began = std::time::Instant::now();
    assert!(export(&twin).status().expect("the program").success());
    let whole = began.elapsed();
    let out = folder.join("killed");
    let listed = |folder: &Path| -> Vec<(PathBuf, Vec<u8>)> {
        let within = |file: PathBuf| {
            let bytes = fs::read(&file).expect("bytes");
            (file.strip_prefix(folder).expect("within").to_owned(), bytes)
        };
        files(folder).into_iter().map(within).collect()
    };
    let expected = listed(&twin);
    let mut was_cut_off = 0;
    for round in 0..20_u32 {
        let mut child = export(&out).spawn().expect("the program");
        std::thread::sleep(whole * (round % 10 + 1) / 14);
        let _ = child.kill();
        was_cut_off += u32::from(!child.wait().expect("an end").success());
        if !out.exists() {
            continue;
        }
        for (name, bytes) in listed(&out) {
            let is_begun = |name: &Path| {
                shown(name).ends_with(".part") || shown(name).contains(".export-begun")
            };
            let is_whole = expected.contains(&(name.clone(), bytes));
            assert!(is_begun(&name) || is_whole, "round {round}: {}", name.display());
        }
        if out.join("export.json").exists() {
            fs::remove_dir_all(&out).expect("begun again");
        }
    }
    assert!(was_cut_off > 5, "only {was_cut_off} were cut off");
    if out.exists() && files(&out).iter().all(|file| shown(file).ends_with(".part")) {
        fs::remove_dir_all(&out).expect("nothing was begun");
    }
    assert!(export(&out).status().expect("the program").success());
    let whole = |of: Vec<(PathBuf, Vec<u8>)>| -> Vec<(PathBuf, Vec<u8>)> {
        of.into_iter().filter(|(name, _)| !shown(name).ends_with(".part")).collect()
    };
    assert!(whole(listed(&out)) == expected);
}
