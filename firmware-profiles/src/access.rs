//! Questions a driver or a virtual servo asks of a profile.

use crate::files;
use crate::schema::{
    Encoding, Joint, Line, Protocol, Register, RegisterItem, Robot, Role, Servo, Setup,
};
use std::collections::BTreeMap;

impl Servo {
    /// The register with this role. Of a role held by several registers (indirect addresses and
    /// data) this is the one with the lowest address; see [`Servo::registers_with`].
    #[must_use]
    pub fn register(&self, role: Role) -> Option<&Register> {
        self.registers_with(role).next()
    }

    /// Every register with this role, in order of address.
    pub fn registers_with(&self, role: Role) -> impl Iterator<Item = &Register> {
        self.registers.iter().filter(move |register| register.role == Some(role))
    }

    /// A register by the vendor's word, e.g. `Goal Position`, or `Indirect Address 3` where the
    /// table has many of a kind.
    #[must_use]
    pub fn register_named(&self, name: &str) -> Option<RegisterItem<'_>> {
        self.registers.iter().find_map(|register| match &register.repeat {
            None => (register.name == name).then(|| register.item(0)).flatten(),
            Some(_) => {
                let number: u16 =
                    name.strip_prefix(&register.name)?.strip_prefix(' ')?.parse().ok()?;
                let item = register.item(number.checked_sub(register.first_number())?)?;
                (item.name() == name).then_some(item)
            }
        })
    }

    /// Every item of the control table in order of address, repeated registers spelt out.
    pub fn items(&self) -> impl Iterator<Item = RegisterItem<'_>> {
        self.registers.iter().flat_map(|register| {
            (0..register.item_count()).filter_map(|index| register.item(index))
        })
    }

    /// What a value of the error register says: the names of its bits, or of its one code.
    pub fn error_words(&self, raw: i64) -> impl Iterator<Item = &str> {
        let bits = self.error_bits.iter().filter(move |bit| raw >> bit.bit & 1 == 1);
        let codes = self.error_codes.iter().filter(move |code| i64::from(code.value) == raw);
        bits.map(|bit| bit.name.as_str()).chain(codes.map(|code| code.name.as_str()))
    }

    /// Number of bytes from address 0 to the end of the last register.
    #[must_use]
    pub fn table_len(&self) -> u16 {
        self.registers.iter().map(Register::end).max().unwrap_or(0)
    }

    /// Value of the baud register for a line speed.
    #[must_use]
    pub fn baud_index(&self, bps: u32) -> Option<u8> {
        self.baud.iter().find(|baud| baud.bps == bps).map(|baud| baud.index)
    }

    /// Line speed for a value of the baud register.
    #[must_use]
    pub fn baud_bps(&self, index: u8) -> Option<u32> {
        self.baud.iter().find(|baud| baud.index == index).map(|baud| baud.bps)
    }

    /// Angle of one encoder count, rad.
    #[must_use]
    pub fn radians_per_count(&self) -> f64 {
        f64::from(self.position.degrees).to_radians() / f64::from(self.position.counts)
    }
}

impl Register {
    /// Number of equal items from [`Register::address`] on.
    #[must_use]
    pub fn item_count(&self) -> u16 {
        self.repeat.map_or(1, u16::from)
    }

    /// Number in the name of the first item of a repeated register.
    #[must_use]
    pub fn first_number(&self) -> u16 {
        self.first.map_or(1, u16::from)
    }

    /// Address of the first byte after the register, all items counted. A validated register ends
    /// within 16 bits; one that does not is held at the highest address.
    #[must_use]
    pub fn end(&self) -> u16 {
        self.address.saturating_add(u16::from(self.bytes).saturating_mul(self.item_count()))
    }

    /// The item `index` (0 = the first), if there are so many.
    #[must_use]
    pub fn item(&self, index: u16) -> Option<RegisterItem<'_>> {
        if index >= self.item_count() {
            return None;
        }
        let address = self.address.checked_add(u16::from(self.bytes).checked_mul(index)?)?;
        Some(RegisterItem { register: self, index, address })
    }

    /// The range of raw values: `min`..`max` where given, else what the bytes can hold.
    #[must_use]
    pub fn range(&self) -> (i64, i64) {
        let (lowest, highest) = self.encoding.range();
        (self.min.unwrap_or(lowest), self.max.unwrap_or(highest))
    }
}

