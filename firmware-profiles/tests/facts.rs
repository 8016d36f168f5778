//! Facts of the shipped profiles against the makers' documents and public models, and the
//! questions a driver asks of them.

use gaitway_profiles::{
    Access, Encoding, Protocol, Region, Register, Robot, Role, Segment, Servo, Unit,
    adapter_for_usb, robot, servo,
};
use std::collections::BTreeMap;
use std::f64::consts::{FRAC_PI_2, PI};

fn register(servo: &Servo, role: Role) -> &Register {
    servo.register(role).unwrap_or_else(|| panic!("{} has no {role:?}", servo.name))
}

fn address_and_size(servo: &Servo, role: Role) -> (u16, u8) {
    let register = register(servo, role);
    (register.address, register.bytes)
}

// Servos. Sources: ROBOTIS e-Manual pages of the models; for Feetech lerobot feetech/tables.py and
// SCServo_Linux SMS_STS.h.

#[test]
fn xm430_w350_is_the_table_of_its_e_manual_page() {
    let servo = servo("xm430-w350").unwrap();
    assert_eq!((servo.model_number, servo.protocol), (1020, Protocol::Dynamixel2));
    let goal = register(servo, Role::GoalPosition);
    assert_eq!((goal.address, goal.bytes, goal.encoding), (116, 4, Encoding::I32));
    assert_eq!((goal.region, goal.access, goal.unit), (Region::Ram, Access::Rw, Unit::Turn));
    assert_eq!(address_and_size(servo, Role::TorqueEnable), (64, 1));
    assert_eq!(address_and_size(servo, Role::HardwareError), (70, 1));
    assert_eq!(address_and_size(servo, Role::PositionPGain), (84, 2));
    assert_eq!(address_and_size(servo, Role::Feedforward2ndGain), (88, 2));
    assert_eq!(address_and_size(servo, Role::Feedforward1stGain), (90, 2));
    assert_eq!(address_and_size(servo, Role::BusWatchdog), (98, 1));
    assert_eq!(address_and_size(servo, Role::ProfileVelocity), (112, 4));
    assert_eq!(address_and_size(servo, Role::PresentCurrent), (126, 2));
    assert_eq!(address_and_size(servo, Role::PresentVelocity), (128, 4));
    assert_eq!(address_and_size(servo, Role::PresentPosition), (132, 4));
    let limit = register(servo, Role::CurrentLimit);
    assert_eq!((limit.address, limit.initial, limit.scale), (38, Some(1193), Some(0.00269)));
    assert_eq!(register(servo, Role::VelocityLimit).initial, Some(200));
    assert_eq!(register(servo, Role::PositionPGain).initial, Some(800));
    assert_eq!(register(servo, Role::Shutdown).initial, Some(52));
    assert!(servo.register(Role::AccelerationLimit).is_none(), "MX only");
    // No-load speed 46 rev/min at 12 V.
    assert!((servo.motor.no_load_speed_rad_s * 60.0 / (2.0 * PI) - 46.0).abs() < 0.01);
}

#[test]
fn xl430_w250_measures_load_where_others_measure_current() {
    let servo = servo("xl430-w250").unwrap();
    assert_eq!(servo.model_number, 1060);
    let load = register(servo, Role::PresentLoad);
    assert_eq!(
        (load.address, load.bytes, load.scale, load.unit),
        (126, 2, Some(0.001), Unit::Ratio)
    );
    for role in [Role::PresentCurrent, Role::GoalCurrent, Role::CurrentLimit] {
        assert!(servo.register(role).is_none(), "{role:?}");
    }
    assert_eq!(register(servo, Role::PositionDGain).initial, Some(4000));
    assert_eq!(register(servo, Role::MinVoltageLimit).initial, Some(60));
    assert_eq!(servo.baud_index(4_500_000), Some(7));
}

#[test]
fn xl330_m288_has_twenty_indirect_items_and_a_pwm_slope() {
    let servo = servo("xl330-m288").unwrap();
    assert_eq!(servo.model_number, 1200);
    let address = register(servo, Role::IndirectAddress);
    assert_eq!((address.address, address.item_count(), address.end()), (168, 20, 208));
    let data = register(servo, Role::IndirectData);
    assert_eq!((data.address, data.item_count(), servo.table_len()), (208, 20, 228));
    let slope = servo.register_named("PWM Slope").unwrap();
    assert_eq!((slope.address, slope.initial()), (62, Some(140)));
    assert_eq!(register(servo, Role::Shutdown).initial, Some(53));
    assert_eq!(register(servo, Role::VelocityLimit).max, Some(2047));
    assert_eq!(servo.baud_index(4_500_000), None, "4 Mbps is the fastest");
    assert_eq!(servo.baud_index(4_000_000), Some(6));
}

