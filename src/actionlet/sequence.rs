//! A chain of actionlets of one degree of freedom.

use crate::actionlet::{Actionlet, Shape, State};
use crate::error::Error;

/// Most actionlets in a chain.
pub const MAX_LENGTH: usize = 1_000_000;

/// Actionlets of one degree of freedom, each beginning when and where the one before ends: angle
/// and velocity are continuous by construction.
#[derive(Clone, Debug, PartialEq)]
pub struct Sequence {
    begin_s: f64,
    from_rad: f64,
    actionlets: Vec<Actionlet>,
}

impl Sequence {
    /// An empty chain: at rest at `angle_rad` from `begin_s` on.
    ///
    /// # Errors
    /// If a number is not finite.
    pub fn starting_at(begin_s: f64, angle_rad: f64) -> Result<Self, Error> {
        if !(begin_s.is_finite() && angle_rad.is_finite()) {
            return Err(Error::new("the start of a sequence is not finite")
                .got(format!("{angle_rad} rad at {begin_s} s")));
        }
        Ok(Self { begin_s, from_rad: angle_rad, actionlets: Vec::new() })
    }

    /// Appends an actionlet to `to_rad`.
    ///
    /// # Errors
    /// If the target is not finite, the duration is not above zero, or the chain is full.
    pub fn then(mut self, duration_s: f64, to_rad: f64, shape: Shape) -> Result<Self, Error> {
        if self.actionlets.len() >= MAX_LENGTH {
            return Err(
                Error::new("a sequence is too long").allowed(format!("{MAX_LENGTH} actionlets"))
            );
        }
        let (begin_s, from_rad) = (self.end_s(), self.to_rad());
        self.actionlets.push(Actionlet::new(begin_s, duration_s, from_rad, to_rad, shape)?);
        Ok(self)
    }

    /// Appends a rest.
    ///
    /// # Errors
    /// As [`Self::then`].
    pub fn rest(self, duration_s: f64) -> Result<Self, Error> {
        let angle_rad = self.to_rad();
        self.then(duration_s, angle_rad, Shape::default())
    }

    /// The actionlets in order of time.
    #[must_use]
    pub fn actionlets(&self) -> &[Actionlet] {
        &self.actionlets
    }

    /// When the chain begins, s.
    #[must_use]
    pub const fn begin_s(&self) -> f64 {
        self.begin_s
    }

    /// When the chain ends, s.
    #[must_use]
    pub fn end_s(&self) -> f64 {
        self.actionlets.last().map_or(self.begin_s, Actionlet::end_s)
    }

    /// How long the chain lasts, s.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.end_s() - self.begin_s
    }

    /// Angle at the begin, rad.
    #[must_use]
    pub const fn from_rad(&self) -> f64 {
        self.from_rad
    }

    /// Angle at the end, rad.
    #[must_use]
    pub fn to_rad(&self) -> f64 {
        self.actionlets.last().map_or(self.from_rad, Actionlet::to_rad)
    }

    /// State at `time_s`; at rest before the begin and after the end.
    #[must_use]
    pub fn at(&self, time_s: f64) -> State {
        let next = self.actionlets.partition_point(|actionlet| actionlet.begin_s() <= time_s);
        match next.checked_sub(1) {
            Some(index) => self.actionlets[index].at(time_s),
            None => State::at_rest(self.from_rad),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn an_empty_sequence_rests() {
        let empty = Sequence::starting_at(2.0, 0.3).unwrap();
        for time_s in [-9.0, 2.0, 9.0, f64::NAN] {
            assert_eq!(empty.at(time_s), State::at_rest(0.3));
        }
        assert_eq!(empty.duration_s(), 0.0);
    }

    #[test]
    fn unusable_numbers_are_refused() {
        assert!(Sequence::starting_at(f64::NAN, 0.0).is_err());
        assert!(Sequence::starting_at(0.0, f64::INFINITY).is_err());
        let start = || Sequence::starting_at(0.0, 0.0).unwrap();
        assert!(start().then(0.0, 1.0, Shape::default()).is_err());
        assert!(start().then(-1.0, 1.0, Shape::default()).is_err());
        assert!(start().then(1.0, f64::NAN, Shape::default()).is_err());
        assert!(start().rest(f64::INFINITY).is_err());
    }

    fn sequences() -> impl Strategy<Value = Sequence> {
        let step = (0.05..2.0, -2.0..2.0, 0.1..0.9, 0..4);
        (prop::collection::vec(step, 1..12), -1.0..1.0).prop_map(|(steps, from)| {
            steps.into_iter().fold(Sequence::starting_at(0.5, from).unwrap(), |chain, step| {
                let (duration, to, t, kind) = step;
                match kind {
                    0 => chain.rest(duration),
                    1 => chain.then(duration, to, Shape::MinimumJerk),
                    _ => chain.then(duration, to, Shape::half_sine(t).unwrap()),
                }
                .unwrap()
            })
        })
    }

    proptest! {
        #[test]
        fn angle_and_velocity_are_continuous_at_every_seam(chain in sequences()) {
            for pair in chain.actionlets().windows(2) {
                let (before, after) = (pair[0].at(pair[0].end_s()), pair[1].at(pair[1].begin_s()));
                prop_assert_eq!(before.position_rad, after.position_rad);
                prop_assert_eq!((before.velocity_rad_s, after.velocity_rad_s), (0.0, 0.0));
                let near = 1e-7;
                let seam_s = pair[1].begin_s();
                let around = [chain.at(seam_s - near), chain.at(seam_s + near)];
                for state in around {
                    prop_assert!((state.position_rad - after.position_rad).abs() < 1e-9);
                    prop_assert!(state.velocity_rad_s.abs() < 1e-5);
                }
            }
        }

        #[test]
        fn the_chain_reaches_each_angle_at_its_time(chain in sequences()) {
            for actionlet in chain.actionlets() {
                let at = |time_s| chain.at(time_s).position_rad;
                prop_assert!((at(actionlet.begin_s()) - actionlet.from_rad()).abs() < 1e-12);
                prop_assert!((at(actionlet.end_s()) - actionlet.to_rad()).abs() < 1e-12);
            }
            prop_assert_eq!(chain.at(1e9), State::at_rest(chain.to_rad()));
            prop_assert_eq!(chain.at(-1e9), State::at_rest(chain.from_rad()));
        }
    }
}
