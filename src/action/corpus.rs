//! Many variations of an action, reproducible one by one: variation n of a seed is the same
//! whatever was made before it, and by how many threads.

use crate::action::feet::FootingBounds;
use crate::action::fit::fit;
use crate::action::foothold::Footstep;
use crate::action::frames::{self, CorpusPose};
use crate::action::mutate::around_zero;
use crate::action::{Database, Foothold, Join, Motion, Spread, phrase};
use crate::actionlet::Shape;
use crate::body::{Dof, Proportions};
use crate::error::Error;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::sync::OnceLock;

/// Draws of a variation before none is found whose feet hold.
const DRAWS: u32 = 16;
/// Repairs of a draw: by what its feet do ...
const REPAIRS: u32 = 3;
/// ... and then by going back towards the action itself as well, to this part of the way from it each time.
const RETREATS: u32 = 4;
const RETREATS_TO: f64 = 0.75;

/// Actions are fitted to bodies whose statures lie apart by this part of it at most.
const RUNG: f64 = 0.04;

/// Points are kept to this, m: a tenth of a millimetre is far below what a body is known to, and
/// the bytes that say nothing compress.
const POINT_STEP_M: f64 = 1.0 / 16_384.0;

/// What to make: variations of one class.
#[derive(Clone, Debug)]
pub struct Corpus {
    /// What a learner is to call it.
    pub label: String,
    /// The actions.
    pub parts: Vec<phrase::Part>,
    /// How they are joined.
    pub join: Join,
    /// How far variations go.
    pub spread: Spread,
    /// Where exchanged velocity functions come from.
    pub database: Database,
    /// Seed of everything random.
    pub seed: u64,
    /// Poses per second.
    pub rate_hz: f64,
    /// The body that moves: its legs decide where the root goes.
    pub body: Proportions,
    /// Whether joints and ends are written as points in space.
    pub has_points: bool,
}

/// Whether a person could do a variation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum VariationStatus {
    /// Its feet stand where they stand, on the floor, and its root is not jerked ([`FootingBounds`]).
    Valid,
    /// So they do since its seams were moved further.
    Repaired,
    /// Somewhere they do not, or it is; nor were those of other draws.
    Implausible,
}

impl VariationStatus {
    /// As it stands in tables.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Valid => "valid",
            Self::Repaired => "repaired",
            Self::Implausible => "implausible",
        }
    }
}

/// A variation as a row.
#[derive(Clone, Debug, PartialEq)]
pub struct VariationRow {
    /// Its number.
    pub number: i32,
    /// What became of it.
    pub status: VariationStatus,
    /// Draws before it whose feet did not hold.
    pub rejected: u32,
    /// Stature of the body that does it, m.
    pub stature_m: f64,
    /// How long it lasts, s.
    pub duration_s: f64,
    /// How many poses it has.
    pub poses: usize,
}

/// Some variations as columns.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Batch {
    /// Number of the variation, by pose.
    pub variation: Vec<i32>,
    /// Time, s, by pose.
    pub time_s: Vec<f32>,
    /// Angles, rad, by degree of freedom and pose.
    pub angles_rad: [Vec<f32>; 22],
    /// Stature of the body, m, by pose.
    pub stature_m: Vec<f32>,
    /// Where the root is in the world, m: X forward, Y left, Z up; by axis and pose.
    pub root_m: [Vec<f32>; 3],
    /// Orientation of the pelvis in the world, a quaternion: w, x, y, z; by pose.
    pub pelvis: [Vec<f32>; 4],
    /// Which parts of the feet carry, in the order of [`crate::body::root::SOLES`]; by pose.
    pub carries: [Vec<bool>; 4],
    /// Where joints and ends are, m, in the order of [`frames::point_names`], x, y and z of each; by
    /// pose. None if they are not asked for.
    pub points_m: Vec<Vec<f32>>,
    /// The variations, one row each.
    pub rows: Vec<VariationRow>,
    /// The actionlets the poses were made from.
    pub pieces: Pieces,
}

/// Actionlets as columns: the parameters of every variation.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Pieces {
    /// Number of the variation.
    pub variation: Vec<i32>,
    /// The n of y_n.
    pub dof: Vec<i32>,
    /// 0 rest, 1 half sine, 2 minimum jerk, 3 sampled.
    pub shape: Vec<i32>,
    /// When it begins, s.
    pub begin_s: Vec<f64>,
    /// How long it lasts, s.
    pub duration_s: Vec<f64>,
    /// Angle at the begin, rad.
    pub from_rad: Vec<f64>,
    /// Angle at the end, rad.
    pub to_rad: Vec<f64>,
    /// T of a half sine; not a number for the others.
    pub peak: Vec<f64>,
    /// How many of `samples` belong to it: none unless its shape is sampled.
    pub sample_count: Vec<usize>,
    /// Velocity functions by samples, of an integral of 1, one after the other; see
    /// [`Sampled::velocities`](crate::actionlet::Sampled::velocities).
    pub samples: Vec<f64>,
}

