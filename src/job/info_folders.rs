//! What a folder holds that programs keep motions in: a corpus, a dataset of LeRobot's, a session, or one of BONES-SEED.

use super::corpus::{bones_seed_metadata, stem_of};
use super::source::lerobot;
use crate::corpus::store::Store;
use crate::corpus::tables::TRIALS;
use crate::error::Error;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// So deep are folders looked into for a motion: `soma_uniform/bvh/DATE/MOTION.bvh`.
const DEEPEST: usize = 2;

/// A folder of motions.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FolderOverview {
    /// `corpus`, `lerobot`, `session` or `bones-seed`.
    pub format: &'static str,
    /// What it says of itself: what, and how much.
    pub holds: Vec<(&'static str, String)>,
    /// What can be done with it.
    pub next: String,
}

/// Looks into a folder; none if it is none of these.
///
/// # Errors
/// One that is, and cannot be read.
pub fn overview(folder: &Path) -> Result<Option<FolderOverview>, Error> {
    let shown = folder.display();
    if Store::is_corpus(folder) {
        let store = Store::open(folder)?;
        let (version, manifest) = (store.version(), store.manifest());
        let holds = vec![
            ("name", manifest.name.clone()),
            ("version", version.version.clone()),
            ("trials", version.trials.to_string()),
            ("frames", version.frames.to_string()),
            ("people", store.subjects()?.len().to_string()),
        ];
        let next = format!("gaitway corpus query {shown} \"action=walk\"");
        return Ok(Some(FolderOverview { format: "corpus", holds, next }));
    }
    if folder.join(lerobot::INFO).is_file() {
        let holds = lerobot::overview(folder)?;
        let next = format!("gaitway play '{shown}#0' --robot NAME --dry-run");
        return Ok(Some(FolderOverview { format: "lerobot", holds, next }));
    }
    if folder.join("session.toml").is_file() {
        let is_finished = folder.join("manifest.toml").is_file();
        let (state, next) = match is_finished {
            true => ("yes", format!("gaitway corpus add CORPUS {shown}")),
            false => ("no", format!("gaitway record --session {shown}")),
        };
        let holds = vec![("finished", state.to_owned())];
        return Ok(Some(FolderOverview { format: "session", holds, next }));
    }
    Ok(bones_seed_metadata(folder).map(|table| FolderOverview {
        format: "bones-seed",
        holds: vec![("table", table.display().to_string())],
        next: format!("gaitway corpus add CORPUS {shown}"),
    }))
}

/// Fails for a folder of motions, of which a page shows one: what can be drawn of it is told.
///
/// # Errors
/// As said; a folder of these that cannot be read.
pub fn no_page(folder: &Path) -> Result<(), Error> {
    if !folder.is_dir() {
        return Ok(());
    }
    let Some(FolderOverview { format, .. }) = overview(folder)? else { return Ok(()) };
    let shown = folder.display();
    let (what, remedy) = match format {
        "lerobot" => (
            "a dataset of LeRobot's",
            format!(
                "gaitway retarget '{shown}#0' --robot NAME -o FILE.csv --html FILE.html draws an episode"
            ),
        ),
        "corpus" => ("a corpus", remedy_of_corpus(folder)?),
        "session" => {
            let trials = first_file(&folder.join("trials"), ".mcap");
            let first = trials.map(|trial| drawn(&trial));
            ("a session", first.unwrap_or_else(|| "nothing is recorded in it yet".to_owned()))
        }
        _ => {
            let rooms = ["soma_proportional", "soma_uniform"].map(|room| folder.join(room));
            let clips = rooms.iter().find_map(|room| first_file(room, ".bvh"));
            let first = clips.map(|clip| drawn(&clip));
            let none = "unpack soma_proportional or soma_uniform there, and take one of its clips";
            ("a folder in the layout of BONES-SEED", first.unwrap_or_else(|| none.to_owned()))
        }
    };
    Err(Error::new("a page shows one motion")
        .at(shown.to_string())
        .got(what)
        .allowed("a capture, markers, a table or a recording")
        .remedy(remedy))
}

/// The command that draws a file.
fn drawn(file: &Path) -> String {
    format!("gaitway info {} --html FILE.html", file.display())
}

/// How to draw a trial of a corpus: its first.
fn remedy_of_corpus(folder: &Path) -> Result<String, Error> {
    let (store, shown) = (Store::open(folder)?, folder.display());
    let first = store.files(TRIALS).next().map(|note| store.trials_in(note)).transpose()?;
    let Some(first) = first.and_then(|trials| trials.into_iter().next()) else {
        return Ok(format!("nothing is in it yet: gaitway corpus add {shown} walk adds a motion"));
    };
    Ok(format!(
        "gaitway corpus export {shown} --format bvh -o DIR, then gaitway info DIR/{}.bvh --html FILE.html",
        stem_of(&first)
    ))
}

/// The first file by name in a folder, or in the folders in it, that ends so.
fn first_file(folder: &Path, ending: &str) -> Option<PathBuf> {
    let mut rooms = vec![(folder.to_owned(), 0)];
    while let Some((room, depth)) = rooms.pop() {
        let entries = std::fs::read_dir(room).into_iter().flatten().flatten();
        let mut places: Vec<PathBuf> = entries.map(|entry| entry.path()).collect();
        places.sort();
        let ends = |place: &&PathBuf| place.to_str().is_some_and(|name| name.ends_with(ending));
        if let Some(found) = places.iter().find(|place| ends(place) && place.is_file()) {
            return Some(found.clone());
        }
        let is_folder = |place: &PathBuf| place.symlink_metadata().is_ok_and(|of| of.is_dir());
        if depth < DEEPEST {
            // The last of them is looked into first.
            rooms.extend(places.into_iter().filter(is_folder).rev().map(|room| (room, depth + 1)));
        }
    }
    None
}

impl FolderOverview {
    /// For a person.
    #[must_use]
    pub fn words(&self) -> String {
        let lines = self.holds.iter().map(|(what, of)| format!("{what:9} {of}\n"));
        let lines: String = lines.collect();
        format!("format    {}\n{lines}next      {}\n", self.format, self.next)
    }
}
