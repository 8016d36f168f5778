//! Real time that waits: for a host and the doors of its virtual robot in one process, on a machine
//! that may let either of them stand for a tenth of a second.
//!
//! The host and each door say until when they sleep. Time goes on as real time does, but not further
//! than [`SLACK_NS`] past the moment at which one of them should have gone on and has not; nor past
//! bytes that one has written and the other, which is listening, has not been given yet: the kernel
//! has them carried by a worker that waits for its turn like any other. What real time is ahead by
//! then is never made up for.
//!
//! So neither ever sees the other be late, however busy the machine is, and everything else (line
//! timing, watchdogs, faults at their moments) is as behind any door. Nobody is waited for longer
//! than [`LONGEST_WAIT_NS`] at a time: whoever waits for a person is not late.

use rustix::time::{ClockId, clock_gettime};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// About as late as an idle machine wakes somebody. In a cycle of twenty servos there are some thirty
/// wake-ups, which add up on a busy machine: to a millisecond and a half of the eight there are.
const SLACK_NS: u64 = 50_000;

/// Real time for which somebody is waited for.
const LONGEST_WAIT_NS: u64 = 5_000_000_000;

/// A clock shared by a host and the doors of one world.
pub struct PatientTime {
    began_ns: u64,
    parties: Mutex<Parties>,
}

impl Default for PatientTime {
    fn default() -> Self {
        Self { began_ns: real_ns(), parties: Mutex::default() }
    }
}

/// It goes on while the machine is suspended; that is waited for like any other stall.
fn real_ns() -> u64 {
    let t = clock_gettime(ClockId::Boottime);
    u64::try_from(t.tv_sec).unwrap_or(0) * 1_000_000_000 + u64::try_from(t.tv_nsec).unwrap_or(0)
}

impl PatientTime {
    /// Nanoseconds since it began.
    #[must_use]
    pub fn now_ns(&self) -> u64 {
        let (mut parties, real_ns) = self.parties();
        parties.now_ns(real_ns)
    }

    /// By how much real time is ahead, nanoseconds.
    #[must_use]
    pub fn waited_ns(&self) -> u64 {
        let (mut parties, real_ns) = self.parties();
        parties.now_ns(real_ns);
        parties.waited_ns
    }

    /// The host goes on now. The present moment.
    pub fn host_is_here(&self) -> u64 {
        let (mut parties, real_ns) = self.parties();
        let now_ns = parties.now_ns(real_ns);
        parties.host.sleeps_until(now_ns);
        parties.host_hears = None;
        now_ns
    }

    /// The host sleeps until then. The present moment.
    pub fn host_sleeps(&self, until_ns: u64) -> u64 {
        let (mut parties, real_ns) = self.parties();
        let now_ns = parties.now_ns(real_ns);
        parties.host.sleeps_until(until_ns);
        parties.host_hears = None;
        now_ns
    }

    /// The host listens to this line, until then. The present moment, and whether bytes are on
    /// their way to it.
    pub fn host_listens(&self, line: usize, until_ns: u64) -> (u64, bool) {
        let (mut parties, real_ns) = self.parties();
        let now_ns = parties.now_ns(real_ns);
        parties.host.sleeps_until(until_ns);
        parties.host_hears = Some(line);
        (now_ns, parties.lines.get(line).is_some_and(|line| line.to_host.owed > 0))
    }

    /// The host has opened this line: what was on its way is lost.
    pub fn host_opens(&self, line: usize) {
        let (mut parties, _) = self.parties();
        let line = parties.line(line);
        (line.to_host, line.to_door) = Default::default();
    }

    /// The host has read so many bytes of this line, and goes on.
    pub fn host_has_read(&self, line: usize, count: usize) {
        let (mut parties, real_ns) = self.parties();
        let now_ns = parties.now_ns(real_ns);
        parties.host.sleeps_until(now_ns);
        parties.host_hears = None;
        parties.line(line).to_host.taken(count, now_ns);
    }

    /// The host has written so many bytes to this line.
    pub fn host_has_written(&self, line: usize, count: usize) {
        let (mut parties, real_ns) = self.parties();
        let now_ns = parties.now_ns(real_ns);
        parties.line(line).to_door.sent(count, now_ns);
    }

    /// A door sleeps until then, or until bytes come if it is `hungry` for them. The present moment.
    pub(super) fn door_sleeps(&self, line: usize, until_ns: u64, hungry: bool) -> u64 {
        let (mut parties, real_ns) = self.parties();
        let now_ns = parties.now_ns(real_ns);
        let door = parties.line(line);
        door.door.get_or_insert_default().sleeps_until(until_ns);
        door.hungry = hungry;
        now_ns
    }

    /// A door has read so many bytes, and goes on.
    pub(super) fn door_has_read(&self, line: usize, count: usize) {
        let (mut parties, real_ns) = self.parties();
        let now_ns = parties.now_ns(real_ns);
        let line = parties.line(line);
        line.door.get_or_insert_default().sleeps_until(now_ns);
        line.to_door.taken(count, now_ns);
    }

