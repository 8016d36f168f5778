//! How sensors sit on a body, from poses and movements a person can do.
//!
//! N pose: every segment is upright and faces forward, so the tilt of each sensor on its segment
//! follows from gravity. What is left is one angle about the vertical per sensor, which no single
//! pose shows. It is told, best first,
//!
//! 1. by a movement: bowing, sitting down, bending knees and elbows turn segments about the body's
//!    Y axis. The axis of the sensor's angular rate (principal components) is that axis;
//! 2. by a second pose, for arms: from N to T pose they turn about the body's X axis;
//! 3. by how the sensor was strapped on: the axis of it that was to point forward.
//!
//! Whoever is calibrated faces the same way throughout; that way is +X of the world.

use crate::body::Segment;
use crate::error::Error;
use crate::units::wrap_rad;
use glam::{DMat3, DQuat, DVec3};
use nalgebra::{Matrix3, SymmetricEigen};

/// A person who stands still moves less than this, rad, root mean square.
pub(super) const STILL_RAD: f64 = 0.05;
/// A movement is about one axis if the second principal component of its angular rate is below this
/// share of the first.
pub const CONSISTENT: f64 = 0.1;
/// A movement turns a segment at least this far, rad.
const LEAST_TURN_RAD: f64 = 0.35;
/// An axis that is horizontal on a body is measured this near to it: the sine of its slope.
const LEVEL: f64 = 0.35;
/// A sensor whose tilt on its segment changed by more than this has slipped, rad.
const SLIPPED_RAD: f64 = 0.26;
/// From N to T pose an arm turns by a right angle, give or take this, rad.
const T_POSE_RAD: f64 = 0.6;

/// A sensor as it was strapped on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WornSensor {
    /// The segment that wears it.
    pub segment: Segment,
    /// The axis of the sensor that was to point forward in N pose, in the sensor's axes; used where
    /// nothing better tells. `None` if it was strapped on anyhow.
    pub forward: Option<DVec3>,
}

/// A movement that turns some segments about the body's Y axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Movement {
    /// From standing, a bow with a straight back and neck, and back.
    Bow,
    /// From standing, sitting down and getting up.
    SitToStand,
    /// From standing, elbows and knees bent and stretched: marching with the feet pulled along,
    /// arms at the sides.
    Bend,
    /// From hanging, both straight arms raised forward and lowered.
    RaiseArms,
}

impl Movement {
    /// All of them, in the order in which they are asked for.
    pub const ALL: [Self; 4] = [Self::Bow, Self::SitToStand, Self::Bend, Self::RaiseArms];

    /// The segments it turns, and whether their turning about +Y is positive at the far end.
    #[must_use]
    pub const fn turns(self) -> &'static [(Segment, f64)] {
        use Segment as S;
        match self {
            Self::Bow => &[(S::Pelvis, 1.0), (S::Torso, 1.0), (S::Head, 1.0)],
            Self::SitToStand => &[(S::LeftThigh, -1.0), (S::RightThigh, -1.0)],
            Self::Bend => &[
                (S::LeftForearm, -1.0),
                (S::RightForearm, -1.0),
                (S::LeftShank, 1.0),
                (S::RightShank, 1.0),
                (S::LeftFoot, 1.0),
                (S::RightFoot, 1.0),
            ],
            Self::RaiseArms => &[(S::LeftUpperArm, -1.0), (S::RightUpperArm, -1.0)],
        }
    }
}

/// What a sensor said during a movement.
#[derive(Clone, Debug, PartialEq)]
pub struct Moved {
    /// The movement.
    pub movement: Movement,
    /// Orientations of each sensor in its own world, evenly sampled, `[sensor][sample]`.
    pub orientation: Vec<Vec<DQuat>>,
}

/// How the heading of a sensor was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HeadingBy {
    /// A movement about the body's Y axis.
    Movement,
    /// The turn from N to T pose.
    TPose,
    /// The way it was to be strapped on: as good as that was done.
    Strapping,
}

