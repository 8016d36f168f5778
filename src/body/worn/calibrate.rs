//! How sensors sit on a body, from poses and movements a person can do.
//!
//! N pose: every segment is upright and faces forward, so the tilt of each sensor on its segment
//! follows from gravity. What is left is one angle about the vertical per sensor, which no single
//! pose shows. It is told, best first,
//!
//! 1. by a movement: bowing, sitting down, bending knees and elbows lean segments forward or back.
//!    What they lean about (principal components) is the body's Y axis;
//! 2. by a second pose, for arms: from N to T pose they turn about the body's X axis;
//! 3. by all that was done, where nobody moved as asked: legs of whoever sits down or walks lean
//!    forward and back more than to the sides;
//! 4. by how the sensor was strapped on: the axis of it that was to point forward.
//!
//! How a segment leans is where the sensor has up, and not how fast it turns: flesh twists a sensor
//! about the limb more and faster than anybody bends a knee, and whoever turns round leans nowhere.
//!
//! Whoever is calibrated faces the same way throughout; that way is +X of the world.

use crate::body::Segment;
use crate::error::Error;
use crate::units::wrap_rad;
use glam::{DQuat, DVec2, DVec3};
use nalgebra::{Matrix2, SymmetricEigen, Vector2};

/// A person who stands still moves less than this, rad, root mean square.
pub(super) const STILL_RAD: f64 = 0.05;
/// A movement is about one axis if the second principal component of how a sensor leaned is below this
/// share of the first.
pub const CONSISTENT: f64 = 0.1;
/// The same of all that somebody did who was asked for nothing.
const LEANING: f64 = 0.3;
/// It counts as often as a sensor leans otherwise by this, rad.
const NEW_RAD: f64 = 0.05;
/// And a strap is not believed to be off by more than this, rad.
const STRAPPED_RAD: f64 = core::f64::consts::FRAC_PI_3;
/// Who leans this much further one way than the other shows which way is forward.
const SKEWED: f64 = 0.3;
/// A movement leans a segment at least this far, rad.
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
    /// How it leaned while its wearer did what they liked.
    Leaning,
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
            Self::Leaning => "leaning",
            Self::Strapping => "strapping",
        }
    }

    /// What a word means.
    #[must_use]
    pub fn from_word(word: &str) -> Option<Self> {
        let all = [Self::Movement, Self::TPose, Self::Leaning, Self::Strapping];
        all.into_iter().find(|by| by.word() == word)
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
    /// Second over first principal component of how it leaned.
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
    calibrate_by_all(sensors, n_pose, t_pose, moves, None)
}

/// The same with all that sensors said while the person did `at_will`, evenly sampled: it tells headings of legs
/// where no movement does.
///
/// # Errors
/// As of [`calibrate`].
pub fn calibrate_by_all(
    sensors: &[WornSensor],
    n_pose: &[Vec<DQuat>],
    t_pose: Option<&[Vec<DQuat>]>,
    moves: &[Moved],
    at_will: Option<&[Vec<DQuat>]>,
) -> Result<Calibration, Error> {
    let count = sensors.len();
    let fits = |lists: &[Vec<DQuat>]| lists.len() == count;
    let moves_fit = moves.iter().all(|moved| fits(&moved.orientation));
    if !(fits(n_pose) && t_pose.is_none_or(fits) && at_will.is_none_or(fits) && moves_fit) {
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
        let found = found.or_else(|| {
            let (heading, consistency) =
                by_leaning(sensor.segment, standing, &at_will?[at], strapped)?;
            Some((heading, HeadingBy::Leaning, Some(consistency)))
        });
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
        match forward_and_back(&ups(standing, said), CONSISTENT) {
            Ok(leaning) => {
                let heading = leaning.heading_rad(sign * leaning.mean);
                if best.is_none_or(|(_, least)| leaning.consistency < least) {
                    best = Some((heading, leaning.consistency));
                }
            }
            Err(why) => notes.push(format!("{name}, {movement:?}: {why}; it was not used")),
        }
    }
    best
}

