//! Errors of an orientation filter on recordings whose true orientation a camera system measured.
//! `tests/orientation_truth.rs` says which they are.

use glam::{DQuat, DVec3};
use std::path::Path;

/// Time between two samples of BROAD.
pub const BROAD_PERIOD_S: f64 = 7.0 / 2000.0;
/// Time between two samples of the trials with two sensors on a joint.
pub const JOINT_PERIOD_S: f64 = 0.02;

/// Rows of little-endian floats.
pub fn floats(path: &Path, columns: usize) -> Vec<Vec<f64>> {
    let bytes = std::fs::read(path).expect("a recording");
    let numbers: Vec<f64> =
        bytes.as_chunks::<4>().0.iter().map(|b| f64::from(f32::from_le_bytes(*b))).collect();
    numbers.chunks_exact(columns).map(<[f64]>::to_vec).collect()
}

/// Rows of a table with one line of titles.
pub fn table(path: &Path) -> Vec<Vec<f64>> {
    let text = std::fs::read_to_string(path).expect("a table");
    let row = |line: &str| line.split(',').map(|cell| cell.parse().expect("a number")).collect();
    text.lines().skip(1).map(row).collect()
}

pub fn vector(row: &[f64], at: usize) -> DVec3 {
    DVec3::new(row[at], row[at + 1], row[at + 2])
}

pub fn quaternion(row: &[f64], at: usize) -> DQuat {
    DQuat::from_xyzw(row[at + 1], row[at + 2], row[at + 3], row[at])
}

/// Degrees of heading, inclination and both of an error seen from the world (Laidig et al. 2021).
fn error_deg(error: DQuat) -> [f64; 3] {
    let heading = 2.0 * error.z.atan2(error.w);
    let heading =
        (heading + std::f64::consts::PI).rem_euclid(std::f64::consts::TAU) - std::f64::consts::PI;
    let inclination = 2.0 * error.w.hypot(error.z).min(1.0).acos();
    let total = 2.0 * error.w.abs().min(1.0).acos();
    [total, heading, inclination].map(f64::to_degrees)
}

fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0), |(sum, count), v| (sum + v * v, count + 1));
    assert!(count > 0);
    (sum / f64::from(count)).sqrt()
}

/// RMSE of total, heading and inclination over the moving phases of a BROAD trial, degrees. The
/// filter is given angular rate, specific force and magnetic field; with `heading` it tells north.
pub fn broad_rmse_deg(
    rows: &[Vec<f64>],
    heading: bool,
    mut filter: impl FnMut(DVec3, DVec3, Option<DVec3>) -> DQuat,
) -> [f64; 3] {
    let mut errors = Vec::new();
    for row in rows {
        let field = Some(vector(row, 6)).filter(|v| v.is_finite());
        let found = filter(vector(row, 0), vector(row, 3), field);
        let truth = quaternion(row, 9);
        if row[13] != 0.0 && truth.is_finite() {
            errors.push(found * truth.conjugate());
        }
    }
    if !heading {
        // Without a magnetometer the heading starts anywhere: that of the first two seconds of
        // motion is taken off.
        let first = errors.iter().take((2.0 / BROAD_PERIOD_S) as usize);
        let (z, w) = first.fold((0.0, 0.0), |(z, w), e| {
            let sign = if e.w < 0.0 { -1.0 } else { 1.0 };
            (z + sign * e.z, w + sign * e.w)
        });
        let off = DQuat::from_rotation_z(-2.0 * z.atan2(w));
        errors.iter_mut().for_each(|error| *error = off * *error);
    }
    [0, 1, 2].map(|part| rms(errors.iter().map(|error| error_deg(*error)[part])))
}

/// RMSE of the relative orientation of two segments, degrees, heading told once from the truth at
/// 5 s. The filter is given number of the sensor, angular rate and specific force.
pub fn joint_rmse_deg(
    rows: &[Vec<f64>],
    mut filter: impl FnMut(usize, DVec3, DVec3) -> DQuat,
) -> f64 {
    let mut heading = None;
    let mut errors = Vec::new();
    for (index, row) in rows.iter().enumerate() {
        let [one, two] = [0, 1].map(|n| filter(n, vector(row, 6 * n + 3), vector(row, 6 * n)));
        let [true_one, true_two] = [12, 16].map(|at| quaternion(row, at).normalize());
        let truth = true_one.conjugate() * true_two;
        if !truth.is_finite() || index < 250 {
            continue;
        }
        let between = |heading: f64| one.conjugate() * DQuat::from_rotation_z(heading) * two;
        let heading = *heading.get_or_insert_with(|| {
            // Of the turns about the vertical the one that explains the truth best.
            let needed = one * truth * two.conjugate();
            2.0 * needed.z.atan2(needed.w)
        });
        errors.push(error_deg(between(heading) * truth.conjugate())[0]);
    }
    rms(errors.into_iter())
}
