//! The vector: KickR reduced to the right foot. dt 0.05 s, noise 0.01 m; long from 0.55 m, mean from
//! 0.15 m, fast from 1 m/s, gap of 2 frames; limbs of 1 m. Frames count from 1.

use super::*;
use crate::recognise::features::Feature;
use crate::recognise::model::{Condition, FeatureRange, Travel};

const DT_S: f64 = 0.05;
const EPS_M: f64 = 0.01;
const FORWARD_M: [f64; 12] = [0.0, 0.0, 0.1, 0.2, 0.2, 0.1, 0.0, -0.1, -0.2, -0.2, -0.1, 0.0];

fn feature(name: &str) -> Feature {
    Feature::named(name).expect(name)
}

fn phase(name: &str, sign: f64) -> ModelPhase {
    let (frontal, vertical) = (feature("right_foot_frontal"), feature("right_foot_vertical"));
    let moves = EPS_M / DT_S;
    let gate = |feature| {
        let range = if sign > 0.0 {
            FeatureRange { from: moves, ..FeatureRange::ANY }
        } else {
            FeatureRange { to: -moves, ..FeatureRange::ANY }
        };
        Condition { feature, range }
    };
    let fast = FeatureRange { from: 1.0, ..FeatureRange::ANY };
    let travel = |feature, from, to| Travel {
        feature,
        sign,
        amount: FeatureRange { from, to },
        speed: fast,
    };
    ModelPhase {
        name: name.to_owned(),
        gates: vec![gate(frontal), gate(vertical)],
        postures: Vec::new(),
        travels: vec![travel(frontal, 0.55, f64::INFINITY), travel(vertical, 0.15, 0.55)],
        means: Vec::new(),
        shortest_s: 0.0,
        longest_s: f64::INFINITY,
        ends_soon: false,
    }
}

fn kick(gap_frames: f64) -> ActionModel {
    ActionModel {
        name: "kick-r".to_owned(),
        action: "kick".to_owned(),
        side: None,
        note: String::new(),
        source: String::new(),
        also: Vec::new(),
        gap_s: gap_frames * DT_S,
        slack_s: 0.0,
        leading: 0,
        phases: vec![phase("forward", 1.0), phase("back", -1.0)],
    }
}

/// When what happened: the frame in which it was told (one beyond the last at the end of the stream).
fn told(
    model: &ActionModel,
    reading: EquationReading,
    forward_m: &[f64],
) -> Vec<(usize, ActionEvent)> {
    let mut machine = ModelMachine::new(reading);
    let mut told = Vec::new();
    for (index, df) in forward_m.iter().enumerate() {
        let mut row = FeatureRow::unknown(DT_S);
        row.values[feature("right_foot_frontal").index()] = df / DT_S;
        row.values[feature("right_foot_vertical").index()] = 0.4 * df / DT_S;
        let frame = index + 1;
        machine.next(model, &row, frame as f64 * DT_S, &mut |what| told.push((frame, what)));
    }
    machine.finish(model, &mut |what| told.push((forward_m.len() + 1, what)));
    told
}

/// Recognitions: the frame at which, and from which frame to which.
fn recognised(reading: EquationReading, forward_m: &[f64]) -> Vec<(usize, [usize; 2])> {
    let frame = |time_s: f64| (time_s / DT_S).round() as usize;
    let done = |(at, what)| match what {
        ActionEvent::Done { span, .. } => Some((at, [frame(span.start_s), frame(span.end_s)])),
        _ => None,
    };
    told(&kick(2.0), reading, forward_m).into_iter().filter_map(done).collect()
}

fn changed(change: impl FnOnce(&mut Vec<f64>)) -> Vec<f64> {
    let mut forward_m = FORWARD_M.to_vec();
    change(&mut forward_m);
    forward_m
}

#[test]
fn the_kick_is_recognised_at_frame_12_as_3_to_11_by_both_readings() {
    for reading in [EquationReading::Strict, EquationReading::Repaired] {
        assert_eq!(recognised(reading, &FORWARD_M), [(12, [3, 11])], "{reading:?}");
        let first = told(&kick(2.0), reading, &FORWARD_M).into_iter().find_map(|(at, what)| {
            if let ActionEvent::Phase { number: 1, span } = what { Some((at, span)) } else { None }
        });
        let (_, span) = first.expect("phase 1");
        assert_eq!((span.start_s / DT_S).round(), 3.0, "{reading:?}");
        assert_eq!((span.end_s / DT_S).round(), 6.0, "{reading:?}");
    }
}

#[test]
fn a_frame_doubled_between_the_phases_is_missed_as_printed_and_waited_out_as_repaired() {
    let doubled = changed(|frames| frames.insert(6, 0.0));
    assert_eq!(recognised(EquationReading::Strict, &doubled), []);
    assert_eq!(recognised(EquationReading::Repaired, &doubled), [(13, [3, 12])]);
}

