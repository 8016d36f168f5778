//! Our codecs against those of two published crates, on the bytes they put on a line and the
//! values they read from one.
//!
//! `dynamixel2` 0.9.1 wants a serial device, so it is given a pseudo-terminal; `rustypot` 1.13.1
//! takes any `serialport::SerialPort`, so it is given one that lives in memory. Where they are
//! known to be wrong, a test of its own says how, so that a corrected release is noticed.

use dynamixel2::instructions::{BulkReadData, BulkWriteData};
#[path = "wire_against_others/memory_port.rs"]
mod memory_port;

use dynamixel2::instructions::{FactoryResetKind, SyncWriteData};
use gaitway::wire::checksum::crc16;
use gaitway::wire::dynamixel2::{self as dxl, BulkRead, ErrorCode, FactoryReset, Target};
use gaitway::wire::{Decoded, EncodeError, dynamixel1 as dxl1, feetech as sts};
use memory_port::MemoryPort;
use proptest::prelude::*;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustypot::DynamixelProtocolHandler;
use std::io::{Read, Write};
use std::time::{Duration, Instant};

fn dxl_id(number: u8) -> dxl::Id {
    dxl::Id::new(number).unwrap()
}

fn sts_id(number: u8) -> sts::Id {
    sts::Id::new(number).unwrap()
}

/// Bytes as printed in a manual.
fn hex(text: &str) -> Vec<u8> {
    text.split_whitespace().map(|byte| u8::from_str_radix(byte, 16).unwrap()).collect()
}

fn sent(encode: impl FnOnce(&mut Vec<u8>)) -> Vec<u8> {
    let mut out = Vec::new();
    encode(&mut out);
    out
}

fn tried(encode: impl FnOnce(&mut Vec<u8>) -> Result<(), EncodeError>) -> Vec<u8> {
    sent(|out| encode(out).unwrap())
}

/// A status with a body already stuffed.
fn status(id: u8, body: &[u8]) -> Vec<u8> {
    let [low, high] = (body.len() as u16 + 3).to_le_bytes();
    let mut packet = [&[0xFF, 0xFF, 0xFD, 0x00, id, low, high, 0x55], body].concat();
    packet.extend(crc16(&packet).to_le_bytes());
    packet
}

/// `dynamixel2` on one end of a pseudo-terminal, and the other end.
struct PtyLine {
    bus: dynamixel2::Bus<Vec<u8>, Vec<u8>>,
    far_end: std::fs::File,
}

impl PtyLine {
    fn open() -> Self {
        let far_end = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).unwrap();
        grantpt(&far_end).unwrap();
        unlockpt(&far_end).unwrap();
        let name = ptsname(&far_end, Vec::new()).unwrap().into_string().unwrap();
        let buffers = || vec![0; 1024];
        let bus = dynamixel2::Bus::open_with_buffers(name, 1_000_000, buffers(), buffers());
        Self { bus: bus.unwrap(), far_end: far_end.into() }
    }

    /// Checks that their bus sends exactly `ours`. Nobody answers, so they time out where they
    /// expect an answer; what matters has been sent by then.
    fn assert_sends<R>(
        &mut self,
        name: &str,
        ours: &[u8],
        instruct: impl FnOnce(&mut dynamixel2::Bus<Vec<u8>, Vec<u8>>) -> R,
    ) {
        instruct(&mut self.bus);
        let theirs = self.receive(ours.len());
        assert_eq!(theirs, ours, "{name}: {theirs:02X?}, ours {ours:02X?}");
    }

    /// What came out of the line, at least `length` bytes.
    fn receive(&mut self, length: usize) -> Vec<u8> {
        let (mut received, mut chunk) = (Vec::new(), [0; 1024]);
        while received.len() < length {
            let patience = Timespec { tv_sec: 5, tv_nsec: 0 };
            let mut waiting = [PollFd::new(&self.far_end, PollFlags::IN)];
            let ready = poll(&mut waiting, Some(&patience)).unwrap();
            assert!(ready == 1, "only {received:02X?} of {length} bytes were sent");
            let n = self.far_end.read(&mut chunk).unwrap();
            received.extend_from_slice(&chunk[..n]);
        }
        received
    }

    /// What their bus makes of a status that answers a read: id, error byte, parameters.
    fn read_status(&mut self, status: &[u8]) -> Result<(u8, u8, Vec<u8>), dynamixel2::ReadError> {
        // They empty their input when they send, so something is sent first.
        self.bus.write_instruction(1, 0x01, 0, |_| ()).unwrap();
        self.receive(10);
        self.far_end.write_all(status).unwrap();
        let status = self.bus.read_status_response_deadline(Instant::now() + PATIENCE)?;
        Ok((status.packet_id(), status.error(), status.parameters().to_vec()))
    }
}

