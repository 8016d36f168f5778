//! Lines of text, kept as they are.

use super::LOOK;
use super::intake::{Intake, SourceReport};
use crate::capture::Counts;
use crate::port::{BytePort, Clock, MonotonicClock, PortError};
use crate::recording::SourceKind;

/// Longer lines are cut.
const LONGEST_LINE: usize = 4096;

/// A line of text whose port is open.
pub struct TextLines {
    name: String,
    address: String,
    port: Box<dyn BytePort>,
}

impl TextLines {
    /// Lines that come from `port`.
    pub fn new(name: String, address: &str, port: Box<dyn BytePort>) -> Self {
        Self { name, address: address.to_owned(), port }
    }

    /// Records until it is to stop or the port is gone.
    pub fn record(mut self, intake: &Intake) {
        let metadata = [("source", self.address.as_str())];
        let source = intake.add(&self.name, SourceKind::Lines, &metadata);
        intake.expects(&source, 0.0);
        let mut counts = Counts::default();
        let mut line = Vec::new();
        let mut buffer = [0_u8; 4096];
        let mut ended = None;
        while ended.is_none() && !intake.stopped() {
            match self.port.receive(&mut buffer, MonotonicClock.now() + LOOK) {
                Ok(count) => {
                    let arrival = MonotonicClock.now();
                    for &byte in &buffer[..count] {
                        if byte != b'\n' && line.len() < LONGEST_LINE {
                            line.push(byte);
                            continue;
                        }
                        let text = String::from_utf8_lossy(&line).trim_end().to_owned();
                        line.clear();
                        if byte != b'\n' {
                            line.push(byte);
                        }
                        counts.samples += 1;
                        intake.take_line(&source, arrival, text);
                    }
                }
                Err(PortError::TimedOut) => {}
                Err(error) => ended = Some(error.to_string()),
            }
        }
        if let Some(why) = &ended {
            intake.ended(&source, why);
        }
        let name = source.name.to_string();
        intake.report(SourceReport { name, counts, ended, ..SourceReport::default() });
    }
}
