//! A virtual robot with weight: its file's body on a level floor, on a stand or screwed down, moved by its virtual servos.
//!
//! What stands on the floor are soles, and of other links the corners of boxes and the ends of capsules: a robot that falls
//! lies there. The floor is level and as rough as rubber on wood (friction 1). Links that could touch one another by the robot's shapes do not go
//! through one another; they are smooth there.

use crate::error::Error;
use crate::retarget::base::{self, BasePath, Held, StandingSole};
use crate::retarget::collision::SelfContact;
use crate::rigid::ground::GRAVITY_M_S2;
use crate::rigid::{LinkContact, Moving, Placement, Pull, Volume};
use crate::robot::RobotBody;
use crate::time::Instant;
use gaitway_profiles::Robot;
use gaitway_sim::{Body, Felt, Outside, Push, SimError, Turned, World};
use glam::DVec3;
use serde::Serialize;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Of soles on the floor.
const FRICTION: f64 = 1.0;
/// A trunk that is turned further than this has fallen, rad: 60 deg.
const FALLEN_RAD: f64 = std::f64::consts::FRAC_PI_3;

/// How stiff and how damped the stop of a joint at the end of its range is, N m/rad and N m s/rad.
const STOP_NM_RAD: f64 = 1e3;
const STOP_NM_S_RAD: f64 = 5.0;

/// How fast the floor comes to its slope, rad/s: as somebody tilts a board.
const FLOOR_RAD_S: f64 = 0.5;

/// Where the surface of a capsule is looked at, from its ends.
const WAYS: [DVec3; 6] = [DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::NEG_Y, DVec3::Z, DVec3::NEG_Z];

/// How often it is kept where the base is, and how often at most: ten minutes.
const PATH_NS: u64 = 20_000_000;
const PATH_PLACES: usize = 30_000;

/// How a robot fell.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Fall {
    /// When, s since torque was on on its servos.
    pub at_s: f64,
    /// When by the world's clock.
    #[serde(skip)]
    pub at: Instant,
    /// What touched the floor that should not, by the joint that carries it; null if it tilted.
    pub touched: Option<String>,
}

impl Fall {
    /// As a person reads it.
    #[must_use]
    pub fn words(&self) -> String {
        format!("fell at {:.1} s: {}", self.at_s, self.how())
    }

    /// The same by the world's clock, as faults are told.
    #[must_use]
    pub fn world_words(&self) -> String {
        format!("{:.6} s: {}", self.at.seconds_since(Instant::ZERO), self.how())
    }

    /// How it came to lie.
    #[must_use]
    pub fn how(&self) -> String {
        match &self.touched {
            Some(link) => format!("{link} on the floor"),
            None => "tilted by 60 deg".to_owned(),
        }
    }
}

/// Links that met one another.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Meeting {
    /// Which, by the joints that carry them.
    pub links: [String; 2],
    /// When first, s since torque was on on its servos.
    pub at_s: f64,
    /// How hard they pressed on one another at most, N.
    pub peak_force_n: f64,
}

impl Meeting {
    /// As a person reads it.
    #[must_use]
    pub fn words(&self) -> String {
        let Self { links: [one, two], at_s, peak_force_n } = self;
        format!("{one} met {two} at {at_s:.1} s, and pressed on it with up to {peak_force_n:.0} N")
    }
}

/// What became of a body, for whoever gave it to a world.
#[derive(Clone, Debug)]
pub struct Witness {
    seen: Arc<Mutex<Seen>>,
    can_fall: bool,
}

/// What was seen of it since it was let go.
#[derive(Debug, Default)]
struct Seen {
    /// The first fall.
    fall: Option<Fall>,
    /// Of each two links that met until then, in the order in which they did.
    meetings: Vec<((usize, usize), Meeting)>,
    /// When the first of the places was.
    path_from_ns: u64,
    places: Vec<Placement>,
    contacts: Vec<[bool; 2]>,
}

impl Seen {
    fn note(&mut self, contact: &LinkContact, at_s: f64, name: impl Fn(usize) -> String) {
        let LinkContact { links, force_n, .. } = *contact;
        match self.meetings.iter_mut().find(|(known, _)| *known == links) {
            Some((_, meeting)) => meeting.peak_force_n = meeting.peak_force_n.max(force_n),
            None => {
                let named = [name(links.0), name(links.1)];
                let meeting = Meeting { links: named, at_s, peak_force_n: force_n };
                self.meetings.push((links, meeting));
            }
        }
    }
}

