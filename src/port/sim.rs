//! The virtual robot behind the port traits: waiting *is* running the virtual world, so the code
//! above runs unmodified, in one thread and in virtual time. All lines of a world share its clock.

use super::patient::PatientClock;
use super::{BytePort, Clock, FramePort, Heard, PortError};
use crate::time::{Duration, Instant};
use crate::wire::can::error_frame::ErrorFrame;
use crate::wire::can::{CanFrame, CanId, Format};
use gaitway_sim::can::{self as sim, CanHeard, Kind};
use gaitway_sim::{LiveCan, World};
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// A virtual world shared by its clock and its lines.
#[derive(Clone)]
pub struct SharedWorld(Arc<Mutex<World>>);

impl SharedWorld {
    /// Shares `world`.
    #[must_use]
    pub fn new(world: World) -> Self {
        Self(Arc::new(Mutex::new(world)))
    }

    /// Looks at or changes the world between two bus exchanges.
    ///
    /// A panic of another holder leaves registers, not invariants, half written: the world stays
    /// usable for the stop that follows.
    pub fn lock(&self) -> MutexGuard<'_, World> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The mutex itself, for a real-time door.
    #[must_use]
    pub fn inner(&self) -> Arc<Mutex<World>> {
        Arc::clone(&self.0)
    }
}

/// The world's own clock.
pub struct VirtualClock(pub SharedWorld);

impl Clock for VirtualClock {
    fn now(&self) -> Instant {
        Instant::from_nanos(self.0.lock().now_ns())
    }

    fn sleep_until(&self, at: Instant) {
        self.0.lock().run_until(at.as_nanos());
    }
}

/// The host's end of one virtual serial line. If the line hangs up it stays gone, as a port does whose
/// adapter was pulled out, even if the adapter comes back.
pub struct VirtualLine {
    world: SharedWorld,
    line: usize,
    baud_bps: u32,
    /// Which connection to the line this is.
    connection: Option<u32>,
}

impl VirtualLine {
    /// The host's end of line number `line`, sending at `baud_bps`.
    #[must_use]
    pub fn new(world: SharedWorld, line: usize, baud_bps: u32) -> Self {
        let connection = world.lock().connection(line);
        Self { world, line, baud_bps, connection }
    }

    fn connected(&self) -> Result<MutexGuard<'_, World>, PortError> {
        connected(&self.world, self.line, self.connection)
    }
}

/// The world, if the line is still the one that was opened.
fn connected(
    world: &SharedWorld,
    line: usize,
    connection: Option<u32>,
) -> Result<MutexGuard<'_, World>, PortError> {
    let world = world.lock();
    if connection.is_some() && world.connection(line) == connection {
        Ok(world)
    } else {
        Err(PortError::Gone(format!("virtual line {line} hung up")))
    }
}

impl BytePort for VirtualLine {
    fn send(&mut self, bytes: &[u8], deadline: Instant) -> Result<(), PortError> {
        let mut rest = bytes;
        loop {
            let mut world = self.connected()?;
            let taken = world.transmit(self.line, rest, self.baud_bps);
            rest = &rest[taken..];
            match world.blocked_until_ns(self.line) {
                Some(until_ns) if !rest.is_empty() => {
                    world.run_until(until_ns.min(deadline.as_nanos()));
                    if until_ns > deadline.as_nanos() {
                        return Err(PortError::TimedOut);
                    }
                }
                _ => return Ok(()),
            }
        }
    }

    fn receive(&mut self, buffer: &mut [u8], deadline: Instant) -> Result<usize, PortError> {
        let count = self.connected()?.receive(self.line, buffer, deadline.as_nanos());
        match count {
            0 => self.connected().and(Err(PortError::TimedOut)),
            n => Ok(n),
        }
    }

    fn discard_input(&mut self) -> Result<(), PortError> {
        self.connected()?.discard_input(self.line);
        Ok(())
    }
}

