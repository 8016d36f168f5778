//! What a body's motion says of the ground, against force plates that measured it: how hard the ground pushes, and
//! when feet touch it and leave it.

use crate::aloud::aloud;
use crate::captured;
use gaitway::body::Proportions;
use gaitway::body::carrying::{FootPart, MeasuredFoot};
use gaitway::body::mass::segment_masses;
use gaitway::mocap::c3d;
use gaitway::mocap::markers::{Frame, Head, Markers};
use gaitway::mocap::plates::{Plate, Plates};
use gaitway::mocap::plug_in_gait::GaitBones;
use gaitway::motion::smooth::low_pass;
use gaitway::recognise::points::Lengths;
use gaitway::rigid::ground::{GRAVITY_M_S2, GroundReaction, reactions};
use gaitway::rigid::mass::{Mass, Posed};
use glam::{DQuat, DVec3};
use std::ops::RangeInclusive;
use std::path::Path;

/// Forces of both kinds are compared below this frequency, Hz: as usual for markers of gait (Winter, "Biomechanics
/// and Motor Control of Human Movement", 4th ed., 2009, sec. 3.4.4.3).
const CUTOFF_HZ: f64 = 6.0;

/// A trial in which all ground that carries is measured for a while.
struct Measured {
    file: &'static str,
    /// From the file's first frame, s.
    span_s: RangeInclusive<f64>,
    /// Most that force by motion and measured force may differ by, root mean square, % of body weight.
    most_percent: f64,
}

/// - On the level: until 1.18 s the rear foot stands beside the plates. The heel of the foot that lands on the first
///   plate is 49 mm behind its edge, and carries there until it rises, at 1.34 s; the third foot lands behind the
///   plates after 2.04 s.
/// - Downstairs: the foot on the landing leaves it at 0.50 s, and from 2.50 s the other lands beside the last plate.
const TRIALS: [Measured; 2] = [
    Measured { file: "PiG_Motion-FlatFoot-Full.c3d", span_s: 1.34..=2.04, most_percent: 8.0 },
    Measured { file: "cgm_Movement_trial.c3d", span_s: 0.55..=2.48, most_percent: 4.5 },
];

/// A plate that shows less than this may have nobody on it, N.
const IDLE_N: f64 = 25.0;
/// A foot is on a plate from this force on, N: usual in gait analysis, and four times the noise of these plates.
const PRESSED_N: f64 = 20.0;

/// A file with its plates.
struct Trial {
    markers: Markers,
    plates: Vec<Plate>,
    /// By plate, what it shows while nobody is on it, N.
    idle_n: Vec<f64>,
    rate_hz: f64,
}

impl Trial {
    fn read(path: &Path) -> Self {
        let markers = c3d::read(path).expect("read");
        let head = markers.head();
        assert_eq!(head.screen[1], "+Z", "{}: up", path.display());
        let plates: Vec<Plate> =
            Plates::of(head).list.into_iter().map(|(_, plate)| plate).collect();
        let rate_hz = head.rate_hz.expect("a rate");
        let idle_n = plates.iter().map(|plate| {
            // The mean of each frame: single samples of some plates are cut off near zero.
            let up_n = |frame| {
                plate.during(&markers.head().analog, markers.analog_counts(frame)).force_n.z
            };
            let mut idle: Vec<f64> = (0..markers.head().frames).map(up_n).collect();
            idle.retain(|up_n| up_n.abs() < IDLE_N);
            idle.sort_by(f64::total_cmp);
            idle.get(idle.len() / 2).copied().unwrap_or(0.0)
        });
        let idle_n = idle_n.collect();
        Self { idle_n, markers, plates, rate_hz }
    }

    fn head(&self) -> &Head {
        self.markers.head()
    }

    /// What a plate pushes up with, less what it shows with nobody on it, N, sample by sample.
    fn up_n(&self, plate: usize) -> Vec<f64> {
        let (analog, idle_n) = (&self.head().analog, self.idle_n[plate]);
        let counts = (0..self.head().frames).flat_map(|frame| {
            self.markers.analog_counts(frame).chunks_exact(analog.channels.len())
        });
        counts.map(|counts| self.plates[plate].at(analog, counts).force_n.z - idle_n).collect()
    }

    /// Where a marker is, by frame, m.
    fn places_m(&self, name: &str) -> Vec<Option<DVec3>> {
        let metres = self.head().metres_per_unit().expect("a unit");
        let point = marker(self.head(), name).expect(name);
        let mut frame = Frame::default();
        let place = |at| {
            assert!(self.markers.frame(at, &mut frame));
            place_m(&frame, point, metres)
        };
        (0..self.head().frames).map(place).collect()
    }

