//! Recordings of sensors and lines on disks made of memory: a disk that fails, fills up or stands
//! still costs what it must, is counted by topic and source, and holds up nobody.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::mpsc::channel;
use std::time::{Duration, Instant as Clock, UNIX_EPOCH};

use gaitway::capture::{Captured, Fused, Order, Stamp};
use gaitway::device::sensor::SensorSample;
use gaitway::recording::{
    Overview, Pace, RecordedSource, Recorder, ReplayedSample, RunEnd, RunStart, SampleEncoding,
    SourceId, SourceKind, SourceRecord, read_orientations, recover, sensor_series, summary,
    write_csv,
};
use gaitway::time::Instant;
use glam::{DQuat, DVec3};

#[path = "recording/disk.rs"]
mod disk;

use disk::{GatedDisk, MemoryDisk, Stands};

const MONOTONIC_START: Instant = Instant::from_nanos(5_000_000_000);

const EACH_RECORD: Pace = Pace { chunk: Duration::ZERO, sync: Duration::ZERO };
/// Records that wait for the disk: those of 15 sensors at 200 Hz for 2.7 s.
const QUEUE: u64 = 8192;

fn start() -> RunStart {
    RunStart {
        robot: String::new(),
        motion: "squat".into(),
        joints: Vec::new(),
        wall_clock_start: UNIX_EPOCH + Duration::from_secs(1_704_164_645),
        monotonic_start: MONOTONIC_START,
        gaitway_version: "0.1.0".into(),
        metadata: BTreeMap::new(),
    }
}

fn end(number: u64) -> RunEnd {
    let (outcome, metadata) = ("done".into(), BTreeMap::new());
    RunEnd { outcome, stop_reason: None, at: at(number), metadata }
}

fn at(number: u64) -> Instant {
    MONOTONIC_START + Duration::from_millis(5 * number)
}

/// Sample `number` of a 200 Hz sensor that knows its own orientation: two messages.
fn sample(number: u64, missed: u64) -> SourceRecord {
    let order = if missed == 0 { Order::Next } else { Order::Gap };
    let (arrival, taken) = (at(number), at(number));
    SourceRecord::Sample(Box::new(Captured {
        stamp: Stamp { arrival, taken, number, step_s: 0.005, missed, estimated: 0, order },
        sample: SensorSample {
            acceleration_m_s2: Some(DVec3::new(number as f64, 0.5, 9.75)),
            orientation: Some(DQuat::IDENTITY),
            ticks: Some(number * 5000),
            ..SensorSample::default()
        },
        fused: None,
        stuck: false,
    }))
}

fn line(number: u64) -> SourceRecord {
    SourceRecord::Line(at(number), format!("line {number}"))
}

fn source(name: &str, kind: SourceKind) -> RecordedSource {
    RecordedSource { name: name.to_owned(), metadata: BTreeMap::new(), kind }
}

fn recorder(disk: impl gaitway::recording::Disk, pace: Pace) -> Recorder {
    Recorder::create_for_sources_on(disk, start(), pace).unwrap()
}

fn file(name: &str, bytes: &[u8]) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("recording-sensors");
    std::fs::create_dir_all(&folder).unwrap();
    let path = folder.join(format!("{name}.mcap"));
    std::fs::write(&path, bytes).unwrap();
    path
}

fn overview(name: &str, bytes: &[u8]) -> Overview {
    summary(&file(name, bytes)).unwrap()
}

/// Two sensors and lines, `count` of each in turn.
fn record_three(recorder: &Recorder, count: u64) -> [SourceId; 3] {
    let ids = [("left", SourceKind::Imu), ("right", SourceKind::Imu), ("notes", SourceKind::Lines)]
        .map(|(name, kind)| recorder.add_source(source(name, kind)));
    for number in 0..count {
        recorder.take_record(ids[0], sample(number, 0));
        recorder.take_record(ids[1], sample(number, 0));
        recorder.take_record(ids[2], line(number));
    }
    ids
}

