//! LeRobot's motor buses: how most SO-101 arms are driven.

use crate::aloud::aloud;
use crate::bench::{Bench, Client, Lost};
use crate::python::{Python, environment};
use crate::scenario::{About, Record, Run, Scenario};
use gaitway_sim::Options;
use serde_json::{Value, json};
use std::path::Path;
use std::process::Command;

const NAME: &str = "lerobot";

pub static STS: Scenario =
    Scenario::new(NAME, "FEETECH STS", About::Everything(&["STS3215 of SO-101"]), Run::Python(sts));

pub static PROTOCOL_2: Scenario = Scenario::new(
    NAME,
    "DYNAMIXEL 2.0",
    About::Everything(&["XM430-W350", "XL330-M288", "XL430-W250"]),
    Run::Python(protocol_2),
);

/// Robots of LeRobot that have a file here, and where LeRobot has its own.
const ROBOTS: [(&str, &str); 8] = [
    ("so101", "robots/so_follower/so_follower.py"),
    ("so101-leader", "teleoperators/so_leader/so_leader.py"),
    ("so100", "robots/so_follower/so_follower.py"),
    ("koch", "robots/koch_follower/koch_follower.py"),
    ("koch-leader", "teleoperators/koch_leader/koch_leader.py"),
    ("lekiwi", "robots/lekiwi/lekiwi.py"),
    ("hope-jr-arm", "robots/hope_jr/hope_jr_arm.py"),
    ("hope-jr-hand", "robots/hope_jr/hope_jr_hand.py"),
];

/// LeRobot connects to each as its own class would: the names, IDs and models are LeRobot's.
pub fn robots() {
    let python = match crate::python::python() {
        Ok(python) => python,
        Err(cause) => return aloud!("SKIPPED: LeRobot's robots were not tried: {cause}"),
    };
    for (name, file) in ROBOTS {
        let options = Options { permit_eeprom: true, ..Options::default() };
        let bench = Bench::open(name, options);
        let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/clients/lerobot_robots.py");
        let mut client = Command::new(&python.program);
        client.args(["-B", script, bench.port(0), file]).env("GAITWAY_BESIDE", &python.beside);
        let output = client.output().expect("a Python process");
        let told: Value = serde_json::from_slice(&output.stdout)
            .unwrap_or_else(|e| panic!("{name}: {e}: {}", String::from_utf8_lossy(&output.stderr)));
        let robot = gaitway_profiles::robot(name).expect("a shipped robot");
        let ours: Value = robot
            .joints
            .iter()
            .map(|joint| {
                let servo = gaitway_profiles::servo(&joint.servo).expect("a profile");
                let turn = f64::from(joint.direction) * (joint.initial_rad() + joint.offset_rad);
                let count = f64::from(servo.position.zero_count) + turn / servo.radians_per_count();
                (joint.name.clone(), json!([joint.id, servo.model_number, count.round() as i64]))
            })
            .collect();
        assert_eq!(told, ours, "{name}");
    }
}

/// LeRobot's own commands, with PyTorch: a port is found, motors are set up, two arms calibrated, one led by the other, two
/// episodes recorded and one replayed.
pub fn commands() {
    const TORCH: &str = include_str!("../python/torch.txt");
    const REST: &str = include_str!("../python/lerobot.txt");
    if std::env::var_os("GAITWAY_LONG").is_none() {
        return aloud!("SKIPPED: LeRobot's own commands (6 GB) are run with GAITWAY_LONG=1");
    }
    let modules = "torch, lerobot, scservo_sdk, rerun";
    let made = environment("lerobot-environment", &[TORCH, REST], modules, |made| {
        made.pip("torch.txt", &[])?;
        made.pip("lerobot.txt", &[])
    });
    let python = made.expect("an environment with LeRobot").join("bin/python");
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let folder = crate::program::folder("lerobot-whole");
    // In a session of its own, so that other programs do not make it late: its time-outs are as they are shipped.
    let output = Command::new("setsid")
        .arg("-w")
        .arg(python)
        .args([root.join("tests/clients/lerobot_whole.py"), folder])
        .env("PYTHONPATH", root.join("python"))
        .env("GAITWAY", env!("CARGO_BIN_EXE_gaitway"))
        .output()
        .expect("a Python process");
    let told: Value = serde_json::from_slice(&output.stdout)
        .unwrap_or_else(|e| panic!("{e}: {}", String::from_utf8_lossy(&output.stderr)));
    match told["port"].as_str() {
        Some(skipped) if skipped.starts_with("SKIPPED") => aloud!("find-port: {skipped}"),
        port => assert_eq!(port, Some("/dev/ttyGAITWAY")),
    }
    assert_eq!(told["ids"], json!([1, 2, 3, 4, 5, 6]));
    let number = |of: &Value| of.as_f64().unwrap_or_else(|| panic!("a number: {told:#}"));
    // Counts of 4096 a turn: 0.4 rad by hand, and the follower behind.
    let [leader, follower] = [0, 1].map(|arm| number(&told["led"][arm]));
    assert!((leader - 2047.0).abs() > 200.0 && (leader - follower).abs() < 40.0, "{told:#}");
    assert_eq!(told["info"]["total_episodes"], 2);
    let [sent, wanted] = [0, 1].map(|of| number(&told["replayed"][of]));
    assert!(sent == wanted && wanted > 60.0 && number(&told["range_counts"]) > 100.0, "{told:#}");
    assert!(number(&told["apart_counts"]) <= 1.0, "each goal is that of the dataset: {told:#}");
    aloud!(
        "LeRobot's commands: {wanted} goals of an episode replayed, {} counts apart at most",
        told["apart_counts"]
    );
}

