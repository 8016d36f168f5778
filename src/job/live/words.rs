//! What `live` reports, as a person reads it.

use super::report::{BodyReport, LiveReport};
use crate::job::explain::BodySide;
use crate::job::report::counted;
use crate::job::source_words;
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
            if mount.lost > 0 {
                let times = counted(mount.lost, "time");
                let _ = writeln!(out, "  {:<16} lost {times}, {:.2} s", "", mount.lost_s);
            }
        }
        for doubt in &self.doubts {
            let _ = writeln!(out, "  look: {doubt}");
        }
    }
}

impl LiveReport {
    /// The report as lines for a person; `brief`: how it ended, and what was written.
    #[must_use]
    pub fn text(&self, brief: bool) -> String {
        let mut out = self.run.text(brief);
        if brief {
            return out;
        }
        if let Some(body) = &self.body {
            body.text(&mut out);
        }
        for sensor in &self.sensors {
            source_words::heard(sensor, &mut out);
        }
        for answer in self.answers.iter().flat_map(|answers| &answers.given) {
            let side = answer.side.map_or("", BodySide::word);
            let done = format!("{} {side}", answer.action);
            let why =
                answer.stop_reason.as_ref().map_or_else(String::new, |why| format!(": {why}"));
            let _ = writeln!(
                out,
                "answer    {} at {:.2} s: {} {}{why} ({:.2} s)",
                done.trim_end(),
                answer.recognised_at_s,
                answer.motion,
                answer.outcome.word(),
                answer.duration_s
            );
        }
        if let Some(ignored) =
            self.answers.as_ref().map(|answers| answers.ignored).filter(|n| *n > 0)
        {
            let _ = writeln!(
                out,
                "          {ignored} came while the robot answered, and have no answer"
            );
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
            "behind    {} by limits ({} limited); poses {} old, p99 {}",
            ms(self.lag_s.map(|lag_s| lag_s.max(0.0))),
            counted(self.limited_samples, "sample"),
            ms(self.latency.map(|latency| latency.median_s)),
            ms(self.latency.map(|latency| latency.p99_s))
        );
        out
    }
}
