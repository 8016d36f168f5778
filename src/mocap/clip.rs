//! A captured motion in the world: metres, Z up, pose by pose.
//!
//! A file does not say its unit nor which way is up. Both are found from the person in it:
//!
//! * Unit: the one of metre, centimetre, millimetre, inch and CMU's 1/0.45 inch that makes a
//!   plausible stature of the legs, thigh and shank being 0.245 + 0.246 of stature (Drillis &
//!   Contini 1966, in Winter, "Biomechanics and Motor Control of Human Movement", fig. 4.1).
//! * Up: the axis that the body points along over the whole motion, weighed against how little
//!   the lowest point of the body moves along it (the floor) and the pose drawn by the OFFSETs.
//! * Leading rest poses, which some converters put before the motion, are dropped.

use crate::body::Segment;
use crate::error::{Error, ErrorKind, counted};
use crate::mocap::bones::Bones;
use crate::mocap::bvh::Bvh;
use crate::mocap::landmarks::Landmarks;
use crate::mocap::mapping::{ARMS, LEGS, Mapping, MappingFile};
use crate::mocap::skeleton::{Placed, Skeleton};
use glam::{DQuat, DVec3};

/// Poses looked at to find unit and axes.
const SAMPLES: usize = 300;
/// Thigh plus shank, in statures.
const LEG_OF_STATURE: f64 = 0.245 + 0.246;
/// Upper arm plus forearm, in statures; for a body without legs.
const ARM_OF_STATURE: f64 = 0.186 + 0.146;
/// Statures taken for real, m: from a child of three to the tallest common adult. Wider, and inch
/// and CMU unit, 2.22 apart, could not be told from one another.
const PLAUSIBLE_STATURE_M: std::ops::RangeInclusive<f64> = 0.9..=2.1;
/// Stature given to a body of no plausible unit, and preferred between two plausible ones, m.
const USUAL_STATURE_M: f64 = 1.7;
const UNITS: [(&str, f64); 5] = [
    ("metre", 1.0),
    ("centimetre", 0.01),
    ("millimetre", 0.001),
    ("inch", 0.0254),
    ("CMU unit of 1/0.45 inch", 0.0254 / 0.45),
];
const AXES: [(&str, DVec3); 6] = [
    ("+X", DVec3::X),
    ("+Y", DVec3::Y),
    ("+Z", DVec3::Z),
    ("-X", DVec3::NEG_X),
    ("-Y", DVec3::NEG_Y),
    ("-Z", DVec3::NEG_Z),
];

/// A skeleton in motion, understood.
#[derive(Clone, Debug)]
pub struct Clip {
    bvh: Bvh,
    skeleton: Skeleton,
    mapping: Mapping,
    first: usize,
    to_world: DQuat,
    metres_per_unit: f64,
    rest: Option<Placed>,
    stature_m: f64,
    notes: Vec<String>,
}

impl Clip {
    /// Finds out what a file does not say.
    ///
    /// # Errors
    /// If the skeleton is no person's, or there are fewer than two poses.
    pub fn new(bvh: Bvh, file: Option<&MappingFile>) -> Result<Self, Error> {
        let mapping = Mapping::find(&bvh, file)?;
        if bvh.pose_count() < 2 {
            return Err(Error::of(ErrorKind::Malformed, "there is no motion in the file")
                .got(format!("{} pose", bvh.pose_count()))
                .allowed("at least 2 poses"));
        }
        let skeleton = Skeleton::new(&bvh);
        let notes = skeleton.notes().to_vec();
        let mut clip = Self {
            bvh,
            skeleton,
            mapping,
            first: 0,
            to_world: DQuat::IDENTITY,
            metres_per_unit: 1.0,
            rest: None,
            stature_m: USUAL_STATURE_M,
            notes,
        };
        clip.find_unit()?;
        clip.drop_rest_poses();
        clip.find_up();
        clip.check_sides();
        clip.notes.push(clip.mapping.describe(&clip.bvh));
        Ok(clip)
    }

    /// What was found out, a line each.
    #[must_use]
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// Puts what was found out about the file before what was found out about the person.
    pub fn note_first(&mut self, notes: Vec<String>) {
        self.notes.splice(0..0, notes);
    }

    /// The bones of the skeleton.
    #[must_use]
    pub fn bones(&self) -> Bones {
        Bones::of(&self.bvh.joints)
    }

    /// Which joint is which segment.
    #[must_use]
    pub fn mapping(&self) -> &Mapping {
        &self.mapping
    }

    /// Stature estimated from the legs, m.
    #[must_use]
    pub fn stature_m(&self) -> f64 {
        self.stature_m
    }

    /// Length of a file unit, m.
    #[must_use]
    pub fn metres_per_unit(&self) -> f64 {
        self.metres_per_unit
    }

    /// The file's up axis, as a unit vector of the file.
    #[must_use]
    pub fn file_up(&self) -> DVec3 {
        self.to_world.inverse() * DVec3::Z
    }

    /// Poses per second.
    #[must_use]
    pub fn rate_hz(&self) -> f64 {
        1.0 / self.bvh.time_step_s
    }

