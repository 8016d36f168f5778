//! A model drafted from examples: what all of them share.
//!
//! Of the 18 directed motions the one is taken that moves furthest and goes to and fro in the same order in every
//! example; its strokes are the phases. Of each phase the draft then says what all examples have in common: how far
//! and how fast that part moves, where it is, what the other parts do, which feet stand, how long it lasts; with room to
//! both sides, because the next person does it otherwise. It is a beginning for a person to go on from.

use super::features::{Feature, FeatureRow};
use super::model::{BodySide, FeatureRange};
use crate::error::counted;
use std::fmt::Write;

/// What is slower does not move, limb lengths per second; as in model files.
const MOVES_L_S: f64 = 0.15;
/// A stroke may be interrupted for so long, s.
const SLACK_S: f64 = 0.1;
/// Shortest stroke that counts, limb lengths.
const LEAST_L: f64 = 0.1;
/// Parts of an example's longest stroke from which on a stroke counts; the first by which all examples have one order.
const COUNTS: [f64; 4] = [0.25, 0.4, 0.55, 0.7];
/// Most strokes of a draft.
const MAX_STROKES: usize = 8;
/// Part of the least of all examples that is asked of how far and how fast.
const OF_LEAST: f64 = 0.6;
/// Part of the leader's speed below which another part only moves along.
const ALONG: f64 = 0.5;
/// Room beside what was seen of a measure: lengths in limbs, and degrees.
const ROOM_L: f64 = 0.2;
const ROOM_DEG: f64 = 12.0;

/// What the draft is called and shows.
#[derive(Clone, Debug, PartialEq)]
pub struct DraftName<'a> {
    /// Its name.
    pub name: &'a str,
    /// The action it shows; its name if none is given.
    pub action: Option<&'a str>,
    /// The side, if it has one.
    pub side: Option<BodySide>,
}

/// One stroke of a part in one direction.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Stroke {
    from: usize,
    to: usize,
    /// Signed, limb lengths.
    travel_l: f64,
    time_s: f64,
}

/// Strokes of a moving feature, as long as wanted at least.
fn strokes(rows: &[FeatureRow], feature: Feature) -> Vec<Stroke> {
    let mut found: Vec<Stroke> = Vec::new();
    let mut open: Option<Stroke> = None;
    let mut still_s = 0.0;
    for (n, row) in rows.iter().enumerate() {
        let value = row.value(feature);
        let moves = value.abs() > MOVES_L_S;
        match &mut open {
            Some(stroke) if moves && value * stroke.travel_l > 0.0 => {
                stroke.to = n;
                stroke.travel_l += value * row.dt_s;
                stroke.time_s += row.dt_s + still_s;
                still_s = 0.0;
            }
            Some(_) if !moves && still_s + row.dt_s <= SLACK_S => still_s += row.dt_s,
            _ => {
                found.extend(open.take());
                still_s = 0.0;
                if moves {
                    let travel_l = value * row.dt_s;
                    open = Some(Stroke { from: n, to: n, travel_l, time_s: row.dt_s });
                }
            }
        }
    }
    found.extend(open);
    found
}

/// The strokes of each example, if they come in the same order in all.
fn shared(examples: &[Vec<FeatureRow>], feature: Feature) -> Option<Vec<Vec<Stroke>>> {
    let all: Vec<Vec<Stroke>> = examples.iter().map(|rows| strokes(rows, feature)).collect();
    COUNTS.into_iter().find_map(|share| {
        let long = |strokes: &Vec<Stroke>| -> Vec<Stroke> {
            let longest_l = strokes.iter().map(|of| of.travel_l.abs()).fold(0.0, f64::max);
            let least_l = (share * longest_l).max(LEAST_L);
            strokes.iter().filter(|of| of.travel_l.abs() >= least_l).copied().collect()
        };
        let all: Vec<Vec<Stroke>> = all.iter().map(long).collect();
        let signs = |strokes: &[Stroke]| -> Vec<bool> {
            strokes.iter().map(|of| of.travel_l > 0.0).collect()
        };
        let first = signs(all.first()?);
        let fits = (1..=MAX_STROKES).contains(&first.len());
        (fits && all.iter().all(|strokes| signs(strokes) == first)).then_some(all)
    })
}

