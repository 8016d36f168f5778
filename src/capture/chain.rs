//! One sensor from readings to captured samples: SI units, a place in time, an orientation.

use super::orientation::{Fused, Mode, Orientation};
use super::stuck::Stuck;
use super::timeline::{Order, Stamp, Telling, Timeline};
use crate::device::sensor::{Assembler, SensorSample};
use crate::time::{Duration, Instant};
use crate::wire::sensor::Reading;
use gaitway_profiles::Sensor;
use glam::DQuat;

/// A sample with all that is known of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Captured {
    /// When and which.
    pub stamp: Stamp,
    /// What was measured.
    pub sample: SensorSample,
    /// Orientation from angular rate and acceleration; `None` where one of them is missing, and for
    /// samples that came twice or out of order.
    pub fused: Option<Fused>,
    /// True if the sensor's values stand still while its number or time goes on: nothing is measured.
    pub stuck: bool,
}

impl Captured {
    /// Turns vectors of the sensor into those of its own world: the fused orientation or, of a sensor that does not send what is
    /// fused, its own. `None` for a sample that is not used.
    #[must_use]
    pub fn orientation(&self) -> Option<DQuat> {
        let sample = &self.sample;
        let is_fused = sample.angular_rate_rad_s.is_some() && sample.acceleration_m_s2.is_some();
        match self.fused {
            Some(fused) => Some(fused.orientation),
            None if is_fused || self.stamp.order == Order::Doubted => None,
            None => sample.orientation,
        }
    }
}

/// The way of one sensor's readings.
pub struct Chain {
    assembler: Assembler,
    timeline: Timeline,
    orientation: Orientation,
    /// Time since the last sample that was fused, s.
    unfused_s: f64,
    stuck: Stuck,
    stuck_samples: u64,
    profile_rate_hz: f64,
}

/// Part by which a rate may be off another and be called the same.
const SAME_RATE: f64 = 0.05;

/// True if a rate is another one than this.
#[must_use]
pub fn is_another(rate_hz: f64, known_hz: f64) -> bool {
    !((rate_hz / known_hz - 1.0).abs() <= SAME_RATE)
}

impl Chain {
    /// For a sensor of this profile.
    #[must_use]
    pub fn new(sensor: &Sensor, mode: Mode) -> Self {
        let period_s = 1.0 / sensor.rate_hz;
        let telling = Telling {
            counter_bits: sensor.counter.map(|counter| counter.bits),
            clock: sensor.clock.map(|clock| (clock.bits, clock.tick_s)),
            period_s,
            latency: Duration::from_secs_f64(sensor.latency_s),
        };
        Self {
            assembler: Assembler::new(sensor),
            timeline: Timeline::new(telling),
            orientation: Orientation::new(period_s, mode),
            unfused_s: 0.0,
            stuck: Stuck::default(),
            stuck_samples: 0,
            profile_rate_hz: sensor.rate_hz,
        }
    }

    /// Takes a reading that arrived at `arrival`; the samples it completes or cuts short, if it does.
    pub fn take(&mut self, reading: &Reading, arrival: Instant) -> [Option<Captured>; 2] {
        self.assembler.take(reading).map(|sample| Some(self.captured(sample?, arrival)))
    }

    fn captured(&mut self, sample: SensorSample, arrival: Instant) -> Captured {
        let stamp = self.timeline.take(sample.counter, sample.ticks, arrival);
        let is_new = matches!(stamp.order, Order::Next | Order::Gap | Order::Reset);
        let stuck = is_new && self.stuck.take(&sample, stamp.taken);
        self.stuck_samples += u64::from(stuck);
        let fused = match stamp.order {
            _ if stuck => {
                self.unfused_s += stamp.step_s;
                None
            }
            Order::Duplicate | Order::Late | Order::Doubted => None,
            Order::Next | Order::Gap | Order::Reset => {
                self.unfused_s += stamp.step_s;
                self.orientation.come_every(self.timeline.period_s());
                let fused = self.orientation.take(
                    self.unfused_s,
                    sample.angular_rate_rad_s,
                    sample.acceleration_m_s2,
                    sample.magnetic_field_t,
                );
                if fused.is_some() {
                    self.unfused_s = 0.0;
                }
                fused
            }
        };
        Captured { stamp, sample, fused, stuck }
    }

    /// What was seen of order and time.
    #[must_use]
    pub const fn timeline(&self) -> &Timeline {
        &self.timeline
    }

    /// Samples per second by the device's own clock, as far as that is known.
    #[must_use]
    pub fn rate_hz(&self) -> Option<f64> {
        self.timeline.rate_hz()
    }

    /// Samples per second by its profile.
    #[must_use]
    pub const fn profile_rate_hz(&self) -> f64 {
        self.profile_rate_hz
    }

    /// Samples in which nothing was measured any more.
    #[must_use]
    pub const fn stuck_samples(&self) -> u64 {
        self.stuck_samples
    }

    /// Samples that lacked a required part, or in which one was beyond what the sensor measures.
    #[must_use]
    pub const fn incomplete(&self) -> u64 {
        self.assembler.incomplete()
    }
}
