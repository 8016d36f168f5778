//! A file that has its name only once it is worth it. What it replaces stays whole until then,
//! whatever happens in between: a refusal, a full disk, a killed process.
//!
//! One that is worth nothing until it is whole ([`Draft::whole`]) has no name at all before: nothing is left of it if the
//! program is killed, and nobody's file is in its way. Where a file system knows no files without a name, it grows as
//! `NAME.part` beside the name it is to have, in the same folder, and is renamed; so does what can be used as far as it
//! goes ([`Draft::beside`]). A recording ([`Draft::create`]) that replaces nothing is made under its own name: what there
//! is of it can be read if it is cut off. What has a name is locked for as long as it is written, so that two programs
//! never write one file. What is no regular file (`/dev/null`, a pipe) is written to as it is.

use crate::error::{Error, ErrorKind};
use rustix::fs::{AtFlags, CWD, OFlags, linkat};
use std::fs::{File, OpenOptions, Permissions, TryLockError};
use std::io::{self, Write};
use std::os::fd::AsRawFd;
use std::os::unix::fs::{MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// What the name of a file ends in that is to replace another and has not done so yet.
const ENDING: &str = ".part";
/// Where the system shows a program the files it has open.
const OPEN_FILES: &str = "/proc/self/fd";

/// Most files of a folder that are looked at.
const MOST_FILES: usize = 100_000;

/// Fails if something that is written is a file that is read, whatever its name; of a folder that is read: a file in
/// it. `--force` permits to replace results, not to lose what they are made of.
///
/// # Errors
/// What would be written over.
pub fn check_apart<'a>(
    read: impl IntoIterator<Item = &'a Path>,
    written: impl IntoIterator<Item = &'a Path>,
) -> Result<(), Error> {
    let id = |path: &Path| std::fs::metadata(path).ok().map(|file| (file.dev(), file.ino()));
    let mut known = Vec::new();
    let mut folders: Vec<PathBuf> = Vec::new();
    for path in read {
        known.extend(id(path));
        folders.extend(path.is_dir().then(|| path.to_owned()));
    }
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).into_iter().flatten().flatten() {
            // Links are followed for their files and not for their folders, which may go round.
            let is_folder = entry.file_type().is_ok_and(|of| of.is_dir());
            folders.extend(is_folder.then(|| entry.path()));
            known.extend(id(&entry.path()).filter(|_| !is_folder));
        }
        if known.len() > MOST_FILES {
            break;
        }
    }
    let mut written = written.into_iter();
    match written.find(|path| !path.is_dir() && id(path).is_some_and(|id| known.contains(&id))) {
        None => Ok(()),
        Some(path) => {
            Err(Error::of(ErrorKind::Exists, "the file that is read would be written over")
                .at(path.display().to_string())
                .remedy("choose another name; --force is not for this"))
        }
    }
}

/// A file that is being written.
#[derive(Debug)]
pub struct Draft {
    file: File,
    place: Place,
    /// The folder in which it has just got its name, not yet synchronised.
    named_in: Arc<Mutex<Option<PathBuf>>>,
}

#[derive(Debug)]
enum Place {
    /// Beside the name it is to have, in the place of what has it, or only if nothing has.
    Beside { part: PathBuf, target: PathBuf, replaces: bool },
    /// Without a name, in the folder of the one it is to have, in the place of what has it, or only if nothing has.
    Nameless { target: PathBuf, replaces: bool },
    /// New, under its own name, and not yet worth keeping.
    New(PathBuf),
    /// Under its own name, for good.
    Kept,
}

impl Draft {
    /// Begins a file that is to be `path`; one that is there is replaced only if `force` is set.
    ///
    /// # Errors
    /// [`io::ErrorKind::AlreadyExists`] without `force`, [`io::ErrorKind::ResourceBusy`] if another program
    /// writes it, and what the file system says.
    pub fn create(path: &Path, force: bool) -> io::Result<Self> {
        let made = OpenOptions::new().write(true).create_new(true).open(path);
        let file = match made {
            Err(cause) if force && cause.kind() == io::ErrorKind::AlreadyExists => {
                return Self::replace(path, Self::grown);
            }
            made => made?,
        };
        free(file.try_lock())?;
        Ok(Self::of(file, Place::New(path.to_owned())))
    }

    /// Begins a file that grows beside the name it is to have, whether or not a file is there: what has
    /// the name is whole, even if this process is killed.
    ///
    /// # Errors
    /// [`io::ErrorKind::ResourceBusy`] if another program writes it, and what the file system says.
    pub fn beside(path: &Path) -> io::Result<Self> {
        Self::grown(path.to_owned(), true, None)
    }

