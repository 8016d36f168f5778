//! Markers as a table of comma-separated values whose columns say what they are.
//!
//! `frame` (may be missing), `time_s`, then three columns of each point: `LABEL_x_UNIT`, `LABEL_y_UNIT`,
//! `LABEL_z_UNIT`. Places are written in metres (`_m`); `_mm`, `_cm` and other units are read as well. Without a
//! unit it is unknown. A point that was not seen has empty cells. What is no place has its unit, or a word that says
//! what it is (`_angle`, `_force`, ...) where its unit does not.

use crate::error::{Error, ErrorKind, counted, either};
use crate::mocap::even_times;
use crate::mocap::markers::{
    Frame, Frames, Head, MAX_POINTS, MarkerFormat, MarkerPoint, Markers, PointKind, PointSample,
    metres_of,
};
use crate::table::{self, Row, TableWriter};
use std::collections::BTreeSet;
use std::io::Write;

/// Largest file read, bytes.
pub const MAX_FILE_BYTES: u64 = 256 << 20;
/// What positions may take beside two times the file, bytes.
const SPARE_BYTES: usize = 8 << 20;
const POSITION_BYTES: usize = 12;
/// What is no place.
const KINDS: [PointKind; 5] =
    [PointKind::Angle, PointKind::Force, PointKind::Moment, PointKind::Power, PointKind::Scalar];
const SHAPE: &str =
    "time_s, then LABEL_x_m, LABEL_y_m, LABEL_z_m for each marker (or _mm, _cm, ...)";

/// True if a table with these titles is one of markers: some point has places, and nothing is an angle of a
/// joint or a turn of a segment, as in tables of these, which may have places beside them.
#[must_use]
pub fn is_of_markers(titles: &str) -> bool {
    let first = titles.lines().next().unwrap_or_default();
    let titles = || first.split(',').map(|title| title.trim().trim_matches('"'));
    let is_place = |title: &str| {
        part(title).is_some_and(|(_, _, unit)| unit.is_empty() || metres_of(unit).is_some())
    };
    // Angles of markers come in threes, those of joints one by one.
    let all: BTreeSet<&str> = titles().collect();
    let is_of_three = |title: &str| {
        part(title).is_some_and(|(label, _, unit)| {
            ["x", "y", "z"]
                .iter()
                .all(|axis| all.contains(format!("{label}_{axis}_{unit}").as_str()))
        })
    };
    titles().filter(|title| is_place(title)).count() >= 3
        && !titles().any(|title| title.ends_with("_qw"))
        && !titles().any(|title| title.ends_with("_rad") && !is_of_three(title))
}

/// Label, axis and unit of a column.
fn part(title: &str) -> Option<(&str, usize, &str)> {
    let axes = ["_x", "_y", "_z"].into_iter().enumerate();
    let found = axes.filter_map(|(axis, mark)| {
        let at = title.rfind(mark)?;
        let (label, rest) = title.split_at(at);
        let unit = rest.strip_prefix(mark)?;
        let unit = if unit.is_empty() { Some("") } else { unit.strip_prefix('_') };
        unit.filter(|unit| !unit.contains('_')).map(|unit| (at, (label, axis, unit)))
    });
    found.max_by_key(|(at, _)| *at).map(|(_, part)| part)
}

