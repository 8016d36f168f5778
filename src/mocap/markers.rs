//! Markers in motion: points, what they were measured with, and what was recorded beside them.
//!
//! A file of markers becomes a [`Head`], which tells all but the frames, and its frames one by one, so that a file
//! of any length can be looked at and converted in constant memory. [`Markers`] holds both.
//!
//! Positions stay in the axes and the unit of the file, as 32-bit numbers, which is what C3D has: no
//! reader turns or scales them, and what is written again is the same. [`Head::metres_per_unit`] tells the
//! unit where the file does. A marker that was not seen in a frame has no position; there is no number
//! that stands for that.

use crate::error::{Error, ErrorKind, counted, either};
use crate::mocap::acclaim::check_rate;
use crate::mocap::parameters::Parameters;

/// Most points of a file.
pub const MAX_POINTS: usize = 16_384;
/// Most analog channels of a file.
pub const MAX_CHANNELS: usize = 16_384;
/// What is farther from the origin than this along an axis is no place of a marker, m.
pub const FARTHEST_M: f64 = 1e3;
/// A marker that is never further from the origin may well be there, m.
const ORIGIN_M: f64 = 0.05;
/// The unit of length of files that do not say it: millimetres, which laboratories use.
pub const USUAL_UNIT_M: f64 = 1e-3;

/// The kind of file that markers came from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MarkerFormat {
    /// C3D.
    C3d,
    /// Motion Analysis' track row column text.
    Trc,
    /// Character Studio's text.
    Csm,
    /// A table of comma-separated values whose columns say what they are.
    Csv,
}

impl MarkerFormat {
    /// The word for it, which is also the ending of its files.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::C3d => "c3d",
            Self::Trc => "trc",
            Self::Csm => "csm",
            Self::Csv => "csv",
        }
    }
}

/// What the three numbers of a point are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PointKind {
    /// A place of a marker.
    Marker,
    /// A place that a model computed from markers.
    Modelled,
    /// Angles.
    Angle,
    /// A force.
    Force,
    /// A moment.
    Moment,
    /// A power.
    Power,
    /// Any other numbers.
    Scalar,
}

impl PointKind {
    /// The word for it.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Marker => "marker",
            Self::Modelled => "modelled",
            Self::Angle => "angle",
            Self::Force => "force",
            Self::Moment => "moment",
            Self::Power => "power",
            Self::Scalar => "scalar",
        }
    }

    /// True if the numbers are a place.
    #[must_use]
    pub const fn is_place(self) -> bool {
        matches!(self, Self::Marker | Self::Modelled)
    }
}

/// One point of a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MarkerPoint {
    /// Its name, with the subject's before a colon if the file has that: `LANK`, `Daniel:LANK`.
    pub label: String,
    /// What somebody wrote about it; often empty.
    pub description: String,
    /// What its numbers are.
    pub kind: PointKind,
    /// The unit of its numbers as the file names it; empty if it does not.
    pub unit: String,
}

/// One channel of analog data.
#[derive(Clone, Debug, PartialEq)]
pub struct AnalogChannel {
    /// Its name.
    pub label: String,
    /// What somebody wrote about it; often empty.
    pub description: String,
    /// The unit of its values; empty if the file does not say.
    pub unit: String,
    /// Value of one count.
    pub scale: f64,
    /// The count that is zero.
    pub offset: f64,
}

impl AnalogChannel {
    /// A stored count as a value in the channel's unit.
    #[must_use]
    pub fn value(&self, count: f32) -> f64 {
        (f64::from(count) - self.offset) * self.scale
    }
}

/// The analog channels of a file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Analog {
    /// The channels.
    pub channels: Vec<AnalogChannel>,
    /// Samples of each channel in one frame.
    pub per_frame: usize,
    /// Samples of each channel per second, if known.
    pub rate_hz: Option<f64>,
}

impl Analog {
    /// Counts in one frame.
    #[must_use]
    pub fn counts_per_frame(&self) -> usize {
        self.channels.len() * self.per_frame
    }
}

/// Something that happened at one time.
#[derive(Clone, Debug, PartialEq)]
pub struct MarkerEvent {
    /// When, s, on the clock of the capture: its frame 1 is at zero.
    pub time_s: f64,
    /// What: `Foot Strike`.
    pub label: String,
    /// On which side or of what: `Left`, `General`; empty if the file does not say.
    pub context: String,
    /// Of whom; empty if the file does not say.
    pub subject: String,
    /// What somebody wrote about it.
    pub description: String,
}

