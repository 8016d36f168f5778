//! What one program says and hears.

use super::entries::{Wanted, hex, seconds, told};
use super::request::{self, Refusal, Request};
use super::{Surroundings, VERSION};
use crate::World;
use serde_json::{Map, Value, json};
use std::time::Duration;

/// Longest request, bytes.
const LONGEST: usize = 1 << 16;
/// Bytes of requests that wait; more is lost.
const MOST_WAITING: usize = 1 << 18;
/// While so many bytes wait to be read no request is served, and while half as many do events are lost.
const MOST_UNREAD: usize = 1 << 20;
/// A reply with entries ends when it is so long, bytes.
const LONG_REPLY: usize = 1 << 18;
/// Requests served before somebody else may have the world.
const AT_ONCE: usize = 64;

/// One program's requests and what it is told. Bytes go in and come out; it is told the world and the
/// time.
#[derive(Debug)]
pub struct Session {
    surroundings: Surroundings,
    input: Vec<u8>,
    /// So much of it has been served.
    served: usize,
    /// The rest of a request that is too long is passed over.
    skipping: bool,
    output: Vec<u8>,
    waiting: Option<Waiting>,
    follows: Option<Following>,
    refused: u64,
    dropped: u64,
}

/// A request that is answered later.
#[derive(Debug)]
struct Waiting {
    tag: Option<Value>,
    wanted: Wanted,
    next: u64,
    resets: u64,
    found: u64,
    count: u64,
    timeout: Duration,
    until: Duration,
}

#[derive(Debug)]
struct Following {
    wanted: Wanted,
    next: u64,
    resets: u64,
    lost: u64,
}

impl Session {
    /// A program that has said nothing yet.
    #[must_use]
    pub fn new(surroundings: Surroundings) -> Session {
        Session {
            surroundings,
            input: Vec::new(),
            served: 0,
            skipping: false,
            output: Vec::new(),
            waiting: None,
            follows: None,
            refused: 0,
            dropped: 0,
        }
    }

    /// Takes what the program has said. Whoever reads it asks [`Session::is_hungry`] first; what is too
    /// much is lost.
    pub fn hear(&mut self, bytes: &[u8]) {
        let room = MOST_WAITING.saturating_sub(self.input.len());
        let taken = bytes.get(..room).unwrap_or(bytes);
        self.dropped += (bytes.len() - taken.len()) as u64;
        self.input.extend_from_slice(taken);
    }

    /// True while more of the program can be taken.
    #[must_use]
    pub fn is_hungry(&self) -> bool {
        self.input.len() < MOST_WAITING / 2 && self.output.len() < MOST_UNREAD
    }

    /// True while it waits for something to happen, or there is more to do: [`Session::work`] is to be
    /// called soon.
    #[must_use]
    pub fn is_expectant(&self) -> bool {
        let has_more = self.waiting.is_none() && self.has_request() && self.has_room();
        self.waiting.is_some() || self.follows.is_some() || has_more
    }

    /// Nothing that it has said is left to be done.
    #[must_use]
    pub fn is_done(&self) -> bool {
        self.waiting.is_none() && !self.has_request()
    }

    fn has_request(&self) -> bool {
        self.waiting_input().contains(&b'\n') || self.waiting_input().len() > LONGEST
    }

    fn waiting_input(&self) -> &[u8] {
        self.input.get(self.served..).unwrap_or_default()
    }

    fn has_room(&self) -> bool {
        self.output.len() < MOST_UNREAD
    }

    /// What the program is told, not yet read.
    #[must_use]
    pub fn output(&self) -> &[u8] {
        &self.output
    }

    /// So many bytes of it were read.
    pub fn was_read(&mut self, count: usize) {
        self.output.drain(..count.min(self.output.len()));
    }

