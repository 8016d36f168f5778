//! A CAN line of the virtual world on an interface of the operating system, so that every program
//! that speaks SocketCAN finds the virtual actuators there.

use super::can::CanInterface;
use super::{Clock as _, FramePort as _, Heard, MonotonicClock, PortError};
use crate::time::Duration;
use crate::wire::can::{CanFrame, CanId, Format};
use gaitway_sim::can::{CanFrame as SimFrame, CanHeard, Kind};
use gaitway_sim::{LiveCan, World};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::Instant;

/// How long the bridge may not notice that it is to end.
const LOOK: Duration = Duration::from_millis(20);
/// How long the interface may be full before a frame is lost.
const SEND: Duration = Duration::from_millis(50);

/// A line on an interface, until it is dropped.
pub struct CanBridge {
    name: String,
    stop: Arc<AtomicBool>,
    lost: Arc<Mutex<Option<String>>>,
    thread: Option<JoinHandle<()>>,
}

impl CanBridge {
    /// Puts line number `line` on the interface, whose own bit rate, if it has one, does not
    /// matter: the virtual line keeps its time itself.
    ///
    /// # Errors
    /// No such interface or no such CAN line.
    pub fn open(world: Arc<Mutex<World>>, line: usize, interface: &str) -> Result<Self, PortError> {
        let port = CanInterface::open(interface)?;
        let live = LiveCan::new(world, line).map_err(|e| PortError::Gone(e.to_string()))?;
        let stop = Arc::new(AtomicBool::new(false));
        let lost = Arc::new(Mutex::new(None));
        let (stopping, losing) = (Arc::clone(&stop), Arc::clone(&lost));
        let name = format!("bridge {interface}");
        let carry = move || {
            if let Err(error) = carry(port, &live, &stopping) {
                *losing.lock().unwrap_or_else(PoisonError::into_inner) = Some(error.to_string());
            }
        };
        let thread = std::thread::Builder::new().name(name).spawn(carry);
        let thread = thread.map_err(|e| PortError::Io(format!("no thread: {e}")))?;
        Ok(Self { name: interface.to_owned(), stop, lost, thread: Some(thread) })
    }

    /// Name of the interface.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Why nothing is carried any more, if so.
    #[must_use]
    pub fn lost(&self) -> Option<String> {
        self.lost.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

impl Drop for CanBridge {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Release);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

fn carry(mut port: CanInterface, live: &LiveCan, stop: &AtomicBool) -> Result<(), PortError> {
    // When no frame was there last: the next was sent after that.
    let mut looked = Instant::now();
    while !stop.load(Ordering::Acquire) {
        let (heard, quiet) = live.heard();
        for heard in heard {
            // That the virtual line is off the bus cannot be said on another's interface: it is
            // silent.
            let CanHeard::Frame(frame) = heard else { continue };
            let Some(frame) = from_sim(&frame) else { continue };
            match port.send(&frame, MonotonicClock.now() + SEND) {
                // Full, or a classic interface and an FD frame: as on a real line, it is lost.
                Ok(()) | Err(PortError::TimedOut | PortError::Io(_)) => {}
                Err(error) => return Err(error),
            }
        }
        let asked = Instant::now();
        let mut received = port.receive(MonotonicClock.now());
        if received == Err(PortError::TimedOut) {
            looked = asked;
            received = port.receive(MonotonicClock.now() + LOOK.min(quiet));
        }
        match received {
            // Of more than the line can take some are lost.
            Ok(Heard::Frame(frame)) => drop(live.send_since(to_sim(&frame), looked)),
            Ok(Heard::Report(_)) | Err(PortError::TimedOut) => {}
            Err(error) => return Err(error),
        }
    }
    Ok(())
}

fn to_sim(frame: &CanFrame) -> SimFrame {
    let kind = match frame.format() {
        Format::Classic => Kind::Classic,
        Format::Remote { length } => Kind::Remote(length),
        Format::Fd { fast } => Kind::Fd { fast },
    };
    let id = frame.id();
    let bytes = frame.payload().to_vec();
    SimFrame { id: id.number(), extended: id.is_extended(), kind, bytes }
}

fn from_sim(frame: &SimFrame) -> Option<CanFrame> {
    let format = match frame.kind {
        Kind::Classic => Format::Classic,
        Kind::Remote(length) => Format::Remote { length },
        Kind::Fd { fast } => Format::Fd { fast },
    };
    let id = if frame.extended { CanId::extended(frame.id) } else { CanId::standard(frame.id) };
    CanFrame::new(id?, format, &frame.bytes)
}