/// A corpus whose variations can be made: how feet answer to what varies is known.
#[derive(Clone, Debug)]
pub struct Variations {
    corpus: Corpus,
    /// Of bodies as tall as variations may be, evenly spread; looked at when one is drawn.
    rungs: Vec<OnceLock<Result<Rung, Error>>>,
    bounds: FootingBounds,
    /// Draws of a variation: one where the actions themselves do not stand on their feet.
    draws: u32,
}

/// The actions as a body of some stature does them, and how its feet answer.
#[derive(Clone, Debug)]
struct Rung {
    parts: Vec<phrase::Part>,
    footholds: Vec<Foothold>,
}

/// A variation.
#[derive(Clone, Debug, PartialEq)]
pub struct Varied {
    /// What is done.
    pub motion: Motion,
    /// Who does it.
    pub body: Proportions,
    /// What became of it.
    pub status: VariationStatus,
    /// Draws before it whose feet did not hold.
    pub rejected: u32,
}

impl Variations {
    /// Looks at the actions of a corpus.
    ///
    /// # Errors
    /// If they cannot be performed.
    pub fn of(corpus: Corpus) -> Result<Self, Error> {
        let Corpus { parts, spread, body, join, .. } = &corpus;
        let bounds = FootingBounds::of(&phrase::performed_by(parts, *join, body)?.motion, body)?;
        // Who hops on the spot for long wanders, since no two hops are alike.
        let goes_round = parts.iter().any(|part| part.action.cyclic.is_some());
        let bounds = if goes_round { bounds.map(FootingBounds::wherever) } else { bounds };
        let draws = if bounds.is_some() { DRAWS } else { 1 };
        // To either side of the body itself; the cast saturates, and not-a-number becomes zero.
        let steps = (spread.stature / RUNG).ceil() as usize;
        let rungs = vec![OnceLock::new(); 2 * steps + 1];
        let made = Self { corpus, rungs, bounds: bounds.unwrap_or_default(), draws };
        made.rung(0.0)?;
        Ok(made)
    }

    /// The actions as a body does them that is about so much taller, as a part of its stature.
    fn rung(&self, taller: f64) -> Result<&Rung, Error> {
        let Corpus { parts, spread, body, .. } = &self.corpus;
        let steps = (self.rungs.len() / 2) as f64;
        let step = if steps > 0.0 { (taller / spread.stature * steps).round() } else { 0.0 };
        let about = || {
            let taller = if steps > 0.0 { step / steps * spread.stature } else { 0.0 };
            let own = body.of_other_stature(body.stature_m() * (1.0 + taller))?;
            let fitted = |part: &phrase::Part| {
                let action = fit(&part.action, body, &own)?;
                Ok(phrase::Part { item: part.item.clone(), action })
            };
            let parts = parts.iter().map(fitted).collect::<Result<Vec<_>, Error>>()?;
            let footholds = parts.iter().map(|part| Foothold::of(part, spread, &own));
            let footholds = footholds.collect::<Result<_, _>>()?;
            Ok(Rung { parts, footholds })
        };
        // From 0 up to twice the steps.
        let rung =
            self.rungs[((step + steps) as usize).min(self.rungs.len() - 1)].get_or_init(about);
        rung.as_ref().map_err(Clone::clone)
    }

