//! C3D files made by hand, for each kind of machine, with whatever is to be wrong with them. Written from the
//! User Guide and not from the product, which shares nothing with it.

#![allow(dead_code, reason = "each test file uses a part")]

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Machine {
    Intel,
    Dec,
    Mips,
}

impl Machine {
    pub const ALL: [Self; 3] = [Self::Intel, Self::Dec, Self::Mips];

    pub fn word(self, value: u16) -> [u8; 2] {
        if self == Self::Mips { value.to_be_bytes() } else { value.to_le_bytes() }
    }

    pub fn float(self, value: f32) -> [u8; 4] {
        match self {
            Self::Intel => value.to_le_bytes(),
            Self::Mips => value.to_be_bytes(),
            Self::Dec if value == 0.0 => [0; 4],
            // Two powers of two more in the exponent, the upper word first.
            Self::Dec => {
                let [a, b, c, d] = (value * 4.0).to_be_bytes();
                [b, a, d, c]
            }
        }
    }
}

/// What a parameter holds.
#[derive(Clone, Debug)]
pub enum Values {
    Text(Vec<&'static str>),
    Bytes(Vec<u8>),
    Ints(Vec<i32>),
    Floats(Vec<f32>),
}

#[derive(Clone, Debug)]
pub struct Made {
    pub machine: Machine,
    pub real: bool,
    pub points: usize,
    pub frames: usize,
    pub channels: usize,
    pub per_frame: usize,
    pub scale: f32,
    pub rate_hz: f32,
    pub first: usize,
    /// Group, name, dimensions, values; a name that is here twice is written twice.
    pub parameters: Vec<(&'static str, &'static str, Vec<u8>, Values)>,
    /// Words of the header (from 1) that say something else.
    pub header: Vec<(usize, u16)>,
    /// x, y, z and the fourth word of a point in a frame, in counts of the scale.
    pub point: fn(usize, usize) -> [i16; 4],
    pub analog: fn(usize) -> i16,
}

/// A point that moves, seen by cameras 1 and 3 with a residual of 3 steps; every seventh is not seen.
pub fn usual_point(frame: usize, point: usize) -> [i16; 4] {
    if (frame + point) % 7 == 6 {
        return [0, 0, 0, -1];
    }
    let of = |n: usize| (n % 2000) as i16 - 1000;
    [of(frame * 3 + point), of(frame + 17 * point), of(900 + point), 0x0503]
}

impl Made {
    /// Points, frames, channels and samples per frame; nothing wrong.
    pub fn new(points: usize, frames: usize, channels: usize, per_frame: usize) -> Self {
        let mut made = Self {
            machine: Machine::Intel,
            real: true,
            points,
            frames,
            channels,
            per_frame,
            scale: 0.1,
            rate_hz: 100.0,
            first: 1,
            parameters: Vec::new(),
            header: Vec::new(),
            point: usual_point,
            analog: |at| (at % 4096) as i16 - 100,
        };
        let ints = |value: usize| Values::Ints(vec![value as i32]);
        made.set("POINT", "USED", &[], ints(points));
        made.set("POINT", "FRAMES", &[], ints(frames.min(65_535)));
        made.set("POINT", "RATE", &[], Values::Floats(vec![100.0]));
        made.set("POINT", "UNITS", &[2], Values::Text(vec!["mm"]));
        made.set("ANALOG", "USED", &[], ints(channels));
        made.set("ANALOG", "RATE", &[], Values::Floats(vec![100.0 * per_frame as f32]));
        made.set("ANALOG", "GEN_SCALE", &[], Values::Floats(vec![0.5]));
        let each = channels as u8;
        made.set("ANALOG", "SCALE", &[each], Values::Floats(vec![0.25; channels]));
        made.set("ANALOG", "OFFSET", &[each], Values::Ints(vec![12; channels]));
        made
    }

    pub fn set(&mut self, group: &'static str, name: &'static str, dims: &[u8], values: Values) {
        let known = self.parameters.iter_mut().find(|of| (of.0, of.1) == (group, name));
        match known {
            Some(known) => (known.2, known.3) = (dims.to_vec(), values),
            None => self.parameters.push((group, name, dims.to_vec(), values)),
        }
    }

    pub fn without(&mut self, group: &str, name: &str) {
        self.parameters.retain(|of| (of.0, of.1) != (group, name));
    }

