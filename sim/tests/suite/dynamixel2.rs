//! Bytes and rules of ROBOTIS e-Manual, "DYNAMIXEL Protocol 2.0" and the X series control table.
//! Vectors marked "computed" are made by its rules with a CRC of our own.

use crate::scene::{Scene, Status, dynamixels, hex, instruction, read, sync_read, write};

const OK_1: &str = "FF FF FD 00 01 04 00 55 00 A1 0C";
const TORQUE_ENABLE: u16 = 64;
const GOAL_POSITION: u16 = 116;

fn scene(ids: &[u8]) -> Scene {
    Scene::new(&dynamixels(ids))
}

/// The servo of the manual's examples: model 1030 with firmware 38.
fn manual_scene(ids: &[u8]) -> Scene {
    let mut scene = scene(ids);
    for id in ids {
        scene.set(&format!("j{id}"), "Model Number", 1030);
        scene.set(&format!("j{id}"), "Firmware Version", 38);
    }
    scene
}

#[test]
fn ping_is_answered_with_model_and_firmware() {
    let mut scene = manual_scene(&[1]);
    let answer = scene.ask(&hex("FF FF FD 00 01 03 00 01 19 4E"));
    assert_eq!(answer, hex("FF FF FD 00 01 07 00 55 00 06 04 26 65 5D"));
    assert_eq!(scene.ask(&hex("FF FF FD 00 02 03 00 01 19 72")), [0_u8; 0]);
}

#[test]
fn all_servos_answer_a_broadcast_ping_in_order_of_id() {
    let mut scene = manual_scene(&[2, 1]);
    let answer = scene.ask(&hex("FF FF FD 00 FE 03 00 01 31 42"));
    let (one, two) = answer.split_at(14);
    assert_eq!(one, hex("FF FF FD 00 01 07 00 55 00 06 04 26 65 5D"));
    assert_eq!(two, hex("FF FF FD 00 02 07 00 55 00 06 04 26 6F 6D"));
}

#[test]
fn read_gives_the_present_position() {
    let mut scene = scene(&[1]);
    scene.set("j1", "Present Position", 166);
    let answer = scene.ask(&hex("FF FF FD 00 01 07 00 02 84 00 04 00 1D 15"));
    assert_eq!(answer, hex("FF FF FD 00 01 08 00 55 00 A6 00 00 00 8C C0"));
}

#[test]
fn write_sets_the_goal_position() {
    let mut scene = scene(&[1]);
    let answer = scene.ask(&hex("FF FF FD 00 01 09 00 03 74 00 00 02 00 00 CA 89"));
    assert_eq!(answer, hex(OK_1));
    assert_eq!(scene.get("j1", "Goal Position"), 512);
}

#[test]
fn a_registered_write_waits_for_the_action() {
    let mut scene = scene(&[1]);
    let before = scene.get("j1", "Goal Velocity");
    let answer = scene.ask(&hex("FF FF FD 00 01 09 00 04 68 00 C8 00 00 00 AE 8E"));
    assert_eq!(answer, hex(OK_1));
    assert_eq!(scene.get("j1", "Goal Velocity"), before);
    assert_eq!(scene.get("j1", "Registered Instruction"), 1);
    assert_eq!(scene.ask(&hex("FF FF FD 00 01 03 00 05 02 CE")), hex(OK_1));
    assert_eq!(scene.get("j1", "Goal Velocity"), 200);
    assert_eq!(scene.get("j1", "Registered Instruction"), 0);
    // Nothing is registered now: instruction error.
    assert_eq!(scene.error(&hex("FF FF FD 00 01 03 00 05 02 CE")), 2);
}

#[test]
fn factory_reset_keeps_the_id_when_asked_to() {
    let mut scene = scene(&[1]);
    scene.set("j1", "Min Position Limit", 100);
    assert_eq!(scene.ask(&hex("FF FF FD 00 01 04 00 06 01 A1 E6")), hex(OK_1));
    assert_eq!(scene.get("j1", "ID"), 1);
    assert_eq!(scene.get("j1", "Min Position Limit"), 0);
    // Baud rate and return delay are the factory's again.
    assert_eq!(scene.get("j1", "Baud Rate"), 1);
    scene.wait_ms(500);
    assert_eq!(scene.ask(&instruction(1, 1, &[])), [0_u8; 0]);
    scene.baud_bps = 57_600;
    assert_eq!(scene.tell(&instruction(1, 1, &[])).len(), 1);
}

