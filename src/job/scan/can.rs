//! Who is on a CAN line: what is listened to, what is asked, what is left alone, and who answers.

use crate::bus::can::scan::{Call, Found, overhear, scan};
use crate::bus::can::{Form, Peer};
use crate::error::{Error, counted, either};
use crate::job::observer::{Event, Observer};
use crate::rig::{Address, CanIdentity, can_ask_error, describe, dialect_name, dialect_of};
use crate::rig::{OpenCanLine, open_can};
use crate::time::Duration;
use crate::wire::can::{moteus, robstride};
use gaitway_profiles::Dialect;
use serde::Serialize;

/// A device that was heard.
#[derive(Clone, Debug, Serialize)]
pub struct Device {
    /// Its id.
    pub id: u8,
    /// What it speaks.
    pub protocol: &'static str,
    /// Model, as far as it says; several it may be of are joined by "or".
    pub model: Option<String>,
    /// Profiles it may be of.
    pub profiles: Vec<String>,
    /// Its hardware, as it says.
    pub hardware: Option<String>,
    /// Its firmware, as it says.
    pub firmware: Option<String>,
    /// Its serial number.
    pub serial: Option<String>,
    /// Identifier of its answers, where that is a setting of its own.
    pub answer_id: Option<u16>,
    /// It speaks without being asked.
    pub unasked: bool,
    /// True if it drives its motor; null if it does not tell.
    pub torque_on: Option<bool>,
    /// What it reports to be wrong, in words.
    pub faults: Option<String>,
}

/// An id where more than one device seems to be.
#[derive(Clone, Debug, Serialize)]
pub struct Collision {
    /// Its id.
    pub id: u8,
    /// What it speaks.
    pub protocol: &'static str,
    /// Why.
    pub reason: String,
}

/// A dialect in which nobody was asked.
#[derive(Clone, Debug, Serialize)]
pub struct LeftOut {
    /// What it speaks.
    pub protocol: &'static str,
    /// Why.
    pub reason: String,
}

/// What `scan` found on a CAN line.
#[derive(Clone, Debug, Default, Serialize)]
pub struct CanScanReport {
    /// The line.
    pub bus: String,
    /// Its speed, in words.
    pub speed: String,
    /// What was asked and listened to, in words.
    pub asked: Vec<String>,
    /// What was not asked.
    pub left_out: Vec<LeftOut>,
    /// Who was heard.
    pub devices: Vec<Device>,
    /// Ids of more than one.
    pub collisions: Vec<Collision>,
    /// What else is worth knowing of this line.
    pub notes: Vec<String>,
}

/// Longer than three beats of an ODrive's heart.
const LISTEN: Duration = Duration::from_millis(350);
/// CubeMars in servo mode may be set to speak once a second.
const LISTEN_LONG: Duration = Duration::from_millis(2500);
/// The host's id among moteus, as the maker's programs have it.
const MOTEUS_HOST: u8 = 0;

