//! A pseudo-terminal whose other end programs take for a serial port.

use rustix::event::PollFlags;
use rustix::fd::{AsFd, BorrowedFd, OwnedFd};
use rustix::fs::{Mode, OFlags, inotify};
use rustix::io::Errno;
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{
    Action, OptionalActions, QueueSelector, ioctl_tiocnxcl, tcflow, tcflush, tcgetattr, tcsetattr,
};
use std::ffi::OsStr;
use std::mem::MaybeUninit;
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};

/// Both ends of a raw terminal. The program's end is held open here too, so that the terminal
/// outlives the programs that come and go; what the system does when a program closes a real port
/// as the last one is therefore done here.
pub(crate) struct Terminal {
    /// None once hung up.
    master: Option<OwnedFd>,
    slave: OwnedFd,
    path: PathBuf,
    /// Tells of programs that open and close the terminal: those events of it that come with this
    /// number.
    watch: OwnedFd,
    own_events: i32,
    programs: usize,
    stopped: bool,
}

impl Terminal {
    pub fn open(baud_bps: u32) -> Result<Terminal, Errno> {
        let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC)?;
        grantpt(&master)?;
        unlockpt(&master)?;
        let name = ptsname(&master, Vec::new())?;
        let path = PathBuf::from(OsStr::from_bytes(name.as_bytes()));
        let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC;
        let slave = rustix::fs::open(&path, flags, Mode::empty())?;
        let mut settings = tcgetattr(&slave)?;
        settings.make_raw();
        settings.set_speed(baud_bps)?;
        tcsetattr(&slave, OptionalActions::Now, &settings)?;
        rustix::fs::fcntl_setfl(&master, OFlags::RDWR | OFlags::NONBLOCK)?;
        let watch = inotify::init(inotify::CreateFlags::CLOEXEC | inotify::CreateFlags::NONBLOCK)?;
        let events = inotify::WatchFlags::OPEN | inotify::WatchFlags::CLOSE;
        let own_events = inotify::add_watch(&watch, &path, events)?;
        // Equal events in a row are told as one, and could not be counted. Each is told of the
        // folder too, so that no two in a row are equal.
        if let Some(folder) = path.parent() {
            inotify::add_watch(&watch, folder, events)?;
        }
        let (master, programs, stopped) = (Some(master), 0, false);
        Ok(Terminal { master, slave, path, watch, own_events, programs, stopped })
    }

    pub fn path(&self) -> &Path {
        &self.path
    }

    /// True while a program has it open.
    pub const fn is_open(&self) -> bool {
        self.programs > 0
    }

    /// The speed programs have set.
    pub fn baud_bps(&self) -> Result<u32, Errno> {
        Ok(tcgetattr(&self.slave)?.output_speed())
    }

    pub fn waits_for(&self, hungry: bool) -> Vec<(BorrowedFd<'_>, PollFlags)> {
        let master = self.master.iter().filter(|_| hungry);
        let master = master.map(|master| (master.as_fd(), PollFlags::IN));
        master.chain([(self.watch.as_fd(), PollFlags::IN)]).collect()
    }

    pub fn read(&mut self, hungry: bool, bytes: &mut [u8]) -> Result<usize, Errno> {
        let count = match self.master.as_ref().filter(|_| hungry) {
            None => 0,
            Some(master) => match rustix::io::read(master, bytes) {
                Ok(count) => count,
                Err(Errno::AGAIN | Errno::INTR) => 0,
                Err(gone) => return Err(gone),
            },
        };
        // After the bytes: whoever wrote them has opened the terminal before.
        self.see_who_comes_and_goes()?;
        Ok(count)
    }

    fn see_who_comes_and_goes(&mut self) -> Result<(), Errno> {
        let mut buffer = [MaybeUninit::uninit(); 4096];
        let mut events = inotify::Reader::new(&self.watch, &mut buffer);
        loop {
            let event = match events.next() {
                Ok(event) if event.wd() != self.own_events => continue,
                Ok(event) => event.events(),
                Err(Errno::AGAIN | Errno::INTR) => return Ok(()),
                Err(errno) => return Err(errno),
            };
            if event.contains(inotify::ReadFlags::OPEN) {
                self.programs += 1;
            } else if event
                .intersects(inotify::ReadFlags::CLOSE_WRITE | inotify::ReadFlags::CLOSE_NOWRITE)
            {
                self.programs = self.programs.saturating_sub(1);
                if self.programs == 0 {
                    // What nobody read is not for the next, who may open it again.
                    tcflush(&self.slave, QueueSelector::IFlush)?;
                    ioctl_tiocnxcl(&self.slave)?;
                }
            }
        }
    }

    pub fn write(&self, bytes: &[u8]) -> Result<usize, Errno> {
        let Some(master) = self.master.as_ref().filter(|_| self.programs > 0) else {
            return Ok(0);
        };
        match rustix::io::write(master, bytes) {
            Ok(count) => Ok(count),
            Err(Errno::AGAIN | Errno::INTR) => Ok(0),
            Err(gone) => Err(gone),
        }
    }

    /// What programs have not read yet is lost.
    pub fn forget_unread(&self) -> Result<(), Errno> {
        tcflush(&self.slave, QueueSelector::IFlush)
    }

    /// Lets programs wait when they write, or lets them go on.
    pub fn stop_writes(&mut self, stop: bool) -> Result<(), Errno> {
        if stop != self.stopped && self.master.is_some() {
            tcflow(&self.slave, if stop { Action::OOff } else { Action::OOn })?;
            self.stopped = stop;
        }
        Ok(())
    }

    /// Programs see a hang-up; the name stays taken until this value is dropped.
    pub fn hang_up(&mut self) {
        self.master = None;
    }
}
