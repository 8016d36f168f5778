//! One CAN line: frames out, answers matched by whoever asks, deadlines, counts, and what the line
//! reports of itself.
//!
//! Unlike a serial line nobody has to wait for anybody: frames carry their own identifier, so
//! several questions may be open at once, and a late answer is still its device's own.

mod bits;
mod peer;
pub mod scan;
#[cfg(test)]
mod tests;

pub use bits::Shape;
pub use peer::{Form, NoSuchSetting, Peer};

use super::patience::{HOST_LATE, Patience};
use super::{AskError, Miss};
use crate::port::{Clock, FramePort, Heard, PortError};
use crate::time::{Duration, Instant};
use crate::wire::can::CanFrame;
use crate::wire::can::error_frame::ErrorFrame;
use std::sync::Arc;

/// What the deadlines of a CAN line are made of.
#[derive(Clone, Copy, Debug)]
pub struct CanTiming {
    /// Bits per second.
    pub bitrate_bps: u32,
    /// Bits per second in the payload of fast FD frames; without CAN FD of no meaning.
    pub data_bitrate_bps: u32,
    /// Time the adapter may hold frames back.
    pub latency: Duration,
}

/// Time a device takes to answer. No maker promises one; 50 to 300 us have been measured.
const ANSWER_DELAY: Duration = Duration::from_millis(1);
/// Scheduling time granted on top.
const SLACK: Duration = Duration::from_micros(500);
/// Longest wait for the answer to one question outside the cycle, before it is asked again.
const PATIENCE: Duration = Duration::from_millis(10);

/// What happened on the line so far.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CanStats {
    /// Frames sent.
    pub sent: u64,
    /// Frames of known devices.
    pub heard: u64,
    /// Questions asked again.
    pub retried: u64,
    /// Frames that are nobody's here: of other devices, of unknown meaning, or cut short.
    pub foreign: u64,
    /// Time these frames occupy the line, s, each taken for the longest it may be.
    pub busy_s: f64,
    /// How often the send queue was found full, and waited for.
    pub full_queue: u64,
    /// Lines of text of a serial adapter that meant nothing: bytes of it were lost.
    pub garbled: u64,
    /// Reports of the line: nobody acknowledged.
    pub no_ack: u64,
    /// Reports: so many errors that the controller may not speak up any more.
    pub passive: u64,
    /// Reports: frames were lost in the controller.
    pub overflow: u64,
    /// Reports of any other kind.
    pub other_reports: u64,
}

/// A CAN line.
pub struct CanBus {
    port: Box<dyn FramePort>,
    clock: Arc<dyn Clock>,
    timing: CanTiming,
    stats: CanStats,
    retries: u32,
    /// How much later than they should have waits ended so far, in all.
    late: Duration,
    last_report: Option<ErrorFrame>,
}

impl CanBus {
    /// A line behind `port`. `clock` is the port's own.
    #[must_use]
    pub fn new(port: Box<dyn FramePort>, clock: Arc<dyn Clock>, timing: CanTiming) -> Self {
        let stats = CanStats::default();
        let late = Duration::ZERO;
        Self { port, clock, timing, stats, retries: 1, late, last_report: None }
    }

    /// How late this host was so far, in all: what its waits took beyond their ends.
    #[must_use]
    pub const fn host_late(&self) -> Duration {
        self.late
    }

    /// What happened so far.
    #[must_use]
    pub fn stats(&self) -> CanStats {
        let (full_queue, garbled) = (self.port.full_queue_count(), self.port.garbled_count());
        CanStats { full_queue, garbled, ..self.stats }
    }

    /// The last thing the line reported of itself.
    #[must_use]
    pub const fn last_report(&self) -> Option<ErrorFrame> {
        self.last_report
    }

    /// How often a lost answer is asked for again.
    pub const fn set_retries(&mut self, retries: u32) {
        self.retries = retries;
    }

    /// How often a lost answer is asked for again.
    #[must_use]
    pub const fn retries(&self) -> u32 {
        self.retries
    }

    /// The longest a frame of this form occupies the line, s.
    #[must_use]
    pub fn frame_time_s(&self, shape: Shape) -> f64 {
        shape.longest_s(self.timing.bitrate_bps, self.timing.data_bitrate_bps)
    }

    /// The longest until all answers to frames sent now are here, if frames and answers together
    /// occupy the line for `line_s`.
    #[must_use]
    pub fn answer_time(&self, line_s: f64) -> Duration {
        Duration::from_secs_f64(line_s) + ANSWER_DELAY + self.timing.latency + SLACK
    }

    /// Hands a frame to the line, waiting for room in its send queue.
    ///
    /// # Errors
    /// [`AskError::Port`]; a queue that stays full is one too: nobody takes what is said.
    pub fn send(&mut self, frame: &CanFrame, budget: Instant) -> Result<(), AskError> {
        self.port.send(frame, budget)?;
        self.stats.sent += 1;
        self.stats.busy_s += self.frame_time_s(Shape::of(frame));
        Ok(())
    }

    /// What is heard by `until`; none if nothing is.
    ///
    /// # Errors
    /// [`AskError::Port`]: the port failed, or the line reports that its controller left it.
    fn next(&mut self, until: Instant) -> Result<Option<CanFrame>, AskError> {
        loop {
            let due = self.clock.now().max(until);
            let received = self.port.receive(until);
            let late = self.clock.now().since(due);
            if late > HOST_LATE {
                self.late += late;
            }
            match received {
                Ok(Heard::Frame(frame)) => {
                    self.stats.busy_s += self.frame_time_s(Shape::of(&frame));
                    return Ok(Some(frame));
                }
                Ok(Heard::Report(report)) => self.note(report)?,
                Err(PortError::TimedOut) => return Ok(None),
                Err(error) => return Err(error.into()),
            }
        }
    }

