//! Each fault does what it says, and only that.

use crate::scene::{
    Scene, Status, dynamixels, feetech, feetechs, instruction, read, statuses, sync_read, write,
};
use gaitway_sim::{Damage, Fault, Options, SimError, World};

const MS: u64 = 1_000_000;

fn scene(faults: Vec<Fault>) -> Scene {
    let options = Options { permit_eeprom: true, faults, ..Options::default() };
    Scene::with(&dynamixels(&[1, 2]), options)
}

fn damaged(damage: Damage) -> Scene {
    scene(vec![Fault::Status { joint: "j1".into(), nth: 1, damage }])
}

fn position(id: u8) -> Status {
    Status { id, error: 0, params: vec![0x00, 0x08, 0, 0] }
}

const ASK: fn() -> Vec<u8> = || read(1, 132, 4);

/// The second answer is damaged, the first and the third are not.
fn only_the_second(damage: Damage) -> Vec<u8> {
    let mut scene = damaged(damage);
    assert_eq!(scene.tell(&ASK()), [position(1)]);
    let answer = scene.ask(&ASK());
    assert_eq!(scene.tell(&ASK()), [position(1)]);
    answer
}

fn sound() -> Vec<u8> {
    damaged(Damage::Mute).ask(&ASK())
}

#[test]
fn a_flipped_bit_is_the_one_asked_for() {
    let mut expected = sound();
    expected[9] ^= 0x04;
    assert_eq!(only_the_second(Damage::FlipBit { bit: Some(74) }), expected);
    let drawn = only_the_second(Damage::FlipBit { bit: None });
    let changed: u32 = drawn.iter().zip(sound()).map(|(a, b)| (a ^ b).count_ones()).sum();
    assert_eq!(changed, 1);
}

#[test]
fn a_dropped_byte_is_missing() {
    let mut expected = sound();
    expected.remove(3);
    assert_eq!(only_the_second(Damage::DropByte { at: Some(3) }), expected);
    assert_eq!(only_the_second(Damage::DropByte { at: None }).len(), expected.len());
}

#[test]
fn a_lie_and_a_wrong_id_have_sound_checksums() {
    let lie = statuses(&only_the_second(Damage::Lie { at: 1, xor: 0x03 }));
    assert_eq!(lie, [Status { params: vec![0x00, 0x0B, 0, 0], ..position(1) }]);
    let wrong = statuses(&only_the_second(Damage::WrongId { id: 77 }));
    assert_eq!(wrong, [position(77)]);
}

#[test]
fn a_lie_in_a_merged_status_is_covered_by_all_later_checksums() {
    let lie = Damage::Lie { at: 0, xor: 0xFF };
    let mut scene = scene(vec![Fault::Status { joint: "j1".into(), nth: 0, damage: lie }]);
    let answer = scene.ask(&sync_read(0x8A, 132, 4, &[1, 2]));
    assert_eq!(answer[10], 0xFF);
    for end in [14, 22] {
        assert_eq!(crate::scene::crc16(&answer[..end]).to_le_bytes(), answer[end..end + 2]);
    }
}

#[test]
fn a_duplicate_comes_twice_and_garbage_before() {
    assert_eq!(only_the_second(Damage::Duplicate), [sound(), sound()].concat());
    let garbage = only_the_second(Damage::Garbage { length: 6 });
    assert_eq!(garbage[6..], sound());
}

#[test]
fn a_mute_servo_breaks_the_chain_for_once() {
    let mut scene = scene(vec![Fault::Status { joint: "j1".into(), nth: 0, damage: Damage::Mute }]);
    let request = sync_read(0x82, 132, 4, &[1, 2]);
    assert_eq!(scene.tell(&request), []);
    assert_eq!(scene.tell(&request), [position(1), position(2)]);
}

#[test]
fn a_stale_reply_comes_in_the_next_window() {
    let mut scene = damaged(Damage::StaleReply { by_ns: 30 * MS });
    scene.ask(&ASK());
    assert_eq!(scene.ask(&ASK()), [0_u8; 0]);
    scene.set("j1", "Present Position", 2000);
    scene.wait_ms(9);
    let both = scene.tell(&ASK());
    assert_eq!(both.len(), 2);
    assert!(both.contains(&position(1)));
}

#[test]
fn a_silent_servo_neither_hears_nor_answers_for_its_time() {
    let silent = Fault::Silent { joint: "j1".into(), from_ns: 0, until_ns: 50 * MS };
    let mut scene = scene(vec![silent]);
    assert_eq!(scene.ask(&write(1, 65, &[1])), [0_u8; 0]);
    assert_eq!(scene.get("j1", "LED"), 0);
    assert_eq!(scene.tell(&instruction(2, 1, &[])).len(), 1);
    scene.wait_ms(50);
    assert_eq!(scene.tell(&instruction(1, 1, &[])).len(), 1);
}

#[test]
fn an_overload_takes_the_torque_and_shows_the_alert() {
    let mut scene = scene(vec![Fault::Overload { joint: "j1".into(), at_ns: 100 * MS }]);
    scene.ask(&write(1, 64, &[1]));
    scene.world.run_until(100 * MS);
    assert_eq!(scene.error(&instruction(1, 1, &[])), 0x80);
    assert_eq!(scene.get("j1", "Torque Enable"), 0);
    assert_eq!(scene.error(&instruction(2, 1, &[])), 0);
}

