//! Requests as they come, and what they ask for.

use crate::SimError;
use crate::fault::Fault;
use crate::hand::Hand;
use crate::script::keys::Keys;
use crate::script::{ScriptError, read_fault};
use serde_json::Value as Json;
use toml::{Table, Value};

/// Longest time that is stepped over at once, and longest that is waited, s.
const LONGEST_STEP_S: f64 = 60.0;
const LONGEST_WAIT_S: f64 = 3600.0;
/// Shortest and longest words of a program's own in a request.
const TAG_BYTES: usize = 200;
/// Bytes a host says at once.
const MOST_SENT: usize = 4096;
/// Entries in one reply, and how many are waited for.
const MOST_ENTRIES: i64 = 1000;
const MOST_AWAITED: i64 = 100_000;
/// All kinds of entries.
pub(super) const KINDS: [&str; 8] =
    ["asked", "answered", "frame", "struck", "torque", "adapter", "fell", "reset"];

/// Why a request is not done.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Refusal {
    pub at: String,
    pub got: String,
    pub allowed: String,
}

impl From<ScriptError> for Refusal {
    fn from(ScriptError { at, got, allowed }: ScriptError) -> Self {
        Self { at, got, allowed }
    }
}

/// What a program asks for.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Request {
    About,
    State { joint: String },
    Get { servo: String, register: Option<String> },
    Set { servo: String, register: String, value: i64 },
    Hand { joint: String, to_rad: f64, speed_rad_s: f64, torque_nm: Option<f64>, holds_on: bool },
    LetGo { joint: String },
    Plug { servo: String, plugged: bool },
    Adapter { line: String, plugged: bool },
    Begin { faults: Vec<Fault> },
    End { fault: u64 },
    Reset,
    Freeze,
    Run,
    Step { time_ns: u64 },
    Log { filter: Filter, most: usize },
    Count { filter: Filter },
    Wait { filter: Filter, count: u64, timeout_s: f64 },
    Subscribe { filter: Filter },
    Unsubscribe,
    Send { line: String, bytes: Vec<u8>, baud_bps: Option<u32>, time_ns: u64 },
}

impl Request {
    /// The hand that is meant; how strong it is unless told depends on the joint.
    pub fn hand(to_rad: f64, speed_rad_s: f64, torque_nm: f64, holds_on: bool) -> Hand {
        Hand { to_rad, speed_rad_s, torque_nm, holds_on }
    }
}

/// Which entries of the journal are meant.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Filter {
    pub since: u64,
    pub kind: Option<&'static str>,
    pub joint: Option<String>,
    pub line: Option<String>,
    pub id: Option<u32>,
    pub instruction: Option<String>,
    pub address: Option<u16>,
}

const VERBS: &str = "about, state, get, set, hand, let-go, plug, unplug, fault, end, reset, freeze, \
                     step, run, log, count, wait, subscribe, unsubscribe, send";

/// A request and the words of a program's own that its reply carries too.
pub(super) fn read(line: &str, now_ns: u64) -> (Option<Json>, Result<Request, Refusal>) {
    let wrong = |got: &str, allowed: &str| Refusal {
        at: "request".to_string(),
        got: got.to_string(),
        allowed: allowed.to_string(),
    };
    let mut object = match serde_json::from_str::<Json>(line) {
        Ok(Json::Object(object)) => object,
        Ok(_) => return (None, Err(wrong("no object", "one JSON object on a line"))),
        Err(error) => {
            return (None, Err(wrong(&error.to_string(), "one JSON object on a line")));
        }
    };
    let tag = object.shift_remove("tag");
    if tag.as_ref().is_some_and(|tag| tag.to_string().len() > TAG_BYTES) {
        let allowed = format!("a tag of at most {TAG_BYTES} bytes");
        return (None, Err(wrong("a longer tag", &allowed)));
    }
    let mut table = Table::new();
    for (key, value) in object {
        match value_of(value) {
            Some(value) => drop(table.insert(key, value)),
            None => {
                let got = format!("null in {key}");
                return (tag, Err(wrong(&got, "keys that are not there instead of null")));
            }
        }
    }
    let request = request(Keys::new("request".to_string(), table).at(now_ns));
    (tag, request.map_err(Refusal::from))
}

fn value_of(value: Json) -> Option<Value> {
    Some(match value {
        Json::Null => return None,
        Json::Bool(truth) => Value::Boolean(truth),
        Json::Number(number) => match number.as_i64() {
            Some(whole) => Value::Integer(whole),
            None => Value::Float(number.as_f64()?),
        },
        Json::String(text) => Value::String(text),
        Json::Array(list) => Value::Array(list.into_iter().map(value_of).collect::<Option<_>>()?),
        Json::Object(object) => {
            let pairs = object.into_iter().map(|(key, value)| Some((key, value_of(value)?)));
            Value::Table(pairs.collect::<Option<Table>>()?)
        }
    })
}

