//! Robots on CAN lines, and on CAN and serial lines together, played in virtual time.

mod program;
#[path = "can_robot/robots.rs"]
mod robots;
#[path = "scene/mod.rs"]
mod scene;

use gaitway::control::{self, Sample, Settings, Sink, StopReason};
use gaitway::port::sim::{SharedWorld, VirtualCanLine, VirtualClock, VirtualLine};
use gaitway::port::{BytePort, Clock, FramePort, Heard, PortError};
use gaitway::robot::{LinePort, Link, Robot};
use gaitway::time::{Duration, Instant};
use gaitway::wire::can::CanFrame;
use gaitway_profiles::LineKind;
use gaitway_sim::can::Trouble;
use gaitway_sim::{Damage, Fault, Options, World};
use robots::{CUBEMARS, CUBEMARS_SERVO, DAMIAO, Kind, MOTEUS, ODRIVE, RECOIL, ROBSTRIDE};
use scene::{Played, Scene, assert_clean};
use serde_json::Value;
use std::path::PathBuf;
use std::sync::atomic::Ordering;
use std::sync::{Arc, Mutex};

fn robot(text: &str, name: &str) -> Robot {
    let file = gaitway_profiles::parse_robot(&format!("{name}.toml"), text);
    Robot::new(file.unwrap_or_else(|e| panic!("{e}"))).expect("a robot")
}

fn legs(kind: Kind, rate_hz: f64) -> Scene {
    Scene::with_robot(robot(&robots::legs(kind, rate_hz), "legs"), Options::default())
}

fn few(kind: Kind, count: usize, rate_hz: f64) -> Scene {
    Scene::with_robot(robot(&robots::few(kind, count, rate_hz), "few"), Options::default())
}

/// It moved as far as it was told and stands still at the end.
fn assert_played(played: &Played, swing_rad: f64) {
    assert_eq!(played.run.stop, None, "{:?}", played.run.notes);
    assert_clean(&played.verdict);
    for (index, joint) in played.run.tally.joints.iter().enumerate() {
        let moved = joint.highest_rad - joint.lowest_rad;
        assert!((moved - swing_rad).abs() < 0.1, "joint {index} moved by {moved}");
    }
}

/// Bits of a classic frame of eight bytes with 11 bits of identifier, pause included, with the most
/// stuff bits there can be (Davis et al. 2007, section 3).
const FRAME_BITS: f64 = 135.0;
const BITRATE_BPS: f64 = 1e6;
const SECOND_NS: u64 = 1_000_000_000;

#[test]
fn twelve_actuators_on_one_line_play_at_200_hz() {
    let mut scene = legs(DAMIAO, 200.0);
    let found = scene.preflight().expect("a robot that is ready");
    // A goal and its answer for each of twelve, in cycles of 5 ms.
    let cycle_s = 12.0 * 2.0 * FRAME_BITS / BITRATE_BPS;
    assert!((found.wire_limit_hz - 1.0 / cycle_s).abs() < 0.1, "{} Hz", found.wire_limit_hz);
    assert!((found.bus_load - cycle_s * 200.0).abs() < 1e-6, "{}", found.bus_load);
    let words = found.lines[0].to_string();
    assert!(words.contains("answers to the goals of 12 actuators"), "{words}");
    assert!(words.contains("3.2 ms of 5.0 ms"), "{words}");

    let before = scene.link.can_stats(0).expect("a CAN line");
    let played = scene.play_until(0.5, 2, &|| false);
    assert_played(&played, 0.5);
    assert!(played.trajectory.duration_s() > 1.0);
    for joint in scene.link.robot().joint_names() {
        let speed = scene.world.lock().joint_velocity_rad_s(&joint).expect("a joint");
        assert!(speed.abs() < 0.05, "{joint} still turns at {speed} rad/s");
    }
    let stats = scene.link.can_stats(0).expect("a CAN line");
    assert_eq!((stats.foreign, stats.retried), (0, 0));
    // Twelve goals at once, into a queue of ten.
    assert!(stats.full_queue >= played.run.tally.cycles, "{stats:?}");
    let note = "line legs: send queue full, and waited for";
    assert!(played.run.notes.iter().any(|said| said.starts_with(note)), "{:?}", played.run.notes);
    // The preflight before it and the arming say a few hundred frames more.
    let goals = 12 * played.run.tally.cycles;
    let sent = stats.sent - before.sent;
    assert!(sent >= goals && sent < goals + 500, "{sent} frames for {goals} goals");
    // What the line was truly occupied for lies below, by stuff bits that were not needed.
    let (run, share) = (&played.run, cycle_s * 200.0);
    assert!((run.bus_load - share).abs() < 0.02, "{} is not {share}", run.bus_load);
    let world = scene.world.lock();
    let truth_s = world.can_line(0).expect("the line").busy_ns() as f64 * 1e-9;
    assert!(truth_s < stats.busy_s && truth_s > 0.8 * stats.busy_s, "{truth_s} {}", stats.busy_s);
    println!(
        "load {:.3}, limit {:.1} Hz, truly {:.3}",
        run.bus_load,
        found.wire_limit_hz,
        truth_s / stats.busy_s * run.bus_load
    );
}

