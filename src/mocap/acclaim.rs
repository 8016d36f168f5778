//! Acclaim skeletons and motions (ASF, AMC): read as what a BVH file holds.
//!
//! An ASF file draws a skeleton: of each bone its direction and length in the world when all angles are
//! zero, the axes `C` its angles turn about, and which angles it has. An AMC file has the angles, frame by
//! frame. The format is described by Lander, "Working with Motion Capture File Formats" (Game Developer,
//! January 1998), and used by the CMU motion capture database (<https://mocap.cs.cmu.edu>): a bone's own
//! rotation is `C R inverse(C)`, where `R` turns about x, then y, then z for `dof rx ry rz`, all about fixed
//! axes, and `C` is made of the angles of `axis` in the same way.
//!
//! A bone becomes a joint at its beginning, with the bone's own rotation as three angles; its length is the
//! OFFSET of what hangs below it. So whatever takes a BVH file takes these.

use crate::error::{Error, ErrorKind, counted};
use crate::mocap::bvh::source::Source;
use crate::mocap::bvh::{
    Axis, Bvh, Channel, Joint, MAX_DEPTH, MAX_FILE_BYTES, MAX_JOINTS, MAX_POSES,
};
use crate::mocap::opened::{opened, unreadable, with_a_point};
use glam::{DQuat, DVec3, EulerRot};
use std::collections::BTreeMap;
use std::io::Read;
use std::path::Path;

/// Largest ASF file, bytes.
const MAX_SKELETON_BYTES: u64 = 1 << 20;
/// Largest magnitude of a number; beyond it the file is damaged, and squares stay finite.
const MAX_MAGNITUDE: f64 = 1e9;
/// What poses may take beside seven quarters of the file, bytes: twice that, while they are moved to where
/// there is more room, is what a reader may take in all.
const SPARE_BYTES: u64 = 6 << 20;
/// Frames per second of a file that does not say them, as in the CMU database.
pub const USUAL_HZ: f64 = 120.0;
/// Frames per second that are taken for real.
const RATES_HZ: std::ops::RangeInclusive<f64> = 0.1..=100_000.0;

/// Fails if nothing is captured with so many frames per second.
///
/// # Errors
/// As said.
pub(super) fn check_rate(rate_hz: f64) -> Result<(), Error> {
    if RATES_HZ.contains(&rate_hz) {
        return Ok(());
    }
    Err(Error::of(ErrorKind::OutsideLimits, "no rate that motion is captured with")
        .at("frames per second")
        .got(format!("{rate_hz} Hz"))
        .allowed(format!("{} to {} Hz", RATES_HZ.start(), RATES_HZ.end())))
}

/// What one number of a bone is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Freedom {
    Turn(Axis),
    Shift(Axis),
}

impl Freedom {
    fn of(word: &str) -> Option<Self> {
        Some(match word.to_ascii_lowercase().as_str() {
            "rx" => Self::Turn(Axis::X),
            "ry" => Self::Turn(Axis::Y),
            "rz" => Self::Turn(Axis::Z),
            "tx" => Self::Shift(Axis::X),
            "ty" => Self::Shift(Axis::Y),
            "tz" => Self::Shift(Axis::Z),
            _ => return None,
        })
    }
}

/// One bone.
#[derive(Clone, Debug)]
struct Bone {
    name: String,
    parent: Option<usize>,
    /// From its beginning to its end, file units, all angles zero.
    along: DVec3,
    /// The axes its angles turn about.
    axes: DQuat,
    freedoms: Vec<Freedom>,
}

/// An ASF file: a skeleton without motion.
#[derive(Clone, Debug)]
pub struct AcclaimSkeleton {
    /// The root, then bones, parents before children.
    bones: Vec<Bone>,
    /// Where the root is if the motion says zero.
    origin: DVec3,
    notes: Vec<String>,
}

