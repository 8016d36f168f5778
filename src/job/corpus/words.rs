//! What came of it, as a person reads it.

use super::{
    AddReport, AskReport, CheckReport, ExportReport, GenerateReport, GeneratedTrial, NewReport,
    PlanReport, RemoveReport,
};
use crate::job::report::counted;
use std::collections::BTreeMap;
use std::fmt::Write as _;

/// Most lines of a kind.
const MOST_LINES: usize = 20;

impl NewReport {
    /// In a few lines.
    #[must_use]
    pub fn words(&self) -> String {
        let mut text = format!("corpus    {}\nmanifest  {}\n", self.name, self.manifest);
        if !self.unsaid.is_empty() {
            let _ = writeln!(text, "unsaid    {}: write them there", self.unsaid.join(", "));
        }
        text
    }
}

impl AddReport {
    /// In a few lines.
    #[must_use]
    pub fn words(&self) -> String {
        let Self { added, frames, labels, found, trials, version, .. } = self;
        let (outcome, there) = (self.outcome.word(), found.len());
        let mut text = format!(
            "{outcome}: {added} added ({frames}, {labels}), {there} found, {trials} in all\n\
             version   {version}\n",
            labels = counted(*labels, "label"),
            frames = counted(*frames, "frame"),
            added = counted(*added, "trial")
        );
        for found in found.iter().take(MOST_LINES) {
            let _ =
                writeln!(text, "found     {} is {} by its {}", found.source, found.trial, found.by);
        }
        for unread in self.unread.iter().take(MOST_LINES) {
            let _ = writeln!(text, "unread    {}", unread.replace('\n', "\n          "));
        }
        for (what, all) in [("found", found.len()), ("unread", self.unread.len())] {
            more(&mut text, what, all);
        }
        for note in &self.notes {
            let _ = writeln!(text, "remark    {note}");
        }
        text
    }
}

impl PlanReport {
    /// How much is there, what is missing, and whom to ask.
    #[must_use]
    pub fn words(&self) -> String {
        let Self { set, wanted, recorded, only_made, missing, people, .. } = self;
        let mut text = format!(
            "{set}: {recorded} of {wanted} recorded, {} missing, {only_made} of them made by the program\n",
            counted(missing.len(), "trial")
        );
        if self.unasked > 0 {
            let _ = writeln!(
                text,
                "unasked   {} that the set does not ask for",
                counted(self.unasked, "trial")
            );
        }
        for of in missing.iter().take(MOST_LINES) {
            let (planned, parts) = (&of.planned, of.parts_missing.join(", "));
            let who = if planned.people > 1 {
                format!(" ({} of {})", of.done_by, counted(planned.people, "person"))
            } else {
                String::new()
            };
            let lacks = if parts.is_empty() { parts } else { format!(" [nobody yet: {parts}]") };
            let _ = writeln!(text, "missing   {:18} {}{who}{lacks}", planned.name, planned.explain);
        }
        more(&mut text, "missing", missing.len());
        let _ = writeln!(text, "people    {people} of known stature and mass; to be asked next:");
        for of in &self.next_people {
            let gender = of.gender.as_deref().map_or_else(String::new, |of| format!(", {of}"));
            let [from, to] = of.age_years;
            let _ = writeln!(
                text,
                "          {:.2} m, {:.0} kg, {from} to {to}{gender}",
                of.stature_m,
                of.mass_kg,
                to = counted(to, "year")
            );
        }
        for file in &self.written {
            let _ = writeln!(text, "wrote     {file}");
        }
        text
    }
}

impl GenerateReport {
    /// A line for each action, and what misses a bound.
    #[must_use]
    pub fn words(&self) -> String {
        let Self { added, found, version, set, part: [part, of], seed, .. } = self;
        let added = counted(*added, "trial");
        let outcome = self.outcome.word();
        let mut text = format!(
            "{outcome}: {added} of {set} added (part {part} of {of}, seed {seed}), {found} found\n\
             version   {version}\n"
        );
        if !self.left_out.is_empty() {
            let (count, few) = (self.left_out.len(), self.left_out.iter().take(8));
            let few = few.map(String::as_str).collect::<Vec<_>>().join(", ");
            let rest = if count > 8 { ", ..." } else { "" };
            let _ = writeln!(text, "left out  {count} that no shipped action does: {few}{rest}");
        }
        for alike in &self.alike {
            let _ = writeln!(text, "alike     {alike}");
        }
        let mut by_action: BTreeMap<&str, Vec<&GeneratedTrial>> = BTreeMap::new();
        for trial in &self.trials {
            by_action.entry(trial.action).or_default().push(trial);
        }
        if !by_action.is_empty() {
            text.push_str(
                "\naction           trials  misses  away mm  sinks mm  slides mm  root m/s2  inside mm  force N\n",
            );
        }
        for (action, trials) in by_action {
            let most = |of: fn(&GeneratedTrial) -> f64| {
                trials.iter().map(|trial| of(trial)).fold(0.0, f64::max)
            };
            let margins = trials.iter().filter_map(|trial| trial.margin_mm);
            let inside =
                margins.reduce(f64::min).map_or_else(|| "-".to_owned(), |mm| format!("{mm:.0}"));
            let _ = writeln!(
                text,
                "{action:16} {:6}  {:6}  {:7.1}  {:8.2}  {:9.1}  {:9.1}  {inside:>9}  {:7.0}",
                trials.len(),
                trials.iter().filter(|trial| !trial.missed.is_empty()).count(),
                most(|of| of.away_mm),
                most(|of| of.sinks_mm),
                most(|of| of.slides_mm),
                most(|of| of.root_m_s2),
                most(|of| of.force_n),
            );
        }
        let missing: Vec<&GeneratedTrial> =
            self.trials.iter().filter(|trial| !trial.missed.is_empty()).collect();
        for trial in missing.iter().take(MOST_LINES) {
            let _ = writeln!(text, "misses    {}: {}", trial.name, trial.missed.join(", "));
        }
        more(&mut text, "misses", missing.len());
        for name in self.changed.iter().take(MOST_LINES) {
            let _ = writeln!(text, "changed   {name} is not what it is when it is made again");
        }
        more(&mut text, "changed", self.changed.len());
        text
    }
}

