//! What the feet of a body do while it performs a motion, and whether they hold: they stand still, above the
//! floor, and the root is not jerked.

use core::ops::Range;
use glam::DVec3;

use crate::action::Motion;
use crate::body::contact::{ON_FLOOR_M, lowest_m, places_m, worst_slide_m};
use crate::body::{Proportions, SegmentPose, root};
use crate::error::Error;

/// A sole that stands sinks into the floor by less, m.
const SINKS_M: f64 = 0.001;
/// While it is on the floor, a sole that stands slides by less, m.
const SLIDES_M: f64 = 0.005;
/// The root of a body that stands is accelerated by less, m/s^2 ...
const ROOT_M_S2: f64 = 18.0;
/// ... and by less than this if it flies, and so lands.
const LANDING_ROOT_M_S2: f64 = 40.0;
/// Feet that end no further from where they began have come back, m.
pub(super) const CAME_BACK_M: f64 = 0.02;
/// An action that slides by more does not stand on its feet: its variations are not held to it, m.
const MOST_SLIDES_M: f64 = 0.008;
/// So much worse than the action itself its variations may be.
const WORSE: f64 = 1.25;
/// What is told of a sole between two looks is off by less, m: so that what holds here holds however often
/// others look. Where soles go between looks is a cubic; a fourth derivative of 3e5 m/s^4 (a foot that swings
/// by 0.3 m at 5 Hz) makes it wrong by 2 micrometres, and the eighth of a look at which extremes are found
/// (0.5 ms, at 100 m/s^2) by 3.
const TOLD_M: f64 = 0.000_01;

/// How still feet stand and how hard they land at most.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FootingBounds {
    slides_m: f64,
    root_m_s2: f64,
    /// Infinite if the feet are not to come back.
    away_m: f64,
}

impl Default for FootingBounds {
    fn default() -> Self {
        Self { slides_m: SLIDES_M, root_m_s2: ROOT_M_S2, away_m: f64::INFINITY }
    }
}

/// A bound, and by how much a motion misses it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Missed {
    /// What is bounded, with its unit: `sinks_m`, `slides_m`, `root_acceleration_m_s2`, `away_m`.
    pub what: &'static str,
    /// What it is.
    pub got: f64,
    /// What it is to stay below.
    pub most: f64,
}

impl Missed {
    /// What it is, for a person.
    pub(super) fn told(&self) -> String {
        format!("{}: {:.4}", self.what, self.got)
    }

    /// What is allowed, for a person.
    pub(super) fn allowed(&self) -> String {
        format!("below {:.4}", self.most)
    }
}

impl FootingBounds {
    /// Whether feet hold is looked at so often; the acceleration of the root is that over 4 ms.
    pub(super) const JUDGED_HZ: f64 = 250.0;

    /// For variations of a motion, and for other bodies: they may be a quarter worse than it is itself, where it
    /// is outside the usual bounds, and feet come back that come back in it. None if its feet do not hold well enough to be held on to.
    ///
    /// # Errors
    /// As [`Motion::poses`].
    pub fn of(motion: &Motion, body: &Proportions) -> Result<Option<Self>, Error> {
        let seen = Feet::of(body, &motion.poses(body, FootingBounds::JUDGED_HZ)?);
        let usual = Self::default();
        let slides_m = worst_slide_m(&seen.soles_m);
        let root_m_s2 = seen.root_m_s2();
        let worse = |own: f64, usual: f64| if own < usual { usual } else { WORSE * own };
        let bounds = Self {
            slides_m: worse(slides_m, usual.slides_m),
            root_m_s2: worse(root_m_s2, usual.root_m_s2),
            away_m: if seen.come_back() { CAME_BACK_M } else { f64::INFINITY },
        };
        let holds = slides_m < MOST_SLIDES_M && root_m_s2 < LANDING_ROOT_M_S2;
        Ok((holds && seen.share(&bounds) < 1.0).then_some(bounds))
    }

    /// Whether a motion stays inside, and no sole sinks into the floor by 1 mm.
    ///
    /// # Errors
    /// As [`Motion::poses`].
    pub fn hold(&self, motion: &Motion, body: &Proportions) -> Result<bool, Error> {
        Ok(self.share(motion, body)? < 1.0)
    }

    /// The part of what it may do that a motion does: above 1 if it does not stay inside.
    ///
    /// # Errors
    /// As [`Motion::poses`].
    pub fn share(&self, motion: &Motion, body: &Proportions) -> Result<f64, Error> {
        Ok(Feet::of(body, &motion.poses(body, FootingBounds::JUDGED_HZ)?).share(self))
    }

    /// Those that hold for either.
    pub(super) fn or(&self, other: &Self) -> Self {
        Self {
            slides_m: self.slides_m.max(other.slides_m),
            root_m_s2: self.root_m_s2.max(other.root_m_s2),
            away_m: self.away_m.max(other.away_m),
        }
    }

    /// The same wherever feet end.
    #[must_use]
    pub(super) const fn wherever(self) -> Self {
        Self { away_m: f64::INFINITY, ..self }
    }

