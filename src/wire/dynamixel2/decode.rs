//! Status packets of Protocol 2.0 out of a stream of bytes that may be damaged anywhere.
//!
//! How it finds its feet again: a packet begins at a header and nowhere else, and stuffing keeps
//! headers out of packets. A header inside the bytes a packet lays claim to therefore proves that
//! packet damaged, at once and not only when the claimed length has arrived; every bad packet is
//! dropped up to the next header, or beginning of one, wherever that lies. So a whole packet on
//! the line is always delivered, whatever came before it. (The one exception inside a packet are
//! its last four bytes, which may look like a header: two parameters and the CRC, which is not
//! stuffed. There the CRC decides.)
//!
//! A stuffed sequence that lacks its extra `FD` is accepted as it stands, as DynamixelSDK does,
//! unless it is a whole header.

use super::{BODY, HEADER, Id, MAX_PACKET, PREFIX, STATUS, Status, StatusError};
use super::{find_header, find_pattern, instruction_len};
use crate::wire::checksum::crc16;
use crate::wire::{BROADCAST, Decoded, Reason};

/// Tells what lies at the front of `bytes`. Parameters that had to be unstuffed are in `scratch`,
/// which is overwritten and never grows beyond [`MAX_PACKET`]; others are borrowed from `bytes`.
///
/// The answer does not depend on how the bytes arrive: one by one or all at once, the same
/// packets come out.
pub fn decode<'a>(bytes: &'a [u8], scratch: &'a mut Vec<u8>) -> Decoded<Status<'a>> {
    match find_header(bytes) {
        0 => {}
        garbage => return Decoded::Skip(garbage),
    }
    let total = match claimed_len(bytes) {
        Err(reason) => return Decoded::Bad(reason, abandon(bytes)),
        Ok(None) => return Decoded::Need(instruction_len(0) - bytes.len()),
        Ok(Some(total)) => total,
    };
    if let Some(inner) = inner_header(bytes, total) {
        return Decoded::Bad(Reason::Interrupted { claimed: total, available: inner }, inner);
    }
    let Some(packet) = bytes.get(..total) else {
        return Decoded::Need(total - bytes.len());
    };
    let (checked, crc) = packet.split_at(total - 2);
    let (expected, actual) = (crc16(checked), u16::from_le_bytes([crc[0], crc[1]]));
    if expected != actual {
        return Decoded::Bad(Reason::Checksum { expected, actual }, abandon(bytes));
    }
    let Some((id, body)) = status_of(checked) else {
        return Decoded::Echo(total);
    };
    // The error byte is never an inserted one: there would have to be three bytes before it.
    let body = match find_pattern(body) {
        Some(_) => unstuff(body, scratch),
        None => body,
    };
    let (error, params) = (StatusError::from_byte(body[0]), &body[1..]);
    Decoded::Packet(Status { id, error, params }, total)
}

/// Bytes to take from the front when [`decode`] asks for more and none will come: up to the next
/// place where a packet may begin. Then decode again; a whole packet may lie behind a cut one.
#[must_use]
pub fn abandon(bytes: &[u8]) -> usize {
    match bytes {
        [] => 0,
        [_, rest @ ..] => 1 + find_header(rest),
    }
}

/// Length in bytes of the packet at the front by its length field, once enough of it is there.
fn claimed_len(bytes: &[u8]) -> Result<Option<usize>, Reason> {
    let Some(&id) = bytes.get(HEADER.len()) else { return Ok(None) };
    if id == 0xFD || id == 0xFF {
        return Err(Reason::Id(id));
    }
    let Some(&[low, high]) = bytes.get(5..PREFIX) else { return Ok(None) };
    let claimed = usize::from(u16::from_le_bytes([low, high]));
    let most = MAX_PACKET - PREFIX;
    if !(3..=most).contains(&claimed) {
        return Err(Reason::Length { claimed, least: 3, most });
    }
    match bytes.get(PREFIX) {
        None => return Ok(None),
        Some(&STATUS) if id == BROADCAST => return Err(Reason::Merged),
        Some(&STATUS) if claimed < 4 => {
            return Err(Reason::Length { claimed, least: 4, most });
        }
        Some(_) => {}
    }
    Ok(Some(PREFIX + claimed))
}

/// Where another header begins inside the packet of `total` bytes at the front, its last four
/// bytes excepted.
fn inner_header(bytes: &[u8], total: usize) -> Option<usize> {
    let seen = &bytes[..bytes.len().min(total - 1)];
    let mut from = HEADER.len();
    while let Some(found) = find_pattern(&seen[from..]) {
        let at = from + found;
        if seen.get(at + 3) == Some(&HEADER[3]) {
            return Some(at);
        }
        from = at + 3;
    }
    None
}

/// Sender and body, error byte first, if the packet is a status. `checked` is without its CRC.
fn status_of(checked: &[u8]) -> Option<(Id, &[u8])> {
    if checked[PREFIX] != STATUS {
        return None;
    }
    Some((Id::new(checked[HEADER.len()])?, &checked[BODY..]))
}

/// Removes the `FD` after every `FF FF FD`.
fn unstuff<'a>(body: &[u8], scratch: &'a mut Vec<u8>) -> &'a [u8] {
    scratch.clear();
    scratch.reserve_exact(body.len());
    let mut rest = body;
    while let Some(found) = find_pattern(rest) {
        let (kept, after) = rest.split_at(found + 3);
        scratch.extend_from_slice(kept);
        rest = after.strip_prefix(&[0xFD]).unwrap_or(after);
    }
    scratch.extend_from_slice(rest);
    scratch
}

#[cfg(test)]
mod tests {
    use super::*;

