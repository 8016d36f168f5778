//! A CAN line in virtual time, with virtual actuators on it.
//!
//! - Arbitration: whenever the line is idle, of all frames that wait the one with the lowest
//!   identifier goes, bit by bit as on a real line (standard before extended, data before remote).
//! - Timing: a classic frame takes exactly its bits, stuff bits and pause to the next frame
//!   included; a CAN FD frame the most it may take.
//! - The host's send queue is short, as in Linux; [`CanLine::send`] says when it is full.
//! - Bus-off: the host's interface has left the line. It says so once, hears nothing any more, and
//!   what the host sends is lost, until it is started anew.
//!
//! A world's lines ([`crate::World::can_send`]) run with everything else in it; a [`CanLine`] of
//! its own is for a test of one device.
//!
//! - Collision: frames that differ only behind what arbitration compares and begin at once destroy each
//!   other. They are lost and counted ([`CanLine::collisions`]); real controllers would try again, in
//!   step with each other, until chance parts them.
//!
//! Not modelled: other errors on the line.

mod actuator;
mod bits;
mod coded;
mod cubemars;
mod damiao;
mod drive;
mod moteus;
mod odrive;
mod recoil;
mod robstride;
pub mod slcan;

pub(crate) use actuator::BOOT_NS;
pub use actuator::{Actuator, ActuatorError};
pub use drive::Trouble;

use crate::servo::Event;
use std::collections::VecDeque;
use std::ops::Range;

/// A frame, on the simulator's side.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CanFrame {
    /// 11 bits, or 29 if `extended`.
    pub id: u32,
    /// Which of the two.
    pub extended: bool,
    /// Classic, remote or FD.
    pub kind: Kind,
    /// 0 to 8 bytes, or up to 64 with FD.
    pub bytes: Vec<u8>,
}

/// Formats of frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// CAN 2.0 with data.
    Classic,
    /// CAN 2.0 remote request for so many bytes.
    Remote(u8),
    /// CAN FD, its payload at the fast rate or not.
    Fd {
        /// At the fast rate.
        fast: bool,
    },
}

impl CanFrame {
    /// A classic frame with data.
    #[must_use]
    pub fn classic(id: u32, extended: bool, bytes: &[u8]) -> CanFrame {
        CanFrame { id, extended, kind: Kind::Classic, bytes: bytes.to_vec() }
    }

    /// Cuts the payload, or fills it up with zeros, as far as its format allows.
    pub(crate) fn set_length(&mut self, length: usize) {
        let most = if matches!(self.kind, Kind::Fd { .. }) { 64 } else { 8 };
        self.bytes.resize(length.min(most), 0);
    }

    /// What arbitration compares, first bit highest: 11 bits of identifier, RTR or SRR, IDE, the
    /// rest of an extended identifier, its RTR. Zero wins.
    fn urgency(&self) -> u32 {
        let remote = u32::from(matches!(self.kind, Kind::Remote(_)));
        if self.extended {
            (self.id >> 18) << 21 | 0b11 << 19 | (self.id & 0x3_FFFF) << 1 | remote
        } else {
            self.id << 21 | remote << 20
        }
    }
}

/// What the host's interface hears.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum CanHeard {
    /// A frame of someone else.
    Frame(CanFrame),
    /// The interface has left the line.
    BusOff,
    /// It takes part again.
    Restarted,
}

/// How fast a line is and how much the host may queue.
#[derive(Clone, Copy, Debug)]
pub struct CanOptions {
    /// Bit rate, bit/s.
    pub bitrate_bps: u32,
    /// Bit rate of the payload of fast FD frames, bit/s.
    pub data_bitrate_bps: u32,
    /// Frames the host's interface holds; Linux has 10 by default (`txqueuelen`).
    pub queue_frames: usize,
    /// False: frames take no time.
    pub timing: bool,
}

impl Default for CanOptions {
    fn default() -> Self {
        CanOptions {
            bitrate_bps: 1_000_000,
            data_bitrate_bps: 5_000_000,
            queue_frames: 10,
            timing: true,
        }
    }
}

/// The host's send queue is full (`ENOBUFS`).
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the send queue is full")]
pub struct QueueFull;

/// What the host does not fetch is lost beyond this many, as in a socket's buffer.
const INBOX_FRAMES: usize = 4096;

