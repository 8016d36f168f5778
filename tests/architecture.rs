//! The import rules of ARCHITECTURE.md: who may know whom. The table is the document.

#[path = "architecture/knows.rs"]
mod knows;

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// A room: a file of `src` and the folder beside it.
struct Room {
    name: &'static str,
    /// Rooms it uses.
    uses: &'static str,
    /// What else it touches, by the names of [`TOUCHED`].
    touches: &'static str,
}

const fn room(name: &'static str, uses: &'static str, touches: &'static str) -> Room {
    Room { name, uses, touches }
}

/// Every room, with all that it uses and touches: what is not here is not allowed, and what is here
/// and not used is not true any more.
const ROOMS: &[Room] = &[
    room("action", "actionlet body columnar error motion table toml_text", "files"),
    room("actionlet", "error motion", ""),
    room("body", "error motion rigid time toml_text units", ""),
    room("bus", "port time units wire", "clock"),
    room("calibration", "error toml_text", "profiles"),
    room("capture", "device time wire", "profiles"),
    room("clean", "body error mocap toml_text", ""),
    room(
        "cli",
        "action body corpus draft error job recording rig sensing session time view",
        "arguments bars clock files keys profiles signals sleep threads wall-clock",
    ),
    room("columnar", "error", "files"),
    room("control", "bus device error guard motion robot time", "clock profiles threads"),
    room("corpus", "body clean columnar draft error toml_text", "files"),
    room("device", "bus error wire", "profiles"),
    room("draft", "error", "files"),
    room("error", "", "profiles"),
    room("guard", "motion time", ""),
    room(
        "job",
        "action actionlet body bus calibration capture clean columnar control corpus device draft error mocap motion port \
         recognise recording retarget rig rigid robot sensing session table time toml_text view \
         wire",
        "clock files network profiles simulator threads wall-clock",
    ),
    room("mocap", "body error motion rigid table toml_text units", "files"),
    room("motion", "error", ""),
    room("port", "time wire", "clock files network ports simulator threads wall-clock"),
    room("recognise", "body error toml_text", ""),
    room("recording", "capture device draft error table time", "clock files threads wall-clock"),
    room("retarget", "body error mocap motion recognise rigid robot units", "profiles"),
    room("rig", "bus calibration device error port robot time wire", "clock profiles simulator"),
    room("rigid", "error", ""),
    room(
        "robot",
        "bus calibration device error guard motion port rigid time units wire",
        "clock profiles",
    ),
    room(
        "sensing",
        "body capture device error port recording rig session time toml_text wire",
        "clock network profiles wall-clock",
    ),
    room(
        "session",
        "action body capture error mocap recording table time toml_text units",
        "files wall-clock",
    ),
    room("table", "error", ""),
    room("time", "", ""),
    room("toml_text", "error", "profiles"),
    room("units", "", ""),
    room("view", "body error mocap recording retarget rigid robot time", "network signals threads"),
    room("wire", "", ""),
];

/// What a room may touch beside other rooms, and how that looks in code.
const TOUCHED: &[(&str, &[&str])] = &[
    ("arguments", &["clap"]),
    ("bars", &["indicatif"]),
    ("clock", &[".now()", "::now()", "sleep_until("]),
    ("files", &["std::fs", "rustix::fs"]),
    ("keys", &["io::stdin", "std::io::stdin"]),
    ("network", &["std::net"]),
    ("ports", &["serialport", "socketcan"]),
    ("profiles", &["gaitway_profiles"]),
    ("signals", &["tokio"]),
    ("simulator", &["gaitway_sim"]),
    ("sleep", &["thread::sleep"]),
    ("threads", &["std::thread"]),
    ("wall-clock", &["std::time"]),
];

fn rust_files(path: &Path, found: &mut Vec<PathBuf>) {
    if path.is_dir() {
        for entry in fs::read_dir(path).expect("a readable folder") {
            rust_files(&entry.expect("a readable entry").path(), found);
        }
    } else if path.extension().is_some_and(|e| e == "rs") {
        found.push(path.to_owned());
    }
}

/// The code of a file: comments removed, because prose may name what code must not use.
fn code(path: &Path) -> String {
    let text = fs::read_to_string(path).expect("a readable source file");
    let lines = text.lines().map(|line| line.split("//").next().unwrap_or(""));
    lines.collect::<Vec<_>>().join("\n")
}

/// True of a file that is built for unit tests only: what stands in there for a line or a device may
/// know more than its room.
fn is_test(path: &Path) -> bool {
    let is_test = |part: &std::ffi::OsStr| {
        ["tests.rs", "testing.rs", "lock_tests.rs", "tests", "testing"]
            .iter()
            .any(|name| part == *name)
    };
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    path.strip_prefix(src).is_ok_and(|within| within.iter().any(is_test))
}

