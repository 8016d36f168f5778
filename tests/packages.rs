//! What is given to others: crates that can be published in order, an archive and a Debian package, each as a
//! stranger gets it.

mod aloud;
mod program;

use aloud::aloud;
use program::{folder, words};
use std::collections::BTreeSet;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

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

/// A Debian system with nothing in it but what every one has, made once; or none where it cannot be had, which is said.
fn clean_system() -> Option<PathBuf> {
    let root = Path::new(env!("CARGO_TARGET_TMPDIR")).join("clean-system");
    let complete = root.join("complete");
    if complete.exists() {
        return Some(root);
    }
    let _ = fs::remove_dir_all(&root);
    // Of the release that this program was built on: its C library is no older.
    let release = fs::read_to_string("/etc/os-release").unwrap_or_default();
    let name = release.lines().find_map(|line| line.strip_prefix("VERSION_CODENAME="))?;
    let mut debootstrap = Command::new("debootstrap");
    debootstrap.args(["--variant=minbase", name]).arg(&root).arg("http://deb.debian.org/debian");
    match debootstrap.output() {
        Ok(output) if output.status.success() => {
            fs::write(complete, "").expect("a file");
            Some(root)
        }
        failed => {
            let words = failed.map_or_else(|e| e.to_string(), |output| words(&output));
            aloud!(
                "SKIPPED: installing into a clean system (debootstrap: {words}); into an empty root instead"
            );
            None
        }
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

    // dpkg takes it into a clean system, with all that it depends on; where there is none, into a root of its own.
    let (root, is_system) = clean_system().map_or((folder("root"), false), |root| (root, true));
    let mut dpkg = Command::new(if is_system { "chroot" } else { "dpkg" });
    if is_system {
        let package = root.join("gaitway.deb");
        fs::copy(find(".deb"), package).expect("a copy");
        run(dpkg.arg(&root).args(["dpkg", "-i", "/gaitway.deb"]));
    } else {
        fs::create_dir_all(root.join("var/lib/dpkg/info")).expect("a folder");
        fs::create_dir_all(root.join("var/lib/dpkg/updates")).expect("a folder");
        fs::write(root.join("var/lib/dpkg/status"), "").expect("a file");
        dpkg.arg(format!("--root={}", root.display()))
            .args(["--force-depends", "--force-not-root"]);
        run(dpkg.arg("-i").arg(find(".deb")));
    }
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
    let sbom = fs::read_to_string(find(".cdx.json")).expect("a list of what is in it");
    assert_eq!(
        sbom,
        fs::read_to_string(root.join("usr/share/doc/gaitway/sbom.cdx.json")).expect("too")
    );
    let crates = fs::read_to_string(root.join("usr/share/doc/gaitway/crates.tsv")).expect("a list");
    assert!(crates.lines().any(|line| line.starts_with("serde\t")), "{crates}");
    assert!(!crates.contains("proptest"), "what tests are made of is in no package");
    assert!(crates.lines().all(|line| line.split('\t').count() == 3), "{crates}");

    let unpacked = folder("unpacked");
    run(Command::new("tar").arg("-C").arg(&unpacked).arg("-xzf").arg(find(".tar.gz")));
    let archive = fs::read_dir(&unpacked).expect("a folder").flatten().next().expect("one folder");
    if is_system {
        // There it is run by its name, by who has nothing else: in a mount namespace of its own, for terminals.
        let begin = "mount -t devpts -o newinstance,ptmxmode=0666 devpts \"$0/dev/pts\" && \
                     exec chroot \"$0\" gaitway \"$@\"";
        let installed = || {
            let mut command = Command::new("unshare");
            command.args(["--mount", "sh", "-c", begin]).arg(&root).env("HOME", "/root");
            command
        };
        fs::create_dir_all(root.join("tmp/begun")).expect("a folder");
        program::does_what_the_readme_begins_with(installed, "/tmp/begun");
        fs::remove_dir_all(root.join("tmp/begun")).expect("it is gone");
        run(Command::new("chroot").arg(&root).args(["dpkg", "-r", "gaitway"]));
        assert!(!root.join("usr/bin/gaitway").exists(), "it is gone once it is removed");
    }
    let installed = (!is_system).then(|| root.join("usr/bin/gaitway"));
    for program in installed.into_iter().chain([archive.path().join("bin/gaitway")]) {
        begins(&program, &folder("begun"));
    }
}

/// What the README begins with, done by this program for somebody who has nothing of Gaitway's.
fn begins(program: &Path, folder: &Path) {
    let installed = || {
        let mut command = Command::new(program);
        command.env("XDG_CONFIG_HOME", folder.join("nobody"));
        command
    };
    program::does_what_the_readme_begins_with(installed, &folder.display().to_string());
}

#[test]
fn cargo_installs_a_program_that_does_what_the_readme_begins_with() {
    if std::env::var_os("GAITWAY_LONG").is_none() {
        aloud!("SKIPPED: cargo install builds a release, with GAITWAY_LONG=1");
        return;
    }
    let readme = fs::read_to_string(Path::new(ROOT).join("README.md")).expect("a README");
    let told = readme.lines().find_map(|line| line.strip_prefix("cargo install "));
    let told = told.and_then(|line| line.split(" #").next()).expect("how it is installed");
    let root = folder("installed");
    let mut cargo = Command::new(env!("CARGO"));
    cargo.arg("install").args(told.split_whitespace()).arg("--root").arg(&root);
    run(cargo.args(["--no-track", "--quiet"]).current_dir(ROOT));
    begins(&root.join("bin/gaitway"), &folder("begun-by-cargo"));
}

/// The environment with another project's reader of such documents, made once.
fn cyclonedx() -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("cyclonedx");
    let python = folder.join("bin/python");
    if folder.join("complete").exists() {
        return Some(python);
    }
    let venv = Command::new("python3").args(["-m", "venv", "--clear"]).arg(&folder).output();
    let list = Path::new(ROOT).join("tests/python/sbom.txt");
    let pip = Command::new(&python)
        .args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check", "-r"])
        .arg(list)
        .output();
    let is_made = [venv, pip].iter().all(|made| made.as_ref().is_ok_and(|it| it.status.success()));
    if !is_made {
        assert!(std::env::var_os("CI").is_none(), "no reader of CycloneDX");
        aloud!("SKIPPED: the list of crates is not held against the schema: no Python with PyPI");
        return None;
    }
    fs::write(folder.join("complete"), "").expect("a file");
    Some(python)
}

