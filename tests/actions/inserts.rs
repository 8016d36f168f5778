//! Pieces of one motion pasted into another, in every degree of freedom they move: Tables 1 and 2 of
//! Zheng et al., "Human Motion Simulation and Action Corpus", 2007.

use gaitway::action::{Fits, Insert, Inserts, Join, Meanwhile, Motion, NoSeam, phrase, vocabulary};
use gaitway::actionlet::{Actionlet, Cut, Sequence, Shape, insert};
use gaitway::body::{Dof, Proportions};
use proptest::prelude::*;

/// A chain from rows of when, where to (rad) and T.
fn chain(from_rad: f64, rows: &[(f64, f64, f64)]) -> Sequence {
    let start = Sequence::starting_at(0.0, from_rad).unwrap();
    rows.iter().fold(start, |chain, (end_s, to_rad, t)| {
        let duration_s = end_s - chain.end_s();
        chain.then(duration_s, *to_rad, Shape::half_sine(*t).unwrap()).unwrap()
    })
}

/// A motion of some chains; what has none rests.
fn motion(chains: &[(Dof, Sequence)]) -> Motion {
    let still = Sequence::starting_at(0.0, 0.0).unwrap();
    let of = |dof| chains.iter().find(|(of, _)| *of == dof).map(|(_, chain)| chain.clone());
    Motion::new(Dof::ALL.map(|dof| of(dof).unwrap_or_else(|| still.clone())).to_vec()).unwrap()
}

fn performed(text: &str) -> Motion {
    phrase::perform(&phrase::load(text).unwrap(), Join::Transition).unwrap()
}

fn same(got: f64, expected: f64) {
    assert!((got - expected).abs() <= 5.1e-10, "{got} is not {expected}");
}

const ELBOW: Dof = Dof::LeftElbowFlexion;
const SHOULDER: Dof = Dof::LeftShoulderFlexion;
const NECK: Dof = Dof::NeckFlexion;

/// sa1, sa2 of two degrees of freedom that rest at different times, and of one that rests.
fn source() -> Motion {
    motion(&[
        (ELBOW, chain(0.0, &[(0.8, 0.6, 0.4), (2.0, -0.1, 0.5)])),
        (SHOULDER, chain(0.1, &[(1.2, 0.5, 0.6), (2.0, 0.2, 0.3)])),
    ])
}

/// The target's actionlets end at 3, 4 and 5 s, 2.8 and 5 s; the neck moves as well.
fn target() -> Motion {
    motion(&[
        (ELBOW, chain(0.0, &[(3.0, 0.2, 0.5), (4.0, 1.0, 0.3), (5.0, 0.9, 0.5)])),
        (SHOULDER, chain(0.0, &[(2.8, 0.9, 0.7), (5.0, 0.1, 0.4)])),
        (NECK, chain(0.0, &[(2.5, 0.3, 0.5), (5.0, 0.0, 0.5)])),
    ])
}

const CUT: Cut = Cut { begin_s: 0.5, end_s: 1.4, target_s: 3.6, keep_end: false };

fn inserted(cut: Cut, meanwhile: Meanwhile) -> Motion {
    target().with_inserted(&source(), cut, NoSeam::Refused, meanwhile).unwrap().0
}

