//! The writing side: a bounded queue, one thread, one file that only grows.

use std::collections::BTreeMap;
use std::fs::{File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant as Clock};

use mcap::records::{MessageHeader, Metadata};
use mcap::write::NoSeek;

use super::message::{self, Run, Stamp, Topic};
use super::sample::{CycleRecord, RunEnd, RunStart};
use super::sensor::{self, RecordedSource, SourceId, SourceKind, SourceRecord};
use crate::error::Error;
use crate::time::Instant;

/// Cycles that may wait for the disk: 2.5 s at 100 Hz, about 1 MiB with 20 joints.
const QUEUE_CYCLES: usize = 256;
/// Samples that may wait for the disk: 2.7 s of 15 sensors at 200 Hz.
const QUEUE_SAMPLES: usize = 8192;
/// Topic under which dropped samples and lines of sources are counted.
const SOURCES: &str = "/imu, /lines";

/// What a recording needs of a disk.
pub trait Disk: Send + 'static {
    /// Puts all of `bytes` at the end of the file.
    ///
    /// # Errors
    /// As the file system says; some of the bytes may have been written.
    fn append(&mut self, bytes: &[u8]) -> io::Result<()>;

    /// Returns once everything appended would survive a power cut.
    ///
    /// # Errors
    /// As the file system says; what was appended since the last success may be lost.
    fn sync(&mut self) -> io::Result<()>;
}

impl Disk for File {
    fn append(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.write_all(bytes)
    }

    fn sync(&mut self) -> io::Result<()> {
        self.sync_data()
    }
}

/// How often the thread lets go of what it holds. Zero is "after every cycle".
#[derive(Clone, Copy, Debug)]
pub struct Pace {
    /// The longest a message stays in memory before its chunk is appended.
    pub chunk: Duration,
    /// The longest an appended chunk stays unsynchronised.
    pub sync: Duration,
}

impl Default for Pace {
    fn default() -> Self {
        Self { chunk: Duration::from_millis(250), sync: Duration::from_secs(1) }
    }
}

/// A chunk is also closed at this size, which bounds the memory it takes.
const CHUNK_BYTES: usize = 1 << 20;

/// What became of everything a [`Recorder`] was given.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Summary {
    /// Messages stored.
    pub messages: u64,
    /// Messages refused by the full queue, by topic.
    pub dropped: BTreeMap<&'static str, u64>,
    /// Messages taken from the queue but not stored, because the disk failed.
    pub lost: u64,
    /// Bytes appended to the file.
    pub bytes: u64,
    /// Why writing ended early, if it did.
    pub poisoned: Option<String>,
}

impl Summary {
    /// Whether everything the recorder was given is in the file, and the file is complete.
    #[must_use]
    pub fn is_complete(&self) -> bool {
        self.dropped.is_empty() && self.lost == 0 && self.poisoned.is_none()
    }
}

enum Item {
    /// A cycle, and how many were dropped just before it.
    Cycle(CycleRecord, u64),
    /// A source, whose records follow.
    Source(RecordedSource),
    /// A record of a source, and how many were dropped just before it.
    Record(SourceId, SourceRecord, u64),
    /// The end, and how many cycles were dropped just before it.
    End(RunEnd, u64),
}

/// Records a run. Dropped without [`Recorder::finish`], it stores what it was given and leaves
/// an unfinished file, which every reader here accepts.
#[derive(Debug)]
pub struct Recorder {
    queue: Option<SyncSender<Item>>,
    thread: Option<JoinHandle<Summary>>,
    joints: usize,
    /// Cycles dropped since the last one the queue took.
    gap: AtomicU64,
    /// Messages dropped, by topic in the order of [`Topic::ALL`].
    dropped: [AtomicU64; Topic::ALL.len()],
    /// Records dropped since the last one the queue took, by source.
    source_gaps: Mutex<Vec<u64>>,
    /// Messages of sources dropped.
    dropped_of_sources: AtomicU64,
}

