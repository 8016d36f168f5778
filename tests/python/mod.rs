//! One Python environment for all tests that need other people's Python programs: made once under
//! the target folder, to the versions in `requirements.txt`, whoever comes first.

use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

/// What is installed in the environment.
pub const REQUIREMENTS: &str = include_str!("requirements.txt");
/// What is installed into the folder [`Python::beside`].
pub const BESIDE: &str = include_str!("beside.txt");

/// A Python that has what the tests ask of it.
#[derive(Clone)]
pub struct Python {
    /// The interpreter.
    pub program: PathBuf,
    /// A folder with the modules of [`BESIDE`], for `PYTHONPATH`.
    pub beside: PathBuf,
}

/// The environment, or in words why there is none. With `CI` set that is a failure: nothing may go
/// untested there unnoticed.
pub fn python() -> Result<Python, String> {
    // Asked once in each test program: a registry that cannot be reached takes its time to say so.
    static FOUND: OnceLock<Result<Python, String>> = OnceLock::new();
    match FOUND.get_or_init(installed).clone() {
        Err(cause) if std::env::var_os("CI").is_some() => {
            panic!("the Python environment of the tests cannot be made: {cause}")
        }
        found => found,
    }
}

fn installed() -> Result<Python, String> {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("python-environment");
    let python = Python { program: folder.join("bin/python"), beside: folder.join("beside") };
    // Several test programs may come at once: one makes it, the others wait.
    let lock = File::create(folder.with_extension("lock")).map_err(|e| e.to_string())?;
    lock.lock().map_err(|e| e.to_string())?;
    let complete = folder.join("complete");
    let wanted = [REQUIREMENTS, BESIDE].concat();
    let usable = run(Command::new(&python.program).args(["-c", "import serial, mcap"])).is_ok();
    if usable && fs::read_to_string(&complete).is_ok_and(|found| found == wanted) {
        return Ok(python);
    }
    run(Command::new("python3").args(["-m", "venv", "--clear"]).arg(&folder))?;
    let lists = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/python");
    let pip = |list: &str| {
        let mut pip = Command::new(&python.program);
        pip.args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check"]);
        pip.args(["--no-deps", "-r"]).arg(lists.join(list));
        pip
    };
    run(&mut pip("requirements.txt"))?;
    run(pip("beside.txt").arg("--target").arg(&python.beside))?;
    fs::write(complete, wanted).map_err(|e| e.to_string())?;
    Ok(python)
}

fn run(command: &mut Command) -> Result<(), String> {
    match command.output() {
        Ok(output) if output.status.success() => Ok(()),
        Ok(output) => Err(format!("{command:?}: {}", String::from_utf8_lossy(&output.stderr))),
        Err(cause) => Err(format!("{command:?}: {cause}")),
    }
}
