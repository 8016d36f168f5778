//! The 21 bones of the Human Motion Database (Guerra-Filho and Biswas, "The human motion database: a cognitive and
//! parametric sampling of human motion", Image and Vision Computing 30, 2012) laid over markers: with hands, collar bones,
//! hips, and a back in two parts.
//!
//! While the person stands, each bone goes from one point to another. In each frame those that are segments of the body
//! model turn as the segments do; the others by least squares over their own markers ([`register`]). Bones of constant
//! length are put end to end. Turns are told from how the person stood: standing so is zero of all of them.

use super::calibrated::places;
use super::marker_set::{Labelled, MarkerPlace, SeenMarkers};
use super::rigid::{Lie, Pair, register};
use super::{FitSettings, MarkedBody, Work, turned};
use crate::body::{Joint, Segment};
use crate::error::{Error, ErrorKind};
use crate::mocap::bvh::{self, Axis, Bvh, Channel};
use crate::mocap::markers::{
    Frame, Head, MarkerFormat, MarkerPoint, Markers, PointKind, PointSample,
};
use glam::{DMat3, DQuat, DVec3, EulerRot};

mod frames;

pub use frames::BoneFrame;

/// Bones.
pub const BONES: usize = 21;
/// Weight of a marker that sits on another bone against one of its own.
const BORROWED: f64 = 0.1;
/// Values are rounded to this many parts of a degree or centimetre.
const PARTS: f64 = 1e4;

