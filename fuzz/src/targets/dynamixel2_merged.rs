//! Any bytes read as the merged status of any fast read: no panic, one verdict per device asked,
//! and an answer once whole stays what it is when more bytes arrive.

use gaitway::wire::checksum::crc16;
use gaitway::wire::dynamixel2::{Id, MAX_PACKET, Status, decode_merged};

/// Puts right every CRC of a merged status that begins the line, by the lengths asked for.
fn mend(line: &mut [u8], asked: &[(Id, usize)]) {
    let mut end = 8;
    for (_, length) in asked {
        end += 2 + length;
        if end + 2 > line.len() {
            return;
        }
        let crc = crc16(&line[..end]);
        line[end..end + 2].copy_from_slice(&crc.to_le_bytes());
        end += 2;
    }
}

fn check(line: &[u8], asked: &[(Id, usize)]) {
    let merged = decode_merged(line, asked);
    assert!(merged.need() <= MAX_PACKET);
    assert_eq!(merged.answers().count(), asked.len());
    for ((id, answer), (asked_id, length)) in merged.answers().zip(asked) {
        assert_eq!(id, *asked_id);
        if let Ok(Status { id: answers, params, .. }) = answer {
            assert!(answers == id && params.len() == *length);
        }
    }
}

// The first byte says how many devices were asked; two bytes for each follow, id and length.
pub fn fuzz(input: &[u8]) {
    let [devices, rest @ ..] = input else { return };
    let (asked, line) = rest.split_at(rest.len().min(2 * usize::from(devices % 32)));
    let asked: Vec<_> = asked
        .chunks_exact(2)
        .filter_map(|ask| Some((Id::new(ask[0])?, usize::from(ask[1]))))
        .collect();
    check(line, &asked);
    let mut line = line.to_vec();
    mend(&mut line, &asked);
    check(&line, &asked);
}