#[test]
fn dynamixel_speeds_are_in_the_manuals_unit_and_baud_rates_in_its_order() {
    for name in ["xm430-w350", "xl430-w250", "xl330-m288"] {
        let servo = servo(name).unwrap();
        for role in [Role::PresentVelocity, Role::ProfileVelocity, Role::VelocityLimit] {
            let register = register(servo, role);
            assert_eq!((register.unit, register.scale), (Unit::Rpm, Some(0.229)), "{name}");
        }
        let rates: Vec<_> = (0..=6).map(|index| servo.baud_bps(index)).collect();
        let expected = [9_600, 57_600, 115_200, 1_000_000, 2_000_000, 3_000_000, 4_000_000];
        assert_eq!(rates, expected.map(Some), "{name}");
        assert!((servo.radians_per_count() - PI / 2048.0).abs() < 1e-15);
    }
}

#[test]
fn sts3215_has_sign_magnitude_values_with_the_sign_bit_of_each() {
    let servo = servo("sts3215").unwrap();
    assert_eq!((servo.model_number, servo.protocol), (777, Protocol::FeetechSts));
    assert_eq!(servo.model_number.to_le_bytes(), [9, 3], "major 9, minor 3");
    for (role, address, encoding) in [
        (Role::HomingOffset, 31, Encoding::SignMagnitude11),
        (Role::GoalPosition, 42, Encoding::SignMagnitude15),
        (Role::GoalVelocity, 46, Encoding::SignMagnitude15),
        (Role::PresentPosition, 56, Encoding::SignMagnitude15),
        (Role::PresentVelocity, 58, Encoding::SignMagnitude15),
        (Role::PresentLoad, 60, Encoding::SignMagnitude10),
        (Role::PresentCurrent, 69, Encoding::SignMagnitude15),
    ] {
        let register = register(servo, role);
        assert_eq!((register.address, register.bytes), (address, 2), "{role:?}");
        assert_eq!(register.encoding, encoding, "{role:?}");
    }
    assert_eq!(address_and_size(servo, Role::ModelNumber), (3, 2));
    assert_eq!(address_and_size(servo, Role::EepromLock), (55, 1));
    // The gains stand in the order P, D, I.
    assert_eq!(address_and_size(servo, Role::PositionPGain), (21, 1));
    assert_eq!(address_and_size(servo, Role::PositionDGain), (22, 1));
    assert_eq!(address_and_size(servo, Role::PositionIGain), (23, 1));
    let acceleration = register(servo, Role::ProfileAcceleration);
    assert_eq!((acceleration.address, acceleration.bytes), (41, 1));
    assert_eq!((acceleration.unit, acceleration.scale), (Unit::CountPerSecond2, Some(100.0)));
    assert_eq!((servo.baud_index(1_000_000), servo.baud_bps(4)), (Some(0), Some(115_200)));
    assert_eq!(Encoding::SignMagnitude11.range(), (-2047, 2047));
    assert_eq!(Encoding::SignMagnitude10.range(), (-1023, 1023));
}

#[test]
fn ax_12a_is_the_table_of_its_e_manual_page() {
    let servo = servo("ax-12a").unwrap();
    assert_eq!((servo.model_number, servo.protocol), (12, Protocol::Dynamixel1));
    for (role, address, bytes, initial) in [
        (Role::ReturnDelay, 5, 1, Some(250)),
        (Role::MinPositionLimit, 6, 2, Some(0)),
        (Role::MaxPositionLimit, 8, 2, Some(1023)),
        (Role::TemperatureLimit, 11, 1, Some(70)),
        (Role::MinVoltageLimit, 12, 1, Some(60)),
        (Role::MaxVoltageLimit, 13, 1, Some(140)),
        (Role::MaxTorque, 14, 2, Some(1023)),
        (Role::StatusReturnLevel, 16, 1, Some(2)),
        (Role::AlarmLed, 17, 1, Some(36)),
        (Role::Shutdown, 18, 1, Some(36)),
        (Role::TorqueEnable, 24, 1, Some(0)),
        (Role::CwComplianceMargin, 26, 1, Some(1)),
        (Role::CcwComplianceSlope, 29, 1, Some(32)),
        (Role::GoalPosition, 30, 2, None),
        (Role::GoalVelocity, 32, 2, None),
        (Role::PresentPosition, 36, 2, None),
        (Role::PresentVelocity, 38, 2, None),
        (Role::PresentLoad, 40, 2, None),
        (Role::PresentVoltage, 42, 1, None),
        (Role::PresentTemperature, 43, 1, None),
        (Role::EepromLock, 47, 1, Some(0)),
        (Role::Punch, 48, 2, Some(32)),
    ] {
        let register = register(servo, role);
        let found = (register.address, register.bytes, register.initial);
        assert_eq!(found, (address, bytes, initial), "{role:?}");
    }
    assert_eq!(register(servo, Role::PresentVelocity).encoding, Encoding::SignMagnitude10);
    assert_eq!(register(servo, Role::GoalVelocity).scale, Some(0.111));
    assert!((servo.radians_per_count().to_degrees() - 0.293).abs() < 1e-3, "0.29 degrees");
    assert!(!servo.bulk_read && servo.operating_modes.is_empty());
    assert!((servo.motor.no_load_speed_rad_s * 60.0 / (2.0 * PI) - 59.0).abs() < 0.01);
}

