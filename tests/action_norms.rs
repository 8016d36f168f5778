//! The shipped walk and run along the whole stride, against measured people.

#[path = "gait/measured.rs"]
mod measured;

use gaitway::action::vocabulary;
use gaitway::body::Dof;
use measured::{Measured, RUNNING, WALKING};

/// Root mean square over the stride, deg, of hip, knee and ankle; a left stride that is steady.
fn off_deg(action: &str, measured: &Measured) -> [f64; 3] {
    let action = vocabulary::find(action).unwrap();
    let motion = action.perform().unwrap();
    // The left foot touches down half a period after the start.
    let at_deg = |dof, sample: usize| {
        let part = sample as f64 / 20.0;
        motion.at(dof, (1.5 + part) * action.duration_s).position_rad.to_degrees()
    };
    let rms = |dof, expected: [f64; 20]| {
        let square = |(sample, angle): (usize, f64)| (at_deg(dof, sample) - angle).powi(2);
        let sum: f64 = expected.into_iter().enumerate().map(square).sum();
        (sum / 20.0).sqrt()
    };
    let off = [
        rms(Dof::LeftHipFlexion, measured.hip_deg.map(|hip| hip - measured.pelvis_deg)),
        rms(Dof::LeftKneeFlexion, measured.knee_deg),
        rms(Dof::LeftAnkleDorsiflexion, measured.ankle_deg),
    ];
    println!("{}: hip {:.1}, knee {:.1}, ankle {:.1} deg", action.name, off[0], off[1], off[2]);
    off
}

#[test]
fn walking_angles_are_within_five_degrees_of_measured_people_along_the_stride() {
    let off = off_deg("walk", &WALKING);
    assert!(off.iter().all(|rms| *rms <= 5.0), "{off:?}");
}

#[test]
fn running_angles_are_within_eight_degrees_of_measured_people_along_the_stride() {
    let off = off_deg("run", &RUNNING);
    assert!(off.iter().all(|rms| *rms <= 8.0), "{off:?}");
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
