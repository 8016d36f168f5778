//! What the sensors of a recording said, sensor by sensor, for whoever works on it afterwards.

use super::disk::open;
use super::imu_message::{SensorMessage, Turned};
use super::marker::Marker;
use super::message::{Run, Topic, parse};
use super::reader::check_unpacked;
use super::sample::RunStart;
use super::scan::{Channel, Found, scan};
use crate::device::sensor::SensorSample;
use crate::error::{Error, ErrorKind};
use glam::{DQuat, DVec3};
use std::collections::BTreeMap;
use std::io::{BufReader, Read};
use std::path::Path;

/// The largest recording taken into memory, bytes.
const FILE_BYTES: u64 = 1 << 30;

/// The sensors of a recording in memory.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SensorSeries {
    /// What the recording was; missing only if the very beginning of the file is damaged.
    pub start: Option<RunStart>,
    /// By name of the sensor, samples in the order in which they were taken.
    pub sensors: BTreeMap<String, Vec<SensorMoment>>,
    /// What was marked while it was recorded.
    pub markers: Vec<Marker>,
    /// Samples known to be missing.
    pub missed: u64,
    /// Wall clock of the first message, nanoseconds since 1970.
    pub first_ns: u64,
    /// Wall clock of the last.
    pub last_ns: u64,
    /// Whether the file was closed as it should be and nothing in it is damaged.
    pub whole: bool,
}

/// One sample of a sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SensorMoment {
    /// When it was taken: wall clock at the start plus monotonic time, nanoseconds since 1970.
    pub taken_ns: u64,
    /// Angular rate in the sensor's axes, rad/s.
    pub rate_rad_s: Option<DVec3>,
    /// Acceleration in the sensor's axes, gravity included, m/s^2.
    pub acceleration_m_s2: Option<DVec3>,
    /// Magnetic field in the sensor's axes, T.
    pub field_t: Option<DVec3>,
    /// Turns vectors of the sensor into those of its own world, Z up; `None` while nobody knows.
    pub orientation: Option<DQuat>,
}

impl SensorMoment {
    /// What was measured, as sensors say it.
    #[must_use]
    pub fn sample(&self) -> SensorSample {
        SensorSample {
            angular_rate_rad_s: self.rate_rad_s,
            acceleration_m_s2: self.acceleration_m_s2,
            magnetic_field_t: self.field_t,
            ..SensorSample::default()
        }
    }
}

/// Reads the sensors of a recording, finished or not.
///
/// # Errors
/// If the file cannot be opened, is no MCAP recording, or is over 1 GiB, packed or unpacked.
pub fn sensor_series(path: &Path) -> Result<SensorSeries, Error> {
    let at_path = |error: Error| error.at(path.display().to_string());
    let file = open(path)?;
    let bytes = file.metadata().map_or(0, |metadata| metadata.len());
    if bytes > FILE_BYTES {
        return Err(at_path(
            Error::of(ErrorKind::Malformed, "the recording is too large to be read at once")
                .got(format!("{} MiB", bytes >> 20))
                .allowed(format!("{} MiB", FILE_BYTES >> 20)),
        ));
    }
    let mut series = SensorSeries { first_ns: u64::MAX, ..SensorSeries::default() };
    let mut unpacked = 0;
    let tally = scan(BufReader::new(file).take(FILE_BYTES), |found| {
        if let Found::Message { channel, header, body } = found {
            unpacked += body.len() as u64;
            check_unpacked(unpacked, FILE_BYTES)?;
            series.first_ns = series.first_ns.min(header.log_time);
            series.last_ns = series.last_ns.max(header.log_time);
            series.add(channel, header.publish_time, body);
        }
        Ok(())
    })
    .map_err(at_path)?;
    series.first_ns = series.first_ns.min(series.last_ns);
    series.whole = tally.finished && tally.lost_bytes == 0;
    for moments in series.sensors.values_mut() {
        // Late ones came out of order.
        moments.sort_by_key(|moment| moment.taken_ns);
    }
    Ok(series)
}

