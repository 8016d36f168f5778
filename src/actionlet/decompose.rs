//! From a series of angles to the actionlets it is made of.
//!
//! A series that is made of actionlets is cut at its instants of zero velocity, crossings and
//! touches alike. Any other is cut where it pays: of all chains through candidate instants the one
//! with the least squared error plus a price per actionlet is found by dynamic programming, and the
//! price raised as far as the tolerance allows. Either way all seam times, seam angles and peak
//! places are then refined together by least squares.
//!
//! Noise is not fitted. Where it matters, what is asked for is 0.7 of the tolerance and the noise
//! together, since noise takes its own part by what it does to the numbers; cuts are looked for in the smoothed
//! series, and an actionlet must explain more than its three numbers would by chance: no price is below
//! 2 * 3 times the variance of the noise (Akaike, "A new look at the statistical model identification", 1974).
//! Schwarz's price, 3 ln(n), finds fewer actionlets and is further from the motion.

mod noise;
mod refine;
mod seams;

use crate::actionlet::{Actionlet, Sequence, Shape};
use crate::error::Error;
use refine::Knots;

/// Most samples of a series.
pub const MAX_SAMPLES: usize = 2_000_000;
/// Attempts at the price of an actionlet.
const PRICES: u32 = 11;
/// A series is taken to be made of actionlets if they fit it this well, as a part of its range.
const MADE_OF_ACTIONLETS: f64 = 1e-5;
/// One that fits this well may be, but for an end that lies between two samples.
const ALMOST_MADE_OF_ACTIONLETS: f64 = 0.05;
/// Angle changes below this part of the tolerance are rests.
const REST_PART: f64 = 0.25;
/// Noise below this part of the tolerance does not matter.
const NOISE_PART: f64 = 0.3;
/// The part of the tolerance that is asked for beside noise that matters.
const TOLERANCE_PART: f64 = 0.7;
/// Numbers that an actionlet adds to a chain.
const NUMBERS_OF_ONE: f64 = 3.0;

/// A series as actionlets.
#[derive(Clone, Debug, PartialEq)]
pub struct Decomposed {
    /// The actionlets, from 0 s to the last sample. Those that a series is made of end when the last
    /// of them does: within a sample's time of it.
    pub chain: Sequence,
    /// Root mean square of chain minus series, rad.
    pub rms_rad: f64,
    /// Standard deviation of the series' noise, rad: what was not to be fitted. 0 where it does not
    /// matter beside the tolerance.
    pub noise_rad: f64,
}

impl Decomposed {
    /// Numbers that say the chain: the first angle, and per actionlet when it ends, the angle there
    /// and the place of its peak, which a rest does not have. A chain that only rests is its angle.
    #[must_use]
    pub fn numbers(&self) -> usize {
        if self.chain.actionlets().iter().all(Actionlet::is_rest) {
            return 1;
        }
        let of = |piece: &Actionlet| if piece.is_rest() { 2 } else { 3 };
        1 + self.chain.actionlets().iter().map(of).sum::<usize>()
    }
}

/// Decomposes angles, rad, sampled at `rate_hz` into as few actionlets as reproduce them with a
/// root mean square error of `tolerance_rad`; beside noise that matters, as reproduce the motion
/// below it so. If even the finest cut misses the tolerance, that is returned; the error says so.
///
/// # Errors
/// If there are fewer than 3 samples or more than [`MAX_SAMPLES`], one is not finite, or rate or
/// tolerance are not above zero.
pub fn decompose(
    samples_rad: &[f64],
    rate_hz: f64,
    tolerance_rad: f64,
) -> Result<Decomposed, Error> {
    check(samples_rad, rate_hz, tolerance_rad)?;
    let duration_s = (samples_rad.len() - 1) as f64 / rate_hz;
    let mean_rad = samples_rad.iter().sum::<f64>() / samples_rad.len() as f64;
    let series = Series { samples_rad, rate_hz };
    let still = Sequence::starting_at(0.0, mean_rad)?.rest(duration_s)?;
    let still = series.judged(still);
    if still.rms_rad <= tolerance_rad {
        return Ok(still);
    }
    if let Some(found) = series.exact()? {
        return Ok(found);
    }
    let noise_rad = noise::noise(samples_rad);
    if noise_rad > NOISE_PART * tolerance_rad {
        let allowed_rad = (TOLERANCE_PART * tolerance_rad).hypot(noise_rad);
        let found = if still.rms_rad <= allowed_rad {
            still
        } else {
            let price = 2.0 * NUMBERS_OF_ONE * noise_rad * noise_rad;
            let smooth_rad = seams::smoothed(samples_rad, rate_hz)?;
            series.cheapest(&smooth_rad, allowed_rad, price)?.unwrap_or(still)
        };
        return Ok(Decomposed { noise_rad, ..found });
    }
    Ok(series.cheapest(samples_rad, tolerance_rad, 0.0)?.unwrap_or(still))
}

fn check(samples_rad: &[f64], rate_hz: f64, tolerance_rad: f64) -> Result<(), Error> {
    if !(3..=MAX_SAMPLES).contains(&samples_rad.len()) {
        return Err(Error::new("a series has too few or too many samples to decompose")
            .got(samples_rad.len().to_string())
            .allowed(format!("3 to {MAX_SAMPLES}")));
    }
    if let Some(index) = samples_rad.iter().position(|value| !value.is_finite()) {
        return Err(Error::new("a sample is not finite").at(format!("sample {index}")));
    }
    if !(rate_hz.is_normal() && rate_hz > 0.0 && tolerance_rad > 0.0) {
        return Err(Error::new("rate and tolerance must be above zero")
            .got(format!("{rate_hz} Hz, {tolerance_rad} rad")));
    }
    Ok(())
}

