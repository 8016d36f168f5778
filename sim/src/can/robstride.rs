//! CyberGear and RobStride actuators, the makers' own protocol.
//!
//! Source: Xiaomi, "CyberGear instruction manual", section 4 (belovictor/cybergear-docs);
//! RobStride's manuals for what the newer ones add; kscalelabs/actuator 01c8f989. What they leave
//! open: the run mode changes only while the drive does not run; answers go to the host that asked
//! last; `limit_torque` and the gains of the modes do not change how it moves.

use super::CanFrame;
use super::coded::{decode, encode};
use super::drive::{Drive, Goal, Trouble};
use crate::servo::Event;
use gaitway_profiles::Ranges;
use std::collections::BTreeMap;

const RUN_MODE: u16 = 0x7005;
const TORQUE_CURRENT: u16 = 0x7006;
const SPEED_GOAL: u16 = 0x700A;
const POSITION_GOAL: u16 = 0x7016;
const SPEED_LIMIT: u16 = 0x7017;
const POSITION: u16 = 0x7019;
const CURRENT: u16 = 0x701A;
const VELOCITY: u16 = 0x701B;
const SUPPLY: u16 = 0x701C;
/// Silence allowed, in 50 us: a parameter of RobStride, a function code of CyberGear.
const TIMEOUT: u16 = 0x7028;
const CYBERGEAR_TIMEOUT: u16 = 0x200C;
const TIMEOUT_STEP_NS: u64 = 50_000;
/// How steeply a profile closes in on its goal, 1/s: the factory's `loc_kp`.
const APPROACH_PER_S: f64 = 30.0;
/// Torque for one ampere, N m (assumed; a CyberGear's).
const TORQUE_CONSTANT_NM_A: f64 = 0.87;
/// Between two reports, ns: the factory's EPScan_time of 1.
const REPORT_NS: u64 = 10_000_000;
/// The host until one has spoken.
const HOST: u8 = 0xFD;

#[derive(Clone, Debug)]
pub(super) struct Robstride {
    id: u8,
    ranges: Ranges,
    timeout_index: u16,
    /// Parameters by index, their bits: those that can be written.
    parameters: BTreeMap<u16, u32>,
    kept: BTreeMap<u16, u32>,
    host: u8,
    /// The fault it has told of.
    told: Option<Trouble>,
    /// When it tells of itself unasked next, if it does.
    report_ns: Option<u64>,
    cybergear: bool,
}

impl Robstride {
    pub fn new(id: u8, model: &str, ranges: Ranges) -> Robstride {
        let cybergear = model == "cybergear";
        let timeout_index = if cybergear { CYBERGEAR_TIMEOUT } else { TIMEOUT };
        let float = |value: f64| (value as f32).to_bits();
        let factory: BTreeMap<u16, u32> = [
            (RUN_MODE, 0),
            (TORQUE_CURRENT, 0),
            (SPEED_GOAL, 0),
            (0x700B, float(ranges.torque_nm)),
            (0x7010, float(0.125)),
            (0x7011, float(0.0158)),
            (0x7014, float(0.1)),
            (POSITION_GOAL, 0),
            (SPEED_LIMIT, float(ranges.velocity_rad_s)),
            (0x7018, float(ranges.torque_nm / TORQUE_CONSTANT_NM_A)),
            (0x701E, float(APPROACH_PER_S)),
            (0x701F, float(1.0)),
            (0x7020, float(0.002)),
            (timeout_index, 0),
        ]
        .into();
        let parameters = factory.clone();
        Robstride {
            id,
            ranges,
            timeout_index,
            parameters,
            kept: factory,
            host: HOST,
            told: None,
            report_ns: None,
            cybergear,
        }
    }

    pub fn restart(&mut self) {
        self.parameters.clone_from(&self.kept);
        self.report_ns = None;
    }

    pub fn due_ns(&self, drive: &Drive, now_ns: u64) -> Option<u64> {
        if drive.latched == self.told { self.report_ns } else { Some(now_ns) }
    }

