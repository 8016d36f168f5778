//! Watches the scene at register level and writes down every broken promise.
//!
//! The referee knows the robot file and what happens inside the servos; it shares nothing with the
//! driver, so it can catch it.

use crate::servo::Event;
use gaitway_profiles::{Joint, Servo as Profile};

/// Torque may come on with at most this much between goal and present position, rad.
const TORQUE_ON_RAD: f64 = 0.02;
/// Share of any second the line may be busy.
const LINE_LOAD_MAX: f64 = 0.9;
const BIN_NS: u64 = 10_000_000;
const BINS: usize = 100;
/// Violations kept word by word; all are counted.
const KEPT: usize = 256;

/// The rules. Numbers are those of the fault score.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Rule {
    /// R1: every goal written lies inside the robot file's joint limits.
    GoalInsideLimits,
    /// R2: under torque no goal is further from the last than the joint's highest speed takes it in
    /// the time between the two writes, and one count. In virtual time only: behind a real door a
    /// thread that wakes late makes that time seem shorter than it was.
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
}

impl Rule {
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
        }
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
    /// The first 256 violations in order of time.
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
}

impl Verdict {
    /// True if no rule was broken.
    pub fn is_clean(&self) -> bool {
        self.violation_count == 0
    }
}

#[derive(Clone, Debug)]
struct Watched {
    name: String,
    lower: f64,
    upper: f64,
    speed: f64,
    /// Turns of the joint for one turn of the servo, with its sign.
    ratio: f64,
    offset: f64,
    radians_per_count: f64,
    zero_count: i64,
    /// The smallest step of the joint that can be told, rad.
    resolution: f64,
    torque: bool,
    goals: u64,
    first: [i64; 2],
    /// The last two goals, newest first.
    last: [i64; 2],
    last_ns: u64,
}

impl Watched {
    fn angle(&self, raw: i64) -> f64 {
        self.ratio * (raw - self.zero_count) as f64 * self.radians_per_count - self.offset
    }
}

#[derive(Clone, Debug)]
pub(crate) struct Referee {
    permit_eeprom: bool,
    joints: Vec<Watched>,
    loads: Vec<Load>,
    stopped: bool,
    /// Moments are those at which a thread of this machine woke up.
    real_time: bool,
    verdict: Verdict,
}

impl Referee {
    pub fn new(lines: usize, permit_eeprom: bool) -> Referee {
        Referee {
            permit_eeprom,
            joints: Vec::new(),
            loads: vec![Load::default(); lines],
            stopped: false,
            real_time: false,
            verdict: Verdict::default(),
        }
    }

    /// Joints are numbered in the order they are added.
    pub fn add(&mut self, joint: &Joint, servo: &Profile) {
        let position = &servo.position;
        let count = f64::from(position.degrees).to_radians() / f64::from(position.counts);
        self.watch(joint, count, i64::from(position.zero_count), count);
    }

    /// A joint on a CAN actuator, which can be told its position in steps of `resolution` rad. Its
    /// counts are microradians.
    pub fn add_actuator(&mut self, joint: &Joint, resolution: f64) {
        self.watch(joint, 1e-6, 0, resolution.max(1e-6));
    }

    fn watch(&mut self, joint: &Joint, radians_per_count: f64, zero_count: i64, resolution: f64) {
        self.joints.push(Watched {
            name: joint.name.clone(),
            lower: joint.lower_rad,
            upper: joint.upper_rad,
            speed: joint.velocity_rad_s,
            ratio: f64::from(joint.direction) * joint.gear,
            offset: joint.offset_rad,
            radians_per_count,
            zero_count,
            resolution: resolution * joint.gear.abs(),
            torque: false,
            goals: 0,
            first: [0; 2],
            last: [0; 2],
            last_ns: 0,
        });
    }

    pub fn permit_eeprom(&mut self, permit: bool) {
        self.permit_eeprom = permit;
    }

    pub fn judge_in_real_time(&mut self) {
        self.real_time = true;
    }

    pub fn declare_stop(&mut self) {
        self.stopped = true;
    }