/// The angle change below which an actionlet is a rest.
fn rest_below(range_rad: f64, tolerance_rad: f64) -> f64 {
    (REST_PART * tolerance_rad).max(1e-6 * range_rad)
}

struct Series<'a> {
    samples_rad: &'a [f64],
    rate_hz: f64,
}

impl Series<'_> {
    fn judged(&self, chain: Sequence) -> Decomposed {
        let mut again = vec![0.0; self.samples_rad.len()];
        chain.sample_into(self.rate_hz, &mut again);
        let squares: f64 =
            again.iter().zip(self.samples_rad).map(|(got, given)| (got - given).powi(2)).sum();
        let rms_rad = (squares / again.len() as f64).sqrt();
        Decomposed { chain, rms_rad, noise_rad: 0.0 }
    }

    /// Greatest minus least angle, rad.
    fn range_rad(&self) -> f64 {
        let ends = (f64::MAX, f64::MIN);
        let (low, high) = self
            .samples_rad
            .iter()
            .fold(ends, |(low, high), value| (low.min(*value), high.max(*value)));
        high - low
    }

    /// The actionlets that the series is made of, if it is. The last of them need not come to rest at
    /// a sample.
    fn exact(&self) -> Result<Option<Decomposed>, Error> {
        let (samples_rad, rate_hz, range_rad) = (self.samples_rad, self.rate_hz, self.range_rad());
        let Some(instants_s) = seams::instants_of_rest(samples_rad, rate_hz) else {
            return Ok(None);
        };
        let mut knots = Knots::through(samples_rad, rate_hz, &instants_s);
        knots.refine(samples_rad, rate_hz, 60);
        let found = self.judged(knots.chain(rest_below(range_rad, 0.0))?);
        if found.rms_rad <= MADE_OF_ACTIONLETS * range_rad {
            return Ok(Some(found));
        }
        if found.rms_rad > ALMOST_MADE_OF_ACTIONLETS * range_rad {
            return Ok(None);
        }
        let mut knots = Knots::through(samples_rad, rate_hz, &instants_s).with_free_end(rate_hz);
        knots.refine(samples_rad, rate_hz, 60);
        let found = self.judged(knots.chain(rest_below(range_rad, 0.0))?);
        Ok((found.rms_rad <= MADE_OF_ACTIONLETS * range_rad).then_some(found))
    }

    /// The fewest actionlets that keep the root mean square error allowed, none at less than a price
    /// in squared error; else those that come nearest. Cuts are looked for in `rough_rad`.
    fn cheapest(
        &self,
        rough_rad: &[f64],
        allowed_rad: f64,
        least_price: f64,
    ) -> Result<Option<Decomposed>, Error> {
        let (samples_rad, rate_hz) = (self.samples_rad, self.rate_hz);
        let candidates = seams::candidates(rough_rad, rate_hz)?;
        let costs = seams::Costs::between(rough_rad, &candidates);
        let rest_rad = rest_below(self.range_rad(), allowed_rad);
        let mut best: Option<Decomposed> = None;
        // From a price that nothing is worth to one below what the tolerance is worth.
        let worth = allowed_rad * allowed_rad * samples_rad.len() as f64;
        let (mut cheap, mut dear) = ((worth * 1e-5).max(least_price).ln(), (worth * 1e2).ln());
        for attempt in 0..PRICES {
            let price = if attempt == 0 { cheap } else { f64::midpoint(cheap, dear) };
            let cut = costs.cheapest(price.exp());
            let times_s: Vec<f64> = cut.iter().map(|index| *index as f64 / rate_hz).collect();
            let mut knots = Knots::through(rough_rad, rate_hz, &times_s);
            knots.refine(samples_rad, rate_hz, 12);
            let found = self.judged(knots.chain(rest_rad)?);
            let fits = found.rms_rad <= allowed_rad;
            if attempt > 0 {
                if fits { cheap = price } else { dear = price }
            }
            let better =
                best.as_ref().is_none_or(|best| match (fits, best.rms_rad <= allowed_rad) {
                    (true, true) => found.numbers() < best.numbers(),
                    (fits, fitted) => {
                        fits && !fitted || fits == fitted && found.rms_rad < best.rms_rad
                    }
                });
            if better {
                best = Some(found);
            }
        }
        Ok(best)
    }
}

impl Knots {
    /// The chain of these knots; changes below `rest_rad` become rests, neighbours of which merge.
    fn chain(&self, rest_rad: f64) -> Result<Sequence, Error> {
        let mut chain = Sequence::starting_at(0.0, self.angles_rad[0])?;
        let mut resting_s = 0.0;
        for index in 0..self.peaks.len() {
            let duration_s = self.times_s[index + 1] - self.times_s[index];
            let to_rad = self.angles_rad[index + 1];
            if !((to_rad - chain.to_rad()).abs() > rest_rad) {
                resting_s += duration_s;
                continue;
            }
            if resting_s > 0.0 {
                chain = chain.rest(resting_s)?;
                resting_s = 0.0;
            }
            chain = chain.then(duration_s, to_rad, Shape::half_sine(self.peaks[index])?)?;
        }
        if resting_s > 0.0 { chain.rest(resting_s) } else { Ok(chain) }
    }
}

#[cfg(test)]
mod tests;
