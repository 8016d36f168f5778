//! One question at a time on one shared line: deadlines from the line speed, answers matched by
//! ID, one retry inside the caller's time budget, every miss counted.
//!
//! A question is split in `begin` and `finish`, so that two lines can overlap without threads.

mod codec;

use crate::port::{BytePort, Clock, PortError};
use crate::time::{Duration, Instant};
use crate::units::line_time_s;
use codec::Heard;
pub use codec::Protocol;
use std::fmt;
use std::sync::Arc;

/// What the deadlines of a line are made of.
#[derive(Clone, Copy, Debug)]
pub struct Timing {
    /// Bits per second.
    pub baud_bps: u32,
    /// Time a device waits before it answers.
    pub return_delay: Duration,
    /// Time the adapter may hold bytes back.
    pub latency: Duration,
}

/// Scheduling and conversion time granted to every answer on top of what can be computed.
const SLACK: Duration = Duration::from_micros(300);

/// Bytes heard after one question at most; what babbles on is not an answer.
const MOST_HEARD: usize = 16 * 1024;

/// How long after a lost answer its late bytes are reckoned with.
const WARY_FOR: Duration = Duration::from_millis(20);

/// An answer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Reply {
    /// The device reports a hardware error; the instruction was carried out all the same.
    pub alert: bool,
    /// What was asked for.
    pub bytes: Vec<u8>,
}

/// Why there is no answer from a device that was asked.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Miss {
    /// Nothing came in time.
    Silent,
    /// Something came that failed its checks.
    Garbled,
    /// Another device answered.
    WrongId {
        /// ID that was asked.
        asked: u8,
        /// ID that answered.
        got: u8,
    },
    /// The device answered no.
    Refused(String),
    /// A sound answer, but with a position the joint cannot have reached since the last.
    Implausible,
}

impl fmt::Display for Miss {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Silent => f.write_str("no answer"),
            Self::Garbled => f.write_str("answer damaged on the line"),
            Self::WrongId { asked, got } => write!(f, "asked ID {asked}, ID {got} answered"),
            Self::Refused(text) => write!(f, "the device refused: {text}"),
            Self::Implausible => f.write_str("a position the joint cannot have reached"),
        }
    }
}

/// Why a question could not be asked or was not answered.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum AskError {
    /// The line itself failed.
    Port(PortError),
    /// The device did not answer.
    Miss(Miss),
    /// The question does not fit the protocol (ID or length).
    Unsayable(String),
}

impl From<PortError> for AskError {
    fn from(error: PortError) -> Self {
        Self::Port(error)
    }
}

impl From<Miss> for AskError {
    fn from(miss: Miss) -> Self {
        Self::Miss(miss)
    }
}

impl fmt::Display for AskError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Port(error) => error.fmt(f),
            Self::Miss(miss) => miss.fmt(f),
            Self::Unsayable(text) => f.write_str(text),
        }
    }
}

impl std::error::Error for AskError {}

/// What happened on the line so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Stats {
    /// Packets sent.
    pub asked: u64,
    /// Answers used.
    pub answered: u64,
    /// Devices asked again.
    pub retried: u64,
    /// Packets that failed their checks.
    pub garbled: u64,
    /// Answers nobody was waiting for.
    pub unasked: u64,
    /// Bytes sent and received, for the line load.
    pub bytes: u64,
}

/// Which instruction reads a block from many devices at once.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GroupRead {
    /// One status per device.
    Sync,
    /// One status for all (Dynamixel Fast Sync Read).
    Fast,
}

/// The question under way.
struct Pending {
    ids: Vec<u8>,
    address: u16,
    length: u16,
    mode: GroupRead,
    heard_at: Instant,
}

/// A shared line with its protocol.
pub struct Bus {
    port: Box<dyn BytePort>,
    clock: Arc<dyn Clock>,
    protocol: Protocol,
    timing: Timing,
    stats: Stats,
    sent: Vec<u8>,
    received: Vec<u8>,
    scratch: Vec<u8>,
    heard: usize,
    retries: u32,
    sending_until: Instant,
    quiet_until: Instant,
    wary_until: Instant,
    pending: Option<Pending>,
}

