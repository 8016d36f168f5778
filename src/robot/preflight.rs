//! Everything that is checked before torque: identity, configuration, health, start pose and
//! line speed. Reads only.

mod actuator;
mod line;
mod mode;

pub use super::reading::LINE_SHARE;
pub use line::EepromWrite;

use super::reading::LinePlan;
use super::{Joint, Link, LinkError, ServoDrive};
use crate::bus::{AskError, Miss};
use crate::error::{Error, ErrorKind};
use crate::port::PortError;
use crate::time::{Duration, Instant};
use gaitway_profiles::{Region, Register, Role};

/// What preflight found. Nobody but [`preflight`] can make one, so nothing moves without:
///
/// ```compile_fail,E0639
/// let invented = gaitway::robot::preflight::Preflight { start_rad: vec![0.0; 20] };
/// ```
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Preflight {
    /// The robot, by name.
    pub robot: String,
    /// Where each joint stands, rad.
    pub start_rad: Vec<f64>,
    /// Firmware of each joint's servo.
    pub firmware: Vec<u16>,
    /// Highest rate the slowest line can carry if nothing else were said on it, by computation, Hz.
    pub wire_limit_hz: f64,
    /// Share of the time the slowest line will be busy, by computation.
    pub bus_load: f64,
    /// How each line is read.
    pub lines: Vec<LinePlan>,
    /// Time between two cycles.
    pub period: Duration,
    /// Things a person should know that do not stop the motion.
    pub notes: Vec<String>,
    /// True if some joint had torque on already: the robot is held, and taken over as it stands.
    pub held: bool,
    /// Registers in RAM that differ from the robot file and will be written: joint, register, raw.
    pub to_write: Vec<(usize, &'static Register, i64)>,
    /// Joints whose bus watchdog has stopped the servo, and its register. Such a servo takes no goal
    /// until it is cleared, and what it does then with its old goal is not known.
    pub latched: Vec<(usize, &'static Register)>,
    /// Registers in EEPROM that will be written, with the user's permit.
    pub eeprom: Vec<EepromWrite>,
    /// Settings of CAN actuators that differ from what goals need and will be written, until
    /// power-off: joint, number, bits.
    pub settings: Vec<(usize, u16, u32)>,
    /// Raw return delay of each joint's servo; 0 where it has no such register.
    return_delay_raw: Vec<i64>,
}

impl Preflight {
    /// Nothing found yet.
    pub(crate) fn of(robot: &str, period: Duration) -> Self {
        Self {
            robot: robot.to_owned(),
            start_rad: Vec::new(),
            firmware: Vec::new(),
            wire_limit_hz: 0.0,
            bus_load: 0.0,
            lines: Vec::new(),
            period,
            notes: Vec::new(),
            held: false,
            to_write: Vec::new(),
            latched: Vec::new(),
            eeprom: Vec::new(),
            settings: Vec::new(),
            return_delay_raw: Vec::new(),
        }
    }
}

/// What preflight may pass over.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Accept {
    /// Firmware outside the profile's range.
    pub firmware: bool,
    /// Return delays in EEPROM are lowered, if the rate asked for needs it.
    pub eeprom: bool,
}

/// A joint must be this still before torque, rad/s.
const STILL_RAD_S: f64 = 0.05;
/// For this long.
const STILL_FOR: Duration = Duration::from_millis(200);
/// Distance from the temperature limit at which a motion is refused, degrees Celsius.
const TEMPERATURE_MARGIN_C: f64 = 5.0;
/// Silence after which no answer to an earlier question is reckoned with.
const LATE_ANSWERS: Duration = Duration::from_millis(200);
/// A joint that gives no answer is asked in so many turns, with a silence after each.
const TURNS: usize = 3;
/// Budget of one question outside the cycle.
pub(crate) const QUESTION: Duration = Duration::from_millis(100);
/// Outside the cycle a lost answer costs nothing but time. They share the budget of a question, and
/// get back what a late host took of it ([`crate::bus::Bus::set_retries`]).
pub(crate) const PATIENT_RETRIES: u32 = 10;

/// Runs all checks for a motion at `period`.
///
/// # Errors
/// The first check that fails, with joint, found and expected values.
pub fn preflight(link: &mut Link, period: Duration, accept: Accept) -> Result<Preflight, Error> {
    let mut found = Preflight::of(&link.robot().name, period);
    link.set_retries(PATIENT_RETRIES);
    check_identity(link, accept, &mut found)?;
    actuator::check(link, &mut found)?;
    mode::check_modes(link)?;
    check_setup(link, &mut found)?;
    line::check_return_delays(link, &mut found)?;
    check_watchdogs(link, &mut found)?;
    check_health(link, &mut found)?;
    if found.held {
        let note = "torque was already on: the robot is taken over where it stands";
        found.notes.push(note.to_owned());
    }
    line::check_line_speed(link, period, accept, &mut found)?;
    found.start_rad = check_still(link)?;
    line::check_measured(link, &found)?;
    check_start(link, &found.start_rad)?;
    Ok(found)
}

/// Looks at a robot that is only read: its servos are those of its file and set up as it says, so that its positions mean
/// what they say. Where its joints are, rad.
///
/// # Errors
/// The first servo that is another one, is set up otherwise, or gives no position.
pub fn readable(link: &mut Link, accept: Accept) -> Result<Vec<f64>, Error> {
    let mut found = Preflight::of(&link.robot().name, Duration::ZERO);
    link.set_retries(PATIENT_RETRIES);
    check_identity(link, accept, &mut found)?;
    check_setup(link, &mut found)?;
    positions(link)
}

/// Looks at a robot that is only watched: each servo that answers is the model its file says. Who is silent is passed over.
///
/// # Errors
/// The first servo that is another model, or a line that is lost.
pub fn same_models(link: &mut Link) -> Result<(), Error> {
    (0..link.robot().joints.len()).try_for_each(|joint| check_model(link, joint).map(drop))
}

/// As [`same_models`], where angles must mean what they say as well: each servo that answers is set up as its file says.
///
/// # Errors
/// The first servo that is another one or set up otherwise, or a line that is lost.
pub fn same_servos(link: &mut Link) -> Result<(), Error> {
    let mut found = Preflight::of(&link.robot().name, Duration::ZERO);
    for joint in 0..link.robot().joints.len() {
        if check_model(link, joint)? {
            check_setup_of(link, joint, &mut found)?;
        }
    }
    Ok(())
}

/// True if a joint's servo answers; it is then the model its file says.
fn check_model(link: &mut Link, joint: usize) -> Result<bool, Error> {
    let Some(servo) = link.robot().joints[joint].servo() else { return Ok(false) };
    let profile = servo.model.profile();
    let mut was_other = false;
    // One question may be lost; and on a host that stood still an answer to an earlier one may come last.
    for _ in 0..TURNS {
        let limit = budget(link);
        match link.read_raw(joint, Role::ModelNumber, limit) {
            Ok(model) if model == i64::from(profile.model_number) => return Ok(true),
            Ok(model) if was_other => return Err(other_model(link, joint, model)),
            Ok(_) => {
                was_other = true;
                wait_for_late_answers(link);
            }
            Err(error) if matches!(error.error, AskError::Port(_)) => {
                return Err(exchange_error(link, Some(joint), &error));
            }
            Err(_) => {}
        }
    }
    Ok(false)
}

/// Words for a servo of another model.
fn other_model(link: &Link, joint: usize, model: i64) -> Error {
    let said =
        Error::of(ErrorKind::NotReady, "the servo is not the model that the robot file says")
            .at(place(link, joint));
    let Some(servo) = link.robot().joints[joint].servo() else { return said };
    let (own, profile) = (servo.model.profile(), |name| gaitway_profiles::servo(name).ok());
    let known = gaitway_profiles::servo_names()
        .filter_map(profile)
        .find(|known| i64::from(known.model_number) == model && known.protocol == own.protocol);
    let named = known.map_or_else(String::new, |known| format!(" ({})", known.model));
    said.got(format!("model number {model}{named}"))
        .allowed(format!("{} ({})", own.model_number, own.model))
        .remedy("correct the robot file, or the servo's ID")
}

pub(crate) fn budget(link: &Link) -> Instant {
    link.clock().now() + QUESTION
}

pub(super) fn place(link: &Link, joint: usize) -> String {
    let Joint { name, id, line, .. } = &link.robot().joints[joint];
    format!("joint {name}, ID {id}, line {}", link.robot().lines[*line].name)
}

/// Words for a host that was too late to hear an answer: nothing is known of the device.
pub(crate) fn host_late(place: String, late: Duration) -> Error {
    Error::of(ErrorKind::HostLate, "this host is too late to hear the answers")
        .at(place)
        .got(format!("{} ms late while it waited", late.as_millis()))
        .allowed("a host that runs when an answer comes")
        .remedy("end other programs, or take a faster machine, and start again")
}

/// Words for a failed exchange with `joint`.
pub(crate) fn exchange_error(link: &Link, joint: Option<usize>, failed: &LinkError) -> Error {
    let actuator = joint.is_some_and(|joint| link.robot().joints[joint].actuator().is_some());
    let place = joint.map_or_else(|| failed.place.clone(), |joint| place(link, joint));
    match &failed.error {
        AskError::Port(PortError::Gone(port)) => Error::of(ErrorKind::Absent, "the port vanished")
            .at(place)
            .got(port.clone())
            .remedy("check the cable and the adapter, then start again"),
        AskError::Port(error) => {
            Error::of(ErrorKind::Damaged, "the line failed").at(place).got(error.to_string())
        }
        AskError::Miss(Miss::HostLate { by_ms }) => host_late(place, Duration::from_millis(*by_ms)),
        AskError::Miss(Miss::Silent) if actuator => Error::of(
            ErrorKind::Silent,
            "an actuator does not answer",
        )
        .at(place)
        .got("nothing")
        .remedy(
            "check its power, its cable, its ids (its own and that of its answers), the bit \
                 rate, and a terminator at each end of the line",
        ),
        AskError::Miss(Miss::Silent) => Error::of(ErrorKind::Silent, "a servo does not answer")
            .at(place)
            .got("nothing")
            .remedy("check its power, its cable, its ID and its line speed"),
        AskError::Miss(Miss::Garbled) => Error::of(
            ErrorKind::Damaged,
            "a servo's answers are damaged",
        )
        .at(place)
        .got("packets that fail their checksum")
        .remedy(
            "look for two servos with this ID, a loose connector, a missing terminator or a \
                 wrong line speed",
        ),
        AskError::Miss(miss) => {
            Error::of(ErrorKind::Damaged, "a servo answers wrongly").at(place).got(miss.to_string())
        }
        AskError::Unsayable(text) => Error::new(text.clone()).at(place),
    }
}

fn check_identity(link: &mut Link, accept: Accept, found: &mut Preflight) -> Result<(), Error> {
    for joint in 0..link.robot().joints.len() {
        let Some(servo) = link.robot().joints[joint].servo() else {
            found.firmware.push(0);
            continue;
        };
        let profile = servo.model.profile();
        let (model, firmware) = mode::identity(link, joint)?;
        if model != profile.model_number {
            return Err(other_model(link, joint, model.into()));
        }
        let range = profile.firmware;
        let inside = firmware >= range.min && range.max.is_none_or(|max| firmware <= max);
        if !inside && !accept.firmware {
            let max = range.max.map_or_else(|| "newer".to_owned(), |max| max.to_string());
            return Err(Error::new("the servo's profile was not checked against this firmware")
                .at(place(link, joint))
                .got(format!("firmware {firmware}"))
                .allowed(format!("{} to {max}", range.min))
                .remedy("update the servo, or add --accept-firmware if you know its registers"));
        }
        if !inside {
            found
                .notes
                .push(format!("{}: firmware {firmware} accepted as asked", place(link, joint)));
        }
        found.firmware.push(firmware);
    }
    Ok(())
}

/// Compares the registers the robot file states with those in the servo.
fn check_setup(link: &mut Link, found: &mut Preflight) -> Result<(), Error> {
    (0..link.robot().joints.len()).try_for_each(|joint| check_setup_of(link, joint, found))
}

fn check_setup_of(link: &mut Link, joint: usize, found: &mut Preflight) -> Result<(), Error> {
    for (register, wanted) in expected_registers(&link.robot().joints[joint]) {
        let name = &register.name;
        let raw = read_surely(link, joint, register, |raw| raw == wanted)?;
        if raw == wanted {
            continue;
        }
        if register.region == Region::Ram && register.role != Some(Role::TorqueEnable) {
            found.notes.push(format!(
                "{}: {name} is {raw}, set to {wanted} as the robot file says",
                place(link, joint)
            ));
            found.to_write.push((joint, register, wanted));
            continue;
        }
        return Err(Error::of(
            ErrorKind::NotReady,
            "a servo is not configured as the robot file says",
        )
        .at(format!("{}, register {name} ({})", place(link, joint), register.address))
        .got(format!("{raw} (raw)"))
        .allowed(format!("{wanted} (raw)"))
        .remedy("set the register with the maker's tool, or correct the robot file"));
    }
    Ok(())
}

/// Asks a joint for something, and again after a silence if it gives no answer: what a busy machine
/// holds back comes late, and nothing moves meanwhile.
fn ask<T>(
    link: &mut Link,
    joint: usize,
    mut question: impl FnMut(&mut Link, Instant) -> Result<T, LinkError>,
) -> Result<T, Error> {
    for _ in 1..TURNS {
        let limit = budget(link);
        match question(link, limit) {
            Err(LinkError {
                error: AskError::Miss(Miss::Silent | Miss::HostLate { .. }), ..
            }) => {
                wait_for_late_answers(link);
            }
            answer => return answer.map_err(|e| exchange_error(link, Some(joint), &e)),
        }
    }
    let limit = budget(link);
    question(link, limit).map_err(|e| exchange_error(link, Some(joint), &e))
}

fn wait_for_late_answers(link: &Link) {
    let clock = std::sync::Arc::clone(link.clock());
    clock.sleep_until(clock.now() + LATE_ANSWERS);
}

/// The value of `register`, asked again in silence unless it is `fine`: answers carry no number, and
/// on a host that stood still for long one to an earlier question may come last.
fn read_surely(
    link: &mut Link,
    joint: usize,
    register: &Register,
    fine: impl Fn(i64) -> bool,
) -> Result<i64, Error> {
    let raw = ask(link, joint, |link, limit| link.read_register(joint, register, limit))?;
    if fine(raw) {
        return Ok(raw);
    }
    wait_for_late_answers(link);
    ask(link, joint, |link, limit| link.read_register(joint, register, limit))
}

/// Registers that decide where a goal leads: compared even if the robot file leaves them at what
/// the servo leaves the factory with.
const DECISIVE: [Role; 9] = [
    Role::DriveMode,
    Role::HomingOffset,
    Role::OperatingMode,
    Role::MinPositionLimit,
    Role::MaxPositionLimit,
    Role::ResolutionDivider,
    Role::AngularResolution,
    Role::TorqueControlEnable,
    Role::GoalTime,
];

/// What must be in a joint's servo: the robot file's setup, and the decisive registers.
fn expected_registers(joint: &Joint) -> Vec<(&'static Register, i64)> {
    let Some(ServoDrive { model, setup, .. }) = joint.servo() else { return Vec::new() };
    let expected = |register: &'static Register| {
        // That the servo answers at all proves its line speed; its return delay is measured by.
        let apart = [Role::BaudRate, Role::ReturnDelay];
        let role = register.role.filter(|role| !apart.contains(role));
        match setup.get(&register.name) {
            Some(&raw) if register.role.is_none() || role.is_some() => Some((register, raw)),
            None if role.is_some_and(|role| DECISIVE.contains(&role)) => {
                Some((register, register.initial?))
            }
            _ => None,
        }
    };
    model.profile().registers.iter().filter_map(expected).collect()
}

