//! Bodies of MCAP records, decoded in place (<https://mcap.dev/spec>, "Records" and "Serialization").
//!
//! A file says how long its strings and maps are. Here every such length is held against the bytes
//! that are there before memory is asked for; the reader of the `mcap` crate asks first.

use std::collections::BTreeMap;

use mcap::records::{MessageHeader, Metadata, op};

/// Most entries of one map. What a recorder says of a sensor or a run takes a few dozen.
const MAP_ENTRIES: usize = 8192;

/// A record that says something about the messages, or holds them.
#[derive(Debug, PartialEq)]
pub(super) enum Record<'a> {
    Schema(SchemaRecord<'a>),
    Channel(ChannelRecord<'a>),
    Message(MessageHeader, &'a [u8]),
    Chunk(ChunkRecord<'a>),
    Metadata(Metadata),
}

#[derive(Debug, PartialEq)]
pub(super) struct SchemaRecord<'a> {
    pub(super) id: u16,
    pub(super) name: &'a str,
    pub(super) encoding: &'a str,
    pub(super) text: &'a [u8],
}

#[derive(Debug, PartialEq)]
pub(super) struct ChannelRecord<'a> {
    pub(super) id: u16,
    pub(super) schema_id: u16,
    pub(super) topic: &'a str,
    pub(super) encoding: &'a str,
    pub(super) metadata: BTreeMap<String, String>,
}

#[derive(Debug, PartialEq)]
pub(super) struct ChunkRecord<'a> {
    /// Of the records; zero says that there is none.
    pub(super) crc: u32,
    pub(super) compression: &'a str,
    /// Bytes of the records once they are unpacked.
    pub(super) size: u64,
    pub(super) records: &'a [u8],
}

impl<'a> Record<'a> {
    /// Decodes a body; `None` if it is malformed, or of a record that is not read here. Bytes
    /// behind the last field are passed over: later versions of the format may put fields there.
    pub(super) fn decode(opcode: u8, body: &'a [u8]) -> Option<Self> {
        let mut fields = Fields(body);
        Some(match opcode {
            op::SCHEMA => Self::Schema(SchemaRecord {
                id: fields.u16()?,
                name: fields.text()?,
                encoding: fields.text()?,
                text: fields.sized_bytes()?,
            }),
            op::CHANNEL => Self::Channel(ChannelRecord {
                id: fields.u16()?,
                schema_id: fields.u16()?,
                topic: fields.text()?,
                encoding: fields.text()?,
                metadata: fields.map()?,
            }),
            op::MESSAGE => {
                let header = MessageHeader {
                    channel_id: fields.u16()?,
                    sequence: fields.u32()?,
                    log_time: fields.u64()?,
                    publish_time: fields.u64()?,
                };
                Self::Message(header, fields.0)
            }
            op::CHUNK => {
                // First and last time of its messages.
                fields.bytes(16)?;
                let (size, crc, compression) = (fields.u64()?, fields.u32()?, fields.text()?);
                let bytes = usize::try_from(fields.u64()?).ok()?;
                Self::Chunk(ChunkRecord { crc, compression, size, records: fields.bytes(bytes)? })
            }
            op::METADATA => {
                let name = fields.text()?.to_owned();
                Self::Metadata(Metadata { name, metadata: fields.map()? })
            }
            _ => return None,
        })
    }
}

/// The fields of a body that are still to be read; little-endian.
struct Fields<'a>(&'a [u8]);

impl<'a> Fields<'a> {
    fn bytes(&mut self, count: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.0.split_at_checked(count)?;
        self.0 = rest;
        Some(taken)
    }

