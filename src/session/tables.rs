//! Inertial sensors out of tables: what a series of samples is to a recording, and raw samples fused again.
//!
//! What a table's columns are is declared in a file (TOML); Xsens' text, which MT Manager exports, and OpenSim's tables
//! of orientations say it themselves. All become a [`SensorSeries`], as recordings do.
//!
//! ```toml
//! rate_hz = 50                       # or: time = "time", a column in seconds
//! n_pose_s = [0, 4]                  # somebody stands in N pose; for sensors with a segment
//! [[sensor]]
//! name = "upper"
//! rate = ["gyr1_x", "gyr1_y", "gyr1_z"]
//! rate_unit = "rad/s"                # or deg/s
//! acceleration = ["acc1_x", "acc1_y", "acc1_z"]
//! acceleration_unit = "m/s2"         # or g
//! field = ["mag1_x", "mag1_y", "mag1_z"]
//! orientation = ["q1_w", "q1_x", "q1_y", "q1_z"]   # of a world with Z up
//! axes = ["x", "-z", "y"]            # the sensor's axes: its Y is what the table calls -Z
//! rate_scale = 1.01                  # and acceleration_scale
//! segment = "left_thigh"             # worn there
//! forward = "z"                      # what was strapped on to point forward: also [x, y, z], "30 deg from x to y"
//! [[movement]]
//! movement = "sit_to_stand"          # or bow, bend, raise_arms
//! time_s = [15, 20]
//! ```
//!
//! Of a recording it says `axes`, scales and segments, by the names of its sensors.

use super::now::MOVEMENTS;
use crate::body::worn::WornSensor;
use crate::body::worn::calibrate::{Moved, calibrate_by_all};
use crate::body::worn::kept::Kept;
use crate::body::worn::strap::StrapDirection;
use crate::body::{segment_name, segment_named};
use crate::capture::{Mode, Orientation};
use crate::error::{Error, ErrorKind, counted};
use crate::mocap::opensim::{OpenSimCell, OpenSimTable};
use crate::recording::{SensorMoment, SensorSeries};
use crate::table::{self, Row};
use crate::toml_text::from_toml;
use glam::{DMat3, DQuat, DVec3};
use serde::Deserialize;

/// Most samples of all sensors of a table.
const MAX_SAMPLES: usize = 4_000_000;
/// Standard gravity, m/s^2.
const GRAVITY_M_S2: f64 = 9.806_65;
/// How segments lean is looked at once in this time, s.
const AT_WILL_S: f64 = 0.05;
/// Tesla of the unit in which fields are written.
const MICROTESLA: f64 = 1e-6;

/// What a table's columns are, and how its sensors were worn.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DeclaredSensors {
    time: Option<String>,
    rate_hz: Option<f64>,
    n_pose_s: Option<[f64; 2]>,
    #[serde(default)]
    sensor: Vec<DeclaredSensor>,
    #[serde(default)]
    movement: Vec<DeclaredMovement>,
}

/// One sensor.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct DeclaredSensor {
    name: String,
    rate: Option<[String; 3]>,
    rate_unit: Option<String>,
    rate_scale: Option<f64>,
    acceleration: Option<[String; 3]>,
    acceleration_unit: Option<String>,
    acceleration_scale: Option<f64>,
    field: Option<[String; 3]>,
    orientation: Option<[String; 4]>,
    axes: Option<[String; 3]>,
    segment: Option<String>,
    forward: Option<StrapDirection>,
}

/// A movement that tells headings.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct DeclaredMovement {
    movement: String,
    time_s: [f64; 2],
}

fn wrong(what: &str, got: impl Into<String>, allowed: &str) -> Error {
    Error::of(ErrorKind::Malformed, what.to_owned()).got(got).allowed(allowed)
}

/// An axis by its name, with its sign.
fn axis(name: &str) -> Result<DVec3, Error> {
    let (sign, letter) = match name.strip_prefix('-') {
        Some(letter) => (-1.0, letter),
        None => (1.0, name),
    };
    let axis = match letter {
        "x" => DVec3::X,
        "y" => DVec3::Y,
        "z" => DVec3::Z,
        _ => return Err(wrong("not an axis", name, "x, y, z, -x, -y, -z")),
    };
    Ok(sign * axis)
}

