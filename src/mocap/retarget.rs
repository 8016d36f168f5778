//! A captured motion on a robot's joints.
//!
//! What is carried over is how each segment is turned against the trunk, as a rotation: the
//! robot's link that plays a segment is to be turned from its N pose as the segment is from its
//! own. No table of axes and no Euler angles take part. Per pose and group of connected joints,
//! least squares finds the angles:
//!
//! * direction: the link's long axis along the segment's (weight per link),
//! * twist: the turn about the long axis (weight per link, zero where it does not matter),
//! * hands: of an arm that lacks an axis, where the hand is from the shoulder on,
//! * limits: a penalty that grows past a joint's limit, so that other joints make up for it,
//! * middle: a faint pull to the middle of the range, for angles nothing else settles,
//! * velocity: a penalty on speed, over the whole clip at once and blind to the direction of time.
//!   Angles that the segments settle well are hardly touched; where a robot's shoulder or hip is
//!   singular and an angle counts for little, it changes slowly instead of spinning,
//! * acceleration: a penalty where the robot cannot follow, so that it does not chase what it will
//!   not reach.
//!
//! The result is filtered without delay and bent smoothly into the limits. A motion without noise is
//! not filtered where the robot can do it: its joints do exactly what the body does (`exact`).

use crate::body::segment_name;
use crate::body::{Segment, SegmentPose};
use crate::error::{Error, counted};
use crate::mocap::anatomy::Capture;
use crate::motion::path::end_velocity;
use crate::motion::saturate;
use crate::motion::smooth::{Rests, low_pass_between};
use crate::units::wrap_rad;
use glam::{DQuat, DVec3};
use serde::Serialize;

pub mod banded;
mod copied;
mod exact;
mod group;
mod online;
mod refine;
mod solve;

pub use copied::copied;
use group::Group;
pub use online::Online;

/// A joint of a robot; same meaning as in a robot profile.
#[derive(Clone, Debug)]
pub struct ModelJoint {
    /// Name.
    pub name: String,
    /// Index of the joint whose link carries this one; none: the base.
    pub parent: Option<usize>,
    /// Origin in the parent link's frame, m, all joints at zero.
    pub origin_m: DVec3,
    /// Axis of rotation, unit length; link frames are parallel to the base at zero.
    pub axis: DVec3,
    /// Lowest angle, rad.
    pub lower_rad: f64,
    /// Highest angle, rad.
    pub upper_rad: f64,
}

/// A link that plays a human segment.
#[derive(Clone, Copy, Debug)]
pub struct SegmentLink {
    /// The segment.
    pub segment: Segment,
    /// Index of the last joint before the link.
    pub joint: usize,
    /// Weight of the direction of the segment's long axis; 1 = normal.
    pub direction_weight: f64,
    /// Weight of the turn about the long axis; 0 = ignored.
    pub twist_weight: f64,
}

/// Where the hand of an arm is that lacks an axis: what its links cannot show by how they point it shows by where it
/// is.
#[derive(Clone, Copy, Debug)]
pub struct Hand {
    /// Upper arm and forearm.
    pub segments: [Segment; 2],
    /// Joint before the link that the shoulder is in, and where in its axes, m.
    pub shoulder: (usize, DVec3),
    /// The same of the hand.
    pub hand: (usize, DVec3),
    /// Length of upper arm and forearm of a person whose arm is as long as the robot's, m.
    pub lengths_m: [f64; 2],
}

/// What retargeting needs to know of a robot.
#[derive(Clone, Debug)]
pub struct RobotModel {
    /// Joints, in the order of every list of angles.
    pub joints: Vec<ModelJoint>,
    /// Segments the base plays: pelvis, torso or both.
    pub base: Vec<Segment>,
    /// Angles in which the robot stands as a person does in N pose, rad; limits do not matter.
    pub n_pose_rad: Vec<f64>,
    /// Links that play a segment.
    pub links: Vec<SegmentLink>,
    /// Hands that are brought to where a person's would be.
    pub hands: Vec<Hand>,
}

/// How the solved angles are treated.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    /// Cutoff of the low-pass filter, Hz. Voluntary human movement lies below 6 Hz (Winter, sec.
    /// 3.4.4.3). Lowered to 0.4 of the capture's rate where that is less.
    pub cutoff_hz: f64,
    /// Distance from a limit, rad, from which on angles are bent.
    pub margin_rad: f64,
    /// The motion has no noise, since it was made and not measured: limbs that can do what the body
    /// does are neither filtered nor calmed. The filter then only rounds the corners where a robot
    /// comes to the edge of what it can do.
    pub exact: bool,
}

impl Default for Settings {
    fn default() -> Self {
        Self { cutoff_hz: 6.0, margin_rad: 0.05, exact: false }
    }
}

