//! mjbots moteus: frames of subframes that write and read registers, CAN FD as a rule.
//!
//! Source: mjbots/moteus 00d474b0, `docs/reference.md`, section A. What it leaves open: an answer
//! has the format of its question, and goes as several frames if it does not fit one; registers
//! that are not known give the error 2 ("unknown register"); the modes played are stopped,
//! position, zero velocity and, as position with the bounds, stay within.

use super::drive::{Drive, Goal, Trouble};
use super::{CanFrame, Kind};
use crate::servo::Event;
use std::f64::consts::TAU;

const STOPPED: f64 = 0.0;
const FAULT: f64 = 1.0;
const POSITION: f64 = 10.0;
const TIMEOUT: f64 = 11.0;
const ZERO_VELOCITY: f64 = 12.0;
const NOTHING: u8 = 0x50;
const UNKNOWN_REGISTER: u8 = 2;
/// Gains of the position loop, N m/rev and N m/(rev/s), as somebody tuned them for a robot's joint.
const KP_NM_REV: f64 = 200.0;
const KD_NM_S_REV: f64 = 10.0;
/// Torque for one ampere, N m (assumed).
const TORQUE_CONSTANT_NM_A: f64 = 0.1;

/// How a number travels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Width {
    Int8,
    Int16,
    Int32,
    Float,
}

impl Width {
    fn of(code: u8) -> Width {
        [Width::Int8, Width::Int16, Width::Int32, Width::Float][usize::from(code >> 2 & 3)]
    }

    fn bytes(self) -> usize {
        match self {
            Width::Int8 => 1,
            Width::Int16 => 2,
            Width::Int32 | Width::Float => 4,
        }
    }
}

/// What one step stands for, by width of the integer.
fn steps(register: u32) -> [f64; 3] {
    match register {
        0x001 | 0x006 | 0x020 | 0x026 | 0x040 | 0x041 | 0x130 | 0x131 => [0.01, 1e-4, 1e-5],
        0x002 | 0x021 => [0.1, 2.5e-4, 1e-5],
        0x003 | 0x022 | 0x025 | 0x030..=0x034 => [0.5, 0.01, 0.001],
        0x004 | 0x005 | 0x01C | 0x01D => [1.0, 0.1, 0.001],
        0x00D => [0.5, 0.1, 0.001],
        0x00E | 0x00A => [1.0, 0.1, 0.001],
        0x023 | 0x024 => [1.0 / 127.0, 1.0 / 32_767.0, 1.0 / f64::from(i32::MAX)],
        0x027 => [0.01, 0.001, 1e-6],
        _ => [1.0; 3],
    }
}

/// Not-a-number is the smallest integer.
fn put(bytes: &mut Vec<u8>, width: Width, register: u32, value: f64) {
    let integer = |step: f64, most: f64| (value / step).round().clamp(-most, most);
    let [step8, step16, step32] = steps(register);
    match width {
        Width::Float => bytes.extend((value as f32).to_le_bytes()),
        Width::Int8 if value.is_nan() => bytes.extend(i8::MIN.to_le_bytes()),
        Width::Int8 => bytes.extend((integer(step8, 127.0) as i8).to_le_bytes()),
        Width::Int16 if value.is_nan() => bytes.extend(i16::MIN.to_le_bytes()),
        Width::Int16 => bytes.extend((integer(step16, 32_767.0) as i16).to_le_bytes()),
        Width::Int32 if value.is_nan() => bytes.extend(i32::MIN.to_le_bytes()),
        Width::Int32 => {
            bytes.extend((integer(step32, f64::from(i32::MAX)) as i32).to_le_bytes());
        }
    }
}

fn get(bytes: &[u8], register: u32) -> f64 {
    let [step8, step16, step32] = steps(register);
    let scaled = |value: i32, least: i32, step: f64| {
        if value == least { f64::NAN } else { f64::from(value) * step }
    };
    match *bytes {
        [a] => scaled(a.cast_signed().into(), i8::MIN.into(), step8),
        [a, b] => scaled(i16::from_le_bytes([a, b]).into(), i16::MIN.into(), step16),
        [a, b, c, d] => scaled(i32::from_le_bytes([a, b, c, d]), i32::MIN, step32),
        _ => f64::NAN,
    }
}

