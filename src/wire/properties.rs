//! What holds of the codecs for every input, tried on generated ones.
//!
//! The reference decoder and sealer here share nothing with the code under test: the CRC is
//! computed bit by bit and stuffing is undone by looking at three bytes back.

use super::{Decoded, Reason, dynamixel1 as dxl1, dynamixel2 as dxl, feetech as sts};
use proptest::collection::vec;
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

/// A decoded status that owns its bytes: id, error byte, parameters.
type Seen = (u8, u8, Vec<u8>);

fn slow_crc(bytes: &[u8]) -> [u8; 2] {
    let mut crc: u16 = 0;
    for byte in bytes {
        for bit in (0..8).rev() {
            let carry = (crc >> 15) as u8 ^ (byte >> bit & 1);
            crc = (crc << 1) ^ if carry == 1 { 0x8005 } else { 0 };
        }
    }
    crc.to_le_bytes()
}

/// A Protocol 2.0 packet, stuffed as DynamixelSDK does it: looking back over three bytes.
fn dxl_packet(id: u8, body: &[u8]) -> Vec<u8> {
    let mut stuffed = Vec::new();
    for (at, &byte) in body.iter().enumerate() {
        stuffed.push(byte);
        if at >= 2 && body[at - 2..=at] == [0xFF, 0xFF, 0xFD] {
            stuffed.push(0xFD);
        }
    }
    let [low, high] = (stuffed.len() as u16 + 2).to_le_bytes();
    let mut packet = vec![0xFF, 0xFF, 0xFD, 0x00, id, low, high];
    packet.extend(stuffed);
    packet.extend(slow_crc(&packet));
    packet
}

fn dxl_status(id: u8, error: u8, params: &[u8]) -> Vec<u8> {
    dxl_packet(id, &[&[0x55, error], params].concat())
}

fn sts_packet(id: u8, error: u8, params: &[u8]) -> Vec<u8> {
    let mut packet = vec![0xFF, 0xFF, id, params.len() as u8 + 2, error];
    packet.extend(params);
    let sum: u32 = packet[2..].iter().map(|&byte| u32::from(byte)).sum();
    packet.push(255 - (sum % 256) as u8);
    packet
}

fn error_byte(error: dxl::StatusError) -> u8 {
    let number = match error.code {
        None => 0,
        Some(dxl::ErrorCode::ResultFail) => 1,
        Some(dxl::ErrorCode::Instruction) => 2,
        Some(dxl::ErrorCode::Crc) => 3,
        Some(dxl::ErrorCode::DataRange) => 4,
        Some(dxl::ErrorCode::DataLength) => 5,
        Some(dxl::ErrorCode::DataLimit) => 6,
        Some(dxl::ErrorCode::Access) => 7,
        Some(dxl::ErrorCode::Unknown(number)) => number,
    };
    number | u8::from(error.alert) << 7
}

/// One protocol as the line reader below needs it: what lies at the front, and giving up.
trait Protocol {
    fn front(&mut self, bytes: &[u8]) -> Decoded<Seen>;
    fn abandon(bytes: &[u8]) -> usize;
}

#[derive(Default)]
struct Dynamixel(Vec<u8>);

impl Protocol for Dynamixel {
    fn front(&mut self, bytes: &[u8]) -> Decoded<Seen> {
        dxl::decode(bytes, &mut self.0)
            .map(|status| (status.id.get(), error_byte(status.error), status.params.to_vec()))
    }

    fn abandon(bytes: &[u8]) -> usize {
        dxl::abandon(bytes)
    }
}

/// With the longest answer expected.
struct Feetech(usize);

impl Protocol for Feetech {
    fn front(&mut self, bytes: &[u8]) -> Decoded<Seen> {
        sts::decode(bytes, self.0)
            .map(|status| (status.id.get(), status.error.0, status.params.to_vec()))
    }

    fn abandon(bytes: &[u8]) -> usize {
        sts::abandon(bytes)
    }
}

