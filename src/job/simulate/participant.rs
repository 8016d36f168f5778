//! A virtual person in virtual sensors who takes part in a session: does what its folder says is asked now, and waits for the
//! operator.

use super::acting::{Act, Acting, Carries, Stays, locked};
use super::imus::{ImusOrder, OpenSensor, Way, wear_file, write_wear};
use super::mishaps::{MishapScript, Occasion, Wrong};
use super::person::RATE_HZ;
use super::worn::Worn;
use crate::action::vocabulary;
use crate::body::worn::Movement;
use crate::body::{Segment, segment_name};
use crate::error::{Error, ErrorKind};
use crate::job::source::body_motion;
use crate::mocap::anatomy::Capture;
use crate::session::now::{MOVEMENTS, Now, NowWanted};
use gaitway_sim::imu::{ImuDoor, MadeMotion, MakesPoses, Stage, VirtualImu};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

/// How tall the person is, m.
const STATURE_M: f64 = 1.75;
/// An action begins so long after it was asked for, s.
const FIRST_S: f64 = 1.0;
/// Longest motion of an action, s.
const LONGEST_S: f64 = 600.0;
/// A sensor that could not be plugged in again is tried once more after this time, s.
const ONCE_MORE_S: f64 = 1.0;

/// Which session somebody takes part in, and how.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct FollowOrder {
    /// Its folder; a session may be begun there later.
    pub session: PathBuf,
    /// Which of its subjects it is; `None`: whoever is asked.
    pub subject: Option<String>,
    /// Motions of actions that do not ship with gaitway, or other ones of those that do: name, and motion as [`body_motion`]
    /// reads it.
    pub actions: Vec<(String, String)>,
    /// What goes wrong, as a file.
    pub script: Option<PathBuf>,
}

/// A sensor, and its door unless it was pulled out.
struct Sensor {
    segment: Segment,
    imu: VirtualImu,
    door: Option<ImuDoor>,
}

/// What is done at a time that was foreseen.
enum Deed {
    Does(Act, String),
    Stumbles,
    Swaps(Segment, Segment),
    Loses(Segment, f64),
    Returns(Segment),
}

/// Who asked: the process, when that began, and which request of it.
type Asker = (u32, u64, u64);

/// Somebody who takes part in a session, and whose sensors can be opened. Dropping it ends them.
///
/// The motion goes on whoever listens, as a person's does.
pub struct Participant {
    order: FollowOrder,
    stage: Stage,
    way: Way,
    open: Vec<OpenSensor>,
    sensors: Vec<Sensor>,
    wear_file: Option<PathBuf>,
    acting: Arc<Mutex<Acting>>,
    /// Motions by the names of actions.
    known: BTreeMap<String, Arc<Capture>>,
    script: MishapScript,
    /// By mishap: it befell the person already.
    befell: Vec<bool>,
    random: ChaCha8Rng,
    asker: Option<Asker>,
    /// True while nobody wears the sensors.
    lies: bool,
    due: Vec<(f64, Deed)>,
    /// What could not be read last.
    unread: Option<String>,
    said: Vec<String>,
}

