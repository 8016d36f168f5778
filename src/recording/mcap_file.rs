//! An MCAP file on its way to the disk (<https://mcap.dev/spec>): chunks, their indexes, and the
//! summary at its end. It only grows; whoever writes takes what has been added and appends it.

use std::collections::BTreeMap;
use std::mem::take;

use mcap::records::{MessageHeader, Metadata, op};

use super::crc::Crc;
use super::packing::Compression;

/// An MCAP file in the making.
pub(super) struct McapFile {
    packing: Compression,
    /// Added and not yet taken.
    added: Vec<u8>,
    /// Of these up to the end of the last chunk.
    chunks_end: usize,
    /// Of everything up to here.
    position: u64,
    crc: Crc,
    chunk: Chunk,
    schemas: Vec<Vec<u8>>,
    channels: Vec<Vec<u8>>,
    /// Messages of each channel.
    counts: Vec<u64>,
    times: Option<(u64, u64)>,
    chunk_indexes: Vec<u8>,
    chunks: u32,
    metadata_indexes: Vec<u8>,
    metadata: u32,
}

/// A chunk that is still open.
#[derive(Default)]
struct Chunk {
    records: Vec<u8>,
    times: Option<(u64, u64)>,
    /// Time and place of each message, by channel.
    places: BTreeMap<u16, Vec<u8>>,
}

impl McapFile {
    pub(super) fn new(packing: Compression) -> Self {
        let mut file = Self {
            packing,
            added: Vec::new(),
            chunks_end: 0,
            position: 0,
            crc: Crc::default(),
            chunk: Chunk::default(),
            schemas: Vec::new(),
            channels: Vec::new(),
            counts: Vec::new(),
            times: None,
            chunk_indexes: Vec::new(),
            chunks: 0,
            metadata_indexes: Vec::new(),
            metadata: 0,
        };
        file.add(mcap::MAGIC);
        let mut header = Vec::new();
        put_sized(&mut header, b"");
        put_sized(&mut header, concat!("gaitway ", env!("CARGO_PKG_VERSION")).as_bytes());
        file.add_record(op::HEADER, &header);
        file
    }

    /// What was added since this was last asked.
    pub(super) fn take(&mut self) -> Vec<u8> {
        self.chunks_end = 0;
        take(&mut self.added)
    }

    /// Of what was added since, all up to the end of the last chunk. The index of a chunk is taken with
    /// what follows: a disk that is full after a chunk has stored all of its messages, and one that is
    /// full before has stored none.
    pub(super) fn take_chunks(&mut self) -> Vec<u8> {
        let rest = self.added.split_off(self.chunks_end);
        self.chunks_end = 0;
        std::mem::replace(&mut self.added, rest)
    }

    /// The number of a schema; the same again if it is known.
    pub(super) fn add_schema(
        &mut self,
        name: &str,
        encoding: &str,
        text: &[u8],
    ) -> Result<u16, String> {
        let mut body = Vec::new();
        for field in [name.as_bytes(), encoding.as_bytes(), text] {
            put_sized(&mut body, field);
        }
        // Zero would say that a channel has none.
        let (at, is_new) = number(&mut self.schemas, body, 1)?;
        if is_new {
            put_record(&mut self.chunk.records, op::SCHEMA, &numbered(at, 1, &self.schemas));
        }
        Ok(at)
    }

    /// The number of a channel; the same again if it is known.
    pub(super) fn add_channel(
        &mut self,
        schema: u16,
        topic: &str,
        encoding: &str,
        metadata: &BTreeMap<String, String>,
    ) -> Result<u16, String> {
        let mut body = schema.to_le_bytes().to_vec();
        put_sized(&mut body, topic.as_bytes());
        put_sized(&mut body, encoding.as_bytes());
        put_map(&mut body, metadata);
        let (at, is_new) = number(&mut self.channels, body, 0)?;
        if is_new {
            self.counts.push(0);
            put_record(&mut self.chunk.records, op::CHANNEL, &numbered(at, 0, &self.channels));
        }
        Ok(at)
    }

