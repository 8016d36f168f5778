//! A CAN line whose port says what the test wrote down.

use super::*;
use crate::wire::can::{CanFrame, CanId, Format};
use std::collections::VecDeque;
use std::sync::atomic::{AtomicU64, Ordering};

/// Time passes by waiting only.
#[derive(Default)]
struct Ticker(AtomicU64);

impl Clock for Ticker {
    fn now(&self) -> Instant {
        Instant::from_nanos(self.0.load(Ordering::Relaxed))
    }

    fn sleep_until(&self, at: Instant) {
        self.0.fetch_max(at.as_nanos(), Ordering::Relaxed);
    }
}

/// Hears what is written down, each at its time, ms, after the frame that was sent as its number.
struct Written {
    clock: Arc<Ticker>,
    sent: usize,
    heard: VecDeque<(usize, u64, Heard)>,
}

impl FramePort for Written {
    fn full_queue_count(&self) -> u64 {
        0
    }

    fn send(&mut self, _frame: &CanFrame, _deadline: Instant) -> Result<(), PortError> {
        self.sent += 1;
        Ok(())
    }

    fn receive(&mut self, deadline: Instant) -> Result<Heard, PortError> {
        let due = |at_ms: u64| Instant::from_nanos(at_ms * 1_000_000);
        match self.heard.front() {
            Some(&(after, at_ms, heard)) if self.sent >= after && due(at_ms) <= deadline => {
                self.clock.sleep_until(due(at_ms));
                self.heard.pop_front();
                Ok(heard)
            }
            _ => {
                self.clock.sleep_until(deadline);
                Err(PortError::TimedOut)
            }
        }
    }
}

fn frame(id: u32, bytes: &[u8]) -> CanFrame {
    CanFrame::new(CanId::standard(id).expect("11 bits"), Format::Classic, bytes).expect("fits")
}

fn line(heard: &[(usize, u64, Heard)]) -> (CanBus, Arc<Ticker>) {
    let clock = Arc::new(Ticker::default());
    let port =
        Written { clock: Arc::clone(&clock), sent: 0, heard: heard.iter().copied().collect() };
    let timing =
        CanTiming { bitrate_bps: 1_000_000, data_bitrate_bps: 1_000_000, latency: Duration::ZERO };
    let shared: Arc<dyn Clock> = clock.clone();
    (CanBus::new(Box::new(port), shared, timing), clock)
}

/// The byte of an answer under 0x11.
fn answer(frame: &CanFrame) -> Option<u8> {
    (frame.id() == CanId::standard(0x11)?).then(|| frame.payload().first().copied())?
}

fn soon(clock: &Ticker) -> Instant {
    clock.now() + Duration::from_millis(100)
}

#[test]
fn an_answer_is_found_among_frames_of_others() {
    let heard = [
        (1, 1, Heard::Frame(frame(0x700, &[1]))),
        (1, 1, Heard::Frame(frame(0x11, &[]))),
        (1, 2, Heard::Frame(frame(0x11, &[7]))),
    ];
    let (mut bus, clock) = line(&heard);
    let known = |frame: &CanFrame| frame.id() == CanId::standard(0x700).expect("fits");
    let got = bus.ask(&frame(1, &[]), answer, known, soon(&clock));
    assert_eq!(got, Ok(7));
    // The one of another device that is known, the answer, and one that was cut short.
    let CanStats { heard, foreign, sent, retried, .. } = bus.stats();
    assert_eq!((heard, foreign, sent, retried), (2, 1, 1, 0));
}

#[test]
fn a_lost_answer_is_asked_for_again() {
    let (mut bus, clock) = line(&[(2, 12, Heard::Frame(frame(0x11, &[7])))]);
    let got = bus.ask(&frame(1, &[]), answer, |_| false, soon(&clock));
    assert_eq!((got, bus.stats().retried), (Ok(7), 1));
    let (mut bus, clock) = line(&[]);
    let got = bus.ask(&frame(1, &[]), answer, |_| false, soon(&clock));
    assert_eq!(got, Err(AskError::Miss(Miss::Silent)));
    assert_eq!(bus.stats().sent, 2);
    assert!(clock.now() <= Instant::from_nanos(20_000_000), "ten ms for each try");
}

