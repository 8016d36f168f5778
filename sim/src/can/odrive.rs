//! ODrive, CAN Simple: `node << 5 | command`, little-endian, in revolutions.
//!
//! Source: odriverobotics/ODrive, `docs/can-protocol.rst` and `can_simple.cpp` of firmware 0.5.6;
//! ODrive documentation, "CAN Protocol" of firmware 0.6. What they leave open: the axis is
//! calibrated; other states than closed loop are left for idle at once; of the input modes only the
//! trapezoidal one limits the speed on its own; ramps and filters are not played; any message for
//! the axis feeds its watchdog. Endpoints (SDO) are not played.

use super::drive::{Drive, Goal, Trouble};
use super::{CanFrame, Kind};
use gaitway_profiles::Actuator as Profile;
use std::f64::consts::TAU;

const HEARTBEAT_NS: u64 = 100_000_000;
const ESTIMATES_NS: u64 = 10_000_000;
/// Boards are not switched on at the same microsecond.
const STAGGER_NS: u64 = 1_370_000;
const IDLE: u8 = 1;
const CLOSED_LOOP: u8 = 8;
const TORQUE_CONTROL: u32 = 1;
const VELOCITY_CONTROL: u32 = 2;
const POSITION_CONTROL: u32 = 3;
const PASSTHROUGH: u32 = 1;
const TRAPEZOIDAL: u32 = 5;
/// Encoder counts in a revolution: the 8192 of the boards' usual encoder.
const COUNTS: f64 = 8192.0;
/// Torque for one ampere, N m, of the motor the documentation recommends (8.27 / 270 rpm/V).
const TORQUE_CONSTANT_NM_A: f64 = 8.27 / 270.0;

/// Which generation of firmware.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Firmware {
    V05,
    V06,
}

#[derive(Clone, Debug)]
pub(super) struct Odrive {
    node: u8,
    firmware: Firmware,
    control: u32,
    input: u32,
    input_position: f64,
    input_velocity: f64,
    input_torque: f64,
    /// rev/s; the factory's.
    velocity_limit: f64,
    trajectory_velocity: f64,
    /// 1/s; the factory's.
    position_gain: f64,
    /// What was between the encoder's zero and the shaft's when somebody set the position, rev.
    offset: f64,
    heartbeat_ns: u64,
    estimates_ns: u64,
}

impl Odrive {
    pub fn new(node: u8, profile: &Profile) -> Odrive {
        let old = profile.model.contains("firmware 0.5");
        let stagger_ns = u64::from(node) * STAGGER_NS;
        Odrive {
            node,
            firmware: if old { Firmware::V05 } else { Firmware::V06 },
            control: POSITION_CONTROL,
            input: PASSTHROUGH,
            input_position: 0.0,
            input_velocity: 0.0,
            input_torque: 0.0,
            velocity_limit: 10.0,
            trajectory_velocity: 2.0,
            position_gain: 20.0,
            offset: 0.0,
            heartbeat_ns: HEARTBEAT_NS + stagger_ns % HEARTBEAT_NS,
            estimates_ns: ESTIMATES_NS + stagger_ns % ESTIMATES_NS,
        }
    }

    pub fn restart(&mut self) {
        self.control = POSITION_CONTROL;
        self.input = PASSTHROUGH;
        self.offset = 0.0;
        (self.input_velocity, self.input_torque) = (0.0, 0.0);
    }

    pub fn due_ns(&self) -> Option<u64> {
        Some(self.heartbeat_ns.min(self.estimates_ns))
    }

    /// Heartbeat and estimates, each at its rate.
    pub fn speak(&mut self, drive: &Drive, now_ns: u64) -> Vec<CanFrame> {
        let mut said = Vec::new();
        if self.heartbeat_ns <= now_ns {
            self.heartbeat_ns += HEARTBEAT_NS;
            said.push(self.heartbeat(drive));
        }
        if self.estimates_ns <= now_ns {
            self.estimates_ns += ESTIMATES_NS;
            said.push(self.estimates(drive));
        }
        said
    }

    fn frame(&self, command: u32, bytes: [u8; 8]) -> CanFrame {
        CanFrame::classic(u32::from(self.node) << 5 | command, false, &bytes)
    }

    fn floats(&self, command: u32, first: f64, second: f64) -> CanFrame {
        let word = |value: f64| u64::from((value as f32).to_bits());
        self.frame(command, (word(first) | word(second) << 32).to_le_bytes())
    }

    /// Byte 4 is the state. Firmware 0.5 then has flags of motor, encoder and controller; 0.6 the
    /// result of the last procedure (0 success) and whether the trajectory is done.
    fn heartbeat(&self, drive: &Drive) -> CanFrame {
        let state = if drive.enabled { CLOSED_LOOP } else { IDLE };
        let [e0, e1, e2, e3] = self.axis_error(drive).to_le_bytes();
        let there = (self.input_position - self.turns(drive)).abs() < 0.01;
        let rest = match self.firmware {
            Firmware::V05 => {
                let motor = u8::from(self.motor_error(drive) != 0);
                let encoder = u8::from(drive.latched == Some(Trouble::Encoder));
                [motor, encoder, u8::from(there) << 7]
            }
            Firmware::V06 => [0, u8::from(there), 0],
        };
        self.frame(0x01, [e0, e1, e2, e3, state, rest[0], rest[1], rest[2]])
    }