/// A force plate in the floor.
#[derive(Clone, Debug, PartialEq)]
pub struct ForcePlate {
    /// What its channels carry.
    pub kind: PlateKind,
    /// Corners in the axes and the unit of the points, as the file orders them.
    pub corners: [[f32; 3]; 4],
    /// The way from the sensor's origin to the middle of the surface, in the plate's axes; of type 3 the first two
    /// are how far the posts are to the side. As the file has it: some programs turn it around.
    pub origin: [f32; 3],
    /// Index of each analog channel; `None` where the file names one it does not have.
    pub channels: Vec<Option<usize>>,
    /// Of type 4: 36 numbers that make forces and moments of the channels, column after column.
    pub calibration: Vec<f32>,
}

/// What the channels of a force plate carry (C3D User Guide, "FORCE_PLATFORM:TYPE").
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlateKind {
    /// Type 1: three forces, the centre of pressure, the free moment.
    CentreOfPressure,
    /// Type 2: three forces and three moments.
    ForcesMoments,
    /// Type 3: eight forces at the four posts.
    Posts,
    /// Type 4: as type 2, by a calibration matrix.
    Calibrated,
    /// Another, by its number.
    Other(u16),
}

impl PlateKind {
    /// Of the number in the file.
    #[must_use]
    pub const fn of_number(number: u16) -> Self {
        match number {
            1 => Self::CentreOfPressure,
            2 => Self::ForcesMoments,
            3 => Self::Posts,
            4 => Self::Calibrated,
            other => Self::Other(other),
        }
    }

    /// The number in the file.
    #[must_use]
    pub const fn number(self) -> u16 {
        match self {
            Self::CentreOfPressure => 1,
            Self::ForcesMoments => 2,
            Self::Posts => 3,
            Self::Calibrated => 4,
            Self::Other(number) => number,
        }
    }
}

/// All that is known of markers but their frames.
#[derive(Clone, Debug, PartialEq)]
pub struct Head {
    /// The kind of file they came from.
    pub format: MarkerFormat,
    /// How the file stores them: `Intel, real`; empty of a text.
    pub encoding: String,
    /// The points, in the order of the file.
    pub points: Vec<MarkerPoint>,
    /// Frames.
    pub frames: usize,
    /// Number of the first frame; a capture begins with 1, a section of it later.
    pub first_frame: u64,
    /// Frames per second, positive; `None` if the file does not say.
    pub rate_hz: Option<f64>,
    /// The unit of places as the file names it; empty if it does not.
    pub unit: String,
    /// Which axes of the file point to the right and up on a screen: `+X`, `+Z`; empty if it does not say.
    pub screen: [String; 2],
    /// Analog channels.
    pub analog: Analog,
    /// What happened, in the order of the file.
    pub events: Vec<MarkerEvent>,
    /// Force plates.
    pub plates: Vec<ForcePlate>,
    /// Who was captured.
    pub subjects: Vec<String>,
    /// Which program wrote the file, as far as it says so.
    pub made_by: String,
    /// True if each sample has a residual and cameras.
    pub has_residuals: bool,
    /// What one step of a stored residual is; 0 where there are none.
    pub residual_step: f32,
    /// The parameters of a C3D file, all of them.
    pub parameters: Parameters,
    /// What was wrong with the file, what was made of it, and what had to be left.
    pub notes: Vec<String>,
    /// Frames that the file claims and does not hold.
    pub lost_frames: u64,
}

impl Head {
    /// The head of a file without points, to be filled.
    #[must_use]
    pub fn new(format: MarkerFormat) -> Self {
        Self {
            format,
            encoding: String::new(),
            points: Vec::new(),
            frames: 0,
            first_frame: 1,
            rate_hz: None,
            unit: String::new(),
            screen: Default::default(),
            analog: Analog::default(),
            events: Vec::new(),
            plates: Vec::new(),
            subjects: Vec::new(),
            made_by: String::new(),
            has_residuals: false,
            residual_step: 0.0,
            parameters: Parameters::default(),
            notes: Vec::new(),
            lost_frames: 0,
        }
    }