/// What a position command says; absent means as the manual's "if unspecified".
#[derive(Clone, Copy, Debug)]
struct Command {
    position: f64,
    velocity: f64,
    torque: f64,
    kp_scale: f64,
    kd_scale: f64,
    torque_limit: f64,
    stop: f64,
    timeout_s: f64,
}

impl Command {
    const UNSPECIFIED: Command = Command {
        position: 0.0,
        velocity: 0.0,
        torque: 0.0,
        kp_scale: 1.0,
        kd_scale: 1.0,
        torque_limit: f64::INFINITY,
        stop: f64::NAN,
        timeout_s: 0.0,
    };

    fn slot(&mut self, register: u32) -> Option<&mut f64> {
        Some(match register {
            0x020 => &mut self.position,
            0x021 => &mut self.velocity,
            0x022 => &mut self.torque,
            0x023 => &mut self.kp_scale,
            0x024 => &mut self.kd_scale,
            0x025 => &mut self.torque_limit,
            0x026 => &mut self.stop,
            0x027 => &mut self.timeout_s,
            _ => return None,
        })
    }
}

#[derive(Clone, Debug)]
pub(super) struct Moteus {
    id: u8,
    /// `servo.default_timeout_s`.
    pub default_timeout_ns: Option<u64>,
    /// The mode that was written last, as long as nothing has ended it.
    mode: f64,
    command: Command,
    /// The encoder's zero was moved by so much, rev.
    offset: f64,
}

impl Moteus {
    pub fn new(id: u8) -> Moteus {
        let default_timeout_ns = Some(100_000_000);
        let command = Command::UNSPECIFIED;
        Moteus { id, default_timeout_ns, mode: STOPPED, command, offset: 0.0 }
    }

    pub fn restart(&mut self) {
        self.mode = STOPPED;
        self.offset = 0.0;
    }

    /// The mode it is in.
    fn present_mode(&self, drive: &Drive) -> f64 {
        match (drive.latched, drive.enabled) {
            (Some(_), _) => FAULT,
            (None, false) => STOPPED,
            (None, true) if drive.on_silence_brakes => TIMEOUT,
            (None, true) => self.mode,
        }
    }

    pub fn hear(&mut self, drive: &mut Drive, frame: &CanFrame) -> Vec<CanFrame> {
        let destination = frame.id as u8;
        let everyone = destination == 0x7F;
        let own = destination == self.id || everyone;
        if matches!(frame.kind, Kind::Remote(_)) || frame.id >> 16 != 0 || !own {
            return Vec::new();
        }
        let most = if frame.kind == Kind::Classic { 8 } else { 64 };
        let source = (frame.id >> 8) as u8;
        let mut answer = Answer { parts: vec![Vec::new()], most };
        let mut reader = Reader { left: &frame.bytes };
        let mut written = None;
        while let Some(subframe) = reader.next() {
            self.carry_out(drive, subframe, &mut answer, &mut written);
        }
        if let Some(mode) = written {
            self.begin(drive, mode);
        }
        if source & 0x80 == 0 {
            return Vec::new();
        }
        let id = u32::from(self.id) << 8 | u32::from(source & 0x7F);
        answer.frames(id, frame.kind)
    }

    fn carry_out(
        &mut self,
        drive: &mut Drive,
        subframe: Subframe<'_>,
        answer: &mut Answer,
        written: &mut Option<f64>,
    ) {
        match subframe {
            Subframe::Write { width, start, values } => {
                for (register, bytes) in (start..=u32::MAX).zip(values.chunks(width.bytes())) {
                    let value = match (width, bytes) {
                        (Width::Float, &[a, b, c, d]) => f32::from_le_bytes([a, b, c, d]).into(),
                        _ => get(bytes, register),
                    };
                    if !self.write(drive, register, value, written) {
                        answer.push(&refusal(0x30, register));
                    }
                }
            }
            Subframe::Read { width, start, count } => {
                let last = start.saturating_add(count);
                let unknown = (start..last).find(|&r| self.read(drive, r).is_none());
                if let Some(register) = unknown {
                    return answer.push(&refusal(0x31, register));
                }
                let mut bytes = reply_head(width, start, count);
                for register in start..last {
                    let value = self.read(drive, register).unwrap_or(f64::NAN);
                    put(&mut bytes, width, register, value);
                }
                answer.push(&bytes);
            }
            // Nothing waits on the console.
            Subframe::Poll { channel } => answer.push(&[0x41, channel, 0]),
        }
    }

