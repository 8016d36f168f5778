//! TOML of strangers: what it takes to read it is estimated before it is read.
//!
//! A TOML parser keeps every token, list and table of a file. Tokens of one byte take 48, a table
//! of four letters takes a thousand: 1 MiB of `[a1.b.c.d]` took 428 MB (toml 1.2.1). The estimate
//! counts with the parser's own lexer, and with the sizes of what it keeps.

use serde::de::{DeserializeOwned, Error as _};
use std::borrow::Cow;
use toml::Spanned;
use toml::de::DeValue;
use toml_parser::Source;
use toml_parser::lexer::{Token, TokenKind};

/// What reading a TOML file may take beside [`PER_BYTE`] times its size, bytes.
const ALWAYS_BYTES: usize = 15 << 20;
const PER_BYTE: usize = 2;

/// Reads TOML as [`toml::from_str`] does, in memory that stays in proportion: at most four times
/// the text and 16 MiB.
///
/// # Errors
/// As [`toml::from_str`]; a text of so many lines, lists and tables that reading it would take more.
pub fn from_toml<T: DeserializeOwned>(text: &str) -> Result<T, toml::de::Error> {
    let (needed, allowed) = (Structure::of(text).bytes(text), ALWAYS_BYTES + PER_BYTE * text.len());
    if needed > allowed {
        return Err(toml::de::Error::custom(format!(
            "the file has too many lines, lists and tables: reading it would take {} MiB, allowed \
             are {} MiB; split it",
            needed.div_ceil(1 << 20),
            allowed >> 20
        )));
    }
    toml::from_str(text)
}

/// What the estimate says that [`from_toml`] takes at most for the tables and lists of a text, bytes.
#[must_use]
pub fn toml_bytes(text: &str) -> usize {
    Structure::of(text).bytes(text)
}

/// How much of everything a parser keeps of a text.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Structure {
    tokens: usize,
    tables: usize,
    entries: usize,
    lists: usize,
    items: usize,
}

impl Structure {
    /// Counts. Of a text that is no TOML rather too much than too little.
    fn of(text: &str) -> Self {
        let mut found = Self::default();
        // The brackets that are open: true for a list, false for a table in braces.
        let mut open: Vec<bool> = Vec::new();
        let (mut in_value, mut dots) = (false, 0);
        for token in Source::new(text).lex() {
            found.tokens += 1;
            match token.kind() {
                // The first dot of a value may be a number's.
                TokenKind::Dot => {
                    dots += 1;
                    if !in_value || dots > 1 {
                        found.tables += 1;
                        found.entries += 1;
                    }
                }
                TokenKind::Equals => {
                    found.entries += 1;
                    in_value = true;
                    // No key stands in a list: it was never closed, and the parser goes on without.
                    if open.last() == Some(&true) {
                        open.clear();
                    }
                }
                TokenKind::LeftSquareBracket if in_value => {
                    found.lists += 1;
                    open.push(true);
                }
                // A heading: a table, in another or in a list of tables.
                TokenKind::LeftSquareBracket => {
                    found.tables += 1;
                    found.entries += 1;
                    found.lists += 1;
                }
                TokenKind::LeftCurlyBracket => {
                    found.tables += 1;
                    open.push(false);
                    in_value = false;
                }
                TokenKind::RightSquareBracket if open.last() == Some(&true) => drop(open.pop()),
                TokenKind::RightCurlyBracket if open.last() == Some(&false) => {
                    open.pop();
                    in_value = true;
                }
                TokenKind::Comma => {
                    found.items += 1;
                    in_value = open.last() == Some(&true);
                }
                TokenKind::Newline => in_value = open.last() == Some(&true),
                _ => {}
            }
            if ends_a_word(token) {
                dots = 0;
            }
        }
        found
    }

    fn bytes(self, text: &str) -> usize {
        let value = size_of::<Spanned<DeValue>>();
        let entry = value + size_of::<Spanned<Cow<str>>>();
        // The lexer's guess, doubled until it is enough; then an event for each token.
        let mut capacity = (text.len() / 7 * 2).max(4);
        while capacity < self.tokens {
            capacity *= 2;
        }
        let tokens = (capacity + self.tokens) * size_of::<Token>();
        // A node of a B-tree holds eleven entries, at least five of them; the first node of a table
        // is there with its first entry.
        let nodes = self.tables * (11 * entry + 16) + self.entries * entry * 5 / 2;
        // A list begins with room for four and doubles.
        let lists = self.lists * 4 * value + self.items * 2 * value;
        tokens + nodes + lists
    }
}

/// True for what cannot stand within a number or a dotted key.
fn ends_a_word(token: Token) -> bool {
    !matches!(token.kind(), TokenKind::Atom | TokenKind::Dot)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;
    use std::path::{Path, PathBuf};

    fn files(folder: &Path, found: &mut Vec<PathBuf>) {
        for entry in fs::read_dir(folder).expect("a folder") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                files(&path, found);
            } else if path.extension().is_some_and(|ending| ending == "toml") {
                found.push(path);
            }
        }
    }

    #[test]
    fn what_is_shipped_takes_less_than_a_tenth_of_what_is_allowed() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR"));
        let mut found = Vec::new();
        for folder in ["actuators", "adapters", "robots", "sensors", "servos", "../actions"] {
            files(&root.join(folder), &mut found);
        }
        assert!(found.len() > 100, "only {} files", found.len());
        for path in found {
            let text = fs::read_to_string(&path).expect("a text");
            let needed = toml_bytes(&text);
            assert!(needed < ALWAYS_BYTES / 10, "{}: {needed} bytes", path.display());
        }
    }

    #[test]
    fn tables_lists_and_their_parts_are_counted_where_they_stand() {
        let counts = |text: &str| {
            let Structure { tables, entries, lists, items, .. } = Structure::of(text);
            (tables, entries, lists, items)
        };
        for (text, expected) in [
            ("a = 1.5\nb = \"c.d\" # [e]\n", (0, 2, 0, 0)),
            ("a.b = -0.25e1\n", (1, 2, 0, 0)),
            ("a . b = 1\n", (1, 2, 0, 0)),
            ("[a.b]\nc = 1\n", (2, 3, 1, 0)),
            ("a = [1.5, [2.5, 3.5],\n4.5]\nb.c = 1\n", (1, 3, 2, 3)),
            ("a = { b.c = 1.5, d = [0.5] }\ne.f = 1\n", (3, 6, 1, 1)),
            ("a = [{ b = 1 }, { c.d = 1 }]\n", (3, 4, 1, 1)),
            // A version or a time is a text; a key of numbers is a key.
            ("1.2 = 1\na = 1.2.3\n", (2, 4, 0, 0)),
            // What never ends must not hide what follows.
            ("a = {\nb.c = 1\nd.e = 1\n", (3, 5, 0, 0)),
            ("a = [1,\nb = 1\n[[c]]\nd.e = 1\n", (3, 6, 3, 1)),
        ] {
            assert_eq!(counts(text), expected, "{text}");
        }
    }

    #[test]
    fn a_text_of_too_much_structure_is_refused_and_a_smaller_one_read() {
        let of = |lines: usize| {
            let text: String = (0..lines).map(|n| format!("[a{n}.b.c.d]\n")).collect();
            from_toml::<toml::Table>(&text)
        };
        assert_eq!(of(1000).expect("not too much").len(), 1000);
        let error = of(50_000).expect_err("too much").to_string();
        assert!(error.contains("too many lines, lists and tables"), "{error}");
    }
}
