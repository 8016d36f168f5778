//! A robot follows goals that are made as it goes: by a body that is heard, or by a function of the
//! user's own, which runs on a thread of its own. Nothing of either runs in the loop.

use super::live::{LiveJoint, LiveReport};
use super::observer::{Event, Meter, Observer, Progress};
use super::play::{describe_virtual, lie_as_its_file_says};
use super::recorder::RunRecorder;
use super::report::{JointReport, Outcome};
use crate::control::{
    self, Balanced, Balancer, Input, Mirror, Sample, Settings, Sink, Stop, StopCode, balance, net,
};
use crate::error::Error;
use crate::job::report::counted;
use crate::motion::Trend;
use crate::rig::Connection;
use crate::robot::Robot;
use crate::robot::preflight::Preflight;
use crate::time::{Duration, Instant};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};

/// Moments that wait for a function that is slow; more are not kept.
const MOST_WAITING: usize = 16;
/// In virtual time a function is waited for, but not for longer than this.
const PATIENCE: Duration = Duration::from_secs(5);

/// How a robot follows.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FollowOptions {
    /// Follow for this time, then come to rest; `None`: until the goals end.
    pub time: Option<Duration>,
    /// Cycles per second; `None`: as the robot's file says.
    pub rate_hz: Option<f64>,
    /// Record goals and measured states to this file.
    pub record: Option<PathBuf>,
    /// The recording may replace a file that is there.
    pub replace: bool,
    /// Move servos whose firmware the profile was not checked against.
    pub accept_firmware: bool,
}

/// What a function that makes goals is told. All joints are in the robot's order.
#[derive(Clone, Debug, PartialEq)]
pub struct Moment {
    /// Time since the robot reached the first goal, s; 0 while it is on its way there.
    pub time_s: f64,
    /// Goal in effect when the joints were read, rad.
    pub goal_rad: Vec<f64>,
    /// Measured angle, rad; `None` where the read was missed.
    pub position_rad: Vec<Option<f64>>,
    /// Measured speed, rad/s; `None` where the read was missed or the servo does not tell.
    pub velocity_rad_s: Vec<Option<f64>>,
}

/// A robot that was looked at and not touched.
pub(super) struct Ready<'a> {
    pub(super) connection: &'a mut Connection,
    pub(super) found: &'a Preflight,
    pub(super) settings: Settings,
    /// At which share of the joints' velocity and acceleration limits it follows.
    pub(super) pace: f64,
    /// How it keeps its balance meanwhile, if it does.
    pub(super) balancing: Option<Balancing>,
}

/// A robot that keeps its balance while it follows.
pub(super) struct Balancing {
    /// What balance leaves of it: goals are made for this one.
    pub(super) leaves: Robot,
    balancer: Balancer,
}

impl Balancing {
    /// Of a robot that stands at `start_rad`.
    ///
    /// # Errors
    /// As [`balance::leaves`].
    pub(super) fn of(robot: &Robot, start_rad: &[f64], settings: Settings) -> Result<Self, Error> {
        let (leaves, rooms_rad) = balance::leaves_room(robot, start_rad)?;
        let period_s = settings.period.as_secs_f64();
        let balancer = Balancer::new(robot, period_s, |joint| rooms_rad[joint])?;
        Ok(Self { leaves, balancer })
    }
}

