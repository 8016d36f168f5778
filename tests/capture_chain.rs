//! Virtual sensors of every format on a moving body, through decoder, profile, clock and fusion,
//! against the truth.

use gaitway::capture::{Captured, Chain, Mode, Order};
use gaitway::device::sensor::{SensorSample, stream_format};
use gaitway::time::Instant;
use gaitway::wire::sensor::Stream;
use gaitway_profiles::Quantity;
use gaitway_sim::imu::{
    BodyMotion, DotPayload, ImuErrors, ImuWire, Kinematics, Mount, Sent, VirtualImu,
};
use glam::{DQuat, DVec3};

const PROFILES: [(&str, ImuWire); 18] = [
    ("witmotion-wt901", ImuWire::WitMotion),
    ("witmotion-wt901ble", ImuWire::WitMotionBle),
    ("bno08x-rvc", ImuWire::Bno08xRvc),
    ("xsens-mti", ImuWire::Xsens),
    ("vectornav-vn100", ImuWire::VectorNavBinary),
    ("vectornav-vn100-ascii", ImuWire::VectorNavAscii),
    ("x-imu3", ImuWire::XImu3),
    ("mpu6050-teapot", ImuWire::Teapot),
    ("arduino-csv", ImuWire::Csv),
    ("nmea-imu", ImuWire::Nmea),
    ("cobs-imu", ImuWire::Cobs),
    ("slip-imu", ImuWire::Slip),
    ("movella-dot", ImuWire::MovellaDot(DotPayload::CustomMode5)),
    ("movella-dot-rate", ImuWire::MovellaDot(DotPayload::RateQuantities)),
    ("movella-dot-extended", ImuWire::MovellaDot(DotPayload::ExtendedQuaternion)),
    ("movella-dot-complete", ImuWire::MovellaDot(DotPayload::CompleteQuaternion)),
    ("movella-dot-orientation", ImuWire::MovellaDot(DotPayload::OrientationQuaternion)),
    ("movella-dot-custom1", ImuWire::MovellaDot(DotPayload::CustomMode1)),
];

/// A forearm that swings: 0.6 rad to both sides of level, about the vertical and about its own
/// length, its origin moving a little.
fn swing(seconds: f64) -> BodyMotion {
    let rate_hz = 100.0;
    let times: Vec<f64> =
        (0..=(seconds * rate_hz) as u32).map(|n| f64::from(n) / rate_hz).collect();
    let turn = |t: &f64| {
        DQuat::from_rotation_z(0.6 * (2.1 * t).sin())
            * DQuat::from_rotation_y(0.5 * (1.3 * t).sin())
            * DQuat::from_rotation_x(0.3 * (3.1 * t).cos())
    };
    let orientations: Vec<_> = times.iter().map(turn).map(|q| [q.w, q.x, q.y, q.z]).collect();
    let positions: Vec<_> =
        times.iter().map(|t| [0.1 * (1.7 * t).sin(), 0.05 * (2.3 * t).cos(), 1.0]).collect();
    BodyMotion::new(rate_hz, &positions, &orientations).expect("a motion")
}

fn imu(profile: &str, wire: ImuWire, errors: ImuErrors, seconds: f64) -> VirtualImu {
    let rate_hz = gaitway_profiles::sensor(profile).expect("shipped").rate_hz;
    let mount = Mount { offset_m: [0.1, 0.02, 0.0], orientation: [0.8, 0.0, 0.6, 0.0] };
    VirtualImu::new(swing(seconds), mount, errors, wire, rate_hz).expect("a sensor")
}

/// What is captured of each sample that arrived, with the truth of when it was sent.
fn capture(profile: &str, imu: VirtualImu) -> (Vec<(Sent, Captured)>, Chain) {
    let sensor = gaitway_profiles::sensor(profile).expect("shipped");
    let mut stream = Stream::new(stream_format(&sensor).expect("columns").expect("a stream"));
    let mut chain = Chain::new(&sensor, Mode::SixAxes);
    let mut found = Vec::new();
    for sent in imu {
        let arrival = Instant::from_nanos(1_000_000_000 + (sent.due_s * 1e9).round() as u64);
        stream.push(&sent.bytes, |reading| {
            for captured in chain.take(&reading, arrival).into_iter().flatten() {
                found.push((sent.clone(), captured));
            }
        });
    }
    assert_eq!(stream.counts().bad, 0, "{profile}");
    (found, chain)
}

fn vector(v: [f64; 3]) -> DVec3 {
    DVec3::from_array(v)
}

fn orientation(truth: &Kinematics) -> DQuat {
    let [w, x, y, z] = truth.orientation;
    DQuat::from_xyzw(x, y, z, w)
}

