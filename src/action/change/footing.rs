//! Feet that hold while one gait goes over into another.
//!
//! Where both gaits move the legs, no way over from a cycle to the next puts the feet exactly where they stand
//! still: in between they are in neither gait. So the seams of the legs around the change are moved, as little as
//! may be, to where soles that are on the floor stay where they are and the body is not thrown: damped least
//! squares (Levenberg, Marquardt) on what the soles and the root really do. Every degree of freedom stays a chain of
//! actionlets, inside its range, and no faster than it may be in a change. What holds then no better than
//! variations of the gaits must is refused.

use std::ops::Range;

use glam::{DQuat, DVec2, DVec3};
use nalgebra::{Cholesky, DMatrix, DVector};

use super::{Gait, Line, Seam, chain, limits};
use crate::action::feet::{Feet, FootingBounds};
use crate::action::{Crossing, GaitChange, Motion};
use crate::actionlet::shape::PEAK_AT;
use crate::actionlet::{Actionlet, Sequence, Shape};
use crate::body::contact::worst_slide_m;
use crate::body::mass::{SegmentMasses, segment_masses};
use crate::body::root::{AboutRoot, path_about_m};
use crate::body::stance::{self, Upright};
use crate::body::{Dof, JointAngles, PelvisAngles, Proportions};
use crate::error::{Error, ErrorKind};
use crate::motion::JointLimits;

/// Seams of each gait that are moved, before the one that is left and after the one that is joined.
const BESIDE: usize = 2;
/// So far each is moved as a matter of course: rad, s, and T.
const USUAL_RAD: f64 = 0.06;
const USUAL_S: f64 = 0.02;
const USUAL_T: f64 = 0.1;
/// A joint that is faster than this part of what it may be ...
const HASTE_FROM: f64 = 0.99;
/// ... is this part faster as little as seams are moved as a matter of course.
const USUAL_HASTE: f64 = 0.05;
/// Soles and root are looked at so often ...
const LOOKS_HZ: f64 = 125.0;
/// ... from so long before the seams that are moved to so long after them, s, of which ...
const AROUND_S: f64 = 0.7;
/// ... the first and the last are not judged: nothing is known of what was before.
const EDGE_S: f64 = 0.12;
/// A sole that is lower than this counts as one that is on the floor: it comes there when others move a little, m.
const NEARLY_ON_FLOOR_M: f64 = 0.007;
/// Soles that are on the floor are held as well as this, m ...
const HOLDS_M: f64 = 0.000_7;
/// ... and where the root is accelerated by more than this part of what is allowed ...
const ROOT_PART: f64 = 0.7;
/// ... as well as this, m/s^2; on the average over ...
const ROOT_HOLDS_M_S2: f64 = 3.0;
/// ... this time, s.
const HOLDS_FOR_S: f64 = 0.05;
/// Where feet do not hold well enough yet, what they do matters so many times as much, in turn ...
const MATTERS: [f64; 4] = [1.0, 3.0, 10.0, 30.0];
/// ... until of what they may slide this part is used up.
pub(super) const GOOD: f64 = 0.9;
/// Steps of the search at most ...
const STEPS: usize = 14;
/// ... each damped anew at most so often ...
const TRIES: usize = 6;
/// ... and worth it if this part of what is off is left.
const ENOUGH_BETTER: f64 = 0.995;
/// A figure is moved by this part of what is usual to tell how soles answer.
const NUDGE: f64 = 0.05;
/// Rounds in which a gait by itself is judged.
const ROUNDS: u32 = 3;
/// Two seams of a chain stay so far apart, s.
const APART_S: f64 = 0.02;

/// What of one leg's chain is moved: seams by index, and T up to the first that stays.
struct Moved {
    dof: Dof,
    seams: Range<usize>,
    limits: JointLimits,
}

/// The legs around a change, as they may be moved.
struct Around {
    body: Proportions,
    masses: SegmentMasses,
    moved: Vec<Moved>,
    /// By degree of freedom: the chain from before to after what is looked at.
    given: Vec<Vec<Seam>>,
    /// Where it is looked at to move seams, and where it is judged.
    looks: Looks,
    judged: Looks,
    slides_m: f64,
    root_m_s2: f64,
}

/// The body with its seams somewhere. Of the next trial, in which few of them are elsewhere, most instants are known by it.
struct Body {
    all: Vec<Vec<Seam>>,
    seen: Vec<Seen>,
}

/// The body at an instant.
struct Seen {
    angles: JointAngles,
    upright: Upright,
    pelvis: PelvisAngles,
    about: AboutRoot,
}

