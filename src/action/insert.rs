//! A piece of one motion pasted into another: Tables 1 and 2 of Zheng et al. 2007 in every degree of
//! freedom that the piece moves.
//!
//! The tables say what happens to one chain of actionlets ([`paste`]). Joints come to rest at different
//! times, so that a cut of the whole body is another one in each degree of freedom: its first seam in the
//! cut is where its piece begins. The target becomes longer by the length of the cut. What the piece does
//! not move is the target's.

use crate::action::{Fits, Join, Motion, file, phrase};
use crate::actionlet::{Actionlet, Cut, Sequence, delayed, insert::AS_TOLD_S, paste, seam_in};
use crate::body::{Dof, Joint};
use crate::error::{Error, ErrorKind};
use std::fmt;
use std::str::FromStr;

/// Shortest cut, s.
pub const MIN_CUT_S: f64 = file::MIN_DURATION_S;
/// Angles may be so much out of their range, rad: what was rounded.
const ROUNDED_RAD: f64 = 1e-9;

/// What is done with a degree of freedom that the cut moves, but in which it holds no seam.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum NoSeam {
    /// The insert is refused, with the seams that are near.
    #[default]
    Refused,
    /// In this degree of freedom the cut is moved, as long as it is, to begin at the seam that is
    /// nearest to where it should.
    Moved,
}

/// What is done meanwhile by the degrees of freedom that the cut does not move.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Meanwhile {
    /// They go on as in the target, and are done by the length of the cut earlier than the others.
    #[default]
    GoesOn,
    /// What they are doing lasts longer by the length of the cut, so that all stay in step.
    Waits,
}

/// A piece of a motion and where it goes, as typed: `bow:0.5s..1.4s@3.6s`.
#[derive(Clone, Debug, PartialEq)]
pub struct Insert {
    source: String,
    cut_s: Option<(f64, f64)>,
    target_s: f64,
}

impl Insert {
    /// A piece of `source`, a phrase, from and to so many seconds of its own time, or all of it, to be
    /// pasted at `target_s`.
    ///
    /// # Errors
    /// If a time is not finite, below zero or beyond a day, or the piece is shorter than
    /// [`MIN_CUT_S`].
    pub fn new(source: &str, cut_s: Option<(f64, f64)>, target_s: f64) -> Result<Self, Error> {
        let usable = |time_s: f64| (0.0..=file::MAX_DURATION_S).contains(&time_s);
        let (from_s, to_s) = cut_s.unwrap_or((0.0, MIN_CUT_S));
        if let Some(wrong_s) = [from_s, to_s, target_s].into_iter().find(|time_s| !usable(*time_s))
        {
            return Err(Error::of(ErrorKind::OutsideLimits, "a time of an insert is not usable")
                .got(format!("{wrong_s} s"))
                .allowed(format!("0 to {} s", file::MAX_DURATION_S)));
        }
        if !(to_s - from_s >= MIN_CUT_S - AS_TOLD_S) {
            return Err(Error::new("a cut ends before it begins, or at once")
                .got(format!("{from_s} to {to_s} s"))
                .allowed(format!("the end at least {MIN_CUT_S} s after the begin")));
        }
        if source.is_empty() {
            return Err(Error::new("an insert names no action"));
        }
        Ok(Self { source: source.to_owned(), cut_s, target_s })
    }

    /// What the piece is cut out of: a phrase.
    #[must_use]
    pub fn source(&self) -> &str {
        &self.source
    }
}

impl FromStr for Insert {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        let unreadable = |got: &str| {
            Error::of(ErrorKind::Malformed, "an insert is not written as it must be")
                .at(text)
                .got(got)
                .allowed(
                    "SOURCE:FROM..TO@TIME as in bow:0.5s..1.4s@3.6s, or SOURCE@TIME for all of it",
                )
        };
        let seconds = |time: &str| -> Result<f64, Error> {
            let number = time.trim().strip_suffix('s').and_then(|number| number.parse().ok());
            number.ok_or_else(|| unreadable(&format!("{time:?}, where a time belongs: 1.4s")))
        };
        let (rest, target) =
            text.rsplit_once('@').ok_or_else(|| unreadable("no @ before the time it goes to"))?;
        let target_s = seconds(target)?;
        let piece =
            rest.rsplit_once(':').and_then(|(source, cut)| Some((source, cut.split_once("..")?)));
        let (source, cut_s) = match piece {
            Some((source, (from, to))) => (source, Some((seconds(from)?, seconds(to)?))),
            None => (rest, None),
        };
        Self::new(source.trim(), cut_s, target_s).map_err(|e| e.at(text))
    }
}

