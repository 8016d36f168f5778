//! Scripts of faults for virtual robots.

use crate::error::{Error, ErrorKind};
use gaitway_sim::{Script, ScriptError, SimError, World};
use std::path::Path;

/// Reads a script.
///
/// # Errors
/// A file that cannot be read, or is no script.
pub(super) fn read(path: &Path) -> Result<Script, Error> {
    let file = path.display().to_string();
    let text = gaitway_profiles::read_text(path)?;
    Script::parse(&text).map_err(|ScriptError { at, got, allowed }| {
        Error::new("the fault script has errors")
            .at(format!("{file}, {at}"))
            .got(got)
            .allowed(allowed)
    })
}

/// The faults of a script befall a world that is there, at their times of its clock.
///
/// # Errors
/// As [`read`]; a script that wants another world than this; a fault of what is not there.
pub(in crate::job) fn befall(world: &mut World, path: &Path) -> Result<(), Error> {
    let script = read(path)?;
    let place = || path.display().to_string();
    let sets = [
        ("seed", script.seed.is_some()),
        ("missing_in_chain", script.missing_in_chain.is_some()),
        ("bad_checksum", script.bad_checksum.is_some()),
        ("zero_speed", script.zero_speed.is_some()),
        ("torque_switch", script.torque_switch.is_some()),
    ];
    if let Some((key, _)) = sets.into_iter().find(|(_, is_set)| *is_set) {
        return Err(Error::of(ErrorKind::Malformed, "only faults befall a robot of this process")
            .at(place())
            .got(key)
            .allowed("[[fault]]")
            .remedy("take it out, or let `gaitway simulate ROBOT --faults` be the robot"));
    }
    world.begin(&script.faults).map_err(|error| {
        let said = Error::new(error.to_string()).at(place());
        match error {
            SimError::NeedsWeight(_) => said.remedy("add --physics, or take the fault out"),
            SimError::UnknownJoint(_) => said.allowed(world.joint_names().join(", ")),
            SimError::UnknownLine(_) => said.allowed(world.line_names().join(", ")),
            _ => said,
        }
    })?;
    Ok(())
}
