//! DYNAMIXEL Protocol 2.0 bytes as the device sees them.
//!
//! Source: ROBOTIS e-Manual, "DYNAMIXEL Protocol 2.0" (packet, byte stuffing, CRC).
//! Example: `FF FF FD 00 01 03 00 01 19 4E` is a ping to ID 1; model 1030 with firmware 38 answers
//! `FF FF FD 00 01 07 00 55 00 06 04 26 65 5D`.

use crate::exchange::Scan;
use std::borrow::Cow;

const HEADER: [u8; 4] = [0xFF, 0xFF, 0xFD, 0x00];
/// The manual gives no size of a device's receive buffer; this is the maker's SDK's.
const LONGEST: usize = 1024;
const STATUS: u8 = 0x55;

/// CRC-16 with polynomial 0x8005, start 0, bits from the top, as in the e-Manual's "CRC
/// Calculation".
const CRC_TABLE: [u16; 256] = {
    let mut table = [0; 256];
    let mut byte = 0;
    while byte < 256 {
        let mut crc = (byte as u16) << 8;
        let mut bit = 0;
        while bit < 8 {
            crc = if crc & 0x8000 != 0 { crc << 1 ^ 0x8005 } else { crc << 1 };
            bit += 1;
        }
        table[byte] = crc;
        byte += 1;
    }
    table
};

/// The CRC after `bytes`, given the CRC before them.
pub(crate) fn crc_after(crc: u16, bytes: &[u8]) -> u16 {
    bytes.iter().fold(crc, |crc, &byte| crc << 8 ^ CRC_TABLE[usize::from((crc >> 8) as u8 ^ byte)])
}

/// What stands at the start of `bytes`.
pub(crate) fn scan(bytes: &[u8]) -> Scan {
    let common = bytes.iter().zip(HEADER).take_while(|&(&byte, header)| byte == header).count();
    if common < HEADER.len() {
        if common == bytes.len() {
            return Scan::Incomplete;
        }
        // Not a header: look for the next place where one could begin.
        let next = bytes.iter().skip(1).position(|&byte| byte == 0xFF);
        return Scan::Skip(next.map_or(bytes.len(), |at| at + 1));
    }
    if bytes.len() < 7 {
        return Scan::Incomplete;
    }
    let length = usize::from(u16::from_le_bytes([bytes[5], bytes[6]]));
    let total = length + 7;
    if length < 3 || total > LONGEST {
        return Scan::Skip(1);
    }
    if bytes.len() < total {
        return Scan::Incomplete;
    }
    let crc = u16::from_le_bytes([bytes[total - 2], bytes[total - 1]]);
    if crc_after(0, &bytes[..total - 2]) == crc { Scan::Packet(total) } else { Scan::Spoilt(total) }
}

/// ID, instruction and parameters of a packet [`scan`] found whole.
pub(crate) fn open(packet: &[u8]) -> (u8, u8, Cow<'_, [u8]>) {
    let body = unstuff(&packet[7..packet.len() - 2]);
    let id = packet[4];
    match body {
        Cow::Borrowed(body) => (id, body[0], Cow::Borrowed(&body[1..])),
        Cow::Owned(mut body) => {
            let code = body.remove(0);
            (id, code, Cow::Owned(body))
        }
    }
}

fn unstuff(body: &[u8]) -> Cow<'_, [u8]> {
    if !body.windows(4).any(|four| four == [0xFF, 0xFF, 0xFD, 0xFD]) {
        return Cow::Borrowed(body);
    }
    let mut plain: Vec<u8> = Vec::with_capacity(body.len());
    let mut skip = false;
    for &byte in body {
        if skip && byte == 0xFD {
            skip = false;
            continue;
        }
        plain.push(byte);
        skip = plain.ends_with(&[0xFF, 0xFF, 0xFD]);
    }
    Cow::Owned(plain)
}