    fn write(
        &mut self,
        drive: &mut Drive,
        register: u32,
        value: f64,
        written: &mut Option<f64>,
    ) -> bool {
        match register {
            0x000 => {
                self.command = Command::UNSPECIFIED;
                *written = Some(value);
            }
            0x130 | 0x131 if value.is_finite() => {
                self.offset = value - drive.position_rad() / TAU;
                drive.note(Event::Kept("the output's position"));
            }
            // Bounds of "stay within", which the spring does not know.
            0x040..=0x046 => {}
            _ => match self.command.slot(register) {
                Some(slot) => *slot = value,
                None => return false,
            },
        }
        true
    }

    /// Begins what a frame that wrote the mode asks for.
    fn begin(&mut self, drive: &mut Drive, mode: f64) {
        if mode == STOPPED {
            drive.clear();
            return drive.disable();
        }
        // Timeout and faults are left by stopping only.
        if drive.latched.is_some() || (drive.enabled && drive.on_silence_brakes) {
            return;
        }
        let command = self.command;
        let timeout_ns = match command.timeout_s {
            0.0 => self.default_timeout_ns,
            seconds => (seconds > 0.0).then_some((seconds * 1e9) as u64),
        };
        if mode == ZERO_VELOCITY {
            drive.aim(Goal::Brake);
        } else if mode == POSITION {
            drive.aim(self.spring(drive, command));
        } else {
            return;
        }
        self.mode = mode;
        drive.set_timeout(timeout_ns);
        drive.enable();
    }

    fn spring(&self, drive: &Drive, command: Command) -> Goal {
        let or = |value: f64, other: f64| if value.is_nan() { other } else { value };
        let here = drive.position_rad() / TAU + self.offset;
        let kp_scale = or(command.kp_scale, 1.0).clamp(0.0, 1.0);
        let kd_scale = or(command.kd_scale, 1.0).clamp(0.0, 1.0);
        let mut velocity = or(command.velocity, 0.0);
        let position = or(command.position, here);
        if command.position.is_nan() && !command.stop.is_nan() {
            velocity = velocity.abs().copysign(command.stop - here);
        }
        Goal::Impedance {
            position: (position - self.offset) * TAU,
            velocity: velocity * TAU,
            kp: KP_NM_REV / TAU * kp_scale,
            kd: KD_NM_S_REV / TAU * kd_scale.min(kp_scale.max(kd_scale)),
            torque: or(command.torque, 0.0),
            torque_limit: or(command.torque_limit, f64::INFINITY).abs(),
            travels: true,
            stop: (command.stop - self.offset) * TAU,
        }
    }

    fn read(&self, drive: &Drive, register: u32) -> Option<f64> {
        let mut command = self.command;
        Some(match register {
            0x000 => self.present_mode(drive),
            0x001 | 0x006 => drive.tell_rad() / TAU + self.offset,
            0x002 => drive.velocity_rad_s / TAU,
            0x003 => drive.torque_nm,
            0x004 => drive.torque_nm / TORQUE_CONSTANT_NM_A,
            0x005 => 0.0,
            0x00A => drive.celsius(),
            0x00B => 0.0,
            0x00C => 1.0,
            0x00D => drive.supply_v(),
            0x00E => drive.celsius(),
            0x00F => fault_code(drive.latched),
            // An r4.11's model, and register map 5.
            0x100 => 4.0,
            0x101 => 0.0,
            0x102 => 5.0,
            0x110 => self.id.into(),
            0x120 => 0x4757.into(),
            0x121 => 0.0,
            0x122 => self.id.into(),
            _ => *command.slot(register)?,
        })
    }
}

