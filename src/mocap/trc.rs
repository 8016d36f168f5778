//! Track row column files (TRC): markers as a text with tabs, as Motion Analysis made it and OpenSim reads it.
//!
//! Five lines of head, then a row per frame: its number, its time, three coordinates of each marker. A marker
//! that was not seen has empty cells. The format is described in OpenSim's documentation, "Marker (.trc)
//! Files". Which axis is up the file does not say.

use crate::error::{Error, ErrorKind, counted, either};
use crate::mocap::even_times;
use crate::mocap::markers::{
    Frame, Frames, Head, MAX_POINTS, MarkerFormat, MarkerPoint, Markers, PointKind, PointSample,
};
use std::io::Write;

/// Largest file read, bytes.
pub const MAX_FILE_BYTES: u64 = 256 << 20;
/// What positions may take beside three times the file, bytes: nothing is as empty as that.
const SPARE_BYTES: usize = 8 << 20;
/// Bytes of a position.
const POSITION_BYTES: usize = 12;

fn malformed(what: impl Into<String>, line: usize) -> Error {
    Error::of(ErrorKind::Malformed, what).at(format!("line {line}"))
}

fn shown(text: &str) -> String {
    format!("\"{}\"", text.chars().take(40).collect::<String>())
}

/// The cells of a line: by tabs if it has any, else by blanks.
fn cells(line: &str) -> impl Iterator<Item = &str> {
    let by_tabs = line.contains('\t');
    let tabbed = line.split('\t').map(str::trim).filter(move |_| by_tabs);
    let blank = line.split_whitespace().filter(move |_| !by_tabs);
    tabbed.chain(blank)
}

/// Reads the bytes of a file.
///
/// # Errors
/// If it breaks the format or exceeds a bound; the message names the line.
pub fn parse(bytes: &[u8]) -> Result<Markers, Error> {
    let text = String::from_utf8_lossy(bytes);
    let text = text.strip_prefix('\u{feff}').unwrap_or(&text);
    let mut lines = text.lines().enumerate().map(|(at, line)| (at + 1, line));
    let mut next = |what: &str| {
        let line = lines.next();
        line.ok_or_else(|| malformed(format!("the file ends before {what}"), 1))
    };
    let (number, first) = next("its first line")?;
    if !first.trim_start().to_ascii_lowercase().starts_with("pathfiletype") {
        return Err(malformed("not a TRC file", number)
            .got(shown(first))
            .allowed("PathFileType as the first word"));
    }
    let (_, names) = next("the names of its head")?;
    let (values_line, values) = next("the values of its head")?;
    let values: Vec<&str> = cells(values).collect();
    let value = |name: &str| {
        let at = cells(names).position(|cell| cell.eq_ignore_ascii_case(name))?;
        values.get(at).copied().filter(|value| !value.is_empty())
    };
    let mut head = Head::new(MarkerFormat::Trc);
    head.unit = value("Units").unwrap_or_default().to_owned();
    let rate = value("DataRate").and_then(|rate| rate.parse::<f64>().ok());
    head.rate_hz = rate.filter(|rate| rate.is_finite() && *rate > 0.0);
    let (_, labels) = next("the names of its markers")?;
    let labels: Vec<&str> = cells(labels).skip(2).filter(|label| !label.is_empty()).collect();
    let claimed = value("NumMarkers").and_then(|count| count.parse::<usize>().ok());
    if let Some(claimed) = claimed.filter(|claimed| *claimed != labels.len()) {
        head.notes.push(format!(
            "line {values_line}: NumMarkers says {claimed}, {} {} there",
            counted(labels.len(), "marker name"),
            either(labels.len(), "is", "are")
        ));
    }
    if labels.is_empty() || labels.len() > MAX_POINTS {
        return Err(malformed("no usable number of markers", values_line + 1)
            .got(labels.len().to_string())
            .allowed(format!("1 to {MAX_POINTS}")));
    }
    let unit = head.unit.clone();
    let point = |label: &&str| MarkerPoint {
        label: (*label).to_owned(),
        description: String::new(),
        kind: PointKind::Marker,
        unit: unit.clone(),
    };
    head.points = labels.iter().map(point).collect();
    next("the axes of its markers")?;
    let rows = lines.filter(|(_, line)| !line.trim().is_empty());
    let frames = rows.clone().count();
    let needed = frames.saturating_mul(labels.len()).saturating_mul(POSITION_BYTES);
    let most = bytes.len().saturating_mul(3) + SPARE_BYTES;
    if needed > most {
        return Err(Error::of(
            ErrorKind::Malformed,
            "the markers would take far more memory than the file",
        )
        .got(format!(
            "{frames} for {}",
            counted(labels.len(), "marker"),
            frames = counted(frames, "row")
        ))
        .allowed(format!("{}; needed: {needed}", counted(most, "byte")))
        .remedy("leave out the markers that are never seen"));
    }
    let claimed = value("NumFrames").and_then(|count| count.parse::<u64>().ok());
    if let Some(claimed) = claimed.filter(|claimed| *claimed != frames as u64) {
        head.notes.push(format!(
            "line {values_line}: NumFrames says {claimed}, {frames} {are} there",
            frames = counted(frames, "row"),
            are = either(frames, "is", "are")
        ));
        head.lost_frames = claimed.saturating_sub(frames as u64);
    }
    head.frames = frames;
    read_rows(head, rows)
}

