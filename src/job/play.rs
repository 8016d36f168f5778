//! `play`: from a motion to a moving robot, and what came of it. The whole job, in order.

use super::bodily::{self, Laid};
use super::observer::{Event, Meter, Observer, Progress};
use super::page::RobotScene;
use super::pending::unless_stopped;
use super::recorder::{RunRecorder, Series};
use super::report::{
    BodyFigures, JointReport, Outcome, OwnProfile, PhysicsReport, PlayReport, RefereeReport,
};
use super::simulate::script;
use super::source::{self, MotionOrder, RobotMotion};
use super::weight::{self, Witness};
use crate::control::{
    self, BalanceFigures, Balanced, Balancer, Left, Performance, Planned, Settings, StopReason,
    balance, inject, net,
};
use crate::error::{Error, ErrorKind, counted};
use crate::motion::{Plan, PlanOptions, Setpoint, Trajectory};
use crate::retarget::base::BasePath;
use crate::rig::{Address, Connection, calibrated, connect, patience_words};
use crate::robot::preflight::{Preflight, preflight};
use crate::robot::{Link, LinkError, Robot};
use crate::time::Duration;
use crate::view::scene::ViewScene;
use crate::view::tracks::{SpanKind, ViewSpan};
use gaitway_profiles::WhenFallen;
use std::path::{Path, PathBuf};

pub use crate::motion::plan::SPEEDS;
pub use crate::robot::preflight::Accept;

/// What the joints do when the motion is over.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum EndState {
    /// Stay where they are, torque on.
    #[default]
    Hold,
    /// Torque off: a standing robot falls.
    Limp,
}

/// How often a motion is played.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rounds {
    /// So often.
    Times(u32),
    /// Until it is stopped.
    Endless,
}

impl Rounds {
    /// How many are planned. Of those without end the first and the last are unlike the others: one is between them.
    const fn planned(self) -> u32 {
        match self {
            Self::Times(count) => count,
            Self::Endless => 3,
        }
    }
}

/// How a motion is played.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Playing speed: 0.5 is half as fast as recorded.
    pub speed: f64,
    /// Slow the motion until the robot can follow, or refuse it; `None`: slow what a person did.
    pub retime: Option<bool>,
    /// Move to where the motion begins; otherwise refuse one that begins elsewhere.
    pub approach: bool,
    /// How often, with a transition in between.
    pub rounds: Rounds,
    /// Cycles per second; `None`: as the robot's file says.
    pub rate_hz: Option<f64>,
    /// What the joints do afterwards.
    pub end: EndState,
    /// Record goals and measured states to this file.
    pub record: Option<PathBuf>,
    /// The recording may replace a file that is there.
    pub replace: bool,
    /// Keep the goals and angles of every cycle for whoever asked.
    pub keep_series: bool,
    /// What may be different from what the profiles say.
    pub accept: Accept,
    /// Check everything, write nothing.
    pub dry_run: bool,
    /// The robot hangs on a stand: it cannot fall.
    pub hangs: bool,
    /// Play what a robot on its own feet is predicted to fall in.
    pub allow_fall: bool,
    /// The virtual robot has weight, and may fall.
    pub physics: bool,
    /// Joints answer a base that is tilted otherwise than the motion wants.
    pub balance: bool,
    /// Script of faults that befall a virtual robot of this process.
    pub faults: Option<PathBuf>,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            speed: 1.0,
            retime: None,
            approach: true,
            rounds: Rounds::Times(1),
            rate_hz: None,
            end: EndState::Hold,
            record: None,
            replace: false,
            keep_series: false,
            accept: Accept::default(),
            dry_run: false,
            hangs: false,
            allow_fall: false,
            physics: false,
            balance: false,
            faults: None,
        }
    }
}

/// Which motion on which robot, and how.
#[derive(Clone, Debug, PartialEq)]
pub struct PlayOrder {
    /// The motion.
    pub motion: MotionOrder,
    /// The robot, by name or path of its file.
    pub robot: String,
    /// Where its lines are.
    pub buses: Vec<Address>,
    /// Its calibration; `None`: the usual one, if there is one and the robot is real.
    pub calibration: Option<PathBuf>,
    /// Seed of a virtual robot.
    pub seed: u64,
    /// How.
    pub options: Options,
}