impl DeclaredSensors {
    /// Reads the text of a file.
    ///
    /// # Errors
    /// Another format, a unit, axis, segment or direction that is none, a sensor named twice.
    pub fn parse(text: &str) -> Result<Self, Error> {
        let declared: Self = from_toml(text).map_err(|cause| {
            wrong("not a declaration of sensors", cause.to_string().trim(), "see docs/capture.md")
        })?;
        for (at, sensor) in declared.sensor.iter().enumerate() {
            if declared.sensor[..at].iter().any(|other| other.name == sensor.name) {
                return Err(wrong("a sensor is declared twice", sensor.name.clone(), "each once"));
            }
            let in_sensor = |error: Error| error.at(format!("sensor {}", sensor.name));
            sensor.turn().map_err(in_sensor)?;
            sensor.rate_factor().map_err(in_sensor)?;
            sensor.acceleration_factor().map_err(in_sensor)?;
            sensor.worn().map_err(in_sensor)?;
        }
        if declared.rate_hz.is_some_and(|rate_hz| !(0.1..=10_000.0).contains(&rate_hz)) {
            return Err(wrong(
                "no rate of a sensor",
                format!("{:?}", declared.rate_hz),
                "0.1 to 10000 Hz",
            ));
        }
        Ok(declared)
    }

    /// Sensors, by their names, are worn so, whatever was declared of others.
    pub fn wear<'a>(&mut self, worn: impl Iterator<Item = (&'a str, WornSensor)>) {
        self.sensor.iter_mut().for_each(|sensor| sensor.segment = None);
        for (name, WornSensor { segment, forward }) in worn {
            let at = self.sensor.iter().position(|sensor| sensor.name == name);
            let at = at.unwrap_or_else(|| {
                let new = DeclaredSensor { name: name.to_owned(), ..DeclaredSensor::default() };
                self.sensor.push(new);
                self.sensor.len() - 1
            });
            self.sensor[at].segment = Some(segment_name(segment).to_owned());
            self.sensor[at].forward = Some(match forward {
                Some(forward) => StrapDirection::Along(forward.to_array()),
                None => StrapDirection::Words("none".to_owned()),
            });
        }
    }

    /// True if any sensor is declared to be worn.
    #[must_use]
    pub fn is_worn(&self) -> bool {
        self.sensor.iter().any(|sensor| sensor.segment.is_some())
    }

    /// Somebody stands in N pose from one time to another, s, whatever was declared of that.
    pub fn stands_in_n_pose(&mut self, from_to_s: [f64; 2]) {
        self.n_pose_s = Some(from_to_s);
    }

    fn named(&self, name: &str) -> Option<&DeclaredSensor> {
        self.sensor.iter().find(|sensor| sensor.name == name)
    }
}

impl DeclaredSensor {
    /// Where it is worn and what of it points forward; `None` if it is not worn.
    fn worn(&self) -> Result<Option<WornSensor>, Error> {
        let forward = self.forward.as_ref().map(StrapDirection::forward).transpose()?.flatten();
        let segment = self.segment.as_deref().map(segment_named).transpose()?;
        Ok(segment.map(|segment| WornSensor { segment, forward }))
    }

    /// What takes vectors in the table's axes to the sensor's.
    fn turn(&self) -> Result<DMat3, Error> {
        let Some([x, y, z]) = &self.axes else { return Ok(DMat3::IDENTITY) };
        let turn = DMat3::from_cols(axis(x)?, axis(y)?, axis(z)?).transpose();
        if (turn.determinant() - 1.0).abs() < 1e-9 {
            return Ok(turn);
        }
        let allowed = "three different axes that make a right hand: [\"x\", \"-z\", \"y\"]";
        Err(wrong("no axes of a sensor", format!("{x}, {y}, {z}"), allowed))
    }

    fn rate_factor(&self) -> Result<f64, Error> {
        let unit = match self.rate_unit.as_deref() {
            None | Some("rad/s") => 1.0,
            Some("deg/s") => 1.0_f64.to_radians(),
            Some(other) => return Err(wrong("not a unit of angular rate", other, "rad/s, deg/s")),
        };
        scaled(unit, self.rate_scale)
    }

    fn acceleration_factor(&self) -> Result<f64, Error> {
        let unit = match self.acceleration_unit.as_deref() {
            None | Some("m/s2") => 1.0,
            Some("g") => GRAVITY_M_S2,
            Some(other) => return Err(wrong("not a unit of acceleration", other, "m/s2, g")),
        };
        scaled(unit, self.acceleration_scale)
    }
}

