//! Tables of what tests hold, which a document repeats line by line.

use std::path::Path;

/// A test that holds something: its file, its name, and how many cases it must have run; 0 where that
/// is not counted.
pub type Held = (&'static str, &'static str, u64);

/// The tests as a cell of a table; a file is named where it changes.
pub fn named(held_by: &[Held]) -> String {
    let mut file = "";
    let mut tests = Vec::new();
    for (of, name, _) in held_by {
        let place = if *of == file { String::new() } else { format!("{of} ") };
        file = of;
        tests.push(format!("{place}`{name}`"));
    }
    tests.join(", ")
}

/// Which of these tests do not exist.
pub fn missing<'a>(held_by: impl IntoIterator<Item = &'a Held>) -> Vec<String> {
    let mut missing = Vec::new();
    for (file, name, _) in held_by {
        let text = std::fs::read_to_string(root().join(file)).unwrap_or_default();
        if !has_test(&text, name) {
            missing.push(format!("{file} has no test {name}"));
        }
    }
    missing
}

/// True if `text` has a test of this name; one with hyphens is a case of a harness of its own.
pub fn has_test(text: &str, name: &str) -> bool {
    if name.contains('-') {
        return text.contains(&format!("(\"{name}\","));
    }
    let Some(at) = text.find(&format!("fn {name}(")) else { return false };
    let before: Vec<&str> = text[..at].lines().rev().take(4).collect();
    before.iter().any(|line| line.trim() == "#[test]")
}

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

pub fn every_source() -> Vec<String> {
    let mut folders = vec![
        root().join("tests"),
        root().join("src"),
        root().join("sim/tests"),
        root().join("firmware-profiles/tests"),
    ];
    let mut texts = Vec::new();
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).expect("a folder") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|end| end == "rs") {
                texts.push(std::fs::read_to_string(path).expect("a source"));
            }
        }
    }
    texts
}

pub fn read(document: &str) -> String {
    std::fs::read_to_string(root().join(document)).expect("a document")
}

/// The rows of a document's table are these: lines whose first cell is an identifier.
pub fn assert_repeated(document: &str, is_id: impl Fn(&str) -> bool, lines: &[String]) {
    let text = read(document);
    let written: Vec<&str> = text.lines().filter(|line| is_row(line, &is_id)).collect();
    for (line, wanted) in written.iter().zip(lines) {
        assert_eq!(line, wanted, "{document} differs from the suite");
    }
    assert_eq!(written.len(), lines.len(), "{document} has other rows");
}

/// Puts these rows in the place of those that a document has.
pub fn rewrite(document: &str, is_id: impl Fn(&str) -> bool, lines: &[String]) {
    let text = read(document);
    let rest: Vec<&str> = text.lines().filter(|line| !is_row(line, &is_id)).collect();
    let head = rest.iter().position(|line| line.starts_with("|---|")).expect("the head of a table");
    let rows: Vec<&str> = lines.iter().map(String::as_str).collect();
    let all = [&rest[..=head], &rows, &rest[head + 1..]].concat();
    std::fs::write(root().join(document), all.join("\n") + "\n").expect("a document");
}

fn is_row(line: &str, is_id: impl Fn(&str) -> bool) -> bool {
    let id = line.strip_prefix("| ").and_then(|rest| rest.split(' ').next());
    id.is_some_and(is_id)
}
