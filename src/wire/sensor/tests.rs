//! What holds of every stream format for every input, tried on generated ones.
//!
//! The packets are built here by hand, sums bit by bit, so that no code under test takes part.

use super::{Format, Lines, Reading, Stream, decode};
use crate::wire::Decoded;
use proptest::collection::vec;
use proptest::prelude::*;

fn columns(text: &str) -> Vec<super::Column> {
    text.split(' ').map(|name| name.parse().expect("a column")).collect()
}

fn formats() -> Vec<Format> {
    vec![
        Format::WitMotion,
        Format::WitMotionBle,
        Format::Bno08xRvc,
        Format::Xsens,
        Format::VectorNavBinary,
        Format::VectorNavAscii,
        Format::XImu3,
        Format::Teapot,
        Format::Lines(Lines {
            prefix: String::new(),
            check: false,
            columns: columns("counter ax ay az"),
        }),
        Format::Lines(Lines {
            prefix: "$IMU".to_owned(),
            check: true,
            columns: columns("counter ax ay az"),
        }),
        Format::Cobs(columns("counter:u16 ax:i16 ay:i16 az:f32")),
        Format::Slip(columns("counter:u16 ax:i16 ay:i16 az:f32")),
    ]
}

/// Packet number `n` of a stream of this format.
fn packet(format: &Format, n: u8) -> Vec<u8> {
    let seen = |body: &[u8]| body.iter().fold(0_u8, |sum, b| sum.wrapping_add(*b));
    match format {
        Format::WitMotion => {
            let mut out = vec![0x55, 0x51, n, 1, n, 2, n, 3, n, 4];
            out.push(seen(&out));
            out
        }
        Format::WitMotionBle => {
            let mut out = vec![0x55, 0x61];
            out.extend((0..18).map(|at| n ^ (at << 1)));
            out
        }
        Format::Bno08xRvc => {
            let mut out = vec![0xAA, 0xAA, n, 1, 0, 2, 0, 3, 0, n, 0, 5, 0, 6, 0, 0, 0, 0];
            out.push(seen(&out[2..]));
            out
        }
        Format::Xsens => {
            let mut out = vec![0xFA, 0xFF, 0x36, 5, 0x10, 0x20, 2, 0, n];
            out.push(0_u8.wrapping_sub(seen(&out[1..])));
            out
        }
        Format::VectorNavBinary => {
            let mut out = vec![0xFA, 0x01, 0x01, 0x00, n, 2, 3, 4, 5, 6, 7, 8];
            let mut crc = 0_u32;
            for bit in out[1..].iter().flat_map(|b| (0..8).rev().map(move |i| b >> i & 1)) {
                let carry = crc >> 15 & 1 ^ u32::from(bit);
                crc = (crc << 1 & 0xFFFF) ^ if carry == 1 { 0x1021 } else { 0 };
            }
            out.extend((crc as u16).to_be_bytes());
            out
        }
        Format::VectorNavAscii => sealed(&format!("VNYPR,{n},-1.5,+007.25")),
        Format::XImu3 if n.is_multiple_of(2) => format!("M,{n}000,0.5,1.5,-2.5\r\n").into_bytes(),
        Format::XImu3 => {
            let mut out =
                vec![0x80 + b'T', n & 0x0F | 0x40, 0, 0, 0, 0, 0, 0, 0, 0xDB, 0xDC, 0xDB, 0xDD];
            out.extend([0x40, 0x41, 0x0A]);
            out
        }
        Format::Teapot => vec![0x24, 0x02, n, 1, 1, n, 3, 4, 5, 6, 0, n, 0x0D, 0x0A],
        Format::Lines(Lines { check: false, .. }) => {
            format!("{n}, ax:0.5, ay=1e-3 ,-9.81\r\n").into_bytes()
        }
        Format::Lines(_) => sealed(&format!("IMU,{n},0.5,0.001,-9.81")),
        Format::Cobs(_) => {
            let record = [n | 1, 1, 2, 3, 4, 5, 6, 7, 8, 9];
            [&[11], &record[..], &[0]].concat()
        }
        Format::Slip(_) => [&[n & 0x7F, 1, 2, 3, 4, 5, 6, 7, 8, 9][..], &[0xC0]].concat(),
    }
}

fn sealed(body: &str) -> Vec<u8> {
    let check = body.bytes().fold(0, |check, byte| check ^ byte);
    format!("${body}*{check:02X}\r\n").into_bytes()
}

fn readings(format: &Format, bytes: &[u8], portion: usize) -> Vec<Reading> {
    let mut stream = Stream::new(format.clone());
    let mut found = Vec::new();
    for portion in bytes.chunks(portion) {
        stream.push(portion, |reading| found.push(reading));
    }
    assert_eq!(stream.counts().packets, found.len() as u64);
    found
}

