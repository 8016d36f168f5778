//! The reference MCAP reader for Python (<https://pypi.org/project/mcap/>) opens our recordings
//! and finds in them what we put there.

mod aloud;
mod python;

use aloud::aloud;
use std::fs;
use std::path::Path;
use std::process::Command;

use gaitway::capture::{Captured, Fused, Order, Stamp};
use gaitway::device::sensor::SensorSample;
use gaitway::recording::{
    Compression, RecordedSource, Recorder, RunStart, SampleEncoding, SourceKind, SourceRecord,
    read, recover, recover_packed, summary,
};
use glam::{DQuat, DVec3};
use std::time::Duration;

#[path = "recording/scene.rs"]
mod scene;

use scene::{WALL_START_S, cycle, end, messages, start};

const SCRIPT: &str = r#"
import json, sys
from mcap.reader import make_reader
from mcap.records import Chunk
from mcap.stream_reader import StreamReader

path = sys.argv[1]
with open(path, "rb") as file:
    records = sum(1 for _ in StreamReader(file, validate_crcs=True).records)
with open(path, "rb") as file:
    chunks = StreamReader(file, emit_chunks=True).records
    packed = sorted({record.compression for record in chunks if isinstance(record, Chunk)})
with open(path, "rb") as file:
    reader = make_reader(file, validate_crcs=True)
    statistics = reader.get_summary().statistics
    found = {
        "records": records,
        "packed": packed,
        "message_count": statistics.message_count,
        "counts": {},
        "schemas": {},
        "first": {},
        "first_log_time": {},
        "metadata": {entry.name: entry.metadata for entry in reader.iter_metadata()},
    }
    for schema, channel, message in reader.iter_messages():
        topic = channel.topic
        found["counts"][topic] = found["counts"].get(topic, 0) + 1
        found["schemas"][topic] = schema.name
        found["first"].setdefault(topic, json.loads(message.data))
        found["first_log_time"].setdefault(topic, message.log_time)
print(json.dumps(found))
"#;

/// Writes the messages of a recording again, each chunk packed as it is told.
const REWRITE: &str = r#"
import sys
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

source, target, packing = sys.argv[1:]
with open(source, "rb") as file, open(target, "wb") as out:
    writer = Writer(out, chunk_size=20000, compression=CompressionType[packing])
    writer.start()
    schemas, channels = {}, {}
    for schema, channel, message in make_reader(file).iter_messages(log_time_order=False):
        if schema.id not in schemas:
            schemas[schema.id] = writer.register_schema(schema.name, schema.encoding, schema.data)
        if channel.id not in channels:
            channels[channel.id] = writer.register_channel(
                channel.topic, channel.message_encoding, schemas[schema.id], channel.metadata)
        writer.add_message(channels[channel.id], message.log_time, message.data,
                           message.publish_time, message.sequence)
    writer.finish()
"#;

#[test]
fn recordings_are_packed_so_that_the_reference_reader_unpacks_them_and_the_other_way_round() {
    let python = match python::python() {
        Ok(python) => python.program,
        Err(cause) => {
            aloud!("SKIPPED: no Python with the mcap package, nothing was compared: {cause}");
            return;
        }
    };
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("python-packed-recordings");
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).unwrap();
    let path = folder.join("trial.mcap");
    let recorder = Recorder::create(&path, false, start()).unwrap();
    (0..400).for_each(|n| recorder.take_patiently(cycle(n)));
    let stored = recorder.finish(end(400));
    let ours = read(&path).unwrap();
    let mut sizes = Vec::new();
    for packing in Compression::ALL {
        let packed = recover_packed(&path, None, true, packing).unwrap();
        assert_eq!(packed.messages, stored.messages);
        assert_eq!(read(&packed.path).unwrap().cycles, ours.cycles, "{packing}");
        let seen = seen_by(&python, &packed.path);
        assert_eq!(seen["message_count"], stored.messages, "{packing}");
        let name = if packing == Compression::None { "" } else { packing.word() };
        assert_eq!(seen["packed"], serde_json::json!([name]), "{packing}");
        sizes.push(fs::metadata(&packed.path).unwrap().len());

        let theirs = folder.join(format!("theirs-{packing}.mcap"));
        let mut rewrite = Command::new(&python);
        rewrite.args(["-c", REWRITE]).arg(&packed.path).arg(&theirs);
        let output = rewrite.arg(packing.word().to_uppercase()).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let again = read(&theirs).unwrap();
        assert_eq!(again.cycles, ours.cycles, "{packing}");
        assert_eq!((again.start, again.end), (ours.start.clone(), ours.end.clone()));
        let overview = summary(&theirs).unwrap();
        assert!(overview.finished && overview.lost_bytes == 0);
        assert_eq!(overview.channels.values().sum::<u64>(), stored.messages);
    }
    let [plain, lz4, zstd] = sizes[..] else { unreachable!() };
    aloud!("{plain} bytes plain, {lz4} in LZ4, {zstd} in Zstandard");
    assert!(lz4 * 2 < plain && zstd < lz4);
}

