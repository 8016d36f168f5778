//! Markers from one kind of file to another, frame by frame.

use super::observer::{Event, Observer};
use super::pending::go_on;
use super::report::Outcome;
use crate::draft::{Draft, Drafts, check_free};
use crate::error::{Error, ErrorKind};
use crate::mocap::markers::{Frame, Frames, Head, MarkerFormat};
use crate::mocap::{c3d, csm, marker_files, marker_table, trc};
use serde::Serialize;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

/// Frames between two words about progress.
const STEP: u64 = 4096;

/// Which markers become which file.
#[derive(Clone, Debug, PartialEq)]
pub struct MarkersOrder {
    /// A file of markers.
    pub markers: PathBuf,
    /// Frames per second, where the file does not say them or somebody knows better.
    pub rate_hz: Option<f64>,
    /// The file, whose ending says what is written.
    pub file: PathBuf,
    /// It may replace one that is there.
    pub replace: bool,
}

/// What came of it.
#[derive(Clone, Debug, Serialize)]
pub struct MarkersReport {
    /// `done`, or `done_with_loss` if the file claims frames that it does not hold.
    pub outcome: Outcome,
    /// The kind of file that was read.
    pub format: &'static str,
    /// Points read.
    pub points: usize,
    /// Frames written.
    pub frames: usize,
    /// Frames per second.
    pub rate_hz: Option<f64>,
    /// What was wrong with the file that was read, what was made of it, what was left out.
    pub notes: Vec<String>,
    /// Where.
    pub written: String,
}

/// Writes markers as another kind of file. Positions stay in the axes of the file.
///
/// # Errors
/// A file that cannot be read or is of no kind that holds markers, another ending of the file to be written,
/// one that exists or cannot be written, a rate or unit that nobody knows.
pub fn convert(order: &MarkersOrder, observer: &dyn Observer) -> Result<MarkersReport, Error> {
    let Some(kind) = marker_files::written_as(&order.file) else {
        return Err(Error::of(ErrorKind::Unknown, "this kind of file cannot be written")
            .at(order.file.display().to_string())
            .allowed(
                "of markers, a file that ends in .c3d, .trc, .csm, .csv, .bvh, .mot, .x3d or .html",
            ));
    };
    check_free(&order.file, order.replace)?;
    let mut reader = marker_files::open(&order.markers)?;
    if let Some(rate_hz) = order.rate_hz {
        reader.take_rate(rate_hz)?;
    }
    let head = reader.head().clone();
    let in_file = |error: Error| match error.place {
        None => error.at(order.markers.display().to_string()),
        Some(_) => error,
    };
    let mut files = Drafts::default();
    let left_out = written(&mut files, &order.file, order.replace, kind, &mut reader, observer);
    let left_out = left_out.map_err(in_file)?;
    files.keep()?;
    let mut notes = head.notes.clone();
    notes.extend(reader.closing_notes());
    notes.extend(left_out);
    Ok(MarkersReport {
        outcome: if head.lost_frames > 0 { Outcome::DoneWithLoss } else { Outcome::Done },
        format: head.format.word(),
        points: head.points.len(),
        frames: head.frames,
        rate_hz: head.rate_hz,
        notes,
        written: order.file.display().to_string(),
    })
}

/// Writes frames as one kind of file, which is still to be kept. What could not be written is in the notes that come
/// back.
///
/// # Errors
/// A file that exists or cannot be written, frames that cannot be read, a rate or unit that nobody knows.
pub(super) fn written(
    files: &mut Drafts,
    file: &Path,
    replace: bool,
    kind: MarkerFormat,
    frames: &mut dyn Frames,
    observer: &dyn Observer,
) -> Result<Vec<String>, Error> {
    let unwritable = |cause: std::io::Error| {
        Error::unwritten("cannot write the file", &cause).at(file.display().to_string())
    };
    let draft = Draft::whole(file, replace).map_err(unwritable)?;
    let mut out = BufWriter::with_capacity(1 << 16, draft);
    let mut told = Told { frames, observer, done: 0, is_unread: false };
    let written = match kind {
        MarkerFormat::C3d => c3d::write::write(&mut out, &mut told),
        MarkerFormat::Trc => trc::write(&mut out, &name_of(file), &mut told),
        MarkerFormat::Csm => csm::write(&mut out, &name_of(file), &mut told),
        MarkerFormat::Csv => marker_table::write(&mut out, &mut told),
    };
    let left_out = written.map_err(|error| {
        // What could not be read is of another file.
        let is_of_this = error.kind == ErrorKind::Io && error.place.is_none() && !told.is_unread;
        if is_of_this { error.at(file.display().to_string()) } else { error }
    })?;
    files.add(file, out.into_inner().map_err(|cause| unwritable(cause.into_error()))?);
    Ok(left_out)
}

fn name_of(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// Frames on their way, counted aloud.
struct Told<'a> {
    frames: &'a mut dyn Frames,
    observer: &'a dyn Observer,
    done: u64,
    is_unread: bool,
}

impl Frames for Told<'_> {
    fn head(&self) -> &Head {
        self.frames.head()
    }

    fn next_frame(&mut self, frame: &mut Frame) -> Result<bool, Error> {
        // A wish to stop leaves nothing behind.
        go_on(self.observer)?;
        let read = self.frames.next_frame(frame);
        self.is_unread |= read.is_err();
        let is_there = read?;
        self.done += u64::from(is_there);
        let total = self.frames.head().frames as u64;
        if !is_there || self.done.is_multiple_of(STEP) {
            let done = if is_there { self.done } else { total };
            self.observer.hear(Event::Step { done, total, what: "frames" });
        }
        Ok(is_there)
    }
}