#[test]
fn a_rate_the_line_cannot_carry_is_refused() {
    let mut scene = legs(DAMIAO, 300.0);
    let error = scene.preflight().expect_err("too fast").to_string();
    assert!(error.contains("the line is too slow for this rate"), "{error}");
    assert!(error.contains("at most --rate 246"), "80 % of 308.6 Hz: {error}");
}

#[test]
fn every_dialect_plays() {
    for kind in [DAMIAO, CUBEMARS, ROBSTRIDE, ODRIVE, MOTEUS, RECOIL, CUBEMARS_SERVO] {
        println!("{}", kind.servo);
        let played = few(kind, 3, 100.0).play(0.5, 2);
        assert_played(&played, 0.5);
        assert_eq!(played.run.tally.missed_cycles, 0, "{}", kind.servo);
    }
}

#[test]
fn the_gains_of_the_robot_file_are_told_before_anything_moves() {
    let mut scene = few(DAMIAO, 2, 100.0);
    let found = scene.preflight().expect("a robot that is ready");
    let policy = "kp 40 N m/rad, kd 1.5 N m s/rad: joint_1, joint_2";
    assert!(found.notes.iter().any(|note| note.ends_with(policy)), "{:?}", found.notes);
}

#[test]
fn what_actuators_say_of_themselves_is_told_once_for_all_that_say_the_same() {
    let found = few(RECOIL, 3, 100.0).preflight().expect("a robot that is ready");
    let told: Vec<_> = found.notes.iter().filter(|note| note.starts_with("firmware")).collect();
    assert_eq!(told.len(), 1, "{told:?}");
    // The version of Recoil that the virtual one has: its digits are a date.
    assert_eq!(*told[0], "firmware 0x20250226: joint_1, joint_2, joint_3");
}

/// Everything the host says in a world, with the line and the time.
type Said = Arc<Mutex<Vec<(usize, u64)>>>;

struct Tapped<P> {
    port: P,
    line: usize,
    clock: Arc<dyn Clock>,
    said: Said,
}

impl<P> Tapped<P> {
    fn note(&self) {
        let now_ns = self.clock.now().as_nanos();
        self.said.lock().expect("not poisoned").push((self.line, now_ns));
    }
}

impl FramePort for Tapped<VirtualCanLine> {
    fn full_queue_count(&self) -> u64 {
        self.port.full_queue_count()
    }

    fn send(&mut self, frame: &CanFrame, deadline: Instant) -> Result<(), PortError> {
        self.note();
        self.port.send(frame, deadline)
    }

    fn receive(&mut self, deadline: Instant) -> Result<Heard, PortError> {
        self.port.receive(deadline)
    }
}

impl BytePort for Tapped<VirtualLine> {
    fn send(&mut self, bytes: &[u8], deadline: Instant) -> Result<(), PortError> {
        // Goals are sync writes (instruction 0x83) to Goal Position (116); the rest are questions.
        if bytes.get(7) == Some(&0x83) && bytes.get(8) == Some(&116) {
            self.note();
        }
        self.port.send(bytes, deadline)
    }

    fn receive(&mut self, buffer: &mut [u8], deadline: Instant) -> Result<usize, PortError> {
        self.port.receive(buffer, deadline)
    }

    fn discard_input(&mut self) -> Result<(), PortError> {
        self.port.discard_input()
    }
}

