//! A person's poses on a robot's joints, one by one: limb by limb, and then so that the robot is not in itself and its
//! weight is over its feet.

use super::lost;
use crate::body::worn::limb::WornLimb;
use crate::body::{Segment, SegmentPose};
use crate::error::Error;
use crate::mocap::retarget::{Online, RobotModel};
use crate::retarget::adjust::{Adjustable, Adjuster, Lifts};
use crate::retarget::base::{Held, StandingSole};
use crate::robot::{Joint, Robot, RobotBody};
use glam::DVec3;

/// What of a robot's body follows.
pub struct FollowingBody {
    body: RobotBody,
    start_rad: Vec<f64>,
    limits_rad: Vec<(f64, f64)>,
    velocity_rad_s: Vec<f64>,
    free: Vec<bool>,
    stands: bool,
}

impl FollowingBody {
    /// Of a robot, if its file has a body, that follows the segments that are `worn`; `hangs` if it hangs on a stand.
    ///
    /// # Errors
    /// A body no tree can be made of.
    pub fn of(
        robot: &Robot,
        model: &RobotModel,
        worn: &[bool; 13],
        hangs: bool,
    ) -> Result<Option<Self>, Error> {
        let Some(body) = RobotBody::of(&robot.file)? else { return Ok(None) };
        let limits = |joint: &Joint| (joint.limits.lower_rad(), joint.limits.upper_rad());
        let mut free = vec![false; robot.joints.len()];
        for link in model.links.iter().filter(|link| worn[link.segment.index()]) {
            let chain = std::iter::successors(Some(link.joint), |at| model.joints[*at].parent);
            chain.for_each(|joint| free[joint] = true);
        }
        // Ankles have to give way even where nobody wears a sensor on a foot.
        for limb in WornLimb::ALL.into_iter().filter(|limb| limb.is_leg()) {
            let own = lost::joints(model, limb);
            if own.iter().zip(&free).any(|(own, free)| *own && *free) {
                own.iter().zip(&mut free).for_each(|(own, free)| *free |= own);
            }
        }
        let held = Held::of(&body, &StandingSole::all(&body), hangs);
        Ok(Some(Self {
            start_rad: robot.joints.iter().map(|joint| joint.initial_rad).collect(),
            limits_rad: robot.joints.iter().map(limits).collect(),
            velocity_rad_s: robot
                .joints
                .iter()
                .map(|joint| joint.limits.velocity_rad_s())
                .collect(),
            free,
            stands: held == Held::Standing,
            body,
        }))
    }

    /// What somebody should know before it follows: that it is taken to stand. `None` of one that need not.
    pub fn warning(&self) -> Option<&'static str> {
        self.stands.then_some(
            "the robot is taken to stand on its feet, and lifts one only once its weight is over the other; --hang if it \
             hangs on a stand",
        )
    }

    /// Who moves its poses one by one, from where its joints are.
    pub fn adjuster(&self, here_rad: &[f64]) -> Adjuster<'_> {
        let Self { body, start_rad, limits_rad, free, .. } = self;
        let of = Adjustable { body, start_rad, limits_rad, free };
        Adjuster::new(of, &self.velocity_rad_s, here_rad, self.stands)
    }
}

/// Puts poses on a robot's joints.
pub struct OntoRobot<'a> {
    online: Online<'a>,
    adjuster: Option<Adjuster<'a>>,
    /// The segment that the robot's base plays.
    base: Segment,
    /// How long it was on its way to the first pose after its goals had come near it, s.
    arriving_s: f64,
}

impl<'a> OntoRobot<'a> {
    /// With what fits limbs and, of a robot that has a body, what moves them all.
    pub fn new(model: &RobotModel, online: Online<'a>, adjuster: Option<Adjuster<'a>>) -> Self {
        let pelvis = model.base.iter().find(|segment| **segment == Segment::Pelvis);
        let base = pelvis.or(model.base.first()).copied().unwrap_or(Segment::Pelvis);
        Self { online, adjuster, base, arriving_s: 0.0 }
    }

    /// Angles by joint, rad, for the pose `dt_s` after the one before; slowly while the robot is on its way to the first.
    pub fn pose(&mut self, pose: &SegmentPose, dt_s: f64, approaching: bool) -> Vec<f64> {
        let angles_rad = self.online.pose(pose, dt_s);
        match &mut self.adjuster {
            None => angles_rad.to_vec(),
            Some(adjuster) => {
                let up = pose.orientation[self.base.index()].inverse() * DVec3::Z;
                let goes_on = !approaching && adjuster.is_arriving();
                self.arriving_s += if goes_on { dt_s } else { 0.0 };
                adjuster.next(angles_rad, up, dt_s, approaching)
            }
        }
    }

    /// True while the robot does not stand on both feet.
    pub fn is_stepping(&self) -> bool {
        self.adjuster.as_ref().is_some_and(Adjuster::is_stepping)
    }

    /// True while the robot is on its way to the first pose.
    pub fn is_arriving(&self) -> bool {
        self.adjuster.as_ref().is_some_and(Adjuster::is_arriving)
    }

    /// How long it was so after its goals had come near that pose, s.
    pub const fn arriving_s(&self) -> f64 {
        self.arriving_s
    }

    /// True while legs are not yet where the person has them.
    pub fn is_late(&self) -> bool {
        self.adjuster.as_ref().is_some_and(Adjuster::is_late)
    }

    /// How often feet were lifted; none of a robot that need not stand.
    pub fn lifts(&self) -> Option<Lifts> {
        self.adjuster.as_ref().and_then(Adjuster::lifts)
    }
}

/// What became of the feet, for a person.
pub fn note(lifts: Lifts) -> Option<String> {
    let Lifts { lifted, kept_down } = lifts;
    (kept_down > 0).then(|| {
        format!(
            "feet lifted: {lifted}; feet that the person had put down again before the weight was over the other one, and that \
             stayed on the floor: {kept_down}"
        )
    })
}
