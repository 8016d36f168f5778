//! The host dies, or loses a line.

use super::scene::{
    Host, Played, Samples, Scene, assert_clean, excuse_unreached, op3_on_two_lines,
};
use super::{MID_NS, SWING_RAD};
use gaitway::control::{self, Sample, Sink, StopReason};
use gaitway_sim::{Options, Rule};
use std::sync::Arc;
use std::sync::atomic::Ordering;

const WATCHDOG: &str = "Bus Watchdog";
/// What the register reads once it has bitten.
const BITTEN: i64 = 255;

/// The host is killed in this cycle: not a word of it is heard any more.
struct KilledIn(u64, Arc<Host>);

impl Sink for KilledIn {
    fn take(&mut self, sample: &Sample<'_>) {
        if sample.cycle == self.0 {
            self.1.cut.store(true, Ordering::Relaxed);
        }
    }
}

/// Plays until the host is killed in `cycle`.
fn kill_in(scene: &mut Scene, cycle: u64) {
    let found = scene.preflight().expect("a robot that is ready");
    let trajectory = scene.swing(&found.start_rad, 0.5, 2);
    let armed = super::scene::arm(&mut scene.link, &found).expect("torque");
    let (link, settings) = (&mut scene.link, scene.settings);
    let mut sink = KilledIn(cycle, Arc::clone(&scene.host));
    let run = control::run(link, armed, &trajectory, settings, &mut sink, &|| false)
        .expect("its own joints");
    assert_eq!(run.tally.cycles, cycle + 1, "it outlived cycle {cycle}");
    // The next host opens the line anew.
    scene.reopen();
}

fn wait_ms(scene: &Scene, millis: u64) {
    let mut world = scene.world.lock();
    let until_ns = world.now_ns() + millis * 1_000_000;
    world.run_until(until_ns);
}

fn fastest_rad_s(scene: &Scene) -> f64 {
    let world = scene.world.lock();
    let speed = |joint: &String| world.joint_velocity_rad_s(joint).expect("a joint").abs();
    world.joint_names().iter().map(speed).fold(0.0, f64::max)
}

fn watchdogs(scene: &Scene) -> Vec<i64> {
    let world = scene.world.lock();
    world.joint_names().iter().map(|joint| world.register(joint, WATCHDOG).expect("one")).collect()
}

#[test]
fn x27_servos_stop_by_themselves_when_their_host_is_killed() {
    for cycle in (0..50).map(|k| 4 * k) {
        let mut scene = Scene::op3();
        kill_in(&mut scene, cycle);
        let at = |scene: &Scene, joint: &String| {
            let world = scene.world.lock();
            let goal = world.register(joint, "Goal Position").expect("a goal");
            (world.joint_position_rad(joint).expect("a joint"), goal)
        };
        let joints = scene.link.robot().joint_names();
        let killed: Vec<_> = joints.iter().map(|joint| at(&scene, joint)).collect();
        wait_ms(&scene, 190);
        assert_eq!(watchdogs(&scene), [10; 20], "bitten too early, killed in cycle {cycle}");
        wait_ms(&scene, 60);
        assert_eq!(watchdogs(&scene), [BITTEN; 20], "not bitten, killed in cycle {cycle}");
        wait_ms(&scene, 250);
        let speed = fastest_rad_s(&scene);
        assert!(speed < 0.05, "{speed} rad/s half a second after the kill in cycle {cycle}");
        for (index, joint) in joints.iter().enumerate() {
            let (from_rad, goal) = killed[index];
            let (to_rad, last_goal) = at(&scene, joint);
            assert_eq!(goal, last_goal, "{joint}: a goal after the kill");
            let of = &scene.link.robot().joints[index];
            let register = of.register(gaitway_profiles::Role::GoalPosition).expect("one");
            // OP3's joints turn as their servos do.
            let goal_rad = of.model().expect("a servo").si_from_raw(register, goal);
            let (low, high) = (from_rad.min(goal_rad) - 0.05, from_rad.max(goal_rad) + 0.05);
            assert!(to_rad >= low && to_rad <= high, "{joint}: {to_rad} not in {low}..{high}");
        }
    }
}

#[test]
fn x27_the_next_start_clears_what_the_last_host_left_behind() {
    for pause_ms in [20, 300] {
        let mut scene = Scene::op3();
        kill_in(&mut scene, 60);
        wait_ms(&scene, pause_ms);
        let found = scene.preflight().expect("a robot that is ready");
        let said = found.notes.iter().filter(|note| note.contains("bus watchdog")).count();
        assert_eq!(said, 20, "{:?}", found.notes);
        let Played { run, verdict, .. } = scene.play_until(SWING_RAD, 1, &|| false);
        assert_eq!(run.stop, None, "{pause_ms} ms after the kill");
        let rules: Vec<Rule> = verdict.violations.iter().map(|v| v.rule).collect();
        assert_eq!(rules, [], "{:?}", verdict.violations);
        assert_eq!(watchdogs(&scene), [0; 20]);
    }
}