/// A motion of a robot's joints, evenly sampled; not yet slowed down to what its servos can do.
#[derive(Clone, Debug)]
pub struct Retargeted {
    /// Joint names, in the order of the lists below.
    pub joints: Vec<String>,
    /// Samples per second.
    pub rate_hz: f64,
    /// Angles as the fit wants them, filtered if they have noise, rad, `[joint][sample]`; may exceed
    /// limits.
    pub wanted_rad: Vec<Vec<f64>>,
    /// Angles inside the limits, rad, `[joint][sample]`.
    pub positions_rad: Vec<Vec<f64>>,
    /// Samples of each joint that the limits moved by more than 0.01 rad. The fit itself heeds the
    /// limits, so these are few; what a robot cannot reach shows in `at_limit_share` and
    /// `fit_error_deg`.
    pub clipped_samples: Vec<usize>,
    /// The same as a share of all samples, 0 to 1.
    pub clipped_share: Vec<f64>,
    /// Share of samples in which a joint stands within the margin of a limit, 0 to 1: there the
    /// robot's range decides, not the person.
    pub at_limit_share: Vec<f64>,
    /// Mean angle between the long axes of segment and link at `positions_rad`, degrees.
    pub fit_error_deg: Vec<(Segment, f64)>,
    /// What the robot cannot show of how the trunk leans, as [`trunk_lean_lost`].
    pub trunk_lean_lost: Option<TrunkLean>,
    /// What was found out, a line each.
    pub notes: Vec<String>,
}

/// How far a trunk leans against its pelvis: the angle between the long axes of torso and pelvis.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct TrunkLean {
    /// Farthest, deg.
    pub most_deg: f64,
    /// When, s from the first pose.
    pub at_s: f64,
    /// Mean over the poses, deg.
    pub mean_deg: f64,
}

/// A sample counts as clipped if the limits moved it by more than this, rad.
const CLIPPED_RAD: f64 = 0.01;
/// A lean that is lost is said in the notes from here on, deg.
const NOTED_LEAN_DEG: f64 = 5.0;
/// Joints at a limit for more than this share of the poses are said in the notes.
const NOTED_SHARE: f64 = 0.2;

/// An end of a clip is at rest if no segment turns faster there, rad/s: a sway, not yet a movement.
const STILL_RAD_S: f64 = 0.05;

/// Turns a capture into joint angles of a robot. Joints that move no link of `model.links` stay at
/// `initial_rad`.
///
/// # Errors
/// If the model contradicts itself, or a limb the robot needs is not in the capture. (A missing
/// head is left to the robot: its joints stay where they are.)
pub fn retarget(
    capture: &Capture,
    model: &RobotModel,
    initial_rad: &[f64],
    settings: &Settings,
) -> Result<Retargeted, Error> {
    let mut notes = capture.notes.clone();
    let mut wanted_rad = wanted(capture, model, initial_rad, &mut notes)?;
    let cutoff_hz = settings.cutoff_hz.min(0.4 * capture.rate_hz);
    let rests = rests(capture);
    for series in &mut wanted_rad {
        *series = low_pass_between(series, capture.rate_hz, cutoff_hz, rests)?;
    }
    if settings.exact {
        for group in Group::all(model, &usable_links(capture, model, &mut Vec::new())?) {
            exact::lay_over(&group, capture, rests, &mut wanted_rad);
        }
    }
    judged(capture, model, wanted_rad, settings.margin_rad, notes)
}

/// Bends angles into the limits, and says what that and the robot's build cost.
fn judged(
    capture: &Capture,
    model: &RobotModel,
    wanted_rad: Vec<Vec<f64>>,
    margin_rad: f64,
    mut notes: Vec<String>,
) -> Result<Retargeted, Error> {
    let positions_rad: Vec<Vec<f64>> = wanted_rad
        .iter()
        .zip(&model.joints)
        .map(|(series, joint)| {
            let bent = |angle: &f64| saturate(*angle, joint.lower_rad, joint.upper_rad, margin_rad);
            series.iter().map(bent).collect()
        })
        .collect();
    let clipped_samples: Vec<usize> = wanted_rad
        .iter()
        .zip(&positions_rad)
        .map(|(wanted, held)| {
            let untouched = |(w, h): &(&f64, &f64)| (*w - *h).abs() <= CLIPPED_RAD;
            held.len() - wanted.iter().zip(held).filter(untouched).count()
        })
        .collect();
    let count = capture.poses.len().max(1) as f64;
    let at_limit = |(held, joint): (&Vec<f64>, &ModelJoint)| {
        let inside = joint.lower_rad + margin_rad..=joint.upper_rad - margin_rad;
        held.iter().filter(|angle| !inside.contains(*angle)).count() as f64 / count
    };
    let at_limit_share: Vec<f64> = positions_rad.iter().zip(&model.joints).map(at_limit).collect();
    for (share, joint) in at_limit_share.iter().zip(&model.joints) {
        if *share > NOTED_SHARE {
            let percent = share * 100.0;
            notes.push(format!("{} is at its limit in {percent:.0} % of the poses", joint.name));
        }
    }
    let trunk_lean_lost = trunk_lean_lost(capture, model);
    notes.extend(trunk_lean_lost.and_then(TrunkLean::note));
    Ok(Retargeted {
        joints: model.joints.iter().map(|joint| joint.name.clone()).collect(),
        rate_hz: capture.rate_hz,
        clipped_share: clipped_samples.iter().map(|clipped| *clipped as f64 / count).collect(),
        clipped_samples,
        at_limit_share,
        fit_error_deg: fit_error_deg(capture, model, &positions_rad)?,
        trunk_lean_lost,
        wanted_rad,
        positions_rad,
        notes,
    })
}

