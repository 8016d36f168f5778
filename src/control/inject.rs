//! A panic put in on purpose, for the tests that see what becomes of one.
//!
//! Only with the feature `inject-panic`, which no release has: the environment variable
//! `GAITWAY_PANIC=STEP:N` then breaks the program once, at step STEP of cycle N, and
//! `GAITWAY_PANIC=STEP:N+` whenever it comes to that step from there on.

/// Does nothing.
#[cfg(not(feature = "inject-panic"))]
pub(crate) const fn point(_step: &str, _cycle: u64) {}

/// Breaks the program here if that was asked for.
#[cfg(feature = "inject-panic")]
pub(crate) fn point(step: &str, cycle: u64) {
    use std::sync::OnceLock;
    use std::sync::atomic::{AtomicBool, Ordering};
    struct Asked {
        step: String,
        cycle: u64,
        again: bool,
    }
    static ASKED: OnceLock<Option<Asked>> = OnceLock::new();
    static DONE: AtomicBool = AtomicBool::new(false);
    let asked = ASKED.get_or_init(|| {
        let asked = std::env::var("GAITWAY_PANIC").ok()?;
        let (step, when) = asked.split_once(':')?;
        let again = when.ends_with('+');
        let cycle = when.trim_end_matches('+').parse().ok()?;
        Some(Asked { step: step.to_owned(), cycle, again })
    });
    let Some(asked) = asked else { return };
    let is_time = cycle == asked.cycle || asked.again && cycle > asked.cycle;
    if asked.step == step && is_time && (asked.again || !DONE.swap(true, Ordering::SeqCst)) {
        std::panic::panic_any(format!("put in on purpose at {step}, cycle {cycle}"));
    }
}