/// So long after a motion a robot with weight must still stand, ns of virtual time.
const LOOKED_AFTER_NS: u64 = 1_000_000_000;

/// What a played motion leaves behind.
#[derive(Debug)]
pub struct Played {
    /// What came of it.
    pub report: PlayReport,
    /// The robot, and every cycle, if that was asked for and something was played.
    pub series: Option<(Robot, Series)>,
    /// What a page draws of it, if the cycles were asked for and something was played.
    pub scene: Option<ViewScene>,
}

/// What is kept of a run for whoever asked for every cycle.
pub(super) struct Kept {
    robot: Robot,
    series: Series,
    scene: ViewScene,
}

impl Played {
    /// Keeps what was asked for.
    pub(super) fn keep(&mut self, kept: Option<Kept>) {
        if let Some(Kept { robot, series, scene }) = kept {
            self.series = Some((robot, series));
            self.scene = Some(scene);
        }
    }
}

/// Opens the robot, plays and reports; whatever goes wrong is in the report.
#[must_use]
pub fn play(order: &PlayOrder, observer: &dyn Observer) -> Played {
    let buses = order.buses.iter().map(ToString::to_string).collect();
    let mut report = PlayReport::new(&order.motion.motion, &order.robot, buses);
    report.dry_run = order.options.dry_run;
    let mut played = Played { report, series: None, scene: None };
    let done = under_net(&mut played.report, |report| {
        refuse_limp_without_end(&order.options)?;
        refuse_balance_without_legs(order)?;
        let (robot, calibration) =
            calibrated(&order.robot, &order.buses, order.calibration.as_deref())?;
        report.calibration = calibration.map(|path| path.display().to_string());
        report.robot.clone_from(&robot.name);
        report.profiles = OwnProfile::of(&robot);
        let hung = MotionOrder {
            hangs: order.options.hangs,
            balanced_at: (order.options.retime != Some(false)).then_some(order.options.speed),
            ..order.motion.clone()
        };
        let moved = if order.options.balance { balance::leaves(&robot)? } else { robot.clone() };
        let motion = load(&hung, &moved, observer)?;
        report.describe_motion(&motion);
        report.cycle_hz = order.options.rate_hz.unwrap_or(robot.file.rate_hz);
        if stopped_before_torque(observer, report) {
            return Ok(None);
        }
        let mut connection = connect(robot, &order.buses, order.seed)?;
        play_on(&mut connection, &motion, &order.options, observer, report)
    });
    match done {
        Ok(kept) => played.keep(kept),
        Err(error) => played.report.describe_refused(&error),
    }
    played
}

/// A motion without end has no end at which joints go limp: what ends it is a stop, and a stop holds.
fn refuse_limp_without_end(options: &Options) -> Result<(), Error> {
    if options.rounds != Rounds::Endless || options.end != EndState::Limp {
        return Ok(());
    }
    Err(Error::new("a motion without end has no end at which joints go limp")
        .at("--end limp")
        .got("--loop without a number: only a stop ends it, and after a stop joints hold")
        .allowed("--end hold, or --loop N")
        .remedy("stop it with Ctrl-C, then `gaitway limp`"))
}

/// Who hangs on a stand cannot fall, and joints that are to stay where they are answer no tilt.
fn refuse_balance_without_legs(order: &PlayOrder) -> Result<(), Error> {
    let PlayOrder { motion, options, .. } = order;
    let other = match (options.hangs, motion.only.is_empty()) {
        _ if !options.balance => return Ok(()),
        (true, _) => "--hang",
        (false, false) => "--only",
        (false, true) => return Ok(()),
    };
    Err(Error::new("a robot on a stand, or of which only some joints move, does not balance")
        .at("--balance")
        .got(format!("{other} too"))
        .allowed("one of the two")
        .remedy("leave one of them out"))
}

