//! What servos refuse, what they protect themselves from, and what they keep.

use crate::scene::{Scene, dynamixels, feetech, instruction, mixed, read, write};
use gaitway_profiles::{Protocol, Role};
use gaitway_sim::{Fault, Options};
use proptest::prelude::*;

const ANGLE_LIMIT: u8 = 1 << 1;
const OVERHEATING: u8 = 1 << 2;
const RANGE: u8 = 1 << 3;
const OVERLOAD: u8 = 1 << 5;
const STORE: [u8; 5] = [0x01, 0x43, 0x54, 0x52, 0x4C];
const RESTORE: [u8; 5] = [0x02, 0x43, 0x54, 0x52, 0x4C];

fn one(servo: &str) -> Scene {
    Scene::new(&mixed(&[(servo, 1)]))
}

/// A servo whose shaft is stuck from the start.
fn stuck(servo: &str) -> Scene {
    let joint = "j1".to_string();
    let fault = Fault::StuckPosition { joint, from_ns: 0, until_ns: u64::MAX };
    let options = Options { permit_eeprom: true, faults: vec![fault], ..Options::default() };
    Scene::with(&mixed(&[(servo, 1)]), options)
}

/// Writes bytes to ID 1 in protocol 1.0's frame; returns the error byte.
fn put(scene: &mut Scene, address: u8, bytes: &[u8]) -> u8 {
    let answer = scene.ask(&feetech(1, 3, &[&[address], bytes].concat()));
    assert_eq!(answer.len(), 6, "{address}");
    answer[4]
}

// DYNAMIXEL with protocol 1.0.

#[test]
fn a_goal_outside_the_angle_limits_is_an_angle_limit_error_and_is_not_taken() {
    let mut scene = one("ax-12a");
    put(&mut scene, 8, &800_u16.to_le_bytes());
    let before = scene.get("j1", "Goal Position");
    assert_eq!(put(&mut scene, 30, &801_u16.to_le_bytes()), ANGLE_LIMIT);
    assert_eq!(scene.get("j1", "Goal Position"), before);
    assert_eq!(put(&mut scene, 30, &800_u16.to_le_bytes()), 0);
}

#[test]
fn what_is_not_there_or_not_possible_is_a_range_error() {
    let mut scene = one("ax-12a");
    assert_eq!(put(&mut scene, 36, &[0, 0]), RANGE, "present position is read only");
    assert_eq!(put(&mut scene, 10, &[1]), RANGE, "nothing is at 10");
    assert_eq!(put(&mut scene, 49, &[0, 0]), RANGE, "beyond the table");
    assert_eq!(put(&mut scene, 24, &[2]), RANGE);
    assert_eq!(put(&mut scene, 32, &1_500_u16.to_le_bytes()), RANGE, "clockwise in joint mode");
    // Half a word may be written, reserved bytes read.
    assert_eq!(put(&mut scene, 34, &[0xFF]), 0);
    assert_eq!(scene.ask(&feetech(1, 2, &[9, 3])), feetech(1, 0, &[0x03, 0, 70]));
    assert_eq!(scene.ask(&feetech(1, 2, &[45, 10]))[4], RANGE);
}

#[test]
fn ax_eeprom_may_be_written_under_torque_until_it_is_locked_for_good() {
    let mut scene = one("ax-12a");
    put(&mut scene, 24, &[1]);
    assert_eq!(put(&mut scene, 5, &[10]), 0);
    assert_eq!(put(&mut scene, 47, &[1]), 0);
    assert_eq!(put(&mut scene, 5, &[20]), RANGE);
    assert_eq!(put(&mut scene, 47, &[0]), RANGE);
    assert_eq!(scene.get("j1", "Return Delay Time"), 10);
}

#[test]
fn heat_sets_the_torque_limit_to_0_until_it_is_written_again_when_cool() {
    let mut scene = one("mx-28");
    put(&mut scene, 24, &[1]);
    put(&mut scene, 30, &2_300_u16.to_le_bytes());
    scene.set("j1", "Present Temperature", 90);
    assert_eq!(put(&mut scene, 25, &[0]), OVERHEATING);
    assert_eq!(scene.get("j1", "Torque Limit"), 0);
    assert_eq!(scene.get("j1", "Torque Enable"), 1);
    put(&mut scene, 34, &1_023_u16.to_le_bytes());
    scene.wait_ms(10);
    assert_eq!(scene.get("j1", "Torque Limit"), 0, "it is still hot");
    scene.set("j1", "Present Temperature", 40);
    assert_eq!(put(&mut scene, 34, &1_023_u16.to_le_bytes()), 0);
    scene.wait_ms(500);
    assert!((scene.get("j1", "Present Position") - 2_300).abs() <= 4);
}

