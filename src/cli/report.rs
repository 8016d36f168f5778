//! How jobs ended, as a shell reads it.

use crate::job::report::{PlayReport, Stop, StopCode};

pub use crate::job::report::Outcome;

impl Outcome {
    /// Exit code of the process.
    pub(in crate::cli) const fn exit_code(self) -> i32 {
        match self {
            Self::Done => 0,
            Self::Refused | Self::Failed => 1,
            Self::DoneWithLoss => 3,
            Self::Stopped => 4,
        }
    }
}

impl PlayReport {
    /// The exit code, given the first signal that came.
    pub(in crate::cli) fn exit_code(&self, signal: Option<i32>) -> i32 {
        match (signal, &self.stop) {
            (Some(number), Some(Stop { code: StopCode::Asked, .. })) => 128 + number,
            _ => self.outcome.exit_code(),
        }
    }
}