/// A point by which a bone begins or ends.
#[derive(Clone, Copy, Debug)]
enum BonePoint {
    Marker(MarkerPlace),
    Joint(Joint),
    /// The middle of markers, of those of them that are there.
    Middle(&'static [MarkerPlace]),
    /// The tenth thoracic vertebra, else half way up from the pelvis to the seventh cervical one.
    MiddleOfBack,
}

/// A bone of the table.
#[derive(Clone, Copy, Debug)]
struct Bone {
    name: &'static str,
    parent: Option<usize>,
    from: BonePoint,
    to: BonePoint,
    turned: TurnedBy,
    /// The name of its end, if nothing hangs on it.
    end: Option<&'static str>,
}

/// How it is known how a bone is turned.
#[derive(Clone, Copy, Debug)]
enum TurnedBy {
    /// As a segment of the body model.
    Segment(Segment),
    /// By its markers, and by some of its neighbours' that count less.
    Markers(&'static [MarkerPlace], &'static [MarkerPlace]),
}

/// All of them, each after the one that it hangs on.
const TABLE: [Bone; BONES] = {
    use BonePoint::{Marker, Middle, MiddleOfBack};
    use MarkerPlace::*;
    const BACK: BonePoint = Middle(&[LPSI, RPSI, SACR]);
    const HEAD: BonePoint = Middle(&[LFHD, RFHD, LBHD, RBHD, HTOP, HFRO, HSID]);
    const fn bone(
        name: &'static str,
        parent: usize,
        from: BonePoint,
        to: BonePoint,
        turned: TurnedBy,
    ) -> Bone {
        Bone { name, parent: Some(parent), from, to, turned, end: None }
    }
    const fn at(joint: Joint) -> BonePoint {
        BonePoint::Joint(joint)
    }
    const fn ending(bone: Bone, end: &'static str) -> Bone {
        Bone { end: Some(end), ..bone }
    }
    const fn with(segment: Segment) -> TurnedBy {
        TurnedBy::Segment(segment)
    }
    use Joint::*;
    use Segment::{
        Head, LeftFoot, LeftForearm, LeftShank, LeftThigh, LeftUpperArm, RightFoot, RightForearm,
        RightShank, RightThigh, RightUpperArm,
    };
    use TurnedBy::Markers;
    const PELVIS_OWN: TurnedBy = Markers(&[LASI, RASI, LPSI, RPSI, SACR], &[]);
    const LOWER: TurnedBy = Markers(&[T10, STRN, LPSI, RPSI, SACR], &[]);
    const UPPER: TurnedBy = Markers(&[C7, CLAV, RBAK, T10], &[]);
    const NECK_OWN: TurnedBy = Markers(&[C7, CLAV, LBHD, RBHD], &[]);
    let front = Middle(&[LASI, RASI]);
    let (hands, collars) = (
        [Markers(&[LWRA, LWRB, LFIN], &[LFRM]), Markers(&[RWRA, RWRB, RFIN], &[RFRM])],
        [Markers(&[LSHO], &[CLAV]), Markers(&[RSHO], &[CLAV])],
    );
    [
        Bone { name: "Root", parent: None, from: BACK, to: front, turned: PELVIS_OWN, end: None },
        bone("Lower_Back", 0, BACK, MiddleOfBack, LOWER),
        bone("Upper_Back", 1, MiddleOfBack, Marker(C7), UPPER),
        bone("Neck", 2, Marker(C7), at(Neck), NECK_OWN),
        ending(bone("Head", 3, at(Neck), HEAD, with(Head)), "Head_End"),
        bone("L_Collar", 2, Marker(C7), at(LeftShoulder), collars[0]),
        bone("L_Upper_Arm", 5, at(LeftShoulder), at(LeftElbow), with(LeftUpperArm)),
        bone("L_Lower_Arm", 6, at(LeftElbow), at(LeftWrist), with(LeftForearm)),
        ending(bone("L_Hand", 7, at(LeftWrist), Marker(LFIN), hands[0]), "L_Hand_End"),
        bone("R_Collar", 2, Marker(C7), at(RightShoulder), collars[1]),
        bone("R_Upper_Arm", 9, at(RightShoulder), at(RightElbow), with(RightUpperArm)),
        bone("R_Lower_Arm", 10, at(RightElbow), at(RightWrist), with(RightForearm)),
        ending(bone("R_Hand", 11, at(RightWrist), Marker(RFIN), hands[1]), "R_Hand_End"),
        bone("L_Hip", 0, Marker(LPSI), at(LeftHip), PELVIS_OWN),
        bone("L_Upper_Leg", 13, at(LeftHip), at(LeftKnee), with(LeftThigh)),
        bone("L_Lower_Leg", 14, at(LeftKnee), at(LeftAnkle), with(LeftShank)),
        ending(bone("L_Foot", 15, at(LeftAnkle), Marker(LTOE), with(LeftFoot)), "L_Foot_End"),
        bone("R_Hip", 0, Marker(RPSI), at(RightHip), PELVIS_OWN),
        bone("R_Upper_Leg", 17, at(RightHip), at(RightKnee), with(RightThigh)),
        bone("R_Lower_Leg", 18, at(RightKnee), at(RightAnkle), with(RightShank)),
        ending(bone("R_Foot", 19, at(RightAnkle), Marker(RTOE), with(RightFoot)), "R_Foot_End"),
    ]
};

/// A bone as the calibration shows it.
#[derive(Clone, Debug)]
struct StoodBone {
    /// Index among those that are there.
    parent: Option<usize>,
    name: &'static str,
    end: Option<&'static str>,
    /// Where it begins and ends while the person stands, m, world with Z up.
    from_m: DVec3,
    to_m: DVec3,
    /// Its markers: where they are from its beginning, and how much they count.
    markers: Vec<(MarkerPlace, DVec3, f64)>,
    /// The segment as which it turns.
    segment: Option<Segment>,
    /// The joint at which it begins, if it is one of the body model.
    joint: Option<Joint>,
    /// True if it hangs where the one above ends, whatever its markers say.
    hangs: bool,
    /// Its frame in the world while the person stands; none if its third point is missing.
    axes: Option<DQuat>,
}

/// Bones in motion.
#[derive(Clone, Debug)]
pub struct FittedBones {
    bones: Vec<StoodBone>,
    rate_hz: f64,
    upright: DQuat,
    /// Where the first begins, m, and how each is turned from how the person stood; a frame each.
    frames: Vec<(DVec3, Vec<DQuat>)>,
    /// Joints of the body model as they were found in each frame, m, world with Z up.
    joints_m: Vec<[Option<DVec3>; 15]>,
    /// Of each bone the sum of squares of what its markers are off, m², and how many there were.
    off: Vec<(f64, usize)>,
    /// Of each bone the frames in which too little of it is seen: it goes with the one that carries it.
    unseen: Vec<usize>,
    /// What is missing, and what was done about it.
    pub notes: Vec<String>,
}

/// How well one bone goes with its markers.
#[derive(Clone, Debug, PartialEq)]
pub struct BoneFit {
    /// Its name.
    pub name: &'static str,
    /// Its length, m.
    pub length_m: f64,
    /// Root mean square distance of its markers from where it says that they are, m.
    pub residual_m: f64,
    /// Frames in which too little of it was seen.
    pub unseen_frames: usize,
}

/// Lays the bones over a trial.
///
/// # Errors
/// As [`super::fit`].
pub fn fit_bones(
    calibration: Option<&Markers>,
    trial: &Markers,
    settings: &FitSettings,
) -> Result<FittedBones, Error> {
    let labelled = Labelled::find(trial.head(), &settings.sets, settings.subject.as_deref())?;
    let own = |frame| labelled.seen(trial, frame);
    let mut notes = Vec::new();
    let body = MarkedBody::of(calibration, trial.head(), &own, settings, &mut notes)?;
    let bones = stood(&body, &mut notes)?;
    let count = bones.len();
    let mut fitted = FittedBones {
        bones,
        rate_hz: super::rate(trial.head())?,
        upright: body.upright,
        frames: Vec::with_capacity(trial.head().frames),
        joints_m: Vec::new(),
        off: vec![(0.0, 0); count],
        unseen: vec![0; count],
        notes,
    };
    let mut work = Work::new(&body.person, settings.joints, trial.head().frames);
    for frame in 0..trial.head().frames {
        let seen = turned(&own(frame), body.upright);
        work.take(&seen, |_| true);
        // How the segments are turned since the person stood.
        let since = Segment::ALL.map(|segment| {
            let lie = work.lies.last()?[segment.index()]?;
            let stood = body.person.segments[segment.index()].as_ref()?.lay.turn;
            Some(lie.turn * stood.inverse())
        });
        fitted.take(&seen, &since);
    }
    fitted.joints_m = work.joints_m;
    Ok(fitted)
}

/// The bones that the calibration shows.
fn stood(body: &MarkedBody, notes: &mut Vec<String>) -> Result<Vec<StoodBone>, Error> {
    let of = |place: MarkerPlace| body.still[place as usize];
    let middle = |places: &[MarkerPlace]| {
        let there: Vec<DVec3> = places.iter().filter_map(|place| of(*place)).collect();
        (!there.is_empty()).then(|| there.iter().sum::<DVec3>() / there.len() as f64)
    };
    let back = middle(&[MarkerPlace::LPSI, MarkerPlace::RPSI, MarkerPlace::SACR]);
    let point = |point: BonePoint| match point {
        // Without the two beside it, a marker on the sacrum.
        BonePoint::Marker(place @ (MarkerPlace::LPSI | MarkerPlace::RPSI)) => of(place).or(back),
        BonePoint::Marker(place) => of(place),
        BonePoint::Joint(joint) => body.person.joints_m[joint.index()],
        BonePoint::Middle(places) => middle(places),
        BonePoint::MiddleOfBack => {
            of(MarkerPlace::T10).or_else(|| Some(back?.midpoint(of(MarkerPlace::C7)?)))
        }
    };
    if of(MarkerPlace::T10).is_none() && of(MarkerPlace::C7).is_some() {
        notes.push("no T10: the back bends half way between PSI and C7".to_owned());
    }
    let (mut bones, mut left): (Vec<StoodBone>, Vec<&str>) = (Vec::new(), Vec::new());
    let (mut no_frame, mut by_hinge): (Vec<&str>, Vec<&str>) = (Vec::new(), Vec::new());
    let mut index = [None; BONES];
    for (at, bone) in TABLE.iter().enumerate() {
        let parent = bone.parent.map(|parent| index[parent]);
        let ends = point(bone.from).zip(point(bone.to));
        // What hangs on nothing hangs in the air.
        let Some(((from_m, to_m), parent)) = ends.zip(match parent {
            None => Some(None),
            Some(there) => there.map(Some),
        }) else {
            left.push(bone.name);
            continue;
        };
        let (own, borrowed, segment) = match bone.turned {
            TurnedBy::Markers(own, borrowed) => (own, borrowed, None),
            TurnedBy::Segment(segment) => (places(segment), &[][..], Some(segment)),
        };
        let weighed = |places: &'static [MarkerPlace], weight: f64| {
            places.iter().filter_map(move |place| Some((*place, of(*place)? - from_m, weight)))
        };
        let markers: Vec<_> = weighed(own, 1.0).chain(weighed(borrowed, BORROWED)).collect();
        let missing: Vec<String> = own
            .iter()
            .filter(|place| of(**place).is_none() && !is_other(**place))
            .map(|place| place.name())
            .collect();
        if !missing.is_empty() {
            notes.push(format!("{} goes without {}", bone.name, missing.join(", ")));
        }
        let hangs = bone.parent.is_some() && own.len() < 3;
        index[at] = Some(bones.len());
        let (name, end) = (bone.name, bone.end);
        let joint = match bone.from {
            BonePoint::Joint(joint) => Some(joint),
            BonePoint::Marker(_) | BonePoint::Middle(_) | BonePoint::MiddleOfBack => None,
        };
        // Without its third point, a limb's bone has its hinge.
        let sign = if name.starts_with("L_") { 1.0 } else { -1.0 };
        let hinge = segment.and_then(|segment| body.person.segments[segment.index()].as_ref());
        let hinge = hinge.filter(|_| bone.parent.is_some() && segment != Some(Segment::Head));
        let outwards = hinge.map(|worn| from_m + worn.lay.turn * DVec3::Y * sign);
        let third_m = frames::THIRD[at].map(|place| point(BonePoint::Marker(place)).or(outwards));
        if frames::THIRD[at].is_some_and(|place| of(place).is_none()) && outwards.is_some() {
            by_hinge.push(name);
        }
        let axes = match third_m {
            None => frames::by_rule(name, to_m - from_m, None),
            Some(third_m) => third_m
                .and_then(|third_m| frames::by_rule(name, to_m - from_m, Some(third_m - from_m))),
        };
        if axes.is_none() {
            no_frame.push(name);
        }
        let hung =
            StoodBone { parent, name, end, from_m, to_m, markers, segment, joint, hangs, axes };
        bones.push(hung);
    }
    if !left.is_empty() {
        notes.push(format!("bones that the markers do not show, left out: {}", left.join(", ")));
    }
    if !by_hinge.is_empty() {
        notes.push(format!(
            "frames by the hinge, since their third point is missing: {}",
            by_hinge.join(", ")
        ));
    }
    if !no_frame.is_empty() {
        notes.push(format!(
            "bones without a frame, since their third point is missing: {}",
            no_frame.join(", ")
        ));
    }
    if bones.is_empty() {
        return Err(Error::of(ErrorKind::Absent, "the calibration does not show the pelvis"));
    }
    Ok(bones)
}

