//! `gaitway record` on virtual sensors behind pseudo-terminals and UDP. Time is real here.

mod program;

use gaitway_sim::imu::{BodyMotion, ImuDoor, ImuErrors, ImuWire, Mount, Stage, VirtualImu};
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::net::{Ipv4Addr, SocketAddr, UdpSocket};
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

/// A sensor that turns about the vertical at 1 rad/s for so long.
fn sensor(wire: ImuWire, rate_hz: f64, seconds: f64, errors: ImuErrors) -> VirtualImu {
    let angles: Vec<f64> = (0..=(seconds * 50.0) as u32).map(|n| f64::from(n) / 50.0).collect();
    let turns: Vec<_> =
        angles.iter().map(|a| [(a / 2.0).cos(), 0.0, 0.0, (a / 2.0).sin()]).collect();
    let motion = BodyMotion::new(50.0, &vec![[0.0; 3]; turns.len()], &turns).expect("a motion");
    VirtualImu::new(motion, Mount::default(), errors, wire, rate_hz).expect("a sensor")
}

fn record(folder: &Path, arguments: &[String]) -> Output {
    crate::program::gaitway()
        .current_dir(folder)
        .args(["record", "-o", "take.mcap", "--json"])
        .args(arguments)
        .output()
        .expect("the command")
}

fn json(output: &Output) -> Value {
    serde_json::from_slice(&output.stdout)
        .unwrap_or_else(|e| panic!("no report ({e}): {}", String::from_utf8_lossy(&output.stderr)))
}

/// Rows of the table by sensor, as maps from title to cell.
fn table(folder: &Path) -> BTreeMap<String, Vec<BTreeMap<String, String>>> {
    let output = crate::program::gaitway()
        .current_dir(folder)
        .args(["convert", "take.mcap", "take.csv"])
        .output()
        .expect("the command");
    assert!(matches!(output.status.code(), Some(0 | 3)), "{output:?}");
    let text = std::fs::read_to_string(folder.join("take.csv")).expect("a table");
    let mut lines = text.lines().map(|line| line.split(',').map(str::to_owned));
    let titles: Vec<String> = lines.next().expect("titles").collect();
    let mut rows: BTreeMap<String, Vec<_>> = BTreeMap::new();
    for line in lines {
        let row: BTreeMap<String, String> = titles.iter().cloned().zip(line).collect();
        assert_eq!(row.len(), titles.len());
        rows.entry(row["sensor"].clone()).or_default().push(row);
    }
    rows
}

fn number(row: &BTreeMap<String, String>, title: &str) -> f64 {
    row[title].parse().unwrap_or_else(|e| panic!("{title} {:?}: {e}", row[title]))
}

