//! Somebody who does what is asked, as it is asked: pose after pose is made when it is needed, and goes over smoothly into
//! whatever is asked next, wherever the body is by then.

use super::person::RATE_HZ;
use super::worn::wxyz;
use crate::body::proportions::proximal_joint;
use crate::body::worn::Movement;
use crate::body::worn::check::t_pose;
use crate::body::{Dof, Joint, JointAngles, Proportions, Segment, SegmentPose};
use crate::error::Error;
use crate::mocap::anatomy::Capture;
use gaitway_sim::imu::{MakesPoses, SegmentAt};
use glam::{DQuat, DVec3};
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// From what is done to what is asked, s.
const FADE_S: f64 = 1.2;
/// So many poses are known at least after they were made: two seconds.
const KEPT: usize = 240;
/// Height of a table, m.
const TABLE_M: f64 = 0.75;
/// Standing before a movement, s: the guide waits for it.
const STANDING_S: f64 = 0.9;
/// Who did a movement and is still asked for it does it again after this time, s.
const AGAIN_S: f64 = 6.0;
/// Into an action, out of it, and standing before the next time, s.
const BETWEEN_S: f64 = 0.8;
/// Whatever moves comes to its pace in this time, and to rest, s: a capture may begin and end anywhere in a movement, and
/// something else may be asked at any time.
const PACE_S: f64 = 0.5;
/// How long a stumble takes, s, how far the body leans in it, rad, and how far it goes, m.
const STUMBLE_S: f64 = 1.2;
const STUMBLE_RAD: f64 = 0.35;
const STUMBLE_M: f64 = 0.2;
/// A step of marching on the spot, s, and how many there are.
const STEP_S: f64 = 0.8;
const STEPS: u32 = 4;

/// How somebody stays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stays {
    /// In N pose.
    NPose,
    /// In T pose.
    TPose,
    /// Standing, with both arms straight forward.
    ArmsForward,
    /// Sitting upright.
    Sit,
}

/// What somebody does from one moment on.
#[derive(Clone, Debug)]
pub enum Act {
    /// Nobody wears the sensors: they lie on a table.
    Table,
    /// Stays like this.
    Stay(Stays),
    /// Does this movement of a calibration, and stands; once more after a while.
    Move(Movement),
    /// Does what was captured, again and again, the first time after so many seconds.
    Repeat(Arc<Capture>, f64),
}

/// From rest to rest without a jump in acceleration: the share of the way after a share of the time.
fn smooth(time: f64) -> f64 {
    let t = time.clamp(0.0, 1.0);
    t * t * t * (10.0 - 15.0 * t + 6.0 * t * t)
}

/// There and back: how far, at a share of the time.
fn there_and_back(time: f64) -> f64 {
    smooth(2.0 * time) - smooth(2.0 * time - 1.0)
}

/// What was gone through of something that comes to its pace as [`smooth`] does, in `pace_s`, after so long.
fn begun_s(time_s: f64, pace_s: f64) -> f64 {
    let x = (time_s / pace_s.max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
    pace_s * x.powi(4) * (2.5 - 3.0 * x + x * x) + (time_s - pace_s).max(0.0)
}

/// Where somebody stands, and where they look.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Standing {
    floor_m: DVec3,
    turned: DQuat,
}

/// The part of a rotation about the vertical, as a body faces.
fn facing(q: DQuat) -> DQuat {
    let ahead = q * DVec3::X;
    DQuat::from_rotation_z(ahead.y.atan2(ahead.x))
}

const fn floor(point: DVec3) -> DVec3 {
    DVec3::new(point.x, point.y, 0.0)
}

