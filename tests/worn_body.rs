//! Sensors on a body whose motion is known: what is measured against what was done.

use gaitway::action::vocabulary;
use gaitway::body::worn::{
    Calibration, HeadingBy, Moved, Movement, Wearing, WornSensor,
    calibrate::{calibrate, calibrate_by_all},
    check,
};
use gaitway::body::{Dof, JointAngles, Segment, SegmentPose};
use glam::{DQuat, DVec3};
use std::f64::consts::PI;

const RATE_HZ: f64 = 60.0;

/// Reproducible numbers: xorshift, and sums of twelve for a normal distribution.
struct Dice(u64);

impl Dice {
    fn even(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn normal(&mut self, sigma: f64) -> f64 {
        sigma * ((0..12).map(|_| self.even()).sum::<f64>() - 6.0)
    }

    fn turn(&mut self, sigma: f64) -> DQuat {
        DQuat::from_scaled_axis(DVec3::from_array([0; 3].map(|_| self.normal(sigma))))
    }
}

/// How far from perfect people and sensors are; angles rad, root mean square.
#[derive(Clone, Copy)]
struct Faults {
    /// A sensor strapped on turned about the limb.
    strapping: f64,
    /// A segment in a pose that a person was asked for.
    posture: f64,
    /// A movement's axis against the segment's.
    wobble: f64,
    /// Inclination of the filter (VQF: 0.7 deg over the BROAD recordings).
    inclination: f64,
    /// Drift of the heading, rad/s.
    drift: f64,
}

const NONE: Faults =
    Faults { strapping: 0.0, posture: 0.0, wobble: 0.0, inclination: 0.0, drift: 0.0 };
const REAL: Faults = Faults {
    strapping: 12.0 * PI / 180.0,
    posture: 2.5 * PI / 180.0,
    wobble: 0.03,
    inclination: 0.7 * PI / 180.0,
    drift: 1.0 / 60.0 * PI / 180.0,
};

/// A body that wears sensors on some segments, strapped on somehow.
struct Person {
    worn: Vec<Segment>,
    /// Sensor in the segment's axes.
    strapped: Vec<DQuat>,
    /// Heading of each sensor's world in the true one.
    heading: Vec<f64>,
    drift: Vec<f64>,
    slow: Vec<DVec3>,
    dice: Dice,
    faults: Faults,
}

impl Person {
    fn new(worn: &[Segment], faults: Faults, seed: u64) -> Self {
        let mut dice = Dice(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1);
        for _ in 0..10 {
            dice.even();
        }
        // The sensor's X forward, more or less, and tilted as the limb is round.
        let strapped = worn.iter().map(|_| {
            DQuat::from_rotation_z(dice.normal(faults.strapping))
                * DQuat::from_rotation_y(dice.normal(0.2))
        });
        let strapped = strapped.collect();
        let heading = worn.iter().map(|_| PI * (2.0 * dice.even() - 1.0)).collect();
        let drift = worn.iter().map(|_| dice.normal(faults.drift)).collect();
        let slow = vec![DVec3::ZERO; worn.len()];
        Self { worn: worn.to_vec(), strapped, heading, drift, slow, dice, faults }
    }

    fn sensors(&self, is_forward_known: bool) -> Vec<WornSensor> {
        let forward = is_forward_known.then_some(DVec3::X);
        self.worn.iter().map(|&segment| WornSensor { segment, forward }).collect()
    }

    /// What the sensors say of a pose, `time_s` after calibration.
    fn say(&mut self, pose: &SegmentPose, time_s: f64) -> [Option<DQuat>; 13] {
        let mut said = [None; 13];
        for (at, segment) in self.worn.iter().enumerate() {
            // Inclination errors wander within seconds.
            let kick = DVec3::new(self.dice.normal(1.0), self.dice.normal(1.0), 0.0);
            let keep = (-1.0 / (2.0 * RATE_HZ)).exp();
            self.slow[at] = keep * self.slow[at]
                + (1.0 - keep * keep).sqrt() * self.faults.inclination / 2f64.sqrt() * kick;
            let world = DQuat::from_rotation_z(-self.heading[at] - self.drift[at] * time_s)
                * DQuat::from_scaled_axis(self.slow[at]);
            said[segment.index()] =
                Some(world * pose.orientation[segment.index()] * self.strapped[at]);
        }
        said
    }