    /// What slides are to stay below, m.
    pub(super) const fn slides_m(&self) -> f64 {
        self.slides_m
    }

    /// What the root's acceleration is to stay below.
    pub(super) fn root_m_s2(&self, flies: bool) -> f64 {
        if flies { LANDING_ROOT_M_S2 } else { self.root_m_s2 }
    }

    /// Whether so far a slide takes up a part of what is allowed.
    pub(super) fn is_nearly_slid(&self, slides_m: f64, part: f64) -> bool {
        slides_m > part * self.slides_m
    }

    /// Whether so great an acceleration of the root takes up a part of what is allowed.
    pub(super) fn is_nearly_jerked(&self, root_m_s2: f64, flies: bool, part: f64) -> bool {
        root_m_s2 > part * self.root_m_s2(flies)
    }

    /// What a motion misses.
    ///
    /// # Errors
    /// As [`Motion::poses`].
    pub fn missed(&self, motion: &Motion, body: &Proportions) -> Result<Vec<Missed>, Error> {
        let figures = Feet::of(body, &motion.poses(body, FootingBounds::JUDGED_HZ)?).figures(self);
        Ok(figures.into_iter().filter(|figure| !(figure.got < figure.most)).collect())
    }
}

/// Soles and root by pose.
#[derive(Clone, Debug)]
pub(super) struct Feet {
    pub(super) soles_m: Vec<[DVec3; 4]>,
    pub(super) roots_m: Vec<DVec3>,
}

impl Feet {
    pub(super) fn of(body: &Proportions, poses: &[SegmentPose]) -> Self {
        Self {
            soles_m: poses.iter().map(|pose| places_m(body, pose)).collect(),
            roots_m: poses.iter().map(|pose| pose.root_m).collect(),
        }
    }

    /// What is bounded.
    fn figures(&self, bounds: &FootingBounds) -> [Missed; 4] {
        let most_m_s2 = if self.fly() { LANDING_ROOT_M_S2 } else { bounds.root_m_s2 };
        let sinks_m = TOLD_M - lowest_m(&self.soles_m);
        let slides_m = TOLD_M + worst_slide_m(&self.soles_m);
        let root_m_s2 = self.root_m_s2();
        [
            Missed { what: "sinks_m", got: sinks_m, most: SINKS_M },
            Missed { what: "slides_m", got: slides_m, most: bounds.slides_m },
            Missed { what: "root_acceleration_m_s2", got: root_m_s2, most: most_m_s2 },
            Missed { what: "away_m", got: self.away_m().length(), most: bounds.away_m },
        ]
    }

    fn share(&self, bounds: &FootingBounds) -> f64 {
        self.figures(bounds).iter().map(|figure| figure.got / figure.most).fold(0.0, f64::max)
    }

    /// Whether no sole is on the floor at some time.
    pub(super) fn fly(&self) -> bool {
        self.soles_m.iter().any(|soles_m| soles_m.iter().all(|m| m.z >= ON_FLOOR_M))
    }

    /// Greatest acceleration of the root, over 4 ms.
    pub(super) fn root_m_s2(&self) -> f64 {
        self.bends_m()
            .map(|bend_m| bend_m.length() * FootingBounds::JUDGED_HZ * FootingBounds::JUDGED_HZ)
            .fold(0.0, f64::max)
    }

    pub(super) fn bends_m(&self) -> impl Iterator<Item = DVec3> {
        self.roots_m.windows(3).map(|three| three[0] - 2.0 * three[1] + three[2])
    }

    /// How far the middle of the soles is in the end from where it was, over the floor, m.
    pub(super) fn away_m(&self) -> DVec3 {
        let middle = |soles_m: &[DVec3; 4]| soles_m.iter().sum::<DVec3>() / 4.0;
        let (Some(first), Some(last)) = (self.soles_m.first(), self.soles_m.last()) else {
            return DVec3::ZERO;
        };
        (middle(last) - middle(first)).with_z(0.0)
    }

    /// Whether feet end about where they began.
    pub(super) fn come_back(&self) -> bool {
        self.away_m().length() < CAME_BACK_M
    }

    /// Which of the soles are on the floor, from when to when.
    pub(super) fn contacts(&self) -> Vec<(usize, Range<usize>)> {
        self.lower_than(ON_FLOOR_M)
    }

    /// Which of the soles are lower than this, m, from when to when.
    pub(super) fn lower_than(&self, height_m: f64) -> Vec<(usize, Range<usize>)> {
        let mut contacts = Vec::new();
        for sole in 0..root::SOLES.len() {
            let carries = |soles_m: &[DVec3; 4]| soles_m[sole].z < height_m;
            let mut at = 0;
            for same in self.soles_m.chunk_by(|a, b| carries(a) == carries(b)) {
                if carries(&same[0]) {
                    contacts.push((sole, at..at + same.len()));
                }
                at += same.len();
            }
        }
        contacts
    }
}
