//! The world: a robot's servos and CAN actuators on their lines, and the time they share.

mod board;
mod can;
mod options;
mod reach;
mod weight;

pub use options::{BadChecksum, MissingInChain, Options, TorqueSwitch, ZeroSpeed};
pub use reach::JointState;

use crate::SimError;
use crate::can::CanLine;
use crate::door::{Bell, Pace, PatientTime};
use crate::fault::plan::{Names, Place, Plan, Strike};
use crate::fault::{Fault, Struck};
use crate::journal::{Happening, Journal};
use crate::line::{Line, Plugged, Shared};
use crate::referee::{Referee, Verdict, When};
use crate::servo::Servo;
use crate::table::Model;
use gaitway_profiles::{Joint, Robot, Role, Servo as Profile};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeMap;
use std::sync::{Arc, Weak};

/// A virtual robot in virtual time. The same seed and the same host bytes at the same times give
/// the same bytes back.
pub struct World {
    now_ns: u64,
    /// All lines; those of CAN have only their name and whether they are plugged in here.
    lines: Vec<Line>,
    /// CAN lines by their number.
    can: BTreeMap<usize, CanLine>,
    shared: Shared,
    joints: Vec<Placed>,
    by_name: BTreeMap<String, usize>,
    /// A moment of real time and the world time it was then, once a door is open.
    pace: Option<Pace>,
    /// As everything was at first.
    start: Box<Start>,
    resets: u64,
    /// What its servos move, if it has weight.
    weight: Option<weight::Weight>,
    /// The board in its base, if it has one.
    board: Option<board::BaseBoard>,
    /// Of doors that are open.
    bells: Vec<Weak<Bell>>,
}

/// What a world begins with.
#[derive(Clone)]
struct Start {
    lines: Vec<Line>,
    can: BTreeMap<usize, CanLine>,
    shared: Shared,
}

