//! Pose states, frame by frame, as flat rows of numbers: Salamah and Brunnett's Eqs. 1 to 17 and Table 1,
//! and measures of our own that make models independent of who is seen. Motions are in limb lengths
//! per second, legs for root, torso and feet, arms for hands; true is 1, false is 0, and what the
//! source does not show is not a number, so that nothing compares with it.
//!
//! Strictly read, a motion is the difference of two frames. Repaired, it is the line through
//! all frames of [`WINDOW_S`] that fits them best, so that noise does not hide it at high rates; it comes half of that later.

use super::contact::{Contacts, Floor, Known};
use super::points::{Axes, BodyPoint, Lengths, Points};
use super::posture::{EquationReading, MajorPosture, PostureState, posture};
use glam::DVec3;
use std::collections::VecDeque;

/// Time over which velocities are taken, s.
pub const WINDOW_S: f64 = 1.0 / 15.0;
/// What is slower counts as still where noise is less, limb lengths per second (ours).
const STILL_L_S: f64 = 0.15;
/// So long may Eqs. 3 to 5 fail before a way begins anew, s (ours).
const WAY_GAP_S: f64 = 0.4;

/// Parts whose motion is described, with the limb that measures it.
const PARTS: [(&str, BodyPoint, bool); 6] = [
    ("root", BodyPoint::Root, false),
    ("torso", BodyPoint::Chest, false),
    ("left_hand", BodyPoint::LeftHand, true),
    ("right_hand", BodyPoint::RightHand, true),
    ("left_foot", BodyPoint::LeftFoot, false),
    ("right_foot", BodyPoint::RightFoot, false),
];
const AXES: [&str; 3] = ["frontal", "vertical", "sagittal"];

/// Features but postures and motions, with the one that mirrors it and the sign it has there.
const NAMED: [(&str, &str, f64); 46] = [
    ("dynamic", "dynamic", 1.0),
    ("locomotive", "locomotive", 1.0),
    ("upright", "upright", 1.0),
    ("on_floor", "on_floor", 1.0),
    ("symmetric", "symmetric", 1.0),
    ("on_belly", "on_belly", 1.0),
    ("on_back", "on_back", 1.0),
    ("sideways", "sideways", 1.0),
    ("flight", "flight", 1.0),
    ("left_foot_contact", "right_foot_contact", 1.0),
    ("right_foot_contact", "left_foot_contact", 1.0),
    ("left_knee_contact", "right_knee_contact", 1.0),
    ("right_knee_contact", "left_knee_contact", 1.0),
    ("left_hand_contact", "right_hand_contact", 1.0),
    ("right_hand_contact", "left_hand_contact", 1.0),
    ("left_hip_contact", "right_hip_contact", 1.0),
    ("right_hip_contact", "left_hip_contact", 1.0),
    ("left_hand_height", "right_hand_height", 1.0),
    ("right_hand_height", "left_hand_height", 1.0),
    ("left_hand_ahead", "right_hand_ahead", 1.0),
    ("right_hand_ahead", "left_hand_ahead", 1.0),
    ("left_hand_out", "right_hand_out", 1.0),
    ("right_hand_out", "left_hand_out", 1.0),
    ("left_hand_to_head", "right_hand_to_head", 1.0),
    ("right_hand_to_head", "left_hand_to_head", 1.0),
    ("hands_apart", "hands_apart", 1.0),
    ("feet_apart", "feet_apart", 1.0),
    ("left_foot_leads", "left_foot_leads", -1.0),
    ("trunk_lean_deg", "trunk_lean_deg", 1.0),
    ("hips_height", "hips_height", 1.0),
    ("left_leg", "right_leg", 1.0),
    ("right_leg", "left_leg", 1.0),
    ("left_knee_height", "right_knee_height", 1.0),
    ("right_knee_height", "left_knee_height", 1.0),
    ("left_foot_height", "right_foot_height", 1.0),
    ("right_foot_height", "left_foot_height", 1.0),
    ("root_speed", "root_speed", 1.0),
    ("left_hand_speed", "right_hand_speed", 1.0),
    ("right_hand_speed", "left_hand_speed", 1.0),
    ("left_foot_speed", "right_foot_speed", 1.0),
    ("right_foot_speed", "left_foot_speed", 1.0),
    ("left_hand_across", "right_hand_across", 1.0),
    ("right_hand_across", "left_hand_across", 1.0),
    ("left_hand_lift", "right_hand_lift", 1.0),
    ("right_hand_lift", "left_hand_lift", 1.0),
    ("turning_deg_s", "turning_deg_s", -1.0),
];

