//! The robot as it was calibrated: its file, and what was measured on this one.

use crate::calibration::{Calibration, usual_path};
use crate::error::Error;
use crate::rig::Address;
use crate::robot::Robot;
use clap::Args;
use std::path::PathBuf;

/// Which calibration is used.
#[derive(Clone, Debug, Default, Args)]
pub struct CalibrationArg {
    /// Calibration of this robot [default: the one `gaitway calibrate` wrote, if there is one;
    /// none for a virtual robot]
    #[arg(long, value_name = "FILE.toml")]
    calibration: Option<PathBuf>,
}

impl CalibrationArg {
    /// Loads the robot called `name` with its calibration, and says which file that was.
    ///
    /// A virtual robot of this process is as its file says: the calibration of the one on the desk
    /// is laid over it only if it is named.
    ///
    /// # Errors
    /// An unknown robot, or a calibration that is not its own.
    pub fn load(&self, name: &str, buses: &[Address]) -> Result<(Robot, Option<PathBuf>), Error> {
        let robot = Robot::load(name)?;
        let real = buses.iter().any(|address| !address.bus.is_virtual());
        let usual = || usual_path(&robot.name).filter(|path| real && path.exists());
        let Some(path) = self.calibration.clone().or_else(usual) else { return Ok((robot, None)) };
        let calibration = Calibration::read(&path)?;
        let at = |e: Error| if e.place.is_none() { e.at(path.display().to_string()) } else { e };
        Ok((robot.with_calibration(&calibration).map_err(at)?, Some(path)))
    }
}
