//! Force plates: from the channels of a file to the force of the ground on whoever stands there.
//!
//! "The C3D File Format: User Guide" (Motion Lab Systems, 2008), chapter "The FORCE_PLATFORM group", says how plates
//! are stored; the equations of the plates with eight channels are those of Kistler (also in Winter, "Biomechanics
//! and Motor Control of Human Movement", 4th ed., 2009, chapter 5).
//!
//! A plate's own Z points down into the floor, its X from the second corner to the first, its Y from the fourth
//! to the first, as the guide orders corners. Channels carry the force of the plate on the person, so that
//! somebody who stands gives a negative Fz there, and a force that points up in the laboratory. What comes out
//! is in the axes of the points of the file, in N and Nm, places in m.
//!
//! FORCE_PLATFORM:ORIGIN goes from the sensor's origin to the middle of the surface and has a negative Z; some
//! programs store it the other way around, which a positive Z shows, and it is turned. Baselines are not
//! subtracted (FORCE_PLATFORM:ZERO): in a section of a trial the frames it names may have somebody on the plate.

use crate::error::{Error, ErrorKind, counted};
use crate::mocap::markers::{Analog, ForcePlate, Head, PlateKind, metres_of};
use glam::{DMat3, DVec3};

/// A force across the plate below which its place means nothing, N: half a kilogram, a few times the noise of a
/// plate. Ours.
pub const LEAST_PRESS_N: f64 = 5.0;

/// A force plate, ready to turn counts into forces.
#[derive(Clone, Debug, PartialEq)]
pub struct Plate {
    kind: MeasuredBy,
    /// Index of each analog channel that it uses.
    channels: Vec<usize>,
    /// From the plate's axes to those of the points.
    axes: DMat3,
    centre_m: DVec3,
    corners_m: [DVec3; 4],
    /// What a moment of the channels has to be multiplied with to be in Nm.
    nm_per_moment: f64,
    /// What was taken for granted, a line each.
    notes: Vec<String>,
}

/// How force and moment come out of the channels. Lengths in m, plate's axes, from the sensor to the surface.
#[derive(Clone, Debug, PartialEq)]
enum MeasuredBy {
    Pressure { metres_per_place: f64 },
    Moments { to_surface_m: DVec3 },
    Posts { beside_m: [f64; 2], to_surface_m: DVec3 },
    Matrix { matrix: Box<[[f64; 6]; 6]>, to_surface_m: DVec3 },
}

/// What the ground does to who stands on a plate, at one time, in the axes of the points.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GroundForce {
    /// The force, N.
    pub force_n: DVec3,
    /// The moment about the middle of the plate's surface, Nm.
    pub moment_nm: DVec3,
    /// The centre of pressure on the surface, m; `None` while nobody presses: the force across the surface is
    /// below [`LEAST_PRESS_N`].
    pub centre_of_pressure_m: Option<DVec3>,
    /// The moment that is left about the centre of pressure, Nm; zero where there is none.
    pub free_moment_nm: DVec3,
}

/// All plates of a file. Those that say too little are left out, and told of.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Plates {
    /// The plates that can be used, with the number each has in the file, from 0.
    pub list: Vec<(usize, Plate)>,
    /// Why others cannot, a line each.
    pub notes: Vec<String>,
}

impl Plates {
    /// The plates of a file.
    #[must_use]
    pub fn of(head: &Head) -> Self {
        let mut plates = Self::default();
        for (at, stored) in head.plates.iter().enumerate() {
            match Plate::of(head, stored) {
                Ok(plate) => {
                    let told = |note: &String| format!("force plate {}: {note}", at + 1);
                    plates.notes.extend(plate.notes.iter().map(told));
                    plates.list.push((at, plate));
                }
                Err(error) => {
                    let words = error.to_string();
                    let words: Vec<&str> = words.split_whitespace().collect();
                    plates.notes.push(format!("force plate {}: {}", at + 1, words.join(" ")));
                }
            }
        }
        plates
    }
}

