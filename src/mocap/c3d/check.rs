//! What other programs may stumble over in a C3D file.
//!
//! Readers disagree on files that leave out what is usual, or say one thing in two ways. The rules here are
//! those that a file must keep to be opened alike everywhere; what this project writes keeps them.
//! They are: header and parameters agree; the group ANALOG is complete also where there are no channels;
//! analog samples per frame are a whole number; events have contexts; lists are as long as what they
//! describe; every name stands once.

use super::header::{BLOCK, Header};
use super::layout::Layout;
use crate::error::{counted, either};
use crate::mocap::markers::Head;
use crate::mocap::parameters::{Parameter, ParameterKind, Parameters, shown_name, text_of};
use std::collections::BTreeSet;

/// The rules that are broken, a line each.
pub(super) fn findings(head: &Head, header: &Header, layout: &Layout) -> Vec<String> {
    let mut check = Check { parameters: &head.parameters, findings: Vec::new() };
    check.agreement(head, header, layout);
    check.points(layout.points);
    check.analog(head, layout);
    check.events();
    check.plates();
    check.names();
    if !head.encoding.starts_with("Intel") {
        check.say(format!("numbers as of a {} machine, which some programs refuse", head.encoding));
    }
    check.findings
}

struct Check<'a> {
    parameters: &'a Parameters,
    findings: Vec<String>,
}