#[test]
fn what_each_source_sent_is_told_by_source() {
    let disk = MemoryDisk::default();
    let recorder = recorder(disk.clone(), Pace::default());
    let ids = record_three(&recorder, 100);
    // The left one loses two samples on its line, then goes on.
    recorder.take_record(ids[0], sample(102, 2));
    assert!(recorder.finish(end(110)).is_complete());

    let found = overview("told", &disk.bytes());
    let [left, right, notes] = ["left", "right", "notes"].map(|name| &found.sources[name]);
    assert_eq!((left.records, left.gaps, left.missed), (101, 1, 2));
    assert_eq!((right.records, right.gaps, right.missed), (100, 0, 0));
    assert_eq!((notes.records, notes.gaps), (100, 0));
    assert!((left.duration_s - 0.51).abs() < 1e-9 && (right.duration_s - 0.495).abs() < 1e-9);
    assert_eq!((found.missed_samples, found.damaged_samples, found.dropped_samples), (2, 0, 0));
    assert!(found.finished);
}

/// Sample `number` of a sensor that says all there is to be said, fused, and not always as it should.
fn full(number: u64) -> SourceRecord {
    let order =
        [Order::Next, Order::Gap, Order::Reset, Order::Doubted][(number % 97).min(3) as usize];
    let turn = 0.01 * number as f64;
    let wave = |phase: f64| (turn + phase).sin();
    let missed = if order == Order::Gap { 3 } else { 0 };
    let (arrival, taken) = (at(number), at(number));
    SourceRecord::Sample(Box::new(Captured {
        stamp: Stamp { arrival, taken, number, step_s: 0.005, missed, estimated: 0, order },
        sample: SensorSample {
            acceleration_m_s2: Some(DVec3::new(wave(0.0), wave(1.0), 9.81)),
            linear_acceleration_m_s2: Some(DVec3::new(wave(2.0), wave(3.0), 0.01)),
            angular_rate_rad_s: (!number.is_multiple_of(5))
                .then(|| DVec3::new(wave(4.0), 0.0, -wave(5.0))),
            magnetic_field_t: Some(DVec3::new(2e-5, wave(6.0) * 1e-5, 4e-5)),
            orientation: Some(DQuat::from_rotation_z(turn)),
            temperature_c: number.is_multiple_of(3).then_some(31.25),
            counter: Some(number % 256),
            ticks: Some(number * 5000),
            implausible: number.is_multiple_of(40),
        },
        fused: Some(Fused {
            orientation: DQuat::from_rotation_x(turn),
            settled: number > 20,
            bias_rad_s: DVec3::new(1e-3, -2e-3, 3e-3),
            bias_sigma_rad_s: 1e-4,
            at_rest: number.is_multiple_of(2),
            magnetically_disturbed: true,
        }),
        stuck: false,
    }))
}

/// How far two readings are apart: at most half a step of 24 bits of the greatest part.
fn is_as_said(text: Option<DVec3>, packed: Option<DVec3>) -> bool {
    match (text, packed) {
        (Some(text), Some(packed)) => {
            (text - packed).abs().max_element() <= text.abs().max_element() * 6e-8
        }
        (text, packed) => text == packed,
    }
}

/// So is a rotation, whose parts are at most one.
fn is_turned_as_said(text: Option<DQuat>, packed: Option<DQuat>) -> bool {
    match (text, packed) {
        (Some(text), Some(packed)) => (text - packed).length() < 1.2e-7,
        (text, packed) => text == packed,
    }
}

