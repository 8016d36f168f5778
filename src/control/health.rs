//! Doubts that last become a stop. Each rule has a bound, a count and a name.

use super::Sample;
use crate::bus::Miss;
use crate::error::{counted, listed};
use crate::time::{Duration, Instant};
use std::fmt;

/// A base that is tilted further than this from upright lies, or will, rad: 60 deg.
pub const FALLEN_RAD: f64 = std::f64::consts::FRAC_PI_3;
/// Cycles in a row without an answer of the sensor in the base after which nobody feels anything.
pub const BLIND_CYCLES: u32 = 5;

/// Bounds beyond which a motion is stopped.
#[derive(Clone, Copy, Debug)]
pub struct Bounds {
    /// Cycles in a row in which a joint was asked and gave no feedback.
    pub misses_in_a_row: u32,
    /// Late cycles among the last hundred.
    pub late_of_hundred: u32,
    /// Longest time between two cycles.
    pub gap: Duration,
    /// Largest distance between goal and present, rad.
    pub tracking_rad: f64,
    /// How long it may last.
    pub tracking_for: Duration,
    /// How long the supply may be below the servo's minimum.
    pub low_voltage_for: Duration,
}

impl Default for Bounds {
    fn default() -> Self {
        Self {
            misses_in_a_row: 5,
            late_of_hundred: 5,
            gap: Duration::from_millis(100),
            tracking_rad: 0.35,
            tracking_for: Duration::from_millis(300),
            low_voltage_for: Duration::from_millis(100),
        }
    }
}

/// Why a motion was stopped before its end.
#[derive(Clone, Debug, PartialEq)]
pub enum StopReason {
    /// The operator asked (a signal).
    Asked,
    /// A joint gave no feedback for too many cycles.
    Silent {
        /// Joint name.
        joint: String,
        /// Cycles in a row.
        cycles: u32,
        /// What the last miss was.
        miss: String,
    },
    /// The host cannot keep the rate.
    Late {
        /// Late cycles of the last hundred.
        cycles: u32,
    },
    /// The host stalled once.
    Stalled {
        /// Time between two cycles, s.
        gap_s: f64,
    },
    /// A joint does not follow.
    NotFollowing {
        /// Joint name.
        joint: String,
        /// Distance between goal and present, rad.
        error_rad: f64,
    },
    /// A servo reports an error or let go of its torque.
    ServoFault {
        /// Joint name.
        joint: String,
        /// In words.
        fault: String,
    },
    /// A servo is too hot.
    Hot {
        /// Joint name.
        joint: String,
        /// Degrees Celsius.
        temperature_c: f64,
        /// At which it is stopped, degrees Celsius.
        limit_c: f64,
    },
    /// The supply is too low.
    LowVoltage {
        /// Joint name.
        joint: String,
        /// V.
        voltage_v: f64,
        /// Below which it is stopped, V.
        minimum_v: f64,
    },
    /// The guard refused a goal.
    Refused {
        /// Joint name.
        joint: String,
        /// In words.
        reason: String,
    },
    /// The servos of a line came back from a silence without torque.
    CameBackLimp {
        /// Line name.
        line: String,
        /// The joints on it, which are told nothing any more.
        joints: Vec<String>,
    },
    /// The base is tilted so far that the robot lies, or will.
    Fell {
        /// How far from upright, rad.
        tilt_rad: f64,
    },
    /// The sensor in the base gave no answer for too many cycles.
    FeelsNothing {
        /// Cycles in a row.
        cycles: u32,
    },
    /// The program itself broke in the middle of a motion.
    Broke {
        /// What the panic said.
        words: String,
    },
    /// A line failed; nothing can be commanded on it any more.
    LineLost {
        /// Line name.
        line: String,
        /// What happened.
        text: String,
        /// The joints on it, left at their last goal.
        joints: Vec<String>,
    },
}

