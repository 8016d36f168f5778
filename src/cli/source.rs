//! From a motion as typed to a path over the robot's joints.

pub mod joints;

use super::report::Source;
use crate::action::{Join, phrase, vocabulary};
use crate::body::{Proportions, Segment};
use crate::error::Error;
use crate::mocap::anatomy::{self, Capture};
use crate::mocap::bvh;
use crate::mocap::clip::Clip;
use crate::mocap::mapping::MappingFile;
use crate::mocap::retarget::{self, ModelJoint, Retargeted, RobotModel, SegmentLink};
use crate::motion::Path;
use crate::motion::plan::SPEEDS;
use crate::robot::Robot;
use clap::Args;
use gaitway_profiles as profiles;
use glam::DVec3;
use std::path::PathBuf;

/// Which motion, for which robot, and how much of it.
#[derive(Clone, Debug, Args)]
pub struct MotionArgs {
    /// A capture (.bvh), an action that ships with gaitway (walk), an action file (.toml), several
    /// actions (walk:6s,wave-r,bow), or a motion of the robot's own joints: a recording (.mcap),
    /// such as one guided by hand, or a table (.csv: time_s, JOINT_rad)
    motion: String,
    /// Robot by name, or path of its file (see `gaitway profile list`)
    #[arg(long)]
    robot: String,
    /// File that says which joint of the capture is which body segment (TOML)
    #[arg(long, value_name = "FILE.toml")]
    mapping: Option<PathBuf>,
    /// Playing speed: 0.5 is half as fast as recorded
    #[arg(long, value_name = "X", default_value_t = 1.0, value_parser = speed,
          allow_negative_numbers = true)]
    speed: f64,
    /// Play from this time of the capture, s
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    from: Option<f64>,
    /// Play to this time of the capture, s
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    to: Option<f64>,
    /// Move only these joints (comma between names); the others stay where they are
    #[arg(long, value_name = "JOINTS", value_delimiter = ',')]
    only: Vec<String>,
    /// Swap left and right
    #[arg(long)]
    mirror: bool,
    /// Slow the motion down until the robot can follow (the default for what a person did)
    #[arg(long, conflicts_with = "no_retime")]
    retime: bool,
    /// Refuse a motion the robot cannot follow at the speed asked for
    #[arg(long)]
    no_retime: bool,
}

/// Reads `--speed`.
fn speed(text: &str) -> Result<f64, String> {
    let speed: f64 = text.parse().map_err(|_| "not a number".to_owned())?;
    if SPEEDS.contains(&speed) {
        Ok(speed)
    } else {
        Err(format!("allowed: {} to {}", SPEEDS.start(), SPEEDS.end()))
    }
}

impl MotionArgs {
    /// The motion as typed.
    #[must_use]
    pub fn motion(&self) -> &str {
        &self.motion
    }

    /// The robot as typed.
    #[must_use]
    pub fn robot(&self) -> &str {
        &self.robot
    }

    /// Playing speed.
    #[must_use]
    pub const fn speed(&self) -> f64 {
        self.speed
    }
}

/// Poses per second of a performed action.
const ACTION_HZ: f64 = 120.0;
/// Stature of the body that performs actions, m.
const ACTION_STATURE_M: f64 = 1.75;

/// A motion on a robot's joints, before it is timed.
#[derive(Clone, Debug)]
pub struct Loaded {
    /// The motion as it came in.
    pub source: Source,
    /// Choices made on the way.
    pub notes: Vec<String>,
    only: Vec<String>,
    retargeted: Retargeted,
    /// True if it may be slowed down.
    pub retime: bool,
}

/// Reads the motion and transfers it to the robot's joints.
///
/// # Errors
/// An unreadable or malformed file, a skeleton that is no person, unknown joints in `--only`, a
/// section that is empty.
pub fn load(args: &MotionArgs, robot: &Robot) -> Result<Loaded, Error> {
    only(robot, &args.only)?;
    if let Some(motion) = joints::read(std::path::Path::new(&args.motion))? {
        return in_joints(args, robot, &motion);
    }
    let (mut capture, source) = body_motion(&args.motion, args.mapping.as_deref())?;
    if args.mirror {
        capture.mirror();
    }
    cut(&mut capture, args.from, args.to)?;
    let model = robot_model(&robot.file, robot);
    let initial_rad: Vec<f64> = robot.joints.iter().map(|joint| joint.initial_rad).collect();
    let settings = retarget::Settings::default();
    let retargeted = retarget::retarget(&capture, &model, &initial_rad, &settings)?;
    let notes = retargeted.notes.clone();
    // A person's motion is slowed by default; `--retime` says so explicitly.
    let retime = !args.no_retime;
    Ok(Loaded { source, notes, only: args.only.clone(), retargeted, retime })
}

