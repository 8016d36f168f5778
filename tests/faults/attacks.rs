//! What broke an earlier version from outside: each scene beside a twin that ends done.

use super::scene::{Scene, Stall, arm, assert_clean, assert_excused, is_excused};
use super::sent::{Told, goal_rad};
use super::{MID_NS, ROBOTS, SWING_RAD, first_joint};
use gaitway::control::{self, Exception, Sample, Sink, StopReason};
use gaitway::guard::Guard;
use gaitway::port::sim::SharedWorld;
use gaitway::robot::Joint;
use gaitway_profiles::Role;
use gaitway_sim::{Damage, Fault, Options, Rule};
use std::cell::Cell;
use std::sync::Arc;
use std::sync::atomic::Ordering;

/// The tracking bound, rad.
const BOUND_RAD: f64 = 0.35;
/// What encoders and rounding add to it, rad.
const COUNTS_RAD: f64 = 0.01;

/// Largest distance between the goal in a joint's servo and where the joint is, cycle by cycle.
struct Farthest {
    world: SharedWorld,
    joint: String,
    of: Joint,
    farthest_rad: f64,
    /// When the host is killed, ns.
    cut_at: Option<(u64, Arc<super::scene::Host>)>,
}

impl Farthest {
    fn of(scene: &Scene, joint: &str) -> Self {
        let of = scene.link.robot().joints.iter().find(|of| of.name == joint).expect("a joint");
        Self {
            world: scene.world.clone(),
            joint: joint.to_owned(),
            of: of.clone(),
            farthest_rad: 0.0,
            cut_at: None,
        }
    }

    fn now_rad(&self) -> f64 {
        let world = self.world.lock();
        let register = self.of.register(Role::GoalPosition).expect("a goal");
        let goal = world.register(&self.joint, &register.name).expect("a goal");
        (goal_rad(&self.of, goal) - world.joint_position_rad(&self.joint).expect("a joint")).abs()
    }

    fn look(&mut self) {
        self.farthest_rad = self.farthest_rad.max(self.now_rad());
    }
}

impl Sink for Farthest {
    fn take(&mut self, sample: &Sample<'_>) {
        self.look();
        if let Some((at_ns, host)) = &self.cut_at
            && sample.at.as_nanos() >= *at_ns
        {
            host.cut.store(true, Ordering::Relaxed);
        }
    }
}

fn blocked(joint: &str, until_ns: u64) -> Fault {
    Fault::StuckPosition { joint: joint.to_owned(), from_ns: MID_NS, until_ns }
}

fn run_for(scene: &Scene, millis: u64) {
    let mut world = scene.world.lock();
    let until_ns = world.now_ns() + millis * 1_000_000;
    world.run_until(until_ns);
}

#[test]
fn the_goal_of_a_blocked_joint_stays_within_the_bound_in_the_motion_the_ramp_and_after_it() {
    for robot in ROBOTS {
        let joint = first_joint(robot);
        for swing_rad in [0.9, 1.2, 1.5] {
            let mut scene = Scene::with_faults(robot, vec![blocked(&joint, u64::MAX)]);
            let found = scene.preflight().expect("a robot that is ready");
            let trajectory = scene.swing(&found.start_rad, swing_rad, 8);
            let armed = arm(&mut scene.link, &found).expect("torque");
            let mut seen = Farthest::of(&scene, &joint);
            let settings = scene.settings;
            let run =
                control::run(&mut scene.link, armed, &trajectory, settings, &mut seen, &|| false)
                    .expect("its own joints");
            seen.look();
            let what = format!("{robot}, swing of {swing_rad} rad: {:?}", run.stop);
            assert!(seen.farthest_rad <= BOUND_RAD + COUNTS_RAD, "{what}: {}", seen.farthest_rad);
            let named = matches!(&run.stop, Some(
                StopReason::NotFollowing { joint: named, .. }
                | StopReason::ServoFault { joint: named, .. }) if *named == joint);
            assert!(named, "{what}");
            assert!(seen.farthest_rad > 0.2, "{what}: it was never far: {}", seen.farthest_rad);
        }
    }
}

