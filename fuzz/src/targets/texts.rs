//! Any text as an action, a mapping, a calibration of a robot or of a body, a plan, the files of a
//! session, edits of markers and thresholds of a corpus: no panic, and what is accepted is read the same after it was written.

use gaitway::action::{file, phrase};
use gaitway::body::anthropometry::Subject;
use gaitway::body::worn::kept::Kept;
use gaitway::calibration::Calibration;
use gaitway::clean::edits::{EditList, EditStep};
use gaitway::clean::thresholds::Thresholds;
use gaitway::clean::trial::Trial;
use gaitway::mocap::mapping::MappingFile;
use gaitway::session::files::{BodyCheck, DeviceCheck, SessionFile, TrialFile};
use gaitway::session::manifest::Manifest;
use gaitway::session::plan::Plan;
use gaitway::toml_text::from_toml;
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

/// Edits as they are read, written again, and taken to a trial that has some of their markers.
fn edits(text: &str) {
    let Ok(list) = EditList::parse(text) else { return };
    let again = EditList::parse(&list.to_text().expect("a text")).expect("its own text");
    assert_eq!(again, list);
    let labels = list.edits.iter().take(3).map(|edit| edit.marker.clone()).collect();
    let trial = Trial::new(100.0, labels, 200).expect("room");
    for edit in &list.edits {
        if let Ok(Some(step)) = EditStep::of(edit, &trial, 1) {
            assert!(step.marker < trial.markers() && step.frames.end <= trial.frames());
        }
    }
}

pub fn fuzz(input: &[u8]) {
    let Ok(text) = std::str::from_utf8(input) else { return };
    action(text);
    edits(text);
    if let Ok(thresholds) = Thresholds::parse(text) {
        session::<Thresholds>(text);
        assert!(thresholds.most_doubt_percent.is_none_or(|of| (0.0..=100.0).contains(&of)));
    }
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
}
