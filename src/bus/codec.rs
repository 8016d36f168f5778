//! The protocols of a line behind one face: the same questions, each protocol's own bytes.

use super::{Miss, Reply};
use crate::time::Duration;
use crate::wire::{Decoded, dynamixel1 as dxl1, dynamixel2 as dxl, feetech as sts};

/// What a device speaks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Protocol {
    /// ROBOTIS DYNAMIXEL Protocol 1.0.
    Dynamixel1,
    /// ROBOTIS DYNAMIXEL Protocol 2.0.
    Dynamixel2,
    /// FEETECH STS/SMS.
    FeetechSts,
    /// FEETECH SCS: big-endian words and no group read.
    FeetechScs,
}

use Protocol::{Dynamixel1, Dynamixel2, FeetechScs, FeetechSts};

impl std::fmt::Display for Protocol {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Dynamixel1 => "Dynamixel 1.0",
            Dynamixel2 => "Dynamixel 2.0",
            FeetechSts => "Feetech STS",
            FeetechScs => "Feetech SCS",
        })
    }
}

/// Which instruction reads from many devices at once.
///
/// Dynamixel 2.0 knows all four (the fast ones from some firmware on), Dynamixel 1.0 bulk reads
/// only (MX models), Feetech STS sync reads only, Feetech SCS none.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum GroupRead {
    /// The same registers of all, one status per device.
    Sync,
    /// The same registers of all, one status for all.
    Fast,
    /// Each device's own registers, one status per device.
    Bulk,
    /// Each device's own registers, one status for all.
    FastBulk,
}

impl GroupRead {
    /// True if all devices answer in one status.
    #[must_use]
    pub const fn merged(self) -> bool {
        matches!(self, Self::Fast | Self::FastBulk)
    }
}

/// What one device is asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GroupItem {
    /// Who.
    pub id: u8,
    /// First address.
    pub address: u16,
    /// Number of bytes.
    pub length: u16,
}

/// What lies at the front of the received bytes.
pub(super) enum Heard<'a> {
    /// Not enough to tell.
    Need,
    /// So many bytes of our own, or of another host.
    Echo(usize),
    /// So many bytes that begin no packet.
    Noise(usize),
    /// So many bytes of a damaged packet.
    Damaged(usize),
    /// A device's answer, in so many bytes.
    Status(Said<'a>, usize),
}

/// What a device said.
pub(super) struct Said<'a> {
    pub id: u8,
    pub alert: bool,
    /// Why the instruction was not carried out.
    pub no: Option<Miss>,
    pub params: &'a [u8],
}

impl Said<'_> {
    /// True if it can be the answer to a question for `length` bytes.
    pub(super) const fn answers(&self, length: usize) -> bool {
        self.no.is_some() || self.params.len() == length
    }

    /// As the answer to a question for `length` bytes.
    pub(super) fn reply(self, length: usize) -> Result<Reply, Miss> {
        match self.no {
            Some(miss) => Err(miss),
            None if self.params.len() != length => Err(Miss::Garbled),
            None => Ok(Reply { alert: self.alert, bytes: self.params.to_vec() }),
        }
    }
}

