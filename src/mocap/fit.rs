//! Markers to bones: a person's segments laid over the markers of every frame.
//!
//! A calibration (a static trial, else the quietest half second of the trial itself) shows where each marker sits on
//! its segment ([`calibrated`]) and where the joints are under the skin ([`centres`]). Then, frame by frame, each
//! segment is laid over its markers by least squares ([`rigid`]), from the pelvis outwards. Thighs hang on the hip
//! and forearms on the elbow. Arms hang on the shoulder, which is found anew in every frame because the collar bone
//! moves it. Shanks and feet lie where their markers are, the knee being one point among others: skin that slides over
//! the thigh moves the knee more than the markers below it. What markers leave open, the segment keeps of how it lay
//! before on the segment that carries it: so a marker that is missing for a while stops nothing. A segment without
//! any marker is filled in between and told of.
//!
//! Bones have the lengths of the calibration: the poses are turns of segments of constant length.
//!
//! The hinges of knees and elbows are turned to where bending turns them in the trial, as far as it bends.

use crate::body::{Joint, Segment, SegmentPose, segment_name};
use crate::error::{Error, ErrorKind, counted, either};
use crate::mocap::anatomy::{Capture, face_forward};
use crate::mocap::markers::{Head, Markers};
use calibrated::{Calibrated, is_free, limb};
use centres::{HipBy, JointsAt, Measures, Side, SideMeasures, elbow, elbow_out, shoulder};
use glam::{DQuat, DVec3};
use marker_set::{Labelled, MarkerPlace, MarkerSet, SeenMarkers};
use rigid::{Lie, Pair, register};

pub mod bones;
pub mod calibrated;
pub mod centres;
pub mod functional;
pub mod marker_set;
pub mod rigid;
mod still;

/// Weight of what no motion says about a hinge, as the cubed sine of a bend: 14 degrees.
const HINGE_PRIOR: f64 = 0.014;
/// Legs, thigh and shank, in statures (Drillis and Contini 1966).
const LEGS: f64 = 0.245 + 0.246;
/// Weight of a knee or ankle, as the segment above has it, beside the markers of the segment below: that of a marker.
const JOINT: f64 = 1.0;
/// Weight of an elbow joint worked out of a bent arm, beside the markers of the arm.
const ELBOW: f64 = 1.0;

/// What is asked of a fit.
#[derive(Clone, Debug, PartialEq)]
pub struct FitSettings {
    /// Marker sets that are tried.
    pub sets: Vec<MarkerSet>,
    /// Whose markers, where a file has several subjects.
    pub subject: Option<String>,
    /// How the hip joints are placed.
    pub hips: HipBy,
    /// Hip joints that motion showed ([`functional`]), left and right, in the frame of [`centres::pelvis`], m.
    pub hips_m: [Option<DVec3>; 2],
    /// Where the other joints are taken to be.
    pub joints: JointsAt,
    /// Radius of a marker with its base, m.
    pub marker_radius_m: f64,
}

impl Default for FitSettings {
    fn default() -> Self {
        Self {
            sets: MarkerSet::shipped(),
            subject: None,
            hips: HipBy::default(),
            hips_m: [None; 2],
            joints: JointsAt::default(),
            marker_radius_m: 0.007,
        }
    }
}

/// How well one marker goes with its segment.
#[derive(Clone, Debug, PartialEq)]
pub struct MarkerFit {
    /// Where it sits.
    pub place: MarkerPlace,
    /// The segment that carries it.
    pub segment: Segment,
    /// Root mean square distance from where the segment says it is, m.
    pub residual_m: f64,
    /// The largest of these distances, m.
    pub worst_m: f64,
    /// Frames in which it was not seen.
    pub missing: usize,
}

/// A time in which no marker showed a segment: it is filled in between what is before and after.
#[derive(Clone, Debug, PartialEq)]
pub struct UnseenSegment {
    /// The segment.
    pub segment: Segment,
    /// First frame, from 0.
    pub from: usize,
    /// First frame after it.
    pub to: usize,
}

