//! Clients of FEETECH servos in Python: the maker's SDK as two packages, and feetech-cli.

use crate::bench::{Bench, Client, Lost};
use crate::python::Python;
use crate::registers::{self, Listed};
use crate::scenario::{About, Record, Run, Scenario};
use gaitway_sim::Options;
use serde_json::json;

const STS: &[&str] = &["STS3215"];

/// The SDK as its maker's package of 2026.
pub static FTSERVO: Scenario = Scenario::new(
    "ftservo-python-sdk",
    "FEETECH STS",
    About::Everything(STS),
    Run::Python(|python, record| vendor(python, "ftservo-python-sdk", record)),
);

/// The same SDK as the package of 2022, which LeRobot uses.
pub static FEETECH_SERVO_SDK: Scenario = Scenario::new(
    "feetech-servo-sdk",
    "FEETECH STS",
    About::Everything(STS),
    Run::Python(|python, record| vendor(python, "feetech-servo-sdk", record)),
);

/// A command line for people who set up servos.
pub static FEETECH_CLI: Scenario =
    Scenario::new("feetech-cli", "FEETECH STS", About::Everything(STS), Run::Python(cli));

/// Joint and ID of the servos of `robots/feetech.toml`.
const THREE: [(&str, i64); 3] = [("one", 1), ("two", 2), ("last", 253)];

const ID: u8 = 5;
const MAX_ANGLE: u8 = 11;
const TORQUE: u8 = 40;
const ACCELERATION: u8 = 41;
const GOAL: u8 = 42;
const LOCK: u8 = 55;
const PRESENT: u8 = 56;
const EVERYONE: u8 = 254;

fn bench() -> Bench {
    Bench::open("feetech", Options { permit_eeprom: true, ..Options::default() })
}

pub fn start_vendor(python: &Python, port: &str, package: &str, family: &str) -> Client {
    let arguments = [port, "1000000", package, family];
    Client::start(python, "scservo_client.py", &arguments)
}

fn vendor(python: &Python, package: &str, record: &mut Record) -> Result<(), Lost> {
    let bench = bench();
    let mut sdk = start_vendor(python, bench.port(0), package, "sts");
    for (_, id) in THREE {
        // Major 9, minor 3, little-endian.
        assert_eq!(sdk.ask("ping", json!([id]))?, 777);
    }
    record.works("Ping");
    reads(&bench, &mut sdk, record)?;
    writes(&bench, &mut sdk, record)?;
    sync_writes(&bench, &mut sdk, record)?;
    change_id(&bench, &mut sdk, record)?;
    calibrate(&bench, &mut sdk, record)?;
    if package == "ftservo-python-sdk" {
        named_operations(&bench, &mut sdk, record)?;
    }
    whole_robot(python, package, "so101")?;
    whole_robot(python, package, "open-duck-mini-v2")
}

/// Every joint is told one thing and found at another.
fn whole_robot(python: &Python, package: &str, name: &str) -> Result<(), Lost> {
    let bench = Bench::open(name, Options::default());
    let mut sdk = start_vendor(python, bench.port(0), package, "sts");
    let robot = gaitway_profiles::robot(name).expect("a shipped robot");
    let ids: Vec<i64> = robot.joints.iter().map(|joint| i64::from(joint.id)).collect();
    assert!(ids.len() >= 6, "{name}");
    let positions: Vec<i64> = ids.iter().map(|id| 1500 + 11 * id).collect();
    for (joint, position) in robot.joints.iter().zip(&positions) {
        bench.set(&joint.name, "Present Position", *position);
    }
    let seen = sdk.ask("sync_read", json!([ids, PRESENT, 2]))?;
    assert_eq!(seen, json!(positions), "{name}");
    let goal = |id: i64| 2500 - 13 * id;
    let goals: Vec<_> =
        ids.iter().map(|&id| json!([id, [goal(id) & 255, goal(id) >> 8]])).collect();
    sdk.ask("sync_write", json!([GOAL, goals]))?;
    for joint in &robot.joints {
        bench.assert_comes_to(&joint.name, "Goal Position", goal(i64::from(joint.id)));
    }
    Ok(())
}

