//! Reading and writing the control table from the bus.
//!
//! - DYNAMIXEL 2.0 checks before it writes and answers with a number: an address that is not there,
//!   that cannot be written, or that is EEPROM under torque (of either axis, where two share a
//!   case) or by a Secondary ID, is an access error; a value outside its register's range a range
//!   error; outside a configured limit a limit error; part of an item a length error.
//! - DYNAMIXEL 1.0 writes bytes wherever they belong, also into half a word, and EEPROM under
//!   torque too, unless Lock(47) is 1, which only power-off takes back. Its errors are bits: a goal
//!   outside the angle limits is an angle limit error; all else that cannot be is a range error
//!   (the manual does not list what is): an address that is not there or read-only, a value out of
//!   range, locked EEPROM, a clockwise speed in joint mode. Reserved bytes within the table read as
//!   zero.
//! - A board's firmware (OpenCR's for the OP3) has a length error for what begins after the table, and no other: bytes that
//!   cannot be written stay, and bytes without meaning read as zero.
//! - FEETECH has no such errors: what cannot be done is left undone in silence. With Lock (55, SCS
//!   48) at 1 EEPROM takes writes, but power-off takes them back.
//!
//! A DYNAMIXEL write that covers several items does nothing if one of them is refused; the manuals
//! do not say.

use super::control::Fresh;
use super::{Event, Refusal, Servo};
use crate::table::Item;
use crate::world::TorqueSwitch;
use gaitway_profiles::{Access, Mode, Protocol, Region, Role};
use std::sync::Arc;

/// Profile registers hold at most this many milliseconds in a time-based profile.
const PROFILE_MS_MAX: i64 = 32_737;
/// Drive Mode(10).
const TORQUE_ON_BY_GOAL: i64 = 0x08;

impl Servo {
    /// Appends the bytes of the range to `out`.
    pub fn read(&mut self, address: u16, length: usize, out: &mut Vec<u8>) -> Result<(), Refusal> {
        self.refresh();
        self.read_range(address, length, out)?;
        if let Some(item) = self.model.role(Role::PresentPosition)
            && item.range().all(|at| self.shows(at, address, length))
        {
            self.told = self.value(Role::PresentPosition);
        }
        Ok(())
    }

    /// Whether a read from `address` on holds the byte at `at`, directly or indirectly.
    fn shows(&self, at: usize, address: u16, length: usize) -> bool {
        let range = usize::from(address)..usize::from(address) + length;
        if !self.model.touches_indirect(address, length) {
            return range.contains(&at);
        }
        let mut read = range.filter_map(|read| u16::try_from(read).ok());
        read.any(|read| self.behind(read) == at)
    }

    fn read_range(&self, address: u16, length: usize, out: &mut Vec<u8>) -> Result<(), Refusal> {
        let range = usize::from(address)..usize::from(address) + length;
        match self.model.protocol {
            Protocol::FeetechSts | Protocol::FeetechScs => {
                // Bytes without meaning, and those after the table, read as zero.
                out.extend(range.map(|at| self.table.get(at).copied().unwrap_or(0)));
                return Ok(());
            }
            Protocol::Dynamixel1 => {
                out.extend_from_slice(self.table.get(range).ok_or(Refusal::Range)?);
                return Ok(());
            }
            Protocol::Dynamixel2 if !self.model.has_shaft && range.start < self.table.len() => {
                out.extend(range.map(|at| self.table.get(at).copied().unwrap_or(0)));
                return Ok(());
            }
            Protocol::Dynamixel2 if length == 0 || !self.model.has_shaft => {
                return Err(Refusal::Length);
            }
            Protocol::Dynamixel2 => {}
        }
        if range.end > self.table.len() || range.clone().any(|at| self.item_at(at).is_none()) {
            return Err(Refusal::Access);
        }
        if !self.model.touches_indirect(address, length) {
            out.extend_from_slice(&self.table[range]);
            return Ok(());
        }
        for at in range {
            out.push(self.table[self.behind(at as u16)]);
        }
        Ok(())
    }

    fn item_at(&self, at: usize) -> Option<&Item> {
        self.model.at(u16::try_from(at).ok()?)
    }

    /// The address an indirect data byte stands for, or the address itself.
    fn behind(&self, address: u16) -> usize {
        let Some(pointer) = self.model.pointer_behind(address) else {
            return usize::from(address);
        };
        let Some(item) = self.model.at(pointer) else { return usize::from(address) };
        let target = item.decode(self.item_bytes(item)) as usize;
        if target < self.table.len() { target } else { usize::from(address) }
    }

