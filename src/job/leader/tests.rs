//! A virtual arm that hands lead and a virtual arm that follows it, in virtual time.

use super::*;
use crate::job::observer::{Nobody, Observer};
use crate::robot::Robot;
use gaitway_sim::{Hand, World};

fn order(leader: &str, robot: &str) -> LeadOrder {
    LeadOrder {
        leader: format!("servos:{leader}@sim"),
        leader_calibration: None,
        limp: false,
        by_range: Vec::new(),
        robot: robot.to_owned(),
        buses: vec!["sim".parse().expect("an address")],
        calibration: None,
        seed: 1,
        rate_hz: Some(100.0),
        pace: 1.0,
        time: Some(Duration::from_secs(6)),
        record: None,
        replace: false,
        accept_firmware: true,
        dry_run: false,
    }
}

/// A leader and a follower on lines of their own, and what the former's world goes through: told the time of the follower.
struct Scene {
    order: LeadOrder,
    leader: Connection,
    follower: Connection,
    pairs: Pairs,
}

impl Scene {
    fn new(order: LeadOrder) -> Self {
        let open = |name: &str| {
            connect(Robot::load(name).expect("shipped"), &order.buses, 1).expect("virtual")
        };
        let name = order.leader.trim_start_matches("servos:").trim_end_matches("@sim").to_owned();
        let (leader, follower) = (open(&name), open(&order.robot));
        let (one, two) = (leader.link.robot(), follower.link.robot());
        let pairs = Pairs::of(one, two, &order.by_range).expect("joints in common");
        Self { order, leader, follower, pairs }
    }

    /// Follows while `hands` do something to the leader's world once, as soon as it is looked at.
    fn follow(self, hands: impl FnOnce(&mut World)) -> (LiveReport, Worlds) {
        self.watched(hands, &Nobody)
    }

    /// The same before somebody who is asked in every cycle.
    fn watched(
        mut self,
        hands: impl FnOnce(&mut World),
        observer: &dyn Observer,
    ) -> (LiveReport, Worlds) {
        let mut report = self.order.report();
        let (ours, theirs) = (self.leader.world.clone(), self.follower.world.clone());
        hands(&mut ours.as_ref().expect("virtual").lock());
        let done =
            lead(&self.order, self.leader, &mut self.follower, self.pairs, observer, &mut report);
        if let Err(error) = &done {
            report.run.describe_refused(error);
        }
        drop(done);
        (report, Worlds { leader: ours.expect("virtual"), follower: theirs.expect("virtual") })
    }
}

/// What both worlds are like afterwards.
struct Worlds {
    leader: crate::port::sim::SharedWorld,
    follower: crate::port::sim::SharedWorld,
}

impl Worlds {
    fn of(world: &crate::port::sim::SharedWorld, joint: &str) -> f64 {
        world.lock().joint_position_rad(joint).expect("a joint")
    }

    fn torque(world: &crate::port::sim::SharedWorld, joint: &str) -> i64 {
        world.lock().read_register(joint, "Torque Enable").expect("a register")
    }
}

fn hand(world: &mut World, joint: &str, to_rad: f64, speed_rad_s: f64) {
    let hand = Hand { to_rad, speed_rad_s, torque_nm: 3.0, holds_on: true };
    world.take_by_hand(joint, hand).expect("a joint");
}

#[test]
fn an_arm_goes_where_another_is_led_by_hand_and_ends_at_rest() {
    let scene = Scene::new(order("so101-leader", "so101"));
    let (report, worlds) = scene.follow(|world| {
        hand(world, "shoulder_pan", 0.8, 0.5);
        hand(world, "elbow_flex", -0.6, 0.4);
    });
    assert_eq!(report.run.outcome, Outcome::Done, "{:?}", report.run.stop_reason);
    for joint in ["shoulder_pan", "elbow_flex", "wrist_flex"] {
        let (led, followed) =
            (Worlds::of(&worlds.leader, joint), Worlds::of(&worlds.follower, joint));
        assert!((led - followed).abs() < 0.03, "{joint}: {followed} for {led}");
    }
    assert!(Worlds::of(&worlds.follower, "shoulder_pan") > 0.75);
    for joint in &report.run.joints {
        assert_eq!(joint.end_velocity_rad_s, 0.0, "{}", joint.name);
    }
    assert!(worlds.follower.lock().verdict().violations.is_empty());
    // Nobody wrote to the leader.
    assert_eq!(Worlds::torque(&worlds.leader, "gripper"), 0);
    assert!(report.sensors[0].counts.samples > 300, "{:?}", report.sensors);
}

