//! How every line is read: which instruction, and what in which cycle, so that the rate asked for
//! fits the line. Pure arithmetic; nothing is sent from here.

use super::{Joint, Robot, ServoDrive};
use crate::bus::{Bus, GroupItem, GroupQuestion, GroupRead, Protocol};
use crate::error::counted;
use crate::time::Duration;
use gaitway_profiles::Role;
use std::collections::BTreeMap;
use std::fmt;

/// Share of a cycle a line may be busy.
pub const LINE_SHARE: f64 = 0.8;

/// A joint is read at least once in so many cycles; a line that needs more is too slow.
const MOST_TURNS: usize = 4;

/// How joints are asked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// One after the other.
    Single,
    /// By one question to all.
    Group(GroupRead),
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Single => "single reads",
            Self::Group(GroupRead::Sync) => "sync read",
            Self::Group(GroupRead::Fast) => "fast sync read",
            Self::Group(GroupRead::Bulk) => "bulk read",
            Self::Group(GroupRead::FastBulk) => "fast bulk read",
        })
    }
}

/// Joints on one line that are asked together, and for what.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Reading {
    /// What they speak.
    pub protocol: Protocol,
    /// How they are asked.
    pub method: Method,
    /// Index of each joint in [`Robot::joints`], and what it is asked for.
    pub joints: Vec<(usize, GroupItem)>,
}

impl Reading {
    /// The group question for these joints.
    pub(super) fn question(&self, kind: GroupRead) -> GroupQuestion {
        let items = self.joints.iter().map(|&(_, item)| item).collect();
        GroupQuestion { protocol: self.protocol, kind, items }
    }

    fn time_s(&self, bus: &Bus) -> f64 {
        match self.method {
            Method::Group(kind) => bus.read_time_s(&self.question(kind)),
            Method::Single => {
                let time = |&(_, item): &(usize, GroupItem)| {
                    bus.one_read_time_s(self.protocol, usize::from(item.length))
                };
                self.joints.iter().map(time).sum()
            }
        }
    }

    /// Lowest and highest number of bytes asked of one joint.
    fn lengths(&self) -> (u16, u16) {
        let lengths = || self.joints.iter().map(|(_, item)| item.length);
        (lengths().min().unwrap_or(0), lengths().max().unwrap_or(0))
    }
}

impl fmt::Display for Reading {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let bytes = match self.lengths() {
            (low, high) if low == high => counted(low, "byte"),
            (low, high) => format!("{low} to {high}", high = counted(high, "byte")),
        };
        write!(f, "{} of {bytes} from {}", self.method, counted(self.joints.len(), "servo"))
    }
}

/// What is read on one line, cycle by cycle in turn.
#[derive(Clone, Debug)]
pub struct LineReads {
    /// Everything of every joint; what is read when nothing moves.
    pub whole: Vec<Reading>,
    /// What is read in each cycle of the round; one entry if it is the same in all.
    pub turns: Vec<Vec<Reading>>,
}

impl LineReads {
    /// Nothing is read: the line tells by itself.
    #[must_use]
    pub fn none() -> Self {
        Self { whole: Vec::new(), turns: vec![Vec::new()] }
    }
}

/// What a line carries in a cycle, and how fast that can be.
#[derive(Clone, Debug, PartialEq)]
pub struct LinePlan {
    /// Name of the line.
    pub line: String,
    /// How it is read, in words.
    pub method: String,
    /// Cycles until every joint's feedback has been read completely.
    pub turns: usize,
    /// Line time of the longest cycle, s: goals, states, and the slow facts of one joint.
    pub cycle_time_s: f64,
    /// Cycles per second if nothing else were said, Hz.
    pub limit_hz: f64,
    /// True if that takes at most [`LINE_SHARE`] of the cycle asked for.
    pub fits: bool,
    /// The cycle asked for, s.
    pub period_s: f64,
}

impl LinePlan {
    /// Of a line that is occupied for `cycle_s` by each cycle, and for `share` of the time besides.
    #[must_use]
    pub fn of(line: &str, method: String, cycle_s: f64, share: f64, period_s: f64) -> Self {
        let cycle_time_s = cycle_s + share * period_s;
        Self {
            line: line.to_owned(),
            method,
            turns: 1,
            cycle_time_s,
            limit_hz: (1.0 - share) / cycle_s,
            fits: cycle_time_s <= LINE_SHARE * period_s,
            period_s,
        }
    }

