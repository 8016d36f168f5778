//! Which motion, as it is typed.

use super::inserts::InsertArgs;
use crate::job::play::SPEEDS;
use crate::job::source::{CaptureOptions, MotionOrder};
use clap::Args;
use std::path::PathBuf;

/// Which motion, for which robot, and how much of it.
#[derive(Clone, Debug, Args)]
pub struct MotionArgs {
    /// A capture (.bvh, .amc), markers (.c3d, .trc, .csv), an action that ships with gaitway (walk), an
    /// action file (.toml), several actions (walk:6s,wave-r,bow; two gaits without a stop:
    /// walk:6s+run:5s), or a motion of the robot's own joints: a recording (.mcap), such as one guided by hand, a table (.csv: time_s,
    /// then JOINT_rad for each joint that moves, rows at most 0.5 s apart, or key frames; or without titles as Unitree's LAFAN1), or an episode of a
    /// LeRobot dataset (FOLDER#3)
    motion: String,
    /// Robot by name, or path of its file (see `gaitway profile list`)
    #[arg(long)]
    robot: String,
    /// File that says which joint of the capture is which body segment (TOML)
    #[arg(long, value_name = "FILE.toml")]
    mapping: Option<PathBuf>,
    /// Skeleton of an AMC file [default: the .asf file beside it that it is named after]
    #[arg(long, value_name = "FILE.asf")]
    skeleton: Option<PathBuf>,
    /// Trial in which the person stands still, for markers [default: the quietest half second of the
    /// motion]
    #[arg(long = "static", value_name = "FILE")]
    static_trial: Option<PathBuf>,
    /// Frames per second of an AMC file [default: what the file says, or 120], or of markers that do not
    /// say it
    #[arg(long, value_name = "HZ", allow_negative_numbers = true)]
    capture_rate: Option<f64>,
    #[command(flatten)]
    inserts: InsertArgs,
    /// Playing speed: 0.5 is half as fast as recorded
    #[arg(long, value_name = "X", default_value_t = 1.0, value_parser = speed,
          allow_negative_numbers = true)]
    speed: f64,
    /// Play from this time of the capture, s
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    from: Option<f64>,
    /// Play to this time of the capture, s
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    to: Option<f64>,
    /// Move only these joints (comma between names); the others stay where they are
    #[arg(long, value_name = "JOINTS", value_delimiter = ',')]
    only: Vec<String>,
    /// Swap left and right
    #[arg(long)]
    mirror: bool,
    /// Slow the motion down until the robot can follow (the default for what a person did)
    #[arg(long, conflicts_with = "no_retime")]
    retime: bool,
    /// Refuse a motion the robot cannot follow at the speed asked for
    #[arg(long)]
    no_retime: bool,
    /// The robot hangs on a stand: its base stays where it is, and it cannot fall
    #[arg(long)]
    hang: bool,
    /// A robot on its own feet may fall: what it cannot do upright stays as near to the person as it can,
    /// and does not wait for the robot's feet. Without this a real robot is not sent into a fall
    #[arg(long, conflicts_with = "hang")]
    allow_fall: bool,
}

/// Reads `--speed`.
fn speed(text: &str) -> Result<f64, String> {
    let speed: f64 = text.parse().map_err(|_| "not a number".to_owned())?;
    if SPEEDS.contains(&speed) {
        Ok(speed)
    } else {
        Err(format!("allowed: {} to {}", SPEEDS.start(), SPEEDS.end()))
    }
}

impl MotionArgs {
    /// What is to be loaded.
    #[must_use]
    pub fn order(&self) -> MotionOrder {
        MotionOrder {
            motion: self.motion.clone(),
            inserts: self.inserts.order(),
            mapping: self.mapping.clone(),
            reading: CaptureOptions {
                skeleton: self.skeleton.clone(),
                rate_hz: self.capture_rate,
                static_trial: self.static_trial.clone(),
            },
            from_s: self.from,
            to_s: self.to,
            only: self.only.clone(),
            mirror: self.mirror,
            hangs: self.hang,
            balanced_at: None,
            may_fall: self.allow_fall,
        }
    }

    /// Whether it is to be slowed down, if that was said.
    #[must_use]
    pub fn retime(&self) -> Option<bool> {
        match (self.retime, self.no_retime) {
            (_, true) => Some(false),
            (true, _) => Some(true),
            _ => None,
        }
    }

    /// The robot as typed.
    #[must_use]
    pub fn robot(&self) -> &str {
        &self.robot
    }

    /// Whether it hangs on a stand.
    #[must_use]
    pub const fn hangs(&self) -> bool {
        self.hang
    }

    /// Whether it may fall.
    #[must_use]
    pub const fn allows_fall(&self) -> bool {
        self.allow_fall
    }

    /// Playing speed.
    #[must_use]
    pub const fn speed(&self) -> f64 {
        self.speed
    }
}
