//! Faults as data: what a script says happens, and what it says wrongly is named.

use crate::scene::{
    Scene, can_robot, dynamixels, feetech, feetechs, instruction, mixed, read, statuses, sync_read,
    write,
};
use gaitway_sim::can::{CanFrame, CanHeard};
use gaitway_sim::{
    BadChecksum, MissingInChain, Options, Rule, Script, TorqueSwitch, Usb, World, ZeroSpeed,
};

const MS: u64 = 1_000_000;

fn scene(script: &str) -> Scene {
    let faults = Script::parse(script).unwrap().faults;
    let options = Options { permit_eeprom: true, faults, ..Options::default() };
    Scene::with(&dynamixels(&[1, 2]), options)
}

fn refusal(script: &str) -> String {
    Script::parse(script).unwrap_err().to_string()
}

fn position(id: u8) -> Vec<u8> {
    Scene::new(&dynamixels(&[id])).ask(&read(id, 132, 4))
}

#[test]
fn a_fault_names_its_servo_by_joint_or_by_line_and_id() {
    for whose in ["joint = 'j1'", "line = 'body'\nid = 1"] {
        let mut scene = scene(&format!("[[fault]]\nkind = 'mute'\n{whose}\nnth = [0, 2]"));
        let answers: Vec<usize> = (0..4).map(|_| scene.ask(&read(1, 132, 4)).len()).collect();
        assert_eq!(answers, [0, 15, 0, 15]);
        assert_eq!(scene.tell(&read(2, 132, 4)).len(), 1);
    }
}

#[test]
fn a_damage_may_be_for_a_time_a_line_and_a_share_of_statuses() {
    let script = "[[fault]]\nkind = 'mute'\nline = 'body'\nfrom_s = 0.1\nuntil_s = 0.2\n";
    let mut always = scene(script);
    for (at_ms, count) in [(0, 1), (100, 0), (179, 0), (200, 1)] {
        always.world.run_until(at_ms * MS);
        assert_eq!(always.tell(&read(1, 132, 4)).len(), count, "{at_ms} ms");
    }
    let mut half = scene("[[fault]]\nkind = 'mute'\nprobability = 0.5");
    let heard = (0..400).filter(|_| !half.ask(&read(1, 132, 4)).is_empty()).count();
    assert!((140..=260).contains(&heard), "{heard}");
}

#[test]
fn what_struck_is_counted_and_told_once() {
    let mut scene = scene(
        "[[fault]]\nkind = 'echo'\njoint = 'j2'\nnth = 1\n\
         [[fault]]\nkind = 'reboot'\njoint = 'j1'\nat_s = 0.5",
    );
    scene.ask(&read(2, 132, 4));
    assert_eq!(scene.world.struck_count(), 0);
    scene.ask(&read(2, 132, 4));
    scene.world.run_until(500 * MS);
    assert_eq!(scene.world.struck_count(), 2);
    let said: Vec<String> = scene.world.take_struck().iter().map(ToString::to_string).collect();
    assert!(said[0].ends_with("s: echo, j2, status 1"), "{said:?}");
    assert_eq!(said[1], "0.500000 s: reboot, j1");
    assert_eq!(scene.world.take_struck(), []);
}

#[test]
fn an_echo_and_a_false_header_come_before_the_status() {
    let mut echoed = scene("[[fault]]\nkind = 'echo'");
    let request = read(1, 132, 4);
    assert_eq!(echoed.ask(&request), [request.clone(), position(1)].concat());
    let mut false_header = scene("[[fault]]\nkind = 'false-header'");
    let answer = false_header.ask(&request);
    assert_eq!(answer[..8], [0xFF, 0xFF, 0xFD, 0, 1, 40, 0, 0x55]);
    assert_eq!(answer[8..], position(1));
}

