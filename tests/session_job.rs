//! A recording session led by a program instead of a person at a terminal: a virtual sensor behind a
//! TCP port, worn by nobody who moves. Time is real here.

mod program;

use gaitway::body::anthropometry::{Measure, Subject};
use gaitway::error::Error;
use gaitway::job::report::Outcome;
use gaitway::job::session::{
    Answered, Doubt, During, Happening, Instead, Judged, Mark, MeasureAnswer, Mend, Operator,
    Ready, Repetitions, SessionOrder, SessionReport, SessionState, Unsteady, Wish, Words, open,
};
use gaitway::recording::{SampleEncoding, sensor_series};
use gaitway::sensing::{Answer, Cue, Person, Question};
use gaitway::session::manifest::Manifest;
use gaitway::session::{BodyCheck, DeviceCheck, Plan, SessionFile, TrialFile, Verdict};
use gaitway_sim::imu::{BodyMotion, ImuErrors, ImuWire, Mount, VirtualImu};
use glam::DVec3;
use serde::de::DeserializeOwned;
use std::io::Write;
use std::net::{Ipv4Addr, TcpListener};
use std::path::Path;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// A sensor that stays where it is, from its beginning for each that comes: the source as it is typed.
fn sensor(segment: &str) -> String {
    let motion = BodyMotion::still(600.0).expect("a motion");
    let errors = ImuErrors {
        rate_noise_rad_s: 0.001,
        acceleration_noise_m_s2: 0.03,
        seed: 7,
        ..ImuErrors::default()
    };
    let imu = VirtualImu::new(motion, Mount::default(), errors, ImuWire::Csv, 100.0);
    let imu = imu.expect("a sensor");
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).expect("a port");
    let address = listener.local_addr().expect("its address");
    // It ends with the test.
    std::thread::spawn(move || {
        for line in listener.incoming() {
            let mut line = line.expect("a session");
            line.set_nodelay(true).expect("an option");
            let began = Instant::now();
            for sample in imu.clone() {
                let due = began + Duration::from_secs_f64(sample.due_s);
                std::thread::sleep(due.saturating_duration_since(Instant::now()));
                if line.write_all(&sample.bytes).is_err() {
                    break;
                }
            }
        }
    });
    format!("{segment}=imu:arduino-csv@tcp:{address}")
}

/// What was asked and what happened, in the order in which it did, as far as it is compared.
#[derive(Clone, Debug, PartialEq)]
enum Entry {
    GoingOn(String),
    New,
    Refused(String),
    Asked(&'static str),
    Needed(Measure),
    Maybe(Measure),
    /// A measure that is doubtful.
    Doubted(Measure),
    Still(f64),
    Checked(String),
    Written(String),
    Facing(String),
    Next(String, u32, u32),
    Recording(String),
    Marked(u32, u32),
    Recorded(String, Vec<String>),
    Finishing,
    Angles(Vec<String>),
}

/// Leads a session without looking up once.
#[derive(Default)]
struct Leader {
    /// Stops instead of recording a trial.
    leaves: bool,
    log: Mutex<Vec<Entry>>,
    /// What the one who is led answers next.
    answer: Mutex<Option<Answer>>,
    /// Looks at the trial that is recorded now.
    looks: Mutex<u32>,
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Leader {
    fn note(&self, entry: Entry) {
        locked(&self.log).push(entry);
    }

    /// How often this was noted before, and notes it.
    fn times(&self, entry: Entry) -> usize {
        let before = locked(&self.log).iter().filter(|known| **known == entry).count();
        self.note(entry);
        before
    }

    fn log(&self) -> Vec<Entry> {
        locked(&self.log).clone()
    }

    fn has(&self, entry: &Entry) -> bool {
        locked(&self.log).contains(entry)
    }
}

/// Whoever is led: stands at once, and leaves movements out.
impl Person for Leader {
    fn tell(&self, cue: Cue<'_>) {
        match cue {
            Cue::Ask(Question::Stands) => *locked(&self.answer) = Some(Answer::GoOn),
            Cue::Move(_) => *locked(&self.answer) = Some(Answer::Skip),
            _ => {}
        }
    }

