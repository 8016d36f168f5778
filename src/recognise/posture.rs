//! The posture of a body: Salamah and Brunnett's Eqs. 6 to 17, each in two readings. The strict one is
//! what they print; the repaired one is what it must mean.
//!
//! | Eq. | strict | repaired |
//! |---|---|---|
//! | 6 | read from left to right, without the outer brackets that are missing | either leg by itself |
//! | 10 | the hip lower than delta above the world's zero, no foot on the other side asked for | the hip less than delta above its foot |
//! | 11 | a trunk that points down lies too | it is a handstand |
//! | 14, 15 | the front within [`FACING_RAD`] of the vertical | the side to which it points |
//!
//! Postures overlap in the paper; they are tried in the order of [`MajorPosture`], which is ours. What is not shown
//! is unknown: a posture is named if it is known and every one before it is known not to be.

use super::contact::{Contacts, Known};
use super::points::{Axes, BodyPoint, Lengths, Points};
use glam::{DVec2, DVec3};

/// How the paper's equations are read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum EquationReading {
    /// What they must mean.
    #[default]
    Repaired,
    /// What is printed.
    Strict,
}

/// eta of Eq. 6, femurs.
const EXTENDED: f64 = 1.5;
/// alpha of Eq. 6.
const LEG_INCLINED_RAD: f64 = 45.0 * core::f64::consts::PI / 180.0;
/// beta of Eqs. 7 and 8.
const UPRIGHT_RAD: f64 = 30.0 * core::f64::consts::PI / 180.0;
/// delta of Eqs. 9 and 10, femurs.
const LOW: f64 = 0.5;
/// gamma of Eq. 11.
const HORIZONTAL_RAD: f64 = 70.0 * core::f64::consts::PI / 180.0;
/// How near "approximately 180" and "approximately 0" degrees of Eqs. 14 and 15 are, read strictly
/// (ours; the paper gives no number): what gamma leaves to the horizontal.
pub const FACING_RAD: f64 = 20.0 * core::f64::consts::PI / 180.0;
/// A knee is bent by more than this (ours: the paper says "bent").
const BENT_RAD: f64 = 60.0 * core::f64::consts::PI / 180.0;

/// A major posture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MajorPosture {
    /// Both feet and both hands on the ground, the root above it.
    FourSupported,
    /// A leg is extended and not inclined much.
    Standing,
    /// A knee is on the ground, the root is not.
    Kneeling,
    /// The trunk is horizontal.
    Lying,
    /// The centre of mass is not above the feet.
    Sitting,
    /// The hip is low above a foot on the ground.
    Squatting,
    /// At least a foot and a hand on the ground: the paper's other variant, Eq. 17.
    FootAndHand,
    /// None of them: on the way from one to another.
    Transition,
}

impl MajorPosture {
    /// All of them, in the order in which they are tried.
    pub const ALL: [Self; 8] = [
        Self::FourSupported,
        Self::Standing,
        Self::Kneeling,
        Self::Lying,
        Self::Sitting,
        Self::Squatting,
        Self::FootAndHand,
        Self::Transition,
    ];

    /// Its word in models.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::FourSupported => "four_supported",
            Self::Standing => "standing",
            Self::Kneeling => "kneeling",
            Self::Lying => "lying",
            Self::Sitting => "sitting",
            Self::Squatting => "squatting",
            Self::FootAndHand => "foot_and_hand",
            Self::Transition => "transition",
        }
    }
}

/// All that is said of the posture of one frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PostureState {
    /// The first posture that fits; none where too little is shown to say.
    pub major: Option<MajorPosture>,
    /// Eq. 7; its opposite is "bent", Eq. 8. ("Leaned" needs to know what is leaned against.)
    pub upright: Known,
    /// Of who sits or lies: on the ground and not on an object (Eq. 12).
    pub on_floor: Known,
    /// Of who kneels or squats: with both knees.
    pub symmetric: Known,
    /// Eqs. 13 and 14: the front down, hips level. Of four supports: forward.
    pub on_belly: Known,
    /// Eqs. 13 and 15: the front up, hips level. Of four supports: backward.
    pub on_back: Known,
    /// Eq. 16: one hip above the other.
    pub sideways: Known,
}

fn and(a: Known, b: Known) -> Known {
    match (a, b) {
        (Some(false), _) | (_, Some(false)) => Some(false),
        (Some(true), Some(true)) => Some(true),
        _ => None,
    }
}

fn or(a: Known, b: Known) -> Known {
    not(and(not(a), not(b)))
}

fn not(a: Known) -> Known {
    a.map(|a| !a)
}

/// Whether a number is beyond another; unknown if either is none.
fn above(value: f64, limit: f64) -> Known {
    (!value.is_nan() && !limit.is_nan()).then_some(value > limit)
}