fn request(mut keys: Keys) -> Result<Request, ScriptError> {
    // A program that was written for another version is refused here.
    keys.integer("version", 1, i64::from(super::VERSION))?;
    let verb = keys.need_text("do")?;
    let request = match verb.as_str() {
        "about" => Request::About,
        "state" => Request::State { joint: keys.need_name("joint")? },
        "get" => Request::Get { servo: servo(&mut keys)?, register: register(&mut keys)? },
        "set" => {
            let servo = servo(&mut keys)?;
            let register = register(&mut keys)?;
            let register = register.ok_or_else(|| keys.missing("register", "a register"))?;
            let value = keys.need_integer("value", i64::from(i32::MIN), i64::from(u32::MAX))?;
            Request::Set { servo, register, value }
        }
        "hand" => {
            let joint = keys.need_name("joint")?;
            let to_rad = keys.number("to_rad", -1e6, 1e6)?;
            Request::Hand {
                joint,
                to_rad: to_rad.ok_or_else(|| keys.missing("to_rad", "an angle, rad"))?,
                speed_rad_s: keys.number("speed_rad_s", 1e-6, 1e6)?.unwrap_or(1.0),
                torque_nm: keys.number("torque_nm", 1e-9, 1e6)?,
                holds_on: keys.truth("hold")?.unwrap_or(false),
            }
        }
        "let-go" => Request::LetGo { joint: keys.need_name("joint")? },
        "plug" | "unplug" => {
            let plugged = verb == "plug";
            match keys.has("line") && !keys.has("id") {
                true => Request::Adapter { line: keys.need_name("line")?, plugged },
                false => Request::Plug { servo: servo(&mut keys)?, plugged },
            }
        }
        "fault" => return Ok(Request::Begin { faults: read_fault(keys)? }),
        "end" => Request::End { fault: keys.need_integer("fault", 0, i64::MAX)? as u64 },
        "reset" => Request::Reset,
        "freeze" => Request::Freeze,
        "run" => Request::Run,
        "step" => Request::Step { time_ns: time_ns(&mut keys, LONGEST_STEP_S, None)? },
        "log" => {
            let filter = filter(&mut keys)?;
            let most = keys.integer("most", 1, MOST_ENTRIES)?.unwrap_or(MOST_ENTRIES);
            Request::Log { filter, most: most as usize }
        }
        "count" => Request::Count { filter: filter(&mut keys)? },
        "wait" => Request::Wait {
            filter: filter(&mut keys)?,
            count: keys.integer("count", 1, MOST_AWAITED)?.unwrap_or(1) as u64,
            timeout_s: keys.number("timeout_s", 0.0, LONGEST_WAIT_S)?.unwrap_or(1.0),
        },
        "subscribe" => Request::Subscribe { filter: filter(&mut keys)? },
        "unsubscribe" => Request::Unsubscribe,
        "send" => {
            let line = keys.need_name("line")?;
            let text = keys.need_text("bytes")?;
            let bytes = hex(&text).filter(|bytes| bytes.len() <= MOST_SENT);
            let allowed = format!("at most {MOST_SENT} bytes in hexadecimal, two digits each");
            let bytes = bytes.ok_or_else(|| keys.wrong("bytes", "something else", &allowed))?;
            let baud_bps = keys.integer("baud_bps", 1, 100_000_000)?.map(|bps| bps as u32);
            Request::Send { line, bytes, baud_bps, time_ns: time_ns(&mut keys, 10.0, Some(0.005))? }
        }
        _ => return Err(keys.wrong("do", &format!("{verb:?}"), VERBS)),
    };
    keys.finish()?;
    Ok(request)
}

fn servo(keys: &mut Keys) -> Result<String, ScriptError> {
    keys.servo()?.ok_or_else(|| keys.missing("joint", "a joint, or line and id"))
}

/// By its name, or by its address.
fn register(keys: &mut Keys) -> Result<Option<String>, ScriptError> {
    match keys.integer_if("register", 0, i64::from(u16::MAX))? {
        Some(address) => Ok(Some(address.to_string())),
        None => keys.name("register"),
    }
}

fn time_ns(keys: &mut Keys, longest_s: f64, usual_s: Option<f64>) -> Result<u64, ScriptError> {
    let seconds = keys.number("for_s", 0.0, longest_s)?.or(usual_s);
    let allowed = format!("seconds from 0 to {longest_s}");
    let seconds = seconds.ok_or_else(|| keys.missing("for_s", &allowed))?;
    Ok((seconds * 1e9).round() as u64)
}

fn filter(keys: &mut Keys) -> Result<Filter, ScriptError> {
    Ok(Filter {
        since: keys.integer("since", 0, i64::MAX)?.unwrap_or(0) as u64,
        kind: keys.choice("kind", KINDS.map(|kind| (kind, kind)))?,
        joint: keys.name("joint")?,
        line: keys.name("line")?,
        id: keys.integer("id", 0, 0x1FFF_FFFF)?.map(|id| id as u32),
        instruction: keys.name("instruction")?,
        address: keys.integer("address", 0, i64::from(u16::MAX))?.map(|address| address as u16),
    })
}

/// `FF FF 01` or `ffff01`.
fn hex(text: &str) -> Option<Vec<u8>> {
    let digits: Vec<u32> = text
        .chars()
        .filter(|c| !c.is_ascii_whitespace())
        .map(|c| c.to_digit(16))
        .collect::<Option<_>>()?;
    let pairs = digits.chunks(2).map(|pair| match *pair {
        [high, low] => u8::try_from(high << 4 | low).ok(),
        _ => None,
    });
    pairs.collect()
}

impl From<SimError> for Refusal {
    fn from(error: SimError) -> Self {
        let allowed = match &error {
            SimError::UnknownRegister { known, .. } => known.clone(),
            SimError::Value { low, high, .. } => format!("{low}..{high}"),
            SimError::UnknownJoint(_) => {
                "a joint, or LINE/ID with the ID it had at first; about names them".to_string()
            }
            SimError::UnknownLine(_) => "a line; about names them".to_string(),
            SimError::TimeRuns => "freeze, then step or send".to_string(),
            SimError::Held(_) => {
                "torque off; or hand, which takes the joint there against its torque \
                 (torque_nm), and holds it (hold)"
                    .to_string()
            }
            SimError::NoRegisters(_) => "state tells how its joint is".to_string(),
            SimError::NoSuchFault(_) => "the number that fault gave, once".to_string(),
            _ => "something else".to_string(),
        };
        Self { at: "request".to_string(), got: error.to_string(), allowed }
    }
}
