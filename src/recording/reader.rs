//! The reading side: every recording, finished or not, and what can be saved of a broken one.

use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use mcap::records::{MessageHeader, Metadata};
use serde::Serialize;

use super::bounded::JOINTS;
use super::disk::{Disk, create_file, open};
use super::mcap_file::McapFile;
use super::message::{Cycle, Health, JointState, JointStates, Moment, Run, Topic, parse};
use super::overview::{Overview, SourceOverview};
use super::packing::Compression;
use super::sample::{CycleRecord, JointRecord, RunEnd, RunStart};
use super::scan::{Channel, Found, Tally, scan};
use crate::draft::Draft;
use crate::error::{Error, ErrorKind, counted};
use crate::time::Instant;

/// The largest file [`read`] takes into memory; [`summary`] and [`recover`] take any size.
const FILE_BYTES: u64 = 256 << 20;
/// Opcode, length and header of a message record, and its entry in the chunk's index.
const MESSAGE_OVERHEAD: usize = 9 + 22 + 16;
/// What a recording in memory may take beside three times its messages, bytes.
const MEMORY_BYTES: usize = 12 << 20;

/// A recording in memory.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Recording {
    /// What the run was; missing only if the very beginning of the file is damaged.
    pub start: Option<RunStart>,
    /// How the run ended; missing in an unfinished file.
    pub end: Option<RunEnd>,
    /// The joints, in the order of every record.
    pub joint_names: Vec<String>,
    /// The cycles that could be read, in file order.
    pub cycles: Vec<CycleRecord>,
    /// Cycles that the recorder dropped because the disk could not keep up.
    pub dropped_cycles: u64,
    /// Whether the file was closed as it should be.
    pub finished: bool,
    /// Bytes of the file that could not be used.
    pub lost_bytes: u64,
}

/// What [`recover`] saved.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Recovered {
    /// The new file.
    pub path: PathBuf,
    /// Messages in it.
    pub messages: u64,
    /// Whether the old file had been closed as it should be.
    pub was_finished: bool,
    /// Bytes of the old file that could not be used.
    pub lost_bytes: u64,
    /// Samples of sensors and cycles of a robot that had been stored and could not be read: those
    /// that are missing in the middle. What had not reached the file when it was cut off is not known.
    pub damaged: u64,
    /// What there is of each sensor and source of text.
    pub sources: BTreeMap<String, SourceOverview>,
}

/// The goals of a recording as a motion.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GoalSeries {
    /// The joints that had goals.
    pub joint_names: Vec<String>,
    /// Seconds since the first sample, strictly rising.
    pub times_s: Vec<f64>,
    /// One row per time, one goal per joint, radians.
    pub positions_rad: Vec<Vec<f64>>,
}

/// Reads a recording, as much of it as is whole.
///
/// # Errors
/// If the file cannot be opened, is no MCAP recording, or is over 256 MiB, packed or unpacked.
pub fn read(path: &Path) -> Result<Recording, Error> {
    let at_path = |error: Error| error.at(path.display().to_string());
    let file = open(path)?;
    let bytes = file.metadata().map(|metadata| metadata.len()).unwrap_or(0);
    if bytes > FILE_BYTES {
        return Err(at_path(
            Error::of(ErrorKind::Malformed, "the recording is too large to be read at once")
                .got(format!("{} MiB", bytes >> 20))
                .allowed(format!("{} MiB", FILE_BYTES >> 20)),
        ));
    }
    Recording::from_source(file).map_err(at_path)
}

/// What is read at once may unpack to no more than a file may have.
pub(super) fn check_unpacked(bytes: u64, most: u64) -> Result<(), Error> {
    if bytes <= most {
        return Ok(());
    }
    Err(Error::of(ErrorKind::Malformed, "the recording is too large to be read at once")
        .got(format!("more than {} MiB of messages", most >> 20))
        .allowed(format!("{} MiB", most >> 20)))
}