    /// Begins a file that has its name only when it is whole, also if nothing has the name now; one that is there is
    /// replaced only if `force` is set. Of two that write one at the same time the last wins, if it may replace.
    ///
    /// # Errors
    /// As [`Draft::create`].
    pub fn whole(path: &Path, force: bool) -> io::Result<Self> {
        // A dangling link counts as taken: writing through it would write elsewhere.
        match path.symlink_metadata() {
            Err(_) => Self::nameless(path.to_owned(), force, None),
            Ok(_) if force => Self::replace(path, Self::nameless),
            Ok(_) => Err(io::ErrorKind::AlreadyExists.into()),
        }
    }

    fn of(file: File, place: Place) -> Self {
        Self { file, place, named_in: Arc::default() }
    }

    fn replace(
        path: &Path,
        begun: fn(PathBuf, bool, Option<Permissions>) -> io::Result<Self>,
    ) -> io::Result<Self> {
        let Some(target) = replaceable(path) else {
            let file = OpenOptions::new().write(true).create(true).truncate(true).open(path)?;
            return Ok(Self::of(file, Place::Kept));
        };
        let old = File::open(&target)?;
        // Whoever records to it holds it; nobody is waited for.
        free(old.try_lock_shared())?;
        let rights = old.metadata()?.permissions();
        begun(target, true, Some(rights))
    }

    /// Begins a file without a name, with these rights.
    fn nameless(target: PathBuf, replaces: bool, rights: Option<Permissions>) -> io::Result<Self> {
        let mut options = OpenOptions::new();
        options.write(true).custom_flags(OFlags::TMPFILE.bits().cast_signed());
        // A name is given to it by way of this folder.
        let made = Path::new(OPEN_FILES).exists().then(|| options.open(folder_of(&target)));
        let Some(Ok(file)) = made else { return Self::grown(target, replaces, rights) };
        if let Some(rights) = rights {
            file.set_permissions(rights)?;
        }
        Ok(Self::of(file, Place::Nameless { target, replaces }))
    }

    /// Begins a file beside `target`, with these rights.
    fn grown(target: PathBuf, replaces: bool, rights: Option<Permissions>) -> io::Result<Self> {
        let part = beside(&target, ENDING);
        loop {
            // No link is followed, and no pipe waited for.
            let flags = OFlags::NOFOLLOW | OFlags::NONBLOCK;
            let mut options = OpenOptions::new();
            options.write(true).create(true).truncate(false);
            let file = options.custom_flags(flags.bits().cast_signed()).open(&part)?;
            free(file.try_lock())?;
            // Another may have renamed or removed it before it was locked here.
            let is_named = part.symlink_metadata().is_ok_and(|named| same(&named, &file));
            if is_named {
                // One that was left behind by a killed process begins anew.
                file.set_len(0)?;
                if let Some(rights) = rights {
                    file.set_permissions(rights)?;
                }
                return Ok(Self::of(file, Place::Beside { part, target, replaces }));
            }
        }
    }

    /// True if another file is still under the name this one is to have.
    #[must_use]
    pub fn replaces(&self) -> bool {
        let (Place::Beside { target, .. } | Place::Nameless { target, .. }) = &self.place else {
            return false;
        };
        target.symlink_metadata().is_ok()
    }

    /// Gives it its name, for good. It may be written on. The name survives a power cut once it is
    /// synchronised ([`Draft::sync`]).
    ///
    /// # Errors
    /// As the file system says; it has not its name then.
    pub fn keep(&mut self) -> io::Result<()> {
        let named = match &self.place {
            Place::Beside { part, target, replaces: true } => {
                std::fs::rename(part, target)?;
                target
            }
            Place::Beside { part, target, replaces: false } => {
                rename_to_free(part, target)?;
                target
            }
            Place::Nameless { target, replaces } => {
                name(&self.file, target, *replaces)?;
                target
            }
            Place::New(path) => path,
            Place::Kept => return Ok(()),
        };
        let mut named_in = self.named_in.lock().unwrap_or_else(PoisonError::into_inner);
        *named_in = Some(folder_of(named).to_owned());
        drop(named_in);
        self.place = Place::Kept;
        Ok(())
    }

    /// Returns once everything written would survive a power cut.
    ///
    /// # Errors
    /// As the file system says.
    pub fn sync(&self) -> io::Result<()> {
        synced(&self.file, &self.named_in)
    }

