//! The Python package: a wheel with the program of this test run in it, in an environment that has
//! nothing else, and what python/README.md says.

mod aloud;
mod program;
mod python;

use aloud::aloud;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn done(command: &mut Command) -> Result<Output, String> {
    let output = command.output().map_err(|e| format!("{command:?}: {e}"))?;
    if output.status.success() {
        return Ok(output);
    }
    Err(format!("{command:?}: {}", program::words(&output)))
}

/// An environment with what a list names.
fn environment(folder: &Path, wanted: &[&str]) -> Result<(), String> {
    done(Command::new("python3").args(["-m", "venv", "--clear"]).arg(folder))?;
    let mut pip = Command::new(folder.join("bin/python"));
    pip.args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check"]).args(wanted);
    done(&mut pip).map(drop)
}

/// The environment with the tools, made once; or in words why there is none. With `CI` set that is a
/// failure.
fn tools() -> Result<PathBuf, String> {
    static MADE: OnceLock<Result<PathBuf, String>> = OnceLock::new();
    let make = || {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("package-tools");
        let list = root().join("tests/python/package.txt");
        let wanted = fs::read_to_string(&list).map_err(|e| e.to_string())?;
        let complete = folder.join("complete");
        if fs::read_to_string(&complete).is_ok_and(|found| found == wanted) {
            return Ok(folder);
        }
        environment(&folder, &["-r", &list.display().to_string()])?;
        fs::write(complete, wanted).map_err(|e| e.to_string())?;
        Ok(folder)
    };
    match MADE.get_or_init(make).clone() {
        Err(cause) if std::env::var_os("CI").is_some() => panic!("no tools: {cause}"),
        found => found,
    }
}

/// maturin, which takes the program of this test run instead of building it once more.
fn maturin(tools: &Path, arguments: &[&str], output: &Path) -> Command {
    let mut maturin = Command::new(tools.join("bin/maturin"));
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    maturin.args(arguments).arg("-o").arg(output).current_dir(root());
    // maturin takes away the file that it is told of, for a moment: other tests need the program.
    let built = output.with_extension("built");
    fs::create_dir_all(&built).expect("a folder");
    let own = built.join("gaitway");
    fs::copy(program::PATH, &own).expect("a copy");
    maturin.env("REAL_CARGO", cargo).env("BUILT", own);
    maturin.env("CARGO", root().join("tests/python/cargo_with_a_binary.py"));
    maturin
}

/// The only file in a folder.
fn only_file(folder: &Path) -> PathBuf {
    let files: Vec<_> = fs::read_dir(folder).expect("a folder").flatten().collect();
    assert_eq!(files.len(), 1, "{files:?}");
    files[0].path()
}

/// What the README of the project begins with, done by the command of an environment.
fn begins(environment: &Path, folder: &Path) {
    let installed = || {
        let mut command = Command::new(environment.join("bin/gaitway"));
        command.env("XDG_CONFIG_HOME", folder.join("nobody"));
        command
    };
    let files = folder.join("begun");
    fs::create_dir(&files).expect("a folder");
    program::does_what_the_readme_begins_with(installed, &files.display().to_string());
}

/// pytest in an environment, away from the sources.
fn pytest(python: &Path, folder: &Path) -> Command {
    let mut pytest = Command::new(python);
    pytest.args(["-m", "pytest", "-q", "-p", "no:cacheprovider"]).current_dir(folder);
    pytest.env("XDG_CONFIG_HOME", folder.join("nobody")).env_remove("GAITWAY");
    pytest
}

#[test]
fn a_clean_environment_takes_the_wheel_and_three_lines_of_pytest_pass() {
    let tools = match tools() {
        Ok(tools) => tools,
        Err(cause) => return aloud!("SKIPPED: no wheel was made: {cause}"),
    };
    let folder = program::folder("wheel");
    let wheels = folder.join("wheels");
    done(&mut maturin(&tools, &["build", "--profile", "dev"], &wheels)).expect("a wheel");
    let wheel = only_file(&wheels).display().to_string();
    let clean = folder.join("clean");
    environment(&clean, &[&wheel, "pytest==9.2.0", "pyserial==3.5"]).expect("an installation");

    let version =
        done(Command::new(clean.join("bin/gaitway")).arg("--version")).expect("a program");
    assert!(program::words(&version).contains(env!("CARGO_PKG_VERSION")));

    begins(&clean, &folder);

    let (python, tests) = (clean.join("bin/python"), folder.join("tests"));
    fs::create_dir(&tests).expect("a folder");
    let three_lines = "def test_it(virtual_robot):\n    virtual_robot.joint('gripper').registers['ID'] = 9\n    \
                       assert virtual_robot.registers('arm/6')['ID'] == 9\n";
    fs::write(tests.join("test_three_lines.py"), three_lines).expect("a file");
    let said = program::words(&done(&mut pytest(&python, &tests)).expect("a test that passes"));
    assert!(said.contains("1 passed"), "{said}");

    fs::copy(root().join("tests/python/package_in_use.py"), tests.join("test_in_use.py"))
        .expect("a copy");
    let said = program::words(&done(&mut pytest(&python, &tests)).expect("tests that pass"));
    assert!(said.contains("10 passed"), "{said}");

    // One that fails shows what went over the line.
    let failing = "def test_it(virtual_robot):\n    virtual_robot.freeze()\n    \
                   virtual_robot.send(bytes.fromhex('ffff060201f6'))\n    assert False, 'on purpose'\n";
    fs::write(tests.join("test_three_lines.py"), failing).expect("a file");
    let output = pytest(&python, &tests).arg("test_three_lines.py").output().expect("pytest");
    let said = program::words(&output);
    assert!(!output.status.success() && said.contains("on purpose"), "{said}");
    assert!(said.contains("last packets of so101"), "{said}");
    assert!(said.contains("->  ping 6  ffff060201f6"), "{said}");
    assert!(said.contains("<-  6  ffff060200f7"), "{said}");
}