/// Heading of a leg's segment by how it leaned while somebody did what they liked, and its consistency. Which of the two
/// ways is forward tells the strap, if anybody said how that was.
fn by_leaning(
    segment: Segment,
    standing: DQuat,
    said: &[DQuat],
    strapped: Option<f64>,
) -> Option<(f64, f64)> {
    // Thighs are raised forward, shanks and feet trail behind.
    let sign = match segment {
        Segment::LeftThigh | Segment::RightThigh => -1.0,
        Segment::LeftShank | Segment::RightShank => 1.0,
        Segment::LeftFoot | Segment::RightFoot => 1.0,
        _ => return None,
    };
    // Whoever sits for an hour shows no more by it than whoever sits down.
    let mut new: Vec<DVec3> = Vec::new();
    for up in ups(standing, said) {
        if new.last().is_none_or(|last| up.angle_between(*last) > NEW_RAD) {
            new.push(up);
        }
    }
    let leaning = forward_and_back(&new, LEANING).ok()?;
    let heading_rad = match strapped {
        Some(strapped) => {
            let off = |heading_rad: &f64| wrap_rad(heading_rad - strapped).abs();
            let ways = [1.0, -1.0].map(|way| leaning.heading_rad(way));
            ways.into_iter().find(|heading_rad| off(heading_rad) <= STRAPPED_RAD)?
        }
        None if leaning.skew.abs() > SKEWED => leaning.heading_rad(sign * leaning.skew),
        None => return None,
    };
    Some((heading_rad, leaning.consistency))
}

/// Where up is, in N pose's axes, of a sensor that has leaned since.
fn ups(standing: DQuat, said: &[DQuat]) -> Vec<DVec3> {
    let ups = said.iter().map(|q| standing * (q.inverse() * DVec3::Z));
    ups.filter(|up| up.is_finite()).collect()
}

/// How a sensor leaned.
struct Leaning {
    /// What it leaned about most, level, in the sensor's own world as it was in N pose.
    axis: DVec2,
    /// How far to the sides of that, over how far about it.
    consistency: f64,
    /// Mean about the axis.
    mean: f64,
    /// How much further one way than the other, -1 to 1.
    skew: f64,
}

impl Leaning {
    /// Heading if the axis, or the other way if `way` is negative, is the body's Y.
    fn heading_rad(&self, way: f64) -> f64 {
        let axis = self.axis * way.signum();
        wrap_rad(core::f64::consts::FRAC_PI_2 - axis.y.atan2(axis.x))
    }
}

/// What a sensor leaned about, if it is one axis: to the sides less than `most` of how far it leaned about that.
fn forward_and_back(ups: &[DVec3], most: f64) -> Result<Leaning, String> {
    let furthest_rad = ups.iter().map(|up| up.z.clamp(-1.0, 1.0).acos()).fold(0.0, f64::max);
    if !(furthest_rad >= LEAST_TURN_RAD) {
        return Err(format!("it leaned by {:.0} deg only", furthest_rad.to_degrees()));
    }
    // A lean of an angle is its sine long.
    let leans = || ups.iter().map(|up| DVec2::new(up.y, -up.x));
    let spread = leans().fold(Matrix2::zeros(), |sum, lean| {
        let lean = Vector2::new(lean.x, lean.y);
        sum + lean * lean.transpose()
    });
    let eigen = SymmetricEigen::new(spread);
    let (first, second) = if eigen.eigenvalues[0] > eigen.eigenvalues[1] { (0, 1) } else { (1, 0) };
    let [along, aside] = [first, second].map(|at| eigen.eigenvalues[at].max(0.0).sqrt());
    let consistency = aside / along;
    if !(consistency < most) {
        return Err(format!("it leaned about more than one axis (s2/s1 = {consistency:.2})"));
    }
    let axis = eigen.eigenvectors.column(first);
    let axis = DVec2::new(axis[0], axis[1]);
    let mean = leans().map(|lean| lean.dot(axis)).sum();
    let cubes = |of: fn(f64) -> f64| leans().map(|lean| of(lean.dot(axis)).powi(3)).sum::<f64>();
    let skew = cubes(|lean| lean) / cubes(f64::abs);
    Ok(Leaning { axis, consistency, mean, skew })
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
