//! ROBOTIS DynamixelSDK for Python.

use crate::bench::{Bench, Client, Lost};
use crate::python::Python;
use crate::scenario::{About, Record, Run, Scenario};
use gaitway_sim::Options;
use serde_json::{Value, json};

pub const NAME: &str = "dynamixel-sdk";
/// Everything it offers for Protocol 1.0.
pub static PROTOCOL_1: Scenario =
    Scenario::new(NAME, "DYNAMIXEL 1.0", About::Everything(OLD), Run::Python(protocol_1));

const OLD: &[&str] = &["AX-12A", "MX-28", "MX-64", "MX-106"];
const MODELS: &[&str] = &["XM430-W350", "XL330-M288", "XL430-W250"];

/// Everything it offers for Protocol 2.0.
pub static PROTOCOL_2: Scenario =
    Scenario::new(NAME, "DYNAMIXEL 2.0", About::Everything(MODELS), Run::Python(protocol_2));

/// Joint and ID of the servos of `robots/dynamixel2.toml` on its first line.
pub const THREE: [(&str, i64); 3] = [("xm", 1), ("xl330", 3), ("xl430", 252)];

// Registers whose address is the same in all X-series servos (e-Manual, control tables).
const RETURN_DELAY: u16 = 9;
const HOMING_OFFSET: u16 = 20;
const LED: u16 = 65;
const P_GAIN: u16 = 84;
const PROFILE_VELOCITY: u16 = 112;
const GOAL: u16 = 116;
const PRESENT: u16 = 132;
const VOLTAGE: u16 = 144;
/// "All devices".
const EVERYONE: u8 = 254;

pub fn client(python: &Python, bench: &Bench, line: usize, bps: u32, protocol: u8) -> Client {
    let arguments = [bench.port(line), &bps.to_string(), &protocol.to_string()];
    Client::start(python, "dynamixel_sdk_client.py", &arguments)
}

fn protocol_2(python: &Python, record: &mut Record) -> Result<(), Lost> {
    let bench = Bench::open("dynamixel2", Options { permit_eeprom: true, ..Options::default() });
    let mut sdk = client(python, &bench, 0, 1_000_000, 2);
    pings(&bench, &mut sdk, record)?;
    reads(&bench, &mut sdk, record)?;
    writes(&bench, &mut sdk, record)?;
    reads_of_many(&bench, &mut sdk, record)?;
    writes_to_many(&bench, &mut sdk, record)?;
    clear(&bench, &mut sdk, record)?;
    restarts(python, &bench, &mut sdk, record)?;
    fast_lines(python, &bench)?;
    twenty(python)
}

fn pings(bench: &Bench, sdk: &mut Client, record: &mut Record) -> Result<(), Lost> {
    let mut all = json!({});
    for (joint, id) in THREE {
        let model = bench.register(joint, "Model Number");
        assert_eq!(sdk.ask("ping", json!([id]))?, model, "{joint}");
        all[id.to_string()] = json!([model, bench.register(joint, "Firmware Version")]);
    }
    record.works("Ping");
    assert_eq!(all["252"], json!([1060, 45]), "XL430-W250, by the manual and the robot file");
    // The highest ID has its turn 15 ms before the SDK stops listening, whatever it was told; a
    // machine may stall longer.
    let found = (0..5).any(|_| sdk.ask("broadcast_ping", json!([])).is_ok_and(|seen| seen == all));
    assert!(found, "everyone's ping never found {all}");
    record.works("Ping, broadcast");
    Ok(())
}

