//! A person and markers, as what is drawn at each instant.

use super::super::person::PersonTrack;
use super::super::series::Coded;
use super::super::tracks::{MarkerTrack, MarkerTracks};
use super::messages::{Colour, LineKind, Pose, SceneEntity, SceneUpdate, Text};
use super::{Channel, GOOD, LINE_M, MASS, Stage, WORLD, WRONG, update};
use glam::{DQuat, DVec3};
use std::io::{self, Write};

/// The middle, the left and the right of a person.
const SIDES: [Colour; 3] = [
    Colour::new([0.55, 0.6, 0.66, 1.0]),
    Colour::new([0.15, 0.4, 0.85, 1.0]),
    Colour::new([0.85, 0.25, 0.2, 1.0]),
];
const MARKER: Colour = Colour::new([0.2, 0.5, 0.9, 1.0]);
const MENDED: Colour = Colour::new([0.8, 0.55, 0.1, 1.0]);
const UNLABELLED: Colour = Colour::new([0.5, 0.5, 0.5, 1.0]);
const TEXT: Colour = Colour::new([0.4, 0.4, 0.4, 1.0]);
/// Radii of segments, as a part of the stature, and of markers, m.
const SEGMENT: f64 = 0.012;
const MARKER_M: f64 = 0.007;
/// Height of letters, m.
const LETTER_M: f64 = 0.03;

/// A place, sample by sample; not numbers where nobody knows.
struct Path([Vec<f64>; 3]);

impl Path {
    fn of(coded: &[Coded; 3]) -> Self {
        Self(coded.each_ref().map(Coded::values))
    }

    fn at(&self, sample: usize) -> Option<DVec3> {
        let [x, y, z] = self.0.each_ref().map(|axis| axis.get(sample).copied().unwrap_or(f64::NAN));
        Some(DVec3::new(x, y, z)).filter(|at_m| at_m.is_finite())
    }
}

/// A person on the stage.
pub(super) struct Figure<'a> {
    person: &'a PersonTrack,
    points: Vec<Path>,
    centre: Path,
    contacts: Option<Vec<f64>>,
    /// Where the corners of each pose begin, and all of them, m.
    support: Option<(Vec<usize>, [Vec<f64>; 2])>,
    body: Channel<SceneUpdate>,
    balance: Channel<SceneUpdate>,
}

impl<'a> Figure<'a> {
    pub(super) fn new<W: Write>(stage: &mut Stage<W>, person: &'a PersonTrack) -> io::Result<Self> {
        let support = person.support.as_ref().map(|support| {
            let counts = support.counts.values().into_iter();
            let begins = counts.scan(0, |sum, count| {
                let begin = *sum;
                *sum += count as usize;
                Some(begin)
            });
            let mut begins: Vec<usize> = begins.collect();
            begins.push(support.x.count());
            (begins, [support.x.values(), support.y.values()])
        });
        Ok(Self {
            person,
            points: person.points.iter().map(Path::of).collect(),
            centre: Path::of(&person.centre),
            contacts: person.contacts.as_ref().map(Coded::values),
            support,
            body: stage.channel("/scene/person")?,
            balance: stage.channel("/scene/person_balance")?,
        })
    }

    pub(super) fn put<W: Write>(
        &self,
        stage: &mut Stage<W>,
        sample: usize,
        at_s: f64,
    ) -> io::Result<()> {
        stage.tell(self.body, at_s, |ns| update(self.drawn(sample, ns)))?;
        stage.tell(self.balance, at_s, |ns| update(self.balanced(sample, ns)))
    }

    fn drawn(&self, sample: usize, time_ns: u64) -> SceneEntity {
        let radius_m = SEGMENT * self.person.stature_m;
        let mut entity = SceneEntity::of(time_ns, WORLD, "person");
        let at = |point: usize| self.points.get(point).and_then(|path| path.at(sample));
        for (lines, colour) in self.person.lines.iter().zip(SIDES) {
            for (from, to) in *lines {
                if let Some((from_m, to_m)) = at(*from).zip(at(*to)) {
                    entity.capsule([from_m, to_m], radius_m, colour);
                }
            }
        }
        if let [Some(neck_m), Some(crown_m)] = self.person.head.map(at) {
            let radius_m = neck_m.distance(crown_m) / 2.0;
            entity.ball((neck_m + crown_m) / 2.0, radius_m, SIDES[0]);
        }
        entity
    }

