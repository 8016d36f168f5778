//! The device calibration: sensors that lie still say how steady they are.

use super::files::SensorCheck;
use crate::error::{counted, either};
use crate::time::Instant;
use crate::units::wrap_rad;
use glam::{DQuat, DVec3};

/// What a sensor said while it was to lie still.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StillSample {
    /// When it was taken.
    pub taken: Instant,
    /// Angular rate in the sensor's axes, rad/s.
    pub rate_rad_s: Option<DVec3>,
    /// Acceleration in the sensor's axes, m/s^2.
    pub acceleration_m_s2: Option<DVec3>,
    /// Orientation in the sensor's own world.
    pub orientation: Option<DQuat>,
}

/// Fewer samples tell nothing.
const LEAST_SAMPLES: usize = 50;
/// Angular rate less its mean, root mean square: more, and the sensor was not still.
const MOST_NOISE_RAD_S: f64 = 1.0 * core::f64::consts::PI / 180.0;
/// Mean of the angular rate: beyond this VQF (Laidig and Seel 2023, `biasClip`) does not take it for
/// a bias any more.
const MOST_BIAS_RAD_S: f64 = 2.0 * core::f64::consts::PI / 180.0;
/// How far one g may be off.
const MOST_OFF_G: f64 = 0.05;
const GRAVITY_M_S2: f64 = 9.806_65;
/// How far the rate of samples may be off the profile's, as a part.
const MOST_OFF_RATE: f64 = 0.05;
/// Part of the samples that may be missing.
const MOST_MISSED: f64 = 0.01;
/// Orientation of a sensor that tells nothing else: spread, rad.
const MOST_SPREAD_RAD: f64 = 1.0 * core::f64::consts::PI / 180.0;

/// Judges what a sensor with this nominal rate said; `missed` samples were lost in between.
#[must_use]
pub fn judge(
    name: &str,
    nominal_rate_hz: f64,
    samples: &[StillSample],
    missed: u64,
) -> SensorCheck {
    let span_s = match samples {
        [first, .., last] => last.taken.seconds_since(first.taken),
        _ => 0.0,
    };
    let rates: Vec<DVec3> = samples.iter().filter_map(|s| s.rate_rad_s).collect();
    let forces: Vec<DVec3> = samples.iter().filter_map(|s| s.acceleration_m_s2).collect();
    let turns: Vec<DQuat> = samples.iter().filter_map(|s| s.orientation).collect();
    let (rate, noise) = mean_and_spread(&rates);
    let (force, force_noise) = mean_and_spread(&forces);
    let count = samples.len() as f64;
    let has = |list: &[DVec3]| !list.is_empty();
    let mut check = SensorCheck {
        name: name.to_owned(),
        passed: true,
        why: Vec::new(),
        samples: samples.len() as u64,
        missed,
        duration_s: span_s,
        rate_hz: if span_s > 0.0 { (count + missed as f64 - 1.0) / span_s } else { 0.0 },
        nominal_rate_hz,
        noise_rad_s: has(&rates).then_some(noise),
        bias_rad_s: has(&rates).then_some(rate.length()),
        acceleration_m_s2: has(&forces).then_some(force.length()),
        acceleration_noise_m_s2: has(&forces).then_some(force_noise),
        heading_drift_rad_s: heading_drift(&turns, span_s),
    };
    check.why = faults(&check, &turns);
    let has_measured = has(&rates) || has(&forces);
    if samples.len() >= LEAST_SAMPLES && has_measured && stand_still(&rates) && stand_still(&forces)
    {
        check.why.push(
            "its values stand still, which noise does not allow: nothing is measured".to_owned(),
        );
    }
    check.passed = check.why.is_empty();
    check
}

/// True if all of them are the same to the bit.
fn stand_still(vectors: &[DVec3]) -> bool {
    vectors.windows(2).all(|pair| pair[0] == pair[1])
}

fn faults(check: &SensorCheck, turns: &[DQuat]) -> Vec<String> {
    let mut why = Vec::new();
    let deg = f64::to_degrees;
    if check.samples < LEAST_SAMPLES as u64 {
        why.push(format!(
            "{} came, {LEAST_SAMPLES} are the least",
            counted(check.samples, "sample")
        ));
        return why;
    }
    let (rate, nominal) = (check.rate_hz, check.nominal_rate_hz);
    if !((rate / nominal - 1.0).abs() <= MOST_OFF_RATE) {
        why.push(format!("{rate:.1} samples per second, its profile says {nominal:.1}"));
    }
    let sent = (check.samples + check.missed) as f64;
    if !(check.missed as f64 / sent <= MOST_MISSED) {
        why.push(format!(
            "{} of {} {} missing",
            check.missed,
            counted(sent, "sample"),
            either(check.missed, "is", "are")
        ));
    }
    match check.noise_rad_s {
        Some(noise) if !(noise <= MOST_NOISE_RAD_S) => {
            why.push(format!("it moved: {:.2} deg/s RMS, {:.1} allowed", deg(noise), 1.0));
        }
        None if turns.is_empty() => why.push("it tells no angular rate and no orientation".into()),
        None if !(spread(turns) <= MOST_SPREAD_RAD) => {
            why.push(format!("it moved: {:.2} deg RMS, {:.1} allowed", deg(spread(turns)), 1.0));
        }
        _ => {}
    }
    if let Some(bias) = check.bias_rad_s.filter(|bias| !(*bias <= MOST_BIAS_RAD_S)) {
        why.push(format!("at rest it says {:.2} deg/s, {:.1} allowed", deg(bias), 2.0));
    }
    let off = |force: f64| (force / GRAVITY_M_S2 - 1.0).abs();
    if let Some(force) = check.acceleration_m_s2.filter(|force| !(off(*force) <= MOST_OFF_G)) {
        why.push(format!("at rest it says {force:.2} m/s^2, one g within 5 % allowed"));
    }
    why
}

