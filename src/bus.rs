//! One question at a time on one shared line: deadlines from the line speed, answers matched by
//! ID, one retry inside the caller's time budget, every miss counted.
//!
//! A question is split in `begin` and `finish`, so that two lines can overlap without threads.

pub mod can;
mod codec;
mod group;
mod instruct;
mod patience;
pub mod scan;

use crate::port::{BytePort, Clock, Closed, PortError};
use crate::time::{Duration, Instant};
use crate::units::line_time_s;
use codec::Heard;
pub use codec::{GroupItem, GroupRead, Protocol};
pub use group::GroupQuestion;
use group::Pending;
pub use instruct::{FactoryReset, RollCall};
use patience::{HOST_LATE, Patience};
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
const WARY_FOR: Duration = Duration::from_millis(300);

/// Where nothing moves, the longest that an answer is waited for beyond the time it takes.
const MOST_PATIENCE: Duration = Duration::from_millis(10);

/// Where nothing moves, the line has this long at least to take a question.
const PATIENT_SEND: Duration = Duration::from_millis(100);

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
    /// It was not this device's turn to be asked.
    NotAsked,
    /// A sound answer, but with a position the joint cannot have reached since the last.
    Implausible,
    /// Nothing was heard, but each time this host was late: it says nothing of the device.
    HostLate {
        /// How late it was in all, ms.
        by_ms: u64,
    },
}

impl fmt::Display for Miss {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Silent => f.write_str("no answer"),
            Self::Garbled => f.write_str("answer damaged on the line"),
            Self::WrongId { asked, got } => write!(f, "asked ID {asked}, ID {got} answered"),
            Self::Refused(text) => write!(f, "the device refused: {text}"),
            Self::NotAsked => f.write_str("not asked in this cycle"),
            Self::Implausible => f.write_str("a position the joint cannot have reached"),
            Self::HostLate { by_ms } => {
                write!(f, "this host was {by_ms} ms late in hearing the answers")
            }
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

/// A shared line. Every question says which protocol it is in: one line may mix families.
pub struct Bus {
    port: Box<dyn BytePort>,
    clock: Arc<dyn Clock>,
    timing: Timing,
    stats: Stats,
    sent: Vec<u8>,
    received: Vec<u8>,
    scratch: Vec<u8>,
    heard: usize,
    retries: u32,
    /// How much later than they should have waits ended so far, in all.
    late: Duration,
    sending_until: Instant,
    quiet_until: Instant,
    wary_until: Instant,
    pending: Option<Pending>,
    /// Who answered the group read under way without being asked.
    strangers: Vec<u8>,
    echo: bool,
    /// Our own bytes will be heard before the answer.
    echo_due: bool,
}

impl Bus {
    /// A line behind `port`. `clock` is the port's own.
    #[must_use]
    pub fn new(port: Box<dyn BytePort>, clock: Arc<dyn Clock>, timing: Timing) -> Self {
        Self {
            port,
            clock,
            timing,
            stats: Stats::default(),
            sent: Vec::with_capacity(1024),
            received: Vec::with_capacity(4096),
            scratch: Vec::with_capacity(1024),
            heard: 0,
            retries: 1,
            late: Duration::ZERO,
            sending_until: Instant::ZERO,
            quiet_until: Instant::ZERO,
            wary_until: Instant::ZERO,
            pending: None,
            strangers: Vec::with_capacity(8),
            echo: false,
            echo_due: false,
        }
    }

    /// Speaks at another speed from now on, through a port that is opened anew: the one before is
    /// closed first, since a port is held by one. If that fails the line stays closed.
    ///
    /// # Errors
    /// What `open` fails with.
    pub fn reopen<E>(
        &mut self,
        baud_bps: u32,
        open: impl FnOnce() -> Result<Box<dyn BytePort>, E>,
    ) -> Result<(), E> {
        self.port = Box::new(Closed);
        self.port = open()?;
        self.timing.baud_bps = baud_bps;
        Ok(())
    }

