//! Orientations of sensors out of a recording, to be played as if they came now.

use super::disk::open;
use super::imu_message::SensorMessage;
use super::scan::{Found, scan};
use crate::capture::Stuck;
use crate::device::sensor::SensorSample;
use crate::error::Error;
use crate::time::{Duration, Instant};
use glam::{DQuat, DVec3};
use std::collections::{BTreeMap, VecDeque};
use std::io::BufReader;
use std::path::Path;
use std::sync::Arc;

/// Samples replayed at most: half an hour of 15 sensors at 200 Hz.
const MOST_SAMPLES: usize = 5_400_000;

/// A recorded sample, as far as it is replayed.
#[derive(Clone, Debug, PartialEq)]
pub struct ReplayedSample {
    /// Name of the sensor.
    pub sensor: Arc<str>,
    /// Turns vectors of the sensor into those of its own world, Z up; `None` while nobody knew.
    pub orientation: Option<DQuat>,
    /// What its accelerometer said, in its own axes, m/s^2, if it told angular rate as well.
    pub acceleration_m_s2: Option<DVec3>,
    /// True if the sensor or its filter had begun anew.
    pub anew: bool,
    /// True if its values stood still: nothing was measured.
    pub stuck: bool,
    /// When it was read, since the first sample was.
    pub read: Duration,
    /// How long before that it was taken.
    pub age: Duration,
}

/// What is known of a sensor before its next orientation.
struct Before {
    sensor: Arc<str>,
    /// The device began anew.
    reset: bool,
    values: Stuck,
    acceleration_m_s2: Option<DVec3>,
}

impl Before {
    fn of(name: &str) -> Self {
        let (sensor, values) = (name.into(), Stuck::default());
        Self { sensor, reset: false, values, acceleration_m_s2: None }
    }
}

/// Reads the orientations of all sensors, in the order in which they were read.
///
/// # Errors
/// A file that cannot be read, one without orientations, one that is too long.
pub fn read_orientations(path: &Path) -> Result<VecDeque<ReplayedSample>, Error> {
    let place = || path.display().to_string();
    let file = open(path)?;
    let mut found = Vec::new();
    // What the sample said before its orientation.
    let mut names: BTreeMap<String, Before> = BTreeMap::new();
    scan(BufReader::new(file), |what| {
        let Found::Message { channel, header, body } = what else { return Ok(()) };
        let Some((name, part)) =
            channel.topic.strip_prefix("/imu/").and_then(|topic| topic.rsplit_once('/'))
        else {
            return Ok(());
        };
        if !names.contains_key(name) {
            names.insert(name.to_owned(), Before::of(name));
        }
        let Some(Before { sensor, reset, values, acceleration_m_s2 }) = names.get_mut(name) else {
            return Ok(());
        };
        let turned = match SensorMessage::read(&channel.encoding, part, body) {
            Some(SensorMessage::Sample(imu, turned)) => {
                *reset |= imu.order == "reset";
                let sample = SensorSample {
                    angular_rate_rad_s: imu.angular_velocity.map(DVec3::from),
                    acceleration_m_s2: imu.linear_acceleration.map(DVec3::from),
                    magnetic_field_t: imu.magnetic_field.map(DVec3::from),
                    ..SensorSample::default()
                };
                *acceleration_m_s2 =
                    sample.acceleration_m_s2.filter(|_| sample.angular_rate_rad_s.is_some());
                if values.take(&sample, Instant::from_nanos(header.publish_time)) {
                    let age_ns = header.log_time.saturating_sub(header.publish_time);
                    found.push((
                        header.log_time,
                        ReplayedSample {
                            sensor: Arc::clone(sensor),
                            orientation: None,
                            acceleration_m_s2: None,
                            anew: false,
                            stuck: true,
                            read: Duration::ZERO,
                            age: Duration::from_nanos(age_ns),
                        },
                    ));
                }
                turned
            }
            Some(SensorMessage::Turned(turned)) => Some(turned),
            None => None,
        };
        let Some(turned) = turned else { return Ok(()) };
        let orientation = DQuat::from(turned.rotation);
        found.push((
            header.log_time,
            ReplayedSample {
                sensor: Arc::clone(sensor),
                orientation: Some(orientation).filter(|q| turned.settled && q.is_finite()),
                acceleration_m_s2: acceleration_m_s2.take(),
                anew: std::mem::take(reset) || !turned.settled,
                stuck: false,
                read: Duration::ZERO,
                age: Duration::from_nanos(header.log_time.saturating_sub(header.publish_time)),
            },
        ));
        if found.len() > MOST_SAMPLES {
            return Err(Error::new("the recording is too long to be replayed live")
                .allowed(format!("{MOST_SAMPLES} samples")));
        }
        Ok(())
    })
    .map_err(|error| error.at(place()))?;
    found.sort_by_key(|(log_time, _)| *log_time);
    let Some(&(first, _)) = found.first() else {
        return Err(Error::new("the recording holds no orientations of sensors").at(place()));
    };
    let since_first = |(log_time, sample): (u64, ReplayedSample)| ReplayedSample {
        read: Duration::from_nanos(log_time - first),
        ..sample
    };
    Ok(found.into_iter().map(since_first).collect())
}