#[test]
fn bus_off_is_the_end_of_the_line_and_other_reports_are_counted() {
    // Classes of `linux/can/error.h`: 0x04 controller (0x30 passive), 0x20 no acknowledgement,
    // 0x40 bus off.
    let passive = ErrorFrame::decode(0x04, &[0, 0x30, 0, 0, 0, 0, 0, 0]);
    let no_ack = ErrorFrame::decode(0x20, &[0; 8]);
    let heard = [
        (0, 1, Heard::Report(passive)),
        (0, 1, Heard::Report(no_ack)),
        (0, 2, Heard::Frame(frame(0x11, &[7]))),
        (0, 3, Heard::Report(ErrorFrame::decode(0x40, &[0; 8]))),
    ];
    let (mut bus, clock) = line(&heard);
    let mut frames = 0;
    let ended = bus.call(&[], Duration::from_millis(10), &mut |_| {
        frames += 1;
        true
    });
    assert!(
        matches!(&ended, Err(AskError::Port(PortError::Gone(text))) if text.contains("bus off"))
    );
    assert_eq!((frames, clock.now()), (1, Instant::from_nanos(3_000_000)));
    let words = bus.troubles().expect("trouble");
    assert!(words.contains("error passive (1), no acknowledgement (1)"), "{words}");
}

#[test]
fn what_is_sent_and_heard_occupies_the_line_for_the_longest_it_may() {
    let (mut bus, clock) = line(&[(1, 1, Heard::Frame(frame(0x11, &[7; 8])))]);
    assert_eq!(bus.ask(&frame(1, &[0; 8]), answer, |_| false, soon(&clock)), Ok(7));
    // Davis et al. 2007: 135 bits each.
    assert!((bus.stats().busy_s - 270e-6).abs() < 1e-12, "{}", bus.stats().busy_s);
}

/// A host that sleeps through the first answers of a device.
struct Sleepy {
    clock: Arc<Ticker>,
    question: CanFrame,
    answer: CanFrame,
    asked: usize,
    answers: usize,
}

impl FramePort for Sleepy {
    fn full_queue_count(&self) -> u64 {
        0
    }

    fn send(&mut self, frame: &CanFrame, _deadline: Instant) -> Result<(), PortError> {
        self.asked += usize::from(*frame == self.question);
        Ok(())
    }

    fn receive(&mut self, deadline: Instant) -> Result<Heard, PortError> {
        // Oftener than everybody is asked anyway.
        if self.asked > 2 && self.answers == 0 {
            self.answers += 1;
            return Ok(Heard::Frame(self.answer));
        }
        let stall_ms = if self.answers == 0 { 60 } else { 0 };
        self.clock.sleep_until(deadline + Duration::from_millis(stall_ms));
        Err(PortError::TimedOut)
    }
}

#[test]
fn a_host_that_sleeps_through_answers_asks_again() {
    let clock = Arc::new(Ticker::default());
    let port = Sleepy {
        clock: Arc::clone(&clock),
        question: scan::Call::Damiao.questions()[0],
        answer: frame(0x11, &[1, 0, 0x33, 8, 1, 0, 0, 0]),
        asked: 0,
        answers: 0,
    };
    let timing =
        CanTiming { bitrate_bps: 1_000_000, data_bitrate_bps: 1_000_000, latency: Duration::ZERO };
    let mut bus = CanBus::new(Box::new(port), clock, timing);
    let found = scan::scan(&mut bus, scan::Call::Damiao, &mut |_| ()).unwrap();
    assert_eq!(found.iter().map(|one| one.peer.id()).collect::<Vec<_>>(), [1]);
}

/// A line whose one device answers its question after `delay`.
struct Delayed {
    clock: Arc<Ticker>,
    question: CanFrame,
    answer: CanFrame,
    delay: Duration,
    due: Vec<Instant>,
}

impl FramePort for Delayed {
    fn full_queue_count(&self) -> u64 {
        0
    }

    fn send(&mut self, frame: &CanFrame, _deadline: Instant) -> Result<(), PortError> {
        if *frame == self.question {
            self.due.push(self.clock.now() + self.delay);
        }
        Ok(())
    }

    fn receive(&mut self, deadline: Instant) -> Result<Heard, PortError> {
        let Some(due) = self.due.first().copied().filter(|due| *due <= deadline) else {
            self.clock.sleep_until(deadline);
            return Err(PortError::TimedOut);
        };
        self.due.remove(0);
        self.clock.sleep_until(due.max(self.clock.now()));
        Ok(Heard::Frame(self.answer))
    }
}

#[test]
fn a_device_that_answers_when_all_have_been_asked_is_found() {
    let clock = Arc::new(Ticker::default());
    let port = Delayed {
        clock: Arc::clone(&clock),
        question: scan::Call::Damiao.questions()[254],
        answer: frame(0x11, &[255, 0, 0x33, 8, 255, 0, 0, 0]),
        delay: Duration::from_millis(90),
        due: Vec::new(),
    };
    let timing =
        CanTiming { bitrate_bps: 1_000_000, data_bitrate_bps: 1_000_000, latency: Duration::ZERO };
    let mut bus = CanBus::new(Box::new(port), clock, timing);
    let found = scan::scan(&mut bus, scan::Call::Damiao, &mut |_| ()).unwrap();
    assert_eq!(found.iter().map(|one| one.peer.id()).collect::<Vec<_>>(), [255]);
}
