//! A body whose motion is known: a trunk, an upper and a lower limb, with five markers on each, that swing and turn as
//! limbs do, on skin that moves a little.

use gaitway::clean::trial::Trial;
use gaitway::mocap::markers::{
    Frame, FramesOf, Head, MarkerFormat, MarkerPoint, Markers, PointKind, PointSample,
};
use gaitway::mocap::{c3d, marker_table, trc};
use glam::{DQuat, DVec3};
use std::f64::consts::TAU;
use std::fs::File;
use std::io::BufWriter;
use std::ops::Range;
use std::path::Path;

const RATE_HZ: f64 = 100.0;
const FRAMES: usize = 500;
const EACH: usize = 5;

/// A number between -1 and 1 that looks like chance (SplitMix64 of Steele, Lea and Flood 2014).
pub fn noise(seed: u64) -> f64 {
    let mut z = seed.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    (z ^ (z >> 31)) as f64 / (u64::MAX as f64 / 2.0) - 1.0
}

#[derive(Clone, Copy)]
pub struct Body {
    seed: u64,
}

impl Body {
    pub const fn new(seed: u64) -> Self {
        Self { seed }
    }

    fn chance(&self, of: u64) -> f64 {
        noise(self.seed << 20 ^ of)
    }

    /// Where the markers are, m.
    pub fn trial(&self) -> Trial {
        let labels = (0..3 * EACH).map(|marker| format!("M{marker}")).collect();
        let mut trial = Trial::new(RATE_HZ, labels, FRAMES).expect("room");
        for frame in 0..FRAMES {
            for (marker, place) in self.places(frame).into_iter().enumerate() {
                trial.put(marker, frame, Some(place));
            }
        }
        trial
    }

    fn places(&self, frame: usize) -> Vec<DVec3> {
        let time_s = frame as f64 / RATE_HZ;
        let swing = |hz: f64, size: f64, of: u64| {
            size * (TAU * (hz * (1.0 + 0.1 * self.chance(of)) * time_s + self.chance(of + 1))).sin()
        };
        let trunk =
            DQuat::from_rotation_z(swing(0.7, 0.2, 1)) * DQuat::from_rotation_y(swing(1.1, 0.1, 3));
        let hip = DVec3::new(0.8 * time_s, swing(0.9, 0.03, 5), 1.0 + swing(1.8, 0.02, 7));
        let upper = trunk * DQuat::from_rotation_y(swing(0.9, 0.5, 9));
        let knee = hip + upper * DVec3::new(0.0, 0.0, -0.42);
        let lower = upper * DQuat::from_rotation_y(0.5 + swing(0.9, 0.45, 11));
        let segments = [(hip, trunk, 0.25), (hip, upper, -0.4), (knee, lower, -0.4)];
        let mut places = Vec::new();
        for (segment, (origin, turn, length)) in segments.into_iter().enumerate() {
            for marker in 0..EACH {
                let of = 100 + 10 * (segment * EACH + marker) as u64;
                let along = length * (0.15 + 0.18 * marker as f64);
                let own = DVec3::new(
                    0.08 * (TAU * marker as f64 / 2.5).cos(),
                    0.08 * (TAU * marker as f64 / 2.5).sin(),
                    along,
                );
                let skin = DVec3::new(
                    swing(1.3, 0.002, of),
                    swing(1.7, 0.002, of + 2),
                    swing(2.1, 0.002, of + 4),
                );
                let at = |axis: u64| 2e-4 * self.chance(of << 24 ^ axis << 20 ^ frame as u64);
                places.push(origin + turn * (own + skin) + DVec3::new(at(1), at(2), at(3)));
            }
        }
        places
    }

    /// The same as a file has them, mm, without some frames of some markers.
    pub fn markers(&self, gaps: &[(usize, Range<usize>)]) -> Markers {
        self.part(0..FRAMES, gaps)
    }

    /// Some frames of it.
    pub fn part(&self, frames: Range<usize>, gaps: &[(usize, Range<usize>)]) -> Markers {
        let whole = self.trial();
        let mut trial = Trial::new(RATE_HZ, whole.labels().to_vec(), frames.len()).expect("room");
        for marker in 0..whole.markers() {
            for (at, frame) in frames.clone().enumerate() {
                trial.put(marker, at, whole.at(marker, frame));
            }
        }
        for (marker, frames) in gaps {
            trial.take_out(*marker, frames.clone());
        }
        markers_of(&trial, "mm")
    }
}

pub fn markers_of(trial: &Trial, unit: &str) -> Markers {
    let mut head = Head::new(MarkerFormat::C3d);
    head.points = trial
        .labels()
        .iter()
        .map(|label| MarkerPoint {
            label: label.clone(),
            description: String::new(),
            kind: PointKind::Marker,
            unit: unit.to_owned(),
        })
        .collect();
    head.unit = unit.to_owned();
    head.frames = trial.frames();
    head.set_rate(trial.rate_hz());
    let mut markers = Markers::with_room(head).expect("room");
    for frame in 0..trial.frames() {
        let sample = |marker| {
            let position = (trial.at(marker, frame)? * 1e3).as_vec3().to_array();
            Some(PointSample { position, residual: 0.0, cameras: 0 })
        };
        let points = (0..trial.markers()).map(sample).collect();
        markers.push(&Frame { points, analog: Vec::new() });
    }
    markers
}

pub fn write_c3d(path: &Path, markers: &Markers) {
    write(path, markers);
}

pub fn write(path: &Path, markers: &Markers) {
    let mut out = BufWriter::new(File::create(path).expect("a file"));
    let mut frames = FramesOf::new(markers);
    match path.extension().and_then(|ending| ending.to_str()) {
        Some("c3d") => c3d::write::write(&mut out, &mut frames),
        Some("trc") => trc::write(&mut out, "made.trc", &mut frames),
        _ => marker_table::write(&mut out, &mut frames),
    }
    .expect("written");
}