    /// The same, to be called on another thread: it may take as long as it likes while the file is
    /// written on.
    ///
    /// # Errors
    /// A file that cannot be had twice.
    pub fn syncer(&self) -> io::Result<impl FnMut() -> io::Result<()> + Send + 'static> {
        let (file, named_in) = (self.file.try_clone()?, Arc::clone(&self.named_in));
        Ok(move || synced(&file, &named_in))
    }

    /// Writes a whole file, or leaves what was there.
    ///
    /// # Errors
    /// As [`Draft::create`]; what could not be written is gone again.
    pub fn write_whole(path: &Path, force: bool, bytes: &[u8]) -> io::Result<()> {
        let mut draft = Self::whole(path, force)?;
        draft.write_all(bytes)?;
        draft.sync()?;
        draft.keep()?;
        draft.sync()
    }
}

/// Gives a file without a name its name.
fn name(file: &File, target: &Path, replaces: bool) -> io::Result<()> {
    let own = format!("{OPEN_FILES}/{}", file.as_raw_fd());
    let link = |to: &Path| linkat(CWD, own.as_str(), CWD, to, AtFlags::SYMLINK_FOLLOW);
    if !replaces {
        return Ok(link(target)?);
    }
    // A link takes no other's place; a name that nobody else thinks of, renamed, does.
    static NAMED: AtomicU64 = AtomicU64::new(0);
    let number = NAMED.fetch_add(1, Ordering::Relaxed);
    let passing = beside(target, &format!(".{}.{number}{ENDING}", std::process::id()));
    link(&passing)?;
    std::fs::rename(&passing, target).inspect_err(|_| {
        // One that cannot be removed is in nobody's way: there is nobody left to tell.
        let _ = std::fs::remove_file(&passing);
    })
}

fn synced(file: &File, named_in: &Mutex<Option<PathBuf>>) -> io::Result<()> {
    let synced = match file.sync_data() {
        // Pipes and devices have nothing to be synchronised.
        Err(cause) if cause.kind() == io::ErrorKind::InvalidInput => Ok(()),
        synced => synced,
    };
    let folder = named_in.lock().unwrap_or_else(PoisonError::into_inner).take();
    if let Some(folder) = folder {
        // Some file systems cannot synchronise a folder; the file is worth having even so.
        let _ = File::open(folder).and_then(|folder| folder.sync_all());
    }
    synced
}

impl Write for Draft {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.file.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

impl Drop for Draft {
    /// One that was not kept leaves nothing behind.
    fn drop(&mut self) {
        if let Place::Beside { part: path, .. } | Place::New(path) = &self.place {
            // One that cannot be removed is in nobody's way: there is nobody left to tell.
            let _ = std::fs::remove_file(path);
        }
    }
}

/// Writes a whole file; one that is there is replaced only if `force` is set, and only once the new one
/// is whole.
///
/// # Errors
/// The file exists and is to stay, or cannot be written.
pub fn write_file(path: &Path, force: bool, bytes: &[u8]) -> Result<(), Error> {
    check_free(path, force)?;
    Draft::write_whole(path, force, bytes).map_err(|cause| unwritten(path, &cause))
}

/// Files that belong together: they have their names only when all of them are whole.
#[derive(Debug, Default)]
pub struct Drafts(Vec<(PathBuf, Draft)>);

impl Drafts {
    /// Adds one that is written already.
    pub fn add(&mut self, path: &Path, draft: Draft) {
        self.0.push((path.to_owned(), draft));
    }

    /// Writes another.
    ///
    /// # Errors
    /// As [`write_file`].
    pub fn write(&mut self, path: &Path, force: bool, bytes: &[u8]) -> Result<(), Error> {
        check_free(path, force)?;
        let written = Draft::whole(path, force).and_then(|mut draft| {
            draft.write_all(bytes)?;
            Ok(draft)
        });
        self.add(path, written.map_err(|cause| unwritten(path, &cause))?);
        Ok(())
    }