/// A model file of what all examples share, as text; none if no part moves in the same order in all of them.
#[must_use]
pub fn drafted(name: &DraftName<'_>, examples: &[Vec<FeatureRow>]) -> Option<String> {
    let least_l = |strokes: &Vec<Vec<Stroke>>| {
        let of = |strokes: &Vec<Stroke>| strokes.iter().map(|of| of.travel_l.abs()).sum::<f64>();
        strokes.iter().map(of).fold(f64::INFINITY, f64::min)
    };
    let moving = Feature::all().filter(|feature| feature.axis_words().is_some());
    let (leader, strokes) = moving
        .filter_map(|feature| Some((feature, shared(examples, feature)?)))
        .max_by(|a, b| least_l(&a.1).total_cmp(&least_l(&b.1)))?;
    let gap_s = longest_gap_s(examples, &strokes);
    let mut text = format!("schema = 1\nname = \"{}\"\n", name.name);
    if let Some(action) = name.action {
        let _ = writeln!(text, "action = \"{action}\"");
    }
    if let Some(side) = name.side {
        let _ = writeln!(text, "side = \"{}\"", side.word());
    }
    let _ = writeln!(
        text,
        "note = \"Drafted from {} by {}\"",
        counted(examples.len(), "example"),
        leader.name()
    );
    let _ = writeln!(text, "gap_s = {:.2}\nslack_s = {SLACK_S}", (1.5 * gap_s + 0.1).min(60.0));
    for index in 0..strokes[0].len() {
        let of: Vec<(&[FeatureRow], Stroke)> = examples
            .iter()
            .zip(&strokes)
            .map(|(rows, strokes)| (&rows[strokes[index].from..=strokes[index].to], strokes[index]))
            .collect();
        phase(&mut text, index, leader, &of);
    }
    Some(text)
}

fn longest_gap_s(examples: &[Vec<FeatureRow>], strokes: &[Vec<Stroke>]) -> f64 {
    let gaps = examples.iter().zip(strokes).flat_map(|(rows, strokes)| {
        strokes
            .windows(2)
            .map(|pair| rows[pair[0].to + 1..pair[1].from].iter().map(|row| row.dt_s).sum::<f64>())
    });
    gaps.fold(0.0, f64::max)
}

/// One phase of the draft.
fn phase(text: &mut String, index: usize, leader: Feature, of: &[(&[FeatureRow], Stroke)]) {
    let Some((part, axis, words)) = leader.axis_words() else { return };
    let direction = words[usize::from(of[0].1.travel_l < 0.0)];
    let least = |value: &dyn Fn(&Stroke) -> f64| {
        of.iter().map(|(_, stroke)| value(stroke)).fold(f64::INFINITY, f64::min)
    };
    let most_s = of.iter().map(|(_, stroke)| stroke.time_s).fold(0.0, f64::max);
    let amount_l = OF_LEAST * least(&|stroke| stroke.travel_l.abs());
    let speed_l_s = OF_LEAST * least(&|stroke| stroke.travel_l.abs() / stroke.time_s);
    let _ = writeln!(text, "\n[[phase]]\nname = \"{} {direction}\"", index + 1);
    for (key, value) in [("contact", 1.0), ("no_contact", 0.0)] {
        let feet: Vec<&str> =
            [("left_foot", "left_foot_contact"), ("right_foot", "right_foot_contact")]
                .into_iter()
                .filter(|(_, name)| always(of, name, value))
                .map(|(foot, _)| foot)
                .collect();
        if !feet.is_empty() {
            let _ = writeln!(text, "{key} = {feet:?}");
        }
    }
    let _ = writeln!(
        text,
        "{part} = {{ {axis} = \"{direction} {amount_l:.2}.. {speed_l_s:.2}../s\" }}"
    );
    for feature in Feature::all() {
        let Some(range) = common(feature, leader, part, of) else { continue };
        let _ = writeln!(text, "average.{} = [{:.2}, {:.2}]", feature.name(), range.from, range.to);
    }
    let shortest_s = 0.5 * least(&|stroke| stroke.time_s);
    let _ = writeln!(text, "duration_s = [{shortest_s:.2}, {:.2}]", (2.0 * most_s + 0.1).min(60.0));
}

fn mean_of(rows: &[FeatureRow], feature: Feature) -> f64 {
    rows.iter().map(|row| row.value(feature)).sum::<f64>() / rows.len() as f64
}

/// Whether a feature has one value in every frame of every example.
fn always(of: &[(&[FeatureRow], Stroke)], name: &str, value: f64) -> bool {
    let Some(feature) = Feature::named(name) else { return false };
    of.iter().all(|(rows, _)| rows.iter().all(|row| row.value(feature) == value))
}

