//! A whole robot's servos given their IDs and line speed, one after the other as they are plugged in.
//!
//! What is done is in the servos themselves: whoever breaks off plugs in what is done and begins again, and goes on behind it.

use super::change::{change_baud, change_id, needed, refuse_taken};
use super::device::Device;
use super::{Protocol, Which};
use crate::device::Model;
use crate::error::{Error, ErrorKind};
use crate::job::observer::{Event, Nobody, Observer};
use crate::job::report::Outcome;
use crate::job::scan::{self, ScanOrder, Speeds, scan_line};
use crate::rig::{Address, BusKind};
use crate::robot::Robot;
use gaitway_profiles::{LineKind, Role, Servo};
use serde::Serialize;
use std::fmt::Write;

/// Whose servos, and where they are plugged in.
#[derive(Clone, Debug, PartialEq)]
pub struct SetUpOrder {
    /// Where the line is; its name before it if the robot has several.
    pub bus: Address,
    /// Robot by name, or path of its file.
    pub robot: String,
    /// Only these joints; none: all of the line.
    pub joints: Vec<String>,
    /// What servos keep at power-off may be written.
    pub permit_eeprom: bool,
    /// Look who is there, write nothing.
    pub dry_run: bool,
}

/// A servo that is wanted next.
#[derive(Clone, Copy, Debug)]
pub struct SetUpTask<'a> {
    /// The joint it is for.
    pub joint: &'a str,
    /// Its model.
    pub model: &'a str,
    /// The ID it gets.
    pub id: u8,
    /// What was wrong with what was plugged in before, if anything was.
    pub wrong: Option<&'a Error>,
}

/// What whoever plugs in says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SetUpAnswer {
    /// It is plugged in.
    Go,
    /// Not this one.
    Skip,
    /// That is enough.
    Stop,
}

/// What came of a joint's servo.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum SetUpState {
    /// It was changed.
    Done,
    /// It was as it is to be.
    WasDone,
    /// Only in a dry run: it would be changed.
    WouldBeDone,
    /// Whoever plugs in left it out.
    Skipped,
}

/// A joint whose servo was looked at.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct SetUpJoint {
    /// Its name.
    pub name: String,
    /// What came of it.
    pub state: SetUpState,
    /// The ID it had; null if it was skipped.
    pub id_before: Option<u8>,
    /// The line speed it had, bit/s.
    pub baud_bps_before: Option<u32>,
    /// Its ID.
    pub id: u8,
    /// Its line speed, bit/s.
    pub baud_bps: u32,
    /// How to undo it.
    pub undo: Vec<String>,
}

/// What came of all of them.
#[derive(Clone, Debug, Serialize)]
pub struct SetUpReport {
    /// `done`, `done_with_loss` if a joint was skipped, `stopped`.
    pub outcome: Outcome,
    /// Nothing was written.
    pub dry_run: bool,
    /// The robot's name.
    pub robot: String,
    /// The line.
    pub bus: String,
    /// Joint by joint, in the order in which they were set up.
    pub joints: Vec<SetUpJoint>,
}

/// A joint whose servo is to be set up.
#[derive(Clone, Copy)]
struct Wanted<'a> {
    name: &'a str,
    id: u8,
    servo: &'static Servo,
    baud_bps: u32,
}

