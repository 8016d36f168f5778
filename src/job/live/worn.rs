//! A robot that does what a person who wears sensors does.

use super::lost::{self, Lost};
use super::naming::{HowNamed, LiveWord, NamedBody, Naming, PosedNow};
use super::onto_robot::{FollowingBody, OntoRobot};
use super::performer::LONGEST_WAIT_S;
use super::report::{self, BodyReport, LiveReport};
use super::when::{self, Answer, Answers, AnswersReport, Call, CheckedAnswer, Overheard, When};
use super::{Job, Ready};
use crate::body::Segment;
use crate::body::worn::calibrate::words;
use crate::body::worn::calm::Calm;
use crate::body::worn::doubt::Doubts;
use crate::body::worn::kept::Kept;
use crate::body::worn::limb::{LimbChange, WornLimb, WornLimbs};
use crate::body::worn::swaps::SwapWatch;
use crate::body::worn::{Wearing, WornPose};
use crate::body::{segment_name, segment_named};
use crate::capture::Counts;
use crate::control::{self, Balanced, Input, Performance, Planned, Stop, StopCode, StopReason};
use crate::corpus::store::check_outside;
use crate::draft;
use crate::error::{Error, ErrorKind};
use crate::job::heard::Rates;
use crate::job::model::robot_model;
use crate::job::observer::{Event, Meter, Observer, Progress};
use crate::job::page::live::TOLD_HZ;
use crate::job::play::{self, describe_virtual};
use crate::job::recognise::EquationReading;
use crate::job::recorder::RunRecorder;
use crate::job::report::{Outcome, PlayReport};
use crate::job::source::{MotionOrder, RobotMotion};
use crate::mocap::retarget::{self, Online};
use crate::motion::follow::STALE_S;
use crate::motion::{Target, Trend};
use crate::port::{Clock, MonotonicClock};
use crate::recognise::stream::LONGEST_GAP_S;
use crate::recording::read_orientations;
use crate::rig::Connection;
use crate::robot::preflight::Preflight;
use crate::sensing::{
    Ended, Feed, Guide, Guided, Intake, LOOK, Person, Place, SensingEvent, Sensors, Source,
    SourceReport, StopAtEnd, Wear,
};
use crate::session::files::BODY_KEY;
use crate::time::{Duration, Instant};
use glam::{DQuat, DVec3};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Sender, channel};

/// Tables per second.
const SHOWN_HZ: f64 = 4.0;
/// Time between two looks at how sensors are heard.
const EVERY: Duration = Duration::from_millis(500);
/// Poses per second where no robot asks for them.
const POSES_HZ: f64 = 50.0;