/// Says that there are more.
fn more(text: &mut String, what: &str, all: usize) {
    if all > MOST_LINES {
        let _ = writeln!(text, "{what:9} {} more: --json or --report lists them", all - MOST_LINES);
    }
}

impl AskReport {
    /// A line for each trial that is listed.
    #[must_use]
    pub fn words(&self) -> String {
        let mut text = String::new();
        for clip in &self.clips {
            let of = &clip.entry;
            let subject = of.subject.as_deref().unwrap_or("-");
            let (trial, set, action) = (&of.trial, &of.set, &of.action);
            let (length_s, name) = (of.duration_s, &of.name);
            let _ =
                write!(text, "{trial}  {set:12} {action:16} {subject:8} {length_s:7.2} s  {name}");
            for span in &clip.answering {
                let _ = write!(text, "  {} to {}", span.first_frame, span.last_frame);
            }
            text.push('\n');
        }
        let _ = writeln!(
            text,
            "{} of version {:.12}",
            counted(self.looked.trials, "trial"),
            self.version
        );
        if let Some(written) = &self.written {
            let _ = writeln!(text, "written   {written}");
        }
        text
    }
}

impl CheckReport {
    /// A line for each fault.
    #[must_use]
    pub fn words(&self) -> String {
        let mut text = String::new();
        for fault in &self.faults {
            let _ = writeln!(text, "{:9} {}: {}", fault.kind, fault.at, fault.what);
        }
        for remark in &self.remarks {
            let _ = writeln!(text, "remark    {remark}");
        }
        let Self { trials, labels, subjects, frames, files, faults, version, .. } = self;
        let (outcome, wrong) = (self.outcome.word(), counted(faults.len(), "fault"));
        let _ = writeln!(
            text,
            "{outcome}: {trials}, {labels}, {subjects}, {frames} in {files}, {wrong}\n\
             version   {version}",
            files = counted(*files, "file"),
            frames = counted(*frames, "frame"),
            labels = counted(*labels, "label"),
            trials = counted(*trials, "trial"),
            subjects = counted(subjects, "person")
        );
        text
    }
}

impl RemoveReport {
    /// In a few lines.
    #[must_use]
    pub fn words(&self) -> String {
        let word = if self.dry_run { "would go" } else { "gone" };
        let mut text =
            format!("{} {word}, {} in the corpus\n", counted(self.removed, "trial"), self.left);
        for export in &self.exports {
            let (path, format, subjects) =
                (&export.path, &export.format, export.subjects.join(", "));
            let _ =
                writeln!(text, "export    {path} ({format}) has {subjects}: take it back yourself");
        }
        let _ = writeln!(text, "version   {}", self.version);
        text
    }
}

impl ExportReport {
    /// How many episodes there are, in a dataset.
    fn episodes(&self) -> Option<usize> {
        let all: usize = self.trials.iter().map(|of| of.episodes.len()).sum();
        (all > 0).then_some(all)
    }

    /// In a few lines.
    #[must_use]
    pub fn words(&self) -> String {
        let mut text = format!(
            "{}: {} as {} in {}\nversion   {}\n",
            self.outcome.word(),
            counted(self.trials.len(), "trial"),
            self.format,
            self.written,
            self.version
        );
        for (licence, count) in &self.licences {
            let _ = writeln!(text, "licence   {licence}: {count}");
        }
        if self.noncommercial {
            text.push_str("licence   not for what earns money\n");
        }
        if let Some(episodes) = self.episodes() {
            let played: usize = self.trials.iter().map(|of| of.recordings.len()).sum();
            let _ = writeln!(
                text,
                "episodes  {episodes}, {played} of them recorded: goals as actions, measured angles as states{}",
                if played < episodes { "; of the others goals stand for both" } else { "" }
            );
        }
        for of in self.trials.iter().filter(|of| of.predicted_fall_s.is_some()).take(MOST_LINES) {
            let (name, at_s) = (&of.entry.name, of.predicted_fall_s.unwrap_or(0.0));
            let _ = writeln!(text, "falls     {name} at {at_s:.1} s");
        }
        for of in self.withheld.iter().take(MOST_LINES) {
            let why = of.why.replace('\n', "\n          ");
            let _ = writeln!(text, "withheld  {} ({}): {why}", of.trial, of.name);
        }
        more(&mut text, "withheld", self.withheld.len());
        text
    }
}
