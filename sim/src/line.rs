//! A half-duplex serial line: who talks when, what is heard, what reaches the host.
//!
//! Ten bits to a byte. One event per packet: the bytes of one status become readable together, when
//! the last of them is complete, unless an adapter gathers them ([`crate::Usb`]). A wrong baud rate
//! makes bytes unreadable: servos ignore them, and a host that changed its rate while a status was
//! under way reads garbage. Two that talk at once spoil each other's bytes, except that equal
//! starts give the bitwise AND (idle is high, zero wins), so equal statuses pass unnoticed.

mod inbox;

use crate::adapter::Usb;
use crate::exchange::{Answer, Exchange, Order, Scan};
use crate::family::Family;
use crate::fault::plan::{Place, Plan};
use crate::fault::{Arrival, Damage, damage_at_host, damage_at_sender};
use crate::journal::{Asked, Happening, Journal};
use crate::referee::{Referee, When};
use crate::servo::{Event, Servo};
use crate::world::{BadChecksum, MissingInChain};
use gaitway_profiles::Role;
use inbox::{Inbox, Reception, Told};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use std::collections::VecDeque;
use std::path::PathBuf;

/// Between the slots of two IDs in the answer to a broadcast ping. The order is not documented;
/// this is the pause the makers' SDKs allow for each ID, so the latest they would wait for.
const SLOT_PAUSE_NS: u64 = 3_000_000;
/// What waits to be sent; more is lost, as in an overrun.
const WAITING_BYTES_MAX: usize = 1 << 16;

/// What all lines of a world share.
#[derive(Clone, Debug)]
pub(crate) struct Shared {
    pub line_timing: bool,
    /// World time follows real time, behind a door.
    pub real_time: bool,
    pub echo: bool,
    pub adapter_latency_ns: u64,
    pub usb: Option<Usb>,
    pub missing_in_chain: MissingInChain,
    pub bad_checksum: BadChecksum,
    pub faults: Plan,
    pub rng: ChaCha8Rng,
    pub referee: Referee,
    pub journal: Journal,
}

impl Shared {
    fn wire_ns(&self, bytes: usize, baud_bps: u32) -> u64 {
        if self.line_timing { bytes as u64 * 10_000_000_000 / u64::from(baud_bps) } else { 0 }
    }

    /// Something has happened in a joint's servo or actuator.
    pub fn tell(&mut self, joint: usize, when: When, event: Event) {
        let torque = match event {
            Event::TorqueOn { .. } => Some(true),
            Event::TorqueOff => Some(false),
            _ => None,
        };
        if let Some(on) = torque {
            self.journal.note(when.latest_ns, || Happening::Torque { joint, on });
        }
        self.referee.event(joint, when, event);
    }

    /// What befalls the `nth` status of a servo, which answers an instruction of `at_ns`.
    pub fn befall(&mut self, place: Place, nth: u64, at_ns: u64) -> Vec<Damage> {
        let Shared { faults, rng, journal, .. } = self;
        let damages = faults.strike_status(place, nth, at_ns, rng);
        for struck in faults.latest(damages.len()) {
            journal.note(at_ns, || Happening::Struck(struck.clone()));
        }
        damages
    }

    fn pause_ns(&self, pause_ns: u64) -> u64 {
        if self.line_timing { pause_ns } else { 0 }
    }
}

/// Time on the wire.
#[derive(Clone, Copy, Debug)]
struct Span {
    start_ns: u64,
    end_ns: u64,
}

impl Span {
    fn overlaps(self, other: Span) -> bool {
        self.start_ns < other.end_ns && other.start_ns < self.end_ns
    }
}

/// Host bytes on their way to the servos.
#[derive(Clone, Debug)]
struct Chunk {
    span: Span,
    bytes: Vec<u8>,
    baud_bps: u32,
    /// When the host may have begun to send them at the earliest.
    earliest_ns: u64,
}

impl Chunk {
    /// When something of it that ended at `end_ns` did. (What an earlier chunk at another speed
    /// left unfinished may seem to end before this one began.)
    fn when(&self, end_ns: u64) -> When {
        let earliest_ns = self.earliest_ns + end_ns.saturating_sub(self.span.start_ns);
        When { earliest_ns: earliest_ns.min(end_ns), latest_ns: end_ns }
    }
}

