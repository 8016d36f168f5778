//! Character Studio Motion files (CSM): markers as a text, as 3D Studio Max reads it.
//!
//! A head of lines `$Name value`, `$Order` with the labels on the lines behind it, and `$Points` with a row per
//! frame: its number, then three coordinates of each marker. A marker that was not seen says `DROPOUT` three
//! times. The unit is not in the file: millimetres are taken, which programs of optical systems write; nor is which
//! axis is up.

use crate::error::{Error, ErrorKind, counted, either};
use crate::mocap::markers::{
    Frame, Frames, Head, MAX_POINTS, MarkerFormat, MarkerPoint, Markers, PointKind, PointSample,
};
use std::io::Write;

/// Largest file read, bytes.
pub const MAX_FILE_BYTES: u64 = 256 << 20;
/// What positions may take beside three times the file, bytes.
const SPARE_BYTES: usize = 8 << 20;
/// Bytes of a position.
const POSITION_BYTES: usize = 12;
/// Most people in a file.
const MAX_SUBJECTS: usize = 64;
/// What stands where a coordinate would, of a marker that was not seen.
const DROPOUT: &str = "DROPOUT";

fn malformed(what: impl Into<String>, line: usize) -> Error {
    Error::of(ErrorKind::Malformed, what).at(format!("line {line}"))
}

fn shown(text: &str) -> String {
    format!("\"{}\"", text.chars().take(40).collect::<String>())
}

/// The lines of a file with their numbers, empty ones left out.
fn lines(text: &str) -> impl Iterator<Item = (usize, &str)> + Clone {
    let lines = text.lines().enumerate().map(|(at, line)| (at + 1, line.trim()));
    lines.filter(|(_, line)| !line.is_empty())
}

/// Name and value of a line of the head: `$Rate 120`.
fn field(line: &str) -> Option<(String, &str)> {
    let rest = line.strip_prefix('$')?;
    let (name, value) = rest.split_once(char::is_whitespace).unwrap_or((rest, ""));
    Some((name.to_ascii_lowercase(), value.trim()))
}

/// What the head claims.
#[derive(Default)]
struct Claims {
    first: Option<u64>,
    last: Option<u64>,
    markers: Option<usize>,
}

/// Reads the bytes of a file.
///
/// # Errors
/// If it breaks the format or exceeds a bound; the message names the line.
pub fn parse(bytes: &[u8]) -> Result<Markers, Error> {
    let text = String::from_utf8_lossy(bytes);
    let text = text.strip_prefix('\u{feff}').unwrap_or(&text);
    let mut lines = lines(text);
    let mut head = Head::new(MarkerFormat::Csm);
    head.unit = "mm".to_owned();
    head.notes.push("a CSM file does not say its unit: millimetres are taken".to_owned());
    let mut claims = Claims::default();
    let points_at = read_head(&mut lines, &mut head, &mut claims)?;
    if head.points.is_empty() || head.points.len() > MAX_POINTS {
        return Err(malformed("no usable number of markers in $Order", points_at)
            .got(head.points.len().to_string())
            .allowed(format!("1 to {MAX_POINTS}")));
    }
    let names = head.points.len();
    if let Some(claimed) = claims.markers.filter(|claimed| *claimed != names) {
        head.notes.push(format!(
            "$NumMarkers says {claimed}, $Order has {names}",
            names = counted(names, "name")
        ));
    }
    let frames = lines.clone().count();
    let needed = frames.saturating_mul(names).saturating_mul(POSITION_BYTES);
    let most = bytes.len().saturating_mul(3) + SPARE_BYTES;
    if needed > most {
        return Err(Error::of(
            ErrorKind::Malformed,
            "the markers would take far more memory than the file",
        )
        .got(format!(
            "{frames} for {names}",
            names = counted(names, "marker"),
            frames = counted(frames, "row")
        ))
        .allowed(format!("{}; needed: {needed}", counted(most, "byte"))));
    }
    head.frames = frames;
    if let (Some(first), Some(last)) = (claims.first, claims.last) {
        let claimed = last.saturating_sub(first).saturating_add(1);
        if claimed != frames as u64 {
            head.notes.push(format!(
                "$FirstFrame and $LastFrame make {claimed}, {frames} {are} there",
                frames = counted(frames, "row"),
                are = either(frames, "is", "are"),
                claimed = counted(claimed, "frame")
            ));
            head.lost_frames = claimed.saturating_sub(frames as u64);
        }
    }
    read_rows(head, lines)
}