impl Job<'_> {
    /// Calibrates who wears the sensors, then lets the robot follow, or shows angles.
    pub(super) fn follow_sensors(&mut self) -> Result<(), Error> {
        let order = self.order;
        let (wear, replayed) = self.wear()?;
        let mut worn = [false; 13];
        for place in &wear.places {
            worn[place.segment.index()] = true;
        }
        when::check(&order.when, order.models.as_deref(), &worn)?;
        let ready = self.robot()?;
        let answers = self.answers(ready.as_ref())?;
        let real_time = ready.as_ref().is_none_or(|ready| ready.connection.real_time);
        if !real_time && replayed.is_none() {
            return Err(Error::new(
                "sensors run in real time, but this robot runs in virtual time",
            )
            .at("--bus")
            .got("sim")
            .remedy("take --bus sim:pty: the virtual robot in real time"));
        }
        let worn: Vec<String> = wear.places.iter().map(|place| place.sensor.clone()).collect();
        let mut opened = Vec::new();
        for source in &wear.sources {
            opened.push(source.open(&worn)?);
        }
        let recorder = match &ready {
            Some(ready) => Some(self.recorder_for_sensors(&ready.connection)?),
            None => self.recorder_without_robot()?,
        };
        let kept = recorder.as_ref().and_then(RunRecorder::shared);
        let stop = AtomicBool::new(false);
        let observer = self.observer;
        let tell_event = |event: SensingEvent<'_>| observer.hear(Event::Sensing(event));
        let mode = order.mode;
        let intake = Intake::new(kept.as_deref(), &stop, mode, &tell_event);
        let intake = if order.keep_going { intake.patient() } else { intake };
        let (sender, receiver) = channel();
        let monotonic: Arc<dyn Clock> = Arc::new(MonotonicClock);
        let clock =
            ready.as_ref().map_or(monotonic, |ready| Arc::clone(ready.connection.link.clock()));
        let intake = intake.heard_by(sender, Arc::clone(&clock));
        let patience = ready.as_ref().and_then(|ready| ready.connection.patience.clone());
        let is_replay = replayed.is_some();
        let feed = replayed.unwrap_or(Feed::Live(receiver));
        let mut sensors = Sensors::new(wear.places, feed);
        let done = std::thread::scope(|scope| {
            let _stop = StopAtEnd(&stop);
            for source in opened {
                let intake = &intake;
                scope.spawn(move || source.record(intake));
            }
            // The loop may not wait for a terminal: what it has to say is said elsewhere.
            let (tell, told) = channel::<LiveWord>();
            let mut marks = lost::LostMarks::of(kept.clone(), patience);
            scope.spawn(move || {
                told.into_iter().for_each(|told| match told {
                    LiveWord::Words(text) => observer.hear(Event::Note(&text)),
                    LiveWord::Marked(at, text) => {
                        observer.hear(Event::Note(&text));
                        marks.take(at, text);
                    }
                    LiveWord::Recognised(event) => observer.hear(Event::Recognised(&event)),
                    LiveWord::Posed(posed) => {
                        let PosedNow { pose, sensors, angles, age_s } = &*posed;
                        observer.hear(Event::Posed { pose, sensors, angles, age_s: *age_s });
                    }
                });
            });
            if observer.looks() {
                let (intake, stop) = (&intake, &stop);
                scope.spawn(move || tell_heard(intake, stop, observer));
            }
            self.led(&mut sensors, ready, recorder, answers, tell, &*clock)
        });
        self.report.sensors = match is_replay {
            false => intake.into_reports(),
            true => replay_reports(&sensors),
        };
        self.report.sensors.sort_by(|a, b| a.name.cmp(&b.name));
        drop(kept);
        let (left, result) = done;
        match left {
            Some((mut recorder, Some(ready))) => {
                recorder.finish(&mut self.report.run, &ready.connection);
            }
            Some((mut recorder, None)) => recorder.finish_without_robot(&mut self.report.run),
            None => {}
        }
        result
    }

    /// Who wears what, and the recording that speaks for them if it is one.
    fn wear(&self) -> Result<(Wear, Option<Feed>), Error> {
        let replays: Vec<&str> =
            self.order.from.iter().filter_map(|from| from.strip_prefix("replay:")).collect();
        let [replay] = replays.as_slice() else {
            let unknown = |error: Error| {
                Error {
                allowed: Some(
                    "SEGMENT=imu:PROFILE@BUS, imu:slimevr@udp:0.0.0.0:6969, imu:natnet@udp:ADDRESS:1510, or, alone, \
                     replay:FILE.mcap or file:MOTION"
                        .into(),
                ),
                ..error
            }
            };
            let sources =
                self.order.from.iter().map(|text| text.parse::<Source>().map_err(unknown));
            let sources = sources.collect::<Result<Vec<_>, Error>>()?;
            return Ok((Wear::of(sources, &self.order.wear)?, None));
        };
        if self.order.from.len() > 1 {
            return Err(Error::new("a recording cannot be followed together with other sources")
                .at("--from"));
        }
        let samples = read_orientations(Path::new(replay))?;
        let mut wear = Wear::of(Vec::new(), &self.order.wear)?;
        if !wear.sources.is_empty() {
            return Err(Error::new("a recording cannot be followed together with other sources")
                .at("--wear"));
        }
        let mut names: Vec<Arc<str>> = samples.iter().map(|s| Arc::clone(&s.sensor)).collect();
        names.sort();
        names.dedup();
        for name in &names {
            // What was said at the command line wins over how a sensor was named when it was recorded.
            let Ok(segment) = segment_named(name) else { continue };
            let is_taken = |place: &Place| *place.sensor == **name || place.segment == segment;
            if !wear.places.iter().any(is_taken) {
                wear.put(name, name, Some(DVec3::X))?;
            }
        }
        if wear.places.is_empty() {
            return Err(Error::new("which segment wears which sensor?")
                .got(format!("recorded: {}", names.join(", ")))
                .remedy("say it for each, e.g. --wear left_thigh=NAME"));
        }
        Ok((wear, Some(Feed::replay(samples))))
    }

    /// Calibrates and follows while the readers run.
    fn led(
        &mut self,
        sensors: &mut Sensors,
        ready: Option<Ready>,
        mut recorder: Option<RunRecorder>,
        answers: Answers,
        tell: Sender<LiveWord>,
        clock: &dyn Clock,
    ) -> (Option<Recorded>, Result<(), Error>) {
        let guided = match self.calibrated(sensors, clock) {
            Ok(guided) => guided,
            Err(ended) => {
                let kept = worth_keeping(recorder, ready.as_ref());
                let result = match ended {
                    Ended::Failed(error) => Err(error),
                    Ended::Stopped => {
                        self.report.run.describe_stopped();
                        Ok(())
                    }
                };
                return (kept.map(|recorder| (recorder, None)), result);
            }
        };
        self.report.body = Some(BodyReport::of(&guided));
        // How the sensors are worn is known only now; without it nobody could be seen in the recording.
        if let Some((recorder, text)) = recorder.as_mut().zip(guided.kept.text().ok()) {
            recorder.tell(BODY_KEY, text);
        }
        let wearing = Wearing::new(&guided.kept.calibration);
        self.report.worn = wearing.worn();
        let naming = match self.naming(recorder.as_ref()) {
            Ok(naming) => naming,
            Err(error) => {
                let kept = worth_keeping(recorder, ready.as_ref());
                return (kept.map(|recorder| (recorder, None)), Err(error));
            }
        };
        let mut body = Body::new(sensors, wearing, self.person, tell, self.order.time);
        // What was typed while somebody was calibrated meant nothing that comes now.
        let _ = (self.person.wants_a_reset(), self.person.agrees());
        body.naming = naming;
        body.answers = answers;
        body.leads = !self.order.dry_run;
        body.insists = self.order.despite_swaps;
        body.looks = self.observer.looks();
        if self.order.keep_going {
            let stands = ready.as_ref().map(|ready| stands(&ready.connection)).transpose();
            let stands = match stands {
                Ok(stands) => stands.unwrap_or(false),
                Err(error) => {
                    let kept = worth_keeping(recorder, ready.as_ref());
                    return (kept.map(|recorder| (recorder, None)), Err(error));
                }
            };
            body.keep_going(WornLimbs::new(|limb| !(stands && limb.is_leg())));
        }
        let done = match (ready, recorder) {
            (Some(ready), Some(recorder)) if !self.order.dry_run => {
                match self.mirrored(&mut body, ready, recorder) {
                    Ok(run) => (run.map(|(recorder, ready)| (recorder, Some(ready))), Ok(())),
                    Err(error) => (None, Err(error)),
                }
            }
            (ready, recorder) => {
                self.show(&mut body, clock);
                (recorder.map(|recorder| (recorder, ready)), Ok(()))
            }
        };
        self.named = body.describe(&mut self.report);
        done
    }

    /// Who names what the body does, if somebody is to.
    fn naming(&self, recorder: Option<&RunRecorder>) -> Result<Option<Naming>, Error> {
        let order = self.order;
        if !order.names() {
            return Ok(None);
        }
        let shared = recorder.and_then(RunRecorder::shared);
        let how = self.how.clone().unwrap_or_else(|| HowNamed {
            models: order.models.clone(),
            equations: EquationReading::Repaired,
            slowed: 1.0,
            keeps_poses: false,
        });
        Naming::new(&how, shared).map(Some)
    }

    /// Takes up the calibration of the body, or makes one and keeps it.
    fn calibrated(&mut self, sensors: &mut Sensors, clock: &dyn Clock) -> Result<Guided, Ended> {
        let order = self.order;
        let plan = &order.plan;
        let file = order.body_calibration.as_deref();
        let known = match file.filter(|path| path.exists() && !order.recalibrate) {
            None => None,
            Some(path) => {
                let text = gaitway_profiles::read_text(path).map_err(Error::from)?;
                Some(Kept::parse(&text).map_err(|e| e.at(path.display().to_string()))?)
            }
        };
        let mut guide = Guide::new(sensors, clock, self.person);
        guide.wait_for_sensors()?;
        if let Some(kept) = known {
            return guide.take_up(kept, plan);
        }
        let guided = guide.calibrate(plan)?;
        if !(guided.doubts.is_empty() || order.dry_run || order.despite_swaps) {
            return Err(Error::new("nobody is followed whose sensors seem to be swapped")
                .got(guided.doubts.join("; "))
                .remedy(
                    "change them and begin again; --despite-swaps, if they are right as they are",
                )
                .into());
        }
        if let Some(path) = file {
            let text = guided.kept.text()?;
            check_outside(path)?;
            draft::write_file(path, order.recalibrate, text.as_bytes())?;
            let kept = format!("calibration of the body kept in {}", path.display());
            self.observer.hear(Event::Note(&kept));
        }
        Ok(guided)
    }

    /// Motions that answer actions, each looked at as if it were to be played from where the robot stands now.
    ///
    /// # Errors
    /// No robot to play them, a motion that is unknown or that the robot cannot play.
    fn answers(&mut self, ready: Option<&Ready>) -> Result<Answers, Error> {
        let order = self.order;
        if order.when.is_empty() {
            return Ok(Answers::default());
        }
        let Some(Ready { connection, found, .. }) = ready else {
            return Err(Error::new("which robot is to answer, and where?")
                .at("--when")
                .remedy("add --robot and --bus"));
        };
        let mut report = AnswersReport::default();
        let mut list = Vec::new();
        for when in &order.when {
            let of_this = |error: Error| {
                let place = error.place.as_deref().map_or_else(String::new, |at| format!(", {at}"));
                error.at(format!("--when {}{place}", when.action))
            };
            let (motion, run) = self.looked_at(when, connection, found).map_err(of_this)?;
            let slowed = match run.retime_factor > 1.0 {
                true => format!(", {:.2} times slower", run.retime_factor),
                false => String::new(),
            };
            let note = format!("{} is answered by {}{slowed}", when.action, when.motion);
            self.report.run.notes.push(note);
            report.checked.push(CheckedAnswer::of(when, &run));
            list.push(Answer { when: when.clone(), motion });
        }
        self.report.answers = Some(report);
        Ok(Answers::new(list))
    }

    /// A motion that answers, and what `play` would say of it.
    fn looked_at(
        &self,
        when: &When,
        connection: &Connection,
        found: &Preflight,
    ) -> Result<(RobotMotion, PlayReport), Error> {
        let mut run = self.order.report().run;
        let speed = play::Options::default().speed;
        let order = MotionOrder { balanced_at: Some(speed), ..MotionOrder::of(&when.motion) };
        let observer = self.observer;
        let options = self.order.answer_options();
        let laid_for = play::laid_for(connection.link.robot(), &options)?;
        let motion = play::load(&order, &laid_for, observer)?;
        play::prepare(connection, found, &motion, &options, observer, &mut run)?;
        Ok((motion, run))
    }

    /// The robot follows the body, and answers it where it is to: then it comes to rest, plays, and follows again.
    fn mirrored(
        &mut self,
        body: &mut Body<'_>,
        mut ready: Ready,
        mut recorder: RunRecorder,
    ) -> Result<Option<(RunRecorder, Ready)>, Error> {
        let followed = self.followed(body, &mut ready, &mut recorder);
        self.report.describe_body();
        ready.describe_weight(&mut self.report);
        match followed {
            Ok(true) => Ok(Some((recorder, ready))),
            other => {
                recorder.discard();
                other.map(|_| None)
            }
        }
    }

    /// False if nothing moved.
    ///
    /// # Errors
    /// What was refused before anything moved. Once something has, it is in the report.
    fn followed(
        &mut self,
        body: &mut Body<'_>,
        ready: &mut Ready,
        recorder: &mut RunRecorder,
    ) -> Result<bool, Error> {
        let mut report = std::mem::replace(&mut self.report, self.order.report());
        let first = self.stretch(body, ready, recorder, &mut report);
        self.report = report;
        if !matches!(first, Ok(true)) {
            return first;
        }
        while self.report.run.outcome == Outcome::Done
            && let Some(call) = body.answers.take()
        {
            let mut run = self.order.report().run;
            run.motion.clone_from(&body.answers.list[call.answer].when.motion);
            match answer(self, &call, body, ready, recorder, &mut run) {
                Ok(()) => {}
                // The robot holds from before.
                Err(error) if error.kind == ErrorKind::Stopped => {
                    run.describe_no_further(StopReason::Asked.to_string());
                }
                // What cannot be played from where the robot has come to rest is not played.
                Err(error) => run.describe_refused(&error),
            }
            self.take_up_answer(&call, run, body);
            if self.report.run.outcome != Outcome::Done {
                break;
            }
            let mut later = self.order.report();
            match self.stretch(body, ready, recorder, &mut later) {
                Ok(true) => self.report.take_up(later),
                Ok(false) => self.report.run.describe_no_further(StopReason::Asked.to_string()),
                Err(error) => self.report.run.describe_no_further(error.to_string()),
            }
        }
        Ok(true)
    }

    /// Writes down how an answer ended. One that was refused ends nothing; any other end than its own does.
    fn take_up_answer(&mut self, call: &Call, run: PlayReport, body: &mut Body<'_>) {
        if let Some(answers) = &mut self.report.answers {
            answers.give(call, &run);
        }
        body.tell(match run.outcome {
            Outcome::Refused => {
                format!(
                    "{} is not played: {}",
                    run.motion,
                    run.stop_reason.as_deref().unwrap_or("")
                )
            }
            outcome => format!("{}: {}; the robot follows again", run.motion, outcome.word()),
        });
        body.answers.done();
        if run.outcome != Outcome::Refused {
            self.report.run.take_up(run);
        }
    }

    /// Follows from where the robot stands, until the body is gone, somebody stops it, or an answer is called for; false if
    /// nothing moved.
    fn stretch(
        &self,
        body: &mut Body<'_>,
        ready: &mut Ready,
        recorder: &mut RunRecorder,
        report: &mut LiveReport,
    ) -> Result<bool, Error> {
        // Somebody may have moved the robot while the person was calibrated.
        ready.look_again(self.order)?;
        let (balancing, robot) = ready.balancing(self.order)?;
        let settings = retarget::Settings::default();
        let worn = body.wearing.worn();
        let model = robot_model(&robot)?;
        let online = Online::new(&model, &worn, &ready.found.start_rad, &settings)?;
        let both = [Segment::Pelvis, Segment::Torso].iter().all(|segment| worn[segment.index()]);
        if both && model.lacks_waist() {
            let note = "the robot has no waist joint: it does not show how the trunk leans against the \
                        pelvis";
            report.run.notes.push(note.to_owned());
        }
        report.run.notes.extend(online.notes().iter().cloned());
        let following = FollowingBody::of(&robot, &model, &worn, self.order.hangs)?;
        let is_first = body.following_since.is_none();
        let warning = following.as_ref().and_then(FollowingBody::warning).filter(|_| is_first);
        warning.into_iter().for_each(|warning| self.observer.hear(Event::Note(warning)));
        let here_rad = &ready.found.start_rad;
        let adjuster = following.as_ref().map(|following| following.adjuster(here_rad));
        let mut onto = OntoRobot::new(&model, online, adjuster);
        let mut trend = Trend::default();
        let of_limbs = WornLimb::ALL.map(|limb| lost::joints(&model, limb));
        let mut ending: Option<Instant> = None;
        let mut newest = |now: Instant, approaching: bool| {
            let is_coming = approaching || onto.is_arriving();
            // Who stands on one leg puts the other one down first, if the person does.
            let ends = body.answers.is_called() || body.is_late(now, is_coming);
            let waits = ends && onto.is_stepping() && {
                let since = *ending.get_or_insert(now);
                now.seconds_since(since) <= LONGEST_WAIT_S
            };
            if ends && !waits || body.is_over() {
                return Input::End;
            }
            let Some((moment, oldest_s, dt_s)) = body.moment(now) else { return Input::Nothing };
            trend.push(oldest_s, &onto.pose(&moment.pose, dt_s, approaching));
            let Some(target) = trend.target(body.seconds(now)) else { return Input::Nothing };
            Input::Pose(Target { careful: body.careful(&of_limbs), ..target })
        };
        let followed = ready.follow(balancing, &mut newest, recorder, self.observer, report);
        report.describe_feet(&onto);
        followed
    }

    /// Shows the angles of the body until it is to end.
    fn show(&mut self, body: &mut Body<'_>, clock: &dyn Clock) {
        let mut show_at = clock.now();
        let mut last = None;
        while !self.observer.wants_to_stop() {
            let now = clock.now();
            if body.is_late(now, false) || body.is_over() {
                break;
            }
            if let Some((moment, ..)) = body.moment(now) {
                let angles = moment.measured.angles;
                if now >= show_at {
                    show_at = now + Duration::from_secs_f64(1.0 / SHOWN_HZ);
                    let worn = body.wearing.worn();
                    self.observer.hear(Event::Angles { angles: &angles, worn: &worn });
                }
                last = Some(angles);
            }
            clock.sleep_until(now + Duration::from_secs_f64(1.0 / POSES_HZ));
        }
        self.report.angles_rad = last.map(report::angles_by_name);
        self.report.run.outcome = Outcome::Done;
    }
}

