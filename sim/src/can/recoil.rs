//! Recoil, the motor controller of Berkeley Humanoid Lite: `function << 7 | id`, little-endian, in
//! radians of the output.
//!
//! Source: uncertainty-cc/Recoil-Motor-Controller, `motor_controller.c` (handleCANMessage,
//! handleNMT, handleSDO, setMode) and `app.c` (watchdog). What they leave open: gains and limits as
//! HybridRobotics/Berkeley-Humanoid-Lite-Lowlevel sets them up; of the memory that parameters lie in
//! only those named here are played, the rest is zero and stays so; a fault brings idle mode.

use super::CanFrame;
use super::drive::{Drive, Goal, Trouble};
use crate::servo::Event;
use std::collections::BTreeMap;

const DISABLED: u8 = 0x00;
const IDLE: u8 = 0x01;
const DAMPING: u8 = 0x02;
const TORQUE: u8 = 0x11;
const VELOCITY: u8 = 0x12;
const POSITION: u8 = 0x13;

const ID_AT: u16 = 0x000;
const FIRMWARE_AT: u16 = 0x004;
const WATCHDOG_AT: u16 = 0x008;
const RATE_AT: u16 = 0x00C;
const MODE_AT: u16 = 0x010;
const ERROR_AT: u16 = 0x014;
const KP_AT: u16 = 0x020;
const KD_AT: u16 = 0x028;
const TORQUE_LIMIT_AT: u16 = 0x030;
const LOWER_AT: u16 = 0x038;
const UPPER_AT: u16 = 0x03C;
const TORQUE_AT: u16 = 0x048;
const VELOCITY_AT: u16 = 0x054;
const POSITION_AT: u16 = 0x060;
const SUPPLY_AT: u16 = 0x100;
/// Size of the memory.
const END: u16 = 0x144;

const INVALID_MODE: u32 = 1 << 5;
const WATCHDOG: u32 = 1 << 6;
const BAD_MESSAGE: u32 = 1 << 10;

#[derive(Clone, Debug)]
pub(super) struct Recoil {
    mode: u8,
    error: u32,
    parameters: BTreeMap<u16, u32>,
    kept: BTreeMap<u16, u32>,
    position_target: f64,
    velocity_target: f64,
    torque_target: f64,
    due_ns: u64,
}

impl Recoil {
    pub fn new(id: u8) -> Recoil {
        let float = |value: f32| value.to_bits();
        let parameters: BTreeMap<u16, u32> = [
            (ID_AT, id.into()),
            (FIRMWARE_AT, 0x2025_0226),
            (WATCHDOG_AT, 1000),
            (RATE_AT, 0),
            (0x01C, float(15.0)),
            (KP_AT, float(20.0)),
            (0x024, 0),
            (KD_AT, float(2.0)),
            (TORQUE_LIMIT_AT, float(6.0)),
            (0x034, float(20.0)),
            (LOWER_AT, float(f32::NEG_INFINITY)),
            (UPPER_AT, float(f32::INFINITY)),
        ]
        .into();
        Recoil {
            mode: IDLE,
            error: 0,
            kept: parameters.clone(),
            parameters,
            position_target: 0.0,
            velocity_target: 0.0,
            torque_target: 0.0,
            due_ns: 0,
        }
    }

    /// As the maker's tool would, and the next start.
    pub fn set_timeout(&mut self, timeout_ns: Option<u64>) {
        let milliseconds = timeout_ns.map_or(0, |timeout_ns| (timeout_ns / 1_000_000) as u32);
        self.parameters.insert(WATCHDOG_AT, milliseconds);
        self.kept.insert(WATCHDOG_AT, milliseconds);
    }

    pub fn restart(&mut self, drive: &mut Drive) {
        self.parameters = self.kept.clone();
        (self.mode, self.error) = (IDLE, 0);
        let milliseconds = u64::from(self.parameters[&WATCHDOG_AT]);
        drive.set_timeout((milliseconds > 0).then_some(milliseconds * 1_000_000));
    }

