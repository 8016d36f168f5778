//! Bytes and rules of ROBOTIS e-Manual, "DYNAMIXEL Protocol 1.0", AX-12A and MX-28. Those marked
//! "computed" follow from the frame's rules.

use crate::scene::{Scene, feetech as instruction, hex, mixed};
use gaitway_sim::{BadChecksum, Options};

const OK_1: &str = "FF FF 01 02 00 FC";
const CHECKSUM_ERROR: u8 = 0x10;
const INSTRUCTION_ERROR: u8 = 0x40;

fn ax(id: u8) -> Scene {
    Scene::new(&mixed(&[("ax-12a", id)]))
}

fn status(id: u8, error: u8) -> Vec<u8> {
    instruction(id, error, &[])
}

#[test]
fn ping_is_answered_by_the_servo_named_and_by_nobody_if_to_all() {
    let mut scene = ax(1);
    assert_eq!(scene.ask(&hex("FF FF 01 02 01 FB")), hex(OK_1));
    assert_eq!(scene.ask(&instruction(2, 1, &[])), [0_u8; 0]);
    assert_eq!(scene.ask(&instruction(0xFE, 1, &[])), [0_u8; 0]);
}

#[test]
fn read_gives_temperature_and_position() {
    let mut scene = ax(1);
    scene.set("j1", "Present Temperature", 32);
    assert_eq!(scene.ask(&hex("FF FF 01 04 02 2B 01 CC")), hex("FF FF 01 03 00 20 DB"));
    scene.set("j1", "Present Position", 512);
    // Computed.
    assert_eq!(scene.ask(&hex("FF FF 01 04 02 24 02 D2")), hex("FF FF 01 04 00 00 02 F8"));
}

#[test]
fn goal_and_speed_are_written_together() {
    let mut scene = ax(1);
    // Computed: goal 512, speed 0x100.
    assert_eq!(scene.ask(&hex("FF FF 01 07 03 1E 00 02 00 01 D3")), hex(OK_1));
    assert_eq!(scene.get("j1", "Goal Position"), 512);
    assert_eq!(scene.get("j1", "Moving Speed"), 0x100);
}

#[test]
fn everyone_takes_the_id_of_a_broadcast_write_and_nobody_answers() {
    let mut scene = ax(7);
    assert_eq!(scene.ask(&hex("FF FF FE 04 03 03 01 F6")), [0_u8; 0]);
    assert_eq!(scene.get("j7", "ID"), 1);
    assert_eq!(scene.ask(&hex("FF FF 01 02 01 FB")), hex(OK_1));
}

#[test]
fn a_registered_write_waits_for_the_broadcast_action() {
    let mut scene = ax(1);
    let before = scene.get("j1", "Goal Position");
    assert_eq!(scene.ask(&hex("FF FF 01 05 04 1E F4 01 E2")), hex(OK_1));
    assert_eq!(scene.get("j1", "Goal Position"), before);
    assert_eq!(scene.get("j1", "Registered"), 1);
    assert_eq!(scene.ask(&hex("FF FF FE 02 05 FA")), [0_u8; 0]);
    assert_eq!(scene.get("j1", "Goal Position"), 500);
    assert_eq!(scene.get("j1", "Registered"), 0);
    // Nothing is registered now.
    assert_eq!(scene.ask(&instruction(1, 5, &[])), status(1, INSTRUCTION_ERROR));
}

#[test]
fn factory_reset_brings_back_id_and_speed_of_the_factory() {
    let mut robot = mixed(&[("ax-12a", 0)]);
    robot.lines[0].kind = gaitway_profiles::LineKind::Serial { baud_bps: 500_000 };
    let mut scene = Scene::new(&robot);
    assert_eq!(scene.ask(&hex("FF FF 00 02 06 F7")), hex("FF FF 00 02 00 FD"));
    scene.wait_ms(1000);
    scene.baud_bps = 1_000_000;
    assert_eq!(scene.ask(&hex("FF FF 01 02 01 FB")), hex(OK_1));
}

