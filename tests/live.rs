//! Live, from end to end: virtual sensors on a walking body, their bytes, fusion, joints, the
//! robot's joints, follower, guard, and a virtual OP3, against what was truly done.

mod captured;
mod program;
mod scene;

use gaitway::action::vocabulary;
use gaitway::body::proportions::proximal_joint;
use gaitway::body::worn::{Calibration, Wearing, WornSensor, calibrate::calibrate};
use gaitway::body::{Dof, JointAngles, Proportions, Segment, SegmentPose};
use gaitway::capture::{Chain, Mode};
use gaitway::control::{self, Input, Mirror, mirror::Latency};
use gaitway::device::sensor::stream_format;
use gaitway::job::model::robot_model;
use gaitway::job::source::body_motion;
use gaitway::mocap::retarget::{Online, Settings, retarget};
use gaitway::motion::{FollowTally, Target, Trend};
use gaitway::robot::Robot;
use gaitway::time::Instant;
use gaitway::wire::sensor::Stream;
use gaitway_sim::Options;
use gaitway_sim::imu::{BodyMotion, ImuErrors, ImuWire, Mount, VirtualImu};
use glam::{DQuat, DVec3};
use scene::{Samples, Scene};
use std::sync::Mutex;

const RATE_HZ: f64 = 120.0;
/// Standing in N pose: until calibration ends, and until the walk begins.
const STILL_S: f64 = 6.0;
const STAND_S: f64 = 9.0;
/// When what is measured of the robot is compared.
const WALKING_S: f64 = STAND_S + 0.5;

/// A person who stands, then walks.
struct Walker {
    angles: Vec<JointAngles>,
    poses: Vec<SegmentPose>,
}

impl Walker {
    fn new(rounds: u32) -> Self {
        let walk =
            vocabulary::find("walk").expect("shipped").perform_rounds(rounds).expect("walks");
        let body = Proportions::of_stature(1.75).expect("a body");
        let mut angles = walk.sampled(RATE_HZ).expect("sampled");
        let mut poses = walk.poses(&body, RATE_HZ).expect("posed");
        let stand = (STAND_S * RATE_HZ) as usize;
        angles.splice(0..0, std::iter::repeat_n(angles[0], stand));
        poses.splice(0..0, std::iter::repeat_n(poses[0].clone(), stand));
        Self { angles, poses }
    }

    fn motion(&self, segment: Segment) -> BodyMotion {
        let body = Proportions::of_stature(1.75).expect("a body");
        let joint = proximal_joint(segment);
        let positions: Vec<[f64; 3]> =
            self.poses.iter().map(|p| body.positions(p).joint_m(joint).to_array()).collect();
        let turn = |pose: &SegmentPose| {
            let q = pose.orientation[segment.index()];
            [q.w, q.x, q.y, q.z]
        };
        let orientations: Vec<[f64; 4]> = self.poses.iter().map(turn).collect();
        BodyMotion::new(RATE_HZ, &positions, &orientations).expect("a motion")
    }

    fn at(&self, time_s: f64) -> usize {
        ((time_s * RATE_HZ).round().max(0.0) as usize).min(self.poses.len() - 1)
    }

    fn duration_s(&self) -> f64 {
        (self.poses.len() - 1) as f64 / RATE_HZ
    }
}

/// One sensor and the way of its bytes.
struct Worn {
    segment: Segment,
    sent: std::iter::Peekable<VirtualImu>,
    stream: Stream,
    chain: Chain,
    /// Orientation and when it was taken, s.
    newest: Option<(DQuat, f64)>,
}

impl Worn {
    fn new(walker: &Walker, segment: Segment, batch_s: f64) -> Self {
        let sensor = gaitway_profiles::sensor("x-imu3").expect("shipped");
        let n = segment.index() as f64;
        // Strapped on with its X forward, turned down a little; not where the segment begins.
        let tilt = DQuat::from_rotation_y(0.1 * (n - 6.0) / 6.0);
        let mount = Mount {
            offset_m: (segment.long_axis() * 0.12).to_array(),
            orientation: [tilt.w, tilt.x, tilt.y, tilt.z],
        };
        let errors = ImuErrors {
            rate_bias_rad_s: [0.004, -0.003, 0.005],
            rate_noise_rad_s: 0.002,
            acceleration_noise_m_s2: 0.03,
            clock_skew: 20e-6,
            loss: 0.002,
            latency_s: 0.002,
            jitter_s: 0.001,
            batch_s,
            seed: segment.index() as u64 + 1,
            ..ImuErrors::default()
        };
        let motion = walker.motion(segment);
        let imu = VirtualImu::new(motion, mount, errors, ImuWire::XImu3, sensor.rate_hz);
        Self {
            segment,
            sent: imu.expect("a sensor").peekable(),
            stream: Stream::new(
                stream_format(&sensor).expect("a stream").expect("bytes one after another"),
            ),
            chain: Chain::new(&sensor, Mode::SixAxes),
            newest: None,
        }
    }

