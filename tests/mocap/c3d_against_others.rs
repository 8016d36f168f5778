//! C3D files as other people's readers see them (the packages ezc3d and c3d of PyPI, and the crate c3dio): what
//! they open we open, with their frames, points and rates, and sample by sample with their numbers. Where
//! they differ, the raw bytes were looked at; `JUDGED` says what was found. What we write, they read.

use crate::aloud::aloud;
use crate::captured::c3d_files;
use crate::dumped::{Seen, by_c3dio, by_us, dumped};
use crate::judged;
use crate::judged::{JUDGED, Opened};
use crate::python;
use gaitway::mocap::c3d;
use gaitway::mocap::markers::{Frames, FramesOf, Markers};
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

fn name_of(path: &Path) -> String {
    path.file_name().expect("a name").to_string_lossy().into_owned()
}

fn scratch(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).expect("a folder");
    folder
}

/// What two readers say of one file and do not say alike, a word each.
fn differences(ours: &Seen, theirs: &Seen) -> BTreeSet<&'static str> {
    let mut found = BTreeSet::new();
    let mut unless = |same: bool, what| {
        if !same {
            found.insert(what);
        }
    };
    unless(ours.frames == theirs.frames, "frames");
    unless(ours.points == theirs.points, "points");
    unless((ours.rate_hz - theirs.rate_hz).abs() <= 1e-4, "rate");
    unless(ours.first == theirs.first, "first frame");
    unless(ours.channels == theirs.channels && ours.samples == theirs.samples, "channels");
    // Labels that are missing have names of ours, and some readers cut at the first blank.
    let named = theirs.labels.iter().zip(&ours.labels).filter(|(theirs, _)| !theirs.is_empty());
    unless(named.into_iter().all(|(theirs, ours)| theirs == ours), "labels");
    if ours.frames == theirs.frames && ours.points == theirs.points {
        for (ours, theirs) in ours.samples_of_points.iter().zip(&theirs.samples_of_points) {
            match (ours, theirs) {
                (Some(ours), Some(theirs)) => {
                    // They scale integers in 32 or 64 bits: half a unit in the last place of 32.
                    let near = |a: f64, b: f64| (a - b).abs() <= 1.2e-7 * a.abs();
                    unless((0..3).all(|axis| near(ours[axis], theirs[axis])), "positions");
                    unless((ours[3] - theirs[3]).abs() <= 1e-6 * ours[3].abs(), "residuals");
                }
                (None, None) => {}
                (Some(_), None) => unless(false, "they do not see"),
                (None, Some(_)) => unless(false, "they see"),
            }
        }
    }
    if ours.analog.len() == theirs.analog.len() {
        let near = |(a, b): (&f64, &f64)| (a - b).abs() <= 1e-6 * a.abs().max(1e-6);
        unless(ours.analog.iter().zip(&theirs.analog).all(near), "analog values");
    }
    found
}

#[test]
fn what_others_open_is_opened_and_every_difference_is_accounted_for() {
    let Some(files) = c3d_files() else { return };
    let python = match python::python() {
        Ok(python) => Some(python.program),
        Err(cause) => {
            aloud!("SKIPPED: no Python with the packages ezc3d and c3d: {cause}");
            None
        }
    };
    let folder = scratch("c3d-against-others");
    let others = python.map(|python| dumped(&python, &folder, &files));
    let mut met = BTreeSet::new();
    for (number, path) in files.iter().enumerate() {
        let name = name_of(path);
        let ours = by_us(path).unwrap_or_else(|error| panic!("{name} is not opened: {error}"));
        let mut readers = vec![("c3dio", by_c3dio(path))];
        if let Some(others) = &others {
            readers.extend(["ezc3d", "c3d"].map(|of| (of, others.seen(number, of))));
        }
        for (reader, theirs) in readers {
            let found = match theirs {
                Ok(theirs) => differences(&ours, &theirs),
                Err(_) => BTreeSet::from(["refused"]),
            };
            for what in found {
                let row = JUDGED
                    .iter()
                    .find(|row| row.file == name && row.reader == reader && row.what == what);
                assert!(row.is_some(), "{name}, {reader}: {what} (not judged)");
                met.insert((name.clone(), reader, what));
            }
        }
    }
    let here: BTreeSet<String> = files.iter().map(|path| name_of(path)).collect();
    let read = |reader: &str| others.is_some() || reader == "c3dio";
    for row in JUDGED.iter().filter(|row| here.contains(row.file) && read(row.reader)) {
        let key = (row.file.to_owned(), row.reader, row.what);
        assert!(met.contains(&key), "{key:?} is no difference any more: {}", row.why);
    }
}

