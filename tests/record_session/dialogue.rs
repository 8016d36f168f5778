//! An operator at a pseudo-terminal who waits for what is said before answering.

use super::person::Person;
use rustix::fd::OwnedFd;
use rustix::fs::{Mode, OFlags};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use std::path::Path;
use std::process::{Child, Stdio};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// Longer nobody waits: something is wrong then.
const PATIENCE: Duration = Duration::from_secs(30);

/// `gaitway record` at a terminal of its own.
pub struct Dialogue<'a> {
    child: Child,
    person: &'a Person,
    terminal: Arc<OwnedFd>,
    said: Arc<Mutex<String>>,
    /// What was expected so far ends here.
    seen: usize,
}

impl<'a> Dialogue<'a> {
    pub fn start(folder: &Path, arguments: &[String], person: &'a Person) -> Self {
        let terminal = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).expect("a terminal");
        grantpt(&terminal).and_then(|()| unlockpt(&terminal)).expect("a terminal of ours");
        let path = ptsname(&terminal, Vec::new()).expect("a name");
        let end = || -> Stdio {
            let flags = OFlags::RDWR | OFlags::NOCTTY;
            rustix::fs::open(path.as_c_str(), flags, Mode::empty()).expect("its end").into()
        };
        person.is_listened_to();
        let child = crate::program::gaitway()
            .current_dir(folder)
            .arg("record")
            .args(arguments)
            .stdin(end())
            .stdout(end())
            .stderr(end())
            .spawn()
            .expect("the command");
        let terminal = Arc::new(terminal);
        let said = Arc::new(Mutex::new(String::new()));
        let (from, to) = (Arc::clone(&terminal), Arc::clone(&said));
        // It ends when the command has closed the terminal.
        std::thread::spawn(move || {
            let mut bytes = [0_u8; 4096];
            while let Ok(count @ 1..) = rustix::io::read(&*from, &mut bytes) {
                to.lock().expect("whole").push_str(&String::from_utf8_lossy(&bytes[..count]));
            }
        });
        Self { child, person, terminal, said, seen: 0 }
    }

    /// Waits until these words are said after those that were expected before.
    pub fn expect(&mut self, words: &str) {
        self.expect_one_of(&[words]);
    }

    /// Waits until one of these is said, and tells which was first.
    pub fn expect_one_of<'w>(&mut self, choices: &[&'w str]) -> &'w str {
        let began = Instant::now();
        loop {
            let said = self.said.lock().expect("whole").clone();
            let found = choices.iter().filter_map(|w| Some((said[self.seen..].find(w)?, *w)));
            if let Some((at, words)) = found.min() {
                self.seen += at + words.len();
                return words;
            }
            assert!(began.elapsed() < PATIENCE, "{choices:?} was not said:\n{said}");
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    /// What is said after what was expected, up to the end of the line.
    pub fn rest_of_line(&mut self) -> String {
        let from = self.seen;
        self.expect("\n");
        let said = self.said.lock().expect("whole");
        said[from..self.seen].trim().to_owned()
    }

    /// All that was said so far, as lines without what makes a terminal of them.
    pub fn said(&self) -> String {
        self.said.lock().expect("whole").replace('\r', "")
    }

    /// Types a line.
    pub fn say(&mut self, line: &str) {
        let bytes = format!("{line}\n").into_bytes();
        let written = rustix::io::write(&*self.terminal, &bytes);
        assert_eq!(written, Ok(bytes.len()));
    }

    /// Presses keys, and no Enter after them.
    pub fn press(&mut self, keys: &str) {
        assert_eq!(rustix::io::write(&*self.terminal, keys.as_bytes()), Ok(keys.len()));
    }

    /// Waits for a question and answers it.
    pub fn answer(&mut self, question: &str, line: &str) {
        self.expect(question);
        self.say(line);
    }

    /// Waits for the end; the exit code.
    pub fn ends(mut self) -> Option<i32> {
        let began = Instant::now();
        let ended = loop {
            match self.child.try_wait().expect("its state") {
                Some(ended) => break ended,
                None if began.elapsed() < 4 * PATIENCE => {
                    std::thread::sleep(Duration::from_millis(10))
                }
                None => {
                    let _ = self.child.kill();
                    panic!("it does not end:\n{}", self.said());
                }
            }
        };
        self.person.is_left();
        ended.code()
    }

    /// Ctrl-C.
    pub fn interrupts(&self) {
        let id = i32::try_from(self.child.id()).ok().and_then(rustix::process::Pid::from_raw);
        rustix::process::kill_process(id.expect("a process"), rustix::process::Signal::INT)
            .expect("interrupted");
    }

    /// As by a power cut.
    pub fn dies(mut self) {
        self.child.kill().expect("killed");
        let _ = self.child.wait();
        self.person.is_left();
    }
}

impl Drop for Dialogue<'_> {
    fn drop(&mut self) {
        // Shown for a test that fails, and with --nocapture.
        println!("{}", self.said.lock().expect("whole"));
        // A test that failed leaves nobody behind.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
