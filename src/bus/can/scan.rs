//! Who is on a CAN line: what devices say unasked, and what answers questions that move nothing and
//! switch nothing.
//!
//! Every question is asked twice, because nobody repeats what a device was too busy to hear. Two
//! devices with one id answer both; where their answers differ in anything, the line carries both,
//! or reports errors. Answers equal in every bit are one to everybody.

use super::{AskError, CanBus, Form, NoSuchSetting, Peer};
use crate::time::{Duration, Instant};
use crate::wire::can::cubemars::MitCommand;
use crate::wire::can::moteus::{self, Message as MoteusMessage, Part, Resolution, Route};
use crate::wire::can::{
    CanFrame, Faults, Format, Number, cubemars, damiao, odrive, recoil, robstride,
};
use std::collections::BTreeMap;

/// In what, and at whom, a line's devices are asked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Call {
    /// Each id for its own id's register.
    Damiao,
    /// Each id for the number of its processor, on behalf of this host.
    Robstride(robstride::Id),
    /// Each node for its estimates, by remote request.
    Odrive,
    /// Each id for model and serial number, on behalf of this host. Needs CAN FD.
    Moteus(moteus::Id),
    /// Each id for its own id.
    Recoil,
    /// Each id is told to let go, because nothing else is answered by those that drive nothing.
    CubemarsMit,
}

/// A device that was heard.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Found {
    /// Which.
    pub peer: Peer,
    /// It spoke without being asked.
    pub unasked: bool,
    /// Its serial number, or its processor's, if its answer has one.
    pub serial: Option<u64>,
    /// Answers that contradict each other: more than one device has this id.
    pub contradicts: bool,
}

/// How many ids are asked in one go.
const AT_ONCE: usize = 16;
/// How long answers to them are waited for. No maker promises a time.
const ANSWERS: Duration = Duration::from_millis(4);
/// Each id is asked so often.
const ROUNDS: usize = 2;
/// A host that slept through the answers for so much longer asks again, at most so often: its own stall is nobody's
/// silence.
const SLEPT: Duration = Duration::from_millis(20);
const AGAIN: usize = 3;
/// How long after the last question answers are still waited for: an adapter that gathers frames or
/// a computer that is busy brings them late, and late they are as true.
const LATE: Duration = Duration::from_millis(100);
/// Damiao's register with the id a device listens to.
const OWN_ID: u8 = damiao::register::ESC_ID;
/// moteus: model, firmware and map of registers; three words of serial number.
const MODEL: u16 = 0x100;
const SERIAL: u16 = 0x120;
/// In how many beats of a heart a node is believed to have one.
const BEATS: u32 = 2;

impl Call {
    /// Every question it takes.
    #[must_use]
    pub fn questions(self) -> Vec<CanFrame> {
        let [first, last] = match self {
            Self::Damiao => [1, u8::MAX],
            Self::Robstride(_) => [0, 254],
            Self::Odrive => [0, 63],
            // 127 is everybody.
            Self::Moteus(_) => [1, 126],
            Self::Recoil => [1, 127],
            Self::CubemarsMit => [0, u8::MAX],
        };
        (first..=last).filter_map(|id| self.question(id)).collect()
    }

    /// The question to `id`; none if the dialect has no such id, or it is the host's.
    fn question(self, id: u8) -> Option<CanFrame> {
        Some(match self {
            Self::Damiao => damiao::request(damiao::Id::new(id)?, damiao::Request::Read(OWN_ID)),
            Self::Robstride(host) => {
                let id = robstride::Id::new(id)?;
                robstride::command(host, id, robstride::Command::Identify)
            }
            Self::Odrive => odrive::request(odrive::Id::new(id)?, odrive::Request::Estimates),
            Self::Moteus(host) => {
                moteus_question(host, moteus::Id::new(id).filter(|id| *id != host)?)
            }
            Self::Recoil => {
                let own_id = recoil::Command::Read(recoil::parameter::DEVICE_ID);
                recoil::command(recoil::Id::new(id)?, own_id)
            }
            Self::CubemarsMit => cubemars::mit_command(cubemars::Id::new(id)?, MitCommand::Disable),
        })
    }

