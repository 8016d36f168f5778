//! House rules that a machine can hold.

mod aloud;

use aloud::aloud;
use std::path::Path;
use std::process::Command;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

#[test]
fn the_sources_are_formatted() {
    let Ok(run) =
        Command::new("cargo").args(["fmt", "--all", "--check"]).current_dir(root()).output()
    else {
        aloud!("SKIPPED: cargo fmt is not installed");
        return;
    };
    let said = String::from_utf8_lossy(&run.stderr);
    if said.contains("is not installed") || said.contains("no such command") {
        aloud!("SKIPPED: rustfmt is not installed");
        return;
    }
    assert!(
        run.status.success(),
        "run `cargo fmt --all`:\n{}",
        String::from_utf8_lossy(&run.stdout)
    );
}

#[test]
fn the_documentation_is_made_without_a_warning() {
    // In a folder of its own: whoever runs the tests holds the usual one.
    let made = Command::new("cargo")
        .args(["doc", "--workspace", "--no-deps", "--quiet", "--target-dir"])
        .arg(Path::new(env!("CARGO_TARGET_TMPDIR")).join("doc"))
        .env("RUSTDOCFLAGS", "-D warnings")
        .current_dir(root())
        .output()
        .expect("cargo");
    assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
}

fn text_files(folder: &Path, found: &mut Vec<std::path::PathBuf>) {
    for entry in std::fs::read_dir(folder).expect("a readable folder") {
        let path = entry.expect("a readable entry").path();
        let name = path.file_name().and_then(|n| n.to_str()).unwrap_or_default();
        if path.is_dir() && !matches!(name, "target" | ".git" | "corpus" | "artifacts") {
            text_files(&path, found);
        } else if path.extension().is_some_and(|e| e == "rs" || e == "toml" || e == "md") {
            found.push(path);
        }
    }
}

#[test]
fn nothing_is_left_for_later() {
    let mut files = Vec::new();
    text_files(root(), &mut files);
    assert!(files.len() > 50, "only {} files found", files.len());
    // Put together here so that this file does not contain them.
    let marks = [["TO", "DO"].concat(), ["FIX", "ME"].concat(), ["unimplement", "ed!"].concat()];
    for file in files {
        let text = std::fs::read_to_string(&file).expect("a text file");
        for mark in &marks {
            assert!(!text.contains(mark.as_str()), "{} contains {mark}", file.display());
        }
    }
}

#[test]
fn no_crate_contains_unsafe_code() {
    for manifest in ["Cargo.toml", "firmware-profiles/Cargo.toml", "sim/Cargo.toml"] {
        let text = std::fs::read_to_string(root().join(manifest)).expect("a manifest");
        assert!(
            text.contains("[lints]\nworkspace = true"),
            "{manifest} leaves the workspace lints"
        );
    }
    let workspace = std::fs::read_to_string(root().join("Cargo.toml")).expect("a manifest");
    assert!(workspace.contains("unsafe_code = \"forbid\""));
}
