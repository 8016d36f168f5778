//! A subject's calibration as a file, and as part of every recording that leans on it.

use super::files::SCHEMA;
use super::utc::Utc;
use super::wearers::{segment_name, segment_named};
use crate::body::Segment;
use crate::body::worn::{Calibration, HeadingBy, Mount};
use crate::error::Error;
use glam::DQuat;
use serde::{Deserialize, Serialize};

/// Under this key the metadata of a recording holds the calibration, as TOML.
pub const METADATA_KEY: &str = "body_calibration";
/// In N pose a segment is upright to within this, or its sensor has slipped, rad.
const SLIPPED_RAD: f64 = 15.0 * core::f64::consts::PI / 180.0;

/// `calibration/body-ID-NN.toml`: how each sensor sits on a body.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BodyCalibration {
    /// Version of the format; 1.
    pub schema: u32,
    /// Id of the subject.
    pub subject: String,
    /// The subject's stature, m.
    pub stature_m: Option<f64>,
    /// When it was made.
    pub made: Utc,
    /// Until when it is trusted.
    pub expires: Utc,
    /// True if it may be used.
    pub passed: bool,
    /// Largest error of a worn segment in the pose that was held to verify it, rad.
    pub verified_rad: Option<f64>,
    /// What a person should know.
    #[serde(default)]
    pub notes: Vec<String>,
    /// Sensor by sensor.
    #[serde(rename = "sensor")]
    pub sensors: Vec<MountRow>,
}

/// How one sensor sits.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MountRow {
    /// Name of the source.
    pub source: String,
    /// The segment that wears it.
    pub segment: String,
    /// Turns vectors of the segment into those of the sensor: w, x, y, z.
    pub sensor_from_segment: [f64; 4],
    /// Heading of the sensor's world in ours, rad. It starts anew with the sensor's filter.
    pub heading_rad: f64,
    /// `movement`, `t-pose` or `strapping`.
    pub heading_by: String,
    /// Second over first principal component of the movement's angular rate.
    pub consistency: Option<f64>,
    /// How far the sensor sits from where it was to be strapped on, rad.
    pub strapped_off_rad: Option<f64>,
    /// Error in the pose that was held to verify it, rad.
    pub verified_rad: Option<f64>,
}

const HEADINGS: [(HeadingBy, &str); 3] = [
    (HeadingBy::Movement, "movement"),
    (HeadingBy::TPose, "t-pose"),
    (HeadingBy::Strapping, "strapping"),
];

impl MountRow {
    /// What was found of the sensor called `source`.
    #[must_use]
    pub fn of(source: &str, mount: &Mount) -> Self {
        let q = mount.sensor_from_segment;
        let by = HEADINGS.iter().find(|(by, _)| *by == mount.heading_by);
        Self {
            source: source.to_owned(),
            segment: segment_name(mount.segment).to_owned(),
            sensor_from_segment: [q.w, q.x, q.y, q.z],
            heading_rad: mount.heading_rad,
            heading_by: by.map_or("strapping", |(_, word)| word).to_owned(),
            consistency: mount.consistency,
            strapped_off_rad: mount.strapped_off_rad,
            verified_rad: None,
        }
    }

    /// The segment that wears it.
    ///
    /// # Errors
    /// A name that is none.
    pub fn segment(&self) -> Result<Segment, Error> {
        segment_named(&self.segment).ok_or_else(|| {
            Error::new("a calibration names no segment of the body")
                .at(format!("sensor {}", self.source))
                .got(self.segment.clone())
                .allowed(super::wearers::segment_names())
        })
    }

    fn mount(&self) -> Result<Mount, Error> {
        let [w, x, y, z] = self.sensor_from_segment;
        let turn = DQuat::from_xyzw(x, y, z, w);
        let of_unit_length = (turn.length() - 1.0).abs() <= 1e-3;
        if !(of_unit_length && self.heading_rad.is_finite()) {
            return Err(Error::new("a calibration holds no rotation")
                .at(format!("sensor {}", self.source))
                .got(format!("{:?}, {}", self.sensor_from_segment, self.heading_rad)));
        }
        let by = HEADINGS.iter().find(|(_, word)| *word == self.heading_by);
        Ok(Mount {
            segment: self.segment()?,
            sensor_from_segment: turn.normalize(),
            heading_rad: self.heading_rad,
            heading_by: by.map_or(HeadingBy::Strapping, |(by, _)| *by),
            consistency: self.consistency,
            strapped_off_rad: self.strapped_off_rad,
        })
    }
}

impl BodyCalibration {
    /// Reads a calibration, from a file or a recording.
    ///
    /// # Errors
    /// What is none, of another version, or wears two sensors on one segment.
    pub fn parse(text: &str) -> Result<Self, Error> {
        let calibration: Self = toml::from_str(text).map_err(|e| {
            Error::new("this is no calibration of a body").got(e.message().replace('\n', "; "))
        })?;
        if calibration.schema != SCHEMA {
            return Err(Error::new("a body's calibration of another version")
                .got(calibration.schema.to_string())
                .allowed(SCHEMA.to_string()));
        }
        calibration.worn()?;
        Ok(calibration)
    }

