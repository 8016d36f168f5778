//! Any text as markers (TRC, CSM, a table), as a table of OpenSim's, of joint angles or of sensors: no panic, and markers that were
//! read are read the same after they were written.

use gaitway::action::table;
use gaitway::capture::Mode;
use gaitway::mocap::markers::{FramesOf, Markers};
use gaitway::mocap::{csm, marker_table, opensim, trc};
use gaitway::session::tables::{self, DeclaredSensors};

/// What a table of one sensor may be called.
const SENSOR: &str = r#"
time = "t"
[[sensor]]
name = "a"
rate = ["u", "v", "w"]
acceleration = ["x", "y", "z"]
field = ["x", "y", "z"]
"#;

fn same(a: &Markers, b: &Markers) {
    assert_eq!(a.head().frames, b.head().frames);
    for frame in 0..a.head().frames {
        for point in 0..a.head().points.len() {
            let of = |markers: &Markers| markers.sample(frame, point).map(|s| s.position);
            assert_eq!(of(a), of(b));
        }
    }
}

pub fn fuzz(input: &[u8]) {
    if let Ok(markers) = trc::parse(input) {
        let mut text = Vec::new();
        // A label of nothing but blanks, or none, is not found again.
        if trc::write(&mut text, "name", &mut FramesOf::new(&markers)).is_ok() {
            same(&markers, &trc::parse(&text).expect("what was written"));
        }
    }
    if let Ok(markers) = csm::parse(input) {
        let mut text = Vec::new();
        // Without a rate none is written.
        if csm::write(&mut text, "name", &mut FramesOf::new(&markers)).is_ok() {
            same(&markers, &csm::parse(&text).expect("what was written"));
        }
    }
    if let Ok(table) = opensim::parse(input) {
        assert_eq!(table.cell(table.rows(), 0), None);
        if let Ok(body) = table.body_angles() {
            assert_eq!(body.angles.len(), body.pelvis.len());
        }
    }
    if let Ok(text) = str::from_utf8(input) {
        let declared = DeclaredSensors::parse(SENSOR).expect("a declaration");
        for found in [tables::of_xsens(text, "a"), tables::of_table(text, &declared)] {
            let Ok(mut series) = found else { continue };
            let none = DeclaredSensors::default();
            let _ = tables::fuse(&mut series, &none, Some(Mode::NineAxes));
        }
    }
    if let Ok(angles) = table::parse(input) {
        assert!(angles.rate_hz.is_finite() && angles.rate_hz > 0.0);
        assert!(angles.angles.iter().flat_map(|of| of.0).all(f64::is_finite));
    }
    if let Ok(markers) = marker_table::parse(input) {
        let mut text = Vec::new();
        let _ = marker_table::write(&mut text, &mut FramesOf::new(&markers));
        let _ = marker_table::parse(&text);
    }
}
