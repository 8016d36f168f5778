//! The named pieces of a capture as trials of their own.
//!
//! What is cut is what the recogniser names, or what a table says (`recognise --labels`, perhaps mended by hand). A
//! BVH file is cut as it stands: its skeleton and every number of its channels stay. Anything else becomes BVH files of the
//! body model, as `convert` writes them.

use super::labels::label_text;
use super::recognise::{EquationReading, models, of_capture};
use super::source::{self, CaptureOptions, Source, body_motion};
use crate::body::{JointAngles, Proportions, Segment, SegmentPose};
use crate::corpus::store::check_outside;
use crate::draft;
use crate::error::{Error, ErrorKind};
use crate::mocap::anatomy::Capture;
use crate::mocap::bvh::{self, Bvh};
use crate::mocap::export;
use crate::recognise::model::BodySide;
use crate::table::{TableWriter, rows};
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Rounding of times, s.
const ROUNDED_S: f64 = 1e-9;
/// Most pieces of a capture.
const MAX_PIECES: usize = 10_000;

/// What is to be cut.
#[derive(Clone, Debug, Default)]
pub struct CutOrder {
    /// A capture, or actions.
    pub motion: String,
    /// File that says which joint of the capture is which body segment.
    pub mapping: Option<PathBuf>,
    /// What the capture does not say itself.
    pub reading: CaptureOptions,
    /// Folder of models in place of the shipped ones.
    pub models: Option<PathBuf>,
    /// A table of what is where, in place of what is recognised.
    pub labels: Option<PathBuf>,
    /// The actions to cut, by name; empty for all.
    pub only: Vec<String>,
    /// So much is left before and after each piece, s.
    pub margin_s: f64,
    /// Events of one action that are no further apart are one piece, s.
    pub join_s: f64,
    /// Folder for the pieces and their table.
    pub folder: PathBuf,
    /// Files may replace others.
    pub replace: bool,
}

/// Something that somebody does.
#[derive(Clone, Debug, PartialEq)]
struct Doing {
    class: String,
    side: String,
    start_s: f64,
    end_s: f64,
}

/// One piece.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CutPiece {
    /// Its file, in the folder.
    pub file: String,
    /// The action.
    pub action: String,
    /// So many events are in it.
    pub events: usize,
    /// Its first frame in the capture, from 0.
    pub first_frame: usize,
    /// Frames.
    pub frames: usize,
    /// Its first frame, s of the capture.
    pub start_s: f64,
    /// Its last frame, s of the capture.
    pub end_s: f64,
}

/// What was cut.
#[derive(Clone, Debug, Serialize)]
pub struct CutReport {
    /// `done`.
    pub outcome: &'static str,
    /// What was cut.
    pub motion: String,
    /// The motion as it came in.
    pub source: Source,
    /// Frames per second.
    pub rate_hz: f64,
    /// Frames.
    pub frames: usize,
    /// Whether the pieces are those of the file, number by number, or of the body model.
    pub as_it_stands: bool,
    /// The pieces, in the order of their beginnings.
    pub pieces: Vec<CutPiece>,
    /// The table of what is where in them; null if there are none.
    pub labels: Option<String>,
    /// Choices made on the way.
    pub notes: Vec<String>,
}