impl fmt::Display for StopReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Asked => f.write_str("stopped as asked"),
            Self::Silent { joint, cycles, miss } => {
                write!(
                    f,
                    "joint {joint} gave no feedback for {cycles}: {miss}",
                    cycles = counted(cycles, "cycle")
                )
            }
            Self::Late { cycles } => {
                write!(f, "the host cannot keep the rate: {cycles} of 100 cycles late")
            }
            Self::Stalled { gap_s } => {
                write!(f, "the host stalled for {:.0} ms", gap_s * 1e3)
            }
            Self::NotFollowing { joint, error_rad } => write!(
                f,
                "joint {joint} does not follow: {:.1} deg from its goal",
                error_rad.to_degrees()
            ),
            Self::ServoFault { joint, fault } => write!(f, "joint {joint}: {fault}"),
            Self::Hot { joint, temperature_c, .. } => {
                write!(f, "joint {joint} is too hot: {temperature_c:.0} deg C")
            }
            Self::LowVoltage { joint, voltage_v, .. } => {
                write!(f, "the supply is too low at joint {joint}: {voltage_v:.1} V")
            }
            Self::Refused { joint, reason } => {
                write!(f, "the guard refused a goal for joint {joint}: {reason}")
            }
            Self::CameBackLimp { line, joints } => write!(
                f,
                "line {line} came back without torque; nothing more is sent to {}",
                listed(joints)
            ),
            Self::Fell { tilt_rad } => {
                write!(f, "the robot fell: its base is tilted by {:.0} deg", tilt_rad.to_degrees())
            }
            Self::FeelsNothing { cycles } => {
                let cycles = counted(cycles, "cycle");
                write!(f, "the sensor in the base gave no answer for {cycles}")
            }
            Self::Broke { words } => write!(f, "the control loop broke: {words}"),
            Self::LineLost { line, text, joints } => write!(
                f,
                "the line was lost: line {line}: {text}; no word reaches {}",
                listed(joints)
            ),
        }
    }
}

/// The kinds of reasons to stop; each has its page in `docs/troubleshooting/`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum StopCode {
    /// The operator asked.
    Asked,
    /// A joint, or all of them, gave no feedback.
    Silent,
    /// The host cannot keep the rate.
    Late,
    /// The host stalled once.
    Stalled,
    /// A joint does not follow.
    NotFollowing,
    /// A servo reports an error or let go.
    ServoFault,
    /// A servo is too hot.
    Hot,
    /// The supply is too low.
    LowVoltage,
    /// The guard refused a goal.
    RefusedByGuard,
    /// Servos came back without torque.
    CameBackLimp,
    /// The program broke.
    Broke,
    /// A line failed.
    LineLost,
    /// A sensor that was followed is gone.
    SensorLost,
    /// Sensors that are followed seem to be swapped.
    SensorsSwapped,
    /// What makes the goals broke: a function of the user's own.
    SourceBroke,
    /// The robot lies, or will.
    Fell,
    /// The sensor in the base gave no answer.
    FeelsNothing,
}

impl StopCode {
    /// All kinds.
    pub const ALL: [Self; 17] = [
        Self::Asked,
        Self::Silent,
        Self::Late,
        Self::Stalled,
        Self::NotFollowing,
        Self::ServoFault,
        Self::Hot,
        Self::LowVoltage,
        Self::RefusedByGuard,
        Self::CameBackLimp,
        Self::Broke,
        Self::LineLost,
        Self::SensorLost,
        Self::SensorsSwapped,
        Self::SourceBroke,
        Self::Fell,
        Self::FeelsNothing,
    ];
}

impl fmt::Display for StopCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Asked => "asked",
            Self::Silent => "silent",
            Self::Late => "late",
            Self::Stalled => "stalled",
            Self::NotFollowing => "not-following",
            Self::ServoFault => "servo-fault",
            Self::Hot => "hot",
            Self::LowVoltage => "low-voltage",
            Self::RefusedByGuard => "refused-by-guard",
            Self::CameBackLimp => "came-back-limp",
            Self::Broke => "broke",
            Self::LineLost => "line-lost",
            Self::SensorLost => "sensor-lost",
            Self::SensorsSwapped => "sensors-swapped",
            Self::SourceBroke => "source-broke",
            Self::Fell => "fell",
            Self::FeelsNothing => "feels-nothing",
        })
    }
}

/// A reason to stop as data: what a program compares and a table holds.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Stop {
    /// Its kind.
    pub code: StopCode,
    /// Joint, where it is about one.
    pub joint: Option<String>,
    /// Line, where it is about one; else the joint's.
    pub line: Option<String>,
    /// What was found.
    pub got: Option<f64>,
    /// What would have been allowed.
    pub allowed: Option<f64>,
    /// Unit of both.
    pub unit: Option<&'static str>,
    /// Cycle in which it was found; null before the first.
    pub cycle: Option<u64>,
}

impl Stop {
    /// A stop of which no more is known than its kind.
    #[must_use]
    pub const fn of(code: StopCode) -> Self {
        let (joint, line, got, allowed, unit, cycle) = (None, None, None, None, None, None);
        Self { code, joint, line, got, allowed, unit, cycle }
    }
}

impl StopReason {
    /// Its kind.
    #[must_use]
    pub const fn code(&self) -> StopCode {
        match self {
            Self::Asked => StopCode::Asked,
            Self::Silent { .. } => StopCode::Silent,
            Self::Late { .. } => StopCode::Late,
            Self::Stalled { .. } => StopCode::Stalled,
            Self::NotFollowing { .. } => StopCode::NotFollowing,
            Self::ServoFault { .. } => StopCode::ServoFault,
            Self::Hot { .. } => StopCode::Hot,
            Self::LowVoltage { .. } => StopCode::LowVoltage,
            Self::Refused { .. } => StopCode::RefusedByGuard,
            Self::CameBackLimp { .. } => StopCode::CameBackLimp,
            Self::Broke { .. } => StopCode::Broke,
            Self::LineLost { .. } => StopCode::LineLost,
            Self::Fell { .. } => StopCode::Fell,
            Self::FeelsNothing { .. } => StopCode::FeelsNothing,
        }
    }

