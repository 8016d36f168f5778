//! One gait goes over into another without a stop: `walk:6s+run:5s`.

use gaitway::action::phrase::{self, Follows, Performed};
use gaitway::action::{Action, Join, Motion, change, file, vocabulary};
use gaitway::actionlet::Actionlet;
use gaitway::body::contact::Footing;
use gaitway::body::{Dof, Proportions};
use proptest::prelude::*;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// What is performed; each phrase is made once for all tests, which look at it from several sides.
fn performed(text: &str) -> Performed {
    static MADE: Mutex<BTreeMap<String, Arc<OnceLock<Performed>>>> = Mutex::new(BTreeMap::new());
    let made = {
        let mut made = MADE.lock().unwrap_or_else(PoisonError::into_inner);
        Arc::clone(made.entry(text.to_owned()).or_default())
    };
    made.get_or_init(|| phrase::performed(&phrase::load(text).unwrap(), Join::Transition).unwrap())
        .clone()
}

fn body() -> Proportions {
    Proportions::of_stature(1.75).unwrap()
}

fn refused(text: &str, words: &[&str]) {
    let parts = phrase::load(text).unwrap_or_else(|e| panic!("{text}: {e}"));
    let error = phrase::perform(&parts, Join::Transition).expect_err(text).to_string();
    for word in words {
        assert!(error.contains(word), "{text}: {word:?} is not in:\n{error}");
    }
}

/// Greatest speed of any degree of freedom at a time, rad/s.
fn fastest_rad_s(motion: &Motion, time_s: f64) -> f64 {
    let speeds = Dof::ALL.map(|dof| motion.at(dof, time_s).velocity_rad_s.abs());
    speeds.into_iter().fold(0.0, f64::max)
}

fn is_smooth(motion: &Motion) {
    for dof in Dof::ALL {
        let pieces = motion.track(dof).actionlets();
        for pair in pieces.windows(2) {
            assert_eq!(pair[0].to_rad(), pair[1].from_rad(), "{}", dof.name());
            assert!((pair[0].end_s() - pair[1].begin_s()).abs() < 1e-12);
        }
        for piece in pieces {
            assert_eq!(piece.at(piece.begin_s()).velocity_rad_s, 0.0, "{}", dof.name());
            assert_eq!(piece.at(piece.end_s()).velocity_rad_s, 0.0, "{}", dof.name());
            let (lower, upper) = dof.range_rad();
            let inside = lower - 1e-9..=upper + 1e-9;
            assert!(inside.contains(&piece.to_rad()), "{}: {}", dof.name(), piece.to_rad());
        }
        let end_s = pieces.last().map_or(0.0, Actionlet::end_s);
        assert!((end_s - motion.duration_s()).abs() < 1e-9);
    }
}

/// Shipped gaits that travel, one after the other.
const GAITS: [&str; 5] = [
    "walk:6s+run:5s",
    "run:4s+walk:4s",
    "walk:x3+run:x5+walk:x3",
    "walk:x3@1.3+run:x4@0.8",
    "walk:x1+run:x1",
];

#[test]
fn gaits_that_go_over_are_smooth_and_inside_their_ranges() {
    for text in GAITS {
        is_smooth(&performed(text).motion);
    }
}

#[test]
fn at_no_time_around_a_change_does_everything_rest() {
    for text in GAITS {
        let Performed { motion, changes } = performed(text);
        assert_eq!(changes.len(), text.matches('+').count());
        for change in &changes {
            let crossings = change.crossings.iter();
            let from_s = crossings.clone().map(|of| of.left_s).fold(change.time_s, f64::min);
            let to_s = crossings.map(|of| of.joined_s).fold(change.time_s, f64::max);
            let (from_s, to_s) = (from_s.max(0.1), to_s.min(motion.duration_s() - 0.1));
            for step in 0..=2000 {
                let time_s = from_s + (to_s - from_s) * f64::from(step) / 2000.0;
                let fastest = fastest_rad_s(&motion, time_s);
                assert!(fastest > 0.1, "{text}: {fastest} rad/s at {time_s} s");
            }
        }
    }
    // With a comma everything does.
    let stops = performed("walk:6s,run:5s");
    assert!(stops.changes.is_empty());
    assert!(fastest_rad_s(&stops.motion, 6.0) < 1e-9);
}