/// True of markers that only some sets have.
const fn is_other(place: MarkerPlace) -> bool {
    use MarkerPlace::*;
    matches!(place, SACR | HTOP | HFRO | HSID | LMT5 | RMT5)
}

impl FittedBones {
    fn take(&mut self, seen: &SeenMarkers, segments: &[Option<DQuat>; 13]) {
        let mut lies: Vec<Lie> = Vec::with_capacity(self.bones.len());
        for (at, bone) in self.bones.iter().enumerate() {
            let carrier = bone.parent.and_then(|parent| Some((lies.get(parent)?, parent)));
            let last = self.frames.last().map(|(root_m, turns)| (*root_m, turns.as_slice()));
            let turn = |of: usize| last.map_or(DQuat::IDENTITY, |(_, turns)| turns[of]);
            let before = match carrier {
                Some((carrier, parent)) => carrier.turn * turn(parent).inverse() * turn(at),
                None => turn(at),
            };
            // Where the one above ends, as it lies itself.
            let ends =
                |lie: &Lie, parent: usize| lie.world(bone.from_m - self.bones[parent].from_m);
            let hung_m = carrier.map(|(carrier, parent)| ends(carrier, parent));
            let pairs: Vec<Pair> = bone
                .markers
                .iter()
                .filter_map(|(place, own_m, weight)| {
                    let world_m = seen[*place as usize]?;
                    Some(Pair { own_m: *own_m, world_m, weight: *weight })
                })
                .collect();
            let shows = pairs.iter().filter(|pair| pair.weight == 1.0).count();
            let hangs_at = hung_m.filter(|_| bone.hangs || shows < 3);
            let at_m = hung_m.or(last.map(|(root_m, _)| root_m)).unwrap_or(bone.from_m);
            let lie = match bone.segment {
                Some(segment) => segments[segment.index()].map(|turn| Lie { turn, at_m }),
                None if shows > 0 => register(&pairs, hangs_at, before),
                None => None,
            };
            if let Some(lie) = lie {
                for pair in pairs.iter().filter(|pair| pair.weight == 1.0) {
                    self.off[at].0 += lie.world(pair.own_m).distance_squared(pair.world_m);
                    self.off[at].1 += 1;
                }
            } else {
                self.unseen[at] += 1;
            }
            lies.push(lie.unwrap_or(Lie { turn: before, at_m }));
        }
        let root_m = lies.first().map_or(DVec3::ZERO, |lie| lie.at_m);
        self.frames.push((root_m, lies.into_iter().map(|lie| lie.turn).collect()));
    }