fn seen_by(python: &Path, recording: &Path) -> serde_json::Value {
    let output =
        Command::new(python).args(["-c", SCRIPT]).arg(recording).output().expect("it ran before");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

#[test]
fn the_reference_reader_finds_what_was_recorded() {
    let python = match python::python() {
        Ok(python) => python.program,
        Err(cause) => {
            aloud!("SKIPPED: no Python with the mcap package, nothing was compared: {cause}");
            return;
        }
    };
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("python-recordings");
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).unwrap();
    let path = folder.join("trial.mcap");
    let recorder = Recorder::create(&path, false, start()).unwrap();
    (0..60).for_each(|n| recorder.take_patiently(cycle(n)));
    let stored = recorder.finish(end(60));
    assert_eq!(stored.messages, (0..60).map(messages).sum::<u64>() + 2);

    let seen = seen_by(&python, &path);
    assert_eq!(seen["message_count"], stored.messages);
    let counts = serde_json::json!({
        "/run": 2, "/joints/goal": 60, "/joints/present": 60, "/cycle": 60, "/health": 15
    });
    assert_eq!(seen["counts"], counts);
    assert_eq!(seen["schemas"]["/joints/present"], "foxglove.JointStates");
    let present = &seen["first"]["/joints/present"];
    assert_eq!(present["joints"][0]["position"], -0.125);
    assert_eq!(present["joints"][1], serde_json::json!({ "name": "r_el" }));
    assert_eq!(seen["first"]["/health"]["joints"][0]["temperature_c"], 41.0);
    assert_eq!(seen["first_log_time"]["/cycle"], WALL_START_S * 1_000_000_000);
    assert_eq!(seen["metadata"]["gaitway.start"]["robot"], "op3");
    assert_eq!(seen["metadata"]["gaitway.end"]["outcome"], "done");

    let bytes = fs::read(&path).unwrap();
    fs::write(&path, &bytes[..bytes.len() - 200]).unwrap();
    let recovered = recover(&path, false).unwrap();
    let seen = seen_by(&python, &recovered.path);
    assert_eq!(seen["message_count"], recovered.messages);
    assert_eq!(seen["counts"], counts);
    assert_eq!(seen["metadata"]["gaitway.recovered"]["was_finished"], "false");
}

/// Decodes by the description in the file.
const DECODE: &str = r#"
import json, struct, sys
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

samples = []
with open(sys.argv[1], "rb") as file:
    reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
    for schema, channel, message, decoded in reader.iter_decoded_messages(["/imu/left/sample"]):
        def parts(name, of):
            value = getattr(decoded, name)
            return [struct.unpack("<I", struct.pack("<f", getattr(value, part)))[0] for part in of] if decoded.HasField(name) else None
        order = decoded.DESCRIPTOR.fields_by_name["order"].enum_type.values_by_number[decoded.order].name
        samples.append([decoded.timestamp.seconds * 10**9 + decoded.timestamp.nanos, decoded.number, order,
                        parts("angular_velocity", "xyz"), parts("orientation", "wz"), parts("fused", "wx"), decoded.settled,
                        decoded.device_ticks if decoded.HasField("device_ticks") else None])
print(json.dumps(samples))
"#;

#[test]
fn samples_in_few_bytes_are_decoded_by_others_from_what_the_file_says_of_them() {
    let python = match python::python() {
        Ok(python) => python.program,
        Err(cause) => {
            aloud!("SKIPPED: no Python with the mcap package, nothing was decoded: {cause}");
            return;
        }
    };
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("python-packed-samples");
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).unwrap();
    let path = folder.join("packed.mcap");
    let begun = RunStart { joints: Vec::new(), ..start() };
    let began = begun.monotonic_start;
    let recorder = Recorder::create_for_sources(&path, false, begun).unwrap();
    recorder.write_samples_as(SampleEncoding::Protobuf);
    let (name, metadata) = ("left".to_owned(), Default::default());
    let id = recorder.add_source(RecordedSource { name, metadata, kind: SourceKind::Imu });
    let rate = |n: u64| (!n.is_multiple_of(4)).then(|| DVec3::new(0.5 * n as f64, -0.25, 8.0));
    let fused = |n: u64| Fused {
        orientation: DQuat::from_rotation_x(0.2 * n as f64),
        settled: n > 20,
        bias_rad_s: DVec3::ZERO,
        bias_sigma_rad_s: 0.0,
        at_rest: false,
        magnetically_disturbed: true,
    };
    for n in 0..40_u64 {
        let at = began + Duration::from_millis(10 * n);
        let order = if n == 7 { Order::Reset } else { Order::Next };
        let stamp = Stamp {
            arrival: at,
            taken: at,
            number: n,
            step_s: 0.01,
            missed: 0,
            estimated: 0,
            order,
        };
        let sample = SensorSample {
            angular_rate_rad_s: rate(n),
            orientation: Some(DQuat::from_rotation_z(0.1 * n as f64)),
            ticks: (n > 3).then_some(n << 40),
            ..SensorSample::default()
        };
        let captured = Captured { stamp, sample, fused: (n > 9).then(|| fused(n)), stuck: false };
        recorder.take_record(id, SourceRecord::Sample(Box::new(captured)));
    }
    assert!(recorder.finish(end(1)).is_complete());

    let output = Command::new(&python).args(["-c", DECODE]).arg(&path).output().expect("it runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let seen: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let first_ns = seen[0][0].as_u64().unwrap();
    // Numbers have 24 bits in the file, and are told as those.
    let short = |value: f64| (value as f32).to_bits();
    for n in 0..40_u64 {
        let at_ns = first_ns + 10_000_000 * n;
        let order = if n == 7 { "RESET" } else { "NEXT" };
        let rate = rate(n).map(|rate| rate.to_array().map(short));
        let own = DQuat::from_rotation_z(0.1 * n as f64);
        let turned = (n > 9).then(|| fused(n).orientation).map(|of| [of.w, of.x].map(short));
        let ticks = (n > 3).then_some(n << 40);
        let own = [own.w, own.z].map(short);
        let wanted = serde_json::json!([at_ns, n, order, rate, own, turned, n > 20, ticks]);
        assert_eq!(seen[n as usize], wanted);
    }
}
