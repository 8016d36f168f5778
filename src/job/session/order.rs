//! Which session is led, and what its sensors are.

use crate::body::anthropometry::Subject;
use crate::body::worn::strap::StrapDirection;
use crate::body::{Segment, segment_name};
use crate::error::Error;
use crate::recording::SampleEncoding;
use crate::sensing::{self, Source, What};
use crate::session::wearers::wearer;
use crate::session::{Plan, SessionFile};
use glam::DVec3;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// Which session is led, and by which sensors.
#[derive(Clone, Debug)]
pub struct SessionOrder {
    /// Its folder: one that is empty or does not exist yet, or that of a session to be gone on with.
    pub folder: PathBuf,
    /// Sensors, each named like the segment that wears it, of a second subject with `2-` before that;
    /// none: those that the session was begun with.
    pub sources: Vec<Source>,
    /// Which segment wears which tracker, `SEGMENT=TRACKER`, or a file that says what is worn, as `live --wear` reads it.
    pub wear: Vec<String>,
    /// What is to be recorded; `None`: the operator is asked, or was when it began.
    pub plan: Option<Plan>,
    /// Whether headings are taken from the magnetic field.
    pub magnetometer: bool,
    /// Subjects of other sessions: who has one of these ids is not measured again.
    pub known: Vec<Subject>,
    /// How samples of sensors are written in trials.
    pub samples: SampleEncoding,
}

/// A sensor of a session.
pub(super) struct Worn {
    /// The name under which it is heard.
    pub(super) heard: String,
    /// The name that says where it is worn.
    pub(super) name: String,
    /// Samples per second by its profile.
    pub(super) rate_hz: f64,
}

/// Trackers that name themselves, each with the name it goes by here.
type Wear = BTreeMap<String, String>;

/// What of a sensor points forward, by the name it goes by here, where that is not X.
pub(super) type Straps = BTreeMap<String, StrapDirection>;

impl SessionOrder {
    /// The same with what files of `--wear` say: sources, trackers, and how they were strapped on.
    pub(super) fn with_files(mut self) -> Result<(Self, Straps), Error> {
        let (typed, files): (Vec<String>, Vec<String>) =
            self.wear.into_iter().partition(|text| text.contains('='));
        self.wear = typed;
        let mut straps = Straps::new();
        let read = sensing::Wear::of(Vec::new(), &files)?;
        for place in read.places {
            let name = segment_name(place.segment).to_owned();
            let is_source = |source: &Source| source.name.as_ref() == Some(&place.sensor);
            if !read.sources.iter().any(is_source) {
                self.wear.push(format!("{name}={}", place.sensor));
            }
            match place.forward {
                Some(DVec3::X) => {}
                Some(forward) => drop(straps.insert(name, StrapDirection::Along(forward.into()))),
                None => drop(straps.insert(name, StrapDirection::Words("none".to_owned()))),
            }
        }
        // As they would be typed: the session's file keeps them so, and is read by nobody who knows the file of today.
        self.sources.extend(read.sources.into_iter().map(|source| match &source.name {
            Some(name) if !source.text.starts_with(&format!("{name}=")) => {
                let text = format!("{name}={}", source.text);
                Source { text, ..source }
            }
            _ => source,
        }));
        Ok((self, straps))
    }

    /// A new session needs sensors; a name mistyped makes no folder.
    pub(super) fn check_sensors(&self) -> Result<(), Error> {
        if self.sources.is_empty() && !self.folder.join("session.toml").exists() {
            return Err(no_sensors().at(self.folder.display().to_string()));
        }
        Ok(())
    }

    /// What a session is to be is said once, when it begins: what is said later and differs would be
    /// ignored, so it is refused.
    pub(super) fn check_as_begun(&self, begun: &SessionFile, straps: &Straps) -> Result<(), Error> {
        let differs = if self.plan.as_ref().is_some_and(|plan| *plan != begun.plan) {
            "--plan"
        } else if self.magnetometer && !begun.magnetometer {
            "--magnetometer"
        } else if self.sources.is_empty() && !self.wear.is_empty() {
            "--wear without sources"
        } else if !straps.is_empty() && *straps != begun.forward {
            "--wear"
        } else {
            return Ok(());
        };
        Err(Error::new("the session was begun with other settings")
            .at(differs)
            .allowed("what stands in session.toml")
            .remedy("leave it out to go on, or begin another session"))
    }

