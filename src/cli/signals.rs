//! Ctrl-C and termination as a flag that the loop looks at. A second signal changes nothing.

use crate::error::Error;
use std::sync::Arc;
use std::sync::atomic::{AtomicI32, Ordering};
use tokio::signal::unix::{SignalKind, signal};

/// The first signal that came since any command listens; 0 if none did.
static HEARD: AtomicI32 = AtomicI32::new(0);

/// The number of the first signal that came since this process listens.
#[must_use]
pub fn heard() -> Option<i32> {
    Some(HEARD.load(Ordering::SeqCst)).filter(|&number| number != 0)
}

/// True of a signal that ends from outside what listens until Ctrl-C: Ctrl-C is its own end.
#[must_use]
pub const fn is_from_outside(number: i32) -> bool {
    number != 2
}

/// From now on, and for good, a file that may not grow any more is an error of whoever writes it and
/// no signal (SIGXFSZ) that would end the process in the middle of a motion. A reader that is gone
/// (SIGPIPE) is one already: Rust sees to that.
///
/// # Errors
/// If the system does not let the process listen.
pub fn outlive_size_limits() -> std::io::Result<()> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_io().build()?;
    let _guard = runtime.enter();
    // A signal that is listened for once does nothing by itself for as long as the process lives,
    // whether or not anybody still asks for it (documentation of `tokio::signal::unix::Signal`).
    signal(SignalKind::from_raw(rustix::process::Signal::XFSZ.as_raw())).map(drop)
}

/// The first signal that came, if any.
#[derive(Clone, Debug, Default)]
pub struct Signals(Arc<AtomicI32>);

impl Signals {
    /// Listens for SIGINT, SIGTERM and SIGHUP on a thread of its own from now on.
    ///
    /// # Errors
    /// If the system does not let the process listen.
    pub fn listen() -> std::io::Result<Self> {
        let signals = Self::default();
        let first = Arc::clone(&signals.0);
        let runtime = tokio::runtime::Builder::new_current_thread().enable_io().build()?;
        let guard = runtime.enter();
        let kinds = [SignalKind::interrupt(), SignalKind::terminate(), SignalKind::hangup()];
        let [mut interrupt, mut terminate, mut hangup] =
            [signal(kinds[0])?, signal(kinds[1])?, signal(kinds[2])?];
        drop(guard);
        std::thread::Builder::new().name("signals".to_owned()).spawn(move || {
            runtime.block_on(async {
                loop {
                    let number = tokio::select! {
                        _ = interrupt.recv() => 2,
                        _ = terminate.recv() => 15,
                        _ = hangup.recv() => 1,
                    };
                    let _ = HEARD.compare_exchange(0, number, Ordering::SeqCst, Ordering::SeqCst);
                    let _ = first.compare_exchange(0, number, Ordering::SeqCst, Ordering::SeqCst);
                }
            });
        })?;
        Ok(signals)
    }

    /// As [`Signals::listen`].
    ///
    /// # Errors
    /// In words.
    pub fn listened() -> Result<Self, Error> {
        Self::listen().map_err(|e| Error::new(format!("no signals: {e}")))
    }

    /// As [`Signals::listen`], for a command that is over soon and must not be cut off in the middle:
    /// a wish to stop changes nothing.
    ///
    /// # Errors
    /// If the system does not let the process listen.
    pub fn defer() -> Result<(), Error> {
        Self::listen().map(drop).map_err(|e| Error::new(format!("no signals: {e}")))
    }

    /// The number of the first signal that came.
    #[must_use]
    pub fn first(&self) -> Option<i32> {
        Some(self.0.load(Ordering::SeqCst)).filter(|&number| number != 0)
    }
}
