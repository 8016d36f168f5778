//! What a recording holds, told in one pass and little memory.

use std::collections::BTreeMap;
use std::io::BufReader;
use std::path::Path;

use mcap::records::MessageHeader;
use serde::{Deserialize, Serialize};

use super::disk::open;
use super::imu_message::{SampleEncoding, SensorMessage};
use super::message::{Cycle, Run, Topic, parse};
use super::scan::{Channel, Found, scan};
use crate::error::Error;

/// Most sources that are listed; a recording's channels are fewer.
const SOURCES: usize = 4096;

/// What a file holds, without its values.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Overview {
    /// The robot's name, if the file says it.
    pub robot: Option<String>,
    /// The motion's name or path, if the file says it.
    pub motion: Option<String>,
    /// How the run ended, if the file says it.
    pub outcome: Option<String>,
    /// From the first to the last message, seconds.
    pub duration_s: f64,
    /// Messages by topic.
    pub channels: BTreeMap<String, u64>,
    /// What there is of each sensor and source of text.
    pub sources: BTreeMap<String, SourceOverview>,
    /// Readings of a joint that are missing, each a gap with a reason.
    pub missed_reads: u64,
    /// Cycles that the recorder dropped because the disk could not keep up.
    pub dropped_cycles: u64,
    /// Cycles that had been stored and cannot be read: the file is damaged there.
    pub damaged_cycles: u64,
    /// Samples of sensors that were lost on their way to the recorder.
    pub missed_samples: u64,
    /// Samples and lines that the recorder dropped because the disk could not keep up.
    pub dropped_samples: u64,
    /// Samples that had been stored and cannot be read: the file is damaged there.
    pub damaged_samples: u64,
    /// Whether the file was closed as it should be.
    pub finished: bool,
    /// Bytes of the file that could not be used.
    pub lost_bytes: u64,
    #[serde(skip)]
    span: Span,
    /// Number of the next cycle, if one was seen.
    #[serde(skip)]
    next_cycle: Option<u64>,
}

/// What a file holds of one source.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct SourceOverview {
    /// Samples or lines.
    pub records: u64,
    /// From the first to the last of them, as they were read, seconds.
    pub duration_s: f64,
    /// Places at which something is missing, for whatever reason.
    pub gaps: u64,
    /// Samples that the sensor or its line lost.
    pub missed: u64,
    /// Samples that were probably lost, of a sensor that tells neither number nor time.
    pub estimated: u64,
    /// Samples or lines that the recorder dropped because the disk could not keep up.
    pub dropped: u64,
    /// Samples that had been stored and cannot be read: the file is damaged there. Lines of text have
    /// no numbers, so none of theirs are known.
    pub damaged: u64,
    /// Samples that came twice.
    pub duplicates: u64,
    /// Samples that came out of order.
    pub late: u64,
    /// Times the device began again.
    pub resets: u64,
    /// Samples with a time or number that jumped, and that were not used.
    pub doubted: u64,
    /// Samples with a value beyond what their sensor measures, which is left out.
    pub beyond: u64,
    #[serde(skip)]
    span: Span,
    /// Number of the next sample.
    #[serde(skip)]
    next: u64,
}

/// The first and the last time of something, ns.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Span(Option<(u64, u64)>);

impl Span {
    /// Takes a time in and gives the length in seconds.
    fn take(&mut self, at_ns: u64) -> f64 {
        let (first, last) = self.0.unwrap_or((at_ns, at_ns));
        let (first, last) = (first.min(at_ns), last.max(at_ns));
        self.0 = Some((first, last));
        (last - first) as f64 / 1e9
    }
}

/// What of a sample or a line is counted.
#[derive(Deserialize)]
struct Numbered {
    number: Option<u64>,
    order: Option<String>,
    #[serde(default)]
    missed_before: u64,
    #[serde(default)]
    estimated_before: u64,
    #[serde(default)]
    dropped_before: u64,
    #[serde(default)]
    implausible: bool,
}

impl Numbered {
    /// A sample or a line of a channel with this encoding; `None` if it is none.
    fn read(encoding: &str, body: &[u8]) -> Option<Self> {
        if encoding == SampleEncoding::Json.name() {
            return parse(body);
        }
        let read = SensorMessage::read(encoding, "sample", body);
        let Some(SensorMessage::Sample(imu, _)) = read else { return None };
        Some(Self {
            number: Some(imu.number),
            order: Some(imu.order.clone().into_owned()),
            missed_before: imu.missed_before,
            estimated_before: imu.estimated_before,
            dropped_before: imu.dropped_before,
            implausible: imu.implausible,
        })
    }
}