#[test]
fn without_a_frame_between_the_phases_only_the_repaired_machine_sees_both() {
    let removed = changed(|frames| {
        frames.remove(6);
    });
    assert_eq!(recognised(EquationReading::Strict, &removed), []);
    assert_eq!(recognised(EquationReading::Repaired, &removed), [(11, [3, 10])]);
}

#[test]
fn a_stream_that_ends_in_the_last_phase_has_it_as_repaired() {
    let cut = changed(|frames| frames.truncate(11));
    assert_eq!(recognised(EquationReading::Strict, &cut), []);
    assert_eq!(recognised(EquationReading::Repaired, &cut), [(12, [3, 11])]);
}

#[test]
fn half_a_kick_is_cancelled_at_frame_7_by_both_readings() {
    let halved: Vec<f64> = FORWARD_M.iter().map(|df| df / 2.0).collect();
    for reading in [EquationReading::Strict, EquationReading::Repaired] {
        assert_eq!(told(&kick(2.0), reading, &halved), [], "{reading:?}");
        let mut machine = ModelMachine::new(reading);
        let mut idle = Vec::new();
        for (index, df) in halved.iter().enumerate() {
            let mut row = FeatureRow::unknown(DT_S);
            row.values[feature("right_foot_frontal").index()] = df / DT_S;
            row.values[feature("right_foot_vertical").index()] = 0.4 * df / DT_S;
            machine.next(&kick(2.0), &row, index as f64 * DT_S, &mut |_| ());
            idle.push(machine.is_idle());
        }
        assert_eq!(idle[1..7], [true, false, false, false, false, true], "{reading:?}");
    }
}

#[test]
fn three_frames_between_the_phases_are_more_than_a_gap_of_two() {
    let apart = changed(|frames| frames.splice(6..7, [0.0; 3]).for_each(drop));
    assert_eq!(recognised(EquationReading::Repaired, &apart), []);
}

#[test]
fn it_is_told_to_be_under_way_before_it_is_done() {
    let told = told(&kick(2.0), EquationReading::Repaired, &FORWARD_M);
    let at: Vec<usize> = told.iter().map(|(at, _)| *at).collect();
    // At frame 6 it has gone 0.6 m forward; 8 begins the way back, 12 ends it.
    assert_eq!(at, [6, 8, 12, 12]);
    assert!(matches!(told[0].1, ActionEvent::Begun { .. }), "{told:?}");
    // The way back does not come.
    let broken = changed(|frames| frames[7..].fill(0.0));
    let told = super::tests::told(&kick(2.0), EquationReading::Repaired, &broken);
    assert_eq!(told.last(), Some(&(9, ActionEvent::BrokenOff { number: 2 })));
}

#[test]
fn a_leading_phase_is_part_of_the_kick_if_it_is_there_and_is_not_asked_for() {
    let mut model = kick(2.0);
    let mut lead = phase("swing back", -1.0);
    lead.travels.clear();
    model.phases.insert(0, lead);
    model.leading = 1;
    let spans = |forward_m: &[f64]| -> Vec<(f64, usize)> {
        let done = |(_, what)| match what {
            ActionEvent::Done { span, phases } => {
                Some(((span.start_s / DT_S).round(), phases.len()))
            }
            _ => None,
        };
        told(&model, EquationReading::Repaired, forward_m).into_iter().filter_map(done).collect()
    };
    assert_eq!(spans(&FORWARD_M), [(3.0, 2)]);
    let led = changed(|frames| frames[1] = -0.1);
    assert_eq!(spans(&led), [(2.0, 3)]);
}

#[test]
fn two_kicks_in_a_row_are_two_and_a_phase_of_one_frame_has_an_end() {
    let twice = changed(|frames| frames.extend(&FORWARD_M[2..]));
    assert_eq!(recognised(EquationReading::Repaired, &twice), [(12, [3, 11]), (22, [13, 21])]);
    let short = [0.0, 0.6, 0.0, -0.6, 0.0];
    assert_eq!(recognised(EquationReading::Strict, &short), []);
    assert_eq!(recognised(EquationReading::Repaired, &short), [(5, [2, 4])]);
}

#[test]
fn what_is_not_shown_fits_no_phase() {
    let unseen = FeatureRow::unknown(DT_S);
    assert!(!phase("forward", 1.0).fits(&unseen));
}

#[test]
fn a_phase_that_lasts_too_long_is_no_phase_nor_is_what_is_left_of_it() {
    let mut model = kick(2.0);
    model.phases.truncate(1);
    model.phases[0].longest_s = 4.0 * DT_S;
    let done = |forward_m: &[f64]| {
        let told = told(&model, EquationReading::Repaired, forward_m);
        told.iter().filter(|(_, what)| matches!(what, ActionEvent::Done { .. })).count()
    };
    assert_eq!(done(&FORWARD_M), 1);
    assert_eq!(done(&[0.0, 0.1, 0.2, 0.2, 0.2, 0.2, 0.2, 0.2, 0.2, 0.0]), 0);
}

