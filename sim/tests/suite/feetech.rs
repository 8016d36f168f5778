//! Bytes from public tests and tables of the FEETECH STS protocol (SCServo_Linux, LeRobot); those
//! marked "computed" follow from the frame's rules.

use crate::scene::{Scene, feetech, feetechs, hex, mixed};
use gaitway_sim::{Fault, Options, Rule, TorqueSwitch};

fn scene(ids: &[u8]) -> Scene {
    Scene::new(&feetechs(ids))
}

const OK_1: &str = "FF FF 01 02 00 FC";

#[test]
fn ping_is_answered_by_the_servo_named() {
    let mut scene = scene(&[1, 3]);
    assert_eq!(scene.ask(&hex("FF FF 01 02 01 FB")), hex(OK_1));
    assert_eq!(scene.ask(&hex("FF FF 02 02 01 FA")), [0_u8; 0]);
    assert_eq!(scene.ask(&hex("FF FF 03 02 01 F9")), hex("FF FF 03 02 00 FA"));
    assert_eq!(scene.ask(&feetech(0xFE, 1, &[])), hex("FF FF 01 02 00 FC FF FF 03 02 00 FA"));
}

#[test]
fn read_gives_position_and_temperature() {
    let mut scene = scene(&[1]);
    for (raw, answer) in [
        (1304, "FF FF 01 04 00 18 05 DD"),
        (2048, "FF FF 01 04 00 00 08 F2"),
        (3060, "FF FF 01 04 00 F4 0B FB"),
    ] {
        scene.set("j1", "Present Position", raw);
        assert_eq!(scene.ask(&hex("FF FF 01 04 02 38 02 BE")), hex(answer));
    }
    scene.set("j1", "Present Temperature", 42);
    assert_eq!(scene.ask(&hex("FF FF 01 04 02 3F 01 B8")), hex("FF FF 01 03 00 2A D1"));
    assert_eq!(scene.ask(&hex("FF FF 01 04 02 38 0F B1")).len(), 6 + 15);
}

#[test]
fn writes_of_the_vendors_and_others_are_understood() {
    let mut scene = scene(&[1]);
    let cases = [
        ("FF FF 01 05 03 2A 00 08 C4", "Goal Position", 2048),
        ("FF FF 01 09 03 2A 00 08 00 00 E8 03 D5", "Goal Velocity", 1000),
        // Computed: acceleration 50, position 2048, time 0, speed 2400.
        ("FF FF 01 0A 03 29 32 00 08 00 00 60 09 25", "Goal Velocity", 2400),
        ("FF FF 01 04 03 28 01 CE", "Torque Enable", 1),
        ("FF FF 01 04 03 28 00 CF", "Torque Enable", 0),
        // Computed.
        ("FF FF 01 05 03 2E E8 83 5D", "Goal Velocity", -1000),
        ("FF FF 01 04 03 37 00 C0", "Lock", 0),
        ("FF FF 01 05 03 1F 64 08 6B", "Homing Offset", -100),
        ("FF FF 01 04 03 21 01 D5", "Operating Mode", 1),
        ("FF FF 01 04 03 37 01 BF", "Lock", 1),
    ];
    for (packet, register, raw) in cases {
        assert_eq!(scene.ask(&hex(packet)), hex(OK_1), "{register}");
        assert_eq!(scene.get("j1", register), raw, "{packet}");
    }
    assert_eq!(scene.get("j1", "Acceleration"), 50);
}

#[test]
fn sync_write_sets_goals_and_is_not_answered() {
    let mut scene = scene(&[1, 2]);
    let packet = "FF FF FE 0E 83 2A 04 01 00 08 E8 03 02 00 08 E8 03 59";
    assert_eq!(scene.ask(&hex(packet)), [0_u8; 0]);
    // Four bytes from 42 on: the second word is the goal time.
    for joint in ["j1", "j2"] {
        assert_eq!(scene.get(joint, "Goal Position"), 2048);
        assert_eq!(scene.get(joint, "Goal Velocity"), 0);
    }
}

