//! The crates `dynamixel2` and `rustypot`, in this process, on real pseudo-terminals.

use crate::bench::{Bench, Lost};
use crate::dynamixel_sdk::THREE;
use crate::scenario::{About, Record, Run, Scenario};
use dynamixel2::instructions::{BulkReadData, BulkWriteData, FactoryResetKind, SyncWriteData};
use dynamixel2::{ReadError, TransferError};
use gaitway_sim::Options;
use rustypot::DynamixelProtocolHandler;
use serialport::SerialPort;
use std::time::Duration;

pub const DYNAMIXEL2: &str = "dynamixel2 (crate)";
pub const RUSTYPOT: &str = "rustypot (crate)";

pub static DYNAMIXEL2_PROTOCOL_2: Scenario = Scenario::new(
    DYNAMIXEL2,
    "DYNAMIXEL 2.0",
    About::Everything(&["XM430-W350", "XL330-M288", "XL430-W250"]),
    Run::Here(dynamixel2),
);

pub static RUSTYPOT_PROTOCOL_2: Scenario = Scenario::new(
    RUSTYPOT,
    "DYNAMIXEL 2.0",
    About::Everything(&["XM430-W350", "XL330-M288", "XL430-W250"]),
    Run::Here(|record| rustypot(record, &X_SERIES)),
);

pub static RUSTYPOT_PROTOCOL_1: Scenario = Scenario::new(
    RUSTYPOT,
    "DYNAMIXEL 1.0",
    About::Everything(&["AX-12A", "MX-28", "MX-64", "MX-106"]),
    Run::Here(|record| rustypot(record, &AX_AND_MX)),
);

pub static RUSTYPOT_STS: Scenario = Scenario::new(
    RUSTYPOT,
    "FEETECH STS",
    About::Everything(&["STS3215"]),
    Run::Here(|record| rustypot(record, &STS)),
);

/// Allows a servo 34 ms and the time on the wire.
pub type Bus = dynamixel2::Bus<Vec<u8>, Vec<u8>>;

pub fn open() -> (Bench, Bus) {
    let bench = Bench::open("dynamixel2", Options { permit_eeprom: true, ..Options::default() });
    let buffers = || vec![0; 1024];
    let bus = Bus::open_with_buffers(bench.port(0), 1_000_000, buffers(), buffers());
    (bench, bus.expect("a port"))
}

impl From<TransferError> for Lost {
    #[track_caller]
    fn from(error: TransferError) -> Lost {
        match error {
            TransferError::ReadError(ReadError::Io(cause))
                if cause.kind() == std::io::ErrorKind::TimedOut =>
            {
                Lost(cause.to_string())
            }
            other => panic!("{other:?}"),
        }
    }
}

fn id(number: i64) -> u8 {
    u8::try_from(number).expect("an ID")
}