/// Cuts the named pieces out of a capture.
///
/// # Errors
/// A capture, a model or a table that cannot be read, margins that are none, a file that cannot be written.
pub fn cut(order: &CutOrder) -> Result<CutReport, Error> {
    check_outside(&order.folder)?;
    for (name, value_s) in [("--margin", order.margin_s), ("--join", order.join_s)] {
        if !(0.0..=3600.0).contains(&value_s) {
            return Err(Error::of(ErrorKind::OutsideLimits, "a time is out of range")
                .at(name)
                .got(format!("{value_s} s"))
                .allowed("0 to 3600 s"));
        }
    }
    let (capture, source) = body_motion(&order.motion, order.mapping.as_deref(), &order.reading)?;
    let doings = match &order.labels {
        Some(table) => listed(table, &order.motion)?,
        None => {
            let models = models(order.models.as_deref())?;
            let found = of_capture(&capture, models, EquationReading::Repaired, &mut |_| ())?;
            let doing = |event: super::recognise::RecognisedAction| Doing {
                class: event.action,
                side: event.side.map_or("", side_letter).to_owned(),
                start_s: event.start_s,
                end_s: event.end_s,
            };
            found.events.into_iter().map(doing).collect()
        }
    };
    let is_asked = |doing: &Doing| order.only.is_empty() || order.only.contains(&doing.class);
    let mut pieces = joined(doings.into_iter().filter(is_asked).collect(), order.join_s);
    pieces.sort_by(|a, b| a[0].start_s.total_cmp(&b[0].start_s));
    if pieces.len() > MAX_PIECES {
        return Err(Error::of(ErrorKind::OutsideLimits, "there are too many pieces")
            .at(order.motion.clone())
            .got(pieces.len().to_string())
            .allowed(MAX_PIECES.to_string())
            .remedy("join what is near: --join 2"));
    }
    let whole = Whole::of(&order.motion, &capture)?;
    let stem = Path::new(&order.motion).file_stem().and_then(|stem| stem.to_str());
    let stem =
        stem.filter(|_| source::file_kind(Path::new(&order.motion)) != source::FileKind::Other);
    let mut cuts = Vec::new();
    for (index, doings) in pieces.iter().enumerate() {
        let Some(span) = frames_of(doings, order.margin_s, &capture) else { continue };
        let file =
            format!("{}-{:03}-{}.bvh", stem.unwrap_or("action"), index + 1, word(&doings[0].class));
        draft::check_free(&order.folder.join(&file), order.replace)?;
        cuts.push((file, span, doings));
    }
    let table = order.folder.join("labels.csv");
    if !cuts.is_empty() {
        draft::check_free(&table, order.replace)?;
        std::fs::create_dir_all(&order.folder).map_err(|e| {
            Error::of((&e).into(), "cannot make the folder")
                .at(order.folder.display().to_string())
                .got(e.to_string())
        })?;
    }
    for (file, (first, count), _) in &cuts {
        draft::write_file(&order.folder.join(file), order.replace, &whole.piece(*first, *count))?;
    }
    if !cuts.is_empty() {
        draft::write_file(&table, order.replace, &labels(&cuts, capture.rate_hz)?)?;
    }
    let piece = |(file, (first, count), doings): (String, (usize, usize), &Vec<Doing>)| CutPiece {
        file,
        action: doings[0].class.clone(),
        events: doings.len(),
        first_frame: first,
        frames: count,
        start_s: first as f64 / capture.rate_hz,
        end_s: (first + count - 1) as f64 / capture.rate_hz,
    };
    Ok(CutReport {
        outcome: "done",
        motion: order.motion.clone(),
        rate_hz: capture.rate_hz,
        frames: capture.poses.len(),
        as_it_stands: matches!(whole, Whole::File(_)),
        labels: (!cuts.is_empty()).then(|| table.display().to_string()),
        pieces: cuts.into_iter().map(piece).collect(),
        notes: capture.notes,
        source,
    })
}

const fn side_letter(side: BodySide) -> &'static str {
    match side {
        BodySide::Left => "L",
        BodySide::Right => "R",
    }
}

/// A class as a part of a file's name.
fn word(class: &str) -> String {
    let fits = |c: char| if c.is_ascii_alphanumeric() || c == '-' { c } else { '-' };
    class.chars().take(60).map(fits).collect()
}