/// A person's motion, fitted.
#[derive(Clone, Debug, PartialEq)]
pub struct Fitted {
    /// Frames per second.
    pub rate_hz: f64,
    /// Frames that the file claims and does not hold.
    pub lost_frames: u64,
    /// Segments in every frame, world with Z up, otherwise the axes of the file.
    pub poses: Vec<SegmentPose>,
    /// Joints in every frame, by [`Joint::index`], same world, m; none where they were not found.
    pub joints_m: Vec<[Option<DVec3>; 15]>,
    /// From the axes of the file to the world.
    pub upright: DQuat,
    /// By [`Segment::index`]: the segments that have markers.
    pub tracked: [bool; 13],
    /// Where each joint sits on the segment that it hangs on, m; by [`Joint::index`].
    pub offsets_m: [Option<DVec3>; 15],
    /// Length of each limb's segment, m.
    pub lengths_m: Vec<(Segment, f64)>,
    /// Stature by the legs, m.
    pub stature_m: f64,
    /// Residuals.
    pub markers: Vec<MarkerFit>,
    /// Times in which a segment was not seen.
    pub unseen: Vec<UnseenSegment>,
    /// The marker set and the subject.
    pub labelled: Labelled,
    /// The person's measures, left and right.
    pub measures: [SideMeasures; 2],
    /// What was found out or taken for granted.
    pub notes: Vec<String>,
}

/// Fits a trial.
///
/// # Errors
/// No marker set that matches, no rate, no pelvis in the calibration, nobody upright in it.
pub fn fit(
    calibration: Option<&Markers>,
    trial: &Markers,
    settings: &FitSettings,
) -> Result<Fitted, Error> {
    let rate_hz = rate(trial.head())?;
    let labelled = find(trial.head(), settings)?;
    let mut notes = trial.head().notes.clone();
    let missing = labelled.missing();
    if !missing.is_empty() {
        notes.push(format!("not in the trial: {}", missing.join(", ")));
    }
    let own = |frame| labelled.seen(trial, frame);
    let body = MarkedBody::of(calibration, trial.head(), &own, settings, &mut notes)?;
    let mut work = Work::new(&body.person, settings.joints, trial.head().frames);
    for frame in 0..trial.head().frames {
        work.take(&turned(&labelled.seen(trial, frame), body.upright), |_| true);
    }
    work.turn_hinges();
    let lost_frames = trial.head().lost_frames;
    if lost_frames > 0 {
        notes.push(format!(
            "{lost_frames} that the file claims {are} not there",
            lost_frames = counted(lost_frames, "frame"),
            are = either(lost_frames, "is", "are")
        ));
    }
    Ok(Fitted { lost_frames, ..work.finish(rate_hz, body.upright, labelled, notes) })
}

/// A person calibrated: what carries markers.
#[derive(Clone, Debug)]
pub struct MarkedBody {
    person: Calibrated,
    joints: JointsAt,
    /// Where markers were while the person stood, in the world, m.
    still: SeenMarkers,
    /// From the axes of the file to the world.
    upright: DQuat,
}

impl MarkedBody {
    /// By a calibration, else by the trial itself, of which `own` tells where its markers are in a frame.
    ///
    /// # Errors
    /// No marker set that matches, no rate, no pelvis in the calibration, nobody upright in it.
    pub fn of(
        calibration: Option<&Markers>,
        trial: &Head,
        own: &dyn Fn(usize) -> SeenMarkers,
        settings: &FitSettings,
        notes: &mut Vec<String>,
    ) -> Result<Self, Error> {
        let rate_hz = rate(trial)?;
        let (still, heads) = match calibration {
            Some(calibration) => {
                let of = find(calibration.head(), settings)?;
                let hz = rate(calibration.head()).unwrap_or(rate_hz);
                let frames = calibration.head().frames;
                let seen = |frame| of.seen(calibration, frame);
                (still::quietest(frames, &seen, hz, notes)?, vec![calibration.head(), trial])
            }
            None => {
                notes.push("no static trial: the trial calibrates itself".to_owned());
                (still::quietest(trial.frames, own, rate_hz, notes)?, vec![trial])
            }
        };
        let upright = still::upright(&still, trial)?;
        let still = turned(&still, upright);
        let measures = Measures::of(&heads, &still, settings.marker_radius_m, notes);
        let measures = Measures { hips_m: settings.hips_m, ..measures };
        let person = Calibrated::of(&still, measures, settings.hips, settings.joints, notes)?;
        Ok(Self { person, joints: settings.joints, still, upright })
    }

