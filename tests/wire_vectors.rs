//! Packets printed in manuals and public test suites, against our encoders and decoders.
//!
//! DYNAMIXEL: ROBOTIS e-Manual, "DYNAMIXEL Protocol 2.0", in the order of its chapters, with two
//! misprints corrected where noted; some from the tests of pollen-robotics/rustypot (c79239aa) and
//! robohouse-delft/dynamixel2-rs (cd639a76). Rows marked "by hand" were put together from the
//! manual's rules with an independent CRC. Protocol 1.0: ROBOTIS e-Manual, "DYNAMIXEL Protocol 1.0"
//! (ROBOTIS-GIT/emanual 097301c2); its checksums are all as printed. Feetech: tests of huggingface/lerobot (7427f318) and
//! other public suites; "by hand" likewise.

use gaitway::wire::dynamixel1::{self as dxl1, StatusError as Error1};
use gaitway::wire::dynamixel2::{self as dxl, BulkRead, FactoryReset};
use gaitway::wire::feetech::{self as sts, SignBit};
use gaitway::wire::{Decoded, EncodeError};

/// Bytes written as in a manual.
fn hex(text: &str) -> Vec<u8> {
    text.split_whitespace()
        .map(|byte| u8::from_str_radix(byte, 16).unwrap_or_else(|_| panic!("{byte} is no byte")))
        .collect()
}

fn dxl_id(number: u8) -> dxl::Id {
    dxl::Id::new(number).unwrap()
}

fn sts_id(number: u8) -> sts::Id {
    sts::Id::new(number).unwrap()
}

/// What an encoder appends; it must leave alone what was there.
fn sent(encode: impl FnOnce(&mut Vec<u8>)) -> Vec<u8> {
    let mut out = vec![0xAA];
    encode(&mut out);
    assert_eq!(out.remove(0), 0xAA);
    out
}

/// The same for an encoder that may refuse, and must not here.
fn tried(encode: impl FnOnce(&mut Vec<u8>) -> Result<(), EncodeError>) -> Vec<u8> {
    sent(|out| assert_eq!(encode(out), Ok(())))
}

/// Rows of name, printed bytes, encoded bytes.
#[track_caller]
fn assert_as_printed(rows: &[(&str, &str, Vec<u8>)]) {
    for (name, printed, encoded) in rows {
        assert_eq!(*encoded, hex(printed), "{name}: {encoded:02X?}");
    }
}

#[test]
fn dynamixel_instructions_to_one_device_are_as_printed() {
    let [one, two] = [dxl_id(1), dxl_id(2)];
    let goal = |value: i32| tried(|o| dxl::write(o, one, 116, &value.to_le_bytes()));
    let reset = sent(|o| dxl::factory_reset(o, one, FactoryReset::KeepId));
    let velocity = tried(|o| dxl::reg_write(o, one, 104, &200_i32.to_le_bytes()));
    assert_as_printed(&[
        ("ping 1", "FF FF FD 00 01 03 00 01 19 4E", sent(|o| dxl::ping(o, one))),
        ("ping 2", "FF FF FD 00 02 03 00 01 19 72", sent(|o| dxl::ping(o, two))),
        ("ping 42", "FF FF FD 00 2A 03 00 01 16 D2", sent(|o| dxl::ping(o, dxl_id(42)))),
        ("ping all", "FF FF FD 00 FE 03 00 01 31 42", sent(|o| dxl::ping(o, dxl::Target::All))),
        (
            "read present position",
            "FF FF FD 00 01 07 00 02 84 00 04 00 1D 15",
            tried(|o| dxl::read(o, one, 132, 4)),
        ),
        (
            "read (43, 2)",
            "FF FF FD 00 01 07 00 02 2B 00 02 00 2E CD",
            tried(|o| dxl::read(o, one, 43, 2)),
        ),
        ("write goal 512", "FF FF FD 00 01 09 00 03 74 00 00 02 00 00 CA 89", goal(512)),
        ("register velocity", "FF FF FD 00 01 09 00 04 68 00 C8 00 00 00 AE 8E", velocity),
        ("action", "FF FF FD 00 01 03 00 05 02 CE", sent(|o| dxl::action(o, one))),
        ("reset but id", "FF FF FD 00 01 04 00 06 01 A1 E6", reset),
        ("reboot 1", "FF FF FD 00 01 03 00 08 2F 4E", sent(|o| dxl::reboot(o, one))),
        ("reboot 2", "FF FF FD 00 02 03 00 08 2F 72", sent(|o| dxl::reboot(o, two))),
        (
            "clear",
            "FF FF FD 00 01 08 00 10 01 44 58 4C 22 B1 DC",
            sent(|o| dxl::clear_multi_turn(o, one)),
        ),
        (
            "backup",
            "FF FF FD 00 01 08 00 20 01 43 54 52 4C 16 F5",
            sent(|o| dxl::control_table_backup(o, one)),
        ),
        // The manual prints CRC 92 F5; over these bytes it is 9E F5.
        (
            "restore",
            "FF FF FD 00 01 08 00 20 02 43 54 52 4C 9E F5",
            sent(|o| dxl::control_table_restore(o, one)),
        ),
        (
            "by hand: goal 0x00FDFFFF, stuffed",
            "FF FF FD 00 01 0A 00 03 74 00 FF FF FD FD 00 21 E7",
            goal(0x00FD_FFFF),
        ),
        ("by hand: goal -1", "FF FF FD 00 01 09 00 03 74 00 FF FF FF FF C8 89", goal(-1)),
        (
            "by hand: torque on",
            "FF FF FD 00 01 06 00 03 40 00 01 DB 66",
            tried(|o| dxl::write(o, one, 64, &[1])),
        ),
    ]);
}