const MOVES: usize = MajorPosture::ALL.len();
const FIRST_NAMED: usize = MOVES + PARTS.len() * AXES.len();
/// How many features there are.
pub const FEATURES: usize = FIRST_NAMED + NAMED.len();

/// One of the numbers of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Feature(u8);

/// The part of a body whose motion is described, by its place in [`Feature::parts`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MovingPart(u8);

/// An axis of a body: Table 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BodyAxis {
    /// Forward and backward.
    Frontal,
    /// Up and down.
    Vertical,
    /// Left and right.
    Sagittal,
}

impl Feature {
    /// That this posture is the major one.
    #[must_use]
    pub const fn posture(posture: MajorPosture) -> Self {
        Self(posture as u8)
    }

    /// The motion of a part along an axis, limb lengths per second.
    #[must_use]
    pub const fn moving(part: MovingPart, axis: BodyAxis) -> Self {
        Self(MOVES as u8 + 3 * part.0 + axis as u8)
    }

    /// The feature of this name, postures and motions (`right_foot_frontal`) among them.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        Self::all().find(|feature| feature.name() == name)
    }

    /// All features.
    pub fn all() -> impl Iterator<Item = Self> {
        (0..FEATURES as u8).map(Self)
    }

    /// The parts whose motion is described, by name.
    pub fn parts() -> impl Iterator<Item = (&'static str, MovingPart)> {
        (0u8..).zip(PARTS).map(|(index, (name, ..))| (name, MovingPart(index)))
    }

    /// Of the motion of a part along an axis: the part, the axis, and the words for its two directions.
    #[must_use]
    pub fn axis_words(self) -> Option<(&'static str, &'static str, [&'static str; 2])> {
        const DIRECTIONS: [[&str; 2]; 3] =
            [["forward", "backward"], ["up", "down"], ["left", "right"]];
        let moving = self.index().checked_sub(MOVES)?;
        let (part, ..) = PARTS.get(moving / 3)?;
        Some((part, AXES[moving % 3], DIRECTIONS[moving % 3]))
    }

    /// Its place in a row.
    #[must_use]
    pub const fn index(self) -> usize {
        self.0 as usize
    }

    /// Its name in models.
    #[must_use]
    pub fn name(self) -> String {
        let index = self.index();
        if let Some(posture) = MajorPosture::ALL.get(index) {
            return posture.word().to_owned();
        }
        match index.checked_sub(FIRST_NAMED) {
            Some(named) => NAMED[named].0.to_owned(),
            None => {
                let moving = index - MOVES;
                format!("{}_{}", PARTS[moving / 3].0, AXES[moving % 3])
            }
        }
    }

    /// What it is when left and right are exchanged, and the sign it then has.
    #[must_use]
    pub fn mirrored(self) -> (Self, f64) {
        let index = self.index();
        if index < MOVES {
            return (self, 1.0);
        }
        if index >= FIRST_NAMED {
            let (_, other, sign) = NAMED[index - FIRST_NAMED];
            let at = NAMED.iter().position(|(name, ..)| *name == other).unwrap_or(0);
            return (Self((FIRST_NAMED + at) as u8), sign);
        }
        let (part, axis) = ((index - MOVES) / 3, (index - MOVES) % 3);
        let other = match part {
            2 | 4 => part + 1,
            3 | 5 => part - 1,
            part => part,
        };
        (Self((MOVES + 3 * other + axis) as u8), if axis == 2 { -1.0 } else { 1.0 })
    }
}