/// The host's end of one virtual CAN line. Its send queue is as short as that of an interface, and
/// whoever finds it full waits, as at one.
pub struct VirtualCanLine {
    world: SharedWorld,
    line: usize,
    connection: Option<u32>,
    full_queue_count: u64,
}

/// Pause before a full send queue is tried again: about one frame of eight bytes at 1 Mbit/s.
const QUEUE_PAUSE: Duration = Duration::from_micros(150);

impl VirtualCanLine {
    /// The host's end of line number `line`.
    #[must_use]
    pub fn new(world: SharedWorld, line: usize) -> Self {
        let connection = world.lock().connection(line);
        Self { world, line, connection, full_queue_count: 0 }
    }

    fn connected(&self) -> Result<MutexGuard<'_, World>, PortError> {
        connected(&self.world, self.line, self.connection)
    }
}

impl FramePort for VirtualCanLine {
    fn full_queue_count(&self) -> u64 {
        self.full_queue_count
    }

    fn send(&mut self, frame: &CanFrame, deadline: Instant) -> Result<(), PortError> {
        let frame = to_sim(frame);
        loop {
            let mut world = self.connected()?;
            if world.can_send(self.line, frame.clone()).is_ok() {
                return Ok(());
            }
            let again = Instant::from_nanos(world.now_ns()) + QUEUE_PAUSE;
            if again <= deadline {
                world.run_until(again.as_nanos());
            }
            drop(world);
            self.full_queue_count += 1;
            if again > deadline {
                return Err(PortError::TimedOut);
            }
        }
    }

    fn receive(&mut self, deadline: Instant) -> Result<Heard, PortError> {
        loop {
            let heard = self.connected()?.can_receive(self.line, deadline.as_nanos());
            match heard {
                Some(heard) => {
                    if let Some(heard) = of_sim(&heard) {
                        return Ok(heard);
                    }
                }
                None => return self.connected().and(Err(PortError::TimedOut)),
            }
        }
    }
}

/// The host's end of a virtual CAN line whose world runs with real time, or stands while this host is
/// late.
pub struct LiveCanLine {
    live: LiveCan,
    clock: PatientClock,
    heard: VecDeque<CanHeard>,
    full_queue_count: u64,
}

impl LiveCanLine {
    /// The host's end of line number `line` of `world`, whose time goes with `clock` from now on.
    ///
    /// # Errors
    /// [`PortError::Gone`] if it is no CAN line.
    pub fn new(world: &SharedWorld, line: usize, clock: &PatientClock) -> Result<Self, PortError> {
        let live = LiveCan::patient(world.inner(), line, clock.time())
            .map_err(|e| PortError::Gone(e.to_string()))?;
        let (clock, heard) = (clock.clone(), VecDeque::new());
        Ok(Self { live, clock, heard, full_queue_count: 0 })
    }
}

impl FramePort for LiveCanLine {
    fn full_queue_count(&self) -> u64 {
        self.full_queue_count
    }

    fn send(&mut self, frame: &CanFrame, deadline: Instant) -> Result<(), PortError> {
        while self.live.send(to_sim(frame)).is_err() {
            self.full_queue_count += 1;
            let again = self.clock.now() + QUEUE_PAUSE;
            if again > deadline {
                return Err(PortError::TimedOut);
            }
            self.clock.sleep_until(again);
            self.heard.extend(self.live.heard().0);
        }
        Ok(())
    }

    fn receive(&mut self, deadline: Instant) -> Result<Heard, PortError> {
        loop {
            let (heard, quiet) = self.live.heard();
            self.heard.extend(heard);
            while let Some(heard) = self.heard.pop_front() {
                if let Some(heard) = of_sim(&heard) {
                    return Ok(heard);
                }
            }
            let now = self.clock.now();
            if now >= deadline {
                return Err(PortError::TimedOut);
            }
            self.clock.sleep_until(deadline.min(now + quiet.max(QUEUE_PAUSE)));
        }
    }
}

