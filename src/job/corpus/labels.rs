//! What is done in which frames of trials that are added: from tables, from folders of labels of frames, or as the
//! program recognises it.

use crate::corpus::rows::LabelEntry;
use crate::error::{Error, ErrorKind};
use crate::job::labels::{self, Cut, NOTHING};
use crate::job::recognise::{EquationReading, models, of_capture};
use crate::job::report::counted;
use crate::mocap::anatomy::Capture;
use crate::recognise::machine::Span;
use crate::recognise::model::BodySide;
use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsString;
use std::path::{Path, PathBuf};

/// A label of a clip.
struct ClipLabel {
    /// The clip, from its folder on.
    file: String,
    class: String,
    side: Option<BodySide>,
    cut: Option<Cut>,
    /// How many frames have labels, where they have them one by one.
    all_frames: Option<usize>,
    /// True if nobody can say.
    is_unclear: bool,
}

/// The labels in a table, or in a folder of labels of frames of the clips in `clips`.
///
/// # Errors
/// What cannot be read, or is none.
fn clip_labels(path: &Path, clips: &Path) -> Result<Vec<ClipLabel>, Error> {
    let read = labels::read(path, Some(clips))?;
    let of = |file: &str, class: &str, side, cut, is_unclear| ClipLabel {
        file: file.to_owned(),
        class: class.to_owned(),
        side,
        cut,
        all_frames: read.frames.get(file).copied(),
        is_unclear,
    };
    let clear = read.list.iter().filter(|label| label.class != NOTHING || label.cut.is_some());
    let clear = clear.map(|label| of(&label.file, &label.class, label.side, label.cut, false));
    let unclear = read.unclear.iter().flat_map(|(file, cuts)| {
        cuts.iter().map(|(class, cut)| of(file, class, None, Some(*cut), true))
    });
    Ok(clear.chain(unclear).collect())
}

/// Labels of files.
#[derive(Default)]
pub struct KnownLabels {
    /// The folder from which on files are named.
    folder: PathBuf,
    /// By the names of files without their folders.
    by_name: BTreeMap<OsString, Vec<ClipLabel>>,
}

impl KnownLabels {
    /// Reads a table, or a folder of labels of frames that belong to the files of `clips`.
    ///
    /// # Errors
    /// What cannot be read, or is none.
    pub fn read(path: &Path, clips: Option<&Path>) -> Result<Self, Error> {
        if !path.is_dir() {
            let folder = path.parent().unwrap_or(Path::new(".")).to_owned();
            return Ok(Self::of_labels(clip_labels(path, &folder)?, folder));
        }
        let clips = clips.ok_or_else(|| {
            Error::new("a folder of labels belongs to a folder of clips")
                .at(path.display().to_string())
                .remedy("name the folder of clips as what is to be added")
        })?;
        Ok(Self::of_labels(clip_labels(path, clips)?, clips.to_owned()))
    }

    fn of_labels(labels: Vec<ClipLabel>, folder: PathBuf) -> Self {
        let mut by_name: BTreeMap<OsString, Vec<ClipLabel>> = BTreeMap::new();
        for label in labels {
            let name = Path::new(&label.file).file_name().unwrap_or_default().to_owned();
            by_name.entry(name).or_default().push(label);
        }
        Self { folder, by_name }
    }

    /// Adds a label of a file.
    pub fn add(&mut self, file: &Path, class: String, span: Span) {
        let name = file.file_name().unwrap_or_default().to_owned();
        // From wherever files are named, a whole path is one.
        let file = file.canonicalize().unwrap_or_else(|_| file.to_owned());
        let file = file.display().to_string();
        let cut = Some(Cut::Seconds(span));
        let label = ClipLabel { file, class, side: None, cut, all_frames: None, is_unclear: false };
        self.by_name.entry(name).or_default().push(label);
    }

    /// Labels of a file.
    fn of<'a>(&'a self, file: &'a Path) -> impl Iterator<Item = &'a ClipLabel> {
        let alike = file.file_name().and_then(|name| self.by_name.get(name));
        alike.into_iter().flatten().filter(move |label| {
            let labelled = self.folder.join(&label.file);
            let is_same = |a: PathBuf| file.canonicalize().is_ok_and(|b| a == b);
            labelled == file || labelled.canonicalize().is_ok_and(is_same)
        })
    }

