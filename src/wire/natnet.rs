//! NatNet: what Motive (OptiTrack) streams over UDP. Little-endian.
//!
//! `id(2) length(2) payload`; a server answers at its command port, and streams frames to a multicast group or to whoever
//! connected. What stands in a frame depends on the version that the server tells, so nothing but that is read without it. From
//! 4.1 on each section tells its size, and what a newer 4 adds behind the entries that are known is passed over.
//!
//! Sources: Motive's documentation, "NatNet: Data Types" and "NatNet: Bitstream Syntax" (docs.optitrack.com, NatNet SDK), for the
//! meaning; for the order of fields by version the crates natnet 0.1.0 (MIT or Apache-2.0) and natnet-decode 0.1.0 (MIT), and
//! mje-nz/python_natnet (BSD-3-Clause). Packets of these are in `tests/natnet/packets.hex`.
//!
//! Not done: places, markers, force plates, devices, cameras. They are passed over.

use super::Reason;

/// Where a server is asked unless it was set up otherwise.
pub const COMMAND_PORT: u16 = 1510;

const CONNECT: u16 = 0;
const SERVER_INFO: u16 = 1;
const REQUEST_MODELS: u16 = 4;
const MODELS: u16 = 5;
const FRAME: u16 = 7;
const DISCONNECT: u16 = 9;
const KEEP_ALIVE: u16 = 10;
/// Length of a program's name, and of any other that is kept.
const NAME_BYTES: usize = 256;
/// A name, the program's version and the protocol's.
const SENDER_BYTES: usize = NAME_BYTES + 8;
/// A sender; whether it takes only what it subscribed to, the version it asks for (0: the server's own), and a zero.
const CONNECT_BYTES: usize = SENDER_BYTES + 6;

/// Version of the protocol.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Version {
    /// The first number.
    pub major: u8,
    /// The second.
    pub minor: u8,
}

impl Version {
    /// The oldest that says whether a body is tracked.
    pub const OLDEST: Self = Self { major: 2, minor: 6 };
    /// The newest whose layout is known; a newer 4 is read by the sizes it tells.
    pub const NEWEST: Self = Self { major: 4, minor: 2 };

    /// True if its frames can be read.
    #[must_use]
    pub fn is_read(self) -> bool {
        self >= Self::OLDEST && self.major <= Self::NEWEST.major
    }

    fn from(self, major: u8, minor: u8) -> bool {
        self >= Self { major, minor }
    }
}

impl std::fmt::Display for Version {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}.{}", self.major, self.minor)
    }
}

/// What a server says.
#[derive(Clone, Debug, PartialEq)]
pub enum Message {
    /// Who it is.
    Server(Server),
    /// What it streams.
    Models(Vec<Model>),
    /// A frame.
    Frame(Frame),
    /// Anything else, or what cannot be read before its version is known.
    Other(u16),
}

/// A server.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Server {
    /// Version of its frames.
    pub version: Version,
    /// Ticks of its clock in a second; 0: it does not say (before 3.0).
    pub ticks_per_s: u64,
    /// Where it streams to; `None`: it does not say (before 3.0).
    pub data: Option<Data>,
}

/// Where frames go.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Data {
    /// The port.
    pub port: u16,
    /// The multicast group; `None`: to whoever connected.
    pub group: Option<[u8; 4]>,
}

/// What of a frame a body is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Part {
    /// A rigid body.
    Body(i32),
    /// A bone of a skeleton: both numbers.
    Bone(i32, i32),
    /// A body of an asset: both numbers.
    OfAsset(i32, i32),
}

/// The name of a part.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Model {
    /// Which.
    pub part: Part,
    /// Name of the skeleton or asset that it belongs to.
    pub owner: Option<String>,
    /// Its own name.
    pub name: String,
}

/// A frame, as far as it is read.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// Its number.
    pub number: u32,
    /// All bodies in it.
    pub bodies: Vec<Body>,
    /// Seconds on the server's clock.
    pub time_s: f64,
    /// When the cameras' shutters were half through, in ticks of the server's clock; 0: it does not say.
    pub exposed_ticks: u64,
    /// What is streamed is not what it was.
    pub models_changed: bool,
}

/// A body in a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Body {
    /// Which.
    pub part: Part,
    /// Orientation w, x, y, z; one, as sent.
    pub quaternion: [f64; 4],
    /// True if the cameras see it: else its orientation is an old one.
    pub is_tracked: bool,
}