/// How long after a joint was blocked its host is killed, ms; or that it is not.
pub(super) fn kills() -> impl Iterator<Item = Option<u64>> {
    (0..14).map(|k| Some(50 * k)).chain([None])
}

/// What became of a joint that was blocked for a while, as a person's hand would, rad: how far its goal
/// was from it at most, and at the end, and how far it turned when it was let go, with no host.
pub(super) struct Freed {
    pub farthest_rad: f64,
    pub left_rad: f64,
    pub turned_rad: f64,
    /// The host was killed before it had stopped by itself.
    pub killed: bool,
}

pub(super) fn blocked_and_freed(robot: &str, killed_after_ms: Option<u64>) -> Freed {
    let joint = first_joint(robot);
    // A servo of OP3 lets go by itself when it is overloaded for longer.
    let let_go_ns = MID_NS + if robot == "op3" { 1_000_000_000 } else { 1_900_000_000 };
    let mut scene = Scene::with_faults(robot, vec![blocked(&joint, let_go_ns)]);
    let found = scene.preflight().expect("a robot that is ready");
    let trajectory = scene.swing(&found.start_rad, 1.2, 8);
    let armed = arm(&mut scene.link, &found).expect("torque");
    let mut seen = Farthest::of(&scene, &joint);
    seen.cut_at = killed_after_ms.map(|ms| (MID_NS + ms * 1_000_000, Arc::clone(&scene.host)));
    let settings = scene.settings;
    control::run(&mut scene.link, armed, &trajectory, settings, &mut seen, &|| false)
        .expect("its own joints");
    let at_rad = |scene: &Scene| scene.world.lock().joint_position_rad(&joint).expect("one");
    let blocked_at_rad = at_rad(&scene);
    seen.look();
    let left_rad = seen.now_rad();
    let now_ns = scene.world.lock().now_ns();
    assert!(now_ns < let_go_ns, "{robot}, {killed_after_ms:?}: let go first");
    run_for(&scene, 4_000);
    let turned_rad = (at_rad(&scene) - blocked_at_rad).abs();
    let killed = scene.host.cut.load(Ordering::Relaxed);
    Freed { farthest_rad: seen.farthest_rad, left_rad, turned_rad, killed }
}

#[test]
fn a_blocked_joint_that_is_freed_later_turns_no_further_than_the_bound_with_no_host() {
    for robot in ["open-duck-mini-v2", "op3"] {
        let mut killed = 0;
        for killed_after_ms in kills() {
            let freed = blocked_and_freed(robot, killed_after_ms);
            let turned_rad = freed.turned_rad;
            assert!(
                turned_rad <= BOUND_RAD + COUNTS_RAD,
                "{robot}, killed after {killed_after_ms:?} ms: freed, it turned {turned_rad} rad by \
                 itself"
            );
            killed += usize::from(freed.killed && freed.farthest_rad > 0.2);
        }
        assert!(killed > 5, "{robot}: killed {killed} times with its goal ahead of the joint");
    }
}

#[test]
fn a_joint_that_is_held_up_for_a_moment_catches_up_and_the_motion_ends_done() {
    for robot in ROBOTS {
        let joint = first_joint(robot);
        let mut scene = Scene::with_faults(robot, vec![blocked(&joint, MID_NS + 200_000_000)]);
        let played = scene.play_until(0.5, 4, &|| false);
        assert_eq!(played.run.stop, None, "{robot}");
        assert_clean(&played.verdict);
        let last = played.samples.0.last().expect("samples");
        for (end, present) in played.trajectory.end_rad().iter().zip(last) {
            let off = (end - present.expect("a last read")).abs();
            assert!(off < 0.03, "{robot}: {off} rad from its goal at the end");
        }
    }
}

