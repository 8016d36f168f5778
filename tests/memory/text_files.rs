//! Small valid files of every text format, and hostile ones made from them.

use crate::mcap_files::cuts;
use crate::readers::Files;

/// Most bytes of a profile, a table, a plan and what else is read as they are.
const TEXT_BYTES: usize = 1 << 20;
/// Files that differ from a valid one in one place, at most.
const MOST: usize = 300;
/// What is no number a joint, a register or a time can have.
const BAD_NUMBERS: [&str; 10] = [
    "nan",
    "-nan",
    "inf",
    "-inf",
    "1e999",
    "-1e308",
    "4e-324",
    "-0.0",
    "18446744073709551616",
    "-9223372036854775808",
];

pub const TABLE: &str = include_str!("../../fuzz/seeds/motions/table.csv");
pub const BVH: &str = include_str!("../../fuzz/seeds/motions/capture.bvh");
pub const TRC: &str = include_str!("../../fuzz/seeds/marker_texts/trial.trc");
pub const CSM: &str = include_str!("../../fuzz/seeds/marker_texts/trial.csm");
pub const MOT: &str = include_str!("../../fuzz/seeds/marker_texts/walk.mot");
pub const MARKER_TABLE: &str = include_str!("../../fuzz/seeds/marker_texts/trial.csv");
pub const ASF: &str = include_str!("../../fuzz/seeds/acclaim/skeleton.asf");
pub const AMC: &str = include_str!("../../fuzz/seeds/acclaim/motion.amc");
pub const MAPPING: &str = include_str!("../../fuzz/seeds/texts/mapping.toml");
pub const CALIBRATION: &str = include_str!("../../fuzz/seeds/texts/calibration.toml");
pub const BODY_CALIBRATION: &str = include_str!("../../fuzz/seeds/texts/body-calibration.toml");
pub const PLAN: &str = include_str!("../../fuzz/seeds/texts/plan.toml");
pub const SESSION: &str = include_str!("../../fuzz/seeds/texts/session.toml");
pub const TRIAL: &str = include_str!("../../fuzz/seeds/texts/trial.toml");
pub const DEVICE_CHECK: &str = include_str!("../../fuzz/seeds/texts/device-check.toml");
pub const BODY_CHECK: &str = include_str!("../../fuzz/seeds/texts/body-check.toml");
pub const SUBJECT: &str = include_str!("../../fuzz/seeds/texts/subject.toml");
pub const FAULTS: &str = include_str!("../../fuzz/seeds/fault_scripts/two.toml");

/// One file with this text over and over, as long as a text may be.
fn full_of(head: &str, part: &str, tail: &str) -> Vec<u8> {
    let times = (TEXT_BYTES - head.len() - tail.len()) / part.len();
    [head, &part.repeat(times), tail].concat().into_bytes()
}

/// As [`full_of`], each time with another number in place of `#`.
fn numbered(head: &str, part: &str) -> Vec<u8> {
    let mut text = head.to_owned();
    for number in 0.. {
        let next = part.replace('#', &number.to_string());
        if text.len() + next.len() > TEXT_BYTES {
            break;
        }
        text += &next;
    }
    text.into_bytes()
}

fn one(file: Vec<u8>) -> Files {
    Box::new(move || vec![file.clone()])
}

/// Every number of a text in turn made one of [`BAD_NUMBERS`].
fn bad_numbers(text: &[u8]) -> Vec<Vec<u8>> {
    let begins = |at: usize| {
        let before = if at == 0 { b' ' } else { text[at - 1] };
        text[at].is_ascii_digit() && matches!(before, b' ' | b'\n' | b',' | b'[' | b'-' | b'=')
    };
    let places: Vec<usize> = (0..text.len()).filter(|&at| begins(at)).collect();
    let step = places.len().div_ceil(MOST / BAD_NUMBERS.len()).max(1);
    let mut files = Vec::new();
    for &at in places.iter().step_by(step) {
        let number = text[at..].iter().take_while(|b| b.is_ascii_alphanumeric() || **b == b'.');
        let end = at + number.count();
        for bad in BAD_NUMBERS {
            files.push([&text[..at], bad.as_bytes(), &text[end..]].concat());
        }
    }
    files
}

