//! Reading and writing the control table from the bus.
//!
//! DYNAMIXEL checks before it writes and answers with a number: an address that is not there, that
//! cannot be written or that is EEPROM under torque is an access error; a value outside its
//! register's range a range error; outside a configured limit a limit error; part of an item a
//! length error. A write that covers several items does nothing if one of them is refused (the
//! manual does not say). Feetech has no such errors: what cannot be done is left undone in silence.

use super::{Event, Refusal, Servo};
use crate::table::Item;
use gaitway_profiles::{Access, Protocol, Region, Role};
use std::sync::Arc;

impl Servo {
    /// Appends the bytes of the range to `out`.
    pub fn read(&mut self, address: u16, length: usize, out: &mut Vec<u8>) -> Result<(), Refusal> {
        self.refresh();
        let range = usize::from(address)..usize::from(address) + length;
        if self.model.protocol == Protocol::FeetechSts {
            // Bytes without meaning, and those after the table, read as zero.
            out.extend(range.map(|at| self.table.get(at).copied().unwrap_or(0)));
            return Ok(());
        }
        if length == 0 {
            return Err(Refusal::Length);
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
        if self.model.protocol == Protocol::FeetechSts {
            self.write_leniently(address, bytes);
            return Ok(());
        }
        if bytes.is_empty() {
            return Err(Refusal::Length);
        }
        self.check(address, bytes)?;
        let mut touched = Touched::default();
        if !self.model.touches_indirect(address, bytes.len()) {
            self.commit(address, bytes, &mut touched);
        } else {
            for (address, bytes) in self.runs(address, bytes) {
                self.commit(address, &bytes, &mut touched);
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
                    self.events.push(Event::Goal { raw, accepted: false });
                }
                return Err(refusal);
            }
            at += size;
            rest = &rest[size..];
        }
        Ok(())
    }

    fn check_item(&self, item: &Item, raw: i64) -> Result<(), Refusal> {
        if item.access == Access::R || item.region == Region::Eeprom && self.torque_on() {
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
        if item.min.is_some_and(|min| raw < min) || item.max.is_some_and(|max| raw > max) {
            return Err(Refusal::Range);
        }
        let magnitude = |limit| self.value(limit).is_none_or(|limit| raw.abs() <= limit);
        let within = match item.role {
            Some(Role::GoalPosition) => self.within_position_limits(raw),
            Some(Role::GoalVelocity) => magnitude(Role::VelocityLimit),
            Some(Role::GoalCurrent) => magnitude(Role::CurrentLimit),
            Some(Role::GoalPwm) => magnitude(Role::PwmLimit),
            _ => true,
        };
        if within { Ok(()) } else { Err(Refusal::Limit) }
    }

    fn within_position_limits(&self, raw: i64) -> bool {
        // Min and Max Position Limit hold in position mode (3) only.
        self.value(Role::OperatingMode).is_some_and(|mode| mode != 3)
            || self.value(Role::MinPositionLimit).is_none_or(|min| raw >= min)
                && self.value(Role::MaxPositionLimit).is_none_or(|max| raw <= max)
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

    /// Feetech: any bytes may be written; each item takes its share if it can.
    fn write_leniently(&mut self, address: u16, bytes: &[u8]) {
        let model = Arc::clone(&self.model);
        let mut touched = Touched::default();
        let (start, end) = (usize::from(address), usize::from(address) + bytes.len());
        let mut at = start;
        while at < end.min(model.length) {
            let Some(item) = model.at(at as u16) else {
                at += 1;
                continue;
            };
            let range = item.range();
            let mut new = [0_u8; 4];
            new[..range.len()].copy_from_slice(&self.table[range.clone()]);
            for k in range.start.max(start)..range.end.min(end) {
                new[k - range.start] = bytes[k - start];
            }
            self.store_leniently(item, item.decode(&new), &mut touched);
            at = range.end;
        }
        self.settle(touched);
    }

    fn store_leniently(&mut self, item: &Item, raw: i64, touched: &mut Touched) {
        if item.region == Region::Eeprom {
            self.events.push(Event::Eeprom { address: item.address });
        }
        let allowed = item.access == Access::Rw
            && match item.role {
                // 0 free, 1 on, 2 damping, 128 "this is the middle".
                Some(Role::TorqueEnable) => matches!(raw, 0 | 1 | 2 | 128),
                _ => item.min.is_none_or(|min| raw >= min) && item.max.is_none_or(|max| raw <= max),
            };
        if !allowed {
            if item.role == Some(Role::GoalPosition) {
                self.events.push(Event::Goal { raw, accepted: false });
            }
        } else if item.role == Some(Role::TorqueEnable) && raw == 128 {
            self.make_this_the_middle(touched);
        } else {
            self.store(item, raw, touched);
        }
    }

    fn make_this_the_middle(&mut self, touched: &mut Touched) {
        let Some(item) = self.model.role(Role::HomingOffset).copied() else { return };
        let middle = i64::from(self.model.profile.position.zero_count);
        let old = item.decode(self.item_bytes(&item));
        let (low, high) = item.representable();
        self.events.push(Event::Eeprom { address: item.address });
        self.store(&item, (old + self.present_position() - middle).clamp(low, high), touched);
        self.put(Role::GoalPosition, self.present_position());
    }

    /// Puts a value into the table and notes what follows from it.
    fn store(&mut self, item: &Item, raw: i64, touched: &mut Touched) {
        let old = item.decode(self.item_bytes(item));
        item.encode(raw, &mut self.table[item.range()]);
        if item.region == Region::Eeprom {
            let locked = self.value(Role::EepromLock).is_some_and(|lock| lock != 0);
            if !locked {
                self.persistent[item.range()].copy_from_slice(&self.table[item.range()]);
            }
        }
        match item.role {
            Some(Role::GoalPosition) => {
                touched.goal = true;
                self.events.push(Event::Goal { raw, accepted: true });
            }
            // After a shutdown only a reboot brings the torque back.
            Some(Role::TorqueEnable) if self.is_shut_down() => self.put(Role::TorqueEnable, 0),
            Some(Role::TorqueEnable) => touched.torque = Some((old, raw)),
            Some(Role::BusWatchdog) => self.watchdog_latched = false,
            Some(Role::OperatingMode) => touched.mode = raw != old,
            Some(Role::HomingOffset | Role::DriveMode) => touched.geometry = true,
            _ => touched.drive = true,
        }
    }

    /// What follows from a write once all its items are in: Feetech hosts write goal position and
    /// speed together, with the position first.
    fn settle(&mut self, touched: Touched) {
        if touched.mode && self.model.protocol == Protocol::Dynamixel2 {
            self.mode_defaults();
        }
        if touched.mode || touched.drive {
            self.update_drive();
        }
        // Drive Mode(10), bit 3: a new goal brings the torque on.
        let wakes = touched.goal && self.drive_mode() & 0x08 != 0 && !self.torque_on();
        if wakes {
            self.put(Role::TorqueEnable, 1);
        }
        if let Some((old, new)) = touched.torque.or(wakes.then_some((0, 1))) {
            self.switch_torque(old != 0, new != 0);
        }
        if (touched.goal || touched.geometry) && self.torque_on() && !self.watchdog_latched {
            self.pursue_goal();
        }
    }
}

/// What a write changed.
#[derive(Clone, Copy, Debug, Default)]
struct Touched {
    goal: bool,
    torque: Option<(i64, i64)>,
    mode: bool,
    geometry: bool,
    drive: bool,
}
