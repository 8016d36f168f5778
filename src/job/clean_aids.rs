//! What helps to fill the gaps of a trial beside the trial itself, out of files: a static trial, other trials.

use crate::clean::aids::{Aids, CarryingBody, seen};
use crate::clean::detect;
use crate::clean::edits::{EditStep, prepare};
use crate::clean::sha256::Sha256;
use crate::clean::source::{SourceMarkers, digest, source};
use crate::clean::trial::Trial;
use crate::error::{Error, ErrorKind};
use crate::mocap::fit::marker_set::{Labelled, MarkerPlace};
use crate::mocap::fit::{FitSettings, MarkedBody};
use crate::mocap::marker_files;
use crate::mocap::markers::{FramesOf, Head, Markers};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Other trials that are looked at, at most, and samples in all of them.
const MOST_OTHERS: usize = 24;
const MOST_SAMPLES: usize = 4 << 20;

/// Another trial, with what is wrong taken out.
#[derive(Clone, Debug)]
pub(super) struct OtherTrial {
    file: PathBuf,
    trial: Trial,
    sha256: String,
}

/// Such files as an edit list names them.
pub(super) struct NamedAids {
    pub(super) static_trial: Option<String>,
    pub(super) others: Vec<String>,
    /// Of what is in all of them.
    pub(super) sha256: Option<String>,
}

/// Files read that help to fill gaps.
#[derive(Clone, Debug, Default)]
pub(super) struct AidFiles {
    static_trial: Option<Arc<(PathBuf, Markers)>>,
    others: Arc<[OtherTrial]>,
    /// The one that is cleaned, which is not among the others.
    own: PathBuf,
}

impl AidFiles {
    /// Reads a static trial, and other trials, but the one that is cleaned itself.
    ///
    /// # Errors
    /// A file that cannot be read or holds no labelled markers.
    pub(super) fn read(
        static_trial: Option<&Path>,
        others: &[PathBuf],
        own: &Path,
        rate_hz: Option<f64>,
    ) -> Result<Self, Error> {
        let is_other = |file: &&PathBuf| !is_same(file, own);
        let others: Vec<PathBuf> = others.iter().filter(is_other).cloned().collect();
        let mut read = Vec::new();
        for file in &others {
            if !OtherTrial::read_into(&mut read, file, rate_hz)? {
                break;
            }
        }
        Ok(Self {
            static_trial: read_static(static_trial)?,
            others: read.into(),
            own: own.to_owned(),
        })
    }

    /// These, for another of them.
    pub(super) fn of(&self, own: &Path) -> Self {
        Self { own: own.to_owned(), ..self.clone() }
    }

    /// A static trial and other trials that are read already.
    ///
    /// # Errors
    /// A static trial that cannot be read.
    pub(super) fn with(
        static_trial: Option<&Path>,
        others: Vec<OtherTrial>,
    ) -> Result<Self, Error> {
        let own = PathBuf::new();
        Ok(Self { static_trial: read_static(static_trial)?, others: others.into(), own })
    }

    fn others(&self) -> impl Iterator<Item = &OtherTrial> {
        self.others.iter().filter(|other| !is_same(&other.file, &self.own))
    }

    /// What they are to a trial from which what is wrong was taken out. What was found out about the body is added to
    /// the notes.
    ///
    /// # Errors
    /// A static trial whose markers are no person who stands, or another's than the trial's.
    pub(super) fn aids(
        &self,
        head: &Head,
        source: &SourceMarkers,
        trial: &Trial,
        notes: &mut Vec<String>,
    ) -> Result<Aids, Error> {
        let others = self.others().map(|other| other.trial.clone()).collect();
        let stands = self.static_trial.as_deref();
        let body = body(head, source, trial, stands.map(|(_, markers)| markers), notes);
        let body = match (body, stands) {
            (Ok(body), _) => Some(body),
            (Err(error), Some((file, _))) => return Err(error.in_file(file)),
            // A trial that shows nobody is filled in other ways.
            (Err(_), None) => None,
        };
        Ok(Aids { body, others })
    }

