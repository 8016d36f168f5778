//! One Python environment for all tests that need other people's Python programs: made once under
//! the target folder, to the versions in `requirements.txt`, whoever comes first. What is too large for all has one of its own.

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
    let within = |folder: &Path| Python {
        program: folder.join("bin/python"),
        beside: folder.join("beside"),
    };
    let folder =
        environment("python-environment", &[REQUIREMENTS, BESIDE], "serial, mcap", |made| {
            made.pip("requirements.txt", &[])?;
            let beside = within(&made.folder).beside;
            made.pip("beside.txt", &["--target", &beside.display().to_string()])
        })?;
    Ok(within(&folder))
}

/// An environment that is being made.
pub struct Making {
    folder: PathBuf,
}

impl Making {
    /// Installs a list of this folder.
    pub fn pip(&self, list: &str, more: &[&str]) -> Result<(), String> {
        let lists = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/python");
        let mut pip = Command::new(self.folder.join("bin/python"));
        pip.args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check"]);
        run(pip.args(["--no-deps", "-r"]).arg(lists.join(list)).args(more))
    }
}

/// The folder of an environment with what the lists name, in which some modules can be imported: made, unless it is there.
pub fn environment(
    name: &str,
    lists: &[&str],
    modules: &str,
    fill: impl Fn(&Making) -> Result<(), String>,
) -> Result<PathBuf, String> {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    // Several test programs may come at once: one makes it, the others wait.
    let lock = File::create(folder.with_extension("lock")).map_err(|e| e.to_string())?;
    lock.lock().map_err(|e| e.to_string())?;
    let (complete, wanted) = (folder.join("complete"), lists.concat());
    let import = format!("import {modules}");
    let usable = run(Command::new(folder.join("bin/python")).args(["-c", &import])).is_ok();
    if usable && fs::read_to_string(&complete).is_ok_and(|found| found == wanted) {
        return Ok(folder);
    }
    run(Command::new("python3").args(["-m", "venv", "--clear"]).arg(&folder))?;
    fill(&Making { folder: folder.clone() })?;
    fs::write(complete, wanted).map_err(|e| e.to_string())?;
    Ok(folder)
}

fn run(command: &mut Command) -> Result<(), String> {
    match command.output() {
        Ok(output) if output.status.success() => Ok(()),
        Ok(output) => Err(format!("{command:?}: {}", String::from_utf8_lossy(&output.stderr))),
        Err(cause) => Err(format!("{command:?}: {cause}")),
    }
}
