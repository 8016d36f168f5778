//! A few servos on one line, and a host that speaks to them. The host's side of the protocols is
//! written here once more, bit by bit, so that it shares nothing with the crate.

use gaitway_profiles::{CanSpeed, Line, LineKind, Robot, Setup};
use gaitway_sim::{Options, World};

/// Bytes written as `FF FF FD 00`.
pub fn hex(text: &str) -> Vec<u8> {
    text.split_whitespace().map(|byte| u8::from_str_radix(byte, 16).unwrap()).collect()
}

pub fn crc16(bytes: &[u8]) -> u16 {
    let mut crc = 0_u16;
    for bit in bytes.iter().flat_map(|&byte| (0..8).rev().map(move |k| byte >> k & 1)) {
        let carry = (crc >> 15) as u8 ^ bit;
        crc = crc << 1 ^ if carry == 1 { 0x8005 } else { 0 };
    }
    crc
}

/// A DYNAMIXEL 2.0 instruction.
pub fn instruction(id: u8, code: u8, params: &[u8]) -> Vec<u8> {
    let mut body = vec![code];
    for &byte in params {
        body.push(byte);
        if body.ends_with(&[0xFF, 0xFF, 0xFD]) {
            body.push(0xFD);
        }
    }
    let mut packet = vec![0xFF, 0xFF, 0xFD, 0x00, id];
    packet.extend((body.len() as u16 + 2).to_le_bytes());
    packet.extend(body);
    packet.extend(crc16(&packet).to_le_bytes());
    packet
}

pub fn read(id: u8, address: u16, length: u16) -> Vec<u8> {
    instruction(id, 0x02, &[address.to_le_bytes(), length.to_le_bytes()].concat())
}

pub fn write(id: u8, address: u16, bytes: &[u8]) -> Vec<u8> {
    instruction(id, 0x03, &[&address.to_le_bytes(), bytes].concat())
}

/// Sync read (0x82) or fast sync read (0x8A).
pub fn sync_read(code: u8, address: u16, length: u16, ids: &[u8]) -> Vec<u8> {
    instruction(0xFE, code, &[&address.to_le_bytes(), &length.to_le_bytes(), ids].concat())
}

pub fn sync_write_goals(goals: &[(u8, i32)]) -> Vec<u8> {
    let mut params = vec![116, 0, 4, 0];
    for (id, goal) in goals {
        params.push(*id);
        params.extend(goal.to_le_bytes());
    }
    instruction(0xFE, 0x83, &params)
}

/// A DYNAMIXEL 2.0 status.
#[derive(Debug, PartialEq)]
pub struct Status {
    pub id: u8,
    pub error: u8,
    pub params: Vec<u8>,
}

/// Takes statuses apart; fails on any byte that is not part of a sound one.
pub fn statuses(mut bytes: &[u8]) -> Vec<Status> {
    let mut all = Vec::new();
    while !bytes.is_empty() {
        assert_eq!(bytes[..4], [0xFF, 0xFF, 0xFD, 0x00], "{bytes:02X?}");
        let length = usize::from(u16::from_le_bytes([bytes[5], bytes[6]]));
        let (packet, rest) = bytes.split_at(length + 7);
        let (body, crc) = packet.split_at(packet.len() - 2);
        assert_eq!(crc16(body).to_le_bytes(), crc, "{packet:02X?}");
        assert_eq!(body[7], 0x55);
        let mut params = Vec::new();
        let mut k = 8;
        while k < body.len() {
            params.push(body[k]);
            k += if params.ends_with(&[0xFF, 0xFF, 0xFD]) { 2 } else { 1 };
        }
        all.push(Status { id: body[4], error: params.remove(0), params });
        bytes = rest;
    }
    all
}

/// An instruction, or a status, of DYNAMIXEL Protocol 1.0 or FEETECH.
pub fn feetech(id: u8, code: u8, params: &[u8]) -> Vec<u8> {
    let mut packet = vec![0xFF, 0xFF, id, params.len() as u8 + 2, code];
    packet.extend(params);
    let sum: u32 = packet[2..].iter().map(|&byte| u32::from(byte)).sum();
    packet.push(!(sum as u8));
    packet
}

/// OP3's first joints, XM430-W350 at 1 Mbps without return delay, with these IDs.
pub fn dynamixels(ids: &[u8]) -> Robot {
    let mut robot = gaitway_profiles::robot("op3").unwrap();
    robot.lines[0].kind = LineKind::Serial { baud_bps: 1_000_000 };
    let mut setup = robot.setups.swap_remove(0);
    setup.registers.remove("Baud Rate");
    setup.registers.insert("Return Delay Time".into(), 0);
    robot.setups = vec![setup];
    robot.body = None;
    robot.joints.truncate(ids.len());
    for (joint, &id) in robot.joints.iter_mut().zip(ids) {
        joint.id = id;
        joint.name = format!("j{id}");
        joint.parent = None;
        (joint.lower_rad, joint.upper_rad, joint.initial) = (-1.5, 1.5, Some(0.0));
    }
    robot
}