impl RegisterItem<'_> {
    /// The vendor's word with the item's number, if it has one.
    #[must_use]
    pub fn name(&self) -> String {
        match self.register.repeat {
            None => self.register.name.clone(),
            Some(_) => {
                format!("{} {}", self.register.name, self.register.first_number() + self.index)
            }
        }
    }

    /// Raw factory value (EEPROM) or value at power-up (RAM) of this item.
    #[must_use]
    pub fn initial(&self) -> Option<i64> {
        let step = self.register.initial_step.unwrap_or(0);
        self.register
            .initial
            .map(|initial| initial.saturating_add(step.saturating_mul(i64::from(self.index))))
    }
}

impl Encoding {
    /// Size in bytes.
    #[must_use]
    pub fn bytes(self) -> u8 {
        match self {
            Self::U8 | Self::I8 => 1,
            Self::U16 | Self::I16 => 2,
            Self::SignMagnitude10 | Self::SignMagnitude11 | Self::SignMagnitude15 => 2,
            Self::U32 | Self::I32 => 4,
        }
    }

    /// Lowest and highest raw value the bytes can hold.
    #[must_use]
    pub fn range(self) -> (i64, i64) {
        match self {
            Self::U8 => (0, 0xFF),
            Self::U16 => (0, 0xFFFF),
            Self::U32 => (0, 0xFFFF_FFFF),
            Self::I8 => (i64::from(i8::MIN), i64::from(i8::MAX)),
            Self::I16 => (i64::from(i16::MIN), i64::from(i16::MAX)),
            Self::I32 => (i64::from(i32::MIN), i64::from(i32::MAX)),
            Self::SignMagnitude10 => (-0x3FF, 0x3FF),
            Self::SignMagnitude11 => (-0x7FF, 0x7FF),
            Self::SignMagnitude15 => (-0x7FFF, 0x7FFF),
        }
    }
}

impl Protocol {
    /// Highest ID a single device can have; the lowest is 0.
    #[must_use]
    pub fn highest_id(self) -> u8 {
        match self {
            Self::Dynamixel2 => 252,
            Self::Dynamixel1 | Self::FeetechSts | Self::FeetechScs => 253,
        }
    }
}

impl Robot {
    /// The joint with this name.
    #[must_use]
    pub fn joint(&self, name: &str) -> Option<&Joint> {
        self.joints.iter().find(|joint| joint.name == name)
    }

    /// The joints on a line, in the order of the file.
    pub fn joints_on(&self, line: &str) -> impl Iterator<Item = &Joint> {
        self.joints.iter().filter(move |joint| joint.line == line)
    }

    /// How the servo of a joint is configured: its firmware version and raw values by register
    /// name, later entries laid over earlier ones. What no entry says is as it leaves the factory:
    /// of a servo without any, the newest firmware its profile is known to hold for. It runs at the
    /// speed of its line.
    #[must_use]
    pub fn setup_for(&self, joint: &Joint) -> (u16, BTreeMap<String, i64>) {
        let mut firmware = 0;
        let mut registers = BTreeMap::new();
        if let Ok(servo) = files::servo(&joint.servo) {
            firmware = servo.firmware.max.unwrap_or(servo.firmware.min);
            let line = self.lines.iter().find(|line| line.name == joint.line);
            let index = line.and_then(Line::baud_bps).and_then(|bps| servo.baud_index(bps));
            if let Some((index, register)) = index.zip(servo.register(Role::BaudRate)) {
                registers.insert(register.name.clone(), i64::from(index));
            }
        }
        for setup in self.setups.iter().filter(|setup| setup.applies_to(joint)) {
            firmware = setup.firmware;
            registers.extend(setup.registers.iter().map(|(name, raw)| (name.clone(), *raw)));
        }
        (firmware, registers)
    }
}

impl Joint {
    /// Pose the robot starts in, rad: what the file says, else the angle nearest to zero that is a
    /// hundredth of its range inside its limits, where no step of an encoder leads beyond them.
    #[must_use]
    pub fn initial_rad(&self) -> f64 {
        let inset_rad = 0.01 * (self.upper_rad - self.lower_rad);
        let nearest = || 0.0_f64.max(self.lower_rad + inset_rad).min(self.upper_rad - inset_rad);
        self.initial.unwrap_or_else(nearest)
    }

    /// Where the joint sits in its parent's frame and what it turns about, if the file says.
    #[must_use]
    pub fn mounting(&self) -> Option<([f64; 3], [f64; 3])> {
        self.origin_m.zip(self.axis)
    }
}

impl Setup {
    /// True if this entry speaks of the joint.
    #[must_use]
    pub fn applies_to(&self, joint: &Joint) -> bool {
        self.servo == joint.servo
            && self.joints.as_ref().is_none_or(|names| names.contains(&joint.name))
    }
}