/// Asks for one servo after the other and sets it up.
///
/// # Errors
/// No permit, a robot or a line that is none of servos, a line that is lost, a servo that does not keep what is written. A
/// wrong servo is told to whoever plugs in, and asked for again.
pub fn set_up(
    order: &SetUpOrder,
    observer: &dyn Observer,
    ask: &mut dyn FnMut(SetUpTask<'_>) -> SetUpAnswer,
) -> Result<SetUpReport, Error> {
    if !order.permit_eeprom && !order.dry_run {
        return Err(Error::of(
            ErrorKind::NotPermitted,
            "IDs and speeds are kept at power-off; nothing was written",
        )
        .at(order.bus.to_string())
        .remedy("add --permit-eeprom if that is meant, or --dry-run to see who is there"));
    }
    let robot = Robot::load(&order.robot)?;
    let wanted = wanted(&robot, order)?;
    let mut report = SetUpReport {
        outcome: Outcome::Done,
        dry_run: order.dry_run,
        robot: robot.name.clone(),
        bus: order.bus.to_string(),
        joints: Vec::new(),
    };
    let mut present = already(order, &wanted)?;
    for next in &wanted {
        if present.contains(&next.id) {
            report.joints.push(next.found(SetUpState::WasDone, Some((next.id, next.baud_bps))));
            continue;
        }
        let mut wrong = None;
        let done = loop {
            let task = SetUpTask {
                joint: next.name,
                model: &next.servo.model,
                id: next.id,
                wrong: wrong.as_ref(),
            };
            match ask(task) {
                _ if observer.wants_to_stop() => break None,
                SetUpAnswer::Stop => break None,
                SetUpAnswer::Skip => break Some(next.found(SetUpState::Skipped, None)),
                SetUpAnswer::Go => {}
            }
            match newcomer(order, next, &present)? {
                // One that was pulled out meanwhile is asked for again: what is changed of it by then is found there.
                Ok(found) => match change(order, next, found) {
                    Ok(done) => break Some(done),
                    Err(error) if matches!(error.kind, ErrorKind::Silent | ErrorKind::Damaged) => {
                        wrong = Some(
                            error.remedy("plug it in again, alone or beside those that are done"),
                        );
                    }
                    Err(error) => return Err(error),
                },
                Err(error) => wrong = Some(error),
            }
        };
        let Some(done) = done else {
            report.outcome = Outcome::Stopped;
            return Ok(report);
        };
        if done.state == SetUpState::Skipped {
            report.outcome = Outcome::DoneWithLoss;
        } else {
            present.push(next.id);
        }
        observer.hear(Event::Note(&done.words()));
        report.joints.push(done);
    }
    Ok(report)
}

/// The joints that are meant: the one that keeps the ID that servos leave the factory with comes last, so that no newcomer
/// has the ID of one that is done.
fn wanted<'a>(robot: &'a Robot, order: &SetUpOrder) -> Result<Vec<Wanted<'a>>, Error> {
    let names: Vec<&str> = robot.lines.iter().map(|line| line.name.as_str()).collect();
    let line = match &order.bus.line {
        None if names.len() == 1 => 0,
        None => {
            return Err(Error::new("which line of the robot is that?")
                .at(order.bus.to_string())
                .allowed(names.join(", "))
                .remedy("LINE=BUS"));
        }
        Some(name) => names.iter().position(|known| known == name).ok_or_else(|| {
            Error::of(ErrorKind::Unknown, "the robot has no such line").none_of(
                name,
                &names,
                "take one of these",
            )
        })?,
    };
    let LineKind::Serial { baud_bps } = robot.lines[line].kind else {
        return Err(Error::new("actuators on a CAN line are set up one by one")
            .at(format!("line {}", names[line]))
            .remedy("gaitway servo set-id can:INTERFACE ID NEW_ID"));
    };
    if let Some(unknown) = order
        .joints
        .iter()
        .find(|name| !robot.joints.iter().any(|joint| joint.name == **name && joint.line == line))
    {
        let own = robot.joints.iter().filter(|joint| joint.line == line);
        return Err(Error::of(ErrorKind::Unknown, "the line has no such joint")
            .at("--joint")
            .none_of(unknown, own.map(|joint| &joint.name), "take one of these"));
    }
    let is_meant = |name: &String| order.joints.is_empty() || order.joints.contains(name);
    let joints = robot.joints.iter().filter(|joint| joint.line == line && is_meant(&joint.name));
    let mut wanted: Vec<Wanted<'a>> = joints
        .filter_map(|joint| {
            let servo = joint.servo()?.model.profile();
            Some(Wanted { name: &joint.name, id: joint.id, servo, baud_bps })
        })
        .collect();
    wanted.sort_by_key(|of| (factory_id(of.servo) == Some(of.id), std::cmp::Reverse(of.id)));
    Ok(wanted)
}

fn factory_id(servo: &Servo) -> Option<u8> {
    let initial = servo.register(Role::Id)?.initial?;
    u8::try_from(initial).ok()
}

