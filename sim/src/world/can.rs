//! The CAN lines of a world: they run with its clock, its faults and its referee.

use super::{Placed, World};
use crate::SimError;
use crate::can::{Actuator, BOOT_NS, CanFrame, CanHeard, CanLine, CanOptions, QueueFull, Said};
use crate::fault::plan::{Names, Place, Strike};
use crate::fault::{Fault, damage_frame};
use crate::journal::Happening;
use crate::referee::When;
use gaitway_profiles::{Joint, Robot};
use std::collections::BTreeMap;

/// The robot's CAN lines, still without actuators. Without line timing bits take no time.
pub(super) fn lines(robot: &Robot, line_timing: bool) -> BTreeMap<usize, CanLine> {
    let lines = robot.lines.iter().enumerate();
    let speeds = lines.filter_map(|(k, line)| Some((k, line.can()?)));
    speeds
        .map(|(k, speed)| {
            let options = CanOptions {
                bitrate_bps: speed.bitrate_bps,
                data_bitrate_bps: speed.data_bitrate_bps.unwrap_or(speed.bitrate_bps),
                timing: line_timing,
                ..CanOptions::default()
            };
            (k, CanLine::new(options, Vec::new()))
        })
        .collect()
}

impl World {
    pub(super) fn add_actuator(
        &mut self,
        robot: &Robot,
        joint: &Joint,
        line: usize,
    ) -> Result<(), SimError> {
        let wrong = |reason: String| SimError::BadServo {
            joint: joint.name.clone(),
            servo: joint.servo.clone(),
            reason,
        };
        let profile = gaitway_profiles::actuator(&joint.servo)
            .map_err(|_| SimError::UnknownServo(joint.servo.clone()))?;
        let mut actuator =
            Actuator::with(&profile, joint.id).map_err(|error| wrong(error.to_string()))?;
        let ratio = f64::from(joint.direction) * joint.gear;
        actuator.place((joint.initial_rad() + joint.offset_rad) / ratio);
        actuator.set_feedback_rate(robot.rate_hz.ceil() as u32);
        actuator.set_answer_id(joint.answer_id.unwrap_or(0));
        if let Some(seconds) = joint.timeout_configured_s {
            actuator.set_timeout(Some((seconds * 1e9) as u64));
        }
        let resolution = profile.ranges.map_or(0.0, |ranges| ranges.position_rad / 32_767.5);
        self.shared.referee.add_actuator(joint, line, resolution);
        let Some(can) = self.can.get_mut(&line) else { return Ok(()) };
        self.joints.push(Placed {
            place: Place { line, servo: can.actuators().len() },
            initial_rad: joint.initial_rad(),
            offset_rad: joint.offset_rad,
            ratio,
        });
        can.add(actuator);
        Ok(())
    }

    /// What a CAN actuator cannot suffer.
    pub(super) fn check_actuator(&self, fault: &Fault, names: &Names) -> Result<(), SimError> {
        let (joint, for_actuators) = match fault {
            Fault::Perhaps { fault, .. } => return self.check_actuator(fault, names),
            Fault::PositionJump { joint, .. }
            | Fault::Register { joint, .. }
            | Fault::Twin { joint, .. } => (joint, false),
            Fault::Trouble { joint, .. } => (joint, true),
            _ => return Ok(()),
        };
        let place = names.servo(joint)?;
        let reason = match (self.can.contains_key(&place.line), for_actuators) {
            (true, true) | (false, false) => return Ok(()),
            (true, false) => "is a CAN actuator, and has no such fault",
            (false, true) => "is no CAN actuator, and has no such fault",
        };
        Err(SimError::BadServo {
            joint: joint.clone(),
            servo: "on that line".to_string(),
            reason: reason.to_string(),
        })
    }

    /// Whether a line is a CAN line.
    pub fn is_can(&self, line: usize) -> bool {
        self.can.contains_key(&line)
    }

    /// A CAN line, to look at.
    pub fn can_line(&self, line: usize) -> Option<&CanLine> {
        self.can.get(&line)
    }

    /// A CAN line, to bring it into a state past the host.
    pub fn can_line_mut(&mut self, line: usize) -> Option<&mut CanLine> {
        self.can.get_mut(&line)
    }