/// Torque comes on in this scene after a stall at `step` of arming, in which `joint` was turned.
/// Arming's own word on it.
pub(super) fn armed_with_a_stall(
    robot: &str,
    at: Option<u64>,
    lasts_ms: u64,
    by_rad: f64,
) -> (Scene, String) {
    let mut scene = Scene::of(robot, Options::default());
    let found = scene.preflight().expect("a robot that is ready");
    scene.host.keep_sent();
    let begun = scene.host.steps();
    if let Some(step) = at {
        let turned = Some((first_joint(robot), by_rad));
        let (step, lasts_ns) = (begun + step, lasts_ms * 1_000_000);
        scene.host.stall(Stall { step, lasts_ns, turned });
    }
    let armed = arm(&mut scene.link, &found);
    let said = armed.map_or_else(|error| error.to_string(), |_| "armed".to_owned());
    (scene, said)
}

#[test]
fn a_stall_at_any_step_of_arming_never_lets_torque_move_a_joint_that_was_turned_meanwhile() {
    for robot in ["op3", "open-duck-mini-v2", "mixed"] {
        let (twin, said) = armed_with_a_stall(robot, None, 0, 0.0);
        assert_eq!(said, "armed");
        let steps = twin.host.steps();
        assert_clean_before_goals(&twin);
        let (mut found_by_the_clock, mut refused) = (0, 0);
        for (step, lasts_ms) in (0..steps).flat_map(|step| [60, 3_000].map(|ms| (step, ms))) {
            let (scene, said) = armed_with_a_stall(robot, Some(step), lasts_ms, 0.31);
            if scene.host.stalled() == 0 {
                continue;
            }
            let what = format!("{robot}, {lasts_ms} ms before step {step}: {said}");
            let verdict = scene.world.lock().verdict();
            let torque_far = verdict.violations.iter().any(|v| v.rule == Rule::TorqueOn);
            let torque = |joint: &String| scene.world.lock().register(joint, "Torque Enable");
            let joints = scene.link.robot().joint_names();
            let on = joints.iter().filter(|joint| torque(joint) == Some(1)).count();
            if torque_far {
                // After the last look nobody can prevent it; it is seen, and undone.
                assert!(said.contains("the host stalled as torque came on"), "{what}");
                found_by_the_clock += 1;
            }
            refused += usize::from(said != "armed");
            if said == "armed" {
                assert_eq!(on, joints.len(), "{what}");
            } else {
                assert_eq!(on, 0, "{what}");
            }
        }
        println!("{robot}: {refused} refused, {found_by_the_clock} found by the clock");
        assert!(refused > 0, "{robot}: no stall was ever noticed");
        assert!(found_by_the_clock > 0, "{robot}: no stall came after the last look");
    }
}

fn assert_clean_before_goals(scene: &Scene) {
    let verdict = scene.world.lock().verdict();
    let seen: Vec<String> = verdict.violations.iter().map(ToString::to_string).collect();
    assert!(seen.is_empty(), "{}", seen.join("\n"));
}

/// Arming, after so many looks of which somebody asks to stop; of a robot that was limp, or held.
/// Whether it came to its end, and how many looks there were.
pub(super) fn armed_until(robot: &str, held: bool, asked_after: u64) -> (Scene, bool, u64) {
    let mut scene = Scene::of(robot, Options::default());
    if held {
        let found = scene.preflight().expect("a robot that is ready");
        arm(&mut scene.link, &found).expect("torque");
        control::left::leave(&mut scene.link);
    }
    let found = scene.preflight().expect("a robot that is ready");
    let looks = Cell::new(0);
    let asked = || {
        looks.set(looks.get() + 1);
        looks.get() > asked_after
    };
    scene.host.keep_sent();
    let armed = control::arm::arm(&mut scene.link, &found, &asked).expect("no failure");
    (scene, matches!(armed, control::Arming::Done(_)), looks.get())
}