/// Reads up to `$Points` and gives its line.
fn read_head<'a>(
    lines: &mut impl Iterator<Item = (usize, &'a str)>,
    head: &mut Head,
    claims: &mut Claims,
) -> Result<usize, Error> {
    let (mut is_order, mut is_first, mut last_line) = (false, true, 1);
    for (line, text) in lines {
        last_line = line;
        let Some((name, value)) = field(text) else {
            if is_first || !is_order {
                return Err(malformed("not a CSM file", line)
                    .got(shown(text))
                    .allowed("lines that begin with $: $Filename, $Rate, $Order, $Points"));
            }
            add_labels(head, text);
            continue;
        };
        (is_first, is_order) = (false, false);
        let wrong = || malformed(format!("${name} has no usable value"), line).got(shown(value));
        match name.as_str() {
            "points" => return Ok(line),
            "order" => {
                is_order = true;
                add_labels(head, value);
            }
            "rate" => {
                let rate_hz = value.parse::<f64>().ok();
                let rate_hz = rate_hz.filter(|rate| rate.is_finite() && *rate > 0.0);
                head.rate_hz = Some(rate_hz.ok_or_else(wrong)?);
            }
            "actor" if !value.is_empty() && head.subjects.len() < MAX_SUBJECTS => {
                head.subjects.push(value.to_owned());
            }
            "firstframe" => claims.first = Some(value.parse().map_err(|_| wrong())?),
            "lastframe" => claims.last = Some(value.parse().map_err(|_| wrong())?),
            "nummarkers" => claims.markers = Some(value.parse().map_err(|_| wrong())?),
            // Scales bones, not markers, and whatever else somebody wrote down.
            _ => {}
        }
    }
    Err(malformed("the file ends before $Points", last_line).allowed("$Points and rows of frames"))
}

fn add_labels(head: &mut Head, text: &str) {
    // One more than allowed is enough to be refused.
    let room = (MAX_POINTS + 1).saturating_sub(head.points.len());
    head.points.extend(text.split_whitespace().take(room).map(|label| MarkerPoint {
        label: label.to_owned(),
        description: String::new(),
        kind: PointKind::Marker,
        unit: "mm".to_owned(),
    }));
}

fn read_rows<'a>(
    head: Head,
    rows: impl Iterator<Item = (usize, &'a str)>,
) -> Result<Markers, Error> {
    let (mut partial, mut next) = (0_usize, None::<u64>);
    let labels: Vec<String> = head.points.iter().map(|point| point.label.clone()).collect();
    let mut markers = Markers::with_room(head)?;
    let mut frame = Frame::default();
    let mut skipped = 0_u64;
    for (line, row) in rows {
        let mut cells = row.split_whitespace();
        let number = cells.next().unwrap_or_default();
        let number: u64 = number.parse().map_err(|_| {
            malformed("a row does not begin with the number of its frame", line).got(shown(number))
        })?;
        match next {
            None => markers.set_first_frame(number.max(1)),
            Some(next) if number != next => skipped += 1,
            Some(_) => {}
        }
        next = Some(number.saturating_add(1));
        frame.points.clear();
        for label in &labels {
            let mut numbers = [None; 3];
            for number in &mut numbers {
                let cell = cells.next().ok_or_else(|| {
                    malformed("a row ends before its last marker", line).got(shown(label))
                })?;
                *number = coordinate(cell).ok_or_else(|| {
                    malformed("a coordinate is no number", line)
                        .got(format!("{} of {label}", shown(cell)))
                        .allowed("a number or DROPOUT")
                })?;
            }
            let seen = numbers.iter().flatten().count();
            partial += usize::from(seen == 1 || seen == 2);
            frame.points.push(match numbers {
                [Some(x), Some(y), Some(z)] => {
                    Some(PointSample { position: [x, y, z], residual: 0.0, cameras: 0 })
                }
                _ => None,
            });
        }
        if let Some(more) = cells.next() {
            return Err(malformed("a row has more cells than there are markers", line)
                .got(shown(more))
                .allowed(format!("1 and three for each of {}", counted(labels.len(), "marker"))));
        }
        markers.push(&frame);
    }
    if partial > 0 {
        markers.note(format!(
            "{} with one or two of three coordinates: taken as not seen",
            counted(partial, "sample")
        ));
    }
    if skipped > 0 {
        markers.note(format!(
            "{skipped} {does} not follow the one before by number",
            skipped = counted(skipped, "row"),
            does = either(skipped, "does", "do")
        ));
    }
    Ok(markers)
}

