//! The program itself breaks: a panic at every step of a cycle and of arming.

use super::scene::{Samples, Scene, assert_clean, assert_excused, is_excused};
use super::{ROBOTS, SWING_RAD, forty};
use gaitway::control::{
    self, Exception, Motion, Performance, Planned, Sample, Settings, Sink, StopReason,
};
use gaitway::motion::Setpoint;
use gaitway::time::Instant;
use serde_json::Value;
use std::panic::resume_unwind;
use std::sync::atomic::{AtomicU64, Ordering};

const WORDS: &str = "put in on purpose";

/// Breaks without a word on standard error: the hook that would print it is not run.
fn breaks() -> ! {
    resume_unwind(Box::new(WORDS))
}

/// When something breaks: in its `first` call, or in every one from then on.
#[derive(Clone, Copy, Debug)]
struct When {
    first: u64,
    for_good: bool,
}

impl When {
    fn is_now(self, call: u64) -> bool {
        call == self.first || self.for_good && call > self.first
    }
}

struct BrokenSink(When);

impl Sink for BrokenSink {
    fn take(&mut self, sample: &Sample<'_>) {
        if self.0.is_now(sample.cycle) {
            breaks();
        }
    }
}

struct BrokenMotion<'a> {
    inner: Planned<'a>,
    calls: u64,
    when: When,
}

impl Motion for BrokenMotion<'_> {
    fn advance(&mut self, dt_s: f64, now: Instant, setpoints: &mut [Setpoint]) -> bool {
        self.calls += 1;
        if self.when.is_now(self.calls - 1) {
            breaks();
        }
        self.inner.advance(dt_s, now, setpoints)
    }

    fn stop(&mut self) {
        self.inner.stop();
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Part {
    Sink,
    Motion,
    Asked,
}

/// Plays a swing in which one part breaks, and looks that the robot ends at rest and holds.
fn play_broken(robot: &str, part: Part, when: When) {
    let mut scene = Scene::of(robot, Default::default());
    let found = scene.preflight().expect("a robot that is ready");
    let trajectory = scene.swing(&found.start_rad, SWING_RAD, 3);
    let armed = super::scene::arm(&mut scene.link, &found).expect("torque");
    let never = When { first: u64::MAX, for_good: false };
    let of = |this: Part| if this == part { when } else { never };
    let inner = Planned::new(&trajectory, scene.link.robot()).expect("its own joints");
    let mut motion = BrokenMotion { inner, calls: 0, when: of(Part::Motion) };
    let mut sink = BrokenSink(of(Part::Sink));
    let looks = AtomicU64::new(0);
    let asked = || {
        let look = looks.fetch_add(1, Ordering::Relaxed);
        if of(Part::Asked).is_now(look) {
            breaks();
        }
        false
    };
    let settings: Settings = scene.settings;
    let run = control::stream(&mut scene.link, armed, &mut motion, settings, &mut sink, &asked);
    let what = format!("{robot}, {part:?}, {when:?}: {:?}, {:?}", run.stop, run.exceptions);
    assert_eq!(run.stop, Some(StopReason::Broke { words: WORDS.into() }), "{what}");
    let verdict = scene.world.lock().verdict();
    let mut seen = verdict.violations;
    if when.for_good && part == Part::Motion {
        // A motion that never works again leaves no way to run it down: the joints are left at their
        // last goal, and the run says so. All else ends at rest.
        assert_eq!(run.exceptions, [Exception::GoalsBroke], "{what}");
        seen.retain(|violation| !is_excused(violation, &run, &scene.link));
    } else {
        assert_eq!(run.exceptions, [], "{what}");
    }
    let seen: Vec<String> = seen.iter().map(ToString::to_string).collect();
    assert!(seen.is_empty(), "{what}:\n{}", seen.join("\n"));
    for joint in scene.link.robot().joint_names() {
        let world = scene.world.lock();
        assert_eq!(world.register(&joint, "Torque Enable"), Some(1), "{what}: {joint}");
        assert!(world.register(&joint, "Bus Watchdog").unwrap_or(0) == 0, "{what}: {joint}");
        let speed_rad_s = world.joint_velocity_rad_s(&joint).expect("a joint").abs();
        assert!(speed_rad_s < 0.05, "{what}: {joint} still turns with {speed_rad_s} rad/s");
    }
}

#[test]
fn x28_a_panic_of_any_part_in_any_cycle_is_a_stop_that_ends_at_rest() {
    let mut cases = 0;
    for robot in ROBOTS {
        for part in [Part::Sink, Part::Motion, Part::Asked] {
            for first in [0, 1, 2, 17, 40, 75] {
                for for_good in [false, true] {
                    play_broken(robot, part, When { first, for_good });
                    cases += 1;
                }
            }
        }
    }
    forty::ran("x28_a_panic_of_any_part_in_any_cycle_is_a_stop_that_ends_at_rest", cases);
}

#[test]
fn x28_a_panic_at_any_look_of_arming_leaves_a_limp_robot_limp() {
    let mut cases = 0;
    for robot in ROBOTS {
        let performed = |broken_at: u64| {
            let mut scene = Scene::of(robot, Default::default());
            let found = scene.preflight().expect("a robot that is ready");
            let trajectory = scene.swing(&found.start_rad, SWING_RAD, 1);
            let mut motion = Planned::new(&trajectory, scene.link.robot()).expect("its own joints");
            let looks = AtomicU64::new(0);
            let asked = || {
                let look = looks.fetch_add(1, Ordering::Relaxed);
                if look == broken_at {
                    breaks();
                }
                // Looks after those of arming belong to the motion: it is not what is tested here.
                broken_at == u64::MAX && look > 5_000
            };
            let (settings, mut sink) = (scene.settings, Samples::default());
            let done = control::perform(
                &mut scene.link,
                &found,
                &mut motion,
                settings,
                &mut sink,
                &asked,
                &mut |is_over| {
                    while !is_over() {
                        std::thread::yield_now();
                    }
                },
            );
            (scene, done.map_err(|error| error.to_string()), looks.into_inner())
        };
        // The twin: nothing breaks, and the looks that are arming's are those before the first cycle.
        let (twin, done, looks) = performed(u64::MAX);
        let Ok(Performance::Ran(run)) = done else { panic!("{robot}: {done:?}") };
        assert_eq!(run.stop, None);
        assert_clean(&twin.world.lock().verdict());
        let arming = looks - run.tally.cycles;
        assert!(arming > 20, "{robot}: {arming} looks");
        for look in (0..arming).step_by(3) {
            let (scene, done, _) = performed(look);
            let error = done.expect_err("it broke");
            let what = format!("{robot}, look {look} of {arming}: {error}");
            assert!(error.contains("the program broke") && error.contains(WORDS), "{what}");
            for joint in scene.link.robot().joint_names() {
                let world = scene.world.lock();
                assert_eq!(world.register(&joint, "Torque Enable"), Some(0), "{what}: {joint}");
                assert!(world.register(&joint, "Bus Watchdog").unwrap_or(0) == 0, "{what}");
            }
            cases += 1;
        }
    }
    assert!(cases > 100, "{cases} looks");
}

/// The command itself, in virtual time, broken at one of the steps that are made for it.
fn broken_command(step: &str, cycle: u64) -> Value {
    let output = crate::program::gaitway()
        .args(["play", "walk", "--robot", "op3", "--bus", "sim", "--json", "-q", "--to", "1.0"])
        .env("GAITWAY_PANIC", format!("{step}:{cycle}"))
        .env("RUST_BACKTRACE", "0")
        .output()
        .expect("a run");
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1), "{step}, cycle {cycle}: {said}");
    serde_json::from_slice(&output.stdout).unwrap_or_else(|e| panic!("{step}: {e}: {said}"))
}

