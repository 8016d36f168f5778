//! Angles as a table: `time_s` and the 22 degrees of freedom by name, rad.

use crate::action::Motion;
use crate::body::Dof;
use crate::error::Error;
use std::fmt::Write;
use std::io;

/// The head of the table.
#[must_use]
pub fn head() -> String {
    let mut head = String::from("time_s");
    for dof in Dof::ALL {
        let _ = write!(head, ",{}_rad", dof.name());
    }
    head
}

/// Writes a motion, a row per sample.
///
/// # Errors
/// If the rate is out of range, or the table cannot be written.
pub fn write_csv(motion: &Motion, rate_hz: f64, out: &mut impl io::Write) -> Result<(), Error> {
    let unwritable = |e: io::Error| Error::new("cannot write the table").got(e.to_string());
    writeln!(out, "{}", head()).map_err(unwritable)?;
    let mut row = String::new();
    for (index, angles) in motion.sampled(rate_hz)?.iter().enumerate() {
        row.clear();
        let _ = write!(row, "{:.6}", index as f64 / rate_hz);
        for angle_rad in angles.0 {
            let _ = write!(row, ",{angle_rad:.9}");
        }
        row.push('\n');
        out.write_all(row.as_bytes()).map_err(unwritable)?;
    }
    Ok(())
}
