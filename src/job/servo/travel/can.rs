//! A movement of an actuator of a CAN line: which model it is, with what gains, and how it learns
//! that its host is gone.

use super::{MoveOrder, RAMP_S, SHARE, bare_joint, robot_of};
use crate::bus::can::Peer;
use crate::error::{Error, ErrorKind};
use crate::job::servo::actuator::Actuator;
use crate::rig::Connection;
use crate::robot::Link;
use gaitway_profiles::{self as profiles, LineKind};
use std::f64::consts::TAU;

/// Actuators that keep their numbers in revolutions go so far from their zero, rad: two turns.
const TWO_TURNS_RAD: f64 = 2.0 * TAU;
/// Of the range of coded numbers the last steps are left alone.
const INSIDE: f64 = 0.999;

/// A robot of one joint, which is the actuator itself, with its line open.
///
/// # Errors
/// Nobody answers; a model that is not known; gains that are missing, or that nobody is told.
pub fn alone(order: &MoveOrder) -> Result<(String, Connection), Error> {
    let actuator = Actuator::open(&order.which)?;
    let place = actuator.place();
    let profile = actuator.profile().cloned().ok_or_else(|| {
        let known: Vec<&str> = profiles::actuator_names().collect();
        Error::new("the actuator does not say which model it is, and its numbers depend on that")
            .at(place.clone())
            .got(actuator.model())
            .allowed(known.join(", "))
            .remedy("read its label, then add --model NAME")
    })?;
    check_gains(order, &profile).map_err(|e| e.at(place.clone()))?;
    let velocity_rad_s = order.speed_rad_s / SHARE;
    let (most_rad, most_rad_s) = match &profile.ranges {
        Some(ranges) => (ranges.position_rad * INSIDE, ranges.velocity_rad_s),
        None => (TWO_TURNS_RAD, f64::INFINITY),
    };
    let answer_id = match actuator.peer() {
        Peer::Damiao { answer_id, .. } => Some(answer_id),
        _ => None,
    };
    let joint = profiles::Joint {
        answer_id,
        kp_nm_rad: order.kp_nm_rad,
        kd_nm_s_rad: order.kd_nm_s_rad,
        timeout_configured_s: order.timeout_s,
        lower_rad: -most_rad,
        upper_rad: most_rad,
        velocity_rad_s: velocity_rad_s.min(most_rad_s),
        acceleration_rad_s2: velocity_rad_s / RAMP_S,
        ..bare_joint(actuator.peer().id(), &profile.name)
    };
    let kind = LineKind::Can(actuator.line.speed);
    let robot = robot_of(joint, kind, Vec::new()).map_err(|e| e.at(place.clone()))?;
    Ok((place, actuator.line.into_link(robot)?))
}

fn check_gains(order: &MoveOrder, profile: &profiles::Actuator) -> Result<(), Error> {
    let told = profile.dialect.codes_numbers();
    match (told, order.kp_nm_rad, order.kd_nm_s_rad) {
        (true, Some(_), Some(_)) | (false, None, None) => Ok(()),
        (true, ..) => Err(Error::new("this actuator needs its gains with every goal")
            .got("no --kp, or no --kd")
            .remedy(
                "start low, e.g. --kp 10 --kd 0.5 (N m/rad and N m s/rad at the output), with \
                 nobody's hand in the way",
            )),
        (false, ..) => Err(Error::new("the actuator keeps its own gains, and is told none")
            .got("--kp or --kd")
            .remedy("leave them out; the maker's tool sets them")),
    }
}

/// An actuator has no limits of its own: it goes no further than a turn.
///
/// # Errors
/// A goal more than a turn away.
pub fn refuse_far(link: &Link, place: &str, from_rad: f64, to_rad: f64) -> Result<(), Error> {
    let is_actuator = link.robot().joints.iter().any(|joint| joint.actuator().is_some());
    if !is_actuator || (to_rad - from_rad).abs() <= TAU {
        return Ok(());
    }
    Err(Error::of(ErrorKind::OutsideLimits, "the angle is more than a turn away")
        .at(place)
        .got(format!(
            "{:.1} deg; it stands at {:.1} deg",
            to_rad.to_degrees(),
            from_rad.to_degrees()
        ))
        .allowed("a turn at most"))
}