#[test]
fn an_ax_that_cannot_move_shuts_down_with_an_overload_and_blinks() {
    let mut scene = stuck("ax-12a");
    put(&mut scene, 30, &900_u16.to_le_bytes());
    scene.wait_ms(1_500);
    assert_eq!(put(&mut scene, 25, &[0]), OVERLOAD);
    assert_eq!(scene.get("j1", "Torque Limit"), 0);
    assert_eq!(scene.get("j1", "Present Load"), 0);
    let seen: Vec<_> = (0..4)
        .map(|_| {
            scene.wait_ms(500);
            scene.world.led_lit("j1").unwrap()
        })
        .collect();
    assert!(seen == [true, false, true, false] || seen == [false, true, false, true], "{seen:?}");
    assert_eq!(put(&mut scene, 34, &500_u16.to_le_bytes()), 0, "forgotten");
}

#[test]
fn an_mx_forgets_an_overload_when_its_torque_limit_is_written_not_its_torque() {
    let mut scene = stuck("mx-28");
    put(&mut scene, 24, &[1]);
    put(&mut scene, 30, &3_000_u16.to_le_bytes());
    scene.wait_ms(1_500);
    assert_eq!(put(&mut scene, 24, &[0]), OVERLOAD);
    assert_eq!(put(&mut scene, 24, &[1]), OVERLOAD);
    assert_eq!(put(&mut scene, 34, &500_u16.to_le_bytes()), 0);
}

#[test]
fn an_angle_limit_error_shuts_down_if_the_shutdown_mask_says_so() {
    let mut scene = one("mx-28");
    put(&mut scene, 8, &3_000_u16.to_le_bytes());
    put(&mut scene, 18, &[36 | ANGLE_LIMIT]);
    put(&mut scene, 24, &[1]);
    assert_eq!(put(&mut scene, 30, &3_001_u16.to_le_bytes()), ANGLE_LIMIT);
    assert_eq!(scene.get("j1", "Torque Limit"), 0);
}

// FEETECH.

#[test]
fn an_sts_that_cannot_move_keeps_only_its_protective_torque_until_torque_is_rewritten() {
    let mut scene = stuck("sts3215");
    put(&mut scene, 40, &[1]);
    put(&mut scene, 42, &3_000_u16.to_le_bytes());
    // Overload torque 80 %, protection time 200 * 10 ms.
    scene.wait_ms(1_900);
    assert!(scene.get("j1", "Present Load") > 900);
    scene.wait_ms(300);
    assert_eq!(put(&mut scene, 41, &[0]), OVERLOAD);
    assert_eq!(scene.get("j1", "Torque Enable"), 1);
    // Protective torque 20 %.
    assert_eq!(scene.get("j1", "Present Load"), 200);
    assert_eq!(put(&mut scene, 40, &[1]), 0);
    scene.wait_ms(10);
    assert!(scene.get("j1", "Present Load") > 900);
}

#[test]
fn an_sts_too_hot_lets_go_and_takes_torque_again_when_cool() {
    let mut scene = one("sts3215");
    put(&mut scene, 40, &[1]);
    scene.set("j1", "Present Temperature", 75);
    assert_eq!(put(&mut scene, 40, &[1]), OVERHEATING);
    assert_eq!(scene.get("j1", "Torque Enable"), 0);
    scene.set("j1", "Present Temperature", 40);
    assert_eq!(put(&mut scene, 40, &[1]), 0, "the bit goes with its cause");
    assert_eq!(scene.get("j1", "Torque Enable"), 1);
}

#[test]
fn an_offset_that_would_not_fit_is_taken_the_other_way_round_the_turn() {
    let mut scene = one("sts3215");
    scene.set("j1", "Homing Offset", -2000);
    scene.set("j1", "Present Position", 1000);
    // The encoder reads 1000 - 2000 + 4096 = 3096; 3096 - 1048 = 2048.
    put(&mut scene, 40, &[128]);
    assert_eq!(scene.get("j1", "Present Position"), 2048);
    assert_eq!(scene.get("j1", "Homing Offset"), 1048);
}

#[test]
fn an_scs_has_no_middle_to_set() {
    let mut scene = one("scs0009");
    scene.set("j1", "Present Position", 300);
    put(&mut scene, 40, &[128]);
    assert_eq!(scene.get("j1", "Present Position"), 300);
    assert_eq!(scene.get("j1", "Torque Enable"), 0);
}

