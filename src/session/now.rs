//! What a session asks for at this moment, as a file that other programs read: a light, a projector, a virtual person. It is no
//! part of what the session recorded: it is there while a session is led, and gone afterwards.

use crate::body::worn::Movement;
use crate::error::{Error, ErrorKind, counted};
use serde::{Deserialize, Serialize};
use std::fs::{File, OpenOptions};
use std::io::Read;
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;

/// Its name in the session's folder.
pub const NOW_FILE: &str = "now.json";
/// Version of its form.
pub const NOW_VERSION: u64 = 1;
/// Longer it never is, bytes.
const MOST_BYTES: u64 = 1 << 16;

/// What is asked of subjects.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum NowWanted {
    /// Nothing: the operator is asked, or thinks.
    #[default]
    Wait,
    /// All sensors lie still, on a table.
    LieStill,
    /// The sensors are put on.
    PutOn,
    /// Stand in N pose.
    NPose,
    /// Stand in T pose.
    TPose,
    /// One of the movements of a calibration, there and back.
    Move,
    /// Watch how an action is done.
    Watch,
    /// Try an action; nothing is recorded.
    Practise,
    /// Do an action, again and again: it is recorded.
    Perform,
}

impl NowWanted {
    /// As it stands in the file.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Wait => "wait",
            Self::LieStill => "lie_still",
            Self::PutOn => "put_on",
            Self::NPose => "n_pose",
            Self::TPose => "t_pose",
            Self::Move => "move",
            Self::Watch => "watch",
            Self::Practise => "practise",
            Self::Perform => "perform",
        }
    }
}

/// Movements of a calibration, by the words for them in files.
pub const MOVEMENTS: [(&str, Movement); 4] = [
    ("bow", Movement::Bow),
    ("sit_to_stand", Movement::SitToStand),
    ("bend", Movement::Bend),
    ("raise_arms", Movement::RaiseArms),
];

/// The action that a trial is of.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct NowAction {
    /// Its name.
    pub name: String,
    /// What subjects are told.
    #[serde(default)]
    pub explain: String,
    /// How long it takes once, s, if it ships with gaitway.
    #[serde(default)]
    pub lasts_s: Option<f64>,
    /// Name of the trial, while it is recorded.
    #[serde(default)]
    pub trial: Option<String>,
    /// Good repetitions before this trial, and in it so far.
    #[serde(default)]
    pub good: u32,
    /// Good repetitions wanted.
    #[serde(default)]
    pub wanted: u32,
    /// Bad repetitions in this trial so far.
    #[serde(default)]
    pub bad: u32,
}

/// `now.json`. Keys that a reader does not know are to be passed over; one that changes its meaning makes another version.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Now {
    /// Version of the form; 1.
    pub gaitway_now: u64,
    /// The process that leads the session. Is it gone, the file was left behind and says nothing.
    pub pid: u32,
    /// When that process was started, in the system's ticks since it booted (`/proc/PID/stat`, the 22nd); 0: unknown.
    pub started: u64,
    /// Number of this change, from 1.
    pub change: u64,
    /// Number of the request, from 1: a new one for everything that is asked anew, the same again too.
    pub request: u64,
    /// How often the same was asked of the same subjects until now, this time with it: of movements each for itself.
    pub times: u64,
    /// What is wanted.
    pub wanted: NowWanted,
    /// Which movement, of [`NowWanted::Move`].
    #[serde(default)]
    pub movement: Option<String>,
    /// Of whom, by id; empty: of all.
    #[serde(default)]
    pub subjects: Vec<String>,
    /// Which action, of watching, practising and performing.
    #[serde(default)]
    pub action: Option<NowAction>,
    /// How long it is to be held from this change on, s.
    #[serde(default)]
    pub hold_s: Option<f64>,
    /// True while a trial is recorded.
    #[serde(default)]
    pub recording: bool,
    /// What the operator is told, in words.
    #[serde(default)]
    pub text: String,
}

/// The version alone: whatever else another version says.
#[derive(Deserialize)]
struct Version {
    gaitway_now: u64,
}

impl Now {
    /// What is asked, in a word: a movement by its name.
    #[must_use]
    pub fn word(&self) -> &str {
        match (&self.movement, self.wanted) {
            (Some(movement), NowWanted::Move) => movement,
            _ => self.wanted.word(),
        }
    }