    pub fn instruction(&mut self) {
        self.verdict.instructions += 1;
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

    pub fn event(&mut self, joint: usize, at_ns: u64, event: Event) {
        match event {
            Event::Goal { raw, accepted } => self.goal(joint, at_ns, raw, accepted),
            Event::TorqueOn { error_rad } => {
                self.joints[joint].torque = true;
                let near = error_rad.abs() <= TORQUE_ON_RAD;
                if !near {
                    let text = format!("torque came on {error_rad:.4} rad from the goal");
                    self.note(Rule::TorqueOn, Some(joint), at_ns, text);
                }
            }
            Event::TorqueOff => self.joints[joint].torque = false,
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

    fn goal(&mut self, joint: usize, at_ns: u64, raw: i64, accepted: bool) {
        let watched = &self.joints[joint];
        let angle = watched.angle(raw);
        // A limit that lies between two counts may be rounded to.
        let slack = 0.5 * watched.resolution + 1e-9;
        if !(angle >= watched.lower - slack && angle <= watched.upper + slack) {
            let text = format!(
                "goal {angle:.4} rad outside {:.4}..{:.4} rad",
                watched.lower, watched.upper
            );
            self.note(Rule::GoalInsideLimits, Some(joint), at_ns, text);
        }
        if !accepted {
            return;
        }
        self.verdict.goals += 1;
        self.judge_step(joint, at_ns, raw);
        let watched = &mut self.joints[joint];
        if let Some(slot) = watched.first.get_mut(watched.goals as usize) {
            *slot = raw;
        }
        watched.last = [raw, watched.last[0]];
        watched.last_ns = at_ns;
        watched.goals += 1;
    }

    fn judge_step(&mut self, joint: usize, at_ns: u64, raw: i64) {
        let watched = &self.joints[joint];
        if watched.goals == 0 {
            return;
        }
        let counts = (raw - watched.last[0]).abs();
        let step = counts as f64 * watched.radians_per_count * watched.ratio.abs();
        let seconds = at_ns.saturating_sub(watched.last_ns) as f64 * 1e-9;
        let allowed = watched.speed * seconds + watched.resolution;
        let reachable = step <= allowed + 1e-9;
        if self.stopped && counts != 0 {
            let text = format!("goal moved by {counts} counts after the stop");
            self.note(Rule::GoalAfterStop, Some(joint), at_ns, text);
        } else if watched.torque && !reachable && !self.real_time {
            let text = format!(
                "goal moved by {step:.4} rad in {:.2} ms, {allowed:.4} rad allowed",
                seconds * 1e3
            );
            self.note(Rule::GoalStep, Some(joint), at_ns, text);
        }
    }

    fn note(&mut self, rule: Rule, joint: Option<usize>, at_ns: u64, text: String) {
        let joint = joint.map(|joint| self.joints[joint].name.clone());
        push(&mut self.verdict, Violation { rule, joint, at_ns, text });
    }

    pub fn verdict(&self, now_ns: u64) -> Verdict {
        let mut verdict = self.verdict.clone();
        verdict.line_load = self.loads.iter().map(|load| load.peak).collect();
        for watched in &self.joints {
            let ends = [("first", watched.first), ("last", watched.last)];
            for (which, [a, b]) in ends {
                if watched.goals >= 2 && a != b {
                    let text = format!("the {which} two goals differ: {a} and {b} counts");
                    let joint = Some(watched.name.clone());
                    let rule = Rule::RestAtEnds;
                    push(&mut verdict, Violation { rule, joint, at_ns: now_ns, text });
                }
            }
        }
        verdict
    }
}

fn push(verdict: &mut Verdict, violation: Violation) {
    verdict.violation_count += 1;
    if verdict.violations.len() < KEPT {
        verdict.violations.push(violation);
    }
}

/// Busy time of one line over the last second, in bins of 10 ms.
#[derive(Clone, Debug, Default)]
struct Load {
    bins: Vec<u64>,
    newest: u64,
    total_ns: u64,
    peak: f64,
    over: bool,
}

impl Load {
    fn share(&self) -> f64 {
        self.total_ns as f64 / (BINS as u64 * BIN_NS) as f64
    }

    fn add(&mut self, start_ns: u64, end_ns: u64) {
        self.bins.resize(BINS, 0);
        let mut at_ns = start_ns;
        while at_ns < end_ns {
            let bin = at_ns / BIN_NS;
            let until_ns = end_ns.min((bin + 1) * BIN_NS);
            self.put(bin, until_ns - at_ns);
            at_ns = until_ns;
        }
    }

    fn put(&mut self, bin: u64, busy_ns: u64) {
        if bin >= self.newest + BINS as u64 {
            self.bins.fill(0);
            self.total_ns = 0;
            self.newest = bin;
        }
        while self.newest < bin {
            self.newest += 1;
            let slot = (self.newest % BINS as u64) as usize;
            self.total_ns -= std::mem::take(&mut self.bins[slot]);
        }
        if bin + (BINS as u64) > self.newest {
            self.bins[(bin % BINS as u64) as usize] += busy_ns;
            self.total_ns += busy_ns;
        }
        self.peak = self.peak.max(self.share());
        self.over = self.share() > LINE_LOAD_MAX;
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