#[test]
fn samples_in_few_bytes_say_what_they_say_as_text() {
    let [text, packed] = [SampleEncoding::Json, SampleEncoding::Protobuf].map(|encoding| {
        let disk = MemoryDisk::default();
        let recorder = recorder(disk.clone(), Pace::default());
        recorder.write_samples_as(encoding);
        let ids = ["left", "right"].map(|name| recorder.add_source(source(name, SourceKind::Imu)));
        for number in 0..2000 {
            ids.iter().for_each(|id| recorder.take_record(*id, full(number)));
        }
        assert!(recorder.finish(end(2000)).is_complete());
        disk.bytes()
    });
    println!("{} bytes as text, {} as protobuf", text.len(), packed.len());
    assert!(packed.len() * 2 < text.len(), "{} {}", packed.len(), text.len());

    let files = [file("as-text", &text), file("packed", &packed)];
    let [a, b] = files.each_ref().map(|path| summary(path).unwrap());
    assert_eq!(a.sources, b.sources);
    assert_eq!(b.channels["/imu/left/sample"], 2000);
    assert!(!b.channels.contains_key("/imu/left/orientation"), "it is in the sample");
    assert!(a.sources["left"].resets > 0 && a.sources["left"].doubted > 0 && a.missed_samples > 0);
    let [a, b] = files.each_ref().map(|path| sensor_series(path).unwrap());
    assert_eq!((a.missed, a.first_ns, a.last_ns), (b.missed, b.first_ns, b.last_ns));
    for (a, b) in a.sensors["right"].iter().zip(&b.sensors["right"]) {
        assert_eq!((a.taken_ns, a.orientation.is_some()), (b.taken_ns, b.orientation.is_some()));
        assert!(is_turned_as_said(a.orientation, b.orientation), "{a:?} {b:?}");
        assert!(is_as_said(a.rate_rad_s, b.rate_rad_s), "{a:?} {b:?}");
        assert!(is_as_said(a.acceleration_m_s2, b.acceleration_m_s2), "{a:?} {b:?}");
        assert!(is_as_said(a.field_t, b.field_t), "{a:?} {b:?}");
    }
    assert_eq!((a.sensors["right"].len(), b.sensors["right"].len()), (2000, 2000));
    let [a, b] = files.each_ref().map(|path| read_orientations(path).unwrap());
    assert_eq!(a.len(), b.len());
    for (a, b) in a.iter().zip(&b) {
        assert!(is_turned_as_said(a.orientation, b.orientation), "{a:?} {b:?}");
        assert!(is_as_said(a.acceleration_m_s2, b.acceleration_m_s2), "{a:?} {b:?}");
        let plain = |of: &ReplayedSample| ReplayedSample {
            orientation: None,
            acceleration_m_s2: None,
            ..of.clone()
        };
        assert_eq!(plain(a), plain(b));
    }

    // As tables, cell by cell.
    let [a, b] = files.each_ref().map(|path| {
        let mut table = Vec::new();
        write_csv(path, &mut table).unwrap();
        String::from_utf8(table).unwrap()
    });
    assert_eq!((a.lines().count(), a.lines().next()), (b.lines().count(), b.lines().next()));
    for (a, b) in a.lines().zip(b.lines()).skip(1) {
        for (a, b) in a.split(',').zip(b.split(',')) {
            let is_near = || Some((a.parse::<f64>().ok()? - b.parse::<f64>().ok()?).abs() <= 1e-6);
            assert!(a == b || is_near() == Some(true), "{a} {b}");
        }
    }
}

#[test]
fn a_packed_recording_that_is_cut_off_is_read_and_recovered_as_any() {
    let disk = MemoryDisk::default();
    let recorder = recorder(disk.clone(), EACH_RECORD);
    recorder.write_samples_as(SampleEncoding::Protobuf);
    let id = recorder.add_source(source("left", SourceKind::Imu));
    (0..200).for_each(|number| recorder.take_record(id, full(number)));
    assert!(recorder.finish(end(200)).is_complete());
    let whole = disk.bytes();
    let (mut most, mut least) = (0, 200);
    for share in 1..10 {
        let cut = file("packed-cut", &whole[..whole.len() * share / 10]);
        let read = sensor_series(&cut).unwrap();
        let count = read.sensors.get("left").map_or(0, Vec::len);
        assert!(count >= most && !read.whole, "{share}");
        (most, least) = (count, least.min(count));
        let recovered = recover(&cut, true).unwrap();
        let again = sensor_series(&recovered.path).unwrap();
        assert_eq!(again.sensors.get("left").map_or(0, Vec::len), count);
    }
    assert!(most >= 100 && least < 50, "{least} {most}");
}

#[test]
fn counts_that_a_file_makes_too_large_are_as_large_as_can_be() {
    let disk = MemoryDisk::default();
    let recorder = recorder(disk.clone(), EACH_RECORD);
    let source = recorder.add_source(source("thigh", SourceKind::Imu));
    for number in 0..3 {
        recorder.take_record(source, sample(number, u64::MAX));
    }
    assert!(recorder.finish(end(3)).is_complete());
    let path = file("counts", &disk.bytes());
    let rows = write_csv(&path, &mut std::io::sink()).expect("a table");
    assert_eq!((rows.rows, rows.missing), (3, u64::MAX));
    assert_eq!(sensor_series(&path).expect("sensors").missed, u64::MAX);
    assert_eq!(summary(&path).expect("an overview").missed_samples, u64::MAX);
}

