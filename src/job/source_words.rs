//! What became of sources, in words: one that was heard, and one that a recording holds.

use super::report::counted;
use crate::capture::is_another;
use crate::recording::SourceOverview;
use crate::sensing::SourceReport;
use std::fmt::Write;

/// What became of a source, as one line.
pub fn heard(report: &SourceReport, out: &mut String) {
    let counts = report.counts;
    let _ = write!(out, "  {:<16} {}", report.name, counted(counts.samples, "sample"));
    let told = [
        (counts.missed, "missing"),
        (counts.estimated.unwrap_or(0), "missing (estimated)"),
        (counts.duplicates, "twice"),
        (counts.late, "out of order"),
        (counts.resets, "resets"),
        (counts.misread, "misread times"),
        (report.incomplete, "with a reading that is missing or beyond the sensor's range"),
        (report.stuck, "with values that stood still"),
        (report.bad_packets, "bad packets"),
        (report.refused, "calls of others refused"),
    ];
    list(&told, out);
    let rates = report.rate_hz.zip(report.profile_rate_hz);
    if let Some((own, usual)) = rates.filter(|(own, usual)| is_another(*own, *usual)) {
        let _ = write!(out, ", {}", rate(own, usual));
    }
    if report.skew_ppm != 0.0 {
        let _ = write!(out, ", clock {:+.1} ppm", report.skew_ppm);
    }
    if report.gone > 0 {
        let _ = write!(out, ", gone {} for {:.1} s", counted(report.gone, "time"), report.gone_s);
    }
    if let Some(ended) = &report.ended {
        let _ = write!(out, "; ended early: {ended}");
    }
    out.push('\n');
}

/// How often a sensor samples by its own clock, beside what its profile says.
pub(super) fn rate(own_hz: f64, profile_hz: f64) -> String {
    match is_another(own_hz, profile_hz) {
        true => format!("sends {own_hz:.1} Hz where its profile says {profile_hz}"),
        false => format!("sends {own_hz:.1} Hz, as its profile says"),
    }
}

/// A source in one line: what there is and what is not.
#[must_use]
pub fn kept(name: &str, source: &SourceOverview) -> String {
    let mut text = format!("{name}: {} in {:.2} s", source.records, source.duration_s);
    let counts = [
        (source.gaps, "gaps"),
        (source.missed, "missing"),
        (source.estimated, "missing (estimated)"),
        (source.dropped, "dropped"),
        (source.damaged, "unreadable"),
        (source.duplicates, "twice"),
        (source.late, "out of order"),
        (source.resets, "resets"),
        (source.doubted, "with a time that was doubted"),
        (source.beyond, "with a value beyond the sensor's range"),
    ];
    list(&counts, &mut text);
    text
}

/// What there is of anything.
fn list(counts: &[(u64, &str)], out: &mut String) {
    for (count, word) in counts.iter().filter(|(count, _)| *count > 0) {
        let _ = write!(out, ", {count} {word}");
    }
}
