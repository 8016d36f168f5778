//! Damiao DM actuators.
//!
//! Source: Damiao, "DM-J4310-2EC user manual" V1.0; cmjang/DM_Control_Python, `DM_CAN.py`. What
//! they leave open: orders count in every mode; frames of another mode than that in force are not
//! answered; a fault that its cause has left goes with the order to clear it; what is written to a
//! register that tells only is ignored, and the answer has the old value.

use super::CanFrame;
use super::coded::{Order, impedance, state};
use super::drive::{Drive, Goal, Trouble};
use crate::servo::Event;
use gaitway_profiles::Ranges;

const REGISTERS: u32 = 0x7FF;
const MST_ID: usize = 7;
const ESC_ID: usize = 8;
const TIMEOUT: usize = 9;
const CTRL_MODE: usize = 10;
const PMAX: usize = 21;
const VMAX: usize = 22;
const TMAX: usize = 23;
/// The position, read only: at the motor, and at the output.
const POSITIONS: [usize; 2] = [80, 81];
/// The supply voltage, read only, of newer firmware.
const SUPPLY: usize = 60;
/// One step of the timeout register, ns.
const TIMEOUT_STEP_NS: u64 = 50_000;
/// How steeply a profile closes in on its goal, 1/s (assumed).
const APPROACH_PER_S: f64 = 30.0;

#[derive(Clone, Debug)]
pub(super) struct Damiao {
    ranges: Ranges,
    registers: Vec<u32>,
    /// Registers as they will be after the next power-up.
    kept: Vec<u32>,
}

impl Damiao {
    pub fn new(id: u8, ranges: Ranges) -> Damiao {
        let mut registers = vec![0; 128];
        registers[ESC_ID] = id.into();
        registers[CTRL_MODE] = 1;
        for (register, end) in
            [(PMAX, ranges.position_rad), (VMAX, ranges.velocity_rad_s), (TMAX, ranges.torque_nm)]
        {
            registers[register] = (end as f32).to_bits();
        }
        Damiao { ranges, kept: registers.clone(), registers }
    }

    pub fn set_answer_id(&mut self, id: u16) {
        self.registers[MST_ID] = id.into();
        self.kept[MST_ID] = id.into();
    }

    pub fn restart(&mut self) {
        self.registers.clone_from(&self.kept);
        self.take_ranges();
    }

    fn id(&self) -> u32 {
        self.registers[ESC_ID]
    }

    pub fn hear(&mut self, drive: &mut Drive, frame: &CanFrame) -> Vec<CanFrame> {
        let Ok(bytes) = <[u8; 8]>::try_from(frame.bytes.as_slice()) else { return Vec::new() };
        if frame.extended {
            return Vec::new();
        }
        if frame.id == REGISTERS {
            let [low, high, what, number, value @ ..] = bytes;
            let meant = u32::from(u16::from_le_bytes([low, high])) == self.id();
            if !meant {
                return Vec::new();
            }
            drive.feed();
            return self.manage(drive, what, number, value);
        }
        match frame.id.checked_sub(self.id()) {
            Some(0) if Order::of(bytes).is_some() => self.order(drive, bytes),
            Some(offset) if offset == (self.registers[CTRL_MODE] - 1) << 8 => {
                match goal(&self.ranges, offset, bytes) {
                    Some(goal) => drive.aim(goal),
                    None => return Vec::new(),
                }
            }
            _ => return Vec::new(),
        }
        drive.feed();
        vec![self.feedback(drive)]
    }

    fn order(&mut self, drive: &mut Drive, bytes: [u8; 8]) {
        match Order::of(bytes) {
            Some(Order::Clear) => drive.clear(),
            Some(Order::Enable) => drive.enable_without_goal(),
            Some(Order::Disable) => drive.disable(),
            Some(Order::SetZero) => {
                drive.place(0.0);
                drive.note(Event::Kept("the zero position"));
            }
            Some(Order::Unknown) | None => {}
        }
    }