#[test]
fn a_cut_anywhere_leaves_every_closed_chunk_of_every_sensor() {
    let disk = MemoryDisk::default();
    let recorder = recorder(disk.clone(), EACH_RECORD);
    record_three(&recorder, 8);
    assert!(recorder.finish(end(10)).is_complete());
    let (bytes, lengths) = (disk.bytes(), disk.lengths());
    // Appends: the start, one per record, the end, the summary.
    assert_eq!(lengths.len(), 1 + 24 + 1 + 1);
    for cut in (lengths[0]..bytes.len()).step_by(53) {
        let found = overview("cut", &bytes[..cut]);
        let closed = lengths[1..25].iter().filter(|&&length| length <= cut).count() as u64;
        let records = found.sources.values().map(|source| source.records).sum::<u64>();
        // A chunk is whole a little before its append is: its index follows it.
        assert!(records == closed || records == closed + 1, "cut at {cut}: {closed}, {records}");
        assert!(!found.finished && found.damaged_samples == 0);
        assert!(found.sources.values().all(|source| source.gaps == 0));
    }
}

#[test]
fn samples_in_a_broken_chunk_are_counted_and_said_by_the_rescue() {
    let disk = MemoryDisk::default();
    let recorder = recorder(disk.clone(), EACH_RECORD);
    record_three(&recorder, 20);
    assert!(recorder.finish(end(20)).is_complete());
    let (mut bytes, lengths) = (disk.bytes(), disk.lengths());
    // The chunks of the left sensor's samples 4, 5 and 9 and of the right one's 7; 100 bytes into a
    // chunk is inside a message.
    for append in [1 + 3 * 4, 1 + 3 * 5, 1 + 3 * 9, 1 + 3 * 7 + 1] {
        bytes[lengths[append - 1] + 100] ^= 0x10;
    }
    let found = overview("broken", &bytes);
    let [left, right] = ["left", "right"].map(|name| &found.sources[name]);
    assert_eq!((left.records, left.damaged, left.gaps), (17, 3, 2));
    assert_eq!((right.records, right.damaged, right.gaps), (19, 1, 1));
    assert_eq!((found.damaged_samples, found.finished), (4, true));

    let path = file("rescued", &bytes);
    let recovered = recover(&path, true).unwrap();
    assert_eq!((recovered.damaged, recovered.was_finished), (4, true));
    assert!(recovered.lost_bytes > 0);
    let rescued = summary(&recovered.path).unwrap();
    assert_eq!(rescued.sources, found.sources, "the gaps stay gaps");
}

#[test]
fn a_disk_that_fails_at_any_call_keeps_what_was_stored_and_every_message_is_counted() {
    // Ten of each: two messages a sample, one a line, and the start and the end.
    let total = 10 * (2 + 2 + 1) + 2;
    let mut call = 3;
    loop {
        let disk = MemoryDisk::failing_at(call);
        let recorder = recorder(disk.clone(), EACH_RECORD);
        record_three(&recorder, 10);
        let summary = recorder.finish(end(10));
        assert_eq!(summary.messages + summary.lost, total, "call {call}");
        assert!(summary.dropped.is_empty());
        let found = overview("failing", &disk.bytes());
        let read: u64 = found.channels.values().sum();
        // A failed synchronisation may have kept the message it was for, and the end of the run.
        assert!(read + 1 >= summary.messages, "call {call}: less in the file than was promised");
        assert!(found.sources.values().all(|source| source.gaps == 0), "call {call}");
        if summary.poisoned.is_none() {
            break;
        }
        assert!(!summary.is_complete());
        call += 1;
    }
    assert!(call > 60, "every append and synchronisation failed once: {call}");
}

/// As a disk is, of which somebody else took the rest: full between a chunk and its index, too.
#[test]
fn a_disk_that_is_full_after_any_byte_holds_just_the_messages_that_were_counted_as_stored() {
    let whole = MemoryDisk::default();
    let recording = recorder(whole.clone(), EACH_RECORD);
    record_three(&recording, 3);
    assert!(recording.finish(end(3)).is_complete());
    let (first, all) = (whole.lengths()[0], whole.bytes().len());
    for room in (first..all).step_by(61) {
        let disk = MemoryDisk::with_room_for(room);
        let recording = recorder(disk.clone(), EACH_RECORD);
        record_three(&recording, 3);
        let summary = recording.finish(end(3));
        let read: u64 = overview("full", &disk.bytes()).channels.values().sum();
        assert_eq!(read, summary.messages, "{room} bytes");
        assert_eq!(summary.messages + summary.lost, 3 * 5 + 2, "{room} bytes");
    }
}

