//! Every operating mode of every family moves as its manual says.

use crate::scene::{Scene, dynamixels, feetech, instruction, mixed, write};
use gaitway_sim::{Options, ZeroSpeed};

const TORQUE_ENABLE: u16 = 64;
const GOAL_PWM: u16 = 100;
const GOAL_CURRENT: u16 = 102;
const GOAL_VELOCITY: u16 = 104;
const PROFILE_ACCELERATION: u16 = 108;
const GOAL_POSITION: u16 = 116;
/// 0.229 rev/min in pulses of 1/4096 turn per second.
const PULSES_PER_S: f64 = 0.229 / 60.0 * 4096.0;

fn set1(scene: &mut Scene, address: u16, value: u8) {
    assert_eq!(scene.error(&write(1, address, &[value])), 0, "{address} = {value}");
}

fn set2(scene: &mut Scene, address: u16, value: i16) {
    assert_eq!(scene.error(&write(1, address, &value.to_le_bytes())), 0, "{address} = {value}");
}

fn set4(scene: &mut Scene, address: u16, value: i32) {
    assert_eq!(scene.error(&write(1, address, &value.to_le_bytes())), 0, "{address} = {value}");
}

/// An XM430-W350 in an operating mode, its torque still off.
fn xm430(mode: u8) -> Scene {
    let mut scene = Scene::new(&dynamixels(&[1]));
    set1(&mut scene, 11, mode);
    scene
}

fn one(servo: &str) -> Scene {
    Scene::new(&mixed(&[(servo, 1)]))
}

/// Writes bytes to ID 1 in protocol 1.0's frame; returns the error byte.
fn put(scene: &mut Scene, address: u8, bytes: &[u8]) -> u8 {
    let answer = scene.ask(&feetech(1, 3, &[&[address], bytes].concat()));
    assert_eq!(answer.len(), 6, "{address}");
    answer[4]
}

fn put_word(scene: &mut Scene, address: u8, value: u16) -> u8 {
    put(scene, address, &value.to_le_bytes())
}

#[test]
fn velocity_mode_turns_at_the_goal_velocity_for_good() {
    let mut scene = xm430(1);
    set1(&mut scene, TORQUE_ENABLE, 1);
    set4(&mut scene, GOAL_VELOCITY, 100);
    scene.wait_ms(2_000);
    assert!((scene.get("j1", "Present Velocity") - 100).abs() <= 1);
    assert_eq!(scene.get("j1", "Velocity Trajectory"), 100);
    let from = scene.get("j1", "Present Position");
    scene.wait_ms(10_000);
    let turned = (scene.get("j1", "Present Position") - from) as f64;
    assert!((turned / (1_000.0 * PULSES_PER_S) - 1.0).abs() < 0.01, "{turned}");
    set4(&mut scene, GOAL_VELOCITY, -50);
    scene.wait_ms(2_000);
    assert!((scene.get("j1", "Present Velocity") + 50).abs() <= 1);
}

#[test]
fn in_velocity_mode_the_ramp_takes_64_v_over_a_ms() {
    let mut scene = xm430(1);
    set4(&mut scene, PROFILE_ACCELERATION, 5);
    set1(&mut scene, TORQUE_ENABLE, 1);
    let start_ns = scene.world.now_ns();
    set4(&mut scene, GOAL_VELOCITY, 100);
    // t1 = 64 * 100 / 5 = 1280 ms; half of the speed after half of it.
    scene.world.run_until(start_ns + 640_000_000);
    assert!((scene.get("j1", "Velocity Trajectory") - 50).abs() <= 1);
    scene.world.run_until(start_ns + 1_260_000_000);
    assert!(scene.get("j1", "Velocity Trajectory") < 100);
    scene.world.run_until(start_ns + 1_290_000_000);
    assert_eq!(scene.get("j1", "Velocity Trajectory"), 100);
}