impl Recorder {
    /// Creates the file at `path` and starts writing. The run's start is on the disk when this
    /// returns.
    ///
    /// # Errors
    /// If the file exists and `force` is not set, or cannot be created or written.
    pub fn create(path: &Path, force: bool, start: RunStart) -> Result<Self, Error> {
        let file = create_file(path, force)?;
        Self::create_on(file, start, Pace::default()).map_err(|error| error.at(shown(path)))
    }

    /// Records onto any [`Disk`].
    ///
    /// # Errors
    /// If the start of the run cannot be written, or the system gives no thread.
    pub fn create_on(disk: impl Disk, start: RunStart, pace: Pace) -> Result<Self, Error> {
        Self::with_queue(disk, start, pace, QUEUE_CYCLES)
    }

    /// As [`Recorder::create`], with a queue long enough for many sensors.
    ///
    /// # Errors
    /// As [`Recorder::create`].
    pub fn create_for_sources(path: &Path, force: bool, start: RunStart) -> Result<Self, Error> {
        let file = create_file(path, force)?;
        Self::with_queue(file, start, Pace::default(), QUEUE_SAMPLES)
            .map_err(|error| error.at(shown(path)))
    }

    fn with_queue(
        disk: impl Disk,
        start: RunStart,
        pace: Pace,
        length: usize,
    ) -> Result<Self, Error> {
        let joints = start.joints.len();
        let log = Log::create(disk, start, pace)
            .map_err(|cause| Error::new("the recording cannot be started").got(cause))?;
        let (queue, taken) = sync_channel(length);
        let thread = std::thread::Builder::new()
            .name("recording".into())
            .spawn(move || log.run(&taken))
            .map_err(|cause| Error::new("no thread for the recording").got(cause.to_string()))?;
        let (gap, dropped, source_gaps, dropped_of_sources) = Default::default();
        Ok(Self {
            queue: Some(queue),
            thread: Some(thread),
            joints,
            gap,
            dropped,
            source_gaps,
            dropped_of_sources,
        })
    }

    /// Adds a source; its channels stand in the file before its first record. Waits for the queue.
    pub fn add_source(&self, source: RecordedSource) -> SourceId {
        let mut gaps = self.source_gaps.lock().unwrap_or_else(PoisonError::into_inner);
        let id = SourceId(gaps.len());
        gaps.push(0);
        if let Some(queue) = &self.queue {
            // In the order of the numbers, so while they are locked. Refused only if the thread is
            // gone; `finish` then says so.
            let _ = queue.send(Item::Source(source));
        }
        id
    }

    /// Takes a record of a source; never waits. If the queue is full, the record is dropped and
    /// counted, and the next one of the source says so in the file.
    pub fn take_record(&self, source: SourceId, record: SourceRecord) {
        let mut gaps = self.source_gaps.lock().unwrap_or_else(PoisonError::into_inner);
        let Some(gap) = gaps.get_mut(source.0) else { return };
        let messages = sensor::message_count(&record);
        let item = Item::Record(source, record, *gap);
        match self.queue.as_ref().map(|queue| queue.try_send(item)) {
            Some(Ok(())) => *gap = 0,
            _ => {
                *gap += 1;
                self.dropped_of_sources.fetch_add(messages, Ordering::Relaxed);
            }
        }
    }

    /// Takes one cycle; never waits. If the queue is full, the cycle is dropped, counted by topic,
    /// and the next one taken says so in the file. So is a record with the wrong number of joints.
    pub fn take(&self, record: CycleRecord) {
        self.offer(record, |queue, item| {
            queue.try_send(item).map_err(|refused| match refused {
                TrySendError::Full(item) | TrySendError::Disconnected(item) => item,
            })
        });
    }

    /// Takes one cycle, waiting for the disk if it must. Only for runs whose clock waits too:
    /// virtual time and conversions.
    pub fn take_patiently(&self, record: CycleRecord) {
        self.offer(record, |queue, item| queue.send(item).map_err(|refused| refused.0));
    }

