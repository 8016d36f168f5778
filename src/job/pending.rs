//! Work that only computes, on a thread of its own: whoever wants to stop does not wait for it.

use super::net;
use super::observer::Observer;
use crate::error::{Error, ErrorKind};
use crate::time::Duration;
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::thread::JoinHandle;

/// So often a wish to stop is looked for.
const LOOK: Duration = Duration::from_millis(20);
/// As much as the first thread of a process usually has, bytes.
const STACK_BYTES: usize = 8 << 20;

/// What a thread is still at. One that nobody waits for any more goes on to its end or to that of the
/// process, so it must touch nothing that others see.
pub(super) struct Pending<T> {
    done: Receiver<Result<T, String>>,
    thread: JoinHandle<()>,
}

impl<T: Send + 'static> Pending<T> {
    /// Begins it.
    ///
    /// # Errors
    /// If there are no more threads.
    pub(super) fn begin(work: impl FnOnce() -> T + Send + 'static) -> Result<Self, Error> {
        let (done, pending) = sync_channel(1);
        let thread = std::thread::Builder::new().name("work".to_owned()).stack_size(STACK_BYTES);
        // Nobody may wait for it any more.
        let begun = thread.spawn(move || drop(done.send(net::catch(work))));
        let thread = begun.map_err(|e| Error::of(ErrorKind::Io, "no thread").got(e.to_string()))?;
        Ok(Self { done: pending, thread })
    }

    /// Waits for it. If it panics, so does this.
    ///
    /// # Errors
    /// The observer wanted to stop.
    pub(super) fn wait(self, observer: &dyn Observer) -> Result<T, Error> {
        loop {
            match self.done.recv_timeout(LOOK) {
                Ok(Ok(done)) => {
                    // It has nothing more to do; the next one takes up its memory.
                    let _ = self.thread.join();
                    return Ok(done);
                }
                Ok(Err(words)) => std::panic::resume_unwind(Box::new(words)),
                Err(RecvTimeoutError::Disconnected) => {
                    return Err(Error::of(ErrorKind::Broke, "a thread ended without a word"));
                }
                Err(RecvTimeoutError::Timeout) if observer.wants_to_stop() => return Err(stopped()),
                Err(RecvTimeoutError::Timeout) => {}
            }
        }
    }
}

/// Does work that only computes, unless the observer wants to stop.
///
/// # Errors
/// Those of the work; a wish to stop.
pub(super) fn unless_stopped<T: Send + 'static>(
    observer: &dyn Observer,
    work: impl FnOnce() -> Result<T, Error> + Send + 'static,
) -> Result<T, Error> {
    Pending::begin(work)?.wait(observer)?
}

/// Fails if the observer wants to stop.
///
/// # Errors
/// As said.
pub(super) fn go_on(observer: &dyn Observer) -> Result<(), Error> {
    if observer.wants_to_stop() { Err(stopped()) } else { Ok(()) }
}

fn stopped() -> Error {
    Error::of(ErrorKind::Stopped, "stopped before it was done")
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicU32, Ordering};

    /// Wants to stop when it is asked for the third time.
    #[derive(Default)]
    struct Impatient(AtomicU32);

    impl Observer for Impatient {
        fn wants_to_stop(&self) -> bool {
            self.0.fetch_add(1, Ordering::Relaxed) >= 2
        }
    }

    #[test]
    fn what_is_done_in_time_comes_back_and_what_never_ends_is_left() {
        let patient = Impatient::default();
        assert_eq!(unless_stopped(&patient, || Ok(5)), Ok(5));
        let endless = || -> Result<u32, Error> {
            loop {
                std::thread::park();
            }
        };
        let left = unless_stopped(&Impatient::default(), endless);
        assert_eq!(left.expect_err("it never ends").kind, ErrorKind::Stopped);
        let failed = unless_stopped(&patient, || Err::<u32, _>(Error::new("no")));
        assert_eq!(failed, Err(Error::new("no")));
    }

    #[test]
    fn what_panics_does_so_where_it_is_waited_for() {
        let work = || -> Result<u32, Error> { std::panic::panic_any("five".to_owned()) };
        let told = net::catch(|| unless_stopped(&Impatient::default(), work));
        assert!(told.is_err_and(|words| words.starts_with("five")));
    }
}
