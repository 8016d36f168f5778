//! `live`: a robot does now what a body does. The whole job, in order.

use super::follow::{self, Balancing};
use super::model::robot_model;
use super::observer::{Event, Observer};
use super::play;
use super::recorder::RunRecorder;
use super::report::{Outcome, OwnProfile, PlayReport};
use super::source;
use super::weight::Witness;
use crate::capture;
use crate::control::{self, Input, Settings, inject, net};
use crate::error::Error;
use crate::mocap::files::CaptureOptions;
use crate::mocap::retarget::{self, Online};
use crate::motion::Trend;
use crate::recording::SampleEncoding;
use crate::rig::{Address, Connection, calibrated, connect};
use crate::robot::Robot;
use crate::robot::preflight::{Accept, Preflight, preflight};
use crate::sensing::{Person, Plan};
use crate::time::{Duration, Instant};
use std::path::PathBuf;

mod lost;
pub(super) mod naming;
mod onto_robot;
mod performer;
mod report;
mod when;
mod words;
mod worn;

use naming::{HowNamed, NamedBody};
use onto_robot::{FollowingBody, OntoRobot};
use performer::Performer;
pub use report::{BodyReport, LatencyReport, LiveJoint, LiveReport, MountReport};
pub use when::{AnswersReport, CheckedAnswer, GivenAnswer, When};

/// Whom a robot follows, and how.
#[derive(Clone, Debug)]
pub struct LiveOrder {
    /// Sensors (`SEGMENT=imu:PROFILE@BUS`, trackers), or alone `replay:FILE.mcap`, `file:MOTION`.
    pub from: Vec<String>,
    /// Which segment wears which sensor: `SEGMENT=SENSOR`, or files of those.
    pub wear: Vec<String>,
    /// The robot, by name or path of its file; `None`: only the body is shown.
    pub robot: Option<String>,
    /// Where its lines are.
    pub buses: Vec<Address>,
    /// Its calibration; `None`: the usual one, if there is one and the robot is real.
    pub calibration: Option<PathBuf>,
    /// Seed of a virtual robot.
    pub seed: u64,
    /// How samples of sensors are recorded.
    pub samples: SampleEncoding,
    /// Cycles per second; `None`: as the robot's file says.
    pub rate_hz: Option<f64>,
    /// Follow for this time, then come to rest.
    pub time: Option<Duration>,
    /// How the body is calibrated.
    pub plan: Plan,
    /// Calibration of the body: taken up if the file is there, else made and kept there.
    pub body_calibration: Option<PathBuf>,
    /// Make it anew, and replace the file.
    pub recalibrate: bool,
    /// Which sensors headings are told from.
    pub mode: capture::Mode,
    /// Record goals, measured states and the samples of all sensors to this file.
    pub record: Option<PathBuf>,
    /// The recording may replace a file that is there.
    pub replace: bool,
    /// Move servos whose firmware the profile was not checked against.
    pub accept_firmware: bool,
    /// It hangs on a stand: its feet need not carry it.
    pub hangs: bool,
    /// A virtual robot has weight and may fall.
    pub physics: bool,
    /// It feels how its base tilts, and answers.
    pub balances: bool,
    /// Script of faults that befall a virtual robot.
    pub faults: Option<PathBuf>,
    /// Write nothing to the robot; show the body's angles.
    pub dry_run: bool,
    /// Name what who wears the sensors does.
    pub recognise: bool,
    /// Folder of models for that, in place of the shipped ones.
    pub models: Option<PathBuf>,
    /// What the robot plays when the person does something that is named.
    pub when: Vec<When>,
    /// An arm or the head whose sensor is lost rests, and the others are followed.
    pub keep_going: bool,
    /// Somebody is followed although sensors seem to be swapped.
    pub despite_swaps: bool,
}

impl LiveOrder {
    /// Whom to follow, in one line.
    #[must_use]
    pub fn motion(&self) -> String {
        let named = self.from.iter().chain(&self.wear).map(String::as_str);
        named.collect::<Vec<_>>().join(" ")
    }

    /// True if what the person does is to be named.
    const fn names(&self) -> bool {
        self.recognise || !self.when.is_empty()
    }

    /// How what answers is played.
    fn answer_options(&self) -> play::Options {
        play::Options { balance: self.balances, ..play::Options::default() }
    }

    /// A report of nothing yet.
    #[must_use]
    pub fn report(&self) -> LiveReport {
        let robot = self.robot.as_deref().unwrap_or("no robot");
        let buses = self.buses.iter().map(ToString::to_string).collect();
        let mut run = PlayReport::new(&self.motion(), robot, buses);
        run.dry_run = self.dry_run;
        LiveReport::new(run)
    }
}

/// What the whole job shares.
struct Job<'a> {
    order: &'a LiveOrder,
    observer: &'a dyn Observer,
    person: &'a dyn Person,
    report: LiveReport,
    /// How what is done is named; `None`: by the order's models, as a person does it.
    how: Option<HowNamed>,
    named: Option<NamedBody>,
}