    /// The legs of a body whose legs are as long as the person's: from the front of the hip bone over the knee to
    /// the ankle, mean of both and of all frames.
    fn legs(&self) -> Lengths {
        let mean_m = |from: &str, to: &str| {
            let (mut sum_m, mut count) = (0.0, 0.0);
            for side in ['L', 'R'] {
                let [from, to] = [from, to].map(|name| self.places_m(&format!("{side}{name}")));
                for (from_m, to_m) in from.into_iter().zip(to) {
                    let Some((from_m, to_m)) = from_m.zip(to_m) else { continue };
                    sum_m += from_m.distance(to_m);
                    count += 1.0;
                }
            }
            sum_m / count
        };
        let length_m = mean_m("ASI", "KNE") + mean_m("KNE", "ANK");
        let body = Proportions::of_stature(1.7).expect("a person").with_leg_length_m(length_m);
        Lengths::of(&body.expect("a person"))
    }

    /// A number of the person that Plug-in Gait was told.
    fn told(&self, name: &str) -> f64 {
        self.head().parameters.numbers("PROCESSING", name)[0]
    }

    /// What all plates push up with in each frame of a range, body weights below [`CUTOFF_HZ`].
    fn measured(&self, frames: RangeInclusive<usize>, weight_n: f64) -> Vec<f64> {
        let analog = &self.head().analog;
        let all = frames.map(|frame| {
            let counts = self.markers.analog_counts(frame);
            let of =
                |(plate, idle_n): (&Plate, &f64)| plate.during(analog, counts).force_n.z - idle_n;
            self.plates.iter().zip(&self.idle_n).map(of).sum::<f64>() / weight_n
        });
        low_pass(&all.collect::<Vec<f64>>(), self.rate_hz, CUTOFF_HZ).expect("filtered")
    }

    /// What the ground has to push up with for bodies to move as they do, body weights below [`CUTOFF_HZ`], in
    /// each frame of a range. `bodies` says where they are in a frame, if they were seen.
    fn moved<B: AsRef<[Posed]>>(
        &self,
        frames: RangeInclusive<usize>,
        bodies: impl Fn(&Frame) -> Option<B>,
    ) -> Vec<f64> {
        let mut frame = Frame::default();
        let seen: Vec<Option<B>> = (0..self.head().frames)
            .map(|at| {
                assert!(self.markers.frame(at, &mut frame));
                bodies(&frame)
            })
            .collect();
        let first = seen.iter().position(Option::is_some).expect("seen");
        let seen: Vec<B> = seen.into_iter().skip(first).map_while(|bodies| bodies).collect();
        let mass_kg: f64 = seen[0].as_ref().iter().map(|body| body.mass.mass_kg).sum();
        let up = |reaction: &GroundReaction| reaction.force_n.z / (mass_kg * GRAVITY_M_S2);
        let all: Vec<f64> = reactions(&seen, self.rate_hz).iter().map(up).collect();
        // Before the first and behind the last it moves, too.
        let inner = low_pass(&all[1..all.len() - 1], self.rate_hz, CUTOFF_HZ).expect("filtered");
        frames.map(|at| inner[at - first - 1]).collect()
    }
}

/// Root mean square of differences, %.
fn rms_percent(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    1e2 * (a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>() / a.len() as f64).sqrt()
}

