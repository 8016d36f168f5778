//! The device's side of the dialects, from the makers' documents.
//!
//! Source: CubeMars, "AK Series Actuator Driver Manual" 1.0.15, section 5.3; Damiao,
//! "DM-J4310-2EC user manual" V1.0; Xiaomi, "CyberGear instruction manual", section 4.

use super::actuator::{Actuator, Goal};
use super::{CanFrame, Kind};
use gaitway_profiles::{Dialect, Ranges};

/// Damiao: registers by number; the others keep nothing here.
#[derive(Clone, Debug)]
pub(super) struct Registers([u32; 128]);

const MST_ID: usize = 7;
const ESC_ID: usize = 8;
const TIMEOUT: usize = 9;
const CTRL_MODE: usize = 10;
/// One step of the timeout register, ns.
const TIMEOUT_STEP_NS: u64 = 50_000;

impl Registers {
    pub fn new(id: u8, ranges: &Ranges) -> Registers {
        let mut values = [0; 128];
        values[MST_ID] = 0;
        values[ESC_ID] = id.into();
        values[CTRL_MODE] = 1;
        let ends = [ranges.position_rad, ranges.velocity_rad_s, ranges.torque_nm];
        for (register, end) in values[21..24].iter_mut().zip(ends) {
            *register = (end as f32).to_bits();
        }
        Registers(values)
    }
}

/// Whether a drive that the host left alone must be cleared before it drives again.
pub(super) fn keeps_silence_fault(dialect: Dialect) -> bool {
    dialect == Dialect::Damiao
}

/// None if the frame is not for this actuator; else its answer, if it gives one.
pub(super) fn hear(actuator: &mut Actuator, frame: &CanFrame) -> Option<Option<CanFrame>> {
    if frame.kind != Kind::Classic {
        return None;
    }
    match actuator.dialect {
        Dialect::CubemarsMit => cubemars(actuator, frame),
        Dialect::Damiao => damiao(actuator, frame),
        Dialect::Robstride => robstride(actuator, frame),
        Dialect::CubemarsServo | Dialect::Odrive | Dialect::Moteus | Dialect::Recoil => None,
    }
}

/// The middle of step `code` of 2^bits on a range.
fn decode(code: u64, bits: u32, low: f64, high: f64) -> f64 {
    low + code as f64 * (high - low) / ((1_u64 << bits) - 1) as f64
}

fn encode(value: f64, bits: u32, end: f64) -> u64 {
    let steps = ((1_u64 << bits) - 1) as f64;
    ((value.clamp(-end, end) + end) * steps / (2.0 * end)) as u64
}

/// The packed command, or an order in its last byte.
fn mini_cheetah(actuator: &mut Actuator, bytes: [u8; 8]) {
    const ORDER: u64 = 0xFFFF_FFFF_FFFF_FF00;
    let whole = u64::from_be_bytes(bytes);
    if whole & ORDER == ORDER {
        match bytes[7] {
            0xFB => actuator.silenced = false,
            0xFC => actuator.enable(true),
            0xFD => actuator.enable(false),
            0xFE => actuator.place(0.0),
            _ => {}
        }
        return;
    }
    let ranges = &actuator.ranges;
    let field = |shift: u32| whole >> shift & 0xFFF;
    let both = |code, bits, end: f64| decode(code, bits, -end, end);
    actuator.goal = Some(Goal::Impedance {
        position: both(whole >> 48, 16, ranges.position_rad),
        velocity: both(field(36), 12, ranges.velocity_rad_s),
        kp: decode(field(24), 12, 0.0, ranges.kp_nm_rad),
        kd: decode(field(12), 12, 0.0, ranges.kd_nm_s_rad),
        torque: both(field(0), 12, ranges.torque_nm),
    });
}

/// Position, velocity and torque in five bytes.
fn state(actuator: &Actuator) -> [u8; 5] {
    let ranges = &actuator.ranges;
    let whole = encode(actuator.position_rad, 16, ranges.position_rad) << 24
        | encode(actuator.velocity_rad_s, 12, ranges.velocity_rad_s) << 12
        | encode(actuator.torque_nm, 12, ranges.torque_nm);
    let [_, _, _, bytes @ ..] = whole.to_be_bytes();
    bytes
}

fn cubemars(actuator: &mut Actuator, frame: &CanFrame) -> Option<Option<CanFrame>> {
    let bytes: [u8; 8] = frame.bytes.as_slice().try_into().ok()?;
    if frame.extended || frame.id != u32::from(actuator.id) {
        return None;
    }
    mini_cheetah(actuator, bytes);
    let [p1, p0, v, vt, t] = state(actuator);
    let answer = [actuator.id, p1, p0, v, vt, t, actuator.celsius as u8, 0];
    Some(Some(CanFrame::classic(0, false, &answer)))
}

