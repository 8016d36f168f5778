//! What a reader of TOML has against a file, in words of the file instead of the program's types.

/// As far apart as a key that was mistyped may be from the one that was meant, a part of its length.
const MISTYPED: f64 = 0.34;

/// A reader's message in plain words; one that is not known stays as it is.
#[must_use]
pub fn plain_words(message: &str) -> String {
    known(message).unwrap_or_else(|| message.to_owned())
}

fn known(message: &str) -> Option<String> {
    if let Some(rest) = message.strip_prefix("missing field ") {
        return Some(format!("the key {rest} is missing"));
    }
    if let Some(rest) = message.strip_prefix("duplicate field ") {
        return Some(format!("the key {rest} is there twice"));
    }
    for (begins, what, all) in [
        ("unknown field `", "there is no key", "the keys here are"),
        ("unknown variant `", "there is no choice", "the choices here are"),
    ] {
        let Some((word, rest)) = message.strip_prefix(begins).and_then(|m| m.split_once('`'))
        else {
            continue;
        };
        let names: Vec<&str> = rest.split('`').skip(1).step_by(2).collect();
        let meant = nearest(word, &names).map(|name| format!("; did you mean `{name}`?"));
        let listed = match names.as_slice() {
            [] => String::new(),
            names => format!("; {all} {}", names.join(", ")),
        };
        return Some(format!("{what} `{word}`{}{listed}", meant.unwrap_or_default()));
    }
    let (found, expected) = message.split_once(", expected ")?;
    let found = found.strip_prefix("invalid type: ").or(found.strip_prefix("invalid value: "));
    Some(format!("{}, where {} belongs", value(found?), kind(expected)))
}

/// The name that a mistyped one is near to, if there is just one.
fn nearest<'a>(word: &str, names: &[&'a str]) -> Option<&'a str> {
    let small = word.to_lowercase();
    let apart = |name: &str| strsim::damerau_levenshtein(&small, &name.to_lowercase());
    let best = names.iter().copied().min_by_key(|name| apart(name))?;
    if names.iter().filter(|name| apart(name) == apart(best)).count() > 1 {
        return None;
    }
    let length = best.chars().count().max(word.chars().count());
    (apart(best) as f64 <= MISTYPED * length as f64).then_some(best)
}

/// So many names at most are said to have been meant by the beginning of them.
const MOST_MEANT: usize = 4;
/// A shorter beginning may be that of anything.
const LEAST_BEGINNING: usize = 2;

/// The names that a word was meant to be: the one it is near to, or the few that begin with it, in any letters.
fn meant<'a>(word: &str, names: &[&'a str]) -> Vec<&'a str> {
    if let Some(near) = nearest(word, names) {
        return vec![near];
    }
    let plain = |name: &str| name.to_lowercase().replace('_', "-");
    let begins: Vec<&str> =
        names.iter().copied().filter(|name| plain(name).starts_with(&plain(word))).collect();
    let is_told = word.chars().count() >= LEAST_BEGINNING && begins.len() <= MOST_MEANT;
    if is_told { begins } else { Vec::new() }
}

/// What to do about a name that is none of these: take the one that was meant, or else `otherwise`.
#[must_use]
pub fn advice(name: &str, names: &[&str], otherwise: &str) -> String {
    match meant(name, names).split_last() {
        Some((last, [])) => format!("did you mean {last}? If not, {otherwise}"),
        Some((last, others)) => {
            format!("did you mean {} or {last}? If not, {otherwise}", others.join(", "))
        }
        None => otherwise.to_owned(),
    }
}

/// `string "two"` as `the text "two"`.
fn value(found: &str) -> String {
    let in_ticks = |before: &str| found.strip_prefix(before)?.strip_suffix('`').map(str::to_owned);
    if let Some(text) = found.strip_prefix("string ") {
        return format!("the text {text}");
    }
    let number = in_ticks("integer `").or_else(|| in_ticks("floating point `"));
    if let Some(number) = number {
        return format!("the number {number}");
    }
    match found {
        "sequence" => "a list".to_owned(),
        "map" => "a table".to_owned(),
        _ => in_ticks("boolean `").unwrap_or_else(|| found.to_owned()),
    }
}

