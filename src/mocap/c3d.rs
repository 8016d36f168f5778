//! C3D, the file of optical motion capture: markers, analog channels, events and force plates.
//!
//! The format is described in "The C3D File Format: User Guide" (Motion Lab Systems, 2008) and at
//! <https://www.c3d.org>. Files of Intel, DEC and MIPS machines are read, with integer or real data. Real files
//! break the book in many ways; what can be told from the rest of the file is, and each time it is said
//! ([`Head::notes`]). Frames are read one by one: memory does not grow with the file.
//!
//! A sample whose fourth word is negative was not seen. So is one that is no finite number, and one
//! at the very origin whose fourth word has all bits set, as some programs fill frames. One *not* at the
//! origin with such a word was seen, and its residual is not known.

pub mod check;
mod header;
mod layout;
mod meaning;
pub mod number;
mod section;
pub mod write;

use crate::error::{Error, ErrorKind, counted, either};
use crate::mocap::markers::{Frame, Frames, Head, Markers, PointSample};
use crate::mocap::opened::{opened, unreadable};
use header::{BLOCK, Header, KEY};
use layout::Layout;
use number::Processor;
use std::io::{Cursor, ErrorKind as IoErrorKind, Read};
use std::path::Path;

/// Bytes of frames that are read at once, unless a single frame is longer.
const CHUNK_BYTES: usize = 1 << 17;
/// Largest file of unknown length (a pipe) that is read, bytes.
const MAX_PIPE_BYTES: u64 = 256 << 20;

/// A C3D file being read.
#[derive(Debug)]
pub struct Reader<R> {
    stream: Cursor<Vec<u8>>,
    rest: R,
    head: Head,
    header: Header,
    layout: Layout,
    processor: Processor,
    unsigned: bool,
    /// Frames handed out.
    given: u64,
    chunk: Vec<u8>,
    /// Bytes of the chunk that were used.
    used: usize,
    unusable: u64,
    /// Frame and point of the first of them.
    first_unusable: Option<(u64, usize)>,
    without_residual: u64,
}

/// Opens a file; its frames are still to be read.
///
/// # Errors
/// If the file cannot be read, or breaks the format beyond what can be made of it.
pub fn open(path: &Path) -> Result<Reader<Box<dyn Read>>, Error> {
    let in_file = |error: Error| error.in_file(path);
    let (file, found) = opened(path)?;
    if found.is_file() || found.is_dir() {
        return Reader::new(Box::new(file) as Box<dyn Read>, found.len()).map_err(in_file);
    }
    let mut bytes = Vec::new();
    file.take(MAX_PIPE_BYTES)
        .read_to_end(&mut bytes)
        .map_err(|cause| in_file(unreadable(&cause)))?;
    let length = bytes.len() as u64;
    Reader::new(Box::new(Cursor::new(bytes)) as Box<dyn Read>, length).map_err(in_file)
}

/// Reads a whole file. Memory stays below four times the file's size plus 16 MiB.
///
/// # Errors
/// As [`open`], and what keeps a frame from being read.
pub fn read(path: &Path) -> Result<Markers, Error> {
    open(path)?.into_markers().map_err(|error| match error.place {
        Some(_) => error,
        None => error.at(path.display().to_string()),
    })
}

/// Reads from memory.
///
/// # Errors
/// As [`read`].
pub fn parse(bytes: &[u8]) -> Result<Markers, Error> {
    Reader::new(bytes, bytes.len() as u64)?.into_markers()
}

