//! One action done while another goes on, made of both, held against somebody who did both at once.

use super::motions::{ANGLES, Held, Judging, MotionScore, MotionScoreOrder, mean, poses, turned};
use super::people::Split;
use crate::body::{Dof, End, Joint, Proportions};
use crate::error::Error;
use crate::job::pending::go_on;
use crate::job::{Event, Observer};
use std::collections::BTreeMap;

/// What is compared at once, s.
const PIECE_S: f64 = 1.0;
/// Instants of it.
const INSTANTS: usize = 20;
/// Between the places at which a piece of a part may begin, s.
const STEP_S: f64 = 0.05;
/// Joints and ends above the pelvis, at which two bodies are compared.
const JOINTS: [Joint; 8] = [
    Joint::Torso,
    Joint::Neck,
    Joint::LeftShoulder,
    Joint::RightShoulder,
    Joint::LeftElbow,
    Joint::RightElbow,
    Joint::LeftWrist,
    Joint::RightWrist,
];
const ENDS: [End; 3] = [End::HeadTop, End::LeftFingertip, End::RightFingertip];

fn is_of_leg(signal: usize) -> bool {
    (Dof::LeftHipFlexion.index()..ANGLES).contains(&signal)
}

fn is_of_arm(signal: usize) -> bool {
    signal < ANGLES && !is_of_leg(signal) && limb(signal) != limb(Dof::NeckFlexion.index())
}

/// The angles of the limb that an angle above the pelvis belongs to: an arm, or trunk and neck.
fn limb(signal: usize) -> &'static [usize] {
    const TRUNK: [usize; 4] = [
        Dof::TorsoFlexion.index(),
        Dof::TorsoLateralBend.index(),
        Dof::TorsoAxial.index(),
        Dof::NeckFlexion.index(),
    ];
    const LEFT: [usize; 4] = [
        Dof::LeftShoulderFlexion.index(),
        Dof::LeftShoulderAbduction.index(),
        Dof::LeftShoulderRotation.index(),
        Dof::LeftElbowFlexion.index(),
    ];
    const RIGHT: [usize; 4] = [
        Dof::RightShoulderFlexion.index(),
        Dof::RightShoulderAbduction.index(),
        Dof::RightShoulderRotation.index(),
        Dof::RightElbowFlexion.index(),
    ];
    match signal {
        signal if LEFT.contains(&signal) => &LEFT,
        signal if RIGHT.contains(&signal) => &RIGHT,
        _ => &TRUNK,
    }
}

/// Rows of a piece of a trial that begins at a time.
fn piece(of: &Held, from_s: f64) -> Vec<Vec<f64>> {
    let last_s = (of.frames().saturating_sub(1) as f64 / of.entry.rate_hz).max(1e-9);
    let row = |at: usize| of.at((from_s + PIECE_S * at as f64 / (INSTANTS - 1) as f64) / last_s);
    (0..INSTANTS).map(row).collect()
}

/// Where pieces of a trial begin, s.
fn begins(of: &Held, step_s: f64) -> impl Iterator<Item = f64> {
    let last_s = of.frames().saturating_sub(1) as f64 / of.entry.rate_hz;
    let count = ((last_s - PIECE_S) / step_s + 1e-9).floor() + 1.0;
    (0..count.max(0.0) as usize).map(move |at| at as f64 * step_s)
}

/// The piece of some trials whose angles are nearest to those of another, as far as `counts`; and in which trial it is.
fn nearest(
    trials: &[&Held],
    truth: &[Vec<f64>],
    counts: impl Fn(usize) -> bool,
) -> Option<(usize, Vec<Vec<f64>>)> {
    let signals: Vec<usize> = (0..ANGLES).filter(|signal| counts(*signal)).collect();
    let mut best: Option<(f64, usize, Vec<Vec<f64>>)> = None;
    for (index, of) in trials.iter().enumerate() {
        for from_s in begins(of, STEP_S) {
            let own = piece(of, from_s);
            let square = |(a, b): (&Vec<f64>, &Vec<f64>)| -> f64 {
                signals.iter().map(|signal| turned(a[*signal], b[*signal]).powi(2)).sum()
            };
            let apart: f64 = own.iter().zip(truth).map(square).sum();
            if best.as_ref().is_none_or(|(least, ..)| apart < *least) {
                best = Some((apart, index, own));
            }
        }
    }
    best.map(|(_, index, own)| (index, own))
}

/// How much each angle moves in a trial: its mean square about its mean.
fn moves(of: &Held) -> Vec<f64> {
    let of_signal = |values: &Vec<f32>| {
        let own: Vec<f64> = values.iter().map(|value| f64::from(*value)).collect();
        let middle = mean(&own);
        mean(&own.iter().map(|value| (value - middle).powi(2)).collect::<Vec<_>>())
    };
    of.frames.signals[..ANGLES].iter().map(of_signal).collect()
}

/// Mean distance above the pelvis of two bodies that stand and walk alike, mm.
fn apart_mm(body: &Proportions, made: &[Vec<f64>], truth: &[Vec<f64>]) -> f64 {
    let mut distances = Vec::new();
    for (one, other) in poses(made).iter().zip(&poses(truth)) {
        let (one, other) = (body.positions(one), body.positions(other));
        let joints = JOINTS.iter().map(|of| of.index());
        distances.extend(joints.map(|at| one.joints_m[at].distance(other.joints_m[at])));
        let ends = ENDS.iter().map(|of| *of as usize);
        distances.extend(ends.map(|at| one.ends_m[at].distance(other.ends_m[at])));
    }
    1e3 * mean(&distances)
}