fn reads(bench: &Bench, sdk: &mut Client, record: &mut Record) -> Result<(), Lost> {
    for (joint, id) in THREE {
        bench.set(joint, "Return Delay Time", 17);
        bench.set(joint, "Position P Gain", 0x1234 + id);
        bench.set(joint, "Homing Offset", -300 - id);
        assert_eq!(sdk.ask("read", json!([id, RETURN_DELAY, 1]))?, 17);
        assert_eq!(sdk.ask("read", json!([id, P_GAIN, 2]))?, 0x1234 + id);
        // The SDK gives numbers without sign; its examples tell users to take the complement.
        assert_eq!(sdk.ask("read", json!([id, HOMING_OFFSET, 4]))?, (1_i64 << 32) - 300 - id);
        bench.set(joint, "Homing Offset", 0);
    }
    // Overload, bit 5 of Hardware Error Status: every status has the alert bit from then on.
    bench.set("xm", "Hardware Error Status", 0x20);
    assert_eq!(sdk.ask("read_with_error", json!([1, RETURN_DELAY, 1]))?, json!([[17], 0x80]));
    bench.set("xm", "Hardware Error Status", 0);
    record.works("Read");
    Ok(())
}

fn writes(bench: &Bench, sdk: &mut Client, record: &mut Record) -> Result<(), Lost> {
    for (joint, id) in THREE {
        sdk.ask("write", json!([id, LED, 1, 1]))?;
        sdk.ask("write", json!([id, P_GAIN, 2, 0x0321 + id]))?;
        sdk.ask("write", json!([id, PROFILE_VELOCITY, 4, 0x0102 + id]))?;
        bench.assert_holds("LED", &[(joint, 1)]);
        bench.assert_holds("Position P Gain", &[(joint, 0x0321 + id)]);
        bench.assert_holds("Profile Velocity", &[(joint, 0x0102 + id)]);
        // It does not wait for a status, so there must be none: level 1 answers reads only.
        bench.set(joint, "Status Return Level", 1);
        sdk.ask("write_unanswered", json!([id, P_GAIN, 2, 77]))?;
        assert_eq!(sdk.ask("read", json!([id, P_GAIN, 2]))?, 77);
        bench.assert_holds("Position P Gain", &[(joint, 77)]);
        bench.set(joint, "Status Return Level", 2);
        // Access error: the present position cannot be written.
        let refusal = sdk.complaint("write", json!([id, PRESENT, 4, 5]))?;
        assert!(refusal.as_str().is_some_and(|said| said.contains("error 7 ")), "{refusal}");
    }
    record.works("Write");
    for (joint, id) in THREE {
        let before = bench.register(joint, "Goal Position");
        sdk.ask("reg_write", json!([id, GOAL, 4, 1500 + id]))?;
        bench.assert_holds("Goal Position", &[(joint, before)]);
        bench.assert_holds("Registered Instruction", &[(joint, 1)]);
    }
    record.works("Reg Write");
    sdk.ask("action", json!([EVERYONE]))?;
    // Nobody answers: a question to anyone of them comes after.
    sdk.ask("ping", json!([1]))?;
    for (joint, id) in THREE {
        bench.assert_holds("Goal Position", &[(joint, 1500 + id)]);
        bench.assert_holds("Registered Instruction", &[(joint, 0)]);
    }
    record.works("Action");
    Ok(())
}

fn reads_of_many(bench: &Bench, sdk: &mut Client, record: &mut Record) -> Result<(), Lost> {
    let positions: [(&str, i64); 3] = [("xm", -70_000), ("xl330", 1), ("xl430", 4000)];
    // Extended position mode, in which a reading below zero is legal.
    for (joint, position) in positions {
        bench.set(joint, "Operating Mode", 4);
        bench.set(joint, "Present Position", position);
        bench.assert_holds("Present Position", &[(joint, position)]);
    }
    let there = json!([(1_i64 << 32) - 70_000, 1, 4000]);
    for (operation, name) in [("sync_read", "Sync Read"), ("fast_sync_read", "Fast Sync Read")] {
        assert_eq!(sdk.ask(operation, json!([[1, 3, 252], PRESENT, 4]))?, there, "{name}");
        let back = json!([there[2], there[0]]);
        assert_eq!(sdk.ask(operation, json!([[252, 1], PRESENT, 4]))?, back, "{name}");
        record.works(name);
    }
    bench.set("xl330", "Position P Gain", 0xABC);
    let volts = bench.register("xl430", "Present Input Voltage");
    assert!(volts > 90, "{volts} tenths of a volt");
    let asked = json!([[[1, PRESENT, 4], [3, P_GAIN, 2], [252, VOLTAGE, 2]]]);
    for (operation, name) in [("bulk_read", "Bulk Read"), ("fast_bulk_read", "Fast Bulk Read")] {
        let seen = sdk.ask(operation, asked.clone())?;
        assert_eq!(seen, json!([there[0], 0xABC, volts]), "{name}");
        record.works(name);
    }
    Ok(())
}