// DYNAMIXEL 2.0.

#[test]
fn a_servo_shut_down_blinks_and_shows_it_in_moving_nothing() {
    let mut scene = stuck("xm430-w350");
    scene.ask(&write(1, 64, &[1]));
    scene.ask(&write(1, 116, &3_000_i32.to_le_bytes()));
    scene.wait_ms(1_200);
    assert_eq!(scene.get("j1", "Hardware Error Status"), 0x20);
    assert_eq!(scene.get("j1", "Torque Enable"), 0);
    assert_eq!(scene.get("j1", "Present PWM"), 0);
    let lit: Vec<_> = (0..2)
        .map(|_| {
            scene.wait_ms(500);
            scene.world.led_lit("j1").unwrap()
        })
        .collect();
    assert_ne!(lit[0], lit[1]);
}

#[test]
fn both_axes_in_a_case_must_be_limp_for_eeprom_and_share_the_line_speed() {
    let mut robot = mixed(&[("2xl430-w250", 1), ("2xl430-w250", 2)]);
    robot.joints[1].shares_case_with = Some("j1".into());
    let mut scene = Scene::new(&robot);
    assert_eq!(scene.error(&write(2, 64, &[1])), 0);
    assert_eq!(scene.error(&write(1, 9, &[10])), 7);
    assert_eq!(scene.error(&write(2, 64, &[0])), 0);
    assert_eq!(scene.error(&write(1, 9, &[10])), 0);
    assert_eq!(scene.get("j2", "Return Delay Time"), 0, "not shared");
    assert_eq!(scene.error(&write(2, 8, &[1])), 0);
    assert_eq!(scene.get("j1", "Baud Rate"), 1);
    scene.baud_bps = 57_600;
    assert_eq!(scene.tell(&instruction(1, 1, &[])).len(), 1);
}

#[test]
fn a_group_obeys_its_secondary_id_in_silence_but_not_in_eeprom() {
    // e-Manual, Secondary(Shadow) ID(12), its own example.
    let mut scene = Scene::new(&dynamixels(&[1, 2, 5]));
    for id in [1, 2, 5] {
        assert_eq!(scene.error(&write(id, 12, &[5])), 0);
    }
    let answers = scene.tell(&write(5, 65, &[1]));
    assert_eq!(answers.iter().map(|status| status.id).collect::<Vec<_>>(), [5]);
    for joint in ["j1", "j2", "j5"] {
        assert_eq!(scene.get(joint, "LED"), 1, "{joint}");
    }
    assert_eq!(scene.error(&write(5, 24, &20_u32.to_le_bytes())), 0);
    assert_eq!(scene.get("j5", "Moving Threshold"), 20);
    assert_eq!(scene.get("j1", "Moving Threshold"), 10);
    for id in [1, 2, 5] {
        scene.ask(&write(id, 12, &[100]));
    }
    assert_eq!(scene.ask(&write(100, 65, &[0])), [0_u8; 0]);
    assert_eq!(scene.get("j2", "LED"), 0);
}

#[test]
fn a_backup_brings_eeprom_gains_and_indirect_addresses_back() {
    let mut scene = Scene::new(&dynamixels(&[1]));
    assert_eq!(scene.error(&instruction(1, 0x20, &RESTORE)), 1, "there is none yet");
    assert_eq!(scene.get("j1", "Backup Ready"), 0);
    scene.ask(&write(1, 52, &500_i32.to_le_bytes()));
    scene.ask(&write(1, 84, &700_u16.to_le_bytes()));
    scene.ask(&write(1, 168, &132_u16.to_le_bytes()));
    scene.ask(&write(1, 65, &[1]));
    scene.ask(&write(1, 64, &[1]));
    assert_eq!(scene.error(&instruction(1, 0x20, &STORE)), 1, "not under torque");
    scene.ask(&write(1, 64, &[0]));
    assert_eq!(scene.error(&instruction(1, 0x20, &STORE)), 0);
    assert_eq!(scene.get("j1", "Backup Ready"), 1);
    scene.ask(&write(1, 52, &100_i32.to_le_bytes()));
    scene.ask(&write(1, 84, &900_u16.to_le_bytes()));
    assert_eq!(scene.error(&instruction(1, 0x20, &RESTORE)), 0);
    assert_eq!(scene.ask(&instruction(1, 1, &[])), [0_u8; 0], "it restarts");
    scene.wait_ms(500);
    assert_eq!(scene.get("j1", "Min Position Limit"), 500);
    assert_eq!(scene.get("j1", "Position P Gain"), 700);
    assert_eq!(scene.get("j1", "Indirect Address 1"), 132);
    assert_eq!(scene.get("j1", "LED"), 0, "not among what is kept");
}

