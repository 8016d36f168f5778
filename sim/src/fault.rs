//! What goes wrong, on purpose: scripted by time or by the number of a status, or drawn from the
//! seed.

pub(crate) mod plan;

use crate::adapter::Usb;
use crate::can::{CanFrame, Trouble};
use crate::dynamixel1;
use crate::dynamixel2::packet;
use crate::exchange::{Exchange, Order};
use crate::family::Family;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use std::path::PathBuf;

/// One fault in a scene. Times are world time in ns. A servo is named by its joint, as in the robot
/// file, or as `LINE/ID` with the ID it has at first. [`crate::Script`] reads them from a file.
#[derive(Clone, Debug, PartialEq)]
pub enum Fault {
    /// The `nth` status (from 0, of any kind) of this joint's servo is damaged.
    Status {
        /// Whose status.
        joint: String,
        /// Which of its statuses.
        nth: u64,
        /// In which way.
        damage: Damage,
    },
    /// Every status of every servo is damaged with this probability, by the world's seed.
    AnyStatus {
        /// 0 to 1.
        probability: f64,
        /// In which way.
        damage: Damage,
    },
    /// Statuses are damaged, each with this probability, by the world's seed.
    Statuses {
        /// Whose: a servo, or all of a line as `LINE/*`; none means all there are.
        of: Option<String>,
        /// First moment, of the instruction they answer.
        from_ns: u64,
        /// First moment after; `u64::MAX` for good.
        until_ns: u64,
        /// 0 to 1.
        probability: f64,
        /// In which way.
        damage: Damage,
    },
    /// The servo neither hears nor answers for a while: a loose data wire. Its motor goes on.
    Silent {
        /// Whose servo.
        joint: String,
        /// First moment.
        from_ns: u64,
        /// First moment after.
        until_ns: u64,
    },
    /// The overload error trips, as after a second of stall.
    Overload {
        /// Whose servo.
        joint: String,
        /// When.
        at_ns: u64,
    },
    /// The servo restarts: torque off, RAM as at power-up, deaf while it boots.
    Reboot {
        /// Whose servo.
        joint: String,
        /// When.
        at_ns: u64,
    },
    /// All servos lose power and come back without torque.
    Brownout {
        /// Power goes.
        from_ns: u64,
        /// All listen again.
        until_ns: u64,
    },
    /// The shaft is blocked: it does not turn, and the motor stalls against it.
    StuckPosition {
        /// Whose shaft.
        joint: String,
        /// First moment.
        from_ns: u64,
        /// First moment after; `u64::MAX` for good.
        until_ns: u64,
    },
    /// The position register stands still, whatever the shaft does; the servo itself still finds
    /// its goal.
    FrozenPosition {
        /// Whose register.
        joint: String,
        /// First moment.
        from_ns: u64,
        /// First moment after; `u64::MAX` for good.
        until_ns: u64,
    },
    /// The encoder's reading jumps for good.
    PositionJump {
        /// Whose encoder.
        joint: String,
        /// When.
        at_ns: u64,
        /// By how many counts.
        counts: i32,
    },
    /// A register holds another value than the robot file says: another model, firmware or limit,
    /// a supply too low. As [`crate::World::set_register`].
    Register {
        /// Whose.
        joint: String,
        /// Its name in the profile.
        register: String,
        /// The raw value.
        raw: i64,
        /// From when on; 0 is before anything else.
        at_ns: u64,
    },
    /// Another servo like this joint's, with the same ID, hangs on its line.
    Twin {
        /// Whose twin.
        joint: String,
        /// How far its shaft is turned from the first's, rad.
        turn_rad: f64,
    },
    /// The adapter hands over late.
    SlowLine {
        /// Which line; none means every one.
        line: Option<String>,
        /// First moment.
        from_ns: u64,
        /// First moment after; `u64::MAX` for good.
        until_ns: u64,
        /// Every byte is held back so long.
        latency_ns: u64,
        /// And gathered like this.
        usb: Option<Usb>,
    },
    /// The adapter is pulled out: what is under way is lost, the port is gone. See
    /// [`crate::World::connection`].
    HangUp {
        /// Which line; none means every one.
        line: Option<String>,
        /// When.
        at_ns: u64,
        /// When it is plugged in again, if ever. The servos have kept their power.
        until_ns: Option<u64>,
        /// Door's link from then on; none means the same.
        link: Option<PathBuf>,
    },
    /// The line takes no bytes from the host.
    Blocked {
        /// Which line; none means every one.
        line: Option<String>,
        /// First moment.
        from_ns: u64,
        /// First moment after.
        until_ns: u64,
        /// So many bytes it takes all the same: a write is then partial.
        bytes: usize,
    },
    /// Something is wrong with a CAN actuator: it lets go, and says so in its family's way until
    /// the cause is gone and the fault is cleared.
    Trouble {
        /// Whose.
        joint: String,
        /// What.
        trouble: Trouble,
        /// First moment.
        from_ns: u64,
        /// First moment after; `u64::MAX` for good.
        until_ns: u64,
    },
    /// The host's interface leaves a CAN line. See [`crate::can::CanHeard::BusOff`].
    BusOff {
        /// Which line; none means every CAN line.
        line: Option<String>,
        /// When.
        at_ns: u64,
        /// When it takes part again, if ever.
        until_ns: Option<u64>,
    },
    /// A foreign node talks on a CAN line without being asked.
    Babble {
        /// Which line; none means every CAN line.
        line: Option<String>,
        /// What it says.
        frame: CanFrame,
        /// How often; at least 10 us.
        period_ns: u64,
        /// First moment.
        from_ns: u64,
        /// First moment after; `u64::MAX` for good.
        until_ns: u64,
    },
    /// Somebody pushes a robot with weight ([`crate::World::give_weight`]); one without does not move.
    Push {
        /// The joint whose link is pushed; none means the robot's first link.
        joint: Option<String>,
        /// How hard, as [`crate::Outside::forces`].
        force_n: [f64; 3],
        /// First moment.
        from_ns: u64,
        /// First moment after; `u64::MAX` for good.
        until_ns: u64,
    },
    /// The floor under a robot with weight falls.
    Slope {
        /// How much, as [`crate::Outside::slope_rad`].
        slope_rad: [f64; 2],
        /// First moment.
        from_ns: u64,
        /// First moment after; `u64::MAX` for good.
        until_ns: u64,
    },
    /// The fault happens in so many worlds of all, by the seed.
    Perhaps {
        /// 0 to 1.
        probability: f64,
        /// Which.
        fault: Box<Fault>,
    },
}