/// Before the first degree of freedom leaves and after the last has joined, it is what each does alone.
#[test]
fn before_and_after_a_change_each_gait_is_what_it_is_alone() {
    let Performed { motion, changes } = performed("walk:6s+run:5s");
    let [change] = changes.as_slice() else { panic!("{changes:?}") };
    assert_eq!((change.from.as_str(), change.to.as_str(), change.phase), ("walk", "run", 0.5));
    assert!((change.time_s - 6.0).abs() < 1e-9);
    // As many whole rounds as come nearest to 5 s.
    let period_s = vocabulary::find("run").unwrap().duration_s;
    let rounds = (5.0 / period_s).round();
    assert!((motion.duration_s() - 6.0 - rounds * period_s).abs() < 1e-9);
    let (walk, run) = (performed("walk:x7").motion, performed(&format!("run:x{rounds}")).motion);
    for crossing in &change.crossings {
        let dof = crossing.dof;
        assert!(crossing.left_s < crossing.joined_s, "{crossing:?}");
        for step in 0..1090 {
            let time_s = f64::from(step) / 100.0;
            let now = motion.at(dof, time_s);
            // A run by itself is joined within two rounds.
            let alone = match time_s {
                _ if time_s <= crossing.left_s => walk.at(dof, time_s),
                _ if time_s >= crossing.joined_s.max(6.0 + 2.0 * period_s) => {
                    run.at(dof, time_s - 6.0)
                }
                _ => continue,
            };
            let off_rad = (now.position_rad - alone.position_rad).abs();
            assert!(off_rad < 1e-9, "{} at {time_s} s: {off_rad}", dof.name());
        }
        // At both seams it rests, at an angle at which each of the gaits comes to rest.
        for (time_s, angle_rad) in
            [(crossing.left_s, crossing.left_rad), (crossing.joined_s, crossing.joined_rad)]
        {
            let state = motion.at(dof, time_s);
            assert!(state.velocity_rad_s.abs() < 1e-6, "{}: {state:?}", dof.name());
            assert!((state.position_rad - angle_rad).abs() < 1e-9);
        }
        assert!((walk.at(dof, crossing.left_s).velocity_rad_s).abs() < 1e-6);
    }
    let named = |dof: Dof| change.crossings.iter().any(|crossing| crossing.dof == dof);
    assert!(
        named(Dof::LeftHipFlexion) && named(Dof::TorsoFlexion),
        "both, and what only one moves"
    );
    assert!(!named(Dof::LeftShoulderAbduction), "what neither moves");
}

/// Nothing is faster in a change than in the gaits themselves or an unhurried transition.
#[test]
fn a_change_asks_no_more_than_the_gaits_do() {
    for (text, alone) in
        [("walk:6s+run:5s", "walk:x4,run:x6"), ("run:4s+walk:4s", "walk:x4,run:x6")]
    {
        let Performed { motion, changes } = performed(text);
        let alone = performed(alone).motion;
        let greatest = |dof: Dof, pick: fn(&Actionlet) -> f64| {
            let cycle = alone.track(dof).actionlets().iter();
            // Ways in and out are not the cycle.
            let cycle = cycle.filter(|piece| {
                (1.2..3.6).contains(&piece.begin_s()) || (6.0..8.0).contains(&piece.begin_s())
            });
            cycle.map(pick).fold(0.0, f64::max)
        };
        for crossing in &changes[0].crossings {
            let pieces = motion.track(crossing.dof).actionlets();
            let over = pieces.iter().find(|piece| (piece.begin_s() - crossing.left_s).abs() < 1e-9);
            let over = over.expect("the transition").peaks();
            let speed = greatest(crossing.dof, |piece| piece.peaks().velocity_rad_s).max(3.0);
            let sharp = greatest(crossing.dof, |piece| piece.peaks().acceleration_rad_s2).max(15.0);
            assert!(over.velocity_rad_s <= speed * 1.001, "{crossing:?}: {over:?}, {speed}");
            assert!(over.acceleration_rad_s2 <= sharp * 1.001, "{crossing:?}: {over:?}, {sharp}");
        }
    }
}

