//! Actions made for what is asked of them: a reach to a point, a kick at a speed, a step in a direction.
//!
//! Other actions are files that say their angles. Here the angles follow from where a hand or a foot is to be: poses are
//! found by least squares (`posing`), and joined by actionlets, from rest to rest (`course`). A leg that stands
//! alone keeps its angles, or lets its hip, knee and ankle go together so that its foot stays flat; while both feet
//! stand, the actionlets of legs are so timed that neither slides (`settle`). Hops and jumps in a direction are the shipped
//! ones with their seams moved until they come down there (`travel`). A step and a reach may overlap (`overlap`).
//!
//! Places count from the point of the floor below the centre of mass of the body as it stands at first: X forward, Y left,
//! Z up. Directions count from straight ahead to the right, as those of the Human Motion Database do (Guerra-Filho and
//! Biswas, "The human motion database: A cognitive and parametric sampling of human motion", Image and Vision Computing
//! 30, 2012).

mod course;
mod damped;
mod kick;
mod lift;
mod overlap;
mod posing;
mod reach;
mod settle;
mod sit;
mod step;
mod travel;

use glam::DVec3;

use crate::action::Motion;
use crate::action::feet::{FootingBounds, Missed};
use crate::body::mass::{centre_of_mass_m, segment_masses};
use crate::body::{End, JointAngles, Proportions};
use crate::error::Error;

use overlap::First;

pub use posing::Side;
pub use step::Steps;

/// What is to be done.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Ask {
    /// The right hand's fingertip goes to a point, stays a moment and comes back; with a greatest speed on the way
    /// there, m/s, if somebody says one.
    Reach {
        /// Where.
        target_m: DVec3,
        /// How fast.
        speed_m_s: Option<f64>,
    },
    /// The right foot's tip goes through a point, at a speed there, m/s.
    Kick {
        /// Where.
        target_m: DVec3,
        /// How fast.
        speed_m_s: f64,
    },
    /// A step, and the other foot beside it.
    Step {
        /// Which way, rad to the right of straight ahead.
        direction_rad: f64,
        /// How far, m.
        length_m: f64,
    },
    /// Down onto a seat of this height, m, and up again.
    SitAndStand {
        /// Height of the seat.
        height_m: f64,
    },
    /// Something lifted with both hands from near the floor to the waist.
    Lift {
        /// What it weighs, kg.
        load_kg: f64,
    },
    /// Walking, so many rad to the right of where it faces.
    Walk {
        /// Which way.
        direction_rad: f64,
    },
    /// Jogging.
    Jog {
        /// Which way.
        direction_rad: f64,
    },
    /// A step, and a reach that begins while its foot swings.
    StepThenReach {
        /// Which way the step goes.
        direction_rad: f64,
    },
    /// A reach, and a step whose foot swings while the hand is on its way back.
    ReachThenStep {
        /// Which way the step goes.
        direction_rad: f64,
    },
    /// A hop on both feet.
    Hop {
        /// Which way.
        direction_rad: f64,
        /// How far, m.
        length_m: f64,
    },
    /// A jump with a swing of the arms.
    Jump {
        /// Which way.
        direction_rad: f64,
        /// How far, m.
        length_m: f64,
    },
}

/// Where something of the body is to be at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mark {
    /// Of what.
    pub of: Marked,
    /// When, s.
    pub at_s: f64,
    /// Where, m; from the middle of the feet at first on the floor.
    pub at_m: DVec3,
}

/// What of a body is looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Marked {
    /// An end of the body.
    End(End),
    /// The middle of the sole of a foot.
    Foot(Side),
    /// The middle of both feet.
    Feet,
    /// The middle between the hip joints, its height alone.
    RootHeight,
}

/// A motion that was asked for.
#[derive(Clone, Debug)]
pub struct Made {
    /// It.
    pub motion: Motion,
    /// Where it is to be when.
    pub marks: Vec<Mark>,
    /// What it carries in its hands, kg, from when on, s.
    pub load: Option<(f64, f64)>,
    /// When it sits on something, s: from, to.
    pub seated_s: Option<(f64, f64)>,
    /// The speed that was asked for in the end: of the hand or the foot, m/s.
    pub speed_m_s: Option<f64>,
    /// From when to when each of the actions that it is made of is done, s; empty of one action.
    pub parts_s: Vec<(f64, f64)>,
}

impl Made {
    /// A motion that is to be somewhere at some times, and carries nothing.
    #[must_use]
    pub const fn of(motion: Motion, marks: Vec<Mark>) -> Self {
        Self { motion, marks, load: None, seated_s: None, speed_m_s: None, parts_s: Vec::new() }
    }

    /// What feet and floor miss of what they are held to.
    ///
    /// # Errors
    /// As [`Motion::poses`].
    pub fn missed(&self, body: &Proportions) -> Result<Vec<Missed>, Error> {
        FootingBounds::default().missed(&self.motion, body)
    }
}

/// A body that does what is asked. What several asks share is found once.
#[derive(Debug)]
pub struct Performer {
    body: Proportions,
    steps: Option<Steps>,
}

impl Performer {
    /// Of a body.
    #[must_use]
    pub const fn of(body: Proportions) -> Self {
        Self { body, steps: None }
    }

    /// The body.
    #[must_use]
    pub const fn body(&self) -> &Proportions {
        &self.body
    }

    /// Does what is asked.
    ///
    /// # Errors
    /// What a body cannot do; which point it comes near to is not judged here, but by the marks.
    pub fn make(&mut self, ask: &Ask) -> Result<Made, Error> {
        let body = self.body;
        match *ask {
            Ask::Reach { target_m, speed_m_s } => reach::made(&body, target_m, speed_m_s),
            Ask::Kick { target_m, speed_m_s } => kick::made(self.steps()?, target_m, speed_m_s),
            Ask::Step { direction_rad, length_m } => {
                self.steps()?.made(&[(direction_rad, length_m)])
            }
            Ask::SitAndStand { height_m } => sit::made(&body, height_m),
            Ask::Lift { load_kg } => lift::made(&body, load_kg),
            Ask::Walk { direction_rad } => travel::walk(self, direction_rad),
            Ask::Jog { direction_rad } => travel::jog(self, direction_rad),
            Ask::StepThenReach { direction_rad } => {
                overlap::made(self.steps()?, First::Step, direction_rad)
            }
            Ask::ReachThenStep { direction_rad } => {
                overlap::made(self.steps()?, First::Reach, direction_rad)
            }
            Ask::Hop { direction_rad, length_m } => travel::hop(self, direction_rad, length_m),
            Ask::Jump { direction_rad, length_m } => travel::jump(self, direction_rad, length_m),
        }
    }

    fn steps(&mut self) -> Result<&Steps, Error> {
        if self.steps.is_none() {
            self.steps = Some(Steps::of(self.body)?);
        }
        self.steps.as_ref().ok_or_else(|| Error::new("a body has no steps"))
    }
}

/// From the middle between the hip joints to the point of the floor below the centre of mass, of a body that stands
/// still.
#[must_use]
pub fn origin_m(body: &Proportions) -> DVec3 {
    let upright = JointAngles::default().to_pose(DVec3::ZERO, glam::DQuat::IDENTITY);
    centre_of_mass_m(body, &segment_masses(body), &upright).with_z(0.0)
}

/// A direction as a vector over the floor.
fn way(direction_rad: f64) -> DVec3 {
    DVec3::new(direction_rad.cos(), -direction_rad.sin(), 0.0)
}
