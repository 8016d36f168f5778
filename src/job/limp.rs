//! Torque off. The robot falls if nothing holds it: whoever orders this has asked.

use super::report::Outcome;
use crate::control;
use crate::error::Error;
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

/// Lets a robot go.
///
/// # Errors
/// A bus that cannot be opened, joints that do not confirm.
pub fn limp(robot: Robot, buses: &[Address]) -> Result<LimpReport, Error> {
    let mut connection = connect(robot, buses, 0)?;
    control::arm::disarm(&mut connection.link)?;
    let robot = connection.link.robot();
    let (name, limp) = (robot.name.clone(), robot.joint_names());
    Ok(LimpReport { outcome: Outcome::Done, robot: name, limp })
}