const PATIENCE: Duration = Duration::from_secs(5);

#[test]
fn dynamixel2_sends_the_same_instructions_to_one_device() {
    let mut line = PtyLine::open();
    let one = dxl_id(1);
    line.assert_sends("ping", &sent(|o| dxl::ping(o, one)), |bus| bus.ping(1));
    let read = tried(|o| dxl::read(o, one, 132, 4));
    line.assert_sends("read", &read, |bus| bus.read_u32(1, 132));
    let write = tried(|o| dxl::write(o, one, 116, &[0xFF, 0xFF, 0xFD, 0x00]));
    line.assert_sends("write, stuffed", &write, |bus| bus.write_u32(1, 116, 0x00FD_FFFF));
    let reg_write = tried(|o| dxl::reg_write(o, one, 104, &[200, 0, 0, 0]));
    line.assert_sends("reg write", &reg_write, |bus| bus.reg_write_u32(1, 104, 200));
    line.assert_sends("action", &sent(|o| dxl::action(o, one)), |bus| bus.action(1));
    let all = sent(|o| dxl::action(o, Target::All));
    line.assert_sends("action of all", &all, |bus| bus.broadcast_action());
    line.assert_sends("reboot", &sent(|o| dxl::reboot(o, one)), |bus| bus.reboot(1));
    let clear = sent(|o| dxl::clear_multi_turn(o, one));
    line.assert_sends("clear", &clear, |bus| bus.clear_revolution_counter(1));
    let kinds = [
        (FactoryReset::Everything, FactoryResetKind::ResetAll),
        (FactoryReset::KeepId, FactoryResetKind::KeepId),
        (FactoryReset::KeepIdAndBaud, FactoryResetKind::KeepIdAndBaudRate),
    ];
    for (ours, theirs) in kinds {
        let reset = sent(|o| dxl::factory_reset(o, one, ours));
        line.assert_sends("factory reset", &reset, |bus| bus.factory_reset(1, theirs));
    }
}

#[test]
fn dynamixel2_sends_the_same_instructions_to_several_devices() {
    let mut line = PtyLine::open();
    let goals = [(1, -1_i32), (2, 170), (200, 4095)];
    let ids = goals.map(|(id, _)| dxl_id(id));
    let sync_read = tried(|o| dxl::sync_read(o, 126, 10, ids));
    line.assert_sends("sync read", &sync_read, |bus| bus.sync_read(&[1, 2, 200], 126, 10));
    let writes = goals.map(|(id, goal)| (dxl_id(id), goal.to_le_bytes()));
    let sync_write = tried(|o| dxl::sync_write(o, 116, 4, writes));
    line.assert_sends("sync write", &sync_write, |bus| {
        let goals = goals.map(|(motor_id, goal)| SyncWriteData { motor_id, data: goal as u32 });
        bus.sync_write_u32(116, &goals)
    });
    let bulk_write = tried(|o| dxl::bulk_write(o, writes.map(|(id, goal)| (id, 116, goal))));
    line.assert_sends("bulk write", &bulk_write, |bus| {
        bus.bulk_write(&goals.map(|(motor_id, goal)| {
            let data = goal.to_le_bytes();
            BulkWriteData { motor_id, address: 116, data }
        }))
    });
    let ask = BulkRead { id: dxl_id(1), address: 144, length: 2 };
    let bulk_read = tried(|o| dxl::bulk_read(o, [ask]));
    line.assert_sends("bulk read of one", &bulk_read, |bus| {
        bus.bulk_read(&[BulkReadData { motor_id: 1, address: 144, count: 2 }])
    });
}

