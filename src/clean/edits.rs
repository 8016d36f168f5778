//! The edit list: what is done to a trial, as a file that a person may read, change and apply again to what was
//! recorded. Edits do not build on one another: each can be taken away.

use super::artefact::{Artefact, ArtefactKind};
use super::choice::Chooser;
use super::fill::Method;
use super::trial::Trial;
use crate::error::{Error, ErrorKind, counted};
use crate::toml_text::{from_toml, plain_words, to_toml};
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::ops::Range;

/// Version of the format.
pub const SCHEMA: u32 = 1;
/// Most bytes of an edit list.
pub const MAX_BYTES: usize = 1 << 24;

/// What stands at the head of the file.
const REMARKS: &str = "\
What `gaitway clean` did. Applied again to the same file by --edits, it gives the same result.
remedy: fill      what is seen in these frames is taken out, and the gap filled by `method`
        remove    what is seen in these frames is taken out
        exchange  the marker and `with` have each other's names in these frames
        leave     nothing is done
method: cubic, quintic, rigid_body, pattern, low_rank, skeleton (static_trial, else the trial itself, shows the
        body), other_trials (by other_trials)
Frames are counted as in the file, the last one included. To undo an edit, delete it or let it `leave`.
An edit of your own has the kind by_hand. To give a piece of a nameless point its name, exchange the marker with
it (with = \"*12\"). To crop the trial, write the first and the last frame to keep above the first edit:
keep_frames = [120, 480]
How many minutes you spent on it may stand there too: minutes = 12";

/// What is done.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Remedy {
    /// What is seen is taken out, and the gap is filled.
    Fill,
    /// What is seen is taken out.
    Remove,
    /// Two markers have each other's names.
    Exchange,
    /// Nothing.
    Leave,
}

/// One edit.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Edit {
    /// What was wrong.
    pub kind: ArtefactKind,
    /// Name of the marker.
    pub marker: String,
    /// The first frame of it, as the file counts.
    pub first_frame: u64,
    /// The last frame of it.
    pub last_frame: u64,
    /// What is done.
    pub remedy: Remedy,
    /// How a gap is filled.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub method: Option<Method>,
    /// Name of the marker it is exchanged with.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub with: Option<String>,
}

/// A list of edits and what it belongs to.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EditList {
    /// Version of the format; 1.
    pub schema: u32,
    /// The file that it was made for.
    pub source: String,
    /// SHA-256 of the places in that file; without it the list is taken for any file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub source_sha256: Option<String>,
    /// The first and the last frame that are kept, as the file counts; all without it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub keep_frames: Option<Vec<u64>>,
    /// Minutes that a person spent on this list: for the table of rounds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub minutes: Option<f64>,
    /// The trial in which the person stands still, of whose skeleton fills make use; without it the trial itself.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub static_trial: Option<String>,
    /// Other trials that fills make use of.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub other_trials: Vec<String>,
    /// SHA-256 of the places in those files; without it they are taken as they are.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub aids_sha256: Option<String>,
    /// What is done.
    #[serde(default, rename = "edit", skip_serializing_if = "Vec::is_empty")]
    pub edits: Vec<Edit>,
}

impl EditList {
    /// Reads a list.
    ///
    /// # Errors
    /// A text that is no edit list of this version.
    pub fn parse(text: &str) -> Result<Self, Error> {
        if text.len() > MAX_BYTES {
            return Err(Error::of(ErrorKind::OutsideLimits, "the edit list is too large")
                .got(counted(text.len(), "byte"))
                .allowed(format!("at most {MAX_BYTES} bytes")));
        }
        let list: Self = from_toml(text).map_err(|cause| {
            let error = Error::of(ErrorKind::Malformed, "not an edit list")
                .got(plain_words(cause.message()))
                .remedy("compare it with one that `gaitway clean` wrote");
            match cause.span() {
                Some(span) => {
                    let line = 1 + text.get(..span.start).unwrap_or_default().matches('\n').count();
                    error.at(format!("line {line}"))
                }
                None => error,
            }
        })?;
        if list.schema == SCHEMA {
            let is_time = |minutes: &f64| minutes.is_finite() && *minutes >= 0.0;
            return match list.minutes.filter(|minutes| !is_time(minutes)) {
                None => Ok(list),
                Some(minutes) => Err(Error::of(ErrorKind::OutsideLimits, "no time that was spent")
                    .at("minutes")
                    .got(minutes.to_string())
                    .allowed("0 or more")),
            };
        }
        Err(Error::of(ErrorKind::Malformed, "another version of edit lists")
            .got(list.schema.to_string())
            .allowed(SCHEMA.to_string()))
    }