#[test]
fn in_velocity_mode_with_a_time_based_profile_the_ramp_takes_a_ms() {
    let mut scene = xm430(1);
    set1(&mut scene, 10, 0x04);
    set4(&mut scene, PROFILE_ACCELERATION, 500);
    set1(&mut scene, TORQUE_ENABLE, 1);
    let start_ns = scene.world.now_ns();
    set4(&mut scene, GOAL_VELOCITY, 100);
    scene.world.run_until(start_ns + 250_000_000);
    assert!((scene.get("j1", "Velocity Trajectory") - 50).abs() <= 1);
    scene.world.run_until(start_ns + 502_000_000);
    assert_eq!(scene.get("j1", "Velocity Trajectory"), 100);
}

#[test]
fn pwm_mode_gives_the_duty_asked_for_and_no_more() {
    let mut scene = xm430(16);
    set1(&mut scene, TORQUE_ENABLE, 1);
    scene.wait_ms(500);
    assert_eq!(scene.get("j1", "Present Velocity"), 0, "no goal was written yet");
    set2(&mut scene, GOAL_PWM, 442);
    scene.wait_ms(1_000);
    assert_eq!(scene.get("j1", "Present PWM"), 442);
    // Half of 46 rev/min, less what load and friction take.
    let speed = scene.get("j1", "Present Velocity");
    assert!((80..=100).contains(&speed), "{speed}");
}

#[test]
fn current_mode_gives_the_current_asked_for() {
    let mut scene = xm430(0);
    set1(&mut scene, TORQUE_ENABLE, 1);
    scene.wait_ms(500);
    assert_eq!(scene.get("j1", "Present Velocity"), 0, "no goal was written yet");
    scene.world.transmit(0, &write(1, GOAL_CURRENT, &(-200_i16).to_le_bytes()), 1_000_000);
    scene.wait_ms(3);
    assert!((scene.get("j1", "Present Current") + 200).abs() <= 1);
    assert!(scene.get("j1", "Present Velocity") < 0);
}

#[test]
fn extended_position_mode_goes_over_many_turns_and_up_to_256() {
    let mut scene = xm430(4);
    set1(&mut scene, TORQUE_ENABLE, 1);
    set4(&mut scene, GOAL_POSITION, -3 * 4096);
    scene.wait_ms(8_000);
    assert!((scene.get("j1", "Present Position") + 3 * 4096).abs() <= 3);
    set4(&mut scene, GOAL_POSITION, 1_048_575);
    assert_eq!(scene.error(&write(1, GOAL_POSITION, &1_048_576_i32.to_le_bytes())), 4);
}

#[test]
fn position_mode_forgets_the_turns_of_other_modes() {
    let mut scene = xm430(4);
    scene.set("j1", "Present Position", 5 * 4096 + 100);
    set1(&mut scene, 11, 3);
    assert_eq!(scene.get("j1", "Present Position"), 100);
    // Pushed over the end by hand; torque coming on counts anew as well.
    scene.set("j1", "Present Position", 4096 + 7);
    scene.set("j1", "Goal Position", 7);
    set1(&mut scene, TORQUE_ENABLE, 1);
    assert_eq!(scene.get("j1", "Present Position"), 7);
}

#[test]
fn a_mode_the_servo_does_not_know_is_a_range_error() {
    let mut scene = Scene::new(&dynamixels(&[1]));
    assert_eq!(scene.error(&write(1, 11, &[2])), 4);
    let mut scene = one("xl430-w250");
    assert_eq!(scene.error(&write(1, 11, &[0])), 4, "an XL430 measures no current");
}

#[test]
fn a_change_of_mode_brings_goals_to_their_limits() {
    let mut scene = xm430(16);
    set2(&mut scene, GOAL_PWM, 100);
    set2(&mut scene, GOAL_CURRENT, 100);
    set1(&mut scene, 11, 5);
    assert_eq!(scene.get("j1", "Goal PWM"), 885);
    assert_eq!(scene.get("j1", "Goal Current"), 1193);
}

#[test]
fn goal_pwm_limits_the_duty_of_the_other_modes() {
    let mut scene = xm430(3);
    set1(&mut scene, TORQUE_ENABLE, 1);
    set2(&mut scene, GOAL_PWM, 200);
    scene.world.transmit(0, &write(1, GOAL_POSITION, &3_500_i32.to_le_bytes()), 1_000_000);
    for _ in 0..200 {
        scene.wait_ms(1);
        assert!(scene.get("j1", "Present PWM") <= 200);
    }
    assert!(scene.get("j1", "Present Position") > 2100);
}