/// Reads a line on which `pieces` arrive one after another and then nothing more. Checks on the
/// way that every step takes something that is there.
fn read_line<'a, P: Protocol>(
    protocol: &mut P,
    pieces: impl IntoIterator<Item = &'a [u8]>,
) -> Vec<Seen> {
    let (mut received, mut seen) = (Vec::new(), Vec::new());
    let mut drain = |received: &mut Vec<u8>, silent: bool| {
        loop {
            let taken = match protocol.front(received) {
                Decoded::Packet(status, n) => {
                    seen.push(status);
                    n
                }
                Decoded::Skip(n) | Decoded::Bad(_, n) | Decoded::Echo(n) => n,
                Decoded::Need(n) => {
                    assert!(0 < n && received.len() + n <= dxl::MAX_PACKET);
                    if !silent || received.is_empty() {
                        break;
                    }
                    P::abandon(received)
                }
            };
            assert!(0 < taken && taken <= received.len(), "{taken} of {received:02X?}");
            received.drain(..taken);
        }
    };
    for piece in pieces {
        received.extend_from_slice(piece);
        drain(&mut received, false);
    }
    drain(&mut received, true);
    assert!(received.is_empty());
    seen
}

/// Bytes among which those that matter to framing are frequent.
fn biased_byte() -> impl Strategy<Value = u8> {
    prop_oneof![
        4 => Just(0xFF),
        3 => Just(0xFD),
        3 => Just(0x00),
        1 => Just(0xFE),
        1 => Just(0x55),
        1 => 0_u8..16,
        2 => any::<u8>(),
    ]
}

fn params(most: usize) -> impl Strategy<Value = Vec<u8>> {
    vec(biased_byte(), 0..=most)
}

fn statuses(last_id: u8) -> impl Strategy<Value = Vec<Seen>> {
    vec((0..=last_id, any::<u8>(), params(16)), 1..6)
}

/// A line of whole packets, cut ones, and noise; and where to split it.
fn damaged_line(
    last_id: u8,
    packet: fn(u8, u8, &[u8]) -> Vec<u8>,
) -> impl Strategy<Value = (Vec<u8>, Vec<usize>)> {
    let piece = prop_oneof![
        (0..=last_id, any::<u8>(), params(12)).prop_map(move |(id, e, p)| packet(id, e, &p)),
        (0..=last_id, params(12), any::<prop::sample::Index>()).prop_map(move |(id, p, cut)| {
            let mut packet = packet(id, 0, &p);
            packet.truncate(cut.index(packet.len()));
            packet
        }),
        (0..=last_id, params(12), any::<prop::sample::Index>(), 0_u8..8).prop_map(
            move |(id, p, at, bit)| {
                let mut packet = packet(id, 0, &p);
                let at = at.index(packet.len());
                packet[at] ^= 1 << bit;
                packet
            }
        ),
        vec(biased_byte(), 0..8),
    ];
    let line = vec(piece, 1..8).prop_map(|pieces| pieces.concat());
    (line, vec(any::<prop::sample::Index>(), 0..6)).prop_map(|(line, cuts)| {
        let mut cuts: Vec<_> = cuts.iter().map(|cut| cut.index(line.len() + 1)).collect();
        cuts.sort_unstable();
        (line, cuts)
    })
}

fn split<'a>(line: &'a [u8], cuts: &[usize]) -> Vec<&'a [u8]> {
    let ends = cuts.iter().copied().chain([line.len()]);
    let starts = [0].into_iter().chain(cuts.iter().copied());
    starts.zip(ends).map(|(start, end)| &line[start..end]).collect()
}

