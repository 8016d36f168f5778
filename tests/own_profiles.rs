//! Servo, robot and sensor files of a user's own, without a rebuild: found by name beside the robot
//! file or in a folder of profiles, by driver and virtual robot alike, never under a shipped name.

mod program;

use program::json;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::Output;

/// A folder of the test's own with a robot whose servos ship with nobody.
fn folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("own-profiles").join(name);
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).expect("a folder");
    let so101 = Path::new(env!("CARGO_MANIFEST_DIR")).join("firmware-profiles/robots/so101.toml");
    let so101 = std::fs::read_to_string(so101).expect("a shipped robot");
    let arm = so101.replace("name = \"so101\"", "name = \"my-arm\"");
    write(&folder, "my-arm.toml", &arm.replace("sts3215-c001", "my-servo"));
    write(&folder, "table.csv", "time_s,shoulder_pan_rad\n0,0\n0.4,0.1\n0.8,0.1\n1.2,0\n");
    folder
}

fn write(folder: &Path, name: &str, text: &str) {
    std::fs::write(folder.join(name), text).expect("written");
}

/// As a shipped one, under a name of its own.
const SERVO: &str = "extends = \"sts3215-c001\"\nname = \"my-servo\"\nmodel = \"Mine\"\n";

fn gaitway(folder: &Path, arguments: &[&str]) -> Output {
    crate::program::gaitway()
        .current_dir(folder)
        .env("XDG_CONFIG_HOME", folder.join("config"))
        .args(arguments)
        .output()
        .expect("the command")
}

fn complaint(output: &Output) -> String {
    assert_eq!(output.status.code(), Some(1), "{output:?}");
    String::from_utf8_lossy(&[&output.stdout[..], &output.stderr].concat()).into_owned()
}

const PLAY: [&str; 5] = ["play", "table.csv", "--bus", "sim", "--json"];

/// The report of a played table, which names the servo's file.
fn plays(folder: &Path, more: &[&str], file: &Path) {
    let output = gaitway(folder, &[&PLAY[..], more].concat());
    let report = json(&output);
    assert_eq!(report["outcome"], "done", "{report:#}");
    assert_eq!(report["referee"]["violations"], Value::Array(Vec::new()));
    let own = report["profiles"].as_array().expect("profiles");
    let servo = own.iter().find(|own| own["name"] == "my-servo").expect("the servo");
    assert_eq!(servo["file"], file.canonicalize().expect("it is there").display().to_string());
    let crc = format!("{:08x}", crc32fast::hash(&std::fs::read(file).expect("the file")));
    assert_eq!(servo["crc32"], crc);
}

#[test]
fn a_servo_beside_the_robot_file_is_found_and_played() {
    let folder = folder("beside");
    write(&folder, "my-servo.toml", SERVO);
    plays(&folder, &["--robot", "my-arm.toml"], &folder.join("my-servo.toml"));
}

#[test]
fn a_folder_of_profiles_is_found_by_option_and_at_its_usual_place() {
    let folder = folder("folders");
    for (place, option) in
        [("mine", vec!["--profiles", "mine"]), ("config/gaitway/profiles", vec![])]
    {
        let place = folder.join(place);
        std::fs::create_dir_all(&place).expect("a folder");
        std::fs::rename(folder.join("my-arm.toml"), place.join("my-arm.toml")).expect("moved");
        write(&place, "my-servo.toml", SERVO);
        // The robot goes by its name, too.
        let more = [&["--robot", "my-arm"][..], &option].concat();
        plays(&folder, &more, &place.join("my-servo.toml"));
        let list = json(&gaitway(&folder, &[&["profile", "list", "--json"][..], &option].concat()));
        let servos = list["servos"].as_array().expect("servos");
        assert!(servos.iter().any(|servo| servo["name"] == "my-servo"), "{list:#}");
        let shown = gaitway(&folder, &[&["profile", "show", "my-servo"][..], &option].concat());
        assert!(shown.status.success(), "{}", String::from_utf8_lossy(&shown.stderr));
        let held = gaitway(&folder, &[&["servo", "info", "sim", "1"][..], &more].concat());
        assert!(String::from_utf8_lossy(&held.stdout).contains("FEETECH Mine"), "{held:?}");
        std::fs::rename(place.join("my-arm.toml"), folder.join("my-arm.toml")).expect("back");
        std::fs::remove_file(place.join("my-servo.toml")).expect("gone");
    }
}

