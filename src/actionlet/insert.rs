//! Cutting a piece out of one chain and pasting it into another (Zheng et al. 2007, Tables 1, 2).
//!
//! The tables fix times and velocity functions. A velocity function keeps its shape and its peak,
//! so the angle an actionlet covers grows and shrinks with its duration; what follows the insert
//! moves on in time and in angle. That is ours: the paper does not say. [`insert()`] is the letter of
//! the tables, [`paste`] adds what they leave open: cuts that begin or end at an instant of rest, and
//! targets that rest.

use crate::actionlet::{Actionlet, Sequence};
use crate::error::Error;

/// Instants nearer than this are one, s: times are told to people to so many decimals, and come back
/// as they were told.
pub const AS_TOLD_S: f64 = 1e-6;
/// An actionlet pasted into a time no further from its own duration than this, s, is pasted as it is.
const AS_IT_IS_S: f64 = 2.5 * AS_TOLD_S;
/// Angles nearer than this are one, rad.
const SAME_ANGLE_RAD: f64 = 1e-9;

/// A piece of time of the source and the moment of the target it is pasted at, s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cut {
    /// Where the piece begins: inside an actionlet of the source.
    pub begin_s: f64,
    /// Where the piece ends: inside a later actionlet of the source.
    pub end_s: f64,
    /// Where it goes: inside an actionlet of the target.
    pub target_s: f64,
    /// Ends the inserted piece at the angle at which the target's actionlet ended, so that what
    /// follows keeps its angles.
    pub keep_end: bool,
}

impl Cut {
    /// How long the piece is, s: by so much the target becomes longer.
    #[must_use]
    pub fn length_s(&self) -> f64 {
        self.end_s - self.begin_s
    }
}

/// A chain with a piece of another one in it, and what went where.
#[derive(Clone, Debug, PartialEq)]
pub struct Pasted {
    /// The chain.
    pub chain: Sequence,
    /// The first seam of the source in the cut, s of the source (`t_sa2`): the actionlets that begin
    /// there and later are pasted.
    pub seam_s: f64,
    /// Up to here, s of the source, they are pasted as they are; the last one may last longer or
    /// shorter.
    pub as_is_to_s: f64,
    /// Where the first of them begins, s of the chain (`t'_ta2`).
    pub from_s: f64,
    /// Where the last one ends, s of the chain (`t'_ta3`).
    pub to_s: f64,
    /// What is added to every angle after it, rad.
    pub moved_rad: f64,
}

/// Pastes a piece of `source` into `target`: `ta1' = [t_ta1, t_target + (t_sa2 - t_begin)]` with
/// the velocity function of ta1, `ta2' = [that, t_ta2 + (t_end - t_begin)]` with that of sa2.
/// Actionlets wholly inside the piece come between, shifted by `t_target - t_begin`, unchanged in
/// duration and in angle covered. The actionlet of the target is retimed from its own start: an
/// insert has to be decided before that begins to play.
///
/// It works on one degree of freedom;
/// [`Motion::with_inserted`](crate::action::Motion::with_inserted) on all that a piece moves. A nod in
/// the middle of a bow:
///
/// ```
/// use gaitway::action::{Motion, vocabulary};
/// use gaitway::actionlet::{Cut, Sequence, Shape, insert};
/// use gaitway::body::Dof;
///
/// let nod = Sequence::starting_at(0.0, 0.0)?;
/// let nod = nod.then(0.3, 0.35, Shape::half_sine(0.5)?)?;
/// let nod = nod.then(0.3, 0.0, Shape::half_sine(0.4)?)?;
/// let bow = vocabulary::find("bow")?.perform()?;
/// let neck = bow.track(Dof::NeckFlexion);
/// let moving = neck.actionlets().iter().find(|piece| !piece.is_rest()).unwrap();
/// let target_s = moving.begin_s() + moving.duration_s() / 2.0;
/// let cut = Cut { begin_s: 0.1, end_s: 0.5, target_s, keep_end: false };
///
/// let mut tracks = bow.clone().into_tracks();
/// tracks[Dof::NeckFlexion.index()] = insert(&nod, neck, cut)?;
/// let nodding = Motion::new(tracks)?;
/// assert!((nodding.duration_s() - bow.duration_s() - 0.4).abs() < 1e-9);
/// # Ok::<(), gaitway::error::Error>(())
/// ```
///
/// # Errors
/// If a time does not lie strictly inside an actionlet, begin and end lie in the same one, or
/// keeping the end would turn the direction of the last actionlet.
pub fn insert(source: &Sequence, target: &Sequence, cut: Cut) -> Result<Sequence, Error> {
    let first = around(source, cut.begin_s, "the begin of the cut")?;
    let last = around(source, cut.end_s, "the end of the cut")?;
    let into = around(target, cut.target_s, "the place to insert at")?;
    if first >= last {
        return Err(Error::new("a cut must begin in one actionlet and end in a later one")
            .got(format!("{} to {} s", cut.begin_s, cut.end_s))
            .allowed("begin and end on two sides of an instant of rest"));
    }
    let pieces = source.actionlets();
    let piece = Piece {
        seam_s: pieces[first].end_s(),
        inner: &pieces[first + 1..last],
        closing: &pieces[last],
    };
    Ok(into_moving(target, into, &piece, cut)?.chain)
}

