use super::*;
use std::f64::consts::TAU;

const MS: u64 = STEP_NS;
const COUNT: f64 = TAU / 4096.0;

fn idle_motor() -> Motor {
    let facts = gaitway_profiles::Motor {
        no_load_speed_rad_s: 8.0,
        stall_torque_nm: 3.0,
        stall_current_a: 2.3,
        voltage_v: 12.0,
        source: "test".into(),
    };
    Motor::new(&facts, COUNT)
}

fn motor(regulator: Regulator) -> Motor {
    let mut motor = idle_motor();
    motor.set_regulator(regulator);
    motor.hold_here();
    motor
}

fn p_only(gain_per_s: f64) -> Regulator {
    Regulator { position_p: [gain_per_s; 2], ..Regulator::NONE }
}

/// Moves on in steps of a millisecond and calls `look` after each.
fn watch(motor: &mut Motor, ms: u64, mut look: impl FnMut(&Motor)) {
    let start_ns = motor.now_ns();
    for k in 1..=ms {
        motor.advance(start_ns + k * MS);
        look(motor);
    }
}

#[test]
fn a_sine_of_30_degrees_at_1_hz_lags_by_one_to_three_degrees() {
    let mut motor = motor(p_only(100.0));
    let mut worst = 0.0_f64;
    for cycle in 0..200_u64 {
        let t = cycle as f64 * 0.01;
        let goal = 30_f64.to_radians() * (TAU * t).sin();
        motor.advance(cycle * 10 * MS);
        worst = worst.max((goal - motor.position_rad()).abs());
        motor.go_to(goal, Pace::Step);
    }
    let worst = worst.to_degrees();
    // 2 pi * 30 deg/s / 100 per s = 1.9 deg, plus up to one cycle of 10 ms at that speed.
    assert!((1.0..=4.0).contains(&worst), "{worst}");
}

#[test]
fn a_step_settles_within_the_droop_load_and_friction_make() {
    let mut motor = motor(p_only(100.0));
    motor.go_to(0.5, Pace::Step);
    let mut highest = 0.0_f64;
    watch(&mut motor, 1000, |motor| highest = highest.max(motor.position_rad()));
    assert!(highest <= 0.5 * 1.05, "{highest}");
    // At rest k e / w0 lies within load +- friction: 2 % +- 3 %.
    let share = (0.5 - motor.position_rad()) * 100.0 / 8.0;
    assert!((-0.011..=0.051).contains(&share), "{share}");
}

#[test]
fn a_motor_at_rest_wakes_for_a_new_goal_a_stiffer_gain_and_a_free_shaft() {
    let mut motor = motor(p_only(10.0));
    motor.advance(1_000 * MS);
    motor.go_to(0.5, Pace::Step);
    motor.advance(3_000 * MS);
    let soft = motor.position_rad();
    assert!((soft - 0.5).abs() <= 1.01 * 0.05 * 8.0 / 10.0);
    motor.set_regulator(p_only(200.0));
    motor.advance(4_000 * MS);
    assert!((motor.position_rad() - 0.5).abs() < (soft - 0.5).abs());
    motor.set_blocked(true);
    motor.advance(5_000 * MS);
    motor.go_to(0.0, Pace::Step);
    motor.advance(6_000 * MS);
    motor.set_blocked(false);
    motor.advance(7_000 * MS);
    assert!(motor.position_rad().abs() <= 0.05 * 8.0 / 200.0 + 1e-3);
}

#[test]
fn an_integral_takes_the_droop_away() {
    let mut motor = motor(Regulator { position_i: 500.0, ..p_only(100.0) });
    motor.go_to(0.5, Pace::Step);
    watch(&mut motor, 3000, |_| {});
    assert!((motor.position_rad() - 0.5).abs() <= 0.5 * COUNT + 1e-9);
}