#[test]
fn its_types_are_complete() {
    let tools = match tools() {
        Ok(tools) => tools,
        Err(cause) => return aloud!("SKIPPED: its types were not checked: {cause}"),
    };
    let mut mypy = Command::new(tools.join("bin/python"));
    let cache = Path::new(env!("CARGO_TARGET_TMPDIR")).join("mypy");
    mypy.args(["-m", "mypy", "--strict", "python/gaitway", "--cache-dir"]).arg(cache);
    done(mypy.current_dir(root())).expect("no complaint");
}

#[test]
fn the_source_package_has_all_that_the_program_is_built_of_and_installs() {
    let tools = match tools() {
        Ok(tools) => tools,
        Err(cause) => return aloud!("SKIPPED: no source package was made: {cause}"),
    };
    let folder = program::folder("sdist");
    done(&mut maturin(&tools, &["sdist"], &folder)).expect("a source package");
    let mut tar = Command::new("tar");
    let package = only_file(&folder);
    let listed = done(tar.arg("-tzf").arg(&package)).expect("a list");
    let listed = program::words(&listed);
    for file in [
        "pyproject.toml",
        "python/gaitway/pytest_plugin.py",
        "python/gaitway/py.typed",
        "Cargo.lock",
        "src/main.rs",
        "sim/src/control.rs",
        "firmware-profiles/robots/so101.toml",
        "firmware-profiles/build.rs",
    ] {
        assert!(listed.lines().any(|line| line.ends_with(&format!("/{file}"))), "{file}: {listed}");
    }
    if std::env::var_os("GAITWAY_LONG").is_none() {
        return aloud!("SKIPPED: the source package is built and installed with GAITWAY_LONG=1");
    }
    let place = program::folder("sdist-installed");
    let clean = place.join("clean");
    environment(&clean, &[&package.display().to_string()]).expect("a build and an installation");
    begins(&clean, &place);
}

/// The blocks of Python below a heading of the README, up to the next heading as high.
fn recipes() -> Vec<(String, String)> {
    let text = fs::read_to_string(root().join("python/README.md")).expect("a README");
    let (_, recipes) = text.split_once("## Recipes\n").expect("recipes");
    let (recipes, _) = recipes.split_once("\n## ").expect("something after them");
    let parts = recipes.split("\n### ").skip(1);
    let recipe = |part: &str| {
        let name = part.lines().next()?.to_owned();
        let (_, code) = part.split_once("```python\n")?;
        Some((name, code.split_once("```")?.0.to_owned()))
    };
    parts.filter_map(recipe).collect()
}

#[test]
fn the_recipes_of_its_readme_work() {
    let python = match python::python() {
        Ok(python) => python,
        Err(cause) => return aloud!("SKIPPED: no recipe was tried: {cause}"),
    };
    let folder = program::folder("recipes");
    let recipes = recipes();
    let names: Vec<&str> = recipes.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(names, ["DynamixelSDK", "LeRobot", "pypot", "rustypot"]);
    for (name, code) in &recipes {
        fs::write(folder.join(format!("test_{}.py", name.to_lowercase())), code).expect("a file");
    }
    // LeRobot's motors are ours to try without torch, which they do not use.
    fs::write(folder.join("conftest.py"), include_str!("clients/lerobot_alone.py"))
        .expect("a file");
    let mut pytest = pytest(&python.program, &folder);
    pytest.args(["-p", "gaitway.pytest_plugin"]).env("GAITWAY", program::PATH);
    pytest.env("PYTHONPATH", root().join("python")).env("GAITWAY_BESIDE", &python.beside);
    let said = program::words(&done(&mut pytest).expect("recipes that work"));
    assert!(said.contains("4 passed"), "{said}");
}