/// Reads a motion, unless the observer wants to stop.
///
/// # Errors
/// As [`source::load`]; a wish to stop.
pub(super) fn load(
    order: &MotionOrder,
    robot: &Robot,
    observer: &dyn Observer,
) -> Result<RobotMotion, Error> {
    let (order, robot) = (order.clone(), robot.clone());
    unless_stopped(observer, move || source::load(&order, &robot))
}

/// Runs a part of a job under a net for panics, which are told in the report.
///
/// # Errors
/// The part's own.
pub(super) fn under_net<T>(
    report: &mut PlayReport,
    part: impl FnOnce(&mut PlayReport) -> Result<Option<T>, Error>,
) -> Result<Option<T>, Error> {
    net::catch(|| part(report)).unwrap_or_else(|words| {
        report.describe_broken(&words);
        Ok(None)
    })
}

/// Plays on a robot that is open: looks at every servo, plans from where the robot stands, performs.
pub(super) fn play_on(
    connection: &mut Connection,
    motion: &RobotMotion,
    options: &Options,
    observer: &dyn Observer,
    report: &mut PlayReport,
) -> Result<Option<Kept>, Error> {
    let file = &connection.link.robot().file;
    let rate_hz = options.rate_hz.unwrap_or(file.rate_hz);
    report.cycle_hz = rate_hz;
    if file.acceleration_source.starts_with("assumed") {
        report.notes.push(format!("acceleration limits {}", file.acceleration_source));
    }
    if options.rounds == Rounds::Endless && options.keep_series {
        return Err(Error::new("a page would hold every cycle of a motion without end")
            .at("--html")
            .remedy("--loop N, or --record: `gaitway view` shows what was recorded"));
    }
    let settings = Settings::at_rate(rate_hz);
    let witness = options.physics.then(|| give_weight(connection, options.hangs)).transpose()?;
    if let Some(script) = &options.faults {
        befall(connection, script)?;
    }
    inject::point("preflight", 0);
    let found = preflight(&mut connection.link, settings.period, options.accept)?;
    report.describe_preflight(&found);
    if options.balance {
        feel_first(&mut connection.link, &found)?;
    }
    let prepared = prepare(connection, &found, motion, options, observer, report)?;
    if options.dry_run {
        observer.hear(Event::Foreseen(&prepared.foreseen));
        report.outcome = Outcome::Done;
        return Ok(None);
    }
    if stopped_before_torque(observer, report) {
        return Ok(None);
    }
    let series = perform(connection, &found, &prepared, settings, options, observer, report)?;
    let Prepared { planned, base, metrics, .. } = prepared;
    if let Some(witness) = &witness {
        describe_weight(report, connection, witness);
    }
    let Some((robot, series)) = series else { return Ok(None) };
    // Only in virtual time the cycles go by the clock of the world.
    let began = series.began.filter(|_| !connection.real_time);
    let weighed = witness
        .as_ref()
        .zip(began)
        .and_then(|(witness, began)| Some((witness.path_since(began)?, began)));
    let drawn = RobotScene {
        robot: &robot,
        motion,
        planned: &planned,
        speed: options.speed,
        base: weighed.as_ref().map(|(path, _)| path).or(base.as_ref()),
        metrics: &metrics,
        series: &series,
    };
    // A page that cannot be made changes nothing of what was played.
    let scene = match drawn.view() {
        Ok(mut scene) => {
            if let (Some((_, began)), Some(physics)) = (weighed, &mut report.physics) {
                physics.is_drawn = true;
                scene.spans.extend(physics.fall.as_ref().map(|fall| {
                    let at_s = fall.at.seconds_since(began);
                    ViewSpan::new(SpanKind::Wrong, "fell", &fall.how(), at_s, at_s)
                }));
            }
            scene
        }
        Err(error) => {
            report.notes.push(error.to_string());
            return Ok(None);
        }
    };
    Ok(Some(Kept { robot, series, scene }))
}