/// Reads the bytes of a file.
///
/// # Errors
/// If it is no such table or exceeds a bound; the message names the line.
pub fn parse(bytes: &[u8]) -> Result<Markers, Error> {
    let text = str::from_utf8(bytes).map_err(|cause| {
        Error::of(ErrorKind::Malformed, "the table is no text")
            .at(format!("byte {}", cause.valid_up_to()))
            .allowed("UTF-8")
    })?;
    let mut rows = table::rows(text);
    let titles = rows.next().transpose()?;
    let titles: Vec<&str> = titles.iter().flat_map(Row::cells).collect();
    let mut head = Head::new(MarkerFormat::Csv);
    let columns = columns(&titles, &mut head)?;
    let count = rows.count();
    let needed = count.saturating_mul(head.points.len()).saturating_mul(POSITION_BYTES);
    let most = bytes.len().saturating_mul(2) + SPARE_BYTES;
    if needed > most {
        return Err(Error::of(
            ErrorKind::Malformed,
            "the markers would take far more memory than the file",
        )
        .got(format!(
            "{count} for {}",
            counted(head.points.len(), "marker"),
            count = counted(count, "row")
        ))
        .allowed(format!("{}; needed: {needed}", counted(most, "byte")))
        .remedy("leave out the markers that are never seen"));
    }
    head.frames = count;
    let points = head.points.len();
    let mut markers = Markers::with_room(head)?;
    let mut frame = Frame::default();
    let (mut first_s, mut last_s, mut partial, mut first_frame) = (None, 0.0, 0_usize, None);
    let mut times = Vec::new();
    for row in table::rows(text).skip(1) {
        let row = row?;
        let wrong = |what: &str, got: String| {
            Error::of(ErrorKind::Malformed, what.to_owned())
                .at(format!("line {}", row.line))
                .got(got)
                .allowed(SHAPE)
        };
        if row.width() != titles.len() {
            let got =
                format!("{}, {}", counted(row.width(), "cell"), counted(titles.len(), "column"));
            return Err(wrong("a row has not one cell per column", got));
        }
        let mut numbers = vec![[None; 3]; points];
        for (cell, (column, title)) in row.cells().zip(columns.iter().zip(&titles)) {
            let number = || {
                let number = cell.parse().ok().filter(|number: &f64| number.is_finite());
                number.ok_or_else(|| wrong("a cell is no number", format!("{title}: {cell}")))
            };
            match *column {
                Column::Frame => {
                    let number = number()?;
                    first_frame.get_or_insert(if number >= 1.0 { number as u64 } else { 1 });
                }
                Column::Time => {
                    let time_s = number()?;
                    if first_s.is_some() && !(time_s > last_s) {
                        return Err(wrong("time does not go on", format!("{time_s} s")));
                    }
                    first_s.get_or_insert(time_s);
                    last_s = time_s;
                    times.push((row.line, time_s));
                }
                Column::Part { point, axis, scale } => {
                    let place = numbers.get_mut(point).and_then(|of| of.get_mut(axis));
                    if let Some(place) = place.filter(|_| !cell.is_empty()) {
                        *place = Some((number()? / scale) as f32);
                    }
                }
                Column::Other => {}
            }
        }
        frame.points.clear();
        for numbers in numbers {
            let seen = numbers.iter().flatten().count();
            partial += usize::from(seen == 1 || seen == 2);
            frame.points.push(match numbers {
                [Some(x), Some(y), Some(z)] => {
                    Some(PointSample { position: [x, y, z], residual: 0.0, cameras: 0 })
                }
                _ => None,
            });
        }
        markers.push(&frame);
    }
    even_times::check(&times)?;
    let steps = count.saturating_sub(1) as f64;
    let rate_hz = first_s.map(|first_s| steps / (last_s - first_s));
    if let Some(rate_hz) = rate_hz.filter(|rate_hz| rate_hz.is_finite() && *rate_hz > 0.0) {
        // Times are written in so many digits: a rate that is nearly whole is whole.
        let whole = rate_hz.round();
        markers.set_rate(if (rate_hz - whole).abs() < 1e-5 * rate_hz { whole } else { rate_hz });
    }
    markers.set_first_frame(first_frame.unwrap_or(1));
    if partial > 0 {
        markers.note(format!(
            "{} with one or two of three coordinates: taken as not seen",
            counted(partial, "sample")
        ));
    }
    Ok(markers)
}

/// What a column holds.
#[derive(Clone, Copy)]
enum Column {
    Frame,
    Time,
    Part { point: usize, axis: usize, scale: f64 },
    Other,
}

fn columns(titles: &[&str], head: &mut Head) -> Result<Vec<Column>, Error> {
    let malformed = |what: &str, got: String| {
        Error::of(ErrorKind::Malformed, what.to_owned()).at("line 1").got(got).allowed(SHAPE)
    };
    if !titles.contains(&"time_s") {
        let got = titles.first().copied().unwrap_or("nothing").to_owned();
        return Err(malformed("not a table of markers: there is no column time_s", got));
    }
    let mut columns = Vec::with_capacity(titles.len());
    let mut known = std::collections::BTreeMap::new();
    let mut parts = Vec::new();
    let mut other = 0;
    for title in titles {
        let column = match (*title, part(title)) {
            ("time_s", _) => Column::Time,
            ("frame", _) => Column::Frame,
            (_, Some((label, axis, unit))) => {
                let next = parts.len();
                let point = *known.entry((label, unit)).or_insert(next);
                if point == next {
                    parts.push([false; 3]);
                    if next == MAX_POINTS {
                        return Err(malformed(
                            "too many markers",
                            format!("more than {MAX_POINTS}"),
                        ));
                    }
                    let kind = kind_of(unit);
                    // One unit for all places: metres, if they are all of known length.
                    let unit = match metres_of(unit) {
                        Some(_) => "m",
                        None if unit == kind.word() => "",
                        None => unit,
                    };
                    let (label, unit) = (label.to_owned(), unit.to_owned());
                    head.points.push(MarkerPoint { label, description: String::new(), kind, unit });
                }
                let place = parts.get_mut(point).and_then(|axes| axes.get_mut(axis));
                if place.is_none_or(|place| std::mem::replace(place, true)) {
                    return Err(malformed("a column comes twice", (*title).to_owned()));
                }
                let scale = 1.0 / metres_of(unit).unwrap_or(1.0);
                Column::Part { point, axis, scale }
            }
            _ => {
                other += 1;
                Column::Other
            }
        };
        columns.push(column);
    }
    if let Some(at) = parts.iter().position(|axes| axes.contains(&false)) {
        let label = head.points.get(at).map(|point| point.label.clone()).unwrap_or_default();
        return Err(malformed("a marker has not all three columns", label));
    }
    if head.points.is_empty() {
        return Err(malformed(
            "not a table of markers",
            titles.join(", ").chars().take(60).collect(),
        ));
    }
    if other > 0 {
        head.notes.push(format!(
            "{other} {are}: left out",
            other = counted(other, "column"),
            are = either(other, "is no coordinate of a marker", "are no coordinates of markers")
        ));
    }
    let place = head.points.iter().find(|point| point.kind.is_place());
    head.unit = place.map(|point| point.unit.clone()).unwrap_or_default();
    Ok(columns)
}

