//! The control channel: what a program outside does to a running world.

use crate::scene::instruction;
use gaitway_profiles::Robot;
use gaitway_sim::control::{ControlSocket, Session, Surroundings};
use gaitway_sim::{BenchServos, Door, Fault, Hand, Options, World, bench, profiles};
use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::os::unix::fs::PermissionsExt;
use std::os::unix::net::UnixStream;
use std::path::PathBuf;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

fn of(servos: &[&str]) -> Robot {
    let servos: Vec<BenchServos> = servos.iter().map(|text| text.parse().unwrap()).collect();
    bench(&servos, None).unwrap()
}

fn world(servos: &[&str]) -> World {
    let mut world = World::new(&of(servos), Options::default()).unwrap();
    world.keep_journal(true);
    world
}

/// A world and one program's session with it.
struct Desk {
    world: World,
    session: Session,
    now: Duration,
}

impl Desk {
    fn new(servos: &[&str]) -> Desk {
        let session = Session::new(Surroundings::default());
        Desk { world: world(servos), session, now: Duration::ZERO }
    }

    /// All that is said to these lines.
    fn say(&mut self, lines: &str) -> String {
        self.session.hear(lines.as_bytes());
        self.session.hear(b"\n");
        let mut said = String::new();
        loop {
            self.session.work(&mut self.world, self.now);
            said.push_str(std::str::from_utf8(self.session.output()).unwrap());
            self.session.was_read(usize::MAX);
            if self.session.is_done() || !said.ends_with('\n') {
                return said;
            }
        }
    }

