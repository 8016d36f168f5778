//! Torque off. The robot falls if nothing holds it, so somebody is asked.

use super::report::Outcome;
use crate::control;
use crate::error::{Error, ErrorKind};
use crate::rig::{Address, connect};
use crate::robot::Robot;
use serde::Serialize;

/// Who went limp.
#[derive(Clone, Debug, Serialize)]
pub struct LimpReport {
    /// Done.
    pub outcome: Outcome,
    /// The robot's name.
    pub robot: String,
    /// Its joints, which confirmed that torque is off.
    pub limp: Vec<String>,
}

/// Lets a robot go if somebody who is asked says that it is supported; `robot` is its name, or the path of
/// its file.
///
/// # Errors
/// No consent, a bus that cannot be opened, joints that do not confirm.
pub fn limp(
    robot: &str,
    buses: &[Address],
    is_supported: impl FnOnce(&str) -> bool,
) -> Result<LimpReport, Error> {
    let robot = Robot::load(robot)?;
    if !is_supported(&robot.name) {
        return Err(Error::of(
            ErrorKind::NotPermitted,
            "nobody confirmed that the robot may go limp",
        )
        .remedy("support the robot, then answer yes at a terminal (a piped answer is none), or add --yes"));
    }
    let mut connection = connect(robot, buses, 0)?;
    control::arm::disarm(&mut connection.link)?;
    let robot = connection.link.robot();
    let (name, limp) = (robot.name.clone(), robot.joint_names());
    Ok(LimpReport { outcome: Outcome::Done, robot: name, limp })
}
