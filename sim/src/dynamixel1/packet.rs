//! The bytes of DYNAMIXEL Protocol 1.0, which FEETECH's servos use as well.
//!
//! Source: ROBOTIS e-Manual, "DYNAMIXEL Protocol 1.0" (packet, checksum), and for FEETECH the
//! maker's SDK as public in adityakamath/SCServo_Linux (`SCS.cpp`): `FF FF ID LEN INST params CHK`,
//! where `LEN` counts what follows it. Nothing is stuffed: `FF FF` may occur among parameters.
//! Example: `FF FF 01 02 01 FB` pings ID 1, which answers `FF FF 01 02 00 FC`.

use crate::exchange::Scan;

/// Bytes of a status without parameters.
pub(crate) const STATUS_OVERHEAD: usize = 6;
/// Most parameters the length byte of a status can speak of.
pub(crate) const MOST_PARAMS: usize = 253;

/// What stands at the start of `bytes`.
pub(crate) fn scan(bytes: &[u8]) -> Scan {
    let common = bytes.iter().take(2).take_while(|&&byte| byte == 0xFF).count();
    if common < 2 && common < bytes.len() {
        let next = bytes.iter().skip(1).position(|&byte| byte == 0xFF);
        return Scan::Skip(next.map_or(bytes.len(), |at| at + 1));
    }
    let &[_, _, id, length, ..] = bytes else {
        // A third FF belongs to a header that begins one byte later.
        return if bytes.get(2) == Some(&0xFF) { Scan::Skip(1) } else { Scan::Incomplete };
    };
    if id == 0xFF || length < 2 {
        return Scan::Skip(1);
    }
    let total = usize::from(length) + 4;
    match bytes.get(..total) {
        None => Scan::Incomplete,
        Some(packet) if checksum(&packet[2..total - 1]) == packet[total - 1] => Scan::Packet(total),
        Some(_) => Scan::Spoilt(total),
    }
}

/// ID, instruction and parameters of a packet [`scan`] found whole.
pub(crate) fn open(packet: &[u8]) -> (u8, u8, &[u8]) {
    (packet[2], packet[4], &packet[5..packet.len() - 1])
}

fn checksum(bytes: &[u8]) -> u8 {
    !bytes.iter().fold(0_u8, |sum, &byte| sum.wrapping_add(byte))
}

/// A status packet with at most [`MOST_PARAMS`] parameters.
pub(crate) fn status(id: u8, error: u8, params: &[u8]) -> Vec<u8> {
    let mut packet = vec![0xFF, 0xFF, id, (params.len() + 2) as u8, error];
    packet.extend_from_slice(params);
    packet.push(checksum(&packet[2..]));
    packet
}

/// Makes the checksum good again after the bytes were changed.
pub(crate) fn reseal(packet: &mut [u8]) {
    if let [_, _, body @ .., sum] = packet {
        *sum = checksum(body);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_status_of_position_2048_and_speed_minus_100_is_sign_and_magnitude() {
        // Computed by the frame's rules; -100 is 100 with bit 15 set.
        let expected = [0xFF, 0xFF, 0x01, 0x06, 0x00, 0x00, 0x08, 0x64, 0x80, 0x0C];
        assert_eq!(status(1, 0, &[0x00, 0x08, 0x64, 0x80]), expected);
    }

    #[test]
    fn a_third_ff_before_the_id_is_skipped() {
        assert_eq!(scan(&[0xFF, 0xFF, 0xFF, 0x01, 0x02, 0x01, 0xFB]), Scan::Skip(1));
        assert_eq!(scan(&[0xFF, 0xFF, 0x01, 0x02, 0x01, 0xFB]), Scan::Packet(6));
        assert_eq!(scan(&[0xFF, 0xFF, 0x01, 0x02, 0x01, 0xFA]), Scan::Spoilt(6));
        assert_eq!(scan(&[0xFF, 0xFF, 0x01]), Scan::Incomplete);
    }

    #[test]
    fn a_packet_of_protocol_2_is_none_of_protocol_1() {
        // Its third byte would be ID 253, its fourth a length of 0.
        assert_eq!(scan(&[0xFF, 0xFF, 0xFD, 0x00, 0x01, 0x03, 0x00, 0x01]), Scan::Skip(1));
    }

    proptest! {
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
