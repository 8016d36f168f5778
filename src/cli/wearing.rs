//! Who wears which sensor, and how they are calibrated, as it is typed.

use crate::body::worn::Movement;
use crate::job::record::Mode;
use crate::sensing::Plan;
use crate::time::{Duration, duration};
use clap::{Args, ValueEnum};
use std::path::PathBuf;

/// Sensors that somebody wears.
#[derive(Clone, Debug, Args)]
pub struct WearingArgs {
    /// Which segment wears which sensor: SEGMENT=SENSOR, or a file that lists them
    #[arg(long, value_name = "SEGMENT=SENSOR|FILE.toml", num_args = 1..)]
    pub wear: Vec<String>,
    /// Calibration of the body: used if the file exists (N pose then finds the headings), otherwise
    /// made and saved there
    #[arg(long, value_name = "FILE.toml")]
    pub calibration_body: Option<PathBuf>,
    /// Make the calibration of the body anew, and replace the file
    #[arg(long, requires = "calibration_body")]
    pub recalibrate: bool,
    /// Who wears the sensors; kept with the calibration of the body
    #[arg(long, value_name = "NAME", default_value = "", hide_default_value = true)]
    subject: String,
    /// Begin N pose after this time, instead of with Enter [without a terminal: 3s]
    #[arg(long, value_name = "TIME", value_parser = duration)]
    n_pose_after: Option<Duration>,
    /// Do not ask for T pose
    #[arg(long)]
    no_t_pose: bool,
    /// Movements that find headings more precisely than poses alone
    #[arg(long, value_name = "MOVES", value_delimiter = ',')]
    moves: Vec<MoveArg>,
    /// Take headings from the magnetic field (not recommended indoors)
    #[arg(long)]
    magnetometer: bool,
}

/// Movements as they are typed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum MoveArg {
    /// Bow: pelvis, torso, head
    Bow,
    /// Sit down and stand up: thighs
    Sit,
    /// March, elbows bending: forearms, shanks, feet
    March,
    /// Raise both arms: upper arms
    Raise,
}

impl From<MoveArg> for Movement {
    fn from(typed: MoveArg) -> Self {
        match typed {
            MoveArg::Bow => Self::Bow,
            MoveArg::Sit => Self::SitToStand,
            MoveArg::March => Self::Bend,
            MoveArg::Raise => Self::RaiseArms,
        }
    }
}

impl WearingArgs {
    /// How the body is calibrated.
    pub fn plan(&self) -> Plan {
        Plan {
            n_pose_after: self.n_pose_after,
            t_pose: !self.no_t_pose,
            moves: self.moves.iter().map(|&typed| typed.into()).collect(),
            subject: self.subject.clone(),
        }
    }

    /// Which sensors headings are told from.
    pub const fn mode(&self) -> Mode {
        if self.magnetometer { Mode::NineAxes } else { Mode::SixAxes }
    }
}
