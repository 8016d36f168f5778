//! One motion after another: angle and velocity continuous in every degree of freedom.

use crate::action::motion::{Motion, resting_until, then_until};
use crate::actionlet::{Sequence, Shape, decompose, shortest_duration_s};
use crate::body::Dof;
use crate::error::Error;
use crate::motion::JointLimits;
use crate::motion::ease;

/// Angles nearer than this need no transition, rad.
pub const SAME_ANGLE_RAD: f64 = 1e-6;
/// A person's unhurried transition: at most so fast ...
pub const TRANSITION_RAD_S: f64 = 3.0;
/// ... so sharply ...
pub const TRANSITION_RAD_S2: f64 = 15.0;
/// ... and not shorter than this, s.
pub const TRANSITION_MIN_S: f64 = 0.3;
/// What a blend may be off when it is cut into actionlets again, deg, root mean square.
const BLEND_TOLERANCE_DEG: f64 = 0.1;
/// Samples per second of a blend.
const BLEND_HZ: f64 = 240.0;

/// How two motions are joined where their angles differ.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Join {
    /// A transition actionlet in every degree of freedom between the two.
    #[default]
    Transition,
    /// The end of the first and the begin of the second overlap by so many seconds and are mixed,
    /// then cut into actionlets again: a mixture is not made of actionlets.
    Blend(f64),
}

impl Motion {
    /// This motion and then `next`. Where all angles match, a plain join.
    ///
    /// # Errors
    /// If a blend is longer than one of the two, or the result is too long.
    pub fn followed_by(self, next: Self, how: Join) -> Result<Self, Error> {
        let differ = |dof: &Dof| {
            let (end, start) = (self.track(*dof).to_rad(), next.track(*dof).from_rad());
            !((end - start).abs() <= SAME_ANGLE_RAD)
        };
        match how {
            _ if !Dof::ALL.iter().any(differ) => self.transition(next, 0.0),
            Join::Transition => {
                let duration_s = self.transition_s(&next)?;
                self.transition(next, duration_s)
            }
            Join::Blend(window_s) => self.blend(&next, window_s),
        }
    }

    /// How long the degree of freedom with the furthest way takes.
    fn transition_s(&self, next: &Self) -> Result<f64, Error> {
        let limits = JointLimits::new(-1e3, 1e3, TRANSITION_RAD_S, TRANSITION_RAD_S2)?;
        let of = |dof: Dof| {
            let distance_rad = next.track(dof).from_rad() - self.track(dof).to_rad();
            shortest_duration_s(&Shape::default(), distance_rad, &limits, None)
        };
        Ok(Dof::ALL.into_iter().map(of).fold(TRANSITION_MIN_S, f64::max))
    }

    fn transition(self, next: Self, duration_s: f64) -> Result<Self, Error> {
        let begin_s = self.duration_s() + duration_s;
        let mut flights_s = self.flights_s().to_vec();
        flights_s.extend(next.flights_s().iter().map(|(a, b)| (a + begin_s, b + begin_s)));
        let end_s = begin_s + next.duration_s();
        let pairs = self.into_tracks().into_iter().zip(next.into_tracks());
        let tracks = pairs.map(|(mut chain, next)| {
            if duration_s > 0.0 {
                chain = then_until(chain, begin_s, next.from_rad(), Shape::default())?;
            }
            let chain = appended(chain, &next, begin_s)?;
            resting_until(chain, end_s)
        });
        Self::new(tracks.collect::<Result<_, Error>>()?)?.in_flight(flights_s)
    }

    /// Mixes the last `window_s` of this with the first of `next`.
    fn blend(&self, next: &Self, window_s: f64) -> Result<Self, Error> {
        let longest_s = self.duration_s().min(next.duration_s());
        if !(window_s > 0.0 && window_s <= longest_s) {
            return Err(Error::new("a blend is longer than what it joins")
                .got(format!("{window_s} s"))
                .allowed(format!("above 0 to {longest_s} s")));
        }
        let begin_s = self.duration_s() - window_s;
        let tracks = Dof::ALL.map(|dof| {
            let blended = blended(self.track(dof), next.track(dof), begin_s, window_s);
            blended.map_err(|e| e.at(dof.name()))
        });
        let tracks = tracks.into_iter().collect::<Result<Vec<_>, _>>()?;
        let outside = |(from, to): &(f64, f64)| *to <= begin_s || *from >= begin_s + window_s;
        let later = next.flights_s().iter().map(|(from, to)| (from + begin_s, to + begin_s));
        let flights = self.flights_s().iter().copied().chain(later).filter(outside);
        Self::new(tracks)?.in_flight(flights.collect())
    }
}

/// Appends the actionlets of `next`, which begins at 0 s, from `begin_s` on.
fn appended(chain: Sequence, next: &Sequence, begin_s: f64) -> Result<Sequence, Error> {
    next.actionlets().iter().try_fold(chain, |chain, piece| {
        let end_s = begin_s + piece.end_s();
        // Equal angles join exactly, so that a rest stays one.
        let to_rad = if piece.is_rest() { chain.to_rad() } else { piece.to_rad() };
        then_until(chain, end_s, to_rad, piece.shape().clone())
    })
}

/// One degree of freedom: kept up to the seam before the window, mixed and cut into actionlets up
/// to the seam after it, and kept from there.
fn blended(
    first: &Sequence,
    next: &Sequence,
    begin_s: f64,
    window_s: f64,
) -> Result<Sequence, Error> {
    let kept = first.actionlets().iter().take_while(|piece| piece.end_s() <= begin_s).count();
    let left = next.actionlets().iter().take_while(|piece| piece.begin_s() < window_s).count();
    let start = Sequence::starting_at(0.0, first.from_rad())?;
    let head = first.actionlets()[..kept].iter().try_fold(start, |chain, piece| {
        chain.then(piece.duration_s(), piece.to_rad(), piece.shape().clone())
    })?;
    let from_s = head.end_s();
    let tail = &next.actionlets()[left..];
    let to_s = begin_s + tail.first().map_or(next.end_s(), |piece| piece.begin_s());
    let mixed = |time_s: f64| {
        let share = ease::step(((time_s - begin_s) / window_s).clamp(0.0, 1.0));
        let (old, new) = (first.at(time_s), next.at(time_s - begin_s));
        old.position_rad * (1.0 - share) + new.position_rad * share
    };
    let steps = ((to_s - from_s) * BLEND_HZ).ceil().max(2.0);
    let rate_hz = steps / (to_s - from_s);
    let samples: Vec<f64> =
        (0..=steps as usize).map(|step| mixed(from_s + step as f64 / rate_hz)).collect();
    let cut = decompose(&samples, rate_hz, BLEND_TOLERANCE_DEG.to_radians())?.chain;
    let mut chain = head;
    let last = cut.actionlets().len().saturating_sub(1);
    for (index, piece) in cut.actionlets().iter().enumerate() {
        // The end meets what follows exactly.
        let to_rad =
            if index == last { next.at(to_s - begin_s).position_rad } else { piece.to_rad() };
        chain = then_until(chain, from_s + piece.end_s(), to_rad, piece.shape().clone())?;
    }
    tail.iter().try_fold(chain, |chain, piece| {
        then_until(chain, begin_s + piece.end_s(), piece.to_rad(), piece.shape().clone())
    })
}
