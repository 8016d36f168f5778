//! Walks any MCAP file from front to back, damaged or cut off anywhere, in bounded memory.
//!
//! The format is read here record by record (<https://mcap.dev/spec>), the bodies in
//! [`super::record`]. A chunk counts only if it is whole and its CRC is right, so nothing a torn
//! write left behind is taken for a message.
//!
//! Memory stays in proportion to what is read: a buffer grows with the bytes that are there, and
//! what a file says about its messages (schemas, channels, metadata) counts up to stated bounds.
//! What goes beyond them is counted as lost.

use std::collections::BTreeMap;
use std::io::{self, Read};
use std::sync::Arc;

use mcap::records::{MessageHeader, Metadata, op};

use super::crc::crc32;
use super::packing::{Compression, Packed};
use super::record::{ChannelRecord, ChunkRecord, Record, SchemaRecord};
use crate::error::{Error, ErrorKind, counted};

/// No record of a recording is larger: chunks are closed at 1 MiB.
const RECORD_BYTES: u64 = 64 << 20;
/// Opcode and length.
const RECORD_START: usize = 9;
/// A buffer for a record grows in steps of at most this.
const STEP_BYTES: u64 = 1 << 20;
/// Most schemas, channels and metadata records of a file; one that is said again does not count.
const DESCRIPTIONS: usize = 4096;
/// Most bytes of them, all together.
const DESCRIPTION_BYTES: usize = 2 << 20;
/// Most entries of the maps of channels and metadata records, all together.
const DESCRIPTION_ENTRIES: usize = 8192;

/// A channel and its schema.
#[derive(Debug)]
pub(super) struct Channel {
    pub(super) topic: String,
    pub(super) encoding: String,
    pub(super) metadata: BTreeMap<String, String>,
    pub(super) schema: Option<Arc<Schema>>,
}

impl Channel {
    fn is(&self, record: &ChannelRecord, schema: Option<&Arc<Schema>>) -> bool {
        let same_schema = match (&self.schema, schema) {
            (Some(known), Some(schema)) => Arc::ptr_eq(known, schema),
            (known, schema) => known.is_none() && schema.is_none(),
        };
        same_schema
            && self.topic == record.topic
            && self.encoding == record.encoding
            && self.metadata == record.metadata
    }
}

#[derive(Debug)]
pub(super) struct Schema {
    pub(super) name: String,
    pub(super) encoding: String,
    pub(super) text: Vec<u8>,
}

impl Schema {
    fn is(&self, record: &SchemaRecord) -> bool {
        self.name == record.name && self.encoding == record.encoding && self.text == record.text
    }
}

/// What a file may still say about its messages.
struct Allowance {
    records: usize,
    bytes: usize,
    entries: usize,
}

