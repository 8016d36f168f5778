//! An MCAP file of messages that others define: written on the way, a chunk at a time.

use std::collections::BTreeMap;
use std::io::{self, Write};

use mcap::records::MessageHeader;

use super::mcap_file::McapFile;
use super::packing::Compression;

/// A chunk is closed once its messages have so many bytes.
const CHUNK_BYTES: usize = 1 << 20;

/// What the messages of a channel are.
#[derive(Clone, Copy, Debug)]
pub struct Schema<'a> {
    /// Its name, as readers know it.
    pub name: &'a str,
    /// How it is told (<https://mcap.dev/spec/registry>), as `protobuf` or `jsonschema`.
    pub encoding: &'a str,
    /// It.
    pub data: &'a [u8],
    /// How its messages are coded, as `protobuf` or `json`.
    pub messages: &'a str,
}

/// A file in the making. Messages come in the order of their times.
pub struct MessageFile<W: Write> {
    mcap: McapFile,
    to: W,
    /// Bytes of messages in the open chunk.
    open_bytes: usize,
    /// Messages of each channel.
    counts: Vec<u32>,
}

impl<W: Write> MessageFile<W> {
    /// One that is written here.
    #[must_use]
    pub fn new(to: W) -> Self {
        Self { mcap: McapFile::new(Compression::Zstd), to, open_bytes: 0, counts: Vec::new() }
    }

    /// The number of a channel with this topic.
    ///
    /// # Errors
    /// More channels than a file can have.
    pub fn channel(&mut self, topic: &str, schema: Schema<'_>) -> io::Result<u16> {
        let Schema { name, encoding, data, messages } = schema;
        let number = self.mcap.add_schema(name, encoding, data).map_err(io::Error::other)?;
        let none = BTreeMap::new();
        let number =
            self.mcap.add_channel(number, topic, messages, &none).map_err(io::Error::other)?;
        self.counts.resize(self.counts.len().max(usize::from(number) + 1), 0);
        Ok(number)
    }

    /// Adds a message of a time, ns since 1970.
    ///
    /// # Errors
    /// A channel that was not added, what cannot be written.
    pub fn add(&mut self, channel: u16, time_ns: u64, message: &[u8]) -> io::Result<()> {
        let sequence = self.counts.get(usize::from(channel)).copied().unwrap_or(0);
        let header = MessageHeader {
            channel_id: channel,
            sequence,
            log_time: time_ns,
            publish_time: time_ns,
        };
        self.mcap.add_message(&header, message).map_err(io::Error::other)?;
        if let Some(count) = self.counts.get_mut(usize::from(channel)) {
            *count = sequence.wrapping_add(1);
        }
        self.open_bytes += message.len();
        if self.open_bytes >= CHUNK_BYTES {
            self.mcap.close_chunk().map_err(io::Error::other)?;
            self.open_bytes = 0;
            self.to.write_all(&self.mcap.take())?;
        }
        Ok(())
    }

    /// Ends the file.
    ///
    /// # Errors
    /// What cannot be written.
    pub fn finish(mut self) -> io::Result<W> {
        self.mcap.finish().map_err(io::Error::other)?;
        self.to.write_all(&self.mcap.take())?;
        Ok(self.to)
    }
}
