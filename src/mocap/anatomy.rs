//! From joints as a file turns them to segments as anatomy turns them.
//!
//! A file's bone frames are arbitrary: models are drawn as T, as A, as N, or with every bone along
//! one axis. The anatomical frame of a segment (see [`crate::body`]) is fixed in its bone frame,
//! so one constant rotation per segment is all there is to find. It belongs to the skeleton and not
//! to a clip: it is found once for all clips of a skeleton that are at hand
//! ([`crate::mocap::siblings`]). It is found like this:
//!
//! * Reference poses tell how bones lie in a person who stands straight: the rest pose of the
//!   skeleton where it has one, else the poses of the clips that stand straightest.
//! * Pelvis: Y along the hip joints. Z up in the rest pose; without one, halfway between trunk and
//!   thighs in the standing poses, since a hip flexes about as far below the pelvis as above it.
//! * Torso: the rest pose; without one, Z along the trunk in the standing poses and Y,
//!   on average over the clips, along the shoulder joints.
//! * Head: the rest pose; without one, straight on the torso on average while the trunk is upright.
//! * A rest pose may be drawn as nobody stands: with the head or the chest bent. In N pose
//!   all frames are equal, so people who stand upright in the clips show it. A frame that is tilted
//!   by more than anybody's posture explains is set upright, by as little as the two witnesses ask
//!   for: the body around it (trunk and thighs) and the vertical. Who stoops leans with all of the trunk, and
//!   keeps it: the frame is set upright against the trunk.
//! * Without a rest pose, a frame of these that is found within some degrees of the bone's own axes
//!   is taken along them, as the skeleton was built.
//! * Thigh, shank, upper arm, forearm: Z along the bone, exactly. Y along the hinge of knee or
//!   elbow, which is where bending turns: the mean over the clips of the cross product of the two
//!   bone directions, weighted with the bend (a straight limb says little, and that with noise).
//!   Its sign is anatomy's: knees bend backwards, elbows forwards. Where a limb hardly bends, a
//!   prior takes over: the segment swung from N pose into its reference direction without twist;
//!   for legs without a rest pose, the knee bends towards where the toes point.
//! * Foot: flat as in the rest pose, X towards the toes. Where it stands otherwise while it stands
//!   still on the floor, Z is up there; without a rest pose and never on the floor, the toes are as
//!   far below the ankle as usual.

use crate::body::segment_name;
use crate::body::{Segment, SegmentPose};
use crate::error::Error;
use crate::mocap::clip::Clip;
use crate::mocap::landmarks::Landmarks;
use crate::mocap::mapping::{ARMS, LEGS};
use crate::mocap::skeleton::Placed;
use glam::{DMat3, DQuat, DVec3};
use serde::Serialize;

mod poses;

pub use poses::{Poses, Stance};

