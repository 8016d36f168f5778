//! What a run leaves behind: the recording, and the series for the plots.

use super::observer::Meter;
use super::report::{Outcome, PlayReport};
use crate::bus::Miss;
use crate::control::{Sample, Sink};
use crate::device::JointState;
use crate::error::Error;
use crate::job::report::counted;
use crate::motion::Plan;
use crate::port::patient::PatientClock;
use crate::port::{Clock, MonotonicClock};
use crate::recording::{
    CycleRecord, JointRecord, RecordedJoint, Recorder, RunEnd, RunStart, SampleEncoding,
};
use crate::rig::Connection;
use crate::robot::Joint;
use crate::time::Instant;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Series of one run, kept for the plots.
#[derive(Debug, Default)]
pub struct Series {
    /// When the first cycle was, if its clock is known.
    pub began: Option<Instant>,
    /// Time of each cycle since the first, s.
    pub time_s: Vec<f64>,
    /// Goals, by joint.
    pub goal_rad: Vec<Vec<f64>>,
    /// Speed of the goals, by joint.
    pub goal_velocity_rad_s: Vec<Vec<f64>>,
    /// Measured angles, by joint; NaN where none was read.
    pub present_rad: Vec<Vec<f64>>,
    /// Where a joint was asked for its angle and none came, by joint. One that is read in turn is not asked in every cycle.
    pub missed: Vec<Vec<bool>>,
    /// Measured speeds, by joint; NaN where none was read, as in all that follow.
    pub velocity_rad_s: Vec<Vec<f64>>,
    /// Currents, by joint.
    pub current_a: Vec<Vec<f64>>,
    /// Loads as part of the full one, by joint.
    pub load_ratio: Vec<Vec<f64>>,
    /// Temperatures, by joint.
    pub temperature_c: Vec<Vec<f64>>,
    /// Voltages, by joint.
    pub voltage_v: Vec<Vec<f64>>,
}

impl Series {
    /// The goals of a plan, as they will be told.
    pub(super) fn planned(plan: &Plan, rate_hz: f64) -> Self {
        let goal_rad = vec![Vec::new(); plan.trajectory.joints().len()];
        let mut series = Self { goal_rad, ..Self::default() };
        for (time_s, pose) in plan.rows(rate_hz) {
            series.time_s.push(time_s);
            for (goals, goal_rad) in series.goal_rad.iter_mut().zip(pose) {
                goals.push(goal_rad);
            }
        }
        series
    }

    /// Series of so many joints, without a cycle.
    fn of(joints: usize) -> Self {
        let none = || vec![Vec::new(); joints];
        Self {
            began: None,
            time_s: Vec::new(),
            goal_rad: none(),
            goal_velocity_rad_s: none(),
            present_rad: none(),
            missed: vec![Vec::new(); joints],
            velocity_rad_s: none(),
            current_a: none(),
            load_ratio: none(),
            temperature_c: none(),
            voltage_v: none(),
        }
    }
}

/// Takes every cycle of a run.
pub struct RunRecorder {
    recorder: Option<(Arc<Recorder>, PathBuf)>,
    patient: bool,
    /// The robot's clock, if what is recorded has the system's moments instead.
    of_system: Option<PatientClock>,
    series: Option<Series>,
    began: Option<Instant>,
    /// The number of the next cycle, and of the first of what is performed now: one recording may have several
    /// performances.
    next_cycle: u64,
    first_cycle: u64,
    /// What the recording is told of itself once it is closed.
    told: BTreeMap<String, String>,
}

impl RunRecorder {
    /// Starts a recording at `path`, if one is wanted, and series, if plots are. With `force` it
    /// replaces the file that is there with its first cycle.
    ///
    /// # Errors
    /// The file exists and `force` is not set, or it cannot be written.
    pub fn begin(
        path: Option<&Path>,
        force: bool,
        plots: bool,
        connection: &Connection,
        motion: &str,
    ) -> Result<Self, Error> {
        let recorder = match path {
            None => None,
            Some(path) => {
                let recorder = Recorder::create(path, force, start(connection, motion))?;
                Some((Arc::new(recorder), path.to_owned()))
            }
        };
        let joints = connection.link.robot().joints.len();
        let series = plots.then(|| Series::of(joints));
        let patient = !connection.real_time;
        Ok(Self {
            recorder,
            patient,
            of_system: None,
            series,
            began: None,
            next_cycle: 0,
            first_cycle: 0,
            told: BTreeMap::new(),
        })
    }

    /// Starts a recording that sensors are written to beside the loop, if one is wanted. All of it has
    /// the system's moments: the person goes on while the time of a virtual robot waits.
    ///
    /// # Errors
    /// As [`RunRecorder::begin`].
    pub fn begin_with_sensors(
        path: Option<&Path>,
        force: bool,
        connection: &Connection,
        motion: &str,
    ) -> Result<Self, Error> {
        let mut all = Self::begin(None, force, false, connection, motion)?;
        if let Some(path) = path {
            all.of_system.clone_from(&connection.patience);
            let mut start = start(connection, motion);
            start.monotonic_start = all.moment(start.monotonic_start);
            let recorder = Recorder::create_for_sources(path, force, start)?;
            all.recorder = Some((Arc::new(recorder), path.to_owned()));
        }
        Ok(all)
    }