fn common(minimal: &[u8]) -> Vec<(&'static str, Files)> {
    let (cut, bent, broken) = (minimal.to_vec(), minimal.to_vec(), minimal.to_vec());
    let not_text = move || {
        let mut files: Vec<Vec<u8>> = Vec::new();
        for at in (0..broken.len()).step_by(broken.len().div_ceil(MOST)) {
            let mut file = broken.clone();
            file[at] = [0, 0xFF, 0xC3, b'"', b'\r'][at % 5];
            files.push(file);
        }
        files
    };
    let numbers: Files = Box::new(move || bad_numbers(&bent));
    let has_numbers = minimal.iter().any(u8::is_ascii_digit);
    let numbers = has_numbers.then_some(("numbers-that-are-none", numbers));
    let cases: Vec<(&'static str, Files)> = vec![
        ("cut-off-anywhere", Box::new(move || cuts(&cut, MOST))),
        ("a-byte-that-is-no-text", Box::new(not_text)),
        ("a-word-of-1-MiB", one(full_of("", "x", ""))),
        ("empty-lines", one(full_of("", "\n", ""))),
        ("zeros", one(vec![0; TEXT_BYTES])),
        ("larger-than-any-file-may-be", one(vec![b' '; 20 << 20])),
    ];
    cases.into_iter().chain(numbers).collect()
}

pub fn hostile_tables(minimal: &[u8]) -> Vec<(&'static str, Files)> {
    let mut cases = common(minimal);
    cases.extend([
        ("titles-without-end", one(numbered("time_s", ",#_rad"))),
        ("the-same-title-without-end", one(full_of("time_s", ",_rad", ""))),
        ("a-row-without-end", one(full_of("time_s,a_rad\n0,0\n", ",0", ""))),
        ("rows-without-end", one(numbered("time_s,a_rad\n", "#,0\n"))),
        ("columns-and-rows", one(columns_and_rows())),
    ]);
    cases
}

/// As many numbers of two bytes as a table can have.
fn columns_and_rows() -> Vec<u8> {
    let columns = 1000;
    let titles: Vec<String> = (0..columns).map(|n| format!("{n}_rad")).collect();
    numbered(&format!("time_s,{}\n", titles.join(",")), &format!("#{}\n", ",0".repeat(columns)))
}

pub fn hostile_bvh(minimal: &[u8]) -> Vec<(&'static str, Files)> {
    let mut cases = common(minimal);
    let claims = |frames: &str| {
        let file = BVH.replace("Frames: 2", &format!("Frames: {frames}"));
        file.into_bytes()
    };
    let counts = ["2000000", "2e6", "1e19", "18446744073709551615", "-1", "nan", "0"];
    let claimed: Files = Box::new(move || counts.map(claims).to_vec());
    let channels = BVH.replace("CHANNELS 3", "CHANNELS 99999999999");
    let joint = "JOINT j\n{\nOFFSET 0 0 0\n";
    let name = format!("HIERARCHY\nROOT {}\n{{\n", "x".repeat(60_000));
    let root = "HIERARCHY\nROOT r\n{\nOFFSET 0 0 0\nCHANNELS 1 Xrotation\n";
    let motion = format!("{root}}}\nMOTION\nFrames: 2000000\nFrame Time: 0.01\n");
    cases.extend([
        ("counts-of-poses", claimed),
        ("a-count-of-channels", one(channels.into_bytes())),
        ("nesting-without-end", one(full_of(root, joint, ""))),
        ("joints-without-end", one(full_of(root, &format!("{joint}}}\n"), ""))),
        ("end-sites-without-end", one(full_of(root, "End Site{OFFSET 0 0 0}\n", ""))),
        ("a-long-name", one(name.into_bytes())),
        ("poses-of-two-bytes", one([motion.as_bytes(), &b"0\n".repeat(1_900_000)].concat())),
    ]);
    cases
}

