//! OpenSim's tables (MOT, STO): a head of lines up to `endheader`, a line of titles that begins with `time`, and a
//! row of numbers for each moment, with tabs or blanks between them.
//!
//! The head says `inDegrees=yes` or `no`, and in newer files what a cell holds: `DataType=double`, `Vec3` or
//! `Quaternion` (w, x, y, z, with commas between them). Older heads (SIMM's) say `datarows 100`. Described in OpenSim's
//! documentation, "Motion (.mot) Files", "Storage (.sto) Files" and "IMU Placer". OpenSim's world has X forward, Y
//! up, Z to the right.
//!
//! [`OpenSimTable::body_angles`] takes the coordinates that the published models share (gait2392 and its kin, Rajagopal
//! 2016) to the 22 degrees of freedom. Their joints turn intrinsically about Z, X, Y, which are this body's -Y, X and
//! Z: the angles are the same but for signs. Where a model's axis is oblique (ankle, elbow), it is taken as
//! this body's. [`write()`] is the way back.

use crate::body::{Dof, JointAngles};
use crate::error::{Error, ErrorKind, counted, either};
use crate::mocap::opened::{as_utf8, bytes_of};
use glam::{DQuat, DVec3, EulerRot};
use std::collections::BTreeSet;
use std::f64::consts::{PI, TAU};
use std::fmt::Write;
use std::path::Path;

/// Largest file read, bytes.
pub const MAX_FILE_BYTES: u64 = 256 << 20;
/// What numbers may take beside three times the file, bytes.
const SPARE_BYTES: usize = 4 << 20;
/// Most columns of a table.
const MAX_COLUMNS: usize = 16_384;
/// Most lines of a head.
const HEAD_LINES: usize = 4096;
/// Most rows that become poses of a body: nearly three hours at 100 per second.
const MAX_POSES: usize = 1_000_000;
/// A step further from the usual one than this part of it makes the times uneven.
const UNEVEN: f64 = 0.01;

/// What a cell of a table holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OpenSimCell {
    /// A number.
    Number,
    /// Three numbers.
    Vector,
    /// A rotation: w, x, y, z.
    Quaternion,
}

impl OpenSimCell {
    /// The word for it in the head of a file.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Number => "double",
            Self::Vector => "Vec3",
            Self::Quaternion => "Quaternion",
        }
    }

    const fn numbers(self) -> usize {
        match self {
            Self::Number => 1,
            Self::Vector => 3,
            Self::Quaternion => 4,
        }
    }

    fn named(word: &str) -> Option<Self> {
        let all = [Self::Number, Self::Vector, Self::Quaternion];
        all.into_iter().find(|cell| cell.word().eq_ignore_ascii_case(word))
    }
}

/// A table as it stands in a file: nothing interpreted.
#[derive(Clone, Debug, PartialEq)]
pub struct OpenSimTable {
    /// What the first line calls it.
    pub name: String,
    /// Whether angles are in degrees; `None` if the file does not say.
    pub in_degrees: Option<bool>,
    /// What cells hold.
    pub cell: OpenSimCell,
    /// Titles behind `time`.
    pub columns: Vec<String>,
    /// Time of each row, s, rising.
    pub times_s: Vec<f64>,
    /// What is wrong with the file and what was made of it.
    pub notes: Vec<String>,
    /// Rows that the head claims and the file does not hold.
    pub lost_rows: u64,
    /// Row after row; not a number where there is none.
    values: Vec<f64>,
}

/// A table on the body model.
#[derive(Clone, Debug, PartialEq)]
pub struct OpenSimBody {
    /// Rows per second, at even times.
    pub rate_hz: f64,
    /// Angles, row by row.
    pub angles: Vec<JointAngles>,
    /// How the pelvis is turned in the world, row by row.
    pub pelvis: Vec<DQuat>,
    /// Where the model's pelvis is in the world, m; empty if the table does not say.
    pub places_m: Vec<DVec3>,
    /// Degrees of freedom that no column says: they stay at zero.
    pub at_rest: Vec<Dof>,
    /// What was found out and what was left.
    pub notes: Vec<String>,
}

fn malformed(what: impl Into<String>, line: usize) -> Error {
    Error::of(ErrorKind::Malformed, what).at(format!("line {line}"))
}

fn shown(text: &str) -> String {
    format!("\"{}\"", text.chars().take(40).collect::<String>())
}