#[test]
fn full_speed_feed_forward_takes_the_lag_of_a_steady_motion_away() {
    let lag_at = |feedforward_speed| {
        let mut motor = motor(Regulator { feedforward_speed, ..p_only(100.0) });
        motor.go_to(10.0, Pace::Rectangle { speed: 2.0 });
        watch(&mut motor, 1000, |_| {});
        motor.trajectory().position - motor.position_rad()
    };
    // Back-EMF at 2 rad/s asks for (1 - f) 2/8 of the duty, load and friction for 5 %; the duty is
    // k lag / w0, with the lag behind the target of the step's end seen at its start, 1 ms ago.
    let expected = ((1.0 - FRICTION_RATIO) * 2.0 / 8.0 + 0.05) * 8.0 / 100.0 - 2.0 * STEP_S;
    assert!((lag_at(0.0) - expected).abs() <= 0.02 * expected, "{}", lag_at(0.0));
    let rest = lag_at(1.0);
    assert!((rest - (expected - 2.0 / 100.0)).abs() <= 1e-3, "{rest}");
}

#[test]
fn a_large_d_gain_damps_and_stays_stable() {
    let mut motor = motor(Regulator { position_d: 16.0, ..p_only(200.0) });
    motor.go_to(0.3, Pace::Step);
    let mut highest = 0.0_f64;
    watch(&mut motor, 2000, |motor| highest = highest.max(motor.position_rad()));
    assert!(highest <= 0.3 + 1e-6, "{highest}");
    let droop = 0.3 - motor.position_rad();
    assert!(droop.abs() <= 1.01 * 0.05 * 8.0 / 200.0, "{droop}");
}

#[test]
fn the_shaft_never_turns_faster_than_without_load() {
    let mut motor = motor(p_only(100.0));
    motor.go_to(20.0, Pace::Step);
    watch(&mut motor, 3000, |motor| assert!(motor.velocity_rad_s() <= 8.0));
}

#[test]
fn the_law_of_speed_reaches_the_speed_and_its_ramp_takes_its_time() {
    let mut motor = motor(Regulator { speed_p: 1.0, speed_i: 10.0, ..Regulator::NONE });
    motor.spin(-3.0, Pace::Trapezoid { speed: 3.0, acceleration: 6.0 });
    motor.advance(250 * MS);
    assert!((motor.trajectory().velocity + 1.5).abs() <= 1e-9);
    motor.advance(3000 * MS);
    assert!((motor.velocity_rad_s() + 3.0).abs() <= 0.01, "{}", motor.velocity_rad_s());
}

#[test]
fn a_duty_gives_its_share_of_the_speed_less_load_and_friction() {
    let mut motor = motor(Regulator::NONE);
    motor.apply(0.5);
    motor.advance(1000 * MS);
    // i = s u - w / wi with i = load + friction = 5 % and s = 1 - 0.06 * 0.05 * 0.5.
    let expected = 8.0 / (1.0 - FRICTION_RATIO) * (0.5 * (1.0 - 0.06 * 0.025) - 0.05);
    assert!((motor.velocity_rad_s() - expected).abs() <= 1e-3 * expected);
    assert!((motor.duty() - 0.5).abs() <= 1e-3);
}

#[test]
fn a_current_accelerates_until_the_voltage_is_used_up() {
    let mut motor = motor(Regulator::NONE);
    motor.push(2.3 * 0.25);
    watch(&mut motor, 5, |motor| assert!((motor.current_a() - 2.3 * 0.25).abs() <= 1e-9));
    // T dw/dt = wi (0.25 - 0.05).
    let expected = 8.0 / (1.0 - FRICTION_RATIO) * 0.2 * 5.0 / 4.0;
    assert!((motor.velocity_rad_s() - expected).abs() <= 1e-9);
    motor.advance(500 * MS);
    assert!(motor.velocity_rad_s() <= 8.0 && motor.current_a() < 2.3 * 0.25);
}