/// Whether and where a line's adapter is plugged in.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Plugged {
    pub now: bool,
    pub times: u32,
    /// What a door's link is to be called since.
    pub link: Option<PathBuf>,
}

/// A line that takes no more than so many bytes.
#[derive(Clone, Copy, Debug)]
struct Blocked {
    until_ns: u64,
    bytes: usize,
}

/// A packet among the bytes heard.
struct Heard {
    family: Family,
    start: usize,
    end: usize,
    /// Its checksum is right.
    sound: bool,
}

#[derive(Clone, Debug)]
pub(crate) struct Line {
    pub name: String,
    /// What the servos are set up for.
    pub baud_bps: u32,
    pub servos: Vec<Servo>,
    index: usize,
    sending: VecDeque<Chunk>,
    host_free_ns: u64,
    host_baud_bps: u32,
    /// Bytes heard of which some family has not yet made packets.
    heard: Vec<u8>,
    heard_end_ns: u64,
    /// How much of them each family is done with, in the order of [`Family::ALL`].
    done: [usize; Family::ALL.len()],
    inbox: Inbox,
    /// What the adapter holds bytes back beyond its gathering, ns.
    latency_ns: u64,
    pub plugged: Plugged,
    blocked: Option<Blocked>,
    /// The instruction carried out last.
    instruction: Vec<u8>,
    /// When the last status asked for so far would be over.
    window_end_ns: u64,
}

impl Line {
    pub fn new(index: usize, name: &str, baud_bps: u32, shared: &Shared) -> Line {
        Line {
            name: name.to_string(),
            baud_bps,
            servos: Vec::new(),
            index,
            sending: VecDeque::new(),
            host_free_ns: 0,
            host_baud_bps: baud_bps,
            heard: Vec::new(),
            heard_end_ns: 0,
            done: [0; Family::ALL.len()],
            inbox: Inbox::new(shared.usb),
            latency_ns: shared.adapter_latency_ns,
            plugged: Plugged { times: 1, now: true, link: None },
            blocked: None,
            instruction: Vec::new(),
            window_end_ns: 0,
        }
    }

    /// The host starts to send, after what it is sending already; it may have done so since
    /// `earliest_ns`. Returns how many bytes the line takes; fewer than there are if it is blocked.
    pub fn transmit(
        &mut self,
        (earliest_ns, now_ns): (u64, u64),
        bytes: &[u8],
        baud_bps: u32,
        shared: &mut Shared,
    ) -> usize {
        let queued: usize = self.sending.iter().map(|chunk| chunk.bytes.len()).sum();
        let lost = baud_bps == 0 || queued + bytes.len() > WAITING_BYTES_MAX || !self.plugged.now;
        if bytes.is_empty() || lost {
            return bytes.len();
        }
        let count = match self.blocked.as_mut().filter(|blocked| now_ns < blocked.until_ns) {
            None => bytes.len(),
            Some(blocked) => {
                let count = bytes.len().min(blocked.bytes);
                blocked.bytes -= count;
                count
            }
        };
        if count > 0 {
            self.send_from_host((earliest_ns, now_ns), &bytes[..count], baud_bps, shared);
        }
        count
    }

    fn send_from_host(
        &mut self,
        (earliest_ns, now_ns): (u64, u64),
        bytes: &[u8],
        baud_bps: u32,
        shared: &mut Shared,
    ) {
        let start_ns = now_ns.max(self.host_free_ns);
        // A line that is not free makes the bytes wait, whenever they came.
        let earliest_ns = if earliest_ns < now_ns { earliest_ns } else { start_ns };
        let end_ns = start_ns + shared.wire_ns(bytes.len(), baud_bps);
        let span = Span { start_ns, end_ns };
        self.host_free_ns = end_ns;
        self.collect(now_ns, &mut shared.rng);
        if baud_bps != self.host_baud_bps {
            self.host_baud_bps = baud_bps;
            self.heard.clear();
            self.done = [0; Family::ALL.len()];
        }
        shared.referee.busy(self.index, start_ns, end_ns);
        let mut bytes = bytes.to_vec();
        spoil(span, &mut bytes, &mut self.inbox.coming, &mut shared.rng);
        if shared.echo {
            let ready_ns = end_ns + self.latency_ns;
            let bytes = bytes.clone();
            let (from_servo, told) = (false, None);
            self.inbox.receive(Reception { span, ready_ns, bytes, baud_bps, from_servo, told });
        }
        self.sending.push_back(Chunk { span, bytes, baud_bps, earliest_ns });
    }