fn scaled(unit: f64, scale: Option<f64>) -> Result<f64, Error> {
    let scale = scale.unwrap_or(1.0);
    if scale.is_finite() && scale > 0.0 {
        return Ok(unit * scale);
    }
    Err(wrong("no scale of a sensor", scale.to_string(), "a number above zero"))
}

/// Columns of a sensor, by their places in the table.
struct Columns {
    rate: Option<[usize; 3]>,
    acceleration: Option<[usize; 3]>,
    field: Option<[usize; 3]>,
    orientation: Option<[usize; 4]>,
}

/// The sensors of a table of comma-separated values, as they are declared.
///
/// # Errors
/// A column that is not there, a cell that is no number, time that does not go on, too many samples.
pub fn of_table(text: &str, declared: &DeclaredSensors) -> Result<SensorSeries, Error> {
    let mut rows = table::all_rows(text);
    let titles = rows.find(|row| !row.as_ref().is_ok_and(Row::is_empty)).transpose()?;
    let titles: Vec<&str> = titles.iter().flat_map(Row::cells).collect();
    let column = |title: &String| {
        titles.iter().position(|one| one == title).ok_or_else(|| {
            Error::of(ErrorKind::Absent, "a declared column is not in the table")
                .got(title.clone())
                .allowed(titles.iter().take(40).copied().collect::<Vec<_>>().join(", "))
        })
    };
    let three = |names: &Option<[String; 3]>| -> Result<Option<[usize; 3]>, Error> {
        let Some([x, y, z]) = names else { return Ok(None) };
        Ok(Some([column(x)?, column(y)?, column(z)?]))
    };
    let mut sensors = Vec::with_capacity(declared.sensor.len());
    for sensor in &declared.sensor {
        let orientation = match &sensor.orientation {
            Some([w, x, y, z]) => Some([column(w)?, column(x)?, column(y)?, column(z)?]),
            None => None,
        };
        sensors.push(Columns {
            rate: three(&sensor.rate)?,
            acceleration: three(&sensor.acceleration)?,
            field: three(&sensor.field)?,
            orientation,
        });
    }
    let time = match (&declared.time, declared.rate_hz) {
        (Some(title), None) => Time::Column(column(title)?),
        (None, Some(rate_hz)) => Time::Rate(rate_hz),
        _ => {
            return Err(wrong(
                "when samples were taken is not declared",
                "",
                "time or rate_hz, one of them",
            ));
        }
    };
    let mut found: Vec<Vec<SensorMoment>> = vec![Vec::new(); sensors.len()];
    let (mut samples, mut missed, mut first_s) = (0, 0, None);
    let mut before_s = f64::NEG_INFINITY;
    let mut cells: Vec<f64> = Vec::with_capacity(titles.len());
    for (at, row) in rows.enumerate() {
        let row = row?;
        let in_row = |error: Error| error.at(format!("line {}", row.line));
        // A row of nothing but commas took its time.
        if row.is_empty() {
            missed += sensors.len() as u64;
            continue;
        }
        if row.width() != titles.len() {
            let got =
                format!("{}, {}", counted(row.width(), "cell"), counted(titles.len(), "column"));
            return Err(in_row(wrong("a row has not one cell per column", got, "as many")));
        }
        cells.clear();
        // What is no number is missing: a cell may be text that nobody declared.
        cells.extend(row.cells().map(|cell| cell.parse().unwrap_or(f64::NAN)));
        let time_s = match time {
            Time::Rate(rate_hz) => at as f64 / rate_hz,
            Time::Column(column) => cells.get(column).copied().unwrap_or(f64::NAN),
        };
        if !(time_s > before_s && time_s.is_finite()) {
            return Err(in_row(wrong(
                "time does not go on",
                time_s.to_string(),
                "seconds that rise",
            )));
        }
        before_s = time_s;
        let taken_ns = ((time_s - *first_s.get_or_insert(time_s)) * 1e9).round() as u64;
        samples += sensors.len();
        if samples > MAX_SAMPLES {
            return Err(too_many());
        }
        for (columns, moments) in sensors.iter().zip(&mut found) {
            let moment = SensorMoment {
                taken_ns,
                rate_rad_s: vector(&cells, columns.rate),
                acceleration_m_s2: vector(&cells, columns.acceleration),
                field_t: vector(&cells, columns.field).map(|field| field * MICROTESLA),
                orientation: rotation(&cells, columns.orientation),
            };
            let has_something = moment.rate_rad_s.is_some()
                || moment.acceleration_m_s2.is_some()
                || moment.field_t.is_some()
                || moment.orientation.is_some();
            match has_something {
                true => moments.push(moment),
                false => missed += 1,
            }
        }
    }
    let names = declared.sensor.iter().map(|sensor| sensor.name.clone());
    Ok(SensorSeries { missed, ..series(names.zip(found).collect())? })
}