    /// Who gives this answer to any of its questions, and a number that is its own alone.
    fn answer(self, frame: &CanFrame) -> Option<(Peer, Option<u64>)> {
        match self {
            Self::Damiao => {
                // The answer names the id twice: as the device asked, and as the register's value.
                let [low, 0, 0x33, OWN_ID, value, 0, 0, 0] = *frame.payload() else { return None };
                let id = damiao::Id::new(low).filter(|_| low == value)?;
                let answer_id = u16::try_from(frame.id().number()).ok()?;
                let answered = damiao::register_value(id, answer_id, OWN_ID, frame)?;
                (answered == u32::from(low)).then_some((Peer::Damiao { id, answer_id }, None))
            }
            Self::Robstride(host) => match robstride::message(frame)? {
                (id, robstride::Message::Identity(bytes)) => {
                    Some((Peer::Robstride { id, host }, Some(u64::from_be_bytes(bytes))))
                }
                _ => None,
            },
            Self::Odrive => match odrive::message(frame)? {
                (id, odrive::Message::Feedback(feedback)) if feedback.position.is_some() => {
                    Some((Peer::Odrive { id }, None))
                }
                _ => None,
            },
            Self::Moteus(host) => moteus_answer(host, frame),
            Self::Recoil => match recoil::message(frame)? {
                (id, recoil::Message::Parameter(bits)) if bits == u32::from(id.get()) => {
                    Some((Peer::Recoil { id }, None))
                }
                _ => None,
            },
            Self::CubemarsMit => {
                let (id, _) = cubemars::mit_reply(frame)?;
                Some((Peer::CubemarsMit { id }, None))
            }
        }
    }
}

fn moteus_question(host: moteus::Id, id: moteus::Id) -> CanFrame {
    let mut message = MoteusMessage::default();
    let whole = message
        .read(Resolution::Int32, MODEL, 3)
        .and_then(|()| message.read(Resolution::Int32, SERIAL, 3));
    debug_assert!(whole.is_ok(), "six bytes");
    message.frame(Route { source: host, destination: id, reply: true, fast: true })
}

fn moteus_answer(host: moteus::Id, frame: &CanFrame) -> Option<(Peer, Option<u64>)> {
    let (id, to) = moteus::ends(frame)?;
    if to != host || !matches!(frame.format(), Format::Fd { .. }) {
        return None;
    }
    let mut serial = 0;
    let mut model = false;
    for part in moteus::parts(frame.payload()) {
        let Part::Value(register, Some(Number::Steps(steps))) = part else { continue };
        model |= register == u32::from(MODEL);
        // Of the three words the first two fit; the third tells devices of a series apart.
        if let Some(word) = register.checked_sub(SERIAL.into()).filter(|word| *word < 3) {
            serial ^= u64::from(steps.cast_unsigned()).rotate_left(if word == 1 { 32 } else { 0 });
        }
    }
    model.then_some((Peer::Moteus { id, host }, Some(serial)))
}

/// Asks everybody `call` names; devices in order of their ids. `progress` is told how many
/// questions were asked.
///
/// # Errors
/// [`AskError::Port`]: the line failed.
pub fn scan(
    bus: &mut CanBus,
    call: Call,
    progress: &mut dyn FnMut(u64),
) -> Result<Vec<Found>, AskError> {
    let mut found: BTreeMap<u8, Found> = BTreeMap::new();
    let mut take = |frame: &CanFrame| {
        let Some((peer, serial)) = call.answer(frame) else { return false };
        let new = Found { peer, unasked: false, serial, contradicts: false };
        let known = found.entry(peer.id()).or_insert(new);
        known.contradicts |= known.peer != peer || known.serial != serial;
        true
    };
    let questions = call.questions();
    for _ in 0..ROUNDS {
        for some in questions.chunks(AT_ONCE) {
            if matches!(call, Call::Recoil) {
                // Whose an answer is is told by its id, but not to which question it is.
                some.iter().try_for_each(|frame| ask(bus, &[*frame], &mut take))?;
            } else {
                ask(bus, some, &mut take)?;
            }
            progress(some.len() as u64);
        }
    }
    bus.call(&[], LATE, &mut take)?;
    Ok(found.into_values().collect())
}

