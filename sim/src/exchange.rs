//! What servos say to one instruction, and in which order, before the line gives it times.

use crate::family::Family;
use crate::servo::Servo;

/// What the start of received bytes is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Scan {
    /// Could become a packet; wait.
    Incomplete,
    /// So many bytes are no packet.
    Skip(usize),
    /// A whole packet of so many bytes.
    Packet(usize),
    /// So many bytes are a packet but for their checksum.
    Spoilt(usize),
}

/// A part of the control table one servo is asked for.
#[derive(Clone, Copy)]
pub(crate) struct Ask {
    pub id: u8,
    pub address: u16,
    pub length: usize,
}

/// Who waits for whom.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Order {
    /// Each answers after its own return delay: more than one collide.
    Together,
    /// Each waits for the one before, then its own return delay.
    Chained,
    /// Each goes on where the one before ended.
    Merged,
    /// Each in the time slot of its ID.
    Slots,
}

/// One servo's status, or the gap where one was asked for.
#[derive(Clone, Debug)]
pub(crate) struct Answer {
    /// Index of the servo on its line; none if nobody answers here.
    pub servo: Option<usize>,
    pub id: u8,
    pub bytes: Vec<u8>,
    /// Bytes a status would have here.
    pub length: usize,
    pub delay_ns: u64,
    /// Has the ID of the answer before, and so starts together with it.
    pub twin: bool,
}

/// All that is said to one instruction.
#[derive(Clone, Debug)]
pub(crate) struct Exchange {
    pub order: Order,
    pub answers: Vec<Answer>,
}

impl Exchange {
    pub fn nothing() -> Exchange {
        Exchange { order: Order::Together, answers: Vec::new() }
    }
}

impl Answer {
    pub fn given(servo: usize, id: u8, bytes: Vec<u8>, delay_ns: u64) -> Answer {
        Answer { servo: Some(servo), id, length: bytes.len(), bytes, delay_ns, twin: false }
    }

    pub fn missing(id: u8, length: usize, delay_ns: u64) -> Answer {
        Answer { servo: None, id, bytes: Vec::new(), length, delay_ns, twin: false }
    }
}

/// The servos of a family that hear the packet now on the line, with their indices.
pub(crate) fn hearing(
    servos: &mut [Servo],
    family: Family,
) -> impl Iterator<Item = (usize, &mut Servo)> {
    servos.iter_mut().enumerate().filter(move |(_, servo)| servo.hears && family.includes(servo))
}

/// The servos of a family that are plugged in and have this ID, whether they hear or not.
pub(crate) fn with_id(
    servos: &mut [Servo],
    family: Family,
    id: u8,
) -> impl Iterator<Item = (usize, &mut Servo)> {
    let meant = move |servo: &Servo| servo.attached && servo.id() == id && family.includes(servo);
    servos.iter_mut().enumerate().filter(move |(_, servo)| meant(servo))
}

/// A status from each servo asked, in order; `overhead` is a status's length without parameters.
/// A servo that says nothing leaves a gap.
pub(crate) fn in_turn(
    servos: &mut [Servo],
    family: Family,
    asks: &[Ask],
    overhead: usize,
    mut status: impl FnMut(&mut Servo, &Ask) -> Option<Vec<u8>>,
) -> Exchange {
    let mut answers = Vec::with_capacity(asks.len());
    for ask in asks {
        let mut delay_ns = 0;
        let mut given = false;
        for (index, servo) in with_id(servos, family, ask.id) {
            delay_ns = servo.return_delay_ns();
            if !servo.hears {
                continue;
            }
            if let Some(bytes) = status(servo, ask) {
                let answer = Answer::given(index, ask.id, bytes, delay_ns);
                answers.push(Answer { twin: given, ..answer });
                given = true;
            }
        }
        if !given {
            answers.push(Answer::missing(ask.id, overhead + ask.length, delay_ns));
        }
    }
    Exchange { order: Order::Chained, answers }
}
