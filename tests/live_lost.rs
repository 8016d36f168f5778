//! A robot goes on while a sensor of an arm is lost: the arm rests, and is followed again when its heading was mended and
//! whoever wears it agrees. Somebody who moves as a script says is played from a recording, in virtual time.

mod program;

use gaitway::body::{Segment, segment_name};
use gaitway::capture::{Captured, Mode, Order, Stamp};
use gaitway::device::sensor::SensorSample;
use gaitway::job::Nobody;
use gaitway::job::live::{LiveOrder, LiveReport, live};
use gaitway::job::report::Outcome;
use gaitway::recording::{
    self, RecordedSource, Recorder, RunEnd, RunStart, SampleEncoding, SourceKind, SourceRecord,
    sensor_series,
};
use gaitway::robot::Robot;
use gaitway::sensing::{Answer, Cue, Person, Plan};
use gaitway::time::{Duration, Instant};
use glam::DQuat;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

const RATE_HZ: f64 = 50.0;
const LENGTH_S: f64 = 36.0;
/// The body stands in N pose before, between and after these, and swings both arms alike, its elbows and its head in them.
const SWINGS_S: [(f64, f64); 2] = [(6.0, 21.0), (28.0, 35.0)];
/// The sensor on the left forearm says nothing in this time, and its heading is another one afterwards.
const SILENT_S: (f64, f64) = (12.0, 19.0);
const HEADING_RAD: f64 = 1.0;

const WORN: [Segment; 7] = [
    Segment::Pelvis,
    Segment::Torso,
    Segment::Head,
    Segment::LeftUpperArm,
    Segment::LeftForearm,
    Segment::RightUpperArm,
    Segment::RightForearm,
];

/// How a segment of the body is turned at a moment.
fn turned(segment: Segment, at_s: f64) -> DQuat {
    let swing = SWINGS_S.iter().find(|(from_s, to_s)| (*from_s..*to_s).contains(&at_s));
    let share = swing.map_or(0.0, |(from_s, to_s)| {
        let edge_s = (at_s - from_s).min(to_s - at_s).min(1.0);
        edge_s * (1.0 - (5.0 * (at_s - from_s)).cos()) / 2.0
    });
    let about_y = |rad: f64| DQuat::from_rotation_y(-rad * share);
    // Inwards, so that what was said last when a sensor was lost faces elsewhere than N pose does.
    let inwards = |rad: f64| DQuat::from_rotation_z(rad * share);
    match segment {
        Segment::LeftUpperArm => inwards(-0.5) * about_y(0.9),
        Segment::RightUpperArm => inwards(0.5) * about_y(0.9),
        Segment::LeftForearm => inwards(-0.5) * about_y(1.6),
        Segment::RightForearm => inwards(0.5) * about_y(1.6),
        Segment::Head => DQuat::from_rotation_z(0.3 * share),
        _ => DQuat::IDENTITY,
    }
}