/// The body keeps travelling, on feet that stand.
#[test]
fn the_body_goes_on_forward_through_a_change() {
    let body = body();
    let run_s = 5.0 * vocabulary::find("run").unwrap().duration_s;
    for (text, change_s) in [("walk:6s+run:5s", 6.0), ("run:x5+walk:4s", run_s)] {
        let motion = performed(text).motion;
        let poses = motion.poses(&body, 120.0).unwrap();
        let speed = |time_s: f64, for_s: f64| {
            let at = |time_s: f64| poses[(time_s * 120.0).round() as usize].root_m.x;
            (at(time_s + for_s) - at(time_s)) / for_s
        };
        // Mean speed over each fifth of a second: that of the walk is 1.2 m/s, of the run 2.3 m/s.
        for step in -10..=8 {
            let time_s = change_s + f64::from(step) / 10.0;
            let speed_m_s = speed(time_s, 0.2);
            assert!(speed_m_s > 0.6, "{text}: {speed_m_s} m/s at {time_s} s");
            assert!(speed_m_s < 3.5, "{text}: {speed_m_s} m/s at {time_s} s");
        }
    }
}

/// Soles stand still, above the floor, and the root is not thrown, in the change as in the gaits.
#[test]
fn feet_hold_in_a_change_of_gait_or_it_is_refused() {
    let body = body();
    for text in [
        "walk:x3+run:x4",
        "run:x3+walk:x4",
        "walk:x3+hop-l:x4",
        "hop-l:x3+walk:x4",
        "walk:x3+jumping-jacks:x4",
    ] {
        let poses = performed(text).motion.poses(&body, 240.0).unwrap();
        let footing = Footing::of(&body, &poses, 240.0).unwrap();
        let (slide_m, root_m_s2) = (footing.slide_m(), footing.root_acceleration_m_s2());
        println!("{text}: slides {:.1} mm, root {root_m_s2:.1} m/s2", slide_m * 1e3);
        // Jumping jacks slide by 4.7 mm themselves.
        let most_m = if text.contains("jacks") { 0.006 } else { 0.005 };
        assert!(slide_m < most_m, "{text}: {slide_m}");
        assert!(root_m_s2 < 40.0, "{text}: {root_m_s2}");
        assert!(footing.lowest_m() > -0.001, "{text}: {}", footing.lowest_m());
    }
    for (text, names) in [("run:x3+hop-r:x4", "run+hop-r"), ("hop-l:x3+hop-r:x4", "hop-l+hop-r")] {
        refused(text, &["feet do not hold", names, "comma"]);
    }
}

/// Arms that go on while legs come out of rest, or go back to it: as the gait does by itself.
#[test]
fn legs_that_only_one_of_two_gaits_moves_begin_and_end_as_it_does_alone() {
    let arms = "swing-arms-circular:x2";
    let arms_s = performed(arms).motion.duration_s();
    let walk = performed("walk:x3").motion;
    let legs = || Dof::ALL.into_iter().filter(|dof| dof.is_of_leg());
    let (first, last) =
        (performed(&format!("walk:x3+{arms}")), performed(&format!("{arms}+walk:x3")));
    for step in 0..=360 {
        let time_s = f64::from(step) * walk.duration_s() / 360.0;
        for dof in legs() {
            let alone_rad = walk.at(dof, time_s).position_rad;
            let first_rad = first.motion.at(dof, time_s).position_rad;
            let last_rad = last.motion.at(dof, arms_s + time_s).position_rad;
            assert!((first_rad - alone_rad).abs() < 1e-9, "{} at {time_s} s", dof.name());
            assert!((last_rad - alone_rad).abs() < 1e-9, "{} at {time_s} s", dof.name());
        }
    }
    for Performed { motion, changes } in [first, last] {
        is_smooth(&motion);
        let [change] = changes.as_slice() else { panic!("{changes:?}") };
        let crosses = |dof| change.crossings.iter().any(|crossing| crossing.dof == dof);
        assert!(crosses(Dof::LeftKneeFlexion) && crosses(Dof::LeftShoulderFlexion), "{change:?}");
    }
}

