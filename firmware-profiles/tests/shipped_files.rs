//! Every shipped profile is a test of its own: it must satisfy the validator.

use gaitway_profiles::{
    Adapter, Servo, actuator, actuator_names, adapter_names, adapters, board, board_names, robot,
    robot_names, sensor, sensor_names, servo, servo_names,
};
use libtest_mimic::{Arguments, Failed, Trial};
use std::collections::BTreeSet;

fn main() {
    let mut trials = Vec::new();
    for name in servo_names() {
        trials.push(Trial::test(format!("servo::{name}"), move || {
            let servo = servo(name)?;
            every_byte_has_an_owner_or_none(servo)
        }));
    }
    for name in actuator_names() {
        trials.push(Trial::test(format!("actuator::{name}"), move || {
            Ok(actuator(name).map(|_| ())?)
        }));
    }
    for name in robot_names() {
        trials.push(Trial::test(format!("robot::{name}"), move || Ok(robot(name).map(|_| ())?)));
    }
    for name in sensor_names() {
        trials.push(Trial::test(format!("sensor::{name}"), move || Ok(sensor(name).map(|_| ())?)));
    }
    for name in board_names() {
        trials.push(Trial::test(format!("board::{name}"), move || Ok(board(name).map(|_| ())?)));
    }
    for name in adapter_names() {
        trials.push(Trial::test(format!("adapter::{name}"), move || {
            let adapters = adapters()?;
            let found = adapters.iter().any(|adapter| adapter.name == name);
            if found { Ok(()) } else { Err(Failed::from("not among the adapters")) }
        }));
    }
    trials.push(Trial::test("no_usb_id_belongs_to_two_adapters", usb_ids_are_distinct));
    trials.push(Trial::test("no_two_profiles_have_the_same_name", || {
        let devices = || servo_names().chain(actuator_names()).chain(adapter_names());
        let names = || devices().chain(robot_names()).chain(sensor_names()).chain(board_names());
        let distinct: BTreeSet<&str> = names().collect();
        if distinct.len() == names().count() { Ok(()) } else { Err(Failed::without_message()) }
    }));
    libtest_mimic::run(&Arguments::from_args(), trials).exit();
}

/// The items of repeated registers are spelt out by the accessors, not by the file: check them
/// byte by byte, independently of the validator's rule on registers.
fn every_byte_has_an_owner_or_none(servo: &Servo) -> Result<(), Failed> {
    let mut owners = vec![None; usize::from(servo.table_len())];
    for item in servo.items() {
        let start = usize::from(item.address);
        for owner in &mut owners[start..start + usize::from(item.register.bytes)] {
            if let Some(other) = owner.replace(item.name()) {
                return Err(format!("{other} and {} share a byte", item.name()).into());
            }
        }
        let found = servo.register_named(&item.name()).map(|found| found.address);
        if found != Some(item.address) {
            return Err(format!("{} is found at {found:?}", item.name()).into());
        }
    }
    Ok(())
}

fn usb_ids_are_distinct() -> Result<(), Failed> {
    let of = |adapter: &'static Adapter| &adapter.usb_ids;
    let ids = || adapters().map(|list| list.into_iter().flat_map(of));
    let distinct: BTreeSet<&String> = ids()?.collect();
    if distinct.len() == ids()?.count() { Ok(()) } else { Err(Failed::from("an id stands twice")) }
}
