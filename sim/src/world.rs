//! The world: a robot's servos on their lines, and the time they share.

use crate::SimError;
use crate::fault::{Fault, Faults, Strike};
use crate::line::{Line, Shared};
use crate::referee::{Referee, Verdict};
use crate::servo::Servo;
use crate::table::Model;
use gaitway_profiles::{Joint, Robot, Role, Servo as Profile};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Instant;

/// How a world behaves.
#[derive(Clone, Debug)]
pub struct Options {
    /// Everything random follows from it.
    pub seed: u64,
    /// True: bytes take their time and servos wait their return delay. False: all at once.
    pub line_timing: bool,
    /// EEPROM writes are allowed from the start.
    pub permit_eeprom: bool,
    /// The host hears its own bytes, as with some adapters.
    pub echo: bool,
    /// Time the adapter holds bytes back after they are complete.
    pub adapter_latency_ns: u64,
    /// What comes after a servo that does not answer its part of a sync or bulk read.
    pub missing_in_chain: MissingInChain,
    /// What DYNAMIXEL servos say to a packet for them whose checksum is wrong.
    pub bad_checksum: BadChecksum,
    /// What goes wrong.
    pub faults: Vec<Fault>,
}

impl Default for Options {
    fn default() -> Options {
        Options {
            seed: 0,
            line_timing: true,
            permit_eeprom: false,
            echo: false,
            adapter_latency_ns: 0,
            missing_in_chain: MissingInChain::Silent,
            bad_checksum: BadChecksum::Ignore,
            faults: Vec::new(),
        }
    }
}

/// What servos do whose turn in a sync or bulk read comes after one that stays silent. No manual
/// says; a servo is known to wait for the status before its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MissingInChain {
    /// They wait for good.
    Silent,
    /// They go on after a pause. A merged (fast) status is cut off all the same.
    AnswerAfter {
        /// The pause.
        gap_ns: u64,
    },
}

/// What DYNAMIXEL servos do with a packet for them whose checksum is wrong. The manuals define an
/// error for it (bit 4 in Protocol 1.0, number 3 in Protocol 2.0), but hosts do not get to see it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BadChecksum {
    /// Nothing; the bytes are searched for another packet.
    Ignore,
    /// They answer with the error.
    Answer,
}

/// A virtual robot in virtual time. The same seed and the same host bytes at the same times give
/// the same bytes back.
pub struct World {
    now_ns: u64,
    lines: Vec<Line>,
    shared: Shared,
    joints: Vec<Placed>,
    by_name: BTreeMap<String, usize>,
    /// A moment of real time and the world time it was then, once a door is open.
    epoch: Option<(Instant, u64)>,
}

/// Where a joint's servo is.
#[derive(Clone, Copy, Debug)]
struct Placed {
    line: usize,
    servo: usize,
    initial_rad: f64,
    /// Turns of the joint for one turn of the servo, with its sign.
    ratio: f64,
}

impl World {
    /// The robot's servos, powered up, set up as its file says, limp in its initial pose.
    ///
    /// # Errors
    /// A servo profile, line or joint that does not exist, a line speed a servo does not know, or a
    /// register value that does not fit.
    pub fn new(robot: &Robot, options: Options) -> Result<World, SimError> {
        World::build(robot, options, |name| gaitway_profiles::servo(name).ok())
    }

    /// As [`World::new`], with profiles that need not be shipped.
    ///
    /// # Errors
    /// As [`World::new`].
    pub fn with_servos(
        robot: &Robot,
        servos: &[Profile],
        options: Options,
    ) -> Result<World, SimError> {
        World::build(robot, options, |name| servos.iter().find(|servo| servo.name == name))
    }