#[test]
fn flights_are_those_of_the_gait_that_flies() {
    let motion = performed("walk:6s+run:x7").motion;
    let alone = performed("run:x7").motion;
    assert!(motion.flights_s().iter().all(|(from_s, _)| *from_s >= 6.0));
    // Run by itself begins with a step on the ground; here it is in its cycle from the first.
    assert!(motion.flights_s().len() >= alone.flights_s().len());
    for (from_s, to_s) in alone.flights_s() {
        let is_it = |flight: &&(f64, f64)| {
            (flight.0 - from_s - 6.0).abs() < 1e-9 && (flight.1 - to_s - 6.0).abs() < 1e-9
        };
        assert!(motion.flights_s().iter().any(|flight| is_it(&flight)), "{from_s}");
    }
}

#[test]
fn the_last_gait_goes_on_to_the_phase_at_which_it_ends() {
    // A hop ends in phase 0.45, as it begins; jumping jacks in 0.05. From 0.05 it is 0.4 more.
    let hop = vocabulary::find("hop").unwrap();
    let jacks = vocabulary::find("jumping-jacks").unwrap();
    let (motion, changes) =
        change::without_a_stop(&[(jacks.clone(), 3), (hop.clone(), 4)], &body()).unwrap();
    assert!((motion.duration_s() - 3.0 * 1.2 - 4.4 * 0.6).abs() < 1e-9);
    assert!((changes[0].phase - 0.05).abs() < 1e-12);
    for dof in Dof::ALL {
        let end = motion.at(dof, motion.duration_s());
        assert!((end.position_rad - hop.pose[dof]).abs() < 1e-9, "{}", dof.name());
    }
}

#[test]
fn phrases_mix_changes_and_stops() {
    let Performed { motion, changes } = performed("bow,walk:x3+run:x4,wave-r");
    is_smooth(&motion);
    let [change] = changes.as_slice() else { panic!("{changes:?}") };
    assert!((change.time_s - 2.8 - 3.6).abs() < 1e-6, "{}", change.time_s);
    let seam_s = change.crossings[0].left_s;
    assert!(motion.at(change.crossings[0].dof, seam_s).velocity_rad_s.abs() < 1e-6);
    assert!(fastest_rad_s(&motion, 2.8) < 1e-9, "a comma is a stop");
    let run_s = 4.0 * vocabulary::find("run").unwrap().duration_s;
    assert!((motion.duration_s() - 2.8 - 3.6 - run_s - 5.0).abs() < 1e-6);
}

const STEADY: &str = r#"schema = 1
name = "NAME"
cyclic = true
duration_s = 0.4
rounds = 4

[pose]
left_elbow_flexion = LOW

[[group]]
name = "left arm"
kind = "limb"
turns.left_shoulder_flexion = [[0.25, -10], [0.75, 10]]
turns.left_elbow_flexion = [[0.0, LOW], [0.5, HIGH]]
"#;

