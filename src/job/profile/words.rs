//! What is known of devices, in words.

mod sensor;

use super::{CheckedProfile, ListedProfile, ProfileList, dialect, protocol};
use crate::error::counted;
use gaitway_profiles::{self as profiles, Actuator, Profile, Register, Servo, Unit};
use std::collections::BTreeMap;
use std::fmt::Write;

/// What is known of a device or a robot.
#[must_use]
pub fn shown(profile: &Profile) -> String {
    match profile {
        Profile::Servo(servo) => show_servo(servo),
        Profile::Actuator(actuator) => show_actuator(actuator),
        Profile::Robot(robot) => show_robot(robot),
        Profile::Adapter(adapter) => show_adapter(adapter),
        Profile::Sensor(sensor) => sensor::show(sensor),
        Profile::Board(board) => show_board(board),
    }
}

/// What a look through a profile found.
#[must_use]
pub fn checked(checked: &CheckedProfile) -> String {
    let mut out = format!("{}: OK; {}, {}\n", checked.name, checked.kind, checked.holds);
    if !checked.unconfirmed.is_empty() {
        let _ = writeln!(out, "unconfirmed: {}", checked.unconfirmed.len());
    }
    for fact in &checked.unconfirmed {
        let _ = writeln!(out, "  {:<36} {}", fact.place, fact.source);
    }
    out
}

/// All there are, by kind and maker.
#[must_use]
pub fn listed(list: &ProfileList) -> String {
    let mut out = String::new();
    for (title, listed) in [("servos", &list.servos), ("CAN actuators", &list.actuators)] {
        let mut groups: BTreeMap<_, Vec<&ListedProfile>> = BTreeMap::new();
        for one in listed {
            groups.entry((&one.maker, one.protocol)).or_default().push(one);
        }
        for ((maker, protocol), listed) in groups {
            let words = [Some(title), maker.as_deref(), protocol];
            let words: Vec<_> = words.into_iter().flatten().collect();
            let _ = writeln!(out, "{}", words.join(", "));
            for one in listed {
                let _ = writeln!(out, "  {:<24} {}", one.name, one.model);
            }
        }
    }
    for (title, listed) in [
        ("sensors", &list.sensors),
        ("robots", &list.robots),
        ("adapters", &list.adapters),
        ("boards", &list.boards),
    ] {
        let _ = writeln!(out, "{title}");
        for one in listed {
            let maker = one.maker.as_ref().map_or_else(String::new, |m| format!("{m} "));
            let ids = one.usb_ids.join(", ");
            let ids = if ids.is_empty() { ids } else { format!(" ({ids})") };
            let _ = writeln!(out, "  {:<24} {maker}{}{ids}", one.name, one.model);
        }
    }
    out
}

fn show_actuator(actuator: &Actuator) -> String {
    let line = &actuator.line;
    let rates = |rates: &[u32]| {
        let rates: Vec<_> = rates.iter().map(u32::to_string).collect();
        rates.join(", ")
    };
    let mut out = format!(
        "{} {}, CAN actuator, {}\nsource   {}\nline     {} bit/s\n",
        actuator.maker,
        actuator.model,
        dialect(actuator.dialect),
        actuator.source,
        rates(&line.bitrates_bps)
    );
    if !line.data_bitrates_bps.is_empty() {
        let _ = writeln!(out, "CAN FD   {} bit/s", rates(&line.data_bitrates_bps));
    }
    let factory = line.factory_id.map_or_else(String::new, |id| format!(", {id} when new"));
    let _ = writeln!(out, "ids      {} to {}{factory}", line.first_id, line.last_id);
    if let Some(ranges) = &actuator.ranges {
        let _ = writeln!(
            out,
            "ranges   {:.1} deg, {:.1} deg/s, {} N m (either way); kp to {} N m/rad, kd to {} N m s/rad",
            ranges.position_rad.to_degrees(),
            ranges.velocity_rad_s.to_degrees(),
            ranges.torque_nm,
            ranges.kp_nm_rad,
            ranges.kd_nm_s_rad
        );
    }
    if let Some(gear) = &actuator.gear {
        let _ = writeln!(out, "gear     {} : 1", gear.ratio);
    }
    let _ = writeln!(out, "timeout  {}", actuator.timeout.action);
    out
}

fn show_servo(servo: &Servo) -> String {
    let modes: Vec<String> =
        servo.operating_modes.iter().map(|m| format!("{} {}", m.value, words(m.mode))).collect();
    let motor = &servo.motor;
    let mut out = format!(
        "{} {}, model number {}, {}\nmanual   {}\nposition {} in {}, zero at {}\n\
         motor    {:.1} deg/s unloaded, {} N m, {} A, at {} V\nmodes    {}\n\n\
         {:>5} {:>5} {:<28} {:<6} {:<3} {:>18} {:>9} {:<24} {}\n",
        servo.maker,
        servo.model,
        servo.model_number,
        protocol(servo.protocol),
        servo.manual,
        counted(servo.position.counts, "count"),
        counted(servo.position.degrees, "degree"),
        servo.position.zero_count,
        motor.no_load_speed_rad_s.to_degrees(),
        motor.stall_torque_nm,
        motor.stall_current_a,
        motor.voltage_v,
        if modes.is_empty() { "by the angle limits".to_owned() } else { modes.join(", ") },
        "addr",
        "bytes",
        "register",
        "kept",
        "",
        "raw range",
        "initial",
        "role",
        "one count"
    );
    for register in &servo.registers {
        let _ = writeln!(out, "{}", register_row(register));
    }
    out
}

