//! The scene's faults sorted out: what strikes at which moment, what may befall each status, and
//! what has struck.

use super::{Damage, Fault, Struck};
use crate::SimError;
use crate::adapter::Usb;
use crate::can::{CanFrame, Trouble};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use std::collections::VecDeque;
use std::ops::Range;
use std::path::PathBuf;

/// What there may be of faults that have not ended: each is an entry or two for each place.
const MOST: usize = 4096;
/// Struck faults remembered until they are taken; all are counted.
const KEPT: usize = 4096;

/// What happens at one moment.
#[derive(Clone, Debug)]
pub(crate) enum Strike {
    Silence { servo: Place, until_ns: u64 },
    Speak { servo: Place, until_ns: u64 },
    Overload { servo: Place },
    Reboot { servo: Place },
    Brownout { until_ns: u64 },
    PowerBack { until_ns: u64 },
    Stick { servo: Place, stuck: bool },
    Freeze { servo: Place, frozen: bool },
    Jump { servo: Place, counts: i64 },
    Register { servo: Place, register: String, raw: i64 },
    Twin { servo: Place, turn_rad: f64 },
    Unplug { servo: Place },
    Slow { line: usize, latency_ns: u64, usb: Option<Usb> },
    AtSpeed { line: usize },
    HangUp { line: usize },
    PlugIn { line: usize, link: Option<PathBuf> },
    Block { line: usize, until_ns: u64, bytes: usize },
    Unblock { line: usize },
    Trouble { servo: Place, trouble: Option<Trouble> },
    BusOff { line: usize, bus_off: bool },
    Babble { line: usize, frame: CanFrame, period_ns: u64, until_ns: u64 },
    Hush { line: usize, frame: CanFrame },
    Push { fault: u64, servo: Option<Place>, force_n: [f64; 3] },
    Relent { fault: u64 },
    Slope { slope_rad: [f64; 2] },
}

/// A servo by its line and place on it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Place {
    pub line: usize,
    pub servo: usize,
}

/// A strike with its time, and what is noted of it.
#[derive(Clone, Debug)]
pub(crate) struct Planned {
    at_ns: u64,
    pub strike: Strike,
    note: Option<(&'static str, String)>,
    /// Number of the fault it belongs to.
    pub fault: u64,
    /// It undoes what the fault has done.
    ends: bool,
}

/// Which statuses a damage is for.
#[derive(Clone, Debug)]
struct Rule {
    fault: u64,
    line: Option<usize>,
    servo: Option<usize>,
    nth: Option<u64>,
    span: Range<u64>,
    probability: f64,
    damage: Damage,
}

/// What things are called in a world.
#[derive(Clone, Debug, Default)]
pub(crate) struct Names {
    pub lines: Vec<String>,
    /// Which of the lines are CAN.
    pub can: Vec<usize>,
    /// Joint, ID and place of every servo.
    pub servos: Vec<(String, u8, Place)>,
    /// Profile, ID and place of every board.
    pub boards: Vec<(String, u8, Place)>,
}

impl Names {
    /// All that have registers on serial lines.
    fn devices(&self) -> impl Iterator<Item = &(String, u8, Place)> {
        self.servos.iter().chain(&self.boards)
    }

    /// The servo of a joint, a board by its profile, or whoever is at `LINE/ID`.
    pub fn servo(&self, name: &str) -> Result<Place, SimError> {
        let joint = self.devices().find(|(joint, ..)| joint == name);
        let found = joint.or_else(|| {
            let (line, id) = name.split_once('/')?;
            let (line, id) = (self.line(line).ok()?, id.parse::<u8>().ok()?);
            self.devices().find(|&&(_, own, place)| place.line == line && own == id)
        });
        found.map(|&(_, _, place)| place).ok_or_else(|| SimError::UnknownJoint(name.to_string()))
    }

    fn line(&self, name: &str) -> Result<usize, SimError> {
        let line = self.lines.iter().position(|line| line == name);
        line.ok_or_else(|| SimError::UnknownLine(name.to_string()))
    }

    /// One CAN line, or all.
    fn can_lines(&self, name: Option<&String>) -> Result<Vec<usize>, SimError> {
        let Some(name) = name else { return Ok(self.can.clone()) };
        let line = self.line(name)?;
        if self.can.contains(&line) {
            return Ok(vec![line]);
        }
        Err(SimError::NotCan(name.clone()))
    }

    /// One line, or all.
    fn lines(&self, name: Option<&String>) -> Result<Vec<usize>, SimError> {
        match name {
            Some(name) => Ok(vec![self.line(name)?]),
            None => Ok((0..self.lines.len()).collect()),
        }
    }

