//! Disks made of memory, which fail and stand still when they are told to.

use std::io;
use std::sync::mpsc::Receiver;
use std::sync::{Arc, Mutex, MutexGuard};

use gaitway::recording::{Disk, Syncer};

/// A disk in memory. Clones share it.
#[derive(Clone, Default)]
pub struct MemoryDisk(Arc<Mutex<Memory>>);

#[derive(Default)]
struct Memory {
    bytes: Vec<u8>,
    /// Length of the file after each append.
    lengths: Vec<usize>,
    calls: u64,
    /// The call that fails; an append writes half of its bytes first.
    fails_at: Option<u64>,
    /// How much it holds; an append writes what there is room for first.
    room: Option<usize>,
}

impl MemoryDisk {
    pub fn failing_at(call: u64) -> Self {
        let disk = Self::default();
        disk.memory().fails_at = Some(call);
        disk
    }

    pub fn with_room_for(bytes: usize) -> Self {
        let disk = Self::default();
        disk.memory().room = Some(bytes);
        disk
    }

    pub fn bytes(&self) -> Vec<u8> {
        self.memory().bytes.clone()
    }

    /// Length of the file after each append.
    pub fn lengths(&self) -> Vec<usize> {
        self.memory().lengths.clone()
    }

    /// Appends and synchronisations so far.
    pub fn calls(&self) -> u64 {
        self.memory().calls
    }

    fn memory(&self) -> MutexGuard<'_, Memory> {
        self.0.lock().unwrap()
    }
}

impl Memory {
    fn call(&mut self) -> io::Result<()> {
        self.calls += 1;
        match self.fails_at {
            Some(call) if call == self.calls => Err(io::Error::other("no space left")),
            _ => Ok(()),
        }
    }
}

impl Disk for MemoryDisk {
    fn append(&mut self, bytes: &[u8]) -> io::Result<()> {
        let mut memory = self.memory();
        let called = memory.call();
        let room = memory.room.map_or(usize::MAX, |room| room - memory.bytes.len());
        let (stored, called) = match called {
            Err(failed) => (&bytes[..bytes.len() / 2], Err(failed)),
            Ok(()) if bytes.len() > room => {
                (&bytes[..room], Err(io::ErrorKind::StorageFull.into()))
            }
            Ok(()) => (bytes, Ok(())),
        };
        memory.bytes.extend_from_slice(stored);
        let length = memory.bytes.len();
        memory.lengths.push(length);
        called
    }

    fn syncer(&self) -> io::Result<Syncer> {
        let disk = self.clone();
        Ok(Box::new(move || disk.memory().call()))
    }
}

/// A disk that stands still from a call on until its gate is dropped; what is sent through the gate lets one call pass.
pub struct GatedDisk {
    disk: MemoryDisk,
    gate: Arc<Mutex<Gate>>,
    stands: Stands,
}

/// What of a disk stands still.
#[derive(Clone, Copy, PartialEq)]
pub enum Stands {
    /// Appending and synchronising.
    Both,
    /// Only synchronising.
    Syncs,
    /// Only appending.
    Appends,
}

struct Gate {
    gate: Receiver<()>,
    open_calls: u32,
}

impl GatedDisk {
    /// Lets so many calls through before it stands still.
    pub fn new(disk: MemoryDisk, gate: Receiver<()>, open_calls: u32, stands: Stands) -> Self {
        Self { disk, gate: Arc::new(Mutex::new(Gate { gate, open_calls })), stands }
    }
}

fn pass(gate: &Mutex<Gate>) {
    let mut gate = gate.lock().unwrap();
    if gate.open_calls == 0 {
        // Waits until the other end is gone, then never again.
        let _ = gate.gate.recv();
    } else {
        gate.open_calls -= 1;
    }
}

impl Disk for GatedDisk {
    fn append(&mut self, bytes: &[u8]) -> io::Result<()> {
        if self.stands != Stands::Syncs {
            pass(&self.gate);
        }
        self.disk.append(bytes)
    }

    fn syncer(&self) -> io::Result<Syncer> {
        let (gate, mut sync) = (Arc::clone(&self.gate), self.disk.syncer()?);
        let waits = self.stands != Stands::Appends;
        Ok(Box::new(move || {
            if waits {
                pass(&gate);
            }
            sync()
        }))
    }
}
