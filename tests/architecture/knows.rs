//! Which file of a crate names what another one has: a small reader of `use` and of paths.

use std::collections::{BTreeMap, BTreeSet};

/// A file as its module: `["control", "cycle"]`.
pub type Module = Vec<String>;

/// What each file names of other files. A part that names what its own room has (`a::b` something of
/// `a`) does not count: that is what a part is.
pub fn who_knows_whom(code: &BTreeMap<Module, String>) -> BTreeMap<Module, BTreeSet<Module>> {
    let mut passed_on: BTreeMap<Module, BTreeMap<String, Module>> = BTreeMap::new();
    for (me, text) in code {
        for (is_public, path) in uses(text).0 {
            let Some(path) = absolute(me, &path, code).filter(|_| is_public) else { continue };
            let Some((of, _)) = split(&path, code).filter(|(of, _)| of != me) else { continue };
            let name = path.last().cloned().unwrap_or_default();
            passed_on.entry(me.clone()).or_default().insert(name, of);
        }
    }
    let mut knows: BTreeMap<Module, BTreeSet<Module>> = BTreeMap::new();
    for (me, text) in code {
        let (used, rest) = uses(text);
        let used = used.into_iter().filter(|(is_public, _)| !is_public).map(|(_, path)| path);
        for path in used.chain(paths(&rest)) {
            let Some(path) = absolute(me, &path, code) else { continue };
            let Some((mut of, rest)) = split(&path, code) else { continue };
            let owner = rest.first().and_then(|name| passed_on.get(&of)?.get(name));
            if let Some(owner) = owner {
                of.clone_from(owner);
            }
            if of != *me && !me.starts_with(&of) {
                knows.entry(me.clone()).or_default().insert(of);
            }
        }
    }
    knows
}

/// Files that need one another in a circle, and those between two circles.
pub fn circles(
    mut knows: BTreeMap<Module, BTreeSet<Module>>,
) -> BTreeMap<Module, BTreeSet<Module>> {
    loop {
        let before = knows.len();
        let known: BTreeSet<Module> = knows.values().flatten().cloned().collect();
        knows.retain(|file, _| known.contains(file));
        let left: BTreeSet<Module> = knows.keys().cloned().collect();
        for of in knows.values_mut() {
            of.retain(|file| left.contains(file));
        }
        knows.retain(|_, of| !of.is_empty());
        if knows.len() == before {
            return knows;
        }
    }
}

/// All that `use` names, each with whether it is passed on; and the text without it.
fn uses(text: &str) -> (Vec<(bool, Module)>, String) {
    let (mut found, mut rest, mut left) = (Vec::new(), String::new(), text);
    while let Some(at) = left.find("use ") {
        let line = left[..at].rsplit('\n').next().unwrap_or_default().trim();
        let is_use = line.is_empty() || line.starts_with("pub");
        let end = left[at..].find(';').map_or(left.len(), |end| at + end);
        if is_use {
            let mut named = Vec::new();
            expand(&[], &left[at + 4..end], &mut named);
            found.extend(named.into_iter().map(|path| (line.starts_with("pub"), path)));
            rest.push_str(&left[..at]);
            left = &left[end..];
        } else {
            rest.push_str(&left[..at + 4]);
            left = &left[at + 4..];
        }
    }
    rest.push_str(left);
    (found, rest)
}

/// `a::{b, c::d}` as `a::b` and `a::c::d`.
fn expand(before: &[String], text: &str, found: &mut Vec<Module>) {
    let text = text.trim();
    let mut path = before.to_vec();
    let Some((head, list)) = text.split_once('{') else {
        let text = text.split(" as ").next().unwrap_or_default();
        path.extend(text.split("::").map(|part| part.trim().to_owned()));
        return found.push(path);
    };
    path.extend(
        head.split("::").map(|part| part.trim().to_owned()).filter(|part| !part.is_empty()),
    );
    let list = list.rsplit_once('}').map_or(list, |(list, _)| list);
    let (mut depth, mut from) = (0, 0);
    for (at, letter) in list.char_indices().chain([(list.len(), ',')]) {
        match letter {
            '{' => depth += 1,
            '}' => depth -= 1,
            ',' if depth == 0 => {
                if !list[from..at].trim().is_empty() {
                    expand(&path, &list[from..at], found);
                }
                from = at + 1;
            }
            _ => {}
        }
    }
}

/// All paths in code: words with `::` between them.
fn paths(text: &str) -> Vec<Module> {
    let words = text.split(|c: char| !(c.is_alphanumeric() || c == '_' || c == ':'));
    let paths = words.filter(|word| word.contains("::") && !word.starts_with(':'));
    paths.map(|word| word.split("::").map(str::to_owned).collect()).collect()
}

/// A path from the root of the crate; `None` if it leads elsewhere.
fn absolute(me: &Module, path: &Module, code: &BTreeMap<Module, String>) -> Option<Module> {
    let mut from = me.clone();
    let mut parts = path.iter().peekable();
    match path.first()?.as_str() {
        "crate" => {
            parts.next();
            from.clear();
        }
        "self" => drop(parts.next()),
        "super" => {
            while parts.next_if(|part| *part == "super").is_some() {
                from.pop();
            }
        }
        part => {
            let of_mine = [&me[..], &[part.to_owned()]].concat();
            if !code.contains_key(&of_mine) {
                return None;
            }
        }
    }
    from.extend(parts.cloned());
    Some(from)
}

/// The file that a path leads to, and what is left of it.
fn split(path: &Module, code: &BTreeMap<Module, String>) -> Option<(Module, Module)> {
    let is_file = |end: &usize| code.contains_key(&path[..*end]);
    let end = (1..=path.len()).rev().find(is_file)?;
    Some((path[..end].to_vec(), path[end..].to_vec()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(files: &[(&str, &str)]) -> BTreeMap<Module, String> {
        let module = |name: &str| name.split('/').map(str::to_owned).collect();
        files.iter().map(|(name, text)| (module(name), (*text).to_owned())).collect()
    }

    #[test]
    fn two_files_that_need_one_another_are_a_circle_and_a_part_and_its_room_are_none() {
        let room = ("room", "mod part;\npub use part::Thing;\nfn f() { part::g() }");
        let part = ("room/part", "use super::f;\nuse std::fmt;\npub struct Thing;");
        assert!(circles(who_knows_whom(&of(&[room, part]))).is_empty());
        let one = ("room/one", "use super::{Thing, two::{self, Two}};\nuse std::fmt;");
        let two = ("room/two", "fn f() -> crate::room::one::One {}");
        let found = circles(who_knows_whom(&of(&[room, part, one, two])));
        let names: Vec<_> = found.keys().map(|file| file.join("/")).collect();
        assert_eq!(names, ["room/one", "room/two"]);
        // What a room passes on belongs to the part that has it.
        let two = ("room/two", "use super::Thing;");
        let part = ("room/part", "fn h() { super::two::k() }");
        assert_eq!(circles(who_knows_whom(&of(&[room, part, two]))).len(), 2);
    }
}