    /// The reply to one request that is done.
    fn ask(&mut self, request: &str) -> String {
        let said = self.say(request);
        assert!(said.starts_with(r#"{"ok":true"#), "{request}: {said}");
        said.trim_end().to_string()
    }

    fn refused(&mut self, request: &str) -> String {
        let said = self.say(request);
        assert!(said.starts_with(r#"{"ok":false"#), "{request}: {said}");
        said
    }

    fn number(&mut self, request: &str, key: &str) -> f64 {
        let said = self.ask(request);
        let after = said.split(&format!("\"{key}\":")).nth(1).unwrap_or_else(|| panic!("{said}"));
        let end = after.find([',', '}']).unwrap();
        after[..end].parse().unwrap_or_else(|_| panic!("{said}"))
    }

    fn position(&mut self, joint: &str) -> f64 {
        self.number(&format!(r#"{{"do":"state","joint":"{joint}"}}"#), "position_rad")
    }

    fn step(&mut self, seconds: f64) {
        self.ask(&format!(r#"{{"do":"step","for_s":{seconds}}}"#));
    }

    /// What the servo with this ID says to a ping, hexadecimal.
    fn ping(&mut self, id: u8) -> String {
        let bytes: String = instruction(id, 1, &[]).iter().map(|b| format!("{b:02x}")).collect();
        let said = self.ask(&format!(r#"{{"do":"send","line":"bus","bytes":"{bytes}"}}"#));
        said.split("\"bytes\":\"").nth(1).unwrap().split('"').next().unwrap().to_string()
    }
}

/// Status of an XM430-W350 with ID 1 to a ping: model 1020, firmware as the bench has it.
fn is_whole(answer: &str) -> bool {
    answer.starts_with("fffffd0001070055") && answer.len() == 28
}

#[test]
fn registers_are_read_and_preset_by_name_or_address() {
    let mut desk = Desk::new(&["xm430-w350:1,2"]);
    for name in [r#""Goal Position""#, r#""goal_position""#, "116", r#""GOAL-POSITION""#] {
        desk.ask(&format!(r#"{{"do":"set","joint":"joint_1","register":{name},"value":1234}}"#));
        let get = format!(r#"{{"do":"get","line":"bus","id":1,"register":{name}}}"#);
        assert_eq!(desk.ask(&get), r#"{"ok":true,"value":1234}"#);
        desk.ask(r#"{"do":"set","joint":"joint_1","register":116,"value":0}"#);
    }
    // Read-only on the line; here it sets what it measures.
    desk.ask(r#"{"do":"set","joint":"joint_2","register":"Present Position","value":3000}"#);
    assert!((desk.position("joint_2") - (3000.0 - 2048.0) * 0.088_f64.to_radians()).abs() < 2e-3);
    let all = desk.ask(r#"{"do":"get","joint":"joint_2"}"#);
    assert!(all.contains(r#""Model Number":1020"#) && all.contains(r#""Present Position":3000"#));
    for (request, words) in [
        (r#"{"do":"get","joint":"joint_3","register":"ID"}"#, "joint_3"),
        (r#"{"do":"get","joint":"joint_1","register":"Colour"}"#, "Goal Position"),
        (r#"{"do":"set","joint":"joint_1","register":"ID","value":300}"#, "0..255"),
        (r#"{"do":"set","joint":"joint_1","register":"ID"}"#, "key value"),
    ] {
        assert!(desk.refused(request).contains(words), "{request}");
    }
}

#[test]
fn a_joint_that_torque_holds_is_moved_by_hand_and_not_by_setting_a_number() {
    let mut desk = Desk::new(&["sts3215:1"]);
    let set = r#"{"do":"set","joint":"joint_1","register":"Present_Position","value":3000}"#;
    desk.ask(r#"{"do":"set","joint":"joint_1","register":"Torque_Enable","value":1}"#);
    let before = desk.position("joint_1");
    let refused = desk.refused(set);
    assert!(refused.contains("torque holds joint_1") && refused.contains("hand"), "{refused}");
    assert_eq!(desk.position("joint_1"), before);
    // Whatever else it measures may be set.
    desk.ask(r#"{"do":"set","joint":"joint_1","register":"Present_Temperature","value":70}"#);
    desk.ask(r#"{"do":"set","joint":"joint_1","register":"Torque_Enable","value":0}"#);
    desk.ask(set);
    assert!(desk.position("joint_1") > before + 1.0);
}

#[test]
fn a_limp_joint_follows_the_hand_and_stays_where_it_was_put() {
    for model in ["xm430-w350:1", "sts3215:1", "xl330-m288:1", "ax-12a:1", "dm4310:1"] {
        let mut desk = Desk::new(&[model]);
        desk.ask(r#"{"do":"hand","joint":"joint_1","to_rad":0.7,"speed_rad_s":0.5}"#);
        let begin = desk.position("joint_1");
        desk.step(0.5);
        let on_the_way = desk.position("joint_1");
        assert!((on_the_way - begin - 0.25).abs() < 0.03, "{model}: {on_the_way}");
        desk.step(2.0);
        let there = desk.position("joint_1");
        assert!((there - 0.7).abs() < 0.01, "{model}: {there}");
        let state = desk.ask(r#"{"do":"state","joint":"joint_1"}"#);
        assert!(state.contains(r#""in_hand":false"#), "{model}: {state}");
        desk.step(5.0);
        assert!((desk.position("joint_1") - there).abs() < 0.01, "{model} slid away");
    }
}

#[test]
fn a_joint_under_torque_resists_a_hand_and_gives_way_to_a_stronger_one() {
    let mut desk = Desk::new(&["xm430-w350:1"]);
    desk.ask(r#"{"do":"set","joint":"joint_1","register":"Torque Enable","value":1}"#);
    let begin = desk.position("joint_1");
    desk.ask(r#"{"do":"hand","joint":"joint_1","to_rad":1.0,"hold":true}"#);
    desk.step(3.0);
    let held = desk.position("joint_1") - begin;
    assert!((0.0..0.2).contains(&held), "{held}");
    let current =
        desk.number(r#"{"do":"get","joint":"joint_1","register":"Present Current"}"#, "value");
    assert!(current < -50.0, "it pulls back with {current}");
    desk.ask(r#"{"do":"let-go","joint":"joint_1"}"#);
    desk.step(2.0);
    assert!((desk.position("joint_1") - begin).abs() < 0.02, "it is back");
    // Three times what it gives when stalled (4.1 N m at 12 V, its maker's page).
    let strong = r#"{"do":"hand","joint":"joint_1","to_rad":1.0,"torque_nm":12.3,"hold":true}"#;
    desk.ask(strong);
    desk.step(2.0);
    assert!((desk.position("joint_1") - begin) > 0.8, "{}", desk.position("joint_1"));
}

#[test]
fn a_servo_without_its_plug_says_nothing_and_boots_without_torque_when_it_is_back() {
    let mut desk = Desk::new(&["xm430-w350:1,2"]);
    desk.ask(r#"{"do":"set","joint":"joint_1","register":"Torque Enable","value":1}"#);
    desk.ask(r#"{"do":"set","joint":"joint_1","register":"Homing Offset","value":7}"#);
    desk.ask(r#"{"do":"unplug","joint":"joint_1"}"#);
    assert_eq!(desk.ping(1), "");
    assert!(desk.ping(2).starts_with("fffffd0002"), "the other one is still there");
    assert!(desk.ask(r#"{"do":"state","joint":"joint_1"}"#).contains(r#""plugged":false"#));
    desk.ask(r#"{"do":"plug","line":"bus","id":1}"#);
    assert_eq!(desk.ping(1), "", "it boots");
    desk.step(0.5);
    assert!(is_whole(&desk.ping(1)));
    let value = |name| format!(r#"{{"do":"get","joint":"joint_1","register":"{name}"}}"#);
    assert_eq!(desk.number(&value("Torque Enable"), "value"), 0.0);
    assert_eq!(desk.number(&value("Homing Offset"), "value"), 7.0, "EEPROM stays");
}

#[test]
fn an_actuator_without_its_plug_is_silent_too() {
    let mut world = world(&["dm4310:1"]);
    let enable =
        gaitway_sim::can::CanFrame::classic(1, false, &[255, 255, 255, 255, 255, 255, 255, 0xFC]);
    let answers = |world: &mut World| {
        world.can_send(0, enable.clone()).unwrap();
        world.can_receive(0, world.now_ns() + 5_000_000).is_some()
    };
    assert!(answers(&mut world));
    world.unplug("joint_1").unwrap();
    assert!(!answers(&mut world));
    assert!(!world.joint_state("joint_1").unwrap().torque, "it has lost its power");
    world.plug("joint_1").unwrap();
    world.step(500_000_000).unwrap();
    assert!(answers(&mut world));
}

#[test]
fn an_adapter_is_pulled_out_and_plugged_in() {
    let mut desk = Desk::new(&["xm430-w350:1"]);
    desk.ask(r#"{"do":"unplug","line":"bus"}"#);
    assert_eq!(desk.world.connection(0), None);
    assert_eq!(desk.ping(1), "");
    desk.ask(r#"{"do":"unplug","line":"bus"}"#);
    desk.ask(r#"{"do":"plug","line":"bus"}"#);
    assert_eq!(desk.world.connection(0), Some(2));
    assert!(is_whole(&desk.ping(1)));
    let log = desk.ask(r#"{"do":"log","kind":"adapter"}"#);
    assert_eq!(log.matches(r#""plugged":false"#).count(), 1, "{log}");
    assert!(desk.refused(r#"{"do":"plug","line":"legs"}"#).contains("legs"));
}

/// Faults that a ping shows, and that are gone when they end.
const SHOWN_BY_A_PING: [&str; 16] = [
    r#""kind":"mute","joint":"joint_1""#,
    r#""kind":"lie","joint":"joint_1""#,
    r#""kind":"wrong-id","line":"bus","id":1,"as_id":9"#,
    r#""kind":"length","joint":"joint_1","length":5"#,
    r#""kind":"flip-bit","line":"bus""#,
    r#""kind":"drop-byte""#,
    r#""kind":"duplicate""#,
    r#""kind":"stale-reply","by_s":1"#,
    r#""kind":"garbage","bytes":3"#,
    r#""kind":"false-header""#,
    r#""kind":"echo""#,
    r#""kind":"silent","joint":"joint_1""#,
    r#""kind":"twin","joint":"joint_1","turn_rad":1"#,
    r#""kind":"register","joint":"joint_1","register":"Model Number","value":5"#,
    r#""kind":"brownout""#,
    r#""kind":"hang-up","line":"bus""#,
];

#[test]
fn a_fault_begins_when_told_to_and_ends_when_told_to() {
    for keys in SHOWN_BY_A_PING
        .iter()
        .copied()
        .chain([r#""kind":"slow-line","latency_s":1"#, r#""kind":"blocked","line":"bus""#])
    {
        let mut desk = Desk::new(&["xm430-w350:1"]);
        desk.step(1.5);
        let sound = desk.ping(1);
        assert!(is_whole(&sound), "{sound}");
        let number = desk.number(&format!(r#"{{"do":"fault",{keys}}}"#), "fault");
        let read = |desk: &mut Desk| match keys.contains("twin") {
            // Equal statuses of two pass unnoticed: where their shafts are differs.
            true => {
                let read = instruction(1, 2, &[132, 0, 4, 0]);
                desk.world.transmit(0, &read, 57_600);
                let mut buffer = [0; 64];
                let until_ns = desk.world.now_ns() + 20_000_000;
                let count = desk.world.receive(0, &mut buffer, until_ns);
                format!("{:02x?}", &buffer[..count])
            }
            false => desk.ping(1),
        };
        let broken = read(&mut desk);
        desk.ask(&format!(r#"{{"do":"end","fault":{number}}}"#));
        desk.step(2.0);
        read(&mut desk);
        desk.step(2.0);
        assert_eq!(desk.ping(1), sound, "{keys} has ended");
        assert_ne!(broken, read(&mut desk), "{keys} shows");
        assert!(desk.refused(&format!(r#"{{"do":"end","fault":{number}}}"#)).contains("no fault"));
    }
}

#[test]
fn faults_of_the_shaft_and_the_encoder_end_too() {
    let position = r#"{"do":"get","joint":"joint_1","register":"Present Position"}"#;
    let hand = r#"{"do":"hand","joint":"joint_1","to_rad":0.5}"#;
    for (keys, reads, turns) in [
        (r#""kind":"stuck","joint":"joint_1""#, false, false),
        (r#""kind":"frozen","joint":"joint_1""#, false, true),
    ] {
        let mut desk = Desk::new(&["xm430-w350:1"]);
        let (before, place) = (desk.number(position, "value"), desk.position("joint_1"));
        let number = desk.number(&format!(r#"{{"do":"fault",{keys}}}"#), "fault");
        desk.ask(hand);
        desk.step(2.0);
        assert_eq!((desk.number(position, "value") - before).abs() > 10.0, reads, "{keys}");
        assert_eq!((desk.position("joint_1") - place).abs() > 0.1, turns, "{keys}");
        desk.ask(&format!(r#"{{"do":"end","fault":{number}}}"#));
        desk.step(2.0);
        assert!((desk.position("joint_1") - 0.5).abs() < 0.01, "{keys} has ended");
        assert!((desk.number(position, "value") - before).abs() > 300.0, "{keys} has ended");
    }
    let mut desk = Desk::new(&["xm430-w350:1"]);
    let before = desk.number(position, "value");
    let jump = r#"{"do":"fault","kind":"jump","joint":"joint_1","counts":100}"#;
    let number = desk.number(jump, "fault");
    assert_eq!(desk.number(position, "value"), before + 100.0);
    desk.ask(&format!(r#"{{"do":"end","fault":{number}}}"#));
    assert_eq!(desk.number(position, "value"), before);
}

#[test]
fn faults_of_can_lines_end_too() {
    let mut desk = Desk::new(&["dm4310:1"]);
    for (keys, shown) in [
        (r#""kind":"babble","line":"can","period_s":0.001,"frame_id":5"#, true),
        (r#""kind":"bus-off","line":"can""#, true),
    ] {
        let number = desk.number(&format!(r#"{{"do":"fault",{keys}}}"#), "fault");
        let heard = |desk: &mut Desk| {
            let until_ns = desk.world.now_ns() + 10_000_000;
            std::iter::from_fn(|| desk.world.can_receive(0, until_ns)).count() > 0
        };
        assert_eq!(heard(&mut desk), shown, "{keys}");
        desk.ask(&format!(r#"{{"do":"end","fault":{number}}}"#));
        desk.step(0.1);
        heard(&mut desk);
        assert!(!heard(&mut desk), "{keys} has ended");
    }
    let trouble = r#"{"do":"fault","kind":"trouble","joint":"joint_1","cause":"encoder"}"#;
    let number = desk.number(trouble, "fault");
    assert!(desk.world.actuator("joint_1").unwrap().trouble().is_some());
    desk.ask(&format!(r#"{{"do":"end","fault":{number}}}"#));
}

#[test]
fn a_fault_that_has_not_begun_never_does_once_it_is_ended() {
    let mut desk = Desk::new(&["xm430-w350:1"]);
    let later = r#"{"do":"fault","kind":"reboot","joint":"joint_1","at_s":2}"#;
    let number = desk.number(later, "fault");
    desk.ask(&format!(r#"{{"do":"end","fault":{number}}}"#));
    desk.step(3.0);
    assert_eq!(desk.number(r#"{"do":"count","kind":"struck"}"#, "count"), 0.0);
    desk.number(r#"{"do":"fault","kind":"reboot","joint":"joint_1"}"#, "fault");
    assert_eq!(desk.number(r#"{"do":"count","kind":"struck"}"#, "count"), 1.0);
    for (request, words) in [
        (r#"{"do":"fault","kind":"reboot"}"#, "key joint"),
        (r#"{"do":"fault","kind":"reboot","joint":"knee"}"#, "knee"),
        (r#"{"do":"fault","kind":"quake"}"#, "brownout"),
        (r#"{"do":"fault","kind":"mute","at":1}"#, "key at"),
        (r#"{"do":"fault","kind":"trouble","joint":"joint_1","cause":"encoder"}"#, "no CAN"),
    ] {
        assert!(desk.refused(request).contains(words), "{request}");
    }
}

#[test]
fn faults_that_never_end_are_not_taken_without_end() {
    let mut desk = Desk::new(&["xm430-w350:1"]);
    let mut taken = 0;
    while desk.say(r#"{"do":"fault","kind":"mute"}"#).starts_with(r#"{"ok":true"#) {
        taken += 1;
        assert!(taken < 10_000);
    }
    assert!(
        desk.refused(r#"{"do":"fault","kind":"twin","joint":"joint_1"}"#)
            .contains("have not ended")
    );
    desk.ask(r#"{"do":"reset"}"#);
    // Twins that come and go do not pile up on the line.
    for _ in 0..1000 {
        let twin = r#"{"do":"fault","kind":"twin","joint":"joint_1"}"#;
        let number = desk.number(twin, "fault");
        desk.ask(&format!(r#"{{"do":"end","fault":{number}}}"#));
    }
    assert!(is_whole(&desk.ping(1)));
}

/// Requests whose replies depend on chance, on time and on all that went before.
const SCRIPT: &str = r#"{"do":"fault","kind":"flip-bit","probability":0.5}
{"do":"send","line":"bus","bytes":"fffffd00010300011 94e"}
{"do":"hand","joint":"joint_1","to_rad":0.4}
{"do":"step","for_s":0.3}
{"do":"state","joint":"joint_1"}
{"do":"send","line":"bus","bytes":"fffffd00010300011 94e"}
{"do":"set","joint":"joint_2","register":"Torque Enable","value":1}
{"do":"unplug","joint":"joint_1"}
{"do":"step","for_s":1}
{"do":"get","joint":"joint_2"}
{"do":"send","line":"bus","bytes":"fffffd00fe03000131 42","for_s":2}
{"do":"log"}
{"do":"count","kind":"struck"}"#;

#[test]
fn the_same_requests_bring_the_same_bytes_in_another_world_and_after_a_reset() {
    let mut one = Desk::new(&["xm430-w350:1,2"]);
    one.ask(r#"{"do":"reset"}"#);
    let said = one.say(SCRIPT);
    assert_eq!(said.matches(r#""ok":true"#).count(), SCRIPT.lines().count(), "{said}");
    assert!(said.contains(r#""kind":"struck""#) && said.contains(r#""kind":"answered""#), "{said}");
    let mut other = Desk::new(&["xm430-w350:1,2"]);
    other.ask(r#"{"do":"reset"}"#);
    assert_eq!(other.say(SCRIPT), said);
    // Half of another story, cut off by a reset.
    one.say(SCRIPT.lines().rev().collect::<Vec<_>>().join("\n").as_str());
    one.ask(r#"{"do":"unplug","line":"bus"}"#);
    one.ask(r#"{"do":"reset"}"#);
    assert_eq!(one.say(SCRIPT), said);
}

#[test]
fn the_rust_api_has_the_same_verbs() {
    let mut desk = Desk::new(&["xm430-w350:1"]);
    let mut world = world(&["xm430-w350:1"]);
    desk.ask(r#"{"do":"hand","joint":"joint_1","to_rad":0.4,"torque_nm":0.5,"speed_rad_s":2}"#);
    let hand = Hand { to_rad: 0.4, speed_rad_s: 2.0, torque_nm: 0.5, holds_on: false };
    world.take_by_hand("joint_1", hand).unwrap();
    let silent = Fault::Silent { joint: "joint_1".to_string(), from_ns: 0, until_ns: u64::MAX };
    let number = world.begin(&[silent]).unwrap();
    desk.ask(r#"{"do":"fault","kind":"silent","joint":"joint_1"}"#);
    desk.step(0.1);
    world.step(100_000_000).unwrap();
    world.end(number).unwrap();
    desk.ask(r#"{"do":"end","fault":0}"#);
    assert_eq!(world.joint_state("joint_1").unwrap(), desk.world.joint_state("joint_1").unwrap());
    let entries = |world: &World| world.journal().since(0).cloned().collect::<Vec<_>>();
    assert_eq!(entries(&world), entries(&desk.world));
    assert!(!entries(&world).is_empty());
}

#[test]
fn what_was_asked_is_kept_with_its_time_and_counted() {
    let mut desk = Desk::new(&["xm430-w350:1,2"]);
    desk.step(1.0);
    desk.ping(1);
    let (now_ns, baud_bps) = (desk.world.now_ns(), 57_600);
    let goal = instruction(2, 3, &[116, 0, 0, 8, 0, 0]);
    desk.world.transmit(0, &goal, baud_bps);
    desk.step(0.1);
    let goals = crate::scene::sync_write_goals(&[(1, 2100), (2, 2200)]);
    desk.world.transmit(0, &goals, baud_bps);
    desk.step(0.1);
    // Ten bits to a byte.
    let end_s = now_ns as f64 * 1e-9 + goal.len() as f64 * 10.0 / f64::from(baud_bps);
    let log = desk.ask(r#"{"do":"log","kind":"asked","instruction":"write"}"#);
    assert!(
        log.contains(r#""id":2,"instruction":"write","address":116,"register":"Goal Position""#)
    );
    let at = log.split(r#""at_s":"#).nth(1).unwrap().split(',').next().unwrap();
    assert!((at.parse::<f64>().unwrap() - end_s).abs() < 1e-6, "{at} {end_s}");
    assert!(desk.ask(r#"{"do":"log","instruction":"sync-write"}"#).contains(r#""ids":[1,2]"#));
    for (filter, count) in [
        (r#""kind":"asked""#, 3.0),
        (r#""kind":"asked","id":1"#, 2.0),
        (r#""kind":"asked","id":2"#, 2.0),
        (r#""joint":"joint_2","address":116"#, 2.0),
        (r#""instruction":"ping""#, 1.0),
        (r#""kind":"answered","id":1"#, 1.0),
        (r#""kind":"answered""#, 2.0),
        (r#""kind":"torque""#, 0.0),
    ] {
        let counted = desk.number(&format!(r#"{{"do":"count",{filter}}}"#), "count");
        assert_eq!(counted, count, "{filter}: {}", desk.ask(r#"{"do":"log"}"#));
    }
}

#[test]
fn what_is_said_at_a_speed_that_no_servo_is_set_to_was_not_asked() {
    let mut desk = Desk::new(&["xm430-w350:1"]);
    desk.step(1.0);
    for baud_bps in [9_600, 115_200, 4_000_000, 57_600] {
        desk.world.transmit(0, &instruction(1, 1, &[]), baud_bps);
        desk.step(0.1);
    }
    for (kind, count) in [("asked", 1.0), ("answered", 1.0)] {
        let counted = desk.number(&format!(r#"{{"do":"count","kind":"{kind}"}}"#), "count");
        assert_eq!(counted, count, "{kind}: {}", desk.ask(r#"{"do":"log"}"#));
    }
}

#[test]
fn whoever_waits_is_answered_when_it_has_come_or_when_it_is_too_late() {
    let mut desk = Desk::new(&["xm430-w350:1"]);
    desk.session.hear(b"{\"tag\":7,\"do\":\"wait\",\"instruction\":\"ping\",\"count\":2}\n");
    desk.session.hear(b"{\"do\":\"freeze\"}\n");
    for _ in 0..2 {
        desk.session.work(&mut desk.world, desk.now);
        assert!(desk.session.output().is_empty() && desk.session.is_expectant());
        desk.world.transmit(0, &instruction(1, 1, &[]), 57_600);
        desk.world.step(100_000_000).unwrap();
    }
    let said = desk.say("");
    assert!(said.starts_with(r#"{"tag":7,"ok":true,"count":2,"entry":{"n":"#), "{said}");
    assert_eq!(said.lines().count(), 2, "then the next request is served: {said}");

    desk.session.hear(b"{\"do\":\"wait\",\"instruction\":\"reboot\",\"timeout_s\":3}\n");
    desk.session.work(&mut desk.world, Duration::from_secs(1));
    desk.session.work(&mut desk.world, Duration::from_millis(3999));
    assert!(desk.session.output().is_empty());
    desk.session.work(&mut desk.world, Duration::from_secs(4));
    let said = String::from_utf8(desk.session.output().to_vec()).unwrap();
    assert!(said.contains(r#""got":"0 within 3 s""#), "{said}");
}

#[test]
fn whoever_subscribes_hears_of_it_and_of_nothing_else() {
    let mut desk = Desk::new(&["xm430-w350:1"]);
    desk.ask(r#"{"do":"subscribe","kind":"torque"}"#);
    let said = desk.say(
        r#"{"do":"set","joint":"joint_1","register":"Torque Enable","value":1}
{"do":"step","for_s":0.1}"#,
    );
    let events: Vec<&str> = said.lines().filter(|line| line.starts_with(r#"{"event""#)).collect();
    assert_eq!(events.len(), 1, "{said}");
    assert!(events[0].contains(r#""kind":"torque","joint":"joint_1","on":true"#), "{said}");
    desk.ask(r#"{"do":"unsubscribe"}"#);
    let said = desk.say(r#"{"do":"unplug","joint":"joint_1"}"#);
    assert_eq!(said, "{\"ok\":true}\n");
}

#[test]
fn what_is_no_request_is_refused_in_words_and_counted() {
    let mut desk = Desk::new(&["xm430-w350:1"]);
    let garbage = [
        "x",
        "{",
        "[]",
        "1",
        "null",
        "{}",
        "\u{1}",
        r#"{"do":7}"#,
        r#"{"do":"dance"}"#,
        r#"{"do":"reset","joint":1}"#,
        r#"{"do":"step"}"#,
        r#"{"do":"step","for_s":1e9}"#,
        r#"{"do":"step","for_s":null}"#,
        r#"{"version":2,"do":"about"}"#,
        r#"{"do":"hand","joint":"joint_1","to_rad":1,"speed_rad_s":0}"#,
        r#"{"do":"hand","joint":"joint_1","to_rad":1e300}"#,
        r#"{"do":"send","line":"bus","bytes":"fff"}"#,
        r#"{"do":"send","line":"bus","bytes":"zz"}"#,
        r#"{"do":"log","kind":"rumour"}"#,
        r#"{"do":"wait","count":0}"#,
    ];
    for line in garbage {
        let said = desk.refused(line);
        assert!(said.contains(r#""allowed":""#), "{said}");
    }
    desk.session.hear(&[0xFF, 0xFE, b'\n']);
    assert!(desk.say("").contains("UTF-8"));
    let long = "x".repeat(70_000);
    assert_eq!(desk.refused(&long).lines().count(), 1);
    let deep = format!("{{\"do\":{}", "[".repeat(60_000));
    desk.refused(&deep);
    let refused = garbage.len() as f64 + 3.0;
    assert_eq!(desk.number(r#"{"do":"about"}"#, "refused"), refused);
}

#[test]
fn a_program_that_never_reads_costs_no_more_than_its_share() {
    let mut desk = Desk::new(&["xm430-w350:1"]);
    desk.session.hear(b"{\"do\":\"subscribe\"}\n");
    let mut most = 0;
    for _ in 0..20_000 {
        if desk.session.is_hungry() {
            desk.session.hear(b"{\"do\":\"get\",\"joint\":\"joint_1\"}\n{\"do\":\"log\"}\n");
        }
        desk.world.transmit(0, &instruction(1, 1, &[]), 57_600);
        desk.world.step(10_000_000).unwrap();
        desk.session.work(&mut desk.world, desk.now);
        most = most.max(desk.session.output().len());
    }
    assert!(!desk.session.is_hungry(), "nothing more is taken of it");
    assert!(most < 3 << 20, "{most} bytes wait for it");
    // Once it reads it is served again, and told how much it has missed.
    let said = desk.say(r#"{"do":"about"}"#) + &desk.say(r#"{"do":"about"}"#);
    let dropped = said.rsplit(r#""dropped":"#).next().unwrap().trim_end_matches("}\n");
    assert!(dropped.parse::<u64>().unwrap() > 0, "{dropped}");
    assert!(said.contains(r#""lost":"#));
}

#[test]
fn a_thousand_resets_leave_nothing_behind() {
    let mut desk = Desk::new(&["xm430-w350:1-20"]);
    let first = desk.ask(r#"{"do":"reset"}"#) + &desk.say(r#"{"do":"log"}"#);
    for _ in 0..1000 {
        desk.ping(3);
        desk.ask(r#"{"do":"reset"}"#);
    }
    assert_eq!(desk.ask(r#"{"do":"reset"}"#) + &desk.say(r#"{"do":"log"}"#), first);
    assert_eq!(desk.world.resets(), 1002);
}

// The doors: time that is stopped, and a reset under the feet of a program.

fn open(world: World) -> (Arc<Mutex<World>>, Door, std::net::TcpStream) {
    let world = Arc::new(Mutex::new(world));
    let door = Door::open_tcp(Arc::clone(&world), 0, "127.0.0.1:0".parse().unwrap()).unwrap();
    let address = door.path().display().to_string();
    let port = std::net::TcpStream::connect(&address["tcp:".len()..]).unwrap();
    port.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
    (world, door, port)
}

fn folder(name: &str) -> PathBuf {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).unwrap();
    folder
}

fn ask(stream: &UnixStream, request: &str) -> String {
    writeln!(&mut &*stream, "{request}").unwrap();
    stream.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
    let mut said = String::new();
    BufReader::new(stream).read_line(&mut said).unwrap();
    said
}

#[test]
fn behind_a_door_frozen_time_holds_the_answer_back_until_it_is_stepped() {
    let (world, door, mut port) = open(world(&["xm430-w350:1"]));
    let path = folder("control-frozen").join("c");
    let _socket = ControlSocket::listen(world, Surroundings::default(), &path).unwrap();
    let stream = UnixStream::connect(&path).unwrap();
    assert!(ask(&stream, r#"{"do":"step","for_s":1}"#).contains("time runs"));
    assert!(ask(&stream, r#"{"do":"freeze"}"#).contains("true"));
    port.write_all(&instruction(1, 1, &[])).unwrap();
    let mut answer = [0; 14];
    port.set_read_timeout(Some(Duration::from_millis(300))).unwrap();
    assert!(port.read_exact(&mut answer).is_err(), "no time has passed");
    port.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
    // The answer is there at once: the door does not sleep over it.
    ask(&stream, r#"{"do":"step","for_s":0.1}"#);
    port.read_exact(&mut answer).unwrap();
    assert_eq!(answer[..5], [0xFF, 0xFF, 0xFD, 0, 1]);
    ask(&stream, r#"{"do":"run"}"#);
    port.write_all(&instruction(1, 1, &[])).unwrap();
    port.read_exact(&mut answer).unwrap();
    assert!(
        ask(&stream, r#"{"do":"wait","instruction":"ping","count":2}"#).contains(r#""count":2"#)
    );
    drop(door);
}

#[test]
fn behind_a_door_a_reset_begins_time_anew_and_the_program_stays_connected() {
    let (world, _door, mut port) = open(world(&["xm430-w350:1"]));
    let path = folder("control-reset").join("c");
    let _socket = ControlSocket::listen(world, Surroundings::default(), &path).unwrap();
    let stream = UnixStream::connect(&path).unwrap();
    for _ in 0..50 {
        port.write_all(&instruction(1, 3, &[64, 0, 1])).unwrap();
        let mut answer = [0; 11];
        port.read_exact(&mut answer).unwrap();
        assert_eq!(answer[8], 0, "no error");
        assert!(ask(&stream, r#"{"do":"state","joint":"joint_1"}"#).contains(r#""torque":true"#));
        ask(&stream, r#"{"do":"reset"}"#);
        assert!(ask(&stream, r#"{"do":"state","joint":"joint_1"}"#).contains(r#""torque":false"#));
    }
    assert!(ask(&stream, r#"{"do":"about"}"#).contains(r#""resets":50"#));
}

#[test]
fn the_socket_is_the_users_alone_and_gone_at_the_end() {
    let folder = folder("control-mode");
    let path = folder.join("c");
    let world = Arc::new(Mutex::new(world(&["xm430-w350:1"])));
    let listen = || ControlSocket::listen(Arc::clone(&world), Surroundings::default(), &path);
    let socket = listen().unwrap();
    let mode = fs::symlink_metadata(&path).unwrap().permissions().mode();
    assert_eq!(mode & 0o777, 0o600);
    assert_eq!(fs::read_dir(&folder).unwrap().count(), 1, "nothing else is left in the folder");
    assert!(listen().unwrap_err().to_string().contains("is there already"));
    drop(socket);
    assert!(!path.exists());
    // What somebody else has there stays.
    fs::write(&path, "mine").unwrap();
    assert!(listen().is_err());
    assert_eq!(fs::read_to_string(&path).unwrap(), "mine");
    fs::remove_file(&path).unwrap();
    // A socket at which nobody listens any more makes room.
    drop(std::os::unix::net::UnixListener::bind(&path).unwrap());
    drop(listen().unwrap());
    let too_long = folder.join("c".repeat(120));
    let refused = ControlSocket::listen(Arc::clone(&world), Surroundings::default(), &too_long);
    assert!(refused.is_err());
}

#[test]
fn a_crowd_at_the_socket_is_sent_away_and_those_inside_are_served() {
    let path = folder("control-crowd").join("c");
    let world = Arc::new(Mutex::new(world(&["xm430-w350:1"])));
    let _socket = ControlSocket::listen(world, Surroundings::default(), &path).unwrap();
    let inside: Vec<UnixStream> = (0..8).map(|_| UnixStream::connect(&path).unwrap()).collect();
    for stream in &inside {
        assert!(ask(stream, r#"{"do":"about"}"#).contains("joint_1"));
    }
    let mut outside = UnixStream::connect(&path).unwrap();
    outside.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
    let mut said = String::new();
    outside.read_to_string(&mut said).unwrap();
    assert!(said.contains("one program too many"), "{said}");
    // One never reads, one talks nonsense and one dies: the others are served.
    let mut mute = &inside[0];
    mute.set_nonblocking(true).unwrap();
    inside[1].set_nonblocking(true).unwrap();
    let began = Instant::now();
    while began.elapsed() < Duration::from_millis(500) {
        let _ = mute.write(b"{\"do\":\"log\"}\n{\"do\":\"get\",\"joint\":\"joint_1\"}\n");
        let _ = (&inside[1]).write(b"\xff\xfe{{{\n");
        assert!(ask(&inside[2], r#"{"do":"reset"}"#).contains("true"));
    }
    drop(inside);
    let again = UnixStream::connect(&path).unwrap();
    assert!(ask(&again, r#"{"do":"about"}"#).contains("joint_1"));
}

#[test]
fn the_virtual_robots_of_the_shelf_are_told_about() {
    let robot = profiles::robot("poppy-humanoid").unwrap();
    let mut world = World::new(&robot, Options::default()).unwrap();
    let surroundings = Surroundings { robot: robot.name.clone(), ..Surroundings::default() };
    surroundings.places.set(vec![Some("/dev/pts/4".to_string()), None]);
    let mut session = Session::new(surroundings);
    session.hear(b"{\"do\":\"about\",\"tag\":[1,\"a\"]}\n");
    session.work(&mut world, Duration::ZERO);
    let said = String::from_utf8(session.output().to_vec()).unwrap();
    assert!(said.starts_with(r#"{"tag":[1,"a"],"ok":true,"version":1,"robot":"poppy-humanoid""#));
    assert!(said.contains(r#""place":"/dev/pts/4""#) && said.contains(r#""place":null"#), "{said}");
    assert_eq!(said.matches(r#""servo":""#).count(), robot.joints.len());
}

/// Lines of the example, with its times masked.
fn example() -> Vec<String> {
    let text = fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/README.md")).unwrap();
    let (_, after) = text.split_once("nc -U").unwrap();
    let (_, block) = after.split_once("```json\n").unwrap();
    block.split("```").next().unwrap().lines().map(without_times).collect()
}

fn without_times(line: &str) -> String {
    match line.split_once(r#""at_s":"#) {
        None => line.to_string(),
        Some((before, after)) => {
            format!("{before}at{}", &after[after.find([',', '}']).unwrap()..])
        }
    }
}

#[test]
fn the_example_of_the_readme_is_what_is_said() {
    let robot = profiles::robot("so101").unwrap();
    let mut world = World::new(&robot, Options::default()).unwrap();
    world.keep_journal(true);
    let mut desk =
        Desk { world, session: Session::new(Surroundings::default()), now: Duration::ZERO };
    let example = example();
    assert!(example.len() > 10);
    for pair in example.chunks(2) {
        if pair[0].contains("wait") {
            let baud_bps = desk.world.line_baud_bps(0).unwrap();
            desk.world.transmit(0, &[0xFF, 0xFF, 6, 2, 1, 0xF6], baud_bps);
            desk.step(0.01);
        }
        assert_eq!(without_times(desk.say(&pair[0]).trim_end()), pair[1]);
    }
}
