//! Every decoder and reader on bytes made up: always on what its seeds become when they are changed at random, the same on
//! every run; with `GAITWAY_LONG` by libFuzzer, which looks for new ways through the code, and the codecs under Miri, the
//! interpreter that sees undefined behaviour. By hand these two are `fuzz/run.sh` and the command in `fuzz/miri`. `FUZZ_SECONDS`
//! says for how long libFuzzer runs each target.

mod aloud;

/// What is fuzzed, as libFuzzer's program has it.
#[path = "../fuzz/src"]
mod fuzz {
    pub mod shared;
    pub mod targets;
}

use aloud::aloud;
use fuzz::{shared, targets};
use rand::seq::IndexedRandom;
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

/// Seconds for each target of libFuzzer, unless the environment says otherwise.
const SECONDS: &str = "5";
/// How many inputs each target gets beside its seeds, and one that runs a virtual robot on each.
const INPUTS: usize = 10_000;
const INPUTS_OF_ROBOTS: usize = 500;
const ROBOTS: [&str; 2] = ["control_requests", "virtual_servos"];
/// Bytes of an input, unless the target names another bound.
const LONGEST: usize = 2048;

fn folder() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/fuzz"))
}

fn names() -> Vec<String> {
    let entries = std::fs::read_dir(folder().join("src/targets")).expect("the folder of targets");
    let name = |path: PathBuf| path.file_stem()?.to_str().map(str::to_owned);
    let mut names: Vec<String> =
        entries.filter_map(|entry| name(entry.expect("an entry").path())).collect();
    names.sort();
    names
}

/// What a target starts from, read as run.sh reads it, and how long its inputs may be.
fn seeds(target: &str) -> (Vec<Vec<u8>>, usize) {
    let (mut seeds, mut longest) = (Vec::new(), LONGEST);
    let read = |path: PathBuf| std::fs::read(&path).expect("a seed");
    let of = |ending: &str| folder().join("seeds").join(format!("{target}{ending}"));
    let mut files = of_folder(&of(""));
    if let Ok(text) = std::fs::read_to_string(of(".hex")) {
        let lines = text.lines().map(|line| line.split('#').next().unwrap_or("").replace(' ', ""));
        seeds.extend(lines.filter(|line| !line.is_empty()).map(|line| bytes(&line)));
    }
    if let Ok(text) = std::fs::read_to_string(of(".files")) {
        for line in text.lines() {
            if let Some(length) = line.strip_prefix("max_len ") {
                longest = length.parse().expect("a length");
                continue;
            }
            let pattern = folder().join("..").join(line);
            let (within, name) = (pattern.parent(), pattern.file_name().and_then(|n| n.to_str()));
            let (within, name) = (within.expect("a folder"), name.expect("a name"));
            let fits = |path: &PathBuf| match name.split_once('*') {
                Some((before, after)) => {
                    path.file_name().and_then(|n| n.to_str()).is_some_and(|n| {
                        n.len() >= before.len() + after.len()
                            && n.starts_with(before)
                            && n.ends_with(after)
                    })
                }
                None => path.ends_with(name),
            };
            let found: Vec<PathBuf> = of_folder(within).into_iter().filter(fits).collect();
            assert!(!found.is_empty(), "{line} names no file");
            files.extend(found);
        }
    }
    seeds.extend(files.into_iter().map(read));
    seeds.iter_mut().for_each(|seed| seed.truncate(longest));
    (seeds, longest)
}

/// The files of a folder, if there is one.
fn of_folder(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten();
    let mut files: Vec<PathBuf> = entries.map(|entry| entry.expect("an entry").path()).collect();
    files.retain(|path| path.is_file());
    files.sort();
    files
}

fn bytes(hex: &str) -> Vec<u8> {
    let digits = hex.as_bytes().chunks(2).map(|two| std::str::from_utf8(two).expect("hex digits"));
    digits.map(|two| u8::from_str_radix(two, 16).expect("a byte in hex")).collect()
}

