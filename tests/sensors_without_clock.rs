//! Sensors that tell neither number nor time: what they send is written here from their makers' manuals, and shares nothing
//! with the simulator.

use gaitway::capture::{Captured, Chain, Mode};
use gaitway::device::sensor::stream_format;
use gaitway::time::Instant;
use gaitway::wire::sensor::Stream;
use glam::DVec3;
use std::f64::consts::TAU;

/// Turns to both sides of where it began, about the vertical, by so much, deg, so often a second.
const SWING_DEG: f64 = 60.0;
const SWINGS_HZ: f64 = 0.5;
const SECONDS: f64 = 30.0;

/// Rate of turn, deg/s.
fn rate_deg_s(t: f64) -> f64 {
    SWING_DEG * TAU * SWINGS_HZ * (TAU * SWINGS_HZ * t).cos()
}

/// "WIT Standard Protocol": `55 TYPE`, four words, low byte first, and the low byte of the sum of all before.
fn wit(kind: u8, words: [f64; 4]) -> Vec<u8> {
    let mut packet = vec![0x55, kind];
    for word in words {
        packet.extend((word.round() as i16).to_le_bytes());
    }
    packet.push(packet.iter().fold(0_u8, |sum, byte| sum.wrapping_add(*byte)));
    packet
}

/// Acceleration in 16 g / 32768, angular velocity in 2000 deg/s / 32768, angle in 180 deg / 32768.
fn wt901(t: f64) -> Vec<u8> {
    let yaw_deg = SWING_DEG * (TAU * SWINGS_HZ * t).sin();
    let mut sample = wit(0x51, [0.0, 0.0, 32768.0 / 16.0, 2500.0]);
    sample.extend(wit(0x52, [0.0, 0.0, rate_deg_s(t) / 2000.0 * 32768.0, 2500.0]));
    sample.extend(wit(0x53, [0.0, 0.0, yaw_deg / 180.0 * 32768.0, 0.0]));
    sample
}

/// "WIT BLE 5.0 protocol": `55 61` and nine words: acceleration, angular velocity, angle.
fn wt901_ble(t: f64) -> Vec<u8> {
    let yaw_deg = SWING_DEG * (TAU * SWINGS_HZ * t).sin();
    let words = [0.0, 0.0, 2048.0, 0.0, 0.0, rate_deg_s(t) * 16.384, 0.0, 0.0, yaw_deg * 182.044];
    let mut packet = vec![0x55, 0x61];
    words.iter().for_each(|word| packet.extend((word.round() as i16).to_le_bytes()));
    packet
}

/// VN-100 user manual, "Quaternion, Magnetic, Acceleration and Angular Rates": X, Y, Z, W of the quaternion, Gauss, m/s^2, rad/s;
/// the 8-bit XOR of what stands between `$` and `*`. Z points down.
fn vnqmr(t: f64) -> Vec<u8> {
    let half = (SWING_DEG * (TAU * SWINGS_HZ * t).sin()).to_radians() / 2.0;
    let (z, w, rate) = (half.sin(), half.cos(), rate_deg_s(t).to_radians());
    let text = format!(
        "VNQMR,+0.000000,+0.000000,{z:+.6},{w:+.6},+0.2000,+0.0000,+0.4000,+00.000,+00.000,-09.807,+00.000000,\
         +00.000000,{rate:+010.6}"
    );
    let sum = text.bytes().fold(0_u8, |sum, byte| sum ^ byte);
    format!("${text}*{sum:02X}\r\n").into_bytes()
}

type Emitter = fn(f64) -> Vec<u8>;
const EMITTERS: [(&str, Emitter); 3] = [
    ("witmotion-wt901", wt901),
    ("witmotion-wt901ble", wt901_ble),
    ("vectornav-vn100-ascii", vnqmr),
];

/// What is captured of samples that are taken `rate_hz` times a second and handed over every `batch_s`; the host stands still for
/// 300 ms now and then, and a share of the samples is damaged on the way.
fn captured(
    profile: &str,
    emit: Emitter,
    rate_hz: f64,
    batch_s: f64,
    damaged: f64,
) -> (Vec<(f64, Captured)>, Chain) {
    let sensor = gaitway_profiles::sensor(profile).expect("shipped");
    let mut stream = Stream::new(stream_format(&sensor).expect("columns").expect("a stream"));
    let mut chain = Chain::new(&sensor, Mode::SixAxes);
    let mut found = Vec::new();
    let mut pending: Option<(f64, Vec<u8>)> = None;
    let mut read = |at_s: f64, bytes: &[u8]| {
        let arrival = Instant::from_nanos(((1.0 + at_s) * 1e9) as u64);
        stream.push(bytes, |reading| {
            for captured in chain.take(&reading, arrival).into_iter().flatten() {
                found.push((at_s, captured));
            }
        });
    };
    let stalls_s = [6.1, 9.43, 13.7, 14.1, 20.05, 26.6];
    for n in 0..(SECONDS * rate_hz) as u32 {
        let taken_s = f64::from(n) / rate_hz;
        let handed_s = (taken_s / batch_s).ceil() * batch_s;
        let stall = stalls_s.iter().find(|from| (**from..**from + 0.3).contains(&handed_s));
        let read_s = stall.map_or(handed_s, |from| from + 0.3);
        let mut bytes = emit(taken_s);
        // The golden ratio spreads them evenly and without a pattern.
        if (f64::from(n) * 0.618_034).fract() < damaged {
            bytes[6] ^= 0x10;
        }
        match &mut pending {
            Some((at_s, all)) if (*at_s - read_s).abs() < 1e-9 => all.extend(bytes),
            _ => {
                if let Some((at_s, all)) = pending.replace((read_s, bytes)) {
                    read(at_s, &all);
                }
            }
        }
    }
    if let Some((at_s, all)) = pending {
        read(at_s, &all);
    }
    (found, chain)
}

