//! A line with the test in its middle: a TCP port for the command, a virtual robot at the other end, and
//! between them a relay that reads along and puts faults in where the wire shows the phase.
//!
//! TCP and no pseudo-terminal: a kernel that is busy hands what is written to one on when it comes to it,
//! on some machines after more than a second, and a robot that falls silent is no subject here.

use crate::wire::{Dialect, Word};
use gaitway_sim::{Door, Options, World};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use std::collections::BTreeMap;
use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// A moment of a run, as the wire shows it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Moment {
    /// The first word on the line.
    First,
    /// The first register outside EEPROM is written.
    Arming,
    /// Torque is written: on or off.
    Torque,
    /// So many goals that led on were written.
    Moving(usize),
    /// So long after the first goal that led on.
    After(Duration),
    /// So many goal writes after the last fault.
    Goals(usize),
    /// So many questions for positions since torque was written, or since the last fault.
    Looks(usize),
    /// A servo's EEPROM was opened.
    Unlocked,
}

/// What is done at a moment.
pub type Deed = Box<dyn FnMut() + Send>;

/// A question of the host, and when its answers went on to the host's end of the line.
#[derive(Clone, Copy, Debug)]
pub struct Question {
    pub address: u16,
    pub asked: Instant,
    pub statuses: usize,
    /// When the last of them did.
    pub answered: Option<Instant>,
}

/// What passed on the line.
#[derive(Debug, Default)]
pub struct Seen {
    /// Every question, in order.
    pub questions: Vec<Question>,
    /// Goals, each with its time, by ID, counts; one entry for each write.
    pub goals: Vec<(Instant, BTreeMap<u8, i64>)>,
    /// Values written to torque registers, in order.
    pub torque: Vec<(u8, bool)>,
    /// Where each servo was last read, counts.
    pub present: BTreeMap<u8, i64>,
    /// How many goal writes there had been when each fault was put in.
    pub put_in: Vec<usize>,
    /// EEPROM registers that were written.
    pub eeprom: Vec<(u8, u16)>,
    moving: usize,
    moved_at: Option<Instant>,
    looks: usize,
    asked: u16,
    /// Bytes of each in the one answer of several, where that was asked for.
    fast: Option<usize>,
}

/// The other end of the command's line.
pub struct Tap {
    path: String,
    seen: Arc<Mutex<Seen>>,
    world: Arc<Mutex<World>>,
    over: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
    _door: Door,
}

