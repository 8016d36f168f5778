//! The joints of who leads, and which of them lead which joints of who follows.

use super::doubt::{Doubt, Trust};
use crate::bus::AskError;
use crate::capture::Counts;
use crate::control::plausible::Believed;
use crate::error::{Error, ErrorKind};
use crate::port::Clock;
use crate::rig::Connection;
use crate::robot::{Joint, LinkError, Robot};
use crate::time::Duration;
use gaitway_profiles::Role;
use std::sync::Arc;

/// Budget of one look at all joints.
const LOOK: Duration = Duration::from_millis(50);
/// Budget of one question before anything moves.
const QUESTION: Duration = Duration::from_millis(500);

/// A joint that leads another.
#[derive(Clone, Debug, PartialEq)]
struct Pair {
    /// Index of the leader's.
    leads: usize,
    /// Index of the follower's.
    follows: usize,
    /// Range of the follower's, rad.
    range_rad: [f64; 2],
    /// Range of the leader's, if the share of it counts and not the angle, rad.
    share_of_rad: Option<[f64; 2]>,
}

impl Pair {
    /// Where the follower's joint is to be, inside its range, while the leader's is here, rad.
    fn goal_rad(&self, leader_rad: f64) -> f64 {
        let [lower_rad, upper_rad] = self.range_rad;
        let wanted_rad = match self.share_of_rad {
            None => leader_rad,
            Some([from_rad, to_rad]) => {
                let share = (leader_rad - from_rad) / (to_rad - from_rad);
                lower_rad + share * (upper_rad - lower_rad)
            }
        };
        wanted_rad.clamp(lower_rad, upper_rad)
    }
}

/// Which joint leads which.
#[derive(Clone, Debug, PartialEq)]
pub struct Pairs {
    joints: Vec<Pair>,
    unled: Vec<String>,
    unfollowed: Vec<String>,
}

impl Pairs {
    /// Joints of the same name. Those of `by_range` are led by the share of the leader's range, the others by its angle.
    ///
    /// # Errors
    /// Two robots that have none in common, a joint `by_range` that both have not.
    pub fn of(leader: &Robot, robot: &Robot, by_range: &[String]) -> Result<Self, Error> {
        let index = |name: &str| leader.joints.iter().position(|joint| joint.name == name);
        let names = |of: &Robot| -> Vec<String> {
            of.joints.iter().map(|joint| joint.name.clone()).collect()
        };
        let (mut joints, mut unled) = (Vec::new(), Vec::new());
        for (follows, joint) in robot.joints.iter().enumerate() {
            let range = |joint: &Joint| [joint.limits.lower_rad(), joint.limits.upper_rad()];
            match index(&joint.name) {
                Some(leads) => {
                    let share_of_rad =
                        by_range.contains(&joint.name).then(|| range(&leader.joints[leads]));
                    joints.push(Pair { leads, follows, range_rad: range(joint), share_of_rad });
                }
                None => unled.push(joint.name.clone()),
            }
        }
        if joints.is_empty() {
            return Err(Error::new("no joint of one robot has the name of one of the other")
                .at(format!("robot {}, led by {}", robot.name, leader.name))
                .got(names(leader).join(", "))
                .allowed(names(robot).join(", ")));
        }
        let led = |name: &String| joints.iter().any(|of| robot.joints[of.follows].name == *name);
        if let Some(unknown) = by_range.iter().find(|name| !led(name)) {
            let both = joints.iter().map(|of| &robot.joints[of.follows].name);
            return Err(Error::of(ErrorKind::Unknown, "not a joint that both robots have")
                .at("--by-range")
                .none_of(unknown, both, "take one of these"));
        }
        let own = names(robot);
        let unfollowed = names(leader).into_iter().filter(|name| !own.contains(name)).collect();
        Ok(Self { joints, unled, unfollowed })
    }

    /// What is to be said of joints that have no partner.
    pub fn notes(&self) -> Vec<String> {
        let mut notes = Vec::new();
        if !self.unled.is_empty() {
            notes.push(format!("nobody leads {}: they stay where they are", self.unled.join(", ")));
        }
        if !self.unfollowed.is_empty() {
            notes.push(format!(
                "the robot has no {}: it is not followed",
                self.unfollowed.join(", ")
            ));
        }
        notes
    }
}

/// What a look at the leader gave.
pub enum Look {
    /// Where the follower is to be, rad.
    Goal(Vec<f64>),
    /// A joint did not answer, or is doubted: what the others say is no pose.
    Silent,
    /// Its line is gone, and why.
    Gone(String),
}

/// A leader that somebody guides by hand. Nothing is written to it.
pub struct GuidedArm {
    connection: Connection,
    pairs: Pairs,
    goal_rad: Vec<f64>,
    /// Where its joints can have been.
    believed: Believed,
    /// Whether they leapt, and how often one came back from where it leapt to.
    doubts: Vec<Doubt>,
    lies: u64,
    counts: Counts,
    /// Joints that did not answer for so many looks in a row.
    missed: Vec<u32>,
    silent: Vec<String>,
}

/// A hand turns a joint so many times as fast as its motor at most.
const BY_HAND: f64 = 3.0;
/// So many looks in a row without an answer are silence, and said.
const SILENT: u32 = 10;

