//! A motion as a table: `time_s`, the 22 degrees of freedom by name, rad, and where the root is in
//! the world, m: X forward, Y left, Z up, and how the pelvis is turned, rad, from [`Motion::placed`].

use crate::action::Motion;
use crate::body::{Dof, JointAngles, PelvisAngles, Proportions};
use crate::error::Error;
use crate::table::TableWriter;
use glam::{DQuat, DVec3};
use std::io;

/// The titles of the table.
pub fn titles() -> impl Iterator<Item = String> {
    let root = ["root_x_m", "root_y_m", "root_z_m"].map(str::to_owned);
    let angles = Dof::ALL.iter().map(|dof| format!("{}_rad", dof.name()));
    std::iter::once("time_s".to_owned()).chain(angles).chain(root)
}

/// The cells of pose number `index` of a motion at `rate_hz`.
pub fn cells(
    index: usize,
    rate_hz: f64,
    angles: &JointAngles,
    root_m: DVec3,
) -> impl Iterator<Item = String> {
    let values = angles.0.into_iter().chain(root_m.to_array());
    let values = values.map(|value| format!("{value:.9}"));
    std::iter::once(format!("{:.6}", index as f64 / rate_hz)).chain(values)
}

/// The titles of the columns that say how the pelvis is turned.
pub fn pelvis_titles() -> impl Iterator<Item = String> {
    PelvisAngles::NAMES.iter().map(|name| format!("{name}_rad"))
}

/// The cells of these columns.
pub fn pelvis_cells(orientation: DQuat) -> impl Iterator<Item = String> {
    PelvisAngles::of(orientation).to_array().into_iter().map(|value| format!("{value:.9}"))
}

/// Writes a motion of a body with these proportions, a row per sample.
///
/// # Errors
/// If the rate is out of range, or the table cannot be written.
pub fn write_csv(
    motion: &Motion,
    body: &Proportions,
    rate_hz: f64,
    out: &mut impl io::Write,
) -> Result<(), Error> {
    let mut table = TableWriter::new(out);
    table.row(titles().chain(pelvis_titles()))?;
    for (index, (angles, pelvis, root_m)) in motion.placed(body, rate_hz)?.iter().enumerate() {
        table.row(cells(index, rate_hz, angles, *root_m).chain(pelvis_cells(*pelvis)))?;
    }
    table.finish().map(drop)
}
