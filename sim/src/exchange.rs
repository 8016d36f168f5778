//! What servos say to one instruction, and in which order, before the line gives it times.

/// What the start of received bytes is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Scan {
    /// Could become a packet; wait.
    Incomplete,
    /// So many bytes are no packet.
    Skip(usize),
    /// A whole packet of so many bytes.
    Packet(usize),
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
