//! Recordings on a disk made of memory: what goes in comes out, and whatever the disk does, what
//! was stored before stays readable and nothing is made up.

use std::collections::{BTreeMap, BTreeSet};
use std::io;
use std::sync::mpsc::channel;
use std::time::Duration;

use gaitway::recording::{
    CycleRecord, JointRecord, Pace, RecordedJoint, Recorder, Recording, RunStart, Summary,
    joint_series,
};
use gaitway::time::Instant;
use proptest::collection::vec;
use proptest::prelude::*;
use proptest::sample::Index;

#[path = "recording/disk.rs"]
mod disk;
#[path = "recording/scene.rs"]
mod scene;

use disk::{GatedDisk, MemoryDisk, Stands};
use scene::{cycle, end, messages, start};

/// Each cycle is a chunk of its own, each chunk is synchronised.
const EACH_CYCLE: Pace = Pace { chunk: Duration::ZERO, sync: Duration::ZERO };

fn record(disk: &MemoryDisk, cycles: u64, pace: Pace) -> Summary {
    let recorder = Recorder::create_on(disk.clone(), start(), pace).unwrap();
    (0..cycles).for_each(|n| recorder.take_patiently(cycle(n)));
    recorder.finish(end(cycles))
}

fn given(cycles: u64) -> Vec<CycleRecord> {
    (0..cycles).map(cycle).collect()
}

#[test]
fn what_was_recorded_is_read_back_exactly() {
    let disk = MemoryDisk::default();
    let summary = record(&disk, 40, Pace::default());
    let recording = Recording::from_source(disk.bytes().as_slice()).unwrap();

    assert!(summary.is_complete());
    assert_eq!(summary.bytes, disk.bytes().len() as u64);
    assert_eq!(recording.cycles, given(40));
    assert_eq!(recording.start, Some(start()));
    assert_eq!(recording.end, Some(end(40)));
    assert_eq!(recording.joint_names, ["r_sho_pitch", "r_el"]);
    assert!(recording.finished);
    assert_eq!((recording.dropped_cycles, recording.lost_bytes), (0, 0));
}

#[test]
fn the_mcap_library_reads_every_message_with_its_checksums() {
    let disk = MemoryDisk::default();
    record(&disk, 40, EACH_CYCLE);
    let bytes = disk.bytes();

    let checked = mcap::read::Options::ValidateChunkCrcs.into();
    let stream = mcap::MessageStream::new_with_options(&bytes, checked).unwrap();
    let mut counts = BTreeMap::new();
    for message in stream {
        let message = message.unwrap();
        assert_eq!(message.channel.message_encoding, "json");
        *counts.entry(message.channel.topic.clone()).or_insert(0_u64) += 1;
    }
    let expected = [
        ("/cycle", 40),
        ("/health", 10),
        ("/joints/goal", 40),
        ("/joints/present", 40),
        ("/run", 2),
    ]
    .map(|(topic, count)| (topic.to_owned(), count));
    assert_eq!(counts, expected.into());

    let footer = mcap::Summary::read(&bytes).unwrap().unwrap();
    assert_eq!(footer.stats.unwrap().message_count, 40 * 3 + 10 + 2);
    assert_eq!(footer.metadata_indexes.len(), 2);
}

#[test]
fn every_schema_in_the_file_is_json() {
    let disk = MemoryDisk::default();
    record(&disk, 1, EACH_CYCLE);
    let footer = mcap::Summary::read(&disk.bytes()).unwrap().unwrap();
    assert_eq!(footer.schemas.len(), 4);
    for schema in footer.schemas.values() {
        let text: serde_json::Value = serde_json::from_slice(&schema.data).unwrap();
        assert_eq!(text["title"], schema.name.as_str());
        assert_eq!(schema.encoding, "jsonschema");
    }
}