    /// Writes the bytes from `address` on.
    pub fn write(&mut self, address: u16, bytes: &[u8], now_ns: u64) -> Result<(), Refusal> {
        self.advance(now_ns);
        let mut touched = Touched { mode_before: Some(self.mode()), ..Touched::default() };
        match self.model.protocol {
            Protocol::FeetechSts | Protocol::FeetechScs => {
                for (item, raw) in self.items_in(address, bytes) {
                    self.store_leniently(&item, raw, &mut touched);
                }
            }
            Protocol::Dynamixel1 => {
                if let Err(refusal) = self.check_bytes(address, bytes) {
                    self.shut_down_for(i64::from(refusal.status_bit()));
                    return Err(refusal);
                }
                for (item, raw) in self.items_in(address, bytes) {
                    self.store(&item, raw, &mut touched);
                }
            }
            Protocol::Dynamixel2 if !self.model.has_shaft => {
                if bytes.is_empty() || usize::from(address) >= self.table.len() {
                    return Err(Refusal::Length);
                }
                for (item, raw) in self.items_in(address, bytes) {
                    if item.access == Access::Rw {
                        self.store(&item, raw, &mut touched);
                    }
                }
            }
            Protocol::Dynamixel2 => {
                if bytes.is_empty() {
                    return Err(Refusal::Length);
                }
                self.check(address, bytes)?;
                if !self.model.touches_indirect(address, bytes.len()) {
                    self.commit(address, bytes, &mut touched);
                } else {
                    for (address, bytes) in self.runs(address, bytes) {
                        self.commit(address, &bytes, &mut touched);
                    }
                }
            }
        }
        self.settle(touched);
        Ok(())
    }

    /// What a write through indirect data writes: runs of consecutive addresses.
    fn runs(&self, address: u16, bytes: &[u8]) -> Vec<(u16, Vec<u8>)> {
        let mut runs: Vec<(u16, Vec<u8>)> = Vec::new();
        for (k, &byte) in bytes.iter().enumerate() {
            let target = self.behind(address.saturating_add(k as u16)) as u16;
            match runs.last_mut() {
                Some((start, run)) if usize::from(*start) + run.len() == usize::from(target) => {
                    run.push(byte);
                }
                _ => runs.push((target, vec![byte])),
            }
        }
        runs
    }

    /// Whether a strict servo would do this write.
    pub(super) fn check(&mut self, address: u16, bytes: &[u8]) -> Result<(), Refusal> {
        if !self.model.touches_indirect(address, bytes.len()) {
            return self.check_run(address, bytes);
        }
        for (address, bytes) in self.runs(address, bytes) {
            self.check_run(address, &bytes)?;
        }
        Ok(())
    }

    fn check_run(&mut self, address: u16, bytes: &[u8]) -> Result<(), Refusal> {
        let model = Arc::clone(&self.model);
        let mut at = usize::from(address);
        let mut rest = bytes;
        while !rest.is_empty() {
            let item = u16::try_from(at).ok().and_then(|at| model.at(at)).ok_or(Refusal::Access)?;
            if item.region == Region::Eeprom {
                self.events.push(Event::Eeprom { address: item.address });
            }
            if at != usize::from(item.address) {
                return Err(Refusal::Access);
            }
            let size = usize::from(item.bytes);
            if rest.len() < size {
                return Err(Refusal::Length);
            }
            let raw = item.decode(rest);
            if let Err(refusal) = self.check_item(item, raw) {
                if item.role == Some(Role::GoalPosition) {
                    self.note_goal(raw, false);
                }
                return Err(refusal);
            }
            at += size;
            rest = &rest[size..];
        }
        Ok(())
    }

    fn check_item(&self, item: &Item, raw: i64) -> Result<(), Refusal> {
        let closed =
            item.region == Region::Eeprom && (self.torque_on() || self.mate_torque || self.grouped);
        if item.access == Access::R || closed {
            return Err(Refusal::Access);
        }
        let frozen = match item.role {
            Some(Role::GoalPosition | Role::GoalVelocity | Role::GoalCurrent | Role::GoalPwm) => {
                true
            }
            Some(Role::BusWatchdog) => raw != 0,
            _ => false,
        };
        if frozen && self.watchdog_latched {
            return Err(Refusal::Range);
        }
        if !item.allows(raw) || !self.has_meaning(item, raw) {
            return Err(Refusal::Range);
        }
        let magnitude = |limit| self.value(limit).is_none_or(|limit| raw.abs() <= limit);
        let within = match item.role {
            Some(Role::GoalPosition) => self.within_position_limits(raw),
            Some(Role::GoalVelocity) => magnitude(Role::VelocityLimit),
            Some(Role::ProfileAcceleration) => magnitude(Role::AccelerationLimit),
            Some(Role::GoalCurrent) => magnitude(Role::CurrentLimit),
            Some(Role::GoalPwm) => magnitude(Role::PwmLimit),
            _ => true,
        };
        if within { Ok(()) } else { Err(Refusal::Limit) }
    }