/// Reads a datagram. Without a version, nothing but the message that tells it.
///
/// # Errors
/// [`Reason::Interrupted`] if something ends before it should, [`Reason::Malformed`] for a number of things below zero, and
/// for a description of a kind that has no known length.
pub fn decode(datagram: &[u8], version: Option<Version>) -> Result<Message, Reason> {
    let mut rest = datagram;
    let id = u16::from_le_bytes(take(&mut rest)?);
    // Some servers tell a length that is not that of the payload; the datagram's own is right.
    let _length = take::<2>(&mut rest)?;
    Ok(match (id, version) {
        (SERVER_INFO, _) => Message::Server(server(rest)?),
        (MODELS, Some(version)) => Message::Models(models(rest, version)?),
        (FRAME, Some(version)) => Message::Frame(frame(rest, version)?),
        _ => Message::Other(id),
    })
}

/// Asks a server who it is and, if it streams to single hosts, to stream here.
#[must_use]
pub fn connect() -> [u8; 4 + CONNECT_BYTES] {
    let mut packet = [0; 4 + CONNECT_BYTES];
    packet[..2].copy_from_slice(&CONNECT.to_le_bytes());
    packet[2..4].copy_from_slice(&(CONNECT_BYTES as u16).to_le_bytes());
    let name = b"gaitway";
    packet[4..4 + name.len()].copy_from_slice(name);
    packet
}

/// Asks a server what it streams.
#[must_use]
pub const fn request_models() -> [u8; 4] {
    empty(REQUEST_MODELS)
}

/// Says that somebody still listens.
#[must_use]
pub const fn keep_alive() -> [u8; 4] {
    empty(KEEP_ALIVE)
}

/// Says that nobody listens any more.
#[must_use]
pub const fn disconnect() -> [u8; 4] {
    empty(DISCONNECT)
}

const fn empty(id: u16) -> [u8; 4] {
    let [low, high] = id.to_le_bytes();
    [low, high, 0, 0]
}

fn server(mut rest: &[u8]) -> Result<Server, Reason> {
    part(&mut rest, NAME_BYTES + 4)?;
    let [major, minor, ..] = take::<4>(&mut rest)?;
    let version = Version { major, minor };
    if !version.from(3, 0) {
        return Ok(Server { version, ticks_per_s: 0, data: None });
    }
    let ticks_per_s = u64::from_le_bytes(take(&mut rest)?);
    let port = u16::from_le_bytes(take(&mut rest)?);
    let [is_multicast] = take(&mut rest)?;
    let group = take(&mut rest)?;
    let data = Some(Data { port, group: (is_multicast != 0).then_some(group) });
    Ok(Server { version, ticks_per_s, data })
}

/// A frame's sections, in their order.
fn frame(mut rest: &[u8], version: Version) -> Result<Frame, Reason> {
    let rest = &mut rest;
    let number = u32::from_le_bytes(take(rest)?);
    let mut bodies = Vec::new();
    // Sets of markers, and markers by themselves.
    pass(rest, version, |rest| text(rest).and_then(|_| each(rest, |rest| skip(rest, 12))))?;
    pass(rest, version, |rest| skip(rest, 12))?;
    section(rest, version, |rest| {
        bodies.push(body(rest, version, Part::Body)?);
        Ok(())
    })?;
    section(rest, version, |rest| {
        let skeleton = number_of(rest)?;
        each(rest, |rest| {
            bodies.push(body(rest, version, |id| bone(skeleton, id))?);
            Ok(())
        })
    })?;
    let labelled = labelled_bytes(version);
    if version.from(4, 1) {
        section(rest, version, |rest| {
            let asset = number_of(rest)?;
            each(rest, |rest| {
                bodies.push(body(rest, version, |id| of_asset(asset, id))?);
                Ok(())
            })?;
            each(rest, |rest| skip(rest, labelled))
        })?;
    }
    pass(rest, version, |rest| skip(rest, labelled))?;
    // Force plates, and other devices: channels of samples.
    for since_minor in [9, 11] {
        if version.from(2, since_minor) {
            pass(rest, version, channels)?;
        }
    }
    if !version.from(3, 0) {
        // A latency, which 3.0 tells by its ticks.
        skip(rest, 4)?;
    }
    // Time code.
    skip(rest, 8)?;
    let time_s = match version.from(2, 7) {
        true => f64::from_le_bytes(take(rest)?),
        false => f64::from(f32::from_le_bytes(take(rest)?)),
    };
    let mut exposed_ticks = 0;
    if version.from(3, 0) {
        exposed_ticks = u64::from_le_bytes(take(rest)?);
        // Received by the server, and sent.
        skip(rest, 16)?;
    }
    if version.from(4, 1) {
        // Precision time protocol: seconds and parts of one.
        skip(rest, 8)?;
    }
    let flags = u16::from_le_bytes(take(rest)?);
    Ok(Frame { number, bodies, time_s, exposed_ticks, models_changed: flags & 2 != 0 })
}

