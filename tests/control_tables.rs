//! ROBOTIS's own control tables, as its Python SDK brings them (`dynamixel_easy_sdk/control_table`), against our
//! profiles: every model it names, row by row.

mod aloud;
mod python;

use aloud::aloud;
use gaitway_profiles::{Protocol, RegisterItem, Role, Servo, Unit, servo, servo_names};
use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::TAU;
use std::fs;
use std::path::{Path, PathBuf};

/// Rows of ours that the SDK's tables lack: they came with a firmware that the tables are older than.
const NEWER: [&str; 2] = ["Startup Configuration", "Backup Ready"];

/// What a profile has by its e-Manual page alone.
const BY_THE_PAGE: [(&str, &str); 1] = [("rh-p12-rn", "External Port Data")];

/// A file of the SDK: the sections under `[type info]`, `[unit info]` and `[control table]`.
struct Table {
    name: String,
    facts: BTreeMap<String, f64>,
    /// Units in SI by the name of the row.
    units: BTreeMap<String, (f64, String)>,
    rows: Vec<(u16, u8, String)>,
}

fn folder() -> Option<PathBuf> {
    let python = match python::python() {
        Ok(python) => python,
        Err(cause) => {
            aloud!("SKIPPED: the maker's tables are not at hand: {cause}");
            return None;
        }
    };
    let libraries = python.program.parent()?.parent()?.join("lib");
    let found = fs::read_dir(libraries).expect("an environment").flatten().find_map(|version| {
        let folder = version.path().join("site-packages/dynamixel_easy_sdk/control_table");
        folder.is_dir().then_some(folder)
    });
    Some(found.expect("dynamixel-sdk brings its tables"))
}

fn read(folder: &Path, name: &str) -> Table {
    let text = fs::read_to_string(folder.join(name)).expect("a table");
    let mut table = Table {
        name: name.to_owned(),
        facts: BTreeMap::new(),
        units: BTreeMap::new(),
        rows: Vec::new(),
    };
    let mut section = "";
    for line in text.lines().map(str::trim_end).filter(|line| !line.is_empty()) {
        let cells: Vec<&str> = line.split('\t').map(str::trim).collect();
        match (line, section, &cells[..]) {
            ("[type info]" | "[unit info]" | "[control table]", ..) => section = line,
            (_, "[type info]", [name, value]) => {
                if let Ok(value) = value.parse() {
                    table.facts.insert((*name).to_owned(), value);
                }
            }
            (_, "[unit info]", [name, value, unit, ..]) => {
                if let Ok(value) = value.parse() {
                    table.units.insert((*name).to_owned(), (value, (*unit).to_owned()));
                }
            }
            (_, "[control table]", [address, bytes, name]) => {
                if let (Ok(address), Ok(bytes)) = (address.parse(), bytes.parse()) {
                    table.rows.push((address, bytes, (*name).to_owned()));
                }
            }
            _ => panic!("{name}: {line:?}"),
        }
    }
    table
}

/// Each model of the SDK with our profile of it; models without a number in its list by their file's name.
fn pairs(folder: &Path) -> Vec<(Table, &'static Servo)> {
    let numbers = fs::read_to_string(folder.join("dynamixel.model")).expect("the list of models");
    let numbers = numbers.lines().filter_map(|line| {
        let (number, file) = line.split_once('\t')?;
        Some((number.trim().parse::<u16>().ok()?, file.trim().to_owned()))
    });
    let mut numbers: Vec<(Option<u16>, String)> =
        numbers.map(|(n, file)| (Some(n), file)).collect();
    let listed: BTreeSet<String> = numbers.iter().map(|(_, file)| file.clone()).collect();
    let files = fs::read_dir(folder).expect("a folder").flatten();
    let files = files.filter_map(|file| file.file_name().into_string().ok());
    let others = files.filter(|file| {
        let newer = file.ends_with("_fw52.model") || file == "dynamixel.model";
        file.ends_with(".model") && !newer && !listed.contains(file)
    });
    numbers.extend(others.map(|file| (None, file)));
    let ours: Vec<&Servo> =
        servo_names().map(|name| servo(name).expect("a shipped servo")).collect();
    let second = ours.iter().filter(|servo| servo.protocol == Protocol::Dynamixel2);
    let second: Vec<&Servo> = second.copied().collect();
    numbers
        .into_iter()
        .map(|(number, file)| {
            let stem = file.trim_end_matches(".model").replace('_', "-");
            let fits = |servo: &&&Servo| match number {
                Some(number) => servo.model_number == number,
                None => servo.name == stem,
            };
            let found: Vec<&&Servo> = second.iter().filter(fits).collect();
            assert_eq!(found.len(), 1, "{number:?} {file}: one profile for each model");
            let servo: &'static Servo = found[0];
            // Ours are the tables of the newer firmware where the SDK has both.
            let newer = file.replace(".model", "_fw52.model");
            let file = if folder.join(&newer).exists() { newer } else { file };
            (read(folder, &file), servo)
        })
        .collect()
}

