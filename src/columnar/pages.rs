//! Pages compressed by zstd (RFC 8878) and read back, in Rust alone.
//!
//! The bytes of numbers are split by place before (Parquet, "Byte Stream Split"): all first bytes,
//! all second ones and so on. So what repeats stands in runs, and the rest is left to entropy coding.
//! A block holds the bytes of one place, with a code of its own, and only runs are looked for: four
//! times as fast as looking for matches, for a twelfth more bytes (docs/decisions.md).

use crate::error::counted;
use bytes::Bytes;
use parquet::column::page::{
    CompressedPage, Page, PageMetadata, PageReader, PageWriteSpec, PageWriter,
};
use parquet::errors::ParquetError;
use parquet::file::writer::SerializedPageWriter;
use ruzstd::decoding::StreamingDecoder;
use ruzstd::encoding::{CompressionLevel, FrameCompressor, Matcher, Sequence};
use std::io::Read;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Most bytes that a page unpacks to: a file that says more was not made here.
const MAX_PAGE: u64 = 1 << 28;
/// Most values that are unpacked before somebody takes them: the longest row group of ours has a hundredth of it.
pub const MAX_VALUES: usize = 1 << 23;
/// Most bytes of a block, by the format.
const MAX_BLOCK: usize = 1 << 17;
/// A run below this costs more than it saves.
const MIN_RUN: usize = 12;

/// Writes pages of one column, compressed.
pub struct ZstdPages<'a> {
    pages: SerializedPageWriter<'a, Vec<u8>>,
    /// Bytes of a number that are split by place; 1 for what is not.
    places: usize,
}

impl<'a> ZstdPages<'a> {
    /// Writes on into `pages`.
    pub const fn new(pages: SerializedPageWriter<'a, Vec<u8>>, places: usize) -> Self {
        Self { pages, places }
    }
}

impl PageWriter for ZstdPages<'_> {
    fn write_page(&mut self, page: CompressedPage) -> Result<PageWriteSpec, ParquetError> {
        let packed = Bytes::from(zstd(page.data(), page.data().len() / self.places));
        let mut of = page.compressed_page().clone();
        match &mut of {
            Page::DataPage { buf, .. } | Page::DictionaryPage { buf, .. } => *buf = packed,
            // Its levels stay as they are; files of version 1 have none.
            Page::DataPageV2 { .. } => {
                return Err(ParquetError::General("a page of version 2".to_owned()));
            }
        }
        self.pages.write_page(CompressedPage::new(of, page.uncompressed_size()))
    }

    fn close(&mut self) -> Result<(), ParquetError> {
        self.pages.close()
    }
}

/// How pages are packed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Packing {
    /// They are not.
    Nothing,
    /// As [`ZstdPages`] packs them.
    Zstd,
    /// As Arrow packs them, if nobody asks for anything else.
    Snappy,
}

/// Reads pages of one column and unpacks them: those beneath are told that nothing is compressed.
pub struct UnpackedPages {
    pages: Box<dyn PageReader>,
    packing: Packing,
    given: Arc<AtomicUsize>,
}

impl UnpackedPages {
    /// Unpacks the pages of `pages`.
    pub fn new(pages: impl PageReader + 'static, packing: Packing) -> Self {
        Self { pages: Box::new(pages), packing, given: Arc::default() }
    }

    /// How many values its pages held since this was last set to 0: at most [`MAX_VALUES`], then it fails. A few bytes
    /// may say that a value is there a thousand million times.
    pub fn given(&self) -> Arc<AtomicUsize> {
        Arc::clone(&self.given)
    }
}

impl Iterator for UnpackedPages {
    type Item = Result<Page, ParquetError>;

    fn next(&mut self) -> Option<Self::Item> {
        self.get_next_page().transpose()
    }
}

impl PageReader for UnpackedPages {
    fn get_next_page(&mut self) -> Result<Option<Page>, ParquetError> {
        let Some(mut page) = self.pages.get_next_page()? else { return Ok(None) };
        let values = page.num_values() as usize;
        if self.given.fetch_add(values, Ordering::Relaxed).saturating_add(values) > MAX_VALUES {
            return Err(ParquetError::General(format!("more than {MAX_VALUES} values at once")));
        }
        match &mut page {
            Page::DataPage { buf, .. } | Page::DictionaryPage { buf, .. } => match self.packing {
                Packing::Nothing => {}
                Packing::Zstd => *buf = unpacked(buf)?,
                Packing::Snappy => *buf = of_snappy(buf)?,
            },
            Page::DataPageV2 { .. } if self.packing == Packing::Nothing => {}
            Page::DataPageV2 { .. } => {
                return Err(ParquetError::General("a page of version 2".to_owned()));
            }
        }
        Ok(Some(page))
    }