/// A recording that is to be closed, and the robot that it is of.
type Recorded = (RunRecorder, Option<Ready>);

/// The recording of a run that came to nothing. Of a robot nothing was played: it would only be in the way. Without one,
/// what sensors said is what was asked for.
fn worth_keeping(recorder: Option<RunRecorder>, robot: Option<&Ready>) -> Option<RunRecorder> {
    if robot.is_none() {
        return recorder;
    }
    let _ = recorder.map(RunRecorder::discard);
    None
}

/// Plays what answers an action, as `play` does: looks at every servo, plans from where the robot stands, performs. The
/// body is heard all the while.
///
/// # Errors
/// What was refused before anything moved.
fn answer(
    job: &Job<'_>,
    call: &Call,
    body: &mut Body<'_>,
    ready: &mut Ready,
    recorder: &mut RunRecorder,
    run: &mut PlayReport,
) -> Result<(), Error> {
    ready.look_again(job.order)?;
    let Ready { connection, found, settings, .. } = ready;
    let motion = &body.answers.list[call.answer].motion;
    let options = job.order.answer_options();
    let prepared = play::prepare(connection, found, motion, &options, job.observer, run)?;
    let laid_for = play::laid_for(connection.link.robot(), &options)?;
    let planned = Planned::new(&prepared.planned.trajectory, &laid_for)?;
    let mut balancer = play::balancer_of(connection, &prepared, *settings, &options)?;
    let mut hear = |now: Instant| drop(body.moment(now));
    let meter = Meter::of(connection.link.robot().joints.len());
    let duration_s = prepared.planned.trajectory.duration_s();
    let mut overheard = Overheard { planned, hear: &mut hear };
    let performed = control::perform(
        &mut connection.link,
        found,
        &mut Balanced { motion: &mut overheard, balancer: balancer.as_mut() },
        *settings,
        &mut recorder.metered(meter.clone()),
        &|| job.observer.wants_to_stop(),
        &mut |is_over| job.observer.watch(&Progress { meter: &meter, duration_s, is_over }),
    )?;
    match performed {
        // The robot holds from before.
        Performance::Stopped => run.describe_no_further(StopReason::Asked.to_string()),
        performed => {
            run.describe_performance(&performed);
            run.balance = balancer.map(|of| of.figures().clone());
            play::lie_as_its_file_says(&performed, run, connection);
        }
    }
    describe_virtual(run, connection);
    Ok(())
}

