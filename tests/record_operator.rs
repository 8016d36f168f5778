//! A session led by somebody who has never done it: at a real pseudo-terminal, with typing mistakes, sensors that are lost and a
//! computer that loses power. Whatever they do, the folder tells what was truly done. Time is real here.

#[allow(dead_code)]
#[path = "record_session/dialogue.rs"]
mod dialogue;
#[allow(dead_code)]
#[path = "record_session/guided.rs"]
mod guided;
#[allow(dead_code)]
#[path = "record_session/person.rs"]
mod person;
mod program;

use dialogue::Dialogue;
use gaitway::body::anthropometry::{Measure, Subject};
use gaitway::body::{Dof, Segment};
use gaitway::recording::sensor_series;
use gaitway::session::files::STATURE_KEY;
use gaitway::session::manifest::Manifest;
use gaitway::session::{DeviceCheck, SessionFile, TrialFile, Verdict};
use guided::{calibrated, movement, passes, raises_an_arm, read, stand_and_type, stand_until};
use person::{Act, Person};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Real time for one at a time.
static REAL_TIME: Mutex<()> = Mutex::new(());

fn alone() -> MutexGuard<'static, ()> {
    REAL_TIME.lock().unwrap_or_else(PoisonError::into_inner)
}

const PLAN: &str = r#"
still_s = 1.5

[[action]]
name = "reach-up"
explain = "Reach up with the right hand, straight, and lower it."
repetitions = 3
"#;

/// Mistake after mistake, each told and asked again, or taken back.
fn set_up(operator: &mut Dialogue) {
    operator.answer("name of the session", "");
    operator.answer("operator", "Bob");
    // 1: the wrong name, seen one question later.
    operator.answer("place", "back");
    operator.answer("operator", "Ada");
    operator.answer("place", "rom 2");
    // Who only wanted to see it again has not lost it.
    operator.answer("remarks", "back");
    operator.expect("now: rom 2");
    operator.answer("place", "");
    operator.answer("remarks", "a cold");
    // 2: a real name.
    operator.answer("id of the subject", "Anna B");
    operator.expect("! not an id");
    operator.answer("id of the subject", "session");
    operator.expect("! the session itself is called so");
    operator.answer("id of the subject", "s01");
    // 3: the age where the gender is asked.
    operator.answer("gender", "34");
    operator.expect("! not a gender");
    operator.answer("gender", "f");
    operator.answer("age", "back");
    operator.answer("gender", "");
    // 4: words for a number.
    operator.answer("age", "seventy");
    operator.expect("! age: not a number");
    operator.answer("age", "70");
    // 5: centimetres without saying so.
    operator.answer("stature", "170");
    operator.expect("not a plausible measure");
    // 6: the sitting height, for somebody of 70 years.
    operator.answer("stature", "0,91");
    operator.answer("few people of 70 years are so short. Is it right?", "");
    operator.answer("stature", "1,60 m");
    // 7: another unit.
    operator.answer("mass", "60 cm");
    operator.expect("not a unit of this measure");
    operator.answer("mass", "60,5 kg");
    // 8: a digit too few, beside the stature.
    operator.answer("left leg length", "0.4");
    operator.answer("25 % of the stature, 40 to 65 % are usual. Is it right?", "n");
    operator.answer("left leg length", "0.84");
    // 9: two sides that do not belong together.
    operator.answer("right leg length", "48 cm");
    operator.answer("the left one is 0.84 m. Is it right?", "n");
    operator.answer("right leg length", "84 cm");
    operator.answer("left knee width", "10 cm");
    operator.answer("right knee width", ".");
    operator.answer("remarks: actions", "");
}

/// The sensor on the forearm has an empty battery.
fn devices(operator: &mut Dialogue, person: &Person) {
    // 10: words for a choice.
    operator.answer("Do they lie still?", "perhaps");
    operator.expect("not one of the answers");
    person.silences(Segment::RightForearm, true);
    operator.answer("Do they lie still?", "");
    operator.expect("REPEAT");
    person.silences(Segment::RightForearm, false);
    operator.answer("Not every sensor is good", "");
    passes(1.5);
    operator.answer("Do they lie still?", "");
    operator.expect("written: calibration/device-02.toml");
}

