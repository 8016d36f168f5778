//! A motion slowed down where it must be, and not everywhere.

use super::path::Path;
use crate::error::Error;

/// Pace comes and goes over this time of the motion before and after what asks for it, s.
const AROUND_S: f64 = 0.3;
/// How often what is still too fast is slowed.
const ROUNDS: usize = 12;
/// What is too fast by less is left to the stretch of the whole motion.
const NEARLY: f64 = 1.02;

/// At which times of a path, in samples and one step of it after another, nothing asks for more time any longer (but for a hair), with
/// the least delay; none if nothing does anyway, or if nothing is gained over stretching all of it. `needs` says of a path, by
/// sample, how many times as long it would have to take there, by itself.
///
/// # Errors
/// None that is known: of a spline.
pub fn in_parts(path: &Path, needs: impl Fn(&Path) -> Vec<f64>) -> Result<Option<Vec<f64>>, Error> {
    let asked = too_fast(&needs(path));
    let worst = asked.iter().copied().fold(0.0, f64::max).exp();
    if worst <= 1.0 || !worst.is_finite() {
        return Ok(None);
    }
    let reach = (AROUND_S / path.step_s()) as usize;
    let mut pace = around(&asked, reach);
    let mut best: Option<(f64, Vec<f64>)> = None;
    for _ in 0..ROUNDS {
        let times = clock(&pace);
        let series = path.splines().iter().map(|spline| {
            times.iter().map(|time| spline.sample(time * path.step_s())[0]).collect()
        });
        let slowed = Path::new(path.joints().to_vec(), 1.0 / path.step_s(), series.collect())?;
        let left = too_fast(&needs(&slowed));
        let over = left.iter().copied().fold(0.0, f64::max).exp();
        let takes = over * (times.len() - 1) as f64;
        let mut asked = vec![0.0_f64; pace.len()];
        for (time, left) in times.iter().zip(&left) {
            let at = (time.round() as usize).min(asked.len() - 1);
            asked[at] = asked[at].max(*left);
        }
        if best.as_ref().is_none_or(|(least, _)| takes < *least) {
            best = Some((takes, times));
        }
        if over < NEARLY {
            break;
        }
        let more = around(&asked, reach);
        pace.iter_mut().zip(more).for_each(|(pace, more)| *pace += more);
    }
    let whole = worst * (pace.len() - 1) as f64;
    Ok(best.filter(|(takes, _)| *takes < whole).map(|(_, times)| times))
}

/// By sample, the logarithm of how many times as long it would have to take.
fn too_fast(needs: &[f64]) -> Vec<f64> {
    needs.iter().map(|factor| factor.max(1.0).ln()).collect()
}

/// The highest of what is asked for at each sample, fading to both sides.
fn around(asked: &[f64], reach: usize) -> Vec<f64> {
    let mut all = vec![0.0_f64; asked.len()];
    for (at, asked) in asked.iter().enumerate().filter(|(_, asked)| **asked > 0.0) {
        let (from, to) = (at.saturating_sub(reach), (at + reach + 1).min(all.len()));
        for (near, value) in all[from..to].iter_mut().enumerate() {
            let part = (from + near).abs_diff(at) as f64 / (reach + 1) as f64;
            let share = (core::f64::consts::FRAC_PI_2 * part).cos().powi(2);
            *value = value.max(asked * share);
        }
    }
    all
}

/// Even times of a motion of this pace, by sample as a logarithm: the first and the last are its ends.
fn clock(pace: &[f64]) -> Vec<f64> {
    let last = pace.len().saturating_sub(1);
    let mut reached = vec![0.0];
    for two in pace.windows(2) {
        reached.push(reached[reached.len() - 1] + 0.5 * (two[0].exp() + two[1].exp()));
    }
    let count = reached[last].ceil().max(1.0);
    let mut at = 0;
    (0..=count as usize)
        .map(|tick| {
            let wanted = reached[last] * tick as f64 / count;
            while at + 1 < last && reached[at + 1] < wanted {
                at += 1;
            }
            let next = (at + 1).min(last);
            let lasts = reached[next] - reached[at];
            let share = if lasts > 0.0 { (wanted - reached[at]) / lasts } else { 0.0 };
            (at as f64 + share).clamp(0.0, last as f64)
        })
        .collect()
}
