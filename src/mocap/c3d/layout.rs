//! Where in a C3D file which number stands, settled from claims that do not always agree.
//!
//! How many points, analog counts and frames there are, and where the data begin, stands both in the
//! header and in parameters. All combinations of what is claimed are held against the length of the file:
//! one that fills the file exactly is right, whatever else is claimed. Where none does, parameters are
//! believed, and as many whole frames are read as there are.

use super::header::{BLOCK, Header};
use crate::error::{Error, ErrorKind, counted, either};
use crate::mocap::markers::{MAX_CHANNELS, MAX_POINTS};
use crate::mocap::parameters::{Parameter, Parameters};

/// The number of frames of a longer file, where 16 bits tell it.
const SATURATED: u64 = 65_535;

/// The layout of the data.
#[derive(Clone, Debug, PartialEq)]
pub struct Layout {
    /// Byte at which the data begin.
    pub start: u64,
    /// Points per frame.
    pub points: usize,
    /// Analog counts per frame.
    pub analog: usize,
    /// Analog channels.
    pub channels: usize,
    /// Size of a count; negative if the data are real numbers.
    pub scale: f32,
    /// Whole frames that are there.
    pub frames: u64,
    /// Frames that are claimed.
    pub claimed: u64,
    /// Number of the first frame.
    pub first: u64,
    /// Disagreements, and what was taken.
    pub notes: Vec<String>,
}

impl Layout {
    /// True if the data are real numbers.
    pub fn is_real(&self) -> bool {
        self.scale < 0.0
    }

    /// Bytes of a number.
    pub fn word(&self) -> usize {
        if self.is_real() { 4 } else { 2 }
    }

    /// Bytes of a frame.
    pub fn frame_bytes(&self) -> usize {
        (4 * self.points + self.analog) * self.word()
    }
}

/// What header and parameters claim, each the likelier first.
struct Claims {
    points: Vec<usize>,
    analog: Vec<usize>,
    scale: Vec<f32>,
    start: Vec<u64>,
    frames: Vec<u64>,
}

#[derive(Clone, Copy)]
struct Candidate {
    points: usize,
    analog: usize,
    scale: f32,
    start: u64,
    frames: u64,
}

impl Candidate {
    fn frame_bytes(&self) -> u64 {
        let word = if self.scale < 0.0 { 4 } else { 2 };
        (4 * self.points + self.analog) as u64 * word
    }

    /// Frames that fit into a file of this length.
    fn room(&self, bytes: u64) -> u64 {
        bytes.saturating_sub(self.start).checked_div(self.frame_bytes()).unwrap_or(0)
    }

    /// True if it fills the file to the block.
    fn is_exact(&self, bytes: u64) -> bool {
        let needed = self.start.saturating_add(self.frames.saturating_mul(self.frame_bytes()));
        self.frame_bytes() > 0 && needed <= bytes && bytes - needed < BLOCK as u64
    }

    /// How many claims it contradicts.
    fn against(&self, claims: &Claims) -> usize {
        let saturated = |claim: u64| claim == SATURATED && self.frames > claim;
        let frames = claims.frames.iter().filter(|&&of| of != self.frames && !saturated(of));
        claims.points.iter().filter(|&&of| of != self.points).count()
            + claims.analog.iter().filter(|&&of| of != self.analog).count()
            + claims.scale.iter().filter(|&&of| (of < 0.0) != (self.scale < 0.0)).count()
            + claims.start.iter().filter(|&&of| of != self.start).count()
            + frames.count()
    }
}