/// Rows whose angles above the pelvis are given by a rule, on the legs and the place of the truth.
fn above(truth: &[Vec<f64>], rule: impl Fn(usize, usize) -> f64) -> Vec<Vec<f64>> {
    let row = |(at, own): (usize, &Vec<f64>)| -> Vec<f64> {
        let given = |signal: usize| signal >= ANGLES || is_of_leg(signal);
        (0..own.len())
            .map(|signal| if given(signal) { own[signal] } else { rule(at, signal) })
            .collect()
    };
    truth.iter().enumerate().map(row).collect()
}

/// An action put on another, as somebody does both at once: trials whose action is called `walk+punch`, of those called
/// `walk` and `punch`.
///
/// # Errors
/// As [`super::motions::generalisation`].
pub fn splicing(order: &MotionScoreOrder, observer: &dyn Observer) -> Result<MotionScore, Error> {
    let mut judging = Judging::of(order)?;
    let trials = std::mem::take(&mut judging.trials);
    let split = judging.split.clone();
    let mut report = judging.report(
        "splicing",
        (
            "each second of trials of two actions at once (walk+punch), above the pelvis; legs, and which piece of each \
             action it is, are given",
            "mm",
        ),
    );
    let mut by_action: BTreeMap<&str, Vec<&Held>> = BTreeMap::new();
    for held in &trials {
        by_action.entry(held.entry.action.as_str()).or_default().push(held);
    }
    let mut errors: [Vec<f64>; 4] = Default::default();
    let mut by_class: BTreeMap<String, Vec<f64>> = BTreeMap::new();
    for (action, truths) in &by_action {
        let Some((under, over)) = action.split_once('+') else { continue };
        let parts = |name: &str| -> Vec<&Held> {
            let all = by_action.get(name).map_or(&[][..], Vec::as_slice);
            all.iter().copied().filter(|of| split.lends(&of.entry)).collect()
        };
        let (under, over) = (parts(under), parts(over));
        for truth in truths.iter().filter(|of| split.judges(&of.entry)) {
            if under.is_empty() || over.is_empty() {
                report.pass_over("an action of the two is not there alone", 1);
                continue;
            }
            let body = Proportions::of_stature(truth.entry.body_stature_m)?;
            let before = errors[0].len();
            for from_s in begins(truth, PIECE_S) {
                go_on(observer)?;
                observer.hear(Event::Step {
                    done: report.judged,
                    total: trials.len() as u64,
                    what: "trials",
                });
                let wanted = piece(truth, from_s);
                let found =
                    nearest(&under, &wanted, is_of_leg).zip(nearest(&over, &wanted, is_of_arm));
                let Some(((a_index, a), (b_index, b))) = found else { continue };
                let (a_moves, b_moves) = (moves(under[a_index]), moves(over[b_index]));
                let is_over = |signal: usize| {
                    let of =
                        |moves: &[f64]| -> f64 { limb(signal).iter().map(|at| moves[*at]).sum() };
                    of(&b_moves) > of(&a_moves)
                };
                // How far from one to the other the truth is, at best.
                let best = |signal: usize| {
                    let (mut along, mut square) = (0.0, 1e-12);
                    for ((a, b), own) in a.iter().zip(&b).zip(&wanted) {
                        let way = turned(a[signal], b[signal]);
                        along += way * turned(a[signal], own[signal]);
                        square += way * way;
                    }
                    f64::clamp(along / square, 0.0, 1.0)
                };
                let between = |share: &dyn Fn(usize) -> f64| {
                    above(&wanted, |at, n| a[at][n] + share(n) * turned(a[at][n], b[at][n]))
                };
                let made = [
                    between(&|n| f64::from(u8::from(is_over(n)))),
                    between(&|_| 1.0),
                    between(&|_| 0.0),
                    between(&best),
                ];
                for (errors, made) in errors.iter_mut().zip(&made) {
                    errors.push(apart_mm(&body, made, &wanted));
                }
            }
            if errors[0].len() == before {
                let why = "it, or an action of the two alone, is shorter than a second";
                report.pass_over(why, 1);
                continue;
            }
            report.judged += 1;
            by_class.entry((*action).to_owned()).or_default().extend(&errors[0][before..]);
        }
    }
    if report.judged == 0 {
        report.truth = match split {
            Split::Everybody => {
                "no truth here: no trial of two actions at once (walk+punch) beside trials of each alone"
            }
            Split::People { .. } => {
                "no truth here: nobody who is judged did two actions at once (walk+punch) that others did alone"
            }
        };
        return Ok(report);
    }
    let what = [
        "all above the pelvis of the second action, pasted",
        "the first action, without the second",
    ];
    report.tell(&errors[0], what.into_iter().zip(&errors[1..]));
    report.bound = Some((
        "each angle between the two, as far as who knows the truth wants it",
        mean(&errors[3]),
    ));
    report.per_class = by_class.iter().map(|(class, own)| (class.clone(), mean(own))).collect();
    Ok(report)
}
