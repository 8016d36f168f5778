//! What `info` says of captures and markers.

use crate::error::either;
use crate::job::info::{
    CaptureOverview, FileOverview, MarkerFigures, MarkerOverview, TableOverview,
};
use crate::job::info_columns::{ColumnFigures, ColumnsOverview};
use crate::job::labels::{LabelledAction, LabelsOverview};
use crate::job::report::counted;
use crate::job::sensors::{SensorFigures, SensorsOverview, Without};
use std::fmt::Write;

/// Most markers with gaps, channels and events that are told one by one; `--json` has all.
const MOST: usize = 12;
/// Most columns of an unknown table that are told one by one.
const MOST_COLUMNS: usize = 40;

/// What is in a file, for a person.
#[must_use]
pub fn words(overview: &FileOverview) -> String {
    match overview {
        FileOverview::Markers(markers) => of_markers(markers),
        FileOverview::Capture(capture) => of_capture(capture),
        FileOverview::Table(table) => of_table(table),
        FileOverview::Labels(labels) => of_labels(labels),
        FileOverview::Sensors(sensors) => of_sensors(sensors),
        FileOverview::Folder(folder) => folder.words(),
        FileOverview::Columns(columns) => of_columns(columns),
    }
}

fn of_columns(overview: &ColumnsOverview) -> String {
    let mut text = format!("format    {}, {}\n", overview.format, counted(overview.rows, "row"));
    if overview.uneven_rows > 0 {
        let _ = writeln!(
            text,
            "uneven    {} without one cell per column",
            counted(overview.uneven_rows, "row")
        );
    }
    for column in overview.columns.iter().take(MOST_COLUMNS) {
        let ColumnFigures { name, numbers, empty, least, greatest, rises, first_no_number_line } =
            column;
        let range = least.zip(*greatest).map(|(least, greatest)| format!("{least} to {greatest}"));
        let range = range.unwrap_or_else(|| "text".to_owned());
        let others = overview.rows - numbers.min(&overview.rows) - empty.min(&overview.rows);
        let _ = write!(text, "column    {name}: {range}");
        for (count, what) in [(*empty, "empty"), (others, "no number")] {
            if count > 0 && least.is_some() {
                let _ = write!(text, ", {count} {what}");
            }
        }
        if let Some(line) = first_no_number_line.filter(|_| least.is_some()) {
            let _ = write!(text, " (the first in line {line})");
        }
        text.push_str(if *rises { ", rises\n" } else { "\n" });
    }
    if overview.columns.len() > MOST_COLUMNS {
        let _ = writeln!(text, "          {} more: --json", overview.columns.len() - MOST_COLUMNS);
    }
    for note in &overview.notes {
        let _ = writeln!(text, "remark    {note}");
    }
    text
}

fn of_sensors(overview: &SensorsOverview) -> String {
    let mut text = format!("format    {}\n", overview.format);
    for (name, of) in &overview.sensors {
        let rate = known(of.rate_hz, "Hz");
        let what = of.quantities.join(", ");
        let SensorFigures { samples, duration_s, without, .. } = of;
        let _ = writeln!(
            text,
            "sensor    {name}: {samples} at {rate}, {duration_s:.2} s: {what}",
            samples = counted(*samples, "sample")
        );
        for (quantity, Without { samples, first_s }) in without {
            let samples = counted(samples, "sample");
            let _ = writeln!(
                text,
                "          {samples} without {quantity}, the first at {first_s:.3} s"
            );
        }
    }
    let _ = writeln!(text, "missing   {}", counted(overview.missed, "sample"));
    text
}

