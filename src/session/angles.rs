//! Joint angles of the 22-DOF body out of a recording of worn sensors.
//!
//! Sensors take their samples when they like; here all are brought to one even rate by spherical
//! interpolation between two samples that are near enough. A sensor that is silent for longer is
//! silent: its segment stays as it was and is marked. Segments that are not worn are at rest on what
//! carries them, and are marked all along.

use super::files::{LEGS_KEY, STATURE_KEY};
use crate::action::table;
use crate::body::segment_name;
use crate::body::worn::Wearing;
use crate::body::worn::kept::Kept;
use crate::body::{Dof, JointAngles, Proportions, Segment, SegmentPose, root};
use crate::error::Error;
use crate::mocap::{bvh, export};
use crate::recording::{
    CycleRecord, JointRecord, RecordedJoint, Recorder, RunEnd, RunStart, SensorMoment, SensorSeries,
};
use crate::table::TableWriter;
use crate::time::{Duration, Instant};
use glam::DQuat;
use std::collections::BTreeMap;
use std::path::Path;

/// Between two samples further apart than this nobody knows what a sensor did, s.
const MOST_GAP_S: f64 = 0.1;
/// Stature of a body nobody measured, m.
const USUAL_STATURE_M: f64 = 1.75;
/// Most poses that are computed: a day at 100 per second.
const MOST_POSES: f64 = 8_640_000.0;

/// A body's motion, at an even rate.
#[derive(Clone, Debug, PartialEq)]
pub struct WornMotion {
    /// Poses per second.
    pub rate_hz: f64,
    /// Wall clock of the first pose, nanoseconds since 1970.
    pub start_ns: u64,
    /// Angles, pose by pose.
    pub angles: Vec<JointAngles>,
    /// Segments in the world, the lowest sole on the ground.
    pub poses: Vec<SegmentPose>,
    /// Pose by pose and by [`Segment::index`]: true if the segment's own sensor said so.
    pub measured: Vec<[bool; 13]>,
    /// By [`Segment::index`]: which segments wear a sensor.
    pub worn: [bool; 13],
    /// The body it was put on.
    pub body: Proportions,
}

impl WornMotion {
    /// The motion in a recording of a person with this body who was calibrated so.
    ///
    /// # Errors
    /// A calibration that names sensors which are not in the recording, a rate that is none, sensors
    /// that never spoke at the same time.
    pub fn of(
        series: &SensorSeries,
        kept: &Kept,
        body: Proportions,
        rate_hz: f64,
    ) -> Result<Self, Error> {
        let sensors = worn_sensors(series, kept)?;
        let (first_ns, last_ns) = common_span(&sensors)?;
        let span_s = (last_ns - first_ns) as f64 / 1e9;
        let count = (span_s * rate_hz).floor() + 1.0;
        if !((1.0..=1000.0).contains(&rate_hz) && count <= MOST_POSES) {
            return Err(Error::new("not a rate for joint angles")
                .got(format!("{rate_hz} Hz for {span_s:.1} s"))
                .allowed("1 to 1000 Hz, at most 8,640,000 poses"));
        }
        let mut wearing = Wearing::new(&kept.calibration);
        let mut readers: Vec<Interpolated> =
            sensors.iter().map(|(segment, said)| Interpolated::new(*segment, said)).collect();
        let mut motion = Self {
            rate_hz,
            start_ns: first_ns,
            angles: Vec::with_capacity(count as usize),
            poses: Vec::with_capacity(count as usize),
            measured: Vec::with_capacity(count as usize),
            worn: wearing.worn(),
            body,
        };
        let mut before_ns = first_ns;
        for n in 0..count as u64 {
            let at_ns = first_ns + (n as f64 / rate_hz * 1e9).round() as u64;
            let mut said = [None; 13];
            for reader in &mut readers {
                said[reader.segment.index()] = reader.at(at_ns);
            }
            let moment = wearing.pose(&said, (at_ns - before_ns) as f64 / 1e9);
            before_ns = at_ns;
            motion.angles.push(moment.measured.angles);
            motion.poses.push(moment.pose);
            motion.measured.push(moment.fresh);
        }
        motion.put_on_ground();
        Ok(motion)
    }