    /// Where a marker is in frames that follow one another, by all others that are seen in them, m, in the axes of the
    /// file; none where they do not show it. Whether the marker itself is seen makes no difference.
    #[must_use]
    pub fn carried(
        &self,
        place: MarkerPlace,
        frames: impl ExactSizeIterator<Item = SeenMarkers>,
    ) -> Vec<Option<DVec3>> {
        let carrier = Segment::ALL.into_iter().find_map(|segment| {
            let worn = self.person.segments[segment.index()].as_ref()?;
            let (_, own_m) = worn.markers.iter().find(|(of, _)| *of == place)?;
            Some((segment, *own_m))
        });
        let Some((segment, own_m)) = carrier else { return vec![None; frames.len()] };
        // What the segment hangs on: all up to the pelvis.
        let is_needed = |of: Segment| {
            std::iter::successors(Some(segment), |below| below.parent()).any(|below| below == of)
        };
        let mut work = Work::new(&self.person, self.joints, frames.len());
        let mut found = Vec::with_capacity(frames.len());
        for mut seen in frames {
            seen[place as usize] = None;
            work.take(&turned(&seen, self.upright), is_needed);
            let lie = work.lies.last().and_then(|lies| lies[segment.index()]);
            found.push(lie.map(|lie| self.upright.inverse() * lie.world(own_m)));
        }
        found
    }
}

fn find(head: &Head, settings: &FitSettings) -> Result<Labelled, Error> {
    Labelled::find(head, &settings.sets, settings.subject.as_deref())
}

fn rate(head: &Head) -> Result<f64, Error> {
    head.rate_hz.ok_or_else(|| {
        Error::of(ErrorKind::Absent, "the file does not say its frames per second")
            .remedy("say them: --rate HZ (with play and retarget --capture-rate HZ)")
    })
}

fn turned(seen: &SeenMarkers, upright: DQuat) -> SeenMarkers {
    seen.map(|place| place.map(|place| upright * place))
}

/// The marker on the skin over a joint at the end of a limb's segment.
const fn beside(joint: Joint) -> Option<MarkerPlace> {
    match joint {
        Joint::LeftKnee => Some(MarkerPlace::LKNE),
        Joint::RightKnee => Some(MarkerPlace::RKNE),
        Joint::LeftAnkle => Some(MarkerPlace::LANK),
        Joint::RightAnkle => Some(MarkerPlace::RANK),
        Joint::LeftElbow => Some(MarkerPlace::LELB),
        Joint::RightElbow => Some(MarkerPlace::RELB),
        _ => None,
    }
}

/// A fit at work.
struct Work<'a> {
    person: &'a Calibrated,
    joints: JointsAt,
    /// How each segment lies on the one that carries it, as last seen.
    on_carrier: [DQuat; 13],
    lies: Vec<[Option<Lie>; 13]>,
    joints_m: Vec<[Option<DVec3>; 15]>,
    /// By segment, its markers in their order: sum of squares, worst, frames seen.
    sums: [Vec<(f64, f64, usize)>; 13],
}