#[test]
fn a_current_limit_holds_whatever_the_error() {
    let mut motor = motor(Regulator { current_limit: 0.1, ..p_only(100.0) });
    motor.go_to(3.0, Pace::Step);
    watch(&mut motor, 500, |motor| assert!(motor.torque_ratio() <= 0.1 + 1e-12));
    assert!(motor.position_rad() > 0.1);
}

#[test]
fn inside_the_dead_zone_nothing_pushes() {
    let zone = [0.0, 0.05];
    let mut motor = motor(Regulator { dead_zone_rad: zone, punch: 0.1, ..p_only(100.0) });
    motor.go_to(0.049, Pace::Step);
    motor.advance(100 * MS);
    assert_eq!((motor.position_rad(), motor.duty()), (0.0, 0.0));
    motor.go_to(0.06, Pace::Step);
    watch(&mut motor, 1, |motor| assert!(motor.duty() > 0.1));
}

#[test]
fn one_long_advance_equals_many_short_ones() {
    let (mut long, mut short) = (motor(p_only(100.0)), motor(p_only(100.0)));
    for motor in [&mut long, &mut short] {
        motor.go_to(1.0, Pace::Trapezoid { speed: 2.0, acceleration: 10.0 });
    }
    long.advance(5_000 * MS);
    for k in 0..=50_000 {
        short.advance(k * MS / 10);
    }
    assert_eq!(long.position_rad(), short.position_rad());
    assert!((long.temperature_c() - short.temperature_c()).abs() <= 1e-6);
}

#[test]
fn a_blocked_shaft_stalls_and_trips_when_the_load_lasts() {
    let overload = Bound { ratio: 0.8, time_s: 1.0 };
    let mut motor = motor(Regulator { overload, ..p_only(100.0) });
    motor.advance(10 * MS);
    motor.set_blocked(true);
    motor.go_to(1.0, Pace::Step);
    assert_eq!(motor.advance(900 * MS), Advance::Done);
    assert!((motor.current_a() - 2.3).abs() < 0.2);
    assert_eq!(motor.advance(1_100 * MS), Advance::Overloaded);
    assert!(motor.temperature_c() > 30.0);
    assert!(motor.voltage_v() < 11.5);
}

#[test]
fn without_torque_the_shaft_coasts_to_rest_and_stays() {
    let mut motor = motor(p_only(100.0));
    motor.go_to(5.0, Pace::Step);
    motor.advance(100 * MS);
    motor.release();
    motor.advance(400 * MS);
    let rest = motor.position_rad();
    motor.advance(10_000 * MS);
    assert_eq!(motor.position_rad(), rest);
    assert_eq!(motor.current_a(), 0.0);
}

#[test]
fn a_braked_shaft_stops_sooner_than_a_free_one() {
    let turned = |stop: fn(&mut Motor)| {
        let mut motor = motor(Regulator::NONE);
        motor.apply(1.0);
        motor.advance(200 * MS);
        let from = motor.position_rad();
        stop(&mut motor);
        motor.advance(1_000 * MS);
        motor.position_rad() - from
    };
    assert!(turned(Motor::brake) < 0.5 * turned(Motor::release));
}

#[test]
fn the_winding_warms_with_the_square_of_the_current() {
    let rise = |share: f64| {
        let mut motor = motor(Regulator::NONE);
        motor.set_temperature_c(AMBIENT_C);
        motor.set_blocked(true);
        motor.push(share * 2.3);
        motor.advance(60_000 * MS);
        motor.temperature_c() - AMBIENT_C
    };
    // A first-order rise: 60 degC i² (1 - exp(-60 s / 120 s)).
    let expected = 60.0 * 0.36 * (1.0 - (-0.5_f64).exp());
    assert!((rise(0.6) - expected).abs() <= 1e-2 * expected, "{}", rise(0.6));
    assert!((rise(0.6) / rise(0.3) - 4.0).abs() <= 1e-2);
}