    /// As [`Wearing`](crate::body::worn::Wearing) takes it.
    ///
    /// # Errors
    /// A segment that is none or wears two sensors, a rotation that is none.
    pub fn worn(&self) -> Result<Calibration, Error> {
        let mounts: Vec<Mount> =
            self.sensors.iter().map(MountRow::mount).collect::<Result<_, _>>()?;
        for (at, mount) in mounts.iter().enumerate() {
            if mounts[..at].iter().any(|other| other.segment == mount.segment) {
                return Err(Error::new("two sensors are worn on one segment")
                    .at(segment_name(mount.segment)));
            }
        }
        Ok(Calibration { mounts, notes: self.notes.clone() })
    }

    /// Finds the headings anew from a person who stands in N pose, facing forward: `said` is the
    /// mean orientation of every sensor, in the order of [`Self::sensors`]. How far each segment
    /// then is from upright, rad.
    ///
    /// # Errors
    /// A sensor that said nothing, and one that has slipped since it was calibrated.
    pub fn face_forward(&mut self, said: &[Option<DQuat>]) -> Result<Vec<f64>, Error> {
        let mut off = Vec::new();
        let mut headings = Vec::new();
        for (at, row) in self.sensors.iter().enumerate() {
            let silent = || {
                Error::new("a sensor said nothing in N pose")
                    .at(row.source.clone())
                    .remedy("is it switched on, and in reach?")
            };
            let said = said.get(at).copied().flatten().ok_or_else(silent)?;
            let turned = said * row.mount()?.sensor_from_segment;
            // The turn about the vertical nearest to it; what is left leans.
            let heading_rad = -2.0 * turned.z.atan2(turned.w);
            let upright = DQuat::from_rotation_z(heading_rad) * turned;
            let lean_rad = upright.angle_between(DQuat::IDENTITY);
            if !(lean_rad <= SLIPPED_RAD) {
                return Err(Error::new("a sensor has slipped, or the pose was no N pose")
                    .at(row.source.clone())
                    .got(format!("{:.0} deg from upright", lean_rad.to_degrees()))
                    .allowed(format!("{:.0} deg", SLIPPED_RAD.to_degrees()))
                    .remedy("stand upright with the arms down; or calibrate the subject again"));
            }
            headings.push(crate::units::wrap_rad(heading_rad));
            off.push(lean_rad);
        }
        for (row, heading_rad) in self.sensors.iter_mut().zip(headings) {
            row.heading_rad = heading_rad;
        }
        Ok(off)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn row(segment: &str, turn: DQuat) -> MountRow {
        MountRow {
            source: segment.to_owned(),
            segment: segment.to_owned(),
            sensor_from_segment: [turn.w, turn.x, turn.y, turn.z],
            heading_rad: 0.3,
            heading_by: "movement".to_owned(),
            consistency: Some(0.02),
            strapped_off_rad: None,
            verified_rad: Some(0.05),
        }
    }

    fn calibration(sensors: Vec<MountRow>) -> BodyCalibration {
        BodyCalibration {
            schema: 1,
            subject: "s01".into(),
            stature_m: Some(1.7),
            made: Utc(1_000_000_000),
            expires: Utc(1_000_014_400),
            passed: true,
            verified_rad: Some(0.05),
            notes: vec!["a \"note\"\nof two lines".into()],
            sensors,
        }
    }

    #[test]
    fn a_calibration_is_read_as_it_was_written_and_nothing_else_is() {
        let turn = DQuat::from_rotation_y(0.4);
        let whole = calibration(vec![row("torso", turn), row("left_shank", turn)]);
        let text = super::super::toml_text::to_text(&whole).unwrap();
        assert_eq!(BodyCalibration::parse(&text), Ok(whole.clone()));
        assert_eq!(MountRow::of("torso", &whole.sensors[0].mount().unwrap()).heading_rad, 0.3);
        for (from, to) in [
            ("schema = 1", "schema = 2"),
            ("\"left_shank\"", "\"tail\""),
            ("\"left_shank\"", "\"torso\""),
            ("sensor_from_segment = [", "sensor_from_segment = [9.0, "),
            ("heading_rad = 0.3", "heading_rad = nan"),
        ] {
            let changed = text.replace(from, to);
            assert!(changed != text && BodyCalibration::parse(&changed).is_err(), "{to}");
        }
    }

    proptest! {
        #[test]
        fn headings_are_found_again_whatever_they_became(
            tilt in -1.0..1.0_f64, about in -3.0..3.0_f64, heading in -3.0..3.0_f64,
        ) {
            let mount = DQuat::from_rotation_z(about) * DQuat::from_rotation_x(tilt);
            let mut found = calibration(vec![row("torso", mount)]);
            // Upright, facing forward: world from sensor is Rz(-heading) mount^-1.
            let said = DQuat::from_rotation_z(-heading) * mount.inverse();
            let off = found.face_forward(&[Some(said)]).unwrap();
            prop_assert!(off[0] < 1e-6);
            let turned = crate::units::wrap_rad(found.sensors[0].heading_rad - heading);
            prop_assert!(turned.abs() < 1e-9, "{turned}");
        }
    }

    #[test]
    fn a_sensor_that_slipped_or_is_silent_is_named_and_nothing_is_changed() {
        let mut found = calibration(vec![row("torso", DQuat::IDENTITY)]);
        let before = found.clone();
        let leans = DQuat::from_rotation_y(0.4);
        let error = found.face_forward(&[Some(leans)]).unwrap_err().to_string();
        assert!(error.contains("slipped") && error.contains("torso"), "{error}");
        assert!(found.face_forward(&[None]).is_err());
        assert_eq!(found, before);
    }
}