    /// True if it is asked of this subject; `None`: of anybody.
    #[must_use]
    pub fn is_for(&self, subject: Option<&str>) -> bool {
        let is = |id: &str| self.subjects.iter().any(|known| known == id);
        self.subjects.is_empty() || subject.is_none_or(is)
    }

    /// What a session in this folder asks for now; `None` if none is led there: there is no such file, or whoever wrote it is
    /// gone.
    ///
    /// # Errors
    /// A file that cannot be read, is none of these, or is of another version.
    pub fn read(session: &Path) -> Result<Option<Self>, Error> {
        let path = session.join(NOW_FILE);
        let place = path.display().to_string();
        let unreadable = |cause: &std::io::Error| {
            Error::of(cause.into(), "cannot read what a session asks for")
                .at(place.clone())
                .got(cause.to_string())
        };
        let other = |got: String| {
            Error::of(ErrorKind::Malformed, "this is not what a session asks for")
                .at(place.clone())
                .got(got)
                .allowed("what `gaitway record --session` writes")
                .remedy("take it away: a session that is led writes it anew")
        };
        // What is no file, a pipe above all, must not be waited for.
        let nonblocking = rustix::fs::OFlags::NONBLOCK.bits();
        let opened =
            OpenOptions::new().read(true).custom_flags(nonblocking.cast_signed()).open(&path);
        let file = match opened {
            Ok(file) => file,
            Err(cause) if cause.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            Err(cause) => return Err(unreadable(&cause)),
        };
        let found = file.metadata().map_err(|cause| unreadable(&cause))?;
        if !found.is_file() {
            return Err(other("a pipe, a device or a folder".to_owned()));
        }
        let mut bytes = Vec::new();
        let read = file.take(MOST_BYTES + 1).read_to_end(&mut bytes);
        read.map_err(|cause| unreadable(&cause))?;
        if bytes.len() as u64 > MOST_BYTES {
            return Err(other(format!("more than {}", counted(MOST_BYTES, "byte"))));
        }
        let unlike = |cause: serde_json::Error| other(cause.to_string());
        let version: Version = serde_json::from_slice(&bytes).map_err(unlike)?;
        if version.gaitway_now != NOW_VERSION {
            return Err(Error::new("what a session asks for is told in another form")
                .at(place)
                .got(format!("version {}", version.gaitway_now))
                .allowed(format!("version {NOW_VERSION}"))
                .remedy("lead the session and follow it with the same version of gaitway"));
        }
        let now: Self = serde_json::from_slice(&bytes).map_err(unlike)?;
        Ok(Some(now).filter(Self::is_led))
    }

    /// True if such a file may be written into this folder: there is none of its name, or one of a session.
    #[must_use]
    pub fn has_a_place(session: &Path) -> bool {
        let path = session.join(NOW_FILE);
        match path.symlink_metadata() {
            Err(cause) => cause.kind() == std::io::ErrorKind::NotFound,
            // What a link leads to stays as it is when the link makes way.
            Ok(found) if found.is_symlink() => true,
            Ok(found) if found.is_file() && found.len() <= MOST_BYTES => std::fs::read(&path)
                .is_ok_and(|bytes| serde_json::from_slice::<Version>(&bytes).is_ok()),
            Ok(_) => false,
        }
    }

    /// True if whoever wrote it is there; where the system tells nothing of its processes that is believed.
    fn is_led(&self) -> bool {
        match started(self.pid) {
            Some(started) => self.started == 0 || started == self.started,
            None => started(std::process::id()).is_none(),
        }
    }
}