    /// Does what was asked for, and tells what has happened. `now` is real time since any moment; it
    /// goes on for those who wait.
    pub fn work(&mut self, world: &mut World, now: Duration) {
        world.catch_up();
        self.look_for_awaited(world, now);
        for _ in 0..AT_ONCE {
            if self.waiting.is_some() || !self.has_room() {
                break;
            }
            let Some(line) = self.next_line() else { break };
            self.serve(&line, world, now);
        }
        self.input.drain(..self.served.min(self.input.len()));
        self.served = 0;
        self.tell_followed(world);
    }

    /// The next whole request; one that is too long is refused here.
    fn next_line(&mut self) -> Option<Vec<u8>> {
        loop {
            let rest = self.waiting_input();
            let end = rest.iter().position(|&byte| byte == b'\n');
            let Some(end) = end else {
                if rest.len() > LONGEST {
                    self.served = self.input.len();
                    self.refuse_length();
                }
                return None;
            };
            let line = rest.get(..=end).unwrap_or_default().to_vec();
            self.served += line.len();
            if std::mem::take(&mut self.skipping) {
                continue;
            }
            if line.len() > LONGEST {
                self.refuse_length();
                self.skipping = false;
                continue;
            }
            if !line.iter().all(u8::is_ascii_whitespace) {
                return Some(line);
            }
        }
    }

    fn refuse_length(&mut self) {
        if !std::mem::replace(&mut self.skipping, true) {
            let refusal = Refusal {
                at: "request".to_string(),
                got: "a longer line".to_string(),
                allowed: format!("at most {LONGEST} bytes in a line"),
            };
            self.answer(None, Err(refusal));
        }
    }

    fn serve(&mut self, line: &[u8], world: &mut World, now: Duration) {
        let (tag, request) = match std::str::from_utf8(line) {
            Ok(text) => request::read(text, world.now_ns()),
            Err(_) => {
                let refusal = Refusal {
                    at: "request".to_string(),
                    got: "bytes that are not UTF-8".to_string(),
                    allowed: "one JSON object on a line".to_string(),
                };
                (None, Err(refusal))
            }
        };
        let reply = match request {
            Ok(Request::Wait { filter, count, timeout_s }) => match Wanted::of(filter, world) {
                Ok(wanted) => {
                    let timeout = Duration::from_secs_f64(timeout_s);
                    let (next, resets) = (wanted.since(), world.resets());
                    let until = now + timeout;
                    let found = 0;
                    self.waiting =
                        Some(Waiting { tag, wanted, next, resets, found, count, timeout, until });
                    return self.look_for_awaited(world, now);
                }
                Err(refusal) => Err(refusal),
            },
            Ok(request) => self.carry_out(request, world),
            Err(refusal) => Err(refusal),
        };
        world.ring();
        self.answer(tag, reply);
    }

    fn answer(&mut self, tag: Option<Value>, reply: Result<Value, Refusal>) {
        let mut said = Map::new();
        said.extend(tag.map(|tag| ("tag".to_string(), tag)));
        said.insert("ok".to_string(), json!(reply.is_ok()));
        match reply {
            Ok(Value::Object(reply)) => said.extend(reply),
            Ok(_) => {}
            Err(Refusal { at, got, allowed }) => {
                self.refused += 1;
                let error = json!({"at": at, "got": got, "allowed": allowed});
                said.insert("error".to_string(), error);
            }
        }
        self.say(&Value::Object(said));
    }

    fn say(&mut self, said: &Value) {
        self.output.extend_from_slice(said.to_string().as_bytes());
        self.output.push(b'\n');
    }