/// Reads an ASF file.
///
/// # Errors
/// If it cannot be read, breaks the format or exceeds a bound; the message names the line.
pub fn read_skeleton(path: &Path) -> Result<AcclaimSkeleton, Error> {
    let (file, known) = opened(path)?;
    let bytes = known.len();
    if bytes > MAX_SKELETON_BYTES {
        return Err(too_large(bytes, MAX_SKELETON_BYTES).in_file(path));
    }
    let mut text = Vec::new();
    file.take(MAX_SKELETON_BYTES)
        .read_to_end(&mut text)
        .map_err(|cause| unreadable(&cause).in_file(path))?;
    parse_skeleton(&text).map_err(|error| error.in_file(path))
}

/// Reads an AMC file of this skeleton, with what was found out about it. `rate_hz` goes before what the
/// file says.
///
/// # Errors
/// If it cannot be read, breaks the format, names other bones or exceeds a bound.
pub fn read(
    path: &Path,
    skeleton: &AcclaimSkeleton,
    rate_hz: Option<f64>,
) -> Result<(Bvh, Vec<String>), Error> {
    let (file, known) = opened(path)?;
    motion(file, known.len(), skeleton, rate_hz).map_err(|error| error.in_file(path))
}

/// Reads a skeleton from memory.
///
/// # Errors
/// As [`read_skeleton`].
pub fn parse_skeleton(text: &[u8]) -> Result<AcclaimSkeleton, Error> {
    if text.len() as u64 > MAX_SKELETON_BYTES {
        return Err(too_large(text.len() as u64, MAX_SKELETON_BYTES));
    }
    let text = String::from_utf8_lossy(text);
    let mut parsed = Parsed::default();
    for line in lines(&text) {
        parsed.line(&line)?;
    }
    parsed.finish()
}

/// Reads a motion from memory.
///
/// # Errors
/// As [`read`].
pub fn parse(
    text: &[u8],
    skeleton: &AcclaimSkeleton,
    rate_hz: Option<f64>,
) -> Result<(Bvh, Vec<String>), Error> {
    motion(text, text.len() as u64, skeleton, rate_hz)
}

fn too_large(bytes: u64, most: u64) -> Error {
    Error::of(ErrorKind::Malformed, "the file is too large")
        .got(counted(bytes, "byte"))
        .allowed(format!("at most {most}", most = counted(most, "byte")))
        .remedy("cut the recording into shorter files")
}

/// Words of one line.
struct Line<'a> {
    number: usize,
    words: Vec<&'a str>,
}

/// The text of an ASF file as lines of words; comments are left out.
fn lines(text: &str) -> impl Iterator<Item = Line<'_>> {
    let numbered = text.split('\n').enumerate();
    let lines = numbered.map(|(at, line)| {
        let plain = line.split('#').next().unwrap_or_default();
        Line { number: at + 1, words: plain.split_whitespace().collect() }
    });
    lines.filter(|line| !line.words.is_empty())
}

fn malformed(what: impl Into<String>, line: usize) -> Error {
    Error::of(ErrorKind::Malformed, what).at(format!("line {line}"))
}

fn number(word: &str, line: usize) -> Result<f64, Error> {
    let number = word.parse().ok().filter(|number: &f64| number.abs() <= MAX_MAGNITUDE);
    number.ok_or_else(|| {
        let refused = malformed("a number is expected", line)
            .got(format!("\"{}\"", word.chars().take(40).collect::<String>()))
            .allowed(format!("a finite number, magnitude at most {MAX_MAGNITUDE}"));
        with_a_point(refused, word)
    })
}

fn three(words: &[&str], line: usize) -> Result<DVec3, Error> {
    let [x, y, z] = words
        .first_chunk::<3>()
        .ok_or_else(|| malformed("three numbers are expected", line).got(words.join(" ")))?;
    Ok(DVec3::new(number(x, line)?, number(y, line)?, number(z, line)?))
}

