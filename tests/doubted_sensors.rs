//! What is doubted of bodies and sensors that are as they should be: captured people, and one who wore sensors.

#[path = "captured/mod.rs"]
mod captured;
mod virtual_wearer;

use gaitway::body::worn::doubt::{DoubtChange, Doubts};
use gaitway::body::worn::swaps::SwapWatch;
use gaitway::body::{Segment, SegmentPose};
use gaitway::capture::{Mode, Orientation, Stuck};
use gaitway::device::sensor::SensorSample;
use gaitway::job::model::robot_model;
use gaitway::job::source::body_motion;
use gaitway::mocap::anatomy::Capture;
use gaitway::mocap::retarget::{Online, Settings};
use gaitway::mocap::{self, files::CaptureOptions};
use gaitway::motion::{Follower, Setpoint, Trend};
use gaitway::robot::Robot;
use gaitway::time::Instant;
use glam::{DQuat, DVec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::collections::{BTreeMap, BTreeSet};
use virtual_wearer::{Performance, VirtualWearer};

const RATE_HZ: f64 = 100.0;
/// From one capture to the next, s. Slower joins are doubted more often in long sessions: see docs/decisions.md.
const JOIN_S: f64 = 0.8;

/// Looks at a body from moment to moment; who is doubted, and from when on.
fn doubted(poses: impl Iterator<Item = SegmentPose>, worn: [bool; 13]) -> Vec<(f64, DoubtChange)> {
    let mut doubts = Doubts::default();
    let mut found = Vec::new();
    for (n, pose) in poses.enumerate() {
        let taken = Instant::from_nanos(n as u64 * 10_000_000 + 1);
        for segment in Segment::ALL.into_iter().filter(|segment| worn[segment.index()]) {
            doubts.hear(segment, pose.orientation[segment.index()], taken, false);
        }
        let new = doubts.judge(1.0 / RATE_HZ);
        doubts.look(&pose, &worn);
        found.extend(new.into_iter().map(|change| (n as f64 / RATE_HZ, change)));
    }
    found.retain(|(_, change)| change.doubted.is_some());
    found
}

/// Everything that the captures show, dancing, fighting and handsprings as well, some of which nobody cleaned.
#[test]
fn of_captured_people_hardly_anything_is_doubted() {
    let Some(folder) = captured::captured("mocap/bvh") else { return };
    let (mut seconds, mut files, mut clean, mut skipped) = (0.0, 0, 0, 0);
    let mut all = Vec::new();
    for path in captured::bvh_files(&folder) {
        let read = mocap::files::read(&path, &CaptureOptions::default());
        let clip = read.and_then(|file| mocap::clip::Clip::new(file.bvh, None));
        let Ok(capture) = clip.and_then(|clip| mocap::anatomy::capture(&clip)) else {
            skipped += 1;
            continue;
        };
        let length_s = capture.poses.len() as f64 / capture.rate_hz;
        let count = (length_s * RATE_HZ) as u32;
        let poses = (0..count).map(|n| capture.at(f64::from(n) / RATE_HZ));
        let found = doubted(poses, capture.tracked);
        for (at_s, change) in &found {
            eprintln!("{} at {at_s:.2} s: {}", path.display(), change.words());
        }
        (seconds, files) = (seconds + length_s, files + 1);
        clean += usize::from(found.is_empty());
        all.extend(found);
    }
    eprintln!(
        "{} doubts in {:.0} s of {files} captures, {clean} without any, {skipped} skipped",
        all.len(),
        seconds
    );
    assert!(files >= 60, "{files}");
    assert!(clean * 100 >= files * 85, "{clean} of {files}");
    assert!(all.len() as f64 <= 4.0 * seconds / 60.0, "{} in {seconds} s", all.len());
}

/// A minute of somebody who stands, sits and walks, with thirteen real sensors: what each measured becomes its orientation, and none
/// turns or is jolted as nobody can, nor stands still.
#[test]
fn of_somebody_who_wears_sensors_nothing_is_doubted() {
    let Some(folder) = captured::captured("imu/qmt_full_body") else { return };
    let bytes = std::fs::read(folder.join("full_body_16imu_100hz_t40-100s.f32")).expect("a file");
    let (values, rest) = bytes.as_chunks::<4>();
    assert!(rest.is_empty());
    let values: Vec<f64> =
        values.iter().map(|bytes| f64::from(f32::from_le_bytes(*bytes))).collect();
    // As its description lists them; the lower back and the hands are segments of their own there, and none here.
    use Segment as S;
    let order = [
        Some(S::LeftFoot),
        Some(S::LeftShank),
        Some(S::LeftThigh),
        Some(S::RightFoot),
        Some(S::RightShank),
        Some(S::RightThigh),
        Some(S::Pelvis),
        None,
        Some(S::Torso),
        Some(S::Head),
        None,
        Some(S::LeftForearm),
        Some(S::LeftUpperArm),
        None,
        Some(S::RightForearm),
        Some(S::RightUpperArm),
    ];
    let mut filters: Vec<Orientation> =
        order.iter().map(|_| Orientation::new(0.01, Mode::SixAxes)).collect();
    let mut stuck = vec![Stuck::default(); order.len()];
    let mut doubts = Doubts::default();
    let (mut rows, mut found) = (0_u64, Vec::new());
    for row in values.chunks_exact(6 * order.len()) {
        let taken = Instant::from_nanos(rows * 10_000_000 + 1);
        rows += 1;
        for ((said, segment), (filter, stuck)) in
            row.chunks_exact(6).zip(order).zip(filters.iter_mut().zip(&mut stuck))
        {
            let (rate, acceleration) =
                (DVec3::from_slice(&said[..3]), DVec3::from_slice(&said[3..]));
            let fused = filter.take(0.01, Some(rate), Some(acceleration), None).expect("measured");
            let sample = SensorSample {
                angular_rate_rad_s: Some(rate),
                acceleration_m_s2: Some(acceleration),
                ..SensorSample::default()
            };
            let is_stuck = stuck.take(&sample, taken);
            if let Some(segment) = segment.filter(|_| fused.settled) {
                doubts.hear(segment, fused.orientation, taken, is_stuck);
                doubts.weigh(segment, Some(fused.orientation * acceleration), 0.01);
            }
        }
        found.extend(doubts.judge(0.01));
    }
    assert_eq!(rows, 6000);
    assert!(found.is_empty(), "{found:?}");
}

/// What a look at every segment and every joint takes is printed, and held by nothing: it depends on the machine.
#[test]
fn limbs_that_swing_are_not_doubted_and_what_a_look_takes_is_printed() {
    let mut doubts = Doubts::default();
    let mut pose = SegmentPose { root_m: glam::DVec3::ZERO, orientation: [DQuat::IDENTITY; 13] };
    let began = std::time::Instant::now();
    let (mut changes, mut walk) = (0, SwapWatch::default());
    for n in 0..20_000_u64 {
        let taken = Instant::from_nanos(n * 10_000_000 + 1);
        for segment in Segment::ALL {
            let turned = DQuat::from_rotation_y(0.3 * (n as f64 / 30.0).sin());
            pose.orientation[segment.index()] = turned;
            doubts.hear(segment, turned, taken, false);
            doubts.weigh(segment, Some(DVec3::Z * 9.8), 0.01);
        }
        changes += doubts.judge(0.01).len();
        doubts.look(&pose, &[true; 13]);
        changes += walk.take(&pose, &[true; 13], 0.01).len();
    }
    eprintln!("{:.4} ms a cycle", began.elapsed().as_secs_f64() * 1e3 / 20_000.0);
    assert_eq!(changes, 0);
}

/// Somebody who wears sensors and does what was captured, in an order that the seed tells, for so long.
fn performs(seed: u64, lasts_s: f64, captures: &[Capture]) -> Performance {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut performance = Performance::new();
    while performance.lasts_s() < lasts_s {
        let capture = &captures[random.random_range(0..captures.len())];
        let lasts_s = (capture.poses.len() - 1) as f64 / capture.rate_hz;
        let motion = virtual_wearer::from_rest_to_rest(lasts_s, |at_s| capture.at(at_s));
        performance.go_on(motion, JOIN_S);
    }
    performance
}

/// In the names of captures that are no walking, running, waving, bowing, sitting or gesturing: dances, fights, jumps, flips.
const WILD: [&str; 15] = [
    "silly",
    "dab",
    "jump",
    "twirl",
    "kick",
    "handspring",
    "fairmotion_01",
    "cmu_01_01",
    "dance",
    "martial",
    "superman",
    "boxing",
    "punch",
    "slash",
    "skipping",
];

/// Two minutes each from N pose on, as operators are told to mend headings, in an order that the seed tells. With `GAITWAY_LONG` ten
/// hours of it, and ten of what is wild.
#[test]
fn virtual_persons_in_usual_sensors_are_hardly_ever_doubted() {
    let Some(folder) = captured::captured("mocap/bvh") else { return };
    let mut captures = [Vec::new(), Vec::new()];
    for path in captured::bvh_files(&folder) {
        let read = mocap::files::read(&path, &CaptureOptions::default());
        let clip = read.and_then(|file| mocap::clip::Clip::new(file.bvh, None));
        let Ok(capture) = clip.and_then(|clip| mocap::anatomy::capture(&clip)) else { continue };
        let name = path.file_name().expect("a name").to_string_lossy().to_lowercase();
        if capture.tracked == [true; 13] && capture.poses.len() > 20 {
            captures[usize::from(WILD.iter().any(|wild| name.contains(wild)))].push(capture);
        }
    }
    let is_long = std::env::var_os("GAITWAY_LONG").is_some();
    for (captures, what, most_an_hour) in
        [(&captures[0], "everyday", 0.5), (&captures[1], "wild", f64::INFINITY)]
    {
        let sessions = if is_long { 300 } else { 10 };
        let (mut by_cause, mut seconds): (BTreeMap<String, u32>, f64) = Default::default();
        for seed in 0..sessions {
            let mut wearer = VirtualWearer::new(&performs(seed, 120.0, captures), seed);
            while wearer.goes_on() {
                let Some((_, changes)) = wearer.step(|_, _, _| {}) else { continue };
                for why in changes.iter().filter_map(|change| change.doubted) {
                    *by_cause.entry(format!("{why:?}")).or_default() += 1;
                }
            }
            seconds += wearer.time_s();
        }
        let hours = seconds / 3600.0;
        let an_hour = |count: u32| f64::from(count) / hours;
        let each: BTreeMap<_, _> =
            by_cause.iter().map(|(why, count)| (why, format!("{:.2}", an_hour(*count)))).collect();
        let all = by_cause.values().sum();
        eprintln!(
            "{what}: {} captures, {hours:.2} h, {:.2} doubts an hour: {each:?}",
            captures.len(),
            an_hour(all)
        );
        assert!(captures.len() >= 15 && !by_cause.contains_key("Gravity"), "{by_cause:?}");
        // Of twenty minutes one may be many an hour.
        assert!(all <= 1 || an_hour(all) <= most_an_hour, "{by_cause:?} in {hours} h");
    }
}

/// What is wrong with what sensors measure, from some time on.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Fault {
    Stuck,
    Knock(Segment),
    RunsAway,
    Tilts,
    DeadAxis,
    Blows,
    Pushed,
    Off,
    Scaled,
    Swapped(Segment, Segment),
}