/// Weight of the prior of a hinge, as the cubed sine of a bend: 14 degrees.
const HINGE_PRIOR: f64 = 0.014;
/// Standing poses are those within this much of the straightest, as a mean cosine of trunk and legs.
const AS_STRAIGHT: f64 = 0.02;
/// A body stands if its trunk and its thighs are in line to this cosine.
const STANDING: f64 = 0.7;
/// Cosine of the lean of a trunk that is upright, on average over the standing poses: 14 degrees.
const UPRIGHT: f64 = 0.97;
/// The same for one pose in which somebody may look straight ahead: 26 degrees.
const TRUNK_UP: f64 = 0.9;
/// A pelvis or torso that is drawn further than this from how people stand is drawn tilted, rad: actors
/// who play old people hold the chest 16 degrees forward of the line from hips to shoulders.
const TRUNK_DOUBT_RAD: f64 = 18.0 * DEGREE;
/// The same for the head, which people bend forward more, and longer, but do not hold thrown back.
const HEAD_DOUBT_RAD: f64 = 25.0 * DEGREE;
const HEAD_BACK_DOUBT_RAD: f64 = 12.0 * DEGREE;
/// Whoever draws a skeleton lays the bones' own axes along the body: a frame that is found in motion this
/// near to them is along them, rad.
const AS_BUILT_RAD: f64 = 6.0 * DEGREE;
/// Steps to a geometric median, and what is as near as can be, rad.
const ITERATIONS: usize = 10;
const NEAR_RAD: f64 = DEGREE;
const DEGREE: f64 = core::f64::consts::PI / 180.0;
/// Slope of the line from ankle to toes below a flat foot's sole, rad: an ankle 0.039 of stature
/// high (Winter, fig. 4.1), the ball of the foot some 2 cm, 0.14 m ahead.
const TOE_SLOPE_RAD: f64 = 0.33;
/// A foot found flat on the floor within this of how it is drawn flat is as it is drawn, rad: a
/// walking foot is never still for long. From three times as far on it is as it was found, and
/// between the two in between.
const FLAT_AS_DRAWN_RAD: f64 = 3.0 * DEGREE;
/// A flat foot found further than this from where it should be was not flat, rad.
const FLAT_DOUBT_RAD: f64 = 0.7;

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
    /// True of an action, whose soles are on the floor exactly where they carry; false of what was measured.
    pub is_made: bool,
    /// What was found out about the file, a line each.
    pub notes: Vec<String>,
}

/// What showed how the trunk and the head of a skeleton lie in a person who stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Posture {
    /// The rest pose that the skeleton is drawn in.
    Drawn,
    /// Poses of the clips in which somebody stands upright.
    Upright,
    /// The straightest poses of clips in which nobody stands upright: all that leans is taken for
    /// straight.
    Straightest,
}

/// The constant rotation of each segment of a skeleton.
#[derive(Clone, Debug)]
pub struct Anatomy {
    /// Joint that carries the segment, and its anatomical frame in that joint's frame.
    frames: [Option<(usize, DQuat)>; 13],
    posture: Posture,
    /// Captured poses that stand straightest.
    straight: usize,
    /// Captured poses looked at.
    poses: usize,
    /// Segments that are drawn as nobody stands, and by how much, rad.
    tilted: Vec<(Segment, f64)>,
}

/// Reads a clip into a motion of segments, by what it shows alone.
///
/// # Errors
/// If hips or trunk cannot be located.
pub fn capture(clip: &Clip) -> Result<Capture, Error> {
    Ok(Anatomy::find(&Poses::of(clip))?.capture(clip))
}

/// Turns and shifts the world so that the first pose stands at the origin and faces +X.
pub(super) fn face_forward(poses: &mut [SegmentPose]) {
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

/// What the search for the constants looks at, and what it has found.
struct Search<'a> {
    poses: &'a Poses,
    /// Captured poses that stand straightest.
    straight: Vec<&'a Stance>,
    /// True if people stand upright in these.
    upright: bool,
    frames: [Option<(usize, DQuat)>; 13],
    tilted: Vec<(Segment, f64)>,
}

impl Anatomy {
    /// Finds the constants of a skeleton.
    ///
    /// # Errors
    /// If hips or trunk cannot be located.
    pub fn find(poses: &Poses) -> Result<Self, Error> {
        let straight = straightest(poses);
        if poses.drawn().is_empty() && straight.is_empty() {
            return Err(Error::new("the trunk of the body cannot be located")
                .allowed("hips and shoulders, neck or head, apart from one another")
                .remedy("name the joints in a mapping file"));
        }
        let up = |stance: &&Stance| poses.body(stance).trunk().map_or(0.0, |trunk| trunk.z);
        let uprightness = straight.iter().map(up).sum::<f64>() / straight.len().max(1) as f64;
        let upright = uprightness >= UPRIGHT;
        let posture = match (poses.drawn().is_empty(), upright) {
            (false, _) => Posture::Drawn,
            (true, true) => Posture::Upright,
            (true, false) => Posture::Straightest,
        };
        let mut search =
            Search { poses, straight, upright, frames: [None; 13], tilted: Vec::new() };
        search.trunk()?;
        for (side, arm) in ARMS.into_iter().enumerate() {
            search.leg(side);
            search.arm(arm);
        }
        search.head();
        Ok(Self {
            frames: search.frames,
            posture,
            straight: search.straight.len(),
            poses: poses.captured().len(),
            tilted: search.tilted,
        })
    }