    /// Reads what has arrived up to `now_s`; orientations on the way go to `seen`.
    fn read(&mut self, now_s: f64, mut seen: impl FnMut(DQuat)) {
        while let Some(sent) = self.sent.next_if(|sent| sent.due_s <= now_s) {
            let arrival = Instant::from_nanos(1_000_000_000 + (sent.due_s * 1e9).round() as u64);
            let (chain, newest) = (&mut self.chain, &mut self.newest);
            self.stream.push(&sent.bytes, |reading| {
                let [_, Some(captured)] = chain.take(&reading, arrival) else { return };
                let taken_s = captured.stamp.taken.as_nanos() as f64 / 1e9 - 1.0;
                if let Some(fused) = captured.fused.filter(|fused| fused.settled) {
                    *newest = Some((fused.orientation, taken_s));
                    seen(fused.orientation);
                }
            });
        }
    }
}

/// N pose: the last three seconds of standing still.
fn calibrated(sensors: &mut [Worn]) -> Calibration {
    let worn: Vec<WornSensor> = sensors
        .iter()
        .map(|s| WornSensor { segment: s.segment, forward: Some(DVec3::X) })
        .collect();
    let stand = |sensor: &mut Worn| {
        sensor.read(STILL_S - 3.0, |_| {});
        let mut said = Vec::new();
        sensor.read(STILL_S, |orientation| said.push(orientation));
        said
    };
    let n_pose: Vec<Vec<DQuat>> = sensors.iter_mut().map(stand).collect();
    calibrate(&worn, &n_pose, None, &[]).expect("calibrated")
}

fn rms_deg(squares: f64, count: usize) -> f64 {
    (squares / count.max(1) as f64).sqrt().to_degrees()
}

/// A pose of the body and when it was taken, s.
type Taken = (SegmentPose, f64);

/// What became of a walk.
struct Followed {
    latency: Latency,
    tally: FollowTally,
    /// What the robot did, and the times of the poses that it was given, s.
    samples: Samples,
    moments: Vec<f64>,
    start_rad: Vec<f64>,
}

/// A virtual OP3 walks with the poses that `body` has at a time, `dt_s` after those before.
fn op3_follows(
    walker: &Walker,
    body: &mut (dyn FnMut(f64, f64) -> Option<Taken> + Send),
) -> Followed {
    let mut scene = Scene::of("op3", Options::default());
    let found = scene.preflight().expect("ready");
    let armed = scene::arm(&mut scene.link, &found).expect("torque");
    let robot = scene.link.robot().clone();
    let model = robot_model(&robot).expect("an anatomy");
    let settings = Settings::default();
    let mut online = Online::new(&model, &[true; 13], &found.start_rad, &settings).expect("fits");
    let mut trend = Trend::default();
    let mut began: Option<Instant> = None;
    let mut before_s = STILL_S;
    let moments = Mutex::new(Vec::<f64>::new());
    let mut newest = |now: Instant, _approaching: bool| {
        let now_s = STILL_S + now.seconds_since(*began.get_or_insert(now));
        if now_s >= walker.duration_s() {
            return Input::End;
        }
        let dt_s = now_s - before_s;
        let Some((pose, taken_s)) = body(now_s, dt_s) else { return Input::Nothing };
        trend.push(taken_s, online.pose(&pose, dt_s));
        before_s = now_s;
        moments.lock().expect("nobody else").push(now_s);
        trend.target(now_s).map_or(Input::Nothing, Input::Pose)
    };
    let limits = robot.limits();
    let mut mirror = Mirror::new(&mut newest, &found.start_rad, limits);
    let mut samples = Samples::default();
    let run =
        control::stream(&mut scene.link, armed, &mut mirror, scene.settings, &mut samples, &|| {
            false
        });
    assert_eq!(run.stop, None);
    let verdict = scene.world.lock().verdict();
    assert!(verdict.violations.is_empty(), "{:?}", verdict.violations);
    let (latency, tally) = (mirror.latency().expect("followed"), mirror.tally().clone());
    let moments = moments.into_inner().expect("nobody else");
    Followed { latency, tally, samples, moments, start_rad: found.start_rad }
}

