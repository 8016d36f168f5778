//! Labels frame by frame, as the ICS Action Database has them: for each trial a folder, in it for each action a file, in it
//! for each frame a line: 1.0 if the frame is part of the action, 0.0 if not, 0.5 if nobody can say. A frame may be part of
//! several actions.

use super::{Cut, Label, Labels, label_text};
use crate::corpus::store::check_outside;
use crate::draft;
use crate::error::{Error, ErrorKind};
use crate::job::report::counted;
use std::path::{Path, PathBuf};

/// Most files and folders in one folder.
const MOST_ENTRIES: usize = 10_000;
/// Longest part of a name of a file, characters.
const LONGEST_NAME: usize = 100;

/// What a line says of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Mark {
    Part,
    Unclear,
    Not,
}

impl Mark {
    /// As it is written.
    pub(super) const fn word(self) -> &'static str {
        match self {
            Self::Part => "1.0",
            Self::Unclear => "0.5",
            Self::Not => "0.0",
        }
    }

    pub(super) fn read(text: &str) -> Result<Self, Error> {
        match text.trim().parse::<f64>() {
            Ok(1.0) => Ok(Self::Part),
            Ok(0.5) => Ok(Self::Unclear),
            Ok(0.0) => Ok(Self::Not),
            _ => Err(Error::of(
                ErrorKind::Malformed,
                "a frame is part of an action, or not, or unclear",
            )
            .got(text.trim().chars().take(40).collect::<String>())
            .allowed("1.0, 0.0 or 0.5")),
        }
    }
}

/// What is marked in the frames of a trial, for one action.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct ActionMarks {
    pub(super) action: String,
    pub(super) marks: Vec<Mark>,
}

/// True if a folder may be one of labels: it has folders with texts in them.
pub(super) fn is_folder(path: &Path) -> bool {
    let is_text = |path: &PathBuf| path.extension().is_some_and(|ending| ending == "txt");
    let has_texts = |trial: &PathBuf| entries(trial).is_ok_and(|all| all.iter().any(is_text));
    let found = entries(path).unwrap_or_default();
    !found.iter().any(is_text) && found.iter().filter(|path| path.is_dir()).any(has_texts)
}

/// The name of the trial that a clip or a motion is: that of its file, with plain letters.
pub(super) fn trial_of(motion: &str) -> String {
    let path = Path::new(motion);
    let stem = path.file_stem().and_then(std::ffi::OsStr::to_str).unwrap_or(motion);
    let plain = |c: char| if c.is_alphanumeric() || "-_. ".contains(c) { c } else { '-' };
    let name: String = stem.chars().map(plain).take(LONGEST_NAME).collect();
    if name.starts_with('.') || name.is_empty() { format!("trial-{name}") } else { name }
}

/// Writes `FOLDER/TRIAL/ACTION.txt`.
///
/// # Errors
/// An action that cannot be the name of a file, labels of other actions in the folder of a trial, files that exist or cannot
/// be written.
pub(super) fn write(
    folder: &Path,
    replace: bool,
    trials: &[(String, Vec<ActionMarks>)],
) -> Result<(), Error> {
    check_outside(folder)?;
    let mut files = Vec::new();
    for (trial, actions) in trials {
        let trial = folder.join(trial);
        for ActionMarks { action, marks } in actions {
            let is_name = !action.starts_with('.')
                && action.chars().all(|c| c != '/' && !c.is_control())
                && action.chars().count() <= LONGEST_NAME;
            if !is_name {
                return Err(Error::of(ErrorKind::Malformed, "an action is no name of a file")
                    .at(trial.display().to_string())
                    .got(action.chars().take(40).collect::<String>()));
            }
            let file = trial.join(format!("{action}.txt"));
            draft::check_free(&file, replace)?;
            let lines = marks.iter().flat_map(|mark| [mark.word(), "\n"]);
            files.push((file, lines.collect::<String>()));
        }
        let is_other = |path: &PathBuf| !files.iter().any(|(file, _)| file == path);
        if trial.is_dir()
            && let Some(other) = entries(&trial)?.into_iter().find(is_other)
        {
            return Err(Error::of(ErrorKind::Exists, "the folder has other labels of this trial")
                .at(other.display().to_string())
                .remedy("take them out of it, or name another folder"));
        }
    }
    let made = |path: &Path| {
        std::fs::create_dir_all(path).map_err(|cause| {
            Error::of((&cause).into(), "the folder cannot be made")
                .at(path.display().to_string())
                .got(cause.to_string())
        })
    };
    trials.iter().try_for_each(|(trial, _)| made(&folder.join(trial)))?;
    files.iter().try_for_each(|(file, text)| draft::write_file(file, replace, text.as_bytes()))
}

