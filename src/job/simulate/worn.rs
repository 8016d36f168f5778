//! Virtual sensors on a virtual person.

use super::person::{self, Person};
use crate::body::Segment;
use crate::body::proportions::proximal_joint;
use crate::error::Error;
use gaitway_profiles::{Sensor, SensorProtocol};
use gaitway_sim::imu::{
    BodyMotion, DotPayload, ImuError, ImuErrors, ImuMotion, ImuWire, Mount, VirtualImu,
};
use glam::{DQuat, DVec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// From the joint above to the sensor, along the segment, m.
const ALONG_M: f64 = 0.12;

/// How sensors are worn, and how good they are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Strapping {
    /// Noise and bias as a multiple of a usual sensor's; 0: none.
    pub noise: f64,
    /// Drift of headings that sensors compute themselves, standard deviation, rad/s.
    pub drift_rad_s: f64,
    /// How far straps are turned about the limbs, root mean square, rad.
    pub twist_rad: f64,
    /// An adapter holds bytes back to multiples of this time, s.
    pub batch_s: f64,
    /// Probability that a sample is lost.
    pub loss: f64,
}

/// Reads a number from zero to `most`.
fn up_to(most: f64, text: &str) -> Result<f64, String> {
    let value = text.parse::<f64>().ok().filter(|value| (0.0..=most).contains(value));
    value.ok_or_else(|| format!("allowed are 0 to {most}"))
}

/// Reads [`Strapping::noise`].
///
/// # Errors
/// What is not a factor from 0 to 1000.
pub fn factor(text: &str) -> Result<f64, String> {
    up_to(1e3, text)
}

/// Reads [`Strapping::twist_rad`], in degrees.
///
/// # Errors
/// What is not an angle from 0 to 180 degrees.
pub fn degrees(text: &str) -> Result<f64, String> {
    up_to(180.0, text)
}

/// Reads [`Strapping::loss`].
///
/// # Errors
/// What is not a share from 0 to 1.
pub fn share(text: &str) -> Result<f64, String> {
    up_to(1.0, text)
}

/// What is known of how a segment's sensor is worn: as a file of what is worn says it.
#[derive(Clone, Debug, PartialEq)]
pub struct KnownStrap {
    /// Who wears it.
    pub segment: Segment,
    /// Its profile, if it is heard by itself.
    pub profile: Option<String>,
    /// What of the sensor points forward in N pose, in its axes; `None`: nobody knows.
    pub forward: Option<DVec3>,
    /// The last three bytes of a tracker's network address, which its name tells.
    pub tracker: Option<[u8; 3]>,
}

/// Sensors of somebody who is given one after the other.
pub struct Worn {
    rate_hz: f64,
    wire: ImuWire,
    known: Vec<(KnownStrap, f64, ImuWire)>,
    strapping: Strapping,
    random: ChaCha8Rng,
}

/// What a virtual sensor of this profile speaks.
///
/// # Errors
/// None does.
pub fn wire(sensor: &Sensor) -> Result<ImuWire, Error> {
    Ok(match (sensor.protocol, sensor.name.as_str()) {
        (SensorProtocol::Witmotion, _) => ImuWire::WitMotion,
        (SensorProtocol::WitmotionBle, _) => ImuWire::WitMotionBle,
        (SensorProtocol::Bno08xRvc, _) => ImuWire::Bno08xRvc,
        (SensorProtocol::Xsens, _) => ImuWire::Xsens,
        (SensorProtocol::VectornavBinary, _) => ImuWire::VectorNavBinary,
        (SensorProtocol::VectornavAscii, _) => ImuWire::VectorNavAscii,
        (SensorProtocol::XImu3, _) => ImuWire::XImu3,
        (SensorProtocol::MpuTeapot, _) => ImuWire::Teapot,
        (SensorProtocol::Slimevr, _) => ImuWire::SlimeVr,
        (SensorProtocol::Lines, "arduino-csv") => ImuWire::Csv,
        (SensorProtocol::Lines, "nmea-imu") => ImuWire::Nmea,
        (SensorProtocol::Cobs, "cobs-imu") => ImuWire::Cobs,
        (SensorProtocol::Slip, "slip-imu") => ImuWire::Slip,
        (SensorProtocol::Slip, "movella-dot") => ImuWire::MovellaDot(DotPayload::CustomMode5),
        (SensorProtocol::Slip, "movella-dot-rate") => {
            ImuWire::MovellaDot(DotPayload::RateQuantities)
        }
        (SensorProtocol::Slip, "movella-dot-extended") => {
            ImuWire::MovellaDot(DotPayload::ExtendedQuaternion)
        }
        (SensorProtocol::Slip, "movella-dot-complete") => {
            ImuWire::MovellaDot(DotPayload::CompleteQuaternion)
        }
        (SensorProtocol::Slip, "movella-dot-orientation") => {
            ImuWire::MovellaDot(DotPayload::OrientationQuaternion)
        }
        (SensorProtocol::Slip, "movella-dot-custom1") => {
            ImuWire::MovellaDot(DotPayload::CustomMode1)
        }
        (SensorProtocol::Natnet, _) => {
            return Err(Error::new("virtual persons wear no markers")
                .at("--profile")
                .got(sensor.name.clone())
                .allowed("profiles of inertial sensors"));
        }
        (SensorProtocol::Lines | SensorProtocol::Cobs | SensorProtocol::Slip, _) => {
            return Err(Error::new("virtual sensors cannot send columns of your own")
                .at("--profile")
                .got(sensor.name.clone())
                .allowed("profiles that ship with gaitway"));
        }
    })
}

