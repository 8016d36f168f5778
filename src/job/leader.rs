//! `follow`: a robot does what another does that somebody leads by hand. The whole job, in order.

use super::follow;
use super::live::LiveReport;
use super::observer::{Event, Observer};
use super::recorder::RunRecorder;
use super::report::{Outcome, OwnProfile, PlayReport};
use super::taught::refuse_who_only_obeys;
use crate::control::{self, Input, Settings, Stop, StopCode, inject, net};
use crate::error::{Error, ErrorKind, counted};
use crate::motion::Trend;
use crate::port::Clock;
use crate::rig::{Address, Connection, calibrated, connect};
use crate::robot::preflight::{Accept, Preflight, preflight, readable};
use crate::sensing::{Source, SourceReport, StopAtEnd, What};
use crate::time::{Duration, Instant};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Sender, channel};

mod doubt;
mod joints;

use joints::{GuidedArm, Look, Pairs};

/// So long the robot waits for a leader's first pose.
const PATIENCE: Duration = Duration::from_secs(3);

/// Shares of a robot's pace at which it may follow.
const PACES: core::ops::RangeInclusive<f64> = 0.05..=1.0;

/// Who leads, who follows, and how.
#[derive(Clone, Debug, PartialEq)]
pub struct LeadOrder {
    /// Who leads: `servos:ROBOT@BUS`.
    pub leader: String,
    /// Its calibration; `None`: the usual one, if there is one and it is real.
    pub leader_calibration: Option<PathBuf>,
    /// Its torque is switched off first.
    pub limp: bool,
    /// Joints that are led by the share of the leader's range, and not by its angle.
    pub by_range: Vec<String>,
    /// Who follows, by name or path of its file.
    pub robot: String,
    /// Where its lines are.
    pub buses: Vec<Address>,
    /// Its calibration; `None`: the usual one, if there is one and the robot is real.
    pub calibration: Option<PathBuf>,
    /// Seed of virtual robots.
    pub seed: u64,
    /// Cycles per second; `None`: as the robot's file says.
    pub rate_hz: Option<f64>,
    /// At which share of its velocity and acceleration limits it follows.
    pub pace: f64,
    /// Follow for this time, then come to rest; `None`: until the observer wants to stop.
    pub time: Option<Duration>,
    /// Record goals and measured states of who follows to this file.
    pub record: Option<PathBuf>,
    /// The recording may replace a file that is there.
    pub replace: bool,
    /// Move servos whose firmware the profile was not checked against.
    pub accept_firmware: bool,
    /// Look at both, write nothing.
    pub dry_run: bool,
}

impl LeadOrder {
    /// A report of nothing yet.
    #[must_use]
    pub fn report(&self) -> LiveReport {
        let buses = self.buses.iter().map(ToString::to_string).collect();
        let mut run = PlayReport::new(&self.leader, &self.robot, buses);
        run.dry_run = self.dry_run;
        LiveReport::new(run)
    }
}

/// Follows and reports; whatever goes wrong is in the report.
#[must_use]
pub fn follow_leader(order: &LeadOrder, observer: &dyn Observer) -> LiveReport {
    let mut report = order.report();
    match net::catch(|| followed(order, observer, &mut report)) {
        Ok(Ok(())) => {}
        Ok(Err(error)) => report.run.describe_refused(&error),
        Err(words) => report.run.describe_broken(&words),
    }
    report
}

fn followed(
    order: &LeadOrder,
    observer: &dyn Observer,
    report: &mut LiveReport,
) -> Result<(), Error> {
    if !PACES.contains(&order.pace) {
        return Err(Error::of(ErrorKind::OutsideLimits, "nobody follows at this pace")
            .at("--pace")
            .got(order.pace.to_string())
            .allowed(format!("{} to {}", PACES.start(), PACES.end())));
    }
    let Source { what: What::Servos { robot: name, addresses }, .. } = order.leader.parse()? else {
        return Err(Error::new("only a robot leads another")
            .got(order.leader.clone())
            .allowed("servos:ROBOT@BUS")
            .remedy("who wears sensors leads by `gaitway live`"));
    };
    let (robot, calibration) =
        calibrated(&order.robot, &order.buses, order.calibration.as_deref())?;
    let (leader, leader_calibration) =
        calibrated(&name, &addresses, order.leader_calibration.as_deref())?;
    report.run.calibration = calibration.map(|path| path.display().to_string());
    report.run.robot.clone_from(&robot.name);
    report.run.profiles = OwnProfile::of(&robot);
    let pairs = Pairs::of(&leader, &robot, &order.by_range)?;
    report.run.notes.extend(pairs.notes());
    if let Some(path) = leader_calibration {
        report.run.notes.push(format!("calibration of the leader {}", path.display()));
    }
    let mut connection = connect(robot, &order.buses, order.seed)?;
    let leader = connect(leader, &addresses, order.seed)?;
    let done = lead(order, leader, &mut connection, pairs, observer, report)?;
    if let Some(mut recorder) = done {
        recorder.finish(&mut report.run, &connection);
    }
    Ok(())
}