#[test]
fn reboot_keeps_eeprom_and_resets_ram() {
    let mut scene = scene(&[2]);
    assert_eq!(scene.error(&write(2, 52, &100_i32.to_le_bytes())), 0);
    assert_eq!(scene.error(&write(2, 84, &[0x20, 0x03])), 0);
    assert_eq!(scene.error(&write(2, 65, &[1])), 0);
    assert_eq!(scene.error(&write(2, TORQUE_ENABLE, &[1])), 0);
    let answer = scene.tell(&hex("FF FF FD 00 02 03 00 08 2F 72"));
    assert_eq!(answer, [Status { id: 2, error: 0, params: vec![] }]);
    assert_eq!(scene.ask(&instruction(2, 1, &[])), [0_u8; 0], "it is still booting");
    scene.wait_ms(500);
    assert_eq!(scene.tell(&instruction(2, 1, &[])).len(), 1);
    assert_eq!(scene.get("j2", "Min Position Limit"), 100);
    assert_eq!(scene.get("j2", "LED"), 0);
    assert_eq!(scene.get("j2", "Torque Enable"), 0);
}

#[test]
fn clear_brings_the_reading_back_into_one_turn() {
    let mut scene = scene(&[1]);
    scene.set("j1", "Present Position", 3 * 4096 + 17);
    assert_eq!(scene.ask(&hex("FF FF FD 00 01 08 00 10 01 44 58 4C 22 B1 DC")), hex(OK_1));
    assert_eq!(scene.get("j1", "Present Position"), 17);
}

#[test]
fn sync_read_is_answered_by_each_in_the_order_asked() {
    let mut scene = scene(&[1, 2]);
    scene.set("j1", "Present Position", 166);
    scene.set("j2", "Present Position", 2079);
    let answer = scene.ask(&hex("FF FF FD 00 FE 09 00 82 84 00 04 00 01 02 CE FA"));
    let (one, two) = answer.split_at(15);
    assert_eq!(one, hex("FF FF FD 00 01 08 00 55 00 A6 00 00 00 8C C0"));
    assert_eq!(two, hex("FF FF FD 00 02 08 00 55 00 1F 08 00 00 BA BE"));
    let ids: Vec<u8> =
        scene.tell(&sync_read(0x82, 132, 4, &[2, 1])).iter().map(|status| status.id).collect();
    assert_eq!(ids, [2, 1]);
}

#[test]
fn sync_read_of_current_velocity_and_position_is_understood() {
    let mut scene = scene(&[1, 2]);
    let answer = scene.tell(&hex("FF FF FD 00 FE 09 00 82 7E 00 0A 00 01 02 38 92"));
    assert_eq!(answer.len(), 2);
    assert!(answer.iter().all(|status| status.error == 0 && status.params.len() == 10));
    let merged = scene.ask(&hex("FF FF FD 00 FE 09 00 8A 7E 00 0A 00 01 02 BB 1A"));
    assert_eq!(merged.len(), 8 + 2 * 14);
}

#[test]
fn sync_write_sets_all_goals_and_is_not_answered() {
    let mut scene = scene(&[1, 2]);
    let packet = "FF FF FD 00 FE 11 00 83 74 00 04 00 01 96 00 00 00 02 AA 00 00 00 82 87";
    assert_eq!(scene.ask(&hex(packet)), [0_u8; 0]);
    assert_eq!(scene.get("j1", "Goal Position"), 150);
    assert_eq!(scene.get("j2", "Goal Position"), 170);
}

#[test]
fn fast_sync_read_merges_the_statuses_with_a_running_crc() {
    let mut scene = scene(&[3, 7, 4]);
    for (joint, raw) in [("j3", 166), ("j7", 2079), ("j4", 1023)] {
        scene.set(joint, "Present Position", raw);
    }
    let answer = scene.ask(&hex("FF FF FD 00 FE 0A 00 8A 84 00 04 00 03 07 04 20 F2"));
    let expected = "FF FF FD 00 FE 19 00 55 00 03 A6 00 00 00 84 08 00 07 1F 08 00 00 16 CA \
                    00 04 FF 03 00 00 D1 9E";
    assert_eq!(answer, hex(expected));
}