/// Worked out by hand from Tables 1 and 2, for each degree of freedom by itself: the elbow rests in the
/// cut at 0.8 s, the shoulder at 1.2 s.
#[test]
fn each_degree_of_freedom_has_the_times_of_table_two_at_its_own_seam() {
    let got = inserted(CUT, Meanwhile::GoesOn);
    let ends = |dof: Dof| -> Vec<(f64, f64)> {
        let pieces = got.track(dof).actionlets().iter();
        pieces.map(|piece| (piece.end_s(), piece.to_rad())).collect()
    };
    // ta1' = [3, 3.6 + (0.8 - 0.5)]; ta2' = [that, 4 + 0.9]; then the target, 0.9 s later.
    let elbow = ends(ELBOW);
    assert_eq!(elbow.len(), 4);
    let first = 0.2 + 0.8 * 0.9;
    let second = first - 0.7 / 1.2;
    for (got, (end_s, to_rad)) in
        elbow.iter().zip([(3.0, 0.2), (3.9, first), (4.9, second), (5.9, second - 0.1)])
    {
        same(got.0, end_s);
        same(got.1, to_rad);
    }
    // ta1' = [2.8, 3.6 + (1.2 - 0.5)]; ta2' = [that, 5 + 0.9].
    let shoulder = ends(SHOULDER);
    assert_eq!(shoulder.len(), 3);
    let first = 0.9 - 0.8 / 2.2 * 1.5;
    for (got, (end_s, to_rad)) in
        shoulder.iter().zip([(2.8, 0.9), (4.3, first), (5.9, first - 0.3 / 0.8 * 1.6)])
    {
        same(got.0, end_s);
        same(got.1, to_rad);
    }
    // Velocity functions: v_ta1 and v_sa2.
    let peak = |dof: Dof, index: usize| got.track(dof).actionlets()[index].shape().clone();
    assert_eq!(peak(ELBOW, 1), Shape::half_sine(0.3).unwrap());
    assert_eq!(peak(ELBOW, 2), Shape::half_sine(0.5).unwrap());
    assert_eq!(peak(SHOULDER, 1), Shape::half_sine(0.4).unwrap());
    assert_eq!(peak(SHOULDER, 2), Shape::half_sine(0.3).unwrap());
    // What the cut does not move is the target's.
    for step in 0..50 {
        let time_s = f64::from(step) / 10.0;
        assert_eq!(got.at(NECK, time_s), target().at(NECK, time_s));
    }
    same(got.duration_s(), 5.9);
}

/// Where the tables say all, the whole body does what `insert` does in one degree of freedom.
#[test]
fn where_the_target_moves_each_track_is_that_of_the_tables() {
    let got = inserted(CUT, Meanwhile::GoesOn);
    for dof in [ELBOW, SHOULDER] {
        let one = insert(source().track(dof), target().track(dof), CUT).unwrap();
        assert_eq!(*got.track(dof), one, "{}", dof.name());
    }
}

#[test]
fn what_waits_is_as_much_longer_and_comes_to_the_same_angles() {
    let got = inserted(CUT, Meanwhile::Waits);
    let neck = got.track(NECK).actionlets();
    same(neck[0].end_s(), 2.5);
    same(neck[1].end_s(), 5.9);
    same(neck[1].to_rad(), 0.0);
    assert!(got.track(NECK).actionlets().iter().all(|piece| piece.duration_s() > 0.0));
    same(got.duration_s(), 5.9);
}

#[test]
fn what_was_done_is_told_by_degree_of_freedom() {
    let (_, done) =
        target().with_inserted(&source(), CUT, NoSeam::Refused, Meanwhile::GoesOn).unwrap();
    assert_eq!((done.cut, done.kept), (CUT, vec![NECK]));
    let told: Vec<_> =
        done.pasted.iter().map(|track| (track.dof, track.seam_s, track.cut_moved_s)).collect();
    assert_eq!(told, [(SHOULDER, 1.2, 0.0), (ELBOW, 0.8, 0.0)]);
    same(done.pasted[1].from_s, 3.9);
    same(done.pasted[1].to_s, 4.9);
    same(done.pasted[1].moved_rad, 0.2 + 0.8 * 0.9 - 0.7 / 1.2 - 1.0);
}

#[test]
fn a_cut_without_a_seam_is_refused_by_name_or_moved_to_the_nearest() {
    // The elbow rests at 0.8 s; the shoulder at 0, 1.2 and 2 s only.
    let cut = Cut { begin_s: 0.5, end_s: 1.1, ..CUT };
    let go = |no_seam| target().with_inserted(&source(), cut, no_seam, Meanwhile::GoesOn);
    let error = go(NoSeam::Refused).unwrap_err().to_string();
    for words in [
        "left_shoulder_flexion rests at 0 and 1.2 s",
        "cut from 0 s on, or until later than 1.2 s",
        "--insert-nearest",
    ] {
        assert!(error.contains(words), "{words:?} is not in:\n{error}");
    }
    assert!(!error.contains("left_elbow_flexion"), "{error}");
    let (got, done) = go(NoSeam::Moved).unwrap();
    let told: Vec<_> =
        done.pasted.iter().map(|track| (track.dof, track.cut_begin_s, track.seam_s)).collect();
    assert_eq!(told, [(SHOULDER, 0.0, 0.0), (ELBOW, 0.5, 0.8)]);
    same(done.pasted[0].cut_moved_s, -0.5);
    same(done.pasted[0].cut_end_s, 0.6);
    // The shoulder's cut begins at its seam: ta1' ends at the target time, ta2' is the one that begins
    // there, at its own speed.
    let shoulder = got.track(SHOULDER).actionlets();
    same(shoulder[1].end_s(), 3.6);
    same(shoulder[2].end_s(), 5.0 + 0.6);
    same(shoulder[2].change_rad(), 0.4 / 1.2 * 2.0);
}