/// Records what seven sensors say, without the one on the `lost` segment while that is silent.
fn performed(path: &Path, lost: Segment) {
    let start = RunStart {
        robot: String::new(),
        motion: String::new(),
        joints: Vec::new(),
        wall_clock_start: std::time::UNIX_EPOCH,
        monotonic_start: Instant::ZERO,
        gaitway_version: String::new(),
        metadata: Default::default(),
    };
    let recorder = Recorder::create_for_sources(path, false, start).expect("a file");
    let sources = WORN.map(|segment| {
        recorder.add_source(RecordedSource {
            name: segment_name(segment).to_owned(),
            metadata: Default::default(),
            kind: SourceKind::Imu,
        })
    });
    let mut was_silent = false;
    for n in 0..(LENGTH_S * RATE_HZ) as u64 {
        let at_s = n as f64 / RATE_HZ;
        let at = Instant::ZERO + Duration::from_secs_f64(at_s);
        for (segment, source) in WORN.into_iter().zip(sources) {
            let (is_silent, is_back) =
                ((SILENT_S.0..SILENT_S.1).contains(&at_s), at_s >= SILENT_S.1);
            if segment == lost && is_silent {
                was_silent = true;
                continue;
            }
            let heading_rad = if segment == lost && is_back { HEADING_RAD } else { 0.0 };
            let said = DQuat::from_rotation_z(heading_rad) * turned(segment, at_s);
            let anew = segment == lost && std::mem::take(&mut was_silent);
            let order = if anew { Order::Reset } else { Order::Next };
            let step_s = 1.0 / RATE_HZ;
            let (missed, estimated) = (0, 0);
            let (arrival, taken, number) = (at, at, n);
            let stamp = Stamp { arrival, taken, number, step_s, missed, estimated, order };
            let sample = SensorSample { orientation: Some(said), ..SensorSample::default() };
            let captured = Captured { stamp, sample, fused: None, stuck: false };
            recorder.take_record(source, SourceRecord::Sample(Box::new(captured)));
        }
        if n % 100 == 0 {
            // The queue is for samples that come as time goes.
            std::thread::sleep(std::time::Duration::from_millis(20));
        }
    }
    let end = RunEnd {
        outcome: "done".into(),
        stop_reason: None,
        at: Instant::ZERO + Duration::from_secs_f64(LENGTH_S),
        metadata: Default::default(),
    };
    assert!(recorder.finish(end).is_complete());
}

/// Presses keys at cycles of the loop, counted from when it is first asked.
struct Keys {
    reset_at: &'static [u32],
    agree_at: &'static [u32],
    asked: [AtomicU32; 2],
}

impl Person for Keys {
    fn tell(&self, _: Cue<'_>) {}

    fn answer(&self) -> Option<Answer> {
        None
    }

    fn can_answer(&self) -> bool {
        false
    }

    fn wants_to_stop(&self) -> bool {
        false
    }

    fn wants_a_reset(&self) -> bool {
        self.reset_at.contains(&self.asked[0].fetch_add(1, Ordering::Relaxed))
    }

    fn agrees(&self) -> bool {
        self.agree_at.contains(&self.asked[1].fetch_add(1, Ordering::Relaxed))
    }
}

fn order(folder: &Path, keep_going: bool) -> LiveOrder {
    LiveOrder {
        from: vec![format!("replay:{}", folder.join("person.mcap").display())],
        wear: Vec::new(),
        robot: Some("op3".to_owned()),
        buses: vec!["sim".parse().expect("an address")],
        calibration: None,
        seed: 0,
        samples: SampleEncoding::Protobuf,
        rate_hz: Some(RATE_HZ),
        time: None,
        plan: Plan {
            n_pose_after: Some(Duration::from_millis(500)),
            t_pose: false,
            moves: Vec::new(),
            subject: String::new(),
        },
        body_calibration: None,
        recalibrate: false,
        mode: Mode::SixAxes,
        record: Some(folder.join("robot.mcap")),
        replace: true,
        accept_firmware: false,
        hangs: true,
        physics: false,
        balances: false,
        faults: None,
        dry_run: false,
        recognise: false,
        models: None,
        when: Vec::new(),
        keep_going,
        despite_swaps: false,
    }
}

fn followed(folder: &Path, keep_going: bool, keys: &Keys) -> LiveReport {
    live(&order(folder, keep_going), &Nobody, keys)
}

impl Keys {
    fn pressed(reset_at: &'static [u32], agree_at: &'static [u32]) -> Self {
        Self { reset_at, agree_at, asked: Default::default() }
    }

