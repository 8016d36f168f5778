//! A sequence that ends where it began and goes round for ever.

use crate::actionlet::{Sequence, State};
use crate::error::Error;

/// A closed, repeating sequence.
#[derive(Clone, Debug, PartialEq)]
pub struct Cycle(Sequence);

impl Cycle {
    /// Closes a sequence.
    ///
    /// # Errors
    /// If it is empty or does not end exactly at the angle it began with.
    pub fn closing(sequence: Sequence) -> Result<Self, Error> {
        if sequence.actionlets().is_empty() {
            return Err(Error::new("a cycle needs at least one actionlet"));
        }
        if sequence.from_rad() != sequence.to_rad() {
            return Err(Error::new("a cycle does not close")
                .got(format!("ends at {} rad", sequence.to_rad()))
                .allowed(format!("{} rad, where it began", sequence.from_rad())));
        }
        Ok(Self(sequence))
    }

    /// Time of one round, s.
    #[must_use]
    pub fn period_s(&self) -> f64 {
        self.0.duration_s()
    }

    /// One round.
    #[must_use]
    pub const fn sequence(&self) -> &Sequence {
        &self.0
    }

    /// State at any time; rounds follow one another before and after the given one.
    #[must_use]
    pub fn at(&self, time_s: f64) -> State {
        let phase_s = (time_s - self.0.begin_s()).rem_euclid(self.period_s());
        self.0.at(self.0.begin_s() + phase_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::actionlet::Shape;
    use proptest::prelude::*;

    fn round() -> Sequence {
        let start = Sequence::starting_at(0.25, 0.1).unwrap();
        let there = start.then(0.7, 0.9, Shape::half_sine(0.3).unwrap()).unwrap();
        there.rest(0.1).unwrap().then(0.4, 0.1, Shape::MinimumJerk).unwrap()
    }

    #[test]
    fn a_sequence_that_does_not_close_is_refused() {
        let open = Sequence::starting_at(0.0, 0.1).unwrap();
        assert!(Cycle::closing(open.clone()).is_err());
        assert!(Cycle::closing(open.then(1.0, 0.2, Shape::default()).unwrap()).is_err());
        assert!((Cycle::closing(round()).unwrap().period_s() - 1.2).abs() < 1e-12);
    }

    proptest! {
        #[test]
        fn every_round_is_the_same(time_s in 0.25..1.45, rounds in -50..50i32) {
            let cycle = Cycle::closing(round()).unwrap();
            let there = cycle.at(time_s + f64::from(rounds) * cycle.period_s());
            let here = cycle.sequence().at(time_s);
            prop_assert!((there.position_rad - here.position_rad).abs() < 1e-9);
            prop_assert!((there.velocity_rad_s - here.velocity_rad_s).abs() < 1e-9);
        }
    }
}