#[test]
fn a_full_disk_is_said_at_once_and_not_at_the_end() {
    let disk = MemoryDisk::failing_at(5);
    let recorder = recorder(disk, EACH_RECORD);
    assert_eq!(recorder.failure(), None);
    let id = recorder.add_source(source("left", SourceKind::Imu));
    let patience = Clock::now() + Duration::from_secs(30);
    let mut number = 0;
    while recorder.failure().is_none() {
        assert!(Clock::now() < patience, "the failure is never said");
        recorder.take_record(id, sample(number, 0));
        number += 1;
        std::thread::yield_now();
    }
    assert_eq!(recorder.failure(), Some("no space left"));
    let summary = recorder.finish(end(number));
    assert_eq!(summary.poisoned.as_deref(), Some("no space left"));
    let dropped: u64 = summary.dropped.values().sum();
    assert_eq!(summary.messages + summary.lost + dropped, 2 * number + 2);
}

#[test]
fn a_synchronisation_that_takes_two_seconds_loses_nothing_of_fifteen_sensors() {
    let (gate, closed) = channel();
    let disk = MemoryDisk::default();
    // The start is appended and synchronised, the first chunk appended; then the disk stands still.
    let gated = GatedDisk::new(disk.clone(), closed, 3, Stands::Both);
    let recorder = recorder(gated, EACH_RECORD);
    let ids: Vec<_> = (0..15)
        .map(|n| recorder.add_source(source(&format!("imu-{n}"), SourceKind::Imu)))
        .collect();
    for number in 0..2 * 200 {
        ids.iter().for_each(|id| recorder.take_record(*id, sample(number, 0)));
    }
    drop(gate);
    let summary = recorder.finish(end(400));
    assert!(summary.is_complete(), "{:?}", summary.dropped);
    let found = overview("slow", &disk.bytes());
    assert!(found.sources.values().all(|source| (source.records, source.gaps) == (400, 0)));
    assert_eq!(found.sources.len(), 15);
}

#[test]
fn samples_are_in_the_file_though_the_disk_takes_its_time_to_synchronise() {
    let (gate, closed) = channel();
    let disk = MemoryDisk::default();
    // Already the start is synchronised for as long as the gate stands.
    let gated = GatedDisk::new(disk.clone(), closed, 0, Stands::Syncs);
    let soon = Pace { chunk: Duration::ZERO, sync: Duration::from_nanos(1) };
    let recorder = recorder(gated, soon);
    let left = recorder.add_source(source("left", SourceKind::Imu));
    (0..300).for_each(|number| recorder.take_record(left, sample(number, 0)));
    let patience = Clock::now() + Duration::from_secs(20);
    let kept = || overview("slow-sync", &disk.bytes()).sources.get("left").map_or(0, |s| s.records);
    while kept() < 300 && Clock::now() < patience {
        std::thread::sleep(Duration::from_millis(5));
    }
    let samples = kept();
    // Whatever came of it: the thread that waits for the disk must end.
    drop(gate);
    assert!(recorder.finish(end(300)).is_complete());
    assert_eq!(samples, 300);
}

/// A disk that takes one piece at a time, when it is allowed to: after nobody waits any more it is given one piece, and no other.
#[test]
fn who_ends_a_recording_does_not_wait_for_all_that_a_slow_disk_has_not_taken_and_it_is_counted() {
    let (allow, gate) = channel();
    let disk = MemoryDisk::default();
    // The beginning of the file is taken at once.
    let slow = GatedDisk::new(disk.clone(), gate, 1, Stands::Appends);
    let each = Pace { chunk: Duration::ZERO, sync: Duration::from_secs(1) };
    let recorder = recorder(slow, each);
    let imu = recorder.add_source(source("left", SourceKind::Imu));
    const GIVEN: u64 = 100;
    (0..GIVEN).for_each(|number| recorder.take_record(imu, sample(number, 0)));
    let summary = std::thread::scope(|scope| {
        scope.spawn(|| {
            // So that it has been asked to end by then.
            std::thread::sleep(Duration::from_secs(2));
            // Once it has ended nobody takes any more.
            for _ in 0..GIVEN + 10 {
                let _ = allow.send(());
            }
        });
        recorder.finish_within(end(GIVEN), Duration::ZERO)
    });
    assert!(disk.lengths().len() <= 2, "{:?}", disk.lengths());
    assert!(summary.poisoned.as_ref().is_some_and(|why| why.contains("too slow")), "{summary:?}");
    // Two messages of each sample, and the end of the run.
    assert_eq!(summary.messages + summary.lost, 1 + 2 * GIVEN + 1, "{summary:?}");
    assert!(summary.lost >= 2 * GIVEN - 2, "{summary:?}");
    // What there is can be read.
    let series = sensor_series(&file("slow.mcap", &disk.bytes())).expect("a recording");
    assert!(!series.whole);
}