/// What was answered wrongly is changed later.
fn edited(operator: &mut Dialogue) {
    operator.answer("Record reach-up-02?", "e");
    // 11: a name that is none.
    operator.answer("what is to be changed?", "s1");
    operator.expect("! not one of these");
    operator.answer("what is to be changed?", "session");
    operator.expect("now: Ada");
    operator.answer("operator", "");
    operator.expect("now: rom 2");
    operator.answer("place", "room 2");
    operator.expect("now: a cold");
    operator.answer("remarks", "-");
    operator.answer("Record reach-up-02?", "e");
    operator.answer("what is to be changed?", "s01");
    operator.expect("now: f");
    operator.answer("gender", "");
    operator.answer("age", "");
    operator.expect("now: 1.6 m");
    operator.answer("stature", "-");
    operator.expect("! this measure is needed");
    operator.answer("stature", "1,70");
    operator.expect("now: 60.5 kg");
    for measure in ["mass", "left leg length", "right leg length"] {
        operator.answer(measure, "");
    }
    operator.expect("now: 0.1 m");
    operator.answer("left knee width", "-");
    operator.answer("right knee width", ".");
    operator.answer("remarks: actions", "");
}

/// One good repetition and one bad one; what was typed before it began counts for nothing.
fn first_trial(operator: &mut Dialogue, person: &Person) {
    operator.expect("0 of 3 good repetitions");
    operator.answer("Explain it and show it", "");
    operator.answer("Let it be practised", "");
    operator.answer("Record reach-up-01?", "");
    // 12: impatient, all of it while N pose is looked at.
    stand_and_type(operator, &["x", "", "too early", "."], "RECORDING reach-up-01");
    person.does(raises_an_arm());
    passes(2.35);
    person.stands();
    operator.press(" ");
    operator.expect("1 good, 0 bad");
    operator.press("x");
    operator.expect("1 good, 1 bad");
    operator.say("a door banged");
    operator.expect("1 good, 1 bad");
    passes(0.6);
    operator.press(".");
    // 13: words for a choice, and for a number.
    operator.answer("keep it?", "maybe");
    operator.expect("not one of the answers");
    operator.answer("keep it?", "");
    operator.answer("good repetitions in it [Enter: 1", "one");
    operator.expect("not a number of repetitions");
    operator.answer("good repetitions in it", "");
    operator.answer("notes", "");
    operator.answer("props", "");
}

/// Its sensor is pulled out in the middle; the next one waits until it is plugged in again.
fn pulled_out(operator: &mut Dialogue, person: &Person) {
    operator.answer("Record reach-up-02?", "");
    stand_until(operator, "RECORDING reach-up-02");
    passes(0.8);
    person.pulls(Segment::RightUpperArm, true);
    operator.expect("! it ends here, sensor right_upper_arm is gone");
    operator.expect("keep it?");
    // Enter for a repetition comes too late, and answers nothing.
    operator.say("");
    passes(0.3);
    operator.say("r");
    operator.answer("what was wrong", "cable");
    operator.expect("Record reach-up-03?");
    person.pulls(Segment::RightUpperArm, false);
    operator.expect("right_upper_arm is back after");
    // It came while something was asked, stands on a line of its own, and what was asked is asked again.
    operator.expect("Record reach-up-03?");
    let said = operator.said();
    let line = said.lines().rfind(|line| line.contains("right_upper_arm is back after"));
    assert!(line.is_some_and(|line| !line.starts_with('>')), "{said}");
}

fn killed(operator: &mut Dialogue, person: &Person) {
    operator.say("");
    stand_until(operator, "RECORDING reach-up-03");
    person.does(raises_an_arm());
    passes(2.35);
    person.stands();
    operator.press(" ");
    operator.expect("1 good, 0 bad");
    // A second is what may be lost.
    passes(1.5);
}

fn last(operator: &mut Dialogue, person: &Person) {
    operator.expect("2 of 3 good repetitions");
    operator.answer("Record reach-up-04?", "");
    stand_until(operator, "RECORDING reach-up-04");
    person.does(raises_an_arm());
    passes(2.35);
    person.stands();
    operator.press("\n");
    operator.expect("1 good");
    passes(0.6);
    operator.say(".");
    operator.answer("keep it?", "");
    operator.answer("good repetitions in it", "");
    operator.answer("notes", "");
    operator.answer("props", "");
}

