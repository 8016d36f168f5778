//! A motion as a table: `time_s`, the 22 degrees of freedom by name, rad, and where the root is in
//! the world, m: X forward, Y left, Z up, and how the pelvis is turned, rad, from [`Motion::placed`].

use crate::action::Motion;
use crate::actionlet::key_frames;
use crate::body::{Dof, JointAngles, PelvisAngles, Proportions};
use crate::error::{Error, ErrorKind, counted};
use crate::table::{Row, TableWriter, rows};
use glam::{DQuat, DVec3};
use std::io;

/// Most rows that become poses of a body: nearly three hours at 100 per second.
const MAX_POSES: usize = 1_000_000;
/// What numbers may take beside three times the table, bytes.
const SPARE_BYTES: usize = 4 << 20;
/// Times are even if each is this part of a step at most from where it should be: they are written in so many digits.
const UNEVEN: f64 = 0.5;
/// Further than this no joint turns, rad: angles beyond are degrees by mistake. It is twice around.
const MOST_RAD: f64 = 4.0 * std::f64::consts::PI;
/// Further than this nobody turns around and nobody goes, rad and m.
const MOST: f64 = 1e5;
const ROOT: [&str; 3] = ["root_x_m", "root_y_m", "root_z_m"];
const SHAPE: &str = "time_s, then columns called by degrees of freedom of the body (left_elbow_flexion_rad, or _deg), \
                     and if known root_x_m, root_y_m, root_z_m, pelvis_rotation_rad, pelvis_obliquity_rad, \
                     pelvis_tilt_rad";

/// The titles of the table.
pub fn titles() -> impl Iterator<Item = String> {
    let root = ROOT.map(str::to_owned);
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

/// A table of joint angles that was read.
#[derive(Clone, Debug, PartialEq)]
pub struct AnglesTable {
    /// Rows per second.
    pub rate_hz: f64,
    /// Angles, row by row; those without a column are zero.
    pub angles: Vec<JointAngles>,
    /// Where the root is in the world, m, row by row; empty if the table does not say.
    pub roots_m: Vec<DVec3>,
    /// How the pelvis is turned in the world, row by row; empty if the table does not say.
    pub pelvis: Vec<DQuat>,
    /// Degrees of freedom that have a column.
    pub said: Vec<Dof>,
    /// Whether angles are in degrees.
    pub in_degrees: bool,
    /// What was left out.
    pub notes: Vec<String>,
}

/// What a column is.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Column {
    Time,
    Angle(usize),
    Pelvis(usize),
    Root(usize),
    Other,
}

impl Column {
    /// What a title says, and whether that is in degrees.
    fn of(title: &str) -> (Self, bool) {
        let (name, is_deg) = match title.strip_suffix("_deg") {
            Some(name) => (name, true),
            None => (title.strip_suffix("_rad").unwrap_or(""), false),
        };
        let place = |names: &[&str], of: &str| names.iter().position(|one| *one == of);
        let column = if title == "time_s" {
            Self::Time
        } else if let Some(axis) = place(&ROOT, title) {
            Self::Root(axis)
        } else if let Some(angle) = place(&PelvisAngles::NAMES, name) {
            Self::Pelvis(angle)
        } else if let Some(dof) = Dof::ALL.iter().position(|dof| dof.name() == name) {
            Self::Angle(dof)
        } else {
            Self::Other
        };
        (column, is_deg && matches!(column, Self::Pelvis(_) | Self::Angle(_)))
    }
}

/// True if a table with these titles is one of joint angles of the body: it has times and at least one of them, and no angle
/// of any other joint.
#[must_use]
pub fn is_of_body(titles: &str) -> bool {
    let first = titles.lines().next().unwrap_or_default().trim_start_matches('\u{feff}');
    let titles = || first.split(',').map(|title| title.trim().trim_matches('"'));
    let is_strange = |title: &str| {
        Column::of(title).0 == Column::Other && (title.ends_with("_rad") || title.ends_with("_deg"))
    };
    titles().any(|title| title == "time_s")
        && titles().any(|title| matches!(Column::of(title).0, Column::Angle(_)))
        && !titles().any(is_strange)
}

