//! The protocols of a line behind one face: the same questions, each protocol's own bytes.

use super::{GroupRead, Miss, Reply};
use crate::time::Duration;
use crate::wire::{Decoded, dynamixel2 as dxl, feetech as sts};

/// What is spoken on a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Protocol {
    /// ROBOTIS DYNAMIXEL Protocol 2.0.
    Dynamixel2,
    /// FEETECH STS/SMS.
    FeetechSts,
}

/// What lies at the front of the received bytes.
pub(super) enum Heard<'a> {
    /// Not enough to tell.
    Need,
    /// Drop this many bytes; true if they were a damaged packet.
    Drop(usize, bool),
    /// A device's answer of `n` bytes.
    Status { id: u8, alert: bool, refused: Option<String>, params: &'a [u8], n: usize },
}

fn dxl_id(id: u8) -> Result<dxl::Id, String> {
    dxl::Id::new(id).ok_or_else(|| format!("ID {id} is not a Dynamixel ID (0 to 252)"))
}

fn sts_id(id: u8) -> Result<sts::Id, String> {
    sts::Id::new(id).ok_or_else(|| format!("ID {id} is not a Feetech ID (0 to 253)"))
}

/// A Feetech address or length, which is one byte.
fn byte(number: u16) -> Result<u8, String> {
    u8::try_from(number).map_err(|_| format!("{number} does not fit a Feetech packet"))
}

impl Protocol {
    /// Time a device takes to answer whatever its return delay register says. Feetech documents
    /// none; 200 us covers what owners of STS servos report.
    pub(super) const fn least_reply_delay(self) -> Duration {
        match self {
            Self::Dynamixel2 => Duration::ZERO,
            Self::FeetechSts => Duration::from_micros(200),
        }
    }

    /// Bytes of a status with `params` bytes.
    pub(super) const fn status_bytes(self, params: usize) -> usize {
        match self {
            Self::Dynamixel2 => dxl::status_len(params),
            Self::FeetechSts => sts::status_len(params),
        }
    }

    /// Bytes of the one answer of a fast group read.
    pub(super) const fn merged_bytes(self, devices: usize, length: usize) -> usize {
        match self {
            Self::Dynamixel2 => dxl::merged_status_len(devices, devices * length),
            Self::FeetechSts => devices * sts::status_len(length),
        }
    }

    /// Bytes that ask one device for some.
    pub(super) const fn read_bytes(self) -> usize {
        match self {
            Self::Dynamixel2 => dxl::instruction_len(4),
            Self::FeetechSts => sts::instruction_len(2),
        }
    }

    /// Bytes that answer a ping.
    pub(super) const fn ping_bytes(self) -> usize {
        match self {
            Self::Dynamixel2 => 3,
            Self::FeetechSts => 0,
        }
    }

    /// Bytes of a group read of `length` bytes from `devices`, question and answers.
    pub(super) const fn group_read_bytes(
        self,
        devices: usize,
        length: usize,
        mode: GroupRead,
    ) -> usize {
        match (self, mode) {
            (Self::Dynamixel2, GroupRead::Sync) => {
                dxl::sync_read_len(devices) + devices * dxl::status_len(length)
            }
            (Self::Dynamixel2, GroupRead::Fast) => {
                dxl::sync_read_len(devices) + dxl::merged_status_len(devices, devices * length)
            }
            (Self::FeetechSts, _) => {
                sts::sync_read_len(devices) + devices * sts::status_len(length)
            }
        }
    }

    /// Bytes of a sync write of `length` bytes to `devices`.
    pub(super) const fn sync_write_bytes(self, devices: usize, length: usize) -> usize {
        match self {
            Self::Dynamixel2 => dxl::sync_write_len(devices, length),
            Self::FeetechSts => sts::sync_write_len(devices, length),
        }
    }

    pub(super) fn ping(self, out: &mut Vec<u8>, id: u8) -> Result<(), String> {
        match self {
            Self::Dynamixel2 => dxl::ping(out, dxl_id(id)?),
            Self::FeetechSts => sts::ping(out, sts_id(id)?),
        }
        Ok(())
    }

    pub(super) fn read(
        self,
        out: &mut Vec<u8>,
        id: u8,
        address: u16,
        length: u16,
    ) -> Result<(), String> {
        match self {
            Self::Dynamixel2 => dxl::read(out, dxl_id(id)?, address, length),
            Self::FeetechSts => sts::read(out, sts_id(id)?, byte(address)?, byte(length)?),
        }
        .map_err(|e| e.to_string())
    }