/// A robot in a world, its host's words noted.
fn tapped(robot: Robot) -> (Scene, Said) {
    let world = World::new(&robot.file, Options::default()).expect("a virtual robot");
    let world = SharedWorld::new(world);
    let clock: Arc<dyn Clock> = Arc::new(VirtualClock(world.clone()));
    let said = Said::default();
    let ports = robot.lines.iter().enumerate().map(|(line, of)| {
        let (clock, said, world) = (Arc::clone(&clock), Arc::clone(&said), world.clone());
        let port = match of.kind {
            LineKind::Can(_) => {
                let port = VirtualCanLine::new(world, line);
                LinePort::Frames(Box::new(Tapped { port, line, clock, said }))
            }
            LineKind::Serial { baud_bps } => {
                let port = VirtualLine::new(world, line, baud_bps);
                LinePort::Bytes(Box::new(Tapped { port, line, clock, said }))
            }
        };
        (port, Duration::ZERO)
    });
    let ports = ports.collect();
    let settings = Settings::at_rate(robot.file.rate_hz);
    let host = scene::Host::new(&world);
    (Scene { world, link: Link::new(robot, ports, clock), settings, host }, said)
}

#[test]
fn a_mixed_robot_is_told_its_goals_on_all_lines_within_one_cycle() {
    let (mut scene, said) = tapped(robot(&robots::mixed(100.0), "mixed"));
    let played = scene.play_until(0.4, 2, &|| false);
    assert_played(&played, 0.4);
    // While it moved: the run ends with its last goal, and took so long.
    let said = said.lock().expect("not poisoned");
    let last_ns = said.iter().filter(|(line, _)| *line == 2).map(|(_, at)| *at).max();
    let last_ns = last_ns.expect("goals for the arms");
    let first_ns = last_ns - (played.run.duration_s * 1e9) as u64 + SECOND_NS / 2;
    let arms: Vec<u64> = said
        .iter()
        .filter(|&&(line, at)| line == 2 && (first_ns..last_ns - SECOND_NS / 2).contains(&at))
        .map(|&(_, at)| at)
        .collect();
    assert!(arms.len() > 50, "{} cycles", arms.len());
    let mut widest_ns = 0;
    for at in arms {
        // The legs' frames of this cycle: the twelve nearest.
        let mut near: Vec<u64> = said
            .iter()
            .filter(|(line, _)| *line != 2)
            .map(|(_, other)| other.abs_diff(at))
            .collect();
        near.sort_unstable();
        widest_ns = widest_ns.max(near[11]);
    }
    println!("goals of a cycle are told within {} us", widest_ns / 1000);
    assert!(widest_ns < 2_000_000, "{widest_ns} ns apart in a cycle of 10 ms");
}

/// Plays a moment and ends the host without a word.
fn killed_in_motion(scene: &mut Scene) {
    let found = scene.preflight().expect("a robot that is ready");
    let trajectory = scene.swing(&found.start_rad, 0.5, 2);
    let armed = scene::arm(&mut scene.link, &found).expect("torque");
    let (link, settings) = (&mut scene.link, scene.settings);
    let mut sink = KilledIn(40, Arc::clone(&scene.host));
    let run = control::run(link, armed, &trajectory, settings, &mut sink, &|| false)
        .expect("its own joints");
    assert_eq!(run.tally.cycles, 41, "it outlived its cycle");
    // The next host opens the line anew.
    scene.reopen();
}

/// A moteus and a Recoil go on braking, which they tell.
fn brakes(scene: &mut Scene) -> bool {
    let budget = scene.link.clock().now() + Duration::from_millis(100);
    scene.link.whole_states(budget).expect("a line");
    (0..scene.link.health_reads(1)).any(|part| {
        let told = scene.link.health(1, part, budget).expect("a line").error_bits;
        told.is_some_and(|bits| scene.link.error_words(1, bits).contains("host was silent"))
    })
}

/// In this cycle its lines are cut: not a word of the host is heard any more.
struct KilledIn(u64, Arc<scene::Host>);

impl Sink for KilledIn {
    fn take(&mut self, sample: &Sample<'_>) {
        if sample.cycle == self.0 {
            self.1.cut.store(true, Ordering::Relaxed);
        }
    }
}