/// The twin: the centre of mass that the laboratory's own program stored, with its own masses and bones.
#[test]
fn the_ground_pushes_as_hard_as_the_motion_of_its_masses_says() {
    let Some(folder) = captured::captured("mocap/c3d/pig") else { return };
    for Measured { file, span_s, most_percent } in TRIALS {
        let trial = Trial::read(&folder.join(file));
        let at = |time_s: &f64| (time_s * trial.rate_hz).round() as usize;
        let frames = at(span_s.start())..=at(span_s.end());
        let (mass_kg, stature_m) = (trial.told("Bodymass"), trial.told("Height") * 1e-3);
        let body = Proportions::of_stature(stature_m).expect("a person").with_mass_kg(mass_kg);
        let body = body.expect("a person");
        let masses = segment_masses(&body);
        let bones = GaitBones::of(trial.head(), "").expect("stored bones");
        let ours = trial.moved(frames.clone(), |frame| bones.posed(&frame.points, &body, &masses));
        let metres = trial.head().metres_per_unit().expect("a unit");
        let stored = marker(trial.head(), "CentreOfMass").expect("stored");
        let one = Mass { mass_kg, ..Mass::NONE };
        let theirs = trial.moved(frames.clone(), |frame| {
            let origin_m = place_m(frame, stored, metres)?;
            Some([Posed { mass: one, origin_m, turned: DQuat::IDENTITY }])
        });
        let measured = trial.measured(frames.clone(), mass_kg * GRAVITY_M_S2);
        let range = |forces: &[f64]| {
            let least = forces.iter().copied().fold(f64::MAX, f64::min);
            (least, forces.iter().copied().fold(f64::MIN, f64::max))
        };
        let (ours_percent, theirs_percent) =
            (rms_percent(&ours, &measured), rms_percent(&theirs, &measured));
        let between_percent = rms_percent(&ours, &theirs);
        let ((least, most), (least_ours, most_ours)) = (range(&measured), range(&ours));
        aloud!(
            "{file}, {} frames: measured {least:.2} to {most:.2} body weights, by motion {least_ours:.2} to \
             {most_ours:.2}; differ by {ours_percent:.2} % of body weight rms, the laboratory's own centre of \
             mass by {theirs_percent:.2} %, both from one another by {between_percent:.2} %",
            frames.count()
        );
        assert!(ours_percent < most_percent, "{file}: {ours_percent} %");
        // As near as the laboratory's own program comes, to a tenth.
        assert!(ours_percent < 1.1 * theirs_percent, "{file}: {ours_percent}, {theirs_percent} %");
        // Nearer to that program than it is to the plates, by half.
        assert!(between_percent < 0.5 * theirs_percent, "{file}: {between_percent} %");
        assert!(most - least > 0.3, "{file}: the force changes");
    }
}

/// The point of a name, with or without a subject before it.
fn marker(head: &Head, name: &str) -> Option<usize> {
    head.points.iter().position(|point| point.label.rsplit(':').next() == Some(name))
}

fn place_m(frame: &Frame, point: usize, metres: f64) -> Option<DVec3> {
    let sample = frame.points.get(point).copied().flatten()?;
    Some(DVec3::from_array(sample.position.map(f64::from)) * metres)
}

/// Trials with markers on heels and toes, and how far contact times by motion and by plates may be apart, frames. The
/// last is slow, has 60 frames a second and markers that jitter by 5 mm: its last foot presses with less than
/// [`PRESSED_N`] for some 30 ms before it leaves.
const STEPS: [(&str, f64); 4] = [
    ("pig/PiG_Motion-FlatFoot-Full.c3d", 2.0),
    ("pig/cgm_Movement_trial.c3d", 2.0),
    ("variants/Gait.c3d", 2.0),
    ("variants/PlugInC3D.c3d", 3.0),
];
/// A foot that touches the floor before its plate (file, plate): its heel lands behind the edge.
const LANDS_BESIDE: [(&str, usize); 1] = [("pig/PiG_Motion-FlatFoot-Full.c3d", 0)];

/// Heel and toe of a foot, by frame, m.
struct Foot {
    parts_m: [Vec<Option<DVec3>>; 2],
}

impl Foot {
    fn of(trial: &Trial, side: char) -> Self {
        Self { parts_m: ["HEE", "TOE"].map(|name| trial.places_m(&format!("{side}{name}"))) }
    }

    /// Places along the sole in a frame.
    fn sole_m(&self, frame: usize) -> Option<[DVec3; 5]> {
        let [heel_m, toe_m] = [self.parts_m[0][frame]?, self.parts_m[1][frame]?];
        Some([0.0, 0.25, 0.5, 0.75, 1.0].map(|part| heel_m.lerp(toe_m, part)))
    }

    /// How high the highest plate lies that is under some of the foot; none if it is beside all.
    fn ground_m(&self, frame: usize, plates: &[Plate]) -> Option<f64> {
        let sole_m = self.sole_m(frame)?;
        let lowest_m = sole_m.iter().map(|place_m| place_m.z).fold(f64::MAX, f64::min);
        let under = plates.iter().filter(|plate| sole_m.iter().any(|at_m| plate.is_over(*at_m)));
        let heights_m = under.map(|plate| plate.centre_m().z);
        // What a marker sits on is below it, but for a shoe that gives.
        heights_m.filter(|height_m| *height_m < lowest_m + 0.02).max_by(f64::total_cmp)
    }