/// Tells until the end how sensors are heard.
fn tell_heard(intake: &Intake<'_>, stop: &AtomicBool, observer: &dyn Observer) {
    let mut rates = Rates::default();
    let mut next = MonotonicClock.now();
    while !stop.load(Ordering::Acquire) {
        let now = MonotonicClock.now();
        if now >= next {
            next = now + EVERY;
            observer.hear(Event::Heard(&rates.of_all(intake.heard(), now)));
        }
        MonotonicClock.sleep_until(now + LOOK);
    }
}

/// True of a robot that plays legs: it is taken to stand on them.
///
/// # Errors
/// A robot whose file does not say what it is in a person.
fn stands(connection: &Connection) -> Result<bool, Error> {
    let model = robot_model(connection.link.robot())?;
    let is_leg = |segment| WornLimb::of(segment).is_some_and(WornLimb::is_leg);
    Ok(model.links.iter().any(|link| is_leg(link.segment)))
}

/// Counts of a recording that was followed.
fn replay_reports(sensors: &Sensors) -> Vec<SourceReport> {
    let report = |(name, samples): (&str, u64)| SourceReport {
        name: name.to_owned(),
        counts: Counts { samples, ..Counts::default() },
        ..SourceReport::default()
    };
    sensors.samples().map(report).collect()
}