/// IDs of joints that answer as they are to, but for the one that a servo has from the factory: nobody knows whether that is
/// the joint's or a newcomer.
fn already(order: &SetUpOrder, wanted: &[Wanted<'_>]) -> Result<Vec<u8>, Error> {
    let Some(first) = wanted.first() else { return Ok(Vec::new()) };
    let found = heard(order, first, first.baud_bps)?;
    let is_done = |of: &&Wanted<'_>| {
        factory_id(of.servo) != Some(of.id)
            && found.devices.iter().any(|device| device.id == of.id && is_model(device, of.servo))
    };
    Ok(wanted.iter().filter(is_done).map(|of| of.id).collect())
}

fn is_model(device: &scan::Device, servo: &Servo) -> bool {
    device.model_number == Some(servo.model_number)
}

/// Who answers at one speed. It is asked to the end whatever is wanted meanwhile: of half a scan a newcomer may look alone
/// who is not.
fn heard(order: &SetUpOrder, of: &Wanted<'_>, baud_bps: u32) -> Result<scan::ScanReport, Error> {
    let protocol: Protocol = Model::new(of.servo).protocol();
    let (robot, protocol) = (Some(order.robot.as_str()), Some(protocol));
    let speeds = Speeds::One(baud_bps);
    scan_line(&ScanOrder { bus: &order.bus, robot, protocol, speeds, wait: None }, &Nobody)
}

/// The one servo that was plugged in; or why that is none.
fn newcomer(
    order: &SetUpOrder,
    next: &Wanted<'_>,
    present: &[u8],
) -> Result<Result<(u8, u32), Error>, Error> {
    let place = || format!("{} for {}", order.bus, next.name);
    let mut speeds = vec![next.baud_bps];
    speeds.extend(next.servo.baud.iter().map(|baud| baud.bps).filter(|bps| *bps != next.baud_bps));
    let over_tcp = matches!(order.bus.bus, BusKind::Tcp { .. });
    for bps in speeds.into_iter().take(if over_tcp { 1 } else { usize::MAX }) {
        let found = match heard(order, next, bps) {
            // An adapter need not know every speed that a servo knows.
            Err(error) if error.kind == ErrorKind::Unknown && bps != next.baud_bps => continue,
            found => found?,
        };
        let is_known = |id: u8| bps == next.baud_bps && present.contains(&id);
        if let Some(collision) = found.collisions.first() {
            return Ok(Err(Error::of(ErrorKind::Busy, "two servos answer at once")
                .at(place())
                .got(format!("ID {}: {}", collision.id, collision.reason))
                .allowed("one servo that is new")
                .remedy("unplug all that are not set up yet but this one")));
        }
        let new: Vec<&scan::Device> =
            found.devices.iter().filter(|device| !is_known(device.id)).collect();
        match new.as_slice() {
            [] => {}
            [one] if is_model(one, next.servo) => return Ok(Ok((one.id, bps))),
            [other] => {
                let number = other.model_number.map_or("unknown".to_owned(), |n| n.to_string());
                let name = other.model.clone().unwrap_or_else(|| "no profile".to_owned());
                return Ok(Err(Error::of(ErrorKind::NotReady, "this servo is another model")
                    .at(place())
                    .got(format!("model number {number} ({name}), ID {}", other.id))
                    .allowed(format!("{} ({})", next.servo.model_number, next.servo.model))));
            }
            several => {
                let ids: Vec<String> = several.iter().map(|one| one.id.to_string()).collect();
                return Ok(Err(Error::of(ErrorKind::Busy, "several servos are new")
                    .at(place())
                    .got(format!("IDs {} at {bps} bit/s", ids.join(", ")))
                    .allowed("one that is new, beside those that are done")
                    .remedy("unplug the others")));
            }
        }
    }
    Ok(Err(Error::of(ErrorKind::Silent, "nobody new answers")
        .at(place())
        .remedy("check its cable and its power")))
}