impl fmt::Display for Insert {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.source)?;
        if let Some((from_s, to_s)) = self.cut_s {
            write!(f, ":{from_s}s..{to_s}s")?;
        }
        let target_s = self.target_s;
        write!(f, "@{target_s}s")
    }
}

/// Inserts in order, each into what the one before made, and how they are done.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Inserts {
    /// What goes where.
    pub list: Vec<Insert>,
    /// What is done where a cut holds no seam.
    pub no_seam: NoSeam,
    /// What follows a piece keeps its angles: see [`Cut::keep_end`].
    pub keep_end: bool,
    /// What the others do.
    pub meanwhile: Meanwhile,
}

/// What an insert did to one degree of freedom.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PastedTrack {
    /// Which.
    pub dof: Dof,
    /// Where the cut begins in it, s of the source: not where it should if it was moved to a seam.
    pub cut_begin_s: f64,
    /// Where it ends, s of the source.
    pub cut_end_s: f64,
    /// By how much it was moved, s; 0 if it was not.
    pub cut_moved_s: f64,
    /// Its first seam in the cut, s of the source: what begins there and later is pasted.
    pub seam_s: f64,
    /// Where the pasted actionlets begin, s of the result.
    pub from_s: f64,
    /// Where they end, s of the result.
    pub to_s: f64,
    /// What is added to the angles of what follows, rad.
    pub moved_rad: f64,
}

/// What an insert did.
#[derive(Clone, Debug, PartialEq)]
pub struct Inserted {
    /// The cut, in s of the source and of the target.
    pub cut: Cut,
    /// What was pasted.
    pub pasted: Vec<PastedTrack>,
    /// What moves in the target and was not pasted into.
    pub kept: Vec<Dof>,
}

impl Inserts {
    /// A motion with all of them in it, as a body does them, and what each did.
    ///
    /// # Errors
    /// As [`Motion::with_inserted`], with the insert it is about; if a source is no phrase of actions.
    pub fn apply(&self, motion: Motion, fits: &mut Fits) -> Result<(Motion, Vec<Inserted>), Error> {
        let mut done = Vec::with_capacity(self.list.len());
        let mut whole = motion;
        for insert in &self.list {
            let of_insert = |e: Error| {
                let within = e.place.as_ref().map(|place| format!(", {place}"));
                e.at(format!("insert {insert}{}", within.unwrap_or_default()))
            };
            let mut parts = phrase::load(&insert.source).map_err(of_insert)?;
            for part in &mut parts {
                part.action = fits.fit(&part.action).map_err(of_insert)?;
            }
            let source = phrase::perform(&parts, Join::Transition).map_err(of_insert)?;
            let (begin_s, end_s) = insert.cut_s.unwrap_or((0.0, source.duration_s()));
            let cut = Cut { begin_s, end_s, target_s: insert.target_s, keep_end: self.keep_end };
            let (next, inserted) = whole
                .with_inserted(&source, cut, self.no_seam, self.meanwhile)
                .map_err(of_insert)?;
            whole = next;
            done.push(inserted);
        }
        Ok((whole, done))
    }
}

