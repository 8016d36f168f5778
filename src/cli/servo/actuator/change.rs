//! `servo set-id` and `servo reboot` for an actuator of a CAN line, and what cannot be done there.

use crate::cli::servo::identity::SetIdArgs;
use crate::cli::servo::reset::RebootArgs;
use crate::cli::terminal::Terminal;
use crate::cli::{Deed, Remarks};
use crate::error::Error;
use crate::job::servo::actuator::Actuator;
use crate::rig::dialect_name;
use serde_json::json;

/// Refuses a command of serial servos, in words.
///
/// # Errors
/// Always.
pub fn refuse(what: &str, bus: &dyn std::fmt::Display, remedy: &str) -> Result<i32, Error> {
    Err(Error::new(format!("{what} is not available on CAN lines"))
        .at(bus.to_string())
        .remedy(remedy))
}

/// Runs `servo set-id`.
///
/// # Errors
/// As [`Actuator::set_id`].
pub fn set_id(args: &SetIdArgs, remarks: Remarks) -> Result<i32, Error> {
    let mut actuator = Actuator::open(&args.target.which()?)?;
    let (old, new) = (actuator.peer().id(), args.new_id);
    actuator.set_id(new, args.permit_eeprom)?;
    let protocol = dialect_name(actuator.dialect());
    let undo = (new != old).then(|| {
        let (bus, again) = (actuator.bus(), args.target.again());
        format!(
            "gaitway servo set-id {bus} {new} {old} --protocol {protocol} --permit-eeprom{again}"
        )
    });
    if let Some(undo) = &undo {
        remarks.say(&format!("to undo: {undo}"));
    }
    let text = format!("{} now has ID {new} (before: {old})\n", actuator.model());
    let report = json!({
        "id_before": old, "id": new, "bus": actuator.bus(), "protocol": protocol, "undo": undo
    });
    Ok(args.target.output.conclude(&report, &text, Deed::Work, 0))
}

/// Runs `servo reboot`.
///
/// # Errors
/// As [`Actuator::reboot`], and an error that came back.
pub fn reboot(args: &RebootArgs, remarks: Remarks) -> Result<i32, Error> {
    let mut actuator = Actuator::open(&args.target.which()?)?;
    let back = actuator.reboot(args.yes, &Terminal::unheard(remarks))?;
    let text = format!("{} is back\n", actuator.place());
    let report = json!({
        "id": actuator.peer().id(), "torque_on": back.torque_on, "faulty": back.faulty
    });
    let code = args.target.output.conclude(&report, &text, Deed::Work, 0);
    if back.faulty {
        return Err(Error::new("an error came back at once").at(actuator.place()));
    }
    Ok(code)
}