    fn none() -> Self {
        Self::pressed(&[], &[])
    }
}

/// Goals of a joint by time since the first sample of the person, s.
struct Goals(Vec<(f64, Vec<f64>)>);

impl Goals {
    /// Of a run that ended when the person's recording did.
    fn of(path: PathBuf) -> Self {
        let cycles = recording::read(&path).expect("recorded").cycles;
        let ended = cycles.last().expect("cycles").at;
        let row = |cycle: &recording::CycleRecord| {
            let goals = cycle.joints.iter().map(|joint| joint.goal_rad.expect("a goal"));
            (LENGTH_S - ended.seconds_since(cycle.at), goals.collect())
        };
        Self(cycles.iter().map(row).collect())
    }

    fn within(&self, joint: usize, from_s: f64, to_s: f64) -> Vec<f64> {
        let rows = self.0.iter().filter(|(at_s, _)| (from_s..to_s).contains(at_s));
        rows.map(|(_, goals)| goals[joint]).collect()
    }

    fn range(&self, joint: usize, from_s: f64, to_s: f64) -> f64 {
        let goals = self.within(joint, from_s, to_s);
        assert!(goals.len() > 20, "{from_s} {to_s}");
        let (least, most) =
            goals.iter().fold((f64::MAX, f64::MIN), |(a, b), q| (a.min(*q), b.max(*q)));
        most - least
    }

