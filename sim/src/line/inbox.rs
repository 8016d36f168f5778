//! What is on its way from a line to the host, and what waits there to be read.

use super::Span;
use crate::adapter::Usb;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use std::collections::VecDeque;

/// What waits for a host that never reads; more is lost, as in an overrun.
const WAITING_BYTES_MAX: usize = 1 << 16;

/// A position that a status tells the host.
#[derive(Clone, Copy, Debug)]
pub(super) struct Told {
    pub joint: usize,
    pub measured_ns: u64,
}

/// Bytes on their way to the host.
#[derive(Clone, Debug)]
pub(super) struct Reception {
    pub span: Span,
    /// When the last byte is in the adapter's hands.
    pub ready_ns: u64,
    pub bytes: Vec<u8>,
    pub baud_bps: u32,
    pub from_servo: bool,
    /// The position in it, if it is undamaged.
    pub told: Option<Told>,
}

impl Reception {
    /// When byte `k` is in the adapter's hands.
    fn byte_ns(&self, k: usize) -> u64 {
        let span_ns = u128::from(self.span.end_ns - self.span.start_ns);
        let count = self.bytes.len().max(1) as u128;
        let before_end = span_ns * (count - 1).saturating_sub(k as u128) / count;
        self.ready_ns.saturating_sub(before_end as u64)
    }
}

#[derive(Clone, Debug)]
pub(super) struct Inbox {
    /// In order of `ready_ns`.
    pub coming: VecDeque<Reception>,
    /// Bytes of the first of them that the host has already.
    taken: usize,
    ready: VecDeque<u8>,
    /// Bytes that were ready and are not there any more.
    gone: u64,
    /// What the host is told by the ready bytes up to each of these, counted from the first ever.
    telling: VecDeque<(u64, Told)>,
    /// Without one the bytes of a status become readable together, when the last is there.
    pub usb: Option<Usb>,
    /// When the adapter's timer started.
    timer_from_ns: u64,
}

impl Inbox {
    pub fn new(usb: Option<Usb>) -> Inbox {
        Inbox {
            coming: VecDeque::new(),
            taken: 0,
            ready: VecDeque::new(),
            gone: 0,
            telling: VecDeque::new(),
            usb,
            timer_from_ns: 0,
        }
    }

    pub fn receive(&mut self, reception: Reception) {
        let after = |other: &&Reception| other.ready_ns > reception.ready_ns;
        // The first may be half read: nothing goes before it.
        let movable = self.coming.len() - usize::from(self.taken > 0);
        let later = self.coming.iter().rev().take(movable).take_while(after).count();
        self.coming.insert(self.coming.len() - later, reception);
    }

    /// When bytes become readable next.
    pub fn next_ready_ns(&self) -> Option<u64> {
        self.next_packet().map(|(at_ns, _)| at_ns)
    }

    /// When and how many bytes become readable next.
    fn next_packet(&self) -> Option<(u64, usize)> {
        let front = self.coming.front()?;
        let Some(usb) = self.usb else {
            return Some((front.ready_ns, front.bytes.len() - self.taken));
        };
        let first = (self.taken..front.bytes.len()).map(|k| front.byte_ns(k));
        let others = self.coming.iter().skip(1);
        let others = others.flat_map(|r| (0..r.bytes.len()).map(|k| r.byte_ns(k)));
        let mut times = first.chain(others);
        let mut at_ns = times.next().unwrap_or(front.ready_ns);
        let waited_ns = at_ns.saturating_sub(self.timer_from_ns);
        let timer_ns = usb.timer_ns.max(1);
        let expiry_ns = self.timer_from_ns + waited_ns.div_ceil(timer_ns) * timer_ns;
        let mut count = 1;
        while count < usb.packet_bytes {
            let Some(next_ns) = times.next().filter(|&next_ns| next_ns <= expiry_ns) else {
                return Some((expiry_ns, count));
            };
            at_ns = at_ns.max(next_ns);
            count += 1;
        }
        Some((at_ns, count))
    }

    /// Moves what has come by `now_ns` to where the host reads it; returns how much waits there.
    /// What was sent at another speed than the host's is unreadable.
    pub fn collect(&mut self, now_ns: u64, host_baud_bps: u32, rng: &mut ChaCha8Rng) -> usize {
        while let Some((at_ns, count)) = self.next_packet().filter(|&(at_ns, _)| at_ns <= now_ns) {
            self.timer_from_ns = at_ns;
            self.deliver(count, host_baud_bps, rng);
        }
        let excess = self.ready.len().saturating_sub(WAITING_BYTES_MAX);
        self.lose(excess);
        self.ready.len()
    }

    fn deliver(&mut self, mut count: usize, host_baud_bps: u32, rng: &mut ChaCha8Rng) {
        while let Some(front) = self.coming.front() {
            let garbled = front.baud_bps != host_baud_bps;
            let now = count.min(front.bytes.len() - self.taken);
            for &byte in &front.bytes[self.taken..self.taken + now] {
                self.ready.push_back(if garbled { rng.random() } else { byte });
            }
            count -= now;
            self.taken += now;
            if self.taken < front.bytes.len() {
                return;
            }
            if let Some(told) = front.told.filter(|_| !garbled) {
                self.telling.push_back((self.gone + self.ready.len() as u64, told));
            }
            self.taken = 0;
            self.coming.pop_front();
            if count == 0 {
                return;
            }
        }
    }

    /// The host asks something else: what it has not taken by now is late, and tells it nothing that
    /// it could rely on.
    pub fn asked_again(&mut self) {
        self.coming.iter_mut().for_each(|late| late.told = None);
        self.telling.clear();
    }

    /// Takes readable bytes; `had` hears of each position that is whole with them.
    pub fn take(&mut self, buf: &mut [u8], mut had: impl FnMut(Told)) -> usize {
        let count = buf.len().min(self.ready.len());
        for (slot, byte) in buf.iter_mut().zip(self.ready.drain(..count)) {
            *slot = byte;
        }
        self.gone += count as u64;
        while self.telling.front().is_some_and(|&(end, _)| end <= self.gone) {
            self.telling.pop_front().into_iter().for_each(|(_, told)| had(told));
        }
        count
    }

    /// The oldest readable bytes are lost.
    fn lose(&mut self, count: usize) {
        self.ready.drain(..count);
        self.gone += count as u64;
        self.telling.retain(|&(end, _)| end > self.gone);
    }

    pub fn discard_ready(&mut self) {
        self.lose(self.ready.len());
    }

    /// Loses everything: the adapter was pulled out.
    pub fn clear(&mut self) {
        self.coming.clear();
        self.lose(self.ready.len());
        self.taken = 0;
    }
}
