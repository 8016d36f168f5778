//! A walk made of actionlets: the project's own sample motion.
//!
//! Each degree of freedom runs through the turning points of its curve over a stride, as half-sine
//! actionlets. The turning points follow the normative curves of level walking in Winter,
//! "Biomechanics and Motor Control of Human Gait", 2nd ed., 1991 (hip and knee flexed at heel
//! contact, a first small and a second large wave of the knee, ankle rocking through the stance
//! phase), adjusted so that feet hardly slide. The walk begins and ends at rest in N pose.

use glam::{DQuat, DVec3};

use crate::actionlet::{Sequence, Shape};
use crate::body::contact::root_on_ground;
use crate::body::{Dof, JointAngles, Proportions, SegmentPose};
use crate::error::Error;

/// A turning point of a curve: time in strides, angle in deg, and the place of the speed peak on
/// the way to the next turning point.
type Turn = (f64, f64, f64);

/// How one degree of freedom walks.
struct Part {
    dof: Dof,
    /// Turning points of a stride, times counted from heel contact of the left foot.
    stride: &'static [Turn],
    /// How much later than on the left this side's stride runs, in strides.
    later: f64,
    /// A turning point of the first step, time counted from the start of the walk.
    lead_in: Option<Turn>,
    /// A turning point of the last step, time counted back from the end of the walk.
    lead_out: Option<Turn>,
}

const HIP: [Turn; 2] = [(0.56, -16.0, 0.57), (0.92, 32.0, 0.48)];
const KNEE: [Turn; 4] =
    [(0.0, 8.0, 0.2), (0.13, 17.0, 0.62), (0.32, 10.0, 0.49), (0.76, 58.0, 0.56)];
const ANKLE: [Turn; 5] = [
    (0.01, 0.0, 0.56),
    (0.06, -1.0, 0.35),
    (0.48, 11.0, 0.8),
    (0.67, -10.0, 0.49),
    (0.86, 3.0, 0.24),
];
/// Arms swing against the leg of their own side.
const SHOULDER: [Turn; 2] = [(0.02, -20.0, 0.5), (0.52, 14.0, 0.5)];
const ELBOW: [Turn; 2] = [(0.06, 12.0, 0.5), (0.56, 32.0, 0.5)];
/// At left heel contact the left shoulder is back.
const TORSO: [Turn; 2] = [(0.02, 5.0, 0.5), (0.52, -5.0, 0.5)];

/// The left leg takes the first step, the right leg the last; both are lifted enough to clear the
/// ground, since half a step swings through lower than a whole one.
#[rustfmt::skip]
const PARTS: [Part; 11] = [
    part(Dof::LeftHipFlexion, &HIP, 0.0, None, None),
    part(Dof::LeftKneeFlexion, &KNEE, 0.0, Some((0.24, 26.0, 0.5)), Some((0.11, 2.0, 0.5))),
    part(Dof::LeftAnkleDorsiflexion, &ANKLE, 0.0, Some((0.13, 11.0, 0.5)), Some((0.11, 10.0, 0.5))),
    part(Dof::RightHipFlexion, &HIP, 0.5, None, Some((0.13, 15.0, 0.39))),
    part(Dof::RightKneeFlexion, &KNEE, 0.5, None, Some((0.20, 48.0, 0.57))),
    part(Dof::RightAnkleDorsiflexion, &ANKLE, 0.5, None, Some((0.17, 18.0, 0.5))),
    part(Dof::LeftShoulderFlexion, &SHOULDER, 0.0, None, None),
    part(Dof::RightShoulderFlexion, &SHOULDER, 0.5, None, None),
    part(Dof::LeftElbowFlexion, &ELBOW, 0.0, None, None),
    part(Dof::RightElbowFlexion, &ELBOW, 0.5, None, None),
    part(Dof::TorsoAxial, &TORSO, 0.0, None, None),
];

const fn part(
    dof: Dof,
    stride: &'static [Turn],
    later: f64,
    lead_in: Option<Turn>,
    lead_out: Option<Turn>,
) -> Part {
    Part { dof, stride, later, lead_in, lead_out }
}