/// Both are nearer to their seam after the begin of the cut than to the one before.
#[test]
fn the_nearest_seam_may_be_a_later_one() {
    let cut = Cut { begin_s: 0.7, end_s: 0.79, ..CUT };
    let go = |cut| target().with_inserted(&source(), cut, NoSeam::Moved, Meanwhile::GoesOn);
    let (_, done) = go(cut).unwrap();
    let seam_s = |dof| done.pasted.iter().find(|track| track.dof == dof).unwrap().seam_s;
    assert_eq!((seam_s(ELBOW), seam_s(SHOULDER)), (0.8, 1.2));
}

#[test]
fn cuts_that_cannot_be_are_refused_in_words() {
    let go = |begin_s, end_s, target_s| {
        let cut = Cut { begin_s, end_s, target_s, keep_end: false };
        let made = target().with_inserted(&source(), cut, NoSeam::Moved, Meanwhile::Waits);
        made.err().map(|error| error.to_string()).unwrap_or_default()
    };
    assert_eq!(go(0.5, 1.4, 3.6), "");
    for (begin_s, end_s, target_s, words) in [
        (1.4, 0.5, 3.6, "ends before it begins"),
        (0.5, 0.5, 3.6, "ends before it begins"),
        (0.5, 2.5, 3.6, "not inside what it is cut out of"),
        (-0.5, 1.5, 3.6, "not inside what it is cut out of"),
        (f64::NAN, 1.5, 3.6, "not inside what it is cut out of"),
        (0.5, f64::INFINITY, 3.6, "not inside what it is cut out of"),
        (0.5, 1e300, 3.6, "not inside what it is cut out of"),
        (0.5, 1.4, 5.1, "not inside the motion"),
        (0.5, 1.4, -0.1, "not inside the motion"),
        (0.5, 1.4, f64::NAN, "not inside the motion"),
    ] {
        let said = go(begin_s, end_s, target_s);
        assert!(said.contains(words), "{begin_s} to {end_s} at {target_s}: {said:?}");
    }
    let still = motion(&[(NECK, chain(0.0, &[(1.0, 0.3, 0.5), (2.0, 0.3, 0.5), (3.0, 0.0, 0.5)]))]);
    let cut = Cut { begin_s: 1.1, end_s: 1.9, target_s: 1.0, keep_end: false };
    let error = target().with_inserted(&still, cut, NoSeam::Moved, Meanwhile::GoesOn);
    assert!(error.unwrap_err().to_string().contains("nothing moves in the cut"));
}

#[test]
fn an_angle_beyond_its_range_is_refused_and_one_that_was_beyond_may_stay() {
    let (_, upper_rad) = ELBOW.range_rad();
    let bent = |to_rad| motion(&[(ELBOW, chain(0.0, &[(1.0, to_rad, 0.5), (2.0, 0.0, 0.5)]))]);
    let cut = Cut { begin_s: 0.0, end_s: 1.0, target_s: 1.0, keep_end: false };
    let go = |target: Motion, source: Motion| {
        target.with_inserted(&source, cut, NoSeam::Refused, Meanwhile::GoesOn)
    };
    let error = go(bent(2.0), bent(1.0)).unwrap_err().to_string();
    assert!(error.contains("left_elbow_flexion") && error.contains("150 deg"), "{error}");
    // A capture may leave the range; an insert goes no further out.
    let beyond = upper_rad + 0.3;
    assert!(go(bent(beyond), bent(beyond)).is_err());
    let keeps = Cut { begin_s: 0.0, end_s: 2.0, target_s: 0.0, keep_end: true };
    let kept = bent(beyond).with_inserted(&bent(1.0), keeps, NoSeam::Refused, Meanwhile::GoesOn);
    assert!(kept.is_ok(), "{kept:?}");
}

