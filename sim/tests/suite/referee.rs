//! Each rule of the referee with a scene that breaks it and a twin that does not.

use crate::scene::{
    Scene, dynamixels, feetech, instruction, mixed, sync_read, sync_write_goals, write,
};
use gaitway_sim::{Options, Rule};

/// One joint: -1.5..1.5 rad, at most 4.796 rad/s.
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
    for (step, rules) in [(32, vec![]), (33, vec![Rule::GoalStep])] {
        let mut scene = holding();
        goal(&mut scene, 2048);
        for raw in [2048 + step, 2048 + step] {
            goal(&mut scene, raw);
        }
        assert_eq!(broken(&scene), rules, "{step}");
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
        let mut goal = |raw: i16| {
            let [a, b] = word(raw);
            scene.ask(&feetech(1, 3, &[address, a, b]));
            scene.wait_ms(2000);
            broken(&scene)
        };
        assert_eq!(goal(zero), [], "{servo}");
        let mut rules = goal(zero + limit - 1);
        rules.retain(|&rule| rule != Rule::RestAtEnds);
        assert_eq!(rules, [], "{servo}");
        assert!(goal(zero + limit + 2).contains(&Rule::GoalInsideLimits), "{servo}");
        assert!(goal(zero - limit - 2).contains(&Rule::GoalInsideLimits), "{servo}");
        assert_eq!(scene.world.verdict().goals, 4, "{servo}");
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