#[test]
fn reverse_mode_mirrors_speed_current_and_duty() {
    let cases = [(1, GOAL_VELOCITY, 4), (16, GOAL_PWM, 2), (0, GOAL_CURRENT, 2)].map(
        |(mode, goal, size)| {
            let turned = |reverse| {
                let mut scene = xm430(mode);
                set1(&mut scene, 10, reverse);
                set1(&mut scene, TORQUE_ENABLE, 1);
                let bytes = 150_i32.to_le_bytes();
                assert_eq!(scene.error(&write(1, goal, &bytes[..size])), 0);
                scene.wait_ms(300);
                for register in ["Present Velocity", "Present PWM"] {
                    assert!(scene.get("j1", register) > 0, "{mode} {reverse} {register}");
                }
                assert!(scene.get("j1", "Present Position") > 2048);
                // What the shaft itself did, by the same register without reversal.
                set1(&mut scene, TORQUE_ENABLE, 0);
                scene.wait_ms(500);
                set1(&mut scene, 10, 0);
                scene.get("j1", "Present Position") - 2048
            };
            (turned(0), turned(1))
        },
    );
    for (normal, reversed) in cases {
        assert!(normal > 0 && reversed < 0, "{normal} {reversed}");
    }
}

#[test]
fn a_goal_brings_the_torque_on_if_drive_mode_says_so() {
    let mut scene = xm430(3);
    set4(&mut scene, GOAL_POSITION, 2_100);
    assert_eq!(scene.get("j1", "Torque Enable"), 0);
    set1(&mut scene, 10, 0x08);
    set4(&mut scene, GOAL_POSITION, 2_200);
    assert_eq!(scene.get("j1", "Torque Enable"), 1);
    scene.wait_ms(500);
    assert!((scene.get("j1", "Present Position") - 2_200).abs() <= 3);
}

#[test]
fn moving_status_tells_the_shape_of_the_profile() {
    // 0.229 rev/min, 214.577 rev/min²: 300 is reached within 64 * 300 / 1000 = 19 ms and 90 pulses.
    for (velocity, acceleration, distance, bits) in
        [(30, 0, 400, 0x12), (30, 20, 900, 0x32), (200, 5, 400, 0x22), (0, 20, 100, 0x00)]
    {
        let mut scene = xm430(3);
        set1(&mut scene, TORQUE_ENABLE, 1);
        set4(&mut scene, PROFILE_ACCELERATION, acceleration);
        set4(&mut scene, 112, velocity);
        set4(&mut scene, GOAL_POSITION, 2048 + distance);
        let status = scene.get("j1", "Moving Status");
        assert_eq!(status & 0x32, bits, "{velocity} {acceleration} {distance}: {status:02X}");
        scene.wait_ms(5_000);
        assert_eq!(scene.get("j1", "Moving Status"), 0x01, "in position");
    }
}

#[test]
fn a_shaft_that_cannot_follow_shows_a_following_error() {
    let fault =
        gaitway_sim::Fault::StuckPosition { joint: "j1".into(), from_ns: 0, until_ns: u64::MAX };
    let options = Options { faults: vec![fault], ..Default::default() };
    let mut scene = Scene::with(&dynamixels(&[1]), options);
    set1(&mut scene, TORQUE_ENABLE, 1);
    set4(&mut scene, GOAL_POSITION, 2_500);
    assert_eq!(scene.get("j1", "Moving Status"), 0x08);
}

#[test]
fn a_profile_may_not_last_longer_than_32737_ms() {
    let mut scene = xm430(3);
    set4(&mut scene, 112, 32_767);
    set1(&mut scene, 10, 0x04);
    assert_eq!(scene.error(&write(1, 112, &32_738_i32.to_le_bytes())), 4);
    set4(&mut scene, 112, 32_737);
}

