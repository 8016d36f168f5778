//! The person at the terminal: answers, one line each, read beside the joints.

use crate::cli::output::{prompt, say_over};
use crate::cli::signals::Signals;
use crate::cli::{limp, say};
use crate::error::Error;
use crate::job::calibrate::{Answer, Consent, JointTask, Person, Seen};
use std::io::{BufRead, IsTerminal};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::Duration;

/// Lines of standard input, and signals, which count as the wish to stop.
pub struct Answers {
    lines: Receiver<String>,
    signals: Signals,
    /// Standard error is a terminal.
    is_seen: bool,
    /// The last line there is a range.
    has_range: bool,
}

/// Time between two looks at a joint while nothing is answered.
const LOOK: Duration = Duration::from_millis(5);

impl Answers {
    /// Reads standard input on a thread of its own.
    ///
    /// # Errors
    /// No thread to be had.
    pub fn listen(signals: Signals) -> Result<Self, Error> {
        let (sender, receiver) = channel();
        let read = move || {
            for line in std::io::stdin().lock().lines().map_while(Result::ok) {
                if sender.send(line).is_err() {
                    break;
                }
            }
        };
        std::thread::Builder::new()
            .name("answers".to_owned())
            .spawn(read)
            .map_err(|e| Error::new(format!("no thread: {e}")))?;
        let is_seen = std::io::stderr().is_terminal();
        Ok(Self { lines: receiver, signals, is_seen, has_range: false })
    }
}

impl Answers {
    /// The next line; nothing once there is no more, or a signal came.
    pub fn line(&mut self) -> Option<String> {
        while self.signals.first().is_none() {
            match self.lines.recv_timeout(LOOK) {
                Err(RecvTimeoutError::Timeout) => {}
                line => return line.ok(),
            }
        }
        None
    }
}

impl Person for Answers {
    fn wants_to_stop(&self) -> bool {
        self.signals.first().is_some()
    }

    /// A plain yes, at a terminal only.
    fn consent(&mut self, robot: &str) -> Consent {
        if !std::io::stdin().is_terminal() {
            return Consent::No;
        }
        let _ = prompt(&limp::question(robot));
        loop {
            if self.wants_to_stop() {
                return Consent::Stop;
            }
            match self.lines.recv_timeout(LOOK) {
                Ok(line) if line.trim() == "yes" => return Consent::Yes,
                Ok(_) | Err(RecvTimeoutError::Disconnected) => return Consent::No,
                Err(RecvTimeoutError::Timeout) => {}
            }
        }
    }

    /// No more input is a stop, and so is a signal.
    fn ask(
        &mut self,
        task: JointTask<'_>,
        look: &mut dyn FnMut() -> Result<Option<Seen>, Error>,
    ) -> Result<Answer<()>, Error> {
        say(&question(task));
        self.has_range = false;
        loop {
            if self.wants_to_stop() {
                return Ok(Answer::Stop);
            }
            look()?.into_iter().for_each(|seen| self.tell(seen));
            let line = match self.lines.recv_timeout(LOOK) {
                Ok(line) => line,
                Err(RecvTimeoutError::Timeout) => continue,
                Err(RecvTimeoutError::Disconnected) => return Ok(Answer::Stop),
            };
            // What happened up to the answer belongs to it.
            look()?.into_iter().for_each(|seen| self.tell(seen));
            match line.trim() {
                "" => return Ok(Answer::Go(())),
                "s" => return Ok(Answer::Skip),
                "q" => return Ok(Answer::Stop),
                other => {
                    say(&format!("  {other:?}? Enter goes on, s skips this joint, q stops"));
                    self.has_range = false;
                }
            }
        }
    }

    fn tell(&mut self, seen: Seen) {
        say(&match seen {
            Seen::Joint { number, total } => format!("[{number}/{total}]"),
            Seen::ZeroAt(servo_rad) => {
                format!("  zero where the servo stands at {:.1} deg", servo_rad.to_degrees())
            }
            Seen::TurnsWithServo(true) => "  it turns with its servo".to_owned(),
            Seen::TurnsWithServo(false) => "  it turns against its servo".to_owned(),
            Seen::TooLittle(turned_rad) => {
                format!("  that was only {:.1} deg: further, please", turned_rad.to_degrees())
            }
            // Live where somebody looks on, else line by line.
            Seen::Range { has_grown: false, .. } if !self.is_seen => return,
            Seen::Range { lower_rad, upper_rad, now_rad, .. } => {
                let [lower, upper, now] = [lower_rad, upper_rad, now_rad].map(f64::to_degrees);
                let text = format!("  {lower:.1} to {upper:.1} deg, now {now:.1} deg");
                if self.is_seen && std::mem::replace(&mut self.has_range, true) {
                    return say_over(1, &(text + "\n"));
                }
                text
            }
        });
    }
}

fn question(task: JointTask<'_>) -> String {
    match task {
        JointTask::Zero { joint, id } => {
            format!("{joint} (ID {id}): hold it at its zero, then Enter (s skips it, q stops)")
        }
        JointTask::Positive => {
            "  turn it in its positive direction and hold it there, then Enter".to_owned()
        }
        JointTask::Range => {
            "  move it slowly through its whole range, both ends, then Enter".to_owned()
        }
    }
}
