//! Who wears which sensor, as it was typed or stands in a file.

use super::source::{Source, What};
use crate::body::Segment;
use crate::body::worn::WornSensor;
use crate::body::worn::strap::StrapDirection;
use crate::body::{segment_name, segment_named};
use crate::error::{Error, ErrorKind};
use crate::toml_text::{from_toml, to_toml};
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;

/// A sensor on a segment.
#[derive(Clone, Debug, PartialEq)]
pub struct Place {
    /// The segment that wears it.
    pub segment: Segment,
    /// Name of the sensor: that of its source, or the one a tracker gives itself.
    pub sensor: String,
    /// The axis of the sensor that points forward in N pose, as far as straps allow.
    pub forward: Option<DVec3>,
}

/// Who wears what, and where it is heard.
#[derive(Clone, Debug, Default)]
pub struct Wear {
    /// What is worn.
    pub places: Vec<Place>,
    /// Where sensors are heard.
    pub sources: Vec<Source>,
}

/// A file of `--wear`.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct WearFile {
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    sources: Vec<String>,
    #[serde(default)]
    forward: Option<StrapDirection>,
    segments: BTreeMap<String, Entry>,
}

#[derive(Serialize, Deserialize)]
#[serde(
    untagged,
    expecting = "no sensor of a segment: \"NAME\", \"imu:PROFILE@BUS\" or { sensor = \"NAME\", forward = \"x\" }"
)]
enum Entry {
    Plain(String),
    Full { sensor: String, forward: Option<StrapDirection> },
}

impl Wear {
    /// From `--from` and `--wear` as they were typed. A sensor that is named like a segment is worn
    /// there; others need a `--wear SEGMENT=SENSOR`, or a file of those.
    ///
    /// # Errors
    /// An unknown segment, one that wears two sensors, a sensor on two segments, a source that
    /// cannot be worn, one that nobody wears.
    pub fn of(sources: Vec<Source>, wear: &[String]) -> Result<Self, Error> {
        let mut all = Self { places: Vec::new(), sources };
        for text in wear {
            match text.split_once('=') {
                Some((segment, sensor)) => {
                    all.put(segment, sensor, Some(DVec3::X)).map_err(|e| at(e, text))?;
                }
                None => all.read(Path::new(text)).map_err(|e| at(e, text))?,
            }
        }
        for source in all.sources.clone() {
            all.place(&source).map_err(|e| at(e, &source.text))?;
        }
        Ok(all)
    }

    /// The same with these sources besides: a sensor that is named like a segment which wears nothing yet is worn there, and any other
    /// source is not.
    #[must_use]
    pub fn beside(mut self, sources: &[Source]) -> Self {
        let sensors = sources.iter().filter(|source| source.check_wearable().is_ok());
        for name in sensors.filter_map(|source| source.name.as_deref()) {
            let is_placed = self.places.iter().any(|place| place.sensor == name);
            let Ok(segment) = segment_named(name) else { continue };
            if !is_placed && self.places.iter().all(|place| place.segment != segment) {
                let sensor = name.to_owned();
                self.places.push(Place { segment, sensor, forward: Some(DVec3::X) });
            }
        }
        self.sources.splice(0..0, sources.iter().cloned());
        self
    }

    /// What is worn, as calibration wants it.
    #[must_use]
    pub fn worn(&self) -> Vec<WornSensor> {
        let worn = |place: &Place| WornSensor { segment: place.segment, forward: place.forward };
        self.places.iter().map(worn).collect()
    }

    /// Who wears what, from the text of a file.
    ///
    /// # Errors
    /// Another format; else as [`Self::of`].
    pub fn parse(text: &str) -> Result<Self, Error> {
        let mut all = Self::default();
        all.take(text)?;
        Ok(all)
    }

    /// The text of a file that says so, without where sensors are heard.
    ///
    /// # Errors
    /// None that these places could have.
    pub fn text_of(places: &[Place]) -> Result<String, Error> {
        let entry = |place: &Place| {
            let forward = Some(match place.forward {
                // No `-0.0`.
                Some(forward) => StrapDirection::Along((forward + DVec3::ZERO).to_array()),
                None => StrapDirection::Words("none".to_owned()),
            });
            (
                segment_name(place.segment).to_owned(),
                Entry::Full { sensor: place.sensor.clone(), forward },
            )
        };
        let segments = places.iter().map(entry).collect();
        to_toml("", &WearFile { sources: Vec::new(), forward: None, segments })
    }