/// Joints on STS3215 at 1 Mbps with these IDs.
pub fn feetechs(ids: &[u8]) -> Robot {
    let mut robot = gaitway_profiles::robot("open-duck-mini-v2").unwrap();
    robot.body = None;
    robot.joints.truncate(ids.len());
    for (joint, &id) in robot.joints.iter_mut().zip(ids) {
        joint.id = id;
        joint.name = format!("j{id}");
        joint.parent = None;
        (joint.lower_rad, joint.upper_rad, joint.initial) = (-3.0, 3.0, Some(0.0));
    }
    robot
}

/// Any servos on one line at 1 Mbps, without return delay; joints are named after the IDs.
pub fn mixed(servos: &[(&str, u8)]) -> Robot {
    let mut robot = dynamixels(&servos.iter().map(|&(_, id)| id).collect::<Vec<_>>());
    let common = robot.setups[0].clone();
    robot.setups.clear();
    for (joint, (servo, _)) in robot.joints.iter_mut().zip(servos) {
        joint.servo = (*servo).to_string();
        let firmware = match gaitway_profiles::servo(servo).unwrap().protocol {
            gaitway_profiles::Protocol::Dynamixel2 => 46,
            _ => 0x030A,
        };
        let registers = [("Return Delay Time".to_string(), 0)].into();
        let servo = joint.servo.clone();
        robot.setups.push(Setup { servo, firmware, registers, ..common.clone() });
    }
    robot
}

/// A world and its host.
pub struct Scene {
    pub world: World,
    pub baud_bps: u32,
}

impl Scene {
    pub fn new(robot: &Robot) -> Scene {
        Scene::with(robot, Options { permit_eeprom: true, ..Options::default() })
    }

    pub fn with(robot: &Robot, options: Options) -> Scene {
        let baud_bps = robot.lines[0].baud_bps().unwrap();
        Scene { world: World::new(robot, options).unwrap(), baud_bps }
    }

    /// Sends, then collects what comes until 20 ms pass in silence.
    pub fn ask(&mut self, bytes: &[u8]) -> Vec<u8> {
        self.world.transmit(0, bytes, self.baud_bps);
        let mut answer = Vec::new();
        let mut buf = [0; 4096];
        loop {
            let deadline_ns = self.world.now_ns() + 20_000_000;
            match self.world.receive(0, &mut buf, deadline_ns) {
                0 => return answer,
                count => answer.extend_from_slice(&buf[..count]),
            }
        }
    }

    /// The statuses to an instruction.
    pub fn tell(&mut self, bytes: &[u8]) -> Vec<Status> {
        statuses(&self.ask(bytes))
    }

    /// The error number of the one status to an instruction.
    pub fn error(&mut self, bytes: &[u8]) -> u8 {
        let statuses = self.tell(bytes);
        assert_eq!(statuses.len(), 1);
        statuses[0].error
    }

    pub fn set(&mut self, joint: &str, register: &str, raw: i64) {
        assert!(self.world.set_register(joint, register, raw), "{joint} {register}");
    }

    pub fn get(&self, joint: &str, register: &str) -> i64 {
        self.world.register(joint, register).unwrap()
    }

    pub fn wait_ms(&mut self, ms: u64) {
        let now_ns = self.world.now_ns();
        self.world.run_until(now_ns + ms * 1_000_000);
    }
}

/// OP3's first joints as CAN actuators of these profiles on one line at 1 Mbit/s, from zero pose,
/// the Damiao among them answering under 0x10 and their id.
pub fn can_robot(actuators: &[(&str, u8)]) -> Robot {
    let mut robot = gaitway_profiles::robot("op3").unwrap();
    robot.body = None;
    let name = robot.lines[0].name.clone();
    let speed = CanSpeed { bitrate_bps: 1_000_000, data_bitrate_bps: None, host_id: 0xFD };
    robot.lines = vec![Line { name: name.clone(), kind: LineKind::Can(speed) }];
    robot.setups.clear();
    robot.joints.truncate(actuators.len());
    for (k, (joint, &(model, id))) in robot.joints.iter_mut().zip(actuators).enumerate() {
        joint.name = format!("j{}", k + 1);
        (joint.line, joint.servo, joint.id) = (name.clone(), model.to_string(), id);
        joint.answer_id = model.starts_with("dm").then_some(0x10 + u16::from(id));
        (joint.direction, joint.gear, joint.offset_rad) = (1, 1.0, 0.0);
        (joint.lower_rad, joint.upper_rad, joint.velocity_rad_s) = (-2.0, 2.0, 5.0);
        (joint.initial, joint.parent, joint.shares_case_with) = (Some(0.0), None, None);
    }
    robot
}
