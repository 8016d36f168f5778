//! Each rule of the referee with a scene that breaks it and a twin that does not.

use crate::scene::{
    Scene, dynamixels, feetech, instruction, mixed, read, sync_read, sync_write_goals, write,
};
use gaitway_sim::{Damage, Fault, Options, Rule};

/// One joint: -1.5..1.5 rad, at most 4.796 rad/s and 23.981 rad/s2.
fn scene() -> Scene {
    Scene::with(&dynamixels(&[1]), Options::default())
}

/// With torque on at the present position.
fn holding() -> Scene {
    let mut scene = scene();
    goal(&mut scene, 2048);
    scene.ask(&write(1, 64, &[1]));
    scene
}

/// Writes a goal and lets 10 ms pass.
fn goal(scene: &mut Scene, raw: i32) {
    scene.world.transmit(0, &sync_write_goals(&[(1, raw)]), 1_000_000);
    scene.wait_ms(10);
}

fn broken(scene: &Scene) -> Vec<Rule> {
    scene.world.verdict().violations.iter().map(|violation| violation.rule).collect()
}

/// How often these rules were broken.
fn counts<const N: usize>(scene: &Scene, rules: [Rule; N]) -> [u64; N] {
    let verdict = scene.world.verdict();
    rules.map(|rule| verdict.count(rule))
}

#[test]
fn r1_goals_stay_inside_the_joint_limits() {
    // 1.5 rad is 977.8 counts; rounding to the next count is forgiven.
    for (raw, rules) in [(2048 + 978, vec![]), (2048 + 979, vec![Rule::GoalInsideLimits; 2])] {
        let mut scene = scene();
        goal(&mut scene, raw);
        goal(&mut scene, raw);
        assert_eq!(broken(&scene), rules, "{raw}");
    }
}

#[test]
fn r1_counts_goals_the_servo_refuses_too() {
    let mut scene = scene();
    assert_eq!(scene.error(&write(1, 116, &5000_i32.to_le_bytes())), 6);
    let verdict = scene.world.verdict();
    assert_eq!(verdict.violations[0].rule, Rule::GoalInsideLimits);
    assert_eq!(verdict.violations[0].joint.as_deref(), Some("j1"));
    assert_eq!(verdict.goals, 0);
}

#[test]
fn r2_a_goal_steps_no_further_than_the_joint_can_go_since_the_last() {
    // In 10 ms 4.796 rad/s make 31.3 counts; one more is allowed.
    for (step, count) in [(32, 0), (33, 1)] {
        let mut scene = holding();
        goal(&mut scene, 2048);
        for raw in [2048 + step, 2048 + step] {
            goal(&mut scene, raw);
        }
        assert_eq!(counts(&scene, [Rule::GoalStep]), [count], "{step}");
    }
}

#[test]
fn r2_a_pause_of_the_host_buys_a_tenth_of_a_second_and_no_more() {
    // 100 ms at 4.796 rad/s are 312.65 counts; one more is allowed.
    for (pause_ms, step, count) in [(90, 282, 0), (90, 284, 1), (5_000, 313, 0), (5_000, 314, 1)] {
        let mut scene = holding();
        goal(&mut scene, 2048);
        scene.wait_ms(pause_ms - 10);
        goal(&mut scene, 2048 + step);
        assert_eq!(counts(&scene, [Rule::GoalStep]), [count], "{pause_ms} ms, {step}");
    }
}

#[test]
fn r2_a_servo_that_hears_nothing_while_its_host_talks_is_no_pause() {
    let silent = Fault::Silent { joint: "j1".into(), from_ns: 100_000_000, until_ns: 595_000_000 };
    let options = Options { faults: vec![silent], ..Options::default() };
    let mut scene = Scene::with(&dynamixels(&[1]), options);
    goal(&mut scene, 2048);
    scene.ask(&write(1, 64, &[1]));
    // 10 counts every 10 ms: 1.5 rad/s. It misses some forty of them.
    let mut raw = 2048;
    while scene.world.now_ns() < 700_000_000 {
        raw += 10;
        goal(&mut scene, raw);
    }
    assert_eq!(counts(&scene, [Rule::GoalStep]), [0]);
}