impl Bus {
    /// A line behind `port`. `clock` is the port's own.
    #[must_use]
    pub fn new(
        port: Box<dyn BytePort>,
        clock: Arc<dyn Clock>,
        protocol: Protocol,
        mut timing: Timing,
    ) -> Self {
        timing.return_delay = timing.return_delay.max(protocol.least_reply_delay());
        Self {
            port,
            clock,
            protocol,
            timing,
            stats: Stats::default(),
            sent: Vec::with_capacity(1024),
            received: Vec::with_capacity(4096),
            scratch: Vec::with_capacity(1024),
            heard: 0,
            retries: 1,
            sending_until: Instant::ZERO,
            quiet_until: Instant::ZERO,
            wary_until: Instant::ZERO,
            pending: None,
        }
    }

    /// What happened so far.
    #[must_use]
    pub const fn stats(&self) -> Stats {
        self.stats
    }

    /// The line's timing.
    #[must_use]
    pub const fn timing(&self) -> Timing {
        self.timing
    }

    /// The line's protocol.
    #[must_use]
    pub const fn protocol(&self) -> Protocol {
        self.protocol
    }

    /// Time `bytes` in `devices` answers take on the line, return delays included.
    fn line_and_delay(&self, bytes: usize, devices: usize) -> Duration {
        let line_s = line_time_s(bytes, self.timing.baud_bps);
        let delay = self.timing.return_delay * u32::try_from(devices).unwrap_or(u32::MAX);
        Duration::from_secs_f64(line_s) + delay
    }

    /// The longest it may take until they are here, once the question has left.
    fn answer_time(&self, bytes: usize, devices: usize) -> Duration {
        self.line_and_delay(bytes, devices) + self.timing.latency + SLACK
    }

    /// When the next question may be asked: after a lost answer the line is left in silence.
    #[must_use]
    pub const fn ready_at(&self) -> Instant {
        self.quiet_until
    }

    /// When the last question had left.
    #[must_use]
    pub const fn spoken_at(&self) -> Instant {
        self.sending_until
    }

    /// True if a question to one device, for `length` bytes, asked now is over by `budget`.
    #[must_use]
    pub fn fits(&self, length: usize, budget: Instant) -> bool {
        let question = self.line_and_delay(self.protocol.read_bytes(), 0);
        let begins = self.clock.now().max(self.quiet_until);
        begins + question + self.answer_time(self.protocol.status_bytes(length), 1) <= budget
    }

    /// Line time of reading `length` bytes from each of `devices`, s.
    #[must_use]
    pub fn read_time_s(&self, devices: usize, length: usize, mode: GroupRead) -> f64 {
        let bytes = self.protocol.group_read_bytes(devices, length, mode);
        let delays = if mode == GroupRead::Fast { 1 } else { devices };
        line_time_s(bytes, self.timing.baud_bps)
            + self.timing.return_delay.as_secs_f64() * delays as f64
    }

    /// Line time of writing `length` bytes to each of `devices`, s.
    #[must_use]
    pub fn write_time_s(&self, devices: usize, length: usize) -> f64 {
        line_time_s(self.protocol.sync_write_bytes(devices, length), self.timing.baud_bps)
    }

    /// Sends what is in `self.sent`, after the silence a lost answer left behind.
    fn say(&mut self, budget: Instant) -> Result<Instant, AskError> {
        // Late bytes of an answer given up on must not be taken for the next one.
        self.clock.sleep_until(self.quiet_until);
        self.port.discard_input()?;
        self.received.clear();
        self.heard = 0;
        self.port.send(&self.sent, budget)?;
        self.stats.asked += 1;
        self.stats.bytes += self.sent.len() as u64;
        // Bytes queue behind those still leaving; nothing needs to be waited for.
        let begins = self.sending_until.max(self.clock.now());
        let line_s = line_time_s(self.sent.len(), self.timing.baud_bps);
        self.sending_until = begins + Duration::from_secs_f64(line_s);
        Ok(self.sending_until)
    }

