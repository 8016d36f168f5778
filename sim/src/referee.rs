//! Watches the scene at register level and writes down every broken promise.
//!
//! The referee knows the robot file and what happens inside the servos; it shares nothing with the
//! driver, so it can catch it.

mod load;
#[cfg(test)]
mod tests;
mod tracking;
mod watched;

use crate::servo::Event;
use gaitway_profiles::{Joint, Servo as Profile};
use load::Load;
use std::collections::BTreeMap;
use watched::{Goal, Watched};

/// Torque may come on with at most this much between goal and present position, rad.
const TORQUE_ON_RAD: f64 = 0.02;
/// A goal that stood while its host said nothing for longer than this is no sample of a motion.
const LONGEST_PAUSE_NS: u64 = 100_000_000;
/// Violations kept word by word; all are counted.
const KEPT: usize = 1024;

/// The rules. Numbers are those of the fault score.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Rule {
    /// R1: every goal written lies inside the robot file's joint limits.
    GoalInsideLimits,
    /// R2: under torque no goal is further from the last than the joint's highest speed takes it in
    /// the time between the two writes, and one count. A pause in which the host says nothing on the
    /// line counts as 100 ms at most, for the joint has come to its goal meanwhile. A goal at which
    /// the joint stands already (0.02 rad) may always be written: it moves nothing.
    ///
    /// Behind a door a goal's time is known within bounds only: the program wrote it after the door
    /// had last looked and found nothing, and before the door had read it. A step breaks the rule if
    /// there are no moments within these bounds, in the order of the goals, at which the step and
    /// all before it would have been legal. They are found by giving each goal the earliest moment
    /// that the goals before it leave. So a door that wakes late makes the referee miss a step, and
    /// never see one that was none.
    GoalStep,
    /// R2b: the first two goals written to a joint are equal, and the last two.
    RestAtEnds,
    /// R3: torque comes on only with the goal within 0.02 rad of the present position.
    TorqueOn,
    /// R4: nothing is written to EEPROM without permission.
    Eeprom,
    /// R5: after a declared stop no goal differs from the last before it.
    GoalAfterStop,
    /// R6: the host does not talk before the statuses it asked for can be over.
    ReplyWindow,
    /// R10: the line is busy for at most 90 % of any second.
    LineLoad,
    /// R11: under torque a goal goes no further from the joint than 0.35 rad and what the goal has
    /// gone, to and fro, since the joint was read (its commanded speed, summed over that time).
    ///
    /// The joint is where its host last read it: the newest position that a servo told, by its own
    /// encoder, in a status which the host has taken from the line undamaged. (Where one status of
    /// an answer was damaged none of it counts as read, nor what is taken after the host has said
    /// something else: that answer was late.) Where it was when torque came on counts as
    /// read. What moves the joint after that, a hand, a load or a spring, cannot be known yet and
    /// does not count. After a fault or a hand of the simulator has turned the shaft, or made the
    /// encoder jump, the joint counts as standing anywhere between where it reads and where it was
    /// the moment before, until it has been read within 0.35 rad of its goal for half a second. And
    /// a goal that stays, or comes nearer, breaks nothing: only a goal that goes away is the host's
    /// doing.
    ///
    /// A host that reads joints in turn has more room, by what its own goals go in the meantime. One
    /// that drives on a joint that does not follow breaks this rule.
    GoalDistance,
    /// R12: under torque a joint's goal speed changes by at most twice the joint's highest
    /// acceleration times the time that takes, and comes to zero: the last two goals are equal.
    ///
    /// Goals sample a motion at uneven times. The step between two of them, divided by its time, is
    /// the motion's mean speed over that time; and of a motion with acceleration at most `a` the
    /// means over two adjacent spans differ by at most `a` times the time between their middles,
    /// exactly. Each goal is rounded to a count, so a mean may be off by one count in its span. A
    /// joint was at rest when torque came on. Pauses, and goals at which the joint stands, are as in
    /// R2; after such a goal the joint is at rest. Behind a door the rule is broken if it is for all
    /// spans within the bounds of the goals' times.
    SpeedChange,
}

