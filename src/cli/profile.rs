//! `profile list`, `profile show`, `profile check`: what is known of devices, and whether a file
//! is right.

use crate::error::Error;
use clap::{Args, Subcommand};
use gaitway_profiles as profiles;
use std::fmt::Write;

/// Arguments of `profile`.
#[derive(Debug, Args)]
#[command(after_help = "Example: gaitway profile list")]
pub struct ProfileArgs {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    /// Servos and robots that come with gaitway
    #[command(after_help = "Example: gaitway profile list")]
    List,
    /// One servo's registers or one robot's joints
    #[command(after_help = "Example: gaitway profile show xm430-w350")]
    Show {
        /// Name of a servo or robot, or path of a robot file
        name: String,
    },
    /// Read a robot file and say what is wrong with it, if anything
    #[command(after_help = "Example: gaitway profile check my-robot.toml")]
    Check {
        /// Robot file, or name of a shipped one
        file: String,
    },
}

/// Runs `profile`.
///
/// # Errors
/// An unknown name, or a file that is wrong: what, where, got, allowed.
pub fn run(args: &ProfileArgs) -> Result<i32, Error> {
    let text = match &args.action {
        Action::List => list(),
        Action::Show { name } => show(name)?,
        Action::Check { file } => {
            let robot = profiles::robot(file).map_err(|e| Error::new(e.to_string()))?;
            let robot = crate::robot::Robot::new(robot)?;
            format!(
                "{}: right; {} joints on {} line(s)\n",
                robot.name,
                robot.joints.len(),
                robot.lines.len()
            )
        }
    };
    super::print(&text);
    Ok(0)
}

fn list() -> String {
    let mut out = String::from("servos\n");
    for name in profiles::servo_names() {
        if let Ok(servo) = profiles::servo(name) {
            let _ = writeln!(out, "  {name:<24} {} {}", servo.maker, servo.model);
        }
    }
    out.push_str("robots\n");
    for name in profiles::robot_names() {
        if let Ok(robot) = profiles::robot(name) {
            let _ = writeln!(out, "  {name:<24} {}", robot.description);
        }
    }
    out
}

fn show(name: &str) -> Result<String, Error> {
    if let Ok(servo) = profiles::servo(name) {
        return Ok(show_servo(servo));
    }
    let robot = profiles::robot(name).map_err(|e| Error::new(e.to_string()))?;
    Ok(show_robot(&robot))
}

fn show_servo(servo: &profiles::Servo) -> String {
    let mut out = format!(
        "{} {}, model number {}\nmanual {}\n\n{:>5} {:>5} {:<28} {:<6} {:<3} {:>10} {:<8} {}\n",
        servo.maker,
        servo.model,
        servo.model_number,
        servo.manual,
        "addr",
        "bytes",
        "register",
        "kept",
        "",
        "initial",
        "unit",
        "source"
    );
    for register in &servo.registers {
        let kept = if register.region == profiles::Region::Eeprom { "eeprom" } else { "ram" };
        let access = if register.access == profiles::Access::Rw { "rw" } else { "r" };
        let initial = register.initial.map_or_else(|| "-".to_owned(), |raw| raw.to_string());
        let unit = format!("{:?}", register.unit).to_lowercase();
        let _ = writeln!(
            out,
            "{:>5} {:>5} {:<28} {kept:<6} {access:<3} {initial:>10} {unit:<8} {}",
            register.address, register.bytes, register.name, register.source
        );
    }
    out
}

fn show_robot(robot: &profiles::Robot) -> String {
    let mut out = format!("{}: {}\nsource {}\n\n", robot.name, robot.description, robot.source);
    for line in &robot.lines {
        let _ = writeln!(out, "line {}: {} bit/s", line.name, line.baud_bps);
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