#[test]
fn dynamixel2_reads_the_same_statuses() {
    let mut line = PtyLine::open();
    let statuses = [
        hex("FF FF FD 00 01 07 00 55 00 06 04 26 65 5D"),
        hex("FF FF FD 00 02 08 00 55 00 1F 08 00 00 BA BE"),
        hex("FF FF FD 00 01 04 00 55 80 A2 8F"),
        hex("FF FF FD 00 01 09 00 55 00 FF FF FD FD FF DA 9E"),
        status(252, &[0x00, 0xFF, 0xFF, 0xFF, 0xFF]),
    ];
    for bytes in statuses {
        let mut scratch = Vec::new();
        let Decoded::Packet(ours, _) = dxl::decode(&bytes, &mut scratch) else { panic!() };
        let (id, error, params) = line.read_status(&bytes).unwrap();
        assert_eq!((ours.id.get(), ours.params), (id, &params[..]), "{bytes:02X?}");
        assert_eq!(ours.error, dxl::StatusError::from_byte(error), "{bytes:02X?}");
    }
}

#[test]
fn dynamixel2_misses_a_pattern_behind_a_third_ff_and_we_do_not() {
    let mut line = PtyLine::open();
    let ours = tried(|o| dxl::write(o, dxl_id(1), 116, &[0xFF, 0xFF, 0xFF, 0xFD]));
    assert_eq!(ours[..15], hex("FF FF FD 00 01 0A 00 03 74 00 FF FF FF FD FD"));
    let _ = line.bus.write_u32(1, 116, 0xFDFF_FFFF);
    let theirs = line.receive(16);
    assert_eq!(theirs[..14], hex("FF FF FD 00 01 09 00 03 74 00 FF FF FF FD"), "not stuffed");

    let stuffed = status(1, &[0x00, 0xFF, 0xFF, 0xFF, 0xFD, 0xFD]);
    let mut scratch = Vec::new();
    let Decoded::Packet(ours, 16) = dxl::decode(&stuffed, &mut scratch) else { panic!() };
    assert_eq!(ours.params, [0xFF, 0xFF, 0xFF, 0xFD]);
    let (_, _, theirs) = line.read_status(&stuffed).unwrap();
    assert_eq!(theirs, [0xFF, 0xFF, 0xFF, 0xFD, 0xFD], "stuffing left in");
}

#[test]
fn dynamixel2_overlaps_the_items_of_a_bulk_read_and_we_do_not() {
    let printed = hex("FF FF FD 00 FE 0D 00 92 01 90 00 02 00 02 92 00 01 00 1A 05");
    let asked = [(1, 144, 2), (2, 146, 1)];
    let ours = asked.map(|(id, address, length)| BulkRead { id: dxl_id(id), address, length });
    assert_eq!(tried(|o| dxl::bulk_read(o, ours)), printed);

    let mut line = PtyLine::open();
    let theirs = asked.map(|(motor_id, address, count)| BulkReadData { motor_id, address, count });
    let _ = line.bus.bulk_read(&theirs);
    let theirs = line.receive(printed.len());
    assert_eq!(theirs[8..14], [1, 2, 146, 0, 1, 0], "the second begins inside the first");
}

/// What rustypot sends when asked something nobody answers.
fn sent_by<R>(ask: impl FnOnce(&mut MemoryPort) -> R) -> Vec<u8> {
    let mut port = MemoryPort::default();
    ask(&mut port);
    port.sent
}

