//! CubeMars (T-Motor) AK actuators: MIT mode, and servo mode, which is kin to VESC.
//!
//! Source: CubeMars, "AK Series Actuator Driver Manual" 1.0.15, sections 5.1 to 5.3;
//! neurobionics/TMotorCANControl. What they leave open: after "set zero" the firmware is mute for
//! about a second; a command of servo mode takes the motor over at once, and a duty is taken for
//! that share of the highest speed.

use super::CanFrame;
use super::coded::{Order, impedance, state};
use super::drive::{Drive, Goal, Trouble};
use crate::servo::Event;
use gaitway_profiles::Ranges;

/// Who answers go to.
const MASTER: u32 = 0;
/// How long the firmware says nothing after it was told to set its zero, ns; TMotorCANControl
/// waits so long.
const MUTE_NS: u64 = 1_000_000_000;
/// How steeply a profile closes in on its goal, 1/s (assumed).
const APPROACH_PER_S: f64 = 30.0;
/// Feedback unless it is set otherwise, Hz (assumed; 1 to 500 can be set).
const FEEDBACK_HZ: u32 = 50;
/// Torque at the output for one ampere, N m (assumed; about an AK80-9's).
const TORQUE_CONSTANT_NM_A: f64 = 0.945;

fn error_code(trouble: Option<Trouble>) -> u8 {
    match trouble {
        None | Some(Trouble::Silence | Trouble::Stopped) => 0,
        Some(Trouble::OverTemperature) => 1,
        Some(Trouble::OverCurrent | Trouble::Overload) => 2,
        Some(Trouble::OverVoltage) => 3,
        Some(Trouble::UnderVoltage) => 4,
        Some(Trouble::Encoder) => 5,
        Some(Trouble::LostPhase) => 6,
    }
}

/// MIT mode.
#[derive(Clone, Debug)]
pub(super) struct Mit {
    id: u8,
    ranges: Ranges,
    mute_until_ns: u64,
}

impl Mit {
    pub fn new(id: u8, ranges: Ranges) -> Mit {
        Mit { id, ranges, mute_until_ns: 0 }
    }

    pub fn hear(&mut self, drive: &mut Drive, frame: &CanFrame) -> Vec<CanFrame> {
        let Ok(bytes) = <[u8; 8]>::try_from(frame.bytes.as_slice()) else { return Vec::new() };
        if frame.extended || frame.id != u32::from(self.id) {
            return Vec::new();
        }
        drive.feed();
        match Order::of(bytes) {
            None => drive.aim(impedance(&self.ranges, bytes)),
            Some(Order::Enable) => {
                // There is no order that clears a fault: enabling anew does.
                drive.clear();
                drive.enable_without_goal();
            }
            Some(Order::Disable) => drive.disable(),
            Some(Order::SetZero) => {
                drive.place(0.0);
                self.mute_until_ns = drive.now_ns() + MUTE_NS;
            }
            Some(Order::Clear | Order::Unknown) => {}
        }
        if drive.now_ns() < self.mute_until_ns {
            return Vec::new();
        }
        let [p1, p0, v, vt, t] = state(&self.ranges, drive);
        let error = error_code(drive.latched);
        let answer = [self.id, p1, p0, v, vt, t, drive.celsius() as u8, error];
        vec![CanFrame::classic(MASTER, false, &answer)]
    }
}

/// Servo mode.
#[derive(Clone, Debug)]
pub(super) struct ServoMode {
    id: u8,
    /// Electrical revolutions of the rotor for one of the output.
    turns: f64,
    period_ns: Option<u64>,
    due_ns: u64,
}

impl ServoMode {
    /// `turns`: electrical revolutions for one of the output.
    pub fn new(id: u8, turns: f64) -> ServoMode {
        let mut mode = ServoMode { id, turns, period_ns: None, due_ns: 0 };
        mode.set_rate(FEEDBACK_HZ, 0);
        mode
    }

    /// How often it tells of itself; 0 = never.
    pub fn set_rate(&mut self, feedback_hz: u32, now_ns: u64) {
        self.period_ns = 1_000_000_000_u64.checked_div(feedback_hz.into());
        self.due_ns = now_ns + self.period_ns.unwrap_or(0);
    }

    fn output_rad_s(&self, electrical_rpm: f64) -> f64 {
        electrical_rpm / self.turns * std::f64::consts::TAU / 60.0
    }

    fn electrical_rpm(&self, output_rad_s: f64) -> f64 {
        output_rad_s * 60.0 / std::f64::consts::TAU * self.turns
    }

    pub fn due_ns(&self) -> Option<u64> {
        self.period_ns.map(|_| self.due_ns)
    }

    pub fn speak(&mut self, drive: &Drive) -> Vec<CanFrame> {
        self.due_ns += self.period_ns.unwrap_or(0);
        let whole = |value: f64| value.clamp(-32_000.0, 32_000.0) as i16;
        let [p1, p0] = whole(drive.tell_rad().to_degrees() * 10.0).to_be_bytes();
        let [v1, v0] = whole(self.electrical_rpm(drive.velocity_rad_s) / 10.0).to_be_bytes();
        let [c1, c0] = whole(drive.torque_nm / TORQUE_CONSTANT_NM_A * 100.0).to_be_bytes();
        let error = error_code(drive.latched);
        let bytes = [p1, p0, v1, v0, c1, c0, drive.celsius() as u8, error];
        vec![CanFrame::classic(0x29 << 8 | u32::from(self.id), true, &bytes)]
    }

    /// Commands are not answered.
    pub fn hear(&mut self, drive: &mut Drive, frame: &CanFrame) -> Vec<CanFrame> {
        if frame.extended && frame.id & 0xFF == u32::from(self.id) {
            drive.feed();
            self.obey(drive, frame.id >> 8, &frame.bytes);
        }
        Vec::new()
    }

    fn obey(&mut self, drive: &mut Drive, packet: u32, bytes: &[u8]) {
        let profile = |position: f64, speed: f64| Goal::Position {
            position,
            velocity: 0.0,
            gain: APPROACH_PER_S,
            speed,
        };
        let first = bytes.first_chunk::<4>().map(|word| f64::from(i32::from_be_bytes(*word)));
        let goal = match (packet, first, bytes) {
            (0, Some(steps), _) => Goal::Velocity(steps / 1e5 * drive.velocity_max_rad_s),
            (1, Some(milliampere), _) => Goal::Torque(milliampere / 1e3 * TORQUE_CONSTANT_NM_A),
            (2, Some(_), _) => Goal::Brake,
            (3, Some(rpm), _) => Goal::Velocity(self.output_rad_s(rpm)),
            (4, Some(steps), _) => profile((steps / 1e4).to_radians(), f64::INFINITY),
            (5, _, &[kept, ..]) => {
                drive.place(0.0);
                if kept == 1 {
                    drive.note(Event::Kept("the origin"));
                }
                return;
            }
            (6, Some(steps), &[_, _, _, _, s1, s0, _, _]) => {
                let speed = f64::from(i16::from_be_bytes([s1, s0])) * 10.0;
                profile((steps / 1e4).to_radians(), self.output_rad_s(speed))
            }
            _ => return,
        };
        drive.clear();
        drive.aim(goal);
        drive.enable();
    }
}
