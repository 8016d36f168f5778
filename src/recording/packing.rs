//! How the chunks of an MCAP file are packed: LZ4 and Zstandard frames, or not at all
//! (<https://mcap.dev/spec/registry>, "Well-known compression formats").

use std::fmt;
use std::io::{Read, Write};
use std::str::FromStr;

use lz4_flex::frame::{FrameDecoder as Lz4Decoder, FrameEncoder, FrameInfo};
use ruzstd::decoding::{FrameDecoder as ZstdDecoder, StreamingDecoder};
use ruzstd::encoding::{CompressionLevel, compress_to_vec};

/// A chunk may unpack to this: recorders close chunks at 1 to 4 MiB. Twice as much again may be needed while it is
/// unpacked.
const UNPACKED_BYTES: usize = 6 << 20;
/// The window that a Zstandard frame may ask for, as its default greatest level does. Memory is only
/// taken for what was unpacked.
const WINDOW_BYTES: u64 = 128 << 20;

/// What an LZ4 frame begins with (<https://github.com/lz4/lz4/blob/dev/doc/lz4_Frame_format.md>).
const LZ4_FRAME: [u8; 4] = 0x184D_2204_u32.to_le_bytes();

/// How the chunks of a recording are packed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Compression {
    /// As they are.
    None,
    /// LZ4 frames: the usual, by measurement (docs/decisions.md).
    #[default]
    Lz4,
    /// Zstandard frames.
    Zstd,
}

impl Compression {
    /// All there are.
    pub const ALL: [Self; 3] = [Self::None, Self::Lz4, Self::Zstd];

    /// As a person writes it.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::None => "none",
            other => other.name(),
        }
    }

    /// As the format names it.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::None => "",
            Self::Lz4 => "lz4",
            Self::Zstd => "zstd",
        }
    }

    pub(super) fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|one| one.name() == name)
    }

    /// Packs the records of a chunk.
    pub(super) fn pack(self, records: Vec<u8>) -> Result<Vec<u8>, String> {
        match self {
            Self::None => Ok(records),
            Self::Zstd => Ok(compress_to_vec(&*records, CompressionLevel::Fastest)),
            Self::Lz4 => {
                let size = FrameInfo::new().content_size(Some(records.len() as u64));
                let mut encoder = FrameEncoder::with_frame_info(size, Vec::new());
                encoder.write_all(&records).map_err(|error| error.to_string())?;
                encoder.finish().map_err(|error| error.to_string())
            }
        }
    }

    /// Unpacks a chunk that is said to hold `size` bytes.
    pub(super) fn unpack(self, packed: &[u8], size: u64) -> Result<Vec<u8>, Packed> {
        let size = usize::try_from(size).ok().filter(|size| *size <= UNPACKED_BYTES);
        let Some(size) = size else { return Err(Packed::TooMuch { most: UNPACKED_BYTES }) };
        match self {
            Self::None => read(packed, size),
            // Older kinds of frames have larger blocks, and are not what the format names.
            Self::Lz4 if !packed.starts_with(&LZ4_FRAME) => Err(Packed::Broken),
            Self::Lz4 => read(Lz4Decoder::new(packed), size),
            Self::Zstd => {
                let mut decoder = ZstdDecoder::new();
                decoder.set_max_window_size(WINDOW_BYTES);
                let stream = StreamingDecoder::new_with_decoder(packed, decoder);
                read(stream.map_err(|_| Packed::Broken)?, size)
            }
        }
    }
}

/// Reads exactly `size` bytes, which is all there may be.
fn read(source: impl Read, size: usize) -> Result<Vec<u8>, Packed> {
    // One more, so that what holds more is seen to.
    let mut records = Vec::with_capacity(size + 1);
    let told = source.take(size as u64 + 1).read_to_end(&mut records);
    if told.is_err() || records.len() != size { Err(Packed::Broken) } else { Ok(records) }
}

/// Why a chunk was not unpacked.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Packed {
    /// It is damaged, or holds another number of bytes than it says.
    Broken,
    /// It says that it unpacks to more than is taken into memory.
    TooMuch { most: usize },
}

impl fmt::Display for Compression {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(self.word())
    }
}

impl FromStr for Compression {
    type Err = String;

    fn from_str(word: &str) -> Result<Self, String> {
        let known = Self::ALL.into_iter().find(|one| one.word() == word);
        known.ok_or_else(|| "zstd, lz4 and none are known".into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn what_was_packed_is_unpacked_the_same(
            bytes in prop::collection::vec(0u8..20, 0..9000),
            which in 0..3usize,
        ) {
            let packing = Compression::ALL[which];
            let packed = packing.pack(bytes.clone()).unwrap();
            let size = bytes.len() as u64;
            prop_assert_eq!(packing.unpack(&packed, size).unwrap(), bytes);
            // A chunk that says too much or too little of itself is not believed.
            prop_assert_eq!(packing.unpack(&packed, size + 1), Err(Packed::Broken));
            if size > 0 {
                prop_assert_eq!(packing.unpack(&packed, size - 1), Err(Packed::Broken));
            }
        }

        #[test]
        fn damaged_frames_give_no_panic(
            bytes in prop::collection::vec(0u8..20, 1..3000),
            which in 0..3usize,
            at in any::<prop::sample::Index>(),
            byte in any::<u8>(),
            end in any::<prop::sample::Index>(),
        ) {
            let packing = Compression::ALL[which];
            let mut packed = packing.pack(bytes.clone()).unwrap();
            let at = at.index(packed.len());
            packed[at] = byte;
            packed.truncate(end.index(packed.len() + 1));
            let _ = packing.unpack(&packed, bytes.len() as u64);
        }
    }

    #[test]
    fn a_chunk_that_swells_beyond_bounds_is_refused_before_memory_is_asked_for() {
        let zeros = vec![0; UNPACKED_BYTES + (1 << 20)];
        for packing in [Compression::Lz4, Compression::Zstd] {
            let packed = packing.pack(zeros.clone()).unwrap();
            let most = UNPACKED_BYTES;
            assert!(packed.len() < 1 << 20, "{packing}: {}", packed.len());
            let told = packing.unpack(&packed, zeros.len() as u64);
            assert_eq!(told, Err(Packed::TooMuch { most }), "{packing}");
            assert_eq!(packing.unpack(&packed, 7), Err(Packed::Broken), "{packing}");
        }
    }

    #[test]
    fn words_are_read_as_they_are_written() {
        for packing in Compression::ALL {
            assert_eq!(packing.word().parse(), Ok(packing));
            assert_eq!(Compression::from_name(packing.name()), Some(packing));
        }
        assert!("gzip".parse::<Compression>().is_err());
    }
}