    /// A door has written so many bytes that somebody can read.
    pub(super) fn door_has_written(&self, line: usize, count: usize) {
        let (mut parties, real_ns) = self.parties();
        let now_ns = parties.now_ns(real_ns);
        parties.line(line).to_host.sent(count, now_ns);
    }

    /// A door is closed, or was hung up: nothing is on its way any more.
    pub(super) fn door_closes(&self, line: usize) {
        let (mut parties, _) = self.parties();
        *parties.line(line) = Line::default();
    }

    fn parties(&self) -> (MutexGuard<'_, Parties>, u64) {
        // Figures are whole between two statements, whoever panicked.
        let parties = self.parties.lock().unwrap_or_else(PoisonError::into_inner);
        // After the lock: real time never goes back from one holder to the next.
        (parties, real_ns().saturating_sub(self.began_ns))
    }
}

#[derive(Debug, Default)]
struct Parties {
    /// What it was when last asked.
    now_ns: u64,
    /// By how much real time is ahead.
    waited_ns: u64,
    host: Party,
    /// The line it listens to.
    host_hears: Option<usize>,
    lines: Vec<Line>,
}

/// Somebody who is waited for.
#[derive(Debug, Default)]
struct Party {
    until_ns: u64,
    held: Held,
}

/// Since when, in real time, everybody waits for this.
#[derive(Debug, Default)]
struct Held(Option<u64>);

/// One line and its door, if it has one.
#[derive(Debug, Default)]
struct Line {
    door: Option<Party>,
    /// It reads what comes.
    hungry: bool,
    to_door: Mail,
    to_host: Mail,
}

/// Bytes on their way.
#[derive(Debug, Default)]
struct Mail {
    /// Below zero for an instant, if they are read before their writer has said so.
    owed: i64,
    since_ns: u64,
    held: Held,
}

impl Held {
    /// True once everybody has waited long enough.
    fn too_long(&mut self, real_ns: u64) -> bool {
        let since_ns = *self.0.get_or_insert(real_ns);
        real_ns.saturating_sub(since_ns) > LONGEST_WAIT_NS
    }
}

impl Party {
    fn sleeps_until(&mut self, until_ns: u64) {
        *self = Self { until_ns, held: Held(None) };
    }

    /// Until when time may pass, if it would like to pass until `free_ns`.
    fn bound_ns(&mut self, free_ns: u64, real_ns: u64) -> u64 {
        let bound_ns = self.until_ns.saturating_add(SLACK_NS);
        if bound_ns < free_ns && self.held.too_long(real_ns) { u64::MAX } else { bound_ns }
    }
}

impl Mail {
    fn sent(&mut self, count: usize, now_ns: u64) {
        if self.owed <= 0 {
            self.since_ns = now_ns;
            self.held = Held(None);
        }
        self.owed += i64::try_from(count).unwrap_or(i64::MAX);
    }

    fn taken(&mut self, count: usize, now_ns: u64) {
        self.owed -= i64::try_from(count).unwrap_or(i64::MAX);
        self.since_ns = now_ns;
        self.held = Held(None);
    }

    /// As [`Party::bound_ns`].
    fn bound_ns(&mut self, free_ns: u64, real_ns: u64) -> u64 {
        if self.owed <= 0 {
            return u64::MAX;
        }
        let bound_ns = self.since_ns.saturating_add(SLACK_NS);
        if bound_ns < free_ns && self.held.too_long(real_ns) {
            // They were lost: nobody reads what was there when a terminal was flushed.
            *self = Self::default();
            return u64::MAX;
        }
        bound_ns
    }
}

impl Parties {
    fn line(&mut self, line: usize) -> &mut Line {
        if self.lines.len() <= line {
            self.lines.resize_with(line + 1, Line::default);
        }
        &mut self.lines[line]
    }

