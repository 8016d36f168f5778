//! Biovision hierarchy files (BVH): reading within stated bounds, and writing.
//!
//! The format is described in Meredith & Maddock, "Motion Capture File Formats Explained"
//! (University of Sheffield, CS-01-11). What the numbers mean (unit, axes, which position channels
//! count) is not in the file; [`crate::mocap::skeleton`] and [`crate::mocap::clip`] find it out.
//!
//! Accepted beyond the letter of that text, because real files need it: any channel order and
//! count per joint, rotations before positions, CRLF or tabs, numbers such as `.5` and `1e-5`,
//! joint names with blanks, leaves without `End Site`, keywords in any case, several roots.

use crate::error::{Error, ErrorKind, counted};
use crate::mocap::opened::{opened, with_a_point};
use glam::DVec3;
use std::fmt::Write as _;
use std::io::Read;
use std::path::Path;

pub(in crate::mocap) mod source;
use source::Source;

/// Largest header of a file whose joints alone are read, bytes.
const MAX_HEADER_BYTES: u64 = 1 << 20;
/// Largest file read, bytes.
pub const MAX_FILE_BYTES: u64 = 256 << 20;
/// Most joints in a hierarchy.
pub const MAX_JOINTS: usize = 512;
/// Deepest nesting of joints.
pub const MAX_DEPTH: usize = 64;
/// Most poses in a file.
pub const MAX_POSES: usize = 2_000_000;
/// Most channels of one joint: two sets of position and rotation.
const MAX_CHANNELS: usize = 12;
/// Largest magnitude of a number; beyond it the file is damaged, and squares stay finite.
const MAX_MAGNITUDE: f64 = 1e9;

/// An axis of a joint's frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[allow(missing_docs)]
pub enum Axis {
    X,
    Y,
    Z,
}

impl Axis {
    /// The axis as a unit vector.
    #[must_use]
    pub const fn unit(self) -> DVec3 {
        match self {
            Self::X => DVec3::X,
            Self::Y => DVec3::Y,
            Self::Z => DVec3::Z,
        }
    }
}

/// What one number of a pose means.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Channel {
    /// A coordinate in the file's unit of length.
    Position(Axis),
    /// A rotation about an axis, degrees; applied in the order the joint lists them, each about
    /// the axis as turned by those before (intrinsic).
    Rotation(Axis),
}

impl Channel {
    const ALL: [(Self, &str); 6] = [
        (Self::Position(Axis::X), "Xposition"),
        (Self::Position(Axis::Y), "Yposition"),
        (Self::Position(Axis::Z), "Zposition"),
        (Self::Rotation(Axis::X), "Xrotation"),
        (Self::Rotation(Axis::Y), "Yrotation"),
        (Self::Rotation(Axis::Z), "Zrotation"),
    ];

    /// The keyword in the file.
    #[must_use]
    pub fn keyword(self) -> &'static str {
        Self::ALL.iter().find(|(channel, _)| *channel == self).map_or("", |(_, word)| word)
    }
}

/// One joint of the hierarchy.
#[derive(Clone, Debug, PartialEq)]
pub struct Joint {
    /// Name as written in the file.
    pub name: String,
    /// Index of the parent; always smaller than the joint's own. Roots have none.
    pub parent: Option<usize>,
    /// `OFFSET` from the parent, file units, parent's frame.
    pub offset: DVec3,
    /// Channels in file order.
    pub channels: Vec<Channel>,
    /// Index of the joint's first value in a pose.
    pub first_channel: usize,
    /// `End Site` offsets, file units, joint's frame.
    pub ends: Vec<DVec3>,
}

/// A BVH file as it stands: nothing interpreted.
#[derive(Clone, Debug, PartialEq)]
pub struct Bvh {
    /// Joints in file order, parents before children.
    pub joints: Vec<Joint>,
    /// Time from pose to pose, s; positive.
    pub time_step_s: f64,
    /// All poses, one after the other; degrees and file units; finite.
    pub values: Vec<f64>,
}

impl Bvh {
    /// Numbers per pose.
    #[must_use]
    pub fn channel_count(&self) -> usize {
        self.joints.last().map_or(0, |joint| joint.first_channel + joint.channels.len())
    }

    /// Number of poses.
    #[must_use]
    pub fn pose_count(&self) -> usize {
        self.values.len().checked_div(self.channel_count()).unwrap_or(0)
    }

    /// The numbers of one pose. `index` must be below [`Self::pose_count`].
    #[must_use]
    pub fn pose(&self, index: usize) -> &[f64] {
        let count = self.channel_count();
        &self.values[index * count..(index + 1) * count]
    }
}