impl Rule {
    /// All rules, in the order of their numbers.
    pub const ALL: [Rule; 10] = [
        Rule::GoalInsideLimits,
        Rule::GoalStep,
        Rule::RestAtEnds,
        Rule::TorqueOn,
        Rule::Eeprom,
        Rule::GoalAfterStop,
        Rule::ReplyWindow,
        Rule::LineLoad,
        Rule::GoalDistance,
        Rule::SpeedChange,
    ];

    /// Short name, e.g. `R2b`.
    pub fn code(self) -> &'static str {
        match self {
            Rule::GoalInsideLimits => "R1",
            Rule::GoalStep => "R2",
            Rule::RestAtEnds => "R2b",
            Rule::TorqueOn => "R3",
            Rule::Eeprom => "R4",
            Rule::GoalAfterStop => "R5",
            Rule::ReplyWindow => "R6",
            Rule::LineLoad => "R10",
            Rule::GoalDistance => "R11",
            Rule::SpeedChange => "R12",
        }
    }

    /// The rule, as a person reads it.
    pub fn words(self) -> &'static str {
        match self {
            Rule::GoalInsideLimits => "goals stay inside the joint's limits",
            Rule::GoalStep => "no goal steps further than its joint can turn meanwhile",
            Rule::RestAtEnds => {
                "a motion begins and ends at rest: its first two goals are equal, and its last two"
            }
            Rule::TorqueOn => "torque comes on with the goal where the joint stands",
            Rule::Eeprom => {
                "EEPROM, kept at power-off, is written with permission only; a client that is meant to write it: simulate --permit-eeprom"
            }
            Rule::GoalAfterStop => "no goal moves after a stop",
            Rule::ReplyWindow => "nobody talks while an answer is due",
            Rule::LineLoad => "a line is busy for at most 90 % of any second",
            Rule::GoalDistance => "a joint that does not follow is not driven on",
            Rule::SpeedChange => "speed is gained and lost no faster than the joint can",
        }
    }

    /// What a careful host does, as the rest of that sentence, where the rule says no more than
    /// that: other programs may have their reasons to do without.
    pub fn of_a_careful_host(self) -> Option<&'static str> {
        Some(match self {
            Rule::GoalStep => "lets no goal step further than its joint can turn meanwhile",
            Rule::RestAtEnds => "begins and ends a motion at rest",
            Rule::TorqueOn => "switches torque on with the goal where the joint stands",
            Rule::GoalAfterStop => "moves no goal after a stop",
            Rule::GoalDistance => "does not drive on a joint that does not follow",
            Rule::SpeedChange => "gains and loses speed no faster than the joint can",
            Rule::GoalInsideLimits | Rule::Eeprom | Rule::ReplyWindow | Rule::LineLoad => {
                return None;
            }
        })
    }
}

/// One broken rule.
#[derive(Clone, Debug, PartialEq)]
pub struct Violation {
    /// Which rule.
    pub rule: Rule,
    /// Whose servo, where the rule is about one.
    pub joint: Option<String>,
    /// World time, ns.
    pub at_ns: u64,
    /// What happened, with numbers.
    pub text: String,
}

/// What the referee saw.
#[derive(Clone, Debug, Default)]
pub struct Verdict {
    /// The first 1024 violations in order of time; those of a motion's end come last.
    pub violations: Vec<Violation>,
    /// All violations.
    pub violation_count: u64,
    /// Goals written and accepted.
    pub goals: u64,
    /// Instructions heard.
    pub instructions: u64,
    /// Statuses sent.
    pub statuses: u64,
    /// Busiest second of each line, as a share of that second. Without line timing 0.
    pub line_load: Vec<f64>,
    counts: BTreeMap<Rule, u64>,
}

impl Verdict {
    /// True if no rule was broken.
    pub fn is_clean(&self) -> bool {
        self.violation_count == 0
    }

    /// How often a rule was broken.
    pub fn count(&self, rule: Rule) -> u64 {
        self.counts.get(&rule).copied().unwrap_or(0)
    }