impl Witness {
    /// What is to be said of a body that has been looked at to the end.
    #[must_use]
    pub fn words(&self) -> String {
        match self.fall() {
            Some(fall) => fall.words(),
            None if self.can_fall => "with weight, it stayed up".to_owned(),
            None => "with weight, its base held by somebody: it cannot fall".to_owned(),
        }
    }

    fn seen(&self) -> MutexGuard<'_, Seen> {
        self.seen.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The first fall, if there was one.
    #[must_use]
    pub fn fall(&self) -> Option<Fall> {
        self.seen().fall.clone()
    }

    /// Which links met one another before it fell, in the order in which they did.
    #[must_use]
    pub fn meetings(&self) -> Vec<Meeting> {
        self.seen().meetings.iter().map(|(_, meeting)| meeting.clone()).collect()
    }

    /// Where the base was, and which feet were on the floor, from an instant of the world's clock on, ten minutes at
    /// most; none if the robot was never let go.
    #[must_use]
    pub fn path_since(&self, from: Instant) -> Option<BasePath> {
        let seen = self.seen();
        let rate_hz = 1e9 / PATH_NS as f64;
        let whole =
            BasePath { rate_hz, places: seen.places.clone(), contacts: seen.contacts.clone() };
        let late_s = from.seconds_since(Instant::from_nanos(seen.path_from_ns));
        drop(seen);
        let end_s = whole.places.len().checked_sub(1)? as f64 / rate_hz;
        let count = ((end_s - late_s) * rate_hz).floor().max(0.0) as usize + 1;
        let at = |index: usize| whole.at(late_s + index as f64 / rate_hz);
        let (places, contacts) = (0..count.min(PATH_PLACES)).map(at).unzip();
        Some(BasePath { rate_hz, places, contacts })
    }
}

/// Gives a virtual robot the weight of its file; `hangs` if it hangs on a stand.
///
/// # Errors
/// A file without a body, joints that CAN actuators move.
pub fn give(world: &mut World, robot: &Robot, hangs: bool) -> Result<Witness, Error> {
    let body = RobotBody::of(robot)?.ok_or_else(|| {
        Error::new("a robot without a body has no weight")
            .at(format!("robot {}", robot.name))
            .remedy("gaitway robot import FILE.urdf makes a file with one; or leave out --physics")
    })?;
    let (weighed, witness) = Weighed::new(robot, body, hangs);
    world.give_weight(Box::new(weighed)).map_err(|error| {
        let said = Error::new(error.to_string()).at(format!("robot {}", robot.name));
        match error {
            SimError::NoWeight(_) => said.remedy("leave out --physics"),
            _ => said,
        }
    })?;
    Ok(witness)
}

/// A robot's body that is moved.
struct Weighed {
    body: RobotBody,
    soles: Vec<StandingSole>,
    held: Held,
    /// What of it may touch what.
    apart: SelfContact,
    /// What each joint can, rad: there is a stop at either end.
    ranges_rad: Vec<[f64; 2]>,
    /// Once it was let go.
    moving: Option<Moving>,
    /// How its base was accelerated in the last step, m/s².
    gained_m_s2: DVec3,
    /// How much the floor falls ahead and to the left by now, rad, and how it turns, rad/s.
    slope_rad: [f64; 2],
    floor_rad_s: DVec3,
    powered_since_ns: u64,
    witness: Witness,
}

impl Weighed {
    /// A body that somebody holds, and whoever tells what became of it.
    fn new(robot: &Robot, body: RobotBody, hangs: bool) -> (Self, Witness) {
        let soles = StandingSole::all(&body);
        let held = Held::of(&body, &soles, hangs);
        let witness = Witness { seen: Arc::default(), can_fall: held == Held::Standing };
        let ranges_rad =
            robot.joints.iter().map(|joint| [joint.lower_rad, joint.upper_rad]).collect();
        let start_rad: Vec<f64> = robot.joints.iter().map(|joint| joint.initial_rad()).collect();
        let apart = SelfContact::of(&body, &start_rad);
        let weighed = Self {
            body,
            soles,
            held,
            apart,
            ranges_rad,
            moving: None,
            gained_m_s2: DVec3::ZERO,
            slope_rad: [0.0; 2],
            floor_rad_s: DVec3::ZERO,
            powered_since_ns: 0,
            witness: witness.clone(),
        };
        (weighed, witness)
    }

