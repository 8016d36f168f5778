//! What passes on a line, read by the test itself: a few kinds of packets of two protocols, by their
//! manuals, and nothing of the driver's or the simulator's code.

/// One instruction, or one status.
#[derive(Clone, Debug, PartialEq)]
pub enum Word {
    /// A register, or a block of them, is written to one servo.
    Write { id: u8, address: u16, data: Vec<u8> },
    /// The same registers are written to several.
    SyncWrite { address: u16, items: Vec<(u8, Vec<u8>)> },
    /// A block of registers is asked for.
    Read { address: u16 },
    /// A block of so many bytes is asked of several, who answer in one packet.
    FastRead { address: u16, length: usize },
    /// A servo answers.
    Status { id: u8, data: Vec<u8> },
    /// Anything else that is whole.
    Other,
}

/// Feetech STS, or DYNAMIXEL protocol 2.0; and where their registers are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Dialect {
    Feetech,
    Dynamixel,
}

impl Dialect {
    /// The first register that is not kept at power-off.
    pub const fn ram(self) -> u16 {
        match self {
            Self::Feetech => 40,
            Self::Dynamixel => 64,
        }
    }

    /// Torque Enable, one byte.
    pub const fn torque(self) -> u16 {
        match self {
            Self::Feetech => 40,
            Self::Dynamixel => 64,
        }
    }

    /// Goal Position and its bytes.
    pub const fn goal(self) -> (u16, usize) {
        match self {
            Self::Feetech => (42, 2),
            Self::Dynamixel => (116, 4),
        }
    }

    /// Present Position; as long as the goal.
    pub const fn present(self) -> u16 {
        match self {
            Self::Feetech => 56,
            Self::Dynamixel => 132,
        }
    }

    /// What each servo says in a status. To a fast read of so many bytes all of them answer in one, with
    /// the broadcast ID: each its ID and data, and between two of them a CRC and the next one's error.
    pub fn answers(id: u8, data: &[u8], fast: Option<usize>) -> Vec<(u8, Vec<u8>)> {
        const BROADCAST: u8 = 0xFE;
        match fast {
            Some(length) if id == BROADCAST => data
                .chunks(length + 4)
                .filter_map(|one| Some((*one.first()?, one.get(1..=length)?.to_vec())))
                .collect(),
            _ => vec![(id, data.to_vec())],
        }
    }

    /// Takes the whole packets at the beginning of `bytes` out of it.
    pub fn take_words(self, bytes: &mut Vec<u8>, from_host: bool) -> Vec<Word> {
        let mut words = Vec::new();
        while let Some((word, used)) = match self {
            Self::Feetech => feetech(bytes, from_host),
            Self::Dynamixel => dynamixel(bytes),
        } {
            words.extend(word);
            bytes.drain(..used);
        }
        words
    }

    /// A register of the position kind, counts, out of `data` that begins at `address`.
    pub fn counts_at(self, register: u16, address: u16, data: &[u8]) -> Option<i64> {
        let from = usize::from(register.checked_sub(address)?);
        let bytes = data.get(from..from + self.goal().1)?;
        let mut raw = bytes.iter().rev().fold(0_i64, |sum, &byte| sum << 8 | i64::from(byte));
        match self {
            // Bit 15 is the sign.
            Self::Feetech if raw & 0x8000 != 0 => raw = -(raw & 0x7FFF),
            Self::Dynamixel => raw = i64::from(raw as u32 as i32),
            Self::Feetech => {}
        }
        Some(raw)
    }
}

/// FF FF ID LENGTH INSTRUCTION PARAMETERS SUM; in a status the instruction is the error.
fn feetech(bytes: &[u8], from_host: bool) -> Option<(Option<Word>, usize)> {
    let start = bytes.windows(2).position(|two| two == [0xFF, 0xFF])?;
    let packet = &bytes[start..];
    let length = usize::from(*packet.get(3)?);
    let whole = packet.get(..4 + length)?;
    let sum = whole[2..3 + length].iter().fold(0_u8, |sum, &byte| sum.wrapping_add(byte));
    if length < 2 || !sum != whole[3 + length] {
        return Some((None, start + 1));
    }
    let (id, code, body) = (whole[2], whole[4], &whole[5..3 + length]);
    let word = match code {
        _ if !from_host => Word::Status { id, data: body.to_vec() },
        0x02 if body.len() == 2 => Word::Read { address: u16::from(body[0]) },
        0x03 if !body.is_empty() => {
            Word::Write { id, address: u16::from(body[0]), data: body[1..].to_vec() }
        }
        0x82 if body.len() > 2 => Word::Read { address: u16::from(body[0]) },
        0x83 if body.len() > 2 => {
            let items = body[2..].chunks_exact(usize::from(body[1]) + 1);
            let items = items.map(|item| (item[0], item[1..].to_vec())).collect();
            Word::SyncWrite { address: u16::from(body[0]), items }
        }
        _ => Word::Other,
    };
    Some((Some(word), start + 4 + length))
}

