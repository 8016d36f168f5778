//! docs/words.md is true: its words are in order and stand once, and every type name that several rooms
//! have is in its table with all of them.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The rows of the table under a heading, cell by cell.
fn table(text: &str, heading: &str) -> Vec<Vec<String>> {
    let part = text.split("\n## ").find(|part| part.starts_with(heading)).expect("a part");
    let rows = part.lines().filter(|line| line.starts_with("| ") || line.starts_with("|-"));
    let cells = |row: &str| -> Vec<String> {
        row.trim_matches('|').split(" | ").map(|cell| cell.trim().to_owned()).collect()
    };
    rows.skip(2).map(cells).collect()
}

fn words() -> String {
    std::fs::read_to_string(root().join("docs/words.md")).expect("docs/words.md")
}

#[test]
fn words_stand_once_and_in_order_each_with_its_meaning() {
    let rows = table(&words(), "# Words");
    assert!(rows.len() > 50, "{} words", rows.len());
    let of = |row: &[String]| row[0].replace(['(', ')'], "").to_lowercase();
    for pair in rows.windows(2) {
        assert!(of(&pair[0]) < of(&pair[1]), "{} before {}", pair[0][0], pair[1][0]);
    }
    for row in &rows {
        assert!(row.len() == 2 && row[1].len() > 8, "{row:?}");
    }
}

fn rust_files(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default().to_owned();
        if path.is_dir() && !name.starts_with("test") {
            rust_files(&path, found);
        } else if name.ends_with(".rs") && !name.starts_with("test") {
            found.push(path);
        }
    }
}

/// The public types of each room of `src`, by name.
fn rooms_by_type() -> BTreeMap<String, BTreeSet<String>> {
    let src = root().join("src");
    let mut files = Vec::new();
    rust_files(&src, &mut files);
    let mut found: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for file in files {
        let within = file.strip_prefix(&src).expect("in src");
        let room = within.iter().next().expect("a room").to_string_lossy().replace(".rs", "");
        let text = std::fs::read_to_string(&file).expect("a source file");
        for line in text.lines().map(str::trim_start) {
            let kinds = ["pub struct ", "pub enum ", "pub trait ", "pub type "];
            let Some(rest) = kinds.iter().find_map(|kind| line.strip_prefix(kind)) else {
                continue;
            };
            let name: String = rest.chars().take_while(|c| c.is_alphanumeric()).collect();
            found.entry(name).or_default().insert(room.clone());
        }
    }
    found
}

#[test]
fn a_type_name_of_several_rooms_is_listed_with_all_of_them_and_no_other_is() {
    let several: BTreeMap<String, BTreeSet<String>> =
        rooms_by_type().into_iter().filter(|(_, rooms)| rooms.len() > 1).collect();
    let listed: BTreeMap<String, BTreeSet<String>> = table(&words(), "One name, several types")
        .into_iter()
        .map(|row| {
            let rooms = row[1].split(", ").map(|room| room.trim_matches('`').to_owned()).collect();
            (row[0].trim_matches('`').to_owned(), rooms)
        })
        .collect();
    assert_eq!(listed, several);
}
