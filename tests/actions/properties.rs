//! What holds for every action, whatever its numbers: continuity, Eq. 7, mutation, joining.

use gaitway::action::database::{Type, Types};
use gaitway::action::{Action, Database, Join, Motion, Spread, mutate, phrase, vocabulary};
use gaitway::actionlet::{Actionlet, Shape};
use gaitway::body::Dof;
use proptest::prelude::*;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::sync::LazyLock;

static SHIPPED: LazyLock<Database> = LazyLock::new(|| Database::shipped().unwrap());

fn any_action() -> impl Strategy<Value = Action> {
    let names: Vec<&str> = vocabulary::names().collect();
    prop::sample::select(names).prop_map(|name| vocabulary::find(name).unwrap())
}

/// One to four actions in a row, some longer, shorter, faster or slower than shipped.
fn any_phrase() -> impl Strategy<Value = String> {
    let names: Vec<&str> = vocabulary::names().collect();
    let length = prop_oneof![
        Just(String::new()),
        (1u32..5).prop_map(|rounds| format!(":x{rounds}")),
        (0.5..12.0).prop_map(|seconds| format!(":{seconds:.2}s")),
    ];
    let pace = prop_oneof![Just(String::new()), (0.1..10.0).prop_map(|pace| format!("@{pace:.2}"))];
    let item = (prop::sample::select(names), length, pace);
    let item = item.prop_map(|(name, length, pace)| format!("{name}{length}{pace}"));
    prop::collection::vec(item, 1..5).prop_map(|items| items.join(","))
}

/// Between samples, velocity changes no more than the sharpest acceleration allows, and angle no
/// more than the velocity: no jump hides in a seam, whatever the seams claim.
fn never_jumps(motion: &Motion) -> Result<(), TestCaseError> {
    const STEPS: u32 = 2000;
    let step_s = motion.duration_s() / f64::from(STEPS);
    for dof in Dof::ALL {
        let peaks = motion.track(dof).actionlets().iter().map(Actionlet::peaks);
        let (fastest, sharpest) = peaks.fold((0.0f64, 0.0f64), |(speed, sharp), peak| {
            (speed.max(peak.velocity_rad_s), sharp.max(peak.acceleration_rad_s2))
        });
        let mut before = motion.at(dof, 0.0);
        for step in 1..=STEPS {
            let now = motion.at(dof, f64::from(step) * step_s);
            let moved = (now.position_rad - before.position_rad).abs();
            let changed = (now.velocity_rad_s - before.velocity_rad_s).abs();
            prop_assert!(moved <= fastest * step_s * 1.001 + 1e-9, "{dof:?}: {moved} rad");
            prop_assert!(changed <= sharpest * step_s * 1.001 + 1e-9, "{dof:?}: {changed} rad/s");
            before = now;
        }
    }
    Ok(())
}

/// All strides are alike.
const ALIKE: Spread = Spread {
    angle: 0.0,
    time: 0.0,
    peak: 0.0,
    duration: 0.0,
    exchange: 0.0,
    stride: 0.0,
    stature: 0.0,
    heading_rad: 0.0,
};

fn any_spread() -> impl Strategy<Value = Spread> {
    let parts = (0.0..0.9, 0.0..0.45, 0.0..0.8, 0.0..0.9, 0.0..1.0, 0.0..3.0);
    parts.prop_map(|(angle, time, peak, duration, exchange, stride)| Spread {
        angle,
        time,
        peak,
        duration,
        exchange,
        stride,
        ..Spread::default()
    })
}

/// Angle and velocity meet exactly at every seam; velocity is zero there.
fn is_smooth(motion: &Motion) -> Result<(), TestCaseError> {
    for dof in Dof::ALL {
        let pieces = motion.track(dof).actionlets();
        for pair in pieces.windows(2) {
            prop_assert_eq!(pair[0].to_rad(), pair[1].from_rad());
            let (before, after) = (pair[0].at(pair[0].end_s()), pair[1].at(pair[1].begin_s()));
            prop_assert_eq!(before.position_rad, after.position_rad);
            prop_assert_eq!((before.velocity_rad_s, after.velocity_rad_s), (0.0, 0.0));
            prop_assert!((pair[0].end_s() - pair[1].begin_s()).abs() < 1e-12);
        }
        for piece in pieces.iter().filter(|piece| !piece.is_rest()) {
            for part in [0.01, 0.3, 0.5, 0.8, 0.99] {
                let state = piece.at(piece.begin_s() + part * piece.duration_s());
                prop_assert!(state.velocity_rad_s * piece.change_rad() > 0.0, "{dof:?}");
            }
        }
        let end_s = pieces.last().map_or(0.0, |piece| piece.end_s());
        prop_assert!((end_s - motion.duration_s()).abs() < 1e-6);
    }
    Ok(())
}

