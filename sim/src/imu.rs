//! Virtual inertial sensors: mounted on a segment of a moving body, speaking their makers' formats.
//!
//! The body is given as sampled poses of the segment, all of them beforehand ([`BodyMotion`]) or as they are needed
//! ([`MadeMotion`]); what the sensor measures follows from smooth curves through them, errors are added as a real sensor has them
//! ([`ImuErrors`]), and the samples become bytes that are due at a moment ([`VirtualImu`]), or come
//! out of a pseudo-terminal or a UDP socket in real time ([`ImuDoor`]).
//!
//! World: X east, Y north, Z up, metres. Quaternions are w, x, y, z and turn vectors of the named
//! body into the world's.

mod door;
mod encode;
mod made;
mod motion;
mod stage;
mod turn;

pub use door::ImuDoor;
pub use encode::{DotPayload, ImuWire, Measured};
pub use made::{AROUND, ImuMotion, MadeMotion, MakesPoses, SegmentAt};
pub use motion::{BodyMotion, Kinematics};
pub use stage::Stage;

use gaitway_profiles::counted;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Gravity of the virtual world, m/s^2.
pub const GRAVITY_M_S2: f64 = 9.806_65;

/// Why there can be no such sensor.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ImuError {
    /// Too few poses for a motion, or not as many positions as orientations.
    #[error(
        "{} and {} make no motion",
        counted(.positions, "position"),
        counted(.orientations, "orientation")
    )]
    Poses {
        /// Positions given.
        positions: usize,
        /// Orientations given.
        orientations: usize,
    },
    /// A number that is not finite, or a rate that is not above zero.
    #[error("{0} is not usable")]
    Number(&'static str),
}

/// Where a sensor sits on its segment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mount {
    /// From the segment's origin to the sensor, in the segment's axes, m.
    pub offset_m: [f64; 3],
    /// Turns vectors of the sensor into those of the segment.
    pub orientation: [f64; 4],
}

impl Default for Mount {
    fn default() -> Self {
        Self { offset_m: [0.0; 3], orientation: [1.0, 0.0, 0.0, 0.0] }
    }
}

/// A field beside the earth's, for a time: steel, a motor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Disturbance {
    /// From this time of the motion, s.
    pub from_s: f64,
    /// To this, s.
    pub to_s: f64,
    /// What it adds in the world, T.
    pub field_t: [f64; 3],
}

/// What a sensor gets wrong, and what its way to the host does. The default is none of it, in an
/// earth field of middle Europe.
#[derive(Clone, Debug, PartialEq)]
pub struct ImuErrors {
    /// Added to the angular rate, rad/s.
    pub rate_bias_rad_s: [f64; 3],
    /// Standard deviation of one sample of angular rate, rad/s.
    pub rate_noise_rad_s: f64,
    /// Added to the acceleration, m/s^2.
    pub acceleration_bias_m_s2: [f64; 3],
    /// Standard deviation of one sample of acceleration, m/s^2.
    pub acceleration_noise_m_s2: f64,
    /// Standard deviation of one sample of magnetic field, T.
    pub field_noise_t: f64,
    /// What one of each is measured as, by axis.
    pub scale: [f64; 3],
    /// The measuring axes turned against the case by this rotation vector, rad.
    pub misalignment_rad: [f64; 3],
    /// The earth's field in the world, T.
    pub earth_field_t: [f64; 3],
    /// Fields beside it.
    pub disturbances: Vec<Disturbance>,
    /// How fast the heading runs away of an orientation that the sensor computes itself, rad/s.
    pub heading_drift_rad_s: f64,
    /// Probability that a sample is lost on its way.
    pub loss: f64,
    /// How much slower the sensor's clock runs than the host's; it samples by its own.
    pub clock_skew: f64,
    /// The adapter hands over what it has at multiples of this time, s; zero: at once.
    pub batch_s: f64,
    /// The part of the way that is always the same, s.
    pub latency_s: f64,
    /// The largest part that is not, s.
    pub jitter_s: f64,
    /// Seed of everything random.
    pub seed: u64,
}

impl Default for ImuErrors {
    fn default() -> Self {
        Self {
            rate_bias_rad_s: [0.0; 3],
            rate_noise_rad_s: 0.0,
            acceleration_bias_m_s2: [0.0; 3],
            acceleration_noise_m_s2: 0.0,
            field_noise_t: 0.0,
            scale: [1.0; 3],
            misalignment_rad: [0.0; 3],
            earth_field_t: [0.0, 20e-6, -44e-6],
            disturbances: Vec::new(),
            heading_drift_rad_s: 0.0,
            loss: 0.0,
            clock_skew: 0.0,
            batch_s: 0.0,
            latency_s: 0.0,
            jitter_s: 0.0,
            seed: 0,
        }
    }
}

/// One sample on its way.
#[derive(Clone, Debug, PartialEq)]
pub struct Sent {
    /// Number of the sample, from zero.
    pub number: u64,
    /// When it was taken, time of the motion on the host's clock, s.
    pub taken_s: f64,
    /// When its bytes reach the host, the same clock, s.
    pub due_s: f64,
    /// True motion of the sensor at that moment.
    pub truth: Kinematics,
    /// Its bytes; none if it was lost.
    pub bytes: Vec<u8>,
}

