//! CAN lines of `simulate` as a USB-CAN adapter: other people's Python programs, unmodified, move
//! virtual actuators through a pseudo-terminal, and where they are is looked up past the line.

mod aloud;
mod program;
mod python;

use aloud::aloud;
use gaitway_sim::{Door, Options, World};
use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::sync::{Arc, Mutex, PoisonError};

const ROBOT: &str = include_str!("can_door/four-families.toml");

/// The robot's world, and a line's door.
fn door(line_name: &str) -> (Arc<Mutex<World>>, Door) {
    door_of("four-families.toml", ROBOT, line_name)
}

/// The world of a robot's file, and a line's door.
fn door_of(file: &str, robot: &str, line_name: &str) -> (Arc<Mutex<World>>, Door) {
    let robot = gaitway_profiles::parse_robot(file, robot).expect("a robot");
    let world = World::new(&robot, Options::default()).expect("a world");
    let line = world.line_names().iter().position(|name| name == line_name).expect("a line");
    let world = Arc::new(Mutex::new(world));
    let door = Door::open(Arc::clone(&world), line, None).expect("a door");
    (world, door)
}

/// Lets Python move the actuator of a family by half a radian, and looks whether it went.
fn moves(family: &str) {
    let python = match python::python() {
        Ok(python) => python,
        Err(why) => {
            aloud!("SKIPPED: no Python program moved the virtual {family} actuator: {why}");
            return;
        }
    };
    let (world, door) = door(family);
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/can_door/move.py");
    let Output { status, stderr, .. } = Command::new(python.program)
        .arg(script)
        .arg(family)
        .arg(door.path())
        .output()
        .expect("Python starts");
    assert!(status.success(), "{family}: {}", String::from_utf8_lossy(&stderr));
    let world = world.lock().unwrap_or_else(PoisonError::into_inner);
    let joint = format!("{family}_joint");
    let position = world.joint_position_rad(&joint).expect("the joint");
    // It was let go once it was there, and may have coasted on.
    assert!((position - 0.5).abs() < 0.1, "{family}: {position} rad");
    assert!(world.verdict().goals > 0);
}

#[test]
fn damiao_motor_moves_a_virtual_damiao() {
    moves("damiao");
}

#[test]
fn python_can_moves_a_virtual_cubemars() {
    moves("cubemars");
}

#[test]
fn python_can_moves_a_virtual_odrive() {
    moves("odrive");
}

#[test]
fn the_moteus_package_moves_a_virtual_moteus_with_fd_frames() {
    moves("moteus");
}

#[test]
fn the_example_of_the_readme_does_what_it_says() {
    let python = match python::python() {
        Ok(python) => python,
        Err(why) => {
            aloud!("SKIPPED: the README's python-can example was not tried: {why}");
            return;
        }
    };
    let readme = include_str!("../sim/README.md");
    let examples = readme.split("```python\n").filter_map(|text| text.split_once("```"));
    let mut examples = examples.map(|(code, _)| code).filter(|code| code.contains("import can\n"));
    let example = examples.next().expect("an example");
    let tables = readme.split("```toml\n").filter_map(|text| text.split_once("```"));
    let mut tables = tables.map(|(text, _)| text).filter(|text| text.contains("dm4310"));
    let (world, door) = door_of("my-robot.toml", tables.next().expect("a robot"), "bus");
    let path = door.path().display().to_string();
    let output = Command::new(python.program)
        .args(["-c", &example.replace("/tmp/my-robot", &path)])
        .output()
        .expect("Python starts");
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    assert_eq!(said.trim(), "0x11 0.5", "{}", String::from_utf8_lossy(&output.stderr));
    // Who copies it to a real actuator gets no blow.
    let verdict = world.lock().unwrap_or_else(PoisonError::into_inner).verdict();
    assert!(verdict.goals > 200 && verdict.is_clean(), "{:?}", verdict.violations);
}

fn simulate(arguments: &[&str]) -> Command {
    let mut command = crate::program::gaitway();
    let robot = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/can_door/four-families.toml");
    command.arg("simulate").arg(robot).args(arguments);
    command
}

#[test]
fn simulate_says_where_each_can_line_is_and_an_adapter_answers_there() {
    let mut child =
        simulate(&[]).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("the simulator");
    let stdout = BufReader::new(child.stdout.take().expect("an output"));
    let lines: Vec<String> = stdout.lines().take(4).map(|line| line.expect("text")).collect();
    let (path, name) = lines[0].split_once(' ').expect("a path and a name");
    assert_eq!((path.starts_with("/dev/"), name), (true, "damiao"), "{lines:?}");
    let mut port = std::fs::File::options().read(true).write(true).open(path).expect("a port");
    port.write_all(b"V\r").expect("written");
    let mut version = [0; 6];
    port.read_exact(&mut version).expect("an answer");
    assert_eq!(&version, b"V1013\r");
    let interrupted = Command::new("kill").args(["-INT", &child.id().to_string()]).status();
    assert!(interrupted.expect("kill").success());
    let output = child.wait_with_output().expect("an end");
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success() && said.contains("referee: no rule broken"), "{said}");
}

#[test]
fn an_interface_for_a_line_must_be_named_and_be_there() {
    for (arguments, what, hint) in [
        (&["--can", "vcan0"][..], "which CAN line is meant?", "NAME=INTERFACE"),
        (&["--can", "arms=vcan0"], "there is no such CAN line", "cubemars"),
        (&["--can", "odrive=nocan7"], "cannot put the line on this interface", "nocan7"),
    ] {
        let output = simulate(arguments).output().expect("a run");
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(!output.status.success() && said.contains(what) && said.contains(hint), "{said}");
    }
}
