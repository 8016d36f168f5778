//! The examples do what they say, and are short enough to be read at once.

#[path = "../examples/follow.rs"]
mod follow;
#[path = "../examples/play.rs"]
mod play;
#[path = "../examples/record.rs"]
mod record;
#[path = "../examples/stop_on_condition.rs"]
mod stop_on_condition;
#[path = "../examples/virtual_robot.rs"]
mod virtual_robot;

#[test]
fn a_motion_is_played() {
    play::main().expect("played");
}

#[test]
fn a_motion_is_stopped_on_a_condition() {
    stop_on_condition::main().expect("stopped");
}

#[test]
fn goals_of_ones_own_are_followed() {
    follow::main().expect("followed");
}

#[test]
fn a_motion_is_recorded_and_read() {
    record::main().expect("recorded");
}

#[test]
fn a_virtual_robot_answers() {
    virtual_robot::main().expect("answered");
}

#[test]
fn each_is_at_most_forty_lines() {
    for name in ["follow", "play", "record", "stop_on_condition", "virtual_robot"] {
        let path = format!("{}/examples/{name}.rs", env!("CARGO_MANIFEST_DIR"));
        let lines = std::fs::read_to_string(path).expect("an example").lines().count();
        assert!(lines <= 40, "{name}: {lines} lines");
    }
}
