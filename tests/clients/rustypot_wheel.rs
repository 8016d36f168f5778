//! The rustypot wheel: one controller class for each family of servos, and the bus above them.

use crate::bench::{Bench, Client, Lost};
use crate::python::Python;
use crate::registers::{self, Listed};
use crate::scenario::{About, Record, Run, Scenario};
use crate::tap::{Tap, contains, hex};
use gaitway_profiles::Protocol;
use gaitway_sim::Options;
use serde_json::{Value, json};

pub const NAME: &str = "rustypot (wheel)";

pub static PROTOCOL_2: Scenario = Scenario::new(
    NAME,
    "DYNAMIXEL 2.0",
    About::Everything(&["XM430-W350", "XL330-M288", "XL430-W250", "XL320"]),
    Run::Python(protocol_2),
);

pub static PROTOCOL_1: Scenario = Scenario::new(
    NAME,
    "DYNAMIXEL 1.0",
    About::Everything(&["AX-12A", "MX-28", "MX-64", "MX-106"]),
    Run::Python(protocol_1),
);

pub static STS: Scenario =
    Scenario::new(NAME, "FEETECH STS", About::Everything(&["STS3215"]), Run::Python(sts));

pub static SCS: Scenario =
    Scenario::new(NAME, "FEETECH SCS", About::Everything(&["SCS0009"]), Run::Python(scs));

/// A servo and the words for it: joint, ID, profile.
type Servo = (&'static str, i64, &'static str);

fn bench(robot: &str) -> Bench {
    Bench::open(robot, Options { permit_eeprom: true, ..Options::default() })
}

pub fn client(python: &Python, port: &str, family: &str) -> Client {
    client_at(python, port, "1000000", family)
}

pub fn client_at(python: &Python, port: &str, bps: &str, family: &str) -> Client {
    Client::start(python, "rustypot_client.py", &[port, bps, family, "0.4"])
}

/// Reads and writes every register the class lists; `unknown` are those the servo does not have,
/// `fixed` those it does not let anyone write.
fn whole_table(
    bench: &Bench,
    client: &mut Client,
    (joint, id, profile): Servo,
    unknown: &[&str],
    fixed: &[&str],
    record: &mut Record,
) -> Result<(), Lost> {
    let listed = Listed::table(client.ask("registers", json!([]))?);
    let servo = gaitway_profiles::servo(profile).expect("a shipped profile");
    let otherwise = registers::read_all(bench, joint, servo, &listed, |register| {
        let seen = client.ask("read_register", json!([id, register.name]))?;
        Ok(seen.as_i64().expect("a number"))
    })?;
    assert_eq!(otherwise, unknown, "{profile}: registers it does not have");
    record.works("Read");
    let otherwise = registers::write_all(bench, joint, servo, &listed, |register, value| {
        client.ask("write_register", json!([id, register.name, value]))?;
        Ok(())
    })?;
    assert_eq!(otherwise, fixed, "{profile}: registers it does not let anyone write");
    record.works("Write");
    Ok(())
}

fn protocol_2(python: &Python, record: &mut Record) -> Result<(), Lost> {
    let no_current = ["current_limit at 38, 2", "goal_current at 102, 2"];
    // Indirect Data 1 of the XL330 is at 208: a defect with a test of its own.
    let of_another =
        ["acceleration_limit at 40, 4", "indirect_data_5 at 228, 1", "indirect_data_6 at 229, 1"];
    let read_only = ["firmware_version", "registered_instruction"];
    let kinds: [(&str, Servo, &[&str], &[&str]); 3] = [
        ("Xl430", ("xl430", 252, "xl430-w250"), &no_current, &[]),
        ("Xl430", ("xm", 1, "xm430-w350"), &[], &[]),
        ("Xl330", ("xl330", 3, "xl330-m288"), &of_another, &read_only),
    ];
    for (family, servo, unknown, fixed) in kinds {
        let bench = bench("dynamixel2");
        let mut client = client(python, bench.port(0), family);
        whole_table(&bench, &mut client, servo, unknown, fixed, record)?;
        let three: [Servo; 3] =
            [("xm", 1, "xm430-w350"), ("xl330", 3, "xl330-m288"), ("xl430", 252, "xl430-w250")];
        pings(&bench, &mut client, &three, record)?;
        broadcast_ping(&mut client, json!({ "1": 1020, "3": 1200, "252": 1060 }), record)?;
        sync_writes(&bench, &mut client, &three, 4, record)?;
        sync_reads(&bench, &mut client, &three, 4, record)?;
        client.ask("set_fast_sync_read", json!([true]))?;
        sync_reads(&bench, &mut client, &three, 4, &mut Record::default())?;
        client.ask("set_fast_sync_read", json!([false]))?;
        record.works("Fast Sync Read");
        restarts(&bench, &mut client, servo, record)?;
    }
    xl320(python, record)?;
    stuffing(python)?;
    angles(python, record)?;
    above(python, record)
}

