//! Byte times, pauses, chains and collisions.

use crate::scene::{
    Scene, dynamixels, hex, instruction, read, statuses, sync_read, sync_write_goals, write,
};
use gaitway_sim::{MissingInChain, Options, World};

const PING_1: &str = "FF FF FD 00 01 03 00 01 19 4E";
/// One byte at 1 Mbps.
const BYTE_NS: u64 = 10_000;

/// All arrivals: when they were readable, and how many bytes.
fn arrivals(world: &mut World, until_ns: u64) -> Vec<(u64, usize)> {
    let mut all = Vec::new();
    let mut buf = [0; 4096];
    loop {
        match world.receive(0, &mut buf, until_ns) {
            0 => return all,
            count => all.push((world.now_ns(), count)),
        }
    }
}

#[test]
fn a_status_is_complete_after_request_return_delay_and_its_own_bytes() {
    let mut scene = Scene::new(&dynamixels(&[1]));
    scene.set("j1", "Return Delay Time", 250);
    scene.world.transmit(0, &hex(PING_1), 1_000_000);
    let times = arrivals(&mut scene.world, 10_000_000);
    assert_eq!(times, [(10 * BYTE_NS + 500_000 + 14 * BYTE_NS, 14)]);
}

#[test]
fn a_servo_that_is_asked_twice_within_its_return_delay_answers_one_after_the_other() {
    let mut scene = Scene::new(&dynamixels(&[1, 2]));
    scene.set("j1", "Return Delay Time", 250);
    scene.set("j2", "Return Delay Time", 250);
    // The second question ends 100 us after the first, while the first answer takes 140 us.
    scene.world.transmit(0, &hex(PING_1), 1_000_000);
    scene.world.transmit(0, &hex(PING_1), 1_000_000);
    let first_ns = 10 * BYTE_NS + 500_000 + 14 * BYTE_NS;
    let mut bytes = vec![0; 4096];
    let mut heard = Vec::new();
    let mut times = Vec::new();
    while let count @ 1.. = scene.world.receive(0, &mut bytes, 10_000_000) {
        heard.extend_from_slice(&bytes[..count]);
        times.push((scene.world.now_ns(), count));
    }
    assert_eq!(times, [(first_ns, 14), (first_ns + 14 * BYTE_NS, 14)]);
    assert_eq!(statuses(&heard).len(), 2, "both are whole: {heard:02x?}");
    // Two servos have two transmitters, and spoil one another.
    scene.world.transmit(0, &hex(PING_1), 1_000_000);
    scene.world.transmit(0, &instruction(2, 1, &[]), 1_000_000);
    let mut both = Vec::new();
    while let count @ 1.. = scene.world.receive(0, &mut bytes, 20_000_000) {
        both.extend_from_slice(&bytes[..count]);
    }
    let sound = |part: &[u8]| both.windows(part.len()).any(|window| window == part);
    assert!(!sound(&heard[..14]), "{both:02x?}");
}

#[test]
fn a_question_does_not_wait_for_the_turn_of_its_servo_in_a_ping_of_all() {
    let mut scene = Scene::new(&dynamixels(&[252]));
    // Whose turn comes after 252 slots, in three quarters of a second.
    scene.world.transmit(0, &instruction(0xFE, 1, &[]), 1_000_000);
    scene.world.run_until(100_000_000);
    scene.world.transmit(0, &instruction(252, 1, &[]), 1_000_000);
    let mut bytes = vec![0; 4096];
    let mut times = Vec::new();
    while let count @ 1.. = scene.world.receive(0, &mut bytes, 1_000_000_000) {
        times.push((scene.world.now_ns() / 100_000_000, count));
    }
    assert_eq!(times.len(), 2, "{times:?}");
    assert_eq!(times[0], (1, 14), "at once");
    assert!(times[1].0 >= 5, "and in its turn: {times:?}");
}

#[test]
fn in_a_sync_read_each_waits_for_the_one_before_and_its_own_delay() {
    let mut scene = Scene::new(&dynamixels(&[1, 2, 3]));
    for (joint, delay) in [("j1", 1), ("j2", 2), ("j3", 50)] {
        scene.set(joint, "Return Delay Time", delay);
    }
    let request = sync_read(0x82, 132, 4, &[3, 1, 2]);
    scene.world.transmit(0, &request, 1_000_000);
    let times = arrivals(&mut scene.world, 10_000_000);
    let asked_ns = request.len() as u64 * BYTE_NS;
    let first_ns = asked_ns + 100_000 + 15 * BYTE_NS;
    let second_ns = first_ns + 2_000 + 15 * BYTE_NS;
    let third_ns = second_ns + 4_000 + 15 * BYTE_NS;
    assert_eq!(times, [(first_ns, 15), (second_ns, 15), (third_ns, 15)]);
}