/// Fewer where an interpreter runs them.
const fn cases(number: u32) -> u32 {
    if cfg!(miri) { 1 } else { number }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: cases(2000), ..ProptestConfig::default() })]

    #[test]
    fn the_crc_equals_the_one_computed_bit_by_bit(bytes in vec(any::<u8>(), 0..200)) {
        prop_assert_eq!(super::checksum::crc16(&bytes).to_le_bytes(), slow_crc(&bytes));
    }

    #[test]
    fn a_write_is_the_packet_the_reference_builds(id in 0_u8..=252, bytes in params(40)) {
        let mut out = Vec::new();
        dxl::write(&mut out, dxl::Id::new(id).unwrap(), 116, &bytes).unwrap();
        prop_assert_eq!(out, dxl_packet(id, &[&[0x03, 116, 0], &bytes[..]].concat()));
    }

    #[test]
    fn whole_dynamixel_statuses_come_out_as_they_were_sent(
        sent in statuses(252), cuts in vec(any::<prop::sample::Index>(), 0..6),
    ) {
        let line: Vec<u8> = sent.iter().flat_map(|(id, e, p)| dxl_status(*id, *e, p)).collect();
        let mut cuts: Vec<_> = cuts.iter().map(|cut| cut.index(line.len())).collect();
        cuts.sort_unstable();
        prop_assert_eq!(&read_line(&mut Dynamixel::default(), [&line[..]]), &sent);
        prop_assert_eq!(&read_line(&mut Dynamixel::default(), split(&line, &cuts)), &sent);
        prop_assert_eq!(&read_line(&mut Dynamixel::default(), line.chunks(1)), &sent);
    }

    #[test]
    fn a_dynamixel_status_is_never_lost_to_what_came_before_it(
        (mut line, _) in damaged_line(252, dxl_status), params in params(16),
    ) {
        // A packet that lost its end may find one in the status behind it: last bytes that were
        // those of a header, or a CRC that fits by chance. Nobody could tell.
        let status = dxl_status(77, 0, &params);
        let alone = read_line(&mut Dynamixel::default(), [&line[..]]).len();
        for borrowed in 1..status.len() {
            let with_part = [&line[..], &status[..borrowed]];
            prop_assume!(read_line(&mut Dynamixel::default(), with_part).len() == alone);
        }
        line.extend(status);
        let seen = read_line(&mut Dynamixel::default(), [&line[..]]);
        prop_assert_eq!(seen.last(), Some(&(77, 0, params)));
    }

    #[test]
    fn a_damaged_dynamixel_line_reads_the_same_in_any_portions(
        (line, cuts) in damaged_line(252, dxl_status),
    ) {
        let at_once = read_line(&mut Dynamixel::default(), [&line[..]]);
        prop_assert_eq!(&read_line(&mut Dynamixel::default(), line.chunks(1)), &at_once);
        prop_assert_eq!(&read_line(&mut Dynamixel::default(), split(&line, &cuts)), &at_once);
    }

    #[test]
    fn one_flipped_bit_never_makes_another_dynamixel_status_of_that_length(
        id in 0_u8..=252, error in any::<u8>(), params in params(16),
    ) {
        let status = dxl_status(id, error, &params);
        for bit in 0..8 * status.len() {
            let mut flipped = status.clone();
            flipped[bit / 8] ^= 1 << (bit % 8);
            let seen = read_line(&mut Dynamixel::default(), [&flipped[..]]);
            // A false length moves the CRC to two other bytes, which fit by chance once in 65,536:
            // the asker knows the length it asked for, and refuses any other.
            let other = seen.iter().find(|(_, _, found)| found.len() == params.len());
            prop_assert!(other.is_none(), "bit {} gives {:?}", bit, seen);
        }
    }

    #[test]
    fn the_instruction_we_sent_is_heard_as_an_echo_before_its_answer(
        goals in prop::collection::btree_map(0_u8..=252, any::<[u8; 4]>(), 1..20),
        params in params(16),
    ) {
        let writes = goals.iter().map(|(&id, goal)| (dxl::Id::new(id).unwrap(), goal));
        let mut line = Vec::new();
        dxl::sync_write(&mut line, 116, 4, writes).unwrap();
        let echo = line.len();
        line.extend(dxl_status(5, 0, &params));
        prop_assert_eq!(Dynamixel::default().front(&line), Decoded::Echo(echo));
        prop_assert_eq!(read_line(&mut Dynamixel::default(), [&line[..]]), [(5, 0, params)]);
    }

    #[test]
    fn whole_feetech_statuses_come_out_as_they_were_sent(
        sent in statuses(253), cuts in vec(any::<prop::sample::Index>(), 0..6),
    ) {
        let line: Vec<u8> = sent.iter().flat_map(|(id, e, p)| sts_packet(*id, *e, p)).collect();
        let mut cuts: Vec<_> = cuts.iter().map(|cut| cut.index(line.len())).collect();
        cuts.sort_unstable();
        prop_assert_eq!(&read_line(&mut Feetech(16), [&line[..]]), &sent);
        prop_assert_eq!(&read_line(&mut Feetech(16), split(&line, &cuts)), &sent);
        prop_assert_eq!(&read_line(&mut Feetech(16), line.chunks(1)), &sent);
    }

    #[test]
    fn a_short_packet_is_the_same_to_the_decoders_of_both_makers(
        (line, _) in damaged_line(253, sts_packet), longest in 0_usize..14,
    ) {
        let ours = dxl1::decode(&line, longest).map(|s| (s.id, s.error.0, s.params));
        let theirs = sts::decode(&line, longest).map(|s| (s.id, s.error.0, s.params));
        prop_assert_eq!(ours, theirs);
    }

    #[test]
    fn a_bulk_read_of_protocol_1_lists_length_id_and_address(
        asked in prop::collection::btree_map(0_u8..=253, (any::<u8>(), 0_u8..=244), 1..60),
    ) {
        let reads = asked.iter().map(|(&id, &(address, length))| {
            dxl1::BulkRead { id: dxl1::Id::new(id).unwrap(), address, length }
        });
        let mut out = Vec::new();
        dxl1::bulk_read(&mut out, reads).unwrap();
        let items = asked.iter().flat_map(|(&id, &(address, length))| [length, id, address]);
        // An instruction is laid out as a status with the instruction in place of the error.
        let expected = sts_packet(0xFE, 0x92, &[0].into_iter().chain(items).collect::<Vec<_>>());
        prop_assert_eq!(out.len(), dxl1::bulk_read_len(asked.len()));
        prop_assert_eq!(out, expected);
    }

    #[test]
    fn a_damaged_feetech_line_reads_the_same_in_any_portions(
        (line, cuts) in damaged_line(253, sts_packet),
    ) {
        let at_once = read_line(&mut Feetech(12), [&line[..]]);
        prop_assert_eq!(&read_line(&mut Feetech(12), line.chunks(1)), &at_once);
        prop_assert_eq!(&read_line(&mut Feetech(12), split(&line, &cuts)), &at_once);
    }

    #[test]
    fn one_flipped_bit_never_makes_another_feetech_status_of_that_length(
        id in 0_u8..=253, error in any::<u8>(), params in vec(0_u8..0xF0, 0..16),
    ) {
        // A flipped length may leave a shorter packet whose sum fits by chance, and so may a
        // header among the parameters, which are therefore without FF here.
        let status = sts_packet(id, error, &params);
        for bit in 0..8 * status.len() {
            let mut flipped = status.clone();
            flipped[bit / 8] ^= 1 << (bit % 8);
            let seen = read_line(&mut Feetech(16), [&flipped[..]]);
            let same_length = seen.iter().any(|(_, _, seen)| seen.len() == params.len());
            prop_assert!(!same_length, "bit {} gives {:?}", bit, seen);
        }
    }

    #[test]
    fn garbage_before_a_status_costs_only_itself(
        garbage in vec(any::<u8>().prop_filter("no header", |b| *b != 0xFF), 0..40),
        params in params(16),
    ) {
        let line = [&garbage[..], &dxl_status(1, 0, &params)].concat();
        let expected = [(1, 0, params.clone())];
        prop_assert_eq!(read_line(&mut Dynamixel::default(), line.chunks(3)), expected.clone());
        let line = [&garbage[..], &sts_packet(1, 0, &params)].concat();
        prop_assert_eq!(read_line(&mut Feetech(16), line.chunks(3)), expected);
    }
}