    fn build<'a>(
        robot: &Robot,
        options: Options,
        find: impl Fn(&str) -> Option<&'a Profile>,
    ) -> Result<World, SimError> {
        let by_name: BTreeMap<String, usize> =
            robot.joints.iter().enumerate().map(|(k, joint)| (joint.name.clone(), k)).collect();
        let faults = Faults::new(&options.faults, |joint| {
            by_name.get(joint).copied().ok_or_else(|| SimError::UnknownJoint(joint.to_string()))
        })?;
        let lines = robot.lines.iter().enumerate();
        let mut world = World {
            now_ns: 0,
            lines: lines.map(|(k, l)| Line::new(k, &l.name, l.baud_bps)).collect(),
            shared: Shared {
                line_timing: options.line_timing,
                real_time: false,
                echo: options.echo,
                adapter_latency_ns: options.adapter_latency_ns,
                missing_in_chain: options.missing_in_chain,
                bad_checksum: options.bad_checksum,
                faults,
                rng: ChaCha8Rng::seed_from_u64(options.seed),
                referee: Referee::new(robot.lines.len(), options.permit_eeprom),
            },
            joints: Vec::new(),
            by_name,
            epoch: None,
        };
        let mut models: BTreeMap<&str, Arc<Model>> = BTreeMap::new();
        for joint in &robot.joints {
            let profile =
                find(&joint.servo).ok_or_else(|| SimError::UnknownServo(joint.servo.clone()))?;
            let model = models.entry(&joint.servo).or_insert_with(|| Arc::new(Model::new(profile)));
            world.add(robot, joint, Arc::clone(model))?;
        }
        for (joint, span) in world.shared.faults.silences.clone() {
            world.servo_mut(joint).silent.push(span);
        }
        Ok(world)
    }

    fn add(&mut self, robot: &Robot, joint: &Joint, model: Arc<Model>) -> Result<(), SimError> {
        let line = robot.lines.iter().position(|line| line.name == joint.line);
        let line = line.ok_or_else(|| SimError::UnknownLine(joint.line.clone()))?;
        let baud_bps = robot.lines[line].baud_bps;
        let profile = &model.profile;
        let wrong = |reason: &str| SimError::BadServo {
            joint: joint.name.clone(),
            servo: profile.name.clone(),
            reason: reason.to_string(),
        };
        let baud = profile.baud.iter().find(|baud| baud.bps == baud_bps);
        let baud = baud.ok_or_else(|| wrong("does not know its line's speed"))?;
        for role in [Role::Id, Role::BaudRate, Role::PresentPosition, Role::GoalPosition] {
            model.role(role).ok_or_else(|| wrong(&format!("has no register for {role:?}")))?;
        }
        let (firmware, registers) = robot.setup_for(joint);
        let mut servo = Servo::new(Arc::clone(&model), firmware);
        servo.joint = Some(self.joints.len());
        servo.set_up(Role::Id, i64::from(joint.id));
        servo.set_up(Role::BaudRate, i64::from(baud.index));
        for (name, raw) in &registers {
            if !servo.force(name, *raw) {
                return Err(wrong(&format!("has no register {name:?} that can hold {raw}")));
            }
        }
        let ratio = f64::from(joint.direction) * joint.gear;
        servo.place((joint.initial_rad + joint.offset_rad) / ratio);
        servo.mark_start();
        self.shared.referee.add(joint, profile);
        self.joints.push(Placed {
            line,
            servo: self.lines[line].servos.len(),
            initial_rad: joint.initial_rad,
            ratio,
        });
        self.lines[line].servos.push(servo);
        Ok(())
    }

    /// World time, ns.
    pub fn now_ns(&self) -> u64 {
        self.now_ns
    }

    /// Names of the lines; their order gives the numbers the other functions want.
    pub fn line_names(&self) -> Vec<String> {
        self.lines.iter().map(|line| line.name.clone()).collect()
    }

    /// Speed the servos of a line are set up for, bits per second.
    pub fn line_baud_bps(&self, line: usize) -> Option<u32> {
        self.lines.get(line).map(|line| line.baud_bps)
    }

    /// Names of the joints in the order of the robot file.
    pub fn joint_names(&self) -> Vec<String> {
        let mut names = vec![String::new(); self.joints.len()];
        for (name, &k) in &self.by_name {
            names[k].clone_from(name);
        }
        names
    }

    /// Lets time pass until `time_ns`; a time gone by changes nothing.
    pub fn run_until(&mut self, time_ns: u64) {
        while let Some(next_ns) = self.next_event_ns().filter(|&next_ns| next_ns <= time_ns) {
            self.now_ns = self.now_ns.max(next_ns);
            self.happen();
        }
        self.now_ns = self.now_ns.max(time_ns);
    }

    /// When the servos hear something next, or a fault strikes.
    fn next_event_ns(&self) -> Option<u64> {
        let hearing = self.lines.iter().filter_map(Line::next_hearing_ns).min();
        let strike = self.shared.faults.strikes.last().map(|&(at_ns, _)| at_ns);
        hearing.into_iter().chain(strike).min()
    }

    /// Carries out the next event, a fault before a packet.
    fn happen(&mut self) {
        let now_ns = self.now_ns;
        if let Some((_, strike)) =
            self.shared.faults.strikes.pop_if(|&mut (at_ns, _)| at_ns <= now_ns)
        {
            self.strike(strike);
        } else if let Some(line) = self
            .lines
            .iter_mut()
            .filter(|line| line.next_hearing_ns().is_some())
            .min_by_key(|line| line.next_hearing_ns())
        {
            line.hear_next(&mut self.shared);
        }
    }

    fn strike(&mut self, strike: Strike) {
        let now_ns = self.now_ns;
        match strike {
            Strike::Overload { joint } => self.servo_mut(joint).raise_overload(now_ns),
            Strike::Reboot { joint } => {
                self.servo_mut(joint).restart(now_ns, now_ns + crate::servo::BOOT_NS);
            }
            Strike::Brownout { until_ns } => {
                for servo in self.lines.iter_mut().flat_map(|line| &mut line.servos) {
                    servo.restart(now_ns, until_ns);
                }
            }
            Strike::Block { joint, blocked } => {
                let servo = self.servo_mut(joint);
                servo.advance(now_ns);
                servo.motor.blocked = blocked;
            }
            Strike::Jump { joint, counts } => {
                let servo = self.servo_mut(joint);
                servo.advance(now_ns);
                servo.jump(counts);
            }
        }
        for line in &mut self.lines {
            line.report(now_ns, &mut self.shared.referee);
        }
    }

    /// The host starts to send on a line, after what it is sending already; returns at once.
    pub fn transmit(&mut self, line: usize, bytes: &[u8], baud_bps: u32) {
        let now_ns = self.now_ns;
        if let Some(line) = self.lines.get_mut(line) {
            line.transmit(now_ns, bytes, baud_bps, &mut self.shared);
        }
    }

    /// Runs the world until at least one byte for the host is there, or until the deadline. Returns
    /// how many bytes were put into `buf`; time is then that of the last event needed.
    pub fn receive(&mut self, line: usize, buf: &mut [u8], deadline_ns: u64) -> usize {
        if line >= self.lines.len() {
            return 0;
        }
        loop {
            if self.lines[line].collect(self.now_ns, &mut self.shared.rng) > 0 {
                return self.lines[line].take(buf);
            }
            if self.now_ns >= deadline_ns {
                // Without line timing an instruction sent now is heard now.
                if self.next_event_ns().is_none_or(|next_ns| next_ns > self.now_ns) {
                    return 0;
                }
                self.run_until(self.now_ns);
                continue;
            }
            let ready_ns = self.lines[line].next_ready_ns();
            let next_ns = self.next_event_ns().into_iter().chain(ready_ns).min();
            let next_ns = next_ns.map_or(deadline_ns, |next_ns| next_ns.min(deadline_ns));
            self.run_until(next_ns);
        }
    }

    /// Drops what waits for the host on a line.
    pub fn discard_input(&mut self, line: usize) {
        if let Some(line) = self.lines.get_mut(line) {
            line.collect(self.now_ns, &mut self.shared.rng);
            line.discard_ready();
        }
    }

    /// When something happens on a line that a host would notice, if nobody sends more.
    pub(crate) fn next_on_line_ns(&self, line: usize) -> Option<u64> {
        let line = self.lines.get(line)?;
        line.next_hearing_ns().into_iter().chain(line.next_ready_ns()).min()
    }

    /// Real time and world time run together from the first call on.
    pub(crate) fn epoch(&mut self) -> (Instant, u64) {
        self.shared.real_time = true;
        *self.epoch.get_or_insert((Instant::now(), self.now_ns))
    }

    fn servo(&self, joint: usize) -> &Servo {
        let place = self.joints[joint];
        &self.lines[place.line].servos[place.servo]
    }

    fn servo_mut(&mut self, joint: usize) -> &mut Servo {
        let place = self.joints[joint];
        &mut self.lines[place.line].servos[place.servo]
    }

    /// The servo of a joint, moved on to now.
    fn current(&mut self, joint: &str) -> Option<&mut Servo> {
        let joint = *self.by_name.get(joint)?;
        let now_ns = self.now_ns;
        let servo = self.servo_mut(joint);
        servo.advance(now_ns);
        Some(servo)
    }

    /// Where the joint really is, whatever its registers say, rad.
    pub fn joint_position_rad(&self, joint: &str) -> Option<f64> {
        let joint = *self.by_name.get(joint)?;
        let place = self.joints[joint];
        let mut servo = self.servo(joint).clone();
        servo.advance(self.now_ns);
        Some(place.initial_rad + place.ratio * servo.turned_rad())
    }

    /// How fast the joint really turns, rad/s.
    pub fn joint_velocity_rad_s(&self, joint: &str) -> Option<f64> {
        let joint = *self.by_name.get(joint)?;
        let mut servo = self.servo(joint).clone();
        servo.advance(self.now_ns);
        Some(self.joints[joint].ratio * servo.velocity_rad_s())
    }

    /// Turns a joint's shaft by hand, rad. Returns false if there is no such joint.
    pub fn place_joint(&mut self, joint: &str, position_rad: f64) -> bool {
        let Some(&index) = self.by_name.get(joint) else { return false };
        let Placed { initial_rad, ratio, .. } = self.joints[index];
        let Some(servo) = self.current(joint) else { return false };
        let turn = (position_rad - initial_rad) / ratio - servo.turned_rad();
        servo.turn_by(turn);
        true
    }

    /// Raw value of a register by its name in the profile.
    pub fn register(&self, joint: &str, register: &str) -> Option<i64> {
        let mut servo = self.servo(*self.by_name.get(joint)?).clone();
        servo.advance(self.now_ns);
        servo.named(register)
    }

    /// Sets a register's raw value past all rules, to set a scene. Present position, voltage and
    /// temperature set what they measure. Returns false if there is no such joint or register, or
    /// the value does not fit.
    pub fn set_register(&mut self, joint: &str, register: &str, raw: i64) -> bool {
        self.current(joint).is_some_and(|servo| servo.force(register, raw))
    }

    /// Unplugs a joint's servo. Returns false if there is no such joint.
    pub fn remove(&mut self, joint: &str) -> bool {
        self.current(joint).is_some_and(|servo| {
            servo.attached = false;
            true
        })
    }

    /// Plugs in another servo like this joint's, with the same ID and registers, its shaft turned
    /// by `turn_rad`. Returns false if there is no such joint.
    pub fn duplicate(&mut self, joint: &str, turn_rad: f64) -> bool {
        let Some(&index) = self.by_name.get(joint) else { return false };
        let Some(servo) = self.current(joint) else { return false };
        let mut stray = servo.clone();
        stray.joint = None;
        stray.turn_by(turn_rad);
        self.lines[self.joints[index].line].servos.push(stray);
        true
    }

    /// Allows or forbids EEPROM writes from now on (rule R4).
    pub fn permit_eeprom(&mut self, permit: bool) {
        self.shared.referee.permit_eeprom(permit);
    }

    /// From now on no goal may differ from the last (rule R5).
    pub fn declare_stop(&mut self) {
        self.shared.referee.declare_stop();
    }

    /// What the referee has seen so far.
    pub fn verdict(&self) -> Verdict {
        self.shared.referee.verdict(self.now_ns)
    }
}
