//! Many variations of an action, reproducible one by one: variation n of a seed is the same
//! whatever was made before it, and by how many threads.

use crate::action::frames::{self, CorpusPoses, VariationStatus};
use crate::action::{Database, Join, Motion, Spread, mutate, phrase};
use crate::actionlet::Shape;
use crate::body::{Dof, Proportions};
use crate::error::Error;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

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

/// A variation as a row.
#[derive(Clone, Debug, PartialEq)]
pub struct VariationRow {
    /// Its number.
    pub number: i32,
    /// What became of it.
    pub status: VariationStatus,
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

impl Corpus {
    /// Variation number `index` as a motion.
    ///
    /// # Errors
    /// If it cannot be performed.
    pub fn variation(&self, index: u32) -> Result<Motion, Error> {
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        random.set_stream(u64::from(index));
        let vary = |part: &phrase::Part| phrase::Part {
            item: part.item.clone(),
            action: mutate(&part.action, &self.spread, &self.database, &mut random),
        };
        let parts: Vec<phrase::Part> = self.parts.iter().map(vary).collect();
        phrase::perform(&parts, self.join)
    }

    /// Variations `from..to` as columns.
    ///
    /// # Errors
    /// If one cannot be performed or has too many poses.
    pub fn batch(&self, from: u32, to: u32) -> Result<Batch, Error> {
        let mut batch = Batch::default();
        if self.has_points {
            batch.points_m.resize(frames::POINTS * 3, Vec::new());
        }
        for index in from..to {
            let motion = self.variation(index)?;
            let made = frames::frames(&motion, &self.body, self.rate_hz)?;
            // There are at most a hundred million; the cast cannot wrap.
            let number = index as i32;
            batch.push(number, &made, self.rate_hz);
            batch.rows.push(VariationRow {
                number,
                status: made.status,
                duration_s: motion.duration_s(),
                poses: made.frames.len(),
            });
            batch.pieces.push(number, &motion);
        }
        Ok(batch)
    }

    /// The actions as they are called, without how long they last: `walk,wave-r`.
    #[must_use]
    pub fn class(&self) -> String {
        let mut class = String::new();
        for part in &self.parts {
            if !class.is_empty() {
                let stops = part.item.follows == phrase::Follows::AtRest;
                class.push(if stops { ',' } else { '+' });
            }
            class += &part.action.name;
        }
        class
    }

    /// Rounds of all its actions.
    #[must_use]
    pub fn rounds(&self) -> u32 {
        let rounds = self.parts.iter().map(|part| part.item.timed(&part.action).1);
        rounds.fold(0, u32::saturating_add)
    }
}

impl Batch {
    fn push(&mut self, number: i32, made: &CorpusPoses, rate_hz: f64) {
        let frames = &made.frames;
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
        let corpus = corpus(7);
        let (whole, tail) = (corpus.batch(0, 6).unwrap(), corpus.batch(4, 6).unwrap());
        let skip = whole.variation.iter().position(|number| *number == 4).unwrap();
        assert_eq!(whole.angles_rad[20][skip..], tail.angles_rad[20]);
        assert_eq!(whole.time_s[skip..], tail.time_s);
        assert_ne!(corpus.variation(0).unwrap(), corpus.variation(1).unwrap());
        assert_ne!(corpus.variation(0).unwrap(), self::corpus(8).variation(0).unwrap());
    }

    #[test]
    fn the_parameters_make_the_poses_again() {
        let mut corpus = corpus(1);
        // A knee that is late: of a kind a capture may have.
        let sampled = Shape::Sampled(Arc::new(Sampled::through(&[0.0, 1.0, 4.0, 0.0]).unwrap()));
        for turn in &mut corpus.parts[0].action.waveforms[0] {
            turn.shape = sampled.clone();
        }
        let batch = corpus.batch(3, 4).unwrap();
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
