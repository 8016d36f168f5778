//! The C3D reader and writer on files made by hand: what is read, what is made of files that break the book,
//! what is refused, and that nothing else ever happens.

use crate::c3d_made::{Machine, Made, Values, usual_point};
use gaitway::error::Error;
use gaitway::mocap::c3d::{self, Reader};
use gaitway::mocap::markers::{Frame, Frames, FramesOf, Markers, PlateKind};

fn read(made: &Made) -> Markers {
    c3d::parse(&made.bytes()).expect("a file that is read")
}

/// Fails unless the points and counts are those that the file was made of.
fn holds(markers: &Markers, made: &Made) {
    let head = markers.head();
    assert_eq!((head.points.len(), head.frames), (made.points, made.frames));
    assert_eq!(
        (head.analog.channels.len(), head.analog.per_frame),
        (made.channels, made.per_frame)
    );
    for frame in 0..made.frames {
        for point in 0..made.points {
            let [x, y, z, word] = (made.point)(frame, point);
            let sample = markers.sample(frame, point);
            assert_eq!(sample.is_some(), word >= 0, "frame {frame}, point {point}");
            let Some(sample) = sample else { continue };
            let position = [x, y, z].map(|count| f32::from(count) * made.scale);
            assert_eq!(sample.position, position, "frame {frame}, point {point}");
            assert_eq!(sample.residual, f32::from(word as u8) * made.scale);
            assert_eq!(i16::from(sample.cameras), word >> 8);
        }
        let counts = made.channels * made.per_frame;
        let expected = (0..counts).map(|at| f32::from((made.analog)(frame * counts + at)));
        assert!(markers.analog_counts(frame).iter().copied().eq(expected), "frame {frame}");
    }
}

#[test]
fn every_machine_and_kind_of_number_is_read_with_residuals_cameras_and_analog_counts() {
    for machine in Machine::ALL {
        for real in [true, false] {
            for per_frame in [1, 7, 10] {
                let made = Made { machine, real, ..Made::new(5, 40, 3, per_frame) };
                let markers = read(&made);
                holds(&markers, &made);
                let head = markers.head();
                assert_eq!(head.rate_hz, Some(100.0));
                assert_eq!(head.analog.rate_hz, Some(100.0 * per_frame as f64));
                assert_eq!((head.unit.as_str(), head.metres_per_unit()), ("mm", Some(0.001)));
                // (count - OFFSET) * SCALE * GEN_SCALE.
                assert_eq!(head.analog.channels[0].value(100.0), (100.0 - 12.0) * 0.25 * 0.5);
            }
        }
    }
}

#[test]
fn a_file_of_more_than_65535_frames_has_them_all_wherever_it_says_how_many() {
    let long = || Made { point: |_, _| [1, 2, 3, 0], ..Made::new(1, 70_000, 0, 0) };
    let mut trial = long();
    // 70,000 = 0x11170: the last frame in two words, the lower first.
    trial.set("TRIAL", "ACTUAL_START_FIELD", &[2], Values::Ints(vec![1, 0]));
    trial.set("TRIAL", "ACTUAL_END_FIELD", &[2], Values::Ints(vec![0x1170, 1]));
    let mut counted = long();
    counted.set("POINT", "LONG_FRAMES", &[], Values::Floats(vec![70_000.0]));
    let mut real = long();
    real.set("POINT", "FRAMES", &[], Values::Floats(vec![70_000.0]));
    for made in [trial, counted, real] {
        let markers = read(&made);
        assert_eq!(markers.head().frames, 70_000, "{:?}", markers.head().notes);
        assert!(markers.sample(69_999, 0).is_some());
        let mut bytes = Vec::new();
        c3d::write::write(&mut bytes, &mut FramesOf::new(&markers)).expect("written");
        let reader = Reader::new(bytes.as_slice(), bytes.len() as u64).expect("read");
        assert_eq!((reader.head().frames, reader.findings()), (70_000, Vec::new()));
        assert_eq!(reader.head().notes, Vec::<String>::new());
    }
    // Nothing but the length of the file says more than that there are 65,535 at least.
    let frames = read(&long()).head().frames;
    assert!((70_000..70_032).contains(&frames), "{frames}: to the end of the last block");
}