fn writes_to_many(bench: &Bench, sdk: &mut Client, record: &mut Record) -> Result<(), Lost> {
    // In extended position mode goals go 256 turns either way.
    sdk.ask("sync_write", json!([GOAL, 4, [[1, -5000], [3, 70_000], [252, 3]]]))?;
    sdk.ask("ping", json!([1]))?;
    bench.assert_holds("Goal Position", &[("xm", -5000), ("xl330", 70_000), ("xl430", 3)]);
    record.works("Sync Write");
    let goals = json!([[[1, GOAL, 4, 11], [3, LED, 1, 0], [252, P_GAIN, 2, 0x0405]]]);
    sdk.ask("bulk_write", goals)?;
    sdk.ask("ping", json!([1]))?;
    bench.assert_holds("Goal Position", &[("xm", 11), ("xl330", 70_000), ("xl430", 3)]);
    bench.assert_holds("LED", &[("xm", 1), ("xl330", 0), ("xl430", 1)]);
    bench.assert_holds("Position P Gain", &[("xm", 77), ("xl330", 0xABC), ("xl430", 0x0405)]);
    record.works("Bulk Write");
    Ok(())
}

fn clear(bench: &Bench, sdk: &mut Client, record: &mut Record) -> Result<(), Lost> {
    for (joint, id) in THREE {
        bench.set(joint, "Present Position", 3 * 4096 + 100 + id);
        sdk.ask("clear_multi_turn", json!([id]))?;
        bench.assert_holds("Present Position", &[(joint, 100 + id)]);
    }
    record.works("Clear, multi-turn");
    Ok(())
}

fn restarts(
    python: &Python,
    bench: &Bench,
    sdk: &mut Client,
    record: &mut Record,
) -> Result<(), Lost> {
    for (joint, id) in THREE {
        bench.set(joint, "LED", 1);
        bench.set(joint, "Shutdown", 5);
        sdk.ask("reboot", json!([id]))?;
        // RAM is lost, EEPROM is not.
        bench.assert_holds("LED", &[(joint, 0)]);
        bench.assert_holds("Shutdown", &[(joint, 5)]);
    }
    for (_, id) in THREE {
        until_it_answers(sdk, id);
    }
    record.works("Reboot");
    // 2: all but ID and speed; 1: all but the ID, so that the speed becomes 57600 bit/s.
    sdk.ask("factory_reset", json!([1, 2]))?;
    bench.assert_holds("Shutdown", &[("xm", 52), ("xl330", 5)]);
    bench.assert_holds("Baud Rate", &[("xm", 3)]);
    sdk.ask("factory_reset", json!([3, 1]))?;
    bench.assert_holds("Baud Rate", &[("xl330", 1)]);
    bench.assert_holds("ID", &[("xl330", 3)]);
    // 255: everything.
    sdk.ask("factory_reset", json!([252, 255]))?;
    bench.assert_holds("ID", &[("xl430", 1)]);
    bench.assert_holds("Baud Rate", &[("xl430", 1)]);
    until_it_answers(sdk, 1);
    let mut slow = client(python, bench, 0, 57_600, 2);
    for (id, model) in [(3, 1200), (1, 1060)] {
        until_it_answers(&mut slow, id);
        assert_eq!(slow.ask("ping", json!([id]))?, model);
    }
    record.works("Factory Reset");
    Ok(())
}

/// A servo that restarts is deaf for a while, which is no time-out of the client's.
fn until_it_answers(sdk: &mut Client, id: i64) {
    let answered = (0..100).any(|_| sdk.ask("ping", json!([id])).is_ok());
    assert!(answered, "ID {id} never came back");
}