/// The virtual robot of this process gets weight.
pub(super) fn give_weight(connection: &Connection, hangs: bool) -> Result<Witness, Error> {
    let world = connection.world.as_ref().ok_or_else(|| {
        Error::new("only a virtual robot of this process is given weight")
            .at("--physics")
            .allowed("--bus sim, --bus sim:pty")
    })?;
    weight::give(&mut world.lock(), &connection.link.robot().file, hangs)
}

/// Faults befall the virtual robot of this process, by its own clock.
pub(super) fn befall(connection: &Connection, script: &Path) -> Result<(), Error> {
    let world = connection.world.as_ref().ok_or_else(|| {
        Error::new("only a virtual robot of this process is befallen by faults")
            .at("--faults")
            .allowed("--bus sim, --bus sim:pty")
    })?;
    script::befall(&mut world.lock(), script)
}

/// So many of the links that met are told to a person.
const MEETINGS_TOLD: usize = 3;

/// Says whether a robot with weight fell, in the motion or within a second after it.
pub(super) fn describe_weight(report: &mut PlayReport, connection: &Connection, witness: &Witness) {
    if let Some(world) = connection.world.as_ref().filter(|_| !connection.real_time) {
        let mut world = world.lock();
        let after_ns = world.now_ns() + LOOKED_AFTER_NS;
        world.run_until(after_ns);
    }
    report.notes.push(witness.words());
    let physics = PhysicsReport::of(witness);
    let met =
        physics.met.iter().take(MEETINGS_TOLD).map(|met| format!("with weight, {}", met.words()));
    report.notes.extend(met);
    let untold = physics.met.len().saturating_sub(MEETINGS_TOLD);
    if untold > 0 {
        let more = counted(untold, "more pair");
        report.notes.push(format!("with weight, {more} of links met: --json lists them"));
    }
    report.physics = Some(physics);
}

/// A motion that was laid from where a robot stands, and looked at: it may be played.
pub(super) struct Prepared {
    pub(super) planned: Plan,
    base: Option<BasePath>,
    metrics: BodyFigures,
    /// What whoever looks on is told of it before it begins.
    foreseen: Vec<ViewSpan>,
}

/// Lays a motion from where the robot stands, and looks at what it does to all of it.
///
/// # Errors
/// What the robot's limits do not allow, or for a real one its balance; a wish to stop.
pub(super) fn prepare(
    connection: &Connection,
    found: &Preflight,
    motion: &RobotMotion,
    options: &Options,
    observer: &dyn Observer,
    report: &mut PlayReport,
) -> Result<Prepared, Error> {
    let robot = &laid_for(connection.link.robot(), options)?;
    let (laid, foreseen) = {
        let (robot, start_rad) = (robot.clone(), found.start_rad.clone());
        let (motion, options) = (motion.clone(), options.clone());
        let looks = observer.looks();
        unless_stopped(observer, move || {
            let how = PlanOptions {
                speed: options.speed,
                retime: options.retime.unwrap_or(motion.of_person),
                approach: options.approach,
                rounds: options.rounds.planned(),
                ..PlanOptions::default()
            };
            let laid = bodily::laid(&robot, &start_rad, &motion, how, options.hangs)?;
            let foreseen = || {
                let drawn = RobotScene {
                    robot: &robot,
                    motion: &motion,
                    planned: &laid.planned,
                    speed: options.speed,
                    base: laid.base.as_ref(),
                    metrics: &laid.figures,
                    series: &Series::planned(&laid.planned, robot.file.rate_hz),
                };
                drawn.foreseen()
            };
            let foreseen = if looks { foreseen()? } else { Vec::new() };
            Ok((laid, foreseen))
        })?
    };
    report.notes.extend(laid.calm_note());
    let Laid { planned, base, figures: metrics, .. } = laid;
    describe_plan(report, connection.link.robot(), &planned, motion);
    report.metrics = Some(metrics.clone());
    if !options.allow_fall {
        may_fall(&metrics, connection.world.is_some() || options.dry_run, report)?;
    }
    report.notes.extend(bodily::soft_note(&metrics));
    report.notes.extend(bodily::weak_note(&metrics));
    Ok(Prepared { planned, base, metrics, foreseen })
}