#[test]
fn a_robot_that_is_left_holding_holds_without_a_host() {
    let mut scene = Scene::op3();
    let played = scene.play_until(SWING_RAD, 1, &|| false);
    assert_eq!(played.run.stop, None);
    assert!(played.run.notes[0].contains("20 servos would have stopped"), "{:?}", played.run.notes);
    wait_ms(&scene, 5_000);
    assert_eq!(watchdogs(&scene), [0; 20]);
    for joint in scene.link.robot().joint_names() {
        assert_eq!(scene.world.lock().register(&joint, "Torque Enable"), Some(1), "{joint}");
    }
}

#[test]
fn a_pause_between_torque_and_the_first_cycle_is_a_stall() {
    for (pause_ms, stalled) in [(50, false), (300, true)] {
        let mut scene = Scene::op3();
        let found = scene.preflight().expect("a robot that is ready");
        let trajectory = scene.swing(&found.start_rad, SWING_RAD, 1);
        let armed = super::scene::arm(&mut scene.link, &found).expect("torque");
        wait_ms(&scene, pause_ms);
        let mut samples = Samples::default();
        let settings = scene.settings;
        let run =
            control::run(&mut scene.link, armed, &trajectory, settings, &mut samples, &|| false)
                .expect("its own joints");
        assert_eq!(matches!(run.stop, Some(StopReason::Stalled { .. })), stalled, "{:?}", run.stop);
        assert_clean(&scene.world.lock().verdict());
    }
}

#[test]
fn h18_the_other_lines_come_to_rest_when_one_is_lost() {
    // Twin: nothing is cut.
    let whole = Scene::with_robot(op3_on_two_lines(), Options::default()).play(0.5, 3);
    assert_eq!(whole.run.stop, None);
    assert_clean(&whole.verdict);
    for cut_line in [0, 1] {
        for at_ns in (0..10).map(|k| MID_NS + 1_111_111 * k) {
            let cut = Some((cut_line, at_ns));
            let mut scene = Scene::with_cut(op3_on_two_lines(), Options::default(), cut);
            let mut played = scene.play_until(0.5, 3, &|| false);
            let Some(StopReason::LineLost { line, joints, .. }) = &played.run.stop else {
                panic!("{:?}", played.run.stop);
            };
            assert_eq!(line, ["body", "legs"][cut_line]);
            assert_eq!(joints.len(), [8, 12][cut_line], "{joints:?}");
            // The joints on the lost line never hear their last goals; all others do.
            let unreached = joints.len() as u64;
            let excused = excuse_unreached(&mut played.verdict, joints);
            assert_eq!(excused, [unreached; 2]);
            assert_clean(&played.verdict);
            // They stop by themselves; the others are led to rest and told to hold.
            wait_ms(&scene, 300);
            assert!(fastest_rad_s(&scene) < 0.05);
            for (joint, watchdog) in scene.link.robot().joints.iter().zip(watchdogs(&scene)) {
                let expected = if joint.line == cut_line { BITTEN } else { 0 };
                assert_eq!(watchdog, expected, "{}", joint.name);
            }
            // T_stop = 1.6 max(v/a) + 2 T after the cut, and half a second to settle.
            let cycles = played.samples.0.len() as f64;
            assert!(cycles < 50.0 + 100.0 * (1.6 * 0.2 + 0.5) + 250.0, "{cycles} cycles");
        }
    }
}

#[test]
fn h18_the_only_line_lost_ends_the_motion_at_once() {
    let robot = gaitway::robot::Robot::load("op3").expect("a shipped robot");
    let mut scene = Scene::with_cut(robot, Options::default(), Some((0, MID_NS)));
    let played = scene.play_until(0.5, 3, &|| false);
    assert!(matches!(played.run.stop, Some(StopReason::LineLost { .. })), "{:?}", played.run.stop);
    let now_ns = scene.world.lock().now_ns();
    assert!(now_ns < MID_NS + 10_000_000, "it went on for {} ns", now_ns - MID_NS);
}

/// A swing on a robot one of whose lines is cut: how often the host did something with a port or its
/// clock in the motion, and after the last cycle before the cut; and how many cycles there were.
fn steps_of(robot: gaitway::robot::Robot, cut: Option<(usize, u64)>) -> (u64, u64, u64) {
    let mut scene = Scene::with_cut(robot, Options::default(), cut);
    let found = scene.preflight().expect("a robot that is ready");
    let trajectory = scene.swing(&found.start_rad, 0.5, 3);
    let armed = super::scene::arm(&mut scene.link, &found).expect("torque");
    let begun = scene.host.steps();
    let mut seen = StepsBefore { host: Arc::clone(&scene.host), steps: 0 };
    let settings = scene.settings;
    let run = control::run(&mut scene.link, armed, &trajectory, settings, &mut seen, &|| false)
        .expect("its own joints");
    assert_eq!(run.stop.is_some(), cut.is_some());
    let steps = scene.host.steps();
    (steps - begun, steps - seen.steps, run.tally.cycles)
}

