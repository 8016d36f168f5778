//! What comes next in a session follows from its folder alone, whatever was written last.

use gaitway::body::Segment;
use gaitway::body::anthropometry::{Measure, Subject};
use gaitway::body::worn::kept::Kept;
use gaitway::body::worn::{Calibration, HeadingBy, Mount};
use gaitway::session::files::{TrialRecording, trial_name, trial_of};
use gaitway::session::{
    BodyCheck, DeviceCheck, Folder, Plan, Progress, SessionFile, Step, TrialFile, Verdict,
};
use gaitway::time::Utc;
use glam::DQuat;
use std::collections::BTreeMap;
use std::path::PathBuf;

const NOW: Utc = Utc(1_800_000_000);

fn folder(name: &str) -> PathBuf {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = std::fs::remove_dir_all(&folder);
    folder
}

fn session(subjects: &[&str], plan: &str) -> SessionFile {
    SessionFile {
        schema: 1,
        name: "lab".into(),
        begun: NOW,
        operator: String::new(),
        place: String::new(),
        remarks: String::new(),
        sources: vec!["torso=imu:x-imu3@/dev/null".into()],
        wear: BTreeMap::new(),
        forward: BTreeMap::new(),
        magnetometer: false,
        subjects: subjects.iter().map(|id| (*id).to_owned()).collect(),
        skipped: Vec::new(),
        plan: Plan::parse(plan, "plan.toml").expect("a plan"),
        gaitway_version: "test".into(),
    }
}

fn subject(id: &str) -> Subject {
    let measures = BTreeMap::from([(Measure::Stature, 1.7)]);
    Subject { id: id.into(), measures, ..Subject::default() }
}

fn device(passed: bool, because: &str) -> DeviceCheck {
    DeviceCheck {
        schema: 1,
        made: NOW,
        expires: NOW.plus_hours(24.0),
        passed,
        accepted_because: because.into(),
        sensors: Vec::new(),
    }
}

fn body(id: &str, passed: bool) -> BodyCheck {
    BodyCheck {
        schema: 1,
        subject: id.into(),
        made: NOW,
        expires: NOW.plus_hours(4.0),
        passed,
        sensors: 0,
        worst_rad: Some(0.05),
        off_t_pose_rad: BTreeMap::new(),
        notes: Vec::new(),
    }
}

fn kept(id: &str) -> String {
    let mount = Mount {
        segment: Segment::Torso,
        sensor_from_segment: DQuat::IDENTITY,
        heading_rad: 0.0,
        heading_by: HeadingBy::Movement,
        consistency: None,
        strapped_off_rad: None,
    };
    let calibration = Calibration { mounts: vec![mount], notes: Vec::new() };
    let (subject, sensors) = (id.to_owned(), vec!["torso".to_owned()]);
    Kept { subject, made_unix_s: NOW.0, sensors, calibration }.text().expect("a text")
}

fn trial(action: &str, number: u32, subjects: &[&str], verdict: Verdict, good: u32) -> TrialFile {
    let recording = |id: &&str| TrialRecording {
        subject: (*id).to_owned(),
        file: format!("trials/{}.{id}.mcap", trial_name(action, number)),
    };
    TrialFile {
        schema: 1,
        action: action.into(),
        number,
        judged: NOW,
        verdict,
        good_repetitions: good,
        notes: String::new(),
        props: String::new(),
        closed: true,
        missed_samples: 0,
        duration_s: 3.0,
        recordings: subjects.iter().map(recording).collect(),
        taps: Vec::new(),
    }
}

const PLAN: &str = "repetitions = 3\n[[action]]\nname = \"bow\"\n[[action]]\nname = \"wave-r\"\n\
                    together = true";