/// The angles the fit wants, neither filtered nor bent into the limits: `[joint][sample]`, rad,
/// without jumps of a turn.
///
/// # Errors
/// As [`retarget`].
pub fn wanted(
    capture: &Capture,
    model: &RobotModel,
    initial_rad: &[f64],
    notes: &mut Vec<String>,
) -> Result<Vec<Vec<f64>>, Error> {
    model.check(initial_rad)?;
    let used = usable_links(capture, model, notes)?;
    let rests = rests(capture);
    let mut angles: Vec<Vec<f64>> =
        initial_rad.iter().map(|angle| vec![*angle; capture.poses.len()]).collect();
    for group in Group::all(model, &used) {
        let solved = solve::clip(&group, capture, rests, initial_rad);
        for (row, joint) in group.joints().iter().enumerate() {
            let mut series: Vec<f64> = solved.iter().map(|angles| angles[row]).collect();
            let joint_model = &model.joints[*joint];
            unwrap(&mut series, (joint_model.lower_rad + joint_model.upper_rad) / 2.0);
            angles[*joint] = series;
        }
    }
    Ok(angles)
}

/// What a robot that lacks a waist cannot show of a capture: how the trunk leans against the pelvis.
/// Its base follows the pelvis, its arms and head are as on the trunk. `None` for other robots.
#[must_use]
pub fn trunk_lean_lost(capture: &Capture, model: &RobotModel) -> Option<TrunkLean> {
    if !model.lacks_waist() {
        return None;
    }
    let lean = |pose: &SegmentPose| pose.torso_lean_rad().to_degrees();
    let leans: Vec<f64> = capture.poses.iter().map(lean).collect();
    let farthest = (0..leans.len()).max_by(|a, b| leans[*a].total_cmp(&leans[*b]))?;
    Some(TrunkLean {
        most_deg: leans[farthest],
        at_s: farthest as f64 / capture.rate_hz,
        mean_deg: leans.iter().sum::<f64>() / leans.len() as f64,
    })
}

impl TrunkLean {
    /// A sentence for who watches a robot that lacks a waist, unless it is little.
    #[must_use]
    pub fn note(self) -> Option<String> {
        let Self { most_deg, at_s, mean_deg } = self;
        (most_deg >= NOTED_LEAN_DEG).then(|| {
            format!(
                "the robot has no waist joint: it does not show how the trunk leans against the \
                 pelvis, up to {most_deg:.0} deg (at {at_s:.2} s; {mean_deg:.0} deg on average)"
            )
        })
    }
}

/// The links whose segments the capture has.
fn usable_links(
    capture: &Capture,
    model: &RobotModel,
    notes: &mut Vec<String>,
) -> Result<Vec<SegmentLink>, Error> {
    let is_tracked = |segment: Segment| capture.tracked[segment.index()];
    let mut used = Vec::with_capacity(model.links.len());
    for link in &model.links {
        if is_tracked(link.segment) {
            used.push(*link);
        } else if link.segment == Segment::Head {
            notes.push("the capture has no head: the robot's head stays where it is".to_owned());
        } else {
            let name = segment_name(link.segment);
            return Err(Error::new("the capture lacks a segment that the robot needs")
                .got(format!("no {name}"))
                .remedy("name its joint in a mapping file if the skeleton has it"));
        }
    }
    Ok(used)
}

/// At which ends no segment turns.
fn rests(capture: &Capture) -> Rests {
    let poses = &capture.poses;
    let still = |at: fn(usize, usize) -> usize| {
        let turned = |segment: usize, i: usize| {
            let of = |i: usize| poses[at(i, poses.len())].orientation[segment];
            (of(0).inverse() * of(i)).to_scaled_axis()
        };
        let speed = |(segment, axis): (usize, usize)| {
            let angle = |i| turned(segment, i)[axis];
            end_velocity(poses.len(), 1.0 / capture.rate_hz, angle).abs()
        };
        let mut all =
            (0..capture.tracked.len()).flat_map(|segment| (0..3).map(move |i| (segment, i)));
        poses.len() >= 4 && all.all(|at| speed(at) <= STILL_RAD_S)
    };
    Rests { start: still(|i, _| i), end: still(|i, count| count - 1 - i) }
}