/// What is said of a fall that is predicted: of a virtual robot, which cannot fall, in a note.
///
/// # Errors
/// A real robot is not sent there.
fn may_fall(figures: &BodyFigures, is_virtual: bool, report: &mut PlayReport) -> Result<(), Error> {
    let Some(at_s) = figures.predicted_fall_s else { return Ok(()) };
    if is_virtual {
        report.notes.extend(bodily::fall_note(figures));
        return Ok(());
    }
    Err(match figures.still_fall_s {
        Some(still_s) => Error::of(ErrorKind::OutsideLimits, bodily::TOO_SOFT)
            .at(format!("{still_s:.2} s, without any motion"))
            .got("it tips over by itself: its servos give way further than its weight bears")
            .allowed("a robot that stands by itself")
            .remedy(bodily::STIFFER),
        None => Error::of(ErrorKind::OutsideLimits, bodily::WOULD_FALL)
            .at(format!("{at_s:.2} s"))
            .got("its weight leaves its soles for too long, or its servos give way too far")
            .allowed("weight over the soles, but for short moments")
            .remedy(bodily::INSTEAD),
    })
}

/// A wish to stop that comes before torque is on is fulfilled by never switching it on.
pub(super) fn stopped_before_torque(observer: &dyn Observer, report: &mut PlayReport) -> bool {
    let asked = observer.wants_to_stop();
    if asked {
        report.describe_stopped();
    }
    asked
}

/// The robot as a motion is laid for it: balance keeps a part of some joints' limits for itself.
pub(super) fn laid_for(robot: &Robot, options: &Options) -> Result<Robot, Error> {
    if options.balance { balance::leaves(robot) } else { Ok(robot.clone()) }
}

/// How long the sensor in the base may take to answer before anything moves.
const FIRST_FELT: Duration = Duration::from_millis(100);

/// Looks whether the sensor in the base is the one in the robot's file, and feels what the robot's legs say.
///
/// # Errors
/// A sensor that does not answer, another one, or one that feels otherwise.
pub(super) fn feel_first(link: &mut Link, found: &Preflight) -> Result<(), Error> {
    let robot = link.robot().clone();
    let balancer = Balancer::new(&robot, 1.0 / robot.file.rate_hz, |_| 1.0)?;
    let silent = |error: LinkError| {
        Error::of(ErrorKind::Silent, "the sensor in the base cannot be felt")
            .at(error.place.clone())
            .got(error.to_string())
            .remedy("look at its power and cable, or leave out --balance")
    };
    let budget = |link: &Link| link.clock().now() + FIRST_FELT;
    let until = budget(link);
    let (model, firmware) = link.sensor_identity(until).map_err(silent)?;
    if let Some(sensor) = &robot.base_sensor {
        let board = &sensor.board;
        let is_known = firmware >= board.firmware.min
            && board.firmware.max.is_none_or(|newest| firmware <= newest);
        if model != board.model_number || !is_known {
            let newest = board.firmware.max.map_or("".to_owned(), |newest| newest.to_string());
            return Err(Error::of(ErrorKind::NotReady, "another device has the sensor's ID")
                .at(format!("{} in the base, ID {}", sensor.name, sensor.id))
                .got(format!("model {model}, firmware {firmware}"))
                .allowed(format!(
                    "model {}, firmware {}..{newest}",
                    board.model_number, board.firmware.min
                ))
                .remedy("name the right board in [body.imu], or leave out --balance"));
        }
    }
    let until = budget(link);
    let felt = link.inertial(until).map_err(silent)?;
    balancer.look(&felt, &found.start_rad)
}

/// How often a trajectory is looked at, s, and what a joint may go further between two looks, rad: half a millisecond under
/// the highest acceleration here is less.
const LOOKED_EVERY_S: f64 = 0.005;
const BETWEEN_RAD: f64 = 1e-3;