impl Motion {
    /// This motion with a piece of `source` in it: [`paste`] in every degree of freedom that moves in
    /// the cut. Flights of the target after it come later where the legs do, those of the source come
    /// along.
    ///
    /// # Errors
    /// If a time is outside its motion, nothing moves in the cut, a degree of freedom has no seam in it
    /// (and that is refused), the legs would fall out of step, a flight would be torn, an angle would
    /// leave its range, or an end angle cannot be kept.
    pub fn with_inserted(
        &self,
        source: &Self,
        cut: Cut,
        no_seam: NoSeam,
        meanwhile: Meanwhile,
    ) -> Result<(Self, Inserted), Error> {
        self.check(source, &cut)?;
        let moved: Vec<Dof> =
            Dof::ALL.into_iter().filter(|dof| moves(source.track(*dof), &cut)).collect();
        let cuts = cuts(source, &moved, &cut, no_seam)?;
        self.check_steps(&moved, &cut, meanwhile)?;
        let mut pasted: Vec<(PastedTrack, f64)> = Vec::new();
        let mut tracks = Vec::with_capacity(Dof::ALL.len());
        for dof in Dof::ALL {
            let target = self.track(dof);
            let Some((_, own)) = cuts.iter().find(|(of, _)| *of == dof) else {
                tracks.push(match meanwhile {
                    Meanwhile::GoesOn => target.clone(),
                    Meanwhile::Waits => delayed(target, cut.target_s, cut.length_s())?,
                });
                continue;
            };
            let found = paste(source.track(dof), target, *own).map_err(|e| e.at(dof.name()))?;
            check_range(dof, &found.chain, [source.track(dof), target])?;
            let track = PastedTrack {
                dof,
                cut_begin_s: own.begin_s,
                cut_end_s: own.end_s,
                cut_moved_s: own.begin_s - cut.begin_s,
                seam_s: found.seam_s,
                from_s: found.from_s,
                to_s: found.to_s,
                moved_rad: found.moved_rad,
            };
            pasted.push((track, found.as_is_to_s));
            tracks.push(found.chain);
        }
        let legs_wait = meanwhile == Meanwhile::Waits || moved.iter().any(|dof| is_of_leg(*dof));
        let mut flights_s =
            if legs_wait { self.flights_after(&cut)? } else { self.flights_s().to_vec() };
        flights_s.extend(flights_of(source, &cut, &pasted)?);
        let motion = Self::new(tracks)?;
        let flights_s = in_order(flights_s, motion.duration_s());
        let kept = |dof: &Dof| !moved.contains(dof) && !rests(self.track(*dof));
        let kept = Dof::ALL.into_iter().filter(kept).collect();
        let pasted = pasted.into_iter().map(|(track, _)| track).collect();
        Ok((motion.in_flight(flights_s)?, Inserted { cut, pasted, kept }))
    }

    fn check(&self, source: &Self, cut: &Cut) -> Result<(), Error> {
        let within = |time_s: f64, motion: &Self| {
            (-AS_TOLD_S..=motion.duration_s() + AS_TOLD_S).contains(&time_s)
        };
        let outside = |what: &str, got: String, motion: &Self| {
            Err(Error::of(ErrorKind::OutsideLimits, what)
                .got(got)
                .allowed(format!("0 to {} s", told(motion.duration_s()))))
        };
        if !(within(cut.begin_s, source) && within(cut.end_s, source)) {
            let got = format!("{} to {} s", told(cut.begin_s), told(cut.end_s));
            return outside("a cut is not inside what it is cut out of", got, source);
        }
        if !within(cut.target_s, self) {
            let got = format!("{} s", told(cut.target_s));
            return outside("the time to insert at is not inside the motion", got, self);
        }
        if !(cut.length_s() >= MIN_CUT_S - AS_TOLD_S) {
            return Err(Error::new("a cut ends before it begins, or at once")
                .got(format!("{} to {} s", told(cut.begin_s), told(cut.end_s)))
                .allowed(format!("the end at least {MIN_CUT_S} s after the begin")));
        }
        Ok(())
    }

    /// Fails if some of the legs' joints came later than the others from then on.
    fn check_steps(&self, moved: &[Dof], cut: &Cut, meanwhile: Meanwhile) -> Result<(), Error> {
        if meanwhile == Meanwhile::Waits || !moved.iter().any(|dof| is_of_leg(*dof)) {
            return Ok(());
        }
        let goes_on = |dof: &Dof| {
            let later =
                |piece: &Actionlet| !piece.is_rest() && piece.end_s() > cut.target_s + AS_TOLD_S;
            is_of_leg(*dof)
                && !moved.contains(dof)
                && self.track(*dof).actionlets().iter().any(later)
        };
        let late: Vec<&str> = Dof::ALL.into_iter().filter(goes_on).map(Dof::name).collect();
        if late.is_empty() {
            return Ok(());
        }
        Err(Error::new("the legs would fall out of step")
            .got(format!("the cut moves legs, but not {}, which go on", late.join(", ")))
            .allowed("a cut that moves all that the legs still do, or none of it")
            .remedy("let what it does not move wait for it (--insert-wait)"))
    }