#[test]
fn the_list_of_what_is_in_it_keeps_to_the_schema_and_names_every_crate_that_is_locked() {
    let metadata = || {
        let mut cargo = Command::new(env!("CARGO"));
        cargo.args(["metadata", "--format-version", "1", "--locked", "--offline"]);
        run(cargo.args(["--filter-platform", "x86_64-unknown-linux-gnu"]).current_dir(ROOT)).stdout
    };
    let made = || {
        let mut python = Command::new("python3");
        python.arg(Path::new(ROOT).join("packaging/sbom.py"));
        python.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = python.spawn().expect("python3");
        child.stdin.take().expect("piped").write_all(&metadata()).expect("it reads");
        let output = child.wait_with_output().expect("it ends");
        assert!(output.status.success(), "{}", words(&output));
        output.stdout
    };
    let document = made();
    assert_eq!(document, made(), "the same sources, the same bytes");
    let told: serde_json::Value = serde_json::from_slice(&document).expect("JSON");
    let lock = fs::read_to_string(Path::new(ROOT).join("Cargo.lock")).expect("a lock");
    let components = told["components"].as_array().expect("components");
    assert!(components.len() > 100, "{}", components.len());
    for component in components {
        let (name, version) = (&component["name"], &component["version"]);
        let entry = format!("name = {name}\nversion = {version}\n");
        let (_, rest) = lock.split_once(&entry).unwrap_or_else(|| panic!("{entry} is not locked"));
        // What came from a registry has the checksum that it is downloaded by.
        let own = rest.split("\n\n").next().unwrap_or_default();
        if let Some(sum) = component["hashes"][0]["content"].as_str() {
            assert!(own.contains(sum), "{name}");
        } else {
            assert!(!own.contains("checksum"), "{name} has a checksum");
        }
    }
    assert!(!components.iter().any(|one| one["name"] == "proptest"), "of tests only");
    let Some(python) = cyclonedx() else { return };
    let file = folder("sbom").join("gaitway.cdx.json");
    let check = "import sys\nfrom cyclonedx.schema import SchemaVersion\n\
                 from cyclonedx.validation.json import JsonStrictValidator\n\
                 fault = JsonStrictValidator(SchemaVersion.V1_5).validate_str(open(sys.argv[1]).read())\n\
                 sys.exit(str(fault) if fault else 0)";
    fs::write(&file, &document).expect("a file");
    run(Command::new(&python).args(["-c", check]).arg(&file));
    // The reader is one: it takes nothing else.
    fs::write(&file, String::from_utf8_lossy(&document).replace("SHA-256", "SHA-0")).expect("it");
    let output = Command::new(&python).args(["-c", check]).arg(&file).output().expect("it runs");
    assert!(!output.status.success());
}