#[test]
fn step_follows_step_and_two_subjects_take_turns_or_act_together() {
    let folder = Folder::open(&folder("session-steps")).expect("a folder");
    let next = |at: Utc| Progress::read(&folder).expect("read").next(at);
    assert_eq!(next(NOW), Step::SetUp);
    folder.write_new("session.toml", &session(&["a", "b"], PLAN)).expect("written");
    for id in ["a", "b"] {
        assert_eq!(next(NOW), Step::Subject(id.into()));
        folder.write_new(&format!("subjects/{id}.toml"), &subject(id)).expect("written");
    }
    assert_eq!(next(NOW), Step::Device);
    folder.write_new("calibration/device-01.toml", &device(false, "")).expect("written");
    assert_eq!(next(NOW), Step::Device, "a calibration that failed is none");
    folder.write_new("calibration/device-02.toml", &device(false, "old")).expect("written");
    for id in ["a", "b"] {
        assert_eq!(next(NOW), Step::Body(id.into()));
        let name = format!("calibration/body-{id}-01");
        folder.write_new_bytes(&format!("{name}.toml"), kept(id).as_bytes()).expect("written");
        assert_eq!(next(NOW), Step::Body(id.into()), "it was not judged yet");
        folder.write_new(&format!("{name}-check.toml"), &body(id, true)).expect("written");
    }
    let step = |index, number, ids: &[&str]| {
        Step::Trial(index, number, ids.iter().map(|id| (*id).to_owned()).collect())
    };
    // All that is left is known beforehand; a day later the sensors and their wearers are calibrated anew before that.
    let ahead = |at: Utc| Progress::read(&folder).expect("read").ahead(at);
    let trials = [step(0, 1, &["a"]), step(0, 1, &["b"]), step(1, 1, &["a", "b"]), Step::Finish];
    assert_eq!(ahead(NOW), trials);
    let again = [Step::Device, Step::Body("a".into()), Step::Body("b".into())];
    assert_eq!(ahead(NOW.plus_hours(25.0)), [&again[..], &trials].concat());
    let put = |trial: &TrialFile| {
        folder.write_new(&format!("trials/{}.toml", trial.name()), trial).expect("written");
    };
    assert_eq!(next(NOW), step(0, 1, &["a"]));
    put(&trial("bow", 1, &["a"], Verdict::Keep, 2));
    put(&trial("bow", 2, &["a"], Verdict::Retake, 9));
    assert_eq!(next(NOW), step(0, 3, &["a"]), "what is to be retaken does not count");
    put(&trial("bow", 3, &["a"], Verdict::Keep, 1));
    assert_eq!(next(NOW), step(0, 4, &["b"]));
    put(&trial("bow", 4, &["b"], Verdict::Keep, 3));
    assert_eq!(next(NOW), step(1, 1, &["a", "b"]));
    put(&trial("wave-r", 1, &["a", "b"], Verdict::Keep, 3));
    assert_eq!(next(NOW), Step::Finish);
    folder.write_new_bytes("manifest.toml", b"schema = 1").expect("written");
    assert_eq!(next(NOW), Step::Finished);
}

#[test]
fn calibrations_expire_and_unjudged_trials_come_first() {
    let folder = Folder::open(&folder("session-expiry")).expect("a folder");
    folder.write_new("session.toml", &session(&["a"], PLAN)).expect("written");
    folder.write_new("subjects/a.toml", &subject("a")).expect("written");
    folder.write_new("calibration/device-01.toml", &device(true, "")).expect("written");
    folder.write_new_bytes("calibration/body-a-01.toml", kept("a").as_bytes()).expect("written");
    folder.write_new("calibration/body-a-01-check.toml", &body("a", true)).expect("written");
    let progress = || Progress::read(&folder).expect("read");
    let alone = vec!["a".to_owned()];
    assert_eq!(progress().next(NOW), Step::Trial(0, 1, alone.clone()));
    assert_eq!(progress().next(NOW.plus_hours(5.0)), Step::Body("a".into()));
    assert_eq!(progress().next(NOW.plus_hours(25.0)), Step::Device);
    assert_eq!(progress().next_attempt("device"), "device-02");
    assert_eq!(progress().next_attempt("body-a"), "body-a-02");

    // Killed while recording, while judging, and while writing a file.
    folder.write_new_bytes("trials/bow-01.mcap", b"").expect("written");
    folder.write_new_bytes("trials/bow-01.recovered.mcap", b"").expect("written");
    folder.write_new_bytes("trials/bow-02.toml.new", b"half of i").expect("written");
    let read = progress();
    assert_eq!(read.next(NOW), Step::Judge("bow-01".into()));
    assert_eq!(read.unjudged["bow-01"], ["trials/bow-01.mcap"]);
    assert_eq!(read.next_number("bow"), 2, "no number is used twice");

    // Nothing is written over.
    let refused = folder.write_new_bytes("trials/bow-01.mcap", b"other").unwrap_err();
    assert!(refused.to_string().contains("exists already"), "{refused}");

    // One session at a time.
    let busy = Folder::open(folder.root()).unwrap_err().to_string();
    assert!(busy.contains("a session is already running in this folder"), "{busy}");

    // Skipped is done, and a file that somebody spoiled is named.
    let mut skipping = session(&["a"], PLAN);
    skipping.skipped = vec!["bow".into(), "wave-r".into()];
    folder.replace("session.toml", &skipping).expect("replaced");
    folder
        .write_new("trials/bow-01.toml", &trial("bow", 1, &["a"], Verdict::Retake, 0))
        .expect("w");
    assert_eq!(progress().next(NOW), Step::Finish);
    edited(&folder, "subjects/a.toml", "id = \"a\"\n[measures]\nstature_m = 170");
    let error = Progress::read(&folder).unwrap_err().to_string();
    assert!(error.contains("subjects/a.toml") && error.contains("0.3 to 3 m"), "{error}");
    edited(&folder, "subjects/a.toml", "nonsense");
    let error = Progress::read(&folder).unwrap_err().to_string();
    assert!(error.contains("subjects/a.toml"), "{error}");
}

/// What an editor does.
fn edited(folder: &Folder, name: &str, text: &str) {
    std::fs::write(folder.path(name), text).expect("written");
}

#[test]
fn names_of_trials_tell_action_and_number() {
    assert_eq!(trial_name("wave-r", 3), "wave-r-03");
    for (action, number) in [("wave-r", 1), ("bow", 99), ("jump-2", 100)] {
        assert_eq!(trial_of(&trial_name(action, number)), Some((action, number)));
    }
    for name in ["", "bow", "bow-", "bow-1", "bow-x1", "-01x", "bow-99999999999"] {
        assert_eq!(trial_of(name), None, "{name}");
    }
}
