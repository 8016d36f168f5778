//! From a file of markers to a trial, and back: what was edited is put in, everything else goes through untouched.

use super::edits::{Change, EditStep, Filled};
use super::sha256::Sha256;
use super::trial::Trial;
use crate::error::{Error, ErrorKind, counted, either};
use crate::mocap::markers::{
    Frame, Frames, Head, Markers, PlacelessCount, PointKind, PointSample, USUAL_UNIT_M,
};
use glam::DVec3;
use std::collections::BTreeSet;
use std::ops::Range;

/// Endings of the four points that Plug-in Gait stores of each bone.
const BONE_ENDINGS: [char; 4] = ['O', 'A', 'L', 'P'];

/// The markers of a file that cleaning looks at.
#[derive(Clone, Debug)]
pub struct SourceMarkers {
    /// Where they are.
    pub trial: Trial,
    /// Of each marker the index of its point in the file.
    pub points: Vec<usize>,
    /// Length of the file's unit, m.
    pub metres_per_unit: f64,
    /// What was taken for granted, and what is left as it is.
    pub notes: Vec<String>,
}

/// Takes the labelled markers out of a file: not what a model computed, and not the nameless (`*12`).
///
/// # Errors
/// A file without a rate, without labelled markers, or too large for memory.
pub fn source(markers: &Markers) -> Result<SourceMarkers, Error> {
    source_and(markers, &BTreeSet::new())
}

/// As [`source`], and of the nameless those that edits name.
///
/// # Errors
/// As [`source`].
pub fn source_and(markers: &Markers, named: &BTreeSet<String>) -> Result<SourceMarkers, Error> {
    let head = markers.head();
    let rate_hz = head.rate_hz.ok_or_else(|| {
        Error::new("frames per second are not known").remedy("say them: --rate HZ")
    })?;
    let mut points = labelled(head);
    if points.is_empty() {
        return Err(Error::of(ErrorKind::Unknown, "the file has no labelled markers")
            .got(counted(head.points.len(), "point"))
            .allowed("points with names of their own that are places of markers"));
    }
    let also: Vec<usize> = (0..head.points.len())
        .filter(|at| {
            let point = &head.points[*at];
            let is_asked_for = point.kind == PointKind::Marker && named.contains(&point.label);
            is_asked_for && points.binary_search(at).is_err()
        })
        .collect();
    points.extend(also);
    let mut notes = Vec::new();
    let metres_per_unit = head.metres_per_unit().unwrap_or_else(|| {
        notes.push("the file does not say its unit of length: taken for mm".to_owned());
        USUAL_UNIT_M
    });
    let left = head.points.len() - points.len();
    if left > 0 {
        notes.push(format!(
            "{} {}",
            counted(left, "point"),
            either(
                left,
                "is no labelled marker (computed, or without a name): left as it is",
                "are no labelled markers (computed, or without a name): left as they are"
            )
        ));
    }
    let labels = unique(points.iter().filter_map(|at| Some(&head.points.get(*at)?.label)));
    let mut trial = Trial::new(rate_hz, labels, head.frames).ok_or_else(|| {
        Error::of(ErrorKind::Io, "the markers do not fit into memory")
            .got(format!(
                "{} of {}",
                counted(head.frames, "frame"),
                counted(points.len(), "marker")
            ))
            .remedy("cut the capture into shorter files")
    })?;
    let mut placeless = PlacelessCount::default();
    for (marker, point) in points.iter().enumerate() {
        for frame in 0..head.frames {
            let sample = markers.sample(frame, *point);
            trial.put(marker, frame, sample.map(|of| metres(of.position, metres_per_unit)));
        }
        let found = markers.placeless(*point, metres_per_unit);
        placeless.add(&found);
        found.at_origin.into_iter().for_each(|frame| trial.put(marker, frame, None));
        if trial.seen_runs(marker).is_empty() {
            notes.push(format!("{} is never seen: left", trial.labels()[marker]));
        }
    }
    notes.extend(placeless.notes());
    Ok(SourceMarkers { trial, points, metres_per_unit, notes })
}

