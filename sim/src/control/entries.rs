//! Entries of the journal: which are meant, and how they are told.

use super::request::{Filter, Refusal};
use crate::World;
use crate::can::Kind;
use crate::journal::{Entry, Happening};
use serde_json::{Map, Value, json};

/// A filter with all its names found.
#[derive(Clone, Debug)]
pub(super) struct Wanted {
    filter: Filter,
    line: Option<usize>,
    id: Option<u32>,
    /// Number and name of the joint.
    joint: Option<(usize, String)>,
}

impl Wanted {
    pub fn of(filter: Filter, world: &mut World) -> Result<Wanted, Refusal> {
        let mut line = filter.line.as_ref().map(|line| world.line_of(line)).transpose()?;
        let (mut id, mut joint) = (filter.id, None);
        if let Some(name) = &filter.joint {
            let (own_line, own_id) = world.line_and_id(name)?;
            (line, id) = (line.or(Some(own_line)), id.or(own_id.map(u32::from)));
            let number = world.joint_names().iter().position(|known| known == name);
            joint = number.map(|number| (number, name.clone()));
        }
        Ok(Wanted { filter, line, id, joint })
    }

    pub fn takes(&self, entry: &Entry) -> bool {
        let of_kind = self.filter.kind.is_none_or(|kind| kind == kind_of(&entry.what));
        let asks = self.filter.instruction.is_some() || self.filter.address.is_some();
        let line = |line: usize| self.line.is_none_or(|wanted| wanted == line);
        let no_id = self.id.is_none();
        of_kind
            && match &entry.what {
                Happening::Asked(asked) => {
                    let id = |id: u32| u8::try_from(id).is_ok_and(|id| asked.concerns(id));
                    let name = &self.filter.instruction;
                    line(asked.line)
                        && self.id.is_none_or(id)
                        && name.as_ref().is_none_or(|name| asked.instruction() == *name)
                        && self.filter.address.is_none_or(|at| asked.address == Some(at))
                }
                _ if asks => false,
                Happening::Answered { line: of, id, .. } => {
                    line(*of) && self.id.is_none_or(|wanted| wanted == u32::from(*id))
                }
                Happening::Frame { line: of, frame, .. } => {
                    line(*of) && self.id.is_none_or(|wanted| wanted == frame.id)
                }
                Happening::Struck(struck) => match (&self.joint, &self.filter.line) {
                    (Some((_, name)), _) => struck.place == *name,
                    (None, Some(line)) => struck.place == *line,
                    (None, None) => no_id,
                },
                Happening::Torque { joint, .. } => match &self.joint {
                    Some((number, _)) => number == joint,
                    None => self.line.is_none() && no_id,
                },
                Happening::Adapter { line: of, .. } => line(*of) && self.joint.is_none(),
                Happening::Fell { .. } => self.line.is_none() && no_id && self.joint.is_none(),
                Happening::Reset => true,
            }
    }

    /// The number of the first entry that is meant.
    pub fn since(&self) -> u64 {
        self.filter.since
    }
}

fn kind_of(what: &Happening) -> &'static str {
    match what {
        Happening::Asked(_) => "asked",
        Happening::Answered { .. } => "answered",
        Happening::Frame { .. } => "frame",
        Happening::Struck(_) => "struck",
        Happening::Torque { .. } => "torque",
        Happening::Adapter { .. } => "adapter",
        Happening::Fell { .. } => "fell",
        Happening::Reset => "reset",
    }
}

pub(super) fn seconds(time_ns: u64) -> f64 {
    time_ns as f64 / 1e9
}

pub(super) fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// An entry as it is told.
pub(super) fn told(entry: &Entry, world: &World) -> Value {
    let mut told = Map::new();
    told.insert("n".to_string(), json!(entry.number));
    told.insert("at_s".to_string(), json!(seconds(entry.at_ns)));
    told.insert("kind".to_string(), json!(kind_of(&entry.what)));
    let mut put = |key: &str, value: Value| drop(told.insert(key.to_string(), value));
    let line_name = |line: usize| json!(world.line_names().get(line));
    match &entry.what {
        Happening::Asked(asked) => {
            put("line", line_name(asked.line));
            put("id", json!(asked.id));
            put("instruction", json!(asked.instruction()));
            if let Some(address) = asked.address {
                put("address", json!(address));
                let of = asked.ids.first().copied().unwrap_or(asked.id);
                if let Some(name) = world.register_name(asked.line, of, address) {
                    put("register", json!(name));
                }
            }
            if !asked.ids.is_empty() {
                put("ids", json!(asked.ids));
            }
            put("params", json!(hex(&asked.params)));
            put("bytes", json!(hex(&asked.bytes)));
        }
        Happening::Answered { line, id, bytes } => {
            put("line", line_name(*line));
            put("id", json!(id));
            put("bytes", json!(hex(bytes)));
        }
        Happening::Frame { line, from_host, frame } => {
            put("line", line_name(*line));
            put("from_host", json!(from_host));
            put("id", json!(frame.id));
            put("extended", json!(frame.extended));
            let (fd, remote) =
                (matches!(frame.kind, Kind::Fd { .. }), matches!(frame.kind, Kind::Remote(_)));
            put("fd", json!(fd));
            put("remote", json!(remote));
            put("bytes", json!(hex(&frame.bytes)));
        }
        Happening::Struck(struck) => {
            put("fault", json!(struck.fault));
            put("place", json!(struck.place));
            if let Some(nth) = struck.nth {
                put("nth", json!(nth));
            }
        }
        Happening::Torque { joint, on } => {
            put("joint", json!(world.joint_names().get(*joint)));
            put("on", json!(on));
        }
        Happening::Adapter { line, plugged } => {
            put("line", line_name(*line));
            put("plugged", json!(plugged));
        }
        Happening::Fell { on } => put("on", json!(Some(on).filter(|on| !on.is_empty()))),
        Happening::Reset => {}
    }
    Value::Object(told)
}