    /// False for values inside the register's range that stand for nothing.
    fn has_meaning(&self, item: &Item, raw: i64) -> bool {
        match item.role {
            Some(Role::OperatingMode) => self.model.mode(raw).is_some(),
            Some(Role::ProfileVelocity | Role::ProfileAcceleration) => {
                self.drive_mode() & super::control::TIME_BASED == 0 || raw <= PROFILE_MS_MAX
            }
            _ => true,
        }
    }

    fn within_position_limits(&self, raw: i64) -> bool {
        let (min, max) = self.limits();
        self.mode() != Mode::Position || (min..=max).contains(&raw)
    }

    /// The items that bytes from `address` on touch, with the values they come to.
    fn items_in(&self, address: u16, bytes: &[u8]) -> Vec<(Item, i64)> {
        let (start, end) = (usize::from(address), usize::from(address) + bytes.len());
        let mut items = Vec::new();
        let mut at = start;
        while at < end.min(self.model.length) {
            let Some(&item) = self.item_at(at) else {
                at += 1;
                continue;
            };
            let range = item.range();
            let mut new = [0_u8; 4];
            new[..range.len()].copy_from_slice(&self.table[range.clone()]);
            for k in range.start.max(start)..range.end.min(end) {
                new[k - range.start] = bytes[k - start];
            }
            items.push((item, item.decode(&new)));
            at = range.end;
        }
        items
    }

    /// Whether a servo with protocol 1.0 would do this write.
    fn check_bytes(&mut self, address: u16, bytes: &[u8]) -> Result<(), Refusal> {
        let range = usize::from(address)..usize::from(address) + bytes.len();
        if bytes.is_empty() || range.clone().any(|at| self.item_at(at).is_none()) {
            return Err(Refusal::Range);
        }
        let locked = self.value(Role::EepromLock).is_some_and(|lock| lock != 0);
        for (item, raw) in self.items_in(address, bytes) {
            if item.region == Region::Eeprom {
                self.events.push(Event::Eeprom { address: item.address });
            }
            let closed = locked
                && (item.region == Region::Eeprom
                    || item.role == Some(Role::EepromLock) && raw == 0);
            let joint = matches!(self.mode(), Mode::Position | Mode::ExtendedPosition);
            let wrong_way = item.role == Some(Role::GoalVelocity) && joint && raw < 0;
            if item.access == Access::R || closed || !item.allows(raw) || wrong_way {
                return Err(Refusal::Range);
            }
            if item.role == Some(Role::GoalPosition) && !self.within_position_limits(raw) {
                self.note_goal(raw, false);
                return Err(Refusal::Limit);
            }
        }
        Ok(())
    }

    /// Writes a checked run.
    fn commit(&mut self, address: u16, bytes: &[u8], touched: &mut Touched) {
        let model = Arc::clone(&self.model);
        let mut at = usize::from(address);
        let mut rest = bytes;
        while let Some(item) = u16::try_from(at).ok().and_then(|at| model.at(at)) {
            let size = usize::from(item.bytes);
            if rest.len() < size {
                break;
            }
            self.store(item, item.decode(rest), touched);
            at += size;
            rest = &rest[size..];
        }
    }

    fn store_leniently(&mut self, item: &Item, raw: i64, touched: &mut Touched) {
        if item.region == Region::Eeprom {
            self.events.push(Event::Eeprom { address: item.address });
        }
        let allowed = item.access == Access::Rw
            && match item.role {
                // 0 free, 1 on, 2 damping, 128 "this is the middle".
                Some(Role::TorqueEnable) => matches!(raw, 0 | 1 | 2 | 128),
                _ => item.allows(raw) && self.has_meaning(item, raw),
            };
        if !allowed {
            if item.role == Some(Role::GoalPosition) {
                self.note_goal(raw, false);
            }
        } else if item.role == Some(Role::TorqueEnable) && raw == 128 {
            self.make_this_the_middle(touched);
        } else {
            self.store(item, raw, touched);
        }
    }