#[test]
fn whoever_hears_nothing_from_the_host_lets_go_and_is_played_again() {
    // Recoil's watch is a second, the others' a fifth of one at most.
    for (kind, silence_ms) in
        [(DAMIAO, 200), (CUBEMARS, 200), (ROBSTRIDE, 200), (MOTEUS, 200), (RECOIL, 1000)]
    {
        let mut scene = few(kind, 3, 100.0);
        killed_in_motion(&mut scene);
        let wait_ms = |scene: &Scene, millis: u64| {
            let mut world = scene.world.lock();
            let until_ns = world.now_ns() + millis * 1_000_000;
            world.run_until(until_ns);
        };
        let shared = scene.world.clone();
        let trouble = || {
            let world = shared.lock();
            world.actuator("joint_2").expect("an actuator").trouble()
        };
        let driven = || shared.lock().actuator("joint_2").expect("an actuator").enabled();
        wait_ms(&scene, silence_ms - 20);
        assert!(driven(), "{}: let go too early", kind.servo);
        wait_ms(&scene, 40);
        let gone = !driven() || trouble() == Some(Trouble::Silence) || brakes(&mut scene);
        assert!(gone, "{}: still driven", kind.servo);
        wait_ms(&scene, 2000);
        let played = scene.play(0.3, 1);
        assert_eq!(played.run.stop, None, "{}: {:?}", kind.servo, played.run.notes);
    }
}

#[test]
fn an_actuator_with_an_error_is_refused_and_stops_a_motion_in_words() {
    for (kind, words) in [
        (DAMIAO, "voltage too high"),
        (CUBEMARS, "voltage too high"),
        (MOTEUS, "voltage too high"),
        (ODRIVE, "voltage too high"),
        (RECOIL, "voltage too high"),
    ] {
        let mut scene = few(kind, 2, 100.0);
        {
            let mut world = scene.world.lock();
            let actuator = world.actuator_mut("joint_2").expect("an actuator");
            actuator.set_trouble(Some(Trouble::OverVoltage));
        }
        let error = scene.preflight().expect_err("a refusal").to_string();
        assert!(error.contains("joint_2") && error.contains(words), "{}: {error}", kind.servo);
    }
    for kind in [DAMIAO, CUBEMARS, ROBSTRIDE, MOTEUS, ODRIVE, RECOIL] {
        let trouble = Fault::Trouble {
            joint: "joint_2".into(),
            trouble: Trouble::OverVoltage,
            from_ns: 2 * SECOND_NS,
            until_ns: u64::MAX,
        };
        let options = Options { faults: vec![trouble], ..Options::default() };
        let robot = robot(&robots::few(kind, 2, 100.0), "few");
        let played = Scene::with_robot(robot, options).play(0.5, 4);
        let Some(StopReason::ServoFault { joint, fault }) = played.run.stop else {
            panic!("{}: {:?}", kind.servo, played.run.stop)
        };
        assert_eq!(joint, "joint_2");
        assert!(fault.contains("voltage too high"), "{}: {fault}", kind.servo);
    }
}

#[test]
fn ranges_other_than_the_profiles_are_refused() {
    let text = robots::few(DAMIAO, 2, 100.0);
    let other = text.replace("dm4310", "dm4340");
    let file = gaitway_profiles::parse_robot("few.toml", &other).expect("a robot");
    let world = SharedWorld::new(World::new(&file, Options::default()).expect("a world"));
    let clock: Arc<dyn Clock> = Arc::new(VirtualClock(world.clone()));
    let port: Box<dyn FramePort> = Box::new(VirtualCanLine::new(world.clone(), 0));
    let link = Link::new(robot(&text, "few"), vec![(port, Duration::ZERO)], clock);
    let host = scene::Host::new(&world);
    let mut scene = Scene { world, link, settings: Settings::at_rate(100.0), host };
    let error = scene.preflight().expect_err("a refusal").to_string();
    // DM_CAN.py, Limit_Param: 8 rad/s of a DM4340, 30 of a DM4310.
    assert!(error.contains("VMAX") && error.contains('8') && error.contains("30"), "{error}");
    assert!(error.contains("means something else by its numbers"), "{error}");
}

#[test]
fn gains_are_not_told_to_an_actuator_that_nobody_says_lets_go() {
    let text = robots::few(CUBEMARS, 2, 100.0).replace("timeout_configured_s = 0.2", "");
    let mut scene = Scene::with_robot(robot(&text, "few"), Options::default());
    let error = scene.preflight().expect_err("a refusal").to_string();
    assert!(error.contains("go on pulling when the host dies"), "{error}");
    assert!(error.contains("timeout_configured_s"), "{error}");
    // One that is shorter than three cycles of 10 ms lets go between two goals.
    let text = robots::few(CUBEMARS, 2, 100.0).replace("= 0.2", "= 0.025");
    let mut scene = Scene::with_robot(robot(&text, "few"), Options::default());
    let error = scene.preflight().expect_err("a refusal").to_string();
    assert!(error.contains("let go between two goals"), "{error}");
}

