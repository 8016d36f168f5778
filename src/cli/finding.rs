//! Findings, as a person reads them.

use crate::job::finding::{Finding, Level};
use std::fmt::Write;

/// Findings as lines for a person, remedies below each.
#[must_use]
pub fn text(findings: &[Finding]) -> String {
    let mut out = String::new();
    let width = findings.iter().map(|f| f.about.len()).max().unwrap_or(0);
    for Finding { about, level, found, remedy } in findings {
        let word = match level {
            Level::Ok => "ok",
            Level::Advice => "advice",
            Level::Problem => "PROBLEM",
        };
        let _ = writeln!(out, "{word:<8} {about:<width$}  {found}");
        for line in remedy.iter().flat_map(|remedy| remedy.lines()) {
            let _ = writeln!(out, "{:<8} {:<width$}    {line}", "", "");
        }
    }
    out
}