fn heard(decoded: Decoded<Said<'_>>) -> Heard<'_> {
    match decoded {
        Decoded::Need(_) => Heard::Need,
        Decoded::Skip(n) => Heard::Noise(n),
        Decoded::Echo(n) => Heard::Echo(n),
        Decoded::Bad(_, n) => Heard::Damaged(n),
        Decoded::Packet(said, n) => Heard::Status(said, n),
    }
}

/// Why a Protocol 2.0 device did not do what it was told. If it says that the instruction reached
/// it damaged, that is a fault of the line like any other, and asking again is right.
fn refusal(code: dxl::ErrorCode) -> Miss {
    match code {
        dxl::ErrorCode::Crc => Miss::Garbled,
        other => Miss::Refused(other.to_string()),
    }
}

/// The same for Protocol 1.0.
fn refusal1(error: dxl1::StatusError) -> Option<Miss> {
    if error.any(dxl1::StatusError::CHECKSUM) {
        Some(Miss::Garbled)
    } else if error.refused() {
        Some(Miss::Refused(error.to_string()))
    } else {
        None
    }
}

fn dxl_id(id: u8) -> Result<dxl::Id, String> {
    dxl::Id::new(id).ok_or_else(|| format!("ID {id} is not a Dynamixel ID (0 to 252)"))
}

fn short_id(id: u8) -> Result<sts::Id, String> {
    sts::Id::new(id).ok_or_else(|| format!("ID {id} is not one of 0 to 253"))
}

impl Protocol {
    /// Time a device takes to answer whatever its return delay register says. Feetech documents
    /// none; 200 us covers what owners of STS servos report.
    pub(super) const fn least_reply_delay(self) -> Duration {
        match self {
            Dynamixel1 | Dynamixel2 => Duration::ZERO,
            FeetechSts | FeetechScs => Duration::from_micros(200),
        }
    }

    /// Bytes of a status with `params` bytes.
    pub(super) const fn status_bytes(self, params: usize) -> usize {
        match self {
            Dynamixel2 => dxl::status_len(params),
            Dynamixel1 | FeetechSts | FeetechScs => sts::status_len(params),
        }
    }

    /// Bytes that ask one device for some.
    pub(super) const fn read_bytes(self) -> usize {
        match self {
            Dynamixel2 => dxl::instruction_len(4),
            Dynamixel1 | FeetechSts | FeetechScs => sts::instruction_len(2),
        }
    }

    /// Parameter bytes in the answer to a ping.
    pub(super) const fn ping_bytes(self) -> usize {
        match self {
            Dynamixel2 => 3,
            Dynamixel1 | FeetechSts | FeetechScs => 0,
        }
    }

    /// Bytes of the question to `devices`.
    pub(super) const fn group_read_bytes(self, kind: GroupRead, devices: usize) -> usize {
        match (self, kind) {
            (Dynamixel2, GroupRead::Sync | GroupRead::Fast) => dxl::sync_read_len(devices),
            (Dynamixel2, GroupRead::Bulk | GroupRead::FastBulk) => dxl::bulk_read_len(devices),
            (_, GroupRead::Bulk | GroupRead::FastBulk) => dxl1::bulk_read_len(devices),
            (_, GroupRead::Sync | GroupRead::Fast) => sts::sync_read_len(devices),
        }
    }

    /// Bytes of a sync write of `length` bytes to `devices`.
    pub(super) const fn sync_write_bytes(self, devices: usize, length: usize) -> usize {
        match self {
            Dynamixel2 => dxl::sync_write_len(devices, length),
            Dynamixel1 | FeetechSts | FeetechScs => sts::sync_write_len(devices, length),
        }
    }

    /// A number that this protocol sends in one byte.
    fn byte(self, what: &str, number: u16) -> Result<u8, String> {
        u8::try_from(number).map_err(|_| {
            format!("{what} {number} does not fit a {self} packet, which has one byte for it")
        })
    }

    /// IDs a device can have are those below.
    pub(super) const fn ids(self) -> u8 {
        match self {
            Dynamixel2 => 253,
            Dynamixel1 | FeetechSts | FeetechScs => 254,
        }
    }

    pub(super) fn ping_all(self, out: &mut Vec<u8>) -> Result<(), String> {
        match self {
            Dynamixel2 => dxl::ping(out, dxl::Target::All),
            FeetechSts => sts::ping(out, sts::Target::All),
            Dynamixel1 | FeetechScs => return Err(format!("{self} answers no ping of all")),
        }
        Ok(())
    }

    pub(super) fn ping(self, out: &mut Vec<u8>, id: u8) -> Result<(), String> {
        match self {
            Dynamixel2 => dxl::ping(out, dxl_id(id)?),
            Dynamixel1 | FeetechSts | FeetechScs => sts::ping(out, short_id(id)?),
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
            Dynamixel2 => dxl::read(out, dxl_id(id)?, address, length),
            Dynamixel1 | FeetechSts | FeetechScs => {
                let (address, length) =
                    (self.byte("address", address)?, self.byte("length", length)?);
                sts::read(out, short_id(id)?, address, length)
            }
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
            Dynamixel2 => dxl::write(out, dxl_id(id)?, address, bytes),
            Dynamixel1 | FeetechSts | FeetechScs => {
                sts::write(out, short_id(id)?, self.byte("address", address)?, bytes)
            }
        }
        .map_err(|e| e.to_string())
    }

    pub(super) fn reg_write(
        self,
        out: &mut Vec<u8>,
        id: u8,
        address: u16,
        bytes: &[u8],
    ) -> Result<(), String> {
        match self {
            Dynamixel2 => dxl::reg_write(out, dxl_id(id)?, address, bytes),
            Dynamixel1 | FeetechSts | FeetechScs => {
                sts::reg_write(out, short_id(id)?, self.byte("address", address)?, bytes)
            }
        }
        .map_err(|e| e.to_string())
    }

    pub(super) fn action_all(self, out: &mut Vec<u8>) {
        match self {
            Dynamixel2 => dxl::action(out, dxl::Target::All),
            Dynamixel1 | FeetechSts | FeetechScs => sts::action(out, sts::Target::All),
        }
    }

    pub(super) fn factory_reset(
        self,
        out: &mut Vec<u8>,
        id: u8,
        keep: dxl::FactoryReset,
    ) -> Result<(), String> {
        match (self, keep) {
            (Dynamixel2, _) => dxl::factory_reset(out, dxl_id(id)?, keep),
            (_, dxl::FactoryReset::Everything) => sts::factory_reset(out, short_id(id)?),
            _ => return Err(format!("{self} has no factory reset that keeps something")),
        }
        Ok(())
    }

    /// An instruction that only Protocol 2.0 has.
    pub(super) fn only2(
        self,
        out: &mut Vec<u8>,
        id: u8,
        name: &str,
        encode: impl FnOnce(&mut Vec<u8>, dxl::Id),
    ) -> Result<(), String> {
        if self != Dynamixel2 {
            return Err(format!("{self} has no {name}"));
        }
        encode(out, dxl_id(id)?);
        Ok(())
    }

    pub(super) fn group_read(
        self,
        out: &mut Vec<u8>,
        kind: GroupRead,
        items: &[GroupItem],
    ) -> Result<(), String> {
        match (self, kind) {
            (Dynamixel2, GroupRead::Sync | GroupRead::Fast) => {
                let (address, length) = shared_block(items)?;
                let ids = items.iter().map(|item| dxl_id(item.id));
                let ids = ids.collect::<Result<Vec<_>, _>>()?;
                if kind == GroupRead::Sync {
                    dxl::sync_read(out, address, length, ids)
                } else {
                    dxl::fast_sync_read(out, address, length, ids)
                }
            }
            (Dynamixel2, GroupRead::Bulk | GroupRead::FastBulk) => {
                let reads = items.iter().map(|&GroupItem { id, address, length }| {
                    Ok(dxl::BulkRead { id: dxl_id(id)?, address, length })
                });
                let reads = reads.collect::<Result<Vec<_>, String>>()?;
                if kind == GroupRead::Bulk {
                    dxl::bulk_read(out, reads)
                } else {
                    dxl::fast_bulk_read(out, reads)
                }
            }
            (FeetechSts, GroupRead::Sync) => {
                let (address, length) = shared_block(items)?;
                let (address, length) =
                    (self.byte("address", address)?, self.byte("length", length)?);
                let ids = items.iter().map(|item| short_id(item.id));
                sts::sync_read(out, address, length, ids.collect::<Result<Vec<_>, _>>()?)
            }
            (Dynamixel1, GroupRead::Bulk) => {
                let reads = items.iter().map(|item| {
                    let id = short_id(item.id)?;
                    let address = self.byte("address", item.address)?;
                    Ok(dxl1::BulkRead { id, address, length: self.byte("length", item.length)? })
                });
                dxl1::bulk_read(out, reads.collect::<Result<Vec<_>, String>>()?)
            }
            _ => return Err(format!("{self} has no {kind:?} read")),
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
            Dynamixel2 => {
                let items = items.iter().map(|&(id, bytes)| Ok((dxl_id(id)?, bytes)));
                let items = items.collect::<Result<Vec<_>, String>>()?;
                dxl::sync_write(out, address, length, items)
            }
            Dynamixel1 | FeetechSts | FeetechScs => {
                let (address, length) =
                    (self.byte("address", address)?, self.byte("length", length)?);
                let items = items.iter().map(|&(id, bytes)| Ok((short_id(id)?, bytes)));
                let items = items.collect::<Result<Vec<_>, String>>()?;
                sts::sync_write(out, address, length, items)
            }
        }
        .map_err(|e| e.to_string())
    }

    pub(super) fn bulk_write(
        self,
        out: &mut Vec<u8>,
        items: &[(u8, u16, &[u8])],
    ) -> Result<(), String> {
        if self != Dynamixel2 {
            return Err(format!("{self} has no bulk write"));
        }
        let items = items.iter().map(|&(id, address, bytes)| Ok((dxl_id(id)?, address, bytes)));
        let items = items.collect::<Result<Vec<_>, String>>()?;
        dxl::bulk_write(out, items).map_err(|e| e.to_string())
    }

    /// What lies at the front of `received`, where answers have at most `longest` bytes.
    pub(super) fn decode<'a>(
        self,
        received: &'a [u8],
        longest: usize,
        scratch: &'a mut Vec<u8>,
    ) -> Heard<'a> {
        match self {
            Dynamixel2 => heard(dxl::decode(received, scratch).map(|status| Said {
                id: status.id.get(),
                alert: status.error.alert,
                no: status.error.code.map(refusal),
                params: status.params,
            })),
            Dynamixel1 => heard(dxl1::decode(received, longest).map(|status| Said {
                id: status.id.get(),
                alert: status.error.alert(),
                no: refusal1(status.error),
                params: status.params,
            })),
            // No bit of theirs is about the instruction; what they refuse they do not answer.
            FeetechSts | FeetechScs => heard(sts::decode(received, longest).map(|status| Said {
                id: status.id.get(),
                alert: !status.error.is_ok(),
                no: None,
                params: status.params,
            })),
        }
    }

    /// Bytes to drop when nothing more comes behind the beginning of a packet.
    pub(super) fn abandon(self, received: &[u8]) -> usize {
        match self {
            Dynamixel2 => dxl::abandon(received),
            Dynamixel1 | FeetechSts | FeetechScs => sts::abandon(received),
        }
    }
}

