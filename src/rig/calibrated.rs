//! A robot as it was calibrated: its file, and what was measured on this one.

use super::Address;
use crate::calibration::{Calibration, usual_path};
use crate::error::Error;
use crate::robot::Robot;
use std::path::{Path, PathBuf};

/// Loads the robot called `name` with its calibration, and says which file that was: `calibration`,
/// or the one that `gaitway calibrate` wrote.
///
/// A virtual robot of this process is as its file says: the calibration of the one on the desk is laid
/// over it only if it is named.
///
/// # Errors
/// An unknown robot, or a calibration that is not its own.
pub fn calibrated(
    name: &str,
    buses: &[Address],
    calibration: Option<&Path>,
) -> Result<(Robot, Option<PathBuf>), Error> {
    let robot = Robot::load(name)?;
    let real = buses.iter().any(|address| !address.bus.is_virtual());
    let usual = || usual_path(&robot.name).filter(|path| real && path.exists());
    let Some(path) = calibration.map(Path::to_owned).or_else(usual) else {
        return Ok((robot, None));
    };
    let calibration = Calibration::read(&path)?;
    let at = |e: Error| if e.place.is_none() { e.at(path.display().to_string()) } else { e };
    Ok((robot.with_calibration(&calibration).map_err(at)?, Some(path)))
}