fn metres(position: [f32; 3], metres_per_unit: f64) -> DVec3 {
    let [x, y, z] = position;
    DVec3::new(x.into(), y.into(), z.into()) * metres_per_unit
}

/// The points that are labelled markers.
fn labelled(head: &Head) -> Vec<usize> {
    let own = |label: &str| label.rsplit(':').next().unwrap_or_default().trim().to_owned();
    let names: BTreeSet<String> = head.points.iter().map(|point| own(&point.label)).collect();
    let is_of_bone = |name: &str| {
        let mut letters = name.chars();
        let ends = letters.next_back().is_some_and(|last| BONE_ENDINGS.contains(&last));
        let bone = letters.as_str();
        ends && BONE_ENDINGS.iter().all(|ending| names.contains(&format!("{bone}{ending}")))
    };
    let is_marker = |at: &usize| {
        head.points.get(*at).is_some_and(|point| {
            let name = own(&point.label);
            point.kind == PointKind::Marker
                && !name.is_empty()
                && !name.starts_with('*')
                && !name.starts_with("CentreOfMass")
                && !is_of_bone(&name)
        })
    };
    (0..head.points.len()).filter(is_marker).collect()
}

/// Names of which each stands once: the second of two gets `#2`.
fn unique<'a>(labels: impl Iterator<Item = &'a String>) -> Vec<String> {
    let mut known = BTreeSet::new();
    let mut found = Vec::new();
    for label in labels {
        let mut name = label.clone();
        let mut number = 2_usize;
        while !known.insert(name.clone()) {
            name = format!("{label}#{number}");
            number += 1;
        }
        found.push(name);
    }
    found
}

/// The frames of a file after the edits.
pub struct Cleaned<'a> {
    markers: &'a Markers,
    /// Steps with indices of points instead of markers, and their places in the list; those that begin last first.
    to_come: Vec<(usize, EditStep)>,
    /// Steps of this frame, in the order of the list.
    now: Vec<(usize, EditStep)>,
    /// Sorted by frame, then point.
    filled: Vec<(usize, usize, [f32; 3])>,
    next: usize,
    next_filled: usize,
}

impl<'a> Cleaned<'a> {
    /// Of a file, what was taken of it, what is done and what was filled.
    #[must_use]
    pub fn new(
        markers: &'a Markers,
        source: &SourceMarkers,
        steps: &[EditStep],
        filled: &[Filled],
    ) -> Self {
        let point = |marker: usize| source.points.get(marker).copied().unwrap_or(usize::MAX);
        let mut to_come: Vec<(usize, EditStep)> = steps
            .iter()
            .map(|step| EditStep {
                marker: point(step.marker),
                frames: step.frames.clone(),
                change: match step.change {
                    Change::Exchange(other) => Change::Exchange(point(other)),
                    change => change,
                },
            })
            .enumerate()
            .collect();
        to_come.sort_by_key(|(_, step)| std::cmp::Reverse(step.frames.start));
        let mut filled: Vec<(usize, usize, [f32; 3])> = filled
            .iter()
            .map(|of| {
                let place = (of.place / source.metres_per_unit).as_vec3().to_array();
                (of.frame, point(of.marker), place)
            })
            .collect();
        filled.sort_by_key(|(frame, point, _)| (*frame, *point));
        Self { markers, to_come, now: Vec::new(), filled, next: 0, next_filled: 0 }
    }
}

impl Frames for Cleaned<'_> {
    fn head(&self) -> &Head {
        self.markers.head()
    }

    fn next_frame(&mut self, frame: &mut Frame) -> Result<bool, Error> {
        let now = self.next;
        if !self.markers.frame(now, frame) {
            return Ok(false);
        }
        self.next += 1;
        self.now.retain(|(_, step)| step.frames.end > now);
        while let Some(step) = self.to_come.pop_if(|(_, step)| step.frames.start <= now) {
            self.now.push(step);
            self.now.sort_by_key(|(place, _)| *place);
        }
        for (_, step) in &self.now {
            if let Change::Exchange(other) = step.change
                && step.marker.max(other) < frame.points.len()
            {
                frame.points.swap(step.marker, other);
            }
        }
        for (_, step) in &self.now {
            if matches!(step.change, Change::Exchange(_)) {
                continue;
            }
            if let Some(point) = frame.points.get_mut(step.marker) {
                *point = None;
            }
        }
        while let Some((of, point, place)) = self.filled.get(self.next_filled)
            && *of <= now
        {
            if let Some(point) = frame.points.get_mut(*point).filter(|_| *of == now) {
                // Seen by no camera, and with no residual: as C3D marks what was interpolated.
                let position = *place;
                *point = Some(PointSample { position, residual: 0.0, cameras: 0 });
            }
            self.next_filled += 1;
        }
        Ok(true)
    }
}