impl<'a> Work<'a> {
    fn new(person: &'a Calibrated, joints: JointsAt, frames: usize) -> Self {
        let turn = |segment: Segment| {
            person.segments[segment.index()].as_ref().map_or(DQuat::IDENTITY, |worn| worn.lay.turn)
        };
        let on_carrier = Segment::ALL.map(|segment| {
            let carrier = segment.parent().map_or(DQuat::IDENTITY, turn);
            carrier.inverse() * turn(segment)
        });
        let sums = Segment::ALL.map(|segment| {
            let count = person.segments[segment.index()].as_ref().map_or(0, |w| w.markers.len());
            vec![(0.0, 0.0, 0); count]
        });
        let (lies, joints_m) = (Vec::with_capacity(frames), Vec::with_capacity(frames));
        Self { person, joints, on_carrier, lies, joints_m, sums }
    }

    /// Lays the segments that are needed over a frame.
    fn take(&mut self, seen: &SeenMarkers, is_needed: impl Fn(Segment) -> bool) {
        let mut lies: [Option<Lie>; 13] = [None; 13];
        let mut joints_m: [Option<DVec3>; 15] = [None; 15];
        for segment in Segment::ALL.into_iter().filter(|segment| is_needed(*segment)) {
            let at = segment.index();
            let Some(worn) = &self.person.segments[at] else { continue };
            let carrier = segment.parent().and_then(|parent| lies[parent.index()]);
            let last = self.lies.last().and_then(|lies| lies[at]);
            let before = match (carrier, segment.parent()) {
                (Some(carrier), _) => carrier.turn * self.on_carrier[at],
                (None, None) => last.map_or(worn.lay.turn, |lie| lie.turn),
                (None, Some(_)) => last.map_or(self.on_carrier[at], |lie| lie.turn),
            };
            let mut pairs: Vec<Pair> = Vec::with_capacity(worn.markers.len() + 2);
            for (place, own_m) in &worn.markers {
                let world_m = seen[*place as usize];
                pairs.extend(world_m.map(|world_m| Pair { own_m: *own_m, world_m, weight: 1.0 }));
            }
            // Without any marker of its own a segment is not seen.
            if pairs.is_empty() {
                continue;
            }
            let hangs_at = self.hangs_at(segment, seen, &lies, &joints_m);
            let hangs_at = if is_free(segment) {
                for (place, own_m) in &worn.also {
                    let seen = seen[*place as usize];
                    pairs.extend(seen.map(|world_m| Pair { own_m: *own_m, world_m, weight: 1.0 }));
                }
                // The knee of a shank, the ankle of a foot, where the segment above has it.
                let joint = hangs_at.filter(|_| !worn.also.is_empty());
                let on = |world_m| Pair { own_m: DVec3::ZERO, world_m, weight: JOINT };
                pairs.extend(joint.map(on));
                None
            } else {
                if hangs_at.is_none() {
                    continue;
                }
                hangs_at
            };
            pairs.extend(self.bent_elbow(segment, seen, hangs_at, pairs.len()));
            let Some(lie) = register(&pairs, hangs_at, before) else { continue };
            if let Some(carrier) = carrier {
                self.on_carrier[at] = carrier.turn.inverse() * lie.turn;
            }
            for (sum, (place, own_m)) in self.sums[at].iter_mut().zip(&worn.markers) {
                let Some(world_m) = seen[*place as usize] else { continue };
                let off_m = lie.world(*own_m).distance(world_m);
                *sum = (sum.0 + off_m * off_m, sum.1.max(off_m), sum.2 + 1);
            }
            self.place_joints(segment, &lie, seen, &mut joints_m);
            lies[at] = Some(lie);
        }
        if self.joints == JointsAt::EachFrame {
            self.by_rules(seen, &mut joints_m);
        }
        self.lies.push(lies);
        self.joints_m.push(joints_m);
    }