/// Sensors with errors of their own, and when the fault begins: in another moment of a stride each, s.
const TRIED: [(u64, f64); 6] =
    [(7, 13.0), (8, 13.35), (9, 13.6), (10, 14.1), (11, 14.45), (12, 14.9)];

impl Fault {
    /// Spoils what a sensor says so long after the fault began, s.
    fn spoil(self, since_s: f64, segment: Segment, says: &mut virtual_wearer::Spoilt) {
        let on = match self {
            Self::Knock(on) => on,
            Self::Off => Segment::LeftForearm,
            _ => Segment::LeftThigh,
        };
        if segment != on || since_s < 0.0 {
            return;
        }
        match self {
            Self::Stuck => says.stuck = since_s < 2.0,
            Self::Knock(_) if since_s < 0.3 => says.rate += DVec3::Z * 12.0,
            Self::RunsAway => says.rate += DVec3::Z * 0.2,
            Self::Tilts => says.rate += DVec3::Y * 0.2,
            Self::DeadAxis => says.rate.y = 0.0,
            Self::Blows if since_s % 0.2 < 0.01 => says.force += DVec3::X * 150.0,
            Self::Pushed => says.force += DVec3::X * 3.0,
            Self::Off => says.force += DVec3::X * 6.0,
            Self::Scaled => says.force *= 1.3,
            _ => {}
        }
    }
}