#[test]
fn a_missed_read_has_no_value_and_every_message_names_every_joint() {
    let disk = MemoryDisk::default();
    record(&disk, 1, EACH_CYCLE);
    let bytes = disk.bytes();
    let mut by_topic = BTreeMap::new();
    for message in mcap::MessageStream::new(&bytes).unwrap().map(Result::unwrap) {
        let json: serde_json::Value = serde_json::from_slice(&message.data).unwrap();
        by_topic.entry(message.channel.topic.clone()).or_insert(json);
    }
    let present = &by_topic["/joints/present"]["joints"];
    assert_eq!(present[1], serde_json::json!({ "name": "r_el" }));
    assert_eq!(present[0]["position"], -0.125);
    let missed = serde_json::json!([{ "name": "r_el", "reason": "timed out" }]);
    assert_eq!(by_topic["/cycle"]["missed"], missed);
    assert_eq!(by_topic["/cycle"]["host_monotonic_ns"], 5_000_000_000_u64);
}

#[test]
fn a_value_that_json_cannot_hold_becomes_a_gap_with_a_reason() {
    let disk = MemoryDisk::default();
    let recorder = Recorder::create_on(disk.clone(), start(), EACH_CYCLE).unwrap();
    let mut record = cycle(1);
    record.joints[0].present_position_rad = Some(f64::NAN);
    recorder.take_patiently(record);
    assert!(recorder.finish(end(1)).is_complete());

    let recording = Recording::from_source(disk.bytes().as_slice()).unwrap();
    let joint = &recording.cycles[0].joints[0];
    assert_eq!(joint.present_position_rad, None);
    assert_eq!(joint.missed.as_deref(), Some("not a finite number"));
}

#[test]
fn log_times_follow_the_monotonic_clock_alone() {
    // The wall clock of this machine is years away from the scene's: it is not consulted.
    let disk = MemoryDisk::default();
    record(&disk, 30, EACH_CYCLE);
    let bytes = disk.bytes();
    for message in mcap::MessageStream::new(&bytes).unwrap().map(Result::unwrap) {
        let json: serde_json::Value = serde_json::from_slice(&message.data).unwrap();
        let Some(n) = json["cycle"].as_u64() else { continue };
        let expected = scene::WALL_START_S * 1_000_000_000 + n * 10_000_000;
        assert_eq!((message.log_time, message.publish_time), (expected, expected));
        assert_eq!(json["timestamp"]["sec"], expected / 1_000_000_000);
        assert_eq!(json["timestamp"]["nsec"], expected % 1_000_000_000);
    }
}

#[test]
fn two_cycles_in_one_nanosecond_stay_two_in_their_order() {
    let disk = MemoryDisk::default();
    let recorder = Recorder::create_on(disk.clone(), start(), Pace::default()).unwrap();
    let twins = [cycle(1), CycleRecord { at: cycle(1).at, ..cycle(2) }];
    twins.iter().for_each(|twin| recorder.take_patiently(twin.clone()));
    assert!(recorder.finish(end(2)).is_complete());
    let recording = Recording::from_source(disk.bytes().as_slice()).unwrap();
    assert_eq!(recording.cycles, twins);
    assert_eq!(joint_series(&recording).times_s, [0.0], "a motion's times rise strictly");
}

#[test]
fn recorded_goals_come_back_as_a_motion() {
    let disk = MemoryDisk::default();
    let recorder = Recorder::create_on(disk.clone(), start(), Pace::default()).unwrap();
    for n in 10..14 {
        let mut record = cycle(n);
        if n == 12 {
            record.joints[0].goal_rad = None;
        }
        recorder.take_patiently(record);
    }
    assert!(recorder.finish(end(14)).is_complete());
    let series = joint_series(&Recording::from_source(disk.bytes().as_slice()).unwrap());
    let goal = |n: u64| n as f64 / 1024.0;
    assert_eq!(series.joint_names, ["r_sho_pitch", "r_el"]);
    assert_eq!(series.times_s, [0.0, 0.010, 0.030]);
    let rows = [10, 11, 13].map(|n| vec![goal(n), -goal(n)]);
    assert_eq!(series.positions_rad, rows);
}

#[test]
fn a_file_cut_at_any_byte_gives_every_closed_chunk_and_nothing_else() {
    let disk = MemoryDisk::default();
    record(&disk, 12, EACH_CYCLE);
    let bytes = disk.bytes();
    // Appends: the start of the run, one per cycle, the end of the run, the summary.
    let lengths = disk.lengths();
    assert_eq!(lengths.len(), 1 + 12 + 1 + 1);
    for cut in mcap::MAGIC.len()..bytes.len() {
        let recording = Recording::from_source(&bytes[..cut]).unwrap();
        let closed = lengths[1..13].iter().filter(|&&length| length <= cut).count();
        let read = recording.cycles.len();
        // A chunk is whole a little before its append is: its index follows it.
        assert!(read == closed || read == closed + 1, "cut at {cut}: {closed} closed, {read} read");
        assert_eq!(recording.cycles, given(read as u64));
        assert!(!recording.finished);
    }
}

