//! Leads somebody through a calibration, by their answers or, where nobody can answer, by time.

use super::person::{Answer, Cue, Person, Question, Unseen, Until};
use super::progress::Progress;
use super::sensors::Sensors;
use super::{Place, Wear};
use crate::body::Segment;
use crate::body::segment_name;
use crate::body::worn::calibrate::{calibrate, words};
use crate::body::worn::check::{
    PAIRS, T_POSE_FAIL_RAD, doubts, has_begun, off_t_pose, restless, turned_rad,
};
use crate::body::worn::kept::{Kept, VALID_S};
use crate::body::worn::{Calibration, Moved, Movement, WornSensor};
use crate::error::Error;
use crate::port::Clock;
use crate::time::{Duration, Instant, Utc};
use core::f64::consts::FRAC_PI_2;
use glam::{DQuat, DVec3};
use std::time::{SystemTime, UNIX_EPOCH};

/// How often it is looked what sensors say.
const LOOK: Duration = Duration::from_millis(20);
/// A pose is held so long.
const HOLD: Duration = Duration::from_secs(3);
/// In T pose, which arms in the air tell by themselves, so long.
const HOLD_SPREAD: Duration = Duration::from_millis(1500);
/// Sensors say something within this time, or something is wrong with them.
const PATIENCE: Duration = Duration::from_secs(15);
/// Without a terminal, a pose or a movement comes within this time.
const WITHIN: Duration = Duration::from_secs(30);
/// Who waits for a pose that does not come is told why, this often.
const HINT: Duration = Duration::from_secs(6);
/// Without a terminal, so many tries to stand still.
const TRIES: usize = 10;
/// Arms are up once each has turned so far from N pose, rad.
const SPREAD_RAD: f64 = FRAC_PI_2 - 0.6;
/// It is over once all are so near to N pose again, rad.
const BACK_RAD: f64 = 0.15;
/// Slower sensors could not be followed, Hz: their poses would be too old.
const LEAST_RATE_HZ: f64 = 20.0;

/// What is asked for.
#[derive(Clone, Debug, Default)]
pub struct Plan {
    /// Begin N pose after this time instead of asking for Enter; without a terminal 3 s.
    pub n_pose_after: Option<Duration>,
    /// Ask for T pose.
    pub t_pose: bool,
    /// Movements to be done.
    pub moves: Vec<Movement>,
    /// Who wears the sensors.
    pub subject: String,
}

/// What came of a guided calibration.
#[derive(Clone, Debug, PartialEq)]
pub struct Guided {
    /// The calibration, as it can be kept.
    pub kept: Kept,
    /// How far each segment was from where it belongs in T pose, rad; empty if that was not seen.
    pub off_t_pose_rad: Vec<(Segment, f64)>,
    /// Sensors that seem to be on another segment than was said.
    pub doubts: Vec<String>,
}

/// Why it is over before its end.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Ended {
    /// Whoever is led wants it to end.
    Stopped,
    /// Something that asking again does not mend.
    Failed(Error),
}

impl From<Error> for Ended {
    fn from(error: Error) -> Self {
        Self::Failed(error)
    }
}

/// What every sensor said, `[place][sample]`.
type Series = Vec<Vec<DQuat>>;

/// What was said in T pose, if that was seen, and how far each segment was off in it, rad.
type SeenTPose = (Option<Series>, Vec<(Segment, f64)>);

/// Whoever leads.
pub struct Guide<'a> {
    sensors: &'a mut Sensors,
    clock: &'a dyn Clock,
    person: &'a dyn Person,
    worn: Vec<WornSensor>,
}

impl<'a> Guide<'a> {
    /// Leads somebody who wears these sensors. `clock` is the one that samples are stamped with.
    pub fn new(sensors: &'a mut Sensors, clock: &'a dyn Clock, person: &'a dyn Person) -> Self {
        let worn = Wear { places: sensors.places().to_vec(), sources: Vec::new() }.worn();
        Self { sensors, clock, person, worn }
    }