/// Rotations about fixed axes in this order.
fn turned(turns: impl IntoIterator<Item = (Axis, f64)>) -> DQuat {
    let turn = |all: DQuat, (axis, angle_rad): (Axis, f64)| {
        DQuat::from_axis_angle(axis.unit(), angle_rad) * all
    };
    turns.into_iter().fold(DQuat::IDENTITY, turn)
}

/// The order of three axes: `XYZ`.
fn order(word: Option<&&str>, line: usize) -> Result<[Axis; 3], Error> {
    let word = word.copied().unwrap_or("XYZ");
    let axis = |letter: char| match letter.to_ascii_uppercase() {
        'X' => Some(Axis::X),
        'Y' => Some(Axis::Y),
        'Z' => Some(Axis::Z),
        _ => None,
    };
    let axes: Vec<Axis> = word.chars().filter_map(axis).collect();
    <[Axis; 3]>::try_from(axes).ok().filter(|_| word.len() == 3).ok_or_else(|| {
        malformed("an order of axes is expected", line).got(word).allowed("XYZ, ZYX, ...")
    })
}

const fn part(of: DVec3, axis: Axis) -> f64 {
    match axis {
        Axis::X => of.x,
        Axis::Y => of.y,
        Axis::Z => of.z,
    }
}

#[derive(Default)]
struct Draft {
    name: Option<String>,
    direction: Option<DVec3>,
    length: Option<f64>,
    axes: Option<(DVec3, [Axis; 3])>,
    freedoms: Vec<Freedom>,
}

/// Which part of an ASF file a line stands in.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Section {
    #[default]
    Other,
    Units,
    Root,
    Bones,
    Hierarchy,
}

#[derive(Default)]
struct Parsed {
    section: Section,
    in_radians: bool,
    root: Draft,
    root_at: DVec3,
    root_turn: DVec3,
    open: Option<Draft>,
    bones: Vec<Draft>,
    parents: BTreeMap<String, String>,
    last_line: usize,
}

impl Parsed {
    fn line(&mut self, line: &Line) -> Result<(), Error> {
        self.last_line = line.number;
        let Some((first, rest)) = line.words.split_first() else { return Ok(()) };
        if let Some(section) = first.strip_prefix(':') {
            self.section = match section.to_ascii_lowercase().as_str() {
                "units" => Section::Units,
                "root" => Section::Root,
                "bonedata" => Section::Bones,
                "hierarchy" => Section::Hierarchy,
                _ => Section::Other,
            };
            return Ok(());
        }
        let word = first.to_ascii_lowercase();
        match self.section {
            Section::Other => Ok(()),
            Section::Units => {
                if word == "angle" {
                    self.in_radians = rest.first().is_some_and(|unit| unit.starts_with("rad"));
                }
                Ok(())
            }
            Section::Root => self.root_line(&word, rest, line.number),
            Section::Bones => self.bone_line(&word, rest, line.number),
            Section::Hierarchy => self.hierarchy_line(first, rest, line.number),
        }
    }

    fn root_line(&mut self, word: &str, rest: &[&str], line: usize) -> Result<(), Error> {
        match word {
            "order" => self.root.freedoms = freedoms(rest, line)?,
            "position" => self.root_at = three(rest, line)?,
            "orientation" => self.root_turn = three(rest, line)?,
            _ => {}
        }
        Ok(())
    }