#[test]
fn two_sensors_of_different_make_are_recorded_side_by_side() {
    let folder = crate::program::folder("record-two");
    // Without noise they would turn evenly to the bit, which no sensor that measures does.
    let rate_noise_rad_s = 0.001;
    let errors =
        ImuErrors { latency_s: 0.001, jitter_s: 0.001, rate_noise_rad_s, ..ImuErrors::default() };
    let left = sensor(ImuWire::Xsens, 100.0, 60.0, errors.clone());
    let right = sensor(ImuWire::Csv, 100.0, 60.0, errors);
    let left = ImuDoor::open(left, 115_200, None).expect("a terminal");
    let right = ImuDoor::open(right, 115_200, None).expect("a terminal");
    let output = record(
        &folder,
        &[
            format!("left=imu:xsens-mti@{}", left.path().display()),
            format!("right=imu:arduino-csv@{}", right.path().display()),
            "--for".to_owned(),
            "2s".to_owned(),
            "--name".to_owned(),
            "turn".to_owned(),
        ],
    );
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    let report = json(&output);
    assert_eq!(
        (&report["outcome"], report["sources"].as_array().map(Vec::len)),
        (&"done".into(), Some(2))
    );

    let info = crate::program::gaitway()
        .current_dir(&folder)
        .args(["info", "take.mcap"])
        .output()
        .expect("info");
    let said = String::from_utf8_lossy(&info.stdout).into_owned();
    for word in ["motion    turn", "/imu/left/sample", "/imu/right/orientation", "complete"] {
        assert!(said.contains(word), "no {word} in:\n{said}");
    }

    let rows = table(&folder);
    for name in ["left", "right"] {
        let rows = &rows[name];
        // A host that stalls reads later, and not less: the terminal keeps what it has.
        assert!(rows.len() > 100, "{name}: {}", rows.len());
        for pair in rows.windows(2) {
            assert_eq!(number(&pair[1], "number"), number(&pair[0], "number") + 1.0);
            assert!(number(&pair[1], "taken_s") >= number(&pair[0], "taken_s"));
            assert!(number(&pair[1], "taken_s") <= number(&pair[1], "read_s"));
        }
        let (first, last) = (&rows[20], &rows[rows.len() - 1]);
        assert!((number(last, "acceleration_z_m_s2") - 9.80665).abs() < 0.01);
        assert!((number(last, "rate_z_rad_s") - 1.0).abs() < 0.01);
        // 1 rad/s: the fused heading turns by as many radians as seconds pass on its own clock.
        let heading = |row| 2.0 * number(row, "fused_z").atan2(number(row, "fused_w"));
        let turned = (heading(last) - heading(first)).rem_euclid(std::f64::consts::TAU);
        let passed = (number(last, "number") - number(first, "number")) / 100.0;
        assert!((turned - passed % std::f64::consts::TAU).abs() < 0.02, "{turned} in {passed} s");
    }
}

#[test]
fn a_file_that_says_what_is_worn_names_the_sensors_and_is_kept_for_whoever_converts_the_recording()
{
    let folder = crate::program::folder("record-worn");
    let errors = ImuErrors { rate_noise_rad_s: 0.001, ..ImuErrors::default() };
    let still = |seed| {
        let motion = BodyMotion::still(60.0).expect("a motion");
        let errors = ImuErrors { seed, ..errors.clone() };
        let imu = VirtualImu::new(motion, Mount::default(), errors, ImuWire::Csv, 100.0);
        ImuDoor::open(imu.expect("a sensor"), 115_200, None).expect("a terminal")
    };
    let (pelvis, thigh) = (still(1), still(2));
    let worn = format!(
        "[segments]\npelvis = \"imu:arduino-csv@{}\"\nleft_thigh = {{ sensor = \"strap\", forward = \"y\" }}\n",
        pelvis.path().display()
    );
    std::fs::write(folder.join("worn.toml"), worn).expect("a file");
    let strap = format!("strap=imu:arduino-csv@{}", thigh.path().display());
    let order = |others: &[&str]| -> Vec<String> {
        let words = ["--wear", "worn.toml", "--for", "3s"];
        words.iter().chain(others).map(|word| (*word).to_owned()).collect()
    };
    let refused = record(&folder, &order(&[]));
    let said = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert_eq!(refused.status.code(), Some(1), "{said}");
    assert!(said.contains("no source brings a sensor that is worn"), "{said}");
    assert!(said.contains("left_thigh") && said.contains("strap"), "{said}");
    assert!(!folder.join("take.mcap").exists());

    let output = record(&folder, &order(&[&strap]));
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    let report = json(&output);
    let sources = report["sources"].as_array().expect("two").iter();
    // Each comes when it has been opened.
    let names: BTreeSet<&str> = sources.filter_map(|of| of["name"].as_str()).collect();
    assert_eq!(names, BTreeSet::from(["strap", "pelvis"]));
    let convert = |arguments: &[&str]| {
        crate::program::gaitway()
            .current_dir(&folder)
            .args(["convert", "take.mcap"])
            .args(arguments)
            .output()
            .expect("the command")
    };
    // Who stood in N pose, and when, is all that is still to be said.
    let output = convert(&["angles.csv", "--n-pose", "1,2"]);
    // One samples a moment before the other, and nothing is missing.
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    let text = std::fs::read_to_string(folder.join("angles.csv")).expect("angles");
    let mut lines = text.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let titles = lines.next().expect("titles");
    let hip = titles.iter().position(|title| title.contains("left_hip_flexion"));
    let hip = hip.unwrap_or_else(|| panic!("{titles:?}"));
    let angles: Vec<f64> = lines.map(|row| row[hip].parse().expect("a number")).collect();
    assert!(angles.len() > 150 && angles.iter().all(|rad| rad.abs() < 0.02), "{angles:?}");
    // Outside of what was recorded, and before the filters have settled, nobody can have stood there.
    for span in ["100,200", "0,0.2"] {
        let refused = convert(&["other.csv", "--n-pose", span]);
        let said = String::from_utf8_lossy(&refused.stderr).into_owned();
        assert_eq!(refused.status.code(), Some(1), "{span}: {said}");
        for words in ["no orientation in N pose", "allowed  within ", "to do    say when"] {
            assert!(said.contains(words), "{span}: no {words:?} in\n{said}");
        }
        assert!(!folder.join("other.csv").exists());
    }
    let worn = "[segments]\nhead = \"pelvis\"\n";
    std::fs::write(folder.join("otherwise.toml"), worn).expect("a file");
    let output = convert(&["head.csv", "--n-pose", "1,2", "--wear", "otherwise.toml"]);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{said}");
    let words = "worn otherwise; --wear counts: pelvis on the pelvis, strap on the left_thigh";
    assert!(said.contains(words), "{said}");
    // A person who stood in no N pose is no motion yet.
    let recognised = crate::program::gaitway()
        .current_dir(&folder)
        .args(["recognise", "take.mcap"])
        .output()
        .expect("the command");
    let said = String::from_utf8_lossy(&recognised.stderr).into_owned();
    assert!(said.contains("the recording shows no body") && said.contains("--n-pose"), "{said}");
    // Without it the samples are what there is.
    assert_eq!(convert(&["samples.csv"]).status.code(), Some(0));
}

