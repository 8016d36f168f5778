//! The recording's thread: turns records into chunks of one file that only grows, and counts what
//! is safe.

use std::collections::BTreeMap;
use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, TryRecvError, channel};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::{Duration, Instant as Clock};

use mcap::records::{MessageHeader, Metadata};

use super::disk::{Disk, Syncer};
use super::imu_message::SampleEncoding;
use super::mcap_file::McapFile;
use super::message::{self, Run, Stamp, Topic};
use super::packing::Compression;
use super::sample::{CycleRecord, RunEnd, RunStart};
use super::sensor::{self, RecordedSource, SourceChannel, SourceId, SourceRecord};
use crate::time::Instant;

/// A chunk is also closed at this size, which bounds the memory it takes.
const CHUNK_BYTES: usize = 1 << 20;
/// So much is appended between two looks at whether anybody waits still.
const PIECE_BYTES: usize = 1 << 16;
/// How often it is looked whether a synchronisation has come to its end, where nothing else comes.
const SYNC_LOOK: Duration = Duration::from_millis(100);

/// When a recording takes the place of the file it replaces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Keep {
    /// With its first cycle: what sensors say before the robot moves is worth no other recording.
    FirstCycle,
    /// With whatever comes first.
    First,
    /// When it is finished and nothing is missing.
    Whole,
}

impl Keep {
    /// As usual for a recording of a robot, or of none.
    pub(super) fn usual(start: &RunStart) -> Self {
        if start.joints.is_empty() { Self::First } else { Self::FirstCycle }
    }
}

/// How often the thread lets go of what it holds. Zero is "after every cycle".
#[derive(Clone, Copy, Debug)]
pub struct Pace {
    /// The longest a message stays in memory before its chunk is appended.
    pub chunk: Duration,
    /// The longest an appended chunk stays unsynchronised on a disk that keeps up. Zero waits for the
    /// disk every time.
    pub sync: Duration,
}

impl Default for Pace {
    fn default() -> Self {
        Self { chunk: Duration::from_millis(250), sync: Duration::from_secs(1) }
    }
}

/// What became of everything a [`Recorder`](super::Recorder) was given.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Summary {
    /// Messages stored.
    pub messages: u64,
    /// Messages refused by the full queue, by topic.
    pub dropped: BTreeMap<String, u64>,
    /// Messages taken from the queue but not stored, because the disk failed.
    pub lost: u64,
    /// Bytes appended to the file.
    pub bytes: u64,
    /// Why writing ended early, if it did.
    pub poisoned: Option<String>,
    /// True if nothing came that is worth another recording: the one that was to be replaced is as it
    /// was.
    pub kept_old: bool,
}

impl Summary {
    /// Whether everything the recorder was given is in the file, and the file is complete.
    #[must_use]
    pub fn is_complete(&self) -> bool {
        self.dropped.is_empty() && self.lost == 0 && self.poisoned.is_none()
    }
}

/// Why a recording ends without its last messages on a disk that does not keep up.
const TOO_SLOW: &str = "the disk is too slow for what was still to be written";

pub(super) enum Item {
    /// A cycle, and how many were dropped just before it.
    Cycle(CycleRecord, u64),
    /// A record of a source, and how many were dropped just before it.
    Record(SourceId, SourceRecord, u64),
    /// The end, and what was dropped just before it: cycles, and records by source.
    End(RunEnd, u64, BTreeMap<String, u64>),
}

/// What the recorder and its thread both look at. Nobody waits while holding it.
#[derive(Debug, Default)]
pub(super) struct Shared {
    /// Added sources, in the order of their numbers, and how samples of each are written.
    pub(super) sources: Mutex<Vec<(RecordedSource, SampleEncoding)>>,
    /// How samples of sources that are added are written.
    pub(super) samples: OnceLock<SampleEncoding>,
    /// Why writing ended early.
    pub(super) failure: OnceLock<String>,
    /// Nothing of it is wanted.
    pub(super) discarded: AtomicBool,
    /// Whoever waits for its end waits until then.
    pub(super) ends_by: OnceLock<Clock>,
}

impl Shared {
    /// True once nobody waits for the disk any more.
    fn is_over(&self) -> bool {
        self.ends_by.get().is_some_and(|by| Clock::now() >= *by)
    }
}

