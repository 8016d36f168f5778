//! The cycle, over servos that follow, and what becomes of it when they, the host or the program do
//! not.

use super::*;
use crate::control::arm::{Arming, arm};
use crate::control::testing::{
    Bench, GOAL, PRESENT, READ, SYNC_READ, Said, Servo, Shared, Standing, T, TORQUE, World,
};
use crate::port::Clock as _;
use std::f64::consts::PI;

const MS: Duration = Duration::from_millis(1);
const NS: Duration = Duration::from_nanos(1);

/// Two seconds: every joint to 0.3 rad and back, 0.47 rad/s and 1.5 rad/s² at most.
fn there_and_back(limits: &[JointLimits]) -> Trajectory {
    let names = (0..limits.len()).map(|joint| format!("joint{joint}")).collect();
    let knots = (0..=20).map(|k| 0.15 * (1.0 - (PI * 0.1 * f64::from(k)).cos()));
    let row: Vec<f64> = knots.collect();
    Trajectory::new(names, 0.1, vec![row; limits.len()], limits).expect("a motion")
}

/// What happens at each step of a motion, given its number from 0.
type Step<'a> = Box<dyn FnMut(usize) + 'a>;

/// A motion that tells how it was asked.
struct Probe<'a> {
    of: Box<dyn Motion + 'a>,
    /// Time that passed, and until when, at each step.
    steps: Vec<(f64, Instant)>,
    stops: u32,
    step: Step<'a>,
}

impl Motion for Probe<'_> {
    fn advance(&mut self, dt_s: f64, now: Instant, setpoints: &mut [Setpoint]) -> bool {
        self.steps.push((dt_s, now));
        (self.step)(self.steps.len() - 1);
        self.of.advance(dt_s, now, setpoints)
    }

    fn stop(&mut self) {
        self.stops += 1;
        self.of.stop();
    }
}

/// A motion that never comes to rest: it creeps from where it began, 0.1 rad/s for two seconds and
/// back.
struct Restless(f64);

impl Motion for Restless {
    fn advance(&mut self, dt_s: f64, _now: Instant, setpoints: &mut [Setpoint]) -> bool {
        self.0 += dt_s;
        let (position_rad, velocity_rad_s) = match self.0 % 4.0 {
            out if out < 2.0 => (0.1 * out, 0.1),
            back => (0.1 * (4.0 - back), -0.1),
        };
        setpoints.fill(Setpoint { position_rad, velocity_rad_s, acceleration_rad_s2: 0.0 });
        false
    }

    fn stop(&mut self) {}
}

/// A motion that stands somewhere else from a step on.
struct Jump {
    at: usize,
    to_rad: f64,
    step: usize,
}

impl Motion for Jump {
    fn advance(&mut self, _dt_s: f64, _now: Instant, setpoints: &mut [Setpoint]) -> bool {
        let position_rad = if self.step < self.at { 0.0 } else { self.to_rad };
        self.step += 1;
        setpoints.fill(Setpoint { position_rad, ..Setpoint::default() });
        self.step > self.at + 3
    }

    fn stop(&mut self) {}
}

/// A motion that stands for one step, goes on for two, and stands for good: as a goal does that was
/// held at a blocked joint when the joint is let go.
struct GoesOn(usize);

impl Motion for GoesOn {
    fn advance(&mut self, _dt_s: f64, _now: Instant, setpoints: &mut [Setpoint]) -> bool {
        self.0 += 1;
        let position_rad = 0.005 * (self.0.clamp(4, 6) - 4) as f64;
        setpoints.fill(Setpoint { position_rad, ..Setpoint::default() });
        self.0 != 5 && self.0 > 3
    }

    fn stop(&mut self) {}
}

/// A sink that does something at each cycle.
struct Each<'a>(Box<dyn FnMut(&Sample<'_>) + 'a>);

impl Sink for Each<'_> {
    fn take(&mut self, sample: &Sample<'_>) {
        (self.0)(sample);
    }
}

/// How a scene is played.
struct Scene<'a> {
    line_of: &'a [usize],
    motion: Option<Box<dyn Motion + 'a>>,
    sink: Box<dyn FnMut(&Sample<'_>) + 'a>,
    step: Step<'a>,
    asked: Box<dyn Fn() -> bool + 'a>,
    /// Runs once the robot is armed.
    setup: Box<dyn FnOnce(&Bench) + 'a>,
}

/// What came of it.
struct Played {
    bench: Bench,
    run: Run,
    steps: Vec<(f64, Instant)>,
    stops: u32,
    trajectory: Trajectory,
}

impl Default for Scene<'_> {
    fn default() -> Self {
        Self {
            line_of: &[0, 0],
            motion: None,
            sink: Box::new(|_| {}),
            step: Box::new(|_| {}),
            asked: Box::new(|| false),
            setup: Box::new(|_| {}),
        }
    }
}

impl Scene<'_> {
    fn play(self) -> Played {
        self.play_on(|_| {})
    }

    /// Hands out the world before anything is done, for the closures of the scene.
    fn play_on(self, world: impl FnOnce(Shared)) -> Played {
        let mut bench = Bench::new(self.line_of);
        world(bench.world.clone());
        let found = bench.checked();
        let armed = arm(&mut bench.link, &found, &|| false).and_then(Arming::done);
        let armed = armed.expect("armed");
        bench.forget_log();
        (self.setup)(&bench);
        let limits = bench.link.robot().limits();
        let trajectory = there_and_back(&limits);
        let own = bench.link.robot().clone();
        let planned = || {
            Box::new(Planned::new(&trajectory, &own).expect("its own joints")) as Box<dyn Motion>
        };
        let of = match self.motion {
            Some(motion) => motion,
            None => planned(),
        };
        let mut motion = Probe { of, steps: Vec::new(), stops: 0, step: self.step };
        let mut sink = Each(self.sink);
        let settings = Settings::at_rate(50.0);
        let asked = self.asked;
        let run = stream(&mut bench.link, armed, &mut motion, settings, &mut sink, &*asked);
        let Probe { steps, stops, .. } = motion;
        Played { bench, run, steps, stops, trajectory: trajectory.clone() }
    }
}

/// Something that every closure of a scene may look at.
type Cell<T> = std::cell::RefCell<T>;

fn counts(rad: f64) -> f64 {
    rad * 4096.0 / (2.0 * PI)
}

impl Played {
    fn goals(&self) -> Vec<Said> {
        self.bench.log().into_iter().filter(Said::is_goals).collect()
    }

    /// Goals of the joint with this ID, in counts from 0 rad, without sign.
    fn goals_of(&self, id: u8) -> Vec<i64> {
        let of = |said: &Said| said.goals().into_iter().find(|goal| goal.0 == id);
        self.goals().iter().filter_map(of).map(|goal| (goal.1 - 2048).abs()).collect()
    }