    fn fastest(&self, joint: usize, from_s: f64, to_s: f64) -> f64 {
        let goals = self.within(joint, from_s, to_s);
        goals.windows(2).map(|two| (two[1] - two[0]).abs() * RATE_HZ).fold(0.0, f64::max)
    }
}

#[test]
fn an_arm_whose_sensor_is_lost_rests_and_is_followed_again_slowly_once_mended_and_agreed() {
    let folder = crate::program::folder("arm");
    performed(&folder.join("person.mcap"), Segment::LeftForearm);
    // The loop begins four seconds after the recording does. Agreed to before anything speaks (15 s), and before anything
    // was mended (21.8 s); mended in N pose (22.5 s); agreed while both arms swing (29 s).
    let keys = Keys::pressed(&[925], &[550, 890, 1250]);
    let report = followed(&folder, true, &keys);
    let run = &report.run;
    assert_eq!(run.outcome, Outcome::Done, "{:?}", run.stop_reason);
    assert!(run.referee.as_ref().is_some_and(|referee| referee.violations.is_empty()));
    let body = report.body.as_ref().expect("a body");
    for mount in &body.sensors {
        let is_lost = mount.segment == "left_forearm";
        assert_eq!(mount.lost, u64::from(is_lost), "{mount:?}");
        assert_eq!((mount.lost_s > 5.5 && mount.lost_s < 7.0), is_lost, "{mount:?}");
        // Mended in N pose by what it said then: one that was never lost is as it was, the other is where its heading went.
        let went_rad = if is_lost { -HEADING_RAD } else { 0.0 };
        assert!((mount.heading_reset_rad - went_rad).abs() < 0.02, "{mount:?}");
    }
    assert!(!run.notes.iter().any(|note| note.contains("rested at the end")), "{:?}", run.notes);
    let marks = sensor_series(&folder.join("robot.mcap")).expect("recorded").markers;
    let told: Vec<&str> = marks.iter().map(|mark| mark.text.as_str()).collect();
    let wanted = [
        "the sensor on the left forearm is lost: the left arm goes to rest",
        "not all its sensors speak",
        "all sensors of the left arm speak again",
        "first stand in N pose",
        "the left arm can be followed again",
        "the left arm is followed again, slowly",
    ];
    assert_eq!(told.len(), wanted.len(), "{told:#?}");
    for (told, wanted) in told.iter().zip(wanted) {
        assert!(told.contains(wanted), "{told}");
    }
    let goals = Goals::of(folder.join("robot.mcap"));
    let robot = Robot::load("op3").expect("shipped");
    let joint = |name: &str| robot.joints.iter().position(|of| of.name == name).expect(name);
    {
        let (left, right) = (joint("l_sho_pitch"), joint("r_sho_pitch"));
        // Both arms swing before; then the right one alone, and the left one hangs; then both.
        assert!(goals.range(left, 8.0, 12.0) > 0.5 && goals.range(right, 8.0, 12.0) > 0.5);
        let hangs = goals.within(left, 5.0, 6.0)[0];
        let resting = goals.within(left, 17.0, 28.5);
        assert!(resting.iter().all(|goal| (goal - hangs).abs() < 0.02), "{left}");
        assert!(goals.range(right, 16.0, 21.0) > 0.5);
        assert!(goals.range(left, 32.0, 34.0) > 0.5);
        // The same limits, and the same motion: its heading is right again.
        let mirrored = |at_s: (f64, f64)| -> f64 {
            let both = goals.within(left, at_s.0, at_s.1);
            let both = both.into_iter().zip(goals.within(right, at_s.0, at_s.1));
            both.map(|(left, right)| (left + right).abs()).fold(0.0, f64::max)
        };
        assert!(mirrored((8.0, 11.5)) < 0.05, "{}", mirrored((8.0, 11.5)));
        assert!(mirrored((32.5, 34.0)) < 0.05, "{}", mirrored((32.5, 34.0)));
        // From when the arm is lost until it follows again at 30 % of its speed, also on the way back.
        let most_rad_s = 0.3 * robot.joints[left].limits.velocity_rad_s();
        let fastest = goals.fastest(left, 13.2, 30.4);
        assert!(fastest <= most_rad_s + 1e-3, "{fastest} {most_rad_s}");
        assert!(goals.fastest(right, 29.0, 30.4) > most_rad_s, "the other one is not held back");
    }
}

#[test]
fn whoever_agrees_to_nothing_leaves_the_arm_at_rest_to_the_end_and_is_told() {
    let folder = crate::program::folder("nobody-agrees");
    performed(&folder.join("person.mcap"), Segment::LeftUpperArm);
    let report = followed(&folder, true, &Keys::pressed(&[925], &[]));
    assert_eq!(report.run.outcome, Outcome::Done, "{:?}", report.run.stop_reason);
    let notes = &report.run.notes;
    assert!(notes.iter().any(|note| note.contains("the left arm rested at the end")), "{notes:?}");
    let goals = Goals::of(folder.join("robot.mcap"));
    let robot = Robot::load("op3").expect("shipped");
    let joint = |name: &str| robot.joints.iter().position(|of| of.name == name).expect(name);
    assert!(goals.range(joint("l_sho_pitch"), 17.0, 34.0) < 0.02);
    assert!(goals.range(joint("r_sho_pitch"), 29.0, 34.0) > 0.5);
}

/// What is not to keep going, and what carries the rest, waits for its sensor as ever.
#[test]
fn a_silent_trunk_and_a_silent_arm_without_being_asked_to_keep_going_let_the_robot_stand() {
    for (name, lost, keep_going) in
        [("trunk", Segment::Torso, true), ("arm-waits", Segment::LeftForearm, false)]
    {
        let folder = crate::program::folder(name);
        performed(&folder.join("person.mcap"), lost);
        let report = followed(&folder, keep_going, &Keys::none());
        assert_eq!(report.run.outcome, Outcome::Done, "{:?}", report.run.stop_reason);
        assert!(report.stale_s > 6.0, "{name}: {}", report.stale_s);
        assert!(report.body.expect("a body").sensors.iter().all(|mount| mount.lost == 0));
        let marks = sensor_series(&folder.join("robot.mcap")).expect("recorded").markers;
        assert!(marks.is_empty(), "{marks:?}");
    }
}

#[test]
fn of_a_motion_that_is_performed_no_sensor_can_be_lost() {
    let folder = crate::program::folder("no-sensors");
    let order = LiveOrder { from: vec!["file:walk".to_owned()], ..order(&folder, true) };
    let report = live(&order, &Nobody, &Keys::none());
    assert_eq!(report.run.outcome, Outcome::Refused);
    let reason = report.run.stop_reason.unwrap_or_default();
    assert!(reason.contains("--keep-going"), "{reason}");
}