#[test]
fn a_hostile_length_has_a_sound_checksum_where_one_is_possible() {
    for length in [0_u16, 1, 2, 3, 4, 200, 0xFFFF] {
        let mut scene = scene(&format!("[[fault]]\nkind = 'length'\nlength = {length}"));
        let answer = scene.ask(&read(1, 132, 4));
        assert_eq!(answer[5..7], length.to_le_bytes());
        assert_eq!(answer.len(), 7 + usize::from(length).clamp(2, 4096), "{length}");
        let (body, crc) = answer.split_at(answer.len() - 2);
        assert_eq!(crate::scene::crc16(body).to_le_bytes(), crc);
    }
    let faults = Script::parse("[[fault]]\nkind = 'length'\nlength = 3").unwrap().faults;
    let mut scene = Scene::with(&feetechs(&[1]), Options { faults, ..Options::default() });
    assert_eq!(scene.ask(&feetech(1, 2, &[56, 2])), feetech(1, 0, &[0]));
}

#[test]
fn a_servo_may_be_another_than_the_robot_file_says() {
    let mut scene = scene(
        "[[fault]]\nkind = 'register'\njoint = 'j1'\nregister = 'Model Number'\nvalue = 1060\n\
         [[fault]]\nkind = 'register'\njoint = 'j1'\nregister = 'Firmware Version'\nvalue = 40\n\
         [[fault]]\nkind = 'register'\nline = 'body'\nid = 2\nregister = 'Min Position Limit'\n\
         value = 100\nat_s = 0.1",
    );
    let answer = scene.tell(&instruction(1, 1, &[]));
    assert_eq!(answer[0].params, [0x24, 0x04, 40]);
    assert_eq!(scene.get("j2", "Min Position Limit"), 0);
    scene.world.run_until(100 * MS);
    assert_eq!(scene.get("j2", "Min Position Limit"), 100);
    let wrong = "[[fault]]\nkind = 'register'\njoint = 'j1'\nregister = 'Model'\nvalue = 1";
    let faults = Script::parse(wrong).unwrap().faults;
    let world =
        gaitway_sim::World::new(&dynamixels(&[1]), Options { faults, ..Options::default() });
    assert!(world.err().unwrap().to_string().contains("\"Model\""));
}

#[test]
fn a_frozen_position_is_shown_while_the_shaft_turns() {
    let mut scene = scene("[[fault]]\nkind = 'frozen'\njoint = 'j1'\nfrom_s = 0.1\nuntil_s = 1");
    scene.ask(&write(1, 64, &[1]));
    scene.world.run_until(100 * MS);
    scene.ask(&write(1, 116, &2400_i32.to_le_bytes()));
    scene.world.run_until(900 * MS);
    assert_eq!(scene.ask(&read(1, 132, 4)), position(1));
    assert!(scene.world.joint_position_rad("j1").unwrap() > 0.4);
    scene.world.run_until(1000 * MS);
    assert!(scene.get("j1", "Present Position") > 2300);
}

#[test]
fn two_servos_with_one_id_answer_together() {
    let mut scene = scene("[[fault]]\nkind = 'twin'\njoint = 'j1'\nturn_rad = 1.0");
    let answer = scene.ask(&read(1, 132, 4));
    assert_ne!(answer, position(1));
    assert_eq!(answer[..7], position(1)[..7], "equal bytes pass unnoticed");
}

