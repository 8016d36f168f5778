//! A motion before its timing is settled: it may be too fast for the robot and may start or end
//! moving.

use std::collections::HashSet;

use crate::error::{Error, ErrorKind, counted};
use crate::motion::spline::{End, Spline};

/// Most joints of a path.
pub const MAX_JOINTS: usize = 512;
/// Most samples per joint.
pub const MAX_SAMPLES: usize = 2_000_000;
/// Most numbers in a path: joints times samples.
pub const MAX_VALUES: usize = 16_000_000;
/// Highest rate.
pub const MAX_RATE_HZ: f64 = 100_000.0;
/// Longest path: one day.
pub const MAX_DURATION_S: f64 = 86_400.0;
/// Slowest end velocity that counts as moving. Slower than this on every joint, the end is taken
/// for a rest, and a stop there asks little of the acceleration.
pub const REST_RAD_S: f64 = 1e-2;
/// Largest difference of a time stamp from the even grid, as a part of the grid's step. Files round
/// their times (0.0083 s at 120 Hz is off by 0.4 %); more is not an evenly sampled motion.
const GRID_TOLERANCE: f64 = 0.02;

/// Positions of named joints at an even rate, as one spline per joint.
#[derive(Clone, Debug, PartialEq)]
pub struct Path {
    joints: Vec<String>,
    splines: Vec<Spline>,
    starts_moving: bool,
    ends_moving: bool,
}

impl Path {
    /// Makes a path from `positions_rad[joint][sample]`, sampled at `rate_hz`.
    ///
    /// An end where no joint moves faster than [`REST_RAD_S`] becomes an exact rest.
    ///
    /// # Errors
    /// If a joint is named twice or has no row, rows differ in length, there are fewer than two
    /// samples or more than the bounds of this module, the rate is not usable, or a position is not
    /// finite; joint and sample index are named.
    pub fn new(
        joints: Vec<String>,
        rate_hz: f64,
        positions_rad: Vec<Vec<f64>>,
    ) -> Result<Self, Error> {
        check_names(&joints, positions_rad.len())?;
        let samples = positions_rad.first().map_or(0, Vec::len);
        check_size(joints.len(), samples, rate_hz)?;
        for (joint, row) in joints.iter().zip(&positions_rad) {
            if row.len() != samples {
                return Err(Error::new("joints have different numbers of positions")
                    .at(format!("joint {joint}"))
                    .got(row.len().to_string())
                    .allowed(format!("{samples}, as the first joint")));
            }
            if let Some(index) = row.iter().position(|position| !position.is_finite()) {
                return Err(Error::new("a joint position is not a finite number")
                    .at(format!("joint {joint}, sample {index}"))
                    .got(row[index].to_string()));
            }
        }
        let step_s = 1.0 / rate_hz;
        let moving = |row: &Vec<f64>, order: fn(usize, usize) -> usize| {
            let at = |i| row[order(i, row.len())];
            !(end_velocity(row.len(), step_s, at).abs() <= REST_RAD_S)
        };
        let starts_moving = positions_rad.iter().any(|row| moving(row, |i, _| i));
        let ends_moving = positions_rad.iter().any(|row| moving(row, |i, len| len - 1 - i));
        let condition = |moving| if moving { End::Free } else { End::Velocity(0.0) };
        let splines = positions_rad
            .into_iter()
            .map(|row| {
                Spline::through(row, step_s, condition(starts_moving), condition(ends_moving))
            })
            .collect::<Result<_, _>>()?;
        Ok(Self { joints, splines, starts_moving, ends_moving })
    }

