//! `record --session`: an operator is led through a whole recording session.
//!
//! What is to be done next follows from what is in the folder
//! ([`Progress`](crate::session::Progress)), so the session can be ended anywhere, by any means, and
//! gone on with.

mod console;
mod device;
mod finish;
mod setup;
mod subject;
mod trial;

use super::RecordArgs;
use crate::body::Segment;
use crate::body::segment_name;
use crate::cli::cues;
use crate::cli::report::Outcome;
use crate::cli::signals::Signals;
use crate::cli::{Deed, Remarks};
use crate::error::{Error, ErrorKind};
use crate::job::record::Mode;
use crate::sensing::{Hub, Intake, SensingEvent, Source, StopAtEnd, What, wall_clock};
use crate::session::wearers::wearer;
use crate::session::{Folder, Plan, Progress, SessionFile, Step, Verdict};
use crate::time::Utc;
use console::{Console, Ended};
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

/// A sensor of a session.
struct Worn {
    /// The name under which it is heard.
    heard: String,
    /// The name that says where it is worn.
    name: String,
    rate_hz: f64,
}

/// The session that runs.
struct Job<'a> {
    folder: &'a Folder,
    console: &'a Console,
    hub: &'a Hub,
    worn: &'a [Worn],
    progress: Progress,
}

impl Job<'_> {
    fn now(&self) -> Utc {
        wall_clock()
    }

    /// What the session is.
    fn session(&self) -> Result<&SessionFile, Error> {
        self.progress.session.as_ref().ok_or_else(|| Error::new("the session is not set up"))
    }

    /// Names of the sources.
    fn names(&self) -> Vec<String> {
        self.worn.iter().map(|worn| worn.name.clone()).collect()
    }

    fn nominal_rate_hz(&self, name: &str) -> f64 {
        self.worn.iter().find(|worn| worn.name == name).map_or(0.0, |worn| worn.rate_hz)
    }

    /// Number of a subject among those of the session.
    fn wearer_of(&self, id: &str) -> usize {
        let subjects = self.progress.session.as_ref().map(|session| &session.subjects);
        subjects.and_then(|ids| ids.iter().position(|known| known == id)).unwrap_or(0)
    }

    /// Reads again what is there.
    fn reload(&mut self) -> Result<(), Error> {
        self.progress = Progress::read(self.folder)?;
        Ok(())
    }
}

/// What came of it.
#[derive(Serialize)]
struct Report {
    outcome: &'static str,
    session: PathBuf,
    subjects: Vec<String>,
    trials: usize,
    kept: usize,
    good_repetitions: u32,
    manifest: Option<PathBuf>,
}

/// Leads a session, from its beginning or from where it was left.
///
/// # Errors
/// A folder or sources that cannot be used; a disk that fails.
pub fn run(
    args: &RecordArgs,
    root: &Path,
    signals: Signals,
    remarks: Remarks,
) -> Result<i32, Error> {
    args.output.check_files(&[])?;
    let plan = args.plan.as_deref().map(read_plan).transpose()?;
    if args.sources.is_empty() && !root.join("session.toml").exists() {
        // A name mistyped makes no folder.
        return Err(no_sensors().at(root.display().to_string()));
    }
    let folder = Folder::open(root)?;
    let progress = Progress::read(&folder)?;
    if progress.finished {
        remarks.say("the session is finished already");
        return Ok(report(args, &folder, &progress));
    }
    if let Some(begun) = &progress.session {
        check_as_begun(args, plan.as_ref(), begun)?;
    }
    let (texts, wear) = given(args, &progress)?;
    let worn = sensors(&texts, &wear)?;
    check_names(&worn, progress.session.as_ref())?;
    let heard: Vec<String> = worn.iter().map(|worn| worn.heard.clone()).collect();
    let open = |text: &String| text.parse::<Source>()?.open(&heard);
    let opened = texts.iter().map(open).collect::<Result<Vec<_>, Error>>()?;
    let given = setup::Given {
        sources: texts,
        wear,
        names: worn.iter().map(|worn| worn.name.clone()).collect(),
        plan,
        magnetometer: args.magnetometer,
    };
    let nine = progress.session.as_ref().map_or(args.magnetometer, |s| s.magnetometer);
    let mode = if nine { Mode::NineAxes } else { Mode::SixAxes };
    let hub = Hub::of(worn.iter().map(|worn| (worn.heard.clone(), worn.name.clone())));
    let stop = AtomicBool::new(false);
    let tell = |event: SensingEvent<'_>| remarks.say(&cues::of_event(event));
    let intake = Intake::new(None, &stop, mode, &tell).heard_by_hub(&hub);
    let console = Console::listen(signals)?;
    let ended = std::thread::scope(|scope| {
        let _stop = StopAtEnd(&stop);
        for source in opened {
            let intake = &intake;
            scope.spawn(move || source.record(intake));
        }
        let (folder, console, hub, worn) = (&folder, &console, &hub, &worn[..]);
        let mut job = Job { folder, console, hub, worn, progress };
        lead(&mut job, given)
    });
    let on = format!("to go on: gaitway record --session {}", root.display());
    match ended {
        Ok(()) => Ok(report(args, &folder, &Progress::read(&folder)?)),
        Err(Ended::Stopped) => {
            console.say(&format!("\nstopped; {on}"));
            Ok(Outcome::Stopped.exit_code())
        }
        Err(Ended::Signal(number)) => {
            console.say(&format!("\nstopped; {on}"));
            Ok(128 + number)
        }
        Err(Ended::Failed(error)) => {
            console.say(&format!("\nwhat was done is kept; {on}"));
            Err(error)
        }
    }
}

