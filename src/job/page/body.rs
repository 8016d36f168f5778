//! People and markers as pages draw them.

use crate::body::{Proportions, SegmentPose, contact};
use crate::error::Error;
use crate::mocap::anatomy::Capture;
use crate::mocap::markers::{Frame, Frames, MarkerEvent, PointKind};
use crate::mocap::scene::{DrawnFeet, Scene};
use crate::view::person::{PersonTrack, places};
use crate::view::scene::ViewScene;
use crate::view::tracks::{MarkerTrack, MarkerTracks, SampleClock, SpanKind, ViewSpan};
use glam::DVec3;

/// What places of markers are rounded to, m.
const MARKER_M: f64 = 1e-4;
/// Samples of markers on a page, at most: beyond, every second frame is drawn, or every third, ...
const MOST_SAMPLES: usize = 3_000_000;
/// Length of the unit of a file that names none, m.
const USUAL_UNIT_M: f64 = 1e-3;

/// A person who does something, on the floor that the capture shows.
///
/// # Errors
/// A stature nobody has.
pub fn person(capture: &Capture) -> Result<ViewScene, Error> {
    let lengths = Proportions::of_stature(capture.stature_m)?;
    Ok(in_poses(&lengths, &capture.poses, capture.rate_hz, &capture.tracked, capture.is_made))
}

/// A body in these poses, of whose segments these are known: made or measured.
#[must_use]
pub fn in_poses(
    lengths: &Proportions,
    poses: &[SegmentPose],
    rate_hz: f64,
    known: &[bool; 13],
    is_made: bool,
) -> ViewScene {
    let person = PersonTrack::of(&Scene {
        title: "",
        poses,
        body: lengths,
        rate_hz,
        floor_m: contact::floor_m(lengths, poses),
        feet: DrawnFeet::of(is_made, known),
    });
    ViewScene {
        duration_s: poses.len().saturating_sub(1) as f64 / rate_hz,
        person: Some(person),
        ..ViewScene::default()
    }
}

/// Points of two readings of one file, of which one may be mended; marks of the file itself beside them.
///
/// # Errors
/// What keeps frames from being read.
pub fn markers(
    given: &mut dyn Frames,
    mended: Option<&mut dyn Frames>,
) -> Result<ViewScene, Error> {
    let head = given.head().clone();
    let rate_hz = head.rate_hz.unwrap_or(100.0);
    let points: Vec<usize> =
        (0..head.points.len()).filter(|at| head.points[*at].kind == PointKind::Marker).collect();
    let every = (3 * points.len() * head.frames).div_ceil(MOST_SAMPLES).max(1);
    let axes = Axes::of(&head.screen, head.metres_per_unit().unwrap_or(USUAL_UNIT_M));
    let before = places_of(given, &points, every, &axes)?;
    let after = mended.map(|mended| places_of(mended, &points, every, &axes)).transpose()?;
    let count = before.first().map_or(0, Vec::len);
    let coded = |places_m: &[DVec3]| places(places_m, MARKER_M);
    let same = |one: &[DVec3], two: &[DVec3]| {
        let is_same = |(a, b): (&DVec3, &DVec3)| a == b || a.is_nan() && b.is_nan();
        one.iter().zip(two).all(is_same)
    };
    let tracks = points.iter().enumerate().map(|(n, point)| {
        let name = head.points[*point].label.trim().to_owned();
        let now = after.as_ref().map_or(&before[n], |after| &after[n]);
        MarkerTrack {
            labelled: !name.is_empty() && !name.starts_with('*'),
            at: coded(now),
            before: (!same(now, &before[n])).then(|| coded(&before[n])),
            name,
        }
    });
    // Frames of a file are counted from one, and so are times of events.
    let began_s = head.first_frame.saturating_sub(1) as f64 / rate_hz;
    let event = |of: &MarkerEvent| {
        let (label, at_s) = (format!("{} {}", of.context, of.label), of.time_s - began_s);
        ViewSpan::new(SpanKind::Event, "marked in the file", label.trim(), at_s, at_s)
    };
    let clock = SampleClock::Even { rate_hz: rate_hz / every as f64, count };
    Ok(ViewScene {
        duration_s: count.saturating_sub(1) as f64 * every as f64 / rate_hz,
        markers: Some(MarkerTracks { clock, points: tracks.collect() }),
        spans: head.events.iter().map(event).collect(),
        ..ViewScene::default()
    })
}

/// From the axes of a file to Z up.
struct Axes {
    /// Number and sign of the axes that become X, Y and Z.
    from: [(usize, f64); 3],
    metres: f64,
}

impl Axes {
    fn of(screen: &[String; 2], metres: f64) -> Self {
        let up = screen[1].as_str();
        let sign = if up.starts_with('-') { -1.0 } else { 1.0 };
        let from = match up.trim_start_matches(['+', '-']) {
            "X" => [(1, 1.0), (2, 1.0), (0, sign)],
            "Y" => [(2, 1.0), (0, 1.0), (1, sign)],
            _ => [(0, 1.0), (1, 1.0), (2, if up == "-Z" { -1.0 } else { 1.0 })],
        };
        Self { from, metres }
    }

    fn place_m(&self, position: [f32; 3]) -> DVec3 {
        let [x, y, z] = self.from.map(|(axis, sign)| f64::from(position[axis]) * sign);
        DVec3::new(x, y, z) * self.metres
    }
}

/// Where points are in every so manyth frame; not a number where they were not seen.
fn places_of(
    frames: &mut dyn Frames,
    points: &[usize],
    every: usize,
    axes: &Axes,
) -> Result<Vec<Vec<DVec3>>, Error> {
    let mut places_m = vec![Vec::new(); points.len()];
    let mut frame = Frame::default();
    let mut at = 0_usize;
    while frames.next_frame(&mut frame)? {
        if at.is_multiple_of(every) {
            for (places_m, point) in places_m.iter_mut().zip(points) {
                let sample = frame.points.get(*point).copied().flatten();
                places_m.push(sample.map_or(DVec3::NAN, |of| axes.place_m(of.position)));
            }
        }
        at += 1;
    }
    Ok(places_m)
}