    /// Flights where the legs come later from the target time on: those before as they are, those
    /// after so much later.
    fn flights_after(&self, cut: &Cut) -> Result<Vec<(f64, f64)>, Error> {
        let (mut begin_s, mut end_s) = (cut.target_s, cut.target_s);
        for dof in Dof::ALL.into_iter().filter(|dof| is_of_leg(*dof)) {
            // What is retimed has other angles from its begin to its end.
            let retimed = self.track(dof).actionlets().iter().filter(|piece| {
                let is_around = piece.begin_s() < cut.target_s - AS_TOLD_S
                    && cut.target_s + AS_TOLD_S < piece.end_s();
                is_around && !piece.is_rest()
            });
            for piece in retimed {
                begin_s = begin_s.min(piece.begin_s());
                end_s = end_s.max(piece.end_s());
            }
        }
        let mut flights_s = Vec::with_capacity(self.flights_s().len());
        for (from_s, to_s) in self.flights_s() {
            if *to_s <= begin_s + AS_TOLD_S {
                flights_s.push((*from_s, *to_s));
            } else if *from_s >= end_s - AS_TOLD_S {
                flights_s.push((from_s + cut.length_s(), to_s + cut.length_s()));
            } else {
                return Err(Error::new("an insert would tear a flight of the target")
                    .got(format!(
                        "the flight from {} to {} s; at {} s legs are moving from {} to {} s",
                        told(*from_s),
                        told(*to_s),
                        told(cut.target_s),
                        told(begin_s),
                        told(end_s)
                    ))
                    .allowed("a time at which no leg is in a movement that has to do with a flight")
                    .remedy("insert where the legs rest, or a piece that moves no leg"));
            }
        }
        Ok(flights_s)
    }
}

/// Seconds as they are told.
fn told(time_s: f64) -> String {
    let text = format!("{time_s:.6}");
    let short = text.trim_end_matches('0').trim_end_matches('.');
    if short == "-0" { "0".to_owned() } else { short.to_owned() }
}

/// True if a chain moves between the ends of a cut.
fn moves(source: &Sequence, cut: &Cut) -> bool {
    source.actionlets().iter().any(|piece| {
        let is_in =
            piece.begin_s() < cut.end_s - AS_TOLD_S && cut.begin_s + AS_TOLD_S < piece.end_s();
        is_in && !piece.is_rest()
    })
}

fn rests(chain: &Sequence) -> bool {
    chain.actionlets().iter().all(Actionlet::is_rest)
}

fn is_of_leg(dof: Dof) -> bool {
    matches!(
        dof.joint(),
        Joint::LeftHip
            | Joint::RightHip
            | Joint::LeftKnee
            | Joint::RightKnee
            | Joint::LeftAnkle
            | Joint::RightAnkle
    )
}

/// The cut of each degree of freedom that moves in it.
fn cuts(
    source: &Motion,
    moved: &[Dof],
    cut: &Cut,
    no_seam: NoSeam,
) -> Result<Vec<(Dof, Cut)>, Error> {
    if moved.is_empty() {
        return Err(Error::new("nothing moves in the cut")
            .got(format!("{} to {} s", told(cut.begin_s), told(cut.end_s)))
            .remedy("cut a piece in which something moves"));
    }
    let seamless = |dof: &&Dof| seam_in(source.track(**dof), cut).is_none();
    let without: Vec<Dof> = moved.iter().filter(seamless).copied().collect();
    if no_seam == NoSeam::Refused && !without.is_empty() {
        return Err(without_seam(source, &without, cut));
    }
    let own = |dof: &Dof| {
        let own = if without.contains(dof) { to_a_seam(source.track(*dof), cut) } else { *cut };
        (*dof, own)
    };
    Ok(moved.iter().map(own).collect())
}

/// The cut, moved to begin at the seam nearest to where it should.
fn to_a_seam(source: &Sequence, cut: &Cut) -> Cut {
    let length_s = cut.length_s();
    let seams = source.actionlets().iter().map(Actionlet::begin_s);
    let fitting = seams.filter(|seam_s| seam_s + length_s <= source.end_s() + AS_TOLD_S);
    let away = |seam_s: &f64| (seam_s - cut.begin_s).abs();
    let nearest = fitting.min_by(|a, b| away(a).total_cmp(&away(b)));
    let begin_s = nearest.unwrap_or_else(|| source.begin_s());
    Cut { begin_s, end_s: begin_s + length_s, ..*cut }
}

