//! Why models did or did not fire, in words.

use super::explain::{
    Demand, ExplainReport, ExplainedModel, FurthestAttempt, Stopped, UnmetDemand,
};
use std::fmt::Write;

/// The report as text, a few lines for each model.
#[must_use]
pub fn explained(report: &ExplainReport) -> String {
    let mut text = String::new();
    for model in &report.models {
        let ExplainedModel { model, phases, fired, failed_attempts, furthest, missing, .. } = model;
        if !missing.is_empty() {
            let _ = writeln!(text, "{model:22} cannot fire: the source does not show");
            let _ = writeln!(text, "  {}", missing.join(", "));
            continue;
        }
        let spans: Vec<String> =
            fired.iter().map(|of| format!("{:.2} to {:.2} s", of.start_s, of.end_s)).collect();
        let fired = if spans.is_empty() {
            "did not fire".to_owned()
        } else {
            format!("fired at {}", spans.join(", "))
        };
        let _ = writeln!(text, "{model:22} {fired}; {failed_attempts} attempts failed");
        if let Some(attempt) = furthest {
            failure(&mut text, attempt, *phases);
        }
    }
    text
}

/// The attempt that came furthest, in words.
fn failure(text: &mut String, attempt: &FurthestAttempt, phases: usize) {
    let FurthestAttempt { start_s, at_s, number, phase, stopped, wanting, ended_by } = attempt;
    let phase = in_all(*number, phase, phases);
    let _ = match stopped {
        Stopped::NotEntered => {
            writeln!(text, "  nearest at {at_s:.2} s, where {phase} did not begin:")
        }
        Stopped::NotEnough => {
            writeln!(text, "  furthest from {start_s:.2} to {at_s:.2} s, where {phase} ended with:")
        }
        Stopped::TooLong => {
            writeln!(text, "  furthest from {start_s:.2} to {at_s:.2} s, where {phase} went on:")
        }
        Stopped::NoNext => {
            writeln!(
                text,
                "  furthest from {start_s:.2} s; {phase} did not follow, nearest at {at_s:.2} s:"
            )
        }
    };
    for unmet in wanting {
        let _ = writeln!(text, "    {}", demand(unmet));
    }
    if !ended_by.is_empty() && *stopped == Stopped::NotEnough {
        let lacks: Vec<String> = ended_by.iter().map(demand).collect();
        let _ = writeln!(text, "    (it ended by {})", lacks.join("; "));
    }
}

fn demand(unmet: &UnmetDemand) -> String {
    let feature = unmet.feature.as_deref().unwrap_or("");
    let what = match unmet.demand {
        Demand::Frame => feature.to_owned(),
        Demand::Posture => format!("posture {feature}"),
        Demand::Amount => format!("{feature}, amount"),
        Demand::Speed => format!("{feature}, speed"),
        Demand::Average => format!("{feature}, average"),
        Demand::Duration => "duration, s".to_owned(),
    };
    let asked = match (unmet.from, unmet.to) {
        (Some(from), Some(to)) => format!("{from:.2} to {to:.2}"),
        (Some(from), None) => format!("{from:.2} or more"),
        (None, Some(to)) => format!("{to:.2} or less"),
        (None, None) => "any".to_owned(),
    };
    match (unmet.value, unmet.by) {
        (Some(value), Some(by)) => format!("{what} {value:.2}, asked {asked} ({by:+.2})"),
        _ => format!("{what} not shown, asked {asked}"),
    }
}

fn in_all(number: usize, phase: &str, phases: usize) -> String {
    format!("phase {number} of {phases} ({phase})")
}

/// The attempt that came furthest, in one line for a time line.
pub(super) fn in_short(attempt: &FurthestAttempt, phases: usize) -> String {
    let phase = in_all(attempt.number, &attempt.phase, phases);
    let how = match attempt.stopped {
        Stopped::NotEntered => "did not begin",
        Stopped::NotEnough => "was not enough",
        Stopped::TooLong => "went on too long",
        Stopped::NoNext => "did not follow",
    };
    let wanting: Vec<String> = attempt.wanting.iter().map(demand).collect();
    format!("{phase} {how}: {}", wanting.join("; "))
}