    fn joint(&self, place: Place) -> String {
        let known = self.devices().find(|&&(_, _, at)| at == place);
        known.map_or_else(|| self.lines[place.line].clone(), |(joint, ..)| joint.clone())
    }
}

/// The scene's faults, sorted out.
#[derive(Clone, Debug, Default)]
pub(crate) struct Plan {
    names: Names,
    rules: Vec<Rule>,
    /// Latest first.
    planned: Vec<Planned>,
    /// Number of the fault that is taken apart, or of the next.
    fault: u64,
    struck: VecDeque<Struck>,
    struck_count: u64,
}

impl Plan {
    pub fn new(faults: &[Fault], names: Names, rng: &mut ChaCha8Rng) -> Result<Plan, SimError> {
        let mut plan = Plan { names, ..Plan::default() };
        for fault in faults {
            plan.add(fault, rng)?;
            plan.fault += 1;
        }
        // What was named first strikes first.
        plan.planned.reverse();
        plan.planned.sort_by_key(|planned| std::cmp::Reverse(planned.at_ns));
        Ok(plan)
    }

    /// Faults that come as one, later than the others: their number. Those that cannot be leave nothing
    /// behind.
    pub fn begin(&mut self, faults: &[Fault], rng: &mut ChaCha8Rng) -> Result<u64, SimError> {
        if self.rules.len() + self.planned.len() + faults.len() > MOST {
            return Err(SimError::TooManyFaults(MOST));
        }
        let before = std::mem::take(&mut self.planned);
        let rules = self.rules.len();
        let added = faults.iter().try_for_each(|fault| self.add(fault, rng));
        let fresh = std::mem::replace(&mut self.planned, before);
        if let Err(wrong) = added {
            self.rules.truncate(rules);
            return Err(wrong);
        }
        fresh.into_iter().for_each(|planned| self.insert(planned));
        self.fault += 1;
        Ok(self.fault - 1)
    }

    /// After what is planned for the same moment.
    fn insert(&mut self, planned: Planned) {
        let place = self.planned.partition_point(|other| other.at_ns > planned.at_ns);
        self.planned.insert(place, planned);
    }

    /// A fault is over: what undoes what it has done; none if there is no such fault, or nothing left
    /// of it.
    pub fn end(&mut self, fault: u64) -> Option<Vec<Strike>> {
        let rules = self.rules.len();
        self.rules.retain(|rule| rule.fault != fault);
        let (own, others) = std::mem::take(&mut self.planned)
            .into_iter()
            .partition::<Vec<_>, _>(|planned| planned.fault == fault);
        self.planned = others;
        if own.is_empty() && self.rules.len() == rules {
            return None;
        }
        let has_begun = own.iter().all(|planned| planned.ends);
        Some(own.into_iter().filter(|_| has_begun).map(|planned| planned.strike).collect())
    }

    /// What undoes what this fault has just done: known only now.
    pub fn ends_with(&mut self, fault: u64, strike: Strike) {
        self.insert(Planned { at_ns: u64::MAX, strike, note: None, fault, ends: true });
    }

    /// What all is called.
    pub fn names(&self) -> &Names {
        &self.names
    }

    fn add(&mut self, fault: &Fault, rng: &mut ChaCha8Rng) -> Result<(), SimError> {
        match fault {
            Fault::Perhaps { probability, fault } => {
                if rng.random::<f64>() < *probability {
                    self.add(fault, rng)?;
                }
            }
            Fault::Status { joint, nth, damage } => {
                let place = self.names.servo(joint)?;
                self.rules.push(Rule {
                    fault: self.fault,
                    line: Some(place.line),
                    servo: Some(place.servo),
                    nth: Some(*nth),
                    span: 0..u64::MAX,
                    probability: 1.0,
                    damage: *damage,
                });
            }
            Fault::AnyStatus { probability, damage } => {
                let span = 0..u64::MAX;
                let (probability, damage) = (*probability, *damage);
                self.rules.push(Rule {
                    fault: self.fault,
                    line: None,
                    servo: None,
                    nth: None,
                    span,
                    probability,
                    damage,
                });
            }
            Fault::Statuses { of, from_ns, until_ns, probability, damage } => {
                let (line, servo) = self.whose(of.as_deref())?;
                let (span, probability, damage) = (*from_ns..*until_ns, *probability, *damage);
                let fault = self.fault;
                self.rules.push(Rule { fault, line, servo, nth: None, span, probability, damage });
            }
            Fault::SlowLine { line, .. }
            | Fault::HangUp { line, .. }
            | Fault::Blocked { line, .. } => {
                for line in self.names.lines(line.as_ref())? {
                    self.add_to_line(fault, line);
                }
            }
            Fault::BusOff { line, .. } | Fault::Babble { line, .. } => {
                for line in self.names.can_lines(line.as_ref())? {
                    self.add_to_line(fault, line);
                }
            }
            Fault::Push { joint, force_n, from_ns, until_ns } => {
                let servo = joint.as_ref().map(|joint| self.names.servo(joint)).transpose()?;
                let (fault, force_n) = (self.fault, *force_n);
                let on = joint.clone().unwrap_or_default();
                self.plan_on_body(*from_ns, Strike::Push { fault, servo, force_n }, "push", on);
                self.plan_end(*until_ns, Strike::Relent { fault });
            }
            Fault::Slope { slope_rad, from_ns, until_ns } => {
                let strike = Strike::Slope { slope_rad: *slope_rad };
                self.plan_on_body(*from_ns, strike, "slope", String::new());
                self.plan_end(*until_ns, Strike::Slope { slope_rad: [0.0; 2] });
            }
            _ => self.add_to_servo(fault)?,
        }
        Ok(())
    }