fn xl320(python: &Python, record: &mut Record) -> Result<(), Lost> {
    let bench = bench("xl320");
    let mut wheel = client(python, bench.port(0), "Xl320");
    whole_table(&bench, &mut wheel, ("two", 2, "xl320"), &[], &[], record)?;
    let three: [Servo; 3] = [("one", 1, "xl320"), ("two", 2, "xl320"), ("last", 252, "xl320")];
    pings(&bench, &mut wheel, &three, record)?;
    broadcast_ping(&mut wheel, json!({ "1": 350, "2": 350, "252": 350 }), record)?;
    sync_writes(&bench, &mut wheel, &three, 2, record)?;
    sync_reads(&bench, &mut wheel, &three, 2, record)
}

/// Goal Current(102) = -1 and Goal Velocity(104) = 253 are the bytes of a header.
fn stuffing(python: &Python) -> Result<(), Lost> {
    let bench = bench("dynamixel2");
    bench.set("xm", "Velocity Limit", 300);
    let mut wheel = client(python, bench.port(0), "Xl430");
    let header = json!([0xFF, 0xFF, 0xFD, 0, 0, 0]);
    wheel.ask("write_raw_data", json!([1, 102, header]))?;
    bench.assert_holds("Goal Current", &[("xm", -1)]);
    bench.assert_holds("Goal Velocity", &[("xm", 253)]);
    assert_eq!(wheel.ask("read_raw_data", json!([1, 102, 6]))?, header);
    let tap = Tap::silent();
    let mut wheel = client(python, tap.port(), "Xl430");
    wheel.ask("sync_write_raw_data", json!([[1], 102, [header]]))?;
    assert!(contains(&tap.heard(22), &hex("01 FF FF FD FD 00 00 00")), "{:02X?}", tap.heard(22));
    Ok(())
}

/// Radians, zero in the middle; the class for XL430 and XM430 has counts only.
fn angles(python: &Python, record: &mut Record) -> Result<(), Lost> {
    let bench = bench("dynamixel2");
    let mut wheel = client(python, bench.port(0), "Xl330");
    wheel.ask("write_goal_position", json!([3, 0.5]))?;
    // 0.5 rad x 4096 / 2 pi = 325.95 counts. It cuts off where others round.
    bench.assert_holds("Goal Position", &[("xl330", 2048 + 325)]);
    wheel.ask("sync_write_goal_position", json!([[3, 252], [-1.0, 1.25]]))?;
    bench.assert_comes_to("xl330", "Goal Position", 2048 - 652);
    bench.assert_comes_to("xl430", "Goal Position", 2048 + 814);
    bench.set("xl430", "Present Position", 1024);
    let seen = wheel.ask("sync_read_present_position", json!([[252]]))?[0].as_f64();
    let quarter = seen.expect("an angle") + std::f64::consts::FRAC_PI_2;
    assert!(quarter.abs() < 1e-6, "{quarter} rad beside a quarter turn");
    record.works("Angles and speeds in SI units");
    Ok(())
}

fn pings(
    bench: &Bench,
    client: &mut Client,
    servos: &[Servo],
    record: &mut Record,
) -> Result<(), Lost> {
    let mut models = json!({});
    for &(joint, id, _) in servos {
        answered(id, &client.ask("ping", json!([id]))?)?;
        models[id.to_string()] = json!(bench.register(joint, "Model Number"));
    }
    let ids: Vec<i64> = servos.iter().map(|&(_, id, _)| id).chain([77]).collect();
    // It waits about 5 ms for each, whatever it was told, and a machine may stall longer.
    let found = (0..10).any(|_| client.ask("scan", json!([ids])).is_ok_and(|seen| seen == models));
    assert!(found, "scan never found {models}");
    record.works("Ping");
    Ok(())
}

