//! Whether a profile can be used for what it is there for: more than that its file has the form of one.

use crate::device::sensor::stream_format;
use crate::error::Error;
use crate::robot::Robot;
use gaitway_profiles::Profile;

/// Asks for what playing needs of a robot's servos, and recording of a sensor.
///
/// # Errors
/// What is missing.
pub fn check_use(profile: &Profile) -> Result<(), Error> {
    match profile {
        Profile::Robot(robot) => Robot::new(robot.as_ref().clone()).map(drop),
        Profile::Sensor(sensor) => stream_format(sensor).map(drop),
        Profile::Servo(_) | Profile::Actuator(_) | Profile::Adapter(_) => Ok(()),
    }
}