/// Bytes that look like packets often enough to reach what lies behind the checks.
fn noise() -> impl Strategy<Value = Vec<u8>> {
    let telling = prop::sample::select(
        b"\x55\x51\x61\xAA\xFA\xFF\x36\x01\x24\x02\x0A\x0D\xDB\xDC\xC0\x00$VNI,*".to_vec(),
    );
    vec(prop_oneof![telling, any::<u8>()], 0..1500)
}

#[test]
fn every_packet_built_by_hand_is_read() {
    for format in formats() {
        let bytes: Vec<u8> = (0..100).flat_map(|n| packet(&format, n)).collect();
        let found = readings(&format, &bytes, 7);
        assert_eq!(found.len(), 100, "{format:?}");
        assert!(found.iter().all(|reading| *reading != Reading::default()), "{format:?}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(if cfg!(miri) { 4 } else { 200 }))]

    #[test]
    fn any_bytes_are_decoded_in_steps_that_take_something(bytes in noise()) {
        for format in formats() {
            let mut rest = &bytes[..];
            loop {
                let taken = match decode(&format, rest) {
                    Decoded::Need(more) => {
                        prop_assert!(more > 0 && rest.len() + more <= 1100, "{format:?} {more}");
                        break;
                    }
                    Decoded::Packet(_, n) | Decoded::Bad(_, n) | Decoded::Skip(n)
                    | Decoded::Echo(n) => n,
                };
                prop_assert!(taken > 0 && taken <= rest.len(), "{format:?}");
                rest = &rest[taken..];
            }
        }
    }

    #[test]
    #[cfg_attr(miri, ignore = "too many tries for an interpreter")]
    fn it_does_not_matter_in_which_portions_bytes_arrive(
        bytes in noise(),
        portion in 1_usize..40,
    ) {
        for format in formats() {
            let mut mixed = packet(&format, 3);
            mixed.extend(&bytes);
            mixed.extend(packet(&format, 4));
            // Bytes may spell what is not a number, which equals nothing: words are compared.
            let words = |portion: usize| format!("{:?}", readings(&format, &mixed, portion));
            prop_assert_eq!(
                words(portion),
                words(usize::MAX),
                "{:?}", format
            );
        }
    }

    /// Bytes lost, changed and added in a packet cost that packet and at most three after it, unless
    /// they make a false packet whose checksum of one byte fits by chance: that costs what its length
    /// byte claims.
    #[test]
    #[cfg_attr(miri, ignore = "too many tries for an interpreter")]
    fn after_any_damage_the_stream_is_read_again(
        from in 0_usize..40,
        lost in 0_usize..25,
        added in vec(any::<u8>(), 0..25),
    ) {
        for format in formats() {
            prop_assert!(is_read_again(&format, from, lost, &added), "{format:?}");
        }
    }
}

/// True if what follows the damage is read as it is without it.
fn is_read_again(format: &Format, from: usize, lost: usize, added: &[u8]) -> bool {
    let packets: Vec<_> = (0..200).map(|n| packet(format, n)).collect();
    let whole = readings(format, &packets.concat(), usize::MAX);
    let mut bytes = packets.concat();
    let end = (from + lost).min(bytes.len());
    let damaged = (0..200).find(|&n| packets[..n].concat().len() >= end).unwrap_or(200);
    bytes.splice(from..end, added.iter().copied());
    let found = readings(format, &bytes, 64);
    let false_packet = found.iter().any(|reading| !whole.contains(reading));
    // A length byte claims 255 bytes at most, besides the head and the checksum.
    let claimed = if false_packet { 260_usize.div_ceil(packets[0].len()) } else { 0 };
    found.ends_with(&whole[damaged + 4 + claimed..])
}

#[test]
fn a_false_packet_whose_checksum_fits_by_chance_costs_what_its_length_claims() {
    // Of 256 such packets with 114 bytes of body one fits; the body reaches into the packets behind.
    let body = [181, 145, 51, 199, 161, 216, 147, 52, 244, 92, 204, 86, 15, 101, 60];
    let costs = |last: u8| {
        let added: Vec<u8> = [69, 114].into_iter().chain(body).chain([last]).collect();
        assert!(is_read_again(&Format::Xsens, 2, 9, &added), "{last}");
        let packets: Vec<u8> = (0..200).flat_map(|n| packet(&Format::Xsens, n)).collect();
        let damaged = [&packets[..2], &added, &packets[11..]].concat();
        200 - readings(&Format::Xsens, &damaged, 64).len()
    };
    let dearest = (0..=255).map(costs).max();
    assert!(dearest > Some(8), "none fits: {dearest:?}");
}
