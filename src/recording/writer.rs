//! The writing side: a bounded queue in front of the thread of [`super::log`].

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use super::disk::{Disk, create_file, shown};
use super::imu_message::SampleEncoding;
use super::log::{Item, Keep, Log, Pace, Shared, Summary, locked};
use super::message::{self, Topic};
use super::sample::{CycleRecord, RunEnd, RunStart};
use super::sensor::{self, RecordedSource, SourceId, SourceRecord};
use crate::error::{Error, ErrorKind};

/// Cycles that may wait for the disk: 2.5 s at 100 Hz, about 1 MiB with 20 joints.
const QUEUE_CYCLES: usize = 256;
/// Samples that may wait for the disk: 2.7 s of 15 sensors at 200 Hz.
const QUEUE_SAMPLES: usize = 8192;

/// What the full queue refused of one source.
#[derive(Debug)]
struct Refused {
    name: String,
    samples: SampleEncoding,
    /// Records since the last one the queue took.
    gap: u64,
    /// Messages, by topic.
    messages: Vec<(String, u64)>,
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
    /// What was dropped of each source.
    refused: Mutex<Vec<Refused>>,
    shared: Arc<Shared>,
}

impl Recorder {
    /// Creates the file at `path` and starts writing. The start of a run of a robot is on the
    /// disk when this returns; what only sensors say is taken at once. A file that is there is replaced, with `force`, when there is something to keep: with
    /// the first cycle, or the first record if no robot is recorded. Until then the new one is
    /// `path.part`.
    ///
    /// # Errors
    /// If the file exists and `force` is not set, if another program writes it, or if it cannot be
    /// created or written.
    pub fn create(path: &Path, force: bool, start: RunStart) -> Result<Self, Error> {
        let keep = Keep::usual(&start);
        Self::create_at(path, force, start, keep, QUEUE_CYCLES)
    }

    /// As [`Recorder::create`], for what is no run but made of something that is there already: it
    /// has its name, and replaces a file, only once it is whole.
    ///
    /// # Errors
    /// As [`Recorder::create`].
    pub fn create_whole(path: &Path, force: bool, start: RunStart) -> Result<Self, Error> {
        Self::create_at(path, force, start, Keep::Whole, QUEUE_CYCLES)
    }

    fn create_at(
        path: &Path,
        force: bool,
        start: RunStart,
        keep: Keep,
        length: usize,
    ) -> Result<Self, Error> {
        let file = create_file(path, force, keep == Keep::Whole)?;
        let recorder = Self::with_queue(file, start, Pace::default(), keep, length);
        recorder.map_err(|error| error.at(shown(path)))
    }

    /// Records onto any [`Disk`].
    ///
    /// # Errors
    /// If the start of the run cannot be written, or the system gives no thread.
    pub fn create_on(disk: impl Disk, start: RunStart, pace: Pace) -> Result<Self, Error> {
        let keep = Keep::usual(&start);
        Self::with_queue(disk, start, pace, keep, QUEUE_CYCLES)
    }

    /// As [`Recorder::create`], with a queue long enough for many sensors.
    ///
    /// # Errors
    /// As [`Recorder::create`].
    pub fn create_for_sources(path: &Path, force: bool, start: RunStart) -> Result<Self, Error> {
        let keep = Keep::usual(&start);
        Self::create_at(path, force, start, keep, QUEUE_SAMPLES)
    }

    /// As [`Recorder::create_on`], with a queue long enough for many sensors.
    ///
    /// # Errors
    /// As [`Recorder::create_on`].
    pub fn create_for_sources_on(
        disk: impl Disk,
        start: RunStart,
        pace: Pace,
    ) -> Result<Self, Error> {
        let keep = Keep::usual(&start);
        Self::with_queue(disk, start, pace, keep, QUEUE_SAMPLES)
    }