    /// Gives all of them their names.
    ///
    /// # Errors
    /// What cannot be written to the disk, or has no place any more: those after it have no names then.
    pub fn keep(mut self) -> Result<(), Error> {
        for (path, draft) in &self.0 {
            draft.sync().map_err(|cause| unwritten(path, &cause))?;
        }
        for (path, draft) in &mut self.0 {
            draft.keep().and_then(|()| draft.sync()).map_err(|cause| unwritten(path, &cause))?;
        }
        Ok(())
    }
}

pub(crate) fn unwritten(path: &Path, cause: &io::Error) -> Error {
    Error::unwritten("cannot write the file", cause).at(path.display().to_string())
}

/// Fails if `path` exists and is to stay, or is no file.
///
/// # Errors
/// As said.
pub fn check_free(path: &Path, force: bool) -> Result<(), Error> {
    if path.is_dir() {
        return Err(Error::new("this is a folder, not a file")
            .at(path.display().to_string())
            .remedy("give the name of a file in it"));
    }
    if path == Path::new("-") {
        return Err(Error::new("this is no name of a file").got("-").remedy(
            "name a file (./- for one of this name); results come on standard output by themselves",
        ));
    }
    let Ok(known) = path.symlink_metadata() else { return Ok(()) };
    // A dangling link counts as taken: writing through it would write elsewhere.
    if known.is_symlink() && !path.exists() {
        let leads_to = std::fs::read_link(path).map(|to| to.display().to_string());
        return Err(Error::of(ErrorKind::Exists, "there is a link that leads nowhere")
            .at(path.display().to_string())
            .got(format!("a link to {}", leads_to.unwrap_or_default()))
            .remedy("remove the link, or choose another name"));
    }
    if force {
        return Ok(());
    }
    Err(Error::of(ErrorKind::Exists, "the file exists already")
        .at(path.display().to_string())
        .remedy("choose another name, or add --force to overwrite it"))
}

/// The folder in which the file grows that is to be `path`: it must be one that may be written to.
/// None for what is written to as it is.
#[must_use]
pub fn grows_in(path: &Path) -> Option<PathBuf> {
    match path.symlink_metadata() {
        Err(_) => Some(folder_of(path).to_owned()),
        Ok(_) => replaceable(path).map(|target| folder_of(&target).to_owned()),
    }
}

/// The file that a regular file at `path` is, links followed. None for what is replaced by writing
/// to it: devices, pipes, what the system shows of itself, links that lead nowhere.
fn replaceable(path: &Path) -> Option<PathBuf> {
    let target = std::fs::canonicalize(path).ok()?;
    let is_own = [path, &target].into_iter().all(|path| {
        let absolute = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
        !absolute.starts_with("/dev/fd")
            && !absolute.starts_with("/proc")
            && !absolute.starts_with("/dev/std")
    });
    (is_own && target.is_file()).then_some(target)
}

/// Renames a file to a name that nothing has.
fn rename_to_free(part: &Path, target: &Path) -> io::Result<()> {
    use rustix::fs::{RenameFlags, renameat_with};
    use rustix::io::Errno;
    match renameat_with(CWD, part, CWD, target, RenameFlags::NOREPLACE) {
        // Not every file system can; then another program may come between.
        Err(Errno::INVAL | Errno::NOSYS) if target.symlink_metadata().is_err() => {
            std::fs::rename(part, target)
        }
        renamed => renamed.map_err(io::Error::from),
    }
}

fn beside(target: &Path, ending: &str) -> PathBuf {
    let mut name = target.as_os_str().to_owned();
    name.push(ending);
    PathBuf::from(name)
}

fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

fn same(named: &std::fs::Metadata, file: &File) -> bool {
    file.metadata().is_ok_and(|open| (open.dev(), open.ino()) == (named.dev(), named.ino()))
}

/// Fails if another program holds the file.
fn free(locked: Result<(), TryLockError>) -> io::Result<()> {
    match locked {
        Err(TryLockError::WouldBlock) => {
            Err(io::Error::new(io::ErrorKind::ResourceBusy, "another program is writing it"))
        }
        // Not every file system has locks.
        Ok(()) | Err(TryLockError::Error(_)) => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    fn folder(name: &str) -> PathBuf {
        let folder = std::env::temp_dir().join(format!("draft-{name}-{}", std::process::id()));
        let _ = fs::remove_dir_all(&folder);
        fs::create_dir_all(&folder).expect("a folder");
        folder
    }

    fn names(folder: &Path) -> Vec<String> {
        let entries = fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry"));
        let mut names: Vec<String> =
            entries.map(|entry| entry.file_name().to_string_lossy().into_owned()).collect();
        names.sort();
        names
    }

    #[test]
    fn a_file_that_is_to_stay_stays_and_one_that_is_replaced_touches_no_other() {
        let folder = folder("written");
        let (path, beside) = (folder.join("body.toml"), folder.join("body.toml.new"));
        for path in [&path, &beside] {
            fs::write(path, "precious").expect("a file");
        }
        let refused = write_file(&path, false, b"new").expect_err("it was not to be replaced");
        assert!(refused.to_string().contains("--force"), "{refused}");
        assert_eq!(fs::read(&path).expect("a file"), b"precious");
        write_file(&path, true, b"new").expect("replaced");
        assert_eq!(fs::read(&path).expect("a file"), b"new");
        assert_eq!(fs::read(&beside).expect("a file"), b"precious");
        assert_eq!(names(&folder), ["body.toml", "body.toml.new"], "no litter");
        assert!(write_file(&folder, true, b"new").is_err(), "a folder is no file");
    }

    #[test]
    fn what_is_replaced_stays_whole_until_the_new_one_is_kept() {
        let folder = folder("keep");
        let path = folder.join("a");
        fs::write(&path, "old").expect("a file");
        assert_eq!(
            Draft::create(&path, false).expect_err("there").kind(),
            io::ErrorKind::AlreadyExists
        );
        let mut draft = Draft::create(&path, true).expect("a draft");
        draft.write_all(b"new").expect("written");
        assert_eq!(fs::read(&path).expect("a file"), b"old");
        assert_eq!(names(&folder), ["a", "a.part"]);
        draft.keep().expect("renamed");
        draft.write_all(b"er").expect("written on");
        drop(draft);
        assert_eq!(fs::read(&path).expect("a file"), b"newer");
        assert_eq!(names(&folder), ["a"]);
    }

    #[test]
    fn what_grows_beside_its_name_has_it_only_once_it_is_kept() {
        use std::os::unix::fs::symlink;
        let folder = folder("beside");
        let (path, part) = (folder.join("a"), folder.join("a.part"));
        let mut draft = Draft::beside(&path).expect("a draft");
        draft.write_all(b"whole").expect("written");
        assert_eq!(names(&folder), ["a.part"]);
        let second = Draft::beside(&path).expect_err("the first is written");
        assert_eq!(second.kind(), io::ErrorKind::ResourceBusy);
        draft.keep().expect("renamed");
        assert_eq!(fs::read(&path).expect("a file"), b"whole");
        drop(draft);
        // What somebody else put under the name it grows under is not written through.
        fs::write(folder.join("precious"), "old").expect("a file");
        symlink(folder.join("precious"), &part).expect("a link");
        assert!(Draft::beside(&path).is_err());
        assert_eq!(fs::read(folder.join("precious")).expect("a file"), b"old");
    }

    #[test]
    fn a_draft_that_is_not_kept_leaves_nothing_behind() {
        let folder = folder("drop");
        let (old, new) = (folder.join("old"), folder.join("new"));
        fs::write(&old, "old").expect("a file");
        drop((Draft::create(&old, true).expect("a draft"), Draft::create(&new, true)));
        assert_eq!(names(&folder), ["old"]);
        assert_eq!(fs::read(&old).expect("a file"), b"old");
    }

    #[test]
    fn what_a_killed_process_left_is_written_anew() {
        let folder = folder("left");
        let path = folder.join("a");
        fs::write(&path, "old").expect("a file");
        fs::write(folder.join("a.part"), "left behind, and longer").expect("a file");
        let mut draft = Draft::create(&path, true).expect("a draft");
        draft.write_all(b"new").and_then(|()| draft.keep()).expect("written");
        assert_eq!(fs::read(&path).expect("a file"), b"new");
        assert_eq!(names(&folder), ["a"]);
    }

    #[test]
    fn a_file_that_is_to_be_whole_has_its_name_at_its_end_and_takes_it_from_nobody() {
        let folder = folder("whole");
        let path = folder.join("a");
        // Somebody else's file that is not all there, which has nothing to do with it.
        fs::write(folder.join("a.part"), "precious").expect("a file");
        let mut draft = Draft::whole(&path, false).expect("a draft");
        draft.write_all(b"half").expect("written");
        assert_eq!(names(&folder), ["a.part"]);
        draft.write_all(b" and half").and_then(|()| draft.keep()).expect("renamed");
        assert_eq!(fs::read(&path).expect("a file"), b"half and half");
        drop(draft);
        assert_eq!(fs::read(folder.join("a.part")).expect("a file"), b"precious");
        fs::remove_file(folder.join("a.part")).expect("removed");
        assert_eq!(names(&folder), ["a"]);
        let refused = Draft::whole(&path, false).expect_err("there");
        assert_eq!(refused.kind(), io::ErrorKind::AlreadyExists);
        // Somebody else makes a file of that name in the meantime.
        let path = folder.join("b");
        let mut draft = Draft::whole(&path, false).expect("a draft");
        fs::write(&path, "precious").expect("a file");
        assert_eq!(draft.keep().expect_err("taken").kind(), io::ErrorKind::AlreadyExists);
        drop(draft);
        assert_eq!(fs::read(&path).expect("a file"), b"precious");
        assert_eq!(names(&folder), ["a", "b"]);
    }

    #[test]
    fn files_that_belong_together_appear_together_or_not_at_all() {
        let folder = folder("together");
        let [one, two] = ["one", "two"].map(|name| folder.join(name));
        let mut drafts = Drafts::default();
        drafts.write(&one, false, b"one").expect("written");
        assert_eq!(names(&folder), [""; 0], "before the other is there");
        assert!(drafts.write(Path::new("/dev/full"), true, b"two").is_err());
        drop(drafts);
        assert_eq!(names(&folder), [""; 0]);
        let mut drafts = Drafts::default();
        drafts.write(&one, false, b"one").expect("written");
        drafts.write(&two, false, b"two").expect("written");
        drafts.keep().expect("kept");
        assert_eq!(names(&folder), ["one", "two"]);
    }

    #[test]
    fn what_is_replaced_when_it_is_whole_was_never_beside_it() {
        use std::os::unix::fs::PermissionsExt;
        let folder = folder("nameless");
        let path = folder.join("a");
        fs::write(&path, "old").expect("a file");
        fs::set_permissions(&path, fs::Permissions::from_mode(0o640)).expect("rights");
        let [mut one, mut other] = [(), ()].map(|()| Draft::whole(&path, true).expect("a draft"));
        assert!(one.replaces());
        one.write_all(b"one").expect("written");
        other.write_all(b"other").expect("written");
        assert_eq!(names(&folder), ["a"], "a kill would leave nothing");
        other.keep().expect("kept");
        one.keep().expect("kept");
        drop(other);
        assert_eq!(fs::read(&path).expect("a file"), b"one", "the last wins, whole");
        assert_eq!(path.metadata().expect("a file").permissions().mode() & 0o777, 0o640);
        drop(Draft::whole(&path, true).expect("a draft"));
        assert_eq!(names(&folder), ["a"]);
    }

    #[test]
    fn two_never_write_one_file() {
        let folder = folder("two");
        let path = folder.join("a");
        let mut first = Draft::create(&path, true).expect("a draft");
        let second = |when: &str| {
            let refused = Draft::create(&path, true).expect_err(when);
            assert_eq!(refused.kind(), io::ErrorKind::ResourceBusy, "{when}");
        };
        second("while the first is new");
        first.keep().expect("kept");
        second("while the first is written on");
        drop(first);
        let mut third = Draft::create(&path, true).expect("nobody writes it");
        second("while the third is beside it");
        third.keep().expect("kept");
        second("while the third is written on");
        drop(third);
        Draft::write_whole(&path, true, b"whole").expect("nobody writes it");
        assert_eq!(names(&folder), ["a"]);
    }

    #[test]
    fn a_link_stays_a_link_and_its_file_is_replaced_with_its_rights() {
        use std::os::unix::fs::{PermissionsExt, symlink};
        let folder = folder("link");
        let (path, link) = (folder.join("a"), folder.join("link"));
        fs::write(&path, "old").expect("a file");
        fs::set_permissions(&path, fs::Permissions::from_mode(0o600)).expect("rights");
        symlink(&path, &link).expect("a link");
        Draft::write_whole(&link, true, b"new").expect("written");
        assert!(link.is_symlink());
        assert_eq!(fs::read(&path).expect("a file"), b"new");
        assert_eq!(path.metadata().expect("a file").permissions().mode() & 0o777, 0o600);
        assert_eq!(names(&folder), ["a", "link"]);
    }

    #[test]
    fn a_device_is_written_to_and_stays() {
        Draft::write_whole(Path::new("/dev/null"), true, b"new").expect("written");
        let full = Draft::write_whole(Path::new("/dev/full"), true, b"new");
        assert_eq!(full.expect_err("full").kind(), io::ErrorKind::StorageFull);
        for device in ["/dev/null", "/dev/full"] {
            assert!(!Path::new(device).metadata().expect("there").is_file());
        }
    }
}