/// When a process was started, in ticks since the system booted; `None` if it is not there, or nobody tells.
#[must_use]
pub fn started(pid: u32) -> Option<u64> {
    let mut text = String::new();
    File::open(format!("/proc/{pid}/stat")).ok()?.take(4096).read_to_string(&mut text).ok()?;
    // The second is the name of the program, in brackets, and may hold anything.
    let (_, after) = text.rsplit_once(") ")?;
    // The state is the third.
    after.split_whitespace().nth(22 - 3)?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An empty folder.
    fn folder(name: &str) -> std::path::PathBuf {
        let folder =
            std::env::temp_dir().join(format!("gaitway-now-{}-{name}", std::process::id()));
        let _ = std::fs::remove_dir_all(&folder);
        std::fs::create_dir_all(&folder).expect("a folder");
        folder
    }

    fn told(pid: u32, started: u64) -> Now {
        Now { gaitway_now: 1, pid, started, change: 1, ..Now::default() }
    }

    fn written(folder: &Path, now: &Now) {
        std::fs::write(folder.join(NOW_FILE), serde_json::to_vec(now).expect("JSON"))
            .expect("written");
    }

    #[test]
    fn it_is_read_as_it_was_written_and_what_a_later_program_adds_is_passed_over() {
        let folder = folder("same");
        assert_eq!(Now::read(&folder), Ok(None), "there is none");
        let own = std::process::id();
        let action = NowAction { name: "bow".into(), lasts_s: Some(2.0), ..NowAction::default() };
        let now = Now {
            subjects: vec!["s01".into()],
            wanted: NowWanted::Perform,
            action: Some(action),
            ..told(own, started(own).unwrap_or(0))
        };
        written(&folder, &now);
        assert_eq!(Now::read(&folder), Ok(Some(now.clone())));
        assert!(now.is_for(Some("s01")) && now.is_for(None) && !now.is_for(Some("s02")));
        let mut value = serde_json::to_value(&now).expect("JSON");
        value["colour"] = "green".into();
        std::fs::write(folder.join(NOW_FILE), value.to_string()).expect("written");
        assert_eq!(Now::read(&folder), Ok(Some(now)));
        std::fs::remove_dir_all(folder).expect("taken away");
    }

    #[test]
    fn what_was_left_by_a_process_that_is_gone_asks_for_nothing() {
        let folder = folder("left");
        let own = std::process::id();
        let since = started(own).expect("Linux tells it");
        // No process has this number: the largest is 2^22.
        written(&folder, &told(u32::MAX, 0));
        assert_eq!(Now::read(&folder), Ok(None));
        // Another process has its number now.
        written(&folder, &told(own, since + 1));
        assert_eq!(Now::read(&folder), Ok(None));
        written(&folder, &told(own, since));
        assert!(matches!(Now::read(&folder), Ok(Some(_))));
        std::fs::remove_dir_all(folder).expect("taken away");
    }

    #[test]
    fn what_is_no_such_file_is_refused_in_words_and_never_waited_for() {
        let folder = folder("hostile");
        let path = folder.join(NOW_FILE);
        let said = |bytes: &[u8]| {
            let _ = std::fs::remove_file(&path);
            std::fs::write(&path, bytes).expect("written");
            Now::read(&folder).expect_err("a refusal").to_string()
        };
        let deep = "[".repeat(60_000);
        let garbage: [&[u8]; 7] = [
            b"",
            b"\xff\xfe\x00",
            b"null",
            b"{}",
            br#"{"gaitway_now": -1}"#,
            br#"{"gaitway_now": 1, "pid": "me"}"#,
            deep.as_bytes(),
        ];
        for bytes in garbage {
            assert!(said(bytes).contains("not what a session asks for"), "{}", said(bytes));
        }
        assert!(said(&vec![b' '; 10 << 20]).contains("more than 65536 bytes"));
        let version = said(br#"{"gaitway_now": 2, "wanted": "fly"}"#);
        assert!(version.contains("version 2") && version.contains("version 1"), "{version}");
        let wish = said(
            br#"{"gaitway_now":1,"pid":1,"started":0,"change":1,"request":1,"times":1,"wanted":"fly"}"#,
        );
        assert!(wish.contains("fly"), "{wish}");
        std::fs::remove_file(&path).expect("taken away");
        std::fs::create_dir(&path).expect("a folder in its place");
        assert!(Now::read(&folder).is_err());
        std::fs::remove_dir(&path).expect("taken away");
        rustix::fs::mknodat(rustix::fs::CWD, &path, rustix::fs::FileType::Fifo, 0o600.into(), 0)
            .expect("a pipe that nobody writes");
        assert!(Now::read(&folder).expect_err("a refusal").to_string().contains("a pipe"));
        std::fs::remove_dir_all(folder).expect("taken away");
    }
}