impl Recording {
    /// Reads a recording from any source of bytes; at most 256 MiB of it.
    ///
    /// # Errors
    /// As [`read`].
    pub fn from_source(source: impl Read) -> Result<Self, Error> {
        let mut recording = Self::default();
        let mut bytes_of_joints = 0;
        let tally = scan(BufReader::new(source).take(FILE_BYTES), |found| {
            let Found::Message { channel, body, .. } = found else { return Ok(()) };
            bytes_of_joints += body.len();
            if recording.add(&channel.topic, body).is_none() {
                recording.lost_bytes += body.len() as u64;
            }
            recording.check_size(bytes_of_joints)
        })?;
        recording.finished = tally.finished;
        recording.lost_bytes += tally.lost_bytes;
        Ok(recording)
    }

    /// Keeps memory in proportion to the file, whatever the file claims.
    fn check_size(&self, bytes: usize) -> Result<(), Error> {
        check_unpacked(bytes as u64, FILE_BYTES)?;
        let joints = self.joint_names.len();
        let memory = self.cycles.len() * (joints * size_of::<JointRecord>() + 64);
        let allowed = 3 * bytes + MEMORY_BYTES;
        if joints > JOINTS || memory > allowed {
            return Err(Error::new("the recording claims more joints than it has values for")
                .got(format!(
                    "{joints}, {}",
                    counted(self.cycles.len(), "cycle"),
                    joints = counted(joints, "joint")
                ))
                .allowed(format!("{JOINTS} joints")));
        }
        Ok(())
    }

    /// Adds one message; `None` if it is malformed. Other programs' topics are passed over.
    fn add(&mut self, topic: &str, body: &[u8]) -> Option<()> {
        match Topic::from_name(topic) {
            Some(Topic::Run) => self.add_run(body),
            Some(Topic::Goal) => self.add_joints(body, |record, read| {
                record.goal_rad = read.position;
            }),
            Some(Topic::Present) => self.add_joints(body, |record, read| {
                record.present_position_rad = read.position;
                record.present_velocity_rad_s = read.velocity;
                record.present_current_a = read.current_a;
                record.present_load_ratio = read.load_ratio;
                record.device_clock = read.device_clock_ticks;
            }),
            Some(Topic::Health) => self.add_health(body),
            Some(Topic::Cycle) => self.add_cycle(body),
            None => Some(()),
        }
    }

    fn add_run(&mut self, body: &[u8]) -> Option<()> {
        let run: Run = parse(body)?;
        self.dropped_cycles = self.dropped_cycles.saturating_add(run.dropped_before);
        if let Some(start) = run.start {
            self.joint_names = start.joints.iter().map(|joint| joint.name.clone()).collect();
            self.start = Some(start);
        }
        self.end = run.end.or(self.end.take());
        Some(())
    }

    fn add_joints(
        &mut self,
        body: &[u8],
        set: impl Fn(&mut JointRecord, &JointState),
    ) -> Option<()> {
        let states: JointStates = parse(body)?;
        self.learn_names(states.joints.iter().map(|joint| &joint.name));
        let is_usual = states.joints.iter().map(|joint| &*joint.name).eq(&self.joint_names);
        let mut names = BTreeSet::new();
        // A message that says two things of one joint says nothing.
        if !is_usual && !states.joints.iter().all(|joint| names.insert(&*joint.name)) {
            return None;
        }
        for (index, joint) in states.joints.iter().enumerate() {
            set(self.joint(&states.moment, index, &joint.name)?, joint);
        }
        Some(())
    }

    fn add_health(&mut self, body: &[u8]) -> Option<()> {
        let health: Health = parse(body)?;
        for (index, joint) in health.joints.iter().enumerate() {
            let record = self.joint(&health.moment, index, &joint.name)?;
            (record.temperature_c, record.voltage_v) = (joint.temperature_c, joint.voltage_v);
        }
        Some(())
    }

    fn add_cycle(&mut self, body: &[u8]) -> Option<()> {
        let cycle: Cycle = parse(body)?;
        self.dropped_cycles = self.dropped_cycles.saturating_add(cycle.dropped_before);
        self.cycle(&cycle.moment).base = cycle.base.map(|base| Box::new(base.into()));
        for (index, missed) in cycle.missed.into_iter().enumerate() {
            let record = self.joint(&cycle.moment, index, &missed.name)?;
            record.missed = Some(Cow::Owned(missed.reason.into_owned()));
        }
        Some(())
    }