/// Asks until the host was awake while answers were due.
fn ask(
    bus: &mut CanBus,
    questions: &[CanFrame],
    take: &mut dyn FnMut(&CanFrame) -> bool,
) -> Result<(), AskError> {
    for _ in 0..=AGAIN {
        let late = bus.late;
        bus.call(questions, ANSWERS, take)?;
        if bus.late < late + SLEPT {
            break;
        }
    }
    Ok(())
}

fn moteus_state(host: moteus::Id, id: moteus::Id) -> CanFrame {
    let mut message = MoteusMessage::default();
    let whole = message
        .read(Resolution::Int8, moteus::register::MODE, 1)
        .and_then(|()| message.read(Resolution::Int8, moteus::register::FAULT, 1));
    debug_assert!(whole.is_ok(), "four bytes");
    message.frame(Route { source: host, destination: id, reply: true, fast: true })
}

/// Its heartbeat says which state; what its error bits mean depends on its firmware.
fn odrive_state(id: odrive::Id, frame: &CanFrame) -> Option<(bool, Faults)> {
    match odrive::message(frame)? {
        (from, odrive::Message::Heartbeat { error, state }) if from == id => {
            let faults = if error == 0 { Faults::NONE } else { Faults::OTHER };
            Some((u32::from(state) == odrive::STATE_CLOSED_LOOP, faults))
        }
        _ => None,
    }
}

/// The device with this id, if one answers by `budget`.
///
/// # Errors
/// [`AskError::Port`]: the line failed.
pub fn find(
    bus: &mut CanBus,
    call: Call,
    id: u8,
    budget: Instant,
) -> Result<Option<Found>, AskError> {
    let Some(question) = call.question(id) else { return Ok(None) };
    let answer = |frame: &CanFrame| call.answer(frame).filter(|(peer, _)| peer.id() == id);
    match bus.ask(&question, answer, |_| true, budget) {
        Ok((peer, serial)) => Ok(Some(Found { peer, unasked: false, serial, contradicts: false })),
        Err(AskError::Port(error)) => Err(error.into()),
        Err(_) => Ok(None),
    }
}

/// What a line's devices say unasked.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Overheard {
    /// Devices, by dialect and id.
    pub devices: Vec<Found>,
    /// Frames heard that are none of theirs.
    pub foreign_count: u64,
}

/// Listens until `until` to those who speak without being asked: ODrive's heartbeat, the status of
/// CubeMars in servo mode, the reports of RobStride.
///
/// # Errors
/// [`AskError::Port`]: the line failed.
pub fn overhear(bus: &mut CanBus, until: Instant) -> Result<Overheard, AskError> {
    let mut heard: BTreeMap<(u8, u8), (Peer, u32)> = BTreeMap::new();
    let mut foreign_count = 0;
    bus.listen(until, &mut |frame| {
        let Some((dialect, peer, counts)) = speaks_unasked(frame) else {
            foreign_count += 1;
            return (false, true);
        };
        let (_, beats) = heard.entry((dialect, peer.id())).or_insert((peer, 0));
        *beats += u32::from(counts);
        (true, true)
    })?;
    let believed = heard.into_values().filter(|(_, beats)| *beats >= BEATS);
    let devices =
        believed.map(|(peer, _)| Found { peer, unasked: true, serial: None, contradicts: false });
    Ok(Overheard { devices: devices.collect(), foreign_count })
}