#[test]
fn a_reboot_in_mid_motion_leaves_the_joint_limp() {
    let mut scene = scene(vec![Fault::Reboot { joint: "j1".into(), at_ns: 100 * MS }]);
    scene.ask(&write(1, 64, &[1]));
    scene.ask(&write(1, 112, &[10, 0, 0, 0]));
    scene.ask(&write(1, 116, &2500_i32.to_le_bytes()));
    scene.world.run_until(110 * MS);
    assert_eq!(scene.ask(&instruction(1, 1, &[])), [0_u8; 0]);
    scene.world.run_until(450 * MS);
    assert_eq!(scene.get("j1", "Torque Enable"), 0);
    assert_eq!(scene.get("j1", "Profile Velocity"), 0);
    let rest = scene.get("j1", "Present Position");
    assert!((2048..2100).contains(&rest), "{rest}");
    // The goal is what was read as it restarted; the shaft may have coasted on by a count.
    assert!((scene.get("j1", "Goal Position") - rest).abs() <= 1);
}

#[test]
fn after_a_brownout_all_come_back_without_torque() {
    let mut scene = scene(vec![Fault::Brownout { from_ns: 100 * MS, until_ns: 400 * MS }]);
    for id in [1, 2] {
        scene.ask(&write(id, 64, &[1]));
    }
    scene.world.run_until(200 * MS);
    assert_eq!(scene.ask(&instruction(0xFE, 1, &[])), [0_u8; 0]);
    scene.world.run_until(400 * MS);
    assert_eq!(scene.tell(&instruction(0xFE, 1, &[])).len(), 2);
    assert_eq!((scene.get("j1", "Torque Enable"), scene.get("j2", "Torque Enable")), (0, 0));
}

#[test]
fn a_restart_during_a_brownout_does_not_bring_the_power_back() {
    let mut scene = scene(vec![
        Fault::Brownout { from_ns: 100_000_000, until_ns: 2_000_000_000 },
        Fault::Reboot { joint: "j1".into(), at_ns: 200_000_000 },
    ]);
    scene.wait_ms(1_500);
    assert!(scene.ask(&read(1, 132, 4)).is_empty());
    scene.wait_ms(500);
    assert_eq!(scene.error(&read(1, 132, 4)), 0);
    // The tick counts from the return of the power, 300 ms before all listen.
    let tick_ms = scene.get("j1", "Realtime Tick");
    assert!((300..500).contains(&tick_ms), "{tick_ms}");
}

#[test]
fn a_blocked_shaft_stays_and_trips_the_overload() {
    let stuck = Fault::StuckPosition { joint: "j1".into(), from_ns: 50 * MS, until_ns: u64::MAX };
    let mut scene = scene(vec![stuck]);
    scene.ask(&write(1, 64, &[1]));
    scene.world.run_until(60 * MS);
    let before = scene.get("j1", "Present Position");
    scene.ask(&write(1, 116, &2500_i32.to_le_bytes()));
    scene.wait_ms(500);
    assert_eq!(scene.get("j1", "Present Position"), before);
    assert!(scene.get("j1", "Present Current") > 700);
    scene.wait_ms(600);
    assert_eq!(scene.get("j1", "Hardware Error Status"), 0x20);
    assert_eq!(scene.get("j1", "Torque Enable"), 0);
}

#[test]
fn a_position_jump_changes_the_reading_not_the_joint() {
    let jump = Fault::PositionJump { joint: "j1".into(), at_ns: 10 * MS, counts: 500 };
    let mut scene = scene(vec![jump]);
    scene.wait_ms(20);
    assert_eq!(scene.get("j1", "Present Position"), 2548);
    assert_eq!(scene.world.joint_position_rad("j1"), Some(0.0));
}

#[test]
fn random_damage_strikes_about_as_often_as_asked() {
    let damage = Damage::FlipBit { bit: None };
    let mut scene = scene(vec![Fault::AnyStatus { probability: 0.1, damage }]);
    let whole = sound();
    let struck = (0..1000).filter(|_| scene.ask(&ASK()) != whole).count();
    assert!((70..=130).contains(&struck), "{struck}");
}

#[test]
fn feetech_statuses_are_damaged_as_well() {
    let damage = Damage::Lie { at: 0, xor: 0x0F };
    let faults = vec![Fault::Status { joint: "j1".into(), nth: 0, damage }];
    let mut scene = Scene::with(&feetechs(&[1]), Options { faults, ..Options::default() });
    assert_eq!(scene.ask(&feetech(1, 2, &[56, 2])), feetech(1, 0, &[0x0F, 0x08]));
}

#[test]
fn a_fault_for_an_unknown_joint_is_refused() {
    let faults = vec![Fault::Overload { joint: "tail".into(), at_ns: 0 }];
    let options = Options { faults, ..Options::default() };
    let refused = World::new(&dynamixels(&[1]), options).err();
    assert!(matches!(refused, Some(SimError::UnknownJoint(joint)) if joint == "tail"));
}

#[test]
fn a_line_speed_the_servo_does_not_have_is_refused() {
    let mut robot = dynamixels(&[1]);
    robot.lines[0].kind = gaitway_profiles::LineKind::Serial { baud_bps: 123_456 };
    assert!(matches!(World::new(&robot, Options::default()), Err(SimError::BadServo { .. })));
}