    /// Without a readable start, the first message names the joints.
    fn learn_names<'a>(&mut self, names: impl Iterator<Item = &'a Cow<'a, str>>) {
        if self.joint_names.is_empty() {
            self.joint_names = names.take(JOINTS).map(|name| name.to_string()).collect();
        }
    }

    /// The record of a joint in the cycle of `moment`; `index` is where it most likely stands.
    fn joint(&mut self, moment: &Moment, index: usize, name: &str) -> Option<&mut JointRecord> {
        let likely = self.joint_names.get(index).is_some_and(|known| known == name);
        let index =
            if likely { index } else { self.joint_names.iter().position(|known| known == name)? };
        self.cycle(moment).joints.get_mut(index)
    }

    /// The messages of a cycle stand together: either the last record is of this cycle, or this
    /// is the first message of a new one.
    fn cycle(&mut self, moment: &Moment) -> &mut CycleRecord {
        let (cycle, at) = (moment.cycle, Instant::from_nanos(moment.host_monotonic_ns));
        let known = self.cycles.last().is_some_and(|last| last.cycle == cycle && last.at == at);
        if !known {
            let joints = vec![JointRecord::default(); self.joint_names.len().min(JOINTS)];
            self.cycles.push(CycleRecord { cycle, at, joints, base: None });
        }
        let last = self.cycles.len() - 1;
        &mut self.cycles[last]
    }
}

/// Writes everything that can be trusted in `path` to `FILE.recovered.mcap` beside it, as a
/// finished file. Takes any MCAP file, ours or not. Replaces a file only with `force`.
///
/// # Errors
/// If the file cannot be read or is no MCAP recording, or the new file exists or cannot be written.
pub fn recover(path: &Path, force: bool) -> Result<Recovered, Error> {
    recover_packed(path, None, force, Compression::default())
}

/// As [`recover`], to a file of its own (on another disk, where this one is full), packed as `packing` says.
///
/// # Errors
/// As [`recover`].
pub fn recover_packed(
    path: &Path,
    to: Option<&Path>,
    force: bool,
    packing: Compression,
) -> Result<Recovered, Error> {
    let source = open(path)?;
    let target = to.map_or_else(|| path.with_extension("recovered.mcap"), Path::to_owned);
    let draft = create_file(&target, force, true).map_err(|error| match error.remedy {
        Some(_) => error.remedy("move it away, or add --force to replace it"),
        None => error,
    })?;
    let mut copy = Copy::new(draft, packing);
    let mut overview = Overview::default();
    let copied = scan(BufReader::new(source), |found| {
        if let Found::Message { channel, header, body } = &found {
            overview.add(channel, header, body);
        }
        copy.add(found).map_err(|cause| unwritable(&target, &cause))
    })
    .and_then(|tally| {
        copy.finish(path, tally).map_err(|cause| unwritable(&target, &cause))?;
        Ok(tally)
    });
    match copied {
        Ok(tally) => Ok(Recovered {
            path: target,
            messages: copy.messages,
            was_finished: tally.finished,
            lost_bytes: tally.lost_bytes,
            damaged: overview.damaged(),
            sources: overview.sources,
        }),
        // Half a rescue would stand in the way of the next one: it is gone with its draft.
        Err(error) => {
            let place =
                error.place.clone().map_or_else(|| path.display().to_string(), String::from);
            Err(error.at(place))
        }
    }
}

fn unwritable(path: &Path, cause: &str) -> Error {
    Error::new("the recovered file cannot be written").at(path.display().to_string()).got(cause)
}

/// Copies what a scan finds into a new file.
struct Copy {
    draft: Draft,
    mcap: McapFile,
    /// Channels by their id in the old file, with the id in the new one.
    channels: BTreeMap<u16, (Arc<Channel>, u16)>,
    /// Written at the end: each would close a chunk, and chunks are remembered until then.
    metadata: Vec<Metadata>,
    messages: u64,
    chunk_bytes: usize,
}

