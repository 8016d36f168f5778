//! From joints as a file turns them to segments as anatomy turns them.
//!
//! A file's bone frames are arbitrary: models are drawn as T, as A, as N, or with every bone along
//! one axis. The anatomical frame of a segment (see [`crate::body`]) is fixed in its bone frame,
//! so one constant rotation per segment is all there is to find. It is found like this:
//!
//! * Reference poses tell how bones lie in a person who stands straight: the rest pose of the file
//!   where it has one, else the poses of the clip that stand straightest.
//! * Pelvis: Y along the hip joints. Z up in the rest pose; without one, halfway between trunk and
//!   thighs in the standing poses, since a hip flexes about as far below the pelvis as above it.
//! * Torso: the rest pose; without one, Z along the trunk in the standing poses and Y, on average
//!   over the clip, along the shoulder joints.
//! * Head: the rest pose; without one, straight on the torso on average over the clip.
//! * Thigh, shank, upper arm, forearm: Z along the bone, exactly. Y along the hinge of knee or
//!   elbow, which is where bending turns: the mean over the clip of the cross product of the two
//!   bone directions, weighted with the bend (a straight limb says little, and that with noise).
//!   Its sign is anatomy's: knees bend backwards, elbows forwards. Where a limb hardly bends, a
//!   prior takes over: the segment swung from N pose into its reference direction without twist;
//!   for legs without a rest pose, the knee bends towards where the toes point.
//! * Foot: Z up while the foot stands still on the floor, X towards the toes. Never on the floor,
//!   it is flat in the rest pose; without one, the toes are as far below the ankle as usual.

use crate::body::segment_name;
use crate::body::{Segment, SegmentPose};
use crate::error::Error;
use crate::mocap::clip::Clip;
use crate::mocap::landmarks::Landmarks;
use crate::mocap::mapping::{ARMS, LEGS};
use crate::mocap::skeleton::Placed;
use glam::{DMat3, DQuat, DVec3};

/// Poses looked at for the constants.
const SAMPLES: usize = 600;
/// Weight of the prior of a hinge, as the cubed sine of a bend: 14 degrees.
const HINGE_PRIOR: f64 = 0.014;
/// Standing poses are those within this much of the straightest, as a mean cosine.
const AS_STRAIGHT: f64 = 0.02;
/// A body stands if its trunk and its thighs are in line to this cosine.
const STANDING: f64 = 0.7;
/// Slope of the line from ankle to toes below a flat foot's sole, rad: an ankle 0.039 of stature
/// high (Winter, fig. 4.1), the ball of the foot some 2 cm, 0.14 m ahead.
const TOE_SLOPE_RAD: f64 = 0.33;
/// A flat foot found further than this from where it should be was not flat, rad.
const FLAT_DOUBT_RAD: f64 = 0.7;
/// A foot on the floor moves slower than this, m/s, and is this near its lowest, m.
const STILL_M_S: f64 = 0.3;
const NEAR_FLOOR_M: f64 = 0.03;

/// A captured motion as a body moves: what a robot, a recogniser or a simulator starts from.
#[derive(Clone, Debug, PartialEq)]
pub struct Capture {
    /// Poses per second.
    pub rate_hz: f64,
    /// The poses. The world is turned about Z and shifted level so that the person starts at the
    /// origin and faces +X; heights are the file's.
    pub poses: Vec<SegmentPose>,
    /// Which segments the skeleton has, by [`Segment::index`]; the others follow their parent.
    pub tracked: [bool; 13],
    /// Stature estimated from limb lengths, m.
    pub stature_m: f64,
    /// What was found out about the file, a line each.
    pub notes: Vec<String>,
}

/// The constant rotation of each segment.
#[derive(Clone, Debug)]
pub struct Anatomy {
    /// Joint that carries the segment, and its anatomical frame in that joint's frame.
    frames: [Option<(usize, DQuat)>; 13],
}

/// Reads a clip into a motion of segments.
///
/// # Errors
/// If hips or trunk cannot be located.
pub fn capture(clip: &Clip) -> Result<Capture, Error> {
    let mut notes = clip.notes().to_vec();
    let anatomy = Anatomy::calibrate(clip, &mut notes)?;
    let mut placed = Placed::default();
    let mut poses: Vec<SegmentPose> = (0..clip.pose_count())
        .map(|index| {
            clip.place(index, &mut placed);
            anatomy.pose(clip.landmarks(&placed))
        })
        .collect();
    face_forward(&mut poses);
    Ok(Capture {
        rate_hz: clip.rate_hz(),
        poses,
        tracked: anatomy.frames.map(|frame| frame.is_some()),
        stature_m: clip.stature_m(),
        notes,
    })
}

