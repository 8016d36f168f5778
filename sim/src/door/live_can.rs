//! One CAN line of a world in real time, for whoever carries its frames to and from somewhere else:
//! an interface of the operating system, say.

use super::{DoorError, KEEP_UP_NS, Pace, PatientTime, lock};
use crate::World;
use crate::can::{CanFrame, CanHeard, QueueFull};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// Frames that may wait for the line: what comes from elsewhere has queued there already.
const FRAMES: usize = 1024;

/// A CAN line whose world's clock follows real time.
pub struct LiveCan {
    world: Arc<Mutex<World>>,
    line: usize,
    pace: Pace,
}

impl LiveCan {
    /// The line with this number; the world's clock runs from now on, if it did not yet.
    ///
    /// # Errors
    /// No such line, or no CAN line.
    pub fn new(world: Arc<Mutex<World>>, line: usize) -> Result<LiveCan, DoorError> {
        LiveCan::of(world, line)
    }

    /// The same, for a host in this process: the world's time goes with `time`, which waits for the
    /// host.
    ///
    /// # Errors
    /// As [`LiveCan::new`].
    pub fn patient(
        world: Arc<Mutex<World>>,
        line: usize,
        time: &Arc<PatientTime>,
    ) -> Result<LiveCan, DoorError> {
        lock(&world).patient_pace(time);
        LiveCan::of(world, line)
    }

    fn of(world: Arc<Mutex<World>>, line: usize) -> Result<LiveCan, DoorError> {
        let mut locked = lock(&world);
        let can = locked.can_line_mut(line).ok_or(DoorError::NoLine(line))?;
        can.set_queue(FRAMES);
        let pace = locked.pace();
        drop(locked);
        Ok(LiveCan { world, line, pace })
    }

    fn now_ns(&self) -> u64 {
        self.pace.now_ns()
    }

    /// Hands a frame of somebody else's to the line, now.
    ///
    /// # Errors
    /// The queue is full; come back after a while.
    pub fn send(&self, frame: CanFrame) -> Result<(), QueueFull> {
        self.send_since(frame, Instant::now())
    }

    /// As [`LiveCan::send`], of a frame that may have been sent to us since `earliest`: when it was
    /// last looked for and not there. The referee judges by that, too.
    ///
    /// # Errors
    /// As [`LiveCan::send`].
    pub fn send_since(&self, frame: CanFrame, earliest: Instant) -> Result<(), QueueFull> {
        let earliest_ns = self.now_ns().saturating_sub(earliest.elapsed().as_nanos() as u64);
        let mut world = lock(&self.world);
        world.run_until(self.now_ns());
        world.can_send_noticed(self.line, frame, earliest_ns)
    }

    /// All that was heard by now, and how long nothing more will be heard unless somebody sends.
    pub fn heard(&self) -> (Vec<CanHeard>, Duration) {
        let mut world = lock(&self.world);
        let now_ns = self.now_ns();
        world.run_until(now_ns);
        let heard = std::iter::from_fn(|| world.can_receive(self.line, now_ns)).collect();
        world.keep_up();
        let next_ns = world.next_on_line_ns(self.line).unwrap_or(u64::MAX);
        let wait_ns = next_ns.min(now_ns + KEEP_UP_NS).saturating_sub(self.now_ns());
        (heard, Duration::from_nanos(wait_ns))
    }
}