/// A merged status, built by the rule that every CRC is over all before it.
fn merged(answers: &[Seen]) -> Vec<u8> {
    let length: usize = answers.iter().map(|(_, _, params)| params.len() + 4).sum();
    let [low, high] = (length as u16 + 1).to_le_bytes();
    let mut packet = vec![0xFF, 0xFF, 0xFD, 0x00, 0xFE, low, high, 0x55];
    for (id, error, params) in answers {
        packet.extend([*error, *id]);
        packet.extend(params);
        packet.extend(slow_crc(&packet));
    }
    packet
}

fn merged_answers() -> impl Strategy<Value = Vec<Seen>> {
    prop::collection::btree_map(0_u8..=252, (any::<u8>(), params(12)), 1..8)
        .prop_map(|map| map.into_iter().map(|(id, (error, params))| (id, error, params)).collect())
        .prop_shuffle()
}

fn asked_of(answers: &[Seen]) -> Vec<(dxl::Id, usize)> {
    let ask = |(id, _, params): &Seen| (dxl::Id::new(*id).unwrap(), params.len());
    answers.iter().map(ask).collect()
}

/// The whole answers in some bytes, in the order asked; `None` for those that are not.
fn read_merged(bytes: &[u8], asked: &[(dxl::Id, usize)]) -> Vec<Option<Seen>> {
    let seen = |(id, answer): (dxl::Id, Result<dxl::Status<'_>, dxl::NoAnswer>)| {
        let status = answer.ok()?;
        assert_eq!(status.id, id);
        Some((id.get(), error_byte(status.error), status.params.to_vec()))
    };
    dxl::decode_merged(bytes, asked).answers().map(seen).collect()
}