/// The features of one frame.
#[derive(Clone, Debug, PartialEq)]
pub struct FeatureRow {
    /// By [`Feature::index`]; not a number where unknown.
    pub values: [f64; FEATURES],
    /// Since the frame before, s.
    pub dt_s: f64,
}

impl FeatureRow {
    /// A frame of which nothing is known.
    #[must_use]
    pub const fn unknown(dt_s: f64) -> Self {
        Self { values: [f64::NAN; FEATURES], dt_s }
    }

    /// A feature; not a number where unknown.
    #[must_use]
    pub const fn value(&self, feature: Feature) -> f64 {
        self.values[feature.index()]
    }
}

/// The place of a named feature in a row, found while the program is compiled.
const fn at(name: &str) -> usize {
    let name = name.as_bytes();
    let mut index = 0;
    while index < NAMED.len() {
        let other = NAMED[index].0.as_bytes();
        let mut same = 0;
        while same < name.len() && same < other.len() && name[same] == other[same] {
            same += 1;
        }
        if same == name.len() && same == other.len() {
            return FIRST_NAMED + index;
        }
        index += 1;
    }
    panic!("no such feature")
}

/// Sets a named feature of a row.
macro_rules! set {
    ($row:expr, $name:literal, $value:expr) => {
        $row.values[const { at($name) }] = $value
    };
}

/// The noise of a source (Eq. 2): how far a point moves in a frame in which nothing moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// Along one axis, m; what Eq. 1 compares with.
    pub axis_m: f64,
    /// In space, m; what Eqs. 3 to 5 compare with where they are repaired.
    pub norm_m: f64,
    /// Frames per second at which this is so: noise per frame depends on it.
    pub rate_hz: f64,
}

impl Noise {
    /// Of a source in which somebody stands still for half a second: of its quietest one. None if it is shorter.
    /// Where nobody ever stands still this is motion and not noise; see [`Self::is_still`].
    #[must_use]
    pub fn of_quietest(frames: &[Points], rate_hz: f64) -> Option<Self> {
        let window = (0.5 * rate_hz).round().max(1.0) as usize;
        let steps: Vec<(f64, f64)> =
            frames.windows(2).map(|pair| step(&pair[0], &pair[1])).collect();
        let most = |steps: &[(f64, f64)]| {
            steps
                .iter()
                .fold((0.0, 0.0), |most: (f64, f64), step| (most.0.max(step.0), most.1.max(step.1)))
        };
        let quietest = steps.windows(window).map(most).min_by(|a, b| a.1.total_cmp(&b.1))?;
        Some(Self { axis_m: quietest.0, norm_m: quietest.1, rate_hz })
    }

    /// Whether it can be noise: slower than what counts as still.
    #[must_use]
    pub fn is_still(&self, lengths: &Lengths) -> bool {
        self.norm_m * self.rate_hz <= STILL_L_S * lengths.leg_m()
    }
}

/// The largest motion from one frame to the next, along an axis and in space, m; toes are not looked at.
fn step(from: &Points, to: &Points) -> (f64, f64) {
    let moved = BodyPoint::ALL[..11].iter().map(|place| to[*place] - from[*place]);
    moved.filter(|d| d.is_finite()).fold((0.0, 0.0), |most: (f64, f64), d| {
        (most.0.max(d.abs().max_element()), most.1.max(d.length()))
    })
}

/// Makes rows of features of frames as they come, in memory that does not grow.
#[derive(Clone, Debug)]
pub struct Extractor {
    lengths: Lengths,
    reading: EquationReading,
    noise: Option<Noise>,
    floor: Floor,
    before: VecDeque<(f64, Points)>,
    time_s: f64,
    way_m: DVec3,
    without_way_s: f64,
}