#[test]
fn x28_a_panic_at_every_step_of_a_cycle_ends_at_rest_and_is_reported() {
    let mut cases = 0;
    for step in ["read", "judge", "sink", "advance", "admit", "write"] {
        for cycle in [0, 60] {
            let report = broken_command(step, cycle);
            let what = format!("{step}, cycle {cycle}: {report:#}");
            assert_eq!(report["stop"]["code"], "broke", "{what}");
            let reason = report["stop_reason"].as_str().expect("words");
            assert!(
                reason.contains(&format!("put in on purpose at {step}, cycle {cycle}")),
                "{what}"
            );
            assert_eq!(report["referee"]["violations"], serde_json::json!([]), "{what}");
            assert_eq!(report["left"]["holding"].as_array().map(Vec::len), Some(20), "{what}");
            cases += 1;
        }
    }
    for step in ["arm-goals", "arm-torque"] {
        let report = broken_command(step, 0);
        assert_eq!(report["cycles"], 0, "{report:#}");
        let reason = report["stop_reason"].as_str().expect("words");
        assert!(reason.contains("put in on purpose"), "{reason}");
        assert!(reason.contains("torque was switched off again"), "{reason}");
        cases += 1;
    }
    forty::ran("x28_a_panic_at_every_step_of_a_cycle_ends_at_rest_and_is_reported", cases);
}

#[test]
fn x28_motions_that_nothing_breaks_end_done() {
    for robot in ROBOTS {
        let mut scene = Scene::of(robot, Default::default());
        let played = scene.play_until(SWING_RAD, 3, &|| false);
        assert_eq!(played.run.stop, None, "{robot}");
        assert_eq!(assert_excused(&played, &scene.link), 0);
    }
    let profile = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/Cargo.toml"));
    // A program that aborts instead could not catch anything.
    assert!(profile.expect("a manifest").contains("panic = \"unwind\""));
}
