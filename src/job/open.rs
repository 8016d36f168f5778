//! A robot that is open, and what can be done with it: the face of this crate.

use super::follow::{self, FollowOptions, Moment};
use super::live::LiveReport;
use super::observer::{Nobody, Observer};
use super::play::{Options, Played, play_on, under_net};
use super::recorder::RunRecorder;
use super::report::{OwnProfile, PlayReport};
use super::source::{self, MotionOrder, RobotMotion};
use crate::control::Settings;
use crate::error::Error;
use crate::rig::{Address, Connection, calibrated, connect};
use crate::robot::Robot;
use crate::robot::preflight::{Accept, preflight};
use std::path::PathBuf;

/// A robot, real or virtual, whose lines are open. Nothing was written to it yet.
pub struct Rig {
    connection: Connection,
    buses: Vec<String>,
    calibration: Option<PathBuf>,
}

/// Opens the robot called `robot` (or described by that file) at `bus`: `sim` for a virtual one in
/// virtual time, `serial:/dev/ttyUSB0`, `can:can0`, ..., as `--bus` of the command takes it; several
/// lines with a comma between them (`left_leg=can:can0,right_leg=can:can1`).
///
/// # Errors
/// An unknown robot, an address that is none, a port that cannot be opened.
pub fn open(robot: &str, bus: &str) -> Result<Rig, Error> {
    let buses = bus.split(',').map(str::parse).collect::<Result<Vec<Address>, Error>>()?;
    let (robot, calibration) = calibrated(robot, &buses, None)?;
    let connection = connect(robot, &buses, 0)?;
    Ok(Rig { connection, buses: buses.iter().map(ToString::to_string).collect(), calibration })
}

impl Rig {
    /// What is known of the robot: its joints, limits and lines.
    #[must_use]
    pub const fn robot(&self) -> &Robot {
        self.connection.link.robot()
    }

    /// Reads a motion and transfers it to the robot's joints: a capture (`dance.bvh`), actions
    /// (`walk:6s,bow`), a recording or a table.
    ///
    /// # Errors
    /// As [`source::load`].
    pub fn motion(&self, motion: &str) -> Result<RobotMotion, Error> {
        source::load(&MotionOrder::of(motion), self.robot())
    }

    /// The same with choices: a section of it, some joints only, left and right swapped.
    ///
    /// # Errors
    /// As [`source::load`].
    pub fn motion_of(&self, order: &MotionOrder) -> Result<RobotMotion, Error> {
        source::load(order, self.robot())
    }

    /// Plays a motion to its end: every servo is looked at, the way is planned from where the robot
    /// stands, slowed to what its joints can do, and performed under watch.
    ///
    /// # Errors
    /// What was refused before anything moved. What happened since torque came on is in the report.
    pub fn play(&mut self, motion: &RobotMotion, options: Options) -> Result<PlayReport, Error> {
        Ok(self.play_watched(motion, options, &Nobody)?.report)
    }

    /// The same with somebody who looks on, and may want it to end.
    ///
    /// # Errors
    /// As [`Rig::play`].
    pub fn play_watched(
        &mut self,
        motion: &RobotMotion,
        options: Options,
        observer: &dyn Observer,
    ) -> Result<Played, Error> {
        let mut report = self.report(&motion.name);
        report.dry_run = options.dry_run;
        report.describe_motion(motion);
        let kept = under_net(&mut report, |report| {
            play_on(&mut self.connection, motion, &options, observer, report)
        })?;
        let mut played = Played { report, series: None, scene: None };
        played.keep(kept);
        Ok(played)
    }

    /// Lets the robot follow goals that `source` makes: asked again and again with what was measured, on
    /// a thread of its own, it gives an angle for each joint in rad, in the order of
    /// [`Robot::joint_names`], or `None` at its end. The robot goes to the first goal at 30 % of its
    /// speed; then the newest one is followed inside the joints' limits. A goal that has become old is
    /// eased to rest, and so is the last one when `source` ends or panics.
    ///
    /// In virtual time (`sim`) each cycle waits for `source`, so that a run can be repeated.
    ///
    /// # Errors
    /// What was refused before anything moved. What happened since torque came on is in the report.
    pub fn follow(
        &mut self,
        source: impl FnMut(&Moment) -> Option<Vec<f64>> + Send + 'static,
        options: FollowOptions,
    ) -> Result<LiveReport, Error> {
        self.follow_watched(source, options, &Nobody)
    }

    /// The same with somebody who looks on, and may want it to end.
    ///
    /// # Errors
    /// As [`Rig::follow`].
    pub fn follow_watched(
        &mut self,
        source: impl FnMut(&Moment) -> Option<Vec<f64>> + Send + 'static,
        options: FollowOptions,
        observer: &dyn Observer,
    ) -> Result<LiveReport, Error> {
        let mut report = LiveReport::new(self.report("a function"));
        let rate_hz = options.rate_hz.unwrap_or(self.robot().file.rate_hz);
        report.run.cycle_hz = rate_hz;
        let settings = Settings::at_rate(rate_hz);
        let accept = Accept { firmware: options.accept_firmware, eeprom: false };
        let found = preflight(&mut self.connection.link, settings.period, accept)?;
        report.run.describe_preflight(&found);
        let connection = &mut self.connection;
        let (joints, waits) = (connection.link.robot().joints.len(), !connection.real_time);
        let mut recorder = RunRecorder::begin(
            options.record.as_deref(),
            options.replace,
            false,
            connection,
            &report.run.motion,
        )?;
        let (moments, mut goals) = follow::begin(joints, options.time, waits, source)?;
        let ready =
            follow::Ready { connection, found: &found, settings, pace: 1.0, balancing: None };
        let mut newest = |now, approaching| goals.newest(now, approaching);
        let done = ready.follow(&mut newest, &mut recorder, Some(moments), observer, &mut report);
        if matches!(done, Ok(true)) {
            goals.describe(&mut report);
            recorder.finish(&mut report.run, &self.connection);
            return Ok(report);
        }
        recorder.discard();
        done?;
        goals.describe(&mut report);
        Ok(report)
    }

    /// A report of nothing yet.
    fn report(&self, motion: &str) -> PlayReport {
        let mut report = PlayReport::new(motion, &self.robot().name, self.buses.clone());
        report.profiles = OwnProfile::of(self.robot());
        report.calibration = self.calibration.as_ref().map(|path| path.display().to_string());
        report
    }
}