fn walks_live(batch_s: f64) {
    let walker = Walker::new(6);
    let sensors = Segment::ALL.map(|segment| Worn::new(&walker, segment, batch_s));
    let mut sensors = Vec::from(sensors);
    let mut wearing = Wearing::new(&calibrated(&mut sensors));
    let body = Mutex::new((0.0, 0_usize));
    let followed = op3_follows(&walker, &mut |now_s, dt_s| {
        let mut said = [None; 13];
        let mut oldest_s = f64::INFINITY;
        for sensor in &mut sensors {
            sensor.read(now_s, |_| {});
            let (orientation, taken_s) = sensor.newest?;
            said[sensor.segment.index()] = Some(orientation);
            oldest_s = oldest_s.min(taken_s);
        }
        let moment = wearing.pose(&said, dt_s);
        let mut body = body.lock().expect("nobody else");
        if now_s > WALKING_S {
            let truth = walker.angles[walker.at(oldest_s)];
            for dof in Dof::ALL {
                body.0 += (moment.measured.angles[dof] - truth[dof]).powi(2);
                body.1 += 1;
            }
        }
        Some((moment.pose, oldest_s))
    });
    // A robot that is told the truth, at once, has the same limits.
    let told =
        op3_follows(&walker, &mut |now_s, _| Some((walker.poses[walker.at(now_s)].clone(), now_s)));
    let (squares, count) = body.into_inner().expect("nobody else");
    let truth = wanted(&walker, &followed.start_rad);
    judge(batch_s, rms_deg(squares, count), &walker, &truth, &followed, &told);
}

/// What the robot was to do, from the true poses.
fn wanted(walker: &Walker, start_rad: &[f64]) -> Vec<Vec<f64>> {
    let model = robot_model(&Robot::load("op3").expect("shipped")).expect("an anatomy");
    let mut online =
        Online::new(&model, &[true; 13], start_rad, &Settings::default()).expect("fits");
    walker.poses.iter().map(|pose| online.pose(pose, 1.0 / RATE_HZ).to_vec()).collect()
}

impl Followed {
    /// What the robot did while the person walked, against what it was to do `delay_s` before, deg.
    fn error_deg(&self, walker: &Walker, truth: &[Vec<f64>], delay_s: f64) -> f64 {
        let (mut squares, mut count) = (0.0, 0);
        let read = self.moments.iter().zip(&self.samples.0).filter(|(s, _)| **s >= WALKING_S);
        for (now_s, measured) in read {
            let wanted = &truth[walker.at(now_s - delay_s)];
            for (measured, wanted) in measured.iter().zip(wanted) {
                let Some(measured) = measured else { continue };
                squares += (measured - wanted).powi(2);
                count += 1;
            }
        }
        rms_deg(squares, count)
    }

    /// The delay at which the robot is nearest, s, and how near, deg.
    fn nearest(&self, walker: &Walker, truth: &[Vec<f64>]) -> (f64, f64) {
        let delays = (0..40).map(|n| f64::from(n) / RATE_HZ);
        let errors = delays.map(|delay_s| (delay_s, self.error_deg(walker, truth, delay_s)));
        errors.min_by(|a, b| a.1.total_cmp(&b.1)).expect("forty")
    }
}

/// The robot cannot walk as fast as the person does: what its limits take it cannot have from poses that are
/// true either. What sensors, fusion and adapters take is the rest.
fn judge(
    batch_s: f64,
    body_deg: f64,
    walker: &Walker,
    truth: &[Vec<f64>],
    followed: &Followed,
    told: &Followed,
) {
    let Followed { latency, tally, .. } = followed;
    let (delay_s, error_deg) = followed.nearest(walker, truth);
    let (told_delay_s, told_deg) = told.nearest(walker, truth);
    println!(
        "batches of {:.0} ms: joints of the body {body_deg:.2} deg RMSE; motion to goal median \
         {:.1} ms, p99 {:.1} ms, behind by limits {:.1} ms ({} samples limited); robot against \
         truth {error_deg:.2} deg RMSE at a delay of {:.0} ms; told the truth, {told_deg:.2} deg at {:.0} ms",
        batch_s * 1e3,
        latency.median_s * 1e3,
        latency.p99_s * 1e3,
        tally.lag_s().unwrap_or(0.0) * 1e3,
        tally.limited_samples.iter().sum::<u64>(),
        delay_s * 1e3,
        told_delay_s * 1e3
    );
    assert!(body_deg < 1.0, "{body_deg}");
    assert!(latency.p99_s < 0.1 && latency.median_s < 0.05);
    assert!(error_deg < told_deg + 0.5, "{error_deg}, told the truth {told_deg}");
    assert!(tally.stale_samples < 5, "{tally:?}");
}

