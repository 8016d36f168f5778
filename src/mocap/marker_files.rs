//! Files that hold markers, told apart by their endings.

use crate::error::{Error, ErrorKind};
use crate::mocap::c3d;
use crate::mocap::csm;
use crate::mocap::marker_table;
use crate::mocap::markers::{Frame, Frames, Head, MarkerFormat, Markers};
use crate::mocap::opened::{as_utf8, bytes_of};
use crate::mocap::trc;
use crate::table;
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// Bytes of a table that are looked at to see what its columns are.
const TITLES_BYTES: u64 = 1 << 20;

/// The kind of a file: by its ending, and of a table by its titles.
#[must_use]
pub fn format_of(path: &Path) -> Option<MarkerFormat> {
    let ending = path.extension()?.to_str()?.to_ascii_lowercase();
    match ending.as_str() {
        "c3d" => Some(MarkerFormat::C3d),
        "trc" => Some(MarkerFormat::Trc),
        "csm" => Some(MarkerFormat::Csm),
        "csv" => is_marker_table(path).then_some(MarkerFormat::Csv),
        _ => None,
    }
}

/// The kind of file that is written under a name.
#[must_use]
pub fn written_as(path: &Path) -> Option<MarkerFormat> {
    let ending = path.extension()?.to_str()?;
    [MarkerFormat::C3d, MarkerFormat::Trc, MarkerFormat::Csm, MarkerFormat::Csv]
        .into_iter()
        .find(|format| ending.eq_ignore_ascii_case(format.word()))
}

fn is_marker_table(path: &Path) -> bool {
    // A pipe is read once only, and opening it waits for a writer.
    if !std::fs::metadata(path).is_ok_and(|found| found.is_file()) {
        return false;
    }
    let Ok(file) = File::open(path) else { return false };
    let mut start = Vec::new();
    let read = file.take(TITLES_BYTES).read_to_end(&mut start);
    read.is_ok() && marker_table::is_of_markers(&String::from_utf8_lossy(&as_utf8(start)))
}

/// Fails if a file is a table (.csv) whose columns are separated by semicolons or tabs: nothing knows it then.
///
/// # Errors
/// As said.
pub fn check_commas(path: &Path) -> Result<(), Error> {
    let is_csv = path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("csv"));
    if !is_csv || !std::fs::metadata(path).is_ok_and(|found| found.is_file()) {
        return Ok(());
    }
    let mut start = Vec::new();
    match File::open(path).and_then(|file| file.take(TITLES_BYTES).read_to_end(&mut start)) {
        Ok(_) => table::check_commas(&String::from_utf8_lossy(&as_utf8(start)))
            .map_err(|error| error.in_file(path)),
        // Whoever reads it says what is wrong.
        Err(_) => Ok(()),
    }
}

/// A file being read.
pub enum MarkerReader {
    /// Frame by frame: a file of any length.
    Stream(Box<c3d::Reader<Box<dyn Read>>>),
    /// All in memory.
    Whole {
        /// The markers.
        markers: Box<Markers>,
        /// Index of the frame that comes next.
        next: usize,
    },
}

/// Opens a file.
///
/// # Errors
/// If it cannot be read, breaks its format, or is of no kind that holds markers.
pub fn open(path: &Path) -> Result<MarkerReader, Error> {
    let in_file = |error: Error| error.in_file(path);
    let whole = |markers: Markers| MarkerReader::Whole { markers: Box::new(markers), next: 0 };
    match format_of(path) {
        Some(MarkerFormat::C3d) => Ok(MarkerReader::Stream(Box::new(c3d::open(path)?))),
        Some(MarkerFormat::Trc) => {
            let bytes = as_utf8(bytes_of(path, trc::MAX_FILE_BYTES)?);
            trc::parse(&bytes).map(whole).map_err(in_file)
        }
        Some(MarkerFormat::Csm) => {
            let bytes = as_utf8(bytes_of(path, csm::MAX_FILE_BYTES)?);
            csm::parse(&bytes).map(whole).map_err(in_file)
        }
        Some(MarkerFormat::Csv) => {
            let bytes = as_utf8(bytes_of(path, marker_table::MAX_FILE_BYTES)?);
            marker_table::parse(&bytes).map(whole).map_err(in_file)
        }
        None => {
            check_commas(path)?;
            Err(Error::of(ErrorKind::Unknown, "not a file of markers")
                .at(path.display().to_string())
                .allowed(
                    "a file that ends in .c3d, .trc or .csm, or a table (.csv) with columns LABEL_x_m, ...",
                ))
        }
    }
}

/// Reads a whole file. `rate_hz` says its frames per second where it does not, or somebody knows better.
///
/// # Errors
/// As [`open`], and what keeps a frame from being read.
pub fn read(path: &Path, rate_hz: Option<f64>) -> Result<Markers, Error> {
    let mut markers = match open(path)? {
        MarkerReader::Stream(reader) => {
            reader.into_markers().map_err(|error| error.in_file(path))?
        }
        MarkerReader::Whole { markers, .. } => *markers,
    };
    if let Some(rate_hz) = rate_hz {
        markers.take_rate(rate_hz)?;
    }
    Ok(markers)
}

/// As [`read`], without samples that are no places ([`Markers::without_placeless`]).
///
/// # Errors
/// As [`read`].
pub fn read_places(path: &Path, rate_hz: Option<f64>) -> Result<Markers, Error> {
    read(path, rate_hz).map(Markers::without_placeless)
}

impl MarkerReader {
    /// What other programs may stumble over in this file.
    #[must_use]
    pub fn findings(&self) -> Vec<String> {
        match self {
            Self::Stream(reader) => reader.findings(),
            Self::Whole { .. } => Vec::new(),
        }
    }

    /// What was found in the frames that were read.
    #[must_use]
    pub fn closing_notes(&self) -> Vec<String> {
        match self {
            Self::Stream(reader) => reader.closing_notes(),
            Self::Whole { .. } => Vec::new(),
        }
    }

    /// Takes somebody's word for the frames per second ([`Head::take_rate`]).
    ///
    /// # Errors
    /// A rate that nothing is captured with.
    pub fn take_rate(&mut self, rate_hz: f64) -> Result<(), Error> {
        match self {
            Self::Stream(reader) => reader.take_rate(rate_hz),
            Self::Whole { markers, .. } => markers.take_rate(rate_hz),
        }
    }
}

impl Frames for MarkerReader {
    fn head(&self) -> &Head {
        match self {
            Self::Stream(reader) => reader.head(),
            Self::Whole { markers, .. } => markers.head(),
        }
    }

    fn next_frame(&mut self, frame: &mut Frame) -> Result<bool, Error> {
        match self {
            Self::Stream(reader) => reader.next_frame(frame),
            Self::Whole { markers, next } => {
                let is_there = markers.frame(*next, frame);
                *next += usize::from(is_there);
                Ok(is_there)
            }
        }
    }
}
