//! What others wrote that this is built from: every package under a licence of `deny.toml`, from the
//! one registry, and every direct dependency named with its reason in `CONTRIBUTING.md`.

mod aloud;

use aloud::aloud;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::process::{Command, Output};

const REGISTRY: &str = "registry+https://github.com/rust-lang/crates.io-index";

fn cargo(args: &[&str]) -> Output {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    Command::new(cargo).args(args).current_dir(root).output().expect("cargo")
}

/// The packages of this machine's builds: those of other systems need not be downloaded here.
fn packages() -> Vec<serde_json::Value> {
    let rustc = Command::new("rustc").arg("-vV").output().expect("rustc");
    let said = String::from_utf8_lossy(&rustc.stdout).into_owned();
    let host = said.lines().find_map(|line| line.strip_prefix("host: ")).expect("a host");
    let args = ["metadata", "--offline", "--locked", "--format-version", "1"];
    let output = cargo(&[&args[..], &["--filter-platform", host]].concat());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let metadata: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    metadata["packages"].as_array().expect("a list").clone()
}

/// What `deny.toml` allows everybody, and what one crate besides.
struct Licences {
    allowed: BTreeSet<String>,
    exceptions: BTreeMap<String, BTreeSet<String>>,
}

impl Licences {
    fn read() -> Self {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/deny.toml");
        let text = std::fs::read_to_string(path).expect("deny.toml");
        let deny: toml::Table = text.parse().expect("TOML");
        let words = |list: &toml::Value| -> BTreeSet<String> {
            let words = list.as_array().expect("a list").iter();
            words.map(|word| word.as_str().expect("a text").to_owned()).collect()
        };
        let exception = |entry: &toml::Value| {
            (entry["crate"].as_str().expect("a crate").to_owned(), words(&entry["allow"]))
        };
        let exceptions = deny["licenses"]["exceptions"].as_array().expect("a list");
        Self {
            allowed: words(&deny["licenses"]["allow"]),
            exceptions: exceptions.iter().map(exception).collect(),
        }
    }

    /// Whether a crate may be used under its licence expression (SPDX, annex D; a slash is an older
    /// way to write OR).
    fn admit(&self, name: &str, expression: &str) -> bool {
        let spaced = expression.replace('(', " ( ").replace(')', " ) ").replace('/', " OR ");
        let words: Vec<&str> = spaced.split_whitespace().collect();
        let mut rest = words.as_slice();
        let admitted = self.any(name, &mut rest);
        admitted && rest.is_empty()
    }

    fn any(&self, name: &str, words: &mut &[&str]) -> bool {
        let mut admitted = self.all(name, words);
        while take(words, "OR") {
            admitted |= self.all(name, words);
        }
        admitted
    }

    fn all(&self, name: &str, words: &mut &[&str]) -> bool {
        let mut admitted = self.one(name, words);
        while take(words, "AND") {
            admitted &= self.one(name, words);
        }
        admitted
    }

    fn one(&self, name: &str, words: &mut &[&str]) -> bool {
        if take(words, "(") {
            let admitted = self.any(name, words);
            return take(words, ")") && admitted;
        }
        let Some(&licence) = words.split_off_first() else { return false };
        let mut licence = licence.to_owned();
        if take(words, "WITH") {
            let Some(exception) = words.split_off_first() else { return false };
            licence += &format!(" WITH {exception}");
        }
        let besides = self.exceptions.get(name);
        self.allowed.contains(&licence) || besides.is_some_and(|own| own.contains(&licence))
    }
}

/// Takes the first word off if it is this one.
fn take(words: &mut &[&str], word: &str) -> bool {
    let is = words.first() == Some(&word);
    if is {
        *words = &words[1..];
    }
    is
}

#[test]
fn every_package_is_under_a_licence_that_is_allowed_and_from_the_registry() {
    let licences = Licences::read();
    let packages = packages();
    for package in &packages {
        let name = package["name"].as_str().expect("a name");
        let expression = package["license"].as_str().unwrap_or_default();
        assert!(licences.admit(name, expression), "{name}: {expression}");
        let source = &package["source"];
        assert!(source.is_null() || source == REGISTRY, "{name} is from {source}");
    }
    assert!(packages.len() > 100, "only {} packages", packages.len());
    aloud!("licences of {} packages looked at", packages.len());
}

#[test]
fn every_direct_dependency_is_named_with_its_reason() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/CONTRIBUTING.md");
    let text = std::fs::read_to_string(path).expect("CONTRIBUTING.md");
    let (_, table) = text.split_once("| crate | for |").expect("the table");
    let rows = table.lines().filter_map(|row| row.strip_prefix("| ")?.split_once(" |"));
    let named: BTreeSet<&str> = rows
        .flat_map(|(crates, _)| crates.split(", "))
        .filter_map(|name| name.split(' ').next())
        .collect();
    let ours = packages().into_iter().filter(|package| package["source"].is_null());
    let mut looked_at = 0;
    for package in ours {
        for dependency in package["dependencies"].as_array().expect("a list") {
            let name = dependency["name"].as_str().expect("a name");
            let foreign = !dependency["source"].is_null();
            assert!(!foreign || named.contains(name), "{name} is not in CONTRIBUTING.md");
            looked_at += usize::from(foreign);
        }
    }
    assert!(looked_at > 20, "only {looked_at} dependencies");
}

#[test]
fn cargo_deny_says_the_same() {
    let version = cargo(&["deny", "--version"]);
    if !version.status.success() {
        aloud!("SKIPPED: cargo-deny is not installed (cargo install cargo-deny --locked)");
        return;
    }
    let checks = ["check", "licenses", "bans", "sources"];
    let output = cargo(&[&["deny", "--offline"], &checks[..]].concat());
    let said = [output.stdout, output.stderr].concat();
    let said = String::from_utf8_lossy(&said);
    assert!(output.status.success(), "{said}");
    let verdict = said.lines().find(|line| line.contains("licenses ok"));
    aloud!("cargo deny: {}", verdict.expect("a verdict"));
}

#[test]
fn a_licence_is_admitted_as_its_expression_says() {
    let words = |list: &[&str]| list.iter().map(|word| (*word).to_owned()).collect();
    let licences = Licences {
        allowed: words(&["MIT", "Apache-2.0", "Apache-2.0 WITH LLVM-exception"]),
        exceptions: [("port".to_owned(), words(&["MPL-2.0"]))].into(),
    };
    for (name, expression, admitted) in [
        ("a", "MIT", true),
        ("a", "GPL-3.0-only", false),
        ("a", "MIT OR GPL-3.0-only", true),
        ("a", "GPL-3.0-only/MIT", true),
        ("a", "MIT AND GPL-3.0-only", false),
        ("a", "(MIT OR GPL-3.0-only) AND Apache-2.0", true),
        ("a", "MIT OR GPL-3.0-only AND Apache-2.0", true),
        ("a", "(MIT OR Apache-2.0) AND NCSA", false),
        ("a", "Apache-2.0 WITH LLVM-exception", true),
        ("a", "MIT WITH LLVM-exception", false),
        ("a", "MPL-2.0", false),
        ("port", "MPL-2.0", true),
        ("a", "", false),
        ("a", "(MIT", false),
        ("a", "MIT)", false),
    ] {
        assert_eq!(licences.admit(name, expression), admitted, "{name}: {expression}");
    }
}
