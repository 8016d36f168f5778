//! Every robot that ships plays.

use super::scene::{Scene, assert_clean};
use gaitway_sim::Options;

#[test]
fn every_shipped_robot_is_ready_and_plays_a_swing_to_its_end() {
    for robot in gaitway_profiles::robot_names() {
        let mut scene = Scene::of(robot, Options::default());
        let found = scene.preflight().unwrap_or_else(|e| panic!("{robot}: {e}"));
        for plan in &found.lines {
            println!("{robot}: {plan}, at most {:.0} Hz", plan.limit_hz);
        }
        let played = scene.play_until(0.2, 2, &|| false);
        assert_eq!(played.run.stop, None, "{robot}");
        assert_eq!(played.run.tally.missed_cycles, 0, "{robot}");
        assert_clean(&played.verdict);
    }
}