fn reads(bench: &Bench, sdk: &mut Client, record: &mut Record) -> Result<(), Lost> {
    for (joint, id) in THREE {
        bench.set(joint, "Acceleration", 50 + id % 100);
        bench.set(joint, "Max Position Limit", 0xA0B + id);
        bench.set(joint, "Goal Time", 0);
        bench.set(joint, "Goal Position", 0x0900 + id);
        assert_eq!(sdk.ask("read", json!([id, ACCELERATION, 1]))?, 50 + id % 100);
        assert_eq!(sdk.ask("read", json!([id, MAX_ANGLE, 2]))?, 0xA0B + id);
        // Four bytes are two words: the position, then the time.
        assert_eq!(sdk.ask("read", json!([id, GOAL, 4]))?, 0x0900 + id);
        bench.set(joint, "Max Position Limit", 4095);
    }
    // Overload, bit 5 of Status: the maker prints no more than the byte.
    bench.set("one", "Status", 0x20);
    assert_eq!(sdk.ask("read_with_error", json!([1, LOCK, 1]))?, json!([[1], 0x20]));
    bench.set("one", "Status", 0);
    record.works("Read");
    let positions = [("one", 7), ("two", 4095), ("last", 2048)];
    for (joint, position) in positions {
        bench.set(joint, "Present Position", position);
    }
    assert_eq!(sdk.ask("sync_read", json!([[1, 2, 253], PRESENT, 2]))?, json!([7, 4095, 2048]));
    assert_eq!(sdk.ask("sync_read", json!([[253, 1], PRESENT, 2]))?, json!([2048, 7]));
    record.works("Sync Read");
    Ok(())
}

fn writes(bench: &Bench, sdk: &mut Client, record: &mut Record) -> Result<(), Lost> {
    for (joint, id) in THREE {
        sdk.ask("write", json!([id, ACCELERATION, 1, 33 + id % 100]))?;
        sdk.ask("write", json!([id, GOAL, 2, 0x0201 + id]))?;
        bench.assert_holds("Acceleration", &[(joint, 33 + id % 100)]);
        bench.assert_holds("Goal Position", &[(joint, 0x0201 + id)]);
        // Position, then speed 46 by way of time 44.
        sdk.ask("write", json!([id, 44, 4, 1000 << 16 | 5]))?;
        bench.assert_holds("Goal Time", &[(joint, 5)]);
        bench.assert_holds("Goal Velocity", &[(joint, 1000)]);
        // Level 0: a write is done and not answered.
        bench.set(joint, "Response Status Level", 0);
        sdk.ask("write_unanswered", json!([id, GOAL, 2, 0x0404 + id]))?;
        assert_eq!(sdk.ask("read", json!([id, GOAL, 2]))?, 0x0404 + id);
        bench.assert_holds("Goal Position", &[(joint, 0x0404 + id)]);
        bench.set(joint, "Response Status Level", 1);
    }
    record.works("Write");
    for (joint, id) in THREE {
        let goal = 1600 + id;
        sdk.ask("reg_write", json!([id, GOAL, [goal & 255, goal >> 8]]))?;
        bench.assert_holds("Goal Position", &[(joint, 0x0404 + id)]);
        bench.assert_holds("Async Write Flag", &[(joint, 1)]);
    }
    record.works("Reg Write");
    sdk.ask("action", json!([2]))?;
    bench.assert_holds("Goal Position", &[("two", 1602), ("one", 0x0405)]);
    sdk.ask("action", json!([EVERYONE]))?;
    sdk.ask("ping", json!([1]))?;
    for (joint, id) in THREE {
        bench.assert_holds("Goal Position", &[(joint, 1600 + id)]);
        bench.assert_holds("Async Write Flag", &[(joint, 0)]);
    }
    record.works("Action");
    Ok(())
}

fn sync_writes(bench: &Bench, sdk: &mut Client, record: &mut Record) -> Result<(), Lost> {
    let entries = json!([GOAL, [[1, [0x10, 0x01]], [2, [0x20, 0x02]], [253, [0xFF, 0x0F]]]]);
    sdk.ask("sync_write", entries)?;
    sdk.ask("ping", json!([1]))?;
    bench.assert_holds("Goal Position", &[("one", 0x0110), ("two", 0x0220), ("last", 0x0FFF)]);
    record.works("Sync Write");
    Ok(())
}