    /// True if a gap is filled so.
    #[must_use]
    pub fn fills_by(&self, method: Method) -> bool {
        let is_so = |edit: &Edit| edit.remedy == Remedy::Fill && edit.method == Some(method);
        self.edits.iter().any(is_so)
    }

    /// Every name that an edit has.
    #[must_use]
    pub fn names(&self) -> BTreeSet<String> {
        let both = |edit: &Edit| std::iter::once(edit.marker.clone()).chain(edit.with.clone());
        self.edits.iter().flat_map(both).collect()
    }

    /// Indices of the frames that are kept, of a file of so many that begins with this number.
    ///
    /// # Errors
    /// Frames that the file does not have, or none.
    pub fn kept(&self, first_frame: u64, frames: usize) -> Result<Range<usize>, Error> {
        let Some(kept) = &self.keep_frames else { return Ok(0..frames) };
        let [first, last] = *kept.as_slice() else {
            let kept: Vec<String> = kept.iter().map(u64::to_string).collect();
            return Err(Error::of(ErrorKind::Malformed, "not the ends of what is kept")
                .at("keep_frames")
                .got(format!("[{}]", kept.join(", ")))
                .allowed("two numbers: the first frame that is kept, and the last"));
        };
        let end = first_frame.saturating_add(frames as u64);
        if first < first_frame || first > last || last >= end {
            return Err(Error::of(ErrorKind::OutsideLimits, "the file has no such frames")
                .at("keep_frames")
                .got(format!("{first} to {last}"))
                .allowed(format!("{first_frame} to {}", end.saturating_sub(1))));
        }
        let at = |frame: u64| usize::try_from(frame - first_frame).unwrap_or(frames).min(frames);
        Ok(at(first)..at(last).saturating_add(1).min(frames))
    }

    /// The list as text.
    ///
    /// # Errors
    /// Names that have no form in TOML.
    pub fn to_text(&self) -> Result<String, Error> {
        to_toml(REMARKS, self)
    }
}

/// An edit on a trial, by indices.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct EditStep {
    /// Index of the marker.
    pub marker: usize,
    /// Indices of the frames.
    pub frames: Range<usize>,
    /// What is done.
    pub change: Change,
}

/// What a step does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    /// Takes out and fills, in one way.
    Fill(Method),
    /// Takes out.
    Remove,
    /// Gives two markers each other's names: the index of the other.
    Exchange(usize),
}

impl EditStep {
    /// What is to be done about an artefact before gaps are looked at.
    #[must_use]
    pub fn unfilled(artefact: &Artefact) -> Self {
        let change = match artefact.with {
            Some(other) if artefact.kind.is_swap() => Change::Exchange(other),
            _ => Change::Remove,
        };
        Self { marker: artefact.marker, frames: artefact.frames.clone(), change }
    }