    /// Says how many frames there are per second; what is not positive says nothing.
    pub fn set_rate(&mut self, rate_hz: f64) {
        if rate_hz.is_finite() && rate_hz > 0.0 {
            self.rate_hz = Some(rate_hz);
            let per_frame = self.analog.per_frame as f64;
            self.analog.rate_hz = (per_frame > 0.0).then_some(rate_hz * per_frame);
        }
    }

    /// Takes somebody's word for the frames per second; where the file says something else, that is noted.
    ///
    /// # Errors
    /// A rate that nothing is captured with.
    pub fn take_rate(&mut self, rate_hz: f64) -> Result<(), Error> {
        check_rate(rate_hz)?;
        // A C3D file says it in 32 bits.
        let is_same = |said_hz: &f64| (said_hz - rate_hz).abs() <= 1e-6 * rate_hz;
        if let Some(said_hz) = self.rate_hz.filter(|said_hz| !is_same(said_hz)) {
            self.notes.push(format!(
                "the file says {said_hz} per second; taken as {rate_hz}, as told",
                said_hz = counted(said_hz, "frame")
            ));
        }
        self.set_rate(rate_hz);
        Ok(())
    }

    /// Indices of the points that are places.
    ///
    /// # Errors
    /// If there is none: nothing is left for a kind of file that holds places alone.
    pub fn places(&self) -> Result<Vec<usize>, Error> {
        let is_place = |at: &usize| self.points.get(*at).is_some_and(|of| of.kind.is_place());
        let places: Vec<usize> = (0..self.points.len()).filter(is_place).collect();
        if !places.is_empty() {
            return Ok(places);
        }
        Err(Error::of(ErrorKind::Absent, "there are no places of markers to write")
            .got(match self.points.len() {
                0 => "no points at all".to_owned(),
                others => format!("{}, of angles, forces or the like", counted(others, "point")),
            })
            .remedy("`gaitway info` tells what is in the file; .csv and .c3d hold what is no place, too"))
    }

    /// What a file leaves out that has room for neither channels nor events, nor for so many of the points.
    pub(super) fn left_out(&self, points: usize) -> Vec<String> {
        let left = [
            (
                points,
                "point",
                "is no place (an angle, a force, ...):",
                "are no places (angles, forces, ...):",
            ),
            (self.analog.channels.len(), "analog channel", "is", "are"),
            (self.events.len(), "event", "is", "are"),
        ];
        let told = |(count, what, one, more): (usize, &str, &str, &str)| {
            (count > 0)
                .then(|| format!("{} {} left out", counted(count, what), either(count, one, more)))
        };
        left.into_iter().filter_map(told).collect()
    }

    /// Length of the unit of places, m, if the file names one that is known.
    #[must_use]
    pub fn metres_per_unit(&self) -> Option<f64> {
        metres_of(&self.unit)
    }

    /// From the first frame to the last, s.
    #[must_use]
    pub fn duration_s(&self) -> Option<f64> {
        Some(self.frames.saturating_sub(1) as f64 / self.rate_hz?)
    }
}

/// Length of a unit of this name, m. Some files cut the name off: `mete`.
#[must_use]
pub fn metres_of(unit: &str) -> Option<f64> {
    let unit = unit.trim().to_ascii_lowercase();
    let starts = |long: &str, least: usize| unit.len() >= least && long.starts_with(&unit);
    Some(match unit.as_str() {
        "m" => 1.0,
        "cm" => 0.01,
        "mm" => 0.001,
        "in" => 0.0254,
        "ft" => 0.3048,
        _ if starts("meters", 3) || starts("metres", 3) => 1.0,
        _ if starts("centimeters", 4) || starts("centimetres", 4) => 0.01,
        _ if starts("millimeters", 4) || starts("millimetres", 4) => 0.001,
        _ if starts("inches", 4) => 0.0254,
        _ => return None,
    })
}

/// Where a point was in one frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointSample {
    /// Its numbers, finite, in the axes and the unit of the file.
    pub position: [f32; 3],
    /// How far the rays of the cameras missed one another, in the unit of the file; 0 if it was
    /// interpolated or is not known.
    pub residual: f32,
    /// Which of the first seven cameras saw it, a bit each.
    pub cameras: u8,
}

/// One frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Frame {
    /// The points in their order; `None` where one was not seen.
    pub points: Vec<Option<PointSample>>,
    /// Counts of the analog channels, all channels of a sample, then of the next.
    pub analog: Vec<f32>,
}