#[test]
fn a_changed_bit_anywhere_never_changes_a_recorded_value() {
    let disk = MemoryDisk::default();
    record(&disk, 6, EACH_CYCLE);
    let bytes = disk.bytes();
    for position in mcap::MAGIC.len()..bytes.len() {
        let mut damaged = bytes.clone();
        damaged[position] ^= 1 << (position % 8);
        let Ok(recording) = Recording::from_source(damaged.as_slice()) else { continue };
        for record in recording.cycles {
            assert_eq!(record, cycle(record.cycle), "bit changed in byte {position}");
        }
    }
}

#[test]
fn a_sector_of_zeros_costs_its_own_chunks_at_most_those_behind_it() {
    let disk = MemoryDisk::default();
    record(&disk, 20, EACH_CYCLE);
    let bytes = disk.bytes();
    let lengths = disk.lengths();
    for sector in (512..bytes.len()).step_by(512) {
        let mut torn = bytes.clone();
        let end = torn.len().min(sector + 512);
        torn[sector..end].fill(0);
        let recording = Recording::from_source(torn.as_slice()).unwrap();
        let before = lengths[1..21].iter().filter(|&&length| length <= sector).count();
        if lengths[0] <= sector {
            assert!(recording.cycles.len() >= before, "sector at {sector}");
        }
        for record in recording.cycles {
            assert_eq!(record, cycle(record.cycle), "sector at {sector}");
        }
    }
}

#[test]
fn a_chunk_with_a_wrong_checksum_is_left_out_and_the_next_ones_are_read() {
    let disk = MemoryDisk::default();
    record(&disk, 12, EACH_CYCLE);
    let mut bytes = disk.bytes();
    let lengths = disk.lengths();
    // Just before the end of the sixth cycle's chunk: inside its last message.
    bytes[lengths[6] - 20] ^= 0x01;
    let recording = Recording::from_source(bytes.as_slice()).unwrap();
    let expected: Vec<_> = (0..12).filter(|&n| n != 5).map(cycle).collect();
    assert_eq!(recording.cycles, expected);
    assert!(recording.finished);
    assert!(recording.lost_bytes > 0);
}

#[test]
fn a_disk_that_fails_at_any_call_keeps_what_was_stored_and_every_message_is_counted() {
    let cycles = 10;
    let total = (0..cycles).map(messages).sum::<u64>() + 2;
    let mut call = 1;
    loop {
        let disk = MemoryDisk::failing_at(call);
        let Ok(recorder) = Recorder::create_on(disk.clone(), start(), EACH_CYCLE) else {
            assert!(call <= 2, "only the first append and its synchronising can refuse the start");
            call += 1;
            continue;
        };
        (0..cycles).for_each(|n| recorder.take_patiently(cycle(n)));
        let summary = recorder.finish(end(cycles));
        assert_eq!(summary.messages + summary.lost, total, "call {call}");
        assert!(summary.dropped.is_empty());

        let recording = Recording::from_source(disk.bytes().as_slice()).unwrap();
        assert_eq!(recording.cycles, given(recording.cycles.len() as u64));
        let read = (0..recording.cycles.len() as u64).map(messages).sum::<u64>();
        assert!(read + 2 >= summary.messages, "call {call}: less in the file than was promised");
        if summary.poisoned.is_none() {
            assert_eq!(summary.lost, 0);
            break;
        }
        assert!(!summary.is_complete());
        call += 1;
    }
    // Start, ten cycles and end with two calls each, but the end is synchronised with the summary.
    assert_eq!(call, 2 * (1 + cycles) + 3 + 1);
}

