//! What helps to fill gaps beside the trial itself: the body that carries the markers, and other trials.

use super::trial::Trial;
use crate::mocap::fit::MarkedBody;
use crate::mocap::fit::marker_set::{MarkerPlace, PLACES, SeenMarkers};
use glam::DVec3;

/// What there is beside the trial; nothing, unless somebody asks for it.
#[derive(Clone, Debug, Default)]
pub struct Aids {
    /// The person.
    pub body: Option<CarryingBody>,
    /// Other trials with markers of the same names, from which all that is wrong has been taken out.
    pub others: Vec<Trial>,
}

/// A body, and which markers of a trial sit where on it.
#[derive(Clone, Debug)]
pub struct CarryingBody {
    body: MarkedBody,
    /// By marker.
    places: Vec<Option<MarkerPlace>>,
}

impl CarryingBody {
    /// A body that carries these places of the markers of a trial.
    #[must_use]
    pub const fn new(body: MarkedBody, places: Vec<Option<MarkerPlace>>) -> Self {
        Self { body, places }
    }

    /// The same for a trial whose markers stand in another order.
    #[must_use]
    pub fn on(&self, own: &Trial, other: &Trial) -> Self {
        let place = |label: &String| {
            let at = marker_called(own, label)?;
            self.places.get(at).copied().flatten()
        };
        let places = other.labels().iter().map(place).collect();
        Self { body: self.body.clone(), places }
    }

    /// Where a marker is in some frames by all others but those that are hidden, m; none where they do not show it.
    #[must_use]
    pub fn carried(
        &self,
        trial: &Trial,
        marker: usize,
        frames: std::ops::Range<usize>,
        is_hidden: impl Fn(usize) -> bool,
    ) -> Option<Vec<Option<DVec3>>> {
        let place = self.places.get(marker).copied().flatten()?;
        let shown: Vec<(usize, MarkerPlace)> = self
            .places
            .iter()
            .enumerate()
            .filter_map(|(marker, place)| Some((marker, (*place)?)))
            .filter(|(marker, _)| !is_hidden(*marker))
            .collect();
        let seen = frames.map(|frame| seen(trial, &shown, frame));
        Some(self.body.carried(place, seen))
    }
}

/// Where markers are in a frame, by their places on a body.
#[must_use]
pub fn seen(trial: &Trial, shown: &[(usize, MarkerPlace)], frame: usize) -> SeenMarkers {
    let mut seen = [None; PLACES];
    for (marker, place) in shown {
        seen[*place as usize] = trial.at(*marker, frame);
    }
    seen
}

/// The marker of a trial that has a name: with what a colon separates from it, else without, if that is one alone.
#[must_use]
pub fn marker_called(trial: &Trial, label: &str) -> Option<usize> {
    let own = |label: &str| label.rsplit(':').next().unwrap_or_default().trim().to_owned();
    let name = own(label);
    let whole = trial.labels().iter().position(|of| of == label);
    whole.or_else(|| {
        let mut alike = trial.labels().iter().enumerate().filter(|(_, of)| own(of) == name);
        let first = alike.next()?;
        alike.next().is_none().then_some(first.0)
    })
}