    fn note(&mut self, report: ErrorFrame) -> Result<(), PortError> {
        self.last_report = Some(report);
        self.stats.no_ack += u64::from(report.no_ack());
        self.stats.passive += u64::from(report.passive());
        self.stats.overflow += u64::from(report.overflow());
        let named = report.no_ack() || report.passive() || report.overflow();
        self.stats.other_reports += u64::from(!named && !report.recovered());
        if report.bus_off() {
            return Err(PortError::Gone(format!("the CAN controller left the line: {report}")));
        }
        Ok(())
    }

    fn count(&mut self, known: bool) {
        self.stats.heard += u64::from(known);
        self.stats.foreign += u64::from(!known);
    }

    /// Hands everything that was heard up to now to `take`, which says whether it knew the frame.
    ///
    /// # Errors
    /// [`AskError::Port`].
    pub fn drain(&mut self, take: &mut dyn FnMut(&CanFrame) -> bool) -> Result<(), AskError> {
        let now = self.clock.now();
        while let Some(frame) = self.next(now)? {
            let known = take(&frame);
            self.count(known);
        }
        Ok(())
    }

    /// Hands what is heard to `take` until that has all it wants or it is `until`. `take` says
    /// whether it knew the frame, and whether it wants more.
    ///
    /// # Errors
    /// [`AskError::Port`].
    pub fn listen(
        &mut self,
        until: Instant,
        take: &mut dyn FnMut(&CanFrame) -> (bool, bool),
    ) -> Result<(), AskError> {
        while let Some(frame) = self.next(until)? {
            let (known, more) = take(&frame);
            self.count(known);
            if !more {
                break;
            }
        }
        Ok(())
    }

    /// Sends `frame` and waits for the frame that `answer` makes something of; asks again after a
    /// while without it. Other frames are handed to `other`, which says whether it knew them. With
    /// more retries than one, time in which this host was late is given back, and a question is not
    /// counted as unanswered that it was too late to hear the answer of.
    ///
    /// # Errors
    /// [`AskError::Miss`] with [`Miss::Silent`] if no answer came by `budget` or for all retries,
    /// or [`Miss::HostLate`] if that may be this host's fault; [`AskError::Port`].
    pub fn ask<T>(
        &mut self,
        frame: &CanFrame,
        mut answer: impl FnMut(&CanFrame) -> Option<T>,
        mut other: impl FnMut(&CanFrame) -> bool,
        budget: Instant,
    ) -> Result<T, AskError> {
        let is_patient = self.retries > 1;
        let patience = PATIENCE + self.timing.latency;
        let mut patient = Patience::new(budget);
        let mut retries_left = self.retries;
        loop {
            let (late_before, now) = (self.late, self.clock.now());
            self.send(frame, if is_patient { patient.end.max(now + patience) } else { budget })?;
            let until = self.clock.now() + patience;
            let until = if is_patient { until } else { until.min(budget) };
            let mut found = None;
            self.listen(until, &mut |heard| {
                found = answer(heard);
                (found.is_some() || other(heard), found.is_none())
            })?;
            if let Some(found) = found {
                return Ok(found);
            }
            let excused = is_patient && patient.excuses(self.late - late_before);
            if !excused {
                let has_time = self.clock.now() < patient.end || is_patient && patient.is_due();
                if retries_left == 0 || !has_time {
                    return Err(patient.verdict(Miss::Silent).into());
                }
                retries_left -= 1;
            }
            self.stats.retried += 1;
        }
    }

    /// Sends `frames` one after the other and hands everything that is heard until `window` is
    /// over after the last to `take`, which says whether it knew the frame. This is how devices are
    /// looked for: many are asked at once, and how many answer is not known.
    ///
    /// # Errors
    /// [`AskError::Port`].
    pub fn call(
        &mut self,
        frames: &[CanFrame],
        window: Duration,
        take: &mut dyn FnMut(&CanFrame) -> bool,
    ) -> Result<(), AskError> {
        for frame in frames {
            self.send(frame, self.clock.now() + window)?;
            self.drain(take)?;
        }
        self.listen(self.clock.now() + window, &mut |frame| (take(frame), true))
    }

    /// What the line reported of itself, in words for a person; none if nothing.
    #[must_use]
    pub fn troubles(&self) -> Option<String> {
        let stats = self.stats();
        let CanStats { no_ack, passive, overflow, other_reports, full_queue, .. } = stats;
        let counts = [
            (full_queue, "send queue full, and waited for"),
            (passive, "error passive"),
            (no_ack, "no acknowledgement"),
            (overflow, "frames lost in the controller"),
            (stats.garbled, "damaged lines of the adapter"),
            (other_reports, "other errors"),
        ];
        let said = counts.iter().filter(|(count, _)| *count > 0);
        let said: Vec<String> = said.map(|(count, words)| format!("{words} ({count})")).collect();
        let last = self.last_report.map(|last| format!("; last report: {last}"));
        (!said.is_empty()).then(|| said.join(", ") + &last.unwrap_or_default())
    }
}