#[test]
fn a_disk_that_is_full_after_any_byte_holds_just_the_messages_that_were_counted_as_stored() {
    let cycles = 6;
    let total = (0..cycles).map(messages).sum::<u64>() + 2;
    let whole = MemoryDisk::default();
    record(&whole, cycles, EACH_CYCLE);
    let (first, all) = (whole.lengths()[0], whole.bytes().len());
    let mut seen = BTreeSet::new();
    for room in (first..all).step_by(29) {
        let disk = MemoryDisk::with_room_for(room);
        let summary = record(&disk, cycles, EACH_CYCLE);
        assert_eq!(summary.messages + summary.lost, total, "{room} bytes");
        let recording = Recording::from_source(disk.bytes().as_slice()).unwrap();
        let of_cycles = (0..recording.cycles.len() as u64).map(messages).sum::<u64>();
        let of_run = u64::from(recording.start.is_some()) + u64::from(recording.end.is_some());
        assert_eq!(of_cycles + of_run, summary.messages, "{room} bytes");
        seen.insert(recording.cycles.len());
    }
    assert_eq!(seen, (0..=6).collect(), "full in each cycle, and after the last");
}

#[test]
fn every_message_is_counted_whenever_a_disk_fails_that_is_not_waited_for() {
    let cycles = 10;
    let total = (0..cycles).map(messages).sum::<u64>() + 2;
    let soon = Pace { chunk: Duration::ZERO, sync: Duration::from_nanos(1) };
    let mut failed = 0;
    // As many calls as there are at most: how many synchronisations fall together is not known.
    for call in 3..=2 * (1 + cycles) + 4 {
        let disk = MemoryDisk::failing_at(call);
        let recorder = Recorder::create_on(disk.clone(), start(), soon).unwrap();
        (0..cycles).for_each(|n| recorder.take_patiently(cycle(n)));
        let summary = recorder.finish(end(cycles));
        assert_eq!(summary.messages + summary.lost, total, "call {call}");
        assert_eq!(summary.poisoned.is_some(), disk.calls() >= call, "call {call}");
        let recording = Recording::from_source(disk.bytes().as_slice()).unwrap();
        let read = (0..recording.cycles.len() as u64).map(messages).sum::<u64>();
        assert!(read + 2 >= summary.messages, "call {call}: less in the file than was promised");
        failed += u64::from(summary.poisoned.is_some());
    }
    assert!(failed > cycles, "{failed} failures");
}

/// Waits for what another thread does; false if that does not come.
fn comes(mut is_so: impl FnMut() -> bool) -> bool {
    let patience = std::time::Instant::now() + Duration::from_secs(20);
    while !is_so() && std::time::Instant::now() < patience {
        std::thread::sleep(Duration::from_millis(1));
    }
    is_so()
}

#[test]
fn a_disk_that_takes_its_time_to_synchronise_holds_up_nothing_that_is_appended() {
    let (gate, closed) = channel();
    let disk = MemoryDisk::default();
    // The start is synchronised; the next time takes as long as the gate stands.
    let gated = GatedDisk::new(disk.clone(), closed, 1, Stands::Syncs);
    let soon = Pace { chunk: Duration::ZERO, sync: Duration::from_nanos(1) };
    let recorder = Recorder::create_on(gated, start(), soon).unwrap();
    // Less than the queue holds: whoever waited for the disk would not wait here.
    (0..200).for_each(|n| recorder.take(cycle(n)));
    let kept = || Recording::from_source(disk.bytes().as_slice()).unwrap().cycles.len();
    let all_are_in_the_file = comes(|| kept() == 200);
    // Whatever came of it: the thread that waits for the disk must end.
    drop(gate);
    let summary = recorder.finish(end(200));
    assert!(all_are_in_the_file);
    assert!(summary.is_complete(), "{summary:?}");
}

#[test]
fn after_a_failure_nothing_more_is_written() {
    let disk = MemoryDisk::failing_at(7);
    let summary = record(&disk, 50, EACH_CYCLE);
    assert_eq!(disk.calls(), 7);
    assert_eq!(summary.poisoned.as_deref(), Some("no space left"));
}

