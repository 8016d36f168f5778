//! Legs that go over together.
//!
//! A knee that is already in the gait after while its hip is still in the one before puts the foot down
//! where neither gait has it, and the body is thrown back or falls. So of the ways over of hips, knees and
//! ankles those are taken that together keep the body's pace and height between what both gaits have at that
//! time: the best few of legs that go over about one instant each are improved joint by joint and then two joints
//! of a leg at a time. Seen from the side, with the pelvis upright.

use glam::DVec2;

use super::{Around, Choice, Line};
use crate::body::{Dof, End, Joint, Proportions};
use crate::error::Error;

/// Joints of both legs, from the hip down.
const LEGS: [[Dof; 3]; 2] = [
    [Dof::LeftHipFlexion, Dof::LeftKneeFlexion, Dof::LeftAnkleDorsiflexion],
    [Dof::RightHipFlexion, Dof::RightKneeFlexion, Dof::RightAnkleDorsiflexion],
];

/// Proportions are those of this stature; which ways are best hardly depends on it.
const STATURE_M: f64 = 1.75;
/// A sole this much higher than the lowest carries 1/e of what that carries, m: about as high as feet swing over the
/// floor, so that a foot that would scuff it, once the pelvis lists, is seen from afar.
const CARRIES_M: f64 = 0.01;
/// As bad as one another: a pace so far outside both gaits' own ...
const PACE_M_S: f64 = 0.2;
/// ... a height so far outside theirs ...
const HEIGHT_M: f64 = 0.02;
/// ... and a joint so far from its own cycle, rad.
const STRAYS_RAD: f64 = 0.4;
/// Instants about which legs are tried to go over.
const INSTANTS: usize = 9;
/// Of those so many are improved.
const BEGINS: usize = 4;
/// Times that all joints are gone through at most.
const SWEEPS: usize = 4;

/// Ways over of all degrees of freedom in which both legs' joints go over together, the best first; those of what
/// is no leg's are as they are given.
///
/// # Errors
/// As of chains of actionlets.
pub(super) fn together(
    lines: &[Line],
    choices: &[Choice],
    around: &Around,
    given: &[usize],
) -> Result<Vec<Vec<usize>>, Error> {
    let mut joints = Vec::with_capacity(6);
    for dof in LEGS.into_iter().flatten() {
        joints.push(Ways::of(&lines[dof.index()], &choices[dof.index()], around)?);
    }
    let legs = Legs::of(joints, around)?;
    let of_legs = LEGS.as_flattened().iter().map(|dof| given[dof.index()]);
    let mut begins = vec![Best::of(&legs, of_legs)];
    if let (Some(first_s), Some(last_s)) = (around.times_s.first(), around.times_s.last()) {
        let instants = |i: usize| first_s + (last_s - first_s) * i as f64 / (INSTANTS - 1) as f64;
        for left in (0..INSTANTS).map(instants) {
            for right in (0..INSTANTS).map(instants) {
                let about = |(joint, ways): (usize, &Ways)| {
                    ways.about(if joint < 3 { left } else { right })
                };
                begins.push(Best::of(&legs, legs.joints.iter().enumerate().map(about)));
            }
        }
    }
    begins.sort_by(|a, b| a.worth.total_cmp(&b.worth));
    begins.dedup_by(|a, b| a.ways == b.ways);
    begins.truncate(BEGINS);
    begins.iter_mut().for_each(|best| best.settles(&legs));
    begins.sort_by(|a, b| a.worth.total_cmp(&b.worth));
    begins.dedup_by(|a, b| a.ways == b.ways);
    let whole = |best: Best| {
        let mut ways = given.to_vec();
        for (dof, way) in LEGS.into_iter().flatten().zip(best.ways) {
            ways[dof.index()] = way;
        }
        ways
    };
    Ok(begins.into_iter().map(whole).collect())
}