#[test]
fn rustypot_sends_the_same_protocol_2_instructions() {
    let them = DynamixelProtocolHandler::v2();
    let one = dxl_id(1);
    assert_eq!(sent_by(|p| them.ping(p, 1)), sent(|o| dxl::ping(o, one)));
    assert_eq!(sent_by(|p| them.broadcast_ping(p)), sent(|o| dxl::ping(o, Target::All)));
    assert_eq!(sent_by(|p| them.reboot(p, 1)), sent(|o| dxl::reboot(o, one)));
    let kinds = [
        (FactoryReset::Everything, false, false),
        (FactoryReset::KeepId, true, false),
        (FactoryReset::KeepIdAndBaud, true, true),
    ];
    for (kind, id, baud) in kinds {
        let theirs = sent_by(|p| them.factory_reset(p, 1, id, baud));
        assert_eq!(theirs, sent(|o| dxl::factory_reset(o, one, kind)));
    }
}

#[test]
fn rustypot_reads_the_same_merged_status() {
    let example = hex(
        "FF FF FD 00 FE 19 00 55 00 03 A6 00 00 00 84 08 00 07 1F 08 00 00 16 CA 00 04 FF 03 00 \
         00 D1 9E",
    );
    let mut port = MemoryPort::answering(&example);
    let theirs =
        DynamixelProtocolHandler::v2().fast_sync_read(&mut port, &[3, 7, 4], 132, 4).unwrap();
    let asked = [3, 7, 4].map(|id| (dxl_id(id), 4));
    let ours = dxl::decode_merged(&example, &asked).answers();
    let ours: Vec<_> = ours.map(|(_, answer)| answer.unwrap().params.to_vec()).collect();
    assert_eq!(ours, theirs);
    assert_eq!(port.sent, tried(|o| dxl::fast_sync_read(o, 132, 4, asked.map(|(id, _)| id))));
}

#[test]
fn rustypot_takes_a_refused_read_for_no_bytes_and_we_say_why() {
    // Access error: there is no such register.
    let refused = hex("FF FF FD 00 01 04 00 55 07 B0 8C");
    let them = DynamixelProtocolHandler::v2();
    let theirs = them.read(&mut MemoryPort::answering(&refused), 1, 200, 4);
    assert_eq!(theirs.unwrap(), [0_u8; 0], "success, and nothing read");
    // The number is there for those who ask for it and know that it is a number: read as a bit
    // mask, as in Protocol 1.0, it would be three errors at once.
    let (_, error) = them.read_with_error(&mut MemoryPort::answering(&refused), 1, 200, 4).unwrap();
    assert_eq!((error.v2_instruction_error(), error.v2_alert()), (7, false));
    assert_eq!(error.v1_conditions().len(), 3);

    let mut scratch = Vec::new();
    let Decoded::Packet(ours, _) = dxl::decode(&refused, &mut scratch) else { panic!() };
    assert_eq!(ours.error, dxl::StatusError { alert: false, code: Some(ErrorCode::Access) });
}

#[test]
fn rustypot_sends_the_same_feetech_instructions() {
    let them = DynamixelProtocolHandler::v1();
    let one = sts_id(1);
    assert_eq!(sent_by(|p| them.ping(p, 1)), sent(|o| sts::ping(o, one)));
    assert_eq!(sent_by(|p| them.broadcast_ping(p)), sent(|o| sts::ping(o, sts::Target::All)));
    let reset = sent_by(|p| them.factory_reset(p, 1, false, false));
    assert_eq!(reset, sent(|o| sts::factory_reset(o, one)));
    assert_eq!(sent_by(|p| them.read(p, 1, 56, 15)), tried(|o| sts::read(o, one, 56, 15)));
    let ids = [one, sts_id(253)];
    let sync_read = sent_by(|p| them.sync_read(p, &[1, 253], 56, 4));
    assert_eq!(sync_read, tried(|o| sts::sync_read(o, 56, 4, ids)));
}

#[test]
fn rustypot_sends_the_same_protocol_1_instructions() {
    let them = DynamixelProtocolHandler::v1();
    let one = sts_id(1);
    assert_eq!(sent_by(|p| them.ping(p, 1)), sent(|o| dxl1::ping(o, one)));
    let reset = sent_by(|p| them.factory_reset(p, 1, false, false));
    assert_eq!(reset, sent(|o| dxl1::factory_reset(o, one)));
    assert_eq!(sent_by(|p| them.read(p, 1, 36, 8)), tried(|o| dxl1::read(o, one, 36, 8)));
    let write = sent_by(|p| them.write(p, 1, 30, &[0, 2]));
    assert_eq!(write, tried(|o| dxl1::write(o, one, 30, &[0, 2])));
}

