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

/// Files whose words people read: of the three crates, of the page, of the Python package. Tests are none.
fn files_with_words() -> Vec<PathBuf> {
    let mut files = Vec::new();
    for folder in ["src", "sim/src", "firmware-profiles/src"] {
        rust_files(&root().join(folder), &mut files);
    }
    for folder in ["src/view/page", "python/gaitway"] {
        let entries = std::fs::read_dir(root().join(folder)).expect("a folder");
        files.extend(entries.map(|entry| entry.expect("an entry").path()).filter(|path| {
            path.extension().is_some_and(|ending| ending == "js" || ending == "py")
        }));
    }
    files.retain(|path| {
        !["tests.rs", "properties.rs"].iter().any(|end| path.to_string_lossy().ends_with(end))
    });
    files.sort();
    files
}

/// Where a text that began with `mark` ends, and where the code goes on behind it. What is behind a backslash ends nothing.
fn closed(text: &str, from: usize, mark: &str) -> (usize, usize) {
    let mut at = from;
    while let Some(rest) = text.get(at..).filter(|rest| !rest.is_empty()) {
        if rest.starts_with(mark) {
            return (at, at + mark.len());
        }
        let escaped = usize::from(rest.starts_with('\\'));
        at += rest.chars().take(1 + escaped).map(char::len_utf8).sum::<usize>();
    }
    (text.len(), text.len())
}

/// The texts in quotes of a source, each with the number of its line; what is said in comments is left out, and so are tests.
fn quoted(source: &str, ending: &str) -> Vec<(usize, String)> {
    let source = source.split("#[cfg(test)]\nmod tests {").next().unwrap_or_default();
    let (comment, marks) = match ending {
        "rs" => ("//", ["\"", "\"", "\""]),
        "js" => ("//", ["`", "\"", "'"]),
        _ => ("#", ["\"\"\"", "\"", "'"]),
    };
    let mut found = Vec::new();
    let mut at = 0;
    while let Some(rest) = source.get(at..).filter(|rest| !rest.is_empty()) {
        if rest.starts_with(comment) {
            at += rest.find('\n').unwrap_or(rest.len());
        } else if ending == "rs" && (rest.starts_with("'\"'") || rest.starts_with("'\\")) {
            at += 3;
        } else if let Some(hashes) =
            ["r###\"", "r##\"", "r#\""].iter().find(|raw| rest.starts_with(**raw))
        {
            let end = format!("\"{}", &hashes[1..hashes.len() - 1]);
            at += hashes.len() + rest[hashes.len()..].find(&end).unwrap_or(0) + end.len();
        } else if let Some(mark) = marks.iter().find(|mark| rest.starts_with(**mark)) {
            let (end, next) = closed(source, at + mark.len(), mark);
            let line = source[..at].matches('\n').count() + 1;
            found.push((line, joined(&source[at + mark.len()..end])));
            at = next;
        } else {
            at += rest.chars().next().map_or(1, char::len_utf8);
        }
    }
    found
}

/// A text that goes on in the next line of its source, as it is read.
fn joined(text: &str) -> String {
    let mut lines = text.split("\\\n");
    let first = lines.next().unwrap_or_default().to_owned();
    lines.fold(first, |all, line| all + line.trim_start())
}

/// What stands behind a name or is no number of things: verbs, and units that have one form.
const NO_NOUNS: [&str; 47] = [
    "across",
    "allows",
    "as",
    "becomes",
    "begins",
    "belongs",
    "bends",
    "bps",
    "calls",
    "changes",
    "claims",
    "comes",
    "corpus",
    "differs",
    "does",
    "draws",
    "ends",
    "exists",
    "flies",
    "gives",
    "goes",
    "has",
    "is",
    "its",
    "knows",
    "leaves",
    "lists",
    "listens",
    "looks",
    "mass",
    "moves",
    "ms",
    "needs",
    "ns",
    "restart-ms",
    "takes",
    "wears",
    "rests",
    "says",
    "seems",
    "series",
    "speaks",
    "stands",
    "this",
    "turns",
    "us",
    "was",
];
/// What may stand between a number and its noun.
const BETWEEN: [&str; 14] = [
    "analog", "driven", "finite", "good", "key", "limb", "line", "more", "other", "rest", "such",
    "usable", "whole", "worn",
];
/// Where a number stands before several all the same, with the reason.
const SEVERAL_ALL_THE_SAME: [(&str, &str, &str); 13] = [
    ("bus/codec.rs", "{self} answers", "a verb: a protocol answers"),
    ("c3d/check.rs", "{channels} times", "a product"),
    ("c3d/check.rs", "{per_frame} times", "a product"),
    ("c3d/meaning.rs", "{needed} channels", "a plate has six or eight"),
    ("firmware-profiles/src/counted.rs", "{one}s", "here several are made of one"),
    ("job/robot_draft.rs", "{place} answers", "a verb: a device answers"),
    ("job/scan/can.rs", "{id} answers", "a verb: a device answers"),
    ("job/servo/change.rs", "{id} answers", "a verb: a device answers"),
    ("job/servo/change.rs", "{} answers", "a verb: a device answers"),
    ("model/file.rs", "{} limb lengths", "a range"),
    ("retarget/figures.rs", "{two} are", "two shapes"),
    ("src/wire.rs", "{bytes} bytes", "more than a packet holds"),
    ("src/wire.rs", "{claimed} bytes", "a packet has a head"),
];

