//! A person as a page draws it: segments, what of the feet carries, the centre of mass, and how hard the floor
//! pushes.

use super::PLACE_M;
use super::series::Coded;
use super::tracks::SampleClock;
use crate::body::contact::{self, Footing};
use crate::body::mass::{centre_of_mass_m, segment_masses};
use crate::body::root::SOLES;
use crate::body::{End, Joint, Segment, SegmentPose};
use crate::mocap::scene::{DrawnFeet, Scene};
use glam::{DQuat, DVec3};
use serde::Serialize;

/// Poses per second the page draws at most.
const MOST_HZ: f64 = 60.0;
/// What parts of quaternions are rounded to.
const TURN: f64 = 1e-3;
/// What forces are rounded to, body weights.
const FORCE: f64 = 1e-3;

/// The number of a joint's point, and of an end's: joints first.
const fn joint(joint: Joint) -> usize {
    joint.index()
}

const fn end(end: End) -> usize {
    Joint::ALL.len() + end as usize
}

/// Lines drawn, between points: of the middle, of the left side, of the right.
const LINES: [&[(usize, usize)]; 3] = [
    &[
        (joint(Joint::Pelvis), joint(Joint::Torso)),
        (joint(Joint::Torso), joint(Joint::Neck)),
        (joint(Joint::LeftShoulder), joint(Joint::RightShoulder)),
        (joint(Joint::LeftHip), joint(Joint::RightHip)),
        (joint(Joint::Torso), joint(Joint::LeftHip)),
        (joint(Joint::Torso), joint(Joint::RightHip)),
    ],
    &[
        (joint(Joint::LeftShoulder), joint(Joint::LeftElbow)),
        (joint(Joint::LeftElbow), joint(Joint::LeftWrist)),
        (joint(Joint::LeftWrist), end(End::LeftFingertip)),
        (joint(Joint::LeftHip), joint(Joint::LeftKnee)),
        (joint(Joint::LeftKnee), joint(Joint::LeftAnkle)),
        (joint(Joint::LeftAnkle), end(End::LeftHeel)),
        (end(End::LeftHeel), end(End::LeftToe)),
        (end(End::LeftToe), joint(Joint::LeftAnkle)),
    ],
    &[
        (joint(Joint::RightShoulder), joint(Joint::RightElbow)),
        (joint(Joint::RightElbow), joint(Joint::RightWrist)),
        (joint(Joint::RightWrist), end(End::RightFingertip)),
        (joint(Joint::RightHip), joint(Joint::RightKnee)),
        (joint(Joint::RightKnee), joint(Joint::RightAnkle)),
        (joint(Joint::RightAnkle), end(End::RightHeel)),
        (end(End::RightHeel), end(End::RightToe)),
        (end(End::RightToe), joint(Joint::RightAnkle)),
    ],
];

/// A person over time.
#[derive(Clone, Debug, Serialize)]
pub struct PersonTrack {
    /// When the poses are.
    pub clock: SampleClock,
    /// Height from sole to crown, m.
    pub(super) stature_m: f64,
    /// Places of joints and ends.
    pub(super) points: Vec<[Coded; 3]>,
    /// Numbers of points between which lines are drawn: of the middle, the left, the right side.
    pub(super) lines: [&'static [(usize, usize)]; 3],
    /// Numbers of the neck and the crown.
    pub(super) head: [usize; 2],
    /// Numbers of left heel and toe, right heel and toe.
    pub(super) soles: [usize; 4],
    /// Of the soles on the floor the sum of 1, 2, 4, 8; absent if nobody captured feet.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) contacts: Option<Coded>,
    /// The centre of mass.
    pub(super) centre: [Coded; 3],
    /// What the soles on the floor span; absent if nobody captured feet.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) support: Option<Support>,
    /// Sensors that are worn.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    sensors: Vec<SensorTrack>,
    /// How hard the floor pushes, body weights; absent where poses are too far apart to tell.
    #[serde(skip_serializing_if = "Option::is_none")]
    force: Option<Coded>,
}

/// A sensor that somebody wears.
#[derive(Clone, Debug, Serialize)]
struct SensorTrack {
    /// Its name.
    name: String,
    /// It is drawn between these two points.
    between: [usize; 2],
    /// How it is turned: w, x, y, z; not a number while it says nothing.
    turn: [Coded; 4],
}

/// A sensor that somebody wears, as it is drawn.
#[derive(Clone, Debug, PartialEq)]
pub struct DrawnSensor {
    /// Its name.
    pub name: String,
    /// Who wears it.
    pub segment: Segment,
    /// How it is turned in each pose of the scene; `None` while it says nothing.
    pub turns: Vec<Option<DQuat>>,
}

/// The points between which a segment is.
const fn ends(segment: Segment) -> [usize; 2] {
    use {End as E, Joint as J, Segment as S};
    match segment {
        S::Pelvis => [joint(J::LeftHip), joint(J::RightHip)],
        S::Torso => [joint(J::Torso), joint(J::Neck)],
        S::Head => [joint(J::Neck), end(E::HeadTop)],
        S::LeftUpperArm => [joint(J::LeftShoulder), joint(J::LeftElbow)],
        S::LeftForearm => [joint(J::LeftElbow), joint(J::LeftWrist)],
        S::RightUpperArm => [joint(J::RightShoulder), joint(J::RightElbow)],
        S::RightForearm => [joint(J::RightElbow), joint(J::RightWrist)],
        S::LeftThigh => [joint(J::LeftHip), joint(J::LeftKnee)],
        S::LeftShank => [joint(J::LeftKnee), joint(J::LeftAnkle)],
        S::LeftFoot => [joint(J::LeftAnkle), end(E::LeftToe)],
        S::RightThigh => [joint(J::RightHip), joint(J::RightKnee)],
        S::RightShank => [joint(J::RightKnee), joint(J::RightAnkle)],
        S::RightFoot => [joint(J::RightAnkle), end(E::RightToe)],
    }
}

/// Corners of an area on the floor, pose by pose.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Support {
    /// How many of each pose.
    pub(super) counts: Coded,
    /// Of all of them, one pose after the other.
    pub(super) x: Coded,
    pub(super) y: Coded,
}