impl Ready<'_> {
    /// Lets the robot follow until the source ends or somebody stops it; false if nothing was played.
    pub(super) fn follow(
        self,
        newest: &mut control::mirror::Source<'_>,
        recorder: &mut RunRecorder,
        moments: Option<Moments>,
        observer: &dyn Observer,
        report: &mut LiveReport,
    ) -> Result<bool, Error> {
        let Self { connection, found, settings, pace, mut balancing } = self;
        let limits = match &balancing {
            Some(balancing) => balancing.leaves.limits(),
            None => connection.link.robot().limits(),
        };
        let limits = limits.iter().map(|of| of.paced(pace)).collect::<Result<Vec<_>, _>>()?;
        let meter = Meter::of(limits.len());
        let mut mirror = Mirror::new(newest, &found.start_rad, limits);
        let balancer = balancing.as_mut().map(|of| &mut of.balancer);
        let performed = control::perform(
            &mut connection.link,
            found,
            &mut Balanced { motion: &mut mirror, balancer },
            settings,
            &mut Both { recorder: recorder.metered(meter.clone()), moments },
            &|| observer.wants_to_stop(),
            &mut |is_over| {
                observer.hear(Event::Following);
                let duration_s = f64::INFINITY;
                observer.watch(&Progress { meter: &meter, duration_s, is_over });
            },
        )?;
        describe_joints(report, connection, &mirror);
        report.describe(&mirror, settings);
        if !report.run.describe_performance(&performed) {
            report.run.joints.clear();
            return Ok(false);
        }
        report.run.balance = balancing.map(|of| of.balancer.figures().clone());
        lie_as_its_file_says(&performed, &mut report.run, connection);
        describe_virtual(&mut report.run, connection);
        Ok(true)
    }
}

fn describe_joints(report: &mut LiveReport, connection: &Connection, mirror: &Mirror<'_>) {
    let (velocity, acceleration) = mirror.peaks();
    for (index, joint) in connection.link.robot().joints.iter().enumerate() {
        report.run.joints.push(JointReport {
            peak_velocity_rad_s: velocity[index],
            peak_acceleration_rad_s2: acceleration[index],
            ..JointReport::of(joint)
        });
        let limited_samples = mirror.tally().limited_samples[index];
        report.limited.push(LiveJoint { name: joint.name.clone(), limited_samples });
    }
}

/// The recording, and whoever else hears of each cycle.
struct Both<S> {
    recorder: S,
    moments: Option<Moments>,
}

impl<S: Sink> Sink for Both<S> {
    fn take(&mut self, sample: &Sample<'_>) {
        self.recorder.take(sample);
        if let Some(moments) = &mut self.moments {
            moments.take(sample);
        }
    }
}

/// Tells a function of each cycle.
pub(super) struct Moments {
    to: SyncSender<(Instant, Moment)>,
    /// When the first goal was reached, in nanoseconds; 0 before.
    reached_ns: Arc<AtomicU64>,
}

impl Moments {
    fn take(&mut self, sample: &Sample<'_>) {
        let reached_ns = self.reached_ns.load(Ordering::Relaxed);
        let since = |ns: u64| sample.at.seconds_since(Instant::from_nanos(ns)).max(0.0);
        let of = |read: fn(&crate::device::JointState) -> Option<f64>| {
            sample
                .states
                .iter()
                .map(|state| state.as_ref().ok().and_then(|(s, _)| read(s)))
                .collect()
        };
        let moment = Moment {
            time_s: if reached_ns == 0 { 0.0 } else { since(reached_ns) },
            goal_rad: sample.goal_rad.to_vec(),
            position_rad: of(|state| Some(state.position_rad)),
            velocity_rad_s: of(|state| state.velocity_rad_s),
        };
        // A function that is too slow hears of fewer moments; the loop never waits for it.
        let _ = self.to.try_send((sample.at, moment));
    }
}

/// What a function made of a moment.
enum Made {
    Goals(Instant, Vec<f64>),
    End,
    Broke(String),
}

/// Goals that a function of the user's own makes, as the loop sees them.
pub(super) struct Goals {
    made: Receiver<Made>,
    trend: Trend,
    began: Option<Instant>,
    following_since: Option<Instant>,
    reached_ns: Arc<AtomicU64>,
    longest: Option<Duration>,
    /// True where time is virtual: it waits for the function, so that a run can be repeated.
    waits: bool,
    is_over: bool,
    broke: Option<String>,
}

