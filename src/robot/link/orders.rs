//! What is said to the CAN actuators of a link besides goals.

use super::{Link, LinkError};
use crate::time::{Duration, Instant};

impl Link {
    /// True if the actuator of `joint` says that it drives, or does not, as `wanted`. A servo's
    /// torque is a register like any other.
    pub(crate) fn torque_is(&mut self, joint: usize, wanted: bool) -> Result<bool, LinkError> {
        let told = self.can(joint)?.torque(joint, wanted);
        told.map_err(|e| self.joint_error(joint, e))
    }

    /// Switches the actuator of `joint` off and has it confirm that.
    pub(crate) fn limp(&mut self, joint: usize) -> Result<(), LinkError> {
        let limp = self.can(joint)?.limp(joint);
        limp.map_err(|e| self.joint_error(joint, e))
    }

    /// Prepares the drive of `joint` for its first goal. Nothing moves by it.
    pub(crate) fn prepare(&mut self, joint: usize, budget: Instant) -> Result<(), LinkError> {
        if self.robot.joints[joint].servo().is_some() {
            return Ok(());
        }
        let prepared = self.can(joint)?.prepare(joint, budget);
        prepared.map_err(|e| self.joint_error(joint, e))
    }

    /// Sets how long the host may be silent before the actuator of `joint` lets go, where the line
    /// can set it, and reads it back; none restores what was found. A servo's watchdog is a
    /// register like any other.
    pub(crate) fn watch_host(
        &mut self,
        joint: usize,
        silence: Option<Duration>,
        budget: Instant,
    ) -> Result<(), LinkError> {
        let set = self.can(joint)?.watch_host(joint, silence, budget);
        set.map_err(|e| self.joint_error(joint, e))
    }

    /// Bits of a setting of the actuator of `joint`.
    ///
    /// # Errors
    /// [`LinkError`]; [`crate::bus::AskError::Unsayable`] for a servo, and if the dialect has no such setting.
    pub fn read_setting(
        &mut self,
        joint: usize,
        number: u16,
        budget: Instant,
    ) -> Result<u32, LinkError> {
        let read = self.can(joint)?.read(joint, number, budget);
        read.map_err(|e| self.joint_error(joint, e))
    }

    /// Writes a setting of the actuator of `joint` until power-off; what it then reads.
    pub(crate) fn write_setting(
        &mut self,
        joint: usize,
        number: u16,
        bits: u32,
        budget: Instant,
    ) -> Result<u32, LinkError> {
        let written = self.can(joint)?.write(joint, number, bits, budget);
        written.map_err(|e| self.joint_error(joint, e))
    }
}