/// A sensor that plays a motion once, sample by sample.
#[derive(Clone, Debug)]
pub struct VirtualImu {
    motion: ImuMotion,
    mount: Mount,
    errors: ImuErrors,
    wire: ImuWire,
    rate_hz: f64,
    number: u64,
    last_due_s: f64,
    stays: bool,
    random: ChaCha8Rng,
}

impl VirtualImu {
    /// A sensor on a segment that moves like `motion`, sampling `rate_hz` times per second of its
    /// own clock and speaking `wire`.
    ///
    /// # Errors
    /// A rate that is not above zero.
    pub fn new(
        motion: impl Into<ImuMotion>,
        mount: Mount,
        errors: ImuErrors,
        wire: ImuWire,
        rate_hz: f64,
    ) -> Result<Self, ImuError> {
        if !(rate_hz.is_finite() && rate_hz > 0.0) {
            return Err(ImuError::Number("the rate"));
        }
        let random = ChaCha8Rng::seed_from_u64(errors.seed);
        let (number, last_due_s, stays) = (0, 0.0, false);
        let motion = motion.into();
        Ok(Self { motion, mount, errors, wire, rate_hz, number, last_due_s, stays, random })
    }

    /// The same, and when the motion is over it goes on to measure the last pose without end. The
    /// motion must end at rest.
    #[must_use]
    pub const fn then_still(mut self) -> Self {
        self.stays = true;
        self
    }

    /// Leaves out what it would have sampled before this time of the motion, s.
    fn skip_to(&mut self, time_s: f64) {
        let passed = (time_s / (1.0 + self.errors.clock_skew) * self.rate_hz).floor() as u64;
        self.number = self.number.max(passed);
    }

    /// What it speaks.
    #[must_use]
    pub const fn wire(&self) -> ImuWire {
        self.wire
    }

    /// A number with this standard deviation (G. Box and M. Muller, 1958).
    fn noise(&mut self, deviation: f64) -> f64 {
        if deviation == 0.0 {
            return 0.0;
        }
        let (one, other): (f64, f64) = (self.random.random(), self.random.random());
        deviation * (-2.0 * (1.0 - one).ln()).sqrt() * (std::f64::consts::TAU * other).cos()
    }

    fn noisy(&mut self, values: [f64; 3], deviation: f64) -> [f64; 3] {
        values.map(|value| value + self.noise(deviation))
    }

    fn measured(&mut self, truth: &Kinematics, taken_s: f64) -> Measured {
        let errors = self.errors.clone();
        let skewed = |vector: [f64; 3]| {
            let seen = turn::back(turn::of_vector(errors.misalignment_rad), vector);
            std::array::from_fn(|axis| seen[axis] * errors.scale[axis])
        };
        let plus = |a: [f64; 3], b: [f64; 3]| std::array::from_fn(|axis| a[axis] + b[axis]);
        let rate = plus(skewed(truth.rate_rad_s), errors.rate_bias_rad_s);
        let force = plus(skewed(truth.specific_force_m_s2), errors.acceleration_bias_m_s2);
        let beside = errors.disturbances.iter().filter(|d| (d.from_s..d.to_s).contains(&taken_s));
        let field = beside.fold(errors.earth_field_t, |sum, d| plus(sum, d.field_t));
        let field = skewed(turn::back(truth.orientation, field));
        Measured {
            rate_rad_s: self.noisy(rate, errors.rate_noise_rad_s),
            specific_force_m_s2: self.noisy(force, errors.acceleration_noise_m_s2),
            linear_acceleration_m_s2: plus(
                force,
                turn::back(truth.orientation, [0.0, 0.0, -GRAVITY_M_S2]),
            ),
            field_t: self.noisy(field, errors.field_noise_t),
            orientation: turn::times(
                turn::of_vector([0.0, 0.0, errors.heading_drift_rad_s * taken_s]),
                truth.orientation,
            ),
            number: self.number,
            device_s: self.number as f64 / self.rate_hz,
        }
    }
}

impl Iterator for VirtualImu {
    type Item = Sent;

    /// The next sample, until the motion is over, or without end ([`VirtualImu::then_still`]).
    fn next(&mut self) -> Option<Sent> {
        let number = self.number;
        let taken_s = number as f64 / self.rate_hz * (1.0 + self.errors.clock_skew);
        if taken_s > self.motion.duration_s() && !self.stays {
            return None;
        }
        let truth = self.motion.at(taken_s, &self.mount);
        let measured = self.measured(&truth, taken_s);
        let bytes = self.wire.encode(&measured);
        let lost = self.errors.loss > 0.0 && self.random.random::<f64>() < self.errors.loss;
        let late_s = self.errors.jitter_s * self.random.random::<f64>();
        let sent_s = taken_s + self.errors.latency_s + late_s;
        let batch_s = self.errors.batch_s;
        let due_s = if batch_s > 0.0 { (sent_s / batch_s).ceil() * batch_s } else { sent_s };
        // Bytes on one line do not overtake each other.
        self.last_due_s = self.last_due_s.max(due_s);
        self.number += 1;
        let bytes = if lost { Vec::new() } else { bytes };
        Some(Sent { number, taken_s, due_s: self.last_due_s, truth, bytes })
    }
}
