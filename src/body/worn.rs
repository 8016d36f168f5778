//! A body that wears orientation sensors: from what the sensors say to segments and joint angles.
//!
//! A sensor gives its orientation in a world of its own: Z is up for all of them, but without a
//! magnetometer each one's heading starts somewhere else. With `q` that orientation, `m` how the
//! segment is turned in the sensor's axes, and `h` the heading of the sensor's world in ours,
//!
//! ```text
//! segment in the world = Rz(h) q m
//! ```
//!
//! [`calibrate`] finds `m` and `h` of every sensor, [`Wearing`] applies them, keeps `h` true while
//! the body moves, and says what it had to mend. Any subset of segments may be worn: the others are
//! at rest on the segment that carries them, and are said not to be worn.

pub mod calibrate;
pub mod calm;
pub mod check;
mod constraint;
pub mod doubt;
mod down;
mod facing;
pub mod kept;
pub mod limb;
pub mod strap;
pub mod swaps;

use crate::body::{JointAngles, Measured, Segment, SegmentPose};
use constraint::{Freedom, heading_error_rad};
use facing::Facing;
use glam::{DQuat, DVec3};
use limb::WornLimb;

pub use calibrate::{Calibration, HeadingBy, Mount, Moved, Movement, WornSensor};

/// Fastest correction of a heading while the body moves, rad/s: far above the drift of a sensor
/// whose bias is known, far below what anyone sees.
const CORRECTION_RAD_S: f64 = 0.5 * core::f64::consts::PI / 180.0;
/// Time in which a correction follows what the joints say, s (Laidig et al., "Exploiting kinematic
/// constraints to compensate magnetic disturbances when calculating joint angles of approximate
/// hinge joints from orientation estimates of inertial sensors", ICORR 2017, use 5 s).
const CORRECTION_S: f64 = 5.0;
/// Fastest change of a heading after a reset, rad/s: a robot that mirrors must not jump.
const RESET_RAD_S: f64 = 20.0 * core::f64::consts::PI / 180.0;

/// A segment that was doubted is back where its sensor says after this time, s.
const RETURN_S: f64 = 1.5;
/// A limb whose sensors are lost is at rest on what carries it after this time, s.
const REST_S: f64 = 1.5;

/// Joints whose anatomy tells the heading of the segment below from that of the one above. Knee and
/// ankle are taken as hinges; a forearm also turns about its own axis.
const JOINTS: [(Segment, Freedom); 6] = [
    (Segment::LeftForearm, Freedom::FlexionAndTwist),
    (Segment::RightForearm, Freedom::FlexionAndTwist),
    (Segment::LeftShank, Freedom::Flexion),
    (Segment::LeftFoot, Freedom::Flexion),
    (Segment::RightShank, Freedom::Flexion),
    (Segment::RightFoot, Freedom::Flexion),
];

/// Segments that are upright enough for the most part to say how they face. Arms are not.
const UPRIGHT: [Segment; 8] = [
    Segment::Torso,
    Segment::Head,
    Segment::LeftThigh,
    Segment::LeftShank,
    Segment::LeftFoot,
    Segment::RightThigh,
    Segment::RightShank,
    Segment::RightFoot,
];

/// A body that wears calibrated sensors, as it moves.
#[derive(Clone, Debug)]
pub struct Wearing {
    mounts: [Option<Mount>; 13],
    headings: [Heading; 13],
    /// Last orientation said by each segment's sensor.
    said: [Option<DQuat>; 13],
    /// Sensors that began anew: their own headings mean nothing until they are taken up again.
    lost: [bool; 13],
    before: Option<JointAngles>,
    worn_for_s: f64,
    /// Segments whose sensors say what cannot be.
    doubted: [bool; 13],
    /// Segments of limbs whose sensors are lost.
    resting: [bool; 13],
    /// Segments that wait on what carries them, or are on their way back.
    waiting: [Option<Waiting>; 13],
    /// Where all segments were a moment ago.
    shown: Option<[DQuat; 13]>,
    /// How segments face on what carries them.
    facing: [Facing; 13],
}

/// A segment that waits.
#[derive(Clone, Copy, Debug)]
struct Waiting {
    /// How it is turned on what carries it; a pelvis in the world.
    turned: DQuat,
    /// Part of the way from there to rest, in time; zero of one that waits where it was.
    rest: f64,
    /// Part of the way back to where its sensor says, in time.
    back: f64,
}

impl Waiting {
    /// One that was turned like this when it began to wait.
    const fn at(turned: DQuat) -> Self {
        Self { turned, rest: 0.0, back: 0.0 }
    }

    /// How it is turned, where its sensor says `said`: between the two, so that no joint goes further than one of them.
    fn turned(&self, said: DQuat) -> DQuat {
        let rested = between(self.turned, DQuat::IDENTITY, self.rest);
        between(rested, said, self.back)
    }
}