fn steady(name: &str, low: u32) -> Action {
    let text = STEADY.replace("NAME", name).replace("LOW", &low.to_string());
    let text = text.replace("HIGH", &(low + 10).to_string());
    file::parse(&text, name, &vocabulary::lender).unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn what_cannot_go_over_is_refused_in_words() {
    refused("bow+walk:6s", &["done once", "bow", "comma"]);
    refused("walk:6s+bow", &["walk+bow", "done once", "comma"]);
    refused(
        "walk:6s+hop",
        &["no foot is on the ground", "phase 0.5", "hop flies from 0.408 to 0.806"],
    );
    refused(
        "swing-arms-sagittal+swing-arms-sagittal",
        &["come to rest before the other begins", "every degree of freedom rests at"],
    );
    refused("walk:x200000+run:5s", &["out of range", "100000"]);
    // From one end of the elbow's range to the other within a period of 0.4 s.
    let go = |low| {
        let gaits = [(steady("straight", 5), 4), (steady("bent", low), 4)];
        change::without_a_stop(&gaits, &body())
    };
    let error = go(130).unwrap_err().to_string();
    for word in ["faster than a person", "straight+bent, left_elbow_flexion", "172 deg/s", "comma"]
    {
        assert!(error.contains(word), "{word:?} is not in:\n{error}");
    }
    assert!(go(20).is_ok());
}

#[test]
fn a_plus_sign_means_a_change_and_may_be_part_of_a_path() {
    let follows = |text: &str| -> Vec<(String, Follows)> {
        phrase::parse(text).unwrap().into_iter().map(|item| (item.name, item.follows)).collect()
    };
    let own = |name: &str, follows| (name.to_owned(), follows);
    assert_eq!(
        follows("walk:6s+run:5s@0.9, bow"),
        [own("walk", Follows::AtRest), own("run", Follows::InMotion), own("bow", Follows::AtRest)]
    );
    for wrong in ["walk+", "+walk", "walk++run", "walk+,run", "+"] {
        assert!(phrase::parse(wrong).is_err(), "{wrong}");
    }
    assert!(phrase::is_phrase("walk+run") && phrase::is_phrase("x+run"));
    let folder = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join("changes");
    std::fs::create_dir_all(&folder).unwrap();
    let path = folder.join("left+right.toml");
    std::fs::write(&path, vocabulary::text("bow").unwrap()).unwrap();
    let path = path.to_str().unwrap();
    for text in [path.to_owned(), format!("{path}:3s"), format!("walk,{path}@0.5")] {
        let names = follows(&text);
        let (name, follows) = names.last().unwrap();
        assert_eq!((name.as_str(), *follows), (path, Follows::AtRest), "{text}");
    }
    let capture = folder.join("walk+run.bvh");
    std::fs::write(&capture, "").unwrap();
    assert!(!phrase::is_phrase(capture.to_str().unwrap()));
}

fn any_gait() -> impl Strategy<Value = String> {
    let cyclic =
        vocabulary::names().filter(|name| vocabulary::find(name).unwrap().cyclic.is_some());
    let pace = prop_oneof![Just(String::new()), (0.5..2.0).prop_map(|pace| format!("@{pace:.2}"))];
    (prop::sample::select(cyclic.collect::<Vec<_>>()), 1u32..6, pace)
        .prop_map(|(name, rounds, pace)| format!("{name}:x{rounds}{pace}"))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(8))]

    /// Whatever goes over into whatever: smooth and moving, or a reason.
    #[test]
    fn any_gait_goes_over_into_any_other_or_is_refused(
        gaits in prop::collection::vec(any_gait(), 2..4),
    ) {
        let text = gaits.join("+");
        match phrase::performed(&phrase::load(&text).unwrap(), Join::Transition) {
            Err(error) => prop_assert!(error.to_string().contains("comma"), "{error}"),
            Ok(Performed { motion, changes }) => {
                is_smooth(&motion);
                prop_assert_eq!(changes.len(), gaits.len() - 1);
                for change in &changes {
                    for crossing in &change.crossings {
                        prop_assert!(crossing.left_s < crossing.joined_s, "{text}: {crossing:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn any_phrase_is_read_or_refused(text in "[a-z:@,+.0-9x-]{0,30}") {
        let _ = phrase::parse(&text);
        let _ = phrase::is_phrase(&text);
    }
}