impl Fault {
    /// Its name in a script, if it concerns a robot with weight alone.
    #[must_use]
    pub fn of_weight(&self) -> Option<&'static str> {
        match self {
            Fault::Push { .. } => Some("push"),
            Fault::Slope { .. } => Some("slope"),
            Fault::Perhaps { fault, .. } => fault.of_weight(),
            _ => None,
        }
    }
}

/// What happens to one status.
///
/// `Mute`, `Lie` and `WrongId` happen in the servo, so the others on the line hear them too and a
/// chain breaks after a mute one. The rest happens between the line and the host.
///
/// A CAN actuator's frame: `Lie` changes a byte of its payload, `WrongId` the low eight bits of its
/// identifier; `Length` makes the payload so many bytes (8 at most, or 64 with FD), `DropByte` one
/// fewer; `Garbage` is a foreign frame before it, `Echo` the host's own. `FlipBit` and
/// `FalseHeader` do nothing: such a frame never gets past the controller.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Damage {
    /// It is not sent.
    Mute,
    /// One byte of its parameters is changed by exclusive or; the checksum is right.
    Lie {
        /// Which parameter byte.
        at: usize,
        /// The bits that change.
        xor: u8,
    },
    /// It carries another ID; the checksum is right.
    WrongId {
        /// The ID it carries.
        id: u8,
    },
    /// One bit arrives changed; drawn from the seed unless given.
    FlipBit {
        /// Number of the bit, 8 to a byte, least significant first.
        bit: Option<usize>,
    },
    /// One byte does not arrive; drawn from the seed unless given.
    DropByte {
        /// Number of the byte.
        at: Option<usize>,
    },
    /// It arrives twice.
    Duplicate,
    /// It arrives this much later, perhaps when something else is asked.
    StaleReply {
        /// How much later.
        by_ns: u64,
    },
    /// Random bytes arrive right before it.
    Garbage {
        /// How many.
        length: usize,
    },
    /// The head of a status that never comes arrives right before it; its length field says there
    /// are 40 bytes more.
    FalseHeader,
    /// The host's own instruction arrives right before it.
    Echo,
    /// Its length field holds this. It has as many bytes as that, up to 4096, zeros added, and a
    /// checksum that is right for them. Of a fast (merged) status only the field changes.
    Length {
        /// The length field; Protocol 1.0 and FEETECH have its low byte.
        length: u16,
    },
}

