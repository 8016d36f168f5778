//! People and markers as pages draw them.

use crate::body::{Proportions, SegmentPose, contact};
use crate::error::Error;
use crate::mocap::anatomy::Capture;
use crate::mocap::markers::{Frame, Frames, Head, MarkerEvent, PointKind};
use crate::mocap::plates::{GroundForce, Plate, Plates};
use crate::mocap::scene::{DrawnFeet, Scene};
use crate::view::person::{PersonTrack, places};
use crate::view::scene::ViewScene;
use crate::view::tracks::{
    MarkerTrack, MarkerTracks, PlateTrack, PlateTracks, SampleClock, SpanKind, ViewSpan,
};
use glam::DVec3;

/// What places of markers are rounded to, m.
const MARKER_M: f64 = 1e-4;
/// What forces are rounded to, N.
const FORCE_N: f64 = 0.5;
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
    let plates = Plates::of(&head).list;
    let mut forces = vec![Vec::new(); plates.len()];
    let before = places_of(given, &points, every, &axes, |frame| {
        for (forces, (_, plate)) in forces.iter_mut().zip(&plates) {
            forces.push(plate.during(&head.analog, &frame.analog));
        }
    })?;
    let after =
        mended.map(|mended| places_of(mended, &points, every, &axes, |_| ())).transpose()?;
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
    // A file of forces alone has none of points.
    let tracks: Vec<MarkerTrack> = tracks.collect();
    Ok(ViewScene {
        duration_s: count.saturating_sub(1) as f64 * every as f64 / rate_hz,
        plates: plate_tracks(&head, &plates, &forces, &clock, &axes),
        markers: Some(MarkerTracks { clock, points: tracks }),
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
        self.turned(DVec3::from_array(position.map(f64::from))) * self.metres
    }

    /// A direction, or a place in m.
    fn turned(&self, vector: DVec3) -> DVec3 {
        DVec3::from_array(self.from.map(|(axis, sign)| vector[axis] * sign))
    }
}

/// What force plates felt, frame by frame; `None` if there are none that say where.
fn plate_tracks(
    head: &Head,
    plates: &[(usize, Plate)],
    forces: &[Vec<GroundForce>],
    clock: &SampleClock,
    axes: &Axes,
) -> Option<PlateTracks> {
    let track = |((number, plate), forces): (&(usize, Plate), &Vec<GroundForce>)| {
        let coded = |of: &dyn Fn(&GroundForce) -> DVec3, quantum: f64| {
            let all: Vec<DVec3> = forces.iter().map(|force| axes.turned(of(force))).collect();
            places(&all, quantum)
        };
        let nobody = DVec3::NAN;
        PlateTrack {
            name: match head.plates.len() {
                1 => "force plate".to_owned(),
                _ => format!("force plate {}", number + 1),
            },
            corners_m: plate.corners_m().map(|corner_m| axes.turned(corner_m).to_array()),
            force: coded(&|of| of.force_n, FORCE_N),
            at: coded(&|of| of.centre_of_pressure_m.unwrap_or(nobody), MARKER_M),
        }
    };
    let plates: Vec<PlateTrack> = plates.iter().zip(forces).map(track).collect();
    (!plates.is_empty()).then(|| PlateTracks { clock: clock.clone(), plates })
}

/// Where points are in every so manyth frame, which `seen` sees as well; not a number where they were not seen.
fn places_of(
    frames: &mut dyn Frames,
    points: &[usize],
    every: usize,
    axes: &Axes,
    mut seen: impl FnMut(&Frame),
) -> Result<Vec<Vec<DVec3>>, Error> {
    let mut places_m = vec![Vec::new(); points.len()];
    let mut frame = Frame::default();
    let mut at = 0_usize;
    while frames.next_frame(&mut frame)? {
        if at.is_multiple_of(every) {
            seen(&frame);
            for (places_m, point) in places_m.iter_mut().zip(points) {
                let sample = frame.points.get(*point).copied().flatten();
                places_m.push(sample.map_or(DVec3::NAN, |of| axes.place_m(of.position)));
            }
        }
        at += 1;
    }
    Ok(places_m)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mocap::markers::{
        Analog, AnalogChannel, ForcePlate, FramesOf, MarkerFormat, Markers, PlateKind,
    };
    use crate::view::series::Coded;

    /// Somebody of 800 N stands 0.1 m beside the middle of a plate, in a laboratory with Y up.
    #[test]
    fn a_force_plate_is_drawn_with_z_up_where_somebody_presses_and_not_while_nobody_does() {
        let mut head = Head::new(MarkerFormat::C3d);
        head.unit = "m".to_owned();
        head.screen = ["+X".to_owned(), "+Y".to_owned()];

        let channel = |unit: &str| AnalogChannel {
            label: String::new(),
            description: String::new(),
            unit: unit.to_owned(),
            scale: 1.0,
            offset: 0.0,
        };
        let channels = ["N", "N", "N", "Nm", "Nm", "Nm"].map(channel).to_vec();
        head.analog = Analog { channels, per_frame: 1, rate_hz: None };
        // X of the plate along X, its Z down: its Y is Z of the laboratory.
        let corners = [[1.3, 0.0, 2.2], [0.7, 0.0, 2.2], [0.7, 0.0, 1.8], [1.3, 0.0, 1.8]];
        head.plates = vec![ForcePlate {
            kind: PlateKind::ForcesMoments,
            corners,
            origin: [0.0; 3],
            channels: (0..6).map(Some).collect(),
            calibration: Vec::new(),
        }];
        head.set_rate(100.0);
        let mut markers = Markers::with_room(head).unwrap();
        for pressed_n in [800.0_f32, 0.0] {
            let mut frame = Frame::default();
            // Pressed at x = 0.1: about Y of the plate by -x Fz.
            frame.analog.extend([0.0, 0.0, -pressed_n, 0.0, 0.1 * pressed_n, 0.0]);

            markers.push(&frame);
        }
        let scene = super::markers(&mut FramesOf::new(&markers), None).unwrap();
        let plates = scene.plates.unwrap().plates;
        let values = |coded: &[Coded; 3]| coded.each_ref().map(Coded::values);
        assert_eq!(plates[0].name, "force plate");
        let near = |found: [Vec<f64>; 3], expected: [f64; 3]| {
            for (found, expected) in found.iter().zip(expected) {
                assert!((found[0] - expected).abs() < 1e-3, "{found:?}, {expected}");
            }
        };
        // Z of the file is X here, X is Y, and Y is up.
        near(values(&plates[0].at), [2.0, 1.1, 0.0]);
        near(values(&plates[0].force), [0.0, 0.0, 800.0]);
        assert!(values(&plates[0].at)[0][1].is_nan());
        assert_eq!(plates[0].corners_m[0], [2.2_f32, 1.3, 0.0].map(f64::from));
    }
}
