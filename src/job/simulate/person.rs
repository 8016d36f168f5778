//! What the virtual person does: poses and a bow to calibrate by, then a motion.

use crate::body::worn::check::t_pose;
use crate::body::{Joint, JointAngles, Proportions, Segment, SegmentPose};
use crate::error::Error;
use crate::mocap::anatomy::Capture;
use glam::{DQuat, DVec3};

/// Poses per second.
pub const RATE_HZ: f64 = 120.0;
/// From one pose to the next, s.
const CHANGE_S: f64 = 1.2;
/// How long T pose is held, s.
const SPREAD_S: f64 = 6.0;
/// How long the person stands between T pose and the bow, s.
const STAND_S: f64 = 4.0;
/// How far the bow goes, rad, and how long it takes there, s.
const BOW_RAD: f64 = 0.8;
const BOW_S: f64 = 1.5;
/// At the end, so that what is measured afterwards is at rest, s.
const END_S: f64 = 1.0;
/// Longest performance, s: ten minutes of 13 sensors are 200 MB.
const LONGEST_S: f64 = 600.0;

/// What the motion is called.
const MOTION: &str = "the motion";

/// A performance, pose by pose.
pub struct Person {
    body: Proportions,
    poses: Vec<SegmentPose>,
    /// What the person does from which time on, s.
    doing: Vec<(f64, &'static str)>,
}

impl Person {
    /// Somebody who stands for `stand_s`, shows T pose and a bow, stands so long once more, so that a
    /// robot can go to its pose, and then does what was captured.
    ///
    /// # Errors
    /// A motion that is too long.
    pub fn new(capture: &Capture, stand_s: f64) -> Result<Self, Error> {
        let duration_s = capture.poses.len() as f64 / capture.rate_hz;
        if !(duration_s + 2.0 * stand_s <= LONGEST_S) {
            return Err(Error::new("the performance is too long")
                .at("--motion")
                .got(format!("{:.0} s", duration_s + 2.0 * stand_s))
                .allowed(format!("{LONGEST_S:.0} s")));
        }
        let body = Proportions::of_stature(capture.stature_m)?;
        let at =
            |angles: &JointAngles| angles.to_pose(DVec3::Z * body.root_height_m(), DQuat::IDENTITY);
        let (n_pose, spread) = (at(&JointAngles::default()), at(&t_pose()));
        let mut bowed = n_pose.clone();
        for segment in [Segment::Pelvis, Segment::Torso, Segment::Head] {
            bowed.orientation[segment.index()] = DQuat::from_rotation_y(BOW_RAD);
        }
        let mut person = Self { body, poses: vec![n_pose.clone()], doing: Vec::new() };
        person.stand("N pose", stand_s);
        person.change("arms up", &spread, CHANGE_S);
        person.stand("T pose", SPREAD_S);
        person.change("arms down", &n_pose, CHANGE_S);
        person.stand("N pose", STAND_S);
        person.change("bow", &bowed, BOW_S);
        person.change("up again", &n_pose, BOW_S);
        person.stand("stands", stand_s);
        let samples = (duration_s * RATE_HZ) as usize;
        let moving: Vec<SegmentPose> =
            (0..samples).map(|n| capture.at(n as f64 / RATE_HZ)).collect();
        if let Some(first) = moving.first() {
            person.change("to the motion", first, CHANGE_S);
        }
        person.begin(MOTION);
        person.poses.extend(moving);
        person.change("to N pose", &n_pose, CHANGE_S);
        person.stand("N pose until the end", END_S);
        Ok(person)
    }

    /// When the motion begins, s.
    #[must_use]
    pub fn motion_at_s(&self) -> f64 {
        let motion = self.doing.iter().find(|(_, what)| *what == MOTION);
        motion.map_or(0.0, |(from_s, _)| *from_s)
    }

    /// What is done at a time, s.
    #[must_use]
    pub fn doing(&self, time_s: f64) -> &'static str {
        let begun = self.doing.partition_point(|(from_s, _)| *from_s <= time_s);
        self.doing[begun.saturating_sub(1)].1
    }

    /// All poses, [`RATE_HZ`] per second.
    #[must_use]
    pub fn poses(&self) -> &[SegmentPose] {
        &self.poses
    }

    /// Where a joint is in each pose, m.
    pub fn positions(&self, joint: Joint) -> impl Iterator<Item = DVec3> {
        self.poses.iter().map(move |pose| self.body.positions(pose).joint_m(joint))
    }

    fn begin(&mut self, what: &'static str) {
        self.doing.push((self.poses.len() as f64 / RATE_HZ, what));
    }

    fn stand(&mut self, what: &'static str, time_s: f64) {
        self.begin(what);
        let last = self.poses[self.poses.len() - 1].clone();
        self.poses.extend(std::iter::repeat_n(last, (time_s * RATE_HZ) as usize));
    }

    /// Goes to a pose, starting and ending at rest, without a jump in acceleration (fifth-order
    /// polynomial).
    fn change(&mut self, what: &'static str, to: &SegmentPose, time_s: f64) {
        self.begin(what);
        let from = self.poses[self.poses.len() - 1].clone();
        let count = (time_s * RATE_HZ) as usize;
        for n in 1..=count {
            let t = n as f64 / count as f64;
            let share = t * t * t * (10.0 - 15.0 * t + 6.0 * t * t);
            self.poses.push(from.towards(to, share));
        }
    }
}