    fn answer(&self) -> Option<Answer> {
        locked(&self.answer).take()
    }

    fn can_answer(&self) -> bool {
        true
    }

    fn wants_to_stop(&self) -> bool {
        false
    }
}

impl Operator for Leader {
    fn person(&self) -> &dyn Person {
        self
    }

    fn hear(&self, happening: Happening<'_>) {
        self.note(match happening {
            Happening::GoingOn(session) => Entry::GoingOn(session.name.clone()),
            Happening::NewSession => Entry::New,
            Happening::Refused(error) => Entry::Refused(error.what.clone()),
            Happening::MeasuringStill { seconds } => Entry::Still(seconds),
            Happening::SensorChecked(check) => Entry::Checked(check.name.clone()),
            Happening::Written { file, .. } => Entry::Written(file.to_owned()),
            Happening::FacingForward { subject } => Entry::Facing(subject.to_owned()),
            Happening::NextTrial { action, good, wanted, .. } => {
                Entry::Next(action.name.clone(), good, wanted)
            }
            Happening::Recording { trial } => Entry::Recording(trial.to_owned()),
            Happening::Marked { good, bad, .. } => Entry::Marked(good, bad),
            Happening::Recorded(recorded) => {
                let heard = recorded.parts.iter().flat_map(|part| &part.samples);
                let heard = heard.filter(|(_, samples)| **samples > 50);
                Entry::Recorded(recorded.trial.clone(), heard.map(|(n, _)| n.clone()).collect())
            }
            Happening::Finishing => Entry::Finishing,
            Happening::Angles { files } => Entry::Angles(files.to_vec()),
            // What a busy machine does to a sensor is not judged here.
            _ => return,
        });
    }

    fn ready(&self, what: Ready<'_>) -> Answered<()> {
        self.note(Entry::Asked(match what {
            Ready::LyingStill { sensors } => {
                assert_eq!(sensors, ["torso"]);
                "still?"
            }
            Ready::Worn { subject, segments } => {
                assert_eq!((subject, segments), ("s01", &[gaitway::body::Segment::Torso][..]));
                "worn?"
            }
            Ready::Again { error } => panic!("the calibration did not work: {error}"),
            Ready::Explained => "explained?",
            Ready::Practised => "practised?",
            Ready::Retake { trial } => panic!("{trial} is whole"),
        }));
        Ok(())
    }

    fn words(&self, what: Words<'_>) -> Answered<String> {
        let (asked, answer) = match what {
            Words::SessionName { .. } => ("name", ""),
            Words::Leader => ("leader", "a program"),
            Words::Place => ("place", ""),
            Words::Remarks => ("remarks", "a rehearsal"),
            Words::FirstSubject => match self.times(Entry::Asked("subject")) {
                0 => return Ok("Anna B".to_owned()),
                _ => return Ok("s01".to_owned()),
            },
            Words::SecondSubject => panic!("there is one"),
            // Its name was mistyped.
            Words::Explanation { .. } => ("explanation", ""),
            Words::Changed { .. } => panic!("nothing is changed"),
            Words::Gender => ("gender", ""),
            Words::SubjectRemarks => ("injuries", "none"),
            Words::WhyAccepted => ("why", "the machine is busy"),
            Words::Notes => ("notes", "the first"),
            Words::WhatWasWrong => panic!("it is kept"),
            Words::Props { usual } => {
                assert_eq!(usual, "");
                ("props", "a hat")
            }
        };
        self.note(Entry::Asked(asked));
        Ok(answer.to_owned())
    }