#[test]
fn samples_that_are_lost_are_counted_and_told_by_the_exit_code() {
    let folder = crate::program::folder("record-loss");
    let errors = ImuErrors { loss: 0.1, seed: 5, ..ImuErrors::default() };
    let door = ImuDoor::open(sensor(ImuWire::Bno08xRvc, 100.0, 60.0, errors), 115_200, None)
        .expect("a terminal");
    let source = format!("imu:bno08x-rvc@{}", door.path().display());
    let output = record(&folder, &[source, "--for".to_owned(), "2s".to_owned()]);
    assert_eq!(output.status.code(), Some(3), "{output:?}");
    let report = json(&output);
    let counts = &report["sources"][0]["counts"];
    let (samples, missed) = (counts["samples"].as_u64(), counts["missed"].as_u64());
    assert!(samples > Some(50) && missed > Some(2), "{counts}");
    let rows = &table(&folder)["bno08x-rvc"];
    let in_table: f64 = rows.iter().map(|row| number(row, "missed_before")).sum();
    assert_eq!(Some(in_table as u64), missed);
}

#[test]
fn a_slimevr_tracker_finds_the_recorder_and_is_recorded() {
    let folder = crate::program::folder("record-slimevr");
    // A port that was free a moment ago.
    let free = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).and_then(|s| s.local_addr());
    let port = free.expect("a port").port();
    let imu = sensor(ImuWire::SlimeVr, 100.0, 60.0, ImuErrors::default());
    let server = SocketAddr::from((Ipv4Addr::LOCALHOST, port));
    let tracker = ImuDoor::open_slimevr(&Stage::default(), imu, server, [2, 0, 0, 0, 0, 1])
        .expect("a tracker");
    let source = format!("imu:slimevr@udp:127.0.0.1:{port}");
    let output = record(&folder, &[source, "--for".to_owned(), "3s".to_owned()]);
    drop(tracker);
    let report = json(&output);
    assert!(report["sources"][0]["counts"]["samples"].as_u64() > Some(50), "{report}");
    let rows = &table(&folder)["tracker-000001-0"];
    assert!(rows.iter().all(|row| !row["device_w"].is_empty() && row["fused_w"].is_empty()));
}

