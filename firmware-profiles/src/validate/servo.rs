//! Rules for servos: the control table must be one a device could have.

use super::{Verdict, header, not_empty, positive, unique};
use crate::counted::counted;
use crate::error::{Faults, ProfileError};
use crate::schema::{Access, Baud, FirmwareRange, Mode, Protocol, Register, Role, Servo};
use std::collections::BTreeSet;

/// Registers that the driver and the virtual servo cannot do without.
const REQUIRED: [Role; 11] = [
    Role::ModelNumber,
    Role::FirmwareVersion,
    Role::Id,
    Role::BaudRate,
    Role::MinPositionLimit,
    Role::MaxPositionLimit,
    Role::TorqueEnable,
    Role::GoalPosition,
    Role::PresentPosition,
    Role::PresentVelocity,
    Role::PresentVoltage,
];

const REQUIRED_OF_DYNAMIXEL_1: &[Role] =
    &[Role::ReturnDelay, Role::StatusReturnLevel, Role::GoalVelocity, Role::TorqueLimit];
const REQUIRED_OF_DYNAMIXEL_2: &[Role] = &[
    Role::ReturnDelay,
    Role::StatusReturnLevel,
    Role::OperatingMode,
    Role::HardwareError,
    Role::ProfileVelocity,
    Role::ProfileAcceleration,
];
/// The XL-320 speaks Protocol 2.0 over a table in the manner of 1.0, which has a torque limit.
const REQUIRED_OF_OLD_TABLE: &[Role] = &[
    Role::ReturnDelay,
    Role::StatusReturnLevel,
    Role::OperatingMode,
    Role::HardwareError,
    Role::GoalVelocity,
];
const REQUIRED_OF_STS: &[Role] = &[
    Role::ReturnDelay,
    Role::StatusReturnLevel,
    Role::OperatingMode,
    Role::HardwareError,
    Role::FirmwareVersionMinor,
    Role::EepromLock,
];
const REQUIRED_OF_SCS: &[Role] = &[Role::FirmwareVersionMinor, Role::EepromLock];

/// Of the required ones, those that must accept a write.
const WRITABLE: [Role; 3] = [Role::Id, Role::TorqueEnable, Role::GoalPosition];

pub(crate) fn servo(file: &str, servo: &Servo) -> Verdict {
    let mut faults = Faults::default();
    faults.note(header(file, servo.schema, &servo.name));
    for (key, text) in [("model", &servo.model), ("maker", &servo.maker), ("manual", &servo.manual)]
    {
        faults.note(not_empty(file, key, text));
    }
    faults.note(facts(file, servo));
    faults.note(instructions(file, servo));
    table(file, servo.protocol, &servo.registers, &mut faults);
    // What follows looks at the table as a whole.
    if faults.count() == 0 {
        let names = servo.items().map(|item| item.name());
        faults.note(unique(file, "register name", "register", names));
        faults.note(roles(file, servo));
        faults.note(modes(file, servo));
        faults.note(baud(file, &servo.baud, servo.register(Role::BaudRate)));
    }
    faults.verdict()
}

/// Each register by itself, and one after the other.
pub(super) fn table(file: &str, protocol: Protocol, registers: &[Register], faults: &mut Faults) {
    let mut table_end = 0;
    for register in registers {
        faults.note(one_register(file, protocol, register));
        if u32::from(register.address) < table_end {
            faults.note(Err(ProfileError::new(file, "registers overlap or are out of order")
                .at(place(register))
                .got(format!("address {}", register.address))
                .allowed(format!("{table_end} or higher: the register before ends there"))));
        }
        table_end = end(register);
    }
}

pub(super) fn firmware(file: &str, range: FirmwareRange) -> Verdict {
    if range.max.is_some_and(|max| max < range.min) {
        return Err(ProfileError::new(file, "the firmware range is upside down")
            .at("firmware")
            .got(format!("{}..{}", range.min, range.max.unwrap_or_default())));
    }
    Ok(())
}

fn facts(file: &str, servo: &Servo) -> Verdict {
    firmware(file, servo.firmware)?;
    let position = &servo.position;
    not_empty(file, "position.source", &position.source)?;
    if position.counts == 0 || position.degrees == 0 {
        return Err(ProfileError::new(file, "the encoder has no scale")
            .at("position")
            .got(format!(
                "{} in {}",
                counted(position.counts, "count"),
                counted(position.degrees, "degree")
            ))
            .allowed("both above 0"));
    }
    let lowest = i64::from(position.lowest_count);
    let highest = lowest + i64::from(position.counts) - 1;
    if !(lowest..=highest).contains(&i64::from(position.zero_count)) {
        return Err(ProfileError::new(file, "angle zero lies outside the encoder's span")
            .at("position.zero_count")
            .got(position.zero_count)
            .allowed(format!("{lowest}..{highest}")));
    }
    let motor = &servo.motor;
    not_empty(file, "motor.source", &motor.source)?;
    for (key, value) in [
        ("no_load_speed_rad_s", motor.no_load_speed_rad_s),
        ("stall_torque_nm", motor.stall_torque_nm),
        ("stall_current_a", motor.stall_current_a),
        ("voltage_v", motor.voltage_v),
    ] {
        positive(file, || format!("motor.{key}"), value)?;
    }
    for bit in &servo.error_bits {
        not_empty(file, "error_bit.name", &bit.name)?;
        if bit.bit > 7 {
            return Err(ProfileError::new(file, "the error register has eight bits")
                .at("error_bit.bit")
                .got(bit.bit)
                .allowed("0..7"));
        }
    }
    unique(file, "error bit", "error_bit", servo.error_bits.iter().map(|bit| bit.bit))?;
    error_codes(file, servo)
}

