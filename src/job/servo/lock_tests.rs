//! Whatever is lost while a Feetech servo's lock is open, and whenever: afterwards it is closed, or it
//! is said that it may be open. In virtual time, on the servo's own registers.

use super::Which;
use super::change::{change_baud, change_id, set_back};
use super::device::Device;
use crate::bus::FactoryReset;
use crate::error::Error;
use gaitway_profiles::Role;
use gaitway_sim::{Damage, Fault, Options, World};

const JOINT: &str = "gripper";
const ID: u8 = 6;
const NEW_ID: u8 = 42;
/// A change is made and read back within this time, ns; the rest is waiting.
const BUSY_NS: u64 = 30_000_000;

/// Something that opens the lock.
type Change = fn(&mut Device) -> Result<(), Error>;

const CHANGES: [(&str, Change); 4] = [
    ("set", |device| {
        let item = device.item(Role::TemperatureLimit).expect("a register that is kept");
        device.set(&item, 61, true).map(|_| ())
    }),
    ("set-id", |device| {
        let item = device.item(Role::Id).expect("a register");
        change_id(device, &item, NEW_ID)
    }),
    ("set-baud", |device| {
        let item = device.item(Role::BaudRate).expect("a register");
        let speeds = &device.model.profile().baud;
        let speed = speeds.iter().find(|speed| speed.bps == 500_000).expect("a speed");
        change_baud(device, &item, speed)
    }),
    ("factory-reset", |device| {
        // The virtual one keeps its ID; what a real one does is not documented.
        set_back(device, FactoryReset::Everything, ID, 1_000_000).map(|_| ())
    }),
];

/// The servo, on a line of its own, in a world where `faults` strike from now on.
fn device(faults: Vec<Fault>) -> Device {
    let which = Which {
        bus: "sim".parse().expect("an address"),
        id: ID,
        robot: Some("so101".to_owned()),
        model: None,
        protocol: None,
        dialect: None,
    };
    let device = Device::open(&which).expect("a servo");
    let mut robot = gaitway_profiles::robot("so101").expect("a shipped robot");
    robot.joints.retain(|joint| joint.name == JOINT);
    robot.joints[0].parent = None;
    robot.anatomy = None;
    let options = Options { faults, permit_eeprom: true, ..Options::default() };
    let world = World::new(&robot, options).expect("a world");
    *device.line.world.as_ref().expect("a virtual one").lock() = world;
    device
}

/// What came of a change, and the registers the servo then has.
struct Came {
    result: Result<(), String>,
    lock: i64,
    id: i64,
    took_ns: u64,
}

fn come_of(change: Change, faults: Vec<Fault>) -> Came {
    let mut device = device(faults);
    let result = change(&mut device).map_err(|error| error.to_string());
    let world = device.line.world.as_ref().expect("a virtual one").lock();
    let register = |name: &str| world.register(JOINT, name).expect("a register");
    Came { result, lock: register("Lock"), id: register("ID"), took_ns: world.now_ns() }
}

/// Moments at which something begins to be lost, ns.
fn moments(change: Change) -> impl Iterator<Item = u64> {
    let whole_ns = come_of(change, Vec::new()).took_ns;
    let busy = (0..BUSY_NS.min(whole_ns)).step_by(700_000);
    busy.chain((BUSY_NS..whole_ns).step_by(9_000_000))
}

#[test]
fn without_a_fault_each_change_is_made_and_the_lock_is_closed() {
    for (name, change) in CHANGES {
        let came = come_of(change, Vec::new());
        assert_eq!(came.result, Ok(()), "{name}");
        assert_eq!(came.lock, 1, "{name}");
    }
}

#[test]
fn whatever_answers_are_lost_the_lock_is_closed_or_said_to_be_open() {
    let (mut failed, mut done) = (0, 0);
    for (name, change) in CHANGES {
        for from_ns in moments(change) {
            for for_ns in [2_000_000, 30_000_000, u64::MAX - from_ns] {
                let fault = Fault::Statuses {
                    of: Some(JOINT.to_owned()),
                    from_ns,
                    until_ns: from_ns + for_ns,
                    probability: 1.0,
                    damage: Damage::Mute,
                };
                let came = come_of(change, vec![fault]);
                let place = format!("{name}, answers lost from {from_ns} ns for {for_ns} ns");
                // Every instruction was heard, so it is closed whether or not anybody can know.
                assert_eq!(came.lock, 1, "{place}: {:?}", came.result);
                match came.result {
                    Ok(()) => done += 1,
                    Err(_) => failed += 1,
                }
            }
        }
    }
    assert!(failed > 100 && done > 100, "{failed} failed, {done} done: some of both");
}

#[test]
fn a_servo_that_hears_nothing_any_more_is_said_to_be_open() {
    let mut open = 0;
    for (name, change) in CHANGES {
        for from_ns in moments(change) {
            for for_ns in [5_000_000, 60_000_000, u64::MAX - from_ns] {
                let (joint, until_ns) = (JOINT.to_owned(), from_ns + for_ns);
                let came = come_of(change, vec![Fault::Silent { joint, from_ns, until_ns }]);
                let place = format!("{name}, deaf from {from_ns} ns for {for_ns} ns");
                if came.lock == 1 {
                    continue;
                }
                open += 1;
                let said = came.result.expect_err(&place);
                assert!(said.contains("EEPROM lock may be open"), "{place}:\n{said}");
                assert!(
                    said.contains("gaitway servo set sim") && said.contains("'Lock' 1"),
                    "{said}"
                );
            }
        }
    }
    assert!(open > 5, "only {open} were left open");
}

#[test]
fn a_changed_id_whose_answer_is_lost_is_found_by_asking_under_the_new_one() {
    let change = CHANGES[1].1;
    let mut found = 0;
    for from_ns in moments(change) {
        let fault = Fault::Statuses {
            of: Some(JOINT.to_owned()),
            from_ns,
            until_ns: from_ns + 3_000_000,
            probability: 1.0,
            damage: Damage::Mute,
        };
        let came = come_of(change, vec![fault]);
        assert_eq!(came.result, Ok(()), "answers lost for 3 ms from {from_ns} ns");
        assert_eq!((came.id, came.lock), (NEW_ID.into(), 1));
        found += 1;
    }
    assert!(found > 20, "{found}");
}

#[test]
fn a_lock_that_was_left_open_is_closed_with_the_command_that_was_named() {
    let mut device = device(Vec::new());
    {
        let mut world = device.line.world.as_ref().expect("a virtual one").lock();
        assert!(world.set_register(JOINT, "Lock", 0));
    }
    let lock = super::register::find(device.model.profile(), "Lock").expect("a register");
    assert!(device.set(&lock, 0, true).is_err(), "it is opened where that is needed alone");
    let closed = device.set(&lock, 1, false).expect("closed");
    assert_eq!((closed.old, closed.new), (0, 1));
}
