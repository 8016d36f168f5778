//! What is given to others: crates that can be published in order, an archive and a Debian package, each as a
//! stranger gets it.

mod aloud;
mod program;

use aloud::aloud;
use program::{folder, words};
use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

fn run(command: &mut Command) -> Output {
    let output = command.output().unwrap_or_else(|e| panic!("{command:?}: {e}"));
    assert!(output.status.success(), "{command:?}: {}", words(&output));
    output
}

/// The files that a crate would be published with.
fn listed(crate_name: &str) -> BTreeSet<String> {
    let mut cargo = Command::new(env!("CARGO"));
    cargo.args(["package", "--list", "--allow-dirty", "--offline", "-p", crate_name]);
    let output = run(cargo.current_dir(ROOT));
    String::from_utf8_lossy(&output.stdout).lines().map(str::to_owned).collect()
}

#[test]
fn crates_carry_all_that_they_are_built_of_and_no_tests() {
    for (name, inside) in [
        ("gaitway-profiles", &["build.rs", "servos/robotis/xm430-w350.toml"][..]),
        ("gaitway-sim", &["src/lib.rs", "README.md"]),
        (
            "gaitway",
            &["actions/walk.toml", "models/bow.toml", "udev/60-gaitway.rules", "src/main.rs"],
        ),
    ] {
        let files = listed(name);
        for file in inside {
            assert!(files.contains(*file), "{name} lacks {file}");
        }
        let test = files.iter().find(|file| file.starts_with("tests/") || file.ends_with(".png"));
        assert_eq!(test, None, "{name}");
    }
}

#[test]
fn a_crate_that_another_needs_is_named_with_the_version_it_has() {
    let read = |path: &str| fs::read_to_string(Path::new(ROOT).join(path)).expect("a manifest");
    let version = env!("CARGO_PKG_VERSION");
    for manifest in ["Cargo.toml", "sim/Cargo.toml"] {
        let text = read(manifest);
        let ours = text.lines().filter(|line| line.starts_with("gaitway-"));
        let mut count = 0;
        for line in ours {
            let wanted = format!("version = \"{version}\"");
            assert!(line.contains("path = ") && line.contains(&wanted), "{manifest}: {line}");
            count += 1;
        }
        assert!(count > 0, "{manifest}");
    }
}

/// True if the programs that make a Debian package are at hand, and there is time: an unoptimised program is packed
/// for a quarter of a minute.
fn can_package() -> bool {
    if std::env::var_os("GAITWAY_LONG").is_none() {
        aloud!("SKIPPED: archive and Debian package are made with GAITWAY_LONG=1");
        return false;
    }
    let needed = ["dpkg-deb", "objdump", "strip", "python3", "gzip", "tar"];
    let lacks = needed.iter().find(|name| {
        let found = Command::new("sh").args(["-c", &format!("command -v {name}")]).output();
        !found.is_ok_and(|output| output.status.success())
    });
    if let Some(name) = lacks {
        assert!(std::env::var_os("CI").is_none(), "{name} is not installed");
        aloud!("SKIPPED: {name} is not installed");
    }
    lacks.is_none()
}

#[test]
fn archive_and_debian_package_install_a_program_with_pages_completions_and_the_rule() {
    if !can_package() {
        return;
    }
    let out = folder("made");
    let make = || {
        let mut script = Command::new(Path::new(ROOT).join("packaging/linux"));
        script.arg(program::PATH).arg(&out);
        script
    };
    run(&mut make());
    let again = make().output().expect("a script");
    assert!(!again.status.success(), "nothing is overwritten");
    let find = |end: &str| {
        let names = fs::read_dir(&out).expect("a folder").flatten().map(|file| file.path());
        names.into_iter().find(|path| path.to_string_lossy().ends_with(end)).expect(end)
    };
    let sums = fs::read_dir(&out).expect("a folder").flatten().map(|file| file.path());
    let mut sums = sums.filter(|path| path.to_string_lossy().contains("SHA256SUMS"));
    let sums = sums.next().expect("checksums");
    run(Command::new("sha256sum").arg("-c").arg(sums).current_dir(&out));

    // dpkg takes it into a root of its own. What it depends on is this machine's.
    let root = folder("root");
    fs::create_dir_all(root.join("var/lib/dpkg/info")).expect("a folder");
    fs::create_dir_all(root.join("var/lib/dpkg/updates")).expect("a folder");
    fs::write(root.join("var/lib/dpkg/status"), "").expect("a file");
    let mut dpkg = Command::new("dpkg");
    dpkg.arg(format!("--root={}", root.display())).args(["--force-depends", "--force-not-root"]);
    run(dpkg.arg("-i").arg(find(".deb")));
    for file in [
        "usr/lib/udev/rules.d/60-gaitway.rules",
        "usr/share/man/man1/gaitway.1.gz",
        "usr/share/man/man1/gaitway-simulate.1.gz",
        "usr/share/bash-completion/completions/gaitway",
        "usr/share/fish/vendor_completions.d/gaitway.fish",
        "usr/share/zsh/vendor-completions/_gaitway",
        "usr/share/doc/gaitway/copyright",
    ] {
        let length = fs::metadata(root.join(file)).map_or(0, |file| file.len());
        assert!(length > 100, "{file}: {length} bytes");
    }
    let crates = fs::read_to_string(root.join("usr/share/doc/gaitway/crates.tsv")).expect("a list");
    assert!(crates.lines().any(|line| line.starts_with("serde\t")), "{crates}");
    assert!(!crates.contains("proptest"), "what tests are made of is in no package");
    assert!(crates.lines().all(|line| line.split('\t').count() == 3), "{crates}");

    let unpacked = folder("unpacked");
    run(Command::new("tar").arg("-C").arg(&unpacked).arg("-xzf").arg(find(".tar.gz")));
    let archive = fs::read_dir(&unpacked).expect("a folder").flatten().next().expect("one folder");
    for program in [root.join("usr/bin/gaitway"), archive.path().join("bin/gaitway")] {
        let play = ["play", "bow", "--robot", "op3", "--bus", "sim", "--json", "-q"];
        let played = run(Command::new(&program).args(play).env("XDG_CONFIG_HOME", &root));
        assert_eq!(program::json(&played)["outcome"], "done", "{}", program.display());
    }
}