/// Between two rotations at a part of the time, at rest at both ends.
fn between(from: DQuat, to: DQuat, time: f64) -> DQuat {
    let share = time * time * (3.0 - 2.0 * time);
    let to = if from.dot(to) < 0.0 { -to } else { to };
    from.slerp(to, share).normalize()
}

/// What was done to a sensor's heading since calibration.
#[derive(Clone, Copy, Debug, Default)]
struct Heading {
    /// Sum of what the joints asked for, rad.
    corrected_rad: f64,
    /// Sum of what resets asked for and was done, rad.
    reset_rad: f64,
    /// Part of a reset that is still to be done, rad.
    owed_rad: f64,
}

/// A moment of a body that wears sensors.
#[derive(Clone, Debug, PartialEq)]
pub struct WornPose {
    /// Segments in the world; the pelvis stands at the origin.
    pub pose: SegmentPose,
    /// Angles of the joints, and what they do not say.
    pub measured: Measured,
    /// By [`Segment::index`]: true if the segment's own sensor said so now. The others are at rest
    /// on what carries them or, if their sensor is silent, as it said last.
    pub fresh: [bool; 13],
}

/// How a sensor's heading ran away, as far as the joints show it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drift {
    /// The segment that wears it.
    pub segment: Segment,
    /// Heading corrected since calibration, against the segment that carries it, rad; `None` where
    /// no joint tells: only a reset mends such a heading.
    pub corrected_rad: Option<f64>,
    /// The same per time, rad/s; `None` during the first ten seconds.
    pub rate_rad_s: Option<f64>,
    /// Heading taken by resets, rad.
    pub reset_rad: f64,
}

impl Wearing {
    /// A body that wears what was calibrated.
    #[must_use]
    pub fn new(calibration: &Calibration) -> Self {
        let mut mounts = [None; 13];
        for mount in &calibration.mounts {
            mounts[mount.segment.index()] = Some(*mount);
        }
        Self {
            mounts,
            headings: [Heading::default(); 13],
            said: [None; 13],
            lost: [false; 13],
            before: None,
            worn_for_s: 0.0,
            doubted: [false; 13],
            resting: [false; 13],
            waiting: [None; 13],
            shown: None,
            facing: Default::default(),
        }
    }

    /// By [`Segment::index`]: which segments wear a sensor.
    #[must_use]
    pub fn worn(&self) -> [bool; 13] {
        self.mounts.map(|mount| mount.is_some())
    }

    /// By [`Segment::index`]: how the sensors are turned in the world of a moment of this body; `None` of one that is not
    /// worn, or said nothing then.
    #[must_use]
    pub fn sensors(&self, moment: &WornPose) -> [Option<DQuat>; 13] {
        std::array::from_fn(|at| {
            let mount = self.mounts[at].filter(|_| moment.fresh[at])?;
            Some(moment.pose.orientation[at] * mount.sensor_from_segment.inverse())
        })
    }

    /// The body `dt_s` after the moment before. `said` is by [`Segment::index`]: the orientation of
    /// the segment's sensor in its own world, `None` if it said nothing valid.
    pub fn pose(&mut self, said: &[Option<DQuat>; 13], dt_s: f64) -> WornPose {
        let dt_s = if dt_s.is_finite() { dt_s.clamp(0.0, 1.0) } else { 0.0 };
        let mut fresh = [false; 13];
        for (at, quaternion) in said.iter().enumerate() {
            let sound = quaternion.filter(|q| q.is_finite() && q.length_squared() > 0.25);
            if let (Some(quaternion), Some(mount)) = (sound, &self.mounts[at]) {
                let quaternion = quaternion.normalize();
                if std::mem::take(&mut self.lost[at])
                    && let Some(before) = self.orientation(mount.segment)
                {
                    let heading_rad = self.heading_rad(mount);
                    let again = Mount { heading_rad, ..*mount }.segment_in_world(quaternion);
                    self.headings[at].reset_rad += about_z_rad(before * again.inverse());
                }
                self.said[at] = Some(quaternion);
                fresh[at] = true;
            }
        }
        self.worn_for_s += dt_s;
        for heading in &mut self.headings {
            let step = heading.owed_rad.clamp(-RESET_RAD_S * dt_s, RESET_RAD_S * dt_s);
            heading.owed_rad -= step;
            heading.reset_rad += step;
        }
        // What is doubted tells no headings.
        let told = core::array::from_fn(|at| fresh[at] && self.waiting[at].is_none());
        self.correct(&told, dt_s);
        for segment in Segment::ALL {
            let (waits, rests) = (self.waits(segment), self.resting[segment.index()]);
            let waiting = &mut self.waiting[segment.index()];
            match waiting {
                Some(to_rest) if rests => to_rest.rest = (to_rest.rest + dt_s / REST_S).min(1.0),
                Some(on_its_way) if !waits => on_its_way.back += dt_s / RETURN_S,
                _ => {}
            }
            *waiting = waiting.filter(|waiting| waiting.back < 1.0);
        }
        self.look_how_they_face(dt_s);
        let pose = self.segments(true);
        self.shown = Some(pose.orientation);
        let measured = match &self.before {
            Some(before) => JointAngles::of_pose_after(&pose, before),
            None => JointAngles::of_pose(&pose),
        };
        self.before = Some(measured.angles);
        WornPose { pose, measured, fresh }
    }