#[test]
fn fast_sync_read_reaches_the_upper_indirect_addresses() {
    let mut scene = scene(&[1, 2]);
    for (joint, low) in [("j1", 2000), ("j2", 9)] {
        scene.set(joint, "Indirect Address 30", low);
        scene.set(joint, "Indirect Address 31", 0);
    }
    let answer = scene.ask(&hex("FF FF FD 00 FE 09 00 8A 44 02 04 00 01 02 72 F2"));
    let expected = "FF FF FD 00 FE 11 00 55 00 01 D0 07 00 00 0C 83 00 02 09 00 00 00 11 40";
    assert_eq!(answer, hex(expected));
}

#[test]
fn a_servo_with_old_firmware_is_silent_to_fast_sync_read() {
    let mut scene = manual_scene(&[1, 2]);
    assert_eq!(scene.ask(&sync_read(0x8A, 132, 4, &[1, 2])), [0_u8; 0]);
}

#[test]
fn bulk_read_asks_each_for_something_else() {
    let mut scene = scene(&[1, 2]);
    scene.set("j1", "Present Input Voltage", 119);
    scene.set("j2", "Present Temperature", 36);
    let request = "FF FF FD 00 FE 0D 00 92 01 90 00 02 00 02 92 00 01 00 1A 05";
    let answer = scene.ask(&hex(request));
    let (one, two) = answer.split_at(13);
    assert_eq!(one, hex("FF FF FD 00 01 06 00 55 00 77 00 C3 69"));
    assert_eq!(two, hex("FF FF FD 00 02 05 00 55 00 24 8B A9"));
}

#[test]
fn bulk_write_tells_each_something_else() {
    let mut scene = scene(&[1, 2]);
    scene.set("j1", "Max Voltage Limit", 150);
    scene.set("j2", "Temperature Limit", 70);
    let request = "FF FF FD 00 FE 10 00 93 01 20 00 02 00 A0 00 02 1F 00 01 00 50 B7 68";
    assert_eq!(scene.ask(&hex(request)), [0_u8; 0]);
    assert_eq!(scene.get("j1", "Max Voltage Limit"), 160);
    assert_eq!(scene.get("j2", "Temperature Limit"), 80);
}

#[test]
fn fast_bulk_read_merges_parts_of_different_length() {
    let mut scene = scene(&[3, 7, 4]);
    scene.set("j3", "Present Position", 166);
    scene.set("j4", "Present Temperature", 31);
    let request = "FF FF FD 00 FE 12 00 9A 03 84 00 04 00 07 7C 00 02 00 04 92 00 01 00 DA 2D";
    let answer = scene.ask(&hex(request));
    // As the manual's, whose ID 7 reports a PWM of 421; here it is at rest.
    assert_eq!(answer[..16], hex("FF FF FD 00 FE 14 00 55 00 03 A6 00 00 00 67 A4"));
    assert_eq!(answer[16..20], [0x00, 0x07, 0x00, 0x00]);
    assert_eq!(answer[22..25], [0x00, 0x04, 0x1F]);
    assert_eq!(answer[25..], crate::scene::crc16(&answer[..25]).to_le_bytes());
}

#[test]
fn a_stuffed_write_is_unstuffed_before_its_value_is_judged() {
    let mut scene = scene(&[1]);
    // Goal position 0x00FDFFFF, computed: beyond what the register takes.
    let answer = scene.ask(&hex("FF FF FD 00 01 0A 00 03 74 00 FF FF FD FD 00 21 E7"));
    assert_eq!(answer, hex("FF FF FD 00 01 04 00 55 04 BA 8C"));
    let bytes = [0xFF, 0xFF, 0xFD, 0xFF, 0xFF, 0xFD, 0xFD];
    assert_eq!(scene.error(&write(1, 224, &bytes)), 0);
    assert_eq!(scene.tell(&read(1, 224, 7))[0].params, bytes);
}

#[test]
fn a_status_that_holds_a_header_is_stuffed() {
    let mut scene = scene(&[1]);
    for (k, raw) in [0xFF, 0xFF, 0xFD, 0xFF].into_iter().enumerate() {
        scene.set("j1", &format!("Indirect Data {}", k + 1), raw);
    }
    let answer = scene.ask(&read(1, 224, 4));
    assert_eq!(answer, hex("FF FF FD 00 01 09 00 55 00 FF FF FD FD FF DA 9E"));
}