fn in_range(motion: &Motion) -> Result<(), TestCaseError> {
    for (dof, piece) in motion.moving() {
        let (lower, upper) = dof.range_rad();
        let inside = lower - 1e-9..=upper + 1e-9;
        prop_assert!(inside.contains(&piece.from_rad()) && inside.contains(&piece.to_rad()));
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(150))]

    #[test]
    fn variations_are_smooth_inside_their_ranges_and_reproducible(
        action in any_action(),
        spread in any_spread(),
        seed in any::<u64>(),
    ) {
        prop_assert!(spread.check().is_ok());
        let vary = || mutate(&action, &spread, &SHIPPED, &mut ChaCha8Rng::seed_from_u64(seed));
        let varied = vary();
        prop_assert_eq!(&varied, &vary());
        let motion = varied.perform().unwrap();
        is_smooth(&motion)?;
        in_range(&motion)?;
        let ratio = varied.duration_s / action.duration_s;
        prop_assert!((ratio - 1.0).abs() <= spread.duration + 1e-12);
    }

    #[test]
    fn variations_keep_periods_phases_and_first_turning_points(
        action in any_action(),
        spread in any_spread(),
        seed in any::<u64>(),
    ) {
        prop_assume!(action.cyclic.is_some());
        let varied = mutate(&action, &spread, &SHIPPED, &mut ChaCha8Rng::seed_from_u64(seed));
        for (group, given) in varied.groups.iter().zip(&action.groups) {
            prop_assert_eq!((group.phase, group.rate), (given.phase, given.rate));
            prop_assert_eq!(&group.tracks, &given.tracks);
        }
        for (turns, given) in varied.waveforms.iter().zip(&action.waveforms) {
            // The first seam stays, so |A - X| does; the sum of durations is the period.
            prop_assert_eq!(turns[0].at, given[0].at);
            prop_assert!(turns.windows(2).all(|pair| pair[0].at < pair[1].at));
            prop_assert!(turns[turns.len() - 1].at < turns[0].at + 1.0);
        }
        // No more and no fewer actionlets where the cycle is joined and left.
        let (motion, given) = (varied.perform().unwrap(), action.perform().unwrap());
        for dof in Dof::ALL {
            let count = |motion: &Motion| motion.track(dof).actionlets().len();
            prop_assert_eq!(count(&motion), count(&given), "{}", dof.name());
        }
    }

    #[test]
    fn exchanged_actionlets_are_of_the_type_they_replace(
        action in any_action(),
        seed in any::<u64>(),
    ) {
        let spread = Spread { exchange: 1.0, ..ALIKE };
        let varied = mutate(&action, &spread, &SHIPPED, &mut ChaCha8Rng::seed_from_u64(seed));
        for (turns, given) in varied.waveforms.iter().zip(&action.waveforms) {
            for (turn, given) in turns.iter().zip(given) {
                prop_assert_eq!((turn.at, turn.angle_rad), (given.at, given.angle_rad));
            }
        }
        let known: Vec<&Shape> =
            SHIPPED.types().flat_map(|(_, entries)| entries).map(|entry| &entry.shape).collect();
        for turn in varied.waveforms.iter().flatten() {
            let given = action.waveforms.iter().flatten().any(|other| other.shape == turn.shape);
            prop_assert!(given || known.contains(&&turn.shape));
        }
    }

    #[test]
    fn joined_motions_are_smooth_and_contain_both(
        first in any_action(),
        second in any_action(),
        window_s in prop_oneof![Just(None), (0.05..0.5).prop_map(Some)],
    ) {
        let (a, b) = (first.perform().unwrap(), second.perform().unwrap());
        let how = window_s.map_or(Join::Transition, Join::Blend);
        let joined = a.clone().followed_by(b.clone(), how).unwrap();
        is_smooth(&joined)?;
        let differ = Dof::ALL
            .into_iter()
            .any(|dof| (a.track(dof).to_rad() - b.track(dof).from_rad()).abs() > 1e-6);
        let sum_s = a.duration_s() + b.duration_s();
        match (differ, window_s) {
            (false, _) => prop_assert!((joined.duration_s() - sum_s).abs() < 1e-6),
            (true, None) => prop_assert!(joined.duration_s() >= sum_s + 0.3 - 1e-9),
            (true, Some(window_s)) => {
                prop_assert!((joined.duration_s() - sum_s + window_s).abs() < 1e-6);
            }
        }
        for dof in Dof::ALL {
            let (start, end) = (joined.at(dof, 0.0), joined.at(dof, joined.duration_s()));
            prop_assert!((start.position_rad - a.track(dof).from_rad()).abs() < 1e-9);
            prop_assert!((end.position_rad - b.track(dof).to_rad()).abs() < 1e-9);
            prop_assert!(start.velocity_rad_s == 0.0 && end.velocity_rad_s.abs() < 1e-9);
        }
    }

    #[test]
    fn phrases_start_loop_stop_and_change_pace_without_a_jump(text in any_phrase()) {
        let motion = phrase::perform(&phrase::load(&text).unwrap(), Join::Transition).unwrap();
        is_smooth(&motion)?;
        never_jumps(&motion)?;
        for dof in Dof::ALL {
            prop_assert_eq!(motion.at(dof, 0.0).velocity_rad_s, 0.0);
            prop_assert!(motion.at(dof, motion.duration_s()).velocity_rad_s.abs() < 1e-9);
        }
    }

    #[test]
    fn any_phrase_is_read_or_refused(text in "[a-z:@,.0-9x-]{0,30}") {
        let _ = phrase::parse(&text);
        let _ = phrase::is_phrase(&text);
    }
}

