//! Where joints are under the skin: from markers and a person's measures.
//!
//! Plug-in Gait's rules (Davis et al., "A gait analysis data collection and reduction technique", Human Movement
//! Science 10, 1991; Vicon, "Plug-in Gait Reference Guide", with its constants) are followed to the letter, so that
//! what they give can be compared. For the hip there are two others: Bell et al., "A comparison of the accuracy of
//! several hip center location prediction methods", Journal of Biomechanics 23, 1990, and Harrington et al.,
//! "Prediction of the hip joint centre in adults, children, and patients with cerebral palsy based on magnetic
//! resonance imaging", Journal of Biomechanics 40, 2007.

use super::marker_set::{MarkerPlace, SeenMarkers};
use super::rigid::Lie;
use crate::body::anthropometry::Measure;
use crate::mocap::markers::Head;
use crate::mocap::parameters::Parameter;
use glam::{DMat3, DQuat, DVec3};
use serde::Serialize;

/// Angles of the hip joint in the pelvis, rad (Davis et al. 1991, Table 2, as Plug-in Gait rounds them).
const THETA: f64 = 0.5;
const BETA: f64 = 0.314;
/// Widths as parts of the leg's length, where nobody measured them; an adult of 0.92 m has a knee of 108 mm, an ankle of
/// 74, an elbow of 74, a wrist of 58, and 46 mm from the top of the shoulder to its centre. Ours.
const USUAL: [f64; 5] = [0.117, 0.080, 0.080, 0.063, 0.050];

/// Sine of the bend from which an elbow shows its hinge: 15 degrees.
const BENT: f64 = 0.26;

/// How the hip joints are placed in the pelvis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum HipBy {
    /// By the length of the leg, as Plug-in Gait does.
    #[default]
    PlugInGait,
    /// By the distance between the ASIS alone (Bell et al. 1990).
    Bell,
    /// By width and depth of the pelvis (Harrington et al. 2007).
    Harrington,
}

/// Where joints are taken to be.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum JointsAt {
    /// Moved inwards by the widths.
    #[default]
    Centres,
    /// On the markers of knee, ankle, shoulder, elbow and wrist; the hip by its rule.
    Markers,
    /// Moved inwards in each frame anew, by Plug-in Gait's rules, whatever that makes of the lengths of bones.
    EachFrame,
}

/// One side of the body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// The left one.
    Left,
    /// The right one.
    Right,
}

impl Side {
    /// Both.
    pub const BOTH: [Self; 2] = [Self::Left, Self::Right];

    /// 1 on the left, -1 on the right: what is outwards along Y.
    #[must_use]
    pub const fn sign(self) -> f64 {
        match self {
            Self::Left => 1.0,
            Self::Right => -1.0,
        }
    }

    /// Of a left and a right thing, this side's.
    #[must_use]
    pub fn of<T>(self, left: T, right: T) -> T {
        match self {
            Self::Left => left,
            Self::Right => right,
        }
    }
}

/// What is measured on one side of a person, m.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
#[allow(missing_docs)]
pub struct SideMeasures {
    pub leg_length_m: f64,
    pub knee_width_m: f64,
    pub ankle_width_m: f64,
    pub elbow_width_m: f64,
    pub wrist_width_m: f64,
    pub shoulder_offset_m: f64,
}

/// What the rules need to know of a person.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Measures {
    /// Of the left and the right side.
    pub sides: [SideMeasures; 2],
    /// From a marker's middle to the skin, m.
    pub marker_radius_m: f64,
    /// Distance between the ASIS, m, where a file says it.
    pub inter_asis_m: Option<f64>,
    /// Hip joints that motion showed, left and right, in the frame of [`pelvis`], m.
    pub hips_m: [Option<DVec3>; 2],
}

/// The names that Plug-in Gait gives to measures in the group PROCESSING, without the side.
const STORED: [(&str, Measure); 6] = [
    ("LegLength", Measure::LeftLegLength),
    ("KneeWidth", Measure::LeftKneeWidth),
    ("AnkleWidth", Measure::LeftAnkleWidth),
    ("ElbowWidth", Measure::LeftElbowWidth),
    ("WristWidth", Measure::LeftWristWidth),
    ("ShoulderOffset", Measure::LeftShoulderOffset),
];