#[test]
fn a_slow_adapter_hands_over_when_its_timer_says_so() {
    let robot = dynamixels(&[1, 2]);
    let ready = |options| {
        let mut scene = Scene::with(&robot, options);
        scene.world.transmit(0, &sync_read(0x82, 132, 4, &[1, 2]), 1_000_000);
        let mut times = Vec::new();
        let mut buf = [0; 100];
        loop {
            match scene.world.receive(0, &mut buf, 40 * MS) {
                0 => return times,
                count => times.push((scene.world.now_ns(), count)),
            }
        }
    };
    // 16 bytes of instruction, two statuses of 15 bytes, 10 us each.
    assert_eq!(ready(Options::default()), [(310_000, 15), (460_000, 15)]);
    let usb = Some(Usb::FTDI);
    assert_eq!(ready(Options { usb, ..Options::default() }), [(16 * MS, 30)]);
    let full = Some(Usb { packet_bytes: 10, timer_ns: 300_000 });
    let times = ready(Options { usb: full, ..Options::default() });
    // Ten bytes at 260 us; the timer, started then, at 560 us would be later than the next ten.
    assert_eq!(times, [(260_000, 10), (360_000, 10), (460_000, 10)]);
    let script = "[[fault]]\nkind = 'slow-line'\ntimer_s = 0.016\nuntil_s = 0.02";
    let faults = Script::parse(script).unwrap().faults;
    assert_eq!(ready(Options { faults, ..Options::default() }), [(16 * MS, 30)]);
}

#[test]
fn an_adapter_is_named_as_in_its_profile() {
    for (adapter, timer_s, usb) in [
        ("usb2dynamixel", None, Usb::FTDI),
        ("u2d2", Some(0.001), Usb::FTDI_LOW_LATENCY),
        ("ch343", None, Usb::FULL_SPEED),
    ] {
        let options = Options::default().behind(adapter, timer_s).unwrap();
        assert_eq!((options.usb, options.echo), (Some(usb), false), "{adapter}");
    }
    for (adapter, timer_s, words) in
        [("ch343", 0.001, "ch343 has no latency timer"), ("ftdi", 0.3, "1 to 255 ms")]
    {
        let refused = Options::default().behind(adapter, Some(timer_s)).unwrap_err();
        assert!(refused.to_string().contains(words), "{refused}");
    }
    let refused = Options::default().behind("u2d3", None).unwrap_err();
    assert!(refused.to_string().contains("u2d3"));
}

#[test]
fn a_line_that_hung_up_is_silent_and_its_connection_another_afterwards() {
    let mut scene = scene("[[fault]]\nkind = 'hang-up'\nat_s = 0.1\nuntil_s = 0.2");
    assert_eq!(scene.world.connection(0), Some(1));
    scene.world.run_until(100 * MS);
    assert_eq!(scene.world.connection(0), None);
    scene.world.transmit(0, &write(1, 65, &[1]), 1_000_000);
    let mut buf = [0; 64];
    assert_eq!(scene.world.receive(0, &mut buf, 150 * MS), 0);
    scene.world.run_until(200 * MS);
    assert_eq!(scene.world.connection(0), Some(2));
    assert_eq!(scene.get("j1", "LED"), 0);
    assert_eq!(scene.tell(&read(1, 132, 4)).len(), 1);
}

#[test]
fn a_blocked_line_takes_as_many_bytes_as_it_says() {
    let script = "[[fault]]\nkind = 'blocked'\nfrom_s = 0\nuntil_s = 0.05\nbytes = 20";
    let mut scene = scene(script);
    let ping = instruction(1, 1, &[]);
    for taken in [10, 10, 0] {
        assert_eq!(scene.world.transmit(0, &ping, 1_000_000), taken);
    }
    assert_eq!(scene.world.blocked_until_ns(0), Some(50 * MS));
    scene.world.run_until(50 * MS);
    assert_eq!(scene.world.blocked_until_ns(0), None);
    assert_eq!(scene.world.transmit(0, &ping, 1_000_000), 10);
}

#[test]
fn a_fault_with_a_probability_happens_in_that_share_of_seeds() {
    let script = "[[fault]]\nkind = 'overload'\njoint = 'j1'\nat_s = 0.001\nprobability = 0.5";
    let faults = Script::parse(script).unwrap().faults;
    let struck = |seed| {
        let options = Options { seed, faults: faults.clone(), ..Options::default() };
        let mut scene = Scene::with(&dynamixels(&[1]), options);
        scene.world.run_until(MS);
        scene.world.struck_count()
    };
    let of_100: u64 = (0..100).map(struck).sum();
    assert!((30..=70).contains(&of_100), "{of_100}");
    assert_eq!((0..100).map(struck).sum::<u64>(), of_100);
}

