//! A CAN line behind an adapter that speaks slcan on a serial line: no set-up of the system is needed, nor its
//! CAN.
//!
//! An adapter acknowledges each command, in their order, or never does (CANable); so nothing waits for that once
//! the channel is open. What it refuses is told as frames that were lost: whoever asked, asks again.

use super::{BytePort, Clock, FramePort, Heard, MonotonicClock, PortError};
use crate::time::{Duration, Instant};
use crate::wire::can::slcan::{self, SlcanReader, SlcanSaid};
use crate::wire::can::{CanFrame, Format};
use std::collections::VecDeque;

/// Longest wait for an adapter's version, which another program may have left in the middle of a line.
const FIRST_ANSWER: Duration = Duration::from_millis(1000);
/// Longest wait for the answer to any other command, of an adapter that gives some.
const ANSWER: Duration = Duration::from_millis(500);
/// An adapter whose channel is closed says nothing by itself; one that was open has said all after this.
const SETTLED: Duration = Duration::from_millis(30);
/// Longest wait for that.
const SETTLING: Duration = Duration::from_millis(300);
/// Frames that may be ahead of one in the adapter: the smallest queue of the makers has eight.
const AHEAD: u32 = 6;
/// Unanswered commands that are remembered; more than that, and it does not answer.
const REMEMBERED: usize = 256;
/// How often the adapter is asked whether something is wrong, while frames are sent.
const STATUS_EVERY: Duration = Duration::from_millis(500);
/// Refused for so long without one that was taken, and so often, frames have no way out.
const STUCK: Duration = Duration::from_millis(100);
const STUCK_FRAMES: u32 = 8;
/// Reads in one go that gave nothing, once the time for them is over: a line that babbles must not hold anyone.
const MOST_READS: u32 = 16;
/// How long closing the channel may take.
const CLOSING: Duration = Duration::from_millis(50);

/// An adapter with its channel open.
pub struct SlcanAdapter {
    port: Box<dyn BytePort>,
    place: String,
    speeds: SlcanSpeeds,
    reader: SlcanReader,
    /// Bytes that were read and not understood yet: those from `start` to `end`.
    bytes: [u8; 4096],
    start: usize,
    end: usize,
    /// What the adapter has not answered yet, oldest first.
    asked: VecDeque<Unanswered>,
    /// When the line has sent all that was handed over so far, if nobody else speaks.
    free_at: Instant,
    status: StatusQuestion,
    /// Since when, and how often, frames were refused and none was taken.
    refused: Option<(Instant, u32)>,
    /// A command was cut off: its rest must not become the beginning of the next.
    cut_off: bool,
    full_queue_count: u64,
    /// Lines that meant nothing before the channel was open.
    garbled_before: u64,
}

/// Speeds of the CAN line behind an adapter, bit/s.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SlcanSpeeds {
    /// Of the line.
    pub bitrate_bps: u32,
    /// Of fast payloads, where the line carries CAN FD.
    pub data_bitrate_bps: Option<u32>,
}

/// Why an adapter was not opened.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum NotOpened {
    /// Its serial line failed.
    Port(PortError),
    /// Nothing there answers as such an adapter does.
    Silent,
    /// The adapter refuses this command, which is to do that.
    Refused(String, &'static str),
    /// Adapters know no such bit rate, bit/s.
    NoSuchRate(u32),
}

impl From<PortError> for NotOpened {
    fn from(error: PortError) -> Self {
        Self::Port(error)
    }
}

/// A command that an answer is expected to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Unanswered {
    Frame,
    Status,
}

/// Whether the adapter is asked for its status.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum StatusQuestion {
    /// Not before this.
    DueAt(Instant),
    /// It knows no such command.
    Unknown,
}