/// Mean, and root mean square of what is left.
fn mean_and_spread(vectors: &[DVec3]) -> (DVec3, f64) {
    let count = vectors.len().max(1) as f64;
    let mean = vectors.iter().sum::<DVec3>() / count;
    let squares: f64 = vectors.iter().map(|v| (*v - mean).length_squared()).sum();
    (mean, (squares / count).sqrt())
}

/// Root mean square angle to the first.
fn spread(turns: &[DQuat]) -> f64 {
    let Some(first) = turns.first() else { return 0.0 };
    let squares: f64 = turns.iter().map(|q| first.angle_between(*q).powi(2)).sum();
    (squares / turns.len() as f64).sqrt()
}

/// How fast the heading turns, rad/s: from the first to the last quarter.
fn heading_drift(turns: &[DQuat], span_s: f64) -> Option<f64> {
    let quarter = turns.len() / 4;
    if quarter == 0 || !(span_s > 0.0) {
        return None;
    }
    let first = turns[0];
    let headings = |part: &[DQuat]| {
        let about_z = part.iter().map(|q| {
            let turned = *q * first.inverse();
            wrap_rad(2.0 * turned.z.atan2(turned.w))
        });
        about_z.sum::<f64>() / part.len() as f64
    };
    let (early, late) = (headings(&turns[..quarter]), headings(&turns[turns.len() - quarter..]));
    // The middles of two quarters are three quarters apart.
    Some((late - early) / (0.75 * span_s))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Five seconds at 100 Hz; `at` says rate and acceleration at a time.
    fn said(at: impl Fn(f64) -> (DVec3, DVec3)) -> Vec<StillSample> {
        let sample = |n: u64| {
            let t = n as f64 / 100.0;
            let (rate, force) = at(t);
            let noise = DVec3::X * if n.is_multiple_of(2) { 1e-12 } else { 0.0 };
            let (rate, force) = (rate + noise, force + noise);
            StillSample {
                taken: Instant::from_nanos(n * 10_000_000),
                rate_rad_s: Some(rate),
                acceleration_m_s2: Some(force),
                orientation: Some(DQuat::from_rotation_z(0.002 * t)),
            }
        };
        (0..500).map(sample).collect()
    }

    const UP: DVec3 = DVec3::new(0.0, 0.0, GRAVITY_M_S2);

    #[test]
    fn a_sensor_that_lies_still_passes_with_what_was_measured() {
        let bias = DVec3::new(0.01, 0.0, -0.005);
        let check = judge("torso", 100.0, &said(|_| (bias, UP)), 0);
        assert!(check.passed, "{:?}", check.why);
        assert!((check.rate_hz - 100.0).abs() < 1e-9);
        assert!((check.bias_rad_s.unwrap() - bias.length()).abs() < 1e-12);
        assert!(check.noise_rad_s.unwrap() < 1e-12);
        assert!((check.heading_drift_rad_s.unwrap() - 0.002).abs() < 1e-5);
    }

    #[test]
    fn what_is_wrong_with_a_sensor_is_said_in_words() {
        let bad = |at: &dyn Fn(f64) -> (DVec3, DVec3), missed: u64, nominal: f64| {
            judge("torso", nominal, &said(at), missed).why.join("; ")
        };
        assert!(bad(&|t| (DVec3::X * 0.1 * (9.0 * t).sin(), UP), 0, 100.0).contains("it moved"));
        assert!(bad(&|_| (DVec3::X * 0.05, UP), 0, 100.0).contains("at rest it says 2.86 deg/s"));
        assert!(bad(&|_| (DVec3::ZERO, UP * 0.9), 0, 100.0).contains("one g"));
        assert!(bad(&|_| (DVec3::ZERO, UP), 50, 110.0).contains("50 of 550"));
        assert!(bad(&|_| (DVec3::ZERO, UP), 0, 200.0).contains("its profile says 200.0"));
        let nan = bad(&|_| (DVec3::NAN, UP), 0, 100.0);
        assert!(nan.contains("it moved"), "{nan}");
        assert!(judge("torso", 100.0, &[], 0).why[0].contains("0 samples"));
    }

    #[test]
    fn a_sensor_whose_values_stand_still_does_not_pass() {
        let mut samples = said(|_| (DVec3::X * 0.01, UP));
        assert!(judge("torso", 100.0, &samples, 0).passed);
        // One that was never alive says nothing, some do not even say that, and some tell no angular rate.
        for (rate, force) in [
            (Some(DVec3::X * 0.01), Some(UP)),
            (Some(DVec3::ZERO), Some(UP)),
            (Some(DVec3::ZERO), None),
            (None, Some(UP)),
        ] {
            for sample in &mut samples {
                (sample.rate_rad_s, sample.acceleration_m_s2) = (rate, force);
            }
            let why = judge("torso", 100.0, &samples, 0).why;
            let said = "its values stand still, which noise does not allow: nothing is measured";
            assert_eq!(why, [said], "{rate:?} {force:?}");
        }
    }

    #[test]
    fn a_sensor_that_tells_orientation_only_is_judged_by_that() {
        let mut samples = said(|_| (DVec3::ZERO, UP));
        for sample in &mut samples {
            (sample.rate_rad_s, sample.acceleration_m_s2) = (None, None);
        }
        assert!(judge("head", 100.0, &samples, 0).passed);
        for (n, sample) in samples.iter_mut().enumerate() {
            sample.orientation = Some(DQuat::from_rotation_x(0.1 * (n as f64 / 20.0).sin()));
        }
        assert!(judge("head", 100.0, &samples, 0).why[0].contains("it moved"));
    }
}