/// A number with mean 0 and standard deviation 1 (the sum of twelve even ones).
fn normal(random: &mut ChaCha8Rng) -> f64 {
    (0..12).map(|_| random.random::<f64>()).sum::<f64>() - 6.0
}

impl Worn {
    /// Sensors of one profile; `seed` decides everything random.
    ///
    /// # Errors
    /// A profile that no virtual sensor speaks.
    pub fn new(
        sensor: &Sensor,
        known: &[KnownStrap],
        strapping: Strapping,
        seed: u64,
    ) -> Result<Self, Error> {
        let (usual, random) = (wire(sensor)?, ChaCha8Rng::seed_from_u64(seed));
        let of = |strap: &KnownStrap| {
            let Some(profile) = &strap.profile else {
                return Ok((strap.clone(), sensor.rate_hz, usual));
            };
            let own = gaitway_profiles::sensor(profile)?;
            Ok((strap.clone(), own.rate_hz, wire(&own)?))
        };
        let known = known.iter().map(of).collect::<Result<_, Error>>()?;
        Ok(Self { rate_hz: sensor.rate_hz, wire: usual, known, strapping, random })
    }

    /// A sensor on somebody whose motion is known, strapped on as people do.
    ///
    /// # Errors
    /// A motion that no sensor could follow.
    pub fn on(&mut self, person: &Person, segment: Segment) -> Result<VirtualImu, Error> {
        self.moved(segment, |world| {
            let joint = proximal_joint(segment);
            let positions: Vec<[f64; 3]> =
                person.positions(joint).map(|at| (world * at).to_array()).collect();
            let turns = person.poses().iter().map(|pose| world * pose.orientation[segment.index()]);
            let turns: Vec<[f64; 4]> = turns.map(wxyz).collect();
            BodyMotion::new(person::RATE_HZ, &positions, &turns)
        })
    }

    /// A sensor that is strapped on as people do, with a heading that starts anywhere. `motion` says how its segment moves in
    /// the world that begins so.
    ///
    /// # Errors
    /// A motion that no sensor could follow.
    pub fn moved<M: Into<ImuMotion>>(
        &mut self,
        segment: Segment,
        motion: impl FnOnce(DQuat) -> Result<M, ImuError>,
    ) -> Result<VirtualImu, Error> {
        let Self { rate_hz, wire, known, strapping, random } = self;
        let known = known.iter().find(|(strap, ..)| strap.segment == segment);
        let (rate_hz, wire) =
            known.map_or((*rate_hz, *wire), |(_, rate_hz, wire)| (*rate_hz, *wire));
        let unfit = |e: ImuError| Error::new(e.to_string());
        // The world of a sensor without a compass begins where it was switched on.
        let world = DQuat::from_rotation_z(std::f64::consts::TAU * random.random::<f64>());
        let motion = motion(world).map_err(unfit)?;
        let twist = strapping.twist_rad * normal(random);
        let strapped =
            DQuat::from_rotation_z(twist) * DQuat::from_rotation_y(0.15 * normal(random));
        let strapped = match known.map(|(strap, ..)| strap.forward) {
            None => strapped,
            Some(Some(forward)) => strapped * DQuat::from_rotation_arc(forward, DVec3::X),
            Some(None) => {
                let anyhow = std::f64::consts::TAU * random.random::<f64>();
                DQuat::from_rotation_z(anyhow) * strapped
            }
        };
        let mount = Mount {
            offset_m: (segment.long_axis() * ALONG_M).to_array(),
            orientation: wxyz(strapped),
        };
        let mut bias = || strapping.noise * 0.004 * normal(random);
        let errors = ImuErrors {
            rate_bias_rad_s: [bias(), bias(), bias()],
            rate_noise_rad_s: strapping.noise * 0.002,
            acceleration_noise_m_s2: strapping.noise * 0.03,
            clock_skew: 20e-6,
            heading_drift_rad_s: strapping.drift_rad_s * normal(random),
            loss: strapping.loss,
            latency_s: 0.002,
            jitter_s: 0.001,
            batch_s: strapping.batch_s,
            seed: random.random(),
            ..ImuErrors::default()
        };
        VirtualImu::new(motion, mount, errors, wire, rate_hz)
            .map(VirtualImu::then_still)
            .map_err(unfit)
    }
}

/// As a virtual sensor takes it.
pub(super) fn wxyz(q: DQuat) -> [f64; 4] {
    [q.w, q.x, q.y, q.z]
}
