//! The HTML page of a played motion, from the report and the recorded series.

use super::play::RunRecorder;
use super::report::PlayReport;
use crate::plot::{self, JointSeries, PlotPage};
use crate::robot::Robot;

/// The page as HTML.
#[must_use]
pub fn page(report: &PlayReport, recorder: &RunRecorder, robot: &Robot) -> String {
    let rows = vec![
        ("outcome", report.text(true).lines().next().unwrap_or_default().to_owned()),
        ("retimed", retiming(report)),
        (
            "cycles",
            format!(
                "{} at {:.0} Hz, {} missed, {} late",
                report.cycles, report.cycle_hz, report.missed_cycles, report.late_cycles
            ),
        ),
        ("line", format!("{:.0} % busy", 100.0 * report.bus_load)),
    ];
    let mut warnings: Vec<String> = report.stop_reason.iter().cloned().collect();
    warnings.extend(report.notes.iter().cloned());
    if let Some(referee) = &report.referee {
        warnings.extend(referee.violations.iter().cloned());
    }
    plot::page(&PlotPage {
        title: format!("{} on {}", report.motion, report.robot),
        summary_rows: rows.into_iter().map(|(label, text)| (label.to_owned(), text)).collect(),
        warnings,
        joints: joints(recorder, robot),
    })
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
fn joints(recorder: &RunRecorder, robot: &Robot) -> Vec<JointSeries> {
    let Some(series) = recorder.series() else { return Vec::new() };
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