#[test]
fn dynamixel_instructions_to_several_devices_are_as_printed() {
    let ids = |numbers: &[u8]| numbers.iter().map(|&n| dxl_id(n)).collect::<Vec<_>>();
    let ask = |number, address, length| BulkRead { id: dxl_id(number), address, length };
    let goals = [(1, 150_u32), (2, 170)].map(|(id, goal)| (dxl_id(id), goal.to_le_bytes()));
    let limits = [(dxl_id(1), 32, hex("A0 00")), (dxl_id(2), 31, hex("50"))];
    assert_as_printed(&[
        (
            "sync read",
            "FF FF FD 00 FE 09 00 82 84 00 04 00 01 02 CE FA",
            tried(|o| dxl::sync_read(o, 132, 4, ids(&[1, 2]))),
        ),
        (
            "sync write goals 150 and 170",
            "FF FF FD 00 FE 11 00 83 74 00 04 00 01 96 00 00 00 02 AA 00 00 00 82 87",
            tried(|o| dxl::sync_write(o, 116, 4, goals)),
        ),
        (
            "fast sync read",
            "FF FF FD 00 FE 0A 00 8A 84 00 04 00 03 07 04 20 F2",
            tried(|o| dxl::fast_sync_read(o, 132, 4, ids(&[3, 7, 4]))),
        ),
        (
            "fast sync read (580, 4)",
            "FF FF FD 00 FE 09 00 8A 44 02 04 00 01 02 72 F2",
            tried(|o| dxl::fast_sync_read(o, 580, 4, ids(&[1, 2]))),
        ),
        (
            "bulk read",
            "FF FF FD 00 FE 0D 00 92 01 90 00 02 00 02 92 00 01 00 1A 05",
            tried(|o| dxl::bulk_read(o, [ask(1, 144, 2), ask(2, 146, 1)])),
        ),
        (
            "bulk write",
            "FF FF FD 00 FE 10 00 93 01 20 00 02 00 A0 00 02 1F 00 01 00 50 B7 68",
            tried(|o| dxl::bulk_write(o, limits)),
        ),
        // The manual repeats the CRC 20 F2 of its fast sync read; over these bytes it is DA 2D.
        (
            "fast bulk read",
            "FF FF FD 00 FE 12 00 9A 03 84 00 04 00 07 7C 00 02 00 04 92 00 01 00 DA 2D",
            tried(|o| dxl::fast_bulk_read(o, [ask(3, 132, 4), ask(7, 124, 2), ask(4, 146, 1)])),
        ),
        (
            "by hand: sync read (126, 10)",
            "FF FF FD 00 FE 09 00 82 7E 00 0A 00 01 02 38 92",
            tried(|o| dxl::sync_read(o, 126, 10, ids(&[1, 2]))),
        ),
        (
            "by hand: fast sync read (126, 10)",
            "FF FF FD 00 FE 09 00 8A 7E 00 0A 00 01 02 BB 1A",
            tried(|o| dxl::fast_sync_read(o, 126, 10, ids(&[1, 2]))),
        ),
    ]);
}

