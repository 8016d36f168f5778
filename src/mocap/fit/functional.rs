//! Where hips are, from a trial in which a leg swings: every marker of the thigh stays on a sphere about the hip joint, as
//! the pelvis sees it. The spheres with one middle are first laid by algebra (Gamage and Lasenby, "New least squares
//! solutions for estimating the average centre of rotation and the axis of rotation", Journal of Biomechanics 35, 2002),
//! which noise draws towards the markers (Halvorsen, "Bias compensated least squares estimate of the center of
//! rotation", Journal of Biomechanics 36, 2003); so the distances themselves are then made small (Gauss and Newton).

use super::FitSettings;
use super::centres::{HipBy, Measures, Side, hip, pelvis};
use super::marker_set::{Labelled, MarkerPlace};
use crate::error::{Error, ErrorKind, counted};
use crate::mocap::markers::Markers;
use glam::DVec3;
use nalgebra::{Matrix3, Vector3};

/// Steps of Gauss and Newton.
const ROUNDS: usize = 20;
/// A residual that halves a sample's weight, m: as where segments are laid over markers.
const DOUBT_M: f64 = 0.02;
/// How far the thigh must swing in its lesser direction, as the standard deviation of where it points, rad. An arc of 15
/// degrees to each side has 0.18. Ours.
const LEAST_SPREAD_RAD: f64 = 0.08;
/// Farther than this from where its width puts the hip in the pelvis (Bell et al. 1990) it is no hip, m. Ours: the
/// regression's own error is some 3 cm at most.
const MOST_OFF_M: f64 = 0.08;
/// Least samples of a marker.
const LEAST_SAMPLES: usize = 50;

/// A hip joint that was found from how the thigh moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FunctionalHip {
    /// Its side.
    pub side: Side,
    /// In the frame of [`pelvis`], m.
    pub centre_m: DVec3,
    /// Root mean square distance of the markers from their spheres, m.
    pub residual_m: f64,
    /// How far the thigh swings in its lesser direction, rad (standard deviation).
    pub spread_rad: f64,
    /// Frames that were used.
    pub frames: usize,
}

impl FunctionalHip {
    /// A line of words about it.
    #[must_use]
    pub fn words(&self) -> String {
        format!(
            "{} hip found from motion: {}, markers {:.1} mm off their spheres, swinging {:.0} deg \
             (standard deviation) in the lesser direction",
            self.side.of("left", "right"),
            counted(self.frames, "frame"),
            self.residual_m * 1e3,
            self.spread_rad.to_degrees()
        )
    }
}

/// The hips of a trial that shows them.
///
/// # Errors
/// No marker set that matches; or if the trial shows none: thighs that hardly swing, or in one direction alone.
pub fn hips(motion: &Markers, settings: &FitSettings) -> Result<Vec<FunctionalHip>, Error> {
    let labelled = Labelled::find(motion.head(), &settings.sets, settings.subject.as_deref())?;
    let tried = Side::BOTH.map(|side| found(motion, &labelled, side));
    if tried.iter().any(Result::is_ok) {
        return Ok(tried.into_iter().flatten().collect());
    }
    let why: Vec<String> = tried.into_iter().filter_map(Result::err).collect();
    Err(Error::of(ErrorKind::Refused, "no hip joint can be found from this motion")
        .got(why.join("; "))
        .allowed(format!(
            "a thigh that swings by {:.0} degrees (standard deviation) forwards and back and to the side",
            LEAST_SPREAD_RAD.to_degrees()
        ))
        .remedy("swing the leg forwards, sideways and around, the pelvis seen all the time"))
}

fn found(motion: &Markers, labelled: &Labelled, side: Side) -> Result<FunctionalHip, String> {
    let name = side.of("left", "right");
    let places =
        side.of([MarkerPlace::LTHI, MarkerPlace::LKNE], [MarkerPlace::RTHI, MarkerPlace::RKNE]);
    let mut seen_of = [Vec::new(), Vec::new()];
    // Sum of where the width of the pelvis puts the hip, and of how many frames.
    let (mut usual, mut frames) = (DVec3::ZERO, 0_usize);
    for frame in 0..motion.head().frames {
        let seen = labelled.seen(motion, frame);
        let Some(lie) = pelvis(&seen) else { continue };
        let Some(bell) = hip(&seen, side, &Measures::default(), HipBy::Bell) else { continue };
        for (all, place) in seen_of.iter_mut().zip(places) {
            all.extend(seen[place as usize].map(|place| lie.own(place)));
        }
        usual += bell;
        frames += 1;
    }
    let clouds: Vec<Vec<DVec3>> =
        seen_of.into_iter().filter(|all| all.len() >= LEAST_SAMPLES).collect();
    if clouds.is_empty() {
        return Err(format!(
            "{name}: pelvis and thigh are seen together in {frames}",
            frames = counted(frames, "frame")
        ));
    }
    usual /= frames as f64;
    let (centre_m, residual_m) =
        middle(&clouds).ok_or_else(|| format!("{name}: the thigh does not move"))?;
    let spread_rad = clouds.iter().map(|cloud| spread(cloud, centre_m)).fold(0.0, f64::max);
    if !(spread_rad >= LEAST_SPREAD_RAD) {
        return Err(format!("{name}: {:.1} degrees", spread_rad.to_degrees()));
    }
    let off_m = centre_m.distance(usual);
    if !(off_m <= MOST_OFF_M) {
        return Err(format!(
            "{name}: {:.0} mm from where the width of the pelvis puts the hip",
            off_m * 1e3
        ));
    }
    Ok(FunctionalHip { side, centre_m, residual_m, spread_rad, frames })
}