    /// The files, for an edit list whose fills make use of them: the static trial, the others, and the digest of all.
    ///
    /// # Errors
    /// Never, of what was read.
    pub(super) fn named(&self, with_static: bool, with_others: bool) -> Result<NamedAids, Error> {
        let stands = self.static_trial.as_deref().filter(|_| with_static);
        let others: Vec<&OtherTrial> = self.others().filter(|_| with_others).collect();
        let shown = |file: &Path| file.display().to_string();
        let mut all = Sha256::default();
        if let Some((_, markers)) = stands {
            all.update(digest(&mut FramesOf::new(markers), |_, _| true)?.sha256.as_bytes());
        }
        others.iter().for_each(|other| all.update(other.sha256.as_bytes()));
        let others: Vec<String> = others.iter().map(|other| shown(&other.file)).collect();
        let is_any = stands.is_some() || !others.is_empty();
        let static_trial = stands.map(|(file, _)| shown(file));
        Ok(NamedAids { static_trial, others, sha256: is_any.then(|| all.finish()) })
    }
}

fn read_static(file: Option<&Path>) -> Result<Option<Arc<(PathBuf, Markers)>>, Error> {
    let read =
        |file: &Path| Ok(Arc::new((file.to_owned(), marker_files::read_places(file, None)?)));
    file.map(read).transpose()
}

impl OtherTrial {
    /// Reads a trial and adds it to others, unless they are enough; false then.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub(super) fn read_into(
        others: &mut Vec<Self>,
        file: &Path,
        rate_hz: Option<f64>,
    ) -> Result<bool, Error> {
        let samples = |of: &Self| of.trial.markers() * of.trial.frames();
        let all: usize = others.iter().map(samples).sum();
        if others.len() >= MOST_OTHERS {
            return Ok(false);
        }
        let read = Self::read(file, rate_hz)?;
        let has_room = all + samples(&read) <= MOST_SAMPLES;
        others.extend(Some(read).filter(|_| has_room));
        Ok(has_room)
    }

    /// Reads a trial and takes out what is wrong.
    ///
    /// # Errors
    /// A file that cannot be read or holds no labelled markers.
    fn read(file: &Path, rate_hz: Option<f64>) -> Result<Self, Error> {
        let markers = marker_files::read(file, rate_hz)?;
        let all = digest(&mut FramesOf::new(&markers), |_, _| true)?;
        let mut trial = source(&markers).map_err(|error| error.in_file(file))?.trial;
        let found = detect::artefacts(&trial, |_, _| {});
        let steps: Vec<EditStep> = found.iter().map(EditStep::unfilled).collect();
        prepare(&mut trial, &steps);
        Ok(Self { file: file.to_owned(), trial, sha256: all.sha256 })
    }
}

/// The body of a trial.
fn body(
    head: &Head,
    source: &SourceMarkers,
    trial: &Trial,
    stands: Option<&Markers>,
    notes: &mut Vec<String>,
) -> Result<CarryingBody, Error> {
    let settings = FitSettings::default();
    let labelled = Labelled::find(head, &settings.sets, None)?;
    let places: Vec<Option<MarkerPlace>> =
        source.points.iter().map(|point| labelled.place_of(*point)).collect();
    let shown: Vec<(usize, MarkerPlace)> =
        places.iter().enumerate().filter_map(|(marker, place)| Some((marker, (*place)?))).collect();
    let own = |frame| seen(trial, &shown, frame);
    let body = MarkedBody::of(stands, head, &own, &settings, notes)?;
    Ok(CarryingBody::new(body, places))
}

/// The file that an edit list names: as it stands there, else beside the trial.
///
/// # Errors
/// If it is nowhere.
pub(super) fn found(named: &str, trial: &Path) -> Result<PathBuf, Error> {
    let as_named = PathBuf::from(named);
    if as_named.exists() {
        return Ok(as_named);
    }
    let beside = as_named.file_name().map(|name| trial.with_file_name(name));
    beside.filter(|file| file.exists()).ok_or_else(|| {
        Error::of(ErrorKind::Absent, "a trial that fills make use of is not there")
            .got(named.to_owned())
            .remedy(
                "put it beside the trial that is cleaned, or name it: --static FILE, --others FILE",
            )
    })
}

fn is_same(one: &Path, other: &Path) -> bool {
    let whole = |path: &Path| std::fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
    whole(one) == whole(other)
}