    /// Adds a message to the open chunk.
    pub(super) fn add_message(
        &mut self,
        header: &MessageHeader,
        data: &[u8],
    ) -> Result<(), String> {
        let count = self.counts.get_mut(usize::from(header.channel_id));
        *count.ok_or("a message of a channel that was not added")? += 1;
        for times in [&mut self.times, &mut self.chunk.times] {
            let (first, last) = times.unwrap_or((header.log_time, header.log_time));
            *times = Some((first.min(header.log_time), last.max(header.log_time)));
        }
        let places = self.chunk.places.entry(header.channel_id).or_default();
        places.extend(header.log_time.to_le_bytes());
        places.extend((self.chunk.records.len() as u64).to_le_bytes());
        let records = &mut self.chunk.records;
        records.reserve(31 + data.len());
        records.push(op::MESSAGE);
        records.extend((22 + data.len() as u64).to_le_bytes());
        records.extend(header.channel_id.to_le_bytes());
        records.extend(header.sequence.to_le_bytes());
        records.extend(header.log_time.to_le_bytes());
        records.extend(header.publish_time.to_le_bytes());
        records.extend(data);
        Ok(())
    }

    /// Closes the chunk, if anything is in it.
    pub(super) fn close_chunk(&mut self) -> Result<(), String> {
        let Chunk { records, times, places } = take(&mut self.chunk);
        if records.is_empty() {
            return Ok(());
        }
        let (first, last) = times.unwrap_or_default();
        let (size, crc) = (records.len() as u64, super::crc::crc32(&records));
        let packed = self.packing.pack(records)?;
        let mut head = Vec::new();
        for field in [first, last, size] {
            head.extend(field.to_le_bytes());
        }
        head.extend(crc.to_le_bytes());
        put_sized(&mut head, self.packing.name().as_bytes());
        head.extend((packed.len() as u64).to_le_bytes());
        let begins = self.position;
        let length = (head.len() + packed.len()) as u64;
        self.add(&[op::CHUNK]);
        self.add(&length.to_le_bytes());
        self.add(&head);
        self.add(&packed);
        let ends = self.position;
        self.chunks_end = self.added.len();
        let mut offsets = Vec::new();
        for (channel, places) in places {
            offsets.extend(channel.to_le_bytes());
            offsets.extend(self.position.to_le_bytes());
            let mut body = channel.to_le_bytes().to_vec();
            put_sized(&mut body, &places);
            self.add_record(op::MESSAGE_INDEX, &body);
        }
        let mut index = Vec::new();
        for field in [first, last, begins, ends - begins] {
            index.extend(field.to_le_bytes());
        }
        put_sized(&mut index, &offsets);
        index.extend((self.position - ends).to_le_bytes());
        put_sized(&mut index, self.packing.name().as_bytes());
        index.extend((packed.len() as u64).to_le_bytes());
        index.extend(size.to_le_bytes());
        put_record(&mut self.chunk_indexes, op::CHUNK_INDEX, &index);
        self.chunks = self.chunks.saturating_add(1);
        Ok(())
    }

    /// Closes the chunk and adds a metadata record behind it.
    pub(super) fn add_metadata(&mut self, metadata: &Metadata) -> Result<(), String> {
        self.close_chunk()?;
        let mut body = Vec::new();
        put_sized(&mut body, metadata.name.as_bytes());
        put_map(&mut body, &metadata.metadata);
        let begins = self.position;
        self.add_record(op::METADATA, &body);
        let mut index = begins.to_le_bytes().to_vec();
        index.extend((self.position - begins).to_le_bytes());
        put_sized(&mut index, metadata.name.as_bytes());
        put_record(&mut self.metadata_indexes, op::METADATA_INDEX, &index);
        self.metadata = self.metadata.saturating_add(1);
        Ok(())
    }

