//! Plays an action and stops it two seconds into its motion; any condition will do that is quick to look
//! at. The robot is led to rest along its path, and holds there.

use gaitway::{Event, Observer, Options, Outcome, Progress};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};

/// Wants it to end once the motion has gone on for two seconds; before it comes the approach.
#[derive(Default)]
struct Enough {
    end_ms: AtomicU64,
    reached: AtomicBool,
}

impl Observer for Enough {
    fn hear(&self, event: Event<'_>) {
        if let Event::Planned { approach_s, .. } = event {
            self.end_ms.store((approach_s * 1e3) as u64 + 2000, Relaxed);
        }
    }

    fn watch(&self, progress: &Progress<'_>) {
        while !progress.is_over() {
            let is_enough = progress.time_s() * 1e3 >= self.end_ms.load(Relaxed) as f64;
            self.reached.fetch_or(is_enough, Relaxed);
            std::thread::sleep(std::time::Duration::from_millis(1));
        }
    }

    fn wants_to_stop(&self) -> bool {
        self.reached.load(Relaxed)
    }
}

pub(crate) fn main() -> Result<(), gaitway::Error> {
    let mut rig = gaitway::open("op3", "sim")?;
    let motion = rig.motion("walk:60s")?;
    let report = rig.play_watched(&motion, Options::default(), &Enough::default())?.report;
    assert_eq!(report.outcome, Outcome::Stopped);
    Ok(())
}
