//! Which markers sit where: marker sets, as data, and the labels of a file that belong to one.

use crate::error::{Error, ErrorKind, counted};
use crate::mocap::markers::{Head, PointKind};
use crate::toml_text::from_toml;
use glam::DVec3;
use serde::Deserialize;
use std::collections::{BTreeMap, BTreeSet};

/// The sets that come with the program.
const SHIPPED: [&str; 4] = [
    include_str!("sets/plug-in-gait.toml"),
    include_str!("sets/plug-in-gait-lower.toml"),
    include_str!("sets/cmu-41.toml"),
    include_str!("sets/baseline.toml"),
];

/// A place on the skin, by its usual name (Vicon, "Plug-in Gait Reference Guide", marker placement). Three of the head, on
/// top, in front and beside, and the left of the back have none there.
#[allow(clippy::upper_case_acronyms, missing_docs, reason = "these are their names")]
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Deserialize)]
pub enum MarkerPlace {
    LFHD,
    RFHD,
    LBHD,
    RBHD,
    HTOP,
    HFRO,
    HSID,
    C7,
    T10,
    CLAV,
    STRN,
    LBAK,
    RBAK,
    LSHO,
    LUPA,
    LELB,
    LFRM,
    LWRA,
    LWRB,
    LFIN,
    RSHO,
    RUPA,
    RELB,
    RFRM,
    RWRA,
    RWRB,
    RFIN,
    LASI,
    RASI,
    LPSI,
    RPSI,
    SACR,
    LTHI,
    LKNE,
    LTIB,
    LANK,
    LHEE,
    LTOE,
    LMT5,
    RTHI,
    RKNE,
    RTIB,
    RANK,
    RHEE,
    RTOE,
    RMT5,
}

/// How many there are.
pub const PLACES: usize = MarkerPlace::RMT5 as usize + 1;

impl MarkerPlace {
    /// Its name.
    #[must_use]
    pub fn name(self) -> String {
        format!("{self:?}")
    }
}

/// A marker set.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MarkerSet {
    schema: u32,
    /// Its name.
    pub name: String,
    /// What a person calls it.
    pub title: String,
    needs: Vec<MarkerPlace>,
    has: Vec<MarkerPlace>,
    #[serde(default)]
    aliases: BTreeMap<MarkerPlace, Vec<String>>,
}

/// The markers of one person among the points of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Labelled {
    /// The set they belong to.
    pub set: MarkerSet,
    /// What their labels begin with, before a colon; empty if with nothing.
    pub subject: String,
    /// By place: index of the point.
    points: [Option<usize>; PLACES],
    metres: f64,
}

/// Where the markers of a person are at one time, m, world with Z up; by place.
pub type SeenMarkers = [Option<DVec3>; PLACES];

impl MarkerSet {
    /// Reads the text of a marker set.
    ///
    /// # Errors
    /// If it is not TOML, names places that nobody knows, or is of another schema.
    pub fn parse(text: &str) -> Result<Self, Error> {
        let set: Self = from_toml(text).map_err(|cause| {
            Error::of(ErrorKind::Malformed, "not a marker set")
                .got(cause.to_string().trim().to_owned())
                .allowed(
                    "schema = 1, name, title, needs, has, [aliases] with places of Plug-in Gait",
                )
        })?;
        if set.schema != 1 {
            return Err(Error::of(ErrorKind::Malformed, "a marker set of an unknown schema")
                .got(format!("schema = {}", set.schema))
                .allowed("schema = 1"));
        }
        Ok(set)
    }

    /// The sets that come with the program.
    #[must_use]
    pub fn shipped() -> Vec<Self> {
        SHIPPED.iter().filter_map(|text| Self::parse(text).ok()).collect()
    }

    /// The shipped set of this name.
    ///
    /// # Errors
    /// If there is none.
    pub fn named(name: &str) -> Result<Self, Error> {
        let shipped = Self::shipped();
        let names: Vec<String> = shipped.iter().map(|set| set.name.clone()).collect();
        shipped.into_iter().find(|set| set.name == name).ok_or_else(|| {
            Error::of(ErrorKind::Unknown, "no such marker set").none_of(
                name,
                &names,
                "take one of these, or give the path of a .toml file",
            )
        })
    }

    fn places(&self) -> impl Iterator<Item = MarkerPlace> {
        self.needs.iter().chain(&self.has).copied()
    }

    /// True if a label without its subject stands for a place.
    fn is_called(&self, place: MarkerPlace, label: &str) -> bool {
        let other = self.aliases.get(&place);
        place.name().eq_ignore_ascii_case(label)
            || other.is_some_and(|all| all.iter().any(|name| name.eq_ignore_ascii_case(label)))
    }
}

/// Subject and name of a label: `Daniel:LANK`.
fn parts(label: &str) -> (&str, &str) {
    label.rsplit_once(':').unwrap_or(("", label))
}