    fn peek_next_page(&mut self) -> Result<Option<PageMetadata>, ParquetError> {
        self.pages.peek_next_page()
    }

    fn skip_next_page(&mut self) -> Result<(), ParquetError> {
        self.pages.skip_next_page()
    }
}

fn unpacked(packed: &[u8]) -> Result<Bytes, ParquetError> {
    let wrong = |got: String| ParquetError::General(format!("a page that is no zstd frame: {got}"));
    let mut bytes = Vec::with_capacity(packed.len().saturating_mul(2));
    let frame = StreamingDecoder::new(packed).map_err(|e| wrong(e.to_string()))?;
    let read = frame.take(MAX_PAGE + 1).read_to_end(&mut bytes);
    read.map_err(|e| wrong(e.to_string()))?;
    if bytes.len() as u64 > MAX_PAGE {
        return Err(wrong(format!("it unpacks to more than {MAX_PAGE} bytes")));
    }
    Ok(Bytes::from(bytes))
}

fn of_snappy(packed: &[u8]) -> Result<Bytes, ParquetError> {
    let wrong = |got: String| ParquetError::General(format!("a page that is no Snappy: {got}"));
    let length = snap::raw::decompress_len(packed).map_err(|e| wrong(e.to_string()))?;
    // Three bytes stand for 64 at most.
    if length as u64 > MAX_PAGE || length / 22 > packed.len() {
        return Err(wrong(format!("{} that unpack to {length}", counted(packed.len(), "byte"))));
    }
    let bytes = snap::raw::Decoder::new().decompress_vec(packed);
    bytes.map(Bytes::from).map_err(|e| wrong(e.to_string()))
}

/// A frame of blocks of at most `block` bytes.
fn zstd(bytes: &[u8], block: usize) -> Vec<u8> {
    let mut packed = Vec::with_capacity(bytes.len() / 2);
    let runs = Runs { block: block.clamp(1, MAX_BLOCK), last: Vec::new() };
    let mut frame = FrameCompressor::new_with_matcher(runs, CompressionLevel::Fastest);
    frame.set_source(bytes);
    frame.set_drain(&mut packed);
    frame.compress();
    drop(frame);
    packed
}

/// Finds runs of one byte within a block.
struct Runs {
    block: usize,
    last: Vec<u8>,
}

impl Matcher for Runs {
    fn get_next_space(&mut self) -> Vec<u8> {
        vec![0; self.block]
    }

    fn get_last_space(&mut self) -> &[u8] {
        &self.last
    }

    fn commit_space(&mut self, space: Vec<u8>) {
        self.last = space;
    }

    fn skip_matching(&mut self) {}

    fn start_matching(&mut self, mut take: impl for<'a> FnMut(Sequence<'a>)) {
        let mut begin = 0;
        let mut at = 0;
        for run in self.last.chunk_by(|a, b| a == b) {
            if run.len() >= MIN_RUN {
                let literals = &self.last[begin..=at];
                take(Sequence::Triple { literals, offset: 1, match_len: run.len() - 1 });
                begin = at + run.len();
            }
            at += run.len();
        }
        if begin < at {
            take(Sequence::Literals { literals: &self.last[begin..] });
        }
    }

    fn reset(&mut self, _: CompressionLevel) {
        self.last.clear();
    }

    fn window_size(&self) -> u64 {
        MAX_BLOCK as u64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use ruzstd::decoding::FrameDecoder;

    fn unpacked(packed: &[u8]) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(1 << 20);
        FrameDecoder::new().decode_all_to_vec(packed, &mut bytes).expect("a frame");
        bytes
    }

    #[test]
    fn a_run_of_one_byte_takes_a_few() {
        let bytes = vec![7; 100_000];
        let packed = zstd(&bytes, 25_000);
        assert!(packed.len() < 40, "{}", packed.len());
        assert_eq!(unpacked(&packed), bytes);
        assert!(unpacked(&zstd(&[], 1)).is_empty());
    }

    proptest! {
        /// Runs and noise of few and of many different bytes, in blocks of any length.
        #[test]
        fn what_was_packed_is_unpacked_the_same(
            parts in prop::collection::vec((any::<u8>(), 1..3000_usize, any::<u8>()), 0..12),
            block in 1..200_000_usize,
        ) {
            let mut bytes = Vec::new();
            let mut state = 1_u32;
            for (byte, length, spread) in parts {
                bytes.extend((0..length).map(|_| {
                    state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                    byte.wrapping_add((state >> 24) as u8 & spread)
                }));
            }
            prop_assert_eq!(unpacked(&zstd(&bytes, block)), bytes);
        }
    }
}