/// Eq. 7: q(t) = p(s_h t + phi), for any number of cycles.
#[test]
fn phase_is_kept_over_a_thousand_cycles() {
    let mut jacks = vocabulary::find("jumping-jacks").unwrap();
    let walk = vocabulary::find("walk").unwrap();
    let rounds = 1000;
    let motion = walk.perform_rounds(rounds).unwrap();
    let period_s = walk.duration_s;
    for round in [2, 10, 500, 997] {
        for part in 0..40 {
            let time_s = (f64::from(round) + f64::from(part) / 40.0) * period_s;
            let left = motion.at(Dof::LeftKneeFlexion, time_s);
            let right = motion.at(Dof::RightKneeFlexion, time_s + period_s / 2.0);
            assert!((left.position_rad - right.position_rad).abs() < 1e-9, "round {round}");
            let early = motion.at(Dof::LeftKneeFlexion, time_s - f64::from(round - 1) * period_s);
            assert!((left.position_rad - early.position_rad).abs() < 1e-9, "round {round}");
            assert!((left.velocity_rad_s - early.velocity_rad_s).abs() < 1e-7);
        }
    }
    // A group with rate 2 goes round twice while another goes round once.
    jacks.rounds = rounds;
    let motion = jacks.perform().unwrap();
    for round in [3, 500, 996] {
        for part in 0..40 {
            let time_s = (f64::from(round) + f64::from(part) / 40.0) * jacks.duration_s;
            let knee = |time_s| motion.at(Dof::LeftKneeFlexion, time_s).position_rad;
            let arm = |time_s| motion.at(Dof::LeftShoulderAbduction, time_s).position_rad;
            assert!((knee(time_s) - knee(time_s + jacks.duration_s / 2.0)).abs() < 1e-9);
            assert!((arm(time_s) - arm(time_s + jacks.duration_s)).abs() < 1e-9);
        }
    }
}

