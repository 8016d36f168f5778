//! Leads somebody through a calibration: in words at a terminal, or by time without one.

use super::operator::Operator;
use super::progress::Progress;
use super::sensors::Sensors;
use super::{Place, Wear};
use crate::body::Segment;
use crate::body::worn::calibrate::{calibrate, words};
use crate::body::worn::check::{
    PAIRS, T_POSE_FAIL_RAD, T_POSE_WARN_RAD, doubts, off_t_pose, restless, turned_rad,
};
use crate::body::worn::kept::{Kept, VALID_S};
use crate::body::worn::{Calibration, Moved, Movement, WornSensor};
use crate::error::Error;
use crate::mocap::mapping::segment_name;
use crate::port::Clock;
use crate::time::{Duration, Instant};
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
/// A movement has begun once a segment turned so far, rad.
const BEGUN_RAD: f64 = 0.35;
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

/// What somebody answered.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Answer {
    GoOn,
    Skip,
    Stop,
}

/// What every sensor said, `[place][sample]`.
type Series = Vec<Vec<DQuat>>;

/// Whoever leads. Functions return `None` if it is to end.
pub struct Guide<'a> {
    sensors: &'a mut Sensors,
    clock: &'a dyn Clock,
    operator: &'a Operator,
    worn: Vec<WornSensor>,
}

impl<'a> Guide<'a> {
    /// Leads somebody who wears these sensors. `clock` is the one that samples are stamped with.
    pub fn new(sensors: &'a mut Sensors, clock: &'a dyn Clock, operator: &'a Operator) -> Self {
        let worn = Wear { places: sensors.places().to_vec(), sources: Vec::new() }.worn();
        Self { sensors, clock, operator, worn }
    }

    /// Waits until every sensor says something that can be used.
    ///
    /// # Errors
    /// Sensors that stay silent, a map that no sensor is on.
    pub fn wait_for_sensors(&mut self) -> Result<Option<()>, Error> {
        let until = self.clock.now() + PATIENCE;
        if self.sensors.places().is_empty() {
            return self.wait_for_strangers();
        }
        while self.sensors.silent().next().is_some() {
            if self.pause(LOOK)?.is_none() {
                return Ok(None);
            }
            if self.clock.now() >= until {
                return Err(self.silence());
            }
        }
        let others: Vec<&str> = self.sensors.others().collect();
        if !others.is_empty() {
            self.say(&format!("nobody wears {}: not used", others.join(", ")));
        }
        Ok(Some(()))
    }

    /// Nothing is known to be worn: what is heard at least can be named.
    fn wait_for_strangers(&mut self) -> Result<Option<()>, Error> {
        if self.pause(PATIENCE / 3)?.is_none() {
            return Ok(None);
        }
        let heard: Vec<&str> = self.sensors.others().collect();
        Err(Error::new("which segment wears which sensor?")
            .got(match heard.is_empty() {
                true => "no sensor heard".to_owned(),
                false => format!("heard {}", heard.join(", ")),
            })
            .remedy("say it for each, e.g. --wear left_thigh=tracker-00aa01-0, or in a file"))
    }

