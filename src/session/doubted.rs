//! What sensors say in a recording that a body cannot do: the same that is doubted while somebody is followed.

use super::angles::{Interpolated, common_span, worn_sensors};
use crate::body::Segment;
use crate::body::worn::Wearing;
use crate::body::worn::doubt::{Doubts, Why};
use crate::body::worn::kept::Kept;
use crate::capture::Stuck;
use crate::error::{Error, counted};
use crate::recording::{SensorMoment, SensorSeries};
use crate::time::Instant;
use glam::{DQuat, DVec3};

/// Time between two looks, ns: what is judged here is judged at 100 Hz.
const LOOK_NS: u64 = 10_000_000;
/// So many are said one by one.
const SAID: usize = 6;

/// A time in which a segment's sensor says what cannot be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Doubted {
    /// Which.
    pub segment: Segment,
    /// What was seen first.
    pub why: Why,
    /// From when on, since all sensors speak, s.
    pub from_s: f64,
    /// Until when, half a second after the last such thing, s.
    pub to_s: f64,
}

impl Doubted {
    /// What happened, in words.
    #[must_use]
    pub fn words(&self) -> String {
        let segment = crate::body::worn::calibrate::words(self.segment);
        let why = match self.why {
            Why::Range => "the joint does not go so far, or its heading is off",
            why => why.words(),
        };
        format!(
            "the sensor on the {segment} is doubted from {:.2} to {:.2} s: {why}",
            self.from_s, self.to_s
        )
    }
}

/// What is doubted of a recording, a line each.
///
/// # Errors
/// As [`doubted`].
pub fn told(series: &SensorSeries, kept: &Kept) -> Result<Vec<String>, Error> {
    Ok(words(&doubted(series, kept)?))
}

/// The same of many, a line each, and the rest counted.
#[must_use]
pub fn words(doubted: &[Doubted]) -> Vec<String> {
    let mut lines: Vec<String> = doubted.iter().take(SAID).map(Doubted::words).collect();
    let more = doubted.len().saturating_sub(SAID);
    if more > 0 {
        let sum_s: f64 = doubted[SAID..].iter().map(|of| of.to_s - of.from_s).sum();
        lines.push(format!("and {} like these, {sum_s:.1} s together", counted(more, "more time")));
    }
    lines
}

/// A sensor's samples, as they are heard one after the other.
struct Heard<'a> {
    segment: Segment,
    moments: core::slice::Iter<'a, SensorMoment>,
    stuck: Stuck,
    /// It said where it is turned, and was not stuck.
    speaks: bool,
    turned: DQuat,
}

impl Heard<'_> {
    /// When it speaks next.
    fn next_ns(&self) -> Option<u64> {
        self.moments.as_slice().first().map(|moment| moment.taken_ns)
    }

    /// Hears what was said until then; tells what was measured of gravity on the mean, in the sensor's own world.
    fn until(&mut self, at_ns: u64, doubts: &mut Doubts) -> Option<DVec3> {
        let (mut sum, mut count) = (DVec3::ZERO, 0_u32);
        while self.next_ns().is_some_and(|next_ns| next_ns <= at_ns) {
            let Some(moment) = self.moments.next() else { break };
            let taken = Instant::from_nanos(moment.taken_ns);
            let is_stuck = self.stuck.take(&moment.sample(), taken);
            self.turned = moment.orientation.unwrap_or(self.turned);
            let spoke = self.speaks;
            self.speaks = moment.orientation.is_some() && !is_stuck;
            if self.speaks && !spoke {
                doubts.began_anew(self.segment);
            }
            if is_stuck || moment.orientation.is_some() {
                doubts.hear(self.segment, self.turned, taken, is_stuck);
            }
            let force = moment.orientation.zip(moment.acceleration_m_s2).filter(|_| !is_stuck);
            if let Some((turned, force)) = force {
                (sum, count) = (sum + turned * force, count + 1);
            }
        }
        (count > 0).then(|| sum / f64::from(count))
    }
}

/// What is doubted of a recording of a person who was calibrated so, in the order of time. Where no sensor speaks nothing is looked at, so
/// that one time that was misread costs nothing.
///
/// # Errors
/// A calibration that names sensors which are not in the recording, sensors that never spoke at the same time.
pub fn doubted(series: &SensorSeries, kept: &Kept) -> Result<Vec<Doubted>, Error> {
    let sensors = worn_sensors(series, kept)?;
    let (first_ns, last_ns) = common_span(&sensors)?;
    let mut readers: Vec<Interpolated<'_>> =
        sensors.iter().map(|(segment, said)| Interpolated::new(*segment, said)).collect();
    let named = kept.sensors.iter().zip(&kept.calibration.mounts);
    let heard = |(name, mount): (&String, &crate::body::worn::Mount)| Heard {
        segment: mount.segment,
        moments: series.sensors.get(name).map(Vec::as_slice).unwrap_or_default().iter(),
        stuck: Stuck::default(),
        speaks: false,
        turned: DQuat::IDENTITY,
    };
    let mut all: Vec<Heard<'_>> = named.map(heard).collect();
    let mut wearing = Wearing::new(&kept.calibration);
    let (mut doubts, worn) = (Doubts::default(), wearing.worn());
    let mut since_s = [None; 13];
    let mut found = Vec::new();
    let (mut at_ns, mut dt_s) = (first_ns, 0.0);
    loop {
        let now_s = (at_ns - first_ns) as f64 / 1e9;
        let mut said = [None; 13];
        for reader in &mut readers {
            said[reader.segment.index()] = reader.at(at_ns);
        }
        for heard in &mut all {
            let force = heard.until(at_ns, &mut doubts);
            let force = force.and_then(|force| wearing.in_world(heard.segment, force));
            doubts.weigh(heard.segment, force, dt_s);
        }
        for change in doubts.judge(dt_s) {
            // As while somebody is followed: of what waits no joint's heading is learnt.
            match change.doubted {
                Some(_) => wearing.hold(change.segment),
                None => wearing.release(change.segment, change.heading_lost),
            }
            let since = &mut since_s[change.segment.index()];
            match (change.doubted, *since) {
                (Some(why), _) => *since = Some((why, now_s)),
                (None, Some((why, from_s))) => {
                    *since = None;
                    found.push(Doubted { segment: change.segment, why, from_s, to_s: now_s });
                }
                (None, None) => {}
            }
        }
        wearing.pose(&said, dt_s);
        doubts.look(&wearing.as_said(), &worn);
        let next_ns = all.iter().filter_map(Heard::next_ns).min();
        let Some(next_ns) = next_ns.map(|next_ns| next_ns.max(at_ns + LOOK_NS)) else { break };
        dt_s = (next_ns - at_ns) as f64 / 1e9;
        at_ns = next_ns;
    }
    let to_s = (last_ns - first_ns) as f64 / 1e9;
    for (segment, since) in Segment::ALL.into_iter().zip(since_s) {
        found.extend(since.map(|(why, from_s)| Doubted { segment, why, from_s, to_s }));
    }
    found.sort_by(|one, other| one.from_s.total_cmp(&other.from_s));
    Ok(found)
}
