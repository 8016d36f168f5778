//! A corpus of made-up trials, and questions about it in two languages: ours and SQL.

use gaitway::body::anthropometry::{Measure, Subject};
use gaitway::corpus::manifest::{CorpusManifest, FiveChoices, SCHEMA};
use gaitway::corpus::rows::{Consent, LabelEntry, SubjectEntry, TrialEntry, TrialKind};
use gaitway::corpus::store::{NewTrial, Store};
use gaitway::corpus::tables::TrialFrames;
use rand::{Rng, RngExt};
use std::collections::BTreeMap;
use std::path::Path;

const SETS: [&str; 3] = ["praxicon", "cross validation", "co+articulation"];
const ACTIONS: [&str; 5] = ["kick", "walk", "wave-r,bow", "sit down", "100%"];
const WORDS: [&str; 6] = ["a", "Ab", "b c", "zebra", "", "kick-left"];
const LICENCES: [&str; 3] = ["CC-BY-4.0", "CC-BY-NC-4.0", "unknown"];

fn pick<'a>(random: &mut impl Rng, of: &[&'a str]) -> &'a str {
    of[random.random_range(0..of.len())]
}

fn some<T>(random: &mut impl Rng, value: T) -> Option<T> {
    random.random_bool(0.7).then_some(value)
}

/// Numbers of few different values, so that tests of equality hit.
fn few(random: &mut impl Rng) -> f64 {
    f64::from(random.random_range(-4..12)) / 4.0
}

/// A corpus of `trials` trials of people, in many steps; every `framed`th has frames.
pub fn corpus(folder: &Path, trials: usize, framed: usize, random: &mut impl Rng) {
    let choices = FiveChoices::default();
    let manifest = CorpusManifest { schema: SCHEMA, name: "made".to_owned(), choices };
    let mut store = Store::create(folder, &manifest).expect("a corpus");
    let person = |n: usize, random: &mut _| {
        let mut measures = BTreeMap::new();
        for (measure, value) in [
            (Measure::Age, 7.0 + few(random).abs() * 10.0),
            (Measure::Stature, 1.2 + few(random).abs() / 8.0),
            (Measure::Mass, 40.0 + few(random) * 4.0),
        ] {
            if let Some(value) = some(random, value) {
                measures.insert(measure, value);
            }
        }
        let gender = pick(random, &["female", "male", ""]).to_owned();
        let subject = Subject { id: format!("s{n:02}"), gender, measures, ..Subject::default() };
        SubjectEntry {
            subject,
            consent: if n.is_multiple_of(3) { Consent::Given } else { Consent::Unknown },
        }
    };
    let people: Vec<SubjectEntry> = (0..12).map(|n| person(n, random)).collect();
    let mut made = 0;
    while made < trials {
        let (set, action) = (pick(random, &SETS), pick(random, &ACTIONS));
        let count = random.random_range(1..=trials / 8).min(trials - made);
        let new = (made..made + count).map(|n| trial(n, set, action, n % framed == 0, random));
        let new: Vec<NewTrial> = new.collect();
        store.add(set, action, new, &people, "").expect("added");
        made += count;
    }
}

fn trial(n: usize, set: &str, action: &str, framed: bool, random: &mut impl Rng) -> NewTrial {
    let count = random.random_range(1..40_usize);
    let signal = |k: usize, random: &mut _| -> Vec<f32> {
        (0..count).map(|at| (few(random) + (n + k + at) as f64 * 1e-3) as f32).collect()
    };
    let frames = TrialFrames { signals: (0..29).map(|k| signal(k, random)).collect() };
    let licence = pick(random, &LICENCES);
    let rate_hz = [30.0, 60.0, 120.0][random.random_range(0..3)];
    let hash = frames.sha256(rate_hz);
    let text = |random: &mut _| {
        let word = pick(random, &WORDS).to_owned();
        some(random, word)
    };
    let mut parameters = BTreeMap::new();
    for name in ["speed_m_s", "target_x_m", "direction_rad"] {
        if random.random_bool(0.5) {
            parameters.insert(name.to_owned(), few(random));
        }
    }
    let (subject, repetitions) = (random.random_range(0..15), random.random_range(-3..11));
    let entry = TrialEntry {
        trial: hash[..16].to_owned(),
        name: format!("{}-{n:04}", pick(random, &WORDS)),
        set: set.to_owned(),
        action: action.to_owned(),
        kind: TrialKind::ALL[random.random_range(0..3)],
        synthetic: random.random(),
        // Some did nobody, and some did somebody of whom nothing is known.
        subject: some(random, format!("s{subject:02}")),
        session: text(random),
        source: "made".to_owned(),
        format: "made".to_owned(),
        source_sha256: None,
        source_file: None,
        provenance: text(random),
        licence: licence.to_owned(),
        noncommercial: licence.contains("NC"),
        verdict: [None, Some("keep"), Some("retake")][random.random_range(0..3)].map(str::to_owned),
        repetitions: (0..11).contains(&repetitions).then_some(repetitions),
        edits_sha256: None,
        untracked: None,
        part_of: None,
        body_stature_m: 1.5 + few(random) / 10.0,
        frames: count as i64,
        rate_hz,
        duration_s: (count - 1) as f64 / rate_hz,
        frames_sha256: hash,
        parameters,
        place: None,
    };
    let label = |label: &str, random: &mut _| {
        let first = RngExt::random_range(random, 0..count as i64);
        LabelEntry {
            trial: entry.trial.clone(),
            set: set.to_owned(),
            action: action.to_owned(),
            label: label.to_owned(),
            first_frame: first,
            last_frame: RngExt::random_range(random, first..count as i64),
            value: if RngExt::random_bool(random, 0.8) { 1.0 } else { 0.5 },
            annotator: "made".to_owned(),
        }
    };
    let some_labels: Vec<&str> =
        ["wave", "walk", "hop"].into_iter().filter(|_| random.random_bool(0.4)).collect();
    let labels = some_labels.iter().map(|name| label(name, random)).collect();
    NewTrial { entry, frames: framed.then_some(frames), labels, source: None }
}