/// Events of one action that are near each other, together.
fn joined(mut doings: Vec<Doing>, join_s: f64) -> Vec<Vec<Doing>> {
    doings.sort_by(|a, b| a.class.cmp(&b.class).then(a.start_s.total_cmp(&b.start_s)));
    let mut pieces: Vec<Vec<Doing>> = Vec::new();
    let mut end_s = f64::NEG_INFINITY;
    for doing in doings {
        match pieces.last_mut() {
            Some(piece)
                if piece[0].class == doing.class && doing.start_s - end_s <= join_s + ROUNDED_S =>
            {
                end_s = end_s.max(doing.end_s);
                piece.push(doing);
            }
            _ => {
                end_s = doing.end_s;
                pieces.push(vec![doing]);
            }
        }
    }
    pieces
}

/// The first frame of a piece with its margins and how many it has; none if nothing of it is in the capture.
fn frames_of(doings: &[Doing], margin_s: f64, capture: &Capture) -> Option<(usize, usize)> {
    let start_s = doings[0].start_s - margin_s;
    let end_s = doings.iter().map(|doing| doing.end_s).fold(f64::NEG_INFINITY, f64::max) + margin_s;
    let first = (start_s * capture.rate_hz).round().max(0.0) as usize;
    let last = (end_s * capture.rate_hz).round().max(0.0) as usize;
    let last = last.min(capture.poses.len().checked_sub(1)?);
    // A capture of one pose has no motion.
    (first < last).then(|| (first, last + 1 - first))
}

/// What pieces are cut out of.
enum Whole {
    /// The file as it stands.
    File(Bvh),
    /// The body model in the motion.
    Body(Bvh),
}

impl Whole {
    fn of(motion: &str, capture: &Capture) -> Result<Self, Error> {
        let path = Path::new(motion);
        if source::file_kind(path) == source::FileKind::Bvh {
            let file = bvh::read(path)?;
            if file.pose_count() == capture.poses.len() {
                return Ok(Self::File(file));
            }
        }
        let body = Proportions::of_stature(capture.stature_m)?;
        let angles = JointAngles::of_clip(&capture.poses, capture.rate_hz).angles;
        let modelled = |(angles, pose): (&JointAngles, &SegmentPose)| {
            angles.to_pose(pose.root_m, pose.orientation[Segment::Pelvis.index()])
        };
        let poses: Vec<SegmentPose> = angles.iter().zip(&capture.poses).map(modelled).collect();
        Ok(Self::Body(export::bvh_of(&poses, &body, capture.rate_hz)))
    }

    fn piece(&self, first: usize, count: usize) -> Vec<u8> {
        let (Self::File(whole) | Self::Body(whole)) = self;
        let channels = whole.channel_count();
        let values = whole.values.iter().skip(first * channels).take(count * channels);
        let piece = Bvh { values: values.copied().collect(), ..without_poses(whole) };
        bvh::write(&piece).into_bytes()
    }
}

fn without_poses(whole: &Bvh) -> Bvh {
    Bvh { joints: whole.joints.clone(), time_step_s: whole.time_step_s, values: Vec::new() }
}

/// The table of the pieces: `score classification` reads it.
fn labels(cuts: &[(String, (usize, usize), &Vec<Doing>)], rate_hz: f64) -> Result<Vec<u8>, Error> {
    let mut out = TableWriter::new(Vec::new());
    out.row(["file", "class", "side", "start_s", "end_s"])?;
    for (file, (first, count), doings) in cuts {
        let begins_s = *first as f64 / rate_hz;
        let length_s = (*count - 1) as f64 / rate_hz;
        for doing in *doings {
            out.row([
                file.clone(),
                doing.class.clone(),
                doing.side.clone(),
                format!("{:.4}", (doing.start_s - begins_s).max(0.0)),
                format!("{:.4}", (doing.end_s - begins_s).min(length_s)),
            ])?;
        }
    }
    out.finish()
}

/// What a table says of a capture. Rows that name another file are left out.
fn listed(path: &Path, motion: &str) -> Result<Vec<Doing>, Error> {
    parse(&label_text(path)?, motion).map_err(|error| error.in_file(path))
}