    fn actions(&self) -> Answered<Vec<String>> {
        let name = match self.times(Entry::Asked("actions")) {
            0 => "nonsense",
            _ => "bow",
        };
        Ok(vec![name.to_owned()])
    }

    fn needed_measure(&self, measure: Measure) -> Answered<f64> {
        // Centimetres first, as people do.
        Ok(if self.times(Entry::Needed(measure)) == 0 { 170.0 } else { 1.7 })
    }

    fn measure(&self, measure: Measure) -> Answered<MeasureAnswer> {
        let asked = self.times(Entry::Maybe(measure));
        Ok(match measure {
            Measure::Age => MeasureAnswer::Is(31.0),
            Measure::Mass => MeasureAnswer::NotMeasured,
            Measure::LeftLegLength if asked == 0 => MeasureAnswer::Is(0.4),
            _ => MeasureAnswer::NothingMore,
        })
    }

    fn is_right(&self, doubt: Doubt<'_>) -> Answered<bool> {
        assert!(doubt.value == 0.4 && doubt.why.contains("24 %"), "{doubt:?}");
        self.note(Entry::Doubted(doubt.measure));
        Ok(false)
    }

    fn unsteady(&self) -> Answered<Unsteady> {
        Ok(match self.times(Entry::Asked("unsteady")) {
            0..3 => Unsteady::Repeat,
            _ => Unsteady::Accept,
        })
    }

    fn mend(&self, error: &Error) -> Answered<Mend> {
        panic!("the headings were not found: {error}")
    }

    fn judge(&self, what: Judged<'_>, usual: Verdict) -> Answered<Verdict> {
        self.note(Entry::Asked(match what {
            Judged::Calibration { notes } => {
                assert_eq!(usual, Verdict::Keep);
                assert!(notes.iter().any(|note| note.contains("no T pose was seen")), "{notes:?}");
                "keep the calibration?"
            }
            Judged::Trial { .. } => "keep the trial?",
        }));
        Ok(Verdict::Keep)
    }

    fn wish(&self, _trial: &str) -> Answered<Wish> {
        self.note(Entry::Asked("wish"));
        if self.leaves { Err(Instead::Stop) } else { Ok(Wish::Record) }
    }

    fn during_trial(&self, within: Duration) -> Answered<During> {
        std::thread::sleep(within);
        let mut looks = locked(&self.looks);
        *looks += 1;
        Ok(match *looks {
            12 => During::Mark(Mark::Good),
            14 => During::Mark(Mark::Bad),
            16 => During::Mark(Mark::Note("the phone rang".to_owned())),
            30 => During::End,
            _ => During::Nothing,
        })
    }