/// A question in our language and as a condition of SQL. `frames` if it may be about signals and is asked by frame.
pub fn question(random: &mut impl Rng, depth: usize, frames: bool) -> (String, String) {
    if depth > 0 && random.random_bool(0.6) {
        let (a, b) = (question(random, depth - 1, frames), question(random, depth - 1, frames));
        return match random.random_range(0..3) {
            0 => (format!("({} and {})", a.0, b.0), format!("({} AND {})", a.1, b.1)),
            1 => (format!("({} or {})", a.0, b.0), format!("({} OR {})", a.1, b.1)),
            _ => (format!("not ({})", a.0), format!("NOT ({})", a.1)),
        };
    }
    let sign = pick(random, &["=", "!=", "<", "<=", ">", ">="]);
    let word = pick(random, &WORDS);
    let number = few(random);
    match random.random_range(0..if frames { 13 } else { 11 }) {
        0 => {
            let set = pick(random, &SETS);
            (format!("set{sign}'{set}'"), format!("t.\"set\" {sign} '{set}'"))
        }
        1 => {
            let (a, b) = (pick(random, &ACTIONS), pick(random, &ACTIONS));
            (format!("action in (\"{a}\", '{b}')"), format!("t.action IN ('{a}', '{b}')"))
        }
        2 => (format!("session {sign} \"{word}\""), format!("t.session {sign} '{word}'")),
        3 => {
            let not = pick(random, &["", "not "]);
            (format!("session is {not}missing"), format!("t.session IS {not}NULL"))
        }
        4 => {
            let years = 7.0 + number.abs() * 10.0;
            (format!("subject.age{sign}{years}"), format!("s.age_years {sign} {years}"))
        }
        5 => {
            let gender = pick(random, &["female", "male"]);
            (format!("subject.gender{sign}{gender}"), format!("s.gender {sign} '{gender}'"))
        }
        6 => {
            let name = pick(random, &["speed_m_s", "target_x_m", "direction_rad"]);
            (format!("{name}{sign}{number}"), format!("t.{name} {sign} {number}"))
        }
        7 => {
            let not = pick(random, &["", "not "]);
            (format!("{not}synthetic"), format!("{not} t.synthetic"))
        }
        8 => {
            let not = pick(random, &["", "not "]);
            (
                format!("repetitions {not}in (1, {number}, 7)"),
                format!("t.repetitions {not} IN (1, {number}, 7)"),
            )
        }
        9 => {
            let not = pick(random, &["", "not "]);
            (format!("name {not}like \"*b*-*1\""), format!("t.name {not} LIKE '%b%-%1'"))
        }
        10 => {
            let label = pick(random, &["wave", "walk", "nothing"]);
            let sql = if frames {
                format!(
                    "EXISTS (SELECT 1 FROM labels l WHERE l.trial = t.trial AND l.value = 1 AND l.label = '{label}' \
                     AND f.frame BETWEEN l.first_frame AND l.last_frame)"
                )
            } else {
                format!(
                    "t.trial IN (SELECT trial FROM labels WHERE value = 1 AND label = '{label}')"
                )
            };
            (format!("label={label}"), sql)
        }
        11 => {
            let name = pick(random, &["root_x_m", "left_knee_flexion_rad", "root_qw"]);
            (
                format!("frame.{name}{sign}{number}"),
                format!("CAST(f.{name} AS DOUBLE) {sign} {number}"),
            )
        }
        _ => (format!("frame.frame {sign} 7"), format!("f.frame {sign} 7")),
    }
}