/// Reads a file. Memory stays below four times the file's size plus 16 MiB: the text is streamed,
/// and a number takes eight bytes where the text has at least two.
///
/// # Errors
/// If the file cannot be read, breaks the format or exceeds a bound; the message names the line.
pub fn read(path: &Path) -> Result<Bvh, Error> {
    let (file, known) = opened(path)?;
    parse_stream(file, known.len()).map_err(|error| error.in_file(path))
}

/// Reads the joints of a file and leaves its poses.
///
/// # Errors
/// If the file cannot be read, or its header breaks the format or exceeds a bound.
pub fn read_joints(path: &Path) -> Result<Vec<Joint>, Error> {
    let (file, _) = opened(path)?;
    hierarchy(&mut Source::new(file.take(MAX_HEADER_BYTES))).map_err(|error| error.in_file(path))
}

/// Reads from memory.
///
/// # Errors
/// As [`read`].
pub fn parse(text: &[u8]) -> Result<Bvh, Error> {
    parse_stream(text, text.len() as u64)
}

fn parse_stream(stream: impl Read, bytes: u64) -> Result<Bvh, Error> {
    if bytes > MAX_FILE_BYTES {
        return Err(Error::of(ErrorKind::Malformed, "the file is too large")
            .got(counted(bytes, "byte"))
            .allowed(format!("at most {MAX_FILE_BYTES} bytes"))
            .remedy("cut the recording into shorter files"));
    }
    let mut source = Source::new(stream);
    let joints = hierarchy(&mut source)?;
    let (poses, time_step_s) = motion_header(&mut source)?;
    let mut bvh = Bvh { joints, time_step_s, values: Vec::new() };
    if bvh.channel_count() == 0 {
        return Err(Error::new("no joint has a channel, so nothing can move"));
    }
    // A number takes two bytes at least, one of them a blank: never reserve for poses that the
    // file cannot hold, whatever it claims.
    let room = (bytes.saturating_sub(source.consumed()) / 2 + 1) as usize;
    bvh.values.reserve_exact(room.min(poses * bvh.channel_count()));
    motion(&mut source, &mut bvh, poses)?;
    Ok(bvh)
}

/// A joint whose closing brace has not come yet.
struct Open {
    joint: usize,
    offset_seen: bool,
    channels_seen: bool,
}

fn hierarchy<R: Read>(source: &mut Source<R>) -> Result<Vec<Joint>, Error> {
    source.keyword("HIERARCHY")?;
    let mut joints: Vec<Joint> = Vec::new();
    let mut open: Vec<Open> = Vec::new();
    loop {
        source.next_in_header()?;
        let word = source.token().to_ascii_uppercase();
        let count = joints.len();
        match (word.as_slice(), open.last_mut()) {
            (b"ROOT", None) | (b"JOINT", Some(_)) => {
                let parent = open.last().map(|open| open.joint);
                joints.push(joint_opening(source, &joints, parent)?);
                open.push(Open { joint: count, offset_seen: false, channels_seen: false });
                if open.len() > MAX_DEPTH {
                    return Err(source
                        .error("the hierarchy is too deep")
                        .allowed(format!("at most {MAX_DEPTH} joints above one another")));
                }
            }
            (b"MOTION", None) if count > 0 => return Ok(joints),
            (_, None) => return Err(source.unexpected("ROOT or MOTION")),
            (word, Some(innermost)) => {
                if joint_line(source, word, &mut joints, innermost)? {
                    open.pop();
                }
            }
        }
    }
}

/// Reads one entry of an open joint; true if it was its closing brace.
fn joint_line<R: Read>(
    source: &mut Source<R>,
    word: &[u8],
    joints: &mut [Joint],
    open: &mut Open,
) -> Result<bool, Error> {
    let has_children = open.joint + 1 < joints.len();
    let joint = &mut joints[open.joint];
    match word {
        b"OFFSET" => {
            joint.offset = offset(source, &joint.name)?;
            open.offset_seen = true;
        }
        b"CHANNELS" if open.channels_seen || has_children => {
            return Err(source
                .error("CHANNELS come twice, or after a child joint")
                .at(source.place_in(&joint.name)));
        }
        b"CHANNELS" => {
            joint.channels = channels(source, &joint.name)?;
            open.channels_seen = true;
        }
        b"END" => joint.ends.push(end_site(source, &joint.name)?),
        b"}" if open.offset_seen => return Ok(true),
        b"}" => {
            return Err(source
                .error("a joint has no OFFSET")
                .at(source.place_in(&joint.name))
                .remedy("give every joint an OFFSET line"));
        }
        _ => {
            let allowed = "JOINT, OFFSET, CHANNELS, End Site or }";
            return Err(source.unexpected(allowed).at(source.place_in(&joint.name)));
        }
    }
    Ok(false)
}