/// A body whose sensors are calibrated, from moment to moment.
struct Body<'a> {
    sensors: &'a mut Sensors,
    wearing: Wearing,
    person: &'a dyn Person,
    tell: Sender<LiveWord>,
    longest: Option<Duration>,
    /// When it was first looked at: times of poses count from here.
    began: Option<Instant>,
    following_since: Option<Instant>,
    before: Option<Instant>,
    stale_s: [f64; 13],
    heading_lost: [u64; 13],
    resets: u64,
    calm: Calm,
    doubts: Doubts,
    walk: SwapWatch,
    /// Sensors that seem to be swapped, as a walk showed.
    swapped: Vec<String>,
    /// They are followed all the same.
    insists: bool,
    is_silent: bool,
    /// A robot follows.
    leads: bool,
    /// Somebody sees what the body does, and saw it last then.
    looks: bool,
    posed_at: Option<Instant>,
    naming: Option<Naming>,
    answers: Answers,
    /// Limbs that may be without their sensors, if it is to keep going.
    lost: Option<Lost>,
}

impl<'a> Body<'a> {
    fn new(
        sensors: &'a mut Sensors,
        wearing: Wearing,
        person: &'a dyn Person,
        tell: Sender<LiveWord>,
        longest: Option<Duration>,
    ) -> Self {
        Self {
            sensors,
            wearing,
            person,
            tell,
            longest,
            began: None,
            following_since: None,
            before: None,
            stale_s: [0.0; 13],
            heading_lost: [0; 13],
            resets: 0,
            calm: Calm::default(),
            doubts: Doubts::default(),
            walk: SwapWatch::default(),
            swapped: Vec::new(),
            insists: false,
            is_silent: false,
            leads: false,
            looks: false,
            posed_at: None,
            naming: None,
            answers: Answers::default(),
            lost: None,
        }
    }

