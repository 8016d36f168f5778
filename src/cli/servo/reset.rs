//! `servo reboot` and `servo factory-reset`: the servo goes limp and comes back.

use super::{Target, actuator};
use crate::bus::{FactoryReset, Protocol};
use crate::cli::signals::Signals;
use crate::cli::{Deed, Remarks};
use crate::error::{Error, ErrorKind};
use crate::job::servo::change::{factory_terms, obeyed, refuse_taken_by_reset, set_back, wait_for};
use crate::job::servo::device::Device;
use clap::Args;
use gaitway_profiles::Role;
use serde_json::json;

/// Arguments of `servo reboot`.
#[derive(Debug, Args)]
pub struct RebootArgs {
    #[command(flatten)]
    pub(super) target: Target,
    /// Torque may go off: whatever the servo carries is supported
    #[arg(long)]
    pub(super) yes: bool,
}

/// Arguments of `servo factory-reset`.
#[derive(Debug, Args)]
pub struct FactoryResetArgs {
    #[command(flatten)]
    target: Target,
    /// Reset ID and line speed too: afterwards the servo answers where it did in the factory
    #[arg(long)]
    everything: bool,
    /// Allow writing what the servo keeps at power-off
    #[arg(long)]
    permit_eeprom: bool,
}

/// Runs `servo reboot`.
///
/// # Errors
/// A servo that cannot, that holds something, or that does not come back.
pub fn reboot(args: &RebootArgs, remarks: Remarks) -> Result<i32, Error> {
    args.target.output.check_files(&[])?;
    if args.target.is_can()? {
        return actuator::reboot(args, remarks);
    }
    let mut device = Device::open(&args.target.which()?)?;
    let protocol = device.model.protocol();
    if protocol != Protocol::Dynamixel2 {
        return Err(Error::new("this protocol has no instruction to restart a servo")
            .at(device.place())
            .got(protocol.to_string())
            .remedy("switch its power off and on"));
    }
    if device.torque_on()? && !args.yes {
        return Err(Error::of(
            ErrorKind::NotPermitted,
            "the servo holds something: restarting lets it go",
        )
        .at(device.place())
        .remedy("support what it carries, then add --yes"));
    }
    let errors_before = device.read_role(Role::HardwareError)?;
    let (id, budget) = (device.id, device.line.budget());
    let told = device.line.bus.reboot(protocol, id, budget);
    obeyed(told).map_err(|e| device.failed(&e))?;
    remarks.say("restarting ...");
    let back = wait_for(&mut device, id)?;
    let errors = device.read_role(Role::HardwareError)?;
    let torque_on = device.torque_on()?;
    let text = format!(
        "{} is back, firmware {}; torque is {}\n",
        device.place(),
        back.firmware,
        if torque_on { "on" } else { "off" }
    );
    let report = json!({
        "id": id, "firmware": back.firmware, "torque_on": torque_on,
        "error_bits_before": errors_before, "error_bits": errors,
    });
    let code = args.target.output.conclude(&report, &text, Deed::Work, 0);
    if errors.is_some_and(|bits| bits != 0) {
        return Err(Error::new("the error came back at once")
            .at(device.place())
            .remedy("`gaitway servo info` says which; find its cause"));
    }
    Ok(code)
}

/// Runs `servo factory-reset`.
///
/// # Errors
/// No permit, torque on, a servo that cannot keep its ID while asked to, or that does not come
/// back.
pub fn factory_reset(args: &FactoryResetArgs, remarks: Remarks) -> Result<i32, Error> {
    args.target.output.check_files(&[])?;
    if args.target.is_can()? {
        let remedy = "the maker's tool does it";
        return actuator::refuse("setting an actuator back", &args.target.bus, remedy);
    }
    Signals::defer()?;
    let mut device = Device::open(&args.target.which()?)?;
    let protocol = device.model.protocol();
    let (old_id, old_bps) = (device.id, device.line.baud_bps);
    if protocol != Protocol::Dynamixel2 && !args.everything {
        return Err(Error::new("this servo can only be reset with its ID and line speed")
            .at(device.place())
            .got(protocol.to_string())
            .remedy("unplug every other servo first, then add --everything"));
    }
    let (id, bps) = if args.everything { factory_terms(&device)? } else { (old_id, old_bps) };
    let what = format!(
        "every register of {} becomes what it left the factory with; afterwards it has ID {id} at \
         {bps} bit/s",
        device.place()
    );
    if !args.permit_eeprom {
        return Err(Error::of(
            ErrorKind::NotPermitted,
            "nothing was written: this is kept at power-off",
        )
        .at(device.place())
        .got(what)
        .remedy(
            "save what you need (`gaitway servo get BUS ID --json`), then add \
                     --permit-eeprom",
        ));
    }
    remarks.say(&what);
    device.must_be_limp()?;
    if id != old_id {
        refuse_taken_by_reset(&mut device, id)?;
    }
    let keep = if args.everything { FactoryReset::Everything } else { FactoryReset::KeepIdAndBaud };
    let back = set_back(&mut device, keep, id, bps)?;
    let text = format!(
        "{} is as it left the factory, firmware {}, at {bps} bit/s\n",
        device.place(),
        back.firmware
    );
    let report = json!({
        "id_before": old_id, "id": id, "baud_bps_before": old_bps, "baud_bps": bps,
        "firmware": back.firmware,
    });
    Ok(args.target.output.conclude(&report, &text, Deed::Work, 0))
}