/// Joint angles, and how far pelvis, torso and head lean forward, as one stands there.
fn standing(angles: &JointAngles, lean_rad: f64, at: &Standing, body: &Proportions) -> SegmentPose {
    let upright = DVec3::Z * body.root_height_m();
    let mut pose = angles.to_pose(upright, DQuat::IDENTITY);
    for segment in [Segment::Pelvis, Segment::Torso, Segment::Head] {
        let orientation = &mut pose.orientation[segment.index()];
        *orientation = DQuat::from_rotation_y(lean_rad) * *orientation;
    }
    // The foot that would move less stays where it is, and the pelvis goes.
    let n_pose = body.positions(&JointAngles::default().to_pose(upright, DQuat::IDENTITY));
    let bent = body.positions(&pose);
    let moved = [Joint::LeftAnkle, Joint::RightAnkle]
        .map(|ankle| bent.joint_m(ankle) - n_pose.joint_m(ankle));
    let least = if moved[0].length() <= moved[1].length() { moved[0] } else { moved[1] };
    pose.root_m = at.floor_m + at.turned * (pose.root_m - least);
    pose.orientation = pose.orientation.map(|q| at.turned * q);
    pose
}

/// Angles of a movement that is done to so great a part, and the lean.
fn part_of(movement: Movement, time: f64) -> (JointAngles, f64) {
    let far = there_and_back(time);
    let mut angles = JointAngles::default();
    match movement {
        Movement::Bow => return (angles, 0.8 * far),
        Movement::SitToStand => {
            let (sitting, lean_rad) = Stays::Sit.angles();
            return (JointAngles(sitting.0.map(|angle| angle * far)), lean_rad * far);
        }
        Movement::RaiseArms => {
            angles[Dof::LeftShoulderFlexion] = 1.4 * far;
            angles[Dof::RightShoulderFlexion] = 1.4 * far;
        }
        Movement::Bend => {
            let step = time.clamp(0.0, 1.0) * f64::from(STEPS);
            let far = there_and_back(step.fract());
            let dofs = match step.floor() as u32 % 2 {
                0 => [Dof::LeftHipFlexion, Dof::LeftKneeFlexion, Dof::LeftElbowFlexion],
                _ => [Dof::RightHipFlexion, Dof::RightKneeFlexion, Dof::RightElbowFlexion],
            };
            for (dof, rad) in dofs.into_iter().zip([0.5, 1.4, 1.3]) {
                angles[dof] = rad * far;
            }
        }
    }
    (angles, 0.0)
}

/// How long a movement takes, s.
fn lasts_s(movement: Movement) -> f64 {
    match movement {
        Movement::Bow | Movement::SitToStand => 3.0,
        Movement::Bend => STEP_S * f64::from(STEPS),
        Movement::RaiseArms => 2.6,
    }
}

impl Stays {
    /// Joint angles, and how far pelvis, torso and head lean forward, rad.
    fn angles(self) -> (JointAngles, f64) {
        let mut angles = JointAngles::default();
        match self {
            Self::NPose => {}
            Self::TPose => return (t_pose(), 0.0),
            Self::ArmsForward => {
                angles[Dof::LeftShoulderFlexion] = core::f64::consts::FRAC_PI_2;
                angles[Dof::RightShoulderFlexion] = core::f64::consts::FRAC_PI_2;
            }
            Self::Sit => {
                // Legs turn against the world, whatever the pelvis does: its lean is laid on afterwards.
                for dof in [Dof::LeftHipFlexion, Dof::RightHipFlexion] {
                    angles[dof] = 1.4;
                }
                for dof in [Dof::LeftKneeFlexion, Dof::RightKneeFlexion] {
                    angles[dof] = 1.4;
                }
                return (angles, 0.2);
            }
        }
        (angles, 0.0)
    }
}

