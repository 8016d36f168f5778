//! Cutting a piece out of one chain and pasting it into another (Zheng et al. 2007, Tables 1, 2).
//!
//! The tables fix times and velocity functions. A velocity function keeps its shape and its peak,
//! so the angle an actionlet covers grows and shrinks with its duration; what follows the insert
//! moves on in time and in angle. That is ours: the paper does not say.

use crate::actionlet::{Actionlet, Sequence};
use crate::error::Error;

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

/// Pastes a piece of `source` into `target`: `ta1' = [t_ta1, t_target + (t_sa2 - t_begin)]` with
/// the velocity function of ta1, `ta2' = [that, t_ta2 + (t_end - t_begin)]` with that of sa2.
/// Actionlets wholly inside the piece come between, shifted by `t_target - t_begin`, unchanged in
/// duration and in angle covered. The actionlet of the target is retimed from its own start: an
/// insert has to be decided before that begins to play.
///
/// It works on one degree of freedom; those of a body reach rest at different times, so that there
/// is no one cut for all of them. A nod in the middle of a bow:
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
    let (pieces, targets) = (source.actionlets(), target.actionlets());
    let (opened, closing) = (&targets[into], &pieces[last]);
    let shift_s = cut.target_s - cut.begin_s;
    let mut out = Sequence::starting_at(target.begin_s(), target.from_rad())?;
    for before in &targets[..into] {
        out = out.then(before.duration_s(), before.to_rad(), before.shape().clone())?;
    }
    out = stretched_until(out, opened, pieces[first].end_s() + shift_s)?;
    for inner in &pieces[first + 1..last] {
        let to_rad = out.to_rad() + inner.change_rad();
        out = out.then(inner.duration_s(), to_rad, inner.shape().clone())?;
    }
    let end_s = opened.end_s() + (cut.end_s - cut.begin_s);
    if cut.keep_end {
        let change_rad = opened.to_rad() - out.to_rad();
        if !(change_rad * closing.change_rad() > 0.0) {
            return Err(Error::new("keeping the end angle would turn the last actionlet around")
                .got(format!("{change_rad} rad left to cover"))
                .allowed(format!("the direction of {} rad", closing.change_rad()))
                .remedy("insert without keeping the end"));
        }
        let duration_s = end_s - out.end_s();
        out = out.then(duration_s, opened.to_rad(), closing.shape().clone())?;
    } else {
        out = stretched_until(out, closing, end_s)?;
    }
    let moved_rad = out.to_rad() - opened.to_rad();
    for after in &targets[into + 1..] {
        out = out.then(after.duration_s(), after.to_rad() + moved_rad, after.shape().clone())?;
    }
    Ok(out)
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