fn joint_opening<R: Read>(
    source: &mut Source<R>,
    joints: &[Joint],
    parent: Option<usize>,
) -> Result<Joint, Error> {
    if joints.len() == MAX_JOINTS {
        return Err(source
            .error("too many joints")
            .allowed(format!("at most {MAX_JOINTS}"))
            .remedy("export without finger or helper joints"));
    }
    let name = source.rest_of_line()?;
    let (name, opened) = match name.strip_suffix('{') {
        Some(name) => (name.trim_end().to_owned(), true),
        None => (name, false),
    };
    if name.is_empty() {
        return Err(source.error("a joint has no name"));
    }
    if !opened {
        source.keyword("{")?;
    }
    let first_channel = joints.last().map_or(0, |last| last.first_channel + last.channels.len());
    Ok(Joint {
        name,
        parent,
        offset: DVec3::ZERO,
        channels: Vec::new(),
        first_channel,
        ends: Vec::new(),
    })
}

fn offset<R: Read>(source: &mut Source<R>, joint: &str) -> Result<DVec3, Error> {
    let mut numbers = [0.0; 3];
    for number in &mut numbers {
        source.next_in_header()?;
        *number = number_of(source).map_err(|error| error.at(source.place_in(joint)))?;
    }
    Ok(DVec3::from_array(numbers))
}

fn channels<R: Read>(source: &mut Source<R>, joint: &str) -> Result<Vec<Channel>, Error> {
    source.next_in_header()?;
    let count = str::from_utf8(source.token())
        .ok()
        .and_then(|text| text.parse::<usize>().ok())
        .filter(|count| *count <= MAX_CHANNELS);
    let Some(count) = count else {
        return Err(source
            .unexpected(&format!("a count from 0 to {MAX_CHANNELS}"))
            .at(source.place_in(joint)));
    };
    let mut channels = Vec::with_capacity(count);
    for _ in 0..count {
        source.next_in_header()?;
        let word = source.token();
        let found =
            Channel::ALL.iter().find(|(_, name)| word.eq_ignore_ascii_case(name.as_bytes()));
        let Some((channel, name)) = found else {
            let allowed = "Xposition, Yposition, Zposition, Xrotation, Yrotation or Zrotation";
            return Err(source.unexpected(allowed).at(source.place_in(joint)));
        };
        if matches!(channel, Channel::Position(_)) && channels.contains(channel) {
            return Err(source
                .error(format!("channel {name} is listed twice"))
                .at(source.place_in(joint)));
        }
        channels.push(*channel);
    }
    Ok(channels)
}

fn end_site<R: Read>(source: &mut Source<R>, joint: &str) -> Result<DVec3, Error> {
    let name = source.rest_of_line()?;
    if !name.ends_with('{') {
        source.keyword("{")?;
    }
    source.keyword("OFFSET")?;
    let end = offset(source, joint)?;
    source.keyword("}")?;
    Ok(end)
}

fn motion_header<R: Read>(source: &mut Source<R>) -> Result<(usize, f64), Error> {
    let poses = source.labelled("Frames")?;
    // Some exporters write the count as a float; a whole number is what counts.
    let count = poses.parse::<f64>().ok();
    let count = count.filter(|n| n.fract() == 0.0 && *n >= 1.0 && *n <= MAX_POSES as f64);
    let Some(count) = count else {
        let error = source.error("the number of poses is not usable").got(poses);
        return Err(error.allowed(format!("a whole number from 1 to {MAX_POSES}")));
    };
    let step = source.labelled("Frame Time")?;
    let step_s = step.parse::<f64>().ok().filter(|step_s| (1e-5..=10.0).contains(step_s));
    let Some(step_s) = step_s else {
        let error = source.error("the frame time is not usable").got(step);
        return Err(error.allowed("0.00001 to 10 s"));
    };
    Ok((count as usize, step_s))
}