/// What a joint may do.
struct Ways {
    /// Angles of each way, and how far it strays in parts of what is usual.
    each: Vec<(Vec<f64>, f64)>,
    /// The middle of each way over, s.
    middles_s: Vec<f64>,
    before_rad: Vec<f64>,
    after_rad: Vec<f64>,
}

impl Ways {
    fn of(line: &Line, choice: &Choice, around: &Around) -> Result<Self, Error> {
        let (before_rad, after_rad) = (around.angles(&line.chain()?), around.angles(&choice.after));
        let mut each = Vec::new();
        for (over, strays) in &choice.ways {
            let goes_rad = around.goes(over, &before_rad, &after_rad)?;
            each.push((goes_rad, strays / (STRAYS_RAD * STRAYS_RAD)));
        }
        if each.is_empty() {
            each.push((after_rad.clone(), 0.0));
        }
        let middles =
            choice.ways.iter().map(|(over, _)| f64::midpoint(over.left.at_s, over.joined.at_s));
        Ok(Self { each, middles_s: middles.collect(), before_rad, after_rad })
    }

    /// The way that goes over nearest to an instant.
    fn about(&self, time_s: f64) -> usize {
        let off = |middle_s: &f64| (middle_s - time_s).abs();
        let ways = self.middles_s.iter().enumerate();
        ways.min_by(|a, b| off(a.1).total_cmp(&off(b.1))).map_or(0, |(index, _)| index)
    }
}

/// Soles of a leg under its hip, seen from the side: x forward, y up, m.
struct Leg {
    thigh_m: f64,
    shank_m: f64,
    soles_m: [DVec2; 2],
}

impl Leg {
    fn soles_m(&self, [hip_rad, knee_rad, ankle_rad]: [f64; 3]) -> [DVec2; 2] {
        // An angle forward of a segment that hangs.
        let hanging = |length_m: f64, angle_rad: f64| {
            DVec2::new(angle_rad.sin(), -angle_rad.cos()) * length_m
        };
        let ankle_m = hanging(self.thigh_m, hip_rad) + hanging(self.shank_m, hip_rad - knee_rad);
        let foot = DVec2::from_angle(hip_rad - knee_rad + ankle_rad);
        self.soles_m.map(|sole_m| ankle_m + foot.rotate(sole_m))
    }
}

/// Both legs and what each gait does with them around the change.
struct Legs {
    leg: Leg,
    joints: Vec<Ways>,
    step_s: f64,
    /// Least and greatest pace, m/s, and height of the hips, m, of both gaits by sample.
    between: Vec<[(f64, f64); 2]>,
}

impl Legs {
    fn of(joints: Vec<Ways>, around: &Around) -> Result<Self, Error> {
        let body = Proportions::of_stature(STATURE_M)?;
        let length_m =
            |joint| body.joint_offset_m(joint).map_or(0.0, |(_, offset_m)| offset_m.length());
        let sole_m = |end| {
            let (_, offset_m) = body.end_offset_m(end);
            DVec2::new(offset_m.x, offset_m.z)
        };
        let leg = Leg {
            thigh_m: length_m(Joint::LeftKnee),
            shank_m: length_m(Joint::LeftAnkle),
            soles_m: [sole_m(End::LeftHeel), sole_m(End::LeftToe)],
        };
        let step_s = around.times_s.get(1).map_or(1.0, |second_s| second_s - around.times_s[0]);
        let mut legs = Self { leg, joints, step_s, between: Vec::new() };
        let before = legs.travels(
            &legs.joints.iter().map(|ways| ways.before_rad.as_slice()).collect::<Vec<_>>(),
        );
        let after = legs
            .travels(&legs.joints.iter().map(|ways| ways.after_rad.as_slice()).collect::<Vec<_>>());
        let between =
            |(a, b): (&[f64; 2], &[f64; 2])| [0, 1].map(|i| (a[i].min(b[i]), a[i].max(b[i])));
        legs.between = before.iter().zip(&after).map(between).collect();
        Ok(legs)
    }

