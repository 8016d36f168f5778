//! A line with nobody on it but the test: what a client sends, byte for byte, and what it makes of
//! bytes that a servo may well send.

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::{Mode, OFlags};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};
use std::fs::File;
use std::io::{Read, Write};
use std::os::fd::OwnedFd;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;

/// What answers the client: all it has sent since the last answer, and what it is told.
type Answering = Box<dyn FnMut(&[u8]) -> Vec<u8> + Send>;

/// The other end of a client's line.
pub struct Tap {
    path: String,
    heard: Arc<Mutex<Vec<u8>>>,
    over: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
    /// Keeps the terminal alive while no client has it open.
    _client_end: OwnedFd,
}

impl Tap {
    /// A line on which each instruction is answered by `answer`, perhaps with nothing.
    pub fn answering(answer: impl FnMut(&[u8]) -> Vec<u8> + Send + 'static) -> Tap {
        let line = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).expect("a pseudo-terminal");
        grantpt(&line).and_then(|()| unlockpt(&line)).expect("a pseudo-terminal");
        let path = ptsname(&line, Vec::new()).expect("its name").into_string().expect("UTF-8");
        let flags = OFlags::RDWR | OFlags::NOCTTY;
        let client_end = rustix::fs::open(path.as_str(), flags, Mode::empty()).expect("its end");
        let mut settings = tcgetattr(&client_end).expect("settings");
        settings.make_raw();
        tcsetattr(&client_end, OptionalActions::Now, &settings).expect("settings");
        let heard = Arc::new(Mutex::new(Vec::new()));
        let over = Arc::new(AtomicBool::new(false));
        let thread = std::thread::spawn({
            let (heard, over) = (Arc::clone(&heard), Arc::clone(&over));
            let answer = Box::new(answer);
            move || serve(line.into(), &heard, &over, answer)
        });
        Tap { path, heard, over, thread: Some(thread), _client_end: client_end }
    }

    /// A line on which nobody ever answers.
    pub fn silent() -> Tap {
        Tap::answering(|_| Vec::new())
    }

    /// What a client opens.
    pub fn port(&self) -> &str {
        &self.path
    }

    /// All that has been sent, at least `length` bytes of it.
    pub fn heard(&self, length: usize) -> Vec<u8> {
        for _ in 0..10_000 {
            let heard = self.heard.lock().expect("the bytes").clone();
            if heard.len() >= length {
                return heard;
            }
            std::thread::sleep(std::time::Duration::from_millis(1));
        }
        panic!("fewer than {length} bytes in 10 s: {:02X?}", self.heard.lock());
    }
}

impl Drop for Tap {
    fn drop(&mut self) {
        self.over.store(true, Ordering::Release);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

fn serve(mut line: File, heard: &Mutex<Vec<u8>>, over: &AtomicBool, mut answer: Answering) {
    let mut chunk = [0; 1024];
    while !over.load(Ordering::Acquire) {
        let patience = Timespec { tv_sec: 0, tv_nsec: 20_000_000 };
        let mut waiting = [PollFd::new(&line, PollFlags::IN)];
        if !poll(&mut waiting, Some(&patience)).is_ok_and(|ready| ready == 1) {
            continue;
        }
        let Ok(count) = line.read(&mut chunk) else { return };
        heard.lock().expect("the bytes").extend_from_slice(&chunk[..count]);
        let _ = line.write_all(&answer(&chunk[..count]));
    }
}

/// Bytes as printed in a manual.
pub fn hex(text: &str) -> Vec<u8> {
    text.split_whitespace().map(|byte| u8::from_str_radix(byte, 16).expect("hex")).collect()
}

/// True if `bytes` contain `part`.
pub fn contains(bytes: &[u8], part: &[u8]) -> bool {
    bytes.windows(part.len()).any(|window| window == part)
}