fn fast_lines(python: &Python, bench: &Bench) -> Result<(), Lost> {
    for (line, bps, joint, id) in [(1, 3_000_000, "three", 5), (2, 4_000_000, "four", 6)] {
        let mut sdk = client(python, bench, line, bps, 2);
        sdk.ask("write", json!([id, P_GAIN, 2, 0x0777]))?;
        bench.assert_holds("Position P Gain", &[(joint, 0x0777)]);
        bench.set(joint, "Position P Gain", 0x0555);
        assert_eq!(sdk.ask("read", json!([id, P_GAIN, 2]))?, 0x0555, "{bps} bit/s");
    }
    Ok(())
}

/// A whole robot: every joint is told one thing and found at another.
fn twenty(python: &Python) -> Result<(), Lost> {
    let bench = Bench::open("op3", Options::default());
    let mut sdk = client(python, &bench, 0, 2_000_000, 2);
    let joints = bench.world().joint_names();
    assert_eq!(joints.len(), 20);
    let robot = gaitway_profiles::robot("op3").expect("a shipped robot");
    let ids: Vec<u8> = robot.joints.iter().map(|joint| joint.id).collect();
    for (joint, id) in joints.iter().zip(&ids) {
        bench.set(joint, "Present Position", 1000 + 37 * i64::from(*id));
    }
    let there: Vec<i64> = ids.iter().map(|&id| 1000 + 37 * i64::from(id)).collect();
    for operation in ["sync_read", "fast_sync_read"] {
        assert_eq!(sdk.ask(operation, json!([ids, PRESENT, 4]))?, json!(there), "{operation}");
    }
    let goals: Vec<Value> = ids.iter().map(|&id| json!([id, 3000 - 41 * i64::from(id)])).collect();
    sdk.ask("sync_write", json!([GOAL, 4, goals]))?;
    sdk.ask("ping", json!([20]))?;
    for (joint, id) in joints.iter().zip(&ids) {
        assert_eq!(bench.register(joint, "Goal Position"), 3000 - 41 * i64::from(*id), "{joint}");
    }
    Ok(())
}

/// Joint, ID and model number of the servos of `robots/dynamixel1.toml` (e-Manual, Model Number).
const FOUR: [(&str, i64, i64); 4] =
    [("ax", 1, 12), ("mx28", 2, 29), ("mx64", 3, 310), ("mx106", 253, 320)];

// Registers that are the same in AX and MX servos.
const OLD_LED: u16 = 25;
const OLD_GOAL: u16 = 30;
const OLD_PRESENT: u16 = 36;
const CCW_LIMIT: u16 = 8;

fn protocol_1(python: &Python, record: &mut Record) -> Result<(), Lost> {
    let bench = Bench::open("dynamixel1", Options { permit_eeprom: true, ..Options::default() });
    let mut sdk = client(python, &bench, 0, 1_000_000, 1);
    for (_, id, model) in FOUR {
        assert_eq!(sdk.ask("ping", json!([id]))?, model);
    }
    record.works("Ping");
    old_reads(&bench, &mut sdk, record)?;
    old_writes(&bench, &mut sdk, record)?;
    sdk.ask("sync_write", json!([OLD_GOAL, 2, [[1, 1023], [2, 513], [3, 514], [253, 4]]]))?;
    sdk.ask("ping", json!([1]))?;
    let goals = [("ax", 1023), ("mx28", 513), ("mx64", 514), ("mx106", 4)];
    bench.assert_holds("Goal Position", &goals);
    record.works("Sync Write");
    old_bulk_read(&bench, &mut sdk, record)?;
    bench.set("mx64", "CCW Angle Limit", 1000);
    sdk.ask("factory_reset", json!([3]))?;
    bench.assert_holds("CCW Angle Limit", &[("mx64", 4095)]);
    bench.assert_holds("ID", &[("mx64", 1)]);
    // 57600 bit/s: 2,000,000 / (34 + 1).
    bench.assert_holds("Baud Rate", &[("mx64", 34)]);
    let mut slow = client(python, &bench, 0, 57_600, 1);
    until_it_answers(&mut slow, 1);
    assert_eq!(slow.ask("ping", json!([1]))?, 310);
    record.works("Factory Reset");
    Ok(())
}