impl Act {
    /// The pose so long after it began, from where one stood then.
    fn pose(&self, time_s: f64, from: &Standing, body: &Proportions) -> SegmentPose {
        let stays = |how: Stays, at: &Standing| {
            let (angles, lean_rad) = how.angles();
            standing(&angles, lean_rad, at, body)
        };
        match self {
            Self::Table => {
                // Every sensor on its back, in a row.
                let lying = from.turned * DQuat::from_rotation_y(-core::f64::consts::FRAC_PI_2);
                let root_m = from.floor_m + DVec3::Z * TABLE_M;
                SegmentPose { root_m, orientation: [lying; 13] }
            }
            Self::Stay(how) => stays(*how, from),
            Self::Move(movement) => {
                let (first_s, lasts_s) = (FADE_S + STANDING_S, lasts_s(*movement));
                let into_s = (time_s - first_s).max(0.0) % (lasts_s + AGAIN_S);
                let (angles, lean_rad) = part_of(*movement, into_s / lasts_s);
                standing(&angles, lean_rad, from, body)
            }
            Self::Repeat(capture, first_s) => {
                let since_s = time_s - first_s;
                if since_s <= 0.0 {
                    return stays(Stays::NPose, from);
                }
                let round = Round::of(capture);
                let (number, into_s) = (since_s / round.lasts_s(), since_s % round.lasts_s());
                let here = round.stood(from, number.floor() as u64);
                let then = round.next(&here);
                let done_s = into_s - BETWEEN_S - round.moves_s();
                if into_s < BETWEEN_S {
                    let first = round.pose(0.0, &here);
                    stays(Stays::NPose, &here).towards(&first, smooth(into_s / BETWEEN_S))
                } else if done_s < 0.0 {
                    round.pose(into_s - BETWEEN_S, &here)
                } else {
                    let last = round.pose(round.moves_s(), &here);
                    last.towards(&stays(Stays::NPose, &then), smooth(done_s / BETWEEN_S))
                }
            }
        }
    }
}

/// A captured motion, done once.
struct Round<'a> {
    capture: &'a Capture,
    motion_s: f64,
    /// Where it begins, and how it faces there, in the capture.
    first: Standing,
    /// Where it ends, from where it began.
    last: Standing,
}

impl<'a> Round<'a> {
    fn of(capture: &'a Capture) -> Self {
        let motion_s = capture.poses.len().saturating_sub(1) as f64 / capture.rate_hz;
        let stands = |time_s: f64| {
            let pose = capture.at(time_s);
            let turned = facing(pose.orientation[Segment::Pelvis.index()]);
            Standing { floor_m: floor(pose.root_m), turned }
        };
        let (first, end) = (stands(0.0), stands(motion_s));
        let back = first.turned.inverse();
        let last =
            Standing { floor_m: back * (end.floor_m - first.floor_m), turned: back * end.turned };
        Self { capture, motion_s, first, last }
    }

    /// How long it takes to come to its pace.
    const fn pace_s(&self) -> f64 {
        self.motion_s.min(PACE_S)
    }

    /// How long it is done, from rest to rest.
    const fn moves_s(&self) -> f64 {
        self.motion_s + self.pace_s()
    }

    /// Once, and standing before the next time.
    const fn lasts_s(&self) -> f64 {
        self.moves_s() + 3.0 * BETWEEN_S
    }

    /// Where in the capture one is who has done it for so long.
    fn captured_s(&self, time_s: f64) -> f64 {
        let left_s = self.moves_s() - time_s;
        match left_s < self.pace_s() {
            true => self.motion_s - begun_s(left_s.max(0.0), self.pace_s()),
            false => begun_s(time_s, self.pace_s()),
        }
    }

    /// Where one stands who did it from there.
    fn next(&self, at: &Standing) -> Standing {
        Standing {
            floor_m: at.floor_m + at.turned * self.last.floor_m,
            turned: (at.turned * self.last.turned).normalize(),
        }
    }

    /// Where one stands who did it so often.
    fn stood(&self, from: &Standing, times: u64) -> Standing {
        (0..times).fold(*from, |at, _| self.next(&at))
    }

    fn pose(&self, time_s: f64, at: &Standing) -> SegmentPose {
        let pose = self.capture.at(self.captured_s(time_s));
        let turned = at.turned * self.first.turned.inverse();
        SegmentPose {
            root_m: at.floor_m + turned * (pose.root_m - self.first.floor_m),
            orientation: pose.orientation.map(|q| turned * q),
        }
    }
}