#[test]
fn a_leader_that_is_thrown_about_is_followed_within_limits_and_at_the_pace_that_was_asked_for() {
    for pace in [1.0, 0.25] {
        let scene = Scene::new(LeadOrder { pace, ..order("so101-leader", "so101") });
        let limits = scene.follower.link.robot().limits();
        let (report, worlds) = scene.follow(|world| {
            hand(world, "shoulder_pan", 1.9, 30.0);
            hand(world, "wrist_roll", -2.7, 30.0);
        });
        assert_eq!(report.run.outcome, Outcome::Done, "{:?}", report.run.stop_reason);
        for (joint, limits) in report.run.joints.iter().zip(&limits) {
            let most = pace * limits.velocity_rad_s() * (1.0 + 1e-9);
            assert!(joint.peak_velocity_rad_s <= most, "{} at {pace}", joint.name);
            let most = pace * limits.acceleration_rad_s2() * (1.0 + 1e-9);
            assert!(joint.peak_acceleration_rad_s2 <= most, "{} at {pace}", joint.name);
        }
        assert!(worlds.follower.lock().verdict().violations.is_empty());
    }
}

#[test]
fn a_trigger_opens_a_wider_gripper_by_the_share_of_its_range() {
    let by_range = vec!["gripper".to_owned()];
    let scene = Scene::new(LeadOrder { by_range, ..order("so101-leader", "so101") });
    let joint = |robot: &Robot| {
        let joint = robot.joints.iter().find(|joint| joint.name == "gripper").expect("a gripper");
        (joint.limits.lower_rad(), joint.limits.upper_rad())
    };
    let (from, to) = joint(scene.leader.link.robot());
    let (lower, upper) = joint(scene.follower.link.robot());
    let (report, worlds) =
        scene.follow(|world| hand(world, "gripper", from + 0.6 * (to - from), 0.5));
    assert_eq!(report.run.outcome, Outcome::Done, "{:?}", report.run.stop_reason);
    let share = (Worlds::of(&worlds.follower, "gripper") - lower) / (upper - lower);
    assert!((share - 0.6).abs() < 0.04, "{share}");
}

#[test]
fn a_leader_that_falls_silent_leaves_the_robot_at_rest_and_one_that_speaks_again_leads_on() {
    let silent = |world: &mut World| {
        hand(world, "shoulder_pan", 1.5, 0.3);
        let fault = gaitway_sim::Fault::Silent {
            joint: "elbow_flex".to_owned(),
            from_ns: 3_000_000_000,
            until_ns: 4_500_000_000,
        };
        world.begin(&[fault]).expect("a fault");
    };
    let scene = Scene::new(order("so101-leader", "so101"));
    let (report, worlds) = scene.follow(silent);
    assert_eq!(report.run.outcome, Outcome::Done, "{:?}", report.run.stop_reason);
    assert!((1.0..2.5).contains(&report.stale_s), "{}", report.stale_s);
    let (led, followed) =
        (Worlds::of(&worlds.leader, "shoulder_pan"), Worlds::of(&worlds.follower, "shoulder_pan"));
    assert!((led - followed).abs() < 0.05, "{followed} for {led}");
    assert!(worlds.follower.lock().verdict().violations.is_empty());
}

/// What may be done to a world.
type Happening = dyn Fn(&mut World) + Sync;

/// Does something to the follower's world once, when it is asked for the so manieth time.
struct Midway<F: Fn(&mut World)> {
    world: crate::port::sim::SharedWorld,
    at: usize,
    asked: std::sync::atomic::AtomicUsize,
    does: F,
}

