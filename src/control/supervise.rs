//! The one way in which joints are moved: armed, streamed on a thread of its own under a net for
//! panics, and left in a way that was looked at.

use super::arm::{Arming, arm, disarm};
use super::cycle::{Motion, Run, Settings, stream};
use super::{Sink, left, net};
use crate::error::{Error, ErrorKind};
use crate::robot::Link;
use crate::robot::preflight::Preflight;

/// What came of a performance.
#[derive(Debug)]
pub enum Performance {
    /// A wish to stop came before torque: the robot is as it was found.
    Stopped,
    /// The motion was streamed.
    Ran(Box<Run>),
    /// The loop broke for good; the servos stand at their last goal.
    Broke {
        /// What the panic said.
        words: String,
        /// What a person should know of how the robot was left.
        notes: Vec<String>,
    },
}

/// Switches torque on and streams `motion` until it is at rest, on a thread of its own; the calling
/// thread runs `meanwhile`, which is handed a look at whether the motion is over and returns when it
/// is.
///
/// `asked_to_stop` is looked at before everything that arming writes, and once per cycle.
///
/// # Errors
/// As [`arm`].
pub fn perform(
    link: &mut Link,
    found: &Preflight,
    motion: &mut (dyn Motion + Send),
    settings: Settings,
    sink: &mut (dyn Sink + Send),
    asked_to_stop: &(dyn Fn() -> bool + Sync),
    meanwhile: &mut dyn FnMut(&dyn Fn() -> bool),
) -> Result<Performance, Error> {
    let done = std::thread::scope(|scope| {
        let link = &mut *link;
        let performer = scope.spawn(move || {
            net::catch(|| {
                let armed = match arm_safely(link, found, asked_to_stop)? {
                    Arming::Done(armed) => armed,
                    Arming::Stopped => return Ok(Performance::Stopped),
                };
                let run = stream(link, armed, motion, settings, sink, &|| asked_to_stop());
                Ok(Performance::Ran(Box::new(run)))
            })
        });
        meanwhile(&|| performer.is_finished());
        performer.join().unwrap_or_else(|panic| Err(net::words(&*panic).to_owned()))
    });
    done.unwrap_or_else(|words| {
        let notes = net::catch(|| left::leave(link).1);
        let notes = notes.unwrap_or_else(|_| vec!["how the robot was left is not known".into()]);
        Ok(Performance::Broke { words, notes })
    })
}

/// Arms; a panic on the way switches torque off again, as any failure does.
///
/// # Errors
/// As [`arm`], and what a panic said.
pub fn arm_safely(
    link: &mut Link,
    found: &Preflight,
    asked_to_stop: &dyn Fn() -> bool,
) -> Result<Arming, Error> {
    net::catch(|| arm(link, found, asked_to_stop)).unwrap_or_else(|words| {
        let error = Error::of(ErrorKind::Broke, "the program broke while the robot was armed")
            .got(words)
            .remedy("please report this; torque was switched off again");
        if found.held {
            super::watchdog::release(link);
            return Err(error.remedy("please report this; the robot is held as it was"));
        }
        match disarm(link) {
            Ok(()) => Err(error),
            Err(still_on) => {
                let remedy = format!("{}; {}", still_on.what, still_on.got.unwrap_or_default());
                Err(error.remedy(remedy))
            }
        }
    })
}

#[cfg(test)]
mod tests;
