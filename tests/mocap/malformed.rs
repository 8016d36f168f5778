//! Broken files of every kind that is read: cut off, with bytes that are others, with numbers that lie. Whatever is in
//! them, each is read or refused in the end, and what is read is finite and no more than the file can hold.

use crate::captured;
use crate::captured::captured;
use crate::program;
use gaitway::action::table;
use gaitway::capture::Mode;
use gaitway::mocap::markers::Markers;
use gaitway::mocap::{acclaim, bvh, c3d, csm, marker_table, opensim, trc};
use gaitway::recording;
use gaitway::session::tables::{self, DeclaredSensors};
use std::fs;
use std::path::{Path, PathBuf};

/// What a table of one sensor may be called.
const SENSOR: &str = "time = \"t\"\n[[sensor]]\nname = \"a\"\nrate = [\"u\", \"v\", \"w\"]\n\
                      acceleration = [\"x\", \"y\", \"z\"]\nfield = [\"x\", \"y\", \"z\"]\n";
/// Numbers that lie about a file of a few hundred bytes.
const LIES: [&str; 10] = [
    "0",
    "-1",
    "1",
    "65536",
    "2147483648",
    "4294967295",
    "18446744073709551616",
    "1e308",
    "nan",
    "",
];
/// Larger files are not broken over and over.
const MOST_BYTES: u64 = 300_000;

fn is_finite(markers: &Markers, bytes: usize) {
    let head = markers.head();
    assert!(
        head.frames.saturating_mul(head.points.len()) <= bytes.max(64),
        "more than it can hold"
    );
    for frame in 0..head.frames {
        for point in 0..head.points.len() {
            let sample = markers.sample(frame, point);
            assert!(sample.is_none_or(|of| of.position.iter().all(|number| number.is_finite())));
        }
    }
}

/// Reads bytes as one kind of file; true if it is one.
fn read(kind: &str, bytes: &[u8], skeleton: &[u8]) -> bool {
    let markers = |read: Result<Markers, gaitway::error::Error>| {
        read.as_ref().map(|markers| is_finite(markers, bytes.len())).is_ok()
    };
    let text = std::str::from_utf8(bytes).unwrap_or_default();
    match kind {
        "bvh" => bvh::parse(bytes).is_ok_and(|bvh| {
            assert!(bvh.values.len() <= bytes.len() && bvh.values.iter().all(|of| of.is_finite()));
            true
        }),
        "asf" => acclaim::parse_skeleton(bytes).is_ok(),
        "amc" => {
            let skeleton = acclaim::parse_skeleton(skeleton).expect("a whole skeleton");
            acclaim::parse(bytes, &skeleton, None).is_ok_and(|(bvh, _)| {
                assert!(bvh.values.iter().all(|of| of.is_finite()));
                true
            })
        }
        "c3d" => markers(c3d::parse(bytes)),
        "trc" => markers(trc::parse(bytes)),
        "csm" => markers(csm::parse(bytes)),
        "mot" | "sto" => opensim::parse(bytes).is_ok_and(|table| {
            let _ = table.body_angles();
            assert!(table.rows() <= bytes.len());
            true
        }),
        "txt" => tables::of_xsens(text, "a").is_ok_and(|mut series| {
            let _ = tables::fuse(&mut series, &DeclaredSensors::default(), Some(Mode::NineAxes));
            true
        }),
        "csv" => {
            let declared = DeclaredSensors::parse(SENSOR).expect("a declaration");
            let is_sensor = tables::of_table(text, &declared).is_ok();
            let is_of_angles = table::parse(bytes).is_ok_and(|table| {
                assert!(table.angles.len() <= bytes.len() && table.rate_hz > 0.0);
                assert!(table.angles.iter().flat_map(|of| of.0).all(f64::is_finite));
                true
            });
            markers(marker_table::parse(bytes)) || is_sensor || is_of_angles
        }
        other => panic!("nobody reads .{other}"),
    }
}

fn kind_of(path: &Path) -> String {
    path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase()
}

fn small_files() -> Vec<PathBuf> {
    let seeds = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/seeds");
    let of = |folder: &str| fs::read_dir(seeds.join(folder)).expect("a folder");
    let all = ["marker_texts", "acclaim", "motions"].into_iter().flat_map(of);
    let mut files: Vec<PathBuf> = all
        .map(|entry| entry.expect("an entry").path())
        .filter(|path| path.file_name().is_some_and(|name| name != "table.csv"))
        .collect();
    files.sort();
    files
}