/// Torque off, unlock, new ID, lock by the new ID.
fn change_id(bench: &Bench, sdk: &mut Client, record: &mut Record) -> Result<(), Lost> {
    sdk.ask("write", json!([2, TORQUE, 1, 0]))?;
    sdk.ask("write", json!([2, LOCK, 1, 0]))?;
    bench.assert_holds("Lock", &[("two", 0)]);
    // The status to this comes from either ID, so it is not waited for.
    sdk.ask("write_unanswered", json!([2, ID, 1, 77]))?;
    std::thread::sleep(std::time::Duration::from_millis(5));
    sdk.ask("write", json!([77, LOCK, 1, 1]))?;
    assert_eq!(sdk.ask("ping", json!([77]))?, 777);
    bench.assert_holds("ID", &[("one", 1), ("two", 77), ("last", 253)]);
    bench.assert_holds("Lock", &[("two", 1)]);
    record.works("Change of ID, with lock");
    Ok(())
}

/// 128 in the torque register: this is the middle.
fn calibrate(bench: &Bench, sdk: &mut Client, record: &mut Record) -> Result<(), Lost> {
    for (joint, id) in [("one", 1), ("last", 253)] {
        bench.set(joint, "Homing Offset", 0);
        bench.set(joint, "Present Position", 1234 + id);
        sdk.ask("write", json!([id, TORQUE, 1, 128]))?;
        bench.assert_holds("Present Position", &[(joint, 2048)]);
        // Present = encoder - offset.
        bench.assert_holds("Homing Offset", &[(joint, 1234 + id - 2048)]);
        assert_eq!(sdk.ask("read", json!([id, PRESENT, 2]))?, 2048);
    }
    record.works("Calibrate to the middle");
    Ok(())
}

/// What the newer package calls by name.
fn named_operations(bench: &Bench, sdk: &mut Client, record: &mut Record) -> Result<(), Lost> {
    let goals = |joint, position, speed, acceleration| {
        bench.assert_holds("Goal Position", &[(joint, position)]);
        bench.assert_holds("Goal Velocity", &[(joint, speed)]);
        bench.assert_holds("Acceleration", &[(joint, acceleration)]);
    };
    sdk.ask("WritePosEx", json!([1, 2100, 2400, 50]))?;
    goals("one", 2100, 2400, 50);
    sdk.ask("RegWritePosEx", json!([253, 1900, 1200, 25]))?;
    sdk.ask("RegAction", json!([]))?;
    sdk.ask("ping", json!([253]))?;
    goals("last", 1900, 1200, 25);
    sdk.ask("sync_write_positions", json!([[[1, 2000, 60, 1], [77, 2222, 3400, 254]]]))?;
    sdk.ask("ping", json!([77]))?;
    goals("one", 2000, 60, 1);
    goals("two", 2222, 3400, 254);
    bench.set("one", "Homing Offset", 0);
    bench.set("one", "Present Position", 3111);
    assert_eq!(sdk.ask("ReadPos", json!([1]))?, 3111);
    assert_eq!(sdk.ask("ReadSpeed", json!([1]))?, 0);
    assert_eq!(sdk.ask("ReadPosSpeed", json!([1]))?, json!([3111, 0]));
    assert_eq!(sdk.ask("ReadMoving", json!([1]))?, 0);
    sdk.ask("unLockEprom", json!([1]))?;
    bench.assert_holds("Lock", &[("one", 0)]);
    sdk.ask("WheelMode", json!([1]))?;
    bench.assert_holds("Operating Mode", &[("one", 1)]);
    sdk.ask("LockEprom", json!([1]))?;
    bench.assert_holds("Lock", &[("one", 1)]);
    sdk.ask("WriteSpec", json!([1, -1000, 20]))?;
    bench.assert_holds("Goal Velocity", &[("one", -1000)]);
    record.works("Wheel mode");
    Ok(())
}

fn cli(python: &Python, record: &mut Record) -> Result<(), Lost> {
    let bench = bench();
    let mut cli = Client::start(python, "feetech_cli_client.py", &[bench.port(0), "sts"]);
    assert_eq!(cli.ask("connect", json!([]))?, json!([1, 2]));
    assert_eq!(cli.ask("ping", json!([253]))?, true);
    assert_eq!(cli.ask("ping", json!([9]))?, false);
    record.works("Ping");
    cli_motion(&bench, &mut cli, record)?;
    whole_table(&bench, &mut cli, record)?;
    cli_groups(&bench, &mut cli, record)?;
    cli_setup(&bench, &mut cli, record)?;
    cli.ask("disconnect", json!([]))?;
    typed(&bench, &mut cli)
}

