//! Rules for boards: a control table in the manner of a servo's, with an inertial sensor in it.

use super::{Verdict, header, not_empty, positive, servo, unique};
use crate::error::{Faults, ProfileError};
use crate::schema::{Board, Encoding, Protocol, Register, Role};

/// Registers that the driver and the virtual board cannot do without.
const REQUIRED: [Role; 5] =
    [Role::ModelNumber, Role::FirmwareVersion, Role::Id, Role::BaudRate, Role::StatusReturnLevel];

pub(crate) fn board(file: &str, board: &Board) -> Verdict {
    let mut faults = Faults::default();
    faults.note(header(file, board.schema, &board.name));
    for (key, text) in [
        ("model", &board.model),
        ("maker", &board.maker),
        ("manual", &board.manual),
        ("imu, source", &board.imu.source),
    ] {
        faults.note(not_empty(file, key, text));
    }
    if board.protocol != Protocol::Dynamixel2 {
        faults.note(Err(ProfileError::new(file, "boards of this protocol are not known")
            .at("protocol")
            .got(format!("{:?}", board.protocol))
            .allowed("dynamixel-2.0")));
    }
    faults.note(servo::firmware(file, board.firmware));
    servo::table(file, board.protocol, &board.registers, &mut faults);
    let with = |role: Role| board.registers.iter().find(|register| register.role == Some(role));
    if faults.count() == 0 {
        let names = board.registers.iter().map(|register| &register.name);
        faults.note(unique(file, "register name", "register", names));
        let roles = board.registers.iter().filter_map(|register| register.role);
        faults.note(unique(file, "role", "register", roles.map(|role| format!("{role:?}"))));
        if let Some(role) = REQUIRED.into_iter().find(|role| with(*role).is_none()) {
            faults.note(Err(ProfileError::new(
                file,
                "a register every board must have is missing",
            )
            .at("register")
            .got(format!("no register with the role {role:?}"))));
        }
        faults.note(servo::baud(file, &board.baud, with(Role::BaudRate)));
    }
    for register in board.registers.iter().filter(|register| register.repeat.is_some()) {
        faults.note(Err(ProfileError::new(file, "a board's registers stand one by one")
            .at(format!("register {:?}", register.name))
            .got("repeat")
            .allowed("no such key")));
    }
    faults.note(imu(file, board));
    faults.verdict()
}

/// Six signed words: three of each sensor, one after the other.
fn imu(file: &str, board: &Board) -> Verdict {
    let imu = &board.imu;
    for (key, value) in
        [("gyroscope_deg_s", imu.gyroscope_deg_s), ("accelerometer_g", imu.accelerometer_g)]
    {
        positive(file, || format!("imu, {key}"), value)?;
    }
    let is_word = |address: u32| {
        let of = |register: &&Register| u32::from(register.address) == address;
        board.registers.iter().find(of).is_some_and(|of| of.encoding == Encoding::I16)
    };
    for (key, first) in [("gyroscope", imu.gyroscope), ("accelerometer", imu.accelerometer)] {
        let words = (0..3).map(|axis| u32::from(first) + 2 * axis);
        if let Some(missing) = words.into_iter().find(|address| !is_word(*address)) {
            return Err(ProfileError::new(file, "what is measured stands in three signed words")
                .at(format!("imu, {key}"))
                .got(format!("no i16 register at {missing}"))
                .allowed("the address of the first of three i16 registers, X, Y and Z"));
        }
    }
    Ok(())
}
