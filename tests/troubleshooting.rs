//! Every reason to stop has its page, and every page its reason.

use gaitway::control::StopCode;
use std::collections::BTreeSet;
use std::path::PathBuf;

fn folder() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("docs/troubleshooting")
}

fn codes() -> BTreeSet<String> {
    StopCode::ALL.iter().map(ToString::to_string).collect()
}

#[test]
fn every_reason_to_stop_has_its_page_and_every_page_its_reason() {
    let pages: BTreeSet<String> = std::fs::read_dir(folder())
        .expect("a folder")
        .map(|entry| entry.expect("an entry").file_name().into_string().expect("UTF-8"))
        .filter_map(|name| name.strip_suffix(".md").map(str::to_owned))
        .filter(|name| name != "README")
        .collect();
    assert_eq!(pages, codes());
    // A report says the same word as its data.
    for code in StopCode::ALL {
        assert_eq!(serde_json::to_value(code).expect("JSON"), code.to_string());
    }
}

#[test]
fn a_page_says_what_it_means_what_the_robot_did_what_is_told_and_what_to_do() {
    for code in codes() {
        let text = std::fs::read_to_string(folder().join(format!("{code}.md"))).expect("a page");
        assert!(text.starts_with(&format!("# {code}\n")), "{code}: another title");
        let parts = ["**Means.**", "**What the robot did.**", "**What the report says.**"];
        let parts = parts.into_iter().chain(["**Causes", "**What to do.**"]);
        let places: Vec<_> = parts.map(|part| (part, text.find(part))).collect();
        let found = places.iter().all(|(_, at)| at.is_some());
        assert!(found && places.is_sorted_by_key(|(_, at)| *at), "{code}: {places:?}");
        for word in ["allowed", "unit", "flight"] {
            assert!(text.contains(&format!("`{word}`")), "{code} says nothing of {word}");
        }
        let lines = text.lines().count();
        assert!((15..=30).contains(&lines), "{code}: {lines} lines");
    }
}

#[test]
fn the_index_leads_to_every_page_and_every_link_leads_somewhere() {
    let index = std::fs::read_to_string(folder().join("README.md")).expect("an index");
    for code in codes() {
        assert!(index.contains(&format!("[{code}]({code}.md)")), "{code} is not in the index");
    }
    for page in codes().into_iter().chain(["README".to_owned()]) {
        let text = std::fs::read_to_string(folder().join(format!("{page}.md"))).expect("a page");
        for link in text.split("](").skip(1).filter_map(|rest| rest.split(')').next()) {
            assert!(folder().join(link).exists(), "{page}: {link} leads nowhere");
        }
    }
}