/// FF FF FD 00 ID LENGTH(2) INSTRUCTION PARAMETERS CRC(2), FF FF FD stuffed with another FD.
fn dynamixel(bytes: &[u8]) -> Option<(Option<Word>, usize)> {
    const HEADER: [u8; 4] = [0xFF, 0xFF, 0xFD, 0x00];
    let start = bytes.windows(4).position(|four| four == HEADER)?;
    let packet = &bytes[start..];
    let word_at = |at: usize| Some(u16::from_le_bytes([*packet.get(at)?, *packet.get(at + 1)?]));
    let length = usize::from(word_at(5)?);
    let whole = packet.get(..7 + length)?;
    if length < 3 {
        return Some((None, start + 4));
    }
    let mut body = whole[8..5 + length].to_vec();
    let mut at = 0;
    while let Some(found) = body[at..].windows(4).position(|four| four == [0xFF, 0xFF, 0xFD, 0xFD])
    {
        at += found + 3;
        body.remove(at);
    }
    let register = |body: &[u8]| u16::from_le_bytes([body[0], body[1]]);
    let (id, code) = (whole[4], whole[7]);
    let word = match code {
        0x55 if !body.is_empty() => Word::Status { id, data: body[1..].to_vec() },
        0x02 | 0x82 if body.len() >= 4 => Word::Read { address: register(&body) },
        0x8A if body.len() >= 4 => {
            let length = usize::from(register(&body[2..]));
            Word::FastRead { address: register(&body), length }
        }
        0x03 if body.len() > 2 => {
            Word::Write { id, address: register(&body), data: body[2..].to_vec() }
        }
        0x83 if body.len() > 4 => {
            let items = body[4..].chunks_exact(usize::from(register(&body[2..])) + 1);
            let items = items.map(|item| (item[0], item[1..].to_vec())).collect();
            Word::SyncWrite { address: register(&body), items }
        }
        _ => Word::Other,
    };
    Some((Some(word), start + 7 + length))
}

/// Examples of the makers' manuals.
#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sync_write_of_two_feetech_goals_is_read() {
        // Goal position 2048 to servos 1 and 2, after half a packet of noise.
        let mut bytes = vec![0xFF, 0xFF, 0xFF, 0xFE];
        bytes.splice(..2, []);
        bytes.extend([0x0A, 0x83, 0x2A, 0x02, 0x01, 0x00, 0x08, 0x02, 0x00, 0x08]);
        let sum = bytes[1..].iter().fold(0_u8, |sum, &byte| sum.wrapping_add(byte));
        bytes.splice(..0, [0x00, 0xFF]);
        bytes.extend([!sum]);
        let words = Dialect::Feetech.take_words(&mut bytes, true);
        let items = vec![(1, vec![0x00, 0x08]), (2, vec![0x00, 0x08])];
        assert_eq!(words, [Word::SyncWrite { address: 42, items }]);
        assert_eq!(Dialect::Feetech.counts_at(42, 42, &[0x00, 0x08]), Some(2048));
        assert_eq!(Dialect::Feetech.counts_at(56, 56, &[0x05, 0x80]), Some(-5));
    }

    #[test]
    fn a_sync_write_of_two_dynamixel_goals_is_read() {
        // The e-Manual's example of Sync Write (0x83): 150 and 170 to servos 1 and 2.
        let mut bytes = vec![
            0xFF, 0xFF, 0xFD, 0x00, 0xFE, 0x11, 0x00, 0x83, 0x74, 0x00, 0x04, 0x00, 0x01, 0x96,
            0x00, 0x00, 0x00, 0x02, 0xAA, 0x00, 0x00, 0x00, 0x82, 0x87,
        ];
        let words = Dialect::Dynamixel.take_words(&mut bytes, true);
        let items = vec![(1, vec![0x96, 0, 0, 0]), (2, vec![0xAA, 0, 0, 0])];
        assert_eq!(words, [Word::SyncWrite { address: 116, items }]);
        assert!(bytes.is_empty());
    }

    #[test]
    fn the_answer_of_several_dynamixels_to_one_fast_read_is_read() {
        // The e-Manual's example of Fast Sync Read (0x8A): positions of servos 3, 7 and 4.
        let mut asked = vec![
            0xFF, 0xFF, 0xFD, 0x00, 0xFE, 0x0A, 0x00, 0x8A, 0x84, 0x00, 0x04, 0x00, 0x03, 0x07,
            0x04, 0x20, 0xF2,
        ];
        let words = Dialect::Dynamixel.take_words(&mut asked, true);
        assert_eq!(words, [Word::FastRead { address: 132, length: 4 }]);
        let mut answered = vec![
            0xFF, 0xFF, 0xFD, 0x00, 0xFE, 0x19, 0x00, 0x55, 0x00, 0x03, 0xA6, 0x00, 0x00, 0x00,
            0x84, 0x08, 0x00, 0x07, 0x1F, 0x08, 0x00, 0x00, 0x16, 0xCA, 0x00, 0x04, 0xFF, 0x03,
            0x00, 0x00, 0xD1, 0x9E,
        ];
        let words = Dialect::Dynamixel.take_words(&mut answered, false);
        let [Word::Status { id, data }] = words.as_slice() else { panic!("{words:?}") };
        let each = Dialect::answers(*id, data, Some(4));
        let counts: Vec<(u8, i64)> = each
            .iter()
            .filter_map(|(id, data)| Some((*id, Dialect::Dynamixel.counts_at(132, 132, data)?)))
            .collect();
        assert_eq!(counts, [(3, 166), (7, 2079), (4, 1023)]);
    }
}