#[test]
fn a_disk_that_stands_still_never_holds_up_the_cycle_and_the_gap_is_marked() {
    let (gate, closed) = channel();
    let disk = MemoryDisk::default();
    let gated = GatedDisk::new(disk.clone(), closed, 2, Stands::Both);
    let recorder = Recorder::create_on(gated, start(), EACH_CYCLE).unwrap();
    // If `take` waited for the disk, this loop would never end.
    (0..2_000).for_each(|n| recorder.take(cycle(n)));
    drop(gate);
    let summary = recorder.finish(end(2_000));

    let dropped = summary.dropped["/cycle"];
    // 256 wait in the queue and one is being written.
    assert!((2_000 - 257..=2_000 - 256).contains(&dropped), "{dropped} dropped");
    assert_eq!(summary.dropped["/joints/present"], dropped);
    assert!(summary.dropped["/health"] < dropped);
    assert_eq!(summary.lost, 0);
    assert!(!summary.is_complete());

    let recording = Recording::from_source(disk.bytes().as_slice()).unwrap();
    assert_eq!(recording.dropped_cycles, dropped);
    assert_eq!(recording.cycles.len() as u64 + dropped, 2_000);
}

#[test]
fn the_first_cycle_after_a_gap_says_how_many_are_missing() {
    let disk = MemoryDisk::default();
    let recorder = Recorder::create_on(disk.clone(), start(), EACH_CYCLE).unwrap();
    recorder.take_patiently(cycle(0));
    // A record that does not fit the run's joints is refused like one that finds no room.
    let misfit = CycleRecord { joints: vec![JointRecord::default()], ..cycle(1) };
    recorder.take(misfit.clone());
    recorder.take(misfit);
    recorder.take_patiently(cycle(3));
    let summary = recorder.finish(end(4));
    assert_eq!(summary.dropped["/cycle"], 2);

    let bytes = disk.bytes();
    let gaps: Vec<_> = mcap::MessageStream::new(&bytes)
        .unwrap()
        .map(Result::unwrap)
        .filter(|message| message.channel.topic == "/cycle")
        .map(|message| serde_json::from_slice::<serde_json::Value>(&message.data).unwrap())
        .map(|json| json["dropped_before"].as_u64().unwrap())
        .collect();
    assert_eq!(gaps, [0, 2]);
}

#[test]
fn a_recorder_that_is_only_dropped_leaves_all_it_took_in_an_unfinished_file() {
    let disk = MemoryDisk::default();
    let recorder = Recorder::create_on(disk.clone(), start(), Pace::default()).unwrap();
    (0..20).for_each(|n| recorder.take_patiently(cycle(n)));
    drop(recorder);
    let recording = Recording::from_source(disk.bytes().as_slice()).unwrap();
    assert_eq!(recording.cycles, given(20));
    assert!(!recording.finished);
    assert_eq!(recording.end, None);
}

#[test]
fn a_file_that_claims_more_joints_than_it_has_values_for_is_refused() {
    let joint = |n: u32| RecordedJoint { name: n.to_string(), ..RecordedJoint::default() };
    let start = RunStart { joints: (0..512).map(joint).collect(), ..start() };
    let disk = MemoryDisk::default();
    drop(Recorder::create_on(disk.clone(), start, EACH_CYCLE).unwrap());

    // Ten thousand tiny cycle messages would become 10,000 x 512 joint records.
    let mut file =
        mcap::WriteOptions::new().compression(None).create(io::Cursor::new(Vec::new())).unwrap();
    let mut ids = [0; 2];
    for (topic, id) in ["/run", "/cycle"].iter().zip(&mut ids) {
        *id = file.add_channel(0, topic, "json", &BTreeMap::new()).unwrap();
    }
    let mut write = |channel_id, json: &[u8]| {
        let header =
            mcap::records::MessageHeader { channel_id, sequence: 0, log_time: 0, publish_time: 0 };
        file.write_to_known_channel(&header, json).unwrap();
    };
    let bytes = disk.bytes();
    let stream = mcap::read::Options::IgnoreEndMagic.into();
    let run = mcap::MessageStream::new_with_options(&bytes, stream).unwrap().next().unwrap();
    write(ids[0], &run.unwrap().data);
    for n in 0..10_000 {
        let json = format!(
            r#"{{"timestamp":{{"sec":0,"nsec":0}},"cycle":{n},"host_monotonic_ns":{n},"missed":[]}}"#
        );
        write(ids[1], json.as_bytes());
    }
    file.finish().unwrap();
    let bytes = file.into_inner().into_inner();
    let error = Recording::from_source(bytes.as_slice()).unwrap_err();
    assert!(error.what.contains("more joints than it has values for"), "{error}");
}

