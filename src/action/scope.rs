//! Joint actions, limb actions, group actions: which degrees of freedom may claim to be one.

use crate::body::{Dof, Joint};
use crate::error::Error;
use serde::Deserialize;

/// What a set of degrees of freedom claims to be (Zheng et al. 2007, Sec. 4).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// Coupled degrees of freedom of one joint.
    Joint,
    /// Two or more physically connected joints.
    Limb,
    /// Any set.
    Group,
    /// The whole body; what is not driven is at rest.
    Action,
}

impl Kind {
    /// Name in files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Joint => "joint",
            Self::Limb => "limb",
            Self::Group => "group",
            Self::Action => "action",
        }
    }

    /// Checks that `dofs` are what they claim to be.
    ///
    /// # Errors
    /// If there are none, a joint action has several joints, or a limb action has one joint only or
    /// joints that are not connected.
    pub fn admit(self, dofs: &[Dof]) -> Result<(), Error> {
        let mut joints: Vec<Joint> = dofs.iter().map(|dof| dof.joint()).collect();
        joints.sort_unstable();
        joints.dedup();
        let names = || joints.iter().map(|joint| format!("{joint:?}")).collect::<Vec<_>>();
        if dofs.is_empty() {
            return Err(Error::new(format!("a {} action moves nothing", self.name()))
                .allowed("at least one degree of freedom"));
        }
        if self == Self::Joint && joints.len() != 1 {
            return Err(Error::new("a joint action moves one joint")
                .got(names().join(", "))
                .allowed("degrees of freedom of one joint")
                .remedy("make it a limb or a group"));
        }
        if self == Self::Limb && !(joints.len() >= 2 && connected(&joints)) {
            return Err(Error::new("a limb action moves two or more connected joints")
                .got(names().join(", "))
                .allowed("joints that hang on one another, such as shoulder and elbow")
                .remedy("make it a joint or a group"));
        }
        Ok(())
    }
}

/// Connected means: exactly one of them hangs on a joint outside.
fn connected(joints: &[Joint]) -> bool {
    let hangs_outside =
        |joint: &&Joint| joint.parent().is_none_or(|parent| !joints.contains(&parent));
    joints.iter().filter(hangs_outside).count() == 1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_left_arm_is_a_limb_and_a_shoulder_a_joint() {
        let shoulder =
            [Dof::LeftShoulderFlexion, Dof::LeftShoulderAbduction, Dof::LeftShoulderRotation];
        let arm = [shoulder.as_slice(), &[Dof::LeftElbowFlexion]].concat();
        assert!(Kind::Joint.admit(&shoulder).is_ok());
        assert!(Kind::Limb.admit(&arm).is_ok());
        assert!(Kind::Joint.admit(&arm).is_err());
        assert!(Kind::Limb.admit(&shoulder).is_err());
        assert!(Kind::Group.admit(&arm).is_ok());
    }

    #[test]
    fn limbs_must_hang_together() {
        assert!(Kind::Limb.admit(&[Dof::LeftHipFlexion, Dof::LeftAnkleDorsiflexion]).is_err());
        assert!(Kind::Limb.admit(&[Dof::LeftHipFlexion, Dof::RightHipFlexion]).is_err());
        assert!(Kind::Limb.admit(&[Dof::TorsoFlexion, Dof::NeckFlexion]).is_ok());
        for kind in [Kind::Joint, Kind::Limb, Kind::Group, Kind::Action] {
            assert!(kind.admit(&[]).is_err(), "{kind:?}");
        }
    }
}
