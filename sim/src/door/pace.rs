//! How the time of a world with open doors passes.

use super::patience::PatientTime;
use std::sync::Arc;
use std::time::Instant;

/// A door that waits patiently looks again after this time at the earliest, so that it does not spin
/// while time stands for somebody else.
const LOOK_NS: u64 = 100_000;

/// World time that goes with real time, or with a time that waits for host and doors.
#[derive(Clone)]
pub(crate) struct Pace {
    /// World time when it began.
    began_ns: u64,
    time: Time,
}

#[derive(Clone)]
enum Time {
    Real(Instant),
    /// And its moment when this began.
    Patient(Arc<PatientTime>, u64),
}

impl Pace {
    pub fn real(world_ns: u64) -> Pace {
        Pace { began_ns: world_ns, time: Time::Real(Instant::now()) }
    }

    pub fn patient(world_ns: u64, time: Arc<PatientTime>) -> Pace {
        let now_ns = time.now_ns();
        Pace { began_ns: world_ns, time: Time::Patient(time, now_ns) }
    }

    /// World time when it began.
    pub const fn began_ns(&self) -> u64 {
        self.began_ns
    }

    /// World time now.
    pub fn now_ns(&self) -> u64 {
        let passed_ns = match &self.time {
            Time::Real(began) => began.elapsed().as_nanos() as u64,
            Time::Patient(time, began_ns) => time.now_ns() - began_ns,
        };
        self.began_ns + passed_ns
    }

    /// The door of `line` sleeps until this world time, or until bytes come if it is `hungry`. How
    /// long that is.
    pub fn door_sleeps(&self, line: usize, until_ns: u64, hungry: bool) -> u64 {
        let Time::Patient(time, began_ns) = &self.time else {
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