impl Extractor {
    /// For a body of these lengths. Without `noise` only what is slower than a person who stands still
    /// counts as still.
    #[must_use]
    pub fn new(lengths: Lengths, reading: EquationReading, noise: Option<Noise>) -> Self {
        let noise = noise.filter(|noise| noise.is_still(&lengths));
        Self {
            lengths,
            reading,
            noise,
            floor: Floor::new(lengths),
            before: VecDeque::new(),
            time_s: 0.0,
            way_m: DVec3::ZERO,
            without_way_s: f64::INFINITY,
        }
    }

    /// The next frame is not one that follows on the last: nothing of what moves goes across. The floor stays.
    pub fn interrupt(&mut self) {
        self.before.clear();
        self.without_way_s = f64::INFINITY;
    }

    /// The next frame, so long after the last, s.
    pub fn next(&mut self, points: &Points, dt_s: f64) -> FeatureRow {
        self.time_s += dt_s;
        let window_s = match self.reading {
            EquationReading::Repaired => WINDOW_S,
            EquationReading::Strict => 0.0,
        };
        // The youngest frame that is at least the window old; the first has none before it.
        while self.before.len() > 1
            && self.before.get(1).is_some_and(|(at_s, _)| self.time_s - at_s >= window_s - 1e-9)
        {
            self.before.pop_front();
        }
        let velocities = self.velocities(points);
        let last = self.before.back().map(|(_, last)| *last);
        self.before.push_back((self.time_s, *points));
        let at_rest = Points(velocities.0.map(|v| if v.is_nan() { DVec3::ZERO } else { v }));
        let contacts = self.floor.next(points, &at_rest, dt_s);
        let axes = Axes::of(points);
        let state = posture(points, &axes, &self.lengths, &contacts, self.reading);
        let mut row = FeatureRow::unknown(dt_s);
        self.write_postures(&mut row, &state);
        self.write_moves(&mut row, &axes, &velocities);
        write_contacts(&mut row, &contacts);
        self.write_measures(&mut row, points, &axes, &contacts);
        set!(row, "dynamic", truth(self.dynamic(points, last.as_ref(), &velocities)));
        set!(row, "locomotive", truth(self.locomotive(&velocities, dt_s)));
        row
    }

    /// The slope of the line through all frames of the window that has the least squares: of two frames their difference,
    /// of more it takes noise out of each.
    fn velocities(&self, points: &Points) -> Points {
        let frames = self.before.len() as f64 + 1.0;
        let sum_s: f64 = self.before.iter().map(|(at_s, _)| at_s - self.time_s).sum();
        let mean_s = self.time_s + sum_s / frames;
        let earlier = self.before.iter().map(|(at_s, _)| (at_s - mean_s).powi(2));
        let squares_s2 = earlier.sum::<f64>() + (self.time_s - mean_s).powi(2);
        if !(squares_s2 > 0.0) {
            return Points([DVec3::NAN; 13]);
        }
        let share = |at_s: f64| (at_s - mean_s) / squares_s2;
        let mut slope = points.0.map(|at| at * share(self.time_s));
        for (at_s, before) in &self.before {
            let share = share(*at_s);
            for (slope, at) in slope.iter_mut().zip(&before.0) {
                *slope += *at * share;
            }
        }
        Points(slope)
    }

    fn write_postures(&self, row: &mut FeatureRow, state: &PostureState) {
        for (value, posture) in row.values.iter_mut().zip(MajorPosture::ALL) {
            *value = state.major.map_or(f64::NAN, |major| f64::from(u8::from(major == posture)));
        }
        set!(row, "upright", truth(state.upright));
        set!(row, "on_floor", truth(state.on_floor));
        set!(row, "symmetric", truth(state.symmetric));
        set!(row, "on_belly", truth(state.on_belly));
        set!(row, "on_back", truth(state.on_back));
        set!(row, "sideways", truth(state.sideways));
    }