/// Which joints `--only` names.
///
/// # Errors
/// A joint the robot does not have, or one that is named twice.
pub(super) fn only(robot: &Robot, names: &[String]) -> Result<Vec<usize>, Error> {
    let mut joints = Vec::with_capacity(names.len());
    for (at, name) in names.iter().enumerate() {
        let joint = robot.joints.iter().position(|joint| joint.name == *name).ok_or_else(|| {
            Error::new("the robot has no such joint")
                .at("--only")
                .got(name.clone())
                .allowed(robot.joint_names().join(", "))
        })?;
        if let Some(first) = joints.iter().position(|&other| other == joint) {
            return Err(Error::new("a joint is named twice")
                .at("--only")
                .got(format!("{name}: name {} and name {}", first + 1, at + 1))
                .allowed("each joint once"));
        }
        joints.push(joint);
    }
    Ok(joints)
}

/// A motion that is in the robot's joints already.
fn in_joints(
    args: &MotionArgs,
    robot: &Robot,
    motion: &joints::JointMotion,
) -> Result<Loaded, Error> {
    if args.mirror || args.mapping.is_some() {
        return Err(Error::new("this motion is in the robot's joints already")
            .at(args.motion.clone())
            .got(if args.mirror { "--mirror" } else { "--mapping" })
            .allowed("a capture or an action"));
    }
    let (retargeted, source) = motion.on(robot, args.from, args.to)?;
    // What a hand did is a person's motion; a trajectory was meant to be played as it is.
    let retime = if motion.taught { !args.no_retime } else { args.retime };
    Ok(Loaded { source, notes: Vec::new(), only: args.only.clone(), retargeted, retime })
}

/// Reads a capture, or performs actions, as a motion of body segments.
///
/// # Errors
/// An unreadable or malformed file, a skeleton that is no person, an unknown action.
pub fn body_motion(
    motion: &str,
    mapping: Option<&std::path::Path>,
) -> Result<(Capture, Source), Error> {
    if phrase::is_phrase(motion) {
        return performed(motion);
    }
    let path = std::path::Path::new(motion);
    if !path.extension().is_some_and(|e| e.eq_ignore_ascii_case("bvh")) {
        let shipped: Vec<&str> = vocabulary::names().collect();
        return Err(Error::new("not a motion I can read").at("MOTION").got(motion).allowed(
            format!(
                "a file that ends in .bvh, an action file (.toml), or a shipped action: {}",
                shipped.join(", ")
            ),
        ));
    }
    let mapping = mapping.map(read_mapping).transpose()?;
    let bvh = bvh::read(path)?;
    let source = Source {
        format: "bvh".to_owned(),
        frames: bvh.pose_count(),
        rate_hz: 1.0 / bvh.time_step_s,
        duration_s: bvh.pose_count().saturating_sub(1) as f64 * bvh.time_step_s,
    };
    let in_file = |e: Error| if e.place.is_none() { e.at(motion) } else { e };
    let clip = Clip::new(bvh, mapping.as_ref()).map_err(in_file)?;
    Ok((anatomy::capture(&clip).map_err(in_file)?, source))
}

/// Actions, performed by a body of usual stature.
fn performed(text: &str) -> Result<(Capture, Source), Error> {
    let motion = phrase::perform(&phrase::load(text)?, Join::Transition)?;
    let poses = motion.poses(&Proportions::of_stature(ACTION_STATURE_M)?, ACTION_HZ)?;
    let source = Source {
        format: "action".to_owned(),
        frames: poses.len(),
        rate_hz: ACTION_HZ,
        duration_s: motion.duration_s(),
    };
    let capture = Capture {
        rate_hz: ACTION_HZ,
        poses,
        tracked: [true; 13],
        stature_m: ACTION_STATURE_M,
        notes: Vec::new(),
    };
    Ok((capture, source))
}

fn read_mapping(path: &std::path::Path) -> Result<MappingFile, Error> {
    let text = profiles::read_text(path)?;
    MappingFile::parse(&text).map_err(|e| e.at(path.display().to_string()))
}

/// Keeps the poses from `from` to `to`, s.
fn cut(capture: &mut Capture, from: Option<f64>, to: Option<f64>) -> Result<(), Error> {
    if from.is_none() && to.is_none() {
        return Ok(());
    }
    let last = capture.poses.len().saturating_sub(1);
    let end_s = last as f64 / capture.rate_hz;
    let (from_s, to_s) = (from.unwrap_or(0.0), to.unwrap_or(end_s));
    if !(from_s >= 0.0 && from_s < to_s && to_s <= end_s + 0.5 / capture.rate_hz) {
        return Err(Error::new("no such section in the capture")
            .at("--from, --to")
            .got(format!("{from_s} to {to_s} s"))
            .allowed(format!("0 to {end_s:.3} s, the end after the beginning")));
    }
    let index = |time_s: f64| ((time_s * capture.rate_hz).round() as usize).min(last);
    let (first, end) = (index(from_s), index(to_s));
    capture.poses.truncate(end + 1);
    capture.poses.drain(..first);
    Ok(())
}