/// Pastes a piece of `source` into `target` as [`insert()`], and where somebody rests at one of the
/// three times, which the tables leave open:
///
/// - A cut that begins at a seam takes the actionlet that begins there, one that ends at a seam the
///   actionlet that ends there, both whole.
/// - A target that rests at `target_s`, for some time or for an instant, has no actionlet to retime:
///   it rests on until the first seam of the cut, the piece comes, ends after `t_end - t_begin`, and
///   the target goes on from where it was.
///
/// # Errors
/// If the cut holds no seam after which something could be pasted, a time is not finite or not inside
/// its chain, or keeping the end would turn the direction of the last actionlet.
pub fn paste(source: &Sequence, target: &Sequence, cut: Cut) -> Result<Pasted, Error> {
    let inside = |chain: &Sequence, time_s: f64| {
        (chain.begin_s() - AS_TOLD_S..=chain.end_s() + AS_TOLD_S).contains(&time_s)
    };
    let in_source = inside(source, cut.begin_s) && inside(source, cut.end_s);
    if !(in_source && inside(target, cut.target_s)) {
        let span = |chain: &Sequence| format!("{} to {} s", chain.begin_s(), chain.end_s());
        return Err(Error::new("a cut, or the place to insert at, is outside its sequence")
            .got(format!("{} to {} s at {} s", cut.begin_s, cut.end_s, cut.target_s))
            .allowed(format!("{}, at {}", span(source), span(target))));
    }
    let Some(piece) = Piece::of(source, &cut) else {
        return Err(Error::new("a cut holds no instant of rest")
            .got(format!("{} to {} s", cut.begin_s, cut.end_s))
            .allowed("an instant of rest inside it, or where it begins"));
    };
    let at = going_on(target, cut.target_s);
    match target.actionlets().get(at) {
        Some(opened) if moves_at(opened, cut.target_s) => into_moving(target, at, &piece, cut),
        _ => into_rest(target, at, &piece, cut),
    }
}

/// The first seam of the source inside a cut, or where it begins, after which there is something to
/// paste; s.
#[must_use]
pub fn seam_in(source: &Sequence, cut: &Cut) -> Option<f64> {
    Piece::of(source, cut).map(|piece| piece.seam_s)
}

