//! The HTML page of a played motion, from the report and the recorded series.

use super::recorder::Series;
use super::report::PlayReport;
use crate::plot::{self, JointSeries, PlotPage};
use crate::robot::Robot;

/// The page as HTML.
#[must_use]
pub fn page(report: &PlayReport, series: &Series, robot: &Robot) -> String {
    let rows = vec![
        ("outcome", report.headline()),
        ("retimed", retiming(report)),
        (
            "cycles",
            format!(
                "{} at {:.0} Hz, {} missed, {} late",
                report.cycles, report.cycle_hz, report.missed_cycles, report.late_cycles
            ),
        ),
        ("duration", format!("{:.1} s", report.duration_s)),
        ("line", format!("{:.0} % busy", 100.0 * report.bus_load)),
        ("tracking", tracking(report)),
        ("made by", format!("gaitway {}", env!("CARGO_PKG_VERSION"))),
    ];
    let mut warnings: Vec<String> = report.stop_reason.iter().cloned().collect();
    if let Some(referee) = &report.referee {
        warnings.extend(referee.violations.iter().cloned());
    }
    plot::page(&PlotPage {
        title: format!("{} on {}", report.motion, report.robot),
        summary_rows: rows.into_iter().map(|(label, text)| (label.to_owned(), text)).collect(),
        warnings,
        notes: report.notes.clone(),
        joints: joints(series, robot),
    })
}

/// The joint that followed worst.
fn tracking(report: &PlayReport) -> String {
    let measured = report.joints.iter().filter_map(|j| Some((j.tracking_rms_rad?, &j.name)));
    let worst = measured.max_by(|a, b| a.0.total_cmp(&b.0));
    worst.map_or_else(
        || "not measured".to_owned(),
        |(rms_rad, joint)| format!("at most {:.2}\u{b0} RMS ({joint})", rms_rad.to_degrees()),
    )
}

fn retiming(report: &PlayReport) -> String {
    match (&report.retime_joint, &report.retime_limit) {
        (Some(joint), Some(limit)) => {
            format!("x {:.3}, asked for by {joint} ({limit})", report.retime_factor)
        }
        _ => "not needed".to_owned(),
    }
}

/// Goals, measured angles and goal speeds as they were.
fn joints(series: &Series, robot: &Robot) -> Vec<JointSeries> {
    let joints = robot.joints.iter().enumerate();
    joints
        .map(|(index, joint)| JointSeries {
            name: joint.name.clone(),
            time_s: series.time_s.clone(),
            goal_rad: series.goal_rad[index].clone(),
            present_rad: series.present_rad[index].clone(),
            goal_velocity_rad_s: series.goal_velocity_rad_s[index].clone(),
            lower_rad: joint.limits.lower_rad(),
            upper_rad: joint.limits.upper_rad(),
            velocity_limit_rad_s: joint.limits.velocity_rad_s(),
        })
        .collect()
}
