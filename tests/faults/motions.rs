//! Motions at and beyond their limits, and a disk that fails beneath one.

use super::disk::MemoryDisk;
use super::scene::{Readings, Scene, arm, assert_clean};
use super::{SWING_RAD, forty};
use gaitway::control::{self, Sample, Sink};
use gaitway::guard::{Guard, RefusalReason};
use gaitway::motion::{JointLimits, Path, PlanOptions, plan};
use gaitway::recording::{
    CycleRecord, JointRecord, Pace, RecordedJoint, Recorder, RunEnd, RunStart,
};
use gaitway::time::{Duration, Instant};

/// -1.5 to 1.5 in hundredths, and a billionth on either side of one.
fn sweep() -> Vec<f64> {
    let hundredths = (-150..=150).map(|k| f64::from(k) / 100.0);
    let near = [1.0 - 1e-6, 1.0 + 1e-6, -1.0 + 1e-6, -1.0 - 1e-6, 10.0, -10.0];
    hundredths.chain(near).collect()
}

#[test]
fn m31_the_guard_admits_what_is_within_each_limit_and_nothing_beyond_it() {
    let limits = JointLimits::new(-1.0, 1.0, 2.0, 8.0).expect("limits");
    let (begun, later) = (Instant::ZERO, Instant::ZERO + Duration::from_millis(10));
    let mut cases = 0;
    for times in sweep() {
        let guard = |from_rad: f64| Guard::standing_at(&[from_rad], vec![limits], begun);
        // A position: from the limit itself, so that the step is allowed.
        let mut at = guard(times.clamp(-1.0, 1.0)).expect("a stand").0;
        let admitted = at.admit(&[times], later);
        assert_eq!(admitted.is_ok(), times.abs() <= 1.0, "a position {times} times the limit");
        // A speed: so much in 10 ms.
        let mut at = guard(0.0).expect("a stand").0;
        let admitted = at.admit(&[times * 2.0 * 0.01], later);
        assert_eq!(admitted.is_ok(), times.abs() <= 1.0, "a speed {times} times the limit");
        if let Err(refusal) = admitted {
            assert!(matches!(refusal.reason, RefusalReason::Step { .. }), "{times}: {refusal:?}");
        }
        cases += 2;
    }
    forty::ran("m31_the_guard_admits_what_is_within_each_limit_and_nothing_beyond_it", cases);
}

/// A swing of one joint, from rest to rest, as `1 - cos`: its largest position, speed and
/// acceleration are known without computing any spline.
fn swing(amplitude_rad: f64, turn_s: f64) -> Path {
    let rate_hz = 200.0;
    let samples = (turn_s * rate_hz).round() as usize;
    let at = |k: usize| {
        let phase = std::f64::consts::TAU * k as f64 / samples as f64;
        amplitude_rad / 2.0 * (1.0 - phase.cos())
    };
    let row = (0..=samples).map(at).collect();
    Path::new(vec!["joint".into()], rate_hz, vec![row]).expect("a path")
}

#[test]
fn m31_a_motion_beyond_a_limit_is_refused_or_slowed_until_it_holds_and_position_never() {
    let turn_s = 2.0;
    let omega = std::f64::consts::TAU / turn_s;
    let mut cases = 0;
    for times in sweep() {
        // The splines between samples follow the cosine to a few millionths.
        if (times.abs() - 1.0).abs() < 0.005 {
            continue;
        }
        let beyond = times.abs() > 1.0;
        // Which limit is reached by so much, all others being far away.
        for (quantity, path, limits) in [
            ("position", swing(times, turn_s), (1.0, 100.0, 1_000.0)),
            ("velocity", swing(times * 2.0 / omega, turn_s), (50.0, 1.0, 1_000.0)),
            ("acceleration", swing(times * 2.0 / omega.powi(2), turn_s), (50.0, 100.0, 1.0)),
        ] {
            let (reach, speed, acceleration) = limits;
            let limits = [JointLimits::new(-reach, reach, speed, acceleration).expect("limits")];
            let what = format!("{quantity}, {times} times its limit");
            let as_is = PlanOptions { retime: false, ..PlanOptions::default() };
            let refused = plan(&[0.0], &path, &limits, as_is);
            assert_eq!(refused.is_err(), beyond, "{what}: {refused:?}");
            if let Err(error) = refused {
                let text = error.to_string();
                let named = text.contains("joint") && text.contains(quantity);
                assert!(named || quantity == "position", "{what}: {text}");
            }
            let slowed = plan(&[0.0], &path, &limits, PlanOptions::default());
            match slowed {
                Ok(plan) => {
                    assert!(!beyond || quantity != "position", "{what}: no time mends a position");
                    assert_eq!(plan.retimed.factor > 1.001, beyond, "{what}: {:?}", plan.retimed);
                }
                Err(error) => assert!(beyond && quantity == "position", "{what}: {error}"),
            }
            cases += 2;
        }
    }
    forty::ran(
        "m31_a_motion_beyond_a_limit_is_refused_or_slowed_until_it_holds_and_position_never",
        cases,
    );
}