    fn whose(&self, of: Option<&str>) -> Result<(Option<usize>, Option<usize>), SimError> {
        let Some(name) = of else { return Ok((None, None)) };
        if let Some(line) = name.strip_suffix("/*") {
            return Ok((Some(self.names.line(line)?), None));
        }
        let place = self.names.servo(name)?;
        Ok((Some(place.line), Some(place.servo)))
    }

    fn add_to_servo(&mut self, fault: &Fault) -> Result<(), SimError> {
        match fault {
            Fault::Silent { joint, from_ns, until_ns } => {
                let servo = self.names.servo(joint)?;
                let strike = Strike::Silence { servo, until_ns: *until_ns };
                self.plan(*from_ns, strike, "silent", servo);
                self.plan_end(*until_ns, Strike::Speak { servo, until_ns: *until_ns });
            }
            Fault::Overload { joint, at_ns } => {
                let servo = self.names.servo(joint)?;
                self.plan(*at_ns, Strike::Overload { servo }, "overload", servo);
            }
            Fault::Reboot { joint, at_ns } => {
                let servo = self.names.servo(joint)?;
                self.plan(*at_ns, Strike::Reboot { servo }, "reboot", servo);
            }
            Fault::Brownout { from_ns, until_ns } => {
                self.planned.push(Planned {
                    at_ns: *from_ns,
                    strike: Strike::Brownout { until_ns: *until_ns },
                    note: Some(("brownout", String::new())),
                    fault: self.fault,
                    ends: false,
                });
                self.plan_end(*until_ns, Strike::PowerBack { until_ns: *until_ns });
            }
            Fault::StuckPosition { joint, from_ns, until_ns } => {
                let servo = self.names.servo(joint)?;
                self.plan(*from_ns, Strike::Stick { servo, stuck: true }, "stuck", servo);
                self.plan_end(*until_ns, Strike::Stick { servo, stuck: false });
            }
            Fault::FrozenPosition { joint, from_ns, until_ns } => {
                let servo = self.names.servo(joint)?;
                self.plan(*from_ns, Strike::Freeze { servo, frozen: true }, "frozen", servo);
                self.plan_end(*until_ns, Strike::Freeze { servo, frozen: false });
            }
            Fault::PositionJump { joint, at_ns, counts } => {
                let servo = self.names.servo(joint)?;
                let strike = Strike::Jump { servo, counts: i64::from(*counts) };
                self.plan(*at_ns, strike, "jump", servo);
                let back = -i64::from(*counts);
                self.plan_end(u64::MAX, Strike::Jump { servo, counts: back });
            }
            Fault::Register { joint, register, raw, at_ns } => {
                let servo = self.names.servo(joint)?;
                let strike = Strike::Register { servo, register: register.clone(), raw: *raw };
                self.plan(*at_ns, strike, "register", servo);
            }
            Fault::Trouble { joint, trouble, from_ns, until_ns } => {
                let servo = self.names.servo(joint)?;
                let strike = Strike::Trouble { servo, trouble: Some(*trouble) };
                self.plan(*from_ns, strike, "trouble", servo);
                self.plan_end(*until_ns, Strike::Trouble { servo, trouble: None });
            }
            Fault::Twin { joint, turn_rad } => {
                let servo = self.names.servo(joint)?;
                self.plan(0, Strike::Twin { servo, turn_rad: *turn_rad }, "twin", servo);
            }
            _ => {}
        }
        Ok(())
    }