#[test]
fn after_the_watchdog_has_bitten_a_wheel_waits_for_a_new_goal() {
    let mut scene = xm430(1);
    set1(&mut scene, TORQUE_ENABLE, 1);
    set4(&mut scene, GOAL_VELOCITY, 50);
    set1(&mut scene, 98, 10);
    scene.wait_ms(1_500);
    assert_eq!(scene.get("j1", "Bus Watchdog"), 255);
    assert_eq!(scene.get("j1", "Present Velocity"), 0);
    assert_eq!(scene.error(&write(1, GOAL_VELOCITY, &150_i32.to_le_bytes())), 4);
    set1(&mut scene, 98, 0);
    scene.wait_ms(500);
    assert_eq!(scene.get("j1", "Present Velocity"), 0);
    set4(&mut scene, GOAL_VELOCITY, 150);
    scene.wait_ms(2_000);
    assert!((scene.get("j1", "Present Velocity") - 150).abs() <= 1);
}

#[test]
fn any_instruction_on_the_line_feeds_the_watchdog() {
    let mut scene = Scene::new(&dynamixels(&[1, 2]));
    set1(&mut scene, TORQUE_ENABLE, 1);
    set1(&mut scene, 98, 3);
    for _ in 0..20 {
        scene.ask(&instruction(2, 1, &[]));
        scene.wait_ms(20);
    }
    assert_eq!(scene.get("j1", "Bus Watchdog"), 3);
}

// FEETECH STS3215.

#[test]
fn sts_speed_mode_turns_at_steps_per_second_with_its_acceleration() {
    let mut scene = one("sts3215");
    put(&mut scene, 33, &[1]);
    // 10 * 100 step/s²: 1000 step/s after a second.
    put(&mut scene, 41, &[10]);
    put(&mut scene, 40, &[1]);
    // -1000 is 1000 with bit 15 set.
    put_word(&mut scene, 46, 0x83E8);
    scene.wait_ms(480);
    let half = scene.get("j1", "Present Velocity");
    assert!((-520..=-350).contains(&half), "{half}");
    scene.wait_ms(3_000);
    assert!((scene.get("j1", "Present Velocity") + 1000).abs() <= 10);
    assert!((0..4096).contains(&scene.get("j1", "Present Position")), "within one turn");
    put_word(&mut scene, 46, 0);
    scene.wait_ms(3_000);
    assert_eq!(scene.get("j1", "Present Velocity"), 0);
}

#[test]
fn sts_pwm_mode_gives_the_duty_of_the_goal_time_register() {
    let mut scene = one("sts3215");
    put(&mut scene, 33, &[2]);
    put(&mut scene, 40, &[1]);
    // -50 %: bit 10 is the sign.
    put_word(&mut scene, 44, 500 | 1 << 10);
    scene.wait_ms(500);
    assert_eq!(scene.get("j1", "Present Load"), -500);
    assert!(scene.get("j1", "Present Velocity") < -1000);
}

#[test]
fn sts_step_mode_moves_by_the_goal_each_time_it_is_written() {
    let mut scene = one("sts3215");
    put(&mut scene, 33, &[3]);
    put(&mut scene, 40, &[1]);
    scene.wait_ms(200);
    assert_eq!(scene.get("j1", "Present Position"), 2048, "torque alone moves nothing");
    for k in 1..=3 {
        put_word(&mut scene, 42, 200);
        scene.wait_ms(500);
        assert!((scene.get("j1", "Present Position") - 2048 - 200 * k).abs() <= 4);
    }
    put_word(&mut scene, 42, 0x8000 | 600);
    scene.wait_ms(1_000);
    assert!((scene.get("j1", "Present Position") - 2048).abs() <= 4);
    put_word(&mut scene, 31, 100);
    scene.wait_ms(500);
    assert!((scene.get("j1", "Present Position") - 1948).abs() <= 4, "an offset is no step");
}

#[test]
fn sts_counts_turns_where_both_angle_limits_are_0() {
    let mut scene = one("sts3215");
    put(&mut scene, 9, &[0, 0, 0, 0]);
    put(&mut scene, 40, &[1]);
    put_word(&mut scene, 42, 10_000);
    scene.wait_ms(5_000);
    assert!((scene.get("j1", "Present Position") - 10_000).abs() <= 4);
    put_word(&mut scene, 42, 0x8000 | 5_000);
    scene.wait_ms(6_000);
    assert!((scene.get("j1", "Present Position") + 5_000).abs() <= 4);
}