impl Participant {
    /// Straps the sensors on and opens their doors, as [`Wearer::open`](super::imus::Wearer::open) does; what is captured in
    /// `imus` and how long that person stands is not used.
    ///
    /// # Errors
    /// As there; a motion of an action that cannot be read, a script that is none or that needs a sensor that is not worn.
    pub fn open(imus: &ImusOrder, order: FollowOrder) -> Result<Self, Error> {
        let sensor = gaitway_profiles::sensor(&imus.profile)?;
        let mut known = BTreeMap::new();
        for (name, motion) in &order.actions {
            known.insert(name.clone(), captured(motion)?);
        }
        let script = order.script.as_deref().map(MishapScript::read).transpose()?;
        let script = script.unwrap_or_default();
        check_worn(&script, &imus.segments, order.script.as_deref())?;
        let mut way = Way::of(imus, &sensor)?;
        let wear_file = wear_file(imus)?;
        let (stage, acting) = (Stage::lasting(), Acting::new(STATURE_M, Act::Table)?);
        let acting = Arc::new(Mutex::new(acting));
        let mut worn = Worn::new(&sensor, &imus.known, imus.strapping, imus.seed)?;
        let (mut open, mut sensors): (Vec<OpenSensor>, Vec<Sensor>) = (Vec::new(), Vec::new());
        for &segment in &imus.segments {
            if open.iter().any(|known| known.segment == segment) {
                continue;
            }
            let imu = worn.moved(segment, |world| {
                let carries = Carries::new(Arc::clone(&acting), segment, world);
                let makes: Arc<dyn MakesPoses> = Arc::new(carries);
                MadeMotion::new(RATE_HZ, makes)
            })?;
            let (door, place) = way.open(&stage, segment, imu.clone())?;
            sensors.push(Sensor { segment, imu, door: Some(door) });
            open.push(OpenSensor { segment, place });
        }
        write_wear(wear_file.as_deref(), &way)?;
        let foreseen = script.mishaps.iter().filter_map(|mishap| match mishap.occasion {
            Occasion::At(at_s) => Some((at_s, deed(&mishap.wrong)?)),
            Occasion::Asked(..) => None,
        });
        Ok(Self {
            due: foreseen.collect(),
            befell: vec![false; script.mishaps.len()],
            random: ChaCha8Rng::seed_from_u64(script.seed),
            script,
            order,
            stage,
            way,
            open,
            sensors,
            wear_file,
            acting,
            known,
            asker: None,
            lies: true,
            unread: None,
            said: vec!["the sensors lie on a table (until something is asked)".to_owned()],
        })
    }

    /// Every sensor, in the order of the segments that were given.
    #[must_use]
    pub fn sensors(&self) -> &[OpenSensor] {
        &self.open
    }

    /// Where it was written which segment wears which sensor.
    #[must_use]
    pub fn wear_file(&self) -> Option<&Path> {
        self.wear_file.as_deref()
    }

    /// Looks what is asked now, and does it; to be called some twenty times a second. Gives what is done from now on and why,
    /// a line each, and what goes wrong.
    pub fn attend(&mut self) -> Vec<String> {
        let now_s = self.stage.began().map_or(0.0, |began| began.elapsed().as_secs_f64());
        self.attend_at(now_s)
    }

    fn attend_at(&mut self, now_s: f64) -> Vec<String> {
        // Poses are made also while nobody listens: what is asked next begins now, and not where somebody listened last.
        let _ = locked(&self.acting).at((now_s * RATE_HZ) as u64, Segment::Pelvis);
        let asked = match Now::read(&self.order.session) {
            Ok(asked) => {
                self.unread = None;
                asked
            }
            Err(error) => {
                let text = format!("! {error}");
                if self.unread.as_ref() != Some(&text) {
                    self.said.push(text.clone());
                    self.unread = Some(text);
                }
                None
            }
        };
        let asker = asked.as_ref().map(|now| (now.pid, now.started, now.request));
        if asker != self.asker {
            let had = self.asker.is_some();
            self.asker = asker;
            match &asked {
                Some(now) => self.is_asked(now, now_s),
                None if had && self.unread.is_none() => {
                    self.said.push("no session is led there".to_owned());
                }
                None => {}
            }
        }
        while let Some(at) = self.due.iter().position(|(at_s, _)| *at_s <= now_s) {
            let (_, deed) = self.due.remove(at);
            self.befalls(deed, now_s);
        }
        std::mem::take(&mut self.said)
    }