/// A Protocol 2.0 packet around a body already stuffed, with a CRC worked out bit by bit.
fn dynamixel_packet(id: u8, body: &[u8]) -> Vec<u8> {
    let [low, high] = u16::try_from(body.len() + 2).unwrap().to_le_bytes();
    let mut packet = [&[0xFF, 0xFF, 0xFD, 0x00, id, low, high], body].concat();
    let mut crc: u16 = 0;
    for &byte in &packet {
        crc ^= u16::from(byte) << 8;
        for _ in 0..8 {
            crc = if crc >> 15 == 1 { (crc << 1) ^ 0x8005 } else { crc << 1 };
        }
    }
    packet.extend(crc.to_le_bytes());
    packet
}

#[test]
fn stuffing_is_that_of_the_unit_vectors_both_ways() {
    let rows = [
        ("FF FF FD FD", "FF FF FD FD FD"),
        ("FF FF FD FF FF FD", "FF FF FD FD FF FF FD FD"),
        ("FF FF 01 FD", "FF FF 01 FD"),
        // From the manual's rule: the run is longer than the pattern.
        ("FF FF FF FD", "FF FF FF FD FD"),
    ];
    for (plain, stuffed) in rows {
        let out = tried(|o| dxl::write(o, dxl_id(1), 116, &hex(plain)));
        assert_eq!(out[10..out.len() - 2], hex(stuffed), "{plain}");

        let status = dynamixel_packet(1, &[hex("55 00"), hex(stuffed)].concat());
        let mut scratch = Vec::new();
        let decoded = dxl::decode(&status, &mut scratch);
        let Decoded::Packet(status, _) = decoded else { panic!("{plain}: {decoded:?}") };
        assert_eq!(status.params, hex(plain), "{plain}");
    }
}

#[test]
fn dynamixel_statuses_have_the_printed_values() {
    // Name, bytes, id, error byte, parameters.
    let rows = [
        ("ping 1", "FF FF FD 00 01 07 00 55 00 06 04 26 65 5D", 1, 0, "06 04 26"),
        ("ping 2", "FF FF FD 00 02 07 00 55 00 06 04 26 6F 6D", 2, 0, "06 04 26"),
        ("position 166", "FF FF FD 00 01 08 00 55 00 A6 00 00 00 8C C0", 1, 0, "A6 00 00 00"),
        ("position 2079", "FF FF FD 00 02 08 00 55 00 1F 08 00 00 BA BE", 2, 0, "1F 08 00 00"),
        ("written", "FF FF FD 00 01 04 00 55 00 A1 0C", 1, 0, ""),
        ("bulk 1", "FF FF FD 00 01 06 00 55 00 77 00 C3 69", 1, 0, "77 00"),
        ("bulk 2", "FF FF FD 00 02 05 00 55 00 24 8B A9", 2, 0, "24"),
        ("by hand: alert", "FF FF FD 00 01 04 00 55 80 A2 8F", 1, 0x80, ""),
        ("by hand: access", "FF FF FD 00 01 04 00 55 07 B0 8C", 1, 7, ""),
        ("by hand: range", "FF FF FD 00 01 04 00 55 04 BA 8C", 1, 4, ""),
        (
            "by hand: stuffed",
            "FF FF FD 00 01 09 00 55 00 FF FF FD FD FF DA 9E",
            1,
            0,
            "FF FF FD FF",
        ),
    ];
    for (name, printed, id, error, params) in rows {
        let (bytes, params, mut scratch) = (hex(printed), hex(params), Vec::new());
        let error = dxl::StatusError::from_byte(error);
        let status = dxl::Status { id: dxl_id(id), error, params: &params };
        let expected = Decoded::Packet(status, bytes.len());
        assert_eq!(dxl::decode(&bytes, &mut scratch), expected, "{name}");
    }
}

#[test]
fn the_answer_to_a_ping_names_model_and_firmware() {
    let bytes = hex("FF FF FD 00 01 07 00 55 00 06 04 26 65 5D");
    let mut scratch = Vec::new();
    let Decoded::Packet(status, 14) = dxl::decode(&bytes, &mut scratch) else { panic!() };
    let identity = dxl::Identity { model_number: 1030, firmware: 38 };
    assert_eq!(status.identity(), Some(identity));
}