    /// Says whether the adapter lets the host hear its own bytes. In Protocol 1.0 and its kin an
    /// instruction looks like the answer to it, so this has to be known beforehand.
    pub const fn set_echo(&mut self, echo: bool) {
        self.echo = echo;
    }

    /// What happened so far.
    #[must_use]
    pub const fn stats(&self) -> Stats {
        self.stats
    }

    /// How late this host was so far, in all: what its waits took beyond their ends, and its
    /// sending beyond what that takes.
    #[must_use]
    pub const fn host_late(&self) -> Duration {
        self.late
    }

    /// Notes if it is later than it should be.
    fn note_late(&mut self, due: Instant) {
        let late = self.clock.now().since(due);
        if late > HOST_LATE {
            self.late += late;
        }
    }

    /// The line's timing.
    #[must_use]
    pub const fn timing(&self) -> Timing {
        self.timing
    }

    /// Time `bytes` take on the line.
    fn line_time(&self, bytes: usize) -> Duration {
        Duration::from_secs_f64(line_time_s(bytes, self.timing.baud_bps))
    }

    /// Time a device that speaks `protocol` waits before it answers.
    fn return_delay(&self, protocol: Protocol) -> Duration {
        self.timing.return_delay.max(protocol.least_reply_delay())
    }

    /// Time `bytes` in `devices` answers take on the line, return delays included.
    fn line_and_delay(&self, protocol: Protocol, bytes: usize, devices: usize) -> Duration {
        let devices = u32::try_from(devices).unwrap_or(u32::MAX);
        self.line_time(bytes) + self.return_delay(protocol) * devices
    }

