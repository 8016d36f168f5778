//! An operator, or a program in the operator's place, is led through a whole recording session: what it
//! is, measures, calibrations, trials, and in the end joint angles and the manifest.
//!
//! What is to be done next follows from what is in the folder ([`Progress`]), so the session can be
//! ended anywhere, by any means, and gone on with. Whoever leads it is an [`Operator`]: answers
//! questions and hears what happens.

mod demonstration;
mod device;
mod finish;
mod happening;
mod judge;
mod looking;
mod notice;
#[cfg(test)]
mod obliging;
mod operator;
mod order;
mod panel;
mod report;
mod setup;
mod subject;
mod trial;
pub mod words;

pub use demonstration::find_demonstrations;
pub use happening::{CutShort, Happening, RecordedTrial, Settled, TrialFault, TrialPart};
pub use operator::{
    Answered, Doubt, During, Instead, Judged, Mark, MeasureAnswer, Mend, Operator, Ready,
    Repetitions, Unsteady, Wish, Words,
};
pub use order::SessionOrder;
pub use panel::OnPage;
pub use report::SessionReport;

use crate::body::anthropometry::Subject;
use crate::capture::Mode;
use crate::error::{Error, ErrorKind};
use crate::job::report::Outcome;
use crate::recording::SampleEncoding;
use crate::sensing::{Ended, Hub, Intake, Opened, SensingEvent, StopAtEnd, wall_clock};
use crate::session::{Folder, Plan, Progress, SessionFile, Step};
use looking::Looking;
use notice::WithNotice;
use order::{Straps, Worn};
use setup::Given;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// A session of which something is left to be done: its folder is taken, its sensors are open.
pub struct Session {
    folder: Arc<Folder>,
    progress: Progress,
    given: Given,
    known: Vec<Subject>,
    worn: Vec<Worn>,
    opened: Vec<Opened>,
    mode: Mode,
    samples: SampleEncoding,
}

/// What there is in a session's folder.
pub enum SessionState {
    /// Something is left to be done.
    Open(Box<Session>),
    /// Nothing is left: what came of it. No sensor was opened.
    Finished(SessionReport),
}

/// Opens a session, from its beginning or from where it was left.
///
/// # Errors
/// A plan that is none, a folder or sensors that cannot be used, other sensors or settings than it was
/// begun with.
pub fn open(order: SessionOrder) -> Result<SessionState, Error> {
    // A plan out of a file was looked at; one that a program put together may say anything.
    let order = SessionOrder { plan: order.plan.map(Plan::checked).transpose()?, ..order };
    for action in order.plan.iter().flat_map(|plan| &plan.actions) {
        demonstration::check(action)?;
    }
    let (order, forward) = order.with_files()?;
    order.check_sensors()?;
    let root = order.folder.clone();
    let missing = root.ancestors().take_while(|of| !of.as_os_str().is_empty() && !of.exists());
    let missing: Vec<PathBuf> = missing.map(Path::to_owned).collect();
    let folder = Arc::new(Folder::open(&root)?);
    opened_in(Arc::clone(&folder), order, forward)
        .inspect_err(|_| folder.take_away_unused(&missing))
}

/// The same, once its folder is taken.
fn opened_in(
    folder: Arc<Folder>,
    order: SessionOrder,
    forward: Straps,
) -> Result<SessionState, Error> {
    let progress = Progress::read(&folder)?;
    if progress.finished {
        let report = SessionReport::of(Outcome::Done, &folder, &progress);
        return Ok(SessionState::Finished(report));
    }
    let begun = progress.session.as_ref();
    if let Some(begun) = begun {
        order.check_as_begun(begun, &forward)?;
    }
    let (sources, wear) = order.worn_by(begun)?;
    let worn = order::sensors(&sources, &wear)?;
    order::check_names(&worn, begun)?;
    let heard: Vec<String> = worn.iter().map(|worn| worn.heard.clone()).collect();
    let (mut opened, mut refused) = (Vec::new(), Vec::new());
    for source in &sources {
        match source.open(&heard) {
            Ok(one) => opened.push(one),
            Err(error) => refused.push(error),
        }
    }
    // All that cannot be opened, so that nobody has to try once for each.
    let mut refused = refused.into_iter();
    if let Some(first) = refused.next() {
        return Err(Error { also: refused.collect(), ..first });
    }
    let nine = begun.map_or(order.magnetometer, |begun| begun.magnetometer);
    let mode = if nine { Mode::NineAxes } else { Mode::SixAxes };
    let given = Given {
        sources: sources.into_iter().map(|source| source.text).collect(),
        wear,
        forward,
        plan: order.plan,
        magnetometer: order.magnetometer,
    };
    let (known, samples) = (order.known, order.samples);
    let session = Session { folder, progress, given, known, worn, opened, mode, samples };
    Ok(SessionState::Open(Box::new(session)))
}