    /// Where links may touch the floor.
    fn corners(&self) -> Vec<(usize, DVec3)> {
        let of_soles =
            self.soles.iter().flat_map(|sole| sole.corners_m.iter().map(|at| (sole.link, *at)));
        let stands = |link: &usize| self.soles.iter().any(|sole| sole.link == *link);
        let others = (0..self.body.volumes.len()).filter(|link| !stands(link));
        let of_others = others.flat_map(|link| {
            let volumes = self.body.volumes[link].iter();
            volumes.flat_map(move |volume| {
                let ways = match volume {
                    Volume::Cuboid(_) => &WAYS[..1],
                    Volume::Capsule(_) => &WAYS[..],
                };
                ways.iter().flat_map(|way| volume.corners_m(*way)).map(move |at| (link, at))
            })
        });
        of_soles.chain(of_others).collect()
    }

    fn look(&self, moving: &Moving, time_ns: u64) {
        let mut seen = self.witness.seen();
        if time_ns.is_multiple_of(PATH_NS) && seen.places.len() < PATH_PLACES {
            if seen.places.is_empty() {
                seen.path_from_ns = time_ns;
            }
            let mut stands = [false; 2];
            for link in moving.on_floor() {
                self.soles
                    .iter()
                    .filter(|of| of.link == link)
                    .for_each(|of| stands[of.side] = true);
            }
            seen.places.push(moving.base());
            seen.contacts.push(stands);
        }
        let at_s = time_ns.saturating_sub(self.powered_since_ns) as f64 * 1e-9;
        // What a robot that has fallen lies on is nobody's concern.
        let pressed = if seen.fall.is_none() { moving.pressed().collect() } else { Vec::new() };
        for contact in pressed {
            seen.note(contact, at_s, |link| self.body.tree.links()[link].name.clone());
        }
        if self.held != Held::Standing {
            return;
        }
        let stands = |link: &usize| self.soles.iter().any(|sole| sole.link == *link);
        let touched = moving.on_floor().find(|link| !stands(link));
        let tilted = (moving.base().turn * DVec3::Z).angle_between(DVec3::Z) > FALLEN_RAD;
        if seen.fall.is_none() && (touched.is_some() || tilted) {
            let fall = Fall {
                at_s,
                at: Instant::from_nanos(time_ns),
                touched: touched.map(|link| self.body.tree.links()[link].name.clone()),
            };
            seen.fall = Some(fall);
        }
    }
}

impl Body for Weighed {
    fn let_go(&mut self, angles_rad: &[f64], powered_since_ns: u64) {
        let poses = [angles_rad.to_vec()];
        let path = base::path(&self.body, &self.soles, self.held, &poses, 1.0, |_| None);
        let (place, _) = path.at(0.0);
        let angles = self.body.angles(angles_rad);
        let stands = self.held == Held::Standing;
        // Who hangs, hangs high enough; who is screwed down, on something without a floor.
        let corners = if stands { self.corners() } else { Vec::new() };
        let moving =
            Moving::at_rest(&self.body.tree, FRICTION, GRAVITY_M_S2, corners, place, &angles);
        self.moving = Some(if stands { moving } else { moving.fixed() });
        self.gained_m_s2 = DVec3::ZERO;
        (self.slope_rad, self.floor_rad_s) = ([0.0; 2], DVec3::ZERO);
        self.powered_since_ns = powered_since_ns;
        *self.witness.seen() = Seen::default();
    }