    fn offer(
        &self,
        record: CycleRecord,
        send: impl FnOnce(&SyncSender<Item>, Item) -> Result<(), Item>,
    ) {
        let fits = record.joints.len() == self.joints;
        let Some(queue) = self.queue.as_ref().filter(|_| fits) else {
            return self.count_dropped(&record, 0);
        };
        let gap = self.gap.swap(0, Ordering::Relaxed);
        if let Err(Item::Cycle(record, gap)) = send(queue, Item::Cycle(record, gap)) {
            self.count_dropped(&record, gap);
        }
    }

    /// Writes the end of the run, closes the file and tells what became of everything. Waits for
    /// the disk.
    #[must_use]
    pub fn finish(mut self, end: RunEnd) -> Summary {
        if let Some(queue) = &self.queue {
            // Refused only if the thread is gone; `close` then says so.
            let _ = queue.send(Item::End(end, self.gap.load(Ordering::Relaxed)));
        }
        self.close()
    }

    fn close(&mut self) -> Summary {
        self.queue = None;
        let gone = || Summary {
            poisoned: Some("the recording's thread ended early".into()),
            ..Summary::default()
        };
        let Some(thread) = self.thread.take() else { return gone() };
        let mut summary = thread.join().unwrap_or_else(|_| gone());
        for (topic, dropped) in Topic::ALL.iter().zip(&self.dropped) {
            let dropped = dropped.load(Ordering::Relaxed);
            if dropped > 0 {
                summary.dropped.insert(topic.name(), dropped);
            }
        }
        let dropped = self.dropped_of_sources.load(Ordering::Relaxed);
        if dropped > 0 {
            summary.dropped.insert(SOURCES, dropped);
        }
        summary
    }

    fn count_dropped(&self, record: &CycleRecord, gap: u64) {
        self.gap.fetch_add(gap + 1, Ordering::Relaxed);
        for topic in message::topics(record) {
            self.dropped[topic as usize].fetch_add(1, Ordering::Relaxed);
        }
    }
}

impl Drop for Recorder {
    fn drop(&mut self) {
        if self.thread.is_some() {
            self.close();
        }
    }
}

fn shown(path: &Path) -> String {
    path.display().to_string()
}

/// Creates a file to append to, and makes its name survive a power cut.
pub(super) fn create_file(path: &Path, force: bool) -> Result<File, Error> {
    let mut options = OpenOptions::new();
    options.write(true);
    if force {
        options.create(true).truncate(true);
    } else {
        options.create_new(true);
    }
    let file = options.open(path).map_err(|cause| {
        let exists = cause.kind() == io::ErrorKind::AlreadyExists;
        let error = Error::new("the file cannot be created").at(shown(path)).got(cause.to_string());
        if exists {
            error.remedy("choose another name, or add --force to replace it")
        } else {
            error
        }
    })?;
    let parent = path.parent().filter(|parent| !parent.as_os_str().is_empty());
    let folder: PathBuf = parent.unwrap_or(Path::new(".")).into();
    // Some file systems cannot synchronise a folder; the recording is worth having even so.
    let _ = File::open(folder).and_then(|folder| folder.sync_all());
    Ok(file)
}

/// Collects the bytes of an MCAP writer, so that a chunk reaches the disk in one append and the
/// MCAP writer itself never meets an I/O error.
#[derive(Clone, Default)]
pub(super) struct Bytes(Arc<Mutex<Vec<u8>>>);