/// The target as it is, `length_s` later from `target_s` on: the actionlet that is going on then
/// lasts so much longer; what rests then rests so much longer.
///
/// # Errors
/// If a number is not finite, or the length is not above zero.
pub fn delayed(target: &Sequence, target_s: f64, length_s: f64) -> Result<Sequence, Error> {
    let (targets, at) = (target.actionlets(), going_on(target, target_s));
    let mut out = copied(target, at)?;
    let held = targets.get(at).filter(|piece| piece.begin_s() < target_s - AS_TOLD_S);
    out = match held {
        Some(held) => {
            out.then(held.duration_s() + length_s, held.to_rad(), held.shape().clone())?
        }
        None => out.rest(length_s)?,
    };
    followed(out, &targets[at + usize::from(held.is_some())..], 0.0)
}

/// True if the target's actionlet is in motion at an instant that is not after its end.
fn moves_at(actionlet: &Actionlet, time_s: f64) -> bool {
    !actionlet.is_rest() && actionlet.begin_s() < time_s - AS_TOLD_S
}

/// Index of the actionlet that ends after `time_s`; of none, one past the last.
fn going_on(chain: &Sequence, time_s: f64) -> usize {
    let before = |piece: &&Actionlet| piece.end_s() - AS_TOLD_S <= time_s;
    chain.actionlets().iter().take_while(before).count()
}

/// The actionlets of a source that begin in a cut.
struct Piece<'a> {
    /// Where the first begins, s.
    seam_s: f64,
    /// Those that end before the cut does.
    inner: &'a [Actionlet],
    /// The one in which the cut ends.
    closing: &'a Actionlet,
}

impl<'a> Piece<'a> {
    fn of(source: &'a Sequence, cut: &Cut) -> Option<Self> {
        let pieces = source.actionlets();
        let first = pieces.iter().position(|piece| cut.begin_s - AS_TOLD_S <= piece.begin_s())?;
        let last = pieces.iter().position(|piece| cut.end_s <= piece.end_s() + AS_TOLD_S)?;
        (first <= last).then(|| Self {
            seam_s: pieces[first].begin_s(),
            inner: &pieces[first..last],
            closing: &pieces[last],
        })
    }
}

/// Tables 1, 2: actionlet number `into` of the target becomes ta1', the closing one of the piece ta2'.
fn into_moving(
    target: &Sequence,
    into: usize,
    piece: &Piece<'_>,
    cut: Cut,
) -> Result<Pasted, Error> {
    let targets = target.actionlets();
    let opened = &targets[into];
    let until_s = cut.target_s + (piece.seam_s - cut.begin_s);
    let out = stretched_until(copied(target, into)?, opened, until_s)?;
    let from_s = out.end_s();
    let end_s = opened.end_s() + cut.length_s();
    let (out, as_is_to_s) = closed(out, piece, &cut, end_s, opened.to_rad())?;
    let (to_s, moved_rad) = (out.end_s(), out.to_rad() - opened.to_rad());
    let chain = followed(out, &targets[into + 1..], moved_rad)?;
    Ok(Pasted { chain, seam_s: piece.seam_s, as_is_to_s, from_s, to_s, moved_rad })
}

/// The target rests: the piece comes between the actionlets before and those from `at` on.
fn into_rest(target: &Sequence, at: usize, piece: &Piece<'_>, cut: Cut) -> Result<Pasted, Error> {
    let targets = target.actionlets();
    let mut out = copied(target, at)?;
    let split = targets.get(at).filter(|rest| rest.begin_s() < cut.target_s - AS_TOLD_S);
    if split.is_some() {
        let before_s = cut.target_s - out.end_s();
        out = out.rest(before_s)?;
    }
    let (since_s, rests_rad) = (out.end_s(), out.to_rad());
    let until_seam_s = piece.seam_s - cut.begin_s;
    if until_seam_s > AS_TOLD_S {
        out = out.rest(until_seam_s)?;
    }
    let from_s = out.end_s();
    let (mut out, as_is_to_s) = closed(out, piece, &cut, since_s + cut.length_s(), rests_rad)?;
    let (to_s, moved_rad) = (out.end_s(), out.to_rad() - rests_rad);
    if let Some(rest) = split {
        out = out.rest(rest.end_s() - cut.target_s)?;
    }
    let chain = followed(out, &targets[at + usize::from(split.is_some())..], moved_rad)?;
    Ok(Pasted { chain, seam_s: piece.seam_s, as_is_to_s, from_s, to_s, moved_rad })
}