    fn read(&mut self, path: &Path) -> Result<(), Error> {
        self.take(&gaitway_profiles::read_text(path)?)
    }

    fn take(&mut self, text: &str) -> Result<(), Error> {
        let file: WearFile = from_toml(text).map_err(|cause| {
            Error::of(ErrorKind::Malformed, "the file does not say what is worn")
                .got(cause.to_string().trim_end().to_owned())
                .allowed(
                    "[segments] with lines such as left_thigh = \"imu:bno08x-rvc@/dev/ttyUSB0\"",
                )
        })?;
        for source in &file.sources {
            self.sources.push(source.parse()?);
        }
        let usual = file.forward.as_ref().map_or(Ok(Some(DVec3::X)), StrapDirection::forward)?;
        for (segment, entry) in &file.segments {
            let (sensor, forward) = match entry {
                Entry::Plain(sensor) => (sensor, usual),
                Entry::Full { sensor, forward } => {
                    (sensor, forward.as_ref().map_or(Ok(usual), StrapDirection::forward)?)
                }
            };
            self.put(segment, sensor, forward)?;
        }
        Ok(())
    }

    /// Puts a sensor, or what is heard at a source, on a segment.
    ///
    /// # Errors
    /// An unknown segment or source, one that is taken.
    pub fn put(
        &mut self,
        segment: &str,
        sensor: &str,
        forward: Option<DVec3>,
    ) -> Result<(), Error> {
        let segment = segment_named(segment)?;
        let sensor = if sensor.contains('@') {
            let source: Source = sensor.parse()?;
            source.check_wearable()?;
            if matches!(source.what, What::Trackers { .. }) {
                return Err(Error::new("trackers name themselves")
                    .got(sensor)
                    .allowed("the name of one, with this source beside it"));
            }
            let name = segment_name(segment).to_owned();
            self.sources.push(Source { name: Some(name.clone()), ..source });
            name
        } else {
            sensor.to_owned()
        };
        if let Some(other) = self.places.iter().find(|place| place.segment == segment) {
            return Err(Error::new("two sensors are worn on one segment")
                .at(segment_name(segment))
                .got(format!("{} and {sensor}", other.sensor)));
        }
        if let Some(other) = self.places.iter().find(|place| place.sensor == sensor) {
            return Err(Error::new("one sensor is worn on two segments")
                .at(format!("sensor {sensor}"))
                .got(format!("{} and {}", segment_name(other.segment), segment_name(segment))));
        }
        self.places.push(Place { segment, sensor, forward });
        Ok(())
    }

    /// Finds where a source is worn, if its name says so.
    fn place(&mut self, source: &Source) -> Result<(), Error> {
        match (&source.what, &source.name) {
            // Trackers name themselves.
            (What::Trackers { .. }, _) => Ok(()),
            (What::Lines { .. } | What::Servos { .. }, _) => source.check_wearable(),
            (What::Imu { .. }, Some(name)) => {
                let is_same = |other: &&Source| other.name.as_ref() == Some(name);
                if self.sources.iter().filter(is_same).count() > 1 {
                    return Err(Error::new("two sensors are worn on one segment").at(name.clone()));
                }
                match self.places.iter().any(|place| place.sensor == *name) {
                    true => Ok(()),
                    false => self.put(name, name, Some(DVec3::X)),
                }
            }
            (What::Imu { .. }, None) => Err(Error::new("which segment wears this sensor?")
                .allowed(Segment::ALL.map(segment_name).join(", "))
                .remedy(format!("write SEGMENT= before it, e.g. left_thigh={}", source.text))),
        }
    }
}