    /// The last two goals of the joint with this ID are one, and none of them jumped.
    fn came_to_rest(&self, id: u8) {
        let goals = self.goals_of(id);
        let [.., a, b] = goals[..] else { panic!("{goals:?}") };
        assert_eq!(a, b, "{goals:?}");
        // 0.48 rad/s for 50 ms at most are 15.6 counts.
        assert!(goals.windows(2).all(|two| (two[1] - two[0]).abs() <= 16), "{goals:?}");
    }

    fn has(&self, wanted: impl Fn(&Exception) -> bool) -> bool {
        self.run.exceptions.iter().any(wanted)
    }

    fn code(&self) -> Option<super::super::StopCode> {
        self.run.stop.as_ref().map(StopReason::code)
    }
}

use super::super::StopCode;

#[test]
fn goals_are_those_of_the_motion_at_the_moment_they_are_written() {
    let played = Scene::default().play();
    assert_eq!(played.run.stop, None);
    assert_eq!(played.run.exceptions, []);
    assert_eq!(played.stops, 0);
    let goals = played.goals();
    assert_eq!(goals.len(), played.steps.len());
    // The first two are to stay: the motion begins with the second.
    let began = played.steps[1].1;
    let mut last = began;
    for (said, &(dt_s, now)) in goals.iter().zip(&played.steps) {
        assert_eq!(dt_s, now.since(last).as_secs_f64());
        last = now.max(began);
        // 13 bytes and 2 goals, sent at once.
        assert!(said.at >= now && said.at.since(now) < MS, "{said:?}");
        let mut wanted = [Setpoint::default(); 2];
        played.trajectory.sample(now.since(began).as_secs_f64(), &mut wanted);
        for (_, goal) in said.goals() {
            let goal = (goal - 2048).abs() as f64;
            assert!((goal - counts(wanted[0].position_rad)).abs() <= 0.51, "{goal}");
        }
    }
    let steps = played.steps.windows(2).map(|two| two[1].1.since(two[0].1));
    assert!(steps.into_iter().all(|step| step.as_nanos().abs_diff(20_000_000) < 1_000_000));
}

#[test]
fn a_motion_ends_with_two_equal_goals_and_torque_on_and_that_is_said() {
    let played = Scene::default().play();
    let goals = played.goals_of(20);
    // 2 s at 50 Hz: steps 0 to 100, perhaps 101 for its rounding, and one goal more.
    assert!((102..=103).contains(&goals.len()), "{}", goals.len());
    played.came_to_rest(20);
    played.came_to_rest(21);
    assert_eq!(goals.last(), Some(&0));
    assert!(goals[50] > 190, "on the way: {goals:?}");
    assert_eq!(played.run.left.holding, ["joint0", "joint1"]);
    assert_eq!(played.run.notes, ["torque stays on: the joints hold where they are"]);
    assert_eq!(played.bench.torque(), [1, 1]);
    let cycles = played.run.tally.cycles;
    assert_eq!(cycles as usize, goals.len() + 1, "it ends in the cycle after the last goal");
    assert!((played.run.duration_s - 0.02 * (cycles - 1) as f64).abs() < 0.01);
    assert_eq!((played.run.tally.late_cycles, played.run.tally.missed_cycles), (0, 0));
    assert_eq!(played.run.flight.len(), 50);
}

#[test]
fn the_sink_sees_each_cycle_with_the_goal_in_effect_and_what_was_read() {
    let seen = Cell::new(Vec::new());
    let scene = Scene {
        sink: Box::new(|sample| {
            let state = sample.states[1].as_ref().expect("read").0;
            let slow = sample.health.as_ref().map(|(joint, _)| *joint);
            assert_eq!(sample.wanted_rad.len(), 2);
            seen.borrow_mut().push((
                sample.cycle,
                sample.at,
                sample.goal_rad[1],
                state.position_rad,
                slow,
                sample.goal_velocity_rad_s[1],
            ));
        }),
        ..Scene::default()
    };
    let played = scene.play();
    let seen = seen.into_inner();
    assert_eq!(seen.len() as u64, played.run.tally.cycles);
    for (k, &(cycle, at, goal_rad, present_rad, slow, speed)) in seen.iter().enumerate() {
        assert_eq!(cycle, k as u64);
        assert_eq!(at.since(seen[0].1), k as u32 * T);
        // A goal is rounded to a count.
        assert!((goal_rad - present_rad).abs() < 0.0008, "{k}: {goal_rad} {present_rad}");
        if k > 0 {
            let mut wanted = [Setpoint::default(); 2];
            let written = played.steps.get(k - 1).map(|step| step.1);
            let motion_s = written.map_or(2.0, |at| at.since(played.steps[1].1).as_secs_f64());
            played.trajectory.sample(motion_s, &mut wanted);
            assert!((wanted[1].velocity_rad_s - speed).abs() < 1e-9, "{k}");
        }
        // The slow facts: two reads of each joint in turn.
        let parts = played.bench.link.health_reads(0);
        assert_eq!(slow, Some(k / parts % 2), "{k}");
    }
}

#[test]
fn a_wish_to_stop_slows_the_motion_down_once_and_is_told_with_its_cycle() {
    let cycle = Cell::new(0);
    let scene = Scene {
        sink: Box::new(|sample| *cycle.borrow_mut() = sample.cycle),
        asked: Box::new(|| *cycle.borrow() >= 24),
        ..Scene::default()
    };
    let played = scene.play();
    assert_eq!(played.run.stop, Some(StopReason::Asked));
    let data = played.run.stop_data.as_ref().expect("data");
    assert_eq!((data.code, data.cycle), (StopCode::Asked, Some(25)));
    assert_eq!(played.stops, 1);
    played.came_to_rest(20);
    // From its full speed: pi/2 x 0.2 s of ramp, and the last goals.
    let goals = played.goals_of(20).len();
    assert!((40..=44).contains(&goals), "{goals}");
}

#[test]
fn a_wish_to_stop_after_the_last_goals_changes_nothing() {
    let goals = Cell::new(0);
    let scene = Scene {
        step: Box::new(|_| *goals.borrow_mut() += 1),
        motion: Some(Box::new(Standing)),
        asked: Box::new(|| *goals.borrow() >= 2),
        ..Scene::default()
    };
    let played = scene.play();
    assert_eq!((played.goals().len(), &played.run.stop), (2, &None));
    let scene =
        Scene { motion: Some(Box::new(Standing)), asked: Box::new(|| true), ..Scene::default() };
    assert_eq!(scene.play().run.stop, Some(StopReason::Asked));
}

