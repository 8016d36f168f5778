//! One joint's goals: how far, how fast and how abruptly they may go.

use super::tracking::Tracking;
use super::{Rule, TORQUE_ON_RAD, When};
use gaitway_profiles::{Joint, counted};

/// A joint that turns no faster than this stands, rad/s.
const STANDING_RAD_S: f64 = 0.05;
/// Far below a count of any encoder, far above what arithmetic loses.
const ROUNDING: f64 = 1e-9;

/// A goal as it reached the servo.
#[derive(Clone, Copy, Debug)]
pub(super) struct Goal {
    pub raw: i64,
    pub when: When,
    /// Sum of all pauses of the host on this line until then, but for 100 ms of each, ns.
    pub paused_ns: u64,
    /// The joint stands where the goal is.
    pub here: bool,
}

/// The goal in force.
#[derive(Clone, Copy, Debug)]
struct InForce {
    goal: Goal,
    /// The earliest moment at which it can have been written without a step before it, or to it,
    /// that was too long (R2).
    legal_ns: u64,
    under_torque: bool,
}

/// From one goal to the next.
#[derive(Clone, Copy, Debug)]
struct Step {
    counts: i64,
    /// It took at least and at most so long, s.
    least_s: f64,
    most_s: f64,
}

impl Step {
    fn between(from: &Goal, to: &Goal) -> Step {
        let paused_ns = to.paused_ns.saturating_sub(from.paused_ns);
        let seconds = |from_ns: u64, to_ns: u64| {
            to_ns.saturating_sub(from_ns).saturating_sub(paused_ns) as f64 * 1e-9
        };
        Step {
            counts: to.raw - from.raw,
            least_s: seconds(from.when.latest_ns, to.when.earliest_ns),
            most_s: seconds(from.when.earliest_ns, to.when.latest_ns),
        }
    }

    /// The lowest and the highest speed that it can have been, counts per second, if either goal is
    /// off by half of `rounding` counts.
    fn speeds(&self, rounding: f64) -> (f64, f64) {
        let over = |counts: f64, seconds: f64| if counts == 0.0 { 0.0 } else { counts / seconds };
        let (low, high) = (self.counts as f64 - rounding, self.counts as f64 + rounding);
        let low = over(low, if low > 0.0 { self.most_s } else { self.least_s });
        let high = over(high, if high > 0.0 { self.least_s } else { self.most_s });
        (low, high)
    }
}

/// What the referee knows of one joint.
#[derive(Clone, Debug)]
pub(super) struct Watched {
    pub name: String,
    pub line: usize,
    lower: f64,
    upper: f64,
    speed: f64,
    acceleration: f64,
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
    in_force: Option<InForce>,
    /// The step to the goal in force; none: it stood still before.
    step: Option<Step>,
    /// By how many counts the goal was moving when the servo gave up because its host had fallen
    /// silent.
    forsaken: i64,
    tracking: Tracking,
}

impl Watched {
    pub fn new(
        joint: &Joint,
        line: usize,
        radians_per_count: f64,
        zero_count: i64,
        resolution: f64,
    ) -> Watched {
        Watched {
            name: joint.name.clone(),
            line,
            lower: joint.lower_rad,
            upper: joint.upper_rad,
            speed: joint.velocity_rad_s,
            acceleration: joint.acceleration_rad_s2,
            ratio: f64::from(joint.direction) * joint.gear,
            offset: joint.offset_rad,
            radians_per_count,
            zero_count,
            resolution: resolution * joint.gear.abs(),
            torque: false,
            goals: 0,
            first: [0; 2],
            last: [0; 2],
            in_force: None,
            step: None,
            forsaken: 0,
            tracking: Tracking::default(),
        }
    }

    fn angle(&self, raw: i64) -> f64 {
        self.ratio * (raw - self.zero_count) as f64 * self.radians_per_count - self.offset
    }

    fn radians(&self, counts: f64) -> f64 {
        self.ratio.abs() * counts * self.radians_per_count
    }

    /// True if the joint stands within what torque may come on with of its goal, seen `off_rad`
    /// away at the servo and turning there with `speed_rad_s`.
    pub fn stands_there(&self, off_rad: f64, speed_rad_s: f64) -> bool {
        let turns = self.ratio.abs();
        turns * off_rad.abs() <= TORQUE_ON_RAD && turns * speed_rad_s.abs() <= STANDING_RAD_S
    }

    /// R1, of a goal whether it was accepted or not.
    pub fn judge_place(&self, raw: i64) -> Option<String> {
        let angle = self.angle(raw);
        // A limit that lies between two counts may be rounded to.
        let slack = 0.5 * self.resolution + ROUNDING;
        let inside = angle >= self.lower - slack && angle <= self.upper + slack;
        (!inside).then(|| {
            format!("goal {angle:.4} rad outside {:.4}..{:.4} rad", self.lower, self.upper)
        })
    }

    /// Torque came on with the shaft at `present` counts and this goal in the register. How long
    /// that has stood there does not matter: from here on it moves the joint.
    pub fn torque_on(&mut self, goal: Goal, present: i64) {
        self.torque = true;
        self.forsaken = 0;
        self.step = None;
        self.in_force = Some(InForce { goal, legal_ns: goal.when.earliest_ns, under_torque: true });
        self.tracking.begin(goal.when.latest_ns, self.angle(present));
    }

    pub fn torque_off(&mut self) {
        self.torque = false;
        self.step = None;
        if let Some(in_force) = &mut self.in_force {
            in_force.under_torque = false;
        }
    }

    /// The servo lets go, or brakes, because it heard nothing for too long.
    pub fn forsake(&mut self) {
        self.forsaken = self.moving_by();
    }