    /// An edit on a trial whose first frame has this number; `None` if nothing is to be done.
    ///
    /// # Errors
    /// A marker that the trial does not have, frames that it does not have, a fill without its method, an exchange
    /// without its other marker.
    pub fn of(edit: &Edit, trial: &Trial, first_frame: u64) -> Result<Option<Self>, Error> {
        let place = || format!("edit of {} from frame {}", edit.marker, edit.first_frame);
        let marker =
            |name: &str| {
                trial.labels().iter().position(|label| label == name).ok_or_else(|| {
                    Error::of(ErrorKind::Unknown, "the file has no such marker")
                        .at(place())
                        .none_of(name, trial.labels(), "delete the edit")
                })
            };
        let index = marker(&edit.marker)?;
        let last = first_frame.saturating_add(trial.frames() as u64).saturating_sub(1);
        let is_there = first_frame <= edit.first_frame
            && edit.first_frame <= edit.last_frame
            && edit.last_frame <= last;
        if !is_there {
            return Err(Error::of(ErrorKind::OutsideLimits, "the file has no such frames")
                .at(place())
                .got(format!("{} to {}", edit.first_frame, edit.last_frame))
                .allowed(format!("{first_frame} to {last}")));
        }
        let at = |frame: u64| usize::try_from(frame - first_frame).unwrap_or(usize::MAX);
        let frames = at(edit.first_frame)..at(edit.last_frame) + 1;
        let lacks = |what: &str| {
            Error::of(ErrorKind::Malformed, format!("the edit lacks `{what}`")).at(place())
        };
        let change = match edit.remedy {
            Remedy::Leave => return Ok(None),
            Remedy::Remove => Change::Remove,
            Remedy::Fill => Change::Fill(edit.method.ok_or_else(|| lacks("method"))?),
            Remedy::Exchange => {
                let other = marker(edit.with.as_deref().ok_or_else(|| lacks("with"))?)?;
                if other == index {
                    return Err(Error::of(ErrorKind::Malformed, "a marker exchanged with itself")
                        .at(place()));
                }
                Change::Exchange(other)
            }
        };
        Ok(Some(Self { marker: index, frames, change }))
    }
}

/// Does the exchanges, then takes out what is to be taken out; nothing is filled yet.
pub fn prepare(trial: &mut Trial, steps: &[EditStep]) {
    for EditStep { marker, frames, change } in steps {
        if let Change::Exchange(other) = change {
            trial.exchange(*marker, *other, frames.clone());
        }
    }
    for EditStep { marker, frames, change } in steps {
        if !matches!(change, Change::Exchange(_)) {
            let _ = trial.take_out(*marker, frames.clone());
        }
    }
}

/// A frame of a gap that was filled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Filled {
    /// Index of the marker.
    pub marker: usize,
    /// Index of the frame.
    pub frame: usize,
    /// The place, m.
    pub place: DVec3,
}

/// Fills the gaps of a prepared trial that the steps are to fill; each after what is seen, and not after what is
/// filled. `told` hears how many of how many are done. Gaps that cannot be filled so are left.
pub fn fill(
    chooser: &mut Chooser<'_>,
    steps: &[EditStep],
    mut told: impl FnMut(usize, usize),
) -> Vec<Filled> {
    let mut markers: Vec<usize> = steps.iter().map(|step| step.marker).collect();
    markers.sort_unstable();
    markers.dedup();
    let mut wanted = Vec::new();
    for marker in markers {
        let gaps = chooser.trial().gaps(marker);
        for gap in gaps {
            // Of several edits that share a gap, the longest says how.
            let shared = |step: &&EditStep| {
                let (from, to) =
                    (step.frames.start.max(gap.frames.start), step.frames.end.min(gap.frames.end));
                to.saturating_sub(from)
            };
            let of_this = steps.iter().filter(|step| step.marker == marker && shared(step) > 0);
            let fills = of_this.filter_map(|step| match step.change {
                Change::Fill(method) => Some((shared(&step), method)),
                _ => None,
            });
            if let Some((_, method)) = fills.max_by_key(|(length, _)| *length) {
                wanted.push((gap, method));
            }
        }
    }
    let count = wanted.len();
    let mut filled = Vec::new();
    for (done, (gap, method)) in wanted.into_iter().enumerate() {
        told(done, count);
        let marker = gap.marker;
        let of_this = steps.iter().filter(|step| step.marker == marker);
        let (fills, others): (Vec<&EditStep>, Vec<&EditStep>) =
            of_this.partition(|step| matches!(step.change, Change::Fill(_)));
        let is_wanted = |frame: &usize| {
            fills.iter().any(|step| step.frames.contains(frame))
                && !others
                    .iter()
                    .any(|step| step.change == Change::Remove && step.frames.contains(frame))
        };
        let places = chooser.fill(&gap, method).unwrap_or_default();
        let frames = gap.frames.zip(places).filter(|(frame, _)| is_wanted(frame));
        filled.extend(frames.map(|(frame, place)| Filled { marker, frame, place }));
    }
    told(count, count);
    filled
}