/// A host that stands still in its sink, in cycle 25, until so long after its last goals.
fn stalled_in_the_sink(until: Duration) -> Played {
    let (clock, last) = (Cell::new(None), Cell::new(Instant::ZERO));
    let scene = Scene {
        sink: Box::new(|sample| {
            let clock = clock.borrow();
            let clock: &Shared = clock.as_ref().expect("set");
            if sample.cycle == 25 {
                clock.sleep_until(*last.borrow() + until);
            }
        }),
        step: Box::new(|_| {
            *last.borrow_mut() = clock.borrow().as_ref().expect("set").now();
        }),
        ..Scene::default()
    };
    scene.play_on(|world| *clock.borrow_mut() = Some(world))
}

#[test]
fn a_host_that_stands_still_for_100_ms_inside_a_cycle_goes_on() {
    let played = stalled_in_the_sink(100 * MS);
    assert_eq!(played.run.stop, None);
    assert_eq!(played.run.exceptions, []);
    // 80 ms of 20 ms are gone.
    assert!((3..=4).contains(&played.run.tally.missed_cycles));
    assert_eq!(played.run.tally.late_cycles, 1);
}

#[test]
fn a_host_that_stands_still_for_longer_inside_a_cycle_leaves_the_joints_at_their_last_goal() {
    let played = stalled_in_the_sink(100 * MS + NS);
    let Some(StopReason::Stalled { gap_s }) = played.run.stop else {
        panic!("{:?}", played.run.stop)
    };
    assert_eq!(gap_s, 0.100_000_001);
    assert_eq!(played.run.exceptions, [Exception::Stalled { gap_s }]);
    let goals = played.goals_of(20);
    // Cycles 0 to 24 had goals; 25 and 26 tell the last one again.
    assert_eq!(goals.len(), 27);
    assert_eq!([goals[25], goals[26]], [goals[24]; 2]);
    assert!(goals[24] > goals[23]);
    assert_eq!(played.run.stop_data.and_then(|stop| stop.cycle), Some(25));
}

/// A host that stands still as its goals of cycle 25 leave.
fn stalled_as_goals_leave(lasts: Duration) -> Played {
    let setup = move |bench: &Bench| {
        let mut goals = 0;
        bench.world.at_each(move |world: &mut World, said: &Said| {
            goals += u32::from(said.is_goals());
            if goals == 26 && said.is_goals() {
                world.stall(lasts);
            }
        });
    };
    Scene { setup: Box::new(setup), ..Scene::default() }.play()
}

#[test]
fn goals_that_leave_late_are_told_and_the_motion_goes_on_from_when_they_left() {
    let on_time = stalled_as_goals_leave(10 * MS);
    assert_eq!(on_time.run.exceptions, []);
    assert!((on_time.steps[26].0 - 0.02).abs() < 1e-3);
    for lasts in [10 * MS + NS, 60 * MS] {
        let played = stalled_as_goals_leave(lasts);
        let late_s = lasts.as_secs_f64();
        assert_eq!(played.run.exceptions, [Exception::SentLate { late_s }]);
        assert_eq!(played.run.stop, None);
        let left = played.steps[25].1 + lasts;
        assert_eq!(played.steps[26].0, played.steps[26].1.since(left).as_secs_f64());
        let said = format!("goals left {:.0} ms late", late_s * 1e3);
        assert!(played.run.notes.iter().any(|note| note.starts_with(&said)));
        played.came_to_rest(20);
    }
}

#[test]
fn a_pause_between_two_cycles_freezes_the_goals_as_well() {
    let played = stalled_as_goals_leave(130 * MS);
    assert_eq!(played.code(), Some(StopCode::Stalled));
    assert!(played.has(|e| matches!(e, Exception::Stalled { .. })));
    let goals = played.goals_of(20);
    assert_eq!(goals.len(), 28);
    assert_eq!([goals[26], goals[27]], [goals[25]; 2]);
}

#[test]
fn a_host_that_is_late_five_times_slows_the_motion_down() {
    let clock = Cell::new(None::<Shared>);
    let late = |cycles: u64| {
        let scene = Scene {
            sink: Box::new(|sample| {
                if sample.cycle >= 10 && sample.cycle < 10 + 2 * cycles && sample.cycle % 2 == 0 {
                    let clock = clock.borrow();
                    let clock = clock.as_ref().expect("set");
                    // Over its period: the next one is late.
                    clock.sleep_until(sample.at + 25 * MS);
                }
            }),
            ..Scene::default()
        };
        scene.play_on(|world| *clock.borrow_mut() = Some(world))
    };
    let four = late(4);
    assert_eq!((four.run.stop.clone(), four.run.tally.late_cycles), (None, 4));
    assert_eq!(four.run.tally.missed_cycles, 4);
    let five = late(5);
    assert_eq!(five.run.stop, Some(StopReason::Late { cycles: 5 }));
    five.came_to_rest(20);
}

#[test]
fn a_cycle_that_begins_more_than_half_a_period_after_its_time_is_late() {
    let late_cycles = |late: Duration| {
        let clock = Cell::new(None::<Shared>);
        let scene = Scene {
            sink: Box::new(|sample| {
                if sample.cycle == 20 {
                    let clock = clock.borrow();
                    let mut world = clock.as_ref().expect("set").lock();
                    world.oversleeps = Some((sample.at + T, late));
                }
            }),
            ..Scene::default()
        };
        let tally = scene.play_on(|world| *clock.borrow_mut() = Some(world)).run.tally;
        (tally.late_cycles, tally.missed_cycles)
    };
    assert_eq!(late_cycles(10 * MS), (0, 0));
    assert_eq!(late_cycles(10 * MS + NS), (1, 0));
}

#[test]
fn a_pause_between_arming_and_the_first_cycle_is_a_stall() {
    for (pause, stalls) in [(90, false), (110, true)] {
        let setup = move |bench: &Bench| bench.world.lock().stall(pause * MS);
        let played = Scene { setup: Box::new(setup), ..Scene::default() }.play();
        assert_eq!(played.code() == Some(StopCode::Stalled), stalls, "{pause}");
        assert_eq!(played.goals().len() == 2, stalls);
    }
}

/// Does something as the goals of a cycle are heard.
fn at_goals(
    cycle: u32,
    mut what: impl FnMut(&mut World) + Send + 'static,
) -> Box<dyn FnOnce(&Bench)> {
    Box::new(move |bench: &Bench| {
        let mut goals = 0;
        bench.world.at_each(move |world: &mut World, said: &Said| {
            goals += u32::from(said.is_goals() && said.line == 0);
            if goals == cycle + 1 && said.is_goals() && said.line == 0 {
                what(world);
            }
        });
    })
}