/// To this client a ping that is answered late is none.
fn answered(id: i64, seen: &Value) -> Result<(), Lost> {
    if seen == true { Ok(()) } else { Err(Lost(format!("ping {id} is not answered"))) }
}

fn broadcast_ping(client: &mut Client, all: Value, record: &mut Record) -> Result<(), Lost> {
    assert_eq!(client.ask("broadcast_scan", json!([]))?, all);
    record.works("Ping, broadcast");
    Ok(())
}

/// A position for each, the lowest first; its bytes as the family orders them.
fn positions(servos: &[Servo], from: i64) -> (Vec<i64>, Vec<i64>) {
    let ids: Vec<i64> = servos.iter().map(|&(_, id, _)| id).collect();
    let positions = ids.iter().map(|&id| from + id).collect();
    (ids, positions)
}

fn sync_writes(
    bench: &Bench,
    client: &mut Client,
    servos: &[Servo],
    size: usize,
    record: &mut Record,
) -> Result<(), Lost> {
    let there = |from: i64| {
        for &(joint, id, _) in servos {
            bench.assert_holds("Goal Position", &[(joint, from + id)]);
        }
    };
    let (ids, goals) = positions(servos, 0x0181);
    client.ask("sync_write_register", json!([ids, "goal_position", goals]))?;
    client.ask("ping", json!([ids[0]]))?;
    there(0x0181);
    let servo = gaitway_profiles::servo(servos[0].2).expect("a shipped profile");
    let address = servo.register_named("Goal Position").expect("a register").address;
    let bytes = |goal: i64| {
        let little = goal.to_le_bytes()[..size].to_vec();
        match servo.protocol {
            Protocol::FeetechScs => little.into_iter().rev().collect(),
            _ => little,
        }
    };
    let raw: Vec<Vec<u8>> = positions(servos, 0x0201).1.into_iter().map(bytes).collect();
    client.ask("sync_write_raw_data", json!([ids, address, raw]))?;
    client.ask("ping", json!([ids[0]]))?;
    there(0x0201);
    record.works("Sync Write");
    Ok(())
}

fn sync_reads(
    bench: &Bench,
    client: &mut Client,
    servos: &[Servo],
    size: usize,
    record: &mut Record,
) -> Result<(), Lost> {
    let (ids, there) = positions(servos, 0x0102);
    for (&(joint, ..), &position) in servos.iter().zip(&there) {
        bench.set(joint, "Present Position", position);
    }
    let seen = client.ask("sync_read_register", json!([ids, "present_position"]))?;
    assert_eq!(seen, json!(there));
    let servo = gaitway_profiles::servo(servos[0].2).expect("a shipped profile");
    let address = servo.register_named("Present Position").expect("a register").address;
    let raw: Vec<Vec<u8>> = there.iter().map(|p| p.to_le_bytes()[..size].to_vec()).collect();
    let seen = client.ask("sync_read_raw_data", json!([ids, address, size]))?;
    assert_eq!(seen, json!(raw));
    record.works("Sync Read");
    Ok(())
}

/// Protocol 2.0.
fn restarts(
    bench: &Bench,
    client: &mut Client,
    (joint, id, _): Servo,
    record: &mut Record,
) -> Result<(), Lost> {
    bench.set(joint, "LED", 1);
    assert_eq!(client.ask("reboot", json!([id]))?, true);
    bench.assert_holds("LED", &[(joint, 0)]);
    record.works("Reboot");
    until_it_answers(client, id);
    bench.set(joint, "Shutdown", 5);
    // Keeps ID and speed unless told otherwise.
    client.ask("factory_reset", json!([id]))?;
    // e-Manual: overload, electrical shock and overheating; on the XL330 voltage too.
    bench.assert_holds("Shutdown", &[(joint, if joint == "xl330" { 53 } else { 52 })]);
    bench.assert_holds("Baud Rate", &[(joint, 3)]);
    bench.assert_holds("ID", &[(joint, id)]);
    record.works("Factory Reset");
    Ok(())
}

/// A servo that restarts is deaf for a while, which is no time-out of the client's.
fn until_it_answers(client: &mut Client, id: i64) {
    let answered = (0..20).any(|_| client.ask("ping", json!([id])).is_ok_and(|seen| seen == true));
    assert!(answered, "ID {id} never came back");
}