    /// The servo's position as it tells the host, at `at_ns`.
    pub fn measured(&mut self, at_ns: u64, raw: i64) {
        let goal = self.in_force.map(|in_force| self.angle(in_force.goal.raw));
        self.tracking.measured(at_ns, self.angle(raw), goal);
    }

    /// The position told at `measured_ns` is in the host's hands.
    pub fn had(&mut self, measured_ns: u64, now_ns: u64) {
        self.tracking.had(measured_ns, now_ns);
    }

    /// A hand or a fault turns the shaft, or what the encoder makes of it, away from `before`.
    pub fn displaced(&mut self, before: i64) {
        self.tracking.displaced(self.angle(before));
    }

    /// True if the goal differs from the last one, after a stop that was declared.
    pub fn judge_stop(&self, raw: i64) -> Option<String> {
        let counts = raw - self.in_force?.goal.raw;
        (counts != 0)
            .then(|| format!("goal moved by {} after the stop", counted(counts.abs(), "count")))
    }

    /// A goal was accepted: which rules it breaks, and how.
    pub fn take(&mut self, goal: Goal) -> Vec<(Rule, String)> {
        let broken = self.judge(&goal);
        if let Some(slot) = self.first.get_mut(self.goals as usize) {
            *slot = goal.raw;
        }
        self.last = [goal.raw, self.last[0]];
        self.goals += 1;
        broken
    }

    fn judge(&mut self, goal: &Goal) -> Vec<(Rule, String)> {
        let before = self.in_force;
        let legal_ns = goal.when.earliest_ns;
        self.in_force = Some(InForce { goal: *goal, legal_ns, under_torque: self.torque });
        let Some(before) = before.filter(|_| self.torque) else { return Vec::new() };
        let step = Step::between(&before.goal, goal);
        let (from, to) = (self.angle(before.goal.raw), self.angle(goal.raw));
        self.tracking.goes(from, to, before.goal.when, goal.when);
        let too_far = self.judge_step(&before, goal, &step);
        let too_abrupt = self.judge_pace(&step);
        if goal.here && (too_far.is_some() || too_abrupt.is_some()) {
            // Told to stay where it stands: nothing moves, and from here on it is at rest.
            self.step = None;
            return Vec::new();
        }
        self.step = Some(step);
        let away = self.tracking.judge(from, to, goal.when.earliest_ns, self.resolution);
        let found = [
            (Rule::GoalStep, too_far),
            (Rule::GoalDistance, away.filter(|_| !goal.here)),
            (Rule::SpeedChange, too_abrupt),
        ];
        found.into_iter().filter_map(|(rule, text)| Some((rule, text?))).collect()
    }

    /// R2.
    fn judge_step(&mut self, before: &InForce, goal: &Goal, step: &Step) -> Option<String> {
        let step_rad = self.radians(step.counts.abs() as f64);
        let needed_s = (step_rad - self.resolution - ROUNDING).max(0.0) / self.speed;
        let paused_ns = goal.paused_ns.saturating_sub(before.goal.paused_ns);
        let legal_ns = before.legal_ns.saturating_add((needed_s * 1e9) as u64 + paused_ns);
        if legal_ns <= goal.when.latest_ns {
            if let Some(in_force) = &mut self.in_force {
                in_force.legal_ns = legal_ns.max(goal.when.earliest_ns);
            }
            return None;
        }
        let allowed = self.speed * step.most_s + self.resolution;
        Some(format!(
            "goal moved by {step_rad:.4} rad in {:.2} ms, {allowed:.4} rad allowed",
            step.most_s * 1e3
        ))
    }

    /// R12, but for the end of a motion.
    fn judge_pace(&self, step: &Step) -> Option<String> {
        let rounding = self.resolution / self.radians(1.0);
        let (low, high) = step.speeds(rounding);
        let (low_before, high_before) =
            self.step.map_or((0.0, 0.0), |before| before.speeds(rounding));
        let change = self.radians((low - high_before).max(low_before - high).max(0.0));
        let most_s = step.most_s + self.step.map_or(0.0, |before| before.most_s);
        // Twice the limit, for half of the time that both steps took: between their middles.
        let allowed = self.acceleration * most_s;
        if change <= allowed + ROUNDING {
            return None;
        }
        let speed = |step: Option<&Step>| {
            step.map_or(0.0, |step| {
                self.ratio.signum() * self.radians(step.counts as f64) / step.most_s
            })
        };
        Some(format!(
            "goal speed went from {:.3} to {:.3} rad/s within {:.2} ms; {allowed:.3} rad/s and a \
             count are allowed",
            speed(self.step.as_ref()),
            speed(Some(step)),
            most_s * 0.5e3
        ))
    }

    /// By how many counts the last goal under torque was away from the one before.
    fn moving_by(&self) -> i64 {
        let under_torque = self.in_force.is_some_and(|in_force| in_force.under_torque);
        self.step.filter(|_| under_torque).map_or(0, |step| step.counts)
    }

    /// R2b and the end of R12, if no goal comes any more.
    pub fn judge_ends(&self) -> Vec<(Rule, String)> {
        let mut found = Vec::new();
        for (which, [a, b]) in [("first", self.first), ("last", self.last)] {
            if self.goals >= 2 && a != b {
                let text = format!("the {which} two goals differ: counts {a} and {b}");
                found.push((Rule::RestAtEnds, text));
            }
        }
        let counts = if self.forsaken == 0 { self.moving_by() } else { self.forsaken };
        if counts != 0 {
            let counts = counts.abs();
            let text = format!(
                "the last goal was {counts} from the one before: no rest",
                counts = counted(counts, "count")
            );
            found.push((Rule::SpeedChange, text));
        }
        found
    }
}
