//! A robot's joints, read again and again, as a body that is named. Nothing is written to them.

use super::RATE_HZ;
use crate::bus::AskError;
use crate::job::live::naming::{LiveWord, NamedBody, Naming};
use crate::job::source::recorded::SeenRobot;
use crate::recognise::stream::LONGEST_GAP_S;
use crate::robot::link::States;
use crate::robot::{Link, LinkError, Robot};
use crate::time::{Duration, Instant};
use std::sync::Arc;
use std::sync::mpsc::Sender;

/// Budget of one look: a servo that is silent must not hold up the others for longer than a few.
const LOOK: Duration = Duration::from_millis(50);

/// What is said of a robot of which no joint answered.
const NOBODY: &str =
    "none of its joints answered: check its power, its cable, and that the lines are its own";

/// What was heard of a robot.
pub struct HeardRobot {
    /// What was named.
    pub named: NamedBody,
    /// Why it ended early, if it did: a line is gone.
    pub lost: Option<String>,
}

/// Joints as they were read last.
struct Joints {
    names: Vec<String>,
    angles_rad: Vec<f64>,
    read: Vec<Option<Instant>>,
    silent: Vec<String>,
}

impl Joints {
    fn new(robot: &Robot) -> Self {
        Self {
            names: robot.joints.iter().map(|joint| joint.name.clone()).collect(),
            angles_rad: robot.joints.iter().map(|joint| joint.initial_rad).collect(),
            read: vec![None; robot.joints.len()],
            silent: Vec::new(),
        }
    }

    fn take(&mut self, states: &States, now: Instant) {
        for (joint, state) in states.iter().enumerate() {
            if let Ok((state, _)) = state
                && state.position_rad.is_finite()
            {
                self.angles_rad[joint] = state.position_rad;
                self.read[joint] = Some(now);
            }
        }
    }

    /// Which joints are known now: over a longer silence nothing is named.
    fn known(&self, now: Instant) -> Vec<bool> {
        let is_known = |read: &Option<Instant>| {
            read.is_some_and(|read| now.seconds_since(read) <= LONGEST_GAP_S)
        };
        self.read.iter().map(is_known).collect()
    }

    /// What is to be said of who is silent, when that changes.
    fn silence(&mut self, known: &[bool]) -> Option<String> {
        let silent = self.names.iter().zip(known).filter(|(_, known)| !**known);
        let silent: Vec<String> = silent.map(|(name, _)| name.clone()).collect();
        if silent == self.silent {
            return None;
        }
        self.silent = silent;
        Some(match self.silent.is_empty() {
            true => "all joints answer again".to_owned(),
            false => format!("silent: {}; what moves with that is unknown", self.silent.join(", ")),
        })
    }
}

/// Reads all joints until the time is over, `is_over` says so or a line is gone, and names what is done.
pub fn listen(
    link: &mut Link,
    seen: &SeenRobot,
    mut naming: Naming,
    tell: Sender<LiveWord>,
    time: Option<Duration>,
    is_over: &dyn Fn() -> bool,
) -> HeardRobot {
    let clock = Arc::clone(link.clock());
    let period = Duration::from_secs_f64(1.0 / RATE_HZ);
    let mut joints = Joints::new(link.robot());
    let mut coming = seen.coming();
    let began = clock.now();
    let (mut at, mut before_s) = (began, None);
    let lost = loop {
        let now = clock.now();
        if is_over() || time.is_some_and(|time| now.since(began) >= time) {
            break None;
        }
        match link.whole_states(now + LOOK) {
            Ok(states) => joints.take(&states, now),
            Err(LinkError { error: AskError::Port(error), place, .. }) => {
                break Some(format!("{place} is gone: {error}"));
            }
            // That nobody answers is seen by how old the angles get.
            Err(_) => {}
        }
        let known = joints.known(clock.now());
        let at_s = now.seconds_since(began);
        // The first looks are for hearing everybody once.
        if at_s > LONGEST_GAP_S
            && let Some(words) = joints.silence(&known)
        {
            // Nobody listens any more only at the very end.
            let _ = tell.send(LiveWord::Words(words));
        }
        if known.contains(&true) {
            let dt_s = before_s.map_or(0.0, |before_s| at_s - before_s);
            before_s = Some(at_s);
            let pose = coming.pose(&joints.angles_rad, dt_s);
            naming.hear(&pose, &seen.known(&known), now, at_s, &tell, |_| ());
        }
        at = (at + period).max(clock.now());
        clock.sleep_until(at);
    };
    let nobody = || joints.read.iter().all(Option::is_none).then(|| NOBODY.to_owned());
    HeardRobot { lost: lost.or_else(nobody), named: naming.finish(&tell) }
}
