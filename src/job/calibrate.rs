//! A robot measured by hand: what its joints read, what is written into servos, and where the file is.

mod by_hand;
pub mod homing;
mod lerobot;
mod measure;
mod person;
pub mod reading;

pub use by_hand::{CalibrateOrder, CalibrateReport, JointMeasured, calibrate};
pub use lerobot::{LerobotOrder, LerobotWay, carry_over};
pub use person::{Answer, Consent, JointTask, Person, Seen};

use crate::calibration::{Calibration, JointCalibration};
use crate::control::inject;
use crate::device::actuator::Wanted;
use crate::draft::Draft;
use crate::error::{Error, ErrorKind};
use crate::robot::Link;
use crate::robot::preflight::{budget, exchange_error};
use gaitway_profiles::Role;
use reading::Measured;
use std::path::{Path, PathBuf};

/// Where a calibration is written while it is under way, and in the end.
#[derive(Clone, Debug)]
pub struct Files {
    /// When it is whole.
    pub file: PathBuf,
    /// While it is made.
    pub partial: PathBuf,
    before: PathBuf,
}

impl Files {
    /// Around this file.
    #[must_use]
    pub fn of(file: PathBuf) -> Self {
        let beside = |end: &str| {
            let mut name = file.clone().into_os_string();
            name.push(end);
            PathBuf::from(name)
        };
        Self { partial: beside(".partial"), before: beside(".before"), file }
    }
}

/// Another servo's counts would be taken for angles they are not.
///
/// # Errors
/// Another model, or numbers that mean something else.
pub fn check_models(link: &mut Link, joints: &[usize]) -> Result<(), Error> {
    for &joint in joints {
        let limit = budget(link);
        if link.robot().joints[joint].actuator().is_some() {
            check_actuator(link, joint)?;
            continue;
        }
        let identity = link.identity(joint, limit);
        let (model, _) = identity.map_err(|e| exchange_error(link, Some(joint), &e))?;
        let of = &link.robot().joints[joint];
        let profile = of.model()?.profile();
        if model != profile.model_number {
            return Err(Error::of(
                ErrorKind::NotReady,
                "the servo is not the model that the robot file says",
            )
            .at(format!("joint {}, ID {}", of.name, of.id))
            .got(format!("model number {model}"))
            .allowed(profile.model_number.to_string()));
        }
    }
    Ok(())
}

/// An actuator whose numbers mean something else tells angles that it does not stand at.
fn check_actuator(link: &mut Link, joint: usize) -> Result<(), Error> {
    let Some(actuator) = link.robot().joints[joint].actuator() else { return Ok(()) };
    for setting in actuator.settings() {
        let Wanted::Near(_) = setting.wanted else { continue };
        let limit = budget(link);
        let bits = link.read_setting(joint, setting.number, limit);
        let bits = bits.map_err(|e| exchange_error(link, Some(joint), &e))?;
        if !setting.wanted.holds(bits) {
            let of = &link.robot().joints[joint];
            return Err(Error::of(
                ErrorKind::NotReady,
                "an actuator means something else by its numbers",
            )
            .at(format!("joint {}, ID {}, {}", of.name, of.id, setting.name))
            .got(setting.wanted.words(bits))
            .remedy("correct the robot file's servo"));
        }
    }
    Ok(())
}

/// Whether a joint drives, if it says so.
///
/// # Errors
/// A joint that does not answer.
pub fn drives(link: &mut Link, joint: usize) -> Result<Option<bool>, Error> {
    let limit = budget(link);
    if link.robot().joints[joint].actuator().is_none() {
        let torque = link.read_raw(joint, Role::TorqueEnable, limit);
        return Ok(Some(torque.map_err(|e| exchange_error(link, Some(joint), &e))? != 0));
    }
    // Most tell it with their state.
    let limit = budget(link);
    link.whole_states(limit).map_err(|e| exchange_error(link, None, &e))?;
    let mut torque_on = None;
    for part in 0..link.health_reads(joint) {
        let limit = budget(link);
        let health = link.health(joint, part, limit);
        let health = health.map_err(|e| exchange_error(link, Some(joint), &e))?;
        torque_on = health.torque_on.or(torque_on);
    }
    Ok(torque_on)
}

/// What becomes of a measured joint: entries of the file, and what was written into the servo, if
/// `into_servo` says that its own offset is set.
///
/// # Errors
/// A range that goals cannot lead through, an offset the servo does not take.
pub fn settle(
    link: &mut Link,
    joint: usize,
    measured: &Measured,
    into_servo: bool,
    dry_run: bool,
) -> Result<(JointCalibration, Option<homing::Change>), Error> {
    let name = link.robot().joints[joint].name.clone();
    let range = measured.range_rad;
    let mut calibrated = JointCalibration {
        name,
        direction: measured.direction,
        offset_rad: measured.offset_rad,
        lower_rad: range.map(|(lower, _)| lower),
        upper_rad: range.map(|(_, upper)| upper),
        homing_offset_raw: None,
    };
    if !into_servo {
        measured.refuse_crossing(link, joint, 0)?;
        calibrated.homing_offset_raw = homing::in_force(link, joint)?;
        return Ok((calibrated, None));
    }
    let change = homing::plan(link, joint, measured)?;
    measured.refuse_crossing(link, joint, change.shift)?;
    if !dry_run {
        homing::write(link, joint, &change)?;
    }
    calibrated.offset_rad = change.offset_rad;
    calibrated.homing_offset_raw = Some(change.new);
    Ok((calibrated, Some(change).filter(|_| !dry_run)))
}

/// Writes what is known so far, whole or not at all.
///
/// # Errors
/// As the file system says.
pub fn save(path: &Path, calibration: &Calibration) -> Result<(), Error> {
    let failed = |e: std::io::Error| {
        Error::of(ErrorKind::Io, "the calibration cannot be written")
            .at(path.display().to_string())
            .got(e.to_string())
    };
    let text = calibration.text()?;
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder).map_err(failed)?;
    }
    // Whole or not at all, whatever happens in between.
    Draft::write_whole(path, true, text.as_bytes()).map_err(failed)
}

/// Puts the finished calibration in its place; how to undo that.
///
/// # Errors
/// As the file system says; what was there before is kept.
pub fn finish(files: &Files, calibration: &Calibration) -> Result<String, Error> {
    inject::point("save", 0);
    let (file, before) = (files.file.display(), files.before.display());
    let had_one = files.file.exists();
    if had_one {
        std::fs::rename(&files.file, &files.before).map_err(|e| {
            Error::new("what was there cannot be kept").at(before.to_string()).got(e.to_string())
        })?;
    }
    save(&files.file, calibration)?;
    let _ = std::fs::remove_file(&files.partial);
    Ok(if had_one { format!("mv {before} {file}") } else { format!("rm {file}") })
}
