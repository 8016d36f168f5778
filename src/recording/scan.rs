//! Walks any MCAP file from front to back, damaged or cut off anywhere, in bounded memory.
//!
//! The format is read here record by record (<https://mcap.dev/spec>); the bodies are parsed by
//! the `mcap` crate. A chunk counts only if it is whole and its CRC is right, so nothing a torn
//! write left behind is taken for a message.

use std::collections::BTreeMap;
use std::io::{self, Read};
use std::sync::Arc;

use mcap::records::{self, MessageHeader, Metadata, Record, op};

use super::crc::crc32;
use crate::error::Error;

/// No record of a recording is larger: chunks are closed at 1 MiB.
const RECORD_BYTES: u64 = 64 << 20;
/// Opcode and length.
const RECORD_START: usize = 9;

/// A channel and its schema.
#[derive(Debug)]
pub(super) struct Channel {
    pub(super) topic: String,
    pub(super) encoding: String,
    pub(super) metadata: BTreeMap<String, String>,
    pub(super) schema: Option<Arc<Schema>>,
}

#[derive(Debug)]
pub(super) struct Schema {
    pub(super) name: String,
    pub(super) encoding: String,
    pub(super) text: Vec<u8>,
}

/// What a scan finds.
pub(super) enum Found<'a> {
    Message { channel: &'a Arc<Channel>, header: MessageHeader, body: &'a [u8] },
    Metadata(Metadata),
}

/// What a scan can say about the file as a whole.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Tally {
    /// The file ends as a finished file must.
    pub(super) finished: bool,
    /// Bytes that could not be used: bad chunks, and everything after the first break.
    pub(super) lost_bytes: u64,
}

/// Calls `visit` for every message and metadata record that can be trusted, in file order.
///
/// # Errors
/// If the source cannot be read, is no MCAP file, is compressed, or `visit` refuses.
pub(super) fn scan(
    source: impl Read,
    visit: impl FnMut(Found) -> Result<(), Error>,
) -> Result<Tally, Error> {
    let mut scan = Scan {
        source,
        visit,
        schemas: BTreeMap::new(),
        channels: BTreeMap::new(),
        tally: Tally::default(),
    };
    let mut magic = Vec::new();
    scan.fill(&mut magic, mcap::MAGIC.len() as u64)?;
    if magic != mcap::MAGIC {
        return Err(Error::new("this is no MCAP recording")
            .got(format!("{magic:02x?}"))
            .allowed("a file that begins with the MCAP magic 89 4d 43 41 50 30 0d 0a"));
    }
    scan.run()?;
    Ok(scan.tally)
}

/// Why a record ends the walk without being an error of ours: the file is broken from here on.
struct Broken;

struct Scan<R, F> {
    source: R,
    visit: F,
    schemas: BTreeMap<u16, Arc<Schema>>,
    channels: BTreeMap<u16, Arc<Channel>>,
    tally: Tally,
}

impl<R: Read, F: FnMut(Found) -> Result<(), Error>> Scan<R, F> {
    fn run(&mut self) -> Result<(), Error> {
        let (mut start, mut body) = (Vec::new(), Vec::new());
        loop {
            self.fill(&mut start, RECORD_START as u64)?;
            let Some((opcode, bytes)) = record_start(&start) else {
                return self.lose(start.len() as u64);
            };
            match opcode {
                op::FOOTER => return self.read_footer(&start, bytes),
                op::CHUNK | op::SCHEMA | op::CHANNEL | op::MESSAGE | op::METADATA => {
                    if bytes > RECORD_BYTES {
                        return self.lose(start.len() as u64);
                    }
                    self.fill(&mut body, bytes)?;
                    if body.len() as u64 != bytes {
                        return self.lose((start.len() + body.len()) as u64);
                    }
                    if self.read_record(opcode, &body)?.is_err() {
                        self.tally.lost_bytes += (start.len() + body.len()) as u64;
                    }
                }
                // No record has opcode zero: this is a hole that a power cut left.
                0 => return self.lose(start.len() as u64),
                _ => {
                    let skipped = self.skip(bytes)?;
                    if skipped != bytes {
                        return self.lose(start.len() as u64 + skipped);
                    }
                }
            }
        }
    }