#[test]
fn what_is_no_recording_is_refused_with_a_word() {
    for bytes in [&b""[..], b"HIERARCHY\nROOT Hips\n", &mcap::MAGIC[..7]] {
        let error = Recording::from_source(bytes).unwrap_err();
        assert!(error.what.contains("not an MCAP recording"), "{error}");
    }
}

#[test]
fn the_time_of_a_record_before_the_start_is_before_the_start() {
    let second = Duration::from_secs(1);
    let wall_ns = scene::WALL_START_S * 1_000_000_000;
    let early = Instant::from_nanos(scene::MONOTONIC_START.as_nanos() - 1_000_000_000);
    assert_eq!(start().wall_nanos(early), wall_ns - 1_000_000_000);
    assert_eq!(start().wall_nanos(scene::MONOTONIC_START + second), wall_ns + 1_000_000_000);
}

proptest! {
    /// Records that are framed well and filled badly reach deeper than plain noise does.
    #[test]
    fn no_bytes_make_the_reader_panic(
        records in vec((0_u8..=16, vec(any::<u8>(), 0..80), -2_i64..3), 0..20),
        cut in any::<Index>(),
    ) {
        let mut bytes = mcap::MAGIC.to_vec();
        for (opcode, body, lie) in records {
            bytes.push(opcode);
            bytes.extend((body.len() as i64 + lie).to_le_bytes());
            bytes.extend(body);
        }
        let _ = Recording::from_source(&bytes[..cut.index(bytes.len()) + 1]);
    }

    #[test]
    fn no_message_makes_the_reader_panic(
        topic in prop::sample::select(vec!["/run", "/cycle", "/health", "/joints/goal"]),
        json in "[\\[\\]{}:,\"a-z0-9_-]{0,60}",
    ) {
        let mut file = mcap::WriteOptions::new()
            .compression(None)
            .create(io::Cursor::new(Vec::new()))
            .unwrap();
        let channel_id = file.add_channel(0, topic, "json", &BTreeMap::new()).unwrap();
        let header =
            mcap::records::MessageHeader { channel_id, sequence: 0, log_time: 0, publish_time: 0 };
        file.write_to_known_channel(&header, json.as_bytes()).unwrap();
        file.finish().unwrap();
        let bytes = file.into_inner().into_inner();
        let recording = Recording::from_source(bytes.as_slice()).unwrap();
        prop_assert_eq!(recording.lost_bytes, json.len() as u64);
    }
}

#[test]
fn a_message_that_says_two_things_of_one_joint_is_malformed_and_no_value_of_either() {
    let mut file =
        mcap::WriteOptions::new().compression(None).create(io::Cursor::new(Vec::new())).unwrap();
    let goal = file.add_channel(0, "/joints/goal", "json", &BTreeMap::new()).unwrap();
    let said = [
        (0, r#"[{"name":"a","position":0.1},{"name":"b","position":0.2}]"#),
        (1, r#"[{"name":"a","position":0.3},{"name":"a","position":0.4}]"#),
        (2, r#"[{"name":"b","position":0.5}]"#),
    ];
    for (n, joints) in said {
        let json = format!(
            r#"{{"timestamp":{{"sec":0,"nsec":0}},"cycle":{n},"host_monotonic_ns":{n},"joints":{joints}}}"#
        );
        let header = mcap::records::MessageHeader {
            channel_id: goal,
            sequence: 0,
            log_time: 0,
            publish_time: 0,
        };
        file.write_to_known_channel(&header, json.as_bytes()).unwrap();
    }
    file.finish().unwrap();
    let bytes = file.into_inner().into_inner();
    let recording = Recording::from_source(bytes.as_slice()).unwrap();
    let goals: Vec<Vec<Option<f64>>> = recording
        .cycles
        .iter()
        .map(|cycle| cycle.joints.iter().map(|joint| joint.goal_rad).collect())
        .collect();
    assert_eq!(goals, [vec![Some(0.1), Some(0.2)], vec![None, Some(0.5)]]);
    assert!(recording.lost_bytes > 0, "it is counted");
}