impl Measures {
    /// What the files say, the first first; what none says is estimated from the legs of a standing person, and
    /// told of in `notes`.
    #[must_use]
    pub fn of(
        heads: &[&Head],
        stands: &SeenMarkers,
        radius_m: f64,
        notes: &mut Vec<String>,
    ) -> Self {
        let stored = |name: &str| {
            heads.iter().find_map(|head| {
                let groups = ["PROCESSING", "SUBJECTS", "SUBJECT"].into_iter();
                let found = groups.filter_map(|group| head.parameters.get(group, name)).next();
                let number = found.and_then(Parameter::number)? * head.metres_per_unit()?;
                (number.is_finite() && number > 0.0).then_some(number)
            })
        };
        let mut estimated = Vec::new();
        let sides = Side::BOTH.map(|side| {
            let letter = side.of("L", "R");
            let leg_m = leg_length(stands, side);
            let values: [f64; 6] = std::array::from_fn(|at| {
                let (name, measure) = STORED[at];
                let name = format!("{letter}{name}");
                let known = stored(&name).filter(|value| measure.range().contains(value));
                known.unwrap_or_else(|| {
                    let value = if at == 0 { leg_m } else { leg_m * USUAL[at - 1] };
                    estimated.push(format!("{name} {:.0} mm", value * 1e3));
                    value
                })
            });
            let [leg_length_m, knee_width_m, ankle_width_m, elbow_width_m, wrist_width_m, _] =
                values;
            let shoulder_offset_m = values[5];
            SideMeasures {
                leg_length_m,
                knee_width_m,
                ankle_width_m,
                elbow_width_m,
                wrist_width_m,
                shoulder_offset_m,
            }
        });
        if !estimated.is_empty() {
            notes.push(format!(
                "not in the file, estimated from the length of the legs: {}",
                estimated.join(", ")
            ));
        }
        Self {
            sides,
            marker_radius_m: radius_m,
            inter_asis_m: stored("InterAsisDistance"),
            hips_m: [None; 2],
        }
    }

    fn side(&self, side: Side) -> &SideMeasures {
        &self.sides[side as usize]
    }
}

/// From the front of the hip bone over the knee to the ankle, by markers, m.
fn leg_length(seen: &SeenMarkers, side: Side) -> f64 {
    let of = |place: MarkerPlace| seen[place as usize];
    let hip = of(side.of(MarkerPlace::LASI, MarkerPlace::RASI));
    let knee = of(side.of(MarkerPlace::LKNE, MarkerPlace::RKNE));
    let ankle = of(side.of(MarkerPlace::LANK, MarkerPlace::RANK));
    let (Some(hip), Some(knee), Some(ankle)) = (hip, knee, ankle) else { return 0.9 };
    hip.distance(knee) + knee.distance(ankle)
}

/// The joint beside a marker (Davis et al. 1991; the "chord" of Plug-in Gait): in the plane of the marker, the joint
/// `above` and `beside`, off the marker by `off_m` at a right angle to the bone, on the side where `beside` is not.
#[must_use]
pub fn chord(beside: DVec3, above: DVec3, marker: DVec3, off_m: f64) -> Option<DVec3> {
    let way = above - marker;
    let along = way.try_normalize()?;
    let out = beside - marker;
    let inwards = -(out - along * out.dot(along)).try_normalize()?;
    let cosine = (off_m / way.length()).clamp(0.0, 1.0);
    Some(marker + (along * cosine + inwards * (1.0 - cosine * cosine).sqrt()) * off_m)
}

/// The pelvis by its markers: X forward, Y left, its origin in the middle of the ASIS.
#[must_use]
pub fn pelvis(seen: &SeenMarkers) -> Option<Lie> {
    let of = |place: MarkerPlace| seen[place as usize];
    let (left, right) = (of(MarkerPlace::LASI)?, of(MarkerPlace::RASI)?);
    let at_m = left.midpoint(right);
    let y = (left - right).try_normalize()?;
    let forward = at_m - back(seen)?;
    let x = (forward - y * forward.dot(y)).try_normalize()?;
    let turn = DQuat::from_mat3(&DMat3::from_cols(x, y, x.cross(y)));
    Some(Lie { turn, at_m })
}