#[test]
fn whatever_an_unpractised_operator_types_and_loses_the_folder_tells_what_was_truly_done() {
    let _alone = alone();
    let folder = crate::program::folder("operator");
    std::fs::write(folder.join("plan.toml"), PLAN).expect("a plan");
    let person = Person::wearing(&[Segment::Torso, Segment::RightUpperArm, Segment::RightForearm]);
    let lab = folder.join("lab");
    let mut begin: Vec<String> =
        ["--session", "lab", "--plan", "plan.toml"].map(str::to_owned).to_vec();
    begin.extend(person.sources());
    let mut operator = Dialogue::start(&folder, &begin, &person);
    set_up(&mut operator);
    devices(&mut operator, &person);
    calibrated(&mut operator, &person);
    first_trial(&mut operator, &person);
    edited(&mut operator);
    pulled_out(&mut operator, &person);
    killed(&mut operator, &person);
    operator.dies();

    let mut operator = Dialogue::start(&folder, &["--session".into(), "lab".into()], &person);
    operator.expect("Trial reach-up-03 was recorded and not judged");
    operator.answer("keep it?", "k");
    operator.answer("good repetitions in it [Enter: 1", "");
    operator.answer("notes", "power was cut");
    operator.answer("props", "");
    last(&mut operator, &person);
    operator.expect("finished: 4 trials, 3 kept, 3 good repetitions");
    assert_eq!(operator.ends(), Some(0));
    check_folder(&lab);
    reused(&folder, &person);
}

/// Every file, and nothing else.
fn check_folder(lab: &Path) {
    let mut files = Vec::new();
    let mut folders = vec![lab.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).expect("a folder") {
            let path = entry.expect("an entry").path();
            match path.is_dir() {
                true => folders.push(path),
                false => {
                    let name = path.strip_prefix(lab).expect("inside").display().to_string();
                    files.push(name);
                }
            }
        }
    }
    files.retain(|name| !name.ends_with(".lock"));
    files.sort();
    let trials = [1, 2, 3, 4].map(|n| format!("reach-up-{n:02}"));
    let mut wanted: Vec<String> =
        ["session.toml", "manifest.toml", "subjects/s01.toml"].map(str::to_owned).to_vec();
    wanted.extend(
        ["device-01", "device-02", "body-s01-01", "body-s01-01-check"]
            .map(|name| format!("calibration/{name}.toml")),
    );
    wanted.extend(
        trials
            .iter()
            .flat_map(|name| ["mcap", "toml"].map(|ending| format!("trials/{name}.{ending}"))),
    );
    let kept = trials.iter().filter(|name| *name != "reach-up-02");
    wanted.extend(kept.flat_map(|name| ["csv", "bvh"].map(|end| format!("angles/{name}.{end}"))));
    wanted.sort();
    assert_eq!(files, wanted);

    let session: SessionFile = read(&lab.join("session.toml"));
    assert_eq!(
        [&session.name, &session.operator, &session.place, &session.remarks],
        ["lab", "Ada", "room 2", ""]
    );
    assert_eq!((session.subjects, session.skipped), (vec!["s01".to_owned()], Vec::new()));
    let subject: Subject = read(&lab.join("subjects/s01.toml"));
    let measures = [
        (Measure::Age, 70.0),
        (Measure::Stature, 1.7),
        (Measure::Mass, 60.5),
        (Measure::LeftLegLength, 0.84),
        (Measure::RightLegLength, 0.84),
    ];
    assert_eq!((subject.gender.as_str(), subject.remarks.as_str()), ("f", ""));
    assert_eq!(subject.measures, BTreeMap::from(measures));

    let first: DeviceCheck = read(&lab.join("calibration/device-01.toml"));
    let second: DeviceCheck = read(&lab.join("calibration/device-02.toml"));
    let failed: Vec<&str> = first
        .sensors
        .iter()
        .filter(|sensor| !sensor.passed)
        .map(|sensor| sensor.name.as_str())
        .collect();
    assert_eq!(failed, ["right_forearm"]);
    assert!(second.passed && second.sensors.len() == 3);

    let trial = |number: usize| {
        let name = &trials[number - 1];
        let file: TrialFile = read(&lab.join(format!("trials/{name}.toml")));
        let series = sensor_series(&lab.join(format!("trials/{name}.mcap"))).expect("read");
        let marks: Vec<String> = series.markers.iter().map(|mark| mark.text.clone()).collect();
        let told = (file.verdict, file.good_repetitions, file.closed);
        (told, file.notes, marks, series.sensors.len())
    };
    let words = |marks: &[&str]| marks.iter().map(|mark| (*mark).to_owned()).collect::<Vec<_>>();
    use Verdict::{Keep, Retake};
    let marks = words(&["repetition", "repetition, bad", "a door banged"]);
    assert_eq!(trial(1), ((Keep, 1, true), String::new(), marks, 3));
    assert_eq!(trial(2), ((Retake, 0, true), "cable".to_owned(), Vec::new(), 3));
    let cut = "power was cut".to_owned();
    assert_eq!(trial(3), ((Keep, 1, false), cut, words(&["repetition"]), 3));
    assert_eq!(trial(4), ((Keep, 1, true), String::new(), words(&["repetition"]), 3));

    let manifest: Manifest = read(&lab.join("manifest.toml"));
    assert_eq!(manifest.choices.range_of_subjects, "s01, f, 70 years, 1.7 m, 60.5 kg");
    assert_eq!((manifest.trials.len(), manifest.actions[0].good_repetitions), (4, 3));
    // The angles are put on the body as it was measured in the end, also those of before.
    let stature = |name: &str| {
        let series = sensor_series(&lab.join(format!("trials/{name}.mcap"))).expect("read");
        series.start.expect("a start").metadata[STATURE_KEY].clone()
    };
    assert_eq!(["reach-up-01", "reach-up-04"].map(stature), ["1.6", "1.7"]);
    let skeleton = |name: &str| {
        let text = std::fs::read_to_string(lab.join(format!("angles/{name}.bvh"))).expect("text");
        text.split("MOTION").next().expect("a skeleton").to_owned()
    };
    assert_eq!(skeleton("reach-up-01"), skeleton("reach-up-04"));
    for name in ["reach-up-01", "reach-up-04"] {
        let most = farthest(&lab.join(format!("angles/{name}.csv")), Dof::RightShoulderFlexion);
        assert!((most - 1.4).abs().to_degrees() < 5.0, "{name}: {most}");
    }
}