#[test]
fn trackers_of_the_network_are_heard_only_where_the_socket_is_open_to_it() {
    let free = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).and_then(|s| s.local_addr());
    let port = free.expect("a port").port();
    // The second address of the loopback interface stands for one of the network.
    let server = SocketAddr::from(([127, 0, 0, 2], port));
    let imu = sensor(ImuWire::SlimeVr, 100.0, 60.0, ImuErrors::default());
    let mac = [2, 0, 0, 0, 0, 1];
    let _tracker = ImuDoor::open_slimevr(&Stage::default(), imu, server, mac).expect("a tracker");
    let heard = |address: &str, time: &str| {
        let folder = crate::program::folder("record-slimevr-network");
        let source = format!("imu:slimevr@udp:{address}");
        let output = record(&folder, &[source, "--for".to_owned(), time.to_owned()]);
        let samples = json(&output)["sources"][0]["counts"]["samples"].as_u64();
        (samples.unwrap_or(0), String::from_utf8_lossy(&output.stderr).into_owned())
    };
    let (samples, said) = heard(&port.to_string(), "4s");
    assert_eq!(samples, 0);
    // Whoever waits for trackers is told how they can be heard.
    assert!(said.contains("this machine alone") && said.contains("udp:0.0.0.0:"), "{said}");
    let (samples, said) = heard(&format!("127.0.0.2:{port}"), "3s");
    assert!(samples > 50, "{samples}: {said}");
    assert!(!said.contains("open to the network"), "{said}");
    let (_, said) = heard(&format!("0.0.0.0:{port}"), "200ms");
    assert!(said.contains(&format!("udp:0.0.0.0:{port} is open to the network")), "{said}");
}