    /// Number of poses without dropped rest poses.
    #[must_use]
    pub fn pose_count(&self) -> usize {
        self.bvh.pose_count() - self.first
    }

    /// Rest poses dropped from the start.
    #[must_use]
    pub fn dropped(&self) -> usize {
        self.first
    }

    /// Places all joints of a pose in the world, m. `index` must be below [`Self::pose_count`].
    pub fn place(&self, index: usize, placed: &mut Placed) {
        self.skeleton.place(self.bvh.pose(self.first + index), placed);
        self.carry_to_world(placed);
    }

    /// The pose models are drawn in, in the world, if the file has one to be trusted: a rest pose
    /// dropped from the start, or the OFFSETs alone where these draw a person standing straight.
    /// Its heading is its own.
    #[must_use]
    pub fn rest(&self) -> Option<Placed> {
        if let Some(rest) = &self.rest {
            let mut rest = rest.clone();
            self.carry_to_world(&mut rest);
            return Some(rest);
        }
        let (mut zero, up) = self.zero_pose()?;
        let turn = DQuat::from_rotation_arc(up, DVec3::Z);
        for (rotation, position) in zero.rotation.iter_mut().zip(&mut zero.position) {
            *rotation = turn;
            *position = turn * *position * self.metres_per_unit;
        }
        Some(zero)
    }

    /// A view of a pose placed in the world.
    #[must_use]
    pub fn landmarks<'a>(&'a self, placed: &'a Placed) -> Landmarks<'a> {
        Landmarks { mapping: &self.mapping, placed, unit: self.metres_per_unit }
    }

    /// At most `limit` poses spread evenly over the motion.
    pub fn samples(&self, limit: usize) -> impl Iterator<Item = usize> + use<> {
        let count = self.pose_count();
        (0..count).step_by(count.div_ceil(limit).max(1))
    }

    fn carry_to_world(&self, placed: &mut Placed) {
        for (rotation, position) in placed.rotation.iter_mut().zip(&mut placed.position) {
            *rotation = self.to_world * *rotation;
            *position = self.to_world * *position * self.metres_per_unit;
        }
    }

    /// The skeleton drawn by its OFFSETs in file axes and units, with its own up axis, if it
    /// stands as models do.
    fn zero_pose(&self) -> Option<(Placed, DVec3)> {
        let mut zero = Placed::default();
        self.skeleton.place_at_zero(&mut zero);
        let view = Landmarks { mapping: &self.mapping, placed: &zero, unit: 1.0 };
        let trunk = view.trunk()?;
        let by_trunk = |a: &DVec3, b: &DVec3| a.dot(trunk).total_cmp(&b.dot(trunk));
        let up = AXES.map(|(_, axis)| axis).into_iter().max_by(by_trunk)?;
        view.is_rest_like(up).then_some((zero, up))
    }

    fn find_unit(&mut self) -> Result<(), Error> {
        let mut placed = Placed::default();
        let mut total = 0.0;
        let mut count = 0;
        for index in self.samples(SAMPLES) {
            self.skeleton.place(self.bvh.pose(index), &mut placed);
            let view = Landmarks { mapping: &self.mapping, placed: &placed, unit: 1.0 };
            let length = |segments: [Segment; 2]| {
                Some(view.bone(segments[0])?.length() + view.bone(segments[1])?.length())
            };
            for side in 0..2 {
                let leg = length([LEGS[side][0], LEGS[side][1]]).map(|leg| leg / LEG_OF_STATURE);
                let arm = || length(ARMS[side]).map(|arm| arm / ARM_OF_STATURE);
                if let Some(stature) = leg.or_else(arm) {
                    total += stature;
                    count += 1;
                }
            }
        }
        let stature = total / f64::from(count);
        if stature.is_nan() || stature <= 1e-6 {
            return Err(Error::new("the limbs of the skeleton have no length")
                .remedy("check the OFFSET lines, or name other joints in a mapping file"));
        }
        let unusual = |unit: f64| (stature * unit / USUAL_STATURE_M).ln().abs();
        let plausible =
            UNITS.iter().filter(|(_, unit)| PLAUSIBLE_STATURE_M.contains(&(stature * unit)));
        match plausible.min_by(|a, b| unusual(a.1).total_cmp(&unusual(b.1))) {
            Some((name, unit)) => {
                self.metres_per_unit = *unit;
                self.stature_m = stature * unit;
                let stature_m = self.stature_m;
                self.notes.push(format!("unit: {name} (stature about {stature_m:.2} m)"));
            }
            None => {
                self.metres_per_unit = USUAL_STATURE_M / stature;
                self.notes.push(format!(
                    "unit: unknown (stature {stature:.3} units); scaled to {USUAL_STATURE_M} m"
                ));
            }
        }
        Ok(())
    }