#[test]
fn a_goal_beyond_the_position_limits_is_a_limit_error() {
    let mut scene = scene(&[1]);
    // Goal position -1, computed.
    assert_eq!(scene.error(&hex("FF FF FD 00 01 09 00 03 74 00 FF FF FF FF C8 89")), 6);
    scene.set("j1", "Max Position Limit", 3000);
    assert_eq!(scene.error(&write(1, GOAL_POSITION, &3001_i32.to_le_bytes())), 6);
    assert_eq!(scene.error(&write(1, GOAL_POSITION, &3000_i32.to_le_bytes())), 0);
    assert_eq!(scene.error(&write(1, 104, &201_i32.to_le_bytes())), 6, "velocity limit is 200");
    assert_eq!(scene.error(&write(1, 100, &886_i16.to_le_bytes())), 4, "beyond the register");
}

#[test]
fn an_undefined_address_is_an_access_error() {
    let mut scene = scene(&[1]);
    let access_error = hex("FF FF FD 00 01 04 00 55 07 B0 8C");
    // Read (0x2B, 2): nothing is at 43.
    assert_eq!(scene.ask(&hex("FF FF FD 00 01 07 00 02 2B 00 02 00 2E CD")), access_error);
    assert_eq!(scene.ask(&read(1, 660, 3)), access_error);
    assert_eq!(scene.ask(&read(1, 0xFFFF, 0xFFFF)), access_error);
    assert_eq!(scene.ask(&write(1, 132, &[0; 4])), access_error, "present position is read only");
    assert_eq!(scene.ask(&write(1, 117, &[0; 3])), access_error, "not at the start of an item");
}

#[test]
fn part_of_an_item_is_a_length_error() {
    let mut scene = scene(&[1]);
    assert_eq!(scene.error(&write(1, GOAL_POSITION, &[0, 8])), 5);
    assert_eq!(scene.error(&instruction(1, 0x02, &[132, 0, 4])), 5);
}

#[test]
fn eeprom_is_closed_while_torque_is_on() {
    let mut scene = scene(&[1]);
    assert_eq!(scene.ask(&hex("FF FF FD 00 01 06 00 03 40 00 01 DB 66")), hex(OK_1));
    assert_eq!(scene.get("j1", "Torque Enable"), 1);
    assert_eq!(scene.error(&write(1, 9, &[10])), 7);
    assert_eq!(scene.error(&write(1, TORQUE_ENABLE, &[0])), 0);
    assert_eq!(scene.error(&write(1, 9, &[10])), 0);
}

#[test]
fn a_hardware_error_shows_as_alert_in_every_status() {
    let mut scene = scene(&[1]);
    scene.set("j1", "Hardware Error Status", 0x20);
    let answer = scene.ask(&write(1, 65, &[1]));
    assert_eq!(answer, hex("FF FF FD 00 01 04 00 55 80 A2 8F"));
    assert_eq!(scene.tell(&read(1, 70, 1))[0].params, [0x20]);
}

#[test]
fn status_return_level_silences_writes_then_reads_but_never_pings() {
    let mut scene = scene(&[1]);
    assert_eq!(scene.error(&write(1, 68, &[1])), 0);
    assert_eq!(scene.ask(&write(1, 65, &[1])), [0_u8; 0]);
    assert_eq!(scene.get("j1", "LED"), 1);
    assert_eq!(scene.tell(&read(1, 65, 1)).len(), 1);
    assert_eq!(scene.ask(&write(1, 68, &[0])), [0_u8; 0]);
    assert_eq!(scene.ask(&read(1, 65, 1)), [0_u8; 0]);
    assert_eq!(scene.ask(&sync_read(0x82, 65, 1, &[1])), [0_u8; 0]);
    assert_eq!(scene.tell(&instruction(1, 1, &[])).len(), 1);
}

#[test]
fn broadcast_writes_are_done_in_silence_and_broadcast_reads_not_at_all() {
    let mut scene = scene(&[1, 2]);
    assert_eq!(scene.ask(&write(0xFE, 65, &[1])), [0_u8; 0]);
    assert_eq!((scene.get("j1", "LED"), scene.get("j2", "LED")), (1, 1));
    assert_eq!(scene.ask(&read(0xFE, 65, 1)), [0_u8; 0]);
}