/// Looks at both, and lets one follow the other; the recording of what was done, if anything was.
fn lead(
    order: &LeadOrder,
    mut leader: Connection,
    connection: &mut Connection,
    pairs: Pairs,
    observer: &dyn Observer,
    report: &mut LiveReport,
) -> Result<Option<RunRecorder>, Error> {
    if leader.real_time != connection.real_time {
        return Err(Error::new("one of both robots runs in virtual time, the other does not")
            .at("LEADER, --bus")
            .remedy("take sim:pty in place of sim: a virtual robot in real time"));
    }
    let rate_hz = order.rate_hz.unwrap_or(connection.link.robot().file.rate_hz);
    report.run.cycle_hz = rate_hz;
    let settings = Settings::at_rate(rate_hz);
    inject::point("preflight", 0);
    let accept = Accept { firmware: order.accept_firmware, eeprom: false };
    let found = preflight(&mut connection.link, settings.period, accept)?;
    report.run.describe_preflight(&found);
    refuse_who_only_obeys(&leader)?;
    let name = leader.link.robot().name.clone();
    let leader_start_rad = readable(&mut leader.link, accept).map_err(|error| {
        let place = error.place.clone().unwrap_or_default();
        error.at(format!("leader {name}, {place}"))
    })?;
    if order.limp && !order.dry_run {
        control::arm::disarm(&mut leader.link)?;
    }
    let mut guided = GuidedArm::new(leader, pairs, &found.start_rad, &leader_start_rad)?;
    guided.check(order.dry_run && order.limp)?;
    if order.dry_run {
        report.run.outcome = Outcome::Done;
        return Ok(None);
    }
    let mut recorder = RunRecorder::begin(
        order.record.as_deref(),
        order.replace,
        false,
        connection,
        &report.run.motion,
    )?;
    let real_time = connection.real_time;
    let mut ready = Follower { connection, found: &found, settings, order, observer };
    let done = match real_time {
        true => ready.hearing(guided, &mut recorder, report),
        false => ready.looking(guided, &mut recorder, report),
    };
    match done {
        Ok(true) => Ok(Some(recorder)),
        other => {
            recorder.discard();
            other.map(|_| None)
        }
    }
}

/// Who follows, looked at and not touched.
struct Follower<'a> {
    connection: &'a mut Connection,
    found: &'a Preflight,
    settings: Settings,
    order: &'a LeadOrder,
    observer: &'a dyn Observer,
}

/// What a leader says.
enum Said {
    /// Where the follower is to be, rad.
    Goal(Instant, Vec<f64>),
    /// Its line is gone.
    Gone(String),
}

/// The goals of who follows, as the loop asks for them.
struct Goals {
    trend: Trend,
    following_since: Option<Instant>,
    asked_since: Option<Instant>,
    /// The leader has been readable once.
    has_said: bool,
    longest: Option<Duration>,
    gone: Option<String>,
}

impl Goals {
    const fn new(longest: Option<Duration>, trend: Trend) -> Self {
        Self {
            trend,
            following_since: None,
            asked_since: None,
            has_said: false,
            longest,
            gone: None,
        }
    }

    fn take(&mut self, said: Said) {
        match said {
            Said::Goal(at, goal_rad) => {
                self.has_said = true;
                self.trend.push(seconds(at), &goal_rad);
            }
            Said::Gone(why) => self.gone = Some(why),
        }
    }

    /// The newest, or that there is none any more.
    fn newest(&mut self, now: Instant, approaching: bool) -> Input {
        if !approaching {
            self.following_since.get_or_insert(now);
        }
        let follows = self.following_since.map(|since| now.since(since));
        let is_late = self.longest.zip(follows).is_some_and(|(longest, time)| time >= longest);
        let asked_since = *self.asked_since.get_or_insert(now);
        if approaching && !self.has_said && now.since(asked_since) >= PATIENCE {
            let patience_s = PATIENCE.as_secs_f64();
            self.gone = Some(format!("a joint of it has not answered for {patience_s:.0} s"));
        }
        if is_late || self.gone.is_some() {
            return Input::End;
        }
        self.trend.target(seconds(now)).map_or(Input::Nothing, Input::Pose)
    }

    /// Says in the report that the leader was gone, if it was.
    fn describe(self, leader: &str, report: &mut LiveReport) {
        let Some(why) = self.gone else { return };
        if report.run.outcome == Outcome::Done {
            report.run.outcome = Outcome::Stopped;
        }
        report.run.stop_reason = Some(format!("the leader {leader} is gone: {why}"));
        report.run.stop = Some(Stop::of(StopCode::SensorLost));
    }
}

