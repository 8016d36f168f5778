//! Two actions at once: legs as one has them, and above the pelvis what the other moves.

use crate::action::Motion;
use crate::actionlet::Sequence;
use crate::body::Dof;
use crate::error::Error;

/// A motion, and when it begins, s.
pub type Begun<'a> = (&'a Motion, f64);

/// One motion of two. Legs, and where they carry the body, are the first's, and so is what `is_others` leaves to it; the
/// rest is the other's. Whoever is done rests.
///
/// # Errors
/// A begin that is negative or not finite.
pub fn at_once(
    (first, first_s): Begun<'_>,
    (other, other_s): Begun<'_>,
    is_others: impl Fn(Dof) -> bool,
) -> Result<Motion, Error> {
    let track = |dof: Dof| {
        if !dof.is_of_leg() && is_others(dof) {
            later(other.track(dof), other_s)
        } else {
            later(first.track(dof), first_s)
        }
    };
    let tracks = Dof::ALL.into_iter().map(track).collect::<Result<_, _>>()?;
    let flights_s = first.flights_s().iter();
    let flights_s = flights_s.map(|(from_s, to_s)| (from_s + first_s, to_s + first_s));
    Motion::new(tracks)?.in_flight(flights_s.collect())
}

/// The chain as it is, so much later; it rests until then.
fn later(chain: &Sequence, by_s: f64) -> Result<Sequence, Error> {
    let start = Sequence::starting_at(chain.begin_s(), chain.from_rad())?;
    let start = if by_s == 0.0 { start } else { start.rest(by_s)? };
    chain.actionlets().iter().try_fold(start, |out, piece| {
        out.then(piece.duration_s(), piece.to_rad(), piece.shape().clone())
    })
}

/// Whether a motion moves a degree of freedom.
#[must_use]
pub fn moves(motion: &Motion, dof: Dof) -> bool {
    motion.track(dof).actionlets().iter().any(|piece| !piece.is_rest())
}