    /// Clips that are labelled, and are none of these files.
    #[must_use]
    pub fn unused<'a>(&'a self, files: &[PathBuf]) -> BTreeSet<&'a str> {
        let all = self.by_name.values().flatten();
        let mut unused: BTreeSet<&str> = all.map(|of| of.file.as_str()).collect();
        for label in files.iter().flat_map(|file| self.of(file)) {
            unused.remove(label.file.as_str());
        }
        unused
    }

    /// What a whole file is, if a label without times says so.
    #[must_use]
    pub fn action(&self, file: &Path) -> Option<String> {
        let mut whole = self.of(file).filter(|label| label.cut.is_none());
        whole.next().map(|label| label.class.clone())
    }

    /// The labels of a file with so many frames a second.
    ///
    /// # Errors
    /// Labels beyond its end.
    pub fn entries(
        &self,
        file: &Path,
        annotator: &str,
        frames: usize,
        rate_hz: f64,
    ) -> Result<Vec<LabelEntry>, Error> {
        let last = frames.saturating_sub(1);
        let mut found = Vec::new();
        for label in self.of(file) {
            if label.all_frames.is_some_and(|count| count != frames) {
                return Err(Error::of(ErrorKind::Malformed, "labels of another number of frames")
                    .at(file.display().to_string())
                    .got(counted(label.all_frames.unwrap_or(0), "label"))
                    .allowed(format!("{frames}, a line for each frame")));
            }
            let (first, end) = match label.cut {
                Some(Cut::Frames { first, last }) => (first, last),
                Some(Cut::Seconds(span)) => {
                    let at = |time_s: f64| (time_s * rate_hz).round() as usize;
                    (at(span.start_s.max(0.0)), at(span.end_s))
                }
                None => (0, last),
            };
            if first > last {
                return Err(Error::of(ErrorKind::OutsideLimits, "a label begins after the end")
                    .at(file.display().to_string())
                    .got(match label.cut {
                        Some(Cut::Seconds(span)) => {
                            format!("{} from {:.3} s on", label.class, span.start_s)
                        }
                        _ => format!("{} from frame {first} on", label.class),
                    })
                    .allowed(format!("frames 0 to {last}, {:.3} s", last as f64 / rate_hz)));
            }
            let value = if label.is_unclear { 0.5 } else { 1.0 };
            found.extend(with_side(
                &label.class,
                label.side,
                first,
                end.min(last),
                value,
                annotator,
            ));
        }
        Ok(found)
    }
}

/// A label and, where it has a side, one with it: `wave` and `wave-l`.
fn with_side(
    class: &str,
    side: Option<BodySide>,
    first: usize,
    last: usize,
    value: f64,
    annotator: &str,
) -> Vec<LabelEntry> {
    let label = |label: String| LabelEntry {
        trial: String::new(),
        set: String::new(),
        action: String::new(),
        label,
        first_frame: first as i64,
        last_frame: last as i64,
        value,
        annotator: annotator.to_owned(),
    };
    let sided = side.map(|side| match side {
        BodySide::Left => format!("{class}-l"),
        BodySide::Right => format!("{class}-r"),
    });
    std::iter::once(class.to_owned()).chain(sided).map(label).collect()
}

/// What the program recognises.
///
/// # Errors
/// Models that cannot be read, a body that cannot be seen.
pub fn recognised(capture: &Capture) -> Result<Vec<LabelEntry>, Error> {
    let found = of_capture(capture, models(None)?, EquationReading::Repaired, &mut |_| ())?;
    let last = capture.poses.len().saturating_sub(1);
    let at = |time_s: f64| ((time_s * capture.rate_hz).round().max(0.0) as usize).min(last);
    let annotator = concat!("gaitway ", env!("CARGO_PKG_VERSION"));
    let labels = found.events.iter().flat_map(|event| {
        with_side(&event.action, event.side, at(event.start_s), at(event.end_s), 1.0, annotator)
    });
    Ok(labels.collect())
}

/// A label of all frames of a trial.
#[must_use]
pub fn throughout(label: &str, frames: usize, annotator: &str) -> LabelEntry {
    LabelEntry {
        trial: String::new(),
        set: String::new(),
        action: String::new(),
        label: label.to_owned(),
        first_frame: 0,
        last_frame: frames.saturating_sub(1) as i64,
        value: 1.0,
        annotator: annotator.to_owned(),
    }
}