/// The class above the controllers, which LeRobot uses.
fn above(python: &Python, record: &mut Record) -> Result<(), Lost> {
    let bench = bench("dynamixel2");
    let mut client = client(python, bench.port(0), "Xl430");
    client.ask("open_bus", json!([[1, 3, 252]]))?;
    assert_eq!(client.ask("bus_set_torque", json!([[1, 3, 252], true]))?, json!({}));
    bench.assert_holds("Torque Enable", &[("xm", 1), ("xl330", 1), ("xl430", 1)]);
    client.ask("bus_sync_write_register", json!([[1, 3], "goal_position", [2000, 2100]]))?;
    client.ask("bus_read_register", json!([1, "id"]))?;
    bench.assert_holds("Goal Position", &[("xm", 2000), ("xl330", 2100), ("xl430", 2048)]);
    client.ask("bus_change_id", json!([3, 4]))?;
    bench.assert_holds("ID", &[("xl330", 4)]);
    bench.assert_holds("Torque Enable", &[("xl330", 0)]);
    let found = client.ask("bus_broadcast_scan", json!([]))?;
    assert_eq!(found, json!({ "1": 1020, "4": 1200, "252": 1060 }));
    client.ask("bus_change_baudrate", json!([4, 57600]))?;
    bench.assert_holds("Baud Rate", &[("xl330", 1)]);
    record.works("Change of ID and speed");
    Ok(())
}

fn protocol_1(python: &Python, record: &mut Record) -> Result<(), Lost> {
    for (family, servo) in [
        ("Ax", ("ax", 1, "ax-12a")),
        ("Mx", ("mx28", 2, "mx-28")),
        ("Mx", ("mx64", 3, "mx-64")),
        ("Mx", ("mx106", 253, "mx-106")),
    ] {
        let bench = bench("dynamixel1");
        let mut client = client(python, bench.port(0), family);
        whole_table(&bench, &mut client, servo, &[], &[], record)?;
        let four: [Servo; 4] = [
            ("ax", 1, "ax-12a"),
            ("mx28", 2, "mx-28"),
            ("mx64", 3, "mx-64"),
            ("mx106", 253, "mx-106"),
        ];
        pings(&bench, &mut client, &four, record)?;
        sync_writes(&bench, &mut client, &four, 2, record)?;
    }
    Ok(())
}

fn sts(python: &Python, record: &mut Record) -> Result<(), Lost> {
    let bench = bench("feetech");
    let mut client = client(python, bench.port(0), "Sts3215");
    // The maker's factory block, which the profile calls read-only.
    let factory = ["moving_velocity_threshold", "dts", "velocity_unit_factor", "hts"];
    whole_table(&bench, &mut client, ("two", 2, "sts3215"), &[], &factory, record)?;
    let three: [Servo; 3] =
        [("one", 1, "sts3215"), ("two", 2, "sts3215"), ("last", 253, "sts3215")];
    pings(&bench, &mut client, &three, record)?;
    broadcast_ping(&mut client, json!({ "1": 777, "2": 777, "253": 777 }), record)?;
    sync_writes(&bench, &mut client, &three, 2, record)?;
    sync_reads(&bench, &mut client, &three, 2, record)?;
    client.ask("open_bus", json!([[1, 2, 253]]))?;
    assert_eq!(client.ask("bus_set_torque", json!([[1, 2], true]))?, json!({}));
    bench.assert_holds("Torque Enable", &[("one", 1), ("two", 1), ("last", 0)]);
    client.ask("bus_change_id", json!([2, 9]))?;
    bench.assert_holds("ID", &[("two", 9)]);
    bench.assert_holds("Torque Enable", &[("two", 0)]);
    record.works("Change of ID, with lock");
    Ok(())
}

fn scs(python: &Python, record: &mut Record) -> Result<(), Lost> {
    let bench = bench("scs");
    let mut client = client(python, bench.port(0), "Scs0009");
    let factory = [
        "pwm_maximum_step",
        "moving_velocity_threshold",
        "dts",
        "minimum_velocity_limit",
        "maximum_velocity_limit",
    ];
    whole_table(&bench, &mut client, ("two", 2, "scs0009"), &[], &factory, record)?;
    let three: [Servo; 3] =
        [("one", 1, "scs0009"), ("two", 2, "scs0009"), ("last", 253, "scs0009")];
    pings(&bench, &mut client, &three, record)?;
    sync_writes(&bench, &mut client, &three, 2, record)
}