#[test]
fn mx_servos_with_protocol_1_differ_by_current_drive_mode_and_number() {
    for (name, number, stall_nm) in [("mx-28", 29, 2.5), ("mx-64", 310, 6.0), ("mx-106", 320, 8.4)]
    {
        let servo = servo(name).unwrap();
        assert_eq!((servo.model_number, servo.protocol), (number, Protocol::Dynamixel1), "{name}");
        assert!(servo.bulk_read, "{name}");
        assert_eq!(servo.motor.stall_torque_nm, stall_nm, "{name}");
        // The gains stand in the order D, I, P.
        assert_eq!(address_and_size(servo, Role::PositionDGain), (26, 1));
        assert_eq!(address_and_size(servo, Role::PositionIGain), (27, 1));
        let gain = register(servo, Role::PositionPGain);
        assert_eq!((gain.address, gain.initial), (28, Some(32)));
        assert_eq!(address_and_size(servo, Role::ResolutionDivider), (22, 1));
        assert_eq!(register(servo, Role::MaxPositionLimit).initial, Some(4095));
        assert_eq!(register(servo, Role::GoalVelocity).scale, Some(0.114));
        // 8.583 degrees/s2 in rev/min2: x 60 x 60 / 360.
        let acceleration = register(servo, Role::ProfileAcceleration);
        assert_eq!((acceleration.address, acceleration.scale), (73, Some(85.83)));
        assert_eq!(servo.register(Role::DriveMode).is_some(), name == "mx-106", "{name}");
        let current = servo.register(Role::PresentCurrent);
        let expected = (name != "mx-28").then_some((68, Some(2048), Some(0.0045)));
        assert_eq!(current.map(|r| (r.address, r.zero, r.scale)), expected, "{name}");
        assert_eq!(servo.register(Role::TorqueControlEnable).is_some(), name != "mx-28");
    }
}

#[test]
fn protocol_1_baud_rates_are_asked_for_by_their_nominal_speed() {
    for name in ["ax-12a", "mx-28", "mx-64", "mx-106"] {
        let servo = servo(name).unwrap();
        for (bps, index) in [(1_000_000, 1), (115_200, 16), (57_600, 34), (9_600, 207)] {
            assert_eq!(servo.baud_index(bps), Some(index), "{name}");
            // 2000000 / (value + 1), 3 % off at most, which a UART bears.
            let real = 2_000_000.0 / (f64::from(index) + 1.0);
            assert!((real / f64::from(bps) - 1.0).abs() < 0.03, "{name} {bps}");
        }
        assert_eq!(servo.baud_index(57_143), None, "{name}: the lookup is exact");
        assert_eq!(servo.baud_index(3_000_000), (name != "ax-12a").then_some(252), "{name}");
    }
}

#[test]
fn scs_servos_have_the_lock_at_48_and_no_mode_register() {
    for (name, high, low) in [("scs0009", 5, 4), ("scs15", 5, 15)] {
        let servo = servo(name).unwrap();
        assert_eq!(servo.protocol, Protocol::FeetechScs, "{name}");
        assert_eq!(servo.model_number.to_be_bytes(), [high, low], "{name}: major, minor");
        assert_eq!(address_and_size(servo, Role::EepromLock), (48, 1), "{name}");
        assert_eq!(address_and_size(servo, Role::GoalPosition), (42, 2), "{name}");
        assert_eq!(address_and_size(servo, Role::GoalTime), (44, 2), "{name}");
        assert_eq!(address_and_size(servo, Role::PresentPosition), (56, 2), "{name}");
        let limit = register(servo, Role::MaxPositionLimit);
        assert_eq!((limit.address, limit.initial), (11, Some(1023)), "{name}");
        assert_eq!(register(servo, Role::PresentLoad).encoding, Encoding::SignMagnitude10);
        assert!(servo.register(Role::OperatingMode).is_none(), "{name}");
        assert!(servo.register(Role::HomingOffset).is_none(), "{name}");
        assert_eq!((servo.baud_index(1_000_000), servo.baud_bps(5)), (Some(0), Some(76_800)));
    }
    let scs = servo("scs0009").unwrap();
    assert_eq!(scs.model_number, 1284, "lerobot MODEL_NUMBER_TABLE");
    assert!((scs.radians_per_count().to_degrees() - 300.0 / 1024.0).abs() < 1e-12);
    assert_eq!(scs.position.zero_count, 511);
}