    fn now_ns(&mut self, real_ns: u64) -> u64 {
        let free_ns = real_ns.saturating_sub(self.waited_ns);
        let mut bound_ns = self.host.bound_ns(free_ns, real_ns);
        for (number, line) in self.lines.iter_mut().enumerate() {
            if let Some(door) = &mut line.door {
                bound_ns = bound_ns.min(door.bound_ns(free_ns, real_ns));
                if line.hungry {
                    bound_ns = bound_ns.min(line.to_door.bound_ns(free_ns, real_ns));
                }
                if self.host_hears == Some(number) {
                    bound_ns = bound_ns.min(line.to_host.bound_ns(free_ns, real_ns));
                }
            }
        }
        self.now_ns = self.now_ns.max(free_ns.min(bound_ns));
        self.waited_ns = real_ns.saturating_sub(self.now_ns);
        self.now_ns
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    /// A host that is here at 0, and a door that sleeps until `door_ms`, hungry.
    fn both(door_ms: u64) -> Parties {
        let mut both = Parties::default();
        both.host.sleeps_until(0);
        both.line(0).door.get_or_insert_default().sleeps_until(door_ms * MS);
        both.line(0).hungry = true;
        both
    }

    #[test]
    fn time_is_real_time_while_everybody_is_punctual() {
        let mut both = both(1_000);
        for ms in 0..100 {
            assert_eq!(both.now_ns(ms * MS), ms * MS);
            both.host.sleeps_until((ms + 1) * MS);
        }
        assert_eq!(both.waited_ns, 0);
    }

    #[test]
    fn a_host_that_stands_is_waited_for_and_the_time_is_not_made_up_for() {
        let mut both = both(1_000);
        both.host.sleeps_until(10 * MS);
        assert_eq!(both.now_ns(300 * MS), 10 * MS + SLACK_NS);
        assert_eq!(both.waited_ns, 290 * MS - SLACK_NS);
        both.host.sleeps_until(20 * MS);
        assert_eq!(both.now_ns(304 * MS), 14 * MS + SLACK_NS);
    }

    #[test]
    fn a_door_that_stands_is_waited_for_too() {
        let mut both = both(5);
        both.host.sleeps_until(900 * MS);
        assert_eq!(both.now_ns(100 * MS), 5 * MS + SLACK_NS);
        both.line(0).door.get_or_insert_default().sleeps_until(1_000 * MS);
        assert_eq!(both.now_ns(110 * MS), 5 * MS + SLACK_NS + 10 * MS);
    }

    #[test]
    fn bytes_that_a_listening_host_was_not_given_hold_time() {
        let mut both = both(1_000);
        both.host.sleeps_until(500 * MS);
        assert_eq!(both.now_ns(10 * MS), 10 * MS);
        both.line(0).to_host.sent(14, 10 * MS);
        assert_eq!(both.now_ns(20 * MS), 20 * MS, "nobody listens");
        both.host_hears = Some(1);
        assert_eq!(both.now_ns(30 * MS), 30 * MS, "another line");
        both.host_hears = Some(0);
        assert_eq!(both.now_ns(99 * MS), 30 * MS, "time does not go back, and stands");
        both.line(0).to_host.taken(10, 30 * MS);
        assert_eq!(both.now_ns(199 * MS), 30 * MS + SLACK_NS, "four are left");
        both.line(0).to_host.taken(4, 31 * MS);
        assert_eq!(both.now_ns(201 * MS), 32 * MS + SLACK_NS);
    }

    #[test]
    fn bytes_on_their_way_to_a_hungry_door_hold_time() {
        for (hungry, expected_ns) in [(true, 10 * MS + SLACK_NS), (false, 50 * MS)] {
            let mut both = both(1_000);
            both.line(0).hungry = hungry;
            both.host.sleeps_until(500 * MS);
            assert_eq!(both.now_ns(10 * MS), 10 * MS);
            both.line(0).to_door.sent(14, 10 * MS);
            assert_eq!(both.now_ns(50 * MS), expected_ns, "{hungry}");
        }
    }

    #[test]
    fn bytes_that_are_read_before_their_writer_says_so_are_not_waited_for() {
        let mut both = both(1_000);
        both.host.sleeps_until(500 * MS);
        both.line(0).to_door.taken(14, 0);
        both.line(0).to_door.sent(14, 0);
        assert_eq!(both.now_ns(50 * MS), 50 * MS);
    }

    #[test]
    fn nobody_is_waited_for_for_ever() {
        let mut both = both(1_000_000);
        assert_eq!(both.now_ns(100 * MS), SLACK_NS, "the wait begins");
        assert_eq!(both.now_ns(100 * MS + LONGEST_WAIT_NS), SLACK_NS);
        let later_ns = 101 * MS + LONGEST_WAIT_NS;
        assert_eq!(both.now_ns(later_ns), SLACK_NS + MS, "it goes on from where it stood");
        assert_eq!(both.now_ns(later_ns + 500 * MS), SLACK_NS + 501 * MS);
        both.host.sleeps_until(600 * MS);
        assert_eq!(both.now_ns(later_ns + 900 * MS), 600 * MS + SLACK_NS, "it is back");
    }

    #[test]
    fn bytes_that_were_lost_are_not_waited_for_for_ever_and_then_forgotten() {
        let mut both = both(1_000_000);
        both.host_hears = Some(0);
        both.line(0).to_host.sent(1, 0);
        for ms in 0..LONGEST_WAIT_NS / MS {
            both.host.sleeps_until(1_000_000 * MS);
            assert!(both.now_ns(ms * MS) <= SLACK_NS);
        }
        let later_ns = LONGEST_WAIT_NS + 10 * MS;
        both.now_ns(later_ns);
        assert_eq!(both.now_ns(later_ns + 100 * MS) / MS, 111);
        assert_eq!(both.line(0).to_host.owed, 0);
    }
}