/// Servos are silent from the reads of one cycle on, and from those of another no more.
fn silent_between(
    joints: &'static [usize],
    cycles: std::ops::Range<u64>,
    mut afterwards: impl FnMut(&mut Servo) + Send + 'static,
) -> Box<dyn FnOnce(&Bench)> {
    Box::new(move |bench: &Bench| {
        // Cycles are told by the clock: questions may be asked again, goals may be held back.
        let (mut began, mut over) = (None, false);
        bench.world.at_each(move |world: &mut World, said: &Said| {
            let began = *began.get_or_insert(said.at);
            let cycle = ((said.at.since(began) + MS).as_nanos() / T.as_nanos()) as u64;
            for &joint in joints {
                let servo = &mut world.servos[joint];
                servo.silent = cycles.contains(&cycle);
                if cycle >= cycles.end && !over {
                    afterwards(servo);
                }
            }
            over |= cycle >= cycles.end;
        });
    })
}

#[test]
fn a_line_that_vanishes_is_left_and_the_other_comes_to_rest_along_its_path() {
    let setup = at_goals(25, |world| world.unplug(1));
    let played = Scene { line_of: &[0, 1], setup, ..Scene::default() }.play();
    let Some(StopReason::LineLost { line, joints, .. }) = played.run.stop.clone() else {
        panic!("{:?}", played.run.stop)
    };
    assert_eq!((line.as_str(), joints), ("line1", vec!["joint1".to_owned()]));
    assert_eq!(played.run.exceptions, [Exception::LineLost { line }]);
    played.came_to_rest(20);
    assert!(played.goals_of(20).len() > 40);
    assert!(played.goals_of(21).len() < 27);
    // Nobody waits for joints that say nothing to come to rest.
    let cycles = played.run.tally.cycles as usize;
    assert!(cycles <= played.goals_of(20).len() + 1, "{cycles}");
    assert_eq!(played.run.left.holding, ["joint0"]);
    assert_eq!(played.run.left.unknown, ["joint1"]);
}

#[test]
fn a_robot_whose_only_line_vanishes_is_left_at_once() {
    let setup = at_goals(25, |world| world.unplug(0));
    let played = Scene { setup, ..Scene::default() }.play();
    assert_eq!(played.code(), Some(StopCode::LineLost));
    assert_eq!(played.goals().len(), 26);
    assert_eq!(played.run.tally.cycles, 26, "in the cycle after");
    assert_eq!(played.run.left.unknown, ["joint0", "joint1"]);
    assert_eq!(played.run.exceptions, [Exception::LineLost { line: "line0".to_owned() }]);
}

#[test]
fn a_line_that_vanishes_as_slow_facts_are_read_is_left_in_that_cycle() {
    let setup = |bench: &Bench| {
        let mut reads = 0;
        bench.world.at_each(move |world: &mut World, said: &Said| {
            reads += u32::from(said.instruction == READ);
            if reads == 26 {
                world.unplug(0);
            }
        });
    };
    let played = Scene { setup: Box::new(setup), ..Scene::default() }.play();
    assert_eq!(played.code(), Some(StopCode::LineLost));
    assert_eq!((played.goals().len(), played.run.tally.cycles), (25, 25));
}

#[test]
fn both_lines_may_vanish_one_after_the_other() {
    let setup = at_goals(25, |world| world.unplug(1));
    let both = move |bench: &Bench| {
        setup(bench);
        let world = bench.world.clone();
        let mut goals = 0;
        world.at_each(move |world: &mut World, said: &Said| {
            goals += u32::from(said.is_goals() && said.line == 0);
            match goals {
                26 => world.unplug(1),
                30 => world.unplug(0),
                _ => {}
            }
        });
    };
    let played = Scene { line_of: &[0, 1], setup: Box::new(both), ..Scene::default() }.play();
    assert_eq!(played.run.exceptions.len(), 2);
    assert_eq!(played.goals_of(20).len(), 30);
    assert!(played.run.notes.iter().all(|note| !note.contains("nobody answered")));
}

#[test]
fn servos_that_were_all_silent_say_that_they_drive_before_they_are_told_another_goal() {
    let setup = silent_between(&[0, 1], 20..22, |_| {});
    let played = Scene { setup, ..Scene::default() }.play();
    assert_eq!(played.run.stop, None);
    assert_eq!(played.run.exceptions, []);
    let log = played.bench.log();
    let answered = log[0].at + 21 * T + 19 * MS;
    let read = log.iter().position(|said| said.is(SYNC_READ, PRESENT) && said.at >= answered);
    let asked = log.iter().position(|said| said.is(SYNC_READ, TORQUE));
    let told = log.iter().position(|said| said.is_goals() && said.at >= answered);
    assert!(read.is_some() && read < asked && asked < told, "{read:?} {asked:?} {told:?}");
    played.came_to_rest(20);
}

#[test]
fn one_lost_reading_of_one_servo_is_no_reason_to_ask() {
    let setup = silent_between(&[1], 20..21, |_| {});
    let played = Scene { setup, ..Scene::default() }.play();
    assert_eq!(played.run.stop, None);
    let before_end = played.bench.log().len() - 1;
    assert!(!played.bench.log()[..before_end].iter().any(|said| said.is(SYNC_READ, TORQUE)));
}

#[test]
fn a_servo_that_was_silent_alone_and_goes_on_may_have_missed_goals_and_is_named() {
    let setup = silent_between(&[1], 20..22, |_| {});
    let played = Scene { setup, ..Scene::default() }.play();
    assert_eq!(played.run.stop, None);
    assert_eq!(played.run.exceptions, [Exception::MissedGoals { joint: "joint1".to_owned() }]);
    played.came_to_rest(21);
}

#[test]
fn a_joint_missed_before_the_second_goal_may_not_have_heard_the_first_and_is_named() {
    for (cycle, is_named) in [(0, true), (1, true), (2, false)] {
        let setup = silent_between(&[1], cycle..cycle + 1, |_| {});
        let played = Scene { setup, ..Scene::default() }.play();
        assert_eq!(played.run.stop, None);
        let missed = Exception::MissedGoals { joint: "joint1".to_owned() };
        let named: Vec<_> = Some(missed).filter(|_| is_named).into_iter().collect();
        assert_eq!(played.run.exceptions, named, "cycle {cycle}");
    }
}