    /// From now on limbs whose sensors are lost rest, and the others are followed.
    fn keep_going(&mut self, limbs: WornLimbs) {
        self.sensors.spare(limbs.may_rest());
        self.lost = Some(Lost::new(limbs, &self.wearing.worn()));
    }

    /// True of a segment that rests, because its limb's sensors were lost.
    fn rests(&self, segment: Segment) -> bool {
        self.lost.as_ref().is_some_and(|lost| lost.limbs.rests(segment))
    }

    /// Joints, of those of each limb, of limbs that rest or are on their way back.
    fn careful(&self, of_limbs: &[Vec<bool>; 5]) -> Vec<bool> {
        self.lost.as_ref().map_or_else(Vec::new, |lost| lost.careful(&self.wearing, of_limbs))
    }

    /// Seconds of a moment since the body was first looked at.
    fn seconds(&self, at: Instant) -> f64 {
        at.seconds_since(self.began.unwrap_or(at))
    }

    /// True once there is nothing more to follow.
    fn is_over(&self) -> bool {
        let is_alone = self.lost.as_ref().is_some_and(Lost::is_all);
        is_alone || self.is_swapped() || self.sensors.ended().is_some() || self.sensors.is_over()
    }

    /// True once it was followed for as long as it was to be; that counts from when nobody is `approaching` any more.
    fn is_late(&mut self, now: Instant, approaching: bool) -> bool {
        if !approaching {
            self.following_since.get_or_insert(now);
        }
        let follows = self.following_since.map(|since| now.since(since));
        self.longest.zip(follows).is_some_and(|(longest, time)| time >= longest)
    }