impl<R: Read> Reader<R> {
    /// Reads header and parameters of a file of so many bytes.
    ///
    /// # Errors
    /// If it is no C3D file, or one from which nothing can be read.
    pub fn new(mut stream: R, bytes: u64) -> Result<Self, Error> {
        let mut prefix = Vec::new();
        fill(&mut stream, &mut prefix, BLOCK as u64)?;
        let [block, key] = *prefix.first_chunk::<2>().ok_or_else(|| no_c3d(&prefix, bytes))?;
        if key != KEY {
            return Err(no_c3d(&prefix, bytes));
        }
        let origin = usize::from(block).saturating_sub(1) * BLOCK;
        if origin < BLOCK || origin as u64 + 4 > bytes {
            return Err(Error::of(ErrorKind::Malformed, "the file does not hold its parameters")
                .at("byte 0, the block of the parameters")
                .got(format!(
                    "block {block}, byte {origin}; the file has {bytes}",
                    bytes = counted(bytes, "byte")
                ))
                .allowed("a block inside the file, 2 in most files")
                .remedy("copy the file again"));
        }
        fill(&mut stream, &mut prefix, origin as u64 + 4)?;
        let section_head = prefix.get(origin..).unwrap_or_default();
        let machine = section_head.get(3).copied().unwrap_or(0);
        let processor = Processor::of_byte(machine).unwrap_or(Processor::Intel);
        let claimed = origin + section::claimed_bytes(section_head);
        let header = Header::read(&prefix, processor);
        // A section may be longer than one byte can tell: it reaches to the data at most.
        let data = usize::from(header.data_start).saturating_sub(1) * BLOCK;
        fill(&mut stream, &mut prefix, claimed.max(data) as u64)?;
        let all = prefix.get(origin..).unwrap_or_default();
        let mut section = section::read(all, origin)?;
        // Parameters that nothing ends go on into the data.
        if data > origin && origin + section.length > data {
            section = section::read(all.get(..data - origin).unwrap_or(all), origin)?;
        }
        let section_end = (origin + section.length) as u64;
        let layout = layout::settle(&header, &section.parameters, section_end, bytes)?;
        let kind = if layout.is_real() { "real" } else { "integer" };
        let encoding = format!("{}, {kind}", section.processor.word());
        let unsigned = meaning::is_unsigned(&section.parameters);
        let mut head = meaning::head(&header, &layout, section.parameters, encoding);
        head.notes.splice(0..0, section.notes);
        let mut reader = Self {
            stream: Cursor::new(prefix),
            rest: stream,
            head,
            header,
            layout,
            processor: section.processor,
            unsigned,
            given: 0,
            chunk: Vec::new(),
            used: 0,
            unusable: 0,
            first_unusable: None,
            without_residual: 0,
        };
        reader.go_to_data()?;
        Ok(reader)
    }

    /// Takes somebody's word for the frames per second ([`Head::take_rate`]).
    ///
    /// # Errors
    /// A rate that nothing is captured with.
    pub fn take_rate(&mut self, rate_hz: f64) -> Result<(), Error> {
        self.head.take_rate(rate_hz)
    }

    /// What other programs may stumble over in this file ([`check`]).
    #[must_use]
    pub fn findings(&self) -> Vec<String> {
        check::findings(&self.head, &self.header, &self.layout)
    }

    fn go_to_data(&mut self) -> Result<(), Error> {
        let held = self.stream.get_ref().len() as u64;
        self.stream.set_position(self.layout.start.min(held));
        let mut left = self.layout.start.saturating_sub(held);
        let mut passed = [0; BLOCK];
        while left > 0 {
            let step = left.min(BLOCK as u64);
            let part = passed.get_mut(..step as usize).unwrap_or_default();
            self.rest.read_exact(part).map_err(|cause| broken_off(&cause))?;
            left -= step;
        }
        Ok(())
    }

    /// Reads all frames.
    ///
    /// # Errors
    /// What keeps a frame from being read.
    pub fn into_markers(mut self) -> Result<Markers, Error> {
        let mut markers = Markers::with_room(self.head.clone())?;
        let mut frame = Frame::default();
        while self.next_frame(&mut frame)? {
            markers.push(&frame);
        }
        for note in self.closing_notes() {
            markers.note(note);
        }
        Ok(markers)
    }

    /// What was found in the frames that were read, for the person who asked.
    #[must_use]
    pub fn closing_notes(&self) -> Vec<String> {
        let mut notes = Vec::new();
        if let Some((frame, point)) = self.first_unusable {
            notes.push(format!(
                "{} {are}, though marked as seen: taken as not seen; the first is in frame {frame}, of {}",
                counted(self.unusable, "sample"),
                self.head.points.get(point).map_or("", |point| &point.label),
                are = either(self.unusable, "is no finite number", "are no finite numbers")
            ));
        }
        if self.without_residual > 0 {
            notes.push(format!(
                "{} {have} a fourth word with all bits set, as if not seen, and are not at the \
                 origin: taken as seen, residual unknown",
                counted(self.without_residual, "sample"),
                have = either(self.without_residual, "has", "have")
            ));
        }
        notes
    }

    /// Reads the frames that come next; false if there are none.
    fn refill(&mut self) -> Result<bool, Error> {
        let frame = self.layout.frame_bytes();
        let left = self.layout.frames - self.given;
        if left == 0 {
            return Ok(false);
        }
        let frames = (CHUNK_BYTES.checked_div(frame).unwrap_or(1).max(1) as u64).min(left);
        self.chunk.resize(frames as usize * frame, 0);
        self.used = 0;
        let held = self.stream.read(&mut self.chunk).map_err(|cause| broken_off(&cause))?;
        let rest = self.chunk.get_mut(held..).unwrap_or_default();
        self.rest.read_exact(rest).map_err(|cause| broken_off(&cause))?;
        Ok(true)
    }