/// What the readers that are right about a file say of it, by hand from their output.
#[test]
fn every_file_has_the_frames_points_and_rates_that_were_found_in_it() {
    let Some(files) = c3d_files() else { return };
    for path in files {
        let name = name_of(&path);
        let Some(known) = judged::OPENED.iter().find(|known| known.file == name) else { continue };
        let seen = by_us(&path).unwrap_or_else(|error| panic!("{name}: {error}"));
        let Opened { frames, points, rate_hz, channels, samples, .. } = *known;
        assert_eq!((seen.frames, seen.points), (frames, points), "{name}");
        assert!((seen.rate_hz - rate_hz).abs() < 1e-3, "{name}: {} Hz", seen.rate_hz);
        assert_eq!((seen.channels, seen.samples), (channels, samples), "{name}");
    }
}

/// The files of one trial, by what they are.
const TWINS: [&[&str]; 2] = [
    &["Eb015pi.c3d", "Eb015sr.c3d", "Eb015vr.c3d", "Eb015pr.c3d", "Eb015si.c3d", "Eb015vi.c3d"],
    &["pc_int.c3d", "Dec_real.c3d", "sgi_real.c3d", "pc_real.c3d", "sgi_int.c3d", "Dec_int.c3d"],
];

#[test]
fn the_encodings_of_one_trial_are_read_alike() {
    let Some(files) = c3d_files() else { return };
    for names in TWINS {
        let of = |name: &&str| files.iter().find(|path| path.ends_with(name));
        let trials: Vec<Markers> =
            names.iter().filter_map(of).map(|path| c3d::read(path).expect("read")).collect();
        let Some((first, others)) = trials.split_first() else { continue };
        assert!(others.len() > 1, "{names:?}: {} files", trials.len());
        for other in others {
            let (a, b) = (first.head(), other.head());
            assert_eq!((a.frames, &a.points, a.rate_hz), (b.frames, &b.points, b.rate_hz));
            assert_eq!((&a.analog, &a.events, &a.plates), (&b.analog, &b.events, &b.plates));
            let is_real = |trial: &Markers| trial.head().encoding.ends_with("real");
            let same_kind = is_real(first) == is_real(other);
            let step = if same_kind { 0.0 } else { a.residual_step };
            for frame in 0..a.frames {
                assert_eq!(first.analog_counts(frame), other.analog_counts(frame));
                for point in 0..a.points.len() {
                    let (a, b) = (first.sample(frame, point), other.sample(frame, point));
                    assert_eq!(a.is_some(), b.is_some(), "frame {frame}, point {point}");
                    let (Some(a), Some(b)) = (a, b) else { continue };
                    assert_eq!((a.residual, a.cameras), (b.residual, b.cameras));
                    for (a, b) in a.position.iter().zip(b.position) {
                        assert!((a - b).abs() <= step, "frame {frame}, point {point}: {a} {b}");
                    }
                }
            }
        }
        let reals: Vec<&Markers> =
            trials.iter().filter(|trial| trial.head().encoding.ends_with("real")).collect();
        assert!(reals.len() > 1, "{names:?}: DEC and MIPS are compared bit for bit");
        for frame in 0..reals[0].head().frames {
            for point in 0..reals[0].head().points.len() {
                let bits = |trial: &&Markers| {
                    trial.sample(frame, point).map(|sample| sample.position.map(f32::to_bits))
                };
                let all: BTreeSet<_> = reals.iter().map(bits).collect();
                assert_eq!(all.len(), 1, "frame {frame}, point {point}");
            }
        }
    }
}