    /// Where a segment hangs: at the joint of the one above, an arm at its shoulder.
    fn hangs_at(
        &self,
        segment: Segment,
        seen: &SeenMarkers,
        lies: &[Option<Lie>; 13],
        joints_m: &[Option<DVec3>; 15],
    ) -> Option<DVec3> {
        let joint = crate::body::proportions::proximal_joint(segment);
        let side = match segment {
            Segment::LeftUpperArm => Side::Left,
            Segment::RightUpperArm => Side::Right,
            _ => return joints_m[joint.index()],
        };
        let torso = lies[Segment::Torso.index()]?;
        let on = self.person.thorax?;
        let trunk = Lie { turn: torso.turn * on.turn, at_m: torso.world(on.at_m) };
        let found = match self.joints {
            JointsAt::Centres | JointsAt::EachFrame => {
                shoulder(seen, side, &trunk, &self.person.measures)
            }
            JointsAt::Markers => seen[side.of(MarkerPlace::LSHO, MarkerPlace::RSHO) as usize],
        };
        found.or_else(|| Some(torso.world(self.person.joint_on(Segment::Torso, joint)?)))
    }

    /// The elbow of an arm that is bent enough to show its hinge: it says how the upper arm is turned about itself.
    fn bent_elbow(
        &self,
        segment: Segment,
        seen: &SeenMarkers,
        hangs_at: Option<DVec3>,
        markers: usize,
    ) -> Option<Pair> {
        let side = match segment {
            Segment::LeftUpperArm => Side::Left,
            Segment::RightUpperArm => Side::Right,
            _ => return None,
        };
        if self.joints == JointsAt::Markers || markers == 0 {
            return None;
        }
        let shoulder_m = hangs_at?;
        let out = elbow_out(seen, side, shoulder_m)?;
        let world_m = elbow(seen, side, shoulder_m, out, &self.person.measures)?;
        let own_m = self.person.joint_on(segment, side.of(Joint::LeftElbow, Joint::RightElbow))?;
        Some(Pair { own_m, world_m, weight: ELBOW })
    }

    /// The joints that hang on a segment. That at the end of a limb lies under the marker beside it, where that is seen and
    /// goes with the others.
    fn place_joints(
        &self,
        segment: Segment,
        lie: &Lie,
        seen: &SeenMarkers,
        joints_m: &mut [Option<DVec3>; 15],
    ) {
        let mut put = |joint: Joint| {
            let own_m = self.person.joint_on(segment, joint);
            let beside = beside(joint).and_then(|place| self.off(segment, lie, seen, place));
            joints_m[joint.index()] =
                own_m.map(|own_m| lie.world(own_m) + beside.unwrap_or_default());
        };
        match limb(segment) {
            Some((_, from, to)) => {
                put(to);
                if !is_free(segment) {
                    joints_m[from.index()] = Some(lie.at_m);
                }
            }
            None if segment == Segment::Pelvis => {
                for joint in [Joint::Pelvis, Joint::LeftHip, Joint::RightHip] {
                    put(joint);
                }
            }
            None if segment == Segment::Torso => {
                put(Joint::Torso);
                put(Joint::Neck);
            }
            None => {}
        }
    }

    /// From where a segment says that one of its markers is to where it was seen, less the further that is.
    fn off(
        &self,
        segment: Segment,
        lie: &Lie,
        seen: &SeenMarkers,
        place: MarkerPlace,
    ) -> Option<DVec3> {
        let worn = self.person.segments[segment.index()].as_ref()?;
        let (_, own_m) = worn.markers.iter().find(|(of, _)| *of == place)?;
        let off_m = seen[place as usize]? - lie.world(*own_m);
        Some(off_m * rigid::trust(off_m.length()))
    }