    fn bone_line(&mut self, word: &str, rest: &[&str], line: usize) -> Result<(), Error> {
        let known = self.bones.len();
        if word == "begin" {
            if self.open.is_some() {
                return Err(malformed("a bone begins inside another", line));
            }
            if known + 1 >= MAX_JOINTS {
                return Err(
                    malformed("too many bones", line).allowed(format!("at most {MAX_JOINTS}"))
                );
            }
            self.open = Some(Draft::default());
            return Ok(());
        }
        if word == "end" {
            let bone = self.open.take();
            let bone = bone.ok_or_else(|| malformed("`end` without `begin`", line))?;
            if bone.name.is_none() || bone.direction.is_none() || bone.length.is_none() {
                return Err(malformed("a bone is not complete", line)
                    .got(bone.name.unwrap_or_else(|| "a bone without a name".to_owned()))
                    .allowed("name, direction and length"));
            }
            self.bones.push(bone);
            return Ok(());
        }
        let Some(bone) = &mut self.open else { return Ok(()) };
        match word {
            "name" => {
                let name = rest.first().ok_or_else(|| malformed("a bone has no name", line))?;
                bone.name = Some((*name).to_owned());
            }
            "direction" => bone.direction = Some(three(rest, line)?),
            "length" => bone.length = Some(number(rest.first().unwrap_or(&""), line)?),
            "axis" => bone.axes = Some((three(rest, line)?, order(rest.get(3), line)?)),
            "dof" => bone.freedoms = freedoms(rest, line)?,
            _ => {}
        }
        Ok(())
    }

    fn hierarchy_line(
        &mut self,
        parent: &str,
        children: &[&str],
        line: usize,
    ) -> Result<(), Error> {
        if matches!(parent, "begin" | "end") && children.is_empty() {
            return Ok(());
        }
        for child in children {
            let known = self.parents.insert((*child).to_owned(), parent.to_owned());
            if known.is_some() {
                return Err(malformed("a bone hangs below two others", line).got(*child));
            }
        }
        Ok(())
    }

    fn finish(self) -> Result<AcclaimSkeleton, Error> {
        let line = self.last_line.max(1);
        if self.root.freedoms.is_empty() || self.bones.is_empty() {
            return Err(malformed("not an ASF skeleton", line)
                .got(counted(self.bones.len(), "bone"))
                .allowed(":root with an order, and bones in :bonedata")
                .remedy("the file is cut off, or no ASF file: copy it again"));
        }
        let mut notes = Vec::new();
        if self.root_turn != DVec3::ZERO {
            notes.push(
                "the orientation of :root is left out: AMC files hold it in each frame".to_owned(),
            );
        }
        let angle = |of: f64| if self.in_radians { of } else { of.to_radians() };
        let axes = |given: Option<(DVec3, [Axis; 3])>| {
            let (angles, order) = given.unwrap_or((DVec3::ZERO, [Axis::X, Axis::Y, Axis::Z]));
            turned(order.map(|axis| (axis, angle(part(angles, axis)))))
        };
        let root = Bone {
            name: "root".to_owned(),
            parent: None,
            along: DVec3::ZERO,
            axes: DQuat::IDENTITY,
            freedoms: self.root.freedoms,
        };
        let mut waiting: Vec<Option<Draft>> = self.bones.into_iter().map(Some).collect();
        let mut bones = vec![root];
        let mut depths = vec![1];
        let mut at = 0;
        // Children of each bone in the order of the file.
        while at < bones.len() {
            let parent = bones.get(at).map(|bone| bone.name.clone()).unwrap_or_default();
            let depth = depths.get(at).copied().unwrap_or(1) + 1;
            for place in &mut waiting {
                let hangs_here =
                    place.as_ref().and_then(|bone| bone.name.as_ref()).is_some_and(|name| {
                        self.parents.get(name).is_some_and(|of| of.eq_ignore_ascii_case(&parent))
                    });
                let Some(bone) = place.take_if(|_| hangs_here) else { continue };
                if depth > MAX_DEPTH {
                    return Err(malformed("bones hang too deep", line)
                        .got(bone.name.unwrap_or_default())
                        .allowed(format!("at most {MAX_DEPTH} below one another")));
                }
                let direction = bone.direction.unwrap_or(DVec3::ZERO).normalize_or_zero();
                bones.push(Bone {
                    name: bone.name.unwrap_or_default(),
                    parent: Some(at),
                    along: direction * bone.length.unwrap_or(0.0),
                    axes: axes(bone.axes),
                    freedoms: bone.freedoms,
                });
                depths.push(depth);
            }
            at += 1;
        }
        let left: Vec<String> =
            waiting.into_iter().flatten().filter_map(|bone| bone.name).collect();
        if !left.is_empty() {
            return Err(malformed("bones hang nowhere", line)
                .got(left.join(", "))
                .allowed("each bone once in :hierarchy, below the root or another bone"));
        }
        Ok(AcclaimSkeleton { bones, origin: self.root_at, notes })
    }
}