/// Steps of the host until the last cycle before the cut.
struct StepsBefore {
    host: Arc<Host>,
    steps: u64,
}

impl Sink for StepsBefore {
    fn take(&mut self, sample: &Sample<'_>) {
        if sample.at.as_nanos() < MID_NS {
            self.steps = self.host.steps();
        }
    }
}

#[test]
fn h18_nobody_spins_on_a_line_that_is_gone() {
    /// Steps of looking how a robot is left, and of the try that failed.
    const ONCE: u64 = 100;
    let (twin, _, twin_cycles) = steps_of(op3_on_two_lines(), None);
    for line in [0, 1] {
        // A cycle on one line has no more steps than one on two.
        let (steps, _, cycles) = steps_of(op3_on_two_lines(), Some((line, MID_NS)));
        let most = twin * cycles / twin_cycles + ONCE;
        assert!(steps <= most, "line {line}: {steps} steps in {cycles} cycles, at most {most}");
    }
    // The only line: a handful of tries, and no cycle more.
    let robot = gaitway::robot::Robot::load("op3").expect("a shipped robot");
    let (_, after, _) = steps_of(robot, Some((0, MID_NS)));
    assert!(after < 60, "{after} steps on a line that is gone");
}

#[test]
fn x27_the_goal_of_a_killed_host_is_within_the_bound_on_every_robot() {
    let mut cases = 0;
    for robot in super::ROBOTS {
        for cycle in (0..50).map(|k| 2 * k) {
            let mut scene = Scene::of(robot, Options::default());
            let found = scene.preflight().expect("a robot that is ready");
            // As fast as the joints may: where goals lead their joints the most.
            let trajectory = scene.swing(&found.start_rad, 1.5, 2);
            let armed = super::scene::arm(&mut scene.link, &found).expect("torque");
            let (link, settings) = (&mut scene.link, scene.settings);
            let mut sink = KilledIn(cycle, Arc::clone(&scene.host));
            control::run(link, armed, &trajectory, settings, &mut sink, &|| false)
                .expect("its own joints");
            let at_kill: Vec<f64> = positions(&scene);
            wait_ms(&scene, 3_000);
            assert!(fastest_rad_s(&scene) < 0.05, "{robot}, killed in cycle {cycle}: not at rest");
            for (joint, (from, to)) in at_kill.iter().zip(positions(&scene)).enumerate() {
                // 0.35 rad, and what an encoder and the weight of the rest may add.
                let moved_rad = (to - from).abs();
                let what = format!("{robot}, cycle {cycle}, joint {joint}");
                assert!(moved_rad <= 0.35 + 0.01, "{what}: it went on for {moved_rad} rad");
            }
            cases += 1;
        }
    }
    super::forty::ran("x27_the_goal_of_a_killed_host_is_within_the_bound_on_every_robot", cases);
}

fn positions(scene: &Scene) -> Vec<f64> {
    let world = scene.world.lock();
    let at = |joint: &String| world.joint_position_rad(joint).expect("a joint");
    world.joint_names().iter().map(at).collect()
}

#[test]
fn c24_nothing_that_moves_a_joint_can_read_the_wall_clock() {
    // What a wall clock that jumps cannot reach: every room between a motion and the line. Their only
    // clock is the port's, which counts from when the machine was started.
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let rooms = ["control", "guard", "motion", "robot", "bus", "wire", "device", "time", "port"];
    let mut files = Vec::new();
    for room in rooms {
        files.push(root.join(format!("{room}.rs")));
        let Ok(folder) = std::fs::read_dir(root.join(room)) else { continue };
        files.extend(folder.map(|entry| entry.expect("an entry").path()));
    }
    let mut read = 0;
    // The door of a virtual line to an interface of the system belongs to the virtual robot.
    let door = |file: &&std::path::PathBuf| !file.ends_with("port/can_bridge.rs");
    let is_source = |file: &&std::path::PathBuf| file.extension().is_some_and(|end| end == "rs");
    for file in files.iter().filter(is_source).filter(door) {
        let text = std::fs::read_to_string(file).expect("a source");
        let text = text.split("#[cfg(test)]").next().unwrap_or_default();
        for word in ["SystemTime", "ClockId::Realtime", "UNIX_EPOCH", "std::time::Instant"] {
            assert!(!text.contains(word), "{} reads another clock: {word}", file.display());
        }
        read += 1;
    }
    assert!(read > 60, "only {read} files");
}