    /// Starts a recording of sensors alone, without a robot.
    ///
    /// # Errors
    /// As [`RunRecorder::begin`].
    pub fn begin_without_robot(path: &Path, force: bool, motion: &str) -> Result<Self, Error> {
        let start = RunStart {
            robot: String::new(),
            motion: motion.to_owned(),
            joints: Vec::new(),
            wall_clock_start: std::time::SystemTime::now(),
            monotonic_start: MonotonicClock.now(),
            gaitway_version: env!("CARGO_PKG_VERSION").to_owned(),
            metadata: Default::default(),
        };
        let recorder = Recorder::create_for_sources(path, force, start)?;
        Ok(Self {
            recorder: Some((Arc::new(recorder), path.to_owned())),
            patient: false,
            of_system: None,
            series: None,
            began: None,
            next_cycle: 0,
            first_cycle: 0,
            told: BTreeMap::new(),
        })
    }

    /// The moment at which something is recorded that was at `at` of the robot's clock just now.
    fn moment(&self, at: Instant) -> Instant {
        self.of_system.as_ref().map_or(at, |clock| clock.to_system(at))
    }

    /// This recorder as the loop's sink, telling `meter` how far the motion is.
    pub(super) fn metered(&mut self, meter: Meter) -> Metered<'_> {
        self.first_cycle = self.next_cycle;
        Metered { recorder: self, meter }
    }

    /// The recording itself, for whoever records beside the loop; to be given back before
    /// [`RunRecorder::finish`].
    #[must_use]
    pub fn shared(&self) -> Option<Arc<Recorder>> {
        self.recorder.as_ref().map(|(recorder, _)| Arc::clone(recorder))
    }

    /// Samples of sensors that are added from now on are written so.
    pub(super) fn write_samples_as(&self, encoding: SampleEncoding) {
        if let Some((recorder, _)) = &self.recorder {
            recorder.write_samples_as(encoding);
        }
    }

    /// Once the recording is closed it has this word under this key of its metadata.
    pub(super) fn tell(&mut self, key: &str, word: String) {
        self.told.insert(key.to_owned(), word);
    }

    /// The series kept for plots.
    #[must_use]
    pub fn into_series(self) -> Option<Series> {
        self.series
    }

    /// Nothing was played: no recording is left, and one that was to be replaced is as it was.
    pub fn discard(self) {
        if let Some((recorder, _)) = self.recorder {
            recorder.discard();
        }
    }

    /// Closes the recording and says in `report` what became of it.
    pub fn finish(&mut self, report: &mut PlayReport, connection: &Connection) {
        let at = self.moment(connection.link.clock().now());
        self.close(report, at);
    }

    /// The same of one that has no robot.
    pub fn finish_without_robot(&mut self, report: &mut PlayReport) {
        self.close(report, MonotonicClock.now());
    }

    fn close(&mut self, report: &mut PlayReport, at: Instant) {
        let Some((recorder, path)) = self.recorder.take() else { return };
        let word = serde_json::to_value(report.outcome).ok();
        let end = RunEnd {
            outcome: word.and_then(|w| w.as_str().map(str::to_owned)).unwrap_or_default(),
            stop_reason: report.stop_reason.clone(),
            at,
            metadata: std::mem::take(&mut self.told),
        };
        report.recording = Some(path.display().to_string());
        let Some(recorder) = Arc::into_inner(recorder) else {
            report.notes.push("the recording was not closed: something still writes".to_owned());
            return;
        };
        let summary = recorder.finish(end);
        if summary.kept_old {
            report.recording = None;
            report.notes.push(format!("nothing was recorded; {} is as it was", path.display()));
        }
        if summary.is_complete() {
            return;
        }
        report.recording_lost = summary.lost + summary.dropped.values().sum::<u64>();
        report.notes.push(format!(
            "the recording lacks {}{}",
            counted(report.recording_lost, "message"),
            summary.poisoned.map_or_else(String::new, |why| format!(": {why}"))
        ));
        if report.outcome == Outcome::Done {
            report.outcome = Outcome::DoneWithLoss;
        }
    }
}

/// The sink of one run.
pub(super) struct Metered<'a> {
    recorder: &'a mut RunRecorder,
    meter: Meter,
}

