//! Why models did or did not fire, in words and drawn.

use super::explain::{
    Demand, ExplainOrder, ExplainReport, ExplainedModel, FurthestAttempt, Stopped, UnmetDemand,
    looked_at,
};
use super::page;
use crate::draft::{check_free, write_file};
use crate::error::{Error, counted};
use crate::mocap::anatomy::Capture;
use crate::view::ViewPage;
use crate::view::tracks::{SpanKind, ViewSpan};
use std::fmt::Write;

/// Explains why models did or did not fire in a motion, and draws it if that is asked for.
///
/// # Errors
/// A motion or a model that cannot be read, a name that no model has, a span that ends before it begins, a pace that
/// nobody has, a page that exists or cannot be written.
pub fn explain(order: &ExplainOrder) -> Result<ExplainReport, Error> {
    order.html.as_ref().map_or(Ok(()), |page| check_free(page, order.replace))?;
    let (report, capture) = looked_at(order)?;
    if let Some(path) = &order.html {
        let html = drawn(&order.motion, &capture, &report.models)?;
        write_file(path, order.replace, html.as_bytes())?;
    }
    Ok(report)
}

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
        let _ = writeln!(
            text,
            "{model:22} {fired}; {failed_attempts} failed",
            failed_attempts = counted(failed_attempts, "attempt")
        );
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
fn in_short(attempt: &FurthestAttempt, phases: usize) -> String {
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

/// The person, with what fired and what was wanting on the time line.
fn drawn(motion: &str, capture: &Capture, models: &[ExplainedModel]) -> Result<String, Error> {
    let mut scene = page::body::person(capture)?;
    for of in models {
        scene.spans.extend(of.fired.iter().map(|fired| {
            ViewSpan::new(SpanKind::Event, &of.model, "fired", fired.start_s, fired.end_s)
        }));
        scene.spans.extend(of.furthest.iter().map(|attempt| {
            let label = in_short(attempt, of.phases);
            let start_s = attempt.start_s.min(attempt.at_s);
            ViewSpan::new(SpanKind::Doubt, &of.model, &label, start_s, attempt.at_s)
        }));
    }
    let fired = models.iter().filter(|of| !of.fired.is_empty()).count();
    let rows = [
        ("models", models.len().to_string()),
        ("fired", fired.to_string()),
        ("duration", format!("{:.2} s", scene.duration_s)),
    ];
    let blind = models.iter().filter(|of| !of.missing.is_empty()).map(|of| {
        format!("{} cannot fire: the source does not show {}", of.model, of.missing.join(", "))
    });
    ViewPage {
        title: format!("why models fired or not in {motion}"),
        summary_rows: rows.into_iter().map(|(name, said)| (name.to_owned(), said)).collect(),
        warnings: Vec::new(),
        notes: capture.notes.iter().cloned().chain(blind).collect(),
        scene,
    }
    .html()
}
