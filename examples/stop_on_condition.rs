//! Plays an action and stops it two seconds into its motion: any condition will do that is quick to look
//! at. The robot is led to rest along its path, and holds there.

use gaitway::control::StopCode;
use gaitway::{Event, Observer, Options, Outcome, Progress};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Duration;

/// Wants it to end once the motion has gone on for two seconds; before it comes the approach.
#[derive(Default)]
struct Enough {
    approach_ms: AtomicU64,
    reached: AtomicBool,
}

impl Observer for Enough {
    fn hear(&self, event: Event<'_>) {
        if let Event::Planned { approach_s, .. } = event {
            self.approach_ms.store((approach_s * 1e3) as u64, Ordering::Relaxed);
        }
    }

    fn watch(&self, progress: &Progress<'_>) {
        let end_s = self.approach_ms.load(Ordering::Relaxed) as f64 / 1e3 + 2.0;
        while !progress.is_over() {
            self.reached.fetch_or(progress.time_s() >= end_s, Ordering::Relaxed);
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    fn wants_to_stop(&self) -> bool {
        self.reached.load(Ordering::Relaxed)
    }
}

pub(crate) fn main() -> Result<(), gaitway::Error> {
    let mut rig = gaitway::open("op3", "sim")?;
    let report =
        rig.play_watched(&rig.motion("walk:60s")?, Options::default(), &Enough::default())?.report;
    assert_eq!(
        (report.outcome, report.stop.map(|stop| stop.code)),
        (Outcome::Stopped, Some(StopCode::Asked))
    );
    println!(
        "stopped after {:.1} s, {:.1} s of them approach",
        report.duration_s, report.approach_s
    );
    Ok(())
}