    /// True of a body that leads a robot with sensors that seem to be swapped, unless that is insisted on.
    fn is_swapped(&self) -> bool {
        self.leads && !self.insists && !self.swapped.is_empty()
    }

    /// The body now, when the oldest of its sensors was read, s, and the time since the moment
    /// before, s; `None` while a sensor says nothing that can be used.
    fn moment(&mut self, now: Instant) -> Option<(WornPose, f64, f64)> {
        self.began.get_or_insert(now);
        self.sensors.hear(now);
        for segment in self.sensors.take_anew() {
            self.wearing.heading_lost(segment);
            self.doubts.began_anew(segment);
            self.heading_lost[segment.index()] += 1;
            if let Some(lost) = &mut self.lost {
                lost.limbs.began_anew(segment);
            }
            if self.rests(segment) {
                continue;
            }
            self.tell(format!(
                "the sensor on the {} began anew, its heading is a guess: stand in N pose and \
                 press r",
                words(segment)
            ));
        }
        let asked = self.person.wants_a_reset();
        let mends = asked && self.calm.moving().is_none();
        if let Some(segment) = self.calm.moving().filter(|_| asked) {
            self.tell(format!(
                "headings are not mended: the {} moves; stand still in N pose, then press r",
                words(segment)
            ));
        }
        if mends {
            self.wearing.reset_heading();
            self.doubts.mended();
            self.resets += 1;
            self.tell("headings are mended, slowly".to_owned());
        }
        let dt_s = self.before.map_or(0.0, |before| now.seconds_since(before));
        self.before = Some(now);
        self.look_for_lost(now, mends, dt_s);
        // A limb that rests is not followed, but heard: its headings are mended by what it says now.
        let heard = self.sensors.newest();
        let rests = |(segment, _): &&(Segment, _)| !self.rests(*segment);
        let newest: Vec<_> = heard.iter().filter(rests).copied().collect();
        self.watch(&newest, now, dt_s);
        let (mut said, mut known) = ([None; 13], [false; 13]);
        let mut oldest = now;
        for (segment, heard) in &heard {
            let rests = self.rests(*segment);
            let Some((orientation, taken)) = *heard else {
                if rests {
                    continue;
                }
                return None;
            };
            let is_fresh = now.seconds_since(taken) <= STALE_S;
            said[segment.index()] = Some(orientation).filter(|_| is_fresh);
            if !rests {
                oldest = oldest.min(taken);
                // What is longer silent than anything is named across shows nothing any more.
                known[segment.index()] = now.seconds_since(taken) <= LONGEST_GAP_S;
            }
        }
        self.doubt(&newest, dt_s);
        let moment = self.wearing.pose(&said, dt_s);
        let worn = self.wearing.worn();
        let judged = Segment::ALL.map(|of| worn[of.index()] && !self.rests(of));
        let as_said = self.wearing.as_said();
        self.doubts.look(&as_said, &judged);
        let measured = Segment::ALL.map(|of| moment.fresh[of.index()] && !self.rests(of));
        self.calm.take(&as_said, &measured, dt_s);
        for swapped in self.walk.take(&as_said, &measured, dt_s) {
            self.tell(swapped.clone());
            self.swapped.push(swapped);
        }
        if self.looks && self.posed_at.is_none_or(|at| now.seconds_since(at) >= 1.0 / TOLD_HZ) {
            self.posed_at = Some(now);
            let age_s = now.seconds_since(oldest);
            let sensors = self.wearing.sensors(&moment);
            let (pose, angles) = (moment.pose.clone(), moment.measured.angles);
            let posed = Box::new(PosedNow { pose, sensors, angles, age_s });
            // Nobody listens any more only at the very end.
            let _ = self.tell.send(LiveWord::Posed(posed));
        }
        let at_s = self.seconds(now);
        if let Some(naming) = &mut self.naming {
            let (tell, answers) = (&self.tell, &mut self.answers);
            naming.hear(&moment.pose, &known, now, at_s, tell, |action| {
                if let Some(said) = answers.hear(action) {
                    // Nobody listens any more only at the very end.
                    let _ = tell.send(LiveWord::Words(said));
                }
            });
        }
        Some((moment, self.seconds(oldest), dt_s))
    }