/// True if a file is one of these, by its ending.
#[must_use]
pub fn is_named(path: &Path) -> bool {
    let ending = path.extension().and_then(|ending| ending.to_str()).unwrap_or_default();
    ["mot", "sto"].iter().any(|one| one.eq_ignore_ascii_case(ending))
}

/// Reads a file.
///
/// # Errors
/// If it cannot be read, and as [`parse`]; the error names it.
pub fn read(path: &Path) -> Result<OpenSimTable, Error> {
    parse(&as_utf8(bytes_of(path, MAX_FILE_BYTES)?)).map_err(|error| error.in_file(path))
}

/// Reads the bytes of a file.
///
/// # Errors
/// If it breaks the format or exceeds a bound; the message names the line.
pub fn parse(bytes: &[u8]) -> Result<OpenSimTable, Error> {
    let text = str::from_utf8(bytes).map_err(|cause| {
        Error::of(ErrorKind::Malformed, "the table is no text")
            .at(format!("byte {}", cause.valid_up_to()))
            .allowed("UTF-8")
    })?;
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let mut lines = text.lines().enumerate().map(|(at, line)| (at + 1, line.trim()));
    let mut table = OpenSimTable {
        name: String::new(),
        in_degrees: None,
        cell: OpenSimCell::Number,
        columns: Vec::new(),
        times_s: Vec::new(),
        notes: Vec::new(),
        lost_rows: 0,
        values: Vec::new(),
    };
    let claimed = read_head(&mut lines, &mut table)?;
    let mut rows = lines.filter(|(_, line)| !line.is_empty());
    let (titles_line, titles) = rows
        .next()
        .ok_or_else(|| malformed("the file ends before the titles of its columns", 1))?;
    let mut titles = titles.split_whitespace();
    let first = titles.next().unwrap_or_default();
    if !first.eq_ignore_ascii_case("time") {
        return Err(malformed("the first column is not time", titles_line)
            .got(shown(first))
            .allowed("time, then the titles of the other columns"));
    }
    let columns = titles.clone().count();
    if columns > MAX_COLUMNS {
        return Err(malformed("too many columns", titles_line)
            .got(columns.to_string())
            .allowed(format!("at most {MAX_COLUMNS}")));
    }
    table.columns = titles.map(str::to_owned).collect();
    let count = rows.clone().count();
    let width = table.columns.len().saturating_mul(table.cell.numbers()) + 1;
    let needed = count.saturating_mul(width).saturating_mul(size_of::<f64>());
    let most = bytes.len().saturating_mul(3) + SPARE_BYTES;
    if needed > most {
        return Err(Error::of(
            ErrorKind::Malformed,
            "the numbers would take far more memory than the file",
        )
        .got(format!(
            "{count} of {}",
            counted(table.columns.len(), "column"),
            count = counted(count, "row")
        ))
        .allowed(format!("{}; needed: {needed}", counted(most, "byte"))));
    }
    table.values.reserve_exact(count * (width - 1));
    table.times_s.reserve_exact(count);
    for (line, row) in rows {
        table.add_row(line, row)?;
    }
    if let Some(claimed) = claimed.filter(|claimed| *claimed != count as u64) {
        table.notes.push(format!(
            "the head says {}, {count} {} there",
            counted(claimed, "row"),
            either(count, "is", "are")
        ));
        table.lost_rows = claimed.saturating_sub(count as u64);
    }
    Ok(table)
}

/// Reads up to `endheader`; how many rows the head claims.
fn read_head<'a>(
    lines: &mut impl Iterator<Item = (usize, &'a str)>,
    table: &mut OpenSimTable,
) -> Result<Option<u64>, Error> {
    let mut claimed = None;
    let mut last_line = 1;
    for (line, text) in lines.by_ref().take(HEAD_LINES) {
        last_line = line;
        if text.eq_ignore_ascii_case("endheader") {
            return Ok(claimed);
        }
        let (key, value) = match text.split_once('=') {
            Some(pair) => pair,
            None => text.split_once(char::is_whitespace).unwrap_or((text, "")),
        };
        let value = value.trim();
        match key.trim().to_ascii_lowercase().as_str() {
            "name" => table.name = value.chars().take(200).collect(),
            "indegrees" => table.in_degrees = Some(value.eq_ignore_ascii_case("yes")),
            "nrows" | "datarows" => claimed = value.parse().ok(),
            "datatype" => {
                table.cell = OpenSimCell::named(value).ok_or_else(|| {
                    malformed("cells of this type are not read", line)
                        .got(shown(value))
                        .allowed("double, Vec3, Quaternion")
                })?;
            }
            _ if line == 1 => table.name = text.chars().take(200).collect(),
            _ => {}
        }
    }
    Err(malformed("not an OpenSim table: its head does not end", last_line)
        .allowed("a line that says endheader"))
}