impl<F: Fn(&mut World) + Sync> Observer for Midway<F> {
    fn hear(&self, _: crate::job::observer::Event<'_>) {}

    fn wants_to_stop(&self) -> bool {
        if self.asked.fetch_add(1, std::sync::atomic::Ordering::Relaxed) == self.at {
            (self.does)(&mut self.world.lock());
        }
        false
    }
}

#[test]
fn a_follower_whose_servo_vanishes_or_whose_host_stands_still_comes_to_rest_and_says_why() {
    let vanish = |world: &mut World| world.unplug("wrist_flex").expect("a servo");
    let stall = |world: &mut World| {
        let until_ns = world.now_ns() + 500_000_000;
        world.run_until(until_ns);
    };
    let happenings: [(&str, &Happening); 2] = [("wrist_flex", &vanish), ("host", &stall)];
    let mut ended = 0;
    for at in [5, 40, 150, 300] {
        for (why, does) in happenings {
            let scene = Scene::new(order("so101-leader", "so101"));
            let world = scene.follower.world.clone().expect("virtual");
            let midway = Midway { world, at, asked: 0.into(), does };
            let led = |world: &mut World| {
                hand(world, "shoulder_pan", 1.2, 0.5);
                hand(world, "wrist_flex", 0.8, 0.4);
            };
            let (report, worlds) = scene.watched(led, &midway);
            let reason = report.run.stop_reason.clone().unwrap_or_default();
            // A host that stands still before anything is to be moved has done no harm.
            let is_harmless = why == "host" && report.run.outcome == Outcome::Done;
            assert!(is_harmless || reason.contains(why), "{why} at {at}: {reason}");
            ended += usize::from(!is_harmless);
            let mut world = worlds.follower.lock();
            let after_ns = world.now_ns() + 1_000_000_000;
            world.run_until(after_ns);
            for joint in ["shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_roll", "gripper"] {
                let speed = world.joint_velocity_rad_s(joint).expect("a joint");
                assert!(speed.abs() < 0.01, "{why} at {at}: {joint} at {speed} rad/s");
            }
        }
    }
    assert!(ended >= 6, "{ended} of 8 were ended");
}

#[test]
fn a_leader_that_holds_itself_is_refused_unless_it_is_to_be_let_go() {
    let holds = |world: &mut World| {
        world.preset("wrist_flex", "Torque Enable", 1).expect("a register");
    };
    let (report, worlds) = Scene::new(order("so101-leader", "so101")).follow(holds);
    assert_eq!(report.run.outcome, Outcome::Refused);
    let reason = report.run.stop_reason.expect("a reason");
    assert!(reason.contains("wrist_flex") && reason.contains("--limp"), "{reason}");
    assert_eq!(Worlds::torque(&worlds.leader, "wrist_flex"), 1);
    assert_eq!(Worlds::torque(&worlds.follower, "wrist_flex"), 0);
    let limp = LeadOrder { limp: true, ..order("so101-leader", "so101") };
    let (report, worlds) = Scene::new(limp.clone()).follow(holds);
    assert_eq!(report.run.outcome, Outcome::Done, "{:?}", report.run.stop_reason);
    assert_eq!(Worlds::torque(&worlds.leader, "wrist_flex"), 0);
    // A dry run writes nothing to either.
    let (report, worlds) = Scene::new(LeadOrder { dry_run: true, ..limp }).follow(holds);
    assert_eq!(report.run.outcome, Outcome::Done, "{:?}", report.run.stop_reason);
    assert_eq!(Worlds::torque(&worlds.leader, "wrist_flex"), 1);
    assert_eq!(Worlds::torque(&worlds.follower, "wrist_flex"), 0);
}

#[test]
fn joints_without_a_partner_are_named_and_robots_without_any_are_refused() {
    let load = |name: &str| Robot::load(name).expect("shipped");
    let (mut leader, robot) = (load("so101-leader"), load("so101"));
    leader.joints[0].name = "pan".to_owned();
    let pairs = Pairs::of(&leader, &robot, &[]).expect("five in common");
    let notes = pairs.notes().join("; ");
    assert!(notes.contains("nobody leads shoulder_pan"), "{notes}");
    assert!(notes.contains("the robot has no pan"), "{notes}");
    let none = Pairs::of(&leader, &load("op3"), &[]).expect_err("nothing in common");
    assert!(none.to_string().contains("shoulder_lift"), "{none}");
    let unknown = Pairs::of(&leader, &robot, &["pan".to_owned()]).expect_err("not of both");
    assert!(unknown.to_string().contains("--by-range"), "{unknown}");
}

#[test]
fn nobody_is_led_beyond_the_range_of_a_joint() {
    let pairs = Pairs::of(
        &Robot::load("so101-leader").expect("shipped"),
        &Robot::load("so101").expect("shipped"),
        &[],
    );
    let scene = Scene::new(order("so101-leader", "so101"));
    assert_eq!(scene.pairs, pairs.expect("all in common"));
    let limit = scene.follower.link.robot().joints[0].limits.upper_rad();
    let (report, worlds) = scene.follow(|world| hand(world, "shoulder_pan", 2.4, 1.0));
    assert_eq!(report.run.outcome, Outcome::Done, "{:?}", report.run.stop_reason);
    let followed = Worlds::of(&worlds.follower, "shoulder_pan");
    assert!(followed < limit + 0.01 && followed > limit - 0.1, "{followed} of {limit}");
    assert!(worlds.follower.lock().verdict().violations.is_empty());
}

#[test]
fn a_leader_whose_servo_is_set_up_otherwise_is_refused_because_its_angles_mean_something_else() {
    let scene = Scene::new(order("so101-leader", "so101"));
    let (report, worlds) = scene.follow(|world| {
        world.preset("shoulder_pan", "Homing Offset", 1000).expect("a register");
    });
    assert_eq!(report.run.outcome, Outcome::Refused);
    let reason = report.run.stop_reason.expect("a reason");
    assert!(reason.contains("leader so101-leader, joint shoulder_pan"), "{reason}");
    assert!(reason.contains("1000 (raw)"), "{reason}");
    assert_eq!(Worlds::torque(&worlds.follower, "shoulder_pan"), 0);
}

#[test]
fn a_leader_is_not_believed_where_no_hand_can_have_brought_it() {
    let missed = |counts: i32| {
        let scene = Scene::new(order("so101-leader", "so101"));
        let (report, worlds) = scene.follow(|world| {
            let joint = "shoulder_pan".to_owned();
            let fault = gaitway_sim::Fault::PositionJump { joint, at_ns: 4_000_000_000, counts };
            world.begin(&[fault]).expect("a fault");
        });
        assert_eq!(report.run.outcome, Outcome::Done, "{:?}", report.run.stop_reason);
        assert!(worlds.follower.lock().verdict().violations.is_empty());
        report.sensors[0].counts.missed
    };
    // 10 counts are less than noise; 900 are 79 degrees at once.
    assert_eq!(missed(10), 0);
    assert!(missed(900) >= 5, "{}", missed(900));
}

#[test]
fn a_leap_of_a_single_reading_is_not_followed_and_counted() {
    // 0.2 rad in one of the answers: a hand could do that between two looks, and it is back at the next.
    let scene = Scene::new(order("so101-leader", "so101"));
    let (report, worlds) = scene.follow(|world| {
        let lie = |nth: u64| gaitway_sim::Fault::Status {
            joint: "shoulder_pan".to_owned(),
            nth,
            damage: gaitway_sim::Damage::Lie { at: 0, xor: 0x80 },
        };
        world.begin(&[lie(200), lie(300)]).expect("faults");
    });
    assert_eq!(report.run.outcome, Outcome::Done, "{:?}", report.run.stop_reason);
    assert_eq!(worlds.leader.lock().struck_count(), 2);
    assert_eq!(report.leaps, Some(2));
    let pan = report.run.joints.iter().find(|joint| joint.name == "shoulder_pan").expect("a joint");
    assert_eq!(pan.peak_velocity_rad_s, 0.0, "the leader rests");
    assert!(report.run.notes.iter().any(|note| note.contains("2 times")), "{:?}", report.run.notes);
    // Led by hand it is followed as before, and nothing of that is taken for a lie.
    let (report, _) = Scene::new(order("so101-leader", "so101"))
        .follow(|world| hand(world, "shoulder_pan", 1.0, 2.0));
    assert_eq!(report.leaps, Some(0));
}

#[test]
fn a_leader_that_never_says_where_it_is_is_not_waited_for_for_ever() {
    let at = |seconds: u64| Instant::ZERO + Duration::from_secs(seconds);
    let newest = |goals: &mut Goals, seconds| goals.newest(at(seconds), true);
    let mut goals = Goals::new(Some(Duration::from_secs(60)), Trend::default());
    assert!(matches!(newest(&mut goals, 7), Input::Nothing));
    assert!(matches!(newest(&mut goals, 9), Input::Nothing));
    assert!(matches!(newest(&mut goals, 10), Input::End));
    let mut report = order("so101-leader", "so101").report();
    report.run.outcome = Outcome::Done;
    goals.describe("so101-leader", &mut report);
    assert_eq!(report.run.outcome, Outcome::Stopped);
    assert!(report.run.stop_reason.expect("why").contains("has not answered for 3 s"));
    // One that has spoken is waited for, until the time is over or somebody stops it.
    let mut goals = Goals::new(None, Trend::default());
    goals.take(Said::Goal(at(7), vec![0.0]));
    newest(&mut goals, 7);
    assert!(!matches!(newest(&mut goals, 60), Input::End));
}
