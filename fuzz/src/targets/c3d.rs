//! Any bytes as a C3D file: no panic, never more than the file can hold, and what is read is read the same
//! after it was written.

use gaitway::mocap::c3d::{Reader, write::write};
use gaitway::mocap::markers::{Frames, FramesOf, Markers};

pub fn fuzz(input: &[u8]) {
    let Ok(reader) = Reader::new(input, input.len() as u64) else { return };
    let _ = reader.findings();
    let head = reader.head().clone();
    let counts = 4 * head.points.len() + head.analog.counts_per_frame();
    assert!(head.frames * counts * 2 <= input.len());
    let markers = reader.into_markers().expect("frames that were told of");
    let mut written = Vec::new();
    if write(&mut written, &mut FramesOf::new(&markers)).is_err() {
        return;
    }
    let again = Reader::new(written.as_slice(), written.len() as u64).expect("what was written");
    let again = again.into_markers().expect("what was written");
    assert_eq!((again.head().frames, again.head().first_frame), (head.frames, head.first_frame));
    for frame in 0..head.frames {
        for point in 0..head.points.len() {
            let of = |markers: &Markers| markers.sample(frame, point).map(|s| s.position);
            assert_eq!(of(&again), of(&markers));
        }
    }
}
