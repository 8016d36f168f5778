//! Sessions over a Unix socket that belongs to the user alone.

use super::{Session, Surroundings};
use crate::World;
use rustix::event::{EventfdFlags, PollFd, PollFlags, Timespec, eventfd, poll};
use rustix::fd::{AsFd, OwnedFd};
use std::fs;
use std::io::{self, ErrorKind, Read, Write};
use std::os::unix::fs::{DirBuilderExt, FileTypeExt, MetadataExt, PermissionsExt};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Programs at once; others are sent away with a word.
const MOST_PROGRAMS: usize = 8;
/// Longest path that programs can connect to, bytes (`sockaddr_un`, unix(7)).
const LONGEST_PATH: usize = 107;
/// How often those who wait or follow are looked after, ns.
const LOOK_NS: i64 = 2_000_000;
/// Longest sleep of the server, s.
const REST_S: i64 = 60;

/// Why there is no socket.
#[derive(Debug, thiserror::Error)]
pub enum SocketError {
    /// Something is there that is no socket left over, or somebody listens at it.
    #[error("{} is there already", .0.display())]
    Taken(PathBuf),
    /// Programs could not name it.
    #[error("{} is longer than the {LONGEST_PATH} bytes of a socket's address", .0.display())]
    TooLong(PathBuf),
    /// The system does not give it.
    #[error("{cannot}: {cause}")]
    System {
        /// What cannot be done.
        cannot: String,
        /// Why.
        cause: io::Error,
    },
}

/// A socket that programs of this user reach past the lines with, until it is dropped.
#[derive(Debug)]
pub struct ControlSocket {
    path: PathBuf,
    /// Which file is ours.
    inode: u64,
    stop: Arc<AtomicBool>,
    bell: Arc<OwnedFd>,
    thread: Option<JoinHandle<()>>,
}

impl ControlSocket {
    /// Listens at `path`, mode 0600. The socket is made in a folder that is this user's alone and then
    /// put in its place, so that at no moment anybody else could open it. Nothing that is there is
    /// replaced, but for a socket at which nobody listens.
    ///
    /// # Errors
    /// Something is there, or the system does not give a socket or thread.
    pub fn listen(
        world: Arc<Mutex<World>>,
        surroundings: Surroundings,
        path: &Path,
    ) -> Result<ControlSocket, SocketError> {
        let system = |cannot: &str| {
            let cannot = format!("{cannot} {}", path.display());
            move |cause: io::Error| SocketError::System { cannot, cause }
        };
        let listener = make(path)?;
        let inode = fs::symlink_metadata(path).map_err(system("cannot look at"))?.ino();
        listener.set_nonblocking(true).map_err(system("cannot listen at"))?;
        let event = eventfd(0, EventfdFlags::CLOEXEC | EventfdFlags::NONBLOCK);
        let event = event.map_err(|errno| system("cannot listen at")(errno.into()))?;
        let (bell, stop) = (Arc::new(event), Arc::new(AtomicBool::new(false)));
        let mut socket = ControlSocket {
            path: path.to_path_buf(),
            inode,
            stop: Arc::clone(&stop),
            bell: Arc::clone(&bell),
            thread: None,
        };
        world.lock().unwrap_or_else(PoisonError::into_inner).keep_journal(true);
        let thread = std::thread::Builder::new().name("control".to_string()).spawn(move || {
            let mut server = Server { world, surroundings, listener, programs: Vec::new() };
            let began = Instant::now();
            while !stop.load(Ordering::Acquire) {
                server.wait(&bell);
                server.turn(began.elapsed());
            }
        });
        socket.thread = Some(thread.map_err(system("no thread for"))?);
        Ok(socket)
    }
}

impl Drop for ControlSocket {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Release);
        let _ = rustix::io::write(&*self.bell, &1_u64.to_ne_bytes());
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
        if fs::symlink_metadata(&self.path).is_ok_and(|found| found.ino() == self.inode) {
            let _ = fs::remove_file(&self.path);
        }
    }
}

fn make(path: &Path) -> Result<UnixListener, SocketError> {
    let failed = |cannot: &str, at: &Path| {
        let cannot = format!("{cannot} {}", at.display());
        move |cause: io::Error| SocketError::System { cannot, cause }
    };
    if path.as_os_str().len() > LONGEST_PATH {
        return Err(SocketError::TooLong(path.to_path_buf()));
    }
    remove_left_over(path)?;
    let beside = match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    // A name of this process, short: it must fit into an address as well.
    let folder = beside.join(format!(".{}", std::process::id()));
    fs::DirBuilder::new().mode(0o700).create(&folder).map_err(failed("cannot make", &folder))?;
    let own = folder.join("s");
    let listener = UnixListener::bind(&own).map_err(failed("cannot listen at", &own));
    let placed = listener.and_then(|listener| {
        let only_mine = fs::Permissions::from_mode(0o600);
        fs::set_permissions(&own, only_mine).map_err(failed("cannot close to others", &own))?;
        // Unlike a renaming this never replaces what has come there meanwhile.
        match fs::hard_link(&own, path) {
            Err(e) if e.kind() == ErrorKind::AlreadyExists => {
                Err(SocketError::Taken(path.to_path_buf()))
            }
            done => done.map(|()| listener).map_err(failed("cannot make", path)),
        }
    });
    let _ = fs::remove_file(&own);
    let _ = fs::remove_dir(&folder);
    placed
}