/// The greatest angle of a column of a table, rad.
fn farthest(path: &Path, dof: Dof) -> f64 {
    let text = std::fs::read_to_string(path).expect("a table");
    let mut lines = text.lines();
    let title = format!("{}_rad", dof.name());
    let at = lines.next().and_then(|titles| titles.split(',').position(|t| t == title));
    let at = at.expect("a column");
    let angle = |line: &str| line.split(',').nth(at).and_then(|c| c.parse::<f64>().ok());
    lines.map(|line| angle(line).expect("a number")).fold(f64::MIN, f64::max)
}

/// Who was measured in one session is not measured in the next.
fn reused(folder: &Path, person: &Person) {
    let mut begin: Vec<String> =
        ["--session", "next", "--subject", "lab/subjects/s01.toml"].map(str::to_owned).to_vec();
    begin.extend(person.sources());
    let mut operator = Dialogue::start(folder, &begin, person);
    for question in ["name of the session", "operator", "place", "remarks"] {
        operator.answer(question, "");
    }
    operator.answer("actions to be recorded", "bow");
    operator.answer("id of the subject", "s01");
    operator.expect("measured in another session");
    operator.answer("Do they lie still?", "q");
    assert_eq!(operator.ends(), Some(4));
    let files = ["lab", "next"].map(|session| {
        std::fs::read_to_string(folder.join(session).join("subjects/s01.toml")).expect("a file")
    });
    assert_eq!(files[0], files[1]);
}

const TOGETHER: &str = r#"
still_s = 1.5
repetitions = 1

[[action]]
name = "bow"

[[action]]
name = "lift"
explain = "Lift the box together."
together = true
"#;