/// Gives the servo that was found its ID, then its speed, and looks for it there.
fn change(
    order: &SetUpOrder,
    next: &Wanted<'_>,
    (id, bps): (u8, u32),
) -> Result<SetUpJoint, Error> {
    if (id, bps) == (next.id, next.baud_bps) {
        return Ok(next.found(SetUpState::WasDone, Some((id, bps))));
    }
    if order.dry_run {
        return Ok(next.found(SetUpState::WouldBeDone, Some((id, bps))));
    }
    let at = |bps: u32| {
        let mut bus = order.bus.clone();
        match &mut bus.bus {
            BusKind::Serial { baud_bps, .. } | BusKind::Tcp { baud_bps, .. } => {
                *baud_bps = Some(bps);
            }
            BusKind::Sim | BusKind::SimPty | BusKind::Can { .. } | BusKind::Slcan { .. } => {}
        }
        bus
    };
    let mut device = Device::open(&Which {
        bus: at(bps),
        id,
        robot: Some(order.robot.clone()),
        model: Some(next.servo.name.clone()),
        protocol: Some(Model::new(next.servo).protocol()),
        dialect: None,
    })?;
    device.must_be_limp()?;
    let mut undo = Vec::new();
    if id != next.id {
        let item = needed(&device, Role::Id)?;
        refuse_taken(&mut device, next.id)?;
        change_id(&mut device, &item, next.id)?;
        undo.push(format!(
            "gaitway servo set-id {} {} {id} --permit-eeprom",
            at(next.baud_bps),
            next.id
        ));
    }
    if bps != next.baud_bps {
        let item = needed(&device, Role::BaudRate)?;
        let known = next.servo.baud.iter().find(|baud| baud.bps == next.baud_bps);
        let speed = known.ok_or_else(|| {
            Error::new("the servo does not know the line's speed")
                .at(device.place())
                .got(format!("{} bit/s", next.baud_bps))
        })?;
        change_baud(&mut device, &item, speed)?;
        undo.push(format!(
            "gaitway servo set-baud {} {} {bps} --permit-eeprom",
            at(next.baud_bps),
            next.id
        ));
    }
    undo.reverse();
    if undo.len() == 2 {
        // By then it speaks at the speed it had.
        undo[1] = format!("gaitway servo set-id {} {} {id} --permit-eeprom", at(bps), next.id);
    }
    Ok(SetUpJoint { undo, ..next.found(SetUpState::Done, Some((id, bps))) })
}

impl Wanted<'_> {
    fn found(&self, state: SetUpState, before: Option<(u8, u32)>) -> SetUpJoint {
        SetUpJoint {
            name: self.name.to_owned(),
            state,
            id_before: before.map(|(id, _)| id),
            baud_bps_before: before.map(|(_, bps)| bps),
            id: self.id,
            baud_bps: self.baud_bps,
            undo: Vec::new(),
        }
    }
}

impl SetUpJoint {
    /// As a person reads it.
    #[must_use]
    pub fn words(&self) -> String {
        let Self { name, id, baud_bps, .. } = self;
        let before = match (self.id_before, self.baud_bps_before) {
            (Some(id), Some(bps)) => format!("ID {id} at {bps} bit/s"),
            _ => String::new(),
        };
        match self.state {
            SetUpState::Done => format!("{name}: ID {id} at {baud_bps} bit/s (before: {before})"),
            SetUpState::WouldBeDone => {
                format!("{name}: {before} would become ID {id} at {baud_bps} bit/s")
            }
            SetUpState::WasDone => format!("{name}: ID {id} at {baud_bps} bit/s, as it is to be"),
            SetUpState::Skipped => format!("{name}: skipped"),
        }
    }
}

impl SetUpReport {
    /// As a person reads it.
    #[must_use]
    pub fn text(&self) -> String {
        let mut text = String::new();
        for joint in &self.joints {
            let _ = writeln!(text, "{}", joint.words());
            for undo in &joint.undo {
                let _ = writeln!(text, "  to undo: {undo}");
            }
        }
        if self.outcome == Outcome::Stopped {
            text.push_str("stopped; plug in those that are done and say the same again to go on\n");
        }
        text
    }
}

/// What is asked of who plugs in.
#[must_use]
pub fn set_up_question(task: SetUpTask<'_>) -> String {
    let wrong = task.wrong.map_or_else(String::new, |error| format!("{error}\n"));
    let SetUpTask { joint, model, id, .. } = task;
    format!(
        "{wrong}plug in the servo of {joint} ({model}, to have ID {id}), alone or beside those that are done.\n\
         Enter goes on, s skips it, q stops: "
    )
}

/// What was answered, if that is an answer.
#[must_use]
pub fn set_up_answered(line: &str) -> Option<SetUpAnswer> {
    Some(match line.trim().to_ascii_lowercase().as_str() {
        "" => SetUpAnswer::Go,
        "s" => SetUpAnswer::Skip,
        "q" => SetUpAnswer::Stop,
        _ => return None,
    })
}