fn parse(text: &str, motion: &str) -> Result<Vec<Doing>, Error> {
    let mut rows = rows(text);
    let titles = rows
        .next()
        .ok_or_else(|| Error::of(ErrorKind::Malformed, "the table of labels is empty"))??;
    let column = |name: &str| titles.cells().position(|title| title == name);
    let (Some(class), Some(start), Some(end)) =
        (column("class"), column("start_s"), column("end_s"))
    else {
        return Err(Error::of(ErrorKind::Malformed, "a table of what is where has other columns")
            .at("line 1")
            .got(titles.cells().collect::<Vec<_>>().join(", "))
            .allowed("class, start_s, end_s, and if known side, file"));
    };
    let (side, file) = (column("side"), column("file"));
    let name = Path::new(motion).file_name();
    let mut doings = Vec::new();
    for row in rows {
        let row = row?;
        let cell = |at: usize| row.cells().nth(at).unwrap_or("");
        let of = file.map(cell).filter(|file| !file.is_empty());
        if of.is_some_and(|of| Path::new(of).file_name() != name) {
            continue;
        }
        let time = |at: usize| cell(at).parse::<f64>().ok().filter(|time_s| time_s.is_finite());
        let (Some(start_s), Some(end_s)) = (time(start), time(end)) else {
            return Err(Error::of(ErrorKind::Malformed, "a time is no number")
                .at(format!("line {}", row.line))
                .got(format!("{} to {}", cell(start), cell(end))));
        };
        if start_s >= end_s || cell(class).is_empty() {
            return Err(Error::of(
                ErrorKind::Malformed,
                "a piece has a class, and ends after it begins",
            )
            .at(format!("line {}", row.line))
            .got(format!("{} from {start_s} to {end_s} s", cell(class))));
        }
        let side = match side.map_or("", cell) {
            "left" | "L" => "L",
            "right" | "R" => "R",
            _ => "",
        };
        doings.push(Doing { class: cell(class).to_owned(), side: side.to_owned(), start_s, end_s });
    }
    Ok(doings)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn doing(class: &str, start_s: f64, end_s: f64) -> Doing {
        Doing { class: class.to_owned(), side: String::new(), start_s, end_s }
    }

    #[test]
    fn strides_that_follow_each_other_are_one_piece_and_a_pause_or_another_action_parts_them() {
        let doings = vec![
            doing("walk", 0.0, 1.0),
            doing("walk", 0.5, 1.5),
            doing("bow", 1.6, 3.0),
            doing("walk", 1.9, 2.4),
            doing("walk", 4.0, 4.5),
        ];
        let pieces = joined(doings, 0.5);
        let counts: Vec<(&str, usize)> =
            pieces.iter().map(|piece| (piece[0].class.as_str(), piece.len())).collect();
        assert_eq!(counts, [("bow", 1), ("walk", 3), ("walk", 1)]);
    }

    #[test]
    fn a_table_is_read_with_the_sides_of_both_its_writers_and_other_files_are_left_out() {
        let text =
            "file,class,side,start_s,end_s\nx/a.bvh,walk,L,0,1\nb.bvh,bow,,0,1\n,wave,right,1,2\n";
        let doings = parse(text, "folder/a.bvh").expect("a table");
        let found: Vec<(&str, &str)> =
            doings.iter().map(|of| (of.class.as_str(), of.side.as_str())).collect();
        assert_eq!(found, [("walk", "L"), ("wave", "R")]);
        for (wrong, said) in [
            ("class,start_s\nwalk,1\n", "line 1"),
            ("class,start_s,end_s\nwalk,2,1\n", "line 2"),
            ("class,start_s,end_s\nwalk,nan,1\n", "line 2"),
            ("", "empty"),
        ] {
            assert!(parse(wrong, "a.bvh").expect_err(wrong).to_string().contains(said), "{wrong}");
        }
    }
}