#[test]
fn r2_a_goal_where_the_joint_stands_is_never_too_far() {
    // The joint is blocked; its goal may come back to it at once, but not to beside it.
    for (back, count) in [(0, 0), (13, 0), (14, 1)] {
        let stuck = Fault::StuckPosition { joint: "j1".into(), from_ns: 0, until_ns: u64::MAX };
        let options = Options { faults: vec![stuck], ..Options::default() };
        let mut scene = Scene::with(&dynamixels(&[1]), options);
        goal(&mut scene, 2048);
        scene.ask(&write(1, 64, &[1]));
        for raw in [2068, 2088, 2108, 2128, 2148] {
            goal(&mut scene, raw);
        }
        goal(&mut scene, 2048 + back);
        assert_eq!(counts(&scene, [Rule::GoalStep]), [count], "{back}");
    }
}

#[test]
fn r2_does_not_judge_goals_without_torque() {
    let mut scene = scene();
    for raw in [2048, 2048, 2500, 2500] {
        goal(&mut scene, raw);
    }
    assert_eq!(broken(&scene), []);
}

#[test]
fn r2b_motions_begin_and_end_at_rest() {
    for (goals, rules) in [
        (vec![2048, 2048, 2050, 2050], vec![]),
        (vec![2048, 2050, 2050], vec![Rule::RestAtEnds]),
        (vec![2048, 2048, 2050], vec![Rule::RestAtEnds]),
        (vec![2048], vec![]),
    ] {
        let mut scene = scene();
        for raw in &goals {
            goal(&mut scene, *raw);
        }
        assert_eq!(broken(&scene), rules, "{goals:?}");
    }
}

#[test]
fn r3_torque_comes_on_only_near_the_goal() {
    // 0.02 rad is 13.04 counts.
    for (raw, rules) in [(2048 + 13, vec![]), (2048 + 14, vec![Rule::TorqueOn])] {
        let mut scene = scene();
        goal(&mut scene, raw);
        scene.ask(&write(1, 64, &[1]));
        assert_eq!(broken(&scene), rules, "{raw}");
    }
}

#[test]
fn r4_eeprom_is_written_with_permission_only() {
    let mut scene = scene();
    scene.world.permit_eeprom(true);
    scene.ask(&write(1, 9, &[1]));
    assert_eq!(broken(&scene), []);
    scene.world.permit_eeprom(false);
    scene.ask(&write(1, 9, &[1]));
    scene.ask(&write(1, 64, &[1]));
    scene.ask(&write(1, 9, &[1]));
    assert_eq!(broken(&scene), [Rule::Eeprom, Rule::Eeprom], "a refused write counts");
}

#[test]
fn r5_after_a_stop_no_goal_moves() {
    let mut scene = holding();
    goal(&mut scene, 2048);
    scene.world.declare_stop();
    goal(&mut scene, 2048);
    assert_eq!(broken(&scene), []);
    goal(&mut scene, 2049);
    goal(&mut scene, 2049);
    assert_eq!(broken(&scene), [Rule::GoalAfterStop]);
}

#[test]
fn r6_no_instruction_while_statuses_are_due() {
    // Ping: 10 bytes out, 14 back.
    for (wait_us, rules) in [(240, vec![]), (239, vec![Rule::ReplyWindow])] {
        let mut scene = scene();
        scene.world.transmit(0, &instruction(1, 1, &[]), 1_000_000);
        scene.world.run_until(wait_us * 1_000);
        scene.ask(&sync_write_goals(&[(1, 2048)]));
        assert_eq!(broken(&scene), rules, "{wait_us}");
    }
}

#[test]
fn r6_waits_for_a_servo_that_stays_silent_too() {
    let mut scene = scene();
    let silent =
        gaitway_sim::Fault::Silent { joint: "j1".into(), from_ns: 0, until_ns: 1_000_000_000 };
    let options = Options { faults: vec![silent], ..Options::default() };
    let mut mute = Scene::with(&dynamixels(&[1]), options);
    for scene in [&mut scene, &mut mute] {
        scene.world.transmit(0, &instruction(1, 1, &[]), 1_000_000);
        scene.world.run_until(200_000);
        scene.ask(&sync_write_goals(&[(1, 2048)]));
        assert_eq!(broken(scene), [Rule::ReplyWindow]);
    }
}