fn register_row(register: &Register) -> String {
    let kept = if register.region == profiles::Region::Eeprom { "eeprom" } else { "ram" };
    let access = if register.access == profiles::Access::Rw { "rw" } else { "r" };
    let initial = register.initial.map_or_else(|| "-".to_owned(), |raw| raw.to_string());
    let name = match register.item_count() {
        1 => register.name.clone(),
        count => {
            let first = register.first_number();
            format!("{} {first} to {}", register.name, first + count - 1)
        }
    };
    let (min, max) = register.range();
    let range = format!("{min} to {max}");
    let role = register.role.map_or_else(String::new, words);
    let row = format!(
        "{:>5} {:>5} {name:<28} {kept:<6} {access:<3} {range:>18} {initial:>9} {role:<24} {}",
        register.address,
        register.bytes,
        one_count(register)
    );
    row.trim_end().to_owned()
}

/// What one count of a register is worth, in the manual's unit.
fn one_count(register: &Register) -> String {
    let unit = match register.unit {
        Unit::None => return String::new(),
        Unit::Turn | Unit::TurnRelative => return "position".to_owned(),
        Unit::Rpm => "rev/min",
        Unit::CountPerSecond => "counts/s",
        Unit::Rpm2 => "rev/min2",
        Unit::CountPerSecond2 => "counts/s2",
        Unit::Ampere => "A",
        Unit::Volt => "V",
        Unit::Celsius => "degC",
        Unit::Second => "s",
        Unit::Ratio => "of full",
    };
    let zero = register.zero.map_or_else(String::new, |zero| format!(" from {zero}"));
    format!("{} {unit}{zero}", register.scale.unwrap_or(1.0))
}

/// A name of the schema as words: `GoalPosition` is `goal position`.
fn words(name: impl std::fmt::Debug) -> String {
    let mut out = String::new();
    for letter in format!("{name:?}").chars() {
        if letter.is_ascii_uppercase() && !out.is_empty() {
            out.push(' ');
        }
        out.push(letter.to_ascii_lowercase());
    }
    out
}

fn show_robot(robot: &profiles::Robot) -> String {
    let mut out = format!("{}: {}\nsource {}\n\n", robot.name, robot.description, robot.source);
    for line in &robot.lines {
        let _ = match line.kind {
            profiles::LineKind::Serial { baud_bps } => {
                writeln!(out, "line {}: {baud_bps} bit/s", line.name)
            }
            profiles::LineKind::Can(speed) => {
                let fast = speed.data_bitrate_bps.map(|bps| format!(", payload {bps} bit/s"));
                let fast = fast.unwrap_or_default();
                writeln!(out, "line {}: CAN, {} bit/s{fast}", line.name, speed.bitrate_bps)
            }
        };
    }
    let _ = writeln!(
        out,
        "\n{:<16} {:>4} {:<14} {:>18} {:>12} {:>14}",
        "joint", "ID", "servo", "range, deg", "deg/s", "deg/s2"
    );
    for joint in &robot.joints {
        let range =
            format!("{:.1} to {:.1}", joint.lower_rad.to_degrees(), joint.upper_rad.to_degrees());
        let _ = writeln!(
            out,
            "{:<16} {:>4} {:<14} {range:>18} {:>12.0} {:>14.0}",
            joint.name,
            joint.id,
            joint.servo,
            joint.velocity_rad_s.to_degrees(),
            joint.acceleration_rad_s2.to_degrees()
        );
    }
    let _ = writeln!(out, "\nacceleration: {}", robot.acceleration_source);
    out
}

fn show_board(board: &profiles::Board) -> String {
    let imu = &board.imu;
    let mut out = format!(
        "{} {}, model number {}, {}\nmanual   {}\nfeels    {:.0} deg/s and {:.0} g at most\n\n",
        board.maker,
        board.model,
        board.model_number,
        protocol(board.protocol),
        board.manual,
        imu.gyroscope_deg_s * f64::from(i16::MAX),
        imu.accelerometer_g * f64::from(i16::MAX),
    );
    for register in &board.registers {
        let _ = writeln!(out, "{}", register_row(register));
    }
    out
}

fn show_adapter(adapter: &profiles::Adapter) -> String {
    let echo = if adapter.echo { "hears its own bytes" } else { "does not hear its own bytes" };
    let mut out = format!(
        "{}: {}\nUSB      {}\necho     {echo}\nlatency  {:.1} ms at most\n",
        adapter.name,
        adapter.model,
        adapter.usb_ids.join(", "),
        adapter.latency_s * 1e3
    );
    if let Some(timer_s) = adapter.latency_timer_s {
        let _ = writeln!(
            out,
            "timer    {} ms as it is plugged in; the driver asks for less",
            timer_s * 1e3
        );
    }
    if let Some(ambiguous) = &adapter.ambiguous {
        let _ = writeln!(out, "not sure {ambiguous}");
    }
    let _ = writeln!(out, "source   {}", adapter.source);
    out
}