    /// Three seconds of standing in a pose as well as a person does.
    fn stand(&mut self, angles: &JointAngles) -> Vec<Vec<DQuat>> {
        let mut pose = angles.to_pose(DVec3::ZERO, DQuat::IDENTITY);
        for orientation in &mut pose.orientation {
            // Nobody stands with a heading error of a segment that gravity would not show as well.
            *orientation = self.dice.turn(self.faults.posture) * *orientation;
        }
        self.series(&vec![pose; 180])
    }

    fn series(&mut self, poses: &[SegmentPose]) -> Vec<Vec<DQuat>> {
        let said: Vec<_> = poses.iter().map(|pose| self.say(pose, 0.0)).collect();
        let of = |segment: &Segment| said.iter().map(|s| s[segment.index()].unwrap()).collect();
        self.worn.iter().map(of).collect()
    }

    /// Five seconds of a movement, not quite about Y.
    fn movement(&mut self, movement: Movement) -> Moved {
        let poses: Vec<SegmentPose> = (0..300)
            .map(|n| {
                let bend = (1.0 - (2.0 * PI * f64::from(n) / 150.0).cos()) / 2.0;
                let mut pose = JointAngles::default().to_pose(DVec3::ZERO, DQuat::IDENTITY);
                for (segment, sign) in movement.turns() {
                    let far = if movement == Movement::Bow { 0.9 } else { 1.2 };
                    let wobble = self.dice.normal(0.0005);
                    let axis = DVec3::new(self.faults.wobble, 1.0, -self.faults.wobble);
                    let turn = axis.normalize() * (sign * far * bend) + DVec3::X * wobble;
                    pose.orientation[segment.index()] = DQuat::from_scaled_axis(turn);
                }
                pose
            })
            .collect();
        Moved { movement, orientation: self.series(&poses) }
    }