/// Records while it plays, as `play --record` does, and remembers what was told.
struct Recording<'a> {
    recorder: &'a Recorder,
    seen: Readings,
}

impl Sink for Recording<'_> {
    fn take(&mut self, sample: &Sample<'_>) {
        let joint =
            |&goal_rad: &f64| JointRecord { goal_rad: Some(goal_rad), ..Default::default() };
        let joints = sample.goal_rad.iter().map(joint).collect();
        self.recorder.take(CycleRecord { cycle: sample.cycle, at: sample.at, joints, base: None });
        self.seen.take(sample);
    }
}

/// A swing recorded on a disk whose nth call fails; none fails for 0. What the motion was, how many
/// calls there were, and whether the failure was known.
fn recorded_on(failing: u64) -> Option<(Readings, u64, bool)> {
    let mut scene = Scene::of("open-duck-mini-v2", Default::default());
    let found = scene.preflight().expect("a robot that is ready");
    let trajectory = scene.swing(&found.start_rad, SWING_RAD, 1);
    let armed = arm(&mut scene.link, &found).expect("torque");
    let disk = if failing == 0 { MemoryDisk::default() } else { MemoryDisk::failing_at(failing) };
    let joint = |name: String| RecordedJoint {
        name,
        lower_rad: None,
        upper_rad: None,
        velocity_limit_rad_s: None,
        acceleration_limit_rad_s2: None,
    };
    let start = RunStart {
        robot: "open-duck-mini-v2".into(),
        motion: "swing".into(),
        joints: scene.link.robot().joint_names().into_iter().map(joint).collect(),
        wall_clock_start: std::time::UNIX_EPOCH,
        monotonic_start: Instant::ZERO,
        gaitway_version: "0".into(),
        metadata: Default::default(),
    };
    let each_cycle = Pace { chunk: std::time::Duration::ZERO, sync: std::time::Duration::ZERO };
    // Refused before torque, if the disk fails at once.
    let recorder = Recorder::create_on(disk.clone(), start, each_cycle).ok()?;
    let mut sink = Recording { recorder: &recorder, seen: Readings::default() };
    let settings = scene.settings;
    let run = control::run(&mut scene.link, armed, &trajectory, settings, &mut sink, &|| false)
        .expect("its own joints");
    assert_eq!(run.stop, None, "call {failing} failed");
    assert_clean(&scene.world.lock().verdict());
    let seen = sink.seen;
    let at = *seen.at.last().expect("a cycle");
    let end =
        RunEnd { outcome: "done".into(), stop_reason: None, at, metadata: Default::default() };
    let summary = recorder.finish(end);
    assert_eq!(summary.poisoned.is_some(), !summary.is_complete(), "call {failing}: unsaid");
    Some((seen, disk.calls(), summary.poisoned.is_some()))
}

#[test]
fn r35_a_disk_that_fails_at_any_call_disturbs_no_goal_and_no_time_of_the_motion() {
    let (twin, calls, failed) = recorded_on(0).expect("a recording");
    assert!(!failed && calls > 50, "{calls} calls");
    let (mut cases, mut known) = (0, 0);
    for failing in 1..=calls {
        let Some((seen, _, failed)) = recorded_on(failing) else {
            assert!(failing <= 2, "call {failing} refused the start");
            continue;
        };
        assert_eq!(seen.at, twin.at, "call {failing} failed: other times");
        assert_eq!(seen.goals_rad, twin.goals_rad, "call {failing} failed: other goals");
        assert_eq!(seen.states, twin.states, "call {failing} failed: other readings");
        known += usize::from(failed);
        cases += 1;
    }
    // Calls depend on how the writer keeps up, the number of failures hardly does.
    assert!(cases > 50 && known * 10 >= cases * 9, "{known} of {cases} failures were known");
}

#[test]
fn f38_an_output_never_goes_through_a_link_without_being_forced() {
    use std::os::unix::fs::symlink;
    let folder = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join("f38");
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).expect("a folder");
    let mut cases = 0;
    for ending in ["csv", "bvh", "mcap"] {
        // A link to something precious, and one that leads nowhere yet.
        for precious in [true, false] {
            let target = folder.join(format!("target-{ending}-{precious}"));
            let link = folder.join(format!("link-{precious}.{ending}"));
            if precious {
                std::fs::write(&target, "precious").expect("a file");
            }
            symlink(&target, &link).expect("a link");
            let output = crate::program::gaitway()
                .args(["retarget", "walk", "--robot", "op3", "-q", "-o"])
                .arg(&link)
                .output()
                .expect("a run");
            let said = String::from_utf8_lossy(&output.stderr);
            assert_eq!(output.status.code(), Some(1), "{ending}, {precious}: {said}");
            let kept = std::fs::read_to_string(&target).ok();
            let expected = precious.then(|| "precious".to_owned());
            assert_eq!(kept, expected, "{ending}: it was written through the link");
            assert!(link.is_symlink(), "{ending}: the link is gone");
            cases += 1;
        }
    }
    forty::ran("f38_an_output_never_goes_through_a_link_without_being_forced", cases);
}