/// Settles the layout of a file of so many bytes. `section_end` is the byte behind the last parameter.
///
/// # Errors
/// If nothing that is claimed can be.
pub fn settle(
    header: &Header,
    parameters: &Parameters,
    section_end: u64,
    bytes: u64,
) -> Result<Layout, Error> {
    let channels_claimed = count(parameters, "ANALOG", "USED");
    let mut claims = claims(header, parameters, channels_claimed, section_end, bytes);
    let frames_at_65535 = claims.frames.contains(&SATURATED);
    let mut best: Option<((bool, usize), Candidate)> = None;
    let frames = if claims.frames.is_empty() { vec![0] } else { claims.frames.clone() };
    for &points in &claims.points {
        for &analog in &claims.analog {
            for &scale in &claims.scale {
                for &start in &claims.start {
                    let mut candidate = Candidate { points, analog, scale, start, frames: 0 };
                    let room = candidate.room(bytes);
                    let longer = (frames_at_65535 && room > SATURATED).then_some(room);
                    for frames in frames.iter().copied().chain(longer) {
                        candidate.frames = frames;
                        let rank = (!candidate.is_exact(bytes), candidate.against(&claims));
                        if best.as_ref().is_none_or(|(known, _)| rank < *known) {
                            best = Some((rank, candidate));
                        }
                    }
                }
            }
        }
    }
    let Some((_, taken)) = best else {
        return Err(no_layout(header, parameters, section_end, bytes));
    };
    let room = taken.room(bytes);
    claims.frames.retain(|&claim| !(claim == SATURATED && taken.frames > claim));
    let mut layout = Layout {
        start: taken.start,
        points: taken.points,
        analog: taken.analog,
        channels: channels_of(taken.analog, channels_claimed, header.per_frame),
        scale: taken.scale,
        frames: taken.frames.min(room),
        claimed: taken.frames,
        first: first(header, parameters, taken.frames),
        notes: Vec::new(),
    };
    layout.tell(&claims, header, parameters, bytes);
    if layout.frames == 0 && layout.claimed > 0 && layout.frame_bytes() > 0 {
        return Err(Error::of(ErrorKind::Malformed, "the file ends before its first frame")
            .at(format!("byte {}, where the data begin", layout.start))
            .got(format!("{} from there on", counted(bytes.saturating_sub(layout.start), "byte")))
            .allowed(format!(
                "{} of {}: {} and {}",
                counted(layout.claimed, "frame"),
                counted(layout.frame_bytes(), "byte"),
                counted(layout.points, "point"),
                counted(layout.analog, "analog count")
            ))
            .remedy("copy the file again"));
    }
    Ok(layout)
}

fn count(parameters: &Parameters, group: &str, name: &str) -> Option<u64> {
    parameters.get(group, name).and_then(Parameter::first_count)
}

fn claims(
    header: &Header,
    parameters: &Parameters,
    channels: Option<u64>,
    section_end: u64,
    bytes: u64,
) -> Claims {
    let points = [count(parameters, "POINT", "USED"), Some(header.points.into())];
    let per_frame = [Some(header.per_frame.into()), ratio(parameters)];
    let used = per_frame.iter().map(|per_frame| Some(channels?.saturating_mul((*per_frame)?)));
    let analog = used.chain([Some(header.analog.into())]);
    let mut scale: Vec<f32> = Vec::new();
    let stored = parameters.get("POINT", "SCALE").and_then(Parameter::number);
    for claim in stored.map(|scale| scale as f32).into_iter().chain([header.scale]) {
        if claim.is_finite() && claim != 0.0 && !scale.contains(&claim) {
            scale.push(claim);
        }
    }
    if scale.is_empty() {
        scale = vec![-1.0, 1.0];
    }
    let start = [Some(header.data_start.into()), count(parameters, "POINT", "DATA_START")];
    let start = start.into_iter().flatten().filter(|&block| block > 1);
    let start = start.map(|block| (block - 1) * BLOCK as u64);
    let is_free = |start: &u64| *start >= section_end && *start <= bytes;
    let limited = |claims: &mut dyn Iterator<Item = Option<u64>>, most: usize| {
        let claims = claims.flatten().filter_map(|claim| usize::try_from(claim).ok());
        distinct(claims.filter(|&claim| claim <= most))
    };
    Claims {
        points: limited(&mut points.into_iter(), MAX_POINTS),
        analog: limited(&mut analog.into_iter(), 65_535),
        scale,
        start: distinct(start.filter(is_free)),
        frames: frames(header, parameters),
    }
}

fn distinct<T: PartialEq>(claims: impl Iterator<Item = T>) -> Vec<T> {
    let mut known = Vec::new();
    for claim in claims {
        if !known.contains(&claim) {
            known.push(claim);
        }
    }
    known
}

/// Analog samples per frame, by the rates.
fn ratio(parameters: &Parameters) -> Option<u64> {
    let rate = |group: &str| {
        let rate = parameters.get(group, "RATE").and_then(Parameter::number);
        rate.filter(|rate| rate.is_finite() && *rate > 0.0)
    };
    let ratio = rate("ANALOG")? / rate("POINT")?;
    (0.5..1e5).contains(&ratio).then(|| ratio.round() as u64)
}

/// Channels that make so many counts per frame.
fn channels_of(analog: usize, claimed: Option<u64>, per_frame: u16) -> usize {
    let divides = |channels: &usize| *channels > 0 && analog.is_multiple_of(*channels);
    let claimed = claimed.and_then(|claimed| usize::try_from(claimed).ok());
    let by_header = analog.checked_div(per_frame.into());
    let channels = claimed.filter(divides).or_else(|| by_header.filter(divides));
    channels.unwrap_or(analog).min(analog).min(MAX_CHANNELS)
}

/// Number of a frame in two words, the lower first.
fn field(parameters: &Parameters, name: &str) -> Option<u64> {
    let counts = parameters.get("TRIAL", name)?.counts();
    let low = (*counts.first()?)?;
    Some(low + (counts.get(1).copied().flatten().unwrap_or(0) << 16))
}

