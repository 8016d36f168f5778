//! How long a question waits where nothing moves, and whose fault it is if it is not answered: a host
//! that was not running cannot have heard an answer.

use super::Miss;
use crate::time::{Duration, Instant};

/// A wait that ends so much after it should have: this process was not running.
pub(super) const HOST_LATE: Duration = Duration::from_millis(2);

/// So many questions are asked while this host is on time before a device is called silent, however
/// late it was before.
const LEAST_TRIES: u32 = 3;

/// Questions that are not counted because this host was late, at most, and how late they were.
const MOST_EXCUSED: (u32, Duration) = (20, Duration::from_secs(2));

/// What became of the tries of one question.
#[derive(Clone, Copy, Debug)]
pub(super) struct Patience {
    /// When the question is given up: its budget, and the time in which this host was late.
    pub end: Instant,
    unanswered: u32,
    excused: u32,
    late: Duration,
}

impl Patience {
    /// A question that has not been asked yet.
    pub const fn new(budget: Instant) -> Self {
        Self { end: budget, unanswered: 0, excused: 0, late: Duration::ZERO }
    }

    /// Takes down a try without an answer in which this host was `late`; true if that excuses the
    /// device.
    pub fn excuses(&mut self, late: Duration) -> bool {
        let excuses = late > Duration::ZERO && self.may_excuse();
        self.late += late;
        self.end = self.end + late;
        self.excused += u32::from(excuses);
        self.unanswered += u32::from(!excuses);
        excuses
    }

    fn may_excuse(&self) -> bool {
        self.excused < MOST_EXCUSED.0 && self.late < MOST_EXCUSED.1
    }

    /// True if the device was not asked often enough to be called silent.
    pub const fn is_due(&self) -> bool {
        self.unanswered < LEAST_TRIES
    }

    /// Why there is no answer, if the last try had `miss`.
    pub fn verdict(&self, miss: Miss) -> Miss {
        if self.may_excuse() {
            return miss;
        }
        Miss::HostLate { by_ms: u64::try_from(self.late.as_millis()).unwrap_or(u64::MAX) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: Duration = Duration::from_millis(1);

    #[test]
    fn a_late_host_excuses_a_device_until_it_has_been_late_for_too_long() {
        let mut patience = Patience::new(Instant::ZERO);
        assert!(!patience.excuses(Duration::ZERO), "the host was on time");
        assert!(patience.is_due());
        for n in 1..=20 {
            assert!(patience.excuses(50 * MS), "{n}");
        }
        assert_eq!(patience.end, Instant::ZERO + 1000 * MS, "its time is given back");
        assert!(!patience.excuses(50 * MS), "not for ever");
        assert_eq!(patience.verdict(Miss::Silent), Miss::HostLate { by_ms: 1050 });

        let mut stalled = Patience::new(Instant::ZERO);
        assert!(stalled.excuses(1990 * MS) && stalled.excuses(20 * MS));
        assert!(!stalled.excuses(20 * MS), "more than two seconds in all");
    }

    #[test]
    fn a_device_that_was_asked_in_time_three_times_is_silent() {
        let mut patience = Patience::new(Instant::ZERO);
        patience.excuses(500 * MS);
        for _ in 0..3 {
            assert!(patience.is_due());
            assert!(!patience.excuses(Duration::ZERO));
        }
        assert!(!patience.is_due());
        assert_eq!(patience.verdict(Miss::Garbled), Miss::Garbled);
    }
}