fn error_codes(file: &str, servo: &Servo) -> Verdict {
    let refuse = |what: &str| ProfileError::new(file, what).at("error_code");
    if !servo.error_codes.is_empty() && !servo.error_bits.is_empty() {
        return Err(refuse("an error register holds bits or one code")
            .got("both error_bit and error_code")
            .allowed("one of them"));
    }
    for code in &servo.error_codes {
        not_empty(file, "error_code.name", &code.name)?;
        if code.value == 0 {
            return Err(refuse("0 says that there is no error").got(0).allowed("1..255"));
        }
    }
    unique(file, "error code", "error_code", servo.error_codes.iter().map(|code| code.value))
}

/// Of the optional questions, only those the protocol has.
fn instructions(file: &str, servo: &Servo) -> Verdict {
    let later = [
        ("fast_sync_read_from_firmware", servo.fast_sync_read_from_firmware.is_some()),
        ("clear_from_firmware", servo.clear_from_firmware.is_some()),
        ("backup_from_firmware", servo.backup_from_firmware.is_some()),
    ];
    for (key, says) in later.into_iter().chain([("bulk_read", servo.bulk_read)]) {
        let protocol = if key == "bulk_read" { Protocol::Dynamixel1 } else { Protocol::Dynamixel2 };
        if says && servo.protocol != protocol {
            return Err(ProfileError::new(file, "the servo's protocol knows no such question")
                .at(key)
                .got(format!("{:?}", servo.protocol))
                .allowed(format!("{protocol:?} only")));
        }
    }
    Ok(())
}

fn one_register(file: &str, protocol: Protocol, register: &Register) -> Verdict {
    let refuse = |what: &str| ProfileError::new(file, what).at(place(register));
    not_empty(file, &place(register), &register.name)?;
    if register.source.trim().is_empty() {
        return Err(refuse("the register does not say where it is written")
            .got("an empty source")
            .allowed("a section of the manual, `measured DATE, UNIT` or `unconfirmed: why`"));
    }
    if register.bytes != register.encoding.bytes() {
        return Err(refuse("the size does not go with the encoding")
            .got(format!("{}, encoding {:?}", counted(register.bytes, "byte"), register.encoding))
            .allowed(counted(register.encoding.bytes(), "byte")));
    }
    if register.repeat == Some(0) || (register.repeat.is_none() && register.first.is_some()) {
        return Err(refuse("a repeated register is one or more items, counted from `first`")
            .got(format!("repeat {:?}, first {:?}", register.repeat, register.first))
            .allowed("`first` only with `repeat`, and `repeat` 1 or more"));
    }
    // Addresses are two bytes in Dynamixel packets, one byte in Feetech packets.
    let table_limit = match protocol {
        Protocol::Dynamixel2 => 0xFFFF,
        Protocol::Dynamixel1 | Protocol::FeetechSts | Protocol::FeetechScs => 0x100,
    };
    if end(register) > table_limit {
        return Err(refuse("the register lies beyond the addresses of the protocol")
            .got(format!("end at {}", end(register)))
            .allowed(format!("end at {table_limit} or before")));
    }
    if let Some(scale) = register.scale {
        positive(file, || format!("{}, scale", place(register)), scale)?;
    }
    raw_values(file, register)
}

fn raw_values(file: &str, register: &Register) -> Verdict {
    let refuse = |what: &str| ProfileError::new(file, what).at(place(register));
    let (lowest, highest) = register.encoding.range();
    for (key, value) in [("min", register.min), ("max", register.max)] {
        if let Some(value) = value.filter(|value| !(lowest..=highest).contains(value)) {
            return Err(refuse("the encoding cannot hold this value")
                .got(format!("{key} = {value}"))
                .allowed(format!("{lowest}..{highest}")));
        }
    }
    let (min, max) = register.range();
    if min > max {
        return Err(refuse("the range is upside down").got(format!("min {min} > max {max}")));
    }
    let last = register.item_count().checked_sub(1).and_then(|index| register.item(index));
    for item in register.item(0).into_iter().chain(last) {
        if let Some(initial) = item.initial().filter(|initial| !(min..=max).contains(initial)) {
            return Err(refuse("the initial value lies outside the range")
                .got(format!("initial {initial}"))
                .allowed(format!("{min}..{max}")));
        }
    }
    Ok(())
}