impl Sink for Metered<'_> {
    fn take(&mut self, sample: &Sample<'_>) {
        let began = *self.recorder.began.get_or_insert(sample.at);
        let time_s = sample.at.seconds_since(began);
        self.meter.set(time_s);
        for (joint, state) in sample.states.iter().enumerate() {
            let present_rad = state.as_ref().map_or(f64::NAN, |(state, _)| state.position_rad);
            self.meter.set_joint(joint, sample.goal_rad[joint], present_rad);
            match state {
                Ok((state, _)) => self.meter.set_state(joint, state),
                Err(miss) if *miss != Miss::NotAsked => self.meter.missed(joint),
                Err(_) => {}
            }
        }
        if let Some((joint, health)) = &sample.health {
            self.meter.set_health(*joint, health);
        }
        if let Some(series) = &mut self.recorder.series {
            series.began = Some(began);
            series.time_s.push(time_s);
            for (index, state) in sample.states.iter().enumerate() {
                series.goal_rad[index].push(sample.goal_rad[index]);
                series.goal_velocity_rad_s[index].push(sample.goal_velocity_rad_s[index]);
                series.missed[index].push(is_missed(state));
                let state = state.as_ref().ok().map(|(state, _)| state);
                let health =
                    sample.health.as_ref().filter(|(joint, _)| *joint == index).map(|(_, of)| of);
                let or_gap = |value: Option<f64>| value.unwrap_or(f64::NAN);
                series.present_rad[index].push(or_gap(state.map(|state| state.position_rad)));
                series.velocity_rad_s[index].push(or_gap(state.and_then(|of| of.velocity_rad_s)));
                series.current_a[index].push(or_gap(state.and_then(|of| of.current_a)));
                series.load_ratio[index].push(or_gap(state.and_then(|of| of.load_ratio)));
                let temperature_c = state.and_then(|of| of.temperature_c);
                let temperature_c = temperature_c.or(health.and_then(|of| of.temperature_c));
                series.temperature_c[index].push(or_gap(temperature_c));
                let voltage_v = state.and_then(|of| of.voltage_v);
                let voltage_v = voltage_v.or(health.and_then(|of| of.voltage_v));
                series.voltage_v[index].push(or_gap(voltage_v));
            }
        }
        let cycle = self.recorder.first_cycle + sample.cycle;
        self.recorder.next_cycle = cycle + 1;
        let at = self.recorder.moment(sample.at);
        let Some((recorder, _)) = &self.recorder.recorder else { return };
        let record = CycleRecord { cycle, at, joints: joint_records(sample), base: None };
        // A virtual clock waits for the disk; a real one never does.
        if self.recorder.patient {
            recorder.take_patiently(record);
        } else {
            recorder.take(record);
        }
    }
}

/// True if it was asked for and did not come.
fn is_missed<T>(state: &Result<T, Miss>) -> bool {
    state.as_ref().is_err_and(|miss| *miss != Miss::NotAsked)
}

fn joint_records(sample: &Sample<'_>) -> Vec<JointRecord> {
    let mut records: Vec<JointRecord> = sample
        .states
        .iter()
        .zip(sample.goal_rad)
        .map(|(state, &goal_rad)| {
            let goal_rad = Some(goal_rad);
            match state {
                Ok((state, _)) => JointRecord { goal_rad, ..measured(state) },
                Err(miss) => JointRecord {
                    goal_rad,
                    missed: is_missed(state).then(|| miss.to_string().into()),
                    ..JointRecord::default()
                },
            }
        })
        .collect();
    if let Some((joint, health)) = &sample.health
        && let Some(record) = records.get_mut(*joint)
    {
        record.temperature_c = record.temperature_c.or(health.temperature_c);
        record.voltage_v = record.voltage_v.or(health.voltage_v);
    }
    records
}

/// A joint and its limits, as a recording keeps them.
pub(super) fn recorded_joint(joint: &Joint) -> RecordedJoint {
    RecordedJoint {
        name: joint.name.clone(),
        lower_rad: Some(joint.limits.lower_rad()),
        upper_rad: Some(joint.limits.upper_rad()),
        velocity_limit_rad_s: Some(joint.limits.velocity_rad_s()),
        acceleration_limit_rad_s2: Some(joint.limits.acceleration_rad_s2()),
    }
}

/// What a joint measured, as a recording keeps it.
pub(super) fn measured(state: &JointState) -> JointRecord {
    JointRecord {
        present_position_rad: Some(state.position_rad),
        present_velocity_rad_s: state.velocity_rad_s,
        present_current_a: state.current_a,
        present_load_ratio: state.load_ratio,
        temperature_c: state.temperature_c,
        voltage_v: state.voltage_v,
        ..JointRecord::default()
    }
}

/// What is known before the first cycle.
fn start(connection: &Connection, motion: &str) -> RunStart {
    let robot = connection.link.robot();
    RunStart {
        robot: robot.name.clone(),
        motion: motion.to_owned(),
        joints: robot.joints.iter().map(recorded_joint).collect(),
        wall_clock_start: std::time::SystemTime::now(),
        monotonic_start: connection.link.clock().now(),
        gaitway_version: env!("CARGO_PKG_VERSION").to_owned(),
        metadata: Default::default(),
    }
}
