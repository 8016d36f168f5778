//! Any bytes in answer to any question of the bus, in all four protocols: no panic, an end in
//! bounded time, one verdict per device asked, and never an answer of another length.

use gaitway::bus::scan::scan;
use gaitway::bus::{Bus, GroupItem, GroupQuestion, GroupRead, Protocol, Timing};
use gaitway::port::{BytePort, Clock, PortError};
use gaitway::time::{Duration, Instant};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

/// A line in virtual time that says `bytes`, `portion` at a time, whatever it is asked.
#[derive(Clone)]
struct Babbler {
    now_ns: Arc<AtomicU64>,
    bytes: Arc<Mutex<Vec<u8>>>,
    portion: usize,
}

impl Clock for Babbler {
    fn now(&self) -> Instant {
        Instant::from_nanos(self.now_ns.load(Ordering::Relaxed))
    }

    fn sleep_until(&self, at: Instant) {
        self.now_ns.fetch_max(at.as_nanos(), Ordering::Relaxed);
    }
}

impl BytePort for Babbler {
    fn send(&mut self, _bytes: &[u8], _deadline: Instant) -> Result<(), PortError> {
        Ok(())
    }

    fn receive(&mut self, buffer: &mut [u8], deadline: Instant) -> Result<usize, PortError> {
        let mut bytes = self.bytes.lock().unwrap();
        let n = self.portion.min(bytes.len()).min(buffer.len());
        if n == 0 {
            drop(bytes);
            self.sleep_until(deadline);
            return Err(PortError::TimedOut);
        }
        self.now_ns.fetch_add(10_000, Ordering::Relaxed);
        buffer[..n].copy_from_slice(&bytes[..n]);
        bytes.drain(..n);
        Ok(n)
    }

    fn discard_input(&mut self) -> Result<(), PortError> {
        Ok(())
    }
}

const PROTOCOLS: [Protocol; 4] =
    [Protocol::Dynamixel1, Protocol::Dynamixel2, Protocol::FeetechSts, Protocol::FeetechScs];
const KINDS: [GroupRead; 4] =
    [GroupRead::Sync, GroupRead::Fast, GroupRead::Bulk, GroupRead::FastBulk];

// Protocol, question, portion and number of devices, then what the line says.
pub fn fuzz(input: &[u8]) {
    let [protocol, question, portion, devices, bytes @ ..] = input else { return };
    let protocol = PROTOCOLS[usize::from(protocol % 4)];
    let line = Babbler {
        now_ns: Arc::default(),
        bytes: Arc::new(Mutex::new(bytes.to_vec())),
        portion: usize::from(*portion).max(1),
    };
    let timing = Timing {
        baud_bps: 1_000_000,
        return_delay: Duration::from_micros(500),
        latency: Duration::ZERO,
    };
    let mut bus = Bus::new(Box::new(line.clone()), Arc::new(line.clone()), timing);
    bus.set_echo(question & 0x80 != 0);
    let budget = Instant::ZERO + Duration::from_secs(10);
    match question % 8 {
        0 => drop(bus.ping(protocol, 1, budget)),
        1 => {
            if let Ok(reply) = bus.read(protocol, 1, 36, u16::from(*devices), budget) {
                assert_eq!(reply.bytes.len(), usize::from(*devices));
            }
        }
        2 => drop(bus.ping_all(protocol, budget)),
        3 => {
            let found = scan(&mut bus, &[protocol], |_| vec![(36, 2)], budget);
            let found = found.expect("a line that never fails");
            assert!(found.found.len() + found.collisions.len() <= 254);
        }
        kind => {
            let item = |id| GroupItem { id, address: 36, length: 4 };
            let items: Vec<_> = (0..devices % 32).map(item).collect();
            let kind = KINDS[usize::from(kind - 4)];
            let question = GroupQuestion { protocol, kind, items };
            if bus.begin_group_read(&question, budget).is_ok() {
                let answers = bus.finish_group_read(budget).expect("a line that never fails");
                assert_eq!(answers.len(), question.items.len());
                assert!(answers.iter().flatten().all(|reply| reply.bytes.len() == 4));
            }
        }
    }
    assert!(line.now() <= budget + Duration::from_secs(1));
}