/// Reads a table of joint angles: the columns of [`titles`] and [`pelvis_titles`], in any order, some or all of them, in rad or
/// degrees.
///
/// # Errors
/// If it is no such table, says something twice, or exceeds a bound; the message names the line.
pub fn parse(bytes: &[u8]) -> Result<AnglesTable, Error> {
    let malformed = |what: &str| Error::of(ErrorKind::Malformed, what.to_owned());
    let text = str::from_utf8(bytes).map_err(|cause| {
        malformed("the table is no text")
            .at(format!("byte {}", cause.valid_up_to()))
            .allowed("UTF-8")
            .remedy("save it as a text in UTF-8")
    })?;
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let mut all = rows(text);
    let head = all.next().transpose()?;
    let names: Vec<&str> = head.iter().flat_map(Row::cells).collect();
    let columns: Vec<(Column, bool)> = names.iter().map(|name| Column::of(name)).collect();
    let there = |column: Column| columns.iter().filter(|(of, _)| *of == column).count();
    let shape = |what: &str| malformed(what).at("line 1").allowed(SHAPE);
    for (name, (column, _)) in names.iter().zip(&columns) {
        if *column != Column::Other && there(*column) > 1 {
            return Err(shape("a column is there twice").got((*name).to_owned()));
        }
    }
    if there(Column::Time) == 0 {
        return Err(shape("a table of joint angles has no times"));
    }
    let of_three =
        |column: fn(usize) -> Column, what: &str| match (0..3).map(|at| there(column(at))).sum() {
            0_usize => Ok(false),
            3 => Ok(true),
            _ => Err(shape("a column of three is missing").got(what.to_owned())),
        };
    let has_root = of_three(Column::Root, "the root")?;
    let has_pelvis = of_three(Column::Pelvis, "the pelvis")?;
    let said: Vec<Dof> = (0..Dof::ALL.len())
        .filter(|at| there(Column::Angle(*at)) > 0)
        .map(|at| Dof::ALL[at])
        .collect();
    if said.is_empty() {
        return Err(shape("no column is a joint angle of the body"));
    }
    let count = all.count();
    let bytes_of_row = size_of::<(JointAngles, DVec3, DQuat, f64)>();
    let most = bytes.len().saturating_mul(3).saturating_add(SPARE_BYTES);
    if count > MAX_POSES || count.saturating_mul(bytes_of_row) > most {
        return Err(Error::of(
            ErrorKind::OutsideLimits,
            "too many rows for so few numbers, or too many at all",
        )
        .got(counted(count, "row"))
        .allowed(format!("at most {MAX_POSES}, and {most} for them", most = counted(most, "byte")))
        .remedy("cut the table into shorter ones"));
    }
    let mut table = AnglesTable {
        rate_hz: 0.0,
        angles: Vec::with_capacity(count),
        roots_m: Vec::with_capacity(if has_root { count } else { 0 }),
        pelvis: Vec::with_capacity(if has_pelvis { count } else { 0 }),
        said,
        in_degrees: columns.iter().any(|(_, is_deg)| *is_deg),
        notes: Vec::new(),
    };
    let mut times_s: Vec<f64> = Vec::with_capacity(count);
    for row in rows(text).skip(1) {
        let row = row?;
        let wrong =
            |what: &str, got: String| malformed(what).at(format!("line {}", row.line)).got(got);
        if row.width() != columns.len() {
            let got =
                format!("{}, {}", counted(row.width(), "cell"), counted(columns.len(), "column"));
            return Err(wrong("a row has not one cell per column", got));
        }
        let (mut angles, mut root_m, mut pelvis) = (JointAngles::default(), [0.0; 3], [0.0; 3]);
        for ((cell, name), (column, is_deg)) in row.cells().zip(&names).zip(&columns) {
            if *column == Column::Other {
                continue;
            }
            let number = cell.parse().ok().filter(|number: &f64| number.is_finite());
            let number = number.ok_or_else(|| {
                wrong(
                    "a cell is no number",
                    format!("{name}: {}", cell.chars().take(40).collect::<String>()),
                )
            })?;
            let number = if *is_deg { number.to_radians() } else { number };
            let most = match column {
                Column::Angle(_) | Column::Pelvis(1 | 2) => MOST_RAD,
                // Whoever turns around goes on beyond a turn.
                Column::Pelvis(_) | Column::Root(_) => MOST,
                Column::Time | Column::Other => f64::INFINITY,
            };
            if number.abs() > most {
                return Err(wrong("no body is turned or moved so far", format!("{name}: {cell}"))
                    .allowed(format!("angles within {MOST_RAD:.0} rad, places within {MOST:.0} m"))
                    .remedy("call columns of degrees by _deg"));
            }
            let place = match *column {
                Column::Angle(at) => angles.0.get_mut(at),
                Column::Root(at) => root_m.get_mut(at),
                Column::Pelvis(at) => pelvis.get_mut(at),
                Column::Time => {
                    if times_s.last().is_some_and(|before| !(number > *before)) {
                        return Err(wrong("time does not go on", format!("{number} s")));
                    }
                    times_s.push(number);
                    None
                }
                Column::Other => None,
            };
            if let Some(place) = place {
                *place = number;
            }
        }
        table.angles.push(angles);
        if has_root {
            table.roots_m.push(DVec3::from(root_m));
        }
        if has_pelvis {
            let [rotation_rad, obliquity_rad, tilt_rad] = pelvis;
            table
                .pelvis
                .push(PelvisAngles { rotation_rad, obliquity_rad, tilt_rad }.to_orientation());
        }
    }
    match key_frames::between(&times_s, Dof::ALL.len())? {
        None => table.rate_hz = rate_of(&times_s)?,
        Some((rate_hz, instants)) => table.go_between(rate_hz, &instants, times_s.len()),
    }
    let left: Vec<&str> = names
        .iter()
        .zip(&columns)
        .filter(|(_, (of, _))| *of == Column::Other)
        .map(|(name, _)| *name)
        .collect();
    if !left.is_empty() {
        table.notes.push(format!("left out of the table: {}", left.join(", ")));
    }
    let at_rest: Vec<&str> =
        Dof::ALL.iter().filter(|dof| !table.said.contains(dof)).map(|dof| dof.name()).collect();
    if !at_rest.is_empty() {
        table
            .notes
            .push(format!("not in the table, and therefore at rest: {}", at_rest.join(", ")));
    }
    Ok(table)
}