#[test]
fn a_line_that_goes_bus_off_is_lost_and_the_others_come_to_rest() {
    let off = Fault::BusOff { line: Some("left_leg".into()), at_ns: 3 * SECOND_NS, until_ns: None };
    let options = Options { faults: vec![off], ..Options::default() };
    let mut scene = Scene::with_robot(robot(&robots::mixed(100.0), "mixed"), options);
    let played = scene.play_until(0.5, 8, &|| false);
    let Some(StopReason::LineLost { line, text, joints }) = &played.run.stop else {
        panic!("{:?}", played.run.stop)
    };
    assert!(line == "left_leg" && text.contains("bus off"), "{line}: {text}");
    assert_eq!(joints.len(), 6);
    assert!(scene.link.is_lost(0) && !scene.link.is_lost(1) && !scene.link.is_lost(2));
    let world = scene.world.lock();
    for joint in scene.link.robot().joints.iter().filter(|joint| joint.line != 0) {
        let speed = world.joint_velocity_rad_s(&joint.name).expect("a joint");
        assert!(speed.abs() < 0.05, "{} still turns at {speed} rad/s", joint.name);
    }
}

#[test]
fn a_send_queue_that_stays_full_is_a_lost_line() {
    // Nothing leaves any more from the third second on: twelve goals do not fit into a queue of ten.
    let held =
        Fault::Blocked { line: None, from_ns: 3 * SECOND_NS, until_ns: 20 * SECOND_NS, bytes: 0 };
    let options = Options { faults: vec![held], ..Options::default() };
    let mut scene = Scene::with_robot(robot(&robots::legs(DAMIAO, 200.0), "legs"), options);
    let played = scene.play_until(0.5, 8, &|| false);
    assert!(matches!(played.run.stop, Some(StopReason::LineLost { .. })), "{:?}", played.run.stop);
}

#[test]
fn a_send_queue_that_is_full_for_a_moment_costs_no_more_than_that() {
    // Six actuators: goals and answers take half the line and no more.
    for held_ms in [1, 5, 20] {
        let from_ns = 3 * SECOND_NS;
        let until_ns = from_ns + held_ms * 1_000_000;
        let held = Fault::Blocked { line: None, from_ns, until_ns, bytes: 0 };
        let play = |faults| {
            let options = Options { faults, ..Options::default() };
            let mut scene =
                Scene::with_robot(robot(&robots::few(DAMIAO, 6, 100.0), "few"), options);
            let played = scene.play_until(0.5, 4, &|| false);
            let steps = scene.host.steps();
            (played, steps)
        };
        let (twin, _) = play(Vec::new());
        assert_eq!(twin.run.stop, None);
        assert!(twin.run.bus_load < 0.5, "{} of the line is busy", twin.run.bus_load);
        let (played, _) = play(vec![held]);
        assert_eq!(played.run.stop, None, "held for {held_ms} ms");
        // Whoever waits for the queue does so by the deadline of its cycle: a few cycles are lost.
        let most = 1 + held_ms / 10 + 1;
        assert!(played.run.tally.missed_cycles <= most, "{}", played.run.tally.missed_cycles);
    }
}

#[test]
fn frames_that_are_short_or_foreign_are_passed_over_and_counted() {
    let short = Fault::Statuses {
        of: None,
        from_ns: 2 * SECOND_NS,
        until_ns: 4 * SECOND_NS,
        probability: 0.05,
        damage: Damage::Length { length: 3 },
    };
    let foreign = Fault::Babble {
        line: None,
        frame: gaitway_sim::can::CanFrame::classic(0x456, false, &[1, 2, 3]),
        period_ns: 2_000_000,
        from_ns: 0,
        until_ns: u64::MAX,
    };
    let options = Options { faults: vec![short, foreign], ..Options::default() };
    let mut scene = Scene::with_robot(robot(&robots::few(DAMIAO, 6, 100.0), "few"), options);
    let played = scene.play_until(0.5, 4, &|| false);
    assert_eq!(played.run.stop, None);
    assert_eq!(played.run.tally.missed_cycles, 0, "who was not understood was asked again");
    let stats = scene.link.can_stats(0).expect("a CAN line");
    assert!(stats.foreign > 1000, "{stats:?}");
}