/// A period of a cycle, pasted in at the same phase, is one round more.
#[test]
fn a_stride_pasted_into_a_walk_is_a_walk_of_one_stride_more() {
    let (walk, longer) = (performed("walk:x4"), performed("walk:x5"));
    for begin_s in [1.2, 1.25, 1.5, 1.73] {
        let cut = Cut { begin_s, end_s: begin_s + 1.2, target_s: begin_s + 1.2, keep_end: false };
        let (got, done) =
            walk.with_inserted(&walk, cut, NoSeam::Refused, Meanwhile::GoesOn).unwrap();
        assert!(done.kept.is_empty());
        assert!((got.duration_s() - longer.duration_s()).abs() < 1e-9);
        for sample in 0..=600 {
            let time_s = f64::from(sample) / 100.0;
            for dof in Dof::ALL {
                let (now, then) = (got.at(dof, time_s), longer.at(dof, time_s));
                assert!(
                    (now.position_rad - then.position_rad).abs() < 1e-9
                        && (now.velocity_rad_s - then.velocity_rad_s).abs() < 1e-7,
                    "{} at {time_s} s, cut from {begin_s}: {now:?}, {then:?}",
                    dof.name()
                );
            }
        }
    }
}

#[test]
fn the_legs_do_not_fall_out_of_step() {
    let walk = performed("walk:x4");
    let bends = chain(0.0, &[(0.5, 0.5, 0.5), (1.0, 0.0, 0.5)]);
    let knee = motion(&[(Dof::RightKneeFlexion, bends)]);
    let cut = Cut { begin_s: 0.0, end_s: 1.0, target_s: 2.3, keep_end: false };
    let go = |meanwhile| walk.with_inserted(&knee, cut, NoSeam::Refused, meanwhile);
    let (waits, _) = go(Meanwhile::Waits).unwrap();
    for dof in Dof::ALL {
        let end_s = waits.track(dof).end_s();
        assert!((end_s - 5.8).abs() < 1e-9, "{}: {end_s}", dof.name());
    }
    let error = go(Meanwhile::GoesOn).unwrap_err().to_string();
    for words in ["out of step", "--insert-wait"] {
        assert!(error.contains(words), "{words:?} is not in:\n{error}");
    }
    // A movement of an arm leaves the legs alone.
    let wave = performed("wave-r");
    let cut = Cut { begin_s: 0.0, end_s: wave.duration_s(), ..cut };
    let (got, _) = walk.with_inserted(&wave, cut, NoSeam::Refused, Meanwhile::GoesOn).unwrap();
    for dof in [Dof::LeftHipFlexion, Dof::RightKneeFlexion, Dof::RightAnkleDorsiflexion] {
        for step in 0..48 {
            let time_s = f64::from(step) / 10.0;
            assert_eq!(got.at(dof, time_s), walk.at(dof, time_s));
        }
    }
}