impl Labelled {
    /// Finds a person's markers: of the sets that have all they need, the one of which most is there.
    ///
    /// # Errors
    /// If no set matches, or there are several subjects and none is named.
    pub fn find(head: &Head, sets: &[MarkerSet], subject: Option<&str>) -> Result<Self, Error> {
        let metres = head.metres_per_unit().ok_or_else(|| {
            Error::of(ErrorKind::Absent, "the unit of length is unknown")
                .got(format!("\"{}\"", head.unit))
                .allowed("mm, cm, m, in, ft")
        })?;
        let markers = || head.points.iter().filter(|point| point.kind == PointKind::Marker);
        let subjects: BTreeSet<&str> = markers().map(|point| parts(&point.label).0).collect();
        let mut found: Vec<Self> = Vec::new();
        for subject in subjects.iter().filter(|name| subject.is_none_or(|one| one == **name)) {
            let all = sets.iter().filter_map(|set| Self::of(head, set, subject, metres));
            found.extend(all.max_by_key(|labelled| (labelled.count(), labelled.is_exact())));
        }
        if found.len() > 1 {
            let names: Vec<&str> = found.iter().map(|one| one.subject.as_str()).collect();
            return Err(Error::new("there are several subjects in this file")
                .got(names.join(", "))
                .remedy("say whose bones are wanted: --subject NAME"));
        }
        found.pop().ok_or_else(|| no_set(head, sets, &subjects, subject))
    }

    fn of(head: &Head, set: &MarkerSet, subject: &str, metres: f64) -> Option<Self> {
        let mut points = [None; PLACES];
        for place in set.places() {
            points[place as usize] = head.points.iter().position(|point| {
                let (of, label) = parts(&point.label);
                point.kind == PointKind::Marker && of == subject && set.is_called(place, label)
            });
        }
        let has = |place: MarkerPlace| points[place as usize].is_some();
        let has_back = has(MarkerPlace::SACR) || (has(MarkerPlace::LPSI) && has(MarkerPlace::RPSI));
        let is_whole = has_back && set.needs.iter().all(|place| has(*place));
        let (set, subject) = (set.clone(), subject.to_owned());
        is_whole.then_some(Self { set, subject, points, metres })
    }

    /// How many markers of the set are there.
    #[must_use]
    pub fn count(&self) -> usize {
        self.points.iter().flatten().count()
    }

    /// True if the labels are the set's own names rather than others for them.
    fn is_exact(&self) -> bool {
        self.set.aliases.is_empty()
    }

    /// True if the file has a marker at this place.
    #[must_use]
    pub const fn has(&self, place: MarkerPlace) -> bool {
        self.points[place as usize].is_some()
    }

    /// The place whose marker is a point of the file.
    #[must_use]
    pub fn place_of(&self, point: usize) -> Option<MarkerPlace> {
        self.set.places().find(|place| self.points[*place as usize] == Some(point))
    }

    /// The places of the set that have no marker.
    #[must_use]
    pub fn missing(&self) -> Vec<String> {
        // A sacrum marker stands for the two beside it.
        let is_other = |place: MarkerPlace| match place {
            MarkerPlace::SACR => self.has(MarkerPlace::LPSI),
            MarkerPlace::LPSI | MarkerPlace::RPSI => self.has(MarkerPlace::SACR),
            _ => false,
        };
        let places = self.set.places().filter(|place| !self.has(*place) && !is_other(*place));
        places.map(MarkerPlace::name).collect()
    }

    /// Where the markers are in a frame, m, in the axes of the file.
    #[must_use]
    pub fn seen(&self, markers: &crate::mocap::markers::Markers, frame: usize) -> SeenMarkers {
        self.points.map(|point| {
            let sample = markers.sample(frame, point?)?;
            Some(DVec3::from_array(sample.position.map(f64::from)) * self.metres)
        })
    }
}

/// What a file is refused with in which no set is found.
fn no_set(
    head: &Head,
    sets: &[MarkerSet],
    subjects: &BTreeSet<&str>,
    subject: Option<&str>,
) -> Error {
    if let Some(name) = subject.filter(|name| !subjects.contains(name)) {
        let known: Vec<&str> = subjects.iter().copied().filter(|name| !name.is_empty()).collect();
        return Error::of(ErrorKind::Unknown, "no such subject in this file").got(name).allowed(
            if known.is_empty() {
                "labels here name no subject: leave --subject out".to_owned()
            } else {
                known.join(", ")
            },
        );
    }
    let labels: Vec<&str> = head
        .points
        .iter()
        .filter(|point| point.kind == PointKind::Marker)
        .map(|point| parts(&point.label).1)
        .collect();
    let lacking = sets.iter().map(|set| {
        let is_there =
            |place: &MarkerPlace| labels.iter().any(|label| set.is_called(*place, label));
        let missing = set.needs.iter().filter(|place| !is_there(place)).map(|place| place.name());
        let mut missing: Vec<String> = missing.collect();
        if missing.is_empty() {
            missing.push("LPSI and RPSI, or SACR".to_owned());
        }
        format!("{} (lacks {})", set.name, missing.join(" "))
    });
    let shown: Vec<&str> = labels.iter().copied().take(60).collect();
    Error::of(ErrorKind::Refused, "no marker set matches this file")
        .got(format!("{}: {}", counted(labels.len(), "marker"), shown.join(" ")))
        .allowed(lacking.collect::<Vec<_>>().join("; "))
        .remedy("rename the markers, or describe the set in a file: --markers FILE.toml")
}