#[test]
fn numbers_of_the_wrong_type_missing_parameters_and_double_names_are_read_and_said() {
    let usual = || Made::new(4, 30, 2, 3);
    let mut real = usual();
    real.set("POINT", "FRAMES", &[], Values::Floats(vec![30.0]));
    real.set("ANALOG", "OFFSET", &[2], Values::Floats(vec![12.0, 12.0]));
    holds(&read(&real), &real);
    let mut byte = usual();
    byte.set("POINT", "USED", &[], Values::Bytes(vec![4]));
    holds(&read(&byte), &byte);
    for (group, name, said) in [
        ("POINT", "RATE", "POINT:RATE"),
        ("POINT", "UNITS", "POINT:UNITS"),
        ("ANALOG", "RATE", "ANALOG:RATE"),
    ] {
        let mut made = usual();
        made.without(group, name);
        let markers = read(&made);
        holds(&markers, &made);
        assert_eq!(markers.head().rate_hz, Some(100.0), "{name}");
        assert_eq!(markers.head().analog.rate_hz, Some(300.0), "{name}");
        let notes = &markers.head().notes;
        assert!(notes.iter().any(|note| note.contains(said)), "{name}: {notes:?}");
    }
    let mut no_rate = Made { rate_hz: 0.0, ..Made::new(4, 30, 0, 0) };
    no_rate.without("POINT", "RATE");
    no_rate.without("ANALOG", "RATE");
    assert_eq!(read(&no_rate).head().rate_hz, None);
    let mut double = usual();
    double.parameters.push(("POINT", "RATE", vec![], Values::Floats(vec![250.0])));
    let markers = read(&double);
    assert_eq!(markers.head().rate_hz, Some(100.0), "the first one counts");
    assert!(
        markers.head().notes.iter().any(|note| note.contains("POINT:RATE comes a second time"))
    );
}

#[test]
fn labels_are_those_of_all_lists_and_points_without_one_have_a_number() {
    let mut made = Made::new(4, 3, 0, 0);
    made.set("POINT", "LABELS", &[4, 2], Values::Text(vec!["LASI", "RASI"]));
    made.set("POINT", "LABELS2", &[4, 1], Values::Text(vec!["C7"]));
    let labels = |made: &Made| -> Vec<String> {
        read(made).head().points.iter().map(|point| point.label.clone()).collect()
    };
    assert_eq!(labels(&made), ["LASI", "RASI", "C7", "point 4"]);
    made.set("POINT", "LABELS", &[2, 6], Values::Text(vec!["a", "b", "c", "d", "e", "f"]));
    assert_eq!(labels(&made), ["a", "b", "c", "d"]);
    let notes = read(&made).head().notes.join("\n");
    assert!(notes.contains("7 labels for 4 points: the last 3 name none"), "{notes}");
}

#[test]
fn where_header_and_parameters_disagree_the_length_of_the_file_decides() {
    // Words of the header: 2 points, 3 analog counts, 5 last frame, 9 block of the data.
    for (word, lie) in [(2, 9), (2, 0), (3, 0), (3, 77), (5, 39), (5, 2), (9, 2), (9, 200), (10, 0)]
    {
        let made = Made { header: vec![(word, lie)], ..Made::new(4, 300, 2, 5) };
        let markers = read(&made);
        holds(&markers, &made);
    }
    for (name, lie) in [("USED", 3), ("FRAMES", 299), ("FRAMES", 310), ("DATA_START", 3)] {
        let mut made = Made::new(40, 300, 2, 5);
        made.set("POINT", name, &[], Values::Ints(vec![lie]));
        let markers = read(&made);
        holds(&markers, &made);
        let notes = &markers.head().notes;
        assert!(!notes.is_empty(), "{name} says {lie}, and nobody is told");
    }
}