fn skeleton() -> Vec<u8> {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/seeds/acclaim/skeleton.asf");
    fs::read(file).expect("a skeleton")
}

/// Where numbers stand in a text.
fn numbers(bytes: &[u8]) -> Vec<std::ops::Range<usize>> {
    let is_of_number = |byte: &u8| byte.is_ascii_digit() || matches!(byte, b'.' | b'-' | b'+');
    let mut found = Vec::new();
    let mut at = 0;
    while at < bytes.len() {
        let length = bytes[at..].iter().take_while(|byte| is_of_number(byte)).count();
        if length > 0 {
            found.push(at..at + length);
        }
        at += length.max(1);
    }
    found
}

#[test]
fn texts_that_are_cut_off_or_changed_or_that_lie_are_read_or_refused() {
    let (skeleton, mut kinds) = (skeleton(), Vec::new());
    for path in small_files() {
        let (kind, whole) = (kind_of(&path), fs::read(&path).expect("a file"));
        assert!(read(&kind, &whole, &skeleton), "{}", path.display());
        let mut is_read = 0;
        for at in 0..whole.len() {
            is_read += usize::from(read(&kind, &whole[..at], &skeleton));
            for with in [0, b' ', b'\n', b'\t', b'9', b'-', b',', b'{', 0x80, 0xff] {
                let mut broken = whole.clone();
                broken[at] = with;
                is_read += usize::from(read(&kind, &broken, &skeleton));
            }
        }
        for number in numbers(&whole) {
            for lie in LIES {
                let mut broken = whole[..number.start].to_vec();
                broken.extend(lie.as_bytes());
                broken.extend(&whole[number.end..]);
                is_read += usize::from(read(&kind, &broken, &skeleton));
            }
        }
        assert!(is_read > 0, "{}: nothing of it is read any more", path.display());
        kinds.push(kind);
    }
    kinds.sort();
    kinds.dedup();
    assert_eq!(kinds, ["amc", "asf", "bvh", "csm", "csv", "mot", "sto", "trc", "txt"]);
}

#[test]
fn recordings_that_are_cut_off_or_changed_are_read_or_refused() {
    let folder = program::folder("malformed");
    let file = folder.join("broken.mcap");
    let text = include_str!("../../fuzz/seeds/recordings.hex");
    let digit = |byte: &u8| char::from(*byte).to_digit(16).expect("a digit") as u8;
    let bytes = |line: &str| -> Vec<u8> {
        line.as_bytes().chunks(2).map(|of| digit(&of[0]) << 4 | digit(&of[1])).collect()
    };
    for line in text.lines().filter(|line| !line.starts_with('#') && !line.is_empty()) {
        let whole = bytes(line);
        let mut broken: Vec<Vec<u8>> =
            (0..whole.len()).step_by(7).map(|at| whole[..at].to_vec()).collect();
        for at in (0..whole.len()).step_by(5) {
            for with in [0x00, 0x7f, 0xff] {
                let mut changed = whole.clone();
                changed[at] = with;
                broken.push(changed);
            }
        }
        for bytes in broken {
            fs::write(&file, &bytes).expect("a file");
            let _ = recording::read(&file);
            let _ = recording::sensor_series(&file);
        }
    }
}

#[test]
fn real_captures_that_are_cut_off_every_512_bytes_are_read_or_refused() {
    let Some(folder) = captured("mocap") else { return };
    let mut files = captured::bvh_files(&folder);
    files.extend(captured::c3d_files().unwrap_or_default());
    let (mut tried, mut is_read) = (0, 0);
    for path in files {
        if path.metadata().is_ok_and(|of| of.len() > MOST_BYTES) {
            continue;
        }
        let (kind, whole) = (kind_of(&path), fs::read(&path).expect("a file"));
        // Of a long text a part of the places, all over it: each cut is read anew from its beginning.
        let most =
            if kind == "c3d" || std::env::var_os("GAITWAY_LONG").is_some() { 600 } else { 40 };
        let step = 512 * whole.len().div_ceil(512).div_ceil(most);
        for length in (0..whole.len()).step_by(step) {
            tried += 1;
            is_read += usize::from(read(&kind, &whole[..length], &[]));
            let mut broken = whole.clone();
            broken[length] ^= 0xa5;
            read(&kind, &broken, &[]);
        }
    }
    println!("{is_read} of {tried} that were cut off are read in part");
    assert!(tried > 1000 && is_read > 0, "{is_read} of {tried}");
}