fn too_many() -> Error {
    Error::of(ErrorKind::OutsideLimits, "the table has too many samples")
        .allowed(format!("{MAX_SAMPLES}, all sensors together"))
        .remedy("cut it into shorter ones")
}

#[derive(Clone, Copy)]
enum Time {
    Column(usize),
    Rate(f64),
}

fn vector(cells: &[f64], columns: Option<[usize; 3]>) -> Option<DVec3> {
    let [x, y, z] = columns?.map(|column| cells.get(column).copied().unwrap_or(f64::NAN));
    Some(DVec3::new(x, y, z)).filter(|v| v.is_finite())
}

fn rotation(cells: &[f64], columns: Option<[usize; 4]>) -> Option<DQuat> {
    turn_of(columns?.map(|column| cells.get(column).copied().unwrap_or(f64::NAN)))
}

/// A rotation of w, x, y, z; none if they are none.
fn turn_of([w, x, y, z]: [f64; 4]) -> Option<DQuat> {
    let quaternion = DQuat::from_xyzw(x, y, z, w);
    let is_one = (quaternion.length() - 1.0).abs() < 0.05;
    is_one.then(|| quaternion.normalize())
}

fn series(sensors: Vec<(String, Vec<SensorMoment>)>) -> Result<SensorSeries, Error> {
    let last = sensors.iter().filter_map(|(_, moments)| moments.last()).map(|m| m.taken_ns).max();
    let Some(last_ns) = last else {
        return Err(Error::new("the table holds no samples of sensors"));
    };
    let sensors = sensors.into_iter().collect();
    Ok(SensorSeries { sensors, last_ns, whole: true, ..SensorSeries::default() })
}

/// The sensors of an OpenSim table of orientations. Its world has Y up.
///
/// # Errors
/// A table of something else, one without rows, or with too many.
pub fn of_opensim(opensim: &OpenSimTable) -> Result<SensorSeries, Error> {
    if opensim.cell != OpenSimCell::Quaternion {
        return Err(wrong(
            "not a table of orientations",
            opensim.cell.word(),
            "DataType=Quaternion",
        ));
    }
    if opensim.rows().saturating_mul(opensim.columns.len()) > MAX_SAMPLES {
        return Err(too_many());
    }
    let first_s = opensim.times_s.first().copied().unwrap_or_default();
    let upright = DQuat::from_rotation_x(std::f64::consts::FRAC_PI_2);
    let sensor = |(column, title): (usize, &String)| {
        let moments = opensim.times_s.iter().enumerate().map(|(row, time_s)| {
            let said = opensim.cell(row, column).and_then(|cell| cell.try_into().ok());
            SensorMoment {
                taken_ns: ((time_s - first_s) * 1e9).round() as u64,
                rate_rad_s: None,
                acceleration_m_s2: None,
                field_t: None,
                orientation: said.and_then(turn_of).map(|said| upright * said),
            }
        });
        (title.clone(), moments.collect())
    };
    series(opensim.columns.iter().enumerate().map(sensor).collect())
}

