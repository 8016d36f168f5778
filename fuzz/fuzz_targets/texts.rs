//! Any text as an action, a mapping, a calibration of a robot or of a body, a plan and the files of
//! a session: no panic, and what is accepted is read the same after it was written.

#![no_main]

use gaitway::action::{file, phrase};
use gaitway::body::anthropometry::Subject;
use gaitway::body::worn::kept::Kept;
use gaitway::calibration::Calibration;
use gaitway::mocap::mapping::MappingFile;
use gaitway::session::files::{BodyCheck, DeviceCheck, SessionFile, TrialFile};
use gaitway::session::manifest::Manifest;
use gaitway::session::plan::Plan;
use gaitway::toml_text::from_toml;
use libfuzzer_sys::fuzz_target;
use serde::Serialize;
use serde::de::DeserializeOwned;

/// A file of a session, as it is read, and once more as it is written.
fn session<T: DeserializeOwned + Serialize>(text: &str) -> Option<T> {
    let value: T = from_toml(text).ok()?;
    let written = toml::to_string(&value).expect("what was read can be written");
    let again: T = from_toml(&written).expect("what was written can be read");
    assert_eq!(toml::to_string(&again).expect("as before"), written);
    Some(value)
}

fn action(text: &str) {
    let Ok(action) = file::parse(text, "action.toml", &|_| None) else { return };
    let motion = action.perform().expect("a file that is accepted can be performed");
    assert!(motion.duration_s().is_finite() && motion.duration_s() > 0.0);
    let _ = action.mirrored();
}

fuzz_target!(|input: &[u8]| {
    let Ok(text) = std::str::from_utf8(input) else { return };
    action(text);
    let _ = phrase::parse(text);
    let _ = MappingFile::parse(text);
    if let Ok(calibration) = Calibration::parse(text) {
        let again = Calibration::parse(&calibration.text().expect("a text")).expect("its own text");
        assert_eq!(again, calibration);
    }
    if let Ok(kept) = Kept::parse(text) {
        let again = Kept::parse(&kept.text().expect("a text")).expect("its own text");
        assert_eq!(again.sensors, kept.sensors);
        assert_eq!(again.calibration.mounts.len(), kept.calibration.mounts.len());
    }
    let _ = Plan::parse(text, "plan.toml");
    session::<SessionFile>(text);
    session::<TrialFile>(text);
    session::<DeviceCheck>(text);
    session::<BodyCheck>(text);
    session::<Manifest>(text);
    if let Some(subject) = session::<Subject>(text) {
        let _ = subject.check();
    }
});
