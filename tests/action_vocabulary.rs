//! The shipped actions: complete, inside their ranges, smooth, with both feet on the ground.

use gaitway::action::{Action, Motion, vocabulary};
use gaitway::body::contact::foot_skate_m_s;
use gaitway::body::{Dof, End, Proportions, SegmentPose};

/// The vocabulary of the specification, both sides of what has sides.
const NAMES: &[&str] = &[
    "walk",
    "run",
    "squat",
    "jump",
    "wave-l",
    "wave-r",
    "box-l",
    "box-r",
    "kick-l",
    "kick-r",
    "side-kick-l",
    "side-kick-r",
    "knee-kick-l",
    "knee-kick-r",
    "hop",
    "hop-l",
    "hop-r",
    "jumping-jacks",
    "swing-arms-sagittal",
    "swing-arms-transverse",
    "swing-arms-circular",
    "sit-down",
    "stand-up",
    "throw-l",
    "throw-r",
    "chop-l",
    "chop-r",
    "drink-l",
    "drink-r",
    "bow",
];

fn shipped() -> Vec<(Action, Motion)> {
    let load = |name: &&str| {
        let action = vocabulary::find(name).unwrap_or_else(|e| panic!("{e}"));
        let motion = action.perform().unwrap_or_else(|e| panic!("{e}"));
        (action, motion)
    };
    NAMES.iter().map(load).collect()
}

fn body() -> Proportions {
    Proportions::of_stature(1.75).unwrap()
}

#[test]
fn every_action_is_there_under_its_name_with_note_and_phases() {
    let names: Vec<&str> = vocabulary::names().collect();
    assert_eq!(names, NAMES);
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("actions");
    let files = std::fs::read_dir(folder).unwrap().flatten();
    let files = files.filter(|file| file.path().extension().is_some_and(|e| e == "toml")).count();
    assert_eq!(files, NAMES.len(), "a file in actions/ is not shipped");
    for (action, _) in shipped() {
        assert!(NAMES.contains(&action.name.as_str()));
        assert!(action.note.len() > 10 && !action.phases.is_empty(), "{}", action.name);
        assert!(!action.source.is_empty(), "{} has no source", action.name);
    }
}

#[test]
fn all_angles_stay_inside_the_anatomical_ranges() {
    for (action, motion) in shipped() {
        for angles in motion.sampled(240.0).unwrap() {
            for dof in Dof::ALL {
                let (lower, upper) = dof.range_rad();
                let angle = angles[dof];
                assert!(lower - 1e-9 <= angle && angle <= upper + 1e-9, "{} {dof:?}", action.name);
            }
        }
    }
}

#[test]
fn every_action_starts_and_ends_at_rest_in_every_degree_of_freedom() {
    for (action, motion) in shipped() {
        for dof in Dof::ALL {
            for time_s in [0.0, motion.duration_s()] {
                let state = motion.at(dof, time_s);
                assert!(state.velocity_rad_s.abs() < 1e-9, "{} {dof:?} at {time_s}", action.name);
            }
        }
    }
}

#[test]
fn no_joint_moves_faster_than_people_do() {
    for (action, motion) in shipped() {
        for (dof, piece) in motion.moving() {
            // Elbows in a throw and knees in a kick reach some 20 rad/s in athletes.
            let peak = piece.peaks().velocity_rad_s;
            assert!(peak < 20.0, "{} {} reaches {peak} rad/s", action.name, dof.name());
        }
    }
}

/// Actions in which a leg swings through so low that its sole comes within a centimetre of the ground,
/// or feet come down to a place that is not yet where they stand.
const SWING_LOW: [&str; 4] = ["kick", "hop-", "jumping-jacks", "throw"];

/// Root mean square speed of soles near the ground, m/s, where something stands: at both ends of a
/// flight, toes and heels pass low over the ground at the speed of the leg.
fn standing_skate_m_s(motion: &Motion, poses: &[SegmentPose]) -> f64 {
    let flies = |sample: usize| {
        let time_s = sample as f64 / 120.0;
        let near = |(from_s, to_s): &(f64, f64)| (from_s - 0.01..to_s + 0.01).contains(&time_s);
        motion.flights_s().iter().any(near)
    };
    let standing = (0..poses.len() - 1).filter(|sample| !flies(*sample) && !flies(*sample + 1));
    let squares: Vec<f64> = standing
        .map(|sample| foot_skate_m_s(&body(), &poses[sample..=sample + 1], 120.0, 0.01).powi(2))
        .collect();
    (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
}

#[test]
fn feet_hardly_slide_and_never_sink_into_the_ground() {
    let mut bad = Vec::new();
    for (action, motion) in shipped() {
        let poses = motion.poses(&body(), 120.0).unwrap();
        let mut lowest = f64::MAX;
        for pose in &poses {
            let at = body().positions(pose);
            for end in End::ALL {
                lowest = lowest.min(at.end_m(end).z);
            }
        }
        let skate = standing_skate_m_s(&motion, &poses);
        println!("{:24} skate {skate:.3} m/s, lowest {:.1} mm", action.name, lowest * 1e3);
        let low = SWING_LOW.iter().any(|part| action.name.contains(part));
        let most = if low { 0.35 } else { 0.015 };
        if !(skate < most && lowest > -0.003) {
            bad.push(format!("{} skates at {skate} m/s, sinks {lowest} m", action.name));
        }
    }
    assert!(bad.is_empty(), "{bad:#?}");
}

#[test]
fn left_and_right_are_mirror_images() {
    for name in ["wave", "box", "kick", "side-kick", "knee-kick", "hop", "throw", "chop", "drink"] {
        let of = |side: &str| vocabulary::find(&format!("{name}-{side}")).unwrap();
        let (left, right) = (of("l").perform().unwrap(), of("r").perform().unwrap());
        for i in 0..50 {
            let time_s = left.duration_s() * f64::from(i) / 49.0;
            for dof in Dof::ALL {
                let (other, sign) = dof.mirrored();
                let (a, b) = (left.at(dof, time_s), right.at(other, time_s));
                assert!((a.position_rad - sign * b.position_rad).abs() < 1e-12, "{name} {dof:?}");
            }
        }
    }
}