/// Half of the way from the furthest to one side to the furthest to the other, deg, of every swing after the fifth second.
fn amplitudes_deg(found: &[(f64, Captured)]) -> Vec<f64> {
    let mut swings: Vec<(f64, f64)> = Vec::new();
    let mut before_deg: f64 = 0.0;
    for (at_s, captured) in found.iter().filter(|(at_s, _)| *at_s > 5.0) {
        let Some(fused) = captured.fused else { continue };
        let forward = fused.orientation * DVec3::X;
        let yaw_deg = forward.y.atan2(forward.x).to_degrees();
        // The short way from the one before, beyond half a turn as well.
        let yaw_deg = before_deg + (yaw_deg - before_deg + 180.0).rem_euclid(360.0) - 180.0;
        before_deg = yaw_deg;
        let swing = ((at_s - 5.0) * SWINGS_HZ) as usize;
        if swing >= swings.len() {
            swings.push((f64::INFINITY, f64::NEG_INFINITY));
        }
        let (least, most) = swings.last_mut().expect("one");
        (*least, *most) = (least.min(yaw_deg), most.max(yaw_deg));
    }
    swings.pop();
    swings.iter().map(|(least, most)| (most - least) / 2.0).collect()
}

#[test]
fn headings_turn_as_far_as_the_sensor_does_however_its_samples_are_handed_over() {
    for (profile, emit) in EMITTERS {
        for rate_hz in [40.0, 50.0, 100.0, 200.0] {
            for batch_s in [0.001, 0.004, 0.016] {
                let (found, chain) = captured(profile, emit, rate_hz, batch_s, 0.0);
                let told = format!("{profile}, {rate_hz} Hz, {batch_s} s");
                // One sample of a kind that comes as several packets is whole when the next begins.
                assert!(found.len() as f64 >= SECONDS * rate_hz - 1.0, "{told}: {}", found.len());
                let amplitudes = amplitudes_deg(&found);
                assert!(amplitudes.len() >= 11, "{told}: {amplitudes:?}");
                for amplitude in amplitudes {
                    assert!((amplitude / SWING_DEG - 1.0).abs() < 0.01, "{told}: {amplitude}");
                }
                let counts = chain.timeline().counts();
                assert_eq!(
                    (counts.estimated, counts.gaps),
                    (Some(0), 0),
                    "{told}: no stall is a loss"
                );
            }
        }
    }
}

#[test]
fn a_damaged_sample_now_and_then_does_not_turn_headings() {
    for (profile, emit) in [EMITTERS[0], EMITTERS[2]] {
        let (found, chain) = captured(profile, emit, 200.0, 0.016, 0.004);
        let fused = found.iter().filter(|(_, captured)| captured.fused.is_some()).count();
        let lost = SECONDS * 200.0 - fused as f64;
        assert!((20.0..40.0).contains(&lost), "{profile}: {lost}");
        for amplitude in amplitudes_deg(&found) {
            assert!((amplitude / SWING_DEG - 1.0).abs() < 0.01, "{profile}: {amplitude}");
        }
        assert_eq!(
            chain.timeline().counts().estimated,
            Some(0),
            "{profile}: nobody can tell of one"
        );
    }
}

/// From the tenth to the twelfth second the sensor sends the same sample again and again: nothing is made of it.
#[test]
fn a_sensor_whose_values_stand_still_is_stuck_and_tells_no_orientation_until_it_measures_again() {
    let stuck: Emitter = |t| wt901(if (10.0..12.0).contains(&t) { 10.0 } else { t });
    let (found, chain) = captured("witmotion-wt901", stuck, 100.0, 0.004, 0.0);
    let is_stuck: Vec<f64> =
        found.iter().filter(|(_, captured)| captured.stuck).map(|(at_s, _)| *at_s).collect();
    let (first, last) = (is_stuck[0], is_stuck[is_stuck.len() - 1]);
    assert!((10.0..10.1).contains(&first) && (11.95..12.05).contains(&last), "{first} {last}");
    assert_eq!(chain.stuck_samples(), is_stuck.len() as u64);
    for (at_s, captured) in found.iter().filter(|(at_s, _)| (10.1..11.9).contains(at_s)) {
        assert!(captured.stuck && captured.orientation().is_none(), "{at_s}");
    }
    // Nobody knows what it did meanwhile: its filter begins anew.
    let after =
        found.iter().find(|(at_s, _)| *at_s > 12.1).and_then(|(_, captured)| captured.fused);
    assert!(after.is_some_and(|fused| !fused.settled), "{after:?}");
}