/// What is done since when; the one before comes to rest beneath it while it fades.
#[derive(Clone, Debug)]
struct Layer {
    act: Act,
    from: Standing,
    since_s: f64,
    /// When something else was asked.
    until_s: f64,
    /// By segment, from what is done beneath: the way round that was taken when it began, which is kept.
    way: [Option<DQuat>; 13],
}

impl Layer {
    const fn new(act: Act, from: Standing, since_s: f64) -> Self {
        Self { act, from, since_s, until_s: f64::INFINITY, way: [None; 13] }
    }

    fn share(&self, time_s: f64) -> f64 {
        smooth((time_s - self.since_s) / FADE_S)
    }

    fn pose(&self, time_s: f64, body: &Proportions) -> SegmentPose {
        let since_s = time_s.min(self.until_s) - self.since_s;
        let over_s = (time_s - self.until_s).clamp(0.0, PACE_S);
        self.act.pose(since_s + over_s - begun_s(over_s, PACE_S), &self.from, body)
    }

    /// On the way from what is beneath to what is done.
    fn over(&mut self, beneath: &SegmentPose, time_s: f64, body: &Proportions) -> SegmentPose {
        let to = self.pose(time_s, body);
        let share = self.share(time_s);
        SegmentPose {
            root_m: beneath.root_m.lerp(to.root_m, share),
            orientation: std::array::from_fn(|at| {
                let between = beneath.orientation[at].inverse() * to.orientation[at];
                let before = self.way[at].unwrap_or(DQuat::IDENTITY);
                let between = if before.dot(between) < 0.0 { -between } else { between };
                self.way[at] = Some(between);
                (beneath.orientation[at] * part(between, share)).normalize()
            }),
        }
    }
}

/// A part of a rotation, also of one that goes the long way round.
fn part(q: DQuat, share: f64) -> DQuat {
    let axis = DVec3::new(q.x, q.y, q.z);
    let length = axis.length();
    match length > 1e-12 {
        true => DQuat::from_axis_angle(axis / length, 2.0 * length.atan2(q.w) * share),
        false => DQuat::IDENTITY,
    }
}

/// On which segment a sensor is.
#[derive(Clone, Copy, Debug)]
struct Strapped {
    was: Segment,
    is: Segment,
    since_s: f64,
}

/// Somebody who does what is asked. What is asked at a time counts from the next pose on that was not made yet.
pub struct Acting {
    body: Proportions,
    layers: Vec<Layer>,
    /// When somebody stumbled, and which way.
    stumbles: Vec<(f64, DVec3)>,
    /// By the segment that a sensor belongs on.
    strapped: [Strapped; 13],
    /// Poses that were made so far, and by sensor the last of them.
    made: u64,
    kept: VecDeque<[SegmentAt; 13]>,
}

impl Acting {
    /// Somebody of this stature.
    ///
    /// # Errors
    /// A stature that nobody has.
    pub fn new(stature_m: f64, act: Act) -> Result<Self, Error> {
        let from = Standing { floor_m: DVec3::ZERO, turned: DQuat::IDENTITY };
        let on = |segment| Strapped { was: segment, is: segment, since_s: 0.0 };
        Ok(Self {
            body: Proportions::of_stature(stature_m)?,
            layers: vec![Layer::new(act, from, 0.0)],
            stumbles: Vec::new(),
            strapped: Segment::ALL.map(on),
            made: 0,
            kept: VecDeque::new(),
        })
    }

    /// When the next pose is that was not made yet, s.
    #[must_use]
    pub fn next_s(&self) -> f64 {
        self.made as f64 / RATE_HZ
    }

    /// From now on this is done.
    pub fn does(&mut self, act: Act) {
        let since_s = self.next_s();
        let Some(last) = self.layers.last_mut() else { return };
        let from = match &last.act {
            // Who walked stands where they are, and looks where they look.
            Act::Repeat(..) => {
                let pose = last.pose(since_s, &self.body);
                let turned = facing(pose.orientation[Segment::Pelvis.index()]);
                Standing { floor_m: floor(pose.root_m), turned }
            }
            _ => last.from,
        };
        last.until_s = since_s;
        self.layers.push(Layer::new(act, from, since_s));
    }