fn of_labels(labels: &LabelsOverview) -> String {
    let mut text = String::new();
    let _ = writeln!(text, "format    {}, {}", labels.format, labels.kind);
    let _ = writeln!(text, "clips     {}", labels.clips);
    if let Some(frames) = labels.frames {
        let _ = writeln!(text, "frames    {frames}");
    }
    for (action, of) in &labels.actions {
        let LabelledAction { clips: in_clips, cuts, unclear, absent_in, .. } = of;
        let frames = of.frames.map_or(String::new(), |frames| {
            format!(", {frames}", frames = counted(frames, "frame"))
        });
        let _ = writeln!(
            text,
            "action    {action}: {cuts} in {in_clips}{frames}; unclear {unclear}, looked for in vain in \
             {absent_in}",
            absent_in = counted(*absent_in, "clip"),
            in_clips = counted(*in_clips, "clip"),
            unclear = counted(unclear, "time"),
            cuts = counted(cuts, "time")
        );
    }
    text
}

fn of_table(table: &TableOverview) -> String {
    let mut text = String::new();
    let _ = writeln!(text, "format    {}, cells of type {}", table.format, table.cells);
    if !table.name.is_empty() {
        let _ = writeln!(text, "name      {}", table.name);
    }
    let lost = match table.lost_rows {
        0 => String::new(),
        lost => {
            format!("; {lost} more {are} claimed and not there", are = either(lost, "is", "are"))
        }
    };
    let _ = writeln!(text, "rows      {}{lost}", table.rows);
    let _ = writeln!(text, "rate      {}", known(table.rate_hz, "Hz"));
    let _ = writeln!(text, "duration  {:.2} s", table.duration_s);
    let angles = match table.in_degrees {
        Some(true) => "in degrees",
        Some(false) => "in radians",
        None => "not said in what",
    };
    let _ = writeln!(text, "angles    {angles}");
    let _ = writeln!(text, "columns   {}", table.columns.len());
    for column in table.columns.iter().take(MOST) {
        let _ = writeln!(text, "column    {column}");
    }
    more(table.columns.len(), "column", &mut text);
    let body = if table.body.is_empty() { "none".to_owned() } else { table.body.join(", ") };
    let _ = writeln!(text, "body      {body}");
    for note in &table.notes {
        let _ = writeln!(text, "note      {note}");
    }
    text
}

fn of_capture(capture: &CaptureOverview) -> String {
    let mut text = String::new();
    let CaptureOverview { format, joints, frames, rate_hz, duration_s, .. } = capture;
    let _ = writeln!(text, "format    {format}, {joints}", joints = counted(*joints, "joint"));
    let _ = writeln!(text, "frames    {frames} at {rate_hz:.3} Hz");
    let _ = writeln!(text, "duration  {duration_s:.2} s");
    let _ = writeln!(text, "stature   {:.2} m", capture.stature_m);
    for note in &capture.notes {
        let _ = writeln!(text, "note      {note}");
    }
    text
}

/// A number or that it is not known.
fn known(number: Option<f64>, unit: &str) -> String {
    number.map_or_else(|| "not said".to_owned(), |number| format!("{number:.2} {unit}"))
}

