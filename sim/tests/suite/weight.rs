//! A servo that moves a body: a rod with a weight at its end, on a shaft that lies level.

use gaitway_sim::{
    BenchServos, Body, Entry, Fault, Felt, Happening, Options, Outside, Push, Script, SimError,
    Turned, World, bench,
};
use std::f64::consts::FRAC_PI_2;

const SERVO: &str = "joint_1";
/// 1 kg at 0.1 m: 0.98 N m while the rod lies level, which is at angle 0.
const MASS_KG: f64 = 1.0;
const ARM_M: f64 = 0.1;
const GRAVITY_M_S2: f64 = 9.81;
const WEIGHT_NM: f64 = MASS_KG * GRAVITY_M_S2 * ARM_M;

struct Rod(Turned);

impl Body for Rod {
    fn let_go(&mut self, angles_rad: &[f64], _: u64) {
        self.0 = Turned { angle_rad: angles_rad[0], rate_rad_s: 0.0 };
    }

    /// Of what is done from outside, what pushes its weight up.
    fn step(&mut self, pushes: &[Push], outside: &Outside, step_s: f64, _: u64) -> Vec<Turned> {
        let [Push { torque_nm, gives_nm_s_rad, armature_kg_m2 }] = *pushes else {
            panic!("one servo")
        };
        let inertia = MASS_KG * ARM_M * ARM_M + armature_kg_m2;
        let Turned { angle_rad, rate_rad_s } = self.0;
        let pushed = outside.forces.iter().filter(|(joint, _)| *joint == Some(0));
        let up_n: f64 = pushed.map(|(_, [_, _, up_n])| up_n).sum();
        let down_n = MASS_KG * GRAVITY_M_S2 * outside.slope_rad[0].cos();
        let torque = torque_nm - (down_n - up_n) * ARM_M * angle_rad.cos();
        let rate_rad_s =
            (inertia * rate_rad_s + step_s * torque) / (inertia + step_s * gives_nm_s_rad);
        self.0 = Turned { angle_rad: angle_rad + step_s * rate_rad_s, rate_rad_s };
        vec![self.0]
    }

    fn felt(&self) -> Felt {
        Felt { spin_rad_s: [0.0, -self.0.rate_rad_s, 0.0], ..Felt::STILL }
    }

    /// Fallen is a rod that hangs.
    fn fallen(&self) -> Option<String> {
        (self.0.angle_rad < -1.2).then(|| "rod".to_owned())
    }
}

fn world() -> World {
    let servos: Vec<BenchServos> = vec!["xm430-w350:1".parse().unwrap()];
    let mut world = World::new(&bench(&servos, None).unwrap(), Options::default()).unwrap();
    world.place_joint(SERVO, 0.0);
    world.give_weight(Box::new(Rod(Turned::default()))).unwrap();
    world
}

fn angle(world: &World) -> f64 {
    world.joint_position_rad(SERVO).unwrap()
}

fn torque(world: &mut World, is_on: bool) {
    world.preset(SERVO, "Torque Enable", i64::from(is_on)).unwrap();
}

/// Lets so many seconds pass in pieces of 7 ms, as somebody does who asks now and then.
fn pass(world: &mut World, seconds: f64) {
    let until_ns = world.now_ns() + (seconds * 1e9) as u64;
    while world.now_ns() < until_ns {
        world.run_until((world.now_ns() + 7_000_000).min(until_ns));
    }
}

#[test]
fn a_servo_without_torque_is_held_by_somebody_until_it_has_torque() {
    let mut world = world();
    pass(&mut world, 5.0);
    assert!(angle(&world).abs() < 1e-9, "{}", angle(&world));
}

#[test]
fn a_robot_is_let_go_on_the_way_however_long_a_stretch_of_time_is() {
    let mut world = world();
    torque(&mut world, true);
    world.run_until(3_000_000_000);
    assert!(angle(&world) < -0.01, "{}", angle(&world));
}

#[test]
fn a_servo_that_holds_a_weight_gives_the_current_of_its_torque_and_sags_by_its_stiffness() {
    let mut world = world();
    torque(&mut world, true);
    pass(&mut world, 3.0);
    let sagged = angle(&world);
    assert!(sagged < -0.01 && sagged > -0.3, "{sagged}");
    // XM430-W350 at 12 V: 4.1 N m and 2.3 A at stall (the maker's page); a count is 2.69 mA.
    let wanted_a = 2.3 * WEIGHT_NM * sagged.cos() / 4.1;
    let current_a = world.register(SERVO, "Present Current").unwrap() as f64 * 2.69e-3;
    assert!((current_a - wanted_a).abs() < 0.03 * wanted_a, "{current_a} {wanted_a}");
}

#[test]
fn a_weight_swings_down_when_torque_goes_and_is_put_back_by_a_reset() {
    let mut world = world();
    torque(&mut world, true);
    pass(&mut world, 1.0);
    torque(&mut world, false);
    pass(&mut world, 4.0);
    // Gears hold what they can: 3 % of 4.1 N m, 0.13 rad of this weight.
    let hangs = angle(&world);
    assert!((hangs + FRAC_PI_2).abs() < 0.15, "{hangs}");
    world.reset().unwrap();
    pass(&mut world, 5.0);
    assert!(angle(&world).abs() < 1e-9, "{}", angle(&world));
    torque(&mut world, true);
    pass(&mut world, 1.0);
    torque(&mut world, false);
    pass(&mut world, 4.0);
    assert_eq!(angle(&world).to_bits(), hangs.to_bits(), "the same again");
}