/// What became of somebody with a fault.
struct Followed {
    changes: Vec<(f64, DoubtChange)>,
    /// By joint of the robot, cycle by cycle.
    joints: Vec<Vec<f64>>,
}

fn followed(
    performance: &Performance,
    robot: &Robot,
    (seed, fault_s): (u64, f64),
    fault: Option<Fault>,
    how: How,
) -> Followed {
    let model = robot_model(robot).expect("an anatomy");
    let start: Vec<f64> = robot.joints.iter().map(|joint| joint.initial_rad).collect();
    let mut online = Online::new(&model, &[true; 13], &start, &Settings::default()).expect("fits");
    let mut follower = Follower::standing_at(&start, robot.limits());
    let mut setpoints = vec![Setpoint::default(); start.len()];
    let mut trend = Trend::default();
    let mut wearer = VirtualWearer::new(performance, seed);
    wearer.trusts = how == How::Trusts;
    wearer.unweighed = how == How::Unweighed;
    if let Some(Fault::Swapped(one, other)) = fault {
        wearer.taken_for.swap(one.index(), other.index());
    }
    let mut all = Followed { changes: Vec::new(), joints: Vec::new() };
    while wearer.goes_on() {
        let at_s = wearer.time_s();
        let spoil = |at_s: f64, of, says: &mut _| {
            fault.into_iter().for_each(|one| one.spoil(at_s - fault_s, of, says));
        };
        let Some((moment, changes)) = wearer.step(spoil) else { continue };
        all.changes.extend(changes.into_iter().map(|change| (at_s, change)));
        trend.push(at_s, online.pose(&moment.pose, 0.01));
        let target = trend.target(at_s);
        follower.advance(0.01, target.as_ref(), &mut setpoints);
        all.joints.push(setpoints.iter().map(|of| of.position_rad).collect());
    }
    all
}