/// Whether an angle whose cosine this is is wider than another; unknown if it is none. An arc cosine costs more than all else.
fn wider(cos: f64, than_rad: f64) -> Known {
    above(-cos, -than_rad.cos())
}

fn angle(a: DVec3, b: DVec3) -> f64 {
    a.angle_between(b)
}

/// One frame.
struct Frame<'a> {
    points: &'a Points,
    axes: &'a Axes,
    lengths: &'a Lengths,
    contacts: &'a Contacts,
    reading: EquationReading,
    /// Cosine of the angle from the trunk to the vertical.
    trunk_cos: f64,
}

/// The posture of one frame.
#[must_use]
pub fn posture(
    points: &Points,
    axes: &Axes,
    lengths: &Lengths,
    contacts: &Contacts,
    reading: EquationReading,
) -> PostureState {
    let frame = Frame::of(points, axes, lengths, contacts, reading);
    // One after the other: what comes behind the first that fits, or that cannot be told, is not asked.
    let tried: [fn(&Frame<'_>) -> Known; 8] = [
        |frame| frame.four_supported(),
        |frame| frame.standing(),
        |frame| frame.kneeling(),
        |frame| frame.lying(),
        |frame| frame.sitting(),
        |frame| frame.squatting(),
        |frame| frame.foot_and_hand(),
        |_| Some(true),
    ];
    let first = MajorPosture::ALL
        .into_iter()
        .zip(tried)
        .map(|(posture, fits)| (posture, fits(&frame)))
        .find(|(_, fits)| *fits != Some(false));
    let major = first.and_then(|(posture, fits)| fits.map(|_| posture));
    let hips = or(contacts.hips[0], contacts.hips[1]);
    let knees = if major == Some(MajorPosture::Kneeling) {
        and(contacts.knees[0], contacts.knees[1])
    } else {
        and(frame.knee_bent(0), frame.knee_bent(1))
    };
    let hips_level = frame.hips_level();
    PostureState {
        major,
        upright: not(wider(frame.trunk_cos, UPRIGHT_RAD)),
        on_floor: hips,
        symmetric: knees,
        on_belly: and(hips_level, frame.faces(DVec3::NEG_Z)),
        on_back: and(hips_level, frame.faces(DVec3::Z)),
        sideways: not(hips_level),
    }
}

const SIDES: [[BodyPoint; 3]; 2] = [
    [BodyPoint::LeftHip, BodyPoint::LeftKnee, BodyPoint::LeftFoot],
    [BodyPoint::RightHip, BodyPoint::RightKnee, BodyPoint::RightFoot],
];

impl<'a> Frame<'a> {
    fn of(
        points: &'a Points,
        axes: &'a Axes,
        lengths: &'a Lengths,
        contacts: &'a Contacts,
        reading: EquationReading,
    ) -> Self {
        let trunk = points[BodyPoint::Chest] - points[BodyPoint::Root];
        Self { points, axes, lengths, contacts, reading, trunk_cos: trunk.z / trunk.length() }
    }

    /// Eq. 6.
    fn standing(&self) -> Known {
        let [left, right] = SIDES.map(|[hip, _, foot]| {
            let leg = self.points[hip] - self.points[foot];
            let length = leg.length();
            let extended = above(length, EXTENDED * self.lengths.femur_m);
            (extended, not(wider(leg.z / length, LEG_INCLINED_RAD)))
        });
        match self.reading {
            EquationReading::Repaired => or(and(left.0, left.1), and(right.0, right.1)),
            EquationReading::Strict => and(or(and(left.0, left.1), right.0), right.1),
        }
    }

    /// Eq. 9.
    fn kneeling(&self) -> Known {
        let height_m = self.points[BodyPoint::Root].z - self.contacts.floor_m;
        let knee = or(self.contacts.knees[0], self.contacts.knees[1]);
        and(knee, above(height_m, LOW * self.lengths.femur_m))
    }

    /// Eq. 11.
    fn lying(&self) -> Known {
        let inclined = wider(self.trunk_cos, HORIZONTAL_RAD);
        match self.reading {
            EquationReading::Repaired => {
                and(inclined, not(wider(self.trunk_cos, core::f64::consts::PI - HORIZONTAL_RAD)))
            }
            EquationReading::Strict => inclined,
        }
    }

    /// Sec. 4.1.5, which has no equation.
    fn sitting(&self) -> Known {
        let beyond = self.mass_beyond_feet_m();
        and(not(self.lying()), above(beyond, 0.0))
    }

    /// Eq. 10.
    fn squatting(&self) -> Known {
        let low_m = LOW * self.lengths.femur_m;
        let side = |side: usize| {
            let [hip, _, foot] = SIDES[side];
            let height_m = match self.reading {
                EquationReading::Repaired => self.points[hip].z - self.points[foot].z,
                EquationReading::Strict => self.points[hip].z,
            };
            let knee_up = not(self.contacts.knees[side]);
            and(and(self.contacts.feet[side], not(above(height_m, low_m))), knee_up)
        };
        and(or(side(0), side(1)), not(self.lying()))
    }

    /// Sec. 4.1.9.
    fn four_supported(&self) -> Known {
        let Contacts { feet, hands, floor_m, .. } = self.contacts;
        let all = and(and(feet[0], feet[1]), and(hands[0], hands[1]));
        and(all, above(self.points[BodyPoint::Root].z, *floor_m))
    }

    /// Eq. 17.
    fn foot_and_hand(&self) -> Known {
        let Contacts { feet, hands, .. } = self.contacts;
        and(or(feet[0], feet[1]), or(hands[0], hands[1]))
    }

    /// Eq. 13; its opposite is Eq. 16.
    fn hips_level(&self) -> Known {
        let across = self.points[BodyPoint::LeftHip] - self.points[BodyPoint::RightHip];
        not(above(across.z.abs(), across.length() / 2.0))
    }

    /// Eqs. 14 and 15.
    fn faces(&self, direction: DVec3) -> Known {
        match self.reading {
            EquationReading::Repaired => above(self.axes.forward.dot(direction), 0.0),
            EquationReading::Strict => not(above(angle(self.axes.forward, direction), FACING_RAD)),
        }
    }

    fn knee_bent(&self, side: usize) -> Known {
        let [hip, knee, foot] = SIDES[side].map(|place| self.points[place]);
        let (thigh, shank) = (knee - hip, foot - knee);
        wider(thigh.dot(shank) / (thigh.length_squared() * shank.length_squared()).sqrt(), BENT_RAD)
    }

    /// How far the centre of mass is outside what the feet span, level, m; below zero inside.
    fn mass_beyond_feet_m(&self) -> f64 {
        let centre = centre_of_mass(self.points).truncate();
        let soles: [DVec2; 4] =
            [BodyPoint::LeftFoot, BodyPoint::RightFoot, BodyPoint::LeftToe, BodyPoint::RightToe]
                .map(|place| self.points[place].truncate());
        // An ankle is in the middle of a foot: what is behind and beside it carries too.
        let margin_m = 0.25 * self.lengths.tibia_m;
        outside_hull_m(centre, &soles) - margin_m
    }
}

/// The whole-body centre of mass from joints alone: masses and places of the segments after Dempster,
/// in Winter, "Biomechanics and Motor Control of Human Movement", 4th ed., 2009, Table 4.1 (trunk with
/// head and neck, whole arms as far as the wrist, thighs, shanks with feet). An arm is on the line from
/// chest to wrist.
fn centre_of_mass(points: &Points) -> DVec3 {
    let between = |from: BodyPoint, to: BodyPoint, share: f64| points[from].lerp(points[to], share);
    let parts = [
        (0.578, between(BodyPoint::Root, BodyPoint::Chest, 0.66)),
        (0.050, between(BodyPoint::Chest, BodyPoint::LeftHand, 0.53)),
        (0.050, between(BodyPoint::Chest, BodyPoint::RightHand, 0.53)),
        (0.100, between(BodyPoint::LeftHip, BodyPoint::LeftKnee, 0.433)),
        (0.100, between(BodyPoint::RightHip, BodyPoint::RightKnee, 0.433)),
        (0.061, between(BodyPoint::LeftKnee, BodyPoint::LeftFoot, 0.606)),
        (0.061, between(BodyPoint::RightKnee, BodyPoint::RightFoot, 0.606)),
    ];
    parts.iter().map(|(mass, at)| *at * *mass).sum()
}

/// How far a point is outside the convex hull of some others; the negative distance to the nearest
/// edge inside. Not a number if one of them is none.
fn outside_hull_m(point: DVec2, others: &[DVec2; 4]) -> f64 {
    // The distance to a convex hull is the greatest of those to the lines that have it on one side.
    if point.is_nan() || others.iter().any(|other| other.is_nan()) {
        return f64::NAN;
    }
    let mut nearest_edge = f64::MAX;
    let mut inside = true;
    let mut is_thin = true;
    for from in others {
        for to in others {
            let Some(along) = (to - from).try_normalize() else { continue };
            let left = |of: DVec2| along.perp_dot(of - from);
            if others.iter().any(|other| left(*other) < -1e-12) {
                continue;
            }
            is_thin &= others.iter().all(|other| left(*other) < 1e-9);
            inside &= left(point) >= 0.0;
            let share = (point - from).dot(along).clamp(0.0, from.distance(*to));
            nearest_edge = nearest_edge.min(point.distance(from + along * share));
        }
    }
    if nearest_edge == f64::MAX {
        return point.distance(others[0]);
    }
    if inside && !is_thin { -nearest_edge } else { nearest_edge }
}

#[cfg(test)]
mod tests;