    /// Everything from here on is lost: so many bytes already read, and the rest.
    fn lose(&mut self, read: u64) -> Result<(), Error> {
        self.tally.lost_bytes += read + self.skip(u64::MAX)?;
        Ok(())
    }

    fn read_footer(&mut self, start: &[u8], bytes: u64) -> Result<(), Error> {
        let mut rest = Vec::new();
        self.fill(&mut rest, bytes.saturating_add(mcap::MAGIC.len() as u64).min(RECORD_BYTES))?;
        self.tally.finished = bytes == 20 && rest.len() == 28 && rest.ends_with(mcap::MAGIC);
        if self.tally.finished { Ok(()) } else { self.lose((start.len() + rest.len()) as u64) }
    }

    /// The outer result stops the scan, the inner one says that this record is of no use.
    fn read_record(&mut self, opcode: u8, body: &[u8]) -> Result<Result<(), Broken>, Error> {
        // The parser is never given an attachment: it does not check the length of one.
        let Ok(record) = mcap::parse_record(opcode, body) else { return Ok(Err(Broken)) };
        match record {
            Record::Chunk { header, data: records } => return self.read_chunk(&header, &records),
            Record::Schema { header, data: text } => {
                let text = text.into_owned();
                let schema = Schema { name: header.name, encoding: header.encoding, text };
                self.schemas.insert(header.id, Arc::new(schema));
            }
            Record::Channel(channel) => self.add_channel(channel),
            Record::Message { header, data: body } => {
                let Some(channel) = self.channels.get(&header.channel_id) else {
                    return Ok(Err(Broken));
                };
                (self.visit)(Found::Message { channel, header, body: &body })?;
            }
            Record::Metadata(metadata) => (self.visit)(Found::Metadata(metadata))?,
            _ => {}
        }
        Ok(Ok(()))
    }

    fn add_channel(&mut self, channel: records::Channel) {
        let known = Channel {
            topic: channel.topic,
            encoding: channel.message_encoding,
            metadata: channel.metadata,
            schema: self.schemas.get(&channel.schema_id).cloned(),
        };
        self.channels.insert(channel.id, Arc::new(known));
    }

    fn read_chunk(
        &mut self,
        header: &records::ChunkHeader,
        mut records: &[u8],
    ) -> Result<Result<(), Broken>, Error> {
        if !header.compression.is_empty() {
            return Err(Error::new("the recording is compressed")
                .got(&header.compression)
                .allowed("MCAP chunks without compression")
                .remedy("mcap decompress FILE -o PLAIN.mcap"));
        }
        let whole = records.len() as u64 == header.compressed_size;
        let unchecked = header.uncompressed_crc == 0; // zero says "no CRC", by the format
        if !whole || !(unchecked || crc32(records) == header.uncompressed_crc) {
            return Ok(Err(Broken));
        }
        while let Some((opcode, bytes)) = record_start(records) {
            let rest = &records[RECORD_START..];
            let Some(body) = usize::try_from(bytes).ok().and_then(|bytes| rest.get(..bytes)) else {
                return Ok(Err(Broken));
            };
            records = &rest[body.len()..];
            let useful = matches!(opcode, op::SCHEMA | op::CHANNEL | op::MESSAGE);
            if useful && self.read_record(opcode, body)?.is_err() {
                return Ok(Err(Broken));
            }
        }
        Ok(if records.is_empty() { Ok(()) } else { Err(Broken) })
    }

    /// Reads up to `bytes` into `buffer`; it grows with what is there, not with what is claimed.
    fn fill(&mut self, buffer: &mut Vec<u8>, bytes: u64) -> Result<(), Error> {
        buffer.clear();
        self.source.by_ref().take(bytes).read_to_end(buffer).map_err(unreadable)?;
        Ok(())
    }

    fn skip(&mut self, bytes: u64) -> Result<u64, Error> {
        io::copy(&mut self.source.by_ref().take(bytes), &mut io::sink()).map_err(unreadable)
    }
}

fn unreadable(cause: io::Error) -> Error {
    Error::new("the recording cannot be read").got(cause.to_string())
}

/// Opcode and length, if `bytes` holds them.
fn record_start(bytes: &[u8]) -> Option<(u8, u64)> {
    let (&opcode, rest) = bytes.split_first()?;
    let (length, _) = rest.split_first_chunk::<8>()?;
    Some((opcode, u64::from_le_bytes(*length)))
}
