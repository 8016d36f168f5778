//! Any text as markers (TRC, a table): no panic, and what is read is read the same after it was written.

#![no_main]

use gaitway::mocap::markers::{FramesOf, Markers};
use gaitway::mocap::{marker_table, trc};
use libfuzzer_sys::fuzz_target;

fn same(a: &Markers, b: &Markers) {
    assert_eq!(a.head().frames, b.head().frames);
    for frame in 0..a.head().frames {
        for point in 0..a.head().points.len() {
            let of = |markers: &Markers| markers.sample(frame, point).map(|s| s.position);
            assert_eq!(of(a), of(b));
        }
    }
}

fuzz_target!(|input: &[u8]| {
    if let Ok(markers) = trc::parse(input) {
        let mut text = Vec::new();
        // A label of nothing but blanks, or none, is not found again.
        if trc::write(&mut text, "name", &mut FramesOf::new(&markers)).is_ok() {
            same(&markers, &trc::parse(&text).expect("what was written"));
        }
    }
    if let Ok(markers) = marker_table::parse(input) {
        let mut text = Vec::new();
        let _ = marker_table::write(&mut text, &mut FramesOf::new(&markers));
        let _ = marker_table::parse(&text);
    }
});