    /// Sensors know no place: the body stands on its lowest sole, which does not slide, or falls freely.
    fn put_on_ground(&mut self) {
        let roots_m = root::path_m(&self.body, &self.poses, self.rate_hz);
        for (pose, root_m) in self.poses.iter_mut().zip(roots_m) {
            pose.root_m = root_m;
        }
    }

    /// Names of the segments that wear no sensor.
    #[must_use]
    pub fn not_worn(&self) -> Vec<&'static str> {
        names(&self.worn)
    }

    /// Moments in which a worn sensor was silent, all sensors together.
    #[must_use]
    pub fn silent_samples(&self) -> u64 {
        let silent = |now: &[bool; 13]| {
            now.iter().zip(self.worn).filter(|(fresh, worn)| *worn && !**fresh).count()
        };
        self.measured.iter().map(silent).sum::<usize>() as u64
    }

    /// As a table: the columns of [`table::titles`], how the pelvis is turned
    /// ([`table::pelvis_titles`]), and last the segments that are not measured in this row, with `;`
    /// between them.
    ///
    /// # Errors
    /// None that a motion can have.
    pub fn csv(&self) -> Result<Vec<u8>, Error> {
        let mut out = TableWriter::new(Vec::new());
        let titles = table::titles().chain(table::pelvis_titles());
        out.row(titles.chain(["not_measured".to_owned()]))?;
        for (n, (angles, pose)) in self.angles.iter().zip(&self.poses).enumerate() {
            let not_measured = names(&self.measured[n]).join(";");
            let cells = table::cells(n, self.rate_hz, angles, pose.root_m);
            let pelvis = table::pelvis_cells(pose.orientation[Segment::Pelvis.index()]);
            out.row(cells.chain(pelvis).chain([not_measured]))?;
        }
        out.finish()
    }

    /// As a BVH file.
    #[must_use]
    pub fn bvh(&self) -> String {
        bvh::write(&export::bvh_of(&self.poses, &self.body, self.rate_hz))
    }

    /// As a recording of joint states, a message per pose: degrees of freedom by name. Those of
    /// segments that are not worn stay at zero and are named in its metadata; a sensor that is
    /// silent is a missed reading.
    ///
    /// # Errors
    /// A file that exists (without `force`) or cannot be written.
    pub fn write_mcap(
        &self,
        path: &Path,
        force: bool,
        mut metadata: BTreeMap<String, String>,
    ) -> Result<(), Error> {
        metadata.insert("not_worn".to_owned(), self.not_worn().join(","));
        metadata.insert("rate_hz".to_owned(), self.rate_hz.to_string());
        let named =
            |dof: &Dof| RecordedJoint { name: dof.name().to_owned(), ..RecordedJoint::default() };
        let start = Instant::from_nanos(self.start_ns);
        let recorder = Recorder::create_whole(
            path,
            force,
            RunStart {
                robot: "22-DOF body".to_owned(),
                motion: metadata.get("trial").cloned().unwrap_or_default(),
                joints: Dof::ALL.iter().map(named).collect(),
                wall_clock_start: std::time::UNIX_EPOCH + Duration::from_nanos(self.start_ns),
                monotonic_start: start,
                gaitway_version: env!("CARGO_PKG_VERSION").to_owned(),
                metadata,
            },
        )?;
        let mut at = start;
        for (n, (angles, measured)) in self.angles.iter().zip(&self.measured).enumerate() {
            at = start + Duration::from_secs_f64(n as f64 / self.rate_hz);
            let joint = |dof: &Dof| {
                let segment = moved(*dof).index();
                let silent = self.worn[segment] && !measured[segment];
                JointRecord {
                    present_position_rad: (!silent).then(|| angles[*dof]),
                    missed: silent.then(|| "the sensor is silent".into()),
                    ..JointRecord::default()
                }
            };
            let joints = Dof::ALL.iter().map(joint).collect();
            recorder.take_patiently(CycleRecord { cycle: n as u64, at, joints, base: None });
        }
        let end =
            RunEnd { outcome: "done".to_owned(), stop_reason: None, at, metadata: BTreeMap::new() };
        let summary = recorder.finish(end);
        if summary.is_complete() {
            return Ok(());
        }
        Err(Error::new("the recording of joint angles is incomplete")
            .at(path.display().to_string())
            .got(summary.poisoned.unwrap_or_default()))
    }
}

