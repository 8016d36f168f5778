//! A motion as a table: `time_s`, the 22 degrees of freedom by name, rad, and where the root is in
//! the world, m: X forward, Y left, Z up, from [`Motion::placed`].

use crate::action::Motion;
use crate::body::{Dof, Proportions};
use crate::error::{Error, ErrorKind};
use std::fmt::Write;
use std::io;

/// The head of the table.
#[must_use]
pub fn head() -> String {
    let mut head = String::from("time_s");
    for dof in Dof::ALL {
        let _ = write!(head, ",{}_rad", dof.name());
    }
    head + ",root_x_m,root_y_m,root_z_m"
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
    let unwritable =
        |e: io::Error| Error::of(ErrorKind::Io, "cannot write the table").got(e.to_string());
    writeln!(out, "{}", head()).map_err(unwritable)?;
    let mut row = String::new();
    for (index, (angles, root_m)) in motion.placed(body, rate_hz)?.iter().enumerate() {
        row.clear();
        let _ = write!(row, "{:.6}", index as f64 / rate_hz);
        for value in angles.0.into_iter().chain(root_m.to_array()) {
            let _ = write!(row, ",{value:.9}");
        }
        row.push('\n');
        out.write_all(row.as_bytes()).map_err(unwritable)?;
    }
    Ok(())
}
