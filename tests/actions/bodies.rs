//! Other bodies stand on their feet while they do the shipped actions; where they do not, it is said.

use crate::program;
use gaitway::action::corpus::{Corpus, VariationStatus, Variations};
use gaitway::action::{Action, Database, Fits, Join, Spread, phrase, vocabulary};
use gaitway::body::contact::{ON_FLOOR_M, places_m};
use gaitway::body::{BodyFigure, Dof, Proportions, Sex};
use glam::DVec3;

fn usual() -> Proportions {
    Proportions::of_stature(1.75).expect("a body")
}

fn of_stature(stature_m: f64) -> Proportions {
    Proportions::of_stature(stature_m).expect("a body")
}

fn action(name: &str) -> Action {
    vocabulary::find(name).expect("an action")
}

/// How far soles slide and sink, m, in poses at a rate: no more than what those poses show.
fn slides_and_sinks_m(action: &Action, body: &Proportions, rate_hz: f64) -> (f64, f64) {
    let motion = action.perform().expect("a motion");
    of_poses_m(body, &motion.poses(body, rate_hz).expect("poses"))
}

fn of_poses_m(body: &Proportions, poses: &[gaitway::body::SegmentPose]) -> (f64, f64) {
    let (mut slides_m, mut sinks_m) = (0f64, 0f64);
    for sole in 0..4 {
        let places: Vec<DVec3> = poses.iter().map(|pose| places_m(body, pose)[sole]).collect();
        for contact in places.split(|place| place.z >= ON_FLOOR_M) {
            let Some(first) = contact.first() else { continue };
            let (least, most) = contact
                .iter()
                .fold((*first, *first), |(least, most), at| (least.min(*at), most.max(*at)));
            slides_m = slides_m.max((most - least).truncate().length());
            sinks_m = sinks_m.max(-least.z);
        }
    }
    (slides_m, sinks_m)
}

#[test]
fn feet_of_other_bodies_hold_as_they_do_on_the_body_that_actions_are_made_for() {
    let drawing = Proportions::of_figure(BodyFigure::DrillisContini, 1.75).expect("a body");
    for (name, body) in [
        ("walk", usual().of_sex(Some(Sex::Female))),
        ("run", usual().of_sex(Some(Sex::Male))),
        ("walk", drawing),
        ("walk", of_stature(1.2)),
        ("throw-r", of_stature(0.9)),
        ("jump", of_stature(0.9)),
        ("jump", of_stature(2.1)),
        ("run", usual().with_leg_length_m(0.7 * 0.971).expect("a body")),
    ] {
        let fitted = Fits::of(body).fit(&action(name)).expect("fitted");
        assert_ne!(fitted, action(name), "{name}");
        for rate_hz in [240.0, 250.0] {
            let (slides_m, sinks_m) = slides_and_sinks_m(&fitted, &body, rate_hz);
            assert!(slides_m < 0.005 && sinks_m < 0.001, "{name}: {slides_m} m, {sinks_m} m");
        }
        let motion = fitted.perform().expect("a motion");
        for (dof, piece) in motion.moving() {
            let (lower, upper) = dof.range_rad();
            let inside = lower - 1e-9..=upper + 1e-9;
            assert!(inside.contains(&piece.to_rad()), "{name} {}", dof.name());
            let is_of_leg = dof.index() >= Dof::LeftHipFlexion.index();
            let own = action(name).perform().expect("a motion");
            let same = own.track(dof).actionlets().iter().any(|one| one.to_rad() == piece.to_rad());
            assert!(is_of_leg || same, "{name}: {} was moved", dof.name());
        }
    }
}

#[test]
fn the_body_that_actions_are_made_for_does_them_as_they_are_and_so_does_a_heavier_one() {
    let heavier = usual().with_mass_kg(110.0).expect("a body");
    for body in [usual(), heavier] {
        let mut fits = Fits::of(body);
        for name in vocabulary::names() {
            assert_eq!(fits.fit(&action(name)).expect("fitted"), action(name));
        }
    }
    // What holds already stays as it is.
    let wave = action("wave-r");
    assert_eq!(Fits::of(of_stature(0.9)).fit(&wave).expect("fitted"), wave);
}