    /// Makes a path from positions with a time stamp each, as a table in a file has them.
    ///
    /// # Errors
    /// As [`Self::new`], and if times are not finite, not rising, or not even to within 2 % of
    /// their mean step; the index is named.
    pub fn from_timed(
        joints: Vec<String>,
        times_s: &[f64],
        positions_rad: Vec<Vec<f64>>,
    ) -> Result<Self, Error> {
        if let Some(index) = times_s.iter().position(|time| !time.is_finite()) {
            return Err(Error::new("a time is not a finite number")
                .at(format!("sample {index}"))
                .got(times_s[index].to_string()));
        }
        if let Some(index) = times_s.windows(2).position(|pair| !(pair[0] < pair[1])) {
            return Err(Error::new("times do not rise")
                .at(format!("sample {}", index + 1))
                .got(format!("{} s after {} s", times_s[index + 1], times_s[index])));
        }
        let [first, .., last] = times_s else {
            return Err(too_few(times_s.len()));
        };
        if positions_rad.iter().any(|row| row.len() != times_s.len()) {
            return Err(Error::new("times and positions differ in number")
                .got(counted(times_s.len(), "time")));
        }
        let step_s = (last - first) / (times_s.len() - 1) as f64;
        for (index, time) in times_s.iter().enumerate() {
            let even = first + index as f64 * step_s;
            if !((time - even).abs() <= GRID_TOLERANCE * step_s) {
                return Err(Error::new("times are not evenly spaced")
                    .at(format!("sample {index}"))
                    .got(format!("{time} s"))
                    .allowed(format!("{even:.6} s within 2 % of the mean step {step_s:.6} s"))
                    .remedy("resample the motion at an even rate"));
            }
        }
        Self::new(joints, 1.0 / step_s, positions_rad)
    }

    /// Joint names, in row order.
    #[must_use]
    pub fn joints(&self) -> &[String] {
        &self.joints
    }

    /// One spline per joint.
    #[must_use]
    pub fn splines(&self) -> &[Spline] {
        &self.splines
    }

    /// Time between samples, s.
    #[must_use]
    pub fn step_s(&self) -> f64 {
        self.splines[0].step_s()
    }

    /// Number of samples of each joint.
    #[must_use]
    pub fn samples(&self) -> usize {
        self.splines[0].values().len()
    }

    /// Time from the first sample to the last, s.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.splines[0].duration_s()
    }

    /// Positions at the first sample, rad.
    #[must_use]
    pub fn first_rad(&self) -> Vec<f64> {
        self.splines.iter().map(|spline| spline.values()[0]).collect()
    }

    /// Positions at the last sample, rad.
    #[must_use]
    pub fn last_rad(&self) -> Vec<f64> {
        self.splines.iter().map(|spline| spline.values()[self.samples() - 1]).collect()
    }

    /// Whether any joint moves at the first sample.
    #[must_use]
    pub const fn starts_moving(&self) -> bool {
        self.starts_moving
    }

    /// Whether any joint moves at the last sample.
    #[must_use]
    pub const fn ends_moving(&self) -> bool {
        self.ends_moving
    }

    /// The same path, `factor` times as long in time; `factor` is finite and positive.
    #[must_use]
    pub fn stretched(&self, factor: f64) -> Self {
        let splines = self.splines.iter().map(|spline| spline.stretched(factor)).collect();
        Self { splines, joints: self.joints.clone(), ..*self }
    }
}

/// Velocity at the end where `at(0)` is the last point before nothing, from as many of the nearest
/// six points as there are (one-sided differences, exact for polynomials of that order).
pub(crate) fn end_velocity(samples: usize, step_s: f64, at: impl Fn(usize) -> f64) -> f64 {
    let weights: &[f64] = match samples {
        0 | 1 => &[],
        2 => &[-1.0, 1.0],
        3 => &[-1.5, 2.0, -0.5],
        4 | 5 => &[-11.0 / 6.0, 3.0, -1.5, 1.0 / 3.0],
        _ => &[-137.0 / 60.0, 5.0, -5.0, 10.0 / 3.0, -1.25, 0.2],
    };
    weights.iter().enumerate().map(|(i, weight)| weight * at(i)).sum::<f64>() / step_s
}

pub(crate) fn check_names(joints: &[String], rows: usize) -> Result<(), Error> {
    if joints.is_empty() || joints.len() > MAX_JOINTS || joints.len() != rows {
        return Err(Error::new("joints and rows of positions do not match")
            .got(format!("{}, {rows}", counted(joints.len(), "joint"), rows = counted(rows, "row")))
            .allowed(format!("one row for each of 1 to {MAX_JOINTS} joints")));
    }
    let mut seen = HashSet::new();
    match joints.iter().find(|joint| !seen.insert(joint.as_str())) {
        Some(joint) => {
            Err(Error::of(ErrorKind::Malformed, "a joint is named twice")
                .at(format!("joint {joint}")))
        }
        None => Ok(()),
    }
}

