//! Whole control tables: what a client calls its registers, against what the servo holds.
//!
//! A client names registers in words of its own; what the two sides share is address and size.

use crate::bench::{Bench, Lost};
use gaitway_profiles::{Access, Encoding, RegisterItem, Role, Servo};
use serde_json::Value;

/// A register as a client lists it.
#[derive(Clone, Debug)]
pub struct Listed {
    pub name: String,
    pub address: u16,
    pub size: u8,
    pub writable: bool,
    /// The client takes and gives values with their sign.
    pub signed: bool,
}

impl Listed {
    /// As the scripts print them: name, address, size, whether writable, whether signed.
    pub fn table(listed: Value) -> Vec<Listed> {
        let listed: Vec<(String, u16, u8, bool, bool)> =
            serde_json::from_value(listed).expect("a table");
        let named = |(name, address, size, writable, signed)| Listed {
            name,
            address,
            size,
            writable,
            signed,
        };
        listed.into_iter().map(named).collect()
    }
}

/// What a value looks like in its bytes, as an unsigned number.
pub fn in_bytes(encoding: Encoding, value: i64) -> u64 {
    let signed_by = |bit: u32| value.unsigned_abs() | if value < 0 { 1 << bit } else { 0 };
    match encoding {
        Encoding::SignMagnitude10 => signed_by(10),
        Encoding::SignMagnitude11 => signed_by(11),
        Encoding::SignMagnitude15 => signed_by(15),
        _ => value as u64 & ((1_u64 << (8 * u32::from(encoding.bytes()))) - 1),
    }
}

/// Registers that decide whether and how a servo is heard, or that change what other registers
/// hold; the scenarios try these one by one.
fn is_delicate(item: &RegisterItem<'_>) -> bool {
    const DELICATE: [Role; 13] = [
        Role::Id,
        Role::BaudRate,
        Role::StatusReturnLevel,
        Role::ReturnDelay,
        Role::HardwareError,
        Role::OperatingMode,
        Role::DriveMode,
        Role::TorqueEnable,
        Role::BusWatchdog,
        Role::EepromLock,
        Role::TemperatureLimit,
        Role::MinVoltageLimit,
        Role::MaxVoltageLimit,
    ];
    const BY_NAME: [&str; 3] = ["Secondary ID", "Secondary(Shadow) ID", "Protocol Type"];
    item.register.role.is_some_and(|role| DELICATE.contains(&role))
        || BY_NAME.contains(&item.register.name.as_str())
}

/// A legal value that is not the one most likely there anyway.
fn unlikely(item: &RegisterItem<'_>) -> i64 {
    const LIMITED: [Role; 4] =
        [Role::GoalPosition, Role::GoalVelocity, Role::GoalCurrent, Role::GoalPwm];
    let share = 17 + i64::from(item.address) % 61;
    if item.register.role.is_some_and(|role| LIMITED.contains(&role)) {
        // Other registers limit these; so much is always allowed.
        return 100 + share;
    }
    let (low, high) = item.register.range();
    let high = high.min(low.saturating_add(60_000));
    low + (high - low) * share / 100
}

/// Reads every register the client lists and compares; returns what the client lists otherwise than
/// the servo's profile does, in words.
pub fn read_all(
    bench: &Bench,
    joint: &str,
    servo: &Servo,
    listed: &[Listed],
    mut read: impl FnMut(&Listed) -> Result<i64, Lost>,
) -> Result<Vec<String>, Lost> {
    let mut otherwise = Vec::new();
    let mut compared = 0;
    for register in listed {
        let items = servo.items().collect::<Vec<_>>();
        let Some(item) = items
            .iter()
            .find(|item| item.address == register.address && item.register.bytes == register.size)
        else {
            otherwise.push(format!("{} at {}, {}", register.name, register.address, register.size));
            continue;
        };
        let name = item.name();
        let original = bench.register(joint, &name);
        let set = !is_delicate(item) && item.register.access == Access::Rw;
        if set {
            bench.set(joint, &name, unlikely(item));
        }
        // What is measured may change between two looks; then all between them is right.
        let before = bench.register(joint, &name);
        let seen = in_bytes(item.register.encoding, read(register)?);
        let after = bench.register(joint, &name);
        let there = [before, after].map(|value| in_bytes(item.register.encoding, value));
        let right = (there[0].min(there[1])..=there[0].max(there[1])).contains(&seen);
        assert!(right, "{joint}: {name} is {there:?}, {register:?} saw {seen}");
        // A limit would have a say in what comes after it.
        if set {
            bench.set(joint, &name, original);
        }
        compared += 1;
    }
    assert!(compared >= 15, "only {compared} registers of {joint} were compared");
    Ok(otherwise)
}

/// Writes every register the client lists as writable, and looks into the servo; returns what the
/// profile says cannot be written.
pub fn write_all(
    bench: &Bench,
    joint: &str,
    servo: &Servo,
    listed: &[Listed],
    mut write: impl FnMut(&Listed, i64) -> Result<(), Lost>,
) -> Result<Vec<String>, Lost> {
    let mut otherwise = Vec::new();
    let mut compared = 0;
    for register in listed.iter().filter(|register| register.writable) {
        let items = servo.items().collect::<Vec<_>>();
        let Some(item) = items
            .iter()
            .find(|item| item.address == register.address && item.register.bytes == register.size)
        else {
            continue;
        };
        if is_delicate(item) {
            continue;
        }
        if item.register.access == Access::R {
            otherwise.push(register.name.clone());
            continue;
        }
        let name = item.name();
        let (wanted, original) = (unlikely(item), bench.register(joint, &name));
        // Something else is there first, so that a write that does nothing is seen.
        bench.set(joint, &name, if wanted == original { wanted + 1 } else { original });
        let in_bytes = in_bytes(item.register.encoding, wanted) as i64;
        write(register, if register.signed { wanted } else { in_bytes })?;
        bench.assert_comes_to(joint, &name, wanted);
        bench.set(joint, &name, original);
        compared += 1;
    }
    assert!(compared >= 5, "only {compared} registers of {joint} were compared");
    Ok(otherwise)
}