/// The series of places.
pub fn places(places_m: &[DVec3], quantum_m: f64) -> [Coded; 3] {
    [0, 1, 2].map(|axis| Coded::of(places_m.iter().map(|place_m| place_m[axis]), quantum_m))
}

/// Every so manyth pose is drawn.
fn thinned(rate_hz: f64) -> usize {
    // Rates of captures are a little off what they are meant to be: a frame takes 0.008333 s.
    (rate_hz / MOST_HZ - 0.01).ceil().max(1.0) as usize
}

impl PersonTrack {
    /// The same with sensors, told as the poses of [`PersonTrack::of`] are, so many times a second.
    #[must_use]
    pub fn wearing(mut self, sensors: Vec<DrawnSensor>, rate_hz: f64) -> Self {
        let every = thinned(rate_hz);
        let track = |sensor: DrawnSensor| {
            let drawn: Vec<[f64; 4]> = (sensor.turns.iter().step_by(every))
                .map(|turn| turn.map_or([f64::NAN; 4], |turn| [turn.w, turn.x, turn.y, turn.z]))
                .collect();
            SensorTrack {
                name: sensor.name,
                between: ends(sensor.segment),
                turn: [0, 1, 2, 3].map(|k| Coded::of(drawn.iter().map(|turn| turn[k]), TURN)),
            }
        };
        self.sensors = sensors.into_iter().map(track).collect();
        self
    }

    /// The same from this time of the scene on, s.
    #[must_use]
    pub fn from(mut self, late_s: f64) -> Self {
        if late_s > 0.0 {
            let times_s: Vec<f64> = self.clock.times_s().iter().map(|at_s| at_s + late_s).collect();
            self.clock = SampleClock::of(&times_s);
        }
        self
    }

    /// A person whose poses are thinned to as many a second as are drawn; the floor of the scene is at zero.
    #[must_use]
    pub fn of(scene: &Scene<'_>) -> Self {
        let every = thinned(scene.rate_hz);
        let over_floor = |pose: &SegmentPose| {
            let root_m = pose.root_m - DVec3::Z * scene.floor_m;
            SegmentPose { root_m, ..pose.clone() }
        };
        let poses: Vec<SegmentPose> = scene.poses.iter().map(over_floor).collect();
        let forces = Footing::of(scene.body, &poses, scene.rate_hz).ok();
        let forces = forces.map(|footing| {
            let drawn = footing.force_body_weights().iter().step_by(every).copied();
            Coded::of(drawn, FORCE)
        });
        let on_floor = Scene { poses: &poses, floor_m: 0.0, ..*scene };
        let carries: Option<Vec<[bool; 4]>> =
            on_floor.carries().map(|all| all.into_iter().step_by(every).collect());
        let drawn: Vec<SegmentPose> = poses.into_iter().step_by(every).collect();
        let rate_hz = scene.rate_hz / every as f64;
        let clock = SampleClock::Even { rate_hz, count: drawn.len() };
        Self { force: forces, ..Self::drawn(scene, clock, &drawn, carries.as_deref()) }
    }

    /// A person of the scene in other poses, over the floor: those it is drawn in, and what of the feet carries in them,
    /// where that is known.
    #[must_use]
    pub fn drawn(
        scene: &Scene<'_>,
        clock: SampleClock,
        poses: &[SegmentPose],
        carries: Option<&[[bool; 4]]>,
    ) -> Self {
        let masses = segment_masses(scene.body);
        let mut points_m = vec![Vec::with_capacity(poses.len()); Joint::ALL.len() + End::ALL.len()];
        let (mut contacts, mut counts, mut corners_m) = (Vec::new(), Vec::new(), Vec::new());
        let mut centres_m = Vec::with_capacity(poses.len());
        for (n, pose) in poses.iter().enumerate() {
            let at = scene.body.positions(pose);
            for (point, place_m) in points_m.iter_mut().zip(at.joints_m.iter().chain(&at.ends_m)) {
                point.push(*place_m);
            }
            centres_m.push(centre_of_mass_m(scene.body, &masses, pose));
            let Some(carries) = carries.and_then(|carries| carries.get(n)) else { continue };
            let sum = carries.iter().zip([1.0, 2.0, 4.0, 8.0]);
            contacts.push(sum.map(|(is, bit)| if *is { bit } else { 0.0 }).sum::<f64>());
            let support = match scene.feet {
                DrawnFeet::Made => contact::support(scene.body, pose),
                _ => contact::support_of(scene.body, pose, carries),
            };
            counts.push(support.corners_m().len() as f64);
            corners_m.extend_from_slice(support.corners_m());
        }
        let flat = |axis: usize| Coded::of(corners_m.iter().map(|at_m| at_m[axis]), PLACE_M);
        let support = Support { counts: Coded::of(counts, 1.0), x: flat(0), y: flat(1) };
        Self {
            clock,
            stature_m: scene.body.stature_m(),
            points: points_m.iter().map(|point_m| places(point_m, PLACE_M)).collect(),
            lines: LINES,
            head: [joint(Joint::Neck), end(End::HeadTop)],
            soles: SOLES.map(end),
            contacts: carries.is_some().then(|| Coded::of(contacts, 1.0)),
            centre: places(&centres_m, PLACE_M),
            support: carries.is_some().then_some(support),
            sensors: Vec::new(),
            force: None,
        }
    }
}