/// A status packet; `error` holds the alert bit and the error number.
pub(crate) fn status(id: u8, error: u8, params: &[u8]) -> Vec<u8> {
    let mut packet = Vec::with_capacity(params.len() + 11);
    packet.extend_from_slice(&HEADER);
    packet.extend_from_slice(&[id, 0, 0, STATUS]);
    for &byte in [error].iter().chain(params) {
        packet.push(byte);
        // Stuffing starts with the instruction byte, at index 7.
        if packet.len() >= 10 && packet.ends_with(&[0xFF, 0xFF, 0xFD]) {
            packet.push(0xFD);
        }
    }
    close(&mut packet);
    packet
}

/// Sets the length field and appends the CRC.
fn close(packet: &mut Vec<u8>) {
    let length = (packet.len() - 7 + 2) as u16;
    packet[5..7].copy_from_slice(&length.to_le_bytes());
    let crc = crc_after(0, packet);
    packet.extend_from_slice(&crc.to_le_bytes());
}

/// The head of a merged status with `length` bytes after the length field.
pub(crate) fn merged_head(length: u16) -> Vec<u8> {
    let [low, high] = length.to_le_bytes();
    vec![0xFF, 0xFF, 0xFD, 0x00, 0xFE, low, high, STATUS]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_crc_is_that_of_the_manual() {
        // CRC-16/UMTS check value, and the table's first and last entries in the e-Manual.
        assert_eq!(crc_after(0, b"123456789"), 0xFEE8);
        assert_eq!(CRC_TABLE[..8], [0, 0x8005, 0x800F, 0x000A, 0x801B, 0x001E, 0x0014, 0x8011]);
        assert_eq!(CRC_TABLE[255], 0x0202);
    }

    #[test]
    fn stuffed_bytes_are_taken_out_also_where_runs_overlap() {
        let cases: [(&[u8], &[u8]); 5] = [
            (&[0xFF, 0xFF, 0xFD, 0xFD], &[0xFF, 0xFF, 0xFD]),
            (&[0xFF, 0xFF, 0xFD, 0xFD, 0xFD], &[0xFF, 0xFF, 0xFD, 0xFD]),
            (&[0xFF, 0xFF, 0xFF, 0xFD, 0xFD], &[0xFF, 0xFF, 0xFF, 0xFD]),
            (
                &[0xFF, 0xFF, 0xFD, 0xFD, 0xFF, 0xFF, 0xFD, 0xFD],
                &[0xFF, 0xFF, 0xFD, 0xFF, 0xFF, 0xFD],
            ),
            (&[0xFF, 0xFF, 0x01, 0xFD], &[0xFF, 0xFF, 0x01, 0xFD]),
        ];
        for (stuffed, plain) in cases {
            assert_eq!(unstuff(stuffed).as_ref(), plain);
        }
    }

    #[test]
    fn a_status_is_stuffed_as_in_the_manual() {
        let expected = [
            0xFF, 0xFF, 0xFD, 0x00, 0x01, 0x09, 0x00, 0x55, 0x00, 0xFF, 0xFF, 0xFD, 0xFD, 0xFF,
            0xDA, 0x9E,
        ];
        assert_eq!(status(1, 0, &[0xFF, 0xFF, 0xFD, 0xFF]), expected);
    }

    proptest! {
        #[test]
        fn a_status_opens_to_what_went_in(
            id in 0..=252_u8,
            error: u8,
            params in prop::collection::vec(prop::sample::select(vec![0xFF_u8, 0xFD, 0, 1]), 0..40),
        ) {
            let packet = status(id, error, &params);
            prop_assert_eq!(scan(&packet), Scan::Packet(packet.len()));
            let (got, code, body) = open(&packet);
            prop_assert_eq!((got, code, body[0]), (id, 0x55, error));
            prop_assert_eq!(&body[1..], &params[..]);
        }

        #[test]
        fn any_bytes_are_scanned_to_an_end(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
            let mut rest = &bytes[..];
            while let Scan::Skip(n) | Scan::Packet(n) | Scan::Spoilt(n) = scan(rest) {
                prop_assert!(n > 0 && n <= rest.len());
                rest = &rest[n..];
            }
        }
    }
}