    /// Takes out the violations that are excused, and says how many they were. Those that are
    /// counted only, since there were too many, stay.
    pub fn excuse(&mut self, excused: impl Fn(&Violation) -> bool) -> u64 {
        let (out, left): (Vec<_>, Vec<_>) =
            std::mem::take(&mut self.violations).into_iter().partition(excused);
        self.violations = left;
        for violation in &out {
            self.violation_count -= 1;
            if let Some(count) = self.counts.get_mut(&violation.rule) {
                *count -= 1;
            }
        }
        out.len() as u64
    }

    fn push(&mut self, violation: Violation) {
        self.violation_count += 1;
        *self.counts.entry(violation.rule).or_default() += 1;
        if self.violations.len() < KEPT {
            self.violations.push(violation);
        }
    }
}

/// When something happened: not before the one moment, and by the other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct When {
    pub earliest_ns: u64,
    pub latest_ns: u64,
}

impl When {
    /// At a moment that is known.
    pub fn at(at_ns: u64) -> When {
        When { earliest_ns: at_ns, latest_ns: at_ns }
    }

    pub fn is_certain(self) -> bool {
        self.earliest_ns == self.latest_ns
    }
}

/// When the host last spoke on a line, and how long it had paused there before, beyond what counts.
#[derive(Clone, Copy, Debug, Default)]
struct Spoken {
    last_ns: u64,
    paused_ns: u64,
}

#[derive(Clone, Debug)]
pub(crate) struct Referee {
    permit_eeprom: bool,
    joints: Vec<Watched>,
    loads: Vec<Load>,
    spoken: Vec<Spoken>,
    stopped: bool,
    verdict: Verdict,
}

impl Referee {
    pub fn new(lines: usize, permit_eeprom: bool) -> Referee {
        Referee {
            permit_eeprom,
            joints: Vec::new(),
            loads: vec![Load::default(); lines],
            spoken: vec![Spoken::default(); lines],
            stopped: false,
            verdict: Verdict::default(),
        }
    }

    /// Joints are numbered in the order they are added.
    pub fn add(&mut self, joint: &Joint, line: usize, servo: &Profile) {
        let position = &servo.position;
        let count = f64::from(position.degrees).to_radians() / f64::from(position.counts);
        let zero = i64::from(position.zero_count);
        self.joints.push(Watched::new(joint, line, count, zero, count));
    }

    /// A joint on a CAN actuator, which can be told its position in steps of `resolution` rad. Its
    /// counts are microradians.
    pub fn add_actuator(&mut self, joint: &Joint, line: usize, resolution: f64) {
        self.joints.push(Watched::new(joint, line, 1e-6, 0, resolution.max(1e-6)));
    }

    pub fn permit_eeprom(&mut self, permit: bool) {
        self.permit_eeprom = permit;
    }

    pub fn declare_stop(&mut self) {
        self.stopped = true;
    }

    /// The host has said something on a line.
    pub fn instruction(&mut self, line: usize, when: When) {
        self.verdict.instructions += 1;
        if let Some(spoken) = self.spoken.get_mut(line) {
            let silent_ns = when.earliest_ns.saturating_sub(spoken.last_ns);
            spoken.paused_ns += silent_ns.saturating_sub(LONGEST_PAUSE_NS);
            spoken.last_ns = when.latest_ns;
        }
    }

    /// The host began to talk at `start_ns` although statuses were due until `due_ns`.
    pub fn talked_early(&mut self, line: usize, start_ns: u64, due_ns: u64) {
        let early_us = (due_ns - start_ns) as f64 * 1e-3;
        let text = format!(
            "line {line}: the host talked {early_us:.1} us before the statuses it had asked for \
             could be over"
        );
        self.note(Rule::ReplyWindow, None, start_ns, text);
    }

    pub fn status(&mut self, line: usize, start_ns: u64, end_ns: u64) {
        self.verdict.statuses += 1;
        self.busy(line, start_ns, end_ns);
    }