fn kind_of(unit: &str) -> PointKind {
    match unit.to_ascii_lowercase().as_str() {
        "deg" | "rad" => PointKind::Angle,
        "n" | "n/kg" => PointKind::Force,
        "nmm" | "nm" | "nmm/kg" | "nm/kg" => PointKind::Moment,
        "w" | "w/kg" => PointKind::Power,
        unit => KINDS.into_iter().find(|kind| kind.word() == unit).unwrap_or(PointKind::Marker),
    }
}

/// Writes all points. What is left out is in the notes that come back.
///
/// # Errors
/// A file that cannot be written, frames that cannot be read, an unknown rate.
pub fn write(out: &mut impl Write, frames: &mut dyn Frames) -> Result<Vec<String>, Error> {
    let head = frames.head().clone();
    let rate_hz = head.rate_hz.ok_or_else(|| {
        Error::new("frames per second are not known, and the table has a column of times")
            .remedy("say them: --rate HZ")
    })?;
    if head.points.is_empty() {
        head.places()?;
    }
    let mut notes = head.left_out(0);
    let mut titles = vec!["frame".to_owned(), "time_s".to_owned()];
    let mut scales = Vec::with_capacity(head.points.len());
    let (mut known, mut renamed, mut computed) = (BTreeSet::new(), 0_usize, 0_usize);
    for point in &head.points {
        let metres = metres_of(&point.unit).filter(|_| point.kind.is_place());
        // A unit must be one word behind the axis.
        let said = point.unit.replace(['_', ' '], "");
        let unit = match metres {
            Some(_) => "m",
            None if point.kind.is_place() && kind_of(&said).is_place() => &said,
            None if point.kind.is_place() => "",
            None if kind_of(&said) == point.kind => &said,
            None => point.kind.word(),
        };
        if metres.is_none() && unit != said {
            let of = format!("units of {} are left out: {}", point.kind.word(), point.unit);
            notes.extend(Some(of).filter(|of| !said.is_empty() && !notes.contains(of)));
        }
        computed += usize::from(point.kind == PointKind::Modelled);
        let mark = if unit.is_empty() { String::new() } else { format!("_{unit}") };
        let mut label = point.label.clone();
        let mut number = 2_usize;
        while !known.insert((label.clone(), mark.clone())) {
            label = format!("{}#{number}", point.label);
            number += 1;
        }
        renamed += usize::from(number > 2);
        titles.extend(["x", "y", "z"].map(|axis| format!("{label}_{axis}{mark}")));
        scales.push(metres.unwrap_or(1.0));
    }
    if renamed > 0 {
        notes.push(format!(
            "{renamed} {have} a name that came before: `#2`, ... is added",
            renamed = counted(renamed, "point"),
            have = either(renamed, "has", "have")
        ));
    }
    if computed > 0 {
        notes.push(format!(
            "{} that a model computed {} like all others",
            counted(computed, "point"),
            either(computed, "is a place", "are places")
        ));
    }
    let mut table = TableWriter::new(out);
    table.row(&titles)?;
    let (mut frame, mut number) = (Frame::default(), 0_u64);
    let mut cells: Vec<String> = Vec::with_capacity(titles.len());
    while frames.next_frame(&mut frame)? {
        let in_all = head.first_frame + number;
        cells.clear();
        cells.push(in_all.to_string());
        cells.push(format!("{:.9}", in_all.saturating_sub(1) as f64 / rate_hz));
        for (at, scale) in scales.iter().enumerate() {
            match frame.points.get(at).copied().flatten() {
                Some(sample) => {
                    cells.extend(sample.position.map(|n| (f64::from(n) * scale).to_string()));
                }
                None => cells.extend([const { String::new() }; 3]),
            }
        }
        table.row(&cells)?;
        number += 1;
    }
    let out = table.finish()?;
    out.flush().map_err(|cause| Error::unwritten("the table cannot be written", &cause))?;
    Ok(notes)
}