/// Follows and reports; whatever goes wrong is in the report. `person` wears the sensors, or speaks for
/// whoever does.
#[must_use]
pub fn live(order: &LiveOrder, observer: &dyn Observer, person: &dyn Person) -> LiveReport {
    let report = order.report();
    let mut job = Job { order, observer, person, report, how: None, named: None };
    match net::catch(|| job.live()) {
        Ok(Ok(())) => {}
        Ok(Err(error)) => job.report.run.describe_refused(&error),
        Err(words) => job.report.run.describe_broken(&words),
    }
    job.report
}

/// Hears who wears sensors, and names what they do; nothing is named if they stop before they are calibrated.
///
/// # Errors
/// Sensors that cannot be opened or were not calibrated, models that cannot be read.
pub(super) fn named(
    order: &LiveOrder,
    how: HowNamed,
    observer: &dyn Observer,
    person: &dyn Person,
) -> Result<(LiveReport, Option<NamedBody>), Error> {
    let report = order.report();
    let mut job = Job { order, observer, person, report, how: Some(how), named: None };
    job.follow_sensors()?;
    Ok((job.report, job.named))
}

/// A robot that was looked at and not touched.
struct Ready {
    connection: Connection,
    found: Preflight,
    settings: Settings,
    /// Who sees whether a virtual robot with weight falls.
    witness: Option<Witness>,
}

impl Ready {
    /// Says what became of a virtual robot with weight.
    fn describe_weight(&self, report: &mut LiveReport) {
        if let Some(witness) = &self.witness {
            play::describe_weight(&mut report.run, &self.connection, witness);
        }
    }

    /// Looks at it once more: somebody may have moved it meanwhile.
    fn look_again(&mut self, order: &LiveOrder) -> Result<(), Error> {
        self.found = look(order, &mut self.connection, self.settings)?;
        Ok(())
    }

    /// How it keeps its balance from where it stands, if it is to, and the robot that goals are made for.
    fn balancing(&self, order: &LiveOrder) -> Result<(Option<Balancing>, Robot), Error> {
        let robot = self.connection.link.robot();
        if !order.balances {
            return Ok((None, robot.clone()));
        }
        let balancing = Balancing::of(robot, &self.found.start_rad, self.settings)?;
        let leaves = balancing.leaves.clone();
        Ok((Some(balancing), leaves))
    }

    fn follow(
        &mut self,
        balancing: Option<Balancing>,
        newest: &mut control::mirror::Source<'_>,
        recorder: &mut RunRecorder,
        observer: &dyn Observer,
        report: &mut LiveReport,
    ) -> Result<bool, Error> {
        let Self { connection, found, settings, .. } = self;
        let ready = follow::Ready { connection, found, settings: *settings, pace: 1.0, balancing };
        ready.follow(newest, recorder, None, observer, report)
    }
}