    /// Takes it that the body stands in N pose now, facing where it faced at calibration: headings
    /// are mended, smoothly, tilts are not touched.
    pub fn reset_heading(&mut self) {
        for segment in Segment::ALL {
            if let Some(turned) = self.orientation(segment) {
                let heading = &mut self.headings[segment.index()];
                heading.owed_rad = -about_z_rad(turned);
                if self.resting[segment.index()] {
                    // Nobody sees it.
                    heading.reset_rad += std::mem::take(&mut heading.owed_rad);
                }
            }
        }
        self.before = None;
    }

    /// The sensor of a segment began anew, and its own heading elsewhere: when it speaks again, the
    /// segment is taken to face as it did last. As good as the body stood still meanwhile; a heading
    /// reset mends the rest.
    pub fn heading_lost(&mut self, segment: Segment) {
        self.lost[segment.index()] = self.mounts[segment.index()].is_some();
    }

    /// From now on a segment and all that it carries wait where they are on what carries them, whatever their sensors say: a knee
    /// is known no better than its thigh.
    pub fn hold(&mut self, segment: Segment) {
        self.doubted[segment.index()] = true;
        let Some(shown) = self.shown else { return };
        let waits = Segment::ALL.map(|segment| self.waits(segment));
        for segment in Segment::ALL.into_iter().filter(|segment| waits[segment.index()]) {
            self.waiting[segment.index()] = Some(Waiting::at(on_its_carrier(&shown, segment)));
        }
    }

    /// From now on a limb goes to rest on what carries it, and stays there, whatever its sensors say.
    pub fn rest(&mut self, limb: WornLimb) {
        let shown = self.shown.unwrap_or([DQuat::IDENTITY; 13]);
        for segment in limb.segments() {
            self.resting[segment.index()] = true;
            self.waiting[segment.index()] = Some(Waiting::at(on_its_carrier(&shown, segment)));
        }
    }

    /// A limb that rested goes slowly to where its sensors say it is.
    pub fn take_up(&mut self, limb: WornLimb) {
        limb.segments().for_each(|segment| self.resting[segment.index()] = false);
    }

    /// True until a limb that rested is where its sensors say it is.
    #[must_use]
    pub fn is_on_its_way(&self, limb: WornLimb) -> bool {
        limb.segments().any(|segment| self.waiting[segment.index()].is_some())
    }

    /// A segment that waited, and what it carries, go slowly to where their sensors say they are. If its sensor's heading means nothing,
    /// it is taken to face as it usually did on what carries it, on the mean of a stride or, where that is not known, as it waited.
    pub fn release(&mut self, segment: Segment, heading_lost: bool) {
        self.doubted[segment.index()] = false;
        let Some(shown) = self.shown else { return };
        if let Some(own) = self.orientation(segment).filter(|_| heading_lost) {
            let at = segment.index();
            let owed_rad = self.facing[at].owed_rad();
            self.headings[at].reset_rad +=
                owed_rad.unwrap_or_else(|| about_z_rad(shown[at] * own.inverse()));
        }
    }

    /// Looks how segments that are upright face on what carries them, as their sensors say it.
    fn look_how_they_face(&mut self, dt_s: f64) {
        let said = self.as_said().orientation;
        for segment in UPRIGHT {
            let Some(above) = segment.parent() else { continue };
            let (at, carrier) = (segment.index(), above.index());
            if self.mounts[at].is_some() && self.mounts[carrier].is_some() && !self.waits(above) {
                let faces_rad = about_z_rad(said[carrier].inverse() * said[at]);
                self.facing[at].take(faces_rad, dt_s, self.doubted[at]);
            }
        }
    }

    /// True if a segment or one that carries it is doubted.
    fn waits(&self, segment: Segment) -> bool {
        let mut next = Some(segment);
        while let Some(one) = next {
            if self.doubted[one.index()] {
                return true;
            }
            next = one.parent();
        }
        false
    }

    /// A vector of the world of a segment's sensor, in ours.
    #[must_use]
    pub fn in_world(&self, segment: Segment, vector: DVec3) -> Option<DVec3> {
        let mount = self.mounts[segment.index()].as_ref()?;
        Some(DQuat::from_rotation_z(self.heading_rad(mount)) * vector)
    }