/// Part of the left leg's stride at which the walk starts and ends: the left leg is about to swing
/// when it starts, the right one has just swung when it ends.
const START_PHASE: f64 = 0.5;
/// Turning points of the stride count from this many strides after the start of the walk ...
const FIRST_TURN: f64 = 0.28;
/// ... to this many before its end; between is time for the transitions from and to N pose.
const LAST_TURN: f64 = 0.22;

/// A pose of a synthesised motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BodySample {
    /// The 22 angles.
    pub angles: JointAngles,
    /// Root position in the world, m.
    pub root_m: DVec3,
    /// Orientation of the pelvis in the world.
    pub root_orientation: DQuat,
}

impl BodySample {
    /// The same as segment orientations.
    #[must_use]
    pub fn to_pose(&self) -> SegmentPose {
        self.angles.to_pose(self.root_m, self.root_orientation)
    }
}

/// What kind of walk.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Walk {
    /// Time of one stride (two steps), s: 0.5 to 5.
    pub stride_s: f64,
    /// Strides from start to end: 1 to 1,000.
    pub strides: u32,
    /// Poses per second: 1 to 10,000.
    pub rate_hz: f64,
}

impl Default for Walk {
    fn default() -> Self {
        Self { stride_s: 1.2, strides: 4, rate_hz: 120.0 }
    }
}

impl Walk {
    /// Walks straight ahead (+X) from above the origin, on the ground z = 0.
    ///
    /// # Errors
    /// If an option is out of the range given with it.
    pub fn synthesise(&self, body: &Proportions) -> Result<Vec<BodySample>, Error> {
        self.check()?;
        let curves = PARTS
            .iter()
            .map(|part| Ok((part.dof, self.curve(part)?)))
            .collect::<Result<Vec<_>, Error>>()?;
        let samples = (f64::from(self.strides) * self.stride_s * self.rate_hz).ceil() as usize;
        let poses: Vec<(JointAngles, DQuat)> = (0..=samples)
            .map(|sample| {
                let mut angles = JointAngles::default();
                for (dof, curve) in &curves {
                    angles[*dof] = curve.at(sample as f64 / self.rate_hz).position_rad;
                }
                (angles, DQuat::IDENTITY)
            })
            .collect();
        let roots_m = root_on_ground(body, &poses);
        let samples = poses.into_iter().zip(roots_m).map(|((angles, root_orientation), root_m)| {
            BodySample { angles, root_m, root_orientation }
        });
        Ok(samples.collect())
    }

    fn check(&self) -> Result<(), Error> {
        let asked = [
            ("stride", self.stride_s, 0.5..=5.0, "s"),
            ("number of strides", f64::from(self.strides), 1.0..=1000.0, "strides"),
            ("rate", self.rate_hz, 1.0..=10_000.0, "Hz"),
        ];
        for (what, value, range, unit) in asked {
            if !range.contains(&value) {
                return Err(Error::new(format!("the {what} of a walk is out of range"))
                    .got(format!("{value} {unit}"))
                    .allowed(format!("{} to {} {unit}", range.start(), range.end())));
            }
        }
        Ok(())
    }

    /// From N pose through the turning points of a degree of freedom and back to N pose.
    fn curve(&self, part: &Part) -> Result<Sequence, Error> {
        let strides = f64::from(self.strides);
        let mut turns = Vec::new();
        turns.extend(part.lead_in);
        // Two strides more than asked: a side may begin anywhere in its stride.
        for stride in 0..self.strides + 2 {
            for (phase, angle_deg, peak_at) in part.stride {
                let at = f64::from(stride) + phase - part.later - START_PHASE;
                if (FIRST_TURN..=strides - LAST_TURN).contains(&at) {
                    turns.push((at, *angle_deg, *peak_at));
                }
            }
        }
        turns.extend(
            part.lead_out.map(|(before, angle, peak_at)| (strides - before, angle, peak_at)),
        );
        turns.push((strides, 0.0, 0.5));
        let mut curve = Sequence::starting_at(0.0, 0.0)?;
        let mut shape = Shape::default();
        for (at, angle_deg, next_peak_at) in turns {
            let duration_s = at * self.stride_s - curve.end_s();
            curve = curve.then(duration_s, angle_deg.to_radians(), shape)?;
            shape = Shape::half_sine(next_peak_at)?;
        }
        Ok(curve)
    }
}

#[cfg(test)]
mod tests;
