//! `servo`: one servo on a bus, its registers by the maker's names.

use super::{Output, Remarks};
use crate::cli::protocol::{ProtocolName, can_dialect, serial_protocol};
use crate::error::Error;
use crate::job::servo::Which;
use crate::rig::{Address, is_can};
use clap::{Args, Subcommand};

mod actuator;
mod identity;
mod registers;
mod reset;
mod travel;

/// Arguments of `servo`.
#[derive(Debug, Args)]
#[command(after_help = "Example: gaitway servo info serial:/dev/ttyUSB0 1")]
pub struct ServoArgs {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    /// Who the servo is, how it is set up and how it is
    #[command(after_help = "Examples:\n  gaitway servo info serial:/dev/ttyUSB0 1\n  \
        gaitway servo info can:can0 1")]
    Info(Target),
    /// Read one register, or all of them
    #[command(after_help = include_str!("help/servo.txt"))]
    Get(registers::GetArgs),
    /// Write one register and read it back
    #[command(after_help = include_str!("help/servo-2.txt"))]
    Set(registers::SetArgs),
    /// Give the servo another ID
    #[command(
        after_help = "Example: gaitway servo set-id serial:/dev/ttyUSB0 1 12 --permit-eeprom"
    )]
    SetId(identity::SetIdArgs),
    /// Give all servos of a robot's line their IDs and speed, one after the other as they are plugged in
    #[command(after_help = include_str!("help/servo-4.txt"))]
    SetUp(identity::SetUpArgs),
    /// Give the servo another line speed
    #[command(
        after_help = "Example: gaitway servo set-baud serial:/dev/ttyUSB0 1 2000000 --permit-eeprom"
    )]
    SetBaud(identity::SetBaudArgs),
    /// Restart the servo: errors are cleared, torque goes off
    #[command(after_help = "Example: gaitway servo reboot serial:/dev/ttyUSB0 1")]
    Reboot(reset::RebootArgs),
    /// Set every register to what the servo left the factory with
    #[command(
        after_help = "Example: gaitway servo factory-reset serial:/dev/ttyUSB0 1 --permit-eeprom"
    )]
    FactoryReset(reset::FactoryResetArgs),
    /// Turn the servo to an angle: one slow, guarded movement
    #[command(after_help = include_str!("help/servo-3.txt"))]
    Move(travel::MoveArgs),
    /// Torque on, where the servo stands, through everything a motion goes through; or off
    #[command(after_help = "Example: gaitway servo torque serial:/dev/ttyUSB0 1 off")]
    Torque(travel::TorqueArgs),
}

/// Which servo is meant, and how it is spoken to.
#[derive(Clone, Debug, Args)]
pub struct Target {
    /// Where the line is: serial:PATH[?baud=N], tcp:HOST:PORT, can:INTERFACE, sim or sim:pty
    bus: Address,
    /// The servo's ID
    id: u8,
    /// Robot whose line this is: says the line speed, and which robot a virtual one is
    #[arg(long, value_name = "ROBOT")]
    robot: Option<String>,
    /// Treat the servo as this model, whatever it says [default: by its model number]
    #[arg(long, visible_alias = "model", value_name = "PROFILE")]
    servo: Option<String>,
    /// Ask in this protocol only [default: all]
    #[arg(long, value_enum)]
    protocol: Option<ProtocolName>,
    #[command(flatten)]
    output: Output,
}

impl Target {
    /// Which servo that is.
    fn which(&self) -> Result<Which, Error> {
        let (protocol, dialect) = match self.is_can()? {
            true => (None, can_dialect(self.protocol, &self.bus)?),
            false => (serial_protocol(self.protocol, &self.bus)?, None),
        };
        Ok(Which {
            bus: self.bus.clone(),
            id: self.id,
            robot: self.robot.clone(),
            model: self.servo.clone(),
            protocol,
            dialect,
        })
    }

    /// What else has to be typed to reach the same line again.
    fn again(&self) -> String {
        self.robot.as_ref().map(|robot| format!(" --robot {robot}")).unwrap_or_default()
    }

    /// True if the line is a CAN line.
    fn is_can(&self) -> Result<bool, Error> {
        is_can(&self.bus, self.robot.as_deref())
    }
}

/// Runs `servo`.
///
/// # Errors
/// A servo that does not answer, or what it or we refuse.
pub fn run(args: &ServoArgs, remarks: Remarks) -> Result<i32, Error> {
    match &args.action {
        Action::Info(target) => registers::info(target),
        Action::Get(args) => registers::get(args),
        Action::Set(args) => registers::set(args, remarks),
        Action::SetId(args) => identity::set_id(args, remarks),
        Action::SetUp(args) => identity::set_up_all(args, remarks),
        Action::SetBaud(args) => identity::set_baud(args, remarks),
        Action::Reboot(args) => reset::reboot(args, remarks),
        Action::FactoryReset(args) => reset::factory_reset(args, remarks),
        Action::Move(args) => travel::run(args, remarks),
        Action::Torque(args) => travel::torque(args, remarks),
    }
}