impl HeadingBy {
    /// Its word in files and reports.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Movement => "movement",
            Self::TPose => "t_pose",
            Self::Strapping => "strapping",
        }
    }

    /// What a word means.
    #[must_use]
    pub fn from_word(word: &str) -> Option<Self> {
        [Self::Movement, Self::TPose, Self::Strapping].into_iter().find(|by| by.word() == word)
    }
}

/// How a sensor sits on its segment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mount {
    /// The segment.
    pub segment: Segment,
    /// Turns vectors of the segment into those of the sensor.
    pub sensor_from_segment: DQuat,
    /// Heading of the sensor's world in ours, rad.
    pub heading_rad: f64,
    /// How it was found.
    pub heading_by: HeadingBy,
    /// Second over first principal component of the movement's angular rate.
    pub consistency: Option<f64>,
    /// Heading by strapping minus the heading found, rad: how far the sensor sits from where it was
    /// to sit.
    pub strapped_off_rad: Option<f64>,
}

impl Mount {
    /// The segment in our world, from what its sensor says in its own.
    #[must_use]
    pub fn segment_in_world(&self, said: DQuat) -> DQuat {
        (DQuat::from_rotation_z(self.heading_rad) * said * self.sensor_from_segment).normalize()
    }
}

/// How all sensors sit.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Calibration {
    /// Sensor by sensor.
    pub mounts: Vec<Mount>,
    /// What a person should know, a line each.
    pub notes: Vec<String>,
}

/// Calibrates `sensors` from what they said, each in its own world, while the person stood in N
/// pose, and, as far as there are any, in T pose and during movements. All are `[sensor][sample]`.
///
/// # Errors
/// Two sensors on a segment, lists that do not fit, a person who moved in a pose, and a sensor
/// whose heading nothing tells: each names the segment and says what to do.
pub fn calibrate(
    sensors: &[WornSensor],
    n_pose: &[Vec<DQuat>],
    t_pose: Option<&[Vec<DQuat>]>,
    moves: &[Moved],
) -> Result<Calibration, Error> {
    let count = sensors.len();
    let fits = |lists: &[Vec<DQuat>]| lists.len() == count;
    if !(fits(n_pose) && t_pose.is_none_or(fits) && moves.iter().all(|m| fits(&m.orientation))) {
        return Err(Error::new("there is not one series for every sensor")
            .allowed(format!("{count} series")));
    }
    let mut calibration = Calibration::default();
    for (at, sensor) in sensors.iter().enumerate() {
        let name = format!("sensor on the {}", words(sensor.segment));
        if sensors[..at].iter().any(|other| other.segment == sensor.segment) {
            return Err(Error::new("two sensors are worn on one segment").at(name));
        }
        let standing = still(&n_pose[at], &name, "N pose")?;
        let spread = t_pose.map(|poses| still(&poses[at], &name, "T pose")).transpose()?;
        let moved = moves.iter().map(|moved| (moved.movement, moved.orientation[at].as_slice()));
        let notes = &mut calibration.notes;
        let found = by_movement(sensor.segment, standing, moved, &name, notes)
            .map(|(heading, consistency)| (heading, HeadingBy::Movement, Some(consistency)));
        let found = found.or_else(|| {
            let heading = by_t_pose(sensor.segment, standing, spread?, &name, notes)?;
            Some((heading, HeadingBy::TPose, None))
        });
        let strapped = sensor.forward.and_then(|forward| by_strapping(standing, forward));
        let found = found.or_else(|| Some((strapped?, HeadingBy::Strapping, None)));
        let Some((heading_rad, heading_by, consistency)) = found else {
            return Err(Error::new("nothing tells which way a sensor faces").at(name).remedy(
                "do a movement that turns this segment, or strap the sensor on with a \
                         known axis forward and say which",
            ));
        };
        let upright = DQuat::from_rotation_z(-heading_rad);
        calibration.mounts.push(Mount {
            segment: sensor.segment,
            sensor_from_segment: (standing.inverse() * upright).normalize(),
            heading_rad,
            heading_by,
            consistency,
            strapped_off_rad: strapped.map(|strapped| wrap_rad(strapped - heading_rad)),
        });
    }
    Ok(calibration)
}