// Accessors.

#[test]
fn repeated_registers_are_found_by_number_and_only_by_a_proper_one() {
    let servo = servo("xm430-w350").unwrap();
    for (name, address, initial) in [
        ("Indirect Address 1", 168, 224),
        ("Indirect Address 3", 172, 226),
        ("Indirect Address 28", 222, 251),
        ("Indirect Address 29", 578, 634),
        ("Indirect Address 56", 632, 661),
        ("Indirect Data 28", 251, 0),
        ("Indirect Data 56", 661, 0),
    ] {
        let item = servo.register_named(name).unwrap();
        assert_eq!((item.name().as_str(), item.address), (name, address));
        assert_eq!(item.initial(), Some(initial), "{name}");
    }
    for name in [
        "Indirect Address",
        "Indirect Address 0",
        "Indirect Address 57",
        "Indirect Address 03",
        "Indirect Address +3",
        "Indirect Address  3",
        "Indirect Address 99999999999999999999",
        "Goal Position 1",
        "goal position",
        "",
    ] {
        assert!(servo.register_named(name).is_none(), "{name:?}");
    }
    assert_eq!(servo.table_len(), 662);
    assert_eq!(servo.registers_with(Role::IndirectAddress).count(), 2);
    assert_eq!(register(servo, Role::IndirectAddress).address, 168);
}

#[test]
fn adapters_are_found_by_their_usb_ids() {
    assert_eq!(adapter_for_usb(0x0403, 0x6014).unwrap().unwrap().name, "u2d2");
    assert_eq!(adapter_for_usb(0x1a86, 0x55d3).unwrap().unwrap().name, "ch343");
    assert_eq!(adapter_for_usb(0x1a86, 0x7523).unwrap().unwrap().name, "ch340");
    assert!(adapter_for_usb(0xffff, 0xffff).unwrap().is_none());
}

#[test]
fn a_later_setup_lies_over_an_earlier_one() {
    let op3 = robot("op3").unwrap();
    for joint in &op3.joints {
        let (firmware, registers) = op3.setup_for(joint);
        let shutdown = if joint.id <= 6 { 56 } else { 52 };
        assert_eq!(registers["Shutdown"], shutdown, "{}", joint.name);
        assert_eq!((firmware, registers["Return Delay Time"]), (45, 1), "{}", joint.name);
        assert_eq!(registers["Baud Rate"], 4, "index 4 is 2 Mbps");
    }
    assert_eq!(op3.joints_on("body").count(), 20);
    assert_eq!(op3.joints_on("arms").count(), 0);
    assert!(op3.joint("r_knee").is_some() && op3.joint("R_KNEE").is_none());
}

// Robots: where the links are.

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
        let origin = add(origin, apply(&rotation, joint.origin_m));
        links.insert(
            joint.name.clone(),
            (origin, turned(&rotation, joint.axis, angle(&joint.name))),
        );
    }
    links
}

#[track_caller]
fn close(a: Vector, b: Vector, tolerance: f64) {
    for (left, right) in a.iter().zip(b) {
        assert!((left - right).abs() <= tolerance, "{a:?} is not {b:?}");
    }
}

fn n_pose(robot: &Robot, joint: &str) -> f64 {
    robot.anatomy.n_pose_rad.get(joint).copied().unwrap_or(0.0)
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
    let initial = |name: &str| op3.joint(name).unwrap().initial_rad;
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
    let starting = links(&duck, |joint| duck.joint(joint).unwrap().initial_rad);
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
        assert_eq!(robot.anatomy.base, [Segment::Pelvis, Segment::Torso], "{name}");
        for segment in [
            Segment::Head,
            Segment::LeftThigh,
            Segment::LeftShank,
            Segment::LeftFoot,
            Segment::RightThigh,
            Segment::RightShank,
            Segment::RightFoot,
        ] {
            assert!(robot.anatomy.segments.iter().any(|link| link.segment == segment), "{name}");
        }
    }
}