    /// The CAN actuator of a joint.
    pub fn actuator(&self, joint: &str) -> Option<&Actuator> {
        let Place { line, servo } = self.joints[*self.by_name.get(joint)?].place;
        self.can.get(&line)?.actuators().get(servo)
    }

    /// The CAN actuator of a joint, to place or break it past the line.
    pub fn actuator_mut(&mut self, joint: &str) -> Option<&mut Actuator> {
        let Place { line, servo } = self.joints[*self.by_name.get(joint)?].place;
        self.can.get_mut(&line)?.actuators_mut().get_mut(servo)
    }

    /// The host queues a frame for a CAN line. What is for a line that does not exist, or is
    /// pulled out or off the bus, is lost.
    ///
    /// # Errors
    /// The queue is full; time must pass first.
    pub fn can_send(&mut self, line: usize, frame: CanFrame) -> Result<(), QueueFull> {
        self.can_send_noticed(line, frame, self.now_ns)
    }

    /// As [`World::can_send`], of a frame that may have been there since `earliest_ns`.
    pub(crate) fn can_send_noticed(
        &mut self,
        line: usize,
        frame: CanFrame,
        earliest_ns: u64,
    ) -> Result<(), QueueFull> {
        let plugged = self.lines.get(line).is_some_and(|line| line.plugged.now);
        match self.can.get_mut(&line).filter(|_| plugged) {
            Some(can) => can.send_noticed(frame, earliest_ns),
            None => Ok(()),
        }
    }

    /// Runs the world until the host has heard something on a CAN line, or until `until_ns`; time
    /// is then that of the last event needed.
    pub fn can_receive(&mut self, line: usize, until_ns: u64) -> Option<CanHeard> {
        loop {
            let can = self.can.get_mut(&line)?;
            if let Some(heard) = can.receive() {
                return Some(heard);
            }
            let plugged = self.lines.get(line).is_some_and(|line| line.plugged.now);
            if !plugged || self.now_ns >= until_ns {
                return None;
            }
            let next_ns = self.next_event_ns().unwrap_or(until_ns).min(until_ns);
            self.run_until(next_ns);
        }
    }

    /// When something happens next on a CAN line.
    pub(super) fn next_can_ns(&self) -> Option<u64> {
        self.can.values().filter_map(CanLine::next_event_ns).min()
    }

    /// Carries out the next event of the CAN lines.
    pub(super) fn happen_on_can(&mut self) {
        let lines = self.can.iter_mut().filter(|(_, can)| can.next_event_ns().is_some());
        let Some((&line, can)) = lines.min_by_key(|(_, can)| can.next_event_ns()) else { return };
        let happened = can.happen();
        if let Some((from_host, frame)) = happened.passed {
            let frame = || Happening::Frame { line, from_host, frame };
            self.shared.journal.note(self.now_ns, frame);
        }
        let joint_of = |actuator| {
            let place = Place { line, servo: actuator };
            self.joints.iter().position(|placed| placed.place == place)
        };
        let when = |at_ns| When { earliest_ns: can.earliest_ns(at_ns), latest_ns: at_ns };
        if let Some(asked_ns) = happened.asked_ns {
            self.shared.referee.instruction(line, when(asked_ns));
        }
        if let Some(busy_ns) = happened.busy_ns {
            match happened.asked_ns {
                Some(_) => self.shared.referee.busy(line, busy_ns.start, busy_ns.end),
                None => self.shared.referee.status(line, busy_ns.start, busy_ns.end),
            }
        }
        for (actuator, at_ns, event) in happened.events {
            if let Some(joint) = joint_of(actuator) {
                self.shared.tell(joint, when(at_ns), event);
            }
        }
        if let Some((actuator, told_ns)) = happened.had
            && let Some(joint) = joint_of(actuator)
        {
            self.shared.referee.had(joint, told_ns, self.now_ns);
        }
        let mut said = happened.said;
        for said in &mut said {
            if let (Some(raw), Some(joint)) = (said.told, joint_of(said.actuator)) {
                self.shared.referee.measured(joint, self.now_ns, raw);
                said.told_ns = Some(self.now_ns);
            }
        }
        for said in said {
            self.say(line, said);
        }
    }