#[test]
fn sync_read_is_answered_in_order() {
    let mut scene = scene(&[1, 2]);
    scene.set("j2", "Present Position", 2047);
    let answer = scene.ask(&hex("FF FF FE 06 82 38 04 01 02 3A"));
    // Computed; the first of the published pair moves, here both are at rest.
    assert_eq!(answer[..10], feetech(1, 0, &[0x00, 0x08, 0, 0]));
    assert_eq!(answer[10..], hex("FF FF 02 06 00 FF 07 00 00 F1"));
}

#[test]
fn a_registered_write_waits_for_the_broadcast_action() {
    let mut scene = scene(&[1]);
    scene.set("j1", "Goal Position", 1000);
    let packet = hex("FF FF 01 09 04 2A 00 08 00 00 E8 03 D4");
    assert_eq!(scene.ask(&packet), hex(OK_1));
    assert_eq!(scene.get("j1", "Async Write Flag"), 1);
    assert_eq!(scene.get("j1", "Goal Position"), 1000);
    assert_eq!(scene.ask(&hex("FF FF FE 02 05 FA")), [0_u8; 0]);
    assert_eq!(scene.get("j1", "Goal Position"), 2048);
    assert_eq!(scene.get("j1", "Async Write Flag"), 0);
}

#[test]
fn an_id_change_under_lock_lasts_until_power_off_only() {
    let mut scene = scene(&[1]);
    // Locked, as at power-up: ID 1 -> 2 acts at once but is not kept.
    assert_eq!(scene.ask(&hex("FF FF 01 04 03 05 02 F0")), hex(OK_1));
    assert_eq!(scene.ask(&feetech(2, 1, &[])).len(), 6);
    assert_eq!(scene.get("j1", "ID"), 2);
    let mut kept = Scene::with(
        &feetechs(&[1]),
        gaitway_sim::Options {
            permit_eeprom: true,
            faults: vec![
                gaitway_sim::Fault::Brownout { from_ns: 200_000_000, until_ns: 300_000_000 },
                gaitway_sim::Fault::Brownout { from_ns: 700_000_000, until_ns: 800_000_000 },
            ],
            ..Default::default()
        },
    );
    kept.ask(&hex("FF FF 01 04 03 05 02 F0"));
    // Booted again, 0.3 s after its power had gone.
    kept.world.run_until(550_000_000);
    assert_eq!(kept.get("j1", "ID"), 1);
    kept.ask(&hex("FF FF 01 04 03 37 00 C0"));
    kept.ask(&hex("FF FF 01 04 03 05 02 F0"));
    kept.ask(&hex("FF FF 02 04 03 37 01 BE"));
    kept.world.run_until(900_000_000);
    assert_eq!(kept.get("j1", "ID"), 2);
}

#[test]
fn a_new_baud_rate_counts_after_the_status() {
    let mut scene = scene(&[1]);
    assert_eq!(scene.ask(&hex("FF FF 01 04 03 06 04 ED")), hex(OK_1));
    assert_eq!(scene.ask(&hex("FF FF 01 02 01 FB")), [0_u8; 0]);
    scene.baud_bps = 115_200;
    assert_eq!(scene.ask(&hex("FF FF 01 02 01 FB")), hex(OK_1));
}

#[test]
fn torque_128_makes_the_present_position_the_middle() {
    let mut scene = scene(&[1]);
    scene.set("j1", "Present Position", 2500);
    assert_eq!(scene.ask(&hex("FF FF 01 04 03 28 80 4F")), hex(OK_1));
    assert_eq!(scene.get("j1", "Present Position"), 2048);
    assert_eq!(scene.get("j1", "Homing Offset"), 2500 - 2048);
    assert_eq!(scene.get("j1", "Torque Enable"), 0);
    // Other values than 0, 1, 2 and 128 do nothing.
    assert_eq!(scene.ask(&feetech(1, 3, &[40, 77])), hex(OK_1));
    assert_eq!(scene.get("j1", "Torque Enable"), 0);
}