    /// Somebody stumbles now, in this direction.
    pub fn stumbles(&mut self, direction_rad: f64) {
        let towards = DVec3::new(direction_rad.cos(), direction_rad.sin(), 0.0);
        self.stumbles.push((self.next_s(), towards));
    }

    /// The sensors that these two segments wear change places.
    pub fn swaps(&mut self, one: Segment, other: Segment) {
        let since_s = self.next_s();
        for strapped in &mut self.strapped {
            let goes = match strapped.is {
                is if is == one => other,
                is if is == other => one,
                _ => continue,
            };
            *strapped = Strapped { was: strapped.is, is: goes, since_s };
        }
    }

    /// Makes the next pose.
    fn make(&mut self) {
        let time_s = self.next_s();
        let faded = self.layers.iter().rposition(|layer| layer.share(time_s) >= 1.0);
        self.layers.drain(..faded.unwrap_or(0));
        let body = &self.body;
        let mut pose = self.layers[0].pose(time_s, body);
        for layer in &mut self.layers[1..] {
            pose = layer.over(&pose, time_s, body);
        }
        self.stumbles.retain(|(since_s, _)| time_s - since_s < STUMBLE_S);
        for (since_s, towards) in &self.stumbles {
            let far = there_and_back((time_s - since_s) / STUMBLE_S);
            let lean = DQuat::from_axis_angle(DVec3::Z.cross(*towards), STUMBLE_RAD * far);
            pose.root_m += *towards * (STUMBLE_M * far);
            pose.orientation = pose.orientation.map(|q| lean * q);
        }
        let positions = body.positions(&pose);
        let on = |segment: Segment| {
            let joint_m = positions.joint_m(proximal_joint(segment));
            (joint_m, pose.orientation[segment.index()])
        };
        let sensors = self.strapped.map(|strapped| {
            let ((from_m, from), (to_m, to)) = (on(strapped.was), on(strapped.is));
            let share = smooth((time_s - strapped.since_s) / FADE_S);
            let position_m = from_m.lerp(to_m, share).to_array();
            SegmentAt { position_m, orientation: wxyz(from.slerp(to, share)) }
        });
        self.kept.push_back(sensors);
        if self.kept.len() > KEPT {
            self.kept.pop_front();
        }
        self.made += 1;
    }

    /// Where the segment is that wears a sensor, in the pose of this number; of those long ago in the oldest that is known.
    pub fn at(&mut self, number: u64, sensor: Segment) -> SegmentAt {
        while self.made <= number {
            self.make();
        }
        let oldest = self.made - self.kept.len() as u64;
        self.kept[number.saturating_sub(oldest) as usize][sensor.index()]
    }
}

/// The segment that one sensor is on, as its motion is made.
pub struct Carries {
    acting: Arc<Mutex<Acting>>,
    sensor: Segment,
    /// How the world of the sensor is turned.
    world: DQuat,
}

/// Somebody whom several sensors share.
pub fn locked(acting: &Mutex<Acting>) -> MutexGuard<'_, Acting> {
    acting.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Carries {
    /// What carries this sensor, in its world.
    #[must_use]
    pub const fn new(acting: Arc<Mutex<Acting>>, sensor: Segment, world: DQuat) -> Self {
        Self { acting, sensor, world }
    }
}

impl MakesPoses for Carries {
    fn poses(&self, from: u64, into: &mut [SegmentAt]) {
        let mut acting = locked(&self.acting);
        for (number, place) in (from..).zip(into) {
            let at = acting.at(number, self.sensor);
            let [w, x, y, z] = at.orientation;
            *place = SegmentAt {
                position_m: (self.world * DVec3::from_array(at.position_m)).to_array(),
                orientation: wxyz(self.world * DQuat::from_xyzw(x, y, z, w)),
            };
        }
    }
}