    /// By frame, whether it carries: plates say how high the ground is and nothing else. Beside them a foot is
    /// taken for low.
    fn carries(&self, trial: &Trial) -> Vec<bool> {
        let frames = trial.head().frames;
        let above_m: [Vec<Option<f64>>; 2] = [0, 1].map(|part| {
            let above =
                |at: usize| Some(self.parts_m[part][at]?.z - self.ground_m(at, &trial.plates)?);
            (0..frames).map(above).collect()
        });
        // A marker is as high on a foot that stands as it is in the lowest tenth of the frames.
        let own_m = above_m.each_ref().map(|above_m| {
            let mut sorted: Vec<f64> = above_m.iter().flatten().copied().collect();
            sorted.sort_by(f64::total_cmp);
            sorted[sorted.len() / 10]
        });
        let legs = trial.legs();
        let mut foot = MeasuredFoot::new(legs.tibia_m, legs.leg_m());
        (0..frames)
            .map(|at| {
                let parts = [0, 1].map(|part| {
                    let place = |at: Option<usize>| *self.parts_m[part].get(at?)?;
                    let moved_m = place(at.checked_sub(1)).zip(place(Some(at + 1)));
                    let speed_m_s = moved_m.map_or(f64::NAN, |(before_m, after_m)| {
                        before_m.distance(after_m) * trial.rate_hz / 2.0
                    });
                    let height_m = above_m[part][at].map_or(0.0, |above_m| above_m - own_m[part]);
                    FootPart { height_m, speed_m_s }
                });
                foot.next(&parts)
            })
            .collect()
    }
}

/// From the first to the last sample of each time that somebody is on a plate for 0.2 s and more.
fn pressed(up_n: &[f64], rate_hz: f64) -> Vec<(usize, usize)> {
    let mut times = Vec::new();
    let mut since = None;
    for (at, up_n) in up_n.iter().chain([&0.0]).enumerate() {
        match since {
            None if *up_n > PRESSED_N => since = Some(at),
            Some(from) if *up_n <= PRESSED_N => {
                if (at - from) as f64 > 0.2 * rate_hz {
                    times.push((from, at));
                }
                since = None;
            }
            _ => {}
        }
    }
    times
}

#[test]
fn feet_touch_and_leave_when_plates_say_so() {
    let Some(folder) = captured::captured("mocap/c3d") else { return };
    let (mut compared, mut within_two, mut left_out) = (0, 0, 0);
    for (file, most_frames) in STEPS {
        let trial = Trial::read(&folder.join(file));
        let feet = ['L', 'R'].map(|side| Foot::of(&trial, side));
        let carries = feet.each_ref().map(|foot| foot.carries(&trial));
        let per_frame = trial.head().analog.per_frame;
        for (number, plate) in trial.plates.iter().enumerate() {
            let up_n = trial.up_n(number);
            for (from, to) in pressed(&up_n, trial.rate_hz * per_frame as f64) {
                let middle = from.midpoint(to) / per_frame;
                let counts = trial.markers.analog_counts(middle);
                let pressure = plate.during(&trial.head().analog, counts).centre_of_pressure_m;
                let pressure_m = pressure.expect("pressed");
                let away_m = |foot: &Foot| {
                    let sole_m = foot.sole_m(middle).expect("seen");
                    let away = sole_m.map(|at_m| (at_m - pressure_m).truncate().length());
                    away.into_iter().fold(f64::MAX, f64::min)
                };
                let is_right = away_m(&feet[1]) < away_m(&feet[0]);
                let carries = &carries[usize::from(is_right)];
                assert!(carries[middle], "{file}, plate {}: nobody stands there", number + 1);
                let begins = (0..middle).rev().find(|at| !carries[*at]).map(|at| at + 1);
                let ends = (middle..carries.len()).find(|at| !carries[*at]);
                let at_end = to >= up_n.len();
                let times = [("touches", begins, from, from == 0), ("leaves", ends, to, at_end)];
                for (what, found, sample, is_cut) in times {
                    if is_cut || (what == "touches" && LANDS_BESIDE.contains(&(file, number))) {
                        left_out += 1;
                        continue;
                    }
                    let expected = sample as f64 / per_frame as f64;
                    let found = found.unwrap_or_else(|| panic!("{file}: no foot {what}"));
                    let late = found as f64 - expected;
                    let side = if is_right { "right" } else { "left" };
                    aloud!(
                        "{file}, plate {}: the {side} foot {what} at {:.3} s, by motion {late:+.1} frames",
                        number + 1,
                        expected / trial.rate_hz
                    );
                    assert!(late.abs() <= most_frames, "{file}: {what}, {late} frames");
                    compared += 1;
                    within_two += usize::from(late.abs() <= 2.0);
                }
            }
        }
    }
    aloud!("{within_two} of {compared} contact times within 2 frames, {left_out} left out");
    assert!(compared >= 18 && within_two + 1 >= compared, "{within_two} of {compared}");
}