    /// How many frames there are.
    #[must_use]
    pub const fn frames(&self) -> usize {
        self.frames.len()
    }

    /// How well each bone goes with its markers.
    #[must_use]
    pub fn bones(&self) -> Vec<BoneFit> {
        let one = |(at, bone): (usize, &StoodBone)| BoneFit {
            name: bone.name,
            length_m: bone.from_m.distance(bone.to_m),
            residual_m: (self.off[at].0 / self.off[at].1.max(1) as f64).sqrt(),
            unseen_frames: self.unseen[at],
        };
        self.bones.iter().enumerate().map(one).collect()
    }

    /// Where bones begin in a frame, and where those end on which nothing hangs, m, axes of the file: joints of the body
    /// model where they were found in that frame, all else end to end with bones of constant length.
    #[must_use]
    pub fn points_m(&self, frame: usize) -> Vec<(&'static str, DVec3)> {
        let Some((root_m, turns)) = self.frames.get(frame) else { return Vec::new() };
        let found = |joint: Joint| self.joints_m.get(frame)?[joint.index()];
        let mut begins: Vec<DVec3> = Vec::with_capacity(self.bones.len());
        let mut ends = Vec::new();
        for (bone, turn) in self.bones.iter().zip(turns) {
            let hung = bone.parent.map_or(*root_m, |parent| {
                let carrier = &self.bones[parent];
                begins[parent] + turns[parent] * (bone.from_m - carrier.from_m)
            });
            let from = bone.joint.and_then(found).unwrap_or(hung);
            begins.push(from);
            ends.extend(bone.end.map(|name| (name, from + *turn * (bone.to_m - bone.from_m))));
        }
        let back = self.upright.inverse();
        let begins = self.bones.iter().map(|bone| bone.name).zip(begins);
        begins.chain(ends).map(|(name, at)| (name, back * at)).collect()
    }