fn whole_table(bench: &Bench, cli: &mut Client, record: &mut Record) -> Result<(), Lost> {
    let listed = Listed::table(cli.ask("registers", json!([]))?);
    let servo = gaitway_profiles::servo("sts3215").expect("a shipped profile");
    for (joint, id) in [("one", 1), ("last", 253)] {
        let otherwise = registers::read_all(bench, joint, servo, &listed, |register| {
            let seen = cli.ask("read_register", json!([id, register.name]))?;
            Ok(seen.as_i64().expect("a number"))
        })?;
        assert_eq!(otherwise, [""; 0]);
        record.works("Read");
        let otherwise = registers::write_all(bench, joint, servo, &listed, |register, value| {
            let seen = cli.ask("write_register", json!([id, register.name, value]))?;
            assert_eq!(seen, value, "{} as read back", register.name);
            Ok(())
        })?;
        assert_eq!(otherwise, [""; 0]);
        record.works("Write");
    }
    Ok(())
}

fn cli_groups(bench: &Bench, cli: &mut Client, record: &mut Record) -> Result<(), Lost> {
    for (joint, position) in [("one", 17), ("two", 4000), ("last", 2049)] {
        bench.set(joint, "Homing Offset", 0);
        bench.set(joint, "Present Position", position);
    }
    let seen = cli.ask("sync_read", json!([[1, 2, 253], PRESENT, 2]))?;
    let there = json!({ "1": [0, [17, 0]], "2": [0, [0xA0, 0x0F]], "253": [0, [1, 8]] });
    assert_eq!(seen, there);
    record.works("Sync Read");
    cli.ask("sync_write_positions", json!([[1, 2, 253], [3000, 100, 2000], 1500, 40]))?;
    cli.ask("ping", json!([1]))?;
    bench.assert_holds("Goal Position", &[("one", 3000), ("two", 100), ("last", 2000)]);
    bench.assert_holds("Goal Velocity", &[("one", 1500), ("two", 1500), ("last", 1500)]);
    bench.assert_holds("Acceleration", &[("one", 40), ("two", 40), ("last", 40)]);
    record.works("Sync Write");
    cli.ask("reg_write", json!([2, GOAL, [0x34, 0x02]]))?;
    bench.assert_holds("Goal Position", &[("two", 100)]);
    record.works("Reg Write");
    cli.ask("action", json!([2]))?;
    bench.assert_holds("Goal Position", &[("two", 0x0234)]);
    record.works("Action");
    Ok(())
}

fn cli_setup(bench: &Bench, cli: &mut Client, record: &mut Record) -> Result<(), Lost> {
    assert_eq!(cli.ask("set_id", json!([2, 3]))?, 3);
    bench.assert_holds("ID", &[("one", 1), ("two", 3)]);
    bench.assert_holds("Lock", &[("two", 1)]);
    record.works("Change of ID, with lock");
    bench.set("one", "Homing Offset", 0);
    bench.set("one", "Present Position", 1500);
    assert_eq!(cli.ask("set_zero", json!([1]))?, 2048);
    bench.assert_holds("Homing Offset", &[("one", 1500 - 2048)]);
    bench.assert_holds("Present Position", &[("one", 2048)]);
    record.works("Calibrate to the middle");
    assert_eq!(cli.ask("set_operating_mode", json!([3, 1]))?, 1);
    cli.ask("set_goal_velocity", json!([3, -700]))?;
    bench.assert_holds("Goal Velocity", &[("two", -700)]);
    record.works("Wheel mode");
    bench.set("two", "Overload Torque", 11);
    cli.ask("factory_reset", json!([3]))?;
    bench.assert_holds("Overload Torque", &[("two", 80)]);
    record.works("Reset");
    Ok(())
}

