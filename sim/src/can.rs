//! A CAN line in virtual time, with virtual actuators on it.
//!
//! - Arbitration: whenever the line is idle, of all frames that wait the one with the lowest
//!   identifier goes, bit by bit as on a real line (standard before extended, data before remote).
//! - Timing: a classic frame takes exactly its bits, stuff bits and pause to the next frame
//!   included; a CAN FD frame the most it may take.
//! - The host's send queue is short, as in Linux; [`CanLine::send`] says when it is full.
//!
//! Not modelled: errors on the line, and two nodes that send the same identifier at once.

mod actuator;
mod bits;
mod codec;

pub use actuator::{Actuator, ActuatorError};

use std::collections::VecDeque;

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

/// How fast a line is and how much the host may queue.
#[derive(Clone, Copy, Debug)]
pub struct CanOptions {
    /// Bit rate, bit/s.
    pub bitrate_bps: u32,
    /// Bit rate of the payload of fast FD frames, bit/s.
    pub data_bitrate_bps: u32,
    /// Frames the host's interface holds; Linux has 10 by default (`txqueuelen`).
    pub queue_frames: usize,
}

impl Default for CanOptions {
    fn default() -> Self {
        CanOptions { bitrate_bps: 1_000_000, data_bitrate_bps: 5_000_000, queue_frames: 10 }
    }
}

/// The host's send queue is full (`ENOBUFS`).
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the send queue is full")]
pub struct QueueFull;

/// Frames that wait for the line, each not before its time.
type Queue = VecDeque<(u64, CanFrame)>;

/// The line, and all that hangs on it.
#[derive(Clone, Debug)]
pub struct CanLine {
    options: CanOptions,
    actuators: Vec<Actuator>,
    now_ns: u64,
    free_ns: u64,
    busy_ns: u64,
    sending: Queue,
    answering: Vec<Queue>,
    inbox: VecDeque<CanFrame>,
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
            sending: Queue::new(),
            answering,
            inbox: VecDeque::new(),
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

    /// The actuators, in the order given.
    #[must_use]
    pub fn actuators(&self) -> &[Actuator] {
        &self.actuators
    }

    /// The actuators, to place or break them past the line.
    pub fn actuators_mut(&mut self) -> &mut [Actuator] {
        &mut self.actuators
    }

    /// The host queues a frame.
    ///
    /// # Errors
    /// The queue is full; time must pass first.
    pub fn send(&mut self, frame: CanFrame) -> Result<(), QueueFull> {
        if self.sending.len() >= self.options.queue_frames {
            return Err(QueueFull);
        }
        self.sending.push_back((self.now_ns, frame));
        Ok(())
    }

    /// The next frame the host has heard by now.
    pub fn receive(&mut self) -> Option<CanFrame> {
        self.inbox.pop_front()
    }

    /// Lets time pass, to `time_ns` or to the first frame the host hears, whichever is first.
    pub fn run_until_heard(&mut self, time_ns: u64) {
        while self.inbox.is_empty() && self.now_ns < time_ns {
            self.step(time_ns);
        }
    }

    /// Lets time pass.
    pub fn run_until(&mut self, time_ns: u64) {
        while self.now_ns < time_ns {
            self.step(time_ns);
        }
    }

    /// One frame goes over the line whole by `time_ns`, or time passes to there.
    fn step(&mut self, time_ns: u64) {
        let start_ns = match self.first_ready_ns() {
            Some(ready_ns) => ready_ns.max(self.free_ns),
            None => return self.pass(time_ns),
        };
        let Some((node, length_ns)) = self.winner(start_ns) else {
            return self.pass(time_ns);
        };
        let end_ns = start_ns + length_ns;
        if end_ns > time_ns {
            return self.pass(time_ns);
        }
        let queue = if node == HOST { &mut self.sending } else { &mut self.answering[node - 1] };
        let Some((_, frame)) = queue.pop_front() else { return self.pass(time_ns) };
        self.pass(end_ns);
        self.free_ns = end_ns;
        self.busy_ns += length_ns;
        self.deliver(node, &frame);
    }

    fn queues(&self) -> impl Iterator<Item = (usize, &Queue)> {
        std::iter::once(&self.sending).chain(&self.answering).enumerate()
    }

    fn first_ready_ns(&self) -> Option<u64> {
        self.queues().filter_map(|(_, queue)| queue.front()).map(|(ready_ns, _)| *ready_ns).min()
    }

    /// Who wins the line that is idle at `start_ns`, and for how long.
    fn winner(&self, start_ns: u64) -> Option<(usize, u64)> {
        let heads = self.queues().filter_map(|(node, queue)| Some((node, queue.front()?)));
        heads
            .filter(|(_, (ready_ns, _))| *ready_ns <= start_ns)
            .min_by_key(|(_, (_, frame))| frame.urgency())
            .map(|(node, (_, frame))| (node, bits::length_ns(frame, self.options)))
    }

    fn pass(&mut self, time_ns: u64) {
        for actuator in &mut self.actuators {
            actuator.run_until(time_ns);
        }
        self.now_ns = self.now_ns.max(time_ns);
    }

    fn deliver(&mut self, from: usize, frame: &CanFrame) {
        if from != HOST {
            return self.inbox.push_back(frame.clone());
        }
        for (actuator, queue) in self.actuators.iter_mut().zip(&mut self.answering) {
            if let Some(answer) = actuator.hear(frame) {
                queue.push_back((self.now_ns + actuator.answer_delay_ns(), answer));
            }
        }
    }
}

/// The host's place among the nodes; the actuators follow.
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
}
