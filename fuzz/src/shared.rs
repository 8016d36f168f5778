//! What the targets share: reading a line to its end, making check sums fit, virtual robots and files.
//!
//! A random packet almost never has the right check sum, so each decoder is also tried on the
//! input with its sums put right; otherwise nothing behind the check would ever be reached.

use gaitway::mocap::bvh::{Bvh, MAX_JOINTS, MAX_POSES};
use gaitway::wire::Decoded;
use gaitway::wire::checksum::{crc16, sum8};
use gaitway_profiles::{LineKind, Robot, Setup};
use peakmem_alloc::{INSTRUMENTED_SYSTEM, PeakMemAlloc};
use std::alloc::System;
use std::path::{Path, PathBuf};

/// Tells how much memory a target took; the same one for all targets, since they are one program.
#[global_allocator]
pub static ALLOCATOR: &PeakMemAlloc<System> = &INSTRUMENTED_SYSTEM;

/// A status that owns its bytes: id, and whatever else identifies what was read.
pub type Seen = (u8, Vec<u8>);

/// Panics if what was read as a capture is larger than one may be, or not whole.
pub fn keeps_bounds(bvh: &Bvh) {
    let (joints, poses) = (bvh.joints.len(), bvh.pose_count());
    assert!((1..=MAX_JOINTS).contains(&joints) && (1..=MAX_POSES).contains(&poses));
    assert_eq!(bvh.values.len(), poses * bvh.channel_count());
    assert!(bvh.values.iter().all(|value| value.is_finite()) && bvh.time_step_s > 0.0);
    for (index, joint) in bvh.joints.iter().enumerate() {
        assert!(joint.parent.is_none_or(|parent| parent < index) && joint.offset.is_finite());
    }
}

/// Reads `line` as it arrives in portions of `portion` bytes and then falls silent. Panics if a
/// step takes nothing or what is not there, or if more is awaited than a packet can have.
pub fn read_line(
    line: &[u8],
    portion: usize,
    longest_packet: usize,
    mut front: impl FnMut(&[u8]) -> Decoded<Seen>,
    abandon: impl Fn(&[u8]) -> usize,
) -> Vec<Seen> {
    let mut seen = Vec::new();
    let (mut start, mut end) = (0, 0);
    loop {
        let received = &line[start..end];
        let taken = match front(received) {
            Decoded::Packet(status, n) => {
                seen.push(status);
                n
            }
            Decoded::Skip(n) | Decoded::Bad(_, n) | Decoded::Echo(n) => n,
            Decoded::Need(n) => {
                assert!(n > 0 && received.len() + n <= longest_packet);
                if end < line.len() {
                    end = line.len().min(end + portion);
                    continue;
                }
                if received.is_empty() {
                    return seen;
                }
                abandon(received)
            }
        };
        assert!(taken > 0 && taken <= received.len(), "{taken} of {}", received.len());
        start += taken;
    }
}

/// Puts right the CRC of every Protocol 2.0 packet in `line`, as far as its length field holds.
pub fn mend_dynamixel2(line: &mut [u8]) {
    let mut at = 0;
    while at + 7 <= line.len() {
        let packet = &mut line[at..];
        let total = 7 + usize::from(u16::from_le_bytes([packet[5], packet[6]]));
        if packet[..4] == [0xFF, 0xFF, 0xFD, 0x00] && (9..=packet.len()).contains(&total) {
            let crc = crc16(&packet[..total - 2]);
            packet[total - 2..total].copy_from_slice(&crc.to_le_bytes());
            at += total;
        } else {
            at += 1;
        }
    }
}

/// Puts right the sum of every Feetech packet in `line`, as far as its length field holds.
pub fn mend_feetech(line: &mut [u8]) {
    let mut at = 0;
    while at + 4 <= line.len() {
        let packet = &mut line[at..];
        let total = 4 + usize::from(packet[3]);
        if packet[..2] == [0xFF, 0xFF] && packet[2] != 0xFF && (5..=packet.len()).contains(&total) {
            packet[total - 1] = sum8(&packet[2..total - 1]);
            at += total;
        } else {
            at += 1;
        }
    }
}

/// An instruction of Protocol 2.0, stuffed and sealed.
pub fn dynamixel2_packet(id: u8, code: u8, params: &[u8]) -> Vec<u8> {
    let mut packet = vec![0xFF, 0xFF, 0xFD, 0x00, id, 0, 0, code];
    for &byte in params {
        packet.push(byte);
        if packet.len() >= 10 && packet.ends_with(&[0xFF, 0xFF, 0xFD]) {
            packet.push(0xFD);
        }
    }
    let length = (packet.len() - 5) as u16;
    packet[5..7].copy_from_slice(&length.to_le_bytes());
    let crc = crc16(&packet);
    packet.extend(crc.to_le_bytes());
    packet
}

/// An instruction of Protocol 1.0 or of Feetech, sealed.
pub fn dynamixel1_packet(id: u8, code: u8, params: &[u8]) -> Vec<u8> {
    let mut packet = vec![0xFF, 0xFF, id, params.len() as u8 + 2, code];
    packet.extend(params);
    packet.push(sum8(&packet[2..]));
    packet
}

/// Servos of every family on one line at 1 Mbit/s: 1 speaks Protocol 2.0, 2 and 5 Protocol 1.0,
/// 3 STS, 4 SCS.
pub fn mixed_robot() -> Robot {
    let servos = ["xl430-w250", "ax-12a", "sts3215", "scs0009", "mx-28"].into_iter().zip(1..);
    let mut robot = gaitway_profiles::robot("op3").expect("a shipped robot");
    robot.lines[0].kind = LineKind::Serial { baud_bps: 1_000_000 };
    let common = robot.setups.swap_remove(0);
    robot.setups.clear();
    robot.joints.truncate(5);
    for (joint, (servo, id)) in robot.joints.iter_mut().zip(servos) {
        (joint.id, joint.servo, joint.parent) = (id, servo.to_owned(), None);
        joint.name = format!("j{id}");
        (joint.lower_rad, joint.upper_rad, joint.initial) = (-1.5, 1.5, Some(0.0));
        let firmware = if id == 1 { 46 } else { 0x030A };
        let registers = [("Return Delay Time".to_owned(), 0)].into();
        let servo = servo.to_owned();
        robot.setups.push(Setup { servo, firmware, registers, ..common.clone() });
    }
    robot
}

/// A folder for what is read from a file only; in memory where the system has such.
pub struct Scratch(PathBuf);

impl Scratch {
    /// The folder of a target in this process; made if it is not there.
    pub fn new(target: &str) -> Self {
        let memory = Path::new("/dev/shm");
        let root = if memory.is_dir() { memory.to_owned() } else { std::env::temp_dir() };
        let folder = root.join(format!("gaitway-fuzz-{target}-{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("a folder for a file");
        Self(folder)
    }

    /// Writes a file in place of the one of this name.
    pub fn write(&self, name: &str, bytes: &[u8]) -> PathBuf {
        let path = self.0.join(name);
        std::fs::write(&path, bytes).expect("a file");
        path
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}