impl Plate {
    /// A plate of a file.
    ///
    /// # Errors
    /// If the file does not say its unit of length, corners that make no plane, a channel that is not there, or a
    /// type that nobody here knows.
    pub fn of(head: &Head, stored: &ForcePlate) -> Result<Self, Error> {
        let metres = head.metres_per_unit().ok_or_else(|| {
            Error::of(ErrorKind::Absent, "the unit of length is unknown")
                .at("POINT:UNITS")
                .got(format!("\"{}\"", head.unit))
                .allowed("mm, cm, m, in, ft")
        })?;
        let corners_m = stored.corners.map(|corner| as_vector(corner) * metres);
        let (axes, centre_m) = placed(&corners_m)?;
        let mut notes = Vec::new();
        let mut to_surface_m = as_vector(stored.origin) * metres;
        if to_surface_m.z > 0.0 && stored.kind != PlateKind::CentreOfPressure {
            // Of a plate with posts the first two are lengths.
            let is_of_posts = stored.kind == PlateKind::Posts;
            let kept = to_surface_m.truncate();
            to_surface_m = -to_surface_m;
            if is_of_posts {
                to_surface_m = kept.extend(to_surface_m.z);
            }
            notes.push("FORCE_PLATFORM:ORIGIN has a positive Z and is turned around".to_owned());
        }
        let needed = if stored.kind == PlateKind::Posts { 8 } else { 6 };
        let channels: Vec<usize> = stored.channels.iter().take(needed).flatten().copied().collect();
        if channels.len() < needed {
            return Err(Error::of(ErrorKind::Absent, "channels of the plate are missing")
                .at("FORCE_PLATFORM:CHANNEL")
                .got(counted(channels.len(), "channel"))
                .allowed(format!("{needed}")));
        }
        let unit = |at: usize| {
            let channel = channels.get(at).and_then(|&at| head.analog.channels.get(at));
            channel.map_or("", |channel| channel.unit.as_str())
        };
        let kind = match stored.kind {
            PlateKind::CentreOfPressure => {
                MeasuredBy::Pressure { metres_per_place: metres_of(unit(3)).unwrap_or(metres) }
            }
            PlateKind::ForcesMoments => MeasuredBy::Moments { to_surface_m },
            PlateKind::Posts => MeasuredBy::Posts {
                beside_m: [to_surface_m.x, to_surface_m.y],
                to_surface_m: DVec3::new(0.0, 0.0, to_surface_m.z),
            },
            PlateKind::Calibrated => match matrix_of(&stored.calibration) {
                Some(matrix) => MeasuredBy::Matrix { matrix: Box::new(matrix), to_surface_m },
                None => MeasuredBy::Moments { to_surface_m },
            },
            PlateKind::Other(number) => {
                return Err(Error::of(ErrorKind::Unknown, "this type of force plate is not known")
                    .at("FORCE_PLATFORM:TYPE")
                    .got(format!("{number}"))
                    .allowed("1 to 4"));
            }
        };
        let has_moments = stored.kind != PlateKind::Posts;
        let told = nm_per(unit(5));
        if has_moments && told.is_none() {
            let unit = unit(5);
            notes.push(format!(
                "moments have the unit \"{unit}\": taken as N times the file's unit of length, {}",
                head.unit
            ));
        }
        let nm_per_moment = told.unwrap_or(metres);
        Ok(Self { kind, channels, axes, centre_m, corners_m, nm_per_moment, notes })
    }

    /// The middle of the surface, m.
    #[must_use]
    pub const fn centre_m(&self) -> DVec3 {
        self.centre_m
    }

    /// The corners, m, as the file orders them.
    #[must_use]
    pub const fn corners_m(&self) -> [DVec3; 4] {
        self.corners_m
    }

    /// The direction out of the surface, towards who stands on it.
    #[must_use]
    pub fn up(&self) -> DVec3 {
        -self.axes.z_axis
    }

    /// True if a place is above, on or below the surface: inside its corners as seen along its normal.
    #[must_use]
    pub fn is_over(&self, place_m: DVec3) -> bool {
        let sides = (0..4).map(|at| {
            let (from, to) = (self.corners_m[at], self.corners_m[(at + 1) % 4]);
            (to - from).cross(place_m - from).dot(self.axes.z_axis)
        });
        let (mut left, mut right) = (false, false);
        for side in sides {
            left |= side > 0.0;
            right |= side < 0.0;
        }
        !(left && right)
    }

    /// What the ground does at one sample: `counts` of all analog channels, in their order.
    #[must_use]
    pub fn at(&self, analog: &Analog, counts: &[f32]) -> GroundForce {
        let value = |at: usize| {
            let index = self.channels.get(at).copied().unwrap_or(usize::MAX);
            let channel = analog.channels.get(index).zip(counts.get(index));
            channel.map_or(0.0, |(channel, count)| channel.value(*count))
        };
        let triple = |at: usize| DVec3::new(value(at), value(at + 1), value(at + 2));
        let moved = |force: DVec3, moment: DVec3, to: DVec3| moment - to.cross(force);
        let (force, moment) = match &self.kind {
            MeasuredBy::Pressure { metres_per_place } => {
                let force = triple(0);
                let place = DVec3::new(value(3), value(4), 0.0) * *metres_per_place;
                let free = DVec3::new(0.0, 0.0, value(5) * self.nm_per_moment);
                (force, place.cross(force) + free)
            }
            MeasuredBy::Moments { to_surface_m } => {
                let force = triple(0);
                (force, moved(force, triple(3) * self.nm_per_moment, *to_surface_m))
            }
            MeasuredBy::Posts { beside_m: [a, b], to_surface_m } => {
                let posts: [f64; 8] = std::array::from_fn(value);
                let (force, moment) = of_posts(&posts, *a, *b);
                (force, moved(force, moment, *to_surface_m))
            }
            MeasuredBy::Matrix { matrix, to_surface_m } => {
                let raw: [f64; 6] = std::array::from_fn(value);
                let out = matrix.map(|row| row.iter().zip(raw).map(|(a, b)| a * b).sum::<f64>());
                let [fx, fy, fz, mx, my, mz] = out;
                let force = DVec3::new(fx, fy, fz);
                let moment = DVec3::new(mx, my, mz) * self.nm_per_moment;
                (force, moved(force, moment, *to_surface_m))
            }
        };
        self.in_laboratory(force, moment)
    }