    /// Variation number `index`: the first draw whose feet hold, as it is drawn or repaired. If none of
    /// many is, the first of them.
    ///
    /// # Errors
    /// If it cannot be performed.
    pub fn variation(&self, index: u32) -> Result<Varied, Error> {
        let corpus = &self.corpus;
        let mut random = ChaCha8Rng::seed_from_u64(corpus.seed);
        random.set_stream(u64::from(index));
        let taller = around_zero(&mut random, corpus.spread.stature);
        let body = corpus.body.of_other_stature(corpus.body.stature_m() * (1.0 + taller))?;
        let rung = self.rung(taller)?;
        let heading_rad = around_zero(&mut random, corpus.spread.heading_rad);
        let varied = |motion: Motion, status, rejected| Varied {
            motion: motion.facing(heading_rad),
            body,
            status,
            rejected,
        };
        let mut first = None;
        for rejected in 0..self.draws {
            // Seams that pass one another make no action: that draw is thrown away like one whose feet slide.
            let drawn =
                rung.footholds.iter().map(|own| own.draw(&body, &corpus.database, &mut random));
            let Ok(mut steps) = drawn.collect::<Result<Vec<Footstep<'_>>, _>>() else { continue };
            for repair in 0..=REPAIRS + RETREATS {
                let Ok(motion) = self.performed(rung, &steps, &body) else { break };
                if self.bounds.hold(&motion, &body)? {
                    let status = if repair == 0 {
                        VariationStatus::Valid
                    } else {
                        VariationStatus::Repaired
                    };
                    return Ok(varied(motion, status, rejected));
                }
                first.get_or_insert(motion);
                let mut moved = false;
                if repair < REPAIRS {
                    for step in &mut steps {
                        moved |= step.repair().unwrap_or(false);
                    }
                }
                // Where no repair is any better it goes back at once.
                if !moved {
                    for step in &mut steps {
                        moved |= step.retreat(RETREATS_TO).unwrap_or(false);
                    }
                }
                if !moved {
                    break;
                }
            }
        }
        let undrawn =
            || phrase::performed_by(&rung.parts, corpus.join, &body).map(|made| made.motion);
        let motion = first.map_or_else(undrawn, Ok)?;
        Ok(varied(motion, VariationStatus::Implausible, self.draws))
    }

    fn performed(
        &self,
        rung: &Rung,
        steps: &[Footstep<'_>],
        body: &Proportions,
    ) -> Result<Motion, Error> {
        let parts = rung
            .parts
            .iter()
            .zip(steps)
            .map(|(part, step)| phrase::Part { item: part.item.clone(), action: step.action() });
        Ok(phrase::performed_by(&parts.collect::<Vec<_>>(), self.corpus.join, body)?.motion)
    }

    /// Variations `from..to` as columns.
    ///
    /// # Errors
    /// If one cannot be performed or has too many poses.
    pub fn batch(&self, from: u32, to: u32) -> Result<Batch, Error> {
        let mut batch = Batch::default();
        if self.corpus.has_points {
            batch.points_m.resize(frames::POINTS * 3, Vec::new());
        }
        for index in from..to {
            let Varied { motion, body, status, rejected } = self.variation(index)?;
            let frames = frames::frames(&motion, &body, self.corpus.rate_hz)?;
            // There are at most a hundred million; the cast cannot wrap.
            let number = index as i32;
            let stature_m = body.stature_m();
            batch.push(number, stature_m, &frames, self.corpus.rate_hz);
            batch.rows.push(VariationRow {
                number,
                status,
                rejected,
                stature_m,
                duration_s: motion.duration_s(),
                poses: frames.len(),
            });
            batch.pieces.push(number, &motion);
        }
        Ok(batch)
    }
}

impl Corpus {
    /// The actions as they are called, without how long they last: `walk,wave-r`.
    #[must_use]
    pub fn class(&self) -> String {
        phrase::class(&self.parts)
    }