    fn repetitions(&self, marked: usize) -> Answered<Repetitions> {
        assert_eq!(marked, 1);
        // It knows better than its marks.
        Ok(Repetitions::try_from(10).expect("a number of repetitions"))
    }
}

fn read<T: DeserializeOwned>(path: &Path) -> T {
    let text = std::fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    toml::from_str(&text).unwrap_or_else(|e| panic!("{}: {e}\n{text}", path.display()))
}

/// A session in this folder with one sensor, or the one it was begun with.
fn order(folder: &Path, source: Option<&str>, plan: Option<Plan>) -> SessionOrder {
    SessionOrder {
        folder: folder.to_owned(),
        sources: source.iter().map(|text| text.parse().expect("a source")).collect(),
        wear: Vec::new(),
        plan,
        magnetometer: false,
        known: Vec::new(),
        samples: SampleEncoding::Json,
    }
}

fn led(order: SessionOrder, leader: &Leader) -> SessionReport {
    match open(order).expect("a session") {
        SessionState::Open(session) => session.lead(leader).expect("a report"),
        SessionState::Finished(report) => panic!("nobody finished it: {report:?}"),
    }
}

#[test]
fn a_program_leads_a_session_to_a_finished_folder() {
    let lab = program::folder("whole").join("lab");
    let source = sensor("torso");
    let leader = Leader::default();
    let report = led(order(&lab, Some(&source), None), &leader);
    assert_eq!(report.outcome, Outcome::Done);
    assert_eq!((report.trials, report.kept, report.good_repetitions), (1, 1, 10));
    assert_eq!(report.manifest, Some(lab.join("manifest.toml")));

    // What it is, and whom it records; answers that nobody can use are asked for once more.
    let asked = Entry::Asked;
    let refused = |what: &str| Entry::Refused(what.to_owned());
    let log = leader.log();
    let begun = [
        Entry::New,
        asked("name"),
        asked("leader"),
        asked("place"),
        asked("remarks"),
        asked("actions"),
        asked("explanation"),
        refused("the vocabulary has no such action"),
        asked("actions"),
        asked("subject"),
        refused("not an id"),
        asked("subject"),
        asked("gender"),
        Entry::Maybe(Measure::Age),
        Entry::Needed(Measure::Stature),
        refused("stature (body height, without shoes): not a plausible measure"),
        Entry::Needed(Measure::Stature),
        Entry::Maybe(Measure::Mass),
        Entry::Maybe(Measure::LeftLegLength),
        Entry::Doubted(Measure::LeftLegLength),
        Entry::Maybe(Measure::LeftLegLength),
        asked("injuries"),
        asked("still?"),
        Entry::Still(5.0),
        Entry::Checked("torso".to_owned()),
    ];
    assert_eq!(log[..begun.len()], begun, "{log:#?}");

    // The calibration, the trial and the end; before that a busy machine may have made sensors lie
    // still once more.
    let from = log.iter().position(|entry| *entry == asked("worn?")).expect("a calibration");
    let text = str::to_owned;
    let rest = [
        asked("worn?"),
        asked("keep the calibration?"),
        Entry::Written(text("calibration/body-s01-01.toml")),
        Entry::Next(text("bow"), 0, 10),
        asked("explained?"),
        asked("practised?"),
        asked("wish"),
        Entry::Facing(text("s01")),
        Entry::Recording(text("bow-01")),
        Entry::Marked(1, 0),
        Entry::Marked(1, 1),
        Entry::Marked(1, 1),
        Entry::Recorded(text("bow-01"), vec![text("torso")]),
        asked("keep the trial?"),
        asked("notes"),
        asked("props"),
        Entry::Finishing,
        Entry::Angles(vec![text("angles/bow-01.csv"), text("angles/bow-01.bvh")]),
    ];
    assert_eq!(log[from..], rest, "{log:#?}");
    check_files(&lab);

    // There is nothing left to be done, and no sensor is opened for it.
    let again = open(order(&lab, None, None)).expect("a session");
    let SessionState::Finished(known) = again else { panic!("it is finished") };
    assert_eq!(known, report);
}

fn check_files(lab: &Path) {
    let session: SessionFile = read(&lab.join("session.toml"));
    assert_eq!((session.name.as_str(), session.operator.as_str()), ("lab", "a program"));
    assert_eq!(session.plan.actions[0].name, "bow");
    let subject: Subject = read(&lab.join("subjects/s01.toml"));
    assert_eq!((subject.measure(Measure::Age), subject.measures.len()), (Some(31.0), 2));
    let check: BodyCheck = read(&lab.join("calibration/body-s01-01-check.toml"));
    assert!(check.passed && check.worst_rad.is_none());
    let trial: TrialFile = read(&lab.join("trials/bow-01.toml"));
    assert_eq!((trial.verdict, trial.good_repetitions), (Verdict::Keep, 10));
    assert_eq!((trial.notes.as_str(), trial.props.as_str()), ("the first", "a hat"));
    assert!(trial.closed && trial.duration_s > 1.0, "{trial:?}");
    let series = sensor_series(&lab.join("trials/bow-01.mcap")).expect("a recording");
    let marks: Vec<&str> = series.markers.iter().map(|marker| marker.text.as_str()).collect();
    assert_eq!(marks, ["repetition", "repetition, bad", "the phone rang"]);
    let manifest: Manifest = read(&lab.join("manifest.toml"));
    assert_eq!(manifest.trials[0].no_angles, None);
    for file in &manifest.trials[0].angles {
        assert!(lab.join(file).exists(), "{file}");
    }
}

#[test]
fn a_program_that_stops_before_a_trial_finds_the_session_where_it_left_it() {
    let lab = program::folder("stopped").join("lab");
    let source = sensor("torso");
    let plan = "still_s = 1.0\n[[action]]\nname = \"bow\"\nrepetitions = 1\n";
    let plan = Plan::parse(plan, "the plan").expect("a plan");
    let first = Leader { leaves: true, ..Leader::default() };
    // What is worn, and how, stands in a file, as `live` reads it.
    let worn = |angle_deg: u32| {
        let (_, what) = source.split_once('=').expect("a name");
        let file = lab.with_file_name(format!("worn-{angle_deg}.toml"));
        let forward = format!("forward = \"{angle_deg} deg from x to y\"");
        let text = format!("[segments]\ntorso = {{ sensor = \"{what}\", {forward} }}\n");
        std::fs::write(&file, text).expect("written");
        vec![file.display().to_string()]
    };
    let begun = SessionOrder { wear: worn(20), ..order(&lab, None, Some(plan)) };
    let report = led(begun, &first);
    let session: SessionFile = read(&lab.join("session.toml"));
    assert_eq!(session.sources, std::slice::from_ref(&source));
    let forward = session.forward["torso"].forward().expect("a direction").expect("known");
    assert!((forward.angle_between(DVec3::X).to_degrees() - 20.0).abs() < 1e-9, "{forward}");
    let other = SessionOrder { wear: worn(30), ..order(&lab, None, None) };
    let refused = open(other).err().expect("a refusal").to_string();
    assert!(refused.contains("--wear") && refused.contains("other settings"), "{refused}");
    assert_eq!((report.outcome, report.trials, &report.manifest), (Outcome::Stopped, 0, &None));
    assert_eq!(report.subjects, ["s01"]);
    assert_eq!(first.log().last(), Some(&Entry::Asked("wish")));
    assert!(!first.has(&Entry::Asked("actions")), "the plan says what is recorded");
    assert!(!lab.join("trials/bow-01.mcap").exists() && !lab.join("manifest.toml").exists());

    // Another plan would be ignored, so it is refused, and so is one that is none.
    let other = Plan::of_names(&["walk"]).expect("a plan");
    for (plan, said) in [(other, "begun with other settings"), (Plan::default(), "must name")] {
        let refused = open(order(&lab, None, Some(plan))).err().expect("a refusal").to_string();
        assert!(refused.contains(said), "{refused}");
    }

    // It goes on without being told the sensors again, and asks nothing that it knows.
    let second = Leader::default();
    let report = led(order(&lab, None, None), &second);
    assert_eq!((report.outcome, report.kept), (Outcome::Done, 1));
    let log = second.log();
    let text = str::to_owned;
    let begun = [
        Entry::GoingOn(text("lab")),
        Entry::Next(text("bow"), 0, 1),
        Entry::Asked("explained?"),
        Entry::Asked("practised?"),
        Entry::Asked("wish"),
        Entry::Facing(text("s01")),
        Entry::Recording(text("bow-01")),
    ];
    assert_eq!(log[..begun.len()], begun, "{log:#?}");
    assert_eq!(log.iter().rev().nth(1), Some(&Entry::Finishing));
    let device: DeviceCheck = read(&lab.join("calibration/device-01.toml"));
    assert_eq!(device.sensors.len(), 1);
    let trial: TrialFile = read(&lab.join("trials/bow-01.toml"));
    assert_eq!((trial.verdict, trial.good_repetitions), (Verdict::Keep, 10));
}