    fn carry_out(&mut self, request: Request, world: &mut World) -> Result<Value, Refusal> {
        let done = Ok(json!({}));
        match request {
            Request::About => return Ok(self.about(world)),
            Request::State { joint } => {
                let state = world.joint_state(&joint)?;
                return Ok(json!({
                    "position_rad": state.position_rad,
                    "velocity_rad_s": state.velocity_rad_s,
                    "torque": state.torque,
                    "plugged": state.plugged,
                    "in_hand": state.in_hand,
                    "statuses": state.statuses,
                    "at_s": seconds(world.now_ns()),
                }));
            }
            Request::Get { servo, register: Some(register) } => {
                return Ok(json!({"value": world.read_register(&servo, &register)?}));
            }
            Request::Get { servo, register: None } => {
                let registers = world.registers(&servo)?;
                let registers: Map<_, _> =
                    registers.into_iter().map(|(name, raw)| (name, json!(raw))).collect();
                return Ok(json!({"registers": registers}));
            }
            Request::Set { servo, register, value } => {
                if world.is_place_under_torque(&servo, &register)? {
                    return Err(crate::SimError::Held(servo).into());
                }
                world.preset(&servo, &register, value)?;
            }
            Request::Hand { joint, to_rad, speed_rad_s, torque_nm, holds_on } => {
                let torque_nm = match torque_nm {
                    Some(torque_nm) => torque_nm,
                    None => world.usual_hand_nm(&joint)?,
                };
                let hand = Request::hand(to_rad, speed_rad_s, torque_nm, holds_on);
                world.take_by_hand(&joint, hand)?;
            }
            Request::LetGo { joint } => world.let_go(&joint)?,
            Request::Plug { servo, plugged: true } => world.plug(&servo)?,
            Request::Plug { servo, plugged: false } => world.unplug(&servo)?,
            Request::Adapter { line, plugged: true } => world.plug_in(&line)?,
            Request::Adapter { line, plugged: false } => world.pull_out(&line)?,
            Request::Begin { faults } => return Ok(json!({"fault": world.begin(&faults)?})),
            Request::End { fault } => world.end(fault)?,
            Request::Reset => world.reset()?,
            Request::Freeze => {
                world.freeze()?;
                return Ok(json!({"at_s": seconds(world.now_ns())}));
            }
            Request::Run => world.unfreeze(),
            Request::Step { time_ns } => {
                world.step(time_ns)?;
                return Ok(json!({"at_s": seconds(world.now_ns())}));
            }
            Request::Log { filter, most } => {
                let wanted = Wanted::of(filter, world)?;
                return Ok(log(&wanted, most, world));
            }
            Request::Count { filter } => {
                let wanted = Wanted::of(filter, world)?;
                let journal = world.journal();
                let count = journal.since(wanted.since()).filter(|entry| wanted.takes(entry));
                let (next, lost) = (journal.next(), journal.lost_since(wanted.since()));
                return Ok(json!({"count": count.count(), "next": next, "lost": lost}));
            }
            Request::Subscribe { filter } => {
                let wanted = Wanted::of(filter, world)?;
                let (next, resets) = (world.journal().next().max(wanted.since()), world.resets());
                self.follows = Some(Following { wanted, next, resets, lost: 0 });
            }
            Request::Unsubscribe => self.follows = None,
            Request::Send { line, bytes, baud_bps, time_ns } => {
                return send(world, &line, &bytes, baud_bps, time_ns);
            }
            // Answered later, where it came.
            Request::Wait { .. } => {}
        }
        done
    }

    fn about(&self, world: &World) -> Value {
        let names = world.line_names();
        let lines = names.iter().enumerate().map(|(k, name)| {
            json!({
                "name": name,
                "kind": if world.is_can(k) { "can" } else { "serial" },
                "place": self.surroundings.places.get(k),
                "plugged": world.connection(k).is_some(),
                "baud_bps": world.line_baud_bps(k).filter(|&bps| bps > 0),
            })
        });
        let joints = world.joints_told().into_iter().map(|(name, line, id, model)| {
            json!({"name": name, "line": names.get(line), "id": id, "servo": model})
        });
        json!({
            "version": VERSION,
            "robot": self.surroundings.robot,
            "at_s": seconds(world.now_ns()),
            "frozen": world.is_frozen(),
            "resets": world.resets(),
            "lines": lines.collect::<Vec<_>>(),
            "joints": joints.collect::<Vec<_>>(),
            "refused": self.refused,
            "dropped": self.dropped,
        })
    }