#[derive(Clone, Copy, PartialEq)]
enum How {
    Doubts,
    Unweighed,
    Trusts,
}

/// How far joints of a robot go beyond what they do without the fault, deg.
fn excess_deg(run: &Followed, range: &[(f64, f64)]) -> f64 {
    let beyond = |(at, rad): (usize, &f64)| (rad - range[at].1).max(range[at].0 - rad);
    let all = run.joints.iter().flat_map(|now| now.iter().enumerate().map(beyond));
    all.fold(0.0, f64::max).to_degrees()
}

/// How far joints of a virtual OP3 go beyond what they do without the fault: as doubted, without what is made of gravity, and without
/// any doubt. Two sets of sensors and moments; with `GAITWAY_LONG` six.
#[test]
fn what_faults_do_to_a_robot_is_bounded_and_printed() {
    let robot = Robot::load("op3").expect("shipped");
    let tried = if std::env::var_os("GAITWAY_LONG").is_some() { &TRIED[..] } else { &TRIED[..2] };
    use Segment as S;
    for motion in ["walk:20s", "run:20s", "bow,bow,bow,bow,bow,bow"] {
        let (capture, _) = body_motion(motion, None, &Default::default()).expect("shipped");
        let mut performance = Performance::new();
        let count =
            (capture.poses.len() as f64 / capture.rate_hz * virtual_wearer::POSES_HZ) as u32;
        let at = |n| capture.at(f64::from(n) / virtual_wearer::POSES_HZ);
        performance.go_on((0..count).map(at).collect(), 1.5);
        let ranges: Vec<Vec<(f64, f64)>> = tried
            .iter()
            .map(|one| {
                let clean = followed(&performance, &robot, *one, None, How::Doubts);
                assert!(clean.changes.is_empty(), "{motion}, {one:?}: {:?}", clean.changes);
                let of = |joint: usize| {
                    let values = clean.joints.iter().map(|now| now[joint]);
                    (
                        values.clone().fold(f64::INFINITY, f64::min),
                        values.fold(f64::NEG_INFINITY, f64::max),
                    )
                };
                (0..clean.joints[0].len()).map(of).collect()
            })
            .collect();
        for fault in [
            Fault::Stuck,
            Fault::Knock(S::LeftThigh),
            Fault::Knock(S::Torso),
            Fault::Knock(S::LeftShank),
            Fault::RunsAway,
            Fault::Tilts,
            Fault::DeadAxis,
            Fault::Blows,
            Fault::Pushed,
            Fault::Off,
            Fault::Scaled,
            Fault::Swapped(S::LeftShank, S::RightShank),
            Fault::Swapped(S::LeftThigh, S::LeftShank),
            Fault::Swapped(S::LeftForearm, S::RightForearm),
        ] {
            let mut worst_deg = [0.0_f64; 3];
            let (mut seen, mut times) = (Vec::new(), 0);
            for (one, range) in tried.iter().zip(&ranges) {
                for (how, worst_deg) in
                    [How::Doubts, How::Unweighed, How::Trusts].into_iter().zip(&mut worst_deg)
                {
                    let run = followed(&performance, &robot, *one, Some(fault), how);
                    *worst_deg = worst_deg.max(excess_deg(&run, range));
                    if how != How::Doubts {
                        continue;
                    }
                    times += run.changes.len();
                    let doubted = |(at_s, change): &(f64, DoubtChange)| {
                        Some((at_s - one.1, change.segment, change.doubted?))
                    };
                    seen.extend(run.changes.iter().find_map(doubted));
                }
            }
            let latest_s = seen.iter().map(|(after_s, ..)| *after_s).fold(0.0, f64::max);
            let how: BTreeSet<_> =
                seen.iter().map(|(_, segment, why)| format!("{segment:?} {why:?}")).collect();
            let [doubts, unweighed, trusts] = worst_deg;
            eprintln!(
                "{motion} {fault:?}: {doubts:.1} deg, unweighed {unweighed:.1}, trusted {trusts:.1}; seen in {} of {}, \
                 after {latest_s:.2} s at the latest: {how:?}; {times} changes",
                seen.len(),
                tried.len(),
            );
            let most_deg = match fault {
                // Named by what a walk shows, after five seconds (tests/swapped_sensors.rs), or in T pose.
                Fault::Swapped(..) => continue,
                Fault::Tilts => 27.0,
                Fault::DeadAxis => 2.0,
                _ => 14.0,
            };
            assert!(doubts < most_deg, "{motion} {fault:?}: {doubts}");
            if matches!(fault, Fault::Blows | Fault::Off) {
                assert_eq!(seen.len(), tried.len(), "{motion} {fault:?}");
            }
            if fault == Fault::Tilts {
                assert!(doubts < 0.8 * unweighed, "{motion}: gravity tells nothing");
            }
        }
    }
}