#[test]
fn a_wish_to_stop_at_any_step_of_arming_leaves_a_limp_robot_limp_and_a_held_one_held() {
    for robot in ROBOTS {
        for held in [false, true] {
            let (_, armed, looks) = armed_until(robot, held, u64::MAX);
            assert!(armed && looks > 20, "{robot}: {looks} looks");
            for after in 0..looks {
                let (scene, armed, _) = armed_until(robot, held, after);
                assert!(!armed, "{robot}: look {after} of {looks} changed nothing");
                for joint in scene.link.robot().joint_names() {
                    let world = scene.world.lock();
                    let torque = world.register(&joint, "Torque Enable");
                    assert_eq!(torque, Some(i64::from(held)), "{robot}, look {after}: {joint}");
                    let watchdog = world.register(&joint, "Bus Watchdog");
                    assert!(watchdog.unwrap_or(0) == 0, "{robot}, look {after}: {joint} watches");
                }
            }
        }
    }
}

pub(super) fn window(of: Option<&str>, from_ms: u64, lasts_ms: u64, damage: Damage) -> Fault {
    let from_ns = MID_NS + from_ms * 1_000_000;
    let until_ns = from_ns.saturating_add(lasts_ms.saturating_mul(1_000_000));
    Fault::Statuses { of: of.map(str::to_owned), from_ns, until_ns, probability: 1.0, damage }
}

#[test]
fn a_silent_servo_and_a_lost_cycle_still_end_at_rest() {
    for robot in ROBOTS {
        let joint = first_joint(robot);
        let silent = |until_ns| Fault::Silent { joint: joint.clone(), from_ns: MID_NS, until_ns };
        for lost_ms in [20, 40, 80] {
            for from_ms in [60, 90, 120, 180, 240, 300] {
                let faults = vec![silent(u64::MAX), window(None, from_ms, lost_ms, Damage::Mute)];
                let mut scene = Scene::with_faults(robot, faults);
                let mut played = scene.play_until(0.5, 4, &|| false);
                let what = format!("{robot}, {lost_ms} ms lost after {from_ms} ms");
                assert!(matches!(played.run.stop, Some(StopReason::Silent { .. })), "{what}");
                // Deaf as well as mute, the servo cannot hear its last goals.
                played.verdict.excuse(|v| v.joint.as_ref() == Some(&joint));
                assert_clean(&played.verdict);
                for other in scene.link.robot().joint_names() {
                    let watchdog = scene.world.lock().register(&other, "Bus Watchdog");
                    assert!(other == joint || watchdog.unwrap_or(0) == 0, "{what}: {other}");
                }
                let said = played.run.notes.join("\n");
                assert!(said.contains(&joint), "{what}: nothing is said of {joint}:\n{said}");
            }
        }
    }
}

#[test]
fn answers_lost_while_goals_still_arrive_end_in_a_ramp_that_is_said_to_be_blind() {
    for robot in ROBOTS {
        let mut scene = Scene::with_faults(robot, vec![window(None, 0, u64::MAX, Damage::Mute)]);
        let played = scene.play_until(0.5, 4, &|| false);
        assert!(matches!(played.run.stop, Some(StopReason::Silent { .. })), "{robot}");
        let wakes = scene
            .link
            .robot()
            .joints
            .iter()
            .any(|joint| joint.model().is_ok_and(|model| model.goal_switches_torque_on()));
        // The servos heard every word: no rule is broken, and they stand. Where a goal might wake
        // who is limp none is sent blindly.
        assert_excused(&played, &scene.link);
        assert!(wakes || played.verdict.is_clean(), "{robot}");
        let blind = played.run.exceptions.iter().find_map(|exception| match exception {
            Exception::BlindRamp { blind_s, most_s, rested } => Some((*blind_s, *most_s, *rested)),
            _ => None,
        });
        let (blind_s, most_s, rested) = blind.unwrap_or_else(|| panic!("{robot}: not said"));
        let period_s = scene.settings.period.as_secs_f64();
        assert!(
            rested != wakes && blind_s <= most_s + 2.0 * period_s,
            "{robot}: {blind_s} s of {most_s} s"
        );
        let said = played.run.notes.join("\n");
        assert!(said.contains("run down blindly"), "{robot}:\n{said}");
        assert!(!said.contains("torque stays on"), "{robot}: said, but not read back:\n{said}");
        if robot == "op3" {
            assert!(said.contains("bus watchdog may still be on in r_sho_pitch"), "{said}");
        }
    }
}