    /// Receives more bytes by `deadline`; false if none came.
    fn listen(&mut self, deadline: Instant) -> Result<bool, PortError> {
        if self.heard >= MOST_HEARD {
            return Ok(false);
        }
        let mut chunk = [0_u8; 1024];
        match self.port.receive(&mut chunk, deadline) {
            Ok(n) => {
                self.heard += n;
                self.stats.bytes += n as u64;
                self.received.extend_from_slice(&chunk[..n]);
                Ok(true)
            }
            Err(PortError::TimedOut) => Ok(false),
            Err(error) => Err(error),
        }
    }

    /// Nothing more comes: drops the beginning of a packet, so that one behind it is found.
    fn drop_cut_packet(&mut self, miss: &mut Miss) -> bool {
        let cut = self.protocol.abandon(&self.received);
        self.received.drain(..cut);
        if cut > 0 {
            self.stats.garbled += 1;
            *miss = Miss::Garbled;
        }
        cut > 0
    }

    /// An answer is missing. Nothing may be asked before the time in which it could still come is
    /// over, and its late bytes had time to arrive and be thrown away.
    fn gave_up(&mut self, window_end: Instant) {
        let late = self.clock.now() + self.timing.latency + SLACK;
        self.quiet_until = self.quiet_until.max(late).max(window_end);
        self.wary_until = self.clock.now() + WARY_FOR;
    }

    /// The answers are there. Soon after a loss they may be late twins of lost ones: the time the
    /// true ones take is waited out, so that those cannot fall into the next question's window.
    fn satisfied(&mut self, heard_at: Instant, bytes: usize, devices: usize) {
        if self.clock.now() < self.wary_until {
            let true_end = heard_at + self.line_and_delay(bytes, devices);
            self.quiet_until = self.quiet_until.max(true_end);
        }
    }

    /// Waits for the one answer of device `id` with `length` bytes.
    fn one_answer(
        &mut self,
        id: u8,
        length: usize,
        heard_at: Instant,
        budget: Instant,
    ) -> Result<Reply, AskError> {
        let window_end = heard_at + self.answer_time(self.protocol.status_bytes(length), 1);
        let deadline = window_end.min(budget);
        let mut miss = Miss::Silent;
        loop {
            match self.protocol.decode(&self.received, length, &mut self.scratch) {
                Heard::Need => {
                    if !self.listen(deadline)? && !self.drop_cut_packet(&mut miss) {
                        self.gave_up(window_end);
                        return Err(miss.into());
                    }
                }
                Heard::Drop(n, garbled) => {
                    self.received.drain(..n);
                    if garbled {
                        self.stats.garbled += 1;
                        miss = Miss::Garbled;
                    }
                }
                Heard::Status { id: got, alert, refused, params, n } => {
                    let reply = Reply { alert, bytes: params.to_vec() };
                    self.received.drain(..n);
                    if got != id {
                        self.stats.unasked += 1;
                        miss = Miss::WrongId { asked: id, got };
                        continue;
                    }
                    self.stats.answered += 1;
                    self.satisfied(heard_at, self.protocol.status_bytes(length), 1);
                    if let Some(text) = refused {
                        return Err(Miss::Refused(text).into());
                    }
                    if reply.bytes.len() != length {
                        return Err(Miss::Garbled.into());
                    }
                    return Ok(reply);
                }
            }
        }
    }

    /// How often a lost answer of one device is asked for again: once in a cycle, more patiently
    /// when nothing is moving.
    pub const fn set_retries(&mut self, retries: u32) {
        self.retries = retries;
    }

    /// Asks one device, and again if the answer was lost and `budget` allows.
    fn ask(
        &mut self,
        id: u8,
        length: usize,
        budget: Instant,
        encode: impl Fn(Protocol, &mut Vec<u8>) -> Result<(), String>,
    ) -> Result<Reply, AskError> {
        let mut retries_left = self.retries;
        loop {
            self.sent.clear();
            encode(self.protocol, &mut self.sent).map_err(AskError::Unsayable)?;
            let heard_at = self.say(budget)?;
            match self.one_answer(id, length, heard_at, budget) {
                Err(AskError::Miss(miss))
                    if retries_left > 0 && !matches!(miss, Miss::Refused(_)) =>
                {
                    let again = self.answer_time(self.protocol.status_bytes(length), 1);
                    if self.clock.now() + again > budget {
                        return Err(miss.into());
                    }
                    retries_left -= 1;
                    self.stats.retried += 1;
                }
                other => return other,
            }
        }
    }