    /// Waits until every sensor says something that can be used.
    ///
    /// # Errors
    /// Sensors that stay silent, a map that no sensor is on.
    pub fn wait_for_sensors(&mut self) -> Result<(), Ended> {
        let until = self.clock.now() + PATIENCE;
        if self.sensors.places().is_empty() {
            return self.wait_for_strangers();
        }
        while self.sensors.silent().next().is_some() {
            self.pause(LOOK)?;
            if self.clock.now() >= until {
                return Err(self.silence().into());
            }
        }
        let others: Vec<&str> = self.sensors.others().collect();
        if !others.is_empty() {
            self.person.tell(Cue::Unused(&others));
        }
        Ok(())
    }

    /// Nothing is known to be worn: what is heard at least can be named.
    fn wait_for_strangers(&mut self) -> Result<(), Ended> {
        self.pause(PATIENCE / 3)?;
        let heard: Vec<&str> = self.sensors.others().collect();
        Err(Error::new("which segment wears which sensor?")
            .got(match heard.is_empty() {
                true => "no sensor heard".to_owned(),
                false => format!("heard {}", heard.join(", ")),
            })
            .remedy("say it for each, e.g. --wear left_thigh=tracker-00aa01-0, or in a file")
            .into())
    }

    fn silence(&self) -> Error {
        let name = |place: &Place| match place.sensor == segment_name(place.segment) {
            true => place.sensor.clone(),
            false => format!("{} ({})", segment_name(place.segment), place.sensor),
        };
        let silent: Vec<String> = self.sensors.silent().map(name).collect();
        let others: Vec<&str> = self.sensors.others().collect();
        let error = Error::new("a worn sensor sends nothing usable").at(silent.join(", "));
        match others.is_empty() {
            true => error.remedy("is it switched on, and does its profile fit?"),
            false => error
                .got(format!("others are heard: {}", others.join(", ")))
                .remedy("do the names after --wear fit?"),
        }
    }

    /// The whole calibration.
    ///
    /// # Errors
    /// Somebody who does not stand still or sensors whose headings nothing tells, without a
    /// terminal to try again at; a sensor that ends.
    pub fn calibrate(&mut self, plan: &Plan) -> Result<Guided, Ended> {
        let asks_t_pose = plan.t_pose && self.arms().next().is_some();
        let turns = |movement: &Movement| self.turned_by(*movement).next().is_some();
        let movements: Vec<Movement> = plan.moves.iter().copied().filter(turns).collect();
        let mut after = movements.iter().map(|movement| Cue::Move(*movement));
        let next = if asks_t_pose { Some(Cue::TPose) } else { after.next() };
        self.announce(next);
        let n_pose = self.n_pose(plan.n_pose_after)?;
        let mut t_pose = None;
        let mut off_t_pose_rad = Vec::new();
        if asks_t_pose {
            self.announce(after.next());
            (t_pose, off_t_pose_rad) = self.checked_t_pose(&n_pose)?;
        }
        let mut moves = Vec::new();
        for movement in &movements {
            self.announce(after.next());
            moves.extend(self.movement(*movement, &n_pose)?);
        }
        let calibration = calibrate(&self.worn, &n_pose, t_pose.as_deref(), &moves)?;
        for note in &calibration.notes {
            self.person.tell(Cue::Note(note));
        }
        let doubts = doubts(&self.worn, &n_pose, t_pose.as_deref(), &moves);
        for doubt in &doubts {
            self.person.tell(Cue::Doubt(doubt));
        }
        if let Some(t_pose) = &t_pose {
            off_t_pose_rad = off_t_pose(&calibration, t_pose)?;
        }
        self.sensors.forget();
        let sensors = self.sensors.places().iter().map(|place| place.sensor.clone()).collect();
        let (subject, made_unix_s) = (plan.subject.clone(), wall_clock().0);
        let kept = Kept { subject, made_unix_s, sensors, calibration };
        Ok(Guided { kept, off_t_pose_rad, doubts })
    }

    /// Says what is asked for after what is asked for now, if there is anything.
    fn announce(&self, next: Option<Cue<'_>>) {
        if let Some(cue) = next {
            self.person.tell(Cue::Next(&cue));
        }
    }