#[test]
fn a_sample_is_missing_by_its_sign_and_all_bits_set_mean_no_residual() {
    // Real files hold the fourth word as a number: 65535 is not negative.
    let mut bytes = Made { point: |_, _| [10, 20, 30, 0x0102], ..Made::new(3, 1, 0, 0) }.bytes();
    let data = bytes.len() - 512;
    bytes[data + 12..data + 16].copy_from_slice(&65_535_f32.to_le_bytes());
    bytes[data + 16..data + 32].fill(0);
    bytes[data + 28..data + 32].copy_from_slice(&65_535_f32.to_le_bytes());
    let markers = c3d::parse(&bytes).expect("read");
    let seen = markers.sample(0, 0).expect("it was somewhere");
    assert_eq!((seen.residual, seen.cameras), (0.0, 0));
    assert_eq!(markers.sample(0, 1), None, "at the origin");
    assert_eq!(markers.sample(0, 2).expect("seen").cameras, 1);
    assert!(markers.head().notes.iter().any(|note| note.contains("residual unknown")));
    // What is no number was not seen, whatever its word says.
    bytes[data..data + 4].copy_from_slice(&f32::NAN.to_le_bytes());
    let markers = c3d::parse(&bytes).expect("read");
    assert_eq!(markers.sample(0, 0), None);
    let notes = markers.head().notes.join("\n");
    let (first, name) = (markers.head().first_frame, &markers.head().points[0].label);
    let told = format!(
        "1 sample is no finite number, though marked as seen: taken as not seen; the first is in frame {first}, of {name}"
    );
    assert!(notes.contains(&told), "{notes}");
}

#[test]
fn unsigned_counts_and_offsets_are_unsigned() {
    let mut made = Made { real: false, analog: |_| -2, ..Made::new(1, 2, 1, 1) };
    made.set("ANALOG", "FORMAT", &[8], Values::Text(vec!["UNSIGNED"]));
    made.set("ANALOG", "OFFSET", &[1], Values::Ints(vec![0x9000]));
    let markers = read(&made);
    assert_eq!(markers.analog_counts(0), [65_534.0]);
    assert_eq!(markers.head().analog.channels[0].offset, f64::from(0x9000));
}

#[test]
fn events_come_from_their_group_or_else_from_the_header() {
    let mut made = Made::new(2, 10, 0, 0);
    // Words 150 and 151: four letters, two events. 153 on: times; 199 on: labels.
    let [lower, upper] = [1.5_f32, 2.25].map(|time| time.to_bits());
    made.header = vec![(150, 12_345), (151, 2)];
    made.header.extend([(153, lower as u16), (154, (lower >> 16) as u16)]);
    made.header.extend([(155, upper as u16), (156, (upper >> 16) as u16)]);
    made.header.extend([(199, 0x4852), (200, 0x2053), (201, 0x484c), (202, 0x2053)]);
    let events = |made: &Made| -> Vec<(f64, String, String)> {
        let markers = read(made);
        let events = markers.head().events.iter();
        events.map(|event| (event.time_s, event.label.clone(), event.context.clone())).collect()
    };
    let plain =
        |time_s: f64, label: &str, context: &str| (time_s, label.to_owned(), context.to_owned());
    assert_eq!(events(&made), [plain(1.5, "RHS", ""), plain(2.25, "LHS", "")]);
    made.set("EVENT", "USED", &[], Values::Ints(vec![2]));
    made.set("EVENT", "TIMES", &[2, 2], Values::Floats(vec![0.0, 1.5, 1.0, 0.25]));
    made.set("EVENT", "LABELS", &[11, 2], Values::Text(vec!["Foot Strike", "Foot Off"]));
    // As some programs write it: without contexts, which ours adds.
    let expected = [plain(1.5, "Foot Strike", ""), plain(60.25, "Foot Off", "")];
    assert_eq!(events(&made), expected);
    let mut bytes = Vec::new();
    c3d::write::write(&mut bytes, &mut FramesOf::new(&read(&made))).expect("written");
    let again = c3d::parse(&bytes).expect("read");
    let contexts = again.head().parameters.get("EVENT", "CONTEXTS").expect("added").texts();
    assert_eq!(contexts, ["General", "General"]);
    assert_eq!(again.head().events[1].time_s, 60.25);
}

