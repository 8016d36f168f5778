//! DYNAMIXEL Protocol 2.0, the host's side: instructions out, status packets in.
//!
//! ```text
//! FF FF FD 00 | id | length, 2 bytes | instruction | parameters          | crc, 2 bytes
//! FF FF FD 00 | id | length, 2 bytes | 55          | error | parameters  | crc, 2 bytes
//! ```
//!
//! The length counts what follows it; words are little-endian. So that the header occurs nowhere
//! else, an `FD` is inserted after every `FF FF FD` between instruction and last parameter
//! (byte stuffing); length and CRC are those of the stuffed bytes.
//!
//! Source: ROBOTIS e-Manual, "DYNAMIXEL Protocol 2.0"
//! (<https://emanual.robotis.com/docs/en/dxl/protocol2/>; text in ROBOTIS-GIT/emanual,
//! `docs/en/dxl/protocol2.md`), sections Instruction Packet, Status Packet, Packet Process and
//! Fast Sync Read; where it is silent, DynamixelSDK 2ded684d, `protocol2_packet_handler.cpp`.
//!
//! Not done: deadlines and matching of answers to questions (the bus does that), control tables
//! (the profiles), the device's side (the simulator has its own).
//!
//! The manual's example of a read, present position (132) of device 1, and the answer, 166:
//!
//! ```
//! use gaitway::wire::{Decoded, dynamixel2};
//!
//! let id = dynamixel2::Id::new(1).ok_or("1 is an id")?;
//! let mut out = Vec::new();
//! dynamixel2::read(&mut out, id, 132, 4)?;
//! assert_eq!(
//!     out,
//!     [0xFF, 0xFF, 0xFD, 0x00, 0x01, 0x07, 0x00, 0x02, 0x84, 0x00, 0x04, 0x00, 0x1D, 0x15],
//! );
//!
//! let answer = [
//!     0xFF, 0xFF, 0xFD, 0x00, 0x01, 0x08, 0x00, 0x55, 0x00, 0xA6, 0x00, 0x00, 0x00, 0x8C, 0xC0,
//! ];
//! let mut scratch = Vec::new();
//! let Decoded::Packet(status, 15) = dynamixel2::decode(&answer, &mut scratch) else {
//!     return Err("a whole status".into());
//! };
//! assert_eq!(status.id, id);
//! assert!(status.error.is_ok());
//! assert_eq!(status.params, 166_u32.to_le_bytes());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod decode;
mod encode;
mod merged;

pub use decode::{abandon, decode};
pub use encode::{
    BulkRead, FactoryReset, action, bulk_read, bulk_write, clear_multi_turn, control_table_backup,
    control_table_restore, factory_reset, fast_bulk_read, fast_sync_read, ping, read, reboot,
    reg_write, sync_read, sync_write, write,
};
pub use merged::{Answers, Merged, NoAnswer, decode_merged};

/// A device: 0 to 252. 253 is not usable, 254 is all devices, 255 would imitate a header.
pub type Id = super::Id<252>;

/// One device or all.
pub type Target = super::Target<252>;

/// Longest packet sent or accepted, in bytes: the buffer of DynamixelSDK, in both directions.
pub const MAX_PACKET: usize = 1024;

const HEADER: [u8; 4] = [0xFF, 0xFF, 0xFD, 0x00];

/// Bytes before those the length field counts.
const PREFIX: usize = 7;

/// Where the parameters of an instruction begin, and the error byte of a status.
const BODY: usize = 8;

/// The instruction code that marks a status.
const STATUS: u8 = 0x55;

/// One device's answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Status<'a> {
    /// Who answers.
    pub id: Id,
    /// How it went.
    pub error: StatusError,
    /// What was read; empty for an answer to anything but a read or a ping. Stuffing removed.
    pub params: &'a [u8],
}

impl Status<'_> {
    /// Reads the parameters as the answer to a ping: three bytes, model number and firmware.
    #[must_use]
    pub fn identity(&self) -> Option<Identity> {
        let &[low, high, firmware] = self.params else { return None };
        Some(Identity { model_number: u16::from_le_bytes([low, high]), firmware })
    }
}

/// What a device says of itself when pinged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Identity {
    /// Control table item Model Number(0).
    pub model_number: u16,
    /// Control table item Firmware Version(6).
    pub firmware: u8,
}

/// The error byte of a status: a flag and a number (not a bit mask).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StatusError {
    /// Hardware Error Status(70) is not zero. The instruction may have been carried out all the
    /// same: this is about the device, [`code`](Self::code) about the instruction.
    pub alert: bool,
    /// Why the instruction was not carried out; `None` if it was.
    pub code: Option<ErrorCode>,
}

impl StatusError {
    /// Reads the byte.
    #[must_use]
    pub const fn from_byte(byte: u8) -> Self {
        let code = match byte & 0x7F {
            0 => None,
            1 => Some(ErrorCode::ResultFail),
            2 => Some(ErrorCode::Instruction),
            3 => Some(ErrorCode::Crc),
            4 => Some(ErrorCode::DataRange),
            5 => Some(ErrorCode::DataLength),
            6 => Some(ErrorCode::DataLimit),
            7 => Some(ErrorCode::Access),
            other => Some(ErrorCode::Unknown(other)),
        };
        Self { alert: byte & 0x80 != 0, code }
    }

    /// Neither alert nor error.
    #[must_use]
    pub const fn is_ok(self) -> bool {
        !self.alert && self.code.is_none()
    }
}

