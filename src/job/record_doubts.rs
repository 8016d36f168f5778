//! What worn sensors say while they are recorded that nobody can do: they stand still, turn or are jolted as no segment of a body, or
//! their gravity is elsewhere than down. Nobody is calibrated here, so no joint is looked at, nor what is swapped: a session does that,
//! and whoever converts the recording.

use super::{Event, Observer};
use crate::body::worn::doubt::Doubts;
use crate::sensing::{Place, Said};
use crate::time::Instant;
use glam::{DQuat, DVec3};
use serde::Serialize;
use std::collections::BTreeMap;
use std::sync::mpsc::Receiver;

/// How often a sensor said what cannot be.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct DoubtTally {
    /// So often.
    pub times: u64,
    /// For so long together, s.
    pub time_s: f64,
}

/// Looks at what worn sensors say.
pub(super) struct RecordDoubts<'a> {
    worn: &'a [Place],
    said: Receiver<Said>,
    doubts: Doubts,
    /// By place, what was measured of gravity since the last look, in the sensor's own world: sum, m/s^2, and count.
    forces: Vec<(DVec3, u32)>,
    looked: Instant,
}

impl<'a> RecordDoubts<'a> {
    /// Of these sensors, as they are heard from now on.
    pub(super) fn new(worn: &'a [Place], said: Receiver<Said>, now: Instant) -> Self {
        let forces = vec![(DVec3::ZERO, 0); worn.len()];
        Self { worn, said, doubts: Doubts::default(), forces, looked: now }
    }

    /// Looks at what was said since the last look; who is doubted from now on is told.
    pub(super) fn look(&mut self, now: Instant, observer: &dyn Observer) {
        while let Ok(said) = self.said.try_recv() {
            self.hear(&said);
        }
        let dt_s = now.seconds_since(self.looked);
        self.looked = now;
        for (place, (sum, count)) in self.worn.iter().zip(&mut self.forces) {
            let force = (*count > 0).then(|| *sum / f64::from(*count));
            (*sum, *count) = (DVec3::ZERO, 0);
            self.doubts.weigh(place.segment, force, dt_s);
        }
        for change in self.doubts.judge(dt_s).iter().filter(|change| change.doubted.is_some()) {
            observer.hear(Event::Note(&change.words()));
        }
    }

    fn hear(&mut self, said: &Said) {
        let Said::Sample { sensor, orientation, acceleration_m_s2, anew, stuck, taken, .. } = said
        else {
            return;
        };
        let Some(at) = self.worn.iter().position(|place| place.sensor == **sensor) else { return };
        let segment = self.worn[at].segment;
        if *anew {
            self.doubts.began_anew(segment);
        }
        // While its values stand still it tells no orientation.
        if *stuck {
            return self.doubts.hear(segment, DQuat::IDENTITY, *taken, true);
        }
        let Some(turned) = orientation else { return };
        self.doubts.hear(segment, *turned, *taken, false);
        if let Some(force) = acceleration_m_s2 {
            let (sum, count) = &mut self.forces[at];
            (*sum, *count) = (*sum + *turned * *force, *count + 1);
        }
    }

    /// By sensor, how often and for how long it was doubted, of those that were.
    pub(super) fn tallies(&self) -> BTreeMap<String, DoubtTally> {
        let tally = |place: &Place| {
            let (times, time_s) = self.doubts.tally(place.segment);
            (times > 0).then(|| (place.sensor.clone(), DoubtTally { times, time_s }))
        };
        self.worn.iter().filter_map(tally).collect()
    }
}