/// Its self-test moves the servo and wants it where it was told to go.
fn cli_motion(bench: &Bench, cli: &mut Client, record: &mut Record) -> Result<(), Lost> {
    bench.set("last", "Present Position", 2000);
    let report = cli.ask("selftest", json!([253, 200, 2]))?;
    assert_eq!(report["passed"], true, "{report:#}");
    assert_eq!(report["moved_count"], 3, "{report:#}");
    bench.assert_holds("Torque Enable", &[("last", 0)]);
    record.works("Motion, checked by the client");
    Ok(())
}

/// The commands as a person types them.
fn typed(bench: &Bench, cli: &mut Client) -> Result<(), Lost> {
    let mut run = |words: &[&str]| -> Result<String, Lost> {
        let answer = cli.ask("command", json!(words))?;
        let said = answer[1].as_str().unwrap_or_default().to_owned();
        assert_eq!(answer[0], 0, "{words:?}: {said}");
        Ok(said)
    };
    bench.set("one", "Present Voltage", 74);
    assert!(run(&["scan"])?.contains("777"));
    assert!(run(&["info", "1"])?.contains("7.4 V"));
    run(&["write", "1", "p_coefficient", "21"])?;
    bench.assert_holds("P Coefficient", &[("one", 21)]);
    bench.set("one", "D Coefficient", 19);
    assert!(run(&["read", "1", "d_coefficient"])?.contains("19"));
    run(&["torque", "1", "on"])?;
    bench.assert_holds("Torque Enable", &[("one", 1)]);
    run(&["torque", "1", "off"])?;
    run(&["set-id", "1", "2", "--yes"])?;
    bench.assert_holds("ID", &[("one", 2)]);
    run(&["set-baud", "2", "500000", "--yes"])?;
    bench.assert_holds("Baud Rate", &[("one", 1)]);
    Ok(())
}

const SCS: &[&str] = &["SCS0009"];

pub static FTSERVO_SCS: Scenario = Scenario::new(
    "ftservo-python-sdk",
    "FEETECH SCS",
    About::Everything(SCS),
    Run::Python(|python, record| big_endian(python, "ftservo-python-sdk", record)),
);

pub static FEETECH_SERVO_SDK_SCS: Scenario = Scenario::new(
    "feetech-servo-sdk",
    "FEETECH SCS",
    About::Everything(SCS),
    Run::Python(|python, record| big_endian(python, "feetech-servo-sdk", record)),
);

/// SCS servos have the lock at 48, and the high byte of a word first.
const SCS_LOCK: u8 = 48;

fn big_endian(python: &Python, package: &str, record: &mut Record) -> Result<(), Lost> {
    let bench = Bench::open("scs", Options { permit_eeprom: true, ..Options::default() });
    let mut sdk = start_vendor(python, bench.port(0), package, "scs");
    for (joint, id) in THREE {
        // Major 5, minor 4.
        assert_eq!(sdk.ask("ping", json!([id]))?, 0x0504);
        record.works("Ping");
        bench.set(joint, "Max Position Limit", 0x0302);
        bench.set(joint, "P Coefficient", 44 + id % 100);
        assert_eq!(sdk.ask("read", json!([id, MAX_ANGLE, 2]))?, 0x0302);
        assert_eq!(sdk.ask("read", json!([id, 21, 1]))?, 44 + id % 100);
        bench.set(joint, "Max Position Limit", 1023);
        bench.set(joint, "Present Position", 0x0201);
        assert_eq!(sdk.ask("read", json!([id, PRESENT, 2]))?, 0x0201);
        record.works("Read");
        sdk.ask("write", json!([id, GOAL, 2, 0x0102]))?;
        bench.assert_holds("Goal Position", &[(joint, 0x0102)]);
        // Time 44, then speed 46.
        sdk.ask("write", json!([id, 44, 4, 0x0304 << 16 | 0x0105]))?;
        bench.assert_holds("Goal Time", &[(joint, 0x0105)]);
        bench.assert_holds("Goal Velocity", &[(joint, 0x0304)]);
        record.works("Write");
        sdk.ask("reg_write", json!([id, GOAL, [0x01, 0x80]]))?;
        bench.assert_holds("Goal Position", &[(joint, 0x0102)]);
        record.works("Reg Write");
        sdk.ask("action", json!([id]))?;
        bench.assert_holds("Goal Position", &[(joint, 0x0180)]);
        record.works("Action");
    }
    let entries = json!([GOAL, [[1, [0x01, 0x10]], [2, [0x02, 0x20]], [253, [0x03, 0xFF]]]]);
    sdk.ask("sync_write", entries)?;
    sdk.ask("ping", json!([1]))?;
    bench.assert_holds("Goal Position", &[("one", 0x0110), ("two", 0x0220), ("last", 0x03FF)]);
    record.works("Sync Write");
    sdk.ask("write", json!([2, SCS_LOCK, 1, 0]))?;
    sdk.ask("write_unanswered", json!([2, ID, 1, 77]))?;
    std::thread::sleep(std::time::Duration::from_millis(5));
    sdk.ask("write", json!([77, SCS_LOCK, 1, 1]))?;
    bench.assert_holds("ID", &[("one", 1), ("two", 77), ("last", 253)]);
    bench.assert_holds("Lock", &[("two", 1)]);
    record.works("Change of ID, with lock");
    if package == "ftservo-python-sdk" {
        big_endian_by_name(&bench, &mut sdk, record)?;
    }
    Ok(())
}