    pub fn due_ns(&self) -> Option<u64> {
        (self.parameters[&RATE_AT] > 0).then_some(self.due_ns)
    }

    /// Its state, unasked.
    pub fn speak(&mut self, drive: &Drive, now_ns: u64) -> Vec<CanFrame> {
        let period_ns = 1_000_000_000 / u64::from(self.parameters[&RATE_AT].max(1));
        self.due_ns = now_ns + period_ns.max(100_000);
        vec![self.floats(0x9, drive.tell_rad(), drive.velocity_rad_s)]
    }

    fn id(&self) -> u32 {
        self.parameters[&ID_AT] & 0x7F
    }

    fn frame(&self, function: u32, bytes: &[u8]) -> CanFrame {
        CanFrame::classic(function << 7 | self.id(), false, bytes)
    }

    fn floats(&self, function: u32, first: f64, second: f64) -> CanFrame {
        let bytes = [(first as f32).to_le_bytes(), (second as f32).to_le_bytes()].concat();
        self.frame(function, &bytes)
    }

    pub fn hear(&mut self, drive: &mut Drive, frame: &CanFrame) -> Vec<CanFrame> {
        let id = frame.id & 0x7F;
        if frame.extended || !(id == 0 || id == self.id()) {
            return Vec::new();
        }
        self.see_silence(drive);
        let bytes = frame.bytes.as_slice();
        let float = |at: usize| {
            let word = bytes.get(at..).and_then(<[u8]>::first_chunk::<4>);
            word.map(|word| f64::from(f32::from_le_bytes(*word))).filter(|value| value.is_finite())
        };
        match frame.id >> 7 {
            0x0 => {
                match *bytes {
                    [mode, node, ..] if u32::from(node) == self.id() => self.set_mode(drive, mode),
                    [_, ..] => {}
                    [] => self.error |= BAD_MESSAGE,
                }
                Vec::new()
            }
            0x1 => vec![CanFrame::classic(self.id(), false, &[self.id() as u8])],
            0x4 => {
                drive.feed();
                let mut echo = bytes.to_vec();
                echo.resize(8, 0);
                vec![self.frame(0x3, &echo)]
            }
            0x6 => {
                let (Some(position), Some(velocity)) = (float(0), float(4)) else {
                    return Vec::new();
                };
                (self.position_target, self.velocity_target) = (position, velocity);
                self.pursue(drive);
                drive.feed();
                vec![self.floats(0x5, drive.tell_rad(), drive.velocity_rad_s)]
            }
            0x8 => {
                let (Some(position), Some(torque)) = (float(0), float(4)) else {
                    return Vec::new();
                };
                (self.position_target, self.torque_target) = (position, torque);
                self.pursue(drive);
                drive.feed();
                vec![self.floats(0x7, drive.tell_rad(), drive.torque_nm)]
            }
            0xC => self.parameter(drive, bytes),
            0xD => {
                if bytes.first().is_some_and(|&store| store != 0) {
                    self.kept = self.parameters.clone();
                    drive.note(Event::Kept("all parameters"));
                } else {
                    self.parameters = self.kept.clone();
                }
                vec![CanFrame::classic(self.id(), false, &[0])]
            }
            0xE => {
                drive.feed();
                Vec::new()
            }
            _ => Vec::new(),
        }
    }

    /// The drive has braked by itself, or let go.
    fn see_silence(&mut self, drive: &Drive) {
        if drive.on_silence_brakes && self.mode != DAMPING {
            self.mode = DAMPING;
            self.error |= WATCHDOG;
        }
        if drive.latched.is_some() && self.mode != DISABLED {
            self.mode = IDLE;
        }
    }

