//! A servo profile laid out for look-up by address and by role, and the raw number encodings.
//!
//! The encodings are written from the manuals here a second time on purpose: a mistake shared with
//! the driver would cancel out and no test could see it.

use gaitway_profiles::{
    Access, Board, Encoding, Mode, Motor, PositionScale, Protocol, Region, RegisterItem, Role,
    Servo as Profile, Unit,
};
use std::collections::HashMap;
use std::f64::consts::TAU;
use std::ops::Range;

/// One item of the control table; repeated items are laid out one by one.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Item {
    pub address: u16,
    pub bytes: u8,
    pub encoding: Encoding,
    pub region: Region,
    pub access: Access,
    pub role: Option<Role>,
    pub min: Option<i64>,
    pub max: Option<i64>,
    pub initial: i64,
    /// FEETECH SCS puts the high byte of a word first.
    big_endian: bool,
    /// One count in the unit below.
    scale: f64,
    zero: Option<i64>,
    unit: Unit,
}

/// A servo model: its profile and the indices into it.
#[derive(Debug)]
pub(crate) struct Model {
    pub protocol: Protocol,
    pub profile: Profile,
    pub items: Vec<Item>,
    pub length: usize,
    pub radians_per_count: f64,
    by_address: Vec<Option<u16>>,
    by_role: Vec<Option<u16>>,
    by_name: HashMap<String, u16>,
    /// Words of a board that are measured, whatever befalls it; none of a servo.
    measured: Range<u16>,
    /// False of a board: nobody turns anything with it.
    pub has_shaft: bool,
    /// Indirect data bytes: their address, and that of the pointer that says what they stand for.
    indirect: Vec<(u16, u16)>,
}

impl Model {
    pub fn new(profile: &Profile) -> Model {
        let mut model = Model {
            protocol: profile.protocol,
            profile: profile.clone(),
            items: Vec::new(),
            length: 0,
            radians_per_count: f64::from(profile.position.degrees).to_radians()
                / f64::from(profile.position.counts),
            by_address: Vec::new(),
            by_role: Vec::new(),
            by_name: HashMap::new(),
            measured: 0..0,
            has_shaft: true,
            indirect: Vec::new(),
        };
        for item in profile.items() {
            model.lay_out(item);
        }
        let addresses = |role| {
            let items = model.items.iter().filter(move |item| item.role == Some(role));
            items.map(|item| item.address).collect::<Vec<u16>>()
        };
        let pointers = addresses(Role::IndirectAddress);
        model.indirect = addresses(Role::IndirectData).into_iter().zip(pointers).collect();
        model
    }

    /// A board: a control table without a shaft behind it.
    pub fn of_board(board: &Board) -> Model {
        let (gyroscope, accelerometer) = (board.imu.gyroscope, board.imu.accelerometer);
        // What a table needs of a servo and a board has not is never looked at: no register of it has a role
        // that a shaft has.
        let profile = Profile {
            schema: board.schema,
            name: board.name.clone(),
            model: board.model.clone(),
            maker: board.maker.clone(),
            protocol: board.protocol,
            model_number: board.model_number,
            firmware: board.firmware,
            manual: board.manual.clone(),
            position: PositionScale {
                counts: 4096,
                degrees: 360,
                zero_count: 0,
                lowest_count: 0,
                source: String::new(),
            },
            baud: board.baud.clone(),
            motor: Motor {
                no_load_speed_rad_s: 1.0,
                stall_torque_nm: 1.0,
                stall_current_a: 1.0,
                voltage_v: 12.0,
                source: String::new(),
            },
            fast_sync_read_from_firmware: None,
            clear_from_firmware: None,
            backup_from_firmware: None,
            bulk_read: false,
            operating_modes: Vec::new(),
            error_bits: Vec::new(),
            error_codes: Vec::new(),
            registers: board.registers.clone(),
        };
        let first = gyroscope.min(accelerometer);
        let end = gyroscope.max(accelerometer) + 6;
        Model { measured: first..end, has_shaft: false, ..Model::new(&profile) }
    }

    /// True if a register shows something that goes on without power.
    pub fn is_measured(&self, item: &Item) -> bool {
        self.measured.contains(&item.address)
    }