#[test]
fn faults_strike_in_every_family() {
    let script =
        "[[fault]]\nkind = 'lie'\nat = 0\nxor = 1\n[[fault]]\nkind = 'wrong-id'\nas_id = 9";
    let faults = Script::parse(script).unwrap().faults;
    let robot = mixed(&[("ax-12a", 1), ("xl430-w250", 2)]);
    let mut scene = Scene::with(&robot, Options { faults, ..Options::default() });
    assert_eq!(scene.ask(&feetech(1, 2, &[25, 1])), feetech(9, 0, &[1]));
    let answer = statuses(&scene.ask(&read(2, 65, 1)));
    assert_eq!((answer[0].id, answer[0].params[0]), (9, 1));
}

#[test]
fn what_is_wrong_is_named_with_its_place_and_what_is_allowed() {
    let cases = [
        ("[[fault]]\nkind = 'flip'", "fault 1 (line 1), key kind: got \"flip\"; allowed: mute, "),
        ("\n\n[[fault]]\njoint = 'j1'", "fault 1 (line 3), key kind: got nothing"),
        ("[[fault]]\nkind = 'flip-bit'\nbit = -1", "key bit: got -1; allowed: a whole number 0.."),
        (
            "[[fault]]\nkind = 'mute'\nbit = 1",
            "key bit: got a key this kind does not have; allowed: kind, ",
        ),
        ("[[fault]]\nkind = 'mute'\nnth = 1", "key joint: got nothing"),
        ("[[fault]]\nkind = 'silent'", "key joint: got nothing"),
        ("[[fault]]\nkind = 'silent'\njoint = 'a'\nid = 3", "key id: got 3; allowed: either joint"),
        ("[[fault]]\nkind = 'silent'\nid = 3", "key line: got nothing"),
        ("[[fault]]\nkind = 'mute'\nprobability = nan", "key probability: got NaN"),
        (
            "[[fault]]\nkind = 'reboot'\njoint = 'a'\nat_s = '1'",
            "key at_s: got \"1\"; allowed: seconds",
        ),
        ("[[fault]]\nkind = 'blocked'\nfrom_s = 2\nuntil_s = 1", "later than from_s"),
        ("[[fault]\nkind = 1", "line 1: got "),
        ("faults = []", "unknown field"),
    ];
    for (script, expected) in cases {
        let said = refusal(script);
        assert!(said.contains(expected), "{script:?}\nsaid {said:?}\nnot {expected:?}");
    }
}

#[test]
fn names_and_lists_have_a_length_because_each_number_becomes_a_fault() {
    let of = |name: usize, numbers: usize| {
        let (name, numbers) = ("j".repeat(name), vec!["1"; numbers].join(","));
        let script = format!("[[fault]]\nkind = 'mute'\njoint = '{name}'\nnth = [{numbers}]");
        Script::parse(&script).map(|script| script.faults.len())
    };
    assert_eq!(of(100, 1000), Ok(1000));
    assert!(of(101, 1).unwrap_err().to_string().contains("key joint: got 101 bytes"));
    assert!(of(1, 1001).unwrap_err().to_string().contains("a list of at most 1000"));
}

#[test]
fn a_script_without_faults_changes_nothing() {
    let script = Script::parse("seed = 7").unwrap();
    assert_eq!(script, Script { seed: Some(7), ..Script::default() });
    let mut scene = scene("");
    assert_eq!(scene.ask(&read(1, 132, 4)), position(1));
    assert!(scene.world.verdict().violations.iter().all(|v| v.rule != Rule::ReplyWindow));
}