#[test]
fn what_is_not_to_vary_stays_also_where_a_capture_left_the_anatomical_range() {
    let mut walk = vocabulary::find("walk").unwrap();
    let (_, upper) = Dof::LeftKneeFlexion.range_rad();
    let knee = walk.tracks().find(|track| track.dof == Dof::LeftKneeFlexion).unwrap().waveform;
    walk.captured = true;
    walk.waveforms[knee][0].angle_rad = upper + 0.2;
    let vary = |spread: &Spread, seed| {
        mutate(&walk, spread, &SHIPPED, &mut ChaCha8Rng::seed_from_u64(seed))
    };
    assert_eq!(vary(&ALIKE, 1), walk);
    let angles = (0..50)
        .map(|seed| vary(&Spread { angle: 0.2, ..ALIKE }, seed).waveforms[knee][0].angle_rad);
    let angles: Vec<f64> = angles.collect();
    assert!(angles.iter().all(|angle| *angle <= upper + 0.2), "no further out");
    assert!(angles.iter().any(|angle| *angle < upper + 0.2), "but it does vary");
}

#[test]
fn phrases_take_seconds_rounds_and_pace() {
    let perform = |text: &str| {
        phrase::perform(&phrase::load(text).unwrap(), Join::Transition).unwrap().duration_s()
    };
    assert!((perform("walk:6s") - 6.0).abs() < 1e-9);
    assert!((perform("walk:x3") - 3.6).abs() < 1e-9);
    assert!((perform("walk:x3@0.5") - 7.2).abs() < 1e-9);
    assert!((perform("bow@2") - 1.4).abs() < 1e-9);
    assert!((perform("bow:2s") - 2.0).abs() < 1e-9);
    // All shipped standing actions start and end in N pose: a plain join.
    assert!((perform("walk:x3,bow,wave-r") - (3.6 + 2.8 + 5.0)).abs() < 1e-6);
    // Sitting is not standing: a transition leads there.
    assert!(perform("stand-up,stand-up") > 4.3);
    assert!((perform("sit-down,stand-up") - 4.2).abs() < 1e-6);
    for wrong in ["walk:", "walk:6", "walk:x0", "walk:-1s", "walk@0", "walk@x", ":6s", "walk,,bow"]
    {
        assert!(phrase::parse(wrong).is_err(), "{wrong}");
    }
}

#[test]
fn the_database_finds_actionlets_by_type_with_where_they_come_from() {
    let mut database = Database::default();
    database.insert(vocabulary::find("run").unwrap()).unwrap();
    let kind = Type::of(Dof::RightKneeFlexion, 1.2).unwrap();
    let found = database.of_type(kind);
    assert!(!found.is_empty());
    assert!(found.iter().all(|entry| entry.action == "run" && entry.change_rad > 0.78));
    assert!(found.iter().any(|entry| entry.source.contains("Fukuchi")));
    let count: usize = database.types().map(|(_, entries)| entries.len()).sum();
    database.insert(vocabulary::find("run").unwrap()).unwrap();
    let again: usize = database.types().map(|(_, entries)| entries.len()).sum();
    assert_eq!(count, again, "an action that comes twice counts once");
    assert!(database.action("run").is_some() && database.action("walk").is_none());
}

/// Fig. 5a of the paper: the running knee has the period AB, BC, CD, DE and two types, AB = CD and
/// BC = DE. By range AB (22 deg) and CD (79 deg) are two.
#[test]
fn the_running_knee_has_the_two_types_of_the_paper_or_one_for_each_range() {
    let run = vocabulary::find("run").unwrap();
    let knee = run.tracks().find(|track| track.dof == Dof::LeftKneeFlexion).unwrap();
    let turns: Vec<f64> = run.waveforms[knee.waveform].iter().map(|turn| turn.angle_rad).collect();
    assert_eq!(turns.len(), 4);
    let counted = |types: Types| {
        let database = Database::shipped_by(types).unwrap();
        let mut found: Vec<Type> = (0..4)
            .map(|at| database.type_of(knee.dof, turns[(at + 1) % 4] - turns[at]).unwrap())
            .collect();
        assert!(found.iter().all(|kind| !database.of_type(*kind).is_empty()));
        let (alternate, count) = (found[0] == found[2] && found[1] == found[3], found.len());
        found.sort();
        found.dedup();
        (alternate, count, found.len())
    };
    assert_eq!(counted(Types::ByDirection), (true, 4, 2));
    let (alternate, _, types) = counted(Types::ByRange);
    assert!(!alternate && types > 2, "{types}");
    assert_eq!(counted(Types::default()), counted(Types::ByRange));
}
