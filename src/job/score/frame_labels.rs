//! Labels frame by frame, as the ICS Action Database has them: for each trial a folder, in it for each action a file, in it
//! for each frame a line: 1.0 if the frame is part of the action, 0.0 if not, 0.5 if nobody can say. A frame may be part of
//! several actions.

use super::{Cut, Label, Labels, NOTHING, label_text};
use crate::error::{Error, ErrorKind};
use std::path::{Path, PathBuf};

/// Most files and folders in one folder.
const MOST_ENTRIES: usize = 10_000;

#[derive(Clone, Copy, PartialEq, Eq)]
enum Mark {
    Part,
    Unclear,
    Not,
}

/// The labels in a folder of trials, for clips of the same names in another: `LABELS/TRIAL/ACTION.txt` for
/// `CLIPS/TRIAL.bvh`.
///
/// # Errors
/// A folder or a file that cannot be read, a line that is none of the three numbers, actions of a trial with other numbers of
/// frames, a trial without a clip.
pub fn read(folder: &Path, clips: &Path) -> Result<Labels, Error> {
    let mut labels = Labels::default();
    let clips = entries(clips)?;
    for trial in entries(folder)?.into_iter().filter(|path| path.is_dir()) {
        let stem = |path: &PathBuf| path.file_stem().map(std::ffi::OsStr::to_owned);
        let named = |clip: &&PathBuf| clip.is_file() && stem(clip).as_deref() == trial.file_name();
        let clip = clips.iter().find(named).and_then(|clip| clip.file_name()?.to_str());
        let Some(clip) = clip else {
            return Err(Error::of(ErrorKind::Absent, "there is no clip of this trial")
                .at(trial.display().to_string())
                .remedy("name the folder of a trial like its clip"));
        };
        for file in entries(&trial)?.into_iter().filter(|path| path.is_file()) {
            let class = file.file_stem().and_then(std::ffi::OsStr::to_str).unwrap_or_default();
            let marks = label_text(&file).and_then(|text| marks(&text));
            take(&mut labels, clip, class, &marks.map_err(|error| error.in_file(&file))?)
                .map_err(|error| error.in_file(&file))?;
        }
        if !labels.list.iter().any(|label| label.file == clip) {
            // Nothing is in it: whatever is named there is false.
            labels.list.push(Label::of(clip, NOTHING, None));
        }
    }
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
    let mark = |(at, line): (usize, &str)| match line.trim().parse::<f64>() {
        Ok(1.0) => Ok(Mark::Part),
        Ok(0.5) => Ok(Mark::Unclear),
        Ok(0.0) => Ok(Mark::Not),
        _ => {
            Err(Error::of(ErrorKind::Malformed, "a frame is part of an action, or not, or unclear")
                .at(format!("line {}", at + 1))
                .got(line.trim().chars().take(40).collect::<String>())
                .allowed("1.0, 0.0 or 0.5"))
        }
    };
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
        .got(format!("{} lines", marks.len()))
        .allowed(format!("{frames}, as the one before")));
    }
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
        assert!(other.expect_err("one frame").to_string().contains("1 lines"));
    }

    #[test]
    fn a_line_that_is_none_of_the_three_is_refused_by_its_number() {
        for wrong in ["1.0\n0.7", "1.0\nyes", "1.0\nnan", "1.0\n\n1.0"] {
            let Err(error) = marks(wrong) else { panic!("{wrong}") };
            assert!(error.to_string().contains("line 2"), "{wrong}: {error}");
        }
    }
}
