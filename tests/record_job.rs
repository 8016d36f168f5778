//! A recording made by a program instead of a person at a terminal.

mod program;

use gaitway::job::Nobody;
use gaitway::job::record::{Mode, RecordOrder, record};
use gaitway::port::{Clock, MonotonicClock};
use gaitway::recording::{Marker, SampleEncoding, sensor_series};
use gaitway::time::Duration;
use std::io::Write;
use std::net::{SocketAddr, TcpListener};
use std::sync::mpsc::channel;

/// Standard gravity, m/s², as the sketch says it; of every tenth sample one beyond the range that its profile says.
fn sketch_lines() -> impl Iterator<Item = String> {
    let line = |at: u32| {
        let z_m_s2 = if at % 10 == 5 { 900.0 } else { 9.8 };
        format!("{},0,0,{z_m_s2},0,0,0\n", at * 10_000)
    };
    (0..).map(line)
}

/// Where something says these lines to whoever comes, one after so many milliseconds.
fn sayer(lines: impl Iterator<Item = String> + Send + 'static, every_ms: u64) -> SocketAddr {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = listener.local_addr().expect("its address");
    std::thread::spawn(move || {
        let (mut line, _) = listener.accept().expect("the recording");
        for text in lines {
            if line.write_all(text.as_bytes()).is_err() {
                break;
            }
            std::thread::sleep(std::time::Duration::from_millis(every_ms));
        }
    });
    address
}

#[test]
fn values_beyond_the_range_of_a_sensor_are_counted_and_told_in_words() {
    let address = sayer(sketch_lines(), 10);
    let file = program::folder("beyond").join("take.mcap");
    let output = program::gaitway()
        .args(["record", &format!("torso=imu:arduino-csv@tcp:{address}"), "--for", "1s", "-o"])
        .arg(&file)
        .output()
        .expect("the command");
    let told = program::words(&output);
    assert_eq!(output.status.code(), Some(3), "{told}");
    assert!(told.contains("with a reading that is missing or beyond the sensor's range"), "{told}");
    // By what is in the file: those are the samples that have no acceleration.
    let series = sensor_series(&file).expect("the recording");
    let samples = &series.sensors["torso"];
    let lacking = samples.iter().filter(|moment| moment.acceleration_m_s2.is_none()).count();
    assert!(
        lacking > 2 && told.contains(&format!("{lacking} with a reading")),
        "{lacking}: {told}"
    );
    let info =
        program::words(&program::gaitway().arg("info").arg(&file).output().expect("the command"));
    assert!(info.contains(&format!("{lacking} with a value beyond the sensor's range")), "{info}");
}

/// A board that turns evenly and whose values stand still from the fourth second on, while its clock goes on.
fn standing_still() -> impl Iterator<Item = String> {
    let line = |n: u32| {
        let noise = 0.004 * f64::from(n.min(400) % 7);
        format!("{},{noise},0,9.8,0,{noise},{}\n", n * 10_000, 0.5 + noise)
    };
    (0..).map(line)
}

/// A board that is turned by 25 rad/s for a fifth of a second.
fn knocked() -> impl Iterator<Item = String> {
    let line = |n: u32| {
        let (force, noise) = (0.003 * f64::from(n % 5), 0.004 * f64::from(n % 7));
        let rate = if (400..420).contains(&n) { 25.0 } else { noise };
        format!("{},{force},0,{},0,{noise},{rate}\n", n * 10_000, 9.8 + force)
    };
    (0..).map(line)
}

#[test]
fn what_nobody_who_wears_a_sensor_can_do_is_told_at_once_and_of_one_that_nobody_wears_is_not() {
    let (torso, cup) = (sayer(knocked(), 10), sayer(knocked(), 10));
    let head = sayer(standing_still(), 10);
    let file = program::folder("knocked").join("take.mcap");
    let output = program::gaitway()
        .args(["record", "--for", "6s", "--json", "-o"])
        .arg(&file)
        .arg(format!("torso=imu:arduino-csv@tcp:{torso}"))
        .arg(format!("cup=imu:arduino-csv@tcp:{cup}"))
        .arg(format!("head=imu:arduino-csv@tcp:{head}"))
        .output()
        .expect("the command");
    let told = program::words(&output);
    assert!(
        told.contains("the sensor on the torso is doubted: it turns faster than anybody can"),
        "{told}"
    );
    let doubted = &program::json(&output)["doubted"];
    assert_eq!(doubted["torso"]["times"], 1, "{told}");
    let time_s = doubted["torso"]["time_s"].as_f64().expect("a time");
    // A stride after the last such thing, for the heading; longer if the filter has not found down by then.
    assert!((1.0..3.0).contains(&time_s), "{time_s}");
    assert!(told.contains("the sensor on the head is doubted: its values stand still"), "{told}");
    assert_eq!(doubted["head"]["times"], 1, "{told}");
    assert_eq!(doubted.as_object().map(serde_json::Map::len), Some(2));
}

/// A sketch that prints every 20 ms, while its profile says 10.
#[test]
fn a_board_that_prints_half_as_often_as_its_profile_says_has_lost_nothing_and_that_is_said_once() {
    let line = |n: u32| format!("{},0,0,9.8,0,0,{:.3}\n", n * 20_000, f64::from(n % 7) * 0.01);
    let address = sayer((0..).map(line), 20);
    let file = program::folder("half-as-often").join("take.mcap");
    let output = program::gaitway()
        .args(["record", &format!("torso=imu:arduino-csv@tcp:{address}"), "--for", "3s", "-o"])
        .arg(&file)
        .output()
        .expect("the command");
    let told = program::words(&output);
    assert_eq!(output.status.code(), Some(0), "{told}");
    let sends = "sends 50.0 Hz where its profile says 100";
    assert!(told.contains(&format!("torso {sends}")), "{told}");
    // Once when it is found, and once in the report.
    assert_eq!((told.matches(sends).count(), told.matches("missing").count()), (2, 0), "{told}");
}

#[test]
fn a_mark_that_was_set_before_the_recording_began_is_one_of_its_beginning() {
    let address = sayer(std::iter::repeat_with(|| "1,2,3\n".to_owned()), 5);
    let file = program::folder("early-mark").join("take.mcap");
    let (sender, marks) = channel();
    let early = Marker { at: MonotonicClock.now(), text: "early".to_owned() };
    sender.send(early).expect("somebody listens");
    let order = RecordOrder {
        sources: vec![format!("lines@tcp:{address}").parse().expect("a source")],
        file: file.clone(),
        worn: Vec::new(),
        replace: false,
        time: Some(Duration::from_secs_f64(0.3)),
        name: String::new(),
        mode: Mode::SixAxes,
        rate_hz: 50.0,
        limp: false,
        samples: SampleEncoding::Json,
    };
    let report = record(&order, &marks, &Nobody).expect("a recording");
    assert!(report.is_whole(), "{report:?}");
    let series = sensor_series(&file).expect("the recording");
    let began = series.start.expect("its start").monotonic_start;
    let [mark] = &series.markers[..] else { panic!("{:?}", series.markers) };
    assert_eq!(mark.text, "early");
    assert!(mark.at >= began, "{:?} before the beginning", began.since(mark.at));
}