fn read_rows<'a>(
    mut head: Head,
    rows: impl Iterator<Item = (usize, &'a str)>,
) -> Result<Markers, Error> {
    let (mut partial, mut first_s, mut last_s, mut count) = (0_usize, 0.0, 0.0, 0_usize);
    let mut markers: Option<Markers> = None;
    let mut frame = Frame::default();
    let mut times = Vec::new();
    for (line, row) in rows {
        let mut cells = cells(row);
        let number = cells.next().unwrap_or_default();
        let number: f64 = number.parse().map_err(|_| {
            malformed("a row does not begin with the number of its frame", line).got(shown(number))
        })?;
        let time = cells.next().unwrap_or_default();
        let time_s: f64 =
            time.parse().map_err(|_| malformed("a row has no time", line).got(shown(time)))?;
        if count == 0 {
            first_s = time_s;
            head.first_frame = if number >= 1.0 { number as u64 } else { 1 };
        }
        (last_s, count) = (time_s, count + 1);
        times.push((line as u64, time_s));
        frame.points.clear();
        for point in &head.points {
            let mut numbers = [None; 3];
            for number in &mut numbers {
                *number = coordinate(cells.next().unwrap_or_default()).ok_or_else(|| {
                    malformed("a coordinate is no number", line).got(format!("of {}", point.label))
                })?;
            }
            let seen = numbers.iter().flatten().count();
            partial += usize::from(seen == 1 || seen == 2);
            let sample = match numbers {
                [Some(x), Some(y), Some(z)] => {
                    Some(PointSample { position: [x, y, z], residual: 0.0, cameras: 0 })
                }
                _ => None,
            };
            frame.points.push(sample);
        }
        if let Some(more) = cells.find(|cell| !cell.is_empty()) {
            return Err(malformed("a row has more cells than there are markers", line)
                .got(shown(more))
                .allowed(format!(
                    "2 and three for each of {}",
                    counted(head.points.len(), "marker")
                )));
        }
        let markers = match &mut markers {
            Some(markers) => markers,
            None => markers.insert(Markers::with_room(head.clone())?),
        };
        markers.push(&frame);
    }
    let Some(mut markers) = markers else { return Markers::with_room(head) };
    even_times::check(&times)?;
    if partial > 0 {
        markers.note(format!(
            "{} with one or two of three coordinates: taken as not seen",
            counted(partial, "sample")
        ));
    }
    let steps = count.saturating_sub(1) as f64;
    let by_times = steps / (last_s - first_s);
    if by_times.is_finite() && by_times > 0.0 {
        match markers.head().rate_hz {
            None => {
                markers.set_rate(by_times);
                markers.note(format!(
                    "DataRate is missing or unusable: {by_times:.3} Hz by the times"
                ));
            }
            Some(rate) if (rate - by_times).abs() > 0.01 * rate => markers.note(format!(
                "DataRate says {rate} Hz, the times {by_times:.3} Hz: {rate} Hz is taken"
            )),
            Some(_) => {}
        }
    }
    Ok(markers)
}

/// A cell as a coordinate: none if it is empty or says that it is none; an error (the outer none) if it is
/// no number at all.
fn coordinate(cell: &str) -> Option<Option<f32>> {
    if cell.is_empty() {
        return Some(None);
    }
    let number: f32 = cell.parse().ok()?;
    Some(Some(number).filter(|number| number.is_finite()))
}

/// Writes the places among the points. What is left out is in the notes that come back.
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
        Error::new("frames per second are not known, and a TRC file must say them")
            .remedy("say them: --rate HZ")
    })?;
    if head.unit.is_empty() {
        return Err(Error::new("the unit of length is not known, and a TRC file must say it")
            .remedy("write a .csv or a .c3d file"));
    }
    let notes = head.left_out(head.points.len() - places.len());
    let unwritable = |cause: std::io::Error| Error::unwritten("the file cannot be written", &cause);
    let count = places.len();
    let first = head.first_frame;
    let mut text = format!("PathFileType\t4\t(X/Y/Z)\t{name}\n");
    text += "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames\n";
    let (frame_count, unit) = (head.frames, &head.unit);
    text += &format!(
        "{rate_hz}\t{rate_hz}\t{frame_count}\t{count}\t{unit}\t{rate_hz}\t{first}\t{frame_count}\nFrame#\tTime"
    );
    for label in places.iter().filter_map(|&at| head.points.get(at)).map(|point| &point.label) {
        text += &format!("\t{}\t\t", label.replace(['\t', '\n', '\r'], " "));
    }
    text += "\n\t";
    for at in 1..=count {
        text += &format!("\tX{at}\tY{at}\tZ{at}");
    }
    text += "\n\n";
    out.write_all(text.as_bytes()).map_err(unwritable)?;
    let (mut frame, mut number) = (Frame::default(), 0_u64);
    while frames.next_frame(&mut frame)? {
        let time_s = (first - 1 + number) as f64 / rate_hz;
        text.clear();
        text += &format!("{}\t{time_s:.6}", first + number);
        for &at in &places {
            match frame.points.get(at).copied().flatten() {
                Some(PointSample { position: [x, y, z], .. }) => {
                    text += &format!("\t{x}\t{y}\t{z}")
                }
                None => text += "\t\t\t",
            }
        }
        text.push('\n');
        out.write_all(text.as_bytes()).map_err(unwritable)?;
        number += 1;
    }
    out.flush().map_err(unwritable)?;
    Ok(notes)
}
