//! What goes wrong, on purpose: scripted by time or by the number of a status, or drawn from the
//! seed.

use crate::SimError;
use crate::dynamixel1;
use crate::dynamixel2::packet;
use crate::exchange::{Exchange, Order};
use crate::family::Family;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// One fault in a scene. Times are world time in ns; joints are named as in the robot file.
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
    /// The encoder's reading jumps for good.
    PositionJump {
        /// Whose encoder.
        joint: String,
        /// When.
        at_ns: u64,
        /// By how many counts.
        counts: i32,
    },
}

/// What happens to one status.
///
/// `Mute`, `Lie` and `WrongId` happen in the servo, so the others on the line hear them too and a
/// chain breaks after a mute one. The rest happens between the line and the host.
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
}

/// A fault that strikes at one moment.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Strike {
    Overload { joint: usize },
    Reboot { joint: usize },
    Brownout { until_ns: u64 },
    Block { joint: usize, blocked: bool },
    Jump { joint: usize, counts: i64 },
}

/// A span in which a joint's servo is silent.
pub(crate) type Silence = (usize, std::ops::Range<u64>);

/// The scene's faults, sorted out.
#[derive(Clone, Debug, Default)]
pub(crate) struct Faults {
    scripted: Vec<(usize, u64, Damage)>,
    random: Vec<(f64, Damage)>,
    /// Latest first.
    pub strikes: Vec<(u64, Strike)>,
    pub silences: Vec<Silence>,
}

impl Faults {
    pub fn new(
        faults: &[Fault],
        find: impl Fn(&str) -> Result<usize, SimError>,
    ) -> Result<Faults, SimError> {
        let mut sorted = Faults::default();
        for fault in faults {
            match fault {
                Fault::Status { joint, nth, damage } => {
                    sorted.scripted.push((find(joint)?, *nth, *damage));
                }
                Fault::AnyStatus { probability, damage } => {
                    sorted.random.push((*probability, *damage));
                }
                Fault::Silent { joint, from_ns, until_ns } => {
                    sorted.silences.push((find(joint)?, *from_ns..*until_ns));
                }
                Fault::Overload { joint, at_ns } => {
                    sorted.strikes.push((*at_ns, Strike::Overload { joint: find(joint)? }));
                }
                Fault::Reboot { joint, at_ns } => {
                    sorted.strikes.push((*at_ns, Strike::Reboot { joint: find(joint)? }));
                }
                Fault::Brownout { from_ns, until_ns } => {
                    sorted.strikes.push((*from_ns, Strike::Brownout { until_ns: *until_ns }));
                }
                Fault::StuckPosition { joint, from_ns, until_ns } => {
                    let joint = find(joint)?;
                    sorted.strikes.push((*from_ns, Strike::Block { joint, blocked: true }));
                    sorted.strikes.push((*until_ns, Strike::Block { joint, blocked: false }));
                }
                Fault::PositionJump { joint, at_ns, counts } => {
                    let strike = Strike::Jump { joint: find(joint)?, counts: i64::from(*counts) };
                    sorted.strikes.push((*at_ns, strike));
                }
            }
        }
        sorted.strikes.sort_by_key(|&(at_ns, _)| std::cmp::Reverse(at_ns));
        Ok(sorted)
    }

    /// True if no status will ever be damaged.
    pub fn spare_statuses(&self) -> bool {
        self.scripted.is_empty() && self.random.is_empty()
    }

    /// What happens to the `nth` status of a joint's servo.
    pub fn strike_status(
        &self,
        joint: Option<usize>,
        nth: u64,
        rng: &mut ChaCha8Rng,
    ) -> Vec<Damage> {
        let scripted = self.scripted.iter().filter(|&&(j, n, _)| Some(j) == joint && n == nth);
        let mut damages: Vec<Damage> = scripted.map(|&(_, _, damage)| damage).collect();
        for &(probability, damage) in &self.random {
            if rng.random::<f64>() < probability {
                damages.push(damage);
            }
        }
        damages
    }
}

/// The damage done in the servo that gives answer `k`.
pub(crate) fn damage_at_sender(family: Family, exchange: &mut Exchange, k: usize, damage: Damage) {
    let merged = exchange.order == Order::Merged;
    let answer = &mut exchange.answers[k];
    match (damage, family) {
        (Damage::Mute, _) => answer.servo = None,
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

/// How a status reaches the host.
pub(crate) struct Arrival {
    pub bytes: Vec<u8>,
    pub copies: usize,
    pub late_ns: u64,
}

/// The damage done between the line and the host.
pub(crate) fn damage_at_host(arrival: &mut Arrival, damage: Damage, rng: &mut ChaCha8Rng) {
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
        Damage::Duplicate => arrival.copies += 1,
        Damage::StaleReply { by_ns } => arrival.late_ns += by_ns,
        _ => {}
    }
}