fn roles(file: &str, servo: &Servo) -> Verdict {
    let mut seen = BTreeSet::new();
    for register in &servo.registers {
        let Some(role) = register.role else { continue };
        let may_repeat = matches!(role, Role::IndirectAddress | Role::IndirectData);
        if !seen.insert(role) && !may_repeat {
            return Err(ProfileError::new(file, "two registers have the same role")
                .at(place(register))
                .got(format!("{role:?}"))
                .allowed("each role once"));
        }
    }
    let of_protocol = match servo.protocol {
        Protocol::Dynamixel1 => REQUIRED_OF_DYNAMIXEL_1,
        Protocol::Dynamixel2 if seen.contains(&Role::TorqueLimit) => REQUIRED_OF_OLD_TABLE,
        Protocol::Dynamixel2 => REQUIRED_OF_DYNAMIXEL_2,
        Protocol::FeetechSts => REQUIRED_OF_STS,
        Protocol::FeetechScs => REQUIRED_OF_SCS,
    };
    if let Some(role) = REQUIRED.iter().chain(of_protocol).find(|role| !seen.contains(role)) {
        return Err(ProfileError::new(file, "a register every servo must have is missing")
            .at("register")
            .got(format!("no register with the role {role:?}")));
    }
    for register in &servo.registers {
        let must_write = register.role.is_some_and(|role| WRITABLE.contains(&role));
        if must_write && register.access != Access::Rw {
            return Err(ProfileError::new(file, "this register must be writable")
                .at(place(register))
                .got("access r")
                .allowed("access rw"));
        }
    }
    let count = |role| servo.registers_with(role).map(Register::item_count).sum::<u16>();
    let (addresses, data) = (count(Role::IndirectAddress), count(Role::IndirectData));
    if addresses != data {
        return Err(ProfileError::new(file, "indirect addresses and indirect data do not pair")
            .at("register")
            .got(format!("{addresses}, {data} data", addresses = counted(addresses, "address")))
            .allowed("as many of one as of the other"));
    }
    let model_number = servo.register(Role::ModelNumber);
    if let Some(initial) = model_number.and_then(|register| register.initial)
        && initial != i64::from(servo.model_number)
    {
        return Err(ProfileError::new(file, "the model number stands here twice, differently")
            .at("model_number")
            .got(servo.model_number)
            .allowed(format!("{initial}, as in the register")));
    }
    Ok(())
}

/// Every mode once, each a value the register takes, and the factory's among them.
fn modes(file: &str, servo: &Servo) -> Verdict {
    let modes = &servo.operating_modes;
    unique(file, "operating mode", "operating_mode", modes.iter().map(|mode| mode.value))?;
    let Some(register) = servo.register(Role::OperatingMode) else {
        if modes.is_empty() {
            return Ok(());
        }
        return Err(ProfileError::new(file, "modes are listed, but no register chooses them")
            .at("operating_mode"));
    };
    let (min, max) = register.range();
    for mode in modes {
        if !(min..=max).contains(&i64::from(mode.value)) {
            return Err(ProfileError::new(file, "the mode register cannot ask for this")
                .at("operating_mode")
                .got(mode.value)
                .allowed(format!("{min}..{max}")));
        }
    }
    let factory = register.initial;
    let known = |value: i64| modes.iter().any(|mode| i64::from(mode.value) == value);
    // A gripper may have no other than the one with a limit on its current.
    let leads = |mode: &Mode| matches!(mode, Mode::Position | Mode::CurrentBasedPosition);
    if !modes.iter().any(|mode| leads(&mode.mode)) || !factory.is_none_or(known) {
        return Err(ProfileError::new(file, "the modes of the servo are not all listed")
            .at("operating_mode")
            .got(format!("{:?}", modes.iter().map(|mode| mode.value).collect::<Vec<_>>()))
            .allowed("a position mode and the factory's mode among them"));
    }
    Ok(())
}

/// Line speeds, and the register that chooses one.
pub(super) fn baud(file: &str, speeds: &[Baud], register: Option<&Register>) -> Verdict {
    if speeds.is_empty() {
        return Err(ProfileError::new(file, "the device has no line speed").at("baud"));
    }
    unique(file, "baud index", "baud", speeds.iter().map(|baud| baud.index))?;
    unique(file, "line speed", "baud", speeds.iter().map(|baud| baud.bps))?;
    let (min, max) = register.map_or((0, 0), Register::range);
    for baud in speeds {
        if baud.bps == 0 || !(min..=max).contains(&i64::from(baud.index)) {
            return Err(ProfileError::new(file, "the baud register cannot ask for this")
                .at("baud")
                .got(format!("index {}, {} bps", baud.index, baud.bps))
                .allowed(format!("index {min}..{max}, a speed above 0")));
        }
    }
    Ok(())
}

/// [`Register::end`] before it is known to fit into 16 bits.
fn end(register: &Register) -> u32 {
    u32::from(register.address) + u32::from(register.bytes) * u32::from(register.item_count())
}

fn place(register: &Register) -> String {
    format!("register {:?} at {}", register.name, register.address)
}
