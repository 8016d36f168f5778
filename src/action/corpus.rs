//! Many variations of an action, reproducible one by one: variation n of a seed is the same
//! whatever was made before it, and by how many threads.

use crate::action::{Database, Join, Motion, Spread, mutate, phrase};
use crate::actionlet::Shape;
use crate::body::{Dof, Proportions};
use crate::error::Error;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// What to make.
#[derive(Clone, Debug)]
pub struct Corpus {
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
        for index in from..to {
            let motion = self.variation(index)?;
            let placed = motion.placed(&self.body, self.rate_hz)?;
            let poses = placed.len();
            // A file holds at most a million variations; the cast cannot wrap.
            let number = index as i32;
            batch.variation.resize(batch.variation.len() + poses, number);
            batch.time_s.extend((0..poses).map(|pose| (pose as f64 / self.rate_hz) as f32));
            for (dof, column) in batch.angles_rad.iter_mut().enumerate() {
                column.extend(placed.iter().map(|(angles, ..)| angles.0[dof] as f32));
            }
            for (axis, column) in batch.root_m.iter_mut().enumerate() {
                column.extend(placed.iter().map(|(_, _, root_m)| root_m[axis] as f32));
            }
            batch.pieces.push(number, &motion);
        }
        Ok(batch)
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
            parts: phrase::load("run:x2").unwrap(),
            join: Join::Transition,
            spread: Spread::default(),
            database: Database::shipped().unwrap(),
            seed,
            rate_hz: 60.0,
            body: Proportions::of_stature(1.75).unwrap(),
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
