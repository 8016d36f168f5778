//! The orientation filter on real recordings whose true orientation a camera system measured.
//!
//! Data, under `GAITWAY_CAPTURES/imu` (its README says what the columns are):
//! - `vqf_golden`: a recording of dlaidig/vqf (MIT) and what the authors' C++ package 2.1.2 makes of
//!   it with default parameters;
//! - `broad`: trials of the BROAD data set (CC BY 4.0, doi 10.3390/data6070072) with OptiTrack truth;
//! - `weygers_kok_2imu`: two sensors on a joint (dlaidig/dfjimu, MIT) with optical truth.
//!
//! The reference figures beside the measured ones are those of the C++ package on the same files.

mod aloud;

use aloud::aloud;
use gaitway::capture::{Mode, Orientation};
use glam::{DQuat, DVec3};
use std::path::PathBuf;

fn folder(name: &str) -> Option<PathBuf> {
    let captures = std::env::var_os("GAITWAY_CAPTURES").map(PathBuf::from);
    let folder = captures.map(|folder| folder.join("imu").join(name)).filter(|f| f.is_dir());
    if folder.is_none() {
        aloud!("SKIPPED: no imu/{name} under GAITWAY_CAPTURES");
    }
    folder
}

/// Rows of little-endian floats.
fn floats(path: &std::path::Path, columns: usize) -> Vec<Vec<f64>> {
    let bytes = std::fs::read(path).expect("a recording");
    let numbers: Vec<f64> =
        bytes.as_chunks::<4>().0.iter().map(|b| f64::from(f32::from_le_bytes(*b))).collect();
    numbers.chunks_exact(columns).map(<[f64]>::to_vec).collect()
}

/// Rows of a table with one line of titles.
fn table(path: &std::path::Path) -> Vec<Vec<f64>> {
    let text = std::fs::read_to_string(path).expect("a table");
    let row = |line: &str| line.split(',').map(|cell| cell.parse().expect("a number")).collect();
    text.lines().skip(1).map(row).collect()
}

fn vector(row: &[f64], at: usize) -> DVec3 {
    DVec3::new(row[at], row[at + 1], row[at + 2])
}

fn quaternion(row: &[f64], at: usize) -> DQuat {
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

const BROAD_PERIOD_S: f64 = 7.0 / 2000.0;

#[test]
fn the_filter_gives_what_the_authors_package_gives() {
    let Some(folder) = folder("vqf_golden") else { return };
    let rows = floats(&folder.join("imu_data.f32"), 9);
    let golden = table(&folder.join("golden_vqf_2.1.2_every10.csv"));
    let mut worst = 0.0_f64;
    for (mode, column) in [(Mode::SixAxes, 1), (Mode::NineAxes, 5)] {
        let mut filter = Orientation::new(BROAD_PERIOD_S, mode);
        let mut expected = golden.iter();
        for (index, row) in rows.iter().enumerate() {
            let (rate, acceleration) = (Some(vector(row, 0)), Some(vector(row, 3)));
            let fused = filter.take(BROAD_PERIOD_S, rate, acceleration, Some(vector(row, 6)));
            let fused = fused.expect("all rows are measurements");
            if index % 10 != 0 {
                continue;
            }
            let expected = expected.next().expect("a row for each tenth");
            assert_eq!(expected[0], index as f64);
            let off = quaternion(expected, column) - fused.orientation;
            worst = worst.max(off.length());
            let bias_off = (vector(expected, 10) - fused.bias_rad_s).length();
            assert!(bias_off < 1e-9, "{mode:?}, row {index}: bias off by {bias_off}");
            assert_eq!(fused.at_rest, expected[14] != 0.0, "{mode:?}, row {index}");
            if mode == Mode::NineAxes {
                let disturbed = expected[15] != 0.0;
                assert_eq!(fused.magnetically_disturbed, disturbed, "row {index}");
            }
        }
    }
    aloud!("largest difference to VQF 2.1.2 (C++): {worst:.1e}");
    assert!(worst < 1e-9, "{worst}");
}

/// RMSE of total, heading and inclination over the moving phases, degrees.
fn broad(file: &str, mode: Mode) -> Option<[f64; 3]> {
    let rows = floats(&folder("broad")?.join(file), 14);
    let mut filter = Orientation::new(BROAD_PERIOD_S, mode);
    let mut errors = Vec::new();
    for row in &rows {
        let field = Some(vector(row, 6)).filter(|v| v.is_finite());
        let fused = filter.take(BROAD_PERIOD_S, Some(vector(row, 0)), Some(vector(row, 3)), field);
        let truth = quaternion(row, 9);
        if row[13] != 0.0 && truth.is_finite() {
            errors.push(fused.expect("a measurement").orientation * truth.conjugate());
        }
    }
    if mode == Mode::SixAxes {
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
    Some([0, 1, 2].map(|part| rms(errors.iter().map(|error| error_deg(*error)[part]))))
}

#[test]
fn on_a_fast_trial_the_error_is_that_of_the_reference() {
    for (mode, reference) in
        [(Mode::NineAxes, [4.08, 3.70, 1.72]), (Mode::SixAxes, [10.14, 9.99, 1.72])]
    {
        let Some(found) = broad("21_undisturbed_fast_combined_full.f32", mode) else { return };
        aloud!("BROAD 21, {mode:?}: RMSE {found:.2?} degrees (total, heading, inclination), ");
        aloud!("  VQF 2.1.2 (C++): {reference:?}");
        for (found, reference) in found.iter().zip(reference) {
            assert!(*found <= reference + 0.05, "{mode:?}: {found} against {reference}");
        }
    }
}

#[test]
fn beside_a_magnet_the_error_is_that_of_the_reference() {
    let file = "28_disturbed_stationary_magnet_A_60s.f32";
    let Some(found) = broad(file, Mode::NineAxes) else { return };
    // Computed with the C++ package 2.1.2 (Python wheel) on this cut, which begins beside the magnet.
    let (total, inclination) = (8.05, 0.89);
    aloud!("BROAD 28 (60 s, magnet), nine axes: RMSE {found:.2?} degrees,");
    aloud!("  VQF 2.1.2 (C++): total {total}, inclination {inclination}");
    assert!(found[0] <= total + 0.05 && found[2] <= inclination + 0.05);
}

/// Relative orientation of two segments, heading told once from the truth at 5 s.
#[test]
fn the_relative_orientation_of_two_segments_is_that_of_the_reference() {
    let Some(folder) = folder("weygers_kok_2imu") else { return };
    for (file, reference) in
        [("data_1D_03.csv", 1.74), ("data_2D_02.csv", 2.54), ("data_3D_02.csv", 2.28)]
    {
        let period_s = 0.02;
        let mut filters = [0, 6].map(|at| (Orientation::new(period_s, Mode::SixAxes), at));
        let mut heading = None;
        let mut errors = Vec::new();
        for (index, row) in table(&folder.join(file)).iter().enumerate() {
            let [one, two] = [0, 1].map(|n| {
                let (filter, at) = &mut filters[n];
                let fused =
                    filter.take(period_s, Some(vector(row, *at + 3)), Some(vector(row, *at)), None);
                fused.expect("a measurement").orientation
            });
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
        let found = rms(errors.into_iter());
        aloud!("{file}: RMSE {found:.2} degrees, VQF 2.1.2 (C++): {reference}");
        assert!(found <= reference * 1.25, "{file}: {found} against {reference}");
    }
}