/// Bytes among which the stuffing pattern is frequent.
fn bytes(most: usize) -> impl Strategy<Value = Vec<u8>> {
    let byte = prop_oneof![2 => Just(0xFF), 2 => Just(0xFD), 1 => any::<u8>()];
    proptest::collection::vec(byte, 1..=most)
}

proptest! {
    #[test]
    fn the_crc_is_that_of_dynamixel2(bytes in proptest::collection::vec(any::<u8>(), 0..300)) {
        prop_assert_eq!(crc16(&bytes), dynamixel2::checksum::calculate_checksum(0, &bytes));
    }

    #[test]
    fn rustypot_writes_the_same_bytes(
        id in 0_u8..=252, address in any::<u8>(), first in bytes(12), second in any::<u8>(),
    ) {
        let them = DynamixelProtocolHandler::v2();
        let theirs = sent_by(|p| them.write(p, id, address, &first));
        let ours = tried(|o| dxl::write(o, dxl_id(id), u16::from(address), &first));
        prop_assert_eq!(theirs, ours);

        let other_id = if id == 252 { 0 } else { id + 1 };
        let mut other = first.clone();
        other[0] = second;
        let length = first.len();
        let theirs = sent_by(|p| {
            them.sync_write(p, &[id, other_id], address, &[first.clone(), other.clone()])
        });
        let writes = [(dxl_id(id), &first), (dxl_id(other_id), &other)];
        let ours = tried(|o| dxl::sync_write(o, u16::from(address), length as u16, writes));
        prop_assert_eq!(theirs, ours);

        let them = DynamixelProtocolHandler::v1();
        let theirs = sent_by(|p| {
            them.sync_write(p, &[id, other_id], address, &[first.clone(), other.clone()])
        });
        let writes = [(sts_id(id), &first), (sts_id(other_id), &other)];
        let ours = tried(|o| sts::sync_write(o, address, length as u8, writes));
        prop_assert_eq!(theirs, ours);
    }

    #[test]
    fn rustypot_reads_the_same_values(id in 0_u8..=252, error in 0_u8..=7, params in bytes(12)) {
        // An instruction we built, turned into a status: same stuffing, then a CRC of its own.
        let written = tried(|o| dxl::write(o, dxl_id(id), u16::from(error), &params));
        let stuffed = &written[10..written.len() - 2];
        let line = status(id, &[&[error], stuffed].concat());
        let mut scratch = Vec::new();
        let Decoded::Packet(ours, n) = dxl::decode(&line, &mut scratch) else { panic!() };
        prop_assert_eq!(n, line.len());
        let them = DynamixelProtocolHandler::v2();
        let mut port = MemoryPort::answering(&line);
        let (theirs, byte) = them.read_with_error(&mut port, id, 0, 4).unwrap();
        prop_assert_eq!(ours.params, &theirs[..]);
        prop_assert_eq!(ours.error, dxl::StatusError::from_byte(byte.byte()));

        let mut line = vec![0xFF, 0xFF, id, params.len() as u8 + 2, error];
        line.extend(&params);
        line.push(gaitway::wire::checksum::sum8(&line[2..]));
        let Decoded::Packet(ours, n) = sts::decode(&line, params.len()) else { panic!() };
        prop_assert_eq!(n, line.len());
        let mut port = MemoryPort::answering(&line);
        let them = DynamixelProtocolHandler::v1();
        let (theirs, byte) = them.read_with_error(&mut port, id, 0, 4).unwrap();
        prop_assert_eq!(ours.params, &theirs[..]);
        prop_assert_eq!(ours.error.0, byte.byte());
        let conditions = byte.v1_conditions().len();
        let Decoded::Packet(ours, _) = dxl1::decode(&line, params.len()) else { panic!() };
        prop_assert_eq!(ours.error.0.count_ones() as usize, conditions);
    }
}