/// Every answer read is the one that was sent.
fn right_or_none(bytes: &[u8], asked: &[(dxl::Id, usize)], sent: &[Seen]) -> bool {
    let read = read_merged(bytes, asked);
    read.iter().zip(sent).all(|(answer, sent)| answer.as_ref().is_none_or(|answer| answer == sent))
}

proptest! {
    // A lost byte moves the CRC to bytes that fit by chance once in 65,536: always the same lines.
    #![proptest_config(ProptestConfig {
        cases: cases(500), rng_seed: RngSeed::Fixed(2), ..ProptestConfig::default()
    })]

    #[test]
    fn a_merged_status_that_lost_a_byte_gives_right_answers_or_none(answers in merged_answers()) {
        let (whole, asked) = (merged(&answers), asked_of(&answers));
        for at in 0..whole.len() {
            let mut lost = whole.clone();
            lost.remove(at);
            prop_assert!(right_or_none(&lost, &asked, &answers), "at {}", at);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: cases(500), ..ProptestConfig::default() })]

    #[test]
    fn a_merged_status_gives_every_answer_behind_any_garbage(
        answers in merged_answers(), garbage in vec(biased_byte(), 0..20),
    ) {
        let bytes = [garbage, merged(&answers)].concat();
        let asked = asked_of(&answers);
        prop_assert_eq!(dxl::decode_merged(&bytes, &asked).need(), 0);
        let expected: Vec<_> = answers.into_iter().map(Some).collect();
        prop_assert_eq!(read_merged(&bytes, &asked), expected);
    }

    #[test]
    fn a_merged_status_with_a_flipped_bit_gives_right_answers_or_none(
        answers in merged_answers(),
    ) {
        let (whole, asked) = (merged(&answers), asked_of(&answers));
        for bit in 0..8 * whole.len() {
            let mut flipped = whole.clone();
            flipped[bit / 8] ^= 1 << (bit % 8);
            prop_assert!(right_or_none(&flipped, &asked, &answers), "bit {}", bit);
        }
    }

    #[test]
    fn any_bytes_read_as_a_merged_status_without_panic(
        bytes in vec(biased_byte(), 0..80), lengths in vec((0_u8..=252, 0_usize..2000), 0..5),
    ) {
        let asked: Vec<_> =
            lengths.iter().map(|&(id, n)| (dxl::Id::new(id).unwrap(), n)).collect();
        prop_assert_eq!(read_merged(&bytes, &asked).len(), asked.len());
    }
}

#[test]
#[cfg_attr(miri, ignore = "a thousand lines take an interpreter too long")]
fn a_status_cut_anywhere_costs_only_itself() {
    let good = dxl_status(2, 0, &[1, 2, 3, 4]);
    // Claims a thousand bytes; at its end, bytes that could begin a header.
    let long = dxl_status(1, 0, &[0xFF; 1000]);
    for cut in 0..long.len() {
        let line = [&long[..cut], &good].concat();
        let seen = read_line(&mut Dynamixel::default(), [&line[..]]);
        assert_eq!(seen, [(2, 0, vec![1, 2, 3, 4])], "cut at {cut}");
    }
}

