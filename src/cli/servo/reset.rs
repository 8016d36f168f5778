//! `servo reboot` and `servo factory-reset`: the servo goes limp and comes back.

use super::{Target, actuator};
use crate::cli::signals::Signals;
use crate::cli::terminal::Terminal;
use crate::cli::{Deed, Remarks};
use crate::error::Error;
use crate::job::servo::change;
use crate::job::servo::device::Device;
use clap::Args;
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
/// As [`change::reboot`], and an error that came back.
pub fn reboot(args: &RebootArgs, remarks: Remarks) -> Result<i32, Error> {
    args.target.output.check_files(&[])?;
    if args.target.is_can()? {
        return actuator::reboot(args, remarks);
    }
    let mut device = Device::open(&args.target.which()?)?;
    let back = change::reboot(&mut device, args.yes, &Terminal::unheard(remarks))?;
    let text = format!(
        "{} is back, firmware {}; torque is {}\n",
        device.place(),
        back.firmware,
        if back.torque_on { "on" } else { "off" }
    );
    let report = json!({
        "id": device.id, "firmware": back.firmware, "torque_on": back.torque_on,
        "error_bits_before": back.errors_before, "error_bits": back.errors,
    });
    let code = args.target.output.conclude(&report, &text, Deed::Work, 0);
    if back.errors.is_some_and(|bits| bits != 0) {
        return Err(Error::new("the error came back at once")
            .at(device.place())
            .remedy("`gaitway servo info` says which; find its cause"));
    }
    Ok(code)
}

/// Runs `servo factory-reset`.
///
/// # Errors
/// As [`change::factory_reset`].
pub fn factory_reset(args: &FactoryResetArgs, remarks: Remarks) -> Result<i32, Error> {
    args.target.output.check_files(&[])?;
    if args.target.is_can()? {
        let remedy = "the maker's tool does it";
        return actuator::refuse("setting an actuator back", &args.target.bus, remedy);
    }
    Signals::defer()?;
    let mut device = Device::open(&args.target.which()?)?;
    let terminal = Terminal::unheard(remarks);
    let now = change::factory_reset(&mut device, args.everything, args.permit_eeprom, &terminal)?;
    let text = format!(
        "{} is as it left the factory, firmware {}, at {} bit/s\n",
        device.place(),
        now.firmware,
        now.baud_bps
    );
    let report = json!({
        "id_before": now.id_before, "id": now.id, "baud_bps_before": now.baud_bps_before,
        "baud_bps": now.baud_bps, "firmware": now.firmware,
    });
    Ok(args.target.output.conclude(&report, &text, Deed::Work, 0))
}
