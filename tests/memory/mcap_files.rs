//! MCAP files written by hand from the format's description (<https://mcap.dev/spec>), so that they
//! can say what no writer would.

use crate::readers::Files;

const MAGIC: &[u8] = b"\x89MCAP0\r\n";
const HEADER: u8 = 1;
const SCHEMA: u8 = 3;
const CHANNEL: u8 = 4;
const MESSAGE: u8 = 5;
const CHUNK: u8 = 6;
const METADATA: u8 = 12;
/// More than any machine that runs this has in one piece, and what fits four bytes.
const HUGE: u32 = 0x7FFF_FFF0;

fn sized(bytes: &[u8]) -> Vec<u8> {
    let mut out = (bytes.len() as u32).to_le_bytes().to_vec();
    out.extend(bytes);
    out
}

fn record(opcode: u8, body: &[u8]) -> Vec<u8> {
    let mut out = vec![opcode];
    out.extend((body.len() as u64).to_le_bytes());
    out.extend(body);
    out
}

fn file(records: &[Vec<u8>]) -> Vec<u8> {
    let mut out = MAGIC.to_vec();
    out.extend(record(HEADER, &[sized(b""), sized(b"")].concat()));
    out.extend(records.concat());
    out
}

fn schema(id: u16, name: &str, text: &[u8]) -> Vec<u8> {
    let fields =
        [id.to_le_bytes().to_vec(), sized(name.as_bytes()), sized(b"jsonschema"), sized(text)];
    record(SCHEMA, &fields.concat())
}

fn map(entries: impl IntoIterator<Item = (String, String)>) -> Vec<u8> {
    let entry =
        |(key, value): (String, String)| [sized(key.as_bytes()), sized(value.as_bytes())].concat();
    sized(&entries.into_iter().flat_map(entry).collect::<Vec<u8>>())
}

/// So many different entries of a map, each as short as can be.
fn entries(count: usize) -> impl Iterator<Item = (String, String)> {
    (0..count).map(|n| (short(n), String::new()))
}

/// A short name for a number: letters of base 64, so that it is text in JSON too.
fn short(mut number: usize) -> String {
    const LETTERS: &[u8; 64] = b"abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789-_";
    let mut name = String::new();
    loop {
        name.push(char::from(LETTERS[number % 64]));
        number /= 64;
        if number == 0 {
            return name;
        }
    }
}

fn channel(id: u16, topic: &str, metadata: Vec<u8>) -> Vec<u8> {
    let head = [id.to_le_bytes(), 0_u16.to_le_bytes()].concat();
    record(CHANNEL, &[head, sized(topic.as_bytes()), sized(b""), metadata].concat())
}

fn message(channel: u16, body: &[u8]) -> Vec<u8> {
    record(MESSAGE, &[&channel.to_le_bytes()[..], &[0; 20], body].concat())
}

/// A chunk without compression and without check sum, which the format allows.
fn chunk(records: &[u8]) -> Vec<u8> {
    let size = (records.len() as u64).to_le_bytes();
    let fields = [&[0; 16][..], &size, &[0; 4], &sized(b""), &size, records].concat();
    record(CHUNK, &fields)
}

fn metadata(name: &str, map: Vec<u8>) -> Vec<u8> {
    record(METADATA, &[sized(name.as_bytes()), map].concat())
}

const RUN: &str = r#"{"timestamp":{"sec":0,"nsec":0},"start":{"robot":"r","motion":"m","joints":[{"name":"a"}],"wall_clock_start_ns":0,"monotonic_start_ns":0,"gaitway_version":"0","metadata":{}}}"#;
const TRANSFORM: &str = r#"{"timestamp":{"sec":0,"nsec":0},"parent_frame_id":"w","child_frame_id":"s","translation":{"x":0,"y":0,"z":0},"rotation":{"x":0,"y":0,"z":0,"w":1},"source":"vqf","settled":true}"#;