fn dynamixel2(record: &mut Record) -> Result<(), Lost> {
    let (bench, mut bus) = open();
    for (joint, number) in THREE {
        let ping = bus.ping(id(number))?.data;
        assert_eq!(i64::from(ping.model), bench.register(joint, "Model Number"));
        assert_eq!(i64::from(ping.firmware), bench.register(joint, "Firmware Version"));
    }
    record.works("Ping");
    let found = (0..5).any(|_| scanned(&mut bus).starts_with(&[1, 3]));
    assert!(found, "scan never found IDs 1 and 3");
    record.works("Ping, broadcast");
    for (joint, number) in THREE {
        let motor = id(number);
        bench.set(joint, "Return Delay Time", 23);
        bench.set(joint, "Position P Gain", 0x2345);
        bench.set(joint, "Homing Offset", -number - 7);
        assert_eq!(bus.read_u8(motor, 9)?.data, 23);
        assert_eq!(bus.read_u16(motor, 84)?.data, 0x2345);
        assert_eq!(i64::from(bus.read_u32(motor, 20)?.data as i32), -number - 7);
        bench.set(joint, "Homing Offset", 0);
        bench.set(joint, "Hardware Error Status", 0x20);
        assert!(bus.read_u8(motor, 9)?.alert, "{joint}");
        bench.set(joint, "Hardware Error Status", 0);
        record.works("Read");
        bus.write_u8(motor, 65, 1)?;
        bus.write_u16(motor, 84, 0x0432)?;
        bus.write_u32(motor, 112, 0x0765)?;
        bench.assert_holds("LED", &[(joint, 1)]);
        bench.assert_holds("Position P Gain", &[(joint, 0x0432)]);
        bench.assert_holds("Profile Velocity", &[(joint, 0x0765)]);
        record.works("Write");
        bus.reg_write_u32(motor, 116, 0x0401)?;
        assert_ne!(bench.register(joint, "Goal Position"), 0x0401);
        record.works("Reg Write");
        bus.action(motor)?;
        bench.assert_holds("Goal Position", &[(joint, 0x0401)]);
        record.works("Action");
        bench.set(joint, "Operating Mode", 4);
        bench.set(joint, "Present Position", 4096 * 5 + 50 + number);
        bus.clear_revolution_counter(motor)?;
        bench.assert_holds("Present Position", &[(joint, 50 + number)]);
        record.works("Clear, multi-turn");
    }
    to_many(&bench, &mut bus, record)?;
    for (joint, number) in THREE {
        bench.set(joint, "LED", 1);
        bus.reboot(id(number))?;
        bench.assert_holds("LED", &[(joint, 0)]);
    }
    record.works("Reboot");
    let back = (0..200).any(|_| bus.ping(1).is_ok());
    assert!(back, "ID 1 never came back");
    bench.set("xm", "Shutdown", 1);
    bus.factory_reset(1, FactoryResetKind::KeepIdAndBaudRate)?;
    bench.assert_holds("Shutdown", &[("xm", 52)]);
    bench.assert_holds("Baud Rate", &[("xm", 3)]);
    record.works("Factory Reset");
    Ok(())
}

/// The IDs that `scan` finds.
pub fn scanned(bus: &mut Bus) -> Vec<u8> {
    let found = bus.scan().expect("sent");
    found.into_iter().flatten().map(|response| response.motor_id).collect()
}

fn to_many(bench: &Bench, bus: &mut Bus, record: &mut Record) -> Result<(), Lost> {
    let goals = [(1, 0x0151), (3, 0x0252), (252, 0x0353)];
    let writes = goals.map(|(motor_id, data)| SyncWriteData { motor_id, data });
    bus.sync_write_u32(116, writes).expect("sent");
    for ((joint, _), (_, goal)) in THREE.iter().zip(goals) {
        bench.assert_comes_to(joint, "Goal Position", goal.into());
    }
    record.works("Sync Write");
    let part =
        |motor_id, address, bytes: &[u8]| BulkWriteData { motor_id, address, data: bytes.to_vec() };
    let writes = vec![part(1, 116, &[7, 1, 0, 0]), part(3, 65, &[0]), part(252, 84, &[0x09, 0x02])];
    bus.bulk_write(&writes).expect("sent");
    bench.assert_comes_to("xm", "Goal Position", 0x0107);
    bench.assert_comes_to("xl330", "LED", 0);
    bench.assert_comes_to("xl430", "Position P Gain", 0x0209);
    record.works("Bulk Write");
    for (k, (joint, _)) in (0_i64..).zip(THREE) {
        bench.set(joint, "Present Position", 1000 - 700 * k);
    }
    let seen = bus.sync_read_u32(&[1, 3, 252], 132)?;
    let seen: Vec<i32> = seen.iter().map(|response| response.data as i32).collect();
    assert_eq!(seen, [1000, 300, -400]);
    record.works("Sync Read");
    // One servo only: of more it makes a wrong request, which a test of its own shows.
    for (motor_id, address, count, there) in
        [(1, 132, 4, vec![0xE8, 0x03, 0, 0]), (252, 84, 2, vec![0x09, 0x02])]
    {
        let seen = bus.bulk_read(&[BulkReadData { motor_id, address, count }])?;
        assert_eq!(seen[0].data, there);
    }
    record.works("Bulk Read");
    Ok(())
}

/// What differs from one family of servos to the next.
struct Family {
    robot: &'static str,
    protocol: fn() -> DynamixelProtocolHandler,
    servos: &'static [(&'static str, u8)],
    goal: u8,
    present: u8,
    size: usize,
    sync_read: bool,
    fast: bool,
}

