//! What a recording shows of a body: of a person who wore sensors, or of a robot by what its servos reported.

use super::Source;
use crate::body::root::StandingRoot;
use crate::body::worn::kept::Kept;
use crate::body::{Proportions, Segment, SegmentPose, root, segment_name};
use crate::error::{Error, ErrorKind};
use crate::job::model::robot_model;
use crate::mocap::anatomy::Capture;
use crate::mocap::retarget::RobotModel;
use crate::recording::{self, Recording, SensorSeries};
use crate::retarget::base::{self, ComingBase, Held, StandingSole};
use crate::robot::{Robot, RobotBody};
use crate::session::angles::{WornMotion, body_of};
use crate::session::doubted;
use crate::session::files::BODY_KEY;
use glam::{DQuat, DVec3};
use std::path::Path;

/// Poses per second.
const RATE_HZ: f64 = 100.0;
/// Longest time without a position of a joint that is bridged by a straight line, s.
const GAP_S: f64 = 0.2;
/// Most poses for each cycle that was recorded: what is read may not become much more than it was.
const MOST_POSES: f64 = 10.0;
/// Standard deviation of the time over which the root of a robot is averaged, s: servos report steps.
const SPREAD_S: f64 = 0.03;
/// Stature of the person whose limbs a robot's are taken for, m.
const STATURE_M: f64 = 1.75;

/// The body in a recording.
///
/// # Errors
/// A file that cannot be read, that holds neither worn sensors that were calibrated nor positions of a robot's joints, or a
/// robot that is not known here or has no parts of a body.
pub fn capture(path: &Path) -> Result<(Capture, Source), Error> {
    let place = path.display().to_string();
    let (format, capture) = match worn(path, RATE_HZ)? {
        Some((motion, series, kept)) => {
            let mut capture = wearer(motion);
            capture.notes.extend(doubted::told(&series, &kept)?);
            ("worn", capture)
        }
        None => ("servos", of_robot(&recording::read(path)?).map_err(|error| error.at(place))?),
    };
    let (rate_hz, frames) = (capture.rate_hz, capture.poses.len());
    let source = Source {
        format: format.to_owned(),
        frames,
        rate_hz,
        duration_s: frames.saturating_sub(1) as f64 / rate_hz,
        ..Source::default()
    };
    Ok((capture, source))
}

/// The person who wore the sensors of a recording that knows how they were worn, in so many poses a second, what the
/// sensors said, and how they sat.
///
/// # Errors
/// A file that cannot be read, or whose sensors cannot have been worn so.
pub fn worn(path: &Path, rate_hz: f64) -> Result<Option<(WornMotion, SensorSeries, Kept)>, Error> {
    let Some(text) = recording::told_of_run(path, BODY_KEY)? else { return Ok(None) };
    let at_path = |error: Error| error.at(path.display().to_string());
    let kept = Kept::parse(&text).map_err(at_path)?;
    let series = recording::sensor_series(path)?;
    // Somebody whose recording was replayed is not recorded once more.
    if series.sensors.is_empty() {
        return Ok(None);
    }
    let metadata = series.start.as_ref().map(|start| start.metadata.clone()).unwrap_or_default();
    let motion = WornMotion::of(&series, &kept, body_of(&metadata)?, rate_hz).map_err(at_path)?;
    Ok(Some((motion, series, kept)))
}

fn wearer(motion: WornMotion) -> Capture {
    let not_worn = motion.not_worn();
    let mut notes = Vec::new();
    if !not_worn.is_empty() {
        notes.push(format!("not worn, and therefore unknown: {}", not_worn.join(", ")));
    }
    let stature_m = motion.body.stature_m();
    let WornMotion { rate_hz, poses, worn, .. } = motion;
    Capture { rate_hz, poses, tracked: worn, stature_m, is_made: false, notes }
}