impl Allowance {
    /// Takes a record of so many bytes and map entries off; false, and nothing taken, if that is
    /// too much.
    fn take(&mut self, bytes: usize, entries: usize) -> bool {
        let left = (
            self.records.checked_sub(1),
            self.bytes.checked_sub(bytes),
            self.entries.checked_sub(entries),
        );
        let (Some(records), Some(bytes), Some(entries)) = left else { return false };
        *self = Self { records, bytes, entries };
        true
    }
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
/// If the source cannot be read, is no MCAP file, is compressed in an unknown way or beyond bounds, or
/// `visit` refuses.
pub(super) fn scan(
    source: impl Read,
    visit: impl FnMut(Found) -> Result<(), Error>,
) -> Result<Tally, Error> {
    let mut scan = Scan {
        source,
        visit,
        schemas: BTreeMap::new(),
        channels: BTreeMap::new(),
        allowance: Allowance {
            records: DESCRIPTIONS,
            bytes: DESCRIPTION_BYTES,
            entries: DESCRIPTION_ENTRIES,
        },
        tally: Tally::default(),
    };
    let mut magic = Vec::new();
    scan.fill(&mut magic, mcap::MAGIC.len() as u64)?;
    if magic != mcap::MAGIC {
        return Err(Error::of(ErrorKind::Malformed, "not an MCAP recording")
            .got(format!("a file that begins with \"{}\"", magic.escape_ascii()))
            .allowed("a file that begins with the MCAP magic 89 4d 43 41 50 30 0d 0a")
            .remedy("take a recording; captures are known by their ending (.bvh, .amc, .c3d)"));
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
    allowance: Allowance,
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
        let useful = match Record::decode(opcode, body) {
            None => false,
            Some(Record::Chunk(chunk)) => return self.read_chunk(&chunk),
            Some(Record::Schema(schema)) => self.add_schema(&schema, body.len()),
            Some(Record::Channel(channel)) => self.add_channel(channel, body.len()),
            Some(Record::Message(header, body)) => match self.channels.get(&header.channel_id) {
                None => false,
                Some(channel) => {
                    (self.visit)(Found::Message { channel, header, body })?;
                    true
                }
            },
            Some(Record::Metadata(metadata)) => {
                let allowed = self.allowance.take(body.len(), metadata.metadata.len());
                if allowed {
                    (self.visit)(Found::Metadata(metadata))?;
                }
                allowed
            }
        };
        Ok(if useful { Ok(()) } else { Err(Broken) })
    }

    fn add_schema(&mut self, record: &SchemaRecord, bytes: usize) -> bool {
        if self.schemas.get(&record.id).is_some_and(|known| known.is(record)) {
            return true;
        }
        let allowed = self.allowance.take(bytes, 0);
        if allowed {
            let (name, encoding) = (record.name.to_owned(), record.encoding.to_owned());
            let schema = Schema { name, encoding, text: record.text.to_owned() };
            self.schemas.insert(record.id, Arc::new(schema));
        }
        allowed
    }

    fn add_channel(&mut self, record: ChannelRecord, bytes: usize) -> bool {
        let schema = self.schemas.get(&record.schema_id);
        if self.channels.get(&record.id).is_some_and(|known| known.is(&record, schema)) {
            return true;
        }
        let allowed = self.allowance.take(bytes, record.metadata.len());
        if allowed {
            let channel = Channel {
                topic: record.topic.to_owned(),
                encoding: record.encoding.to_owned(),
                metadata: record.metadata,
                schema: schema.cloned(),
            };
            self.channels.insert(record.id, Arc::new(channel));
        } else {
            // Its messages must not be taken for those of the channel that had the number before.
            self.channels.remove(&record.id);
        }
        allowed
    }

    fn read_chunk(&mut self, chunk: &ChunkRecord) -> Result<Result<(), Broken>, Error> {
        let unpacked;
        let mut records = match Compression::from_name(chunk.compression) {
            None => return Err(unknown_compression(chunk.compression)),
            Some(Compression::None) => chunk.records,
            Some(packing) => match packing.unpack(chunk.records, chunk.size) {
                Ok(records) => {
                    unpacked = records;
                    &unpacked
                }
                Err(Packed::Broken) => return Ok(Err(Broken)),
                Err(Packed::TooMuch { most }) => return Err(too_large(chunk, most)),
            },
        };
        let unchecked = chunk.crc == 0; // zero says "no CRC", by the format
        if !(unchecked || crc32(records) == chunk.crc) {
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
        let mut left = bytes;
        while left > 0 {
            let step = left.min(STEP_BYTES);
            // Exactly: what doubles takes twice the record.
            buffer.reserve_exact(step as usize);
            let read = self.source.by_ref().take(step).read_to_end(buffer).map_err(unreadable)?;
            if (read as u64) < step {
                break;
            }
            left -= step;
        }
        Ok(())
    }

    fn skip(&mut self, bytes: u64) -> Result<u64, Error> {
        io::copy(&mut self.source.by_ref().take(bytes), &mut io::sink()).map_err(unreadable)
    }
}

fn unknown_compression(name: &str) -> Error {
    let shown: String = name.chars().take(40).collect();
    Error::of(ErrorKind::Malformed, "the recording is compressed in a way that is not known")
        .got(shown)
        .allowed("lz4, zstd or none, as the MCAP format has them")
        .remedy("mcap decompress FILE -o PLAIN.mcap")
}

fn too_large(chunk: &ChunkRecord, most: usize) -> Error {
    Error::of(
        ErrorKind::Malformed,
        "a chunk of the recording unpacks to more than is taken into memory",
    )
    .got(format!("{} out of {}", counted(chunk.size, "byte"), chunk.records.len()))
    .allowed(counted(most, "byte"))
    .remedy("mcap decompress FILE -o PLAIN.mcap, if the file can be trusted")
}

fn unreadable(cause: io::Error) -> Error {
    Error::of(ErrorKind::Malformed, "the recording cannot be read").got(cause.to_string())
}

/// Opcode and length, if `bytes` holds them.
fn record_start(bytes: &[u8]) -> Option<(u8, u64)> {
    let (&opcode, rest) = bytes.split_first()?;
    let (length, _) = rest.split_first_chunk::<8>()?;
    Some((opcode, u64::from_le_bytes(*length)))
}
