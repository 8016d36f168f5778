//! The shipped actions: complete, inside their ranges, smooth, with both feet on the ground.

use gaitway::action::{Action, Motion, vocabulary};
use gaitway::body::contact::Footing;
use gaitway::body::{Dof, Proportions};

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

/// Actions that go somewhere, or end elsewhere than they began.
const GO_SOMEWHERE: [&str; 4] = ["walk", "run", "sit-down", "stand-up"];
/// Actions that land on their feet in place: the root is caught as hard as that.
const LAND: [&str; 5] = ["jump", "hop", "hop-l", "hop-r", "jumping-jacks"];

/// Each could be done by a person who stands on a floor, which never pulls. Running people push with up to 3
/// body weights (Nilsson and Thorstensson, "Ground reaction forces at different speeds of human walking and
/// running", Acta Physiologica Scandinavica 136, 1989).
#[test]
fn feet_stand_where_they_stand_nothing_sinks_and_the_floor_never_pulls() {
    let mut bad = Vec::new();
    for (action, motion) in shipped() {
        let poses = motion.poses(&body(), 250.0).unwrap();
        let footing = Footing::of(&body(), &poses, 250.0).unwrap();
        let name = action.name.as_str();
        let (lowest_m, slide_m) = (footing.lowest_m(), footing.slide_m());
        let root = footing.root_acceleration_m_s2();
        let (_, travel_m) = footing.travel_m();
        let [least, most] = [0.01, 0.99].map(|share| footing.force_quantile(share));
        println!(
            "{name:24} lowest {:.2} mm, slide {:.1} mm, root {root:.1} m/s2, travel {travel_m:.3} m, \
             force {least:.2} to {most:.2}",
            lowest_m * 1e3,
            slide_m * 1e3
        );
        let mut hold = |what: &str, holds: bool| {
            if !holds {
                bad.push(format!("{name}: {what}"));
            }
        };
        hold("sinks", lowest_m > -0.001);
        hold("slides", slide_m < 0.005);
        let most_m_s2 = match name {
            _ if LAND.contains(&name) => 40.0,
            _ => 18.0,
        };
        hold("jerks the root", root < most_m_s2);
        hold("travels", GO_SOMEWHERE.contains(&name) || travel_m < 0.02);
        hold("pulls at the floor", least > -0.05);
        hold("does not press as people do", name != "run" || most < 3.0);
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