/// A socket of a process that was killed makes room.
fn remove_left_over(path: &Path) -> Result<(), SocketError> {
    let Ok(found) = fs::symlink_metadata(path) else { return Ok(()) };
    let refused = |e: &io::Error| e.kind() == ErrorKind::ConnectionRefused;
    let left_over = found.file_type().is_socket()
        && UnixStream::connect(path).as_ref().err().is_some_and(refused);
    if !left_over {
        return Err(SocketError::Taken(path.to_path_buf()));
    }
    fs::remove_file(path).map_err(|cause| {
        let cannot = format!("cannot remove {}", path.display());
        SocketError::System { cannot, cause }
    })
}

struct Server {
    world: Arc<Mutex<World>>,
    surroundings: Surroundings,
    listener: UnixListener,
    programs: Vec<Program>,
}

struct Program {
    stream: UnixStream,
    session: Session,
    has_left: bool,
}

impl Server {
    fn wait(&self, bell: &OwnedFd) {
        let expectant = self.programs.iter().any(|program| program.session.is_expectant());
        let timeout = match expectant {
            true => Timespec { tv_sec: 0, tv_nsec: LOOK_NS },
            false => Timespec { tv_sec: REST_S, tv_nsec: 0 },
        };
        let mut ends = vec![
            PollFd::from_borrowed_fd(bell.as_fd(), PollFlags::IN),
            PollFd::from_borrowed_fd(self.listener.as_fd(), PollFlags::IN),
        ];
        for program in &self.programs {
            let mut flags = PollFlags::empty();
            flags.set(PollFlags::IN, program.session.is_hungry());
            flags.set(PollFlags::OUT, !program.session.output().is_empty());
            ends.push(PollFd::from_borrowed_fd(program.stream.as_fd(), flags));
        }
        let _ = poll(&mut ends, Some(&timeout));
    }

    fn turn(&mut self, now: Duration) {
        for program in &mut self.programs {
            program.read();
            let mut world = self.world.lock().unwrap_or_else(PoisonError::into_inner);
            program.session.work(&mut world, now);
            drop(world);
            program.write();
        }
        self.programs.retain(|program| !program.is_over());
        // Who left has made room.
        while let Ok((stream, _)) = self.listener.accept() {
            self.admit(stream);
        }
    }

    fn admit(&mut self, mut stream: UnixStream) {
        if stream.set_nonblocking(true).is_err() {
            return;
        }
        if self.programs.len() >= MOST_PROGRAMS {
            let words = format!(
                "{{\"ok\":false,\"error\":{{\"at\":\"socket\",\"got\":\"one program too many\",\
                 \"allowed\":\"{MOST_PROGRAMS} at once\"}}}}\n"
            );
            let _ = stream.write(words.as_bytes());
            return;
        }
        let session = Session::new(self.surroundings.clone());
        self.programs.push(Program { stream, session, has_left: false });
    }
}

impl Program {
    /// One that has closed its end is served what it has said before.
    fn read(&mut self) {
        let mut block = [0; 1 << 14];
        while !self.has_left && self.session.is_hungry() {
            match self.stream.read(&mut block) {
                Ok(0) => self.has_left = true,
                Ok(count) => self.session.hear(block.get(..count).unwrap_or_default()),
                Err(e) if e.kind() == ErrorKind::Interrupted => {}
                Err(e) if e.kind() == ErrorKind::WouldBlock => return,
                Err(_) => self.has_left = true,
            }
        }
    }

    fn write(&mut self) {
        while !self.session.output().is_empty() {
            match self.stream.write(self.session.output()) {
                Ok(count) if count > 0 => self.session.was_read(count),
                Err(e) if e.kind() == ErrorKind::Interrupted => {}
                Err(e) if e.kind() == ErrorKind::WouldBlock => return,
                _ => {
                    // Nobody will ever read it.
                    self.has_left = true;
                    self.session.was_read(usize::MAX);
                }
            }
        }
    }

    fn is_over(&self) -> bool {
        self.has_left && self.session.is_done() && self.session.output().is_empty()
    }
}