    fn add_to_line(&mut self, fault: &Fault, line: usize) {
        let name = self.names.lines[line].clone();
        let begins =
            |at_ns, strike, note: &'static str| (at_ns, strike, Some((note, name.clone())));
        let (begin, end) = match fault {
            Fault::SlowLine { from_ns, until_ns, latency_ns, usb, .. } => {
                let strike = Strike::Slow { line, latency_ns: *latency_ns, usb: *usb };
                let end = (*until_ns, Strike::AtSpeed { line }, None);
                (begins(*from_ns, strike, "slow-line"), end)
            }
            Fault::HangUp { at_ns, until_ns, link, .. } => {
                let strike = Strike::PlugIn { line, link: link.clone() };
                let end = begins(until_ns.unwrap_or(u64::MAX), strike, "plug-in");
                (begins(*at_ns, Strike::HangUp { line }, "hang-up"), end)
            }
            Fault::Blocked { from_ns, until_ns, bytes, .. } => {
                let strike = Strike::Block { line, until_ns: *until_ns, bytes: *bytes };
                let end = (*until_ns, Strike::Unblock { line }, None);
                (begins(*from_ns, strike, "blocked"), end)
            }
            Fault::BusOff { at_ns, until_ns, .. } => {
                let strike = Strike::BusOff { line, bus_off: false };
                let end = (until_ns.unwrap_or(u64::MAX), strike, None);
                (begins(*at_ns, Strike::BusOff { line, bus_off: true }, "bus-off"), end)
            }
            Fault::Babble { frame, period_ns, from_ns, until_ns, .. } => {
                let (frame, period_ns, until_ns) = (frame.clone(), *period_ns, *until_ns);
                let end = (until_ns, Strike::Hush { line, frame: frame.clone() }, None);
                let strike = Strike::Babble { line, frame, period_ns, until_ns };
                (begins(*from_ns, strike, "babble"), end)
            }
            _ => return,
        };
        for ((at_ns, strike, note), ends) in [(begin, false), (end, true)] {
            self.planned.push(Planned { at_ns, strike, note, fault: self.fault, ends });
        }
    }

    fn plan(&mut self, at_ns: u64, strike: Strike, kind: &'static str, servo: Place) {
        let note = Some((kind, self.names.joint(servo)));
        self.planned.push(Planned { at_ns, strike, note, fault: self.fault, ends: false });
    }

    fn plan_on_body(&mut self, at_ns: u64, strike: Strike, kind: &'static str, place: String) {
        let note = Some((kind, place));
        self.planned.push(Planned { at_ns, strike, note, fault: self.fault, ends: false });
    }

    fn plan_end(&mut self, at_ns: u64, strike: Strike) {
        let fault = self.fault;
        self.planned.push(Planned { at_ns, strike, note: None, fault, ends: true });
    }

    /// When something strikes next.
    pub fn next_ns(&self) -> Option<u64> {
        self.planned.last().map(|planned| planned.at_ns)
    }

    /// What strikes by `now_ns`, one at a time.
    pub fn strike(&mut self, now_ns: u64) -> Option<Planned> {
        let mut planned = self.planned.pop_if(|planned| planned.at_ns <= now_ns)?;
        if let Some((fault, place)) = planned.note.take() {
            self.note(Struck { at_ns: now_ns, fault, place, nth: None });
        }
        Some(planned)
    }

    /// The latest that struck, so many of them.
    pub fn latest(&self, count: usize) -> impl Iterator<Item = &Struck> {
        self.struck.iter().skip(self.struck.len().saturating_sub(count))
    }

    /// True if no status will ever be damaged.
    pub fn spares_statuses(&self) -> bool {
        self.rules.is_empty()
    }

    /// What happens to the `nth` status of a servo, which answers an instruction of `at_ns`.
    pub fn strike_status(
        &mut self,
        place: Place,
        nth: u64,
        at_ns: u64,
        rng: &mut ChaCha8Rng,
    ) -> Vec<Damage> {
        let mut damages = Vec::new();
        for rule in &self.rules {
            let meant = rule.line.is_none_or(|line| line == place.line)
                && rule.servo.is_none_or(|servo| servo == place.servo)
                && rule.nth.is_none_or(|only| only == nth)
                && rule.span.contains(&at_ns);
            if meant && (rule.probability >= 1.0 || rng.random::<f64>() < rule.probability) {
                damages.push(rule.damage);
            }
        }
        for damage in &damages {
            let place = self.names.joint(place);
            self.note(Struck { at_ns, fault: damage.name(), place, nth: Some(nth) });
        }
        damages
    }

    fn note(&mut self, struck: Struck) {
        self.struck_count += 1;
        if self.struck.len() == KEPT {
            self.struck.pop_front();
        }
        self.struck.push_back(struck);
    }

    /// How many have struck.
    pub fn struck_count(&self) -> u64 {
        self.struck_count
    }

    /// Those that have struck since this was asked last, or the latest of them.
    pub fn take_struck(&mut self) -> Vec<Struck> {
        self.struck.drain(..).collect()
    }
}