    /// Headings of a calibration that was kept, found anew in N pose.
    ///
    /// # Errors
    /// A calibration of other sensors; a sensor that has slipped.
    pub fn take_up(&mut self, kept: Kept, plan: &Plan) -> Result<Guided, Ended> {
        let order = self.sensors.places().iter().map(|place| {
            let fits = |at: &usize| {
                kept.sensors.get(*at) == Some(&place.sensor)
                    && kept.calibration.mounts[*at].segment == place.segment
            };
            (0..kept.calibration.mounts.len()).find(fits).ok_or_else(|| {
                Error::new("this sensor is not in the calibration of the body")
                    .at(format!("{} on the {}", place.sensor, words(place.segment)))
                    .remedy("calibrate again: add --recalibrate")
            })
        });
        let order = order.collect::<Result<Vec<usize>, Error>>()?;
        let age_s = kept.age_s(wall_clock().0);
        if age_s > VALID_S {
            let (hours, held_hours) = (age_s / 3600, VALID_S / 3600);
            self.person.tell(Cue::Old { hours, held_hours });
        }
        let mounts = order.iter().map(|at| kept.calibration.mounts[*at]).collect();
        let sensors = order.iter().map(|at| kept.sensors[*at].clone()).collect();
        let known = Calibration { mounts, notes: Vec::new() };
        loop {
            let n_pose = self.n_pose(plan.n_pose_after)?;
            match known.reheaded(&n_pose) {
                Ok(calibration) => {
                    self.sensors.forget();
                    let kept = Kept { sensors, calibration, ..kept };
                    let (off_t_pose_rad, doubts) = (Vec::new(), Vec::new());
                    return Ok(Guided { kept, off_t_pose_rad, doubts });
                }
                Err(error) if !self.person.can_answer() => return Err(error.into()),
                Err(error) => self.person.tell(Cue::Again(&error)),
            }
        }
    }

    /// Three seconds of N pose, repeated until everybody stands still.
    ///
    /// # Errors
    /// Somebody who does not, without a terminal; sensors that are too slow.
    pub fn n_pose(&mut self, after: Option<Duration>) -> Result<Series, Ended> {
        let asks = self.person.can_answer() && after.is_none();
        let usual = Duration::from_secs(3);
        let mut tries = 0;
        loop {
            tries += 1;
            self.person.tell(Cue::NPose);
            if asks {
                self.ask(Question::Stands)?;
            } else {
                let time = after.filter(|_| tries == 1).unwrap_or(usual);
                self.person.tell(Cue::In(time));
                self.pause(time)?;
            }
            self.person.tell(Cue::HoldStill(HOLD));
            let (from, to, said) = self.held(HOLD)?;
            let Some((place, rad)) = restless(&said) else {
                self.check_rates(from, to)?;
                self.person.tell(Cue::Good);
                return Ok(said);
            };
            let segment = self.worn[place].segment;
            if !asks && tries >= TRIES {
                let name = segment_name(segment);
                let what = match rad.is_finite() {
                    true => format!("{name} moved ({:.1} deg)", rad.to_degrees()),
                    false => format!("{name} said nothing"),
                };
                return Err(Error::new("the subject did not stand still in N pose")
                    .got(what)
                    .remedy("stand still for three seconds and try again")
                    .into());
            }
            self.person.tell(Cue::Moved { segment, rad });
        }
    }

    fn check_rates(&self, from: Instant, to: Instant) -> Result<(), Error> {
        for (at, place) in self.sensors.places().iter().enumerate() {
            let rate_hz = self.sensors.rate_hz(at, from, to);
            if !(rate_hz >= LEAST_RATE_HZ) {
                return Err(Error::new("a sensor is too slow to be followed")
                    .at(format!("{} ({})", segment_name(place.segment), place.sensor))
                    .got(format!("{rate_hz:.0} samples per second"))
                    .allowed(format!("at least {LEAST_RATE_HZ:.0}"))
                    .remedy("set the sensor to a higher rate"));
            }
        }
        Ok(())
    }

    fn arms(&self) -> impl Iterator<Item = usize> {
        let is_arm = |segment| PAIRS[..2].iter().flatten().any(|arm| *arm == segment);
        (0..self.worn.len()).filter(move |at| is_arm(self.worn[*at].segment))
    }

