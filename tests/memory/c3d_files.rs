//! A small C3D file, and hostile ones.

use crate::c3d_made::{Made, Values};
use crate::mcap_files::cuts;
use crate::readers::Files;

/// Files that differ from a valid one in one place, at most.
const MOST: usize = 300;

pub fn minimal() -> Vec<u8> {
    Made::new(3, 8, 2, 2).bytes()
}

/// Parameters of eight bytes, as many as 8 MiB hold, before data that begin behind them.
fn parameters_without_end() -> Vec<u8> {
    let mut file = minimal();
    file[16..18].copy_from_slice(&16_000_u16.to_le_bytes());
    file.truncate(516);
    file.extend([1, 255, b'P', 3, 0, 0]);
    while file.len() < 8 << 20 {
        // A name of one letter, in group 1: one byte, described by nothing.
        file.extend([1, 1, b'a', 6, 0, 1, 0, 7, 0]);
    }
    file
}

/// One frame of as many points, channels and labels of nothing as can be.
fn wide(points: usize, channels: usize) -> Vec<u8> {
    let mut made = Made::new(1, 1, 0, 0);
    (made.points, made.channels, made.per_frame) = (points, channels, usize::from(channels > 0));
    made.real = false;
    made.set("POINT", "USED", &[], Values::Ints(vec![points as i32]));
    made.set("ANALOG", "USED", &[], Values::Ints(vec![channels as i32]));
    made.set("POINT", "LABELS", &[0, 255], Values::Text(vec![""; 255]));
    made.bytes()
}

pub fn hostile(minimal: &[u8]) -> Vec<(&'static str, Files)> {
    let (cut, bent) = (minimal.to_vec(), minimal.to_vec());
    let flipped = move || {
        let step = bent.len().div_ceil(MOST);
        let places = (0..bent.len()).step_by(step);
        places
            .map(|at| {
                let mut file = bent.clone();
                file[at] = [0x00, 0x7f, 0x80, 0xff][at % 4];
                file
            })
            .collect()
    };
    let lies = || {
        let words = [1, 2, 3, 4, 5, 9, 10, 151];
        let header = |word| [0, 255, 32_768, 65_535].map(|lie| vec![(word, lie)]);
        let made = |header| Made { header, ..Made::new(3, 8, 2, 2) }.bytes();
        words.into_iter().flat_map(header).map(made).collect()
    };
    vec![
        ("cut-off-anywhere", Box::new(move || cuts(&cut, MOST))),
        ("a-byte-that-is-another", Box::new(flipped)),
        ("lies-in-the-header", Box::new(lies)),
        ("parameters-without-end", Box::new(|| vec![parameters_without_end()])),
        ("as-many-points-as-can-be", Box::new(|| vec![wide(16_384, 0)])),
        ("as-many-channels-as-can-be", Box::new(|| vec![wide(0, 16_384)])),
        ("points-and-channels", Box::new(|| vec![wide(16_384, 16_384), wide(65_535, 65_535)])),
        ("zeros", Box::new(|| vec![vec![0; 1 << 20], vec![0x50; 1 << 20]])),
        (
            "a-long-one",
            Box::new(|| vec![Made { real: false, ..Made::new(20, 40_000, 2, 5) }.bytes()]),
        ),
    ]
}