/// `u8` as `a whole number from 0 to 255`.
fn kind(expected: &str) -> String {
    let list = ["an array of length ", "a tuple of size "];
    if let Some(count) = list.iter().find_map(|before| expected.strip_prefix(before)) {
        return format!("a list of {count}");
    }
    let words = match expected {
        "f32" | "f64" => "a number",
        "u8" => "a whole number from 0 to 255",
        "u16" => "a whole number from 0 to 65535",
        "u32" | "u64" | "usize" => "a whole number, 0 or above,",
        "i8" | "i16" | "i32" | "i64" | "isize" => "a whole number",
        "a string" => "a text",
        "a sequence" => "a list",
        "a boolean" => "true or false",
        "a map" => "a table",
        other if other.starts_with("struct ") => "a table",
        other => other,
    };
    words.to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde::Deserialize;

    #[derive(Debug, Deserialize)]
    #[serde(deny_unknown_fields)]
    #[allow(dead_code)]
    struct Arm {
        name: String,
        #[serde(default)]
        id: u8,
        #[serde(default)]
        upper_rad: f64,
        #[serde(default)]
        axis: [f64; 3],
        #[serde(default)]
        kind: Kind,
        #[serde(default)]
        links: Vec<f64>,
    }

    #[derive(Debug, Default, Deserialize)]
    #[serde(rename_all = "lowercase")]
    enum Kind {
        #[default]
        Serial,
        Can,
    }

    fn said(text: &str) -> String {
        let refused = crate::from_toml::from_toml::<Arm>(text).expect_err(text);
        plain_words(refused.message())
    }

    #[test]
    fn messages_speak_of_keys_numbers_lists_and_texts() {
        assert_eq!(said("id = 1"), "the key `name` is missing");
        let wrong = |line: &str| said(&format!("name = \"a\"\n{line}"));
        let keys = "the keys here are name, id, upper_rad, axis, kind, links";
        assert_eq!(
            wrong("uper_rad = 1.0"),
            format!("there is no key `uper_rad`; did you mean `upper_rad`?; {keys}")
        );
        assert_eq!(wrong("colour = 1"), format!("there is no key `colour`; {keys}"));
        assert_eq!(
            wrong("kind = \"cann\""),
            "there is no choice `cann`; did you mean `can`?; the choices here are serial, can"
        );
        assert_eq!(wrong("upper_rad = \"two\""), "the text \"two\", where a number belongs");
        assert_eq!(wrong("upper_rad = [1.0]"), "a list, where a number belongs");
        assert_eq!(wrong("links = true"), "true, where a list belongs");
        assert_eq!(wrong("id = 300"), "the number 300, where a whole number from 0 to 255 belongs");
        assert_eq!(wrong("id = 1.5"), "the number 1.5, where a whole number from 0 to 255 belongs");
        assert_eq!(said("name = 3"), "the number 3, where a text belongs");
        assert_eq!(plain_words("something else"), "something else");
    }

    #[test]
    fn a_name_is_meant_only_if_it_is_near_and_no_other_is_as_near() {
        assert_eq!(nearest("wlak", &["walk", "wave-l", "run"]), Some("walk"));
        assert_eq!(nearest("op4", &["op2", "op3"]), None);
        assert_eq!(nearest("dance", &["walk", "run"]), None);
        assert_eq!(nearest("walk", &[]), None);
    }

    #[test]
    fn the_beginning_of_a_few_names_means_them_and_that_of_many_means_none() {
        let names = ["xm430-w210", "xm430-w350", "xl430-w250", "sts3215"];
        let said = |word: &str| advice(word, &names, "look");
        assert_eq!(said("XM430"), "did you mean xm430-w210 or xm430-w350? If not, look");
        assert_eq!(said("sts"), "did you mean sts3215? If not, look");
        assert_eq!(said("x"), "look");
        assert_eq!(said("430"), "look");
        assert_eq!(advice("a-", &["a-1", "a-2", "a-3", "a-4", "a-5"], "look"), "look");
    }
}
