//! The conformance tables: what each client did on the virtual robots, instruction by instruction,
//! written by the runs themselves.

use crate::python::{BESIDE, REQUIREMENTS};
use crate::scenario::{About, Outcome, Scenario};
use std::collections::BTreeMap;
use std::fmt::Write;

/// Instructions in the order of the tables.
const INSTRUCTIONS: [&str; 22] = [
    "Ping",
    "Ping, broadcast",
    "Read",
    "Write",
    "Reg Write",
    "Action",
    "Sync Read",
    "Sync Write",
    "Fast Sync Read",
    "Bulk Read",
    "Bulk Write",
    "Fast Bulk Read",
    "Reboot",
    "Clear, multi-turn",
    "Factory Reset",
    "Reset",
    "Change of ID, with lock",
    "Change of ID and speed",
    "Calibrate to the middle",
    "Wheel mode",
    "Angles and speeds in SI units",
    "Motion, checked by the client",
];

const HEAD: &str = "\
# Conformance

What other people's clients, unmodified, can do on the virtual robots, each behind a real
pseudo-terminal and in real time. Written by the runs of `tests/clients.rs`: a value set through a
client is looked up in the virtual servo past the line, a value read by a client was put there past
the line, so that no client is believed on its own word. To write this page anew:

```
GAITWAY_WRITE_CONFORMANCE=1 cargo test --test clients
```

`yes`: works. `-`: the client does not offer it, or not for these servos. `[n]`: works, or does not,
as defect n of the client says; every defect is shown by a test of its own, which fails when a newer
client no longer has it.

The SDKs are given their setting for slow adapters, 200 ms, so that a machine that stalls does not
count against them. LeRobot runs without the packages for learning: empty modules stand in for them.
";