fn check_size(joints: usize, samples: usize, rate_hz: f64) -> Result<(), Error> {
    if samples < 2 {
        return Err(too_few(samples));
    }
    if samples > MAX_SAMPLES || samples.saturating_mul(joints) > MAX_VALUES {
        return Err(Error::new("a motion is too long to hold in memory")
            .got(format!(
                "{samples} of {joints}",
                joints = counted(joints, "joint"),
                samples = counted(samples, "sample")
            ))
            .allowed(format!("{MAX_SAMPLES} samples, {MAX_VALUES} positions in all")));
    }
    let duration_s = (samples - 1) as f64 / rate_hz;
    let usable = rate_hz > 0.0 && rate_hz <= MAX_RATE_HZ && duration_s <= MAX_DURATION_S;
    if !usable {
        return Err(Error::new("a motion's rate is not usable")
            .got(format!("{rate_hz} Hz for {samples}", samples = counted(samples, "sample")))
            .allowed(format!("0 to {MAX_RATE_HZ} Hz, at most {MAX_DURATION_S} s in all")));
    }
    Ok(())
}

fn too_few(samples: usize) -> Error {
    Error::new("a motion needs at least two samples")
        .got(samples.to_string())
        .allowed("two or more")
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::PI;

    fn names(count: usize) -> Vec<String> {
        (0..count).map(|i| format!("j{i}")).collect()
    }

    fn place(result: Result<Path, Error>) -> String {
        result.unwrap_err().place.unwrap().into()
    }

    #[test]
    fn a_position_that_is_not_finite_is_refused_with_joint_and_index() {
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            for joint in 0..3 {
                for index in 0..5 {
                    let mut rows = vec![vec![0.0; 5]; 3];
                    rows[joint][index] = bad;
                    let got = place(Path::new(names(3), 100.0, rows));
                    assert_eq!(got, format!("joint j{joint}, sample {index}"));
                }
            }
        }
    }

    #[test]
    fn shapes_that_do_not_fit_are_refused() {
        assert!(Path::new(vec![], 100.0, vec![]).is_err());
        assert!(Path::new(names(2), 100.0, vec![vec![0.0; 4]]).is_err());
        assert!(Path::new(names(1), 100.0, vec![vec![]]).is_err());
        assert!(Path::new(names(1), 100.0, vec![vec![0.0]]).is_err());
        assert!(Path::new(names(2), 100.0, vec![vec![0.0; 4], vec![0.0; 5]]).is_err());
        let twice = vec!["knee".to_owned(), "knee".to_owned()];
        assert_eq!(place(Path::new(twice, 100.0, vec![vec![0.0; 4]; 2])), "joint knee");
        for rate_hz in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e-9, 1e6] {
            assert!(Path::new(names(1), rate_hz, vec![vec![0.0; 4]]).is_err(), "{rate_hz}");
        }
    }

    #[test]
    fn times_must_rise_evenly() {
        let from = |times: &[f64]| Path::from_timed(names(1), times, vec![vec![0.0; times.len()]]);
        assert!((from(&[0.5, 0.6, 0.7]).unwrap().step_s() - 0.1).abs() < 1e-12);
        // Four decimals at 120 Hz, as files print them.
        assert!(from(&[0.0, 0.0083, 0.0167, 0.0250, 0.0333]).is_ok());
        assert_eq!(place(from(&[0.0, 0.1, 0.1, 0.2])), "sample 2");
        assert_eq!(place(from(&[0.0, 0.1, 0.05, 0.2])), "sample 2");
        assert_eq!(place(from(&[0.0, f64::NAN, 0.2])), "sample 1");
        assert_eq!(place(from(&[0.0, 0.1, 0.2, 0.4])), "sample 1");
        assert!(from(&[]).is_err());
        assert!(from(&[0.0]).is_err());
        assert!(from(&[0.0, 1e9]).is_err());
    }

    #[test]
    fn an_end_at_rest_becomes_exactly_a_rest_and_a_moving_end_keeps_its_velocity() {
        // A quarter of a sine: starts moving at 1 rad/s, ends at rest.
        let row: Vec<f64> = (0..=100).map(|i| (PI / 2.0 * f64::from(i) / 100.0).sin()).collect();
        let path = Path::new(names(1), 100.0 / (PI / 2.0), vec![row]).unwrap();
        assert!(path.starts_moving() && !path.ends_moving());
        let start = path.splines()[0].sample(0.0)[1];
        assert!((start - 1.0).abs() < 1e-3, "{start}");
        assert_eq!(path.splines()[0].sample(path.duration_s())[1], 0.0);
    }
}
