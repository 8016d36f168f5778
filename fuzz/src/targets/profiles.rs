//! Any text as every kind of profile: no panic, never more memory than the estimate that admits it,
//! and whatever is accepted can be built: a robot with its links, a virtual robot, an actuator.

use crate::shared::ALLOCATOR;
use gaitway::capture::{Chain, Mode};
use gaitway::robot::Robot;
use gaitway_profiles as profiles;
use gaitway_sim::can::Actuator;
use gaitway_sim::{Options, World};
use peakmem_alloc::PeakMemAllocTrait;

/// An error's words, with the line it is about, and what is there before any table is.
const ALWAYS_BYTES: usize = 4096;

fn estimate_holds(text: &str) {
    let estimate = profiles::toml_bytes(text);
    ALLOCATOR.reset_peak_memory();
    let _ = toml::de::DeTable::parse(text);
    let taken = ALLOCATOR.get_peak_memory();
    assert!(
        taken <= estimate + 4 * text.len() + ALWAYS_BYTES,
        "{taken} bytes for {} of text, {estimate} estimated",
        text.len()
    );
}

pub fn fuzz(input: &[u8]) {
    let Ok(text) = std::str::from_utf8(input) else { return };
    estimate_holds(text);
    // A profile is called what its file is called.
    let name = text.lines().find_map(|line| line.strip_prefix("name = \"")?.strip_suffix('"'));
    let file = format!("{}.toml", name.unwrap_or("profile"));
    if let Ok(servo) = profiles::parse_servo(&file, text) {
        assert!(servo.registers.iter().all(|register| matches!(register.bytes, 1 | 2 | 4)));
    }
    if let Ok(actuator) = profiles::parse_actuator(&file, text) {
        let _ = Actuator::with(&actuator, 1);
    }
    let _ = profiles::parse_adapter(&file, text);
    if let Ok(sensor) = profiles::parse_sensor(&file, text) {
        let _ = Chain::new(&sensor, Mode::NineAxes);
    }
    if let Ok(robot) = profiles::parse_robot(&file, text) {
        let _ = World::new(&robot, Options::default());
        if let Ok(robot) = Robot::new(robot) {
            for limits in robot.limits() {
                assert!(limits.lower_rad() < limits.upper_rad());
                assert!(limits.velocity_rad_s() > 0.0 && limits.acceleration_rad_s2() > 0.0);
            }
        }
    }
}