/// What a recording says of itself at its start; `None` if the very beginning is damaged.
///
/// # Errors
/// If the file cannot be opened or is no MCAP recording.
pub fn run_start(path: &Path) -> Result<Option<RunStart>, Error> {
    let mut start = None;
    let scanned = scan(BufReader::new(open(path)?), |found| match found {
        Found::Message { channel, body, .. }
            if Topic::from_name(&channel.topic) == Some(Topic::Run) =>
        {
            start = parse::<Run>(body).and_then(|run| run.start);
            // Once that is known, nothing that follows is of interest.
            if start.is_some() { Err(Error::new("enough was read")) } else { Ok(()) }
        }
        _ => Ok(()),
    });
    match scanned {
        Err(error) if start.is_none() => Err(error.at(path.display().to_string())),
        _ => Ok(start),
    }
}

/// A word that a recording has under a key of its metadata: said at its start, or once it was closed.
///
/// # Errors
/// If the file cannot be opened or is no MCAP recording.
pub fn told_of_run(path: &Path, key: &str) -> Result<Option<String>, Error> {
    let mut told = None;
    let scanned = scan(BufReader::new(open(path)?), |found| match found {
        Found::Message { channel, body, .. }
            if Topic::from_name(&channel.topic) == Some(Topic::Run) =>
        {
            let Some(run) = parse::<Run>(body) else { return Ok(()) };
            let said = [run.start.map(|start| start.metadata), run.end.map(|end| end.metadata)];
            told = said.into_iter().flatten().find_map(|mut metadata| metadata.remove(key));
            // Nothing that follows is of interest then.
            if told.is_some() { Err(Error::new("enough was read")) } else { Ok(()) }
        }
        _ => Ok(()),
    });
    match scanned {
        Err(error) if told.is_none() => Err(error.at(path.display().to_string())),
        _ => Ok(told),
    }
}

impl SensorSeries {
    /// Wall clock at the start, nanoseconds since 1970.
    #[must_use]
    pub fn start_ns(&self) -> u64 {
        self.start.as_ref().map_or(self.first_ns, |start| start.wall_nanos(start.monotonic_start))
    }

    /// From the first to the last message, s.
    #[must_use]
    pub const fn duration_s(&self) -> f64 {
        self.last_ns.saturating_sub(self.first_ns) as f64 / 1e9
    }

    fn add(&mut self, channel: &Channel, taken_ns: u64, body: &[u8]) {
        let topic = channel.topic.as_str();
        if Topic::from_name(topic) == Some(Topic::Run) {
            if let Some(run) = parse::<Run>(body) {
                self.start = run.start.or(self.start.take());
            }
            return;
        }
        if topic == super::marker::TOPIC {
            self.markers.extend(Marker::read(body));
            return;
        }
        let Some((name, part)) = topic.strip_prefix("/imu/").and_then(|t| t.rsplit_once('/'))
        else {
            return;
        };
        match SensorMessage::read(&channel.encoding, part, body) {
            Some(SensorMessage::Sample(imu, turned)) => {
                let missed = imu.missed_before.saturating_add(imu.dropped_before);
                self.missed = self.missed.saturating_add(missed);
                let moment = SensorMoment {
                    taken_ns,
                    rate_rad_s: imu.angular_velocity.map(DVec3::from),
                    acceleration_m_s2: imu.linear_acceleration.map(DVec3::from),
                    field_t: imu.magnetic_field.map(DVec3::from),
                    orientation: turned.and_then(known),
                };
                self.sensors.entry(name.to_owned()).or_default().push(moment);
            }
            Some(SensorMessage::Turned(turned)) => {
                // It follows the sample it belongs to.
                let last = self.sensors.get_mut(name).and_then(|moments| moments.last_mut());
                if let Some(last) = last.filter(|last| last.taken_ns == taken_ns) {
                    last.orientation = known(turned);
                }
            }
            None => {}
        }
    }
}

/// An orientation, once it is one.
fn known(turned: Turned) -> Option<DQuat> {
    turned.settled.then(|| DQuat::from(turned.rotation)).filter(|q| q.is_finite())
}