/// The labels in a folder of trials: `LABELS/TRIAL/ACTION.txt`. Given a folder of clips, trials are called by the files of
/// their names in it: `CLIPS/TRIAL.bvh`.
///
/// # Errors
/// A folder or a file that cannot be read, a line that is none of the three numbers, actions of a trial with other numbers of
/// frames, a trial without a clip.
pub(super) fn read(folder: &Path, clips: Option<&Path>) -> Result<Labels, Error> {
    let mut labels = Labels::default();
    let clips = clips.map(entries).transpose()?;
    for trial in entries(folder)?.into_iter().filter(|path| path.is_dir()) {
        let stem = |path: &PathBuf| path.file_stem().map(std::ffi::OsStr::to_owned);
        let named = |clip: &&PathBuf| clip.is_file() && stem(clip).as_deref() == trial.file_name();
        let file = match &clips {
            Some(clips) => clips.iter().find(named).map(PathBuf::as_path),
            None => Some(trial.as_path()),
        };
        let Some(clip) = file.and_then(|file| file.file_name()?.to_str()) else {
            return Err(Error::of(ErrorKind::Absent, "there is no clip of this trial")
                .at(trial.display().to_string())
                .remedy("name the folder of a trial like its clip"));
        };
        // What file managers leave in every folder is hidden.
        let is_hidden = |path: &PathBuf| {
            path.file_name().is_some_and(|name| name.as_encoded_bytes().starts_with(b"."))
        };
        let files = entries(&trial)?.into_iter();
        for file in files.filter(|path| path.is_file() && !is_hidden(path)) {
            let class = file.file_stem().and_then(std::ffi::OsStr::to_str).unwrap_or_default();
            let marks = label_text(&file).and_then(|text| marks(&text));
            take(&mut labels, clip, class, &marks.map_err(|error| error.in_file(&file))?)
                .map_err(|error| error.in_file(&file))?;
        }
        labels.looked_for.entry(clip.to_owned()).or_default();
    }
    let labels = labels.with_empty_clips();
    if labels.list.is_empty() {
        return Err(Error::of(ErrorKind::Absent, "there are no labels in this folder")
            .at(folder.display().to_string())
            .allowed("TRIAL/ACTION.txt, a line for each frame: 1.0, 0.5 or 0.0"));
    }
    Ok(labels)
}

/// What is in a folder, by name.
fn entries(folder: &Path) -> Result<Vec<PathBuf>, Error> {
    let unreadable = |e: std::io::Error| {
        Error::of((&e).into(), "the folder cannot be read")
            .at(folder.display().to_string())
            .got(e.to_string())
    };
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(unreadable)? {
        found.push(entry.map_err(unreadable)?.path());
        if found.len() > MOST_ENTRIES {
            return Err(Error::of(ErrorKind::OutsideLimits, "too many files in one folder")
                .at(folder.display().to_string())
                .allowed(MOST_ENTRIES.to_string()));
        }
    }
    found.sort_unstable();
    Ok(found)
}

fn marks(text: &str) -> Result<Vec<Mark>, Error> {
    let mark = |(at, line)| Mark::read(line).map_err(|error| error.at(format!("line {}", at + 1)));
    text.trim_end().lines().enumerate().map(mark).collect()
}

/// Takes up one action of a clip.
fn take(labels: &mut Labels, clip: &str, class: &str, marks: &[Mark]) -> Result<(), Error> {
    let frames = *labels.frames.entry(clip.to_owned()).or_insert(marks.len());
    if frames != marks.len() {
        return Err(Error::of(
            ErrorKind::Malformed,
            "the actions of a trial have other numbers of frames",
        )
        .got(counted(marks.len(), "line"))
        .allowed(format!("{frames}, as the one before")));
    }
    labels.looked_for.entry(clip.to_owned()).or_default().insert(class.to_owned());
    let mut first = 0;
    for run in marks.chunk_by(|one, other| one == other) {
        let cut = Cut::Frames { first, last: first + run.len() - 1 };
        match run.first() {
            Some(Mark::Part) => labels.list.push(Label::of(clip, class, Some(cut))),
            Some(Mark::Unclear) => {
                labels.unclear.entry(clip.to_owned()).or_default().push((class.to_owned(), cut));
            }
            Some(Mark::Not) | None => {}
        }
        first += run.len();
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_of_frames_are_cuts_and_what_nobody_can_say_is_neither() {
        let mut labels = Labels::default();
        let text = "0.0\n1.0\n1.0\n0.5\n0\n1\n";
        take(&mut labels, "a.bvh", "kick", &marks(text).expect("marks")).expect("an action");
        let cuts: Vec<Option<Cut>> = labels.list.iter().map(|label| label.cut).collect();
        let cut = |first, last| Some(Cut::Frames { first, last });
        assert_eq!(cuts, [cut(1, 2), cut(5, 5)]);
        let unclear = Cut::Frames { first: 3, last: 3 };
        assert_eq!(labels.unclear["a.bvh"], [("kick".to_owned(), unclear)]);
        let other = take(&mut labels, "a.bvh", "walk", &marks("1.0").expect("marks"));
        assert!(other.expect_err("one frame").to_string().contains("1 line"));
    }

    #[test]
    fn a_line_that_is_none_of_the_three_is_refused_by_its_number() {
        for wrong in ["1.0\n0.7", "1.0\nyes", "1.0\nnan", "1.0\n\n1.0"] {
            let Err(error) = marks(wrong) else { panic!("{wrong}") };
            assert!(error.to_string().contains("line 2"), "{wrong}: {error}");
        }
    }
}
