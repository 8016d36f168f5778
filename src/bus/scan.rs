//! Who is on a line, and which IDs are there twice.
//!
//! Dynamixel 2.0 and Feetech STS are asked all at once, and each that answered once more by its own
//! ID; if anything in the chorus was garbled, the IDs not heard are asked one by one. Dynamixel 1.0
//! and Feetech SCS know no such question and are asked one by one from the start, which finds STS
//! too: the three share one packet and answer each other's pings. What a device of them is must be
//! told by its model number, so each comes with a [`Reading`] in every protocol it may speak.
//!
//! An answer that is lost makes nobody of a device. Whoever is silent is asked again where that costs little: at once if bytes came
//! that were no packet; and once more at the end if an ID nearby answered, since people number servos in a row, or if it
//! is the one that servos leave the factory with. A second pass over all IDs would take twice as long. It is made where most
//! answer alone who were silent when all were asked.
//!
//! Two devices with one ID answer at once. Mostly that garbles the answer, or both are heard one
//! after the other. Only if every bit of the two is the same do they look like one: so each device
//! is also asked, twice, for registers that differ between any two (position, clock), which the
//! caller names. What cannot be told apart even then: two devices equal in all of those at both
//! times, or of which one answers nothing but pings.

use super::codec::Protocol;
use super::{AskError, Bus, Miss, Reply};
use crate::time::{Duration, Instant};
use std::collections::BTreeMap;
use std::fmt;

/// Longest return delay a device can be set to: 254 times 2 us, in all four protocols.
const LONGEST_RETURN_DELAY: Duration = Duration::from_micros(508);

/// What one question is asked at most, when its answers are garbled: noise passes, twins do not.
const TRIES: usize = 3;

/// IDs this far from one that answered are asked again.
const NEARBY: u8 = 8;
/// So many IDs at most: a quarter of all.
const MOST_AGAIN: usize = 63;
/// The ID that servos leave the factory with.
const FACTORY_ID: u8 = 1;

/// The first registers of the servos that share the packet of Protocol 1.0, read to tell them
/// apart: model number and firmware stand in different places.
const FIRST_REGISTERS: (u16, u16) = (0, 5);

/// What a device says it is, if it speaks `protocol`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Reading {
    /// In which protocol its registers are read so.
    pub protocol: Protocol,
    /// Dynamixel: Model Number(0). Feetech: the word at 3.
    pub model_number: u16,
    /// Dynamixel: the byte at 6 (2.0) or 2 (1.0). Feetech: `major * 256 + minor`.
    pub firmware: u16,
}

/// A device that answers.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Found {
    /// The protocol it was asked in.
    pub protocol: Protocol,
    /// Its ID.
    pub id: u8,
    /// It reports a hardware error.
    pub alert: bool,
    /// What it may be: one for Dynamixel 2.0; for the others one for each protocol scanned for
    /// that shares the packet. None if it answers nothing but pings.
    pub readings: Vec<Reading>,
}

/// An ID that is not one device's alone, or not plainly so.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Collision {
    /// The protocol it was asked in.
    pub protocol: Protocol,
    /// The ID.
    pub id: u8,
    /// What gave it away.
    pub reason: Reason,
}

/// What gives two devices with one ID away.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reason {
    /// The answers to the same question were damaged again and again.
    Garbled,
    /// One question was answered twice.
    Twice,
    /// Answers about what never changes differ.
    Differs,
    /// Answered when all were asked, and not when asked alone.
    SilentAlone,
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Garbled => "its answers are damaged again and again",
            Self::Twice => "one question was answered twice",
            Self::Differs => "it gives two answers about what never changes",
            Self::SilentAlone => "it answered when all were asked, and not when asked alone",
        })
    }
}

/// Who is on a line.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Scan {
    /// Devices that answer plainly, by protocol and ID.
    pub found: Vec<Found>,
    /// IDs that do not.
    pub collisions: Vec<Collision>,
    /// False if it ended before all was asked: the time was over, or nobody wanted it to go on.
    pub complete: bool,
}