    fn turned_by(&self, movement: Movement) -> impl Iterator<Item = usize> {
        let turns = move |segment| movement.turns().iter().any(|(turned, _)| *turned == segment);
        (0..self.worn.len()).filter(move |at| turns(self.worn[*at].segment))
    }

    /// T pose, if it was seen, and how far segments are off in it; repeated while somebody wants to.
    fn checked_t_pose(&mut self, n_pose: &[Vec<DQuat>]) -> Result<SeenTPose, Ended> {
        // Movements come later: what only they tell makes no difference here, because segments other
        // than arms are turned alike in both poses.
        let known =
            |worn: &WornSensor| WornSensor { forward: worn.forward.or(Some(DVec3::X)), ..*worn };
        let worn: Vec<WornSensor> = self.worn.iter().map(known).collect();
        let mut tries = 0;
        loop {
            tries += 1;
            let Some(said) = self.t_pose(n_pose)? else { return Ok((None, Vec::new())) };
            let found = calibrate(&worn, n_pose, Some(&said), &[])?;
            let off = off_t_pose(&found, &said)?;
            for &(segment, rad) in &off {
                self.person.tell(Cue::OffTPose { segment, rad });
            }
            if off.iter().all(|(_, rad)| *rad <= T_POSE_FAIL_RAD) {
                return Ok((Some(said), off));
            }
            if self.person.can_answer() {
                if self.ask(Question::TPoseAgain)? == Answer::Skip {
                    return Ok((Some(said), off));
                }
            } else if tries >= 3 {
                let worst = off.iter().max_by(|a, b| a.1.total_cmp(&b.1));
                let (segment, rad) = worst.copied().unwrap_or((Segment::Pelvis, 0.0));
                return Err(Error::new("a segment is not where it belongs in T pose")
                    .at(words(segment))
                    .got(format!("{:.0} deg off", rad.to_degrees()))
                    .allowed(format!("{:.0} deg", T_POSE_FAIL_RAD.to_degrees()))
                    .remedy(
                        "check that the sensor is on the segment you named, or add --no-t-pose to go \
                         without this check",
                    )
                    .into());
            }
        }
    }

    /// Waits for arms in the air that hold still; `None` if nobody raised them.
    fn t_pose(&mut self, n_pose: &[Vec<DQuat>]) -> Result<Option<Series>, Ended> {
        self.person.tell(Cue::TPose);
        let arms: Vec<usize> = self.arms().collect();
        let until = self.clock.now() + WITHIN;
        self.sensors.listen();
        let mut up_since: Option<Instant> = None;
        let mut hint_at = self.clock.now() + HINT;
        loop {
            if self.look()? == Some(Answer::Skip) {
                return Ok(None);
            }
            let now = self.clock.now();
            let said = self.sensors.now();
            let is_up = |at: &usize| {
                let turned = turned_rad(&n_pose[*at], said[*at]?)?;
                Some(turned >= SPREAD_RAD)
            };
            if !arms.iter().all(|at| is_up(at) == Some(true)) {
                up_since = None;
                self.hint(&mut hint_at, Until::Up, &arms, n_pose, |rad| rad < SPREAD_RAD);
            } else {
                let since = *up_since.get_or_insert(now);
                if now.since(since) >= HOLD_SPREAD {
                    let from = Instant::from_nanos(
                        now.as_nanos().saturating_sub(HOLD_SPREAD.as_nanos() as u64 * 2 / 3),
                    );
                    let held = self.sensors.listened(from, now);
                    if restless(&held).is_none() {
                        return Ok(Some(held));
                    }
                }
            }
            if !self.person.can_answer() && now >= until {
                self.person.tell(Cue::Unseen(Unseen::TPose));
                return Ok(None);
            }
        }
    }