#[test]
fn a_file_under_a_shipped_name_two_of_one_name_and_a_broken_one_are_refused_by_name() {
    let folder = folder("refused");
    let robot = ["--robot", "my-arm.toml"];
    let play = |more: &[&str]| complaint(&gaitway(&folder, &[&PLAY[..], more].concat()));
    let said = play(&robot);
    assert!(said.contains("my-servo"), "{said}");
    write(&folder, "my-servo.toml", "extends = \"sts3215-c001\"\nname = \"my-servo\"\nid = 5\n");
    let said = play(&robot);
    assert!(said.contains("my-servo.toml") && said.contains("id"), "{said}");
    let (mine, other) = (folder.join("mine"), folder.join("other"));
    for place in [&mine, &other] {
        std::fs::create_dir_all(place).expect("a folder");
        write(place, "my-servo.toml", SERVO);
    }
    let said = play(&[&robot[..], &["--profiles", "mine", "--profiles", "other"]].concat());
    assert!(said.contains("two profiles have one name") && said.contains("mine"), "{said}");
    write(&mine, "op3.toml", SERVO);
    let said = play(&[&robot[..], &["--profiles", "mine"]].concat());
    assert!(said.contains("the name of a shipped one") && said.contains("op3"), "{said}");
    let said = play(&[&robot[..], &["--profiles", "nowhere"]].concat());
    assert!(said.contains("nowhere"), "{said}");
}

#[test]
fn reports_of_all_kinds_name_the_robots_own_file_and_those_of_its_servos() {
    let folder = folder("named");
    write(&folder, "my-servo.toml", SERVO);
    let arm = folder.join("my-arm.toml").canonicalize().expect("it is there");
    let servo = folder.join("my-servo.toml").canonicalize().expect("it is there");
    let files = |report: &Value| -> Vec<String> {
        let own = report["profiles"].as_array().unwrap_or_else(|| panic!("{report:#}"));
        own.iter().map(|own| own["file"].as_str().expect("a file").to_owned()).collect()
    };
    let both = [servo.display().to_string(), arm.display().to_string()];
    let sim = ["--bus", "sim", "--json"];
    for words in [&["play", "table.csv", "--robot", "my-arm.toml"][..], &["hold", "my-arm.toml"]] {
        assert_eq!(files(&json(&gaitway(&folder, &[words, &sim].concat()))), both, "{words:?}");
    }
    let beside = ["--profiles", "mine", "--json"];
    std::fs::create_dir_all(folder.join("mine")).expect("a folder");
    std::fs::rename(&servo, folder.join("mine/my-servo.toml")).expect("moved");
    let moved = folder.join("mine/my-servo.toml").canonicalize().expect("it is there");
    for words in [
        &["scan", "sim", "--robot", "my-arm.toml"][..],
        &["servo", "info", "sim", "1", "--robot", "my-arm.toml"],
    ] {
        let report = json(&gaitway(&folder, &[words, &beside].concat()));
        let own = files(&report);
        // A model number alone finds the shipped servo, which has the same.
        let expected = if words[0] == "scan" { vec![] } else { vec![moved.display().to_string()] };
        assert_eq!(own, expected, "{words:?}: {report:#}");
    }
    let looked = gaitway(
        &folder,
        &["monitor", "my-arm.toml", "--bus", "sim", "--for", "0s", "--profiles", "mine"],
    );
    let said = String::from_utf8_lossy(&looked.stderr).into_owned();
    assert!(said.contains(&arm.display().to_string()) && said.contains("CRC-32"), "{said}");
}

#[test]
fn an_adapter_of_ones_own_is_known_to_the_simulator_and_listed() {
    let folder = folder("adapter");
    write(&folder, "my-servo.toml", SERVO);
    let adapter = "schema = 1\nname = \"my-cable\"\nmodel = \"A cable of mine\"\n\
                   usb_ids = [\"1209:abcd\"]\necho = true\nlatency_s = 0.002\nsource = \"its label\"\n";
    std::fs::create_dir_all(folder.join("mine")).expect("a folder");
    write(&folder.join("mine"), "my-cable.toml", adapter);
    let list = json(&gaitway(&folder, &["profile", "list", "--json", "--profiles", "mine"]));
    let adapters = list["adapters"].as_array().expect("adapters");
    let mine = adapters.iter().find(|one| one["name"] == "my-cable").expect("mine");
    assert_eq!(mine["usb_ids"], serde_json::json!(["1209:abcd"]));
    let arguments = ["simulate", "my-arm.toml", "--adapter", "no-cable", "--profiles", "mine"];
    let said = complaint(&gaitway(&folder, &[&arguments[..], &["--pty", "line"]].concat()));
    assert!(said.contains("my-cable"), "known are: {said}");
}