/// The sensor of a text that Xsens' MT Manager exported: lines of remarks that begin with `//`, one of them
/// `// Update Rate: 100.0Hz`, titles, and a row of numbers for each packet. Missing packets are seen by the counter.
///
/// # Errors
/// If it is no such text.
pub fn of_xsens(text: &str, name: &str) -> Result<SensorSeries, Error> {
    let mut lines = text.lines().enumerate().map(|(at, line)| (at + 1, line.trim()));
    let (mut rate_hz, mut titles) = (None, None);
    for (_, line) in lines.by_ref() {
        let Some(remark) = line.strip_prefix("//") else {
            titles = (!line.is_empty()).then_some(line);
            break;
        };
        if let Some((_, told)) = remark.split_once("Update Rate:") {
            let told = told.trim().trim_end_matches(char::is_alphabetic).trim();
            rate_hz = told.parse().ok().filter(|rate_hz: &f64| (0.1..=10_000.0).contains(rate_hz));
        }
    }
    let titles: Vec<&str> = titles.unwrap_or_default().split_whitespace().collect();
    let at = |title: &str| titles.iter().position(|one| one.eq_ignore_ascii_case(title));
    let some = |names: [&str; 3]| -> Option<[usize; 3]> {
        let [x, y, z] = names.map(at);
        Some([x?, y?, z?])
    };
    let Some(counter) = at("PacketCounter") else {
        return Err(wrong(
            "not a text that MT Manager exported",
            titles.first().copied().unwrap_or_default(),
            "remarks that begin with //, then titles with PacketCounter",
        ));
    };
    let Some(rate_hz) = rate_hz else {
        return Err(wrong(
            "the text does not say how often samples were taken",
            "",
            "// Update Rate: 100.0Hz",
        ));
    };
    let quaternion = ["Quat_q0", "Quat_q1", "Quat_q2", "Quat_q3"].map(at);
    let columns = Columns {
        rate: some(["Gyr_X", "Gyr_Y", "Gyr_Z"]),
        acceleration: some(["Acc_X", "Acc_Y", "Acc_Z"]),
        field: some(["Mag_X", "Mag_Y", "Mag_Z"]),
        orientation: match quaternion {
            [Some(w), Some(x), Some(y), Some(z)] => Some([w, x, y, z]),
            _ => None,
        },
    };
    let matrix: Vec<Option<usize>> =
        (0..9).map(|n| at(&format!("Mat[{}][{}]", n / 3 + 1, n % 3 + 1))).collect();
    let (mut moments, mut missed, mut first, mut before) = (Vec::new(), 0, None, None::<f64>);
    let mut cells: Vec<f64> = Vec::with_capacity(titles.len());
    let mut wraps = 0.0;
    for (line, row) in lines.filter(|(_, line)| !line.is_empty()) {
        cells.clear();
        // Tabs keep the places of cells that are empty.
        cells.extend(row.split('\t').map(|cell| cell.trim().parse().unwrap_or(f64::NAN)));
        let packet = cells.get(counter).copied().unwrap_or(f64::NAN);
        if !(packet >= 0.0 && packet.fract() == 0.0) {
            return Err(wrong(
                "a row has no number of its packet",
                packet.to_string(),
                "a whole number",
            )
            .at(format!("line {line}")));
        }
        // The counter of a sensor has 16 bits.
        if before.is_some_and(|before| before - (packet + wraps) > 32_768.0) {
            wraps += 65_536.0;
        }
        let packet = packet + wraps;
        if before.is_some_and(|before| packet <= before) {
            return Err(wrong("packets do not go on", packet.to_string(), "numbers that rise")
                .at(format!("line {line}")));
        }
        missed += before.map_or(0, |before| (packet - before) as u64 - 1);
        before = Some(packet);
        if moments.len() == MAX_SAMPLES {
            return Err(too_many());
        }
        let by_matrix = || {
            let number = |at: usize| Some(*cells.get((*matrix.get(at)?)?)?);
            let mut numbers = [0.0; 9];
            for (n, place) in numbers.iter_mut().enumerate() {
                *place = number(n)?;
            }
            // Row by row in the file.
            let turn = DMat3::from_cols_array(&numbers).transpose();
            let is_turn = (turn.determinant() - 1.0).abs() < 0.05;
            is_turn.then(|| DQuat::from_mat3(&turn).normalize())
        };
        moments.push(SensorMoment {
            taken_ns: ((packet - *first.get_or_insert(packet)) / rate_hz * 1e9).round() as u64,
            rate_rad_s: vector(&cells, columns.rate),
            acceleration_m_s2: vector(&cells, columns.acceleration),
            // In the units of the field at the place where it was calibrated; only its direction counts.
            field_t: vector(&cells, columns.field),
            orientation: rotation(&cells, columns.orientation).or_else(by_matrix),
        });
    }
    let mut found = series(vec![(name.to_owned(), moments)])?;
    found.missed = missed;
    Ok(found)
}