#[test]
fn sts_reads_more_than_a_turn_with_phase_bit_4_only() {
    for (phase, reading) in [(0x00, 904), (0x10, 5_000)] {
        let mut scene = one("sts3215");
        scene.set("j1", "Phase", 0x10);
        scene.set("j1", "Present Position", 5_000);
        put(&mut scene, 18, &[phase]);
        assert_eq!(scene.get("j1", "Present Position"), reading);
    }
}

#[test]
fn sts_goal_speed_0_is_no_limit_unless_phase_is_asked() {
    let turned = |zero_speed, phase| {
        let options = Options { permit_eeprom: true, zero_speed, ..Options::default() };
        let mut scene = Scene::with(&mixed(&[("sts3215", 1)]), options);
        scene.set("j1", "Phase", phase);
        put(&mut scene, 40, &[1]);
        put_word(&mut scene, 42, 2_500);
        scene.wait_ms(1_000);
        scene.get("j1", "Present Position") > 2_490
    };
    assert!(turned(ZeroSpeed::NoLimit, 0x00));
    assert!(turned(ZeroSpeed::AsPhaseSays, 0x08));
    assert!(!turned(ZeroSpeed::AsPhaseSays, 0x00));
}

#[test]
fn damping_brakes_but_holds_no_position() {
    let mut scene = one("sts3215");
    put(&mut scene, 40, &[2]);
    put_word(&mut scene, 42, 3_000);
    scene.wait_ms(500);
    assert_eq!(scene.get("j1", "Present Position"), 2048);
    assert_eq!(scene.get("j1", "Torque Enable"), 2);
}

// FEETECH SCS0009: words are big-endian.

fn put_big(scene: &mut Scene, address: u8, words: &[u16]) {
    let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_be_bytes()).collect();
    put(scene, address, &bytes);
}

#[test]
fn an_scs_move_takes_the_running_time() {
    let mut scene = one("scs0009");
    put(&mut scene, 40, &[1]);
    let start_ns = scene.world.now_ns();
    // 300 counts in one second.
    put_big(&mut scene, 42, &[511 + 300, 1_000, 0]);
    scene.world.run_until(start_ns + 500_000_000);
    let half = scene.get("j1", "Present Position") - 511;
    assert!((140..=150).contains(&half), "{half}");
    assert!((scene.get("j1", "Present Velocity") - 300).abs() <= 5);
    scene.world.run_until(start_ns + 1_100_000_000);
    assert!((scene.get("j1", "Present Position") - 811).abs() <= 3);
    assert_eq!(scene.get("j1", "Moving"), 0);
}

#[test]
fn an_scs_without_angle_limits_is_a_wheel_that_reads_0_to_1023() {
    let mut scene = one("scs0009");
    put(&mut scene, 48, &[0]);
    put_big(&mut scene, 9, &[0, 0]);
    put(&mut scene, 40, &[1]);
    // 400 of 1000, clockwise.
    put_big(&mut scene, 44, &[400 | 1 << 10]);
    let mut seen = std::collections::BTreeSet::new();
    for _ in 0..400 {
        scene.wait_ms(10);
        let reading = scene.get("j1", "Present Position");
        assert!((0..=1023).contains(&reading));
        seen.insert(reading);
    }
    assert!(seen.contains(&0) && seen.contains(&1023), "the gap reads as its ends");
    assert_eq!(scene.get("j1", "Present Load"), -400);
}

// DYNAMIXEL AX-12A and MX with protocol 1.0.

#[test]
fn ax_moving_speed_is_0_111_rpm_a_count() {
    let mut scene = one("ax-12a");
    put(&mut scene, 24, &[1]);
    let start_ns = scene.world.now_ns();
    // Speed 100 is 11.1 rev/min or 66.6 deg/s; 300 counts are 87.9 deg.
    put(&mut scene, 30, &[(512_u16 + 300).to_le_bytes(), 100_u16.to_le_bytes()].concat());
    scene.world.run_until(start_ns + 660_000_000);
    let half = scene.get("j1", "Present Position") - 512;
    assert!((140..=150).contains(&half), "{half}");
    assert!((scene.get("j1", "Present Speed") - 100).abs() <= 2);
    scene.world.run_until(start_ns + 1_500_000_000);
    // One count of compliance margin each side.
    assert!((scene.get("j1", "Present Position") - 812).abs() <= 4);
}

