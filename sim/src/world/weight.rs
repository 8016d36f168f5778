//! A robot with weight: its servos' shafts turn the joints of a body.
//!
//! Somebody holds the robot as it stands until torque has been on for a while on as many of its servos as
//! before, and then lets go; until then shafts turn as those of a robot without weight. Whoever switches
//! torque off later finds out what it held.

use super::{Placed, World};
use crate::SimError;
use crate::body::{Body, Outside};
use crate::fault::Fault;
use crate::fault::plan::Place;
use crate::journal::Happening;
use crate::motor::STEP_NS;

/// So long after the last servo was switched on the robot is let go.
const HELD_NS: u64 = 200_000_000;

/// What is known of a body between two steps.
pub(super) struct Weight {
    body: Box<dyn Body>,
    /// Time of its state.
    at_ns: u64,
    held: Held,
    outside: Outside,
    /// Which faults push, in the order of the forces.
    pushing: Vec<u64>,
    /// That it has fallen is in the journal.
    has_fallen: bool,
}

/// How often whoever holds it looks for torque.
const LOOK_NS: u64 = 10_000_000;

/// Whether somebody holds it.
#[derive(Clone, Copy, PartialEq)]
enum Held {
    /// Servos with torque, and since when they are as many.
    Since {
        powered: usize,
        ns: u64,
    },
    LetGo,
}

impl Weight {
    pub fn new(body: Box<dyn Body>, at_ns: u64) -> Self {
        Self {
            body,
            at_ns,
            held: Held::Since { powered: 0, ns: 0 },
            outside: Outside::default(),
            pushing: Vec::new(),
            has_fallen: false,
        }
    }

    /// As at the start of the world.
    pub fn hold_again(&mut self) {
        (self.at_ns, self.held) = (0, Held::Since { powered: 0, ns: 0 });
        (self.outside, self.pushing) = (Outside::default(), Vec::new());
        self.has_fallen = false;
    }
}

impl World {
    /// The robot gets weight: `body` says how its joints turn under what servos do. In place of one it had
    /// somebody holds it again.
    ///
    /// # Errors
    /// A joint is moved by a CAN actuator.
    pub fn give_weight(&mut self, body: Box<dyn Body>) -> Result<(), SimError> {
        let on_can = |joint: &&String| {
            let index = self.by_name.get(*joint).copied();
            index.is_some_and(|index| self.can.contains_key(&self.joints[index].place.line))
        };
        if let Some(joint) = self.joint_names().iter().find(on_can) {
            return Err(SimError::NoWeight(joint.clone()));
        }
        for servo in self.lines.iter_mut().flat_map(|line| &mut line.servos) {
            servo.put_down();
        }
        self.weight = Some(Weight::new(body, self.now_ns / STEP_NS * STEP_NS));
        self.bear_until(self.now_ns);
        Ok(())
    }

    /// A fault begins to push.
    pub(super) fn push_body(&mut self, fault: u64, servo: Option<Place>, force_n: [f64; 3]) {
        let joint = servo.and_then(|servo| self.joints.iter().position(|of| of.place == servo));
        if let Some(weight) = &mut self.weight {
            weight.outside.forces.push((joint, force_n));
            weight.pushing.push(fault);
        }
    }

    /// It pushes no longer.
    pub(super) fn relent(&mut self, fault: u64) {
        if let Some(weight) = &mut self.weight
            && let Some(at) = weight.pushing.iter().position(|of| *of == fault)
        {
            weight.pushing.remove(at);
            weight.outside.forces.remove(at);
        }
    }

    /// The floor falls as much from now on.
    pub(super) fn tilt_floor(&mut self, slope_rad: [f64; 2]) {
        if let Some(weight) = &mut self.weight {
            weight.outside.slope_rad = slope_rad;
        }
    }

    /// A fault that only befalls what has weight needs it.
    pub(super) fn check_weight(&self, fault: &Fault) -> Result<(), SimError> {
        match fault.of_weight().filter(|_| self.weight.is_none()) {
            Some(fault) => Err(SimError::NeedsWeight(fault)),
            None => Ok(()),
        }
    }

    /// True if it was given weight.
    pub(crate) fn has_weight(&self) -> bool {
        self.weight.is_some()
    }

    /// The body moves on to the last whole millisecond at or before `time_ns`.
    pub(super) fn bear_until(&mut self, time_ns: u64) {
        let Some(mut weight) = self.weight.take() else { return };
        // However long a stretch of time is, torque is looked at on the way.
        while let Held::Since { powered, ns } = weight.held {
            let before_ns = weight.at_ns;
            weight.at_ns = before_ns.max((time_ns / STEP_NS * STEP_NS).min(before_ns + LOOK_NS));
            let now = self.powered(weight.at_ns);
            if now != powered {
                weight.held = Held::Since { powered: now, ns: weight.at_ns };
            } else if now > 0 && weight.at_ns >= ns + HELD_NS {
                let angles = self.carry();
                weight.body.let_go(&angles, ns);
                weight.held = Held::LetGo;
            }
            if weight.at_ns == before_ns {
                break;
            }
        }
        while weight.held == Held::LetGo && weight.at_ns + STEP_NS <= time_ns {
            weight.at_ns += STEP_NS;
            self.step_body(&mut weight);
        }
        self.weight = Some(weight);
    }

    /// How many servos of joints have torque.
    fn powered(&mut self, at_ns: u64) -> usize {
        let joints = self.joints.iter();
        joints
            .filter(|placed| {
                let servo = &mut self.lines[placed.place.line].servos[placed.place.servo];
                servo.advance(at_ns);
                servo.torque_on()
            })
            .count()
    }

    /// From here on the body turns the shafts: the joints' angles, rad.
    fn carry(&mut self) -> Vec<f64> {
        let mut angles = Vec::with_capacity(self.joints.len());
        for Placed { place, initial_rad, ratio, .. } in &self.joints {
            let servo = &mut self.lines[place.line].servos[place.servo];
            angles.push(initial_rad + ratio * servo.turned_rad());
            servo.carry();
        }
        angles
    }

    fn step_body(&mut self, weight: &mut Weight) {
        let mut pushes = Vec::with_capacity(self.joints.len());
        for Placed { place, ratio, .. } in &self.joints {
            let servo = &mut self.lines[place.line].servos[place.servo];
            let mut push = servo.push_body(weight.at_ns);
            // What a gear takes of the way it gives to the torque.
            push.torque_nm /= ratio;
            push.gives_nm_s_rad /= ratio * ratio;
            push.armature_kg_m2 /= ratio * ratio;
            pushes.push(push);
        }
        let turned =
            weight.body.step(&pushes, &weight.outside, STEP_NS as f64 * 1e-9, weight.at_ns);
        for (Placed { place, initial_rad, ratio, .. }, turned) in self.joints.iter().zip(turned) {
            let servo = &mut self.lines[place.line].servos[place.servo];
            servo.carry_to((turned.angle_rad - initial_rad) / ratio, turned.rate_rad_s / ratio);
        }
        self.feel(weight.body.felt());
        if !weight.has_fallen
            && let Some(on) = weight.body.fallen()
        {
            weight.has_fallen = true;
            self.shared.journal.note(weight.at_ns, || Happening::Fell { on });
        }
    }
}