fn big_endian_by_name(bench: &Bench, sdk: &mut Client, record: &mut Record) -> Result<(), Lost> {
    sdk.ask("WritePos", json!([1, 700, 300, 900]))?;
    bench.assert_holds("Goal Position", &[("one", 700)]);
    bench.assert_holds("Goal Time", &[("one", 300)]);
    bench.assert_holds("Goal Velocity", &[("one", 900)]);
    sdk.ask("RegWritePos", json!([1, 600, 0, 800]))?;
    sdk.ask("RegAction", json!([]))?;
    sdk.ask("ping", json!([1]))?;
    bench.assert_holds("Goal Position", &[("one", 600)]);
    sdk.ask("sync_write_positions", json!([[[1, 500, 0, 700], [253, 400, 1, 0]]]))?;
    sdk.ask("ping", json!([1]))?;
    bench.assert_holds("Goal Position", &[("one", 500), ("last", 400)]);
    bench.set("last", "Present Position", 321);
    assert_eq!(sdk.ask("ReadPos", json!([253]))?, 321);
    assert_eq!(sdk.ask("ReadPosSpeed", json!([253]))?, json!([321, 0]));
    assert_eq!(sdk.ask("ReadMoving", json!([253]))?, 0);
    sdk.ask("unLockEprom", json!([253]))?;
    bench.assert_holds("Lock", &[("last", 0)]);
    // Both angle limits zero.
    sdk.ask("PWMMode", json!([253]))?;
    bench.assert_holds("Max Position Limit", &[("last", 0)]);
    sdk.ask("WritePWM", json!([253, -500]))?;
    // In this mode the time is a duty with its sign in bit 10.
    bench.assert_holds("Goal Time", &[("last", 1 << 10 | 500)]);
    record.works("Wheel mode");
    Ok(())
}

pub static FEETECH_CLI_SCS: Scenario =
    Scenario::new("feetech-cli", "FEETECH SCS", About::Everything(SCS), Run::Python(cli_scs));

fn cli_scs(python: &Python, record: &mut Record) -> Result<(), Lost> {
    let bench = Bench::open("scs", Options { permit_eeprom: true, ..Options::default() });
    let mut cli = Client::start(python, "feetech_cli_client.py", &[bench.port(0), "scs"]);
    assert_eq!(cli.ask("connect", json!([]))?, json!([1, 2]));
    record.works("Ping");
    for (joint, id) in [("one", 1), ("two", 2)] {
        bench.set(joint, "Present Position", 0x0201);
        assert_eq!(cli.ask("read_register", json!([id, "present_position"]))?, 0x0201);
        assert_eq!(cli.ask("read_register", json!([id, "model_number"]))?, 0x0504);
        record.works("Read");
        cli.ask("set_goal_position", json!([id, 0x0180]))?;
        bench.assert_holds("Goal Position", &[(joint, 0x0180)]);
        record.works("Write");
    }
    cli.ask("sync_write_positions", json!([[1, 2], [0x0111, 0x0222], 0x0301, 0]))?;
    bench.assert_comes_to("one", "Goal Position", 0x0111);
    bench.assert_comes_to("two", "Goal Position", 0x0222);
    bench.assert_comes_to("two", "Goal Velocity", 0x0301);
    record.works("Sync Write");
    Ok(())
}