    /// Asks whether `id` is there. The bytes are the protocol's own (Dynamixel: model, firmware).
    ///
    /// # Errors
    /// [`AskError`].
    pub fn ping(&mut self, id: u8, budget: Instant) -> Result<Reply, AskError> {
        let length = self.protocol.ping_bytes();
        self.ask(id, length, budget, |protocol, out| protocol.ping(out, id))
    }

    /// Reads `length` bytes from `address` on.
    ///
    /// # Errors
    /// [`AskError`].
    pub fn read(
        &mut self,
        id: u8,
        address: u16,
        length: u16,
        budget: Instant,
    ) -> Result<Reply, AskError> {
        self.ask(id, usize::from(length), budget, |protocol, out| {
            protocol.read(out, id, address, length)
        })
    }

    /// Writes `bytes` from `address` on and waits for the device's yes.
    ///
    /// # Errors
    /// [`AskError`].
    pub fn write(
        &mut self,
        id: u8,
        address: u16,
        bytes: &[u8],
        budget: Instant,
    ) -> Result<Reply, AskError> {
        self.ask(id, 0, budget, |protocol, out| protocol.write(out, id, address, bytes))
    }

    /// Writes the same registers of many devices at once; nobody answers.
    ///
    /// # Errors
    /// [`AskError::Port`], [`AskError::Unsayable`].
    pub fn sync_write(
        &mut self,
        address: u16,
        items: &[(u8, &[u8])],
        budget: Instant,
    ) -> Result<(), AskError> {
        self.sent.clear();
        self.protocol.sync_write(&mut self.sent, address, items).map_err(AskError::Unsayable)?;
        self.say(budget)?;
        Ok(())
    }

    /// Asks many devices for `length` bytes from `address` on; [`Bus::finish_group_read`] waits.
    ///
    /// # Errors
    /// [`AskError::Port`], [`AskError::Unsayable`].
    pub fn begin_group_read(
        &mut self,
        ids: &[u8],
        address: u16,
        length: u16,
        mode: GroupRead,
        budget: Instant,
    ) -> Result<(), AskError> {
        self.sent.clear();
        self.protocol
            .group_read(&mut self.sent, ids, address, length, mode)
            .map_err(AskError::Unsayable)?;
        let heard_at = self.say(budget)?;
        self.pending = Some(Pending { ids: ids.to_vec(), address, length, mode, heard_at });
        Ok(())
    }

    /// The answers to the group read under way, in the order of `ids`, those lost asked for once
    /// more if `budget` allows.
    ///
    /// A silent device silences those listed after it, so the second question leaves out the
    /// first one missing unless it is the only one.
    ///
    /// # Errors
    /// [`AskError::Port`]; a device that does not answer is a [`Miss`] of its own.
    pub fn finish_group_read(
        &mut self,
        ids: &[u8],
        budget: Instant,
    ) -> Result<Vec<Result<Reply, Miss>>, AskError> {
        let Some(pending) = self.pending.take() else {
            return Ok(vec![Err(Miss::Silent); ids.len()]);
        };
        let mut answers = self.group_answers(&pending, budget)?;
        let mut lost: Vec<usize> = (0..ids.len())
            .filter(|&i| matches!(answers[i], Err(Miss::Silent | Miss::Garbled)))
            .collect();
        if lost.len() > 1 && answers[lost[0]] == Err(Miss::Silent) {
            lost.remove(0);
        }
        if lost.is_empty() {
            return Ok(answers);
        }
        let again: Vec<u8> = lost.iter().map(|&i| ids[i]).collect();
        let Pending { address, length, mode, .. } = pending;
        let needs = self.read_time_s(again.len(), usize::from(length), mode);
        let ends = self.clock.now().max(self.quiet_until)
            + Duration::from_secs_f64(needs)
            + self.timing.latency
            + SLACK;
        if ends > budget {
            return Ok(answers);
        }
        self.stats.retried += again.len() as u64;
        self.begin_group_read(&again, address, length, mode, budget)?;
        if let Some(pending) = self.pending.take() {
            for (&slot, answer) in lost.iter().zip(self.group_answers(&pending, budget)?) {
                answers[slot] = answer;
            }
        }
        Ok(answers)
    }