/// Reads the joint's position, which takes less than a millisecond.
fn look(scene: &mut Scene) {
    scene.world.transmit(0, &read(1, 132, 4), 1_000_000);
    let deadline_ns = scene.world.now_ns() + 1_000_000;
    assert!(scene.world.receive(0, &mut [0; 64], deadline_ns) > 0);
}

/// A joint that is blocked, under torque, with its goal where it stands.
fn blocked(faults: Vec<Fault>) -> Scene {
    let stuck = Fault::StuckPosition { joint: "j1".into(), from_ns: 0, until_ns: u64::MAX };
    let faults = [vec![stuck], faults].concat();
    let mut scene = Scene::with(&dynamixels(&[1]), Options { faults, ..Options::default() });
    goal(&mut scene, 2048);
    scene.ask(&write(1, 64, &[1]));
    scene
}

/// The first goal, counted from 2048, that broke R11.
fn farthest(scene: &mut Scene, step: i32, mut between: impl FnMut(&mut Scene, i32)) -> Option<i32> {
    (1..=40).map(|k| k * step).find(|&away| {
        between(scene, away);
        goal(scene, 2048 + away);
        counts(scene, [Rule::GoalDistance]) == [1]
    })
}

#[test]
fn r11_a_host_that_sees_a_joint_stand_drives_its_goal_no_further_than_the_bound() {
    // 0.35 rad are 228.17 counts, and one more is allowed. The joint is read right before each
    // goal: of a step of 10 counts in 10.5 ms only what the last 0.4 ms of it are worth counts.
    let mut scene = blocked(Vec::new());
    let first = farthest(&mut scene, 10, |scene, _| look(scene));
    assert_eq!(first, Some(230));
    // In turn, every fourth cycle: three steps more.
    let mut scene = blocked(Vec::new());
    let in_turn = |scene: &mut Scene, away: i32| {
        if (away / 10) % 4 == 1 {
            look(scene);
        }
    };
    let first = farthest(&mut scene, 10, in_turn);
    assert_eq!(first, Some(250), "read before goals 210 and 250");
    // Who never looks knows nothing.
    let mut scene = blocked(Vec::new());
    assert_eq!(farthest(&mut scene, 10, |_, _| {}), None);
}

#[test]
fn r11_a_goal_that_stays_or_comes_back_is_not_driven_on() {
    let mut scene = blocked(Vec::new());
    for raw in (2048..2300).step_by(10).chain([2298; 5]).chain((2050..2290).rev().step_by(10)) {
        look(&mut scene);
        goal(&mut scene, raw);
    }
    // On the way there 2278, 2288 and 2298 are beyond 2048 + 229.5; none after them.
    assert_eq!(counts(&scene, [Rule::GoalDistance]), [3]);
}

#[test]
fn r11_a_joint_that_follows_may_go_anywhere() {
    let mut scene = holding();
    for raw in (2048..2900).step_by(20) {
        look(&mut scene);
        goal(&mut scene, raw);
    }
    assert_eq!(counts(&scene, [Rule::GoalDistance]), [0]);
}

#[test]
fn r11_only_what_arrives_whole_has_been_read() {
    let until_ns = u64::MAX;
    for damage in [
        Damage::Mute,
        Damage::FlipBit { bit: Some(77) },
        Damage::DropByte { at: Some(3) },
        Damage::Lie { at: 1, xor: 4 },
        Damage::Garbage { length: 3 },
    ] {
        let fault =
            Fault::Statuses { of: None, from_ns: 60_000_000, until_ns, probability: 1.0, damage };
        let mut scene = blocked(vec![fault]);
        let ask = |scene: &mut Scene, _: i32| {
            scene.ask(&read(1, 132, 4));
        };
        assert_eq!(farthest(&mut scene, 10, ask), None, "{damage:?}");
    }
    // What the host throws away unread it has not read either.
    let mut scene = blocked(Vec::new());
    let throw_away = |scene: &mut Scene, _: i32| {
        scene.world.transmit(0, &read(1, 132, 4), 1_000_000);
        scene.wait_ms(2);
        scene.world.discard_input(0);
    };
    assert_eq!(farthest(&mut scene, 10, throw_away), None);
}

