//! What plain ways reach where the recogniser is judged: the class of the most alike other clip, and the most frequent
//! class. Both are told what the recogniser has to find: from when to when something is done.

use super::ClassTally;
use crate::recognise::points::{BodyPoint, Points};
use crate::recognise::score::interval;
use glam::{DQuat, DVec3};
use serde::Serialize;
use std::collections::BTreeMap;

/// Instants of a clip that are compared, however long it is.
const INSTANTS: usize = 40;
/// So many instants one clip may be ahead of the other (the band of Sakoe and Chiba, "Dynamic programming algorithm
/// optimization for spoken word recognition", 1978).
const BAND: usize = 8;
/// More clips are not compared, each with each.
const MOST: usize = 2000;

/// What a plain way reaches.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ClassBaseline {
    /// How it tells a class.
    pub what: &'static str,
    /// Share of what there is that it tells rightly.
    pub value: Option<f64>,
    /// Its 95 % interval.
    pub interval: Option<[f64; 2]>,
    /// Share of what it tells that is right.
    pub precision: Option<f64>,
    /// Clips, or cuts of them, that it was asked for.
    pub asked: usize,
}

/// A clip or a cut of it, and what is done in it.
pub(super) struct Example {
    /// The class; none of a distractor.
    class: Option<String>,
    file: String,
    subject: Option<String>,
    poses: Vec<[DVec3; 13]>,
}

impl Example {
    /// Of frames, by the size of the body: each place from the pelvis, in legs, as who faces forward.
    pub(super) fn of(
        class: Option<&str>,
        (file, subject): (&str, Option<&str>),
        frames: &[Points],
        leg_m: f64,
    ) -> Self {
        let last = frames.len().saturating_sub(1);
        let at = |instant: usize| (instant * last + (INSTANTS - 1) / 2) / (INSTANTS - 1);
        let poses = (0..INSTANTS).filter_map(|instant| frames.get(at(instant)));
        Self {
            class: class.map(str::to_owned),
            file: file.to_owned(),
            subject: subject.map(str::to_owned),
            poses: poses.map(|points| facing_forward(points, leg_m)).collect(),
        }
    }

    /// Whether the other may be asked: it is of another person, or of another clip if nobody said whose it is.
    fn is_foreign(&self, other: &Self) -> bool {
        match (&self.subject, &other.subject) {
            (Some(one), Some(other)) => one != other,
            _ => self.file != other.file,
        }
    }
}

fn facing_forward(points: &Points, leg_m: f64) -> [DVec3; 13] {
    let left = points[BodyPoint::LeftHip] - points[BodyPoint::RightHip];
    let turn = DQuat::from_rotation_z(-left.y.atan2(left.x));
    points.0.map(|place| turn * (place - points[BodyPoint::Root]) / leg_m)
}

/// Mean distance of the points that both show; infinite if none is.
fn apart(one: &[DVec3; 13], other: &[DVec3; 13]) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for (a, b) in one.iter().zip(other) {
        let distance = a.distance(*b);
        if distance.is_finite() {
            sum += distance;
            count += 1.0;
        }
    }
    if count > 0.0 { sum / count } else { f64::INFINITY }
}

/// The least sum of distances with which one motion goes over into the other, each in its own order.
fn warped(one: &[[DVec3; 13]], other: &[[DVec3; 13]]) -> f64 {
    let mut before = vec![f64::INFINITY; other.len()];
    for (i, pose) in one.iter().enumerate() {
        let mut now = vec![f64::INFINITY; other.len()];
        for j in i.saturating_sub(BAND)..(i + BAND + 1).min(other.len()) {
            let way = [before[j], if j > 0 { before[j - 1] } else { f64::INFINITY }]
                .into_iter()
                .chain((j > 0).then(|| now[j - 1]))
                .fold(f64::INFINITY, f64::min);
            let way = if i == 0 && j == 0 { 0.0 } else { way };
            now[j] = way + apart(pose, &other[j]);
        }
        before = now;
    }
    before.last().copied().unwrap_or(f64::INFINITY)
}

fn baseline(
    what: &'static str,
    examples: &[Example],
    told: impl Fn(usize) -> Option<String>,
) -> ClassBaseline {
    let mut tally = ClassTally::default();
    for (index, example) in examples.iter().enumerate() {
        let told = told(index);
        tally.truth += usize::from(example.class.is_some());
        tally.recognised += usize::from(told.is_some());
        tally.correct += usize::from(told.is_some() && told == example.class);
    }
    ClassBaseline {
        what,
        value: tally.recall(),
        interval: interval(tally.correct, tally.truth),
        precision: tally.precision(),
        asked: examples.len(),
    }
}

/// What plain ways reach; none without a class that could be told. The first is left out of too many clips.
pub(super) fn baselines(examples: &[Example]) -> Vec<ClassBaseline> {
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    for class in examples.iter().filter_map(|of| of.class.as_deref()) {
        *counts.entry(class).or_default() += 1;
    }
    let Some((most, _)) = counts.iter().max_by_key(|(_, count)| **count) else {
        return Vec::new();
    };
    let nearest = (examples.len() <= MOST).then(|| {
        let near = nearest(examples);
        let told = |index: usize| near[index].and_then(|other| examples[other].class.clone());
        baseline("as the most alike other clip, by time warping", examples, told)
    });
    let always = baseline("always the most frequent class", examples, |_| Some((*most).to_owned()));
    nearest.into_iter().chain([always]).collect()
}

