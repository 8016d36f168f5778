//! Rows of a table of markers have even times: a hole in them is rows that are missing, and frames that are not there
//! would move all that comes later.

use crate::error::{Error, ErrorKind};

/// A step between rows that is longer than this many usual ones is a hole.
const HOLE: f64 = 1.5;

/// Fails if rows are missing between these times, s, each with the line it stands in.
///
/// # Errors
/// The first hole.
pub(super) fn check(times: &[(u64, f64)]) -> Result<(), Error> {
    let mut steps_s: Vec<f64> = times.windows(2).map(|pair| pair[1].1 - pair[0].1).collect();
    steps_s.sort_by(f64::total_cmp);
    // Times that are rounded do not go on at each row, or further at some: the long ones of the usual steps.
    let Some(usual_s) = steps_s.get(steps_s.len() * 9 / 10).copied() else { return Ok(()) };
    let is_hole = |pair: &&[(u64, f64)]| pair[1].1 - pair[0].1 > HOLE * usual_s;
    let Some([(_, from_s), (line, to_s)]) = times.windows(2).find(is_hole) else { return Ok(()) };
    Err(Error::of(ErrorKind::Malformed, "rows are missing")
        .at(format!("line {line}"))
        .got(format!("time goes from {from_s} s to {to_s} s"))
        .allowed(format!("even times, here {usual_s:.6} s apart"))
        .remedy("add the rows, with nothing in the cells of markers that were not seen, or cut the table there"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hole_is_named_and_times_that_are_rounded_are_none() {
        let times = |hole_s: f64| -> Vec<(u64, f64)> {
            let time_s = |row: u32| (f64::from(row) * 100.0 / 119.88).round() / 100.0;
            let late_s = |row: u32| if row > 20 { hole_s } else { 0.0 };
            (0..50).map(|row| (u64::from(row) + 2, time_s(row) + late_s(row))).collect()
        };
        // Hundredths of a second at 119.88 Hz: steps of one, or of none.
        assert!(check(&times(0.0)).is_ok());
        let said = check(&times(0.5)).expect_err("a hole").to_string();
        assert!(said.contains("line 23") && said.contains("rows are missing"), "{said}");
        // One row of a hundred.
        let one: Vec<(u64, f64)> = (0..100_u32)
            .filter(|row| *row != 40)
            .map(|row| (u64::from(row), f64::from(row) / 240.0))
            .collect();
        assert!(check(&one).expect_err("a hole").to_string().contains("line 41"));
        let coarse: Vec<(u64, f64)> = (0..100_u32)
            .map(|row| (u64::from(row), (f64::from(row) / 2.4).round() / 100.0))
            .collect();
        assert!(check(&coarse).is_ok());
        assert!(check(&[]).is_ok() && check(&[(2, 0.0)]).is_ok());
    }
}