/// A watchdog left on by a host that died must be off before the servo obeys goals again.
fn check_watchdogs(link: &mut Link, found: &mut Preflight) -> Result<(), Error> {
    for joint in 0..link.robot().joints.len() {
        let Some(register) = link.robot().joints[joint].register(Role::BusWatchdog) else {
            continue;
        };
        let raw = read_surely(link, joint, register, |raw| raw == 0)?;
        if raw == 0 {
            continue;
        }
        // Above its range it reads that it has bitten (255).
        let latched = register.max.is_some_and(|max| raw > max);
        let words = if latched {
            "the bus watchdog had stopped this servo when its host fell silent; it is cleared"
        } else {
            "the bus watchdog was left on; it is switched off first"
        };
        found.notes.push(format!("{}: {words}", place(link, joint)));
        if latched {
            found.latched.push((joint, register));
        } else {
            found.to_write.push((joint, register, 0));
        }
    }
    Ok(())
}

fn check_health(link: &mut Link, found: &mut Preflight) -> Result<(), Error> {
    for joint in 0..link.robot().joints.len() {
        for part in 0..link.health_reads(joint) {
            let health = ask(link, joint, |link, limit| link.health(joint, part, limit))?;
            if let Some(bits) = health.error_bits.filter(|&bits| bits != 0)
                && actuator::serious(link, joint, bits, found)
            {
                return Err(Error::of(ErrorKind::NotReady, "a servo reports a hardware error")
                    .at(place(link, joint))
                    .got(link.error_words(joint, bits))
                    .allowed("no error")
                    .remedy("find the cause, then reboot the servo"));
            }
            // A robot that holds after a motion is played again from where it stands.
            found.held |= health.torque_on == Some(true);
            check_supply(link, joint, &health)?;
        }
    }
    Ok(())
}

