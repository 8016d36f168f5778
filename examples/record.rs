//! Records a motion while it is played, and reads the recording.

use gaitway::{Options, recording};

pub(crate) fn main() -> Result<(), gaitway::Error> {
    let file = std::env::temp_dir().join(format!("bow-{}.mcap", std::process::id()));
    let mut rig = gaitway::open("open-duck-mini-v2", "sim")?;
    let motion = rig.motion("bow")?;
    let options = Options { record: Some(file.clone()), ..Options::default() };
    let report = rig.play(&motion, options)?;
    let recording = recording::read(&file)?;
    assert!(recording.finished && recording.cycles.len() as u64 == report.cycles);
    for (index, name) in recording.joint_names.iter().enumerate() {
        let angles = recording.cycles.iter().filter_map(|c| c.joints[index].present_position_rad);
        let (low, high) = angles.fold((f64::MAX, f64::MIN), |(l, h), a| (l.min(a), h.max(a)));
        println!("{name:<20} {:6.1} to {:5.1} deg", low.to_degrees(), high.to_degrees());
    }
    std::fs::remove_file(&file).map_err(|e| gaitway::Error::new(e.to_string()))
}