    /// STS; a servo without an offset register takes no notice.
    fn make_this_the_middle(&mut self, touched: &mut Touched) {
        let Some(item) = self.model.role(Role::HomingOffset).copied() else { return };
        let position = &self.model.profile.position;
        let (turn, middle) = (i64::from(position.counts), i64::from(position.zero_count));
        let offset = item.decode(self.item_bytes(&item)) + self.present_position() - middle;
        let within_a_turn = (offset + turn / 2).rem_euclid(turn) - turn / 2;
        let (low, high) = item.representable();
        self.events.push(Event::Eeprom { address: item.address });
        self.store(&item, within_a_turn.clamp(low, high), touched);
        self.note_turn();
        self.put_held(Role::GoalPosition, self.present_position());
    }

    /// Puts a value into the table and notes what follows from it.
    fn store(&mut self, item: &Item, raw: i64, touched: &mut Touched) {
        item.encode(raw, &mut self.table[item.range()]);
        if item.region == Region::Eeprom {
            let locked = self.value(Role::EepromLock).is_some_and(|lock| lock != 0);
            if !locked {
                self.persistent[item.range()].copy_from_slice(&self.table[item.range()]);
            }
        }
        match item.role {
            Some(Role::GoalPosition) => {
                touched.fresh.position = true;
                if self.follows_positions() && self.mode() != Mode::Step {
                    self.note_goal(raw, true);
                }
            }
            Some(Role::GoalVelocity) => {
                (touched.fresh.other, touched.fresh.pace) = (true, true);
            }
            Some(Role::GoalCurrent | Role::GoalPwm | Role::GoalTime) => {
                (touched.fresh.other, touched.drive) = (true, true);
            }
            Some(Role::ProfileVelocity | Role::ProfileAcceleration | Role::MaxSpeed) => {
                touched.fresh.pace = true;
            }
            Some(Role::TorqueEnable) => {
                if matches!(self.model.protocol, Protocol::FeetechSts | Protocol::FeetechScs) {
                    self.forget_overload();
                }
                touched.drive = true;
                // After a shutdown the torque stays off.
                if self.is_shut_down() {
                    self.put(Role::TorqueEnable, 0);
                }
            }
            Some(Role::TorqueLimit) => {
                if self.model.protocol == Protocol::Dynamixel1 {
                    self.forget_overload();
                }
                touched.drive = true;
            }
            Some(Role::BusWatchdog) => self.watchdog_latched = false,
            Some(Role::BaudRate | Role::ProtocolType) => self.case_changed = true,
            Some(
                Role::HomingOffset
                | Role::DriveMode
                | Role::Phase
                | Role::MinPositionLimit
                | Role::MaxPositionLimit
                | Role::ResolutionDivider
                | Role::AngularResolution,
            ) => touched.geometry = true,
            _ => touched.drive = true,
        }
    }

    /// What follows from a write once all its items are in: Feetech hosts write goal position and
    /// speed together, with the position first.
    fn settle(&mut self, touched: Touched) {
        let fresh = touched.fresh;
        let mode_changed = touched.mode_before.is_some_and(|before| before != self.mode());
        if mode_changed {
            self.change_mode();
        }
        if mode_changed || touched.drive {
            self.update_regulator();
        }
        let of_mode = if self.follows_positions() { fresh.position } else { fresh.other };
        self.goal_written |= of_mode;
        if of_mode && self.goal_brings_torque() && !self.torque_on() && !self.is_shut_down() {
            self.put(Role::TorqueEnable, 1);
        }
        self.follow_torque();
        if mode_changed && self.engaged {
            self.stand_still();
            self.pursue(Fresh { position: fresh.position, other: true, pace: true });
        } else if touched.geometry {
            self.note_turn();
            let position = fresh.position || self.mode() != Mode::Step;
            self.pursue(Fresh { position, ..fresh });
        } else if fresh != Fresh::default() {
            self.pursue(fresh);
        }
    }

    fn change_mode(&mut self) {
        self.goal_written = false;
        if self.model.protocol == Protocol::Dynamixel2 {
            self.mode_defaults();
            if self.mode() == Mode::Position {
                self.forget_turns();
            }
        }
        self.note_turn();
    }

    /// Drive Mode(10), bit 3; AX by its goal position; FEETECH if told so.
    fn goal_brings_torque(&self) -> bool {
        match self.model.protocol {
            Protocol::Dynamixel2 => self.drive_mode() & TORQUE_ON_BY_GOAL != 0,
            Protocol::Dynamixel1 => self.has_compliance() && self.follows_positions(),
            Protocol::FeetechSts | Protocol::FeetechScs => {
                self.torque_switch == TorqueSwitch::ComesWithGoal
            }
        }
    }
}

/// What a write changed.
#[derive(Clone, Copy, Debug, Default)]
struct Touched {
    mode_before: Option<Mode>,
    fresh: Fresh,
    /// What position counts mean.
    geometry: bool,
    /// Gains, limits or torque.
    drive: bool,
}