/// Turns and shifts the world so that the first pose stands at the origin and faces +X.
fn face_forward(poses: &mut [SegmentPose]) {
    let Some(first) = poses.first() else { return };
    let facing = first.orientation[Segment::Pelvis.index()] * DVec3::X;
    let turn = DQuat::from_rotation_z(-facing.y.atan2(facing.x));
    let start = DVec3::new(first.root_m.x, first.root_m.y, 0.0);
    for pose in poses {
        pose.root_m = turn * (pose.root_m - start);
        for orientation in &mut pose.orientation {
            *orientation = (turn * *orientation).normalize();
        }
    }
}

/// A pose in which the person stands straight.
struct Reference {
    placed: Placed,
    /// True if it is drawn, not captured: upright to the degree.
    is_drawn: bool,
}

/// What calibration looks at.
struct Calibration<'a> {
    clip: &'a Clip,
    samples: Vec<Placed>,
    references: Vec<Reference>,
    frames: [Option<(usize, DQuat)>; 13],
}

impl Anatomy {
    /// Finds the constants of a clip; says in `notes` how.
    ///
    /// # Errors
    /// If hips or trunk cannot be located.
    pub fn calibrate(clip: &Clip, notes: &mut Vec<String>) -> Result<Self, Error> {
        let samples: Vec<Placed> = clip
            .samples(SAMPLES)
            .map(|index| {
                let mut placed = Placed::default();
                clip.place(index, &mut placed);
                placed
            })
            .collect();
        let references = references(clip, &samples);
        if references.is_empty() {
            return Err(Error::new("the trunk of the body cannot be located")
                .allowed("hips and shoulders, neck or head, apart from one another")
                .remedy("name the joints in a mapping file"));
        }
        let count = references.len();
        notes.push(if references[0].is_drawn {
            "segment frames: from the rest pose and from how knees, elbows and feet move".to_owned()
        } else {
            format!(
                "segment frames: from the {count} straightest poses (the file has no usable rest \
                 pose) and from how knees, elbows and feet move"
            )
        });
        let mut calibration = Calibration { clip, samples, references, frames: [None; 13] };
        calibration.trunk()?;
        for side in 0..2 {
            calibration.leg(LEGS[side]);
            calibration.arm(ARMS[side]);
        }
        calibration.head();
        let missing: Vec<&str> = Segment::ALL
            .iter()
            .filter(|segment| calibration.frames[segment.index()].is_none())
            .map(|segment| segment_name(*segment))
            .collect();
        if !missing.is_empty() {
            notes.push(format!("not in the skeleton: {}", missing.join(", ")));
        }
        Ok(Self { frames: calibration.frames })
    }

    /// The segments of a placed skeleton.
    #[must_use]
    pub fn pose(&self, body: Landmarks<'_>) -> SegmentPose {
        let mut orientation = [DQuat::IDENTITY; 13];
        for segment in Segment::ALL {
            let own = self.frames[segment.index()]
                .map(|(carrier, frame)| (body.placed.rotation[carrier] * frame).normalize());
            let parent = segment.parent().map(|parent| orientation[parent.index()]);
            orientation[segment.index()] = own.or(parent).unwrap_or(DQuat::IDENTITY);
        }
        SegmentPose { root_m: body.hips(), orientation }
    }
}

/// The rest pose if the file has one, else the captured poses that stand straightest.
fn references(clip: &Clip, samples: &[Placed]) -> Vec<Reference> {
    if let Some(placed) = clip.rest() {
        return vec![Reference { placed, is_drawn: true }];
    }
    let straightness = |placed: &Placed| {
        let body = clip.landmarks(placed);
        let trunk = body.trunk()?;
        body.across()?;
        let legs = LEGS.iter().flat_map(|leg| &leg[..2]).filter_map(|part| body.direction(*part));
        let cosines: Vec<f64> = std::iter::once(trunk.z).chain(legs.map(|leg| -leg.z)).collect();
        Some(cosines.iter().sum::<f64>() / cosines.len() as f64)
    };
    let scores: Vec<Option<f64>> = samples.iter().map(straightness).collect();
    let best = scores.iter().flatten().copied().fold(f64::NEG_INFINITY, f64::max);
    let straight = |score: &Option<f64>| score.is_some_and(|score| score >= best - AS_STRAIGHT);
    let chosen = samples.iter().zip(&scores).filter(|(_, score)| straight(score));
    chosen.map(|(placed, _)| Reference { placed: placed.clone(), is_drawn: false }).collect()
}