#[test]
fn another_host_on_the_line_is_noticed_before_anybody_is_told_to_let_go() {
    // A CubeMars answers commands only; what it says unasked answers somebody else.
    let answer =
        gaitway_sim::can::CanFrame::classic(0, false, &[1, 0x7F, 0xFF, 0x7F, 0xF7, 0xFF, 0x23, 0]);
    let other = Fault::Babble {
        line: None,
        frame: answer,
        period_ns: 10_000_000,
        from_ns: 0,
        until_ns: u64::MAX,
    };
    let options = Options { faults: vec![other], ..Options::default() };
    let mut scene = Scene::with_robot(robot(&robots::few(CUBEMARS, 2, 100.0), "few"), options);
    let error = scene.preflight().expect_err("a refusal").to_string();
    assert!(error.contains("another program speaks to the actuators"), "{error}");
    assert_eq!(scene.link.can_stats(0).expect("a CAN line").sent, 0, "not a word was said");
}

#[test]
fn a_robot_is_held_and_let_go() {
    for kind in [DAMIAO, CUBEMARS, ROBSTRIDE, ODRIVE, MOTEUS, RECOIL] {
        let mut scene = few(kind, 3, 100.0);
        let found = scene.preflight().expect("a robot that is ready");
        scene::arm(&mut scene.link, &found).expect("torque");
        let driven = |scene: &Scene| {
            let world = scene.world.lock();
            ["joint_1", "joint_2", "joint_3"]
                .map(|joint| world.actuator(joint).expect("an actuator").enabled())
        };
        assert_eq!(driven(&scene), [true; 3], "{}", kind.servo);
        control::watchdog::release(&mut scene.link);
        control::arm::disarm(&mut scene.link).expect("limp");
        assert_eq!(driven(&scene), [false; 3], "{}", kind.servo);
    }
}

#[test]
fn nobody_goes_on_driving_while_another_does_not_confirm_that_he_let_go() {
    let (mut scene, said) = tapped(robot(&robots::few(DAMIAO, 3, 100.0), "few"));
    let found = scene.preflight().expect("a robot that is ready");
    scene::arm(&mut scene.link, &found).expect("torque");
    // What it says comes under an identifier that nobody listens to.
    scene.world.lock().actuator_mut("joint_1").expect("an actuator").set_answer_id(0x7F);
    said.lock().expect("not poisoned").clear();
    let unsure = control::arm::disarm(&mut scene.link).expect_err("no confirmation").to_string();
    assert!(unsure.contains("joint_1") && !unsure.contains("joint_2"), "{unsure}");
    // It is asked for 300 ms. By then the others have long been told.
    let said = said.lock().expect("not poisoned");
    let third_ns = said[2].1 - said[0].1;
    assert!(third_ns < 5_000_000, "the third frame went out {third_ns} ns after the first");
}

#[test]
fn a_robot_left_holding_holds_unless_its_timeout_was_set_by_hand() {
    for (kind, holds) in [(DAMIAO, true), (MOTEUS, true), (CUBEMARS, false)] {
        let mut scene = few(kind, 2, 100.0);
        let played = scene.play_until(0.3, 1, &|| false);
        assert_eq!(played.run.stop, None);
        let told = played.run.notes.iter().any(|note| note.contains("let go 0.2 s after"));
        assert_eq!(told, !holds, "{:?}", played.run.notes);
        let mut world = scene.world.lock();
        let until_ns = world.now_ns() + 5 * SECOND_NS;
        world.run_until(until_ns);
        let driven = world.actuator("joint_1").expect("an actuator").enabled();
        assert_eq!(driven, holds, "{}", kind.servo);
    }
}

/// Runs the command; its report.
fn reported(arguments: &[&str]) -> (Option<i32>, Value) {
    let command = crate::program::gaitway().args(arguments).output();
    let output = command.expect("the command");
    let report = serde_json::from_slice(&output.stdout);
    let words = String::from_utf8_lossy(&output.stderr).into_owned();
    (output.status.code(), report.unwrap_or_else(|e| panic!("{e}: {words}")))
}