    /// Something new is asked.
    fn is_asked(&mut self, now: &Now, now_s: f64) {
        self.due.retain(|(_, deed)| !matches!(deed, Deed::Does(..)));
        let (mut act, mut words) = self.wanted(now);
        let mut late_s = 0.0;
        let is_for = now.is_for(self.order.subject.as_deref());
        for at in 0..self.script.mishaps.len() {
            let mishap = &self.script.mishaps[at];
            let Some(after_s) = mishap.occasion.after_s(now).filter(|_| is_for) else { continue };
            if std::mem::replace(&mut self.befell[at], true) {
                continue;
            }
            match &mishap.wrong {
                Wrong::Late(by_s) => {
                    late_s = after_s + by_s;
                    self.said.push(format!("waits for {by_s} s first (script)"));
                }
                Wrong::Instead(other, word) => {
                    words = format!("{} (script: {word} instead)", in_words(other));
                    act = Some(other.clone());
                    self.lies = false;
                }
                other => {
                    if let Some(deed) = deed(other) {
                        self.due.push((now_s + after_s, deed));
                    }
                }
            }
        }
        let asked = match now.wanted {
            NowWanted::Wait => "nothing is asked".to_owned(),
            _ if is_for => {
                format!("{} is asked", now.word().replace('_', " "))
            }
            _ => {
                format!("{} is asked of {}", now.word().replace('_', " "), now.subjects.join(", "))
            }
        };
        let why = format!("{asked}, request {}", now.request);
        if let Some(act) = act {
            self.due.push((now_s + late_s, Deed::Does(act, format!("{words} ({why})"))));
        }
    }

    /// What is done because of this, and in words; nothing else than before, if it is no one's.
    fn wanted(&mut self, now: &Now) -> (Option<Act>, String) {
        let wanted = match now.is_for(self.order.subject.as_deref()) {
            true => now.wanted,
            false => NowWanted::Wait,
        };
        if wanted == NowWanted::LieStill || wanted == NowWanted::Wait && self.lies {
            let act = (!std::mem::replace(&mut self.lies, true)).then_some(Act::Table);
            return (act, in_words(&Act::Table));
        }
        self.lies = false;
        let stands = Act::Stay(Stays::NPose);
        let act = match (wanted, &now.action) {
            (NowWanted::TPose, _) => Act::Stay(Stays::TPose),
            (NowWanted::Move, _) => {
                let named = MOVEMENTS.iter().find(|(name, _)| *name == now.word());
                named.map_or(stands, |(_, movement)| Act::Move(*movement))
            }
            (NowWanted::Practise | NowWanted::Perform, Some(action)) => {
                match self.motion(&action.name) {
                    Ok(capture) => {
                        let words = format!("does {} again and again", action.name);
                        return (Some(Act::Repeat(capture, FIRST_S)), words);
                    }
                    Err(error) => {
                        let words = format!("stands, and does not know how to do it: {error}");
                        return (Some(stands), words);
                    }
                }
            }
            _ => stands,
        };
        let words = in_words(&act);
        (Some(act), words)
    }

    /// The motion of an action.
    fn motion(&mut self, name: &str) -> Result<Arc<Capture>, Error> {
        if let Some(known) = self.known.get(name) {
            return Ok(Arc::clone(known));
        }
        // What the file of a session says is taken for a name, and for nothing else.
        if !vocabulary::names().any(|shipped| shipped == name) {
            return Err(Error::of(ErrorKind::Unknown, "no such action ships with gaitway")
                .got(name)
                .remedy("name its motion: --action NAME=MOTION"));
        }
        let capture = captured(name)?;
        self.known.insert(name.to_owned(), Arc::clone(&capture));
        Ok(capture)
    }