#[test]
fn a_disk_that_stands_still_holds_up_no_sensor_and_what_is_dropped_is_counted_by_topic() {
    let (gate, closed) = channel();
    let disk = MemoryDisk::default();
    let gated = GatedDisk::new(disk.clone(), closed, 2, Stands::Both);
    let recorder = recorder(gated, EACH_RECORD);
    // If `take_record` or `add_source` waited for the disk, this would never end.
    let left = recorder.add_source(source("left", SourceKind::Imu));
    let count = QUEUE + 500;
    (0..count).for_each(|number| recorder.take_record(left, sample(number, 0)));
    let notes = recorder.add_source(source("notes", SourceKind::Lines));
    (0..7).for_each(|number| recorder.take_record(notes, line(number)));

    let dropped = recorder.dropped()["/imu/left/sample"];
    // The queue is full and one record is being written.
    assert!((499..=500).contains(&dropped), "{dropped} dropped");
    drop(gate);
    let summary = recorder.finish(end(count));
    assert_eq!(summary.dropped["/imu/left/sample"], dropped);
    assert_eq!(summary.dropped["/imu/left/orientation"], dropped);
    assert_eq!(summary.dropped["/lines/notes"], 7);
    assert_eq!((summary.lost, summary.dropped.len()), (0, 3));
    assert!(!summary.is_complete());

    let found = overview("still", &disk.bytes());
    let (left, notes) = (&found.sources["left"], &found.sources["notes"]);
    assert_eq!(left.records + dropped, count);
    // Nothing came after the gap, so the end of the run tells of it.
    assert_eq!((left.dropped, left.gaps, left.damaged), (dropped, 1, 0));
    assert_eq!((notes.records, notes.dropped), (0, 7));
    assert_eq!(found.dropped_samples, dropped + 7);
}

#[test]
fn the_first_sample_after_a_gap_says_how_many_were_dropped() {
    let (gate, closed) = channel();
    let disk = MemoryDisk::default();
    let gated = GatedDisk::new(disk.clone(), closed, 2, Stands::Both);
    let recorder = recorder(gated, EACH_RECORD);
    let left = recorder.add_source(source("left", SourceKind::Imu));
    (0..QUEUE + 100).for_each(|number| recorder.take_record(left, sample(number, 0)));
    let dropped = recorder.dropped()["/imu/left/sample"];
    drop(gate);
    // Once there is room again, the next one is taken.
    let patience = Clock::now() + Duration::from_secs(30);
    while disk.calls() < 2000 {
        assert!(Clock::now() < patience, "the disk stands still");
        std::thread::sleep(Duration::from_millis(1));
    }
    recorder.take_record(left, sample(QUEUE + 100, 0));
    let summary = recorder.finish(end(QUEUE + 100));
    assert_eq!(summary.dropped["/imu/left/sample"], dropped);

    let bytes = disk.bytes();
    let gaps: Vec<u64> = mcap::MessageStream::new(&bytes)
        .unwrap()
        .map(Result::unwrap)
        .filter(|message| message.channel.topic == "/imu/left/sample")
        .map(|message| serde_json::from_slice::<serde_json::Value>(&message.data).unwrap())
        .filter_map(|json| json["dropped_before"].as_u64().filter(|&count| count > 0))
        .collect();
    assert_eq!(gaps, [dropped]);
    let left = &overview("after", &bytes).sources["left"];
    assert_eq!((left.dropped, left.gaps, left.damaged), (dropped, 1, 0));
}