    /// Rounds of all its actions.
    #[must_use]
    pub fn rounds(&self) -> u32 {
        let rounds = self.parts.iter().map(|part| part.item.timed(&part.action).1);
        rounds.fold(0, u32::saturating_add)
    }
}

impl Batch {
    fn push(&mut self, number: i32, stature_m: f64, frames: &[CorpusPose], rate_hz: f64) {
        self.stature_m.resize(self.stature_m.len() + frames.len(), stature_m as f32);
        self.variation.resize(self.variation.len() + frames.len(), number);
        self.time_s.extend((0..frames.len()).map(|pose| (pose as f64 / rate_hz) as f32));
        for (dof, column) in self.angles_rad.iter_mut().enumerate() {
            column.extend(frames.iter().map(|frame| frame.angles.0[dof] as f32));
        }
        for (axis, column) in self.root_m.iter_mut().enumerate() {
            column.extend(frames.iter().map(|frame| frame.root_m[axis] as f32));
        }
        for (index, column) in self.pelvis.iter_mut().enumerate() {
            let turned = frames.iter().map(|frame| frame.pelvis);
            column.extend(turned.map(|q| [q.w, q.x, q.y, q.z][index] as f32));
        }
        for (sole, column) in self.carries.iter_mut().enumerate() {
            column.extend(frames.iter().map(|frame| frame.carries[sole]));
        }
        if !self.points_m.is_empty() {
            for frame in frames {
                let axes = frame.points_m().into_iter().flat_map(|at| at.to_array());
                for (column, value_m) in self.points_m.iter_mut().zip(axes) {
                    column.push(((value_m / POINT_STEP_M).round() * POINT_STEP_M) as f32);
                }
            }
        }
    }
}

impl Pieces {
    fn push(&mut self, variation: i32, motion: &Motion) {
        for dof in Dof::ALL {
            for piece in motion.track(dof).actionlets() {
                let (shape, peak, samples) = match piece.shape() {
                    _ if piece.is_rest() => (0, f64::NAN, &[][..]),
                    Shape::HalfSine(peak_at) => (1, peak_at.value(), &[][..]),
                    Shape::MinimumJerk => (2, f64::NAN, &[][..]),
                    Shape::Sampled(sampled) => (3, f64::NAN, sampled.velocities()),
                };
                self.variation.push(variation);
                self.dof.push(dof.index() as i32);
                self.shape.push(shape);
                self.begin_s.push(piece.begin_s());
                self.duration_s.push(piece.duration_s());
                self.from_rad.push(piece.from_rad());
                self.to_rad.push(piece.to_rad());
                self.peak.push(peak);
                self.sample_count.push(samples.len());
                self.samples.extend_from_slice(samples);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::actionlet::Sampled;
    use std::sync::Arc;

    fn corpus(seed: u64) -> Corpus {
        Corpus {
            label: "run".to_owned(),
            parts: phrase::load("run:x2").unwrap(),
            join: Join::Transition,
            spread: Spread::default(),
            database: Database::shipped().unwrap(),
            seed,
            rate_hz: 60.0,
            body: Proportions::of_stature(1.75).unwrap(),
            has_points: false,
        }
    }

    #[test]
    fn a_variation_does_not_depend_on_what_was_made_before() {
        let corpus = Variations::of(corpus(7)).unwrap();
        let other = Variations::of(self::corpus(8)).unwrap();
        let (whole, tail) = (corpus.batch(0, 6).unwrap(), corpus.batch(4, 6).unwrap());
        let skip = whole.variation.iter().position(|number| *number == 4).unwrap();
        assert_eq!(whole.angles_rad[20][skip..], tail.angles_rad[20]);
        assert_eq!(whole.time_s[skip..], tail.time_s);
        assert_ne!(corpus.variation(0).unwrap(), corpus.variation(1).unwrap());
        assert_ne!(corpus.variation(0).unwrap(), other.variation(0).unwrap());
    }

    #[test]
    fn the_parameters_make_the_poses_again() {
        let mut corpus = corpus(1);
        // A knee that is late: of a kind a capture may have.
        let sampled = Shape::Sampled(Arc::new(Sampled::through(&[0.0, 1.0, 4.0, 0.0]).unwrap()));
        for turn in &mut corpus.parts[0].action.waveforms[0] {
            turn.shape = sampled.clone();
        }
        let batch = Variations::of(corpus).unwrap().batch(3, 4).unwrap();
        let pieces = &batch.pieces;
        assert!(pieces.shape.contains(&3));
        for (pose, time_s) in batch.time_s.iter().enumerate() {
            let time_s = f64::from(*time_s);
            for dof in Dof::ALL {
                let of = |i: &usize| pieces.dof[*i] == dof.index() as i32;
                let around = |i: &usize| {
                    let end_s = pieces.begin_s[*i] + pieces.duration_s[*i];
                    pieces.begin_s[*i] - 1e-6 <= time_s && time_s <= end_s + 1e-6
                };
                let at = (0..pieces.dof.len()).filter(of).find(around).unwrap();
                let u = ((time_s - pieces.begin_s[at]) / pieces.duration_s[at]).clamp(0.0, 1.0);
                let progress = match pieces.shape[at] {
                    0 => 0.0,
                    1 => Shape::half_sine(pieces.peak[at]).unwrap().progress(u)[0],
                    2 => Shape::MinimumJerk.progress(u)[0],
                    _ => {
                        let from: usize = pieces.sample_count[..at].iter().sum();
                        let samples = &pieces.samples[from..from + pieces.sample_count[at]];
                        Sampled::through(samples).unwrap().raw(u)[0]
                    }
                };
                let change = pieces.to_rad[at] - pieces.from_rad[at];
                let expected = pieces.from_rad[at] + change * progress;
                let got = f64::from(batch.angles_rad[dof.index()][pose]);
                assert!((got - expected).abs() < 1e-5, "{dof:?} at {time_s}: {got} {expected}");
            }
        }
    }
}