    fn befalls(&mut self, deed: Deed, now_s: f64) {
        let text = match deed {
            Deed::Does(act, words) => {
                locked(&self.acting).does(act);
                words
            }
            Deed::Stumbles => {
                let direction_rad = std::f64::consts::TAU * self.random.random::<f64>();
                locked(&self.acting).stumbles(direction_rad);
                "stumbles (script)".to_owned()
            }
            Deed::Swaps(one, other) => {
                locked(&self.acting).swaps(one, other);
                let (one, other) = (segment_name(one), segment_name(other));
                format!("the sensors {one} and {other} change places (script)")
            }
            Deed::Loses(segment, for_s) => {
                let sensor = self.sensors.iter_mut().find(|sensor| sensor.segment == segment);
                if let Some(sensor) = sensor {
                    sensor.door = None;
                }
                self.due.push((now_s + for_s, Deed::Returns(segment)));
                format!("the sensor {} is pulled out for {for_s} s (script)", segment_name(segment))
            }
            Deed::Returns(segment) => match self.plug(segment) {
                Ok(()) => format!("the sensor {} is plugged in again", segment_name(segment)),
                Err(error) => {
                    self.due.push((now_s + ONCE_MORE_S, Deed::Returns(segment)));
                    format!("! {error}")
                }
            },
        };
        self.said.push(text);
    }

    fn plug(&mut self, segment: Segment) -> Result<(), Error> {
        let sensor = self.sensors.iter_mut().find(|sensor| sensor.segment == segment);
        let Some(sensor) = sensor else { return Ok(()) };
        sensor.door = Some(self.way.door(&self.stage, segment, sensor.imu.clone())?);
        Ok(())
    }
}

/// What is done in a mishap that has a time; of those that change what is asked, nothing.
fn deed(wrong: &Wrong) -> Option<Deed> {
    match wrong {
        Wrong::Stumble => Some(Deed::Stumbles),
        Wrong::Swap(one, other) => Some(Deed::Swaps(*one, *other)),
        Wrong::Lose(segment, for_s) => Some(Deed::Loses(*segment, *for_s)),
        Wrong::Late(_) | Wrong::Instead(..) => None,
    }
}

/// What somebody is seen to do.
fn in_words(act: &Act) -> String {
    match act {
        Act::Table => "the sensors lie on a table",
        Act::Stay(Stays::NPose) => "stands in N pose",
        Act::Stay(Stays::TPose) => "stands in T pose",
        Act::Stay(Stays::ArmsForward) => "holds both arms straight forward",
        Act::Stay(Stays::Sit) => "sits",
        Act::Move(Movement::Bow) => "bows and comes up again",
        Act::Move(Movement::SitToStand) => "sits down and stands up again",
        Act::Move(Movement::Bend) => "marches on the spot",
        Act::Move(Movement::RaiseArms) => "raises both arms and lowers them",
        Act::Repeat(..) => "does it again and again",
    }
    .to_owned()
}

fn captured(motion: &str) -> Result<Arc<Capture>, Error> {
    let (capture, _) = body_motion(motion, None, &Default::default())?;
    let lasts_s = capture.poses.len() as f64 / capture.rate_hz;
    if !(lasts_s <= LONGEST_S) {
        return Err(Error::new("the motion of an action is too long")
            .at(motion)
            .got(format!("{lasts_s:.0} s"))
            .allowed(format!("{LONGEST_S:.0} s")));
    }
    Ok(Arc::new(capture))
}

/// Every sensor that a script needs is worn.
fn check_worn(script: &MishapScript, worn: &[Segment], file: Option<&Path>) -> Result<(), Error> {
    let needed = script.mishaps.iter().flat_map(|mishap| match mishap.wrong {
        Wrong::Swap(one, other) => vec![one, other],
        Wrong::Lose(segment, _) => vec![segment],
        _ => Vec::new(),
    });
    let mut missing = needed.filter(|segment| !worn.contains(segment));
    match missing.next() {
        None => Ok(()),
        Some(segment) => Err(Error::new("the script needs a sensor that is not worn")
            .at(file.map_or_else(String::new, |file| file.display().to_string()))
            .got(segment_name(segment))
            .remedy("name it after --wear, or take it out of the script")),
    }
}