/// Frames in which a point has numbers that are no place.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Placeless {
    /// The very origin, where some programs write a marker that was not seen; none of a marker that is never elsewhere.
    pub at_origin: Vec<usize>,
    /// Farther away than any laboratory is wide.
    pub too_far: Vec<usize>,
}

/// How many samples of how many markers that is.
#[derive(Clone, Debug, Default)]
pub struct PlacelessCount {
    at_origin: (usize, usize),
    too_far: (usize, usize),
}

impl PlacelessCount {
    /// Adds a marker.
    pub fn add(&mut self, of: &Placeless) {
        for (count, frames) in
            [(&mut self.at_origin, &of.at_origin), (&mut self.too_far, &of.too_far)]
        {
            *count = (count.0 + frames.len(), count.1 + usize::from(!frames.is_empty()));
        }
    }

    /// In words; none if there were none.
    #[must_use]
    pub fn notes(&self) -> Vec<String> {
        let far = format!("farther than {FARTHEST_M} m away");
        [(self.at_origin, "at the very origin"), (self.too_far, far.as_str())]
            .into_iter()
            .filter(|((samples, _), _)| *samples > 0)
            .map(|((samples, markers), place)| {
                let markers = counted(markers, "marker");
                format!(
                    "{} of {markers} {} {place}: taken for not seen",
                    counted(samples, "sample"),
                    either(samples, "is", "are")
                )
            })
            .collect()
    }
}

/// Markers with all their frames.
#[derive(Clone, Debug, PartialEq)]
pub struct Markers {
    head: Head,
    /// Point after point of frame after frame; not a number where one was not seen.
    positions: Vec<[f32; 3]>,
    /// Of each position; empty if the file has none.
    residuals: Vec<f32>,
    cameras: Vec<u8>,
    /// Counts, as in [`Frame::analog`], frame after frame.
    analog: Vec<f32>,
}

impl Markers {
    /// Markers without frames, with room for those that the head tells of.
    ///
    /// # Errors
    /// If there is no such room.
    pub fn with_room(head: Head) -> Result<Self, Error> {
        let samples = head.frames.saturating_mul(head.points.len());
        let counts = head.frames.saturating_mul(head.analog.counts_per_frame());
        let residuals = if head.has_residuals { samples } else { 0 };
        let mut markers = Self {
            head,
            positions: Vec::new(),
            residuals: Vec::new(),
            cameras: Vec::new(),
            analog: Vec::new(),
        };
        let reserved = markers
            .positions
            .try_reserve_exact(samples)
            .and_then(|()| markers.residuals.try_reserve_exact(residuals))
            .and_then(|()| markers.cameras.try_reserve_exact(residuals))
            .and_then(|()| markers.analog.try_reserve_exact(counts));
        reserved.map_err(|_| {
            Error::of(ErrorKind::Io, "the markers do not fit into memory")
                .got(format!(
                    "{samples} of points and {counts}",
                    counts = counted(counts, "analog count"),
                    samples = counted(samples, "sample")
                ))
                .remedy("cut the capture into shorter files")
        })?;
        markers.head.frames = 0;
        Ok(markers)
    }

    /// Adds a frame. Points and counts that it lacks are not seen and zero; more are left out.
    pub fn push(&mut self, frame: &Frame) {
        let points = self.head.points.len();
        for at in 0..points {
            let sample = frame.points.get(at).copied().flatten();
            self.positions.push(sample.map_or([f32::NAN; 3], |sample| sample.position));
            if self.head.has_residuals {
                self.residuals.push(sample.map_or(0.0, |sample| sample.residual));
                self.cameras.push(sample.map_or(0, |sample| sample.cameras));
            }
        }
        let counts = self.head.analog.counts_per_frame();
        let missing = counts.saturating_sub(frame.analog.len());
        self.analog.extend(frame.analog.iter().take(counts));
        self.analog.extend(std::iter::repeat_n(0.0, missing));
        self.head.frames += 1;
    }

    /// What is known beside the frames.
    #[must_use]
    pub const fn head(&self) -> &Head {
        &self.head
    }

    /// Says how many frames there are per second; what is not positive says nothing.
    pub fn set_rate(&mut self, rate_hz: f64) {
        self.head.set_rate(rate_hz);
    }

    /// Takes somebody's word for the frames per second ([`Head::take_rate`]).
    ///
    /// # Errors
    /// A rate that nothing is captured with.
    pub fn take_rate(&mut self, rate_hz: f64) -> Result<(), Error> {
        self.head.take_rate(rate_hz)
    }