pub fn hostile_trc(minimal: &[u8]) -> Vec<(&'static str, Files)> {
    let mut cases = common(minimal);
    let head = TRC.split("\n\n").next().expect("a head");
    let labels: Vec<String> = (0..16_000).map(|n| format!("{n}\t\t")).collect();
    let many = head.replace("R.Heel\t\t\tL Toe\t\t", &labels.join("\t"));
    let seen = format!("1\t0\t{}\n", "1\t".repeat(48_000));
    cases.extend([
        ("rows-without-end", one(numbered(&format!("{head}\n"), "#\t0\n"))),
        ("rows-of-nothing", one(full_of(&format!("{head}\n"), "1\t0\t\t\t\t\t\t\n", ""))),
        ("markers-without-end", one(full_of(&many, "\n1\t0\t1\t1\t1", "\n"))),
        ("markers-and-rows", one(full_of(&format!("{many}\n"), &seen, ""))),
        ("labels-without-end", one(numbered("PathFileType\nDataRate\n1\nFrame\tTime", "\t#"))),
    ]);
    cases
}

pub fn hostile_csm(minimal: &[u8]) -> Vec<(&'static str, Files)> {
    let mut cases = common(minimal);
    let head = "$Order a\n$Points\n";
    let labels: Vec<String> = (0..16_000).map(|n| format!("{n}")).collect();
    let many = format!("$Order {}\n$Points\n", labels.join(" "));
    let unseen = format!("1{}\n", " 0".repeat(48_000));
    cases.extend([
        ("rows-without-end", one(numbered(head, "# 0 0 0\n"))),
        ("rows-of-nothing", one(full_of(head, "1\n", ""))),
        ("markers-and-rows", one(full_of(&many, &unseen, ""))),
        ("labels-without-end", one(numbered("$Order", " #"))),
        ("lines-of-labels-without-end", one(numbered("$Order\n", "#\n"))),
        ("a-head-without-end", one(numbered("", "$a #\n"))),
        ("actors-without-end", one(full_of("", "$Actor a\n", ""))),
    ]);
    cases
}

pub fn hostile_opensim(minimal: &[u8]) -> Vec<(&'static str, Files)> {
    let mut cases = common(minimal);
    let titles: Vec<String> = (0..16_000).map(|n| format!("{n}")).collect();
    let many = format!("endheader\ntime {}\n", titles.join(" "));
    let row = format!("0{}\n", " 1".repeat(16_000));
    let turns = "DataType=Quaternion\nendheader\ntime a\n";
    cases.extend([
        ("rows-of-times", one(numbered("endheader\ntime\n", "#\n"))),
        ("rows-of-numbers", one(numbered("endheader\ntime a b\n", "# 1 1\n"))),
        ("rows-of-turns", one(numbered(turns, "# 1,0,0,0\n"))),
        ("columns-and-rows", one(full_of(&many, &row, ""))),
        ("columns-without-end", one(numbered("endheader\ntime", " #"))),
        ("a-head-without-end", one(numbered("", "a=#\n"))),
        ("a-long-name", one(full_of("name=", "x", ""))),
    ]);
    cases
}

pub fn hostile_marker_tables(minimal: &[u8]) -> Vec<(&'static str, Files)> {
    let mut cases = common(minimal);
    let empty = "0,#,,,\n";
    cases.extend([
        ("titles-without-end", one(numbered("time_s", ",#_x_m"))),
        ("markers-without-end", one(numbered("time_s", ",#_x_m,#_y_m,#_z_m"))),
        ("rows-without-end", one(numbered("a,time_s,b_x_m,b_y_m,b_z_m\n", empty))),
        ("rows-of-numbers", one(numbered("time_s,b_x_m,b_y_m,b_z_m\n", "#,1,1,1\n"))),
    ]);
    cases
}

pub fn hostile_acclaim(minimal: &[u8]) -> Vec<(&'static str, Files)> {
    let mut cases = common(minimal);
    let frame = "1\nroot 1 1 1 1 1 1\narm 1\nhand 1 1\n";
    let late = format!("#{}\n{frame}", "x".repeat(60_000));
    cases.extend([
        ("frames-without-end", one(full_of("", frame, ""))),
        ("frames-behind-a-long-line", one(full_of(&late, frame, ""))),
        ("numbers-of-frames-without-end", one(full_of(frame, "1\n", ""))),
        ("bones-without-end", one(full_of(frame, "arm 1\n", ""))),
    ]);
    cases
}

/// What each kind of TOML file has of its own.
pub fn hostile_toml(minimal: &[u8]) -> Vec<(&'static str, Files)> {
    let mut cases = common(minimal);
    let (listed, repeated) = (minimal.to_vec(), minimal.to_vec());
    cases.extend([
        ("lists-in-place-of-every-value", Box::new(move || long_lists(&listed)) as Files),
        ("every-table-over-and-over", Box::new(move || repeated_tables(&repeated)) as Files),
    ]);
    cases
}