#[test]
fn what_is_written_is_what_was_read_and_other_readers_see_it() {
    let Some(files) = c3d_files() else { return };
    let folder = scratch("c3d-written");
    let mut written = Vec::new();
    for path in &files {
        let name = name_of(path);
        let read = c3d::read(path).expect("read");
        let mut bytes = Vec::new();
        let notes = c3d::write::write(&mut bytes, &mut FramesOf::new(&read)).expect("written");
        let is_renaming = |note: &String| note.contains("is written as");
        assert!(notes.iter().all(is_renaming), "{name}: {notes:?}");
        let mut reader = c3d::Reader::new(bytes.as_slice(), bytes.len() as u64).expect("read");
        let findings = reader.findings();
        assert_eq!(findings, Vec::<String>::new(), "{name}");
        let (a, b) = (read.head(), reader.head().clone());
        assert_eq!(
            (&a.points, a.frames, a.first_frame),
            (&b.points, b.frames, b.first_frame),
            "{name}"
        );
        assert_eq!((a.rate_hz, &a.unit, &a.screen), (b.rate_hz, &b.unit, &b.screen), "{name}");
        assert_eq!((&a.plates, &a.subjects), (&b.plates, &b.subjects), "{name}");
        for (a, b) in a.events.iter().zip(&b.events) {
            assert_eq!((a.time_s, &a.label), (b.time_s, &b.label), "{name}");
        }
        assert_eq!(a.events.len(), b.events.len(), "{name}");
        judged::keeps_unknown_groups(&name, &a.parameters, &b.parameters);
        let mut frame = Default::default();
        for index in 0..a.frames {
            assert!(reader.next_frame(&mut frame).expect("a frame"));
            for point in 0..a.points.len() {
                assert_eq!(read.sample(index, point), frame.points[point], "{name}, frame {index}");
            }
            let channels = a.analog.channels.len().max(1);
            for (at, (x, y)) in read.analog_counts(index).iter().zip(&frame.analog).enumerate() {
                let (x, y) = (
                    a.analog.channels[at % channels].value(*x),
                    b.analog.channels[at % channels].value(*y),
                );
                assert!((x - y).abs() <= 1e-6 * x.abs(), "{name}, frame {index}: {x} {y}");
            }
        }
        assert!(!reader.next_frame(&mut frame).expect("the end"), "{name}");
        let file = folder.join(name);
        fs::write(&file, bytes).expect("a file");
        written.push(file);
    }
    let mut readers: Vec<(&str, PathBuf, Result<Seen, String>)> = Vec::new();
    readers.extend(written.iter().map(|file| ("c3dio", file.clone(), by_c3dio(file))));
    match python::python() {
        Err(cause) => aloud!("SKIPPED: no Python with the packages ezc3d and c3d: {cause}"),
        Ok(python) => {
            let others = dumped(&python.program, &scratch("c3d-written-read"), &written);
            for (number, file) in written.iter().enumerate() {
                for reader in ["ezc3d", "c3d"] {
                    readers.push((reader, file.clone(), others.seen(number, reader)));
                }
            }
        }
    }
    let mut unjudged = Vec::new();
    for (reader, file, theirs) in readers {
        let name = name_of(&file);
        let ours = by_us(&file).expect("read");
        let found = match theirs {
            Ok(theirs) => differences(&ours, &theirs),
            Err(cause) => {
                aloud!("{reader} refuses {name} as we write it: {cause}");
                BTreeSet::from(["refused"])
            }
        };
        for what in found {
            let row = judged::WRITTEN.iter().find(|row| {
                (row.file == name || row.file == "*") && row.reader == reader && row.what == what
            });
            if row.is_none() {
                unjudged.push(format!("{name} as we write it, {reader}: {what}"));
            }
        }
    }
    assert_eq!(unjudged, Vec::<String>::new());
}