#[test]
fn merged_statuses_have_the_printed_values() {
    type Row<'a> = (&'a str, &'a str, &'a [(u8, &'a str)]);
    let rows: [Row<'_>; 3] = [
        (
            "fast sync read (132, 4) of 3, 7, 4",
            "FF FF FD 00 FE 19 00 55 00 03 A6 00 00 00 84 08 00 07 1F 08 00 00 16 CA \
             00 04 FF 03 00 00 D1 9E",
            &[(3, "A6 00 00 00"), (7, "1F 08 00 00"), (4, "FF 03 00 00")],
        ),
        (
            "fast sync read (580, 4) of 1, 2",
            "FF FF FD 00 FE 11 00 55 00 01 D0 07 00 00 0C 83 00 02 09 00 00 00 11 40",
            &[(1, "D0 07 00 00"), (2, "09 00 00 00")],
        ),
        (
            "fast bulk read 3:(132, 4) 7:(124, 2) 4:(146, 1)",
            "FF FF FD 00 FE 14 00 55 00 03 A6 00 00 00 67 A4 00 07 A5 01 24 74 00 04 1F D9 C1",
            &[(3, "A6 00 00 00"), (7, "A5 01"), (4, "1F")],
        ),
    ];
    for (name, printed, expected) in rows {
        let bytes = hex(printed);
        let asked: Vec<_> =
            expected.iter().map(|(id, params)| (dxl_id(*id), hex(params).len())).collect();
        let merged = dxl::decode_merged(&bytes, &asked);
        assert_eq!(merged.need(), 0, "{name}");
        assert_eq!(merged.answers().count(), asked.len(), "{name}");
        for ((id, answer), (_, params)) in merged.answers().zip(expected) {
            let (error, params) = (dxl::StatusError::default(), &hex(params)[..]);
            assert_eq!(answer, Ok(dxl::Status { id, error, params }), "{name}");
        }
    }
}

#[test]
fn printed_instructions_are_recognised_as_echoes() {
    let rows = [
        "FF FF FD 00 01 03 00 01 19 4E",
        "FF FF FD 00 FE 03 00 01 31 42",
        "FF FF FD 00 01 09 00 03 74 00 00 02 00 00 CA 89",
        "FF FF FD 00 01 08 00 20 02 43 54 52 4C 9E F5",
        "FF FF FD 00 FE 11 00 83 74 00 04 00 01 96 00 00 00 02 AA 00 00 00 82 87",
        "FF FF FD 00 01 0A 00 03 74 00 FF FF FD FD 00 21 E7",
    ];
    for printed in rows {
        let (bytes, mut scratch) = (hex(printed), Vec::new());
        assert_eq!(dxl::decode(&bytes, &mut scratch), Decoded::Echo(bytes.len()), "{printed}");
    }
}

#[test]
fn the_misprinted_crcs_of_the_manual_are_refused() {
    let rows = [
        "FF FF FD 00 01 08 00 20 02 43 54 52 4C 92 F5",
        "FF FF FD 00 FE 12 00 9A 03 84 00 04 00 07 7C 00 02 00 04 92 00 01 00 20 F2",
    ];
    for printed in rows {
        let (bytes, mut scratch) = (hex(printed), Vec::new());
        let decoded = dxl::decode(&bytes, &mut scratch);
        assert!(matches!(decoded, Decoded::Bad(_, n) if n == bytes.len()), "{decoded:?}");
    }
}

#[test]
fn protocol_1_instructions_are_as_printed() {
    let [zero, one, two] = [0, 1, 2].map(|number| dxl1::Id::new(number).unwrap());
    let all = dxl1::Target::All;
    let ask = |id, address| dxl1::BulkRead { id, address, length: 2 };
    let moves = [(zero, hex("10 00 50 01")), (one, hex("20 02 60 03"))];
    assert_as_printed(&[
        ("ping 1", "FF FF 01 02 01 FB", sent(|o| dxl1::ping(o, one))),
        ("read temperature", "FF FF 01 04 02 2B 01 CC", tried(|o| dxl1::read(o, one, 43, 1))),
        ("write id 1 to all", "FF FF FE 04 03 03 01 F6", tried(|o| dxl1::write(o, all, 3, &[1]))),
        // The address is reserved on an AX-12; the packet is whole all the same.
        (
            "write (12) two bytes",
            "FF FF 01 05 03 0C 64 AA DC",
            tried(|o| dxl1::write(o, one, 12, &hex("64 AA"))),
        ),
        (
            "register goal 500",
            "FF FF 01 05 04 1E F4 01 E2",
            tried(|o| dxl1::reg_write(o, one, 30, &500_u16.to_le_bytes())),
        ),
        ("action of all", "FF FF FE 02 05 FA", sent(|o| dxl1::action(o, all))),
        ("reset 0", "FF FF 00 02 06 F7", sent(|o| dxl1::factory_reset(o, zero))),
        (
            "sync write goals and speeds of 0 and 1",
            "FF FF FE 0E 83 1E 04 00 10 00 50 01 01 20 02 60 03 67",
            tried(|o| dxl1::sync_write(o, 30, 4, moves)),
        ),
        (
            "bulk read",
            "FF FF FE 09 92 00 02 01 1E 02 02 24 1D",
            tried(|o| dxl1::bulk_read(o, [ask(one, 30), ask(two, 36)])),
        ),
        (
            "by hand: AX goal 512, speed 256",
            "FF FF 01 07 03 1E 00 02 00 01 D3",
            tried(|o| dxl1::write(o, one, 30, &hex("00 02 00 01"))),
        ),
        (
            "by hand: AX read position",
            "FF FF 01 04 02 24 02 D2",
            tried(|o| dxl1::read(o, one, 36, 2)),
        ),
    ]);
}

#[test]
fn protocol_1_statuses_have_the_printed_values() {
    // Name, bytes, id, error bits, parameters.
    let overload_and_heat = Error1::OVERLOAD | Error1::OVERHEATING;
    let rows = [
        ("ping 1", "FF FF 01 02 00 FC", 1, 0, ""),
        ("temperature 32", "FF FF 01 03 00 20 DB", 1, 0, "20"),
        ("reset 0", "FF FF 00 02 00 FD", 0, 0, ""),
        ("bulk 1", "FF FF 01 04 00 00 80 7A", 1, 0, "00 80"),
        ("bulk 2", "FF FF 02 04 00 00 80 79", 2, 0, "00 80"),
        ("overload, hot", "FF FF 01 02 24 D8", 1, overload_and_heat, ""),
        ("by hand: AX position 512", "FF FF 01 04 00 00 02 F8", 1, 0, "00 02"),
    ];
    for (name, printed, id, error, params) in rows {
        let (bytes, params) = (hex(printed), hex(params));
        let id = dxl1::Id::new(id).unwrap();
        let status = dxl1::Status { id, error: Error1(error), params: &params };
        assert_eq!(dxl1::decode(&bytes, 2), Decoded::Packet(status, bytes.len()), "{name}");
    }
}

#[test]
fn feetech_instructions_are_as_printed() {
    let [one, two] = [sts_id(1), sts_id(2)];
    let ping = |id| sent(|o| sts::ping(o, sts_id(id)));
    let read = |address, length| tried(|o| sts::read(o, one, address, length));
    let write_to = |id, address, bytes: &str| tried(|o| sts::write(o, id, address, &hex(bytes)));
    let write = |address, bytes| write_to(one, address, bytes);
    let signed = |address, value, sign_bit| {
        let raw = sts::sign_magnitude_encode(value, sign_bit).unwrap();
        tried(|o| sts::write(o, one, address, &raw.to_le_bytes()))
    };
    let goals = [one, two].map(|id| (id, hex("00 08 E8 03")));
    let registered = tried(|o| sts::reg_write(o, one, 42, &hex("00 08 00 00 E8 03")));
    assert_as_printed(&[
        ("ping 1", "FF FF 01 02 01 FB", ping(1)),
        ("ping 2", "FF FF 02 02 01 FA", ping(2)),
        ("ping 3", "FF FF 03 02 01 F9", ping(3)),
        // Framing of Protocol 1.0; the servos of STS and SMS series answer in turn.
        ("by hand: ping all", "FF FF FE 02 01 FE", sent(|o| sts::ping(o, sts::Target::All))),
        ("read position", "FF FF 01 04 02 38 02 BE", read(56, 2)),
        ("read 15 bytes", "FF FF 01 04 02 38 0F B1", read(56, 15)),
        ("read temperature", "FF FF 01 04 02 3F 01 B8", read(63, 1)),
        ("goal 2048", "FF FF 01 05 03 2A 00 08 C4", write(42, "00 08")),
        (
            "goal 2048, time 0, speed 1000",
            "FF FF 01 09 03 2A 00 08 00 00 E8 03 D5",
            write(42, "00 08 00 00 E8 03"),
        ),
        (
            "by hand: acceleration 50, goal 2048, time 0, speed 2400",
            "FF FF 01 0A 03 29 32 00 08 00 00 60 09 25",
            write(41, "32 00 08 00 00 60 09"),
        ),
        (
            "sync write goals 2048",
            "FF FF FE 0E 83 2A 04 01 00 08 E8 03 02 00 08 E8 03 59",
            tried(|o| sts::sync_write(o, 42, 4, goals)),
        ),
        ("torque on", "FF FF 01 04 03 28 01 CE", write(40, "01")),
        ("torque off", "FF FF 01 04 03 28 00 CF", write(40, "00")),
        ("by hand: set middle", "FF FF 01 04 03 28 80 4F", write(40, "80")),
        ("by hand: unlock", "FF FF 01 04 03 37 00 C0", write(55, "00")),
        ("by hand: lock", "FF FF 01 04 03 37 01 BF", write(55, "01")),
        ("by hand: id 1 to 2", "FF FF 01 04 03 05 02 F0", write(5, "02")),
        ("by hand: lock 2", "FF FF 02 04 03 37 01 BE", write_to(two, 55, "01")),
        ("by hand: baud index 4", "FF FF 01 04 03 06 04 ED", write(6, "04")),
        ("by hand: speed mode", "FF FF 01 04 03 21 01 D5", write(33, "01")),
        ("by hand: speed -1000", "FF FF 01 05 03 2E E8 83 5D", signed(46, -1000, SignBit::Bit15)),
        ("by hand: offset -100", "FF FF 01 05 03 1F 64 08 6B", signed(31, -100, SignBit::Bit11)),
        (
            "by hand: sync read (56, 4)",
            "FF FF FE 06 82 38 04 01 02 3A",
            tried(|o| sts::sync_read(o, 56, 4, [one, two])),
        ),
        ("by hand: registered goal", "FF FF 01 09 04 2A 00 08 00 00 E8 03 D4", registered),
        ("action of all", "FF FF FE 02 05 FA", sent(|o| sts::action(o, sts::Target::All))),
        // DYNAMIXEL Protocol 1.0 manual, Factory Reset of id 0: the same framing and code.
        ("reset 0", "FF FF 00 02 06 F7", sent(|o| sts::factory_reset(o, sts_id(0)))),
        (
            "by hand: SCS goal 511, speed 1000, big-endian",
            "FF FF 01 09 03 2A 01 FF 00 00 03 E8 DD",
            write(42, "01 FF 00 00 03 E8"),
        ),
        ("by hand: SCS unlock", "FF FF 01 04 03 30 00 C7", write(48, "00")),
    ]);
}

#[test]
fn feetech_statuses_have_the_printed_values() {
    // Name, bytes, id, error bits, parameters.
    let rows = [
        ("ping 1", "FF FF 01 02 00 FC", 1, 0, ""),
        ("ping 3", "FF FF 03 02 00 FA", 3, 0, ""),
        ("position 1304", "FF FF 01 04 00 18 05 DD", 1, 0, "18 05"),
        ("position 2048", "FF FF 01 04 00 00 08 F2", 1, 0, "00 08"),
        ("position 3060", "FF FF 01 04 00 F4 0B FB", 1, 0, "F4 0B"),
        ("temperature 42", "FF FF 01 03 00 2A D1", 1, 0, "2A"),
        ("by hand: 2048, -100", "FF FF 01 06 00 00 08 64 80 0C", 1, 0, "00 08 64 80"),
        ("by hand: 2047, 0", "FF FF 02 06 00 FF 07 00 00 F1", 2, 0, "FF 07 00 00"),
        ("by hand: SCS position 511", "FF FF 01 04 00 01 FF FA", 1, 0, "01 FF"),
        // DYNAMIXEL Protocol 1.0 manual, overload and overheating: the same bits here.
        ("overload, hot", "FF FF 01 02 24 D8", 1, 0x24, ""),
    ];
    for (name, printed, id, error, params) in rows {
        let (bytes, params) = (hex(printed), hex(params));
        let error = sts::StatusError(error);
        let status = sts::Status { id: sts_id(id), error, params: &params };
        assert_eq!(sts::decode(&bytes, 4), Decoded::Packet(status, bytes.len()), "{name}");
    }
}

#[test]
fn feetech_numbers_have_the_printed_values() {
    let rows = [
        ("speed -1000", 0x83E8, SignBit::Bit15, -1000),
        ("offset -100", 0x0864, SignBit::Bit11, -100),
        ("position 1304", 0x0518, SignBit::Bit15, 1304),
        ("present speed -100", 0x8064, SignBit::Bit15, -100),
    ];
    for (name, raw, sign_bit, value) in rows {
        assert_eq!(sts::sign_magnitude_decode(raw, sign_bit), value, "{name}");
        assert_eq!(sts::sign_magnitude_encode(value, sign_bit), Ok(raw), "{name}");
    }
}
