//! Numbers with the words that go with them.

use std::fmt::Display;

/// The word that goes with so many: `either(1, "is", "are")` is `is`, and of all other numbers `are`.
#[must_use]
pub fn either<'a>(count: impl Display, one: &'a str, more: &'a str) -> &'a str {
    if count.to_string() == "1" { one } else { more }
}

/// So many of these: `1 sample`, `2 samples`, `0 entries`, `3 good repetitions`, `22 degrees of freedom`.
#[must_use]
pub fn counted(count: impl Display, one: &str) -> String {
    let count = count.to_string();
    format!("{count} {}", either(&count, one, &several(one)))
}

/// What one of these is called where there are several.
fn several(one: &str) -> String {
    if let Some((head, of)) = one.split_once(" of ") {
        return format!("{} of {of}", several(head));
    }
    if let Some(before) = one.strip_suffix("person") {
        return format!("{before}people");
    }
    let is_vowel = |c: char| "aeiou".contains(c);
    match one.strip_suffix('y') {
        Some(before) if !before.ends_with(is_vowel) => format!("{before}ies"),
        _ if ["s", "x", "ch", "sh"].iter().any(|end| one.ends_with(end)) => format!("{one}es"),
        _ => format!("{one}s"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_is_told_as_one_and_none_and_two_as_several() {
        for (one, two) in [
            ("sample", "samples"),
            ("good repetition", "good repetitions"),
            ("degree of freedom", "degrees of freedom"),
            ("entry", "entries"),
            ("day", "days"),
            ("address", "addresses"),
            ("box", "boxes"),
            ("branch", "branches"),
            ("mesh", "meshes"),
            ("person", "people"),
        ] {
            assert_eq!(counted(0, one), format!("0 {two}"));
            assert_eq!(counted(1_usize, one), format!("1 {one}"));
            assert_eq!(counted(2_u8, one), format!("2 {two}"));
        }
        assert_eq!(counted(1.0, "hour"), "1 hour");
        assert_eq!(counted(1.5, "hour"), "1.5 hours");
        assert_eq!(counted(-1, "count"), "-1 counts");
    }

    #[test]
    fn a_verb_goes_with_its_number() {
        assert_eq!([0, 1, 2].map(|n| either(n, "is", "are")), ["are", "is", "are"]);
        assert_eq!(either(11, "has", "have"), "have");
    }
}