    /// Pace over the soles that carry, m/s, and height of the hips, m, by sample.
    fn travels(&self, angles_rad: &[&[f64]]) -> Vec<[f64; 2]> {
        let soles_m = |sample: usize| {
            let leg = |leg: usize| [0, 1, 2].map(|joint| angles_rad[3 * leg + joint][sample]);
            let ([a, b], [c, d]) = (self.leg.soles_m(leg(0)), self.leg.soles_m(leg(1)));
            [a, b, c, d]
        };
        let lowest =
            |soles_m: &[DVec2; 4]| soles_m.iter().map(|sole| sole.y).fold(f64::MAX, f64::min);
        let mut last_m = soles_m(0);
        let count = angles_rad.iter().map(|angles| angles.len()).min().unwrap_or(0);
        let travels = (1..count).map(|sample| {
            let now_m = soles_m(sample);
            let (low_last_m, low_m) = (lowest(&last_m), lowest(&now_m));
            let (mut moved_m, mut carry) = (0.0, 0.0);
            for (last, now) in last_m.iter().zip(&now_m) {
                let height_m = f64::midpoint(last.y - low_last_m, now.y - low_m);
                let part = (-height_m / CARRIES_M).exp();
                moved_m += (last.x - now.x) * part;
                carry += part;
            }
            last_m = now_m;
            [moved_m / carry / self.step_s, -low_m]
        });
        travels.collect()
    }

    /// How bad these ways are together.
    fn worth(&self, ways: &[usize]) -> f64 {
        let chosen = self.joints.iter().zip(ways).map(|(ways, way)| &ways.each[*way]);
        let strays: f64 = chosen.clone().map(|(_, strays)| strays).sum();
        let angles: Vec<&[f64]> = chosen.map(|(angles_rad, _)| angles_rad.as_slice()).collect();
        let off =
            |value: f64, (least, most): (f64, f64)| (least - value).max(value - most).max(0.0);
        let travels = self.travels(&angles);
        let outside = travels.iter().zip(&self.between).map(|(travels, between)| {
            let pace = off(travels[0], between[0]) / PACE_M_S;
            let height = off(travels[1], between[1]) / HEIGHT_M;
            pace * pace + height * height
        });
        strays + outside.sum::<f64>()
    }
}

/// The best ways so far.
struct Best {
    ways: Vec<usize>,
    worth: f64,
}

impl Best {
    fn of(legs: &Legs, ways: impl Iterator<Item = usize>) -> Self {
        let ways: Vec<usize> = ways.collect();
        let worth = legs.worth(&ways);
        Self { ways, worth }
    }

    /// Improved joint by joint, and then two joints of a leg at a time, as far as that goes.
    fn settles(&mut self, legs: &Legs) {
        for _ in 0..SWEEPS {
            let before = self.worth;
            for joint in 0..legs.joints.len() {
                self.improves(legs, &[joint]);
            }
            for leg in [0, 3] {
                for [a, b] in [[0, 1], [1, 2], [0, 2]] {
                    self.improves(legs, &[leg + a, leg + b]);
                }
            }
            if self.worth >= before {
                break;
            }
        }
    }

    fn tries(&mut self, legs: &Legs, ways: Vec<usize>) {
        let worth = legs.worth(&ways);
        if worth < self.worth {
            *self = Self { ways, worth };
        }
    }

    /// Tries every way of some joints together while the others stay.
    fn improves(&mut self, legs: &Legs, joints: &[usize]) {
        let Some((joint, others)) = joints.split_first() else { return };
        for way in 0..legs.joints[*joint].each.len() {
            let mut ways = self.ways.clone();
            ways[*joint] = way;
            match others {
                [] => self.tries(legs, ways),
                [other, ..] => {
                    for way in 0..legs.joints[*other].each.len() {
                        let mut ways = ways.clone();
                        ways[*other] = way;
                        self.tries(legs, ways);
                    }
                }
            }
        }
    }
}