/// None for a frame that no CAN line carries.
fn of_sim(heard: &CanHeard) -> Option<Heard> {
    // Defined in `linux/can/error.h`: bus-off, and that the controller was restarted.
    let report = |classes| Some(Heard::Report(ErrorFrame::decode(classes, &[])));
    match heard {
        CanHeard::Frame(frame) => from_sim(frame).map(Heard::Frame),
        CanHeard::BusOff => report(1 << 6),
        CanHeard::Restarted => report(1 << 8),
    }
}

fn to_sim(frame: &CanFrame) -> sim::CanFrame {
    sim::CanFrame {
        id: frame.id().number(),
        extended: frame.id().is_extended(),
        kind: match frame.format() {
            Format::Classic => Kind::Classic,
            Format::Remote { length } => Kind::Remote(length),
            Format::Fd { fast } => Kind::Fd { fast },
        },
        bytes: frame.payload().to_vec(),
    }
}

/// None for what no CAN line carries.
fn from_sim(frame: &sim::CanFrame) -> Option<CanFrame> {
    let id = if frame.extended { CanId::extended(frame.id) } else { CanId::standard(frame.id) };
    let format = match frame.kind {
        Kind::Classic => Format::Classic,
        Kind::Remote(length) => Format::Remote { length },
        Kind::Fd { fast } => Format::Fd { fast },
    };
    CanFrame::new(id?, format, &frame.bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use gaitway_sim::{Options, Script, profiles};

    const MS: u64 = 1_000_000;
    const PING_1: [u8; 10] = [0xFF, 0xFF, 0xFD, 0x00, 0x01, 0x03, 0x00, 0x01, 0x19, 0x4E];

    fn line(script: &str) -> (SharedWorld, VirtualLine) {
        let robot = profiles::robot("op3").expect("a robot");
        let faults = Script::parse(script).expect("a script").faults;
        let world = World::new(&robot, Options { faults, ..Options::default() }).expect("a world");
        let world = SharedWorld::new(world);
        (world.clone(), VirtualLine::new(world, 0, 2_000_000))
    }

    fn at_ms(ms: u64) -> Instant {
        Instant::from_nanos(ms * MS)
    }

    #[test]
    fn a_line_that_hung_up_is_gone_even_when_it_is_back() {
        let (world, mut line) = line("[[fault]]\nkind = 'hang-up'\nat_s = 0.1\nuntil_s = 0.2");
        let mut buffer = [0; 64];
        assert_eq!(line.receive(&mut buffer, at_ms(50)), Err(PortError::TimedOut));
        assert!(matches!(line.receive(&mut buffer, at_ms(150)), Err(PortError::Gone(_))));
        assert_eq!(world.lock().now_ns(), 100 * MS, "noticed at once");
        world.lock().run_until(300 * MS);
        assert!(matches!(line.send(&PING_1, at_ms(400)), Err(PortError::Gone(_))));
        let mut again = VirtualLine::new(world, 0, 2_000_000);
        again.send(&PING_1, at_ms(400)).expect("taken");
        assert_eq!(again.receive(&mut buffer, at_ms(400)), Ok(14));
    }

    #[test]
    fn a_blocked_line_makes_its_host_wait_or_give_up() {
        let script = "[[fault]]\nkind = 'blocked'\nuntil_s = 0.1\nbytes = 4";
        let (world, mut line) = line(script);
        assert_eq!(line.send(&PING_1, at_ms(50)), Err(PortError::TimedOut));
        assert_eq!(world.lock().now_ns(), 50 * MS);
        line.send(&PING_1, at_ms(150)).expect("taken in the end");
        assert_eq!(world.lock().now_ns(), 100 * MS);
        assert_eq!(line.receive(&mut [0; 64], at_ms(150)), Ok(14));
    }
}