/// The most alike that may be asked of each.
fn nearest(examples: &[Example]) -> Vec<Option<usize>> {
    let mut near = vec![(f64::INFINITY, None); examples.len()];
    for (i, one) in examples.iter().enumerate() {
        for (j, other) in examples.iter().enumerate().take(i) {
            if !one.is_foreign(other) {
                continue;
            }
            let apart = warped(&one.poses, &other.poses);
            for (index, found) in [(i, j), (j, i)] {
                if apart < near[index].0 {
                    near[index] = (apart, Some(found));
                }
            }
        }
    }
    near.into_iter().map(|(_, found)| found).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Somebody who faces a direction and moves the right hand along a way of heights.
    fn hand(heights: &[f64], facing_rad: f64, leg_m: f64) -> Vec<Points> {
        let turn = DQuat::from_rotation_z(facing_rad);
        let frame = |height: &f64| {
            let mut points = Points([DVec3::ZERO; 13]);
            points[BodyPoint::LeftHip] = DVec3::new(0.0, 0.1, 0.0);
            points[BodyPoint::RightHip] = DVec3::new(0.0, -0.1, 0.0);
            points[BodyPoint::RightHand] = DVec3::new(0.3, 0.0, *height);
            points[BodyPoint::LeftToe] = DVec3::NAN;
            Points(points.0.map(|place| turn * place * leg_m + DVec3::new(3.0, 1.0, 0.9)))
        };
        heights.iter().map(frame).collect()
    }

    fn example(class: Option<&str>, file: &str, frames: &[Points], leg_m: f64) -> Example {
        Example::of(class, (file, None), frames, leg_m)
    }

    #[test]
    fn what_is_alike_but_for_place_heading_size_and_pace_is_the_same() {
        let up: Vec<f64> = (0..60).map(|at| f64::from(at) / 60.0).collect();
        let late: Vec<f64> = (0..90).map(|at| (f64::from(at) - 6.0).max(0.0) / 84.0).collect();
        let down: Vec<f64> = up.iter().rev().copied().collect();
        let one = example(None, "a", &hand(&up, 0.0, 1.0), 1.0);
        let other = example(None, "b", &hand(&late, 2.0, 0.6), 0.6);
        let opposite = example(None, "c", &hand(&down, 0.0, 1.0), 1.0);
        let (near, far) = (warped(&one.poses, &other.poses), warped(&one.poses, &opposite.poses));
        assert!(near < 0.1 && far > 10.0 * near, "{near} {far}");
        assert_eq!(warped(&one.poses, &one.poses), 0.0);
    }

    #[test]
    fn warping_is_the_least_of_all_ways_inside_the_band() {
        // All ways, tried one after the other, of short motions.
        fn least(costs: &[Vec<f64>], i: usize, j: usize) -> f64 {
            if i.abs_diff(j) > BAND {
                return f64::INFINITY;
            }
            let own = costs[i][j];
            if i == 0 && j == 0 {
                return own;
            }
            let mut best = f64::INFINITY;
            if i > 0 {
                best = best.min(least(costs, i - 1, j));
            }
            if j > 0 {
                best = best.min(least(costs, i, j - 1));
            }
            if i > 0 && j > 0 {
                best = best.min(least(costs, i - 1, j - 1));
            }
            best + own
        }
        let way = |heights: [f64; 7]| -> Vec<[DVec3; 13]> {
            hand(&heights, 0.0, 1.0).iter().map(|points| facing_forward(points, 1.0)).collect()
        };
        let one = way([0.0, 0.1, 0.5, 0.4, 0.4, 0.9, 1.0]);
        let other = way([0.2, 0.0, 0.1, 0.6, 0.3, 1.0, 0.8]);
        let costs: Vec<Vec<f64>> =
            one.iter().map(|a| other.iter().map(|b| apart(a, b)).collect()).collect();
        assert!((warped(&one, &other) - least(&costs, 6, 6)).abs() < 1e-12);
    }

    #[test]
    fn a_clip_has_the_class_of_the_most_alike_of_another_file_or_person() {
        let [up, down, still] = [
            (0..50).map(|at| f64::from(at) / 50.0).collect::<Vec<_>>(),
            (0..50).map(|at| 1.0 - f64::from(at) / 50.0).collect(),
            vec![0.2; 50],
        ];
        let of = |class, file: &str, way: &[f64]| example(class, file, &hand(way, 0.3, 0.8), 0.8);
        let mut examples = vec![
            of(Some("raise"), "a", &up),
            of(Some("raise"), "b", &up),
            of(Some("lower"), "c", &down),
            of(Some("lower"), "c", &down),
            of(None, "d", &still),
            of(None, "e", &still),
        ];
        let found = baselines(&examples);
        // The two of file c have nobody but others to ask.
        assert_eq!((found[0].value, found[0].asked), (Some(0.5), 6));
        // Those who lower a hand are most like those who stand still, who have no class.
        assert_eq!(found[0].precision, Some(1.0));
        assert_eq!((found[1].value, found[1].precision), (Some(0.5), Some(2.0 / 6.0)));
        // Labels that lie cost.
        (examples[1].class, examples[2].class) = (Some("lower".into()), Some("raise".into()));
        assert_eq!(baselines(&examples)[0].value, Some(0.0));
        // Of one person nobody is asked about that person.
        for (example, who) in examples.iter_mut().zip(["p", "p", "q", "q", "q", "q"]) {
            example.subject = Some(who.to_owned());
        }
        assert_eq!(nearest(&examples)[0], Some(4));
    }
}
