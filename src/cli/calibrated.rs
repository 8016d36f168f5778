//! Which calibration a command uses.

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
    /// The file that was named.
    #[must_use]
    pub fn path(&self) -> Option<&Path> {
        self.calibration.as_deref()
    }
}
