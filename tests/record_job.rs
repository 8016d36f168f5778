//! A recording made by a program instead of a person at a terminal.

mod program;

use gaitway::job::Nobody;
use gaitway::job::record::{Mode, RecordOrder, record};
use gaitway::port::{Clock, MonotonicClock};
use gaitway::recording::{Marker, sensor_series};
use gaitway::time::Duration;
use std::io::Write;
use std::net::TcpListener;
use std::sync::mpsc::channel;

#[test]
fn a_mark_that_was_set_before_the_recording_began_is_one_of_its_beginning() {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = listener.local_addr().expect("its address");
    std::thread::spawn(move || {
        let (mut line, _) = listener.accept().expect("the recording");
        while line.write_all(b"1,2,3\n").is_ok() {
            std::thread::sleep(std::time::Duration::from_millis(5));
        }
    });
    let file = program::folder("early-mark").join("take.mcap");
    let (sender, marks) = channel();
    let early = Marker { at: MonotonicClock.now(), text: "early".to_owned() };
    sender.send(early).expect("somebody listens");
    let order = RecordOrder {
        sources: vec![format!("lines@tcp:{address}").parse().expect("a source")],
        file: file.clone(),
        replace: false,
        time: Some(Duration::from_secs_f64(0.3)),
        name: String::new(),
        mode: Mode::SixAxes,
        rate_hz: 50.0,
        limp: false,
    };
    let report = record(&order, &marks, &Nobody).expect("a recording");
    assert!(report.is_whole(), "{report:?}");
    let series = sensor_series(&file).expect("the recording");
    let began = series.start.expect("its start").monotonic_start;
    let [mark] = &series.markers[..] else { panic!("{:?}", series.markers) };
    assert_eq!(mark.text, "early");
    assert!(mark.at >= began, "{:?} before the beginning", began.since(mark.at));
}