/// A body, and what is off of it.
struct Trial {
    off: DVector<f64>,
    body: Body,
}

/// Instants at which the body is looked at, and its angles there before anything is moved.
struct Looks {
    rate_hz: f64,
    times_s: Vec<f64>,
    angles: Vec<JointAngles>,
}

/// Moves the seams of the legs around a change to where feet hold, as near as may be, and has the crossings tell
/// what then is left alone. Tells the part of what they may do that feet and root do.
///
/// # Errors
/// As of chains of actionlets.
pub(super) fn hold(
    lines: &mut [Line],
    (from, to): (&Gait<'_>, &Gait<'_>),
    crossings: &mut [Crossing],
    bounds: &FootingBounds,
    body: &Proportions,
) -> Result<f64, Error> {
    let around = Around::between(lines, (from, to), crossings, bounds, body)?;
    let (share, found) = around.holding()?;
    for (moved, seams) in around.moved.iter().zip(around.seams(&found)) {
        let line = &mut lines[moved.dof.index()];
        line.seams[moved.seams.start - 1..=moved.seams.end].clone_from_slice(&seams);
        let [first, last] = [&line.seams[moved.seams.start - 1], &line.seams[moved.seams.end]];
        for crossing in crossings.iter_mut().filter(|of| of.dof == moved.dof) {
            (crossing.left_s, crossing.left_rad) = (first.at_s, first.angle_rad);
            (crossing.joined_s, crossing.joined_rad) = (last.at_s, last.angle_rad);
        }
        line.since = line.since.max(moved.seams.end);
    }
    Ok(share)
}

/// How well feet are to hold in a change: as in variations of both gaits. None if those of one do not hold by
/// themselves.
///
/// # Errors
/// If a gait cannot be performed.
pub(super) fn bounds(
    from: &Gait<'_>,
    to: &Gait<'_>,
    body: &Proportions,
) -> Result<Option<FootingBounds>, Error> {
    let alone = |gait: &Gait<'_>| {
        FootingBounds::of(&gait.action.perform_rounds(ROUNDS.min(gait.action.rounds))?, body)
    };
    let (Some(from), Some(to)) = (alone(from)?, alone(to)?) else { return Ok(None) };
    Ok(Some(from.or(&to).wherever()))
}

/// Fails if feet of a motion with these changes do not hold.
///
/// # Errors
/// If they do not, or as [`Motion::poses`].
pub(super) fn held(
    motion: &Motion,
    changes: &[GaitChange],
    bounds: &FootingBounds,
    body: &Proportions,
) -> Result<(), Error> {
    let missed = bounds.missed(motion, body)?;
    let Some(worst) = missed.iter().max_by(|a, b| (a.got / a.most).total_cmp(&(b.got / b.most)))
    else {
        return Ok(());
    };
    let names = changes.iter().map(|change| format!("{}+{}", change.from, change.to));
    Err(Error::of(ErrorKind::OutsideLimits, "feet do not hold in this change of gait")
        .at(names.collect::<Vec<_>>().join(", "))
        .got(worst.told())
        .allowed(worst.allowed())
        .remedy("join them with a comma, or try another pace (walk@1.2)"))
}

impl Around {
    /// What of two gaits may be moved for feet to hold.
    fn between(
        lines: &[Line],
        (from, to): (&Gait<'_>, &Gait<'_>),
        crossings: &[Crossing],
        bounds: &FootingBounds,
        body: &Proportions,
    ) -> Result<Self, Error> {
        let flies = [from, to].iter().any(|gait| !gait.action.flights.is_empty());
        let mut moved = Vec::new();
        for line in lines.iter().filter(|line| line.dof.is_of_leg()) {
            let crosses = crossings.iter().any(|crossing| crossing.dof == line.dof);
            // The seam that is joined, and the one before it that is left.
            let Some(left) = line.since.checked_sub(1).filter(|_| crosses) else { continue };
            let first = left.saturating_sub(BESIDE).max(1);
            let past = (line.since + BESIDE + 1).min(line.seams.len().saturating_sub(1));
            if first < past {
                let limits = limits(from, to, line.dof)?;
                moved.push(Moved { dof: line.dof, seams: first..past, limits });
            }
        }
        let allowed = (bounds.slides_m(), bounds.root_m_s2(flies));
        Self::of(lines, moved, allowed, body)
    }