    /// Drops leading poses that look like a model's rest pose and are followed by a jump: faster
    /// than a body can turn, or far larger than the steps after it. Resampling may have smeared
    /// the jump over some poses, which go with it.
    fn drop_rest_poses(&mut self) {
        const LONGEST: usize = 30;
        const AFTER: usize = 10;
        const STILL_RAD: f64 = 0.002;
        const FASTEST_RAD_S: f64 = 12.0;
        let count = self.bvh.pose_count().min(LONGEST + AFTER + 1);
        let mut placed = vec![Placed::default(); count];
        for (index, placed) in placed.iter_mut().enumerate() {
            self.skeleton.place(self.bvh.pose(index), placed);
        }
        let steps: Vec<f64> =
            placed.windows(2).map(|pair| self.turn_between(&pair[0], &pair[1])).collect();
        let run = steps.iter().take_while(|step| **step < STILL_RAD).count();
        let mut after: Vec<f64> = steps.iter().skip(run + 1).take(AFTER).copied().collect();
        let Some(jump) = steps.get(run).filter(|_| run <= LONGEST && after.len() >= 2) else {
            return;
        };
        let fastest = FASTEST_RAD_S * self.bvh.time_step_s;
        let smeared = after.iter().take_while(|step| **step > fastest).count();
        after.sort_by(f64::total_cmp);
        let usual = after[after.len() / 2];
        if !(*jump > f64::max(0.15, fastest) || *jump > f64::max(0.3, 4.0 * usual)) {
            return;
        }
        let view = Landmarks { mapping: &self.mapping, placed: &placed[0], unit: 1.0 };
        if AXES.iter().any(|(_, up)| view.is_rest_like(*up)) {
            self.first = run + 1 + smeared;
            self.rest = Some(placed.swap_remove(0));
            let poses = counted(self.first, "rest pose");
            self.notes.push(format!("{poses} at the start dropped"));
        }
    }

    /// Root mean square angle, rad, by which the segments turn from one pose to another.
    fn turn_between(&self, from: &Placed, to: &Placed) -> f64 {
        let carriers = Segment::ALL.iter().filter_map(|s| Some(self.mapping.part(*s)?.carrier));
        let squares: Vec<f64> =
            carriers.map(|at| from.rotation[at].angle_between(to.rotation[at]).powi(2)).collect();
        (squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt()
    }

    fn find_up(&mut self) {
        let size = self.stature_m / self.metres_per_unit;
        let mut lowest = [const { Vec::<f64>::new() }; 6];
        let mut axis_sum = DVec3::ZERO;
        let mut seen = 0.0;
        let mut placed = Placed::default();
        for index in self.samples(SAMPLES) {
            self.skeleton.place(self.bvh.pose(self.first + index), &mut placed);
            let view = Landmarks { mapping: &self.mapping, placed: &placed, unit: 1.0 };
            if let Some(axis) = view.body_axis() {
                axis_sum += axis;
                seen += 1.0;
            }
            for (lowest, (_, up)) in lowest.iter_mut().zip(AXES) {
                let heights = placed.position.iter().map(|position| position.dot(up));
                lowest.push(heights.fold(f64::INFINITY, f64::min));
            }
        }
        let mean_axis = axis_sum / f64::max(seen, 1.0);
        let drawn_up = self.zero_pose().map(|(_, up)| up);
        let mut scores = AXES.map(|(_, up)| up.dot(mean_axis));
        for (at, (_, up)) in AXES.iter().enumerate() {
            scores[at] -= 2.0 * (spread(&lowest[at]) / size).min(0.5);
            if drawn_up == Some(*up) {
                scores[at] += 0.5;
            }
        }
        let best = (0..6).max_by(|a, b| scores[*a].total_cmp(&scores[*b])).unwrap_or(1);
        let (name, up) = AXES[best];
        self.to_world = DQuat::from_rotation_arc(up, DVec3::Z);
        self.notes.push(format!("up: {name}"));
    }

    /// Toes point forward, so left and right can be checked, or found where names do not tell.
    fn check_sides(&mut self) {
        let mut placed = Placed::default();
        let (mut forward, mut arms_with_legs, mut seen) = (0.0, 0.0, 0.0);
        for index in self.samples(SAMPLES) {
            self.place(index, &mut placed);
            let view = self.landmarks(&placed);
            let (Some(across), Some(trunk)) = (view.hip_line(), view.trunk()) else { continue };
            let toes = LEGS.iter().filter_map(|leg| view.direction(leg[2])).sum::<DVec3>();
            forward += toes.normalize_or_zero().dot(across.cross(trunk).normalize_or_zero());
            arms_with_legs += view.shoulder_line().map_or(0.0, |shoulders| shoulders.dot(across));
            seen += 1.0;
        }
        if !self.mapping.sides_are_named && arms_with_legs < 0.0 {
            self.mapping.swap_arms();
        }
        if forward < -0.3 * seen {
            self.mapping.swap_legs();
            self.mapping.swap_arms();
            if self.mapping.sides_are_named {
                self.notes.push(
                    "the toes point backwards if the names of the sides are right: the file is \
                     mirrored; left and right are taken by the toes"
                        .to_owned(),
                );
            }
        }
    }
}

/// Standard deviation.
fn spread(values: &[f64]) -> f64 {
    let count = values.len().max(1) as f64;
    let mean = values.iter().sum::<f64>() / count;
    (values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / count).sqrt()
}