impl Calibration {
    /// The same mounts with headings found anew: `n_pose` is what each sensor, in the order of
    /// [`Calibration::mounts`], said while the person stood in N pose. For sensors that were switched
    /// off since, whose own headings begin elsewhere.
    ///
    /// # Errors
    /// Lists that do not fit, a sensor that moved, and one that hangs on its segment differently
    /// from before: its strap has slipped.
    pub fn reheaded(&self, n_pose: &[Vec<DQuat>]) -> Result<Self, Error> {
        let mut found = Self { mounts: Vec::new(), notes: self.notes.clone() };
        if n_pose.len() != self.mounts.len() {
            return Err(Error::new("there is not one series for every sensor")
                .allowed(format!("{} series", self.mounts.len())));
        }
        for (mount, said) in self.mounts.iter().zip(n_pose) {
            let name = format!("sensor on the {}", words(mount.segment));
            let standing = still(said, &name, "N pose")?;
            // An upright segment is turned about the vertical only in its sensor's world.
            let turned = standing * mount.sensor_from_segment;
            let heading_rad = wrap_rad(-2.0 * turned.z.atan2(turned.w));
            let lean = DQuat::from_rotation_z(heading_rad) * turned;
            let lean_rad = DQuat::IDENTITY.angle_between(if lean.w < 0.0 { -lean } else { lean });
            if !(lean_rad <= SLIPPED_RAD) {
                return Err(Error::new("a sensor does not sit as it did when it was calibrated")
                    .at(name)
                    .got(format!("turned by {:.0} deg", lean_rad.to_degrees()))
                    .allowed(format!("{:.0} deg", SLIPPED_RAD.to_degrees()))
                    .remedy("stand in N pose; if the strap has slipped, calibrate again"));
            }
            let upright = DQuat::from_rotation_z(-heading_rad);
            let sensor_from_segment = (standing.inverse() * upright).normalize();
            found.mounts.push(Mount { sensor_from_segment, heading_rad, ..*mount });
        }
        Ok(found)
    }
}

/// Mean orientation and root mean square distance from it, rad; `None` without a sample.
pub(super) fn mean(said: &[DQuat]) -> Option<(DQuat, f64)> {
    let sound: Vec<DQuat> = said.iter().copied().filter(|q| q.is_finite()).collect();
    let first = sound.first().copied()?;
    let same_side = |q: &DQuat| if q.dot(first) < 0.0 { -*q } else { *q };
    let sum = sound.iter().map(same_side).fold(DQuat::from_xyzw(0.0, 0.0, 0.0, 0.0), |a, b| a + b);
    let mean = sum.normalize();
    let squares: f64 = sound.iter().map(|q| mean.angle_between(same_side(q)).powi(2)).sum();
    Some((mean, (squares / sound.len() as f64).sqrt()))
}

/// Mean orientation of a person who stands still.
fn still(said: &[DQuat], name: &str, pose: &str) -> Result<DQuat, Error> {
    let Some((mean, spread_rad)) = mean(said) else {
        return Err(Error::new(format!("a sensor said nothing in {pose}")).at(name));
    };
    if !(spread_rad <= STILL_RAD) {
        return Err(Error::new(format!("a sensor moved in {pose}"))
            .at(name)
            .got(format!("{:.1} deg", spread_rad.to_degrees()))
            .allowed(format!("{:.1} deg, root mean square", STILL_RAD.to_degrees()))
            .remedy("stand still for three seconds and try again"));
    }
    Ok(mean)
}

/// Heading by the axis that was to point forward.
pub(super) fn by_strapping(standing: DQuat, forward: DVec3) -> Option<f64> {
    let forward = standing * forward.normalize_or_zero();
    (forward.x.hypot(forward.y) > LEVEL).then(|| -forward.y.atan2(forward.x))
}