    /// Share of the time the line is busy.
    #[must_use]
    pub fn load(&self) -> f64 {
        self.cycle_time_s / self.period_s
    }
}

impl fmt::Display for LinePlan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { line, method, cycle_time_s, period_s, .. } = self;
        let (time_ms, period_ms) = (cycle_time_s * 1e3, period_s * 1e3);
        write!(f, "line {line}: {method}; {time_ms:.1} ms of {period_ms:.1} ms")
    }
}

/// What a joint can be asked, and what for.
struct Member {
    joint: usize,
    item: GroupItem,
    fast: bool,
    bulk: bool,
}

/// How much of a joint is asked.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Share {
    Whole,
    Position,
    Nothing,
}

/// Chooses how line number `line` is read at `period`. `firmware` per joint decides who knows the
/// fast instructions; while it is not known (empty), nobody does.
pub fn plan(
    robot: &Robot,
    line: usize,
    bus: &Bus,
    firmware: &[u16],
    period: Duration,
) -> (LineReads, LinePlan) {
    let on_line: Vec<usize> =
        (0..robot.joints.len()).filter(|&joint| robot.joints[joint].line == line).collect();
    let member = |joint: usize, share: Share| {
        let of = &robot.joints[joint];
        let servo = of.servo()?;
        let block = match share {
            Share::Whole => &servo.feedback,
            Share::Position => &servo.position,
            Share::Nothing => return None,
        };
        let item = GroupItem { id: of.id, address: block.address(), length: block.length() };
        let fast = is_fast(robot, of, servo, firmware.get(joint).copied());
        let member = Member { joint, item, fast, bulk: servo.bulk_read() };
        Some((servo.model.protocol(), member))
    };
    let arrange = |share: &dyn Fn(usize) -> Share| -> Vec<Reading> {
        let mut by_protocol: BTreeMap<Protocol, Vec<Member>> = BTreeMap::new();
        for (place, &joint) in on_line.iter().enumerate() {
            if let Some((protocol, member)) = member(joint, share(place)) {
                by_protocol.entry(protocol).or_default().push(member);
            }
        }
        by_protocol.iter().flat_map(|(&protocol, of)| cheapest(bus, protocol, of)).collect()
    };
    let always_s = write_time_s(robot, &on_line, bus) + slow_time_s(robot, &on_line, bus);
    let time_s = |turns: &[Vec<Reading>]| {
        let turn_s = |turn: &Vec<Reading>| turn.iter().map(|reading| reading.time_s(bus)).sum();
        always_s + turns.iter().map(turn_s).fold(0.0, f64::max)
    };
    let whole = arrange(&|_| Share::Whole);
    let mut turns = vec![whole.clone()];
    let (allowed_s, mut kind) = (LINE_SHARE * period.as_secs_f64(), Split::None);
    'found: for next in [Split::Rest, Split::Joints] {
        for count in 2..=MOST_TURNS {
            if time_s(&turns) <= allowed_s {
                break 'found;
            }
            let turn = |turn: usize| {
                arrange(&|place| match (place % count == turn, next) {
                    (true, _) => Share::Whole,
                    (false, Split::Rest) => Share::Position,
                    (false, _) => Share::Nothing,
                })
            };
            (turns, kind) = ((0..count).map(turn).collect(), next);
        }
    }
    let cycle_time_s = time_s(&turns);
    let plan = LinePlan {
        line: robot.lines[line].name.clone(),
        method: words(&turns, kind),
        turns: turns.len(),
        cycle_time_s,
        limit_hz: 1.0 / cycle_time_s,
        fits: cycle_time_s <= allowed_s,
        period_s: period.as_secs_f64(),
    };
    (LineReads { whole, turns }, plan)
}

/// What is spread over several cycles.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Split {
    None,
    /// Position of every joint in every cycle, the rest in turn.
    Rest,
    /// Joints in turn.
    Joints,
}

fn words(turns: &[Vec<Reading>], kind: Split) -> String {
    let first = turns.first().map_or(&[][..], Vec::as_slice);
    let readings: Vec<String> = first.iter().map(ToString::to_string).collect();
    let readings = readings.join(" and ");
    let count = turns.len();
    match kind {
        Split::None => readings,
        Split::Rest => {
            format!(
                "{readings}; every position in every cycle, the rest every {count}",
                count = counted(count, "cycle")
            )
        }
        Split::Joints => {
            format!("{readings} in turn; each joint every {count}", count = counted(count, "cycle"))
        }
    }
}