/// A source whose channels are in the file.
struct Written {
    name: String,
    samples: SampleEncoding,
    channels: Vec<u16>,
}

/// The thread's side: turns records into chunks and counts what is safe.
pub(super) struct Log<D> {
    disk: D,
    mcap: McapFile,
    channels: [u16; Topic::ALL.len()],
    sequences: [u32; Topic::ALL.len()],
    /// Sources whose channels are in the file.
    sources: Vec<Written>,
    shared: Arc<Shared>,
    start: RunStart,
    pace: Pace,
    keep: Keep,
    is_kept: bool,
    /// True if a source said something.
    holds_records: bool,
    /// Size and count of the open chunk, and when its first message came.
    chunk_bytes: usize,
    in_chunk: u64,
    chunk_opened: Clock,
    /// Messages appended but not yet synchronised, and when the last synchronisation was.
    since_sync: u64,
    last_sync: Clock,
    syncs: Syncs,
    last_at: Instant,
    summary: Summary,
}

impl<D: Disk> Log<D> {
    /// Writes the start of the run and, if a robot is recorded, waits until it is on the disk.
    pub(super) fn create(disk: D, start: RunStart, pace: Pace, keep: Keep) -> Result<Self, String> {
        let mut mcap = McapFile::new(Compression::default());
        let mut channels = [0; Topic::ALL.len()];
        for (topic, channel) in Topic::ALL.into_iter().zip(&mut channels) {
            *channel = add_topic(&mut mcap, topic)?;
        }
        let now = Clock::now();
        let syncs = disk.syncer().and_then(Syncs::begin).map_err(|error| error.to_string())?;
        let mut log = Self {
            disk,
            syncs,
            mcap,
            channels,
            sequences: [0; Topic::ALL.len()],
            sources: Vec::new(),
            shared: Arc::default(),
            last_at: start.monotonic_start,
            start,
            pace,
            keep,
            is_kept: false,
            holds_records: false,
            chunk_bytes: 0,
            in_chunk: 0,
            chunk_opened: now,
            since_sync: 0,
            last_sync: now,
            summary: Summary::default(),
        };
        log.open_chunk(1);
        log.write_start().and_then(|()| log.close_chunk())?;
        if log.start.joints.is_empty() && !log.pace.sync.is_zero() {
            // Nothing moves, but somebody performs: what sensors say is taken while a slow disk works.
            log.syncs.ask(log.since_sync);
        } else {
            log.sync()?;
        }
        Ok(log)
    }

    /// What is also seen from outside the thread.
    pub(super) fn shared(&self) -> Arc<Shared> {
        Arc::clone(&self.shared)
    }

    /// Takes records until the recorder lets go, whatever the disk does meanwhile.
    pub(super) fn run(mut self, taken: &Receiver<Item>) -> Summary {
        let mut is_finished = false;
        loop {
            let item = taken.recv_timeout(self.patience());
            self.attempt(0, Self::add_sources);
            match item {
                Ok(Item::Cycle(record, gap)) => {
                    if self.keep != Keep::Whole {
                        self.keep_file();
                    }
                    self.take(&record, gap);
                }
                Ok(Item::Record(source, record, gap)) => {
                    if self.keep == Keep::First {
                        self.keep_file();
                    }
                    self.take_record(source, &record, gap);
                }
                Ok(Item::End(end, gap, of_sources)) => {
                    is_finished = true;
                    self.attempt(1, |log| {
                        log.write_end(&end, gap, of_sources).and_then(|()| log.close_file())
                    });
                    break;
                }
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => {
                    self.attempt(0, |log| log.close_chunk().and_then(|()| log.sync()));
                    break;
                }
            }
            self.attempt(0, Self::close_what_is_due);
        }
        self.settle_name(is_finished);
        self.summary
    }

    /// Gives the file its name.
    fn keep_file(&mut self) {
        if !self.is_kept {
            self.is_kept = true;
            self.attempt(0, |log| {
                log.disk.keep().map_err(|cause| format!("the old file cannot be replaced: {cause}"))
            });
        }
    }