#[test]
fn answers_that_are_only_late_for_a_moment_end_at_rest() {
    for robot in ROBOTS {
        for late_ms in [40, 90, 120, 200] {
            let damage = Damage::StaleReply { by_ns: late_ms * 1_000_000 };
            let mut scene = Scene::with_faults(robot, vec![window(None, 0, late_ms, damage)]);
            let played = scene.play_until(0.5, 4, &|| false);
            assert_clean(&played.verdict);
            assert_excused(&played, &scene.link);
        }
    }
}

/// Goals written to the servos of a scene whose host stands still before one step of a motion.
pub(super) fn stalled_motion(robot: &str, at: Option<(u64, u64)>) -> (Scene, control::Run, u64) {
    let mut scene = Scene::of(robot, Options::default());
    let found = scene.preflight().expect("a robot that is ready");
    let trajectory = scene.swing(&found.start_rad, 1.0, 2);
    scene.host.keep_sent();
    let armed = arm(&mut scene.link, &found).expect("torque");
    let begun = scene.host.steps();
    if let Some((step, lasts_ms)) = at {
        let lasts_ns = lasts_ms * 1_000_000;
        scene.host.stall(Stall { step: begun + step, lasts_ns, turned: None });
    }
    let mut samples = super::scene::Samples::default();
    let settings = scene.settings;
    let run = control::run(&mut scene.link, armed, &trajectory, settings, &mut samples, &|| false)
        .expect("its own joints");
    let steps = scene.host.steps() - begun;
    (scene, run, steps)
}

#[test]
fn a_stall_at_any_step_of_a_cycle_is_no_jump() {
    for robot in ["op3", "open-duck-mini-v2"] {
        let (twin, run, steps) = stalled_motion(robot, None);
        assert_eq!(run.stop, None);
        assert_clean(&twin.world.lock().verdict());
        let middle = steps / 4;
        let mut stopped = 0;
        for (step, lasts_ms) in (middle..middle + 24)
            .flat_map(|step| [20, 60, 95, 150, 250, 1_000].map(|ms| (step, ms)))
        {
            let (scene, run, _) = stalled_motion(robot, Some((step, lasts_ms)));
            let what = format!("{robot}, {lasts_ms} ms before step {step}: {:?}", run.stop);
            assert!(scene.host.stalled() > 0, "{what}");
            let long = lasts_ms > 100;
            let stalled = matches!(run.stop, Some(StopReason::Stalled { .. }));
            assert!(stalled || !long, "{what}");
            stopped += usize::from(stalled);
            // What was on its way when the host stood still was heard late, or not obeyed any more.
            let mut verdict = scene.world.lock().verdict();
            verdict.excuse(|violation| is_excused(violation, &run, &scene.link));
            assert_clean(&verdict);
        }
        assert!(stopped > 24 * 3, "{robot}: {stopped} stalls stopped the motion");
    }
}

/// What a start does with servos that their watchdogs have stopped.
pub(super) struct Started {
    /// Servos that were stopped.
    pub stopped: usize,
    /// How far the old goal of one was from its joint before, rad.
    pub goal_off_rad: f64,
    /// Times a watchdog was cleared, times goals were the next word, and how long after, ms.
    pub cleared: usize,
    pub goals_next: usize,
    pub within_ms: f64,
    /// The highest speed limit that a servo had when it was cleared, in steps of its register.
    pub speed: i64,
    /// How far any joint turned meanwhile, rad.
    pub turned_rad: f64,
}