#[test]
fn an_ax_goal_brings_the_torque_on() {
    let mut scene = one("ax-12a");
    put_word(&mut scene, 30, 600);
    assert_eq!(scene.get("j1", "Torque Enable"), 1);
    scene.wait_ms(1_000);
    assert!((scene.get("j1", "Present Position") - 600).abs() <= 4);
}

#[test]
fn a_steeper_compliance_slope_droops_less() {
    let lag = |slope: u8| {
        let mut scene = one("ax-12a");
        put(&mut scene, 28, &[slope, slope]);
        put(&mut scene, 24, &[1]);
        put(&mut scene, 30, &[(900_u16).to_le_bytes(), 300_u16.to_le_bytes()].concat());
        scene.wait_ms(200);
        let speed = scene.get("j1", "Present Speed");
        assert!((speed - 300).abs() <= 6, "{speed}");
        // Trajectory: 33.3 rev/min since the goal was heard.
        let ideal = 512.0 + 0.2207 * 33.3 * 6.0 / 300.0 * 1024.0;
        ideal - scene.get("j1", "Present Position") as f64
    };
    assert!(lag(16) < lag(64) - 5.0, "{} {}", lag(16), lag(64));
}

#[test]
fn an_ax_without_angle_limits_is_a_wheel_by_duty() {
    let mut scene = one("ax-12a");
    put(&mut scene, 6, &[0, 0, 0, 0]);
    put(&mut scene, 24, &[1]);
    put_word(&mut scene, 32, 1024 + 512);
    scene.wait_ms(1_000);
    // Half of the speed without load, clockwise, less load and friction.
    let facts = &gaitway_profiles::servo("ax-12a").unwrap().motor;
    let free = facts.no_load_speed_rad_s * 60.0 / std::f64::consts::TAU / 0.111;
    let share = scene.get("j1", "Present Speed") as f64 / free;
    assert!((-0.55..=-0.42).contains(&share), "{share}");
    put_word(&mut scene, 32, 1024);
    scene.wait_ms(1_000);
    assert_eq!(scene.get("j1", "Present Speed"), 0);
}

#[test]
fn an_mx_wheel_turns_at_its_speed_and_reads_0_to_4095() {
    let mut scene = one("mx-28");
    put(&mut scene, 6, &[0, 0, 0, 0]);
    put(&mut scene, 24, &[1]);
    put_word(&mut scene, 32, 300);
    let mut seen = std::collections::BTreeSet::new();
    for _ in 0..500 {
        scene.wait_ms(10);
        let reading = scene.get("j1", "Present Position");
        assert!((0..=4095).contains(&reading));
        seen.insert(reading / 1024);
    }
    assert_eq!(seen.len(), 4, "every quarter was passed");
    // 300 * 0.114 rpm, shown in counts of 0.11 rpm.
    assert!((scene.get("j1", "Present Speed") - 311).abs() <= 2);
    put_word(&mut scene, 32, 0);
    scene.wait_ms(2_000);
    assert_eq!(scene.get("j1", "Present Speed"), 0, "0 is stop for a wheel");
}

#[test]
fn an_mx_goal_acceleration_of_10_gives_14_3_rpm_after_a_second() {
    // e-Manual, Goal Acceleration(73), its own example.
    let mut scene = one("mx-64");
    put(&mut scene, 6, &[0, 0, 0, 0]);
    put(&mut scene, 73, &[10]);
    put(&mut scene, 24, &[1]);
    let start_ns = scene.world.now_ns();
    put_word(&mut scene, 32, 400);
    scene.world.run_until(start_ns + 1_000_000_000);
    let rpm = scene.get("j1", "Present Speed") as f64 * 0.11;
    assert!((rpm - 14.3).abs() < 1.5, "{rpm}");
}