#[test]
fn force_plates_of_every_type_have_their_channels_corners_and_calibration() {
    let mut made = Made::new(1, 2, 26, 1);
    made.set("FORCE_PLATFORM", "USED", &[], Values::Ints(vec![4]));
    made.set("FORCE_PLATFORM", "TYPE", &[4], Values::Ints(vec![1, 2, 3, 4]));
    let corners: Vec<f32> = (0..48_u8).map(f32::from).collect();
    made.set("FORCE_PLATFORM", "CORNERS", &[3, 4, 4], Values::Floats(corners));
    made.set("FORCE_PLATFORM", "ORIGIN", &[3, 4], Values::Floats(vec![-1.0; 12]));
    // Eight rows, because of type 3; the last plate has a wire that does not exist.
    let wires = |from: i32, count: i32| (0..8).map(move |n| if n < count { from + n } else { 0 });
    let mut channels: Vec<i32> = wires(1, 6).chain(wires(7, 6)).collect();
    channels.extend(wires(13, 8).chain(wires(21, 6)));
    channels[29] = 99;
    made.set("FORCE_PLATFORM", "CHANNEL", &[8, 4], Values::Ints(channels));
    let matrix: Vec<f32> = (0..144_u8).map(f32::from).collect();
    made.set("FORCE_PLATFORM", "CAL_MATRIX", &[6, 6, 4], Values::Floats(matrix));
    let markers = read(&made);
    let plates = &markers.head().plates;
    use PlateKind::{Calibrated, CentreOfPressure, ForcesMoments, Posts};
    let kinds: Vec<PlateKind> = plates.iter().map(|plate| plate.kind).collect();
    assert_eq!(kinds, [CentreOfPressure, ForcesMoments, Posts, Calibrated]);
    assert_eq!(plates[1].channels, (6..12).map(Some).collect::<Vec<_>>());
    assert_eq!(plates[2].channels.len(), 8);
    assert_eq!(plates[3].channels[5], None);
    assert_eq!(plates[1].corners[0], [12.0, 13.0, 14.0]);
    assert_eq!((plates[3].calibration[0], plates[3].calibration.len()), (108.0, 36));
    let notes = markers.head().notes.join("\n");
    assert!(notes.contains("force plate 4: 5 of its 6 channels"), "{notes}");
}

#[test]
fn more_points_than_a_list_can_name_are_written_in_several_and_read_again() {
    let made = Made { point: usual_point, ..Made::new(600, 3, 0, 0) };
    let markers = read(&made);
    let mut bytes = Vec::new();
    c3d::write::write(&mut bytes, &mut FramesOf::new(&markers)).expect("written");
    let again = c3d::parse(&bytes).expect("read");
    assert_eq!(again.head().points, markers.head().points);
    assert!(again.head().parameters.get("POINT", "LABELS3").is_some());
    holds(&again, &made);
}

#[test]
fn a_list_where_the_place_of_the_data_should_stand_does_not_move_the_data() {
    // Made up by a fuzzer: POINT:DATA_START is a list of 127 numbers, which is one number once it is written.
    let mut bytes = vec![0; 1072];
    let parts: [(usize, &[u8]); 4] = [
        (0, b"\x02P\x01\x00\x02\x00\x01\x00\x02\x00\x00\x00\x00\xc0\x00\x00\x03\x00\x02\x00HC"),
        (432, b"\xd0"),
        (512, b"\x01P\x01U\x05\xffPOINT\x03\x00\x00\x04\x01USED\x07\x00\x02\x00\x01\x00\x00\x06\x01FRAMES\x07\x00\x02\x00\x02\x00\x00\x0a\x01DATA_START\x07\x00\x02\x01\x7f\x00\x00\x05\x01SCALE\x09\x00\x04\x00\x00\xc0\x00\x00\x00\x04\x01RATE\x09\x00\x04\x00HC\x00\x00\x00\x05\x01UNITS\x08\x00\xff\x01\x02mm\x00\x06\x01LABELS\x09\x00\xff\x02\x02\x01C7\x00\x06\xfeANALOG\x03\x00\x00\x04\x02USED\x07\x00\x02\x00\x01\x00\x00\x06\x02OFFSET\x08\x00\x02\x01\x01\x03\x00\x00\x05\x02SCALE\x0a\x00\x04\x01\x05\x01A\x00\xfd\x00\x00\x00EVENT\x03\x00\x00\x04\x03USED\x07\x00\x02\x00\x01\x00\x00\x05\x03*IMES\x0f\x00\x04\x02\x02\x01\x00\x00\x00\x00\x80@\x00\x00\x00\x0e\xfcFORCE_PLATFORM\x03\x00\x00\x04\x04USED\x07\x00\x02\x00\x01\x00\x00\x04\x04TYPE\x08\x00\x02\x01\x01\x04\x00\x00\x05\xfbTRIAL\x03\x00\x00\x10\x05ACTUAL_END_FIELD\x0a\x00\x02\x01\x02\x02"),
        (1024, b"\x80@\x00\x00\x00A\x00\x00@A\x00\x00\x81D\x00\x00\x80A\x00\x00\xa0A\x00\x00\x80@\x00\x00\x00A\x00\x00@A\x00\x00\x81D\x00\x00\x80A\x00\x00\xa0A"),
    ];
    for (at, part) in parts {
        bytes[at..at + part.len()].copy_from_slice(part);
    }
    let markers = c3d::parse(&bytes).expect("read");
    let mut written = Vec::new();
    c3d::write::write(&mut written, &mut FramesOf::new(&markers)).expect("written");
    let again = c3d::parse(&written).expect("what was written");
    assert_eq!(again.head().frames, markers.head().frames);
    for frame in 0..markers.head().frames {
        let of = |markers: &Markers| markers.sample(frame, 0).map(|sample| sample.position);
        assert_eq!(of(&again), of(&markers));
    }
}