/// Starts a function on a thread of its own; what tells it of cycles, and what it makes of them.
///
/// # Errors
/// No thread can be had.
pub(super) fn begin(
    joints: usize,
    longest: Option<Duration>,
    waits: bool,
    source: impl FnMut(&Moment) -> Option<Vec<f64>> + Send + 'static,
) -> Result<(Moments, Goals), Error> {
    let (to, moments) = sync_channel(MOST_WAITING);
    let (makes, made) = sync_channel(MOST_WAITING);
    // It is not waited for at the end: a function that never returns must keep nobody here.
    std::thread::Builder::new()
        .name("goals".to_owned())
        .spawn(move || answer(&moments, &makes, joints, source))
        .map_err(|e| Error::new(format!("no thread: {e}")))?;
    let reached_ns = Arc::new(AtomicU64::new(0));
    let goals = Goals {
        made,
        trend: Trend::default(),
        began: None,
        following_since: None,
        reached_ns: Arc::clone(&reached_ns),
        longest,
        waits,
        is_over: false,
        broke: None,
    };
    Ok((Moments { to, reached_ns }, goals))
}

/// Asks the function again and again, about the newest moment there is.
fn answer(
    moments: &Receiver<(Instant, Moment)>,
    makes: &SyncSender<Made>,
    joints: usize,
    mut source: impl FnMut(&Moment) -> Option<Vec<f64>>,
) {
    while let Ok(first) = moments.recv() {
        let (at, moment) = moments.try_iter().last().unwrap_or(first);
        let made = match net::catch(|| source(&moment)) {
            Err(words) => Made::Broke(words),
            Ok(None) => Made::End,
            Ok(Some(goals)) if goals.len() != joints => Made::Broke(format!(
                "{} for {joints}",
                counted(goals.len(), "goal"),
                joints = counted(joints, "joint")
            )),
            Ok(Some(goals)) if goals.iter().any(|rad| !rad.is_finite()) => {
                Made::Broke("a goal is no number".to_owned())
            }
            Ok(Some(goals)) => Made::Goals(at, goals),
        };
        let is_last = !matches!(made, Made::Goals(..));
        // Nobody asks any more, or the newest goal is the last.
        if makes.send(made).is_err() || is_last {
            return;
        }
    }
}

impl Goals {
    /// The newest goal at a moment, as [`Mirror`] asks for it.
    pub(super) fn newest(&mut self, now: Instant, approaching: bool) -> Input {
        let began = *self.began.get_or_insert(now);
        if !approaching && self.following_since.is_none() {
            self.following_since = Some(now);
            self.reached_ns.store(now.as_nanos().max(1), Ordering::Relaxed);
        }
        self.hear(began);
        let follows = self.following_since.map(|since| now.since(since));
        let is_late = self.longest.zip(follows).is_some_and(|(longest, time)| time >= longest);
        if self.is_over || is_late {
            return Input::End;
        }
        self.trend.target(now.seconds_since(began)).map_or(Input::Nothing, Input::Pose)
    }

    /// Takes all that was made; in virtual time at least one goal.
    fn hear(&mut self, began: Instant) {
        let mut wait = self.waits;
        while !self.is_over {
            let made = match wait {
                false => self.made.try_recv().ok(),
                true => match self.made.recv_timeout(PATIENCE) {
                    Err(RecvTimeoutError::Timeout) => {
                        self.waits = false;
                        None
                    }
                    made => made.ok(),
                },
            };
            wait = false;
            match made {
                None => return,
                Some(Made::Goals(at, goals)) => {
                    self.trend.push(at.seconds_since(began), &goals);
                }
                Some(Made::End) => self.is_over = true,
                Some(Made::Broke(words)) => {
                    self.is_over = true;
                    self.broke = Some(words);
                }
            }
        }
    }

    /// Says in the report that the function broke, if it did.
    pub(super) fn describe(self, report: &mut LiveReport) {
        let Some(words) = self.broke else { return };
        if report.run.outcome == Outcome::Done {
            report.run.outcome = Outcome::Stopped;
        }
        report.run.stop_reason = Some(format!("what makes the goals broke: {words}"));
        report.run.stop = Some(Stop::of(StopCode::SourceBroke));
    }
}