    const POSITION: [u8; 15] = [0xFF, 0xFF, 0xFD, 0, 1, 8, 0, 0x55, 0, 0xA6, 0, 0, 0, 0x8C, 0xC0];

    #[track_caller]
    fn assert_decodes(bytes: &[u8], expected: &Decoded<Status<'_>>) {
        assert_eq!(&decode(bytes, &mut Vec::new()), expected, "{bytes:02X?}");
    }

    #[test]
    fn a_truncated_packet_asks_for_more_bytes() {
        assert_decodes(&[], &Decoded::Need(10));
        assert_decodes(&POSITION[..1], &Decoded::Need(9));
        assert_decodes(&POSITION[..7], &Decoded::Need(3));
        assert_decodes(&POSITION[..8], &Decoded::Need(7));
        assert_decodes(&POSITION[..14], &Decoded::Need(1));
    }

    #[test]
    fn garbage_is_skipped_up_to_what_may_be_a_header() {
        assert_decodes(&[0x00, 0x12, 0x34], &Decoded::Skip(3));
        assert_decodes(&[0x00, 0xFF, 0xFF], &Decoded::Skip(1));
        assert_decodes(&[0xFF, 0xFF, 0xFD, 0xFD, 0xFF], &Decoded::Skip(4));
    }

    #[test]
    fn a_length_beyond_the_maximum_is_refused_and_not_awaited() {
        for claimed in [0_u16, 1, 2, 1018, 0xFFFF] {
            let [low, high] = claimed.to_le_bytes();
            let claimed = usize::from(claimed);
            let reason = Reason::Length { claimed, least: 3, most: 1017 };
            // The FF FF of the last may begin the next header.
            let taken = if claimed == 0xFFFF { 5 } else { 7 };
            assert_decodes(&[0xFF, 0xFF, 0xFD, 0, 1, low, high], &Decoded::Bad(reason, taken));
        }
        let reason = Reason::Length { claimed: 3, least: 4, most: 1017 };
        let status_without_error_byte = [0xFF, 0xFF, 0xFD, 0, 1, 3, 0, 0x55];
        assert_decodes(&status_without_error_byte, &Decoded::Bad(reason, 8));
    }

    #[test]
    fn a_reserved_id_is_refused() {
        assert_decodes(&[0xFF, 0xFF, 0xFD, 0, 0xFD], &Decoded::Bad(Reason::Id(0xFD), 5));
        // The FF may be the first of a header.
        assert_decodes(&[0xFF, 0xFF, 0xFD, 0, 0xFF], &Decoded::Bad(Reason::Id(0xFF), 4));
    }

    #[test]
    fn a_packet_cut_off_by_another_is_dropped_before_its_claimed_length_arrives() {
        let mut bytes = vec![0xFF, 0xFF, 0xFD, 0, 1, 0xE8, 0x03, 0x55, 0, 0xA6];
        bytes.extend(POSITION);
        let reason = Reason::Interrupted { claimed: 1007, available: 10 };
        assert_decodes(&bytes[..13], &Decoded::Need(994));
        assert_decodes(&bytes[..14], &Decoded::Bad(reason, 10));
        assert_decodes(&bytes, &Decoded::Bad(reason, 10));
    }

    #[test]
    fn a_wrong_crc_drops_up_to_the_next_header() {
        let mut bytes = POSITION.to_vec();
        bytes[9] ^= 0x01;
        let reason = Reason::Checksum { expected: crc16(&bytes[..13]), actual: 0xC08C };
        assert_decodes(&bytes, &Decoded::Bad(reason, 15));
        bytes.truncate(15);
        bytes.extend([0x00, 0xFF, 0xFF]);
        assert_decodes(&bytes, &Decoded::Bad(reason, 16));
    }

    #[test]
    #[cfg_attr(miri, ignore = "too many tries for an interpreter")]
    fn a_crc_that_looks_like_the_end_of_a_header_is_accepted() {
        // A status whose last parameters are FF FF and whose CRC is 0x00FD, found by search.
        let (mut packet, mut found) = (Vec::new(), false);
        for word in 0..=u16::MAX {
            let [a, b] = word.to_le_bytes();
            packet = vec![0xFF, 0xFF, 0xFD, 0, 1, 8, 0, 0x55, 0, a, b, 0xFF, 0xFF];
            found = crc16(&packet) == 0x00FD;
            if found {
                break;
            }
        }
        assert!(found, "two free bytes reach every CRC");
        let params = packet[9..].to_vec();
        packet.extend([0xFD, 0x00]);
        let (id, error) = (Id::new(1).unwrap(), StatusError::default());
        let status = Status { id, error, params: &params };
        assert_decodes(&packet, &Decoded::Packet(status, 15));
    }

    #[test]
    fn an_instruction_on_the_line_is_an_echo() {
        let ping = [0xFF, 0xFF, 0xFD, 0, 1, 3, 0, 1, 0x19, 0x4E];
        assert_decodes(&ping, &Decoded::Echo(10));
    }

    #[test]
    fn a_merged_status_nobody_asked_for_is_bad_and_not_awaited() {
        let begun = [0xFF, 0xFF, 0xFD, 0, 0xFE, 0x19, 0x00, 0x55];
        assert_decodes(&begun, &Decoded::Bad(Reason::Merged, 8));
    }

    #[test]
    fn what_will_not_be_completed_is_abandoned_up_to_the_next_header() {
        assert_eq!(abandon(&[]), 0);
        assert_eq!(abandon(&POSITION[..2]), 1); // the second FF may be the first
        assert_eq!(abandon(&POSITION[..3]), 3);
        let cut = [&POSITION[..9], &POSITION[..]].concat();
        assert_eq!(abandon(&cut), 9);
    }
}