fn old_reads(bench: &Bench, sdk: &mut Client, record: &mut Record) -> Result<(), Lost> {
    for (joint, id, _) in FOUR {
        bench.set(joint, "LED", 1);
        bench.set(joint, "CCW Angle Limit", 0x301 + id);
        bench.set(joint, "CW Angle Limit", 0x102);
        assert_eq!(sdk.ask("read", json!([id, OLD_LED, 1]))?, 1);
        assert_eq!(sdk.ask("read", json!([id, CCW_LIMIT, 2]))?, 0x301 + id);
        // Both limits at once, the clockwise one first.
        assert_eq!(sdk.ask("read", json!([id, 6, 4]))?, (0x301 + id) << 16 | 0x102);
        bench.set(joint, "CW Angle Limit", 0);
        bench.set(joint, "CCW Angle Limit", 1023);
    }
    record.works("Read");
    Ok(())
}

fn old_writes(bench: &Bench, sdk: &mut Client, record: &mut Record) -> Result<(), Lost> {
    for (joint, id, _) in FOUR {
        sdk.ask("write", json!([id, OLD_LED, 1, 0]))?;
        sdk.ask("write", json!([id, OLD_GOAL, 2, 0x0155 + id]))?;
        bench.assert_holds("LED", &[(joint, 0)]);
        bench.assert_holds("Goal Position", &[(joint, 0x0155 + id)]);
        // Goal 30 and speed 32 in one.
        sdk.ask("write", json!([id, OLD_GOAL, 4, 0x0120 << 16 | (600 + id)]))?;
        bench.assert_holds("Goal Position", &[(joint, 600 + id)]);
        bench.assert_holds("Moving Speed", &[(joint, 0x0120)]);
        bench.set(joint, "Status Return Level", 1);
        sdk.ask("write_unanswered", json!([id, OLD_GOAL, 2, 77]))?;
        assert_eq!(sdk.ask("read", json!([id, OLD_GOAL, 2]))?, 77);
        bench.assert_holds("Goal Position", &[(joint, 77)]);
        bench.set(joint, "Status Return Level", 2);
        // Angle limit error, bit 1: the goal is beyond the counter-clockwise limit, 1023.
        bench.set(joint, "CCW Angle Limit", 900);
        let refusal = sdk.complaint("write", json!([id, OLD_GOAL, 2, 901]))?;
        assert!(refusal.as_str().is_some_and(|said| said.contains("error 2 ")), "{refusal}");
        bench.set(joint, "CCW Angle Limit", 1023);
    }
    record.works("Write");
    for (joint, id, _) in FOUR {
        sdk.ask("reg_write", json!([id, OLD_GOAL, 2, 300 + id]))?;
        bench.assert_holds("Goal Position", &[(joint, 77)]);
        bench.assert_holds("Registered", &[(joint, 1)]);
    }
    record.works("Reg Write");
    sdk.ask("action", json!([2]))?;
    bench.assert_holds("Goal Position", &[("mx28", 302), ("mx64", 77)]);
    sdk.ask("action", json!([EVERYONE]))?;
    sdk.ask("ping", json!([1]))?;
    for (joint, id, _) in FOUR {
        bench.assert_holds("Goal Position", &[(joint, 300 + id)]);
        bench.assert_holds("Registered", &[(joint, 0)]);
    }
    record.works("Action");
    Ok(())
}

/// Only MX servos know it.
fn old_bulk_read(bench: &Bench, sdk: &mut Client, record: &mut Record) -> Result<(), Lost> {
    for (joint, position) in [("mx28", 3000), ("mx64", 5), ("mx106", 0x0FAB)] {
        bench.set(joint, "Present Position", position);
    }
    bench.set("mx64", "LED", 1);
    let asked = json!([[[2, OLD_PRESENT, 2], [3, OLD_LED, 1], [253, OLD_PRESENT, 2]]]);
    // By its packets: the class above them is broken, which a test of its own shows.
    assert_eq!(sdk.ask("bulk_read_by_hand", asked)?, json!([3000, 1, 0x0FAB]));
    record.works("Bulk Read");
    Ok(())
}