/// What any TOML can be, whatever it should be.
pub fn hostile_structure() -> Vec<(&'static str, Files)> {
    vec![
        ("brackets", one(full_of("", "[", ""))),
        ("a-list-of-brackets", one(full_of("a=", "[", ""))),
        ("a-list-of-lists", one(full_of("a=[", "[],", "]"))),
        ("a-list-of-tables", one(full_of("a=[", "{},", "]"))),
        ("a-list-of-zeros", one(full_of("a=[", "0,", "]"))),
        ("tables-in-tables", one(full_of("", "a={", ""))),
        ("dotted-keys", one(full_of("a", ".a", "=0"))),
        ("dotted-tables", one(full_of("[a", ".a", "]"))),
        ("keys", one(numbered("", "a#=0\n"))),
        ("keys-of-keys", one(numbered("", "a#.b=0\n"))),
        ("tables", one(numbered("", "[a#]\n"))),
        ("tables-of-tables", one(numbered("", "[a#.b.c.d]\n"))),
        ("lists-of-tables", one(full_of("", "[[a]]\n", ""))),
        ("a-list-that-never-ends", one(numbered("a=[\n", "b#.c.d=0\n"))),
        ("a-list-that-never-ends-of-numbers", one(numbered("a=[\n", "1.#=0\n"))),
        ("a-table-that-never-ends", one(numbered("a={\n", "b#.c.d=0\n"))),
        ("lists-that-never-end", one(numbered("", "b#.c.d=[\n"))),
        ("values-that-are-keys", one(numbered("", "a#=b.c.d=0\n"))),
        ("headings-that-never-end", one(numbered("", "[a#.b.c.d\n"))),
        ("headings-of-headings", one(numbered("", "[[a#]]\n[a#.b.c]\nd={e={f=[{}]}}\n"))),
        ("tables-in-a-line", one(numbered("a=[", "{b.c.d=#,e.f=0},"))),
        ("comments", one(full_of("", "#\n", ""))),
        ("escapes", one(full_of("a=\"", "\\u00e9", "\""))),
        ("a-text-without-end", one(full_of("a=\"\"\"", "x\n", ""))),
    ]
}

/// Each value of a file in turn made a list of a great many of itself, as long as a file may be.
fn long_lists(minimal: &[u8]) -> Vec<Vec<u8>> {
    let text = String::from_utf8_lossy(minimal);
    let mut files = Vec::new();
    for (number, line) in text.lines().enumerate() {
        let Some((key, value)) = line.split_once(" = ") else { continue };
        let inside = value.trim().trim_matches(|c| c == '[' || c == ']');
        let inside = if value.starts_with('[') { inside } else { value.trim() };
        if inside.is_empty() || files.len() >= 12 {
            continue;
        }
        let others = |lines: &mut dyn Iterator<Item = &str>| {
            lines.map(|line| format!("{line}\n")).collect::<String>()
        };
        let before = others(&mut text.lines().take(number));
        let after = others(&mut text.lines().skip(number + 1));
        let head = format!("{before}{key} = [");
        for inside in [inside, "0", "[]", "\"\""] {
            files.push(full_of(&head, &format!("{inside},"), &format!("]\n{after}")));
        }
    }
    // A file without values is one without lists.
    files.truncate(48);
    files
}

/// Each part of a file that a `[[heading]]` begins in turn repeated until the file is full.
fn repeated_tables(minimal: &[u8]) -> Vec<Vec<u8>> {
    let text = String::from_utf8_lossy(minimal);
    let mut files = vec![full_of(&text, &text, "")];
    let starts: Vec<usize> = text.match_indices("\n[[").map(|(at, _)| at + 1).collect();
    for (index, &start) in starts.iter().enumerate() {
        let end = starts.get(index + 1).copied().unwrap_or(text.len());
        let heading = text[start..end].lines().next().unwrap_or_default();
        let seen = starts[..index].iter().any(|&other| text[other..].starts_with(heading));
        if !seen {
            files.push(full_of(&text[..end], &text[start..end], &text[end..]));
            files.push(full_of(&text[..start], &format!("{heading}\n"), &text[start..]));
        }
    }
    files
}