/// The body that a robot showed.
fn of_robot(recording: &Recording) -> Result<Capture, Error> {
    let nothing = || {
        Error::of(ErrorKind::Absent, "the recording shows no body").allowed(
            "positions that a robot's servos reported, or sensors whose wearer was calibrated",
        )
    };
    let start = recording.start.as_ref().ok_or_else(nothing)?;
    if start.robot.is_empty() {
        return Err(nothing().remedy(
            "sensors whose wearer stood in N pose become a motion: gaitway convert FILE.mcap FILE.bvh --n-pose FROM,TO",
        ));
    }
    let robot = Robot::load(&start.robot)?;
    let same = robot.joints.len() == start.joints.len()
        && robot.joints.iter().zip(&start.joints).all(|(one, two)| one.name == two.name);
    if !same {
        return Err(Error::new("the robot has other joints than the recording")
            .at(format!("robot {}", robot.name)));
    }
    let SeenRobot { model, body, soles, shown, mut notes } = SeenRobot::of(&robot)?;
    let angles = measured(recording, &robot, &mut notes).ok_or_else(nothing)?;
    let held = Held::of(&body, &soles, false);
    let resting = base::resting(&body, &soles, &angles, RATE_HZ);
    let base = base::path(&body, &soles, held, &angles, RATE_HZ, |at| resting.get(at).copied());
    let poses = angles.iter().zip(&base.places);
    let mut poses: Vec<SegmentPose> =
        poses.map(|(angles, place)| shown.pose(&model, angles, place.turn)).collect();
    // The turns are the robot's, the lengths a person's: it stands where that person would.
    let mut stands = StandingRoot::new(Proportions::of_stature(STATURE_M)?);
    let mut roots_m: Vec<DVec3> =
        poses.iter().map(|pose| stands.next(pose, 1.0 / RATE_HZ)).collect();
    root::spread(&mut roots_m, RATE_HZ, SPREAD_S);
    for (pose, root_m) in poses.iter_mut().zip(roots_m) {
        pose.root_m = root_m;
    }
    Ok(Capture {
        rate_hz: RATE_HZ,
        poses,
        tracked: shown.tracked,
        stature_m: STATURE_M,
        is_made: false,
        notes,
    })
}

/// A robot in which a body is seen.
pub struct SeenRobot {
    model: RobotModel,
    body: RobotBody,
    soles: Vec<StandingSole>,
    shown: Shown,
    /// What is to be said of how it is seen.
    pub notes: Vec<String>,
}

impl SeenRobot {
    /// A robot that has parts of a body.
    ///
    /// # Errors
    /// One that has none, or whose file does not say where its soles are.
    pub fn of(robot: &Robot) -> Result<Self, Error> {
        let model = robot_model(robot)?;
        let body = RobotBody::of(&robot.file)?.ok_or_else(|| {
            Error::new("the robot's file does not say where its soles are")
                .at(format!("robot {}", robot.name))
                .got("no [body]")
        })?;
        let shown = Shown::of(&model);
        let mut notes = vec![
            "where the robot's base was is worked out from joints and soles, which stand on the floor"
                .to_owned(),
        ];
        let hidden = Segment::ALL.into_iter().filter(|segment| !shown.tracked[segment.index()]);
        let hidden: Vec<&str> = hidden.map(segment_name).collect();
        if !hidden.is_empty() {
            notes.push(format!("the robot has no {}", hidden.join(", ")));
        }
        Ok(Self { soles: StandingSole::all(&body), model, body, shown, notes })
    }

    /// The same as its joints are read, from now on.
    #[must_use]
    pub fn coming(&self) -> ComingRobot<'_> {
        ComingRobot { seen: self, base: ComingBase::new(&self.body, &self.soles) }
    }

    /// Which segments are seen while these joints are known.
    #[must_use]
    pub fn known(&self, joints: &[bool]) -> [bool; 13] {
        let is_known = |joint: usize| joints.get(joint).copied().unwrap_or(false);
        let mut known = self.shown.tracked;
        for (segment, link) in self.shown.links.iter().enumerate() {
            let Some((joint, _)) = link else { continue };
            let mut chain = std::iter::successors(Some(*joint), |at| self.model.joints[*at].parent);
            known[segment] &= chain.all(is_known);
        }
        known
    }
}