    fn turns(&self, drive: &Drive) -> f64 {
        drive.position_rad() / TAU + self.offset
    }

    fn estimates(&self, drive: &Drive) -> CanFrame {
        self.floats(0x09, drive.tell_rad() / TAU + self.offset, drive.velocity_rad_s / TAU)
    }

    /// `ODrive.Axis.Error` of firmware 0.5, `ODrive.Error` of 0.6.
    fn axis_error(&self, drive: &Drive) -> u32 {
        let Some(trouble) = drive.latched else { return 0 };
        match (self.firmware, trouble) {
            (Firmware::V05, Trouble::UnderVoltage) => 1 << 1,
            (Firmware::V05, Trouble::OverVoltage) => 1 << 2,
            (Firmware::V05, Trouble::OverCurrent | Trouble::LostPhase | Trouble::Overload) => {
                1 << 6
            }
            (Firmware::V05, Trouble::Encoder) => 1 << 8,
            (Firmware::V05, Trouble::Silence) => 1 << 11,
            (Firmware::V05, Trouble::Stopped) => 1 << 14,
            (Firmware::V05, Trouble::OverTemperature) => 1 << 18,
            (Firmware::V06, Trouble::Encoder) => 1 << 3,
            (Firmware::V06, Trouble::LostPhase) => 1 << 5,
            (Firmware::V06, Trouble::OverVoltage) => 1 << 8,
            (Firmware::V06, Trouble::UnderVoltage) => 1 << 9,
            (Firmware::V06, Trouble::OverCurrent | Trouble::Overload) => 1 << 12,
            (Firmware::V06, Trouble::OverTemperature) => 1 << 14,
            (Firmware::V06, Trouble::Silence) => 1 << 24,
            (Firmware::V06, Trouble::Stopped) => 1 << 25,
        }
    }

    /// `ODrive.Motor.Error` of firmware 0.5.
    fn motor_error(&self, drive: &Drive) -> u64 {
        match drive.latched {
            Some(Trouble::OverCurrent | Trouble::Overload) => 0x1000,
            Some(Trouble::LostPhase) => 0x1,
            Some(Trouble::OverTemperature) => 0x20_0000,
            _ => 0,
        }
    }

    pub fn hear(&mut self, drive: &mut Drive, frame: &CanFrame) -> Vec<CanFrame> {
        let known = matches!(frame.kind, Kind::Classic | Kind::Remote(_));
        if frame.extended || !known || frame.id >> 5 != u32::from(self.node) {
            return Vec::new();
        }
        drive.feed();
        let command = frame.id & 0x1F;
        // A message without a payload asks as a remote request does.
        if matches!(frame.kind, Kind::Remote(_)) || frame.bytes.is_empty() {
            let answer = self.answer(drive, command);
            if answer.is_some() || matches!(frame.kind, Kind::Remote(_)) {
                return answer.into_iter().collect();
            }
        }
        self.obey(drive, command, &frame.bytes);
        Vec::new()
    }

    fn answer(&self, drive: &Drive, command: u32) -> Option<CanFrame> {
        let error = u64::from(self.axis_error(drive));
        let ampere = drive.torque_nm / TORQUE_CONSTANT_NM_A;
        let power = drive.torque_nm * drive.velocity_rad_s;
        Some(match (command, self.firmware) {
            // Protocol 2, an S1's hardware, firmware 0.6.8.
            (0x00, Firmware::V06) => self.frame(0x00, [2, 5, 1, 0, 0, 6, 8, 0]),
            (0x03, Firmware::V05) => self.frame(0x03, self.motor_error(drive).to_le_bytes()),
            (0x03, Firmware::V06) => self.frame(0x03, (error | error << 32).to_le_bytes()),
            (0x04, Firmware::V05) => {
                let error = u64::from(drive.latched == Some(Trouble::Encoder));
                self.frame(0x04, error.to_le_bytes())
            }
            (0x05 | 0x1D, Firmware::V05) => self.frame(command, [0; 8]),
            // Node, serial number, connection.
            (0x06, Firmware::V06) => {
                self.frame(0x06, [self.node, self.node, 0, 0, 0, 0x57, 0x47, 0])
            }
            (0x09, _) => self.estimates(drive),
            (0x0A, Firmware::V05) => {
                let counts = (self.turns(drive) * COUNTS) as i32;
                let within = u64::from(counts.rem_euclid(COUNTS as i32).cast_unsigned());
                let whole = u64::from(counts.cast_unsigned()) | within << 32;
                self.frame(0x0A, whole.to_le_bytes())
            }
            (0x14, _) => self.floats(0x14, ampere, ampere),
            (0x15, Firmware::V05) => self.floats(0x15, 0.0, 0.0),
            (0x15, Firmware::V06) => self.floats(0x15, drive.celsius(), drive.celsius()),
            (0x17, _) => self.floats(0x17, drive.supply_v(), power / drive.supply_v()),
            (0x1C, Firmware::V06) => self.floats(0x1C, drive.torque_nm, drive.torque_nm),
            (0x1D, Firmware::V06) => self.floats(0x1D, power, power),
            _ => return None,
        })
    }