    fn array<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (taken, rest) = self.0.split_first_chunk()?;
        self.0 = rest;
        Some(*taken)
    }

    fn u16(&mut self) -> Option<u16> {
        self.array().map(u16::from_le_bytes)
    }

    fn u32(&mut self) -> Option<u32> {
        self.array().map(u32::from_le_bytes)
    }

    fn u64(&mut self) -> Option<u64> {
        self.array().map(u64::from_le_bytes)
    }

    /// Bytes with their number before them.
    fn sized_bytes(&mut self) -> Option<&'a [u8]> {
        let count = self.u32()?;
        self.bytes(count as usize)
    }

    fn text(&mut self) -> Option<&'a str> {
        str::from_utf8(self.sized_bytes()?).ok()
    }

    /// Texts by name, each name once.
    fn map(&mut self) -> Option<BTreeMap<String, String>> {
        let mut entries = Fields(self.sized_bytes()?);
        let mut map = BTreeMap::new();
        while !entries.0.is_empty() {
            let (key, value) = (entries.text()?, entries.text()?);
            let twice = map.insert(key.to_owned(), value.to_owned()).is_some();
            if twice || map.len() > MAP_ENTRIES {
                return None;
            }
        }
        Some(map)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use mcap::records::Record as Theirs;
    use proptest::prelude::*;

    const OPCODES: [u8; 5] = [op::SCHEMA, op::CHANNEL, op::MESSAGE, op::CHUNK, op::METADATA];

    fn sized(bytes: &[u8]) -> Vec<u8> {
        [&(bytes.len() as u32).to_le_bytes()[..], bytes].concat()
    }

    fn map(entries: &BTreeMap<String, String>) -> Vec<u8> {
        let entry = |(key, value): (&String, &String)| {
            [sized(key.as_bytes()), sized(value.as_bytes())].concat()
        };
        sized(&entries.iter().flat_map(entry).collect::<Vec<u8>>())
    }

    /// The same of a record as the `mcap` crate reads it.
    fn of_the_library(record: Theirs) -> String {
        match record {
            Theirs::Schema { header, data } => {
                format!("{} {} {} {data:?}", header.id, header.name, header.encoding)
            }
            Theirs::Channel(c) => {
                let (id, schema) = (c.id, c.schema_id);
                format!("{id} {schema} {} {} {:?}", c.topic, c.message_encoding, c.metadata)
            }
            Theirs::Message { header, data } => format!("{header:?} {data:?}"),
            Theirs::Chunk { header, data } => {
                let (crc, size) = (header.uncompressed_crc, header.uncompressed_size);
                format!("{crc} {size} {} {data:?}", header.compression)
            }
            Theirs::Metadata(metadata) => format!("{metadata:?}"),
            other => format!("{other:?}"),
        }
    }

    fn of_ours(record: &Record) -> String {
        match record {
            Record::Schema(s) => format!("{} {} {} {:?}", s.id, s.name, s.encoding, s.text),
            Record::Channel(c) => {
                let (id, schema) = (c.id, c.schema_id);
                format!("{id} {schema} {} {} {:?}", c.topic, c.encoding, c.metadata)
            }
            Record::Message(header, data) => format!("{header:?} {data:?}"),
            Record::Chunk(c) => format!("{} {} {} {:?}", c.crc, c.size, c.compression, c.records),
            Record::Metadata(metadata) => format!("{metadata:?}"),
        }
    }

    /// A valid body of a record with this opcode.
    fn body(opcode: u8, text: &str, data: &[u8], entries: &BTreeMap<String, String>) -> Vec<u8> {
        let text = sized(text.as_bytes());
        match opcode {
            op::SCHEMA => [&[1, 2][..], &text, &text, &sized(data)].concat(),
            op::CHANNEL => [&[1, 2, 3, 4][..], &text, &text, &map(entries)].concat(),
            op::MESSAGE => [&[7; 22][..], data].concat(),
            op::CHUNK => {
                let length = (data.len() as u64).to_le_bytes();
                [&[9; 28][..], &text, &length, data].concat()
            }
            _ => [text, map(entries)].concat(),
        }
    }

    proptest! {
        #[test]
        fn a_valid_body_is_read_as_the_library_reads_it(
            which in 0..OPCODES.len(),
            text in ".{0,9}",
            data in prop::collection::vec(any::<u8>(), 0..40),
            entries in prop::collection::btree_map(".{0,5}", ".{0,5}", 0..5),
        ) {
            let opcode = OPCODES[which];
            let body = body(opcode, &text, &data, &entries);
            let theirs = mcap::parse_record(opcode, &body).expect("a valid body");
            let ours = Record::decode(opcode, &body).expect("a valid body");
            prop_assert_eq!(of_ours(&ours), of_the_library(theirs));
        }

        #[test]
        fn what_is_read_of_a_damaged_body_the_library_reads_the_same(
            which in 0..OPCODES.len(),
            entries in prop::collection::btree_map(".{0,5}", ".{0,5}", 0..5),
            at in any::<prop::sample::Index>(),
            byte in any::<u8>(),
            end in any::<prop::sample::Index>(),
        ) {
            let opcode = OPCODES[which];
            let mut body = body(opcode, "text", b"data", &entries);
            let at = at.index(body.len());
            body[at] = byte;
            body.truncate(end.index(body.len() + 1));
            // The other way round nothing is asked: the library would set gigabytes aside.
            if let Some(ours) = Record::decode(opcode, &body) {
                let theirs = mcap::parse_record(opcode, &body).expect("what we could read");
                prop_assert_eq!(of_ours(&ours), of_the_library(theirs));
            }
        }
    }

    #[test]
    fn lengths_beyond_the_body_and_names_said_twice_are_malformed() {
        // Where the first length of each stands.
        for (opcode, at) in [(op::SCHEMA, 2), (op::CHANNEL, 4), (op::CHUNK, 28), (op::METADATA, 0)]
        {
            let body = [&vec![0; at][..], &u32::MAX.to_le_bytes(), &[b'x'; 100]].concat();
            assert_eq!(Record::decode(opcode, &body), None, "opcode {opcode}");
        }
        let entry = [sized(b"key"), sized(b"value")].concat();
        let once = [sized(b"name"), sized(&entry)].concat();
        let twice = [sized(b"name"), sized(&entry.repeat(2))].concat();
        assert!(Record::decode(op::METADATA, &once).is_some());
        assert_eq!(Record::decode(op::METADATA, &twice), None);
    }

    #[test]
    fn a_map_has_as_many_entries_as_anybody_needs_and_no_more() {
        let of = |count: usize| {
            let entries = (0..count).map(|n| (n.to_string(), String::new())).collect();
            Record::decode(op::METADATA, &[sized(b"name"), map(&entries)].concat()).is_some()
        };
        assert!(of(MAP_ENTRIES));
        assert!(!of(MAP_ENTRIES + 1));
    }
}