/// A robot whose joints are read from moment to moment.
pub struct ComingRobot<'a> {
    seen: &'a SeenRobot,
    base: ComingBase<'a>,
}

impl ComingRobot<'_> {
    /// The body that it shows with these angles, rad, so long after the last, s. The root is at the origin.
    pub fn pose(&mut self, angles: &[f64], dt_s: f64) -> SegmentPose {
        let turn = self.base.next(angles, dt_s).turn;
        self.seen.shown.pose(&self.seen.model, angles, turn)
    }
}

/// Angles of all joints, [`RATE_HZ`] times a second, from where all were read first to where one was last. None if there
/// are none.
fn measured(
    recording: &Recording,
    robot: &Robot,
    notes: &mut Vec<String>,
) -> Option<Vec<Vec<f64>>> {
    let first = recording.cycles.first()?.at;
    let series: Vec<Vec<(f64, f64)>> = (0..robot.joints.len())
        .map(|joint| {
            let read = recording.cycles.iter().filter_map(|cycle| {
                let angle_rad = cycle.joints.get(joint)?.present_position_rad?;
                Some((cycle.at.seconds_since(first), angle_rad))
            });
            let mut read: Vec<(f64, f64)> =
                read.filter(|(_, angle_rad)| angle_rad.is_finite()).collect();
            read.dedup_by(|later, before| later.0 <= before.0);
            read
        })
        .collect();
    let (mut from_s, mut to_s) = (0.0_f64, f64::INFINITY);
    for read in &series {
        from_s = from_s.max(read.first()?.0);
        to_s = to_s.min(read.last()?.0);
    }
    let count = ((to_s - from_s) * RATE_HZ).floor() + 1.0;
    if !(2.0..=MOST_POSES * recording.cycles.len() as f64).contains(&count) {
        return None;
    }
    for (joint, read) in robot.joints.iter().zip(&series) {
        let longest_s = read.windows(2).map(|pair| pair[1].0 - pair[0].0).fold(0.0, f64::max);
        if longest_s > GAP_S {
            notes.push(format!(
                "{} was not read for up to {longest_s:.2} s: a straight line is taken",
                joint.name
            ));
        }
    }
    let at = |read: &Vec<(f64, f64)>, time_s: f64| {
        let later = read.partition_point(|(at_s, _)| *at_s < time_s).clamp(1, read.len() - 1);
        let ((from_s, from), (to_s, to)) = (read[later - 1], read[later]);
        from + (to - from) * ((time_s - from_s) / (to_s - from_s)).clamp(0.0, 1.0)
    };
    if series.iter().any(|read| read.len() < 2) {
        return None;
    }
    let pose = |n: u64| series.iter().map(|read| at(read, from_s + n as f64 / RATE_HZ)).collect();
    Some((0..count as u64).map(pose).collect())
}

/// Which segment a robot's links show, and how each is turned in the pose in which its robot stands as a person does in N
/// pose.
struct Shown {
    links: [Option<(usize, DQuat)>; 13],
    tracked: [bool; 13],
}

impl Shown {
    fn of(model: &RobotModel) -> Self {
        let mut links = [None; 13];
        let mut tracked = [false; 13];
        for segment in &model.base {
            tracked[segment.index()] = true;
        }
        for link in &model.links {
            let at_rest = model.link_orientation(link.joint, &model.n_pose_rad);
            links[link.segment.index()] = Some((link.joint, at_rest.inverse()));
            tracked[link.segment.index()] = true;
        }
        Self { links, tracked }
    }

    /// Segments in the world, the root at its origin. What no link shows is as what carries it.
    fn pose(&self, model: &RobotModel, angles: &[f64], base: DQuat) -> SegmentPose {
        let mut orientation = [base; 13];
        for segment in Segment::ALL {
            orientation[segment.index()] = match (self.links[segment.index()], segment.parent()) {
                (Some((joint, rest)), _) => base * model.link_orientation(joint, angles) * rest,
                (None, Some(parent)) if !model.base.contains(&segment) => {
                    orientation[parent.index()]
                }
                (None, _) => base,
            };
        }
        SegmentPose { root_m: DVec3::ZERO, orientation }
    }
}