#[test]
fn an_interruption_within_the_slack_belongs_to_the_phase() {
    let broken = changed(|frames| frames.insert(5, 0.0));
    let mut model = kick(2.0);
    // In the middle of the way the amount is not yet reached, so that this is no gap.
    model.slack_s = DT_S;
    let done = told(&model, EquationReading::Repaired, &broken);
    assert!(done.iter().any(|(_, what)| matches!(what, ActionEvent::Done { .. })), "{done:?}");
    model.slack_s = 0.0;
    let done = told(&model, EquationReading::Repaired, &broken);
    assert!(!done.iter().any(|(_, what)| matches!(what, ActionEvent::Done { .. })), "{done:?}");
}

/// The kick whose way back is enough from 0.25 m on, and which is over then.
fn soon() -> ActionModel {
    let mut model = kick(2.0);
    let back = &mut model.phases[1];
    back.ends_soon = true;
    back.travels[0].amount.from = 0.25;
    back.travels[1].amount.from = 0.1;
    model
}

#[test]
fn a_last_phase_that_ends_soon_is_named_in_the_frame_that_is_enough_and_once_while_it_lasts() {
    let done = |reading, forward_m: &[f64]| -> Vec<(usize, [f64; 2])> {
        let told = told(&soon(), reading, forward_m).into_iter();
        told.filter_map(|(at, what)| match what {
            ActionEvent::Done { span, .. } => {
                Some((at, [span.start_s, span.end_s].map(|s| (s / DT_S).round())))
            }
            _ => None,
        })
        .collect()
    };
    // Back by 0.1 m in frame 8, by 0.3 m in frame 9.
    assert_eq!(done(EquationReading::Repaired, &FORWARD_M), [(9, [3.0, 9.0])]);
    // Fig. 3 ends a phase where a frame no longer fits it.
    assert_eq!(done(EquationReading::Strict, &FORWARD_M), [(12, [3.0, 11.0])]);
    // It goes on for as long as one likes: nothing more is said, nor at the end of the stream.
    let long = changed(|frames| frames.splice(11.., [-0.1; 30]).for_each(drop));
    assert_eq!(done(EquationReading::Repaired, &long), [(9, [3.0, 9.0])]);
    // What comes then is seen as ever.
    let twice = changed(|frames| frames.extend(&FORWARD_M[2..]));
    let both = [(9, [3.0, 9.0]), (19, [13.0, 19.0])];
    assert_eq!(done(EquationReading::Repaired, &twice), both);
}

#[test]
fn a_phase_that_ends_soon_leaves_the_frames_that_fit_it_to_the_next() {
    let mut model = kick(2.0);
    model.phases[1] = phase("on", 1.0);
    for (phase, amount_m) in model.phases.iter_mut().zip([0.3, 0.2]) {
        phase.travels.truncate(1);
        phase.travels[0].amount.from = amount_m;
    }
    let done = |model: &ActionModel| {
        let told = told(model, EquationReading::Repaired, &FORWARD_M).into_iter();
        told.filter_map(|(_, what)| match what {
            ActionEvent::Done { phases, .. } => {
                Some(phases.iter().map(|(_, span)| (span.end_s / DT_S).round()).collect())
            }
            _ => None,
        })
        .collect::<Vec<Vec<f64>>>()
    };
    assert_eq!(done(&model), Vec::<Vec<f64>>::new());
    model.phases[0].ends_soon = true;
    // 0.3 m in frame 4, and 0.3 m more in frames 5 and 6.
    assert_eq!(done(&model), [[4.0, 6.0]]);
}

#[test]
fn a_twitch_before_the_way_back_is_not_taken_for_it_while_the_gap_lasts() {
    let twitch = |still: usize| {
        changed(|frames| {
            let held = [[-0.03].as_slice(), &vec![0.0; still]].concat();
            frames.splice(6..7, held).for_each(drop);
        })
    };
    assert_eq!(recognised(EquationReading::Strict, &twitch(1)), []);
    // The way back begins in frame 9, behind a gap of frames 7 and 8.
    assert_eq!(recognised(EquationReading::Repaired, &twitch(1)), [(13, [3, 12])]);
    assert_eq!(recognised(EquationReading::Repaired, &twitch(2)), []);
    // What was begun is broken off once.
    let told = told(&kick(2.0), EquationReading::Repaired, &twitch(2));
    let broken = told.iter().filter(|(_, what)| matches!(what, ActionEvent::BrokenOff { .. }));
    assert_eq!(broken.count(), 1, "{told:?}");
}
