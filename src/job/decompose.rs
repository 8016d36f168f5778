//! A captured motion as the actionlets it is made of: an action file, and how good it is.

use super::report::Outcome;
use super::source;
use crate::action::decompose::{self, DecomposedMotion, Figure};
use crate::action::{Action, file};
use crate::body::{JointAngles, NearSingular, SegmentPose};
use crate::draft;
use crate::error::{Error, ErrorKind};
use crate::job::observer::Observer;
use crate::job::pending::unless_stopped;
use crate::job::report::counted;
use crate::mocap::anatomy::Capture;
use crate::mocap::files::CaptureOptions;
use crate::mocap::siblings::SegmentFrames;
use serde::Serialize;
use std::path::PathBuf;

/// Degrees of freedom that move less are not counted in the summary, deg.
pub const MOVING_DEG: f64 = 5.0;

/// Which motion, and how well.
#[derive(Clone, Debug, PartialEq)]
pub struct DecomposeOrder {
    /// A capture (.bvh, .amc), or an action.
    pub motion: String,
    /// File that says which joint of the capture is which body segment.
    pub mapping: Option<PathBuf>,
    /// What the capture does not say itself.
    pub reading: CaptureOptions,
    /// Root mean square error allowed in every degree of freedom, deg.
    pub tolerance_deg: f64,
    /// Action file to write.
    pub file: PathBuf,
    /// It may replace one that is there.
    pub replace: bool,
}

/// One degree of freedom of a decomposed motion.
#[derive(Clone, Debug, Serialize)]
pub struct DofFigures {
    /// Its name.
    pub name: &'static str,
    /// From its lowest to its highest angle, deg.
    pub range_deg: f64,
    /// Root mean square error against the samples, deg.
    pub rms_deg: f64,
    /// True if that is more than was allowed.
    pub misses_tolerance: bool,
    /// Noise of the samples that was not to be fitted, deg; 0 where it does not matter.
    pub noise_deg: f64,
    /// Actionlets that it is made of.
    pub actionlets: usize,
    /// Numbers that say them.
    pub numbers: usize,
    /// Times fewer numbers than samples at the reference rate.
    pub compression: f64,
}

/// A joint whose flexion and rotation are poorly determined some of the time.
#[derive(Clone, Debug, Serialize)]
pub struct SingularFigures {
    /// Its name.
    pub joint: &'static str,
    /// Share of the poses within 5 deg of its singularity, 0 to 1.
    pub share: f64,
    /// How far its angles are from a pose at most, there or where it would wind otherwise, deg.
    pub off_deg: f64,
}

/// A motion as actionlets, in figures.
#[derive(Clone, Debug, Serialize)]
pub struct DecomposedReport {
    /// Done with loss if a degree of freedom misses the tolerance.
    pub outcome: Outcome,
    /// What was decomposed.
    pub motion: String,
    /// Length, s.
    pub duration_s: f64,
    /// Poses per second.
    pub rate_hz: f64,
    /// Root mean square error that was allowed, deg.
    pub tolerance_deg: f64,
    /// Degrees of freedom that move more than [`MOVING_DEG`].
    pub moving: usize,
    /// Of those, deg.
    pub median_rms_deg: f64,
    /// Numbers that say them.
    pub numbers: usize,
    /// Times fewer numbers than samples at the reference rate.
    pub compression: f64,
    /// Farthest that the pelvis leans against the vertical, deg. An action does not hold it: its pelvis
    /// is upright.
    pub pelvis_lean_lost_deg: f64,
    /// What the segment frames of a capture were found from; null for an action.
    pub segment_frames: Option<SegmentFrames>,
    /// All degrees of freedom.
    pub dofs: Vec<DofFigures>,
    /// Those joints whose angles are drawn some of the time.
    pub near_singular: Vec<SingularFigures>,
    /// The action file.
    pub written: String,
}

/// Checks the name of the action file.
///
/// # Errors
/// Another ending than `.toml`.
pub fn check_name(order: &DecomposeOrder) -> Result<(), Error> {
    if order.file.extension().is_some_and(|e| e == "toml") {
        return Ok(());
    }
    Err(Error::of(ErrorKind::Unknown, "this kind of file cannot be written")
        .at("-o")
        .got(order.file.display().to_string())
        .allowed("a name that ends in .toml"))
}