#[test]
fn a_fast_sync_read_has_one_delay_and_no_pauses() {
    let mut scene = Scene::new(&dynamixels(&[1, 2, 3]));
    for joint in ["j1", "j2", "j3"] {
        scene.set(joint, "Return Delay Time", 10);
    }
    let request = sync_read(0x8A, 132, 4, &[1, 2, 3]);
    scene.world.transmit(0, &request, 1_000_000);
    let times = arrivals(&mut scene.world, 10_000_000);
    let start_ns = request.len() as u64 * BYTE_NS + 20_000;
    let ends = [16, 24, 32].map(|bytes| start_ns + bytes * BYTE_NS);
    assert_eq!(times, [(ends[0], 16), (ends[1], 8), (ends[2], 8)]);
}

#[test]
fn twenty_servos_at_1_mbps_take_the_wire_time_of_their_bytes() {
    // Sync write of 4 bytes and sync read of 4 bytes, return delay 2 us: 4.52 ms by the framing.
    let ids: Vec<u8> = (1..=20).collect();
    let mut scene = Scene::new(&dynamixels(&ids));
    for id in &ids {
        scene.set(&format!("j{id}"), "Return Delay Time", 1);
    }
    let goals: Vec<(u8, i32)> = ids.iter().map(|&id| (id, 2048)).collect();
    scene.world.transmit(0, &sync_write_goals(&goals), 1_000_000);
    scene.world.transmit(0, &sync_read(0x82, 132, 4, &ids), 1_000_000);
    let times = arrivals(&mut scene.world, 50_000_000);
    assert_eq!(times.len(), 20);
    assert_eq!(times[19].0, (14 + 5 * 20 + 14 + 20 + 20 * 15) * BYTE_NS + 20 * 2_000);
}

#[test]
fn without_line_timing_the_answer_is_there_at_once() {
    let options = Options { line_timing: false, ..Options::default() };
    let mut scene = Scene::with(&dynamixels(&[1, 2]), options);
    scene.set("j1", "Return Delay Time", 250);
    scene.world.transmit(0, &sync_read(0x82, 132, 4, &[1, 2]), 1_000_000);
    let mut buf = [0; 64];
    assert_eq!(scene.world.receive(0, &mut buf, 0), 30);
    assert_eq!(scene.world.now_ns(), 0);
}

#[test]
fn a_pause_of_more_than_1500_us_ends_an_unfinished_packet() {
    for (pause_ns, answered) in [(1_499_000, true), (1_501_000, false)] {
        let mut scene = Scene::new(&dynamixels(&[1]));
        let ping = hex(PING_1);
        scene.world.transmit(0, &ping[..5], 1_000_000);
        scene.world.run_until(5 * BYTE_NS + pause_ns);
        assert_eq!(!scene.ask(&ping[5..]).is_empty(), answered, "{pause_ns}");
        assert!(!scene.ask(&ping).is_empty(), "the next packet is heard");
    }
}

#[test]
fn a_wrong_crc_is_ignored_and_the_next_packet_heard() {
    let mut scene = Scene::new(&dynamixels(&[1]));
    let mut bytes = hex(PING_1);
    bytes[8] ^= 1;
    assert_eq!(scene.ask(&bytes), [0_u8; 0]);
    bytes.extend(hex("12 FF FF FD FF FF FF"));
    bytes.extend(hex(PING_1));
    assert_eq!(scene.tell(&bytes).len(), 1);
}

#[test]
fn at_a_wrong_baud_rate_nothing_is_understood() {
    let mut scene = Scene::new(&dynamixels(&[1]));
    scene.baud_bps = 57_600;
    assert_eq!(scene.ask(&hex(PING_1)), [0_u8; 0]);
    scene.baud_bps = 1_020_000;
    assert_eq!(scene.ask(&hex(PING_1)).len(), 14, "two per cent off is read");
}