    fn of(
        lines: &[Line],
        moved: Vec<Moved>,
        (slides_m, root_m_s2): (f64, f64),
        body: &Proportions,
    ) -> Result<Self, Error> {
        let seams = |moved: &Moved| {
            let seams = &lines[moved.dof.index()].seams;
            (seams[moved.seams.start - 1].at_s, seams[moved.seams.end].at_s)
        };
        let from_s = moved.iter().map(|moved| seams(moved).0).fold(f64::MAX, f64::min) - AROUND_S;
        let to_s = moved.iter().map(|moved| seams(moved).1).fold(f64::MIN, f64::max) + AROUND_S;
        let from_s = from_s.max(0.0);
        let (looks, judged) = (
            Looks::of(lines, from_s, to_s, LOOKS_HZ)?,
            Looks::of(lines, from_s, to_s, FootingBounds::JUDGED_HZ)?,
        );
        let given = moved
            .iter()
            .map(|moved| {
                lines[moved.dof.index()].seams[moved.seams.start - 1..=moved.seams.end].to_vec()
            })
            .collect();
        let masses = segment_masses(body);
        Ok(Self { body: *body, masses, moved, given, looks, judged, slides_m, root_m_s2 })
    }

    /// The least part of what they may do that feet and root do, and how far seams are moved there, in parts of
    /// what is usual.
    fn holding(&self) -> Result<(f64, DVector<f64>), Error> {
        let count = self.given.iter().map(|seams| 2 * (seams.len() - 2) + seams.len() - 1).sum();
        let mut at = DVector::zeros(count);
        let mut best = (f64::INFINITY, at.clone());
        for matters in MATTERS {
            let next = self.least(at.clone(), matters)?;
            if matters > MATTERS[0] && next == at {
                break;
            }
            at = next;
            let share = self.share(&at)?;
            if share < best.0 {
                best = (share, at.clone());
            }
            if share < GOOD {
                break;
            }
        }
        Ok(best)
    }

    /// From there to where what is off and how far seams are moved weigh least together.
    fn least(&self, mut at: DVector<f64>, matters: f64) -> Result<DVector<f64>, Error> {
        let count = at.len();
        let Some(mut now) = self.trial(&at, matters, None)? else { return Ok(at) };
        let mut worth = now.off.norm_squared() + at.norm_squared();
        let mut damping = 1.0;
        for _ in 0..STEPS {
            let mut slopes = DMatrix::zeros(now.off.len(), count);
            for column in 0..count {
                let mut nudged = at.clone();
                nudged[column] += NUDGE;
                if let Some(moved) = self.trial(&nudged, matters, Some(&now.body))? {
                    slopes.set_column(column, &((moved.off - &now.off) / NUDGE));
                }
            }
            let turned = slopes.transpose();
            let (normal, pull) = (&turned * &slopes, &turned * &now.off + &at);
            let mut better = false;
            for _ in 0..TRIES {
                let damped = &normal + DMatrix::identity(count, count) * (1.0 + damping);
                let Some(factors) = Cholesky::new(damped) else { break };
                let next = &at - factors.solve(&pull);
                if let Some(then) = self.trial(&next, matters, Some(&now.body))? {
                    let then_worth = then.off.norm_squared() + next.norm_squared();
                    if then_worth < worth * ENOUGH_BETTER {
                        (at, now, worth, better) = (next, then, then_worth, true);
                        damping = (damping / 4.0).max(1e-3);
                        break;
                    }
                }
                damping *= 4.0;
            }
            if !better {
                break;
            }
        }
        Ok(at)
    }

    /// The seams moved so far, in parts of what is usual.
    fn seams(&self, at: &DVector<f64>) -> Vec<Vec<Seam>> {
        let mut figures = at.iter();
        let mut next = |usual: f64| figures.next().map_or(0.0, |figure| figure * usual);
        let mut all = Vec::with_capacity(self.given.len());
        for (moved, given) in self.moved.iter().zip(&self.given) {
            let mut seams = given.clone();
            let last = seams.len() - 1;
            let (lower, upper) = moved.dof.range_rad();
            for seam in &mut seams[1..last] {
                seam.at_s += next(USUAL_S);
                let angle_rad = seam.angle_rad + next(USUAL_RAD);
                seam.angle_rad =
                    angle_rad.clamp(lower.min(seam.angle_rad), upper.max(seam.angle_rad));
            }
            for seam in &mut seams[1..] {
                let moved = next(USUAL_T);
                if let Shape::HalfSine(peak_at) = &seam.shape {
                    let peak_at = (peak_at.value() + moved).clamp(*PEAK_AT.start(), *PEAK_AT.end());
                    seam.shape = Shape::half_sine(peak_at).unwrap_or_default();
                }
            }
            all.push(seams);
        }
        all
    }