    /// The adapter hands over later from now on, or as the world's options say again.
    pub fn slow_down(&mut self, latency_ns: u64, usb: Option<Usb>) {
        self.latency_ns = latency_ns;
        self.inbox.usb = usb;
    }

    /// The adapter is pulled out; what the servos were told in time they do.
    pub fn pull_out(&mut self) {
        self.plugged.now = false;
        self.inbox.clear();
    }

    /// The adapter is plugged in again.
    pub fn plug_in(&mut self, link: Option<PathBuf>) {
        self.plugged.now = true;
        self.plugged.times += 1;
        self.plugged.link = link;
        self.inbox.clear();
    }

    /// From now on the line takes only so many bytes from the host.
    pub fn block(&mut self, until_ns: u64, bytes: usize) {
        self.blocked = Some(Blocked { until_ns, bytes });
    }

    /// The line takes everything again.
    pub fn unblock(&mut self) {
        self.blocked = None;
    }

    /// Until when the line takes no more bytes.
    pub fn blocked_until_ns(&self, now_ns: u64) -> Option<u64> {
        let blocked =
            self.blocked.filter(|blocked| now_ns < blocked.until_ns && blocked.bytes == 0);
        blocked.map(|blocked| blocked.until_ns)
    }

    /// When the servos have next heard all of what the host sent at once.
    pub fn next_hearing_ns(&self) -> Option<u64> {
        self.sending.front().map(|chunk| chunk.span.end_ns)
    }

    /// When bytes for the host become readable next.
    pub fn next_ready_ns(&self) -> Option<u64> {
        self.inbox.next_ready_ns()
    }

    /// The servos hear the host's next chunk and act on the packets in it.
    pub fn hear_next(&mut self, shared: &mut Shared) {
        let Some(chunk) = self.sending.pop_front() else { return };
        for (done, family) in self.done.iter_mut().zip(Family::ALL) {
            if chunk.span.start_ns > self.heard_end_ns + family.gap_ns() {
                *done = self.heard.len();
            }
        }
        self.judge_turn(chunk.span.start_ns, shared);
        self.heard.extend_from_slice(&chunk.bytes);
        self.heard_end_ns = chunk.span.end_ns;
        let mut last_end = 0;
        while let Some(heard) = self.next_packet(shared.bad_checksum) {
            let packet = self.heard[heard.start..heard.end].to_vec();
            let rest = self.heard.len() - heard.end;
            let end_ns = chunk.span.end_ns - shared.wire_ns(rest, chunk.baud_bps);
            // What two families understand was said once.
            if heard.end > last_end {
                last_end = heard.end;
                shared.referee.instruction(self.index, chunk.when(end_ns));
                // At a speed that no servo here is set to, nobody was asked.
                let at_their_speed =
                    |servo: &Servo| heard.family.includes(servo) && servo.is_set_to(chunk.baud_bps);
                if self.servos.iter().any(at_their_speed) {
                    let asked = || Happening::Asked(Asked::of(self.index, heard.family, &packet));
                    shared.journal.note(end_ns, asked);
                }
                self.inbox.asked_again();
            }
            self.carry_out(&heard, &packet, chunk.when(end_ns), chunk.baud_bps, shared);
            if rest > 0 {
                self.judge_turn(end_ns, shared);
            }
            let span = Span { start_ns: end_ns, end_ns: chunk.span.end_ns };
            spoil(span, &mut self.heard[heard.end..], &mut self.inbox.coming, &mut shared.rng);
        }
        let done = self.done.iter().copied().min().unwrap_or(0);
        self.heard.drain(..done);
        self.done = self.done.map(|at| at - done);
    }