    fn lay_out(&mut self, place: RegisterItem<'_>) {
        let register = place.register;
        let index = self.items.len() as u16;
        let item = Item {
            address: place.address,
            bytes: register.bytes,
            encoding: register.encoding,
            region: register.region,
            access: register.access,
            role: register.role,
            min: register.min,
            max: register.max,
            initial: place.initial().unwrap_or(0),
            big_endian: self.protocol == Protocol::FeetechScs,
            scale: register.scale.unwrap_or(1.0),
            zero: register.zero,
            unit: register.unit,
        };
        self.items.push(item);
        self.by_name.insert(place.name(), index);
        let end = item.range().end;
        self.length = self.length.max(end);
        self.by_address.resize(self.length, None);
        self.by_address[item.range()].fill(Some(index));
        if let Some(role) = register.role {
            let slot = role as usize;
            if self.by_role.len() <= slot {
                self.by_role.resize(slot + 1, None);
            }
            self.by_role[slot].get_or_insert(index);
        }
    }

    /// The item that owns the byte at `address`.
    pub fn at(&self, address: u16) -> Option<&Item> {
        let index = self.by_address.get(usize::from(address)).copied().flatten()?;
        Some(&self.items[usize::from(index)])
    }

    pub fn role(&self, role: Role) -> Option<&Item> {
        let index = self.by_role.get(role as usize).copied().flatten()?;
        Some(&self.items[usize::from(index)])
    }

    pub fn named(&self, name: &str) -> Option<&Item> {
        self.by_name.get(name).map(|&index| &self.items[usize::from(index)])
    }

    /// What a value of the operating mode register makes of the servo.
    pub fn mode(&self, value: i64) -> Option<Mode> {
        let modes = &self.profile.operating_modes;
        modes.iter().find(|mode| i64::from(mode.value) == value).map(|mode| mode.mode)
    }

    /// Address of the pointer behind an indirect data byte.
    pub fn pointer_behind(&self, address: u16) -> Option<u16> {
        self.indirect.iter().find(|&&(byte, _)| byte == address).map(|&(_, pointer)| pointer)
    }

    /// True if any byte of the range is indirect data.
    pub fn touches_indirect(&self, address: u16, length: usize) -> bool {
        let end = usize::from(address) + length;
        self.indirect.iter().any(|&(byte, _)| byte >= address && usize::from(byte) < end)
    }

    /// The raw value in SI units: rad, rad/s, rad/s², A, V, °C, s or a ratio.
    pub fn si(&self, item: &Item, raw: i64) -> f64 {
        (raw - self.zero(item)) as f64 * self.si_per_count(item)
    }

    /// The nearest raw value to one in SI units, within what the encoding can hold.
    pub fn raw(&self, item: &Item, si: f64) -> i64 {
        let (low, high) = item.representable();
        let raw = (si / self.si_per_count(item)).round() + self.zero(item) as f64;
        (raw as i64).clamp(low, high)
    }

    fn zero(&self, item: &Item) -> i64 {
        match (item.zero, item.unit) {
            (Some(zero), _) => zero,
            (None, Unit::Turn) => i64::from(self.profile.position.zero_count),
            (None, _) => 0,
        }
    }

    fn si_per_count(&self, item: &Item) -> f64 {
        item.scale
            * match item.unit {
                Unit::Turn | Unit::TurnRelative | Unit::CountPerSecond | Unit::CountPerSecond2 => {
                    self.radians_per_count
                }
                Unit::Rpm => TAU / 60.0,
                Unit::Rpm2 => TAU / 3600.0,
                Unit::None
                | Unit::Ampere
                | Unit::Volt
                | Unit::Celsius
                | Unit::Second
                | Unit::Ratio => 1.0,
            }
    }
}

impl Item {
    pub fn range(&self) -> Range<usize> {
        let start = usize::from(self.address);
        start..start + usize::from(self.bytes)
    }

    /// True if the raw value lies in the register's own range.
    pub fn allows(&self, raw: i64) -> bool {
        self.min.is_none_or(|min| raw >= min) && self.max.is_none_or(|max| raw <= max)
    }

    fn sign_bit(&self) -> Option<u32> {
        match self.encoding {
            Encoding::SignMagnitude10 => Some(10),
            Encoding::SignMagnitude11 => Some(11),
            Encoding::SignMagnitude15 => Some(15),
            _ => None,
        }
    }

