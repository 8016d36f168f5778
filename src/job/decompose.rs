//! A captured motion as the actionlets it is made of: an action file, and how good it is.

use super::source;
use crate::action::decompose::{self, DecomposedMotion, Figure};
use crate::action::{Action, file};
use crate::draft;
use crate::error::{Error, ErrorKind};
use serde::Serialize;
use std::path::PathBuf;

/// Degrees of freedom that move less are not counted in the summary, deg.
pub const MOVING_DEG: f64 = 5.0;

/// Which motion, and how well.
#[derive(Clone, Debug, PartialEq)]
pub struct DecomposeOrder {
    /// A capture (.bvh), or an action.
    pub motion: String,
    /// File that says which joint of the capture is which body segment.
    pub mapping: Option<PathBuf>,
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
    /// Root mean square error, deg.
    pub rms_deg: f64,
    /// Actionlets that it is made of.
    pub actionlets: usize,
    /// Numbers that say them.
    pub numbers: usize,
    /// Times fewer numbers than samples at the reference rate.
    pub compression: f64,
}

/// A motion as actionlets, in figures.
#[derive(Clone, Debug, Serialize)]
pub struct DecomposedReport {
    /// `done`.
    pub outcome: &'static str,
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
    /// All that move.
    pub dofs: Vec<DofFigures>,
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

/// Decomposes a motion and writes the action file.
///
/// # Errors
/// If the motion cannot be read, does not move, or the file cannot be written.
pub fn decompose(order: &DecomposeOrder) -> Result<DecomposedReport, Error> {
    check_name(order)?;
    let (capture, _) = source::body_motion(&order.motion, order.mapping.as_deref())?;
    let angles = decompose::angles_of(&capture.poses);
    let tolerance_rad = order.tolerance_deg.to_radians();
    let found = decompose::motion_of(&angles, capture.rate_hz, tolerance_rad)?;
    if found.motion.moving().next().is_none() {
        return Err(Error::new("nothing in this motion moves more than the tolerance")
            .at(order.motion.clone())
            .got(format!("{} deg", order.tolerance_deg))
            .remedy("lower --tolerance"));
    }
    let stem = order.file.file_stem().and_then(|stem| stem.to_str()).unwrap_or("motion");
    let source = format!("gaitway actionlets {}, {} deg", order.motion, order.tolerance_deg);
    let note = format!("{} poses at {} Hz as actionlets", angles.len(), capture.rate_hz);
    let action = Action::of_motion(&action_name(stem), &note, &source, &found.motion);
    let text = action.to_toml()?;
    // What was written must be what was found.
    file::parse(&text, &order.file.display().to_string(), &|_| None)?;
    draft::write_file(&order.file, order.replace, text.as_bytes())?;
    Ok(report(order, capture.rate_hz, &found))
}

/// A file name as an action's name.
fn action_name(stem: &str) -> String {
    let fits = |c: char| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { '-' };
    let name: String = stem.chars().map(fits).collect();
    if name.is_empty() { "motion".to_owned() } else { name }
}

fn report(order: &DecomposeOrder, rate_hz: f64, found: &DecomposedMotion) -> DecomposedReport {
    let moves = |figure: &&Figure| figure.range_rad.to_degrees() > MOVING_DEG;
    let moving: Vec<&Figure> = found.figures.iter().filter(moves).collect();
    let numbers: usize = moving.iter().map(|figure| figure.numbers).sum();
    let mut rms: Vec<f64> = moving.iter().map(|figure| figure.rms_rad.to_degrees()).collect();
    rms.sort_by(f64::total_cmp);
    let duration_s = found.motion.duration_s();
    let samples = duration_s * decompose::REFERENCE_HZ * moving.len() as f64;
    DecomposedReport {
        outcome: "done",
        motion: order.motion.clone(),
        duration_s,
        rate_hz,
        tolerance_deg: order.tolerance_deg,
        moving: moving.len(),
        median_rms_deg: rms.get(rms.len() / 2).copied().unwrap_or(0.0),
        numbers,
        compression: samples / numbers.max(1) as f64,
        dofs: found
            .figures
            .iter()
            .map(|figure| DofFigures {
                name: figure.dof.name(),
                range_deg: figure.range_rad.to_degrees(),
                rms_deg: figure.rms_rad.to_degrees(),
                actionlets: figure.actionlets,
                numbers: figure.numbers,
                compression: figure.compression,
            })
            .collect(),
        written: order.file.display().to_string(),
    }
}
