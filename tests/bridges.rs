//! Programs in `examples/` that bring what others measure to Gaitway, with the others' own software at the far end.

mod aloud;
mod program;
mod python;

use aloud::aloud;
use program::{folder, gaitway, words};
use std::fs;
use std::io::{BufRead, BufReader};
use std::net::TcpListener;
use std::path::Path;
use std::process::{Child, Command, Stdio};

/// A sensor of the Lab Streaming Layer, at 200 Hz and in units of its own, whose numbers say which sample it is.
const OUTLET: &str = r#"
import pylsl, time
info = pylsl.StreamInfo("wrist", "IMU", 7, 200, pylsl.cf_double64, "wrist-of-a-test")
channels = info.desc().append_child("channels")
for label, unit in [("battery", ""), ("acc_x", "g"), ("acc_y", "m/s2"), ("acc_z", "g"),
                    ("gyro_x", "deg/s"), ("gyro_y", "rad/s"), ("gyro_z", "deg/s")]:
    channel = channels.append_child("channel")
    channel.append_child_value("label", label)
    channel.append_child_value("unit", unit)
outlet = pylsl.StreamOutlet(info)
while not outlet.wait_for_consumers(1.0):
    pass
begin = pylsl.local_clock()
for number in range(200 * 60):
    while pylsl.local_clock() < begin + number / 200:
        time.sleep(0.001)
    outlet.push_sample([3.9, 0.01 * (number % 100), 0.5, 1.0, number % 60, -2.0, 90.0], begin + number / 200)
"#;

/// Ends a process that goes on for ever.
struct Ended(Child);

impl Drop for Ended {
    fn drop(&mut self) {
        // It may have ended.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[test]
fn a_sensor_of_the_lab_streaming_layer_is_recorded_with_its_own_times_and_units() {
    let python = match python::python() {
        Ok(python) => python.program,
        Err(cause) => {
            return aloud!("SKIPPED: nothing of the Lab Streaming Layer was heard: {cause}");
        }
    };
    let folder = folder("lsl");
    // Nobody outside this machine hears of it.
    let settings = folder.join("lsl.cfg");
    fs::write(&settings, "[multicast]\nResolveScope = machine\n[log]\nlevel = -3\n")
        .expect("written");
    let port = TcpListener::bind("127.0.0.1:0").expect("a port").local_addr().expect("it").port();
    let bridge = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/lsl_in.py");
    let begin = |arguments: &[&str]| {
        let mut command = Command::new(&python);
        command.args(arguments).env("LSLAPICFG", &settings).stderr(Stdio::piped());
        Ended(command.spawn().expect("Python"))
    };
    let _outlet = begin(&["-c", OUTLET]);
    let mut bridge = begin(&[&bridge.display().to_string(), "wrist", &port.to_string()]);
    let said = BufReader::new(bridge.0.stderr.take().expect("its words"));
    let is_ready = said.lines().map_while(Result::ok).any(|line| line.starts_with("to go on"));
    assert!(is_ready, "the bridge found no stream");

    let source = format!("right_forearm=imu:arduino-csv@tcp:127.0.0.1:{port}");
    let run = |arguments: &[&str]| {
        let output = gaitway().current_dir(&folder).args(arguments).output().expect("the program");
        assert!(output.status.success(), "{arguments:?}: {}", words(&output));
    };
    run(&["record", &source, "-o", "wave.mcap", "--for", "3s"]);
    run(&["convert", "wave.mcap", "wave.csv"]);
    let text = fs::read_to_string(folder.join("wave.csv")).expect("a table");
    let mut lines = text.lines();
    let titles: Vec<&str> = lines.next().expect("titles").split(',').collect();
    let rows: Vec<Vec<&str>> = lines.map(|line| line.split(',').collect()).collect();
    let column = |title: &str| -> Vec<f64> {
        let at = titles.iter().position(|of| *of == title).expect(title);
        rows.iter().map(|row| row[at].parse().expect(title)).collect()
    };
    assert!(rows.len() > 200, "{} samples", rows.len());
    let steps = |of: &[f64]| of.windows(2).map(|pair| pair[1] - pair[0]).collect::<Vec<f64>>();
    // Every sample, 5 ms after the one before by the sender's clock, in counts of a microsecond.
    let ticks = steps(&column("device_ticks"));
    assert!(
        ticks.iter().all(|ticks| (ticks.rem_euclid(2f64.powi(32)) - 5000.0).abs() <= 2.0),
        "{ticks:?}"
    );
    assert!(column("missed_before").iter().all(|missed| *missed == 0.0));
    // Which sample it is: by an acceleration in g of 100 kinds, and by a rate in deg/s of 60.
    let hundredth: Vec<f64> =
        column("acceleration_x_m_s2").iter().map(|of| of / 9.80665 * 100.0).collect();
    let sixtieth: Vec<f64> = column("rate_x_rad_s").iter().map(|of| of.to_degrees()).collect();
    for (of, kinds) in [(hundredth, 100.0), (sixtieth, 60.0)] {
        let steps = steps(&of);
        assert!(steps.iter().all(|step| (step.rem_euclid(kinds) - 1.0).abs() < 1e-3), "{steps:?}");
    }
    for (title, value) in [
        ("acceleration_y_m_s2", 0.5),
        ("acceleration_z_m_s2", 9.80665),
        ("rate_y_rad_s", -2.0),
        ("rate_z_rad_s", std::f64::consts::FRAC_PI_2),
    ] {
        let worst = column(title).iter().map(|of| (of - value).abs()).fold(0.0, f64::max);
        assert!(worst < 1e-5, "{title}: {worst}");
    }
}