impl AnglesTable {
    /// Makes poses at instants out of its own, which are key frames.
    fn go_between(&mut self, rate_hz: f64, instants: &[key_frames::InBetween], keys: usize) {
        let between = |instant: &key_frames::InBetween| {
            (instant.before, instant.before + 1, instant.progress)
        };
        let angles = |instant| {
            let (from, to, progress) = between(instant);
            let (from, to) = (self.angles[from].0, self.angles[to].0);
            JointAngles(std::array::from_fn(|dof| from[dof] + (to[dof] - from[dof]) * progress))
        };
        let angles = instants.iter().map(angles).collect();
        let root_m = |instant| {
            let (from, to, progress) = between(instant);
            Some(self.roots_m.get(from)?.lerp(*self.roots_m.get(to)?, progress))
        };
        let roots_m = instants.iter().filter_map(root_m).collect();
        let pelvis = |instant| {
            let (from, to, progress) = between(instant);
            Some(self.pelvis.get(from)?.slerp(*self.pelvis.get(to)?, progress))
        };
        let pelvis = instants.iter().filter_map(pelvis).collect();
        (self.angles, self.roots_m, self.pelvis) = (angles, roots_m, pelvis);
        self.rate_hz = rate_hz;
        self.notes.push(format!(
            "{keys}: each angle goes from one to the next as an actionlet, and is at rest in each",
            keys = counted(keys, "key frame")
        ));
    }
}