/// Takes axes and scales as they are declared, and finds orientations anew from raw samples: all of them if a mode
/// is asked for, else those of sensors that told none. Which sensors were fused.
///
/// # Errors
/// A sensor that is declared and not there, or one without what the mode needs.
pub fn fuse(
    series: &mut SensorSeries,
    declared: &DeclaredSensors,
    mode: Option<Mode>,
) -> Result<Vec<String>, Error> {
    if let Some(unknown) =
        declared.sensor.iter().find(|one| !series.sensors.contains_key(&one.name))
    {
        let known: Vec<&str> = series.sensors.keys().map(String::as_str).collect();
        return Err(Error::of(ErrorKind::Absent, "a declared sensor is not there")
            .got(unknown.name.clone())
            .allowed(known.join(", ")));
    }
    let mut fused = Vec::new();
    for (name, moments) in &mut series.sensors {
        let in_sensor = |error: Error| error.at(format!("sensor {name}"));
        if let Some(sensor) = declared.named(name) {
            adjust(moments, sensor).map_err(in_sensor)?;
        }
        let is_silent = moments.iter().all(|moment| moment.orientation.is_none());
        if mode.is_none() && !is_silent {
            continue;
        }
        fuse_one(moments, mode.unwrap_or_default()).map_err(in_sensor)?;
        fused.push(name.clone());
    }
    Ok(fused)
}

fn adjust(moments: &mut [SensorMoment], sensor: &DeclaredSensor) -> Result<(), Error> {
    let (turn, rate, acceleration) =
        (sensor.turn()?, sensor.rate_factor()?, sensor.acceleration_factor()?);
    let back = DQuat::from_mat3(&turn.transpose());
    for moment in moments {
        moment.rate_rad_s = moment.rate_rad_s.map(|v| turn * v * rate);
        moment.acceleration_m_s2 = moment.acceleration_m_s2.map(|v| turn * v * acceleration);
        moment.field_t = moment.field_t.map(|v| turn * v);
        moment.orientation = moment.orientation.map(|said| (said * back).normalize());
    }
    Ok(())
}

fn fuse_one(moments: &mut [SensorMoment], mode: Mode) -> Result<(), Error> {
    let lacks = |what: &str| {
        Error::of(ErrorKind::Absent, "a sensor cannot be fused")
            .got(format!("no {what} in any sample"))
            .allowed("angular rate and acceleration, and the field with nine axes")
    };
    let has = |of: fn(&SensorMoment) -> bool| moments.iter().any(of);
    if !has(|moment| moment.rate_rad_s.is_some()) {
        return Err(lacks("angular rate"));
    }
    if !has(|moment| moment.acceleration_m_s2.is_some()) {
        return Err(lacks("acceleration"));
    }
    if mode == Mode::NineAxes && !has(|moment| moment.field_t.is_some()) {
        return Err(lacks("magnetic field"));
    }
    let mut steps: Vec<u64> =
        moments.windows(2).map(|two| two[1].taken_ns - two[0].taken_ns).collect();
    steps.sort_unstable();
    let period_s = steps.get(steps.len() / 2).map_or(0.01, |step_ns| *step_ns as f64 / 1e9);
    let mut orientation = Orientation::new(period_s, mode);
    let mut before_ns = None;
    for moment in moments {
        let step_s = before_ns.map_or(0.0, |before| (moment.taken_ns - before) as f64 / 1e9);
        let said =
            orientation.take(step_s, moment.rate_rad_s, moment.acceleration_m_s2, moment.field_t);
        if said.is_some() {
            before_ns = Some(moment.taken_ns);
        }
        moment.orientation = said.filter(|said| said.settled).map(|said| said.orientation);
    }
    Ok(())
}

/// Fails if a sensor that is worn is none of those that spoke.
///
/// # Errors
/// That one, and those that did.
pub fn check_worn(series: &SensorSeries, declared: &DeclaredSensors) -> Result<(), Error> {
    let mut worn = declared.sensor.iter().filter(|sensor| sensor.segment.is_some());
    let Some(absent) = worn.find(|sensor| !series.sensors.contains_key(&sensor.name)) else {
        return Ok(());
    };
    let known: Vec<&str> = series.sensors.keys().map(String::as_str).collect();
    Err(Error::of(ErrorKind::Absent, "a sensor that is worn did not say anything")
        .got(absent.name.clone())
        .allowed(if known.is_empty() { "none said anything".to_owned() } else { known.join(", ") })
        .remedy("leave its segment out, which is at rest then: --wear FILE without it"))
}

