//! A real-time door: one line of a world behind a pseudo-terminal or a TCP port, for programs that
//! want a serial port.
//!
//! The world's clock follows real time while a door is open. The program's line speed is read from
//! its end of the terminal at each write, so a wrong one is not understood, as on hardware; over
//! TCP nobody tells a speed, and the bytes go out at that of the robot file. One thread serves the
//! door and sleeps until bytes come or a status is due.
//!
//! The thread may wake late; when bytes were written is therefore known within bounds: after the door
//! had last looked and found nothing, and before it read them. (A read that finds nothing waits for
//! the kernel's worker that carries a terminal's bytes, so nothing is on its way then.) The referee
//! judges by these bounds.
//!
//! A CAN line is behind a USB-CAN adapter that speaks slcan, whatever the speed of the terminal. For
//! other ways to carry its frames there is [`LiveCan`].

mod live_can;
mod pace;
mod patience;
mod tcp;
mod terminal;

use crate::World;
use crate::can::slcan::Adapter;
use crate::line::Plugged;
pub use live_can::LiveCan;
pub(crate) use pace::Pace;
pub use patience::PatientTime;
use rustix::event::{EventfdFlags, PollFd, PollFlags, Timespec, eventfd, poll};
use rustix::fd::{AsFd, BorrowedFd, OwnedFd};
use rustix::io::Errno;
use std::fs;
use std::io::{self, ErrorKind};
use std::net::SocketAddr;
use std::num::NonZeroU64;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use tcp::TcpEnd;
pub(crate) use terminal::Terminal;

/// The world is moved on at least this often, so that nothing piles up in a long silence.
const KEEP_UP_NS: u64 = 250_000_000;
/// A body costs more, and nobody who asks is to wait for what it did in a quarter of a second.
const BEAR_NS: u64 = 10_000_000;

/// Bytes taken of a program at once; a program that writes without end must not hold the door.
const MOST_TAKEN: usize = 1 << 16;

/// Frames an adapter holds for its line; CANable's firmware has as many.
const ADAPTER_FRAMES: usize = 64;

/// Why a door cannot be opened.
#[derive(Debug, thiserror::Error)]
pub enum DoorError {
    /// The world has no line with this number, or none of the kind that is wanted.
    #[error("the world has no such line {0}")]
    NoLine(usize),
    /// The system gives no pseudo-terminal.
    #[error("no pseudo-terminal: {0}")]
    Terminal(#[from] Errno),
    /// The system gives no such port.
    #[error("nobody can listen at {address}: {cause}")]
    Tcp {
        /// Where.
        address: SocketAddr,
        /// Why.
        cause: io::Error,
    },
    /// Something else is where the link should be.
    #[error("{} exists and is not a link left over from a closed door", .0.display())]
    LinkTaken(PathBuf),
    /// The link cannot be made.
    #[error("{} cannot be made: {cause}", path.display())]
    Link {
        /// Where.
        path: PathBuf,
        /// Why.
        cause: io::Error,
    },
    /// The system gives no thread.
    #[error("no thread: {0}")]
    Thread(io::Error),
}

/// An open door. Dropping it closes the terminal or port, which loses bytes not yet read, and
/// removes the link.
pub struct Door {
    path: PathBuf,
    place: Arc<Mutex<Placement>>,
    bell: Arc<Bell>,
    thread: Option<JoinHandle<()>>,
}

/// Where programs find a door at the moment; an adapter pulled out is nowhere.
#[derive(Clone, Debug, Default)]
struct Placement {
    path: Option<PathBuf>,
    link: Option<PathBuf>,
}

/// Wakes the serving thread, so that it looks again or ends.
pub(crate) struct Bell {
    stop: AtomicBool,
    event: OwnedFd,
}

impl Bell {
    pub fn ring(&self) {
        let _ = rustix::io::write(&self.event, &1_u64.to_ne_bytes());
    }

    fn hush(&self) {
        let _ = rustix::io::read(&self.event, &mut [0_u8; 8]);
    }
}

impl Door {
    /// Opens a pseudo-terminal on a line and serves it until the door is dropped. `link`, if given,
    /// becomes a symbolic link to it.
    ///
    /// # Errors
    /// No such line, no terminal or thread to be had, or a link that cannot be made; a file, or a
    /// link to something that exists, is never replaced.
    pub fn open(
        world: Arc<Mutex<World>>,
        line: usize,
        link: Option<&Path>,
    ) -> Result<Door, DoorError> {
        let baud_bps = lock(&world).line_baud_bps(line).ok_or(DoorError::NoLine(line))?;
        let terminal = Terminal::open(terminal_bps(baud_bps))?;
        let path = terminal.path().to_path_buf();
        if let Some(link) = link {
            make_link(&path, link)?;
        }
        let link = link.map(Path::to_path_buf);
        Door::serve(world, line, baud_bps, End::Terminal(terminal), path, link)
    }