    /// The packet that ends first among those the line's servos make of what they heard.
    fn next_packet(&mut self, bad_checksum: BadChecksum) -> Option<Heard> {
        let mut next: Option<(usize, Heard)> = None;
        for (k, family) in Family::ALL.into_iter().enumerate() {
            let done = &mut self.done[k];
            if !self.servos.iter().any(|servo| family.includes(servo)) {
                *done = self.heard.len();
            }
            let heard = loop {
                let complains = bad_checksum == BadChecksum::Answer && family != Family::Feetech;
                match family.scan(&self.heard[*done..]) {
                    Scan::Incomplete => break None,
                    Scan::Skip(bytes) => *done += bytes,
                    Scan::Spoilt(_) if !complains => *done += 1,
                    Scan::Packet(bytes) => break Some((bytes, true)),
                    Scan::Spoilt(bytes) => break Some((bytes, false)),
                }
            };
            let Some((bytes, sound)) = heard else { continue };
            let heard = Heard { family, start: *done, end: *done + bytes, sound };
            if next.as_ref().is_none_or(|(_, first)| heard.end < first.end) {
                next = Some((k, heard));
            }
        }
        let (k, heard) = next?;
        self.done[k] = heard.end;
        Some(heard)
    }

    /// The host talks from `start_ns` on: is it its turn? In real time that cannot be judged: when
    /// the operating system wakes the door late, the host has rightly given up by then.
    fn judge_turn(&self, start_ns: u64, shared: &mut Shared) {
        if shared.line_timing && !shared.real_time && start_ns < self.window_end_ns {
            shared.referee.talked_early(self.index, start_ns, self.window_end_ns);
        }
    }

    fn carry_out(
        &mut self,
        heard: &Heard,
        packet: &[u8],
        when: When,
        baud_bps: u32,
        shared: &mut Shared,
    ) {
        let end_ns = when.latest_ns;
        for index in 0..self.servos.len() {
            if let Some(mate) = self.servos[index].mate {
                self.servos[index].mate_torque = self.servos[mate].torque_on();
            }
        }
        for servo in self.servos.iter_mut().filter(|servo| heard.family.includes(servo)) {
            servo.hears = servo.can_hear(end_ns, baud_bps);
            if servo.hears {
                servo.heard(end_ns);
            }
        }
        let exchange = if heard.sound {
            heard.family.answer(packet, &mut self.servos, end_ns)
        } else {
            heard.family.complain(packet, &mut self.servos)
        };
        self.share_cases();
        self.instruction.clear();
        self.instruction.extend_from_slice(packet);
        self.report(when, shared);
        self.say(exchange, end_ns, baud_bps, shared);
    }

    /// Two axes in one case have one line speed and one protocol.
    fn share_cases(&mut self) {
        for index in 0..self.servos.len() {
            let changed = std::mem::take(&mut self.servos[index].case_changed);
            let Some(mate) = self.servos[index].mate.filter(|_| changed) else { continue };
            for role in [Role::BaudRate, Role::ProtocolType] {
                if let Some(raw) = self.servos[index].value(role) {
                    self.servos[mate].set_up(role, raw);
                }
            }
        }
    }

    /// Hands what happened in the servos to the referee.
    pub fn report(&mut self, when: When, shared: &mut Shared) {
        for servo in &mut self.servos {
            for event in servo.events.drain(..) {
                if let Some(joint) = servo.joint {
                    shared.tell(joint, when, event);
                }
            }
        }
    }