impl OpenSimTable {
    fn add_row(&mut self, line: usize, row: &str) -> Result<(), Error> {
        let mut cells = row.split_whitespace();
        let time = cells.next().unwrap_or_default();
        let time_s = time.parse().ok().filter(|time: &f64| time.is_finite());
        let time_s = time_s
            .ok_or_else(|| malformed("a row does not begin with a time", line).got(shown(time)))?;
        if self.times_s.last().is_some_and(|before| !(time_s > *before)) {
            return Err(malformed("time does not go on", line).got(format!("{time_s} s")));
        }
        self.times_s.push(time_s);
        let numbers = self.cell.numbers();
        for column in &self.columns {
            let cell = cells.next().ok_or_else(|| {
                malformed("a row ends before its last column", line).got(shown(column))
            })?;
            let mut parts = cell.split(',');
            for _ in 0..numbers {
                let number = parts.next().and_then(|part| part.trim().parse::<f64>().ok());
                let number = number.ok_or_else(|| {
                    malformed("a cell is not what the head says", line)
                        .got(format!("{} in column {}", shown(cell), shown(column)))
                        .allowed(self.cell.word())
                })?;
                self.values.push(if number.is_finite() { number } else { f64::NAN });
            }
            if parts.next().is_some() {
                return Err(malformed("a cell is not what the head says", line)
                    .got(format!("{} in column {}", shown(cell), shown(column)))
                    .allowed(self.cell.word()));
            }
        }
        match cells.next() {
            None => Ok(()),
            Some(more) => Err(malformed("a row has more cells than there are columns", line)
                .got(shown(more))
                .allowed(format!("time and {}", counted(self.columns.len(), "column")))),
        }
    }

    /// How many numbers are none (`nan`), and where the first of them is; nothing if all are.
    #[must_use]
    pub fn not_numbers(&self) -> Option<String> {
        let first = self.values.iter().position(|value| value.is_nan())?;
        let count = self.values.iter().filter(|value| value.is_nan()).count();
        let at = first / self.cell.numbers();
        let (row, column) = (at / self.columns.len(), at % self.columns.len());
        Some(format!(
            "{count} of {} {} not finite, the first at {:.3} s in {}",
            counted(self.values.len(), "number"),
            either(count, "is", "are"),
            self.times_s.get(row).copied().unwrap_or_default(),
            self.columns.get(column).map_or("", String::as_str)
        ))
    }