    /// Decides about the name of a file that was not worth it while it was written. One that replaces
    /// none is left under its own unless nobody wants it.
    fn settle_name(&mut self, is_finished: bool) {
        if self.shared.discarded.load(Ordering::Acquire) {
            return;
        }
        let is_whole = self.summary.poisoned.is_none();
        let is_worth_it = match self.keep {
            Keep::Whole => is_finished && is_whole,
            Keep::First | Keep::FirstCycle => {
                is_finished && self.holds_records || !self.disk.replaces()
            }
        };
        if is_worth_it {
            self.keep_file();
        }
        self.summary.kept_old = self.disk.replaces();
    }

    /// How long nothing needs to be done.
    fn patience(&self) -> Duration {
        let idle = Duration::from_secs(1);
        if self.summary.poisoned.is_some() {
            return idle;
        }
        let chunk = (self.in_chunk > 0).then_some(self.chunk_opened + self.pace.chunk);
        let sync = match self.syncs.asked {
            Some(_) => Some(Clock::now() + SYNC_LOOK),
            None => (self.since_sync > 0).then_some(self.last_sync + self.pace.sync),
        };
        let due = chunk.into_iter().chain(sync).min();
        due.map_or(idle, |due| due.saturating_duration_since(Clock::now()))
    }

    fn close_what_is_due(&mut self) -> Result<(), String> {
        self.settle_sync(Wait::No)?;
        let chunk_is_old = self.chunk_opened.elapsed() >= self.pace.chunk;
        if self.in_chunk > 0 && (chunk_is_old || self.chunk_bytes >= CHUNK_BYTES) {
            self.close_chunk()?;
        }
        let is_due = self.since_sync > 0 && self.last_sync.elapsed() >= self.pace.sync;
        if is_due && self.syncs.asked.is_none() {
            self.syncs.ask(self.since_sync);
            if self.pace.sync.is_zero() {
                self.settle_sync(Wait::Yes)?;
            }
        }
        Ok(())
    }

    fn attempt(&mut self, messages: u64, step: impl FnOnce(&mut Self) -> Result<(), String>) {
        if self.in_chunk > 0 && self.summary.poisoned.is_none() && self.shared.is_over() {
            self.poison(TOO_SLOW.to_owned());
        }
        if self.summary.poisoned.is_some() {
            self.summary.lost += messages;
            return;
        }
        self.open_chunk(messages);
        if let Err(cause) = step(self) {
            self.poison(cause);
        }
    }

    /// Nothing is written any more.
    fn poison(&mut self, cause: String) {
        self.summary.lost += self.in_chunk;
        self.in_chunk = 0;
        // Only the first failure poisons, so nobody has set it before.
        let _ = self.shared.failure.set(cause.clone());
        self.summary.poisoned = Some(cause);
    }

    fn open_chunk(&mut self, messages: u64) {
        if self.in_chunk == 0 && messages > 0 {
            self.chunk_opened = Clock::now();
        }
        self.in_chunk += messages;
    }

    fn take(&mut self, record: &CycleRecord, gap: u64) {
        let wall_ns = self.start.wall_nanos(record.at);
        self.last_at = self.last_at.max(record.at);
        self.attempt(message::topics(record).count() as u64, |log| {
            let messages = message::of_cycle(&log.start.joints, record, wall_ns, gap)
                .map_err(|error| error.to_string())?;
            messages.iter().try_for_each(|(topic, json)| log.write(*topic, wall_ns, json))
        });
    }

    /// Writes down the channels of sources that were added since.
    fn add_sources(&mut self) -> Result<(), String> {
        let added: Vec<_> = locked(&self.shared.sources)[self.sources.len()..].to_vec();
        for (source, samples) in added {
            let channels = add_channels(&mut self.mcap, &source, samples)?;
            self.sources.push(Written { name: source.name, samples, channels });
        }
        Ok(())
    }

