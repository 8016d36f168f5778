//! What the targets share: reading a line to its end, and making check sums fit.
//!
//! A random packet almost never has the right check sum, so each decoder is also tried on the
//! input with its sums put right; otherwise nothing behind the check would ever be reached.

use gaitway::wire::Decoded;
use gaitway::wire::checksum::{crc16, sum8};

/// A status that owns its bytes: id, and whatever else identifies what was read.
pub type Seen = (u8, Vec<u8>);

/// Reads `line` as it arrives in portions of `portion` bytes and then falls silent. Panics if a
/// step takes nothing or what is not there, or if more is awaited than a packet can have.
pub fn read_line(
    line: &[u8],
    portion: usize,
    longest_packet: usize,
    mut front: impl FnMut(&[u8]) -> Decoded<Seen>,
    abandon: impl Fn(&[u8]) -> usize,
) -> Vec<Seen> {
    let mut seen = Vec::new();
    let (mut start, mut end) = (0, 0);
    loop {
        let received = &line[start..end];
        let taken = match front(received) {
            Decoded::Packet(status, n) => {
                seen.push(status);
                n
            }
            Decoded::Skip(n) | Decoded::Bad(_, n) | Decoded::Echo(n) => n,
            Decoded::Need(n) => {
                assert!(n > 0 && received.len() + n <= longest_packet);
                if end < line.len() {
                    end = line.len().min(end + portion);
                    continue;
                }
                if received.is_empty() {
                    return seen;
                }
                abandon(received)
            }
        };
        assert!(taken > 0 && taken <= received.len(), "{taken} of {}", received.len());
        start += taken;
    }
}

/// Puts right the CRC of every Protocol 2.0 packet in `line`, as far as its length field holds.
pub fn mend_dynamixel2(line: &mut [u8]) {
    let mut at = 0;
    while at + 7 <= line.len() {
        let packet = &mut line[at..];
        let total = 7 + usize::from(u16::from_le_bytes([packet[5], packet[6]]));
        if packet[..4] == [0xFF, 0xFF, 0xFD, 0x00] && (9..=packet.len()).contains(&total) {
            let crc = crc16(&packet[..total - 2]);
            packet[total - 2..total].copy_from_slice(&crc.to_le_bytes());
            at += total;
        } else {
            at += 1;
        }
    }
}

/// Puts right the sum of every Feetech packet in `line`, as far as its length field holds.
pub fn mend_feetech(line: &mut [u8]) {
    let mut at = 0;
    while at + 4 <= line.len() {
        let packet = &mut line[at..];
        let total = 4 + usize::from(packet[3]);
        if packet[..2] == [0xFF, 0xFF] && packet[2] != 0xFF && (5..=packet.len()).contains(&total) {
            packet[total - 1] = sum8(&packet[2..total - 1]);
            at += total;
        } else {
            at += 1;
        }
    }
}