impl SlcanAdapter {
    /// Makes an adapter behind `port` take part in its CAN line at these speeds. `place` is named in errors.
    ///
    /// # Errors
    /// [`NotOpened`].
    pub fn open(
        port: Box<dyn BytePort>,
        place: &str,
        speeds: SlcanSpeeds,
    ) -> Result<Self, NotOpened> {
        let no_rate = |bps: u32| NotOpened::NoSuchRate(bps);
        let rate = slcan::rate_command(speeds.bitrate_bps);
        let rate = rate.ok_or_else(|| no_rate(speeds.bitrate_bps))?;
        let fast = speeds
            .data_bitrate_bps
            .map(|bps| slcan::data_rate_command(bps).ok_or_else(|| no_rate(bps)))
            .transpose()?;
        let mut adapter = Self {
            port,
            place: place.to_owned(),
            speeds,
            reader: SlcanReader::default(),
            bytes: [0; 4096],
            start: 0,
            end: 0,
            asked: VecDeque::new(),
            free_at: Instant::ZERO,
            status: StatusQuestion::DueAt(Instant::ZERO),
            refused: None,
            cut_off: false,
            full_queue_count: 0,
            garbled_before: 0,
        };
        adapter.say(&[slcan::GREETING, slcan::CLOSE].concat())?;
        adapter.settle()?;
        let (is_known, mut answers) = adapter.meet()?;
        let mut commands = vec![(slcan::WITHOUT_STAMPS, "leave out time stamps", false)];
        commands.push((&rate[..], "set the bit rate", true));
        if let Some(fast) = &fast {
            commands.push((&fast[..], "carry CAN FD", true));
        }
        commands.push((slcan::OPEN, "open the channel", true));
        for (number, (command, what, is_needed)) in commands.into_iter().enumerate() {
            // Who does not answer the first will not answer the others either.
            let patience = if answers || number == 0 { ANSWER } else { SETTLED };
            let said = adapter.ask(command, patience)?;
            answers |= said.is_some();
            if said == Some(SlcanSaid::Refused) && is_needed {
                let command = String::from_utf8_lossy(command).trim_end().to_owned();
                return Err(NotOpened::Refused(command, what));
            }
        }
        if !is_known && !answers {
            return Err(NotOpened::Silent);
        }
        adapter.garbled_before = adapter.reader.garbled();
        Ok(adapter)
    }

    /// Says a command before the channel is open.
    fn say(&mut self, command: &[u8]) -> Result<(), PortError> {
        self.port.send(command, MonotonicClock.now() + ANSWER)
    }

    /// Reads away what is left of somebody else's words.
    fn settle(&mut self) -> Result<(), PortError> {
        let end = MonotonicClock.now() + SETTLING;
        loop {
            let quiet_at = MonotonicClock.now() + SETTLED;
            match self.port.receive(&mut self.bytes, quiet_at.min(end)) {
                Ok(_) if MonotonicClock.now() < end => {}
                Ok(_) | Err(PortError::TimedOut) => return Ok(()),
                Err(error) => return Err(error),
            }
        }
    }

    /// Asks for the version. Its answer comes after those to all that was said before, however late they are. Whether
    /// it came, and whether anything else was answered.
    fn meet(&mut self) -> Result<(bool, bool), PortError> {
        self.say(slcan::ASK_VERSION)?;
        let until = MonotonicClock.now() + FIRST_ANSWER;
        let mut answers = false;
        loop {
            match self.read(until) {
                Ok(SlcanSaid::Version) => return Ok((true, answers)),
                Ok(SlcanSaid::Taken | SlcanSaid::Refused) => answers = true,
                Ok(_) => {}
                Err(PortError::TimedOut) => return Ok((false, answers)),
                Err(error) => return Err(error),
            }
        }
    }

    /// Says a command and waits for its answer; none if there is none.
    fn ask(&mut self, command: &[u8], patience: Duration) -> Result<Option<SlcanSaid>, PortError> {
        use SlcanSaid::{Refused, Taken};
        self.say(command)?;
        let until = MonotonicClock.now() + patience;
        loop {
            match self.read(until) {
                Ok(said @ (Taken | Refused)) => return Ok(Some(said)),
                Ok(_) => {}
                Err(PortError::TimedOut) => return Ok(None),
                Err(error) => return Err(error),
            }
        }
    }

    /// The next thing that the adapter says.
    fn read(&mut self, deadline: Instant) -> Result<SlcanSaid, PortError> {
        let mut reads_left = MOST_READS;
        loop {
            while self.start < self.end {
                let byte = self.bytes[self.start];
                self.start += 1;
                if let Some(said) = self.reader.next(byte) {
                    return Ok(said);
                }
            }
            if MonotonicClock.now() >= deadline {
                reads_left = reads_left.checked_sub(1).ok_or(PortError::TimedOut)?;
            }
            self.end = self.port.receive(&mut self.bytes, deadline)?.min(self.bytes.len());
            self.start = 0;
        }
    }

    /// What it means to whoever listens to the line.
    fn understand(&mut self, said: SlcanSaid) -> Option<Heard> {
        match said {
            SlcanSaid::Frame(frame) => return Some(Heard::Frame(frame)),
            SlcanSaid::Report(report) => return Some(Heard::Report(report)),
            SlcanSaid::Taken | SlcanSaid::Sent => {
                // A question for the status is not answered like this: that answer was lost.
                while self.asked.pop_front() == Some(Unanswered::Status) {}
                self.refused = None;
            }
            SlcanSaid::Refused => {
                if self.asked.pop_front() == Some(Unanswered::Status) {
                    self.status = StatusQuestion::Unknown;
                    return None;
                }
                let (since, count) = self.refused.unwrap_or_else(|| (MonotonicClock.now(), 0));
                self.refused = Some((since, count + 1));
                if self.status != StatusQuestion::Unknown {
                    self.status = StatusQuestion::DueAt(Instant::ZERO);
                }
                return Some(Heard::Report(slcan::refusal()));
            }
            SlcanSaid::Status(report) => {
                while self.asked.pop_front() == Some(Unanswered::Frame) {}
                return report.map(Heard::Report);
            }
            SlcanSaid::Version => {}
        }
        None
    }

