//! What `live` reports, as a person reads it.

use crate::cli::cues;
use crate::job::live::{BodyReport, LiveReport};
use std::fmt::Write;

impl BodyReport {
    fn text(&self, out: &mut String) {
        let line = format!("body      calibrated {} {}", self.calibrated, self.subject);
        let _ = writeln!(out, "{}", line.trim_end());
        for mount in &self.sensors {
            let degrees = |rad: Option<f64>| {
                rad.map_or_else(|| "-".to_owned(), |rad| format!("{:.1}", rad.to_degrees()))
            };
            let _ = writeln!(
                out,
                "  {:<16} heading by {:<9} T pose {:>5} deg  drift {:>5} deg  silent {:.2} s",
                mount.segment,
                mount.heading_by,
                degrees(mount.off_t_pose_rad),
                degrees(mount.drift_corrected_rad),
                mount.stale_s
            );
        }
        for doubt in &self.doubts {
            let _ = writeln!(out, "  look: {doubt}");
        }
    }
}

impl LiveReport {
    /// The report as lines for a person; `brief` leaves the notes out.
    pub(in crate::cli) fn text(&self, brief: bool) -> String {
        let mut out = self.run.text(brief);
        if let Some(body) = &self.body {
            body.text(&mut out);
        }
        for sensor in &self.sensors {
            cues::of_source(sensor, &mut out);
        }
        if self.run.cycles == 0 {
            return out;
        }
        let ms = |seconds: Option<f64>| {
            seconds.map_or_else(|| "-".to_owned(), |s| format!("{:.1} ms", s * 1e3))
        };
        let _ = writeln!(
            out,
            "following {:.2} s, approach {:.2} s, without a fresh pose {:.2} s",
            self.following_s, self.approaching_s, self.stale_s
        );
        let _ = writeln!(
            out,
            "behind    {} by limits ({} samples limited); poses {} old, p99 {}",
            ms(self.lag_s),
            self.limited_samples,
            ms(self.latency.map(|latency| latency.median_s)),
            ms(self.latency.map(|latency| latency.p99_s))
        );
        out
    }
}
