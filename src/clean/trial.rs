//! Markers as cleaning sees them: places over frames, in metres, with room for what is not there.

use crate::mocap::markers::FARTHEST_M;
use glam::DVec3;
use std::ops::Range;

/// More frames than any trial has.
const MOST_FRAMES: usize = 1 << 40;

/// The markers of one trial.
#[derive(Clone, Debug, PartialEq)]
pub struct Trial {
    rate_hz: f64,
    labels: Vec<String>,
    frames: usize,
    /// Marker after marker, frame after frame, m; not a number where one is not seen.
    places: Vec<[f32; 3]>,
}

/// Frames in which one marker is not seen, between frames in which it is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Gap {
    /// Index of the marker.
    pub marker: usize,
    /// Indices of the frames.
    pub frames: Range<usize>,
}

impl Trial {
    /// A trial in which nothing is seen yet; `None` if there is no room for it. `rate_hz` is positive.
    #[must_use]
    pub fn new(rate_hz: f64, labels: Vec<String>, frames: usize) -> Option<Self> {
        let mut places = Vec::new();
        let samples = labels.len().checked_mul(frames)?;
        places.try_reserve_exact(samples).ok()?;
        places.resize(samples, [f32::NAN; 3]);
        Some(Self { rate_hz, labels, frames, places })
    }

    /// Frames per second.
    #[must_use]
    pub const fn rate_hz(&self) -> f64 {
        self.rate_hz
    }

    /// Frames.
    #[must_use]
    pub const fn frames(&self) -> usize {
        self.frames
    }

    /// Names of the markers.
    #[must_use]
    pub fn labels(&self) -> &[String] {
        &self.labels
    }

    /// Markers.
    #[must_use]
    pub const fn markers(&self) -> usize {
        self.labels.len()
    }

    /// Frames in a time, at least one.
    #[must_use]
    pub fn frames_of(&self, time_s: f64) -> usize {
        // Negative and not-a-number become zero. What no trial has may be added up without an overflow.
        ((time_s * self.rate_hz).round() as usize).clamp(1, MOST_FRAMES)
    }

    fn index(&self, marker: usize, frame: usize) -> Option<usize> {
        (marker < self.labels.len() && frame < self.frames).then(|| marker * self.frames + frame)
    }

    /// Where a marker is, m; `None` if it is not seen, or there is no such marker or frame.
    #[must_use]
    pub fn at(&self, marker: usize, frame: usize) -> Option<DVec3> {
        let [x, y, z] = *self.places.get(self.index(marker, frame)?)?;
        let place = DVec3::new(x.into(), y.into(), z.into());
        place.is_finite().then_some(place)
    }

    /// True if a marker is seen in a frame.
    #[must_use]
    pub fn is_seen(&self, marker: usize, frame: usize) -> bool {
        self.at(marker, frame).is_some()
    }

    /// True if a marker is seen in all of these frames, which all must be there.
    #[must_use]
    pub fn is_seen_throughout(&self, marker: usize, mut frames: Range<usize>) -> bool {
        frames.all(|frame| self.is_seen(marker, frame))
    }

    /// Puts a marker somewhere, m, or nowhere. What is no place in a laboratory is nowhere.
    pub fn put(&mut self, marker: usize, frame: usize, place: Option<DVec3>) {
        let Some(at) = self.index(marker, frame) else { return };
        let place =
            place.filter(|place| place.is_finite() && place.abs().max_element() < FARTHEST_M);
        if let Some(held) = self.places.get_mut(at) {
            *held = place.map_or([f32::NAN; 3], |place| place.as_vec3().to_array());
        }
    }

    /// Takes a marker out of some frames; what was there, for [`Trial::put_back`].
    pub fn take_out(&mut self, marker: usize, frames: Range<usize>) -> Taken {
        let last = frames.end.min(self.frames);
        let frames = frames.start.min(last)..last;
        let begin = self.index(marker, frames.start).unwrap_or(self.places.len());
        let end = (begin + frames.len()).min(self.places.len());
        let held = self.places.get_mut(begin..end).unwrap_or_default();
        let places = held.to_vec();
        held.fill([f32::NAN; 3]);
        Taken { begin, places }
    }

    /// Puts back what was taken out.
    pub fn put_back(&mut self, taken: &Taken) {
        let range = taken.begin..taken.begin + taken.places.len();
        if let Some(held) = self.places.get_mut(range) {
            held.copy_from_slice(&taken.places);
        }
    }

    /// Some of its frames as a trial; `None` if there is no room for it.
    #[must_use]
    pub fn part(&self, frames: Range<usize>) -> Option<Self> {
        let mut part = Self::new(self.rate_hz, self.labels.clone(), frames.len())?;
        for marker in 0..self.markers() {
            for (at, frame) in frames.clone().enumerate() {
                part.put(marker, at, self.at(marker, frame));
            }
        }
        Some(part)
    }

    /// Exchanges two markers in some frames.
    pub fn exchange(&mut self, one: usize, other: usize, frames: Range<usize>) {
        for frame in frames {
            if let (Some(a), Some(b)) = (self.index(one, frame), self.index(other, frame)) {
                self.places.swap(a, b);
            }
        }
    }

    /// Runs of frames in which a marker is seen.
    #[must_use]
    pub fn seen_runs(&self, marker: usize) -> Vec<Range<usize>> {
        runs(self.frames, |frame| self.is_seen(marker, frame))
    }

    /// Where a marker is not seen between frames in which it is.
    #[must_use]
    pub fn gaps(&self, marker: usize) -> Vec<Gap> {
        let seen = self.seen_runs(marker);
        let between = seen.windows(2).map(|pair| pair[0].end..pair[1].start);
        between.map(|frames| Gap { marker, frames }).collect()
    }
}

/// What was taken out of a trial.
#[derive(Clone, Debug)]
pub struct Taken {
    begin: usize,
    places: Vec<[f32; 3]>,
}

/// Runs of indices below `count` for which something is true.
pub fn runs(count: usize, is_so: impl Fn(usize) -> bool) -> Vec<Range<usize>> {
    let mut found = Vec::new();
    let mut begin = None;
    for at in 0..=count {
        let holds = at < count && is_so(at);
        match (holds, begin) {
            (true, None) => begin = Some(at),
            (false, Some(first)) => {
                found.push(first..at);
                begin = None;
            }
            _ => {}
        }
    }
    found
}