    fn step(
        &mut self,
        pushes: &[Push],
        outside: &Outside,
        step_s: f64,
        time_ns: u64,
    ) -> Vec<Turned> {
        let before_rad = self.slope_rad;
        for (now_rad, to_rad) in self.slope_rad.iter_mut().zip(outside.slope_rad) {
            let step_rad = FLOOR_RAD_S * step_s;
            *now_rad += (to_rad - *now_rad).clamp(-step_rad, step_rad);
        }
        let turned = |axis: usize| (self.slope_rad[axis] - before_rad[axis]) / step_s;
        // What falls ahead turns about the left, what falls to the left about what is behind.
        self.floor_rad_s = DVec3::new(-turned(1), turned(0), 0.0);
        let tree = &self.body.tree;
        let coordinate = |joint: usize| tree.coordinate(joint + 1);
        let Some(moving) = &mut self.moving else { return vec![Turned::default(); pushes.len()] };
        let pushed = |(joint, force_n): &(Option<usize>, [f64; 3])| {
            (joint.map_or(0, |joint| joint + 1), DVec3::from_array(*force_n))
        };
        moving.meet(self.apart.touching(&moving.placed()));
        moving.disturb(outside.forces.iter().map(pushed).collect(), self.slope_rad);
        let mut pulls = vec![Pull::default(); tree.moving()];
        for (joint, push) in pushes.iter().enumerate() {
            let Some(at) = coordinate(joint) else { continue };
            let Push { mut torque_nm, mut gives_nm_s_rad, armature_kg_m2 } = *push;
            let angle_rad = moving.angles()[at];
            let [lower_rad, upper_rad] = self.ranges_rad[joint];
            let beyond_rad = (angle_rad - upper_rad).max(0.0) - (lower_rad - angle_rad).max(0.0);
            if beyond_rad != 0.0 {
                torque_nm -= STOP_NM_RAD * beyond_rad;
                gives_nm_s_rad += STOP_NM_RAD * step_s + STOP_NM_S_RAD;
            }
            pulls[at] = Pull { torque_nm, gives_nm_s_rad, armature_kg_m2 };
        }
        // A step without an answer leaves everything where it is, and the next one may have one.
        let before_m_s = moving.velocity_m_s();
        let _ = moving.step(&pulls, step_s);
        self.gained_m_s2 = (moving.velocity_m_s() - before_m_s) / step_s;
        let turned = |joint: usize| {
            coordinate(joint).map_or(Turned::default(), |at| Turned {
                angle_rad: moving.angles()[at],
                rate_rad_s: moving.rates()[at],
            })
        };
        let turned = (0..pushes.len()).map(turned).collect();
        if let Some(moving) = &self.moving {
            self.look(moving, time_ns);
        }
        turned
    }

    fn felt(&self) -> Felt {
        let Some(moving) = &self.moving else { return Felt::STILL };
        let turn = moving.base().turn.inverse();
        let held_m_s2 = self.gained_m_s2 - moving.down() * GRAVITY_M_S2;
        Felt {
            spin_rad_s: (turn * (moving.spin_rad_s() + self.floor_rad_s)).to_array(),
            acceleration_g: (turn * held_m_s2 / GRAVITY_M_S2).to_array(),
        }
    }

    fn fallen(&self) -> Option<String> {
        self.witness.fall().map(|fall| fall.touched.unwrap_or_default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn op3(hangs: bool) -> (Weighed, Witness, Vec<f64>) {
        let robot = gaitway_profiles::robot("op3").expect("a robot");
        let body = RobotBody::of(&robot).expect("sound").expect("a body");
        let initial = robot.joints.iter().map(|joint| joint.initial_rad()).collect();
        let (weighed, seen) = Weighed::new(&robot, body, hangs);
        (weighed, seen, initial)
    }

    /// Three seconds of servos that give nothing but friction.
    fn limp(weighed: &mut Weighed, initial: &[f64]) -> Vec<Turned> {
        weighed.let_go(initial, 0);
        let slack = Push { torque_nm: 0.0, gives_nm_s_rad: 0.05, armature_kg_m2: 0.003 };
        let pushes = vec![slack; initial.len()];
        (1..=3_000)
            .map(|ms| weighed.step(&pushes, &Outside::default(), 1e-3, ms * 1_000_000))
            .last()
            .expect("steps")
    }

    #[test]
    fn a_limp_robot_falls_and_its_joints_stop_at_the_ends_of_their_ranges() {
        let (mut weighed, witness, initial) = op3(false);
        let turned = limp(&mut weighed, &initial);
        let fall = witness.fall().expect("a fall");
        assert!((0.1..1.5).contains(&fall.at_s), "{fall:?}");
        for (turned, [lower_rad, upper_rad]) in turned.iter().zip(&weighed.ranges_rad) {
            let angle_rad = turned.angle_rad;
            assert!(
                (lower_rad - 0.02..=upper_rad + 0.02).contains(&angle_rad),
                "{angle_rad} {lower_rad} {upper_rad}"
            );
        }
    }

    #[test]
    fn a_limp_robot_on_a_stand_hangs_with_straight_legs_and_has_not_fallen() {
        let (mut weighed, witness, initial) = op3(true);
        let robot = gaitway_profiles::robot("op3").expect("a robot");
        let turned = limp(&mut weighed, &initial);
        assert_eq!(witness.fall(), None);
        assert!(witness.words().contains("cannot fall"), "{}", witness.words());
        for name in ["l_knee", "r_knee"] {
            let joint = robot.joints.iter().position(|joint| joint.name == name).expect("a knee");
            assert!(turned[joint].angle_rad.abs() < 0.3, "{name}: {:?}", turned[joint]);
        }
    }
}