/// The first `count` actionlets.
fn copied(chain: &Sequence, count: usize) -> Result<Sequence, Error> {
    let start = Sequence::starting_at(chain.begin_s(), chain.from_rad())?;
    chain.actionlets()[..count].iter().try_fold(start, |out, before| {
        out.then(before.duration_s(), before.to_rad(), before.shape().clone())
    })
}

/// Appends a piece whose last actionlet ends at `end_s`, with `keep_end` at `kept_rad`; also up to
/// where, s of the source, it is as it was.
fn closed(
    mut out: Sequence,
    piece: &Piece<'_>,
    cut: &Cut,
    end_s: f64,
    kept_rad: f64,
) -> Result<(Sequence, f64), Error> {
    for inner in piece.inner {
        let to_rad = out.to_rad() + inner.change_rad();
        out = out.then(inner.duration_s(), to_rad, inner.shape().clone())?;
    }
    let closing = piece.closing;
    let duration_s = end_s - out.end_s();
    let is_as_is = (duration_s - closing.duration_s()).abs() <= AS_IT_IS_S;
    let left_rad = kept_rad - out.to_rad();
    let rests = closing.is_rest() && left_rad.abs() <= SAME_ANGLE_RAD;
    if cut.keep_end && !rests {
        if !(left_rad * closing.change_rad() > 0.0) {
            return Err(Error::new("keeping the end angle would turn the last actionlet around")
                .got(format!("{left_rad} rad left to cover"))
                .allowed(format!("the direction of {} rad", closing.change_rad()))
                .remedy("insert without keeping the end"));
        }
        let is_whole = is_as_is && (left_rad - closing.change_rad()).abs() <= SAME_ANGLE_RAD;
        out = out.then(duration_s, kept_rad, closing.shape().clone())?;
        return Ok((out, if is_whole { closing.end_s() } else { closing.begin_s() }));
    }
    out = if is_as_is {
        let to_rad = out.to_rad() + closing.change_rad();
        out.then(duration_s, to_rad, closing.shape().clone())?
    } else {
        stretched_until(out, closing, end_s)?
    };
    Ok((out, if is_as_is { closing.end_s() } else { closing.begin_s() }))
}

/// Appends what follows, every angle `moved_rad` further on.
fn followed(out: Sequence, after: &[Actionlet], moved_rad: f64) -> Result<Sequence, Error> {
    after.iter().try_fold(out, |out, next| {
        // A sum may be rounded: a rest stays one.
        let to_rad = if next.is_rest() { out.to_rad() } else { next.to_rad() + moved_rad };
        out.then(next.duration_s(), to_rad, next.shape().clone())
    })
}

/// Appends an actionlet that ends at `end_s`, with its velocity function and peak kept.
fn stretched_until(chain: Sequence, kept: &Actionlet, end_s: f64) -> Result<Sequence, Error> {
    let duration_s = end_s - chain.end_s();
    let to_rad = chain.to_rad() + kept.change_rad() * duration_s / kept.duration_s();
    chain.then(duration_s, to_rad, kept.shape().clone())
}