fn has(sample: &SensorSample, quantity: Quantity) -> bool {
    match quantity {
        Quantity::Acceleration => sample.acceleration_m_s2.is_some(),
        Quantity::LinearAcceleration => sample.linear_acceleration_m_s2.is_some(),
        Quantity::AngularRate => sample.angular_rate_rad_s.is_some(),
        Quantity::MagneticField => sample.magnetic_field_t.is_some(),
        Quantity::Orientation | Quantity::Euler => sample.orientation.is_some(),
        Quantity::Temperature => sample.temperature_c.is_some(),
    }
}

#[test]
fn every_format_brings_over_what_the_sensor_underwent() {
    for (profile, wire) in PROFILES {
        let (found, _) = capture(profile, imu(profile, wire, ImuErrors::default(), 5.0));
        let rate_hz = gaitway_profiles::sensor(profile).expect("shipped").rate_hz;
        assert_eq!(found.len(), (5.0 * rate_hz) as usize + 1, "{profile}");
        for (sent, captured) in &found {
            let sample = &captured.sample;
            assert_eq!((captured.stamp.order, sample.implausible), (Order::Next, false));
            assert_eq!(captured.stamp.number, sent.number);
            // Half a count of the coarsest format: 16 g, 2000 deg/s over 32768.
            if let Some(force) = sample.acceleration_m_s2 {
                let off = (force - vector(sent.truth.specific_force_m_s2)).length();
                assert!(off < 0.01, "{profile}: acceleration off by {off}");
            }
            if let Some(rate) = sample.angular_rate_rad_s {
                let off = (rate - vector(sent.truth.rate_rad_s)).length();
                assert!(off < 0.002, "{profile}: rate off by {off}");
            }
            if let Some(told) = sample.orientation {
                let off = told.angle_between(orientation(&sent.truth));
                assert!(off < 0.001, "{profile}: orientation off by {off}");
            }
        }
        let sensor = gaitway_profiles::sensor(profile).expect("shipped");
        let required = sensor.channels.iter().filter(|channel| !channel.optional);
        for quantity in required.map(|channel| channel.quantity) {
            let all = found.iter().all(|(_, captured)| has(&captured.sample, quantity));
            assert!(all, "{profile} lacks {quantity:?}");
        }
    }
}

/// Errors of a good consumer sensor, 20 ppm, 16 ms batches, losses.
fn realistic(seed: u64) -> ImuErrors {
    ImuErrors {
        rate_bias_rad_s: [0.005, -0.003, 0.004],
        rate_noise_rad_s: 0.002,
        acceleration_noise_m_s2: 0.03,
        loss: 0.01,
        clock_skew: 20e-6,
        batch_s: 0.016,
        latency_s: 0.002,
        jitter_s: 0.001,
        seed,
        ..ImuErrors::default()
    }
}

/// The whole chain under realistic errors: time to a millisecond once a minute has passed, the
/// constant part taken off; inclination to a degree; every loss counted.
#[test]
fn with_realistic_errors_time_orientation_and_losses_are_known() {
    for (profile, wire) in [("xsens-mti", ImuWire::Xsens), ("x-imu3", ImuWire::XImu3)] {
        let (found, chain) = capture(profile, imu(profile, wire, realistic(3), 120.0));
        let counts = chain.timeline().counts();
        let total = found.last().expect("samples").0.number + 1;
        assert_eq!(counts.missed, total - found.len() as u64, "{profile}");

        let late = found.iter().filter(|(sent, _)| sent.taken_s > 60.0);
        let mut errors_s: Vec<f64> = late
            .map(|(sent, c)| c.stamp.taken.as_nanos() as f64 / 1e9 - 1.0 - sent.taken_s)
            .collect();
        errors_s.sort_by(f64::total_cmp);
        let middle = errors_s[errors_s.len() / 2];
        let mut off_s: Vec<f64> = errors_s.iter().map(|e| (e - middle).abs()).collect();
        off_s.sort_by(f64::total_cmp);
        let p99_s = off_s[off_s.len() * 99 / 100];
        eprintln!("{profile}: clock p99 {:.3} ms, constant {:.3} ms", p99_s * 1e3, middle * 1e3);
        assert!(p99_s < 0.001, "{profile}: {p99_s} s");

        let mut square = 0.0;
        let mut count = 0.0;
        for (sent, captured) in found.iter().filter(|(sent, _)| sent.taken_s > 10.0) {
            let fused = captured.fused.expect("fused").orientation;
            // The vertical as the sensor sees it: headings play no part.
            let off = (fused.conjugate() * DVec3::Z)
                .angle_between(orientation(&sent.truth).conjugate() * DVec3::Z);
            square += off * off;
            count += 1.0;
        }
        let rmse_deg = f64::sqrt(square / count).to_degrees();
        eprintln!("{profile}: inclination RMSE {rmse_deg:.3} degrees");
        assert!(rmse_deg < 1.0, "{profile}: {rmse_deg}");
    }
}