    /// Lowest and highest value the encoding can hold.
    pub fn representable(&self) -> (i64, i64) {
        if let Some(bit) = self.sign_bit() {
            let magnitude = (1_i64 << bit) - 1;
            return (-magnitude, magnitude);
        }
        let bits = u32::from(self.bytes) * 8;
        match self.encoding {
            Encoding::I8 | Encoding::I16 | Encoding::I32 => {
                (-(1_i64 << (bits - 1)), (1_i64 << (bits - 1)) - 1)
            }
            _ => (0, (1_i64 << bits) - 1),
        }
    }

    /// Number in the bytes of this item; `bytes` holds at least as many.
    pub fn decode(&self, bytes: &[u8]) -> i64 {
        let bytes = &bytes[..usize::from(self.bytes)];
        let join = |word: u32, &byte: &u8| word << 8 | u32::from(byte);
        let word = if self.big_endian {
            bytes.iter().fold(0, join)
        } else {
            bytes.iter().rev().fold(0, join)
        };
        match (self.encoding, self.sign_bit()) {
            (_, Some(bit)) => {
                let magnitude = i64::from(word & ((1 << bit) - 1));
                if word & (1 << bit) != 0 { -magnitude } else { magnitude }
            }
            (Encoding::I8, _) => i64::from(word as u8 as i8),
            (Encoding::I16, _) => i64::from(word as u16 as i16),
            (Encoding::I32, _) => i64::from(word as i32),
            _ => i64::from(word),
        }
    }

    /// Writes `raw` into the bytes of this item.
    pub fn encode(&self, raw: i64, bytes: &mut [u8]) {
        let word = match self.sign_bit() {
            Some(bit) if raw < 0 => raw.unsigned_abs() as u32 | 1 << bit,
            _ => raw as u32,
        };
        let bytes = &mut bytes[..usize::from(self.bytes)];
        bytes.copy_from_slice(&word.to_le_bytes()[..bytes.len()]);
        if self.big_endian {
            bytes.reverse();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn model(name: &str) -> Model {
        Model::new(gaitway_profiles::servo(name).unwrap())
    }

    #[test]
    fn negative_values_are_twos_complement_or_sign_and_magnitude() {
        let (dynamixel, feetech) = (model("xm430-w350"), model("sts3215"));
        let cases: [(&Model, &str, i64, &[u8]); 6] = [
            (&dynamixel, "Goal Position", -1, &[0xFF, 0xFF, 0xFF, 0xFF]),
            (&dynamixel, "Present Current", -100, &[0x9C, 0xFF]),
            // SCServo_Linux: sign in bit 15; LeRobot's encodings table: offset in bit 11.
            (&feetech, "Goal Velocity", -1000, &[0xE8, 0x83]),
            (&feetech, "Homing Offset", -100, &[0x64, 0x08]),
            (&feetech, "Present Load", -5, &[0x05, 0x04]),
            (&feetech, "Goal Position", 2048, &[0x00, 0x08]),
        ];
        for (model, name, raw, bytes) in cases {
            let item = model.named(name).unwrap();
            let mut out = [0; 4];
            item.encode(raw, &mut out);
            assert_eq!(&out[..bytes.len()], bytes, "{name}");
            assert_eq!(item.decode(bytes), raw, "{name}");
        }
    }

    #[test]
    fn scales_are_the_manuals() {
        let model = model("xm430-w350");
        let si = |name, raw| model.si(model.named(name).unwrap(), raw);
        // 0.229 rev/min, 214.577 rev/min², 0.0879 deg, 2.69 mA, 0.1 V.
        assert!((si("Profile Velocity", 100) - 2.39809).abs() < 1e-5);
        assert!((si("Profile Acceleration", 100) - 37.4507).abs() < 1e-4);
        assert!((si("Goal Position", 3072) - std::f64::consts::FRAC_PI_2).abs() < 1e-12);
        assert!((si("Present Current", -1000) + 2.69).abs() < 1e-12);
        assert!((si("Present Input Voltage", 119) - 11.9).abs() < 1e-12);
        assert_eq!(model.raw(model.named("Goal Position").unwrap(), 0.0), 2048);
    }
}