/// Finds all devices on the line of `bus` that speak one of `protocols`, at the line's speed.
///
/// `compare` names registers (address and length) of a device that are unlike those of any other,
/// even of the same model: its position, a clock. They are only read.
///
/// Takes [`Bus::ping_all_time`] where all can be asked at once, and else 254 questions that nearly
/// all run out of time; any return delay is allowed for.
///
/// # Errors
/// [`AskError::Port`]; [`AskError::Unsayable`] if `compare` names what cannot be asked for.
pub fn scan(
    bus: &mut Bus,
    protocols: &[Protocol],
    compare: impl Fn(&Found) -> Vec<(u16, u16)>,
    budget: Instant,
) -> Result<Scan, AskError> {
    scan_while(bus, protocols, compare, budget, &|| true)
}

/// [`scan`] for as long as `goes_on` says so, which is asked before each ID.
///
/// # Errors
/// As [`scan`].
pub fn scan_while(
    bus: &mut Bus,
    protocols: &[Protocol],
    compare: impl Fn(&Found) -> Vec<(u16, u16)>,
    budget: Instant,
    goes_on: &dyn Fn() -> bool,
) -> Result<Scan, AskError> {
    let known_delay = bus.timing.return_delay;
    bus.timing.return_delay = known_delay.max(LONGEST_RETURN_DELAY);
    let scan = Scan { complete: true, ..Scan::default() };
    let mut scanner = Scanner { bus, budget, goes_on, scan };
    let done = scanner.all(protocols, compare);
    let scan = std::mem::take(&mut scanner.scan);
    bus.timing.return_delay = known_delay;
    done.map(|()| scan)
}

/// A scan under way.
struct Scanner<'a> {
    bus: &'a mut Bus,
    budget: Instant,
    goes_on: &'a dyn Fn() -> bool,
    scan: Scan,
}

/// One family of protocols on the line.
struct Pass<'a> {
    asked_in: Protocol,
    family: &'a [Protocol],
    /// Who answered what when all were asked.
    present: &'a BTreeMap<u8, Vec<Reply>>,
    /// Who is there.
    there: &'a mut Vec<u8>,
}

/// What came of asking one ID.
enum Outcome {
    Silent,
    /// Bytes came that were no packet.
    Scraps,
    Answer(Reply),
    /// It is there, and does not do what it is asked.
    Refused,
    Trouble(Reason),
}

/// What is to be said of an ID.
enum Verdict {
    Nobody,
    Alone(Found),
    Collided(Reason),
}

impl Scan {
    fn take(&mut self, protocol: Protocol, id: u8, verdict: Verdict) {
        match verdict {
            Verdict::Nobody => {}
            Verdict::Alone(found) => self.found.push(found),
            Verdict::Collided(reason) => {
                self.collisions.push(Collision { protocol, id, reason });
            }
        }
    }
}