    /// The reason as data; `bounds` are those that were in force.
    #[must_use]
    pub fn as_data(&self, bounds: &Bounds, cycle: Option<u64>) -> Stop {
        let (joint, line) = match self {
            Self::Silent { joint, .. }
            | Self::NotFollowing { joint, .. }
            | Self::ServoFault { joint, .. }
            | Self::Hot { joint, .. }
            | Self::LowVoltage { joint, .. }
            | Self::Refused { joint, .. } => (Some(joint.clone()), None),
            Self::CameBackLimp { line, .. } | Self::LineLost { line, .. } => {
                (None, Some(line.clone()))
            }
            Self::Asked
            | Self::Late { .. }
            | Self::Stalled { .. }
            | Self::Fell { .. }
            | Self::FeelsNothing { .. }
            | Self::Broke { .. } => (None, None),
        };
        let figures = match *self {
            Self::Silent { cycles, .. } => {
                Some((f64::from(cycles), f64::from(bounds.misses_in_a_row) - 1.0, "cycles"))
            }
            Self::Late { cycles } => {
                Some((f64::from(cycles), f64::from(bounds.late_of_hundred) - 1.0, "of 100 cycles"))
            }
            Self::Stalled { gap_s } => Some((gap_s, bounds.gap.as_secs_f64(), "s")),
            Self::NotFollowing { error_rad, .. } => {
                Some((error_rad.abs(), bounds.tracking_rad, "rad"))
            }
            Self::Fell { tilt_rad } => Some((tilt_rad, FALLEN_RAD, "rad")),
            Self::FeelsNothing { cycles } => {
                Some((f64::from(cycles), f64::from(BLIND_CYCLES) - 1.0, "cycles"))
            }
            Self::Hot { temperature_c, limit_c, .. } => Some((temperature_c, limit_c, "deg C")),
            Self::LowVoltage { voltage_v, minimum_v, .. } => Some((voltage_v, minimum_v, "V")),
            _ => None,
        };
        Stop {
            code: self.code(),
            joint,
            line,
            got: figures.map(|(got, ..)| got),
            allowed: figures.map(|(_, allowed, _)| allowed),
            unit: figures.map(|(.., unit)| unit),
            cycle,
        }
    }
}

/// What health must know of a joint.
#[derive(Clone, Debug)]
pub struct JointFacts {
    /// Name, for reasons.
    pub name: String,
    /// Temperature at which to stop, degrees Celsius.
    pub temperature_limit_c: Option<f64>,
    /// Voltage below which to stop, V.
    pub min_voltage_v: Option<f64>,
}

#[derive(Clone, Debug, Default)]
struct JointHealth {
    missed_in_a_row: u32,
    /// Readings since the last one that was believed which the joint cannot have reached.
    wrong_in_a_row: u32,
    /// Cycle of the last reading that was believed.
    believed_in: u64,
    off_goal_since: Option<Instant>,
}

/// Watches the samples of a motion.
#[derive(Debug)]
pub struct Watch {
    bounds: Bounds,
    facts: Vec<JointFacts>,
    joints: Vec<JointHealth>,
    /// All joints hang on one supply: any of them may say that it is low, or not.
    low_since: Option<Instant>,
    /// Cycles in a row in which nobody who was asked gave feedback.
    quiet_cycles: u32,
    late: std::collections::VecDeque<bool>,
}

impl Watch {
    /// A watch over joints with these facts.
    #[must_use]
    pub fn new(bounds: Bounds, facts: Vec<JointFacts>) -> Self {
        let joints = vec![JointHealth::default(); facts.len()];
        Self {
            bounds,
            facts,
            joints,
            low_since: None,
            quiet_cycles: 0,
            late: std::collections::VecDeque::with_capacity(100),
        }
    }

    /// Judges when a cycle ran: `gap` since the one before, and whether it was late.
    pub fn pace(&mut self, gap: Duration, late: bool) -> Option<StopReason> {
        if self.late.len() == 100 {
            self.late.pop_front();
        }
        self.late.push_back(late);
        if gap > self.bounds.gap {
            return Some(StopReason::Stalled { gap_s: gap.as_secs_f64() });
        }
        let cycles = self.late.iter().filter(|&&late| late).count();
        let cycles = u32::try_from(cycles).unwrap_or(u32::MAX);
        (cycles >= self.bounds.late_of_hundred).then_some(StopReason::Late { cycles })
    }

