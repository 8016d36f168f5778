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

/// The tests that a document names: a file in the open, and after it names of tests in backquotes.
fn named_tests(text: &str) -> Vec<(String, String)> {
    let is_file = |word: &str| {
        let rooms = ["tests/", "src/", "sim/", "firmware-profiles/"];
        rooms.iter().any(|room| word.starts_with(room)) && word.ends_with(".rs")
    };
    // Lower case with underscores; shorter names in backquotes are functions and fields.
    let is_test = |word: &str| {
        word.matches('_').count() >= 4
            && word.bytes().all(|b| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'_')
    };
    let mut named = Vec::new();
    for cell in text.split(['\n', '|']) {
        let mut file = None;
        for word in cell.split([' ', '`', ',', '(', ')']).filter(|word| !word.is_empty()) {
            if is_file(word) {
                file = Some(word);
            } else if let Some(file) = file.filter(|_| is_test(word)) {
                named.push((file.to_owned(), word.to_owned()));
            }
        }
    }
    named
}

#[test]
fn every_test_that_a_document_names_after_its_file_exists() {
    let mut documents = Vec::new();
    text_files(&root().join("docs"), &mut documents);
    documents.retain(|path| path.extension().is_some_and(|end| end == "md"));
    documents.extend(["SAFETY.md", "ARCHITECTURE.md"].map(|name| root().join(name)));
    let (mut count, mut missing) = (0, Vec::new());
    for path in &documents {
        let text = std::fs::read_to_string(path).expect("a document");
        for (file, name) in named_tests(&text) {
            let source = std::fs::read_to_string(root().join(&file)).unwrap_or_default();
            count += 1;
            if !source.contains(&format!("fn {name}(")) {
                missing.push(format!("{}: {file} has no {name}", path.display()));
            }
        }
    }
    assert_eq!(missing, [""; 0]);
    assert!(count > 150, "{count}");
}