    /// Joints where the rules have them in this frame alone; those that its markers do not show stay.
    fn by_rules(&self, seen: &SeenMarkers, joints_m: &mut [Option<DVec3>; 15]) {
        let Calibrated { measures, hips, .. } = &self.person;
        let pelvis = centres::pelvis(seen);
        let trunk = centres::thorax(seen, measures.marker_radius_m);
        for side in Side::BOTH {
            let mut put = |left: Joint, right: Joint, found: Option<DVec3>| {
                let joint = &mut joints_m[side.of(left, right).index()];
                *joint = found.or(*joint);
                *joint
            };
            let hip_m =
                pelvis.and_then(|on| Some(on.world(centres::hip(seen, side, measures, *hips)?)));
            let hip_m = put(Joint::LeftHip, Joint::RightHip, hip_m);
            let knee_m = hip_m.and_then(|hip_m| centres::knee(seen, side, hip_m, measures));
            let knee_m = put(Joint::LeftKnee, Joint::RightKnee, knee_m);
            let ankle_m = knee_m.and_then(|knee_m| centres::ankle(seen, side, knee_m, measures));
            put(Joint::LeftAnkle, Joint::RightAnkle, ankle_m);
            let shoulder_m = trunk.and_then(|trunk| shoulder(seen, side, &trunk, measures));
            let Some(shoulder_m) = put(Joint::LeftShoulder, Joint::RightShoulder, shoulder_m)
            else {
                continue;
            };
            let out = elbow_out(seen, side, shoulder_m);
            let elbow_m = out.and_then(|out| elbow(seen, side, shoulder_m, out, measures));
            let elbow_m = put(Joint::LeftElbow, Joint::RightElbow, elbow_m);
            let wrist_m = elbow_m.and_then(|elbow_m| centres::wrist(seen, side, elbow_m, measures));
            put(Joint::LeftWrist, Joint::RightWrist, wrist_m);
        }
    }

    /// Turns upper and lower segments of limbs about themselves, so that their hinge is where bending turns.
    fn turn_hinges(&mut self) {
        const LIMBS: [(Segment, Segment, f64); 4] = [
            (Segment::LeftThigh, Segment::LeftShank, 1.0),
            (Segment::RightThigh, Segment::RightShank, 1.0),
            (Segment::LeftUpperArm, Segment::LeftForearm, -1.0),
            (Segment::RightUpperArm, Segment::RightForearm, -1.0),
        ];
        for (upper, lower, sign) in LIMBS {
            for segment in [upper, lower] {
                let (mut sum, mut count) = (DVec3::ZERO, 0.0);
                for lies in &self.lies {
                    let both = lies[upper.index()].zip(lies[lower.index()]);
                    let Some((above, below)) = both else { continue };
                    let hinge = (above.turn * DVec3::Z).cross(below.turn * DVec3::Z) * sign;
                    let own = if segment == upper { above } else { below };
                    sum += own.turn.inverse() * hinge * hinge.length_squared();
                    count += 1.0;
                }
                if count == 0.0 {
                    continue;
                }
                let hinge = sum / count + DVec3::Y * HINGE_PRIOR;
                let turn = DQuat::from_rotation_z((-hinge.x).atan2(hinge.y));
                for lies in &mut self.lies {
                    if let Some(lie) = &mut lies[segment.index()] {
                        lie.turn *= turn;
                    }
                }
            }
        }
    }