/// Step by step, until nothing is left.
fn lead(job: &mut Job, given: setup::Given) -> Result<(), Ended> {
    let mut given = Some(given);
    if let Some(session) = &job.progress.session {
        job.console.say(&format!(
            "Session {}, begun {}: going on where it was.",
            session.name, session.begun
        ));
    }
    loop {
        job.reload()?;
        match job.progress.next(job.now()) {
            Step::SetUp => {
                let given = given
                    .take()
                    .ok_or_else(|| Error::of(ErrorKind::Absent, "there is no session.toml"))?;
                setup::session(job.console, job.folder, given, job.now())?;
            }
            Step::Subject(id) => setup::subject(job.console, job.folder, &id)?,
            Step::Device => device::calibrate(job)?,
            Step::Body(id) => subject::calibrate(job, &id)?,
            Step::Judge(name) => {
                job.console.say(&format!("\nTrial {name} was recorded and not judged."));
                trial::judge(job, &name)?;
            }
            Step::Trial(action, number, subjects) => trial::trial(job, action, number, &subjects)?,
            Step::Finish => finish::finish(job)?,
            Step::Finished => return Ok(()),
        }
    }
}

fn read_plan(path: &Path) -> Result<Plan, Error> {
    Plan::parse(&gaitway_profiles::read_text(path)?, &path.display().to_string())
}

/// Sources and who wears which tracker, as typed now or, of a session that goes on, before.
fn given(
    args: &RecordArgs,
    progress: &Progress,
) -> Result<(Vec<String>, BTreeMap<String, String>), Error> {
    if args.sources.is_empty() {
        let session = progress.session.as_ref().ok_or_else(no_sensors)?;
        return Ok((session.sources.clone(), session.wear.clone()));
    }
    let mut wear = BTreeMap::new();
    for text in &args.wear {
        let pair = text.split_once('=').filter(|(segment, _)| wearer(segment).is_some());
        let (segment, tracker) = pair.ok_or_else(|| unnamed(text).at("--wear"))?;
        wear.insert(tracker.to_owned(), segment.to_owned());
    }
    Ok((args.sources.iter().map(|source| source.text.clone()).collect(), wear))
}

fn no_sensors() -> Error {
    Error::new("a session needs sensors")
        .allowed("SEGMENT=imu:PROFILE@BUS for each sensor that is worn")
        .remedy("e.g. gaitway record --session lab torso=imu:bno08x-rvc@/dev/ttyUSB0")
}