    /// Frames in which the numbers of a point are no place, with the length of the file's unit.
    #[must_use]
    pub fn placeless(&self, point: usize, metres_per_unit: f64) -> Placeless {
        let mut found = Placeless::default();
        let mut is_elsewhere = false;
        for frame in 0..self.head.frames {
            let Some(PointSample { position, .. }) = self.sample(frame, point) else { continue };
            let place = position.map(|number| f64::from(number) * metres_per_unit);
            if place.iter().any(|number| number.abs() >= FARTHEST_M) {
                found.too_far.push(frame);
            } else if position == [0.0; 3] {
                found.at_origin.push(frame);
            }
            is_elsewhere |=
                place.iter().map(|number| number * number).sum::<f64>().sqrt() > ORIGIN_M;
        }
        if !is_elsewhere {
            found.at_origin.clear();
        }
        found
    }

    /// Without samples that are no places, which is noted.
    #[must_use]
    pub fn without_placeless(mut self) -> Self {
        let metres_per_unit = self.head.metres_per_unit().unwrap_or(USUAL_UNIT_M);
        let points = self.head.points.len();
        let mut told = PlacelessCount::default();
        for point in 0..points {
            if !self.head.points.get(point).is_some_and(|of| of.kind == PointKind::Marker) {
                continue;
            }
            let found = self.placeless(point, metres_per_unit);
            told.add(&found);
            for frame in found.at_origin.into_iter().chain(found.too_far) {
                if let Some(position) = self.positions.get_mut(frame * points + point) {
                    *position = [f32::NAN; 3];
                }
            }
        }
        self.head.notes.extend(told.notes());
        self
    }

    /// Says the number of the first frame, from 1.
    pub(super) fn set_first_frame(&mut self, number: u64) {
        self.head.first_frame = number.max(1);
    }

    /// Adds to what is said about the file.
    pub(super) fn note(&mut self, note: String) {
        self.head.notes.push(note);
    }

    /// Where a point was in a frame; `None` if it was not seen, or there is no such point or frame.
    #[must_use]
    pub fn sample(&self, frame: usize, point: usize) -> Option<PointSample> {
        let points = self.head.points.len();
        let at = frame.checked_mul(points)?.checked_add(point).filter(|_| point < points)?;
        let position = *self.positions.get(at)?;
        let is_seen = position.iter().all(|number| number.is_finite());
        is_seen.then(|| PointSample {
            position,
            residual: self.residuals.get(at).copied().unwrap_or(0.0),
            cameras: self.cameras.get(at).copied().unwrap_or(0),
        })
    }

    /// The counts of a frame, as in [`Frame::analog`]; empty if there is no such frame.
    #[must_use]
    pub fn analog_counts(&self, frame: usize) -> &[f32] {
        let counts = self.head.analog.counts_per_frame();
        let range = frame.saturating_mul(counts)..frame.saturating_add(1).saturating_mul(counts);
        self.analog.get(range).unwrap_or_default()
    }

    /// Copies a frame. False if there is none of this number.
    pub fn frame(&self, index: usize, frame: &mut Frame) -> bool {
        if index >= self.head.frames {
            return false;
        }
        frame.points.clear();
        frame.points.extend((0..self.head.points.len()).map(|point| self.sample(index, point)));
        frame.analog.clear();
        frame.analog.extend(self.analog_counts(index));
        true
    }
}

/// Where frames come from, one after the other.
pub trait Frames {
    /// What is known before the first.
    fn head(&self) -> &Head;

    /// Reads the next frame; false after the last.
    ///
    /// # Errors
    /// What keeps it from being read.
    fn next_frame(&mut self, frame: &mut Frame) -> Result<bool, Error>;
}

/// The frames of markers in memory.
#[derive(Debug)]
pub struct FramesOf<'a> {
    markers: &'a Markers,
    next: usize,
}

impl<'a> FramesOf<'a> {
    /// From the first.
    #[must_use]
    pub const fn new(markers: &'a Markers) -> Self {
        Self { markers, next: 0 }
    }
}

impl Frames for FramesOf<'_> {
    fn head(&self) -> &Head {
        &self.markers.head
    }

    fn next_frame(&mut self, frame: &mut Frame) -> Result<bool, Error> {
        let is_there = self.markers.frame(self.next, frame);
        self.next += usize::from(is_there);
        Ok(is_there)
    }
}