    /// As [`Door::open`], for a host in this process: the world's time goes with `time`, which waits
    /// for the host and this door. The host tells `time` when it sleeps, reads and writes.
    ///
    /// # Errors
    /// As [`Door::open`].
    pub fn open_patient(
        world: Arc<Mutex<World>>,
        line: usize,
        time: &Arc<PatientTime>,
    ) -> Result<Door, DoorError> {
        lock(&world).patient_pace(time);
        Door::open(world, line, None)
    }

    /// Listens at a TCP port for one program at a time, who sends and receives the line's bytes as
    /// they are; port 0 lets the system choose. Any program that reaches the address can move the
    /// virtual robot: give a loopback address unless that is wanted.
    ///
    /// # Errors
    /// No such line, a port that cannot be had, or no thread.
    pub fn open_tcp(
        world: Arc<Mutex<World>>,
        line: usize,
        address: SocketAddr,
    ) -> Result<Door, DoorError> {
        let baud_bps = lock(&world).line_baud_bps(line).ok_or(DoorError::NoLine(line))?;
        let end = TcpEnd::listen(address).map_err(|cause| DoorError::Tcp { address, cause })?;
        let path = PathBuf::from(format!("tcp:{}", end.address()));
        Door::serve(world, line, baud_bps, End::Tcp(end), path, None)
    }

    fn serve(
        world: Arc<Mutex<World>>,
        line: usize,
        baud_bps: u32,
        end: End,
        path: PathBuf,
        link: Option<PathBuf>,
    ) -> Result<Door, DoorError> {
        let pace = lock(&world).pace();
        let plugged = lock(&world).plugged(line).ok_or(DoorError::NoLine(line))?.clone();
        let adapter = lock(&world).can_line_mut(line).map(|can| {
            can.set_queue(ADAPTER_FRAMES);
            Adapter::new(can.options())
        });
        let event = eventfd(0, EventfdFlags::CLOEXEC | EventfdFlags::NONBLOCK)?;
        let bell = Arc::new(Bell { stop: AtomicBool::new(false), event });
        lock(&world).add_bell(&bell);
        let resets = lock(&world).resets();
        let place = Arc::new(Mutex::new(Placement { path: Some(path.clone()), link }));
        let began_ns = pace.began_ns();
        let mut server = Server {
            world,
            line,
            baud_bps,
            pace,
            end,
            adapter,
            pending: Vec::new(),
            just_read: false,
            pending_since_ns: began_ns,
            looked_ns: began_ns,
            kept_up_ns: began_ns,
            resets,
            plugged,
            place: Arc::clone(&place),
            bell: Arc::clone(&bell),
        };
        let mut door = Door { path, place, bell, thread: None };
        let spawned = std::thread::Builder::new().name(format!("door {line}")).spawn(move || {
            // A late wake-up would only make the line seem slower than it is.
            let _ = rustix::thread::set_current_timer_slack(NonZeroU64::new(1));
            // The terminal is gone if this fails; the program at its other end sees a hang-up.
            let _ = server.run();
            server.pace.door_closes(server.line);
        });
        door.thread = Some(spawned.map_err(DoorError::Thread)?);
        Ok(door)
    }

    /// What programs open, as it was at first: the path of the terminal, or `tcp:ADDRESS`.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// What programs can open now; nothing while the adapter is pulled out.
    pub fn current_path(&self) -> Option<PathBuf> {
        self.place.lock().unwrap_or_else(PoisonError::into_inner).path.clone()
    }
}

impl Drop for Door {
    fn drop(&mut self) {
        self.bell.stop.store(true, Ordering::Release);
        self.bell.ring();
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
        self.place.lock().unwrap_or_else(PoisonError::into_inner).remove_link();
    }
}

impl Placement {
    /// Removes the link if it is this door's.
    fn remove_link(&self) {
        if let (Some(link), Some(path)) = (&self.link, &self.path)
            && fs::read_link(link).is_ok_and(|target| target == *path)
        {
            let _ = fs::remove_file(link);
        }
    }
}

/// How a terminal is set up at first; behind an adapter its speed means nothing.
fn terminal_bps(line_bps: u32) -> u32 {
    if line_bps == 0 { 115_200 } else { line_bps }
}

fn lock(world: &Mutex<World>) -> MutexGuard<'_, World> {
    // A world whose other user panicked is still a world.
    world.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Makes `link` point to `path`, in one step, in place of nothing but a dangling or an equal link.
pub(crate) fn make_link(path: &Path, link: &Path) -> Result<(), DoorError> {
    let failed = |cause| DoorError::Link { path: link.to_path_buf(), cause };
    match symlink(path, link) {
        Err(taken) if taken.kind() == ErrorKind::AlreadyExists => {}
        done => return done.map_err(failed),
    }
    let stale = match fs::read_link(link) {
        Ok(target) => target == path || !link.exists(),
        Err(_) => false,
    };
    if !stale {
        return Err(DoorError::LinkTaken(link.to_path_buf()));
    }
    let mut beside = link.as_os_str().to_os_string();
    beside.push(format!(".{}", std::process::id()));
    symlink(path, &beside).map_err(failed)?;
    fs::rename(&beside, link).map_err(|cause| {
        let _ = fs::remove_file(&beside);
        failed(cause)
    })
}

/// The simulator's end of what a program opens.
enum End {
    Terminal(Terminal),
    Tcp(TcpEnd),
}

impl End {
    /// What to wait for; without `hungry` not for bytes.
    fn waits_for(&self, hungry: bool) -> Vec<(BorrowedFd<'_>, PollFlags)> {
        match self {
            End::Terminal(terminal) => terminal.waits_for(hungry),
            End::Tcp(tcp) => tcp.waits_for(hungry),
        }
    }

