//! Plays two actions on a virtual robot and says how it went. For a real one, give `open` the place
//! where it is, such as `"serial:/dev/ttyUSB0"`.

use gaitway::{Options, Outcome};

pub(crate) fn main() -> Result<(), gaitway::Error> {
    let mut rig = gaitway::open("op3", "sim")?;
    let motion = rig.motion("wave-r,bow")?;
    let report = rig.play(&motion, Options { speed: 0.8, ..Options::default() })?;
    assert_eq!(report.outcome, Outcome::Done, "{:?}", report.stop_reason);
    for joint in report.joints.iter().filter(|joint| joint.peak_velocity_rad_s > 0.5) {
        let error_deg = joint.tracking_rms_rad.unwrap_or(f64::NAN).to_degrees();
        println!("{:<12} followed within {error_deg:.1} deg RMS", joint.name);
    }
    Ok(())
}
