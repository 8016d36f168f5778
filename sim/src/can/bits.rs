//! How long a frame takes.
//!
//! Source: Bosch, "CAN Specification" 2.0 (1991), parts A and B; ISO 11898-1:2015 for CAN FD.

use super::{CanFrame, CanOptions, Kind};

/// After the last stuffed bit: CRC delimiter, acknowledgement and its delimiter, end of frame 7,
/// pause 3.
const TAIL: u64 = 13;

pub(super) fn length_ns(frame: &CanFrame, options: CanOptions) -> u64 {
    if !options.timing {
        return 0;
    }
    let ns = |bits: u64, rate: u32| bits * 1_000_000_000 / u64::from(rate.max(1));
    match frame.kind {
        Kind::Classic | Kind::Remote(_) => ns(classic_bits(frame), options.bitrate_bps),
        Kind::Fd { fast } => {
            let [slow, payload] = fd_bits(frame);
            let rate = if fast { options.data_bitrate_bps } else { options.bitrate_bps };
            ns(slow, options.bitrate_bps) + ns(payload, rate)
        }
    }
}

/// Exact.
pub(super) fn classic_bits(frame: &CanFrame) -> u64 {
    let (remote, length) = match frame.kind {
        Kind::Remote(length) => (1, length.min(8)),
        _ => (0, frame.bytes.len().min(8) as u8),
    };
    let mut bits = Vec::with_capacity(128);
    push(&mut bits, 0, 1); // start of frame
    if frame.extended {
        push(&mut bits, frame.id >> 18, 11);
        push(&mut bits, 0b11, 2); // SRR, IDE
        push(&mut bits, frame.id, 18);
        push(&mut bits, remote << 2, 3); // RTR and two reserved
    } else {
        push(&mut bits, frame.id, 11);
        push(&mut bits, remote << 2, 3); // RTR, IDE and one reserved
    }
    push(&mut bits, length.into(), 4);
    for byte in frame.bytes.iter().take(8).filter(|_| remote == 0) {
        push(&mut bits, u32::from(*byte), 8);
    }
    let check = crc15(&bits);
    push(&mut bits, check, 15);
    bits.len() as u64 + stuff_bits(&bits) + TAIL
}

fn push(bits: &mut Vec<bool>, number: u32, count: u32) {
    bits.extend((0..count).rev().map(|k| number >> k & 1 != 0));
}

fn crc15(bits: &[bool]) -> u32 {
    bits.iter().fold(0, |crc, &bit| {
        let next = bit != (crc >> 14 & 1 != 0);
        (crc << 1 & 0x7FFF) ^ if next { 0x4599 } else { 0 }
    })
}

/// After five equal bits one of the other kind, which counts for the next five.
fn stuff_bits(bits: &[bool]) -> u64 {
    let (mut stuffed, mut run, mut last) = (0, 0, None);
    for &bit in bits {
        run = if last == Some(bit) { run + 1 } else { 1 };
        last = Some(bit);
        if run == 5 {
            (stuffed, run, last) = (stuffed + 1, 1, Some(!bit));
        }
    }
    stuffed
}

/// At most: bits at the line's rate and at the payload's, with a stuff bit after every four.
fn fd_bits(frame: &CanFrame) -> [u64; 2] {
    // Start, identifier, RRS, (SRR,) IDE, FDF, reserved, BRS.
    let head = if frame.extended { 36 } else { 17 };
    let bytes = frame.bytes.len() as u64;
    let body = 1 + 4 + 8 * bytes; // ESI, length, payload
    // Stuff count and check sum, with a fixed stuff bit before every four bits.
    let check = if bytes > 16 { 4 + 21 + 7 } else { 4 + 17 + 6 };
    [head + (head - 1) / 4 + TAIL - 1, body + body.div_ceil(4) + check + 1]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bits(id: u32, extended: bool, bytes: &[u8]) -> u64 {
        classic_bits(&CanFrame::classic(id, extended, bytes))
    }

    // Davis et al., "Controller Area Network (CAN) schedulability analysis" (2007), equations 1
    // and 2: a frame of 8 bytes has 108 + 3 bits without stuffing and 135 at most with it; an
    // extended one 128 + 3 and 160.
    #[test]
    fn a_frame_is_as_long_as_the_literature_says() {
        for (extended, least, most) in [(false, 111, 135), (true, 131, 160)] {
            let longest = (0..=255_u8).map(|b| bits(0x2A, extended, &[b; 8])).max();
            let shortest = (0..=255_u8).map(|b| bits(0x2A, extended, &[b; 8])).min();
            assert!(shortest >= Some(least) && longest <= Some(most), "{shortest:?} {longest:?}");
        }
    }

    #[test]
    fn five_equal_bits_are_followed_by_another() {
        assert_eq!(stuff_bits(&[false; 5]), 1);
        assert_eq!(stuff_bits(&[false; 4]), 0);
        // The stuffed one counts: 00000 1 1111 0 ...
        let mut bits = vec![false; 5];
        bits.extend([true; 4]);
        assert_eq!(stuff_bits(&bits), 2);
    }

    #[test]
    fn a_fast_payload_is_shorter() {
        let bytes = vec![0; 64];
        let frame = |fast| CanFrame {
            id: 1,
            extended: false,
            kind: Kind::Fd { fast },
            bytes: bytes.clone(),
        };
        let options = CanOptions::default();
        let (slow, fast) = (length_ns(&frame(false), options), length_ns(&frame(true), options));
        assert!(fast < slow / 3 && fast > 100_000, "{fast} {slow}");
    }
}