    /// Rows.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.times_s.len()
    }

    /// From the first row to the last, s.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        match (self.times_s.first(), self.times_s.last()) {
            (Some(first), Some(last)) => last - first,
            _ => 0.0,
        }
    }

    /// Rows per second on average; `None` of fewer than two.
    #[must_use]
    pub fn rate_hz(&self) -> Option<f64> {
        let rate_hz = self.rows().saturating_sub(1) as f64 / self.duration_s();
        let whole = rate_hz.round();
        // Times are written in so many digits.
        let rate_hz = if (rate_hz - whole).abs() < 1e-4 * rate_hz { whole } else { rate_hz };
        Some(rate_hz).filter(|rate_hz| rate_hz.is_finite() && *rate_hz > 0.0)
    }

    /// The numbers of a cell, if there are such a row and column.
    #[must_use]
    pub fn cell(&self, row: usize, column: usize) -> Option<&[f64]> {
        let numbers = self.cell.numbers();
        let at = row.checked_mul(self.columns.len())?.checked_add(column)?;
        let begins = at.checked_mul(numbers)?;
        let cell = self.values.get(begins..begins + numbers)?;
        (column < self.columns.len()).then_some(cell)
    }

    /// Columns that say a degree of freedom of the body, with it.
    #[must_use]
    pub fn body_columns(&self) -> Vec<(usize, Dof)> {
        let columns = self.columns.iter().enumerate();
        let known = columns.filter_map(|(at, title)| Some((at, Coordinate::of(title)?)));
        let dofs = known.filter_map(|(at, coordinate)| match coordinate {
            Coordinate::Angle(dof, _) | Coordinate::Knee(dof) => Some((at, dof)),
            _ => None,
        });
        if self.cell == OpenSimCell::Number { dofs.collect() } else { Vec::new() }
    }

    /// The motion of the body model.
    ///
    /// # Errors
    /// A table without joint angles that are known, one that says an angle twice or leaves one out, or fewer
    /// than two rows.
    pub fn body_angles(&self) -> Result<OpenSimBody, Error> {
        if self.body_columns().is_empty() {
            return Err(Error::of(ErrorKind::Unknown, "no column is a joint angle that is known")
                .got(self.columns.iter().take(8).cloned().collect::<Vec<_>>().join(", "))
                .allowed("hip_flexion_r, knee_angle_r, lumbar_extension, arm_flex_r, ... as in OpenSim's models"));
        }
        let rate_hz = self.rate_hz().ok_or_else(|| {
            Error::new("a motion needs two rows at least").got(counted(self.rows(), "row"))
        })?;
        let poses = (self.duration_s() * rate_hz).round() + 1.0;
        if !(poses <= MAX_POSES as f64) {
            return Err(Error::of(ErrorKind::OutsideLimits, "the table is too long for a motion")
                .got(counted(poses, "pose"))
                .allowed(format!("{MAX_POSES}")));
        }
        let mut body = OpenSimBody {
            rate_hz,
            angles: vec![JointAngles::default(); poses as usize],
            pelvis: Vec::new(),
            places_m: Vec::new(),
            at_rest: Vec::new(),
            notes: self.notes.clone(),
        };
        let is_radians = self.in_degrees == Some(false);
        if self.in_degrees.is_none() {
            body.notes.push("the file does not say inDegrees: degrees are taken".to_owned());
        }
        let scale = if is_radians { 1.0 } else { 1.0_f64.to_radians() };
        let (mut turns, mut place) = ([None, None, None], [None, None, None]);
        let (mut said, mut left) = (BTreeSet::new(), Vec::new());
        for (column, title) in self.columns.iter().enumerate() {
            let Some(coordinate) = Coordinate::of(title) else {
                left.push(plain(title).unwrap_or(title));
                continue;
            };
            if !said.insert(coordinate.key()) {
                return Err(Error::of(ErrorKind::Malformed, "two columns say the same angle")
                    .at("the titles")
                    .got(shown(title)));
            }
            let mut series = self.even(column, rate_hz, body.angles.len())?;
            match coordinate {
                Coordinate::Angle(dof, sign) => body.set(dof, &series, sign * scale),
                Coordinate::Knee(dof) => {
                    let (least, most) = range(&series);
                    let sign = if -least > most { -1.0 } else { 1.0 };
                    if sign < 0.0 {
                        body.notes.push(format!(
                            "{} bends to negative angles, as in gait2392",
                            plain(title).unwrap_or(title)
                        ));
                    }
                    body.set(dof, &series, sign * scale);
                }
                Coordinate::Turn(axis) => {
                    series.iter_mut().for_each(|angle| *angle *= scale);
                    turns[axis] = Some(series);
                }
                Coordinate::Place(axis) => place[axis] = Some(series),
            }
        }
        let at = |series: &Option<Vec<f64>>, row: usize| {
            series.as_ref().and_then(|series| series.get(row).copied()).unwrap_or(0.0)
        };
        let rows = 0..body.angles.len();
        body.pelvis = rows
            .clone()
            .map(|row| {
                let [tilt, list, rotation] = [0, 1, 2].map(|axis| at(&turns[axis], row));
                DQuat::from_rotation_y(-tilt)
                    * DQuat::from_rotation_x(list)
                    * DQuat::from_rotation_z(rotation)
            })
            .collect();
        if place.iter().any(Option::is_some) {
            let place = |row| {
                let [x, y, z] = [0, 1, 2].map(|axis| at(&place[axis], row));
                DVec3::new(x, -z, y)
            };
            body.places_m = rows.map(place).collect();
        }
        body.at_rest = Dof::ALL.into_iter().filter(|dof| !said.contains(&Key::Dof(*dof))).collect();
        if !body.at_rest.is_empty() {
            let names: Vec<&str> = body.at_rest.iter().map(|dof| dof.name()).collect();
            body.notes
                .push(format!("not in the file, and therefore at rest: {}", names.join(", ")));
        }
        if !left.is_empty() {
            left.truncate(40);
            body.notes
                .push(format!("left out, as the body has no such joint: {}", left.join(", ")));
        }
        Ok(body)
    }

    /// A column at even times, on straight lines between rows where the file's are not.
    fn even(&self, column: usize, rate_hz: f64, poses: usize) -> Result<Vec<f64>, Error> {
        let value = |row: usize| {
            let value = self.cell(row, column).and_then(|cell| cell.first().copied());
            value.filter(|value| value.is_finite()).ok_or_else(|| {
                let title = self.columns.get(column).map_or("", String::as_str);
                let at = format!("row {} of the numbers, column {}", row + 1, shown(title));
                Error::of(ErrorKind::Malformed, "an angle is missing").at(at)
            })
        };
        let first_s = self.times_s.first().copied().unwrap_or_default();
        let step_s = 1.0 / rate_hz;
        let is_even = poses == self.rows()
            && self.times_s.iter().enumerate().all(|(row, time_s)| {
                (time_s - first_s - row as f64 * step_s).abs() <= UNEVEN * step_s
            });
        if is_even {
            return (0..poses).map(value).collect();
        }
        let mut series = Vec::with_capacity(poses);
        let mut row = 1;
        for pose in 0..poses {
            let at_s = first_s + pose as f64 * step_s;
            while row + 1 < self.rows() && self.times_s[row] < at_s {
                row += 1;
            }
            let (before_s, after_s) = (self.times_s[row - 1], self.times_s[row]);
            let part = ((at_s - before_s) / (after_s - before_s)).clamp(0.0, 1.0);
            let (before, after) = (value(row - 1)?, value(row)?);
            series.push(before + part * (after - before));
        }
        Ok(series)
    }
}