    /// Judges what a cycle measured. `fault_words` names error bits of a joint.
    pub fn judge(
        &mut self,
        sample: &Sample<'_>,
        fault_words: impl Fn(usize, u16) -> String,
    ) -> Option<StopReason> {
        let mut reason = None;
        for (index, state) in sample.states.iter().enumerate() {
            let joint = &mut self.joints[index];
            let name = || self.facts[index].name.clone();
            let (state, alert) = match state {
                Ok(state) => state,
                Err(Miss::NotAsked) => continue,
                Err(miss) => {
                    joint.missed_in_a_row += 1;
                    joint.wrong_in_a_row += u32::from(*miss == Miss::Implausible);
                    let unread = sample.cycle.saturating_sub(joint.believed_in);
                    let unread = u32::try_from(unread).unwrap_or(u32::MAX);
                    // An encoder that jumped is back by itself before a joint that is read in turn was
                    // read five times: the servo has turned it there.
                    let cycles = match joint.wrong_in_a_row {
                        0 | 1 => joint.missed_in_a_row,
                        _ => joint.missed_in_a_row.max(unread),
                    };
                    if cycles >= self.bounds.misses_in_a_row {
                        let miss = miss.to_string();
                        reason.get_or_insert(StopReason::Silent { joint: name(), cycles, miss });
                    }
                    continue;
                }
            };
            (joint.missed_in_a_row, joint.wrong_in_a_row) = (0, 0);
            joint.believed_in = sample.cycle;
            if *alert {
                let fault = "the servo raised its alert flag".to_owned();
                reason.get_or_insert(StopReason::ServoFault { joint: name(), fault });
            }
            // The goal itself is never further away than the bound: see [`super::leash`].
            let error_rad = sample.wanted_rad[index] - state.position_rad;
            if error_rad.abs() <= self.bounds.tracking_rad {
                joint.off_goal_since = None;
            } else {
                let since = *joint.off_goal_since.get_or_insert(sample.at);
                if sample.at.since(since) > self.bounds.tracking_for {
                    reason.get_or_insert(StopReason::NotFollowing { joint: name(), error_rad });
                }
            }
            let read = crate::device::Health {
                voltage_v: state.voltage_v,
                temperature_c: state.temperature_c,
                ..Default::default()
            };
            let slow = self.judge_slow(index, &read, sample.at, &fault_words);
            reason = reason.or(slow);
        }
        if let Some((joint, health)) = &sample.health {
            let slow = self.judge_slow(*joint, health, sample.at, &fault_words);
            reason = reason.or(slow);
        }
        reason.or(self.judge_quiet(sample))
    }

    /// Judges a silence of all. Where joints are read in turn it lasts as many cycles as a silence
    /// of one does where all are read.
    fn judge_quiet(&mut self, sample: &Sample<'_>) -> Option<StopReason> {
        let asked = |state: &&Result<_, Miss>| !matches!(state, Err(Miss::NotAsked));
        let mut asked = sample.states.iter().enumerate().filter(|(_, state)| asked(state));
        let (first, state) = asked.next()?;
        let (Err(miss), true) = (state, asked.all(|(_, state)| state.is_err())) else {
            self.quiet_cycles = 0;
            return None;
        };
        self.quiet_cycles += 1;
        (self.quiet_cycles >= self.bounds.misses_in_a_row).then(|| StopReason::Silent {
            joint: self.facts[first].name.clone(),
            cycles: self.quiet_cycles,
            miss: miss.to_string(),
        })
    }

    fn judge_slow(
        &mut self,
        index: usize,
        health: &crate::device::Health,
        at: Instant,
        fault_words: &impl Fn(usize, u16) -> String,
    ) -> Option<StopReason> {
        let facts = &self.facts[index];
        let joint = facts.name.clone();
        if let Some(bits) = health.error_bits.filter(|&bits| bits != 0) {
            return Some(StopReason::ServoFault { joint, fault: fault_words(index, bits) });
        }
        if health.torque_on == Some(false) {
            let fault = "the servo switched its torque off (did it restart?)".to_owned();
            return Some(StopReason::ServoFault { joint, fault });
        }
        if let (Some(temperature_c), Some(limit_c)) =
            (health.temperature_c, facts.temperature_limit_c)
            && !(temperature_c < limit_c)
        {
            return Some(StopReason::Hot { joint, temperature_c, limit_c });
        }
        let (Some(voltage_v), Some(minimum_v)) = (health.voltage_v, facts.min_voltage_v) else {
            return None;
        };
        if voltage_v >= minimum_v {
            self.low_since = None;
            return None;
        }
        let since = *self.low_since.get_or_insert(at);
        let low = at.since(since) > self.bounds.low_voltage_for;
        low.then_some(StopReason::LowVoltage { joint, voltage_v, minimum_v })
    }
}

#[cfg(test)]
mod tests;