    fn with_queue(
        disk: impl Disk,
        start: RunStart,
        pace: Pace,
        keep: Keep,
        length: usize,
    ) -> Result<Self, Error> {
        let joints = start.joints.len();
        let log = Log::create(disk, start, pace, keep).map_err(|cause| {
            Error::of(ErrorKind::Io, "the recording cannot be started").got(cause)
        })?;
        let (queue, taken) = sync_channel(length);
        let shared = log.shared();
        let thread = std::thread::Builder::new()
            .name("recording".into())
            .spawn(move || log.run(&taken))
            .map_err(|cause| Error::new("no thread for the recording").got(cause.to_string()))?;
        let (gap, dropped, refused) = Default::default();
        Ok(Self { queue: Some(queue), thread: Some(thread), joints, gap, dropped, refused, shared })
    }

    /// Nothing was recorded that anybody wants: when the recorder is dropped its file is gone, and one
    /// it was to replace is as it was.
    pub fn discard(&self) {
        self.shared.discarded.store(true, Ordering::Release);
    }

    /// Why nothing is stored any more, as soon as that is so.
    #[must_use]
    pub fn failure(&self) -> Option<&str> {
        self.shared.failure.get().map(String::as_str)
    }

    /// Messages refused by the full queue so far, by topic.
    #[must_use]
    pub fn dropped(&self) -> BTreeMap<String, u64> {
        let of_cycles = Topic::ALL.iter().zip(&self.dropped);
        let of_cycles = of_cycles
            .map(|(topic, dropped)| (topic.name().to_owned(), dropped.load(Ordering::Relaxed)));
        let refused = locked(&self.refused);
        let of_sources = refused.iter().flat_map(|refused| refused.messages.iter().cloned());
        of_cycles.chain(of_sources).filter(|(_, dropped)| *dropped > 0).collect()
    }

    /// Samples of sources that are added from now on are written so. It can be said once, and not at all: as JSON.
    pub fn write_samples_as(&self, encoding: SampleEncoding) {
        let _ = self.shared.samples.set(encoding);
    }

    /// Adds a source; its channels stand in the file before its first record. Never waits for the
    /// disk.
    pub fn add_source(&self, source: RecordedSource) -> SourceId {
        let mut refused = locked(&self.refused);
        let id = SourceId(refused.len());
        let samples = self.shared.samples.get().copied().unwrap_or_default();
        let channels = source.kind.channels(&source.name, samples);
        let messages = channels.into_iter().map(|channel| (channel.topic, 0)).collect();
        refused.push(Refused { name: source.name.clone(), samples, gap: 0, messages });
        // In the order of the numbers, so while they are locked.
        locked(&self.shared.sources).push((source, samples));
        id
    }

    /// Takes a record of a source; never waits. If the queue is full, the record is dropped and
    /// counted by topic, and the next one of the source says so in the file.
    pub fn take_record(&self, source: SourceId, record: SourceRecord) {
        let mut refused = locked(&self.refused);
        let Some(refused) = refused.get_mut(source.0) else { return };
        let messages = sensor::message_count(&record, refused.samples);
        let item = Item::Record(source, record, refused.gap);
        match self.queue.as_ref().map(|queue| queue.try_send(item)) {
            Some(Ok(())) => refused.gap = 0,
            _ => {
                refused.gap += 1;
                refused.messages.iter_mut().take(messages).for_each(|(_, count)| *count += 1);
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
            let gap = self.gap.load(Ordering::Relaxed);
            let of_sources = locked(&self.refused)
                .iter()
                .filter(|refused| refused.gap > 0)
                .map(|refused| (refused.name.clone(), refused.gap))
                .collect();
            let _ = queue.send(Item::End(end, gap, of_sources));
        }
        self.close()
    }

    /// As [`Recorder::finish`], but waits for a slow disk no longer than about this time: what is not written by then is
    /// lost, and counted. The file then lacks its end, as that of a process that was killed.
    #[must_use]
    pub fn finish_within(self, end: RunEnd, patience: Duration) -> Summary {
        // Nobody else ends it.
        let _ = self.shared.ends_by.set(Instant::now() + patience);
        self.finish(end)
    }

    fn close(&mut self) -> Summary {
        self.queue = None;
        let gone = || Summary {
            poisoned: Some("the recording's thread ended early".into()),
            ..Summary::default()
        };
        let Some(thread) = self.thread.take() else { return gone() };
        let mut summary = thread.join().unwrap_or_else(|_| gone());
        summary.dropped = self.dropped();
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
