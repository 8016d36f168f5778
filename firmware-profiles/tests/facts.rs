//! Facts of the shipped profiles against the makers' documents and public models, and the
//! questions a driver asks of them.

use gaitway_profiles::{
    Access, Encoding, Profile, Protocol, Region, Register, Role, Servo, Unit, adapter_for_usb,
    profile, robot, servo, servo_names,
};
use std::f64::consts::PI;

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

/// Facts that differ between the models of a family, as their e-Manual pages print them: number,
/// Velocity Limit(44), Current Limit(38) with its unit in mA, voltage limits in 0.1 V, Position P
/// Gain(84), speed without load in rev/min.
type Page = (&'static str, u16, i64, Option<(i64, f64)>, (i64, i64), i64, f64);
const PAGES: [Page; 22] = [
    ("xl330-m077", 1190, 1620, Some((1750, 1.0)), (35, 70), 400, 383.0),
    ("xl330-m288", 1200, 445, Some((1750, 1.0)), (35, 70), 400, 103.0),
    ("xc330-t181", 1210, 510, Some((910, 1.0)), (55, 140), 900, 104.0),
    ("xc330-t288", 1220, 320, Some((910, 1.0)), (55, 140), 900, 65.0),
    ("xc330-m181", 1230, 545, Some((2352, 1.0)), (35, 70), 1200, 129.0),
    ("xc330-m288", 1240, 350, Some((2352, 1.0)), (35, 70), 1100, 81.0),
    ("xl430-w250", 1060, 265, None, (60, 140), 640, 57.0),
    ("xc430-w150", 1070, 460, None, (60, 160), 460, 106.0),
    ("xc430-w240", 1080, 306, None, (60, 160), 700, 70.0),
    ("2xl430-w250", 1090, 250, None, (60, 140), 640, 57.0),
    ("2xc430-w250", 1160, 275, None, (60, 160), 700, 64.0),
    ("xh430-w350", 1000, 130, Some((648, 2.69)), (95, 160), 900, 30.0),
    ("xh430-w210", 1010, 210, Some((648, 2.69)), (95, 160), 900, 50.0),
    ("xm430-w350", 1020, 200, Some((1193, 2.69)), (95, 160), 800, 46.0),
    ("xm430-w210", 1030, 330, Some((1193, 2.69)), (95, 160), 800, 77.0),
    ("xh430-v350", 1040, 135, Some((689, 1.34)), (110, 300), 800, 31.0),
    ("xh430-v210", 1050, 230, Some((689, 1.34)), (110, 300), 800, 52.0),
    ("xm540-w270", 1120, 128, Some((2047, 2.69)), (95, 160), 800, 30.0),
    ("xm540-w150", 1130, 230, Some((2047, 2.69)), (95, 160), 800, 53.0),
    ("mx-28-2", 30, 230, None, (95, 160), 850, 55.0),
    ("mx-64-2", 311, 285, Some((1941, 3.36)), (95, 160), 850, 63.0),
    ("mx-106-2", 321, 210, Some((2047, 3.36)), (95, 160), 850, 45.0),
];

#[test]
fn each_dynamixel_differs_from_its_base_as_its_page_says() {
    for (name, number, velocity, current, (low, high), p_gain, rpm) in PAGES {
        let servo = servo(name).unwrap();
        let initial = |role| register(servo, role).initial.unwrap();
        assert_eq!((servo.model_number, servo.protocol), (number, Protocol::Dynamixel2), "{name}");
        assert_eq!(initial(Role::VelocityLimit), velocity, "{name}");
        // The limit is near the speed without load: nobody sets it to half or double of that.
        let limit_rpm = velocity as f64 * 0.229;
        assert!((0.9..1.15).contains(&(limit_rpm / rpm)), "{name}: {limit_rpm} of {rpm} rev/min");
        assert!((servo.motor.no_load_speed_rad_s * 30.0 / PI - rpm).abs() < 0.01, "{name}");
        let limits = (initial(Role::MinVoltageLimit), initial(Role::MaxVoltageLimit));
        assert_eq!(limits, (low, high), "{name}");
        assert_eq!(initial(Role::PositionPGain), p_gain, "{name}");
        let limit = servo.register(Role::CurrentLimit);
        assert_eq!(limit.map(|r| r.initial.unwrap()), current.map(|(raw, _)| raw), "{name}");
        for role in [Role::CurrentLimit, Role::GoalCurrent, Role::PresentCurrent] {
            let scale = servo.register(role).map(|r| (r.scale.unwrap() * 1e6).round());
            assert_eq!(scale, current.map(|(_, ma)| (ma * 1e3_f64).round()), "{name} {role:?}");
        }
        assert_eq!(servo.register(Role::PresentLoad).is_some(), current.is_none(), "{name}");
        // The addresses are those of the whole generation.
        assert_eq!(address_and_size(servo, Role::GoalPosition), (116, 4), "{name}");
        assert_eq!(address_and_size(servo, Role::PresentPosition), (132, 4), "{name}");
        let pwm_slope = servo.register(Role::PwmSlope).is_some();
        assert_eq!(pwm_slope, name.starts_with("xl330") || name.starts_with("xc330"), "{name}");
        let acceleration_limit = servo.register(Role::AccelerationLimit).is_some();
        assert_eq!(acceleration_limit, name.starts_with("mx"), "{name}");
    }
}

#[test]
fn operating_modes_are_those_of_the_pages() {
    let values = |name: &str| -> Vec<u8> {
        servo(name).unwrap().operating_modes.iter().map(|mode| mode.value).collect()
    };
    for (name, .., current, _, _, _) in PAGES {
        let all: &[u8] = if current.is_some() { &[0, 1, 3, 4, 5, 16] } else { &[1, 3, 4, 16] };
        assert_eq!(values(name), all, "{name}");
    }
    assert_eq!(values("xl320"), [1, 2]);
    assert_eq!(values("sts3215"), [0, 1, 2, 3]);
    assert_eq!(values("sm8512bl"), [0, 1, 2]);
    for name in ["ax-12a", "mx-28", "scs0009"] {
        assert!(values(name).is_empty(), "{name}: the angle limits choose");
    }
}

#[test]
fn later_instructions_are_known_by_the_firmware_they_came_with() {
    let of = |name: &str| {
        let servo = servo(name).unwrap();
        let (fast, clear) = (servo.fast_sync_read_from_firmware, servo.clear_from_firmware);
        (fast, clear, servo.backup_from_firmware)
    };
    assert_eq!(of("xm430-w350"), (Some(45), Some(42), Some(45)));
    assert_eq!(of("xc330-t288"), (Some(46), Some(42), Some(46)));
    // Not with two axes in a case, and no page promises it for MX.
    assert_eq!(of("2xl430-w250"), (None, Some(42), None));
    assert_eq!(of("mx-64-2"), (None, Some(42), None));
    for name in ["xl320", "ax-12a", "mx-28", "sts3215", "scs15"] {
        assert_eq!(of(name), (None, None, None), "{name}");
    }
}

#[test]
fn xl320_speaks_protocol_2_over_a_table_in_the_manner_of_1() {
    let servo = servo("xl320").unwrap();
    assert_eq!((servo.model_number, servo.protocol), (350, Protocol::Dynamixel2));
    for (role, address, bytes) in [
        (Role::FirmwareVersion, 2, 1),
        (Role::Id, 3, 1),
        (Role::MinPositionLimit, 6, 2),
        (Role::OperatingMode, 11, 1),
        (Role::TemperatureLimit, 12, 1),
        (Role::MaxTorque, 15, 2),
        (Role::StatusReturnLevel, 17, 1),
        (Role::TorqueEnable, 24, 1),
        (Role::PositionDGain, 27, 1),
        (Role::PositionPGain, 29, 1),
        (Role::GoalPosition, 30, 2),
        (Role::GoalVelocity, 32, 2),
        (Role::TorqueLimit, 35, 2),
        (Role::PresentPosition, 37, 2),
        (Role::PresentVoltage, 45, 1),
        (Role::PresentTemperature, 46, 1),
        (Role::HardwareError, 50, 1),
        (Role::Punch, 51, 2),
    ] {
        assert_eq!(address_and_size(servo, role), (address, bytes), "{role:?}");
    }
    assert_eq!((servo.baud_index(1_000_000), servo.baud_index(2_000_000)), (Some(3), None));
    assert!((servo.motor.no_load_speed_rad_s * 30.0 / PI - 114.0).abs() < 0.01);
}

#[test]
fn servos_with_two_axes_keep_only_what_their_pages_have() {
    for name in ["2xl430-w250", "2xc430-w250"] {
        let servo = servo(name).unwrap();
        assert!(servo.register(Role::StartupConfiguration).is_none(), "{name}");
        assert!(servo.register(Role::BackupReady).is_none(), "{name}");
        assert_eq!(register(servo, Role::DriveMode).max, Some(5), "{name}");
    }
    let ports = servo("xm540-w270").unwrap();
    assert_eq!(ports.register_named("External Port Mode 3").unwrap().address, 58);
    assert_eq!(ports.register_named("External Port Data 1").unwrap().address, 152);
}

#[test]
fn gearings_of_the_sts3215_differ_in_the_motor_and_not_in_the_table() {
    let plain = servo("sts3215").unwrap();
    for (name, ratio, volts, kg_cm) in [
        ("sts3215-c001", 345.0, 7.4, Some(19.5)),
        ("sts3215-c044", 191.0, 7.4, None),
        ("sts3215-c046", 147.0, 7.4, None),
        ("sts3215-c018", 345.0, 12.0, Some(30.0)),
        ("sts3215-c047", 345.0, 12.0, Some(30.0)),
    ] {
        let servo = servo(name).unwrap();
        assert_eq!((servo.model_number, servo.motor.voltage_v), (777, volts), "{name}");
        assert_eq!(servo.items().count(), plain.items().count(), "{name}");
        if let Some(kg_cm) = kg_cm {
            assert!((servo.motor.stall_torque_nm - kg_cm * 0.0980665).abs() < 5e-3, "{name}");
        }
        if volts == 7.4 {
            // Speed goes with the gears to a tenth: the figures come from two sellers.
            let expected = plain.motor.no_load_speed_rad_s * 345.0 / ratio;
            let found = servo.motor.no_load_speed_rad_s;
            assert!((found / expected - 1.0).abs() < 0.1, "{name}: {found} for {expected}");
        }
    }
    // major, minor of the maker's list.
    for (name, bytes) in
        [("sts3250", [9, 11]), ("sts3032", [9, 2]), ("sm8512bl", [8, 44]), ("sm40bl", [8, 40])]
    {
        assert_eq!(servo(name).unwrap().model_number.to_le_bytes(), bytes, "{name}");
    }
    let brushless = servo("sm8512bl").unwrap();
    assert_eq!((brushless.baud_bps(4), brushless.baud_bps(11)), (Some(115_200), Some(4_800)));
    assert_eq!(register(brushless, Role::BaudRate).initial, Some(4));
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
    assert_eq!(adapter_for_usb(0x0403, 0x6001).unwrap().unwrap().name, "usb2dynamixel");
    assert_eq!(adapter_for_usb(0xfff1, 0xff48).unwrap().unwrap().name, "opencm904");
    // A board that may be something else says so.
    let opencr = adapter_for_usb(0x0483, 0x5740).unwrap().unwrap();
    assert!(opencr.ambiguous.as_deref().is_some_and(|text| text.contains("moteus")));
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

#[test]
fn unconfirmed_facts_are_listed_with_their_place_and_all_others_are_not() {
    let scs = servo("scs0009").unwrap();
    let listed = scs.unconfirmed();
    let acceleration = listed.iter().find(|fact| fact.place == "register Acceleration(41)");
    assert!(acceleration.is_some_and(|fact| fact.source.starts_with("unconfirmed: ")));
    let marked = scs.registers.iter().filter(|r| r.source.contains("unconfirmed")).count();
    assert_eq!(listed.len(), marked, "neither position nor motor are in doubt");
    assert!(servo("xm540-w270").unwrap().unconfirmed().is_empty());
    // What a base does not know, nobody who extends it knows by silence.
    let doubtful = |name: &str| servo(name).unwrap().unconfirmed().len();
    assert!(doubtful("sts3215-c018") > 10 && servo_names().any(|name| doubtful(name) == 0));
    let Profile::Robot(arm) = profile("so101").unwrap() else { panic!("not a robot") };
    assert!(arm.unconfirmed().iter().any(|fact| fact.place == "source"));
}