    /// How far soles leave where they stand, how hard the root is thrown, and how much too fast joints are, in parts
    /// of what is allowed to them; none where seams pass one another. What `before` saw is not looked at anew.
    fn trial(
        &self,
        at: &DVector<f64>,
        matters: f64,
        before: Option<&Body>,
    ) -> Result<Option<Trial>, Error> {
        let all = self.seams(at);
        let apart = |pair: &[Seam]| pair[1].at_s - pair[0].at_s >= APART_S;
        if !all.iter().all(|seams| seams.windows(2).all(apart)) {
            return Ok(None);
        }
        let mut off = Vec::new();
        for (moved, seams) in self.moved.iter().zip(&all) {
            let chain = chain(seams)?;
            off.extend(chain.actionlets().iter().flat_map(|piece| hastes(piece, &moved.limits)));
        }
        let (feet, body) = self.feet(all, &self.looks, before)?;
        self.add_feet(&feet, matters, &mut off);
        Ok(Some(Trial { off: DVector::from_vec(off), body }))
    }

    /// The feet of the body with these seams.
    fn feet(
        &self,
        all: Vec<Vec<Seam>>,
        looks: &Looks,
        before: Option<&Body>,
    ) -> Result<(Feet, Body), Error> {
        let mut angles = match before {
            Some(before) => before.seen.iter().map(|seen| seen.angles).collect(),
            None => looks.angles.clone(),
        };
        for (which, (moved, seams)) in self.moved.iter().zip(&all).enumerate() {
            if before.is_none_or(|before| before.all[which] != *seams) {
                looks.lay(&mut angles, moved.dof, &chain(seams)?);
            }
        }
        let same =
            |look: usize| Some(&before?.seen[look]).filter(|seen| seen.angles == angles[look]);
        let upright = |(look, angles): (usize, &JointAngles)| {
            same(look).map_or_else(|| Upright::of(&self.body, angles), |seen| seen.upright)
        };
        let uprights: Vec<Upright> = angles.iter().enumerate().map(upright).collect();
        let pelvises = stance::pelvises(&angles, &uprights, looks.rate_hz);
        let about = |(look, pelvis): (usize, &PelvisAngles)| {
            let listed_alike = |seen: &&Seen| {
                seen.pelvis == PelvisAngles { rotation_rad: seen.pelvis.rotation_rad, ..*pelvis }
            };
            match same(look).filter(listed_alike) {
                Some(seen) if seen.pelvis == *pelvis => seen.about,
                Some(seen) => {
                    let turned_rad = pelvis.rotation_rad - seen.pelvis.rotation_rad;
                    seen.about.turned(DQuat::from_rotation_z(turned_rad))
                }
                None => {
                    let turned = pelvis.to_orientation();
                    let pose = stance::on_flat_soles(&angles[look], DVec3::ZERO, turned);
                    AboutRoot::of(&self.body, &self.masses, &pose)
                }
            }
        };
        let abouts: Vec<AboutRoot> = pelvises.iter().enumerate().map(about).collect();
        let roots_m = path_about_m(&abouts, looks.rate_hz);
        // Small; the cast saturates.
        let edge = ((EDGE_S * looks.rate_hz) as usize).min(roots_m.len() / 2);
        let judged = edge..roots_m.len() - edge;
        let soles_m = abouts.iter().zip(&roots_m);
        let soles_m = soles_m.map(|(about, root_m)| about.soles_m.map(|sole_m| sole_m + *root_m));
        let feet = Feet {
            soles_m: soles_m.skip(edge).take(judged.len()).collect(),
            roots_m: roots_m[judged].to_vec(),
        };
        let seen = angles.into_iter().zip(uprights).zip(pelvises.into_iter().zip(abouts));
        let seen = seen.map(|((angles, upright), (pelvis, about))| Seen {
            angles,
            upright,
            pelvis,
            about,
        });
        Ok((feet, Body { all, seen: seen.collect() }))
    }

    /// The part of what they may do that feet and root do.
    fn share(&self, at: &DVector<f64>) -> Result<f64, Error> {
        let (feet, _) = self.feet(self.seams(at), &self.judged, None)?;
        let jerked = feet.root_m_s2() / self.root_m_s2;
        Ok(jerked.max(worst_slide_m(&feet.soles_m) / self.slides_m))
    }