/// The one block all items of a sync read share.
fn shared_block(items: &[GroupItem]) -> Result<(u16, u16), String> {
    let first = items.first().ok_or("no device named")?;
    let block = (first.address, first.length);
    if items.iter().any(|item| (item.address, item.length) != block) {
        return Err("a sync read asks all devices for the same registers".to_owned());
    }
    Ok(block)
}

/// Bytes of a merged status in which `devices` answer with `params` bytes in all.
pub(super) const fn merged_bytes(devices: usize, params: usize) -> usize {
    dxl::merged_status_len(devices, params)
}

/// The answers in a merged status, as far as they are there.
pub(super) fn merged(received: &[u8], items: &[GroupItem]) -> Vec<Result<Reply, Miss>> {
    let asked: Vec<(dxl::Id, usize)> = items
        .iter()
        .filter_map(|item| Some((dxl::Id::new(item.id)?, usize::from(item.length))))
        .collect();
    let answers = dxl::decode_merged(received, &asked).answers().map(|(id, answer)| match answer {
        Ok(status) => match status.error.code {
            None => Ok(Reply { alert: status.error.alert, bytes: status.params.to_vec() }),
            Some(code) => Err(refusal(code)),
        },
        Err(dxl::NoAnswer::Missing) => Err(Miss::Silent),
        Err(dxl::NoAnswer::WrongId { actual, .. }) => {
            Err(Miss::WrongId { asked: id.get(), got: actual })
        }
        Err(dxl::NoAnswer::Checksum { .. } | dxl::NoAnswer::Behind) => Err(Miss::Garbled),
    });
    answers.collect()
}