/// True of what is put in where it is no number of things: a constant, which is not 1, or a number with decimals.
fn is_no_count(inside: &str) -> bool {
    let (name, format) = inside.split_once(':').unwrap_or((inside, ""));
    let is_constant = name.starts_with(char::is_uppercase) && name.len() > 1 && !name.contains('(');
    is_constant || format.contains('.') || inside.contains(".toFixed(") || inside.contains(".join(")
}

/// What in a text is right for several only: `{n} samples`, `{n} are`, `(s)`, `{one}s`.
fn of_several_only(text: &str) -> Vec<String> {
    let mut found = Vec::new();
    if text.contains("(s)") {
        found.push("(s)".to_owned());
    }
    let mut from = 0;
    while let Some(end) = text[from..].find('}').map(|at| from + at) {
        let begin = text[from..end].rfind('{').map(|at| from + at);
        from = end + 1;
        let Some(begin) = begin else { continue };
        let (before, inside, behind) = (&text[..begin], &text[begin + 1..end], &text[end + 1..]);
        if is_no_count(inside) {
            continue;
        }
        let is_word = |c: char| c.is_ascii_lowercase() || c == '-';
        if behind.strip_prefix('s').is_some_and(|rest| !rest.starts_with(is_word))
            && !inside.ends_with("_s")
        {
            found.push(format!("{{{inside}}}s"));
        }
        let Some(behind) = behind.strip_prefix(' ') else { continue };
        let mut words: Vec<&str> = Vec::new();
        let mut rest = behind;
        while words.len() < 2 {
            let length = rest.find(|c| !is_word(c)).unwrap_or(rest.len());
            let (word, after) = rest.split_at(length);
            // A unit: `samples/s`. A key: `bytes=`.
            words.push(if after.starts_with(['/', '=', '(']) { "" } else { word });
            match after.strip_prefix(' ') {
                Some(after) => rest = after,
                None => break,
            }
        }
        let noun = match words[..] {
            [between, noun] if BETWEEN.contains(&between) => noun,
            [noun, ..] => noun,
            [] => continue,
        };
        let is_plural = noun == "people" || noun.len() > 2 && noun.ends_with('s');
        let told = format!("{{{inside}}} {}", behind.split_once(noun).map_or("", |(a, _)| a));
        if is_plural && !NO_NOUNS.contains(&noun) && !noun.starts_with('-') {
            found.push(format!("{told}{noun}"));
        }
        // `0 to {n} are allowed`, and of what came before: `of {n} are`.
        let of_another = [" to ", "..", "of ", "joint "].iter().any(|end| before.ends_with(end));
        if ["are", "were", "have", "do"].contains(&words[0]) && !of_another {
            found.push(format!("{{{inside}}} {}", words[0]));
        }
    }
    found
}

#[test]
fn what_is_right_for_several_only_is_found_in_a_text() {
    for text in [
        "{samples} samples are missing",
        "{} people",
        "{n} good repetitions",
        "{} device(s)",
        "and {lost} are not there",
        "{count} {what}s",
        "${told.length} events",
    ] {
        assert_ne!(of_several_only(text), [""; 0], "{text}");
    }
    for text in [
        "{samples} {are} missing",
        "at most {MAX_FRAMES} frames",
        "{name} stands twice",
        "{:.1} seconds",
        "{} samples/s",
        "from {low} to {high} are allowed",
        "{from_s}s..{to_s}s",
    ] {
        assert_eq!(of_several_only(text), [""; 0], "{text}");
    }
    let source = "// {} samples\nlet a = \"x \\\"{} frames\\\"\"; let b = '\"'; f(\"{} of \\\n   {n} joints\");";
    let texts = [(2, "x \\\"{} frames\\\"".to_owned()), (2, "{} of {n} joints".to_owned())];
    assert_eq!(quoted(source, "rs"), texts);
}

/// `1 samples are missing`: whoever says a number says it by `counted`, and its verb by `either`.
#[test]
fn no_text_has_a_number_before_words_that_are_right_for_several_only() {
    let mut wrong = Vec::new();
    let mut used = BTreeSet::new();
    let files = files_with_words();
    assert!(files.len() > 400, "{} files", files.len());
    for file in files {
        let name =
            file.strip_prefix(root()).expect("in the project").to_string_lossy().into_owned();
        let source = std::fs::read_to_string(&file).expect("a source file");
        let ending = file.extension().unwrap_or_default().to_string_lossy().into_owned();
        for (line, text) in quoted(&source, &ending) {
            for found in of_several_only(&text) {
                let excuse = SEVERAL_ALL_THE_SAME
                    .iter()
                    .position(|(place, what, _)| name.ends_with(place) && found == *what);
                match excuse {
                    Some(excuse) => {
                        used.insert(excuse);
                    }
                    None => wrong.push(format!("{name}:{line}: `{found}` in {text:?}")),
                }
            }
        }
    }
    assert!(
        wrong.is_empty(),
        "say these by error::counted and error::either (a verb that follows a name: NO_NOUNS):\n{}",
        wrong.join("\n")
    );
    let idle: Vec<_> = (0..SEVERAL_ALL_THE_SAME.len())
        .filter(|at| !used.contains(at))
        .map(|at| SEVERAL_ALL_THE_SAME[at])
        .collect();
    assert!(idle.is_empty(), "no such place any more: {idle:?}");
}