    fn finish(
        self,
        rate_hz: f64,
        upright: DQuat,
        labelled: Labelled,
        mut notes: Vec<String>,
    ) -> Fitted {
        let frames = self.lies.len();
        let tracked = Segment::ALL
            .map(|segment| self.lies.iter().any(|lies| lies[segment.index()].is_some()));
        for segment in Segment::ALL.into_iter().filter(|segment| !tracked[segment.index()]) {
            notes.push(format!(
                "{} has too few markers: at rest on what carries it",
                segment_name(segment)
            ));
        }
        let mut unseen = Vec::new();
        let turns = Segment::ALL.map(|segment| {
            let seen = self.lies.iter().map(|lies| lies[segment.index()].map(|lie| lie.turn));
            let seen: Vec<Option<DQuat>> = seen.collect();
            let (filled, gaps) = still::filled(&seen, |a, b, share| a.slerp(b, share));
            if tracked[segment.index()] {
                let told = |(from, to): (usize, usize)| UnseenSegment { segment, from, to };
                unseen.extend(gaps.into_iter().map(told));
            }
            filled
        });
        let roots = self.joints_m.iter().map(|joints| joints[Joint::Pelvis.index()]);
        let (roots, _) = still::filled(&roots.collect::<Vec<_>>(), |a, b, share| a.lerp(b, share));
        let poses = (0..frames).map(|frame| {
            let mut orientation = [DQuat::IDENTITY; 13];
            for segment in Segment::ALL {
                let carrier = segment.parent().map_or(DQuat::IDENTITY, |s| orientation[s.index()]);
                let own = turns[segment.index()].get(frame).copied();
                orientation[segment.index()] = own.unwrap_or(carrier);
            }
            SegmentPose { root_m: roots.get(frame).copied().unwrap_or_default(), orientation }
        });
        let lengths_m: Vec<(Segment, f64)> = Segment::ALL
            .into_iter()
            .filter_map(|segment| {
                let (_, from, to) = limb(segment)?;
                let ends = [from, to].map(|joint| self.person.joints_m[joint.index()]);
                Some((segment, ends[0]?.distance(ends[1]?)))
            })
            .collect();
        let length = |segment| lengths_m.iter().find(|(of, _)| *of == segment).map(|(_, m)| *m);
        let legs: Vec<f64> =
            [(Segment::LeftThigh, Segment::LeftShank), (Segment::RightThigh, Segment::RightShank)]
                .into_iter()
                .filter_map(|(thigh, shank)| Some(length(thigh)? + length(shank)?))
                .collect();
        let stature_m = legs.iter().sum::<f64>() / legs.len().max(1) as f64 / LEGS;
        let offsets_m = Joint::ALL.map(|joint| {
            let parent = joint.parent()?;
            let on = Segment::ALL
                .into_iter()
                .find(|segment| crate::body::proportions::proximal_joint(*segment) == parent)?;
            self.person.joint_on(on, joint)
        });
        Fitted {
            rate_hz,
            lost_frames: 0,
            poses: poses.collect(),
            upright,
            tracked,
            offsets_m,
            lengths_m,
            stature_m,
            markers: self.residuals(frames),
            unseen,
            labelled,
            measures: self.person.measures.sides,
            joints_m: self.joints_m,
            notes,
        }
    }

    fn residuals(&self, frames: usize) -> Vec<MarkerFit> {
        let mut all = Vec::new();
        for segment in Segment::ALL {
            let Some(worn) = &self.person.segments[segment.index()] else { continue };
            let sums = self.sums[segment.index()].iter();
            all.extend(worn.markers.iter().zip(sums).map(|((place, _), (sum, worst, seen))| {
                MarkerFit {
                    place: *place,
                    segment,
                    residual_m: (sum / (*seen).max(1) as f64).sqrt(),
                    worst_m: *worst,
                    missing: frames - seen,
                }
            }));
        }
        all
    }
}

impl Fitted {
    /// The motion as a capture: turned and shifted so that the person begins at the origin and faces +X.
    #[must_use]
    pub fn capture(&self) -> Capture {
        let mut poses = self.poses.clone();
        face_forward(&mut poses);
        Capture {
            rate_hz: self.rate_hz,
            poses,
            tracked: self.tracked,
            stature_m: self.stature_m,
            is_made: false,
            notes: self.notes.clone(),
        }
    }

    /// Root mean square residual of a segment's markers, m; `None` if it has none.
    #[must_use]
    pub fn residual_m(&self, segment: Segment) -> Option<f64> {
        let own = self.markers.iter().filter(|marker| marker.segment == segment);
        let squares: Vec<f64> = own.map(|marker| marker.residual_m.powi(2)).collect();
        (!squares.is_empty()).then(|| (squares.iter().sum::<f64>() / squares.len() as f64).sqrt())
    }
}
