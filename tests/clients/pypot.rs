//! pypot, which drives the Poppy robots: AX and MX servos with Protocol 1.0. It reads one by one
//! and writes by sync write only.

use crate::bench::{Bench, Client, Lost};
use crate::python::Python;
use crate::registers::{self, Listed};
use crate::scenario::{About, Record, Run, Scenario};
use gaitway_sim::Options;
use serde_json::json;

pub const NAME: &str = "pypot";

pub static PROTOCOL_1: Scenario = Scenario::new(
    NAME,
    "DYNAMIXEL 1.0",
    About::Everything(&["AX-12A", "MX-28", "MX-64", "MX-106"]),
    Run::Python(protocol_1),
);

/// Joint, ID, profile, and pypot's name.
const FOUR: [(&str, i64, &str, &str); 4] = [
    ("ax", 1, "ax-12a", "AX-12"),
    ("mx28", 2, "mx-28", "MX-28"),
    ("mx64", 3, "mx-64", "MX-64"),
    ("mx106", 253, "mx-106", "MX-106"),
];

pub fn bench() -> Bench {
    Bench::open("dynamixel1", Options { permit_eeprom: true, ..Options::default() })
}

pub fn client(python: &Python, bench: &Bench) -> Client {
    Client::start(python, "pypot_client.py", &[bench.port(0)])
}

fn protocol_1(python: &Python, record: &mut Record) -> Result<(), Lost> {
    let bench = bench();
    let mut pypot = client(python, &bench);
    for (_, id, ..) in FOUR {
        assert_eq!(pypot.ask("ping", json!([id]))?, true);
    }
    assert_eq!(pypot.ask("scan", json!([[1, 2, 3, 4, 253]]))?, json!([1, 2, 3, 253]));
    let models = json!(["AX-12", "MX-28", "MX-64", "MX-106"]);
    assert_eq!(pypot.ask("model", json!([[1, 2, 3, 253]]))?, models);
    record.works("Ping");
    for (joint, id, profile, model) in FOUR {
        let listed = Listed::table(pypot.ask("registers", json!([model]))?);
        let servo = gaitway_profiles::servo(profile).expect("a shipped profile");
        let otherwise = registers::read_all(&bench, joint, servo, &listed, |register| {
            let seen = pypot.ask("read", json!([id, register.name]))?;
            Ok(seen.as_i64().expect("a number"))
        })?;
        assert_eq!(otherwise, [""; 0], "{model}");
        let otherwise = registers::write_all(&bench, joint, servo, &listed, |register, value| {
            pypot.ask("write", json!([id, register.name, value]))?;
            Ok(())
        })?;
        assert_eq!(otherwise, [""; 0], "{model}");
    }
    record.works("Read");
    record.works("Sync Write");
    angles(&bench, &mut pypot, record)?;
    setup(&bench, &mut pypot, record)
}

/// It throws away what is still under way when it speaks again (a test of its own shows that), so
/// that what it wrote is waited for.
fn comes_to(bench: &Bench, register: &str, expected: &[(&str, i64)]) {
    for &(joint, value) in expected {
        bench.assert_comes_to(joint, register, value);
    }
}

fn angles(bench: &Bench, pypot: &mut Client, record: &mut Record) -> Result<(), Lost> {
    pypot.ask("set_goal_position", json!([{ "1": 30.0, "2": 90.0, "253": -45.0 }]))?;
    // AX: 1023 counts in 300 degrees, 0 in the middle. MX: it takes 4095 counts for 360 degrees,
    // where the maker has 4096, so that it is up to a count beside.
    comes_to(bench, "Goal Position", &[("ax", 614), ("mx28", 3071), ("mx106", 1536)]);
    bench.set("mx64", "Present Position", 1024);
    let seen = pypot.ask("get_present_position", json!([[3]]))?[0].as_f64().expect("an angle");
    assert!((seen + 90.0).abs() < 0.1, "{seen} degrees");
    // 100 degrees a second are 16.67 rev/min, at 0.114 rev/min a count.
    pypot.ask("set_moving_speed", json!([{ "2": 100.0 }]))?;
    comes_to(bench, "Moving Speed", &[("mx28", 146)]);
    record.works("Angles and speeds in SI units");
    Ok(())
}

fn setup(bench: &Bench, pypot: &mut Client, record: &mut Record) -> Result<(), Lost> {
    pypot.ask("enable_torque", json!([[1, 253]]))?;
    comes_to(bench, "Torque Enable", &[("ax", 1), ("mx28", 0), ("mx106", 1)]);
    pypot.ask("disable_torque", json!([[1, 253]]))?;
    comes_to(bench, "Torque Enable", &[("ax", 0), ("mx106", 0)]);
    pypot.ask("set_wheel_mode", json!([[1, 2]]))?;
    for limit in ["CW Angle Limit", "CCW Angle Limit"] {
        comes_to(bench, limit, &[("ax", 0), ("mx28", 0)]);
    }
    pypot.ask("set_joint_mode", json!([[1, 2]]))?;
    comes_to(bench, "CCW Angle Limit", &[("ax", 1023), ("mx28", 4095)]);
    record.works("Wheel mode");
    pypot.ask("change_id", json!([{ "3": 9 }]))?;
    comes_to(bench, "ID", &[("mx64", 9), ("mx28", 2)]);
    assert_eq!(pypot.ask("ping", json!([9]))?, true);
    record.works("Change of ID and speed");
    Ok(())
}