fn freedoms(words: &[&str], line: usize) -> Result<Vec<Freedom>, Error> {
    let mut known = Vec::with_capacity(words.len().min(6));
    for word in words {
        let freedom = Freedom::of(word).ok_or_else(|| {
            malformed("this freedom of a bone is not read", line)
                .got(*word)
                .allowed("rx, ry, rz, tx, ty, tz")
        })?;
        if known.contains(&freedom) {
            return Err(malformed("a freedom is listed twice", line).got(*word));
        }
        known.push(freedom);
    }
    Ok(known)
}

/// Three angles of a joint as BVH lists them.
const TURNS: [Axis; 3] = [Axis::Z, Axis::X, Axis::Y];

impl AcclaimSkeleton {
    /// The bones as joints of a BVH file, file units.
    #[must_use]
    pub fn joints(&self) -> Vec<Joint> {
        let mut joints = Vec::with_capacity(self.bones.len());
        let mut first_channel = 0;
        for (at, bone) in self.bones.iter().enumerate() {
            let turns = bone.freedoms.iter().any(|of| matches!(of, Freedom::Turn(_)));
            let shifts = bone.freedoms.iter().any(|of| matches!(of, Freedom::Shift(_)));
            let mut channels = Vec::new();
            if shifts {
                channels.extend([Axis::X, Axis::Y, Axis::Z].map(Channel::Position));
            }
            if turns {
                channels.extend(TURNS.map(Channel::Rotation));
            }
            let carrier = bone.parent.and_then(|parent| self.bones.get(parent));
            let offset = carrier.map_or(DVec3::ZERO, |carrier| carrier.along);
            let is_leaf = self.bones.iter().all(|other| other.parent != Some(at));
            let count = channels.len();
            joints.push(Joint {
                name: bone.name.clone(),
                parent: bone.parent,
                offset,
                channels,
                first_channel,
                ends: if is_leaf { vec![bone.along] } else { Vec::new() },
            });
            first_channel += count;
        }
        joints
    }

    /// Puts the channels of one bone behind the others.
    fn put(
        &self,
        bone: &Bone,
        offset: DVec3,
        numbers: &[f64],
        in_radians: bool,
        to: &mut Vec<f64>,
    ) {
        let (mut shift, mut turns) = (DVec3::ZERO, Vec::with_capacity(3));
        for (freedom, &number) in bone.freedoms.iter().zip(numbers) {
            match freedom {
                Freedom::Shift(axis) => shift += axis.unit() * number,
                Freedom::Turn(axis) => {
                    turns.push((*axis, if in_radians { number } else { number.to_radians() }));
                }
            }
        }
        if bone.freedoms.iter().any(|of| matches!(of, Freedom::Shift(_))) {
            let from = if bone.parent.is_none() { self.origin } else { offset };
            to.extend((from + shift).to_array());
        }
        if !turns.is_empty() {
            let own = bone.axes * turned(turns) * bone.axes.inverse();
            let (z, x, y) = own.to_euler(EulerRot::ZXY);
            to.extend([z, x, y].map(f64::to_degrees));
        }
    }
}

/// The numbers of one frame while it is read.
struct Frame {
    /// The number that the file gives it.
    number: u64,
    line: usize,
    /// Of each bone its numbers, once they came.
    numbers: Vec<Option<Vec<f64>>>,
}