    /// The longest a frame occupies the line: its own bits, a fifth more of stuffing, the pause after it.
    fn line_time(&self, frame: &CanFrame) -> Duration {
        let head = if frame.id().is_extended() { 67 } else { 47 };
        let payload = 8 * u64::try_from(frame.payload().len()).unwrap_or(0);
        let (slow, fast) = match (frame.format(), self.speeds.data_bitrate_bps) {
            (Format::Fd { fast: true }, Some(bps)) => (head, (payload + 30, bps)),
            _ => (head + payload, (0, self.speeds.bitrate_bps)),
        };
        let nanos = |bits: u64, bps: u32| bits * 6 / 5 * 1_000_000_000 / u64::from(bps.max(1));
        Duration::from_nanos(nanos(slow, self.speeds.bitrate_bps) + nanos(fast.0, fast.1))
    }

    /// Waits until the adapter has room, as far as that can be told from here.
    fn wait_for_room(&mut self, frame: &CanFrame, deadline: Instant) -> Result<(), PortError> {
        let time = self.line_time(frame);
        let room_at = self.free_at.since(Instant::ZERO).saturating_sub(time * AHEAD);
        let room_at = Instant::ZERO + room_at;
        // A host that is late is told so elsewhere: what need not wait is no failure of the line.
        if room_at > deadline && room_at > MonotonicClock.now() {
            self.full_queue_count += 1;
            MonotonicClock.sleep_until(deadline);
            return Err(PortError::TimedOut);
        }
        MonotonicClock.sleep_until(room_at);
        self.free_at = self.free_at.max(MonotonicClock.now()) + time;
        Ok(())
    }

    fn remember(&mut self, asked: Unanswered) {
        if self.asked.len() >= REMEMBERED {
            self.asked.clear();
        }
        self.asked.push_back(asked);
    }
}

impl FramePort for SlcanAdapter {
    fn send(&mut self, frame: &CanFrame, deadline: Instant) -> Result<(), PortError> {
        let is_fd = matches!(frame.format(), Format::Fd { .. });
        if is_fd && self.speeds.data_bitrate_bps.is_none() {
            return Err(PortError::Io(format!("{}: cannot carry {frame:?}", self.place)));
        }
        self.wait_for_room(frame, deadline)?;
        let mut text = if self.cut_off { vec![b'\r'] } else { Vec::new() };
        slcan::write_frame(frame, &mut text);
        self.remember(Unanswered::Frame);
        let now = MonotonicClock.now();
        if matches!(self.status, StatusQuestion::DueAt(at) if at <= now) {
            text.extend(slcan::ASK_STATUS);
            self.remember(Unanswered::Status);
            self.status = StatusQuestion::DueAt(now + STATUS_EVERY);
        }
        let sent = self.port.send(&text, deadline);
        self.cut_off = sent.is_err();
        self.full_queue_count += u64::from(sent == Err(PortError::TimedOut));
        sent?;
        match self.refused {
            Some((since, count)) if count >= STUCK_FRAMES && now.since(since) >= STUCK => {
                Err(PortError::Io(format!("{}: the adapter refuses all that is sent", self.place)))
            }
            _ => Ok(()),
        }
    }

    fn receive(&mut self, deadline: Instant) -> Result<Heard, PortError> {
        loop {
            let said = self.read(deadline)?;
            if let Some(heard) = self.understand(said) {
                return Ok(heard);
            }
        }
    }

    fn full_queue_count(&self) -> u64 {
        self.full_queue_count
    }

    fn garbled_count(&self) -> u64 {
        self.reader.garbled() - self.garbled_before
    }
}

impl Drop for SlcanAdapter {
    /// The adapter leaves the line once it has sent what it was given: letting go may be the last of that.
    fn drop(&mut self) {
        let end = MonotonicClock.now() + CLOSING;
        MonotonicClock.sleep_until(self.free_at.min(end));
        // Nobody is there to be told if it is gone.
        let _ = self.port.send(&[b"\r", slcan::CLOSE].concat(), end + CLOSING);
    }
}
