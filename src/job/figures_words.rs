//! What a motion does to all of a robot, as a person reads it: the worst first.

use crate::retarget::BodyFigures;
use std::fmt::Write;

/// Aims that figures are measured by, to tell the worse from the better: what a robot of half a metre is hardly
/// seen to do wrong.
const SHARE: f64 = 0.01;
const HAND_M: f64 = 0.012;
const FOOT_M: f64 = 0.012;
const TILT_RAD: f64 = 0.0175;
const SLIP: f64 = 1.2;
const LEAN_RAD: f64 = 0.1;
const TURNED_RAD: f64 = 0.3;
const MOTOR_SHARE: f64 = 0.9;
/// A fall is worse than all else.
const FALLS: f64 = 1e6;

/// Lines of a block; empty if nothing is known.
pub fn lines(figures: &BodyFigures) -> String {
    let parts = [balance, contact, floor, feet, limbs, trunk, turned, servos, pace];
    let mut found: Vec<(f64, String)> = parts.iter().filter_map(|part| part(figures)).collect();
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    let words = found.into_iter().map(|(_, words)| words).chain(figures.missing.iter().cloned());
    let mut out = String::new();
    for (at, words) in words.enumerate() {
        let label = if at == 0 { "body" } else { "" };
        let _ = writeln!(out, "{label:<9} {words}");
    }
    out
}

fn mm(metres: f64) -> String {
    format!("{:.0} mm", metres * 1e3)
}

fn balance(figures: &BodyFigures) -> Option<(f64, String)> {
    let (margin_m, share) = (figures.balance_margin_m?, figures.unbalanced_share?);
    let outside = format!(
        "its weight is outside its soles for {:.0} % of the time, by up to {}",
        share * 100.0,
        mm(-margin_m)
    );
    Some(match figures.predicted_fall_s {
        Some(at_s) if margin_m < 0.0 => {
            (FALLS, format!("falls at {at_s:.1} s on its own feet: {outside}"))
        }
        Some(at_s) => {
            (FALLS, format!("falls at {at_s:.1} s on its own feet: its servos give way too far"))
        }
        None if margin_m < 0.0 => (share / SHARE, format!("stays on its feet; {outside}")),
        None => {
            let words = format!(
                "stays on its feet: its weight is {} or more inside its soles",
                mm(margin_m)
            );
            (0.0, words)
        }
    })
}

fn contact(figures: &BodyFigures) -> Option<(f64, String)> {
    let (share, depth_m) = (figures.self_collision_share?, figures.self_collision_depth_m?);
    let words = match &figures.self_collision_links {
        Some([one, two]) => format!(
            "touches itself in {:.0} % of the clip, up to {} deep ({one} in {two})",
            share * 100.0,
            mm(depth_m)
        ),
        None => "touches itself nowhere".to_owned(),
    };
    Some((share / SHARE, words))
}

fn floor(figures: &BodyFigures) -> Option<(f64, String)> {
    let share = figures.penetration_share.filter(|share| *share > 0.0)?;
    let words = format!("goes into the floor in {:.0} % of the clip", share * 100.0);
    Some((share / SHARE, words))
}

fn feet(figures: &BodyFigures) -> Option<(f64, String)> {
    let (slip, tilt) = (figures.slip_m_s?, figures.sole_tilt_p95_rad?);
    let source = figures.slip_source_m_s.map_or_else(String::new, |source| {
        format!(" (the person's, as small, {:.1})", source * 100.0)
    });
    let words = format!(
        "standing feet slide {:.1} cm/s{source}, tilt up to {:.1} deg, float up to {}",
        slip * 100.0,
        tilt.to_degrees(),
        mm(figures.float_p95_m?)
    );
    let beyond = figures.slip_source_m_s.map_or(0.0, |source| slip / (SLIP * source.max(1e-3)));
    Some((beyond.max(tilt / TILT_RAD), words))
}

fn limbs(figures: &BodyFigures) -> Option<(f64, String)> {
    let hands = figures.hand_error_m;
    let feet = figures.foot_error_m;
    let directions = &figures.direction_error_rad;
    let off = |what: &str, metres: Option<f64>| metres.map(|off_m| format!("{what} {}", mm(off_m)));
    let named = [
        ("upper arms", directions.upper_arm),
        ("forearms", directions.forearm),
        ("thighs", directions.thigh),
        ("shanks", directions.shank),
    ];
    let turned = named.into_iter().filter_map(|(what, off_rad)| {
        off_rad.map(|off_rad| format!("{what} {:.0} deg", off_rad.to_degrees()))
    });
    let places = [off("hands", hands), off("ankles", feet)].into_iter().flatten();
    let all: Vec<String> = places.chain(turned).collect();
    if all.is_empty() {
        return None;
    }
    let worst = (hands.unwrap_or(0.0) / HAND_M).max(feet.unwrap_or(0.0) / FOOT_M);
    Some((worst, format!("off the person on average: {}", all.join(", "))))
}

fn trunk(figures: &BodyFigures) -> Option<(f64, String)> {
    let off_rad = figures.trunk_lean_error_rad?;
    let words =
        format!("its trunk leans {:.0} deg differently from the person's", off_rad.to_degrees());
    Some((off_rad / LEAN_RAD, words))
}

fn turned(figures: &BodyFigures) -> Option<(f64, String)> {
    let (own_rad, persons_rad) = (figures.turned_rad?, figures.turned_source_rad?);
    let off = (own_rad - persons_rad).abs() / TURNED_RAD;
    let words = format!(
        "turns by {:.0} deg where the person turned by {:.0}",
        own_rad.to_degrees().round() + 0.0,
        persons_rad.to_degrees().round() + 0.0
    );
    (off >= 1.0).then_some((off, words))
}

fn servos(figures: &BodyFigures) -> Option<(f64, String)> {
    let (torque, voltage) = (figures.peak_torque.as_ref()?, figures.peak_voltage.as_ref()?);
    let words = format!(
        "asks at most {:.0} % of a servo's stall torque ({}, at {:.1} s), and {:.0} % of its voltage ({}, at {:.1} s)",
        torque.share * 100.0,
        torque.joint,
        torque.at_s,
        voltage.share * 100.0,
        voltage.joint,
        voltage.at_s
    );
    let beyond = torque.share.max(voltage.share) / MOTOR_SHARE - 1.0;
    Some((beyond.max(0.0) / (1.0 - MOTOR_SHARE), words))
}

fn pace(figures: &BodyFigures) -> Option<(f64, String)> {
    let pace = figures.retime.as_ref().filter(|pace| pace.worst > 1.0)?;
    let worst = pace.local.iter().max_by(|a, b| a.factor.total_cmp(&b.factor))?;
    let words = format!(
        "half of the motion has to be slowed by x {:.2}, its worst instant by x {:.2} ({}, {:.1} to \
         {:.1} s of it)",
        pace.median, pace.worst, worst.joint, worst.start_s, worst.end_s
    );
    Some((pace.worst - 1.0, words))
}