/// Order of the dialect, who speaks, and whether that alone is a sign of it.
fn speaks_unasked(frame: &CanFrame) -> Option<(u8, Peer, bool)> {
    if let Some((id, _)) = cubemars::servo_feedback(frame) {
        return Some((1, Peer::CubemarsServo { id }, true));
    }
    if let Some((id, message)) = robstride::message(frame)
        && matches!(message, robstride::Message::Feedback(_) | robstride::Message::Fault { .. })
    {
        let host = robstride::Id::new(frame.id().number() as u8)?;
        return Some((2, Peer::Robstride { id, host }, true));
    }
    let (id, message) = odrive::message(frame)?;
    let beat = match message {
        // States of an axis end at 14 (`ODrive.AxisState`).
        odrive::Message::Heartbeat { state, .. } => state <= 14 && frame.payload().len() == 8,
        _ => false,
    };
    Some((0, Peer::Odrive { id }, beat))
}

impl CanBus {
    /// The bits of setting `number` of `peer`.
    ///
    /// # Errors
    /// [`AskError::Unsayable`] if there is no such question, or the device has no such setting;
    /// else as [`CanBus::ask`].
    pub fn read_setting(
        &mut self,
        peer: &Peer,
        number: u16,
        form: Form,
        budget: Instant,
    ) -> Result<u32, AskError> {
        let none = || AskError::Unsayable("its dialect has no such question".into());
        let question = peer.ask(number, form).ok_or_else(none)?;
        let answer = self.ask(&question, |frame| peer.value(number, frame), |_| true, budget)?;
        answer.map_err(|NoSuchSetting| {
            AskError::Unsayable("the device says that it has no such setting".into())
        })
    }

    /// Whether `peer` drives, and what is wrong with it, asked in a way that changes nothing, or
    /// heard within `patience` where it tells unasked; none where its dialect tells neither.
    ///
    /// # Errors
    /// As [`CanBus::ask`].
    pub fn state_of(
        &mut self,
        peer: &Peer,
        patience: Duration,
    ) -> Result<Option<(bool, Faults)>, AskError> {
        let budget = self.clock.now() + patience;
        match *peer {
            Peer::Damiao { id, answer_id } => {
                let question = damiao::request(id, damiao::Request::Feedback);
                let answer = |frame: &CanFrame| damiao::feedback(id, answer_id, frame);
                let feedback = self.ask(&question, answer, |_| true, budget)?;
                Ok(feedback.enabled.map(|enabled| (enabled, feedback.faults)))
            }
            Peer::Moteus { id, host } => {
                let question = moteus_state(host, id);
                let answer = |frame: &CanFrame| {
                    moteus::feedback(id, frame).filter(|told| told.enabled.is_some())
                };
                let feedback = self.ask(&question, answer, |_| true, budget)?;
                Ok(feedback.enabled.map(|enabled| (enabled, feedback.faults)))
            }
            Peer::Recoil { .. } => {
                use recoil::parameter::{ERROR, MODE};
                let mode = self.read_setting(peer, MODE, Form::Whole, budget)?;
                let error = self.read_setting(peer, ERROR, Form::Whole, budget)?;
                Ok(Some((recoil::drives(mode), recoil::faults(error))))
            }
            Peer::Odrive { id } => {
                let mut told = None;
                self.listen(budget, &mut |frame| {
                    told = odrive_state(id, frame);
                    (true, told.is_none())
                })?;
                Ok(told)
            }
            Peer::Robstride { .. } | Peer::CubemarsMit { .. } | Peer::CubemarsServo { .. } => {
                Ok(None)
            }
        }
    }

    /// How many different answers come to one question for setting `number` of `peer`: more than
    /// one if two devices have its id.
    ///
    /// # Errors
    /// [`AskError::Port`].
    pub fn answers_to(&mut self, peer: &Peer, number: u16, form: Form) -> Result<usize, AskError> {
        let Some(question) = peer.ask(number, form) else { return Ok(0) };
        let mut count = 0;
        self.call(&[question], ANSWERS, &mut |frame| {
            let own = peer.value(number, frame).is_some();
            count += usize::from(own);
            own
        })?;
        Ok(count)
    }
}