impl Calibration<'_> {
    fn carrier(&self, segment: Segment) -> Option<usize> {
        Some(self.clip.mapping().part(segment)?.carrier)
    }

    fn set(&mut self, segment: Segment, frame: Option<DQuat>) {
        self.frames[segment.index()] = self.carrier(segment).zip(frame);
    }

    /// The segment's anatomical frame in the world, once known.
    fn frame(&self, segment: Segment, placed: &Placed) -> Option<DQuat> {
        let (carrier, frame) = self.frames[segment.index()]?;
        Some(placed.rotation[carrier] * frame)
    }

    /// Mean over the samples of a direction, in the frame of a joint; not normalised.
    fn mean_in(
        &self,
        joint: usize,
        direction: impl Fn(Landmarks<'_>) -> Option<DVec3>,
    ) -> Option<DVec3> {
        let local = self.samples.iter().filter_map(|placed| {
            Some(placed.rotation[joint].inverse() * direction(self.clip.landmarks(placed))?)
        });
        let (sum, count) = local.fold((DVec3::ZERO, 0.0), |(sum, count), d| (sum + d, count + 1.0));
        (count > 0.0).then(|| sum / count)
    }

    /// Mean over the reference poses of a frame given in the world, in the frame of a joint.
    fn reference_mean(
        &self,
        joint: usize,
        frame: impl Fn(Landmarks<'_>, &Reference) -> Option<(DQuat, f64)>,
    ) -> Option<DQuat> {
        mean_rotation(self.references.iter().filter_map(|reference| {
            let body = self.clip.landmarks(&reference.placed);
            let (frame, weight) = frame(body, reference)?;
            Some((reference.placed.rotation[joint].inverse() * frame, weight))
        }))
    }

    /// Pelvis and torso.
    fn trunk(&mut self) -> Result<(), Error> {
        let missing = || Error::new("pelvis and torso cannot be located");
        let pelvis = self.carrier(Segment::Pelvis).ok_or_else(missing)?;
        let frame = self.reference_mean(pelvis, |body, reference| {
            let thighs = LEGS.iter().filter_map(|leg| body.direction(leg[0])).sum::<DVec3>();
            let trunk = body.trunk()?;
            let thighs = thighs.normalize_or_zero();
            // Who sits all the time shows nothing of the pelvis by the thighs.
            let stands = trunk.dot(-thighs) > STANDING;
            let along = if stands { trunk - thighs } else { trunk };
            let up = if reference.is_drawn { DVec3::Z } else { along };
            Some((across_and_up(body.across()?, up)?, 1.0))
        });
        self.set(Segment::Pelvis, frame);
        if let Some(torso) = self.carrier(Segment::Torso) {
            let shoulders = self.mean_in(torso, |body| body.shoulder_line());
            let frame = self.reference_mean(torso, |body, reference| {
                if reference.is_drawn {
                    return Some((across_and_up(body.across()?, DVec3::Z)?, 1.0));
                }
                let across = shoulders.map(|line| body.placed.rotation[torso] * line);
                let up = body.trunk()?;
                Some((up_and_across(up, across.or_else(|| body.across())?)?, 1.0))
            });
            self.set(Segment::Torso, frame);
        }
        if frame.is_none() { Err(missing()) } else { Ok(()) }
    }

    fn head(&mut self) {
        let Some(head) = self.carrier(Segment::Head) else { return };
        let frame = if self.is_drawn() {
            self.reference_mean(head, |body, _| {
                Some((across_and_up(body.across()?, DVec3::Z)?, 1.0))
            })
        } else {
            mean_rotation(self.samples.iter().filter_map(|placed| {
                let torso = self.frame(Segment::Torso, placed)?;
                Some((placed.rotation[head].inverse() * torso, 1.0))
            }))
        };
        self.set(Segment::Head, frame);
    }

    fn is_drawn(&self) -> bool {
        self.references.first().is_some_and(|reference| reference.is_drawn)
    }

    fn arm(&mut self, [upper, lower]: [Segment; 2]) {
        let bend = |body: Landmarks<'_>| bend(body, lower, upper);
        for segment in [upper, lower] {
            let prior = self.swung(Segment::Torso, segment);
            self.hinged(segment, bend, prior.map(|frame| frame * DVec3::Y));
        }
    }

    fn leg(&mut self, [thigh, shank, foot]: [Segment; 3]) {
        let bend = |body: Landmarks<'_>| bend(body, thigh, shank);
        let swung = |calibration: &Self, segment| {
            Some(calibration.swung(Segment::Pelvis, segment)? * DVec3::Y)
        };
        // The bend of the knee in the thigh follows from that in the shank: it is one hinge.
        let by_toes = self.carrier(shank).filter(|_| !self.is_drawn()).and_then(|carrier| {
            self.mean_in(carrier, |body| Some(body.direction(foot)?.cross(body.direction(shank)?)))
        });
        self.hinged(shank, bend, by_toes.or_else(|| swung(self, shank)));
        let by_shank = self.carrier(thigh).filter(|_| !self.is_drawn()).and_then(|carrier| {
            let (_, frame) = self.frames[shank.index()]?;
            let shank = self.carrier(shank)?;
            self.mean_in(carrier, |body| Some(body.placed.rotation[shank] * frame * DVec3::Y))
        });
        self.hinged(thigh, bend, by_shank.or_else(|| swung(self, thigh)));
        self.foot(foot, shank);
    }

    /// The frame of a segment, in its carrier's, if it lies in the reference poses as it would
    /// after a swing from N pose without twist. `above` is the segment that carries the limb.
    fn swung(&self, above: Segment, segment: Segment) -> Option<DQuat> {
        self.reference_mean(self.carrier(segment)?, |body, reference| {
            let carried = self.frame(above, &reference.placed)?;
            let direction = body.direction(segment)?;
            let hanging = carried * DVec3::NEG_Z;
            // The swing is ambiguous for a limb that points up: such poses hardly count.
            let weight = (1.0 + hanging.dot(direction)).powi(2) + 1e-6;
            Some((DQuat::from_rotation_arc(hanging, direction) * carried, weight))
        })
    }

    /// A segment on one side of a hinge: Z exactly along the bone, Y along the mean of `bend`, or
    /// along `prior` (carrier's frame) as far as that says nothing.
    fn hinged(
        &mut self,
        segment: Segment,
        bend: impl Fn(Landmarks<'_>) -> Option<DVec3>,
        prior: Option<DVec3>,
    ) {
        let Some(carrier) = self.carrier(segment) else { return };
        let along = self.mean_in(carrier, |body| body.direction(segment));
        let Some(along) = along.and_then(DVec3::try_normalize) else { return };
        let hinge = self.mean_in(carrier, bend).unwrap_or(DVec3::ZERO);
        let prior = prior.map_or(DVec3::ZERO, |axis| axis.reject_from(along).normalize_or_zero());
        self.set(segment, up_and_across(-along, hinge + prior * HINGE_PRIOR));
    }

    /// A foot: flat while it stands still on the floor.
    fn foot(&mut self, foot: Segment, shank: Segment) {
        let Some(carrier) = self.carrier(foot) else { return };
        let ahead = self.mean_in(carrier, |body| body.direction(foot));
        let ahead = ahead.filter(|ahead| ahead.length() > 0.5);
        let prior = if self.is_drawn() {
            self.reference_mean(carrier, |body, reference| {
                let knee = self.frame(shank, &reference.placed).map(|shank| shank * DVec3::X);
                let ahead = body.direction(foot).or(knee)?;
                Some((up_and_ahead(DVec3::Z, ahead).or(up_and_ahead(DVec3::Z, knee?))?, 1.0))
            })
        } else {
            self.sloping(carrier, shank, ahead)
        };
        let on_floor = self.up_on_floor(foot, carrier).filter(|up| {
            prior.is_none_or(|prior| up.angle_between(prior * DVec3::Z) < FLAT_DOUBT_RAD)
        });
        let up = on_floor.or(prior.map(|prior| prior * DVec3::Z));
        let ahead = ahead.or(prior.map(|prior| prior * DVec3::X));
        let frame = up.zip(ahead).and_then(|(up, ahead)| up_and_ahead(up, ahead));
        self.set(foot, frame.or(prior));
    }

    /// The frame of a foot whose toes lie as far below the ankle as usual, and whose left is the
    /// shank's on average; without toes, the shank's frame on average.
    fn sloping(&self, carrier: usize, shank: Segment, ahead: Option<DVec3>) -> Option<DQuat> {
        let shanks = self.samples.iter().filter_map(|placed| {
            Some((placed.rotation[carrier].inverse() * self.frame(shank, placed)?, 1.0))
        });
        let shank = mean_rotation(shanks)?;
        let Some(ahead) = ahead else { return Some(shank) };
        let left = (shank * DVec3::Y).reject_from(ahead).try_normalize()?;
        let forward = DQuat::from_axis_angle(left, -TOE_SLOPE_RAD) * ahead;
        up_and_ahead(forward.cross(left), forward)
    }

    /// World up in the foot's joint frame while the foot stands on the floor, if it ever does.
    fn up_on_floor(&self, foot: Segment, carrier: usize) -> Option<DVec3> {
        let clip = self.clip;
        let ends = |placed: &Placed| {
            let body = clip.landmarks(placed);
            let ankle = body.joint(foot)?;
            Some([ankle, ankle + body.bone(foot)?])
        };
        let places: Vec<[DVec3; 2]> = self.samples.iter().filter_map(&ends).collect();
        let floor = [0, 1].map(|end| {
            let mut heights: Vec<f64> = places.iter().map(|place| place[end].z).collect();
            heights.sort_by(f64::total_cmp);
            heights.get(heights.len() / 10).copied().unwrap_or(0.0) + NEAR_FLOOR_M
        });
        let (mut sum, mut count) = (DVec3::ZERO, 0);
        let mut next = Placed::default();
        for (index, placed) in clip.samples(SAMPLES).zip(&self.samples) {
            let here = ends(placed)?;
            let low = (0..2).all(|end| here[end].z <= floor[end]);
            if !low || index + 1 >= clip.pose_count() {
                continue;
            }
            clip.place(index + 1, &mut next);
            let there = ends(&next)?;
            let still = |end: usize| (there[end] - here[end]).length() * clip.rate_hz() < STILL_M_S;
            if still(0) && still(1) {
                sum += placed.rotation[carrier].inverse() * DVec3::Z;
                count += 1;
            }
        }
        let up = sum / f64::from(count.max(1));
        (count >= 3 && up.length() > 0.95).then(|| up.normalize())
    }
}

/// Where bending turns, weighted with the cube of its sine: the cross product of the directions of
/// two bones, times its squared length.
fn bend(body: Landmarks<'_>, one: Segment, other: Segment) -> Option<DVec3> {
    let cross = body.direction(one)?.cross(body.direction(other)?);
    Some(cross * cross.length_squared())
}

/// Frame of three orthonormal axes, given right-handed.
fn frame_of(x: DVec3, y: DVec3, z: DVec3) -> DQuat {
    DQuat::from_mat3(&DMat3::from_cols(x, y, z)).normalize()
}

/// Frame with Y exactly along `across` and Z as near `up` as that allows.
fn across_and_up(across: DVec3, up: DVec3) -> Option<DQuat> {
    let y = across.try_normalize()?;
    let x = y.cross(up).try_normalize()?;
    Some(frame_of(x, y, x.cross(y)))
}

/// Frame with Z exactly along `up` and Y as near `across` as that allows.
fn up_and_across(up: DVec3, across: DVec3) -> Option<DQuat> {
    let z = up.try_normalize()?;
    let x = across.cross(z).try_normalize()?;
    Some(frame_of(x, z.cross(x), z))
}

/// Frame with Z exactly along `up` and X as near `ahead` as that allows.
fn up_and_ahead(up: DVec3, ahead: DVec3) -> Option<DQuat> {
    let z = up.try_normalize()?;
    let y = z.cross(ahead).try_normalize()?;
    Some(frame_of(y.cross(z), y, z))
}

/// Weighted mean of rotations that are close together (normalised sum, signs aligned).
fn mean_rotation(rotations: impl Iterator<Item = (DQuat, f64)>) -> Option<DQuat> {
    let mut sum: Option<DQuat> = None;
    for (rotation, weight) in rotations {
        sum = Some(match sum {
            None => rotation * weight,
            Some(sum) if sum.dot(rotation) < 0.0 => sum - rotation * weight,
            Some(sum) => sum + rotation * weight,
        });
    }
    sum.filter(|sum| sum.length() > 1e-9).map(DQuat::normalize)
}

impl Capture {
    /// The pose at a time, s, between the samples around it; the first before the beginning, the
    /// last after the end. A capture without poses stands in N pose.
    #[must_use]
    pub fn at(&self, time_s: f64) -> SegmentPose {
        let Some(last) = self.poses.len().checked_sub(1) else {
            return crate::body::JointAngles::default().to_pose(DVec3::ZERO, DQuat::IDENTITY);
        };
        let sample = (time_s * self.rate_hz).max(0.0);
        let first = (sample.floor() as usize).min(last);
        let share = (sample - first as f64).clamp(0.0, 1.0);
        self.poses[first].towards(&self.poses[(first + 1).min(last)], share)
    }

    /// Exchanges left and right.
    pub fn mirror(&mut self) {
        for pose in &mut self.poses {
            *pose = pose.mirrored();
        }
        let tracked = self.tracked;
        for segment in Segment::ALL {
            self.tracked[segment.index()] = tracked[segment.mirrored().index()];
        }
    }
}
