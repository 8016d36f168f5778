//! The shipped walk and run along the whole stride, against measured people.

use crate::measured::{Measured, RUNNING, WALKING};
use gaitway::action::vocabulary;
use gaitway::body::Dof;

/// Root mean square over the stride and largest difference, deg, of hip, knee and ankle; a left
/// stride that is steady.
fn off_deg(action: &str, measured: &Measured) -> [(f64, f64); 3] {
    let action = vocabulary::find(action).unwrap();
    let motion = action.perform().unwrap();
    // The left foot touches down half a period after the start.
    let at_deg = |dof, sample: usize| {
        let part = sample as f64 / 20.0;
        motion.at(dof, (1.5 + part) * action.duration_s).position_rad.to_degrees()
    };
    let hip_deg = measured.hip_deg.map(|hip| hip - measured.pelvis_deg);
    [
        (Dof::LeftHipFlexion, hip_deg),
        (Dof::LeftKneeFlexion, measured.knee_deg),
        (Dof::LeftAnkleDorsiflexion, measured.ankle_deg),
    ]
    .map(|(dof, expected_deg)| {
        let off = |sample: usize| at_deg(dof, sample) - expected_deg[sample];
        let rms = ((0..20).map(|sample| off(sample).powi(2)).sum::<f64>() / 20.0).sqrt();
        let most = (0..20).map(|sample| off(sample).abs()).fold(0.0, f64::max);
        println!("{} {}: {rms:.1}, at most {most:.1} deg", action.name, dof.name());
        (rms, most)
    })
}

#[test]
fn walking_angles_are_within_five_degrees_of_measured_people_along_the_stride() {
    let off = off_deg("walk", &WALKING);
    assert!(off.iter().all(|(rms, most)| *rms <= 5.0 && *most <= 11.0), "{off:?}");
}

#[test]
fn running_angles_are_within_six_degrees_of_measured_people_along_the_stride() {
    let off = off_deg("run", &RUNNING);
    assert!(off.iter().all(|(rms, most)| *rms <= 6.0 && *most <= 13.0), "{off:?}");
}

/// The tilt of the pelvis is no free number: it lays the sole flat while the foot stands.
#[test]
fn the_pelvis_of_the_measured_is_tipped_so_that_the_standing_foot_is_flat() {
    for (measured, stands) in [(WALKING, 4..8), (RUNNING, 2..5)] {
        let count = stands.len() as f64;
        let pitch = |sample: usize| {
            let hip = measured.hip_deg[sample] - measured.pelvis_deg;
            hip - measured.knee_deg[sample] + measured.ankle_deg[sample]
        };
        let mean: f64 = stands.map(pitch).sum::<f64>() / count;
        assert!(mean.abs() < 1.0, "{mean} deg");
    }
}