/// A joint of OP3 is blocked, its host killed while its goal is ahead, and the robot started again
/// once its watchdogs have bitten and the joint is free.
pub(super) fn killed_and_started_again() -> Started {
    let joint = first_joint("op3");
    let mut scene = Scene::with_faults("op3", vec![blocked(&joint, MID_NS + 1_900_000_000)]);
    let found = scene.preflight().expect("a robot that is ready");
    let trajectory = scene.swing(&found.start_rad, 1.2, 8);
    let armed = arm(&mut scene.link, &found).expect("torque");
    let mut seen = Farthest::of(&scene, &joint);
    seen.cut_at = Some((MID_NS + 250_000_000, Arc::clone(&scene.host)));
    let settings = scene.settings;
    control::run(&mut scene.link, armed, &trajectory, settings, &mut seen, &|| false)
        .expect("its own joints");
    run_for(&scene, 2_000);
    scene.reopen();
    let found = scene.preflight().expect("a robot that is ready");
    let goal_off_rad = seen.now_rad();
    let joints = scene.link.robot().joint_names();
    let positions = |scene: &Scene| -> Vec<f64> {
        let world = scene.world.lock();
        joints.iter().map(|joint| world.joint_position_rad(joint).expect("a joint")).collect()
    };
    let before = positions(&scene);
    scene.host.keep_sent();
    arm(&mut scene.link, &found).expect("torque");
    let after = positions(&scene);
    let told = Told::by(&scene);
    let mut started = Started {
        stopped: found.latched.len(),
        goal_off_rad,
        cleared: 0,
        goals_next: 0,
        within_ms: 0.0,
        speed: 0,
        turned_rad: before.iter().zip(after).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max),
    };
    for index in 0..joints.len() {
        let cleared =
            told.values(index, Role::BusWatchdog).into_iter().filter(|(_, raw)| *raw == 0);
        for (at_ns, _) in cleared {
            let speeds = told.values(index, Role::ProfileVelocity);
            let speed = speeds.iter().rev().find(|(then_ns, _)| *then_ns < at_ns).expect("a limit");
            let (next_ns, is_goals) = told.next(at_ns).expect("a word");
            started.cleared += 1;
            started.goals_next += usize::from(is_goals);
            started.within_ms = started.within_ms.max((next_ns - at_ns) as f64 * 1e-6);
            started.speed = started.speed.max(speed.1);
        }
    }
    started
}

#[test]
fn a_servo_that_its_watchdog_stopped_is_cleared_slowly_and_told_to_stay_in_the_very_next_word() {
    let started = killed_and_started_again();
    assert_eq!((started.stopped, started.cleared, started.goals_next), (20, 20, 20));
    assert_eq!(started.speed, 1, "the slowest there is");
    assert!(started.goal_off_rad > 0.2, "its goal was never far: {}", started.goal_off_rad);
    assert!(started.turned_rad < 0.02, "a joint turned {} rad", started.turned_rad);
}

#[test]
fn nobody_but_the_guard_can_make_a_goal_of_a_pose_of_another_size() {
    let limits = Scene::op3().link.robot().limits();
    let now = gaitway::time::Instant::ZERO;
    assert!(Guard::standing_at(&[0.0; 3], limits, now).is_err());
}

#[test]
fn without_any_of_this_the_same_motions_end_done() {
    for robot in ROBOTS {
        for swing_rad in [SWING_RAD, 0.5, 1.5] {
            let played = Scene::of(robot, Options::default()).play(swing_rad, 4);
            assert_eq!(played.run.stop, None, "{robot}");
            assert_eq!(played.run.exceptions, [], "{robot}");
            assert_clean(&played.verdict);
        }
    }
}
