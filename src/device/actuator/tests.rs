//! Actuators against numbers worked out by hand.

use super::*;
use crate::wire::can::{CanId, Format};

fn actuator(name: &str, placing: Placing) -> Actuator {
    let profile = profiles::actuator(name).expect("a shipped actuator");
    let line = CanSpeed { bitrate_bps: 1_000_000, data_bitrate_bps: None, host_id: 0xFD };
    Actuator::new(profile, placing, line).expect("it can be placed so")
}

fn placed(id: u8) -> Placing {
    Placing { id, kp_nm_rad: 50.0, kd_nm_s_rad: 1.0, ..Placing::default() }
}

fn frame(id: Option<CanId>, bytes: &[u8]) -> CanFrame {
    CanFrame::new(id.expect("fits"), Format::Classic, bytes).expect("fits")
}

const ONE_RADIAN: Goal = Goal { position_rad: 1.0, velocity_rad_s: 0.0, holds_s: None };

// Steps by the formulas of the makers' code, worked out by hand; ours round to the nearest step,
// so each field may be one higher.
#[test]
fn one_radian_with_gains_is_the_frame_of_the_literature() {
    let bytes = |name| {
        let goal = actuator(name, placed(1)).goal_frame(ONE_RADIAN);
        u64::from_be_bytes(goal.payload().try_into().expect("eight bytes"))
    };
    // p 16 | v 12 | kp 12 | kd 12 | t 12
    for (name, packed) in [("ak80-9", 0x8A3C_7FF1_9933_37FF_u64), ("dm4310", 0x8A3C_7FF1_9933_37FF)]
    {
        let got = bytes(name);
        for (shift, width) in [(48, 16), (36, 12), (24, 12), (12, 12), (0, 12)] {
            let field = |whole: u64| whole >> shift & ((1 << width) - 1);
            assert!(field(got).abs_diff(field(packed)) <= 1, "{name} {got:016X}");
        }
    }
}

#[test]
fn a_late_answer_about_a_register_is_no_position() {
    let placing = Placing { answer_id: 0x11, ..placed(1) };
    let damiao = actuator("dm4310", placing);
    let late = frame(CanId::standard(0x11), &[1, 0, 0x33, 0x15, 0, 0, 0x48, 0x41]);
    assert_eq!(damiao.told(&late), Some(Told::default()), "its own, and nothing of its state");
    let pmax = damiao.ask_setting(21).expect("a question");
    let told = damiao.answer(&pmax, &late).expect("an answer");
    assert_eq!(told.value.map(f32::from_bits), Some(12.5));
    let state = frame(CanId::standard(0x11), &[0x11, 0x8A, 0x3C, 0x7F, 0xF7, 0xFF, 0x23, 0x1E]);
    let told = damiao.told(&state).expect("feedback");
    // 0x8A3C is 35388 of 65535 steps on 25 rad: 0.99966 rad.
    assert!((told.position_rad.expect("a position") - 0.999_66).abs() < 1e-4);
    assert_eq!((told.enabled, told.temperature_c), (Some(true), Some(35.0)));
}

#[test]
fn turns_of_odrive_and_moteus_are_radians_here() {
    let odrive = actuator("odrive-s1", placed(1));
    let told = frame(CanId::standard(0x29), &[0, 0, 0x80, 0xBE, 0, 0, 0, 0x40]);
    let told = odrive.told(&told).expect("estimates");
    // A quarter of a turn back, two turns a second.
    let position_rad = told.position_rad.expect("a position");
    assert!((position_rad + std::f64::consts::FRAC_PI_2).abs() < 1e-6, "{position_rad}");
    let velocity_rad_s = told.velocity_rad_s.expect("a velocity");
    assert!((velocity_rad_s - 4.0 * std::f64::consts::PI).abs() < 1e-6);
    let goal = odrive.goal_frame(Goal { position_rad: 3.0 * std::f64::consts::PI, ..ONE_RADIAN });
    // 1.5 turns, without speed and torque.
    assert_eq!(goal.payload(), [0, 0, 0xC0, 0x3F, 0, 0, 0, 0]);
    assert_eq!(goal.id(), CanId::standard(0x2C).expect("fits"));
}

#[test]
fn a_goal_of_moteus_says_how_long_it_holds() {
    let moteus = actuator("moteus-r4", placed(1));
    let quarter = Goal { position_rad: std::f64::consts::FRAC_PI_2, ..ONE_RADIAN };
    let bytes = |goal| moteus.goal_frame(goal).payload().to_vec();
    // Mode 10; position 0.25 rev and velocity 0 from 0x020; 0.25 s at 0x027.
    let held = bytes(Goal { holds_s: Some(0.25), ..quarter });
    assert_eq!(held[..3], [0x01, 0x00, 0x0A]);
    assert_eq!(held[3..13], [0x0E, 0x20, 0, 0, 0x80, 0x3E, 0, 0, 0, 0]);
    assert_eq!(held[13..19], [0x0D, 0x27, 0, 0, 0x80, 0x3E]);
    // For good is not-a-number.
    let good = bytes(quarter);
    assert!(f32::from_le_bytes([good[15], good[16], good[17], good[18]]).is_nan());
}

#[test]
fn no_goal_can_be_written_as_a_setting() {
    // iq_ref, spd_ref and loc_ref of CyberGear; a Recoil's mode, its measured position and what
    // lies behind it.
    for (name, numbers) in [
        ("rs02", &[0x7006, 0x700A, 0x7016][..]),
        ("recoil-5010", &[0x010, 0x000, 0x040, 0x060, 0x064]),
        ("moteus-r4", &[0x020, 0x000]),
        ("odrive-s1", &[0]),
        ("ak80-9", &[0]),
    ] {
        let actuator = actuator(name, placed(1));
        for &number in numbers {
            assert_eq!(actuator.write_setting(number, 1), None, "{name} {number:#X}");
        }
    }
}

#[test]
fn a_range_holds_only_if_it_is_the_profiles() {
    let near = Wanted::Near(30.0);
    assert!(near.holds(30.0_f32.to_bits()));
    assert!(!near.holds(8.0_f32.to_bits()));
    assert!(!near.holds(f32::NAN.to_bits()));
}
