//! A panic put in on purpose, for the tests that see what becomes of one.
//!
//! Only with the feature `inject-panic`, which no release has: the environment variable
//! `GAITWAY_PANIC=STEP:N` then breaks the program at step STEP of cycle N.

/// Does nothing.
#[cfg(not(feature = "inject-panic"))]
pub(crate) const fn point(_step: &str, _cycle: u64) {}

/// Breaks the program here if that was asked for.
#[cfg(feature = "inject-panic")]
pub(crate) fn point(step: &str, cycle: u64) {
    use std::sync::OnceLock;
    static ASKED: OnceLock<Option<(String, u64)>> = OnceLock::new();
    let asked = ASKED.get_or_init(|| {
        let asked = std::env::var("GAITWAY_PANIC").ok()?;
        let (step, cycle) = asked.split_once(':')?;
        Some((step.to_owned(), cycle.parse().ok()?))
    });
    if asked.as_ref().is_some_and(|(at, when)| at == step && *when == cycle) {
        std::panic::panic_any(format!("put in on purpose at {step}, cycle {cycle}"));
    }
}