/// Fails if a sensor tells no orientation from one time to another, s from the first sample: outside of what was recorded, or before a filter has
/// settled.
fn check_n_pose(
    series: &SensorSeries,
    names: &[String],
    [from_s, to_s]: [f64; 2],
) -> Result<(), Error> {
    let start_ns = series.start_ns();
    let times_s = |name: &String| {
        let moments = series.sensors.get(name).into_iter().flatten();
        let told = moments.filter(|moment| moment.orientation.is_some());
        told.map(|moment| moment.taken_ns.saturating_sub(start_ns) as f64 / 1e9)
    };
    let silent = names.iter().find(|name| !times_s(name).any(|s| (from_s..=to_s).contains(&s)));
    let Some(silent) = silent else { return Ok(()) };
    let first_s = names.iter().map(|name| times_s(name).fold(f64::INFINITY, f64::min));
    let first_s = first_s.fold(0.0, f64::max);
    let last_s = names.iter().map(|name| times_s(name).fold(0.0, f64::max));
    let last_s = last_s.fold(f64::INFINITY, f64::min);
    let error = Error::of(ErrorKind::Absent, "a sensor tells no orientation in N pose")
        .at(format!("sensor {silent}"))
        .got(format!("{from_s} to {to_s} s"));
    Err(match first_s < last_s {
        true => error
            .allowed(format!("within {first_s:.2} to {last_s:.2} s, when all that are worn tell one"))
            .remedy("say when somebody stood so: n_pose_s in the file of --sensors, or --n-pose FROM,TO"),
        false => error.remedy("leave out the sensor that says nothing: --wear FILE without its segment"),
    })
}

/// How the sensors sit, from the times in which somebody is declared to stand in N pose and to move, and from all that was done
/// since; `None` if none is said to be worn.
///
/// # Errors
/// Sensors that are worn without a time in N pose, an unknown segment or movement, and as [`calibrate_by_all`].
pub fn calibrated(
    series: &SensorSeries,
    declared: &DeclaredSensors,
) -> Result<Option<Kept>, Error> {
    let (mut worn, mut names, mut measured) = (Vec::new(), Vec::new(), Vec::new());
    for sensor in &declared.sensor {
        let Some(of) = sensor.worn()? else { continue };
        measured.push(sensor.forward.as_ref().is_some_and(StrapDirection::is_measured));
        worn.push(of);
        names.push(sensor.name.clone());
    }
    if worn.is_empty() {
        return Ok(None);
    }
    let Some(n_pose_s) = declared.n_pose_s else {
        return Err(Error::new(
            "sensors are worn, and when somebody stands in N pose is not declared",
        )
        .allowed("n_pose_s = [from, to], s, in the file of --sensors, or --n-pose FROM,TO"));
    };
    let start_ns = series.start_ns();
    check_n_pose(series, &names, n_pose_s)?;
    let said = |[from_s, to_s]: [f64; 2]| -> Vec<Vec<DQuat>> {
        let of = |name: &String| {
            let moments = series.sensors.get(name).into_iter().flatten();
            let at_s =
                |moment: &SensorMoment| moment.taken_ns.saturating_sub(start_ns) as f64 / 1e9;
            let within = moments.filter(|moment| (from_s..=to_s).contains(&at_s(moment)));
            within.filter_map(|moment| moment.orientation).collect()
        };
        names.iter().map(of).collect()
    };
    let mut moves = Vec::new();
    for moved in &declared.movement {
        let named = MOVEMENTS.iter().find(|(name, _)| *name == moved.movement);
        let Some((_, movement)) = named.copied() else {
            let known = MOVEMENTS.map(|(name, _)| name).join(", ");
            return Err(wrong("not a movement", &moved.movement, &known));
        };
        moves.push(Moved { movement, orientation: said(moved.time_s) });
    }
    // All that was done from N pose on. Who told a direction, and not an axis, has measured it.
    let mut at_will = Vec::new();
    for (name, is_measured) in names.iter().zip(measured) {
        let mut next_s = n_pose_s[0];
        let mut of = Vec::new();
        for moment in series.sensors.get(name).into_iter().flatten().filter(|_| !is_measured) {
            let at_s = moment.taken_ns.saturating_sub(start_ns) as f64 / 1e9;
            if let Some(orientation) = moment.orientation.filter(|_| at_s >= next_s) {
                of.push(orientation);
                next_s = at_s + AT_WILL_S;
            }
        }
        at_will.push(of);
    }
    let calibration = calibrate_by_all(&worn, &said(n_pose_s), None, &moves, Some(&at_will))?;
    Ok(Some(Kept { subject: String::new(), made_unix_s: 0, sensors: names, calibration }))
}
