//! One person as the calibration shows it: which marker sits where on which segment, and how long bones are.

use super::centres::{
    self, HipBy, JointsAt, Measures, Side, ankle, chord, elbow, elbow_out, hip, knee, shoulder,
    thorax, wrist, wrist_marker,
};
use super::marker_set::{MarkerPlace, SeenMarkers};
use super::rigid::Lie;
use crate::body::{Joint, Segment};
use crate::error::{Error, ErrorKind};
use glam::{DMat3, DQuat, DVec3};

/// How high the joint between pelvis and trunk is above the hips, in lengths of the leg: 0.06 of 0.53 statures. Ours.
const LUMBAR: f64 = 0.113;

/// A segment with its markers.
#[derive(Clone, Debug)]
pub struct MarkedSegment {
    /// Each marker and where it is on the segment, m.
    pub markers: Vec<(MarkerPlace, DVec3)>,
    /// Markers of the segment above that sit near enough to the joint to tell of this one, too.
    pub also: Vec<(MarkerPlace, DVec3)>,
    /// How the segment lay in the calibration.
    pub lay: Lie,
}

/// A person, calibrated.
#[derive(Clone, Debug)]
pub struct Calibrated {
    /// By [`Segment::index`]; none of those that the markers do not show.
    pub segments: [Option<MarkedSegment>; 13],
    /// Where each joint was, m, world with Z up.
    pub joints_m: [Option<DVec3>; 15],
    /// Origin of the trunk's markers, on the trunk.
    pub thorax: Option<Lie>,
    /// The person's measures.
    pub measures: Measures,
    /// How hips are placed.
    pub hips: HipBy,
}

/// The places of a segment's markers.
#[must_use]
pub const fn places(segment: Segment) -> &'static [MarkerPlace] {
    use MarkerPlace::*;
    match segment {
        Segment::Pelvis => &[LASI, RASI, LPSI, RPSI, SACR],
        Segment::Torso => &[C7, T10, CLAV, STRN, LBAK, RBAK],
        Segment::Head => &[LFHD, RFHD, LBHD, RBHD, HTOP, HFRO, HSID],
        Segment::LeftUpperArm => &[LELB, LUPA],
        Segment::LeftForearm => &[LWRA, LWRB, LFRM],
        Segment::RightUpperArm => &[RELB, RUPA],
        Segment::RightForearm => &[RWRA, RWRB, RFRM],
        Segment::LeftThigh => &[LKNE, LTHI],
        Segment::LeftShank => &[LANK, LTIB],
        Segment::LeftFoot => &[LHEE, LTOE, LMT5],
        Segment::RightThigh => &[RKNE, RTHI],
        Segment::RightShank => &[RANK, RTIB],
        Segment::RightFoot => &[RHEE, RTOE, RMT5],
    }
}

/// Markers of the segment above whose place on this one hardly changes: beside a knee, and on an ankle.
const fn near_joint(segment: Segment) -> &'static [MarkerPlace] {
    match segment {
        Segment::LeftShank => &[MarkerPlace::LKNE],
        Segment::RightShank => &[MarkerPlace::RKNE],
        Segment::LeftFoot => &[MarkerPlace::LANK],
        Segment::RightFoot => &[MarkerPlace::RANK],
        _ => &[],
    }
}

/// True of a segment that lies where its markers are; false of one that hangs on the joint above it alone, because
/// its own are too few or move with something else.
#[must_use]
pub const fn is_free(segment: Segment) -> bool {
    use Segment::*;
    matches!(segment, Pelvis | Torso | Head | LeftShank | RightShank | LeftFoot | RightFoot)
}

/// The joints at both ends of a limb's segment, and its side; none of trunk, head and feet.
#[must_use]
pub const fn limb(segment: Segment) -> Option<(Side, Joint, Joint)> {
    match segment {
        Segment::LeftThigh => Some((Side::Left, Joint::LeftHip, Joint::LeftKnee)),
        Segment::LeftShank => Some((Side::Left, Joint::LeftKnee, Joint::LeftAnkle)),
        Segment::RightThigh => Some((Side::Right, Joint::RightHip, Joint::RightKnee)),
        Segment::RightShank => Some((Side::Right, Joint::RightKnee, Joint::RightAnkle)),
        Segment::LeftUpperArm => Some((Side::Left, Joint::LeftShoulder, Joint::LeftElbow)),
        Segment::LeftForearm => Some((Side::Left, Joint::LeftElbow, Joint::LeftWrist)),
        Segment::RightUpperArm => Some((Side::Right, Joint::RightShoulder, Joint::RightElbow)),
        Segment::RightForearm => Some((Side::Right, Joint::RightElbow, Joint::RightWrist)),
        _ => None,
    }
}

/// A frame with Z along one direction and Y as near to another as can be.
fn upright(z: DVec3, y: DVec3) -> Option<DQuat> {
    let z = z.try_normalize()?;
    let y = (y - z * y.dot(z)).try_normalize()?;
    Some(DQuat::from_mat3(&DMat3::from_cols(y.cross(z), y, z)))
}