/// Some of the frames of a file.
pub struct CroppedFrames<'a> {
    frames: Cleaned<'a>,
    head: Head,
    keep: Range<usize>,
}

impl<'a> CroppedFrames<'a> {
    /// These frames alone, by index.
    #[must_use]
    pub fn new(frames: Cleaned<'a>, keep: Range<usize>) -> Self {
        let mut head = frames.head().clone();
        head.frames = keep.len();
        head.first_frame = head.first_frame.saturating_add(keep.start as u64);
        Self { frames, head, keep }
    }
}

impl Frames for CroppedFrames<'_> {
    fn head(&self) -> &Head {
        &self.head
    }

    fn next_frame(&mut self, frame: &mut Frame) -> Result<bool, Error> {
        while self.frames.next < self.keep.start {
            if !self.frames.next_frame(frame)? {
                return Ok(false);
            }
        }
        Ok(self.frames.next < self.keep.end && self.frames.next_frame(frame)?)
    }
}

/// The digest of samples: of each its point, its frame and the bits of its place. Of all that are seen if nothing is
/// `edited`, else of those that were seen before and are named by no edit.
///
/// # Errors
/// Frames that cannot be read.
pub fn digest(
    frames: &mut dyn Frames,
    mut is_good: impl FnMut(usize, usize) -> bool,
) -> Result<Digest, Error> {
    let (mut digest, mut samples) = (Sha256::default(), 0);
    let (mut frame, mut number) = (Frame::default(), 0_usize);
    while frames.next_frame(&mut frame)? {
        for (point, sample) in frame.points.iter().enumerate() {
            let Some(PointSample { position, .. }) = sample else { continue };
            if is_good(point, number) {
                digest.update(&(point as u64).to_le_bytes());
                digest.update(&(number as u64).to_le_bytes());
                position.iter().for_each(|of| digest.update(&of.to_le_bytes()));
                samples += 1;
            }
        }
        number += 1;
    }
    Ok(Digest { sha256: digest.finish(), samples })
}

/// What samples come to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Digest {
    /// SHA-256, in hexadecimal digits.
    pub sha256: String,
    /// Samples.
    pub samples: u64,
}

/// Which samples edits name: of each point the frames, as a set of bits.
#[derive(Clone, Debug)]
pub struct NamedSamples {
    frames: usize,
    points: usize,
    bits: Vec<u64>,
}

impl NamedSamples {
    /// By steps on the markers of a file.
    #[must_use]
    pub fn by(steps: &[EditStep], source: &SourceMarkers, head: &Head) -> Self {
        let (frames, points) = (head.frames, head.points.len());
        let mut named = Self { frames, points, bits: vec![0; (frames * points).div_ceil(64)] };
        for step in steps {
            let other = match step.change {
                Change::Exchange(other) => Some(other),
                Change::Fill(_) | Change::Remove => None,
            };
            for marker in std::iter::once(step.marker).chain(other) {
                let Some(point) = source.points.get(marker) else { continue };
                for frame in step.frames.clone() {
                    if let Some(at) = named.at(*point, frame) {
                        named.bits[at / 64] |= 1 << (at % 64);
                    }
                }
            }
        }
        named
    }

    fn at(&self, point: usize, frame: usize) -> Option<usize> {
        (point < self.points && frame < self.frames).then(|| frame * self.points + point)
    }

    /// True if an edit names this sample.
    #[must_use]
    pub fn has(&self, point: usize, frame: usize) -> bool {
        self.at(point, frame).is_some_and(|at| self.bits[at / 64] >> (at % 64) & 1 == 1)
    }
}