fn body(
    rest: &mut &[u8],
    version: Version,
    part: impl FnOnce(i32) -> Part,
) -> Result<Body, Reason> {
    let part = part(number_of(rest)?);
    // Where it is.
    skip(rest, 12)?;
    let [x, y, z, w] = floats(rest)?;
    if !version.from(3, 0) {
        // Its markers: places, numbers and sizes.
        let count = count(rest)?;
        skip(rest, count.saturating_mul(12 + 4 + 4))?;
    }
    // Mean error of its markers.
    skip(rest, 4)?;
    let flags = u16::from_le_bytes(take(rest)?);
    Ok(Body { part, quaternion: [w, x, y, z], is_tracked: flags & 1 != 0 })
}

/// In frames the number of a bone has that of its skeleton in its upper half; in descriptions it may.
const fn bone(skeleton: i32, id: i32) -> Part {
    Part::Bone(skeleton, id & 0xFFFF)
}

/// Likewise.
const fn of_asset(asset: i32, id: i32) -> Part {
    Part::OfAsset(asset, id & 0xFFFF)
}

/// Length of a labelled marker: number, place, size, flags and, since 3.0, a residual.
fn labelled_bytes(version: Version) -> usize {
    if version.from(3, 0) { 26 } else { 22 }
}

fn channels(rest: &mut &[u8]) -> Result<(), Reason> {
    number_of(rest)?;
    each(rest, |rest| each(rest, |rest| skip(rest, 4)))
}

/// Descriptions of what is streamed.
fn models(mut rest: &[u8], version: Version) -> Result<Vec<Model>, Reason> {
    let rest = &mut rest;
    let mut found = Vec::new();
    each(rest, |rest| {
        let kind = number_of(rest)?;
        if version.from(4, 1) {
            let size = count(rest)?;
            let mut inside = part(rest, size)?;
            return match kind {
                1 | 2 | 6 => description(kind, &mut inside, version, &mut found),
                // Its size is told.
                _ => Ok(()),
            };
        }
        description(kind, rest, version, &mut found)
    })?;
    Ok(found)
}

fn description(
    kind: i32,
    rest: &mut &[u8],
    version: Version,
    found: &mut Vec<Model>,
) -> Result<(), Reason> {
    match kind {
        // Markers and their names.
        0 => text(rest).and_then(|_| each(rest, |rest| text(rest).map(drop))),
        1 => {
            let (name, id) = described(rest, version)?;
            found.push(Model { part: Part::Body(id), owner: None, name });
            Ok(())
        }
        2 => {
            let (owner, skeleton) = (text(rest)?, number_of(rest)?);
            each(rest, |rest| {
                let (name, id) = described(rest, version)?;
                found.push(Model { part: bone(skeleton, id), owner: Some(owner.clone()), name });
                Ok(())
            })
        }
        3 => {
            // A force plate: number, serial number, size, origin, calibration, corners, two kinds, channels.
            number_of(rest)?;
            text(rest)?;
            skip(rest, 4 * (2 + 3 + 144 + 12 + 2))?;
            each(rest, |rest| text(rest).map(drop))
        }
        4 => {
            // A device: number, name, serial number, two kinds, channels.
            number_of(rest)?;
            text(rest)?;
            text(rest)?;
            skip(rest, 8)?;
            each(rest, |rest| text(rest).map(drop))
        }
        // A camera: where it is and looks.
        5 => text(rest).and_then(|_| skip(rest, 12 + 16)),
        6 => {
            let owner = text(rest)?;
            let _kind = number_of(rest)?;
            let asset = number_of(rest)?;
            each(rest, |rest| {
                let (name, id) = described(rest, version)?;
                found.push(Model { part: of_asset(asset, id), owner: Some(owner.clone()), name });
                Ok(())
            })?;
            // Markers: name, number, place, size, flags.
            each(rest, |rest| text(rest).and_then(|_| skip(rest, 4 + 12 + 4 + 2)))
        }
        _ => Err(Reason::Malformed),
    }
}