fn check_supply(link: &Link, joint: usize, health: &crate::device::Health) -> Result<(), Error> {
    if let (Some(voltage), Some(minimum)) =
        (health.voltage_v, link.robot().joints[joint].configured(Role::MinVoltageLimit))
        && !(voltage >= minimum)
    {
        return Err(Error::of(ErrorKind::NotReady, "the supply voltage is too low")
            .at(place(link, joint))
            .got(format!("{voltage:.1} V"))
            .allowed(format!("at least {minimum:.1} V"))
            .remedy("charge the battery or check the supply"));
    }
    if let (Some(temperature), Some(limit)) =
        (health.temperature_c, link.robot().joints[joint].configured(Role::TemperatureLimit))
        && !(temperature <= limit - TEMPERATURE_MARGIN_C)
    {
        return Err(Error::of(ErrorKind::NotReady, "a servo is too hot to start")
            .at(place(link, joint))
            .got(format!("{temperature:.0} deg C"))
            .allowed(format!("at most {:.0} deg C", limit - TEMPERATURE_MARGIN_C))
            .remedy("let it cool down"));
    }
    Ok(())
}

/// Reads where the joints stand, twice, and that they do not move in between.
fn check_still(link: &mut Link) -> Result<Vec<f64>, Error> {
    let first = positions(link)?;
    let clock = std::sync::Arc::clone(link.clock());
    clock.sleep_until(clock.now() + STILL_FOR);
    let second = positions(link)?;
    let most_rad = STILL_RAD_S * STILL_FOR.as_secs_f64();
    for (joint, (a, b)) in first.iter().zip(&second).enumerate() {
        if !((a - b).abs() <= most_rad) {
            return Err(Error::new("a joint moves before the start")
                .at(place(link, joint))
                .got(format!("{:.2} deg in {:.1} s", (b - a).to_degrees(), STILL_FOR.as_secs_f64()))
                .allowed(format!("{:.2} deg", most_rad.to_degrees()))
                .remedy("hold the robot still, or support it, and start again"));
        }
    }
    Ok(second)
}