    /// Sources and who wears which tracker, as said now or, of a session that goes on, before.
    pub(super) fn worn_by(
        &self,
        begun: Option<&SessionFile>,
    ) -> Result<(Vec<Source>, Wear), Error> {
        if self.sources.is_empty() {
            let begun = begun.ok_or_else(no_sensors)?;
            return Ok((parsed(&begun.sources)?, begun.wear.clone()));
        }
        let mut wear = Wear::new();
        for text in &self.wear {
            let pair = text.split_once('=').filter(|(segment, _)| wearer(segment).is_some());
            let (segment, tracker) = pair.ok_or_else(|| unnamed(text).at("--wear"))?;
            wear.insert(tracker.to_owned(), segment.to_owned());
        }
        Ok((self.sources.clone(), wear))
    }
}

fn no_sensors() -> Error {
    Error::new("a session needs sensors")
        .allowed("SEGMENT=imu:PROFILE@BUS for each sensor that is worn")
        .remedy(
            "e.g. gaitway record --session lab torso=imu:bno08x-rvc@/dev/ttyUSB0, or a file of them: \
             --wear worn.toml",
        )
}

fn unnamed(text: &str) -> Error {
    Error::new("which segment wears this sensor?").got(text).allowed(format!(
        "{} before the =, of a second subject with 2- before that",
        Segment::ALL.map(segment_name).join(", ")
    ))
}

fn parsed(sources: &[String]) -> Result<Vec<Source>, Error> {
    sources.iter().map(|text| text.parse()).collect()
}

/// The sensors that these sources bring.
pub(super) fn sensors(sources: &[Source], wear: &Wear) -> Result<Vec<Worn>, Error> {
    let mut worn = Vec::new();
    for source in sources {
        let text = &source.text;
        match &source.what {
            What::Imu { profile, .. } => {
                let name = source.name.as_ref().filter(|name| wearer(name).is_some());
                let name = name.ok_or_else(|| unnamed(text))?;
                let rate_hz = gaitway_profiles::sensor(profile)?.rate_hz;
                worn.push(Worn { heard: name.clone(), name: name.clone(), rate_hz });
            }
            What::Trackers { profile, .. } if !wear.is_empty() => {
                let rate_hz = gaitway_profiles::sensor(profile)?.rate_hz;
                worn.extend(wear.iter().map(|(heard, name)| Worn {
                    heard: heard.clone(),
                    name: name.clone(),
                    rate_hz,
                }));
            }
            What::Trackers { .. } => {
                return Err(Error::new("which segment wears which tracker?").got(text).remedy(
                    "add --wear left_thigh=tracker-00aa01-0 for each; `gaitway record` names \
                     those it hears",
                ));
            }
            What::Lines { .. } | What::Servos { .. } => {
                return Err(Error::new("a session records sensors that are worn")
                    .got(text)
                    .allowed(
                        "SEGMENT=imu:PROFILE@BUS, or imu:slimevr@udp:0.0.0.0:6969, imu:natnet@udp:ADDRESS:1510 with --wear",
                    ));
            }
        }
    }
    Ok(worn)
}

/// Each segment once, and the same ones as before.
pub(super) fn check_names(worn: &[Worn], begun: Option<&SessionFile>) -> Result<(), Error> {
    let mut segments: Vec<_> = worn.iter().map(|worn| wearer(&worn.name)).collect();
    segments.sort();
    if let Some(twice) = segments.windows(2).find(|pair| pair[0] == pair[1]) {
        let name = worn.iter().find(|worn| wearer(&worn.name) == twice[0]);
        return Err(Error::new("two sensors are worn on one segment")
            .at(name.map_or_else(String::new, |worn| worn.name.clone())));
    }
    let Some(begun) = begun else { return Ok(()) };
    let before = sensors(&parsed(&begun.sources)?, &begun.wear)?;
    let mut before: Vec<String> = before.into_iter().map(|worn| worn.name).collect();
    let mut now: Vec<String> = worn.iter().map(|worn| worn.name.clone()).collect();
    before.sort();
    now.sort();
    if before == now {
        return Ok(());
    }
    Err(Error::new("the session was begun with other sensors")
        .got(now.join(", "))
        .allowed(before.join(", "))
        .remedy("give the same names (lines may have changed), or begin another session"))
}