#[test]
fn a_body_that_wears_13_sensors_walks_and_a_virtual_op3_walks_with_it() {
    walks_live(0.0);
}

#[test]
fn adapters_that_hold_bytes_back_for_16_ms_make_it_later_and_not_wilder() {
    walks_live(0.016);
}

/// One joint that swings; silent from 2 to 3 s; asked to stop after 5 s, in the middle of a swing.
#[test]
fn without_input_the_robot_stands_and_a_stop_ends_at_rest_within_the_joints_limits() {
    let mut scene = Scene::of("op3", Options::default());
    let found = scene.preflight().expect("ready");
    let armed = scene::arm(&mut scene.link, &found).expect("torque");
    let limits = scene.link.robot().limits();
    let start = found.start_rad.clone();
    let swing = |t: f64| (0.3 * (1.0 - (4.0 * t).cos()), 1.2 * (4.0 * t).sin());
    let began = scene.link.clock().now();
    let mut newest = |now: Instant, _approaching: bool| {
        let t = now.seconds_since(began);
        if (2.0..3.0).contains(&t) {
            return Input::Nothing;
        }
        let (position_rad, velocity_rad_s) = swing(t);
        let mut target = Target {
            position_rad: start.clone(),
            velocity_rad_s: vec![0.0; start.len()],
            age_s: 0.0,
            careful: Vec::new(),
        };
        target.position_rad[0] += position_rad;
        target.velocity_rad_s[0] = velocity_rad_s;
        Input::Pose(target)
    };
    let mut mirror = Mirror::new(&mut newest, &found.start_rad, limits.clone());
    let mut samples = Samples::default();
    let clock = std::sync::Arc::clone(scene.link.clock());
    let asked = || clock.now().seconds_since(began) > 5.0;
    let settings = scene.settings;
    let run = control::stream(&mut scene.link, armed, &mut mirror, settings, &mut samples, &asked);
    assert_eq!(run.stop, Some(control::StopReason::Asked));
    let verdict = scene.world.lock().verdict();
    assert!(verdict.violations.is_empty(), "{:?}", verdict.violations);
    // The half form from at most 1.2 rad/s; the settling time comes after it.
    let ramp_s = std::f64::consts::FRAC_PI_2 * 1.2 / limits[0].acceleration_rad_s2();
    assert!(run.duration_s < 5.0 + ramp_s + settings.settle.as_secs_f64() + 0.1);
    let at = |t: f64| samples.0[(t * 100.0) as usize][0].expect("read");
    assert!((at(2.3) - at(2.95)).abs() < 0.002, "it stands while nobody says anything");
    assert!((at(4.9) - start[0] - swing(4.9).0).abs() < 0.06, "and follows again");
    assert!(mirror.tally().stale_samples >= 95);
}

/// Blind to what comes next, it must not do something else than with the whole clip at hand.
#[test]
fn pose_by_pose_the_robot_is_asked_for_what_the_whole_clip_asks_for() {
    let robot = Robot::load("op3").expect("shipped");
    let model = robot_model(&robot).expect("an anatomy");
    let start: Vec<f64> = robot.joints.iter().map(|joint| joint.initial_rad).collect();
    for action in ["walk", "wave-r", "squat", "kick-l"] {
        let (capture, _) = body_motion(action, None, &Default::default()).expect("shipped");
        let settings = Settings::default();
        let whole = retarget(&capture, &model, &start, &settings).expect("fits");
        let mut online = Online::new(&model, &capture.tracked, &start, &settings).expect("fits");
        let (mut squares, mut count) = (0.0, 0);
        for (at, pose) in capture.poses.iter().enumerate() {
            let angles = online.pose(pose, 1.0 / capture.rate_hz);
            for (angle, series) in angles.iter().zip(&whole.positions_rad) {
                squares += (angle - series[at]).powi(2);
                count += 1;
            }
        }
        let off_deg = rms_deg(squares, count);
        println!("{action}: pose by pose against the whole clip {off_deg:.2} deg RMS");
        assert!(off_deg < 3.0, "{action}: {off_deg}");
    }
}