/// Length fields of Protocol 2.0 that cannot be, each in a packet whose CRC fits.
fn false_lengths() -> Vec<Vec<u8>> {
    let false_length = |claimed: u16| {
        let [low, high] = claimed.to_le_bytes();
        let mut packet = vec![0xFF, 0xFF, 0xFD, 0x00, 0x01, low, high];
        packet.resize(7 + usize::from(claimed.clamp(2, 4096)) - 2, 0x55);
        packet.extend(slow_crc(&packet));
        packet
    };
    [0, 1, 2, 3, 1018, 2000, 0xFFFF].map(false_length).to_vec()
}

#[test]
fn a_false_length_is_bad_whatever_its_crc_takes_no_memory_and_costs_only_itself() {
    let good = dxl_status(2, 0, &[1, 2, 3, 4]);
    for packet in false_lengths() {
        let mut scratch = Vec::new();
        let decoded = dxl::decode(&packet, &mut scratch);
        assert!(matches!(decoded, Decoded::Bad(Reason::Length { .. }, _)), "{decoded:?}");
        assert!(scratch.capacity() == 0, "{} bytes taken", scratch.capacity());
        let line = [&packet[..], &good].concat();
        for portion in [1, 7, line.len()] {
            let seen = read_line(&mut Dynamixel::default(), line.chunks(portion));
            assert_eq!(seen, [(2, 0, vec![1, 2, 3, 4])], "{:02X?}", &packet[..8]);
        }
        let asked = [(dxl::Id::new(2).unwrap(), 4)];
        let mut merged_line = packet.clone();
        merged_line.extend(merged(&[(2, 0, vec![1, 2, 3, 4])]));
        let read = read_merged(&merged_line, &asked);
        assert_eq!(read, [Some((2, 0, vec![1, 2, 3, 4]))]);
    }
}

#[test]
fn a_false_length_of_a_short_packet_is_bad_whatever_its_sum_and_costs_only_itself() {
    let good = sts_packet(2, 0, &[1, 2, 3, 4]);
    for claimed in [0_u8, 1, 7, 0xFE, 0xFF] {
        let mut packet = vec![0xFF, 0xFF, 0x01, claimed];
        packet.resize(4 + usize::from(claimed.max(1)) - 1, 0x00);
        let sum: u32 = packet[2..].iter().map(|&byte| u32::from(byte)).sum();
        packet.push(255 - (sum % 256) as u8);
        let decoded = sts::decode(&packet, 4);
        assert!(matches!(decoded, Decoded::Bad(Reason::Length { .. }, _)), "{decoded:?}");
        let line = [&packet[..], &good].concat();
        for portion in [1, 3, line.len()] {
            let seen = read_line(&mut Feetech(4), line.chunks(portion));
            assert_eq!(seen.last(), Some(&(2, 0, vec![1, 2, 3, 4])), "length {claimed}");
        }
    }
}

#[test]
fn unstuffing_the_longest_status_takes_less_than_a_kibibyte() {
    let params = [0xFF, 0xFF, 0xFD].repeat(253);
    let status = dxl_status(1, 0, &params);
    assert!(status.len() > 1020 && status.len() <= dxl::MAX_PACKET);
    // Grown before, so that doubling would overshoot.
    let mut scratch = vec![0; 600];
    let decoded = dxl::decode(&status, &mut scratch);
    let Decoded::Packet(found, _) = decoded else { panic!("{decoded:?}") };
    assert_eq!(found.params, params);
    assert!(scratch.capacity() <= 1024, "{} bytes taken", scratch.capacity());
}

#[test]
#[cfg_attr(miri, ignore = "65,536 packets take an interpreter too long")]
fn every_length_field_is_survived_with_a_crc_that_fits() {
    let mut scratch = Vec::new();
    for length in 0..=u16::MAX {
        let [low, high] = length.to_le_bytes();
        let mut packet = vec![0xFF, 0xFF, 0xFD, 0x00, 0x01, low, high];
        packet.resize(7 + usize::from(length.clamp(2, 1100)) - 2, 0x55);
        packet.extend(slow_crc(&packet));
        match dxl::decode(&packet, &mut scratch) {
            Decoded::Packet(status, n) => assert_eq!(status.params.len() + 11, n),
            Decoded::Bad(Reason::Length { claimed, .. }, _) => {
                assert_eq!(claimed, usize::from(length));
                assert!(!(4..=1017).contains(&claimed));
            }
            other => panic!("length {length}: {other:?}"),
        }
    }
}