impl OpenSimBody {
    fn set(&mut self, dof: Dof, series: &[f64], scale: f64) {
        for (angles, value) in self.angles.iter_mut().zip(series) {
            angles[dof] = scale * value;
        }
    }
}

fn range(series: &[f64]) -> (f64, f64) {
    let least = series.iter().copied().fold(0.0, f64::min);
    (least, series.iter().copied().fold(0.0, f64::max))
}

/// Coordinates that are written, in the order of the models.
const WRITTEN: [&str; 27] = [
    "pelvis_tilt",
    "pelvis_list",
    "pelvis_rotation",
    "pelvis_tx",
    "pelvis_ty",
    "pelvis_tz",
    "hip_flexion_r",
    "hip_adduction_r",
    "hip_rotation_r",
    "knee_angle_r",
    "ankle_angle_r",
    "hip_flexion_l",
    "hip_adduction_l",
    "hip_rotation_l",
    "knee_angle_l",
    "ankle_angle_l",
    "lumbar_extension",
    "lumbar_bending",
    "lumbar_rotation",
    "arm_flex_r",
    "arm_add_r",
    "arm_rot_r",
    "elbow_flex_r",
    "arm_flex_l",
    "arm_add_l",
    "arm_rot_l",
    "elbow_flex_l",
];

/// Joint angles as a motion file (MOT) for OpenSim: degrees, the pelvis in OpenSim's world, m; a row for each pose, of
/// which `poses` says where the pelvis is and how it is turned (world with Z up, X forward). Knees bend to positive
/// angles, as in Rajagopal's model. The neck has no coordinate in the published models and is left out. Headings go on
/// beyond 180 degrees.
#[must_use]
pub fn write(
    name: &str,
    rate_hz: f64,
    poses: impl ExactSizeIterator<Item = (JointAngles, DVec3, DQuat)>,
) -> String {
    let line: String = name.chars().filter(|of| !of.is_control()).take(200).collect();
    let mut text = format!(
        "{line}\nversion=1\nnRows={}\nnColumns={}\ninDegrees=yes\nendheader\ntime\t{}\n",
        poses.len(),
        1 + WRITTEN.len(),
        WRITTEN.join("\t")
    );
    let mut heading = 0.0;
    for (row, (angles, place_m, pelvis)) in poses.enumerate() {
        // As they are read: intrinsically about -Y, X, Z of this world.
        let (tilt, list, turned) = pelvis.to_euler(EulerRot::YXZ);
        heading += (turned - heading + PI).rem_euclid(TAU) - PI;
        let turns = [-tilt, list, heading];
        let place = [place_m.x, place_m.z, -place_m.y];
        let _ = write!(text, "{:.8}", row as f64 / rate_hz);
        for coordinate in WRITTEN.into_iter().filter_map(Coordinate::of) {
            let value = match coordinate {
                Coordinate::Angle(dof, sign) => (sign * angles[dof]).to_degrees(),
                Coordinate::Knee(dof) => angles[dof].to_degrees(),
                Coordinate::Turn(axis) => turns[axis].to_degrees(),
                Coordinate::Place(axis) => place[axis],
            };
            let _ = write!(text, "\t{value:.8}");
        }
        text.push('\n');
    }
    text
}