/// The body of whoever was recorded, from a recording's metadata: 1.75 m tall if nobody knows.
///
/// # Errors
/// Measures that no person has.
pub fn body_of(metadata: &BTreeMap<String, String>) -> Result<Proportions, Error> {
    let measure = |key: &str| metadata.get(key).and_then(|text| text.parse::<f64>().ok());
    let body = Proportions::of_stature(measure(STATURE_KEY).unwrap_or(USUAL_STATURE_M))?;
    measure(LEGS_KEY).map_or(Ok(body), |length_m| body.with_leg_length_m(length_m))
}

/// Names of the segments for which `is_so` is false.
fn names(is_so: &[bool; 13]) -> Vec<&'static str> {
    let not = Segment::ALL.into_iter().filter(|segment| !is_so[segment.index()]);
    not.map(segment_name).collect()
}

/// The segment that a degree of freedom turns against the one that carries it.
fn moved(dof: Dof) -> Segment {
    let begins =
        |segment: &Segment| crate::body::proportions::proximal_joint(*segment) == dof.joint();
    Segment::ALL.into_iter().find(begins).unwrap_or(Segment::Pelvis)
}

/// What a sensor said and when.
pub(super) type Orientations = Vec<(u64, DQuat)>;

/// The sensors of the calibration with what each said.
pub(super) fn worn_sensors(
    series: &SensorSeries,
    kept: &Kept,
) -> Result<Vec<(Segment, Orientations)>, Error> {
    let mut sensors = Vec::new();
    for (name, mount) in kept.sensors.iter().zip(&kept.calibration.mounts) {
        let moments = series.sensors.get(name).ok_or_else(|| {
            let known: Vec<&str> = series.sensors.keys().map(String::as_str).collect();
            Error::new("the calibration's sensor is not in the recording")
                .got(name.clone())
                .allowed(known.join(", "))
                .remedy("is it the calibration of this session and subject?")
        })?;
        let said = |moment: &SensorMoment| Some((moment.taken_ns, moment.orientation?));
        sensors.push((mount.segment, moments.iter().filter_map(said).collect()));
    }
    Ok(sensors)
}

/// When all of them speak: from the last that began to the last sample of any. Of those that speak to the end none is waited for beyond its
/// own last sample: one samples a moment before the other.
pub(super) fn common_span(sensors: &[(Segment, Orientations)]) -> Result<(u64, u64), Error> {
    let silent = || {
        Error::new("at no time did all sensors give an orientation")
            .remedy("look with `gaitway info` whether all of them were recorded")
    };
    let spoke = || sensors.iter().filter(|(_, said)| !said.is_empty());
    let first = spoke().filter_map(|(_, said)| said.first()).map(|(at, _)| *at).max();
    let lasts = || spoke().filter_map(|(_, said)| said.last()).map(|(at, _)| *at);
    let end = lasts().max();
    let to_the_end = |at: &u64| end.is_some_and(|end| (end - at) as f64 / 1e9 <= MOST_GAP_S);
    let last = lasts().filter(to_the_end).min();
    match (first, last) {
        (Some(first), Some(last)) if first <= last => Ok((first, last)),
        _ => Err(silent()),
    }
}

/// What a sensor says between its samples, asked in the order of time.
pub(super) struct Interpolated<'a> {
    pub(super) segment: Segment,
    said: &'a [(u64, DQuat)],
    next: usize,
}

impl<'a> Interpolated<'a> {
    pub(super) const fn new(segment: Segment, said: &'a [(u64, DQuat)]) -> Self {
        Self { segment, said, next: 0 }
    }

    pub(super) fn at(&mut self, at_ns: u64) -> Option<DQuat> {
        while self.said.get(self.next).is_some_and(|(time, _)| *time < at_ns) {
            self.next += 1;
        }
        let (later_ns, later) = self.said.get(self.next)?;
        if *later_ns == at_ns {
            return Some(*later);
        }
        let (earlier_ns, earlier) = self.said.get(self.next.checked_sub(1)?)?;
        let span_s = (later_ns - earlier_ns) as f64 / 1e9;
        if !(span_s <= MOST_GAP_S) {
            return None;
        }
        let part = (at_ns - earlier_ns) as f64 / (later_ns - earlier_ns) as f64;
        Some(earlier.slerp(*later, part))
    }
}