/// The command, on an action somebody performs now.
#[test]
fn the_live_command_follows_an_action_and_reports_how() {
    let output = crate::program::gaitway()
        .args(["live", "--from", "file:wave-r", "--robot", "op3", "--bus", "sim", "--json"])
        .args(["--for", "2"])
        .output()
        .expect("runs");
    assert_eq!(output.status.code(), Some(0));
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!(report["outcome"], "done");
    assert_eq!(report["referee"]["violations"].as_array().map(Vec::len), Some(0));
    assert!(report["limited_samples"].is_u64() && report["lag_s"].is_f64());
    assert!(report["latency"]["median_s"].is_f64() && report["latency"]["p99_s"].is_f64());
    let following_s = report["following_s"].as_f64().unwrap();
    assert!((1.9..2.2).contains(&following_s), "{following_s}");
    for joint in report["joints"].as_array().expect("joints") {
        let peak = joint["peak_velocity_rad_s"].as_f64().unwrap();
        assert!(peak <= joint["limit_velocity_rad_s"].as_f64().unwrap() * (1.0 + 1e-9));
        assert_eq!(joint["end_velocity_rad_s"], 0.0);
    }
}

#[test]
fn a_source_that_cannot_be_followed_is_refused_before_anything_moves() {
    let output = crate::program::gaitway()
        .args(["live", "--from", "walk", "--robot", "op3", "--bus", "sim", "--json"])
        .output()
        .expect("runs");
    assert_eq!(output.status.code(), Some(1));
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!(report["outcome"], "refused");
    assert!(report["stop_reason"].as_str().unwrap().contains("file:MOTION"));
}

/// What `live` reports of an OP3 with weight that follows a motion.
fn weighed(motion: &str, more: &[&str]) -> serde_json::Value {
    let output = crate::program::gaitway()
        .args(["live", "--from", &format!("file:{motion}"), "--robot", "op3", "--bus", "sim"])
        .args(["--physics", "--json"])
        .args(more)
        .output()
        .expect("runs");
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!(report["outcome"], "done", "{motion}: {report}");
    assert_eq!(report["referee"]["violations"].as_array().map(Vec::len), Some(0), "{motion}");
    report
}

#[test]
fn an_op3_with_weight_lifts_a_foot_when_it_stands_on_the_other_and_stays_up_whatever_is_done() {
    for (motion, lifts) in [("side-kick-l", 1), ("side-kick-r", 1), ("squat", 0), ("wave-r", 0)] {
        let report = weighed(motion, &[]);
        assert!(report["fell_at_s"].is_null(), "{motion}: {}", report["notes"]);
        assert_eq!(report["feet"]["lifted"], lifts, "{motion}");
    }
    // Steps that are too quick for it are not taken, nor is a jump, and that is said.
    for motion in ["walk", "run", "jump", "jumping-jacks"] {
        let report = weighed(motion, &[]);
        assert!(report["fell_at_s"].is_null(), "{motion}: {}", report["notes"]);
        let kept = report["feet"]["kept_down"].as_u64().expect("a number");
        let is_told = report["notes"].to_string().contains("had put down again");
        assert_eq!(is_told, kept > 0, "{motion}: {}", report["notes"]);
    }
    let hangs = weighed("side-kick-l", &["--hang"]);
    assert!(hangs["feet"].is_null() && hangs["notes"].to_string().contains("cannot fall"));
}

/// Walks, kicks, blows and a twirl of grown-up persons and one child, of several skeletons.
const CAPTURES_FOLLOWED: [&str; 9] = [
    "bvh/bandai/dataset-1_walk_normal_001.bvh",
    "bvh/bandai/dataset-2_walk-turn-left_elderly_004.bvh",
    "bvh/bandai/dataset-2_raise-up-both-hands_normal_004.bvh",
    "bvh/xsens74/kicking.bvh",
    "bvh/xsens74/boxing.bvh",
    "bvh/fair/cmu_1006_walking.bvh",
    "bvh/fair/cmu_1006_twirl.bvh",
    "bvh/fair/8yr_old_silly_walk__ae31a5.bvh",
    "bvh/acclaim20/sst_walk_circle.bvh",
];

#[test]
fn an_op3_with_weight_that_follows_captures_as_they_come_stays_up() {
    let Some(folder) = captured::captures() else { return };
    let mut tried = 0;
    for name in CAPTURES_FOLLOWED {
        let path = folder.join("mocap").join(name);
        let report = weighed(path.to_str().expect("a path"), &[]);
        assert!(report["fell_at_s"].is_null(), "{name}: {}", report["notes"]);
        tried += 1;
    }
    println!("{tried} captures were followed by an OP3 with weight");
}