    /// Answers who waits, if it has come or is too late.
    fn look_for_awaited(&mut self, world: &World, now: Duration) {
        let Some(waiting) = &mut self.waiting else { return };
        if waiting.resets != world.resets() {
            (waiting.next, waiting.found, waiting.resets) = (0, 0, world.resets());
        }
        let journal = world.journal();
        for entry in journal.since(waiting.next).filter(|entry| waiting.wanted.takes(entry)) {
            waiting.found += 1;
            if waiting.found == waiting.count {
                let reply = json!({
                    "count": waiting.found,
                    "entry": told(entry, world),
                    "next": entry.number + 1,
                });
                let tag = waiting.tag.take();
                self.waiting = None;
                return self.answer(tag, Ok(reply));
            }
        }
        waiting.next = waiting.next.max(journal.next());
        if now >= waiting.until {
            let refusal = Refusal {
                at: "wait".to_string(),
                got: format!("{} within {} s", waiting.found, waiting.timeout.as_secs_f64()),
                allowed: format!("{} of them", waiting.count),
            };
            let tag = waiting.tag.take();
            self.waiting = None;
            self.answer(tag, Err(refusal));
        }
    }

    fn tell_followed(&mut self, world: &World) {
        let Some(mut follows) = self.follows.take() else { return };
        if follows.resets != world.resets() {
            (follows.next, follows.resets) = (0, world.resets());
        }
        let journal = world.journal();
        follows.lost += journal.lost_since(follows.next);
        for entry in journal.since(follows.next).filter(|entry| follows.wanted.takes(entry)) {
            if self.output.len() >= MOST_UNREAD / 2 {
                follows.lost += 1;
                self.dropped += 1;
                continue;
            }
            let mut event = Map::new();
            event.insert("event".to_string(), told(entry, world));
            if follows.lost > 0 {
                event.insert("lost".to_string(), json!(std::mem::take(&mut follows.lost)));
            }
            self.say(&Value::Object(event));
        }
        follows.next = journal.next();
        self.follows = Some(follows);
    }
}

fn log(wanted: &Wanted, most: usize, world: &World) -> Value {
    let journal = world.journal();
    let (mut entries, mut next, mut bytes) = (Vec::new(), journal.next(), 0);
    for entry in journal.since(wanted.since()).filter(|entry| wanted.takes(entry)) {
        if entries.len() == most || bytes > LONG_REPLY {
            next = entry.number;
            break;
        }
        let told = told(entry, world);
        bytes += told.to_string().len();
        entries.push(told);
    }
    json!({"entries": entries, "next": next, "lost": journal.lost_since(wanted.since())})
}

/// Says something as the line's host, in time that passes only here; what comes back.
fn send(
    world: &mut World,
    line: &str,
    bytes: &[u8],
    baud_bps: Option<u32>,
    time_ns: u64,
) -> Result<Value, Refusal> {
    let number = world.line_of(line)?;
    if !world.is_frozen() {
        return Err(crate::SimError::TimeRuns.into());
    }
    let line_bps = world.line_baud_bps(number).filter(|&bps| bps > 0);
    let Some(baud_bps) = baud_bps.or(line_bps) else {
        let (at, got) = ("request, key line".to_string(), format!("{line:?}, a CAN line"));
        return Err(Refusal { at, got, allowed: "a serial line".to_string() });
    };
    let until_ns = world.now_ns() + time_ns;
    world.transmit(number, bytes, baud_bps);
    let (mut heard, mut buffer) = (Vec::new(), [0; 4096]);
    loop {
        let count = world.receive(number, &mut buffer, until_ns);
        heard.extend_from_slice(buffer.get(..count).unwrap_or_default());
        if count == 0 || heard.len() > LONG_REPLY {
            break;
        }
    }
    world.step(until_ns.saturating_sub(world.now_ns()))?;
    Ok(json!({"bytes": hex(&heard), "at_s": seconds(world.now_ns())}))
}