const X_SERIES: Family = Family {
    robot: "dynamixel2",
    protocol: DynamixelProtocolHandler::v2,
    servos: &[("xm", 1), ("xl330", 3), ("xl430", 252)],
    goal: 116,
    present: 132,
    size: 4,
    sync_read: true,
    fast: true,
};

const AX_AND_MX: Family = Family {
    robot: "dynamixel1",
    protocol: DynamixelProtocolHandler::v1,
    servos: &[("ax", 1), ("mx28", 2), ("mx64", 3), ("mx106", 253)],
    goal: 30,
    present: 36,
    size: 2,
    sync_read: false,
    fast: false,
};

const STS: Family = Family {
    robot: "feetech",
    protocol: DynamixelProtocolHandler::v1,
    servos: &[("one", 1), ("two", 2), ("last", 253)],
    goal: 42,
    present: 56,
    size: 2,
    sync_read: true,
    fast: false,
};

/// A time-out of the crate's, or the end of the test.
fn lost(error: Box<dyn std::error::Error>) -> Lost {
    let said = error.to_string();
    assert!(said.to_lowercase().contains("time"), "{said}");
    Lost(said)
}

fn rustypot(record: &mut Record, family: &Family) -> Result<(), Lost> {
    let options = Options { permit_eeprom: true, ..Options::default() };
    let bench = Bench::open(family.robot, options);
    let port = serialport::new(bench.port(0), 1_000_000).timeout(Duration::from_millis(400));
    let mut port: Box<dyn SerialPort> = port.open().expect("a port");
    let port = port.as_mut();
    let protocol = (family.protocol)();
    let ids: Vec<u8> = family.servos.iter().map(|&(_, id)| id).collect();
    let bytes = |value: i64| value.to_le_bytes()[..family.size].to_vec();
    for &(joint, id) in family.servos {
        assert!(protocol.ping(port, id).map_err(lost)?, "{joint}");
        bench.set(joint, "Present Position", 0x0300 + i64::from(id));
        let seen = protocol.read(port, id, family.present, family.size as u8).map_err(lost)?;
        assert_eq!(seen, bytes(0x0300 + i64::from(id)), "{joint}");
        protocol.write(port, id, family.goal, &bytes(0x0200 + i64::from(id))).map_err(lost)?;
        bench.assert_holds("Goal Position", &[(joint, 0x0200 + i64::from(id))]);
    }
    record.works("Ping");
    record.works("Read");
    record.works("Write");
    let goals: Vec<Vec<u8>> = ids.iter().map(|&id| bytes(0x0102 + i64::from(id))).collect();
    protocol.sync_write(port, &ids, family.goal, &goals).map_err(lost)?;
    for &(joint, id) in family.servos {
        bench.assert_comes_to(joint, "Goal Position", 0x0102 + i64::from(id));
    }
    record.works("Sync Write");
    let there: Vec<Vec<u8>> = ids.iter().map(|&id| bytes(0x0300 + i64::from(id))).collect();
    let size = family.size as u8;
    if family.sync_read {
        let seen = protocol.sync_read(port, &ids, family.present, size).map_err(lost)?;
        assert_eq!(seen, there);
        record.works("Sync Read");
        let found = (0..5).any(|_| protocol.broadcast_ping(port).is_ok_and(|found| found == ids));
        assert!(found, "everyone's ping never found {ids:?}");
        record.works("Ping, broadcast");
    }
    if family.fast {
        let seen = protocol.fast_sync_read(port, &ids, family.present, size).map_err(lost)?;
        assert_eq!(seen, there);
        record.works("Fast Sync Read");
        bench.set("xm", "LED", 1);
        assert!(protocol.reboot(port, 1).map_err(lost)?);
        bench.assert_holds("LED", &[("xm", 0)]);
        record.works("Reboot");
        bench.set("xl430", "Shutdown", 1);
        protocol.factory_reset(port, 252, false, true).map_err(lost)?;
        bench.assert_holds("Shutdown", &[("xl430", 52)]);
        bench.assert_holds("ID", &[("xl430", 252)]);
        record.works("Factory Reset");
    }
    Ok(())
}