/// Decomposes a motion and writes the action file, also if it misses the tolerance.
///
/// # Errors
/// If the motion cannot be read, does not move, or the file cannot be written; a wish to stop.
pub fn decompose(
    order: &DecomposeOrder,
    observer: &dyn Observer,
) -> Result<DecomposedReport, Error> {
    check_name(order)?;
    let of = order.clone();
    let (report, text) = unless_stopped(observer, move || made(&of))?;
    draft::write_file(&order.file, order.replace, text.as_bytes())?;
    Ok(report)
}

/// What is to be said of it, and the action file.
fn made(order: &DecomposeOrder) -> Result<(DecomposedReport, String), Error> {
    let (capture, origin) =
        source::body_motion(&order.motion, order.mapping.as_deref(), &order.reading)?;
    let series = JointAngles::of_clip(&capture.poses, capture.rate_hz);
    let tolerance_rad = order.tolerance_deg.to_radians();
    let found = decompose::motion_of(&series.angles, capture.rate_hz, tolerance_rad)?;
    if found.motion.moving().next().is_none() {
        return Err(Error::new("nothing in this motion moves more than the tolerance")
            .at(order.motion.clone())
            .got(format!("{} deg", order.tolerance_deg))
            .remedy("lower --tolerance"));
    }
    let stem = order.file.file_stem().and_then(|stem| stem.to_str()).unwrap_or("motion");
    let source = format!("gaitway actionlets {}, {} deg", order.motion, order.tolerance_deg);
    let note =
        format!("{} at {} Hz as actionlets", counted(series.angles.len(), "pose"), capture.rate_hz);
    let action = Action::of_motion(&action_name(stem), &note, &source, &found.motion);
    let text = action.to_toml()?;
    // What was written must be what was found.
    file::parse(&text, &order.file.display().to_string(), &|_| None)?;
    let report = report(order, &capture, origin.segment_frames, &found, &series.near_singular);
    Ok((report, text))
}

/// A file name as an action's name.
fn action_name(stem: &str) -> String {
    let fits = |c: char| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { '-' };
    let name: String = stem.chars().map(fits).collect();
    if name.is_empty() { "motion".to_owned() } else { name }
}

fn report(
    order: &DecomposeOrder,
    capture: &Capture,
    segment_frames: Option<SegmentFrames>,
    found: &DecomposedMotion,
    near_singular: &[NearSingular],
) -> DecomposedReport {
    let misses = |figure: &Figure| figure.rms_rad.to_degrees() > order.tolerance_deg;
    let leans_rad = capture.poses.iter().map(SegmentPose::pelvis_lean_rad);
    let moves = |figure: &&Figure| figure.range_rad.to_degrees() > MOVING_DEG;
    let moving: Vec<&Figure> = found.figures.iter().filter(moves).collect();
    let numbers: usize = moving.iter().map(|figure| figure.numbers).sum();
    let mut rms: Vec<f64> = moving.iter().map(|figure| figure.rms_rad.to_degrees()).collect();
    rms.sort_by(f64::total_cmp);
    let duration_s = found.motion.duration_s();
    let samples = duration_s * decompose::REFERENCE_HZ * moving.len() as f64;
    DecomposedReport {
        outcome: if found.figures.iter().any(misses) {
            Outcome::DoneWithLoss
        } else {
            Outcome::Done
        },
        motion: order.motion.clone(),
        duration_s,
        rate_hz: capture.rate_hz,
        tolerance_deg: order.tolerance_deg,
        moving: moving.len(),
        median_rms_deg: rms.get(rms.len() / 2).copied().unwrap_or(0.0),
        numbers,
        compression: samples / numbers.max(1) as f64,
        pelvis_lean_lost_deg: leans_rad.fold(0.0, f64::max).to_degrees(),
        segment_frames,
        dofs: found
            .figures
            .iter()
            .map(|figure| DofFigures {
                name: figure.dof.name(),
                range_deg: figure.range_rad.to_degrees(),
                rms_deg: figure.rms_rad.to_degrees(),
                misses_tolerance: misses(figure),
                noise_deg: figure.noise_rad.to_degrees(),
                actionlets: figure.actionlets,
                numbers: figure.numbers,
                compression: figure.compression,
            })
            .collect(),
        near_singular: near_singular
            .iter()
            .filter(|near| near.share > 0.0 || near.off_rad > 0.0)
            .map(|near| SingularFigures {
                joint: near.joint.name(),
                share: near.share,
                off_deg: near.off_rad.to_degrees(),
            })
            .collect(),
        written: order.file.display().to_string(),
    }
}