fn frames(header: &Header, parameters: &Parameters) -> Vec<u64> {
    let trial = field(parameters, "ACTUAL_START_FIELD").zip(field(parameters, "ACTUAL_END_FIELD"));
    let trial = trial.and_then(|(first, last)| Some(last.checked_sub(first)? + 1));
    let long = count(parameters, "POINT", "LONG_FRAMES");
    let claims = [trial, long, count(parameters, "POINT", "FRAMES"), header.frames()];
    distinct(claims.into_iter().flatten().filter(|&frames| frames > 0))
}

fn first(header: &Header, parameters: &Parameters, frames: u64) -> u64 {
    // A trial that does not tell how many frames there are does not tell the first one either.
    let last = field(parameters, "ACTUAL_END_FIELD");
    let trial = field(parameters, "ACTUAL_START_FIELD")
        .filter(|&first| last.is_some_and(|last| last.checked_sub(first) == frames.checked_sub(1)));
    trial.unwrap_or(header.first.into()).max(1)
}

impl Layout {
    /// Says which claims were not taken, and what the file lacks.
    fn tell(&mut self, claims: &Claims, header: &Header, parameters: &Parameters, bytes: u64) {
        let says = |what: &str, from: &str, claim: u64, taken: u64| {
            format!(
                "{from} says {}; {taken} by the length of the file and the other claims",
                counted(claim, what)
            )
        };
        let mut notes = Vec::new();
        let used = count(parameters, "POINT", "USED");
        for (from, claim) in [("the header", Some(header.points.into())), ("POINT:USED", used)] {
            if let Some(claim) = claim.filter(|claim| *claim != self.points as u64) {
                notes.push(says("point", from, claim, self.points as u64));
            }
        }
        if usize::from(header.analog) != self.analog {
            let (claim, taken) = (header.analog.into(), self.analog as u64);
            notes.push(says("analog count of a frame", "the header", claim, taken));
        }
        for claim in claims.frames.iter().filter(|&&claim| claim != self.claimed) {
            notes.push(says("frame", "the file elsewhere", *claim, self.claimed));
        }
        for claim in claims.scale.iter().filter(|&&claim| claim != self.scale) {
            notes.push(format!(
                "two scales of points, {} and {claim}: the first is taken",
                self.scale
            ));
        }
        for claim in claims.start.iter().filter(|&&claim| claim != self.start) {
            notes.push(format!(
                "the data are said to begin at byte {claim}, too; {} is taken",
                self.start
            ));
        }
        let frame_bytes = self.frame_bytes() as u64;
        if self.frames < self.claimed {
            let held = bytes.saturating_sub(self.start);
            notes.push(format!(
                "{} {} claimed, {} from byte {} on; {held} {are} there: {}, \
                 {} of a part of one left out",
                counted(self.claimed, "frame"),
                either(self.claimed, "is", "are"),
                counted(self.claimed.saturating_mul(frame_bytes), "byte"),
                self.start,
                counted(self.frames, "whole frame"),
                counted(held.checked_rem(frame_bytes).unwrap_or(0), "byte"),
                held = counted(held, "byte"),
                are = either(held, "is", "are")
            ));
        }
        let end = self.start.saturating_add(self.frames.saturating_mul(frame_bytes));
        let behind = bytes.saturating_sub(end);
        if self.frames == self.claimed && behind >= BLOCK as u64 {
            notes.push(format!("left out: {} behind the last frame", counted(behind, "byte")));
        }
        self.notes = notes;
    }
}

fn no_layout(header: &Header, parameters: &Parameters, section_end: u64, bytes: u64) -> Error {
    let start = count(parameters, "POINT", "DATA_START").unwrap_or(0);
    let used = count(parameters, "POINT", "USED");
    let block = u64::from(header.data_start).max(start);
    if block.saturating_sub(1) * BLOCK as u64 > bytes {
        return Error::of(ErrorKind::Malformed, "the file ends before its data")
            .at(format!("block {block}, byte {}", (block - 1) * BLOCK as u64))
            .got(format!("a file of {bytes}", bytes = counted(bytes, "byte")))
            .allowed(format!("{} and more from there on", counted(header.points, "point")))
            .remedy("copy the file again");
    }
    Error::of(
        ErrorKind::Malformed,
        "the file does not say where its data are, or how many points it has",
    )
    .at("header, POINT:DATA_START, POINT:USED")
    .got(format!(
        "data in block {} (header) or {start} (POINT:DATA_START), {} or {}",
        header.data_start,
        header.points,
        counted(used.map_or_else(|| "no".to_owned(), |used| used.to_string()), "point")
    ))
    .allowed(format!(
        "a block from {} to {}; at most {MAX_POINTS} points",
        section_end.div_ceil(BLOCK as u64) + 1,
        bytes / BLOCK as u64 + 1
    ))
    .remedy("the file is cut off or damaged: copy it again")
}
