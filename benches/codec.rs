//! Nanoseconds per packet, ours and those of two published crates, on the same packets in the same
//! run: `cargo bench --bench codec`.
//!
//! `rustypot` is only reachable through a port, so its figures include its copies into and out of
//! one in memory; ours are the codec alone, with buffers that are used again. `dynamixel2` keeps
//! its packets to itself and shows only its CRC.

#[path = "../tests/wire_against_others/memory_port.rs"]
mod memory_port;

use gaitway::wire::checksum::crc16;
use gaitway::wire::{Decoded, dynamixel2 as dxl, feetech as sts};
use memory_port::MemoryPort;
use rustypot::DynamixelProtocolHandler;
use std::hint::black_box;
use std::time::Instant;

/// Servos of a small humanoid.
const SERVOS: u8 = 20;

/// Bytes each is asked for: current, velocity and position.
const ANSWER: usize = 10;

/// Nanoseconds per call: the median of 31 batches of 2,000.
fn time_ns(mut call: impl FnMut()) -> f64 {
    const CALLS: u32 = 2_000;
    let mut batches: Vec<f64> = (0..31)
        .map(|_| {
            let start = Instant::now();
            for _ in 0..CALLS {
                call();
            }
            start.elapsed().as_nanos() as f64 / f64::from(CALLS)
        })
        .collect();
    batches.sort_by(f64::total_cmp);
    batches[batches.len() / 2]
}

fn row(what: &str, ours_ns: f64, theirs: Option<(&str, f64)>) {
    match theirs {
        Some((name, ns)) => {
            let ratio = ns / ours_ns;
            println!("{what:<52} {ours_ns:>8.1} ns   {name:<10} {ns:>8.1} ns   {ratio:>5.1} x");
        }
        None => println!("{what:<52} {ours_ns:>8.1} ns"),
    }
}

fn processor() -> String {
    let cpuinfo = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = cpuinfo.lines().find_map(|line| line.strip_prefix("model name"));
    model.map_or("unknown", |model| model.trim_start_matches([' ', '\t', ':'])).to_owned()
}

/// Version of a crate in the lock file of this build.
fn version(name: &str) -> &'static str {
    let mut lines = include_str!("../Cargo.lock").lines();
    let wanted = format!("name = \"{name}\"");
    lines.find(|line| *line == wanted);
    lines.next().and_then(|line| line.split('"').nth(1)).unwrap_or("unknown")
}

fn dxl_ids() -> impl Iterator<Item = dxl::Id> {
    dxl::Id::every().skip(1).take(usize::from(SERVOS))
}

/// The status of `id` with parameters that need no stuffing.
fn status(id: u8) -> Vec<u8> {
    let mut packet = vec![0xFF, 0xFF, 0xFD, 0x00, id, ANSWER as u8 + 4, 0, 0x55, 0];
    packet.extend((0..ANSWER as u8).map(|n| n.wrapping_mul(29) ^ id));
    packet.extend(crc16(&packet).to_le_bytes());
    packet
}

fn merged_status() -> Vec<u8> {
    let length = 1 + usize::from(SERVOS) * (ANSWER + 4);
    let [low, high] = (length as u16).to_le_bytes();
    let mut packet = vec![0xFF, 0xFF, 0xFD, 0x00, 0xFE, low, high, 0x55];
    for id in 1..=SERVOS {
        packet.extend([0, id]);
        packet.extend([id; ANSWER]);
        packet.extend(crc16(&packet).to_le_bytes());
    }
    packet
}

/// Takes all statuses from `line`; returns how many.
fn read_line(mut line: &[u8], scratch: &mut Vec<u8>) -> usize {
    let mut packets = 0;
    loop {
        let taken = match dxl::decode(line, scratch) {
            Decoded::Need(_) => return packets,
            Decoded::Packet(status, n) => {
                black_box(status);
                packets += 1;
                n
            }
            Decoded::Skip(n) | Decoded::Bad(_, n) | Decoded::Echo(n) => n,
        };
        line = &line[taken..];
    }
}

fn checksums() {
    for length in [15, 114, 1024] {
        let bytes: Vec<u8> = (0..length).map(|n| (n * 31 % 251) as u8).collect();
        let ours = time_ns(|| {
            black_box(crc16(black_box(&bytes)));
        });
        let theirs = time_ns(|| {
            black_box(dynamixel2::checksum::calculate_checksum(0, black_box(&bytes)));
        });
        row(&format!("CRC of {length} bytes"), ours, Some(("dynamixel2", theirs)));
    }
}