/// How far each joint of a motion stays from the nearer end of its range, rad.
fn rooms_rad(robot: &Robot, trajectory: &Trajectory) -> Vec<f64> {
    let limits = robot.limits();
    let mut rooms_rad = vec![f64::INFINITY; limits.len()];
    let mut setpoints = vec![Setpoint::default(); limits.len()];
    let looks = (trajectory.duration_s() / LOOKED_EVERY_S).ceil() as usize;
    for look in 0..=looks {
        trajectory.sample(look as f64 * LOOKED_EVERY_S, &mut setpoints);
        for ((room_rad, limits), setpoint) in rooms_rad.iter_mut().zip(&limits).zip(&setpoints) {
            let below_rad = setpoint.position_rad - limits.lower_rad();
            let above_rad = limits.upper_rad() - setpoint.position_rad;
            *room_rad = room_rad.min(below_rad).min(above_rad);
        }
    }
    rooms_rad.iter().map(|room_rad| room_rad - BETWEEN_RAD).collect()
}

/// Says in the report what was planned, joint by joint.
pub fn describe_plan(report: &mut PlayReport, robot: &Robot, planned: &Plan, motion: &RobotMotion) {
    report.describe_retiming(&planned.retimed);
    report.ease_in_s = planned.ease_in_s;
    report.ease_out_s = planned.ease_out_s;
    report.approach_s = planned.approach_s;
    if planned.ease_in_s > 0.0 || planned.ease_out_s > 0.0 {
        report.notes.push(format!(
            "the clip does not {} at rest and without acceleration; its clock is eased along its own \
             path",
            match (planned.ease_in_s > 0.0, planned.ease_out_s > 0.0) {
                (true, true) => "start and end",
                (true, false) => "start",
                _ => "end",
            }
        ));
    }
    let trajectory = &planned.trajectory;
    let at = |time_s: f64| {
        let mut setpoints = vec![Setpoint::default(); robot.joints.len()];
        trajectory.sample(time_s, &mut setpoints);
        setpoints
    };
    let (first, last) = (at(0.0), at(trajectory.duration_s()));
    let velocity = trajectory.peak_velocity_rad_s();
    let acceleration = trajectory.peak_acceleration_rad_s2();
    let jerk = trajectory.peak_jerk_rad_s3();
    for (index, joint) in robot.joints.iter().enumerate() {
        let clipped_samples = motion.clipped_samples(&joint.name);
        report.joints.push(JointReport {
            peak_velocity_rad_s: velocity[index],
            peak_acceleration_rad_s2: acceleration[index],
            peak_jerk_rad_s3: jerk[index],
            start_velocity_rad_s: first[index].velocity_rad_s,
            end_velocity_rad_s: last[index].velocity_rad_s,
            clipped_samples,
            clipped_share: clipped_samples as f64 / motion.samples().max(1) as f64,
            at_limit_share: motion.at_limit_share(&joint.name),
            ..JointReport::of(joint)
        });
    }
    let fastest = |setpoints: &[Setpoint]| {
        setpoints.iter().map(|s| s.velocity_rad_s.abs()).fold(0.0, f64::max)
    };
    report.max_start_velocity_rad_s = fastest(&first);
    report.max_end_velocity_rad_s = fastest(&last);
}

