//! What the commands say, word for word, so that each change of a word is read by somebody: figures and
//! paths are masked, and blanks count once. After a change that is meant,
//! `GAITWAY_WRITE_TRANSCRIPTS=1 cargo test --test transcripts` writes the files anew; read the difference.

mod program;

use program::{folder, words};
use std::path::{Path, PathBuf};

/// Name of the file, and the arguments; run one after another in one folder, in virtual time.
const RUNS: [(&str, &str); 30] = [
    ("help", "--help"),
    ("help-play", "play --help"),
    ("help-robot-new", "robot new --help"),
    ("play", "play walk --robot op3 --bus sim --record walk.mcap --html walk.html"),
    ("play-again", "play walk --robot op3 --bus sim --record walk.mcap"),
    ("play-dry", "play bow --robot op3 --bus sim --dry-run"),
    ("play-unknown-motion", "play wlak --robot op3 --bus sim"),
    ("play-unknown-robot", "play walk --robot op4 --bus sim"),
    ("play-unknown-bus", "play walk --robot op3 --bus usb0"),
    ("play-only-nobody", "play walk --robot op3 --bus sim --only l_knee,l_toe"),
    ("play-no-port", "play walk --robot op3 --bus serial:/dev/there-is-no-such-port"),
    ("live", "live --from file:bow --robot op3 --bus sim --for 2"),
    ("retarget", "retarget wave-r --robot op3 -o wave.csv"),
    ("play-table", "play wave.csv --robot op3 --bus sim"),
    ("synth", "synth walk -o synth.csv"),
    ("synth-change", "synth walk:6s+run:5s -o into-a-run.csv"),
    ("synth-insert", "synth bow --insert wave-r@1.3s --insert-wait -o polite.csv"),
    ("synth-insert-no-seam", "synth walk --insert bow:0.5s..1s@3s -o none.csv"),
    ("info", "info walk.mcap"),
    ("convert", "convert walk.mcap joints.csv"),
    ("scan", "scan sim --robot so101"),
    ("robot-new", "robot new --from sim --robot so101 -o my-arm.toml"),
    ("profile-check-draft", "profile check my-arm.toml"),
    ("servo-info", "servo info sim 1 --robot op3"),
    ("servo-get-unknown", "servo get sim 1 temperature --robot op3"),
    ("servo-set-refused", "servo set sim 1 ID 5 --robot op3"),
    ("hold", "hold so101 --bus sim"),
    ("limp", "limp so101 --bus sim --yes"),
    ("monitor", "monitor so101 --bus sim"),
    ("profile-show", "profile show sts3215"),
];

fn kept(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/transcripts").join(format!("{name}.txt"))
}

/// The words of a text: numbers as `#`, one blank for several, and no folder of this machine.
fn masked(text: &str, folder: &Path) -> String {
    let text = text.replace(&folder.display().to_string(), "FOLDER");
    let line = |line: &str| {
        let (mut out, mut is_number) = (String::new(), false);
        let mut letters = line.chars().peekable();
        while let Some(c) = letters.next() {
            let in_word = out.ends_with(|last: char| last.is_ascii_alphanumeric() || last == '_');
            let goes_on = c == '.' && letters.peek().is_some_and(char::is_ascii_digit);
            if is_number && (c.is_ascii_digit() || goes_on) || c == ' ' && out.ends_with(' ') {
                continue;
            }
            is_number = c.is_ascii_digit() && !in_word;
            out.push(if is_number { '#' } else { c });
        }
        out.trim_end().replace("-#", "#")
    };
    text.lines().map(|of| line(of) + "\n").collect()
}

#[test]
fn every_command_says_what_somebody_has_read() {
    let folder = folder("runs");
    let writes = std::env::var_os("GAITWAY_WRITE_TRANSCRIPTS").is_some();
    let mut changed = Vec::new();
    for (name, arguments) in RUNS {
        let mut command = program::gaitway();
        command.args(arguments.split(' ')).current_dir(&folder).env("COLUMNS", "100");
        let output = command.stdin(std::process::Stdio::null()).output().expect("the command");
        let code = output.status.code().map_or_else(|| "?".to_owned(), |code| code.to_string());
        let said = masked(&words(&output), &folder);
        let found = format!("$ gaitway {arguments}\n{said}(exit code {code})\n");
        if writes {
            std::fs::write(kept(name), &found).expect("written");
            continue;
        }
        let expected = std::fs::read_to_string(kept(name)).unwrap_or_default();
        if found != expected {
            let differs = found.lines().zip(expected.lines().chain(std::iter::repeat("")));
            let first = differs.into_iter().find(|(a, b)| a != b);
            changed.push(format!(
                "{name}: now {:?}, was {:?}",
                first.map(|f| f.0),
                first.map(|f| f.1)
            ));
        }
    }
    assert!(changed.is_empty(), "read what changed, then write it:\n{}", changed.join("\n"));
}

#[test]
fn no_transcript_is_left_of_a_run_that_is_gone() {
    let folder = kept("help").parent().expect("a folder").to_owned();
    for entry in std::fs::read_dir(folder).expect("transcripts") {
        let path = entry.expect("an entry").path();
        let name = path.file_stem().and_then(|name| name.to_str()).expect("a name");
        assert!(RUNS.iter().any(|(run, _)| *run == name), "{} belongs to no run", path.display());
    }
}

#[test]
fn figures_are_masked_and_names_with_digits_are_not() {
    let folder = Path::new("/tmp/x");
    for (text, expected) in [
        ("20 of 20 at -3.5 deg", "# of # at # deg\n"),
        ("op3, xm430-w350, ID 12", "op3, xm430-w350, ID #\n"),
        ("12.5   s  in /tmp/x/a.csv", "# s in FOLDER/a.csv\n"),
    ] {
        assert_eq!(masked(text, folder), expected);
    }
}