/// A cell as a coordinate: none if the marker was not seen; an error (the outer none) if it is neither.
fn coordinate(cell: &str) -> Option<Option<f32>> {
    if cell.eq_ignore_ascii_case(DROPOUT) {
        return Some(None);
    }
    let number: f32 = cell.parse().ok()?;
    Some(Some(number).filter(|number| number.is_finite()))
}

/// Writes the places among the points, in millimetres. What is left out is in the notes that come back.
///
/// # Errors
/// A file that cannot be written, frames that cannot be read, an unknown rate or unit.
pub fn write(
    out: &mut impl Write,
    name: &str,
    frames: &mut dyn Frames,
) -> Result<Vec<String>, Error> {
    let head = frames.head().clone();
    let places = head.places()?;
    let rate_hz = head.rate_hz.ok_or_else(|| {
        Error::new("frames per second are not known, and a CSM file must say them")
            .remedy("say them: --rate HZ")
    })?;
    let scale = head.metres_per_unit().ok_or_else(|| {
        Error::new("the unit of length is not known, and places of a CSM file are millimetres")
            .remedy("write a .csv or a .c3d file")
    })?;
    let scale = (scale * 1000.0) as f32;
    let notes = head.left_out(head.points.len() - places.len());
    let labels = places.iter().filter_map(|&at| head.points.get(at));
    // A name ends at a blank, and a line that begins with $ is no line of names.
    let label = |point: &MarkerPoint| {
        let words: Vec<&str> = point.label.split_whitespace().collect();
        words.join("_").replace('$', "_")
    };
    let labels: Vec<String> = labels.map(label).collect();
    let unwritable = |cause: std::io::Error| Error::unwritten("the file cannot be written", &cause);
    let first = head.first_frame;
    let last = first.saturating_add((head.frames as u64).saturating_sub(1));
    let mut text = format!("$Filename {name}\n");
    if let Some(subject) = head.subjects.first() {
        text += &format!("$Actor {subject}\n");
    }
    text += &format!("$FirstFrame {first}\n$LastFrame {last}\n$NumFrames {}\n", head.frames);
    text += &format!("$NumMarkers {}\n$Rate {rate_hz}\n$SpinePercent 0.2\n", places.len());
    text += &format!("$Order\n{}\n$Points\n", labels.join(" "));
    out.write_all(text.as_bytes()).map_err(unwritable)?;
    let (mut frame, mut number) = (Frame::default(), first);
    while frames.next_frame(&mut frame)? {
        text.clear();
        text += &number.to_string();
        for &at in &places {
            match frame.points.get(at).copied().flatten() {
                Some(PointSample { position, .. }) => {
                    for coordinate in position {
                        text += &format!(" {}", coordinate * scale);
                    }
                }
                None => text += &format!(" {DROPOUT} {DROPOUT} {DROPOUT}"),
            }
        }
        text.push('\n');
        out.write_all(text.as_bytes()).map_err(unwritable)?;
        number = number.saturating_add(1);
    }
    out.flush().map_err(unwritable)?;
    Ok(notes)
}