#[test]
fn startup_configuration_brings_gains_and_torque_back_at_boot() {
    let mut scene = Scene::new(&dynamixels(&[1]));
    scene.ask(&write(1, 84, &700_u16.to_le_bytes()));
    scene.ask(&instruction(1, 0x20, &STORE));
    let reboot = |scene: &mut Scene| {
        scene.ask(&instruction(1, 0x08, &[]));
        scene.wait_ms(500);
    };
    reboot(&mut scene);
    assert_eq!(scene.get("j1", "Position P Gain"), 800);
    scene.ask(&write(1, 60, &[0x03]));
    reboot(&mut scene);
    assert_eq!(scene.get("j1", "Position P Gain"), 700);
    assert_eq!(scene.get("j1", "Torque Enable"), 1);
    assert!((scene.get("j1", "Present Position") - 2048).abs() <= 2, "it holds where it is");
}

#[test]
fn a_firmware_without_backup_calls_it_an_undefined_instruction() {
    let mut scene = Scene::new(&dynamixels(&[1]));
    scene.set("j1", "Firmware Version", 44);
    assert_eq!(scene.error(&instruction(1, 0x20, &STORE)), 2);
}

#[test]
fn gains_of_the_table_act_as_the_controller_says() {
    // Feed-forward 250 / 4 per pulse and millisecond asks for the whole speed; see servo::control.
    let lag = |feedforward: u16| {
        let mut scene = Scene::new(&dynamixels(&[1]));
        scene.ask(&write(1, 11, &[4]));
        scene.ask(&write(1, 90, &feedforward.to_le_bytes()));
        scene.ask(&write(1, 112, &100_u32.to_le_bytes()));
        scene.ask(&write(1, 64, &[1]));
        scene.ask(&write(1, 116, &20_000_i32.to_le_bytes()));
        scene.wait_ms(500);
        scene.get("j1", "Position Trajectory") - scene.get("j1", "Present Position")
    };
    // 100 * 0.229 rev/min = 1563 pulses a second; at 100 /s that is 15.6 pulses of lag.
    assert!((lag(0) - lag(250) - 16).abs() <= 1, "{} {}", lag(0), lag(250));
    let mut scene = Scene::new(&dynamixels(&[1]));
    scene.ask(&write(1, 82, &500_u16.to_le_bytes()));
    scene.ask(&write(1, 64, &[1]));
    scene.ask(&write(1, 116, &2_500_i32.to_le_bytes()));
    scene.wait_ms(5_000);
    assert_eq!(scene.tell(&read(1, 132, 4))[0].params, 2_500_i32.to_le_bytes());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn whatever_is_written_to_whatever_servo_it_stays_a_servo(
        which in any::<prop::sample::Index>(),
        writes in prop::collection::vec(
            (any::<prop::sample::Index>(), prop::collection::vec(any::<u8>(), 1..9)), 1..40),
    ) {
        let names: Vec<&str> = gaitway_profiles::servo_names().collect();
        let name = *which.get(&names);
        let profile = gaitway_profiles::servo(name).unwrap();
        let registers: Vec<_> = profile.items().collect();
        let baud_rate = profile.register(Role::BaudRate).and_then(|of| of.item(0)).unwrap().name();
        let mut scene = one(name);
        for (register, bytes) in &writes {
            let address = register.get(&registers).address;
            let packet = match profile.protocol {
                Protocol::Dynamixel2 => write(0xFE, address, bytes),
                _ => feetech(0xFE, 3, &[&[address as u8], &bytes[..]].concat()),
            };
            scene.world.transmit(0, &packet, 1_000_000);
            scene.wait_ms(20);
            // Whatever the line speed may have become.
            scene.set("j1", &baud_rate, profile.baud_index(1_000_000).unwrap().into());
        }
        scene.wait_ms(3_000);
        for register in &registers {
            scene.get("j1", &register.name());
        }
        let angle = scene.world.joint_position_rad("j1");
        let speed = scene.world.joint_velocity_rad_s("j1");
        prop_assert!(angle.unwrap().is_finite() && speed.unwrap().is_finite(), "{name}");
    }
}