fn lock<T>(shared: &Mutex<T>) -> MutexGuard<'_, T> {
    shared.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Tap {
    /// `robot` behind a port; each deed is done once, in order, at its moment.
    pub fn open(robot: &str, dialect: Dialect, deeds: Vec<(Moment, Deed)>) -> Tap {
        let file = gaitway_profiles::robot(robot).expect("a shipped robot");
        let options = Options { permit_eeprom: true, ..Options::default() };
        let world = Arc::new(Mutex::new(World::new(&file, options).expect("a virtual robot")));
        let local = std::net::SocketAddr::from(([127, 0, 0, 1], 0));
        let door = Door::open_tcp(Arc::clone(&world), 0, local).expect("a TCP port");
        let address = door.path().display().to_string();
        let robot_end = TcpStream::connect(address.trim_start_matches("tcp:")).expect("the robot");
        robot_end.set_nodelay(true).expect("an option");
        let listener = TcpListener::bind(local).expect("a TCP port");
        let path = format!("tcp:{}", listener.local_addr().expect("its address"));
        let seen = Arc::new(Mutex::new(Seen::default()));
        let over = Arc::new(AtomicBool::new(false));
        let mut relay = Relay {
            listener,
            host: None,
            robot: robot_end,
            dialect,
            seen: Arc::clone(&seen),
            over: Arc::clone(&over),
            deeds: deeds.into(),
            from_host: Vec::new(),
            from_robot: Vec::new(),
        };
        let thread = std::thread::spawn(move || relay.run());
        Tap { path, seen, world, over, thread: Some(thread), _door: door }
    }

    /// What the command opens.
    pub fn port(&self) -> &str {
        &self.path
    }

    /// The robot itself.
    pub fn world(&self) -> MutexGuard<'_, World> {
        lock(&self.world)
    }

    /// What passed so far.
    pub fn seen(&self) -> MutexGuard<'_, Seen> {
        lock(&self.seen)
    }

    /// Ends the relay: what passed is complete.
    pub fn close(&mut self) {
        self.over.store(true, Ordering::Release);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

impl Drop for Tap {
    fn drop(&mut self) {
        self.close();
    }
}

struct Relay {
    listener: TcpListener,
    /// The command, while it has the line open.
    host: Option<TcpStream>,
    robot: TcpStream,
    dialect: Dialect,
    seen: Arc<Mutex<Seen>>,
    over: Arc<AtomicBool>,
    deeds: std::collections::VecDeque<(Moment, Deed)>,
    from_host: Vec<u8>,
    from_robot: Vec<u8>,
}

impl Relay {
    fn run(&mut self) {
        let mut chunk = [0; 4096];
        loop {
            let patience = Timespec { tv_sec: 0, tv_nsec: 20_000_000 };
            let caller = match &self.host {
                Some(host) => PollFd::new(host, PollFlags::IN),
                None => PollFd::new(&self.listener, PollFlags::IN),
            };
            let mut waiting = [caller, PollFd::new(&self.robot, PollFlags::IN)];
            let ready = poll(&mut waiting, Some(&patience)).unwrap_or(0);
            let [caller, robot] = waiting.map(|fd| fd.revents().contains(PollFlags::IN));
            if ready == 0 && self.over.load(Ordering::Acquire) {
                return;
            }
            if caller {
                self.take_from_host(&mut chunk);
            }
            if robot {
                let count = self.robot.read(&mut chunk).unwrap_or(0);
                if count == 0 {
                    return;
                }
                self.from_robot.extend_from_slice(&chunk[..count]);
                for word in self.dialect.take_words(&mut self.from_robot, false) {
                    self.heard_robot(&word);
                }
                if let Some(host) = &mut self.host {
                    let _ = host.write_all(&chunk[..count]);
                }
            }
        }
    }

    /// Takes the call of a command that opens the line, or what it says.
    fn take_from_host(&mut self, chunk: &mut [u8]) {
        let Some(host) = &mut self.host else {
            let (host, _) = self.listener.accept().expect("a command");
            host.set_nodelay(true).expect("an option");
            self.host = Some(host);
            return;
        };
        let count = host.read(chunk).unwrap_or(0);
        if count == 0 {
            // It has closed the line, or is dead.
            self.host = None;
            return;
        }
        self.from_host.extend_from_slice(&chunk[..count]);
        for word in self.dialect.take_words(&mut self.from_host, true) {
            self.heard_host(&word);
        }
        let _ = self.robot.write_all(&chunk[..count]);
    }

    fn heard_robot(&mut self, word: &Word) {
        let Word::Status { id, data } = word else { return };
        let mut seen = lock(&self.seen);
        let asked = seen.asked;
        if let Some(question) = seen.questions.last_mut() {
            question.statuses += 1;
            question.answered = Some(Instant::now());
        }
        for (id, data) in Dialect::answers(*id, data, seen.fast) {
            if let Some(counts) = self.dialect.counts_at(self.dialect.present(), asked, &data) {
                seen.present.insert(id, counts);
            }
        }
    }

    fn heard_host(&mut self, word: &Word) {
        let mut seen = lock(&self.seen);
        let is_first = seen.asked == 0 && seen.goals.is_empty() && seen.torque.is_empty();
        let (is_ram, is_torque, is_goal, is_unlock) = seen.note(word, self.dialect);
        let now = Instant::now();
        let Some((moment, _)) = self.deeds.front() else { return };
        let since = seen.put_in.last().copied().unwrap_or(0);
        let is_it = match *moment {
            Moment::First => is_first,
            Moment::Arming => is_ram,
            Moment::Torque => is_torque,
            Moment::Moving(count) => is_goal && seen.moving >= count,
            Moment::After(time) => is_goal && seen.moved_at.is_some_and(|at| now - at >= time),
            Moment::Goals(count) => is_goal && seen.goals.len() >= since + count,
            Moment::Looks(count) => seen.looks >= count && !seen.torque.is_empty(),
            Moment::Unlocked => is_unlock,
        };
        if is_it {
            let goals = seen.goals.len();
            seen.put_in.push(goals);
            seen.looks = 0;
            drop(seen);
            if let Some((_, mut deed)) = self.deeds.pop_front() {
                deed();
            }
        }
    }
}

/// The register of a Feetech that keeps its EEPROM closed.
const LOCK: u16 = 55;

impl Seen {
    /// Takes one word of the host: whether it writes outside EEPROM, torque, goals, opens EEPROM.
    fn note(&mut self, word: &Word, dialect: Dialect) -> (bool, bool, bool, bool) {
        let (address, items) = match word {
            Word::Read { address } | Word::FastRead { address, .. } => {
                self.asked = *address;
                self.fast = match word {
                    Word::FastRead { length, .. } => Some(*length),
                    _ => None,
                };
                let asked = Instant::now();
                let (statuses, answered) = (0, None);
                self.questions.push(Question { address: *address, asked, statuses, answered });
                self.looks += usize::from(*address == dialect.present());
                return (false, false, false, false);
            }
            Word::Write { id, address, data } => (*address, vec![(*id, data.clone())]),
            Word::SyncWrite { address, items } => (*address, items.clone()),
            Word::Status { .. } | Word::Other => return (false, false, false, false),
        };
        let mut goals = BTreeMap::new();
        let (mut is_torque, mut is_unlock) = (false, false);
        for (id, data) in &items {
            if address < dialect.ram() {
                self.eeprom.push((*id, address));
            }
            let at = |register: u16| data.get(usize::from(register.checked_sub(address)?)).copied();
            if let Some(value) = at(dialect.torque()) {
                self.torque.push((*id, value != 0));
                is_torque = true;
            }
            is_unlock |= dialect == Dialect::Feetech && at(LOCK) == Some(0);
            if let Some(counts) = dialect.counts_at(dialect.goal().0, address, data) {
                goals.insert(*id, counts);
            }
        }
        let is_goal = !goals.is_empty();
        if is_goal {
            let now = Instant::now();
            if self.goals.last().is_some_and(|(_, before)| *before != goals) {
                self.moving += 1;
                self.moved_at.get_or_insert(now);
            }
            self.goals.push((now, goals));
        }
        (address >= dialect.ram(), is_torque, is_goal, is_unlock)
    }
}