#[test]
fn a_line_whose_servos_come_back_limp_is_told_nothing_more() {
    let setup = silent_between(&[0, 1], 20..22, Servo::restart);
    let played = Scene { line_of: &[0, 0, 1], setup, ..Scene::default() }.play();
    let Some(StopReason::CameBackLimp { line, joints }) = played.run.stop.clone() else {
        panic!("{:?}", played.run.stop)
    };
    assert_eq!((line.as_str(), joints.len()), ("line0", 2));
    assert_eq!(played.run.exceptions, [Exception::LineLost { line }]);
    // Goals of cycles 0 to 21, none to line 0 after that.
    assert_eq!(played.goals_of(20).len(), 22);
    played.came_to_rest(22);
    assert!(played.goals_of(22).len() > 30);
    assert_eq!(played.bench.torque(), [0, 0, 1]);
}

#[test]
fn a_robot_that_comes_back_limp_as_a_whole_is_left_at_once() {
    let setup = silent_between(&[0, 1], 20..22, Servo::restart);
    let played = Scene { setup, ..Scene::default() }.play();
    assert_eq!(played.code(), Some(StopCode::CameBackLimp));
    assert_eq!(played.goals().len(), 22);
    assert_eq!(played.run.tally.cycles, 23);
}

#[test]
fn a_servo_that_comes_back_limp_alone_is_told_nothing_more_and_the_others_are() {
    let setup = silent_between(&[1], 20..22, Servo::restart);
    let played = Scene { setup, ..Scene::default() }.play();
    let joint = "joint1".to_owned();
    let fault = "the servo came back without torque (did it restart?)".to_owned();
    assert_eq!(played.run.stop, Some(StopReason::ServoFault { joint: joint.clone(), fault }));
    assert_eq!(played.run.exceptions, [Exception::Limp { joint }]);
    assert_eq!(played.goals_of(21).len(), 22);
    played.came_to_rest(20);
    assert_eq!(played.bench.torque(), [1, 0]);
    let said = "joint joint1 had let go and was told nothing more";
    assert!(played.run.notes.iter().any(|note| note == said));
    assert_eq!(played.run.stop_data.and_then(|stop| stop.line).as_deref(), Some("line0"));
}

#[test]
fn a_servo_that_forgot_its_speed_limit_is_not_as_it_was_armed() {
    let setup = silent_between(&[1], 20..22, |servo| {
        servo.restart();
        servo.set(TORQUE, 1);
    });
    let played = Scene { setup, ..Scene::default() }.play();
    assert_eq!(played.code(), Some(StopCode::ServoFault));
    assert_eq!(played.goals_of(21).len(), 22);
}

#[test]
fn no_goals_go_to_a_line_on_which_somebody_owes_an_answer() {
    let setup = silent_between(&[0, 1], 20..22, |servo| servo.mute_about.push(TORQUE));
    let freed = |cycle: u64| {
        let world = Cell::new(None::<Shared>);
        let setup = silent_between(&[0, 1], 20..22, |servo| servo.mute_about.push(TORQUE));
        let scene = Scene {
            setup,
            sink: Box::new(|sample| {
                if sample.cycle == cycle {
                    let world = world.borrow();
                    let mut world = world.as_ref().expect("set").lock();
                    world.servos.iter_mut().for_each(|servo| servo.mute_about.clear());
                }
            }),
            ..Scene::default()
        };
        scene.play_on(|shared| *world.borrow_mut() = Some(shared))
    };
    // Said two cycles later: goals are told again, and the motion goes on.
    let played = freed(23);
    assert_eq!(played.run.stop, None);
    let cycles: Vec<Instant> = played.steps.iter().map(|step| step.1).collect();
    let told = |k: usize| played.goals().iter().any(|g| g.at >= cycles[k] && g.at < cycles[k + 1]);
    assert_eq!([21, 22, 23, 24].map(told), [true, false, false, true]);
    // Owed for five cycles: it counts as silent, and is waited for no longer than a stop may last.
    let played = Scene { setup, ..Scene::default() }.play();
    let Some(StopReason::Silent { cycles, miss, joint }) = played.run.stop.clone() else {
        panic!("{:?}", played.run.stop)
    };
    assert_eq!((cycles, joint.as_str()), (5, "joint0"));
    assert_eq!(miss, "it does not say whether its torque is on");
    assert_eq!(played.goals().len(), 22);
    assert_eq!(played.run.stop_data.and_then(|stop| stop.cycle), Some(26));
    // Twice the longest stop, 0.36 s, and 0.5 s to settle.
    assert!((played.run.duration_s - (0.52 + 1.22)).abs() < 0.045, "{}", played.run.duration_s);
}

#[test]
fn a_motion_nobody_answers_is_run_down_blindly_and_no_longer_than_a_stop_may_last() {
    let setup = silent_between(&[0, 1], 20..9999, |_| {});
    let played = Scene { setup, ..Scene::default() }.play();
    assert_eq!(played.code(), Some(StopCode::Silent));
    assert_eq!(played.run.stop_data.as_ref().and_then(|stop| stop.cycle), Some(24));
    played.came_to_rest(20);
    let [Exception::BlindRamp { blind_s, most_s, rested }, ref silent @ ..] =
        played.run.exceptions[..]
    else {
        panic!("{:?}", played.run.exceptions)
    };
    let no_answer = |joint: &str| Exception::NoAnswer { joint: joint.to_owned() };
    assert_eq!(silent, [no_answer("joint0"), no_answer("joint1")]);
    assert!(rested && blind_s <= most_s + 0.02, "{blind_s} {most_s}");
    assert!((most_s - (1.6 * 0.2 + 0.04)).abs() < 1e-9);
    assert!(played.run.notes.iter().any(|note| note.contains("and the goals came to rest")));
    // One note for all of them, and not one for each.
    let unanswered =
        played.run.notes.iter().filter(|note| note.starts_with("no answer to the end"));
    let unanswered: Vec<_> = unanswered.collect();
    assert!(unanswered.len() == 1 && unanswered[0].contains("joint0, joint1"), "{unanswered:?}");
    assert_eq!(played.run.left.unknown, ["joint0", "joint1"]);
}

#[test]
fn a_blind_motion_that_does_not_come_to_rest_is_cut_off() {
    let setup = silent_between(&[0, 1], 20..9999, |_| {});
    let motion = Some(Box::new(Restless(0.0)) as Box<dyn Motion>);
    let played = Scene { setup, motion, ..Scene::default() }.play();
    let [Exception::BlindRamp { blind_s, rested, .. }, _, _] = played.run.exceptions[..] else {
        panic!("{:?}", played.run.exceptions)
    };
    assert!(!rested && (0.36..0.4).contains(&blind_s), "{blind_s}");
    assert!(
        played.run.notes.iter().any(|note| note.contains("and the goals did not come to rest"))
    );
    assert!((played.run.duration_s - (0.48 + 0.36)).abs() < 0.045, "{}", played.run.duration_s);
}

