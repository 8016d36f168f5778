//! How motions ended, as a person reads it.

use super::figures_words;
use super::report::{Exception, LINE_SHARE, Outcome, PlayReport, StopCode, counted};
use std::fmt::Write;

impl PlayReport {
    /// The report as lines for a person; `brief`: how it ended, and what was written.
    #[must_use]
    pub fn text(&self, brief: bool) -> String {
        let mut out = String::new();
        self.write_end(&mut out);
        if brief {
            self.write_files(&mut out);
            return out;
        }
        self.write_source(&mut out);
        if !self.dry_run && self.cycles > 0 {
            self.write_run(&mut out);
        }
        self.write_joints(&mut out);
        if let Some(figures) = &self.metrics {
            out.push_str(&figures_words::lines(figures));
        }
        for note in &self.notes {
            let _ = writeln!(out, "note      {note}");
        }
        if let Some(referee) = &self.referee {
            let _ = match referee.violations.len() {
                0 => writeln!(out, "referee   no rule broken"),
                n => writeln!(out, "referee   {} broken", counted(n, "rule")),
            };
            for violation in &referee.violations {
                let _ = writeln!(out, "          {violation}");
            }
            for rule in &referee.rules {
                let _ = writeln!(out, "          {rule}");
            }
        }
        for own in &self.profiles {
            let _ = writeln!(out, "profile   {own}");
        }
        self.write_files(&mut out);
        out
    }

    fn write_files(&self, out: &mut String) {
        for (label, path) in [("recording", &self.recording), ("plots", &self.html)] {
            if let Some(path) = path {
                let _ = writeln!(out, "{label:<9} {path}");
            }
        }
    }

    /// How it ended, and why.
    fn write_end(&self, out: &mut String) {
        let _ = writeln!(out, "{}", self.headline());
        if let Some(reason) = &self.stop_reason {
            let _ = writeln!(out, "reason    {}", reason.replace('\n', "\n          "));
        }
        self.write_stop(out);
    }

    fn write_source(&self, out: &mut String) {
        let source = &self.source;
        if source.frames == 0 {
            return; // refused before anything was read
        }
        let _ = writeln!(
            out,
            "source    {}: {} at {:.2} Hz, {:.2} s",
            source.format,
            counted(source.frames, "pose"),
            source.rate_hz,
            source.duration_s
        );
        if self.joints.is_empty() {
            return; // refused before anything was planned
        }
        let why = match (&self.retime_joint, &self.retime_limit) {
            (Some(joint), Some(limit)) => format!(", asked for by {joint} ({limit})"),
            _ => String::new(),
        };
        let _ = writeln!(out, "retimed   x {:.3}{why}", self.retime_factor);
        let _ = writeln!(
            out,
            "plan      approach {:.2} s, ease in {:.2} s, ease out {:.2} s",
            self.approach_s, self.ease_in_s, self.ease_out_s
        );
    }

    /// The reason as data, and where to read on.
    fn write_stop(&self, out: &mut String) {
        let Some(stop) = self.stop.as_ref().filter(|stop| stop.code != StopCode::Asked) else {
            return;
        };
        let mut parts = vec![format!("code {}", stop.code)];
        parts.extend(stop.line.as_ref().map(|line| format!("line {line}")));
        parts.extend(stop.cycle.map(|cycle| format!("cycle {cycle}")));
        if let (Some(got), Some(allowed), Some(unit)) = (stop.got, stop.allowed, stop.unit) {
            let bound = if got > allowed { "at most" } else { "at least" };
            parts.push(format!("{got:.3} {unit}, {bound} {allowed:.3} allowed"));
        }
        let _ = writeln!(out, "stop      {}", parts.join("; "));
        let _ = writeln!(
            out,
            "          see docs/troubleshooting/{}.md; --json has the last {}",
            stop.code,
            counted(self.flight.len(), "cycle")
        );
    }

    fn write_run(&self, out: &mut String) {
        let _ = writeln!(
            out,
            "cycles    {} at {:.0} Hz in {:.2} s, {} missed, {} late",
            self.cycles, self.cycle_hz, self.duration_s, self.missed_cycles, self.late_cycles
        );
        let limit = self.wire_limit_hz.unwrap_or(0.0);
        let _ = writeln!(
            out,
            "line      {:.0} % busy; up to {:.0} Hz may be asked for ({:.0} % of its {limit:.0} Hz)",
            self.bus_load * 100.0,
            (LINE_SHARE * limit).floor(),
            LINE_SHARE * 100.0
        );
        let show = |value: Option<f64>, unit: &str| {
            value.map_or_else(|| format!("- {unit}"), |v| format!("{v:.1} {unit}"))
        };
        let _ = writeln!(
            out,
            "servos    at most {} and {}, at least {}",
            show(self.max_temperature_c, "deg C"),
            show(self.max_current_a, "A"),
            show(self.min_voltage_v, "V")
        );
        if self.lost() {
            let _ = writeln!(
                out,
                "rest      not known: servos stand at their last goal or swing to it, if they still have torque"
            );
            return;
        }
        let _ = writeln!(
            out,
            "rest      start {:.3} deg/s, end {:.3} deg/s (fastest joint, commanded)",
            self.max_start_velocity_rad_s.to_degrees(),
            self.max_end_velocity_rad_s.to_degrees()
        );
    }

    /// True if the robot could not be led to rest.
    fn lost(&self) -> bool {
        let unrested = |exception: &Exception| {
            matches!(
                exception,
                Exception::LineLost { .. } | Exception::BlindRamp { rested: false, .. }
            )
        };
        self.outcome == Outcome::Failed || self.exceptions.iter().any(unrested)
    }

    fn write_joints(&self, out: &mut String) {
        if self.joints.is_empty() {
            return;
        }
        let _ = writeln!(
            out,
            "{:<16} {:>16} {:>12} {:>10} {:>14} {:>9} {:>9}",
            "joint",
            "measured, deg",
            "peak, deg/s",
            "of limit",
            "tracking, deg",
            "clipped",
            "at limit"
        );
        for joint in &self.joints {
            let range = joint.range_rad.map_or_else(
                || "-".to_owned(),
                |[low, high]| format!("{:.1} to {:.1}", low.to_degrees(), high.to_degrees()),
            );
            let rms = joint
                .tracking_rms_rad
                .map_or_else(|| "-".to_owned(), |rms| format!("{:.2}", rms.to_degrees()));
            let _ = writeln!(
                out,
                "{:<16} {:>16} {:>12.1} {:>8.0} % {:>14} {:>7.1} % {:>7.1} %",
                joint.name,
                range,
                joint.peak_velocity_rad_s.to_degrees(),
                100.0 * joint.peak_velocity_rad_s / joint.limit_velocity_rad_s,
                rms,
                100.0 * joint.clipped_share,
                100.0 * joint.at_limit_share
            );
        }
        if self.joints.iter().any(|joint| joint.clipped_share > 0.0005) {
            out.push_str(
                "          clipped: in so many poses the joint was moved by more than 0.6 deg to stay inside a limit\n",
            );
        }
        if self.joints.iter().any(|joint| joint.at_limit_share > 0.005) {
            let _ = writeln!(
                out,
                "          at limit: in so many poses the robot's range, or the margin in which it bends away from \
                 its end, decides where the joint goes, and not the person"
            );
        }
    }
}