impl Damage {
    /// Its name in a script.
    pub fn name(self) -> &'static str {
        match self {
            Damage::Mute => "mute",
            Damage::Lie { .. } => "lie",
            Damage::WrongId { .. } => "wrong-id",
            Damage::FlipBit { .. } => "flip-bit",
            Damage::DropByte { .. } => "drop-byte",
            Damage::Duplicate => "duplicate",
            Damage::StaleReply { .. } => "stale-reply",
            Damage::Garbage { .. } => "garbage",
            Damage::FalseHeader => "false-header",
            Damage::Echo => "echo",
            Damage::Length { .. } => "length",
        }
    }
}

/// A fault that struck.
#[derive(Clone, Debug, PartialEq)]
pub struct Struck {
    /// World time, ns.
    pub at_ns: u64,
    /// Its name in a script.
    pub fault: &'static str,
    /// Joint, `LINE/ID` or line; empty if it concerned all.
    pub place: String,
    /// Which of the servo's statuses, from 0, where it was one.
    pub nth: Option<u64>,
}

impl std::fmt::Display for Struck {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:.6} s: {}", self.at_ns as f64 * 1e-9, self.fault)?;
        if !self.place.is_empty() {
            write!(f, ", {}", self.place)?;
        }
        match self.nth {
            Some(nth) => write!(f, ", status {nth}"),
            None => Ok(()),
        }
    }
}

/// The damage done in the servo that gives answer `k`.
pub(crate) fn damage_at_sender(family: Family, exchange: &mut Exchange, k: usize, damage: Damage) {
    let merged = exchange.order == Order::Merged;
    let answer = &mut exchange.answers[k];
    match (damage, family) {
        (Damage::Mute, _) => answer.servo = None,
        (Damage::Length { length }, _) if merged => {
            // One length field for all; the bytes stay.
            if let Some(field) = exchange.answers[0].bytes.get_mut(5..7) {
                field.copy_from_slice(&length.to_le_bytes());
                reseal_merged(exchange);
            }
        }
        (Damage::Length { length }, _) => claim_length(&mut answer.bytes, family, length),
        (Damage::Lie { .. } | Damage::WrongId { .. }, Family::Dynamixel2) if merged => {
            let head = if answer.bytes.starts_with(&[0xFF, 0xFF, 0xFD, 0x00]) { 8 } else { 0 };
            let place = match damage {
                Damage::Lie { at, .. } => head + 2 + at,
                _ => head + 1,
            };
            let end = answer.bytes.len() - 2;
            change(&mut answer.bytes[..end], place, damage);
            reseal_merged(exchange);
        }
        // What a hostile length has left too short for an error byte stays as it is.
        (Damage::Lie { .. } | Damage::WrongId { .. }, Family::Dynamixel2)
            if answer.bytes.len() < 11 => {}
        (Damage::Lie { .. } | Damage::WrongId { .. }, Family::Dynamixel2) => {
            let (id, _, body) = packet::open(&answer.bytes);
            let mut plain = body.into_owned();
            plain.insert(0, id);
            let place = if let Damage::Lie { at, .. } = damage { at + 2 } else { 0 };
            change(&mut plain, place, damage);
            answer.bytes = packet::status(plain[0], plain[1], &plain[2..]);
        }
        (Damage::Lie { .. } | Damage::WrongId { .. }, _) => {
            let place = if let Damage::Lie { at, .. } = damage { at + 5 } else { 2 };
            let end = answer.bytes.len() - 1;
            change(&mut answer.bytes[..end], place, damage);
            dynamixel1::packet::reseal(&mut answer.bytes);
        }
        _ => {}
    }
}

fn change(bytes: &mut [u8], place: usize, damage: Damage) {
    if let Some(byte) = bytes.get_mut(place) {
        match damage {
            Damage::Lie { xor, .. } => *byte ^= xor,
            Damage::WrongId { id } => *byte = id,
            _ => {}
        }
    }
}

/// Each servo's CRC in a merged status covers all that was on the line before it.
fn reseal_merged(exchange: &mut Exchange) {
    let mut crc = 0;
    for answer in &mut exchange.answers {
        let Some((block, own)) = answer.bytes.split_last_chunk_mut::<2>() else { break };
        crc = packet::crc_after(crc, block);
        *own = crc.to_le_bytes();
        crc = packet::crc_after(crc, own);
    }
}

