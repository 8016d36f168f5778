//! How every joint is, again and again. Reads only.

use super::observer::{Event, JointReading, Observer};
use super::report::OwnProfile;
use crate::bus::AskError;
use crate::device::{Health, JointState};
use crate::error::{Error, ErrorKind};
use crate::rig::{Address, calibrated, connect};
use crate::robot::preflight::same_models;
use crate::robot::{Link, LinkError};
use crate::time::Duration;
use gaitway_profiles::Role;
use std::path::PathBuf;

/// Whom to look at, and for how long.
#[derive(Clone, Debug, PartialEq)]
pub struct MonitorOrder {
    /// Robot by name, or path of its file.
    pub robot: String,
    /// Where its lines are.
    pub buses: Vec<Address>,
    /// Calibration of this robot; `None`: the one that was kept, if there is one.
    pub calibration: Option<PathBuf>,
    /// End after this time; `None`: when the observer wants to, in virtual time after one look.
    pub time: Option<Duration>,
    /// Looks per second at most, Hz.
    pub rate_hz: f64,
}

/// A joint is asked three times before it is called silent: nothing moves, and this machine may be busy.
const RETRIES: u32 = 2;
/// Budget of the first look: other programs are listened for before anything is told.
const FIRST: Duration = Duration::from_secs(2);
/// Meanwhile those speak who tell of themselves unasked.
const UNASKED: Duration = Duration::from_millis(150);
/// Budget of one question.
const QUESTION: Duration = Duration::from_millis(50);

/// Looks at a robot until the time is over or the observer wants to stop; each look is an event.
///
/// # Errors
/// A bus that cannot be opened, a servo of another model than the robot's file says, a line that is lost. A silent joint is a
/// reading that says so.
pub fn monitor(order: &MonitorOrder, observer: &dyn Observer) -> Result<(), Error> {
    let (robot, calibration) =
        calibrated(&order.robot, &order.buses, order.calibration.as_deref())?;
    if let Some(path) = calibration {
        observer.hear(Event::Note(&format!("calibration {}", path.display())));
    }
    for own in OwnProfile::of(&robot) {
        observer.hear(Event::Note(&format!("profile {own}")));
    }
    let mut connection = connect(robot, &order.buses, 0)?;
    let real_time = connection.real_time;
    let link = &mut connection.link;
    link.set_retries(RETRIES);
    let clock = std::sync::Arc::clone(link.clock());
    same_models(link)?;
    // CAN actuators that answer commands only are listened for first; that is not done again.
    let _ = answered(link.states(clock.now() + FIRST))?;
    clock.sleep_until(clock.now() + UNASKED);
    let began = clock.now();
    let once = if real_time { None } else { Some(Duration::ZERO) };
    let until = order.time.or(once).map(|time| began + time);
    loop {
        let at = clock.now();
        let joints = read(link)?;
        observer.hear(Event::Joints { time_s: at.since(began).as_secs_f64(), joints: &joints });
        let next = at + Duration::from_secs_f64(1.0 / order.rate_hz);
        if until.is_some_and(|until| next > until) || observer.wants_to_stop() {
            return Ok(());
        }
        clock.sleep_until(next);
    }
}

/// A question that one joint did not answer is that joint's matter; a line that is gone is not.
fn answered<T>(read: Result<T, LinkError>) -> Result<Result<T, String>, Error> {
    match read {
        Ok(value) => Ok(Ok(value)),
        Err(LinkError { error: AskError::Port(error), place, .. }) => {
            Err(Error::of(ErrorKind::Damaged, "the line failed").at(place).got(error.to_string()))
        }
        Err(error) => Ok(Err(error.error.to_string())),
    }
}

fn read(link: &mut Link) -> Result<Vec<JointReading>, Error> {
    let states = answered(link.states(link.clock().now() + 2 * QUESTION))?;
    let states = states.map_err(|e| Error::new("the robot cannot be asked").got(e))?;
    let mut readings = Vec::with_capacity(states.len());
    for (index, state) in states.into_iter().enumerate() {
        let joint = &link.robot().joints[index];
        let mut reading =
            JointReading { name: joint.name.clone(), id: joint.id, ..JointReading::default() };
        match state {
            Ok((state, _)) => {
                reading.take(&state);
                fill(link, index, &mut reading)?;
            }
            Err(miss) => reading.error = Some(miss.to_string()),
        }
        readings.push(reading);
    }
    Ok(readings)
}

/// Goal and slow facts of one joint.
fn fill(link: &mut Link, index: usize, reading: &mut JointReading) -> Result<(), Error> {
    let budget = link.clock().now() + QUESTION;
    if let Some(register) = link.robot().joints[index].register(Role::GoalPosition) {
        match answered(link.read_register(index, register, budget))? {
            Ok(raw) => {
                let joint = &link.robot().joints[index];
                let position_rad = joint.model()?.si_from_raw(register, raw);
                let goal = JointState { position_rad, ..JointState::default() };
                reading.goal_rad = Some(joint.joint_state(goal).position_rad);
            }
            Err(miss) => reading.error = Some(miss),
        }
    }
    for part in 0..link.health_reads(index) {
        let budget = link.clock().now() + QUESTION;
        match answered(link.health(index, part, budget))? {
            Ok(health) => {
                reading.take_health(&health);
                if let Some(bits) = health.error_bits.filter(|&bits| bits != 0) {
                    reading.error = Some(link.error_words(index, bits));
                }
            }
            Err(miss) => reading.error = Some(miss),
        }
    }
    Ok(())
}

impl JointReading {
    fn take(&mut self, state: &JointState) {
        self.present_rad = Some(state.position_rad);
        self.velocity_rad_s = state.velocity_rad_s;
        self.load_ratio = state.load_ratio;
        self.current_a = state.current_a;
        self.temperature_c = state.temperature_c;
        self.voltage_v = state.voltage_v;
    }

    fn take_health(&mut self, health: &Health) {
        self.torque_on = self.torque_on.or(health.torque_on);
        self.temperature_c = health.temperature_c.or(self.temperature_c);
        self.voltage_v = health.voltage_v.or(self.voltage_v);
    }
}
