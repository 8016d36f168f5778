//! A robot's joints as a source: hand-guided teaching. Nothing is written to the servos but, if
//! asked for, torque off.

use super::observer::JointReading;
use super::recorder::{measured, recorded_joint};
use super::{Event, Observer};
use crate::capture::Counts;
use crate::control;
use crate::error::Error;
use crate::port::{Clock, MonotonicClock};
use crate::recording::{CycleRecord, JointRecord, RecordedJoint};
use crate::rig::Address;
use crate::rig::{Connection, connect};
use crate::robot::{Joint, Robot};
use crate::sensing::{Intake, SourceReport};
use crate::time::{Duration, Instant};
use std::sync::Arc;

/// A robot whose lines are open.
pub struct Servos {
    connection: Connection,
    period: Duration,
}

/// Actuators that answer nothing but commands cannot be looked at without one.
pub(super) fn refuse_who_only_obeys(connection: &Connection) -> Result<(), Error> {
    let robot = connection.link.robot();
    let obeys = |joint: &&Joint| {
        joint.actuator().is_some_and(|of| of.ask_state().is_none() && of.answers_goals())
    };
    let names: Vec<&str> =
        robot.joints.iter().filter(obeys).map(|joint| joint.name.as_str()).collect();
    if names.is_empty() {
        return Ok(());
    }
    Err(Error::new("actuators that answer nothing but commands cannot be recorded untouched")
        .at(format!("robot {}", robot.name))
        .got(names.join(", "))
        .remedy("support the robot, then add --limp: they are told to let go, and answer that"))
}

impl Servos {
    /// Opens a robot; with `limp` its torque is switched off.
    ///
    /// # Errors
    /// An unknown robot, a bus that cannot be opened or has no real time, a rate that is none,
    /// joints that do not confirm.
    pub fn open(name: &str, buses: &[Address], rate_hz: f64, limp: bool) -> Result<Self, Error> {
        if !(rate_hz > 0.0 && rate_hz <= 1000.0) {
            return Err(Error::new("not a rate")
                .at("--rate")
                .got(rate_hz.to_string())
                .allowed("above 0 to 1000 Hz"));
        }
        let mut connection = connect(Robot::load(name)?, buses, 0)?;
        if !connection.real_time {
            return Err(Error::new("a virtual robot in virtual time cannot be recorded")
                .at("--bus sim")
                .remedy("sim:pty, or gaitway simulate in another terminal"));
        }
        if !limp {
            refuse_who_only_obeys(&connection)?;
        }
        if limp {
            control::arm::disarm(&mut connection.link)?;
        }
        let period = Duration::from_secs_f64(1.0 / rate_hz);
        Ok(Self { connection, period })
    }

    /// The robot's name.
    pub fn robot_name(&self) -> &str {
        &self.connection.link.robot().name
    }

    /// Its joints and their limits, as a recording keeps them.
    pub fn recorded_joints(&self) -> Vec<RecordedJoint> {
        let joints = self.connection.link.robot().joints.iter();
        joints.map(recorded_joint).collect()
    }

    /// Records until it is to stop or a line fails; an observer hears where its joints are.
    pub fn record(mut self, intake: &Intake, observer: &dyn Observer) {
        let name = self.robot_name().to_owned();
        let mut counts = Counts::default();
        let mut ended = None;
        // A virtual robot's time may wait for this machine; what is recorded has the system's.
        let clock = Arc::clone(self.connection.link.clock());
        let began = clock.now();
        let mut at = began;
        for cycle in 0.. {
            clock.sleep_until(at);
            if intake.stopped() {
                break;
            }
            match self.read(cycle, at) {
                Ok(record) => {
                    let missed = record.joints.iter().filter(|joint| joint.missed.is_some());
                    counts.missed += missed.count() as u64;
                    counts.samples += 1;
                    let joints = self.readings(&record);
                    let time_s = at.seconds_since(began);
                    observer.hear(Event::Joints { time_s, joints: &joints });
                    intake.take_cycle(record);
                }
                Err(error) => {
                    ended = Some(error);
                    break;
                }
            }
            at = (at + self.period).max(clock.now());
        }
        if let Some(why) = &ended {
            intake.ended_early(&name, why);
        }
        intake.report(SourceReport { name, counts, ended, ..SourceReport::default() });
    }

    /// Where its joints are, by their names.
    fn readings(&self, record: &CycleRecord) -> Vec<JointReading> {
        let joints = self.connection.link.robot().joints.iter().zip(&record.joints);
        let reading = |(joint, read): (&Joint, &JointRecord)| JointReading {
            name: joint.name.clone(),
            id: joint.id,
            present_rad: read.present_position_rad,
            velocity_rad_s: read.present_velocity_rad_s,
            load_ratio: read.present_load_ratio,
            ..JointReading::default()
        };
        joints.map(reading).collect()
    }

    fn read(&mut self, cycle: u64, at: Instant) -> Result<CycleRecord, String> {
        // A servo that is silent must not hold up the others for longer than a few cycles.
        let budget = at + self.period.max(Duration::from_millis(50));
        let asked = MonotonicClock.now();
        let states = self.connection.link.whole_states(budget).map_err(|e| e.to_string())?;
        let joints = states.into_iter().map(|state| match state {
            Ok((state, _alert)) => measured(&state),
            Err(miss) => {
                JointRecord { missed: Some(miss.to_string().into()), ..JointRecord::default() }
            }
        });
        Ok(CycleRecord { cycle, at: asked, joints: joints.collect(), base: None })
    }
}