#[test]
fn a_stop_that_never_ends_is_cut_off() {
    let cycle = Cell::new(0);
    let scene = Scene {
        sink: Box::new(|sample| *cycle.borrow_mut() = sample.cycle),
        asked: Box::new(|| *cycle.borrow() >= 9),
        motion: Some(Box::new(Restless(0.0))),
        ..Scene::default()
    };
    let played = scene.play();
    // Asked in cycle 10; twice the longest stop, 0.36 s, and 0.5 s to settle.
    assert!((played.run.duration_s - (0.2 + 1.22)).abs() < 0.025, "{}", played.run.duration_s);
    assert!(played.has(|e| matches!(e, Exception::BlindRamp { rested: false, .. })));
}

#[test]
fn joints_that_still_move_after_the_last_goal_are_waited_for_half_a_second() {
    // 200 counts per second are 0.31 rad/s.
    let moving = |joints: &'static [usize], speed: i64| {
        let setup = move |bench: &Bench| {
            joints.iter().for_each(|&joint| bench.change(joint, |servo| servo.set_word(58, speed)));
        };
        Scene { setup: Box::new(setup), motion: Some(Box::new(Standing)), ..Scene::default() }
            .play()
    };
    assert_eq!(moving(&[], 0).run.tally.cycles, 3);
    assert_eq!(moving(&[0], 32).run.tally.cycles, 3, "0.0491 rad/s is rest");
    let waited = moving(&[1], 33).run;
    assert_eq!(waited.tally.cycles, 3 + 25, "0.0506 rad/s is not");
    assert_eq!(waited.stop, None);
}

#[test]
fn who_does_not_answer_after_the_last_goal_is_not_at_rest_but_not_waited_for_for_ever() {
    let setup = silent_between(&[1], 2..9999, |_| {});
    let motion = Some(Box::new(Standing) as Box<dyn Motion>);
    let played = Scene { setup, motion, ..Scene::default() }.play();
    assert_eq!(played.run.tally.cycles, 3 + 25);
    let setup = silent_between(&[0, 1], 2..9999, |_| {});
    let motion = Some(Box::new(Standing) as Box<dyn Motion>);
    let played = Scene { setup, motion, ..Scene::default() }.play();
    assert_eq!(played.run.tally.cycles, 2 + 5, "nobody answers");
}

#[test]
fn a_goal_the_guard_refuses_leaves_the_joints_where_they_were_told_to_be() {
    // 5.4454 rad/s for 20 ms are 0.109 rad.
    let motion = Some(Box::new(Jump { at: 5, to_rad: 0.13, step: 0 }) as Box<dyn Motion>);
    let played = Scene { motion, ..Scene::default() }.play();
    let Some(StopReason::Refused { joint, reason }) = played.run.stop.clone() else {
        panic!("{:?}", played.run.stop)
    };
    assert_eq!(joint, "joint0");
    assert!(reason.starts_with("step of"), "{reason}");
    assert_eq!(played.run.exceptions, [Exception::GuardRefused]);
    assert_eq!(played.goals_of(20), [0; 7]);
    assert_eq!(played.run.stop_data.and_then(|stop| stop.cycle), Some(5));
    let motion = Some(Box::new(Jump { at: 5, to_rad: 0.1, step: 0 }) as Box<dyn Motion>);
    assert_eq!(Scene { motion, ..Scene::default() }.play().run.stop, None);
}

#[test]
fn a_goal_that_goes_on_after_it_stood_is_followed_by_two_equal_ones() {
    let motion = Some(Box::new(GoesOn(0)) as Box<dyn Motion>);
    let played = Scene { motion, ..Scene::default() }.play();
    assert_eq!(played.run.stop, None);
    // A count is 1.5 mrad.
    assert_eq!(played.goals_of(20), [0, 0, 0, 0, 3, 7, 7]);
}

#[test]
fn what_rounding_alone_carried_past_a_limit_is_at_the_limit() {
    let limits = JointLimits::new(-1.0, 2.0, 1.0, 1.0).expect("limits");
    let held = |rad| unrounded(rad, &limits);
    assert_eq!([held(0.5), held(2.0), held(-1.0)], [0.5, 2.0, -1.0]);
    assert_eq!([held(2.0 + 0.9e-9), held(-1.0 - 0.9e-9)], [2.0, -1.0]);
    assert_eq!([held(2.0 + 1.1e-9), held(-1.0 - 1.1e-9)], [2.0 + 1.1e-9, -1.0 - 1.1e-9]);
}

#[test]
fn the_goal_of_a_joint_that_is_blocked_stays_near_it_and_the_motion_stops() {
    let setup = |bench: &Bench| bench.change(1, |servo| servo.stuck = true);
    /// 0.4 rad/s without end.
    struct On(f64);
    impl Motion for On {
        fn advance(&mut self, dt_s: f64, _now: Instant, setpoints: &mut [Setpoint]) -> bool {
            self.0 += dt_s;
            let setpoint =
                Setpoint { position_rad: 0.4 * self.0, velocity_rad_s: 0.4, ..Setpoint::default() };
            setpoints.fill(setpoint);
            self.0 >= 1.0
        }
        fn stop(&mut self) {}
    }
    let motion = Some(Box::new(On(0.0)) as Box<dyn Motion>);
    let played = Scene { setup: Box::new(setup), motion, ..Scene::default() }.play();
    let furthest = played.goals_of(21).into_iter().max().expect("goals");
    assert!((220..=229).contains(&furthest), "0.35 rad are 228.2 counts: {furthest}");
    assert!(played.goals_of(20).into_iter().max() > Some(255));
    assert!(!played.has(|e| matches!(e, Exception::GoalHeld { .. })));
}

#[test]
fn a_joint_that_does_not_follow_is_told_with_its_line() {
    let setup = |bench: &Bench| {
        bench.change(1, |servo| servo.stuck = true);
        // Pushed away in the motion, further than the bound, as fast as can be believed.
        let mut goals = 0;
        bench.world.at_each(move |world: &mut World, said: &Said| {
            goals += i64::from(said.is_goals());
            if said.is_goals() && goals <= 10 {
                world.servos[1].set_word(PRESENT, 2048 - 30 * goals);
            }
        });
    };
    let motion = Some(Box::new(Restless(0.0)) as Box<dyn Motion>);
    let played = Scene { setup: Box::new(setup), motion, ..Scene::default() }.play();
    let Some(StopReason::NotFollowing { joint, .. }) = &played.run.stop else {
        panic!("{:?}", played.run.stop)
    };
    assert_eq!(joint, "joint1");
    let data = played.run.stop_data.clone().expect("data");
    assert_eq!((data.line.as_deref(), data.joint.as_deref()), (Some("line0"), Some("joint1")));
}