    fn add_feet(&self, feet: &Feet, matters: f64, off: &mut Vec<f64>) {
        let part = (1.0 / (LOOKS_HZ * HOLDS_FOR_S)).sqrt();
        let mut slid_m = vec![[DVec2::ZERO; 4]; feet.soles_m.len()];
        for (sole, range) in feet.lower_than(NEARLY_ON_FLOOR_M) {
            let at_m = |look: usize| feet.soles_m[look][sole].truncate();
            let mean_m = range.clone().map(at_m).sum::<DVec2>() / range.len() as f64;
            for look in range {
                slid_m[look][sole] = at_m(look) - mean_m;
            }
        }
        let scale = matters * part / HOLDS_M;
        off.extend(slid_m.iter().flatten().flat_map(|slid_m| (*slid_m * scale).to_array()));
        for bend_m in feet.bends_m() {
            let over = bend_m.length() * LOOKS_HZ * LOOKS_HZ - ROOT_PART * self.root_m_s2;
            off.push(over.max(0.0) * matters * part / ROOT_HOLDS_M_S2);
        }
    }
}

impl Looks {
    fn of(lines: &[Line], from_s: f64, to_s: f64, rate_hz: f64) -> Result<Self, Error> {
        // Some seconds; the cast saturates.
        let looks = ((to_s - from_s) * rate_hz).ceil() as usize;
        let times_s: Vec<f64> = (0..=looks).map(|look| from_s + look as f64 / rate_hz).collect();
        let mut angles = vec![JointAngles::default(); times_s.len()];
        for line in lines {
            let chain = line.chain()?;
            for (angles, time_s) in angles.iter_mut().zip(&times_s) {
                angles[line.dof] = chain.at(*time_s).position_rad;
            }
        }
        Ok(Self { rate_hz, times_s, angles })
    }

    /// Angles of a chain where it is looked at; before and after it they are those that were given.
    fn lay(&self, angles: &mut [JointAngles], dof: Dof, chain: &Sequence) {
        for (angles, time_s) in angles.iter_mut().zip(&self.times_s) {
            if (chain.begin_s()..=chain.end_s()).contains(time_s) {
                angles[dof] = chain.at(*time_s).position_rad;
            }
        }
    }
}

/// How much faster and sharper an actionlet is than it may be in a change, in parts of what is usual.
fn hastes(piece: &Actionlet, limits: &JointLimits) -> [f64; 2] {
    let peaks = piece.peaks();
    let speed = peaks.velocity_rad_s / limits.velocity_rad_s();
    let sharp = peaks.acceleration_rad_s2 / limits.acceleration_rad_s2();
    [speed, sharp].map(|part| (part - HASTE_FROM).max(0.0) / USUAL_HASTE)
}

#[cfg(test)]
mod tests {
    use super::super::{Choice, gaits, go_over};
    use super::*;
    use crate::action::vocabulary;

    /// The search looks at few instants anew; here it is held against a look at all of them.
    #[test]
    fn what_is_known_from_a_trial_before_is_what_is_found_anew() {
        let body = Proportions::of_stature(1.75).unwrap();
        let actions = ["walk", "run"].map(|name| (vocabulary::find(name).unwrap(), 3));
        let gaits = gaits(&actions).unwrap();
        let [from, to] = &gaits[..] else { panic!("two gaits") };
        let mut lines = Dof::ALL.map(|dof| Line::of(from, dof));
        let choices: Vec<Choice> =
            lines.iter().map(|line| line.choice(from, to).unwrap()).collect();
        let nearest: Vec<usize> = choices.iter().map(Choice::nearest).collect();
        let crossings = go_over(&mut lines, &choices, &nearest, (from, to));
        let bounds = bounds(from, to, &body).unwrap().expect("feet hold in both");
        let around = Around::between(&lines, (from, to), &crossings, &bounds, &body).unwrap();
        let count = around.given.iter().map(|seams| 2 * (seams.len() - 2) + seams.len() - 1).sum();
        let start = DVector::zeros(count);
        let mut known = around.trial(&start, 1.0, None).unwrap().expect("seams in order");
        let (mut at, mut moved, mut furthest) = (start, 0, 0.0_f64);
        for column in 0..count {
            at[column] += NUDGE;
            let anew = around.trial(&at, 1.0, None).unwrap().expect("seams in order");
            let told = around.trial(&at, 1.0, Some(&known.body)).unwrap().expect("the same");
            moved += usize::from((&told.off - &known.off).amax() > 1e-3);
            furthest = furthest.max((&told.off - &anew.off).amax());
            known = told;
        }
        // Parts of what is allowed: 1e-6 is less than a nanometre. Each figure leaves its mark.
        assert!(furthest < 1e-6, "{furthest}");
        assert!(moved * 10 > 9 * count, "{moved} of {count}");
    }
}