/// A frame that waits for the line.
#[derive(Clone, Debug)]
struct Waiting {
    /// It goes not before; of the host's, when it was queued.
    ready_ns: u64,
    frame: CanFrame,
    /// When the position in it was measured, if there is one and it is true.
    told_ns: Option<u64>,
}

type Queue = VecDeque<Waiting>;

/// The frame that is on the line.
#[derive(Clone, Copy, Debug)]
struct Passing {
    node: usize,
    start_ns: u64,
    end_ns: u64,
}

/// A node that talks without being asked: foreign, or gone mad.
#[derive(Clone, Debug)]
struct Babbler {
    frame: CanFrame,
    period_ns: u64,
    next_ns: u64,
    until_ns: u64,
}

/// A frame an actuator is about to send.
#[derive(Clone, Debug)]
pub(crate) struct Said {
    pub actuator: usize,
    pub ready_ns: u64,
    pub frame: CanFrame,
    /// The position it tells, microradians.
    pub told: Option<i64>,
    /// When that was measured.
    pub told_ns: Option<u64>,
}

/// What one event on a line has brought.
#[derive(Debug, Default)]
pub(crate) struct Happened {
    /// To be handed to [`CanLine::queue`].
    pub said: Vec<Said>,
    /// For the referee: of which actuator, when, what.
    pub events: Vec<(usize, u64, Event)>,
    /// A frame was on the line.
    pub busy_ns: Option<Range<u64>>,
    /// It was the host's, who queued it then.
    pub asked_ns: Option<u64>,
    /// The frame that has passed, and whether it was the host's.
    pub passed: Option<(bool, CanFrame)>,
    /// The host has a position now: of which actuator, when it was measured.
    pub had: Option<(usize, u64)>,
}

/// The line, and all that hangs on it.
#[derive(Clone, Debug)]
pub struct CanLine {
    options: CanOptions,
    actuators: Vec<Actuator>,
    now_ns: u64,
    free_ns: u64,
    busy_ns: u64,
    collisions: u64,
    passing: Option<Passing>,
    sending: Queue,
    answering: Vec<Queue>,
    babblers: Vec<Babbler>,
    babbling: Queue,
    bus_off: bool,
    /// Nothing of the host's goes out before: nobody acknowledges.
    held_until_ns: u64,
    inbox: VecDeque<CanHeard>,
    /// What the host said last, for those who throw it back at it.
    last_of_host: Option<CanFrame>,
    /// Frames queued at the one moment may have been there since the other, ns.
    noticed: VecDeque<(u64, u64)>,
}

impl CanLine {
    /// A line with these actuators at time zero.
    #[must_use]
    pub fn new(options: CanOptions, actuators: Vec<Actuator>) -> CanLine {
        let answering = vec![Queue::new(); actuators.len()];
        CanLine {
            options,
            actuators,
            now_ns: 0,
            free_ns: 0,
            busy_ns: 0,
            collisions: 0,
            passing: None,
            sending: Queue::new(),
            answering,
            babblers: Vec::new(),
            babbling: Queue::new(),
            bus_off: false,
            held_until_ns: 0,
            inbox: VecDeque::new(),
            last_of_host: None,
            noticed: VecDeque::new(),
        }
    }

    /// The present, ns.
    #[must_use]
    pub fn now_ns(&self) -> u64 {
        self.now_ns
    }

    /// Time the line was occupied so far, ns.
    #[must_use]
    pub fn busy_ns(&self) -> u64 {
        self.busy_ns
    }

    /// How often frames destroyed each other.
    #[must_use]
    pub fn collisions(&self) -> u64 {
        self.collisions
    }

    /// How fast it is, and what the host may queue.
    #[must_use]
    pub fn options(&self) -> CanOptions {
        self.options
    }

    /// Lets the host queue so many frames from now on.
    pub fn set_queue(&mut self, frames: usize) {
        self.options.queue_frames = frames;
    }

    /// The actuators, in the order given.
    #[must_use]
    pub fn actuators(&self) -> &[Actuator] {
        &self.actuators
    }

    /// The actuators, to place or break them past the line.
    pub fn actuators_mut(&mut self) -> &mut [Actuator] {
        &mut self.actuators
    }