#[test]
fn flights_come_along_come_later_or_keep_an_insert_away() {
    let jump = performed("jump");
    let &[(takes_off_s, lands_s)] = jump.flights_s() else { panic!("one flight") };
    let nod = motion(&[(NECK, chain(0.0, &[(1.0, 0.2, 0.5), (3.0, 0.2, 0.5), (4.0, 0.0, 0.5)]))]);
    let go = |target: &Motion, source: &Motion, begin_s, end_s, target_s| {
        let cut = Cut { begin_s, end_s, target_s, keep_end: false };
        target.with_inserted(source, cut, NoSeam::Refused, Meanwhile::Waits)
    };
    // The flight comes along.
    let (got, _) = go(&nod, &jump, 0.0, jump.duration_s(), 1.5).unwrap();
    let &[(from_s, to_s)] = got.flights_s() else { panic!("{:?}", got.flights_s()) };
    same(from_s, 1.5 + takes_off_s);
    same(to_s, 1.5 + lands_s);
    // The body leaves the ground in it, and stands before and after.
    let poses = got.poses(&Proportions::of_stature(1.75).unwrap(), 100.0).unwrap();
    let height = |time_s: f64| poses[(time_s * 100.0) as usize].root_m.z;
    assert!(height((from_s + to_s) / 2.0) > height(1.0) + 0.02);
    same(height(got.duration_s() - 0.02), height(0.0));
    // A part of it does not.
    let middle_s = (takes_off_s + lands_s) / 2.0;
    let error = go(&nod, &jump, 0.0, middle_s, 1.5).unwrap_err().to_string();
    assert!(error.contains("tear a flight of its source"), "{error}");
    // Of two jumps, the second comes later when something is inserted between them; nothing is while
    // one of them flies.
    let jumps = performed("jump,jump");
    let (got, _) = go(&jumps, &nod, 0.0, nod.duration_s(), jump.duration_s()).unwrap();
    let [first, second] = got.flights_s() else { panic!("{:?}", got.flights_s()) };
    assert_eq!(*first, jumps.flights_s()[0]);
    same(second.0, jumps.flights_s()[1].0 + nod.duration_s());
    let error = go(&jumps, &nod, 0.0, nod.duration_s(), middle_s).unwrap_err().to_string();
    assert!(error.contains("tear a flight of the target"), "{error}");
}

#[test]
fn inserts_are_read_as_they_are_written() {
    for text in ["bow:0.5s..1.4s@3.6s", "walk:x3@0.5:0s..2s@0s", "bow@3.6s", "a/b.toml:1s..2s@3s"] {
        let insert: Insert = text.parse().unwrap_or_else(|e| panic!("{text}: {e}"));
        assert_eq!(insert.to_string(), text);
    }
    let source = |text: &str| text.parse::<Insert>().unwrap().source().to_owned();
    assert_eq!(source("../x+y.toml:0.5s..1.4s@3.6s"), "../x+y.toml");
    assert_eq!(source("../bow.toml@3.6s"), "../bow.toml");
    assert_eq!(source("walk:6s@3.6s"), "walk:6s");
    for (text, words) in [
        ("bow", "no @"),
        ("bow:0.5s..1.4s", "no @"),
        ("bow:0.5s..1.4s@3.6", "\"3.6\""),
        ("bow:0.5..1.4s@3.6s", "\"0.5\""),
        ("bow:0.5s..@3.6s", "\"\""),
        ("bow:x..1s@3.6s", "\"x\""),
        ("bow:1.4s..0.5s@3.6s", "ends before it begins"),
        ("bow:1.4s..1.4s@3.6s", "ends before it begins"),
        ("bow:NaNs..1.4s@3.6s", "NaN s"),
        ("bow:0s..infs@3.6s", "inf s"),
        ("bow:-1s..1s@3.6s", "-1 s"),
        ("bow:0s..1e300s@3.6s", "0 to 86400 s"),
        ("bow@-3s", "-3 s"),
        ("bow@NaNs", "NaN s"),
        ("@3s", "names no action"),
        (":0s..1s@3s", "names no action"),
    ] {
        let error = text.parse::<Insert>().expect_err(text).to_string();
        assert!(error.contains(words) && error.contains(text), "{words:?} is not in:\n{error}");
    }
}

#[test]
fn inserts_are_done_in_order_each_into_what_the_one_before_made() {
    let insert = |text: &str| text.parse::<Insert>().unwrap();
    let inserts =
        |list: Vec<Insert>| Inserts { list, meanwhile: Meanwhile::Waits, ..Inserts::default() };
    let wave = performed("wave-r");
    let once = |at_s: f64| insert(&format!("wave-r:1.2s..2.1s@{at_s}s"));
    let (got, done) = inserts(vec![once(2.1), once(3.0), once(2.1)])
        .apply(wave.clone(), &mut Fits::usual().unwrap())
        .unwrap();
    assert_eq!(done.len(), 3);
    assert!((got.duration_s() - wave.duration_s() - 2.7).abs() < 1e-9);
    // Three times more down and up.
    let turns = |motion: &Motion| motion.track(Dof::RightElbowFlexion).actionlets().len();
    assert_eq!(turns(&got), turns(&wave) + 6);
    let error = inserts(vec![once(2.1), once(9.0)])
        .apply(wave, &mut Fits::usual().unwrap())
        .unwrap_err()
        .to_string();
    assert!(error.contains("wave-r:1.2s..2.1s@9s") && error.contains("0 to 5.9 s"), "{error}");
}

