//! Captures taken apart into actionlets: how near, and at what price.

use crate::common::{bvh_files, captures};
use gaitway::action::decompose::{REFERENCE_HZ, motion_of};
use gaitway::action::{Action, file};
use gaitway::body::{Dof, JointAngles};
use gaitway::mocap::read_bvh;
use std::io::Write;

/// Degrees of freedom that move less do not count.
const MOVING_DEG: f64 = 5.0;

/// Root mean square, deg, and numbers stored per sample, of every degree of freedom that moves.
/// Every so many files are looked at. What is judged is what the written file says, after rounding.
fn judged(tolerance_deg: f64, every: usize) -> Option<(usize, Vec<(f64, f64)>)> {
    let folder = captures()?;
    let mut all = Vec::new();
    let mut files = 0;
    for path in bvh_files(&folder).into_iter().step_by(every) {
        let Ok(capture) = read_bvh(&path, None) else { continue };
        files += 1;
        let angles = JointAngles::of_clip(&capture.poses, capture.rate_hz).angles;
        let found = motion_of(&angles, capture.rate_hz, tolerance_deg.to_radians()).unwrap();
        if found.motion.moving().next().is_none() {
            continue;
        }
        let written = Action::of_motion("capture", "", "", &found.motion).to_toml().unwrap();
        let read = file::parse(&written, "capture.toml", &|_| None).unwrap().perform().unwrap();
        let samples = angles.len() as f64;
        for figure in found.figures.iter().filter(|f| f.range_rad.to_degrees() > MOVING_DEG) {
            let squares = angles.iter().enumerate().map(|(index, pose)| {
                let time_s = index as f64 / capture.rate_hz;
                (read.at(figure.dof, time_s).position_rad - pose[figure.dof]).powi(2)
            });
            let rms_deg = (squares.sum::<f64>() / samples).sqrt().to_degrees();
            let at_reference = (samples - 1.0) / capture.rate_hz * REFERENCE_HZ;
            all.push((rms_deg, at_reference / figure.numbers as f64));
        }
    }
    Some((files, all))
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

#[test]
fn captures_come_back_within_a_degree_at_a_tenth_of_the_numbers() {
    let Some((files, all)) = judged(1.0, 1) else { return };
    let rms_deg = median(all.iter().map(|(rms, _)| *rms).collect());
    let compression = median(all.iter().map(|(_, ratio)| *ratio).collect());
    let pooled = all.len() as f64 / all.iter().map(|(_, ratio)| 1.0 / ratio).sum::<f64>();
    let _ = writeln!(
        std::io::stderr(),
        "{files} captures, {} degrees of freedom: median rms {rms_deg:.3} deg, median compression \
         {compression:.1}, pooled {pooled:.1}",
        all.len()
    );
    assert!(files >= 1 && !all.is_empty());
    assert!(rms_deg <= 1.0, "{rms_deg}");
    assert!(compression >= 10.0 && pooled >= 10.0, "{compression}, {pooled}");
}

#[test]
fn a_finer_tolerance_costs_more_numbers_and_a_coarser_one_fewer() {
    let mut before = 0.0;
    for tolerance_deg in [0.5, 2.0] {
        let Some((_, all)) = judged(tolerance_deg, 4) else { return };
        let rms_deg = median(all.iter().map(|(rms, _)| *rms).collect());
        let compression = median(all.iter().map(|(_, ratio)| *ratio).collect());
        let _ = writeln!(
            std::io::stderr(),
            "tolerance {tolerance_deg} deg: median rms {rms_deg:.3} deg, compression {compression:.1}"
        );
        assert!(rms_deg <= tolerance_deg && compression > before);
        before = compression;
    }
}

/// What was made of actionlets comes back as the same actionlets, through angles of poses.
#[test]
fn shipped_actions_return_their_own_actionlets() {
    for name in ["squat", "bow", "wave-r", "kick-r", "walk"] {
        let motion = gaitway::action::vocabulary::find(name).unwrap().perform().unwrap();
        let angles = motion.sampled(240.0).unwrap();
        let found = motion_of(&angles, 240.0, 0.5f64.to_radians()).unwrap();
        let (mut same, mut given) = (0, 0);
        for dof in Dof::ALL {
            let moving = |motion: &gaitway::action::Motion| -> Vec<(f64, f64)> {
                let pieces = motion.track(dof).actionlets().iter();
                pieces.filter(|p| !p.is_rest()).map(|p| (p.end_s(), p.to_rad())).collect()
            };
            let (got, expected) = (moving(&found.motion), moving(&motion));
            given += expected.len();
            let near = |a: &(f64, f64), b: &(f64, f64)| {
                (a.0 - b.0).abs() < 0.005 && (a.1 - b.1).abs() < 1e-3
            };
            same += expected.iter().filter(|b| got.iter().any(|a| near(a, b))).count();
        }
        let _ = writeln!(std::io::stderr(), "{name}: {same} of {given} actionlets came back");
        assert!(same as f64 >= 0.9 * given as f64, "{name}: {same} of {given}");
    }
}