#[test]
fn a_servo_that_lets_go_in_the_motion_is_told_nothing_more() {
    let setup = at_goals(20, |world| world.servos[1].set(TORQUE, 0));
    let played = Scene { setup, ..Scene::default() }.play();
    let Some(StopReason::ServoFault { joint, fault }) = &played.run.stop else {
        panic!("{:?}", played.run.stop)
    };
    assert_eq!(joint, "joint1");
    assert!(fault.contains("switched its torque off"), "{fault}");
    assert_eq!(played.run.exceptions, [Exception::Limp { joint: joint.clone() }]);
    let (gone, others) = (played.goals_of(21).len(), played.goals_of(20).len());
    assert!((21..=30).contains(&gone) && others > gone + 10, "{gone} {others}");
    played.came_to_rest(20);
}

#[test]
fn a_servo_that_reports_an_error_is_named_with_the_words_for_it() {
    let setup = at_goals(20, |world| world.servos[1].set(super::super::testing::STATUS, 0x20));
    let played = Scene { setup, ..Scene::default() }.play();
    let fault = "overload".to_owned();
    let joint = "joint1".to_owned();
    assert_eq!(played.run.stop, Some(StopReason::ServoFault { joint, fault }));
    played.came_to_rest(21);
}

#[test]
fn a_servo_that_is_too_hot_or_badly_supplied_stops_the_motion() {
    let setup = at_goals(20, |world| world.servos[1].set(63, 70));
    assert_eq!(Scene { setup, ..Scene::default() }.play().code(), Some(StopCode::Hot));
    let setup = at_goals(20, |world| world.servos.iter_mut().for_each(|servo| servo.set(62, 39)));
    assert_eq!(Scene { setup, ..Scene::default() }.play().code(), Some(StopCode::LowVoltage));
}

#[test]
fn a_reading_that_cannot_be_is_not_believed() {
    let setup = |bench: &Bench| {
        let mut goals = 0;
        bench.world.at_each(move |world: &mut World, said: &Said| {
            goals += i64::from(said.is_goals());
            // For one cycle it tells another position: 0.77 rad away.
            if goals == 20 && said.is(SYNC_READ, PRESENT) {
                world.servos[1].put_at(1500);
            }
        });
    };
    let played = Scene { setup: Box::new(setup), ..Scene::default() }.play();
    assert_eq!(played.run.stop, None);
    assert_eq!(played.run.tally.joints[1].missed, 1);
    assert_eq!(played.run.tally.joints[0].missed, 0);
}

/// A scene in which something panics in a cycle.
fn broken(cycle: usize, who: &'static str, for_good: bool) -> Played {
    let count = Cell::new(0_usize);
    let breaks = |k: usize| {
        assert!(k != cycle && !(for_good && k > cycle), "on purpose");
    };
    let mut scene = Scene::default();
    match who {
        "sink" => scene.sink = Box::new(move |sample| breaks(sample.cycle as usize)),
        "motion" => scene.step = Box::new(breaks),
        _ => {
            scene.asked = Box::new(move || {
                *count.borrow_mut() += 1;
                breaks(*count.borrow() - 1);
                false
            });
        }
    }
    scene.play()
}

#[test]
fn a_program_that_breaks_anywhere_has_its_joints_come_to_rest() {
    for who in ["sink", "motion", "asked"] {
        for cycle in [0, 1, 2, 30, 50, 99] {
            let played = broken(cycle, who, false);
            let words = "on purpose".to_owned();
            let said = format!("{who} in cycle {cycle}: {:?}", played.run);
            assert_eq!(played.run.stop, Some(StopReason::Broke { words }), "{said}");
            let told = played.run.stop_data.as_ref().and_then(|stop| stop.cycle);
            assert_eq!(told, Some(cycle as u64), "{said}");
            played.came_to_rest(20);
            assert_eq!(played.run.left.holding.len(), 2, "{said}");
        }
    }
}

#[test]
fn a_sink_or_a_wish_that_breaks_for_good_lets_the_motion_be_run_down() {
    for who in ["sink", "asked"] {
        let played = broken(30, who, true);
        assert_eq!(played.code(), Some(StopCode::Broke));
        played.came_to_rest(20);
        assert_eq!(played.run.exceptions, [], "{who}");
        // Along the ramp: 0.31 s.
        let goals = played.goals_of(20).len();
        assert!((44..=50).contains(&goals), "{who}: {goals}");
    }
}

#[test]
fn a_motion_that_breaks_for_good_leaves_the_joints_at_their_last_goal() {
    let played = broken(30, "motion", true);
    assert_eq!(played.code(), Some(StopCode::Broke));
    let goals = played.goals_of(20);
    // None of a motion that does not tell any; the last one is told twice more.
    assert_eq!(goals.len(), 32);
    assert!(goals[29] == goals[30] && goals[30] == goals[31], "{goals:?}");
    assert!(played.has(|exception| *exception == Exception::GoalsBroke));
    assert!(played.run.duration_s < 1.0, "it ends: {}", played.run.duration_s);
}

#[test]
fn the_words_of_a_panic_are_kept() {
    assert_eq!(crate::control::net::words(&"said".to_owned()), "said");
    assert_eq!(crate::control::net::words(&"said"), "said");
    assert_eq!(crate::control::net::words(&5), "no words left");
}

#[test]
fn the_longest_stop_is_its_ramp_and_two_cycles() {
    let limits = [(2.0, 10.0), (3.0, 6.0)];
    let limits = limits.map(|(v, a)| JointLimits::new(-1.0, 1.0, v, a).expect("limits"));
    // 1.6 x 0.5 s + 2 x 0.02 s.
    assert!((longest_stop_s(&limits, T) - 0.84).abs() < 1e-12);
    assert!((longest_stop_s(&limits[..1], T) - 0.36).abs() < 1e-12);
}

#[test]
fn a_rate_becomes_a_period() {
    assert_eq!(Settings::at_rate(50.0).period, T);
    assert_eq!(Settings::at_rate(200.0).period, 5 * MS);
}

#[test]
fn the_share_of_the_time_a_line_was_busy_is_told() {
    let played = Scene::default().play();
    let log = played.bench.log();
    // All that was said before the joints were asked how they are left.
    let said = &log[..log.iter().position(|said| said.is(SYNC_READ, TORQUE)).expect("asked")];
    let bytes: usize = said
        .iter()
        .map(|said| {
            let answer = 6 + usize::from(said.params[1]);
            let answers = match said.instruction {
                SYNC_READ => answer * (said.params.len() - 2),
                READ => answer,
                _ => 0,
            };
            said.params.len() + 6 + answers
        })
        .sum();
    let share = bytes as f64 * 1e-5 / played.run.duration_s;
    assert!((played.run.bus_load - share).abs() < 1e-9, "{} {share}", played.run.bus_load);
}

