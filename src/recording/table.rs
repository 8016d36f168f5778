//! A recording as a table of comma-separated values, for spreadsheets and statistics.
//!
//! Samples of sensors: one row per sample, all sensors in one table in the order in which they were
//! read. Joints of a robot, if the recording has no sensors: one row per cycle. What was not measured
//! is an empty cell. Times are seconds since the start of the recording.

use super::disk::open;
use super::imu_message::{Imu, Rotation, SensorMessage, Turned, Vector};
use super::reader::read;
use super::scan::{Channel, Found, scan};
use crate::error::Error;
use crate::table::TableWriter;
use mcap::records::MessageHeader;
use std::collections::BTreeMap;
use std::io::{BufReader, Write};
use std::path::Path;

const TITLES: &str = "sensor,number,taken_s,read_s,order,missed_before,acceleration_x_m_s2,\
acceleration_y_m_s2,acceleration_z_m_s2,rate_x_rad_s,rate_y_rad_s,rate_z_rad_s,field_x_t,field_y_t,\
field_z_t,device_w,device_x,device_y,device_z,fused_w,fused_x,fused_y,fused_z,settled,\
temperature_c,device_counter,device_ticks";

/// What was written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Rows {
    /// Rows, titles not counted.
    pub rows: u64,
    /// Samples or cycles that are missing in the recording.
    pub missing: u64,
    /// True if the recording was closed as it should be and nothing in it is damaged.
    pub whole: bool,
}

/// Writes a recording as a table.
///
/// # Errors
/// A recording that cannot be read or holds neither samples nor cycles; a table that cannot be
/// written.
pub fn write_csv(path: &Path, out: &mut impl Write) -> Result<Rows, Error> {
    let file = open(path)?;
    let mut table = Samples {
        out: TableWriter::new(&mut *out),
        pending: BTreeMap::new(),
        start_ns: None,
        rows: Rows::default(),
    };
    let tally = scan(BufReader::new(file), |found| match found {
        Found::Message { channel, header, body } => table.add(channel, &header, body),
        Found::Metadata(_) => Ok(()),
    })
    .map_err(|error| error.at(path.display().to_string()))?;
    let mut rows = table.finish()?;
    if rows.rows == 0 {
        return joints(path, out);
    }
    rows.whole = tally.finished && tally.lost_bytes == 0;
    Ok(rows)
}

struct Samples<W: Write> {
    out: TableWriter<W>,
    /// Samples whose orientation may still follow, by sensor.
    pending: BTreeMap<String, (Box<Imu>, MessageHeader)>,
    start_ns: Option<u64>,
    rows: Rows,
}

impl<W: Write> Samples<W> {
    fn add(&mut self, channel: &Channel, header: &MessageHeader, body: &[u8]) -> Result<(), Error> {
        self.start_ns.get_or_insert(header.log_time);
        let Some((name, part)) =
            channel.topic.strip_prefix("/imu/").and_then(|t| t.rsplit_once('/'))
        else {
            return Ok(());
        };
        let turned = match SensorMessage::read(&channel.encoding, part, body) {
            Some(SensorMessage::Sample(sample, turned)) => {
                let missing = sample.missed_before.saturating_add(sample.dropped_before);
                self.rows.missing = self.rows.missing.saturating_add(missing);
                let before = self.pending.insert(name.to_owned(), (sample, *header));
                if let Some((sample, header)) = before {
                    self.row(name, &sample, &header, None)?;
                }
                turned
            }
            Some(SensorMessage::Turned(turned)) => Some(turned),
            None => None,
        };
        let told = turned.and_then(|turned| Some((turned, self.pending.remove(name)?)));
        told.map_or(Ok(()), |(turned, (sample, header))| {
            self.row(name, &sample, &header, Some(turned))
        })
    }

    fn finish(mut self) -> Result<Rows, Error> {
        for (name, (sample, header)) in std::mem::take(&mut self.pending) {
            self.row(&name, &sample, &header, None)?;
        }
        self.out.finish()?;
        Ok(self.rows)
    }

    fn row(
        &mut self,
        name: &str,
        sample: &Imu,
        header: &MessageHeader,
        turned: Option<Turned>,
    ) -> Result<(), Error> {
        if self.rows.rows == 0 {
            self.out.row(TITLES.split(','))?;
        }
        self.rows.rows += 1;
        let start_ns = self.start_ns.unwrap_or(0);
        let since_s =
            |ns: u64| format!("{:.9}", (i128::from(ns) - i128::from(start_ns)) as f64 / 1e9);
        let fused = turned.filter(|turned| turned.is_fused);
        let mut cells = vec![
            name.to_owned(),
            sample.number.to_string(),
            since_s(header.publish_time),
            since_s(header.log_time),
            sample.order.to_string(),
            sample.missed_before.to_string(),
        ];
        for of in [sample.linear_acceleration, sample.angular_velocity, sample.magnetic_field] {
            cells.extend(vector(of));
        }
        cells.extend(rotation(sample.orientation));
        cells.extend(rotation(fused.map(|fused| fused.rotation)));
        cells.push(fused.map_or_else(String::new, |fused| u8::from(fused.settled).to_string()));
        cells.push(cell(sample.temperature_c));
        cells.push(cell(sample.device_counter));
        cells.push(cell(sample.device_ticks));
        self.out.row(cells)
    }
}

fn cell(value: Option<impl ToString>) -> String {
    value.map_or_else(String::new, |value| value.to_string())
}

fn vector(value: Option<Vector>) -> [String; 3] {
    value.map_or_else(Default::default, |v| [v.x, v.y, v.z].map(|part| part.to_string()))
}

fn rotation(value: Option<Rotation>) -> [String; 4] {
    value.map_or_else(Default::default, |q| [q.w, q.x, q.y, q.z].map(|part| part.to_string()))
}

/// One row per cycle.
fn joints(path: &Path, out: &mut impl Write) -> Result<Rows, Error> {
    let recording = read(path)?;
    if recording.cycles.is_empty() {
        return Err(Error::new("the recording holds neither samples nor cycles")
            .at(path.display().to_string()));
    }
    let mut out = TableWriter::new(out);
    let named = |name: &String| [format!("{name}_goal_rad"), format!("{name}_rad")];
    let titles = ["cycle", "time_s"].map(str::to_owned).into_iter();
    out.row(titles.chain(recording.joint_names.iter().flat_map(named)))?;
    let first = recording.cycles[0].at;
    let mut rows = Rows {
        missing: recording.dropped_cycles,
        whole: recording.finished && recording.lost_bytes == 0,
        rows: 0,
    };
    for cycle in &recording.cycles {
        let time_s = format!("{:.9}", cycle.at.seconds_since(first));
        let mut row = vec![cycle.cycle.to_string(), time_s];
        for joint in &cycle.joints {
            row.extend([cell(joint.goal_rad), cell(joint.present_position_rad)]);
            rows.missing = rows.missing.saturating_add(u64::from(joint.missed.is_some()));
        }
        out.row(row)?;
        rows.rows += 1;
    }
    out.finish()?;
    Ok(rows)
}