    /// Takes what a program has written, if it is wanted, and sees who comes and goes.
    fn read(&mut self, hungry: bool, bytes: &mut [u8]) -> Result<usize, Errno> {
        match self {
            End::Terminal(terminal) => terminal.read(hungry, bytes),
            End::Tcp(tcp) => Ok(tcp.read(hungry, bytes)),
        }
    }

    /// Takes what the same program has written besides, before it is served.
    fn read_more(&mut self, bytes: &mut [u8]) -> Result<usize, Errno> {
        match self {
            End::Terminal(terminal) => terminal.read(true, bytes),
            End::Tcp(tcp) => Ok(tcp.read_more(bytes)),
        }
    }

    /// What does not fit into the program's buffer is lost, as in an overrun, and so is what comes
    /// while nobody is there. How many bytes are there to be read.
    fn write(&mut self, bytes: &[u8]) -> Result<usize, Errno> {
        match self {
            End::Terminal(terminal) => terminal.write(bytes),
            End::Tcp(tcp) => Ok(tcp.write(bytes)),
        }
    }
}

struct Server {
    world: Arc<Mutex<World>>,
    line: usize,
    /// Of the robot file.
    baud_bps: u32,
    pace: Pace,
    end: End,
    /// Between the program and a CAN line.
    adapter: Option<Adapter>,
    /// Bytes of the program that the line did not take yet.
    pending: Vec<u8>,
    /// They have come since the world was looked at last.
    just_read: bool,
    /// When the program may have written them at the earliest.
    pending_since_ns: u64,
    /// When nothing more of the program was there.
    looked_ns: u64,
    /// When the whole world was moved on last.
    kept_up_ns: u64,
    /// Resets of the world that it has seen.
    resets: u64,
    plugged: Plugged,
    place: Arc<Mutex<Placement>>,
    bell: Arc<Bell>,
}

impl Server {
    fn run(&mut self) -> Result<(), Errno> {
        let mut wake_ns = self.pace.now_ns();
        loop {
            self.wait(wake_ns)?;
            self.bell.hush();
            if self.bell.stop.load(Ordering::Acquire) {
                return Ok(());
            }
            self.read()?;
            wake_ns = self.turn()?;
        }
    }

    /// Takes all that the program has written.
    fn read(&mut self) -> Result<(), Errno> {
        let mut bytes = [0_u8; 4096];
        let hungry = self.pending.is_empty();
        self.just_read = hungry;
        let mut asked_ns = self.pace.now_ns();
        let mut count = self.end.read(hungry, &mut bytes)?;
        if !hungry {
            return Ok(());
        }
        self.pending_since_ns = self.looked_ns;
        while count > 0 {
            self.pending.extend_from_slice(&bytes[..count]);
            self.pace.door_has_read(self.line, count);
            if self.pending.len() >= MOST_TAKEN {
                return Ok(());
            }
            asked_ns = self.pace.now_ns();
            count = self.end.read_more(&mut bytes)?;
        }
        self.looked_ns = asked_ns;
        Ok(())
    }

    /// Sleeps until bytes come, the bell rings or it is `wake_ns`.
    fn wait(&self, wake_ns: u64) -> Result<(), Errno> {
        let left_ns = self.pace.door_sleeps(self.line, wake_ns, self.pending.is_empty());
        let timeout = Timespec {
            tv_sec: (left_ns / 1_000_000_000) as i64,
            tv_nsec: (left_ns % 1_000_000_000) as i64,
        };
        let mut doors = vec![PollFd::from_borrowed_fd(self.bell.event.as_fd(), PollFlags::IN)];
        for (end, flags) in self.end.waits_for(self.pending.is_empty()) {
            doors.push(PollFd::from_borrowed_fd(end, flags));
        }
        match poll(&mut doors, Some(&timeout)) {
            Ok(_) | Err(Errno::INTR) => Ok(()),
            Err(errno) => Err(errno),
        }
    }