    /// Lets limbs rest whose sensors are lost, takes up again what may be, and says and keeps both.
    fn look_for_lost(&mut self, now: Instant, mends: bool, dt_s: f64) {
        let agrees = self.person.agrees();
        let Some(lost) = &mut self.lost else { return };
        for (limb, change) in lost.judge(self.sensors, now, mends, agrees, dt_s) {
            match change {
                LimbChange::Rests(_) => self.wearing.rest(limb),
                LimbChange::Followed => {
                    self.wearing.take_up(limb);
                    limb.segments().for_each(|segment| self.doubts.began_anew(segment));
                }
                _ => {}
            }
            // Nobody listens any more only at the very end.
            let _ = self.tell.send(LiveWord::Marked(now, lost::words(limb, change)));
        }
    }

    /// Lets segments wait whose sensors say what cannot be, and says so.
    fn doubt(&mut self, newest: &[(Segment, Option<(DQuat, Instant)>)], dt_s: f64) {
        let stuck = self.sensors.stuck();
        for (segment, heard) in newest {
            if let Some((said, taken)) = heard {
                self.doubts.hear(*segment, *said, *taken, stuck[segment.index()]);
            }
        }
        for (segment, force) in self.sensors.take_forces() {
            let force = force.filter(|_| !self.rests(segment));
            let force = force.and_then(|force| self.wearing.in_world(segment, force));
            self.doubts.weigh(segment, force, dt_s);
        }
        for change in self.doubts.judge(dt_s) {
            match change.doubted {
                Some(_) => self.wearing.hold(change.segment),
                None => self.wearing.release(change.segment, change.heading_lost),
            }
            self.tell(change.words());
        }
    }

    /// Notices who is silent, and says so once.
    fn watch(&mut self, newest: &[(Segment, Option<(DQuat, Instant)>)], now: Instant, dt_s: f64) {
        let mut silent = Vec::new();
        for (segment, heard) in newest {
            if heard.is_none_or(|(_, taken)| now.seconds_since(taken) > STALE_S) {
                self.stale_s[segment.index()] += dt_s;
                silent.push(segment_name(*segment));
            }
        }
        if self.is_silent != silent.is_empty() {
            return;
        }
        self.is_silent = !silent.is_empty();
        self.tell(match self.is_silent {
            true if self.leads => {
                format!("silent: {}; the robot stands until it speaks", silent.join(", "))
            }
            true => format!("silent: {}", silent.join(", ")),
            false if self.lost.as_ref().is_some_and(|lost| lost.limbs.any_rests()) => {
                "all other sensors speak".to_owned()
            }
            false => "all sensors speak again".to_owned(),
        });
    }

    /// Says something to the person, without waiting for a terminal.
    fn tell(&self, text: String) {
        // Nobody listens any more only at the very end.
        let _ = self.tell.send(LiveWord::Words(text));
    }

    /// Writes down what became of the sensors.
    fn describe(mut self, report: &mut LiveReport) -> Option<NamedBody> {
        let named = self.naming.take().map(|naming| naming.finish(&self.tell));
        report.events = named.as_ref().map(|named| named.found.events.clone());
        if let Some(answers) = &mut report.answers {
            answers.ignored = self.answers.ignored();
        }
        let gone =
            self.sensors.ended().map(|(sensor, why)| format!("sensor {sensor} is gone: {why}"));
        let alone = self.lost.as_ref().filter(|lost| lost.is_all());
        let alone = alone.map(|_| "no sensor that is worn speaks any more".to_owned());
        if let Some(reason) = gone.or(alone) {
            if report.run.outcome == Outcome::Done {
                report.run.outcome = Outcome::Stopped;
            }
            report.run.stop_reason = Some(reason);
            report.run.stop = Some(Stop::of(StopCode::SensorLost));
        }
        if self.is_swapped() {
            if report.run.outcome == Outcome::Done {
                report.run.outcome = Outcome::Stopped;
            }
            report.run.stop_reason = Some(format!(
                "nobody is followed whose sensors seem to be swapped: {}; change them and begin again; \
                 --despite-swaps, if they are right as they are",
                self.swapped.join("; ")
            ));
            report.run.stop = Some(Stop::of(StopCode::SensorsSwapped));
        }
        if let Some(lost) = &self.lost {
            report.run.notes.extend(lost.notes());
        }
        let Some(body) = &mut report.body else { return named };
        body.heading_resets = self.resets;
        body.doubts.append(&mut self.swapped);
        for drift in self.wearing.drifts() {
            let at = drift.segment.index();
            let name = segment_name(drift.segment);
            let Some(mount) = body.sensors.iter_mut().find(|mount| mount.segment == name) else {
                continue;
            };
            mount.drift_corrected_rad = drift.corrected_rad;
            mount.drift_rad_s = drift.rate_rad_s;
            mount.heading_reset_rad = drift.reset_rad;
            mount.stale_s = self.stale_s[at];
            mount.heading_lost = self.heading_lost[at];
            (mount.doubted, mount.doubted_s) = self.doubts.tally(drift.segment);
            if let Some(lost) = &self.lost {
                (mount.lost, mount.lost_s) = lost.limbs.tally(drift.segment);
            }
        }
        named
    }
}