#[test]
fn the_offset_is_subtracted() {
    let mut scene = scene(&[1]);
    scene.set("j1", "Present Position", 2148);
    scene.set("j1", "Homing Offset", 100);
    assert_eq!(scene.get("j1", "Present Position"), 2048);
    scene.set("j1", "Homing Offset", -100);
    assert_eq!(scene.get("j1", "Present Position"), 2248);
}

#[test]
fn bad_packets_and_unknown_instructions_are_ignored() {
    let mut scene = scene(&[1]);
    assert_eq!(scene.ask(&hex("FF FF 01 02 01 FA")), [0_u8; 0]);
    assert_eq!(scene.ask(&feetech(1, 0x55, &[])), [0_u8; 0]);
    assert_eq!(scene.ask(&feetech(1, 0x02, &[56])), [0_u8; 0]);
    assert_eq!(scene.ask(&hex("FF FF FF 01 02 01 FB")), hex(OK_1), "a third FF in front");
}

#[test]
fn response_level_0_silences_writes() {
    let mut scene = scene(&[1]);
    assert_eq!(scene.ask(&feetech(1, 3, &[8, 0])), hex(OK_1), "under the old level");
    assert_eq!(scene.ask(&feetech(1, 3, &[41, 5])), [0_u8; 0]);
    assert_eq!(scene.get("j1", "Acceleration"), 5);
    assert_eq!(scene.ask(&feetech(1, 1, &[])), hex(OK_1));
}

#[test]
fn an_answer_takes_at_least_50_us_to_begin() {
    let mut scene = scene(&[1]);
    scene.world.transmit(0, &hex("FF FF 01 02 01 FB"), 1_000_000);
    let mut buf = [0; 64];
    assert_eq!(scene.world.receive(0, &mut buf, 1_000_000_000), 6);
    assert_eq!(scene.world.now_ns(), 60_000 + 50_000 + 60_000);
}

/// A servo of this kind whose torque is switched so, and what its host writes to it.
struct Switched {
    scene: Scene,
    big_endian: bool,
}

impl Switched {
    fn new(servo: &str, torque_switch: TorqueSwitch, faults: Vec<Fault>) -> Switched {
        let options = Options { torque_switch, faults, ..Options::default() };
        let scene = Scene::with(&mixed(&[(servo, 1)]), options);
        Switched { scene, big_endian: servo.starts_with("scs") }
    }

    fn goal(&mut self, raw: u16) {
        let [a, b] = if self.big_endian { raw.to_be_bytes() } else { raw.to_le_bytes() };
        self.scene.ask(&feetech(1, 3, &[42, a, b]));
    }

    fn set_torque(&mut self, value: u8) {
        self.scene.ask(&feetech(1, 3, &[40, value]));
    }

    fn torque(&self) -> i64 {
        self.scene.get("j1", "Torque Enable")
    }

    fn position(&mut self) -> i64 {
        self.scene.wait_ms(1_000);
        self.scene.get("j1", "Present Position")
    }

    fn torque_far_from_goal(&self) -> u64 {
        self.scene.world.verdict().count(Rule::TorqueOn)
    }
}

/// Servos with a middle position and one that is 0.15 rad and more away.
const SERVOS: [(&str, u16, u16); 2] = [("sts3215", 2048, 2248), ("scs0009", 511, 611)];

fn near(position: i64, raw: u16) -> bool {
    (position - i64::from(raw)).abs() <= 8
}