    /// A fault is told of as it comes up, and all else at a steady rate if that was asked for.
    pub fn speak(&mut self, drive: &Drive, now_ns: u64) -> Vec<CanFrame> {
        if drive.latched == self.told {
            self.report_ns = Some(now_ns + REPORT_NS);
            return vec![self.feedback(24, drive)];
        }
        self.told = drive.latched;
        let bits: u32 = match drive.latched {
            None | Some(Trouble::Silence | Trouble::Stopped) => return Vec::new(),
            Some(Trouble::OverTemperature) => 1,
            Some(Trouble::LostPhase) => 1 << 1,
            Some(Trouble::UnderVoltage) => 1 << 2,
            Some(Trouble::OverVoltage) => 1 << 3,
            Some(Trouble::Encoder) => 1 << 7,
            Some(Trouble::Overload) => 1 << 14,
            Some(Trouble::OverCurrent) => 1 << 16,
        };
        let id = 21 << 24 | u32::from(self.id) << 8 | u32::from(self.host);
        vec![CanFrame::classic(id, true, &u64::from(bits).to_le_bytes())]
    }

    pub fn hear(&mut self, drive: &mut Drive, frame: &CanFrame) -> Vec<CanFrame> {
        let Ok(bytes) = <[u8; 8]>::try_from(frame.bytes.as_slice()) else { return Vec::new() };
        let [kind, high, low, target] = frame.id.to_be_bytes();
        if !frame.extended || target != self.id {
            return Vec::new();
        }
        drive.feed();
        if kind != 1 {
            self.host = low;
        }
        match kind {
            0 => return vec![self.identity()],
            1 => self.move_to(drive, u16::from_be_bytes([high, low]), bytes),
            3 => self.enable(drive),
            4 => {
                if bytes[0] == 1 {
                    drive.clear();
                }
                drive.disable();
            }
            6 => drive.place(0.0),
            7 => {
                self.id = high;
                drive.note(Event::Kept("the id"));
                return vec![self.identity()];
            }
            17 => return vec![self.read(drive, bytes)],
            18 => self.write(drive, bytes),
            22 if !self.cybergear && bytes == [1, 2, 3, 4, 5, 6, 7, 8] => {
                self.kept.clone_from(&self.parameters);
                drive.note(Event::Kept("all parameters"));
            }
            24 if !self.cybergear && bytes[..6] == [1, 2, 3, 4, 5, 6] => {
                self.report_ns = (bytes[6] == 1).then_some(drive.now_ns() + REPORT_NS);
            }
            _ => return Vec::new(),
        }
        vec![self.feedback(2, drive)]
    }

    /// The unique number of its processor, made up from its id.
    fn identity(&self) -> CanFrame {
        let id = u32::from(self.id) << 8 | 0xFE;
        CanFrame::classic(id, true, &[0x47, 0x57, 0, 0, 0, 0, 0, self.id])
    }

    fn run_mode(&self) -> u32 {
        self.parameters[&RUN_MODE] & 0xFF
    }

    fn move_to(&mut self, drive: &mut Drive, torque: u16, bytes: [u8; 8]) {
        if self.run_mode() != 0 {
            return;
        }
        let word = |k: usize| u64::from(u16::from_be_bytes([bytes[k], bytes[k + 1]]));
        let ranges = &self.ranges;
        let both = |code, end: f64| decode(code, 16, -end, end);
        drive.aim(Goal::impedance(
            both(word(0), ranges.position_rad),
            both(word(2), ranges.velocity_rad_s),
            decode(word(4), 16, 0.0, ranges.kp_nm_rad),
            decode(word(6), 16, 0.0, ranges.kd_nm_s_rad),
            both(torque.into(), ranges.torque_nm),
        ));
    }

    fn enable(&mut self, drive: &mut Drive) {
        if self.run_mode() == 0 {
            return drive.enable_without_goal();
        }
        if !drive.enabled {
            self.pursue(drive);
            drive.enable();
        }
    }