#[test]
fn sync_write_sets_goals_and_speeds_and_is_not_answered() {
    let mut scene = Scene::new(&mixed(&[("ax-12a", 0), ("ax-12a", 1)]));
    let packet = "FF FF FE 0E 83 1E 04 00 10 00 50 01 01 20 02 60 03 67";
    assert_eq!(scene.ask(&hex(packet)), [0_u8; 0]);
    for (joint, goal, speed) in [("j0", 0x10, 0x150), ("j1", 0x220, 0x360)] {
        assert_eq!(scene.get(joint, "Goal Position"), goal);
        assert_eq!(scene.get(joint, "Moving Speed"), speed);
    }
}

#[test]
fn bulk_read_is_answered_in_order_by_mx() {
    let mut scene = Scene::new(&mixed(&[("mx-28", 2), ("mx-28", 1)]));
    scene.set("j1", "Goal Position", 0x80);
    scene.set("j2", "Present Position", 0x80);
    let packet = hex("FF FF FE 09 92 00 02 01 1E 02 02 24 1D");
    let answer = [instruction(1, 0, &[0x80, 0]), instruction(2, 0, &[0x80, 0])].concat();
    assert_eq!(scene.ask(&packet), answer);
}

#[test]
fn ax_has_no_bulk_read_and_those_behind_it_wait() {
    let mut scene = Scene::new(&mixed(&[("ax-12a", 1), ("mx-28", 2)]));
    assert_eq!(scene.ask(&hex("FF FF FE 09 92 00 02 01 1E 02 02 24 1D")), [0_u8; 0]);
    let turned = instruction(0xFE, 0x92, &[0, 2, 2, 36, 2, 1, 30]);
    assert_eq!(scene.ask(&turned).len(), 8, "the MX alone");
}

#[test]
fn the_return_level_silences_writes_then_reads_but_not_pings() {
    let mut scene = ax(1);
    let (ping, read) = (instruction(1, 1, &[]), instruction(1, 2, &[36, 2]));
    let level = |level| instruction(1, 3, &[16, level]);
    assert_eq!(scene.ask(&level(1)), hex(OK_1), "under the old level");
    assert_eq!(scene.ask(&level(1)), [0_u8; 0]);
    assert_eq!(scene.ask(&read).len(), 8);
    assert_eq!(scene.ask(&level(0)), [0_u8; 0]);
    assert_eq!(scene.ask(&read), [0_u8; 0]);
    assert_eq!(scene.ask(&ping), hex(OK_1));
}

#[test]
fn errors_are_a_mask_of_bits() {
    let mut scene = ax(1);
    scene.set("j1", "CCW Angle Limit", 600);
    let goal = |low, high| instruction(1, 3, &[30, low, high]);
    assert_eq!(scene.ask(&goal(0x59, 0x02)), status(1, 0x02), "601 is beyond the angle limit");
    assert_eq!(scene.ask(&instruction(1, 3, &[25, 2])), status(1, 0x08), "no such LED");
    assert_eq!(scene.ask(&instruction(1, 0x55, &[])), status(1, INSTRUCTION_ERROR));
}

#[test]
fn a_wrong_checksum_is_ignored_or_answered_as_the_options_say() {
    let wrong = hex("FF FF 01 02 01 FA");
    assert_eq!(ax(1).ask(&wrong), [0_u8; 0]);
    let options = Options { bad_checksum: BadChecksum::Answer, ..Options::default() };
    let mut scene = Scene::with(&mixed(&[("ax-12a", 1), ("xl430-w250", 2)]), options);
    assert_eq!(scene.ask(&wrong), status(1, CHECKSUM_ERROR));
    assert_eq!(scene.ask(&hex("FF FF 01 02 01 FB")), hex(OK_1));
    let mut ping = crate::scene::instruction(2, 1, &[]);
    ping[8] ^= 1;
    assert_eq!(scene.error(&ping), 3);
}

#[test]
fn a_packet_may_be_sent_in_pieces_less_than_100_ms_apart() {
    for (pause_ms, answer) in [(99, hex(OK_1)), (101, Vec::new())] {
        let mut scene = ax(1);
        scene.world.transmit(0, &hex("FF FF 01"), 1_000_000);
        scene.wait_ms(pause_ms);
        assert_eq!(scene.ask(&hex("02 01 FB")), answer, "{pause_ms} ms");
    }
}