#[test]
fn r11_what_a_hand_or_a_fault_turns_is_not_the_hosts_doing() {
    // The encoder jumps by half a turn's quarter, the servo brings the shaft after it.
    let jump = Fault::PositionJump { joint: "j1".into(), at_ns: 300_000_000, counts: 700 };
    let mut scene =
        Scene::with(&dynamixels(&[1]), Options { faults: vec![jump], ..Options::default() });
    goal(&mut scene, 2048);
    scene.ask(&write(1, 64, &[1]));
    for k in 0..80 {
        look(&mut scene);
        if k == 60 {
            assert!(scene.world.place_joint("j1", -1.2));
        }
        goal(&mut scene, 2048 + 5 * k);
    }
    assert_eq!(counts(&scene, [Rule::GoalDistance]), [0]);
    // Blocked as well, it stands either where it was or where it reads: the goal may go as far
    // from there as ever, 229.2 counts and a little.
    for (counts, first) in [(-700, 240), (700, 960)] {
        let jump = Fault::PositionJump { joint: "j1".into(), at_ns: 60_000_000, counts };
        let mut scene = blocked(vec![jump]);
        assert_eq!(farthest(&mut scene, 40, |scene, _| look(scene)), Some(first), "{counts}");
    }
}

#[test]
fn r11_in_every_way_of_reading() {
    // Sync, fast sync and bulk reads, through indirect data, and the one byte too few.
    let indirect: Vec<u8> = (132..136_u16).flat_map(u16::to_le_bytes).collect();
    let ways: [(Vec<u8>, bool); 6] = [
        (sync_read(0x82, 132, 4, &[1]), true),
        (sync_read(0x8A, 126, 10, &[1]), true),
        (instruction(0xFE, 0x92, &[1, 132, 0, 4, 0]), true),
        (read(1, 224, 4), true),
        (read(1, 132, 3), false),
        (read(1, 116, 4), false),
    ];
    for (way, told) in ways {
        let mut scene = blocked(Vec::new());
        scene.ask(&write(1, 64, &[0]));
        scene.ask(&write(1, 168, &indirect));
        scene.ask(&write(1, 64, &[1]));
        let ask = |scene: &mut Scene, _: i32| {
            scene.world.transmit(0, &way, 1_000_000);
            let deadline_ns = scene.world.now_ns() + 1_000_000;
            assert!(scene.world.receive(0, &mut [0; 64], deadline_ns) > 0);
        };
        let first = farthest(&mut scene, 10, ask);
        assert_eq!(first, told.then_some(230), "{way:02X?}");
    }
}

/// Goals of a motion that gains and loses speed with this acceleration for 100 ms each, and rests,
/// as the counts nearest to them, at these times.
fn ride(acceleration_rad_s2: f64, times_ms: &[u64]) -> Vec<(u64, i32)> {
    let counts_per_rad = 4096.0 / std::f64::consts::TAU;
    let place = |ms: u64| {
        let (t, a) = (ms as f64 * 1e-3, acceleration_rad_s2);
        let rad = match ms {
            0..100 => 0.5 * a * t * t,
            100..200 => a * 0.01 - 0.5 * a * (0.2 - t) * (0.2 - t),
            _ => a * 0.01,
        };
        2048 + (rad * counts_per_rad).round() as i32
    };
    times_ms.iter().map(|&ms| (ms, place(ms))).collect()
}

fn ridden(goals: &[(u64, i32)]) -> Scene {
    let mut scene = holding();
    let start_ns = scene.world.now_ns();
    for &(ms, raw) in goals {
        scene.world.run_until(start_ns + ms * 1_000_000);
        scene.world.transmit(0, &sync_write_goals(&[(1, raw)]), 1_000_000);
    }
    scene.wait_ms(10);
    scene
}