    /// Gives the answers their times and sends them to the host.
    fn say(&mut self, mut exchange: Exchange, at_ns: u64, baud_bps: u32, shared: &mut Shared) {
        let damages = self.draw_damages(&mut exchange, at_ns, shared);
        // Who finds one status damaged may not make out those behind it.
        let sound = damages.iter().all(Vec::is_empty);
        let order = exchange.order;
        let mut clock = ReplyClock::new(order, at_ns);
        let mut expected = ReplyClock::new(order, at_ns);
        let mut broken = false;
        for (k, answer) in exchange.answers.iter().enumerate() {
            let wire_ns = shared.wire_ns(answer.length, baud_bps);
            let pause_ns = shared.pause_ns(answer.delay_ns);
            let slot_ns = shared.pause_ns(wire_ns + SLOT_PAUSE_NS) * u64::from(answer.id);
            expected.next(answer, wire_ns, pause_ns, slot_ns);
            let Some(servo) = answer.servo else {
                match (order, shared.missing_in_chain) {
                    (Order::Chained, MissingInChain::AnswerAfter { gap_ns }) => {
                        clock.end_ns += shared.pause_ns(gap_ns);
                    }
                    (Order::Chained | Order::Merged, _) => broken = true,
                    _ => {}
                }
                continue;
            };
            if broken {
                continue;
            }
            // Asked again within its return delay, it says one after the other. What a servo does that waits for
            // its turn among others is not known: it answers at once.
            let is_alone = order == Order::Together;
            clock.free_ns = if is_alone { self.servos[servo].speaks_until_ns } else { 0 };
            let span = clock.next(answer, wire_ns, pause_ns, slot_ns);
            if is_alone {
                self.servos[servo].speaks_until_ns = span.end_ns;
            }
            self.servos[servo].statuses += 1;
            shared.referee.status(self.index, span.start_ns, span.end_ns);
            let damages = damages.get(k).map_or(&[][..], Vec::as_slice);
            let told = self.told_by(servo, at_ns, &mut shared.referee).filter(|_| sound);
            let (id, bytes) = (answer.id, answer.bytes.clone());
            self.send(id, bytes, (span, told), baud_bps, damages, shared);
        }
        self.servos.iter_mut().for_each(|servo| servo.told = None);
        self.window_end_ns = self.window_end_ns.max(expected.end_ns);
    }

    /// The position that a servo tells in the answer it gives now.
    fn told_by(&mut self, servo: usize, at_ns: u64, referee: &mut Referee) -> Option<Told> {
        let servo = &mut self.servos[servo];
        let (raw, joint) = (servo.told.take()?, servo.joint?);
        referee.measured(joint, at_ns, raw);
        Some(Told { joint, measured_ns: at_ns })
    }

    /// What befalls each answer; what the servos do wrong themselves is done here.
    fn draw_damages(
        &mut self,
        exchange: &mut Exchange,
        at_ns: u64,
        shared: &mut Shared,
    ) -> Vec<Vec<Damage>> {
        if shared.faults.spares_statuses() {
            return Vec::new();
        }
        let mut all = Vec::with_capacity(exchange.answers.len());
        for k in 0..exchange.answers.len() {
            let Some(index) = exchange.answers[k].servo else {
                all.push(Vec::new());
                continue;
            };
            let servo = &self.servos[index];
            let family = Family::of(servo.model.protocol);
            let place = Place { line: self.index, servo: index };
            let damages = shared.befall(place, servo.statuses, at_ns);
            for &damage in &damages {
                damage_at_sender(family, exchange, k, damage);
            }
            if exchange.answers[k].servo.is_none() {
                // It was its turn, though nothing was sent.
                self.servos[index].statuses += 1;
            }
            all.push(damages);
        }
        all
    }

    fn send(
        &mut self,
        id: u8,
        bytes: Vec<u8>,
        (span, told): (Span, Option<Told>),
        baud_bps: u32,
        damages: &[Damage],
        shared: &mut Shared,
    ) {
        let mut arrival = Arrival { bytes, copies: 1, late_ns: 0 };
        for &damage in damages {
            damage_at_host(&mut arrival, damage, &self.instruction, &mut shared.rng);
        }
        shared.journal.note(span.end_ns, || {
            let (line, bytes) = (self.index, arrival.bytes.clone());
            Happening::Answered { line, id, bytes }
        });
        let ready_ns = span.end_ns + self.latency_ns + arrival.late_ns;
        let mut reception =
            Reception { span, ready_ns, bytes: arrival.bytes, baud_bps, from_servo: true, told };
        for chunk in &mut self.sending {
            collide(chunk.span, &mut chunk.bytes, &mut reception, &mut shared.rng);
        }
        for other in self.inbox.coming.iter_mut().filter(|other| other.from_servo) {
            if other.span.start_ns == span.start_ns && other.span.overlaps(span) {
                join_equal_starts(&mut other.bytes, &mut reception.bytes);
                (other.told, reception.told) = (None, None);
            } else {
                collide(other.span, &mut other.bytes, &mut reception, &mut shared.rng);
            }
        }
        if !self.plugged.now {
            return;
        }
        let instant = Span { start_ns: span.end_ns, end_ns: span.end_ns };
        for _ in 1..arrival.copies {
            self.inbox.receive(Reception { span: instant, ..reception.clone() });
        }
        self.inbox.receive(reception);
    }