    /// Where the sensors put the body, those that are doubted as well.
    #[must_use]
    pub fn as_said(&self) -> SegmentPose {
        self.segments(false)
    }

    /// What happened to headings, sensor by sensor.
    #[must_use]
    pub fn drifts(&self) -> Vec<Drift> {
        let worn = Segment::ALL.into_iter().filter(|s| self.mounts[s.index()].is_some());
        let drift = |segment: Segment| {
            let heading = self.headings[segment.index()];
            let told = JOINTS.iter().any(|(below, _)| *below == segment)
                && segment.parent().is_some_and(|above| self.mounts[above.index()].is_some());
            let corrected_rad = told.then_some(heading.corrected_rad);
            let long = self.worn_for_s > 10.0;
            Drift {
                segment,
                corrected_rad,
                rate_rad_s: corrected_rad.filter(|_| long).map(|rad| rad / self.worn_for_s),
                reset_rad: heading.reset_rad,
            }
        };
        worn.map(drift).collect()
    }

    /// Turns headings a little towards what the joints allow.
    fn correct(&mut self, fresh: &[bool; 13], dt_s: f64) {
        for (below, freedom) in JOINTS {
            let Some(above) = below.parent() else { continue };
            // What a reset has not done yet is no drift.
            let is_settled = |segment: Segment| self.headings[segment.index()].owed_rad == 0.0;
            let is_told = |segment: Segment| fresh[segment.index()] && is_settled(segment);
            if !(is_told(above) && is_told(below)) {
                continue;
            }
            let (Some(upper), Some(lower)) = (self.orientation(above), self.orientation(below))
            else {
                continue;
            };
            let Some((off_rad, weight)) = heading_error_rad(upper, lower, freedom) else {
                continue;
            };
            let most = CORRECTION_RAD_S * dt_s;
            let step = (off_rad * weight * dt_s / CORRECTION_S).clamp(-most, most);
            self.headings[below.index()].corrected_rad += step;
        }
    }

    /// Orientation of a worn segment in the world.
    fn orientation(&self, segment: Segment) -> Option<DQuat> {
        let at = segment.index();
        let (mount, said) = (self.mounts[at]?, self.said[at]?);
        let heading_rad = self.heading_rad(&mount);
        Some(Mount { heading_rad, ..mount }.segment_in_world(said))
    }

    /// Heading of a sensor's world in ours by now, rad.
    fn heading_rad(&self, mount: &Mount) -> f64 {
        let heading = self.headings[mount.segment.index()];
        mount.heading_rad + heading.corrected_rad + heading.reset_rad
    }

    /// Segments that wait, and those on their way back, where they are on what carries them; the others as their joints are turned.
    fn with_waiting(&self, said: &[DQuat; 13]) -> [DQuat; 13] {
        let mut shown = *said;
        for segment in Segment::ALL {
            let at = segment.index();
            let (carried, carrier) = segment
                .parent()
                .map_or_else(Default::default, |above| (said[above.index()], shown[above.index()]));
            let said = carried.inverse() * said[at];
            let turned = self.waiting[at].map_or(said, |waiting| waiting.turned(said));
            shown[at] = (carrier * turned).normalize();
        }
        shown
    }

    /// All segments: worn ones as they say, the others at rest on what carries them. A pelvis that
    /// is not worn stands upright and faces where the torso faces.
    fn segments(&self, holds: bool) -> SegmentPose {
        let facing = self.orientation(Segment::Torso).map(|torso| {
            let about_z = DQuat::from_xyzw(0.0, 0.0, torso.z, torso.w);
            if about_z.length_squared() > 1e-6 { about_z.normalize() } else { DQuat::IDENTITY }
        });
        let mut orientation = [facing.unwrap_or(DQuat::IDENTITY); 13];
        for segment in Segment::ALL {
            let carried = segment.parent().map(|above| orientation[above.index()]);
            let own = self.orientation(segment).or(carried);
            orientation[segment.index()] = own.unwrap_or(orientation[0]);
        }
        if holds && self.waiting.iter().any(Option::is_some) {
            orientation = self.with_waiting(&orientation);
        }
        SegmentPose { root_m: DVec3::ZERO, orientation }
    }
}

/// How a segment is turned on what carries it; a pelvis in the world.
fn on_its_carrier(shown: &[DQuat; 13], segment: Segment) -> DQuat {
    let carried = segment.parent().map_or(DQuat::IDENTITY, |above| shown[above.index()]);
    carried.inverse() * shown[segment.index()]
}

/// The turn about Z nearest to a rotation, rad: not an Euler angle, which would be another one for a
/// segment that leans.
fn about_z_rad(turn: DQuat) -> f64 {
    crate::units::wrap_rad(2.0 * turn.z.atan2(turn.w))
}