    pub(crate) fn add(&mut self, actuator: Actuator) {
        self.actuators.push(actuator);
        self.answering.push(Queue::new());
    }

    /// The host queues a frame.
    ///
    /// # Errors
    /// The queue is full; time must pass first.
    pub fn send(&mut self, frame: CanFrame) -> Result<(), QueueFull> {
        if self.bus_off {
            return Ok(()); // As Linux does: the interface has no carrier, and the frame is lost.
        }
        if self.sending.len() >= self.options.queue_frames {
            return Err(QueueFull);
        }
        self.sending.push_back(Waiting { ready_ns: self.now_ns, frame, told_ns: None });
        Ok(())
    }

    /// As [`CanLine::send`], of a frame that may have been there since `earliest_ns`.
    pub(crate) fn send_noticed(
        &mut self,
        frame: CanFrame,
        earliest_ns: u64,
    ) -> Result<(), QueueFull> {
        self.send(frame)?;
        let noticed = (self.now_ns, earliest_ns.min(self.now_ns));
        if noticed.0 != noticed.1 && self.noticed.back() != Some(&noticed) {
            self.noticed.push_back(noticed);
        }
        Ok(())
    }

    /// When a frame of the host that was queued at `asked_ns` may have been there at the earliest.
    pub(crate) fn earliest_ns(&self, asked_ns: u64) -> u64 {
        let noticed = self.noticed.iter().find(|&&(queued_ns, _)| queued_ns == asked_ns);
        noticed.map_or(asked_ns, |&(_, earliest_ns)| earliest_ns)
    }

    /// What the host has heard next by now.
    pub fn receive(&mut self) -> Option<CanHeard> {
        self.inbox.pop_front()
    }

    /// Throws away what the host has heard.
    pub(crate) fn discard_input(&mut self) {
        self.inbox.clear();
    }

    /// The host's interface leaves the line, or takes part in it again.
    pub fn set_bus_off(&mut self, bus_off: bool) {
        if bus_off == self.bus_off {
            return;
        }
        self.bus_off = bus_off;
        self.inbox.push_back(if bus_off { CanHeard::BusOff } else { CanHeard::Restarted });
        if self.passing.is_some_and(|passing| passing.node == HOST) {
            self.passing = None;
        }
        self.sending.clear();
    }

    /// Until `until_ns` nothing of the host's goes out, as if nobody acknowledged it: its queue fills.
    pub fn hold(&mut self, until_ns: u64) {
        self.held_until_ns = until_ns;
    }

    /// The host's interface is pulled out: what it was to send or has heard is lost.
    pub(crate) fn pull_out(&mut self) {
        if self.passing.is_some_and(|passing| passing.node == HOST) {
            self.passing = None;
        }
        self.sending.clear();
        self.inbox.clear();
        self.bus_off = false;
    }

    /// Another node sends this frame every `period_ns`, 10 us at least, from now on.
    pub fn babble(&mut self, frame: CanFrame, period_ns: u64, until_ns: u64) {
        let (period_ns, next_ns) = (period_ns.max(10_000), self.now_ns);
        self.babblers.push(Babbler { frame, period_ns, next_ns, until_ns });
    }

    /// Nobody sends this frame unasked any more.
    pub(crate) fn hush(&mut self, frame: &CanFrame) {
        self.babblers.retain(|babbler| babbler.frame != *frame);
    }

    /// Lets time pass, to `time_ns` or to the first thing the host hears, whichever is first.
    pub fn run_until_heard(&mut self, time_ns: u64) {
        while self.inbox.is_empty() {
            match self.next_event_ns().filter(|&next_ns| next_ns <= time_ns) {
                Some(next_ns) => self.run_until(next_ns),
                None => return self.pass(time_ns),
            }
        }
    }

    /// Lets time pass.
    pub fn run_until(&mut self, time_ns: u64) {
        while self.next_event_ns().is_some_and(|next_ns| next_ns <= time_ns) {
            for said in self.happen().said {
                self.queue(said);
            }
        }
        self.pass(time_ns);
        for actuator in &mut self.actuators {
            actuator.take_events();
        }
    }