/// What the examples have in common of the mean of a feature, with room; none if it says nothing about the phase.
fn common(
    feature: Feature,
    leader: Feature,
    part: &str,
    of: &[(&[FeatureRow], Stroke)],
) -> Option<FeatureRange> {
    let means: Vec<f64> = of.iter().map(|(rows, _)| mean_of(rows, feature)).collect();
    if feature == leader || means.iter().any(|mean| !mean.is_finite()) {
        return None;
    }
    let from = means.iter().copied().fold(f64::INFINITY, f64::min);
    let to = means.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if feature.axis_words().is_some() {
        // Another motion counts if all examples make it in one direction, and not just along with the leader.
        let (least, most) = (from.abs().min(to.abs()), from.abs().max(to.abs()));
        let led = of.iter().map(|(rows, _)| mean_of(rows, leader).abs()).fold(0.0, f64::max);
        if from * to <= 0.0 || least < (2.0 * MOVES_L_S).max(ALONG * led) {
            return None;
        }
        let (near, far) = (0.4 * least, 2.5 * most);
        return Some(if from > 0.0 {
            FeatureRange { from: near, to: far }
        } else {
            FeatureRange { from: -far, to: -near }
        });
    }
    let name = feature.name();
    if name == "root_speed" {
        return Some(FeatureRange { from: 0.0, to: 1.5 * to + 0.2 });
    }
    let is_of_part = match part {
        "root" | "torso" => ["trunk_lean_deg", "hips_height"].contains(&name.as_str()),
        limb => {
            name.strip_prefix(limb).is_some_and(|of| ["_height", "_ahead", "_out"].contains(&of))
        }
    };
    let room = if name.ends_with("_deg") { ROOM_DEG } else { ROOM_L };
    let room = room.max((to - from) / 2.0);
    is_of_part.then_some(FeatureRange { from: from - room, to: to + room })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recognise::machine::{ActionEvent, ModelMachine};
    use crate::recognise::model::file::{Bands, none_to_mirror, parse};
    use crate::recognise::posture::EquationReading;

    const DT_S: f64 = 0.02;

    /// Somebody whose right hand goes forward and back within so long, after a while; the left foot stands.
    fn reach(far_l: f64, stroke_s: f64) -> Vec<FeatureRow> {
        let value = |name: &str| Feature::named(name).expect(name).index();
        let row = |n: i32| {
            let mut row = FeatureRow::unknown(DT_S);
            let phase = (f64::from(n) * DT_S - 0.5) / stroke_s;
            let speed = core::f64::consts::PI * far_l / (2.0 * stroke_s);
            row.values[value("right_hand_frontal")] = if (0.0..2.0).contains(&phase) {
                speed * (core::f64::consts::PI * phase).sin()
            } else {
                0.0
            };
            row.values[value("right_hand_height")] = -0.2;
            row.values[value("left_foot_contact")] = 1.0;
            row.values[value("root_speed")] = 0.05;
            row
        };
        (0..150).map(row).collect()
    }

    fn name() -> DraftName<'static> {
        DraftName { name: "reach-r", action: Some("reach"), side: Some(BodySide::Right) }
    }

    fn fires(text: &str, rows: &[FeatureRow]) -> usize {
        let model = parse(text, "reach-r", &Bands::default(), &none_to_mirror).expect(text);
        let mut machine = ModelMachine::new(EquationReading::Repaired);
        let mut done = 0;
        let mut tell =
            |what: ActionEvent| done += usize::from(matches!(what, ActionEvent::Done { .. }));
        for (n, row) in rows.iter().enumerate() {
            machine.next(&model, row, n as f64 * DT_S, &mut tell);
        }
        machine.finish(&model, &mut tell);
        done
    }

    #[test]
    fn a_draft_sees_its_examples_and_one_between_them_and_no_gesture_of_a_third_of_it() {
        let text = drafted(&name(), &[reach(0.6, 0.5), reach(0.9, 0.7)]).expect("a draft");
        assert!(text.contains("forward 0.36.. 0.7"), "{text}");
        assert!(text.contains("contact = [\"left_foot\"]"), "{text}");
        for far_l in [0.6, 0.75, 0.9] {
            assert_eq!(fires(&text, &reach(far_l, 0.6)), 1, "{far_l}\n{text}");
        }
        assert_eq!(fires(&text, &reach(0.2, 0.5)), 0, "{text}");
    }

    #[test]
    fn examples_that_share_no_motion_make_no_draft() {
        let mut other = reach(0.6, 0.5);
        for row in &mut other {
            row.values = [0.0; crate::recognise::features::FEATURES];
        }
        assert_eq!(drafted(&name(), &[reach(0.6, 0.5), other]), None);
        assert_eq!(drafted(&name(), &[]), None);
    }
}