    /// The points of [`Self::points_m`] as markers that nobody wore, mm.
    ///
    /// # Errors
    /// If there is no room for them.
    pub fn virtual_markers(&self, of: &Head) -> Result<Markers, Error> {
        let mut head = Head::new(MarkerFormat::C3d);
        head.points = self.points_m(0).iter().map(|(name, _)| virtual_point(name)).collect();
        head.unit = "mm".to_owned();
        head.frames = self.frames.len();
        head.first_frame = of.first_frame;
        head.screen.clone_from(&of.screen);
        head.events.clone_from(&of.events);
        head.set_rate(self.rate_hz);
        let mut markers = Markers::with_room(head)?;
        for frame in 0..self.frames.len() {
            let place = |(_, at_m): (&str, DVec3)| {
                let position = (at_m * 1e3).as_vec3().to_array();
                Some(PointSample { position, residual: 0.0, cameras: 0 })
            };
            let points = self.points_m(frame).into_iter().map(place).collect();
            markers.push(&Frame { points, analog: Vec::new() });
        }
        Ok(markers)
    }

    /// As a skeleton in motion: centimetres, Y up; while nothing is turned, the person stands as in the calibration and
    /// faces +Z.
    #[must_use]
    pub fn bvh(&self) -> Bvh {
        // X forward, Y left, Z up become Z, X, Y.
        let axes = DQuat::from_mat3(&DMat3::from_cols(DVec3::Z, DVec3::X, DVec3::Y));
        let heading = self.heading();
        let to_file = axes * DQuat::from_rotation_z(-heading);
        let in_cm = |at_m: DVec3| (to_file * at_m * 100.0).to_array().map(rounded);
        let rotations = [Axis::Z, Axis::X, Axis::Y].map(Channel::Rotation);
        let positions = [Axis::X, Axis::Y, Axis::Z].map(Channel::Position);
        let mut first_channel = 0;
        let joints = self.bones.iter().map(|bone| {
            let mut channels = Vec::new();
            let offset = match bone.parent {
                None => {
                    channels.extend(positions);
                    DVec3::ZERO
                }
                Some(parent) => DVec3::from(in_cm(bone.from_m - self.bones[parent].from_m)),
            };
            channels.extend(rotations);
            let end = bone.end.map(|_| DVec3::from(in_cm(bone.to_m - bone.from_m)));
            let joint = bvh::Joint {
                name: bone.name.to_owned(),
                parent: bone.parent,
                offset,
                first_channel,
                ends: end.into_iter().collect(),
                channels,
            };
            first_channel += joint.channels.len();
            joint
        });
        let joints: Vec<bvh::Joint> = joints.collect();
        let mut values = Vec::with_capacity(first_channel * self.frames.len());
        for (root_m, turns) in &self.frames {
            values.extend(in_cm(*root_m));
            for (bone, turn) in self.bones.iter().zip(turns) {
                let carrier = bone.parent.map_or(DQuat::IDENTITY, |parent| turns[parent]);
                let local = to_file * (carrier.inverse() * *turn) * to_file.inverse();
                let (z, x, y) = local.to_euler(EulerRot::ZXY);
                values.extend([z, x, y].map(|angle| rounded(angle.to_degrees())));
            }
        }
        Bvh { joints, time_step_s: 1.0 / self.rate_hz, values }
    }

    /// Where the person faces while standing, about Z, rad.
    fn heading(&self) -> f64 {
        let named = |name: &str| self.bones.iter().find(|bone| bone.name == name);
        let across = named("L_Hip").zip(named("R_Hip")).map(|(left, right)| left.to_m - right.to_m);
        let forward = across.unwrap_or(DVec3::Y).cross(DVec3::Z);
        forward.y.atan2(forward.x)
    }
}

fn virtual_point(name: &str) -> MarkerPoint {
    MarkerPoint {
        label: name.to_owned(),
        description: "virtual: of a skeleton laid over markers".to_owned(),
        kind: PointKind::Marker,
        unit: "mm".to_owned(),
    }
}

fn rounded(value: f64) -> f64 {
    // Adding zero makes of -0 a plain 0.
    (value * PARTS).round() / PARTS + 0.0
}