fn start(python: &Python, bench: &Bench, kind: &str, motors: &[String]) -> Client {
    let mut arguments = vec![bench.port(0), kind];
    arguments.extend(motors.iter().map(String::as_str));
    Client::start(python, "lerobot_client.py", &arguments)
}

fn sts(python: &Python, record: &mut Record) -> Result<(), Lost> {
    let bench = Bench::open("so101", Options { permit_eeprom: true, ..Options::default() });
    let robot = gaitway_profiles::robot("so101").expect("a shipped robot");
    let joints: Vec<(&str, i64)> =
        robot.joints.iter().map(|joint| (joint.name.as_str(), i64::from(joint.id))).collect();
    let motors: Vec<_> = joints.iter().map(|(name, id)| format!("{name}:{id}:sts3215")).collect();
    let mut bus = start(python, &bench, "feetech", &motors);
    // The handshake pings everyone and compares models and firmware.
    bus.ask("connect", json!([]))?;
    let all: Value = joints.iter().map(|(_, id)| (id.to_string(), json!(777))).collect();
    assert_eq!(bus.ask("broadcast_ping", json!([]))?, all);
    record.works("Ping, broadcast");
    assert_eq!(bus.ask("ping", json!([joints[0].0]))?, 777);
    record.works("Ping");
    bus.ask("configure_motors", json!([]))?;
    for (joint, _) in &joints {
        bench.assert_holds("Acceleration", &[(joint, 254)]);
        bench.assert_holds("Maximum Acceleration", &[(joint, 254)]);
        bench.assert_holds("Return Delay Time", &[(joint, 0)]);
    }
    record.works("Write");
    bus.ask("enable_torque", json!([]))?;
    joints.iter().for_each(|(joint, _)| bench.assert_holds("Lock", &[(joint, 1)]));
    bus.ask("disable_torque", json!([]))?;
    joints.iter().for_each(|(joint, _)| bench.assert_holds("Lock", &[(joint, 0)]));
    homing(&bench, &mut bus, &joints, record)?;
    bench.set(joints[1].0, "Goal Velocity", -333);
    assert_eq!(bus.ask("read", json!(["Goal_Velocity", joints[1].0]))?, -333);
    record.works("Read");
    groups(&bench, &mut bus, &joints, "Goal_Position", record)
}

/// Every pose becomes 2047, LeRobot's middle, by way of the offset: present = actual - offset.
fn homing(
    bench: &Bench,
    bus: &mut Client,
    joints: &[(&str, i64)],
    record: &mut Record,
) -> Result<(), Lost> {
    for (joint, id) in joints {
        bench.set(joint, "Homing Offset", 0);
        bench.set(joint, "Present Position", 1700 + 100 * id);
    }
    bus.ask("set_half_turn_homings", json!([]))?;
    for (joint, id) in joints {
        bench.assert_holds("Homing Offset", &[(joint, 1700 + 100 * id - 2047)]);
        bench.assert_holds("Present Position", &[(joint, 2047)]);
    }
    record.works("Calibrate to the middle");
    Ok(())
}

fn groups(
    bench: &Bench,
    bus: &mut Client,
    joints: &[(&str, i64)],
    goal: &str,
    record: &mut Record,
) -> Result<(), Lost> {
    let values = |of: fn(i64) -> i64| -> Value {
        joints.iter().map(|(joint, id)| ((*joint).to_owned(), json!(of(*id)))).collect()
    };
    bus.ask("sync_write", json!([goal, values(|id| 1900 + id)]))?;
    for (joint, id) in joints {
        bench.assert_comes_to(joint, "Goal Position", 1900 + id);
        bench.set(joint, "Present Position", 2100 + id);
    }
    record.works("Sync Write");
    let seen = bus.ask("sync_read", json!(["Present_Position"]))?;
    assert_eq!(seen, values(|id| 2100 + id));
    record.works("Sync Read");
    Ok(())
}

fn protocol_2(python: &Python, record: &mut Record) -> Result<(), Lost> {
    let bench = Bench::open("dynamixel2", Options { permit_eeprom: true, ..Options::default() });
    let joints = crate::dynamixel_sdk::THREE;
    let models = ["xm430-w350", "xl330-m288", "xl430-w250"];
    let motors: Vec<_> =
        joints.iter().zip(models).map(|((name, id), m)| format!("{name}:{id}:{m}")).collect();
    let mut bus = start(python, &bench, "dynamixel", &motors);
    bus.ask("connect", json!([]))?;
    let all = json!({ "1": 1020, "3": 1200, "252": 1060 });
    let found = (0..3).any(|_| bus.ask("broadcast_ping", json!([])).is_ok_and(|seen| seen == all));
    assert!(found, "everyone's ping never found {all}");
    record.works("Ping, broadcast");
    assert_eq!(bus.ask("ping", json!(["xl430"]))?, 1060);
    record.works("Ping");
    bus.ask("enable_torque", json!([]))?;
    bench.assert_holds("Torque Enable", &[("xm", 1), ("xl330", 1), ("xl430", 1)]);
    bus.ask("disable_torque", json!([]))?;
    bench.assert_holds("Torque Enable", &[("xm", 0), ("xl330", 0), ("xl430", 0)]);
    record.works("Write");
    bench.set("xl430", "Homing Offset", -321);
    assert_eq!(bus.ask("read", json!(["Homing_Offset", "xl430"]))?, -321);
    bench.set("xl430", "Homing Offset", 0);
    record.works("Read");
    groups(&bench, &mut bus, &joints, "Goal_Position", record)
}