    /// When something happens on the line next.
    pub(crate) fn next_event_ns(&self) -> Option<u64> {
        let due = self.actuators.iter().filter_map(Actuator::due_ns);
        let babble = self.babblers.iter().map(|babbler| babbler.next_ns);
        let line = match self.passing {
            Some(passing) => Some(passing.end_ns),
            None => self.first_ready_ns().map(|ready_ns| ready_ns.max(self.free_ns)),
        };
        due.chain(babble).chain(line).min().map(|next_ns| next_ns.max(self.now_ns))
    }

    /// Carries out the next event: someone speaks up, a frame has passed, the next begins.
    pub(crate) fn happen(&mut self) -> Happened {
        let mut happened = Happened::default();
        let Some(time_ns) = self.next_event_ns() else { return happened };
        self.pass(time_ns);
        self.speak_up(&mut happened.said);
        match self.passing.take_if(|passing| passing.end_ns <= time_ns) {
            Some(passing) => self.deliver(passing, &mut happened),
            None if happened.said.is_empty() && self.passing.is_none() => self.begin(),
            None => {}
        }
        for (k, actuator) in self.actuators.iter_mut().enumerate() {
            let events = actuator.take_events().into_iter();
            happened.events.extend(events.map(|(at_ns, event)| (k, at_ns, event)));
        }
        happened
    }

    /// An actuator sends what it said.
    pub(crate) fn queue(&mut self, said: Said) {
        if let Some(queue) = self.answering.get_mut(said.actuator) {
            let Said { ready_ns, frame, told_ns, .. } = said;
            queue.push_back(Waiting { ready_ns, frame, told_ns });
        }
    }

    pub(crate) fn last_of_host(&self) -> Option<&CanFrame> {
        self.last_of_host.as_ref()
    }

    /// Those who speak without being asked do.
    fn speak_up(&mut self, said: &mut Vec<Said>) {
        let ready_ns = self.now_ns;
        for (k, actuator) in self.actuators.iter_mut().enumerate() {
            while actuator.due_ns().is_some_and(|due_ns| due_ns <= ready_ns) {
                said.extend(sayings(actuator.speak(), k, ready_ns, actuator.take_told()));
            }
        }
        for babbler in &mut self.babblers {
            while babbler.next_ns <= ready_ns {
                // A node that cannot keep up sends the same again.
                if self.babbling.len() < 2 {
                    let (ready_ns, frame) = (babbler.next_ns, babbler.frame.clone());
                    self.babbling.push_back(Waiting { ready_ns, frame, told_ns: None });
                }
                babbler.next_ns += babbler.period_ns;
            }
        }
        self.babblers.retain(|babbler| babbler.next_ns < babbler.until_ns);
    }

    /// The first frame of each node, and when it may go.
    fn heads(&self) -> impl Iterator<Item = (usize, u64, &CanFrame)> + Clone {
        let devices = self.answering.iter().chain([&self.babbling]);
        let queues = std::iter::once(&self.sending).chain(devices).enumerate();
        queues.filter_map(|(node, queue)| {
            let Waiting { ready_ns, frame, .. } = queue.front()?;
            let held_ns = if node == HOST { self.held_until_ns } else { 0 };
            Some((node, held_ns.max(*ready_ns), frame))
        })
    }

    fn first_ready_ns(&self) -> Option<u64> {
        self.heads().map(|(_, ready_ns, _)| ready_ns).min()
    }

    /// Of all frames that wait, the most urgent one begins.
    fn begin(&mut self) {
        let start_ns = self.now_ns;
        let waiting = || self.heads().filter(|(_, ready_ns, _)| *ready_ns <= start_ns);
        let Some((node, _, frame)) = waiting().min_by_key(|(_, _, frame)| frame.urgency()) else {
            return;
        };
        let end_ns = start_ns + bits::length_ns(frame, self.options);
        let as_urgent = waiting().filter(|(_, _, other)| other.urgency() == frame.urgency());
        let alike = as_urgent.clone().all(|(_, _, other)| other == frame);
        let lost: Vec<usize> = as_urgent.map(|(node, ..)| node).collect();
        if alike {
            self.passing = Some(Passing { node, start_ns, end_ns });
            return;
        }
        for node in lost {
            self.queue_of(node).pop_front();
        }
        self.collisions += 1;
        self.busy_ns += end_ns - start_ns;
        self.free_ns = end_ns;
    }