#[test]
fn a_fall_is_in_the_journal_once_with_its_time_and_again_after_a_reset() {
    let mut world = world();
    world.keep_journal(true);
    let falls = |world: &World| -> Vec<(u64, String)> {
        let fall = |entry: &Entry| match &entry.what {
            Happening::Fell { on } => Some((entry.at_ns, on.clone())),
            _ => None,
        };
        world.journal().since(0).filter_map(fall).collect()
    };
    for _ in 0..2 {
        torque(&mut world, true);
        pass(&mut world, 1.0);
        assert!(falls(&world).is_empty());
        torque(&mut world, false);
        let before_ns = world.now_ns();
        pass(&mut world, 4.0);
        let fell = falls(&world);
        let [(at_ns, on)] = fell.as_slice() else { panic!("{fell:?}") };
        // A rod of 0.1 m needs a tenth of a second and more to fall by a right angle.
        let fell_for_s = (at_ns - before_ns) as f64 * 1e-9;
        assert!((0.1..2.0).contains(&fell_for_s) && on == "rod", "{fell:?}");
        world.reset().unwrap();
    }
}

#[test]
fn a_blocked_shaft_holds_its_weight_without_current() {
    let mut world = world();
    torque(&mut world, true);
    pass(&mut world, 0.5);
    let before = angle(&world);
    let joint = SERVO.to_string();
    let from_ns = world.now_ns();
    world.begin(&[Fault::StuckPosition { joint, from_ns, until_ns: u64::MAX }]).unwrap();
    torque(&mut world, false);
    pass(&mut world, 2.0);
    assert!((angle(&world) - before).abs() < 1e-4, "{before} {}", angle(&world));
}

#[test]
fn a_twin_that_comes_later_turns_by_itself_and_a_new_body_is_held_again() {
    let mut world = world();
    torque(&mut world, true);
    pass(&mut world, 1.0);
    let joint = SERVO.to_string();
    world.begin(&[Fault::Twin { joint, turn_rad: 0.5 }]).unwrap();
    pass(&mut world, 1.0);
    torque(&mut world, false);
    world.give_weight(Box::new(Rod(Turned::default()))).unwrap();
    let before = angle(&world);
    pass(&mut world, 3.0);
    assert!((angle(&world) - before).abs() < 0.01, "{before} {}", angle(&world));
}

#[test]
fn a_script_pushes_for_as_long_as_it_says_and_a_push_of_whom_is_asked_ends_it() {
    let mut world = world();
    torque(&mut world, true);
    pass(&mut world, 3.0);
    let sagged = angle(&world);
    let push = |from_s: f64, until_s: f64| {
        let text = format!(
            "[[fault]]\nkind = 'push'\njoint = '{SERVO}'\nup_n = 9.81\nfrom_s = {from_s}\nuntil_s = {until_s}\n"
        );
        Script::parse(&text).unwrap().faults
    };
    // Twice its weight, half of it until later.
    let first = world.begin(&push(3.0, 5.0)).unwrap();
    world.begin(&push(3.0, 7.0)).unwrap();
    pass(&mut world, 1.9);
    assert!((angle(&world) + sagged).abs() < 0.02 * -sagged, "{} {sagged}", angle(&world));
    pass(&mut world, 2.0);
    assert!(angle(&world).abs() < 0.02 * -sagged, "borne, no more: {}", angle(&world));
    pass(&mut world, 2.0);
    assert!((angle(&world) - sagged).abs() < 1e-3, "{} {sagged}", angle(&world));
    assert!(world.end(first).is_err(), "it is over");
    let struck: Vec<_> = world.take_struck();
    assert_eq!(struck.len(), 2);
    assert_eq!((struck[0].fault, struck[0].place.as_str()), ("push", SERVO));
    let slope = "[[fault]]\nkind = 'slope'\nahead_rad = 1.5\n";
    let slope = world.begin(&Script::parse(slope).unwrap().faults).unwrap();
    pass(&mut world, 2.0);
    assert!(angle(&world) > 0.5 * sagged, "hardly any weight on a floor so steep");
    world.end(slope).unwrap();
    pass(&mut world, 2.0);
    assert!((angle(&world) - sagged).abs() < 1e-3);
}

#[test]
fn who_has_no_weight_is_not_pushed_and_what_is_no_push_is_refused() {
    let servos: Vec<BenchServos> = vec!["xm430-w350:1".parse().unwrap()];
    let mut light = World::new(&bench(&servos, None).unwrap(), Options::default()).unwrap();
    let push = Fault::Push { joint: None, force_n: [1.0, 0.0, 0.0], from_ns: 0, until_ns: 1 };
    assert!(matches!(light.begin(&[push]), Err(SimError::NeedsWeight("push"))));
    for (keys, said) in [
        ("kind = 'push'", "at least one of ahead_n, left_n, up_n"),
        ("kind = 'push'\nahead_n = nan", "a number from -10000 to 10000"),
        ("kind = 'slope'\nleft_rad = 2", "a number from -1.5 to 1.5"),
        ("kind = 'slope'\nup_rad = 1\nleft_rad = 1", "ahead_rad"),
    ] {
        let refused = Script::parse(&format!("[[fault]]\n{keys}\n")).unwrap_err().to_string();
        assert!(refused.contains(said), "{refused}");
    }
}