/// Index of the actionlet with `time_s` strictly inside.
fn around(chain: &Sequence, time_s: f64, what: &str) -> Result<usize, Error> {
    let inside = |piece: &Actionlet| piece.begin_s() < time_s && time_s < piece.end_s();
    chain.actionlets().iter().position(inside).ok_or_else(|| {
        Error::new(format!("{what} is not inside an actionlet")).got(format!("{time_s} s")).allowed(
            format!(
                "between two instants of rest, from {} to {} s",
                chain.begin_s(),
                chain.end_s()
            ),
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::actionlet::Shape;
    use proptest::prelude::*;

    fn half_sine(t: f64) -> Shape {
        Shape::half_sine(t).unwrap()
    }

    fn source() -> Sequence {
        let start = Sequence::starting_at(0.0, 0.0).unwrap();
        start.then(0.8, 0.6, half_sine(0.4)).unwrap().then(1.2, -0.3, half_sine(0.5)).unwrap()
    }

    fn target() -> Sequence {
        Sequence::starting_at(3.0, 0.2).unwrap().then(1.0, 1.0, half_sine(0.3)).unwrap()
    }

    const CUT: Cut = Cut { begin_s: 0.5, end_s: 1.4, target_s: 3.6, keep_end: false };

    fn same(got: f64, expected: f64) {
        assert!((got - expected).abs() <= 5.1e-10, "{got} is not {expected}");
    }

    /// Worked out by hand from Tables 1 and 2.
    #[test]
    fn times_and_velocity_functions_are_those_of_table_two() {
        let got = insert(&source(), &target(), CUT).unwrap();
        let [one, two] = got.actionlets() else { panic!("{got:?}") };
        same(one.begin_s(), 3.0);
        same(one.end_s(), 3.9);
        same(two.end_s(), 4.9);
        assert_eq!((one.shape(), two.shape()), (&half_sine(0.3), &half_sine(0.5)));
        same(one.to_rad(), 0.92);
        same(two.to_rad(), 0.17);
        same(got.at(3.6).position_rad, 0.839_979_593);
        same(got.at(3.6).velocity_rad_s, 0.740_215_925);
        same(got.at(4.4).position_rad, 0.545);
        same(got.at(4.4).velocity_rad_s, -1.5);
        same(got.at(4.65).position_rad, 0.238_133_793);
    }

    #[test]
    fn what_follows_moves_on_in_time_and_angle() {
        let target = target().then(0.5, 0.4, half_sine(0.6)).unwrap();
        let got = insert(&source(), &target, CUT).unwrap();
        let after = got.actionlets().last().unwrap();
        same(after.begin_s(), 4.9);
        same(after.duration_s(), 0.5);
        same(after.to_rad(), 0.4 - 0.83);
    }

    #[test]
    fn keeping_the_end_leaves_what_follows_at_its_angles_or_is_refused() {
        let cut = Cut { keep_end: true, ..CUT };
        // 0.92 to 1.0 is upwards, the last actionlet goes down.
        let error = insert(&source(), &target(), cut).unwrap_err();
        assert!(error.to_string().contains("turn the last actionlet around"), "{error}");
        let falling = Sequence::starting_at(3.0, 1.0).unwrap();
        let falling = falling.then(1.0, 0.2, half_sine(0.3)).unwrap();
        let got = insert(&source(), &falling, cut);
        same(got.unwrap().to_rad(), 0.2);
    }

    #[test]
    fn inner_actionlets_keep_duration_and_change() {
        let source = source().then(0.4, 0.1, half_sine(0.2)).unwrap();
        let got = insert(&source, &target(), Cut { end_s: 2.1, ..CUT }).unwrap();
        let [_, inner, last] = got.actionlets() else { panic!("{got:?}") };
        same(inner.begin_s(), 0.8 + 3.1);
        same(inner.end_s(), 2.0 + 3.1);
        same(inner.change_rad(), -0.9);
        same(last.end_s(), 4.0 + 1.6);
        same(last.peaks().velocity_rad_s, source.actionlets()[2].peaks().velocity_rad_s);
    }

    #[test]
    fn times_at_rest_are_refused() {
        for cut in [
            Cut { begin_s: 0.0, ..CUT },
            Cut { begin_s: 0.8, ..CUT },
            Cut { end_s: 2.0, ..CUT },
            Cut { end_s: 0.6, ..CUT },
            Cut { target_s: 3.0, ..CUT },
            Cut { target_s: f64::NAN, ..CUT },
        ] {
            assert!(insert(&source(), &target(), cut).is_err(), "{cut:?}");
        }
    }

    fn hold_and_back() -> Sequence {
        // At rest at 0, 1, 1.5 and 2.5 s.
        let start = Sequence::starting_at(0.0, 0.1).unwrap();
        let there = start.then(1.0, 0.7, half_sine(0.4)).unwrap();
        there.rest(0.5).unwrap().then(1.0, 0.1, half_sine(0.6)).unwrap()
    }

    /// What the tables say of a moving target, `paste` says too, and where it went.
    #[test]
    fn a_moving_target_is_pasted_into_as_the_tables_say() {
        let got = paste(&source(), &target(), CUT).unwrap();
        assert_eq!(got.chain, insert(&source(), &target(), CUT).unwrap());
        same(got.seam_s, 0.8);
        same(got.from_s, 3.9);
        same(got.to_s, 4.9);
        same(got.moved_rad, 0.17 - 1.0);
        same(got.as_is_to_s, 0.8);
    }

    #[test]
    fn a_whole_sequence_goes_into_a_rest_as_it_is() {
        let still = Sequence::starting_at(0.0, -0.2).unwrap().rest(6.0).unwrap();
        for keep_end in [false, true] {
            let cut = Cut { begin_s: 0.0, end_s: 2.5, target_s: 2.0, keep_end };
            let got = paste(&hold_and_back(), &still, cut).unwrap();
            same(got.chain.end_s(), 8.5);
            same(got.moved_rad, 0.0);
            assert_eq!((got.seam_s, got.as_is_to_s), (0.0, 2.5));
            for step in 0..=25 {
                let time_s = f64::from(step) / 10.0;
                let (now, then) = (got.chain.at(2.0 + time_s), hold_and_back().at(time_s));
                same(now.position_rad, then.position_rad - 0.3);
                same(now.velocity_rad_s, then.velocity_rad_s);
            }
            same(got.chain.at(1.9).position_rad, -0.2);
            same(got.chain.at(8.0).position_rad, -0.2);
        }
    }

    #[test]
    fn a_cut_takes_whole_what_begins_and_ends_at_its_ends() {
        let still = Sequence::starting_at(0.0, 0.0).unwrap().rest(2.0).unwrap();
        // From the first seam to the third: up and hold.
        let cut = Cut { begin_s: 0.0, end_s: 1.5, target_s: 2.0, keep_end: false };
        let got = paste(&hold_and_back(), &still, cut).unwrap();
        let durations: Vec<f64> =
            got.chain.actionlets().iter().map(Actionlet::duration_s).collect();
        assert_eq!(durations.len(), 3);
        same(durations[1], 1.0);
        same(durations[2], 0.5);
        same(got.moved_rad, 0.6);
        // Half a second before the first seam is half a second of rest; of the last actionlet a part
        // is pasted, at its own speed.
        let cut = Cut { begin_s: 0.5, end_s: 1.9, target_s: 0.7, keep_end: false };
        let got = paste(&hold_and_back(), &still, cut).unwrap();
        same(got.from_s, 0.7 + 0.5);
        same(got.to_s, 0.7 + 1.4);
        same(got.moved_rad, -0.6 * 0.4);
        same(got.chain.end_s(), 3.4);
    }

    /// An instant of rest in the middle of a movement is a place to paste at, and nothing of the
    /// target is retimed there.
    #[test]
    fn a_target_that_turns_is_pasted_into_between_its_actionlets() {
        let target = target().then(0.5, 0.4, half_sine(0.6)).unwrap();
        let cut = Cut { begin_s: 1.0, end_s: 2.5, target_s: 4.0, keep_end: false };
        let got = paste(&hold_and_back(), &target, cut).unwrap();
        let all = got.chain.actionlets();
        assert_eq!(all.len(), 4);
        assert_eq!(all[0], target.actionlets()[0]);
        assert!(all[1].is_rest());
        same(all[2].change_rad(), -0.6);
        same(all[3].begin_s(), 5.5);
        same(all[3].change_rad(), -0.6);
        assert_eq!(all[3].shape(), target.actionlets()[1].shape());
    }

    #[test]
    fn what_holds_no_seam_or_lies_outside_is_refused() {
        let go = |begin_s, end_s, target_s| {
            let cut = Cut { begin_s, end_s, target_s, keep_end: false };
            paste(&hold_and_back(), &target(), cut).map_err(|error| error.to_string())
        };
        assert!(go(0.2, 1.2, 3.5).is_ok());
        for (begin_s, end_s) in [(0.2, 0.8), (0.2, 1.0), (1.2, 0.2), (1.1, 1.4)] {
            assert!(go(begin_s, end_s, 3.5).unwrap_err().contains("no instant of rest"));
        }
        let nan = f64::NAN;
        for (begin_s, end_s, target_s) in [
            (nan, 1.2, 3.5),
            (0.2, nan, 3.5),
            (0.2, 1.2, nan),
            (-0.1, 1.2, 3.5),
            (0.2, 2.6, 3.5),
            (0.2, 1.2, 2.9),
            (0.2, 1.2, 4.1),
            (0.2, f64::INFINITY, 3.5),
        ] {
            assert!(go(begin_s, end_s, target_s).unwrap_err().contains("outside its sequence"));
        }
    }

    #[test]
    fn a_delay_lengthens_what_goes_on_and_nothing_else() {
        let chain = hold_and_back();
        for (target_s, lengthened) in [(0.4, 0), (1.2, 1), (1.5, 3), (2.0, 2), (2.5, 3)] {
            let got = delayed(&chain, target_s, 0.9).unwrap();
            same(got.end_s(), 3.4);
            same(got.to_rad(), 0.1);
            let longer = got.actionlets().iter().map(Actionlet::duration_s).collect::<Vec<_>>();
            match lengthened {
                3 => assert!(longer.len() == 4 && longer.contains(&0.9), "{longer:?}"),
                one => same(longer[one] - chain.actionlets()[one].duration_s(), 0.9),
            }
        }
    }

    proptest! {
        #[test]
        fn the_result_is_smooth_and_has_the_times_of_table_two(
            (d1, d2, d3) in (0.1..2.0, 0.1..2.0, 0.1..2.0),
            (a, b, c, d) in (-1.0..1.0, -1.0..1.0, -1.0..1.0, -1.0..1.0),
            (p1, p2, p3) in (0.01..0.99, 0.01..0.99, 0.01..0.99),
            (t1, t2, t3) in (0.1..0.9, 0.1..0.9, 0.1..0.9),
        ) {
            let start = Sequence::starting_at(0.7, a).unwrap();
            let source = start.then(d1, b, half_sine(t1)).unwrap();
            let source = source.then(d2, c, half_sine(t2)).unwrap();
            let target = Sequence::starting_at(5.0, c).unwrap().then(d3, d, half_sine(t3)).unwrap();
            let (sa2, ta1) = (0.7 + d1, 5.0);
            let cut = Cut {
                begin_s: 0.7 + d1 * p1,
                end_s: sa2 + d2 * p2,
                target_s: ta1 + d3 * p3,
                keep_end: false,
            };
            let got = insert(&source, &target, cut).unwrap();
            let [one, two] = got.actionlets() else { panic!("{got:?}") };
            let seam_s = cut.target_s + (sa2 - cut.begin_s);
            let end_s = ta1 + d3 + (cut.end_s - cut.begin_s);
            prop_assert_eq!(one.begin_s(), ta1);
            prop_assert!((one.end_s() - seam_s).abs() < 1e-12);
            prop_assert!((two.end_s() - end_s).abs() < 1e-12);
            prop_assert_eq!(one.to_rad(), two.from_rad());
            let peak = |piece: &Actionlet| piece.change_rad() / piece.duration_s();
            prop_assert!((peak(one) - peak(&target.actionlets()[0])).abs() < 1e-9);
            prop_assert!((peak(two) - peak(&source.actionlets()[1])).abs() < 1e-9);
        }
    }
}