/// Why a device did not carry out an instruction (manual, Status Packet, Error).
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ErrorCode {
    /// 1: could not be carried out, as a clear while turning or a backup with torque on.
    #[error("result fail (1)")]
    ResultFail,
    /// 2: unknown instruction, or an action with nothing registered.
    #[error("instruction error (2)")]
    Instruction,
    /// 3: the device received the instruction damaged.
    #[error("CRC error (3)")]
    Crc,
    /// 4: outside the range of the item, or a goal while the bus watchdog has tripped.
    #[error("data range error (4)")]
    DataRange,
    /// 5: fewer bytes than the item has.
    #[error("data length error (5)")]
    DataLength,
    /// 6: outside a limit that was set, as a goal beyond Max Position Limit(48).
    #[error("data limit error (6)")]
    DataLimit,
    /// 7: read-only, write-only or absent item, or EEPROM with torque on.
    #[error("access error (7)")]
    Access,
    /// 8 to 127: in no manual.
    #[error("error number {0} (unknown)")]
    Unknown(u8),
}

/// Bytes of an instruction with `params` parameter bytes that need no stuffing.
#[must_use]
pub const fn instruction_len(params: usize) -> usize {
    PREFIX + 3 + params
}

/// Bytes of a status with `params` parameter bytes that need no stuffing.
#[must_use]
pub const fn status_len(params: usize) -> usize {
    PREFIX + 4 + params
}

/// Bytes of a status with `params` parameter bytes that need as much stuffing as possible.
#[must_use]
pub const fn stuffed_status_len(params: usize) -> usize {
    status_len(params) + params / 3
}

/// Bytes of a sync read or fast sync read of `devices`.
#[must_use]
pub const fn sync_read_len(devices: usize) -> usize {
    instruction_len(4 + devices)
}

/// Bytes of a sync write of `length` bytes to each of `devices`, without stuffing.
#[must_use]
pub const fn sync_write_len(devices: usize, length: usize) -> usize {
    instruction_len(4 + devices * (1 + length))
}

/// Bytes of a bulk read or fast bulk read of `devices`.
#[must_use]
pub const fn bulk_read_len(devices: usize) -> usize {
    instruction_len(5 * devices)
}

/// Bytes of the merged status in which `devices` answer with `params` bytes in all.
#[must_use]
pub const fn merged_status_len(devices: usize, params: usize) -> usize {
    BODY + 4 * devices + params
}

/// First place where a packet may begin: a whole header, or the part of one that ends the bytes.
/// The length of `bytes` if there is none.
fn find_header(bytes: &[u8]) -> usize {
    let mut from = 0;
    while let Some(found) = bytes[from..].iter().position(|&byte| byte == HEADER[0]) {
        let at = from + found;
        let seen = HEADER.len().min(bytes.len() - at);
        if bytes[at..].starts_with(&HEADER[..seen]) {
            return at;
        }
        from = at + 1;
    }
    bytes.len()
}

/// First `FF FF FD`. Looks at every third byte as long as it is neither `FF` nor `FD`.
fn find_pattern(bytes: &[u8]) -> Option<usize> {
    let mut last = 2;
    while let Some(&byte) = bytes.get(last) {
        last += match byte {
            0xFD if bytes[last - 2..last] == [0xFF, 0xFF] => return Some(last - 2),
            0xFF => 1,
            _ => 3,
        };
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_header_is_found_behind_anything_and_so_is_its_beginning() {
        assert_eq!(find_header(&[]), 0);
        assert_eq!(find_header(&[0x00, 0xFE, 0xFD]), 3);
        assert_eq!(find_header(&[0xFF, 0xFF, 0xFF, 0xFD, 0x00]), 1);
        assert_eq!(find_header(&[0xFF, 0xFF, 0xFD, 0xFD, 0xFF, 0xFF, 0xFD, 0x00]), 4);
        assert_eq!(find_header(&[0x01, 0xFF]), 1);
        assert_eq!(find_header(&[0x01, 0xFF, 0xFF, 0xFD]), 1);
        assert_eq!(find_header(&[0xFF, 0x01, 0xFF, 0xFF]), 2);
    }

    #[test]
    #[cfg_attr(miri, ignore = "too many tries for an interpreter")]
    fn the_quick_search_finds_what_a_slow_one_finds() {
        // All words of nine letters over the two that matter and one that does not.
        let letters = [0xFF, 0xFD, 0x00];
        for word in 0..3_usize.pow(9) {
            let bytes: Vec<u8> = (0..9).map(|k| letters[word / 3_usize.pow(k) % 3]).collect();
            let slow = bytes.windows(3).position(|three| three == [0xFF, 0xFF, 0xFD]);
            assert_eq!(find_pattern(&bytes), slow, "{bytes:02X?}");
        }
    }

    #[test]
    fn the_error_byte_is_a_flag_and_a_number() {
        assert!(StatusError::from_byte(0x00).is_ok());
        let alert = StatusError::from_byte(0x80);
        assert_eq!(alert, StatusError { alert: true, code: None });
        let both = StatusError::from_byte(0x83);
        assert_eq!(both, StatusError { alert: true, code: Some(ErrorCode::Crc) });
        assert_eq!(StatusError::from_byte(0x07).code, Some(ErrorCode::Access));
        assert_eq!(StatusError::from_byte(0x7F).code, Some(ErrorCode::Unknown(127)));
    }

    #[test]
    fn lengths_are_those_of_the_manuals_examples() {
        assert_eq!(instruction_len(0), 10); // ping
        assert_eq!(status_len(3), 14); // its answer
        assert_eq!(sync_read_len(2), 16);
        assert_eq!(sync_write_len(2, 4), 24);
        assert_eq!(bulk_read_len(2), 20);
        assert_eq!(merged_status_len(3, 12), 32);
    }
}