#[test]
fn torque_that_waits_for_its_register_moves_nothing_before() {
    for (servo, middle, away) in SERVOS {
        let mut host = Switched::new(servo, TorqueSwitch::WaitsForRegister, Vec::new());
        assert_eq!(host.torque(), 0);
        host.goal(away);
        assert_eq!(host.torque(), 0, "{servo}");
        assert!(near(host.position(), middle), "{servo}");
        host.goal(middle);
        host.set_torque(1);
        assert_eq!(host.torque_far_from_goal(), 0);
        host.goal(away);
        assert!(near(host.position(), away), "{servo}");
    }
}

#[test]
fn torque_that_comes_with_a_goal_comes_with_any_while_it_is_off() {
    for (servo, middle, away) in SERVOS {
        let mut host = Switched::new(servo, TorqueSwitch::ComesWithGoal, Vec::new());
        assert_eq!(host.torque(), 0, "{servo}: not at power-up");
        // Where the joint stands: that is how a careful host begins.
        host.goal(middle);
        assert_eq!((host.torque(), host.torque_far_from_goal()), (1, 0), "{servo}");
        host.goal(away);
        assert!(near(host.position(), away), "{servo}");
        // Switched off it stays off, until the next goal.
        host.set_torque(0);
        assert_eq!(host.torque(), 0);
        host.goal(middle);
        assert_eq!((host.torque(), host.torque_far_from_goal()), (1, 1), "{servo}");
        assert!(near(host.position(), middle), "{servo}");
        // Damping is a torque of its own.
        host.set_torque(2);
        host.goal(away);
        assert_eq!(host.torque(), 2, "{servo}");
    }
}

#[test]
fn the_referee_sees_how_far_the_goal_is_that_brings_torque() {
    // 0.02 rad are 13.04 counts of an STS, 3.9 of an SCS.
    for (servo, middle, last) in [("sts3215", 2048, 13), ("scs0009", 511, 3)] {
        for (off, count) in [(last, 0), (last + 1, 1)] {
            let mut host = Switched::new(servo, TorqueSwitch::ComesWithGoal, Vec::new());
            host.goal(middle + off);
            assert_eq!(host.torque_far_from_goal(), count, "{servo} {off}");
        }
    }
}

#[test]
fn torque_that_is_on_at_power_up_holds_where_the_shaft_stands() {
    for (servo, middle, away) in SERVOS {
        // Power is gone from 3 to 4 s; half-way through a hand turns the shaft.
        let gone = Fault::Brownout { from_ns: 3_000_000_000, until_ns: 4_000_000_000 };
        let mut host = Switched::new(servo, TorqueSwitch::OnAtPowerUp, vec![gone]);
        assert_eq!(host.torque(), 1, "{servo}");
        assert!(near(host.position(), middle), "{servo}");
        host.goal(away);
        assert!(near(host.position(), away), "{servo}");
        host.scene.world.run_until(3_500_000_000);
        assert_eq!(host.torque(), 0, "{servo}: without power");
        assert!(host.scene.world.place_joint("j1", 0.7));
        let turned = host.scene.get("j1", "Present Position");
        host.scene.world.run_until(4_500_000_000);
        assert_eq!(host.torque(), 1, "{servo}");
        let position = host.position();
        assert!(near(position, turned as u16), "{servo}: {position} after {turned}");
        assert_eq!(host.torque_far_from_goal(), 0, "{servo}");
        host.set_torque(0);
        assert_eq!(host.torque(), 0, "{servo}: the register switches it off");
        // A goal far away, then torque: as far as any.
        host.goal(middle);
        host.set_torque(1);
        assert_eq!(host.torque_far_from_goal(), 1, "{servo}");
    }
}

#[test]
fn the_torque_of_a_dynamixel_is_its_registers_whatever_a_feetech_does() {
    for torque_switch in [TorqueSwitch::ComesWithGoal, TorqueSwitch::OnAtPowerUp] {
        let mut host = Switched::new("mx-28", torque_switch, Vec::new());
        host.scene.ask(&feetech(1, 3, &[30, 0, 8]));
        assert_eq!(host.torque(), 0);
    }
}