#[test]
fn a_sensor_that_vanishes_ends_its_source_and_not_the_recording() {
    let folder = crate::program::folder("record-vanish");
    let door = ImuDoor::open(sensor(ImuWire::Nmea, 50.0, 60.0, ImuErrors::default()), 9600, None)
        .expect("a terminal");
    let stays = ImuDoor::open(sensor(ImuWire::Csv, 50.0, 60.0, ImuErrors::default()), 9600, None)
        .expect("a terminal");
    let source = format!("goes=imu:nmea-imu@{}", door.path().display());
    let other = format!("stays=imu:arduino-csv@{}", stays.path().display());
    let child = crate::program::gaitway()
        .current_dir(&folder)
        .args(["record", &source, &other, "-o", "take.mcap", "--json", "--for", "2s"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the command");
    std::thread::sleep(Duration::from_millis(900));
    drop(door);
    let output = child.wait_with_output().expect("its end");
    assert_eq!(output.status.code(), Some(3), "{output:?}");
    let report = json(&output);
    let ended = |name: &str| {
        let sources = report["sources"].as_array().expect("sources");
        sources.iter().find(|of| of["name"] == name).expect("it")["ended"].is_string()
    };
    assert_eq!((ended("goes"), ended("stays")), (true, false), "{report}");
    assert!(report["duration_s"].as_f64() >= Some(2.0));
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(said.contains("goes is gone: "), "{said}");
}

/// Its port is there again, under the name it was opened by: the recording goes on, and tells of the gap.
#[test]
fn a_sensor_that_is_plugged_in_again_is_taken_up_in_the_same_recording() {
    let folder = crate::program::folder("record-replugged");
    let link = folder.join("goes");
    let noisy = || ImuErrors { rate_noise_rad_s: 0.001, ..ImuErrors::default() };
    let plug = || {
        let sensor = sensor(ImuWire::Nmea, 50.0, 60.0, noisy());
        ImuDoor::open(sensor, 9600, Some(&link)).expect("a terminal")
    };
    let stays = ImuDoor::open(sensor(ImuWire::Csv, 50.0, 60.0, noisy()), 9600, None);
    let stays = stays.expect("a terminal");
    let door = plug();
    let child = crate::program::gaitway()
        .current_dir(&folder)
        .arg("record")
        .arg(format!("goes=imu:nmea-imu@{}", link.display()))
        .arg(format!("stays=imu:arduino-csv@{}", stays.path().display()))
        .args(["-o", "take.mcap", "--json", "--for", "5s"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the command");
    std::thread::sleep(Duration::from_millis(1200));
    drop(door);
    std::thread::sleep(Duration::from_millis(900));
    let _door = plug();
    let output = child.wait_with_output().expect("its end");
    assert_eq!(output.status.code(), Some(3), "{output:?}");
    let report = json(&output);
    let sources = report["sources"].as_array().expect("sources");
    let goes = sources.iter().find(|of| of["name"] == "goes").expect("it");
    assert_eq!((&goes["gone"], goes["ended"].is_null()), (&1.into(), true), "{report}");
    assert!(goes["gone_s"].as_f64() >= Some(0.5), "{report}");
    let said = String::from_utf8_lossy(&output.stderr);
    for words in ["goes is gone: ", "goes is back after "] {
        assert!(said.contains(words), "no {words} in:\n{said}");
    }
    let read_s: Vec<f64> = table(&folder)["goes"].iter().map(|row| number(row, "read_s")).collect();
    let gap_s = read_s.windows(2).map(|two| two[1] - two[0]).fold(0.0, f64::max);
    let last_s = read_s[read_s.len() - 1] - read_s[0];
    assert!(gap_s >= 0.5 && last_s > gap_s + 1.0, "{gap_s} {last_s}");
}

/// Without a time to end after it would wait for ever for what cannot come.
#[test]
fn a_recording_ends_when_all_its_sources_are_gone() {
    let folder = crate::program::folder("record-all-gone");
    let doors: Vec<ImuDoor> = (0..2)
        .map(|_| {
            let sensor = sensor(ImuWire::Nmea, 50.0, 60.0, ImuErrors::default());
            ImuDoor::open(sensor, 9600, None).expect("a terminal")
        })
        .collect();
    let source =
        |name: &str, door: &ImuDoor| format!("{name}=imu:nmea-imu@{}", door.path().display());
    let child = crate::program::gaitway()
        .current_dir(&folder)
        .args(["record", &source("a", &doors[0]), &source("b", &doors[1])])
        .args(["-o", "take.mcap", "--json"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the command");
    std::thread::sleep(Duration::from_millis(900));
    drop(doors);
    let output = child.wait_with_output().expect("its end");
    assert_eq!(output.status.code(), Some(3), "{output:?}");
    let said = String::from_utf8_lossy(&output.stderr);
    for words in ["a is gone: ", "b is gone: ", "all sources are gone"] {
        assert!(said.contains(words), "no {words} in:\n{said}");
    }
}

#[test]
fn a_recording_that_was_killed_is_read_and_converted() {
    let folder = crate::program::folder("record-killed");
    let door = ImuDoor::open(sensor(ImuWire::Cobs, 100.0, 60.0, ImuErrors::default()), 9600, None)
        .expect("a terminal");
    let source = format!("imu:cobs-imu@{}", door.path().display());
    let mut child = crate::program::gaitway()
        .current_dir(&folder)
        .args(["record", &source, "-o", "take.mcap", "--quiet"])
        .spawn()
        .expect("the command");
    let path = folder.join("take.mcap");
    let began = Instant::now();
    let size = || std::fs::metadata(&path).map_or(0, |metadata| metadata.len());
    while size() < 100_000 && began.elapsed() < Duration::from_secs(20) {
        std::thread::sleep(Duration::from_millis(20));
    }
    child.kill().expect("killed");
    let _ = child.wait();
    let rows = table(&folder);
    assert!(rows["cobs-imu"].len() > 100, "{}", rows["cobs-imu"].len());
    let again = ["convert", "take.mcap", "again.csv"];
    let converted =
        crate::program::gaitway().current_dir(&folder).args(again).output().expect("convert");
    let said = String::from_utf8_lossy(&converted.stderr).into_owned();
    assert!(said.contains("cut off") && !said.contains("0 samples"), "{said}");
    let recovered =
        crate::program::gaitway().current_dir(&folder).args(["recover", "take.mcap"]).output();
    assert_eq!(recovered.expect("recover").status.code(), Some(3));
}

/// The kernel ends the file at a size, in the middle of a write if need be, as a full disk does.
#[test]
fn a_disk_that_fills_up_is_said_at_once_ends_the_recording_and_costs_nothing_before() {
    let folder = crate::program::folder("record-full");
    let doors = [ImuWire::Cobs, ImuWire::Csv].map(|wire| {
        ImuDoor::open(sensor(wire, 100.0, 60.0, ImuErrors::default()), 115_200, None)
            .expect("a terminal")
    });
    let [cobs, csv] = [0, 1].map(|n| doors[n].path().display().to_string());
    let output = Command::new("sh")
        .current_dir(&folder)
        // Blocks of 512 bytes; a write beyond them is an error instead of a signal.
        .args(["-c", "ulimit -f 500; trap '' XFSZ; exec \"$@\"", "sh"])
        .arg(crate::program::PATH)
        .args(["record", "-o", "take.mcap", "--json", "--for", "60s"])
        .args([format!("cobs=imu:cobs-imu@{cobs}"), format!("csv=imu:arduino-csv@{csv}")])
        .output()
        .expect("a shell");
    assert_eq!(output.status.code(), Some(3), "{output:?}");
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(said.contains("the disk fails") && said.contains("File too large"), "{said}");
    let report = json(&output);
    assert_eq!(report["outcome"], "done_with_loss");
    assert!(report["poisoned"].as_str().is_some_and(|why| why.contains("too large")), "{report}");
    assert!(report["duration_s"].as_f64() < Some(59.0), "it does not go on for nothing: {report}");
    assert!(report["dropped"].as_u64() > Some(0), "{report}");

    let info = crate::program::gaitway()
        .current_dir(&folder)
        .args(["info", "take.mcap", "--json"])
        .output();
    let info = json(&info.expect("info"));
    assert_eq!((&info["finished"], &info["damaged_samples"]), (&false.into(), &0.into()), "{info}");
    for name in ["cobs", "csv"] {
        let source = &info["sources"][name];
        assert!(source["records"].as_u64() > Some(50), "{name}: {info}");
        assert_eq!(source["gaps"], 0, "{name}: {info}");
    }
    let in_file: u64 =
        info["channels"].as_object().expect("channels").values().filter_map(Value::as_u64).sum();
    assert_eq!(Some(in_file), report["messages"].as_u64(), "no more and no less than was promised");
    let recovered = crate::program::gaitway()
        .current_dir(&folder)
        .args(["recover", "take.mcap", "--json"])
        .output();
    let recovered = recovered.expect("recover");
    assert_eq!(recovered.status.code(), Some(3));
    assert_eq!(json(&recovered)["messages"], in_file);
}

#[test]
fn a_robot_that_is_guided_by_hand_is_recorded() {
    let folder = crate::program::folder("record-servos");
    let arguments =
        ["servos:so101@sim:pty", "--for", "1s", "--rate", "20"].map(str::to_owned).to_vec();
    let output = record(&folder, &arguments);
    let report = json(&output);
    assert!(report["sources"][0]["counts"]["samples"].as_u64() > Some(5), "{report}");
    let converted = crate::program::gaitway()
        .current_dir(&folder)
        .args(["convert", "take.mcap", "take.csv"])
        .output()
        .expect("the command");
    assert!(matches!(converted.status.code(), Some(0 | 3)), "{converted:?}");
    let text = std::fs::read_to_string(folder.join("take.csv")).expect("a table");
    assert!(text.lines().count() > 5 && text.contains("_rad"), "{text}");
}

#[test]
fn what_cannot_be_recorded_is_refused_before_a_file_is_made() {
    let folder = crate::program::folder("record-refused");
    for (source, said) in [
        ("imu:no-such@/dev/null", "no sensor of this name"),
        ("imu:slimevr@/dev/null", "do not fit"),
        ("imu:bno08x-rvc@udp:6969", "only SlimeVR"),
        ("imu:bno08x-rvc@/dev/no-such-port", "no such port"),
        ("servos:op3@sim", "virtual time"),
        ("nonsense", "not a source"),
    ] {
        let output = record(&folder, &[source.to_owned(), "--for".to_owned(), "1s".to_owned()]);
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(!output.status.success() && text.contains(said), "{source}: {text}");
        assert!(!folder.join("take.mcap").exists(), "{source}");
    }
    let twice = ["a=lines@/dev/null", "b=lines@/dev/null", "a=lines@/dev/zero"].map(str::to_owned);
    let output = record(&folder, &twice);
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(
        output.status.code() == Some(1) && text.contains("two sources have one name"),
        "{text}"
    );
    assert!(!folder.join("take.mcap").exists());
    std::fs::write(folder.join("nobody.toml"), "[segments]\n").expect("a file");
    let (line, port) = ("l=lines@/dev/null", "imu:bno08x-rvc@/dev/zero");
    let (one, other) = (format!("a={port}"), format!("b={port}"));
    for (words, said) in [
        (["--wear=head=l", line], "this source cannot be worn"),
        (["--wear=nobody.toml", "--for=1s"], "there is nothing to record"),
        ([one.as_str(), other.as_str()], "two sources are on one port"),
    ] {
        let output = record(&folder, &words.map(str::to_owned));
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.code() == Some(1) && text.contains(said), "{words:?}: {text}");
        assert!(!folder.join("take.mcap").exists(), "{words:?}");
    }
    // What only a session heeds is not ignored without one.
    let output = record(&folder, &["lines@/dev/null", "--plan=plan.toml"].map(str::to_owned));
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.code() == Some(2) && text.contains("cannot be used with"), "{text}");
    assert!(!folder.join("take.mcap").exists());
}

/// Where the disk is full, the new file goes elsewhere; it is never the old one, nor replaces another unasked.
#[test]
fn a_recording_is_recovered_to_where_somebody_wants_it() {
    let folder = crate::program::folder("recover-out");
    let door = ImuDoor::open(sensor(ImuWire::Csv, 50.0, 60.0, ImuErrors::default()), 9600, None)
        .expect("a terminal");
    let source = format!("imu:arduino-csv@{}", door.path().display());
    record(&folder, &[source, "--for".to_owned(), "1s".to_owned()]);
    std::fs::create_dir(folder.join("elsewhere")).expect("a folder");
    let recover = |arguments: &[&str]| {
        let mut command = crate::program::gaitway();
        command.current_dir(&folder).args(["recover", "take.mcap"]).args(arguments);
        command.output().expect("recover").status.code()
    };
    let out = "elsewhere/whole.mcap";
    assert_eq!(recover(&["-o", out]), Some(0));
    let bytes = std::fs::read(folder.join(out)).expect("a file");
    assert!(!folder.join("take.recovered.mcap").exists());
    let taken = std::fs::read(folder.join("take.mcap")).expect("the old file");
    assert_eq!(recover(&["-o", out]), Some(1), "it is there already");
    assert_eq!(recover(&["-o", "take.mcap", "--force"]), Some(1), "it is what is read");
    assert_eq!(std::fs::read(folder.join("take.mcap")).expect("the old file"), taken);
    assert_eq!(recover(&["-o", out, "--force"]), Some(0));
    assert_eq!(std::fs::read(folder.join(out)).expect("a file").len(), bytes.len());
}
