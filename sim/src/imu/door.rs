//! A virtual sensor behind a pseudo-terminal, or as a SlimeVR tracker on the network, in real time.
//!
//! It begins when somebody listens: the terminal is opened, or a server answers the handshake.

use super::{Stage, VirtualImu};
use crate::door::{DoorError, Terminal, make_link};
use std::fs;
use std::net::{Ipv4Addr, SocketAddr, UdpSocket};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// How often an idle door looks whether it is to close.
const LOOK: Duration = Duration::from_millis(20);
/// How often a tracker looks for its server.
const HANDSHAKE: Duration = Duration::from_millis(500);
/// A server sends a heartbeat twice a second; one that was silent for so long is gone.
const SILENCE: Duration = Duration::from_secs(3);
/// What the server answers.
const HELLO: &[u8] = b"\x03Hey OVR =D 5";

/// An open door; dropping it ends the sensor.
pub struct ImuDoor {
    path: PathBuf,
    link: Option<PathBuf>,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl ImuDoor {
    /// Opens a pseudo-terminal and plays the sensor there, from the start whenever a program opens
    /// it. `link`, if given, becomes a symbolic link to it.
    ///
    /// # Errors
    /// No terminal or thread to be had, or a link that cannot be made.
    pub fn open(imu: VirtualImu, baud_bps: u32, link: Option<&Path>) -> Result<Self, DoorError> {
        Self::open_on(&Stage::default(), imu, baud_bps, link)
    }

    /// The same for one of several sensors whose motion begins together.
    ///
    /// # Errors
    /// As [`ImuDoor::open`].
    pub fn open_on(
        stage: &Stage,
        imu: VirtualImu,
        baud_bps: u32,
        link: Option<&Path>,
    ) -> Result<Self, DoorError> {
        let mut terminal = Terminal::open(baud_bps)?;
        let path = terminal.path().to_path_buf();
        if let Some(link) = link {
            make_link(&path, link)?;
        }
        let link = link.map(Path::to_path_buf);
        let stage = stage.clone();
        Self::start(path, link, move |stop| {
            let mut commands = [0_u8; 256];
            // Commands are taken and not obeyed: the sensor is set up already.
            let mut is_open = |terminal: &mut Terminal| {
                terminal.read(true, &mut commands).map(|_| terminal.is_open())
            };
            while !stop.load(Ordering::Acquire) {
                match is_open(&mut terminal) {
                    Ok(true) => {}
                    Ok(false) => {
                        std::thread::sleep(LOOK);
                        continue;
                    }
                    Err(_) => return,
                }
                let began = stage.enter();
                play(imu.clone(), began, stop, |bytes| {
                    is_open(&mut terminal) == Ok(true) && terminal.write(bytes).is_ok()
                });
                // What was sent last is still to be read.
                while !stop.load(Ordering::Acquire) && is_open(&mut terminal) == Ok(true) {
                    std::thread::sleep(LOOK);
                }
                stage.leave();
            }
        })
    }

    /// A SlimeVR tracker with this network address that looks for its server at `server`, and again
    /// once that has been silent.
    ///
    /// # Errors
    /// No socket or thread to be had.
    pub fn open_slimevr(
        stage: &Stage,
        imu: VirtualImu,
        server: SocketAddr,
        mac: [u8; 6],
    ) -> Result<Self, DoorError> {
        let failed = |cause| DoorError::Tcp { address: server, cause };
        let socket = UdpSocket::bind((Ipv4Addr::UNSPECIFIED, 0)).map_err(failed)?;
        socket.connect(server).map_err(failed)?;
        socket.set_read_timeout(Some(HANDSHAKE)).map_err(failed)?;
        let path = PathBuf::from(format!("udp:{server}"));
        let stage = stage.clone();
        Self::start(path, None, move |stop| {
            while find_server(&socket, mac, stop) {
                let began = stage.enter();
                let mut heard = Instant::now();
                // Heartbeats are only looked for between samples.
                let _ = socket.set_nonblocking(true);
                play(imu.clone(), began, stop, |datagram| {
                    let _ = socket.send(datagram);
                    let mut heartbeat = [0_u8; 128];
                    if socket.recv(&mut heartbeat).is_ok() {
                        heard = Instant::now();
                    }
                    heard.elapsed() < SILENCE
                });
                let _ = socket.set_nonblocking(false);
                stage.leave();
            }
        })
    }

    fn start(
        path: PathBuf,
        link: Option<PathBuf>,
        serve: impl FnOnce(&AtomicBool) + Send + 'static,
    ) -> Result<Self, DoorError> {
        let stop = Arc::new(AtomicBool::new(false));
        let mut door = Self { path, link, stop, thread: None };
        let stop = Arc::clone(&door.stop);
        let thread = std::thread::Builder::new().name("virtual imu".to_owned());
        door.thread = Some(thread.spawn(move || serve(&stop)).map_err(DoorError::Thread)?);
        Ok(door)
    }

    /// What programs open.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }
}

impl Drop for ImuDoor {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Release);
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

/// Sends each sample when it is due, until the motion is over, `send` fails or it is to stop. What was
/// due before somebody listened is not sent.
fn play(
    mut imu: VirtualImu,
    began: Instant,
    stop: &AtomicBool,
    mut send: impl FnMut(&[u8]) -> bool,
) {
    let entered = Instant::now();
    // Of a motion that is made as it goes nobody knows any more what was long ago.
    imu.skip_to(entered.saturating_duration_since(began).as_secs_f64());
    for sent in imu {
        let due = began + Duration::from_secs_f64(sent.due_s);
        if due < entered {
            continue;
        }
        loop {
            if stop.load(Ordering::Acquire) {
                return;
            }
            let left = due.saturating_duration_since(Instant::now());
            if left.is_zero() {
                break;
            }
            std::thread::sleep(left.min(LOOK));
        }
        if !sent.bytes.is_empty() && !send(&sent.bytes) {
            return;
        }
    }
}

/// Says who it is until a server answers; false if it is to stop.
fn find_server(socket: &UdpSocket, mac: [u8; 6], stop: &AtomicBool) -> bool {
    let mut answer = [0_u8; 128];
    while !stop.load(Ordering::Acquire) {
        // Nobody there yet is an error of the socket too; it is tried again.
        let _ = socket.send(&handshake(mac));
        let count = socket.recv(&mut answer).unwrap_or(0);
        if answer[..count].starts_with(HELLO) {
            return true;
        }
        if count == 0 {
            std::thread::sleep(LOOK);
        }
    }
    false
}

/// Board, sensor and processor kinds, three words, build 19, version "sim", the network address.
fn handshake(mac: [u8; 6]) -> Vec<u8> {
    let mut packet = vec![0, 0, 0, 3, 0, 0, 0, 0, 0, 0, 0, 0];
    for word in [4_u32, 4, 2, 0, 0, 0, 19] {
        packet.extend(word.to_be_bytes());
    }
    packet.push(3);
    packet.extend(b"sim");
    packet.extend(mac);
    packet
}