/// Where a joint's servo or actuator is.
#[derive(Clone, Copy, Debug)]
struct Placed {
    place: Place,
    initial_rad: f64,
    offset_rad: f64,
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
        let shared = Shared {
            line_timing: options.line_timing,
            real_time: false,
            echo: options.echo,
            adapter_latency_ns: options.adapter_latency_ns,
            usb: options.usb,
            missing_in_chain: options.missing_in_chain,
            bad_checksum: options.bad_checksum,
            faults: Plan::default(),
            rng: ChaCha8Rng::seed_from_u64(options.seed),
            referee: Referee::new(robot.lines.len(), options.permit_eeprom),
            journal: Journal::default(),
        };
        let lines = robot.lines.iter().enumerate();
        let lines: Vec<Line> =
            lines.map(|(k, l)| Line::new(k, &l.name, l.baud_bps().unwrap_or(0), &shared)).collect();
        let start = Start { lines: Vec::new(), can: BTreeMap::new(), shared: shared.clone() };
        let mut world = World {
            now_ns: 0,
            lines,
            can: can::lines(robot, options.line_timing),
            shared,
            joints: Vec::new(),
            by_name,
            pace: None,
            start: Box::new(start),
            resets: 0,
            weight: None,
            board: None,
            bells: Vec::new(),
        };
        let mut models: BTreeMap<&str, Arc<Model>> = BTreeMap::new();
        for joint in &robot.joints {
            let line = robot.lines.iter().position(|line| line.name == joint.line);
            let line = line.ok_or_else(|| SimError::UnknownLine(joint.line.clone()))?;
            if world.can.contains_key(&line) {
                world.add_actuator(robot, joint, line)?;
                continue;
            }
            let profile =
                find(&joint.servo).ok_or_else(|| SimError::UnknownServo(joint.servo.clone()))?;
            let model = models.entry(&joint.servo).or_insert_with(|| Arc::new(Model::new(profile)));
            world.add(robot, joint, line, Arc::clone(model))?;
        }
        for servo in world.lines.iter_mut().flat_map(|line| &mut line.servos) {
            servo.zero_speed = options.zero_speed;
            servo.set_torque_switch(options.torque_switch);
        }
        world.add_board(robot)?;
        world.join_cases(robot);
        world.plan(robot, &options.faults)?;
        let (lines, can) = (world.lines.clone(), world.can.clone());
        *world.start = Start { lines, can, shared: world.shared.clone() };
        Ok(world)
    }

    /// Tells servos that are two axes in one case of each other.
    fn join_cases(&mut self, robot: &Robot) {
        for (joint, placed) in robot.joints.iter().zip(&self.joints) {
            let mate = joint.shares_case_with.as_ref().and_then(|name| self.by_name.get(name));
            let Some(mate) = mate.map(|&mate| self.joints[mate].place) else { continue };
            let place = placed.place;
            if mate.line == place.line
                && !self.can.contains_key(&place.line)
                && mate.servo != place.servo
            {
                let servos = &mut self.lines[place.line].servos;
                servos[place.servo].mate = Some(mate.servo);
                servos[mate.servo].mate = Some(place.servo);
            }
        }
    }

    fn plan(&mut self, robot: &Robot, faults: &[Fault]) -> Result<(), SimError> {
        let servos = robot.joints.iter().zip(&self.joints);
        let names = Names {
            lines: self.line_names(),
            can: self.can.keys().copied().collect(),
            servos: servos
                .map(|(joint, placed)| (joint.name.clone(), joint.id, placed.place))
                .collect(),
            boards: self.board.iter().map(|of| (of.name.clone(), of.id, of.place)).collect(),
        };
        for fault in faults {
            self.check_register(fault, &names)?;
            self.check_actuator(fault, &names)?;
        }
        self.shared.faults = Plan::new(faults, names, &mut self.shared.rng)?;
        self.run_until(0);
        Ok(())
    }

    /// A fault that sets a register must find one.
    fn check_register(&self, fault: &Fault, names: &Names) -> Result<(), SimError> {
        match fault {
            Fault::Perhaps { fault, .. } => self.check_register(fault, names),
            Fault::Register { joint, register, raw, .. } => {
                let place = names.servo(joint)?;
                let servo = self.lines[place.line].servos.get(place.servo);
                let Some(mut servo) = servo.cloned() else { return Ok(()) };
                if servo.force(register, *raw) {
                    return Ok(());
                }
                Err(SimError::BadServo {
                    joint: joint.clone(),
                    servo: servo.model.profile.name.clone(),
                    reason: format!("has no register {register:?} that can hold {raw}"),
                })
            }
            _ => Ok(()),
        }
    }

    fn add(
        &mut self,
        robot: &Robot,
        joint: &Joint,
        line: usize,
        model: Arc<Model>,
    ) -> Result<(), SimError> {
        let baud_bps = robot.lines[line].baud_bps().unwrap_or(0);
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
        servo.place((joint.initial_rad() + joint.offset_rad) / ratio);
        servo.mark_start();
        self.shared.referee.add(joint, line, profile);
        self.joints.push(Placed {
            place: Place { line, servo: self.lines[line].servos.len() },
            initial_rad: joint.initial_rad(),
            offset_rad: joint.offset_rad,
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

    /// Speed the servos of a line are set up for, bits per second; 0 of a CAN line.
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
            self.bear_until(self.now_ns);
            self.happen();
        }
        self.now_ns = self.now_ns.max(time_ns);
        self.bear_until(self.now_ns);
        self.pass_can();
    }

    /// When something is heard next on a line, or a fault strikes.
    fn next_event_ns(&self) -> Option<u64> {
        let hearing = self.lines.iter().filter_map(Line::next_hearing_ns);
        hearing.chain(self.next_can_ns()).chain(self.shared.faults.next_ns()).min()
    }

    /// Carries out the next event, a fault before a packet.
    fn happen(&mut self) {
        let now_ns = self.now_ns;
        let struck_before = self.shared.faults.struck_count();
        if let Some(planned) = self.shared.faults.strike(now_ns) {
            let Shared { faults, journal, .. } = &mut self.shared;
            let fresh = (faults.struck_count() - struck_before) as usize;
            for struck in faults.latest(fresh) {
                journal.note(now_ns, || Happening::Struck(struck.clone()));
            }
            if let Some(strike) = self.strike(planned.strike) {
                self.shared.faults.ends_with(planned.fault, strike);
            }
        } else if self.next_can_ns().is_some_and(|next_ns| next_ns <= now_ns) {
            self.happen_on_can();
        } else if let Some(line) = self
            .lines
            .iter_mut()
            .filter(|line| line.next_hearing_ns().is_some())
            .min_by_key(|line| line.next_hearing_ns())
        {
            line.hear_next(&mut self.shared);
        }
    }

    /// Something strikes: what undoes it, where that is known only now.
    fn strike(&mut self, strike: Strike) -> Option<Strike> {
        let now_ns = self.now_ns;
        let strike = self.strike_can(strike)?;
        let mut end = None;
        match strike {
            Strike::Silence { servo, until_ns } => {
                self.at(servo).silent.push(now_ns..until_ns);
            }
            Strike::Speak { servo, until_ns } => {
                self.at(servo).silent.retain(|span| span.end != until_ns);
            }
            Strike::Overload { servo } => self.at(servo).raise_overload(now_ns),
            Strike::Reboot { servo } => {
                self.at(servo).restart(now_ns, now_ns + crate::servo::BOOT_NS);
            }
            Strike::Brownout { until_ns } => {
                // However short it is, a servo that lost its power has to boot.
                let awake_ns = until_ns.max(now_ns + crate::servo::BOOT_NS);
                for servo in self.lines.iter_mut().flat_map(|line| &mut line.servos) {
                    servo.restart(now_ns, awake_ns);
                }
            }
            Strike::PowerBack { .. } => {
                for servo in self.lines.iter_mut().flat_map(|line| &mut line.servos) {
                    servo.power_back(now_ns);
                }
            }
            Strike::Stick { servo, stuck } => self.at(servo).motor.set_blocked(stuck),
            Strike::Freeze { servo, frozen } => {
                let servo = self.at(servo);
                servo.frozen = frozen.then(|| servo.present_position());
            }
            Strike::Jump { servo, counts } => self.displace(servo, |servo| servo.jump(counts)),
            // That there is such a register was seen before the start.
            Strike::Register { servo, register, raw } => {
                let before = self.at(servo).named(&register);
                self.displace(servo, |servo| {
                    let _ = servo.force(&register, raw);
                });
                end = before.map(|raw| Strike::Register { servo, register, raw });
            }
            Strike::Twin { servo, turn_rad } => {
                end = Some(Strike::Unplug { servo: self.duplicate_at(servo, turn_rad) });
            }
            Strike::Unplug { servo } => self.at(servo).unplug(now_ns),
            Strike::Slow { line, latency_ns, usb } => self.lines[line].slow_down(latency_ns, usb),
            Strike::AtSpeed { line } => {
                let Shared { adapter_latency_ns, usb, .. } = self.shared;
                self.lines[line].slow_down(adapter_latency_ns, usb);
            }
            Strike::HangUp { line } => {
                self.lines[line].pull_out();
                let plugged = false;
                self.shared.journal.note(now_ns, || Happening::Adapter { line, plugged });
            }
            Strike::PlugIn { line, link } => {
                self.lines[line].plug_in(link);
                let plugged = true;
                self.shared.journal.note(now_ns, || Happening::Adapter { line, plugged });
            }
            Strike::Block { line, until_ns, bytes } => self.lines[line].block(until_ns, bytes),
            Strike::Unblock { line } => self.lines[line].unblock(),
            Strike::Push { fault, servo, force_n } => self.push_body(fault, servo, force_n),
            Strike::Relent { fault } => self.relent(fault),
            Strike::Slope { slope_rad } => self.tilt_floor(slope_rad),
            Strike::Trouble { .. }
            | Strike::BusOff { .. }
            | Strike::Babble { .. }
            | Strike::Hush { .. } => {}
        }
        for line in &mut self.lines {
            line.report(When::at(now_ns), &mut self.shared);
        }
        end
    }

    /// Does something to a servo that may move its shaft, or what its encoder makes of it. (An
    /// encoder that jumps by a whole turn may read the same, and the servo goes after it.)
    fn displace<T>(&mut self, place: Place, change: impl FnOnce(&mut Servo) -> T) -> T {
        let servo = self.at(place);
        let place_of = |servo: &Servo| (servo.present_position(), servo.reading_offset());
        let before = place_of(servo);
        let done = change(servo);
        let moved = place_of(servo) != before;
        let (before, _) = before;
        if let Some(joint) = servo.joint.filter(|_| moved) {
            self.shared.referee.displaced(joint, before);
        }
        done
    }

    /// A servo, moved on to now.
    fn at(&mut self, place: Place) -> &mut Servo {
        let servo = &mut self.lines[place.line].servos[place.servo];
        servo.advance(self.now_ns);
        servo
    }

    /// The host starts to send on a line, after what it is sending already; returns at once how
    /// many bytes the line takes. That is all of them, unless it is blocked; bytes for a line that
    /// does not exist or has hung up are lost.
    pub fn transmit(&mut self, line: usize, bytes: &[u8], baud_bps: u32) -> usize {
        self.transmit_noticed(line, bytes, baud_bps, self.now_ns)
    }

    /// As [`World::transmit`], of bytes that may have been there since `earliest_ns`.
    pub(crate) fn transmit_noticed(
        &mut self,
        line: usize,
        bytes: &[u8],
        baud_bps: u32,
        earliest_ns: u64,
    ) -> usize {
        let times_ns = (earliest_ns.min(self.now_ns), self.now_ns);
        match self.lines.get_mut(line) {
            Some(line) => line.transmit(times_ns, bytes, baud_bps, &mut self.shared),
            None => bytes.len(),
        }
    }

    /// Until when a line takes no bytes from the host, if it is blocked.
    pub fn blocked_until_ns(&self, line: usize) -> Option<u64> {
        self.lines.get(line)?.blocked_until_ns(self.now_ns)
    }

    /// Which connection to a line this is: 1 at first, one more each time the adapter was plugged
    /// in again, none while it is pulled out. A host has lost its port when the number changes.
    pub fn connection(&self, line: usize) -> Option<u32> {
        let plugged = &self.lines.get(line)?.plugged;
        plugged.now.then_some(plugged.times)
    }

    /// How a door stands.
    pub(crate) fn plugged(&self, line: usize) -> Option<&Plugged> {
        self.lines.get(line).map(|line| &line.plugged)
    }

    /// Runs the world until at least one byte for the host is there, or until the deadline. Returns
    /// how many bytes were put into `buf`; time is then that of the last event needed.
    pub fn receive(&mut self, line: usize, buf: &mut [u8], deadline_ns: u64) -> usize {
        if line >= self.lines.len() {
            return 0;
        }
        loop {
            if self.lines[line].collect(self.now_ns, &mut self.shared.rng) > 0 {
                return self.lines[line].take(buf, self.now_ns, &mut self.shared.referee);
            }
            if !self.lines[line].plugged.now {
                return 0;
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
        if let Some(can) = self.can.get_mut(&line) {
            can.discard_input();
        }
        if let Some(line) = self.lines.get_mut(line) {
            line.collect(self.now_ns, &mut self.shared.rng);
            line.discard_ready();
        }
    }

    /// When something happens on a line that a host would notice, if nobody sends more.
    pub(crate) fn next_on_line_ns(&self, line: usize) -> Option<u64> {
        let fault = self.shared.faults.next_ns();
        let line = self.lines.get(line)?;
        let blocked = line.blocked_until_ns(self.now_ns);
        let own = line.next_hearing_ns().into_iter().chain(line.next_ready_ns());
        own.chain(self.next_can_ns()).chain(fault).chain(blocked).min()
    }

    /// Moves every servo on to now, so that a long wait is not made up for all at once.
    pub(crate) fn keep_up(&mut self) {
        let now_ns = self.now_ns;
        for line in &mut self.lines {
            line.servos.iter_mut().for_each(|servo| servo.advance(now_ns));
            line.report(When::at(now_ns), &mut self.shared);
        }
    }

    /// A door wants to hear when something changes that it does not do itself.
    pub(crate) fn add_bell(&mut self, bell: &Arc<Bell>) {
        self.bells.push(Arc::downgrade(bell));
    }

    /// Real time and world time run together from the first call on.
    pub(crate) fn pace(&mut self) -> Pace {
        self.shared.real_time = true;
        self.pace.get_or_insert_with(|| Pace::real(self.now_ns)).clone()
    }

    /// World time goes with this one from the first call on, unless it goes with real time already.
    pub(crate) fn patient_pace(&mut self, time: &Arc<PatientTime>) -> Pace {
        self.shared.real_time = true;
        self.pace.get_or_insert_with(|| Pace::patient(self.now_ns, Arc::clone(time))).clone()
    }

    /// The servo of a joint, which is not on a CAN line.
    fn servo(&self, joint: usize) -> Option<&Servo> {
        let place = self.joints[joint].place;
        self.lines[place.line].servos.get(place.servo)
    }

    /// Where the joint really is, whatever its registers say, rad.
    pub fn joint_position_rad(&self, joint: &str) -> Option<f64> {
        if let Some(actuator) = self.actuator(joint) {
            let Placed { ratio, offset_rad, .. } = self.joints[*self.by_name.get(joint)?];
            return Some(ratio * actuator.position_rad() - offset_rad);
        }
        let joint = *self.by_name.get(joint)?;
        let place = self.joints[joint];
        let mut servo = self.servo(joint)?.clone();
        servo.advance(self.now_ns);
        Some(place.initial_rad + place.ratio * servo.turned_rad())
    }

    /// How fast the joint really turns, rad/s.
    pub fn joint_velocity_rad_s(&self, joint: &str) -> Option<f64> {
        let ratio = self.joints[*self.by_name.get(joint)?].ratio;
        if let Some(actuator) = self.actuator(joint) {
            return Some(ratio * actuator.velocity_rad_s());
        }
        let mut servo = self.servo(*self.by_name.get(joint)?)?.clone();
        servo.advance(self.now_ns);
        Some(ratio * servo.velocity_rad_s())
    }

    /// How many statuses the servo of a joint has given so far, or frames its actuator.
    pub fn statuses(&self, joint: &str) -> Option<u64> {
        if let Some(actuator) = self.actuator(joint) {
            return Some(actuator.said);
        }
        Some(self.servo(*self.by_name.get(joint)?)?.statuses)
    }

    /// Turns a joint's shaft by hand, rad. Returns false if there is no such joint.
    pub fn place_joint(&mut self, joint: &str, position_rad: f64) -> bool {
        let Some(&index) = self.by_name.get(joint) else { return false };
        let Placed { place, initial_rad, offset_rad, ratio } = self.joints[index];
        if let Some(actuator) = self.actuator_mut(joint) {
            let before = (actuator.position_rad() * 1e6).round() as i64;
            actuator.place((position_rad + offset_rad) / ratio);
            self.shared.referee.displaced(index, before);
            return true;
        }
        self.displace(place, |servo| {
            servo.turn_by((position_rad - initial_rad) / ratio - servo.turned_rad());
        });
        true
    }

    /// Raw value of a register by its name in the profile.
    pub fn register(&self, joint: &str, register: &str) -> Option<i64> {
        let mut servo = self.servo(*self.by_name.get(joint)?)?.clone();
        servo.advance(self.now_ns);
        servo.named(register)
    }

    /// Whether the LED of a joint's servo shines; during an alarm it blinks.
    pub fn led_lit(&self, joint: &str) -> Option<bool> {
        let mut servo = self.servo(*self.by_name.get(joint)?)?.clone();
        servo.advance(self.now_ns);
        Some(servo.led_lit())
    }

    /// Sets a register's raw value past all rules, to set a scene. Present position, voltage and
    /// temperature set what they measure. Returns false if there is no such joint or register, or
    /// the value does not fit.
    pub fn set_register(&mut self, joint: &str, register: &str, raw: i64) -> bool {
        let Some(&index) = self.by_name.get(joint) else { return false };
        self.servo(index).is_some()
            && self.displace(self.joints[index].place, |servo| servo.force(register, raw))
    }

    /// Plugs in another servo like this joint's, with the same ID and registers, its shaft turned
    /// by `turn_rad`. Returns false if there is no such joint, or it is on a CAN line.
    pub fn duplicate(&mut self, joint: &str, turn_rad: f64) -> bool {
        let Some(&index) = self.by_name.get(joint) else { return false };
        if self.servo(index).is_none() {
            return false;
        }
        self.duplicate_at(self.joints[index].place, turn_rad);
        true
    }

    /// Where the stray is then. One that is plugged in no more makes room.
    fn duplicate_at(&mut self, place: Place, turn_rad: f64) -> Place {
        let mut stray = self.at(place).clone();
        stray.joint = None;
        stray.put_down();
        stray.turn_by(turn_rad);
        let servos = &mut self.lines[place.line].servos;
        let gone =
            |servo: &Servo| servo.joint.is_none() && !servo.attached && servo.model.has_shaft;
        let free = servos.iter().position(gone);
        match free.and_then(|free| servos.get_mut(free)) {
            Some(slot) => *slot = stray,
            None => servos.push(stray),
        }
        Place { line: place.line, servo: free.unwrap_or(servos.len() - 1) }
    }

    /// Allows or forbids EEPROM writes from now on (rule R4).
    pub fn permit_eeprom(&mut self, permit: bool) {
        self.shared.referee.permit_eeprom(permit);
    }

    /// From now on no goal may differ from the last (rule R5).
    pub fn declare_stop(&mut self) {
        self.shared.referee.declare_stop();
    }

    /// How many faults have struck so far; each damaged status is one.
    pub fn struck_count(&self) -> u64 {
        self.shared.faults.struck_count()
    }

    /// The faults that have struck since this was asked last, the latest 4096 of them.
    pub fn take_struck(&mut self) -> Vec<Struck> {
        self.shared.faults.take_struck()
    }

    /// What the referee has seen so far.
    pub fn verdict(&self) -> Verdict {
        self.shared.referee.verdict(self.now_ns)
    }
}