fn of_markers(file: &MarkerOverview) -> String {
    let mut text = String::new();
    let encoding = if file.encoding.is_empty() { "" } else { ", " };
    let _ = writeln!(text, "format    {}{encoding}{}", file.format, file.encoding);
    if !file.made_by.is_empty() {
        let _ = writeln!(text, "made by   {}", file.made_by);
    }
    if !file.subjects.is_empty() {
        let _ = writeln!(text, "subject   {}", file.subjects.join(", "));
    }
    let from = match file.first_frame {
        1 => String::new(),
        first => format!(", from number {first} on"),
    };
    let lost = match file.lost_frames {
        0 => String::new(),
        lost => {
            format!("; {lost} more {are} claimed and not there", are = either(lost, "is", "are"))
        }
    };
    let _ = writeln!(text, "frames    {}{from}{lost}", file.frames);
    let _ = writeln!(text, "rate      {}", known(file.rate_hz, "Hz"));
    let _ = writeln!(text, "duration  {}", known(file.duration_s, "s"));
    let unit = if file.unit.is_empty() { "not said" } else { &file.unit };
    let _ = writeln!(text, "unit      {unit}");
    let _ = match &file.screen {
        Some([right, up]) => writeln!(text, "screen    {right} to the right, {up} up"),
        None => writeln!(text, "screen    axes not said"),
    };
    let named = |kind: &str| if kind == "modelled" { "modelled point" } else { kind }.to_owned();
    let kinds = file.points.iter().map(|(kind, count)| counted(count, &named(kind)));
    let kinds: Vec<String> = kinds.collect();
    let kinds = if kinds.is_empty() { "none".to_owned() } else { kinds.join(", ") };
    let _ = writeln!(text, "points    {kinds}");
    gaps(file, &mut text);
    if let Some(analog) = &file.analog {
        let count = analog.channels.len();
        let _ = writeln!(
            text,
            "analog    {count} at {}",
            known(analog.rate_hz, "Hz"),
            count = counted(count, "channel")
        );
        for channel in analog.channels.iter().take(MOST) {
            let range = match (channel.least, channel.greatest) {
                (Some(least), Some(greatest)) => format!("{least:.3} to {greatest:.3}"),
                _ => "no values".to_owned(),
            };
            let _ = writeln!(text, "channel   {}: {range} {}", channel.name, channel.unit);
        }
        more(count, "channel", &mut text);
    }
    for plate in &file.plates {
        let channels = plate.channels.iter().map(|name| name.as_deref().unwrap_or("?"));
        let channels = channels.collect::<Vec<_>>().join(", ");
        let peak = plate.peak_vertical_n.map(|peak| format!("; up to {peak:.0} N upwards"));
        let peak = peak.unwrap_or_default();
        let _ = writeln!(text, "plate     type {}: {channels}{peak}", plate.kind);
    }
    for event in file.events.iter().take(MOST) {
        let of = [&event.context, &event.subject];
        let of: Vec<&str> = of.into_iter().map(String::as_str).filter(|w| !w.is_empty()).collect();
        let _ = writeln!(text, "event     {:.3} s {} {}", event.time_s, event.label, of.join(", "));
    }
    more(file.events.len(), "event", &mut text);
    for note in &file.notes {
        let _ = writeln!(text, "note      {note}");
    }
    for finding in file.findings.iter().take(MOST) {
        let _ = writeln!(text, "unusual   {finding}");
    }
    more(file.findings.len(), "unusual thing", &mut text);
    text
}

fn more(count: usize, what: &str, text: &mut String) {
    if count > MOST {
        let _ = writeln!(
            text,
            "          and {}: --json",
            counted(count - MOST, &format!("more {what}"))
        );
    }
}

fn gaps(file: &MarkerOverview, text: &mut String) {
    let _ = writeln!(
        text,
        "gaps      {} in {}, {:.1} % of their samples missing",
        file.gaps,
        counted(file.markers.len(), "marker"),
        100.0 * file.missing_share
    );
    let missing = |marker: &&MarkerFigures| marker.frames < file.frames;
    let mut lacking: Vec<&MarkerFigures> = file.markers.iter().filter(missing).collect();
    lacking.sort_by_key(|marker| marker.frames);
    for marker in lacking.iter().take(MOST) {
        let share = 100.0 * marker.frames as f64 / file.frames.max(1) as f64;
        let longest = match (marker.longest_gap_begins, file.rate_hz) {
            (Some(begins), Some(rate_hz)) => format!(
                ", the longest {:.2} s from frame {begins} on",
                marker.longest_gap_frames as f64 / rate_hz
            ),
            (Some(begins), None) => {
                format!(
                    ", the longest {} from {begins} on",
                    counted(marker.longest_gap_frames, "frame")
                )
            }
            (None, _) => String::new(),
        };
        let _ = writeln!(
            text,
            "marker    {}: seen in {share:.1} % of the frames, {}{longest}",
            marker.name,
            counted(marker.gaps, "gap")
        );
    }
    more(lacking.len(), "marker of which frames are missing", text);
}