/// Present position of every joint; a joint that cannot be read is an error, never a default.
pub(crate) fn positions(link: &mut Link) -> Result<Vec<f64>, Error> {
    let late_before = link.host_late();
    let mut attempts = 0;
    let states = loop {
        let budget = budget(link) + QUESTION;
        let states = link.whole_states(budget).map_err(|e| exchange_error(link, None, &e))?;
        attempts += 1;
        if attempts > PATIENT_RETRIES || states.iter().all(Result::is_ok) {
            break states;
        }
    };
    let mut positions = Vec::with_capacity(states.len());
    for (joint, state) in states.into_iter().enumerate() {
        match state {
            Ok((_, true)) => {
                return Err(Error::of(ErrorKind::NotReady, "a servo raises its alert flag")
                    .at(place(link, joint))
                    .got("an error of its own: supply, temperature or load")
                    .allowed("no error")
                    .remedy("find the cause, then switch the servo off and on again"));
            }
            Ok((state, _)) => positions.push(state.position_rad),
            Err(miss) => return Err(not_read(link, joint, miss, late_before)),
        }
    }
    Ok(positions)
}

/// Words for a joint without a position. Asked alone it may say more: silence in a group can be a
/// collision, or a host that was late.
fn not_read(link: &mut Link, joint: usize, miss: Miss, late_before: Duration) -> Error {
    let of = &link.robot().joints[joint];
    let (line, on_can) = (of.line, of.actuator().is_some());
    if !on_can {
        let limit = budget(link);
        if let Err(alone) = link.read_raw(joint, Role::PresentPosition, limit) {
            return exchange_error(link, Some(joint), &alone);
        }
    }
    let late = link.host_late() - late_before;
    if late > Duration::ZERO {
        return host_late(place(link, joint), late);
    }
    let in_group = LinkError { line, place: String::new(), error: miss.into() };
    exchange_error(link, Some(joint), &in_group)
}

fn check_start(link: &Link, start_rad: &[f64]) -> Result<(), Error> {
    for (joint, &start) in start_rad.iter().enumerate() {
        let limits = &link.robot().joints[joint].limits;
        if !(start >= limits.lower_rad() && start <= limits.upper_rad()) {
            return Err(Error::new("a joint stands outside its limits")
                .at(place(link, joint))
                .got(format!("{:.1} deg", start.to_degrees()))
                .allowed(format!(
                    "{:.1} to {:.1} deg",
                    limits.lower_rad().to_degrees(),
                    limits.upper_rad().to_degrees()
                ))
                .remedy("move it inside by hand with torque off, or correct the robot file"));
        }
    }
    Ok(())
}