    /// What the ground does during a frame: the mean of its samples. `counts` are those of the frame.
    #[must_use]
    pub fn during(&self, analog: &Analog, counts: &[f32]) -> GroundForce {
        let (mut force, mut moment, mut samples) = (DVec3::ZERO, DVec3::ZERO, 0.0);
        for sample in counts.chunks_exact(analog.channels.len().max(1)) {
            let one = self.at(analog, sample);
            force += one.force_n;
            moment += one.moment_nm;
            samples += 1.0;
        }
        if samples == 0.0 {
            return GroundForce::default();
        }
        let back = self.axes.transpose();
        self.in_laboratory(back * (force / samples), back * (moment / samples))
    }

    /// Of force and moment in the plate's axes, about the middle of its surface.
    fn in_laboratory(&self, force: DVec3, moment: DVec3) -> GroundForce {
        let presses = force.z.abs() >= LEAST_PRESS_N;
        let place = presses.then(|| DVec3::new(-moment.y / force.z, moment.x / force.z, 0.0));
        let free = place.map_or(DVec3::ZERO, |place| moment - place.cross(force));
        GroundForce {
            force_n: self.axes * force,
            moment_nm: self.axes * moment,
            centre_of_pressure_m: place.map(|place| self.centre_m + self.axes * place),
            free_moment_nm: self.axes * free,
        }
    }
}

impl GroundForce {
    /// The moment about another place than the middle of `plate`, Nm.
    #[must_use]
    pub fn moment_about_nm(&self, plate: &Plate, place_m: DVec3) -> DVec3 {
        self.moment_nm + (plate.centre_m - place_m).cross(self.force_n)
    }
}

fn as_vector(numbers: [f32; 3]) -> DVec3 {
    DVec3::from_array(numbers.map(f64::from))
}

/// The axes of a plate and the middle of its surface.
fn placed(corners: &[DVec3; 4]) -> Result<(DMat3, DVec3), Error> {
    let [first, second, _, fourth] = *corners;
    let along = first - second;
    let down = along.cross(first - fourth);
    let centre = corners.iter().sum::<DVec3>() / 4.0;
    match (along.try_normalize(), down.try_normalize()) {
        (Some(x), Some(z)) if centre.is_finite() => {
            Ok((DMat3::from_cols(x, z.cross(x), z), centre))
        }
        _ => Err(Error::of(ErrorKind::Malformed, "the corners of the plate make no plane")
            .at("FORCE_PLATFORM:CORNERS")
            .got(format!("{corners:?}"))),
    }
}

/// Force and moment about the middle between the posts. `a` and `b` are how far the posts are to the side of
/// the Y and the X axis, m.
fn of_posts(posts: &[f64; 8], a: f64, b: f64) -> (DVec3, DVec3) {
    let [x12, x34, y14, y23, z1, z2, z3, z4] = *posts;
    let force = DVec3::new(x12 + x34, y14 + y23, z1 + z2 + z3 + z4);
    let moment = DVec3::new(
        b * (z1 + z2 - z3 - z4),
        a * (-z1 + z2 + z3 - z4),
        b * (-x12 + x34) + a * (y14 - y23),
    );
    (force, moment)
}

/// The rows of a matrix that is stored column after column.
fn matrix_of(stored: &[f32]) -> Option<[[f64; 6]; 6]> {
    let columns = stored.as_chunks::<6>().0;
    let is_whole = columns.len() == 6 && stored.iter().any(|number| *number != 0.0);
    is_whole.then(|| {
        std::array::from_fn(|row| std::array::from_fn(|column| f64::from(columns[column][row])))
    })
}

/// Nm in a unit of moments: `Nmm`, `ntmm`, `N.m`.
fn nm_per(unit: &str) -> Option<f64> {
    let unit = unit.trim().to_ascii_lowercase();
    let rest = ["newton", "nt", "n"].into_iter().find_map(|name| unit.strip_prefix(name))?;
    metres_of(rest.trim_start_matches(['.', '*', '-', ' ', 's']))
}
