//! Which calibration a command uses.

use crate::error::Error;
use crate::rig::{Address, calibrated};
use crate::robot::Robot;
use clap::Args;
use std::path::{Path, PathBuf};

/// Which calibration is used.
#[derive(Clone, Debug, Default, Args)]
pub struct CalibrationArg {
    /// Calibration of this robot [default: the one `gaitway calibrate` wrote, if there is one;
    /// none for a virtual robot]
    #[arg(long, value_name = "FILE.toml")]
    calibration: Option<PathBuf>,
}

impl CalibrationArg {
    /// As [`calibrated()`].
    ///
    /// # Errors
    /// As [`calibrated()`].
    pub fn load(&self, name: &str, buses: &[Address]) -> Result<(Robot, Option<PathBuf>), Error> {
        calibrated(name, buses, self.path())
    }

    /// The file that was named.
    #[must_use]
    pub fn path(&self) -> Option<&Path> {
        self.calibration.as_deref()
    }
}