#[test]
fn what_a_tall_body_does_in_the_air_takes_its_time() {
    let jump = action("jump");
    let fitted = Fits::of(of_stature(2.1)).fit(&jump).expect("fitted");
    // Of two that fall from heights as unlike as the bodies, the time goes with the root.
    let expected = (2.1f64 / 1.75).sqrt();
    assert!((fitted.duration_s / jump.duration_s - expected).abs() < 1e-9);
}

fn corpus(name: &str, spread: Spread) -> Variations {
    let made = Variations::of(Corpus {
        label: name.to_owned(),
        parts: phrase::load(name).expect("an action"),
        join: Join::Transition,
        spread,
        database: Database::shipped().expect("actions"),
        seed: 3,
        rate_hz: 60.0,
        body: usual(),
        has_points: false,
    });
    made.expect("it can be performed")
}

#[test]
fn what_is_called_valid_does_not_slide_however_often_it_is_looked_at() {
    for name in ["walk", "run", "jump"] {
        let made = corpus(name, Spread::default());
        for number in 0..12 {
            let varied = made.variation(number).expect("a variation");
            assert_ne!(varied.status, VariationStatus::Implausible, "{name} {number}");
            for rate_hz in [120.0, 240.0, 333.0, 1000.0] {
                let poses = varied.motion.poses(&varied.body, rate_hz).expect("poses");
                let (slides_m, sinks_m) = of_poses_m(&varied.body, &poses);
                let told = format!("{name} {number} at {rate_hz} Hz: {slides_m} m, {sinks_m} m");
                assert!(slides_m < 0.005 && sinks_m < 0.001, "{told}");
            }
        }
    }
}

#[test]
fn a_draw_whose_seams_pass_one_another_is_thrown_away() {
    let made = corpus("walk:x2", Spread { time: 0.45, ..Spread::default() });
    for number in 0..6 {
        made.variation(number).expect("a variation");
    }
}

#[test]
fn bodies_that_vary_by_a_fifth_are_stood_on() {
    let made = corpus("throw-r", Spread { stature: 0.2, ..Spread::default() });
    for number in 0..12 {
        let varied = made.variation(number).expect("a variation");
        assert_ne!(varied.status, VariationStatus::Implausible, "{number}");
    }
}

fn ended(arguments: &[&str], code: i32, outcome: &str) -> (serde_json::Value, String) {
    let output = program::gaitway().args(arguments).arg("--json").output().expect("a run");
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(code), "{arguments:?}: {said}");
    let report = program::json(&output);
    assert_eq!(report["outcome"], outcome);
    (report, said)
}

/// Legs of 50 cm under the trunk of a stature of 1.75 m do not walk so.
#[test]
fn feet_that_do_not_hold_are_said_and_end_with_loss() {
    let folder = program::folder("missed");
    let out = folder.join("walk.csv");
    let out = out.to_str().expect("a path");
    let (report, said) =
        ended(&["synth", "walk", "--set", "leg_m=0.5", "-o", out], 3, "done_with_loss");
    let missed = &report["footing"]["missed"][0];
    let what = missed["what"].as_str();
    assert_eq!((what, missed["most"].as_f64()), (Some("root_acceleration_m_s2"), Some(18.0)));
    assert!(missed["got"].as_f64() > Some(18.0), "{missed}");
    assert!(said.contains("the root is accelerated by"), "{said}");
    let out = folder.join("female.csv");
    let out = out.to_str().expect("a path");
    let (report, said) = ended(&["synth", "walk", "--set", "sex=female", "-o", out], 0, "done");
    assert_eq!(report["footing"]["missed"], serde_json::json!([]));
    assert!(!said.contains("do not hold"), "{said}");
    // At four times its pace nobody's feet hold: said, but it is what was asked for.
    let out = folder.join("fast.csv");
    let out = out.to_str().expect("a path");
    let (_, said) = ended(&["synth", "walk@4", "-o", out], 0, "done");
    assert!(said.contains("feet do not hold"), "{said}");
}

#[test]
fn a_corpus_with_rows_that_nobody_could_do_ends_with_loss() {
    let out = program::folder("corpus").join("walk.parquet");
    let out = out.to_str().expect("a path");
    let (report, said) =
        ended(&["synth", "walk:x2@4", "--variations", "2", "-o", out], 3, "done_with_loss");
    assert_eq!(report["classes"][0]["implausible"], 2);
    assert!(said.contains("2 of 2"), "{said}");
}