impl Copy {
    fn new(draft: Draft, packing: Compression) -> Self {
        let mcap = McapFile::new(packing);
        let (channels, metadata) = Default::default();
        Self { draft, mcap, channels, metadata, messages: 0, chunk_bytes: 0 }
    }

    fn add(&mut self, found: Found) -> Result<(), String> {
        match found {
            Found::Metadata(metadata) => {
                self.metadata.push(metadata);
                Ok(())
            }
            Found::Message { channel, header, body } => {
                let channel_id = self.channel(header.channel_id, channel)?;
                let header = MessageHeader { channel_id, ..header };
                self.mcap.add_message(&header, body)?;
                self.messages += 1;
                self.chunk_bytes += MESSAGE_OVERHEAD + body.len();
                if self.chunk_bytes >= 1 << 20 { self.append() } else { Ok(()) }
            }
        }
    }

    fn channel(&mut self, old: u16, channel: &Arc<Channel>) -> Result<u16, String> {
        if let Some((known, new)) = self.channels.get(&old)
            && Arc::ptr_eq(known, channel)
        {
            return Ok(*new);
        }
        let schema = match &channel.schema {
            Some(schema) => self.mcap.add_schema(&schema.name, &schema.encoding, &schema.text),
            None => Ok(0),
        }?;
        let Channel { topic, encoding, metadata, .. } = channel.as_ref();
        let new = self.mcap.add_channel(schema, topic, encoding, metadata)?;
        self.channels.insert(old, (Arc::clone(channel), new));
        Ok(new)
    }

    fn append(&mut self) -> Result<(), String> {
        self.mcap.close_chunk()?;
        self.chunk_bytes = 0;
        self.draft.append(&self.mcap.take()).map_err(|error| error.to_string())
    }

    fn finish(&mut self, from: &Path, tally: Tally) -> Result<(), String> {
        let note = [
            ("from", from.display().to_string()),
            ("lost_bytes", tally.lost_bytes.to_string()),
            ("was_finished", tally.finished.to_string()),
        ];
        let metadata = note.map(|(key, value)| (key.to_owned(), value)).into();
        self.metadata.push(Metadata { name: "gaitway.recovered".into(), metadata });
        // What was in the last chunk goes first and alone: then the memory for it is free.
        self.append()?;
        for metadata in std::mem::take(&mut self.metadata) {
            self.mcap.add_metadata(&metadata)?;
        }
        self.mcap.finish()?;
        let written = self.draft.append(&self.mcap.take()).and_then(|()| self.draft.sync());
        let named = written.and_then(|()| self.draft.keep()).and_then(|()| self.draft.sync());
        named.map_err(|error| error.to_string())
    }
}

/// The recorded goals as a motion: the joints that had goals, at the cycles in which all of them
/// had one. Times count from the first of these on the host's monotonic clock; a cycle that is
/// not later than the one before it is left out.
#[must_use]
pub fn joint_series(recording: &Recording) -> GoalSeries {
    let cycles = &recording.cycles;
    let goal = |cycle: &CycleRecord, index: usize| cycle.joints.get(index)?.goal_rad;
    let moved: Vec<usize> = (0..recording.joint_names.len())
        .filter(|&index| cycles.iter().any(|cycle| goal(cycle, index).is_some()))
        .collect();
    let mut series = GoalSeries {
        joint_names: moved.iter().map(|&index| recording.joint_names[index].clone()).collect(),
        ..GoalSeries::default()
    };
    let (mut first, mut last) = (None, None);
    for cycle in cycles.iter().filter(|_| !moved.is_empty()) {
        let row: Option<Vec<f64>> = moved.iter().map(|&index| goal(cycle, index)).collect();
        let Some(row) = row.filter(|_| last.is_none_or(|last| cycle.at > last)) else { continue };
        last = Some(cycle.at);
        series.times_s.push(cycle.at.seconds_since(*first.get_or_insert(cycle.at)));
        series.positions_rad.push(row);
    }
    series
}