impl Check<'_> {
    fn say(&mut self, finding: impl Into<String>) {
        self.findings.push(finding.into());
    }

    fn number(&self, group: &str, name: &str) -> Option<f64> {
        self.parameters.get(group, name).and_then(Parameter::number)
    }

    fn count(&self, group: &str, name: &str) -> Option<u64> {
        self.parameters.get(group, name).and_then(Parameter::first_count)
    }

    /// Fails unless two places say the same.
    fn same(&mut self, what: &str, header: f64, group: &str, name: &str) {
        match self.number(group, name) {
            None => self.say(format!("{group}:{name} is missing")),
            Some(number) if (number - header).abs() > 1e-6 * header.abs() => {
                self.say(format!("{what}: {header} in the header, {number} in {group}:{name}"));
            }
            Some(_) => {}
        }
    }

    fn agreement(&mut self, head: &Head, header: &Header, layout: &Layout) {
        self.same("points", header.points.into(), "POINT", "USED");
        self.same("scale", header.scale.into(), "POINT", "SCALE");
        self.same("frames per second", header.rate_hz.into(), "POINT", "RATE");
        let data_start = self.count("POINT", "DATA_START");
        if data_start != Some(header.data_start.into()) {
            let block = header.data_start;
            self.say(format!(
                "the data begin in block {block} by the header, and not by POINT:DATA_START"
            ));
        }
        if (u64::from(header.data_start).saturating_sub(1)) * BLOCK as u64 != layout.start {
            self.say(format!("the data do not begin in block {}", header.data_start));
        }
        let frames = self.count("POINT", "FRAMES");
        let told = layout.claimed.min(65_535);
        if frames != Some(told) || header.frames() != Some(told) {
            self.say(format!(
                "{}: {} in the header, {} in POINT:FRAMES",
                counted(layout.claimed, "frame"),
                header.frames().unwrap_or(0),
                frames.map_or_else(|| "none".to_owned(), |frames| frames.to_string())
            ));
        }
        if layout.claimed > 65_535 && self.count("POINT", "LONG_FRAMES") != Some(layout.claimed) {
            self.say("more than 65,535 frames, and POINT:LONG_FRAMES does not tell how many");
        }
        if layout.frames < layout.claimed {
            self.say(format!(
                "{} {} claimed, {} {} there",
                counted(layout.claimed, "frame"),
                either(layout.claimed, "is", "are"),
                layout.frames,
                either(layout.frames, "is", "are")
            ));
        }
        if usize::from(header.analog) != layout.analog {
            self.say(format!(
                "{} per frame in the header, {} in fact",
                counted(header.analog, "analog count"),
                layout.analog
            ));
        }
        if let Some(rate_hz) = head.analog.rate_hz {
            let ratio = head.rate_hz.map(|points_hz| rate_hz / points_hz);
            let per_frame = head.analog.per_frame as f64;
            if !head.analog.channels.is_empty()
                && ratio.is_none_or(|ratio| (ratio - per_frame).abs() > 1e-6 * per_frame)
            {
                self.say(format!("ANALOG:RATE is not {per_frame} times POINT:RATE"));
            }
        }
    }

    /// Fails unless a list is there, of this kind and long enough.
    fn list(&mut self, group: &str, name: &str, kind: ParameterKind, least: usize) {
        let Some(found) = self.parameters.get(group, name) else {
            return self.say(format!("{group}:{name} is missing"));
        };
        if found.kind != kind {
            return self
                .say(format!("{group}:{name} is of the type {:?}, {kind:?} is usual", found.kind));
        }
        let length = match kind {
            ParameterKind::Char => self.parameters.texts(group, name).len(),
            _ => self.parameters.numbers(group, name).len(),
        };
        if length < least {
            self.say(format!(
                "{group}:{name} has {length} for {least}",
                length = counted(length, "entry")
            ));
        }
    }

    fn points(&mut self, points: usize) {
        self.list("POINT", "FRAMES", ParameterKind::Int, 1);
        self.list("POINT", "LABELS", ParameterKind::Char, points);
        self.list("POINT", "DESCRIPTIONS", ParameterKind::Char, points);
        self.list("POINT", "UNITS", ParameterKind::Char, usize::from(points > 0));
    }

    fn analog(&mut self, head: &Head, layout: &Layout) {
        let channels = head.analog.channels.len();
        self.list("ANALOG", "USED", ParameterKind::Int, 1);
        if self.count("ANALOG", "USED").is_some_and(|used| used != channels as u64) {
            self.say(format!("ANALOG:USED is not {channels}"));
        }
        self.list("ANALOG", "GEN_SCALE", ParameterKind::Float, 1);
        self.list("ANALOG", "RATE", ParameterKind::Float, 1);
        for name in ["LABELS", "DESCRIPTIONS", "UNITS"] {
            self.list("ANALOG", name, ParameterKind::Char, channels);
        }
        self.list("ANALOG", "SCALE", ParameterKind::Float, channels);
        self.list("ANALOG", "OFFSET", ParameterKind::Int, channels);
        let offsets = self.parameters.numbers("ANALOG", "OFFSET");
        if offsets.iter().take(channels).any(|offset| *offset < 0.0) {
            self.say("ANALOG:OFFSET is negative, which programs take in two ways");
        }
        if channels > 0 && !layout.analog.is_multiple_of(channels) {
            self.say(format!(
                "{} per frame {} not {channels} times a whole number",
                counted(layout.analog, "analog count"),
                either(layout.analog, "is", "are")
            ));
        }
    }

    fn events(&mut self) {
        let Some(used) = self.count("EVENT", "USED").filter(|used| *used > 0) else { return };
        let used = usize::try_from(used).unwrap_or(usize::MAX);
        for name in ["CONTEXTS", "LABELS"] {
            self.list("EVENT", name, ParameterKind::Char, used);
        }
        self.list("EVENT", "TIMES", ParameterKind::Float, used.saturating_mul(2));
        let times = self.parameters.get("EVENT", "TIMES");
        if times.is_some_and(|times| times.dimensions.first() != Some(&2)) {
            self.say("EVENT:TIMES is no list of pairs");
        }
    }

    fn plates(&mut self) {
        let Some(used) = self.count("FORCE_PLATFORM", "USED").filter(|used| *used > 0) else {
            return;
        };
        let used = usize::try_from(used).unwrap_or(usize::MAX);
        for (name, kind, each) in [
            ("TYPE", ParameterKind::Int, 1),
            ("CHANNEL", ParameterKind::Int, 6),
            ("CORNERS", ParameterKind::Float, 12),
            ("ORIGIN", ParameterKind::Float, 3),
        ] {
            self.list("FORCE_PLATFORM", name, kind, used.saturating_mul(each));
        }
    }

    fn names(&mut self) {
        let mut groups = BTreeSet::new();
        let upper = |name: &[u8]| text_of(name).trim().to_ascii_uppercase();
        let mut double = Vec::new();
        for group in &self.parameters.groups {
            let of = upper(&group.name);
            let mut names = BTreeSet::new();
            for parameter in &group.parameters {
                let name = upper(&parameter.name);
                if !names.insert(name.clone()) {
                    let [of, name] = [&of, &name].map(|name| shown_name(name.as_bytes()));
                    double.push(format!("{of}:{name} stands twice"));
                }
            }
            if of.is_empty() {
                double.push(format!("group {} has no name", group.id));
            } else if !groups.insert(of.clone()) {
                double.push(format!("group {of} stands twice"));
            }
        }
        self.findings.extend(double);
    }
}