fn fault_code(trouble: Option<Trouble>) -> f64 {
    match trouble {
        None => 0.0,
        Some(Trouble::OverVoltage) => 34.0,
        Some(Trouble::Encoder) => 35.0,
        Some(Trouble::OverTemperature) => 38.0,
        Some(Trouble::UnderVoltage) => 40.0,
        // The motor driver's.
        Some(_) => 33.0,
    }
}

fn put_varuint(bytes: &mut Vec<u8>, number: u32) {
    let mut left = number;
    while left > 0x7F {
        bytes.push(left as u8 | 0x80);
        left >>= 7;
    }
    bytes.push(left as u8);
}

fn reply_head(width: Width, start: u32, count: u32) -> Vec<u8> {
    let code = 0x20
        | match width {
            Width::Int8 => 0x00,
            Width::Int16 => 0x04,
            Width::Int32 => 0x08,
            Width::Float => 0x0C,
        };
    let mut bytes = Vec::new();
    match count {
        1..=3 => bytes.push(code | count as u8),
        _ => {
            bytes.push(code);
            put_varuint(&mut bytes, count);
        }
    }
    put_varuint(&mut bytes, start);
    bytes
}

fn refusal(code: u8, register: u32) -> Vec<u8> {
    let mut bytes = vec![code];
    put_varuint(&mut bytes, register);
    bytes.push(UNKNOWN_REGISTER);
    bytes
}

/// Subframes of an answer, in as many frames as they need.
struct Answer {
    parts: Vec<Vec<u8>>,
    most: usize,
}

impl Answer {
    fn push(&mut self, subframe: &[u8]) {
        let full = self.parts.last().is_none_or(|part| part.len() + subframe.len() > self.most);
        if full {
            self.parts.push(Vec::new());
        }
        if let Some(part) = self.parts.last_mut().filter(|_| subframe.len() <= self.most) {
            part.extend_from_slice(subframe);
        }
    }

    fn frames(self, id: u32, kind: Kind) -> Vec<CanFrame> {
        let frame = |mut bytes: Vec<u8>| {
            if kind != Kind::Classic {
                let lengths = [0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64];
                let length = lengths.into_iter().find(|&length| length >= bytes.len());
                bytes.resize(length.unwrap_or(64), NOTHING);
            }
            CanFrame { id, extended: id > 0x7FF, kind, bytes }
        };
        let parts = self.parts.into_iter().enumerate();
        parts.filter(|(k, part)| *k == 0 || !part.is_empty()).map(|(_, part)| frame(part)).collect()
    }
}

enum Subframe<'a> {
    Write { width: Width, start: u32, values: &'a [u8] },
    Read { width: Width, start: u32, count: u32 },
    Poll { channel: u8 },
}

struct Reader<'a> {
    left: &'a [u8],
}

impl<'a> Reader<'a> {
    fn byte(&mut self) -> Option<u8> {
        let (first, rest) = self.left.split_first()?;
        self.left = rest;
        Some(*first)
    }

    fn varuint(&mut self) -> Option<u32> {
        let mut number = 0_u32;
        for k in 0..5 {
            let byte = self.byte()?;
            number |= u32::from(byte & 0x7F) << (7 * k);
            if byte & 0x80 == 0 {
                return Some(number);
            }
        }
        None
    }

    /// The next subframe; nothing more after one that cannot be read.
    fn next(&mut self) -> Option<Subframe<'a>> {
        loop {
            let code = self.byte()?;
            match code {
                NOTHING => {}
                0x00..=0x1F => {
                    let count = if code & 3 == 0 { self.varuint()? } else { u32::from(code & 3) };
                    let start = self.varuint()?;
                    let width = Width::of(code);
                    if code >= 0x10 {
                        return Some(Subframe::Read { width, start, count: count.min(64) });
                    }
                    let length = (count as usize).checked_mul(width.bytes())?;
                    let (values, rest) = self.left.split_at_checked(length)?;
                    self.left = rest;
                    return Some(Subframe::Write { width, start, values });
                }
                0x40 => {
                    let _channel = self.byte()?;
                    let length = usize::from(self.byte()?);
                    self.left = self.left.get(length..)?;
                }
                0x42 => {
                    let channel = self.byte()?;
                    self.byte()?;
                    return Some(Subframe::Poll { channel });
                }
                _ => return None,
            }
        }
    }
}