    pub fn busy(&mut self, line: usize, start_ns: u64, end_ns: u64) {
        let Some(load) = self.loads.get_mut(line) else { return };
        let was_over = load.over;
        load.add(start_ns, end_ns);
        if load.over && !was_over {
            let percent = load.share() * 100.0;
            let text = format!("line {line} was busy for {percent:.1} % of the last second");
            self.note(Rule::LineLoad, None, end_ns, text);
        }
    }

    pub fn event(&mut self, joint: usize, when: When, event: Event) {
        let at_ns = when.latest_ns;
        let line = self.joints[joint].line;
        let paused_ns = self.spoken.get(line).map_or(0, |spoken| spoken.paused_ns);
        match event {
            Event::Goal { raw, accepted, off_rad, speed_rad_s } => {
                let here = self.joints[joint].stands_there(off_rad, speed_rad_s);
                self.goal(joint, Goal { raw, when, paused_ns, here }, accepted);
            }
            Event::TorqueOn { goal, present, error_rad } => {
                let goal = Goal { raw: goal, when, paused_ns, here: false };
                self.joints[joint].torque_on(goal, present);
                let near = error_rad.abs() <= TORQUE_ON_RAD;
                if !near {
                    let text = format!("torque came on {error_rad:.4} rad from the goal");
                    self.note(Rule::TorqueOn, Some(joint), at_ns, text);
                }
            }
            Event::TorqueOff => self.joints[joint].torque_off(),
            Event::HostSilent => self.joints[joint].forsake(),
            Event::Eeprom { address } => {
                if !self.permit_eeprom {
                    let text = format!("EEPROM address {address} was written without permission");
                    self.note(Rule::Eeprom, Some(joint), at_ns, text);
                }
            }
            Event::Kept(what) => {
                if !self.permit_eeprom {
                    let text = format!("{what} was changed for good without permission");
                    self.note(Rule::Eeprom, Some(joint), at_ns, text);
                }
            }
        }
    }

    /// A servo tells the host where its shaft is.
    pub fn measured(&mut self, joint: usize, at_ns: u64, raw: i64) {
        self.joints[joint].measured(at_ns, raw);
    }

    /// What the servo told at `measured_ns` is in the host's hands, whole.
    pub fn had(&mut self, joint: usize, measured_ns: u64, now_ns: u64) {
        self.joints[joint].had(measured_ns, now_ns);
    }

    /// A hand or a fault turned a shaft, or what its encoder makes of it, away from `before`.
    pub fn displaced(&mut self, joint: usize, before: i64) {
        self.joints[joint].displaced(before);
    }

    fn goal(&mut self, joint: usize, goal: Goal, accepted: bool) {
        let at_ns = goal.when.latest_ns;
        if let Some(text) = self.joints[joint].judge_place(goal.raw) {
            self.note(Rule::GoalInsideLimits, Some(joint), at_ns, text);
        }
        if !accepted {
            return;
        }
        self.verdict.goals += 1;
        let after_stop = self.joints[joint].judge_stop(goal.raw).filter(|_| self.stopped);
        let broken = self.joints[joint].take(goal);
        if let Some(text) = after_stop {
            self.note(Rule::GoalAfterStop, Some(joint), at_ns, text);
        } else {
            for (rule, text) in broken {
                self.note(rule, Some(joint), at_ns, text);
            }
        }
    }

    fn note(&mut self, rule: Rule, joint: Option<usize>, at_ns: u64, text: String) {
        let joint = joint.map(|joint| self.joints[joint].name.clone());
        self.verdict.push(Violation { rule, joint, at_ns, text });
    }

    pub fn verdict(&self, now_ns: u64) -> Verdict {
        let mut verdict = self.verdict.clone();
        verdict.line_load = self.loads.iter().map(|load| load.peak).collect();
        for watched in &self.joints {
            for (rule, text) in watched.judge_ends() {
                let joint = Some(watched.name.clone());
                verdict.push(Violation { rule, joint, at_ns: now_ns, text });
            }
        }
        verdict
    }
}

impl std::fmt::Display for Violation {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} at {:.3} s", self.rule.code(), self.at_ns as f64 / 1e9)?;
        if let Some(joint) = &self.joint {
            write!(f, ", joint {joint}")?;
        }
        write!(f, ": {}", self.text)
    }
}