    /// An actuator's frame goes out, with what befalls it.
    fn say(&mut self, line: usize, said: Said) {
        let Some(can) = self.can.get_mut(&line) else { return };
        let Said { actuator, ready_ns, frame, told, mut told_ns } = said;
        let Some(speaker) = can.actuators_mut().get_mut(actuator) else { return };
        let nth = speaker.said;
        speaker.said += 1;
        let (mut frames, mut late_ns) = (vec![frame], 0);
        if !self.shared.faults.spares_statuses() {
            let place = Place { line, servo: actuator };
            let damages = self.shared.befall(place, nth, self.now_ns);
            let rng = &mut self.shared.rng;
            if !damages.is_empty()
                && let Some(frame) = frames.pop()
            {
                (frames, late_ns) = damage_frame(frame, &damages, can.last_of_host(), rng);
                told_ns = None;
            }
        }
        for frame in frames {
            let ready_ns = ready_ns + late_ns;
            can.queue(Said { actuator, ready_ns, frame, told, told_ns });
        }
    }

    /// Moves every CAN line on to now.
    pub(super) fn pass_can(&mut self) {
        for can in self.can.values_mut() {
            can.pass(self.now_ns);
        }
    }

    /// Carries out a strike that concerns a CAN line or actuator; gives back what does not.
    pub(super) fn strike_can(&mut self, strike: Strike) -> Option<Strike> {
        let now_ns = self.now_ns;
        self.pass_can();
        match strike {
            Strike::BusOff { line, bus_off } => {
                self.can.get_mut(&line)?.set_bus_off(bus_off);
                return None;
            }
            Strike::Babble { line, frame, period_ns, until_ns } => {
                self.can.get_mut(&line)?.babble(frame, period_ns, until_ns);
                return None;
            }
            Strike::Hush { line, frame } => {
                self.can.get_mut(&line)?.hush(&frame);
                return None;
            }
            // Those of other lines go on with the rest.
            Strike::Brownout { until_ns } => {
                for actuator in self.can.values_mut().flat_map(CanLine::actuators_mut) {
                    actuator.restart(until_ns);
                }
            }
            Strike::PowerBack { until_ns } => {
                for actuator in self.can.values_mut().flat_map(CanLine::actuators_mut) {
                    actuator.power_back(until_ns);
                }
            }
            Strike::HangUp { line } | Strike::PlugIn { line, .. } => {
                if let Some(can) = self.can.get_mut(&line) {
                    can.pull_out();
                }
            }
            Strike::Block { line, until_ns, .. } => {
                if let Some(can) = self.can.get_mut(&line) {
                    can.hold(until_ns);
                    return None;
                }
            }
            Strike::Unblock { line } => {
                if let Some(can) = self.can.get_mut(&line) {
                    can.hold(now_ns);
                    return None;
                }
            }
            Strike::Silence { servo, .. }
            | Strike::Speak { servo, .. }
            | Strike::Overload { servo }
            | Strike::Reboot { servo }
            | Strike::Stick { servo, .. }
            | Strike::Freeze { servo, .. }
            | Strike::Trouble { servo, .. } => {
                if let Some(can) = self.can.get_mut(&servo.line) {
                    let actuator = can.actuators_mut().get_mut(servo.servo)?;
                    strike_actuator(actuator, &strike, now_ns);
                    return None;
                }
            }
            _ => {}
        }
        Some(strike)
    }
}

fn strike_actuator(actuator: &mut Actuator, strike: &Strike, now_ns: u64) {
    match *strike {
        Strike::Silence { until_ns, .. } => actuator.be_silent(now_ns..until_ns),
        Strike::Speak { until_ns, .. } => actuator.speak_again(until_ns),
        Strike::Overload { .. } => actuator.overload(),
        Strike::Reboot { .. } => actuator.restart(now_ns + BOOT_NS),
        Strike::Stick { stuck, .. } => actuator.set_stuck(stuck),
        Strike::Freeze { frozen, .. } => actuator.set_frozen(frozen),
        Strike::Trouble { trouble, .. } => actuator.set_trouble(trouble),
        _ => {}
    }
}
