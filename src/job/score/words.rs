//! What came of scores, as a person reads it.

use super::motions::MotionScore;
use super::nearest::ClassBaseline;
use super::{ClassFigures, ClassificationReport, CorruptionFigures};
use crate::job::report::counted;
use std::fmt::Write;

fn percent(value: Option<f64>) -> String {
    value.map_or_else(|| "-".to_owned(), |value| format!("{:.1}", 100.0 * value))
}

fn line(text: &mut String, of: &ClassFigures) {
    let interval = of.recall_interval.map_or_else(String::new, |[low, high]| {
        format!("  {:.0} to {:.0}", 100.0 * low, 100.0 * high)
    });
    let _ = writeln!(
        text,
        "{:22} {:>7} {:>10} {:>6} {:>11} {:>8}{interval}",
        of.class,
        of.tally.correct,
        of.tally.recognised,
        of.tally.truth,
        percent(of.precision),
        percent(of.recall)
    );
}

impl ClassificationReport {
    /// A table for each of what is told.
    #[must_use]
    pub fn words(&self) -> String {
        let report = self;
        let mut text = format!(
            "{:22} {:>7} {:>10} {:>6} {:>11} {:>8}  95 % interval\n",
            "class", "correct", "recognised", "there", "precision %", "recall %"
        );
        for class in &report.per_class {
            line(&mut text, class);
        }
        line(&mut text, &report.global);
        let _ = writeln!(
            text,
            "{:22} {:>37} {:>8}",
            "mean of classes",
            percent(report.mean_precision),
            percent(report.mean_recall)
        );
        for ClassBaseline { what, value, interval, precision, .. } in &report.baselines {
            let interval = interval.map_or_else(String::new, |[low, high]| {
                format!("  {:.0} to {:.0}", 100.0 * low, 100.0 * high)
            });
            let _ = writeln!(
                text,
                "{what:47} {:>11} {:>8}{interval}",
                percent(*precision),
                percent(*value)
            );
        }
        text.push_str("\nby style\n");
        for style in &report.per_style {
            line(&mut text, style);
        }
        text.push_str("\nby source\n");
        for source in &report.per_source {
            line(&mut text, source);
        }
        text.push_str("\nwhat was recognised in the clips of each label\n");
        for label in &report.per_label {
            let found: Vec<String> = label
                .recognised
                .iter()
                .map(|(action, count)| format!("{action} {count}"))
                .collect();
            let meaning = label.class.as_deref().unwrap_or("(distractor)");
            let _ = writeln!(
                text,
                "{:22} {:>4} {meaning:14} {}",
                label.label,
                label.clips,
                found.join(", ")
            );
        }
        if !report.per_corruption.is_empty() {
            text.push_str(
                "\ncorrupted copies: what it costs, and how much later an action is known\n",
            );
        }
        for CorruptionFigures { corruption, global, delay_s, .. } in &report.per_corruption {
            let later = delay_s.map_or_else(String::new, |s| format!("  {:+.0} ms", 1e3 * s));
            let mut row = String::new();
            line(&mut row, &ClassFigures { class: (*corruption).to_owned(), ..global.clone() });
            let _ = writeln!(text, "{}{later}", row.trim_end());
        }
        let _ = writeln!(
            text,
            "\nsides     {} of {} on the side that the label says",
            report.sides.correct,
            counted(report.sides.truth, "recognition")
        );
        match &report.segmentation {
            Some(cut) => {
                let _ = writeln!(
                    text,
                    "cuts      {} compared: mean error {:.1} frames ({:.0} ms), greatest {:.1}",
                    cut.cuts, cut.mean_frames, cut.mean_ms, cut.most_frames
                );
            }
            None if report.cut_by_hand > 0 => {
                let _ = writeln!(text, "cuts      none of {} was recognised", report.cut_by_hand);
            }
            None => text.push_str("cuts      no label has times: clips were judged whole\n"),
        }
        for unread in &report.unread {
            let _ = writeln!(text, "unread    {unread}");
        }
        let _ = writeln!(
            text,
            "{}, {}, {:.0} s",
            counted(report.clips, "clip"),
            counted(report.frames, "frame"),
            report.duration_s
        );
        text
    }
}

impl MotionScore {
    /// The figure, what it is compared with, and the classes.
    #[must_use]
    pub fn words(&self) -> String {
        let of = |value: f64, [low, high]: [f64; 2]| match self.unit {
            "share" => format!("{:.1} %  ({:.1} to {:.1})", 1e2 * value, 1e2 * low, 1e2 * high),
            unit => format!("{value:.1} {unit}  ({low:.1} to {high:.1})"),
        };
        let mut text = format!("{}\n", self.score);
        match (self.value, self.interval) {
            (Some(value), Some(interval)) => {
                let _ = writeln!(
                    text,
                    "value     {}, 95 % interval, {}",
                    of(value, interval),
                    counted(self.judged, "trial")
                );
            }
            (Some(value), None) => {
                let value = of(value, [value; 2]);
                let value = value.split("  (").next().unwrap_or_default();
                let _ = writeln!(text, "value     {value}, of one trial");
            }
            _ => text.push_str("value     -\n"),
        }
        let _ = writeln!(text, "truth     {}", self.truth);
        if let Some([judged, others]) = self.people {
            let _ = writeln!(
                text,
                "people    {judged} of {} judged; what is made of others' trials is made of those of the {}",
                judged + others,
                counted(others, "other")
            );
        }
        for baseline in &self.baselines {
            let value = of(baseline.value, baseline.interval);
            let _ = writeln!(text, "baseline  {value}: {}", baseline.what);
        }
        if let Some((what, value)) = self.bound {
            let value = if self.unit == "share" { 1e2 * value } else { value };
            let _ = writeln!(text, "bound     {value:.1}: {what}");
        }
        if !self.features.is_empty() {
            let _ = writeln!(text, "features  {:74} {:>8} {:>8}", "", "value", "baseline");
        }
        for feature in &self.features {
            let number =
                |of: Option<f64>| of.map_or_else(|| "-".to_owned(), |of| format!("{of:.1}"));
            let what = format!("{}, {}", feature.what, feature.unit);
            let [value, copied] = [feature.value, feature.baseline].map(number);
            let _ = writeln!(text, "  {what:82} {value:>8} {copied:>8}");
        }
        for (class, value) in &self.per_class {
            let value = if self.unit == "share" { 1e2 * value } else { *value };
            let _ = writeln!(text, "  {class:24} {value:8.1}");
        }
        for (why, count) in &self.passed_over {
            let _ = writeln!(text, "not judged  {count}: {why}");
        }
        text
    }
}