impl SourceOverview {
    fn add(&mut self, sample: &Numbered, read_ns: u64) {
        self.records += 1;
        self.beyond += u64::from(sample.implausible);
        self.duration_s = self.span.take(read_ns);
        self.missed = self.missed.saturating_add(sample.missed_before);
        self.estimated = self.estimated.saturating_add(sample.estimated_before);
        self.dropped = self.dropped.saturating_add(sample.dropped_before);
        let told = sample.missed_before.saturating_add(sample.dropped_before);
        let mut gap = told > 0;
        if let Some(number) = sample.number {
            // The numbers count what is missing too, so what no sample tells of was in a broken part.
            let untold = number.saturating_sub(self.next).saturating_sub(told);
            self.damaged = self.damaged.saturating_add(untold);
            self.next = self.next.max(number.saturating_add(1));
            gap |= untold > 0;
        }
        self.gaps += u64::from(gap);
        match sample.order.as_deref() {
            Some("duplicate") => self.duplicates += 1,
            Some("late") => self.late += 1,
            Some("reset") => self.resets += 1,
            Some("doubted") => self.doubted += 1,
            _ => {}
        }
    }
}

impl Overview {
    /// Takes one message in, in the order of the file.
    pub(super) fn add(&mut self, channel: &Channel, header: &MessageHeader, body: &[u8]) {
        let topic = channel.topic.as_str();
        self.duration_s = self.span.take(header.log_time);
        match self.channels.get_mut(topic) {
            Some(count) => *count += 1,
            None => drop(self.channels.insert(topic.to_owned(), 1)),
        }
        match Topic::from_name(topic) {
            Some(Topic::Cycle) => self.add_cycle(body),
            Some(Topic::Run) => self.add_run(body),
            None => self.add_sample(channel, header, body),
            _ => {}
        }
    }

    /// What had been stored and cannot be read: cycles and samples.
    pub(super) fn damaged(&self) -> u64 {
        self.damaged_cycles.saturating_add(self.damaged_samples)
    }

    fn add_cycle(&mut self, body: &[u8]) {
        let Some(cycle) = parse::<Cycle>(body) else { return };
        self.missed_reads += cycle.missed.len() as u64;
        self.dropped_cycles = self.dropped_cycles.saturating_add(cycle.dropped_before);
        let number = cycle.moment.cycle;
        if let Some(next) = self.next_cycle {
            let untold = number.saturating_sub(next).saturating_sub(cycle.dropped_before);
            self.damaged_cycles = self.damaged_cycles.saturating_add(untold);
        }
        self.next_cycle = self.next_cycle.max(Some(number.saturating_add(1)));
    }

    fn add_run(&mut self, body: &[u8]) {
        let Some(run) = parse::<Run>(body) else { return };
        self.dropped_cycles = self.dropped_cycles.saturating_add(run.dropped_before);
        for (name, dropped) in run.dropped_by_source {
            if self.sources.len() >= SOURCES && !self.sources.contains_key(&name) {
                continue;
            }
            let source = self.sources.entry(name).or_default();
            source.dropped = source.dropped.saturating_add(dropped);
            source.gaps += 1;
            self.dropped_samples = self.dropped_samples.saturating_add(dropped);
        }
        if let Some(start) = run.start {
            (self.robot, self.motion) = (Some(start.robot), Some(start.motion));
        }
        self.outcome = run.end.map(|end| end.outcome).or(self.outcome.take());
    }

    fn add_sample(&mut self, channel: &Channel, header: &MessageHeader, body: &[u8]) {
        let topic = channel.topic.as_str();
        let sensor = topic.strip_prefix("/imu/").and_then(|rest| rest.strip_suffix("/sample"));
        let Some(name) = sensor.or_else(|| topic.strip_prefix("/lines/")) else { return };
        let Some(sample) = Numbered::read(&channel.encoding, body) else { return };
        if !self.sources.contains_key(name) {
            self.sources.insert(name.to_owned(), SourceOverview::default());
        }
        let Some(source) = self.sources.get_mut(name) else { return };
        let damaged = source.damaged;
        source.add(&sample, header.log_time);
        self.damaged_samples = self.damaged_samples.saturating_add(source.damaged - damaged);
        self.missed_samples = self.missed_samples.saturating_add(sample.missed_before);
        self.dropped_samples = self.dropped_samples.saturating_add(sample.dropped_before);
    }
}

/// Tells what a file holds, reading it once in little memory.
///
/// # Errors
/// If the file cannot be opened, is no MCAP recording or is packed beyond bounds.
pub fn summary(path: &Path) -> Result<Overview, Error> {
    let mut overview = Overview::default();
    let tally = scan(BufReader::new(open(path)?), |found| {
        if let Found::Message { channel, header, body } = found {
            overview.add(channel, &header, body);
        }
        Ok(())
    })
    .map_err(|error| error.at(path.display().to_string()))?;
    (overview.finished, overview.lost_bytes) = (tally.finished, tally.lost_bytes);
    Ok(overview)
}