/// Name and number of a body that is described.
fn described(rest: &mut &[u8], version: Version) -> Result<(String, i32), Reason> {
    let (name, id) = (text(rest)?, number_of(rest)?);
    // Its parent, and where it is on that.
    skip(rest, 4 + 12)?;
    if version.from(4, 2) {
        // And how it is turned there.
        skip(rest, 16)?;
    }
    if version.from(3, 0) {
        // Markers: their places, their labels and, since 4.0, their names.
        let markers = count(rest)?;
        skip(rest, markers.saturating_mul(12 + 4))?;
        if version.from(4, 0) {
            (0..markers).try_for_each(|_| text(rest).map(drop))?;
        }
    }
    Ok((name, id))
}

/// A number of things, then each of them. Each takes a byte at least, or fails.
fn each<'a>(
    rest: &mut &'a [u8],
    mut thing: impl FnMut(&mut &'a [u8]) -> Result<(), Reason>,
) -> Result<(), Reason> {
    let count = count(rest)?;
    (0..count).try_for_each(|_| thing(rest))
}

/// A section of a frame: since 4.1 with its size, so that it ends where it should however long its entries are.
fn section<'a>(
    rest: &mut &'a [u8],
    version: Version,
    mut entry: impl FnMut(&mut &'a [u8]) -> Result<(), Reason>,
) -> Result<(), Reason> {
    if !version.from(4, 1) {
        return each(rest, entry);
    }
    let (entries, size) = (count(rest)?, count(rest)?);
    let mut inside = part(rest, size)?;
    (0..entries).try_for_each(|_| entry(&mut inside))
}

/// Passes over a section, by its size if that is told.
fn pass<'a>(
    rest: &mut &'a [u8],
    version: Version,
    entry: impl FnMut(&mut &'a [u8]) -> Result<(), Reason>,
) -> Result<(), Reason> {
    if !version.from(4, 1) {
        return each(rest, entry);
    }
    let (_, size) = (count(rest)?, count(rest)?);
    skip(rest, size)
}

fn take<const N: usize>(rest: &mut &[u8]) -> Result<[u8; N], Reason> {
    let interrupted = Reason::Interrupted { claimed: N, available: rest.len() };
    let (bytes, after) = rest.split_first_chunk().ok_or(interrupted)?;
    *rest = after;
    Ok(*bytes)
}

fn part<'a>(rest: &mut &'a [u8], length: usize) -> Result<&'a [u8], Reason> {
    let interrupted = Reason::Interrupted { claimed: length, available: rest.len() };
    let (bytes, after) = rest.split_at_checked(length).ok_or(interrupted)?;
    *rest = after;
    Ok(bytes)
}

fn skip(rest: &mut &[u8], length: usize) -> Result<(), Reason> {
    part(rest, length).map(drop)
}

fn number_of(rest: &mut &[u8]) -> Result<i32, Reason> {
    Ok(i32::from_le_bytes(take(rest)?))
}

fn count(rest: &mut &[u8]) -> Result<usize, Reason> {
    usize::try_from(number_of(rest)?).map_err(|_| Reason::Malformed)
}

fn text(rest: &mut &[u8]) -> Result<String, Reason> {
    let interrupted = Reason::Interrupted { claimed: rest.len() + 1, available: rest.len() };
    let end = rest.iter().position(|&byte| byte == 0).ok_or(interrupted)?;
    let bytes = part(rest, end)?;
    skip(rest, 1)?;
    Ok(String::from_utf8_lossy(&bytes[..bytes.len().min(NAME_BYTES)]).into_owned())
}

fn floats<const N: usize>(rest: &mut &[u8]) -> Result<[f64; N], Reason> {
    let mut out = [0.0; N];
    for out in &mut out {
        *out = f64::from(f32::from_le_bytes(take(rest)?));
    }
    Ok(out)
}
