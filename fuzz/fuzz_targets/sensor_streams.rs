//! Any sensor stream in every format: no panic, progress at every step, and the same readings
//! whether the bytes arrive at once or a few at a time. SlimeVR datagrams besides.

#![no_main]

use gaitway::wire::Decoded;
use gaitway::wire::sensor::{Column, Format, Lines, Stream, decode, slimevr};
use libfuzzer_sys::fuzz_target;

fn format(number: u8) -> Format {
    let columns = |text: &str| -> Vec<Column> {
        text.split(' ').filter_map(|name| name.parse().ok()).collect()
    };
    match number % 11 {
        0 => Format::WitMotion,
        1 => Format::WitMotionBle,
        2 => Format::Bno08xRvc,
        3 => Format::Xsens,
        4 => Format::VectorNavBinary,
        5 => Format::VectorNavAscii,
        6 => Format::XImu3,
        7 => Format::Teapot,
        8 => Format::Cobs(columns("counter:u8 ax:i16 -:u8 ticks:u64 gx:f64")),
        9 => Format::Slip(columns("ax:f32 ay:f32 az:f32")),
        _ => Format::Lines(Lines {
            prefix: if number < 128 { "$IMU".to_owned() } else { String::new() },
            check: number < 128,
            columns: columns("ticks ax ay az"),
        }),
    }
}

/// The readings as text: a reading may hold not-a-number, which equals nothing.
fn readings(format: &Format, line: &[u8], portion: usize) -> String {
    let mut stream = Stream::new(format.clone());
    let mut seen = String::new();
    for bytes in line.chunks(portion) {
        stream.push(bytes, |reading| seen += &format!("{reading:?}"));
    }
    seen
}

// The first two bytes are the format and the portion in which the line arrives.
fuzz_target!(|input: &[u8]| {
    let [number, portion, line @ ..] = input else { return };
    let _ = slimevr::decode(line, |_| {});
    let format = format(*number);
    let mut rest = line;
    loop {
        let taken = match decode(&format, rest) {
            Decoded::Need(more) => {
                assert!(more > 0 && rest.len() + more <= 1100);
                break;
            }
            Decoded::Packet(_, n) | Decoded::Bad(_, n) | Decoded::Skip(n) | Decoded::Echo(n) => n,
        };
        assert!(taken > 0 && taken <= rest.len());
        rest = &rest[taken..];
    }
    let portion = usize::from(*portion).max(1);
    assert_eq!(readings(&format, line, portion), readings(&format, line, line.len().max(1)));
});