/// Joints of the legs and arms, and the outward direction of each hinge, in one pose.
struct Found {
    joints_m: [Option<DVec3>; 15],
    knees_out: [Option<DVec3>; 2],
    elbows_out: [Option<DVec3>; 2],
}

fn find(
    seen: &SeenMarkers,
    measures: &Measures,
    hips: HipBy,
    at: JointsAt,
    notes: &mut Vec<String>,
) -> Option<Found> {
    let of = |place: MarkerPlace| seen[place as usize];
    let pelvis = centres::pelvis(seen)?;
    let trunk = thorax(seen, measures.marker_radius_m);
    let mut joints_m = [None; 15];
    let (mut knees_out, mut elbows_out) = ([None; 2], [None; 2]);
    for side in Side::BOTH {
        let (letter, n) = (side.of("left", "right"), side as usize);
        let left = pelvis.turn * DVec3::Y;
        let mut put = |joint: Joint, place: Option<DVec3>| joints_m[joint.index()] = place;
        let hip_m = pelvis.world(hip(seen, side, measures, hips)?);
        put(side.of(Joint::LeftHip, Joint::RightHip), Some(hip_m));
        let marker = of(side.of(MarkerPlace::LKNE, MarkerPlace::RKNE));
        let (mut knee_m, mut out) = (marker, left * side.sign());
        if at != JointsAt::Markers {
            knee_m = knee(seen, side, hip_m, measures);
            if knee_m.is_none() && marker.is_some() {
                notes.push(format!("no marker on the {letter} thigh: its knee bends forwards"));
                let off_m = measures.sides[n].knee_width_m / 2.0 + measures.marker_radius_m;
                knee_m = marker.and_then(|marker| chord(marker + out, hip_m, marker, off_m));
            }
            out = marker.zip(knee_m).map_or(out, |(marker, knee_m)| marker - knee_m);
        }
        put(side.of(Joint::LeftKnee, Joint::RightKnee), knee_m);
        knees_out[n] = Some(out);
        let marker = of(side.of(MarkerPlace::LANK, MarkerPlace::RANK));
        let mut ankle_m = marker;
        if at != JointsAt::Markers {
            ankle_m = knee_m.and_then(|knee_m| {
                ankle(seen, side, knee_m, measures).or_else(|| {
                    let off_m = measures.sides[n].ankle_width_m / 2.0 + measures.marker_radius_m;
                    chord(marker? + out, knee_m, marker?, off_m)
                })
            });
        }
        put(side.of(Joint::LeftAnkle, Joint::RightAnkle), ankle_m);
        let Some(trunk) = &trunk else { continue };
        let on_marker = at == JointsAt::Markers;
        let shoulder_m = match on_marker {
            true => of(side.of(MarkerPlace::LSHO, MarkerPlace::RSHO)),
            false => shoulder(seen, side, trunk, measures),
        };
        put(side.of(Joint::LeftShoulder, Joint::RightShoulder), shoulder_m);
        let Some(shoulder_m) = shoulder_m else { continue };
        let out = elbow_out(seen, side, shoulder_m).unwrap_or(trunk.turn * DVec3::Y * side.sign());
        elbows_out[n] = Some(out);
        let elbow_m = match on_marker {
            true => of(side.of(MarkerPlace::LELB, MarkerPlace::RELB)),
            false => elbow(seen, side, shoulder_m, out, measures),
        };
        put(side.of(Joint::LeftElbow, Joint::RightElbow), elbow_m);
        let Some(elbow_m) = elbow_m else { continue };
        let inside = (!on_marker).then(|| wrist(seen, side, elbow_m, measures)).flatten();
        let wrist_m = inside.or_else(|| wrist_marker(seen, side));
        put(side.of(Joint::LeftWrist, Joint::RightWrist), wrist_m);
    }
    let (left, right) = (joints_m[Joint::LeftHip.index()]?, joints_m[Joint::RightHip.index()]?);
    joints_m[Joint::Pelvis.index()] = Some(left.midpoint(right));
    let mean = |places: &[MarkerPlace]| {
        let seen: Option<Vec<DVec3>> = places.iter().map(|place| of(*place)).collect();
        seen.map(|seen| seen.iter().sum::<DVec3>() / seen.len() as f64)
    };
    use MarkerPlace::{C7, LBHD, LSHO, RBHD, RSHO};
    // The joint of neck and head as the Human Motion Database's script has it (Guerra-Filho and Biswas, "The human
    // motion database", Image and Vision Computing 30, 2012).
    joints_m[Joint::Neck.index()] = mean(&[C7, C7, LSHO, RSHO, LBHD, RBHD]).or_else(|| of(C7));
    Some(Found { joints_m, knees_out, elbows_out })
}