/// The robot as retargeting sees it.
#[must_use]
pub fn robot_model(file: &profiles::Robot, robot: &Robot) -> RobotModel {
    let index = |name: &str| file.joints.iter().position(|joint| joint.name == name);
    let joints = file.joints.iter().zip(&robot.joints).map(|(joint, resolved)| ModelJoint {
        name: joint.name.clone(),
        parent: joint.parent.as_deref().and_then(index),
        origin_m: DVec3::from_array(joint.origin_m),
        // Files round their numbers; a turn needs a length of exactly one.
        axis: DVec3::from_array(joint.axis).normalize_or_zero(),
        lower_rad: resolved.limits.lower_rad(),
        upper_rad: resolved.limits.upper_rad(),
    });
    let n_pose = |joint: &profiles::Joint| file.anatomy.n_pose_rad.get(&joint.name).copied();
    let links = file.anatomy.segments.iter().filter_map(|link| {
        Some(SegmentLink {
            segment: segment(link.segment),
            joint: index(&link.joint)?,
            direction_weight: link.direction_weight,
            twist_weight: link.twist_weight,
        })
    });
    RobotModel {
        joints: joints.collect(),
        base: file.anatomy.base.iter().copied().map(segment).collect(),
        n_pose_rad: file.joints.iter().map(|joint| n_pose(joint).unwrap_or(0.0)).collect(),
        links: links.collect(),
    }
}

const fn segment(segment: profiles::Segment) -> Segment {
    match segment {
        profiles::Segment::Pelvis => Segment::Pelvis,
        profiles::Segment::Torso => Segment::Torso,
        profiles::Segment::Head => Segment::Head,
        profiles::Segment::LeftUpperArm => Segment::LeftUpperArm,
        profiles::Segment::LeftForearm => Segment::LeftForearm,
        profiles::Segment::RightUpperArm => Segment::RightUpperArm,
        profiles::Segment::RightForearm => Segment::RightForearm,
        profiles::Segment::LeftThigh => Segment::LeftThigh,
        profiles::Segment::LeftShank => Segment::LeftShank,
        profiles::Segment::LeftFoot => Segment::LeftFoot,
        profiles::Segment::RightThigh => Segment::RightThigh,
        profiles::Segment::RightShank => Segment::RightShank,
        profiles::Segment::RightFoot => Segment::RightFoot,
    }
}

impl Loaded {
    /// The path over all joints; those the motion does not drive stay at `start_rad`.
    ///
    /// # Errors
    /// As [`Path::new`].
    pub fn path_from(&self, robot: &Robot, start_rad: &[f64]) -> Result<Path, Error> {
        let samples = self.samples();
        let rows = robot.joints.iter().zip(start_rad).map(|(joint, &start)| {
            match self.series(&joint.name) {
                Some(series) => series.clone(),
                None => vec![start; samples],
            }
        });
        Path::new(robot.joint_names(), self.retargeted.rate_hz, rows.collect())
    }

    /// Angles of a joint the motion drives.
    fn series(&self, joint: &str) -> Option<&Vec<f64>> {
        if !self.only.is_empty() && !self.only.iter().any(|name| name == joint) {
            return None;
        }
        let index = self.retargeted.joints.iter().position(|name| name == joint)?;
        self.retargeted.positions_rad.get(index)
    }

    /// Poses of the motion.
    #[must_use]
    pub fn samples(&self) -> usize {
        self.retargeted.positions_rad.first().map_or(0, Vec::len)
    }

    fn of_joint<T: Copy + Default>(&self, joint: &str, values: &[T]) -> T {
        let index = self.retargeted.joints.iter().position(|name| name == joint);
        index.and_then(|index| values.get(index).copied()).unwrap_or_default()
    }

    /// Poses in which saturation moved a joint.
    #[must_use]
    pub fn clipped_samples(&self, joint: &str) -> usize {
        self.of_joint(joint, &self.retargeted.clipped_samples)
    }

    /// Share of poses in which the fit holds a joint at its limit.
    #[must_use]
    pub fn at_limit_share(&self, joint: &str) -> f64 {
        self.of_joint(joint, &self.retargeted.at_limit_share)
    }
}
