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
mod captured;
mod orientation;

use aloud::aloud;
use captured::captured;
use gaitway::capture::{Mode, Orientation};
use orientation::{
    BROAD_PERIOD_S, JOINT_PERIOD_S, broad_rmse_deg, floats, joint_rmse_deg, quaternion, table,
    vector,
};
use std::path::PathBuf;

fn folder(name: &str) -> Option<PathBuf> {
    captured(&format!("imu/{name}"))
}

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
            // Not by the greatest alone, which takes no notice of not-a-number.
            assert!(off.length() < 1e-9, "{mode:?}, row {index}: off by {}", off.length());
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
}

/// Our filter on a BROAD trial.
fn broad(file: &str, mode: Mode) -> Option<[f64; 3]> {
    let rows = floats(&folder("broad")?.join(file), 14);
    let mut filter = Orientation::new(BROAD_PERIOD_S, mode);
    Some(broad_rmse_deg(&rows, mode == Mode::NineAxes, |rate, force, field| {
        let fused = filter.take(BROAD_PERIOD_S, Some(rate), Some(force), field);
        fused.expect("a measurement").orientation
    }))
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
        [("data_1D_03.csv", 1.52), ("data_2D_02.csv", 2.54), ("data_3D_02.csv", 2.12)]
    {
        let rows = table(&folder.join(file));
        let mut filters = [0, 1].map(|_| Orientation::new(JOINT_PERIOD_S, Mode::SixAxes));
        let found = joint_rmse_deg(&rows, |sensor, rate, force| {
            let fused = filters[sensor].take(JOINT_PERIOD_S, Some(rate), Some(force), None);
            fused.expect("a measurement").orientation
        });
        aloud!("{file}: RMSE {found:.2} degrees, VQF 2.1.2 (C++): {reference}");
        assert!(found <= reference + 0.05, "{file}: {found} against {reference}");
    }
}
