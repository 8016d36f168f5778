//! A virtual OP3 whose joints are taken by hand through what somebody does, in virtual time.

use super::*;
use crate::body::Proportions;
use crate::job::model::robot_model;
use crate::mocap::retarget::{Online, Settings};
use crate::rig::Connection;
use crate::robot::Robot;
use gaitway_sim::Hand;
use std::cell::RefCell;

/// Goals of a robot that does what somebody does, 50 times a second.
fn performed(action: &str, robot: &Robot) -> Vec<Vec<f64>> {
    let body = Proportions::of_stature(1.75).expect("a body");
    let action = crate::action::vocabulary::find(action).expect("shipped");
    let poses = action.perform().and_then(|motion| motion.poses(&body, RATE_HZ)).expect("poses");
    let model = robot_model(robot).expect("parts of a body");
    let start: Vec<f64> = robot.joints.iter().map(|joint| joint.initial_rad).collect();
    let settings = Settings { exact: true, ..Settings::default() };
    let mut online = Online::new(&model, &[true; 13], &start, &settings).expect("fits");
    poses.iter().map(|pose| online.pose(pose, 1.0 / RATE_HZ).to_vec()).collect()
}

struct Listened {
    heard: HeardRobot,
    events: Vec<(&'static str, String)>,
    words: Vec<String>,
}

/// What is told while hands lead all joints through `goals`; `each` may do more to the world at each of them.
fn told(
    connection: &mut Connection,
    goals: &[Vec<f64>],
    each: impl Fn(&mut gaitway_sim::World, usize),
) -> Listened {
    let robot = connection.link.robot().clone();
    let seen = SeenRobot::of(&robot).expect("a body");
    let how =
        HowNamed { models: None, equations: Default::default(), slowed: 1.0, keeps_poses: false };
    let naming = Naming::new(&how, None).expect("models");
    let world = connection.world.clone().expect("virtual");
    let at = RefCell::new(0);
    let is_over = || {
        let n = at.replace_with(|n| *n + 1);
        let Some(goals) = goals.get(n) else { return true };
        let mut world = world.lock();
        for (joint, to_rad) in robot.joints.iter().zip(goals) {
            let hand = Hand { to_rad: *to_rad, speed_rad_s: 20.0, torque_nm: 10.0, holds_on: true };
            world.take_by_hand(&joint.name, hand).expect("a joint");
        }
        each(&mut world, n);
        false
    };
    let (tell, told) = channel();
    let heard = listen(&mut connection.link, &seen, naming, tell, None, &is_over);
    let (mut events, mut words) = (Vec::new(), Vec::new());
    for told in told {
        match told {
            LiveWord::Recognised(event) => events.push((event.kind, event.model.clone())),
            LiveWord::Words(text) | LiveWord::Marked(_, text) => words.push(text),
            LiveWord::Posed(_) => {}
        }
    }
    Listened { heard, events, words }
}

fn op3() -> Connection {
    let addresses: Vec<Address> = vec!["sim".parse().expect("an address")];
    connect(Robot::load("op3").expect("shipped"), &addresses, 1).expect("virtual")
}

/// Registers that decide whether a joint moves, and where.
fn registers(connection: &Connection, names: &[&str]) -> Vec<i64> {
    let joints = connection.link.robot().joints.clone();
    let mut world = connection.world.as_ref().expect("virtual").lock();
    let read = joints.iter().flat_map(|joint| names.iter().map(move |name| (&joint.name, name)));
    read.map(|(joint, name)| world.read_register(joint, name).expect("a register")).collect()
}

#[test]
fn what_a_robot_is_led_through_is_named_while_it_moves_and_nothing_is_written_to_it() {
    let mut connection = op3();
    let goals = performed("wave-r", connection.link.robot());
    let names = ["Torque Enable", "Goal Position", "Profile Velocity", "Operating Mode"];
    let before = registers(&connection, &names);
    let Listened { heard, events, words } = told(&mut connection, &goals, |_, _| ());
    assert_eq!(registers(&connection, &names), before);
    let of_wave: Vec<&str> =
        events.iter().filter(|(_, model)| model == "wave-r").map(|(kind, _)| *kind).collect();
    assert_eq!(of_wave.first(), Some(&"begun"), "{events:?}");
    assert!(of_wave.contains(&"phase"), "{events:?}");
    assert_eq!(of_wave.last(), Some(&"done"), "{events:?}");
    assert!(!events.contains(&("done", "wave-l".to_owned())), "{events:?}");
    let found = &heard.named.found.events;
    let wave = found.iter().find(|event| event.action == "wave").expect("a wave");
    let length_s = goals.len() as f64 / RATE_HZ;
    assert!(wave.start_s > 0.0 && wave.end_s < length_s + 0.1, "{wave:?} of {length_s} s");
    assert!(words.is_empty() && heard.lost.is_none(), "{words:?}");
}

#[test]
fn a_robot_that_holds_itself_still_does_after_it_was_listened_to() {
    let mut connection = op3();
    let joints = connection.link.robot().joints.clone();
    {
        let mut world = connection.world.as_ref().expect("virtual").lock();
        for joint in &joints {
            world.preset(&joint.name, "Torque Enable", 1).expect("a register");
        }
    }
    let seen = SeenRobot::of(connection.link.robot()).expect("a body");
    let how =
        HowNamed { models: None, equations: Default::default(), slowed: 1.0, keeps_poses: false };
    let naming = Naming::new(&how, None).expect("models");
    let (tell, _told) = channel();
    let time = Some(Duration::from_secs(1));
    let heard = listen(&mut connection.link, &seen, naming, tell, time, &|| false);
    assert!(heard.named.found.events.is_empty(), "{:?}", heard.named.found.events);
    assert!((heard.named.last_s - 1.0).abs() < 0.1, "{}", heard.named.last_s);
    assert_eq!(registers(&connection, &["Torque Enable"]), vec![1; joints.len()]);
}

#[test]
fn what_moves_with_a_joint_that_is_silent_is_unknown_and_named_by_nobody() {
    let mut connection = op3();
    let goals = performed("wave-r", connection.link.robot());
    let unplug = |world: &mut gaitway_sim::World, n: usize| {
        if n == 0 {
            world.unplug("r_el").expect("a joint");
        }
    };
    let Listened { heard, events, words } = told(&mut connection, &goals, unplug);
    assert!(!events.iter().any(|(_, model)| model == "wave-r"), "{events:?}");
    assert_eq!(words, ["silent: r_el; what moves with that is unknown"]);
    let blind: Vec<&str> = heard.named.found.blind.iter().map(|of| of.model.as_str()).collect();
    assert!(blind.contains(&"wave-r") && !blind.contains(&"wave-l"), "{blind:?}");
    // One that falls silent later is unknown from then on, and known again once it answers.
    let mut later = op3();
    let gap = |world: &mut gaitway_sim::World, n: usize| match n {
        25 => world.unplug("r_el").expect("a joint"),
        60 => world.plug("r_el").expect("a joint"),
        _ => {}
    };
    let Listened { words, .. } = told(&mut later, &goals, gap);
    let said = ["silent: r_el; what moves with that is unknown", "all joints answer again"];
    assert_eq!(words.get(..2), Some(&said.map(String::from)[..]), "{words:?}");
    // The other arm is seen as before.
    let goals = performed("wave-l", connection.link.robot());
    let Listened { events, .. } = told(&mut connection, &goals, |_, _| ());
    assert!(events.contains(&("done", "wave-l".to_owned())), "{events:?}");
}

#[test]
fn a_robot_of_which_nobody_answers_is_no_robot_that_stands_still() {
    let mut connection = op3();
    let goals = performed("bow", connection.link.robot());
    let names = connection.link.robot().joint_names();
    let Listened { heard, .. } = told(&mut connection, &goals, |world, n| {
        names.iter().filter(|_| n == 0).for_each(|joint| world.unplug(joint).expect("a joint"));
    });
    let lost = heard.lost.expect("it is said");
    assert!(lost.contains("none of its joints answered"), "{lost}");
}

#[test]
fn sources_are_told_from_motions() {
    for text in ["imu:bno08x-rvc@/dev/ttyUSB0", "left_thigh=imu:bno08x-rvc@serial:/dev/x"] {
        assert!(is_source(text), "{text}");
    }
    for text in ["servos:op3@serial:/dev/x", "servos:op3", "replay:a.mcap", "lines@/dev/x", "imu"] {
        assert_eq!(is_source(text), text.contains(['@', ':']), "{text}");
    }
    for text in ["walk:6s,bow", "dance.bvh", "a/b=imu:x.bvh", "imu.bvh", "servos/x.mcap"] {
        assert!(!is_source(text), "{text}");
    }
}

#[test]
fn what_was_heard_is_shown_evenly_each_moment_as_it_was_known_then() {
    let pose = |x: f64| SegmentPose {
        root_m: glam::DVec3::X * x,
        orientation: [glam::DQuat::IDENTITY; 13],
    };
    let poses = [(0.03, pose(1.0)), (0.05, pose(2.0)), (0.099, pose(3.0))];
    let evenly = evenly(&poses).expect("poses");
    let places: Vec<f64> = evenly.iter().map(|pose| pose.root_m.x).collect();
    assert_eq!(places, [1.0, 1.0, 1.0, 2.0, 2.0]);
    assert!(super::evenly(&[]).is_none());
}