#[test]
fn a_script_chooses_what_the_manuals_leave_open() {
    let text = "[behaviour]\nmissing_in_chain_gap_s = 0.0003\nbad_checksum = 'answer'\n\
        zero_speed = 'as-phase-says'\ntorque_switch = 'comes-with-goal'\n";
    let options = Script::parse(text).unwrap().apply(Options::default());
    assert_eq!(options.missing_in_chain, MissingInChain::AnswerAfter { gap_ns: 300_000 });
    assert_eq!(options.bad_checksum, BadChecksum::Answer);
    assert_eq!(options.zero_speed, ZeroSpeed::AsPhaseSays);
    assert_eq!(options.torque_switch, TorqueSwitch::ComesWithGoal);
    // What it does not say stays as it was.
    let kept = Script::parse("[behaviour]\nbad_checksum = 'ignore'\n").unwrap().apply(options);
    assert_eq!(kept.bad_checksum, BadChecksum::Ignore);
    assert_eq!(kept.zero_speed, ZeroSpeed::AsPhaseSays);
    assert_eq!(kept.torque_switch, TorqueSwitch::ComesWithGoal);
    let said = refusal("seed = 1\n[behaviour]\nbad_checksum = 'shout'\n");
    assert!(said.contains("behaviour (line 2), key bad_checksum: got \"shout\""), "{said}");
    assert!(said.contains("ignore, answer"), "{said}");
    assert!(refusal("[behaviour]\nspeed = 1\n").contains("key speed"));
}

/// A world of one DM4310 that this script befalls, for 60 ms; what struck, and when.
fn struck_on_can(script: &str) -> Vec<String> {
    let faults = Script::parse(script).unwrap().faults;
    let options = Options { faults, ..Options::default() };
    let mut world = World::new(&can_robot(&[("dm4310", 1)]), options).unwrap();
    for k in 0..30 {
        world.run_until(k * 2 * MS);
        let refresh = CanFrame::classic(0x7FF, false, &[1, 0, 0xCC, 0, 0, 0, 0, 0]);
        world.can_send(0, refresh).unwrap();
        while let Some(heard) = world.can_receive(0, (k + 1) * 2 * MS) {
            if let CanHeard::Frame(frame) = heard {
                assert!(frame.bytes.len() <= 8);
            }
        }
    }
    world.take_struck().iter().map(|struck| format!("{} {}", struck.fault, struck.place)).collect()
}

#[test]
fn a_script_makes_a_can_line_and_its_actuators_fail() {
    for (script, told) in [
        ("kind = 'trouble'\njoint = 'j1'\ncause = 'lost-phase'\nfrom_s = 0.01", "trouble j1"),
        ("kind = 'bus-off'\nline = 'body'\nat_s = 0.02\nuntil_s = 0.03", "bus-off body"),
        ("kind = 'babble'\nperiod_s = 0.001\nframe_id = 3\nbytes = 2", "babble body"),
        ("kind = 'silent'\nline = 'body'\nid = 1\nfrom_s = 0.01", "silent j1"),
        ("kind = 'length'\njoint = 'j1'\nlength = 3\nnth = 4", "length j1"),
        ("kind = 'blocked'\nfrom_s = 0.01\nuntil_s = 0.02", "blocked body"),
    ] {
        assert_eq!(struck_on_can(&format!("[[fault]]\n{script}")), [told], "{script}");
    }
}

#[test]
fn wrong_can_faults_are_named() {
    for (script, parts) in [
        ("kind = 'trouble'\njoint = 'j1'", &["key cause", "lost-phase"][..]),
        ("kind = 'trouble'\njoint = 'j1'\ncause = 'rust'", &["key cause", "\"rust\""]),
        ("kind = 'bus-off'", &["key at_s", "nothing"]),
        ("kind = 'bus-off'\nat_s = 2\nuntil_s = 1", &["key until_s", "later than at_s"]),
        ("kind = 'babble'", &["key period_s"]),
        ("kind = 'babble'\nperiod_s = 1\nframe_id = 536870912", &["key frame_id", "536870911"]),
    ] {
        let said = refusal(&format!("[[fault]]\n{script}"));
        assert!(parts.iter().all(|part| said.contains(part)), "{said}");
    }
}