    /// Table 1.
    fn write_moves(&self, row: &mut FeatureRow, axes: &Axes, velocities: &Points) {
        for (part, (_, place, is_hand)) in PARTS.into_iter().enumerate() {
            let limb_m = if is_hand { self.lengths.arm_m } else { self.lengths.leg_m() };
            let in_limbs = velocities[place] * (1.0 / limb_m);
            for (axis, along) in [axes.forward, axes.up, axes.left].into_iter().enumerate() {
                row.values[MOVES + 3 * part + axis] = in_limbs.dot(along);
            }
        }
        let speed = |place: BodyPoint, limb_m: f64| velocities[place].length() / limb_m;
        let (arm_m, leg_m) = (self.lengths.arm_m, self.lengths.leg_m());
        set!(row, "root_speed", velocities[BodyPoint::Root].truncate().length() / leg_m);
        set!(row, "left_hand_speed", speed(BodyPoint::LeftHand, arm_m));
        set!(row, "right_hand_speed", speed(BodyPoint::RightHand, arm_m));
        set!(row, "left_foot_speed", speed(BodyPoint::LeftFoot, leg_m));
        set!(row, "right_foot_speed", speed(BodyPoint::RightFoot, leg_m));
        // Of the hands against the trunk: what somebody who walks does with them.
        let against_chest =
            |place: BodyPoint| (velocities[place] - velocities[BodyPoint::Chest]) / arm_m;
        let [left, right] = [BodyPoint::LeftHand, BodyPoint::RightHand].map(against_chest);
        set!(row, "left_hand_across", left.dot(axes.left));
        set!(row, "right_hand_across", right.dot(-axes.left));
        set!(row, "left_hand_lift", left.z);
        set!(row, "right_hand_lift", right.z);
        // To the left: the left hip goes back against the right one.
        let hips = velocities[BodyPoint::RightHip] - velocities[BodyPoint::LeftHip];
        set!(row, "turning_deg_s", (hips.dot(axes.forward) / self.lengths.hips_m).to_degrees());
    }

    fn write_measures(
        &self,
        row: &mut FeatureRow,
        points: &Points,
        axes: &Axes,
        contacts: &Contacts,
    ) {
        let (arm_m, leg_m) = (self.lengths.arm_m, self.lengths.leg_m());
        let chest = points[BodyPoint::Chest];
        let left = (points[BodyPoint::LeftHand] - chest) / arm_m;
        let right = (points[BodyPoint::RightHand] - chest) / arm_m;
        set!(row, "left_hand_height", left.z);
        set!(row, "right_hand_height", right.z);
        set!(row, "left_hand_ahead", left.dot(axes.forward));
        set!(row, "right_hand_ahead", right.dot(axes.forward));
        set!(row, "left_hand_out", left.dot(axes.left));
        set!(row, "right_hand_out", right.dot(-axes.left));
        let head = points[BodyPoint::Head];
        set!(row, "left_hand_to_head", points[BodyPoint::LeftHand].distance(head) / arm_m);
        set!(row, "right_hand_to_head", points[BodyPoint::RightHand].distance(head) / arm_m);
        set!(
            row,
            "hands_apart",
            points[BodyPoint::LeftHand].distance(points[BodyPoint::RightHand]) / arm_m
        );
        let feet = points[BodyPoint::LeftFoot] - points[BodyPoint::RightFoot];
        set!(row, "feet_apart", feet.dot(axes.left) / leg_m);
        set!(row, "left_foot_leads", feet.dot(axes.forward) / leg_m);
        let trunk = chest - points[BodyPoint::Root];
        set!(row, "trunk_lean_deg", trunk.angle_between(DVec3::Z).to_degrees());
        set!(row, "hips_height", (points[BodyPoint::Root].z - contacts.floor_m) / leg_m);
        let leg = |hip: BodyPoint, foot: BodyPoint| points[hip].distance(points[foot]) / leg_m;
        set!(row, "left_leg", leg(BodyPoint::LeftHip, BodyPoint::LeftFoot));
        set!(row, "right_leg", leg(BodyPoint::RightHip, BodyPoint::RightFoot));
        let knee = |hip: BodyPoint, knee: BodyPoint| {
            (points[knee].z - points[hip].z) / self.lengths.femur_m
        };
        set!(row, "left_knee_height", knee(BodyPoint::LeftHip, BodyPoint::LeftKnee));
        set!(row, "right_knee_height", knee(BodyPoint::RightHip, BodyPoint::RightKnee));
        let foot = |foot: BodyPoint| (points[foot].z - contacts.floor_m) / leg_m;
        set!(row, "left_foot_height", foot(BodyPoint::LeftFoot));
        set!(row, "right_foot_height", foot(BodyPoint::RightFoot));
    }

