//! A calibration of a body as a file: how sensors sit, who wore them, and when that was found.

use super::calibrate::{Calibration, HeadingBy, Mount};
use crate::body::{segment_name, segment_named};
use crate::error::{Error, ErrorKind};
use crate::time::Utc;
use crate::toml_text::{from_toml, to_toml};
use glam::DQuat;
use serde::{Deserialize, Serialize};

/// Version of the file format.
const SCHEMA: u32 = 1;
/// Straps are taken off and move: a calibration older than this, s, is another day's.
pub const VALID_S: u64 = 12 * 3600;

/// A calibration that was kept.
#[derive(Clone, Debug, PartialEq)]
pub struct Kept {
    /// Who wore the sensors; may be empty.
    pub subject: String,
    /// When it was made, s since 1970.
    pub made_unix_s: u64,
    /// Name of the sensor of each mount, in the order of [`Calibration::mounts`].
    pub sensors: Vec<String>,
    /// How they sit.
    pub calibration: Calibration,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    schema: u32,
    #[serde(default)]
    subject: String,
    /// For people; [`File::made_unix_s`] counts.
    #[serde(default)]
    made: String,
    made_unix_s: u64,
    mount: Vec<Entry>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    segment: String,
    sensor: String,
    sensor_from_segment: [f64; 4],
    heading_rad: f64,
    heading_by: String,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    consistency: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    strapped_off_rad: Option<f64>,
}

const REMARKS: &str = "\
How sensors sit on a body. Quaternions w, x, y, z turn vectors of the segment into those of the
sensor. Headings hold until the sensors are switched off; they are found anew in N pose.";

impl Kept {
    /// The text of a file.
    ///
    /// # Errors
    /// None that a calibration can have.
    pub fn text(&self) -> Result<String, Error> {
        let entry = |(mount, sensor): (&Mount, &String)| {
            let q = mount.sensor_from_segment;
            Entry {
                segment: segment_name(mount.segment).to_owned(),
                sensor: sensor.clone(),
                sensor_from_segment: [q.w, q.x, q.y, q.z],
                heading_rad: mount.heading_rad,
                heading_by: mount.heading_by.word().to_owned(),
                consistency: mount.consistency,
                strapped_off_rad: mount.strapped_off_rad,
            }
        };
        let file = File {
            schema: SCHEMA,
            subject: self.subject.clone(),
            made: Utc(self.made_unix_s).to_string(),
            made_unix_s: self.made_unix_s,
            mount: self.calibration.mounts.iter().zip(&self.sensors).map(entry).collect(),
        };
        to_toml(REMARKS, &file)
    }

    /// Reads the text of a file.
    ///
    /// # Errors
    /// Another format, an unknown segment or one named twice, a quaternion that is none.
    pub fn parse(text: &str) -> Result<Self, Error> {
        let wrong = |got: String| {
            Error::of(ErrorKind::Malformed, "not a calibration of a body")
                .got(got)
                .remedy("calibrate again, or name another file")
        };
        let file: File =
            from_toml(text).map_err(|cause| wrong(cause.to_string().trim().to_owned()))?;
        if file.schema != SCHEMA {
            return Err(wrong(format!("schema {}", file.schema)));
        }
        let mut kept = Self {
            subject: file.subject,
            made_unix_s: file.made_unix_s,
            sensors: Vec::new(),
            calibration: Calibration::default(),
        };
        for entry in file.mount {
            let segment = segment_named(&entry.segment)?;
            let [w, x, y, z] = entry.sensor_from_segment;
            let quaternion = DQuat::from_xyzw(x, y, z, w);
            let numbers = [entry.heading_rad, quaternion.length()];
            if !(numbers.iter().all(|n| n.is_finite()) && (numbers[1] - 1.0).abs() < 1e-3) {
                return Err(wrong(format!("numbers of {}", entry.segment)));
            }
            if kept.calibration.mounts.iter().any(|mount| mount.segment == segment) {
                return Err(wrong(format!("{} twice", entry.segment)));
            }
            let heading_by = HeadingBy::from_word(&entry.heading_by)
                .ok_or_else(|| wrong(format!("heading_by = {:?}", entry.heading_by)))?;
            kept.sensors.push(entry.sensor);
            kept.calibration.mounts.push(Mount {
                segment,
                sensor_from_segment: quaternion.normalize(),
                heading_rad: entry.heading_rad,
                heading_by,
                consistency: entry.consistency,
                strapped_off_rad: entry.strapped_off_rad,
            });
        }
        Ok(kept)
    }

    /// Time since it was made, s, at a moment, s since 1970; zero if that is still to come.
    #[must_use]
    pub const fn age_s(&self, now_unix_s: u64) -> u64 {
        now_unix_s.saturating_sub(self.made_unix_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::Segment;

    fn kept() -> Kept {
        let mount = Mount {
            segment: Segment::LeftThigh,
            sensor_from_segment: DQuat::from_rotation_y(0.3),
            heading_rad: -1.25,
            heading_by: HeadingBy::TPose,
            consistency: None,
            strapped_off_rad: Some(0.1),
        };
        let calibration = Calibration { mounts: vec![mount], notes: Vec::new() };
        Kept {
            subject: "a \"b\"".to_owned(),
            made_unix_s: 951_782_400,
            sensors: vec!["tracker-00aa01-0".to_owned()],
            calibration,
        }
    }

    #[test]
    fn what_is_written_is_read_back() {
        let text = kept().text().expect("a text");
        let read = Kept::parse(&text).expect("reads");
        let (a, b) = (&read.calibration.mounts[0], &kept().calibration.mounts[0]);
        assert!(a.sensor_from_segment.angle_between(b.sensor_from_segment) < 1e-12);
        assert_eq!((read.subject, read.made_unix_s, read.sensors), {
            let kept = kept();
            (kept.subject, kept.made_unix_s, kept.sensors)
        });
        assert_eq!(
            (a.heading_rad, a.heading_by, a.strapped_off_rad),
            (-1.25, b.heading_by, Some(0.1))
        );
    }

    #[test]
    fn files_that_say_nonsense_are_refused() {
        let good = kept().text().expect("a text");
        for (from, to) in [
            ("schema = 1", "schema = 2"),
            ("left_thigh", "left_nose"),
            ("t_pose", "guess"),
            ("heading_rad = -1.25", "heading_rad = nan"),
            ("[[mount]]", "[[mounts]]"),
        ] {
            assert!(good.contains(from), "{from}");
            assert!(Kept::parse(&good.replace(from, to)).is_err(), "{to}");
        }
        let twice =
            good.split_once("[[mount]]").map(|(_, entry)| format!("{good}\n[[mount]]{entry}"));
        assert!(Kept::parse(&twice.expect("an entry")).is_err());
    }
}