/// The middle between the PSIS, or the sacrum.
fn back(seen: &SeenMarkers) -> Option<DVec3> {
    let of = |place: MarkerPlace| seen[place as usize];
    match (of(MarkerPlace::LPSI), of(MarkerPlace::RPSI)) {
        (Some(left), Some(right)) => Some(left.midpoint(right)),
        _ => of(MarkerPlace::SACR),
    }
}

/// A hip joint in the frame of [`pelvis`], m: as motion showed it, else by a rule.
#[must_use]
pub fn hip(seen: &SeenMarkers, side: Side, measures: &Measures, by: HipBy) -> Option<DVec3> {
    if let Some(shown_m) = measures.hips_m[side as usize] {
        return Some(shown_m);
    }
    let of = |place: MarkerPlace| seen[place as usize];
    let (left, right) = (of(MarkerPlace::LASI)?, of(MarkerPlace::RASI)?);
    let width = left.distance(right);
    let [x, y, z] = match by {
        HipBy::PlugInGait => {
            let both = [Side::Left, Side::Right].map(|side| measures.side(side).leg_length_m);
            let c = 0.115 * (both[0] + both[1]) / 2.0 - 0.0153;
            let half = measures.inter_asis_m.unwrap_or(width) / 2.0;
            // From the ASIS back to the trochanter, and from the skin to the marker.
            let behind =
                0.1288 * measures.side(side).leg_length_m - 0.048_56 + measures.marker_radius_m;
            [
                c * THETA.cos() * BETA.sin() - behind * BETA.cos(),
                half - c * THETA.sin(),
                -c * THETA.cos() * BETA.cos() - behind * BETA.sin(),
            ]
        }
        HipBy::Bell => [-0.22 * width, 0.36 * width, -0.30 * width],
        HipBy::Harrington => {
            let depth = left.midpoint(right).distance(back(seen)?);
            [-0.24 * depth - 0.0099, 0.33 * width + 0.0073, -0.30 * width - 0.0109]
        }
    };
    Some(DVec3::new(x, y * side.sign(), z))
}

/// The knee joint of a frame.
#[must_use]
pub fn knee(seen: &SeenMarkers, side: Side, hip_m: DVec3, measures: &Measures) -> Option<DVec3> {
    let marker = seen[side.of(MarkerPlace::LKNE, MarkerPlace::RKNE) as usize]?;
    let beside = seen[side.of(MarkerPlace::LTHI, MarkerPlace::RTHI) as usize]?;
    let off_m = measures.side(side).knee_width_m / 2.0 + measures.marker_radius_m;
    chord(beside, hip_m, marker, off_m)
}

/// The ankle joint of a frame.
#[must_use]
pub fn ankle(seen: &SeenMarkers, side: Side, knee_m: DVec3, measures: &Measures) -> Option<DVec3> {
    let marker = seen[side.of(MarkerPlace::LANK, MarkerPlace::RANK) as usize]?;
    let beside = seen[side.of(MarkerPlace::LTIB, MarkerPlace::RTIB) as usize]?;
    let off_m = measures.side(side).ankle_width_m / 2.0 + measures.marker_radius_m;
    chord(beside, knee_m, marker, off_m)
}

/// The trunk by its markers: X forward, Y left, Z up, its origin behind the front marker.
#[must_use]
pub fn thorax(seen: &SeenMarkers, radius_m: f64) -> Option<Lie> {
    let of = |place: MarkerPlace| seen[place as usize];
    let (c7, clav) = (of(MarkerPlace::C7)?, of(MarkerPlace::CLAV)?);
    // Without the lower two, the line between the shoulders says where left is.
    let (z, forward) = match (of(MarkerPlace::T10), of(MarkerPlace::STRN)) {
        (Some(t10), Some(strn)) => ((clav + c7) - (strn + t10), (clav + strn) - (c7 + t10)),
        _ => {
            let left = of(MarkerPlace::LSHO)? - of(MarkerPlace::RSHO)?;
            let forward = clav - c7;
            (forward.cross(left), forward)
        }
    };
    let z = z.try_normalize()?;
    let x = (forward - z * forward.dot(z)).try_normalize()?;
    let turn = DQuat::from_mat3(&DMat3::from_cols(x, z.cross(x), z));
    Some(Lie { turn, at_m: clav - x * radius_m })
}