#[test]
fn every_row_of_the_makers_control_tables_stands_in_the_profile_and_no_other() {
    let Some(folder) = folder() else { return };
    let (mut models, mut rows) = (0, 0);
    for (table, servo) in pairs(&folder) {
        models += 1;
        let mut told = BTreeSet::new();
        for (address, bytes, name) in &table.rows {
            // Two more names for the blocks of indirect registers.
            if name.ends_with(" Write") || name.ends_with(" Read") {
                continue;
            }
            rows += 1;
            // Of three MX tables the SDK writes it BUS Watchdog.
            let same = |item: &RegisterItem<'_>| item.name().eq_ignore_ascii_case(name);
            let item = servo.items().find(same);
            let item = item.unwrap_or_else(|| panic!("{}: no register {name}", servo.name));
            let ours = (item.address, item.register.bytes);
            assert_eq!(ours, (*address, *bytes), "{} {name}", servo.name);
            told.insert(item.address);
        }
        for item in servo.items() {
            let repeats = item.register.repeat.is_some();
            let known = told.contains(&item.address) || repeats;
            let newer = NEWER.contains(&item.name().as_str());
            let of_page = |(servo_name, register): &(&str, &str)| {
                *servo_name == servo.name && item.name().starts_with(register)
            };
            let known = known || BY_THE_PAGE.iter().any(of_page);
            assert!(known || newer, "{}: {} has no row in {}", servo.name, item.name(), table.name);
        }
    }
    assert!(models >= 61 && rows > 3500, "{models} models, {rows} rows");
}

#[test]
fn positions_and_speeds_are_scaled_as_the_maker_scales_them() {
    let Some(folder) = folder() else { return };
    let mut compared = 0;
    for (table, servo) in pairs(&folder) {
        // Its table has the X series' scale; its e-Manual page has 1024 counts in 300 degrees.
        if servo.name == "xl320" {
            continue;
        }
        // Its table and its e-Manual page contradict one another; the profile follows the page and says so.
        if servo.name == "rh-p12-rn" {
            let velocity = servo.register(Role::PresentVelocity).expect("one");
            assert!(servo.position.source.contains("unconfirmed"));
            assert!(velocity.source.contains("unconfirmed"));
            continue;
        }
        let fact = |name: &str| *table.facts.get(name).unwrap_or_else(|| panic!("{name}"));
        let zero = fact("value_of_zero_radian_position");
        assert!((f64::from(servo.position.zero_count) - zero).abs() <= 1.0, "{}", servo.name);
        let top = (fact("value_of_max_radian_position") - zero) * servo.radians_per_count();
        // The last count of a turn is one short of it.
        let off = top - fact("max_radian");
        assert!(off.abs() <= 2.0 * servo.radians_per_count() + 1e-5, "{}: {off} rad", servo.name);
        let velocity = servo.register(Role::PresentVelocity).expect("one");
        let (unit, name) = &table.units["Present Velocity"];
        if name == "rad/s" && velocity.unit == Unit::Rpm {
            let ours = velocity.scale.unwrap_or(1.0) * TAU / 60.0;
            assert!((ours / unit - 1.0).abs() < 2e-3, "{}: {ours} rad/s, {unit}", servo.name);
            compared += 1;
        }
    }
    assert!(compared > 50, "{compared}");
}