impl GuidedArm {
    /// Nothing was read yet. Joints that nobody leads stay where the follower starts.
    /// The leader stands at `leader_start_rad`.
    ///
    /// # Errors
    /// Limits that none can be.
    pub fn new(
        connection: Connection,
        pairs: Pairs,
        start_rad: &[f64],
        leader_start_rad: &[f64],
    ) -> Result<Self, Error> {
        let joints = &connection.link.robot().joints;
        let missed = vec![0; joints.len()];
        let by_hand = |joint: &Joint| joint.limits.paced(BY_HAND);
        let limits = joints.iter().map(by_hand).collect::<Result<Vec<_>, _>>()?;
        let now = connection.link.clock().now();
        let believed = Believed::new(leader_start_rad, limits, now);
        Ok(Self {
            believed,
            doubts: vec![Doubt::NEW; missed.len()],
            lies: 0,
            connection,
            pairs,
            goal_rad: start_rad.to_vec(),
            counts: Counts::default(),
            missed,
            silent: Vec::new(),
        })
    }

    /// The leader's name.
    pub fn name(&self) -> &str {
        &self.connection.link.robot().name
    }

    /// Its clock.
    pub fn clock(&self) -> Arc<dyn Clock> {
        Arc::clone(self.connection.link.clock())
    }

    /// What was read so far, and how many readings of it were lies.
    pub fn into_counts(self) -> (Counts, u64) {
        (self.counts, self.lies)
    }

    /// Looks at every joint that leads: it answers, and no torque holds it against the hand; unless somebody will switch
    /// that off.
    ///
    /// # Errors
    /// A joint that is silent, or that holds itself.
    pub fn check(&mut self, will_be_limp: bool) -> Result<(), Error> {
        let link = &mut self.connection.link;
        let place = |link: &crate::robot::Link, joint: usize| {
            format!("leader {}, joint {}", link.robot().name, link.robot().joints[joint].name)
        };
        let mut holding = Vec::new();
        for &Pair { leads: joint, .. } in &self.pairs.joints {
            let Some(register) = link.robot().joints[joint].register(Role::TorqueEnable) else {
                continue;
            };
            let budget = link.clock().now() + QUESTION;
            let raw = link.read_register(joint, register, budget).map_err(|e| {
                Error::of(ErrorKind::Silent, "a joint of the leader does not answer")
                    .at(place(link, joint))
                    .got(e.error.to_string())
                    .remedy("check its power and cable, and that no other program has its port")
            })?;
            if raw != 0 {
                holding.push(link.robot().joints[joint].name.clone());
            }
        }
        if holding.is_empty() || will_be_limp {
            return Ok(());
        }
        Err(Error::of(ErrorKind::NotReady, "the leader holds itself: nobody can lead it by hand")
            .at(format!("leader {}", link.robot().name))
            .got(format!("torque on: {}", holding.join(", ")))
            .allowed("torque off on every joint that leads")
            .remedy("support it, then add --limp: its torque is switched off first"))
    }

    /// Reads all joints.
    pub fn look(&mut self) -> Look {
        let link = &mut self.connection.link;
        let asked_at = link.clock().now();
        let states = match link.whole_states(asked_at + LOOK) {
            Ok(mut states) => {
                self.believed.sift(&mut states, asked_at, link.clock().now());
                states
            }
            Err(LinkError { error: AskError::Port(error), place, .. }) => {
                return Look::Gone(format!("{place}: {error}"));
            }
            // That nobody answers is what every joint then shows.
            Err(_) => Vec::new(),
        };
        self.counts.samples += 1;
        let mut is_whole = true;
        for pair in &self.pairs.joints {
            let (leads, follows) = (pair.leads, pair.follows);
            let read = states.get(leads).and_then(|state| state.as_ref().ok());
            match read.map(|(state, _)| state.position_rad).filter(|rad| rad.is_finite()) {
                Some(rad) => {
                    self.missed[leads] = 0;
                    let trust = self.doubts[leads].hear(rad, asked_at);
                    self.lies += u64::from(trust == Trust::BackFromLie);
                    // What leaps for one look may be back at the next: no pose until then.
                    is_whole &= trust != Trust::Doubted;
                    self.goal_rad[follows] = pair.goal_rad(rad);
                }
                None => {
                    is_whole = false;
                    self.counts.missed += 1;
                    self.missed[leads] = self.missed[leads].saturating_add(1);
                }
            }
        }
        if is_whole { Look::Goal(self.goal_rad.clone()) } else { Look::Silent }
    }

    /// What is to be said of who is silent, when that changes.
    pub fn silence(&mut self) -> Option<String> {
        let joints = &self.connection.link.robot().joints;
        let silent = joints.iter().zip(&self.missed).filter(|(_, missed)| **missed >= SILENT);
        let silent: Vec<String> = silent.map(|(joint, _)| joint.name.clone()).collect();
        if silent == self.silent {
            return None;
        }
        self.silent = silent;
        Some(match self.silent.is_empty() {
            true => "the leader answers again".to_owned(),
            false => {
                let silent = self.silent.join(", ");
                format!("silent: {silent} of the leader; the robot stands until it answers")
            }
        })
    }
}