    /// Hands the program's bytes to the line and what is due to the program; says when to come
    /// back.
    fn turn(&mut self) -> Result<u64, Errno> {
        let baud_bps = match &self.end {
            End::Terminal(terminal) if !self.pending.is_empty() => terminal.baud_bps()?,
            _ => self.baud_bps,
        };
        let mut out = [0_u8; 4096];
        let (pace, line) = (self.pace.clone(), self.line);
        let tell = |end: &mut End, bytes: &[u8]| -> Result<(), Errno> {
            pace.door_has_written(line, end.write(bytes)?);
            Ok(())
        };
        let shared = Arc::clone(&self.world);
        let mut world = lock(&shared);
        let now_ns = self.pace.now_ns();
        if world.resets() != self.resets {
            self.resets = world.resets();
            self.begin_anew(now_ns)?;
        }
        world.run_until(now_ns);
        if let Some(plugged) = world.plugged(self.line).filter(|plugged| **plugged != self.plugged)
        {
            let plugged = plugged.clone();
            self.replug(plugged)?;
        }
        if let Some(adapter) = &mut self.adapter {
            let pending = std::mem::take(&mut self.pending);
            let since_ns = self.pending_since_ns;
            let said = adapter
                .hear(&pending, |frame| world.can_send_noticed(line, frame, since_ns).is_ok());
            if !said.is_empty() {
                tell(&mut self.end, &said)?;
            }
            while let Some(heard) = world.can_receive(line, now_ns) {
                tell(&mut self.end, &adapter.tell(&heard, now_ns))?;
            }
        } else if !self.pending.is_empty() {
            let since_ns = self.pending_since_ns;
            let taken = world.transmit_noticed(self.line, &self.pending, baud_bps, since_ns);
            self.pending.drain(..taken);
        }
        if let End::Terminal(terminal) = &mut self.end {
            terminal.stop_writes(world.blocked_until_ns(self.line).is_some())?;
        }
        loop {
            let count = world.receive(self.line, &mut out, now_ns);
            if count == 0 {
                break;
            }
            tell(&mut self.end, &out[..count])?;
        }
        let keep_up_ns = if world.has_weight() { BEAR_NS } else { KEEP_UP_NS };
        if now_ns >= self.kept_up_ns + keep_up_ns {
            self.kept_up_ns = now_ns;
            world.keep_up();
        }
        let next_ns = world.next_on_line_ns(self.line).unwrap_or(u64::MAX);
        Ok(next_ns.min(now_ns + keep_up_ns))
    }

    /// The world was reset: what the line has not taken is lost, and what the program has not read. What
    /// was read just now may have been written since.
    fn begin_anew(&mut self, now_ns: u64) -> Result<(), Errno> {
        if !self.just_read {
            self.pending.clear();
        }
        (self.pending_since_ns, self.looked_ns, self.kept_up_ns) = (now_ns, now_ns, now_ns);
        match &self.end {
            End::Terminal(terminal) => terminal.forget_unread(),
            End::Tcp(_) => Ok(()),
        }
    }

    /// The adapter was pulled out or plugged in.
    fn replug(&mut self, plugged: Plugged) -> Result<(), Errno> {
        let mut place = self.place.lock().unwrap_or_else(PoisonError::into_inner);
        place.remove_link();
        place.path = None;
        self.pending.clear();
        self.pace.door_closes(self.line);
        if let Some(adapter) = &mut self.adapter {
            adapter.restart();
        }
        match &mut self.end {
            End::Terminal(terminal) => terminal.hang_up(),
            End::Tcp(tcp) => tcp.hang_up(),
        }
        if plugged.now {
            match &mut self.end {
                End::Terminal(terminal) => {
                    // The old one is held until the new one is there, so the name is another.
                    *terminal = Terminal::open(terminal_bps(self.baud_bps))?;
                    let path = terminal.path().to_path_buf();
                    place.link = plugged.link.clone().or(place.link.take());
                    if let Some(link) = &place.link {
                        // What is in the way stays there; the terminal has its own name.
                        let _ = make_link(&path, link);
                    }
                    place.path = Some(path);
                }
                End::Tcp(tcp) => {
                    tcp.come_back();
                    place.path = Some(PathBuf::from(format!("tcp:{}", tcp.address())));
                }
            }
        }
        drop(place);
        self.plugged = plugged;
        Ok(())
    }
}