    fn silence(&self) -> Error {
        let name = |place: &Place| match place.sensor == segment_name(place.segment) {
            true => place.sensor.clone(),
            false => format!("{} ({})", segment_name(place.segment), place.sensor),
        };
        let silent: Vec<String> = self.sensors.silent().map(name).collect();
        let others: Vec<&str> = self.sensors.others().collect();
        let error =
            Error::new("a sensor that is worn says nothing that can be used").at(silent.join(", "));
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
    pub fn calibrate(&mut self, plan: &Plan) -> Result<Option<Guided>, Error> {
        let Some(n_pose) = self.n_pose(plan.n_pose_after)? else { return Ok(None) };
        let mut t_pose = None;
        let mut off_t_pose_rad = Vec::new();
        if plan.t_pose && self.arms().next().is_some() {
            let Some(seen) = self.checked_t_pose(&n_pose)? else { return Ok(None) };
            (t_pose, off_t_pose_rad) = seen;
        }
        let mut moves = Vec::new();
        for &movement in &plan.moves {
            if self.turned_by(movement).next().is_none() {
                continue;
            }
            let Some(seen) = self.movement(movement, &n_pose)? else { return Ok(None) };
            moves.extend(seen);
        }
        let calibration = calibrate(&self.worn, &n_pose, t_pose.as_deref(), &moves)?;
        for note in &calibration.notes {
            self.say(note);
        }
        let doubts = doubts(&self.worn, &n_pose, t_pose.as_deref(), &moves);
        for doubt in &doubts {
            self.say(&format!("look: {doubt}"));
        }
        if let Some(t_pose) = &t_pose {
            off_t_pose_rad = off_t_pose(&calibration, t_pose)?;
        }
        self.sensors.forget();
        let sensors = self.sensors.places().iter().map(|place| place.sensor.clone()).collect();
        let (subject, made_unix_s) = (plan.subject.clone(), now_unix_s());
        let kept = Kept { subject, made_unix_s, sensors, calibration };
        Ok(Some(Guided { kept, off_t_pose_rad, doubts }))
    }

    /// Headings of a calibration that was kept, found anew in N pose.
    ///
    /// # Errors
    /// A calibration of other sensors; a sensor that has slipped.
    pub fn take_up(&mut self, kept: Kept, plan: &Plan) -> Result<Option<Guided>, Error> {
        let order = self.sensors.places().iter().map(|place| {
            let fits = |at: &usize| {
                kept.sensors.get(*at) == Some(&place.sensor)
                    && kept.calibration.mounts[*at].segment == place.segment
            };
            (0..kept.calibration.mounts.len()).find(fits).ok_or_else(|| {
                Error::new("this sensor is not in the calibration of the body")
                    .at(format!("{} on the {}", place.sensor, words(place.segment)))
                    .remedy("calibrate anew: add --recalibrate")
            })
        });
        let order = order.collect::<Result<Vec<usize>, Error>>()?;
        let age_s = kept.age_s(now_unix_s());
        if age_s > VALID_S {
            self.say(&format!(
                "the calibration of the body is {} hours old, and held for {}: straps \
                 move; --recalibrate makes a new one",
                age_s / 3600,
                VALID_S / 3600
            ));
        }
        let mounts = order.iter().map(|at| kept.calibration.mounts[*at]).collect();
        let sensors = order.iter().map(|at| kept.sensors[*at].clone()).collect();
        let known = Calibration { mounts, notes: Vec::new() };
        loop {
            let Some(n_pose) = self.n_pose(plan.n_pose_after)? else { return Ok(None) };
            match known.reheaded(&n_pose) {
                Ok(calibration) => {
                    self.sensors.forget();
                    let kept = Kept { sensors, calibration, ..kept };
                    let (off_t_pose_rad, doubts) = (Vec::new(), Vec::new());
                    return Ok(Some(Guided { kept, off_t_pose_rad, doubts }));
                }
                Err(error) if !self.operator.is_at_terminal() => return Err(error),
                Err(error) => self.say(&format!("{error}\nonce more")),
            }
        }
    }

    /// Three seconds of N pose, repeated until everybody stands still.
    ///
    /// # Errors
    /// Somebody who does not, without a terminal; sensors that are too slow.
    pub fn n_pose(&mut self, after: Option<Duration>) -> Result<Option<Series>, Error> {
        let asks = self.operator.is_at_terminal() && after.is_none();
        let usual = Duration::from_secs(3);
        let mut tries = 0;
        loop {
            tries += 1;
            self.say("N pose: upright, arms down, palms in, facing forward");
            let answer = match asks {
                true => self.ask("  Enter when you stand so; q ends")?,
                false => self.count_down(after.filter(|_| tries == 1).unwrap_or(usual))?,
            };
            if answer == Answer::Stop {
                return Ok(None);
            }
            self.say("  hold still for 3 s");
            let (from, to, said) = match self.held(HOLD)? {
                Some(held) => held,
                None => return Ok(None),
            };
            let Some((moved, rad)) = restless(&said) else {
                self.check_rates(from, to)?;
                self.say("  good");
                return Ok(Some(said));
            };
            let what = self.moved(moved, rad);
            if !asks && tries >= TRIES {
                return Err(Error::new("nobody stood still in N pose")
                    .got(what)
                    .remedy("stand still for three seconds and try again"));
            }
            self.say(&format!("  {what}: once more"));
        }
    }

    fn moved(&self, place: usize, rad: f64) -> String {
        let segment = self.sensors.places().get(place).map_or("", |p| segment_name(p.segment));
        match rad.is_finite() {
            true => format!("{segment} moved ({:.1} deg)", rad.to_degrees()),
            false => format!("{segment} said nothing"),
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

    /// T pose and how far segments are off in it; shown, and repeated while somebody wants to.
    #[allow(clippy::type_complexity)]
    fn checked_t_pose(
        &mut self,
        n_pose: &[Vec<DQuat>],
    ) -> Result<Option<(Option<Series>, Vec<(Segment, f64)>)>, Error> {
        // Movements come later: what only they tell makes no difference here, because segments other
        // than arms are turned alike in both poses.
        let known =
            |worn: &WornSensor| WornSensor { forward: worn.forward.or(Some(DVec3::X)), ..*worn };
        let worn: Vec<WornSensor> = self.worn.iter().map(known).collect();
        let mut tries = 0;
        loop {
            tries += 1;
            let Some(seen) = self.t_pose(n_pose)? else { return Ok(None) };
            let Some(said) = seen else { return Ok(Some((None, Vec::new()))) };
            let found = calibrate(&worn, n_pose, Some(&said), &[])?;
            let off = off_t_pose(&found, &said)?;
            let mut failed = false;
            for (segment, rad) in &off {
                let word = match *rad {
                    rad if rad <= T_POSE_WARN_RAD => "good",
                    rad if rad <= T_POSE_FAIL_RAD => "look",
                    _ => "too far",
                };
                failed |= !(*rad <= T_POSE_FAIL_RAD);
                let name = segment_name(*segment);
                self.say(&format!("  {name:<16} {:5.1} deg off  {word}", rad.to_degrees()));
            }
            if !failed {
                return Ok(Some((Some(said), off)));
            }
            let again = match self.operator.is_at_terminal() {
                true => self.ask("  Enter: once more; s: go on with it; q ends")?,
                false if tries < 3 => Answer::GoOn,
                false => {
                    let worst = off.iter().max_by(|a, b| a.1.total_cmp(&b.1));
                    let (segment, rad) = worst.copied().unwrap_or((Segment::Pelvis, 0.0));
                    return Err(Error::new("a segment is not where it belongs in T pose")
                        .at(words(segment))
                        .got(format!("{:.0} deg off", rad.to_degrees()))
                        .allowed(format!("{:.0} deg", T_POSE_FAIL_RAD.to_degrees()))
                        .remedy(
                            "is the sensor on the segment that was said? add --no-t-pose \
                                 to go without this check",
                        ));
                }
            };
            match again {
                Answer::GoOn => {}
                Answer::Skip => return Ok(Some((Some(said), off))),
                Answer::Stop => return Ok(None),
            }
        }
    }

    /// Waits for arms in the air that hold still. `Some(None)`: nobody raised them.
    fn t_pose(&mut self, n_pose: &[Vec<DQuat>]) -> Result<Option<Option<Series>>, Error> {
        self.say("T pose: arms straight out to the sides, palms down; hold");
        let arms: Vec<usize> = self.arms().collect();
        let until = self.clock.now() + WITHIN;
        self.sensors.listen();
        let mut up_since: Option<Instant> = None;
        let mut hint_at = self.clock.now() + HINT;
        loop {
            match self.look()? {
                Answer::GoOn => {}
                Answer::Skip => return Ok(Some(None)),
                Answer::Stop => return Ok(None),
            }
            let now = self.clock.now();
            let said = self.sensors.now();
            let is_up = |at: &usize| {
                let turned = turned_rad(&n_pose[*at], said[*at]?)?;
                Some(turned >= SPREAD_RAD)
            };
            if !arms.iter().all(|at| is_up(at) == Some(true)) {
                up_since = None;
                self.hint(&mut hint_at, "not up yet", &arms, n_pose, |rad| rad < SPREAD_RAD);
            } else {
                let since = *up_since.get_or_insert(now);
                if now.since(since) >= HOLD_SPREAD {
                    let from = Instant::from_nanos(
                        now.as_nanos().saturating_sub(HOLD_SPREAD.as_nanos() as u64 * 2 / 3),
                    );
                    let held = self.sensors.listened(from, now);
                    if restless(&held).is_none() {
                        return Ok(Some(Some(held)));
                    }
                }
            }
            if !self.operator.is_at_terminal() && now >= until {
                self.say("  no T pose was seen: the arms' headings are not checked");
                return Ok(Some(None));
            }
        }
    }

    /// One movement there and back. `Some(None)`: it was left out.
    fn movement(
        &mut self,
        movement: Movement,
        n_pose: &[Vec<DQuat>],
    ) -> Result<Option<Option<Moved>>, Error> {
        let turned: Vec<usize> = self.turned_by(movement).collect();
        self.say(&format!("then: {}", asked(movement)));
        let until = self.clock.now() + WITHIN;
        self.sensors.listen();
        let mut progress = Progress::default();
        let mut hint_at = self.clock.now() + HINT;
        let all: Vec<usize> = (0..self.worn.len()).collect();
        loop {
            match self.look()? {
                Answer::GoOn => {}
                Answer::Skip => return Ok(Some(None)),
                Answer::Stop => return Ok(None),
            }
            let now = self.clock.now();
            let said = self.sensors.now();
            let off = |at: usize| turned_rad(&n_pose[at], said[at]?);
            let is_back = (0..said.len()).all(|at| off(at).is_some_and(|rad| rad < BACK_RAD));
            let is_away = turned.iter().any(|at| off(*at).is_some_and(|rad| rad > BEGUN_RAD));
            if !is_back {
                let words = "not back yet";
                self.hint(&mut hint_at, words, &all, n_pose, |rad| !(rad < BACK_RAD));
            }
            if let Some(stood) = progress.take(now, is_back, is_away) {
                self.say("  good");
                let orientation = self.sensors.listened(stood, now);
                return Ok(Some(Some(Moved { movement, orientation })));
            }
            if !self.operator.is_at_terminal() && now >= until {
                self.say("  it was not seen: left out");
                return Ok(Some(None));
            }
        }
    }

    /// Says now and then which segments keep what is waited for from happening.
    fn hint(
        &self,
        at: &mut Instant,
        words: &str,
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
            let name = segment_name(self.worn[*place].segment);
            Some(format!("{name} ({:.0} deg from N pose)", turned.to_degrees()))
        });
        let wrong: Vec<String> = wrong.collect();
        if !wrong.is_empty() {
            self.say(&format!("  {words}: {}", wrong.join(", ")));
        }
    }

    /// What all sensors say for so long from now on.
    fn held(&mut self, time: Duration) -> Result<Option<(Instant, Instant, Series)>, Error> {
        self.sensors.listen();
        let from = self.clock.now();
        if self.pause(time)?.is_none() {
            return Ok(None);
        }
        let to = self.clock.now();
        // What was taken last is still on its way.
        if self.pause(Duration::from_millis(150))?.is_none() {
            return Ok(None);
        }
        Ok(Some((from, to, self.sensors.listened(from, to))))
    }

    fn count_down(&mut self, time: Duration) -> Result<Answer, Error> {
        let until = self.clock.now() + time;
        self.say(&format!("  in {:.0} s", time.as_secs_f64()));
        let left = until.since(self.clock.now());
        Ok(if self.pause(left)?.is_none() { Answer::Stop } else { Answer::GoOn })
    }

    /// Waits for Enter, s or q.
    fn ask(&mut self, question: &str) -> Result<Answer, Error> {
        self.say(question);
        loop {
            if self.pause(LOOK)?.is_none() {
                return Ok(Answer::Stop);
            }
            match self.operator.line().as_deref() {
                Some("") => return Ok(Answer::GoOn),
                Some("s") => return Ok(Answer::Skip),
                Some(other) => self.say(&format!("  {other:?}? Enter goes on, s skips, q ends")),
                None => {}
            }
        }
    }

    /// Lets a moment pass; s skips what is waited for.
    fn look(&mut self) -> Result<Answer, Error> {
        if self.pause(LOOK)?.is_none() {
            return Ok(Answer::Stop);
        }
        let skips = self.operator.line().as_deref() == Some("s");
        Ok(if skips { Answer::Skip } else { Answer::GoOn })
    }

    /// Lets time pass while sensors are heard.
    fn pause(&mut self, time: Duration) -> Result<Option<()>, Error> {
        let until = self.clock.now() + time;
        loop {
            let now = self.clock.now();
            self.sensors.hear(now);
            if self.operator.wants_to_stop() {
                return Ok(None);
            }
            if let Some((sensor, why)) = self.sensors.ended() {
                return Err(Error::new("a sensor that is worn is gone")
                    .at(format!("sensor {sensor}"))
                    .got(why.clone())
                    .remedy("plug it in or switch it on, and give the same command again"));
            }
            if self.sensors.is_over() {
                return Err(Error::new("the recording ended during the calibration")
                    .remedy("record N pose first, or take up a calibration that was kept"));
            }
            if now >= until {
                return Ok(Some(()));
            }
            self.clock.sleep_until((now + LOOK).min(until));
        }
    }

    /// Says something to whoever is led: they must know, however quiet the rest is.
    fn say(&self, text: &str) {
        crate::cli::say(text);
    }
}

/// The wall clock, s since 1970.
fn now_unix_s() -> u64 {
    SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_secs()
}

/// A movement as a person is asked for it.
fn asked(movement: Movement) -> &'static str {
    match movement {
        Movement::Bow => "bow with a straight back, and come up again",
        Movement::SitToStand => "sit down and stand up again",
        Movement::Bend => {
            "march on the spot, feet pulled along, elbows bending, arms at the sides; then stand"
        }
        Movement::RaiseArms => "raise both straight arms forward and lower them",
    }
}