fn seconds(at: Instant) -> f64 {
    at.seconds_since(Instant::ZERO)
}

impl Follower<'_> {
    /// Follows a leader that is read on a thread of its own: the loop waits for no line but the follower's.
    fn hearing(
        &mut self,
        mut guided: GuidedArm,
        recorder: &mut RunRecorder,
        report: &mut LiveReport,
    ) -> Result<bool, Error> {
        let (says, said) = channel();
        let stop = AtomicBool::new(false);
        let (clock, period) = (Arc::clone(self.connection.link.clock()), self.settings.period);
        let (name, observer) = (guided.name().to_owned(), self.observer);
        let mut goals = Goals::new(self.order.time, Trend::default());
        let (done, (counts, lies)) = std::thread::scope(|scope| {
            let stop = &stop;
            let reader = scope.spawn(move || {
                read(&mut guided, &*clock, period, &says, stop, observer);
                guided.into_counts()
            });
            let done = {
                let _stop = StopAtEnd(stop);
                let mut hear =
                    move |goals: &mut Goals, _| said.try_iter().for_each(|said| goals.take(said));
                self.follow(&mut goals, &mut hear, recorder, report)
            };
            (done, reader.join().unwrap_or_default())
        });
        report.sensors =
            vec![SourceReport { name: name.clone(), counts, ..SourceReport::default() }];
        tell_lies(lies, &name, report);
        goals.describe(&name, report);
        done
    }

    /// Follows a leader of virtual time, that is looked at whenever a goal is wanted.
    fn looking(
        &mut self,
        mut guided: GuidedArm,
        recorder: &mut RunRecorder,
        report: &mut LiveReport,
    ) -> Result<bool, Error> {
        let mut goals = Goals::new(self.order.time, Trend::default());
        let mut look = |goals: &mut Goals, now: Instant| {
            guided.clock().sleep_until(now);
            match guided.look() {
                Look::Goal(goal_rad) => goals.take(Said::Goal(now, goal_rad)),
                Look::Silent => {}
                Look::Gone(why) => goals.take(Said::Gone(why)),
            }
        };
        let done = self.follow(&mut goals, &mut look, recorder, report);
        let name = guided.name().to_owned();
        let (counts, lies) = guided.into_counts();
        report.sensors =
            vec![SourceReport { name: name.clone(), counts, ..SourceReport::default() }];
        tell_lies(lies, &name, report);
        goals.describe(&name, report);
        done
    }

    fn follow(
        &mut self,
        goals: &mut Goals,
        hear: &mut (dyn FnMut(&mut Goals, Instant) + Send),
        recorder: &mut RunRecorder,
        report: &mut LiveReport,
    ) -> Result<bool, Error> {
        let ready = follow::Ready {
            connection: self.connection,
            found: self.found,
            settings: self.settings,
            pace: self.order.pace,
            balancing: None,
        };
        let mut newest = |now: Instant, approaching: bool| {
            hear(goals, now);
            goals.newest(now, approaching)
        };
        ready.follow(&mut newest, recorder, None, self.observer, report)
    }
}

/// How often the leader leapt and was back at the next look.
fn tell_lies(lies: u64, leader: &str, report: &mut LiveReport) {
    report.leaps = Some(lies);
    if lies > 0 {
        let times = if lies == 1 { "once".to_owned() } else { counted(lies, "time") };
        report.run.notes.push(format!(
            "a joint of {leader} leapt for a single reading, {times}; that was not followed"
        ));
    }
}

/// Reads the leader until it is to stop or is gone; times are those of the follower's clock.
fn read(
    guided: &mut GuidedArm,
    clock: &dyn Clock,
    period: Duration,
    says: &Sender<Said>,
    stop: &AtomicBool,
    observer: &dyn Observer,
) {
    let own = guided.clock();
    let mut at = own.now();
    while !stop.load(Ordering::Acquire) {
        let now = clock.now();
        let look = guided.look();
        if let Some(words) = guided.silence() {
            observer.hear(Event::Note(&words));
        }
        let said = match look {
            Look::Goal(goal_rad) => Said::Goal(now, goal_rad),
            Look::Silent => {
                at = (at + period).max(own.now());
                own.sleep_until(at);
                continue;
            }
            Look::Gone(why) => Said::Gone(why),
        };
        let is_last = matches!(said, Said::Gone(_));
        // Nobody follows any more.
        if says.send(said).is_err() || is_last {
            return;
        }
        at = (at + period).max(own.now());
        own.sleep_until(at);
    }
}

#[cfg(test)]
mod tests;