    /// The goal of the run mode in force, from the parameters.
    fn pursue(&self, drive: &mut Drive) {
        let value = |index: u16| f64::from(f32::from_bits(self.parameters[&index]));
        drive.aim(match self.run_mode() {
            1 => Goal::Position {
                position: value(POSITION_GOAL),
                velocity: 0.0,
                gain: APPROACH_PER_S,
                speed: value(SPEED_LIMIT),
            },
            2 => Goal::Velocity(value(SPEED_GOAL)),
            3 => Goal::Torque(value(TORQUE_CURRENT) * TORQUE_CONSTANT_NM_A),
            _ => return,
        });
    }

    fn write(&mut self, drive: &mut Drive, bytes: [u8; 8]) {
        let [i0, i1, _, _, value @ ..] = bytes;
        let (index, bits) = (u16::from_le_bytes([i0, i1]), u32::from_le_bytes(value));
        let allowed = match index {
            RUN_MODE => !drive.enabled && bits & 0xFF <= 3,
            _ if index == self.timeout_index => true,
            _ => f32::from_bits(bits).is_finite(),
        };
        let Some(parameter) = self.parameters.get_mut(&index).filter(|_| allowed) else { return };
        *parameter = bits;
        if index == self.timeout_index {
            let steps = u64::from(bits);
            drive.set_timeout((steps > 0).then_some(steps * TIMEOUT_STEP_NS));
        }
        let goals = [TORQUE_CURRENT, SPEED_GOAL, POSITION_GOAL, SPEED_LIMIT];
        if goals.contains(&index) && drive.enabled && self.run_mode() != 0 {
            self.pursue(drive);
        }
    }

    /// Bits 16 to 23 of the identifier say whether there is such a parameter.
    fn read(&self, drive: &Drive, bytes: [u8; 8]) -> CanFrame {
        let [i0, i1, ..] = bytes;
        let index = u16::from_le_bytes([i0, i1]);
        let float = |value: f64| Some((value as f32).to_bits());
        let value = match index {
            POSITION => float(drive.tell_rad()),
            CURRENT => float(drive.torque_nm / TORQUE_CONSTANT_NM_A),
            VELOCITY => float(drive.velocity_rad_s),
            SUPPLY => float(drive.supply_v()),
            _ => self.parameters.get(&index).copied(),
        };
        let failed = u32::from(value.is_none());
        let id = 17 << 24 | failed << 16 | u32::from(self.id) << 8 | u32::from(self.host);
        let [v0, v1, v2, v3] = value.unwrap_or(0).to_le_bytes();
        CanFrame::classic(id, true, &[i0, i1, 0, 0, v0, v1, v2, v3])
    }

    fn feedback(&self, kind: u32, drive: &Drive) -> CanFrame {
        let mode: u32 = if drive.enabled { 2 } else { 0 };
        let fault: u32 = match drive.latched {
            None | Some(Trouble::Silence | Trouble::Stopped | Trouble::OverVoltage) => 0,
            Some(Trouble::UnderVoltage) => 1 << 16,
            Some(Trouble::OverCurrent | Trouble::LostPhase) => 1 << 17,
            // A Hall encoder's on CyberGear.
            Some(Trouble::Overload) if self.cybergear => 1 << 17,
            Some(Trouble::Overload) => 1 << 20,
            Some(Trouble::OverTemperature) => 1 << 18,
            Some(Trouble::Encoder) => 1 << 19,
        };
        let who = u32::from(self.id) << 8 | u32::from(self.host);
        let ranges = &self.ranges;
        let whole = encode(drive.tell_rad(), 16, ranges.position_rad) << 48
            | encode(drive.velocity_rad_s, 16, ranges.velocity_rad_s) << 32
            | encode(drive.torque_nm, 16, ranges.torque_nm) << 16
            | (drive.celsius() * 10.0) as u64;
        CanFrame::classic(kind << 24 | mode << 22 | fault | who, true, &whole.to_be_bytes())
    }
}