impl Session {
    /// Leads it to its end, or to where the operator stops. What is asked for meanwhile stands in its folder
    /// ([`Now`](crate::session::now::Now)).
    ///
    /// # Errors
    /// A disk that fails, a file of the session that was changed into something else. What was done is
    /// kept, and can be gone on with.
    pub fn lead(self, operator: &dyn Operator) -> Result<SessionReport, Error> {
        let Self { folder, progress, given, known, worn, opened, mode, samples } = self;
        let with_notice = WithNotice::new(operator, &folder);
        let operator: &dyn Operator = &with_notice;
        let hub = Hub::of(worn.iter().map(|worn| (worn.heard.clone(), worn.name.clone())));
        let stop = AtomicBool::new(false);
        let tell = |event: SensingEvent<'_>| operator.hear(Happening::Sensing(event));
        let intake = Intake::new(None, &stop, mode, &tell).heard_by_hub(&hub).patient();
        let looking = Looking::default();
        let mut job = Job {
            folder: &folder,
            operator,
            hub: &hub,
            worn: &worn,
            looking: &looking,
            known: &known,
            samples,
            progress,
        };
        let ended = std::thread::scope(|scope| {
            let _stop = StopAtEnd(&stop);
            for source in opened {
                let intake = &intake;
                scope.spawn(move || source.record(intake));
            }
            if operator.looks() {
                scope.spawn(|| looking.look(&hub, &worn, operator, &stop));
            }
            step_by_step(&mut job, given)
        });
        let outcome = match ended {
            Ok(()) => Outcome::Done,
            Err(Ended::Stopped) => Outcome::Stopped,
            Err(Ended::Failed(error)) => return Err(error),
        };
        Ok(SessionReport::of(outcome, &folder, &job.progress))
    }
}

/// The session that runs.
struct Job<'a> {
    folder: &'a Folder,
    operator: &'a dyn Operator,
    hub: &'a Hub,
    worn: &'a [Worn],
    looking: &'a Looking,
    /// Subjects of other sessions.
    known: &'a [Subject],
    samples: SampleEncoding,
    progress: Progress,
}

impl Job<'_> {
    /// What the session is.
    fn session(&self) -> Result<&SessionFile, Error> {
        self.progress.session.as_ref().ok_or_else(|| Error::new("the session is not set up"))
    }

    /// Names of the sensors.
    fn names(&self) -> Vec<String> {
        self.worn.iter().map(|worn| worn.name.clone()).collect()
    }

    /// Number of a subject among those of the session, from zero.
    fn number_of(&self, id: &str) -> usize {
        let subjects = self.progress.session.as_ref().map(|session| &session.subjects);
        subjects.and_then(|ids| ids.iter().position(|known| known == id)).unwrap_or(0)
    }

    /// Fails once the operator wants it to end.
    fn check(&self) -> Answered<()> {
        if self.operator.person().wants_to_stop() { Err(Instead::Stop) } else { Ok(()) }
    }

    /// Reads again what is there.
    fn reload(&mut self) -> Result<(), Error> {
        self.progress = Progress::read(self.folder)?;
        Ok(())
    }
}

/// Until nothing is left.
fn step_by_step(job: &mut Job, given: Given) -> Result<(), Ended> {
    let mut given = Some(given);
    if let Some(session) = &job.progress.session {
        job.operator.hear(Happening::GoingOn(session));
    }
    if let Some(last) = job.progress.trials.iter().max_by_key(|trial| trial.judged) {
        job.operator.hear(Happening::Settled(Settled::Trial(last)));
    }
    loop {
        job.reload()?;
        let steps = job.progress.ahead(wall_clock());
        let session = job.progress.session.as_ref();
        job.operator.hear(Happening::Ahead { session, steps: &steps });
        match steps.into_iter().next().unwrap_or(Step::Finished) {
            Step::SetUp => {
                let given = given
                    .take()
                    .ok_or_else(|| Error::of(ErrorKind::Absent, "there is no session.toml"))?;
                setup::session(job, given)?;
            }
            Step::Subject(id) => setup::subject(job, &id)?,
            Step::Device => device::calibrate(job)?,
            Step::Body(id) => subject::calibrate(job, &id)?,
            Step::Judge(trial) => {
                job.operator.hear(Happening::Unjudged { trial: &trial });
                judge::judge(job, &trial)?;
            }
            Step::Trial(action, number, subjects) => trial::trial(job, action, number, &subjects)?,
            Step::Finish => finish::finish(job)?,
            Step::Finished => return Ok(()),
        }
    }
}