fn dynamixel_writes() {
    let them = DynamixelProtocolHandler::v2();
    let (mut out, mut port) = (Vec::new(), MemoryPort::default());
    let goals: Vec<Vec<u8>> = (0..SERVOS).map(|n| vec![n, 8, 0, 0]).collect();
    let ids: Vec<u8> = (1..=SERVOS).collect();
    let ours = time_ns(|| {
        out.clear();
        let _ = black_box(dxl::sync_write(&mut out, 116, 4, dxl_ids().zip(black_box(&goals))));
    });
    let theirs = time_ns(|| {
        port.sent.clear();
        let _ = black_box(them.sync_write(&mut port, black_box(&ids), 116, &goals));
    });
    assert_eq!(out, port.sent, "not the same packet");
    row("encode sync write, 20 x 4 bytes", ours, Some(("rustypot", theirs)));

    // Every goal the worst there is: each needs a stuffed byte.
    let goals = vec![vec![0xFF, 0xFF, 0xFD, 0x00]; usize::from(SERVOS)];
    let ours = time_ns(|| {
        out.clear();
        let _ = black_box(dxl::sync_write(&mut out, 116, 4, dxl_ids().zip(black_box(&goals))));
    });
    let theirs = time_ns(|| {
        port.sent.clear();
        let _ = black_box(them.sync_write(&mut port, black_box(&ids), 116, &goals));
    });
    assert_eq!(out, port.sent, "not the same packet");
    row("encode sync write, 20 x 4 bytes, all stuffed", ours, Some(("rustypot", theirs)));
}

fn dynamixel_reads() {
    let them = DynamixelProtocolHandler::v2();
    let (mut out, mut scratch) = (Vec::new(), Vec::new());
    let ids: Vec<u8> = (1..=SERVOS).collect();

    let one = status(1);
    let ours = time_ns(|| {
        black_box(read_line(black_box(&one), &mut scratch));
    });
    row("decode status, 10 bytes", ours, None);

    let line: Vec<u8> = (1..=SERVOS).flat_map(status).collect();
    assert_eq!(read_line(&line, &mut scratch), usize::from(SERVOS));
    let ours = time_ns(|| {
        out.clear();
        let _ = black_box(dxl::sync_read(&mut out, 126, ANSWER as u16, dxl_ids()));
        black_box(read_line(black_box(&line), &mut scratch));
    });
    let mut port = MemoryPort::answering(&line);
    let theirs = time_ns(|| {
        port.sent.clear();
        let _ = black_box(them.sync_read(&mut port, black_box(&ids), 126, ANSWER as u8));
    });
    row("encode sync read, decode 20 statuses of 10 bytes", ours, Some(("rustypot", theirs)));

    let merged = merged_status();
    let asked: Vec<_> = dxl_ids().map(|id| (id, ANSWER)).collect();
    assert!(dxl::decode_merged(&merged, &asked).answers().all(|(_, answer)| answer.is_ok()));
    let ours = time_ns(|| {
        out.clear();
        let _ = black_box(dxl::fast_sync_read(&mut out, 126, ANSWER as u16, dxl_ids()));
        for answer in dxl::decode_merged(black_box(&merged), &asked).answers() {
            let _ = black_box(answer);
        }
    });
    let mut port = MemoryPort::answering(&merged);
    assert!(them.fast_sync_read(&mut port, &ids, 126, ANSWER as u8).is_ok());
    let theirs = time_ns(|| {
        port.sent.clear();
        let _ = black_box(them.fast_sync_read(&mut port, black_box(&ids), 126, ANSWER as u8));
    });
    row("encode fast sync read, decode merged 20 x 10 bytes", ours, Some(("rustypot", theirs)));
}

fn feetech() {
    let them = DynamixelProtocolHandler::v1();
    let (mut out, mut port) = (Vec::new(), MemoryPort::default());
    let goals: Vec<Vec<u8>> = (0..SERVOS).map(|n| vec![n, 8, 0, 0, 0, 0]).collect();
    let ids: Vec<u8> = (1..=SERVOS).collect();
    let ours = time_ns(|| {
        out.clear();
        let ids = sts::Id::every().skip(1);
        let _ = black_box(sts::sync_write(&mut out, 42, 6, ids.zip(black_box(&goals))));
    });
    let theirs = time_ns(|| {
        port.sent.clear();
        let _ = black_box(them.sync_write(&mut port, black_box(&ids), 42, &goals));
    });
    assert_eq!(out, port.sent, "not the same packet");
    row("Feetech: encode sync write, 20 x 6 bytes", ours, Some(("rustypot", theirs)));
}

fn main() {
    println!("{}", processor());
    println!("dynamixel2 {}, rustypot {}", version("dynamixel2"), version("rustypot"));
    println!("ours first, then theirs, then theirs / ours\n");
    checksums();
    dynamixel_writes();
    dynamixel_reads();
    feetech();
}