    fn calibrated(&mut self, method: Method) -> Calibration {
        let n_pose = self.stand(&JointAngles::default());
        let t_pose = (method != Method::NPose).then(|| self.stand(&t_pose()));
        let moves: Vec<Moved> = match method {
            Method::NPose | Method::TPose => Vec::new(),
            Method::Movements => {
                let all =
                    [Movement::Bow, Movement::SitToStand, Movement::Bend, Movement::RaiseArms];
                all.into_iter().map(|movement| self.movement(movement)).collect()
            }
        };
        calibrate(&self.sensors(true), &n_pose, t_pose.as_deref(), &moves).expect("calibrated")
    }
}

#[derive(Clone, Copy, PartialEq, Debug)]
enum Method {
    NPose,
    TPose,
    Movements,
}

fn t_pose() -> JointAngles {
    let mut angles = JointAngles::default();
    angles[Dof::LeftShoulderAbduction] = PI / 2.0;
    angles[Dof::RightShoulderAbduction] = PI / 2.0;
    angles
}

fn performed(action: &str) -> Vec<JointAngles> {
    let motion = vocabulary::find(action).expect("shipped").perform().expect("performed");
    motion.sampled(RATE_HZ).expect("sampled")
}

/// Joint-angle error over a motion that is repeated for `seconds`, rad, root mean square by DOF.
fn errors(
    person: &mut Person,
    wearing: &mut Wearing,
    truth: &[JointAngles],
    seconds: f64,
) -> [f64; 22] {
    let mut squares = [0.0; 22];
    let count = (seconds * RATE_HZ) as usize;
    for n in 0..count {
        let angles = truth[n % truth.len()];
        let pose = angles.to_pose(DVec3::ZERO, DQuat::IDENTITY);
        let said = person.say(&pose, n as f64 / RATE_HZ);
        let got = wearing.pose(&said, 1.0 / RATE_HZ);
        for dof in Dof::ALL {
            let off = gaitway::units::wrap_rad(got.measured.angles[dof] - angles[dof]);
            squares[dof.index()] += off * off;
        }
    }
    squares.map(|sum| (sum / count as f64).sqrt())
}

fn overall_deg(errors: &[f64; 22]) -> f64 {
    (errors.iter().map(|e| e * e).sum::<f64>() / 22.0).sqrt().to_degrees()
}

#[test]
fn perfect_sensors_give_the_angles_that_were_done_by_every_method() {
    for method in [Method::NPose, Method::TPose, Method::Movements] {
        for action in ["walk", "squat", "wave-r"] {
            let mut person = Person::new(&Segment::ALL, NONE, 7);
            let calibration = person.calibrated(method);
            let by = |segment: Segment| {
                calibration.mounts.iter().find(|m| m.segment == segment).unwrap().heading_by
            };
            if method == Method::Movements {
                assert!(calibration.mounts.iter().all(|m| m.heading_by == HeadingBy::Movement));
            } else {
                assert_eq!(by(Segment::LeftThigh), HeadingBy::Strapping);
                let arms = method == Method::TPose;
                assert_eq!(by(Segment::LeftUpperArm) == HeadingBy::TPose, arms);
            }
            let mut wearing = Wearing::new(&calibration);
            let off = errors(&mut person, &mut wearing, &performed(action), 10.0);
            assert!(overall_deg(&off) < 0.2, "{method:?} {action}: {off:?}");
        }
    }
}

/// The table of docs/live.md, and what it must not fall behind.
#[test]
fn joint_angles_with_real_faults_stay_within_what_each_method_promises() {
    println!("joint-angle RMSE over 22 angles, deg; mean of 8 people, 60 s each");
    println!("{:<12}{:>8}{:>8}{:>10}", "", "N pose", "+ T", "+ moves");
    let mut means = [0.0; 3];
    for action in ["walk", "run", "squat", "wave-r"] {
        let truth = performed(action);
        let mut row = [0.0; 3];
        for (at, method) in
            [Method::NPose, Method::TPose, Method::Movements].into_iter().enumerate()
        {
            for seed in 1..=8 {
                let mut person = Person::new(&Segment::ALL, REAL, seed);
                let mut wearing = Wearing::new(&person.calibrated(method));
                row[at] += overall_deg(&errors(&mut person, &mut wearing, &truth, 60.0)) / 8.0;
            }
            means[at] += row[at] / 4.0;
        }
        println!("{action:<12}{:>8.2}{:>8.2}{:>10.2}", row[0], row[1], row[2]);
        assert!(row[2] < 6.0, "{action}: {row:?}");
    }
    assert!(means[2] < means[1] && means[1] < means[0], "{means:?}");
}

#[test]
fn a_heading_that_drifts_below_a_hinge_is_led_back_and_the_drift_is_said() {
    let worn = [Segment::LeftThigh, Segment::LeftShank];
    let mut person = Person::new(&worn, NONE, 3);
    let calibration = person.calibrated(Method::NPose);
    // 3 deg/min on the shank for five minutes.
    person.drift = vec![0.0, 3.0_f64.to_radians() / 60.0];
    let mut wearing = Wearing::new(&calibration);
    let mut left = Wearing::new(&calibration);
    let walk = performed("walk");
    for n in 0..(300.0 * RATE_HZ) as usize {
        let pose = walk[n % walk.len()].to_pose(DVec3::ZERO, DQuat::IDENTITY);
        let said = person.say(&pose, n as f64 / RATE_HZ);
        let moment = wearing.pose(&said, 1.0 / RATE_HZ);
        let unmended = left.pose(&said, 0.0);
        if n as f64 > 299.0 * RATE_HZ {
            let twist = moment.measured.unmodelled_rad[Segment::LeftShank.index()];
            let drifted = unmended.measured.unmodelled_rad[Segment::LeftShank.index()];
            assert!(twist < 0.6_f64.to_radians(), "{}", twist.to_degrees());
            assert!(drifted > 14.0_f64.to_radians(), "{}", drifted.to_degrees());
        }
    }
    let drifts = wearing.drifts();
    assert_eq!(drifts[0].corrected_rad, None, "no joint tells the thigh's heading");
    let rate = drifts[1].rate_rad_s.unwrap().to_degrees() * 60.0;
    assert!((rate - 3.0).abs() < 0.2, "{rate} deg/min");
}

#[test]
fn a_heading_reset_mends_every_sensor_without_a_jump() {
    let mut person = Person::new(&Segment::ALL, NONE, 5);
    let mut wearing = Wearing::new(&person.calibrated(Method::NPose));
    let standing = JointAngles::default().to_pose(DVec3::ZERO, DQuat::IDENTITY);
    person.drift = (0..13).map(|n| 0.001 * f64::from(n - 6)).collect();
    let off = |moment: &gaitway::body::worn::WornPose| {
        moment.pose.orientation.iter().map(|q| q.angle_between(DQuat::IDENTITY)).fold(0.0, f64::max)
    };
    let mut before = wearing.pose(&person.say(&standing, 60.0), 0.0);
    assert!(off(&before) > 0.3);
    wearing.reset_heading();
    for _ in 0..120 {
        let after = wearing.pose(&person.say(&standing, 60.0), 1.0 / RATE_HZ);
        for (a, b) in before.pose.orientation.iter().zip(&after.pose.orientation) {
            assert!(a.angle_between(*b) < 0.02, "20 deg/s at most, and a correction");
        }
        before = after;
    }
    assert!(off(&before) < 1e-6, "{}", off(&before));
}

#[test]
fn what_is_not_worn_is_at_rest_and_said_not_to_be_worn() {
    let worn = [Segment::Torso, Segment::RightUpperArm, Segment::RightForearm];
    let mut person = Person::new(&worn, NONE, 11);
    let mut wearing = Wearing::new(&person.calibrated(Method::NPose));
    let mut angles = JointAngles::default();
    angles[Dof::RightShoulderFlexion] = 1.0;
    angles[Dof::RightElbowFlexion] = 0.7;
    angles[Dof::LeftElbowFlexion] = 1.2;
    angles[Dof::LeftKneeFlexion] = 0.9;
    // The person has turned round, which the pelvis does not say.
    let pose = angles.to_pose(DVec3::ZERO, DQuat::from_rotation_z(2.0));
    let got = wearing.pose(&person.say(&pose, 0.0), 0.01);
    for dof in Dof::ALL {
        let arm = [Dof::RightShoulderFlexion, Dof::RightElbowFlexion].contains(&dof);
        let wanted = if arm { angles[dof] } else { 0.0 };
        assert!((got.measured.angles[dof] - wanted).abs() < 0.01, "{}", dof.name());
    }
    let is_worn = wearing.worn();
    for segment in Segment::ALL {
        assert_eq!(is_worn[segment.index()], worn.contains(&segment));
    }
    // A sensor that falls silent stays where it was, and is said not to be fresh.
    let mut said = person.say(&pose, 0.0);
    said[Segment::RightForearm.index()] = Some(DQuat::from_xyzw(f64::NAN, 0.0, 0.0, 1.0));
    let silent = wearing.pose(&said, 0.01);
    assert!(!silent.fresh[Segment::RightForearm.index()]);
    assert!(silent.fresh[Segment::Torso.index()]);
    assert!((silent.measured.angles[Dof::RightElbowFlexion] - 0.7).abs() < 0.01);
}

#[test]
fn a_calibration_that_cannot_be_trusted_is_refused_and_says_why() {
    let mut person = Person::new(&[Segment::LeftShank], NONE, 2);
    let n_pose = person.stand(&JointAngles::default());
    let unknown = person.sensors(false);
    let error = calibrate(&unknown, &n_pose, None, &[]).unwrap_err();
    assert!(error.to_string().contains("left shank"), "{error}");
    let mut restless = n_pose.clone();
    for (n, q) in restless[0].iter_mut().enumerate() {
        *q = DQuat::from_rotation_y(0.3 * (n as f64 / 10.0).sin()) * *q;
    }
    let error = calibrate(&person.sensors(true), &restless, None, &[]).unwrap_err();
    assert!(error.to_string().contains("moved in N pose"), "{error}");
    // A leg that swings about two axes is no hinge: the strapping is used, and it is said.
    let mut moved = person.movement(Movement::Bend);
    for (n, q) in moved.orientation[0].iter_mut().enumerate() {
        *q *= DQuat::from_rotation_x(0.5 * (n as f64 / 7.0).sin());
    }
    let found = calibrate(&person.sensors(true), &n_pose, None, &[moved]).expect("strapped");
    assert_eq!(found.mounts[0].heading_by, HeadingBy::Strapping);
    assert!(found.notes[0].contains("more than one axis"), "{:?}", found.notes);
    let twice = [person.sensors(true)[0]; 2];
    let series = vec![n_pose[0].clone(); 2];
    assert!(calibrate(&twice, &series, None, &[]).is_err());
}

/// A thigh's flesh twists about the bone at every step and jolt, faster than the thigh moves, and whoever goes to a chair turns round.
#[test]
fn a_movement_tells_a_heading_though_flesh_twists_a_sensor_and_somebody_turns_round() {
    let mut person = Person::new(&[Segment::LeftThigh], NONE, 37);
    person.strapped[0] = DQuat::from_rotation_z(0.6);
    let n_pose = person.stand(&JointAngles::default());
    let poses: Vec<SegmentPose> = (0..300)
        .map(|n| {
            let time_s = f64::from(n) / RATE_HZ;
            let bend = (1.0 - (2.0 * PI * time_s / 5.0).cos()) / 2.0;
            let mut pose = JointAngles::default().to_pose(DVec3::ZERO, DQuat::IDENTITY);
            let twist = DQuat::from_rotation_z(0.08 * (2.0 * PI * 9.0 * time_s).sin());
            let turned = DQuat::from_rotation_z(0.5 * time_s);
            let raised = DQuat::from_rotation_y(-1.3 * bend);
            pose.orientation[Segment::LeftThigh.index()] = turned * raised * twist;
            pose
        })
        .collect();
    let moved = Moved { movement: Movement::SitToStand, orientation: person.series(&poses) };
    let found = calibrate(&person.sensors(false), &n_pose, None, &[moved]).expect("told");
    assert!(found.notes.is_empty(), "{:?}", found.notes);
    let off = gaitway::units::wrap_rad(found.mounts[0].heading_rad - person.heading[0]);
    assert!(off.abs() < 2.0_f64.to_radians(), "{} deg", off.to_degrees());
}

const LEGS: [Segment; 6] = [
    Segment::LeftThigh,
    Segment::LeftShank,
    Segment::LeftFoot,
    Segment::RightThigh,
    Segment::RightShank,
    Segment::RightFoot,
];

/// Nobody was asked to move in any way, and straps are far off, or unknown.
#[test]
fn legs_of_whoever_walks_and_squats_tell_how_their_sensors_face() {
    for is_forward_known in [true, false] {
        for seed in 1..=8 {
            let faults = Faults { strapping: 0.0, posture: 1.0_f64.to_radians(), ..REAL };
            let mut person = Person::new(&LEGS, faults, seed);
            for (at, strapped) in person.strapped.iter_mut().enumerate() {
                let side = if at % 2 == 0 { 1.0 } else { -1.0 };
                *strapped = DQuat::from_rotation_z(side * 40.0_f64.to_radians()) * *strapped;
            }
            let n_pose = person.stand(&JointAngles::default());
            let done = [performed("walk"), performed("squat")].concat();
            let poses: Vec<SegmentPose> =
                done.iter().map(|angles| angles.to_pose(DVec3::ZERO, DQuat::IDENTITY)).collect();
            let done = person.series(&poses);
            let sensors = person.sensors(is_forward_known);
            let found = calibrate_by_all(&sensors, &n_pose, None, &[], Some(&done));
            let found = found.expect("done");
            for (mount, heading_rad) in found.mounts.iter().zip(&person.heading) {
                assert_eq!(mount.heading_by, HeadingBy::Leaning, "{:?}", mount.segment);
                let off = gaitway::units::wrap_rad(mount.heading_rad - heading_rad);
                assert!(off.abs() < 12.0_f64.to_radians(), "{mount:?} {} deg", off.to_degrees());
            }
        }
    }
}

/// Whoever only stands, or swings a leg round, shows nothing: the strap is believed, and where there is none to believe it is said.
#[test]
fn legs_that_lean_every_way_tell_nothing() {
    let worn = [Segment::LeftThigh];
    let mut person = Person::new(&worn, NONE, 41);
    let n_pose = person.stand(&JointAngles::default());
    let round = |about: DVec3| DQuat::from_scaled_axis(about * 0.7);
    let swung: Vec<SegmentPose> = (0..600)
        .map(|n| {
            let (sin, cos) = (f64::from(n) / 20.0).sin_cos();
            let mut pose = JointAngles::default().to_pose(DVec3::ZERO, DQuat::IDENTITY);
            pose.orientation[Segment::LeftThigh.index()] = round(DVec3::new(cos, sin, 0.0));
            pose
        })
        .collect();
    let swung = person.series(&swung);
    for at_will in [&swung, &n_pose] {
        let told = person.sensors(true);
        let found = calibrate_by_all(&told, &n_pose, None, &[], Some(at_will)).expect("a strap");
        assert_eq!(found.mounts[0].heading_by, HeadingBy::Strapping);
        let untold = person.sensors(false);
        let error = calibrate_by_all(&untold, &n_pose, None, &[], Some(at_will)).unwrap_err();
        assert!(error.to_string().contains("left thigh"), "{error}");
    }
}

/// Straps stay, but the sensors were switched off: their worlds begin elsewhere.
#[test]
fn a_calibration_that_was_kept_finds_its_headings_anew_in_n_pose() {
    let mut person = Person::new(&Segment::ALL, NONE, 17);
    let kept = person.calibrated(Method::Movements);
    for heading in &mut person.heading {
        *heading += 1.9;
    }
    let n_pose = person.stand(&JointAngles::default());
    let found = kept.reheaded(&n_pose).expect("as it was");
    let mut wearing = Wearing::new(&found);
    let off = errors(&mut person, &mut wearing, &performed("walk"), 5.0);
    assert!(overall_deg(&off) < 0.2, "{off:?}");
    // A strap that slipped by 30 deg.
    person.strapped[4] = DQuat::from_rotation_x(0.52) * person.strapped[4];
    let error = kept.reheaded(&person.stand(&JointAngles::default())).unwrap_err().to_string();
    assert!(error.contains("left forearm") && error.contains("slipped"), "{error}");
}

#[test]
fn t_pose_says_which_segment_is_not_where_it_belongs() {
    let mut person = Person::new(&Segment::ALL, NONE, 19);
    let calibration = person.calibrated(Method::NPose);
    let off = check::off_t_pose(&calibration, &person.stand(&t_pose())).expect("stands");
    assert!(off.iter().all(|(_, rad)| *rad < 0.01), "{off:?}");
    let mut lazy = t_pose();
    lazy[Dof::LeftShoulderAbduction] -= 0.4;
    let off = check::off_t_pose(&calibration, &person.stand(&lazy)).expect("stands");
    for (segment, rad) in off {
        let arm = [Segment::LeftUpperArm, Segment::LeftForearm].contains(&segment);
        assert!((rad - if arm { 0.4 } else { 0.0 }).abs() < 0.01, "{segment:?} {rad}");
    }
}

#[test]
fn who_moves_in_a_pose_is_named_and_who_stands_is_not() {
    let mut person = Person::new(&Segment::ALL, REAL, 23);
    let mut said = person.stand(&JointAngles::default());
    assert_eq!(check::restless(&said), None);
    for (n, q) in said[7].iter_mut().enumerate() {
        *q = DQuat::from_rotation_y(0.2 * (n as f64 / 20.0).sin()) * *q;
    }
    let (at, rad) = check::restless(&said).expect("seen");
    assert!(at == 7 && (rad - 0.2 / 2.0_f64.sqrt()).abs() < 0.03, "{at} {rad}");
    said[3].clear();
    assert_eq!(check::restless(&said), Some((3, f64::INFINITY)));
}

/// Two sensors change places; what the rest says tells.
#[test]
fn sensors_that_were_swapped_are_doubted_and_others_are_not() {
    // Marching: one side after the other.
    let march: Vec<SegmentPose> = (0..600)
        .map(|n| {
            let phase = f64::from(n % 120) / 120.0;
            let lift = |begin: f64| {
                let along = ((phase - begin) / 0.5).clamp(0.0, 1.0);
                (1.0 - (2.0 * PI * along).cos()) / 2.0
            };
            let (left, right) = (lift(0.0), lift(0.5));
            let mut angles = JointAngles::default();
            angles[Dof::LeftHipFlexion] = 0.6 * left;
            angles[Dof::LeftKneeFlexion] = 1.2 * left;
            angles[Dof::RightHipFlexion] = 0.6 * right;
            angles[Dof::RightKneeFlexion] = 1.2 * right;
            angles[Dof::LeftElbowFlexion] = 1.4 * right;
            angles[Dof::RightElbowFlexion] = 1.4 * left;
            angles.to_pose(DVec3::ZERO, DQuat::IDENTITY)
        })
        .collect();
    // Sitting down on a low stool and getting up.
    let sit: Vec<SegmentPose> = (0..400)
        .map(|n| {
            let part = (1.0 - (2.0 * PI * f64::from(n) / 400.0).cos()) / 2.0;
            let mut angles = JointAngles::default();
            for (hip, knee) in [
                (Dof::LeftHipFlexion, Dof::LeftKneeFlexion),
                (Dof::RightHipFlexion, Dof::RightKneeFlexion),
            ] {
                (angles[hip], angles[knee]) = (1.5 * part, 1.8 * part);
            }
            angles.to_pose(DVec3::ZERO, DQuat::IDENTITY)
        })
        .collect();
    for seed in 1..=5 {
        let mut person = Person::new(&Segment::ALL, REAL, seed);
        let poses = march.clone();
        let bend = Moved { movement: Movement::Bend, orientation: person.series(&poses) };
        let sat = Moved { movement: Movement::SitToStand, orientation: person.series(&sit) };
        let moves = [bend, sat];
        let (n_pose, t) = (person.stand(&JointAngles::default()), person.stand(&t_pose()));
        let worn = person.sensors(true);
        let doubts = check::doubts(&worn, &n_pose, Some(&t), &moves);
        assert!(doubts.is_empty(), "{doubts:?}");
        for (left, right, limb) in [
            (Segment::LeftForearm, Segment::RightForearm, "forearm"),
            (Segment::LeftShank, Segment::RightShank, "shank"),
        ] {
            let mut swapped = worn.clone();
            swapped[left.index()].segment = right;
            swapped[right.index()].segment = left;
            let doubts = check::doubts(&swapped, &n_pose, Some(&t), &moves);
            assert!(doubts.iter().any(|doubt| doubt.contains(limb)), "{limb}: {doubts:?}");
        }
        // Of one limb, and no other sensor is named for it.
        for (one, other) in [
            (Segment::LeftThigh, Segment::LeftShank),
            (Segment::RightUpperArm, Segment::RightForearm),
        ] {
            let mut swapped = worn.clone();
            swapped[one.index()].segment = other;
            swapped[other.index()].segment = one;
            let doubts = check::doubts(&swapped, &n_pose, None, &moves);
            let [doubt] = &doubts[..] else { panic!("{one:?}: {doubts:?}") };
            for segment in [one, other] {
                let name = gaitway::body::segment_name(segment).replace('_', " ");
                assert!(doubt.contains(&name), "{doubt}");
            }
        }
    }
}

/// Who waves instead of bowing has not bowed; whose sensors are swapped has begun with the neighbour of what was to turn.
#[test]
fn a_movement_begins_with_what_it_turns_or_far_with_its_neighbour_and_with_nothing_else() {
    use Movement as M;
    use Segment as S;
    for (movement, segment, turned_rad, has_begun) in [
        (M::Bow, S::Torso, 0.4, true),
        (M::Bow, S::Torso, 0.3, false),
        (M::Bow, S::RightUpperArm, 1.5, false),
        (M::Bend, S::LeftForearm, 0.4, true),
        (M::Bend, S::LeftUpperArm, 0.6, false),
        (M::Bend, S::LeftUpperArm, 0.9, true),
        (M::Bend, S::Torso, 1.5, false),
        (M::SitToStand, S::RightThigh, 0.4, true),
        (M::SitToStand, S::RightShank, 0.6, false),
        (M::SitToStand, S::RightShank, 0.9, true),
        (M::SitToStand, S::RightForearm, 1.5, false),
        (M::RaiseArms, S::LeftUpperArm, 0.4, true),
        (M::RaiseArms, S::LeftThigh, 1.5, false),
    ] {
        let begun = check::has_begun(movement, segment, turned_rad);
        assert_eq!(begun, has_begun, "{movement:?} {segment:?} {turned_rad}");
    }
}

#[test]
fn a_sensor_that_began_anew_is_taken_up_where_its_segment_faced() {
    let mut person = Person::new(&Segment::ALL, NONE, 29);
    let mut wearing = Wearing::new(&person.calibrated(Method::NPose));
    let mut angles = JointAngles::default();
    angles[Dof::LeftHipFlexion] = 0.5;
    let pose = angles.to_pose(DVec3::ZERO, DQuat::IDENTITY);
    let before = wearing.pose(&person.say(&pose, 0.0), 0.01);
    person.heading[Segment::LeftThigh.index()] += 2.0;
    wearing.heading_lost(Segment::LeftThigh);
    let after = wearing.pose(&person.say(&pose, 0.0), 0.01);
    for (a, b) in before.pose.orientation.iter().zip(&after.pose.orientation) {
        assert!(a.angle_between(*b) < 1e-3, "{}", a.angle_between(*b));
    }
}