    /// Eq. 1.
    fn dynamic(&self, points: &Points, last: Option<&Points>, velocities: &Points) -> Known {
        match self.reading {
            EquationReading::Strict => {
                let eps_m = self.noise.map_or(0.0, |noise| noise.axis_m);
                Some(step(last?, points).0 > eps_m)
            }
            EquationReading::Repaired => {
                let known = velocities.0[..11].iter().map(|velocity| velocity.length_squared());
                let fastest = known.filter(|speed| speed.is_finite()).reduce(f64::max)?;
                Some(fastest.sqrt() > self.still_m_s())
            }
        }
    }

    /// What is slower stands still, m/s.
    fn still_m_s(&self) -> f64 {
        let noise_m_s = self.noise.map_or(0.0, |noise| match self.reading {
            EquationReading::Strict => noise.axis_m * noise.rate_hz,
            EquationReading::Repaired => noise.norm_m * noise.rate_hz,
        });
        match self.reading {
            EquationReading::Strict => noise_m_s,
            EquationReading::Repaired => noise_m_s.max(STILL_L_S * self.lengths.leg_m()),
        }
    }

    /// Eqs. 3 to 5, and the way of the root since they began to hold.
    fn locomotive(&mut self, velocities: &Points, dt_s: f64) -> Known {
        let still_m_s = self.still_m_s();
        let root = velocities[BodyPoint::Root];
        let feet = [velocities[BodyPoint::LeftFoot], velocities[BodyPoint::RightFoot]];
        if root.is_nan() || feet.iter().any(|foot| foot.is_nan()) {
            return None;
        }
        let moves = |v: DVec3| v.length() > still_m_s;
        let with = feet.map(|foot| moves(foot) && foot.dot(root) > 0.0);
        let fixed = feet.map(|foot| !moves(foot));
        let goes = moves(root)
            && match (with, fixed) {
                ([true, true], _) => true,
                ([true, false], [_, other]) => other,
                ([false, true], [other, _]) => other,
                ([false, false], _) => false,
            };
        if goes {
            if self.without_way_s > WAY_GAP_S {
                self.way_m = DVec3::ZERO;
            }
            self.without_way_s = 0.0;
        } else {
            self.without_way_s += dt_s;
        }
        let is_under_way = self.without_way_s <= WAY_GAP_S;
        if is_under_way {
            self.way_m += root * dt_s;
        }
        Some(is_under_way && self.way_m.length() > self.lengths.tibia_m)
    }
}

fn truth(known: Known) -> f64 {
    known.map_or(f64::NAN, |known| f64::from(u8::from(known)))
}

fn write_contacts(row: &mut FeatureRow, contacts: &Contacts) {
    let Contacts { feet, knees, hands, hips, .. } = contacts;
    set!(row, "left_foot_contact", truth(feet[0]));
    set!(row, "right_foot_contact", truth(feet[1]));
    set!(row, "left_knee_contact", truth(knees[0]));
    set!(row, "right_knee_contact", truth(knees[1]));
    set!(row, "left_hand_contact", truth(hands[0]));
    set!(row, "right_hand_contact", truth(hands[1]));
    set!(row, "left_hip_contact", truth(hips[0]));
    set!(row, "right_hip_contact", truth(hips[1]));
    let flight = match feet {
        [Some(left), Some(right)] => Some(!left && !right),
        _ => None,
    };
    set!(row, "flight", truth(flight));
}

#[cfg(test)]
mod tests;