    fn take_record(&mut self, source: SourceId, record: &SourceRecord, gap: u64) {
        let (read, true_at) = record.moments();
        self.last_at = self.last_at.max(read);
        let (log_time, publish_time) =
            (self.start.wall_nanos(read), self.start.wall_nanos(true_at));
        let sequence = match record {
            SourceRecord::Sample(captured) => captured.stamp.number as u32,
            SourceRecord::Line(..) | SourceRecord::Mark(_) => 0, // no number, by the format
        };
        self.holds_records = true;
        let samples = self.sources.get(source.0).map_or_else(Default::default, |of| of.samples);
        self.attempt(sensor::message_count(record, samples) as u64, |log| {
            let Written { name, samples, channels } =
                log.sources.get(source.0).ok_or("a source that was not added")?;
            let messages = sensor::messages(name, record, *samples, publish_time, gap)
                .map_err(|error| error.to_string())?;
            for (channel, bytes) in messages {
                let channel_id = channels.get(channel).copied().unwrap_or_default();
                let header = MessageHeader { channel_id, sequence, log_time, publish_time };
                log.chunk_bytes += bytes.len();
                log.mcap.add_message(&header, &bytes)?;
            }
            Ok(())
        });
    }

    fn write_start(&mut self) -> Result<(), String> {
        let start = &self.start;
        let names: Vec<_> = start.joints.iter().map(|joint| joint.name.as_str()).collect();
        let wall_ns = start.wall_nanos(start.monotonic_start);
        let mut metadata = start.metadata.clone();
        metadata.insert("robot".into(), start.robot.clone());
        metadata.insert("motion".into(), start.motion.clone());
        metadata.insert("joints".into(), names.join(","));
        metadata.insert("gaitway_version".into(), start.gaitway_version.clone());
        metadata.insert("wall_clock_start_ns".into(), wall_ns.to_string());
        metadata.insert("monotonic_start_ns".into(), start.monotonic_start.as_nanos().to_string());
        let run = Run {
            timestamp: Stamp::from_nanos(wall_ns),
            dropped_before: 0,
            dropped_by_source: BTreeMap::new(),
            start: Some(start.clone()),
            end: None,
        };
        let json = serde_json::to_vec(&run).map_err(|error| error.to_string())?;
        self.write_metadata("gaitway.start", metadata)?;
        self.write(Topic::Run, wall_ns, &json)
    }

    fn write_end(
        &mut self,
        end: &RunEnd,
        gap: u64,
        dropped_by_source: BTreeMap<String, u64>,
    ) -> Result<(), String> {
        let wall_ns = self.start.wall_nanos(end.at.max(self.last_at));
        let mut metadata = end.metadata.clone();
        metadata.insert("outcome".into(), end.outcome.clone());
        if let Some(reason) = &end.stop_reason {
            metadata.insert("stop_reason".into(), reason.clone());
        }
        let run = Run {
            timestamp: Stamp::from_nanos(wall_ns),
            dropped_before: gap,
            dropped_by_source,
            start: None,
            end: Some(end.clone()),
        };
        let json = serde_json::to_vec(&run).map_err(|error| error.to_string())?;
        self.write(Topic::Run, wall_ns, &json)?;
        self.write_metadata("gaitway.end", metadata)
    }

    fn write_metadata(
        &mut self,
        name: &str,
        metadata: BTreeMap<String, String>,
    ) -> Result<(), String> {
        self.mcap.add_metadata(&Metadata { name: name.into(), metadata })
    }

    fn write(&mut self, topic: Topic, wall_ns: u64, json: &[u8]) -> Result<(), String> {
        self.chunk_bytes += json.len();
        let sequence = self.sequences[topic as usize];
        self.sequences[topic as usize] = sequence.wrapping_add(1);
        let channel_id = self.channels[topic as usize];
        let header =
            MessageHeader { channel_id, sequence, log_time: wall_ns, publish_time: wall_ns };
        self.mcap.add_message(&header, json)
    }

    fn close_chunk(&mut self) -> Result<(), String> {
        self.mcap.close_chunk()?;
        let chunks = self.mcap.take_chunks();
        self.append(&chunks)?;
        self.summary.messages += self.in_chunk;
        self.since_sync += self.in_chunk;
        (self.in_chunk, self.chunk_bytes) = (0, 0);
        Ok(())
    }

    fn close_file(&mut self) -> Result<(), String> {
        // The chunk goes first and alone, so that a failure in the summary loses no message.
        self.close_chunk()?;
        self.mcap.finish()?;
        let rest = self.mcap.take();
        self.append(&rest)?;
        self.sync()
    }