    fn obey(&mut self, drive: &mut Drive, command: u32, bytes: &[u8]) {
        let float = |at: usize| {
            let word = bytes.get(at..)?.first_chunk::<4>()?;
            Some(f64::from(f32::from_le_bytes(*word))).filter(|value| value.is_finite())
        };
        let whole = |at: usize| Some(u32::from_le_bytes(*bytes.get(at..)?.first_chunk::<4>()?));
        let milli = |at: usize| {
            let word = bytes.get(at..)?.first_chunk::<2>()?;
            Some(f64::from(i16::from_le_bytes(*word)) * 0.001)
        };
        match command {
            0x02 => drive.trip(Trouble::Stopped),
            0x06 if self.firmware == Firmware::V05 => {
                if let Some(node) = whole(0).and_then(|node| u8::try_from(node).ok()) {
                    self.node = node.min(0x3F);
                }
            }
            0x07 => self.set_state(drive, whole(0).unwrap_or(0)),
            0x0B => {
                if let (Some(control), Some(input)) = (whole(0), whole(4)) {
                    (self.control, self.input) = (control, input);
                    self.pursue(drive);
                }
            }
            0x0C => {
                let (Some(position), Some(v), Some(t)) = (float(0), milli(4), milli(6)) else {
                    return;
                };
                (self.input_position, self.input_velocity, self.input_torque) = (position, v, t);
                self.pursue(drive);
            }
            0x0D => {
                let (Some(velocity), Some(torque)) = (float(0), float(4)) else { return };
                (self.input_velocity, self.input_torque) = (velocity, torque);
                self.pursue(drive);
            }
            0x0E => {
                if let Some(torque) = float(0) {
                    self.input_torque = torque;
                    self.pursue(drive);
                }
            }
            0x18 => drive.clear(),
            _ => self.set_up(drive, command, float(0), whole(0)),
        }
    }

    /// Limits, gains and the like.
    fn set_up(&mut self, drive: &mut Drive, command: u32, float: Option<f64>, whole: Option<u32>) {
        match (command, float) {
            (0x0F, Some(velocity)) => self.velocity_limit = velocity.abs(),
            (0x11, Some(velocity)) => self.trajectory_velocity = velocity.abs(),
            (0x16, _) => {
                drive.restart();
                self.restart();
            }
            (0x19, float) => {
                let here = match self.firmware {
                    Firmware::V05 => whole.map(|counts| f64::from(counts.cast_signed()) / COUNTS),
                    Firmware::V06 => float,
                };
                if let Some(here) = here {
                    self.offset = here - drive.position_rad() / TAU;
                }
            }
            (0x1A, Some(gain)) => self.position_gain = gain,
            _ => {}
        }
    }

    fn set_state(&mut self, drive: &mut Drive, state: u32) {
        if state != u32::from(CLOSED_LOOP) {
            return drive.disable();
        }
        if !drive.enabled && drive.latched.is_none() {
            // It takes over where it stands.
            self.input_position = self.turns(drive);
            (self.input_velocity, self.input_torque) = (0.0, 0.0);
            drive.drop_goal();
            drive.enable();
            self.hold(drive);
        }
    }

    /// The goal that comes with closed loop, which is nobody's order.
    fn hold(&self, drive: &mut Drive) {
        if let Some(goal) = self.goal() {
            drive.hold(goal);
        }
    }

    fn pursue(&self, drive: &mut Drive) {
        if let Some(goal) = self.goal() {
            drive.aim(goal);
        }
    }

    fn goal(&self) -> Option<Goal> {
        let speed = match self.input {
            TRAPEZOIDAL => self.trajectory_velocity.min(self.velocity_limit),
            _ => self.velocity_limit,
        };
        match self.control {
            TORQUE_CONTROL => Some(Goal::Torque(self.input_torque)),
            VELOCITY_CONTROL => {
                let limit = self.velocity_limit;
                Some(Goal::Velocity(self.input_velocity.clamp(-limit, limit) * TAU))
            }
            POSITION_CONTROL => Some(Goal::Position {
                position: (self.input_position - self.offset) * TAU,
                velocity: self.input_velocity * TAU,
                gain: self.position_gain,
                speed: speed * TAU,
            }),
            _ => None,
        }
    }
}