    fn manage(&mut self, drive: &mut Drive, what: u8, number: u8, value: [u8; 4]) -> Vec<CanFrame> {
        let asked_id = self.id().to_le_bytes();
        match what {
            0xCC => return vec![self.feedback(drive)],
            0x33 => {}
            0x55 => self.write(drive, usize::from(number), u32::from_le_bytes(value)),
            0xAA => {
                // Only while disabled.
                if !drive.enabled {
                    self.kept.clone_from(&self.registers);
                    drive.note(Event::Kept("all registers"));
                }
                return vec![self.answer([asked_id[0], asked_id[1], what, number, 0, 0, 0, 0])];
            }
            _ => return Vec::new(),
        }
        let Some(value) = self.read(drive, usize::from(number)) else { return Vec::new() };
        let [v0, v1, v2, v3] = value.to_le_bytes();
        vec![self.answer([asked_id[0], asked_id[1], what, number, v0, v1, v2, v3])]
    }

    fn read(&self, drive: &Drive, number: usize) -> Option<u32> {
        if POSITIONS.contains(&number) {
            return Some((drive.tell_rad() as f32).to_bits());
        }
        if number == SUPPLY {
            return Some((drive.supply_v() as f32).to_bits());
        }
        self.registers.get(number).copied()
    }

    fn write(&mut self, drive: &mut Drive, number: usize, value: u32) {
        let allowed = match number {
            MST_ID => value <= 0x7FF,
            ESC_ID => value <= 0xFF,
            CTRL_MODE => (1..=4).contains(&value),
            PMAX | VMAX | TMAX => {
                let end = f32::from_bits(value);
                end.is_finite() && end > 0.0
            }
            11..=20 | 36 | 50..=55 | SUPPLY | 80 | 81 => false,
            _ => number < self.registers.len(),
        };
        if !allowed {
            return;
        }
        self.registers[number] = value;
        match number {
            TIMEOUT => {
                let steps = u64::from(value);
                drive.set_timeout((steps > 0).then_some(steps * TIMEOUT_STEP_NS));
            }
            CTRL_MODE => drive.drop_goal(),
            PMAX | VMAX | TMAX => self.take_ranges(),
            _ => {}
        }
    }

    /// The ranges in force are those of the registers.
    fn take_ranges(&mut self) {
        let end = |number: usize| f64::from(f32::from_bits(self.registers[number]));
        let [position_rad, velocity_rad_s, torque_nm] = [PMAX, VMAX, TMAX].map(end);
        self.ranges = Ranges { position_rad, velocity_rad_s, torque_nm, ..self.ranges.clone() };
    }

    fn answer(&self, bytes: [u8; 8]) -> CanFrame {
        CanFrame::classic(self.registers[MST_ID] & 0x7FF, false, &bytes)
    }

    fn feedback(&self, drive: &Drive) -> CanFrame {
        let status = match drive.latched {
            None => u8::from(drive.enabled),
            Some(Trouble::OverVoltage) => 0x8,
            Some(Trouble::UnderVoltage) => 0x9,
            Some(Trouble::OverCurrent | Trouble::LostPhase) => 0xA,
            Some(Trouble::OverTemperature) => 0xB,
            Some(Trouble::Silence) => 0xD,
            Some(Trouble::Overload) => 0xE,
            // Newer firmware: the sensor cannot be read. Nothing is said of an emergency stop.
            Some(Trouble::Encoder | Trouble::Stopped) => 0x5,
        };
        let [p1, p0, v, vt, t] = state(&self.ranges, drive);
        let celsius = drive.celsius() as u8;
        let first = status << 4 | self.id() as u8 & 0x0F;
        self.answer([first, p1, p0, v, vt, t, celsius, celsius])
    }
}

/// What the eight bytes for an id plus `offset` want; nothing sensible if a number is none.
fn goal(ranges: &Ranges, offset: u32, bytes: [u8; 8]) -> Option<Goal> {
    let [b0, b1, b2, b3, b4, b5, b6, b7] = bytes;
    let first = f64::from(f32::from_le_bytes([b0, b1, b2, b3]));
    let second = f64::from(f32::from_le_bytes([b4, b5, b6, b7]));
    let profile =
        |speed: f64| Goal::Position { position: first, velocity: 0.0, gain: APPROACH_PER_S, speed };
    match offset {
        0 => Some(impedance(ranges, bytes)),
        0x100 => (first.is_finite() && second.is_finite()).then(|| profile(second)),
        0x200 => first.is_finite().then_some(Goal::Velocity(first)),
        // The share of the current is not modelled.
        _ => {
            let speed = f64::from(u16::from_le_bytes([b4, b5]).min(10_000)) * 0.01;
            first.is_finite().then(|| profile(speed))
        }
    }
}
