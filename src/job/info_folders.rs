//! What a folder holds that programs keep motions in: a corpus, a dataset of LeRobot's, a session, or one of BONES-SEED.

use super::corpus::bones_seed_metadata;
use super::source::lerobot;
use crate::corpus::store::Store;
use crate::error::Error;
use serde::Serialize;
use std::path::Path;

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
        "corpus" => (
            "a corpus",
            format!(
                "gaitway corpus export {shown} --format bvh -o DIR, then gaitway info DIR/TRIAL.bvh --html FILE.html"
            ),
        ),
        "session" => {
            ("a session", format!("gaitway info {shown}/trials/TRIAL.mcap --html FILE.html"))
        }
        _ => (
            "a folder in the layout of BONES-SEED",
            "gaitway info CLIP.bvh --html FILE.html".to_owned(),
        ),
    };
    Err(Error::new("a page shows one motion")
        .at(shown.to_string())
        .got(what)
        .allowed("a capture, markers, a table or a recording")
        .remedy(remedy))
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
