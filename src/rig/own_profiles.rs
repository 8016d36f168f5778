//! Folders of profiles of the user's own.

use crate::error::Error;
use std::path::{Path, PathBuf};

/// Makes the profiles in these folders known, and those in the usual one, if that is there:
/// `$XDG_CONFIG_HOME/gaitway/profiles`, or `~/.config/gaitway/profiles`. What lies beside a robot file is
/// found without.
///
/// # Errors
/// A folder that cannot be read, or a file in it whose name is taken.
pub fn own_profiles(folders: &[PathBuf]) -> Result<(), Error> {
    let usual = usual_folder().filter(|folder| folder.is_dir());
    for folder in folders.iter().chain(&usual) {
        gaitway_profiles::add_folder(Path::new(folder))?;
    }
    Ok(())
}

fn usual_folder() -> Option<PathBuf> {
    let config = std::env::var_os("XDG_CONFIG_HOME").filter(|folder| !folder.is_empty());
    let config = config.map(PathBuf::from).filter(|folder| folder.is_absolute());
    let home = || std::env::var_os("HOME").map(|home| PathBuf::from(home).join(".config"));
    Some(config.or_else(home)?.join("gaitway/profiles"))
}