    /// The joint that carries a segment, and the segment's anatomical frame in that joint's frame.
    #[must_use]
    pub const fn frame(&self, segment: Segment) -> Option<(usize, DQuat)> {
        self.frames[segment.index()]
    }

    /// What showed how a person of this skeleton stands.
    #[must_use]
    pub const fn posture(&self) -> Posture {
        self.posture
    }

    /// Captured poses looked at.
    #[must_use]
    pub const fn pose_count(&self) -> usize {
        self.poses
    }

    /// Segments that are drawn as nobody stands, and by how much, rad.
    #[must_use]
    pub fn tilted_rad(&self) -> &[(Segment, f64)] {
        &self.tilted
    }

    /// Sixteen digits that tell frames apart: equal ones have the same (FNV-1a of the quaternions,
    /// rounded to a millionth).
    #[must_use]
    pub fn fingerprint(&self) -> String {
        let number = |frame: &Option<(usize, DQuat)>| -> [i64; 5] {
            let Some((carrier, frame)) = frame else { return [-1; 5] };
            // A quaternion and its opposite are one rotation.
            let sign = if frame.w < 0.0 { -1.0 } else { 1.0 };
            let part = |value: f64| (sign * value * 1e6).round() as i64;
            [*carrier as i64, part(frame.x), part(frame.y), part(frame.z), part(frame.w)]
        };
        let bytes = self.frames.iter().flat_map(number).flat_map(i64::to_le_bytes);
        let hash = bytes.fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| {
            (hash ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3)
        });
        format!("{hash:016x}")
    }

    /// How the constants were found, a line each.
    #[must_use]
    pub fn notes(&self) -> Vec<String> {
        let moving = "how knees, elbows and feet move";
        let poses = match self.straight {
            1 => "the straightest pose".to_owned(),
            count => format!("the {count} straightest poses"),
        };
        let mut notes = vec![match self.posture {
            Posture::Drawn => format!("segment frames: from the rest pose and from {moving}"),
            Posture::Upright => format!(
                "segment frames: from {poses} (there is no usable rest pose) \
                 and from {moving}"
            ),
            Posture::Straightest => format!(
                "segment frames: from {poses} (there is no usable rest pose, \
                 and nobody stands upright: what all poses lean is taken for straight) and from \
                 {moving}"
            ),
        }];
        for (segment, tilt_rad) in &self.tilted {
            notes.push(format!(
                "the rest pose is drawn with the {} tilted by {:.0} deg from how people stand here: \
                 set upright",
                segment_name(*segment),
                tilt_rad.to_degrees()
            ));
        }
        let untracked = |segment: &&Segment| self.frames[segment.index()].is_none();
        let missing: Vec<&str> =
            Segment::ALL.iter().filter(untracked).map(|segment| segment_name(*segment)).collect();
        if !missing.is_empty() {
            notes.push(format!("not in the skeleton: {}", missing.join(", ")));
        }
        notes
    }

    /// A clip of the skeleton as a motion of segments.
    #[must_use]
    pub fn capture(&self, clip: &Clip) -> Capture {
        let mut placed = Placed::default();
        let mut poses: Vec<SegmentPose> = (0..clip.pose_count())
            .map(|index| {
                clip.place(index, &mut placed);
                self.pose(clip.landmarks(&placed))
            })
            .collect();
        face_forward(&mut poses);
        Capture {
            rate_hz: clip.rate_hz(),
            poses,
            tracked: self.frames.map(|frame| frame.is_some()),
            stature_m: clip.stature_m(),
            is_made: false,
            notes: clip.notes().iter().cloned().chain(self.notes()).collect(),
        }
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

/// The captured poses that stand straightest.
fn straightest(poses: &Poses) -> Vec<&Stance> {
    let straightness = |stance: &Stance| {
        let body = poses.body(stance);
        let trunk = body.trunk()?;
        body.across()?;
        let legs = LEGS.iter().flat_map(|leg| &leg[..2]).filter_map(|part| body.direction(*part));
        let legs: Vec<f64> = legs.map(|leg| -leg.z).collect();
        // Of a body without legs the trunk alone.
        let (sum, count) = (legs.iter().sum::<f64>(), legs.len() as f64);
        Some(if legs.is_empty() { trunk.z } else { trunk.z.midpoint(sum / count) })
    };
    let scores: Vec<Option<f64>> = poses.captured().iter().map(straightness).collect();
    let best = scores.iter().flatten().copied().fold(f64::NEG_INFINITY, f64::max);
    let straight = |score: &Option<f64>| score.is_some_and(|score| score >= best - AS_STRAIGHT);
    let chosen = poses.captured().iter().zip(&scores).filter(|(_, score)| straight(score));
    chosen.map(|(stance, _)| stance).collect()
}

/// The frame of a body that is drawn standing upright.
fn drawn_frame(body: Landmarks<'_>) -> Option<DQuat> {
    across_and_up(body.across()?, DVec3::Z)
}

impl Search<'_> {
    fn set(&mut self, segment: Segment, frame: Option<DQuat>) {
        let is_trunk = matches!(segment, Segment::Pelvis | Segment::Torso | Segment::Head);
        let frame = if is_trunk && !self.is_drawn() { frame.map(as_built) } else { frame };
        self.frames[segment.index()] = self.poses.carrier(segment).zip(frame);
    }

    /// The segment's anatomical frame in the world, once known.
    fn frame(&self, segment: Segment, placed: &Placed) -> Option<DQuat> {
        let (carrier, frame) = self.frames[segment.index()]?;
        Some(placed.rotation[carrier] * frame)
    }

    fn is_drawn(&self) -> bool {
        !self.poses.drawn().is_empty()
    }

    /// Mean over poses of a direction given in the world, in the frame of a joint; not normalised.
    fn mean_over<'s>(
        &self,
        stances: impl Iterator<Item = &'s Stance>,
        joint: usize,
        direction: impl Fn(Landmarks<'_>) -> Option<DVec3>,
    ) -> Option<DVec3> {
        let local = stances.filter_map(|stance| {
            let direction = direction(self.poses.body(stance))?;
            Some(stance.placed.rotation[joint].inverse() * direction)
        });
        let (sum, count) = local.fold((DVec3::ZERO, 0.0), |(sum, count), d| (sum + d, count + 1.0));
        (count > 0.0).then(|| sum / count)
    }

    /// The same over all captured poses.
    fn mean_in(
        &self,
        joint: usize,
        direction: impl Fn(Landmarks<'_>) -> Option<DVec3>,
    ) -> Option<DVec3> {
        self.mean_over(self.poses.captured().iter(), joint, direction)
    }

    /// What is typical of a frame given in the world with a weight, in the frame of a joint.
    fn typical_frame<'s>(
        &self,
        stances: impl Iterator<Item = &'s Stance>,
        joint: usize,
        frame: impl Fn(Landmarks<'_>) -> Option<(DQuat, f64)>,
    ) -> Option<DQuat> {
        typical_rotation(stances.filter_map(|stance| {
            let (frame, weight) = frame(self.poses.body(stance))?;
            Some((stance.placed.rotation[joint].inverse() * frame, weight))
        }))
    }

    /// The frame of a segment in its joint's frame, as the rest pose is drawn.
    fn as_drawn(&self, joint: usize) -> Option<DQuat> {
        let upright = |body: Landmarks<'_>| Some((drawn_frame(body)?, 1.0));
        self.typical_frame(self.poses.drawn().iter(), joint, upright)
    }

    /// A drawn frame of trunk or head, set upright if nobody stands as it is drawn: if people who stand
    /// would lean by more than `doubt_rad`, forward or back. `up` is up along the body around the
    /// segment; the vertical is the second witness.
    fn as_people_stand(
        &mut self,
        segment: Segment,
        joint: usize,
        drawn: DQuat,
        doubt_rad: [f64; 2],
        up: impl Fn(&Self, Landmarks<'_>) -> Option<DVec3>,
    ) -> DQuat {
        if !self.upright {
            return drawn;
        }
        let search: &Self = self;
        let drawn_up = drawn * DVec3::Z;
        let straight = || search.straight.iter().copied();
        let along = search.mean_over(straight(), joint, |body| up(search, body));
        let vertical = search.mean_over(straight(), joint, |_| Some(DVec3::Z));
        let witnesses = [along, vertical].into_iter().flatten().filter_map(DVec3::try_normalize);
        let tilts = witnesses.map(|witness| (witness, witness.angle_between(drawn_up)));
        // Up ahead of what is drawn as up: drawn so, people would lean back.
        let is_back = |up: DVec3| (drawn.inverse() * up).x > 0.0;
        match tilts.min_by(|a, b| a.1.total_cmp(&b.1)) {
            Some((witness, tilt_rad)) if tilt_rad > doubt_rad[usize::from(is_back(witness))] => {
                self.tilted.push((segment, tilt_rad));
                (DQuat::from_rotation_arc(drawn_up, witness) * drawn).normalize()
            }
            _ => drawn,
        }
    }

    /// Pelvis and torso.
    fn trunk(&mut self) -> Result<(), Error> {
        let missing = || Error::new("pelvis and torso cannot be located");
        let pelvis = self.poses.carrier(Segment::Pelvis).ok_or_else(missing)?;
        let frame = match self.as_drawn(pelvis) {
            Some(drawn) => {
                let up = |_: &Self, body: Landmarks<'_>| pelvis_up(body);
                let (segment, doubt_rad) = (Segment::Pelvis, [TRUNK_DOUBT_RAD; 2]);
                Some(self.as_people_stand(segment, pelvis, drawn, doubt_rad, up))
            }
            None => self.typical_frame(self.straight.iter().copied(), pelvis, |body| {
                Some((across_and_up(body.across()?, pelvis_up(body)?)?, 1.0))
            }),
        };
        self.set(Segment::Pelvis, frame);
        if let Some(torso) = self.poses.carrier(Segment::Torso) {
            let frame = match self.as_drawn(torso) {
                Some(drawn) => {
                    let up = |_: &Self, body: Landmarks<'_>| body.trunk();
                    let (segment, doubt_rad) = (Segment::Torso, [TRUNK_DOUBT_RAD; 2]);
                    Some(self.as_people_stand(segment, torso, drawn, doubt_rad, up))
                }
                None => {
                    let shoulders = self.mean_in(torso, |body| body.shoulder_line());
                    self.typical_frame(self.straight.iter().copied(), torso, |body| {
                        let across = shoulders.map(|line| body.placed.rotation[torso] * line);
                        let across = across.or_else(|| body.across())?;
                        Some((up_and_across(body.trunk()?, across)?, 1.0))
                    })
                }
            };
            self.set(Segment::Torso, frame);
        }
        if frame.is_none() { Err(missing()) } else { Ok(()) }
    }

    fn head(&mut self) {
        let Some(head) = self.poses.carrier(Segment::Head) else { return };
        let torso = |search: &Self, body: Landmarks<'_>| search.frame(Segment::Torso, body.placed);
        let frame = match self.as_drawn(head) {
            Some(drawn) => {
                let up = |search: &Self, body: Landmarks<'_>| Some(torso(search, body)? * DVec3::Z);
                let (segment, doubt_rad) = (Segment::Head, [HEAD_DOUBT_RAD, HEAD_BACK_DOUBT_RAD]);
                Some(self.as_people_stand(segment, head, drawn, doubt_rad, up))
            }
            None => {
                let search: &Self = self;
                // A few straight poses may look aside: over all in which the trunk is upright, nobody does.
                let is_up =
                    |body: Landmarks<'_>| body.trunk().is_some_and(|trunk| trunk.z > TRUNK_UP);
                let straight = |body: Landmarks<'_>| Some((torso(search, body)?, 1.0));
                let upright = |body: Landmarks<'_>| if is_up(body) { straight(body) } else { None };
                let all = || search.poses.captured().iter();
                search
                    .typical_frame(all(), head, upright)
                    .or_else(|| search.typical_frame(all(), head, straight))
            }
        };
        self.set(Segment::Head, frame);
    }

    fn arm(&mut self, [upper, lower]: [Segment; 2]) {
        let bend = |body: Landmarks<'_>| bend(body, lower, upper);
        for segment in [upper, lower] {
            let prior = self.swung(Segment::Torso, segment);
            self.hinged(segment, bend, prior.map(|frame| frame * DVec3::Y));
        }
    }

    fn leg(&mut self, side: usize) {
        let [thigh, shank, foot] = LEGS[side];
        let bend = |body: Landmarks<'_>| bend(body, thigh, shank);
        let swung =
            |search: &Self, segment| Some(search.swung(Segment::Pelvis, segment)? * DVec3::Y);
        // The bend of the knee in the thigh follows from that in the shank: it is one hinge.
        let by_toes = self.poses.carrier(shank).filter(|_| !self.is_drawn()).and_then(|carrier| {
            self.mean_in(carrier, |body| Some(body.direction(foot)?.cross(body.direction(shank)?)))
        });
        self.hinged(shank, bend, by_toes.or_else(|| swung(self, shank)));
        let by_shank = self.poses.carrier(thigh).filter(|_| !self.is_drawn()).and_then(|carrier| {
            let (shank, frame) = self.frames[shank.index()]?;
            self.mean_in(carrier, |body| Some(body.placed.rotation[shank] * frame * DVec3::Y))
        });
        self.hinged(thigh, bend, by_shank.or_else(|| swung(self, thigh)));
        self.foot(side);
    }

    /// The frame of a segment, in its carrier's, if it lies in the reference poses as it would
    /// after a swing from N pose without twist. `above` is the segment that carries the limb.
    fn swung(&self, above: Segment, segment: Segment) -> Option<DQuat> {
        let joint = self.poses.carrier(segment)?;
        let swung = |body: Landmarks<'_>, carried: DQuat| {
            let direction = body.direction(segment)?;
            let hanging = carried * DVec3::NEG_Z;
            // The swing is ambiguous for a limb that points up: such poses hardly count.
            let weight = (1.0 + hanging.dot(direction)).powi(2) + 1e-6;
            Some((DQuat::from_rotation_arc(hanging, direction) * carried, weight))
        };
        if self.is_drawn() {
            let drawn = |body: Landmarks<'_>| swung(body, drawn_frame(body)?);
            return self.typical_frame(self.poses.drawn().iter(), joint, drawn);
        }
        let standing = |body: Landmarks<'_>| swung(body, self.frame(above, body.placed)?);
        self.typical_frame(self.straight.iter().copied(), joint, standing)
    }

    /// A segment on one side of a hinge: Z exactly along the bone, Y along the mean of `bend`, or
    /// along `prior` (carrier's frame) as far as that says nothing.
    fn hinged(
        &mut self,
        segment: Segment,
        bend: impl Fn(Landmarks<'_>) -> Option<DVec3>,
        prior: Option<DVec3>,
    ) {
        let Some(carrier) = self.poses.carrier(segment) else { return };
        let along = self.mean_in(carrier, |body| body.direction(segment));
        let Some(along) = along.and_then(DVec3::try_normalize) else { return };
        let hinge = self.mean_in(carrier, bend).unwrap_or(DVec3::ZERO);
        let prior = prior.map_or(DVec3::ZERO, |axis| axis.reject_from(along).normalize_or_zero());
        self.set(segment, up_and_across(-along, hinge + prior * HINGE_PRIOR));
    }

    /// A foot: flat as it is drawn, or as it is while it stands still on the floor.
    fn foot(&mut self, side: usize) {
        let [_, shank, foot] = LEGS[side];
        let Some(carrier) = self.poses.carrier(foot) else { return };
        let ahead = self.mean_in(carrier, |body| body.direction(foot));
        let ahead = ahead.filter(|ahead| ahead.length() > 0.5);
        let drawn = self.typical_frame(self.poses.drawn().iter(), carrier, |body| {
            let knee = self.frame(shank, body.placed).map(|shank| shank * DVec3::X);
            let ahead = body.direction(foot).or(knee)?;
            Some((up_and_ahead(DVec3::Z, ahead).or(up_and_ahead(DVec3::Z, knee?))?, 1.0))
        });
        let prior = if self.is_drawn() { drawn } else { self.sloping(carrier, shank, ahead) };
        let prior_up = prior.map(|prior| prior * DVec3::Z);
        let on_floor = self.up_on_floor(side, carrier).and_then(|up| {
            let Some(drawn) = prior_up.filter(|_| self.is_drawn()) else { return Some(up) };
            let (from_rad, to_rad) = (FLAT_AS_DRAWN_RAD, 3.0 * FLAT_AS_DRAWN_RAD);
            let share = (up.angle_between(drawn) - from_rad) / (to_rad - from_rad);
            drawn.lerp(up, share.clamp(0.0, 1.0)).try_normalize()
        });
        let on_floor = on_floor
            .filter(|up| prior_up.is_none_or(|prior| up.angle_between(prior) < FLAT_DOUBT_RAD));
        let up = on_floor.or(prior_up);
        let ahead = ahead.or(prior.map(|prior| prior * DVec3::X));
        let frame = up.zip(ahead).and_then(|(up, ahead)| up_and_ahead(up, ahead));
        self.set(foot, frame.or(prior));
    }

    /// The frame of a foot whose toes lie as far below the ankle as usual, and whose left is the
    /// shank's on average; without toes, the shank's frame on average.
    fn sloping(&self, carrier: usize, shank: Segment, ahead: Option<DVec3>) -> Option<DQuat> {
        let shank = self.typical_frame(self.poses.captured().iter(), carrier, |body| {
            Some((self.frame(shank, body.placed)?, 1.0))
        })?;
        let Some(ahead) = ahead else { return Some(shank) };
        let left = (shank * DVec3::Y).reject_from(ahead).try_normalize()?;
        let forward = DQuat::from_axis_angle(left, -TOE_SLOPE_RAD) * ahead;
        up_and_ahead(forward.cross(left), forward)
    }

    /// World up in the foot's joint frame while the foot stands on the floor, if it ever does.
    fn up_on_floor(&self, side: usize, carrier: usize) -> Option<DVec3> {
        let stands = self.poses.captured().iter().filter(|stance| stance.foot_stands[side]);
        let ups: Vec<DVec3> =
            stands.map(|stance| stance.placed.rotation[carrier].inverse() * DVec3::Z).collect();
        let mean = ups.iter().sum::<DVec3>() / ups.len().max(1) as f64;
        (ups.len() >= 3 && mean.length() > 0.95).then(|| mean.normalize())
    }
}

/// Up along the pelvis: halfway between trunk and thighs of who stands. Who sits shows nothing of the
/// pelvis by the thighs.
fn pelvis_up(body: Landmarks<'_>) -> Option<DVec3> {
    let thighs = LEGS.iter().filter_map(|leg| body.direction(leg[0])).sum::<DVec3>();
    let (trunk, thighs) = (body.trunk()?, thighs.normalize_or_zero());
    let stands = trunk.dot(-thighs) > STANDING;
    (if stands { trunk - thighs } else { trunk }).try_normalize()
}

/// Where bending turns, weighted with the cube of its sine: the cross product of the directions of
/// two bones, times its squared length.
fn bend(body: Landmarks<'_>, one: Segment, other: Segment) -> Option<DVec3> {
    let cross = body.direction(one)?.cross(body.direction(other)?);
    Some(cross * cross.length_squared())
}

/// A frame whose axes lie within [`AS_BUILT_RAD`] of the bone's own, along these; any other as it is.
fn as_built(frame: DQuat) -> DQuat {
    let nearest = |axis: DVec3| {
        let size = axis.abs();
        match size.max_element() {
            most if most == size.x => DVec3::X * axis.x.signum(),
            most if most == size.y => DVec3::Y * axis.y.signum(),
            _ => DVec3::Z * axis.z.signum(),
        }
    };
    let (x, z) = (nearest(frame * DVec3::X), nearest(frame * DVec3::Z));
    let built = frame_of(x, z.cross(x), z);
    let is_near = x.dot(z) == 0.0 && built.angle_between(frame) < AS_BUILT_RAD;
    if is_near { built } else { frame }
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

/// The rotation from which some weighted ones are least far away in sum (their geometric median, by
/// Weiszfeld's iteration): where a third of them is of people who stoop, it is that of the others.
fn typical_rotation(rotations: impl Iterator<Item = (DQuat, f64)>) -> Option<DQuat> {
    let rotations: Vec<(DQuat, f64)> = rotations.collect();
    let mut typical = mean_rotation(rotations.iter().copied())?;
    for _ in 0..ITERATIONS {
        let nearer = rotations.iter().map(|(rotation, weight)| {
            (*rotation, weight / (rotation.angle_between(typical) + NEAR_RAD))
        });
        typical = mean_rotation(nearer).unwrap_or(typical);
    }
    Some(typical)
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

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_frame_near_the_axes_of_its_bone_is_along_them_and_another_stays(
            (a, b, c) in (0u8..4, 0u8..4, 0u8..4),
            axis in prop::array::uniform3(-1.0..1.0),
            off_deg in 0.0_f64..20.0,
        ) {
            let quarter = |turns: u8| f64::from(turns) * core::f64::consts::FRAC_PI_2;
            let built = DQuat::from_rotation_x(quarter(a))
                * DQuat::from_rotation_y(quarter(b))
                * DQuat::from_rotation_z(quarter(c));
            let axis = DVec3::from_array(axis).try_normalize().unwrap_or(DVec3::X);
            let frame = built * DQuat::from_axis_angle(axis, off_deg * DEGREE);
            let found = as_built(frame);
            prop_assume!((off_deg - 6.0).abs() > 0.1);
            let expected = if off_deg < 6.0 { built } else { frame };
            prop_assert!(found.angle_between(expected) < 1e-3, "{off_deg} deg");
        }
    }

    #[test]
    fn what_is_typical_is_not_drawn_aside_by_a_third_that_differs() {
        let turned = |degrees: f64| (DQuat::from_rotation_y(degrees * DEGREE), 1.0);
        let mixed = (0..30).map(|n| turned(if n % 3 == 0 { 24.0 } else { 0.1 * f64::from(n) }));
        let typical = typical_rotation(mixed).expect("some");
        let (_, angle_rad) = typical.to_axis_angle();
        assert!(angle_rad < 4.0 * DEGREE, "{:.1} deg", angle_rad / DEGREE);
    }
}