fn motion<R: Read>(source: &mut Source<R>, bvh: &mut Bvh, poses: usize) -> Result<(), Error> {
    let names: Vec<(usize, Channel)> = bvh
        .joints
        .iter()
        .enumerate()
        .flat_map(|(at, joint)| joint.channels.iter().map(move |channel| (at, *channel)))
        .collect();
    let mut last_line = 0;
    for pose in 0..poses {
        for (at, (joint, channel)) in names.iter().enumerate() {
            if !source.next()? {
                return Err(missing_poses(source, poses, pose, at, names.len()));
            }
            // A value lost in one line would shift all that follow; the line ends catch it.
            if at == 0 && source.token_line() == last_line {
                return Err(wrong_length(source, pose, names.len()));
            }
            last_line = source.token_line();
            let value = number_of(source).map_err(|error| {
                error.at(format!(
                    "line {}, pose {}, joint {}, {}",
                    source.token_line(),
                    pose + 1,
                    bvh.joints[*joint].name,
                    channel.keyword()
                ))
            })?;
            bvh.values.push(value);
        }
    }
    if source.next()? {
        if source.token_line() == last_line {
            return Err(wrong_length(source, poses, names.len()));
        }
        return Err(source
            .error("the file goes on after its last pose")
            .got(format!(
                "more than the {poses} that Frames claims",
                poses = counted(poses, "pose")
            ))
            .remedy("correct the Frames line"));
    }
    Ok(())
}

fn missing_poses<R: Read>(
    source: &Source<R>,
    claimed: usize,
    found: usize,
    values: usize,
    needed: usize,
) -> Error {
    let mut got = counted(found, "whole pose");
    if values > 0 {
        let _ =
            write!(got, " and {values} of {needed} of the next", needed = counted(needed, "value"));
    }
    source
        .error(format!(
            "the file ends early: it claims {claimed} and holds {found}",
            claimed = counted(claimed, "pose")
        ))
        .got(got)
        .allowed(format!(
            "{claimed} of {needed}",
            needed = counted(needed, "value"),
            claimed = counted(claimed, "pose")
        ))
        .remedy("copy the file again, or correct the Frames line if the rest is not needed")
}

fn wrong_length<R: Read>(source: &Source<R>, pose: usize, needed: usize) -> Error {
    source
        .error("a line of the motion has not one value per channel")
        .got(format!("pose {pose} ends in the middle of a line"))
        .allowed(format!(
            "{needed} per pose, each pose on a line of its own",
            needed = counted(needed, "value")
        ))
        .remedy("a value is missing or too many in this line or above it: export the file again")
}

/// The current token as a finite number.
fn number_of<R: Read>(source: &Source<R>) -> Result<f64, Error> {
    let number = str::from_utf8(source.token()).ok().and_then(|text| text.parse::<f64>().ok());
    match number {
        Some(number) if number.abs() <= MAX_MAGNITUDE => Ok(number),
        _ => {
            let text = String::from_utf8_lossy(source.token()).into_owned();
            let allowed = format!("a finite number, magnitude at most {MAX_MAGNITUDE}");
            Err(with_a_point(source.unexpected(&allowed), &text))
        }
    }
}

/// The file text of a hierarchy and its poses. Numbers are the shortest that read back equal.
#[must_use]
pub fn write(bvh: &Bvh) -> String {
    let mut text = String::with_capacity(64 * bvh.joints.len() + 8 * bvh.values.len());
    text.push_str("HIERARCHY\n");
    for (at, joint) in bvh.joints.iter().enumerate() {
        if joint.parent.is_none() {
            write_joint(bvh, at, 0, &mut text);
        }
    }
    let _ = writeln!(text, "MOTION\nFrames: {}", bvh.pose_count());
    let _ = writeln!(text, "Frame Time: {}", bvh.time_step_s);
    for pose in 0..bvh.pose_count() {
        for (at, value) in bvh.pose(pose).iter().enumerate() {
            let _ = write!(text, "{}{value}", if at == 0 { "" } else { " " });
        }
        text.push('\n');
    }
    text
}

fn write_joint(bvh: &Bvh, at: usize, depth: usize, text: &mut String) {
    let joint = &bvh.joints[at];
    let indent = "  ".repeat(depth);
    let inner = "  ".repeat(depth + 1);
    let kind = if depth == 0 { "ROOT" } else { "JOINT" };
    let DVec3 { x, y, z } = joint.offset;
    let _ = writeln!(text, "{indent}{kind} {}\n{indent}{{", joint.name);
    let _ = writeln!(text, "{inner}OFFSET {x} {y} {z}");
    let _ = write!(text, "{inner}CHANNELS {}", joint.channels.len());
    for channel in &joint.channels {
        let _ = write!(text, " {}", channel.keyword());
    }
    text.push('\n');
    for DVec3 { x, y, z } in &joint.ends {
        let _ = writeln!(text, "{inner}End Site\n{inner}{{\n{inner}  OFFSET {x} {y} {z}");
        let _ = writeln!(text, "{inner}}}");
    }
    for child in at + 1..bvh.joints.len() {
        if bvh.joints[child].parent == Some(at) {
            write_joint(bvh, child, depth + 1, text);
        }
    }
    let _ = writeln!(text, "{indent}}}");
}