    fn stored_scale(&self) -> f32 {
        if self.real { -self.scale } else { self.scale }
    }

    fn section(&self, data_start: u16) -> Vec<u8> {
        let mut section = vec![
            1,
            0x50,
            0,
            match self.machine {
                Machine::Intel => 84,
                Machine::Dec => 85,
                Machine::Mips => 86,
            },
        ];
        let mut groups: Vec<&str> = Vec::new();
        let mut all = self.parameters.clone();
        let is_set = |name: &str| all.iter().any(|of| (of.0, of.1) == ("POINT", name));
        if !is_set("SCALE") {
            all.push(("POINT", "SCALE", vec![], Values::Floats(vec![self.stored_scale()])));
        }
        if !all.iter().any(|of| (of.0, of.1) == ("POINT", "DATA_START")) {
            let block = Values::Ints(vec![data_start.into()]);
            all.push(("POINT", "DATA_START", vec![], block));
        }
        for (group, name, dims, values) in all {
            let id = match groups.iter().position(|known| *known == group) {
                Some(known) => known + 1,
                None => {
                    groups.push(group);
                    section.extend([group.len() as u8, (groups.len() as u8).wrapping_neg()]);
                    section.extend(group.as_bytes());
                    section.extend(self.machine.word(3));
                    section.push(0);
                    groups.len()
                }
            };
            section.extend([name.len() as u8, id as u8]);
            section.extend(name.as_bytes());
            let (code, data): (i8, Vec<u8>) = match values {
                Values::Text(texts) => {
                    let length = usize::from(dims.first().copied().unwrap_or(1));
                    let filled = |text: &str| -> Vec<u8> {
                        text.bytes().chain(std::iter::repeat(b' ')).take(length).collect()
                    };
                    (-1, texts.iter().flat_map(|text| filled(text)).collect())
                }
                Values::Bytes(bytes) => (1, bytes),
                Values::Ints(ints) => {
                    (2, ints.iter().flat_map(|int| self.machine.word(*int as u16)).collect())
                }
                Values::Floats(floats) => {
                    (4, floats.iter().flat_map(|float| self.machine.float(*float)).collect())
                }
            };
            let length = 2 + 1 + 1 + dims.len() + data.len() + 1;
            section.extend(self.machine.word(length as u16));
            section.extend([code as u8, dims.len() as u8]);
            section.extend(dims);
            section.extend(data);
            section.push(0);
        }
        section.extend([0, 0]);
        let blocks = section.len().div_ceil(512);
        section[2] = blocks as u8;
        section.resize(blocks * 512, 0);
        section
    }

    pub fn bytes(&self) -> Vec<u8> {
        let blocks = self.section(0).len() / 512;
        let data_start = (blocks + 2) as u16;
        let section = self.section(data_start);
        let mut file = vec![0; 512];
        let mut put = |number: usize, bytes: &[u8]| {
            file[2 * number - 2..2 * number - 2 + bytes.len()].copy_from_slice(bytes);
        };
        let word = |value: usize| self.machine.word(value.min(65_535) as u16);
        put(1, &[2, 0x50]);
        put(2, &word(self.points));
        put(3, &word(self.channels * self.per_frame));
        put(4, &word(self.first));
        put(5, &word(self.first + self.frames - 1));
        put(7, &self.machine.float(self.stored_scale()));
        put(9, &word(data_start.into()));
        put(10, &word(self.per_frame));
        put(11, &self.machine.float(self.rate_hz));
        for (number, value) in &self.header {
            put(*number, &self.machine.word(*value));
        }
        file.extend(section);
        for frame in 0..self.frames {
            for point in 0..self.points {
                let [x, y, z, word] = (self.point)(frame, point);
                for (count, scale) in
                    [(x, self.scale), (y, self.scale), (z, self.scale), (word, 1.0)]
                {
                    if self.real {
                        file.extend(self.machine.float(f32::from(count) * scale));
                    } else {
                        file.extend(self.machine.word(count as u16));
                    }
                }
            }
            let counts = self.channels * self.per_frame;
            for at in 0..counts {
                let count = (self.analog)(frame * counts + at);
                if self.real {
                    file.extend(self.machine.float(f32::from(count)));
                } else {
                    file.extend(self.machine.word(count as u16));
                }
            }
        }
        file.resize(file.len().div_ceil(512) * 512, 0);
        file
    }
}
