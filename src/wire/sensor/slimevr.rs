//! SlimeVR trackers over UDP: one datagram holds one packet or a bundle. Big-endian.
//!
//! `id(4) number(8) payload`. Trackers send their own fused orientation; there is no device time in
//! any packet, and the packet number is the only thing that shows a loss.
//!
//! Source: SlimeVR/SlimeVR-Server at 5549763, `server/core/src/main/java/dev/slimevr/tracking/
//! trackers/udp/`. Orientations are those of the sensor (Z up, heading arbitrary); the server's
//! own world is another. Acceleration is without gravity there.
//!
//! Not done: flex data, glove data, firmware updates.

use crate::wire::Reason;

/// The port trackers look for their server at.
pub const PORT: u16 = 6969;
/// Bundles hold packets, not bundles.
const BUNDLE: u32 = 100;
const SHORT_BUNDLE: u32 = 101;

/// What a tracker says.
#[derive(Clone, Debug, PartialEq)]
pub enum Message {
    /// It looks for a server, or wants to be known again.
    Handshake {
        /// Firmware build; 0 if it does not say.
        build: u32,
        /// Network address of the tracker, its lasting name; zeros if it does not say.
        mac: [u8; 6],
    },
    /// It is there.
    Heartbeat,
    /// Echo of a ping with this number.
    Pong(u32),
    /// A sensor's orientation, w, x, y, z as sent.
    Rotation {
        /// Number of the sensor on the tracker.
        sensor: u8,
        /// Orientation; one, as sent.
        quaternion: [f64; 4],
    },
    /// A sensor's acceleration without gravity, m/s^2.
    Acceleration {
        /// Number of the sensor on the tracker.
        sensor: u8,
        /// X, y, z.
        acceleration: [f64; 3],
    },
    /// Both at once, in the compact form of newer firmware.
    Motion {
        /// Number of the sensor on the tracker.
        sensor: u8,
        /// As in [`Message::Rotation`].
        quaternion: [f64; 4],
        /// As in [`Message::Acceleration`].
        acceleration: [f64; 3],
    },
    /// State of a sensor; to be acknowledged.
    SensorInfo {
        /// Number of the sensor on the tracker.
        sensor: u8,
        /// 0 off, 1 working, 2 in error.
        status: u8,
    },
    /// Battery voltage, V, and level, 0 to 1.
    Battery(f64, f64),
    /// How strongly the tracker receives its network, dBm.
    Signal(i8),
    /// Temperature of a sensor, degrees Celsius.
    Temperature(u8, f64),
    /// The wearer asked for something: 2 full, 3 yaw, 4 mounting reset, 5 pause.
    UserAction(u8),
    /// A packet with an id that is not read here.
    Other(u32),
}

/// Reads a datagram and hands over the messages in it; the packet number.
///
/// # Errors
/// [`Reason::Length`] if a packet is cut short; what stood before it has been handed over.
pub fn decode(datagram: &[u8], mut found: impl FnMut(Message)) -> Result<u64, Reason> {
    let mut rest = datagram;
    let id = u32::from_be_bytes(take(&mut rest)?);
    let number = u64::from_be_bytes(take(&mut rest)?);
    match id {
        BUNDLE => {
            while !rest.is_empty() {
                let length = usize::from(u16::from_be_bytes(take(&mut rest)?));
                let mut packet = part(&mut rest, length)?;
                let id = u32::from_be_bytes(take(&mut packet)?);
                found(message(id, packet)?);
            }
        }
        SHORT_BUNDLE => {
            while !rest.is_empty() {
                let [length] = take(&mut rest)?;
                let mut packet = part(&mut rest, length.into())?;
                let [id] = take(&mut packet)?;
                found(message(id.into(), packet)?);
            }
        }
        _ => found(message(id, rest)?),
    }
    Ok(number)
}

/// The answer that makes this host the tracker's server.
#[must_use]
pub fn handshake_reply() -> [u8; 64] {
    let text = b"\x03Hey OVR =D 5";
    let mut reply = [0; 64];
    reply[..text.len()].copy_from_slice(text);
    reply
}

/// What a server says twice a second, so that the tracker does not look for another.
#[must_use]
pub fn heartbeat() -> [u8; 12] {
    header(1)
}