#[test]
fn two_subjects_are_led_through_a_terminal_one_after_the_other_and_at_once() {
    let _alone = alone();
    let folder = crate::program::folder("two-subjects");
    std::fs::write(folder.join("plan.toml"), TOGETHER).expect("a plan");
    let (one, two) = (Person::wearing(&[Segment::Torso]), Person::wearing(&[Segment::Torso]));
    let lab = folder.join("lab");
    let mut begin: Vec<String> =
        ["--session", "lab", "--plan", "plan.toml"].map(str::to_owned).to_vec();
    begin.extend(one.sources());
    begin.extend(two.sources().iter().map(|source| format!("2-{source}")));
    two.is_listened_to();
    let mut operator = Dialogue::start(&folder, &begin, &one);
    for question in ["name of the session", "operator", "place", "remarks"] {
        operator.answer(question, "");
    }
    operator.answer("id of the subject", "s01");
    operator.answer("id of the second subject", "s01");
    operator.expect("two subjects need two ids");
    // Back from the second to the first.
    operator.answer("id of the second subject", "back");
    operator.answer("id of the subject", "s01");
    operator.answer("id of the second subject", "s02");
    for (id, stature) in [("s01", "1.7"), ("s02", "1.62")] {
        operator.expect(&format!("Subject {id}. Measures"));
        operator.answer("gender", "");
        operator.answer("age", ".");
        operator.answer("stature", stature);
        operator.answer("remarks: actions", "");
    }
    passes(1.0);
    operator.answer("Do they lie still?", "");
    operator.expect("written: calibration/device-01.toml");
    for (id, person) in [("s01", &one), ("s02", &two)] {
        operator.expect(&format!("Calibration of subject {id}"));
        operator.answer("Are they on?", "");
        stand_until(&mut operator, "bow with a straight back");
        movement(&mut operator, person, Act::Bow(2.0));
        operator.answer("Keep this calibration?", "k");
        operator.expect(&format!("written: calibration/body-{id}-01.toml"));
    }
    for (id, person, trial) in [("s01", &one, "bow-01"), ("s02", &two, "bow-02")] {
        operator.expect(&format!("bow, {id}: 0 of 1 good repetition"));
        operator.answer("Explain it and show it", "");
        operator.answer("Let it be practised", "");
        operator.answer(&format!("Record {trial}?"), "");
        stand_until(&mut operator, &format!("RECORDING {trial}"));
        person.does(Act::Bow(2.0));
        passes(2.35);
        person.stands();
        operator.press(" ");
        operator.expect("1 good");
        operator.press(".");
        judged(&mut operator);
    }
    operator.expect("lift, s01 and s02: 0 of 1 good repetition");
    operator.answer("Explain it and show it", "");
    operator.answer("Let it be practised", "");
    operator.answer("Record lift-01?", "");
    stand_until(&mut operator, "subject s02:");
    stand_until(&mut operator, "RECORDING lift-01");
    passes(1.0);
    operator.press(" ");
    operator.expect("1 good");
    operator.press(".");
    judged(&mut operator);
    operator.expect("finished: 3 trials, 3 kept, 3 good repetitions");
    assert_eq!(operator.ends(), Some(0));

    let recordings = |trial: &str| {
        let trial: TrialFile = read(&lab.join(format!("trials/{trial}.toml")));
        let of = trial.recordings.into_iter();
        of.map(|recording| (recording.subject, recording.file)).collect::<Vec<_>>()
    };
    let pair = |subject: &str, file: &str| (subject.to_owned(), format!("trials/{file}.mcap"));
    assert_eq!(recordings("bow-01"), [pair("s01", "bow-01")]);
    assert_eq!(recordings("bow-02"), [pair("s02", "bow-02")]);
    let both = [pair("s01", "lift-01.s01"), pair("s02", "lift-01.s02")];
    assert_eq!(recordings("lift-01"), both);
    for (file, sensor) in [
        ("bow-01", "torso"),
        ("bow-02", "2-torso"),
        ("lift-01.s01", "torso"),
        ("lift-01.s02", "2-torso"),
    ] {
        let series = sensor_series(&lab.join(format!("trials/{file}.mcap"))).expect("read");
        assert_eq!(series.sensors.keys().collect::<Vec<_>>(), [sensor], "{file}");
    }
    let statures = ["s01", "s02"].map(|id| {
        read::<Subject>(&lab.join(format!("subjects/{id}.toml"))).measure(Measure::Stature)
    });
    assert_eq!(statures, [Some(1.7), Some(1.62)]);
}

fn judged(operator: &mut Dialogue) {
    operator.answer("keep it?", "k");
    operator.answer("good repetitions in it [Enter: 1", "");
    operator.answer("notes", "");
    operator.answer("props", "");
}