/// Heading of the arms by their turn from N to T pose.
pub(super) fn by_t_pose(
    segment: Segment,
    standing: DQuat,
    spread: DQuat,
    name: &str,
    notes: &mut Vec<String>,
) -> Option<f64> {
    let side = match segment {
        Segment::LeftUpperArm | Segment::LeftForearm => 1.0,
        Segment::RightUpperArm | Segment::RightForearm => -1.0,
        _ => return None,
    };
    let turn = (spread * standing.inverse()).to_scaled_axis();
    let (angle, axis) = (turn.length(), turn.normalize_or_zero() * side);
    let off = (angle - core::f64::consts::FRAC_PI_2).abs();
    if !(off <= T_POSE_RAD && axis.z.abs() <= LEVEL) {
        notes.push(format!("{name}: the turn from N to T pose was not one; it was not used"));
        return None;
    }
    // Turning about +X takes the hanging left arm to the left.
    Some(-axis.y.atan2(axis.x))
}

/// Heading by the best of the movements that turn the segment about +Y, and its consistency.
pub(super) fn by_movement<'a>(
    segment: Segment,
    standing: DQuat,
    moved: impl Iterator<Item = (Movement, &'a [DQuat])>,
    name: &str,
    notes: &mut Vec<String>,
) -> Option<(f64, f64)> {
    let mut best: Option<(f64, f64)> = None;
    for (movement, said) in moved {
        let Some((_, sign)) = movement.turns().iter().find(|(turned, _)| *turned == segment) else {
            continue;
        };
        match axis_of(standing, said) {
            Ok((axis, consistency)) => {
                let axis = axis * *sign;
                let heading = core::f64::consts::FRAC_PI_2 - axis.y.atan2(axis.x);
                if best.is_none_or(|(_, least)| consistency < least) {
                    best = Some((wrap_rad(heading), consistency));
                }
            }
            Err(why) => notes.push(format!("{name}, {movement:?}: {why}; it was not used")),
        }
    }
    best
}

/// The axis that a sensor turned about, in its own world, pointing so that the turn from standing
/// to the far end is positive; and the second over the first principal component of its rate.
fn axis_of(standing: DQuat, said: &[DQuat]) -> Result<(DVec3, f64), String> {
    let mut spread = DMat3::ZERO;
    for pair in said.windows(2) {
        let step = pair[1] * pair[0].inverse();
        let step = if step.w < 0.0 { -step } else { step }.to_scaled_axis();
        if step.is_finite() {
            spread += DMat3::from_cols(step * step.x, step * step.y, step * step.z);
        }
    }
    let turn_of = |q: &DQuat| {
        let turn = *q * standing.inverse();
        if turn.w < 0.0 { -turn } else { turn }.to_scaled_axis()
    };
    let turns = said.iter().map(turn_of).filter(|turn| turn.is_finite());
    let furthest = turns.max_by(|a, b| a.length().total_cmp(&b.length())).unwrap_or(DVec3::ZERO);
    if !(furthest.length() >= LEAST_TURN_RAD) {
        return Err(format!("it turned by {:.0} deg only", furthest.length().to_degrees()));
    }
    let eigen = SymmetricEigen::new(Matrix3::from_column_slice(&spread.to_cols_array()));
    let mut order = [0, 1, 2];
    order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
    let [first, second] = [order[0], order[1]].map(|at| eigen.eigenvalues[at].max(0.0).sqrt());
    let consistency = second / first;
    if !(consistency < CONSISTENT) {
        return Err(format!("it turned about more than one axis (s2/s1 = {consistency:.2})"));
    }
    let axis = eigen.eigenvectors.column(order[0]);
    let axis = DVec3::new(axis[0], axis[1], axis[2]);
    if !(axis.z.abs() <= LEVEL) {
        return Err("the axis it turned about was not level".to_owned());
    }
    Ok((axis * axis.dot(furthest).signum(), consistency))
}

/// Name of a segment as a person says it.
#[must_use]
pub fn words(segment: Segment) -> String {
    let mut words = String::new();
    for letter in format!("{segment:?}").chars() {
        if letter.is_uppercase() && !words.is_empty() {
            words.push(' ');
        }
        words.extend(letter.to_lowercase());
    }
    words
}