    fn set_mode(&mut self, drive: &mut Drive, mode: u8) {
        if mode == self.mode {
            return;
        }
        match mode {
            DISABLED | IDLE => {
                self.mode = mode;
                drive.disable();
            }
            // Only by way of idle.
            DAMPING | TORQUE | VELOCITY | POSITION if self.mode != DISABLED => {
                if drive.latched.is_some() {
                    return;
                }
                self.mode = mode;
                drive.disable();
                // It takes over where it stands.
                self.position_target = drive.position_rad();
                (self.velocity_target, self.torque_target) = (0.0, 0.0);
                if let Some(goal) = self.goal() {
                    drive.enable();
                    drive.hold(goal);
                }
            }
            _ => {
                self.mode = IDLE;
                self.error |= INVALID_MODE;
                drive.disable();
            }
        }
    }

    fn pursue(&self, drive: &mut Drive) {
        if let Some(goal) = self.goal().filter(|_| self.mode != DAMPING) {
            drive.aim(goal);
        }
    }

    fn goal(&self) -> Option<Goal> {
        let value = |at: u16| f64::from(f32::from_bits(self.parameters[&at]));
        match self.mode {
            POSITION => {
                let position = self.position_target.max(value(LOWER_AT)).min(value(UPPER_AT));
                Some(Goal::Impedance {
                    position,
                    velocity: self.velocity_target,
                    kp: value(KP_AT),
                    kd: value(KD_AT),
                    torque: self.torque_target,
                    torque_limit: value(TORQUE_LIMIT_AT).abs(),
                    travels: false,
                    stop: f64::NAN,
                })
            }
            VELOCITY => Some(Goal::Velocity(self.velocity_target)),
            TORQUE => Some(Goal::Torque(self.torque_target)),
            DAMPING => Some(Goal::Brake),
            _ => None,
        }
    }

    /// Bits 5 to 7 of the first byte: 1 writes, 2 reads.
    fn parameter(&mut self, drive: &mut Drive, bytes: &[u8]) -> Vec<CanFrame> {
        let &[command, low, high, ref rest @ ..] = bytes else {
            self.error |= BAD_MESSAGE;
            return Vec::new();
        };
        let at = u16::from_le_bytes([low, high]);
        if at >= END {
            self.error |= BAD_MESSAGE;
            return Vec::new();
        }
        match (command >> 5, rest) {
            (1, &[_, a, b, c, d, ..]) => self.write(drive, at, u32::from_le_bytes([a, b, c, d])),
            (2, _) => return vec![self.frame(0xB, &self.read(drive, at).to_le_bytes())],
            _ => self.error |= BAD_MESSAGE,
        }
        Vec::new()
    }

    fn write(&mut self, drive: &mut Drive, at: u16, bits: u32) {
        if at == ERROR_AT {
            self.error = bits;
            drive.clear();
        } else if let Some(parameter) = self.parameters.get_mut(&at) {
            let usable = matches!(at, ID_AT | FIRMWARE_AT | WATCHDOG_AT | RATE_AT)
                || !f32::from_bits(bits).is_nan();
            if usable {
                *parameter = bits;
            }
        }
    }

    fn read(&self, drive: &Drive, at: u16) -> u32 {
        let float = |value: f64| (value as f32).to_bits();
        match at {
            MODE_AT => self.mode.into(),
            ERROR_AT => self.error | fault_bit(drive.latched),
            TORQUE_AT => float(drive.torque_nm),
            VELOCITY_AT => float(drive.velocity_rad_s),
            POSITION_AT => float(drive.tell_rad()),
            SUPPLY_AT => float(drive.supply_v()),
            _ => self.parameters.get(&at).copied().unwrap_or(0),
        }
    }
}

fn fault_bit(trouble: Option<Trouble>) -> u32 {
    match trouble {
        None => 0,
        Some(Trouble::Stopped) => 1 << 1,
        Some(Trouble::UnderVoltage | Trouble::LostPhase) => 1 << 4,
        Some(Trouble::Silence) => WATCHDOG,
        Some(Trouble::OverVoltage) => 1 << 7,
        Some(Trouble::OverCurrent | Trouble::Overload) => 1 << 8,
        Some(Trouble::OverTemperature) => 1 << 9,
        Some(Trouble::Encoder) => 1 << 12,
    }
}