    /// One movement there and back; `None` if it was left out.
    fn movement(
        &mut self,
        movement: Movement,
        n_pose: &[Vec<DQuat>],
    ) -> Result<Option<Moved>, Ended> {
        self.person.tell(Cue::Move(movement));
        let until = self.clock.now() + WITHIN;
        self.sensors.listen();
        let mut progress = Progress::default();
        let mut hint_at = self.clock.now() + HINT;
        let all: Vec<usize> = (0..self.worn.len()).collect();
        loop {
            if self.look()? == Some(Answer::Skip) {
                return Ok(None);
            }
            let now = self.clock.now();
            let said = self.sensors.now();
            let off = |at: usize| turned_rad(&n_pose[at], said[at]?);
            let is_back = (0..said.len()).all(|at| off(at).is_some_and(|rad| rad < BACK_RAD));
            let begun = |at: usize, rad| has_begun(movement, self.worn[at].segment, rad);
            let is_away = all.iter().any(|at| off(*at).is_some_and(|rad| begun(*at, rad)));
            if !is_back {
                self.hint(&mut hint_at, Until::Back, &all, n_pose, |rad| !(rad < BACK_RAD));
            } else if now >= hint_at && !progress.has_begun() {
                hint_at = now + HINT;
                self.person.tell(Cue::Waiting { until: Until::Begun, segments: &[] });
            }
            if let Some(stood) = progress.take(now, is_back, is_away) {
                self.person.tell(Cue::Good);
                let orientation = self.sensors.listened(stood, now);
                return Ok(Some(Moved { movement, orientation }));
            }
            if !self.person.can_answer() && now >= until {
                self.person.tell(Cue::Unseen(Unseen::Movement));
                return Ok(None);
            }
        }
    }

    /// Says now and then which segments keep what is waited for from happening.
    fn hint(
        &self,
        at: &mut Instant,
        until: Until,
        places: &[usize],
        n_pose: &[Vec<DQuat>],
        is_wrong: impl Fn(f64) -> bool,
    ) {
        let now = self.clock.now();
        if now < *at {
            return;
        }
        *at = now + HINT;
        let said = self.sensors.now();
        let wrong = places.iter().filter_map(|place| {
            let turned = turned_rad(&n_pose[*place], said[*place]?).filter(|rad| is_wrong(*rad))?;
            Some((self.worn[*place].segment, turned))
        });
        let segments: Vec<(Segment, f64)> = wrong.collect();
        if !segments.is_empty() {
            self.person.tell(Cue::Waiting { until, segments: &segments });
        }
    }

    /// What all sensors say for so long from now on.
    fn held(&mut self, time: Duration) -> Result<(Instant, Instant, Series), Ended> {
        self.sensors.listen();
        let from = self.clock.now();
        self.pause(time)?;
        let to = self.clock.now();
        // What was taken last is still on its way.
        self.pause(Duration::from_millis(150))?;
        Ok((from, to, self.sensors.listened(from, to)))
    }

    /// Waits for an answer.
    fn ask(&mut self, question: Question) -> Result<Answer, Ended> {
        self.person.tell(Cue::Ask(question));
        loop {
            match self.look()? {
                Some(Answer::Other(words)) => self.person.tell(Cue::Unknown(&words)),
                Some(answer) => return Ok(answer),
                None => {}
            }
        }
    }

    /// Lets a moment pass; what was answered in it.
    fn look(&mut self) -> Result<Option<Answer>, Ended> {
        self.pause(LOOK)?;
        Ok(self.person.answer())
    }

    /// Lets time pass while sensors are heard.
    fn pause(&mut self, time: Duration) -> Result<(), Ended> {
        let until = self.clock.now() + time;
        loop {
            let now = self.clock.now();
            self.sensors.hear(now);
            if self.person.wants_to_stop() {
                return Err(Ended::Stopped);
            }
            if let Some((sensor, why)) = self.sensors.ended() {
                return Err(Error::new("a worn sensor is gone")
                    .at(format!("sensor {sensor}"))
                    .got(why.clone())
                    .remedy("plug it in or switch it on, and try again")
                    .into());
            }
            if self.sensors.is_over() {
                return Err(Error::new("the recording ended during the calibration")
                    .remedy("record N pose first, or take up a calibration that was kept")
                    .into());
            }
            if now >= until {
                return Ok(());
            }
            self.clock.sleep_until((now + LOOK).min(until));
        }
    }
}

/// The wall clock of this machine.
#[must_use]
pub fn wall_clock() -> Utc {
    Utc(SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_secs())
}