/// A ping; the tracker sends it back as it is.
#[must_use]
pub fn ping(number: u32) -> [u8; 16] {
    let mut packet = [0; 16];
    packet[..12].copy_from_slice(&header(10));
    packet[12..].copy_from_slice(&number.to_be_bytes());
    packet
}

/// The acknowledgement of [`Message::SensorInfo`]; it carries no packet number.
#[must_use]
pub const fn sensor_info_reply(sensor: u8, status: u8) -> [u8; 6] {
    [0, 0, 0, 15, sensor, status]
}

fn header(id: u32) -> [u8; 12] {
    let mut packet = [0; 12];
    packet[..4].copy_from_slice(&id.to_be_bytes());
    packet
}

fn message(id: u32, mut rest: &[u8]) -> Result<Message, Reason> {
    let rest = &mut rest;
    Ok(match id {
        0 | 1 => Message::Heartbeat,
        3 => handshake(rest),
        4 => {
            let acceleration = floats(rest)?;
            // Old firmware has one sensor and does not number it.
            Message::Acceleration { sensor: rest.first().copied().unwrap_or(0), acceleration }
        }
        10 => Message::Pong(u32::from_be_bytes(take(rest)?)),
        12 => {
            let [volts, level] = floats(rest)?;
            Message::Battery(volts, level)
        }
        15 => {
            let [sensor, status] = take(rest)?;
            Message::SensorInfo { sensor, status }
        }
        17 => {
            let [sensor, _kind] = take(rest)?;
            let [x, y, z, w] = floats(rest)?;
            Message::Rotation { sensor, quaternion: [w, x, y, z] }
        }
        19 => {
            // One radio serves all sensors of a tracker.
            let [_sensor, dbm] = take(rest)?;
            Message::Signal(i8::from_be_bytes([dbm]))
        }
        20 => {
            let [sensor] = take(rest)?;
            let [celsius] = floats(rest)?;
            Message::Temperature(sensor, celsius)
        }
        21 => {
            let [action] = take(rest)?;
            Message::UserAction(action)
        }
        23 => {
            let [sensor] = take(rest)?;
            let [x, y, z, w] = words(rest, 1.0 / 32_768.0)?;
            let acceleration = words(rest, 1.0 / 128.0)?;
            Message::Motion { sensor, quaternion: [w, x, y, z], acceleration }
        }
        _ => Message::Other(id),
    })
}

fn handshake(rest: &mut &[u8]) -> Message {
    // Board, IMU, processor, three words of IMU facts; firmware from long ago sends nothing.
    let build = part(rest, 24).and_then(|_| take(rest)).map_or(0, u32::from_be_bytes);
    let mac = take::<1>(rest)
        .and_then(|[length]| part(rest, length.into()))
        .and_then(|_version| take(rest))
        .unwrap_or_default();
    Message::Handshake { build, mac }
}

fn take<const N: usize>(rest: &mut &[u8]) -> Result<[u8; N], Reason> {
    let short = Reason::Length { claimed: rest.len(), least: N, most: N };
    let (bytes, after) = rest.split_first_chunk().ok_or(short)?;
    *rest = after;
    Ok(*bytes)
}

fn part<'a>(rest: &mut &'a [u8], length: usize) -> Result<&'a [u8], Reason> {
    let available = rest.len();
    let interrupted = Reason::Interrupted { claimed: length, available };
    let (bytes, after) = rest.split_at_checked(length).ok_or(interrupted)?;
    *rest = after;
    Ok(bytes)
}

fn floats<const N: usize>(rest: &mut &[u8]) -> Result<[f64; N], Reason> {
    let mut out = [0.0; N];
    for out in &mut out {
        *out = f64::from(f32::from_be_bytes(take(rest)?));
    }
    Ok(out)
}

/// Signed words that count in units of `scale`.
fn words<const N: usize>(rest: &mut &[u8], scale: f64) -> Result<[f64; N], Reason> {
    let mut out = [0.0; N];
    for out in &mut out {
        *out = f64::from(i16::from_be_bytes(take(rest)?)) * scale;
    }
    Ok(out)
}