impl Bytes {
    pub(super) fn take(&self) -> Vec<u8> {
        std::mem::take(&mut *self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

impl Write for Bytes {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// An MCAP writer for a file that only grows: no seeking, no compression, chunks closed by us.
pub(super) fn mcap_writer(bytes: &Bytes) -> mcap::McapResult<mcap::Writer<NoSeek<Bytes>>> {
    mcap::WriteOptions::new()
        .compression(None)
        .chunk_size(None)
        .disable_seeking(true)
        .library(concat!("gaitway ", env!("CARGO_PKG_VERSION")))
        .create(NoSeek::new(bytes.clone()))
}

/// The thread's side: turns records into chunks and counts what is safe.
struct Log<D> {
    disk: D,
    bytes: Bytes,
    mcap: mcap::Writer<NoSeek<Bytes>>,
    channels: [u16; Topic::ALL.len()],
    sequences: [u32; Topic::ALL.len()],
    /// Added sources: name and channels.
    sources: Vec<(String, Vec<u16>)>,
    start: RunStart,
    pace: Pace,
    /// Size and count of the open chunk, and when its first message came.
    chunk_bytes: usize,
    in_chunk: u64,
    chunk_opened: Clock,
    /// Messages appended but not yet synchronised, and when the last synchronisation was.
    since_sync: u64,
    last_sync: Clock,
    last_at: Instant,
    summary: Summary,
}

impl<D: Disk> Log<D> {
    fn create(disk: D, start: RunStart, pace: Pace) -> Result<Self, String> {
        let bytes = Bytes::default();
        let mut mcap = mcap_writer(&bytes).map_err(|error| error.to_string())?;
        let mut channels = [0; Topic::ALL.len()];
        for (topic, channel) in Topic::ALL.into_iter().zip(&mut channels) {
            *channel = add_topic(&mut mcap, topic).map_err(|error| error.to_string())?;
        }
        let now = Clock::now();
        let mut log = Self {
            disk,
            bytes,
            mcap,
            channels,
            sequences: [0; Topic::ALL.len()],
            sources: Vec::new(),
            last_at: start.monotonic_start,
            start,
            pace,
            chunk_bytes: 0,
            in_chunk: 0,
            chunk_opened: now,
            since_sync: 0,
            last_sync: now,
            summary: Summary::default(),
        };
        log.open_chunk(1);
        log.write_start().and_then(|()| log.close_chunk()).and_then(|()| log.sync())?;
        Ok(log)
    }

    /// Takes records until the recorder lets go, whatever the disk does meanwhile.
    fn run(mut self, taken: &Receiver<Item>) -> Summary {
        loop {
            match taken.recv_timeout(self.patience()) {
                Ok(Item::Cycle(record, gap)) => self.take(&record, gap),
                Ok(Item::Source(source)) => {
                    self.attempt(0, |log| log.add_source(&source));
                }
                Ok(Item::Record(source, record, gap)) => self.take_record(source, &record, gap),
                Ok(Item::End(end, gap)) => {
                    self.attempt(1, |log| log.write_end(&end, gap).and_then(|()| log.close_file()));
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
        self.summary
    }

    /// How long nothing needs to be done.
    fn patience(&self) -> Duration {
        let chunk = (self.in_chunk > 0).then_some(self.chunk_opened + self.pace.chunk);
        let sync = (self.since_sync > 0).then_some(self.last_sync + self.pace.sync);
        let idle = Duration::from_secs(1);
        let due = chunk.into_iter().chain(sync).min();
        due.map_or(idle, |due| due.saturating_duration_since(Clock::now()))
    }

    fn close_what_is_due(&mut self) -> Result<(), String> {
        let chunk_is_old = self.chunk_opened.elapsed() >= self.pace.chunk;
        if self.in_chunk > 0 && (chunk_is_old || self.chunk_bytes >= CHUNK_BYTES) {
            self.close_chunk()?;
        }
        if self.since_sync > 0 && self.last_sync.elapsed() >= self.pace.sync {
            self.sync()?;
        }
        Ok(())
    }

    /// Does a step that stores this many messages, unless poisoned. If it fails, poisons the log.
    /// Either way, what is not stored is counted as lost.
    fn attempt(&mut self, messages: u64, step: impl FnOnce(&mut Self) -> Result<(), String>) {
        if self.summary.poisoned.is_some() {
            self.summary.lost += messages;
            return;
        }
        self.open_chunk(messages);
        if let Err(cause) = step(self) {
            self.summary.lost += self.in_chunk;
            self.in_chunk = 0;
            self.summary.poisoned = Some(cause);
        }
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

    fn add_source(&mut self, source: &RecordedSource) -> Result<(), String> {
        let channels = add_channels(&mut self.mcap, source.kind, &source.name, &source.metadata);
        self.sources.push((source.name.clone(), channels.map_err(|error| error.to_string())?));
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
        self.attempt(sensor::message_count(record), |log| {
            let (name, channels) =
                log.sources.get(source.0).ok_or("a source that was not added")?;
            let messages = sensor::messages(name, record, publish_time, gap)
                .map_err(|error| error.to_string())?;
            for (channel, json) in messages {
                let channel_id = channels.get(channel).copied().unwrap_or_default();
                let header = MessageHeader { channel_id, sequence, log_time, publish_time };
                log.chunk_bytes += json.len();
                log.mcap
                    .write_to_known_channel(&header, &json)
                    .map_err(|error| error.to_string())?;
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
            start: Some(start.clone()),
            end: None,
        };
        let json = serde_json::to_vec(&run).map_err(|error| error.to_string())?;
        self.write_metadata("gaitway.start", metadata)?;
        self.write(Topic::Run, wall_ns, &json)
    }

    fn write_end(&mut self, end: &RunEnd, gap: u64) -> Result<(), String> {
        let wall_ns = self.start.wall_nanos(end.at.max(self.last_at));
        let mut metadata = end.metadata.clone();
        metadata.insert("outcome".into(), end.outcome.clone());
        if let Some(reason) = &end.stop_reason {
            metadata.insert("stop_reason".into(), reason.clone());
        }
        let run = Run {
            timestamp: Stamp::from_nanos(wall_ns),
            dropped_before: gap,
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
        self.mcap
            .write_metadata(&Metadata { name: name.into(), metadata })
            .map_err(|error| error.to_string())
    }

    fn write(&mut self, topic: Topic, wall_ns: u64, json: &[u8]) -> Result<(), String> {
        self.chunk_bytes += json.len();
        let sequence = self.sequences[topic as usize];
        self.sequences[topic as usize] = sequence.wrapping_add(1);
        let channel_id = self.channels[topic as usize];
        let header =
            MessageHeader { channel_id, sequence, log_time: wall_ns, publish_time: wall_ns };
        self.mcap.write_to_known_channel(&header, json).map_err(|error| error.to_string())
    }

    fn close_chunk(&mut self) -> Result<(), String> {
        self.mcap.flush().map_err(|error| error.to_string())?;
        self.append()
    }

    fn close_file(&mut self) -> Result<(), String> {
        // The chunk goes first and alone, so that a failure in the summary loses no message.
        self.close_chunk()?;
        self.mcap.finish().map_err(|error| error.to_string())?;
        self.append()?;
        self.sync()
    }

    fn append(&mut self) -> Result<(), String> {
        let bytes = self.bytes.take();
        self.disk.append(&bytes).map_err(|error| error.to_string())?;
        self.summary.bytes += bytes.len() as u64;
        self.summary.messages += self.in_chunk;
        self.since_sync += self.in_chunk;
        (self.in_chunk, self.chunk_bytes) = (0, 0);
        Ok(())
    }

    fn sync(&mut self) -> Result<(), String> {
        if let Err(cause) = self.disk.sync() {
            // The system may have thrown these away; a second try would not bring them back.
            self.summary.messages -= self.since_sync;
            self.summary.lost += self.since_sync;
            return Err(format!("synchronising failed: {cause}"));
        }
        (self.since_sync, self.last_sync) = (0, Clock::now());
        Ok(())
    }
}

fn add_topic(mcap: &mut mcap::Writer<NoSeek<Bytes>>, topic: Topic) -> mcap::McapResult<u16> {
    let schema = mcap.add_schema(topic.schema_name(), "jsonschema", topic.schema().as_bytes())?;
    mcap.add_channel(schema, topic.name(), "json", &BTreeMap::new())
}

fn add_channels(
    mcap: &mut mcap::Writer<NoSeek<Bytes>>,
    kind: SourceKind,
    name: &str,
    metadata: &BTreeMap<String, String>,
) -> mcap::McapResult<Vec<u16>> {
    let mut channels = Vec::new();
    for (topic, schema_name, schema) in kind.channels(name) {
        let schema = mcap.add_schema(schema_name, "jsonschema", schema.as_bytes())?;
        channels.push(mcap.add_channel(schema, &topic, "json", metadata)?);
    }
    Ok(channels)
}