/// What a session is to be is said once, when it begins: what is typed later and differs would be
/// ignored, so it is refused.
fn check_as_begun(
    args: &RecordArgs,
    plan: Option<&Plan>,
    begun: &SessionFile,
) -> Result<(), Error> {
    let differs = if plan.is_some_and(|plan| *plan != begun.plan) {
        "--plan"
    } else if args.magnetometer && !begun.magnetometer {
        "--magnetometer"
    } else if args.sources.is_empty() && !args.wear.is_empty() {
        "--wear without sources"
    } else {
        return Ok(());
    };
    Err(Error::new("the session was begun with other settings")
        .at(differs)
        .allowed("what stands in session.toml")
        .remedy("leave it out to go on, or begin another session"))
}

/// The sensors that these sources bring.
fn sensors(texts: &[String], wear: &BTreeMap<String, String>) -> Result<Vec<Worn>, Error> {
    let mut worn = Vec::new();
    for text in texts {
        let source: Source = text.parse()?;
        match &source.what {
            What::Imu { profile, .. } => {
                let name = source.name.filter(|name| wearer(name).is_some());
                let name = name.ok_or_else(|| unnamed(text))?;
                let rate_hz = gaitway_profiles::sensor(profile)?.rate_hz;
                worn.push(Worn { heard: name.clone(), name, rate_hz });
            }
            What::Trackers { profile, .. } if !wear.is_empty() => {
                let rate_hz = gaitway_profiles::sensor(profile)?.rate_hz;
                worn.extend(wear.iter().map(|(heard, name)| Worn {
                    heard: heard.clone(),
                    name: name.clone(),
                    rate_hz,
                }));
            }
            What::Trackers { .. } => {
                return Err(Error::new("which segment wears which tracker?").got(text).remedy(
                    "add --wear left_thigh=tracker-00aa01-0 for each; `gaitway record` names \
                     those it hears",
                ));
            }
            What::Lines { .. } | What::Servos { .. } => {
                return Err(Error::new("a session records sensors that are worn")
                    .got(text)
                    .allowed(
                        "SEGMENT=imu:PROFILE@BUS, or imu:slimevr@udp:0.0.0.0:6969 with --wear",
                    ));
            }
        }
    }
    Ok(worn)
}

fn unnamed(text: &str) -> Error {
    Error::new("which segment wears this sensor?").got(text).allowed(format!(
        "{} before the =, of a second subject with 2- before that",
        Segment::ALL.map(segment_name).join(", ")
    ))
}

/// Each segment once, and the same ones as before.
fn check_names(worn: &[Worn], session: Option<&SessionFile>) -> Result<(), Error> {
    let mut segments: Vec<_> = worn.iter().map(|worn| wearer(&worn.name)).collect();
    segments.sort();
    if let Some(twice) = segments.windows(2).find(|pair| pair[0] == pair[1]) {
        let name = worn.iter().find(|worn| wearer(&worn.name) == twice[0]);
        return Err(Error::new("two sensors are worn on one segment")
            .at(name.map_or_else(String::new, |worn| worn.name.clone())));
    }
    let Some(session) = session else { return Ok(()) };
    let before = sensors(&session.sources, &session.wear)?;
    let mut before: Vec<String> = before.into_iter().map(|worn| worn.name).collect();
    let mut now: Vec<String> = worn.iter().map(|worn| worn.name.clone()).collect();
    before.sort();
    now.sort();
    if before == now {
        return Ok(());
    }
    Err(Error::new("the session was begun with other sensors")
        .got(now.join(", "))
        .allowed(before.join(", "))
        .remedy("give the same names (lines may have changed), or begin another session"))
}

fn report(args: &RecordArgs, folder: &Folder, progress: &Progress) -> i32 {
    let kept = progress.trials.iter().filter(|trial| trial.verdict == Verdict::Keep);
    let report = Report {
        outcome: "done",
        session: folder.root().to_owned(),
        subjects: progress.subjects.keys().cloned().collect(),
        trials: progress.trials.len(),
        kept: kept.count(),
        good_repetitions: progress.trials.iter().map(|trial| trial.counted()).sum(),
        manifest: progress.finished.then(|| folder.path("manifest.toml")),
    };
    let text = format!(
        "finished: {} trials, {} kept, {} good repetitions\nwritten   {}\n",
        report.trials,
        report.kept,
        report.good_repetitions,
        folder.path("manifest.toml").display()
    );
    args.output.conclude(&report, &text, Deed::Work, 0)
}