/// The rooms of `src` and the files of each that are part of the product.
fn files_by_room() -> BTreeMap<String, Vec<PathBuf>> {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    rust_files(&src, &mut files);
    let mut rooms: BTreeMap<String, Vec<PathBuf>> = BTreeMap::new();
    for file in files.into_iter().filter(|file| !is_test(file)) {
        let within = file.strip_prefix(&src).expect("inside");
        let first = within.iter().next().expect("a name").to_string_lossy();
        let room = first.trim_end_matches(".rs").to_owned();
        if !["lib", "main"].contains(&room.as_str()) {
            rooms.entry(room).or_default().push(file);
        }
    }
    rooms
}

/// The code of a file without its unit tests, which may know more than its room.
fn product(path: &Path) -> String {
    let text = code(path);
    text.split("#[cfg(test)]\nmod tests {").next().unwrap_or_default().to_owned()
}

/// Rooms that a piece of code names.
fn named<'a>(code: &str, rooms: impl Iterator<Item = &'a String>) -> BTreeSet<String> {
    let parts: Vec<&str> = code.split("crate::").skip(1).collect();
    let word = |part: &str| {
        part.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect::<String>()
    };
    let words: BTreeSet<String> = parts.iter().map(|part| word(part)).collect();
    rooms.filter(|room| words.contains(*room)).cloned().collect()
}

#[test]
fn each_room_uses_and_touches_what_the_table_says_and_nothing_else() {
    let rooms = files_by_room();
    let listed: Vec<&str> = ROOMS.iter().map(|room| room.name).collect();
    assert_eq!(rooms.keys().map(String::as_str).collect::<Vec<_>>(), listed, "a row for each");
    for Room { name, uses, touches } in ROOMS {
        let (mut used, mut touched) = (BTreeMap::new(), BTreeMap::new());
        for file in &rooms[*name] {
            let code = product(file);
            assert!(!code.contains("crate::{"), "{}: name one room at a time", file.display());
            for room in named(&code, rooms.keys()).into_iter().filter(|room| room != name) {
                used.insert(room, file);
            }
            for (what, looks) in TOUCHED {
                if looks.iter().any(|look| code.contains(look)) {
                    touched.insert((*what).to_owned(), file);
                }
            }
        }
        for (found, allowed, verb) in [(used, uses, "uses"), (touched, touches, "touches")] {
            let allowed: BTreeSet<&str> = allowed.split_whitespace().collect();
            for (what, file) in &found {
                assert!(allowed.contains(what.as_str()), "{} {verb} {what}", file.display());
            }
            for what in allowed {
                assert!(found.contains_key(what), "{name} {verb} {what} no more: mend the table");
            }
        }
    }
}

#[test]
fn no_room_is_above_itself() {
    // Whoever is used is below; who is used by nobody is the top.
    let mut left: Vec<&Room> = ROOMS.iter().collect();
    while !left.is_empty() {
        let names: Vec<&str> = left.iter().map(|room| room.name).collect();
        let is_used =
            |name: &str| left.iter().any(|by| by.uses.split_whitespace().any(|u| u == name));
        let before = left.len();
        let tops: Vec<&str> = names.iter().copied().filter(|name| !is_used(name)).collect();
        left.retain(|room| !tops.contains(&room.name));
        assert!(left.len() < before, "rooms that use one another in a circle: {names:?}");
    }
}

/// A room may name its parts and a part what its room has; no other files need one another in a
/// circle, so that each can be read, and tried, after those it names.
#[test]
fn no_files_need_one_another_in_a_circle() {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let files: Vec<PathBuf> = files_by_room().into_values().flatten().collect();
    assert!(files.len() > 200, "the rule looks at {} files", files.len());
    let module = |file: &PathBuf| -> knows::Module {
        let within = file.strip_prefix(&src).expect("inside").with_extension("");
        within.iter().map(|part| part.to_string_lossy().into_owned()).collect()
    };
    let code = files.iter().map(|file| (module(file), product(file))).collect();
    let circles = knows::circles(knows::who_knows_whom(&code));
    let shown: Vec<String> = circles
        .iter()
        .map(|(file, of)| {
            let of: Vec<String> = of.iter().map(|file| file.join("/")).collect();
            format!("{} names {}", file.join("/"), of.join(", "))
        })
        .collect();
    assert!(shown.is_empty(), "{shown:#?}");
}

#[test]
fn nobody_knows_the_command_line() {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    rust_files(&src, &mut files);
    let is_of_it = |path: &Path| {
        let within = path.strip_prefix(&src).expect("inside");
        within.starts_with("cli") || within == Path::new("cli.rs") || within == Path::new("main.rs")
    };
    let others: Vec<_> = files.iter().filter(|path| !is_of_it(path)).collect();
    assert!(others.len() > 100, "the rule looks at {} files", others.len());
    for file in others {
        let code = code(file);
        for name in
            ["cli::", "{cli", ", cli,", ", cli}", "clap", "exit_code", "ExitCode", "process::exit"]
        {
            assert!(!code.contains(name), "{} mentions {name}", file.display());
        }
    }
}

/// Lines of code in `cli`, without blank ones, comments and unit tests: what a job does has no place
/// there.
const THIN: usize = 7000;

#[test]
fn the_command_line_stays_thin() {
    let rooms = files_by_room();
    let lines = rooms["cli"].iter().map(|file| {
        let code = product(file);
        code.lines().filter(|line| !line.trim().is_empty()).count()
    });
    let lines: usize = lines.sum();
    assert!((1000..=THIN).contains(&lines), "{lines} lines of code");
}