impl Job<'_> {
    fn live(&mut self) -> Result<(), Error> {
        match self.order.from.as_slice() {
            [one] if one.starts_with("file:") => self.perform(one.trim_start_matches("file:")),
            _ => self.follow_sensors(),
        }
    }

    /// Connects to the robot and looks at it; `None` if none was named.
    fn robot(&mut self) -> Result<Option<Ready>, Error> {
        let order = self.order;
        let run = &mut self.report.run;
        let Some(name) = &order.robot else { return Ok(None) };
        if order.balances && order.hangs {
            return Err(Error::new("a robot on a stand does not balance")
                .at("--balance")
                .got("--hang too")
                .allowed("one of the two")
                .remedy("leave one of them out"));
        }
        let (robot, calibration) = calibrated(name, &order.buses, order.calibration.as_deref())?;
        run.calibration = calibration.map(|path| path.display().to_string());
        run.robot.clone_from(&robot.name);
        run.profiles = OwnProfile::of(&robot);
        if order.buses.is_empty() {
            return Ok(None);
        }
        // One that can follow nobody is not woken for it.
        robot_model(&robot)?;
        let rate_hz = order.rate_hz.unwrap_or(robot.file.rate_hz);
        run.cycle_hz = rate_hz;
        let settings = Settings::at_rate(rate_hz);
        let mut connection = connect(robot, &order.buses, order.seed)?;
        let witness = order.physics.then(|| play::give_weight(&connection, order.hangs));
        let witness = witness.transpose()?;
        if let Some(script) = &order.faults {
            play::befall(&connection, script)?;
        }
        let found = look(order, &mut connection, settings)?;
        run.describe_preflight(&found);
        Ok(Some(Ready { connection, found, settings, witness }))
    }

    /// Follows a capture or actions that somebody performs now.
    fn perform(&mut self, motion: &str) -> Result<(), Error> {
        if self.order.names() {
            return Err(Error::new("a motion that is known is not named while it is followed")
                .at("--recognise")
                .got(format!("file:{motion}"))
                .remedy(format!("`gaitway recognise {motion}` names what is done in it")));
        }
        if self.order.keep_going {
            return Err(Error::new("no sensor of a motion can be lost")
                .at("--keep-going")
                .got(format!("file:{motion}"))
                .allowed("sensors, or a recording of some (replay:FILE.mcap)"));
        }
        let (capture, origin) = source::body_motion(motion, None, &CaptureOptions::default())?;
        self.report.run.source = origin;
        self.report.run.notes.extend(capture.notes.iter().cloned());
        self.report.worn = capture.tracked;
        let Some(mut ready) = self.robot()? else {
            return Err(Error::new("which robot, and where?")
                .remedy("add --robot and --bus; only sensors are shown without"));
        };
        let (balancing, robot) = ready.balancing(self.order)?;
        let model = robot_model(&robot)?;
        let settings = retarget::Settings::default();
        let online = Online::new(&model, &capture.tracked, &ready.found.start_rad, &settings)?;
        self.report.run.trunk_lean_lost = retarget::trunk_lean_lost(&capture, &model);
        let lean = self.report.run.trunk_lean_lost;
        self.report.run.notes.extend(lean.and_then(retarget::TrunkLean::note));
        self.report.run.notes.extend(online.notes().iter().cloned());
        let body = FollowingBody::of(&robot, &model, &capture.tracked, self.order.hangs)?;
        let warning = body.as_ref().and_then(FollowingBody::warning);
        warning.into_iter().for_each(|warning| self.observer.hear(Event::Note(warning)));
        if self.order.dry_run {
            self.report.run.outcome = Outcome::Done;
            return Ok(());
        }
        let adjuster = body.as_ref().map(|body| body.adjuster(&ready.found.start_rad));
        let mut onto = OntoRobot::new(&model, online, adjuster);
        let longest_s = self.order.time.map(|time| time.as_secs_f64());
        let mut performer = Performer::new(capture, longest_s);
        let mut trend = Trend::default();
        let mut began: Option<Instant> = None;
        let mut before_s: Option<f64> = None;
        let mut newest = |now: Instant, approaching: bool| {
            let now_s = now.seconds_since(*began.get_or_insert(now));
            let is_coming = approaching || onto.is_arriving();
            let waits = onto.is_late() || onto.is_stepping();
            let Some(pose) = performer.pose(now_s, is_coming, waits) else { return Input::End };
            let dt_s = before_s.map_or(0.0, |before_s| now_s - before_s);
            before_s = Some(now_s);
            trend.push(now_s, &onto.pose(&pose, dt_s, approaching));
            trend.target(now_s).map_or(Input::Nothing, Input::Pose)
        };
        let mut recorder = self.recorder(&ready.connection)?;
        let followed =
            ready.follow(balancing, &mut newest, &mut recorder, self.observer, &mut self.report);
        self.report.describe_feet(&onto);
        self.report.describe_body();
        ready.describe_weight(&mut self.report);
        match followed {
            Ok(true) => recorder.finish(&mut self.report.run, &ready.connection),
            other => {
                recorder.discard();
                other?;
            }
        }
        Ok(())
    }

    /// Once torque is on, nothing may keep the loop from its first cycle: the file comes before.
    fn recorder(&self, connection: &Connection) -> Result<RunRecorder, Error> {
        let (path, force) = (self.order.record.as_deref(), self.order.replace);
        RunRecorder::begin(path, force, false, connection, &self.order.motion())
    }

    /// What sensors say, if it is to be kept, where no robot follows.
    fn recorder_without_robot(&self) -> Result<Option<RunRecorder>, Error> {
        let (path, force) = (self.order.record.as_deref(), self.order.replace);
        let begin = |path| RunRecorder::begin_without_robot(path, force, &self.order.motion());
        let recorder = path.map(begin).transpose()?;
        Ok(recorder.inspect(|recorder| recorder.write_samples_as(self.order.samples)))
    }

    /// The same, with room for the samples of many sensors.
    fn recorder_for_sensors(&self, connection: &Connection) -> Result<RunRecorder, Error> {
        let (path, force) = (self.order.record.as_deref(), self.order.replace);
        let motion = self.order.motion();
        let recorder = RunRecorder::begin_with_sensors(path, force, connection, &motion)?;
        recorder.write_samples_as(self.order.samples);
        Ok(recorder)
    }
}

/// Looks at every servo, and at what the base feels if that is to be answered; writes nothing.
fn look(
    order: &LiveOrder,
    connection: &mut Connection,
    settings: Settings,
) -> Result<Preflight, Error> {
    inject::point("preflight", 0);
    let accept = Accept { firmware: order.accept_firmware, eeprom: false };
    let found = preflight(&mut connection.link, settings.period, accept)?;
    if order.balances {
        play::feel_first(&mut connection.link, &found)?;
    }
    Ok(found)
}
