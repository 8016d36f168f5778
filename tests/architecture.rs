//! The import rules of ARCHITECTURE.md: who may know whom. The table is the document.

use std::fs;
use std::path::{Path, PathBuf};

/// Module (a file and the folder beside it), and what it must not mention.
const RULES: &[(&str, &[&str])] = &[
    (
        "wire",
        &[
            "crate::port",
            "crate::bus",
            "crate::device",
            "crate::robot",
            "crate::control",
            "crate::cli",
            "crate::time",
            "gaitway_profiles",
            "gaitway_sim",
            "std::fs",
            "std::io",
            "std::time",
        ],
    ),
    (
        "port",
        &["crate::bus", "crate::device", "crate::robot", "crate::control", "gaitway_profiles"],
    ),
    ("bus", &["crate::device", "crate::robot", "crate::control", "gaitway_profiles", "std::time"]),
    ("device", &["crate::control", "crate::robot", "crate::motion", "std::fs", "std::time"]),
    (
        "guard",
        &["crate::robot", "crate::bus", "crate::port", "crate::device", "crate::wire", "std::time"],
    ),
    ("robot", &["crate::control", "crate::cli", "crate::recording", "std::time"]),
    ("motion", NO_HARDWARE),
    ("action", NO_HARDWARE),
    ("actionlet", NO_HARDWARE),
    ("body", NO_HARDWARE),
    ("mocap", NO_HARDWARE),
    (
        "control",
        &[
            "crate::cli",
            "crate::mocap",
            "crate::recording",
            "crate::wire",
            "crate::bus::can",
            "std::fs",
            "std::time",
        ],
    ),
    (
        "capture",
        &[
            "crate::port",
            "crate::bus",
            "crate::robot",
            "crate::control",
            "crate::cli",
            "crate::recording",
            "std::fs",
            "std::time",
        ],
    ),
    (
        "session",
        &[
            "crate::control",
            "crate::bus",
            "crate::port",
            "crate::device",
            "crate::robot",
            "crate::cli",
            "std::io::stdin",
            "std::thread",
        ],
    ),
    (
        "rig",
        &[
            "crate::control",
            "crate::motion",
            "crate::mocap",
            "crate::action",
            "crate::body",
            "crate::recording",
            "crate::session",
            "crate::cli",
            "clap",
            "std::fs",
            "std::io",
            "std::time",
        ],
    ),
    ("job", &["crate::cli", "clap", "std::io::std", "println!", "ExitCode", "process::exit"]),
    ("recording", &["crate::control", "crate::bus", "crate::port", "crate::robot", "crate::cli"]),
    ("plot", &["crate::control", "crate::bus", "crate::port", "crate::robot", "crate::cli"]),
];

const NO_HARDWARE: &[&str] = &[
    "crate::port",
    "crate::bus",
    "crate::device",
    "crate::guard",
    "crate::robot",
    "crate::control",
    "crate::cli",
    "crate::recording",
    "crate::time",
    "gaitway_profiles",
    "gaitway_sim",
    "std::time",
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

fn module_files(module: &str) -> Vec<PathBuf> {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut found = Vec::new();
    rust_files(&src.join(module), &mut found);
    let file = src.join(format!("{module}.rs"));
    if file.exists() {
        found.push(file);
    }
    assert!(!found.is_empty(), "no source for module {module}");
    found
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
        ["tests.rs", "testing.rs", "tests", "testing"].iter().any(|name| part == *name)
    };
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    path.strip_prefix(src).is_ok_and(|within| within.iter().any(is_test))
}

#[test]
fn no_module_knows_what_it_must_not() {
    let mut broken = Vec::new();
    for (module, forbidden) in RULES {
        for file in module_files(module).iter().filter(|file| !is_test(file)) {
            let code = code(file);
            for name in *forbidden {
                if code.contains(name) {
                    broken.push(format!("{} mentions {name}", file.display()));
                }
            }
        }
    }
    assert!(broken.is_empty(), "import rules broken:\n{}", broken.join("\n"));
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
        for name in ["cli::", "{cli", ", cli", "clap"] {
            assert!(!code.contains(name), "{} mentions {name}", file.display());
        }
    }
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
    assert!(link.contains("pub fn write_goals(&mut self, command: &Command,"));
}
