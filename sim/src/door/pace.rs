//! How the time of a world with open doors passes.

use super::patience::PatientTime;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

/// A door that waits patiently looks again after this time at the earliest, so that it does not spin
/// while time stands for somebody else.
const LOOK_NS: u64 = 100_000;

/// A door looks again after this time at the latest while time is frozen.
const FROZEN_LOOK_NS: u64 = 250_000_000;

/// World time that goes with real time, or with a time that waits for host and doors.
#[derive(Clone)]
pub(crate) struct Pace {
    /// World time when it began.
    began_ns: u64,
    time: Time,
}

#[derive(Clone)]
enum Time {
    Real(Arc<Mutex<Clock>>),
    /// And its moment when this began.
    Patient(Arc<PatientTime>, u64),
}

/// Real time, which may be stopped.
struct Clock {
    world_ns: u64,
    /// When it was that; none while it is frozen.
    since: Option<Instant>,
}

impl Clock {
    fn now_ns(&self) -> u64 {
        self.world_ns + self.since.map_or(0, |since| since.elapsed().as_nanos() as u64)
    }
}

impl Pace {
    pub fn real(world_ns: u64) -> Pace {
        let clock = Clock { world_ns, since: Some(Instant::now()) };
        Pace { began_ns: world_ns, time: Time::Real(Arc::new(Mutex::new(clock))) }
    }

    pub fn patient(world_ns: u64, time: Arc<PatientTime>) -> Pace {
        let now_ns = time.now_ns();
        Pace { began_ns: world_ns, time: Time::Patient(time, now_ns) }
    }

    /// Does something with the clock; none if time waits for a host.
    fn clock<T>(&self, act: impl FnOnce(&mut Clock) -> T) -> Option<T> {
        match &self.time {
            Time::Real(clock) => {
                Some(act(&mut clock.lock().unwrap_or_else(PoisonError::into_inner)))
            }
            Time::Patient(..) => None,
        }
    }

    /// Time stands still from now on. False if it waits for a host.
    pub fn freeze(&self) -> bool {
        let stop = |clock: &mut Clock| (clock.world_ns, clock.since) = (clock.now_ns(), None);
        self.clock(stop).is_some()
    }

    /// Time goes on.
    pub fn run(&self) {
        self.clock(|clock| clock.since = clock.since.or_else(|| Some(Instant::now())));
    }

    /// It is this world time now. False if time waits for a host.
    pub fn set(&self, world_ns: u64) -> bool {
        let set = |clock: &mut Clock| {
            clock.world_ns = world_ns;
            clock.since = clock.since.map(|_| Instant::now());
        };
        self.clock(set).is_some()
    }

    pub fn is_frozen(&self) -> bool {
        self.clock(|clock| clock.since.is_none()).unwrap_or(false)
    }

    /// World time when it began.
    pub const fn began_ns(&self) -> u64 {
        self.began_ns
    }

    /// World time now.
    pub fn now_ns(&self) -> u64 {
        match &self.time {
            Time::Real(_) => self.clock(|clock| clock.now_ns()).unwrap_or(self.began_ns),
            Time::Patient(time, began_ns) => self.began_ns + time.now_ns() - began_ns,
        }
    }

    /// The door of `line` sleeps until this world time, or until bytes come if it is `hungry`. How
    /// long that is.
    pub fn door_sleeps(&self, line: usize, until_ns: u64, hungry: bool) -> u64 {
        let Time::Patient(time, began_ns) = &self.time else {
            if self.is_frozen() {
                return FROZEN_LOOK_NS;
            }
            return until_ns.saturating_sub(self.now_ns());
        };
        let until_ns = until_ns.saturating_sub(self.began_ns).saturating_add(*began_ns);
        match until_ns.saturating_sub(time.door_sleeps(line, until_ns, hungry)) {
            0 => 0,
            left_ns => left_ns.max(LOOK_NS),
        }
    }

    /// The door of `line` has read so many bytes.
    pub fn door_has_read(&self, line: usize, count: usize) {
        if let Time::Patient(time, _) = &self.time {
            time.door_has_read(line, count);
        }
    }

    /// The door of `line` has written so many bytes that somebody can read.
    pub fn door_has_written(&self, line: usize, count: usize) {
        if let Time::Patient(time, _) = &self.time {
            time.door_has_written(line, count);
        }
    }

    /// What was on its way through the door of `line` is lost.
    pub fn door_closes(&self, line: usize) {
        if let Time::Patient(time, _) = &self.time {
            time.door_closes(line);
        }
    }
}