    /// The longest it may take until they are here, once the question has left.
    fn answer_time(&self, protocol: Protocol, bytes: usize, devices: usize) -> Duration {
        self.line_and_delay(protocol, bytes, devices) + self.timing.latency + SLACK
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
    pub fn fits(&self, protocol: Protocol, length: usize, budget: Instant) -> bool {
        let question = self.line_time(protocol.read_bytes());
        let begins = self.clock.now().max(self.quiet_until);
        let answer = self.answer_time(protocol, protocol.status_bytes(length), 1);
        begins + question + answer <= budget
    }

    /// Line time of reading `length` bytes from one device, s.
    #[must_use]
    pub fn one_read_time_s(&self, protocol: Protocol, length: usize) -> f64 {
        let bytes = protocol.read_bytes() + protocol.status_bytes(length);
        self.line_and_delay(protocol, bytes, 1).as_secs_f64()
    }

    /// From now on every device waits at most this long before it answers.
    pub const fn set_return_delay(&mut self, return_delay: Duration) {
        self.timing.return_delay = return_delay;
    }

    /// Line time of a sync write of `length` bytes to each of `devices`, s.
    #[must_use]
    pub fn write_time_s(&self, protocol: Protocol, devices: usize, length: usize) -> f64 {
        line_time_s(protocol.sync_write_bytes(devices, length), self.timing.baud_bps)
    }

    /// Sends what is in `self.sent`, after the silence a lost answer left behind.
    fn say(&mut self, budget: Instant) -> Result<Instant, AskError> {
        // Late bytes of an answer given up on must not be taken for the next one.
        let due = self.clock.now().max(self.quiet_until);
        self.clock.sleep_until(self.quiet_until);
        self.port.discard_input()?;
        self.received.clear();
        self.heard = 0;
        self.echo_due = self.echo;
        self.port.send(&self.sent, budget)?;
        self.note_late(due);
        self.stats.asked += 1;
        self.stats.bytes += self.sent.len() as u64;
        // Bytes queue behind those still leaving; nothing needs to be waited for.
        let begins = self.sending_until.max(self.clock.now());
        self.sending_until = begins + self.line_time(self.sent.len());
        Ok(self.sending_until)
    }

    /// Receives more bytes by `deadline`; false if none came.
    fn listen(&mut self, deadline: Instant) -> Result<bool, PortError> {
        if self.heard >= MOST_HEARD {
            return Ok(false);
        }
        let mut chunk = [0_u8; 1024];
        let due = self.clock.now().max(deadline);
        let received = self.port.receive(&mut chunk, deadline);
        self.note_late(due);
        match received {
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

    /// What lies at the front of the received bytes, our own taken away.
    fn front(&mut self, protocol: Protocol, longest: usize) -> Heard<'_> {
        if self.echo_due && self.received.starts_with(&self.sent) {
            self.received.drain(..self.sent.len());
            self.echo_due = false;
        }
        if self.echo_due && self.sent.starts_with(&self.received) {
            return Heard::Need;
        }
        protocol.decode(&self.received, longest, &mut self.scratch)
    }

    /// Nothing more comes: drops the beginning of a packet, so that one behind it is found.
    fn drop_cut_packet(&mut self, protocol: Protocol, miss: &mut Miss) -> bool {
        let cut = protocol.abandon(&self.received);
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
    fn satisfied(&mut self, protocol: Protocol, heard_at: Instant, bytes: usize, devices: usize) {
        if self.clock.now() < self.wary_until {
            let true_end = heard_at + self.line_and_delay(protocol, bytes, devices);
            self.quiet_until = self.quiet_until.max(true_end);
        }
    }

    /// Waits for the one answer of device `id` with `length` bytes.
    fn one_answer(
        &mut self,
        protocol: Protocol,
        id: u8,
        length: usize,
        heard_at: Instant,
        window_end: Instant,
        budget: Instant,
    ) -> Result<Reply, AskError> {
        let mut deadline = window_end.min(budget);
        let mut miss = Miss::Silent;
        loop {
            match self.front(protocol, length) {
                Heard::Need => {
                    if self.listen(deadline)? {
                        if self.is_patient() {
                            // Bytes that come late move the end: the rest may be on its way.
                            let rest = self.answer_time(protocol, protocol.status_bytes(length), 1);
                            deadline = deadline.max(self.clock.now() + rest);
                        }
                    } else if !self.drop_cut_packet(protocol, &mut miss) {
                        self.gave_up(window_end);
                        return Err(miss.into());
                    }
                }
                Heard::Echo(n) | Heard::Noise(n) => drop(self.received.drain(..n)),
                Heard::Damaged(n) => {
                    self.received.drain(..n);
                    self.stats.garbled += 1;
                    miss = Miss::Garbled;
                }
                Heard::Status(said, n) if said.id != id => {
                    miss = Miss::WrongId { asked: id, got: said.id };
                    self.stats.unasked += 1;
                    self.received.drain(..n);
                }
                Heard::Status(said, _) => {
                    let reply = said.reply(length);
                    self.stats.answered += 1;
                    self.satisfied(protocol, heard_at, protocol.status_bytes(length), 1);
                    return reply.map_err(AskError::from);
                }
            }
        }
    }

    /// How often a lost answer of one device is asked for again. Once is for a cycle: it happens
    /// inside the budget or not at all. More are for when nothing moves: each question then has its
    /// share of the budget, time in which this host was late is given back, and a question is not
    /// counted as unanswered that it was too late to hear the answer of.
    pub const fn set_retries(&mut self, retries: u32) {
        self.retries = retries;
    }

    const fn is_patient(&self) -> bool {
        self.retries > 1
    }

    /// Puts a question into `self.sent`.
    fn encode(
        &mut self,
        write: impl FnOnce(&mut Vec<u8>) -> Result<(), String>,
    ) -> Result<(), AskError> {
        self.sent.clear();
        write(&mut self.sent).map_err(AskError::Unsayable)
    }

    /// Asks one device, and again if the answer was lost and `budget` allows.
    fn ask(
        &mut self,
        protocol: Protocol,
        id: u8,
        length: usize,
        budget: Instant,
        question: impl FnOnce(&mut Vec<u8>) -> Result<(), String>,
    ) -> Result<Reply, AskError> {
        self.encode(question)?;
        let window = self.answer_time(protocol, protocol.status_bytes(length), 1);
        let is_patient = self.is_patient();
        let mut patience = Patience::new(budget);
        let mut retries_left = self.retries;
        loop {
            let late_before = self.late;
            let (mut wait, mut send_by) = (window, budget);
            if is_patient {
                let now = self.clock.now();
                let share = patience.end.since(now) / (retries_left + 1);
                wait = window.max(share.min(MOST_PATIENCE));
                send_by = patience.end.max(now + PATIENT_SEND);
            }
            let heard_at = self.say(send_by)?;
            let window_end = heard_at + wait;
            let limit = if is_patient { window_end } else { budget };
            let answer = self.one_answer(protocol, id, length, heard_at, window_end, limit);
            let miss = match answer {
                Err(AskError::Miss(miss)) if !matches!(miss, Miss::Refused(_)) => miss,
                answer => return answer,
            };
            let excused = is_patient && patience.excuses(self.late - late_before);
            if !excused {
                let has_time =
                    self.clock.now() + window <= patience.end || is_patient && patience.is_due();
                if retries_left == 0 || !has_time {
                    return Err(patience.verdict(miss).into());
                }
                retries_left -= 1;
            }
            self.stats.retried += 1;
        }
    }

    /// Asks whether `id` is there. The bytes are the protocol's own (Dynamixel 2.0: model number
    /// and firmware, three bytes; the others: none).
    ///
    /// # Errors
    /// [`AskError`].
    pub fn ping(&mut self, protocol: Protocol, id: u8, budget: Instant) -> Result<Reply, AskError> {
        let length = protocol.ping_bytes();
        self.ask(protocol, id, length, budget, |out| protocol.ping(out, id))
    }

    /// Reads `length` bytes from `address` on.
    ///
    /// # Errors
    /// [`AskError`].
    pub fn read(
        &mut self,
        protocol: Protocol,
        id: u8,
        address: u16,
        length: u16,
        budget: Instant,
    ) -> Result<Reply, AskError> {
        self.ask(protocol, id, usize::from(length), budget, |out| {
            protocol.read(out, id, address, length)
        })
    }

    /// Writes `bytes` from `address` on and waits for the device's yes.
    ///
    /// A device whose status return level says that it answers reads only carries out the write
    /// and is [`Miss::Silent`]. Tell it by [`Bus::sync_write`], which nobody answers, and read back.
    ///
    /// # Errors
    /// [`AskError`].
    pub fn write(
        &mut self,
        protocol: Protocol,
        id: u8,
        address: u16,
        bytes: &[u8],
        budget: Instant,
    ) -> Result<Reply, AskError> {
        self.ask(protocol, id, 0, budget, |out| protocol.write(out, id, address, bytes))
    }

    /// Writes the same registers of many devices at once; nobody answers.
    ///
    /// # Errors
    /// [`AskError::Port`], [`AskError::Unsayable`].
    pub fn sync_write(
        &mut self,
        protocol: Protocol,
        address: u16,
        items: &[(u8, &[u8])],
        budget: Instant,
    ) -> Result<(), AskError> {
        self.encode(|out| protocol.sync_write(out, address, items))?;
        self.say(budget)?;
        Ok(())
    }

    /// Writes registers of many devices at once, to each its own (ID, address, bytes); nobody
    /// answers. Dynamixel 2.0 only.
    ///
    /// # Errors
    /// [`AskError::Port`], [`AskError::Unsayable`].
    pub fn bulk_write(
        &mut self,
        protocol: Protocol,
        items: &[(u8, u16, &[u8])],
        budget: Instant,
    ) -> Result<(), AskError> {
        self.encode(|out| protocol.bulk_write(out, items))?;
        self.say(budget)?;
        Ok(())
    }
}
