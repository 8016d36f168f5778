//! `profile list`, `profile show`, `profile check`: what is known of devices, and whether a file
//! is right.

use super::{Deed, Output};
use crate::error::Error;
use crate::job::profile::{ProfileList, check, words};
use clap::{Args, Subcommand};
use gaitway_profiles as profiles;
use profiles::Profile;

/// Arguments of `profile`.
#[derive(Debug, Args)]
#[command(after_help = "Example: gaitway profile list")]
pub struct ProfileArgs {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    /// Servos, CAN actuators, sensors, robots and adapters that come with gaitway
    #[command(after_help = "Example: gaitway profile list")]
    List {
        #[command(flatten)]
        output: Output,
    },
    /// One servo's registers, one CAN actuator, one sensor's channels, one robot's joints or one adapter
    #[command(after_help = "Example: gaitway profile show xm430-w350")]
    Show {
        /// Name of a shipped profile, or path of a file
        name: String,
        #[command(flatten)]
        output: Output,
    },
    /// Read a servo, CAN actuator, sensor, robot or adapter file, say what is wrong with it and what is
    /// unconfirmed
    #[command(after_help = "Example: gaitway profile check my-robot.toml")]
    Check {
        /// The file, or name of a shipped profile
        file: String,
        #[command(flatten)]
        output: Output,
    },
}

/// Runs `profile`.
///
/// # Errors
/// An unknown name, or a file that is wrong: what, where, got, allowed.
pub fn run(args: &ProfileArgs) -> Result<i32, Error> {
    match &args.action {
        Action::List { output } => {
            let list = ProfileList::of_all()?;
            Ok(output.conclude(&list, &words::listed(&list), Deed::Look, 0))
        }
        Action::Show { name, output } => {
            let text = words::shown(&load(name)?);
            // A program gets the file itself, in its own units, with every source.
            Ok(output.conclude(&profiles::whole_table(name)?, &text, Deed::Look, 0))
        }
        Action::Check { file, output } => {
            let checked = check(&load(file)?)?;
            Ok(output.conclude(&checked, &words::checked(&checked), Deed::Look, 0))
        }
    }
}

fn load(name_or_path: &str) -> Result<Profile, Error> {
    Ok(profiles::profile(name_or_path)?)
}