fn motion<R: Read>(
    stream: R,
    bytes: u64,
    skeleton: &AcclaimSkeleton,
    rate_hz: Option<f64>,
) -> Result<(Bvh, Vec<String>), Error> {
    if bytes > MAX_FILE_BYTES {
        return Err(too_large(bytes, MAX_FILE_BYTES));
    }
    let mut source = Source::new(stream);
    let mut reading = Reading {
        skeleton,
        joints: skeleton.joints(),
        in_radians: false,
        said_hz: None,
        frame: None,
        first_bytes: 0,
        bytes,
        values: Vec::new(),
        poses: 0,
        jumps: 0,
    };
    while source.next()? {
        reading.word(&mut source)?;
    }
    reading.finish(&source, rate_hz)
}

struct Reading<'a> {
    skeleton: &'a AcclaimSkeleton,
    joints: Vec<Joint>,
    in_radians: bool,
    said_hz: Option<f64>,
    frame: Option<Frame>,
    /// Bytes up to the end of the first frame.
    first_bytes: u64,
    bytes: u64,
    values: Vec<f64>,
    poses: usize,
    /// Frames whose number is not the one behind the last.
    jumps: usize,
}

impl Reading<'_> {
    /// Takes the first word of a line, and what belongs to it.
    fn word<R: Read>(&mut self, source: &mut Source<R>) -> Result<(), Error> {
        let word = String::from_utf8_lossy(source.token()).into_owned();
        let line = source.token_line();
        if word.starts_with('#') {
            source.rest_of_line()?;
            return Ok(());
        }
        if let Some(keyword) = word.strip_prefix(':') {
            let keyword = keyword.to_ascii_uppercase();
            let value = source.rest_of_line()?;
            match keyword.as_str() {
                "RADIANS" => self.in_radians = true,
                "SAMPLES-PER-SECOND" => self.said_hz = value.parse().ok(),
                _ => {}
            }
            return Ok(());
        }
        if let Ok(number) = word.parse::<u64>() {
            let last = self.frame.as_ref().map(|frame| frame.number);
            self.close_frame(source.consumed())?;
            self.jumps += usize::from(last.is_some_and(|last| last.checked_add(1) != Some(number)));
            let numbers = vec![None; self.skeleton.bones.len()];
            self.frame = Some(Frame { number, line, numbers });
            return Ok(());
        }
        self.bone(&word, line, source)
    }

    fn bone<R: Read>(
        &mut self,
        name: &str,
        line: usize,
        source: &mut Source<R>,
    ) -> Result<(), Error> {
        let Some(frame) = &mut self.frame else {
            return Err(malformed("the number of a frame is expected", line)
                .got(format!("\"{}\"", name.chars().take(40).collect::<String>()))
                .remedy("this is not an AMC file, or it is damaged"));
        };
        let bones = &self.skeleton.bones;
        let Some((at, bone)) = bones.iter().enumerate().find(|(_, bone)| bone.name == name) else {
            return Err(malformed("the skeleton has no such bone", line)
                .got(name.chars().take(40).collect::<String>())
                .remedy("name the skeleton that belongs to this motion: --skeleton FILE.asf"));
        };
        let text = source.rest_of_line()?;
        let words: Vec<&str> = text.split_whitespace().collect();
        if words.len() != bone.freedoms.len() {
            return Err(malformed("a bone has not one number per freedom", line)
                .got(format!("{name}: {}", counted(words.len(), "number")))
                .allowed(format!("{} by the skeleton", bone.freedoms.len()))
                .remedy("name the skeleton that belongs to this motion: --skeleton FILE.asf"));
        }
        let numbers = words.iter().map(|word| number(word, line)).collect::<Result<_, _>>()?;
        match frame.numbers.get_mut(at) {
            Some(place) if place.is_none() => *place = Some(numbers),
            _ => {
                return Err(malformed("a bone comes twice in a frame", line)
                    .got(format!("{name} in frame {}", frame.number)));
            }
        }
        Ok(())
    }

    /// Takes the frame in that ends here.
    fn close_frame(&mut self, consumed: u64) -> Result<(), Error> {
        let Some(frame) = self.frame.take() else { return Ok(()) };
        if let Some(lacking) = self.lacking(&frame) {
            return Err(malformed("a frame lacks a bone", frame.line)
                .got(format!("frame {} without {lacking}", frame.number))
                .allowed("every bone that moves, in every frame"));
        }
        if self.poses == MAX_POSES {
            return Err(malformed("too many frames", frame.line)
                .allowed(format!("at most {MAX_POSES}"))
                .remedy("cut the recording into shorter files"));
        }
        let channels = self.joints.iter().map(|joint| joint.channels.len()).sum::<usize>();
        if self.poses == 0 {
            self.first_bytes = consumed.max(1);
            // Frames are of nearly equal length; what is too much by that is never touched.
            let frames = self.bytes / self.first_bytes + 1;
            let most = self.most_bytes() as usize / size_of::<f64>();
            self.values.reserve_exact(channels.saturating_mul(frames as usize).min(most));
        }
        let needed = ((self.values.len() + channels) * size_of::<f64>()) as u64;
        if needed > self.most_bytes() {
            return Err(malformed(
                "the poses would take far more memory than the file",
                frame.line,
            )
            .got(format!("{needed} at frame {}", frame.number, needed = counted(needed, "byte")))
            .allowed(format!("{} for a file of {}", counted(self.most_bytes(), "byte"), self.bytes))
            .remedy("the file is damaged or made to harm: motions have longer names of bones"));
        }
        if self.values.capacity() < self.values.len() + channels {
            self.values.reserve_exact(channels + self.values.len() / 8);
        }
        for ((bone, joint), numbers) in
            self.skeleton.bones.iter().zip(&self.joints).zip(&frame.numbers)
        {
            let numbers = numbers.as_deref().unwrap_or_default();
            self.skeleton.put(bone, joint.offset, numbers, self.in_radians, &mut self.values);
        }
        self.poses += 1;
        Ok(())
    }

    /// Bytes that poses may take.
    const fn most_bytes(&self) -> u64 {
        self.bytes / 4 * 7 + SPARE_BYTES
    }

    /// The first bone that should be in a frame and is not.
    fn lacking(&self, frame: &Frame) -> Option<&str> {
        let bones = self.skeleton.bones.iter().zip(&frame.numbers);
        let mut lacking =
            bones.filter(|(bone, numbers)| numbers.is_none() && !bone.freedoms.is_empty());
        lacking.next().map(|(bone, _)| bone.name.as_str())
    }

    fn finish<R: Read>(
        mut self,
        source: &Source<R>,
        rate_hz: Option<f64>,
    ) -> Result<(Bvh, Vec<String>), Error> {
        let mut notes = self.skeleton.notes.clone();
        // A file may be cut off in its last frame, and nothing in it says how many there were.
        let is_cut = self.frame.as_ref().is_some_and(|frame| self.lacking(frame).is_some());
        if is_cut && self.poses > 0 {
            let last = self.frame.take().map_or(0, |frame| frame.number);
            notes.push(format!(
                "frame {last}, the last, is not whole and left out: the file is cut off"
            ));
        }
        self.close_frame(source.consumed())?;
        if self.poses == 0 {
            return Err(Error::of(ErrorKind::Malformed, "there is no frame in the file")
                .allowed("frames, each with its number and a line per bone"));
        }
        if self.jumps > 0 {
            notes.push(format!(
                "the number of a frame does not follow the one before, {}: taken as if it did",
                counted(self.jumps, "time")
            ));
        }
        let said_hz = self.said_hz.filter(|rate| RATES_HZ.contains(rate));
        let (rate_hz, from) = match (rate_hz, said_hz) {
            (Some(rate), _) => (rate, "as asked for"),
            (None, Some(rate)) => (rate, "as the file says"),
            (None, None) => (USUAL_HZ, "which the file does not say: taken as usual"),
        };
        notes.push(format!("rate: {rate_hz} Hz, {from}"));
        Ok((Bvh { joints: self.joints, time_step_s: 1.0 / rate_hz, values: self.values }, notes))
    }
}
