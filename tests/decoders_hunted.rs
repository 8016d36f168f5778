//! Fuzzing and Miri, briefly: every decoder on bytes made up by libFuzzer, and the codecs under the
//! interpreter that sees undefined behaviour. Both build much and take minutes, so they run where
//! `CI` is set; by hand they are `fuzz/run.sh` and the command in `fuzz/miri`. `FUZZ_SECONDS` says for
//! how long each target runs.

mod aloud;

use aloud::aloud;
use std::path::Path;
use std::process::Command;

/// Seconds for each fuzz target, unless the environment says otherwise.
const SECONDS: &str = "5";

fn in_ci() -> bool {
    std::env::var_os("CI").is_some()
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
    if !in_ci() {
        aloud!("SKIPPED: fuzzing runs where CI is set; by hand: fuzz/run.sh {SECONDS}");
        return;
    }
    let seconds = std::env::var("FUZZ_SECONDS").unwrap_or_else(|_| SECONDS.to_owned());
    let output = command("sh", "fuzz").args(["run.sh", &seconds]).output().expect("a shell");
    let (said, complained) =
        (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "{said}{complained}");
    let targets = std::fs::read_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/fuzz/src/targets"));
    let targets = targets.expect("the folder of targets").count();
    assert_eq!(said.matches("DONE").count(), targets, "not every target ran to its end:\n{said}");
    aloud!("{said}");
}

#[test]
fn miri_finds_nothing_in_the_codecs() {
    if !in_ci() {
        aloud!("SKIPPED: Miri runs where CI is set; by hand: see fuzz/miri/src/lib.rs");
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