/// The one middle of spheres that clouds of points lie on, and the root mean square distance from them.
fn middle(clouds: &[Vec<DVec3>]) -> Option<(DVec3, f64)> {
    let (mut left, mut right) = (Matrix3::zeros(), Vector3::zeros());
    for cloud in clouds {
        let count = cloud.len() as f64;
        let mean = cloud.iter().sum::<DVec3>() / count;
        let square = cloud.iter().map(|at| at.length_squared()).sum::<f64>() / count;
        for at in cloud {
            let off = vector(*at - mean);
            left += off * off.transpose() / count;
            right += off * ((at.length_squared() - square) / (2.0 * count));
        }
    }
    let mut centre = left.cholesky()?.solve(&right);
    let mut rms = 0.0;
    for _ in 0..ROUNDS {
        let (mut left, mut right) = (Matrix3::zeros(), Vector3::zeros());
        let (mut sum, mut count) = (0.0, 0.0);
        for cloud in clouds {
            let at = DVec3::new(centre.x, centre.y, centre.z);
            let ways: Vec<(Vector3<f64>, f64)> = cloud
                .iter()
                .filter_map(|of| {
                    let way = *of - at;
                    Some((vector(way.try_normalize()?), way.length()))
                })
                .collect();
            let mut lengths: Vec<f64> = ways.iter().map(|(_, length)| *length).collect();
            lengths.sort_by(f64::total_cmp);
            let radius = lengths.get(lengths.len() / 2).copied()?;
            let trust = |length: f64| 1.0 / (1.0 + ((length - radius) / DOUBT_M).powi(2));
            let total: f64 = ways.iter().map(|(_, length)| trust(*length)).sum();
            let weighed = |of: fn(&(Vector3<f64>, f64)) -> Vector3<f64>| {
                ways.iter().map(|way| of(way) * trust(way.1)).sum::<Vector3<f64>>() / total
            };
            let radius =
                ways.iter().map(|(_, length)| length * trust(*length)).sum::<f64>() / total;
            // The radius is what fits best with each middle: it takes the mean way out.
            let mean = weighed(|way| way.0);
            for (way, length) in &ways {
                let (off, turned) = (length - radius, way - mean);
                let weight = 1.0 / (1.0 + (off / DOUBT_M).powi(2));
                left += turned * turned.transpose() * weight;
                right += turned * (off * weight);
                sum += off * off;
                count += 1.0;
            }
        }
        rms = (sum / count).sqrt();
        centre += left.cholesky()?.solve(&right);
    }
    let centre = DVec3::new(centre.x, centre.y, centre.z);
    (centre.is_finite() && rms.is_finite()).then_some((centre, rms))
}

/// How far points swing about a middle in the lesser of two directions, rad (standard deviation).
fn spread(cloud: &[DVec3], centre: DVec3) -> f64 {
    let ways: Vec<Vector3<f64>> =
        cloud.iter().filter_map(|at| Some(vector((*at - centre).try_normalize()?))).collect();
    let count = ways.len().max(1) as f64;
    let mean = ways.iter().sum::<Vector3<f64>>() / count;
    // Across the thigh: what is left of a way without its part along the mean one.
    let Some(along) = mean.try_normalize(f64::EPSILON) else { return 0.0 };
    let across = |way: &Vector3<f64>| way - along * way.dot(&along);
    let scatter: Matrix3<f64> =
        ways.iter().map(|way| across(way) * across(way).transpose()).sum::<Matrix3<f64>>() / count;
    let mut sizes: Vec<f64> = scatter.symmetric_eigenvalues().iter().copied().collect();
    sizes.sort_by(f64::total_cmp);
    // The least is along the thigh, and nothing.
    sizes.get(1).copied().unwrap_or(0.0).max(0.0).sqrt()
}

const fn vector(of: DVec3) -> Vector3<f64> {
    Vector3::new(of.x, of.y, of.z)
}