    fn append(&mut self, bytes: &[u8]) -> Result<(), String> {
        for piece in bytes.chunks(PIECE_BYTES) {
            if self.shared.is_over() {
                return Err(TOO_SLOW.to_owned());
            }
            self.disk.append(piece).map_err(|error| error.to_string())?;
            self.summary.bytes += piece.len() as u64;
        }
        Ok(())
    }

    /// Waits until all that was appended is safe.
    fn sync(&mut self) -> Result<(), String> {
        self.settle_sync(Wait::Yes)?;
        if self.syncs.asked.is_none() {
            self.syncs.ask(self.since_sync);
        }
        self.settle_sync(Wait::Yes)
    }

    /// Takes what came of a synchronisation that was asked for.
    fn settle_sync(&mut self, wait: Wait) -> Result<(), String> {
        let Some((messages, told)) = self.syncs.told(wait, &self.shared) else { return Ok(()) };
        if let Err(cause) = told {
            // The system may have thrown these away; a second try would not bring them back.
            self.summary.messages -= self.since_sync;
            self.summary.lost += self.since_sync;
            return Err(format!("synchronising failed: {cause}"));
        }
        self.since_sync -= messages;
        self.last_sync = Clock::now();
        Ok(())
    }
}

/// Whether to wait for the disk.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Wait {
    Yes,
    No,
}

/// The thread that synchronises. A disk that takes seconds for it, because somebody else writes much,
/// holds up nothing that is appended: a process that is killed meanwhile has lost no more than its last
/// chunk.
struct Syncs {
    ask: Sender<()>,
    told: Receiver<io::Result<()>>,
    /// Messages that were not yet safe when a synchronisation was asked for that is under way.
    asked: Option<u64>,
}

impl Syncs {
    fn begin(mut syncer: Syncer) -> io::Result<Self> {
        let (ask, asked) = channel();
        let (tell, told) = channel();
        std::thread::Builder::new().name("recording-sync".into()).spawn(move || {
            while let Ok(()) = asked.recv() {
                if tell.send(syncer()).is_err() {
                    break;
                }
            }
        })?;
        Ok(Self { ask, told, asked: None })
    }

    fn ask(&mut self, messages: u64) {
        self.asked = Some(messages);
        // A thread that is gone shows when it is to tell.
        let _ = self.ask.send(());
    }

    /// What came of what was asked for, and how many messages that makes safe; nothing of a disk that nobody waits for any more:
    /// what was appended is with the system.
    fn told(&mut self, wait: Wait, shared: &Shared) -> Option<(u64, io::Result<()>)> {
        let messages = self.asked?;
        let gone = || Err(io::Error::other("the thread that synchronises is gone"));
        let told = match wait {
            Wait::Yes => loop {
                match self.told.recv_timeout(SYNC_LOOK) {
                    Ok(told) => break told,
                    Err(RecvTimeoutError::Disconnected) => break gone(),
                    Err(RecvTimeoutError::Timeout) if shared.is_over() => return None,
                    Err(RecvTimeoutError::Timeout) => {}
                }
            },
            Wait::No => match self.told.try_recv() {
                Ok(told) => told,
                Err(TryRecvError::Empty) => return None,
                Err(TryRecvError::Disconnected) => gone(),
            },
        };
        self.asked = None;
        Some((messages, told))
    }
}

/// What is in it, also after a thread that held it has panicked: counts stay counts.
pub(super) fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

fn add_topic(mcap: &mut McapFile, topic: Topic) -> Result<u16, String> {
    let schema = mcap.add_schema(topic.schema_name(), "jsonschema", topic.schema().as_bytes())?;
    mcap.add_channel(schema, topic.name(), "json", &BTreeMap::new())
}

fn add_channels(
    mcap: &mut McapFile,
    source: &RecordedSource,
    samples: SampleEncoding,
) -> Result<Vec<u16>, String> {
    let mut channels = Vec::new();
    for SourceChannel { topic, schema } in source.kind.channels(&source.name, samples) {
        let number = mcap.add_schema(schema.name, schema.encoding, schema.data)?;
        channels.push(mcap.add_channel(number, &topic, schema.messages, &source.metadata)?);
    }
    Ok(channels)
}