/// The shoulder joint of a frame. `thorax` is that of [`thorax`].
#[must_use]
pub fn shoulder(
    seen: &SeenMarkers,
    side: Side,
    thorax: &Lie,
    measures: &Measures,
) -> Option<DVec3> {
    let marker = seen[side.of(MarkerPlace::LSHO, MarkerPlace::RSHO) as usize]?;
    let up = (marker - thorax.at_m).cross(thorax.turn * DVec3::X).try_normalize()?;
    let up = if up.dot(thorax.turn * DVec3::Z) > 0.0 { up } else { -up };
    let off_m = measures.side(side).shoulder_offset_m + measures.marker_radius_m;
    chord(marker + up, thorax.at_m, marker, off_m)
}

/// The middle between the markers of a wrist.
#[must_use]
pub fn wrist_marker(seen: &SeenMarkers, side: Side) -> Option<DVec3> {
    let of = |place: MarkerPlace| seen[place as usize];
    let thumb = of(side.of(MarkerPlace::LWRA, MarkerPlace::RWRA));
    let other = of(side.of(MarkerPlace::LWRB, MarkerPlace::RWRB));
    match (thumb, other) {
        (Some(a), Some(b)) => Some(a.midpoint(b)),
        (one, other) => one.or(other),
    }
}

/// Outwards along the hinge of an elbow: at a right angle to the plane of upper arm and forearm, or, of an arm that is
/// all but straight, as the markers of the wrist lie while the palm faces the body.
#[must_use]
pub fn elbow_out(seen: &SeenMarkers, side: Side, shoulder_m: DVec3) -> Option<DVec3> {
    let of = |place: MarkerPlace| seen[place as usize];
    let marker = of(side.of(MarkerPlace::LELB, MarkerPlace::RELB))?;
    let (up, down) = (shoulder_m - marker, wrist_marker(seen, side)? - marker);
    let hinge = up.cross(down) * side.sign();
    if hinge.length() >= BENT * up.length() * down.length() {
        return hinge.try_normalize();
    }
    let thumb = of(side.of(MarkerPlace::LWRA, MarkerPlace::RWRA))?;
    let other = of(side.of(MarkerPlace::LWRB, MarkerPlace::RWRB))?;
    (up.cross(thumb - other) * side.sign()).try_normalize()
}

/// The elbow joint of a frame: off its marker inwards, against `out`.
#[must_use]
pub fn elbow(
    seen: &SeenMarkers,
    side: Side,
    shoulder_m: DVec3,
    out: DVec3,
    measures: &Measures,
) -> Option<DVec3> {
    let marker = seen[side.of(MarkerPlace::LELB, MarkerPlace::RELB) as usize]?;
    let off_m = measures.side(side).elbow_width_m / 2.0 + measures.marker_radius_m;
    chord(marker + out, shoulder_m, marker, off_m)
}

/// The wrist joint of a frame: under the middle of its two markers.
#[must_use]
pub fn wrist(seen: &SeenMarkers, side: Side, elbow_m: DVec3, measures: &Measures) -> Option<DVec3> {
    let of = |place: MarkerPlace| seen[place as usize];
    let thumb = of(side.of(MarkerPlace::LWRA, MarkerPlace::RWRA))?;
    let other = of(side.of(MarkerPlace::LWRB, MarkerPlace::RWRB))?;
    let middle = thumb.midpoint(other);
    let in_ = (other - thumb).cross(middle - elbow_m).try_normalize()? * side.sign();
    let off_m = measures.side(side).wrist_width_m / 2.0 + measures.marker_radius_m;
    Some(middle + in_ * off_m)
}
