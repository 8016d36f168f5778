//! Shipped robots against their makers' documents and public models: where the links are.

use gaitway_profiles::{
    Anatomy, Joint, LineKind, Robot, Role, Segment, Servo, actuator, robot, robot_names, servo,
};
use std::collections::BTreeMap;
use std::f64::consts::{FRAC_PI_2, PI};

fn register(servo: &Servo, role: Role) -> &gaitway_profiles::Register {
    servo.register(role).unwrap_or_else(|| panic!("{} has no {role:?}", servo.name))
}

type Vector = [f64; 3];
type Rotation = [Vector; 3];

fn apply(rotation: &Rotation, v: Vector) -> Vector {
    rotation.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

fn add(a: Vector, b: Vector) -> Vector {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

/// `parent` followed by a turn of `angle` about `axis` (Rodrigues' formula).
fn turned(parent: &Rotation, axis: Vector, angle: f64) -> Rotation {
    let ([x, y, z], (s, c)) = (axis, angle.sin_cos());
    let v = 1.0 - c;
    let turn = [
        [c + x * x * v, x * y * v - z * s, x * z * v + y * s],
        [y * x * v + z * s, c + y * y * v, y * z * v - x * s],
        [z * x * v - y * s, z * y * v + x * s, c + z * z * v],
    ];
    parent.map(|row| {
        [0, 1, 2].map(|k| row[0] * turn[0][k] + row[1] * turn[1][k] + row[2] * turn[2][k])
    })
}

/// Position and orientation of every link in the base, as the schema defines them.
fn links(robot: &Robot, angle: impl Fn(&str) -> f64) -> BTreeMap<String, (Vector, Rotation)> {
    let base = ([0.0; 3], [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
    let mut links: BTreeMap<String, (Vector, Rotation)> = BTreeMap::new();
    for joint in &robot.joints {
        let (origin, rotation) = joint.parent.as_ref().map_or(base, |parent| links[parent]);
        let (origin_m, axis) = joint.mounting().expect("a place");
        let origin = add(origin, apply(&rotation, origin_m));
        links.insert(joint.name.clone(), (origin, turned(&rotation, axis, angle(&joint.name))));
    }
    links
}

#[track_caller]
fn close(a: Vector, b: Vector, tolerance: f64) {
    for (left, right) in a.iter().zip(b) {
        assert!((left - right).abs() <= tolerance, "{a:?} is not {b:?}");
    }
}

fn anatomy(robot: &Robot) -> &Anatomy {
    robot.anatomy.as_ref().expect("an anatomy")
}

fn n_pose(robot: &Robot, joint: &str) -> f64 {
    anatomy(robot).n_pose_rad.get(joint).copied().unwrap_or(0.0)
}

#[test]
fn op3_stands_with_straight_legs_and_hanging_arms_in_n_pose() {
    let op3 = robot("op3").unwrap();
    let links = links(&op3, |joint| n_pose(&op3, joint));
    for (side, y) in [("r", -1.0), ("l", 1.0)] {
        // Sole below the ankle: (0.024, 0, -0.0305) in op3_kinematics_dynamics.cpp. Height by the
        // same table: hip 0.0285, thigh 0.11015, calf 0.110, ankle 0.0305.
        let (ankle, rotation) = links[&format!("{side}_ank_roll")];
        let sole = add(ankle, apply(&rotation, [0.024, 0.0, -0.0305]));
        close(sole, [0.0001, 0.035 * y, -(0.0285 + 0.11015 + 0.110 + 0.0305)], 1e-9);
        close(apply(&rotation, [0.0, 0.0, 1.0]), [0.0, 0.0, 1.0], 1e-6);
        let (shoulder, _) = links[&format!("{side}_sho_roll")];
        let (elbow, forearm) = links[&format!("{side}_el")];
        close(add(elbow, shoulder.map(|v| -v)), [0.0, -0.0001 * y, -0.0904], 2e-4);
        // The end of the forearm: (0, -0.15, 0) right, (0, 0.15, 0) left, in the same table.
        close(apply(&forearm, [0.0, 0.15 * y, 0.0]), [0.0, 0.0, -0.15], 1e-6);
    }
    assert!((n_pose(&op3, "r_sho_roll") + FRAC_PI_2).abs() < 1e-6);
}

#[test]
fn op3_crouches_on_flat_soles_at_the_start_as_the_maker_has_it_elsewhere() {
    let op3 = robot("op3").unwrap();
    let initial = |name: &str| op3.joint(name).unwrap().initial_rad();
    let links = links(&op3, initial);
    for side in ["r", "l"] {
        let (_, rotation) = links[&format!("{side}_ank_roll")];
        close(apply(&rotation, [0.0, 0.0, 1.0]), [0.0, 0.0, 1.0], 1e-5);
        // Knees go forward of hip and ankle, as a person's do.
        let (hip, _) = links[&format!("{side}_hip_pitch")];
        let (knee, _) = links[&format!("{side}_knee")];
        assert!(knee[0] > hip[0] + 0.05);
    }
    // ini_pose.yaml, in degrees.
    for (name, degrees) in
        [("r_sho_pitch", 15.0), ("l_sho_roll", 45.0), ("r_el", 45.0), ("head_tilt", -10.0)]
    {
        assert!((initial(name).to_degrees() - degrees).abs() < 1e-3, "{name}");
    }
}

#[test]
fn op3_moves_no_faster_than_its_velocity_limit_register() {
    let op3 = robot("op3").unwrap();
    let limit = register(servo("xm430-w350").unwrap(), Role::VelocityLimit);
    let rpm = limit.initial.unwrap() as f64 * limit.scale.unwrap();
    for joint in &op3.joints {
        assert!((joint.velocity_rad_s - rpm * 2.0 * PI / 60.0).abs() < 1e-4, "{}", joint.name);
        assert!((joint.velocity_rad_s / joint.acceleration_rad_s2 - 0.2).abs() < 1e-4);
    }
}

/// Sites of apirrone/Open_Duck_Playground's model in its trunk, computed by MuJoCo 4.0.0: angles
/// in the order of the profile; then position and x axis of `left_foot`, `right_foot`, `head`.
const DUCK: [([f64; 14], [[Vector; 2]; 3]); 3] = [
    (
        [0.0; 14],
        [
            [[-0.03456, 0.0894, -0.193599], [1.0, 0.0, 0.0]],
            [[-0.03456, -0.0918, -0.193599], [1.0, 0.0, 0.0]],
            [[0.006, 0.0001, 0.236301], [1.0, 0.0, 0.0]],
        ],
    ),
    (
        [0.3, -0.2, -0.6, 0.9, -0.4, -0.25, 0.35, 0.7, 1.1, -0.5, 0.4, -0.3, 1.2, 0.25],
        [
            [[-0.083641, 0.107443, -0.161899], [0.944702, 0.312992, -0.097843]],
            [[-0.084511, -0.13304, -0.139061], [0.955603, -0.279336, -0.093781]],
            [[-0.040523, 0.008566, 0.22858], [0.360547, 0.932039, 0.036175]],
        ],
    ),
    (
        [-0.5, 0.4, 0.3, -1.2, 0.8, 0.45, -0.3, -0.4, -0.7, 1.3, -0.2, 0.6, -2.1, -0.45],
        [
            [[-0.075373, 0.05184, -0.168739], [0.85456, -0.511148, -0.091953]],
            [[0.003051, -0.029891, -0.176143], [0.594677, 0.011097, 0.803888]],
            [[-0.032518, 0.005106, 0.217564], [-0.464994, -0.863209, -0.196596]],
        ],
    ),
];

#[test]
fn open_duck_moves_as_its_public_model_does() {
    let duck = robot("open-duck-mini-v2").unwrap();
    let links_at = |angles: &[f64; 14]| {
        let by_name: BTreeMap<&str, f64> =
            duck.joints.iter().map(|joint| joint.name.as_str()).zip(*angles).collect();
        links(&duck, |name| by_name[name])
    };
    let zero = links_at(&DUCK[0].0);
    for (angles, sites) in &DUCK {
        let links = links_at(angles);
        for (index, link) in ["left_ankle", "right_ankle", "head_roll"].into_iter().enumerate() {
            // At zero all frames are parallel, which places the site on its link.
            let on_link = add(DUCK[0].1[index][0], zero[link].0.map(|v| -v));
            let (origin, rotation) = links[link];
            close(add(origin, apply(&rotation, on_link)), sites[index][0], 1e-5);
            close(apply(&rotation, [1.0, 0.0, 0.0]), sites[index][1], 1e-5);
        }
    }
}

#[test]
fn open_duck_stands_with_straight_legs_in_n_pose_and_on_flat_soles_at_the_start() {
    let duck = robot("open-duck-mini-v2").unwrap();
    let standing = links(&duck, |joint| n_pose(&duck, joint));
    let starting = links(&duck, |joint| duck.joint(joint).unwrap().initial_rad());
    for side in ["left", "right"] {
        let from = |a: &str, b: &str| {
            let (a, b) = (standing[&format!("{side}_{a}")].0, standing[&format!("{side}_{b}")].0);
            add(b, a.map(|v| -v))
        };
        close(from("hip_pitch", "knee"), [0.0, 0.0, -0.07865], 1e-9);
        close(from("knee", "ankle"), [0.0, 0.0, -0.07865], 1e-9);
        for links in [&standing, &starting] {
            let (_, foot) = links[&format!("{side}_ankle")];
            close(apply(&foot, [0.0, 0.0, 1.0]), [0.0, 0.0, 1.0], 1e-9);
        }
    }
}

#[test]
fn each_robot_plays_pelvis_torso_head_and_legs() {
    for name in ["op3", "open-duck-mini-v2"] {
        let robot = robot(name).unwrap();
        assert_eq!(anatomy(&robot).base, [Segment::Pelvis, Segment::Torso], "{name}");
        for segment in [
            Segment::Head,
            Segment::LeftThigh,
            Segment::LeftShank,
            Segment::LeftFoot,
            Segment::RightThigh,
            Segment::RightShank,
            Segment::RightFoot,
        ] {
            assert!(anatomy(&robot).segments.iter().any(|link| link.segment == segment), "{name}");
        }
    }
}

const HUMANOIDS: [&str; 6] =
    ["berkeley-humanoid-lite", "op2", "op3", "open-duck-mini-v2", "poppy-humanoid", "toddlerbot"];

/// The right-hand joint of a left-hand one.
fn partner<'a>(robot: &'a Robot, left: &Joint) -> Option<&'a Joint> {
    let name = match left.name.strip_prefix("left_") {
        Some(rest) => format!("right_{rest}"),
        None => format!("r_{}", left.name.strip_prefix("l_")?),
    };
    robot.joint(&name)
}

/// +1 if equal angles of the two are mirror images of each other, -1 if opposite angles are. The
/// mirror is the plane of X and Z, so that an axis (a pseudovector) goes to (-x, y, -z).
fn mirror_sign(left: &Joint, right: &Joint) -> f64 {
    let axis = |joint: &Joint| joint.axis.expect("an axis");
    let [x, y, z] = axis(left);
    let mirrored = [-x, y, -z];
    let along: f64 = mirrored.iter().zip(axis(right)).map(|(a, b)| a * b).sum();
    assert!((along.abs() - 1.0).abs() < 1e-6, "{} is no mirror of {}", right.name, left.name);
    along.signum()
}

#[test]
fn left_and_right_are_mirror_images() {
    for name in HUMANOIDS {
        let robot = robot(name).unwrap();
        let angle = |joint: &Joint| joint.initial_rad();
        let at_start = links(&robot, |joint| angle(robot.joint(joint).unwrap()));
        let mut pairs = 0;
        for left in &robot.joints {
            let Some(right) = partner(&robot, left) else { continue };
            pairs += 1;
            let sign = mirror_sign(left, right);
            let [x, y, z] = at_start[&left.name].0;
            // The duck's own model is 2.4 mm off its middle.
            close(at_start[&right.name].0, [x, -y, z], 4e-3);
            assert!(
                (right.initial_rad() - sign * left.initial_rad()).abs() < 1e-9,
                "{}",
                left.name
            );
            let mirrored = if sign > 0.0 {
                (left.lower_rad, left.upper_rad)
            } else {
                (-left.upper_rad, -left.lower_rad)
            };
            // ToddlerBot's config.json has the wrists' ranges the other way round.
            if left.name == "left_wrist_roll" {
                continue;
            }
            // Poppy's JSON gives its elbows and hips a few degrees apart.
            let slack = if name == "poppy-humanoid" { 0.13 } else { 1e-4 };
            let found = (right.lower_rad, right.upper_rad);
            let is_close =
                (found.0 - mirrored.0).abs() <= slack && (found.1 - mirrored.1).abs() <= slack;
            assert!(is_close, "{name} {}: {found:?} is not {mirrored:?}", right.name);
        }
        assert!(pairs >= 5, "{name}: {pairs} pairs");
    }
}

#[test]
fn every_knee_bends_backwards_as_far_as_a_crouch_needs() {
    for (name, hip, knee, ankle) in [
        ("berkeley-humanoid-lite", "left_hip_pitch", "left_knee_pitch", "left_ankle_pitch"),
        ("op2", "l_hip_pitch", "l_knee", "l_ank_pitch"),
        ("op3", "l_hip_pitch", "l_knee", "l_ank_pitch"),
        ("poppy-humanoid", "l_hip_y", "l_knee_y", "l_ankle_y"),
        ("toddlerbot", "left_hip_pitch", "left_knee", "left_ank_pitch"),
    ] {
        let robot = robot(name).unwrap();
        let joint = robot.joint(knee).unwrap();
        // From straight, the far end of the range is the bent one.
        let bent = if joint.upper_rad > -joint.lower_rad { 1.0 } else { -1.0 };
        let links = links(&robot, |joint| if joint == knee { bent } else { n_pose(&robot, joint) });
        let (thigh, shank) = (links[knee].0, links[ankle].0);
        assert!(shank[0] < thigh[0] - 0.05, "{name}: the ankle goes behind the knee");
        assert!(links[hip].0[2] > thigh[2], "{name}: the knee is below the hip");
        assert!(joint.upper_rad - joint.lower_rad > 1.9, "{name}");
    }
}

#[test]
fn op2_stands_on_straight_legs_with_hanging_arms_in_n_pose() {
    let op2 = robot("op2").unwrap();
    let standing = links(&op2, |joint| n_pose(&op2, joint));
    for (side, y) in [("r", -1.0), ("l", 1.0)] {
        // Kinematics.cpp: leg side 37 mm, thigh and calf 93 mm; the hip lies 90.7 + 31.5 mm below
        // the shoulders in robotis_op2.structure.leg.xacro.
        let ankle = standing[&format!("{side}_ank_roll")].0;
        close(ankle, [-0.005, 0.037 * y, -(0.0907 + 0.0315 + 2.0 * 0.093)], 1e-9);
        let (shoulder, _) = standing[&format!("{side}_sho_roll")];
        let (elbow, forearm) = standing[&format!("{side}_el")];
        close(add(elbow, shoulder.map(|v| -v)), [0.016, 0.0, -0.06], 1e-6);
        // At zero the forearm points forward.
        close(apply(&forearm, [1.0, 0.0, 0.0]), [0.0, 0.0, -1.0], 1e-6);
    }
    // At zero the head looks 33 degrees down.
    let (_, head) = standing["head_tilt"];
    let down = 33_f64.to_radians();
    close(apply(&head, [down.cos(), 0.0, -down.sin()]), [1.0, 0.0, 0.0], 1e-6);
}

#[test]
fn op2_starts_crouching_on_flat_soles_with_the_arms_of_its_maker() {
    let op2 = robot("op2").unwrap();
    let initial = |name: &str| op2.joint(name).unwrap().initial_rad();
    let links = links(&op2, initial);
    for side in ["r", "l"] {
        let (_, sole) = links[&format!("{side}_ank_roll")];
        close(apply(&sole, [0.0, 0.0, 1.0]), [0.0, 0.0, 1.0], 1e-5);
    }
    // ini_pose.yaml, degrees.
    for (name, degrees) in
        [("r_sho_pitch", -48.0), ("l_sho_roll", 20.0), ("r_el", 30.0), ("head_tilt", 10.0)]
    {
        assert!((initial(name).to_degrees() - degrees).abs() < 1e-3, "{name}");
    }
}

#[test]
fn poppy_stands_at_zero_and_lifts_its_arms_outward() {
    let poppy = robot("poppy-humanoid").unwrap();
    let standing = links(&poppy, |_| 0.0);
    for (side, y) in [("r", -1.0), ("l", 1.0)] {
        // The URDF: thigh 182 mm, shank 180 mm, upper arm 36.25 + 111.75 mm.
        let from = |a: &str, b: &str| {
            let at = |name: &str| standing[&format!("{side}_{name}")].0;
            add(at(b), at(a).map(|v| -v))
        };
        close(from("hip_y", "knee_y"), [0.0, 0.0, -0.182], 1e-6);
        close(from("knee_y", "ankle_y"), [0.0, 0.0, -0.180], 1e-6);
        let arm = from("shoulder_x", "elbow_y");
        assert!((arm[2] + 0.148).abs() < 1e-4 && arm[1].abs() < 0.02, "{arm:?}");
        // l_shoulder_x goes from -20 to 195 degrees: positive is away from the body.
        let lifted =
            links(&poppy, |joint| if joint == format!("{side}_shoulder_x") { y } else { 0.0 });
        let elbow = lifted[&format!("{side}_elbow_y")].0;
        assert!(elbow[1] * y > 0.2, "{elbow:?}");
    }
    let lines = |line| poppy.joints_on(line).count();
    assert_eq!((lines("upper"), lines("lower")), (15, 10));
    // The JSON: l_hip_y direct with 2 degrees of offset, limits -104 to 84 of the servo.
    let hip = poppy.joint("l_hip_y").unwrap();
    assert!((hip.lower_rad.to_degrees() + 106.0).abs() < 1e-3, "{}", hip.lower_rad);
    assert!((hip.upper_rad.to_degrees() - 82.0).abs() < 1e-3, "{}", hip.upper_rad);
}

#[test]
fn toddlerbot_stands_as_high_as_its_configuration_says() {
    let robot = robot("toddlerbot").unwrap();
    let height = |angles: &dyn Fn(&str) -> f64| {
        let links = links(&robot, angles);
        -links["left_ank_pitch"].0[2]
    };
    let straight = height(&|_| 0.0);
    let default = height(&|joint| robot.joint(joint).unwrap().initial_rad());
    // config.json: torso_z 0.33605, default_torso_z 0.3267.
    assert!((straight - default - (0.33605 - 0.3267)).abs() < 1e-3, "{straight} {default}");
    let start = links(&robot, |joint| robot.joint(joint).unwrap().initial_rad());
    let (_, sole) = start["right_ank_roll"];
    close(apply(&sole, [0.0, 0.0, 1.0]), [0.0, 0.0, 1.0], 0.02);
    // The elbows bend forward from N pose.
    let bent = |joint: &str| if joint == "left_elbow_roll" { 1.0 } else { n_pose(&robot, joint) };
    let links = links(&robot, bent);
    let (elbow, wrist) = (links["left_elbow_roll"].0, links["left_wrist_pitch"].0);
    assert!(wrist[0] > elbow[0] + 0.04, "{elbow:?} {wrist:?}");
}

#[test]
fn toddlerbots_geared_joints_turn_by_the_gears_and_its_axes_share_cases() {
    let robot = robot("toddlerbot").unwrap();
    assert_eq!(robot.joints.len(), 30);
    let gear = |name: &str| robot.joint(name).unwrap().gear;
    // 20 teeth on 22 at the neck, 18 on 21 at the hips.
    assert!((gear("neck_yaw") - 20.0 / 22.0).abs() < 1e-7);
    assert!((gear("left_hip_yaw") - 18.0 / 21.0).abs() < 1e-7);
    assert_eq!(gear("left_knee"), 1.0, "a parallelogram");
    let two_axes = robot.joints.iter().filter(|joint| joint.servo.starts_with('2'));
    assert!(two_axes.clone().all(|joint| joint.shares_case_with.is_some()));
    assert_eq!(two_axes.count(), 16, "eight cases");
    assert!(robot.joints.iter().all(|joint| robot.setup_for(joint).1["Operating Mode"] == 4));
    // The waist carries nothing in the tree.
    let carried = |name: &str| robot.joints.iter().any(|j| j.parent.as_deref() == Some(name));
    assert!(!carried("waist_act_1") && !carried("waist_act_2"));
}

#[test]
fn so101_reaches_forward_and_its_n_pose_hangs_down() {
    for name in ["so101", "so101-leader"] {
        let arm = robot(name).unwrap();
        let at = |angles: &dyn Fn(&str) -> f64| {
            let links = links(&arm, angles);
            ["shoulder_lift", "elbow_flex", "wrist_flex"].map(|joint| links[joint].0)
        };
        let [shoulder, elbow, wrist] = at(&|_| 0.0);
        let length =
            |a: Vector, b: Vector| add(b, a.map(|v| -v)).iter().map(|v| v * v).sum::<f64>().sqrt();
        // so101_new_calib.urdf: (112.57, 28) mm and (134.9, 5.2) mm.
        assert!((length(shoulder, elbow) - 0.1160).abs() < 1e-4);
        assert!((length(elbow, wrist) - 0.1350).abs() < 1e-4);
        assert!(elbow[2] > shoulder[2] + 0.1 && wrist[0] > elbow[0] + 0.13);
        let [shoulder, elbow, wrist] = at(&|joint| n_pose(&arm, joint));
        close(add(elbow, shoulder.map(|v| -v)), [0.0, 0.0, -0.1160], 1e-4);
        close(add(wrist, elbow.map(|v| -v)), [0.0, 0.0, -0.1350], 1e-4);
    }
    let gearing = |name| -> Vec<String> {
        robot(name).unwrap().joints.iter().map(|joint| joint.servo.clone()).collect()
    };
    assert!(gearing("so101").iter().all(|servo| servo == "sts3215-c001"));
    let mixed = ["c044", "c001", "c044", "c046", "c046", "c046"];
    assert_eq!(gearing("so101-leader"), mixed.map(|gear| format!("sts3215-{gear}")));
}

// Lengths between the joints' axes, by the numbers of the models' own frames, which are turned against ours.
#[test]
fn so100_and_koch_reach_as_far_as_their_public_models_do() {
    let length = |v: Vector| v.iter().map(|v| v * v).sum::<f64>().sqrt();
    let arm = |name: &str, angles: &dyn Fn(&str) -> f64| {
        let links = links(&robot(name).unwrap(), angles);
        ["shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "gripper"]
            .map(|joint| links[joint].0)
    };
    let bent = |joint: &str| if joint == "wrist_roll" { 0.0 } else { 0.3 };
    for (name, lengths) in [
        // so100.urdf: (0.1025, 0.0306), (0.11257, 0.028), (0.0052, 0.1349), and 0.0601 with (0.0202, 0.0244).
        ("so100", [[0.1025, 0.0306], [0.11257, 0.028], [0.0052, 0.1349], [0.0845, 0.0202]]),
        // low_cost_robot_arm.xml, and the gripper (-0.045 - 0.01315, 0.013097 - 0.0075, 0.0145).
        ("koch", [[0.0209, 0.0154], [0.1083, 0.016164], [0.10048, 0.0027], [0.05815, 0.015543]]),
    ] {
        for angles in [&|_: &str| 0.0, &bent] as [&dyn Fn(&str) -> f64; 2] {
            let joints = arm(name, angles);
            let pairs = joints.iter().zip(&joints[1..]);
            for ((from, to), part) in pairs.zip(lengths) {
                let found = length(add(*to, from.map(|v| -v)));
                let told = length([part[0], part[1], 0.0]);
                assert!((found - told).abs() < 2e-5, "{name}: {found} m is not {told} m");
            }
        }
    }
    // At zero the SO-100 is folded up, its jaw ahead of the base; the Koch is stretched out ahead.
    let [pan, .., gripper] = arm("so100", &|_| 0.0);
    assert!(gripper[0] - pan[0] > 0.1 && gripper[1].abs() < 1e-6, "{gripper:?}");
    let [pan, lift, elbow, wrist, gripper] = arm("koch", &|_| 0.0);
    assert!(elbow[2] > lift[2] + 0.1 && wrist[0] > elbow[0] + 0.1 && gripper[0] > pan[0] + 0.1);
    // The SO-100's upper arm goes up and over as its angle grows; the Koch's leans forward as it falls.
    let [_, _, leaning, ..] =
        arm("koch", &|joint| if joint == "shoulder_lift" { -0.5 } else { 0.0 });
    assert!(leaning[0] > elbow[0] + 0.04, "{leaning:?}");
    let [_, lift, up, ..] = arm("so100", &|joint| if joint == "shoulder_lift" { 1.8 } else { 0.0 });
    assert!(up[2] - lift[2] > 0.1, "{up:?}");
}

#[test]
fn arms_of_lerobot_have_the_middle_of_their_ranges_where_its_calibration_puts_it() {
    for name in ["koch", "koch-leader", "so100", "so101", "lekiwi"] {
        for joint in &robot(name).unwrap().joints {
            // wrist_roll and the wheels count a whole turn; the SO-101's and so the LeKiwi's other zeros are its model's.
            let middle = (joint.lower_rad + joint.upper_rad) / 2.0;
            let is_so101 = ["so101", "lekiwi"].contains(&name);
            let expected = if is_so101 { 0.0 } else { -middle };
            assert!((joint.offset_rad - expected).abs() < 1e-6, "{name} {}", joint.name);
        }
    }
}

#[test]
fn no_robot_asks_a_joint_for_more_than_its_servo_gives() {
    for name in robot_names() {
        for joint in &robot(name).unwrap().joints {
            // No profile of an actuator says how fast it is.
            if actuator(&joint.servo).is_err() {
                let fastest = servo(&joint.servo).unwrap().motor.no_load_speed_rad_s * joint.gear;
                let share = joint.velocity_rad_s / fastest;
                assert!((0.5..=1.0).contains(&share), "{name} {}: {share}", joint.name);
            }
            assert!(
                joint.axis.iter().flatten().all(|value| value.abs() <= 1.0),
                "{name} {}",
                joint.name
            );
            let (low, high) = (joint.lower_rad, joint.upper_rad);
            assert!(low >= -2.0 * PI && high <= 2.0 * PI, "{name} {}: {low} {high}", joint.name);
        }
    }
}

// berkeley_humanoid_lite.urdf: the lengths of thigh and shank are those of the joints' origins in
// the rotated frames there, (0, 0.15, 0.018) and (0, 0.16, 0.003); of the arm 0.123 + 0.043 m.
#[test]
fn berkeley_humanoid_lite_has_its_makers_limbs_and_hangs_its_arms_in_n_pose() {
    let lite = robot("berkeley-humanoid-lite").unwrap();
    let at_zero = links(&lite, |_| 0.0);
    let between = |a: &str, b: &str| add(at_zero[b].0, at_zero[a].0.map(|v| -v));
    for (side, y) in [("left", 1.0), ("right", -1.0)] {
        let joint = |name: &str| format!("{side}_{name}");
        let thigh = between(&joint("hip_pitch"), &joint("knee_pitch"));
        close(thigh, [0.0, -0.018 * y, -0.15], 1e-5);
        let shank = between(&joint("knee_pitch"), &joint("ankle_pitch"));
        close(shank, [0.0, -0.003 * y, -0.16], 1e-5);
    }
    let hanging = links(&lite, |joint| n_pose(&lite, joint));
    for side in ["left", "right"] {
        let [upper, lower, wrist] = ["shoulder_yaw", "elbow_pitch", "elbow_roll"]
            .map(|name| hanging[&format!("{side}_{name}")].0);
        // Straight down, but for what the joints stand to the side: (0.0245, 0, 0.043) and
        // (0, 0.123, -0.0255) in the file.
        let inward = if side == "left" { -0.0245 } else { 0.0245 };
        close(add(lower, upper.map(|v| -v)), [0.0, inward, -0.043], 1e-4);
        close(add(wrist, lower.map(|v| -v)), [0.0, -inward / 0.0245 * 0.0255, -0.123], 1e-4);
    }
}

#[test]
fn op2_weighs_what_its_maker_says_and_starts_over_its_soles() {
    let op2 = robot("op2").unwrap();
    let placed = links(&op2, |joint| op2.joint(joint).unwrap().initial_rad());
    let (mut mass_kg, mut moment, mut sole) = (0.0, [0.0; 3], Vec::new());
    for link in &op2.body.as_ref().expect("a body").links {
        let at = |point: Vector| {
            link.joint.as_ref().map_or(point, |joint| {
                let (origin, turn) = &placed[joint];
                add(*origin, apply(turn, point))
            })
        };
        mass_kg += link.mass_kg;
        moment = add(moment, at(link.centre_m).map(|v| v * link.mass_kg));
        sole.extend(link.sole_m.iter().flatten().map(|corner| at(*corner)));
    }
    // The e-Manual: 2.9 kg.
    assert!((mass_kg - 2.9).abs() < 0.05, "{mass_kg}");
    let [x, y, _] = moment.map(|v| v / mass_kg);
    assert!(y.abs() < 0.002, "{y}");
    assert_eq!(sole.len(), 8);
    let heel = sole.iter().map(|v| v[0]).fold(f64::MAX, f64::min);
    let toe = sole.iter().map(|v| v[0]).fold(f64::MIN, f64::max);
    assert!(x - heel > 0.03 && toe - x > 0.03, "{heel} {x} {toe}");
    assert!(sole.iter().all(|v| (v[2] - sole[0][2]).abs() < 1e-4), "level");
}

#[test]
fn berkeley_humanoid_lite_has_two_arms_and_two_legs_on_lines_of_their_own() {
    let lite = robot("berkeley-humanoid-lite").unwrap();
    let ids = |line| lite.joints_on(line).map(|joint| joint.id).collect::<Vec<_>>();
    assert_eq!(ids("left_arm"), [1, 3, 5, 7, 9]);
    assert_eq!(ids("right_arm"), [2, 4, 6, 8, 10]);
    assert_eq!(ids("left_leg"), [1, 3, 5, 7, 11, 13]);
    assert_eq!(ids("right_leg"), [2, 4, 6, 8, 12, 14]);
    for line in &lite.lines {
        assert!(matches!(line.kind, LineKind::Can(speed) if speed.bitrate_bps == 1_000_000));
    }
    // robot.py, joint_axis_directions, left leg and right.
    let directions = |line| lite.joints_on(line).map(|joint| joint.direction).collect::<Vec<_>>();
    assert_eq!(directions("left_leg"), [-1, 1, -1, -1, -1, 1]);
    assert_eq!(directions("right_leg"), [-1, 1, 1, 1, 1, 1]);
}