impl Scanner<'_> {
    fn all(
        &mut self,
        protocols: &[Protocol],
        compare: impl Fn(&Found) -> Vec<(u16, u16)>,
    ) -> Result<(), AskError> {
        let (modern, short): (Vec<_>, Vec<_>) =
            protocols.iter().partition(|&&protocol| protocol == Protocol::Dynamixel2);
        for family in [modern, short] {
            let Some(&asked_in) = family.first() else { continue };
            let at_once =
                family.iter().all(|p| matches!(p, Protocol::Dynamixel2 | Protocol::FeetechSts));
            let (present, one_by_one) =
                if at_once { self.roll_call(asked_in)? } else { (BTreeMap::new(), true) };
            let before = self.scan.found.len();
            let wanted = |id: &u8| one_by_one || present.contains_key(id);
            let mut there = Vec::new();
            let mut pass = Pass { asked_in, family: &family, present: &present, there: &mut there };
            let first = (0..asked_in.ids()).filter(wanted);
            if !self.each(&mut pass, first, &compare)? {
                return Ok(());
            }
            let again = again_of(asked_in.ids(), pass.there);
            if !self.each(&mut pass, again.into_iter(), &compare)? {
                return Ok(());
            }
            // SCS is deaf to the question to all and not to that of STS to one: where most answer only alone there may be
            // more of them. Of those who hear it only now and then one is not heard.
            let alone = pass.there.iter().filter(|id| !present.contains_key(id)).count();
            if !one_by_one && 2 * alone > pass.there.len() {
                let known = pass.there.clone();
                let others = (0..asked_in.ids()).filter(|id| !known.contains(id));
                if !self.each(&mut pass, others, &compare)? {
                    return Ok(());
                }
            }
            self.scan.found[before..].sort_by_key(|found| found.id);
        }
        Ok(())
    }

    /// Looks at each of these IDs; false if the time was over before.
    fn each(
        &mut self,
        pass: &mut Pass<'_>,
        ids: impl Iterator<Item = u8>,
        compare: &impl Fn(&Found) -> Vec<(u16, u16)>,
    ) -> Result<bool, AskError> {
        for id in ids {
            if self.bus.clock.now() >= self.budget || !(self.goes_on)() {
                self.scan.complete = false;
                return Ok(false);
            }
            let heard = pass.present.get(&id).map_or(&[][..], Vec::as_slice);
            let verdict = self.one(pass.asked_in, pass.family, id, heard, compare)?;
            if !matches!(verdict, Verdict::Nobody) {
                pass.there.push(id);
            }
            self.scan.take(pass.asked_in, id, verdict);
        }
        Ok(true)
    }

    /// Who answers what when all are asked, and whether anything came that was no answer.
    fn roll_call(
        &mut self,
        protocol: Protocol,
    ) -> Result<(BTreeMap<u8, Vec<Reply>>, bool), AskError> {
        let roll = self.bus.ping_all(protocol, self.budget)?;
        let mut present: BTreeMap<u8, Vec<Reply>> = BTreeMap::new();
        for (id, reply) in roll.present {
            present.entry(id).or_default().push(reply);
        }
        let ping = protocol.status_bytes(protocol.ping_bytes());
        Ok((present, roll.garbled_bytes >= ping / 2))
    }

    /// Looks at one ID, which gave the answers `heard` when all were asked.
    fn one(
        &mut self,
        protocol: Protocol,
        family: &[Protocol],
        id: u8,
        heard: &[Reply],
        compare: &impl Fn(&Found) -> Vec<(u16, u16)>,
    ) -> Result<Verdict, AskError> {
        let tries = if heard.is_empty() { 1 } else { TRIES };
        let ping = |out: &mut Vec<u8>| protocol.ping(out, id);
        let pong = match self.settled(protocol, id, protocol.ping_bytes(), tries, ping)? {
            Outcome::Answer(reply) => reply,
            Outcome::Silent | Outcome::Scraps if heard.is_empty() => return Ok(Verdict::Nobody),
            Outcome::Silent | Outcome::Scraps => return Ok(Verdict::Collided(Reason::SilentAlone)),
            Outcome::Refused => Reply { alert: true, bytes: Vec::new() },
            Outcome::Trouble(reason) => return Ok(Verdict::Collided(reason)),
        };
        if heard.iter().any(|reply| reply.bytes != pong.bytes) {
            return Ok(Verdict::Collided(Reason::Differs));
        }
        if heard.len() > 1 {
            return Ok(Verdict::Collided(Reason::Twice));
        }
        let mut found = Found { protocol, id, alert: pong.alert, readings: Vec::new() };
        if protocol == Protocol::Dynamixel2 {
            found.readings.extend(reading(protocol, &pong.bytes));
        } else {
            match self.registers(protocol, id, FIRST_REGISTERS)? {
                Outcome::Answer(reply) => {
                    let seen = family.iter().filter_map(|&p| reading(p, &reply.bytes));
                    found.readings = seen.collect();
                }
                Outcome::Silent | Outcome::Scraps | Outcome::Refused => {}
                Outcome::Trouble(reason) => return Ok(Verdict::Collided(reason)),
            }
        }
        for block in compare(&found) {
            for _ in 0..2 {
                if let Outcome::Trouble(reason) = self.registers(protocol, id, block)? {
                    return Ok(Verdict::Collided(reason));
                }
            }
        }
        Ok(Verdict::Alone(found))
    }

    fn registers(
        &mut self,
        protocol: Protocol,
        id: u8,
        (address, length): (u16, u16),
    ) -> Result<Outcome, AskError> {
        self.settled(protocol, id, usize::from(length), 1, |out| {
            protocol.read(out, id, address, length)
        })
    }

    /// Asks until it is answered plainly, `tries` times at most; once there was trouble, a plain
    /// answer counts only if no trouble follows.
    fn settled(
        &mut self,
        protocol: Protocol,
        id: u8,
        length: usize,
        mut tries: usize,
        question: impl Fn(&mut Vec<u8>) -> Result<(), String>,
    ) -> Result<Outcome, AskError> {
        let mut plain = None;
        let mut troubles = 0;
        let mut tried = 0;
        loop {
            let outcome = self.asked(protocol, id, length, &question)?;
            tried += 1;
            match outcome {
                Outcome::Trouble(reason) if troubles > 0 => return Ok(Outcome::Trouble(reason)),
                Outcome::Trouble(_) => troubles += 1,
                Outcome::Silent => {}
                Outcome::Scraps => tries = TRIES,
                answer if troubles == 0 => return Ok(answer),
                answer => plain = Some(answer),
            }
            if tried >= if troubles > 0 { TRIES } else { tries } {
                return Ok(plain.unwrap_or(Outcome::Silent));
            }
        }
    }

    /// Asks once and hears out the whole time in which an answer may come.
    fn asked(
        &mut self,
        protocol: Protocol,
        id: u8,
        length: usize,
        question: impl Fn(&mut Vec<u8>) -> Result<(), String>,
    ) -> Result<Outcome, AskError> {
        let status = protocol.status_bytes(length);
        self.bus.encode(question)?;
        let heard_at = self.bus.say(self.budget)?;
        let until = heard_at + self.bus.answer_time(protocol, status, 1);
        let chorus = self.bus.hear_all(protocol, length, until)?;
        let mut own = chorus.said.into_iter().filter(|(said_by, _)| *said_by == id);
        let (first, second) = (own.next(), own.next());
        Ok(match (first, second) {
            (_, Some(_)) => Outcome::Trouble(Reason::Twice),
            // A few bytes of noise are no second answer.
            _ if chorus.garbled_bytes >= status / 2 => Outcome::Trouble(Reason::Garbled),
            (Some((_, Ok(reply))), None) => Outcome::Answer(reply),
            (Some((_, Err(Miss::Refused(_)))), None) => Outcome::Refused,
            (Some(_), None) => Outcome::Trouble(Reason::Garbled),
            (None, None) if chorus.garbled_bytes > 0 => Outcome::Scraps,
            (None, None) => Outcome::Silent,
        })
    }
}