    pub(super) fn write(
        self,
        out: &mut Vec<u8>,
        id: u8,
        address: u16,
        bytes: &[u8],
    ) -> Result<(), String> {
        match self {
            Self::Dynamixel2 => dxl::write(out, dxl_id(id)?, address, bytes),
            Self::FeetechSts => sts::write(out, sts_id(id)?, byte(address)?, bytes),
        }
        .map_err(|e| e.to_string())
    }

    pub(super) fn group_read(
        self,
        out: &mut Vec<u8>,
        ids: &[u8],
        address: u16,
        length: u16,
        mode: GroupRead,
    ) -> Result<(), String> {
        match self {
            Self::Dynamixel2 => {
                let ids = ids.iter().map(|&id| dxl_id(id)).collect::<Result<Vec<_>, _>>()?;
                match mode {
                    GroupRead::Sync => dxl::sync_read(out, address, length, ids),
                    GroupRead::Fast => dxl::fast_sync_read(out, address, length, ids),
                }
            }
            Self::FeetechSts => {
                let ids = ids.iter().map(|&id| sts_id(id)).collect::<Result<Vec<_>, _>>()?;
                sts::sync_read(out, byte(address)?, byte(length)?, ids)
            }
        }
        .map_err(|e| e.to_string())
    }

    pub(super) fn sync_write(
        self,
        out: &mut Vec<u8>,
        address: u16,
        items: &[(u8, &[u8])],
    ) -> Result<(), String> {
        let length = items.first().map_or(0, |(_, bytes)| bytes.len());
        let length = u16::try_from(length).map_err(|_| "too many bytes".to_owned())?;
        match self {
            Self::Dynamixel2 => {
                let items = items.iter().map(|&(id, bytes)| Ok((dxl_id(id)?, bytes)));
                let items = items.collect::<Result<Vec<_>, String>>()?;
                dxl::sync_write(out, address, length, items)
            }
            Self::FeetechSts => {
                let items = items.iter().map(|&(id, bytes)| Ok((sts_id(id)?, bytes)));
                let items = items.collect::<Result<Vec<_>, String>>()?;
                sts::sync_write(out, byte(address)?, byte(length)?, items)
            }
        }
        .map_err(|e| e.to_string())
    }

    /// What lies at the front of `received`, where answers have at most `longest` bytes.
    pub(super) fn decode<'a>(
        self,
        received: &'a [u8],
        longest: usize,
        scratch: &'a mut Vec<u8>,
    ) -> Heard<'a> {
        match self {
            Self::Dynamixel2 => match dxl::decode(received, scratch) {
                Decoded::Need(_) => Heard::Need,
                Decoded::Skip(n) | Decoded::Echo(n) => Heard::Drop(n, false),
                Decoded::Bad(_, n) => Heard::Drop(n, true),
                Decoded::Packet(status, n) => Heard::Status {
                    id: status.id.get(),
                    alert: status.error.alert,
                    refused: status.error.code.map(|code| code.to_string()),
                    params: status.params,
                    n,
                },
            },
            Self::FeetechSts => match sts::decode(received, longest) {
                Decoded::Need(_) => Heard::Need,
                Decoded::Skip(n) | Decoded::Echo(n) => Heard::Drop(n, false),
                Decoded::Bad(_, n) => Heard::Drop(n, true),
                Decoded::Packet(status, n) => Heard::Status {
                    id: status.id.get(),
                    alert: !status.error.is_ok(),
                    refused: None,
                    params: status.params,
                    n,
                },
            },
        }
    }

    /// Bytes to drop when nothing more comes behind the beginning of a packet.
    pub(super) fn abandon(self, received: &[u8]) -> usize {
        match self {
            Self::Dynamixel2 => dxl::abandon(received),
            Self::FeetechSts => sts::abandon(received),
        }
    }
}

/// The answers in a merged status, as far as they are there.
pub(super) fn merged(received: &[u8], ids: &[u8], length: usize) -> Vec<Result<Reply, Miss>> {
    let asked: Vec<(dxl::Id, usize)> =
        ids.iter().filter_map(|&id| Some((dxl::Id::new(id)?, length))).collect();
    let answers = dxl::decode_merged(received, &asked).answers().map(|(id, answer)| match answer {
        Ok(status) => match status.error.code {
            None => Ok(Reply { alert: status.error.alert, bytes: status.params.to_vec() }),
            Some(code) => Err(Miss::Refused(code.to_string())),
        },
        Err(dxl::NoAnswer::Missing) => Err(Miss::Silent),
        Err(dxl::NoAnswer::WrongId { actual, .. }) => {
            Err(Miss::WrongId { asked: id.get(), got: actual })
        }
        Err(dxl::NoAnswer::Checksum { .. } | dxl::NoAnswer::Behind) => Err(Miss::Garbled),
    });
    answers.collect()
}