    fn sample(&mut self, point: usize, position: [f32; 3], word: u16) -> Option<PointSample> {
        if !position.iter().all(|number| number.is_finite()) {
            self.first_unusable.get_or_insert((self.head.first_frame + self.given, point));
            self.unusable += 1;
            return None;
        }
        if word > 0x7fff {
            // All bits set in a word that is not negative.
            if position == [0.0; 3] {
                return None;
            }
            self.without_residual += 1;
            return Some(PointSample { position, residual: 0.0, cameras: 0 });
        }
        let [cameras, residual] = word.to_be_bytes();
        let residual = f32::from(residual) * self.head.residual_step;
        Some(PointSample { position, residual, cameras })
    }

    fn real_frame(&mut self, bytes: &[u8], frame: &mut Frame, number: impl Fn([u8; 4]) -> f32) {
        let (points, analog) = bytes.split_at((16 * self.layout.points).min(bytes.len()));
        for &[x, y, z, word] in points.as_chunks::<4>().0.as_chunks::<4>().0 {
            let word = number(word);
            let is_seen = word >= 0.0;
            let position = [x, y, z].map(&number);
            // A number beyond 16 bits has all of them set, too.
            let at = frame.points.len();
            frame.points.push(if is_seen { self.sample(at, position, word as u16) } else { None });
        }
        frame.analog.extend(analog.as_chunks::<4>().0.iter().map(|&bytes| number(bytes)));
    }

    fn integer_frame(&mut self, bytes: &[u8], frame: &mut Frame, number: impl Fn([u8; 2]) -> u16) {
        let (points, analog) = bytes.split_at((8 * self.layout.points).min(bytes.len()));
        let scale = self.layout.scale;
        for &[x, y, z, word] in points.as_chunks::<2>().0.as_chunks::<4>().0 {
            let position = [x, y, z].map(|bytes| f32::from(number(bytes).cast_signed()) * scale);
            let word = number(word);
            let is_seen = word.cast_signed() >= 0;
            let at = frame.points.len();
            frame.points.push(if is_seen { self.sample(at, position, word) } else { None });
        }
        let unsigned = self.unsigned;
        frame.analog.extend(analog.as_chunks::<2>().0.iter().map(|&bytes| {
            let count = number(bytes);
            if unsigned { f32::from(count) } else { f32::from(count.cast_signed()) }
        }));
    }
}

impl<R: Read> Frames for Reader<R> {
    fn head(&self) -> &Head {
        &self.head
    }

    fn next_frame(&mut self, frame: &mut Frame) -> Result<bool, Error> {
        frame.points.clear();
        frame.analog.clear();
        if self.layout.frame_bytes() == 0 || self.given == self.layout.frames {
            return Ok(false);
        }
        if self.used >= self.chunk.len() && !self.refill()? {
            return Ok(false);
        }
        let chunk = std::mem::take(&mut self.chunk);
        let end = self.used + self.layout.frame_bytes();
        let bytes = chunk.get(self.used..end).unwrap_or_default();
        match (self.layout.is_real(), self.processor) {
            (true, Processor::Intel) => self.real_frame(bytes, frame, f32::from_le_bytes),
            (true, Processor::Dec) => self.real_frame(bytes, frame, number::vax_float),
            (true, Processor::Mips) => self.real_frame(bytes, frame, f32::from_be_bytes),
            (false, Processor::Mips) => self.integer_frame(bytes, frame, u16::from_be_bytes),
            (false, _) => self.integer_frame(bytes, frame, u16::from_le_bytes),
        }
        self.chunk = chunk;
        self.used = end;
        self.given += 1;
        Ok(true)
    }
}

/// Reads on until so many bytes are held, or the file ends.
fn fill(stream: &mut impl Read, prefix: &mut Vec<u8>, length: u64) -> Result<(), Error> {
    let missing = length.saturating_sub(prefix.len() as u64);
    stream.take(missing).read_to_end(prefix).map_err(|cause| broken_off(&cause))?;
    Ok(())
}

fn broken_off(cause: &std::io::Error) -> Error {
    if cause.kind() == IoErrorKind::UnexpectedEof {
        return Error::of(ErrorKind::Io, "the file became shorter while it was read")
            .remedy("read it again once nobody writes it");
    }
    Error::of(cause.into(), "the file cannot be read").got(cause.to_string())
}

fn no_c3d(prefix: &[u8], bytes: u64) -> Error {
    let first = prefix.iter().take(4).map(|byte| format!("{byte:02x}"));
    Error::of(ErrorKind::Malformed, "not a C3D file")
        .at("byte 1")
        .got(match prefix.len() {
            0..2 => format!("{bytes} in all", bytes = counted(bytes, "byte")),
            _ => format!("bytes {} ...", first.collect::<Vec<_>>().join(" ")),
        })
        .allowed("50 as the second byte")
        .remedy("give the path of a .c3d file; if it is one, copy it again")
}