#[test]
fn a_file_that_is_cut_off_keeps_its_whole_frames_and_says_what_is_lost() {
    let made = Made::new(10, 100, 0, 0);
    let bytes = made.bytes();
    // 10 points of 16 bytes: 40 frames and a piece.
    let start = bytes.len() - (100 * 160_usize).div_ceil(512) * 512;
    let markers = c3d::parse(&bytes[..start + 40 * 160 + 7]).expect("read");
    assert_eq!((markers.head().frames, markers.head().lost_frames), (40, 60));
    let notes = markers.head().notes.join("\n");
    for said in [
        "100 frames are claimed, 16000 bytes",
        "6407 bytes are there",
        "40 whole frames",
        "7 bytes",
    ] {
        assert!(notes.contains(said), "{said}: {notes}");
    }
    let refused = |bytes: &[u8]| -> Error { c3d::parse(bytes).expect_err("nothing is left") };
    let none = refused(&bytes[..start + 100]).to_string();
    assert!(
        none.contains("100 bytes from there on") && none.contains("100 frames of 160 bytes"),
        "{none}"
    );
    assert!(refused(&[]).to_string().contains("0 bytes in all"));
    assert!(refused(b"OpenSim").to_string().contains("not a C3D file"));
    let no_parameters = refused(&bytes[..600]).to_string();
    assert!(no_parameters.contains("600"), "{no_parameters}");
}

#[test]
fn a_file_without_frames_is_read_and_written_as_one() {
    let mut made = Made { header: vec![(5, 0)], ..Made::new(3, 0, 2, 2) };
    made.first = 1;
    let markers = read(&made);
    assert_eq!((markers.head().frames, markers.head().points.len()), (0, 3));
    let mut bytes = Vec::new();
    c3d::write::write(&mut bytes, &mut FramesOf::new(&markers)).expect("written");
    let again = c3d::parse(&bytes).expect("what was written");
    assert_eq!((again.head().frames, again.head().points.len()), (0, 3));
}

/// Reads any bytes to the end. What is read never is more than the file can hold.
fn survives(bytes: &[u8]) -> bool {
    let Ok(mut reader) = Reader::new(bytes, bytes.len() as u64) else { return false };
    let head = reader.head().clone();
    let per_frame = 4 * head.points.len() + head.analog.counts_per_frame();
    assert!(head.frames * per_frame * 2 <= bytes.len(), "{} frames of {per_frame}", head.frames);
    let _ = reader.findings();
    let (mut frame, mut frames) = (Frame::default(), 0);
    while reader.next_frame(&mut frame).expect("a frame that was told of") {
        assert_eq!(frame.points.len(), head.points.len());
        assert_eq!(frame.analog.len(), head.analog.counts_per_frame());
        assert!(
            frame
                .points
                .iter()
                .flatten()
                .all(|sample| sample.position.iter().all(|n| n.is_finite()))
        );
        frames += 1;
    }
    assert_eq!(frames, head.frames);
    let markers = c3d::parse(bytes).expect("as before");
    let mut written = Vec::new();
    if c3d::write::write(&mut written, &mut FramesOf::new(&markers)).is_ok() {
        let again = c3d::parse(&written).expect("what was written");
        assert_eq!(again.head().frames, markers.head().frames);
        assert_eq!(again.head().points.len(), markers.head().points.len());
        for frame in 0..markers.head().frames {
            for point in 0..markers.head().points.len() {
                let (a, b) = (markers.sample(frame, point), again.sample(frame, point));
                assert_eq!(a.map(|a| a.position), b.map(|b| b.position));
            }
        }
    }
    true
}