#[test]
fn a_new_id_counts_after_the_status() {
    let mut scene = scene(&[1]);
    assert_eq!(scene.tell(&write(1, 7, &[9]))[0].id, 1);
    assert_eq!(scene.ask(&instruction(1, 1, &[])), [0_u8; 0]);
    assert_eq!(scene.tell(&instruction(9, 1, &[]))[0].id, 9);
}

#[test]
fn indirect_data_reads_and_writes_what_its_addresses_name() {
    let mut scene = scene(&[1]);
    // Goal position bytes and LED side by side.
    let pointers: Vec<u8> =
        [116_u16, 117, 118, 119, 65].iter().flat_map(|address| address.to_le_bytes()).collect();
    assert_eq!(scene.error(&write(1, 168, &pointers)), 0);
    assert_eq!(scene.error(&write(1, 224, &[0x00, 0x06, 0, 0, 1])), 0);
    assert_eq!(scene.get("j1", "Goal Position"), 0x600);
    assert_eq!(scene.tell(&read(1, 224, 5))[0].params, [0x00, 0x06, 0, 0, 1]);
    // The target's rules hold.
    assert_eq!(scene.error(&write(1, 224, &[0xFF, 0xFF, 0, 0, 0])), 6);
}

#[test]
fn the_watchdog_latches_until_it_is_cleared() {
    let mut scene = scene(&[1]);
    scene.ask(&write(1, 98, &[5]));
    scene.wait_ms(500);
    assert_eq!(scene.get("j1", "Bus Watchdog"), 5, "without torque it does not count");
    scene.ask(&write(1, TORQUE_ENABLE, &[1]));
    scene.ask(&write(1, GOAL_POSITION, &2100_i32.to_le_bytes()));
    scene.wait_ms(70);
    assert_eq!(scene.get("j1", "Bus Watchdog"), 5);
    scene.wait_ms(20);
    assert_eq!(scene.get("j1", "Bus Watchdog"), 255);
    let goal = write(1, GOAL_POSITION, &2000_i32.to_le_bytes());
    assert_eq!(scene.error(&goal), 4);
    assert_eq!(scene.error(&write(1, 98, &[5])), 4);
    assert_eq!(scene.error(&write(1, 98, &[0])), 0);
    assert_eq!(scene.error(&goal), 0);
}

#[test]
fn a_shutdown_takes_the_torque_until_reboot() {
    let mut scene = scene(&[1]);
    scene.ask(&write(1, TORQUE_ENABLE, &[1]));
    scene.set("j1", "Present Temperature", 95);
    assert_eq!(scene.error(&instruction(1, 1, &[])), 0x80);
    assert_eq!(scene.get("j1", "Torque Enable"), 0);
    assert_eq!(scene.get("j1", "Hardware Error Status"), 0x04);
    scene.ask(&write(1, TORQUE_ENABLE, &[1]));
    assert_eq!(scene.get("j1", "Torque Enable"), 0);
    scene.set("j1", "Present Temperature", 40);
    scene.ask(&instruction(1, 0x08, &[]));
    scene.wait_ms(500);
    assert_eq!(scene.error(&write(1, TORQUE_ENABLE, &[1])), 0);
    assert_eq!(scene.get("j1", "Torque Enable"), 1);
}

#[test]
fn homing_offset_is_added_and_reverse_mode_mirrors() {
    let mut scene = scene(&[1]);
    scene.set("j1", "Present Position", 2148);
    scene.ask(&write(1, 20, &(-50_i32).to_le_bytes()));
    assert_eq!(scene.get("j1", "Present Position"), 2098);
    scene.ask(&write(1, 10, &[1]));
    assert_eq!(scene.get("j1", "Present Position"), 2048 - 100 - 50);
    // In position mode an offset beyond a quarter turn does nothing.
    scene.ask(&write(1, 20, &2000_i32.to_le_bytes()));
    assert_eq!(scene.get("j1", "Present Position"), 1948);
}