#[test]
fn r12_a_motion_within_twice_the_acceleration_may_be_sampled_at_any_times() {
    // Even, uneven, late by more than a cycle, and in pairs.
    let even: Vec<u64> = (0..25).map(|k| 10 * k).collect();
    let uneven: Vec<u64> = (0..25).map(|k| 10 * k + (k * k * 7) % 9).collect();
    let late: Vec<u64> = vec![0, 10, 20, 75, 80, 90, 165, 170, 180, 190, 240, 250];
    let pairs: Vec<u64> = (0..13).flat_map(|k| [20 * k, 20 * k + 1]).collect();
    // The limit is 23.981: twice that, a little less, and what is three times as much.
    for times_ms in [&even, &uneven, &late, &pairs] {
        assert_eq!(broken(&ridden(&ride(47.9, times_ms))), [], "{times_ms:?}");
    }
    for times_ms in [&even, &uneven, &late] {
        let rough = ridden(&ride(75.0, times_ms));
        assert!(rough.world.verdict().count(Rule::SpeedChange) > 0, "{times_ms:?}");
    }
}

#[test]
fn r12_rounding_to_counts_is_a_count_in_each_speed_and_no_more() {
    // From rest: 47.962 rad/s2 for the middle half of 100 ms make 156.3 counts in 100 ms, and one
    // is rounding. The motion ends there, which is one more.
    for (step, count) in [(157, 1), (158, 2)] {
        let mut scene = holding();
        scene.wait_ms(500);
        goal(&mut scene, 2048 + step);
        assert_eq!(counts(&scene, [Rule::SpeedChange]), [count], "{step}");
    }
    // Between two speeds, 10 ms apart, it is 3.13 counts, and one for each.
    for (step, count) in [(15, 0), (16, 1), (5, 0), (4, 1)] {
        let mut scene = holding();
        for raw in (2048..2400).step_by(10) {
            goal(&mut scene, raw);
        }
        let before = counts(&scene, [Rule::SpeedChange]);
        goal(&mut scene, 2398 + step);
        let more = counts(&scene, [Rule::SpeedChange])[0] - before[0];
        assert_eq!(more, count, "from 10 to {step} counts a cycle");
    }
}

#[test]
fn r12_a_motion_that_breaks_off_has_not_come_to_rest() {
    let times_ms: Vec<u64> = (0..15).map(|k| 10 * k).collect();
    let scene = ridden(&ride(20.0, &times_ms));
    assert_eq!(broken(&scene), [Rule::RestAtEnds, Rule::SpeedChange]);
    assert_eq!(scene.world.verdict().violations[1].joint.as_deref(), Some("j1"));
    // Stopped from 1 rad/s at once: as abrupt, and at rest.
    let mut goals = ride(20.0, &times_ms);
    let last = goals[14].1;
    goals.extend([(150, last), (160, last)]);
    assert_eq!(broken(&ridden(&goals)), [Rule::SpeedChange]);
}

#[test]
fn r12_does_not_judge_a_limp_joint() {
    let mut scene = scene();
    for raw in [2048, 2048, 2100, 2300, 2300] {
        goal(&mut scene, raw);
    }
    assert_eq!(broken(&scene), []);
    // Nor the last goals before torque was taken.
    let mut scene = ridden(&ride(20.0, &[0, 10, 20, 30, 40]));
    scene.ask(&write(1, 64, &[0]));
    assert_eq!(counts(&scene, [Rule::SpeedChange]), [0]);
}

#[test]
fn r12_what_stood_before_torque_came_on_is_no_time_to_go_somewhere() {
    let mut scene = scene();
    goal(&mut scene, 2048);
    goal(&mut scene, 2048);
    for _ in 0..100 {
        scene.ask(&instruction(1, 1, &[]));
    }
    scene.ask(&write(1, 64, &[1]));
    goal(&mut scene, 2148);
    goal(&mut scene, 2148);
    // 0.15 rad within the 20 ms since torque came on, though the goal before is 2 s old.
    assert_eq!(broken(&scene), [Rule::GoalStep, Rule::SpeedChange, Rule::SpeedChange]);
}

#[test]
fn what_is_excused_is_counted_and_gone() {
    let mut scene = holding();
    for raw in [2048, 2048, 2148, 2148] {
        goal(&mut scene, raw);
    }
    let mut verdict = scene.world.verdict();
    assert_eq!(verdict.violation_count, 3);
    let excused = verdict.excuse(|violation| {
        violation.rule == Rule::SpeedChange && violation.joint.as_deref() == Some("j1")
    });
    assert_eq!((excused, verdict.count(Rule::SpeedChange)), (2, 0));
    assert!(!verdict.is_clean(), "the step stays");
    assert_eq!(verdict.excuse(|violation| violation.rule == Rule::GoalStep), 1);
    assert!(verdict.is_clean());
}