/// Takes jumps of whole turns out of a series and shifts it by turns to lie about `middle`.
fn unwrap(series: &mut [f64], middle: f64) {
    let Some(mut last) = series.first().copied() else { return };
    for angle in series.iter_mut() {
        last += wrap_rad(*angle - last);
        *angle = last;
    }
    let mean = series.iter().sum::<f64>() / series.len() as f64;
    let shift = wrap_rad(mean - middle) - (mean - middle);
    series.iter_mut().for_each(|angle| *angle += shift);
}

fn fit_error_deg(
    capture: &Capture,
    model: &RobotModel,
    angles: &[Vec<f64>],
) -> Result<Vec<(Segment, f64)>, Error> {
    let used = usable_links(capture, model, &mut Vec::new())?;
    let mut errors = Vec::with_capacity(used.len());
    for group in Group::all(model, &used) {
        let mut sums = vec![0.0; group.links().len()];
        let mut at = vec![0.0; group.joints().len()];
        for (sample, pose) in capture.poses.iter().enumerate() {
            for (angle, joint) in at.iter_mut().zip(group.joints()) {
                *angle = angles[*joint][sample];
            }
            for (sum, error) in sums.iter_mut().zip(group.direction_errors_rad(&at, pose)) {
                *sum += error;
            }
        }
        for (sum, link) in sums.iter().zip(group.links()) {
            let mean = sum / capture.poses.len().max(1) as f64;
            errors.push((link.segment, mean.to_degrees()));
        }
    }
    Ok(errors)
}

impl RobotModel {
    /// True if the base follows a pelvis and no joint turns a torso against it.
    #[must_use]
    pub fn lacks_waist(&self) -> bool {
        let is_torso = |link: &SegmentLink| link.segment == Segment::Torso;
        self.base.contains(&Segment::Pelvis) && !self.links.iter().any(is_torso)
    }

    /// The segment whose frame `segment` is taken against: of those the base plays, the nearest
    /// that carries it.
    fn reference(&self, segment: Segment) -> Segment {
        let carriers = std::iter::successors(Some(segment), |segment| segment.parent());
        carriers.into_iter().find(|s| self.base.contains(s)).unwrap_or(self.base[0])
    }

    /// Orientation of a segment against what the base plays.
    fn target(&self, segment: Segment, pose: &SegmentPose) -> DQuat {
        let base = pose.orientation[self.reference(segment).index()];
        base.inverse() * pose.orientation[segment.index()]
    }

    /// Orientation of a joint's link in the base frame, `angles` by joint.
    #[must_use]
    pub fn link_orientation(&self, joint: usize, angles: &[f64]) -> DQuat {
        let joints = std::iter::successors(Some(joint), |at| self.joints[*at].parent);
        joints.fold(DQuat::IDENTITY, |below, at| {
            DQuat::from_axis_angle(self.joints[at].axis, angles[at]) * below
        })
    }

    /// Refuses a model that contradicts itself.
    fn check(&self, initial_rad: &[f64]) -> Result<(), Error> {
        let count = self.joints.len();
        let lengths = [("n_pose_rad", self.n_pose_rad.len()), ("initial_rad", initial_rad.len())];
        for (what, length) in lengths {
            if length != count {
                return Err(Error::new(format!("{what} does not fit the robot's joints"))
                    .got(counted(length, "angle"))
                    .allowed(format!("{count}")));
            }
        }
        if self.base.is_empty() {
            return Err(Error::new("the robot's base plays no segment"));
        }
        for joint in &self.joints {
            let sound = joint.axis.is_normalized()
                && joint.lower_rad < joint.upper_rad
                && joint.parent.is_none_or(|parent| parent < count);
            if !sound {
                return Err(Error::new("a joint of the robot is not usable")
                    .at(format!("joint {}", joint.name))
                    .allowed("an axis of unit length, a lower limit below the upper, a parent"));
            }
        }
        for at in 0..count {
            let chain = std::iter::successors(Some(at), |at| self.joints[*at].parent);
            if chain.take(count + 1).count() > count {
                return Err(Error::new("the joints of the robot carry one another in a circle")
                    .at(format!("joint {}", self.joints[at].name)));
            }
        }
        match self.links.iter().find(|link| link.joint >= count) {
            Some(link) => Err(Error::new("a link belongs to no joint")
                .at(segment_name(link.segment))
                .got(link.joint.to_string())),
            None => Ok(()),
        }
    }
}
