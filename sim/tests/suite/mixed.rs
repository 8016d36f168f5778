//! Families of servos on one line: each hears everything and answers only what it understands.

use crate::scene::{Scene, feetech, hex, instruction, mixed, read, statuses};

const MIXTURE: [(&str, u8); 5] =
    [("xl430-w250", 1), ("ax-12a", 2), ("sts3215", 3), ("scs0009", 4), ("mx-28", 5)];

#[test]
fn each_servo_answers_in_its_own_protocol() {
    let mut scene = Scene::new(&mixed(&MIXTURE));
    assert_eq!(scene.tell(&instruction(1, 1, &[])).len(), 1);
    for id in 2..=5 {
        assert_eq!(scene.ask(&feetech(id, 1, &[])), feetech(id, 0, &[]), "ID {id}");
        assert_eq!(scene.ask(&instruction(id, 1, &[])), [0_u8; 0], "ID {id}");
    }
    assert_eq!(scene.ask(&feetech(1, 1, &[])), [0_u8; 0]);
}

#[test]
fn packets_of_two_protocols_may_follow_each_other_at_once() {
    let mut scene = Scene::new(&mixed(&MIXTURE));
    // Writes to everyone are not answered, so nothing collides.
    let led = |on| {
        let dynamixel2 = instruction(0xFE, 3, &[65, 0, on]);
        [dynamixel2, feetech(0xFE, 3, &[25, on])].concat()
    };
    scene.ask(&[led(1), hex("FF FF FD FF"), led(1)].concat());
    for joint in ["j1", "j2", "j5"] {
        assert_eq!(scene.get(joint, "LED"), 1, "{joint}");
    }
}

#[test]
fn a_packet_among_another_protocols_parameters_is_heard_as_one() {
    let mut scene = Scene::new(&mixed(&[("xm430-w350", 1), ("ax-12a", 2)]));
    // LED on for the AX-12A, in the indirect data of the XM430.
    let mut params = vec![224, 0];
    params.extend(feetech(0xFE, 3, &[25, 1]));
    assert_eq!(scene.tell(&instruction(1, 3, &params)).len(), 1);
    assert_eq!(scene.get("j2", "LED"), 1);
}

#[test]
fn words_of_scs_are_big_endian_and_those_of_sts_little_endian() {
    let mut scene = Scene::new(&mixed(&[("scs0009", 1), ("sts3215", 2)]));
    scene.set("j1", "Present Position", 511);
    // Computed.
    assert_eq!(scene.ask(&feetech(1, 2, &[56, 2])), hex("FF FF 01 04 00 01 FF FA"));
    scene.set("j2", "Present Position", 511);
    assert_eq!(scene.ask(&feetech(2, 2, &[56, 2])), feetech(2, 0, &[0xFF, 0x01]));
}

#[test]
fn scs_knows_neither_sync_read_nor_a_ping_to_everyone() {
    let mut scene = Scene::new(&mixed(&[("scs0009", 1), ("sts3215", 2)]));
    assert_eq!(scene.ask(&feetech(0xFE, 1, &[])), feetech(2, 0, &[]));
    let sync_read = |ids: &[u8]| feetech(0xFE, 0x82, &[&[56, 2], ids].concat());
    assert_eq!(scene.ask(&sync_read(&[2, 1])).len(), 8);
    assert_eq!(scene.ask(&sync_read(&[1, 2])), [0_u8; 0], "the STS waits for the SCS");
}

#[test]
fn one_id_in_two_families_of_one_frame_collides() {
    let mut scene = Scene::new(&mixed(&[("ax-12a", 1), ("sts3215", 1)]));
    let answer = scene.ask(&feetech(1, 2, &[3, 1]));
    let sound = [feetech(1, 0, &[1]), feetech(1, 0, &[9])];
    assert!(!answer.is_empty());
    assert!(!sound.contains(&answer), "{answer:02X?}");
}

#[test]
fn an_instruction_two_families_understand_counts_once() {
    let mut scene = Scene::new(&mixed(&[("ax-12a", 1), ("sts3215", 2)]));
    scene.ask(&feetech(2, 1, &[]));
    assert_eq!(scene.world.verdict().instructions, 1);
}

#[test]
fn only_the_watchdog_of_the_family_spoken_to_is_fed() {
    let mut scene = Scene::new(&mixed(&[("xl430-w250", 1), ("ax-12a", 2)]));
    for packet in [[64, 0, 1], [98, 0, 5]] {
        scene.ask(&instruction(1, 3, &packet));
    }
    for _ in 0..10 {
        scene.ask(&feetech(2, 1, &[]));
    }
    let answer = statuses(&scene.ask(&read(1, 98, 1)));
    assert_eq!(answer[0].params, [0xFF]);
}

#[test]
fn lines_of_a_robot_do_not_disturb_each_other() {
    let robot = gaitway_profiles::robot("poppy-humanoid").unwrap();
    let mut world = gaitway_sim::World::new(&robot, gaitway_sim::Options::default()).unwrap();
    let lines: Vec<(u8, u32)> = robot
        .lines
        .iter()
        .map(|line| (robot.joints_on(&line.name).next().unwrap().id, line.baud_bps().unwrap()))
        .collect();
    assert_eq!(lines.len(), 2);
    // Both are asked at once.
    for (line, &(id, baud_bps)) in lines.iter().enumerate() {
        world.transmit(line, &feetech(id, 1, &[]), baud_bps);
    }
    for (line, &(id, _)) in lines.iter().enumerate() {
        let mut answer = [0; 64];
        let count = world.receive(line, &mut answer, 100_000_000);
        assert_eq!(answer[..count], feetech(id, 0, &[]));
    }
}