/// Chains with a rest now and then, from durations, steps and T; they last `duration_s`.
fn chains(duration_s: f64) -> impl Strategy<Value = Sequence> {
    let step = (0.2..1.0, -0.3..0.3f64, 0.1..0.9, 0..4);
    prop::collection::vec(step, 2..9).prop_map(move |steps| {
        let sum: f64 = steps.iter().map(|step| step.0).sum();
        let start = Sequence::starting_at(0.0, 0.9).unwrap();
        steps.into_iter().fold(start, |chain, (part, change_rad, t, kind)| {
            let to_rad = chain.to_rad() + if kind == 0 { 0.0 } else { change_rad };
            let shape = Shape::half_sine(t).unwrap();
            chain.then(part / sum * duration_s, to_rad, shape).unwrap()
        })
    })
}

const LENGTH_S: f64 = 4.0;

/// Those with the widest ranges, so that few inserts leave one.
const ARMS: [Dof; 5] = [
    Dof::LeftShoulderFlexion,
    Dof::RightShoulderFlexion,
    Dof::LeftShoulderAbduction,
    Dof::RightShoulderAbduction,
    Dof::LeftElbowFlexion,
];

fn motions() -> impl Strategy<Value = Motion> {
    prop::collection::vec(chains(LENGTH_S), ARMS.len()).prop_map(|all| {
        let chains: Vec<(Dof, Sequence)> = ARMS.into_iter().zip(all).collect();
        motion(&chains)
    })
}

fn is_smooth(motion: &Motion) -> Result<(), TestCaseError> {
    for dof in Dof::ALL {
        let pieces = motion.track(dof).actionlets();
        for pair in pieces.windows(2) {
            prop_assert_eq!(pair[0].to_rad(), pair[1].from_rad());
            prop_assert!((pair[0].end_s() - pair[1].begin_s()).abs() < 1e-12);
        }
        for piece in pieces {
            prop_assert_eq!(piece.at(piece.begin_s()).velocity_rad_s, 0.0);
            prop_assert_eq!(piece.at(piece.end_s()).velocity_rad_s, 0.0);
        }
        let end_s = pieces.last().map_or(0.0, Actionlet::end_s);
        prop_assert!((end_s - motion.duration_s()).abs() < 1e-9);
    }
    Ok(())
}

