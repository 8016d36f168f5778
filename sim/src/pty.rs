//! A real-time door: one line of a world behind a pseudo-terminal, for programs that want a serial
//! port.
//!
//! The world's clock follows real time while a door is open. The program's line speed is read from
//! its end of the terminal at each write, so a wrong one is not understood, as on hardware. One
//! thread serves the door and sleeps until bytes come or a status is due.

use crate::World;
use rustix::event::{EventfdFlags, PollFd, PollFlags, Timespec, eventfd, poll};
use rustix::fd::{AsFd, OwnedFd};
use rustix::fs::{Mode, OFlags};
use rustix::io::Errno;
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};
use std::ffi::OsStr;
use std::fs;
use std::io::{self, ErrorKind};
use std::num::NonZeroU64;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::Instant;

/// Why a door cannot be opened.
#[derive(Debug, thiserror::Error)]
pub enum DoorError {
    /// The world has no line with this number.
    #[error("the world has no line {0}")]
    NoLine(usize),
    /// The system gives no pseudo-terminal.
    #[error("no pseudo-terminal: {0}")]
    Terminal(#[from] Errno),
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

/// An open door. Dropping it closes the terminal, which loses bytes not yet read, and removes the
/// link.
pub struct Door {
    path: PathBuf,
    link: Option<PathBuf>,
    bell: Arc<Bell>,
    thread: Option<JoinHandle<()>>,
}

/// Wakes the serving thread so that it ends.
struct Bell {
    stop: AtomicBool,
    event: OwnedFd,
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
        let (baud_bps, epoch) = {
            let mut world = lock(&world);
            let baud_bps = world.line_baud_bps(line).ok_or(DoorError::NoLine(line))?;
            (baud_bps, world.epoch())
        };
        let (master, slave, path) = open_terminal(baud_bps)?;
        let event = eventfd(0, EventfdFlags::CLOEXEC | EventfdFlags::NONBLOCK)?;
        let bell = Arc::new(Bell { stop: AtomicBool::new(false), event });
        if let Some(link) = link {
            make_link(&path, link)?;
        }
        let mut door = Door { path, link: link.map(Path::to_path_buf), bell, thread: None };
        let server = Server { world, line, epoch, master, slave, bell: Arc::clone(&door.bell) };
        let spawned = std::thread::Builder::new().name(format!("door {line}")).spawn(move || {
            // A late wake-up would only make the line seem slower than it is.
            let _ = rustix::thread::set_current_timer_slack(NonZeroU64::new(1));
            // The terminal is gone if this fails; the program at its other end sees a hang-up.
            let _ = server.serve();
        });
        door.thread = Some(spawned.map_err(DoorError::Thread)?);
        Ok(door)
    }

    /// The program's end of the terminal.
    pub fn path(&self) -> &Path {
        &self.path
    }
}

impl Drop for Door {
    fn drop(&mut self) {
        self.bell.stop.store(true, Ordering::Release);
        let _ = rustix::io::write(&self.bell.event, &1_u64.to_ne_bytes());
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
        if let Some(link) = &self.link
            && fs::read_link(link).is_ok_and(|target| target == self.path)
        {
            let _ = fs::remove_file(link);
        }
    }
}

fn lock(world: &Mutex<World>) -> MutexGuard<'_, World> {
    // A world whose other user panicked is still a world.
    world.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Both ends of a raw terminal, and the path of the program's. The end is kept open here so that
/// the terminal outlives the programs that come and go.
fn open_terminal(baud_bps: u32) -> Result<(OwnedFd, OwnedFd, PathBuf), Errno> {
    let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC)?;
    grantpt(&master)?;
    unlockpt(&master)?;
    let name = ptsname(&master, Vec::new())?;
    let path = PathBuf::from(OsStr::from_bytes(name.as_bytes()));
    let slave =
        rustix::fs::open(&path, OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC, Mode::empty())?;
    let mut settings = tcgetattr(&slave)?;
    settings.make_raw();
    settings.set_speed(baud_bps)?;
    tcsetattr(&slave, OptionalActions::Now, &settings)?;
    rustix::fs::fcntl_setfl(&master, OFlags::RDWR | OFlags::NONBLOCK)?;
    Ok((master, slave, path))
}

/// Makes `link` point to `path`, in one step, in place of nothing but a dangling or an equal link.
fn make_link(path: &Path, link: &Path) -> Result<(), DoorError> {
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

struct Server {
    world: Arc<Mutex<World>>,
    line: usize,
    epoch: (Instant, u64),
    master: OwnedFd,
    slave: OwnedFd,
    bell: Arc<Bell>,
}

impl Server {
    fn serve(&self) -> Result<(), Errno> {
        let mut wake_ns = None;
        let mut bytes = [0_u8; 4096];
        loop {
            self.wait(wake_ns)?;
            if self.bell.stop.load(Ordering::Acquire) {
                return Ok(());
            }
            let count = match rustix::io::read(&self.master, &mut bytes) {
                Ok(count) => count,
                Err(Errno::AGAIN | Errno::INTR) => 0,
                Err(gone) => return Err(gone),
            };
            wake_ns = self.turn(&bytes[..count])?;
        }
    }

    /// World time that real time has reached.
    fn now_ns(&self) -> u64 {
        let (moment, then_ns) = self.epoch;
        then_ns + moment.elapsed().as_nanos() as u64
    }

    /// Sleeps until bytes come, the bell rings or it is `wake_ns`.
    fn wait(&self, wake_ns: Option<u64>) -> Result<(), Errno> {
        let timeout = wake_ns.map(|wake_ns| {
            let left_ns = wake_ns.saturating_sub(self.now_ns());
            Timespec {
                tv_sec: (left_ns / 1_000_000_000) as i64,
                tv_nsec: (left_ns % 1_000_000_000) as i64,
            }
        });
        let mut doors = [
            PollFd::from_borrowed_fd(self.master.as_fd(), PollFlags::IN),
            PollFd::from_borrowed_fd(self.bell.event.as_fd(), PollFlags::IN),
        ];
        match poll(&mut doors, timeout.as_ref()) {
            Ok(_) | Err(Errno::INTR) => Ok(()),
            Err(errno) => Err(errno),
        }
    }

    /// Hands the program's bytes to the line and what is due to the program; says when to come
    /// back.
    fn turn(&self, bytes: &[u8]) -> Result<Option<u64>, Errno> {
        let baud_bps = if bytes.is_empty() { 0 } else { tcgetattr(&self.slave)?.output_speed() };
        let mut out = [0_u8; 4096];
        let mut world = lock(&self.world);
        let now_ns = self.now_ns();
        world.run_until(now_ns);
        world.transmit(self.line, bytes, baud_bps);
        loop {
            let count = world.receive(self.line, &mut out, now_ns);
            if count == 0 {
                return Ok(world.next_on_line_ns(self.line));
            }
            // What does not fit into the program's buffer is lost, as in an overrun.
            match rustix::io::write(&self.master, &out[..count]) {
                Ok(_) | Err(Errno::AGAIN | Errno::INTR) => {}
                Err(gone) => return Err(gone),
            }
        }
    }
}