    /// The centre of mass with a plumb line, what of the soles carries, and what these span.
    fn balanced(&self, sample: usize, time_ns: u64) -> SceneEntity {
        let radius_m = SEGMENT * self.person.stature_m;
        let mut entity = SceneEntity::of(time_ns, WORLD, "person_balance");
        if let Some(centre_m) = self.centre.at(sample) {
            entity.ball(centre_m, 1.5 * radius_m, MASS);
            entity.line(LineKind::Strip, [centre_m, centre_m.with_z(0.0)], LINE_M, MASS);
        }
        let carries = self.contacts.as_ref().and_then(|of| of.get(sample));
        let carries = carries.map_or(0, |bits| *bits as u8);
        for (bit, sole) in self.person.soles.iter().enumerate() {
            let at_m = self.points.get(*sole).and_then(|path| path.at(sample));
            if let Some(at_m) = at_m.filter(|_| carries >> bit & 1 == 1) {
                entity.ball(at_m, 1.5 * radius_m, GOOD);
            }
        }
        if let Some((begins, [x, y])) = self.support.as_ref().filter(|_| carries != 0) {
            let corners = begins.get(sample).zip(begins.get(sample + 1));
            let corners = corners.map_or(0..0, |(from, to)| *from..*to);
            let corners_m: Vec<DVec3> =
                corners.filter_map(|n| Some(DVec3::new(*x.get(n)?, *y.get(n)?, 0.001))).collect();
            if !corners_m.is_empty() {
                entity.line(LineKind::Loop, corners_m, LINE_M, GOOD);
            }
        }
        entity
    }
}

/// Markers on the stage.
pub(super) struct Dots<'a> {
    markers: &'a MarkerTracks,
    places: Vec<(Path, Option<Path>)>,
    dots: Channel<SceneUpdate>,
    names: Channel<SceneUpdate>,
}

impl<'a> Dots<'a> {
    pub(super) fn new<W: Write>(
        stage: &mut Stage<W>,
        markers: &'a MarkerTracks,
    ) -> io::Result<Self> {
        let place =
            |point: &MarkerTrack| (Path::of(&point.at), point.before.as_ref().map(Path::of));
        Ok(Self {
            markers,
            places: markers.points.iter().map(place).collect(),
            dots: stage.channel("/scene/markers")?,
            names: stage.channel("/scene/marker_names")?,
        })
    }

    pub(super) fn put<W: Write>(
        &self,
        stage: &mut Stage<W>,
        sample: usize,
        at_s: f64,
    ) -> io::Result<()> {
        let points = || self.markers.points.iter().zip(&self.places);
        stage.tell(self.dots, at_s, |ns| {
            let mut entity = SceneEntity::of(ns, WORLD, "markers");
            for (point, (now, before)) in points() {
                let colour = match point {
                    MarkerTrack { labelled: false, .. } => UNLABELLED,
                    MarkerTrack { before: Some(_), .. } => MENDED,
                    _ => MARKER,
                };
                if let Some(at_m) = now.at(sample) {
                    entity.ball(at_m, MARKER_M, colour);
                }
                if let Some(at_m) = before.as_ref().and_then(|before| before.at(sample)) {
                    entity.ball(at_m, MARKER_M, WRONG);
                }
            }
            update(entity)
        })?;
        stage.tell(self.names, at_s, |ns| {
            let mut entity = SceneEntity::of(ns, WORLD, "marker_names");
            for (point, (now, _)) in points().filter(|(point, _)| point.labelled) {
                let Some(at_m) = now.at(sample) else { continue };
                entity.texts.push(Text {
                    pose: Pose::of(at_m + DVec3::Z * LETTER_M, DQuat::IDENTITY),
                    billboard: true,
                    font_size: LETTER_M,
                    color: Some(TEXT),
                    text: point.name.clone(),
                });
            }
            update(entity)
        })
    }
}