#[test]
fn a_status_under_way_while_the_host_changes_its_rate_is_garbage() {
    let mut scene = Scene::new(&dynamixels(&[1]));
    scene.world.transmit(0, &hex(PING_1), 1_000_000);
    scene.world.run_until(12 * BYTE_NS);
    scene.baud_bps = 57_600;
    let answer = scene.ask(&[0x00]);
    assert_eq!(answer.len(), 14);
    assert_ne!(answer, hex("FF FF FD 00 01 07 00 55 00 FC 03 2D 00 00")[..]);
    assert!(answer[..4] != [0xFF, 0xFF, 0xFD, 0x00]);
}

#[test]
fn a_host_that_talks_into_a_status_spoils_it() {
    let mut scene = Scene::new(&dynamixels(&[1]));
    let ping = hex(PING_1);
    scene.world.transmit(0, &ping, 1_000_000);
    scene.world.run_until(15 * BYTE_NS);
    scene.world.transmit(0, &ping, 1_000_000);
    let answer = scene.ask(&[]);
    assert_eq!(answer.len(), 14, "the second ping was spoilt too");
    assert_eq!(answer[..5], [0xFF, 0xFF, 0xFD, 0x00, 0x01]);
    assert!(std::panic::catch_unwind(|| statuses(&answer)).is_err());
    let verdict = scene.world.verdict();
    assert_eq!(verdict.statuses, 1);
}

#[test]
fn two_servos_with_one_id_and_equal_words_are_not_told_apart() {
    let mut scene = Scene::new(&dynamixels(&[1]));
    assert!(scene.world.duplicate("j1", 0.3));
    assert_eq!(scene.tell(&hex(PING_1)).len(), 1);
    // Positions differ, so the line carries their bitwise AND and no CRC holds.
    let answer = scene.ask(&read(1, 132, 4));
    assert_eq!(answer.len(), 15);
    assert!(std::panic::catch_unwind(|| statuses(&answer)).is_err());
}

#[test]
fn after_a_missing_servo_the_chain_is_silent_or_goes_on_as_chosen() {
    let robot = dynamixels(&[1, 2, 3]);
    for (choice, expected) in [
        (MissingInChain::Silent, vec![1]),
        (MissingInChain::AnswerAfter { gap_ns: 300_000 }, vec![1, 3]),
    ] {
        let options = Options { missing_in_chain: choice, ..Options::default() };
        let mut scene = Scene::with(&robot, options);
        scene.world.unplug("j2").unwrap();
        let answer = scene.tell(&sync_read(0x82, 132, 4, &[1, 2, 3]));
        assert_eq!(answer.iter().map(|status| status.id).collect::<Vec<_>>(), expected);
        // A merged status is cut off in either case.
        assert_eq!(scene.ask(&sync_read(0x8A, 132, 4, &[1, 2, 3])).len(), 16);
    }
}

#[test]
fn an_adapter_with_echo_and_latency_gives_both() {
    let options = Options { echo: true, adapter_latency_ns: 1_000_000, ..Options::default() };
    let mut scene = Scene::with(&dynamixels(&[1]), options);
    scene.world.transmit(0, &hex(PING_1), 1_000_000);
    let times = arrivals(&mut scene.world, 10_000_000);
    assert_eq!(times, [(10 * BYTE_NS + 1_000_000, 10), (24 * BYTE_NS + 1_000_000, 14)]);
}

#[test]
fn bytes_are_sent_after_those_before_them() {
    let mut scene = Scene::new(&dynamixels(&[1, 2]));
    scene.world.transmit(0, &write(0xFE, 65, &[1]), 1_000_000);
    scene.world.transmit(0, &instruction(2, 1, &[]), 1_000_000);
    let times = arrivals(&mut scene.world, 10_000_000);
    assert_eq!(times, [((13 + 10 + 14) * BYTE_NS, 14)]);
}

#[test]
fn discarded_input_does_not_come_back() {
    let mut scene = Scene::new(&dynamixels(&[1]));
    scene.world.transmit(0, &hex(PING_1), 1_000_000);
    scene.wait_ms(5);
    scene.world.discard_input(0);
    assert_eq!(scene.ask(&[]), [0_u8; 0]);
}

#[test]
fn broadcast_ping_answers_fall_into_the_slots_of_their_ids() {
    let mut scene = Scene::new(&dynamixels(&[5, 2]));
    scene.world.transmit(0, &instruction(0xFE, 1, &[]), 1_000_000);
    let times = arrivals(&mut scene.world, 100_000_000);
    let slot_ns = 14 * BYTE_NS + 3_000_000;
    let end = |id: u64| 10 * BYTE_NS + id * slot_ns + 14 * BYTE_NS;
    assert_eq!(times, [(end(2), 14), (end(5), 14)]);
}