fn moment(cycle: usize) -> String {
    format!(r#""timestamp":{{"sec":0,"nsec":0}},"cycle":{cycle},"host_monotonic_ns":{cycle}"#)
}

fn sample(number: usize) -> String {
    format!(
        r#"{{"timestamp":{{"sec":0,"nsec":0}},"host_monotonic_ns":{number},"number":{number},"order":"next"}}"#
    )
}

fn topics() -> Vec<u8> {
    let names = ["/run", "/joints/goal", "/joints/present", "/cycle", "/health"];
    let sensors = ["/imu/s/sample", "/imu/s/orientation", "/lines/l", "/marker"];
    let all = names.iter().chain(&sensors).enumerate();
    all.flat_map(|(id, topic)| channel(id as u16, topic, map([]))).collect()
}

/// A robot that moved for three cycles and a sensor on it.
pub fn minimal() -> Vec<u8> {
    let mut records = topics();
    records.extend(message(0, RUN.as_bytes()));
    for n in 0..3 {
        let moment = moment(n);
        let goal = format!(r#"{{{moment},"joints":[{{"name":"a","position":0.5}}]}}"#);
        records.extend(message(1, goal.as_bytes()));
        records.extend(message(3, format!(r#"{{{moment},"missed":[]}}"#).as_bytes()));
        records.extend(message(5, sample(n).as_bytes()));
        records.extend(message(6, TRANSFORM.as_bytes()));
    }
    file(&[schema(1, "s", b"{}"), chunk(&records), metadata("m", map(entries(2)))])
}

/// Cases by name; of files that are `minimal` but for one place, at most so many.
pub fn hostile(minimal: &[u8], most: usize) -> Vec<(&'static str, Files)> {
    let case = |make: fn() -> Vec<u8>| -> Files { Box::new(move || vec![make()]) };
    let (cut, bent) = (minimal.to_vec(), minimal.to_vec());
    vec![
        ("cut-off-anywhere", Box::new(move || cuts(&cut, most))),
        ("a-length-anywhere-is-huge", Box::new(move || huge_words(&bent, most))),
        ("lengths-of-texts-are-huge", Box::new(claims)),
        ("lengths-of-records-are-huge", Box::new(long_records)),
        ("metadata-of-tiny-entries", case(tiny_entries)),
        ("many-metadata-records", case(many_metadata)),
        ("65536-channels-with-an-entry", case(many_channels)),
        ("one-channel-said-anew-without-end", case(restless_channel)),
        ("large-schemas", case(large_schemas)),
        ("messages-of-nothing", case(empty_messages)),
        ("a-message-of-30-MiB", case(long_message)),
        ("names-of-sources-without-end", case(endless_sources)),
        ("lists-of-empty-joints", case(empty_joints)),
        ("cycles-of-512-joints-without-values", case(hollow_cycles)),
        ("cycles-of-one-joint", case(short_cycles)),
        ("samples-and-orientations", case(samples)),
        ("markers-and-lines", case(markers)),
    ]
}

/// The beginnings of a file, all or evenly spread.
pub fn cuts(whole: &[u8], most: usize) -> Vec<Vec<u8>> {
    let step = whole.len().div_ceil(most).max(1);
    (0..whole.len()).step_by(step).map(|end| whole[..end].to_vec()).collect()
}

/// Four bytes at every place, all or evenly spread, say a huge number.
fn huge_words(whole: &[u8], most: usize) -> Vec<Vec<u8>> {
    let step = whole.len().div_ceil(most).max(1);
    let bent = |at: usize| {
        let mut file = whole.to_vec();
        file[at..at + 4].copy_from_slice(&HUGE.to_le_bytes());
        file
    };
    (MAGIC.len()..whole.len() - 4).step_by(step).map(bent).collect()
}

/// Every text and map of a record claims two gigabytes; 60 kB behind it are there.
fn claims() -> Vec<Vec<u8>> {
    let (huge, id) = (HUGE.to_le_bytes(), [1, 0]);
    let (text, ids) = (sized(b"t"), [1, 0, 0, 0]);
    let bodies: Vec<(u8, Vec<u8>)> = vec![
        (SCHEMA, [&id[..], &huge].concat()),
        (SCHEMA, [&id[..], &text, &huge].concat()),
        (SCHEMA, [&id[..], &text, &text, &huge].concat()),
        (CHANNEL, [&ids[..], &huge].concat()),
        (CHANNEL, [&ids[..], &text, &huge].concat()),
        (CHANNEL, [&ids[..], &text, &text, &huge].concat()),
        (CHANNEL, [&ids[..], &text, &text, &40_000_u32.to_le_bytes(), &huge].concat()),
        (CHUNK, [&[0; 28][..], &huge].concat()),
        (CHUNK, [&[0; 28][..], &sized(b""), &u64::MAX.to_le_bytes()].concat()),
        (METADATA, huge.to_vec()),
        (METADATA, [&text[..], &huge].concat()),
        (METADATA, [&text[..], &40_000_u32.to_le_bytes(), &huge].concat()),
    ];
    let filled = |(opcode, mut body): (u8, Vec<u8>)| {
        body.resize(60_000, b'x');
        file(&[record(opcode, &body)])
    };
    bodies.into_iter().map(filled).collect()
}

fn long_records() -> Vec<Vec<u8>> {
    let claimed = [60_001, 1 << 26, 1 << 40, 1 << 62, u64::MAX];
    let opcodes = [HEADER, 2, SCHEMA, CHANNEL, MESSAGE, CHUNK, METADATA, 9, 200];
    let long = |opcode: u8, bytes: u64| {
        let head = [&[opcode][..], &bytes.to_le_bytes()].concat();
        file(&[head, vec![b'x'; 60_000]])
    };
    opcodes.iter().flat_map(|&opcode| claimed.map(|bytes| long(opcode, bytes))).collect()
}

fn tiny_entries() -> Vec<u8> {
    let many = map(entries(1_000_000));
    file(&[metadata("m", many.clone()), channel(1, "/lines/x", many), message(1, b"{}")])
}

fn many_metadata() -> Vec<u8> {
    let each = |n: usize| {
        let first = if n == 0 { topics() } else { Vec::new() };
        [first, message(7, b"{}"), metadata("", map(entries(1)))].concat()
    };
    file(&[(0..100_000).flat_map(each).collect()])
}

fn many_channels() -> Vec<u8> {
    let each = |id: u16| {
        let topic = format!("/imu/{}/sample", short(id.into()));
        [channel(id, &topic, map(entries(1))), message(id, b"{}")].concat()
    };
    file(&[(0..=u16::MAX).flat_map(each).collect()])
}

fn restless_channel() -> Vec<u8> {
    let each = |n: usize| {
        [channel(1, &format!("/lines/{}", short(n)), map([])), message(1, b"{}")].concat()
    };
    file(&[(0..200_000).flat_map(each).collect()])
}

fn large_schemas() -> Vec<u8> {
    let each = |id: u16| {
        let mut channel = channel(id, &short(id.into()), map([]));
        channel[11..13].copy_from_slice(&id.to_le_bytes());
        [schema(id, "s", &vec![b' '; 1 << 20]), channel, message(id, b"{}")].concat()
    };
    file(&[(1..24).flat_map(each).collect()])
}

fn empty_messages() -> Vec<u8> {
    let messages: Vec<u8> = (0..400_000).flat_map(|_| message(2, b"")).collect();
    file(&[topics(), chunk(&messages)])
}

fn long_message() -> Vec<u8> {
    let body = vec![b' '; 30 << 20];
    file(&[topics(), message(5, &body), chunk(&message(0, &body))])
}

fn endless_sources() -> Vec<u8> {
    let each = |part: usize| {
        let name = |n: usize| format!(r#""{}":1"#, short(part * 4000 + n));
        let names: Vec<String> = (0..4000).map(name).collect();
        let run = r#"{"timestamp":{"sec":0,"nsec":0},"dropped_by_source":{"#;
        message(0, format!("{run}{}}}}}", names.join(",")).as_bytes())
    };
    file(&[topics(), (0..60).flat_map(each).collect()])
}

fn empty_joints() -> Vec<u8> {
    let list = vec!["{}"; 80_000].join(",");
    let each = |n: usize| {
        let moment = moment(n);
        let run = RUN.replace(r#"[{"name":"a"}]"#, &format!("[{list}]"));
        let joints = format!(r#"{{{moment},"joints":[{list}]}}"#);
        let missed = format!(r#"{{{moment},"missed":[{list}]}}"#);
        let bodies = [(0, run), (1, joints.clone()), (2, joints.clone()), (4, joints), (3, missed)];
        bodies.iter().flat_map(|(id, body)| message(*id, body.as_bytes())).collect::<Vec<u8>>()
    };
    file(&[topics(), (0..3).flat_map(each).collect()])
}

fn hollow_cycles() -> Vec<u8> {
    let names: Vec<String> = (0..512).map(|n| format!(r#"{{"name":"{}"}}"#, short(n))).collect();
    let run = RUN.replace(r#"{"name":"a"}"#, &names.join(","));
    let cycle = |n: usize| message(3, format!(r#"{{{},"missed":[]}}"#, moment(n)).as_bytes());
    file(&[topics(), message(0, run.as_bytes()), (0..10_000).flat_map(cycle).collect()])
}

fn short_cycles() -> Vec<u8> {
    let goal = |n: usize| {
        let goal = format!(r#"{{{},"joints":[{{"name":"a","position":0}}]}}"#, moment(n));
        message(1, goal.as_bytes())
    };
    let goals: Vec<u8> = (0..60_000).flat_map(goal).collect();
    file(&[topics(), message(0, RUN.as_bytes()), chunk(&goals)])
}

fn samples() -> Vec<u8> {
    let both =
        |n: usize| [message(5, sample(n).as_bytes()), message(6, TRANSFORM.as_bytes())].concat();
    file(&[topics(), chunk(&(0..40_000).flat_map(both).collect::<Vec<u8>>())])
}

fn markers() -> Vec<u8> {
    let mark = r#"{"timestamp":{"sec":0,"nsec":0},"level":2,"message":"","name":"","file":"","line":0,"host_monotonic_ns":0}"#;
    let both = |_| [message(8, mark.as_bytes()), message(7, br#"{"dropped_before":1}"#)].concat();
    file(&[topics(), (0..60_000).flat_map(both).collect()])
}