    fn queue_of(&mut self, node: usize) -> &mut Queue {
        match node {
            HOST => &mut self.sending,
            node => self.answering.get_mut(node - 1).unwrap_or(&mut self.babbling),
        }
    }

    pub(crate) fn pass(&mut self, time_ns: u64) {
        for actuator in &mut self.actuators {
            actuator.run_until(time_ns);
        }
        self.now_ns = self.now_ns.max(time_ns);
    }

    /// A frame has passed whole.
    fn deliver(&mut self, passing: Passing, happened: &mut Happened) {
        let Passing { node, start_ns, end_ns } = passing;
        let Some(Waiting { ready_ns: asked_ns, frame, told_ns }) = self.queue_of(node).pop_front()
        else {
            return;
        };
        self.free_ns = end_ns;
        self.busy_ns += end_ns - start_ns;
        happened.busy_ns = Some(start_ns..end_ns);
        happened.passed = Some((node == HOST, frame.clone()));
        if node != HOST {
            if !self.bus_off && self.inbox.len() < INBOX_FRAMES {
                self.inbox.push_back(CanHeard::Frame(frame));
                happened.had = told_ns.map(|told_ns| (node - 1, told_ns));
            }
            return;
        }
        happened.asked_ns = Some(asked_ns);
        while self.noticed.front().is_some_and(|&(queued_ns, _)| queued_ns < asked_ns) {
            self.noticed.pop_front();
        }
        for (k, actuator) in self.actuators.iter_mut().enumerate() {
            let ready_ns = end_ns + actuator.answer_delay_ns();
            let frames = actuator.hear(&frame, asked_ns);
            happened.said.extend(sayings(frames, k, ready_ns, actuator.take_told()));
        }
        self.last_of_host = Some(frame);
    }
}

/// What an actuator says at once: a position in it is in the first frame.
fn sayings(
    frames: Vec<CanFrame>,
    actuator: usize,
    ready_ns: u64,
    told: Option<i64>,
) -> impl Iterator<Item = Said> {
    frames.into_iter().enumerate().map(move |(k, frame)| {
        let told = told.filter(|_| k == 0);
        Said { actuator, ready_ns, frame, told, told_ns: None }
    })
}

/// The host's place among the nodes; the actuators follow, and whoever babbles.
const HOST: usize = 0;

#[cfg(test)]
mod tests {
    use super::*;

    fn line() -> CanLine {
        CanLine::new(CanOptions::default(), Vec::new())
    }

    #[test]
    fn standard_wins_over_extended_and_data_over_remote() {
        let urgency =
            |id, extended, kind| CanFrame { id, extended, kind, bytes: Vec::new() }.urgency();
        let standard = urgency(0x100, false, Kind::Classic);
        let remote = urgency(0x100, false, Kind::Remote(8));
        let extended = urgency(0x100 << 18, true, Kind::Classic);
        let next = urgency(0x101, false, Kind::Classic);
        assert!(standard < remote && remote < extended && extended < next);
    }

    #[test]
    fn a_full_queue_says_so_until_time_has_passed() {
        let mut line = line();
        let frame = CanFrame::classic(1, false, &[0; 8]);
        for _ in 0..10 {
            assert_eq!(line.send(frame.clone()), Ok(()));
        }
        assert_eq!(line.send(frame.clone()), Err(QueueFull));
        line.run_until(200_000);
        assert_eq!(line.send(frame), Ok(()), "one frame has left within 200 us");
        assert!(line.busy_ns() > 0);
    }
    #[test]
    fn frames_under_one_identifier_that_begin_at_once_destroy_each_other() {
        let heard = |second_ready_ns| {
            let mut line = line();
            for (actuator, ready_ns) in [(0, 1_000), (1, second_ready_ns)] {
                line.answering.push(Queue::new());
                let frame = CanFrame::classic(0, false, &[actuator as u8; 8]);
                line.queue(Said { actuator, ready_ns, frame, told: None, told_ns: None });
            }
            line.run_until(1_000_000);
            (std::iter::from_fn(|| line.receive()).count(), line.collisions())
        };
        assert_eq!(heard(1_000), (0, 1));
        // One that begins while the other passes waits for its end.
        assert_eq!(heard(1_001), (2, 0));
    }
}