fn damiao(actuator: &mut Actuator, frame: &CanFrame) -> Option<Option<CanFrame>> {
    let bytes: [u8; 8] = frame.bytes.as_slice().try_into().ok()?;
    if frame.extended {
        return None;
    }
    let id = u32::from(actuator.id);
    let word = |k: usize| f32::from_le_bytes([bytes[k], bytes[k + 1], bytes[k + 2], bytes[k + 3]]);
    let mode = actuator.registers.0[CTRL_MODE];
    if frame.id == 0x7FF {
        return damiao_register(actuator, bytes);
    } else if frame.id == id && (mode == 1 || bytes[..7] == [0xFF; 7]) {
        mini_cheetah(actuator, bytes);
    } else if frame.id == 0x100 + id && mode == 2 {
        let (position, speed) = (word(0).into(), word(4).into());
        actuator.goal = Some(Goal::Position { position, speed });
    } else if frame.id == 0x200 + id && mode == 3 {
        actuator.goal = Some(Goal::Velocity(word(0).into()));
    } else {
        return None;
    }
    Some(Some(damiao_feedback(actuator)))
}

fn damiao_register(actuator: &mut Actuator, bytes: [u8; 8]) -> Option<Option<CanFrame>> {
    let [low, high, what, number, value @ ..] = bytes;
    if [low, high] != [actuator.id, 0] {
        return None;
    }
    let register = actuator.registers.0.get_mut(usize::from(number))?;
    match what {
        0xCC => return Some(Some(damiao_feedback(actuator))),
        0x33 => {}
        0x55 => *register = u32::from_le_bytes(value),
        _ => return Some(None),
    }
    let [v0, v1, v2, v3] = register.to_le_bytes();
    if what == 0x55 && usize::from(number) == TIMEOUT {
        let steps = u64::from(u32::from_le_bytes(value));
        actuator.set_timeout((steps > 0).then_some(steps * TIMEOUT_STEP_NS));
    }
    let master = actuator.registers.0[MST_ID] & 0x7FF;
    Some(Some(CanFrame::classic(master, false, &[low, high, what, number, v0, v1, v2, v3])))
}

fn damiao_feedback(actuator: &Actuator) -> CanFrame {
    let status = match (actuator.silenced, actuator.enabled) {
        (true, _) => 0xD,
        (false, enabled) => u8::from(enabled),
    };
    let [p1, p0, v, vt, t] = state(actuator);
    let celsius = actuator.celsius as u8;
    let first = status << 4 | actuator.id & 0x0F;
    let master = actuator.registers.0[MST_ID] & 0x7FF;
    CanFrame::classic(master, false, &[first, p1, p0, v, vt, t, celsius, celsius])
}

fn robstride(actuator: &mut Actuator, frame: &CanFrame) -> Option<Option<CanFrame>> {
    let bytes: [u8; 8] = frame.bytes.as_slice().try_into().ok()?;
    let [kind, torque_high, torque_low, target] = frame.id.to_be_bytes();
    if !frame.extended || target != actuator.id {
        return None;
    }
    let mut host = torque_low;
    match kind {
        1 => {
            host = 0xFD;
            let word = |k: usize| u64::from(u16::from_be_bytes([bytes[k], bytes[k + 1]]));
            let torque = u64::from(u16::from_be_bytes([torque_high, torque_low]));
            let ranges = &actuator.ranges;
            let both = |code, end: f64| decode(code, 16, -end, end);
            actuator.goal = Some(Goal::Impedance {
                position: both(word(0), ranges.position_rad),
                velocity: both(word(2), ranges.velocity_rad_s),
                kp: decode(word(4), 16, 0.0, ranges.kp_nm_rad),
                kd: decode(word(6), 16, 0.0, ranges.kd_nm_s_rad),
                torque: both(torque, ranges.torque_nm),
            });
        }
        3 => actuator.enable(true),
        4 => actuator.enable(false),
        6 => actuator.place(0.0),
        _ => return Some(None),
    }
    Some(Some(robstride_feedback(actuator, host)))
}

fn robstride_feedback(actuator: &Actuator, host: u8) -> CanFrame {
    let mode: u32 = if actuator.enabled { 2 } else { 0 };
    let id = 2 << 24 | mode << 22 | u32::from(actuator.id) << 8 | u32::from(host);
    let ranges = &actuator.ranges;
    let whole = encode(actuator.position_rad, 16, ranges.position_rad) << 48
        | encode(actuator.velocity_rad_s, 16, ranges.velocity_rad_s) << 32
        | encode(actuator.torque_nm, 16, ranges.torque_nm) << 16
        | (actuator.celsius * 10.0) as u64;
    CanFrame::classic(id, true, &whole.to_be_bytes())
}