fn perform(
    connection: &mut Connection,
    found: &Preflight,
    prepared: &Prepared,
    settings: Settings,
    options: &Options,
    observer: &dyn Observer,
    report: &mut PlayReport,
) -> Result<Option<(Robot, Series)>, Error> {
    let planned = &prepared.planned;
    let laid_for = laid_for(connection.link.robot(), options)?;
    let mut motion = Planned::new(&planned.trajectory, &laid_for)?;
    let mut duration_s = planned.trajectory.duration_s();
    if options.rounds == Rounds::Endless {
        // From the end of the first round to that of the second: a transition, and the motion.
        let first_s = planned.clip_start_s + planned.clip_s;
        let again_s = (duration_s - first_s) / 2.0;
        motion = motion.again(first_s, first_s + again_s)?;
        duration_s = f64::INFINITY;
    }
    let mut balancer = balancer_of(connection, prepared, settings, options)?;
    // Once torque is on, nothing may keep the loop from its first cycle: the file comes before.
    let mut recorder = RunRecorder::begin(
        options.record.as_deref(),
        options.replace,
        options.keep_series,
        connection,
        &report.motion,
    )?;
    let (approach_s, retime_factor) = (report.approach_s, report.retime_factor);
    observer.hear(Event::Planned { duration_s, approach_s, retime_factor });
    observer.hear(Event::Foreseen(&prepared.foreseen));
    let meter = Meter::of(connection.link.robot().joints.len());
    let performed = control::perform(
        &mut connection.link,
        found,
        &mut Balanced { motion: &mut motion, balancer: balancer.as_mut() },
        settings,
        &mut recorder.metered(meter.clone()),
        &|| observer.wants_to_stop(),
        &mut |is_over| observer.watch(&Progress { meter: &meter, duration_s, is_over }),
    );
    let performed = match performed {
        Ok(performed) if report.describe_performance(&performed) => performed,
        other => {
            recorder.discard();
            return other.map(|_| None);
        }
    };
    report.balance = balancer.map(|of| of.figures().clone());
    report.notes.extend(report.balance.as_ref().map(BalanceFigures::words));
    let is_over = matches!(&performed, Performance::Ran(run) if run.stop.is_none());
    if is_over && options.end == EndState::Limp {
        go_limp(report, connection);
    }
    lie_as_its_file_says(&performed, report, connection);
    recorder.finish(report, connection);
    describe_virtual(report, connection);
    let robot = connection.link.robot().clone();
    Ok(recorder.into_series().map(|series| (robot, series)))
}

/// What keeps the robot upright during a prepared motion, if something is to.
///
/// # Errors
/// As [`Balancer::new`].
pub(super) fn balancer_of(
    connection: &Connection,
    prepared: &Prepared,
    settings: Settings,
    options: &Options,
) -> Result<Option<Balancer>, Error> {
    if !options.balance {
        return Ok(None);
    }
    let robot = connection.link.robot();
    let rooms_rad = rooms_rad(&laid_for(robot, options)?, &prepared.planned.trajectory);
    Balancer::new(robot, settings.period.as_secs_f64(), |joint| rooms_rad[joint]).map(Some)
}

/// Switches torque off on a robot that felt that it fell, if its file wants that.
pub(super) fn lie_as_its_file_says(
    performed: &Performance,
    report: &mut PlayReport,
    connection: &mut Connection,
) {
    let fell = matches!(performed, Performance::Ran(run) if matches!(run.stop, Some(StopReason::Fell { .. })));
    let body = connection.link.robot().file.body.as_ref();
    if fell && body.is_some_and(|body| body.when_fallen == WhenFallen::Limp) {
        go_limp(report, connection);
    }
}

/// Switches torque off after a motion that came to its end.
fn go_limp(report: &mut PlayReport, connection: &mut Connection) {
    match control::arm::disarm(&mut connection.link) {
        Ok(()) => {
            report.left =
                Some(Left { limp: connection.link.robot().joint_names(), ..Left::default() });
            let holds = Left::default().words();
            report.notes.retain(|note| *note != holds);
            report.notes.push("torque is off on every joint".to_owned());
        }
        Err(error) => {
            report.outcome = Outcome::Failed;
            report.stop_reason = Some(error.to_string());
        }
    }
}

/// Says what only a virtual robot can tell: how long it waited, and what its referee saw.
pub(super) fn describe_virtual(report: &mut PlayReport, connection: &Connection) {
    report.notes.extend(patience_words(connection.patience.as_ref()));
    if let Some(world) = &connection.world {
        let verdict = world.lock().verdict();
        let violations = verdict.violations.iter().map(ToString::to_string).collect();
        let broken = gaitway_sim::Rule::ALL.into_iter().filter(|&rule| verdict.count(rule) > 0);
        let rules = broken.map(|rule| format!("{}: {}", rule.code(), rule.words())).collect();
        report.referee = Some(RefereeReport { violations, rules });
    }
}