/// Whether a joint's servo joins a merged answer. Servos with two axes in one case do not, whatever
/// their firmware (ROBOTIS lists Fast Sync Read for the single-axis models only).
fn is_fast(robot: &Robot, joint: &Joint, servo: &ServoDrive, firmware: Option<u16>) -> bool {
    let from = servo.model.profile().fast_sync_read_from_firmware;
    let new_enough = from.is_some_and(|from| firmware.is_some_and(|firmware| firmware >= from));
    let file = robot.file.joint(&joint.name);
    new_enough && file.is_some_and(|file| file.shares_case_with.is_none())
}

/// The arrangement of `members`, who all speak `protocol`, with the least line time.
fn cheapest(bus: &Bus, protocol: Protocol, members: &[Member]) -> Vec<Reading> {
    let reading = |method, of: Vec<&Member>| {
        let joints = of.iter().map(|member| (member.joint, member.item)).collect();
        Reading { protocol, method, joints }
    };
    let one_by_one = |of: Vec<&Member>| match of.is_empty() {
        true => Vec::new(),
        false => vec![reading(Method::Single, of)],
    };
    // By block, and by who knows the fast instruction if `apart`; else only if all do.
    let sync = |apart: bool| -> Vec<Reading> {
        let mut groups: BTreeMap<(u16, u16, bool), Vec<&Member>> = BTreeMap::new();
        for member in members {
            let key = (member.item.address, member.item.length, apart && member.fast);
            groups.entry(key).or_default().push(member);
        }
        let group = |of: Vec<&Member>| {
            let fast = of.iter().all(|member| member.fast);
            let kind = if fast { GroupRead::Fast } else { GroupRead::Sync };
            reading(Method::Group(kind), of)
        };
        groups.into_values().map(group).collect()
    };
    let all = || members.iter().collect::<Vec<_>>();
    let candidates = match protocol {
        Protocol::Dynamixel2 => {
            let fast = members.iter().all(|member| member.fast);
            let kind = if fast { GroupRead::FastBulk } else { GroupRead::Bulk };
            vec![sync(false), sync(true), vec![reading(Method::Group(kind), all())]]
        }
        Protocol::FeetechSts => vec![sync(false)],
        Protocol::Dynamixel1 => {
            let (bulk, single): (Vec<_>, Vec<_>) = members.iter().partition(|member| member.bulk);
            let mut readings = one_by_one(single);
            if !bulk.is_empty() {
                readings.insert(0, reading(Method::Group(GroupRead::Bulk), bulk));
            }
            vec![readings]
        }
        Protocol::FeetechScs => vec![one_by_one(all())],
    };
    let time_s = |readings: &Vec<Reading>| readings.iter().map(|r| r.time_s(bus)).sum::<f64>();
    let best = candidates.into_iter().min_by(|a, b| time_s(a).total_cmp(&time_s(b)));
    best.unwrap_or_default()
}

/// Line time of the goals of all joints, s.
fn write_time_s(robot: &Robot, on_line: &[usize], bus: &Bus) -> f64 {
    let mut groups: BTreeMap<(Protocol, u16, u8), usize> = BTreeMap::new();
    for &joint in on_line {
        let Some(servo) = robot.joints[joint].servo() else { continue };
        if let Ok(goal) = servo.model.register(Role::GoalPosition) {
            *groups.entry((servo.model.protocol(), goal.address, goal.bytes)).or_default() += 1;
        }
    }
    let time = |((protocol, _, bytes), count): ((Protocol, u16, u8), usize)| {
        bus.write_time_s(protocol, count, usize::from(bytes))
    };
    groups.into_iter().map(time).sum()
}

/// Line time of the longest slow read of any joint, s: there must be room for one in a cycle.
fn slow_time_s(robot: &Robot, on_line: &[usize], bus: &Bus) -> f64 {
    let of = |&joint: &usize| {
        let Some(servo) = robot.joints[joint].servo() else { return 0.0 };
        let reads = servo.health.reads().into_iter();
        let time = |(_, bytes)| bus.one_read_time_s(servo.model.protocol(), usize::from(bytes));
        reads.map(time).fold(0.0, f64::max)
    };
    on_line.iter().map(of).fold(0.0, f64::max)
}