#[test]
fn another_operating_mode_brings_default_gains() {
    let mut scene = scene(&[1]);
    scene.ask(&write(1, 84, &[0x10, 0x00]));
    scene.ask(&write(1, 112, &50_u32.to_le_bytes()));
    assert_eq!(scene.error(&write(1, 11, &[4])), 0);
    assert_eq!(scene.get("j1", "Position P Gain"), 800);
    assert_eq!(scene.get("j1", "Profile Velocity"), 0);
    // Extended position mode goes beyond one turn.
    assert_eq!(scene.error(&write(1, GOAL_POSITION, &(-5000_i32).to_le_bytes())), 0);
}

#[test]
fn the_tick_counts_milliseconds_since_power_up() {
    let mut scene = scene(&[1]);
    scene.wait_ms(40_000);
    assert_eq!(scene.get("j1", "Realtime Tick"), 40_000 - 32_768);
}

#[test]
fn a_backup_is_stored_and_restored_with_torque_off_only() {
    // The manual prints the last CRC of restore as 92 F5; 9E F5 is computed.
    let store = hex("FF FF FD 00 01 08 00 20 01 43 54 52 4C 16 F5");
    let restore = hex("FF FF FD 00 01 08 00 20 02 43 54 52 4C 9E F5");
    let mut scene = scene(&[1]);
    assert_eq!(scene.error(&write(1, 52, &100_i32.to_le_bytes())), 0);
    assert_eq!(scene.ask(&store), hex(OK_1));
    assert_eq!(scene.error(&write(1, 52, &200_i32.to_le_bytes())), 0);
    assert_eq!(scene.error(&write(1, TORQUE_ENABLE, &[1])), 0);
    assert_eq!(scene.error(&restore), 1, "torque is on");
    assert_eq!(scene.error(&write(1, TORQUE_ENABLE, &[0])), 0);
    assert_eq!(scene.ask(&restore), hex(OK_1));
    scene.wait_ms(1000);
    assert_eq!(scene.get("j1", "Min Position Limit"), 100);
    assert_eq!(scene.error(&instruction(1, 0x20, &[3, 0x43, 0x54, 0x52, 0x4C])), 4);
}

#[test]
fn older_firmware_knows_neither_clear_nor_backup_nor_fast_reads() {
    let mut scene = scene(&[1]);
    scene.set("j1", "Firmware Version", 41);
    assert_eq!(scene.error(&instruction(1, 0x10, &[1, 0x44, 0x58, 0x4C, 0x22])), 2);
    assert_eq!(scene.error(&instruction(1, 0x20, &[1, 0x43, 0x54, 0x52, 0x4C])), 2);
    assert_eq!(scene.ask(&sync_read(0x8A, 132, 4, &[1])), [0_u8; 0]);
    assert_eq!(scene.tell(&sync_read(0x82, 132, 4, &[1])).len(), 1);
}

#[test]
fn a_factory_reset_of_everything_for_everyone_is_obeyed_by_old_firmware_only() {
    for (firmware, id) in [(41, 1), (42, 7)] {
        let mut scene = scene(&[7]);
        scene.set("j7", "Firmware Version", firmware);
        assert_eq!(scene.ask(&instruction(0xFE, 0x06, &[0xFF])), [0_u8; 0]);
        assert_eq!(scene.get("j7", "ID"), id, "firmware {firmware}");
    }
}

#[test]
fn a_secondary_id_is_obeyed_and_never_answered() {
    let mut scene = scene(&[1, 2]);
    for joint in ["j1", "j2"] {
        scene.set(joint, "Secondary(Shadow) ID", 100);
    }
    assert_eq!(scene.ask(&write(100, 65, &[1])), [0_u8; 0]);
    assert_eq!((scene.get("j1", "LED"), scene.get("j2", "LED")), (1, 1));
    assert_eq!(scene.ask(&read(100, 65, 1)), [0_u8; 0]);
    assert_eq!(scene.ask(&sync_read(0x82, 65, 1, &[100])), [0_u8; 0]);
    scene.ask(&instruction(0xFE, 0x83, &[65, 0, 1, 0, 100, 0]));
    assert_eq!((scene.get("j1", "LED"), scene.get("j2", "LED")), (0, 0));
    // A servo's own ID comes first: it answers, the other obeys.
    scene.set("j2", "Secondary(Shadow) ID", 1);
    assert_eq!(scene.tell(&write(1, 65, &[1])).len(), 1);
    assert_eq!((scene.get("j1", "LED"), scene.get("j2", "LED")), (1, 1));
}