    /// Closes the file; nothing may be added after that.
    pub(super) fn finish(&mut self) -> Result<(), String> {
        self.close_chunk()?;
        let crc = self.crc.value();
        self.add_record(op::DATA_END, &crc.to_le_bytes());
        let mut summary = Vec::new();
        let mut offsets = Vec::new();
        for (opcode, records) in self.summary() {
            if records.is_empty() {
                continue;
            }
            let mut group = vec![opcode];
            group.extend((self.position + summary.len() as u64).to_le_bytes());
            group.extend((records.len() as u64).to_le_bytes());
            put_record(&mut offsets, op::SUMMARY_OFFSET, &group);
            summary.extend(records);
        }
        let begins = self.position;
        let offsets_begin = begins + summary.len() as u64;
        summary.extend(offsets);
        // The footer's check sum is of the summary and the footer up to itself.
        summary.push(op::FOOTER);
        summary.extend(20u64.to_le_bytes());
        summary.extend(begins.to_le_bytes());
        summary.extend(offsets_begin.to_le_bytes());
        let crc = super::crc::crc32(&summary);
        self.add(&summary);
        self.add(&crc.to_le_bytes());
        self.add(mcap::MAGIC);
        Ok(())
    }

    /// The groups of the summary.
    fn summary(&mut self) -> [(u8, Vec<u8>); 5] {
        let (mut schemas, mut channels, mut statistics) = (Vec::new(), Vec::new(), Vec::new());
        for at in 0..self.schemas.len() {
            put_record(&mut schemas, op::SCHEMA, &numbered(at as u16 + 1, 1, &self.schemas));
        }
        for at in 0..self.channels.len() {
            put_record(&mut channels, op::CHANNEL, &numbered(at as u16, 0, &self.channels));
        }
        let mut body = self.counts.iter().sum::<u64>().to_le_bytes().to_vec();
        body.extend((self.schemas.len() as u16).to_le_bytes());
        // No attachments.
        for count in [self.channels.len() as u32, 0, self.metadata, self.chunks] {
            body.extend(count.to_le_bytes());
        }
        let (first, last) = self.times.unwrap_or_default();
        body.extend(first.to_le_bytes());
        body.extend(last.to_le_bytes());
        let mut counts = Vec::new();
        let told = self.counts.iter().enumerate().filter(|(_, count)| **count > 0);
        for (channel, count) in told {
            counts.extend((channel as u16).to_le_bytes());
            counts.extend(count.to_le_bytes());
        }
        put_sized(&mut body, &counts);
        put_record(&mut statistics, op::STATISTICS, &body);
        [
            (op::SCHEMA, schemas),
            (op::CHANNEL, channels),
            (op::STATISTICS, statistics),
            (op::CHUNK_INDEX, take(&mut self.chunk_indexes)),
            (op::METADATA_INDEX, take(&mut self.metadata_indexes)),
        ]
    }

    fn add_record(&mut self, opcode: u8, body: &[u8]) {
        let mut record = Vec::with_capacity(9 + body.len());
        put_record(&mut record, opcode, body);
        self.add(&record);
    }

    fn add(&mut self, bytes: &[u8]) {
        self.crc.take(bytes);
        self.position += bytes.len() as u64;
        self.added.extend(bytes);
    }
}

/// The number of what has this body, counted from `first`, and whether it is new.
fn number(known: &mut Vec<Vec<u8>>, body: Vec<u8>, first: u16) -> Result<(u16, bool), String> {
    let place = known.iter().position(|one| *one == body);
    let at = place.unwrap_or(known.len());
    let at = u16::try_from(at).ok().and_then(|at| at.checked_add(first));
    let at = at.ok_or("more schemas or channels than an MCAP file can have")?;
    if place.is_none() {
        known.push(body);
    }
    Ok((at, place.is_none()))
}

/// The body with its number before it.
fn numbered(number: u16, first: u16, known: &[Vec<u8>]) -> Vec<u8> {
    let body = known.get(usize::from(number - first)).map(Vec::as_slice).unwrap_or_default();
    [&number.to_le_bytes(), body].concat()
}

fn put_record(to: &mut Vec<u8>, opcode: u8, body: &[u8]) {
    to.push(opcode);
    to.extend((body.len() as u64).to_le_bytes());
    to.extend(body);
}

/// Bytes with their number before them.
fn put_sized(to: &mut Vec<u8>, bytes: &[u8]) {
    to.extend((bytes.len() as u32).to_le_bytes());
    to.extend(bytes);
}

fn put_map(to: &mut Vec<u8>, map: &BTreeMap<String, String>) {
    let mut entries = Vec::new();
    for (key, value) in map {
        put_sized(&mut entries, key.as_bytes());
        put_sized(&mut entries, value.as_bytes());
    }
    put_sized(to, &entries);
}