/// The page, or why there is none.
pub fn page(scenarios: &[&'static Scenario], lock_file: &str) -> Result<String, String> {
    let mut ran = Vec::new();
    for scenario in scenarios {
        match scenario.outcome() {
            Outcome::Ran(works) => ran.push((*scenario, works)),
            Outcome::Skipped(why) => return Err(why),
        }
    }
    let mut page = HEAD.to_owned();
    versions(&mut page, scenarios, lock_file);
    let mut protocols: Vec<&str> = Vec::new();
    for (scenario, _) in &ran {
        if !protocols.contains(&scenario.protocol) {
            protocols.push(scenario.protocol);
        }
    }
    for protocol in protocols {
        let here: Vec<_> = ran.iter().filter(|(s, _)| s.protocol == protocol).collect();
        table(&mut page, protocol, &here, &numbers(scenarios));
    }
    defects(&mut page, scenarios);
    Ok(page)
}

fn line(page: &mut String, text: &str) {
    let _ = writeln!(page, "{text}");
}

/// Defects by client, protocol and instruction.
fn numbers(
    scenarios: &[&'static Scenario],
) -> BTreeMap<(&'static str, &'static str, &'static str), Vec<usize>> {
    let mut numbers: BTreeMap<_, Vec<usize>> = BTreeMap::new();
    let defects = scenarios.iter().filter_map(|s| match s.about {
        About::Defect(instruction, _) => Some((s.client, s.protocol, instruction)),
        About::Everything(_) => None,
    });
    for (k, place) in defects.enumerate() {
        numbers.entry(place).or_default().push(k + 1);
    }
    numbers
}

fn versions(page: &mut String, scenarios: &[&'static Scenario], lock_file: &str) {
    let mut clients: Vec<&str> = Vec::new();
    for scenario in scenarios {
        if !clients.contains(&scenario.client) {
            clients.push(scenario.client);
        }
    }
    line(page, "\n## Clients\n\n| client | version | from |\n|---|---|---|");
    for client in clients {
        let (version, from) = version(client, lock_file);
        line(page, &format!("| {client} | {version} | {from} |"));
    }
}

/// The version the runs used: pinned for Python, locked for crates.
fn version(client: &str, lock_file: &str) -> (String, &'static str) {
    let package = client.trim_end_matches(" (wheel)").trim_end_matches(" (crate)");
    let pinned = [REQUIREMENTS, BESIDE].concat();
    let pin = pinned.lines().find_map(|pin| pin.strip_prefix(package)?.strip_prefix("=="));
    if let (Some(version), false) = (pin, client.ends_with(" (crate)")) {
        return (version.to_owned(), "PyPI");
    }
    let entry = format!("name = \"{package}\"\nversion = \"");
    let (_, rest) = lock_file.split_once(&entry).expect("a locked crate");
    (rest.split('"').next().unwrap_or_default().to_owned(), "crates.io")
}

fn table(
    page: &mut String,
    protocol: &str,
    ran: &[&(&'static Scenario, Vec<&'static str>)],
    numbers: &BTreeMap<(&'static str, &'static str, &'static str), Vec<usize>>,
) {
    let mut clients: Vec<&str> = Vec::new();
    for (scenario, _) in ran {
        if !clients.contains(&scenario.client) {
            clients.push(scenario.client);
        }
    }
    line(page, &format!("\n## {protocol}\n"));
    line(page, &format!("| | {} |", clients.join(" | ")));
    line(page, &format!("|---|{}", "---|".repeat(clients.len())));
    let servos: Vec<String> = clients
        .iter()
        .map(|client| {
            let of_client = ran.iter().filter(|(s, _)| s.client == *client);
            let models = of_client.filter_map(|(s, _)| match s.about {
                About::Everything(models) => Some(models.join(", ")),
                About::Defect(..) => None,
            });
            models.collect::<Vec<_>>().join(", ")
        })
        .collect();
    line(page, &format!("| servos | {} |", servos.join(" | ")));
    for instruction in INSTRUCTIONS {
        let cells: Vec<String> = clients
            .iter()
            .map(|client| {
                let works = ran
                    .iter()
                    .any(|(s, works)| s.client == *client && works.contains(&instruction));
                let found = numbers
                    .iter()
                    .find(|((c, p, i), _)| c == client && *p == protocol && *i == instruction);
                let notes = found.map_or(String::new(), |(_, numbers)| {
                    numbers.iter().map(|n| format!(" [{n}]")).collect()
                });
                let word = if works {
                    "yes"
                } else if notes.is_empty() {
                    "-"
                } else {
                    "no"
                };
                format!("{word}{notes}")
            })
            .collect();
        if cells.iter().any(|cell| cell != "-") {
            line(page, &format!("| {instruction} | {} |", cells.join(" | ")));
        }
    }
    for (scenario, works) in ran {
        for instruction in works {
            assert!(INSTRUCTIONS.contains(instruction), "{}: {instruction}", scenario.client);
        }
    }
}

fn defects(page: &mut String, scenarios: &[&'static Scenario]) {
    line(page, "\n## Defects of the clients\n");
    let defects = scenarios.iter().filter_map(|scenario| match scenario.about {
        About::Defect(instruction, what) => Some((scenario, instruction, what)),
        About::Everything(_) => None,
    });
    for (k, (scenario, instruction, what)) in defects.enumerate() {
        let text = format!(
            "{}. **{}**, {}, {instruction}: {what}.",
            k + 1,
            scenario.client,
            scenario.protocol
        );
        line(page, &wrapped(&text, 100, "    "));
    }
}

/// The text in lines of at most `width` columns, the later ones indented.
fn wrapped(text: &str, width: usize, indent: &str) -> String {
    let mut lines = vec![String::new()];
    for word in text.split_whitespace() {
        let last = lines.last_mut().expect("there is one");
        if last.trim().is_empty() {
            last.push_str(word);
        } else if last.len() + 1 + word.len() <= width {
            let _ = write!(last, " {word}");
        } else {
            lines.push(format!("{indent}{word}"));
        }
    }
    lines.join("\n")
}
