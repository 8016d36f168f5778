//! Torque on where the robot stands. Nothing moves.

use super::observer::Observer;
use super::report::{Outcome, OwnProfile};
use crate::control::left::{Left, leave};
use crate::control::{Arming, Stop, StopCode, StopReason, arm_safely, inject, net};
use crate::error::{Error, ErrorKind};
use crate::rig::{Address, calibrated, connect};
use crate::robot::Link;
use crate::robot::preflight::{Accept, budget, exchange_error, preflight};
use crate::time::Duration;
use serde::Serialize;
use std::path::PathBuf;

/// Which robot is to hold, and where.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct HoldOrder {
    /// Robot by name, or path of its file.
    pub robot: String,
    /// Where its lines are.
    pub buses: Vec<Address>,
    /// Calibration of this robot; `None`: the one that was kept, if there is one.
    pub calibration: Option<PathBuf>,
    /// Servos whose firmware the profile was not checked against are held too.
    pub accept_firmware: bool,
    /// Everything is checked, nothing written.
    pub dry_run: bool,
}

/// What became of it.
#[derive(Clone, Debug, Serialize)]
pub struct HoldReport {
    /// Done, or stopped before anything changed.
    pub outcome: Outcome,
    /// The robot's name.
    pub robot: String,
    /// Nothing was written.
    pub dry_run: bool,
    /// The calibration that was used.
    pub calibration: Option<PathBuf>,
    /// The user's own profiles it was made with.
    pub profiles: Vec<OwnProfile>,
    /// Where each joint is held.
    pub joints: Vec<HeldJoint>,
    /// How the robot was left.
    pub left: Option<Left>,
    /// Why it was stopped, in words.
    pub stop_reason: Option<String>,
    /// The same as data.
    pub stop: Option<Stop>,
    /// What else a person should know.
    pub notes: Vec<String>,
}

/// A joint that is held.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct HeldJoint {
    /// Its name.
    pub name: String,
    /// Where, rad.
    pub held_rad: f64,
}

/// Holds a robot where it stands.
///
/// # Errors
/// Anything preflight or arming has against it; torque is off then, or the joints are named.
pub fn hold(order: &HoldOrder, observer: &dyn Observer) -> Result<HoldReport, Error> {
    let (robot, calibration) =
        calibrated(&order.robot, &order.buses, order.calibration.as_deref())?;
    let period = Duration::from_secs_f64(1.0 / robot.file.rate_hz);
    let mut connection = connect(robot, &order.buses, 0)?;
    let link = &mut connection.link;
    inject::point("preflight", 0);
    let accept = Accept { firmware: order.accept_firmware, eeprom: false };
    let found = preflight(link, period, accept)?;
    let names = link.robot().joints.iter().map(|joint| joint.name.clone());
    let held = names.zip(&found.start_rad);
    let mut report = HoldReport {
        outcome: Outcome::Done,
        robot: link.robot().name.clone(),
        dry_run: order.dry_run,
        calibration,
        profiles: OwnProfile::of(link.robot()),
        joints: held.map(|(name, &held_rad)| HeldJoint { name, held_rad }).collect(),
        left: None,
        stop_reason: None,
        stop: None,
        notes: found.notes.clone(),
    };
    if order.dry_run {
        return Ok(report);
    }
    match arm_safely(link, &found, &|| observer.wants_to_stop())? {
        Arming::Done(armed) => {
            // Whatever ends at rest ends with two equal goals, so that a lost one changes nothing.
            let limit = budget(link);
            let written = net::catch(|| link.write_goals(armed.command(), limit));
            let written = match written {
                Ok(written) => written.map_err(|e| exchange_error(link, None, &e)),
                Err(words) => Err(broke(words)),
            };
            let (left, words) = left_alone(link, observer)?;
            if let Err(error) = written {
                words.iter().for_each(|note| observer.hear(super::Event::Note(note)));
                return Err(error);
            }
            report.notes.extend(words);
            report.left = Some(left);
        }
        Arming::Stopped => {
            let held = "it was held before, and still is";
            report.outcome = Outcome::Stopped;
            report.stop_reason = Some(StopReason::Asked.to_string());
            report.stop = Some(Stop::of(StopCode::Asked));
            report.joints.clear();
            report.notes = vec![if found.held { held } else { "torque stayed off" }.to_owned()];
        }
    }
    Ok(report)
}

/// Nobody speaks to the servos from here on, and they shall hold all the same.
fn left_alone(link: &mut Link, observer: &dyn Observer) -> Result<(Left, Vec<String>), Error> {
    net::catch(|| leave(link)).map_err(|words| {
        // Once more without whatever broke.
        let (_, notes) = leave(link);
        notes.iter().for_each(|note| observer.hear(super::Event::Note(note)));
        broke(words)
    })
}

fn broke(words: String) -> Error {
    Error::of(ErrorKind::Broke, "the program broke once the robot held")
        .got(words)
        .remedy("please report this")
}