/// A robot file of this name in a folder of its own.
fn written(name: &str, text: &str) -> String {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("can_robot");
    std::fs::create_dir_all(&folder).expect("a temporary folder");
    let path = folder.join(format!("{name}.toml"));
    // Tests run side by side: whoever reads finds the whole file.
    let own = folder.join(format!("{name}-{:?}", std::thread::current().id()));
    std::fs::write(&own, text).expect("written");
    std::fs::rename(&own, &path).expect("renamed");
    path.display().to_string()
}

#[test]
fn an_action_plays_on_a_robot_of_twelve_can_actuators_at_200_hz() {
    let robot = written("berkeley-legs", &robots::berkeley_legs());
    let common = ["play", "squat", "--robot", &robot, "--bus", "sim", "--json", "-q"];
    let (code, report) = reported(&common);
    assert_eq!((code, &report["outcome"]), (Some(0), &Value::from("done")), "{report:#}");
    assert_eq!(report["cycle_hz"], 200.0);
    assert_eq!(report["referee"]["violations"], serde_json::json!([]));
    for figure in ["missed_cycles", "late_cycles", "max_end_velocity_rad_s"] {
        assert_eq!(report[figure].as_f64(), Some(0.0), "{figure}");
    }
    // Twelve goals and twelve answers of 135 bits, and a question for a slow fact, 85 bits with its
    // three bytes, with an answer that is reckoned with eight: 3.46 ms of 5, and 289 Hz.
    let number = |report: &Value, key: &str| report[key].as_f64().expect("a number");
    assert!((number(&report, "wire_limit_hz") - 1e6 / 3460.0).abs() < 0.1, "{report:#}");
    // The true answer has four bytes, and 95 bits.
    let load = number(&report, "bus_load");
    assert!((load - 3420.0 * 200e-6).abs() < 0.01, "{load}");
    let knee = report["joints"]
        .as_array()
        .expect("joints")
        .iter()
        .find(|joint| joint["name"].as_str().is_some_and(|name| name == "left_knee_pitch"));
    let range = &knee.expect("a knee")["range_rad"];
    let moved = range[1].as_f64().zip(range[0].as_f64()).map(|(high, low)| high - low);
    assert!(moved.expect("measured") > 1.0, "a squat bends the knees: {range}");
    // A dry run knows the line as well.
    let (code, dry) = reported(&[&common[..], &["--dry-run"]].concat());
    assert_eq!((code, number(&dry, "wire_limit_hz")), (Some(0), number(&report, "wire_limit_hz")));
    assert!((number(&dry, "bus_load") - 3460.0 * 200e-6).abs() < 0.001, "{dry:#}");
}

#[test]
fn a_mixed_robot_is_held_monitored_and_let_go_by_command() {
    let robot = written("mixed", &robots::mixed(100.0));
    let on = ["--bus", "sim", "--json", "-q"];
    let (code, report) = reported(&[&["hold", &robot][..], &on].concat());
    assert_eq!(code, Some(0), "{report:#}");
    assert_eq!(report["joints"].as_array().map(Vec::len), Some(18));
    let (code, report) = reported(&[&["monitor", &robot][..], &on].concat());
    assert_eq!(code, Some(0));
    let joints = report["joints"].as_array().expect("joints");
    assert!(joints.iter().all(|joint| joint["error"].is_null()), "{report:#}");
    assert!(joints.iter().all(|joint| joint["torque_on"] == false), "{report:#}");
    let (code, report) = reported(&[&["limp", &robot, "--yes"][..], &on].concat());
    assert_eq!((code, &report["outcome"]), (Some(0), &Value::from("done")));
}

#[test]
fn a_bus_of_the_wrong_kind_is_refused() {
    let robot = written("mixed", &robots::mixed(100.0));
    let buses = [
        ["--bus", "left_leg=serial:/dev/x"],
        ["--bus", "right_leg=can:can0"],
        ["--bus", "arms=can:can1"],
    ];
    let command = crate::program::gaitway()
        .args(["hold", &robot])
        .args(buses.concat())
        .output()
        .expect("the command");
    let words = String::from_utf8_lossy(&command.stderr).into_owned();
    assert_ne!(command.status.code(), Some(0));
    for expected in ["another kind than the bus", "left_leg", "serial:/dev/x", "can:can0"] {
        assert!(words.contains(expected), "{expected:?} is missing in:\n{words}");
    }
}
