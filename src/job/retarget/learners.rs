//! A motion on a robot as those who learn from it read it: the motion alone, at even times, with the base.

use super::super::npz;
use super::super::source::untitled;
use super::RobotClip;
use crate::error::{Error, ErrorKind};
use crate::rigid::Placement;
use crate::robot::{Robot, RobotBody};
use crate::table::TableWriter;

/// In which form.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LearnerFile {
    /// A table without titles: base (x y z, m; qx qy qz qw) and joints (rad) in the order of the robot's file, 30 rows a
    /// second, as Unitree's retargeted LAFAN1 has them.
    RobotCsv,
    /// The same of a robot that has the 29 joints of Unitree's G1, in Unitree's order.
    UnitreeCsv,
    /// The places, turns and velocities of joints and links, 50 frames a second: a `.npz` as `BeyondMimic` and mjlab read it.
    RobotNpz,
}

impl LearnerFile {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::RobotCsv, Self::RobotNpz, Self::UnitreeCsv];

    /// As a word.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::RobotCsv => "robot-csv",
            Self::UnitreeCsv => "unitree-csv",
            Self::RobotNpz => "robot-npz",
        }
    }

    /// What the name of such a file ends in.
    #[must_use]
    pub const fn ending(self) -> &'static str {
        match self {
            Self::RobotCsv | Self::UnitreeCsv => "csv",
            Self::RobotNpz => "npz",
        }
    }

    /// Rows a second, unless others are asked for.
    #[must_use]
    pub const fn rate_hz(self) -> f64 {
        match self {
            Self::RobotCsv | Self::UnitreeCsv => untitled::RATE_HZ,
            Self::RobotNpz => 50.0,
        }
    }

    /// The joints of a robot in the order of the file.
    ///
    /// # Errors
    /// A robot that has not the joints of Unitree's G1, if those are asked for.
    pub(in crate::job) fn joints(self, robot: &Robot) -> Result<Vec<String>, Error> {
        let names = robot.joint_names();
        if self != Self::UnitreeCsv {
            return Ok(names);
        }
        untitled::unitree_order(&names).ok_or_else(|| {
            let missing = untitled::first_missing(&names).unwrap_or_default();
            Error::of(ErrorKind::Unknown, "the robot has not the joints of Unitree's G1")
                .at(robot.name.clone())
                .got(format!("no {missing}"))
                .allowed("a robot with its 29 joints, by its names")
                .remedy(
                    "--format robot-csv writes the joints of any robot, in the order of its file",
                )
        })
    }

    /// The file of a motion whose rows follow at `rate_hz`.
    ///
    /// # Errors
    /// A base of which nobody knows where it goes; joints as in [`Self::joints`]; frames of which there is no whole
    /// number in a second, where the file has room for no other.
    pub(in crate::job) fn bytes(
        self,
        robot: &Robot,
        clip: &RobotClip,
        rate_hz: f64,
    ) -> Result<Vec<u8>, Error> {
        let unknown = |what: &str| {
            Error::new(format!("{what} of this robot is not known"))
                .at(robot.name.clone())
                .allowed("a robot whose file has a [body]")
        };
        if !clip.has_base {
            return Err(unknown("the way of the base"));
        }
        let names = robot.joint_names();
        if self == Self::RobotNpz {
            if rate_hz.fract() != 0.0 {
                return Err(Error::new("this file knows whole frames a second only")
                    .at("--rate")
                    .got(format!("{rate_hz} Hz"))
                    .allowed("a whole number, 50 where none is named"));
            }
            let body = RobotBody::of(&robot.file)?.ok_or_else(|| unknown("the body"))?;
            return Ok(npz::written(&body, &names, &clip.rows, rate_hz as u32));
        }
        let joints = self.joints(robot)?;
        let place_of = |name: &String| names.iter().position(|known| known == name);
        let order: Vec<usize> = joints.iter().filter_map(place_of).collect();
        let mut table = TableWriter::new(Vec::new());
        for (Placement { at_m, turn }, angles_rad) in &clip.rows {
            let place = at_m.to_array().into_iter().chain(turn.to_array());
            let joints = order.iter().map(|joint| angles_rad[*joint]);
            table.row(place.chain(joints).map(|value| format!("{value:.6}")))?;
        }
        table.finish()
    }
}