/// Who is asked once more, nearest to somebody first: silent IDs near those that are `there`; if nobody is, the usual one.
fn again_of(ids: u8, there: &[u8]) -> Vec<u8> {
    let distance = |id: &u8| there.iter().map(|other| id.abs_diff(*other)).min();
    let mut near: Vec<(u8, u8)> = (0..ids)
        .filter_map(|id| Some((distance(&id)?, id)))
        .filter(|(away, _)| (1..=NEARBY).contains(away))
        .collect();
    near.sort_unstable();
    let usual = there.is_empty().then_some(FACTORY_ID);
    near.into_iter().map(|(_, id)| id).take(MOST_AGAIN).chain(usual).collect()
}

/// What a device says it is: in the answer to a ping (Dynamixel 2.0) or in its first registers.
fn reading(protocol: Protocol, bytes: &[u8]) -> Option<Reading> {
    let word = |low: u8, high: u8| u16::from_le_bytes([low, high]);
    let (model_number, firmware) = match (protocol, bytes) {
        (Protocol::Dynamixel2, &[low, high, firmware]) => (word(low, high), firmware.into()),
        (Protocol::Dynamixel1, &[low, high, firmware, ..]) => (word(low, high), firmware.into()),
        (Protocol::FeetechSts, &[major, minor, _, first, second]) => {
            (word(first, second), word(minor, major))
        }
        (Protocol::FeetechScs, &[major, minor, _, first, second]) => {
            (word(second, first), word(minor, major))
        }
        _ => return None,
    };
    Some(Reading { protocol, model_number, firmware })
}