#[test]
fn r10_the_line_is_not_flooded() {
    // 24 bytes a round at 10 us: 240 us, so 250 us a round is 96 % and 280 us is 86 %.
    for (round_us, rules) in [(280, vec![]), (250, vec![Rule::LineLoad])] {
        let mut scene = scene();
        for round in 1..5_000 {
            scene.world.transmit(0, &instruction(1, 1, &[]), 1_000_000);
            scene.world.run_until(round * round_us * 1_000);
        }
        assert_eq!(broken(&scene), rules);
        let load = scene.world.verdict().line_load[0];
        let expected = 240.0 / round_us as f64;
        assert!((load - expected).abs() < 0.01, "{load} {expected}");
    }
}

#[test]
fn the_referee_counts_goals_instructions_and_statuses() {
    let mut scene = holding();
    scene.ask(&sync_read(0x82, 132, 4, &[1]));
    let verdict = scene.world.verdict();
    assert_eq!((verdict.goals, verdict.instructions, verdict.statuses), (1, 3, 2));
    assert!(verdict.is_clean());
    assert_eq!(Rule::RestAtEnds.code(), "R2b");
}

/// A word with the low or the high byte first.
type Word = fn(i16) -> [u8; 2];

/// Servos with the address of their goal.
const OTHER_FAMILIES: [(&str, u8, Word); 4] = [
    ("ax-12a", 30, i16::to_le_bytes),
    ("mx-28", 30, i16::to_le_bytes),
    ("sts3215", 42, i16::to_le_bytes),
    ("scs0009", 42, i16::to_be_bytes),
];

#[test]
fn goals_of_every_family_are_judged() {
    for (servo, address, word) in OTHER_FAMILIES {
        let position = &gaitway_profiles::servo(servo).unwrap().position;
        let zero = position.zero_count as i16;
        let limit_rad = 1.5;
        let counts_per_rad = f64::from(position.counts) / f64::from(position.degrees).to_radians();
        let limit = (limit_rad * counts_per_rad) as i16;
        let mut scene = Scene::with(&mixed(&[(servo, 1)]), Options::default());
        for (k, raw, outside) in [
            (1, zero, 0),
            (2, zero + limit - 1, 0),
            (3, zero + limit + 2, 1),
            (4, zero - limit - 2, 2),
        ] {
            let [a, b] = word(raw);
            scene.ask(&feetech(1, 3, &[address, a, b]));
            scene.wait_ms(2000);
            assert_eq!(counts(&scene, [Rule::GoalInsideLimits]), [outside], "{servo} {raw}");
            assert_eq!(scene.world.verdict().goals, k, "{servo}");
        }
    }
}

#[test]
fn torque_far_from_the_goal_is_seen_in_every_family() {
    for (servo, address, word) in OTHER_FAMILIES {
        let zero = gaitway_profiles::servo(servo).unwrap().position.zero_count as i16;
        for (goal, rules) in [(zero, vec![]), (zero + 100, vec![Rule::TorqueOn])] {
            let mut scene = Scene::with(&mixed(&[(servo, 1)]), Options::default());
            let [a, b] = word(goal);
            scene.ask(&feetech(1, 3, &[address, a, b]));
            let torque = if address == 30 { 24 } else { 40 };
            scene.ask(&feetech(1, 3, &[torque, 1]));
            assert_eq!(broken(&scene), rules, "{servo} {goal}");
        }
    }
}

#[test]
fn eeprom_of_every_family_is_watched() {
    for (servo, ..) in OTHER_FAMILIES {
        let mut scene = Scene::with(&mixed(&[(servo, 1)]), Options::default());
        let id = if servo.starts_with('s') { 5 } else { 3 };
        scene.ask(&feetech(1, 3, &[id, 2]));
        assert_eq!(broken(&scene), [Rule::Eeprom], "{servo}");
    }
}