/// Makes a status as long as its length field is to say, or as near as can be.
fn claim_length(bytes: &mut Vec<u8>, family: Family, length: u16) {
    const LONGEST: usize = 4096;
    let (head, sum_bytes) = if family == Family::Dynamixel2 { (7, 2) } else { (4, 1) };
    let claimed = match family {
        Family::Dynamixel2 => usize::from(length),
        _ => usize::from(length & 0xFF),
    };
    bytes.truncate(bytes.len() - sum_bytes);
    bytes.resize(head + claimed.min(LONGEST).saturating_sub(sum_bytes), 0);
    if family == Family::Dynamixel2 {
        bytes[5..7].copy_from_slice(&length.to_le_bytes());
        bytes.extend(packet::crc_after(0, bytes).to_le_bytes());
    } else {
        bytes[3] = claimed as u8;
        bytes.push(0);
        dynamixel1::packet::reseal(bytes);
    }
}

/// What becomes of a CAN actuator's frame: the frames that are sent for it, and how much later.
pub(crate) fn damage_frame(
    frame: CanFrame,
    damages: &[Damage],
    last_of_host: Option<&CanFrame>,
    rng: &mut ChaCha8Rng,
) -> (Vec<CanFrame>, u64) {
    let (mut frames, mut late_ns) = (vec![frame], 0);
    for damage in damages {
        let Some(frame) = frames.last_mut() else { break };
        match *damage {
            Damage::Mute => frames.clear(),
            Damage::Lie { at, xor } => {
                if let Some(byte) = frame.bytes.get_mut(at) {
                    *byte ^= xor;
                }
            }
            Damage::WrongId { id } => frame.id = frame.id & !0xFF | u32::from(id),
            Damage::Length { length } => frame.set_length(length.into()),
            Damage::DropByte { .. } => frame.set_length(frame.bytes.len().saturating_sub(1)),
            Damage::Duplicate => frames.extend_from_within(frames.len() - 1..),
            Damage::StaleReply { by_ns } => late_ns += by_ns,
            Damage::Garbage { length } => {
                let bytes: Vec<u8> = (0..length.min(8)).map(|_| rng.random()).collect();
                frames.insert(0, CanFrame::classic(rng.random_range(0..0x800), false, &bytes));
            }
            Damage::Echo => frames.splice(0..0, last_of_host.cloned()).for_each(drop),
            Damage::FlipBit { .. } | Damage::FalseHeader => {}
        }
    }
    (frames, late_ns)
}

/// How a status reaches the host.
pub(crate) struct Arrival {
    pub bytes: Vec<u8>,
    pub copies: usize,
    pub late_ns: u64,
}

/// The damage done between the line and the host, who said `instruction`.
pub(crate) fn damage_at_host(
    arrival: &mut Arrival,
    damage: Damage,
    instruction: &[u8],
    rng: &mut ChaCha8Rng,
) {
    let bytes = &mut arrival.bytes;
    match damage {
        Damage::FlipBit { bit } if !bytes.is_empty() => {
            let bits = bytes.len() * 8;
            let bit = bit.unwrap_or_else(|| rng.random_range(0..bits));
            if let Some(byte) = bytes.get_mut(bit / 8) {
                *byte ^= 1 << (bit % 8);
            }
        }
        Damage::DropByte { at } if !bytes.is_empty() => {
            let at = at.unwrap_or_else(|| rng.random_range(0..bytes.len()));
            if at < bytes.len() {
                bytes.remove(at);
            }
        }
        Damage::Garbage { length } => {
            bytes.splice(0..0, (0..length).map(|_| rng.random::<u8>()));
        }
        Damage::FalseHeader => {
            let head = match *bytes.as_slice() {
                [0xFF, 0xFF, 0xFD, 0, id, ..] => vec![0xFF, 0xFF, 0xFD, 0, id, 40, 0, 0x55],
                [_, _, id, ..] => vec![0xFF, 0xFF, id, 40, 0],
                _ => vec![0xFF, 0xFF],
            };
            bytes.splice(0..0, head);
        }
        Damage::Echo => {
            bytes.splice(0..0, instruction.iter().copied());
        }
        Damage::Duplicate => arrival.copies += 1,
        Damage::StaleReply { by_ns } => arrival.late_ns += by_ns,
        _ => {}
    }
}