/// What to do about a dialect.
enum Way {
    Listen,
    Ask(Call),
    LeaveOut(&'static str),
}

/// Scans a CAN line, in one dialect or in all that no device takes for a command. `let_go` permits to ask
/// CubeMars actuators in MIT mode, which let go then.
///
/// # Errors
/// A line that cannot be opened or fails.
pub fn scan_can(
    bus: &Address,
    robot: Option<&str>,
    dialect: Option<Dialect>,
    let_go: bool,
    observer: &dyn Observer,
) -> Result<CanScanReport, Error> {
    let mut line = open_can(bus, robot, 0)?;
    let (bus, speed) = (bus.to_string(), line.speed_words());
    let mut report = CanScanReport { bus, speed, ..CanScanReport::default() };
    let dialects = dialects(dialect, &line);
    let heard = listen(&mut line, &dialects, dialect.is_some(), &mut report)?;
    let mut found = heard;
    for &(dialect, named) in &dialects {
        let call = match way(dialect, named, let_go, &line) {
            Way::Ask(call) => call,
            Way::Listen => continue,
            Way::LeaveOut(reason) => {
                let protocol = dialect_name(dialect);
                report.left_out.push(LeftOut { protocol, reason: reason.to_owned() });
                continue;
            }
        };
        report.asked.push(question_words(call));
        found.extend(ask(&mut line, call, observer, &report.bus)?);
    }
    merge(&mut found);
    for one in &found {
        let place = format!("{} on {}", one.peer, report.bus);
        let identity =
            describe(&mut line, one).map_err(|e| can_ask_error(&line, place.clone(), &e))?;
        if let Some(reason) =
            collides(&mut line, one).map_err(|e| can_ask_error(&line, place, &e))?
        {
            let protocol = dialect_name(dialect_of(&one.peer));
            report.collisions.push(Collision { id: one.peer.id(), protocol, reason });
        }
        report.devices.push(device(&identity));
    }
    report.notes.extend(confusions(&found));
    report.notes.extend(line.bus.troubles().map(|words| format!("the line reports: {words}")));
    Ok(report)
}

/// Dialects to look for, each with whether the user or the robot file named it.
fn dialects(wanted: Option<Dialect>, line: &OpenCanLine) -> Vec<(Dialect, bool)> {
    const ALL: [Dialect; 7] = [
        Dialect::Odrive,
        Dialect::CubemarsServo,
        Dialect::Damiao,
        Dialect::Robstride,
        Dialect::Moteus,
        Dialect::Recoil,
        Dialect::CubemarsMit,
    ];
    if let Some(wanted) = wanted {
        return vec![(wanted, true)];
    }
    let mut of_robot = Vec::new();
    if let Some((robot, number)) = &line.robot {
        for joint in robot.joints.iter().filter(|joint| joint.line == *number) {
            of_robot.extend(joint.actuator().map(|actuator| actuator.profile().dialect));
        }
    }
    ALL.map(|dialect| (dialect, of_robot.contains(&dialect))).to_vec()
}

/// Whose questions another dialect could take for a command is asked only if it was named.
fn way(dialect: Dialect, named: bool, let_go: bool, line: &OpenCanLine) -> Way {
    let robstride_host = robstride::Id::new(line.host_id());
    match dialect {
        Dialect::CubemarsServo => Way::Listen,
        Dialect::Odrive if named => Way::Ask(Call::Odrive),
        Dialect::Odrive => Way::Listen,
        Dialect::Damiao => Way::Ask(Call::Damiao),
        Dialect::Robstride => robstride_host
            .map_or(Way::LeaveOut("the host has no id"), |host| Way::Ask(Call::Robstride(host))),
        Dialect::Moteus if !line.fd => Way::LeaveOut("the interface carries no CAN FD"),
        Dialect::Moteus => {
            moteus::Id::new(MOTEUS_HOST).map_or(Way::Listen, |host| Way::Ask(Call::Moteus(host)))
        }
        Dialect::Recoil if named => Way::Ask(Call::Recoil),
        Dialect::Recoil => Way::LeaveOut(
            "its questions could be commands to others on the line; ask with --protocol recoil",
        ),
        Dialect::CubemarsMit if let_go && named => Way::Ask(Call::CubemarsMit),
        Dialect::CubemarsMit => Way::LeaveOut(
            "it answers only when it is switched on or off; support the robot, then add \
             --protocol cubemars-mit --let-go: whatever is found has let go",
        ),
    }
}

fn question_words(call: Call) -> String {
    match call {
        Call::Damiao => "damiao: ids 1 to 255 for their id's register (0x7FF)",
        Call::Robstride(_) => "robstride: ids 0 to 254 for their processor's number",
        Call::Odrive => "odrive: nodes 0 to 63 for their estimates, by remote request",
        Call::Moteus(_) => "moteus: ids 1 to 126 for model and serial number",
        Call::Recoil => "recoil: ids 1 to 127 for their own id",
        Call::CubemarsMit => "cubemars-mit: ids 0 to 255 were TOLD TO LET GO",
    }
    .to_owned()
}

/// Listens to those who speak unasked.
fn listen(
    line: &mut OpenCanLine,
    dialects: &[(Dialect, bool)],
    only: bool,
    report: &mut CanScanReport,
) -> Result<Vec<Found>, Error> {
    let slow = only && dialects.iter().any(|(dialect, _)| *dialect == Dialect::CubemarsServo);
    let window = if slow { LISTEN_LONG } else { LISTEN };
    let until = line.clock.now() + window;
    let heard =
        overhear(&mut line.bus, until).map_err(|e| can_ask_error(line, report.bus.clone(), &e))?;
    report.asked.push(format!(
        "nothing for {:.2} s: listened to odrive, cubemars-servo and robstride that speak unasked",
        window.as_secs_f64()
    ));
    if heard.foreign_count > 0 {
        report.notes.push(format!(
            "{} {were} heard that are none of these: another program may be speaking on this \
             line",
            counted(heard.foreign_count, "frame"),
            were = either(heard.foreign_count, "was", "were")
        ));
    }
    let wanted = |found: &Found| dialects.iter().any(|(of, _)| *of == dialect_of(&found.peer));
    Ok(heard.devices.into_iter().filter(wanted).collect())
}

fn ask(
    line: &mut OpenCanLine,
    call: Call,
    observer: &dyn Observer,
    bus: &str,
) -> Result<Vec<Found>, Error> {
    let total = 2 * call.questions().len() as u64;
    let mut done = 0;
    let found = scan(&mut line.bus, call, &mut |asked| {
        done += asked;
        observer.hear(Event::Step { done, total, what: "" });
    });
    observer.hear(Event::Step { done: total, total, what: "" });
    found.map_err(|e| can_ask_error(line, bus.to_owned(), &e))
}

/// Who spoke unasked and answered as well is one device.
fn merge(found: &mut Vec<Found>) {
    let mut whole: Vec<Found> = Vec::new();
    for one in found.drain(..) {
        let key = |of: &Found| (dialect_name(dialect_of(&of.peer)), of.peer.id());
        match whole.iter_mut().find(|known| key(known) == key(&one)) {
            Some(known) => {
                known.unasked |= one.unasked;
                known.serial = known.serial.or(one.serial);
                known.contradicts |= one.contradicts;
                known.peer = one.peer;
            }
            None => whole.push(one),
        }
    }
    whole.sort_by_key(|of| (of.peer.id(), dialect_name(dialect_of(&of.peer))));
    *found = whole;
}

/// Why more than one device seems to have this one's id.
fn collides(line: &mut OpenCanLine, found: &Found) -> Result<Option<String>, crate::bus::AskError> {
    if found.contradicts {
        return Ok(Some("answers to one question contradict each other".to_owned()));
    }
    // Where two devices stand differs; what they are called may not.
    let number = match found.peer {
        Peer::Damiao { .. } => 80,
        Peer::Robstride { .. } => robstride::parameter::POSITION,
        Peer::Moteus { .. } => moteus::register::POSITION,
        Peer::Recoil { .. } => crate::wire::can::recoil::parameter::POSITION,
        _ => return Ok(None),
    };
    let answers = line.bus.answers_to(&found.peer, number, Form::Float)?;
    Ok((answers > 1)
        .then(|| format!("{answers} to one question", answers = counted(answers, "answer"))))
}

/// Devices that are taken for one another, though each has an id of its own.
fn confusions(found: &[Found]) -> Vec<String> {
    let damiao: Vec<(u8, u16)> = found
        .iter()
        .filter_map(|of| match of.peer {
            Peer::Damiao { id, answer_id } => Some((id.get(), answer_id)),
            _ => None,
        })
        .collect();
    let mut notes = Vec::new();
    for (k, (id, answer_id)) in damiao.iter().enumerate() {
        for (other, other_answer) in &damiao[k + 1..] {
            if answer_id == other_answer && id & 0x0F == other & 0x0F {
                notes.push(format!(
                    "damiao {id} and {other} answer under one identifier (0x{answer_id:X}) with \
                     the same low four bits: nobody can tell whose state is whose"
                ));
            }
        }
        if let Some((other, _)) = damiao.iter().find(|(other, _)| u16::from(*other) == *answer_id) {
            notes.push(format!(
                "damiao {id} answers under 0x{answer_id:X}, which damiao {other} listens to: \
                 answers of the one are commands to the other"
            ));
        }
    }
    notes
}

fn device(identity: &CanIdentity) -> Device {
    let answer_id = match identity.peer {
        Peer::Damiao { answer_id, .. } => Some(answer_id),
        _ => None,
    };
    Device {
        id: identity.peer.id(),
        protocol: dialect_name(dialect_of(&identity.peer)),
        model: identity.model(),
        profiles: identity.candidates.iter().map(|of| of.name.clone()).collect(),
        hardware: identity.hardware.clone(),
        firmware: identity.firmware.clone(),
        serial: identity.serial.clone(),
        answer_id,
        unasked: identity.unasked,
        torque_on: identity.torque_on,
        faults: identity.faults.filter(|faults| !faults.is_none()).map(|f| f.to_string()),
    }
}