#[test]
fn an_mx_with_both_limits_4095_counts_turns() {
    let mut scene = one("mx-28");
    put(&mut scene, 6, &[0xFF, 0x0F, 0xFF, 0x0F]);
    put(&mut scene, 24, &[1]);
    put_word(&mut scene, 30, -9_000_i16 as u16);
    scene.wait_ms(8_000);
    assert!((scene.get("j1", "Present Position") + 9_000).abs() <= 4);
    // Beyond 28,672 is no goal at all.
    assert_eq!(put_word(&mut scene, 30, 28_673), 1 << 3);
}

#[test]
fn mx_multi_turn_readings_are_divided_by_the_resolution_divider() {
    let mut scene = one("mx-28");
    put(&mut scene, 6, &[0xFF, 0x0F, 0xFF, 0x0F]);
    // e-Manual, Resolution Divider(22): 2048 reads 1024 with a divider of 2.
    put(&mut scene, 22, &[2]);
    assert_eq!(scene.get("j1", "Present Position"), 1024);
    put(&mut scene, 24, &[1]);
    put_word(&mut scene, 30, 1024 + 2048);
    scene.wait_ms(3_000);
    put(&mut scene, 24, &[0]);
    put(&mut scene, 22, &[1]);
    // One turn of 2048 coarse counts is one of 4096.
    assert!((scene.get("j1", "Present Position") - 2048 - 4096).abs() <= 4);
}

#[test]
fn mx_torque_control_mode_gives_the_goal_torque() {
    let mut scene = one("mx-64");
    put(&mut scene, 24, &[1]);
    put(&mut scene, 70, &[1]);
    // 200 * 4.5 mA, clockwise.
    scene.world.transmit(0, &feetech(1, 3, &[71, 200, 0x04]), 1_000_000);
    scene.wait_ms(3);
    assert!((scene.get("j1", "Current") - 2048 + 200).abs() <= 1, "{}", scene.get("j1", "Current"));
    scene.wait_ms(200);
    assert!(scene.get("j1", "Present Speed") < 0);
    scene.world.discard_input(0);
    put(&mut scene, 70, &[0]);
    scene.wait_ms(1_000);
    assert_eq!(scene.get("j1", "Present Speed"), 0, "joint mode holds again");
    put(&mut scene, 70, &[1]);
    scene.wait_ms(200);
    assert!(scene.get("j1", "Present Speed") < 0, "the goal torque is still there");
    put(&mut scene, 70, &[0]);
    scene.wait_ms(1_000);
    assert_eq!(scene.get("j1", "Present Speed"), 0, "joint mode holds again");
}

// XL-320: protocol 2.0, a table in the manner of AX.

#[test]
fn an_xl320_moves_at_its_speed_and_turns_as_a_wheel_by_duty() {
    let mut scene = one("xl320");
    set1(&mut scene, 24, 1);
    let start_ns = scene.world.now_ns();
    // Speed 100 is 66.6 deg/s; 300 counts are 87.9 deg.
    let goal = [812_u16.to_le_bytes(), 100_u16.to_le_bytes()].concat();
    assert_eq!(scene.error(&write(1, 30, &goal)), 0);
    scene.world.run_until(start_ns + 660_000_000);
    let half = scene.get("j1", "Present Position") - 512;
    assert!((140..=150).contains(&half), "{half}");
    set1(&mut scene, 24, 0);
    set1(&mut scene, 11, 1);
    set1(&mut scene, 24, 1);
    set2(&mut scene, 32, 1024 + 512);
    for _ in 0..100 {
        scene.wait_ms(10);
        assert!((0..=1023).contains(&scene.get("j1", "Present Position")));
    }
    assert!(scene.get("j1", "Present Speed") < -300);
}

#[test]
fn an_xl320_has_error_bits_of_its_own() {
    let mut scene = one("xl320");
    scene.set("j1", "Present Temperature", 80);
    assert_eq!(scene.error(&instruction(1, 1, &[])), 0x80);
    // e-Manual XL-320, Hardware Error Status(50): overheating is bit 1.
    assert_eq!(scene.get("j1", "Hardware Error Status"), 0x02);
}