/// What a column of a known name says.
#[derive(Clone, Copy)]
enum Coordinate {
    /// An angle, with the sign that makes it ours.
    Angle(Dof, f64),
    /// The bending of a knee, whose sign the models do not share.
    Knee(Dof),
    /// How the pelvis is turned: about Z, X or Y.
    Turn(usize),
    /// Where the pelvis is: along X, Y or Z.
    Place(usize),
}

/// What a column says, whichever way.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Key {
    Dof(Dof),
    Turn(usize),
    Place(usize),
}

/// The name of a coordinate in a title: newer files write `/jointset/hip_r/hip_flexion_r/value`.
fn plain(title: &str) -> Option<&str> {
    if !title.contains('/') {
        return Some(title);
    }
    title.strip_suffix("/value")?.rsplit('/').next()
}

impl Coordinate {
    fn of(title: &str) -> Option<Self> {
        use Coordinate::{Angle, Knee, Place, Turn};
        Some(match plain(title)? {
            "pelvis_tilt" => Turn(0),
            "pelvis_list" => Turn(1),
            "pelvis_rotation" => Turn(2),
            "pelvis_tx" => Place(0),
            "pelvis_ty" => Place(1),
            "pelvis_tz" => Place(2),
            "lumbar_extension" => Angle(Dof::TorsoFlexion, -1.0),
            "lumbar_bending" => Angle(Dof::TorsoLateralBend, -1.0),
            "lumbar_rotation" => Angle(Dof::TorsoAxial, 1.0),
            "hip_flexion_l" => Angle(Dof::LeftHipFlexion, 1.0),
            "hip_adduction_l" => Angle(Dof::LeftHipAbduction, -1.0),
            "hip_rotation_l" => Angle(Dof::LeftHipRotation, 1.0),
            "knee_angle_l" => Knee(Dof::LeftKneeFlexion),
            "ankle_angle_l" => Angle(Dof::LeftAnkleDorsiflexion, 1.0),
            "arm_flex_l" => Angle(Dof::LeftShoulderFlexion, 1.0),
            "arm_add_l" => Angle(Dof::LeftShoulderAbduction, -1.0),
            "arm_rot_l" => Angle(Dof::LeftShoulderRotation, 1.0),
            "elbow_flex_l" => Angle(Dof::LeftElbowFlexion, 1.0),
            "hip_flexion_r" => Angle(Dof::RightHipFlexion, 1.0),
            "hip_adduction_r" => Angle(Dof::RightHipAbduction, -1.0),
            "hip_rotation_r" => Angle(Dof::RightHipRotation, 1.0),
            "knee_angle_r" => Knee(Dof::RightKneeFlexion),
            "ankle_angle_r" => Angle(Dof::RightAnkleDorsiflexion, 1.0),
            "arm_flex_r" => Angle(Dof::RightShoulderFlexion, 1.0),
            "arm_add_r" => Angle(Dof::RightShoulderAbduction, -1.0),
            "arm_rot_r" => Angle(Dof::RightShoulderRotation, 1.0),
            "elbow_flex_r" => Angle(Dof::RightElbowFlexion, 1.0),
            _ => return None,
        })
    }

    const fn key(self) -> Key {
        match self {
            Self::Angle(dof, _) | Self::Knee(dof) => Key::Dof(dof),
            Self::Turn(axis) => Key::Turn(axis),
            Self::Place(axis) => Key::Place(axis),
        }
    }
}
