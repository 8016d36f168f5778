//! What a person says of a capture that it does not say itself, as it is typed.

use crate::job::source::CaptureOptions;
use clap::Args;
use std::path::PathBuf;

/// How a capture is read.
#[derive(Clone, Debug, Args)]
pub struct ReadingArgs {
    /// File that says which joint of the capture is which body segment (TOML)
    #[arg(long, value_name = "FILE.toml")]
    pub mapping: Option<PathBuf>,
    /// Skeleton of an AMC file [default: the .asf file beside it that it is named after]
    #[arg(long, value_name = "FILE.asf")]
    skeleton: Option<PathBuf>,
    /// Trial in which the person stands still, for markers [default: the quietest half second of the motion]
    #[arg(long = "static", value_name = "FILE")]
    static_trial: Option<PathBuf>,
    /// Frames per second of an AMC file [default: what the file says, or 120] or of markers that do not say it
    #[arg(long, value_name = "HZ", allow_negative_numbers = true)]
    rate: Option<f64>,
}

impl ReadingArgs {
    /// The same as a job takes it.
    #[must_use]
    pub fn options(&self) -> CaptureOptions {
        CaptureOptions {
            skeleton: self.skeleton.clone(),
            rate_hz: self.rate,
            static_trial: self.static_trial.clone(),
        }
    }
}