    /// Moves what has come by `now_ns` to where the host reads it; returns how much waits there.
    pub fn collect(&mut self, now_ns: u64, rng: &mut ChaCha8Rng) -> usize {
        self.inbox.collect(now_ns, self.host_baud_bps, rng)
    }

    /// Takes readable bytes.
    pub fn take(&mut self, buf: &mut [u8], now_ns: u64, referee: &mut Referee) -> usize {
        self.inbox.take(buf, |told| referee.had(told.joint, told.measured_ns, now_ns))
    }

    pub fn discard_ready(&mut self) {
        self.inbox.discard_ready();
    }
}

/// Where on the time axis the next answer goes.
struct ReplyClock {
    order: Order,
    asked_ns: u64,
    last_start_ns: u64,
    end_ns: u64,
    /// Before that the servo that is next has no transmitter to spare.
    free_ns: u64,
}

impl ReplyClock {
    fn new(order: Order, asked_ns: u64) -> ReplyClock {
        ReplyClock { order, asked_ns, last_start_ns: asked_ns, end_ns: asked_ns, free_ns: 0 }
    }

    fn next(&mut self, answer: &Answer, wire_ns: u64, pause_ns: u64, slot_ns: u64) -> Span {
        let start_ns = match self.order {
            _ if answer.twin => self.last_start_ns,
            Order::Together => self.asked_ns + pause_ns,
            Order::Slots => self.asked_ns + slot_ns + pause_ns,
            Order::Chained => self.end_ns + pause_ns,
            // Only the first waits; the others go on without a pause.
            Order::Merged if self.end_ns == self.asked_ns => self.asked_ns + pause_ns,
            Order::Merged => self.end_ns,
        };
        let start_ns = start_ns.max(self.free_ns);
        self.last_start_ns = start_ns;
        self.end_ns = self.end_ns.max(start_ns + wire_ns);
        Span { start_ns, end_ns: start_ns + wire_ns }
    }
}

/// Host bytes and the statuses that are on the wire at the same time spoil each other.
fn spoil(span: Span, bytes: &mut [u8], coming: &mut VecDeque<Reception>, rng: &mut ChaCha8Rng) {
    for reception in coming.iter_mut().filter(|reception| reception.from_servo) {
        collide(span, bytes, reception, rng);
    }
}

fn collide(span: Span, bytes: &mut [u8], reception: &mut Reception, rng: &mut ChaCha8Rng) {
    if span.overlaps(reception.span) {
        reception.told = None;
        garble(span, bytes, reception.span, rng);
        garble(reception.span, &mut reception.bytes, span, rng);
    }
}

/// Changes the bytes of `span` that fall into `other`.
fn garble(span: Span, bytes: &mut [u8], other: Span, rng: &mut ChaCha8Rng) {
    let count = bytes.len();
    let total_ns = u128::from(span.end_ns - span.start_ns).max(1);
    let place = |at_ns: u64| {
        u128::from(at_ns.clamp(span.start_ns, span.end_ns) - span.start_ns) * count as u128
    };
    let first = (place(other.start_ns) / total_ns) as usize;
    let last = (place(other.end_ns).div_ceil(total_ns) as usize).min(count);
    for byte in &mut bytes[first.min(last)..last] {
        *byte ^= rng.random_range(1..=255_u8);
    }
}

/// Two that start together: where one sends zero the line is low. The host hears one byte for both;
/// what the other says beyond the first's end is left in it.
fn join_equal_starts(one: &mut [u8], other: &mut Vec<u8>) {
    for (a, b) in one.iter_mut().zip(&*other) {
        *a &= b;
    }
    other.drain(..one.len().min(other.len()));
}