proptest! {
    #[test]
    fn outside_the_cut_every_actionlet_is_as_it_was(
        (source, target) in (motions(), motions()),
        (from, length) in (0.0..0.7, 0.1..0.9),
        at in 0.0..1.0,
        waits in any::<bool>(),
    ) {
        let begin_s = from * LENGTH_S;
        let end_s = begin_s + (LENGTH_S - begin_s) * length;
        let cut = Cut { begin_s, end_s, target_s: at * LENGTH_S, keep_end: false };
        let meanwhile = if waits { Meanwhile::Waits } else { Meanwhile::GoesOn };
        let made = target.with_inserted(&source, cut, NoSeam::Moved, meanwhile);
        // Else it left a range, or nothing moved.
        prop_assume!(made.is_ok());
        let (got, done) = made.unwrap();
        is_smooth(&got)?;
        prop_assert!((got.duration_s() - LENGTH_S - cut.length_s()).abs() < 1e-9);
        for dof in Dof::ALL {
            let (was, is) = (target.track(dof).actionlets(), got.track(dof).actionlets());
            let pasted = done.pasted.iter().find(|track| track.dof == dof);
            let later_s = if waits || pasted.is_some() { cut.length_s() } else { 0.0 };
            let moved_rad = pasted.map_or(0.0, |track| track.moved_rad);
            for piece in was {
                let before = piece.end_s() <= cut.target_s;
                let after = piece.begin_s() >= cut.target_s;
                if !(before || after) || piece.is_rest() {
                    continue;
                }
                let (later_s, moved_rad) = if before { (0.0, 0.0) } else { (later_s, moved_rad) };
                let is_it = |now: &&Actionlet| {
                    (now.begin_s() - piece.begin_s() - later_s).abs() < 1e-9
                        && (now.end_s() - piece.end_s() - later_s).abs() < 1e-9
                        && (now.from_rad() - piece.from_rad() - moved_rad).abs() < 1e-9
                        && (now.to_rad() - piece.to_rad() - moved_rad).abs() < 1e-9
                        && now.shape() == piece.shape()
                };
                prop_assert!(is.iter().any(|now| is_it(&now)), "{dof:?}: {piece:?} is gone");
            }
        }
    }

    /// Between the first and the last seam in its cut, the source is there as it was.
    #[test]
    fn inside_the_cut_the_source_comes_as_it_was(
        (source, target) in (motions(), motions()),
        (from, length) in (0.0..0.5, 0.3..0.9),
        at in 0.0..1.0,
    ) {
        let begin_s = from * LENGTH_S;
        let end_s = begin_s + (LENGTH_S - begin_s) * length;
        let cut = Cut { begin_s, end_s, target_s: at * LENGTH_S, keep_end: false };
        let made = target.with_inserted(&source, cut, NoSeam::Moved, Meanwhile::GoesOn);
        prop_assume!(made.is_ok());
        let (got, done) = made.unwrap();
        for track in &done.pasted {
            let pieces = source.track(track.dof).actionlets().iter();
            let inside = pieces.filter(|piece| {
                piece.begin_s() >= track.seam_s && piece.end_s() <= track.cut_end_s - 1e-5
            });
            let later_s = track.from_s - track.seam_s;
            for piece in inside {
                for part in [0.1, 0.5, 0.9] {
                    let time_s = piece.begin_s() + part * piece.duration_s();
                    let (then, now) = (piece.at(time_s), got.at(track.dof, time_s + later_s));
                    prop_assert!((then.velocity_rad_s - now.velocity_rad_s).abs() < 1e-6);
                }
            }
            // t'_ta2 = t_target + (t_sa2 - t_begin).
            let expected_s = cut.target_s + (track.seam_s - track.cut_begin_s);
            prop_assert!((track.from_s - expected_s).abs() < 1e-5);
        }
    }

    #[test]
    fn any_text_is_read_as_an_insert_or_refused(text in "[a-z:@,.0-9sNa+-]{0,30}") {
        let _ = text.parse::<Insert>();
    }

    /// Whole shipped actions, anywhere: a motion at rest at both ends, or a reason.
    #[test]
    fn shipped_actions_go_into_one_another_or_are_refused(
        source in prop::sample::select(vocabulary::names().collect::<Vec<_>>()),
        target in prop::sample::select(vocabulary::names().collect::<Vec<_>>()),
        (from, length, at) in (0.0..0.8, 0.1..1.0, 0.0..1.0),
        (nearest, keep_end, waits) in (any::<bool>(), any::<bool>(), any::<bool>()),
    ) {
        let (source, target) = (performed(source), performed(target));
        let begin_s = from * source.duration_s();
        let end_s = begin_s + (source.duration_s() - begin_s) * length;
        let cut = Cut { begin_s, end_s, target_s: at * target.duration_s(), keep_end };
        let no_seam = if nearest { NoSeam::Moved } else { NoSeam::Refused };
        let meanwhile = if waits { Meanwhile::Waits } else { Meanwhile::GoesOn };
        match target.with_inserted(&source, cut, no_seam, meanwhile) {
            Err(error) => prop_assert!(error.to_string().len() > 20),
            Ok((got, done)) => {
                is_smooth(&got)?;
                prop_assert!((got.duration_s() - target.duration_s() - cut.length_s()).abs() < 1e-9);
                prop_assert!(!done.pasted.is_empty());
                for (dof, piece) in got.moving() {
                    let (lower, upper) = dof.range_rad();
                    let inside = lower - 1e-6..=upper + 1e-6;
                    prop_assert!(inside.contains(&piece.to_rad()), "{dof:?}");
                }
                for (from_s, to_s) in got.flights_s() {
                    prop_assert!(0.0 <= *from_s && from_s < to_s && *to_s <= got.duration_s());
                }
            }
        }
    }
}