#[test]
fn a_trajectory_is_run_from_where_the_robot_was_armed() {
    let mut bench = Bench::new(&[0, 0]);
    let found = bench.checked();
    let armed = arm(&mut bench.link, &found, &|| false).and_then(Arming::done).expect("armed");
    bench.forget_log();
    let trajectory = there_and_back(&bench.link.robot().limits());
    let mut sink = Each(Box::new(|_| {}));
    let settings = Settings::at_rate(50.0);
    let run = run(&mut bench.link, armed, &trajectory, settings, &mut sink, &|| false)
        .expect("its own joints");
    assert_eq!((run.stop, run.stop_data), (None, None));
    let goals = bench.log().iter().filter(|said| said.is_goals()).count();
    assert!((102..=103).contains(&goals));
    assert_eq!(bench.world.lock().servos[0].word(GOAL), 2048);
}

#[test]
fn a_stall_is_one_exception_and_none_once_the_last_goals_are_told() {
    // Seen inside its cycle, and by the next one as a gap.
    let played = stalled_in_the_sink(250 * MS);
    assert_eq!(played.run.exceptions.len(), 1, "{:?}", played.run.exceptions);
    let clock = Cell::new(None::<Shared>);
    let scene = Scene {
        motion: Some(Box::new(Standing)),
        setup: Box::new(|bench| bench.change(1, |servo| servo.set_word(58, 200))),
        sink: Box::new(|sample| {
            if sample.cycle == 6 {
                clock.borrow().as_ref().expect("set").sleep_until(sample.at + 250 * MS);
            }
        }),
        ..Scene::default()
    };
    let played = scene.play_on(|world| *clock.borrow_mut() = Some(world));
    assert_eq!(played.run.exceptions, []);
}

/// Lets a player that is about to begin, over two servos, be looked at from inside.
fn with_player<T>(look: impl FnOnce(&mut Player<'_>, &Shared) -> T) -> (T, Bench) {
    with_player_of(&mut Standing, look)
}

fn with_player_of<T>(
    motion: &mut dyn Motion,
    look: impl FnOnce(&mut Player<'_>, &Shared) -> T,
) -> (T, Bench) {
    let mut bench = Bench::new(&[0, 0]);
    let found = bench.checked();
    let armed = arm(&mut bench.link, &found, &|| false).and_then(Arming::done).expect("armed");
    bench.forget_log();
    let began = bench.link.clock().now();
    let world = bench.world.clone();
    let mut player = Player::new(&mut bench.link, armed, motion, began, Settings::at_rate(50.0));
    let seen = look(&mut player, &world);
    drop(player);
    (seen, bench)
}

/// Joint 1 moved at 2.5 rad/s, its goal ahead of it by almost as much as may be, and stopped dead:
/// the goal is on the bound at once.
fn stop_dead(player: &mut Player<'_>) {
    let began = player.link.clock().now();
    let mut advance = |at: u32, present_rad: f64, wanted_rad: f64| {
        let now = began + at * T;
        player.leash.heard(1, present_rad, now);
        let moving =
            Setpoint { position_rad: wanted_rad, velocity_rad_s: 5.0, ..Setpoint::default() };
        player.leash.advance(0.02, now, false, |_| true, &mut [Setpoint::default(), moving]);
        player.leash.forced().next()
    };
    assert_eq!(advance(1, 0.05, 0.33), None);
    assert_eq!(advance(2, 0.05, 0.43), Some(1));
}

#[test]
fn a_goal_that_was_held_at_once_is_told_as_such_and_that_once() {
    let ((exceptions, stop, frozen), _) = with_player(|player, _| {
        stop_dead(player);
        let settings = Settings::at_rate(50.0);
        for since in [T, 2 * T] {
            player.look_for_a_stall(since, settings, 7);
        }
        (player.exceptions.clone(), player.stop.clone(), player.frozen)
    });
    assert_eq!(exceptions, [Exception::GoalHeld { joint: "joint1".to_owned() }]);
    assert_eq!((stop, frozen), (None, false), "the motion goes on");
}

#[test]
fn a_goal_that_would_have_to_be_held_at_once_after_more_than_two_periods_is_a_stall() {
    for since in [2 * T + NS, 3 * T] {
        let ((exceptions, stop, frozen), _) = with_player(|player, _| {
            stop_dead(player);
            player.look_for_a_stall(since, Settings::at_rate(50.0), 7);
            (player.exceptions.clone(), player.stop.clone(), player.frozen)
        });
        let gap_s = since.as_secs_f64();
        assert_eq!(exceptions, [Exception::Stalled { gap_s }]);
        assert_eq!((stop, frozen), (Some(StopReason::Stalled { gap_s }), true));
    }
}

#[test]
fn a_pause_of_which_no_goal_would_be_a_jump_is_a_stall_after_100_ms_only() {
    let stalled = |since: Duration| {
        let look = |player: &mut Player<'_>, _: &Shared| {
            player.look_for_a_stall(since, Settings::at_rate(50.0), 7);
            (player.exceptions.len(), player.frozen)
        };
        with_player(look).0
    };
    assert_eq!([T, 3 * T, 100 * MS].map(stalled), [(0, false); 3]);
    assert_eq!([100 * MS + NS, 200 * MS].map(stalled), [(1, true); 2]);
}

#[test]
fn a_program_that_breaks_when_the_motion_is_over_or_nobody_is_left_makes_no_more_goals() {
    let broken = |goals_at_rest: u32, deserted: bool| {
        let (more, bench) = with_player(|player, _| {
            (player.goals_at_rest, player.deserted) = (goals_at_rest, deserted);
            player.broke("on purpose".to_owned(), 7, Settings::at_rate(50.0))
        });
        (more, bench.log().iter().filter(|said| said.is_goals()).count())
    };
    assert_eq!(broken(LAST_GOALS - 1, false), (true, 1));
    assert_eq!(broken(LAST_GOALS, false), (false, 0));
    assert_eq!(broken(0, true), (false, 0));
}

#[test]
fn a_motion_that_breaks_for_good_and_whose_last_goal_cannot_be_told_is_left_after_four_times() {
    struct Broken;
    impl Motion for Broken {
        fn advance(&mut self, _dt_s: f64, _now: Instant, _setpoints: &mut [Setpoint]) -> bool {
            panic!("on purpose");
        }
        fn stop(&mut self) {}
    }
    let settings = Settings::at_rate(50.0);
    let (more, _) = with_player_of(&mut Broken, |player, world| {
        world.lock().unplug(0);
        [(); 4].map(|()| player.broke("on purpose".to_owned(), 7, settings))
    });
    assert_eq!(more, [true, true, true, false]);
}
