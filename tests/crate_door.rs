//! What another program cannot make this crate do: move a robot that was not looked at, or on a
//! trajectory of other joints. What it cannot even write stands as examples that do not compile beside
//! [`gaitway::robot::preflight::Preflight`], [`gaitway::guard::Command`] and the writer of goals.

mod scene;

use gaitway::control::{self, Arming, Planned};
use gaitway::motion::{Path, PlanOptions, plan};
use scene::Scene;

fn scene(robot: &str) -> Scene {
    Scene::of(robot, Default::default())
}

/// True if a servo of the head has torque on.
fn holds(scene: &Scene) -> bool {
    scene.world.lock().register("head_pan", "Torque Enable") == Some(1)
}

#[test]
fn a_trajectory_of_the_same_joints_in_another_order_is_refused_and_torque_stays_off() {
    let mut scene = scene("op3");
    let found = scene.preflight().expect("a robot that is ready");
    let mut names = scene.link.robot().joint_names();
    names.swap(0, 1);
    let rows = found.start_rad.iter().map(|&rad| vec![rad; 2]).collect();
    let path = Path::new(names, 100.0, rows).expect("a path");
    let limits = scene.link.robot().limits();
    let planned = plan(&found.start_rad, &path, &limits, PlanOptions::default()).expect("a plan");
    let refused = Planned::new(&planned.trajectory, scene.link.robot()).err();
    let said = refused.expect("another order").to_string();
    assert!(said.contains("not of this robot's joints") && said.contains("r_sho_pitch"), "{said}");
    let right = scene.swing(&found.start_rad, 0.1, 1);
    assert!(Planned::new(&right, scene.link.robot()).is_ok(), "its own are taken");
}

#[test]
fn a_robot_is_not_armed_on_what_was_found_of_another() {
    let found = scene("open-duck-mini-v2").preflight().expect("a robot that is ready");
    let mut other = scene("op3");
    let refused = control::arm::arm(&mut other.link, &found, &|| false);
    let said = refused.expect_err("another robot").to_string();
    assert!(said.contains("not the one that was checked") && said.contains("op3"), "{said}");
    assert!(!holds(&other), "nothing was switched on");
    let own = other.preflight().expect("a robot that is ready");
    let armed = control::arm::arm(&mut other.link, &own, &|| false);
    assert!(matches!(armed, Ok(Arming::Done(_))), "what was found of itself will do");
    assert!(holds(&other));
}