    fn group_answers(
        &mut self,
        pending: &Pending,
        budget: Instant,
    ) -> Result<Vec<Result<Reply, Miss>>, AskError> {
        match pending.mode {
            GroupRead::Sync => self.separate_answers(pending, budget),
            GroupRead::Fast => self.merged_answer(pending, budget),
        }
    }

    fn separate_answers(
        &mut self,
        pending: &Pending,
        budget: Instant,
    ) -> Result<Vec<Result<Reply, Miss>>, AskError> {
        let length = usize::from(pending.length);
        let status = self.protocol.status_bytes(length);
        let devices = pending.ids.len();
        let window_end = pending.heard_at + self.answer_time(status * devices, devices);
        // Bytes that come late move the end, so that a slow host loses no answer.
        let patience = self.answer_time(status, 1);
        let mut answers = vec![Err(Miss::Silent); pending.ids.len()];
        let mut left = pending.ids.len();
        let mut deadline = window_end.min(budget);
        while left > 0 {
            match self.protocol.decode(&self.received, length, &mut self.scratch) {
                Heard::Need => {
                    if self.listen(deadline)? {
                        deadline = deadline.max((self.clock.now() + patience).min(budget));
                    } else if !self.drop_cut_packet(&mut Miss::Silent) {
                        self.gave_up(window_end);
                        break;
                    }
                }
                Heard::Drop(n, garbled) => {
                    self.received.drain(..n);
                    self.stats.garbled += u64::from(garbled);
                }
                Heard::Status { id, alert, refused, params, n } => {
                    let reply = Reply { alert, bytes: params.to_vec() };
                    self.received.drain(..n);
                    let place = pending.ids.iter().position(|&asked| asked == id);
                    let Some(slot) = place.filter(|&i| answers[i].is_err()) else {
                        self.stats.unasked += 1;
                        continue;
                    };
                    left -= 1;
                    self.stats.answered += 1;
                    answers[slot] = match refused {
                        Some(text) => Err(Miss::Refused(text)),
                        None if reply.bytes.len() != length => Err(Miss::Garbled),
                        None => Ok(reply),
                    };
                }
            }
        }
        if left == 0 {
            self.satisfied(pending.heard_at, status * devices, devices);
        }
        Ok(answers)
    }

    fn merged_answer(
        &mut self,
        pending: &Pending,
        budget: Instant,
    ) -> Result<Vec<Result<Reply, Miss>>, AskError> {
        let length = usize::from(pending.length);
        let total = self.protocol.merged_bytes(pending.ids.len(), length);
        let window_end = pending.heard_at + self.answer_time(total, 1);
        let patience = self.answer_time(self.protocol.status_bytes(length), 1);
        let mut deadline = window_end.min(budget);
        loop {
            if self.received.len() < total && self.listen(deadline)? {
                deadline = deadline.max((self.clock.now() + patience).min(budget));
                continue;
            }
            let answers = codec::merged(&self.received, &pending.ids, length);
            let complete = answers.iter().all(|a| matches!(a, Ok(_) | Err(Miss::Refused(_))));
            // Bounded even if a babbling line never lets the answer be complete.
            let room = self.received.len() < 2 * total + self.sent.len();
            if !complete && room && self.listen(deadline)? {
                deadline = deadline.max((self.clock.now() + patience).min(budget));
                continue;
            }
            if complete {
                self.satisfied(pending.heard_at, total, 1);
            } else {
                self.gave_up(window_end);
            }
            self.stats.answered += answers.iter().filter(|a| a.is_ok()).count() as u64;
            self.stats.garbled += u64::from(answers.contains(&Err(Miss::Garbled)));
            return Ok(answers);
        }
    }
}