fn without_seam(source: &Motion, dofs: &[Dof], cut: &Cut) -> Error {
    let (mut earliest_s, mut latest_s) = (cut.begin_s, cut.end_s);
    let mut names = Vec::new();
    for dof in dofs {
        let pieces = source.track(*dof).actionlets();
        let around = pieces.iter().find(|piece| cut.begin_s < piece.end_s() - AS_TOLD_S);
        let (before_s, after_s) =
            around.map_or((0.0, 0.0), |piece| (piece.begin_s(), piece.end_s()));
        earliest_s = earliest_s.min(before_s);
        latest_s = latest_s.max(after_s);
        names.push(format!("{} rests at {} and {} s", dof.name(), told(before_s), told(after_s)));
    }
    let later = if latest_s < source.duration_s() - AS_TOLD_S {
        format!(", or until later than {} s", told(latest_s))
    } else {
        String::new()
    };
    Error::new("what the cut moves does not come to rest in it")
        .got(format!("{} to {} s; {}", told(cut.begin_s), told(cut.end_s), names.join("; ")))
        .allowed("a cut that begins at an instant of rest, or holds one, of all that it moves")
        .remedy(format!(
            "cut from {} s on{later}; --insert-nearest moves the cut of each to its nearest rest",
            told(earliest_s)
        ))
}

/// Fails if a chain leaves the anatomical range and goes further than those it was made of.
fn check_range(dof: Dof, chain: &Sequence, made_of: [&Sequence; 2]) -> Result<(), Error> {
    let angles = |chain: &Sequence| -> Vec<f64> {
        let ends = chain.actionlets().iter().map(Actionlet::to_rad);
        std::iter::once(chain.from_rad()).chain(ends).collect()
    };
    let (mut lower, mut upper) = dof.range_rad();
    for angle_rad in made_of.into_iter().flat_map(angles) {
        lower = lower.min(angle_rad);
        upper = upper.max(angle_rad);
    }
    let range = lower - ROUNDED_RAD..=upper + ROUNDED_RAD;
    let Some(out_rad) = angles(chain).into_iter().find(|angle_rad| !range.contains(angle_rad))
    else {
        return Ok(());
    };
    Err(Error::of(ErrorKind::OutsideLimits, "an insert would leave the anatomical range")
        .at(dof.name())
        .got(format!("{:.1} deg", out_rad.to_degrees()))
        .allowed(format!("{:.0} to {:.0} deg", lower.to_degrees(), upper.to_degrees()))
        .remedy("let what follows keep its angles (--insert-keep-end), or cut another piece"))
}

/// Flights of the source in the cut, in s of the result. Each pasted track comes with up to where, s of
/// the source, it is as it was.
fn flights_of(
    source: &Motion,
    cut: &Cut,
    pasted: &[(PastedTrack, f64)],
) -> Result<Vec<(f64, f64)>, Error> {
    let mut flights_s = Vec::new();
    for (from_s, to_s) in source.flights_s() {
        if *to_s <= cut.begin_s + AS_TOLD_S || cut.end_s - AS_TOLD_S <= *from_s {
            continue;
        }
        let inside = cut.begin_s - AS_TOLD_S <= *from_s && *to_s <= cut.end_s + AS_TOLD_S;
        let legs = || pasted.iter().filter(|(track, _)| is_of_leg(track.dof));
        let as_is = |(track, as_is_to_s): &(PastedTrack, f64)| {
            track.cut_moved_s == 0.0
                && track.seam_s <= from_s + AS_TOLD_S
                && *to_s <= as_is_to_s + AS_TOLD_S
        };
        if !(inside && legs().next().is_some() && legs().all(as_is)) {
            return Err(Error::new("a cut would tear a flight of its source")
                .got(format!("the flight from {} to {} s", told(*from_s), told(*to_s)))
                .allowed("a cut that holds all actionlets of the legs around a flight, or none")
                .remedy("cut from before the take-off until after the landing"));
        }
        let later_s = cut.target_s - cut.begin_s;
        flights_s.push((from_s + later_s, to_s + later_s));
    }
    Ok(flights_s)
}

/// Flights one after the other, inside a motion: their times are sums and may be rounded.
fn in_order(mut flights_s: Vec<(f64, f64)>, duration_s: f64) -> Vec<(f64, f64)> {
    flights_s.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut since_s = 0.0;
    for (from_s, to_s) in &mut flights_s {
        if *from_s < since_s && since_s - *from_s <= 2.0 * AS_TOLD_S {
            *from_s = since_s;
        }
        if *to_s > duration_s && *to_s - duration_s <= 2.0 * AS_TOLD_S {
            *to_s = duration_s;
        }
        since_s = *to_s;
    }
    flights_s
}
