//! From limp to holding: goal = present before torque, read back at every step.

use crate::error::Error;
use crate::guard::{Command, Guard};
use crate::robot::Link;
use crate::robot::preflight::{Preflight, budget, exchange_error};
use gaitway_profiles::Role;

/// Largest distance between goal and present when torque comes on, rad.
const HOLD_RAD: f64 = 0.02;

/// Switches torque on with every joint told to stay where it is.
///
/// Also writes what the robot file wants in RAM, and the servos' own speed limit, so that a servo
/// whose host dies never moves faster than its joint may.
///
/// # Errors
/// A servo that does not take or keep what is written. Torque is off again on every joint then.
pub fn arm(link: &mut Link, preflight: &Preflight) -> Result<(Guard, Command), Error> {
    let limits = link.robot().limits();
    let now = link.clock().now();
    let (guard, command) =
        Guard::standing_at(&preflight.start_rad, limits, now).map_err(|refusal| {
            Error::new("the guard refuses the start pose")
                .at(format!("joint {}", link.robot().joints[refusal.joint].name))
                .got(refusal.reason.to_string())
        })?;
    match switch_on(link, preflight, &command) {
        Ok(()) => Ok((guard, command)),
        Err(error) => {
            // Nothing has moved yet, so limp is where the robot already was.
            let _ = disarm(link);
            Err(error)
        }
    }
}

fn switch_on(link: &mut Link, preflight: &Preflight, command: &Command) -> Result<(), Error> {
    for &(joint, register, raw) in &preflight.to_write {
        let limit = budget(link);
        let written = link.write_raw(joint, register, raw, limit);
        written.map_err(|e| exchange_error(link, Some(joint), &e))?;
        expect_raw(link, joint, register.role.unwrap_or(Role::TorqueEnable), register, raw)?;
    }
    for role in [Role::ProfileVelocity, Role::GoalVelocity] {
        limit_speed(link, role)?;
    }
    let limit = budget(link);
    link.write_goals(command, limit).map_err(|e| exchange_error(link, None, &e))?;
    for joint in 0..link.robot().joints.len() {
        let register = link.robot().joints[joint].model.register(Role::GoalPosition);
        let register = register.map_err(|e| Error::new(e.to_string()))?;
        let limit = budget(link);
        let raw = link.read_register(joint, register, limit);
        let raw = raw.map_err(|e| exchange_error(link, Some(joint), &e))?;
        let of = &link.robot().joints[joint];
        let goal_rad = of.model.si_from_raw(register, raw);
        let wanted_rad = of.servo_rad(command.goal_rad()[joint]);
        if !((goal_rad - wanted_rad).abs() <= HOLD_RAD) {
            return Err(Error::new("a servo did not keep its goal; torque stays off")
                .at(format!("joint {}", of.name))
                .got(format!("{:.2} deg", goal_rad.to_degrees()))
                .allowed(format!("{:.2} deg", wanted_rad.to_degrees())));
        }
    }
    check_where_it_was(link, command)?;
    set_torque(link, true)
}

/// Torque moves a joint to its goal: it must still be there.
fn check_where_it_was(link: &mut Link, command: &Command) -> Result<(), Error> {
    let limit = budget(link);
    let states = link.states(limit).map_err(|e| exchange_error(link, None, &e))?;
    for (index, (state, goal)) in states.iter().zip(command.goal_rad()).enumerate() {
        let joint = &link.robot().joints[index];
        let off = state.as_ref().map(|(state, _)| (state.position_rad - goal).abs());
        if !off.as_ref().is_ok_and(|off| *off <= HOLD_RAD) {
            return Err(Error::new("a joint moved before torque came on; torque stays off")
                .at(format!("joint {}", joint.name))
                .got(off.map_or_else(
                    |miss| miss.to_string(),
                    |off| format!("{:.1} deg from where it was", off.to_degrees()),
                ))
                .allowed(format!("{:.1} deg", HOLD_RAD.to_degrees()))
                .remedy("hold the robot still, or support it, and start again"));
        }
    }
    Ok(())
}

/// Tells servos that have a speed register for position moves not to exceed the joint's limit.
fn limit_speed(link: &mut Link, role: Role) -> Result<(), Error> {
    // A Dynamixel's Goal Velocity acts in velocity mode only; its moves obey Profile Velocity.
    let has_profile = |joint: &crate::robot::Joint| {
        joint.model.register(Role::ProfileVelocity).is_ok() == (role == Role::ProfileVelocity)
            && joint.model.register(role).is_ok()
    };
    if !link.robot().joints.iter().all(has_profile) {
        return Ok(());
    }
    let limit = budget(link);
    link.write_all(role, limit, |joint, _| joint.limits.velocity_rad_s())
        .map_err(|e| exchange_error(link, None, &e))
}

fn expect_raw(
    link: &mut Link,
    joint: usize,
    role: Role,
    register: &gaitway_profiles::Register,
    wanted: i64,
) -> Result<(), Error> {
    let limit = budget(link);
    let raw = link.read_register(joint, register, limit);
    let raw = raw.map_err(|e| exchange_error(link, Some(joint), &e))?;
    if raw == wanted {
        return Ok(());
    }
    Err(Error::new("a servo did not keep what was written")
        .at(format!("joint {}, {role:?} ({})", link.robot().joints[joint].name, register.name))
        .got(raw.to_string())
        .allowed(wanted.to_string()))
}

/// Switches torque on or off on every joint, and reads it back.
fn set_torque(link: &mut Link, on: bool) -> Result<(), Error> {
    let value = f64::from(u8::from(on));
    let limit = budget(link);
    link.write_all(Role::TorqueEnable, limit, |_, _| value)
        .map_err(|e| exchange_error(link, None, &e))?;
    for joint in 0..link.robot().joints.len() {
        let register = link.robot().joints[joint].model.register(Role::TorqueEnable);
        let register = register.map_err(|e| Error::new(e.to_string()))?;
        expect_raw(link, joint, Role::TorqueEnable, register, i64::from(on))?;
    }
    Ok(())
}

/// Switches torque off on every joint: the robot goes limp.
///
/// # Errors
/// A servo that does not confirm.
pub fn disarm(link: &mut Link) -> Result<(), Error> {
    set_torque(link, false)
}