fn at(error: Error, place: &str) -> Error {
    if error.place.is_none() { error.at(place) } else { error }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wear(sources: &[&str], wear: &[&str]) -> Result<Wear, Error> {
        let sources = sources.iter().map(|text| text.parse()).collect::<Result<_, _>>()?;
        Wear::of(sources, &wear.iter().map(|text| (*text).to_owned()).collect::<Vec<_>>())
    }

    #[test]
    fn a_sensor_named_like_a_segment_is_worn_there_and_others_by_the_map() {
        let all = wear(
            &["left-thigh=imu:bno08x-rvc@/dev/a", "b=imu:x-imu3@/dev/b", "imu:slimevr@udp:6969"],
            &["left_shank=b", "left_foot=tracker-00aa01-0", "head=imu:x-imu3@/dev/c"],
        )
        .expect("fits");
        let places: Vec<(Segment, &str)> =
            all.places.iter().map(|p| (p.segment, p.sensor.as_str())).collect();
        assert_eq!(
            places,
            [
                (Segment::LeftShank, "b"),
                (Segment::LeftFoot, "tracker-00aa01-0"),
                (Segment::Head, "head"),
                (Segment::LeftThigh, "left-thigh"),
            ]
        );
        assert_eq!(all.sources.len(), 4);
    }

    #[test]
    fn beside_what_is_said_to_be_worn_sensors_named_like_segments_are_and_others_are_not() {
        let names = [
            "torso=imu:x-imu3@/dev/a",
            "head=imu:x-imu3@/dev/b",
            "cup=imu:x-imu3@/dev/c",
            "pelvis=lines@/dev/d",
            "imu:x-imu3@/dev/e",
            "left_shank=imu:x-imu3@/dev/f",
        ];
        let sources: Vec<Source> = names.iter().map(|text| text.parse().expect("one")).collect();
        let said = ["left_foot=cup", "head=tracker-1", "right_shank=left_shank"];
        let all = wear(&[], &said).expect("fits").beside(&sources);
        let places: Vec<_> = all.places.iter().map(|of| (of.segment, of.sensor.as_str())).collect();
        let said = [
            (Segment::LeftFoot, "cup"),
            (Segment::Head, "tracker-1"),
            (Segment::RightShank, "left_shank"),
        ];
        assert_eq!(places, [&said[..], &[(Segment::Torso, "torso")]].concat());
        let texts: Vec<&str> = all.sources.iter().map(|source| source.text.as_str()).collect();
        assert_eq!(texts, names);
    }

    #[test]
    fn what_is_worn_is_written_and_read_back_as_it_was() {
        let forward = |forward| Some(DVec3::from_array(forward));
        let place =
            |segment, sensor: &str, forward| Place { segment, sensor: sensor.to_owned(), forward };
        let places = vec![
            place(Segment::Head, "head", forward([1.0, 0.0, 0.0])),
            place(Segment::LeftThigh, "tracker-00aa01-0", forward([0.6, -0.8, 0.0])),
            place(Segment::RightFoot, "an = \"odd\" name", None),
        ];
        let read = Wear::parse(&Wear::text_of(&places).expect("a text")).expect("the same");
        assert_eq!(read.places.len(), 3);
        assert!(places.iter().all(|place| read.places.contains(place)), "{read:?}");
        assert!(read.sources.is_empty());
    }

    #[test]
    fn a_map_that_cannot_be_is_refused_and_names_what_is_wrong() {
        let imu = |name: &str| format!("{name}imu:bno08x-rvc@/dev/a");
        let (thigh, hyphen) = (imu("left_thigh="), imu("left-thigh="));
        for (sources, map, said) in [
            (vec![imu("nose=")], vec![], "no such segment"),
            (vec![imu("")], vec![], "which segment wears this sensor"),
            (vec![thigh.clone(), hyphen], vec![], "two sensors are worn on one segment"),
            (vec![thigh.clone(), thigh.clone()], vec![], "two sensors are worn on one segment"),
            (vec![thigh], vec!["left_thigh=t"], "two sensors are worn on one segment"),
            (vec![], vec!["head=t", "torso=t"], "one sensor is worn on two segments"),
            (vec!["lines@/dev/a".to_owned()], vec![], "cannot be worn"),
            (vec!["servos:op3@sim".to_owned()], vec![], "cannot be worn"),
            (vec![], vec!["/no/such/file.toml"], "no such file"),
        ] {
            let sources: Vec<&str> = sources.iter().map(String::as_str).collect();
            let error = wear(&sources, &map).expect_err(said).to_string();
            assert!(error.to_lowercase().contains(said), "{said}: {error}");
        }
    }
}