/// An input made of the seeds: one of them, or two put together, with some changes.
fn made_up(seeds: &[Vec<u8>], longest: usize, dice: &mut ChaCha8Rng) -> Vec<u8> {
    let mut input = seeds.choose(dice).cloned().unwrap_or_default();
    if dice.random_bool(0.2)
        && let Some(other) = seeds.choose(dice).filter(|other| !other.is_empty())
    {
        input.truncate(dice.random_range(0..=input.len()));
        input.extend(&other[dice.random_range(0..other.len())..]);
    }
    for _ in 0..dice.random_range(0..8) {
        let at = dice.random_range(0..=input.len());
        let rest = input.len() - at;
        match dice.random_range(0..7) {
            0 if rest > 0 => input[at] ^= 1 << dice.random_range(0..8),
            1 if rest > 0 => {
                input[at] = *[0, 1, 0x7f, 0x80, 0xfe, 0xff].choose(dice).expect("some")
            }
            2 if rest > 0 => input[at] = dice.random(),
            3 => drop(input.drain(at..at + dice.random_range(0..=rest.min(16)))),
            4 => {
                let mut added = vec![0; dice.random_range(1..=16)];
                dice.fill_bytes(&mut added);
                input.splice(at..at, added);
            }
            5 => {
                let again = input[at..at + dice.random_range(0..=rest.min(64))].to_vec();
                input.splice(at..at, again);
            }
            6 => input.truncate(at),
            _ => {}
        }
    }
    input.truncate(longest);
    input
}

/// One after the other: one of them asks how much memory was taken.
#[test]
fn no_decoder_breaks_on_what_its_seeds_become() {
    for name in names() {
        let target = targets::named(&name).unwrap_or_else(|| panic!("{name} is in targets.rs"));
        let (seeds, longest) = seeds(&name);
        assert!(!seeds.is_empty(), "{name} starts from nothing");
        let mut dice = ChaCha8Rng::seed_from_u64(1);
        let begun = Instant::now();
        for seed in &seeds {
            target(seed);
        }
        let count = if ROBOTS.contains(&name.as_str()) { INPUTS_OF_ROBOTS } else { INPUTS };
        for number in 0..count {
            let input = made_up(&seeds, longest, &mut dice);
            let is_broken = std::panic::catch_unwind(|| target(&input)).is_err();
            assert!(!is_broken, "{name} breaks on its input {number}: {input:02x?}");
        }
        aloud!(
            "{name}: {} seeds, {count} inputs, {:.1} s",
            seeds.len(),
            begun.elapsed().as_secs_f64()
        );
    }
}

fn is_long() -> bool {
    let is_long = std::env::var_os("GAITWAY_LONG").is_some();
    if !is_long {
        aloud!(
            "SKIPPED: minutes, and therefore with GAITWAY_LONG=1; by hand: fuzz/run.sh, fuzz/miri"
        );
    }
    is_long
}

/// A command in a folder of the project, without what cargo tells its tests about itself.
fn command(program: &str, folder: &str) -> Command {
    let mut command = Command::new(program);
    command.current_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join(folder));
    for (name, _) in std::env::vars().filter(|(name, _)| {
        name.starts_with("CARGO") || name.starts_with("RUST") && name != "RUSTUP_HOME"
    }) {
        if name != "CARGO_HOME" {
            command.env_remove(name);
        }
    }
    command
}

#[test]
fn no_decoder_breaks_on_bytes_made_up_by_a_fuzzer() {
    if !is_long() {
        return;
    }
    let seconds = std::env::var("FUZZ_SECONDS").unwrap_or_else(|_| SECONDS.to_owned());
    let output = command("sh", "fuzz").args(["run.sh", &seconds]).output().expect("a shell");
    let (said, complained) =
        (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "{said}{complained}");
    assert_eq!(said.matches("DONE").count(), names().len(), "not every target ended:\n{said}");
    aloud!("{said}");
}

#[test]
fn miri_finds_nothing_in_the_codecs() {
    if !is_long() {
        return;
    }
    let has_miri = command("cargo", "fuzz/miri").args(["+nightly", "miri", "--version"]).output();
    if !has_miri.is_ok_and(|output| output.status.success()) {
        aloud!("SKIPPED: no nightly compiler with Miri is installed, so the codecs ran without it");
        return;
    }
    let output = command("cargo", "fuzz/miri")
        // An interpreter is a thousand times slower: the properties are left to the fuzzer above.
        .args(["+nightly", "miri", "test", "--lib", "--", "--skip", "properties"])
        .env("MIRIFLAGS", "-Zmiri-disable-isolation")
        .output()
        .expect("cargo");
    let (said, complained) =
        (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "{said}{complained}");
    assert!(said.contains("test result: ok."), "no test ran:\n{said}{complained}");
    aloud!("{}", said.lines().last().unwrap_or_default());
}