#[test]
fn the_simulator_never_sees_the_driver() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("sim");
    let manifest = fs::read_to_string(root.join("Cargo.toml")).expect("sim/Cargo.toml");
    assert!(!manifest.contains("path = \"..\""), "sim depends on the root package");
    let mut files = Vec::new();
    rust_files(&root.join("src"), &mut files);
    for file in files {
        assert!(!code(&file).contains("gaitway::"), "{} uses the driver", file.display());
    }
}

/// What writes to the terminal, or may panic when it cannot.
const TERMINAL: &[&str] = &["print!(", "println!(", "dbg!(", "io::stdout()", "io::stderr()"];

#[test]
fn one_place_alone_writes_to_the_terminal() {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let (mut files, mut asked) = (Vec::new(), 0);
    rust_files(&src, &mut files);
    for file in files.iter().filter(|path| !path.ends_with("cli/output.rs") && !is_test(path)) {
        for line in code(file).lines() {
            // Whether it is a terminal may be asked anywhere.
            let is_question = line.contains("is_terminal()");
            asked += usize::from(is_question);
            let writes = TERMINAL.iter().find(|name| line.contains(*name) && !is_question);
            assert_eq!(writes, None, "{}: {}", file.display(), line.trim());
        }
    }
    assert!(asked > 0, "the rule looks at nothing");
    let output = code(&src.join("cli/output.rs"));
    assert!(!output.contains("println!("), "this one panics when nobody reads it");
}

/// Where a reader of TOML may be that does not look at the size of what it will build: the one
/// that looks, and what reads a file of this project.
const TOML_READERS: [&str; 2] =
    ["firmware-profiles/src/from_toml.rs", "firmware-profiles/src/extends.rs"];

#[test]
fn files_of_strangers_are_read_as_toml_in_one_way() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut files = Vec::new();
    for folder in ["src", "sim/src", "firmware-profiles/src"] {
        rust_files(&root.join(folder), &mut files);
    }
    for file in files.iter().filter(|file| !TOML_READERS.iter().any(|known| file.ends_with(known)))
    {
        let code = code(file);
        for reader in ["toml::from_str", "toml::from_slice", ".parse::<toml", ".parse::<Table"] {
            assert!(!code.contains(reader), "{} uses {reader}", file.display());
        }
    }
}

#[test]
fn only_the_guard_can_make_a_command() {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    rust_files(&src, &mut files);
    for file in files.iter().filter(|file| !file.ends_with("guard.rs")) {
        assert!(!code(file).contains("Command { goal_rad"), "{}", file.display());
    }
    let guard = code(&src.join("guard.rs"));
    assert!(guard.contains("    goal_rad: Vec<f64>,"), "the field of Command must stay private");
}

/// What makes a frame of a CAN actuator's goal out of numbers.
const GOAL_ENCODERS: &[&str] = &[
    "Command::Setpoint",
    "Command::Position",
    "Command::Velocity",
    "Command::Torque",
    "Command::Duty",
    "Command::Current(",
    "mit_setpoint(",
    "robstride_setpoint(",
    "MODE_POSITION",
    "register::COMMAND",
    "parameter::POSITION_GOAL",
];

/// Where they may stand: the dialects, and the one room that knows what their numbers mean.
fn may_encode_goals(path: &Path) -> bool {
    let path = path.to_string_lossy();
    ["src/wire/can", "src/device/actuator", "src/device/coded.rs"]
        .iter()
        .any(|of| path.contains(of))
}

#[test]
fn only_a_command_of_the_guard_becomes_a_goal_on_a_can_line() {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    rust_files(&src, &mut files);
    for file in files.iter().filter(|file| !may_encode_goals(file)) {
        let code = code(file);
        let known = GOAL_ENCODERS.iter().find(|name| code.contains(*name));
        assert_eq!(known, None, "{} makes goals", file.display());
    }
    // From the one function that asks for a goal frame the way leads to `Link::write_goals` alone,
    // which takes nothing but a command.
    let (device, line) = ("device/actuator.rs", "robot/link/can.rs");
    let places = |name: &str| -> Vec<(String, usize)> {
        let count = |file: &PathBuf| {
            let within = file.strip_prefix(&src).expect("inside").display().to_string();
            (within, code(file).matches(name).count())
        };
        let code = files.iter().filter(|file| !file.ends_with("tests.rs"));
        code.map(count).filter(|(_, count)| *count > 0).collect()
    };
    let mut asked = places("goal_frame(");
    asked.sort();
    // Its own definition, and the form of a cycle's frames, which is never sent.
    assert_eq!(asked, [(device.to_owned(), 2), (line.to_owned(), 1)]);
    assert_eq!(places("axis.goal = Some("), [(line.to_owned(), 1)]);
    assert_eq!(places("can.write_goals("), [("robot/link.rs".to_owned(), 1)]);
    let link = code(&src.join("robot/link.rs"));
    assert!(link.contains("pub(crate) fn write_goals("), "nobody outside writes goals");
}