/// Files of all kinds, small enough to be broken in every place.
fn samples() -> Vec<Vec<u8>> {
    let mut files = Vec::new();
    for machine in Machine::ALL {
        for real in [true, false] {
            let mut made = Made { machine, real, ..Made::new(3, 8, 2, 2) };
            made.set("POINT", "LABELS", &[3, 3], Values::Text(vec!["a", "b", "c"]));
            made.set("EVENT", "USED", &[], Values::Ints(vec![1]));
            made.set("EVENT", "TIMES", &[2, 1], Values::Floats(vec![0.0, 0.5]));
            made.set("FORCE_PLATFORM", "USED", &[], Values::Ints(vec![1]));
            made.set("FORCE_PLATFORM", "TYPE", &[1], Values::Ints(vec![2]));
            made.set("FORCE_PLATFORM", "CHANNEL", &[6, 1], Values::Ints(vec![1, 2, 1, 2, 1, 2]));
            made.set("TRIAL", "ACTUAL_START_FIELD", &[2], Values::Ints(vec![1, 0]));
            made.set("TRIAL", "ACTUAL_END_FIELD", &[2], Values::Ints(vec![8, 0]));
            files.push(made.bytes());
        }
    }
    files
}

#[test]
fn no_truncation_flipped_byte_or_lie_breaks_the_reader() {
    for whole in samples() {
        assert!(survives(&whole));
        for length in (0..whole.len()).step_by(64).chain(500..530) {
            survives(&whole[..length.min(whole.len())]);
        }
        // Every byte of header and parameters, made every kind of number; and of the data a part.
        let mut read = 0;
        for at in 0..whole.len().min(2600) {
            // Of what is empty every fourth byte will do.
            if whole[at] == 0 && at % 4 != 0 {
                continue;
            }
            for with in [0x00, 0x01, 0x7f, 0x80, 0xff] {
                let mut broken = whole.clone();
                broken[at] = with;
                read += usize::from(survives(&broken));
            }
            let mut broken = whole.clone();
            broken[at] ^= 0x55;
            if let Some(next) = broken.get_mut(at + 1) {
                *next ^= 0xff;
            }
            survives(&broken);
        }
        assert!(read > 1000, "of the broken files {read} can be read at all");
    }
}

#[test]
fn every_count_may_lie_by_any_amount() {
    let lies = [0, 1, 2, 255, 256, 32_767, 32_768, 65_535];
    for word in [1, 2, 3, 4, 5, 7, 8, 9, 10, 11, 12, 150, 151] {
        for lie in lies {
            survives(&Made { header: vec![(word, lie)], ..Made::new(3, 8, 2, 2) }.bytes());
        }
    }
    for (group, name) in [
        ("POINT", "USED"),
        ("POINT", "FRAMES"),
        ("POINT", "DATA_START"),
        ("POINT", "SCALE"),
        ("ANALOG", "USED"),
        ("ANALOG", "RATE"),
        ("EVENT", "USED"),
        ("FORCE_PLATFORM", "USED"),
    ] {
        for lie in lies {
            let floats = [f32::from(lie), -f32::from(lie), f32::NAN, f32::INFINITY, 1e38];
            let floats = floats.map(|float| Values::Floats(vec![float]));
            for values in floats.into_iter().chain([Values::Ints(vec![lie.into()])]) {
                let mut made = Made::new(3, 8, 2, 2);
                made.set(group, name, &[], values);
                survives(&made.bytes());
            }
        }
    }
}
