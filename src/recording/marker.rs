//! Marks that a person sets while a recording runs.

use super::message::{Stamp, parse};
use crate::time::Instant;
use serde::{Deserialize, Serialize};

/// Where marks are.
pub(super) const TOPIC: &str = "/marker";

/// A mark.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Marker {
    /// When it was set, host's monotonic clock.
    pub at: Instant,
    /// What it says.
    pub text: String,
}

/// `/marker`, as Foxglove's log panel shows it (`foxglove.Log`,
/// <https://docs.foxglove.dev/docs/sdk/schemas/log>).
#[derive(Serialize, Deserialize)]
struct Log {
    timestamp: Stamp,
    /// 2 is INFO.
    level: u8,
    message: String,
    name: String,
    file: String,
    line: u32,
    host_monotonic_ns: u64,
}

impl Marker {
    /// The message at this wall clock.
    pub(super) fn message(&self, wall_ns: u64) -> serde_json::Result<Vec<u8>> {
        serde_json::to_vec(&Log {
            timestamp: Stamp::from_nanos(wall_ns),
            level: 2,
            message: self.text.clone(),
            name: "operator".to_owned(),
            file: String::new(),
            line: 0,
            host_monotonic_ns: self.at.as_nanos(),
        })
    }

    /// What a message says.
    pub(super) fn read(body: &[u8]) -> Option<Self> {
        let log: Log = parse(body)?;
        Some(Self { at: Instant::from_nanos(log.host_monotonic_ns), text: log.message })
    }
}