/// Rows per second of even times.
fn rate_of(times_s: &[f64]) -> Result<f64, Error> {
    let (Some(first_s), Some(last_s)) = (times_s.first(), times_s.last()) else {
        return Err(Error::of(ErrorKind::Malformed, "the table has no rows").allowed(SHAPE));
    };
    let step_s = (last_s - first_s) / times_s.len().saturating_sub(1) as f64;
    if !(step_s > 0.0 && step_s.is_finite()) {
        return Err(Error::of(ErrorKind::Malformed, "a motion has two rows or more").got("1 row"));
    }
    let off = times_s
        .iter()
        .enumerate()
        .find(|(row, time_s)| (**time_s - first_s - *row as f64 * step_s).abs() > UNEVEN * step_s);
    if let Some((row, time_s)) = off {
        return Err(Error::of(ErrorKind::Malformed, "the times of the rows are uneven")
            .at(format!("row {}", row + 1))
            .got(format!("{time_s} s"))
            .allowed(format!("steps of {step_s:.6} s, as on average"))
            .remedy("fill the rows that are missing, or cut the table there"));
    }
    let (rate_hz, whole) = (1.0 / step_s, (1.0 / step_s).round());
    // Times are written in so many digits.
    Ok(if (rate_hz - whole).abs() < 1e-3 * rate_hz { whole } else { rate_hz })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(titles: &str, rows: &str) -> String {
        format!("{titles}\n{rows}")
    }

    #[test]
    fn columns_in_any_order_and_in_degrees_say_the_same() {
        let rad = table(
            "time_s,left_knee_flexion_rad,root_x_m,root_y_m,root_z_m",
            "0,1,0,0,1\n0.1,0.5,0,0,1\n",
        );
        let deg = "root_z_m,time_s,root_x_m,left_knee_flexion_deg,root_y_m,remark\n\
                   1,0,0,57.29577951308232,0,a\n1,0.1,0,28.64788975654116,0,b\n";
        let (rad, deg) =
            (parse(rad.as_bytes()).expect("rad"), parse(deg.as_bytes()).expect("degrees"));
        assert_eq!((rad.rate_hz, &rad.roots_m, &rad.said), (10.0, &deg.roots_m, &deg.said));
        let most = rad.angles.iter().zip(&deg.angles).flat_map(|(a, b)| a.0.iter().zip(b.0));
        assert!(most.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) < 1e-12);
        assert!(deg.notes.iter().any(|note| note.contains("remark")), "{:?}", deg.notes);
        assert!(rad.pelvis.is_empty());
    }

    #[test]
    fn what_is_no_such_table_is_refused_and_says_where() {
        let titles = "time_s,left_knee_flexion_rad";
        for (titles, rows, said) in [
            (titles, "0,1\n0.1,x\n", "line 3"),
            (titles, "0,1\n0.1\n", "line 3"),
            (titles, "0,1\n0,2\n", "time does not go on"),
            (titles, "0,1\n0.1,1\n0.2,1\n5,1\n", "uneven"),
            (titles, "0,1\n", "two rows"),
            (titles, "", "no rows"),
            (titles, "0,nan\n0.1,1\n", "line 2"),
            (titles, "0,1\n0.1,45\n", "_deg"),
            ("time_s,left_knee_flexion_rad,left_knee_flexion_deg", "0,1,1\n1,1,1\n", "twice"),
            ("time_s,root_x_m", "0,1\n1,1\n", "of three"),
            ("left_knee_flexion_rad", "0\n1\n", "no times"),
        ] {
            let error = parse(table(titles, rows).as_bytes()).expect_err(said).to_string();
            assert!(error.contains(said), "{said}: {error}");
        }
    }

    #[test]
    fn times_in_milliseconds_are_even_and_tables_of_robots_are_others() {
        let rows: String = (0..13).map(|n| format!("{:.3},0\n", f64::from(n) / 120.0)).collect();
        let read = parse(table("time_s,torso_flexion_rad", &rows).as_bytes()).expect("a table");
        assert!((read.rate_hz - 120.0).abs() < 0.1, "{}", read.rate_hz);
        assert!(is_of_body("time_s,torso_flexion_rad,root_x_m,not_measured"));
        assert!(!is_of_body("time_s,torso_flexion_rad,l_el_rad"));
        assert!(!is_of_body("time_s,base_x_m,contact_left"));
        assert!(!is_of_body("torso_flexion_rad"));
    }
}