impl Calibrated {
    /// Of a pose in which somebody stands still, Z up.
    ///
    /// # Errors
    /// If the markers of the pelvis are not all there.
    pub fn of(
        seen: &SeenMarkers,
        measures: Measures,
        hips: HipBy,
        at: JointsAt,
        notes: &mut Vec<String>,
    ) -> Result<Self, Error> {
        let found = find(seen, &measures, hips, at, notes).ok_or_else(|| {
            Error::of(ErrorKind::Absent, "the calibration does not show the pelvis")
                .allowed("LASI, RASI and LPSI with RPSI, or SACR, seen at the same time")
                .remedy("calibrate with another trial: --static FILE")
        })?;
        let mut joints_m = found.joints_m;
        let legs_m = (measures.sides[0].leg_length_m + measures.sides[1].leg_length_m) / 2.0;
        let middle = joints_m[Joint::Pelvis.index()].unwrap_or_default();
        joints_m[Joint::Torso.index()] = Some(middle + DVec3::Z * (LUMBAR * legs_m));
        let trunk = thorax(seen, measures.marker_radius_m);
        let mut segments: [Option<MarkedSegment>; 13] = Default::default();
        for segment in Segment::ALL {
            let turn = turn_of(segment, seen, &found, trunk.as_ref());
            let at_m = joints_m[crate::body::proportions::proximal_joint(segment).index()];
            let Some((turn, at_m)) = turn.zip(at_m) else { continue };
            let lay = Lie { turn, at_m };
            let on = |places: &[MarkerPlace]| -> Vec<(MarkerPlace, DVec3)> {
                let seen = places
                    .iter()
                    .filter_map(|place| Some((*place, lay.own(seen[*place as usize]?))));
                seen.collect()
            };
            let (markers, also) = (on(places(segment)), on(near_joint(segment)));
            let is_alone = matches!(segment, Segment::Pelvis | Segment::Torso | Segment::Head);
            if markers.len() >= if is_alone { 3 } else { 1 } {
                segments[segment.index()] = Some(MarkedSegment { markers, also, lay });
            }
        }
        let torso = segments[Segment::Torso.index()].as_ref();
        let on_trunk = |(torso, trunk): (&MarkedSegment, Lie)| Lie {
            turn: torso.lay.turn.inverse() * trunk.turn,
            at_m: torso.lay.own(trunk.at_m),
        };
        let thorax = torso.zip(trunk).map(on_trunk);
        Ok(Self { segments, joints_m, thorax, measures, hips })
    }

    /// A joint on a segment that carries it, m; `None` if either was not found.
    #[must_use]
    pub fn joint_on(&self, segment: Segment, joint: Joint) -> Option<DVec3> {
        let worn = self.segments[segment.index()].as_ref()?;
        Some(worn.lay.own(self.joints_m[joint.index()]?))
    }
}

/// How a segment lies in the calibration. Trunk, head, pelvis and feet are taken to stand upright and flat there:
/// that is the zero of every joint.
fn turn_of(
    segment: Segment,
    seen: &SeenMarkers,
    found: &Found,
    trunk: Option<&Lie>,
) -> Option<DQuat> {
    let of = |place: MarkerPlace| seen[place as usize];
    if let Some((side, from, to)) = limb(segment) {
        let (from, to) = (found.joints_m[from.index()]?, found.joints_m[to.index()]?);
        let is_leg = matches!(
            segment,
            Segment::LeftThigh | Segment::LeftShank | Segment::RightThigh | Segment::RightShank
        );
        let out = if is_leg { found.knees_out } else { found.elbows_out }[side as usize]?;
        return upright(from - to, out * side.sign());
    }
    match segment {
        Segment::Pelvis => upright(DVec3::Z, of(MarkerPlace::LASI)? - of(MarkerPlace::RASI)?),
        Segment::Torso => upright(DVec3::Z, trunk?.turn * DVec3::Y),
        Segment::Head => {
            let middle = |left, right| Some(of(left)?.midpoint(of(right)?));
            let back = middle(MarkerPlace::LBHD, MarkerPlace::RBHD).or(of(MarkerPlace::HTOP))?;
            let front = middle(MarkerPlace::LFHD, MarkerPlace::RFHD).or(of(MarkerPlace::HFRO))?;
            upright(DVec3::Z, DVec3::Z.cross(front - back))
        }
        Segment::LeftFoot | Segment::RightFoot => {
            let side = if segment == Segment::LeftFoot { Side::Left } else { Side::Right };
            let toe = of(side.of(MarkerPlace::LTOE, MarkerPlace::RTOE))?;
            let heel = of(side.of(MarkerPlace::LHEE, MarkerPlace::RHEE))
                .or(found.joints_m[side.of(Joint::LeftAnkle, Joint::RightAnkle).index()])?;
            upright(DVec3::Z, DVec3::Z.cross(toe - heel))
        }
        _ => None,
    }
}
