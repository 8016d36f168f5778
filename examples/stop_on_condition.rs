//! Plays an action and stops it after two seconds: any condition will do that is quick to look at. The
//! robot is led to rest along its path, and holds there.

use gaitway::control::StopCode;
use gaitway::{Event, Observer, Options, Outcome};
use std::sync::atomic::{AtomicU32, Ordering};

/// Wants it to end after so many looks; there is one in every cycle.
struct Enough(AtomicU32);

impl Observer for Enough {
    fn hear(&self, event: Event<'_>) {
        println!("{event:?}");
    }

    fn wants_to_stop(&self) -> bool {
        self.0.fetch_add(1, Ordering::Relaxed) > 250
    }
}

pub(crate) fn main() -> Result<(), gaitway::Error> {
    let mut rig = gaitway::open("op3", "sim")?;
    let motion = rig.motion("walk:20s")?;
    let enough = Enough(AtomicU32::new(0));
    let report = rig.play_watched(&motion, Options::default(), &enough)?.report;
    assert_eq!(report.outcome, Outcome::Stopped);
    assert_eq!(report.stop.map(|stop| stop.code), Some(StopCode::Asked));
    println!("stopped after {:.1} s, at rest", report.duration_s);
    Ok(())
}
